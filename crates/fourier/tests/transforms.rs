//! Every plan against the sum that it stands for.

use std::f64::consts::TAU;

use fourier::{Complex, forward, forward_single, inverse, real_forward, real_inverse};

/// Lengths of every kind: a power of two, a mixed one, a prime.
const LENGTHS: [usize; 3] = [16, 60, 53];

fn signal(length: usize) -> Vec<Complex<f64>> {
    let at = |j: usize| Complex::new((1.3 * j as f64).sin(), (0.4 * j as f64).cos());
    (0..length).map(at).collect()
}

/// The sum as it is printed above.
fn summed(x: &[Complex<f64>], k: usize) -> Complex<f64> {
    let n = x.len() as f64;
    let turned = |(j, x): (usize, &Complex<f64>)| {
        let (s, c) = (-TAU * j as f64 * k as f64 / n).sin_cos();
        x * Complex::new(c, s)
    };
    x.iter().enumerate().map(turned).sum()
}

/// Rounding: an error of a few ulp a stage, of values of about one.
const ROUNDING: f64 = 1e-12;

#[test]
fn forward_is_the_sum_and_inverse_undoes_it() {
    for length in LENGTHS {
        let x = signal(length);
        let mut bins = x.clone();
        forward(length).process(&mut bins);
        for (k, bin) in bins.iter().enumerate() {
            assert!((bin - summed(&x, k)).norm() < ROUNDING * length as f64);
        }
        inverse(length).process(&mut bins);
        for (back, x) in bins.iter().zip(&x) {
            assert!((back / length as f64 - x).norm() < ROUNDING);
        }
    }
}

#[test]
fn real_transforms_are_the_first_half_and_come_back() {
    for length in LENGTHS {
        let x: Vec<f64> = signal(length).iter().map(|c| c.re).collect();
        let complex: Vec<_> = x.iter().map(|x| Complex::new(*x, 0.0)).collect();
        let plan = real_forward(length);
        let (mut input, mut bins) = (x.clone(), plan.make_output_vec());
        assert_eq!(bins.len(), length / 2 + 1);
        assert!(plan.process(&mut input, &mut bins).is_ok());
        for (k, bin) in bins.iter().enumerate() {
            assert!((bin - summed(&complex, k)).norm() < ROUNDING * length as f64);
        }
        let mut back = vec![0.0; length];
        assert!(real_inverse(length).process(&mut bins, &mut back).is_ok());
        for (back, x) in back.iter().zip(&x) {
            assert!((back / length as f64 - x).abs() < ROUNDING);
        }
    }
}

#[test]
fn single_precision_keeps_seven_digits() {
    let x = signal(64);
    #[expect(clippy::cast_possible_truncation, reason = "what single precision is")]
    let mut bins: Vec<_> = x
        .iter()
        .map(|c| Complex::new(c.re as f32, c.im as f32))
        .collect();
    forward_single(64).process(&mut bins);
    for (k, bin) in bins.iter().enumerate() {
        let apart = Complex::new(f64::from(bin.re), f64::from(bin.im)) - summed(&x, k);
        assert!(apart.norm() < 64.0 * f64::from(f32::EPSILON));
    }
}
