//! Charge left behind in traps while a column is read out, and let go into the rows read after it.
//!
//! ```text
//! captured = transfers traps (1 - exp(-q/knee)),    transfers = row + 1      readout at row 0
//! released k rows later:  captured (1 - a) a^(k-1),  a = exp(-1/release)
//! ```
//!
//! Traps fill: a faint star loses a larger share than a bright one, so that its trail, and with it the
//! shift of its centroid, depends on flux. Charge that comes out beyond the window is lost to it; the
//! rows before the window held what its first row holds, for as long as it takes to balance.
//!
//! Source: Short et al., "An analytical model of radiation-induced charge transfer inefficiency for CCD
//! detectors", MNRAS 430 (2013) 3078, in its simplest form.

use serde::{Deserialize, Serialize};

use super::Place;
use crate::ImagerError;

/// `[detector.trailing]`
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Trailing {
    /// Electrons that the traps of one pixel can hold.
    pub traps_e: f64,
    /// Charge at which they are two thirds full, electrons.
    pub knee_e: f64,
    /// Length of the trail, px.
    pub release_px: f64,
}

impl Trailing {
    pub(super) fn check(&self) -> Result<(), ImagerError> {
        ImagerError::not_negative("detector.trailing.traps_e", self.traps_e)?;
        ImagerError::positive("detector.trailing.knee_e", self.knee_e)?;
        ImagerError::positive("detector.trailing.release_px", self.release_px)
    }

    pub(super) fn apply(&self, place: Place, window: &mut [f64]) {
        let a = (-1.0 / self.release_px).exp();
        let columns = place.columns;
        let transfers = |row: i32| (f64::from(row) + 1.0).max(0.0);
        let captured_of = |charge: f64, row: i32| {
            let traps = transfers(row) * self.traps_e;
            (traps * (1.0 - (-charge / self.knee_e).exp())).min(charge)
        };
        let first_row = window[..columns].iter().sum::<f64>() / columns as f64;
        let before = captured_of(first_row, place.corner[1]) / (1.0 - a);
        for column in 0..columns {
            // trapped charge that is still on its way out
            let mut held = before;
            for (k, row) in (place.corner[1]..).zip(0..window.len() / columns) {
                let charge = &mut window[row * columns + column];
                let captured = captured_of(*charge, k);
                let released = held * (1.0 - a);
                *charge += released - captured;
                held += captured - released;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One bright row: what it loses comes out geometrically behind it, and nothing before it.
    #[test]
    fn a_trail_follows() {
        let trailing = Trailing {
            traps_e: 0.1,
            knee_e: 100.0,
            release_px: 2.0,
        };
        let place = Place {
            corner: [0, 499],
            columns: 1,
            t_s: 0.0,
            exposure_s: 0.1,
        };
        let mut window = [0.0, 1000.0, 0.0, 0.0, 0.0];
        trailing.apply(place, &mut window);
        // row 500 is the 501st transfer
        let captured = 50.1 * (1.0 - (-10.0_f64).exp());
        let a = (-0.5_f64).exp();
        let want = [
            0.0,
            1000.0 - captured,
            captured * (1.0 - a),
            captured * (1.0 - a) * a,
        ];
        for (got, want) in window.iter().zip(want) {
            assert!((got - want).abs() < 1e-9, "{got} {want}");
        }
    }

    /// A uniform level stays, whatever the traps: what is captured comes out of the rows before.
    #[test]
    fn a_level_stays() {
        let trailing = Trailing {
            traps_e: 0.1,
            knee_e: 100.0,
            release_px: 2.0,
        };
        let place = Place {
            corner: [0, 499],
            columns: 2,
            t_s: 0.0,
            exposure_s: 0.1,
        };
        let mut window = [40.0; 12];
        trailing.apply(place, &mut window);
        // captured grows by 1/500 a row
        let captured = 50.0 * (1.0 - (-0.4_f64).exp());
        assert!(
            window
                .iter()
                .all(|w| (w - 40.0).abs() < 6.0 * captured / 500.0),
            "{window:?}"
        );
    }
}
