//! Degrees of freedom, confidence bands, and the bias of the logarithm, on simulated noise.
//!
//! Gates are five standard errors over the seeds, with the slack named where theory is approximate.
use spectra::{
    Detrend, LogAverage, Multitaper, MultitaperSettings, Psd, SpectraError, TaperWeights, Welch,
    WelchSettings, Window, log_bias, log_variance, periodogram,
};

use crate::cases::{autoregressive, mean_and_error, share, white};

const SEEDS: u64 = 400;

/// White noise of unit variance at 1 Hz has the one-sided density 2; at 0 and fs/2, not doubled, 1.
fn level(frequency_hz: f64) -> f64 {
    if (0.001..0.499).contains(&frequency_hz) {
        2.0
    } else {
        1.0
    }
}

/// Spectra of white noise from `estimate`, and the bins (far enough apart to be independent) to look at.
fn check(
    estimate: impl Fn(&[f64]) -> Result<Psd, SpectraError>,
    samples: usize,
    bins: &[usize],
    slack: f64,
    what: &str,
) -> Result<(), SpectraError> {
    let (mut inside, mut ratios, mut logs, mut log_squares) = (0, vec![], vec![], vec![]);
    for seed in 0..SEEDS {
        let spectrum = estimate(&white(samples, seed))?;
        let band = spectrum.confidence(0.9)?;
        for k in bins {
            let truth = level(spectrum.frequency_hz[*k]);
            inside += usize::from(band.lower[*k] <= truth && truth <= band.upper[*k]);
            let ratio = spectrum.psd[*k] / truth;
            let dof = spectrum.dof[*k];
            ratios.push((ratio - 1.0).powi(2) * dof / 2.0);
            logs.push(ratio.ln() - log_bias(dof));
            log_squares.push((ratio.ln() - log_bias(dof)).powi(2) / log_variance(dof));
        }
    }
    share(inside, logs.len(), 0.9, slack, what);
    for (name, values, expected) in [
        ("variance", &ratios, 1.0),
        ("bias of the logarithm", &logs, 0.0),
        ("variance of the logarithm", &log_squares, 1.0),
    ] {
        let [mean, error] = mean_and_error(values);
        assert!(
            (mean - expected).abs() < 5.0 * error + 2.0 * slack,
            "{what}, {name}: {mean} +- {error}, expected {expected}"
        );
    }
    Ok(())
}

/// Exactly chi-squared: no slack. Without trend, at 0 and fs/2 with one degree of freedom.
#[test]
fn periodogram_is_exact() -> Result<(), SpectraError> {
    let plain = |x: &[f64]| periodogram(x, 1.0, Window::Boxcar, Detrend::None);
    check(plain, 64, &[0, 1, 7, 19, 32], 0.0, "periodogram")
}

/// Separate segments are independent: no slack.
#[test]
fn separate_segments_are_exact() -> Result<(), SpectraError> {
    let welch = Welch::new(WelchSettings {
        segment: 64,
        overlap: 0,
        window: Window::Boxcar,
        detrend: Detrend::None,
        fs_hz: 1.0,
    })?;
    check(
        |x| welch.process(x),
        320,
        &[0, 3, 10, 20, 32],
        0.0,
        "no overlap",
    )
}

/// Overlapping segments: a chi-squared of the right variance is not quite the distribution of the
/// estimate; 0.01 covers the difference of the tails at this overlap.
#[test]
fn overlapping_segments() -> Result<(), SpectraError> {
    for overlap in [32, 48] {
        let welch = Welch::new(WelchSettings {
            overlap,
            detrend: Detrend::None,
            ..WelchSettings::half_overlap(64, 1.0)
        })?;
        check(|x| welch.process(x), 320, &[4, 12, 20, 28], 0.01, "overlap")?;
    }
    Ok(())
}

