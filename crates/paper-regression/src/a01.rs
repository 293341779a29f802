//! The claims of \[A01\]: IMAGE and EO-1, one file a group.
//!
//! Not physics: a list.

mod gyro;
mod noise;
mod rotator;

use crate::PaperError;
use crate::row::{Group, Row, Verdict};

/// All rows of \[A01\].
///
/// # Errors
/// A scenario or an assessment that fails: none with the presets.
pub fn groups() -> Result<Vec<Group>, PaperError> {
    Ok(vec![rotator::group()?, noise::group()?, gyro::group()?])
}

/// A row whose verdict is that of its fit.
fn row(
    id: &str,
    paper: &str,
    ours: String,
    under: &str,
    tolerance: &str,
    verdict: [Verdict; 2],
) -> Row {
    let [verdict, expected] = verdict;
    Row {
        id: id.into(),
        paper: paper.into(),
        ours,
        under: under.into(),
        tolerance: tolerance.into(),
        verdict,
        expected,
    }
}

/// The verdict if it fits, or contradicts.
fn fits(fits: bool, then: Verdict) -> Verdict {
    if fits { then } else { Verdict::Contradicts }
}
