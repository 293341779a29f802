//! Rust sources as far as the checks need them: without comments, without their
//! tests, and with `use` trees written out.

/// A source without comments and without `#[cfg(test)]` modules. What is left
/// out becomes blanks, so that every line keeps its number.
pub(crate) struct Code {
    /// With the contents of strings.
    text: String,
    /// Without the contents of strings and characters.
    bones: String,
    /// Every path that a `use` names, in full, and the line of the statement.
    uses: Vec<(usize, String)>,
}

impl Code {
    pub(crate) fn new(source: &str) -> Self {
        let (mut text, mut bones) = blank(source);
        for (start, end) in test_modules(&bones) {
            blank_out(&mut text, start, end);
            blank_out(&mut bones, start, end);
        }
        let uses = uses(&bones);
        Self { text, bones, uses }
    }

    /// Lines (1-based) that name this: an identifier or a path with `::` in code
    /// or in `use`, anything else (`truth.json`) also in strings.
    pub(crate) fn naming(&self, name: &str) -> Vec<usize> {
        let is_path = name.chars().all(|c| is_word(c) || c == ':' || c == '!');
        let text = if is_path { &self.bones } else { &self.text };
        let mut lines: Vec<usize> = text
            .lines()
            .enumerate()
            .filter(|(_, line)| contains_word(line, name))
            .map(|(index, _)| index + 1)
            .collect();
        let below = format!("{name}::");
        lines.extend(
            self.uses
                .iter()
                .filter(|(_, path)| path == name || path.starts_with(&below))
                .map(|(line, _)| *line),
        );
        lines.sort_unstable();
        lines.dedup();
        lines
    }
}

