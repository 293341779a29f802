//! Catalogue and frames: what they hold, and what they refuse.

use focal_plane::{
    Angle, Catalogue, CatalogueError, CatalogueStar, FramesError, SPEED_OF_LIGHT_M_S, StarFrames,
    aberrated, unit_vector,
};
use nalgebra::Vector3;

fn star(id: i64, ra_deg: f64, dec_deg: f64) -> CatalogueStar {
    CatalogueStar {
        id,
        ra_deg,
        dec_deg,
        ..CatalogueStar::default()
    }
}

#[test]
fn stars_are_found_by_id_and_by_place() -> Result<(), CatalogueError> {
    let stars = vec![
        star(7, 359.9, 0.0),
        star(-3, 0.2, 0.0),
        star(5, 0.0, 89.5),
        star(9, 180.0, 0.0),
    ];
    let catalogue = Catalogue::new(2000.0, stars)?;
    assert_eq!(
        (
            catalogue.len(),
            catalogue.is_empty(),
            catalogue.epoch_year()
        ),
        (4, false, 2000.0)
    );
    assert_eq!(catalogue.index_of(-3), Some(1));
    assert_eq!(catalogue.index_of(9), Some(3));
    assert_eq!(catalogue.index_of(8), None);
    let origin = Vector3::x();
    let within = |deg| catalogue.within(&origin, Angle::from_deg(deg), 2000.0);
    assert_eq!(within(0.15), [0]);
    assert_eq!(within(0.25), [0, 1]);
    assert_eq!(within(89.6), [0, 1, 2]);
    assert_eq!(within(179.9), [0, 1, 2]);
    assert_eq!(within(180.0), [0, 1, 2, 3]);
    assert_eq!(within(-1.0), [0; 0]);
    assert_eq!(
        catalogue.directions_at(2010.0)[2],
        catalogue.direction_at(2, 2010.0)
    );
    Ok(())
}

/// Two stars a milliarcsecond apart (5e-9 rad): a cosine could not tell them apart.
#[test]
fn small_cones_are_exact() -> Result<(), CatalogueError> {
    let mas = 1.0 / 3.6e6;
    let catalogue = Catalogue::new(2000.0, vec![star(1, 0.0, 0.0), star(2, mas, 0.0)])?;
    let near = |mas: f64| catalogue.within(&Vector3::x(), Angle::from_arcsec(mas * 1e-3), 2000.0);
    assert_eq!(near(0.99), [0]);
    assert_eq!(near(1.01), [0, 1]);
    Ok(())
}

#[test]
fn bad_catalogues_are_named() {
    let error = |star| Catalogue::new(2000.0, vec![star]).err();
    assert!(matches!(
        Catalogue::new(f64::NAN, vec![]),
        Err(CatalogueError::Epoch { .. })
    ));
    assert_eq!(
        Catalogue::new(
            2000.0,
            vec![star(4, 1.0, 1.0), star(2, 0.0, 0.0), star(4, 2.0, 2.0)]
        )
        .err(),
        Some(CatalogueError::DuplicateId {
            id: 4,
            first: 0,
            second: 2
        })
    );
    for (bad, name) in [
        (star(1, 360.1, 0.0), "ra_deg"),
        (star(1, -0.1, 0.0), "ra_deg"),
        (star(1, 0.0, 90.1), "dec_deg"),
        (star(1, 0.0, f64::NAN), "dec_deg"),
        (
            CatalogueStar {
                mag: f64::NAN,
                ..star(1, 0.0, 0.0)
            },
            "mag",
        ),
        (
            CatalogueStar {
                bv: f64::INFINITY,
                ..star(1, 0.0, 0.0)
            },
            "bv",
        ),
        (
            CatalogueStar {
                pm_ra_mas_yr: f64::NAN,
                ..star(1, 0.0, 0.0)
            },
            "pm_ra_mas_yr",
        ),
        (
            CatalogueStar {
                pm_dec_mas_yr: f64::NAN,
                ..star(1, 0.0, 0.0)
            },
            "pm_dec_mas_yr",
        ),
        (
            CatalogueStar {
                parallax_mas: f64::NAN,
                ..star(1, 0.0, 0.0)
            },
            "parallax_mas",
        ),
    ] {
        match error(bad) {
            Some(CatalogueError::OutOfRange {
                id: 1, name: got, ..
            }) => assert_eq!(got, name),
            other => panic!("{name}: {other:?}"),
        }
    }
    assert_eq!(error(star(1, 360.0, -90.0)), None);
}

