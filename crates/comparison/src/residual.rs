//! The residual of a bundle at attitude level.
//!
//! ```text
//! theta = log(q_measured q_reference^-1)          arcsec, tracker axes
//! outlier: |theta - median| > 8 * 1.4826 MAD      per axis
//! ```
//!
//! `q_measured` is the tracker's own attitude; in a bundle without it, QUEST solves the centroids. Then
//! the stars' directions are those of the catalogue at the bundle's epoch, or without a catalogue
//! their means in the frame of the reference, which leave a common misalignment out of sight.
//!
//! Source: \[M23\] section 4 (residuals by differencing quaternions), Eq. 12.

use std::collections::BTreeMap;

use focal_plane::{
    ARCSEC_PER_RAD, AttitudeResidual, AttitudeSeries, AttitudeSource, Camera, Pixel, StarFrames,
    Vectors,
};
use nalgebra::{UnitQuaternion, Vector3};
use spectra::standing_out;
use star_tracker::solve_frames;
use telemetry::Bundle;

use crate::ComparisonError;

/// Names of the tracker's axes.
pub const AXES: [&str; 3] = ["x", "y", "z"];

/// Frames that a spectrum and a fit need at least.
pub(crate) const NEED: usize = 16;

/// Where the measured attitude came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeasuredBy {
    /// Table `attitude`.
    Attitude,
    /// QUEST on table `stars`.
    Stars,
}

/// Attitude residual per axis, rows in the order of time.
#[derive(Clone, Debug, PartialEq)]
pub struct Residual {
    /// Times, s.
    pub t_s: Vec<f64>,
    /// Residual about x, y, z, arcsec.
    pub arcsec: [Vec<f64>; 3],
    /// Rows beyond 8 robust sigma of their axis, but where something happened ([`spectra::standing_out`]).
    pub outlier: [Vec<bool>; 3],
    /// Attitudes that the reference does not cover.
    pub outside_reference: usize,
    /// Frames whose stars do not fix an attitude.
    pub unsolved: usize,
    /// Where the attitude came from.
    pub measured_by: MeasuredBy,
}

impl Residual {
    /// The residual of a bundle.
    ///
    /// # Errors
    ///
    /// No reference, neither attitude nor stars with a camera, a star without direction, or fewer
    /// than 16 frames.
    pub fn of(bundle: &Bundle) -> Result<Self, ComparisonError> {
        let reference = Self::reference(bundle)?;
        let (t_s, q, unsolved, measured_by) = match (&bundle.attitude, &bundle.stars) {
            (Some(table), _) => (table.t_s.clone(), table.q.clone(), 0, MeasuredBy::Attitude),
            (None, Some(stars)) => {
                let (t_s, q, unsolved) = solved(bundle, stars, &reference)?;
                (t_s, q, unsolved, MeasuredBy::Stars)
            }
            (None, None) => {
                return Err(ComparisonError::NothingToCompare(
                    "the bundle has neither an attitude nor stars",
                ));
            }
        };
        let residual = AttitudeResidual::against(&t_s, &q, &reference);
        let arcsec = residual
            .theta_rad
            .map(|axis| axis.iter().map(|theta| theta * ARCSEC_PER_RAD).collect());
        let mut out = Self {
            outlier: std::array::from_fn(|_| vec![false; residual.t_s.len()]),
            t_s: residual.t_s,
            arcsec,
            outside_reference: residual.outside_reference,
            unsolved,
            measured_by,
        };
        if out.t_s.len() < NEED {
            return Err(ComparisonError::TooFewFrames {
                frames: out.t_s.len(),
                need: NEED,
                outside_reference: out.outside_reference,
                unsolved,
            });
        }
        out.mark_outliers();
        Ok(out)
    }

    /// The better estimate, its gaps left open.
    pub(crate) fn reference(bundle: &Bundle) -> Result<AttitudeSeries, ComparisonError> {
        let table = bundle.reference.as_ref().ok_or(ComparisonError::NothingToCompare(
            "the bundle has no table `reference`: a residual needs a better estimate to be held against",
        ))?;
        Ok(table.series_with_gaps()?)
    }

    /// Marks until nothing new turns up: a mask changes the scale that it is judged by. Where that goes
    /// on throughout, something [`happened`](standing_out::happened) throughout, and no row is marked.
    fn mark_outliers(&mut self) {
        for (values, outlier) in self.arcsec.iter().zip(&mut self.outlier) {
            while standing_out::mark(values, outlier) > 0 {}
        }
    }

    /// The residual about one axis, outliers NaN.
    #[must_use]
    pub fn kept(&self, axis: usize) -> Vec<f64> {
        masked(&self.arcsec[axis], &self.outlier[axis])
    }

    /// Number of outliers about one axis.
    #[must_use]
    pub fn outliers(&self, axis: usize) -> usize {
        self.outlier[axis].iter().filter(|out| **out).count()
    }

