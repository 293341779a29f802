//! Catalogue position: one star is not where the catalogue says.
//!
//! ```text
//! u' = u + east e + north n, normalised          true minus catalogue; e = z x u / |z x u|, n = u x e
//! columns: the shift of P for a change of direction q e, q n, per arcsec
//! ```
//!
//! Proper motion since the catalogue's epoch, an unresolved double, a wrong identity. `east_arcsec` is
//! delta alpha cos delta. At the poles of the equator, where east has no meaning, e = x.
//!
//! Source: local tangent frame of spherical astronomy.

use std::collections::BTreeMap;

use focal_plane::{ARCSEC_PER_RAD, Camera, PointsMut, VectorsMut};
use nalgebra::Vector3;
use star_tracker::{Disturbance, Stages, StarView};

use crate::candidate::check_columns;
use crate::parameters::Reader;
use crate::path::Held;
use crate::velocity_aberration::moved_px;
use crate::{
    ActsOn, AttitudeRows, Candidate, Coefficient, Effect, EffectError, EffectKind, Parameter,
    Parameters, Scene, StarFacts, StarRows, Surroundings,
};

const ID: &str = "catalogue_position";

/// Error of one star that would not surprise, arcsec.
const PLAUSIBLE_ARCSEC: f64 = 10.0;

/// Stars of which each is tried by itself. The products of all columns grow with the square of their
/// number: a tracker that spins past 1298 stars would need 14 GB for stars that it saw four times each.
const MOST_STARS: usize = 64;

/// The kind.
#[derive(Debug)]
pub(crate) struct Kind;

impl EffectKind for Kind {
    fn id(&self) -> &'static str {
        ID
    }
    fn summary(&self) -> &'static str {
        "one star is not where the catalogue says"
    }
    fn needs(&self) -> &'static str {
        "stars and a catalogue"
    }
    fn acts_on(&self) -> ActsOn {
        ActsOn {
            stars: true,
            ..ActsOn::default()
        }
    }
    fn build(
        &self,
        parameters: &Parameters,
        _: &Surroundings<'_>,
    ) -> Result<Box<dyn Effect>, EffectError> {
        let known = ["star_id", "east_arcsec", "north_arcsec"];
        let reader = Reader::new(ID, parameters, &known)?;
        let star_id = reader.integer("star_id")?;
        let [east_arcsec, north_arcsec] = reader.axes(["east_arcsec", "north_arcsec"])?;
        Ok(Box::new(CataloguePosition {
            star_id,
            east_arcsec,
            north_arcsec,
        }))
    }
    fn candidates(&self, scene: &Scene<'_>) -> Vec<Box<dyn Candidate>> {
        if !(scene.has_stars && scene.has_catalogue) {
            return Vec::new();
        }
        let coefficients = ["east_arcsec", "north_arcsec"]
            .map(|name| Coefficient::new(name, "arcsec", PLAUSIBLE_ARCSEC));
        let mut stars: Vec<&StarFacts> = scene.stars.iter().collect();
        let stands_for = if stars.len() > MOST_STARS {
            // the order of those that are left is that of the list
            let mut ranked: Vec<(f64, usize)> =
                stars.iter().map(|s| s.remarkable).zip(0..).collect();
            ranked.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
            ranked.truncate(MOST_STARS);
            ranked.sort_by_key(|(_, at)| *at);
            stars = ranked.into_iter().map(|(_, at)| stars[at]).collect();
            scene.stars.len() as f64 / MOST_STARS as f64
        } else {
            1.0
        };
        stars
            .into_iter()
            .map(|star| {
                let coefficients = coefficients.clone();
                Box::new(PositionCandidate {
                    star_id: star.star_id,
                    coefficients,
                    stands_for,
                }) as Box<dyn Candidate>
            })
            .collect()
    }
}

/// East and north at a direction.
fn east_north(u: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let east = Vector3::z()
        .cross(u)
        .try_normalize(1e-12)
        .unwrap_or_else(Vector3::x);
    [east, u.cross(&east)]
}

#[derive(Clone, Debug)]
struct CataloguePosition {
    star_id: i64,
    east_arcsec: f64,
    north_arcsec: f64,
}

