//! What holds exactly: Parseval's identity, the height of lines, gaps, averages.
use spectra::{
    Detrend, LogAverage, Multitaper, MultitaperSettings, Psd, SpectraError, TaperWeights, Welch,
    WelchSettings, Window, coherent_gain, finite_runs, noise_bandwidth_bins, periodogram,
};

use crate::cases::{close, white};

const WINDOWS: [Window; 7] = [
    Window::Boxcar,
    Window::Hann,
    Window::Hamming,
    Window::Blackman,
    Window::BlackmanHarris,
    Window::Nuttall,
    Window::FlatTop,
];

/// `sum psd df = mean x^2`, for even and odd lengths: only sums of N terms, each to `eps`.
#[test]
fn parseval_of_the_periodogram() -> Result<(), SpectraError> {
    for samples in [2, 3, 17, 1000, 1009, 4096] {
        let x = white(samples, 1);
        let power = x.iter().map(|v| v * v).sum::<f64>() / samples as f64;
        let spectrum = periodogram(&x, 5.0, Window::Boxcar, Detrend::None)?;
        close(spectrum.variance().unwrap(), power, power, 1e-14, samples);
    }
    Ok(())
}

/// The same with windows: the mean of `(w x)^2` over that of `w^2`; averaged over segments for Welch.
#[test]
fn parseval_with_windows_and_tapers() -> Result<(), SpectraError> {
    let x = white(300, 2);
    for window in WINDOWS {
        let welch = Welch::new(WelchSettings {
            segment: 100,
            overlap: 37,
            window,
            detrend: Detrend::None,
            fs_hz: 3.0,
        })?;
        let w = welch.window();
        let square: f64 = w.iter().map(|v| v * v).sum();
        let of_segment = |s: usize| {
            let pairs = x[63 * s..].iter().zip(w);
            pairs.map(|(v, w)| (v * w).powi(2)).sum::<f64>() / square
        };
        let expected = (0..4).map(of_segment).sum::<f64>() / 4.0;
        let got = welch.process(&x)?.variance().unwrap();
        close(got, expected, expected, 1e-14, window);
    }
    let multitaper = Multitaper::new(MultitaperSettings {
        weights: TaperWeights::Uniform,
        detrend: Detrend::None,
        transform: 512,
        ..MultitaperSettings::new(300, 3.0, 3.0)
    })?;
    let of_taper = |k: usize| {
        let pairs = x.iter().zip(multitaper.tapers().taper(k));
        pairs.map(|(v, w)| (v * w).powi(2)).sum::<f64>()
    };
    let expected = (0..5).map(of_taper).sum::<f64>() / 5.0;
    let got = multitaper.process(&x)?.variance().unwrap();
    close(got, expected, expected, 1e-14, "multitaper");
    Ok(())
}

/// A line at the middle of a bin: `A^2/2 / (df enbw)` there, whatever the window.
#[test]
fn height_of_a_line() -> Result<(), SpectraError> {
    let line: Vec<f64> = (0..128)
        .map(|n| 3.0 * (std::f64::consts::TAU * 20.0 * f64::from(n) / 128.0 + 0.3).cos())
        .collect();
    for window in WINDOWS {
        let spectrum = periodogram(&line, 128.0, window, Detrend::None)?;
        let w = window.values(128);
        let expected = 4.5 / noise_bandwidth_bins(&w);
        close(spectrum.psd[20], expected, expected, 1e-13, window);
        assert!(coherent_gain(&w) > 0.2 && coherent_gain(&w) <= 1.0 + 1e-15);
    }
    // Harris (1978), Table 1
    close(
        noise_bandwidth_bins(&Window::Hamming.values(4096)),
        1.36,
        1.0,
        0.005,
        "Hamming",
    );
    close(
        noise_bandwidth_bins(&Window::Blackman.values(4096)),
        1.73,
        1.0,
        0.005,
        "Blackman",
    );
    close(
        noise_bandwidth_bins(&Window::BlackmanHarris.values(4096)),
        2.0,
        1.0,
        0.006,
        "B.-Harris",
    );
    Ok(())
}

