//! Quaternions in another convention than that of the format: turning the wrong way round, or with the scalar first.
//!
//! ```text
//! stars      median angle between q u and the measured direction
//! attitude   median angle of q_measured q^-1
//! ```
//!
//! Not physics: a check of input.

use focal_plane::StarFrames;
use nalgebra::{Quaternion, UnitQuaternion};
use spectra::robust::{median, median_step};
use telemetry::{AttitudeTable, Bundle};

use super::{NEAR, SAMPLES, field, nearest};
use crate::error::CloseError;
use crate::situation::Situation;
use crate::star::directions::seen_at;

type Reading = fn(&UnitQuaternion<f64>) -> UnitQuaternion<f64>;

/// What the columns `qx, qy, qz, qw` may hold instead.
const OTHERS: [(Reading, &str); 3] = [
    (inverse, "the inverse rotations"),
    (scalar_first, "rotations whose scalar stands first"),
    (
        scalar_first_inverse,
        "inverse rotations whose scalar stands first",
    ),
];

fn as_given(q: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    *q
}

fn inverse(q: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    q.inverse()
}

fn scalar_first(q: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::new_normalize(Quaternion::new(q.i, q.j, q.k, q.w))
}

fn scalar_first_inverse(q: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    scalar_first(q).inverse()
}

/// The table that is held against the reference.
#[derive(Clone, Copy)]
enum Measured<'a> {
    Stars(&'a StarFrames),
    Attitude(&'a AttitudeTable),
}

impl<'a> Measured<'a> {
    fn of(bundle: &'a Bundle) -> Option<Self> {
        let stars = bundle.stars.as_ref().map(Self::Stars);
        stars.or_else(|| bundle.attitude.as_ref().map(Self::Attitude))
    }

    /// Its name, and the times of its frames.
    fn times(self) -> (&'static str, &'a [f64]) {
        match self {
            Self::Stars(stars) => ("stars", &stars.t_s),
            Self::Attitude(attitude) => ("attitude", &attitude.t_s),
        }
    }
}

/// Refuses a reference that does not overlap what was measured, or is in another convention.
pub(super) fn check(situation: &Situation<'_>) -> Result<(), CloseError> {
    let bundle = situation.bundle;
    let Some(reference) = &bundle.reference else {
        return Ok(());
    };
    let Some(measured) = Measured::of(bundle) else {
        return Ok(());
    };
    let (what, t_s) = measured.times();
    let ends = |t_s: &[f64]| Some([*t_s.first()?, *t_s.last()?]);
    let (Some(taken), Some(known)) = (ends(t_s), ends(&reference.t_s)) else {
        return Ok(());
    };
    if taken[1] < known[0] || known[1] < taken[0] {
        return Err(CloseError::NoOverlap {
            what,
            measured_s: taken,
            reference_s: known,
        });
    }
    let pairs = pairs(t_s, &reference.t_s);
    let apart = |read_reference: Reading, read_measured: Reading| {
        let mut angles = Vec::new();
        for &(k, at) in &pairs {
            let q = read_reference(&reference.q[at]);
            match measured {
                Measured::Stars(stars) => angles.extend(of_stars(situation, stars, k, &q)),
                Measured::Attitude(attitude) => {
                    angles.push(read_measured(&attitude.q[k]).angle_to(&q));
                }
            }
        }
        median(&mut angles)
    };
    let near = NEAR * field(situation);
    let Some(given) = apart(as_given, as_given).filter(|angle| *angle > near) else {
        return Ok(());
    };
    let attitudes = matches!(measured, Measured::Attitude(_));
    let others = OTHERS.iter().enumerate();
    let of_reference = others.clone().filter_map(|(k, (reading, are))| {
        // of two tables of attitudes of which one turns the other way round nothing tells which
        let table = if attitudes && k == 0 {
            "reference or attitude"
        } else {
            "reference"
        };
        Some((apart(*reading, as_given)?, (table, what, *are)))
    });
    let of_attitude = others.skip(1).filter(|_| attitudes);
    let of_attitude = of_attitude.filter_map(|(_, (reading, are))| {
        Some((apart(as_given, *reading)?, ("attitude", "reference", *are)))
    });
    match nearest(given, of_reference.chain(of_attitude)) {
        Some((angle, (table, what, are))) => Err(CloseError::Convention {
            table,
            what,
            given_deg: given.to_degrees(),
            are,
            angle_deg: angle.to_degrees(),
        }),
        None => Ok(()),
    }
}

/// Frames and the samples of the reference next to them, evenly over all.
fn pairs(t_s: &[f64], reference_t_s: &[f64]) -> Vec<(usize, usize)> {
    let step = median_step(reference_t_s).unwrap_or(f64::INFINITY);
    let stride = t_s.len().div_ceil(SAMPLES).max(1);
    let next = |&k: &usize| {
        let after = reference_t_s.partition_point(|t| *t < t_s[k]);
        let near = after.saturating_sub(1)..(after + 1).min(reference_t_s.len());
        let distance = |at: &usize| (reference_t_s[*at] - t_s[k]).abs();
        let at = near.min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        (distance(&at) <= step).then_some((k, at))
    };
    let frames: Vec<usize> = (0..t_s.len()).step_by(stride).collect();
    frames.iter().filter_map(next).collect()
}

/// Angles between where the stars of a frame are and where `q` turns those of the catalogue, rad.
fn of_stars(
    situation: &Situation<'_>,
    stars: &StarFrames,
    frame: usize,
    q: &UnitQuaternion<f64>,
) -> Vec<f64> {
    let angle = |row: usize| {
        let star = situation.star(stars.star_id[row])?;
        let seen = seen_at(&situation.camera, stars, row);
        Some((q * star.direction).angle(&seen))
    };
    stars.rows_of(frame).filter_map(angle).collect()
}
