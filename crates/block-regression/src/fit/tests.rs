//! Fits from sums against fits of every row.

use super::*;
use crate::gram::Design;
use nalgebra::{Cholesky, Matrix2};
use rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::ops::Range;

/// One scalar a frame: two nuisance columns, three candidates, one residual.
type Table = DMatrix<f64>;

/// Smooth regressors; AR(1) noise of correlation `rho`; the first candidate acts with `size`.
fn table(frames: usize, rho: f64, size: f64, seed: u64) -> Table {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let phase: Vec<f64> = (0..3).map(|_| 3.0 * normal()).collect();
    let mut noise = normal();
    let mut out = DMatrix::zeros(frames, 6);
    for k in 0..frames {
        let t = k as f64 / frames as f64;
        noise = rho * noise + (1.0 - rho * rho).sqrt() * normal();
        out[(k, 0)] = 1.0;
        out[(k, 1)] = t;
        for c in 0..3 {
            out[(k, 2 + c)] = (40.0 * (c as f64 + 1.0) * t + phase[c]).sin();
        }
        out[(k, 5)] = 0.7 - 0.3 * t + size * out[(k, 2)] + noise;
    }
    out
}

fn fits(table: &Table, precision: Matrix2<f64>) -> (Fits, Folds) {
    let folds = Folds::cut(table.nrows());
    let grams = BlockGrams::accumulate(table, &folds);
    let layout = Layout {
        nuisance_precision: DMatrix::from_fn(2, 2, |i, j| precision[(i, j)]),
        relative: 0..0,
        candidates: 3,
        residuals: 1,
    };
    (Fits::new(&grams, &folds, &layout, 1.0).unwrap(), folds)
}

/// One scalar a frame with the columns of `table`: nuisance of these prior precisions, candidates 0 and 2.
struct Dense {
    columns: DMatrix<f64>,
    residual: DVector<f64>,
    precision: DMatrix<f64>,
}

impl Dense {
    fn new(table: &Table, precision: Matrix2<f64>) -> Self {
        let rows = table.nrows();
        let mut prior = DMatrix::zeros(4, 4);
        prior.fixed_view_mut::<2, 2>(0, 0).copy_from(&precision);
        Self {
            columns: DMatrix::from_fn(rows, 4, |i, j| table[(i, [0, 1, 2, 4][j])]),
            residual: table.column(5).into_owned(),
            precision: prior,
        }
    }

    fn of(&self, rows: &[usize]) -> (DMatrix<f64>, DVector<f64>) {
        (
            self.columns.select_rows(rows),
            self.residual.select_rows(rows),
        )
    }

    /// Amplitudes from some rows under priors of this precision; the inverse of the normal matrix, and the
    /// squared error with what the priors add.
    fn solved(
        &self,
        rows: &[usize],
        precision: &DMatrix<f64>,
    ) -> (DVector<f64>, DMatrix<f64>, f64) {
        let (a, r) = self.of(rows);
        let inverse = (a.transpose() * &a + precision).try_inverse().unwrap();
        let score = a.transpose() * &r;
        let x = &inverse * &score;
        let error = r.norm_squared() - x.dot(&score);
        (x, inverse, error)
    }

    /// ln of the density of some rows, every amplitude drawn from its prior (precision in units of the
    /// noise `variance`).
    fn density(&self, rows: &[usize], precision: &DMatrix<f64>, variance: f64) -> f64 {
        let (a, r) = self.of(rows);
        let n = rows.len();
        let prior = precision.clone().try_inverse().unwrap();
        let covariance = (DMatrix::identity(n, n) + &a * prior * a.transpose()) * variance;
        let factor = Cholesky::new(covariance).unwrap();
        let square = r.dot(&factor.solve(&r));
        let constant = n as f64 * std::f64::consts::TAU.ln();
        -0.5 * (constant + factor.ln_determinant() + square)
    }
}

