//! Bundles to try the loop on: the tracker of [M23] Table 1, a motion, and what acts in it.
//!
//! Not physics: scenario files, made from parts.

use closed_loop::{CloseError, Closed, close};
use focal_plane::{Catalogue, CatalogueStar, StarFrames};
use scenarios::{Scenario, simulate};
use telemetry::report::Report;
use telemetry::{Bundle, Model};

/// How the tracker moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Path {
    /// A slow drift, tens of pixels within the run.
    Drift,
    /// Not at all.
    Rest,
    /// Hardly a pixel within the run.
    Still,
    /// Steadily on: after 7 min all stars are others.
    Scan,
    /// Slews to and fro about three axes, up to 5 px/s.
    Slews,
    /// To and fro every 8 s: the image reverses again and again.
    Turns,
    /// The same every five seconds, by half a pixel.
    Sways,
    /// About two axes at two frequencies, over the same pixels again and again: a hundred under each star.
    Nods,
}

impl Path {
    fn toml(self, seed: u64) -> String {
        // pointings of different star density, at any roll
        let s = seed as f64;
        let start = format!(
            "start = {{ ra_deg = {:.3}, dec_deg = {:.3}, roll_deg = {:.3} }}",
            (75.0 + 137.508 * s) % 360.0,
            55.0 * (0.7 * s).sin(),
            (20.0 + 77.7 * s) % 360.0
        );
        let slew = |axis: &str, angle: f64, duration: f64, hold: f64| {
            format!(
                "[[motion.slew]]\naxis = {axis}\nangle_deg = {angle:?}\nduration_s = {duration:?}\nhold_s = {hold:?}\n"
            )
        };
        let to_and_fro = |[a, f]: [f64; 2], [b, g]: [f64; 2]| {
            format!(
                "[motion]\nkind = \"hold\"\n{start}\ndrift_arcsec_s = [1.5, -2.5, 0.5]\n\
                 [[motion.sinusoid]]\naxis = [1.0, 0.4, 0.0]\namplitude_arcsec = {a:?}\nfrequency_hz = {f:?}\n\
                 [[motion.sinusoid]]\naxis = [0.0, 0.6, 1.0]\namplitude_arcsec = {b:?}\nfrequency_hz = {g:?}\n"
            )
        };
        match self {
            Self::Drift => {
                format!("[motion]\nkind = \"hold\"\n{start}\ndrift_arcsec_s = [6.0, -9.0, 1.0]\n")
            }
            Self::Rest => format!("[motion]\nkind = \"hold\"\n{start}\n"),
            Self::Still => {
                format!(
                    "[motion]\nkind = \"hold\"\n{start}\ndrift_arcsec_s = [0.06, -0.09, 0.01]\n"
                )
            }
            Self::Scan => {
                format!(
                    "[motion]\nkind = \"hold\"\n{start}\ndrift_arcsec_s = [130.0, 90.0, 20.0]\n"
                )
            }
            Self::Slews => {
                let mut text = format!(
                    "[motion]\nkind = \"slews\"\n{start}\ndrift_arcsec_s = [1.5, -2.5, 0.5]\nwait_s = 20.0\nrepeat = 4\n"
                );
                for (axis, angle) in [
                    ("[1.0, 0.0, 0.0]", 1.3),
                    ("[0.0, 1.0, 0.0]", 1.3),
                    ("[0.0, 0.0, 1.0]", 7.0),
                ] {
                    text += &slew(axis, angle, 30.0, 10.0);
                    text += &slew(axis, -angle, 30.0, 10.0);
                }
                text
            }
            Self::Nods => format!(
                "[motion]\nkind = \"hold\"\n{start}\n\
                 [[motion.sinusoid]]\naxis = [1.0, 0.0, 0.0]\namplitude_arcsec = 350.0\nfrequency_hz = 0.017\n\
                 [[motion.sinusoid]]\naxis = [0.0, 1.0, 0.0]\namplitude_arcsec = 350.0\nfrequency_hz = 0.0123\n"
            ),
            Self::Turns => to_and_fro([400.0, 0.11], [600.0, 0.083]),
            Self::Sways => to_and_fro([20.0, 0.22], [30.0, 0.166]),
        }
    }
}

/// One bundle to be made.
#[derive(Clone, Debug)]
pub(crate) struct Case {
    pub(crate) path: Path,
    pub(crate) seed: u64,
    pub(crate) stars: usize,
    pub(crate) duration_s: f64,
    /// `[[effect]]` entries: what acts.
    pub(crate) effects: String,
    /// `[reference]`, or nothing.
    pub(crate) reference: String,
    /// More `[[housekeeping.channel]]` entries.
    pub(crate) channels: String,
    /// True temporal noise over the declared.
    pub(crate) noise: f64,
}

impl Case {
    /// Nothing acts; a perfect reference; two channels that do nothing.
    pub(crate) fn new(path: Path, seed: u64) -> Self {
        Self {
            path,
            seed,
            stars: 12,
            duration_s: 420.0,
            effects: String::new(),
            reference: "[reference]\n".to_owned(),
            channels: String::new(),
            noise: 1.0,
        }
    }

