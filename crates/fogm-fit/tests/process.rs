//! Simulated processes and densities against theory, with tolerances from theory.
//!
//! Gates are 5 standard errors; over 400 seeds each z had an rms near 1 (see `z_scores`).

use fogm_fit::{
    Fogm, FogmError, FogmWhite, as_printed, consistent_sigma_hsf, continuous, expected_periodogram,
    log_fit_factor, printed_sigma_hsf, sampled,
};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;
use std::f64::consts::{PI, SQRT_2};

fn run(process: FogmWhite, dt_s: f64, n: usize, seed: u64) -> Vec<f64> {
    let mut out = vec![0.0; n];
    process.simulate_into(dt_s, &mut Xoshiro256PlusPlus::seed_from_u64(seed), &mut out);
    out
}

/// Lag-one correlation of a zero-mean series: standard error `sqrt((1 - a^2)/n)`, bias `-2a/n`.
fn z_lag_one(fogm: Fogm, dt_s: f64, n: usize, seed: u64) -> Result<f64, FogmError> {
    let y = run(FogmWhite::new(fogm, 0.0)?, dt_s, n, seed);
    let top: f64 = y.windows(2).map(|p| p[0] * p[1]).sum();
    let bottom: f64 = y[..n - 1].iter().map(|v| v * v).sum();
    let a = fogm.decay(dt_s);
    let nf = n as f64;
    Ok((top / bottom - a + 2.0 * a / nf) / ((1.0 - a * a) / nf).sqrt())
}

/// Mean square: standard error `sigma^2 sqrt(2/n (1 + a^2)/(1 - a^2))`.
fn z_variance(fogm: Fogm, dt_s: f64, n: usize, seed: u64) -> Result<f64, FogmError> {
    let y = run(FogmWhite::new(fogm, 0.0)?, dt_s, n, seed);
    let (s2, a) = (fogm.sigma() * fogm.sigma(), fogm.decay(dt_s));
    let got = y.iter().map(|v| v * v).sum::<f64>() / n as f64;
    Ok((got / s2 - 1.0) / (2.0 / n as f64 * (1.0 + a * a) / (1.0 - a * a)).sqrt())
}

#[test]
fn simulation_has_the_lag_one_correlation_and_variance_of_theory() -> Result<(), FogmError> {
    for (dt, seed) in [(0.1, 1), (1.0, 2), (10.0, 3), (100.0, 4)] {
        let fogm = Fogm::new(0.5, 30.0)?;
        let (lag, variance) = (
            z_lag_one(fogm, dt, 100_000, seed)?,
            z_variance(fogm, dt, 100_000, seed)?,
        );
        assert!(lag.abs() < 5.0, "lag one at {dt} s: z = {lag}");
        assert!(variance.abs() < 5.0, "variance at {dt} s: z = {variance}");
    }
    Ok(())
}

/// The gates themselves: z has rms 1 within 5/sqrt(2 * 400) over 400 seeds.
#[test]
fn z_scores() -> Result<(), FogmError> {
    let fogm = Fogm::new(2.0, 5.0)?;
    let rms = |z: &dyn Fn(u64) -> Result<f64, FogmError>| -> Result<f64, FogmError> {
        let mut sum = 0.0;
        for seed in 0..400 {
            sum += z(seed)?.powi(2);
        }
        Ok((sum / 400.0).sqrt())
    };
    let tolerance = 5.0 / 800.0_f64.sqrt();
    let lag = rms(&|seed| z_lag_one(fogm, 1.0, 5000, seed))?;
    let variance = rms(&|seed| z_variance(fogm, 1.0, 5000, seed))?;
    assert!((lag - 1.0).abs() < tolerance, "{lag}");
    assert!((variance - 1.0).abs() < tolerance, "{variance}");
    Ok(())
}

/// The first sample already has the full variance: mean square of 4000 first and second samples, each
/// with relative standard error sqrt(2/4000). A start at zero or a frozen state fails.
#[test]
fn start_is_stationary_and_the_state_moves() -> Result<(), FogmError> {
    let fogm = Fogm::new(3.0, 2.0)?;
    let a = fogm.decay(1.0);
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(5);
    let (mut first, mut second, mut cross) = (0.0, 0.0, 0.0);
    for _ in 0..4000 {
        let start = fogm.start(&mut rng);
        let mut state = start;
        // two steps make one of their sum
        fogm.step(&mut state, 0.25, &mut rng);
        fogm.step(&mut state, 0.75, &mut rng);
        first += start * start;
        second += state * state;
        cross += start * state;
    }
    let scale = 4000.0 * 9.0;
    let tolerance = 5.0 * (2.0_f64 / 4000.0).sqrt();
    assert!((first / scale - 1.0).abs() < tolerance, "{first}");
    assert!((second / scale - 1.0).abs() < tolerance, "{second}");
    // a product of two has relative variance 1 + a^2
    let spread = 5.0 * ((1.0 + a * a) / 4000.0).sqrt();
    assert!((cross / scale - a).abs() < spread, "{cross}");
    Ok(())
}

