//! Epoch attitude and gyro bias by batch least squares, and the residual of the tracker against them.
//!
//! ```text
//! q_g' = -w q_g                                        gyro propagated, tracker axes
//! y_k = q_g^-1 log(q_k q_g^-1) = theta + B_k b + walk_k + noise_k,    inertial axes
//! B_k = integral of q_g^-1 dt,   walk: N^2 per second about each axis,   noise: the tracker's, turned
//! ```
//!
//! In inertial axes a constant error stays, and the gyro's angle random walk is a plain random walk. The
//! residual is that of unweighted least squares, as [A01] has it. Bias and attitude at the epoch are
//! estimated again with the walk in the weights: a Kalman filter of the walk turns measurements and
//! design into white rows. N is the one that makes the rows most likely, unless it is given; it holds
//! whatever wanders, for a slow error of the tracker cannot be told from the gyro's. Each stretch without
//! a gap in the gyro has an epoch attitude of its own; the bias is one.
//!
//! Source: [A01], the EO-1 section; Kay, Fundamentals of Statistical Signal Processing (1993), Section
//! 6.4 (generalised least squares), Section 13.4 (innovations).

use focal_plane::{ARCSEC_PER_RAD, Angle, rotation_from_vector, rotation_vector};
use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, UnitQuaternion, Vector3};
use telemetry::RateTable;

use crate::observed::median;
use crate::{AssessError, Observed};

/// Random walks that are tried, arcsec per root second.
const WALKS: [f64; 2] = [1e-4, 10.0];

/// Rounds of the bias: the remainder falls by the angle it makes, a hundredth of a radian at most.
const ROUNDS: usize = 4;

/// What the gyro route found.
#[derive(Clone, Debug, PartialEq)]
pub struct GyroSolution {
    /// Gyro bias, tracker axes, arcsec/s: measured minus true rate.
    pub bias_arcsec_s: [f64; 3],
    /// Its 1 sigma.
    pub bias_sigma_arcsec_s: [f64; 3],
    /// Attitude at the first frame, inertial to tracker.
    pub epoch: UnitQuaternion<f64>,
    /// Its 1 sigma about the tracker's axes, arcsec.
    pub epoch_sigma_arcsec: [f64; 3],
    /// Random walk in the weights, arcsec per root second.
    pub walk_arcsec_rt_s: f64,
    /// Stretches of gyro data without a gap.
    pub stretches: usize,
    /// Times of the frames used, s.
    pub t_s: Vec<f64>,
    /// Index of each frame in the cleaned ones.
    pub frame: Vec<usize>,
    /// Residual about the tracker's axes, arcsec.
    pub residual_arcsec: [Vec<f64>; 3],
}

/// One frame against the gyro.
struct Row {
    frame: usize,
    t_s: f64,
    stretch: usize,
    q: UnitQuaternion<f64>,
    /// Inertial axes, rad.
    y: Vector3<f64>,
    /// Inertial axes, s.
    b: Matrix3<f64>,
}

/// Solves. `noise_arcsec` is the tracker's white noise about its axes; `walk` fixes the random walk,
/// arcsec per root second.
///
/// # Errors
/// Too few frames inside the gyro's span.
pub fn gyro_solution(
    observed: &Observed,
    rates: &RateTable,
    noise_arcsec: [f64; 3],
    walk: Option<f64>,
) -> Result<GyroSolution, AssessError> {
    if let Some(walk) = walk
        && !(walk.is_finite() && walk >= 0.0)
    {
        return Err(AssessError::OutOfRange {
            name: "gyro random walk",
            value: walk,
            expected: "finite and not negative",
        });
    }
    // the path itself turns with the bias: 1 arcsec/s is two degrees in two hours. Each round takes it off
    let mut bias = Vector3::zeros();
    for _ in 0..ROUNDS {
        let rows = propagate(observed, rates, &bias);
        const NEED: usize = 30;
        if rows.len() < NEED {
            return Err(AssessError::TooFew {
                got: rows.len(),
                need: NEED,
                why: " inside the span of the gyro",
            });
        }
        let stretches = rows.last().map_or(0, |row| row.stretch + 1);
        let change = ordinary(&rows, stretches)?;
        bias += change.fixed_rows::<3>(0);
    }
    let rows = propagate(observed, rates, &bias);
    let stretches = rows.last().map_or(0, |row| row.stretch + 1);
    let unweighted = ordinary(&rows, stretches)?;
    let mut residual_arcsec: [Vec<f64>; 3] = Default::default();
    for row in &rows {
        let e = row.q * (row.y - modelled(row, &unweighted));
        for (axis, out) in residual_arcsec.iter_mut().enumerate() {
            out.push(Angle::from_rad(e[axis]).arcsec());
        }
    }
    let noise = noise_arcsec.map(|sigma| Angle::from_arcsec(sigma.max(1e-3)).rad());
    let walk_arcsec_rt_s = match walk {
        Some(walk) => walk,
        None => likeliest(&rows, stretches, &noise),
    };
    let n = Angle::from_arcsec(walk_arcsec_rt_s).rad();
    let Weighted { p, covariance, .. } = weighted(&rows, stretches, &noise, n)
        .ok_or_else(|| undetermined("epoch attitude and gyro bias"))?;
    let first = &rows[0];
    let epoch = rotation_from_vector(&(first.q * p.fixed_rows::<3>(3).into_owned())) * first.q;
    let turn = first.q.to_rotation_matrix();
    let at_epoch = turn.matrix()
        * covariance.fixed_view::<3, 3>(3, 3).into_owned()
        * turn.matrix().transpose();
    Ok(GyroSolution {
        bias_arcsec_s: [0, 1, 2].map(|i| (bias[i] + p[i]) * ARCSEC_PER_RAD),
        bias_sigma_arcsec_s: [0, 1, 2].map(|i| covariance[(i, i)].sqrt() * ARCSEC_PER_RAD),
        epoch,
        epoch_sigma_arcsec: [0, 1, 2].map(|i| at_epoch[(i, i)].sqrt() * ARCSEC_PER_RAD),
        walk_arcsec_rt_s,
        stretches,
        t_s: rows.iter().map(|row| row.t_s).collect(),
        frame: rows.iter().map(|row| row.frame).collect(),
        residual_arcsec,
    })
}

