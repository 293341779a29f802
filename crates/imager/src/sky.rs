//! Real stars: which the tracker follows, where they are, and what it does not know of them.
//!
//! ```text
//! direction = catalogue direction at the epoch, moved east and north where the catalogue is wrong
//! seen      = (direction + v/c) / |...|
//! ```
//!
//! A slot keeps its star until it leaves the field; then the brightest star in the field that no slot has
//! takes it. Stars with a neighbour too near for one window are never followed.
//!
//! Source: [M23] Section 2.6, Step 1, for a catalogue of real stars.

use focal_plane::{Angle, Camera, Catalogue, CatalogueStar, Pixel};
use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::ImagerError;

/// `[stars]`
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Stars {
    /// Followed at once; default 14.
    pub followed: usize,
    /// Faintest followed, mag; default 5.5.
    pub limiting_mag: f64,
    /// Brightest followed, mag; default -2.
    pub brightest_mag: f64,
    /// Stars nearer to the edge of the detector are dropped, px; default 8.
    pub margin_px: f64,
    /// Stars nearer than this to another of the catalogue are not followed, px; default 12.
    pub separation_px: f64,
    /// Companions that no catalogue has.
    pub companion: Vec<Companion>,
    /// Stars that are not where the catalogue has them.
    pub misplaced: Vec<Misplaced>,
}

impl Default for Stars {
    fn default() -> Self {
        Self {
            followed: 14,
            limiting_mag: 5.5,
            brightest_mag: -2.0,
            margin_px: 8.0,
            separation_px: 12.0,
            companion: Vec::new(),
            misplaced: Vec::new(),
        }
    }
}

/// `[[stars.companion]]`: a second star in the same window.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Companion {
    /// The star it belongs to.
    pub star_id: i64,
    /// Distance, arcsec.
    pub separation_arcsec: f64,
    /// Direction from north over east, deg.
    pub position_angle_deg: f64,
    /// Magnitudes fainter than its star.
    pub fainter_mag: f64,
}

/// `[[stars.misplaced]]`: true place minus catalogue.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Misplaced {
    /// The star.
    pub star_id: i64,
    /// Towards east, arcsec.
    pub east_arcsec: f64,
    /// Towards north, arcsec.
    pub north_arcsec: f64,
}

/// One light in a window.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Light {
    /// True direction, inertial, without aberration.
    pub(crate) direction: Vector3<f64>,
    /// Photo-electrons over those of magnitude 0.
    pub(crate) flux: f64,
}

/// A star that may be followed.
#[derive(Clone, Debug)]
pub(crate) struct Source {
    /// As the catalogue has it.
    pub(crate) entry: CatalogueStar,
    /// Where the tracker believes it to be, inertial.
    pub(crate) believed: Vector3<f64>,
    pub(crate) bv: f64,
    /// The star, and its companions.
    pub(crate) lights: Vec<Light>,
}

impl Stars {
    pub(crate) fn check(&self) -> Result<(), ImagerError> {
        let followed = self.followed as f64;
        ImagerError::check("stars.followed", followed, self.followed >= 1, "at least 1")?;
        ImagerError::finite("stars.limiting_mag", self.limiting_mag)?;
        ImagerError::finite("stars.brightest_mag", self.brightest_mag)?;
        ImagerError::not_negative("stars.margin_px", self.margin_px)?;
        ImagerError::not_negative("stars.separation_px", self.separation_px)?;
        for c in &self.companion {
            ImagerError::not_negative("stars.companion.separation_arcsec", c.separation_arcsec)?;
            ImagerError::finite("stars.companion", c.position_angle_deg + c.fainter_mag)?;
        }
        for m in &self.misplaced {
            ImagerError::finite("stars.misplaced", m.east_arcsec + m.north_arcsec)?;
        }
        Ok(())
    }