/// Straight lines vanish under a linear trend, constants under a constant one.
#[test]
fn trends_leave_nothing() {
    let line: Vec<f64> = (0..501).map(|n| 7.0 - 0.3 * f64::from(n)).collect();
    let mut out = vec![0.0; 501];
    Detrend::Linear.apply_into(&line, &mut out);
    assert!(out.iter().all(|v| v.abs() < 1e-12));
    Detrend::Constant.apply_into(&[4.25; 501], &mut out);
    assert!(out.iter().all(|v| v.abs() < 1e-14));
}

/// With gaps, the estimate is the mean over the segments inside the runs, and nothing else is read.
#[test]
fn segments_avoid_gaps() -> Result<(), SpectraError> {
    let mut x = white(1000, 3);
    x[260] = f64::NAN;
    x[700..720].fill(f64::NAN);
    let runs = finite_runs(&x);
    assert_eq!(runs, [0..260, 261..700, 720..1000]);
    let welch = Welch::new(WelchSettings::half_overlap(100, 1.0))?;
    let gaps = welch.process_runs(&x, &runs)?;
    let mut psd = vec![0.0; welch.bins()];
    let used = welch.process_into(&x, &runs, &mut welch.make_scratch(), &mut psd)?;
    assert_eq!(
        [used.segments, used.samples_used, used.samples_left_out],
        [15, 900, 100]
    );
    let parts: Vec<Psd> = runs
        .iter()
        .map(|r| welch.process(&x[r.clone()]))
        .collect::<Result<_, _>>()?;
    for k in 0..welch.bins() {
        let counts = [4.0, 7.0, 4.0];
        let sum: f64 = parts.iter().zip(counts).map(|(p, c)| p.psd[k] * c).sum();
        close(gaps.psd[k], sum / 15.0, gaps.psd[k], 1e-13, k);
        // independent runs: the variances 2 S^2/nu of the parts add
        let spread: f64 = parts
            .iter()
            .zip(counts)
            .map(|(p, c)| c * c / p.dof[k])
            .sum();
        close(gaps.dof[k], 225.0 / spread, gaps.dof[k], 1e-13, k);
    }
    let whole = welch.process(&x);
    assert!(matches!(
        whole,
        Err(SpectraError::NotFinite { index: 260, .. })
    ));
    Ok(())
}

/// Every bin but those at 0 and fs/2 is in one group; a mean over a flat spectrum is flat; white bins add up their
/// degrees of freedom; fully correlated ones do not.
#[test]
fn log_average_keeps_power_and_freedom() -> Result<(), SpectraError> {
    let x = white(4096, 4);
    let spectrum = periodogram(&x, 1.0, Window::Boxcar, Detrend::None)?;
    let average = LogAverage::new(&spectrum, 8.0)?;
    let mut next = 1;
    for group in average.groups() {
        assert_eq!(group.start, next);
        next = group.end;
    }
    assert_eq!(next, spectrum.len() - 1);
    let smooth = average.apply(&spectrum, &[1.0]);
    for (group, dof) in average.groups().iter().zip(&smooth.dof) {
        let sum: f64 = spectrum.dof[group.clone()].iter().sum();
        close(*dof, sum, sum, 1e-12, group);
    }
    let weighted = |p: &Psd| -> f64 { p.psd.iter().zip(&p.dof).map(|(s, d)| s * d).sum() };
    let ends = spectrum.psd[0] + spectrum.psd[2048]; // of one degree of freedom each
    let inside = weighted(&spectrum) - ends;
    close(weighted(&smooth), inside, inside, 1e-12, "power");
    let one = average.apply(&spectrum, &vec![1.0; 4096]);
    close(one.dof[smooth.len() - 1], 2.0, 2.0, 1e-9, "all bins alike");
    assert!(smooth.step_hz().is_none() && smooth.variance().is_none());
    Ok(())
}
