//! Where a value stands that turns out to be wrong only after the file was read.
//!
//! Not physics: reading a file.

use super::node::{Node, Table, Value};

/// The value at a dotted path. Of several tables of one name (`[[motion.slew]]`) the first that has this
/// `value` there, a number or the length of a vector; of a list of numbers the number itself.
pub(super) fn seek<'a>(root: &'a Table, path: &str, value: Option<f64>) -> Option<&'a Node> {
    let mut parts = path.split('.');
    let top = root.get(parts.next()?)?;
    let rest: Vec<&str> = parts.collect();
    let mut found = Vec::new();
    all(top, &rest, &mut found);
    let Some(value) = value else {
        return found.first().copied();
    };
    let same = |node: &&Node| is(node, value) || item(node, value).is_some();
    // a length is the surer sign: vectors share their zeros
    let sure = found.iter().copied().find(|node| is(node, value));
    let node = sure.or_else(|| found.iter().copied().find(same));
    let node = node.or_else(|| found.first().copied())?;
    match item(node, value) {
        Some(item) if !is(node, value) => Some(item),
        _ => Some(node),
    }
}

fn all<'a>(node: &'a Node, path: &[&str], found: &mut Vec<&'a Node>) {
    match (&node.value, path.split_first()) {
        (_, None) => found.push(node),
        (Value::Table(table), Some((first, rest))) => {
            if let Some(inner) = table.get(*first) {
                all(inner, rest, found);
            }
        }
        (Value::Array(items), Some(_)) => items.iter().for_each(|item| all(item, path, found)),
        _ => {}
    }
}

fn number(node: &Node) -> Option<f64> {
    match node.value {
        Value::Float(number) => Some(number),
        Value::Whole(number) => Some(number as f64),
        _ => None,
    }
}

/// Whether this is the number, or a vector of that length.
fn is(node: &Node, value: f64) -> bool {
    let own = match &node.value {
        Value::Array(items) => items
            .iter()
            .map(number)
            .try_fold(0.0, |sum, x| Some(x.map(|x| x * x)? + sum))
            .map(f64::sqrt),
        _ => number(node),
    };
    own.is_some_and(|own| equal(own, value))
}

fn item(node: &Node, value: f64) -> Option<&Node> {
    let Value::Array(items) = &node.value else {
        return None;
    };
    let same = |item: &&Node| number(item).is_some_and(|own| equal(own, value));
    items.iter().find(same)
}

fn equal(a: f64, b: f64) -> bool {
    a.total_cmp(&b).is_eq() || (a - b).abs() <= 1e-12 * b.abs() || a.is_nan() && b.is_nan()
}
