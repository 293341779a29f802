//! Temporal noise of a centroid.
//!
//! ```text
//! sigma^2 = sigma_0^2 10^(0.4 slope (m - m_0)) + (k omega)^2        per axis, white
//! ```
//!
//! `slope` is 0 for a constant sigma, 1 where photons of the star dominate (flux F falls by 10^-0.4 per
//! magnitude and sigma ~ F^-1/2), 2 where background and read noise do (sigma ~ F^-1). `k omega`
//! is growth with the star's rate across the detector: specifications quote NEA at 0.1 deg/s
//! (\[M23\] Table 1).
//!
//! \[M23\] Step 4 states the constant form with a *per-star circular* sigma; see [`crate::sigma`].
//!
//! Source: \[M23\] Step 4 and Table 1.

use crate::TrackerError;
use crate::sigma::per_axis_from_circular;

/// White noise per star and axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TemporalNoise {
    per_axis_arcsec: f64,
    slope: f64,
    reference_mag: f64,
    arcsec_per_deg_s: f64,
}

impl TemporalNoise {
    /// No noise.
    pub const NONE: Self = Self {
        per_axis_arcsec: 0.0,
        slope: 0.0,
        reference_mag: 0.0,
        arcsec_per_deg_s: 0.0,
    };

    /// Constant noise from the per-axis sigma, arcsec.
    ///
    /// # Errors
    /// When it is negative or not finite.
    pub fn per_axis_arcsec(sigma: f64) -> Result<Self, TrackerError> {
        TrackerError::check_not_negative("temporal noise", sigma)?;
        Ok(Self {
            per_axis_arcsec: sigma,
            ..Self::NONE
        })
    }

    /// Constant noise from the per-star circular sigma, arcsec, as \[M23\] Step 4 means it.
    ///
    /// # Errors
    /// When it is negative or not finite.
    pub fn circular_arcsec(sigma: f64) -> Result<Self, TrackerError> {
        Self::per_axis_arcsec(per_axis_from_circular(sigma))
    }

    /// The same, growing with magnitude: the constant sigma holds at `reference_mag`. Stars of unknown
    /// magnitude keep the constant.
    ///
    /// # Errors
    /// When a number is not finite.
    pub fn with_magnitude_slope(
        self,
        slope: f64,
        reference_mag: f64,
    ) -> Result<Self, TrackerError> {
        TrackerError::check_finite("magnitude slope", slope)?;
        TrackerError::check_finite("reference magnitude", reference_mag)?;
        Ok(Self {
            slope,
            reference_mag,
            ..self
        })
    }

    /// The same, growing with rate: `arcsec_per_deg_s` per axis, added in square.
    ///
    /// # Errors
    /// When it is negative or not finite.
    pub fn with_rate(self, arcsec_per_deg_s: f64) -> Result<Self, TrackerError> {
        TrackerError::check_not_negative("rate noise", arcsec_per_deg_s)?;
        Ok(Self {
            arcsec_per_deg_s,
            ..self
        })
    }

    /// Sigma of every star while it neither moves nor differs from the reference magnitude, arcsec per
    /// axis.
    pub fn base_arcsec(&self) -> f64 {
        self.per_axis_arcsec
    }

    /// Whether sigma is one number for all rows.
    pub fn is_constant(&self) -> bool {
        !self.depends_on_mag() && !self.depends_on_rate()
    }

    /// Whether sigma differs between stars.
    pub(crate) fn depends_on_mag(&self) -> bool {
        self.slope.abs() > 0.0
    }

    /// Whether sigma follows the rate.
    pub(crate) fn depends_on_rate(&self) -> bool {
        self.arcsec_per_deg_s > 0.0
    }

    /// Sigma of a star, arcsec per axis; `speed_arcsec_s` is its speed across the detector.
    pub fn sigma_arcsec(&self, mag: f64, speed_arcsec_s: f64) -> f64 {
        let mut variance = self.per_axis_arcsec * self.per_axis_arcsec;
        if self.depends_on_mag() && mag.is_finite() {
            variance *= 10_f64.powf(0.4 * self.slope * (mag - self.reference_mag));
        }
        if self.depends_on_rate() {
            let moving = self.arcsec_per_deg_s * speed_arcsec_s / 3600.0;
            variance += moving * moving;
        }
        variance.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Five magnitudes are a factor 100 in flux: photon noise (slope 1) grows tenfold.
    #[test]
    fn photon_noise_grows_tenfold_in_five_magnitudes() -> Result<(), TrackerError> {
        let noise = TemporalNoise::per_axis_arcsec(2.0)?.with_magnitude_slope(1.0, 3.0)?;
        let at = |mag: f64| noise.sigma_arcsec(mag, 0.0);
        assert!((at(8.0) / at(3.0) - 10.0).abs() < 1e-12);
        assert!(
            (at(f64::NAN) - 2.0).abs() < 1e-15,
            "unknown magnitude keeps the constant"
        );
        Ok(())
    }

    #[test]
    fn rate_noise_adds_in_square() -> Result<(), TrackerError> {
        let noise = TemporalNoise::per_axis_arcsec(3.0)?.with_rate(40.0)?;
        // 0.1 deg/s = 360 arcsec/s: 4 arcsec beside 3
        assert!((noise.sigma_arcsec(5.0, 360.0) - 5.0).abs() < 1e-12);
        Ok(())
    }

    #[test]
    fn negative_noise_is_an_error() {
        assert!(TemporalNoise::circular_arcsec(-1.0).is_err());
        assert!(TemporalNoise::per_axis_arcsec(f64::NAN).is_err());
    }
}
