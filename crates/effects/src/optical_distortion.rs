//! Optical distortion outside the declared prior: scale, aspect, radial, decentring, tilt, off-centre.
//!
//! The map and its terms stand in [`crate::lens`]. The coefficients have no unit (focal length 1). k0 is what the
//! declared focal length is short by, as a share of itself: a lens whose focal length is a little off is never fitted
//! well by k1 and k2. b1 and b2 are pixels that are not square, and axes that are not at right angles; air that lifts
//! stars the more the lower they stand does the same to a camera that stands still. t1 and t2 are a detector that is
//! tilted: all but a rotation of the camera, it is also a boresight that is -f t1 and -f t2 px off the middle.
//!
//! As regressors, terms enter to first order about the boresight, and where that misses a thousandth of a pixel they
//! are made linear about what was found: pixels see what the lens has bent. To first order a displaced centre of a
//! radial term is itself a decentring one. So the centre is looked for by the widest set alone, where an uncalibrated
//! lens has an r^6. Short star tracks do not tell r^2 from r^4: the candidates are nested sets of terms, and the data
//! decides how many it supports.
//!
//! Source: linearity about zero or about what was found; the terms' sources are those of [`crate::lens`].

use focal_plane::{Camera, Pixel};
use star_tracker::StarView;

use crate::candidate::DIFFERENCE;
use crate::lens::{Bend, TERMS};
use crate::parameters::Reader;
use crate::shift::{Shift, ShiftCandidate, Shifted, linear_px};
use crate::{
    ActsOn, Candidate, Coefficient, Effect, EffectError, EffectKind, Nonlinear, Parameter,
    Parameters, Scene, Surroundings,
};

const ID: &str = "optical_distortion";

/// Sets of terms that are tried, as indices into [`TERMS`].
const SETS: [&[usize]; 10] = [
    &[0],
    &[1],
    &[0, 1],
    &[4, 5],
    &[1, 4, 5],
    &[1, 2],
    &[0, 1, 2],
    &[0, 1, 2, 4, 5],
    &[6, 7],
    &[8, 9],
];
/// The same of a camera whose attitude comes of its own stars: it need not have been calibrated, and may stand under air.
const SETS_OF_ITS_OWN: [&[usize]; 4] = [
    &[0, 6, 7],
    &[0, 1, 8, 9],
    &[0, 1, 2, 4, 5, 6, 7, 8, 9],
    &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9],
];

