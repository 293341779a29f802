//! Models against flights, band by band.
//!
//! ```text
//! misfit(band) = 10 log10( mean density of the model / mean density of the flights )       dB
//! ```
//!
//! Model and flights are means over draws of the distortion: one draw is unlikely to match, as the paper
//! says. The standard error of a misfit is that of both means, from the scatter between draws, by
//!
//! ```text
//! (10 / ln 10) sqrt( var_model / (n_model mean^2) + var_flight / (n_flight mean^2) )
//! ```
//!
//! The paper had one flight: what it calls a good fit cannot be told from the model's mean more finely
//! than one flight scatters about it, `(10 / ln 10) sqrt(var_flight) / mean`.
//!
//! Source: \[M23\] Sections 4.2 and 4.3, Figs. 11, 12, 13, 16, 17.

use spectra::Psd;

use crate::PaperError;
use crate::spectrum::{averaged, db, level};
use crate::trial::Axes;

/// Segments of the spectra, s: the longest that fits the calibration.
pub(super) const SEGMENT_S: f64 = 3276.8;

/// One spectrum an axis.
pub(super) fn spectra(axes: &Axes, rate_hz: f64) -> Result<[Psd; 3], PaperError> {
    let [x, y, z] = axes;
    let psd = |series: &[f64]| averaged(series, rate_hz, SEGMENT_S);
    Ok([psd(x)?, psd(y)?, psd(z)?])
}

/// Mean and squared relative standard error of the level of a band.
fn mean_level(draws: &[[Psd; 3]], axis: usize, band_hz: [f64; 2]) -> [f64; 2] {
    let levels: Vec<f64> = draws.iter().map(|psd| level(&psd[axis], band_hz)).collect();
    let n = levels.len() as f64;
    let mean = levels.iter().sum::<f64>() / n;
    let variance = levels.iter().map(|l| (l - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    [mean, variance / (n * mean * mean)]
}

/// Misfit and its standard error, dB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Misfit {
    pub(super) db: f64,
    pub(super) error_db: f64,
    /// By how much single flights scatter.
    pub(super) flight_db: f64,
}

impl Misfit {
    pub(super) fn of(
        model: &[[Psd; 3]],
        flights: &[[Psd; 3]],
        axis: usize,
        band_hz: [f64; 2],
    ) -> Self {
        let [m, m_var] = mean_level(model, axis, band_hz);
        let [f, f_var] = mean_level(flights, axis, band_hz);
        let decibels = |relative: f64| 10.0 / std::f64::consts::LN_10 * relative;
        Self {
            db: db(m / f),
            error_db: decibels((m_var + f_var).sqrt()),
            flight_db: decibels((flights.len() as f64 * f_var).sqrt()),
        }
    }

    /// Below by more than a decibel and two standard errors.
    pub(super) fn under(self) -> bool {
        self.db < -1.0 - 2.0 * self.error_db
    }

    /// Above by as much.
    pub(super) fn over(self) -> bool {
        self.db > 1.0 + 2.0 * self.error_db
    }

    /// Within a decibel and two standard deviations of a single flight, that of the means included.
    pub(super) fn like_one_flight(self) -> bool {
        self.db.abs() < self.one_flight_db()
    }

    /// What [`like_one_flight`](Self::like_one_flight) allows, dB.
    pub(super) fn one_flight_db(self) -> f64 {
        1.0 + 2.0 * self.flight_db.hypot(self.error_db)
    }
}

impl std::fmt::Display for Misfit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:+.1}", self.db)
    }
}

/// What counts, for the page.
pub(super) const TOLERANCE: &str = "1 dB and two standard errors, by the scatter between draws";

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(level: f64) -> [Psd; 3] {
        let psd = Psd {
            frequency_hz: vec![0.0, 1.0, 2.0, 3.0],
            psd: vec![0.0, level, 100.0 * level, level],
            dof: vec![2.0; 4],
            fs_hz: 6.0,
        };
        [psd.clone(), psd.clone(), psd]
    }

    /// Means 2 and 1 are 3.01 dB apart. Two draws of 1.8 and 2.2 know their mean to 10 %, 0.43 dB.
    #[test]
    fn a_misfit_is_the_ratio_of_means_with_its_error() {
        let model = [flat(1.8), flat(2.2)];
        let misfit = Misfit::of(&model, &[flat(1.0), flat(1.0)], 1, [0.5, 1.5]);
        assert!((misfit.db - 10.0 * 2_f64.log10()).abs() < 1e-12);
        assert!((misfit.error_db - 0.1 * 10.0 / 10_f64.ln()).abs() < 1e-12);
        assert!(misfit.over() && !misfit.under());
        let less = Misfit::of(&[flat(1.0), flat(1.0)], &model, 1, [0.5, 1.5]);
        assert!((less.db + misfit.db).abs() < 1e-12 && less.under() && !less.over());
        assert!((less.error_db - misfit.error_db).abs() < 1e-12);
        let vague = Misfit {
            error_db: 1.1,
            ..misfit
        };
        assert!(!vague.over(), "2.2 dB of error and 1 dB");
        // flights of 0.9 and 1.1: one scatters by 0.141 of the mean, 0.614 dB, the means' ratio by 0.1
        let misfit = Misfit::of(
            &[flat(1.2), flat(1.2)],
            &[flat(0.9), flat(1.1)],
            1,
            [0.5, 1.5],
        );
        let per_cent = 10.0 / 10_f64.ln() / 100.0;
        assert!((misfit.flight_db - 10.0 * 2_f64.sqrt() * per_cent).abs() < 1e-12);
        assert!((misfit.one_flight_db() - 1.0 - 20.0 * 3_f64.sqrt() * per_cent).abs() < 1e-12);
        assert!(
            misfit.like_one_flight()
                && !Misfit {
                    flight_db: 0.0,
                    error_db: 0.0,
                    db: -1.01
                }
                .like_one_flight()
        );
    }
}
