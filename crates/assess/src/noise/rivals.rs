//! Objective rivals of the plateau: Allan deviation and the floor of the spectrum.
//!
//! ```text
//! z = x[i+2m] - 2 x[i+m] + x[i]:    mean z^2 = 6 sigma^2 + 2 c m + b m^4    white, random walk, curvature
//! Allan deviation = sqrt(mean z^2 / 2) / tau;   sigma from m = 1, 2, 3, 4
//! floor:  mean of the one-sided density over (0.5 to 0.95) of the Nyquist frequency, times fs / 2
//! ```
//!
//! Source: NIST SP 1065, Eq. 11; Percival & Walden (1993) for the density; `spectra`.

use nalgebra::{Matrix3, Vector3};
use spectra::{
    Allan, AllanData, AllanKind, Detrend, PowerLaw, Welch, WelchSettings, allan_edf,
    continuous_runs,
};

use crate::AssessError;

/// A white noise by another way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rival {
    /// White noise, 1 sigma of a frame.
    pub sigma: f64,
    /// Its own 1 sigma.
    pub error: f64,
}

/// Whether two estimates agree within three sigma of both, and one part in a hundred.
#[must_use]
pub(crate) fn agree(a: [f64; 2], b: [f64; 2]) -> bool {
    (a[0] - b[0]).abs() <= 3.0 * a[1].hypot(b[1]) + 0.01 * a[0]
}

/// White noise from Allan deviations over the first four averaging times.
///
/// # Errors
/// Times that do not ascend.
pub fn allan_white(t_s: &[f64], x: &[f64], step_s: f64) -> Result<Option<Rival>, AssessError> {
    let fs_hz = 1.0 / step_s;
    let allan = Allan::new(
        AllanData::Angle,
        AllanKind::Overlapping,
        PowerLaw::WhiteAngle,
        fs_hz,
    )?;
    let factors = [1, 2, 3, 4];
    let (mut sum, mut count, mut angles) = ([0.0; 4], [0.0; 4], 0);
    for run in continuous_runs(t_s, x, step_s, 0.2)? {
        if run.len() < 16 {
            continue;
        }
        angles += run.len();
        let found = allan.process(&x[run], &factors)?;
        for m in 0..4 {
            let n = found.differences[m] as f64;
            let second = (found.deviation[m] * found.tau_s[m]).powi(2) * 2.0;
            sum[m] += second * n;
            count[m] += n;
        }
    }
    if angles < 32 {
        return Ok(None);
    }
    let square: Vec<f64> = (0..4).map(|m| sum[m] / count[m]).collect();
    // weights by the degrees of freedom of white noise
    let (mut gram, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for (k, factor) in factors.iter().enumerate() {
        let m = *factor as f64;
        let weight = allan_edf(
            PowerLaw::WhiteAngle,
            AllanKind::Overlapping,
            *factor,
            angles,
        );
        let row = Vector3::new(6.0, 2.0 * m, m.powi(4));
        gram += row * row.transpose() * weight;
        right += row * (square[k] * weight);
    }
    let edf = allan_edf(PowerLaw::WhiteAngle, AllanKind::Overlapping, 1, angles);
    // with a walk and a curvature where the data ask for them, without where they would be negative
    let whole = gram.cholesky().map(|c| c.solve(&right));
    let walk = {
        let g = gram.fixed_view::<2, 2>(0, 0).into_owned();
        let r = right.fixed_rows::<2>(0).into_owned();
        g.cholesky().map(|c| c.solve(&r))
    };
    let level = match (whole, walk) {
        (Some(fit), _) if fit.x > 0.0 && fit.y >= 0.0 && fit.z >= 0.0 => fit.x,
        (_, Some(fit)) if fit.x > 0.0 && fit.y >= 0.0 => fit.x,
        _ => square[0] / 6.0,
    };
    let sigma = level.sqrt();
    // two more unknowns triple the error of the first difference alone, in a simulation of white noise
    let error = sigma * (0.5 / edf).sqrt() * 2.0;
    Ok(Some(Rival { sigma, error }))
}

/// White noise from the floor of the spectrum above half the Nyquist frequency.
///
/// # Errors
/// Times that do not ascend, or a spectrum that cannot be made.
pub fn spectral_floor(t_s: &[f64], x: &[f64], step_s: f64) -> Result<Option<Rival>, AssessError> {
    let runs = continuous_runs(t_s, x, step_s, 0.2)?;
    let longest = runs.iter().map(|run| run.len()).max().unwrap_or(0);
    let segment = (longest / 4).min(256);
    if segment < 32 {
        return Ok(None);
    }
    let runs: Vec<_> = runs
        .into_iter()
        .filter(|run| run.len() >= segment)
        .collect();
    let fs_hz = 1.0 / step_s;
    let mut settings = WelchSettings::half_overlap(segment, fs_hz);
    settings.detrend = Detrend::Linear;
    let psd = Welch::new(settings)?.process_runs(x, &runs)?;
    let band = |f: f64| (0.25 * fs_hz..=0.475 * fs_hz).contains(&f);
    let bins: Vec<usize> = (0..psd.len())
        .filter(|k| band(psd.frequency_hz[*k]))
        .collect();
    if bins.is_empty() {
        return Ok(None);
    }
    let n = bins.len() as f64;
    let floor = bins.iter().map(|k| psd.psd[*k]).sum::<f64>() / n;
    // a Hann window makes neighbours agree: two thirds of the bins count
    let dof = bins.iter().map(|k| psd.dof[*k]).sum::<f64>() * 0.5;
    let sigma = (floor * fs_hz / 2.0).sqrt();
    Ok(Some(Rival {
        sigma,
        error: sigma * (0.5 / dof).sqrt(),
    }))
}