/// Errors and likelihoods by brute force. Error: solve on four folds, with a prior as wide as all data
/// make each amplitude, and predict the fifth. Likelihood: the dense density of all rows over that of the
/// four folds, and of the declared priors' share, that with them over that without.
#[test]
fn what_is_predicted_out_of_fold_equals_a_direct_fit() {
    let table = table(400, 0.0, 1.0, 1);
    // of amplitudes that are not drawn by themselves
    let precision = Matrix2::new(4.0, 6.0, 6.0, 25.0);
    let (fits, folds) = fits(&table, precision);
    let dense = Dense::new(&table, precision);
    let fold = folds.fold_of_frame();
    let rows: Vec<usize> = (0..400).collect();

    let (x, inverse, error) = dense.solved(&rows, &dense.precision);
    let variance = error / (400.0 - 4.0);
    let mut wide = dense.precision.clone();
    for i in [2, 3] {
        wide[(i, i)] = variance / (x[i] * x[i]).max(variance * inverse[(i, i)]);
    }
    // the candidates' information beside the nuisance, of one row of all
    let unit = inverse
        .view((2, 2), (2, 2))
        .into_owned()
        .try_inverse()
        .unwrap()
        / 400.0;
    let mut priors = dense.precision.clone();
    priors.view_mut((2, 2), (2, 2)).copy_from(&unit);

    let (mut sse, mut loglik) = (0.0, 0.0);
    for f in 0..5 {
        let (held, train): (Vec<usize>, Vec<usize>) = rows.iter().partition(|&&k| fold[k] == f);
        let (x, _, _) = dense.solved(&train, &wide);
        let (a, r) = dense.of(&held);
        sse += (r - a * x).norm_squared();
        let variance = dense.solved(&train, &priors).2 / (train.len() as f64 - 4.0);
        loglik +=
            dense.density(&rows, &priors, variance) - dense.density(&train, &priors, variance);
    }
    let mut free = priors.clone();
    free.view_mut((0, 0), (2, 2)).scale_mut(FREE);
    let variance = dense.solved(&rows, &priors).2 / (400.0 - 4.0);
    // the wider prior's own density at its middle is no part of what the declared one says
    let middle = -0.5 * (FREE * FREE).ln();
    loglik +=
        dense.density(&rows, &priors, variance) - dense.density(&rows, &free, variance) - middle;

    let ours = fits.out_of_fold(&[0, 2]).unwrap();
    let near = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-9, "{a} against {b}");
    near(ours.total_sse(), sse);
    near(ours.total_loglik(), loglik);
}

/// A column that lives in one fold but for a thousandth of its length: what the others say of its amplitude
/// is noise, 30 times as large as its own error. Acting with 8 sigmas it is worth about 32 nats less the price
/// of a parameter, ln(N)/2 = 3.5, known to 8 (the scatter of z^2/2); predicted by the amplitude of the others
/// as it is, it would lose 500. Without acting it is worth -3.5 and z^2/2: more than nothing in one of 130 by
/// the tail of chi-squared beyond 7. The others' amplitude is shrunk to a sixteenth, 2 sigmas of its own: the
/// squared error out of fold changes by 2^2 - 2 x 8 x 0.5 = -4 on average, with a scatter of 16 x 2, where it would
/// grow by 1000.
#[test]
fn what_acts_in_one_fold_alone_counts() {
    let frames = 1000;
    let gain = |size: f64, seed: u64| {
        let mut table = table(frames, 0.0, 0.0, seed);
        let fold = Folds::cut(frames).fold_of_frame();
        let length = (frames as f64 / 5.0).sqrt();
        for k in 0..frames {
            let own = if fold[k] == 2 {
                1.0
            } else {
                1e-3_f64.sqrt() / 2.0
            };
            table[(k, 2)] = own * if k % 2 == 0 { 1.0 } else { -1.0 };
            table[(k, 5)] += size / length * table[(k, 2)];
        }
        let (fits, _) = fits(&table, Matrix2::zeros());
        let (with, without) = (
            fits.out_of_fold(&[0]).unwrap(),
            fits.out_of_fold(&[]).unwrap(),
        );
        [
            with.total_loglik() - without.total_loglik(),
            with.total_sse() - without.total_sse(),
        ]
    };
    let seeds = 200;
    let mean = |values: Vec<f64>| values.iter().sum::<f64>() / seeds as f64;
    let all: Vec<[f64; 2]> = (0..seeds).map(|seed| gain(8.0, seed)).collect();
    let worth = mean(all.iter().map(|g| g[0]).collect());
    let error = mean(all.iter().map(|g| g[1]).collect());
    let scatter = (seeds as f64).sqrt();
    assert!((worth - 28.5).abs() < 5.0 * 8.0 / scatter, "{worth}");
    assert!((error + 4.0).abs() < 5.0 * 32.0 / scatter, "{error}");
    let alarms = (0..seeds).filter(|&seed| gain(0.0, seed)[0] > 0.0).count();
    assert!(alarms <= 8, "{alarms}");
}

