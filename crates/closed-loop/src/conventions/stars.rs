//! Stars that fit no attitude as they are read, and do in another way: mirrored pictures, right ascensions in hours,
//! angles in radians.
//!
//! ```text
//! median angle between q_k u and the measured direction, q_k the attitude that suits the frame k best
//! ```
//!
//! Not physics: a check of input.

use focal_plane::{Angle, StarFrames, ra_dec, unit_vector};
use nalgebra::Vector3;
use spectra::robust::median;

use super::{NEAR, SAMPLES, field, nearest};
use crate::error::CloseError;
use crate::situation::Situation;
use crate::star::directions::{attitudes, seen_at};

/// Two stars are one angle, which a mirror does not change.
const TELLING: usize = 3;
/// Degrees of an hour.
const HOUR_DEG: f64 = 15.0;

/// How tables may be read instead.
struct Reading {
    /// Table and columns, and what they seem to hold.
    columns: &'static str,
    are: &'static str,
    expected: &'static str,
    mirrored: bool,
    /// Right ascension and declination in what the format wants, of as they are given.
    angles: fn([f64; 2]) -> [f64; 2],
}

const OTHERS: [Reading; 3] = [
    Reading {
        columns: "table stars, columns x_px, y_px",
        are: "a mirrored picture (one axis the other way round, or both exchanged)",
        expected: "pixels of the camera's own right-handed axes, x, y and the boresight z",
        mirrored: true,
        angles: |given| given,
    },
    Reading {
        columns: "table catalog, column ra_deg",
        are: "hours",
        expected: "degrees",
        mirrored: false,
        angles: |[ra, dec]| [HOUR_DEG * ra, dec],
    },
    Reading {
        columns: "table catalog, columns ra_deg, dec_deg",
        are: "radians",
        expected: "degrees",
        mirrored: false,
        angles: |given| given.map(f64::to_degrees),
    },
];

/// Frames that tell.
struct Sample {
    /// Rows of the stars that the catalogue has.
    frames: StarFrames,
    /// Right ascension and declination of each row, as they are given, deg.
    angles_deg: Vec<[f64; 2]>,
}

impl Sample {
    fn of(situation: &Situation<'_>, stars: &StarFrames) -> Self {
        let mut frames = StarFrames::new();
        let mut angles_deg = Vec::new();
        let telling = |k: &usize| stars.rows_of(*k).len() >= TELLING;
        let all: Vec<usize> = (0..stars.frames()).filter(telling).collect();
        for &k in all.iter().step_by(all.len().div_ceil(SAMPLES).max(1)) {
            frames.begin(stars.t_s[k]);
            for row in stars.rows_of(k) {
                let id = stars.star_id[row];
                let Some(star) = situation.star(id) else {
                    continue;
                };
                let (ra, dec) = ra_dec(&star.direction);
                angles_deg.push([ra.deg(), dec.deg()]);
                frames.push(stars.slot[row], id, stars.x_px[row], stars.y_px[row]);
            }
        }
        Self { frames, angles_deg }
    }

    /// Median angle to the stars, read like this, rad; `None` where they cannot be.
    fn apart(
        &self,
        situation: &Situation<'_>,
        mirrored: bool,
        read: fn([f64; 2]) -> [f64; 2],
    ) -> Option<f64> {
        let mut frames = self.frames.clone();
        if mirrored {
            frames.x_px.iter_mut().for_each(|x| *x = -*x);
        }
        let directions = self.angles_deg.iter().map(|&given| direction(read(given)));
        let directions: Vec<_> = directions.collect();
        if directions.iter().any(Option::is_none) {
            return None;
        }
        let row: Vec<usize> = (0..frames.rows()).collect();
        let attitudes = attitudes(&situation.camera, &frames, &row, &directions);
        let mut angles = Vec::new();
        for (k, q) in attitudes.iter().enumerate() {
            let Some(q) = q else { continue };
            for row in frames.rows_of(k) {
                let seen = seen_at(&situation.camera, &frames, row);
                angles.extend(directions[row].map(|u| (q * u).angle(&seen)));
            }
        }
        median(&mut angles)
    }
}

fn direction([ra, dec]: [f64; 2]) -> Option<Vector3<f64>> {
    if !(0.0..=360.0).contains(&ra) || dec.abs() > 90.0 {
        return None;
    }
    Some(unit_vector(Angle::from_deg(ra), Angle::from_deg(dec)))
}

/// Refuses stars that fit the catalogue in another convention alone.
pub(super) fn check(situation: &Situation<'_>) -> Result<(), CloseError> {
    let (Some(stars), Some(_)) = (&situation.bundle.stars, &situation.bundle.catalog) else {
        return Ok(());
    };
    let sample = Sample::of(situation, stars);
    let near = NEAR * field(situation);
    let given = sample.apart(situation, false, |given| given);
    let Some(given) = given.filter(|angle| *angle > near) else {
        return Ok(());
    };
    let others = OTHERS.iter().filter_map(|other| {
        let angle = sample.apart(situation, other.mirrored, other.angles)?;
        Some((angle, other))
    });
    match nearest(given, others) {
        Some((angle, other)) => Err(CloseError::StarConvention {
            columns: other.columns,
            are: other.are,
            expected: other.expected,
            given_deg: given.to_degrees(),
            angle_deg: angle.to_degrees(),
        }),
        None => Ok(()),
    }
}
