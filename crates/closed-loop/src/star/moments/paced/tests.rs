//! Two paces against every row.

use std::f64::consts::PI;
use std::sync::Arc;

use block_regression::Folds;
use focal_plane::{
    ARCSEC_PER_RAD, AttitudeSeries, Camera, Series, StarFrames, rotation_from_vector,
};
use nalgebra::{DMatrix, Vector3};
use telemetry::Model;

use super::*;
use crate::causes::description::Kept;
use crate::search::empirical::{Empirical, Variable};
use crate::star::harness::seen;

const FRAMES: usize = 400;
const STARS: [[f64; 2]; 4] = [
    [300.0, 90.0],
    [-250.0, 330.0],
    [-160.0, -320.0],
    [190.0, -190.0],
];

/// A slew at 10 Hz that takes the stars along by 0.3 px a frame and more; one gap, one outlier.
fn data() -> StarData {
    let camera = Camera::from_fov_deg([1024, 1024], [20.0, 20.0]).unwrap();
    let px = camera.arcsec_per_px()[0] / ARCSEC_PER_RAD;
    let direction = |at: [f64; 2]| camera.direction(focal_plane::Pixel { x: at[0], y: at[1] });
    let mut frames = StarFrames::new();
    let (mut t_s, mut q) = (Vec::new(), Vec::new());
    for k in 0..FRAMES {
        let t = 0.1 * k as f64 + if k > 230 { 0.7 } else { 0.0 };
        let turn = Vector3::new(3.0 * t + 0.05 * t * t, -2.0 * t, 0.0) * px;
        let turned = rotation_from_vector(&turn);
        frames.begin(t);
        for (s, star) in STARS.iter().enumerate() {
            let at = camera.project(&(turned * direction(*star))).unwrap();
            let s = i32::try_from(s).unwrap();
            let noise = (12.9 * (k + 7) as f64 * (1.3 + f64::from(s))).sin();
            frames.push(s, i64::from(s), at.x + 0.1 * noise, at.y - 0.2 * noise);
        }
        t_s.push(t);
        q.push(turned);
    }
    let reference = AttitudeSeries::new(t_s, q, None).unwrap();
    let mut data = seen(&camera, &frames, Some(&reference), &STARS);
    data.outlier[4 * 77 + 1] = true;
    data
}

fn model() -> Model {
    Model::parse(
        "format = \"boresight-model/1\"\n[tracker]\npixels = [1024, 1024]\nfov_deg = [20.0, 20.0]\n\
         [noise]\ntemporal_arcsec = 7.0\ndistortion_arcsec = 3.0\ndistortion_order = 3\n",
        "model.toml",
        &[],
    )
    .unwrap()
}

