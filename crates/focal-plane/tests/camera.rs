//! Pinhole: conventions, errors, and the published camera.

#![expect(
    clippy::float_cmp,
    reason = "exact by construction where compared with =="
)]

use std::f64::consts::PI;

use focal_plane::{Camera, CameraError, Normalised, Pixel, Tangent};
use nalgebra::Vector3;

/// [M23] Table 1 and the conventions: 20 deg over 1024 px is 2903.7 px and 71.0 arcsec a pixel at
/// the centre (70.3 on average).
#[test]
fn aa_str_has_the_published_scale() -> Result<(), CameraError> {
    let camera = Camera::from_fov_deg([1024, 1024], [20.0, 20.0])?;
    let [f, _] = camera.focal_length_px();
    assert!((f - 2903.7).abs() < 0.05, "{f}");
    assert!((camera.arcsec_per_px()[1] - 71.0).abs() < 0.05);
    assert!((camera.fov()[0].deg() - 20.0).abs() < 1e-14);
    assert!((camera.fov()[0].arcsec() / 1024.0 - 70.3).abs() < 0.05);
    assert_eq!(camera.half_size_px(), [512.0, 512.0]);
    assert_eq!(camera.pixel_centre(), 0.5);
    Ok(())
}

#[test]
fn a_wide_detector_has_its_own_axes() -> Result<(), CameraError> {
    let camera = Camera::from_focal_length_px([1000, 600], 2000.0)?;
    assert_eq!(camera.pixels(), [1000, 600]);
    assert!(camera.contains(Pixel {
        x: -500.0,
        y: 300.0
    }));
    assert!(!camera.contains(Pixel { x: 0.0, y: 300.1 }));
    assert!(!camera.contains(Pixel {
        x: f64::NAN,
        y: 0.0
    }));
    let edge = camera.normalised(Pixel {
        x: 250.0,
        y: -300.0,
    });
    assert_eq!(edge, Normalised { x: 0.5, y: -1.0 });
    assert_eq!(
        camera.from_normalised(edge),
        Pixel {
            x: 250.0,
            y: -300.0
        }
    );
    assert_eq!(
        camera.tangent(Pixel { x: 200.0, y: 1.0 }),
        Tangent { x: 0.1, y: 0.0005 }
    );
    assert_eq!(
        camera.pixel(Tangent { x: 0.5, y: -0.25 }),
        Pixel {
            x: 1000.0,
            y: -500.0
        }
    );
    assert!((camera.fov()[1].rad() - 2.0 * 0.15_f64.atan()).abs() < 1e-16);
    Ok(())
}

#[test]
fn behind_the_camera_there_is_nothing() -> Result<(), CameraError> {
    let camera = Camera::from_focal_length_px([10, 10], 100.0)?;
    for z in [0.0, -0.0, -1.0, f64::NAN] {
        assert_eq!(camera.project(&Vector3::new(0.1, 0.2, z)), None);
    }
    assert_eq!(
        camera.project(&Vector3::new(1.0, -2.0, 4.0)),
        Some(Pixel { x: 25.0, y: -50.0 })
    );
    Ok(())
}

#[test]
fn bad_cameras_are_named() {
    let fov = |x, y| Camera::from_fov_deg([1024, 1024], [x, y]).err();
    assert_eq!(
        Camera::from_focal_length_px([1024, 0], 10.0).err(),
        Some(CameraError::NoPixels {
            columns: 1024,
            rows: 0
        })
    );
    assert_eq!(
        Camera::from_fov_deg([0, 7], [20.0, 20.0]).err(),
        Some(CameraError::NoPixels {
            columns: 0,
            rows: 7
        })
    );
    for px in [0.0, -1.0, f64::INFINITY] {
        assert_eq!(
            Camera::from_focal_length_px([4, 4], px).err(),
            Some(CameraError::FocalLength { px })
        );
    }
    assert!(Camera::from_focal_length_px([4, 4], f64::NAN).is_err());
    assert_eq!(
        fov(0.0, 20.0),
        Some(CameraError::FieldOfView {
            axis: 'x',
            deg: 0.0
        })
    );
    assert_eq!(
        fov(20.0, 180.0),
        Some(CameraError::FieldOfView {
            axis: 'y',
            deg: 180.0
        })
    );
    assert!(fov(f64::NAN, 20.0).is_some());
    // tan(10 deg) changes by 0.5 % for 0.098 deg of field
    assert_eq!(fov(20.0, 20.097), None);
    assert!(matches!(
        fov(20.0, 20.099),
        Some(CameraError::AxesDiffer { .. })
    ));
    assert!(matches!(
        fov(20.099, 20.0),
        Some(CameraError::AxesDiffer { .. })
    ));
    let message = fov(20.0, 40.0)
        .map(|error| error.to_string())
        .unwrap_or_default();
    assert!(
        message.contains("2903.696") && message.contains("1406.708"),
        "{message}"
    );
    for value in [0.25, 1.0, -0.5, f64::NAN] {
        let camera = Camera::from_focal_length_px([4, 4], 1.0);
        assert!(matches!(
            camera.and_then(|c| c.with_pixel_centre(value)),
            Err(CameraError::PixelCentre { .. })
        ));
    }
}

/// `phase = 2 pi frac(P + 0.5 - pixel_centre)`: 0 at an edge and pi at a centre, wherever those
/// are; the two conventions are half a pixel apart.
#[test]
fn phase_follows_the_pixel_centre() -> Result<(), CameraError> {
    let edges_whole = Camera::from_focal_length_px([1024, 1024], 2900.0)?;
    let centres_whole = edges_whole.clone().with_pixel_centre(0.0)?;
    for (p, with_edges, with_centres) in [
        (0.0, 0.0, PI),
        (0.5, PI, 0.0),
        (3.25, 0.5 * PI, 1.5 * PI),
        (-0.25, 1.5 * PI, 0.5 * PI),
        (-7.0, 0.0, PI),
        (-1e-20, 0.0, PI),
    ] {
        assert_eq!(
            edges_whole.phase_rad(p),
            with_edges,
            "edges at whole numbers, P = {p}"
        );
        assert_eq!(
            centres_whole.phase_rad(p),
            with_centres,
            "centres at whole numbers, P = {p}"
        );
    }
    assert!(edges_whole.phase_rad(f64::NAN).is_nan());
    assert_eq!(edges_whole.clone().with_pixel_centre(0.5)?, edges_whole);
    Ok(())
}
