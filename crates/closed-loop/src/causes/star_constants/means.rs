//! Mean errors of the stars, and what columns explain of them.
//!
//! What a rotation of the frames does is taken off where these are free, and in every fit where a reference may be
//! misaligned. What the declared distortion may do is no constant of a star's own ([`distorted`]).
//! See [`super`] for the likelihoods.
//!
//! Source: generalised least squares of the means; a row beside its star's mean has what is left.

use std::ops::{AddAssign, Range};

use effects::Candidate;
use nalgebra::{DMatrix, DVector, Matrix3, Matrix3xX, Vector3};
use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::search::without;
use crate::star::columns::star_columns_of;
use crate::star::data::StarData;
use crate::star::evidence::StarEvidence;
use crate::star::frame_rotation::rotation_row;
use distorted::Distorted;

mod distorted;

/// Parts of the run that are summed side by side.
const PARTS: usize = 16;
/// Frames whose columns are held at once.
const AT_ONCE: usize = 1024;
/// Singular values below this share of the largest are none.
const SINGULAR: f64 = 1e-6;
/// Chance below which stars have constants of their own.
const EVIDENT: f64 = 1e-4;
/// The same below which they might.
const DOUBTED: f64 = 0.01;
/// Squares of constants over those of what changes from part to part: a random walk has twice as many.
const LASTING: f64 = 10.0;

/// Whether every frame's rotation is taken off: that of frames with attitudes of their own, and what noise of the
/// reference makes.
pub(super) fn turns_freely(level: &StarEvidence<'_>) -> bool {
    level.data.free_attitude || level.noise.is_some() || level.drawn.is_some()
}

/// What shifts stars: some columns of a candidate, and how much of each is in the fit.
pub(super) struct Shift<'a> {
    pub(super) candidate: &'a dyn Candidate,
    pub(super) columns: Vec<usize>,
    pub(super) values: Vec<f64>,
}

/// Sums over rows, of both axes.
struct Sums {
    /// Weights of each star.
    weight: Vec<f64>,
    /// Weighed columns, the residual last, of both axes of each star.
    columns: DMatrix<f64>,
    /// Weighed products of the columns of each shift with themselves and, last, the residual.
    products: Vec<DMatrix<f64>>,
    /// Weighed squares of the residual, and rows that count.
    squares: f64,
    rows: f64,
    /// Frames whose rotations are taken off.
    turned: f64,
}

impl Sums {
    /// Squares of the mean residuals of the stars, and of how many.
    fn residual_means(&self) -> (f64, f64) {
        let residual = self.columns.row(self.columns.nrows() - 1);
        let square = |star: usize| residual.columns(2 * star, 2).norm_squared();
        let of = |(star, weight): (usize, &f64)| square(star) / weight;
        let seen = self.weight.iter().enumerate().filter(|(_, w)| **w > 0.0);
        let squares = seen.clone().map(of).sum();
        (squares, seen.count() as f64)
    }
}

impl AddAssign for Sums {
    fn add_assign(&mut self, other: Self) {
        let weights = self.weight.iter_mut().zip(other.weight);
        weights.for_each(|(a, b)| *a += b);
        self.columns += other.columns;
        let products = self.products.iter_mut().zip(other.products);
        products.for_each(|(a, b)| *a += b);
        self.squares += other.squares;
        self.rows += other.rows;
        self.turned += other.turned;
    }
}

/// Mean errors of the stars, in units of what white noise and the declared distortion make of them.
pub(super) struct Means {
    /// Without any of the shifts.
    error: DVector<f64>,
    /// What is always in the fit, then the columns of the shifts; of length 1.
    columns: DMatrix<f64>,
    always: usize,
    of_shift: Vec<Range<usize>>,
    /// Squares that each shift takes beside its means.
    within: Vec<f64>,
    /// Numbers that the stars tell.
    numbers: f64,
    /// Squared white noise of a row of weight 1, arcsec^2, and all squares of the rows beside their means over it.
    noise: f64,
    rows: f64,
    /// Squares of the mean residuals of parts of the run beside those of the whole, less those of noise.
    drift: f64,
}

