//! The numbers that the paper puts in, and how much is computed from them.
//!
//! Not physics: settings.

/// What every row follows from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inputs {
    /// \[M23\] 4.1, `sigma_TN`, arcsec: fitted on the boresight attitude, fed in per star.
    pub sigma_tn_arcsec: f64,
    /// \[M23\] 4.1, `sigma_HSF`, arcsec.
    pub sigma_hsf_arcsec: f64,
    /// \[M23\] 4.1, `tau_HSF`, s.
    pub tau_hsf_s: f64,
    /// \[M23\] 4.2, `sigma_LSF`, arcsec, read as circular (erratum E15).
    pub sigma_lsf_arcsec: f64,
    /// Star fields over which the hold is repeated.
    pub fields: u64,
    /// Distortion fields of an ensemble; \[M23\] 4.2 takes 100.
    pub draws: u64,
    /// Flights that stand for the measured side.
    pub flights: u64,
    /// Part of the printed duration that is simulated, up to 1.
    pub duration: f64,
}

impl Default for Inputs {
    fn default() -> Self {
        Self {
            sigma_tn_arcsec: 7.43,
            sigma_hsf_arcsec: 5.06,
            tau_hsf_s: 161.0,
            sigma_lsf_arcsec: 3.1667,
            fields: 16,
            draws: 100,
            flights: 12,
            duration: 1.0,
        }
    }
}
