//! The fits and averages that the claims are about.
//!
//! ```text
//! as printed    [M23] Eq. 17, 19, 20 on a spectrum, raw or averaged (errata E6, E9)
//! consistent    the same with the sampled density and the expectation of each logarithm
//! level         mean of the density over a band
//! ```
//!
//! Source: \[M23\] Section 3.2.

use fogm_fit::{Convention, FitOptions, fit_log_psd};
use spectra::{Detrend, Psd, Welch, WelchSettings, Window, periodogram};

use crate::PaperError;

/// Raw periodogram.
pub(crate) fn raw(series: &[f64], rate_hz: f64) -> Result<Psd, PaperError> {
    Ok(periodogram(
        series,
        rate_hz,
        Window::Boxcar,
        Detrend::Constant,
    )?)
}

/// Average over Hann segments of `segment_s`, or of the whole series where it is shorter.
pub(crate) fn averaged(series: &[f64], rate_hz: f64, segment_s: f64) -> Result<Psd, PaperError> {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a count of samples"
    )]
    let segment = ((segment_s * rate_hz) as usize).min(series.len());
    let welch = Welch::new(WelchSettings::half_overlap(segment, rate_hz))?;
    Ok(welch.process(series)?)
}

/// `[sigma_HSF, tau, sigma_TN]` by Eq. 17 to 20 as printed, in the printed convention.
pub(crate) fn as_printed(psd: &Psd) -> Result<[f64; 3], PaperError> {
    Ok(fit_log_psd(psd, Convention::AsPrinted, &FitOptions::default())?.minimum)
}

/// `[sigma_HSF, tau, sigma_TN]`, true standard deviations.
pub(crate) fn consistent(psd: &Psd) -> Result<[f64; 3], PaperError> {
    Ok(fit_log_psd(psd, Convention::Consistent, &FitOptions::default())?.minimum)
}

/// Mean density within a band, `low <= f < high`; the bins at 0 and fs/2 never count.
pub(crate) fn level(psd: &Psd, [low_hz, high_hz]: [f64; 2]) -> f64 {
    let (mut sum, mut n) = (0.0, 0.0);
    for k in 1..psd.len().saturating_sub(1) {
        if (low_hz..high_hz).contains(&psd.frequency_hz[k]) {
            sum += psd.psd[k];
            n += 1.0;
        }
    }
    sum / n
}

/// Mean spectrum of an ensemble on one grid.
pub(crate) fn mean(spectra: &[Psd]) -> Psd {
    let mut mean = spectra[0].clone();
    for psd in &spectra[1..] {
        for (sum, p) in mean.psd.iter_mut().zip(&psd.psd) {
            *sum += p;
        }
    }
    let n = spectra.len() as f64;
    for (p, dof) in mean.psd.iter_mut().zip(&mut mean.dof) {
        *p /= n;
        *dof *= n;
    }
    mean
}

/// Ratio in decibels.
pub(crate) fn db(ratio: f64) -> f64 {
    10.0 * ratio.log10()
}
