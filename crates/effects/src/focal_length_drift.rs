//! Focal length drift: the scale follows a temperature, or time.
//!
//! ```text
//! dP = 1e-6 ppm_per_c (T(t) - mean T) P        channel form
//! dP = 1e-6 ppm_per_s (t - from_s) P            from_s: the middle of the data, if it is not said
//! ```
//!
//! P is the position off the boresight, and the mean is that of the run's span. The constant part of the scale is not
//! part of this effect: a common gain of all centroids cannot be told from the focal length itself. But a focal length
//! that was right when the run began has one, on average over the run, which shows where no distortion is declared: a
//! drift from the start is looked for, too. Where the channel is not known it counts as its mean.
//!
//! Source: \[M23\] Section 2.1 names thermal scaling and focal length changes among the causes of LSFE.

use std::collections::BTreeMap;

use focal_plane::Series;
use star_tracker::StarView;

use crate::channels::{self, Ending};
use crate::parameters::Reader;
use crate::shift::{Shift, ShiftCandidate, Shifted, sizes};
use crate::{
    ActsOn, Candidate, Coefficient, Effect, EffectError, EffectKind, Parameter, Parameters, Scene,
    Surroundings,
};

const ID: &str = "focal_length_drift";

/// Drift over one standard deviation of its cause that would not surprise, ppm.
const PLAUSIBLE_PPM: f64 = 50.0;

/// The kind.
#[derive(Debug)]
pub(crate) struct Kind;

impl EffectKind for Kind {
    fn id(&self) -> &'static str {
        ID
    }
    fn summary(&self) -> &'static str {
        "the scale follows a temperature channel or time"
    }
    fn needs(&self) -> &'static str {
        "stars, and time or a temperature channel (_c, _k)"
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
        let known = ["channel", "ppm_per_c", "ppm_per_s", "from_s"];
        let reader = Reader::new(ID, parameters, &known)?;
        if let Some(channel) = reader.text("channel")? {
            reader.exclude("channel", ["ppm_per_s", "from_s"])?;
            let series = channels::find(ID, channel, Ending::Temperature, surroundings)?;
            let value = reader.required("ppm_per_c")?;
            return Ok(Box::new(Shifted::new(
                Drift::with_channel(channel, series, surroundings),
                vec![value],
            )));
        }
        if reader.has("ppm_per_c") {
            return Err(EffectError::MissingParameter {
                effect: ID,
                name: "channel",
            });
        }
        let value = reader.required("ppm_per_s")?;
        let from_s = reader.number("from_s")?;
        Ok(Box::new(Shifted::new(
            Drift::with_time(surroundings, from_s),
            vec![value],
        )))
    }
    fn candidates(&self, scene: &Scene<'_>) -> Vec<Box<dyn Candidate>> {
        if !scene.has_stars {
            return Vec::new();
        }
        let mut all: Vec<Box<dyn Candidate>> = Vec::new();
        for (name, series) in channels::ending(Ending::Temperature, &scene.surroundings) {
            if channels::deviation(series) > 0.0 {
                all.push(ShiftCandidate::boxed(Drift::with_channel(
                    name,
                    series,
                    &scene.surroundings,
                )));
            }
        }
        if scene.surroundings.length_s() > 0.0 {
            let [start_s, _] = scene.surroundings.span_s;
            for from_s in [None, Some(start_s)] {
                let drift = Drift::with_time(&scene.surroundings, from_s);
                all.push(ShiftCandidate::boxed(drift));
            }
        }
        all
    }
}

/// What the scale follows.
#[derive(Clone, Debug)]
enum Drift {
    Channel {
        name: String,
        series: Series,
        mean: f64,
    },
    Time {
        /// `None`: from the middle of the data.
        from_s: Option<f64>,
        middle_s: f64,
        length_s: f64,
    },
}

impl Drift {
    fn with_channel(name: &str, series: &Series, surroundings: &Surroundings<'_>) -> Self {
        Self::Channel {
            name: name.to_owned(),
            series: series.clone(),
            mean: channels::mean_within(series, surroundings.span_s),
        }
    }

    fn with_time(surroundings: &Surroundings<'_>, from_s: Option<f64>) -> Self {
        Self::Time {
            from_s,
            middle_s: surroundings.middle_s(),
            length_s: surroundings.length_s(),
        }
    }
}

impl Shift for Drift {
    fn id(&self) -> &'static str {
        ID
    }
    fn coefficients(&self) -> Vec<Coefficient> {
        vec![match self {
            Self::Channel { series, .. } => {
                let plausible = PLAUSIBLE_PPM / channels::deviation(series);
                Coefficient::new("ppm_per_c", "ppm/degC", plausible)
            }
            // the standard deviation of time over a span is its length / sqrt 12
            Self::Time { length_s, .. } => Coefficient::new(
                "ppm_per_s",
                "ppm/s",
                PLAUSIBLE_PPM * 12_f64.sqrt() / length_s,
            ),
        }]
    }
    fn terms(&self, star: &StarView, out: &mut [[f64; 2]]) {
        let cause = match self {
            Self::Channel { series, mean, .. } => {
                series.at(star.t_s).map_or(0.0, |value| value - mean)
            }
            Self::Time {
                from_s, middle_s, ..
            } => star.t_s - from_s.unwrap_or(*middle_s),
        };
        out[0] = [1e-6 * cause * star.at.x, 1e-6 * cause * star.at.y];
    }
    fn parameters(&self, values: &[f64]) -> Vec<Parameter> {
        let mut all = sizes(self.coefficients(), values);
        if let Self::Time {
            from_s: Some(from_s),
            ..
        } = self
        {
            all.push(Parameter::new("from_s", *from_s, "s"));
        }
        all
    }
    fn selectors(&self) -> BTreeMap<String, String> {
        match self {
            Self::Channel { name, .. } => BTreeMap::from([("channel".to_owned(), name.clone())]),
            Self::Time { .. } => BTreeMap::new(),
        }
    }
}
