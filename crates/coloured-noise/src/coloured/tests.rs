use super::*;
use rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;

pub(crate) fn series(noise: &Coloured, t_s: &[f64], seed: u64) -> Vec<f64> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let mut b = noise.slow * normal();
    let mut out = Vec::new();
    for k in 0..t_s.len() {
        if k > 0 {
            let a = (-(t_s[k] - t_s[k - 1]) / noise.tau_s).exp();
            b = a * b + noise.slow * (1.0 - a * a).sqrt() * normal();
        }
        out.push(b + noise.white * normal());
    }
    out
}

/// The likelihood of a series is that of its whitened one less the logarithms of the weights, and
/// steps side by side are those whitened one by one: rounding alone.
#[test]
fn sums_are_those_of_the_whitened_series() {
    let noise = Coloured {
        white: 0.02,
        slow: 0.05,
        tau_s: 40.0,
    };
    let t_s: Vec<f64> = (0..3000).map(|k| 0.1 * f64::from(k)).collect();
    let count: Vec<f64> = (0..3000).map(|k| f64::from(k % 5)).collect();
    let y = series(&noise, &t_s, 12);
    let whitened = |series: &[f64]| {
        let mut out = series.to_vec();
        noise.whiten(&t_s, &count, &mut [&mut out]);
        out
    };
    let weights = noise.gains(&t_s, &count).into_iter().map(|g| g[2]);
    let logs: f64 = weights
        .filter(|w| *w > 0.0)
        .map(|w| w.ln() - 0.5 * std::f64::consts::TAU.ln())
        .sum();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let white = whitened(&y);
    let direct = logs - 0.5 * dot(&white, &white);
    let ours = noise.log_likelihood(&t_s, &y, &count);
    assert!((ours / direct - 1.0).abs() < 1e-9, "{ours} {direct}");
    let one = whitened(&vec![1.0; y.len()]);
    let at: Vec<usize> = (5..2900).step_by(263).collect();
    for (sums, &at) in noise
        .steps(&t_s, &count, &at, [&one, &white])
        .iter()
        .zip(&at)
    {
        let step: Vec<f64> = (0..y.len()).map(|k| f64::from(u8::from(k >= at))).collect();
        let step = whitened(&step);
        let direct = [dot(&step, &step), dot(&step, &one), dot(&step, &white)];
        for (a, b) in sums.iter().zip(direct) {
            assert!((a - b).abs() < 1e-9 * direct[0], "{sums:?} {direct:?}");
        }
    }
}

/// Whitened noise is N(0,1) and independent: the mean square over n rows has
/// standard error sqrt(2/n), the lag-one product 1/sqrt(n).
#[test]
fn whitened_noise_is_white_across_a_gap() {
    let noise = Coloured {
        white: 0.5,
        slow: 1.5,
        tau_s: 40.0,
    };
    let t_s: Vec<f64> = (0..20_000)
        .map(|k| f64::from(k) + if k > 9000 { 500.0 } else { 0.0 })
        .collect();
    let mut y = series(&noise, &t_s, 11);
    noise.whiten(&t_s, &vec![1.0; y.len()], &mut [&mut y]);
    let n = y.len() as f64;
    let square = y.iter().map(|v| v * v).sum::<f64>() / n;
    let lag = y.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / n;
    assert!(
        (square - 1.0).abs() < 5.0 * (2.0 / n).sqrt(),
        "mean square {square}"
    );
    assert!(lag.abs() < 5.0 / n.sqrt(), "lag one {lag}");
}

/// The span is 500 tau and slow dominates: `sigma_b` is known to about
/// sqrt(tau/span) = 4.5 %, tau to twice that, the white part far better.
#[test]
fn the_fit_finds_the_noise() {
    let truth = Coloured {
        white: 0.5,
        slow: 1.5,
        tau_s: 40.0,
    };
    let t_s: Vec<f64> = (0..20_000).map(f64::from).collect();
    let y = series(&truth, &t_s, 5);
    let found = Coloured::fit(&t_s, &y, &vec![1.0; y.len()]);
    assert!(
        (found.slow / truth.slow - 1.0).abs() < 5.0 * 0.045,
        "{found:?}"
    );
    assert!(
        (found.tau_s / truth.tau_s - 1.0).abs() < 5.0 * 0.09,
        "{found:?}"
    );
    assert!((found.white / truth.white - 1.0).abs() < 0.1, "{found:?}");
}

#[test]
fn white_noise_stays_white() {
    let truth = Coloured {
        white: 2.0,
        slow: 0.0,
        tau_s: 1.0,
    };
    let t_s: Vec<f64> = (0..5000).map(f64::from).collect();
    let y = series(&truth, &t_s, 3);
    let found = Coloured::fit(&t_s, &y, &vec![1.0; y.len()]);
    let total = found.white.hypot(found.slow);
    assert!(
        (total / 2.0 - 1.0).abs() < 5.0 * (0.5 / 5000.0_f64).sqrt() + 0.02,
        "{found:?}"
    );
    assert!(found.slow < 0.5 || found.tau_s < 2.0, "{found:?}");
}
