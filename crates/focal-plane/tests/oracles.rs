//! Against programs that share no code with this one: ERFA and 50-digit arithmetic.

mod common;

use std::error::Error;

use common::oracle;
use focal_plane::{Angle, Camera, Catalogue, CatalogueStar, ra_dec, rotation_vector, unit_vector};
use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};

const MAS: f64 = 1e-3 / focal_plane::ARCSEC_PER_RAD;

/// A row of the table of motions, and how far from ERFA's direction ours is, rad.
type Motion = (Vec<f64>, f64);

fn motions() -> Result<Vec<Motion>, Box<dyn Error>> {
    let mut out = Vec::new();
    for row in oracle("proper_motion.csv", 1)? {
        let [ra, dec, pm_ra, pm_dec, parallax, _rv, year, ra_at, dec_at] = row[..] else {
            return Err("nine numbers a row".into());
        };
        let star = CatalogueStar {
            ra_deg: ra,
            dec_deg: dec,
            pm_ra_mas_yr: pm_ra,
            pm_dec_mas_yr: pm_dec,
            parallax_mas: parallax,
            ..CatalogueStar::default()
        };
        let got = Catalogue::new(1991.25, vec![star])?.direction_at(0, year);
        let want = unit_vector(Angle::from_deg(ra_at), Angle::from_deg(dec_at));
        let apart = (got - want).norm();
        out.push((row, apart));
    }
    Ok(out)
}

/// ERFA's relativistic factor on the proper motion is of order (v/c)^2/2 < 5e-8 here: at most
/// 3e-5 mas on 600 arcsec. The rounding of degrees adds 360 eps deg = 3e-7 mas; near the pole
/// nothing more, since only directions are compared. Linear ra and dec would miss by 1e4 mas there.
#[test]
fn proper_motion_matches_erfa() -> Result<(), Box<dyn Error>> {
    let mut compared = 0;
    for (row, apart) in motions()? {
        if row[5].abs() > 0.0 {
            continue;
        }
        compared += 1;
        assert!(apart < 3e-5 * MAS, "{row:?}: {} mas", apart / MAS);
    }
    assert_eq!(compared, 24);
    Ok(())
}

/// What the module says about the radial velocity that is left out: Barnard's star moves on by
/// 49 mas more in 8.75 years and 479 mas in 27.25.
#[test]
fn radial_velocity_of_barnards_star_is_worth_half_an_arcsec_in_27_years()
-> Result<(), Box<dyn Error>> {
    let apart: Vec<f64> = motions()?
        .iter()
        .filter(|(row, _)| row[5] < 0.0)
        .map(|(_, apart)| apart / MAS)
        .collect();
    assert_eq!(apart.len(), 4);
    assert!(
        (apart[1] - 49.3).abs() < 0.1 && (apart[2] - 478.5).abs() < 0.1,
        "{apart:?}"
    );
    Ok(())
}

/// A tracker with X to the east and Y to the north of its boresight sees ERFA's gnomonic
/// coordinates. The tangent of 14 deg is 0.25; its derivative is at most 1.07: an error of 3 eps in
/// the directions and in the attitude (components below 1) stays below 2e-15.
#[test]
fn pinhole_matches_erfa_tangent_plane() -> Result<(), Box<dyn Error>> {
    let camera = Camera::from_focal_length_px([1024, 1024], 1.0)?;
    for row in oracle("tangent_plane.csv", 0)? {
        let [ra0, dec0, ra, dec, east, north] = row[..] else {
            return Err("six numbers a row".into());
        };
        let boresight = unit_vector(Angle::from_deg(ra0), Angle::from_deg(dec0));
        let x = Vector3::z().cross(&boresight).normalize();
        let y = boresight.cross(&x);
        let rows = Matrix3::from_rows(&[x.transpose(), y.transpose(), boresight.transpose()]);
        let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rows));
        let star = q * unit_vector(Angle::from_deg(ra), Angle::from_deg(dec));
        let p = camera.project(&star).ok_or("behind the camera")?;
        assert!(
            (p.x - east).abs() < 2e-15 && (p.y - north).abs() < 2e-15,
            "{p:?} against {east}, {north}"
        );
    }
    Ok(())
}

/// Rounding unit u = eps/2. Each component of the product errs by at most 4u, the vector part by
/// 7u; a rotation vector is at most pi/1 times as long as its vector part: 22u, and 6u for the
/// steps after the product.
#[test]
fn rotation_vector_is_good_to_rounding_at_every_angle() -> Result<(), Box<dyn Error>> {
    let tol = 28.0 * 0.5 * f64::EPSILON;
    for row in oracle("rotation_vector.csv", 0)? {
        let quaternion =
            |c: &[f64]| UnitQuaternion::new_unchecked(Quaternion::new(c[0], c[1], c[2], c[3]));
        let want = Vector3::new(row[8], row[9], row[10]);
        let got = rotation_vector(&quaternion(&row[..4]), &quaternion(&row[4..8]));
        let error = (got - want).norm();
        assert!(error < tol, "angle {}: {error:.1e}", want.norm());
    }
    Ok(())
}

#[test]
fn right_ascension_stays_below_a_full_turn() {
    let (ra, dec) = ra_dec(&Vector3::new(1.0, -1e-20, 0.0));
    assert!(ra.rad() < std::f64::consts::TAU && ra.rad() >= 0.0);
    assert!(dec.rad().abs() < 1e-300);
}