/// Under noise that is correlated over 8 frames (blocks hold 33) the chance of
/// p < 0.05 without an effect is 0.05: over 400 seeds its standard error is
/// 0.011. Ordinary least squares would raise it to about 0.5.
#[test]
fn p_values_hold_under_coloured_noise() {
    let alarms = (0..400)
        .filter(|&seed| {
            let (fits, _) = fits(&table(2000, 0.88, 0.0, seed), Matrix2::zeros());
            fits.estimate(&[0, 1]).unwrap().p_value(&[0]) < 0.05
        })
        .count();
    let rate = alarms as f64 / 400.0;
    assert!((rate - 0.05).abs() < 5.0 * 0.011, "false alarm rate {rate}");
}

/// The same for three parameters at once, correlated over 1.4 frames (what leaks over the edges of
/// blocks counts three times).
#[test]
fn p_values_of_several_parameters_hold() {
    let all = [0, 1, 2];
    let alarms = (0..400)
        .filter(|&seed| {
            let (fits, _) = fits(&table(2000, 0.5, 0.0, seed), Matrix2::zeros());
            fits.estimate(&all).unwrap().p_value(&all) < 0.05
        })
        .count();
    let rate = alarms as f64 / 400.0;
    assert!((rate - 0.05).abs() < 5.0 * 0.011, "false alarm rate {rate}");
}

/// An estimate of uncorrelated parameters whose covariance, `sigma` squared, comes from 60 blocks; white
/// noise would make it 1.
fn drawn(value: &[f64], sigma: &[f64], normal: &mut dyn FnMut() -> f64) -> Estimate {
    let p = value.len();
    let mut covariance = DMatrix::zeros(p, p);
    for _ in 0..59 {
        let s = DVector::from_fn(p, |i, _| sigma[i] * normal());
        covariance.ger(1.0 / 59.0, &s, &s, 1.0);
    }
    Estimate {
        value: DVector::from_row_slice(value),
        covariance,
        white: DMatrix::identity(p, p),
        blocks: 60.0,
    }
}

/// Six parameters, q = 45: the logarithm of p is -16.9 if all is known. 60 blocks cost three nats; to
/// know all of a 6 x 6 covariance from them (Hotelling) costs five.
#[test]
fn several_parameters_lose_little_to_the_few_blocks() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(9);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let all: Vec<usize> = (0..6).collect();
    let known = ChiSquared::new(6.0).unwrap().sf(45.0).ln();
    let lost: f64 = (0..400)
        .map(|_| {
            let value = [45.0_f64.sqrt(), 0.0, 0.0, 0.0, 0.0, 0.0];
            let estimate = drawn(&value, &[1.0; 6], &mut normal);
            (estimate.p_value(&all).ln() - known) / 400.0
        })
        .sum();
    assert!((0.0..4.0).contains(&lost), "{lost} nats");
}

/// One amplitude scatters ten times as wide (in variance) as white noise, two do not: 200 alarms are
/// expected of 200 000 at 0.1 %, with a standard error of 14, and a fifth more is what the formula is
/// off by. Without the tail of the widest alone it is off by 70 %.
#[test]
fn unequal_variances_raise_no_false_alarms() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(7);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let sigma = [10.0_f64.sqrt(), 1.0, 1.0];
    let alarms = (0..200_000)
        .filter(|_| {
            let value = sigma.map(|s| s * normal());
            drawn(&value, &sigma, &mut normal).p_value(&[0, 1, 2]) < 1e-3
        })
        .count();
    assert!((130..290).contains(&alarms), "{alarms}");
}

/// z of the estimate has unit rms over 300 seeds, to 5/sqrt(600).
#[test]
fn sigmas_are_honest_under_coloured_noise() {
    let mut sum = 0.0;
    for seed in 0..300 {
        let (fits, _) = fits(&table(2000, 0.88, 2.0, 1000 + seed), Matrix2::zeros());
        let estimate = fits.estimate(&[0]).unwrap();
        sum += ((estimate.value[0] - 2.0) / estimate.sigma(0)).powi(2);
    }
    let rms = (sum / 300.0_f64).sqrt();
    assert!((rms - 1.0).abs() < 5.0 / 600.0_f64.sqrt(), "rms z {rms}");
}

