//! The plateau against noise whose white part is known.

use assess::{AxisNoise, FlatInterval, axis_noise, pooled_sigma};
use rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;

const STEP_S: f64 = 0.2;

/// `sigma` white, a Gauss-Markov process, rounded to multiples of `quantum`.
fn series(n: u32, sigma: f64, fogm: [f64; 2], quantum: f64, seed: u64) -> (Vec<f64>, Vec<f64>) {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let a = (-STEP_S / fogm[1]).exp();
    let mut state = normal();
    let t: Vec<f64> = (0..n).map(|k| STEP_S * f64::from(k)).collect();
    let x = t.iter().map(|t| {
        state = a * state + (1.0 - a * a).sqrt() * normal();
        let x = fogm[0] * state + sigma * normal() + 0.01 * t;
        if quantum > 0.0 {
            (x / quantum).round() * quantum
        } else {
            x
        }
    });
    let x = x.collect();
    (t, x)
}

fn noise(n: u32, sigma: f64, fogm: [f64; 2], quantum: f64, seed: u64) -> AxisNoise {
    let (t, x) = series(n, sigma, fogm, quantum, seed);
    axis_noise(&t, &x, STEP_S).expect("the test's own numbers are valid")
}

/// z over 60 seeds for white noise, white on a Gauss-Markov process, and white rounded to one and a half
/// sigma, whose rounding error adds a twelfth of the square. The rms of 60 z is 1 +- 0.09; the choice of
/// the plateau and the slope that may not be negative take some from either side. Bounds: 5 standard
/// errors above, and the mean within 0.7.
#[test]
fn the_plateau_is_the_white_noise() {
    for (name, fogm, quantum) in [
        ("white", [0.0, 1.0], 0.0),
        ("white and Gauss-Markov", [3.58, 161.0], 0.0),
        ("white, rounded", [0.0, 1.0], 3.0),
    ] {
        let sigma = 2.0;
        let truth = f64::hypot(sigma, quantum / 12.0_f64.sqrt());
        let (mut sum, mut square, mut far) = (0.0, 0.0, 0);
        for seed in 0..60 {
            let plateau = noise(9000, sigma, fogm, quantum, seed)
                .plateau
                .unwrap_or_else(|| panic!("{name}, seed {seed}: no plateau"));
            let z = (plateau.sigma - truth) / plateau.error;
            sum += z / 60.0;
            square += z * z / 60.0;
            far += usize::from(z.abs() > 5.0);
        }
        println!("{name}: mean {sum:.2}, rms {:.2}", square.sqrt());
        assert!(
            square.sqrt() < 1.45 && sum.abs() < 0.7 && far == 0,
            "{name}"
        );
    }
}

/// The rivals see the same white noise: 60 seeds, mean of the ratio within five standard errors, which
/// are below one percent of it.
#[test]
fn allan_deviation_and_floor_agree_with_it() {
    let (mut allan, mut floor) = (0.0, 0.0);
    for seed in 0..60 {
        let found = noise(9000, 2.0, [3.58, 161.0], 0.0, 100 + seed);
        allan += found.allan.unwrap().sigma / 120.0;
        floor += found.floor.unwrap().sigma / 120.0;
    }
    assert!((allan - 1.0).abs() < 0.01, "{allan}");
    assert!((floor - 1.0).abs() < 0.01, "{floor}");
}

/// A Gauss-Markov process alone has no white noise: its parabolas grow with the span from the start.
#[test]
fn a_process_without_white_noise_has_no_plateau() {
    for seed in 0..20 {
        let found = noise(9000, 0.0, [5.0, 100.0], 0.0, seed);
        assert!(found.plateau.is_none(), "{seed}: {:?}", found.plateau);
    }
}

/// Erratum E13: with the lower sum to n, the number of all frames, or to any other bound than N, the
/// pooled variance of equal intervals would not be their variance.
#[test]
fn both_sums_of_equation_6_run_over_the_intervals() {
    let one = FlatInterval {
        span_s: [0.0, 500.0],
        frames: 500,
        sigma: 1.7,
    };
    assert!((pooled_sigma(&[one; 7]).unwrap() - 1.7).abs() < 1e-12);
    assert!(pooled_sigma(&[]).is_none());
}

/// Gaps leave the windows between them whole; a record cut by a gap every 30 s has no window of 40 s.
#[test]
fn gaps_are_not_bridged() {
    let (t, x) = series(9000, 2.0, [0.0, 1.0], 0.0, 3);
    let hole = |t: f64| t.rem_euclid(30.0) > 27.0;
    let (t, x): (Vec<f64>, Vec<f64>) = t.into_iter().zip(x).filter(|(t, _)| !hole(*t)).unzip();
    let found = axis_noise(&t, &x, STEP_S).unwrap();
    let longest = found.spans.last().unwrap().span_s;
    assert!(longest < 30.0, "{longest}");
    let plateau = found.plateau.unwrap();
    assert!((plateau.sigma - 2.0).abs() < 5.0 * plateau.error);
}