fn undetermined(what: &'static str) -> AssessError {
    AssessError::Fit {
        what,
        reason: "the data do not determine all parameters".into(),
    }
}

/// Gyro attitude at each frame inside the gyro's span, and what goes with it.
fn propagate(observed: &Observed, rates: &RateTable, bias: &Vector3<f64>) -> Vec<Row> {
    let t = &rates.t_s;
    let w: Vec<Vector3<f64>> = rates.w.iter().map(|w| w - bias).collect();
    let mut steps: Vec<f64> = t.windows(2).map(|t| t[1] - t[0]).collect();
    let step_s = median(&mut steps);
    let mut rows = Vec::new();
    let (mut k, mut frame) = (0, 0);
    let mut stretch: Option<usize> = None;
    let mut q = UnitQuaternion::identity();
    let mut b = Matrix3::zeros();
    let mut started = false;
    while k + 1 < t.len() && frame < observed.len() {
        if t[k + 1] - t[k] > 1.5 * step_s {
            // frames in the hole have no gyro; what follows begins anew
            while frame < observed.len() && observed.t_s[frame] < t[k + 1] {
                frame += 1;
            }
            started = false;
            k += 1;
            continue;
        }
        while frame < observed.len() && observed.t_s[frame] < t[k] {
            frame += 1;
        }
        let last = k + 2 == t.len();
        let inside = |s: f64| s < t[k + 1] || (last && s <= t[k + 1]);
        while frame < observed.len() && inside(observed.t_s[frame]) {
            let at = observed.t_s[frame];
            let share = (at - t[k]) / (t[k + 1] - t[k]);
            let w_at = w[k].lerp(&w[k + 1], share);
            let (mut q_at, mut b_at) = advance(&q, &b, &w[k], &w_at, at - t[k]);
            if !started {
                // the first frame of a stretch: the gyro starts from it
                started = true;
                stretch = Some(stretch.map_or(0, |s| s + 1));
                let turn = q_at.inverse() * observed.q[frame];
                q *= turn;
                q_at = observed.q[frame];
                b = Matrix3::zeros();
                let back = advance(&q, &b, &w[k], &w_at, at - t[k]).1;
                b = -back;
                b_at = Matrix3::zeros();
            }
            rows.push(Row {
                frame,
                t_s: at,
                stretch: stretch.unwrap_or(0),
                q: q_at,
                y: q_at.inverse() * rotation_vector(&observed.q[frame], &q_at),
                b: b_at,
            });
            frame += 1;
        }
        if started {
            (q, b) = advance(&q, &b, &w[k], &w[k + 1], t[k + 1] - t[k]);
        }
        k += 1;
    }
    rows
}

/// One step: rates go linearly, fourth order in the step; the integral by Simpson.
fn advance(
    q: &UnitQuaternion<f64>,
    b: &Matrix3<f64>,
    w0: &Vector3<f64>,
    w1: &Vector3<f64>,
    h_s: f64,
) -> (UnitQuaternion<f64>, Matrix3<f64>) {
    let turn = |from: &Vector3<f64>, to: &Vector3<f64>, h: f64| {
        rotation_from_vector(&((from + to) * (-0.5 * h) - from.cross(to) * (h * h / 12.0)))
    };
    let half = turn(w0, &((w0 + w1) * 0.5), 0.5 * h_s) * q;
    let next = UnitQuaternion::new_normalize((turn(w0, w1, h_s) * q).into_inner());
    let back = |q: &UnitQuaternion<f64>| *q.inverse().to_rotation_matrix().matrix();
    let sum = (back(q) + back(&half) * 4.0 + back(&next)) * (h_s / 6.0);
    (next, b + sum)
}