/// One pass over the blocks for all columns, and one for each by itself.
#[test]
fn columns_say_the_same_together_and_alone() {
    for precision in [Matrix2::zeros(), Matrix2::new(40.0, 10.0, 10.0, 90.0)] {
        let (fits, _) = fits(&table(400, 0.6, 0.3, 11), precision);
        let together = fits.each_alone(&[0, 1, 2]);
        for (c, (width, freedom)) in together.into_iter().enumerate() {
            let alone = fits.scatter(&[c]).unwrap();
            let expected = alone.robust[(0, 0)] / alone.white[(0, 0)];
            assert!((width / expected - 1.0).abs() < 1e-9, "{width} {expected}");
            assert!((freedom - alone.blocks + 1.0).abs() < 1e-9);
        }
    }
}

#[test]
fn a_set_that_cannot_be_told_apart_is_refused() {
    let mut table = table(400, 0.0, 1.0, 1);
    let copy = table.column(2).into_owned();
    table.set_column(3, &(2.0 * copy));
    let (fits, _) = fits(&table, Matrix2::zeros());
    assert!(fits.estimate(&[0]).is_some());
    assert!(fits.estimate(&[0, 1]).is_none());
}

/// On all data alone there are amplitudes and errors, but no blocks to scatter and no folds to predict.
#[test]
fn all_data_alone_tells_no_scatter() {
    let table = table(400, 0.0, 1.0, 1);
    let (fits, folds) = fits(&table, Matrix2::zeros());
    let layout = fits.layout.clone();
    let alone = Fits::whole(&BlockGrams::accumulate(&table, &folds), &layout, 1.0).unwrap();
    let (a, b) = (
        alone.solution(&[0, 2]).unwrap(),
        fits.solution(&[0, 2]).unwrap(),
    );
    // the order of the sums is another
    assert!((&a - &b).norm() < 1e-9 * b.norm(), "{a} {b}");
    assert!(fits.estimate(&[0]).is_some() && alone.estimate(&[0]).is_none());
}

/// The same numbers where a block's Gram is a shared matrix and rows on top, and where the sums over
/// folds are known before: rounding alone. Covariance and errors by block against whole products.
#[test]
fn products_of_few_columns_are_those_of_all() {
    let table = table(600, 0.5, 1.0, 3);
    let folds = Folds::cut(600);
    let whole = BlockGrams::accumulate(&table, &folds);
    let layout = Layout {
        nuisance_precision: DMatrix::from_diagonal(&DVector::from_vec(vec![0.0, 25.0])),
        relative: 0..0,
        candidates: 3,
        residuals: 1,
    };
    let (weight, width) = (0.3, table.ncols());
    let split: Vec<(DMatrix<f64>, DMatrix<f64>)> = folds
        .blocks
        .iter()
        .map(|b| {
            let own = table.rows(b.start, b.len());
            let (rest, rows) = (own.rows(2, b.len() - 2), own.rows(0, 2).into_owned());
            ((rest.transpose() * rest) / weight, rows)
        })
        .collect();
    let known = (0..folds.count)
        .map(|f| {
            let own = split.iter().zip(&folds.fold_of_block);
            let own = own.filter(|(_, of)| **of == f);
            let sum = own.fold(DMatrix::zeros(width, width), |sum, (s, _)| sum + &s.0);
            Symmetric::of_lower(&sum)
        })
        .collect();
    let parts = BlockGrams {
        gram: split
            .into_iter()
            .map(|(shared, rows)| Gram::new(weight, Symmetric::of_lower(&shared).into(), rows))
            .collect(),
        known: Some(std::sync::Arc::new(known)),
        ..whole.clone()
    };
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-9 * a.abs(), "{a} {b}");
    let one = Fits::new(&whole, &folds, &layout, 1.3).unwrap();
    let two = Fits::new(&parts, &folds, &layout, 1.3).unwrap();
    for set in [&[0][..], &[2, 0], &[]] {
        let (a, b) = (one.out_of_fold(set).unwrap(), two.out_of_fold(set).unwrap());
        near(a.total_loglik(), b.total_loglik());
        for fits in [&one, &two] {
            let by_block = fits.out_of_fold_by_block(set).unwrap();
            near(a.total_sse(), by_block.total_sse());
            assert_eq!(by_block.sse.len(), folds.blocks.len());
        }
        let (a, b) = (one.estimate(set).unwrap(), two.estimate(set).unwrap());
        // block by block, the nuisance taken out of whole matrices
        let (p, last) = (set.len(), one.all.train.ncols() - 1);
        let pick = layout.picked(None);
        let mut spread = DMatrix::zeros(p, p);
        let mut sum = DMatrix::zeros(last + 1, last + 1);
        let mut shares = Vec::new();
        for b in &folds.blocks {
            let own = table.rows(b.start, b.len());
            let gram = transformed(&(own.transpose() * own), 2, &pick, &one.all.nuisance);
            let score = DVector::from_fn(p, |i, _| {
                let fitted = (0..p).map(|j| gram[(set[i], set[j])] * a.value[j]);
                gram[(set[i], last)] - fitted.sum::<f64>()
            });
            spread += &score * score.transpose();
            let train = |c: &usize| gram[(*c, *c)] / one.all.train[(*c, *c)];
            shares.push(set.iter().map(train).sum::<f64>());
            sum += gram;
        }
        // what equal blocks would hold as much; nearly all of the sixty
        let blocks = shares.iter().sum::<f64>().powi(2) / shares.iter().map(|s| s * s).sum::<f64>();
        assert!(p == 0 || (40.0..=60.0).contains(&blocks), "{blocks}");
        let train = &one.all.train;
        let inner = DMatrix::from_fn(p, p, |i, j| {
            let prior = train[(set[i], set[j])] - sum[(set[i], set[j])];
            spread[(i, j)] * blocks / (blocks - 1.0) + one.variance(set).unwrap() * prior
        });
        let inverse = DMatrix::from_fn(p, p, |i, j| train[(set[i], set[j])])
            .try_inverse()
            .unwrap();
        let covariance = &inverse * inner * &inverse;
        for i in 0..p {
            near(a.value[i], b.value[i]);
            for j in 0..p {
                near(covariance[(i, j)], a.covariance[(i, j)]);
                near(covariance[(i, j)], b.covariance[(i, j)]);
            }
        }
    }
}

