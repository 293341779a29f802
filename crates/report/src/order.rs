//! Names in the order of their numbers: `c2` before `c10`.

use std::collections::BTreeMap;

/// The entries of a map, those that differ in a number at their end by that number.
pub(crate) fn by_number<T>(of: &BTreeMap<String, T>) -> Vec<(&String, &T)> {
    let mut all: Vec<_> = of.iter().collect();
    // the sort is stable: names without a number stay as they are
    all.sort_by(|(a, _), (b, _)| parts(a).cmp(&parts(b)));
    all
}

fn parts(name: &str) -> (&str, Option<u64>) {
    let word = name.trim_end_matches(|c: char| c.is_ascii_digit());
    (word, name[word.len()..].parse().ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coefficients_are_in_the_order_of_their_numbers() {
        let names = ["at_s", "c0", "c1", "c10", "c11", "c2", "half"];
        let map: BTreeMap<String, ()> = names.map(|name| (name.to_owned(), ())).into();
        let sorted: Vec<&str> = by_number(&map).iter().map(|(n, ())| n.as_str()).collect();
        assert_eq!(sorted, ["at_s", "c0", "c1", "c2", "c10", "c11", "half"]);
    }
}
