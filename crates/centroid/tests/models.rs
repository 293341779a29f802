//! The centroid error models: batches, units, pixel grids.

#![expect(clippy::float_cmp, reason = "compared where the result is exact")]

use std::f64::consts::FRAC_PI_2;

use centroid::{
    CentroidError, CentroidFailure, GaussianPsf, Harmonic, Harmonics, Triangle, phase_rad,
};
use focal_plane::{Camera, Pixel, Points, PointsMut};
use proptest::prelude::*;

fn models() -> Result<Vec<CentroidError>, CentroidFailure> {
    let terms = [
        Harmonic {
            amplitude: 0.3,
            phase_rad: 0.4,
        },
        Harmonic {
            amplitude: -0.1,
            phase_rad: 2.0,
        },
    ];
    let psf = GaussianPsf::new(0.4, 3)?;
    Ok(vec![
        CentroidError::None,
        CentroidError::Triangle(Triangle { peak: [0.07, 0.05] }),
        CentroidError::Harmonics(Harmonics::new(&terms, &terms[..1])),
        CentroidError::GaussianPsf(psf),
        CentroidError::GaussianPsf(GaussianPsf::new(0.4, 4)?),
    ])
}

/// Eq. 10 and 11 as printed, at the phase of the camera's own Eq. 9.
#[test]
fn triangle_on_both_pixel_grids() -> Result<(), Box<dyn std::error::Error>> {
    let triangle = CentroidError::Triangle(Triangle::from_peak(5.06));
    for centre in [0.5, 0.0] {
        let camera = Camera::from_fov_deg([1024, 1024], [20.0, 20.0])?.with_pixel_centre(centre)?;
        for i in -500..500 {
            let p = 0.013 * f64::from(i);
            let phase = camera.phase_rad(p);
            assert!((phase - phase_rad(p, centre)).abs() < 1e-14);
            let printed = 5.06 / FRAC_PI_2 * phase.sin().asin();
            let [got, _] = triangle.error_at(Pixel { x: p, y: 0.0 }, centre);
            // asin near its vertical tangent: 5.06 * 2/pi * sqrt(2 * 1.1e-16)
            assert!((got - printed).abs() < 5e-8, "{p}: {got} {printed}");
        }
        // zero in the middle of a pixel, and drawn to it from a quarter of a pixel before
        let middle = 7.0 + centre;
        let [at, before] = triangle.error_at(
            Pixel {
                x: middle,
                y: middle - 0.25,
            },
            centre,
        );
        assert_eq!([at, before], [0.0, 5.06]);
    }
    Ok(())
}

/// A small spot is drawn to the middle of its pixel, as the triangle draws it.
#[test]
fn small_spot_and_triangle_have_one_sign() -> Result<(), Box<dyn std::error::Error>> {
    let psf = CentroidError::GaussianPsf(GaussianPsf::new(0.2, 5)?);
    let triangle = CentroidError::Triangle(Triangle::from_peak(0.1));
    for centre in [0.5, 0.0] {
        for i in 1..20 {
            let x = 3.0 + 0.05 * f64::from(i);
            if (i % 10) == 0 {
                continue;
            }
            let at = Pixel { x, y: 0.0 };
            let [from_spot, _] = psf.error_at(at, centre);
            let [from_triangle, _] = triangle.error_at(at, centre);
            assert!(from_spot * from_triangle > 0.0, "{centre} {x}");
        }
    }
    Ok(())
}

#[test]
fn scaling_changes_the_unit_of_each_axis() {
    let at = Pixel { x: 0.3, y: 8.9 };
    for model in models().unwrap() {
        let [x, y] = model.error_at(at, 0.5);
        let [sx, sy] = model.scaled([71.0, 70.0]).error_at(at, 0.5);
        assert!((sx - 71.0 * x).abs() < 1e-13 && (sy - 70.0 * y).abs() < 1e-13);
    }
}

#[test]
#[should_panic(expected = "positions and x of the output")]
fn lengths_must_agree() {
    let out = PointsMut {
        x: &mut [],
        y: &mut [],
    };
    CentroidError::None.error_into(
        Points {
            x: &[1.0],
            y: &[1.0],
        },
        0.5,
        out,
    );
}

proptest! {
    /// Batches equal single calls to the last bit; NaN stays NaN; the error repeats each pixel.
    #[test]
    fn batches_equal_single_calls(x in prop::collection::vec(-512.0..512.0, 0..30), centre in prop::sample::select(vec![0.0, 0.5])) {
        let mut y: Vec<f64> = x.iter().map(|x| 0.7 * x + 0.1).collect();
        if let Some(first) = y.first_mut() {
            *first = f64::NAN;
        }
        let at = Points { x: &x, y: &y };
        let n = x.len();
        for model in models().unwrap() {
            let [mut ex, mut ey, mut px, mut py] = [(); 4].map(|()| vec![0.0; n]);
            model.error_into(at, centre, PointsMut { x: &mut ex, y: &mut ey });
            model.displace_into(at, centre, PointsMut { x: &mut px, y: &mut py });
            for i in 0..n {
                let pixel = Pixel { x: x[i], y: y[i] };
                let [one_x, one_y] = model.error_at(pixel, centre);
                prop_assert_eq!(ex[i].to_bits(), one_x.to_bits());
                prop_assert_eq!(ey[i].is_nan(), i == 0);
                prop_assert!(i == 0 || ey[i].to_bits() == one_y.to_bits());
                prop_assert_eq!(px[i].to_bits(), (x[i] + one_x).to_bits());
                prop_assert_eq!(py[i].is_nan(), i == 0);
                // the phase carries the position's rounding, 1e-13 turns; the slope is at most 12
                let [by_phase, _] = model.error([phase_rad(x[i], centre), 0.0]);
                let edge = (x[i] - x[i].round()).abs().min((x[i] - x[i].floor() - 0.5).abs());
                prop_assert!(edge < 1e-9 || (by_phase - one_x).abs() < 2e-12);
            }
        }
    }

    /// Odd about the middle of the pixel.
    #[test]
    fn s_curve_is_odd(sigma in 0.05..3.0, window in 1_u32..12, offset in 0.0..0.5) {
        let psf = GaussianPsf::new(sigma, window).unwrap();
        prop_assert!((psf.error_px(offset) + psf.error_px(-offset)).abs() < 1e-13);
        prop_assert!(psf.error_px(offset).abs() <= 0.5 + 1e-12);
    }
}
