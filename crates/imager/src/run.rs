//! A whole run: a bundle in memory, or written as it grows.
//!
//! ```text
//! frame k is exposed about  first_s + k / rate_hz       chunk after chunk of 256 frames
//! ```
//!
//! What is held beside a chunk are the stars that may be followed: memory does not depend on how long
//! the run is, where the motion's own does not.
//!
//! Not physics: the order of the work.

use std::collections::BTreeSet;
use std::io::Write as _;

use focal_plane::{AttitudeSource, Catalogue, StarFrames};
use telemetry::{
    Bundle, BundleWriter, Epoch, Frames, Metadata, QuaternionSigns, TimeScale, TrackerMeta,
    VectorFrame,
};

use crate::pieces::{self, Sampler};
use crate::random::{Key, Use};
use crate::reference::References;
use crate::thermal::Temperatures;
use crate::tracker::Tracker;
use crate::{ImagerError, Instrument};

/// Frames made at once.
const CHUNK: u64 = 256;

/// How long, how often, and with which random numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// Title of the bundle.
    pub title: Option<String>,
    /// True time of the first frame, s.
    pub first_s: f64,
    /// Frames.
    pub frames: u64,
    /// Frames per second.
    pub rate_hz: f64,
    /// Seed of all random numbers. The detector's pixels depend on nothing else.
    pub seed: u64,
    /// Which of the draws of that seed.
    pub draw: u64,
    /// Date at t = 0.
    pub epoch: Option<Epoch>,
    /// Its scale.
    pub time_scale: Option<TimeScale>,
}

impl Default for Run {
    fn default() -> Self {
        Self {
            title: None,
            first_s: 0.0,
            frames: 1,
            rate_hz: 2.0,
            seed: 1,
            draw: 0,
            epoch: None,
            time_scale: None,
        }
    }
}

/// What came out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Summary {
    /// Frames asked for.
    pub frames: u64,
    /// Stars measured in them.
    pub star_rows: u64,
    /// Windows that gave no centroid: too little light, or a motion that is not known throughout.
    pub lost: u64,
}

/// The bundle of a run, in memory: the catalogue's places are those at the run's date.
///
/// # Errors
///
/// A number outside its range, or no star in any frame.
pub fn frames(
    instrument: &Instrument,
    truth: &dyn AttitudeSource,
    catalogue: &Catalogue,
    run: &Run,
) -> Result<Bundle, ImagerError> {
    let mut whole = Bundle::default();
    let mut take = |piece: Bundle, _| {
        join(&mut whole, piece);
        Ok(())
    };
    each(instrument, truth, catalogue, run, &mut take)?;
    whole.meta = metadata(instrument, run, catalogue)?;
    whole.camera = Some(instrument.optics.camera()?);
    if let Some(images) = &whole.images {
        let (size, unread) = (images.size, Vec::new());
        whole.meta.images = Some(telemetry::ImagesMeta { size, unread });
    }
    Ok(whole)
}

/// Writes the bundle of a run as it grows, with `truth.json` beside the tables; `progress` is told the
/// share that is done.
///
/// # Errors
///
/// As [`frames`], and what the operating system says; then nothing is left behind.
pub fn write(
    instrument: &Instrument,
    truth: &dyn AttitudeSource,
    catalogue: &Catalogue,
    run: &Run,
    mut writer: BundleWriter,
    progress: &dyn Fn(f64),
) -> Result<Summary, ImagerError> {
    let summary = each(instrument, truth, catalogue, run, &mut |piece, done| {
        progress(done);
        Ok(writer.append(&piece)?)
    })?;
    let sealed = instrument.truth.sealed(instrument, run, summary);
    let output = writer.output();
    output.write("truth.json", |to| writeln!(to, "{sealed}"))?;
    writer.finish(metadata(instrument, run, catalogue)?)?;
    Ok(summary)
}