    /// Rows that are an outlier about any axis.
    #[must_use]
    pub fn rows_with_outlier(&self) -> usize {
        (0..self.t_s.len()).filter(|&k| self.is_outlier(k)).count()
    }

    /// Whether a row is one about any axis.
    pub(crate) fn is_outlier(&self, row: usize) -> bool {
        self.outlier.iter().any(|axis| axis[row])
    }

    /// Standard deviation about one axis, arcsec: the mean is a misalignment, and no noise.
    #[must_use]
    pub fn std_arcsec(&self, axis: usize) -> f64 {
        std_of(&self.kept(axis))
    }
}

/// `values` with NaN where `out`.
pub(crate) fn masked(values: &[f64], out: &[bool]) -> Vec<f64> {
    let pairs = values.iter().zip(out);
    pairs
        .map(|(v, out)| if *out { f64::NAN } else { *v })
        .collect()
}

/// Standard deviation of the finite values about their mean.
pub(crate) fn std_of(values: &[f64]) -> f64 {
    let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    let count = finite.len() as f64;
    let mean = finite.iter().sum::<f64>() / count;
    (finite.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count).sqrt()
}

type Solved = (Vec<f64>, Vec<UnitQuaternion<f64>>, usize);

/// Attitudes of the frames that have one, and how many have none.
fn solved(
    bundle: &Bundle,
    stars: &StarFrames,
    reference: &AttitudeSeries,
) -> Result<Solved, ComparisonError> {
    let camera = bundle.camera.as_ref().ok_or(ComparisonError::NothingToCompare(
        "the bundle has stars but no attitude, and its [tracker] does not give pixels and focal length to solve one",
    ))?;
    let [x, y, z] = directions(bundle, stars, camera, reference)?;
    let directions = Vectors {
        x: &x,
        y: &y,
        z: &z,
    };
    let q = solve_frames(camera, stars, directions);
    let unsolved = q.iter().filter(|q| q.is_none()).count();
    let pairs = stars.t_s.iter().zip(&q);
    let (t_s, q) = pairs.filter_map(|(t, q)| Some((*t, (*q)?))).unzip();
    Ok((t_s, q, unsolved))
}

/// Inertial direction of the star of each row: of the catalogue, or the mean in the reference's frame.
pub(crate) fn directions(
    bundle: &Bundle,
    stars: &StarFrames,
    camera: &Camera,
    reference: &AttitudeSeries,
) -> Result<[Vec<f64>; 3], ComparisonError> {
    let mut known: BTreeMap<i64, Vector3<f64>> = BTreeMap::new();
    match &bundle.catalog {
        Some(catalogue) => {
            let middle = 0.5 * (stars.t_s[0] + stars.t_s[stars.frames() - 1]);
            let year = bundle.meta.julian_year(middle).unwrap_or(2000.0);
            for &id in &stars.star_id {
                if let std::collections::btree_map::Entry::Vacant(free) = known.entry(id) {
                    let index = catalogue
                        .index_of(id)
                        .ok_or(ComparisonError::UnknownStar { id })?;
                    free.insert(catalogue.direction_at(index, year));
                }
            }
        }
        None => {
            for (k, &t) in stars.t_s.iter().enumerate() {
                let Some(q) = reference.attitude(t) else {
                    continue;
                };
                for row in stars.rows_of(k) {
                    let at = Pixel {
                        x: stars.x_px[row],
                        y: stars.y_px[row],
                    };
                    *known.entry(stars.star_id[row]).or_default() +=
                        q.inverse() * camera.direction(at);
                }
            }
            for sum in known.values_mut() {
                *sum = sum.normalize();
            }
        }
    }
    let nowhere = Vector3::repeat(f64::NAN);
    Ok(std::array::from_fn(|axis| {
        let of = |id: &i64| known.get(id).unwrap_or(&nowhere)[axis];
        stars.star_id.iter().map(of).collect()
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A quarter of the run is off by forty times the rest, as under a slew with a wrong time tag: measured, and to be
    /// compared. One sample alone is a spike.
    #[test]
    fn what_lasts_is_measured() {
        let axis: Vec<f64> = (0..600)
            .map(|k| match k {
                150..300 => 40.0,
                500 => 90.0,
                _ => f64::from(k % 7) - 3.0,
            })
            .collect();
        let mut residual = Residual {
            t_s: (0..600).map(f64::from).collect(),
            outlier: std::array::from_fn(|_| vec![false; 600]),
            arcsec: std::array::from_fn(|_| axis.clone()),
            outside_reference: 0,
            unsolved: 0,
            measured_by: MeasuredBy::Attitude,
        };
        residual.mark_outliers();
        assert_eq!(residual.outliers(0), 1);
        assert!(residual.outlier[2][500]);
    }
}
