//! Model and bundle joined: camera, channels, reference, catalogue.
//!
//! Not physics: bookkeeping.

use std::collections::BTreeMap;

use effects::{FrameGeometry, Surroundings, VectorFrame};
use focal_plane::{AttitudeSeries, Camera, Series};
use telemetry::{Bundle, Model, WindowTable};

use crate::error::CloseError;
use crate::motion::gyro::with_rates;
use crate::questions::hypothesis::Questions;
use crate::star::data::Star;

/// Focal lengths that differ by more than this share are different trackers;
/// rounded numbers in files differ by less.
const FOCAL_TOLERANCE: f64 = 2e-3;

/// What the loop works on.
#[derive(Clone, Debug)]
pub(crate) struct Situation<'a> {
    pub(crate) model: &'a Model,
    pub(crate) bundle: &'a Bundle,
    pub(crate) camera: Camera,
    pub(crate) channels: BTreeMap<String, Series>,
    pub(crate) frames: Option<FrameGeometry>,
    pub(crate) reference: Option<AttitudeSeries>,
    /// Raw windows, as long as centroids may be formed from them.
    pub(crate) windows: Option<&'a WindowTable>,
    /// Effects that are to be tested by name.
    pub(crate) questions: &'a Questions,
    /// Year at which catalogue directions are wanted.
    year: f64,
    span_s: [f64; 2],
}

impl<'a> Situation<'a> {
    pub(crate) fn join(
        model: &'a Model,
        bundle: &'a Bundle,
        questions: &'a Questions,
    ) -> Result<Self, CloseError> {
        let t_s = bundle
            .stars
            .as_ref()
            .map(|s| &s.t_s)
            .or(bundle.attitude.as_ref().map(|a| &a.t_s))
            .ok_or(CloseError::NothingToCompare(
                "the bundle has neither stars nor attitude",
            ))?;
        let span_s = [
            t_s.first().copied().unwrap_or(0.0),
            t_s.last().copied().unwrap_or(0.0),
        ];
        let mut channels = BTreeMap::new();
        if let Some(housekeeping) = &bundle.housekeeping {
            for (name, values) in &housekeeping.channels {
                if let Ok(series) = Series::new(housekeeping.t_s.clone(), values.clone()) {
                    channels.insert(name.clone(), series);
                }
            }
        }
        Ok(Self {
            model,
            bundle,
            camera: camera(model, bundle)?,
            channels,
            frames: bundle.meta.frames.as_ref().map(|f| FrameGeometry {
                tracker_boresight: f.tracker_boresight,
                reference_boresight: f.reference_boresight,
                vectors_in: match f.vectors_in {
                    Some(telemetry::VectorFrame::Inertial) => VectorFrame::Inertial,
                    Some(telemetry::VectorFrame::Tracker) => VectorFrame::Tracker,
                    Some(telemetry::VectorFrame::Body) | None => VectorFrame::Body,
                },
                quaternion_signs: f.quaternion_signs.known(),
            }),
            reference: reference(bundle),
            windows: bundle.images.as_ref(),
            questions,
            year: bundle
                .meta
                .julian_year(0.5 * (span_s[0] + span_s[1]))
                .unwrap_or(2000.0),
            span_s,
        })
    }

    /// The same under another model of the same tracker.
    pub(crate) fn believing<'b>(&'b self, model: &'b Model) -> Situation<'b> {
        Situation {
            model,
            ..self.clone()
        }
    }

    /// The same as if no windows had been sent.
    pub(crate) fn without_windows(&self) -> Self {
        Self {
            windows: None,
            ..self.clone()
        }
    }

    /// What effects may look at.
    pub(crate) fn surroundings(&self) -> Surroundings<'_> {
        Surroundings {
            camera: &self.camera,
            span_s: self.span_s,
            channels: &self.channels,
            frames: self.frames,
        }
    }

    /// A star of the catalogue at the epoch of the data.
    pub(crate) fn star(&self, id: i64) -> Option<Star> {
        let catalogue = self.bundle.catalog.as_ref()?;
        let index = catalogue.index_of(id)?;
        let star = &catalogue.stars()[index];
        Some(Star {
            id,
            mag: star.mag,
            bv: star.bv,
            direction: catalogue.direction_at(index, self.year),
        })
    }

    /// The exposure, the model's before the bundle's.
    pub(crate) fn exposure_s(&self) -> Option<f64> {
        self.model
            .tracker
            .exposure_s
            .or(self.bundle.meta.tracker.exposure_s)
    }
}

/// Channels that an empirical term may follow.
pub(crate) fn channels_of_interest(
    channels: &BTreeMap<String, Series>,
) -> impl Iterator<Item = (String, &Series)> {
    channels
        .iter()
        .filter(|(name, _)| !["vx_", "vy_", "vz_"].iter().any(|v| name.starts_with(v)))
        .map(|(name, series)| (name.clone(), series))
}

/// The better estimate as a series, with its rates or the gyro's.
fn reference(bundle: &Bundle) -> Option<AttitudeSeries> {
    let series = bundle.reference.as_ref()?.series_with_gaps().ok()?;
    Some(with_rates(series, bundle.rates.as_ref()))
}

/// The camera of the model; what it leaves out is the bundle's. What both give has to agree.
fn camera(model: &Model, bundle: &Bundle) -> Result<Camera, CloseError> {
    let camera = model.camera_over(&bundle.meta.tracker)?;
    let camera = camera.or_else(|| bundle.camera.clone());
    let camera = camera.ok_or(CloseError::NoCamera)?;
    let Some(measured) = &bundle.camera else {
        return Ok(camera);
    };
    for axis in 0..2 {
        let (a, b) = (camera.pixels()[axis], measured.pixels()[axis]);
        if a != b {
            return Err(CloseError::TrackersDiffer {
                what: "the number of pixels",
                model: f64::from(a),
                bundle: f64::from(b),
            });
        }
        let (a, b) = (
            camera.focal_length_px()[axis],
            measured.focal_length_px()[axis],
        );
        if (a / b - 1.0).abs() > FOCAL_TOLERANCE {
            return Err(CloseError::TrackersDiffer {
                what: "the focal length, px,",
                model: a,
                bundle: b,
            });
        }
    }
    Ok(camera)
}
