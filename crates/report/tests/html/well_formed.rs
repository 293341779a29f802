//! Whether a page is one that any XML parser reads.

use std::collections::BTreeSet;

/// Every tag closed, every attribute quoted, every entity one of XML's: any XML parser reads it.
pub(crate) fn well_formed(text: &str) -> Result<(), String> {
    let rest = text
        .strip_prefix("<!DOCTYPE html>")
        .ok_or("no document type")?;
    let mut open: Vec<&str> = vec![];
    let mut pieces = rest.split('<');
    let before = pieces.next().unwrap_or_default();
    if !before.trim().is_empty() {
        return Err(format!("text before the root: {before:?}"));
    }
    for piece in pieces {
        let (tag, words) = piece
            .split_once('>')
            .ok_or_else(|| format!("no end: {piece:?}"))?;
        if words.contains('>') {
            return Err(format!("a bare > in {words:?}"));
        }
        for part in [tag, words] {
            entities(part)?;
        }
        if let Some(name) = tag.strip_prefix('/') {
            if open.pop() != Some(name) {
                return Err(format!("</{name}> closes another element"));
            }
            continue;
        }
        let (tag, empty) = match tag.strip_suffix('/') {
            Some(tag) => (tag, true),
            None => (tag, false),
        };
        let (name, attributes) = tag.split_once(' ').unwrap_or((tag, ""));
        let mut seen = BTreeSet::new();
        let mut rest = attributes.trim_start();
        while !rest.is_empty() {
            let (key, after) = rest
                .split_once("=\"")
                .ok_or_else(|| format!("in <{tag}>"))?;
            let (_, after) = after.split_once('"').ok_or_else(|| format!("in <{tag}>"))?;
            if key.is_empty() || key.contains(char::is_whitespace) || !seen.insert(key) {
                return Err(format!("attribute {key:?} in <{tag}>"));
            }
            rest = after.trim_start();
        }
        if !empty {
            open.push(name);
        }
    }
    match open.as_slice() {
        [] => Ok(()),
        left => Err(format!("left open: {left:?}")),
    }
}

fn entities(text: &str) -> Result<(), String> {
    if let Some(c) = text
        .chars()
        .find(|c| c.is_control() && *c != '\n' && *c != '\t')
    {
        return Err(format!("{c:?} in {text:?}"));
    }
    for after in text.split('&').skip(1) {
        let name = after.split(';').next().unwrap_or_default();
        if !["amp", "lt", "gt", "quot", "#39"].contains(&name) {
            return Err(format!("&{name};"));
        }
    }
    Ok(())
}

#[test]
fn the_checker_finds_what_is_broken() {
    let ok = "<!DOCTYPE html>\n<p a=\"1\">x &amp; y<br/></p>\n";
    assert_eq!(well_formed(ok), Ok(()));
    for (from, to) in [
        ("</p>", ""),
        ("&amp;", "&"),
        ("<br/>", "<br>"),
        ("\"1\"", "1"),
        ("x", "\u{1}"),
    ] {
        assert!(well_formed(&ok.replace(from, to)).is_err(), "{from}");
    }
}