impl Means {
    /// Beside what `level` keeps; `left` is what a fit leaves.
    pub(super) fn of(level: &StarEvidence<'_>, shifts: &[Shift<'_>], left: &Left<'_>) -> Self {
        let turned = turns_freely(level);
        let turns = if turned { 0 } else { 3 };
        let kept: usize = level.kept.iter().map(|c| c.coefficients().len()).sum();
        let always = turns + kept;
        let mut end = always;
        let next = |shift: &Shift<'_>| {
            let first = end;
            end += shift.columns.len();
            first..end
        };
        let of_shift: Vec<Range<usize>> = shifts.iter().map(next).collect();
        let frames = level.data.frames.frames();
        let ends: Vec<usize> = (0..=PARTS).map(|k| k * frames / PARTS).collect();
        let design = Design {
            level,
            shifts,
            of_shift: &of_shift,
            inside: left.inside,
            distorted: end,
            columns: end + left.distortion.len(),
        };
        let parts: Vec<Sums> = ends
            .par_windows(2)
            .map(|ends| design.sums(ends[0]..ends[1]))
            .collect();
        let prior = Distorted {
            from: end,
            values: &left.distortion,
            precision: level.nuisance.distortion_precision(),
            told: &left.told,
        };
        let squares: Vec<(f64, f64)> = parts.iter().map(|part| part.residual_means()).collect();
        let mut all = design.sums(0..0);
        parts.into_iter().for_each(|part| all += part);
        let whole = all.residual_means();
        let (of_parts, seen) = squares
            .into_iter()
            .fold((0.0, 0.0), |sum, part| (sum.0 + part.0, sum.1 + part.1));
        let mut means = Self::from_sums(all, shifts, of_shift, always, turned, &prior);
        means.drift = (of_parts - whole.0) / means.noise - 2.0 * (seen - whole.1);
        means
    }

    fn from_sums(
        sums: Sums,
        shifts: &[Shift<'_>],
        of_shift: Vec<Range<usize>>,
        always: usize,
        turned: bool,
        distortion: &Distorted<'_>,
    ) -> Self {
        let seen = sums.weight.iter().filter(|w| **w > 0.0).count() as f64;
        let mut columns = sums.columns.transpose();
        for mut column in columns.column_iter_mut() {
            for (k, value) in column.iter_mut().enumerate() {
                let weight = sums.weight[k / 2];
                *value = if weight > 0.0 {
                    *value / weight.sqrt()
                } else {
                    0.0
                };
            }
        }
        let last = columns.ncols() - 1;
        let squares = sums.squares - columns.column(last).norm_squared();
        let freedom = 2.0 * (sums.rows - seen) - 3.0 * sums.turned;
        let noise = (squares / freedom.max(1.0)).max(f64::MIN_POSITIVE);
        let mut error = columns.column(last).into_owned();
        let modes = distortion.modes(&columns, noise);
        distortion.put_back(&columns, &modes, &mut error);
        let mut within = Vec::new();
        for ((shift, own), products) in shifts.iter().zip(&of_shift).zip(&sums.products) {
            for (column, value) in own.clone().zip(&shift.values) {
                error.axpy(*value, &columns.column(column), 1.0);
            }
            let which: Vec<usize> = own.clone().chain([last]).collect();
            let with = columns.select_columns(&which);
            let means = columns.columns(own.start, own.len());
            let beside = products - means.tr_mul(&with);
            within.push(taken(products, &beside, &shift.values) / noise);
        }
        error /= noise.sqrt();
        modes.whiten(&mut error);
        let mut columns = columns.remove_columns(distortion.from, last + 1 - distortion.from);
        modes.whiten(&mut columns);
        for mut column in columns.column_iter_mut() {
            let length = column.norm();
            if length > 0.0 {
                column /= length;
            }
        }
        Self {
            error,
            columns,
            always,
            within,
            of_shift,
            noise,
            rows: squares / noise,
            drift: 0.0,
            numbers: (2.0 * seen - if turned { 3.0 } else { 0.0 }).max(0.0),
        }
    }

    /// Squares that these shifts leave, and of how many numbers.
    fn left(&self, shifts: &[usize]) -> (f64, f64) {
        let own = shifts.iter().flat_map(|&e| self.of_shift[e].clone());
        let which: Vec<usize> = (0..self.always).chain(own).collect();
        let squares = self.error.norm_squared();
        if which.is_empty() {
            return (squares, self.numbers);
        }
        let svd = self.columns.select_columns(&which).svd(true, false);
        let least = SINGULAR * svd.singular_values.max();
        let sizes = svd.singular_values.iter();
        let (mut taken, mut rank) = (0.0, 0.0);
        for (basis, size) in svd.u.iter().flat_map(|u| u.column_iter()).zip(sizes) {
            if *size > least {
                taken += basis.dot(&self.error).powi(2);
                rank += 1.0;
            }
        }
        ((squares - taken).max(0.0), (self.numbers - rank).max(0.0))
    }

    /// Squares that some of the `standing` shifts take beside the others.
    pub(super) fn taken(&self, standing: &[usize], some: &[usize]) -> f64 {
        (self.left(&without(standing, some)).0 - self.left(standing).0).max(0.0)
    }

    /// Squares that these shifts take beside the means.
    pub(super) fn beside(&self, some: &[usize]) -> f64 {
        some.iter().map(|&e| self.within[e]).sum()
    }

    /// The share of the rows' squares that constants of the stars hold beside these shifts, and the chance of as much by
    /// noise; `None` where they hold none, or change.
    pub(super) fn scatter(&self, standing: &[usize]) -> Option<(f64, f64)> {
        let (left, numbers) = self.left(standing);
        let law = ChiSquared::new(numbers.max(1.0)).ok()?;
        let p_value = law.sf(left);
        let more = left - numbers;
        let lasts = more > LASTING * self.drift;
        (p_value < EVIDENT && lasts).then(|| (more / (left + self.rows), p_value))
    }

    /// Whether noise is all that is left of the stars, as far as half of the numbers tell.
    pub(super) fn are_noise(&self, standing: &[usize]) -> bool {
        let (left, numbers) = self.left(standing);
        let noise = ChiSquared::new(numbers.max(1.0)).is_ok_and(|law| law.sf(left) > DOUBTED);
        noise && numbers >= 0.5 * self.numbers
    }

    /// Nats that some of the `standing` shifts gain beside the others, by the means of the stars and beside these.
    pub(super) fn gain(&self, standing: &[usize], some: &[usize]) -> f64 {
        self.between(standing, some) + 0.5 * self.beside(some)
    }

    /// The same by the means alone.
    pub(super) fn between(&self, standing: &[usize], some: &[usize]) -> f64 {
        let (left, numbers) = self.left(standing);
        let (before, more) = self.left(&without(standing, some));
        let taken = minus_two_ln((before - left).max(0.0), more - numbers);
        let between = minus_two_ln(before, more) - minus_two_ln(left, numbers) - taken;
        0.5 * between
    }
}