    /// The same with an effect: its `id` and the lines of its parameters.
    pub(crate) fn with(mut self, id: &str, parameters: &str) -> Self {
        self.effects += &format!("[[effect]]\nid = \"{id}\"\n{parameters}\n");
        self
    }

    pub(crate) fn reference(mut self, lines: &str) -> Self {
        self.reference = if lines == "none" {
            String::new()
        } else {
            format!("[reference]\n{lines}\n")
        };
        self
    }

    pub(crate) fn scenario(&self) -> Scenario {
        let noise = |sigma: f64| {
            format!(
                "[noise]\ntemporal_arcsec = {sigma:?}\ncentroid_arcsec = 5.06\n\
                 distortion_arcsec = 3.1667\ndistortion_order = 7\n"
            )
        };
        let text = format!(
            "format = \"boresight-model/1\"\nkind = \"pbm\"\n\
             [tracker]\npixels = [1024, 1024]\nfov_deg = [20.0, 20.0]\nmax_stars = {}\nexposure_s = 0.1\n\
             {}{}{}\
             [sky]\nkind = \"hipparcos\"\nstars = {}\n\
             [run]\nduration_s = {:?}\nrate_hz = 2.0\nseed = {}\n{}\
             [housekeeping]\nrate_hz = 0.2\n{HEATER}{OPTICS}{}",
            self.stars,
            noise(7.43 * self.noise),
            self.effects,
            self.path.toml(self.seed),
            self.stars,
            self.duration_s,
            self.seed,
            self.reference,
            self.channels,
        );
        Scenario::parse(&text, "trial.toml").expect("the trial's scenario is one")
    }

    /// The scenario with nothing but this noise of the stars, circular, arcsec.
    pub(crate) fn quiet(&self, temporal_arcsec: f64) -> Scenario {
        let mut scenario = self.scenario();
        let noise = &mut scenario.model.noise;
        noise.temporal_arcsec = Some(temporal_arcsec);
        noise.centroid_arcsec = None;
        noise.distortion_arcsec = None;
        scenario
    }

    /// The model of somebody who does not know what acts, and the bundle.
    pub(crate) fn make(&self) -> (Model, Bundle) {
        let scenario = self.scenario();
        let bundle = simulate(&scenario).expect("the trial's bundle can be made");
        let mut model = scenario.model_without_effects();
        model.noise.temporal_arcsec = Some(7.43);
        (model, bundle)
    }

    pub(crate) fn close(&self) -> Closed {
        let (model, bundle) = self.make();
        closed(&model, &bundle).expect("the loop closes")
    }
}

/// A bracket under a thermostat, and its heater.
const HEATER: &str = r#"[[housekeeping.channel]]
kind = "thermostat"
name = "bracket_c"
low = 19.4
high = 20.6
settles_on = 24.0
settles_off = 17.0
tau_s = 200.0
noise = 0.02
switch = "heater_on"
"#;

/// Optics whose temperature goes up and down within the run.
const OPTICS: &str = r#"[[housekeeping.channel]]
kind = "sinusoid"
name = "optics_c"
mean = 12.0
amplitude = 0.8
period_s = 300.0
phase_deg = 40.0
noise = 0.02
"#;

/// Velocity of the Earth, inertial.
pub(crate) const VELOCITY: &str = r#"[[housekeeping.channel]]
kind = "orbit_velocity"
radius_km = 149597870.7
period_s = 31558149.5
inclination_deg = 23.44
"#;

/// The report of somebody who does not know what acts in a scenario.
pub(crate) fn reported(scenario: &Scenario) -> Report {
    let bundle = simulate(scenario).expect("a bundle");
    let closed = closed(&scenario.model_without_effects(), &bundle);
    closed.expect("the loop closes").report
}

pub(crate) fn closed(model: &Model, bundle: &Bundle) -> Result<Closed, CloseError> {
    close(model, bundle, &|_| {})
}

/// The frames of `stars` whose number `frame` accepts, with those rows (frame, row of it) that `row` does.
pub(crate) fn kept_of(
    stars: &StarFrames,
    frame: impl Fn(usize) -> bool,
    row: impl Fn(usize, usize) -> bool,
) -> StarFrames {
    let mut out = StarFrames::new();
    for k in (0..stars.frames()).filter(|&k| frame(k)) {
        out.begin(stars.t_s[k]);
        for (_, at) in stars.rows_of(k).enumerate().filter(|(i, _)| row(k, *i)) {
            let (slot, star) = (stars.slot[at], stars.star_id[at]);
            out.push(slot, star, stars.x_px[at], stars.y_px[at]);
        }
    }
    out
}

/// The star of that number.
pub(crate) fn star(catalog: &Catalogue, id: i64) -> &CatalogueStar {
    &catalog.stars()[catalog.index_of(id).expect("a known star")]
}

/// Names of the effects, in the order added.
pub(crate) fn named(report: &Report) -> Vec<&str> {
    report.effects.iter().map(|e| e.id.as_str()).collect()
}

/// Sum of the mean squares over both axes, arcsec^2.
pub(crate) fn power(rms: Option<[f64; 2]>) -> f64 {
    rms.map_or(f64::NAN, |[x, y]| x * x + y * y)
}
