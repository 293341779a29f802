//! Motion and run alone: for whoever makes the measurements in another way.
//!
//! Not physics: reading a file.

use std::path::{Path, PathBuf};

use focal_plane::{AttitudeSeries, AttitudeSource};
use serde::Deserialize;
use star_tracker::{Purpose, stream};

use crate::simulate::{span_s, times, truth_and_times};
use crate::{Motion, Run, Scenario, ScenarioError};

/// Where a tracker points, and when it looks.
#[derive(Clone, Debug, PartialEq)]
pub struct Course {
    /// `[motion]`
    pub motion: Motion,
    /// `[run]`
    pub run: Run,
    /// Folder at which relative paths start.
    pub folder: PathBuf,
}

#[derive(Deserialize)]
struct Tables {
    motion: Motion,
    run: Run,
}

impl Course {
    /// The tables whose keys [`parse`](Self::parse) checks.
    pub const TABLES: [&str; 2] = ["motion", "run"];

    /// Reads `[motion]` and `[run]` of a file and leaves its other tables to others; `file` is its name
    /// in messages.
    ///
    /// # Errors
    /// A missing table, a key of these tables that does not exist, or a value of the wrong type, with
    /// the line.
    ///
    /// ```
    /// use focal_plane::AttitudeSource;
    /// let text = "[motion]\nkind = \"hold\"\n[run]\nduration_s = 30.0\n[optics]\npixels = [512, 512]\n";
    /// let course = scenarios::Course::parse(text, "world.toml", ".".as_ref())?;
    /// let (truth, t_s) = course.truth(2.0)?;
    /// assert_eq!((t_s.len(), truth.span_s()), (60, [-5.0, 35.0]));
    /// # Ok::<(), scenarios::ScenarioError>(())
    /// ```
    pub fn parse(text: &str, file: &str, folder: &Path) -> Result<Self, ScenarioError> {
        let tables: Tables = telemetry::config::deserialise(text, file)?;
        Ok(Self {
            motion: tables.motion,
            run: tables.run,
            folder: folder.to_owned(),
        })
    }

    /// True attitude and the times of the frames; `rate_hz` where the run does not say.
    ///
    /// # Errors
    /// A number outside its range, or a recording that cannot be read.
    pub fn truth(&self, rate_hz: f64) -> Result<(AttitudeSeries, Vec<f64>), ScenarioError> {
        self.run.check(telemetry::ModelKind::Pbm)?;
        let rate_hz = self.run.rate_hz.unwrap_or(rate_hz);
        ScenarioError::check_positive("run.rate_hz", rate_hz)?;
        truth_and_times(
            &self.motion,
            &self.run,
            &self.folder,
            rate_hz,
            self.run.draw,
        )
    }

    /// As [`truth`](Self::truth), in memory that does not depend on the duration: the attitude, the time
    /// of the first frame, s, and how many frames there are, `1/rate` apart.
    ///
    /// # Errors
    /// As [`truth`](Self::truth).
    ///
    /// ```
    /// let text = "[motion]\nkind = \"hold\"\n[run]\nduration_s = 1e7\n";
    /// let course = scenarios::Course::parse(text, "world.toml", ".".as_ref())?;
    /// let (truth, first_s, frames) = course.long_truth(2.0)?;
    /// assert_eq!((frames, first_s, truth.span_s()), (20_000_000, 0.0, [-5.0, 1e7 + 5.0]));
    /// # Ok::<(), scenarios::ScenarioError>(())
    /// ```
    pub fn long_truth(
        &self,
        rate_hz: f64,
    ) -> Result<(Box<dyn AttitudeSource>, f64, u64), ScenarioError> {
        let run = &self.run;
        run.check(telemetry::ModelKind::Pbm)?;
        let rate_hz = run.rate_hz.unwrap_or(rate_hz);
        ScenarioError::check_positive("run.rate_hz", rate_hz)?;
        let rng = stream(run.seed, run.draw, Purpose::Motion);
        let span_s = span_s(&self.motion, run)?;
        let truth = self.motion.long_truth(span_s, &self.folder, &rng)?;
        let (first_s, frames) = times(&self.motion, run, truth.span_s(), rate_hz);
        Ok((truth, first_s, frames))
    }
}

impl From<&Scenario> for Course {
    fn from(scenario: &Scenario) -> Self {
        Self {
            motion: scenario.motion.clone(),
            run: scenario.run.clone(),
            folder: scenario.folder.clone(),
        }
    }
}
