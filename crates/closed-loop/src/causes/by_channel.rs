//! One star, or one slot, that follows a channel: which channel is worth a term.
//!
//! A shift of every star with every channel is hundreds of columns. So that channel is looked for which one star, or the
//! stars of one slot, follow most in the residuals r,
//!
//! ```text
//! u = sum w^2 (z - mean of z) r      N = sum w^2 (z - mean of z)^2      (u_x^2 + u_y^2) / N most
//! ```
//!
//! z being the channel from -1 to 1, and it alone has a shift of each of them. What each keeps all the time tells nothing.
//!
//! Not physics: where to look.

use focal_plane::Series;

use crate::causes::places::Left;
use crate::causes::terms::{MOST_STARS, own_slots};
use crate::search::empirical::{Empirical, Variable};
use crate::star::data::StarData;

/// Squares in units of the variance below which none is worth a term.
const LEAST: f64 = 16.0;

/// Weighted sums over the rows of one star or slot.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    rows: f64,
    z: f64,
    squares: f64,
    residual: [f64; 2],
    product: [f64; 2],
}

impl Sums {
    fn add(&mut self, weight: f64, z: f64, residual: [f64; 2]) {
        self.rows += weight;
        self.z += weight * z;
        self.squares += weight * z * z;
        for (axis, r) in residual.into_iter().enumerate() {
            self.residual[axis] += weight * r;
            self.product[axis] += weight * z * r;
        }
    }

    /// The squares that a slope takes beside a constant.
    fn power(&self) -> f64 {
        let mean = self.z / self.rows;
        let information = self.squares - mean * self.z;
        // less is rounding
        if information <= 1e-9 * self.squares {
            return 0.0;
        }
        let score = [0, 1].map(|axis| self.product[axis] - mean * self.residual[axis]);
        (score[0].powi(2) + score[1].powi(2)) / information
    }
}

/// Shifts of each star, and of each slot, with the channel that one of them follows most in `residual` (arcsec, per axis
/// over all rows); channels are those of `terms`.
pub(super) fn by_channel(
    data: &StarData,
    residual: &[Vec<f64>],
    weight: &[f64],
    terms: &[Empirical],
) -> Vec<Empirical> {
    let Some(left) = Left::of(data, residual, weight) else {
        return Vec::new();
    };
    let channels: Vec<(&Variable, &Series, [f64; 2])> =
        terms.iter().filter_map(Empirical::channel).collect();
    if channels.is_empty() {
        return Vec::new();
    }
    let frame = data.frames.frame_of_rows();
    let z: Vec<Vec<f64>> = channels
        .iter()
        .map(|(_, series, [low, high])| {
            let values = series.at_all(&data.frames.t_s);
            let scaled = values
                .into_iter()
                .map(|v| (2.0 * v - low - high) / (high - low));
            scaled
                .map(|z| if z.is_finite() { z } else { 0.0 })
                .collect()
        })
        .collect();
    let variance = left.variance();
    let term = |variable: Variable, of: &dyn Fn(usize) -> usize, count: usize| {
        let powers = z.iter().map(|z| {
            let mut sums = vec![Sums::default(); count];
            for row in left.rows() {
                let r = left.residual.map(|r| r[row]);
                sums[of(row)].add(weight[row].powi(2), z[frame[row] as usize], r);
            }
            let seen = sums.iter().filter(|s| s.rows > 0.0);
            seen.map(Sums::power).fold(0.0, f64::max)
        });
        let (at, power) = powers.enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
        if variance.is_nan() || power <= LEAST * variance {
            return None;
        }
        let (channel, _, range) = channels[at];
        let pair = Empirical::pair(variable, [0.0, 1.0], channel.clone(), range)?;
        Some(pair.looked_for_among(channels.len()))
    };
    let mut found = Vec::new();
    let ids: Vec<i64> = data.stars.iter().map(|s| s.id).collect();
    if !data.free_directions && ids.len() <= MOST_STARS {
        found.extend(term(
            Variable::Star(ids.clone()),
            &|r| data.star[r],
            ids.len(),
        ));
    }
    if let Some(slots) = own_slots(data) {
        let at = |r: usize| slots.binary_search(&data.frames.slot[r]).unwrap_or(0);
        found.extend(term(Variable::Slot(slots.clone()), &at, slots.len()));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A slope of 3 on z of -1, 0 and 1 beside any constant: 3^2 of a sum of squares of 2; none in what does not change.
    #[test]
    fn a_slope_beside_a_constant() {
        let mut sums = Sums::default();
        for z in [-1.0, 0.0, 1.0] {
            sums.add(2.0, z + 5.0, [3.0 * z + 7.0, -4.0]);
        }
        assert!((sums.power() - 2.0 * 18.0).abs() < 1e-9, "{sums:?}");
        let mut still = Sums::default();
        (0..3).for_each(|_| still.add(2.0, 5.0, [1.0, 2.0]));
        assert!(still.power().abs() < 1e-12, "{still:?}");
    }
}
