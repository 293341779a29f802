//! Lines: how often noise shows one, and how well frequency and amplitude are recovered.
use std::f64::consts::{PI, TAU};

use spectra::{Complex, Multitaper, MultitaperSettings, SpectraError, f_test_ln_p};

use crate::cases::{autoregressive, mean_and_error, share, white};

/// The statistic follows F(2, 2K - 2) in white noise: exact, away from the ends where a frequency meets its image.
#[test]
fn f_statistic_has_its_distribution() -> Result<(), SpectraError> {
    let plan = Multitaper::new(MultitaperSettings::new(256, 4.0, 1.0))?;
    let mut scratch = plan.make_scratch();
    let (mut f, mut c) = (vec![0.0; plan.bins()], vec![Complex::ZERO; plan.bins()]);
    let (mut rare, mut half, mut trials) = (0, 0, 0);
    for seed in 0..400 {
        plan.f_test_into(&white(256, seed), &mut scratch, &mut f, &mut c)?;
        for k in (12..116).step_by(13) {
            let ln_p = f_test_ln_p(f[k], 7);
            trials += 1;
            rare += usize::from(ln_p < 0.01_f64.ln());
            half += usize::from(ln_p < 0.5_f64.ln());
        }
    }
    share(rare, trials, 0.01, 0.0, "1 %");
    share(half, trials, 0.5, 0.0, "50 %");
    Ok(())
}

/// White and coloured noise show a line in no more than `alpha` of the series.
#[test]
fn noise_shows_no_more_lines_than_it_says() -> Result<(), SpectraError> {
    let plan = Multitaper::new(MultitaperSettings::for_lines(500, 4.0, 1.0))?;
    let mut scratch = plan.make_scratch();
    let mut alarms = 0;
    for seed in 0..300 {
        for x in [white(500, seed), autoregressive(0.95, 500, seed)] {
            alarms += usize::from(!plan.find_lines(&x, 0.05, 3, &mut scratch)?.is_empty());
        }
    }
    // 600 series, 5 %: 30 +- 5.3; the union bound over four bins a width is generous by about two
    assert!((3..=57).contains(&alarms), "{alarms} of 600");
    Ok(())
}

/// Two lines in noise, anywhere between bins: found, with errors of the size given. The frequency is
/// within 1.4 times its Cramer-Rao bound, a hundredth of a bin.
#[test]
fn lines_are_refined_far_below_a_bin() -> Result<(), SpectraError> {
    let (samples, fs_hz) = (1000_u32, 5.0);
    let plan = Multitaper::new(MultitaperSettings::for_lines(1000, 4.0, fs_hz))?;
    let mut scratch = plan.make_scratch();
    let (mut squares, mut others) = ([vec![], vec![], vec![]], 0);
    let bound = (6.0 * fs_hz * fs_hz / (PI * PI * f64::from(samples).powi(3))).sqrt();
    for seed in 0..200_u32 {
        let share = f64::from(seed) / 200.0;
        let truth = [
            (0.6 + 0.005 * share, 1.5, 0.3 + share),
            (1.7 + 0.005 * (1.0 - share), 1.0, -2.0),
        ];
        let mut x = white(1000, 7000 + u64::from(seed));
        for (n, v) in (0..samples).zip(&mut x) {
            let t_s = f64::from(n) / fs_hz;
            for (f, a, p) in truth {
                *v += a * (TAU * f * t_s + p).cos();
            }
        }
        let lines = plan.find_lines(&x, 0.05, 4, &mut scratch)?;
        others += lines.len() - 2;
        for (f, a, p) in truth {
            let near = |l: &&spectra::Line| (l.frequency_hz - f).abs() < 2e-3;
            let line = lines.iter().find(near).unwrap();
            squares[0].push(((line.frequency_hz - f) / line.sigma_frequency_hz).powi(2));
            squares[1].push(((line.amplitude - a) / line.sigma_amplitude).powi(2));
            squares[2].push(line.sigma_frequency_hz * a / bound);
            assert!(line.ln_p < 0.05_f64.ln() && line.f > 10.0);
            // the phase at the first sample errs with the frequency half a series long
            let sigma = line.sigma_frequency_hz * TAU * 100.0 + line.sigma_amplitude / a;
            assert!((line.phase_rad - p).abs() < 6.0 * sigma, "{line:?} {p}");
        }
    }
    // one more in 5 % of the series or fewer: 10 +- 3
    assert!(others <= 25, "{others} lines of noise");
    // the noise comes from 2K - 2 = 12 values: z^2 follows F(1, 12), mean 12/10
    for values in &squares[..2] {
        let [mean, error] = mean_and_error(values);
        assert!(
            (mean - 1.2).abs() < 5.0 * error,
            "mean z^2 {mean} +- {error}"
        );
    }
    let [ratio, _] = mean_and_error(&squares[2]);
    assert!(ratio < 1.4, "{ratio} times the Cramer-Rao bound");
    Ok(())
}

/// Without noise the line comes back to rounding, and nothing is left.
#[test]
fn pure_line_is_taken_out() -> Result<(), SpectraError> {
    let x: Vec<f64> = (0..800)
        .map(|n| 2.0 * (0.9 * f64::from(n) - 1.0).cos())
        .collect();
    let plan = Multitaper::new(MultitaperSettings {
        detrend: spectra::Detrend::None,
        ..MultitaperSettings::for_lines(800, 4.0, TAU)
    })?;
    let mut scratch = plan.make_scratch();
    let lines = plan.find_lines(&x, 0.01, 1, &mut scratch)?;
    // rounds against the image, whose sidelobes are below 1e-3, leave rounding
    assert!((lines[0].frequency_hz - 0.9).abs() < 1e-12, "{lines:?}");
    assert!((lines[0].phase_rad + 1.0).abs() < 1e-10, "{lines:?}");
    assert!((lines[0].amplitude - 2.0).abs() < 1e-11, "{lines:?}");
    assert!(scratch.remainder().iter().all(|r| r.abs() < 1e-10));
    Ok(())
}