/// Makes the pieces of a bundle, in order.
fn each(
    instrument: &Instrument,
    truth: &dyn AttitudeSource,
    catalogue: &Catalogue,
    run: &Run,
    take: &mut dyn FnMut(Bundle, f64) -> Result<(), ImagerError>,
) -> Result<Summary, ImagerError> {
    instrument.check()?;
    check(instrument, run)?;
    let camera = instrument.optics.camera()?;
    let year = catalogue.epoch_year();
    let sources = instrument.stars.sources(catalogue, year, &camera)?;
    let key = |purpose| Key::new(run.seed, run.draw, purpose);
    let mut sampler = Sampler::new(instrument, key(Use::Sensor), run.first_s)?;
    let mut references = instrument.reference.as_ref().map(|reference| {
        References::new(
            reference,
            &instrument.bracket,
            instrument.bracket_node().ok().flatten(),
            key(Use::Reference),
            run.first_s,
            run.rate_hz,
        )
    });
    let longest_s = references
        .as_ref()
        .map_or(0.0, References::step_s)
        .max(sampler.step_s());
    let first_s = run.first_s - 2.0 * longest_s;
    let mut temperatures = Temperatures::new(&instrument.thermal, first_s);
    let mut tracker = Tracker::new(instrument, truth, sources, camera, [run.seed, run.draw])?;
    let mut summary = Summary {
        frames: run.frames,
        ..Summary::default()
    };
    let (mut seen, mut from) = (BTreeSet::new(), 0);
    let time = |k: u64| run.first_s + k as f64 / run.rate_hz;
    while from < run.frames {
        let to = run.frames.min(from + CHUNK);
        let (start_s, end_s) = (time(from), time(to - 1));
        temperatures.advance([start_s - 2.0 * longest_s, end_s + 2.0 * longest_s]);
        let made = tracker.frames((from..to).map(|k| (k, time(k))), &temperatures);
        for frame in &made {
            summary.star_rows += frame.rows.len() as u64;
            summary.lost += frame.lost;
            seen.extend(frame.rows.iter().map(|row| row.source));
        }
        let mut piece = pieces::of_frames(&made, &tracker.sources, instrument);
        piece.reference = references
            .as_mut()
            .map(|references| references.until(end_s, truth, &temperatures))
            .filter(|table| !table.t_s.is_empty());
        piece.housekeeping = sampler.until(end_s, instrument, &temperatures);
        from = to;
        if from == run.frames {
            if seen.is_empty() {
                return Err(ImagerError::NothingSeen { frames: run.frames });
            }
            piece.catalog = Some(pieces::catalogue(&seen, &tracker.sources, year)?);
        }
        take(piece, from as f64 / run.frames as f64)?;
    }
    Ok(summary)
}

fn check(instrument: &Instrument, run: &Run) -> Result<(), ImagerError> {
    ImagerError::finite("run.first_s", run.first_s)?;
    ImagerError::positive("run.rate_hz", run.rate_hz)?;
    ImagerError::positive("run.frames", run.frames as f64)?;
    // stamps must not come out of order: beyond 6 sigma on either side, nobody waits for it
    let clock = instrument.clock;
    let loose_s = clock.step_s + 12.0 * clock.jitter_s;
    ImagerError::check(
        "clock.step_s + 12 clock.jitter_s",
        loose_s,
        loose_s * run.rate_hz < 1.0,
        "shorter than the time between frames",
    )
}

fn metadata(
    instrument: &Instrument,
    run: &Run,
    catalogue: &Catalogue,
) -> Result<Metadata, ImagerError> {
    let camera = instrument.optics.camera()?;
    let frames = Frames {
        vectors_in: Some(VectorFrame::Inertial),
        quaternion_signs: QuaternionSigns::Known([1.0; 3]),
        ..Frames::default()
    };
    Ok(Metadata {
        title: run.title.clone(),
        source: Some(telemetry::made_here("rendered", run.seed, run.draw)),
        epoch: run.epoch,
        time_scale: run.time_scale,
        sample_rate_hz: Some(run.rate_hz),
        catalog_epoch_year: run.epoch.map(|_| catalogue.epoch_year()),
        tracker: TrackerMeta::of_camera(&camera, Some(instrument.shutter.exposure_s)),
        frames: instrument.orbit.reported.then_some(frames),
        ..Metadata::default()
    })
}

/// Adds the rows of a piece.
fn join(whole: &mut Bundle, piece: Bundle) {
    if let Some(stars) = piece.stars {
        append_stars(whole.stars.get_or_insert_default(), &stars);
    }
    if let Some(mut table) = piece.attitude {
        let all = whole.attitude.get_or_insert_default();
        all.t_s.append(&mut table.t_s);
        all.q.append(&mut table.q);
    }
    if let Some(mut table) = piece.images {
        match &mut whole.images {
            None => whole.images = Some(table),
            Some(all) => {
                all.t_s.append(&mut table.t_s);
                all.slot.append(&mut table.slot);
                all.x0_px.append(&mut table.x0_px);
                all.y0_px.append(&mut table.y0_px);
                all.background.append(&mut table.background);
                all.pixels.append(&mut table.pixels);
            }
        }
    }
    if let Some(mut table) = piece.reference {
        match &mut whole.reference {
            None => whole.reference = Some(table),
            Some(all) => {
                all.t_s.append(&mut table.t_s);
                all.q.append(&mut table.q);
                for (all, table) in all.rates_rad_s.iter_mut().zip(&mut table.rates_rad_s) {
                    all.append(table);
                }
                for (all, table) in all.sigma_arcsec.iter_mut().zip(&mut table.sigma_arcsec) {
                    all.append(table);
                }
            }
        }
    }
    if let Some(mut table) = piece.housekeeping {
        let all = whole.housekeeping.get_or_insert_default();
        all.t_s.append(&mut table.t_s);
        for (name, mut values) in table.channels {
            all.channels.entry(name).or_default().append(&mut values);
        }
    }
    if piece.catalog.is_some() {
        whole.catalog = piece.catalog;
    }
}

fn append_stars(all: &mut StarFrames, piece: &StarFrames) {
    for k in 0..piece.frames() {
        all.begin(piece.t_s[k]);
        for row in piece.rows_of(k) {
            let flux = piece.flux.as_ref().map(|flux| flux[row]);
            let (x, y) = (piece.x_px[row], piece.y_px[row]);
            all.push_measured(piece.slot[row], piece.star_id[row], x, y, None, flux);
        }
    }
}