/// Whether the source defines an item of this name, and whether it is a test.
pub(crate) fn defines(source: &str, name: &str) -> Option<Item> {
    let (_, bones) = blank(source);
    let lines: Vec<&str> = bones.lines().collect();
    let at = lines.iter().position(|line| {
        [
            "fn", "struct", "enum", "trait", "const", "static", "type", "mod",
        ]
        .iter()
        .any(|keyword| {
            line.split_once(&format!("{keyword} "))
                .is_some_and(|(before, after)| {
                    !before.ends_with(is_word)
                        && after
                            .trim_start()
                            .strip_prefix(name)
                            .is_some_and(|rest| !rest.starts_with(is_word))
                })
        })
    })?;
    let is_test = lines[..at]
        .iter()
        .rev()
        .take_while(|line| line.trim().is_empty() || line.trim_start().starts_with("#["))
        .any(|line| line.trim() == "#[test]");
    Some(if is_test { Item::Test } else { Item::Other })
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Item {
    Test,
    Other,
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

fn contains_word(line: &str, word: &str) -> bool {
    line.match_indices(word).any(|(at, _)| {
        let free_before = !line[..at].ends_with(is_word) || !word.starts_with(is_word);
        let free_after = !line[at + word.len()..].starts_with(is_word) || !word.ends_with(is_word);
        free_before && free_after
    })
}

/// The source without comments, and the same without the contents of strings,
/// byte for byte in the same places.
fn blank(source: &str) -> (String, String) {
    let chars: Vec<char> = source.chars().collect();
    let (mut text, mut bones) = (String::new(), String::new());
    let mut at = 0;
    while at < chars.len() {
        let comment = comment_end(&chars, at);
        let literal = literal_end(&chars, at);
        if comment > at {
            for &c in &chars[at..comment] {
                text.push_str(&blanks(c));
                bones.push_str(&blanks(c));
            }
            at = comment;
        } else if literal > at {
            for (i, &c) in chars.iter().enumerate().take(literal).skip(at) {
                text.push(c);
                if i == at || i + 1 == literal {
                    bones.push(c);
                } else {
                    bones.push_str(&blanks(c));
                }
            }
            at = literal;
        } else {
            text.push(chars[at]);
            bones.push(chars[at]);
            at += 1;
        }
    }
    (text, bones)
}

/// As many blanks as the character has bytes; the end of a line stays.
fn blanks(c: char) -> String {
    if c == '\n' {
        c.to_string()
    } else {
        " ".repeat(c.len_utf8())
    }
}

/// The end of the comment that starts here; `at` itself where none does.
fn comment_end(chars: &[char], at: usize) -> usize {
    if chars[at..].starts_with(&['/', '/']) {
        return position(chars, at, |rest| rest[0] == '\n');
    }
    if !chars[at..].starts_with(&['/', '*']) {
        return at;
    }
    let (mut depth, mut i) = (0_usize, at);
    while i < chars.len() {
        if chars[i..].starts_with(&['/', '*']) {
            depth += 1;
            i += 2;
        } else if chars[i..].starts_with(&['*', '/']) {
            depth -= 1;
            i += 2;
            if depth == 0 {
                return i;
            }
        } else {
            i += 1;
        }
    }
    i
}

/// The end of the string or character that starts here; `at` where none does.
fn literal_end(chars: &[char], at: usize) -> usize {
    let rest = &chars[at..];
    let after_word = at > 0 && is_word(chars[at - 1]);
    if rest[0] == 'r' && !after_word {
        let hashes = rest[1..].iter().take_while(|&&c| c == '#').count();
        if rest.get(1 + hashes) == Some(&'"') {
            let mut close = vec!['"'];
            close.extend(vec!['#'; hashes]);
            let end = position(chars, at + 2 + hashes, |rest| rest.starts_with(&close));
            return (end + close.len()).min(chars.len());
        }
    }
    match rest {
        ['"', ..] => quoted_end(chars, at, '"'),
        // A lifetime is no character: 'a' is, 'a is not.
        ['\'', '\\', ..] | ['\'', _, '\'', ..] => quoted_end(chars, at, '\''),
        _ => at,
    }
}

fn quoted_end(chars: &[char], at: usize, quote: char) -> usize {
    let mut i = at + 1;
    while i < chars.len() {
        match chars[i] {
            '\\' => i += 2,
            c if c == quote => return i + 1,
            _ => i += 1,
        }
    }
    chars.len()
}

fn position(chars: &[char], from: usize, found: impl Fn(&[char]) -> bool) -> usize {
    (from..chars.len())
        .find(|&i| found(&chars[i..]))
        .unwrap_or(chars.len())
}

/// Byte ranges of `#[cfg(test)] mod name { .. }`.
fn test_modules(bones: &str) -> Vec<(usize, usize)> {
    const MARK: &str = "#[cfg(test)]";
    bones
        .match_indices(MARK)
        .filter_map(|(start, _)| {
            let open = start + bones[start..].find('{')?;
            let head = &bones[start + MARK.len()..open];
            (head.split_whitespace().any(|word| word == "mod") && !head.contains(';'))
                .then(|| (start, closing(bones, open)))
        })
        .collect()
}

/// The byte after the brace that closes the one at `open`.
fn closing(bones: &str, open: usize) -> usize {
    let mut depth = 0_usize;
    for (at, c) in bones[open..].char_indices() {
        match c {
            '{' => depth += 1,
            '}' => {
                depth -= 1;
                if depth == 0 {
                    return open + at + 1;
                }
            }
            _ => {}
        }
    }
    bones.len()
}

fn blank_out(text: &mut String, start: usize, end: usize) {
    let blank: String = text[start..end].chars().map(blanks).collect();
    text.replace_range(start..end, &blank);
}

/// Every path of every `use`, written out.
fn uses(bones: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    for (at, _) in bones.match_indices("use ") {
        if bones[..at].ends_with(is_word) {
            continue;
        }
        let Some(length) = bones[at..].find(';') else {
            continue;
        };
        let line = bones[..at].matches('\n').count() + 1;
        let mut paths = Vec::new();
        write_out("", &bones[at + 4..at + length], &mut paths);
        found.extend(paths.into_iter().map(|path| (line, path)));
    }
    found
}

/// `a::{b, c::{d, self}}` to `a::b`, `a::c::d`, `a::c`.
fn write_out(front: &str, tree: &str, out: &mut Vec<String>) {
    let tree = tree.trim().trim_start_matches("::");
    let Some(open) = tree.find('{') else {
        let leaf = tree.split(" as ").next().unwrap_or(tree).trim();
        let path = format!("{front}{leaf}");
        let path = path.trim_end_matches("::self").to_owned();
        if !leaf.is_empty() {
            out.push(path);
        }
        return;
    };
    let front = format!("{front}{}", &tree[..open]);
    let inside = tree[open + 1..closing(tree, open)].trim_end_matches('}');
    // Trimmed braces may have closed inner groups too: they only end leaves.
    let (mut depth, mut start) = (0_i32, 0);
    for (at, c) in inside.char_indices() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                write_out(&front, &inside[start..at], out);
                start = at + 1;
            }
            _ => {}
        }
    }
    write_out(&front, &inside[start..], out);
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOURCE: &str = "\
//! Does not use rand_xoshiro, says this header.
use std::{collections::BTreeMap, fs::{self, File}, io as inout};
use nalgebra::{Vector3, base::{Matrix, dimension::{U1, U2}}}; /* /* std::net */ */

