//! One value of a TOML file, read as what it should be.
//!
//! Source: TOML 1.1.

use std::fmt;
use std::ops::RangeInclusive;

use super::node::{Node, Value};
use super::{Config, Section, located, spot};
use crate::{TelemetryError, TomlError};

/// One `key = value`, or one item of an array.
#[derive(Clone)]
pub struct Entry<'a> {
    pub(super) config: &'a Config,
    pub(super) section: String,
    pub(super) key: &'a str,
    pub(super) node: &'a Node,
}

impl fmt::Debug for Entry<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Entry")
            .field("file", &self.config.file)
            .field("key", &self.key)
            .field("value", &self.node.value)
            .finish_non_exhaustive()
    }
}

impl<'a> Entry<'a> {
    /// Its key.
    #[must_use]
    pub fn key(&self) -> &'a str {
        self.key
    }

    /// Its line, 1-based.
    #[must_use]
    pub fn line(&self) -> usize {
        self.config.line(self.node.key_span.start)
    }

    /// Where the value stands, as an error that still lacks its message.
    pub(crate) fn spot(&self) -> TomlError {
        let span = self.node.span.clone();
        spot(&self.config.file, &self.config.text, span, "")
    }

    /// An error at the value.
    pub fn error(&self, message: impl AsRef<str>) -> TelemetryError {
        let Config { file, text, .. } = self.config;
        located(file, text, self.node.span.clone(), message.as_ref())
    }

    /// An error at the key.
    pub fn error_at_key(&self, message: impl AsRef<str>) -> TelemetryError {
        let Config { file, text, .. } = self.config;
        located(file, text, self.node.key_span.clone(), message.as_ref())
    }

    /// "expected ..., found ..." at the value, with the value as the file has it.
    #[must_use]
    pub fn expected(&self, what: &str) -> TelemetryError {
        let found = match self.node.value {
            Value::Table(_) => "a table".to_owned(),
            _ => {
                let written = &self.config.text[self.node.span.clone()];
                written.split_whitespace().collect::<Vec<_>>().join(" ")
            }
        };
        let key = self.key;
        self.error(format!("`{key}`: expected {what}, found {found}"))
    }

    /// Whether the value is a text.
    #[must_use]
    pub fn is_text(&self) -> bool {
        matches!(self.node.value, Value::Text(_))
    }

    /// Whether the value is an array.
    #[must_use]
    pub fn is_array(&self) -> bool {
        matches!(self.node.value, Value::Array(_))
    }

    /// A finite number, whole or not.
    ///
    /// # Errors
    ///
    /// Anything else.
    pub fn number(&self) -> Result<f64, TelemetryError> {
        let number = match self.node.value {
            Value::Float(number) => Some(number),
            // beyond 2^53 no setting needs to be exact
            Value::Whole(number) => Some(number as f64),
            _ => None,
        };
        number
            .filter(|number| number.is_finite())
            .ok_or_else(|| self.expected("a finite number"))
    }

    /// A finite number above 0.
    ///
    /// # Errors
    ///
    /// Anything else.
    pub fn positive(&self) -> Result<f64, TelemetryError> {
        self.number()
            .ok()
            .filter(|&number| number > 0.0)
            .ok_or_else(|| self.expected("a number above 0"))
    }

    /// A finite number not below 0.
    ///
    /// # Errors
    ///
    /// Anything else.
    pub fn non_negative(&self) -> Result<f64, TelemetryError> {
        self.number()
            .ok()
            .filter(|&number| number >= 0.0)
            .ok_or_else(|| self.expected("a number not below 0"))
    }

    /// A whole number within bounds.
    ///
    /// # Errors
    ///
    /// Anything else.
    pub fn integer(&self, within: RangeInclusive<i64>) -> Result<i64, TelemetryError> {
        match self.node.value {
            Value::Whole(number) if within.contains(&number) => Ok(number),
            _ => {
                let (low, high) = (within.start(), within.end());
                Err(self.expected(&format!("a whole number from {low} to {high}")))
            }
        }
    }

    /// A count that fits 32 bits, at least `least`.
    ///
    /// # Errors
    ///
    /// Anything else.
    pub fn count(&self, least: u32) -> Result<u32, TelemetryError> {
        let number = self.integer(i64::from(least)..=i64::from(i32::MAX))?;
        u32::try_from(number).map_err(|_| self.expected("a count"))
    }

    /// A text.
    ///
    /// # Errors
    ///
    /// Anything else.
    pub fn text(&self) -> Result<&'a str, TelemetryError> {
        match &self.node.value {
            Value::Text(text) => Ok(text),
            _ => Err(self.expected("a text")),
        }
    }

    /// `true` or `false`.
    ///
    /// # Errors
    ///
    /// Anything else.
    pub fn switch(&self) -> Result<bool, TelemetryError> {
        match self.node.value {
            Value::Switch(on) => Ok(on),
            _ => Err(self.expected("true or false")),
        }
    }

    /// One of several words.
    ///
    /// # Errors
    ///
    /// Anything else; the words are listed.
    pub fn choice<T: Copy>(&self, words: &[(&str, T)]) -> Result<T, TelemetryError> {
        let found = self.text().unwrap_or("");
        words
            .iter()
            .find(|(word, _)| found == *word)
            .map(|&(_, value)| value)
            .ok_or_else(|| {
                let list: Vec<_> = words.iter().map(|(word, _)| format!("{word:?}")).collect();
                self.expected(&format!("one of {}", list.join(", ")))
            })
    }

    /// The items of an array.
    ///
    /// # Errors
    ///
    /// Anything else.
    pub fn items(&self) -> Result<Vec<Self>, TelemetryError> {
        let Value::Array(array) = &self.node.value else {
            return Err(self.expected("an array"));
        };
        let item = |node: &'a Node| Self {
            node,
            ..self.clone()
        };
        Ok(array.iter().map(item).collect())
    }

    /// An array of `N` items.
    ///
    /// # Errors
    ///
    /// Anything else.
    pub fn array<const N: usize>(&self, of: &str) -> Result<[Self; N], TelemetryError> {
        let wrong = || self.expected(&format!("an array of {N} {of}"));
        let items = self.items().map_err(|_| wrong())?;
        <[Self; N]>::try_from(items).map_err(|_| wrong())
    }

    /// An array of `N` finite numbers.
    ///
    /// # Errors
    ///
    /// Anything else.
    pub fn numbers<const N: usize>(&self) -> Result<[f64; N], TelemetryError> {
        let items = self.array::<N>("numbers")?;
        let mut numbers = [0.0; N];
        for (number, item) in numbers.iter_mut().zip(&items) {
            *number = item.number()?;
        }
        Ok(numbers)
    }

    /// The value as a table.
    ///
    /// # Errors
    ///
    /// Anything else.
    pub fn table(&self) -> Result<Section<'a>, TelemetryError> {
        let Value::Table(table) = &self.node.value else {
            return Err(self.expected("a table"));
        };
        let name = match self.section.as_str() {
            "" => self.key.to_owned(),
            outer => format!("{outer}.{}", self.key),
        };
        Ok(Section {
            config: self.config,
            name,
            table,
            span: self.node.span.clone(),
        })
    }
}
