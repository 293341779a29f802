//! Whether a slow error is the frame's or the stars'.
//!
//! A reference that wanders moves all stars of a frame alike. Stars that each follow
//! something of their own (pixel phases, windows, charge) make a frame's rotation wander
//! too, by as much as they make everything else wander that the frame's stars could do. So
//! the slow part of the rotation is held against that of all other directions in the space
//! of the frame's centroids, in units of the white noise,
//!
//! ```text
//! S = mean over lags 1..D, times, directions of u(t) u(t + lag)      D = tau/2
//! ```
//!
//! and a slow error is not the reference's if S of the other directions is beyond doubt and
//! the rotation's is less than eight times as large: the power of one line in one direction
//! is exponential, so that the largest of three exceeds its mean eightfold in 1 of 1000. Of
//! white noise S has a sigma of 1/sqrt(n D) for n products a lag.
//!
//! Source: an analysis of variance within and between (Fisher 1925) of lagged products.

use nalgebra::Vector3;
use rayon::prelude::*;
use spectra::robust::median_step;
use statrs::function::erf::erfc;
use telemetry::report::{Dependence, Unattributed};

use crate::causes::recurrence;
use crate::figures;
use crate::star::data::StarData;
use crate::star::frame_rotation::{Turn, Turns, counts, rotation_row};

/// Chance below which stars that wander are told.
const ALPHA: f64 = 0.002;
/// Shares of what the stars are known to follow beyond which they mostly wander.
pub(crate) const MOSTLY: f64 = 20.0;
/// The same where it is more certain than any of that, which is not quite certain by itself.
const SURER: f64 = 3.0;
const CERTAIN: f64 = 1e-4;
/// Sigmas of what is beyond doubt.
const BEYOND_DOUBT: f64 = 3.5;
/// Least share of the rotation's slow part.
const SHARE: f64 = 1.0 / 8.0;
/// Longest lag, frames.
const MOST_LAGS: usize = 100;
/// Products of which a sum is nearly Gaussian.
const LEAST_PRODUCTS: f64 = 300.0;
/// Of a frame of three stars.
const LEAST_FREEDOM: f64 = 3.0;
/// Sums of products have wider tails than a Gaussian.
const WIDER: f64 = 1.3;

/// Slow parts over the white noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Slow {
    /// Of the rotation, about the axes asked for.
    pub(crate) rotation: f64,
    /// Of all else, and its sigma if there is none.
    pub(crate) stars: f64,
    pub(crate) sigma: f64,
    /// Lags that it is the mean of.
    lags: usize,
    /// The most certain star: its slow part over its sigma, and how many there are.
    star: f64,
    count: usize,
    /// The axis along which it comes back with the pixel phase, if it does.
    comes_back: Option<usize>,
}

/// Every star does something of its own in time.
pub(crate) const IN_TIME: &str = "time*star";
/// The same by its pixel phase along an axis.
const BY_PHASE: [&str; 2] = ["pixel_phase_x*star", "pixel_phase_y*star"];
/// A wave on the detector ([`crate::unexplained::pattern`]).
const PATTERN: &str = "x_px*y_px";
/// In the names of all terms of the phase.
const PHASE: &str = "pixel_phase";

/// Puts it first that every star does something of its own.
pub(crate) fn stars_first(
    list: &mut Vec<Dependence>,
    variable: &str,
    variance_explained: f64,
    p_value: f64,
) {
    list.retain(|d| d.variable != variable);
    let entry = Dependence {
        variable: variable.to_owned(),
        variance_explained,
        p_value,
    };
    list.insert(0, entry);
}

impl Slow {
    /// Each star wanders by itself.
    pub(crate) fn is_of_the_stars(&self) -> bool {
        self.stars > BEYOND_DOUBT * self.sigma && self.stars > SHARE * self.rotation
    }

    /// Writes it where it is reported, unless what the stars follow is known. `left` is the
    /// share of the before variance that is left.
    pub(crate) fn tell(&self, unattributed: &mut Unattributed, left: f64) {
        let share = (self.stars / (1.0 + self.stars)).max(0.0);
        let first = unattributed.depends_on.first();
        let known = first.map_or(0.0, |d| d.variance_explained);
        // the logarithm of a chance is half a square, and slow noise makes squares larger
        let certain = |d: &Dependence| {
            let p = d.p_value.powf(self.inflation().recip());
            p < self.chance() || p < CERTAIN
        };
        // what comes back with the phase is no pattern under the stars
        let pattern = self.comes_back.is_some() && first.is_some_and(|d| d.variable == PATTERN);
        let much = if pattern { 1.0 } else { SURER };
        let surer = !unattributed.depends_on.iter().any(certain) && share > much * known;
        let little = share < MOSTLY * known && !surer;
        if self.chance() >= ALPHA || unattributed.present && little {
            return;
        }
        // terms say more of the phase than that every star follows it by itself
        let said = |d: &Dependence| figures::certain(d) && d.variable.contains(PHASE);
        let list = &mut unattributed.depends_on;
        if unattributed.present
            && self.comes_back.is_some()
            && let Some(at) = list.iter().position(said)
        {
            if pattern {
                list[..=at].rotate_right(1);
            }
            return;
        }
        if !unattributed.present {
            unattributed.depends_on.clear();
        }
        unattributed.present = true;
        unattributed.variance_fraction = Some(share * left);
        let variable = self.comes_back.map_or(IN_TIME, |axis| BY_PHASE[axis]);
        stars_first(&mut unattributed.depends_on, variable, share, self.chance());
    }

