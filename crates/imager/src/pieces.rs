//! Frames as tables of a bundle.
//!
//! Not physics: moving numbers into columns.

use std::collections::{BTreeMap, BTreeSet};

use focal_plane::{Catalogue, CatalogueStar, StarFrames};
use telemetry::{AttitudeTable, Bundle, Housekeeping, WindowTable};

use crate::random::Key;
use crate::sky::Source;
use crate::thermal::Temperatures;
use crate::tracker::{Frame, Row};
use crate::{ImagerError, Instrument};

/// What the tracker reports of some frames.
pub(crate) fn of_frames(frames: &[Frame], sources: &[Source], instrument: &Instrument) -> Bundle {
    let (mut stars, mut attitude) = (StarFrames::new(), AttitudeTable::default());
    let size = instrument.readout.window;
    let mut images = WindowTable {
        size,
        unread: vec![false; size[0] * size[1]],
        ..WindowTable::default()
    };
    for frame in frames {
        if !frame.rows.is_empty() {
            stars.begin(frame.stamp_s);
        }
        for row in &frame.rows {
            let id = sources[row.source].entry.id;
            stars.push_measured(slot(row), id, row.at.x, row.at.y, None, Some(row.flux_dn));
            if instrument.readout.images {
                images.t_s.push(frame.stamp_s);
                images.slot.push(slot(row));
                images.x0_px.push(row.first.x);
                images.y0_px.push(row.first.y);
                images.background.push(row.background_dn);
                images.pixels.extend_from_slice(&row.window);
            }
        }
        if let Some(q) = frame.q {
            attitude.t_s.push(frame.stamp_s);
            attitude.q.push(q);
        }
    }
    Bundle {
        stars: (stars.rows() > 0).then_some(stars),
        attitude: (!attitude.t_s.is_empty()).then_some(attitude),
        images: (!images.is_empty()).then_some(images),
        ..Bundle::default()
    }
}

fn slot(row: &Row) -> i32 {
    i32::try_from(row.slot).unwrap_or(i32::MAX)
}

/// The catalogue of the stars that were seen.
pub(crate) fn catalogue(
    seen: &BTreeSet<usize>,
    sources: &[Source],
    year: f64,
) -> Result<Catalogue, ImagerError> {
    let mut stars: Vec<CatalogueStar> = seen.iter().map(|&k| sources[k].entry).collect();
    stars.sort_by_key(|star| star.id);
    Ok(Catalogue::new(year, stars)?)
}

/// Samples of the housekeeping, forward in time.
#[derive(Clone, Debug)]
pub(crate) struct Sampler {
    key: Key,
    first_s: f64,
    step_s: f64,
    next: u64,
    /// Node of each sensor.
    nodes: Vec<usize>,
}

impl Sampler {
    pub(crate) fn new(
        instrument: &Instrument,
        key: Key,
        first_s: f64,
    ) -> Result<Self, ImagerError> {
        let thermal = &instrument.thermal;
        let node = |sensor: &crate::Sensor| thermal.index("thermal.sensor.node", &sensor.node);
        let step_s = 1.0 / thermal.rate_hz();
        Ok(Self {
            key,
            // one before the first frame: channels are never extrapolated
            first_s: first_s - step_s,
            step_s,
            next: 0,
            nodes: thermal.sensor.iter().map(node).collect::<Result<_, _>>()?,
        })
    }

    pub(crate) fn step_s(&self) -> f64 {
        self.step_s
    }

    /// All samples up to and with the first at or after `until_s`; none if nothing is sampled.
    pub(crate) fn until(
        &mut self,
        until_s: f64,
        instrument: &Instrument,
        temperatures: &Temperatures,
    ) -> Option<Housekeeping> {
        if self.nodes.is_empty() && !instrument.orbit.reported {
            return None;
        }
        let (mut t_s, mut channels) = (Vec::new(), BTreeMap::<String, Vec<f64>>::new());
        loop {
            let t = self.first_s + self.next as f64 * self.step_s;
            if t >= until_s + self.step_s {
                break;
            }
            t_s.push(t);
            let mut say =
                |name: &str, value: f64| channels.entry(name.to_owned()).or_default().push(value);
            for (k, sensor) in instrument.thermal.sensor.iter().enumerate() {
                let key = self.key.with(self.next).with(k as u64);
                say(
                    &sensor.channel,
                    sensor.reads(temperatures, self.nodes[k], t, key),
                );
            }
            if instrument.orbit.reported {
                let v = instrument.orbit.velocity_km_s(t);
                say("vx_km_s", v.x);
                say("vy_km_s", v.y);
                say("vz_km_s", v.z);
            }
            self.next += 1;
        }
        (!t_s.is_empty()).then_some(Housekeeping { t_s, channels })
    }
}
