//! Coherence: its level without relation, its value and phase with one.
use spectra::{Detrend, SpectraError, Welch, WelchSettings, coherence_significance, whole};

use crate::cases::{mean_and_error, share, white};

/// Unrelated series exceed the level as often as it says: exact for separate segments.
#[test]
fn unrelated_series_stay_below_the_level() -> Result<(), SpectraError> {
    let welch = Welch::new(WelchSettings {
        overlap: 0,
        detrend: Detrend::None,
        ..WelchSettings::half_overlap(32, 1.0)
    })?;
    let (mut above, mut trials) = ([0; 2], 0);
    for seed in 0..400 {
        let (x, y) = (white(320, 2 * seed), white(320, 2 * seed + 1));
        let cross = welch.process_cross(&x, &y, &whole(&x))?;
        let coherence = cross.coherence();
        // Hann's window joins bins up to two apart
        for k in [3, 6, 9, 12] {
            trials += 1;
            for (a, alpha) in above.iter_mut().zip([0.05, 0.3]) {
                *a += usize::from(coherence[k] > coherence_significance(alpha, cross.dof[k])?);
            }
        }
    }
    share(above[0], trials, 0.05, 0.0, "5 %");
    share(above[1], trials, 0.3, 0.0, "30 %");
    Ok(())
}

/// `y` is `x` two samples later, plus as much noise: coherence 1/2, phase `-2 w` (`y` lags). The bias of the
/// coherence is `(1 - c)^2 / (nu/2)`, and the delay costs `2 lag/N` of it.
#[test]
fn delay_shows_in_the_phase() -> Result<(), SpectraError> {
    let welch = Welch::new(WelchSettings::half_overlap(128, 1.0))?;
    let (mut phases, mut coherences, mut dof) = (vec![], vec![], 0.0);
    for seed in 0..100 {
        let (x, noise) = (white(4096, 2 * seed), white(4096, 2 * seed + 1));
        let y: Vec<f64> = (0..4096)
            .map(|n| noise[n] + if n < 2 { 0.0 } else { x[n - 2] })
            .collect();
        let cross = welch.process_cross(&x, &y, std::slice::from_ref(&(2..4096)))?;
        phases.push(cross.phase_rad()[16]);
        coherences.push(cross.coherence()[16]);
        dof = cross.dof[16];
    }
    let [phase, error] = mean_and_error(&phases);
    let expected = -2.0 * std::f64::consts::TAU * 16.0 / 128.0;
    assert!(
        (phase - expected).abs() < 5.0 * error,
        "{phase} +- {error}, {expected}"
    );
    let [coherence, error] = mean_and_error(&coherences);
    let expected = 0.5 + 0.25 / (dof / 2.0);
    assert!(
        (coherence - expected).abs() < 5.0 * error + 4.0 / 128.0,
        "{coherence} +- {error}, {expected}"
    );
    assert!((coherence_significance(0.5, 2.0)? - 1.0).abs() < 1e-15);
    Ok(())
}
