//! Parameters and selectors of an effect, as model files give them and reports write them.
//!
//! Not physics: names and values (the distance between names is that of Levenshtein,
//! Soviet Physics Doklady 10 (1966) 707).

use std::collections::BTreeMap;

use crate::EffectError;

/// One number of an effect with its unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Name as in model files; its suffix is the unit.
    pub name: String,
    /// Value in `unit`.
    pub value: f64,
    /// Unit, for instance `arcsec`, `s`, `ppm/mag`; empty for a pure number.
    pub unit: &'static str,
}

impl Parameter {
    /// A parameter of the given name, value and unit.
    pub fn new(name: impl Into<String>, value: f64, unit: &'static str) -> Self {
        Self {
            name: name.into(),
            value,
            unit,
        }
    }

    /// `change` of this parameter; of an angle the shorter way round.
    pub fn shorter(&self, change: f64) -> f64 {
        let turn = match self.unit {
            "rad" => core::f64::consts::TAU,
            "deg" => 360.0,
            _ => return change,
        };
        change - turn * (change / turn).round()
    }
}

/// A number, or a selector such as a channel's name.
#[derive(Clone, Debug, PartialEq)]
pub enum ParameterValue {
    /// A number.
    Number(f64),
    /// A selector.
    Text(String),
}

impl ParameterValue {
    /// Several numbers: a text with commas, which an effect that takes one number refuses.
    #[must_use]
    pub fn list(numbers: &[f64]) -> Self {
        let texts: Vec<String> = numbers.iter().map(f64::to_string).collect();
        Self::Text(texts.join(","))
    }
}

impl From<f64> for ParameterValue {
    fn from(value: f64) -> Self {
        Self::Number(value)
    }
}

impl From<&str> for ParameterValue {
    fn from(value: &str) -> Self {
        Self::Text(value.to_owned())
    }
}

impl From<String> for ParameterValue {
    fn from(value: String) -> Self {
        Self::Text(value)
    }
}

/// Keys and values of one `[[effect]]` without its `id`.
pub type Parameters = BTreeMap<String, ParameterValue>;

/// Reads the keys of one effect and complains about what it does not know.
#[derive(Debug)]
pub(crate) struct Reader<'a> {
    effect: &'static str,
    given: &'a Parameters,
}

impl<'a> Reader<'a> {
    /// A reader that has checked every given key against `known`.
    pub(crate) fn new(
        effect: &'static str,
        given: &'a Parameters,
        known: &[&str],
    ) -> Result<Self, EffectError> {
        for key in given.keys() {
            if !known.contains(&key.as_str()) {
                return Err(EffectError::UnknownParameter {
                    effect,
                    name: key.clone(),
                    nearest: nearest(key, known.iter().copied())
                        .unwrap_or_default()
                        .to_owned(),
                });
            }
        }
        Ok(Self { effect, given })
    }

