//! One frame after another: which windows are opened, what they hold, and what the tracker makes of it.
//!
//! ```text
//! in order     stars followed, windows (they remember where they were), temperatures
//! in parallel  each frame by itself: light, detector, centroids, QUEST
//! ```
//!
//! A window's random numbers belong to its frame and slot, so that the order of the work changes nothing.
//!
//! Source: [M23] Eq. 12 to 14 for the attitude (QUEST, all stars alike); the rest in the modules named.

use focal_plane::{AttitudeSource, Camera, Pixel, aberrated};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use rayon::prelude::*;

use crate::detector::{PixelTraits, Place};
use crate::path::{NODES, Plan};
use crate::random::{Key, Use};
use crate::render::{Exposed, add_star, row_y};
use crate::sky::{Selection, Source};
use crate::thermal::Temperatures;
use crate::{ImagerError, Instrument};

/// A window to be exposed.
#[derive(Clone, Copy, Debug)]
struct Opened {
    slot: usize,
    source: usize,
    corner: [i32; 2],
}

/// A frame to be exposed.
#[derive(Clone, Debug)]
struct Shot {
    number: u64,
    t_s: f64,
    optics_c: Option<f64>,
    windows: Vec<Opened>,
}

/// A star as the tracker reports it.
#[derive(Clone, Debug)]
pub(crate) struct Row {
    pub(crate) slot: usize,
    pub(crate) source: usize,
    pub(crate) at: Pixel,
    pub(crate) flux_dn: f64,
    pub(crate) background_dn: f64,
    /// Centre of the first pixel.
    pub(crate) first: Pixel,
    /// Raw numbers; empty where no images are wanted.
    pub(crate) window: Vec<f64>,
}

/// A frame as the tracker reports it.
#[derive(Clone, Debug)]
pub(crate) struct Frame {
    pub(crate) stamp_s: f64,
    pub(crate) rows: Vec<Row>,
    pub(crate) q: Option<UnitQuaternion<f64>>,
    /// Windows that gave no centroid.
    pub(crate) lost: u64,
}

/// Everything that frames are made from.
pub(crate) struct Tracker<'a> {
    instrument: &'a Instrument,
    truth: &'a dyn AttitudeSource,
    pub(crate) camera: Camera,
    pub(crate) sources: Vec<Source>,
    plan: Plan,
    exposure: Key,
    clock: Key,
    seed: u64,
    optics_node: Option<usize>,
    selection: Selection,
    /// Where each slot's window lies.
    corners: Vec<Option<[i32; 2]>>,
}

impl<'a> Tracker<'a> {
    pub(crate) fn new(
        instrument: &'a Instrument,
        truth: &'a dyn AttitudeSource,
        sources: Vec<Source>,
        camera: Camera,
        [seed, draw]: [u64; 2],
    ) -> Result<Self, ImagerError> {
        let (shutter, followed) = (instrument.shutter, instrument.stars.followed);
        Ok(Self {
            instrument,
            truth,
            camera,
            sources,
            plan: Plan::new(
                shutter.exposure_s,
                shutter.row_time_s,
                instrument.readout.window[1],
            ),
            exposure: Key::new(seed, draw, Use::Exposure),
            clock: Key::new(seed, draw, Use::Clock),
            seed,
            optics_node: instrument.optics_node()?,
            selection: Selection::new(followed),
            corners: vec![None; followed],
        })
    }

    /// The frames of these numbers and true times, which go on from those before.
    pub(crate) fn frames(
        &mut self,
        times: impl Iterator<Item = (u64, f64)>,
        temperatures: &Temperatures,
    ) -> Vec<Frame> {
        let shots: Vec<Shot> = times
            .map(|(k, t_s)| self.point(k, t_s, temperatures))
            .collect();
        let traits = PixelTraits::new(&self.instrument.detector, self.seed);
        let shots = shots.par_iter();
        shots.map(|shot| self.expose(shot, &traits)).collect()
    }

    /// Chooses stars and windows.
    fn point(&mut self, number: u64, t_s: f64, temperatures: &Temperatures) -> Shot {
        let mut windows = Vec::new();
        if let Some(q) = self.truth.attitude(t_s) {
            let (mut places, before) = (Vec::new(), self.selection.slots.clone());
            let margin_px = self.instrument.stars.margin_px;
            self.selection
                .update(&self.sources, &self.camera, &q, margin_px, &mut places);
            for (slot, place) in places.iter().enumerate() {
                let followed = self.selection.slots[slot];
                let kept = self.corners[slot].filter(|_| followed == before[slot]);
                let corner = place.map(|at| self.instrument.readout.corner(&self.camera, at, kept));
                self.corners[slot] = corner;
                if let (Some(source), Some(corner)) = (followed, corner) {
                    windows.push(Opened {
                        slot,
                        source,
                        corner,
                    });
                }
            }
        }
        Shot {
            number,
            t_s,
            optics_c: self.optics_node.map(|node| temperatures.at(node, t_s)),
            windows,
        }
    }