/// What a fit leaves.
pub(super) struct Left<'a> {
    /// Residual of each row in sample, arcsec.
    pub(super) inside: &'a [Vec<f64>],
    /// Coefficients of the distortion, those of x, then those of y, arcsec.
    pub(super) distortion: DVector<f64>,
    /// What all rows say of them, in the weights of the rows.
    pub(super) told: DMatrix<f64>,
}

/// h of the module's header.
fn minus_two_ln(squares: f64, numbers: f64) -> f64 {
    if squares > numbers && numbers > 0.0 {
        numbers * (1.0 + (squares / numbers).ln())
    } else {
        squares
    }
}

/// Squares that columns take from what is `beside` the means, of the size that suits all best: products of these
/// columns with themselves and, last, the residual, from which `values` of them are taken.
fn taken(all: &DMatrix<f64>, beside: &DMatrix<f64>, values: &[f64]) -> f64 {
    let k = values.len();
    let of = |products: &DMatrix<f64>| {
        let normal = products.view((0, 0), (k, k)).into_owned();
        let score = products.column(k).rows(0, k).into_owned();
        (normal, score)
    };
    let values = DVector::from_column_slice(values);
    let (normal, score) = of(all);
    // a unit each, so that what is small in its own is told from what is nothing
    let unit = normal
        .diagonal()
        .map(|d| if d > 0.0 { d.sqrt().recip() } else { 0.0 });
    let normal = DMatrix::from_fn(k, k, |i, j| normal[(i, j)] * unit[i] * unit[j]);
    let svd = normal.svd(true, true);
    let least = SINGULAR * svd.singular_values.max().max(f64::MIN_POSITIVE);
    let more = svd.solve(&score.component_mul(&unit), least);
    let Ok(more) = more else { return 0.0 };
    let (normal, score) = of(beside);
    let score = score + &normal * &values;
    let size = values + more.component_mul(&unit);
    2.0 * size.dot(&score) - size.dot(&(normal * &size))
}

