//! The page in `docs/`, and whether it is current.
//!
//! Numbers are printed to three digits. Two machines whose mathematical libraries differ in the last
//! bit may round one of them differently: pages are the same if their words are, and each pair of
//! numbers differs by no more than one in the last printed digit.
//!
//! Not physics: text.

use crate::row::{Group, Verdict};

/// The page for these groups.
#[must_use]
pub fn page(groups: &[Group]) -> String {
    let mut text = String::from(
        "# The papers' claims, computed\n\n\
         Made by `cargo xtask paper`; `cargo xtask paper --check` fails if this page is not what the \
         code computes, or if a row's verdict has changed. Nothing here is tuned: inputs are the \
         paper's numbers, and what it leaves out is an assumption that the row names. A verdict is one of\n\n\
         - **reproduced**: the same number or shape comes out;\n\
         - **consistent**: within the spread of what the paper leaves open;\n\
         - **not reproducible from the paper**: it hangs on something that is not printed;\n\
         - **contradicts**: it cannot be so.\n\n\
         No flight data are published. Where the paper compares with measurements, the measured side is a \
         simulated flight with effects that the model under test lacks, and the row says which. Ranges in \
         brackets run over what is not printed, the least to the greatest. The same seeds give the same \
         page, whatever the number of threads; times, which vary, are printed by the command and are not \
         on this page. E1 to E21 are in [errata.md](errata.md).\n\n",
    );
    for verdict in [
        Verdict::Reproduced,
        Verdict::Consistent,
        Verdict::NotReproducible,
        Verdict::Contradicts,
    ] {
        let rows = groups.iter().flat_map(|group| &group.rows);
        let n = rows.filter(|row| row.verdict == verdict).count();
        text.push_str(&format!("{n} {verdict}. "));
    }
    text.push('\n');
    for Group { title, about, rows } in groups {
        text.push_str(&format!(
            "\n## {title}\n\n{about}\n\n\
             | claim | the paper | here | under | tolerance | verdict |\n|---|---|---|---|---|---|\n"
        ));
        for row in rows {
            let cells = [&row.id, &row.paper, &row.ours, &row.under, &row.tolerance];
            for cell in cells {
                text.push_str(&format!("| {} ", cell.replace('|', "\\|")));
            }
            text.push_str(&format!("| {} |\n", row.verdict));
        }
    }
    text
}

/// Whether two pages say the same; otherwise the first line of `new` that `old` has not.
///
/// # Errors
/// That line, 1-based, with its text in `new`.
pub fn same(old: &str, new: &str) -> Result<(), (usize, String)> {
    let mut old_lines = old.lines();
    for (index, line) in new.lines().enumerate() {
        if !old_lines.next().is_some_and(|old| close(old, line)) {
            return Err((index + 1, line.to_owned()));
        }
    }
    match old_lines.next() {
        Some(_) => Err((new.lines().count() + 1, String::new())),
        None => Ok(()),
    }
}

fn close(a: &str, b: &str) -> bool {
    let (mut a, mut b) = (Pieces(a), Pieces(b));
    loop {
        match (a.next(), b.next()) {
            (None, None) => return true,
            (Some(a), Some(b)) if a == b => {}
            (Some(a), Some(b)) => {
                let (Ok(x), Ok(y)) = (a.parse::<f64>(), b.parse::<f64>()) else {
                    return false;
                };
                let decimals = |text: &str| text.split_once('.').map_or(0, |(_, d)| d.len());
                // 9.99 and 10.0 are neighbours: the coarser step of the two; of large numbers only
                // three digits count
                let fewest = decimals(a).min(decimals(b));
                let third = x.abs().max(y.abs()).max(1.0).log10().floor() - 2.0;
                let step = 10_f64.powf(third.max(0.0)) * 0.1_f64.powf(fewest as f64);
                if (x - y).abs() > 1.01 * step {
                    return false;
                }
            }
            _ => return false,
        }
    }
}

/// Numbers, with their sign, and what lies between them.
struct Pieces<'a>(&'a str);

/// Where the first number starts.
fn number_at(text: &str) -> usize {
    let bytes = text.as_bytes();
    let digit = |k: usize| bytes.get(k).is_some_and(u8::is_ascii_digit);
    let starts = |k: &usize| digit(*k) || (matches!(bytes[*k], b'+' | b'-') && digit(k + 1));
    (0..bytes.len()).find(starts).unwrap_or(bytes.len())
}

impl<'a> Iterator for Pieces<'a> {
    type Item = &'a str;

    fn next(&mut self) -> Option<&'a str> {
        if self.0.is_empty() {
            return None;
        }
        let end = match number_at(self.0) {
            0 => {
                let tail = |c: char| !(c.is_ascii_digit() || c == '.');
                let end = self.0[1..].find(tail).map_or(self.0.len(), |k| k + 1);
                // a point at the end of a sentence is none of the number's
                self.0[..end].trim_end_matches('.').len()
            }
            end => end,
        };
        let (piece, rest) = self.0.split_at(end);
        self.0 = rest;
        Some(piece)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::row::Row;

    #[test]
    fn only_the_last_digit_may_differ() {
        assert!(close("| 7.43 (6.1 to 161) |", "| 7.44 (6.1 to 160) |"));
        assert!(close("9.99 dB.", "10.0 dB.") && close("76900", "77000"));
        assert!(close("x -0.1, y +0.0 dB", "x +0.0, y -0.1 dB"));
        for (a, b) in [
            ("7.43", "7.45"),
            ("161 s", "163 s"),
            ("1230", "1250"),
            ("7.43", "-7.43"),
            ("reproduced", "contradicts"),
            ("E14", "E16"),
            ("a 1", "a 1 "),
        ] {
            assert!(!close(a, b), "{a} {b}");
        }
    }

    #[test]
    fn a_page_is_compared_line_by_line() {
        let row = Row {
            id: "size|shape".into(),
            paper: "1.0".into(),
            ours: "2.00".into(),
            under: "-".into(),
            tolerance: "-".into(),
            verdict: Verdict::Contradicts,
            expected: Verdict::Contradicts,
        };
        let mut groups = [Group {
            title: "One",
            about: "About.".into(),
            rows: vec![row],
        }];
        let old = page(&groups);
        assert!(old.contains("| size\\|shape | 1.0 | 2.00 | - | - | contradicts |"));
        assert_eq!(same(&old, &old), Ok(()));
        assert!(same(&old, &format!("{old}more\n")).is_err());
        assert!(same(&format!("{old}more\n"), &old).is_err());
        groups[0].rows[0].ours = "2.03".into();
        let (line, text) = same(&old, &page(&groups)).unwrap_err();
        assert_eq!(line, old.lines().count());
        assert!(text.contains("2.03"));
    }
}