/// Bias, then an attitude for each stretch.
fn modelled(row: &Row, p: &DVector<f64>) -> Vector3<f64> {
    let at = 3 + 3 * row.stretch;
    row.b * p.fixed_rows::<3>(0) + p.fixed_rows::<3>(at)
}

fn ordinary(rows: &[Row], stretches: usize) -> Result<DVector<f64>, AssessError> {
    let n = 3 + 3 * stretches;
    let (mut gram, mut right) = (DMatrix::zeros(n, n), DVector::zeros(n));
    for row in rows {
        let mut design = DMatrix::zeros(3, n);
        design.fixed_view_mut::<3, 3>(0, 0).copy_from(&row.b);
        let at = 3 + 3 * row.stretch;
        design
            .fixed_view_mut::<3, 3>(0, at)
            .copy_from(&Matrix3::identity());
        gram += design.tr_mul(&design);
        right += design.tr_mul(&row.y);
    }
    gram.cholesky()
        .map(|c| c.solve(&right))
        .ok_or_else(|| undetermined("epoch attitude and gyro bias"))
}

struct Weighted {
    p: DVector<f64>,
    covariance: DMatrix<f64>,
    loglik: f64,
}

/// Generalised least squares by the innovations of the walk; columns: y, bias, attitude of the stretch.
fn weighted(rows: &[Row], stretches: usize, noise: &[f64; 3], walk: f64) -> Option<Weighted> {
    type Seven = SMatrix<f64, 3, 7>;
    let n = 3 + 3 * stretches;
    let (mut gram, mut right) = (DMatrix::zeros(n, n), DVector::zeros(n));
    let (mut square, mut log_det) = (0.0, 0.0);
    let mut state = Seven::zeros();
    let mut p = Matrix3::zeros();
    let mut before: Option<&Row> = None;
    let own = Matrix3::from_diagonal(&Vector3::from_fn(|i, _| noise[i] * noise[i]));
    for row in rows {
        match before {
            Some(last) if last.stretch == row.stretch => {
                p += Matrix3::identity() * (walk * walk * (row.t_s - last.t_s));
            }
            _ => {
                state = Seven::zeros();
                p = Matrix3::zeros();
            }
        }
        before = Some(row);
        let mut z = Seven::zeros();
        z.set_column(0, &row.y);
        z.fixed_view_mut::<3, 3>(0, 1).copy_from(&row.b);
        z.fixed_view_mut::<3, 3>(0, 4)
            .copy_from(&Matrix3::identity());
        let turn = row.q.inverse().to_rotation_matrix();
        let r = turn.matrix() * own * turn.matrix().transpose();
        let s = p + r;
        let factor = s.cholesky()?;
        let innovation = z - state;
        let white = factor.l().solve_lower_triangular(&innovation)?;
        log_det += 2.0 * (0..3).map(|i| factor.l_dirty()[(i, i)].ln()).sum::<f64>();
        let gain = factor.solve(&p).transpose();
        state += gain * innovation;
        p -= gain * p;
        p = (p + p.transpose()) * 0.5;
        let at = 3 + 3 * row.stretch;
        let y = white.column(0);
        square += y.norm_squared();
        let index = |k: usize| if k < 3 { k } else { at + k - 3 };
        for i in 0..6 {
            right[index(i)] += white.column(i + 1).dot(&y);
            for j in 0..6 {
                gram[(index(i), index(j))] += white.column(i + 1).dot(&white.column(j + 1));
            }
        }
    }
    let factor = gram.cholesky()?;
    let solved = factor.solve(&right);
    let loglik = -0.5 * (log_det + square - solved.dot(&right));
    Some(Weighted {
        p: solved,
        covariance: factor.inverse(),
        loglik,
    })
}

/// The random walk, arcsec per root second, under which the frames are most likely.
fn likeliest(rows: &[Row], stretches: usize, noise: &[f64; 3]) -> f64 {
    let score = |ln: f64| {
        let walk = Angle::from_arcsec(ln.exp()).rad();
        weighted(rows, stretches, noise, walk).map_or(f64::NEG_INFINITY, |w| w.loglik)
    };
    // a grid of factors of two, then the golden section
    let (low, high) = (WALKS[0].ln(), WALKS[1].ln());
    let step = core::f64::consts::LN_2;
    let (mut best, mut at) = (f64::NEG_INFINITY, low);
    let mut ln = low;
    while ln <= high {
        let s = score(ln);
        if s > best {
            (best, at) = (s, ln);
        }
        ln += step;
    }
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut a, mut b) = (at - step, at + step);
    for _ in 0..20 {
        let (c, d) = (b - golden * (b - a), a + golden * (b - a));
        if score(c) > score(d) {
            b = d;
        } else {
            a = c;
        }
    }
    (0.5 * (a + b)).exp()
}
