//! Whether what the stars do slowly comes back with their pixel phase.
//!
//! Stars that cross pixels slowly err slowly where each follows the pixel phase by an amount of its own,
//! of which no term that is the same for all tells much. Such an error comes back when the star comes to
//! the same phase again, long after; an error in time does not. With u what is left of a star along axis a,
//! in units of its white noise, by bins of its phase along a,
//!
//! ```text
//! R_sa = mean over the bins, and pairs of visits to one, of u u'
//! z    = mean of R_sa / (their scatter / sqrt(n))
//! ```
//!
//! R is 0 where a star's visits have nothing to do with each other, and as large as the slow part is where
//! all of it follows the phase.
//!
//! Source: an analysis of variance within and between (Fisher 1925); Student 1908.

use rayon::prelude::*;

use crate::star::data::StarData;

/// Bins of a pixel phase.
const BINS: usize = 16;
/// Star axes from which a scatter is known.
const LEAST: usize = 8;
/// Sigmas of what comes back: that something slow is there is certain, and one of two names is right.
const LIKELY: f64 = 2.0;
/// Least share of the slow part that comes back.
const SHARE: f64 = 0.25;

/// The axis along which what is `left` (per row and axis, in units of the white noise; known in `rows_of`
/// each star) mostly comes back, where it does: `slow` is its slow part on times of `tau_s`, by which two
/// visits lie apart.
pub(crate) fn comes_back(
    data: &StarData,
    rows_of: &[Vec<usize>],
    left: &[[f64; 2]],
    slow: f64,
    tau_s: f64,
) -> Option<usize> {
    let each = [0, 1].map(|axis| -> Vec<f64> {
        let stars = rows_of.par_iter();
        stars
            .filter_map(|rows| of_star(data, rows, axis, left, tau_s))
            .collect()
    });
    let all: Vec<f64> = each.iter().flatten().copied().collect();
    if all.len() < LEAST {
        return None;
    }
    let n = all.len() as f64;
    let mean = all.iter().sum::<f64>() / n;
    let variance = all.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / (n - 1.0);
    if mean < SHARE * slow || mean < LIKELY * (variance / n).sqrt() {
        return None;
    }
    let of = |axis: &Vec<f64>| axis.iter().sum::<f64>() / axis.len().max(1) as f64;
    Some(usize::from(of(&each[1]) > of(&each[0])))
}

/// Mean product of two visits of one star to a phase; `None` if it never came back.
fn of_star(
    data: &StarData,
    rows: &[usize],
    axis: usize,
    left: &[[f64; 2]],
    apart_s: f64,
) -> Option<f64> {
    let places = data.landed()[axis];
    let mean = rows.iter().map(|&r| left[r][axis]).sum::<f64>() / rows.len().max(1) as f64;
    let mut visits = [Visits::default(); BINS];
    for &row in rows {
        let phase = data.camera.phase_rad(places[row]) / std::f64::consts::TAU;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a share of one turn"
        )]
        let bin = (phase.rem_euclid(1.0) * BINS as f64) as usize;
        visits[bin.min(BINS - 1)].add(data.t_s[row], left[row][axis] - mean, apart_s);
    }
    let (mut product, mut pairs) = (0.0, 0.0);
    for visits in visits {
        let (p, n) = visits.products();
        product += p;
        pairs += n;
    }
    (pairs > 0.0).then(|| product / pairs)
}

/// Sums over the visits to one bin.
#[derive(Clone, Copy, Default)]
struct Visits {
    last_s: f64,
    /// Sum and count of the visit that is on, and of all.
    now: [f64; 2],
    all: [f64; 2],
    /// Squares of both over the visits that have ended.
    squares: [f64; 2],
}

impl Visits {
    fn add(&mut self, t_s: f64, value: f64, apart_s: f64) {
        if self.now[1] > 0.0 && t_s - self.last_s > apart_s {
            self.end();
        }
        self.last_s = t_s;
        for (k, v) in [value, 1.0].into_iter().enumerate() {
            self.now[k] += v;
            self.all[k] += v;
        }
    }

    fn end(&mut self) {
        for (square, now) in self.squares.iter_mut().zip(&mut self.now) {
            *square += *now * *now;
            *now = 0.0;
        }
    }

    /// Sum of the products of rows in different visits, and how many there are.
    fn products(mut self) -> (f64, f64) {
        self.end();
        let [p, n] = [0, 1].map(|k| self.all[k] * self.all[k] - self.squares[k]);
        (p, n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_are_those_of_different_visits() {
        let mut visits = Visits::default();
        for (t, v) in [
            (0.0, 1.0),
            (1.0, 2.0),
            (50.0, 3.0),
            (51.0, 5.0),
            (99.0, -1.0),
        ] {
            visits.add(t, v, 10.0);
        }
        // (1 + 2) (3 + 5) + (1 + 2) (-1) + (3 + 5) (-1), each pair counted twice
        let (product, pairs) = visits.products();
        assert!((product - 2.0 * (24.0 - 3.0 - 8.0)).abs() < 1e-12);
        assert!((pairs - 2.0 * (4.0 + 2.0 + 2.0)).abs() < 1e-12);
    }
}
