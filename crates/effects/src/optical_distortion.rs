//! Optical distortion outside the declared prior: scale, aspect, radial, decentring, tilt, off-centre.
//!
//! ```text
//! x, y    tangent-plane position minus the centre (cx_px, cy_px),   r^2 = x^2 + y^2
//! dx = x (k0 + k1 r^2 + k2 r^4) + 2 p1 x y + p2 (r^2 + 2 x^2) + b1 x + b2 y + x (t1 x + t2 y)
//! dy = y (k0 + k1 r^2 + k2 r^4) + p1 (r^2 + 2 y^2) + 2 p2 x y               + y (t1 x + t2 y)     times f: px
//! ```
//!
//! The coefficients have no unit (focal length 1). k0 is what the declared focal length is short by, as
//! a share of itself: a lens whose focal length is a little off is never fitted well by k1 and k2. b1 and b2
//! are pixels that are not square, and axes that are not at right angles; air that lifts stars the more the lower
//! they stand does the same to a camera that stands still. t1 and t2 are a detector that is tilted: all but a
//! rotation of the camera, it is also a boresight that is -f t1 and -f t2 px off the middle. As regressors, all enter about the boresight; to first order a displaced centre of a radial term is
//! itself a decentring one, so cx, cy are not fitted. Short star tracks do not tell r^2 from r^4: the
//! candidates are nested sets of terms, and the data decides how many it supports.
//!
//! Source: Brown, "Decentering distortion of lenses", Photogrammetric Engineering 32 (1966) 444; Fraser, "Digital
//! camera self-calibration", ISPRS Journal of Photogrammetry 52 (1997) 149 (b1, b2); a plane seen through a pinhole
//! at an angle, to first order (t1, t2).

use focal_plane::{Camera, Pixel};
use star_tracker::StarView;

use crate::parameters::Reader;
use crate::shift::{Shift, ShiftCandidate, Shifted};
use crate::{
    ActsOn, Candidate, Coefficient, Effect, EffectError, EffectKind, Parameter, Parameters, Scene,
    Surroundings,
};

const ID: &str = "optical_distortion";
const TERMS: [&str; 9] = ["k0", "k1", "k2", "p1", "p2", "b1", "b2", "t1", "t2"];

/// Sets of terms that are tried, as indices into [`TERMS`].
const SETS: [&[usize]; 10] = [
    &[0],
    &[1],
    &[0, 1],
    &[3, 4],
    &[1, 3, 4],
    &[1, 2],
    &[0, 1, 2],
    &[0, 1, 2, 3, 4],
    &[5, 6],
    &[7, 8],
];
/// The same of a camera whose attitude comes of its own stars: it need not have been calibrated, and may stand under air.
const SETS_OF_ITS_OWN: [&[usize]; 3] = [&[0, 5, 6], &[0, 1, 7, 8], &[0, 1, 2, 3, 4, 5, 6, 7, 8]];

/// Shift at the edge of the field that would not surprise, as a share of the distance from the
/// boresight: a tenth of what an uncalibrated photographic lens of a narrow field has. Wide fields are bent by more,
/// as far as tan^2/3 where the image is in proportion to the angle (k1 = -1/3): a thirteenth of that.
const PLAUSIBLE_SHARE: f64 = 2e-3;
const PLAUSIBLE_OF_WIDE: f64 = 0.025;
/// The same of a calibrated camera with a narrow field, arcsec.
const PLAUSIBLE_ARCSEC: f64 = 10.0;

/// The kind.
#[derive(Debug)]
pub(crate) struct Kind;

