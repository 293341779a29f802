//! What is known of slow noise before the data is looked at.
//!
//! A short run tells neither the size nor the correlation time of a slow error, and a step, a heater or a slow line
//! makes any such error look larger and slower. Where a model declares it, that counts: as the weight of a noise
//! beside its likelihood.
//!
//! Source: Lange, Little & Taylor 1989 (Student's t for what may be wrong altogether).

use crate::coloured::Coloured;

/// What is known of a slow part before the data is looked at: what a model declares, say.
///
/// ```text
/// ln w = -(nu + 1)/2 sum ln(1 + d^2/nu),   d = ln(slow / declared) / 0.25, ln(tau / declared) / 0.5,   nu = 4
/// ```
///
/// Student's t for what may be wrong altogether: a slow part of twice the declared size costs 2.7 nats, one of ten
/// times 7.7.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foreknown {
    /// Standard deviation of the slow part, in the unit of the series.
    pub slow: f64,
    /// Its correlation time, s.
    pub tau_s: f64,
}

impl Foreknown {
    /// How well sizes and correlation times are declared, in their logarithms.
    const SPREAD: [f64; 2] = [0.25, 0.5];
    const FREEDOM: f64 = 4.0;

    /// Logarithm of the weight of a noise, nats; 0 where it is as expected.
    pub fn log_weight(&self, noise: &Coloured) -> f64 {
        self.log_weight_apart(noise, Self::SPREAD)
    }

    /// The same of what is known so well, in the logarithms of size and time.
    pub(crate) fn log_weight_apart(self, noise: &Coloured, spread: [f64; 2]) -> f64 {
        let off = [noise.slow / self.slow, noise.tau_s / self.tau_s];
        let each = off.into_iter().zip(spread);
        let each = each.map(|(off, spread)| Self::surprise(off, spread));
        -0.5 * (Self::FREEDOM + 1.0) * each.sum::<f64>()
    }

    /// What a slow part pays that is so many times as large as is known of it, nats.
    pub fn paid_by_size(times: f64) -> f64 {
        0.5 * (Self::FREEDOM + 1.0) * Self::surprise(times, Self::SPREAD[0])
    }

    /// ln(1 + d^2/nu) of what is `off` by so many times.
    fn surprise(off: f64, spread: f64) -> f64 {
        let d = off.max(f64::MIN_POSITIVE).ln() / spread;
        (d * d / Self::FREEDOM).ln_1p()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coloured::tests::series;

    /// What is known before tells in a short run and not in a long one. Ten correlation times know ln slow to about
    /// sqrt(tau/span) = 0.32 and what is declared to 0.25 / sqrt(5/4) = 0.22: 0.18 together. Of 60 draws the mean square
    /// is known to 5 sqrt(2/60) = 0.9 of itself. Five hundred know it to 0.045, and a declared size of a fourth, 5.5
    /// spreads off, pulls by 5 * 5.5/(4 + 5.5^2) / 0.25 = 3.2 nats per unit: by 0.045^2 * 3.2 = 0.006.
    #[test]
    fn what_is_known_before_tells_in_a_short_run_alone() {
        let truth = Coloured {
            white: 0.5,
            slow: 1.5,
            tau_s: 40.0,
        };
        let off = |rows: i32, declared: f64, seed: u64| {
            let known = Foreknown {
                slow: declared * truth.slow,
                tau_s: truth.tau_s,
            };
            let t_s: Vec<f64> = (0..rows).map(f64::from).collect();
            let y = series(&truth, &t_s, seed);
            let count = vec![1.0; y.len()];
            let found = truth.refit_near(&known, &t_s, &y, &count);
            let free = truth.refit(&t_s, &y, &count);
            [found, free].map(|n| (n.slow / truth.slow).ln())
        };
        let mut squares = [0.0; 2];
        for seed in 0..60 {
            let short = off(400, 1.0, seed);
            squares
                .iter_mut()
                .zip(short)
                .for_each(|(s, d)| *s += d * d / 60.0);
        }
        assert!(squares[0] < 1.9 * 0.18_f64.powi(2), "{squares:?}");
        assert!(squares[0] < 0.7 * squares[1], "{squares:?}");
        let long = off(20_000, 0.25, 5);
        assert!((long[0] - long[1]).abs() < 0.02, "{long:?}");
    }

    /// Where the noise is as declared there is nothing to pay; a slow part of twice the size pays
    /// 5/2 ln(1 + (ln 2/0.25)^2/4) = 2.7 nats, as does half of it, and of twice the correlation time
    /// 5/2 ln(1 + (ln 2/0.5)^2/4) = 1.0.
    #[test]
    fn what_is_declared_weighs_noise_by_how_far_it_is_off() {
        let known = Foreknown {
            slow: 0.3,
            tau_s: 20.0,
        };
        let weight = |slow: f64, tau_s: f64| {
            known.log_weight(&Coloured {
                white: 1.0,
                slow,
                tau_s,
            })
        };
        assert!(weight(0.3, 20.0).abs() < 1e-12);
        for (slow, tau_s, paid) in [(0.6, 20.0, 2.68), (0.15, 20.0, 2.68), (0.3, 40.0, 0.98)] {
            assert!(
                (weight(slow, tau_s) + paid).abs() < 0.01,
                "{}",
                weight(slow, tau_s)
            );
        }
    }
}
