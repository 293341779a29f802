//! The Hipparcos stars brighter than Hp = 6.5, compiled in.
//!
//! ```text
//! direction at year = direction at 1991.25 + proper motion (year - 1991.25)
//! ```
//!
//! Source: F. van Leeuwen, Hipparcos, the New Reduction of the Raw Data (2007), CDS I/311; ICRS at
//! epoch J1991.25. The subset is `fixtures/hip2`.

use focal_plane::{Catalogue, CatalogueStar, ra_dec};

use crate::ScenarioError;

const TABLE: &str = include_str!("../../../../fixtures/hip2/hip2_hp_lt_6.5.csv");

/// The catalogue with positions moved to another Julian year. Positions are rounded to 1e-8 deg
/// (0.04 mas, a tenth of the best of them), so that they read well in a file.
///
/// # Errors
/// None with the table that is compiled in.
pub fn hipparcos(year: f64) -> Result<Catalogue, ScenarioError> {
    let at_epoch = telemetry::hipparcos::read(TABLE.as_bytes())?;
    let moved = at_epoch.stars().iter().enumerate().map(|(index, star)| {
        let (ra, dec) = ra_dec(&at_epoch.direction_at(index, year));
        let round = |deg: f64| (deg * 1e8).round() / 1e8;
        CatalogueStar {
            ra_deg: round(ra.deg()),
            dec_deg: round(dec.deg()),
            ..*star
        }
    });
    Ok(Catalogue::new(year, moved.collect())?)
}

#[cfg(test)]
mod tests {
    use focal_plane::Angle;

    use super::*;

    /// All lines are stars, and Sirius (HIP 32349) is where it was at J2000.0: 6h 45m 08.917s,
    /// -16d 42' 58.02" (SIMBAD), to 0.05".
    #[test]
    fn sirius_is_where_it_was_in_2000() {
        let catalogue = hipparcos(2000.0).unwrap();
        assert_eq!(catalogue.len(), TABLE.lines().count() - 1);
        assert_eq!(catalogue.len(), 7982);
        let sirius = catalogue.stars()[catalogue.index_of(32349).unwrap()];
        let ra = (6.0 + 45.0 / 60.0 + 8.917 / 3600.0) * 15.0;
        let dec = -(16.0 + 42.0 / 60.0 + 58.02 / 3600.0);
        let cos_dec = Angle::from_deg(dec).rad().cos();
        let off = ((sirius.ra_deg - ra) * cos_dec).hypot(sirius.dec_deg - dec);
        assert!(off * 3600.0 < 0.05, "{} arcsec", off * 3600.0);
    }
}
