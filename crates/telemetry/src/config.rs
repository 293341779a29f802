//! TOML files whose mistakes are shown in place: file, line, column, the line itself, and the
//! nearest key for one that does not exist.
//!
//! Used for bundles and models here, and by whoever adds tables of their own (scenarios).
//!
//! Source: telemetry bundle format, "Bad input" (docs/formats/bundle.md).

mod culprit;
mod entry;
mod node;
mod seek;

use std::fmt;
use std::ops::Range;

use toml::de::DeTable;

use crate::{TelemetryError, TomlError};
pub use culprit::deserialise;
pub use entry::Entry;
use node::{Table, Value};

/// A parsed file.
#[derive(Clone)]
pub struct Config {
    file: String,
    text: String,
    root: Table,
}

impl fmt::Debug for Config {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Config")
            .field("file", &self.file)
            .finish_non_exhaustive()
    }
}

impl Config {
    /// Parses text; `file` is its name in messages.
    ///
    /// ```
    /// use telemetry::config::Config;
    /// let config = Config::parse("[run]\nseeed = 3\n", "example.toml")?;
    /// let run = config.root().section("run")?.expect("is there");
    /// let error = run.allow(&["seed", "draws"]).expect_err("seeed is no key");
    /// let shown = error.to_string();
    /// assert!(shown.starts_with("example.toml, line 2, column 1:"));
    /// assert!(shown.contains("`seed`"));
    /// # Ok::<(), telemetry::TelemetryError>(())
    /// ```
    ///
    /// # Errors
    ///
    /// Text that is no TOML.
    pub fn parse(text: &str, file: &str) -> Result<Self, TelemetryError> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        match DeTable::parse(text) {
            Ok(root) => Ok(Self {
                file: file.into(),
                text: text.into(),
                root: node::table(root.get_ref()),
            }),
            Err(error) => {
                let span = error.span().unwrap_or(0..0);
                Err(located(file, text, span, error.message()))
            }
        }
    }

    /// The table of the whole file.
    #[must_use]
    pub fn root(&self) -> Section<'_> {
        Section {
            config: self,
            name: String::new(),
            table: &self.root,
            span: 0..0,
        }
    }

    /// An error at an entry given by its path, such as `tracker.pixels`, or at the top of the file.
    pub fn error_at(&self, path: &str, message: impl AsRef<str>) -> TelemetryError {
        let mut table = &self.root;
        let mut span = 0..0;
        for part in path.split('.') {
            let Some(node) = table.get(part) else { break };
            span = node.key_span.clone();
            let Value::Table(inner) = &node.value else {
                break;
            };
            table = inner;
        }
        located(&self.file, &self.text, span, message.as_ref())
    }

    /// An error at a value given by its path, such as `motion.slew.axis`, that was found wrong after the
    /// file was read. Of several tables of one name it is the first that has this `value` there: a
    /// number, or a vector of that length. As [`error_at`](Self::error_at) where there is none.
    ///
    /// ```
    /// let text = "[[slew]]\naxis = [0, 0, 1]\n[[slew]]\naxis = [0, 0, 0]\n";
    /// let config = telemetry::config::Config::parse(text, "a.toml")?;
    /// let error = config.error_at_value("slew.axis", Some(0.0), "no direction").to_string();
    /// assert!(error.starts_with("a.toml, line 4, column 8: no direction"));
    /// # Ok::<(), telemetry::TelemetryError>(())
    /// ```
    pub fn error_at_value(
        &self,
        path: &str,
        value: Option<f64>,
        message: impl AsRef<str>,
    ) -> TelemetryError {
        match seek::seek(&self.root, path, value) {
            Some(node) => located(&self.file, &self.text, node.span.clone(), message.as_ref()),
            None => self.error_at(path, message),
        }
    }

    /// As [`error_at_value`](Self::error_at_value) in the `text` of a file that was read before, of the file as a
    /// whole where the path is empty.
    pub fn blame(
        text: &str,
        file: &str,
        path: &str,
        value: Option<f64>,
        reason: String,
    ) -> TelemetryError {
        match Self::parse(text, file) {
            Ok(config) if !path.is_empty() => config.error_at_value(path, value, reason),
            _ => TelemetryError::InFile {
                file: file.to_owned(),
                reason,
            },
        }
    }

    /// Line of a byte, 1-based.
    fn line(&self, byte: usize) -> usize {
        line_of(&self.text, byte)
    }
}

fn line_of(text: &str, byte: usize) -> usize {
    let bytes = &text.as_bytes()[..byte.min(text.len())];
    1 + bytes.iter().filter(|&&b| b == b'\n').count()
}

fn located(file: &str, text: &str, span: Range<usize>, message: &str) -> TelemetryError {
    TelemetryError::Toml(Box::new(spot(file, text, span, message)))
}

fn spot(file: &str, text: &str, span: Range<usize>, message: &str) -> TomlError {
    // an error at the very end is shown at the end of the last line that holds something
    let start = span.start.min(text.trim_end().len());
    let line_start = text[..start].rfind('\n').map_or(0, |at| at + 1);
    let line_end = text[start..].find('\n').map_or(text.len(), |at| start + at);
    let culprit = &text[start..span.end.clamp(start, line_end)];
    TomlError {
        file: file.into(),
        line: line_of(text, start),
        column: text[line_start..start].chars().count() + 1,
        width: culprit.trim_end().chars().count().max(1),
        text: text[line_start..line_end].trim_end().into(),
        message: message.into(),
    }
}

/// The candidate that is nearest to a name, by edits.
#[must_use]
pub fn nearest<'a>(name: &str, candidates: &[&'a str]) -> Option<&'a str> {
    let lower = name.to_lowercase();
    candidates
        .iter()
        .copied()
        .min_by_key(|candidate| strsim::damerau_levenshtein(&lower, &candidate.to_lowercase()))
}

