//! Slepian tapers: orthogonal, concentrated, and of their parity, at any length.
use proptest::prelude::*;
use spectra::{Slepian, SpectraError};

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

    /// Eigenvectors of one symmetric matrix: orthonormal to `eps ||T|| / gap`; the gap is a few units
    /// and the norm `N^2/4`.
    #[test]
    fn orthonormal_and_ordered(samples in 8_usize..400, share in 0.05_f64..0.45, count in 1_usize..8) {
        let nw = share * (samples as f64).min(20.0);
        let slepian = Slepian::new(samples, nw, count)?;
        let tolerance = 1e-15 * (samples * samples) as f64 + 1e-13;
        for k in 0..count {
            for l in 0..=k {
                let expected = f64::from(u8::from(k == l));
                let got = dot(slepian.taper(k), slepian.taper(l));
                prop_assert!((got - expected).abs() < tolerance, "{k} {l}: {got}");
            }
            let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
            let mirrored = slepian.taper(k).iter().rev().zip(slepian.taper(k));
            for (a, b) in mirrored {
                prop_assert!((a - sign * b).abs() < 1e-15);
            }
        }
        for pair in slepian.concentration().windows(2) {
            prop_assert!(pair[0] >= pair[1] - 1e-12 && pair[1] > 0.0);
        }
    }
}

/// Slepian (1978): the asymptotic loss of the first tapers, `1 - lambda_k ~ sqrt(pi) 2^(3k + 2) c^(k + 1/2)
/// e^(-2c)/k!` with `c = pi N W`, to a relative `O(1/c)`.
#[test]
fn concentration_of_a_long_taper() -> Result<(), SpectraError> {
    for nw in [2.0, 3.0, 4.0] {
        let slepian = Slepian::new(20_000, nw, 3)?;
        let c = nw * std::f64::consts::PI;
        let mut leading = 4.0 * (std::f64::consts::PI * c).sqrt() * (-2.0 * c).exp();
        for k in 0..2 {
            let got = (1.0 - slepian.concentration()[k]) / leading;
            let order = [1.0, 3.0][k] / c;
            assert!((got - 1.0).abs() < order, "NW {nw}, taper {k}: {got}");
            leading *= 8.0 * c / (k + 1) as f64;
        }
        for (k, l) in [(0, 1), (0, 2), (1, 2)] {
            assert!(dot(slepian.taper(k), slepian.taper(l)).abs() < 1e-8);
        }
    }
    Ok(())
}