/// A wave that acts in a part of the time: candidates of 30 such, on AR(1) noise of correlation `rho`;
/// the first acts with `size`.
fn windowed(rho: f64, size: f64, seed: u64) -> (Fits, Folds) {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let (frames, candidates) = (1800, 30);
    let place: Vec<(usize, f64)> = (0..candidates).map(|c| (c * 50, 3.0 * normal())).collect();
    let mut noise = normal();
    let mut out = DMatrix::zeros(frames, candidates + 2);
    for k in 0..frames {
        let t = k as f64 / frames as f64;
        noise = rho * noise + (1.0 - rho * rho).sqrt() * normal();
        out[(k, 0)] = 1.0;
        for (c, (first, phase)) in place.iter().enumerate() {
            // 300 frames: ten blocks of sixty
            if (*first..first + 300).contains(&k) {
                out[(k, 1 + c)] = (90.0 * t + phase).sin();
            }
        }
        out[(k, candidates + 1)] = size * out[(k, 1)] + noise;
    }
    let table = out;
    let folds = Folds::cut(frames);
    let grams = BlockGrams::accumulate(&table, &folds);
    let layout = Layout {
        nuisance_precision: DMatrix::zeros(1, 1),
        relative: 0..0,
        candidates,
        residuals: 1,
    };
    (Fits::new(&grams, &folds, &layout, 1.0).unwrap(), folds)
}

/// Ten blocks hold a column's information: their own scatter is off by half, and what all columns say
/// keeps p-values where they belong under coloured noise, too. (White noise for granted: 0.24.)
#[test]
fn p_values_of_columns_that_act_in_a_part_of_the_time_hold() {
    let alarms = (0..400)
        .filter(|&seed| {
            let (fits, _) = windowed(0.5, 0.0, seed);
            fits.estimate(&[0]).unwrap().p_value(&[0]) < 0.05
        })
        .count();
    let rate = alarms as f64 / 400.0;
    assert!((rate - 0.05).abs() < 5.0 * 0.011, "false alarm rate {rate}");
}