impl Disturbance for CataloguePosition {
    fn stages(&self) -> Stages {
        Stages {
            direction: true,
            ..Stages::NONE
        }
    }
    fn direction(&self, star: &StarView, u: Vector3<f64>) -> Vector3<f64> {
        if star.star_id != self.star_id {
            return u;
        }
        let [east, north] = east_north(&u);
        (u + (east * self.east_arcsec + north * self.north_arcsec) / ARCSEC_PER_RAD).normalize()
    }
}

impl Effect for CataloguePosition {
    fn id(&self) -> &'static str {
        ID
    }
    fn parameters(&self) -> Vec<Parameter> {
        vec![
            Parameter::new("east_arcsec", self.east_arcsec, "arcsec"),
            Parameter::new("north_arcsec", self.north_arcsec, "arcsec"),
        ]
    }
    fn selectors(&self) -> BTreeMap<String, String> {
        BTreeMap::from([("star_id".to_owned(), self.star_id.to_string())])
    }
}

#[derive(Clone, Debug)]
struct PositionCandidate {
    star_id: i64,
    coefficients: [Coefficient; 2],
    /// How many stars that were looked at it is proposed for.
    stands_for: f64,
}

impl Candidate for PositionCandidate {
    fn id(&self) -> &'static str {
        ID
    }
    fn selectors(&self) -> BTreeMap<String, String> {
        BTreeMap::from([("star_id".to_owned(), self.star_id.to_string())])
    }
    fn coefficients(&self) -> &[Coefficient] {
        &self.coefficients
    }
    fn stands_for(&self) -> f64 {
        self.stands_for
    }
    fn acts_on_stars(&self) -> bool {
        true
    }
    fn acts_on_attitude(&self) -> bool {
        false
    }
    fn star_columns(&self, camera: &Camera, rows: &StarRows<'_>, out: PointsMut<'_>) -> bool {
        let n = rows.len();
        check_columns(2, n, out.x.len());
        let Some(source) = rows.attitude else {
            return false;
        };
        let mut attitude = Held::new(source);
        out.x.fill(0.0);
        out.y.fill(0.0);
        for i in (0..n).filter(|&i| rows.star_id[i] == self.star_id) {
            let Some(q) = attitude.at(rows.t_s[i]) else {
                continue;
            };
            let u = q.inverse() * camera.direction(rows.at(i));
            for (j, direction) in east_north(&u).into_iter().enumerate() {
                let [dx, dy] = moved_px(camera, rows.at(i), &(q * direction / ARCSEC_PER_RAD));
                out.x[j * n + i] = dx;
                out.y[j * n + i] = dy;
            }
        }
        true
    }
    fn attitude_columns(&self, _: &AttitudeRows<'_>, _: VectorsMut<'_>) -> bool {
        false
    }
    fn realise(
        &self,
        values: &[f64],
        _: &Surroundings<'_>,
    ) -> Result<Box<dyn Effect>, EffectError> {
        assert_eq!(values.len(), 2, "one value per coefficient");
        let [east_arcsec, north_arcsec] = [values[0], values[1]];
        Ok(Box::new(CataloguePosition {
            star_id: self.star_id,
            east_arcsec,
            north_arcsec,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::harness::Bench;

    /// Of 200 stars the 64 most remarkable are tried, in the order of the list, and each pays for 200/64; of
    /// the bench's dozen all are.
    #[test]
    fn of_many_stars_the_most_remarkable_are_tried() {
        let bench = Bench::new();
        let few = Kind.candidates(&bench.scene(None));
        assert_eq!(few.len(), 12);
        assert!(few.iter().all(|c| c.stands_for() <= 1.0));
        let many: Vec<StarFacts> = (0..200)
            .map(|k| StarFacts {
                star_id: k,
                mag: 5.0,
                bv: 0.5,
                remarkable: f64::from((37 * i32::try_from(k).unwrap()) % 200),
            })
            .collect();
        let scene = Scene {
            stars: &many,
            ..bench.scene(None)
        };
        let tried = Kind.candidates(&scene);
        let ids: Vec<i64> = tried
            .iter()
            .map(|c| c.selectors()["star_id"].parse().unwrap())
            .collect();
        let expected: Vec<i64> = (0..200).filter(|k| (37 * k) % 200 >= 136).collect();
        assert_eq!(ids, expected);
        assert!(tried.iter().all(|c| (c.stands_for() - 3.125).abs() < 1e-12));
    }
}
