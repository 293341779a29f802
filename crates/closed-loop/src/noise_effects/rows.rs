//! Squared residuals of single stars, free of what their frame shares.
//!
//! A rotation common to all stars of a frame is the reference's business, so it is
//! taken off by least squares with the present weights. What is left of row i has
//! less variance than its noise v (or more, if the row took no part), axis by axis
//!
//! ```text
//! var_i = v_i - 2 w_i v_i h_i + h_i     h_i = a_i^T C a_i,  C = (sum w a a^T)^-1,  w = P(no spike)/v
//! q_i = sum over the axes of r_i^2 v_i / var_i           so that q/v ~ chi2_2
//! ```
//!
//! A spike of the row's own turns its frame, too, so that less of its square is left:
//!
//! ```text
//! shows_i = (1 - w_i h_i)^2 v_i / var_i
//! ```
//!
//! Held to show all of it, spikes beside nine other stars were told to be a fourteenth too small.
//!
//! A frame of four stars leaves five numbers of eight, so that both axes of a row may be nearly one number, of
//! correlation rho. Half its square in units of v has
//!
//! ```text
//! variance = 1 + rho^2        median = ln 2 (1 - 0.344 rho^2)       (the latter to 2 %; 0.656 ln 2 of one number)
//! ```
//!
//! Held to be two, a star whose frames leave one of it has a level a third too small.
//!
//! Source: leverage in linear regression (Hoaglin & Welsch 1978).

use block_regression::Folds;
use nalgebra::{Matrix3, Vector3};

use crate::star::data::StarData;
use crate::star::frame_rotation::rotation_row;

/// Fewest stars of a frame that leave something beside its rotation.
const MIN_STARS: usize = 3;
/// A row whose rotation takes more than this share of its variance says too little.
const MOST_LEVERAGE: f64 = 0.8;
/// Chance to be sound of a row that is looked at again beside its frame's rotation.
const DOUBTFUL: f64 = 0.5;
/// Rows beyond which frames are thinned evenly: variances are known to 1 % from half of them.
const MOST_ROWS: usize = 100_000;

/// What one row says about the noise.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    /// Squared residual over two axes, arcsec^2.
    pub(super) square: f64,
    /// Share of its square that a spike of the row adds to it.
    pub(super) shows: f64,
    /// Squared correlation of what is left of both axes.
    pub(super) alike: f64,
    /// Declared variance per axis, arcsec^2.
    pub(super) declared: f64,
    /// Magnitude - 5; 0 where unknown.
    pub(super) mag: f64,
    /// Squared rate across the detector, (deg/s)^2.
    pub(super) rate: f64,
    /// Its place among all rows.
    pub(super) at: usize,
    pub(super) star: usize,
    pub(super) block: usize,
    /// Left out of the figures.
    pub(super) marked: bool,
}

impl Row {
    /// Variance of half its square over that of its noise.
    pub(super) fn variance(&self) -> f64 {
        1.0 + self.alike
    }

    /// The level that it shows: half its square over `variance`, such that the median of many is theirs.
    pub(super) fn level_over(&self, variance: f64) -> f64 {
        let median = std::f64::consts::LN_2 * (1.0 - 0.344 * self.alike);
        0.5 * self.square / variance / median
    }
}

/// A row of a frame, and what is believed of it.
struct Member {
    row: Row,
    /// Its rotation columns, arcsec per arcsec.
    turns: [Vector3<f64>; 2],
    variance: f64,
    /// Chance that it is no spike; 0 where it is left out.
    sound: f64,
}

impl Member {
    fn weight(&self) -> f64 {
        self.sound / self.variance
    }

    fn is_doubtful(&self) -> bool {
        !self.row.marked && self.sound < DOUBTFUL
    }
}

/// Squared rate across the detector of every row, (deg/s)^2.
pub(super) fn squared_rates(data: &StarData) -> Vec<f64> {
    let scale = data.camera.arcsec_per_px().map(|s| s / 3600.0);
    let square = |r: usize| {
        let of_axis = |a: usize| (data.velocity[a][r] * scale[a]).powi(2);
        of_axis(0) + of_axis(1)
    };
    (0..data.t_s.len()).map(square).collect()
}

/// Where the rows come from.
pub(super) struct Source<'a> {
    pub(super) data: &'a StarData,
    /// Residuals of every row per axis, arcsec.
    pub(super) residual: &'a [Vec<f64>],
    /// Declared variance per axis of every row, arcsec^2.
    pub(super) declared: &'a [f64],
    /// Squared rate across the detector of every row, (deg/s)^2.
    pub(super) rate: &'a [f64],
    pub(super) folds: &'a Folds,
}