/// What the sums are over.
struct Design<'a> {
    level: &'a StarEvidence<'a>,
    shifts: &'a [Shift<'a>],
    of_shift: &'a [Range<usize>],
    inside: &'a [Vec<f64>],
    /// Columns before those of the distortion, and before the residual.
    distorted: usize,
    columns: usize,
}

impl Design<'_> {
    /// Some frames at a time: the distortion alone has more than a hundred columns.
    fn sums(&self, frames: Range<usize>) -> Sums {
        let mut sums = self.sums_at_once(frames.start..(frames.start + AT_ONCE).min(frames.end));
        for start in (frames.start + AT_ONCE..frames.end).step_by(AT_ONCE) {
            sums += self.sums_at_once(start..(start + AT_ONCE).min(frames.end));
        }
        sums
    }

    fn sums_at_once(&self, frames: Range<usize>) -> Sums {
        let data = self.level.data;
        let rows = data.frames.first_row[frames.start]..data.frames.first_row[frames.end];
        let mut weight: Vec<f64> = rows.clone().map(|row| self.weight_of(row)).collect();
        let mut columns = self.fill(rows.clone());
        let mut turned = 0.0;
        if turns_freely(self.level) {
            for frame in frames {
                let own = data.frames.rows_of(frame);
                let told = without_rotation(data, own, rows.start, &mut weight, &mut columns);
                turned += f64::from(u8::from(told));
            }
        }
        let last = self.columns;
        let of = |own: &Range<usize>| DMatrix::zeros(own.len(), own.len() + 1);
        let mut sums = Sums {
            weight: vec![0.0; data.stars.len()],
            columns: DMatrix::zeros(last + 1, 2 * data.stars.len()),
            products: self.of_shift.iter().map(of).collect(),
            squares: 0.0,
            rows: 0.0,
            turned,
        };
        for (i, row) in rows.enumerate() {
            let (star, w2) = (data.star[row], weight[i].powi(2));
            if w2 == 0.0 {
                continue;
            }
            sums.weight[star] += w2;
            sums.rows += 1.0;
            for (axis, columns) in columns.iter().enumerate() {
                let row = columns.column(i);
                let mut of_star = sums.columns.column_mut(2 * star + axis);
                of_star.axpy(w2, &row, 1.0);
                sums.squares += w2 * row[last].powi(2);
                for (products, own) in sums.products.iter_mut().zip(self.of_shift) {
                    let k = own.len();
                    let shifts = row.rows(own.start, k);
                    let (mut normal, mut score) = products.columns_range_pair_mut(0..k, k);
                    normal.ger(w2, &shifts, &shifts, 1.0);
                    score.axpy(w2 * row[last], &shifts, 1.0);
                }
            }
        }
        sums
    }

    /// Weight of a row, 0 of what does not count.
    fn weight_of(&self, row: usize) -> f64 {
        let known = self.inside.iter().all(|axis| axis[row].is_finite());
        if known && !self.level.data.outlier[row] {
            self.level.weight[row]
        } else {
            0.0
        }
    }

    /// Columns and the residual of these rows, arcsec, along each axis: those of one row below those of another.
    fn fill(&self, rows: Range<usize>) -> [DMatrix<f64>; 2] {
        let data = self.level.data;
        let n = rows.len();
        let scale = data.camera.arcsec_per_px();
        let seen = data.rows(rows.clone(), self.level.motion, None);
        let mut out = [0, 1].map(|_| DMatrix::zeros(self.columns + 1, n));
        let mut at = 0;
        if !turns_freely(self.level) {
            for (i, row) in rows.clone().enumerate() {
                for (out, turn) in out.iter_mut().zip(rotation_row(data, row)) {
                    (0..3).for_each(|k| out[(k, i)] = turn[k]);
                }
            }
            at = 3;
        }
        let mut put = |candidate: &dyn Candidate, which: &[usize]| {
            let own = star_columns_of(candidate, &data.camera, &seen);
            for (axis, out) in out.iter_mut().enumerate() {
                for (to, k) in (at..).zip(which) {
                    for i in 0..n {
                        let shift = own.as_ref().map_or(0.0, |own| own[axis][k * n + i]);
                        out[(to, i)] = shift * scale[axis];
                    }
                }
            }
            at += which.len();
        };
        for kept in &self.level.kept {
            put(
                kept.as_ref(),
                &(0..kept.coefficients().len()).collect::<Vec<_>>(),
            );
        }
        for shift in self.shifts {
            put(shift.candidate, &shift.columns);
        }
        if self.columns > self.distorted {
            let polynomials = self.level.nuisance.polynomials(data, rows.clone());
            let count = polynomials.nrows();
            for (axis, out) in out.iter_mut().enumerate() {
                let from = self.distorted + axis * count;
                out.rows_mut(from, count).copy_from(&polynomials);
            }
        }
        for (i, row) in rows.enumerate() {
            for (out, inside) in out.iter_mut().zip(self.inside) {
                out[(self.columns, i)] = if inside[row].is_finite() {
                    inside[row]
                } else {
                    0.0
                };
            }
        }
        out
    }
}

