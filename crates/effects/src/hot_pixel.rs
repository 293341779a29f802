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

use focal_plane::{Camera, Pixel};
use star_tracker::{Stages, StarView};

use crate::parameters::Reader;
use crate::shift::{Shift, ShiftCandidate, Shifted};
use crate::{
    ActsOn, Candidate, Coefficient, Effect, EffectError, EffectKind, Parameter, Parameters, Scene,
    Surroundings,
};

const ID: &str = "hot_pixel";
pub(crate) const HALF_WIDTH_PX: f64 = 1.5;
/// Credit of a pixel that no star was in: there are more of them, and all else pays for them.
const BESIDE: f64 = 0.1;

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
            HotPixel {
                at,
                half_width_px,
                passed: true,
                beside: false,
                stands_for: 1.0,
            },
            vec![strength],
        )))
    }
    fn candidates(&self, scene: &Scene<'_>) -> Vec<Box<dyn Candidate>> {
        let Some(warm) = scene.warm.filter(|_| scene.has_stars) else {
            return Vec::new();
        };
        let proposed = warm.proposed.iter();
        proposed
            .map(|pixel| {
                ShiftCandidate::boxed(HotPixel {
                    at: pixel.middle,
                    half_width_px: HALF_WIDTH_PX,
                    passed: pixel.passed,
                    beside: pixel.beside,
                    stands_for: warm.stand_for[usize::from(pixel.beside)],
                })
            })
            .collect()
    }
}

/// A hot pixel of unknown strength whose middle is `at`, half-width 1.5 px.
pub fn hot_pixel_at(at: Pixel) -> Box<dyn Candidate> {
    ShiftCandidate::boxed(HotPixel {
        at,
        half_width_px: HALF_WIDTH_PX,
        passed: true,
        beside: false,
        stands_for: 1.0,
    })
}

/// Number of the pixel in which a point lies.
pub(crate) fn pixel_of(camera: &Camera, at: Pixel) -> [i64; 2] {
    let edge = 0.5 - camera.pixel_centre();
    #[expect(clippy::cast_possible_truncation, reason = "pixel numbers are small")]
    [at.x, at.y].map(|p| (p + edge).floor() as i64)
}

/// Middle of a pixel.
pub(crate) fn middle_of(camera: &Camera, pixel: [i64; 2]) -> Pixel {
    let [x, y] = pixel.map(|p| p as f64 + camera.pixel_centre());
    Pixel { x, y }
}

#[derive(Clone, Debug)]
struct HotPixel {
    at: Pixel,
    half_width_px: f64,
    /// Whether stars pass by.
    passed: bool,
    /// Whether no star was in it.
    beside: bool,
    /// How many that were looked at it is proposed for.
    stands_for: f64,
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
        // charge of its own pulls, it does not push
        vec![Coefficient::new("strength", "", 0.03).at_least(0.0)]
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
    fn stands_for(&self) -> f64 {
        self.stands_for
    }
    fn credit(&self) -> f64 {
        if self.beside { BESIDE } else { 1.0 }
    }
    fn reach_px(&self) -> Option<([f64; 2], f64)> {
        self.passed
            .then_some(([self.at.x, self.at.y], self.half_width_px))
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
