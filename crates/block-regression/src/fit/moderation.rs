//! How much wider than under white noise amplitudes scatter: what all columns say of it.
//!
//! A column's own blocks know the ratio m of its variance to that of white noise badly: of a
//! column that acts in slews alone, a dozen blocks hold the information, and m is off by 40 %. All
//! columns are tried on one noise, so that together they tell what m usually is and how much it
//! differs between columns. With m of `v_c` blocks each, as sample variances whose truth scatters
//! like the inverse of a chi-squared of d degrees of freedom,
//!
//! ```text
//! e_c = ln m_c - psi(v_c/2) + ln(v_c/2)       E e = ln m_0 - psi(d/2) + ln(d/2)
//!                                            Var e = psi'(v_c/2) + psi'(d/2)
//! m'_c = (d m_0 + v_c m_c) / (d + v_c),       with d + v_c degrees of freedom
//! ```
//!
//! Where slow noise widens some columns and not others, e scatters, d is small, and every column
//! is left to its own blocks; d is never more than twice the blocks that there are.
//!
//! Source: Smyth 2004 (moderated variance, moments of log variances), with
//! psi'(x) = 1/x + 1/(2 x^2) and psi(x) = ln x - 1/(2 x) - 1/(12 x^2).

/// Fewest columns that tell, and fewest blocks of one that counts.
const MIN_COLUMNS: usize = 20;
const MIN_FREEDOM: f64 = 3.0;

/// What is known of m before a column's own blocks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Usual {
    /// `m_0`, at least 1.
    pub(super) wider: f64,
    /// Blocks that it counts for.
    pub(super) blocks: f64,
}

impl Usual {
    /// Nothing is known.
    pub(super) const UNKNOWN: Self = Self {
        wider: 1.0,
        blocks: 0.0,
    };

    /// From the m of columns and the degrees of freedom behind each; `most` blocks at most.
    pub(super) fn of(columns: &[(f64, f64)], most: f64) -> Self {
        let logs: Vec<(f64, f64)> = columns
            .iter()
            .filter(|(m, v)| *m > 0.0 && m.is_finite() && *v >= MIN_FREEDOM)
            .map(|(m, v)| {
                (
                    m.ln() + 1.0 / v + 1.0 / (3.0 * v * v),
                    2.0 / v + 2.0 / (v * v),
                )
            })
            .collect();
        if logs.len() < MIN_COLUMNS {
            return Self::UNKNOWN;
        }
        let n = logs.len() as f64;
        let mean = logs.iter().map(|l| l.0).sum::<f64>() / n;
        let square: f64 = logs.iter().map(|l| (l.0 - mean).powi(2)).sum();
        let own = logs.iter().map(|l| l.1).sum::<f64>() / n;
        let excess = square / (n - 1.0) - own;
        // psi'(d/2) = excess
        let blocks = if excess > 0.0 {
            (2.0 / excess + 1.0).min(most)
        } else {
            most
        };
        Self {
            wider: (mean - 1.0 / blocks).exp().max(1.0),
            blocks,
        }
    }
}

#[cfg(test)]
mod tests {
    use rand_core::SeedableRng;
    use rand_distr::{ChiSquared, Distribution};
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;

    /// 4000 columns of 15 blocks; their truth `wider` times d over a chi-squared of `d`, or `wider` itself.
    fn drawn(wider: f64, d: Option<f64>) -> Vec<(f64, f64)> {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(5);
        let own = ChiSquared::new(15.0).unwrap();
        (0..4000)
            .map(|_| {
                let truth = d.map_or(wider, |d| {
                    wider * d / ChiSquared::new(d).unwrap().sample(&mut rng)
                });
                (truth * own.sample(&mut rng) / 15.0, 15.0)
            })
            .collect()
    }

    /// Var e = psi'(7.5) + psi'(5) = 0.143 + 0.221, known to 0.364 sqrt(2/4000) times 1.3 for its tails:
    /// 5 sigma of it move d from 10 to 8 or 14, and the mean of e by 5 %.
    #[test]
    fn scatter_between_columns_is_told_from_that_within() {
        let usual = Usual::of(&drawn(2.0, Some(10.0)), 60.0);
        assert!((8.0..14.0).contains(&usual.blocks), "{usual:?}");
        assert!((1.9..2.1).contains(&usual.wider), "{usual:?}");
    }

    /// psi'(7.5) = 0.143 is all the scatter that there is: what is left of it, 0.005 at most, is no d below 60.
    #[test]
    fn columns_alike_are_known_as_well_as_is_allowed() {
        let usual = Usual::of(&drawn(1.0, None), 60.0);
        assert!((usual.blocks - 60.0).abs() < 1e-9, "{usual:?}");
        assert!((1.0..1.05).contains(&usual.wider), "{usual:?}");
        assert_eq!(
            Usual::of(&drawn(1.0, None)[..MIN_COLUMNS - 1], 60.0),
            Usual::UNKNOWN
        );
    }
}
