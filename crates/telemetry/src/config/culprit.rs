//! Which key of a file an error of `serde` is about, and which key was probably meant.
//!
//! Not physics: reading a file.

use core::ops::Range;

use serde::de::DeserializeOwned;

use crate::{TelemetryError, TomlError};

/// Reads text into a type whose fields are the keys; `file` is its name in messages. For whoever adds
/// tables of their own to a file: a type that denies unknown fields answers a misspelt key.
///
/// ```
/// #[derive(Debug, serde::Deserialize)]
/// struct File { run: Run }
/// #[derive(Debug, serde::Deserialize)]
/// #[serde(deny_unknown_fields)]
/// struct Run { seed: u64 }
///
/// let read = telemetry::config::deserialise::<File>;
/// assert_eq!(read("[run]\nseed = 3\n", "a.toml")?.run.seed, 3);
/// let error = read("[run]\nsede = 3\n", "a.toml").expect_err("sede is no key").to_string();
/// assert!(error.starts_with("a.toml, line 2, column 1:") && error.contains("`seed`"));
/// # Ok::<(), telemetry::TelemetryError>(())
/// ```
///
/// # Errors
///
/// A key that does not exist (with the nearest that does), a missing key, or a value of the wrong
/// type, with the line.
pub fn deserialise<T: DeserializeOwned>(text: &str, file: &str) -> Result<T, TelemetryError> {
    toml::from_str(text).map_err(|error| find(&error, text, file))
}

/// The error with its line, and with the nearest key or name where one does not exist.
fn find(error: &toml::de::Error, text: &str, file: &str) -> TelemetryError {
    let said = error.message();
    let names: Vec<&str> = said.split('`').skip(1).step_by(2).collect();
    let unknown = said.starts_with("unknown field") || said.starts_with("unknown variant");
    let message = match names.split_first() {
        Some((wrong, known)) if unknown && !known.is_empty() => {
            let what = if said.starts_with("unknown field") {
                "key"
            } else {
                "name"
            };
            let nearest = known
                .iter()
                .min_by_key(|name| strsim::levenshtein(wrong, name));
            let nearest = nearest.copied().unwrap_or_default();
            format!("no {what} `{wrong}` here; the nearest that exists is `{nearest}`")
        }
        _ => said.to_owned(),
    };
    let span = error.span().unwrap_or(0..0);
    let span = match names.first() {
        Some(wrong) if unknown => word(text, &span, wrong).unwrap_or(span),
        _ => span,
    };
    TelemetryError::Toml(Box::new(place(text, &span, file, message)))
}

/// Where `word` stands by itself inside `span` (a span of a table does not say which key it is about).
fn word(text: &str, span: &Range<usize>, word: &str) -> Option<Range<usize>> {
    let part = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    let inside = |range: &Range<usize>| {
        let before = text[..range.start].chars().next_back();
        let after = text[range.end..].chars().next();
        !before.is_some_and(part) && !after.is_some_and(part)
    };
    let found = |from: usize, to: usize| {
        text.get(from..to)?
            .match_indices(word)
            .map(|(at, _)| from + at..from + at + word.len())
            .find(inside)
    };
    found(span.start, span.end).or_else(|| found(0, text.len()))
}

fn place(text: &str, span: &Range<usize>, file: &str, message: String) -> TomlError {
    let start = span.start.min(text.len());
    let before = text.get(..start).unwrap_or_default();
    let line_start = before.rfind('\n').map_or(0, |at| at + 1);
    let line = text[line_start..].lines().next().unwrap_or_default();
    let column = before[line_start..].chars().count() + 1;
    let rest = line.chars().count().saturating_sub(column - 1);
    let width = text
        .get(span.clone())
        .map_or(1, |culprit| culprit.chars().count());
    TomlError {
        file: file.to_owned(),
        line: before.matches('\n').count() + 1,
        column,
        width: width.clamp(1, rest.max(1)),
        text: line.to_owned(),
        message,
    }
}