/// Reads `truth.json`.
fn read<'a>(name: &'a str) -> char {
    let _ = r#\"a \"quoted\" rand_core\"#;
    let _ = (\"truth.json // no comment\", 'x', '\\'', '{');
    std::process::exit(0)
}

#[cfg(test)]
mod tests {
    use rand_xoshiro::Xoshiro256PlusPlus; // { in a comment
    const TEXT: &str = \"} µ\";

    #[test]
    fn rounds() {}
}

const AFTER: i32 = 0;
";

    #[test]
    fn uses_are_written_out() {
        let code = Code::new(SOURCE);
        let paths: Vec<_> = code.uses.iter().map(|(_, path)| path.as_str()).collect();
        assert_eq!(
            paths,
            [
                "std::collections::BTreeMap",
                "std::fs",
                "std::fs::File",
                "std::io",
                "nalgebra::Vector3",
                "nalgebra::base::Matrix",
                "nalgebra::base::dimension::U1",
                "nalgebra::base::dimension::U2",
            ]
        );
    }

    #[test]
    fn names_are_found_in_code_alone() {
        let code = Code::new(SOURCE);
        assert_eq!(code.naming("std::fs"), [2]);
        assert_eq!(code.naming("std::io"), [2]);
        assert_eq!(code.naming("std::process"), [9]);
        assert_eq!(code.naming("truth.json"), [8]);
        assert_eq!(code.naming("AFTER"), [21]);
        for absent in [
            "rand_xoshiro",
            "rand_core",
            "std::net",
            "std::f",
            "no comment",
            "process::ex",
            "TEXT",
        ] {
            let expected: &[usize] = if absent == "no comment" { &[8] } else { &[] };
            assert_eq!(code.naming(absent), expected, "{absent}");
        }
    }

    #[test]
    fn macros_can_be_named() {
        let code = Code::new("fn f() { println!(\"eprintln!\"); }");
        assert_eq!(code.naming("println!"), [1]);
        assert!(code.naming("eprintln!").is_empty());
    }

    #[test]
    fn tests_are_told_from_other_items() {
        assert_eq!(defines(SOURCE, "rounds"), Some(Item::Test));
        assert_eq!(defines(SOURCE, "read"), Some(Item::Other));
        assert_eq!(defines(SOURCE, "AFTER"), Some(Item::Other));
        assert_eq!(defines(SOURCE, "round"), None);
        assert_eq!(defines(SOURCE, "name"), None);
        assert_eq!(defines("// fn gone() {}", "gone"), None);
        let ignored = "#[test]\n#[ignore]\n/// Doc.\nfn slow() {}";
        assert_eq!(defines(ignored, "slow"), Some(Item::Test));
        let apart = "#[test]\nfn a() {}\nfn b() {}";
        assert_eq!(defines(apart, "b"), Some(Item::Other));
    }
}
