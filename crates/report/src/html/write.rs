//! The page as text: elements, escaping, and numbers that say where they come from.

use std::fmt::Write as _;

use figures::Figure;
use rayon::prelude::*;

use crate::number::short;

/// A page being written.
pub(super) struct Page {
    out: String,
}

/// A cell of a table.
pub(super) struct Cell {
    html: String,
    number: bool,
}

impl Cell {
    /// Words, escaped.
    pub(super) fn text(text: &str) -> Self {
        Self {
            html: escaped(text),
            number: false,
        }
    }

    /// A number, or a few words in its place; escaped.
    pub(super) fn number(text: &str) -> Self {
        Self {
            html: escaped(text),
            number: true,
        }
    }

    /// A number of `report.json`.
    pub(super) fn datum(key: &str, value: f64) -> Self {
        Self::html(datum(key, value, &short(value)))
    }

    /// Such a number that may be missing.
    pub(super) fn maybe(key: &str, value: Option<f64>) -> Self {
        value.map_or_else(|| Self::number("–"), |value| Self::datum(key, value))
    }

    /// Ready-made elements with a number in them.
    pub(super) fn html(html: String) -> Self {
        Self { html, number: true }
    }

    /// Ready-made elements with words in them.
    pub(super) fn words(html: String) -> Self {
        Self {
            html,
            number: false,
        }
    }
}

impl Page {
    pub(super) fn new(title: &str, style: &str) -> Self {
        Self {
            out: format!(
                "<!DOCTYPE html>\n<html xmlns=\"http://www.w3.org/1999/xhtml\" lang=\"en\"><head><meta charset=\"utf-8\"/><meta name=\"viewport\" content=\"width=device-width\"/><title>{}</title><style>{style}</style></head><body>\n",
                escaped(title)
            ),
        }
    }

    pub(super) fn finish(mut self) -> String {
        self.out.push_str("</body></html>\n");
        self.out
    }

    /// Parts of the page that know nothing of each other, in this order, each by the next free thread.
    pub(super) fn parts(&mut self, parts: &[&(dyn Fn(&mut Self) + Sync)]) {
        let written = parts.par_iter().with_max_len(1).map(|part| {
            let mut page = Self { out: String::new() };
            part(&mut page);
            page.out
        });
        self.out.extend(written.collect::<Vec<_>>());
    }

    /// Elements as they are.
    pub(super) fn raw(&mut self, html: &str) {
        self.out.push_str(html);
        self.out.push('\n');
    }

    /// Words, escaped.
    pub(super) fn paragraph(&mut self, text: &str) {
        self.raw(&format!("<p>{}</p>", escaped(text)));
    }

    pub(super) fn section(&mut self, id: &str, heading: &str, body: impl FnOnce(&mut Self)) {
        self.raw(&format!(
            "<section id=\"{id}\"><h2>{}</h2>",
            escaped(heading)
        ));
        body(self);
        self.raw("</section>");
    }

    /// A picture; the caption says how to read it.
    pub(super) fn figure(&mut self, figure: &Figure, caption: &str) {
        let svg = figure.svg();
        self.raw(&format!(
            "<figure>{}<figcaption>{}</figcaption></figure>",
            svg.trim_end(),
            escaped(caption)
        ));
    }

    /// A table; the first cell of each row is its heading.
    pub(super) fn table(&mut self, caption: &str, head: &[&str], rows: Vec<Vec<Cell>>) {
        let mut html = "<div class=\"wide\"><table>".to_owned();
        if !caption.is_empty() {
            // writing to a string cannot fail
            let _ = write!(html, "<caption>{}</caption>", escaped(caption));
        }
        html.push_str("<thead><tr>");
        for (k, name) in head.iter().enumerate() {
            let number = rows
                .first()
                .and_then(|row| row.get(k))
                .is_some_and(|cell| cell.number);
            let _ = write!(
                html,
                "<th scope=\"col\"{}>{}</th>",
                class(number),
                escaped(name)
            );
        }
        html.push_str("</tr></thead><tbody>");
        for row in rows {
            html.push_str("<tr>");
            for (k, cell) in row.iter().enumerate() {
                let tag = if k == 0 { "th scope=\"row\"" } else { "td" };
                let end = if k == 0 { "th" } else { "td" };
                let _ = write!(html, "<{tag}{}>{}</{end}>", class(cell.number), cell.html);
            }
            html.push_str("</tr>");
        }
        html.push_str("</tbody></table></div>");
        self.raw(&html);
    }
}

fn class(number: bool) -> &'static str {
    if number { " class=\"n\"" } else { "" }
}

/// A number of `report.json` with the pointer to it; a number that is not finite has no value there.
pub(super) fn datum(key: &str, value: f64, shown: &str) -> String {
    if !value.is_finite() {
        return escaped(shown);
    }
    format!(
        "<data value=\"{value:e}\" data-key=\"{}\">{}</data>",
        escaped(key),
        escaped(shown)
    )
}

/// A count of `report.json`.
pub(super) fn count(key: &str, value: usize) -> String {
    format!("<data value=\"{value}\" data-key=\"{key}\">{value}</data>")
}

/// A key as a step of a JSON pointer.
pub(super) fn step(key: &str) -> String {
    key.replace('~', "~0").replace('/', "~1")
}

/// Text that is safe inside an element and an attribute.
pub(super) fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            '\n' | '\t' => out.push(c),
            // XML has no way to write these
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => out.push(' '),
            c => out.push(c),
        }
    }
    out
}
