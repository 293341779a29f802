//! Rolling shutter: row y is exposed at `t + line_time y`, y in centred pixels.
//!
//! ```text
//! forward     P(t'),   t' = t + line_time y(t')       solved by substitution
//! stars       dP = line_time y v
//! ```
//!
//! Re-linearised about an estimate, the columns follow the path to that t'.
//!
//! Source: \[M23\] Section 4.2.1 names the effect; a frame's time is the middle of the exposure of row
//! y = 0 (conventions of `focal_plane`).

use focal_plane::{Camera, PointsMut, VectorsMut};
use star_tracker::{Disturbance, Stages, StarView};

use crate::candidate::check_columns;
use crate::parameters::Reader;
use crate::path::Path;
use crate::{
    ActsOn, AttitudeRows, Candidate, Coefficient, Effect, EffectError, EffectKind, Parameter,
    Parameters, Scene, StarRows, Surroundings,
};

const ID: &str = "rolling_shutter";

/// Largest line time that is declared, and that is believed where frames follow each other too fast for it, s;
/// between the two one read-out from frame to frame.
const LARGEST_S: f64 = 0.1;
const MOST_S: f64 = 2e-3;

/// The kind.
#[derive(Debug)]
pub(crate) struct Kind;

impl EffectKind for Kind {
    fn id(&self) -> &'static str {
        ID
    }
    fn summary(&self) -> &'static str {
        "row y is exposed at t + line_time_s y"
    }
    fn needs(&self) -> &'static str {
        "stars, and a motion that the samples resolve"
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
        let reader = Reader::new(ID, parameters, &["line_time_s"])?;
        let line_time_s = reader.within(
            "line_time_s",
            [-LARGEST_S, LARGEST_S],
            "between -0.1 s and 0.1 s per row",
        )?;
        Ok(Box::new(RollingShutter { line_time_s }))
    }
    fn candidates(&self, scene: &Scene<'_>) -> Vec<Box<dyn Candidate>> {
        if !scene.has_stars {
            return Vec::new();
        }
        let lines = f64::from(scene.surroundings.camera.pixels()[1]);
        let frame_s = scene.between_s().map_or(0.0, |s| s / lines);
        let most_s = frame_s.clamp(MOST_S, LARGEST_S);
        vec![Box::new(ShutterCandidate::about(0.0, most_s))]
    }
}

#[derive(Clone, Debug)]
struct RollingShutter {
    line_time_s: f64,
}

impl Disturbance for RollingShutter {
    fn stages(&self) -> Stages {
        Stages {
            instant: true,
            ..Stages::NONE
        }
    }
    fn time_shift_s(&self, star: &StarView) -> f64 {
        self.line_time_s * star.at.y
    }
}

impl Effect for RollingShutter {
    fn id(&self) -> &'static str {
        ID
    }
    fn parameters(&self) -> Vec<Parameter> {
        vec![Parameter::new("line_time_s", self.line_time_s, "s")]
    }
}

#[derive(Clone, Debug)]
struct ShutterCandidate {
    about_s: f64,
    most_s: f64,
    coefficients: [Coefficient; 1],
}

impl ShutterCandidate {
    fn about(about_s: f64, most_s: f64) -> Self {
        let coefficient = Coefficient::new("line_time_s", "s", 1e-4)
            .at_least(-most_s)
            .at_most(most_s);
        Self {
            about_s,
            most_s,
            coefficients: [coefficient],
        }
    }
}

/// Line times below it are taken as zero: the chord of a path loses its digits in rounding.
const SMALLEST_S: f64 = 1e-9;

impl Candidate for ShutterCandidate {
    fn id(&self) -> &'static str {
        ID
    }
    fn coefficients(&self) -> &[Coefficient] {
        &self.coefficients
    }
    fn refined(&self, values: &[f64]) -> Option<Box<dyn Candidate>> {
        values[0]
            .is_finite()
            .then(|| Box::new(Self::about(values[0], self.most_s)) as Box<dyn Candidate>)
    }
    fn acts_on_stars(&self) -> bool {
        true
    }
    fn acts_on_attitude(&self) -> bool {
        false
    }
    fn star_columns(&self, camera: &Camera, rows: &StarRows<'_>, out: PointsMut<'_>) -> bool {
        check_columns(1, rows.len(), out.x.len());
        if self.about_s.abs() < SMALLEST_S {
            for i in 0..rows.len() {
                out.x[i] = rows.y_px[i] * rows.vx_px_s[i];
                out.y[i] = rows.y_px[i] * rows.vy_px_s[i];
            }
            return true;
        }
        let mut path = Path::new(camera, rows);
        for i in 0..rows.len() {
            // from the velocity two substitutions: each shrinks the error by line_time |vy|, 4e-4 in a fast slew
            let mut shift =
                [rows.vx_px_s[i], rows.vy_px_s[i]].map(|v| v * self.about_s * rows.y_px[i]);
            for _ in 0..2 {
                shift = path.shift(i, self.about_s * (rows.y_px[i] + shift[1]));
            }
            out.x[i] = shift[0] / self.about_s;
            out.y[i] = shift[1] / self.about_s;
        }
        true
    }
    fn attitude_columns(&self, _: &AttitudeRows<'_>, _: VectorsMut<'_>) -> bool {
        false
    }
    fn realise(
        &self,
        values: &[f64],
        _: &Surroundings<'_>,
    ) -> Result<Box<dyn Effect>, EffectError> {
        Ok(Box::new(RollingShutter {
            line_time_s: values[0],
        }))
    }
}
