//! A hot pixel seen through centroids alone.
//!
//! ```text
//! dP = strength (H - P)   while |H_x - P_x| <= half_width and |H_y - P_y| <= half_width
//! ```
//!
//! H is the middle of the pixel, P the star. A warm pixel under a window of half-width w adds its
//! charge to the first moment: the centroid moves toward it by the ratio of its charge to the total,
//! for as long as it is inside the window. With raw images `dark_map` says more.
//!
//! Source: first moment of a spot plus one pixel, to first order in the pixel's share.

use std::collections::BTreeMap;

use focal_plane::{Camera, Pixel};
use star_tracker::{Stages, StarView};

use crate::parameters::Reader;
use crate::shift::{Shift, ShiftCandidate, Shifted};
use crate::{
    ActsOn, Candidate, Coefficient, Effect, EffectError, EffectKind, Parameter, Parameters, Scene,
    Surroundings,
};

const ID: &str = "hot_pixel";
const HALF_WIDTH_PX: f64 = 1.5;

/// Pixels that the catalogue proposes: those under most rows.
const MOST_PIXELS: usize = 48;
/// Rows under which a pixel is worth proposing.
const LEAST_ROWS: usize = 10;

/// The kind.
#[derive(Debug)]
pub(crate) struct Kind;

impl EffectKind for Kind {
    fn id(&self) -> &'static str {
        ID
    }
    fn summary(&self) -> &'static str {
        "a warm pixel pulls the centroid of a star near it"
    }
    fn needs(&self) -> &'static str {
        "stars that dwell on a pixel, and no raw windows (with them it is dark_map)"
    }
    fn acts_on(&self) -> ActsOn {
        ActsOn {
            stars: true,
            ..ActsOn::default()
        }
    }
    fn build(
        &self,
        parameters: &Parameters,
        _: &Surroundings<'_>,
    ) -> Result<Box<dyn Effect>, EffectError> {
        let known = ["x_px", "y_px", "strength", "half_width_px"];
        let reader = Reader::new(ID, parameters, &known)?;
        let at = Pixel {
            x: reader.required("x_px")?,
            y: reader.required("y_px")?,
        };
        let strength = reader.required("strength")?;
        let half_width_px = reader.number_or("half_width_px", HALF_WIDTH_PX)?;
        if half_width_px <= 0.0 {
            return Err(EffectError::OutOfRange {
                effect: ID,
                name: "half_width_px".to_owned(),
                value: half_width_px,
                expected: "positive",
            });
        }
        Ok(Box::new(Shifted::new(
            HotPixel { at, half_width_px },
            vec![strength],
        )))
    }
    fn candidates(&self, scene: &Scene<'_>) -> Vec<Box<dyn Candidate>> {
        let Some(rows) = scene.rows.filter(|_| scene.has_stars) else {
            return Vec::new();
        };
        let camera = scene.surroundings.camera;
        let mut seen: BTreeMap<(i64, i64), usize> = BTreeMap::new();
        for i in 0..rows.len() {
            let [column, row] = pixel_of(camera, rows.landed(i));
            *seen.entry((column, row)).or_default() += 1;
        }
        // ties go to the lower coordinates: the list never depends on the order of a hash
        let mut pixels: Vec<_> = seen.into_iter().filter(|(_, n)| *n >= LEAST_ROWS).collect();
        pixels.sort_by_key(|&(pixel, rows)| (core::cmp::Reverse(rows), pixel));
        pixels.truncate(MOST_PIXELS);
        pixels
            .into_iter()
            .map(|((column, row), _)| hot_pixel_at(middle_of(camera, [column, row])))
            .collect()
    }
}

/// A hot pixel of unknown strength whose middle is `at`, half-width 1.5 px.
pub fn hot_pixel_at(at: Pixel) -> Box<dyn Candidate> {
    ShiftCandidate::boxed(HotPixel {
        at,
        half_width_px: HALF_WIDTH_PX,
    })
}

/// Number of the pixel in which a point lies.
fn pixel_of(camera: &Camera, at: Pixel) -> [i64; 2] {
    let edge = 0.5 - camera.pixel_centre();
    #[expect(clippy::cast_possible_truncation, reason = "pixel numbers are small")]
    [at.x, at.y].map(|p| (p + edge).floor() as i64)
}

/// Middle of a pixel.
fn middle_of(camera: &Camera, pixel: [i64; 2]) -> Pixel {
    let [x, y] = pixel.map(|p| p as f64 + camera.pixel_centre());
    Pixel { x, y }
}

#[derive(Clone, Debug)]
struct HotPixel {
    at: Pixel,
    half_width_px: f64,
}

impl Shift for HotPixel {
    fn id(&self) -> &'static str {
        ID
    }
    fn stages(&self) -> Stages {
        Stages {
            centroid: true,
            ..Stages::NONE
        }
    }
    fn coefficients(&self) -> Vec<Coefficient> {
        vec![Coefficient::new("strength", "", 0.03)]
    }
    fn reaches(&self, at: Pixel) -> bool {
        (self.at.x - at.x).abs() <= self.half_width_px
            && (self.at.y - at.y).abs() <= self.half_width_px
    }
    fn terms(&self, star: &StarView, out: &mut [[f64; 2]]) {
        out[0] = if self.reaches(star.at) {
            [self.at.x - star.at.x, self.at.y - star.at.y]
        } else {
            [0.0; 2]
        };
    }
    /// The direction of the pull: a star at rest has pixels on all sides.
    fn choices(&self) -> usize {
        1
    }
    fn parameters(&self, values: &[f64]) -> Vec<Parameter> {
        vec![
            Parameter::new("x_px", self.at.x, "px"),
            Parameter::new("y_px", self.at.y, "px"),
            Parameter::new("strength", values[0], ""),
            Parameter::new("half_width_px", self.half_width_px, "px"),
        ]
    }
}