/// Hands over the columns of the declared unknowns, of a fast term, of two slow ones, and the residual.
fn with_columns(check: impl Fn(&StarColumns<'_>)) {
    let data = data();
    let span = [data.t_s[0], data.t_s[data.t_s.len() - 1]];
    let ids = data.stars.iter().map(|s| s.id).collect();
    let terms = [
        Empirical::new(Variable::Phase(0), [0.0, 1.0], true).unwrap(),
        Empirical::new(Variable::Time, span, true).unwrap(),
        Empirical::new(Variable::Star(ids), [0.0, 1.0], true).unwrap(),
    ];
    with_candidates(&data, &terms.each_ref().map(|t| t as &dyn Candidate), check);
}

fn with_candidates(
    data: &StarData,
    candidates: &[&dyn Candidate],
    check: impl Fn(&StarColumns<'_>),
) {
    let nuisance = StarNuisance::declared(&model(), data);
    let weight: Vec<f64> = data.star.iter().map(|&s| 0.8 + 0.1 * s as f64).collect();
    check(&StarColumns {
        data,
        nuisance: &nuisance,
        candidates,
        residuals: &[data.measured_residual()],
        motion: None,
        weight: &weight,
    });
}

#[test]
fn lines_are_summed_exactly() {
    for (size, [a, b]) in SIZES {
        let node = |frame, other| Node {
            frame,
            group: 0..size,
            other: Some(other),
        };
        let (one, two) = (node(a, b), node(b, a));
        let sum = |of: &dyn Fn(usize) -> f64| (0..size).map(of).sum::<f64>();
        assert!((sum(&|k| one.share(k).powi(2)) - 0.5 * size as f64).abs() < 1e-12);
        assert!((sum(&|k| two.share(k).powi(2)) - 0.5 * size as f64).abs() < 1e-12);
        assert!(sum(&|k| one.share(k) * two.share(k)).abs() < 1e-12);
    }
}

/// Every frame is in one group, whose other frames are like it.
#[test]
fn groups_end_at_gaps_outliers_and_stretches() {
    with_columns(|columns| {
        let stretches = [0..100, 100..FRAMES];
        let nodes = nodes(columns, &stretches, &SIZES);
        let mut held = vec![0; FRAMES];
        for node in &nodes {
            let first = node.other.is_none_or(|other| node.frame < other);
            node.group
                .clone()
                .for_each(|k| held[k] += usize::from(first));
            let whole = |at: usize| node.group.end <= at || node.group.start >= at;
            assert!(whole(100) && whole(231));
            assert!(!node.group.contains(&77) || node.group.len() == 1);
        }
        assert!(held.iter().all(|h| *h == 1));
        assert!(4 * nodes.len() < FRAMES, "{}", nodes.len());
    });
}

/// Products of what is taken at every frame are the same to rounding; all others to what the distortion
/// bends within a group: of third order in a move of 8 px, (8/512)^2 of it at most, once more in the square.
#[test]
fn products_are_those_of_every_frame() {
    with_columns(|columns| {
        let folds = Folds::whole(FRAMES);
        let paced = Paced::of(columns, &folds.blocks).unwrap();
        assert_eq!(paced.fast, [true, false, false]);
        let of = |sums: &dyn Fn(Range<usize>, &mut Scratch) -> Sums| {
            let mut scratch = Scratch::default();
            let each = folds.blocks.iter().map(|b| {
                let sums = sums(b.clone(), &mut scratch);
                sums.block(&mut scratch)
            });
            each.map(|b| (DMatrix::from(&*b.rest), b.scalars))
                .reduce(|a, b| (a.0 + b.0, a.1 + b.1))
                .unwrap()
        };
        let (ours, scalars) = of(&|frames, scratch| paced.sums(columns, frames, None, scratch));
        let (all, count) = of(&|frames, scratch| Sums::over(columns, frames, None, scratch));
        assert!((scalars - count).abs() < 0.5);
        let (width, first) = (all.ncols(), paced.places(columns)[0]);
        let off = |i: usize, j: usize| {
            (ours[(i, j)] - all[(i, j)]).abs() / (all[(i, i)] * all[(j, j)]).sqrt()
        };
        // the order in a Gram matrix is nuisance, candidates, residual
        let unknowns = width
            - 1
            - columns
                .candidates
                .iter()
                .map(|c| c.coefficients().len())
                .sum::<usize>();
        assert!(first < unknowns);
        let is_fast = |c: usize| (unknowns..unknowns + 12).contains(&c) || c == width - 1;
        let worst = DMatrix::from_fn(width, width, |i, j| {
            let limit = if is_fast(i) && is_fast(j) {
                1e-11
            } else {
                3e-4
            };
            off(i, j) / limit
        });
        assert!(
            worst.max() < 1.0,
            "{} at {:?}",
            worst.max(),
            worst.iamax_full()
        );
        let time = unknowns + 12;
        let exact = (time..time + 2)
            .map(|i| off(i, width - 1))
            .fold(0.0, f64::max);
        assert!(exact < 1e-12, "straight columns are exact: {exact}");
    });
}

/// A channel that swings in 20 s, by up to its third power: of its third harmonic, 0.94 rad/s, an arc of 2 h = 0.7 s
/// lies off the line through two frames by (0.94 h)^2 / (3 sqrt 5) = 0.016 of itself. The square, 3e-4, is nothing to a
/// description, and too much for an effect.
#[test]
fn descriptions_may_be_rough() {
    let data = data();
    let t_s: Vec<f64> = (0..500).map(|k| 0.1 * f64::from(k)).collect();
    let swing = t_s.iter().map(|t| (t * 2.0 * PI / 20.0).sin()).collect();
    let channel = Series::new(t_s, swing).unwrap();
    let variable = Variable::Housekeeping("swing_c".to_owned(), channel);
    let term = Empirical::new(variable, [-1.0, 1.0], true).unwrap();
    let all = (0..term.coefficients().len()).collect();
    let effect = Kept::new(Arc::new(term.clone()), all);
    let time = Empirical::new(Variable::Time, [0.0, 40.0], true).unwrap();
    let candidates: [&dyn Candidate; 3] = [&term, &effect, &time];
    with_candidates(&data, &candidates, |columns| {
        let folds = Folds::whole(FRAMES);
        let paced = Paced::of(columns, &folds.blocks).unwrap();
        assert_eq!(paced.fast, [false, true, false]);
    });
}
