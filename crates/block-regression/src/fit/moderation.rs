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
//! is left to its own blocks; d is never more than there are blocks.
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