    /// The chance of as much slow noise of the stars, or of one of them, where there is none.
    fn chance(&self) -> f64 {
        let tail = |z: f64| 0.5 * erfc(z / WIDER * std::f64::consts::FRAC_1_SQRT_2);
        let whole = tail(self.stars / self.sigma);
        (2.0 * whole.min(tail(self.star) * self.count as f64)).min(1.0)
    }

    /// How much wider than under white noise an effect scatters that is the same for all
    /// stars of a frame and slow: at least 1.
    pub(crate) fn inflation(&self) -> f64 {
        if self.stars > BEYOND_DOUBT * self.sigma {
            1.0 + 2.0 * self.lags as f64 * self.stars
        } else {
            1.0
        }
    }
}

/// Slow parts of `residual` (arcsec, per axis over all rows) on times of `tau_s`, about
/// those `axes` that count. `None` with too little data.
pub(crate) fn slow(
    data: &StarData,
    residual: &[Vec<f64>],
    axes: [bool; 3],
    tau_s: f64,
) -> Option<Slow> {
    let step = median_step(&data.frames.t_s)?;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a positive number of frames, limited"
    )]
    let lags = (0.5 * tau_s / step).clamp(1.0, MOST_LAGS as f64) as usize;
    let [x, y] = residual else { return None };
    let weight = weights(data, residual);
    let root: Vec<f64> = data.star.iter().map(|&s| weight[s].sqrt()).collect();
    let turns = Turns::of(data, [x, y], &root).frames;
    let parts: Vec<Option<Parts>> = turns
        .par_iter()
        .enumerate()
        .map(|(k, turn)| Parts::of(data, [x, y], &root, (k, turn.as_ref()?)))
        .collect();
    let mut left = vec![[f64::NAN; 2]; data.t_s.len()];
    let mut rows_of: Vec<Vec<usize>> = vec![Vec::new(); data.stars.len()];
    // directions that a row stands for
    let mut freedom = vec![0.0; data.t_s.len()];
    for parts in parts.iter().flatten() {
        let n = parts.left.len() as f64;
        for &(row, own) in &parts.left {
            left[row] = own;
            freedom[row] = (2.0 * n - 3.0) / n;
            rows_of[data.star[row]].push(row);
        }
    }
    let t_s = &data.frames.t_s;
    let near = |now: f64, before: f64| now - before <= (lags as f64 + 0.5) * step;
    let asked: Vec<usize> = (0..3).filter(|&a| axes[a]).collect();
    let (mut rotation, mut of_rotation) = (0.0, 0.0);
    for (k, now) in parts.iter().enumerate() {
        let Some(now) = now else { continue };
        for before in (k.saturating_sub(lags)..k).rev() {
            if !near(t_s[k], t_s[before]) {
                break;
            }
            if let Some(before) = &parts[before] {
                rotation += asked
                    .iter()
                    .map(|&a| now.turn[a] * before.turn[a])
                    .sum::<f64>();
                of_rotation += asked.len() as f64;
            }
        }
    }
    let each: Vec<Products> = rows_of
        .par_iter()
        .map(|rows| {
            // side by side
            let own: Vec<(f64, [f64; 2])> = rows.iter().map(|&r| (data.t_s[r], left[r])).collect();
            let mut out = Products::default();
            for (i, &(t, u)) in own.iter().enumerate() {
                for &(before, v) in own[i.saturating_sub(lags)..i].iter().rev() {
                    if !near(t, before) {
                        break;
                    }
                    out.sum += u[0] * v[0] + u[1] * v[1];
                    out.count += 2.0;
                    out.directions += freedom[rows[i]];
                }
            }
            out
        })
        .collect();
    let stars: f64 = each.iter().map(|own| own.sum).sum();
    let of_stars: f64 = each.iter().map(|own| own.directions).sum();
    let comes_back =
        recurrence::comes_back(data, &rows_of, &left, stars / of_stars, lags as f64 * step);
    (of_rotation > 0.0 && of_stars >= LEAST_PRODUCTS).then(|| Slow {
        rotation: rotation / of_rotation,
        stars: stars / of_stars,
        comes_back,
        sigma: of_stars.sqrt().recip(),
        lags,
        star: each
            .iter()
            .filter(|own| own.count >= LEAST_PRODUCTS)
            .map(|own| own.sum / own.count.sqrt())
            .fold(0.0, f64::max),
        count: data.stars.len(),
    })
}