/// White noise, 5.5 sigma: the logarithm of p if all is known, against ours. From their own ten blocks
/// it would lose ten nats; at 130 degrees of freedom t loses 1.6, and a scatter taken for a tenth too large 1.5.
#[test]
fn columns_that_act_in_a_part_of_the_time_lose_little() {
    let (mut known, mut ours) = (0.0, 0.0);
    for seed in 0..200 {
        let (fits, _) = windowed(0.0, 0.45, 1000 + seed);
        let estimate = fits.estimate(&[0]).unwrap();
        let square = estimate.square(&[0]).unwrap();
        known += ChiSquared::new(1.0).unwrap().sf(square).ln() / 200.0;
        ours += estimate.p_value(&[0]).ln() / 200.0;
    }
    assert!((-20.0..-14.0).contains(&known), "{known}");
    assert!(
        (0.0..5.0).contains(&(ours - known)),
        "{ours} against {known}"
    );
}

/// A nuisance column that lives in the last fold alone is that fold's own: its residual is that of a fit in
/// the fold, given what the others say of all else.
#[test]
fn what_lives_in_a_fold_alone_is_fitted_there() {
    let mut table = table(1000, 0.0, 0.5, 4);
    let frames = table.nrows();
    let folds = Folds::cut(frames);
    let last = folds.fold_ranges().last().cloned().unwrap();
    for k in 0..frames {
        let alone = last.contains(&k);
        table[(k, 1)] = if alone {
            1.0 + 0.3 * (k as f64).sin()
        } else {
            0.0
        };
        // as large as it is, nobody else can know of it
        table[(k, 5)] += 30.0 * table[(k, 1)];
    }
    let (fits, folds) = fits(&table, Matrix2::new(0.0, 0.0, 0.0, 1e-4));
    let fold = folds.count - 1;
    let beta = fits.amplitudes_without(fold, &[0]).unwrap();
    let nuisance = fits.nuisance(Some(fold), &[0], &beta);
    let left: Vec<f64> = last
        .clone()
        .map(|k| table[(k, 5)] - nuisance[0] - beta[0] * table[(k, 2)])
        .collect();
    let of = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
        let each = last.clone().zip(&left);
        each.map(|(k, r)| f(table[(k, 1)], *r)).sum()
    };
    let expected = of(&|c, r| c * r) / (of(&|c, _| c * c) + 1e-4);
    assert!((nuisance[1] - expected).abs() < 1e-9 * expected.abs());
    // noise of variance 1, and what is known of the amplitudes
    let error = fits.out_of_fold(&[0]).unwrap().sse[fold] / last.len() as f64;
    assert!((0.7..1.4).contains(&error), "{error}");
}

/// A nuisance column in other units (an image that grows in px beside an angle in rad) changes no amplitude and
/// no likelihood: what keeps a column that nothing constrains in bounds is in its own units.
#[test]
fn units_of_the_nuisance_do_not_matter() {
    let plain = table(2000, 0.3, 0.2, 5);
    let mut scaled = plain.clone();
    scaled.column_mut(1).scale_mut(1e8);
    let all = [0, 1, 2];
    let [(a, like_a), (b, like_b)] = [plain, scaled].map(|table| {
        let (fits, _) = fits(&table, Matrix2::zeros());
        let out = fits.out_of_fold(&all).unwrap();
        (fits.estimate(&all).unwrap().value, out.total_loglik())
    });
    assert!((&a - &b).norm() < 1e-6 * a.norm(), "{a} {b}");
    assert!((like_a - like_b).abs() < 1e-3, "{like_a} {like_b}");
}

/// However large an angle is that the data tell and no prior knows of, it costs nothing: of 1e6 sigmas (560 arcsec
/// known to 0.6 mas) the sum of squares, 1e12 of which the angle explains, is the same to its rounding, 1e-16 of
/// that over the condition of two columns. Had it been given 1e-10 of its information beside, that would be 100, and
/// 5 under noise that leaves a twentieth of the information: 47 nats for noise that is not there.
#[test]
fn a_large_unknown_costs_no_likelihood() {
    let plain = table(2000, 0.0, 0.0, 6);
    let mut large = plain.clone();
    let offset = 1e6 / 2000_f64.sqrt();
    large.column_mut(5).add_scalar_mut(offset);
    let [a, b] = [plain, large].map(|table| {
        let (fits, _) = fits(&table, Matrix2::zeros());
        fits.log_marginal(&[]).unwrap()
    });
    assert!((a - b).abs() < 0.02, "{a} {b}");
}

/// Sources that are seen in every frame; a candidate grows with time as its sources lie, `size` times. Beside white
/// noise of 1 each source drifts by its own, by `drift` at the ends.
struct Sources(DMatrix<f64>);