    fn expose(&self, shot: &Shot, traits: &PixelTraits<'_>) -> Frame {
        let velocity_m_s = 1e3 * self.instrument.orbit.velocity_km_s(shot.t_s);
        let mut rows = Vec::with_capacity(shot.windows.len());
        let mut lost = 0;
        let at_once = self
            .plan
            .global()
            .then(|| self.attitudes(shot.t_s))
            .flatten();
        for opened in &shot.windows {
            let middle_s = shot.t_s + self.later_s(opened.corner);
            let attitude = at_once.or_else(|| self.attitudes(middle_s));
            let row = attitude
                .and_then(|q| self.read(shot, *opened, &q, middle_s, &velocity_m_s, traits));
            match row {
                Some(row) => rows.push(row),
                None => lost += 1,
            }
        }
        Frame {
            stamp_s: self
                .instrument
                .clock
                .stamp_s(shot.t_s, self.clock.with(shot.number)),
            q: self.solve(&rows),
            rows,
            lost,
        }
    }

    /// How much later than the row at y = 0 the middle of a window is exposed.
    fn later_s(&self, corner: [i32; 2]) -> f64 {
        let middle = 0.5 * (self.instrument.readout.window[1] as f64 - 1.0);
        self.instrument.shutter.row_time_s * row_y(&self.camera, corner, middle)
    }

    /// True attitudes over an exposure; none where the motion is not known throughout.
    fn attitudes(&self, middle_s: f64) -> Option<[UnitQuaternion<f64>; NODES]> {
        let mut all = [UnitQuaternion::identity(); NODES];
        for (q, after_s) in all.iter_mut().zip(self.plan.instants_s()) {
            *q = self.truth.attitude(middle_s + after_s)?;
        }
        Some(all)
    }

    fn read(
        &self,
        shot: &Shot,
        opened: Opened,
        attitude: &[UnitQuaternion<f64>; NODES],
        middle_s: f64,
        velocity_m_s: &Vector3<f64>,
        traits: &PixelTraits<'_>,
    ) -> Option<Row> {
        let instrument = self.instrument;
        let (readout, detector) = (&instrument.readout, &instrument.detector);
        let ([columns, rows], exposure_s) = (readout.window, instrument.shutter.exposure_s);
        let source = &self.sources[opened.source];
        let mut window = vec![0.0; columns * rows];
        let exposed = Exposed {
            plan: &self.plan,
            attitude,
            corner: opened.corner,
            columns,
        };
        let way = instrument
            .optics
            .way(&self.camera, source.bv, shot.optics_c);
        for light in &source.lights {
            let seen = aberrated(&light.direction, velocity_m_s);
            let electrons = light.flux * detector.electrons_s_mag0 * exposure_s;
            add_star(exposed, &self.camera, &way, &seen, electrons, &mut window);
        }
        let half = self.camera.half_size_px();
        let first = Pixel {
            x: f64::from(opened.corner[0]) + 0.5 - half[0],
            y: f64::from(opened.corner[1]) + 0.5 - half[1],
        };
        for (k, light) in window.iter_mut().enumerate() {
            let at = Pixel {
                x: first.x + (k % columns) as f64,
                y: first.y + (k / columns) as f64,
            };
            *light += instrument.background.e_s(&self.camera, at, shot.t_s) * exposure_s;
        }
        let place = Place {
            corner: opened.corner,
            columns,
            t_s: middle_s,
            exposure_s,
        };
        let mut rng = self
            .exposure
            .with(shot.number)
            .with(opened.slot as u64)
            .stream();
        detector.read_out(traits, place, &mut window, &mut rng);
        let background_dn = readout.background_dn(&window);
        let found = readout.centroid(&window, background_dn)?;
        let step = readout.position_step_px;
        let at = Pixel {
            x: stepped(first.x - 0.5 + found.x, step),
            y: stepped(first.y - 0.5 + found.y, step),
        };
        if !readout.images {
            window.clear();
        }
        Some(Row {
            slot: opened.slot,
            source: opened.source,
            at,
            flux_dn: found.flux,
            background_dn,
            first,
            window,
        })
    }

    /// The attitude that the tracker finds: it believes in a pinhole and in its catalogue.
    fn solve(&self, rows: &[Row]) -> Option<UnitQuaternion<f64>> {
        let seen: Vec<_> = rows
            .iter()
            .map(|row| self.camera.direction(row.at))
            .collect();
        let believed: Vec<_> = rows
            .iter()
            .map(|row| self.sources[row.source].believed)
            .collect();
        let q = quest::quest(&seen, &believed, &vec![1.0; rows.len()])
            .ok()?
            .q;
        let step = self.instrument.readout.quaternion_step;
        if step == 0.0 {
            return Some(q);
        }
        let [i, j, k, w] = [q.i, q.j, q.k, q.w].map(|part| stepped(part, step));
        Some(UnitQuaternion::new_normalize(Quaternion::new(w, i, j, k)))
    }
}

/// The nearest multiple of a step; a step of which 1 is a multiple gives the double nearest to the
/// decimal, which stays short in a file.
fn stepped(value: f64, step: f64) -> f64 {
    let per = (1.0 / step).round();
    if step == 0.0 {
        value
    } else if (per * step - 1.0).abs() < 1e-12 {
        (value * per).round() / per
    } else {
        (value / step).round() * step
    }
}