impl EffectKind for Kind {
    fn id(&self) -> &'static str {
        ID
    }
    fn summary(&self) -> &'static str {
        "scale, aspect, radial, decentring and tilt distortion outside the declared prior"
    }
    fn needs(&self) -> &'static str {
        "stars"
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
        surroundings: &Surroundings<'_>,
    ) -> Result<Box<dyn Effect>, EffectError> {
        let known = [&TERMS[..], &["cx_px", "cy_px"]].concat();
        let reader = Reader::new(ID, parameters, &known)?;
        // Terms not given are not there, and are not reported as zeros.
        let terms: Vec<usize> = (0..TERMS.len()).filter(|&k| reader.has(TERMS[k])).collect();
        let values = terms
            .iter()
            .map(|&k| reader.required(TERMS[k]))
            .collect::<Result<Vec<f64>, _>>()?;
        let centre = Pixel {
            x: reader.number_or("cx_px", 0.0)?,
            y: reader.number_or("cy_px", 0.0)?,
        };
        let brown = Brown {
            camera: surroundings.camera.clone(),
            centre,
            terms,
            stands_for: 1.0,
        };
        Ok(Box::new(Shifted::new(brown, values)))
    }
    fn candidates(&self, scene: &Scene<'_>) -> Vec<Box<dyn Candidate>> {
        if !scene.has_stars {
            return Vec::new();
        }
        let own: &[&[usize]] = if scene.has_reference {
            &[]
        } else {
            &SETS_OF_ITS_OWN
        };
        // sets share their terms: there is as much to be found by chance as there are of these
        let stands_for = TERMS.len() as f64 / (SETS.len() + own.len()) as f64;
        SETS.iter()
            .chain(own)
            .map(|terms| {
                ShiftCandidate::boxed(Brown {
                    camera: scene.surroundings.camera.clone(),
                    centre: Pixel::default(),
                    terms: terms.to_vec(),
                    stands_for,
                })
            })
            .collect()
    }
}

#[derive(Clone, Debug)]
struct Brown {
    camera: Camera,
    centre: Pixel,
    /// Which of [`TERMS`] it has.
    terms: Vec<usize>,
    /// Of how many that are looked at it is one.
    stands_for: f64,
}

impl Shift for Brown {
    fn id(&self) -> &'static str {
        ID
    }
    fn coefficients(&self) -> Vec<Coefficient> {
        let edge = self.camera.half_size_px()[0] / self.camera.focal_length_px()[0];
        let size = f64::max(
            PLAUSIBLE_SHARE.max(PLAUSIBLE_OF_WIDE * edge * edge) * edge,
            PLAUSIBLE_ARCSEC / focal_plane::ARCSEC_PER_RAD,
        );
        let plausible = [
            size / edge,
            size / edge.powi(3),
            size / edge.powi(5),
            size / edge.powi(2),
            size / edge.powi(2),
            size / edge,
            size / edge,
            size / edge.powi(2),
            size / edge.powi(2),
        ];
        self.terms
            .iter()
            .map(|&k| Coefficient::new(TERMS[k], "", plausible[k]))
            .collect()
    }
    fn stands_for(&self) -> f64 {
        self.stands_for
    }
    fn terms(&self, star: &StarView, out: &mut [[f64; 2]]) {
        let off = Pixel {
            x: star.at.x - self.centre.x,
            y: star.at.y - self.centre.y,
        };
        let t = self.camera.tangent(off);
        let (x, y) = (t.x, t.y);
        let r2 = x * x + y * y;
        let [fx, fy] = self.camera.focal_length_px();
        let all = [
            [fx * x, fy * y],
            [fx * x * r2, fy * y * r2],
            [fx * x * r2 * r2, fy * y * r2 * r2],
            [fx * 2.0 * x * y, fy * (r2 + 2.0 * y * y)],
            [fx * (r2 + 2.0 * x * x), fy * 2.0 * x * y],
            [fx * x, 0.0],
            [fx * y, 0.0],
            [fx * x * x, fy * x * y],
            [fx * x * y, fy * y * y],
        ];
        for (out, &k) in out.iter_mut().zip(&self.terms) {
            *out = all[k];
        }
    }
    fn parameters(&self, values: &[f64]) -> Vec<Parameter> {
        let mut all: Vec<Parameter> = self
            .terms
            .iter()
            .zip(values)
            .map(|(&k, &v)| Parameter::new(TERMS[k], v, ""))
            .collect();
        // a centre at the boresight is what is meant without one
        for (name, at) in [("cx_px", self.centre.x), ("cy_px", self.centre.y)] {
            if at.abs() > 0.0 {
                all.push(Parameter::new(name, at, "px"));
            }
        }
        all
    }
}
