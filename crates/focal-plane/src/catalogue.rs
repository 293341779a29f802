//! A star catalogue and the motion of its stars.
//!
//! ```text
//! u(t) = (u0 + (mu_ra e + mu_dec n) (t - t0)) / |...|
//! e = (-sin ra, cos ra, 0),   n = (-sin dec cos ra, -sin dec sin ra, cos dec)
//! ```
//!
//! `mu_ra` already carries cos dec; years are Julian (365.25 d). The motion is uniform in space with
//! the radial velocity left out: for Barnard's star, whose motion is the fastest, that is worth
//! 0.05 arcsec after 9 years and 0.5 arcsec after 27; for any star a tracker follows, far less.
//! Unlike a linear change of ra and dec it is right at the poles.
//!
//! Source: ESA SP-1200 (The Hipparcos and Tycho Catalogues), vol. 1, section 1.2.8, with zero
//! radial velocity.

use nalgebra::Vector3;

use crate::{ARCSEC_PER_RAD, Angle, unit_vector};

/// Why a catalogue cannot be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CatalogueError {
    /// The epoch is no number.
    #[error("epoch {year} is not a finite year")]
    Epoch {
        /// The value given, Julian years.
        year: f64,
    },
    /// Two stars share an id.
    #[error("star {id} is in the catalogue twice, at {first} and {second}")]
    DuplicateId {
        /// The id.
        id: i64,
        /// Index of its first star.
        first: usize,
        /// Index of its second star.
        second: usize,
    },
    /// A value outside its range.
    #[error("star {id}: {name} = {value} is outside {range}")]
    OutOfRange {
        /// The star.
        id: i64,
        /// The quantity.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What is allowed.
        range: &'static str,
    },
}

/// One star at the epoch of its catalogue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CatalogueStar {
    /// Identifier, unique in the catalogue.
    pub id: i64,
    /// Right ascension, deg, 0 to 360.
    pub ra_deg: f64,
    /// Declination, deg, -90 to 90.
    pub dec_deg: f64,
    /// Magnitude.
    pub mag: f64,
    /// Colour index B-V, mag; NaN if unknown.
    pub bv: f64,
    /// Proper motion in right ascension times cos dec, mas per Julian year.
    pub pm_ra_mas_yr: f64,
    /// Proper motion in declination, mas per Julian year.
    pub pm_dec_mas_yr: f64,
    /// Parallax, mas; 0 if unknown. Measured values may be negative.
    pub parallax_mas: f64,
}

impl Default for CatalogueStar {
    /// All zero but the colour, which is unknown.
    fn default() -> Self {
        Self {
            id: 0,
            ra_deg: 0.0,
            dec_deg: 0.0,
            mag: 0.0,
            bv: f64::NAN,
            pm_ra_mas_yr: 0.0,
            pm_dec_mas_yr: 0.0,
            parallax_mas: 0.0,
        }
    }
}

/// Stars of one epoch, checked, in the order given.
///
/// ```
/// use focal_plane::{Angle, Catalogue, CatalogueStar, ra_dec};
/// let barnard = CatalogueStar {
///     id: 87937, ra_deg: 269.454_023, dec_deg: 4.668_288, mag: 9.54, bv: 1.57,
///     pm_ra_mas_yr: -797.84, pm_dec_mas_yr: 10_326.93, parallax_mas: 549.01,
/// };
/// let catalogue = Catalogue::new(1991.25, vec![barnard])?;
/// let (_, dec) = ra_dec(&catalogue.direction_at(0, 2018.5));
/// assert!((dec.deg() - 4.668_288 - 27.25 * 10.326_93 / 3600.0).abs() < 1e-6);
/// # Ok::<(), focal_plane::CatalogueError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Catalogue {
    epoch_year: f64,
    stars: Vec<CatalogueStar>,
    /// At the epoch.
    direction: Vec<Vector3<f64>>,
    /// Change of the direction, rad per year, in the tangent plane at the epoch.
    motion: Vec<Vector3<f64>>,
    /// `(id, index)`, ascending.
    by_id: Vec<(i64, usize)>,
}

