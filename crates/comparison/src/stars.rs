//! The stars of every frame that a model is flown along.
//!
//! ```text
//! telemetry    those of the nearest frame of table `stars`, where they are by their directions
//! catalogue    the brightest of table `catalog` in the field, kept while they are in it
//! generated    made up, with the replacement rule of [M23] Step 1
//! ```
//!
//! Source: \[M23\] Section 4.1 (the stars of telemetry) and Section 2.6, Step 1.

use std::collections::BTreeMap;
use std::ops::Range;

use focal_plane::{AttitudeSeries, AttitudeSource, Camera, StarFrames, Vectors};
use star_tracker::{CatalogueTracking, FieldStar, Purpose, Rows, StarField, stream};
use telemetry::Bundle;
use telemetry::report::StarSource;

use crate::ComparisonError;
use crate::residual::directions;

/// Stars that are followed where the model does not say: \[M23\] Table 1.
const STARS: u32 = 15;
/// Catalogue stars nearer to the edge are not followed, px.
const MARGIN_PX: f64 = 4.0;

/// Rows of all frames.
#[derive(Clone, Debug)]
pub(crate) struct Stars {
    pub(crate) source: StarSource,
    first_row: Vec<usize>,
    slot: Vec<i32>,
    star_id: Vec<i64>,
    mag: Vec<f64>,
    bv: Vec<f64>,
    direction: [Vec<f64>; 3],
}

impl Stars {
    fn new(source: StarSource) -> Self {
        Self {
            source,
            first_row: vec![0],
            slot: vec![],
            star_id: vec![],
            mag: vec![],
            bv: vec![],
            direction: [vec![], vec![], vec![]],
        }
    }

    fn push(&mut self, slot: i32, star: &FieldStar) {
        self.slot.push(slot);
        self.star_id.push(star.id);
        self.mag.push(star.mag);
        self.bv.push(star.bv);
        for axis in 0..3 {
            self.direction[axis].push(star.direction[axis]);
        }
    }

    fn end_frame(&mut self) {
        self.first_row.push(self.slot.len());
    }

    /// The stars of the frames at `t_s`.
    ///
    /// # Errors
    ///
    /// A star without direction, or a tracker of fewer than two.
    pub(crate) fn of(
        bundle: &Bundle,
        camera: &Camera,
        truth: &AttitudeSeries,
        t_s: &[f64],
        max_stars: Option<u32>,
        seed: u64,
    ) -> Result<Self, ComparisonError> {
        let count = max_stars.unwrap_or(STARS) as usize;
        let middle_s = 0.5 * (t_s[0] + t_s[t_s.len() - 1]);
        let year = bundle.meta.julian_year(middle_s).unwrap_or(2000.0);
        if let Some(stars) = &bundle.stars {
            return Self::measured(bundle, stars, camera, truth, t_s);
        }
        if let Some(catalogue) = &bundle.catalog {
            let mut tracking =
                CatalogueTracking::new(catalogue, year, count, f64::INFINITY, MARGIN_PX);
            let mut out = Self::new(StarSource::Catalogue);
            for &t in t_s {
                if let Some(q) = truth.attitude(t) {
                    tracking.update(camera, &q);
                    for (slot, star) in tracking.stars() {
                        out.push(slot, &star);
                    }
                }
                out.end_frame();
            }
            return Ok(out);
        }
        let mut rng = stream(seed, 0, Purpose::StarField);
        let mut field: Option<StarField> = None;
        let mut out = Self::new(StarSource::Generated);
        for &t in t_s {
            if let Some(q) = truth.attitude(t) {
                let field = match &mut field {
                    Some(field) => {
                        field.update(camera, &q, &mut rng);
                        field
                    }
                    none => none.insert(StarField::generate(camera, &q, count, &mut rng)?),
                };
                for (slot, star) in (0_i32..).zip(field.stars()) {
                    out.push(slot, star);
                }
            }
            out.end_frame();
        }
        Ok(out)
    }

    fn measured(
        bundle: &Bundle,
        stars: &StarFrames,
        camera: &Camera,
        truth: &AttitudeSeries,
        t_s: &[f64],
    ) -> Result<Self, ComparisonError> {
        let [x, y, z] = directions(bundle, stars, camera, truth)?;
        let facts: BTreeMap<i64, (f64, f64)> = bundle
            .catalog
            .iter()
            .flat_map(|c| c.stars().iter().map(|star| (star.id, (star.mag, star.bv))))
            .collect();
        let mut steps: Vec<f64> = stars.t_s.windows(2).map(|w| w[1] - w[0]).collect();
        let reach_s = 0.5 * spectra::robust::median(&mut steps).unwrap_or(0.0);
        let mut out = Self::new(StarSource::Telemetry);
        let mut k = 0;
        for &t in t_s {
            while k + 1 < stars.frames() && (stars.t_s[k + 1] - t).abs() <= (stars.t_s[k] - t).abs()
            {
                k += 1;
            }
            if (stars.t_s[k] - t).abs() <= reach_s {
                for row in stars.rows_of(k).filter(|row| x[*row].is_finite()) {
                    let id = stars.star_id[row];
                    let seen = stars.mag.as_ref().map_or(f64::NAN, |mag| mag[row]);
                    let (mag, bv) = facts.get(&id).copied().unwrap_or((seen, f64::NAN));
                    let star = FieldStar {
                        id,
                        direction: [x[row], y[row], z[row]].into(),
                        mag,
                        bv,
                    };
                    out.push(stars.slot[row], &star);
                }
            }
            out.end_frame();
        }
        Ok(out)
    }

    /// Rows of some frames: `first_row` is the caller's, and is filled.
    pub(crate) fn rows<'a>(
        &'a self,
        t_s: &'a [f64],
        frames: Range<usize>,
        first_row: &'a mut Vec<usize>,
    ) -> Rows<'a> {
        let from = self.first_row[frames.start];
        let of = from..self.first_row[frames.end];
        first_row.clear();
        first_row.extend(
            self.first_row[frames.start..=frames.end]
                .iter()
                .map(|row| row - from),
        );
        Rows {
            t_s: &t_s[frames],
            first_row,
            slot: &self.slot[of.clone()],
            star_id: &self.star_id[of.clone()],
            mag: &self.mag[of.clone()],
            bv: &self.bv[of.clone()],
            direction: Vectors {
                x: &self.direction[0][of.clone()],
                y: &self.direction[1][of.clone()],
                z: &self.direction[2][of],
            },
        }
    }
}
