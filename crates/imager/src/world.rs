//! World files: an instrument in physical settings, and what its maker knows to act in it.
//!
//! A world is a file with the tables of this crate beside those of the motion and the run, which the
//! caller reads. `[truth]` goes into the sealed file beside the bundle and acts on nothing.
//!
//! Not physics: reading a file.

use serde::{Deserialize, Serialize};
use telemetry::{Model, ModelKind};

use crate::{
    Background, Bracket, Clock, Detector, ImagerError, Optics, Orbit, Readout, Reference, Shutter,
    Stars, Thermal, Truth,
};

/// The value of `format` in a world file.
pub const WORLD_FORMAT: &str = "boresight-world/1";

/// Tables that this crate reads.
pub const TABLES: [&str; 12] = [
    "truth",
    "optics",
    "shutter",
    "detector",
    "background",
    "readout",
    "clock",
    "stars",
    "orbit",
    "thermal",
    "bracket",
    "reference",
];

/// Everything that is rendered and read out.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(default)]
pub struct Instrument {
    /// `[truth]`
    pub truth: Truth,
    /// `[optics]`
    pub optics: Optics,
    /// `[shutter]`
    pub shutter: Shutter,
    /// `[detector]`
    pub detector: Detector,
    /// `[background]`
    pub background: Background,
    /// `[readout]`
    pub readout: Readout,
    /// `[clock]`
    pub clock: Clock,
    /// `[stars]`
    pub stars: Stars,
    /// `[orbit]`
    pub orbit: Orbit,
    /// `[thermal]`
    pub thermal: Thermal,
    /// `[bracket]`
    pub bracket: Bracket,
    /// `[reference]`; none in the bundle without it.
    pub reference: Option<Reference>,
}

impl Instrument {
    /// Reads the tables of a world file; `file` is its name in messages, `others` are tables that the
    /// caller reads from the same text.
    ///
    /// # Errors
    ///
    /// Another format, a table or key that does not exist, a value of the wrong type, with the line;
    /// or a number outside its range.
    ///
    /// ```
    /// let text = "format = \"boresight-world/1\"\n[shutter]\nrow_time_s = 30e-6\n[run]\nduration_s = 60\n";
    /// let world = imager::Instrument::parse(text, "w.toml", &["run"])?;
    /// assert!(world.shutter.row_time_s > 0.0);
    /// let error = imager::Instrument::parse(&text.replace("row_t", "rowt"), "w.toml", &["run"]).expect_err("no key");
    /// assert!(error.to_string().contains("`row_time_s`"));
    /// # Ok::<(), imager::ImagerError>(())
    /// ```
    pub fn parse(text: &str, file: &str, others: &[&str]) -> Result<Self, ImagerError> {
        let config = telemetry::config::Config::parse(text, file)?;
        let root = config.root();
        let mut known = vec!["format"];
        known.extend(TABLES);
        known.extend(others);
        root.allow(&known)?;
        let format = root.require("format")?;
        if format.text()? != WORLD_FORMAT {
            return Err(format.expected(&format!("{WORLD_FORMAT:?}")).into());
        }
        let instrument: Self = telemetry::config::deserialise(text, file)?;
        instrument.check()?;
        Ok(instrument)
    }

    /// The instrument that a model speaks of: its detector, field, exposure and number of stars; all
    /// else is this crate's default. Noise and centroid errors of the model are formulas and mean
    /// nothing here: they come out of the rendering.
    ///
    /// # Errors
    ///
    /// A model with effects (they are formulas too), or of kind `"hem"`, which has no detector.
    pub fn of_model(model: &Model) -> Result<Self, ImagerError> {
        if model.kind == ModelKind::Hem {
            return Err(ImagerError::NoDetector);
        }
        if let Some(effect) = model.effects.first() {
            let id = effect.id.clone();
            return Err(ImagerError::Formula { id });
        }
        let tracker = &model.tracker;
        let default = Self::default();
        let pixels = tracker.pixels.unwrap_or(default.optics.pixels);
        let of_focal = |f: f64| 2.0 * (0.5 * f64::from(pixels[0]) / f).atan().to_degrees();
        let fov_deg = tracker.fov_deg.map(|fov| fov[0]);
        let fov_deg = fov_deg.or(tracker.focal_length_px.map(of_focal));
        let followed = tracker
            .max_stars
            .and_then(|stars| usize::try_from(stars).ok());
        let instrument = Self {
            optics: Optics {
                pixels,
                fov_deg: fov_deg.unwrap_or(default.optics.fov_deg),
                ..default.optics
            },
            shutter: Shutter {
                exposure_s: tracker.exposure_s.unwrap_or(default.shutter.exposure_s),
                ..default.shutter
            },
            stars: Stars {
                followed: followed.unwrap_or(default.stars.followed),
                ..default.stars
            },
            ..default
        };
        instrument.check()?;
        Ok(instrument)
    }

    /// Checks every number.
    ///
    /// # Errors
    ///
    /// The first number outside its range, or a thermal node that does not exist.
    pub fn check(&self) -> Result<(), ImagerError> {
        self.truth.check()?;
        self.optics.check()?;
        self.shutter.check()?;
        self.detector.check()?;
        self.background.check()?;
        self.readout.check()?;
        self.clock.check()?;
        self.stars.check()?;
        self.orbit.check()?;
        self.thermal.check()?;
        self.bracket.check()?;
        self.reference.iter().try_for_each(Reference::check)?;
        self.optics_node()?;
        self.bracket_node().map(|_| ())
    }

    pub(crate) fn optics_node(&self) -> Result<Option<usize>, ImagerError> {
        let node = self.optics.node.as_ref();
        node.map(|node| self.thermal.index("optics.node", node))
            .transpose()
    }

    pub(crate) fn bracket_node(&self) -> Result<Option<usize>, ImagerError> {
        let node = self.bracket.node.as_ref();
        node.map(|node| self.thermal.index("bracket.node", node))
            .transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_gives_its_tracker_and_nothing_else() {
        let text = "format = \"boresight-model/1\"\nkind = \"pbm\"\n[tracker]\npixels = [512, 512]\n\
            focal_length_px = 1000.0\nmax_stars = 7\nexposure_s = 0.2\n[noise]\ntemporal_arcsec = 5.0\n";
        let model = Model::parse(text, "m.toml", &[]).unwrap();
        let instrument = Instrument::of_model(&model).unwrap();
        let camera = instrument.optics.camera().unwrap();
        assert_eq!(camera.pixels(), [512, 512]);
        assert!((camera.focal_length_px()[0] - 1000.0).abs() < 1e-9);
        assert_eq!(instrument.stars.followed, 7);
        assert!((instrument.shutter.exposure_s - 0.2).abs() < 1e-15);
        assert_eq!(instrument.detector, Detector::default());
        let effect = "[[effect]]\nid = \"time_tag_offset\"\noffset_s = 0.1\n";
        let model = Model::parse(&format!("{text}{effect}"), "m.toml", &[]).unwrap();
        let error = Instrument::of_model(&model).unwrap_err();
        assert!(error.to_string().contains("time_tag_offset"));
        let hybrid = Model {
            kind: ModelKind::Hem,
            ..Model::default()
        };
        assert_eq!(Instrument::of_model(&hybrid), Err(ImagerError::NoDetector));
    }
}