/// A table of the file.
#[derive(Clone)]
pub struct Section<'a> {
    config: &'a Config,
    /// Dotted; empty for the file itself.
    name: String,
    table: &'a Table,
    span: Range<usize>,
}

impl fmt::Debug for Section<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Section")
            .field("file", &self.config.file)
            .field("name", &self.name)
            .finish_non_exhaustive()
    }
}

impl<'a> Section<'a> {
    /// How messages call the table.
    fn title(&self) -> String {
        if self.name.is_empty() {
            "the top of the file".into()
        } else {
            format!("[{}]", self.name)
        }
    }

    /// Line at which the table begins, 1-based.
    #[must_use]
    pub fn line(&self) -> usize {
        self.config.line(self.span.start)
    }

    /// Refuses keys other than these.
    ///
    /// # Errors
    ///
    /// The first key that does not exist, with the nearest that does.
    pub fn allow(&self, keys: &[&str]) -> Result<(), TelemetryError> {
        self.allow_or_point(keys, &[])
    }

    /// As [`allow`](Self::allow); `elsewhere` lists `(table, keys)` where a misplaced key may
    /// belong.
    ///
    /// # Errors
    ///
    /// The first key that does not exist, with its right place or the nearest that does exist.
    pub fn allow_or_point(
        &self,
        keys: &[&str],
        elsewhere: &[(&str, &[&str])],
    ) -> Result<(), TelemetryError> {
        let unknown = self
            .entries()
            .filter(|entry| !keys.contains(&entry.key()))
            .min_by_key(|entry| entry.node.key_span.start);
        let Some(entry) = unknown else { return Ok(()) };
        let key = entry.key();
        let home = elsewhere.iter().find(|(_, keys)| keys.contains(&key));
        let advice = match (home, nearest(key, keys)) {
            (Some((table, _)), _) => format!("; it belongs in {table}"),
            (None, Some(near)) => format!("; the nearest key that does is `{near}`"),
            (None, None) => String::new(),
        };
        let title = self.title();
        Err(entry.error_at_key(format!("key `{key}` does not exist in {title}{advice}")))
    }

    /// All entries, sorted by key.
    pub fn entries(&self) -> impl Iterator<Item = Entry<'a>> + use<'a> {
        let (config, table, name) = (self.config, self.table, self.name.clone());
        table.iter().map(move |(key, node)| Entry {
            config,
            section: name.clone(),
            key,
            node,
        })
    }

    /// One entry, if it is there.
    #[must_use]
    pub fn entry(&self, key: &str) -> Option<Entry<'a>> {
        let (key, node) = self.table.get_key_value(key)?;
        Some(Entry {
            config: self.config,
            section: self.name.clone(),
            key,
            node,
        })
    }

    /// An entry that must be there.
    ///
    /// # Errors
    ///
    /// At the head of the table, if it is not.
    pub fn require(&self, key: &str) -> Result<Entry<'a>, TelemetryError> {
        self.entry(key).ok_or_else(|| {
            self.error(format!(
                "expected a key `{key}` in {}, found none",
                self.title()
            ))
        })
    }

    /// A table inside this one, if it is there.
    ///
    /// # Errors
    ///
    /// An entry of that name that is no table.
    pub fn section(&self, key: &str) -> Result<Option<Self>, TelemetryError> {
        self.entry(key).map(|entry| entry.table()).transpose()
    }

    /// The tables of an array of tables (`[[key]]`), none if it is not there.
    ///
    /// # Errors
    ///
    /// An entry of that name that is anything else.
    pub fn sections(&self, key: &str) -> Result<Vec<Self>, TelemetryError> {
        match self.entry(key) {
            Some(entry) => entry.items()?.iter().map(Entry::table).collect(),
            None => Ok(Vec::new()),
        }
    }

    /// Where the table begins, as an error that still lacks its message.
    pub(crate) fn spot(&self) -> TomlError {
        spot(&self.config.file, &self.config.text, self.span.clone(), "")
    }

    /// An error at the head of the table.
    pub fn error(&self, message: impl AsRef<str>) -> TelemetryError {
        let Config { file, text, .. } = self.config;
        located(file, text, self.span.clone(), message.as_ref())
    }

    /// A number, if it is there.
    ///
    /// # Errors
    ///
    /// An entry that is no finite number.
    pub fn number(&self, key: &str) -> Result<Option<f64>, TelemetryError> {
        self.entry(key).map(|entry| entry.number()).transpose()
    }

    /// A number above 0, if it is there.
    ///
    /// # Errors
    ///
    /// An entry that is no such number.
    pub fn positive(&self, key: &str) -> Result<Option<f64>, TelemetryError> {
        self.entry(key).map(|entry| entry.positive()).transpose()
    }

    /// A number not below 0, if it is there.
    ///
    /// # Errors
    ///
    /// An entry that is no such number.
    pub fn non_negative(&self, key: &str) -> Result<Option<f64>, TelemetryError> {
        self.entry(key)
            .map(|entry| entry.non_negative())
            .transpose()
    }

    /// A text, if it is there.
    ///
    /// # Errors
    ///
    /// An entry that is no text.
    pub fn text(&self, key: &str) -> Result<Option<String>, TelemetryError> {
        self.entry(key)
            .map(|entry| entry.text().map(String::from))
            .transpose()
    }

    /// `N` finite numbers, if they are there.
    ///
    /// # Errors
    ///
    /// An entry that is anything else.
    pub fn numbers<const N: usize>(&self, key: &str) -> Result<Option<[f64; N]>, TelemetryError> {
        self.entry(key).map(|entry| entry.numbers()).transpose()
    }
}