/// Takes from the columns of one frame's rows, of which `first` is where they begin, what a rotation of its stars does;
/// a frame whose stars do not tell one counts for nothing.
fn without_rotation(
    data: &StarData,
    rows: Range<usize>,
    first: usize,
    weight: &mut [f64],
    columns: &mut [DMatrix<f64>; 2],
) -> bool {
    let own = rows.start - first..rows.end - first;
    let turn = |i: usize| rotation_row(data, first + i).map(Vector3::from);
    let counted: Vec<(usize, [Vector3<f64>; 2])> = own
        .clone()
        .filter(|&i| weight[i] > 0.0)
        .map(|i| (i, turn(i)))
        .collect();
    let each = || {
        counted
            .iter()
            .flat_map(|(i, turn)| (0..2).map(move |axis| (*i, axis, turn[axis])))
    };
    let normal: Matrix3<f64> = each()
        .map(|(i, _, turn)| weight[i].powi(2) * turn * turn.transpose())
        .sum();
    let inverse = normal.try_inverse().filter(|_| counted.len() > 1);
    let Some(inverse) = inverse else {
        weight[own].fill(0.0);
        return false;
    };
    let mut moment = Matrix3xX::zeros(columns[0].nrows());
    for (i, axis, turn) in each() {
        moment.ger(weight[i].powi(2), &turn, &columns[axis].column(i), 1.0);
    }
    let theta = inverse * moment;
    for (i, axis, turn) in each() {
        columns[axis]
            .column_mut(i)
            .gemv_tr(-1.0, &theta, &turn, 1.0);
    }
    true
}