impl Source<'_> {
    /// The rate noise that would show at `sigmas` in white noise of the residual's level, arcsec/(deg/s); `None` where the
    /// rate is the same everywhere.
    ///
    /// ```text
    /// var(c^2) = 1 / sum (u - mean u)^2     u = rate^2 / variance: two squares a row, each with 2 variance^2 of its own,
    ///                                       and the level unknown
    /// ```
    pub(super) fn least_rate(&self, sigmas: f64) -> Option<f64> {
        let counted = |r: &usize| {
            let axes = self.residual.iter().all(|a| a[*r].is_finite());
            !self.data.outlier[*r] && axes && self.rate[*r].is_finite() && self.declared[*r] > 0.0
        };
        let rows: Vec<usize> = (0..self.rate.len()).filter(counted).collect();
        let mean = |of: &dyn Fn(usize) -> f64| {
            rows.iter().map(|&r| of(r)).sum::<f64>() / rows.len().max(1) as f64
        };
        let square = |r: usize| 0.5 * self.residual.iter().map(|a| a[r] * a[r]).sum::<f64>();
        let level = mean(&|r| square(r) / self.declared[r]);
        let u = |r: usize| self.rate[r] / (level * self.declared[r]);
        let middle = mean(&u);
        let spread = rows.len() as f64 * mean(&|r| (u(r) - middle).powi(2));
        (spread > 0.0 && spread.is_finite()).then(|| (sigmas / spread.sqrt()).sqrt())
    }

    /// All rows under `belief`: the variance of a row and how likely it is no spike.
    pub(super) fn rows(&self, belief: &dyn Fn(&Row) -> [f64; 2]) -> Vec<Row> {
        let step = self.data.t_s.len().div_ceil(MOST_ROWS).max(1);
        let mut out = Vec::new();
        for (block, frames) in self.folds.blocks.iter().enumerate() {
            for frame in frames.clone().step_by(step) {
                self.frame(frame, block, belief, &mut out);
            }
        }
        out
    }

    /// The rotation of a frame by its rows and their weights, and its covariance.
    fn turn(
        &self,
        members: &[Member],
        weight: impl Fn(&Member) -> f64,
    ) -> Option<(Matrix3<f64>, Vector3<f64>)> {
        let (mut normal, mut moment) = (Matrix3::zeros(), Vector3::zeros());
        for member in members {
            let weight = weight(member);
            for (a, residual) in member.turns.iter().zip(self.residual) {
                normal += a * a.transpose() * weight;
                moment += a * (residual[member.row.at] * weight);
            }
        }
        let covariance = normal.try_inverse()?;
        Some((covariance, covariance * moment))
    }

    fn frame(
        &self,
        frame: usize,
        block: usize,
        belief: &dyn Fn(&Row) -> [f64; 2],
        out: &mut Vec<Row>,
    ) {
        let data = self.data;
        let mut members: Vec<Member> = data
            .frames
            .rows_of(frame)
            .filter(|&r| self.residual.iter().all(|axis| axis[r].is_finite()))
            .map(|r| {
                let mag = data.mag[r] - 5.0;
                let row = Row {
                    square: self.residual[0][r].powi(2) + self.residual[1][r].powi(2),
                    shows: 1.0,
                    alike: 0.0,
                    declared: self.declared[r],
                    mag: if mag.is_finite() { mag } else { 0.0 },
                    rate: self.rate[r],
                    at: r,
                    star: data.star[r],
                    block,
                    marked: data.outlier[r],
                };
                let [variance, sound] = belief(&row);
                Member {
                    turns: rotation_row(data, r).map(Vector3::from),
                    variance,
                    sound: if row.marked { 0.0 } else { sound },
                    row,
                }
            })
            .collect();
        if members.iter().filter(|m| !m.row.marked).count() < MIN_STARS {
            return;
        }
        // stars that a wandering reference moves, all together, are no spikes
        if members.iter().any(Member::is_doubtful) {
            let whole = |m: &Member| f64::from(u8::from(!m.row.marked)) / m.variance;
            let Some((_, theta)) = self.turn(&members, whole) else {
                return;
            };
            for member in members.iter_mut().filter(|m| m.is_doubtful()) {
                let row = member.row;
                let left: f64 = (member.turns.iter().zip(self.residual))
                    .map(|(a, residual)| (residual[row.at] - a.dot(&theta)).powi(2))
                    .sum();
                let square = row.square.min(left);
                [_, member.sound] = belief(&Row { square, ..row });
            }
        }
        let Some((covariance, theta)) = self.turn(&members, Member::weight) else {
            return;
        };
        for member in members {
            let weight = member.weight();
            let Member {
                mut row,
                turns,
                variance,
                ..
            } = member;
            let (mut square, mut shows) = (0.0, 0.0);
            let taken = 1.0 / variance - 2.0 * weight;
            let mut shares = [0.0; 2];
            for (axis, a) in turns.iter().enumerate() {
                let leverage = a.dot(&(covariance * a));
                let share = 1.0 + taken * leverage;
                let left = self.residual[axis][row.at] - a.dot(&theta);
                square += left * left / share;
                shows += 0.5 * (1.0 - weight * leverage).powi(2) / share;
                shares[axis] = share;
            }
            let [x, y] = shares;
            if x.min(y) > 1.0 - MOST_LEVERAGE {
                let common = taken * turns[0].dot(&(covariance * turns[1]));
                (row.square, row.shows) = (square, shows);
                row.alike = (common * common / (x * y)).min(1.0);
                out.push(row);
            }
        }
    }
}