    /// Whether the key is there.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.given.contains_key(name)
    }

    /// A finite number, if given.
    pub(crate) fn number(&self, name: &str) -> Result<Option<f64>, EffectError> {
        match self.given.get(name) {
            None => Ok(None),
            Some(ParameterValue::Number(value)) if value.is_finite() => Ok(Some(*value)),
            Some(ParameterValue::Number(value)) => Err(EffectError::OutOfRange {
                effect: self.effect,
                name: name.to_owned(),
                value: *value,
                expected: "a finite number",
            }),
            Some(ParameterValue::Text(_)) => Err(EffectError::WrongType {
                effect: self.effect,
                name: name.to_owned(),
                expected: "a number",
            }),
        }
    }

    /// A number that must be there.
    pub(crate) fn required(&self, name: &'static str) -> Result<f64, EffectError> {
        self.number(name)?.ok_or(EffectError::MissingParameter {
            effect: self.effect,
            name,
        })
    }

    /// A number, or `default`.
    pub(crate) fn number_or(&self, name: &str, default: f64) -> Result<f64, EffectError> {
        Ok(self.number(name)?.unwrap_or(default))
    }

    /// A number that must be there and lie in `[low, high]`.
    pub(crate) fn within(
        &self,
        name: &'static str,
        [low, high]: [f64; 2],
        expected: &'static str,
    ) -> Result<f64, EffectError> {
        let value = self.required(name)?;
        if (low..=high).contains(&value) {
            return Ok(value);
        }
        Err(EffectError::OutOfRange {
            effect: self.effect,
            name: name.to_owned(),
            value,
            expected,
        })
    }

    /// A whole number, given as a number or as text.
    pub(crate) fn integer(&self, name: &'static str) -> Result<i64, EffectError> {
        let wrong = || EffectError::WrongType {
            effect: self.effect,
            name: name.to_owned(),
            expected: "a whole number",
        };
        match self.given.get(name) {
            None => Err(EffectError::MissingParameter {
                effect: self.effect,
                name,
            }),
            Some(ParameterValue::Text(text)) => text.trim().parse().map_err(|_| wrong()),
            // beyond 2^53 a double no longer tells neighbouring numbers apart
            Some(ParameterValue::Number(value)) => {
                #[expect(clippy::cast_possible_truncation, reason = "whole and below 2^53")]
                let whole = *value as i64;
                let exact = value.fract() == 0.0 && value.abs() <= 9_007_199_254_740_992.0;
                if exact { Ok(whole) } else { Err(wrong()) }
            }
        }
    }

    /// Numbers of which those not given are 0, but one at least must be.
    pub(crate) fn axes<const N: usize>(
        &self,
        names: [&'static str; N],
    ) -> Result<[f64; N], EffectError> {
        if !names.iter().any(|name| self.has(name)) {
            return Err(EffectError::MissingParameter {
                effect: self.effect,
                name: names[0],
            });
        }
        let mut values = [0.0; N];
        for (value, name) in values.iter_mut().zip(names) {
            *value = self.number_or(name, 0.0)?;
        }
        Ok(values)
    }

    /// Refuses every one of `others`, which belong to another form than `name`.
    pub(crate) fn exclude<'o>(
        &self,
        name: &str,
        others: impl IntoIterator<Item = &'o str>,
    ) -> Result<(), EffectError> {
        match others.into_iter().find(|other| self.has(other)) {
            None => Ok(()),
            Some(other) => Err(EffectError::Conflicting {
                effect: self.effect,
                name: name.to_owned(),
                other: other.to_owned(),
            }),
        }
    }

    /// A selector, if given.
    pub(crate) fn text(&self, name: &str) -> Result<Option<&'a str>, EffectError> {
        match self.given.get(name) {
            None => Ok(None),
            Some(ParameterValue::Text(value)) => Ok(Some(value)),
            Some(ParameterValue::Number(_)) => Err(EffectError::WrongType {
                effect: self.effect,
                name: name.to_owned(),
                expected: "text",
            }),
        }
    }
}

/// The known name with the smallest edit distance to `wanted`.
pub(crate) fn nearest<'n>(wanted: &str, known: impl Iterator<Item = &'n str>) -> Option<&'n str> {
    known.min_by_key(|name| edit_distance(wanted, name))
}

/// Levenshtein distance by bytes: identifiers are ASCII.
fn edit_distance(a: &str, b: &str) -> usize {
    let mut previous: Vec<usize> = (0..=b.len()).collect();
    let mut current = vec![0; b.len() + 1];
    for (i, from) in a.bytes().enumerate() {
        current[0] = i + 1;
        for (j, to) in b.bytes().enumerate() {
            let substituted = previous[j] + usize::from(from != to);
            current[j + 1] = substituted.min(previous[j + 1] + 1).min(current[j] + 1);
        }
        core::mem::swap(&mut previous, &mut current);
    }
    previous[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_misspelt_name_is_answered_with_the_nearest() {
        let given = Parameters::from([("line_tme_s".to_owned(), 1.0.into())]);
        let error =
            Reader::new("rolling_shutter", &given, &["line_time_s", "offset_s"]).unwrap_err();
        assert_eq!(
            error,
            EffectError::UnknownParameter {
                effect: "rolling_shutter",
                name: "line_tme_s".to_owned(),
                nearest: "line_time_s".to_owned(),
            }
        );
    }

    #[test]
    fn edit_distance_counts_insertions_deletions_and_substitutions() {
        assert_eq!(edit_distance("kitten", "sitting"), 3);
        assert_eq!(edit_distance("", "abc"), 3);
        assert_eq!(edit_distance("abc", "abc"), 0);
    }
}