const SOURCES: usize = 50;
const PICTURES: usize = 40;

impl Design for Sources {
    fn width(&self) -> usize {
        self.0.ncols()
    }
    fn fill(&self, frames: Range<usize>, out: &mut DMatrix<f64>) -> usize {
        let rows = frames.len() * SOURCES;
        *out = self.0.rows(frames.start * SOURCES, rows).into_owned();
        rows
    }
}

/// Fits of the trend, with the sources as parts or without.
fn trend(size: f64, drift: f64, apart: bool, seed: u64) -> Fits {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let apart_by = 3.4 / SOURCES as f64;
    let sources: Vec<[f64; 2]> = (0..SOURCES)
        .map(|s| [apart_by * s as f64 - 1.7, drift * normal()])
        .collect();
    let table = DMatrix::from_fn(PICTURES * SOURCES, 3, |row, column| {
        let t = (row / SOURCES) as f64 / (0.5 * PICTURES as f64) - 1.0;
        let [at, own] = sources[row % SOURCES];
        match column {
            0 => at,
            1 => at * t,
            _ => size * at * t + own * t + normal(),
        }
    });
    let table = Sources(table);
    let folds = Folds::cut(PICTURES);
    let mut grams = BlockGrams::accumulate(&table, &folds);
    if apart {
        let nothing = std::sync::Arc::new(Symmetric::zeros(3));
        let of_source = |s: usize| {
            let rows: Vec<usize> = (0..PICTURES).map(|k| k * SOURCES + s).collect();
            Gram::new(0.0, nothing.clone(), table.0.select_rows(&rows))
        };
        grams.by_source = (0..SOURCES).map(of_source).collect();
    }
    let layout = Layout {
        nuisance_precision: DMatrix::zeros(1, 1),
        relative: 0..0,
        candidates: 1,
        residuals: 1,
    };
    Fits::new(&grams, &folds, &layout, 1.0).unwrap()
}

/// What each source drifts by makes the trend's sigma sqrt(1 + 40/3) = 3.8 times that of white noise, and its own
/// scatter shows it: 1 in 20 is 1 in 20, known to 0.011 over 400 runs, of which five.
#[test]
fn p_values_of_a_trend_hold_beside_drifts_of_each_source() {
    let alarms = (0..400)
        .filter(|&seed| {
            let fits = trend(0.0, 1.0, true, seed);
            fits.estimate(&[0]).unwrap().p_value(&[0]) < 0.05
        })
        .count();
    let rate = alarms as f64 / 400.0;
    assert!((rate - 0.05).abs() < 5.0 * 0.011, "false alarm rate {rate}");
}

/// A trend of 0.35 in 40 pictures of 50 sources is one of 0.35 sqrt(2000/3) = 9 sigma. Of five blocks in time two hold
/// it, and p of so few is one in a hundred; of sources, 5/9 of their number.
#[test]
fn a_trend_of_few_pictures_is_told_by_its_sources() {
    let [in_time, by_source] = [false, true].map(|apart| {
        let of = |seed| {
            let fits = trend(0.35, 0.0, apart, seed);
            fits.estimate(&[0]).unwrap().p_value(&[0])
        };
        let mut p: Vec<f64> = (0..41).map(of).collect();
        p.sort_by(f64::total_cmp);
        p[20]
    });
    // t of 27 degrees at 9 sigma: 1e-9, at 7: 2e-7
    assert!(by_source < 1e-7 && in_time > 1e-3, "{in_time} {by_source}");
}

/// Data without any noise, in all folds or in all but one, are as likely as rounding lets them be, and no likelihood is
/// infinite: 90 squares over eps of their mean over 500 scalars are 500/eps, of which a half counts.
#[test]
fn a_fold_of_no_noise_has_a_likelihood() {
    for odd in [0.0, 1.0] {
        let mut table = table(500, 0.0, 0.0, 4);
        for k in 0..500 {
            let alternates = [1.0, -1.0][k % 2];
            table[(k, 5)] = if k < 90 { odd * alternates } else { 0.0 };
        }
        let (fits, _) = fits(&table, Matrix2::zeros());
        let [least, most] = [-260.0 / f64::EPSILON, 1e6];
        let all = fits.out_of_fold(&[]).unwrap().total_loglik();
        assert!((least..most).contains(&all), "{odd}: {all:e}");
    }
}