/// What the columns may miss in the corners of the detector, px.
const LINEAR_PX: f64 = 1e-3;
/// What r^6 bends the edge of the field by, px, from which it is looked for, and the centre of the lens with it, where the
/// image is in proportion to the angle: k3 = -1/7. In narrow fields such a lens has nothing to bend but each star by itself.
const WIDE_PX: f64 = 0.1;
/// How far from the boresight a centre is looked for, as a share of half the detector.
const FARTHEST: f64 = 0.2;

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
        if terms.is_empty() {
            return Err(EffectError::MissingParameter {
                effect: ID,
                name: "a term of the lens: k0 to k3, p1, p2, b1, b2, t1 or t2",
            });
        }
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
            about: [0.0; TERMS.len()],
            off_centre: false,
            stands_for: 1.0,
        };
        Ok(Box::new(Shifted::new(brown, values)))
    }
    fn candidates(&self, scene: &Scene<'_>) -> Vec<Box<dyn Candidate>> {
        if !scene.has_stars {
            return Vec::new();
        }
        let [half, _] = scene.surroundings.camera.half_size_px();
        let edge = half / scene.surroundings.camera.focal_length_px()[0];
        let own: &[&[usize]] = match scene.has_reference {
            true => &[],
            false if half * edge.powi(6) / 7.0 > WIDE_PX => &SETS_OF_ITS_OWN,
            false => &SETS_OF_ITS_OWN[..SETS_OF_ITS_OWN.len() - 1],
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
                    about: [0.0; TERMS.len()],
                    off_centre: terms.len() == TERMS.len(),
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
    /// Values of [`TERMS`] at which the map is made linear.
    about: [f64; TERMS.len()],
    /// Whether the centre is looked for.
    off_centre: bool,
    /// Of how many that are looked at it is one.
    stands_for: f64,
}

impl Brown {
    fn bend(&self, at: Pixel, values: &[f64; TERMS.len()]) -> Bend {
        let (at, centre) = (self.camera.tangent(at), self.camera.tangent(self.centre));
        Bend::at(values, [centre.x, centre.y], [at.x, at.y])
    }

    fn all(&self, values: &[f64]) -> [f64; TERMS.len()] {
        let mut all = [0.0; TERMS.len()];
        for (&k, &value) in self.terms.iter().zip(values) {
            all[k] = value;
        }
        all
    }
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
            size / edge.powi(7),
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
    fn nonlinear(&self) -> Vec<Nonlinear> {
        if !self.off_centre {
            return Vec::new();
        }
        let half = self.camera.half_size_px();
        let axis = |name, value: f64, half: f64| {
            let step = FARTHEST * half / 4.0;
            Nonlinear {
                name,
                unit: "px",
                value,
                range: [-FARTHEST * half, FARTHEST * half],
                step,
                difference: Some(DIFFERENCE * step),
            }
        };
        vec![
            axis("cx_px", self.centre.x, half[0]),
            axis("cy_px", self.centre.y, half[1]),
        ]
    }
    fn with_nonlinear(&self, values: &[f64]) -> Option<Self> {
        let inside = self
            .nonlinear()
            .iter()
            .zip(values)
            .all(|(n, v)| (n.range[0]..=n.range[1]).contains(v));
        inside.then(|| Self {
            centre: Pixel {
                x: values[0],
                y: values[1],
            },
            ..self.clone()
        })
    }
    fn shift_px(&self, star: &StarView, values: &[f64]) -> [f64; 2] {
        let [x, y] = self.bend(star.at, &self.all(values)).shift;
        let [fx, fy] = self.camera.focal_length_px();
        [fx * x, fy * y]
    }
    fn refined(&self, values: &[f64]) -> Option<Self> {
        let [half_x, half_y] = self.camera.half_size_px();
        let corners = [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)];
        let misses = corners.into_iter().any(|(x, y)| {
            let corner = StarView {
                t_s: 0.0,
                slot: 0,
                star_id: 0,
                mag: f64::NAN,
                bv: f64::NAN,
                at: Pixel {
                    x: x * half_x,
                    y: y * half_y,
                },
            };
            let linear = linear_px(self, &corner, values);
            let exact = self.shift_px(&corner, values);
            (0..2).any(|axis| (linear[axis] - exact[axis]).abs() > LINEAR_PX)
        });
        misses.then(|| Self {
            about: self.all(values),
            ..self.clone()
        })
    }
    fn linear_about(&self) -> Vec<(&'static str, f64)> {
        let own = self.terms.iter().map(|&k| (TERMS[k], self.about[k]));
        own.filter(|(_, value)| *value != 0.0).collect()
    }
    fn beside_form(&self, values: &[(&'static str, f64)]) -> Option<Self> {
        let mut about = [0.0; TERMS.len()];
        for &k in &self.terms {
            let value = values.iter().find(|(name, _)| *name == TERMS[k]);
            about[k] = value.map_or(0.0, |v| v.1);
        }
        Some(Self {
            about,
            ..self.clone()
        })
    }
    fn stands_for(&self) -> f64 {
        self.stands_for
    }
    fn terms(&self, star: &StarView, out: &mut [[f64; 2]]) {
        let bend = self.bend(star.at, &self.about);
        let mut left = bend.shift;
        let mut square = 0.0;
        for (out, &k) in out.iter_mut().zip(&self.terms) {
            *out = bend.slope(k);
            for axis in 0..2 {
                left[axis] -= self.about[k] * out[axis];
            }
            square += self.about[k].powi(2);
        }
        let focal = self.camera.focal_length_px();
        for (out, &k) in out.iter_mut().zip(&self.terms) {
            // what the slopes leave of the shift goes by the coefficients' sizes
            let share = if square > 0.0 {
                self.about[k] / square
            } else {
                0.0
            };
            *out = [0, 1].map(|axis| focal[axis] * (out[axis] + share * left[axis]));
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
