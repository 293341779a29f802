//! What each of the chosen explains of the mean square, out of fold.
//!
//! Not physics: squares and their shares.

use crate::error::CloseError;

/// Mean squares of the residual out of fold, arcsec^2.
pub(crate) struct Power {
    /// Of the declared model.
    pub(crate) before: f64,
    /// With all that was chosen.
    pub(crate) left: f64,
    /// Share of the first that each of the chosen takes, in their order.
    explained: Vec<f64>,
}

impl Power {
    /// `of_first`: what the first so many of the chosen leave, of which there are `chosen`; `with_none` where none is
    /// fitted.
    pub(crate) fn of(
        before: f64,
        with_none: f64,
        chosen: usize,
        of_first: impl Fn(usize) -> Result<f64, CloseError>,
    ) -> Result<Self, CloseError> {
        let mut explained = Vec::new();
        let mut left = with_none;
        for k in 1..=chosen {
            let now = of_first(k)?;
            explained.push((left - now) / before);
            left = now;
        }
        Ok(Self {
            before,
            left,
            explained,
        })
    }

    pub(crate) fn share_left(&self) -> f64 {
        self.left / self.before
    }

    /// Shares of the chosen, and of a further term beside which so much is left.
    pub(crate) fn explained(&self, beside_a_term: Option<f64>) -> Vec<f64> {
        let term = beside_a_term.map(|left| (self.left - left) / self.before);
        self.explained.iter().copied().chain(term).collect()
    }
}
