//! What a slow error of the reference pays for being there.
//!
//! ```text
//! price = -ln( c e^-told + (1 - c) e^-4 )           4: its size and its correlation time are anything
//! told  = 1.5 + 5/2 ln(1 + (ln(slow / sx) / 0.25)^2 / 4)      where slow is more than the reference tells, at most 4
//! c     = L(0) / (L(0) + L(sx^2))     L(v) = exp(-(w - v)^2 / 2 e^2)      w +- e: the white part of its variance
//! ```
//!
//! A reference that tells its errors tells how large they are, and not how slow: what of them does not change from
//! frame to frame is slow. Before that is looked at, it is one or the other. Less than is told is nothing to wonder at,
//! for filters are cautious.
//!
//! Source: the price of a parameter that is known to a share of its range (Schwarz 1978); Bayes' theorem; Student's t as
//! for what a model declares ([`Foreknown`]).

use coloured_noise::{CommonNoise, Foreknown};

use crate::search::selection::SLOW_PRICE;
use crate::situation::Situation;
use crate::star::reference_noise::White;

/// What a correlation time pays that is known to a factor of two, nats.
const OF_TIME: f64 = 1.5;

/// Errors about an axis that the reference tells of.
#[derive(Clone, Copy, Debug, Default)]
struct Told {
    /// 1 sigma, arcsec.
    sigma: f64,
    /// Chance that they are slow.
    slow: f64,
}

impl Told {
    /// Errors of this square beside a white part of `[variance, its error]`, arcsec^2.
    fn of(square: f64, [white, error]: [f64; 2]) -> Self {
        if square <= 0.0 || !error.is_finite() || error <= 0.0 {
            return Self::default();
        }
        let log = |v: f64| -0.5 * ((white - v) / error).powi(2);
        Self {
            sigma: square.sqrt(),
            slow: 1.0 / (1.0 + (log(square) - log(0.0)).exp()),
        }
    }

    /// Of a slow error of this size, nats.
    fn price(self, slow: f64) -> f64 {
        if self.sigma <= 0.0 {
            return SLOW_PRICE;
        }
        let beyond = Foreknown::paid_by_size((slow / self.sigma).max(1.0));
        let told = (OF_TIME + beyond).min(SLOW_PRICE);
        -(self.slow * (-told).exp() + (1.0 - self.slow) * (-SLOW_PRICE).exp()).ln()
    }
}

/// See the module.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SlowPrice {
    told: [Told; 3],
}

impl SlowPrice {
    /// By the columns of the bundle's reference, beside what is `white` of it.
    pub(crate) fn of(situation: &Situation<'_>, white: Option<&White>) -> Self {
        let reference = situation.bundle.reference.as_ref();
        let rows = reference.and_then(|r| r.sigma_arcsec.as_deref());
        let Some((rows, white)) = rows.zip(white) else {
            return Self::default();
        };
        let count = rows.len().max(1) as f64;
        Self {
            told: std::array::from_fn(|axis| {
                let squares: f64 = rows.iter().map(|row| row[axis] * row[axis]).sum();
                Told::of(squares / count, white.variance[axis])
            }),
        }
    }

    /// About each axis of this `noise`, nats.
    pub(crate) fn of_axes(self, noise: &CommonNoise) -> [f64; 3] {
        std::array::from_fn(|axis| self.told[axis].price(noise.reference[axis].slow))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is told and is not white pays for its time alone, and that of a fifth more for more; ten times as much pays what
    /// is not told of does, as does what is white. Where nobody knows, it is one or the other: 0.5 e^-1.5 + 0.5 e^-4.
    #[test]
    fn what_the_reference_tells_of_is_cheaper() {
        let price =
            |told: f64, slow: f64, white: [f64; 2]| Told::of(told * told, white).price(slow);
        let is = |price: f64, known: f64| (price - known).abs() < 1e-3;
        assert!(is(price(0.0, 0.5, [0.0, 0.01]), SLOW_PRICE));
        assert!(is(price(0.5, 0.5, [0.0, 0.01]), OF_TIME));
        assert!(is(price(0.5, 0.3, [0.0, 0.01]), OF_TIME));
        let more = price(0.5, 0.6, [0.0, 0.01]);
        assert!(more > OF_TIME + 0.1 && more < SLOW_PRICE, "{more}");
        assert!(is(price(0.5, 5.0, [0.0, 0.01]), SLOW_PRICE));
        assert!(is(price(0.5, 0.5, [0.25, 0.01]), SLOW_PRICE));
        let either = -(0.5 * (-OF_TIME).exp() + 0.5 * (-SLOW_PRICE).exp()).ln();
        assert!(is(price(0.5, 0.5, [0.1, 1e3]), either));
    }
}