impl Catalogue {
    /// Checks the stars and prepares their motion. `epoch_year` is a Julian year, such as 1991.25.
    ///
    /// # Errors
    ///
    /// An epoch that is not finite, an id given twice, or a value outside its range; a colour may
    /// be NaN (unknown), nothing else.
    pub fn new(epoch_year: f64, stars: Vec<CatalogueStar>) -> Result<Self, CatalogueError> {
        if !epoch_year.is_finite() {
            return Err(CatalogueError::Epoch { year: epoch_year });
        }
        for star in &stars {
            check(star)?;
        }
        let mut by_id: Vec<_> = stars.iter().enumerate().map(|(i, s)| (s.id, i)).collect();
        by_id.sort_unstable();
        if let Some(pair) = by_id.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            return Err(CatalogueError::DuplicateId {
                id: pair[0].0,
                first: pair[0].1,
                second: pair[1].1,
            });
        }
        let direction = stars
            .iter()
            .map(|s| unit_vector(Angle::from_deg(s.ra_deg), Angle::from_deg(s.dec_deg)))
            .collect();
        let motion = stars.iter().map(motion_rad_yr).collect();
        Ok(Self {
            epoch_year,
            stars,
            direction,
            motion,
            by_id,
        })
    }

    /// Julian year to which the positions belong.
    #[must_use]
    pub fn epoch_year(&self) -> f64 {
        self.epoch_year
    }

    /// The stars as given.
    #[must_use]
    pub fn stars(&self) -> &[CatalogueStar] {
        &self.stars
    }

    /// Number of stars.
    #[must_use]
    pub fn len(&self) -> usize {
        self.stars.len()
    }

    /// Whether there is no star.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.stars.is_empty()
    }

    /// Index of the star with this id.
    #[must_use]
    pub fn index_of(&self, id: i64) -> Option<usize> {
        let at = self.by_id.binary_search_by_key(&id, |&(id, _)| id).ok()?;
        Some(self.by_id[at].1)
    }

    /// Barycentric unit vector of a star in a Julian year (a point of time, such as 2018.56).
    ///
    /// # Panics
    ///
    /// If there is no star `index`.
    #[must_use]
    pub fn direction_at(&self, index: usize, year: f64) -> Vector3<f64> {
        let dt_yr = year - self.epoch_year;
        (self.direction[index] + self.motion[index] * dt_yr).normalize()
    }

    /// [`direction_at`](Self::direction_at) as seen from a place `observer_au` from the barycentre
    /// of the solar system, au, inertial axes: with annual parallax.
    ///
    /// # Panics
    ///
    /// If there is no star `index`.
    #[must_use]
    pub fn direction_from(
        &self,
        index: usize,
        year: f64,
        observer_au: &Vector3<f64>,
    ) -> Vector3<f64> {
        let parallax_rad = self.stars[index].parallax_mas * 1e-3 / ARCSEC_PER_RAD;
        (self.direction_at(index, year) - observer_au * parallax_rad).normalize()
    }

    /// Barycentric unit vectors of all stars, in catalogue order.
    #[must_use]
    pub fn directions_at(&self, year: f64) -> Vec<Vector3<f64>> {
        (0..self.len())
            .map(|index| self.direction_at(index, year))
            .collect()
    }

    /// Indices of the stars at most `radius` from the unit vector `centre`, in catalogue order.
    #[must_use]
    pub fn within(&self, centre: &Vector3<f64>, radius: Angle, year: f64) -> Vec<usize> {
        // chords instead of cosines, which cannot tell angles below 1e-8 rad apart
        let half = radius.rad().clamp(0.0, std::f64::consts::PI) / 2.0;
        let chord_squared = if radius.rad() < std::f64::consts::PI {
            4.0 * half.sin() * half.sin()
        } else {
            f64::INFINITY
        };
        (0..self.len())
            .filter(|&i| (self.direction_at(i, year) - centre).norm_squared() <= chord_squared)
            .collect()
    }
}

fn check(star: &CatalogueStar) -> Result<(), CatalogueError> {
    let finite = "the finite numbers";
    for (name, value, fine, range) in [
        (
            "ra_deg",
            star.ra_deg,
            (0.0..=360.0).contains(&star.ra_deg),
            "0 to 360",
        ),
        (
            "dec_deg",
            star.dec_deg,
            star.dec_deg.abs() <= 90.0,
            "-90 to 90",
        ),
        ("mag", star.mag, star.mag.is_finite(), finite),
        ("bv", star.bv, !star.bv.is_infinite(), finite),
        (
            "pm_ra_mas_yr",
            star.pm_ra_mas_yr,
            star.pm_ra_mas_yr.is_finite(),
            finite,
        ),
        (
            "pm_dec_mas_yr",
            star.pm_dec_mas_yr,
            star.pm_dec_mas_yr.is_finite(),
            finite,
        ),
        (
            "parallax_mas",
            star.parallax_mas,
            star.parallax_mas.is_finite(),
            finite,
        ),
    ] {
        if !fine {
            return Err(CatalogueError::OutOfRange {
                id: star.id,
                name,
                value,
                range,
            });
        }
    }
    Ok(())
}

fn motion_rad_yr(star: &CatalogueStar) -> Vector3<f64> {
    let (sin_ra, cos_ra) = Angle::from_deg(star.ra_deg).rad().sin_cos();
    let (sin_dec, cos_dec) = Angle::from_deg(star.dec_deg).rad().sin_cos();
    let east = Vector3::new(-sin_ra, cos_ra, 0.0);
    let north = Vector3::new(-sin_dec * cos_ra, -sin_dec * sin_ra, cos_dec);
    (east * star.pm_ra_mas_yr + north * star.pm_dec_mas_yr) * (1e-3 / ARCSEC_PER_RAD)
}