/// Half a year apart the star moves by twice its parallax, towards where the Sun is seen from the
/// star: to second order, parallax^2 = 1e-11 rad.
#[test]
fn parallax_shifts_against_the_observer() -> Result<(), CatalogueError> {
    let near = CatalogueStar {
        parallax_mas: 768.0,
        ..star(1, 90.0, 0.0)
    };
    let catalogue = Catalogue::new(2000.0, vec![near])?;
    let parallax = Angle::from_arcsec(0.768).rad();
    let seen = catalogue.direction_from(0, 2000.0, &Vector3::x());
    assert!((seen - Vector3::new(-parallax, 1.0, 0.0)).norm() < 1e-11);
    Ok(())
}

/// Across the line of sight the shift is atan(v/c), towards the velocity; along it, none.
#[test]
fn aberration_is_towards_the_velocity() {
    let u = unit_vector(Angle::from_deg(40.0), Angle::from_deg(-20.0));
    let across = u.cross(&Vector3::z()).normalize();
    let moved = aberrated(&u, &(across * 30_000.0));
    let angle = moved.dot(&across).atan2(moved.dot(&u));
    assert!((angle - (30_000.0 / SPEED_OF_LIGHT_M_S).atan()).abs() < 3e-16);
    assert!((Angle::from_rad(angle).arcsec() - 20.64).abs() < 0.01);
    assert!((aberrated(&u, &(u * 30_000.0)) - u).norm() < 3e-16);
}

fn two_frames() -> StarFrames {
    let mut frames = StarFrames::default();
    frames.begin(1.0);
    frames.push(0, 10, 1.0, 2.0);
    frames.push(1, 11, 3.0, 4.0);
    frames.begin(1.5);
    frames.begin(2.0);
    frames.push_measured(1, 11, 5.0, 6.0, Some(4.5), None);
    frames.push(0, 10, 7.0, 8.0);
    frames
}

#[test]
fn frames_are_contiguous_rows() -> Result<(), FramesError> {
    let frames = two_frames();
    frames.check()?;
    assert_eq!(frames.first_row, [0, 2, 2, 4]);
    assert_eq!(
        [frames.rows_of(0), frames.rows_of(1), frames.rows_of(2)],
        [0..2, 2..2, 2..4]
    );
    assert_eq!(frames.frame_of_rows(), [0, 0, 2, 2]);
    assert_eq!(frames.t_of_rows_s(), [1.0, 1.0, 2.0, 2.0]);
    assert_eq!(frames.positions().y, [2.0, 4.0, 6.0, 8.0]);
    let mag = frames.mag.as_deref().unwrap_or_default();
    assert!(mag[0].is_nan() && mag[1].is_nan() && mag[3].is_nan());
    assert_eq!((mag[2], &frames.flux), (4.5, &None));
    assert_eq!(StarFrames::new().first_row, [0]);
    StarFrames::new().check()
}

#[test]
fn bad_frames_are_named() {
    let broken = |change: fn(&mut StarFrames)| {
        let mut frames = two_frames();
        change(&mut frames);
        frames.check().err()
    };
    assert_eq!(
        broken(|f| f.slot.truncate(3)),
        Some(FramesError::Length {
            column: "slot",
            got: 3,
            need: 4
        })
    );
    assert_eq!(
        broken(|f| f.mag = Some(vec![])),
        Some(FramesError::Length {
            column: "mag",
            got: 0,
            need: 4
        })
    );
    assert_eq!(
        broken(|f| f.first_row = vec![]),
        Some(FramesError::Length {
            column: "first_row",
            got: 0,
            need: 4
        })
    );
    for (first_row, frame, got) in [
        (vec![1, 2, 2, 4], 0, 1),
        (vec![0, 3, 2, 4], 2, 2),
        (vec![0, 2, 2, 3], 3, 3),
        (vec![0, 2, 9, 4], 2, 9),
    ] {
        let mut frames = two_frames();
        frames.first_row = first_row;
        assert_eq!(
            frames.check().err(),
            Some(FramesError::FirstRow {
                frame,
                got,
                rows: 4
            })
        );
    }
    assert_eq!(
        broken(|f| f.t_s[1] = 1.0),
        Some(FramesError::Time { frame: 1, t_s: 1.0 })
    );
    assert!(matches!(
        broken(|f| f.t_s[2] = f64::NAN),
        Some(FramesError::Time { frame: 2, .. })
    ));
    assert_eq!(
        broken(|f| f.slot[3] = 1),
        Some(FramesError::RepeatedSlot {
            frame: 2,
            t_s: 2.0,
            slot: 1
        })
    );
}

/// The two need not be neighbours.
#[test]
fn a_slot_repeats_anywhere_in_a_frame() {
    let mut frames = two_frames();
    frames.push(1, 12, 0.0, 0.0);
    assert!(matches!(
        frames.check(),
        Err(FramesError::RepeatedSlot {
            frame: 2,
            slot: 1,
            ..
        })
    ));
}

#[test]
#[should_panic(expected = "begin a frame before its stars")]
fn a_star_needs_a_frame() {
    StarFrames::new().push(0, 1, 0.0, 0.0);
}
