//! Which stars the tracker follows: `[sky]`.
//!
//! Either real stars, bright first and kept until they leave the field, or generated ones with the
//! replacement rule of [M23] Step 1. Every star's direction is that of its entry in the bundle's
//! catalogue: the table is the truth, unless an effect says otherwise.
//!
//! Source: [M23] Section 2.6, Step 1.

mod hipparcos;

use std::collections::BTreeMap;

use focal_plane::{AttitudeSource, Camera, Catalogue, CatalogueStar, StarFrames, ra_dec};
use rand_core::Rng;
use serde::Deserialize;
use star_tracker::{CatalogueTracking, FieldStar, StarField};

use crate::ScenarioError;

pub use hipparcos::hipparcos;

/// Stars that fit in a tracker whose model does not say how many it follows: `[M23]` Table 1.
const STARS: u32 = 15;

/// Julian year of the catalogue in a simulated bundle.
pub(crate) const CATALOGUE_YEAR: f64 = 2000.0;

/// `[sky]`, told apart by `kind`; without the table, real stars.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
#[non_exhaustive]
pub enum Sky {
    /// `hipparcos`: the stars of the Hipparcos catalogue brighter than Hp = 6.5.
    Hipparcos(HipparcosSky),
    /// `generated`: made-up stars, replaced as in `[M23]` Step 1.
    Generated(GeneratedSky),
}

impl Default for Sky {
    fn default() -> Self {
        Self::Hipparcos(HipparcosSky::default())
    }
}

/// `kind = "hipparcos"`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HipparcosSky {
    /// Stars followed at once; default `max_stars` of `[tracker]`, else 15.
    pub stars: Option<u32>,
    /// Faintest star, magnitudes Hp; default 6.5, the limit of the catalogue.
    pub limiting_mag: f64,
    /// Stars nearer to the edge of the detector than this are dropped, px; default 4.
    pub margin_px: f64,
}

impl Default for HipparcosSky {
    fn default() -> Self {
        Self {
            stars: None,
            limiting_mag: 6.5,
            margin_px: 4.0,
        }
    }
}

/// `kind = "generated"`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GeneratedSky {
    /// Stars followed at once; default `max_stars` of `[tracker]`, else 15.
    pub stars: Option<u32>,
}

/// The stars of every frame.
#[derive(Clone, Debug)]
pub(crate) struct Seen {
    /// Rows without positions.
    pub(crate) frames: StarFrames,
    /// True inertial direction of each row: x, y, z.
    pub(crate) direction: [Vec<f64>; 3],
    /// Magnitude of each row.
    pub(crate) mag: Vec<f64>,
    /// Colour of each row.
    pub(crate) bv: Vec<f64>,
    /// Every star of the run, by id.
    pub(crate) catalogue: Catalogue,
}

impl Seen {
    /// Frames that nobody looks into.
    pub(crate) fn without_stars(t_s: &[f64]) -> Result<Self, ScenarioError> {
        let mut frames = StarFrames::default();
        for &t in t_s {
            frames.begin(t);
        }
        Ok(Self {
            frames,
            direction: [const { Vec::new() }; 3],
            mag: Vec::new(),
            bv: Vec::new(),
            catalogue: Catalogue::new(CATALOGUE_YEAR, Vec::new())?,
        })
    }
}

impl Sky {
    /// Follows the truth through all frames.
    ///
    /// # Errors
    /// Fewer than two generated stars.
    pub(crate) fn follow<R: Rng + ?Sized>(
        &self,
        camera: &Camera,
        truth: &dyn AttitudeSource,
        t_s: &[f64],
        max_stars: Option<u32>,
        year: f64,
        rng: &mut R,
    ) -> Result<Seen, ScenarioError> {
        match self {
            Self::Hipparcos(sky) => {
                let catalogue = hipparcos(CATALOGUE_YEAR)?;
                let stars = sky.stars.or(max_stars).unwrap_or(STARS) as usize;
                ScenarioError::check_finite("sky.limiting_mag", sky.limiting_mag)?;
                ScenarioError::check_not_negative("sky.margin_px", sky.margin_px)?;
                let mut tracking = CatalogueTracking::new(
                    &catalogue,
                    year,
                    stars,
                    sky.limiting_mag,
                    sky.margin_px,
                );
                let mut seen = Rows::default();
                for &t in t_s {
                    seen.frames.begin(t);
                    let Some(q) = truth.attitude(t) else { continue };
                    tracking.update(camera, &q);
                    for (slot, star) in tracking.stars() {
                        seen.push(slot, &star);
                    }
                }
                let entry = |id: i64| catalogue.index_of(id).map(|i| catalogue.stars()[i]);
                seen.with_catalogue(|id, _| entry(id))
            }
            Self::Generated(sky) => {
                let stars = sky.stars.or(max_stars).unwrap_or(STARS) as usize;
                let mut field: Option<StarField> = None;
                let mut seen = Rows::default();
                for &t in t_s {
                    seen.frames.begin(t);
                    let Some(q) = truth.attitude(t) else { continue };
                    let field = match &mut field {
                        Some(field) => {
                            field.update(camera, &q, rng);
                            field
                        }
                        none => none.insert(StarField::generate(camera, &q, stars, rng)?),
                    };
                    for (slot, star) in (0_i32..).zip(field.stars()) {
                        seen.push(slot, star);
                    }
                }
                seen.with_catalogue(|_, star| Some(generated_entry(star)))
            }
        }
    }
}

/// Rows as they are collected.
#[derive(Default)]
struct Rows {
    frames: StarFrames,
    direction: [Vec<f64>; 3],
    mag: Vec<f64>,
    bv: Vec<f64>,
    stars: BTreeMap<i64, FieldStar>,
}

impl Rows {
    fn push(&mut self, slot: i32, star: &FieldStar) {
        self.frames.push(slot, star.id, f64::NAN, f64::NAN);
        for (column, value) in self.direction.iter_mut().zip(star.direction.iter()) {
            column.push(*value);
        }
        self.mag.push(star.mag);
        self.bv.push(star.bv);
        self.stars.entry(star.id).or_insert(*star);
    }

    fn with_catalogue(
        self,
        entry: impl Fn(i64, &FieldStar) -> Option<CatalogueStar>,
    ) -> Result<Seen, ScenarioError> {
        if self.stars.is_empty() {
            return Err(ScenarioError::NothingSeen {
                frames: self.frames.frames(),
            });
        }
        let entries = self
            .stars
            .iter()
            .filter_map(|(&id, star)| entry(id, star))
            .collect();
        Ok(Seen {
            frames: self.frames,
            direction: self.direction,
            mag: self.mag,
            bv: self.bv,
            catalogue: Catalogue::new(CATALOGUE_YEAR, entries)?,
        })
    }
}

/// A generated star as a catalogue knows it: it does not move.
fn generated_entry(star: &FieldStar) -> CatalogueStar {
    let (ra, dec) = ra_dec(&star.direction);
    CatalogueStar {
        id: star.id,
        ra_deg: ra.deg(),
        dec_deg: dec.deg(),
        mag: star.mag,
        bv: star.bv,
        ..CatalogueStar::default()
    }
}