/// Orthonormal tapers of white noise are independent: exact for uniform weights. The adaptive ones depend on
/// the data a little.
#[test]
fn multitaper_has_twice_its_tapers() -> Result<(), SpectraError> {
    for (weights, slack) in [
        (TaperWeights::Uniform, 0.0),
        (TaperWeights::Adaptive, 0.005),
    ] {
        let multitaper = Multitaper::new(MultitaperSettings {
            weights,
            detrend: Detrend::None,
            ..MultitaperSettings::new(128, 4.0, 1.0)
        })?;
        check(
            |x| multitaper.process(x),
            128,
            &[9, 22, 35, 48],
            slack,
            "multitaper",
        )?;
    }
    Ok(())
}

/// Averaged bins of windowed segments: the correlation of neighbours counts. Without it the
/// degrees of freedom would be twice too many here.
#[test]
fn averaged_bins() -> Result<(), SpectraError> {
    let welch = Welch::new(WelchSettings {
        detrend: Detrend::None,
        ..WelchSettings::half_overlap(256, 1.0)
    })?;
    let correlation = welch.bin_correlation(7);
    let averaged = |x: &[f64]| {
        let spectrum = welch.process(x)?;
        Ok(LogAverage::new(&spectrum, 8.0)?.apply(&spectrum, &correlation))
    };
    check(averaged, 1024, &[6, 9, 12], 0.01, "averaged Welch")?;
    // boxcar segments are joined across bins by their overlap alone
    let welch = Welch::new(WelchSettings {
        window: Window::Boxcar,
        overlap: 128,
        ..welch.settings().clone()
    })?;
    let correlation = welch.bin_correlation(7);
    assert!(correlation.len() > 2 && correlation[1] > 0.05);
    let averaged = |x: &[f64]| {
        let spectrum = welch.process(x)?;
        Ok(LogAverage::new(&spectrum, 8.0)?.apply(&spectrum, &correlation))
    };
    check(averaged, 1024, &[6, 9, 12], 0.01, "averaged boxcars")?;
    let multitaper = Multitaper::new(MultitaperSettings {
        weights: TaperWeights::Uniform,
        detrend: Detrend::None,
        ..MultitaperSettings::new(512, 4.0, 1.0)
    })?;
    let correlation = multitaper.bin_correlation();
    let averaged = |x: &[f64]| {
        let spectrum = multitaper.process(x)?;
        Ok(LogAverage::new(&spectrum, 6.0)?.apply(&spectrum, &correlation))
    };
    check(averaged, 512, &[7, 10], 0.01, "averaged multitaper")
}

/// A coloured spectrum of known density `2 / |1 - phi e^(-i w)|^2`: the mean over seeds, within its error and
/// the bias of the window, `(S''/S) w2 / 2` with `w2 = df^2/3 .. 4 df^2` (below 1 % here).
#[test]
fn coloured_noise_has_its_density() -> Result<(), SpectraError> {
    let phi = 0.9;
    let welch = Welch::new(WelchSettings::half_overlap(512, 1.0))?;
    let multitaper = Multitaper::new(MultitaperSettings::new(2048, 4.0, 1.0))?;
    let (mut by_welch, mut by_multitaper) = (vec![vec![]; 257], vec![vec![]; 1025]);
    for seed in 0..200 {
        let x = autoregressive(phi, 2048, seed);
        for (k, p) in welch.process(&x)?.psd.iter().enumerate() {
            by_welch[k].push(*p);
        }
        for (k, p) in multitaper.process(&x)?.psd.iter().enumerate() {
            by_multitaper[k].push(*p);
        }
    }
    for f in [4, 16, 64, 200_usize] {
        let w = std::f64::consts::TAU * f as f64 / 512.0;
        let truth = 2.0 / (1.0 + phi * phi - 2.0 * phi * w.cos());
        for values in [&by_welch[f], &by_multitaper[4 * f]] {
            let [mean, error] = mean_and_error(values);
            assert!(
                (mean - truth).abs() < 5.0 * error + 0.01 * truth,
                "{f}: {mean} +- {error}, {truth}"
            );
        }
    }
    Ok(())
}
