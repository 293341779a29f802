//! Cells: text to numbers, and how messages show them.
//!
//! Source: telemetry bundle format, "Numbers" and "Housekeeping" (docs/formats/bundle.md).

use crate::{Place, TextCells};

/// A column that is a channel, or else text: which, shows with its first cell that is not empty.
#[derive(Debug, Default)]
pub(super) struct Channel {
    pub(super) numbers: Vec<f64>,
    pub(super) words: Option<Words>,
    pub(super) any_number: bool,
}

/// A column of words: the place of the first one, and all cells.
#[derive(Debug)]
pub(super) struct Words {
    pub(super) place: Place,
    first: String,
    pub(super) cells: TextCells,
}

/// A word where a number should be.
pub(super) struct Word {
    pub(super) place: Place,
    pub(super) text: String,
    pub(super) expected: String,
}

impl Channel {
    pub(super) fn push(&mut self, cell: &[u8], place: Place) -> Result<(), Word> {
        let number = number(cell, true);
        match (&mut self.words, number) {
            (None, Some(number)) => {
                self.any_number |= !number.is_nan();
                self.numbers.push(number);
                Ok(())
            }
            (None, None) => {
                let text = String::from_utf8_lossy(cell).into_owned();
                if self.any_number || text.parse::<f64>().is_ok() {
                    let expected = expected_number(true).into();
                    return Err(Word {
                        place,
                        text,
                        expected,
                    });
                }
                // only empty cells so far: this may be a column of words
                let mut cells = TextCells::default();
                for _ in 0..self.numbers.len() {
                    cells.push("");
                }
                cells.push(&text);
                self.numbers = Vec::new();
                self.words = Some(Words {
                    place,
                    first: text,
                    cells,
                });
                Ok(())
            }
            (Some(words), Some(number)) if !number.is_nan() => Err(Word {
                place: words.place,
                text: words.first.clone(),
                expected: format!("a number, as {number} of {place}"),
            }),
            (Some(words), _) => {
                words.cells.push(&String::from_utf8_lossy(cell));
                Ok(())
            }
        }
    }
}

pub(super) fn expected_number(blank: bool) -> &'static str {
    if blank {
        "a finite number or an empty cell"
    } else {
        "a finite number"
    }
}

/// How a message shows a cell.
pub(super) fn shown(cell: &[u8]) -> String {
    const MOST: usize = 40;
    let cell: &str = &String::from_utf8_lossy(cell);
    match cell {
        "" => "an empty cell".into(),
        _ if cell.chars().count() > MOST => {
            let start: String = cell.chars().take(MOST).collect();
            format!("{start:?}...")
        }
        _ if cell.parse::<f64>().is_ok() => cell.into(),
        _ => format!("{cell:?}"),
    }
}

pub(super) fn number(cell: &[u8], blank: bool) -> Option<f64> {
    if cell.is_empty() {
        return blank.then_some(f64::NAN);
    }
    let number: f64 = std::str::from_utf8(cell).ok()?.parse().ok()?;
    (number.is_finite() || (blank && number.is_nan())).then_some(number)
}

pub(super) fn integer(cell: &[u8]) -> Option<i64> {
    let text = std::str::from_utf8(cell).ok()?;
    text.parse()
        .ok()
        .or_else(|| text.parse().ok().and_then(whole))
}

/// A number without a fraction, as some programs write whole numbers ("3.0").
pub(super) fn whole(number: f64) -> Option<i64> {
    /// 2^53: every whole number up to it has a double of its own.
    const EXACT: f64 = 9_007_199_254_740_992.0;
    #[expect(
        clippy::cast_possible_truncation,
        reason = "whole and within 2^53, so exact"
    )]
    (number.fract() == 0.0 && number.abs() <= EXACT).then_some(number as i64)
}