    /// The stars that may be followed, brightest first.
    pub(crate) fn sources(
        &self,
        catalogue: &Catalogue,
        year: f64,
        camera: &Camera,
    ) -> Result<Vec<Source>, ImagerError> {
        let known = |name, id| match catalogue.index_of(id) {
            Some(_) => Ok(()),
            None => Err(ImagerError::NoStar { name, id }),
        };
        for c in &self.companion {
            known("stars.companion.star_id", c.star_id)?;
        }
        for m in &self.misplaced {
            known("stars.misplaced.star_id", m.star_id)?;
        }
        let directions = catalogue.directions_at(year);
        let alone = alone(
            &directions,
            self.separation_px / camera.focal_length_px()[0],
        );
        let wanted = |mag: f64| mag >= self.brightest_mag && mag <= self.limiting_mag;
        let stars = catalogue.stars().iter().enumerate();
        let mut sources: Vec<Source> = stars
            .filter(|&(k, star)| alone[k] && wanted(star.mag))
            .map(|(k, star)| self.source(star, directions[k]))
            .collect();
        sources.sort_by(|a, b| {
            (a.entry.mag.total_cmp(&b.entry.mag)).then(a.entry.id.cmp(&b.entry.id))
        });
        Ok(sources)
    }

    fn source(&self, star: &CatalogueStar, believed: Vector3<f64>) -> Source {
        let east = Vector3::z().cross(&believed);
        let east = if east.norm() > 0.0 {
            east.normalize()
        } else {
            Vector3::y()
        };
        let north = believed.cross(&east);
        let moved = |from: Vector3<f64>, e_arcsec: f64, n_arcsec: f64| {
            let rad = |arcsec: f64| Angle::from_arcsec(arcsec).rad();
            (from + east * rad(e_arcsec) + north * rad(n_arcsec)).normalize()
        };
        let mut direction = believed;
        for m in self.misplaced.iter().filter(|m| m.star_id == star.id) {
            direction = moved(direction, m.east_arcsec, m.north_arcsec);
        }
        let flux = |mag: f64| 10_f64.powf(-0.4 * mag);
        let mut lights = vec![Light {
            direction,
            flux: flux(star.mag),
        }];
        for c in self.companion.iter().filter(|c| c.star_id == star.id) {
            let (sin, cos) = c.position_angle_deg.to_radians().sin_cos();
            lights.push(Light {
                direction: moved(
                    direction,
                    c.separation_arcsec * sin,
                    c.separation_arcsec * cos,
                ),
                flux: flux(star.mag + c.fainter_mag),
            });
        }
        Source {
            entry: *star,
            believed,
            bv: star.bv,
            lights,
        }
    }
}

/// Whether no other star is within `radius_rad`: stars sorted along z, each against those next to it.
fn alone(directions: &[Vector3<f64>], radius_rad: f64) -> Vec<bool> {
    let mut order: Vec<usize> = (0..directions.len()).collect();
    order.sort_by(|&a, &b| directions[a].z.total_cmp(&directions[b].z));
    let mut alone = vec![true; directions.len()];
    for (k, &a) in order.iter().enumerate() {
        for &b in &order[k + 1..] {
            if directions[b].z - directions[a].z > radius_rad {
                break;
            }
            if (directions[a] - directions[b]).norm() < radius_rad {
                alone[a] = false;
                alone[b] = false;
            }
        }
    }
    alone
}

/// Which star each slot follows.
#[derive(Clone, Debug)]
pub(crate) struct Selection {
    /// Index into the sources.
    pub(crate) slots: Vec<Option<usize>>,
}

impl Selection {
    pub(crate) fn new(followed: usize) -> Self {
        Self {
            slots: vec![None; followed],
        }
    }

