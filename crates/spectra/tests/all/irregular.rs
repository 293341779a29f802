//! Lomb-Scargle: the periodogram on regular samples, the right level on irregular ones.
use spectra::{
    Detrend, LombScargle, LombScargleSettings, SpectraError, Window, mean_rate_hz, periodogram,
};

use crate::cases::{close, mean_and_error, white};

/// At multiples of fs/N regular samples make sines orthogonal, and the fit the transform. The last bin,
/// fs/2, has no sine.
#[test]
fn regular_samples_give_the_periodogram() -> Result<(), SpectraError> {
    for (samples, floating_mean) in [(200, false), (200, true), (301, true)] {
        let x = white(samples, 5);
        let t_s: Vec<f64> = (0..samples).map(|n| 40.0 + n as f64 / 4.0).collect();
        let expected = periodogram(&x, 4.0, Window::Boxcar, Detrend::Constant)?;
        let step_hz = 4.0 / samples as f64;
        let settings = LombScargleSettings {
            first_hz: step_hz,
            step_hz,
            bins: samples / 2,
            floating_mean,
            fs_hz: mean_rate_hz(&t_s)?,
        };
        let got = LombScargle::new(&t_s, settings)?.process(&x)?;
        for k in 0..samples / 2 {
            close(got.psd[k], expected.psd[k + 1], 10.0, 1e-12, (samples, k));
            close(got.dof[k], expected.dof[k + 1], 1.0, 1e-15, (samples, k));
        }
    }
    Ok(())
}

/// White noise of unit variance stands at `2/fs` in every bin, exactly so in the mean with a mean of its own
/// fitted: then the fit takes two of N degrees of freedom out of independent values. One mean removed
/// before costs `1/N`.
#[test]
fn white_noise_has_its_level() -> Result<(), SpectraError> {
    let mut t_s = vec![];
    let mut t = 0.0;
    for jump in white(150, 6) {
        t += 0.1 + jump.abs();
        t_s.push(t);
    }
    let settings = LombScargleSettings {
        first_hz: 0.01,
        step_hz: 0.013,
        bins: 60,
        floating_mean: true,
        fs_hz: 1.25,
    };
    let plan = LombScargle::new(&t_s, settings)?;
    let (mut scratch, mut psd) = (plan.make_scratch(), vec![0.0; 60]);
    let mut means = vec![];
    for seed in 0..400 {
        plan.process_into(&white(150, 1000 + seed), &mut scratch, &mut psd)?;
        means.push(psd.iter().sum::<f64>() / 60.0);
    }
    let [mean, error] = mean_and_error(&means);
    assert!((mean - 1.6).abs() < 5.0 * error, "{mean} +- {error}");
    Ok(())
}

/// Phases are turned from bin to bin: after 4000 bins still those of a plan that starts at the last one. Each
/// turn rounds by `eps` and turns are computed anew every 128 bins: `128 eps` of the amplitude.
#[test]
fn many_bins_do_not_drift() -> Result<(), SpectraError> {
    let x = white(100, 9);
    let t_s: Vec<f64> = (0..100)
        .map(|n| f64::from(n) + 0.01 * f64::from(n * n % 23))
        .collect();
    let plan = |first_hz, bins| {
        let settings = LombScargleSettings {
            first_hz,
            step_hz: 1e-4,
            bins,
            floating_mean: true,
            fs_hz: 1.0,
        };
        LombScargle::new(&t_s, settings)?.process(&x)
    };
    let many = plan(1e-4, 4095)?;
    let last = plan(0.4095, 1)?;
    close(many.psd[4094], last.psd[0], 10.0, 3e-14, "last bin");
    Ok(())
}