/// A frame in units of its white noise.
struct Parts {
    /// Its rotation.
    turn: Vector3<f64>,
    /// What that leaves of each row, both axes.
    left: Vec<(usize, [f64; 2])>,
}

impl Parts {
    /// `root`: of each row, one over its white noise. `None` for a frame that has too few.
    fn of(
        data: &StarData,
        residual: [&[f64]; 2],
        root: &[f64],
        (frame, turn): (usize, &Turn),
    ) -> Option<Self> {
        let left = |r: usize| {
            let columns = rotation_row(data, r).map(Vector3::from);
            let left = [0, 1].map(|a| root[r] * (residual[a][r] - columns[a].dot(&turn.theta)));
            (r, left)
        };
        let rows = data.frames.rows_of(frame);
        let counted = rows.filter(|&r| counts(data, residual, r) && root[r] > 0.0);
        (turn.freedom >= LEAST_FREEDOM).then(|| Self {
            turn: turn.theta.component_div(&turn.variance.map(f64::sqrt)),
            left: counted.map(left).collect(),
        })
    }
}

/// Lagged products of one star.
#[derive(Clone, Copy, Debug, Default)]
struct Products {
    sum: f64,
    count: f64,
    /// Directions beside the rotation that they are of.
    directions: f64,
}

/// One over the white variance of each star, from differences of neighbours.
fn weights(data: &StarData, residual: &[Vec<f64>]) -> Vec<f64> {
    let mut last: Vec<Option<usize>> = vec![None; data.stars.len()];
    let mut sum = vec![[0.0; 2]; data.stars.len()];
    for r in (0..data.t_s.len()).filter(|&r| !data.outlier[r]) {
        let star = data.star[r];
        if let Some(p) = last[star] {
            let square: f64 = residual.iter().map(|a| (a[r] - a[p]).powi(2)).sum();
            if square.is_finite() {
                // two axes, two ends
                sum[star][0] += 0.25 * square;
                sum[star][1] += 1.0;
            }
        }
        last[star] = Some(r);
    }
    sum.iter()
        .map(|[square, n]| if *square > 0.0 { n / square } else { 0.0 })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slow(rotation: f64, stars: f64, star: f64) -> Slow {
        Slow {
            rotation,
            stars,
            sigma: 0.001,
            lags: 50,
            star,
            count: 14,
            comes_back: None,
        }
    }

    #[test]
    fn whose_it_is() {
        // less than eight times the stars' own, which are beyond doubt
        assert!(slow(0.03, 0.005, 1.0).is_of_the_stars());
        assert!(!slow(0.05, 0.005, 1.0).is_of_the_stars());
        // the stars show nothing
        assert!(!slow(0.01, 0.003, 1.0).is_of_the_stars());
    }

    #[test]
    fn it_is_told_where_nothing_else_explains_it() {
        let beside = |slow: Slow, known: &[f64], p_value: f64| {
            let mut left = Unattributed {
                present: !known.is_empty(),
                ..Unattributed::default()
            };
            left.depends_on
                .extend(known.iter().map(|&share| Dependence {
                    variable: "mag".to_owned(),
                    variance_explained: share,
                    p_value,
                }));
            slow.tell(&mut left, 1.0);
            let names = left.depends_on.into_iter().map(|d| d.variable);
            (left.present, names.collect::<Vec<_>>())
        };
        let told = |slow: Slow, known: &[f64]| beside(slow, known, 1e-80);
        assert_eq!(
            told(slow(0.0, 0.01, 1.0), &[]),
            (true, vec!["time*star".to_owned()])
        );
        // one star is enough
        assert!(told(slow(0.0, 0.0, 8.0), &[]).0);
        assert!(!told(slow(0.0, 0.002, 3.0), &[]).0);
        let both = ["time*star", "mag"];
        assert_eq!(told(slow(0.0, 0.1, 1.0), &[0.005]).1, ["mag"]);
        assert_eq!(told(slow(0.0, 0.1, 1.0), &[0.004]).1, both);
        // what is certain under white noise is not beside slow noise of the stars
        assert_eq!(beside(slow(0.0, 0.1, 1.0), &[0.005], 1e-9).1, both);
        // 0.1 is beyond doubt, but chance makes the other in one bundle of 200
        assert_eq!(beside(slow(0.0, 0.1, 1.0), &[0.031], 5e-3).1, ["mag"]);
        assert_eq!(beside(slow(0.0, 0.1, 1.0), &[0.030], 5e-3).1, both);
    }

    #[test]
    fn slow_noise_widens() {
        assert!((slow(0.0, 0.01, 1.0).inflation() - 2.0).abs() < 1e-12);
        assert!((slow(0.0, 0.003, 1.0).inflation() - 1.0).abs() < 1e-12);
    }
}