    /// Drops stars that left and fills free slots; returns the believed place of each slot's star.
    pub(crate) fn update(
        &mut self,
        sources: &[Source],
        camera: &Camera,
        q: &UnitQuaternion<f64>,
        margin_px: f64,
        places: &mut Vec<Option<Pixel>>,
    ) {
        let half = camera.half_size_px();
        let inside = |k: usize| {
            let p = camera.project(&(q * sources[k].believed))?;
            (p.x.abs() <= half[0] - margin_px && p.y.abs() <= half[1] - margin_px).then_some(p)
        };
        places.clear();
        for slot in &mut self.slots {
            let place = slot.and_then(inside);
            if place.is_none() {
                *slot = None;
            }
            places.push(place);
        }
        let mut free = (0..self.slots.len())
            .filter(|&s| places[s].is_none())
            .collect::<Vec<_>>();
        free.reverse();
        if free.is_empty() {
            return;
        }
        let boresight = q.inverse() * Vector3::z();
        let focal = camera.focal_length_px();
        let edge = (half[0] / focal[0]).hypot(half[1] / focal[1]).atan().cos();
        for (k, source) in sources.iter().enumerate() {
            if source.believed.dot(&boresight) < edge || self.slots.contains(&Some(k)) {
                continue;
            }
            if let Some(place) = inside(k) {
                let Some(slot) = free.pop() else { break };
                self.slots[slot] = Some(k);
                places[slot] = Some(place);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn star(id: i64, ra_deg: f64, dec_deg: f64, mag: f64) -> CatalogueStar {
        CatalogueStar {
            id,
            ra_deg,
            dec_deg,
            mag,
            ..CatalogueStar::default()
        }
    }

    /// Two stars 2 px apart fall out, the brightest comes first, and a companion lies where its angle says.
    #[test]
    fn neighbours_fall_out_and_companions_come_in() {
        let stars = vec![
            star(1, 10.0, 0.0, 4.0),
            star(2, 10.04, 0.0, 5.0),
            star(3, 12.0, 1.0, 3.0),
            star(4, 13.0, 1.0, 2.0),
        ];
        let catalogue = Catalogue::new(2000.0, stars).unwrap();
        let settings = Stars {
            companion: vec![Companion {
                star_id: 3,
                separation_arcsec: 20.0,
                position_angle_deg: 90.0,
                fainter_mag: 2.5,
            }],
            ..Stars::default()
        };
        let camera = crate::Optics::default().camera().unwrap();
        let sources = settings.sources(&catalogue, 2000.0, &camera).unwrap();
        let ids: Vec<i64> = sources.iter().map(|s| s.entry.id).collect();
        assert_eq!(ids, [4, 3]);
        let lights = &sources[1].lights;
        assert!((lights[1].flux / lights[0].flux - 0.1).abs() < 1e-12);
        let (ra, dec) = focal_plane::ra_dec(&lights[1].direction);
        // east at declination 1 deg; curvature of the small circle, 20^2/2 arcsec^2/rad, is 1e-5 arcsec
        let east = (ra.deg() - 12.0) * 3600.0 * 1_f64.to_radians().cos();
        assert!((east - 20.0).abs() < 1e-3 && (dec.deg() - 1.0).abs() * 3600.0 < 1e-3);
    }

    /// A star that leaves hands its slot over to the brightest that is free, and the others stay.
    #[test]
    fn slots_are_handed_over() {
        let stars = (0..6)
            .map(|k| star(k, 4.0 * k as f64, 0.0, 1.0 + 0.1 * k as f64))
            .collect();
        let catalogue = Catalogue::new(2000.0, stars).unwrap();
        let settings = Stars {
            followed: 3,
            ..Stars::default()
        };
        let camera = crate::Optics::default().camera().unwrap();
        let sources = settings.sources(&catalogue, 2000.0, &camera).unwrap();
        // boresight in the x-y plane, x to the east: at right ascension a the rows are north
        let look = |ra_deg: f64| {
            let a = ra_deg.to_radians();
            let axes = nalgebra::Matrix3::new(
                -a.sin(),
                a.cos(),
                0.0,
                0.0,
                0.0,
                1.0,
                a.cos(),
                a.sin(),
                0.0,
            );
            UnitQuaternion::from_matrix(&axes)
        };
        let mut selection = Selection::new(3);
        let mut places = Vec::new();
        selection.update(&sources, &camera, &look(4.0), 8.0, &mut places);
        assert_eq!(selection.slots, [Some(0), Some(1), Some(2)]);
        assert!(places[1].unwrap().x.abs() < 1e-9);
        selection.update(&sources, &camera, &look(12.0), 8.0, &mut places);
        assert_eq!(selection.slots, [Some(3), Some(1), Some(2)]);
    }
}
