//! The density of rows at a point of the model of their noise ([`super::variance`]), and its slopes.
//!
//! ```text
//! p = sum_c pi_c exp(-q / 2 v_c) / v_c        v_c = v + s S_c^2        v = e^a V 10^(0.4 b (m - 5)) + w R^2
//! P_c = pi_c exp(-q / 2 v_c) / (v_c p)        d ln p / d v_c = P_c (q / 2 v_c - 1) / v_c
//! ```
//!
//! (c: no spike, one, a declared one; s: share of a spike that the row's square shows.)
//!
//! Rows are looked at several side by side, which the compiler turns into the machine's vectors.
//!
//! Source: a scale mixture of chi-squared laws of two degrees of freedom.

use super::rows::Row;
use super::variance::{LEVEL, MAGNITUDE, NO_SHARE, PARAMETERS, PER_MAG, RATE, SHARE, SIZE};

/// Kinds of declared spikes, each of its own size.
pub(super) const DECLARED: usize = 2;
/// No spike, one, and those that are declared.
const COMPONENTS: usize = 2 + DECLARED;

/// The model at a point: what all rows share.
pub(super) struct There {
    pub(super) level: f64,
    /// Of the logarithm of a variance, per magnitude.
    pub(super) slope: f64,
    /// Variance per squared rate.
    pub(super) rate: f64,
    /// Shares of rows without a spike, with one, and with a declared one of each kind.
    pub(super) share: [f64; COMPONENTS],
    /// What a spike adds to the variance.
    pub(super) more: [f64; COMPONENTS],
}

/// Rows side by side.
pub(super) struct Lanes<const N: usize> {
    /// What grows with the level of a row's variance.
    own: [f64; N],
    mag: [f64; N],
    rate: [f64; N],
    /// Half the square.
    half: [f64; N],
    shows: [f64; N],
    /// One where there is a row.
    there: [f64; N],
}

impl Lanes<1> {
    /// One row; `own` is what grows with the level of its variance.
    pub(super) fn of(row: &Row, own: f64) -> Self {
        let mut lanes = Self::of_none();
        lanes.put(0, row, own);
        lanes
    }
}

impl<const N: usize> Lanes<N> {
    pub(super) fn of_none() -> Self {
        Self {
            own: [1.0; N],
            mag: [0.0; N],
            rate: [0.0; N],
            half: [0.0; N],
            shows: [0.0; N],
            there: [0.0; N],
        }
    }

    /// Puts `row` into `lane`.
    pub(super) fn put(&mut self, lane: usize, row: &Row, own: f64) {
        self.own[lane] = own;
        self.mag[lane] = row.mag;
        self.rate[lane] = row.rate;
        self.half[lane] = 0.5 * row.square;
        self.shows[lane] = row.shows;
        self.there[lane] = 1.0;
    }
}

/// The density of each row, `e^exponent factor`, and the probability of each component; of a lane without a row the
/// exponent is nothing.
pub(super) struct Densities<const N: usize> {
    pub(super) exponent: [f64; N],
    pub(super) factor: [f64; N],
    pub(super) posterior: [[f64; N]; COMPONENTS],
    /// One over the variance of each component.
    inverse: [[f64; N]; COMPONENTS],
}

impl There {
    /// By what the level and the slope multiply the declared variance of a star of this magnitude.
    pub(super) fn growth(&self, mag: f64) -> f64 {
        (self.level + self.slope * mag).exp()
    }

    #[inline(always)]
    pub(super) fn densities<const N: usize>(&self, rows: &Lanes<N>) -> Densities<N> {
        let mut out = Densities {
            exponent: [0.0; N],
            factor: [0.0; N],
            posterior: [[0.0; N]; COMPONENTS],
            inverse: [[0.0; N]; COMPONENTS],
        };
        // relative to the widest component, which no square makes impossible
        let spikes = (1..COMPONENTS).filter(|&k| self.share[k] > 0.0);
        let most = spikes.map(|k| self.more[k]).fold(0.0, f64::max);
        let mut variance = [0.0; N];
        let mut widest = [0.0; N];
        for l in 0..N {
            variance[l] = rows.own[l] + self.rate * rows.rate[l];
            widest[l] = 1.0 / (variance[l] + most * rows.shows[l]);
            out.exponent[l] = -rows.half[l] * widest[l];
        }
        for k in (0..COMPONENTS).filter(|&k| self.share[k] > 0.0) {
            let (inverse, part) = (&mut out.inverse[k], &mut out.posterior[k]);
            let mut relative = [1.0; N];
            if self.more[k] < most {
                for l in 0..N {
                    inverse[l] = 1.0 / (variance[l] + self.more[k] * rows.shows[l]);
                    relative[l] = -rows.half[l] * inverse[l] - out.exponent[l];
                }
                relative = relative.map(f64::exp);
            } else {
                *inverse = widest;
            }
            for l in 0..N {
                part[l] = self.share[k] * inverse[l] * relative[l];
                out.factor[l] += part[l];
            }
        }
        for l in 0..N {
            let per_factor = 1.0 / out.factor[l];
            out.posterior.iter_mut().for_each(|p| p[l] *= per_factor);
        }
        out
    }

    /// Slopes of the logarithm of the density, parameter by parameter; nothing of a lane without a row.
    #[inline(always)]
    pub(super) fn slopes<const N: usize>(
        &self,
        rows: &Lanes<N>,
        density: &Densities<N>,
    ) -> [[f64; N]; PARAMETERS] {
        let [rest, rho, ..] = self.share;
        let of_others = rho / rest.max(NO_SHARE);
        let mut out = [[0.0; N]; PARAMETERS];
        for l in 0..N {
            let slope = |k: usize| {
                let inverse = density.inverse[k][l];
                density.posterior[k][l] * (rows.half[l] * inverse - 1.0) * inverse * rows.there[l]
            };
            let spike = slope(1);
            let all = slope(0) + spike + (2..COMPONENTS).map(slope).sum::<f64>();
            let share = density.posterior[1][l] - density.posterior[0][l] * of_others;
            out[LEVEL][l] = all * rows.own[l];
            out[MAGNITUDE][l] = all * rows.own[l] * PER_MAG * rows.mag[l];
            out[RATE][l] = all * rows.rate[l];
            out[SHARE][l] = share * (1.0 - rho) * rows.there[l];
            out[SIZE][l] = spike * self.more[1] * rows.shows[l];
        }
        out
    }
}

/// Levels of the stars: each has one magnitude, and one exponential serves its rows.
#[derive(Default)]
pub(super) struct Levels(Vec<[f64; 2]>);

impl Levels {
    /// What grows with the level of the variance of a row.
    pub(super) fn own(&mut self, there: &There, row: &Row) -> f64 {
        if self.0.len() <= row.star {
            self.0.resize(row.star + 1, [f64::NAN; 2]);
        }
        let known = &mut self.0[row.star];
        if known[0].to_bits() != row.mag.to_bits() {
            *known = [row.mag, there.growth(row.mag)];
        }
        row.declared * known[1]
    }
}