#[cfg(test)]
mod tests {
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;

    /// Stars of which each of `numbers` is off by a constant of `size`, and columns that know nothing of it, in shifts
    /// of so many.
    fn scattered(seed: u64, numbers: usize, size: f64, shifts: &[usize]) -> Means {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let error = DVector::from_fn(numbers, |_, _| size * normal());
        let all: usize = shifts.iter().sum();
        let columns = DMatrix::from_fn(numbers, all, |_, _| normal());
        let mut end = 0;
        let mut next = |k: &usize| {
            end += k;
            end - k..end
        };
        Means {
            error,
            columns,
            always: 0,
            of_shift: shifts.iter().map(&mut next).collect(),
            within: vec![0.0; shifts.len()],
            numbers: numbers as f64,
            noise: 1.0,
            rows: 1000.0,
            drift: 0.0,
        }
    }

    /// Twice the gain is the likelihood ratio of one more variance: nearly chi-squared of one number, and only one half
    /// of the cases has the effect the larger. So 6 is exceeded in 0.7 % of them: 14 of 2000, with three sigmas 25.
    #[test]
    fn columns_that_know_nothing_gain_no_more_than_chance() {
        for shifts in [1, 3, 9] {
            let gains = (0..2000).map(|seed| {
                let means = scattered(seed, 25, 30.0, &[shifts]);
                let (left, numbers) = means.left(&[0]);
                let (whole, all) = means.left(&[]);
                let larger = (whole - left) / (all - numbers) > left / numbers;
                if larger { means.gain(&[0], &[0]) } else { 0.0 }
            });
            let far = gains.filter(|gain| *gain > 3.0).count();
            assert!(far < 25, "{shifts} columns: {far}");
        }
    }

    #[test]
    fn as_many_columns_as_numbers_gain_nothing() {
        let means = scattered(1, 13, 30.0, &[9, 4]);
        assert!(means.gain(&[0, 1], &[0, 1]).abs() < 1e-9);
        // nor each of them beside the other
        assert!(means.gain(&[0, 1], &[1]).abs() < 1e-9);
    }

    /// An effect of 30 sigma that all of 25 numbers agree on, beside noise alone: 25 (1 + ln(900/25)) - 24 - 1 - ln 900 is
    /// 82, twice 41 nats, less chance.
    #[test]
    fn what_the_stars_agree_on_gains() {
        let mut means = scattered(2, 25, 1.0, &[1]);
        means.columns.column_mut(0).normalize_mut();
        means.error.axpy(30.0, &means.columns.column(0), 1.0);
        let gain = means.gain(&[0], &[0]);
        assert!((30.0..50.0).contains(&gain), "{gain}");
        assert!(means.scatter(&[0]).is_none() && means.scatter(&[]).is_some());
    }

    /// Of two columns alike but for what they do beside the means, the one whose size there is that of the means takes
    /// its squares; the other, of which nothing is seen there, takes as many less than none.
    #[test]
    fn rows_beside_their_means_speak_for_a_size_that_they_share() {
        // a column of ten rows of one star: mean squares 8, beside the mean 2; of size 3 where both agree
        let products = |score: f64| DMatrix::from_row_slice(1, 2, &[10.0, score]);
        let beside = |score: f64| DMatrix::from_row_slice(1, 2, &[2.0, score]);
        // the whole is fitted: nothing is left of it, but beside the means what these do not share is
        let alike = taken(&products(0.0), &beside(0.0), &[3.0]);
        assert!((alike - 18.0).abs() < 1e-9, "{alike}");
        let unlike = taken(&products(0.0), &beside(-6.0), &[3.0]);
        assert!((unlike + 18.0).abs() < 1e-9, "{unlike}");
        // of what is not in the fit the size comes from all
        let more = taken(&products(30.0), &beside(6.0), &[0.0]);
        assert!((more - 18.0).abs() < 1e-9, "{more}");
    }
}