/// Mean ratio of a periodogram to a density over bins `from..to` of a series.
fn level(y: &[f64], fs_hz: f64, bins: std::ops::Range<usize>, density: impl Fn(f64) -> f64) -> f64 {
    let n = y.len();
    let count = bins.len() as f64;
    let mut sum = 0.0;
    for j in bins {
        let step = std::f64::consts::TAU * j as f64 / n as f64;
        let (mut re, mut im) = (0.0, 0.0);
        for (k, v) in y.iter().enumerate() {
            let (s, c) = (step * k as f64).sin_cos();
            re += v * c;
            im -= v * s;
        }
        let psd = 2.0 / (n as f64 * fs_hz) * (re * re + im * im);
        sum += psd / density(j as f64 * fs_hz / n as f64);
    }
    sum / count
}

/// Samples 1 s and 3 s apart in turn, tau = 4 s: correlations e^-1/4 and e^-3/4 of neighbours. Of 4 10^4 pairs
/// each, with some 10 samples to an independent one, the standard error is below 0.016.
#[test]
fn neighbours_are_as_alike_as_their_distance_says() -> Result<(), FogmError> {
    let t_s: Vec<f64> = (0..80_000)
        .map(|k| 2.0 * f64::from(k) + f64::from(k % 2))
        .collect();
    let process = FogmWhite::new(Fogm::new(1.0, 4.0)?, 0.0)?;
    let mut y = vec![0.0; t_s.len()];
    process.simulate_at_into(&t_s, &mut Xoshiro256PlusPlus::seed_from_u64(3), &mut y);
    for (first, dt_s) in [(0, 3.0_f64), (1, 1.0)] {
        let pairs = (first..y.len() - 1).step_by(2);
        let n = pairs.clone().count() as f64;
        let product: f64 = pairs.map(|k| y[k] * y[k + 1]).sum::<f64>() / n;
        let want = (-dt_s / 4.0).exp();
        assert!(
            (product - want).abs() < 0.08,
            "{dt_s} s: {product}, but {want}"
        );
    }
    Ok(())
}

/// Erratum E16: Eq. 15 prints `exp(-tau/tau_HSF)`, which grows without bound for negative lags. An
/// autocovariance is even and nowhere above its value at zero.
#[test]
fn autocovariance_is_even_in_the_lag() -> Result<(), FogmError> {
    let process = FogmWhite::new(Fogm::new(3.58, 161.0)?, 7.43)?;
    for lag_s in [0.1, 50.0, 161.0, 2000.0] {
        let (later, earlier) = (
            process.autocovariance(lag_s),
            process.autocovariance(-lag_s),
        );
        assert!((later - earlier).abs() < 1e-14, "{later} {earlier}");
        let expected = 3.58 * 3.58 * f64::exp(-lag_s / 161.0);
        assert!((earlier - expected).abs() < 1e-13, "{earlier} {expected}");
        assert!(earlier < process.autocovariance(0.0));
    }
    Ok(())
}

/// E6: a simulated FOGM has the one-sided level, twice the printed one. 40 bins near and below the
/// corner in each of 10 series: relative standard error 1/sqrt(400) = 0.05.
#[test]
fn printed_fogm_term_is_two_sided() -> Result<(), FogmError> {
    let process = FogmWhite::new(Fogm::new(5.0, 20.0)?, 0.0)?;
    let (fs, n) = (2.0, 20_000);
    let mean = |density: fn(FogmWhite, f64, f64) -> f64| {
        (0..10)
            .map(|seed| {
                let y = run(process, 1.0 / fs, n, seed);
                level(&y, fs, 20..60, |f| density(process, f, fs))
            })
            .sum::<f64>()
            / 10.0
    };
    let (right, printed) = (mean(sampled), mean(as_printed));
    assert!((right - 1.0).abs() < 5.0 * 0.05, "sampled {right}");
    assert!((printed - 2.0).abs() < 5.0 * 0.1, "printed {printed}");
    assert!((mean(continuous) - 1.0).abs() < 5.0 * 0.05);
    // and the printed form becomes right with its own sigma
    let named = FogmWhite::new(Fogm::new(printed_sigma_hsf(5.0), 20.0)?, 0.0)?;
    for f in [0.0, 0.01, 0.3] {
        let (a, b) = (as_printed(named, f, fs), continuous(process, f, fs));
        assert!((a / b - 1.0).abs() < 1e-15, "{f} Hz: {a} {b}");
    }
    assert!((consistent_sigma_hsf(printed_sigma_hsf(5.0)) - 5.0).abs() < 1e-15);
    assert!((printed_sigma_hsf(1.0) - SQRT_2).abs() < 1e-15);
    Ok(())
}

