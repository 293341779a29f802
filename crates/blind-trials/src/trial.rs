//! Where bundles come from: the world files, and simulations.
//!
//! Not physics: reading files.

use std::path::Path;
use std::sync::Arc;

use focal_plane::{AttitudeSeries, Catalogue};
use imager::{ImagerError, Instrument, Run, Truth};
use scenarios::{Course, Scenario, hipparcos, simulate_with_truth};
use telemetry::{Bundle, Model};

use crate::BlindError;

/// Seeds of one world are this far apart: no other world has them.
const SEED_STEP: u64 = 1000;
/// Frames per second where a world does not say.
const RATE_HZ: f64 = 2.0;
/// Positions of stars where no date is given, Julian year.
const YEAR: f64 = 2000.0;

/// Bundles of one kind, and what acts in them.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Its name.
    pub name: String,
    /// What acts.
    pub truth: Truth,
    /// What the analyst declares.
    pub model: Model,
    pub(crate) made: Made,
}

/// How the bundles are made.
#[derive(Clone, Debug)]
pub(crate) enum Made {
    /// Rendered.
    Pixels(Box<World>),
    /// Simulated by the physics-based model.
    Model(Box<Scenario>),
}

/// What is rendered.
#[derive(Clone, Debug)]
pub(crate) struct World {
    pub(crate) instrument: Instrument,
    course: Course,
    sky: Arc<Catalogue>,
}

impl World {
    /// Renders the run of a seed, counted from 0, with this instrument in place of its own.
    pub(crate) fn render(&self, instrument: &Instrument, seed: u64) -> Result<Bundle, BlindError> {
        let mut course = self.course.clone();
        course.run.seed += SEED_STEP * seed;
        let (truth, t_s): (AttitudeSeries, _) = course.truth(RATE_HZ)?;
        let settings = &course.run;
        let run = Run {
            title: settings.title.clone(),
            first_s: t_s[0],
            frames: t_s.len() as u64,
            rate_hz: settings.rate_hz.unwrap_or(RATE_HZ),
            seed: settings.seed,
            draw: settings.draw,
            epoch: settings.epoch,
            time_scale: settings.time_scale,
        };
        let rendered = imager::frames(instrument, &truth, &self.sky, &run);
        rendered.map_err(|reason| self.failed(reason))
    }

    fn failed(&self, reason: ImagerError) -> BlindError {
        let world = self.course.run.title.clone().unwrap_or_default();
        let reason = Box::new(reason);
        BlindError::Imager { world, reason }
    }
}

impl Trial {
    /// Reads a world file.
    ///
    /// # Errors
    ///
    /// A file that cannot be read, a key that does not exist, a value out of its range, or no model.
    pub fn read(path: &Path) -> Result<Self, BlindError> {
        let file = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|e| BlindError::Read {
            file: file.clone(),
            reason: e.to_string(),
        })?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let name = path.file_stem().unwrap_or_default();
        Self::parse(&text, &name.to_string_lossy(), &file, folder)
    }

    /// Reads a world from text; `file` is its name in messages, `folder` where relative paths start.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read).
    pub fn parse(text: &str, name: &str, file: &str, folder: &Path) -> Result<Self, BlindError> {
        let failed = |reason| BlindError::Imager {
            world: name.to_owned(),
            reason: Box::new(reason),
        };
        let instrument = Instrument::parse(text, file, &Course::TABLES).map_err(failed)?;
        let course = Course::parse(text, file, folder)?;
        let truth = instrument.truth.clone();
        let model = truth.model.as_ref().ok_or_else(|| BlindError::NoModel {
            world: name.to_owned(),
        })?;
        let model = Model::read(&folder.join(model))?;
        let year = course.run.epoch.map_or(YEAR, |e| e.julian_year(0.0));
        Ok(Self {
            name: name.to_owned(),
            truth,
            model,
            made: Made::Pixels(Box::new(World {
                instrument,
                course,
                sky: Arc::new(hipparcos(year)?),
            })),
        })
    }

    /// The bundle of a seed, counted from 0.
    ///
    /// # Errors
    ///
    /// What the rendering or the simulation says.
    pub fn bundle(&self, seed: u64) -> Result<Bundle, BlindError> {
        match &self.made {
            Made::Pixels(world) => world.render(&world.instrument, seed),
            Made::Model(scenario) => Ok(simulate_with_truth(scenario, seed)?.bundle),
        }
    }

    /// Whether windows are sent: then the loop takes many times as long.
    #[must_use]
    pub fn has_images(&self) -> bool {
        match &self.made {
            Made::Pixels(world) => world.instrument.readout.images,
            Made::Model(_) => false,
        }
    }

    pub(crate) fn world(&self) -> Option<&World> {
        match &self.made {
            Made::Pixels(world) => Some(world),
            Made::Model(_) => None,
        }
    }
}

/// All worlds of a folder, by name.
///
/// # Errors
///
/// A folder that cannot be read, or any of its worlds.
pub fn worlds(folder: &Path) -> Result<Vec<Trial>, BlindError> {
    let failed = |e: std::io::Error| BlindError::Read {
        file: folder.display().to_string(),
        reason: e.to_string(),
    };
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if path.extension().is_some_and(|e| e == "toml") {
            paths.push(path);
        }
    }
    paths.sort();
    paths.iter().map(|path| Trial::read(path)).collect()
}