/// E7: over [0, fs/2] the density integrates to the variance; up to pi fs it does not. Midpoint
/// rule of a periodic analytic function: exact to rounding at this number of nodes.
#[test]
fn frequencies_run_to_half_the_sampling_frequency() -> Result<(), FogmError> {
    let process = FogmWhite::new(Fogm::new(3.0, 4.0)?, 2.0)?;
    let (fs, nodes) = (5.0, 20_000);
    let integral = |end: f64| {
        let df = end / f64::from(nodes);
        (0..nodes)
            .map(|k| sampled(process, (f64::from(k) + 0.5) * df, fs) * df)
            .sum::<f64>()
    };
    let variance = process.autocovariance(0.0);
    assert!((integral(0.5 * fs) / variance - 1.0).abs() < 1e-10);
    assert!(integral(PI * fs) / variance > 6.0);
    Ok(())
}

/// E8: at fs/2 the sampled density is pi^2/4 times the continuous one, at low frequency equal, and
/// 2.25 times over the top tenth of the band; the simulated series follows the sampled one. 400 bins:
/// standard error 0.05.
#[test]
fn sampling_folds_the_density() -> Result<(), FogmError> {
    let process = FogmWhite::new(Fogm::new(1.0, 100.0)?, 0.0)?;
    let fs = 10.0;
    let ratio = |f: f64| sampled(process, f, fs) / continuous(process, f, fs);
    // next order in (dt/tau)^2 = 1e-6
    assert!((ratio(0.5 * fs) - PI * PI / 4.0).abs() < 1e-5);
    assert!((ratio(1e-4) - 1.0).abs() < 1e-5);
    let top = (0..1000).map(|k| ratio(4.5 + 0.5 * (f64::from(k) + 0.5) / 1000.0));
    assert!((top.sum::<f64>() / 1000.0 - 2.25).abs() < 0.01);
    // leakage of the rectangular window would hide the fold, but tau below a hundredth of the span
    // and the closed expectation tell the two apart
    let process = FogmWhite::new(Fogm::new(1.0, 0.5)?, 0.0)?;
    let y = run(process, 1.0 / fs, 16_000, 6);
    let got = level(&y, fs, 7200..7600, |f| sampled(process, f, fs));
    let wrong = level(&y, fs, 7200..7600, |f| continuous(process, f, fs));
    assert!((got - 1.0).abs() < 0.25, "{got}");
    assert!(wrong > 1.9, "{wrong}");
    Ok(())
}

/// The expectation of the periodogram: 600 series of 64 samples, standard error of each bin
/// 1/sqrt(600); where leakage dominates, the sampled density is far off.
#[test]
fn periodogram_has_its_closed_expectation() -> Result<(), FogmError> {
    let process = FogmWhite::new(Fogm::new(4.0, 300.0)?, 0.01)?;
    let (fs, n) = (1.0, 64);
    for j in [1, 5, 20, 31] {
        let mut sum = 0.0;
        for seed in 0..600 {
            let y = run(process, 1.0 / fs, n, seed);
            sum += level(&y, fs, j..j + 1, |f| {
                expected_periodogram(process, f, fs, n)
            });
        }
        let mean = sum / 600.0;
        assert!(
            (mean - 1.0).abs() < 5.0 / 600.0_f64.sqrt(),
            "bin {j}: {mean}"
        );
    }
    let f = 1.0 / 64.0;
    assert!(expected_periodogram(process, f, fs, n) / sampled(process, f, fs) > 1.5);
    Ok(())
}

/// E9: the factor of an uncorrected fit of logarithms is exp(-gamma/2) for a raw periodogram.
#[test]
fn uncorrected_logarithms_shrink_sigmas() {
    assert!((log_fit_factor(2.0) - 0.749_306).abs() < 1e-6);
    assert!((log_fit_factor(2000.0) - 1.0).abs() < 1e-3);
}

#[test]
fn impossible_parameters_are_refused() -> Result<(), FogmError> {
    let name = |e: Result<Fogm, FogmError>| e.err().map(|e| e.to_string()).unwrap_or_default();
    assert_eq!(
        name(Fogm::new(1.0, 0.0)),
        "tau_s = 0 must be finite and positive"
    );
    assert_eq!(
        name(Fogm::new(f64::NAN, 1.0)),
        "sigma = NaN must be finite and not negative"
    );
    assert!(Fogm::new(f64::INFINITY, 1.0).is_err() && Fogm::new(1.0, f64::NAN).is_err());
    let fogm = Fogm::new(0.0, 1.0)?;
    assert!(FogmWhite::new(fogm, -1.0).is_err());
    Ok(())
}
