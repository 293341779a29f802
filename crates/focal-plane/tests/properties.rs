//! Properties over random inputs, fixed seed: round trips, derivatives, batches against single
//! calls.

#![expect(
    clippy::float_cmp,
    reason = "a batch computes what a single call does, bit by bit"
)]

use std::f64::consts::PI;

use focal_plane::{
    Angle, Camera, Pixel, Points, PointsMut, Quaternions, Series, Vectors, VectorsMut, aberrated,
    ra_dec, rotate_each_into, rotate_into, rotation_from_vector, rotation_vector,
    so3_left_jacobian, so3_left_jacobian_inverse, unit_vector,
};
use nalgebra::Vector3;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

fn config() -> ProptestConfig {
    ProptestConfig {
        rng_seed: RngSeed::Fixed(20_180_725),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

fn vector(size: f64) -> impl Strategy<Value = Vector3<f64>> {
    [-size..size, -size..size, -size..size].prop_map(Vector3::from)
}

/// Up to just below pi, where the logarithm is still unique.
fn turn() -> impl Strategy<Value = Vector3<f64>> {
    (vector(1.0), -12.0..0.0_f64).prop_filter_map("a direction", |(v, log)| {
        let angle = (PI - 1e-6) * 10.0_f64.powf(log);
        (v.norm() > 0.1).then(|| v.normalize() * angle)
    })
}

fn camera() -> impl Strategy<Value = Camera> {
    (2_u32..4000, 2_u32..4000, 1e2..1e5_f64, any::<bool>()).prop_map(|(nx, ny, f, whole)| {
        Camera::from_focal_length_px([nx, ny], f)
            .and_then(|c| c.with_pixel_centre(if whole { 0.0 } else { 0.5 }))
            .expect("a valid camera")
    })
}

fn pixel() -> impl Strategy<Value = Pixel> {
    (-2000.0..2000.0, -2000.0..2000.0).prop_map(|(x, y)| Pixel { x, y })
}

proptest! {
    #![proptest_config(config())]

    /// Five roundings there and back, each eps/2 of the coordinate.
    #[test]
    fn pixels_survive_the_way_to_the_sky_and_back(camera in camera(), p in pixel()) {
        let v = camera.direction(p);
        prop_assert!((v.norm() - 1.0).abs() < 4.0 * f64::EPSILON);
        let back = camera.project(&v).expect("in front of the camera");
        let tol = 4.0 * f64::EPSILON;
        prop_assert!((back.x - p.x).abs() <= tol * p.x.abs() && (back.y - p.y).abs() <= tol * p.y.abs());
        let t = camera.pixel(camera.tangent(p));
        let n = camera.from_normalised(camera.normalised(p));
        for other in [t, n] {
            prop_assert!((other.x - p.x).abs() <= tol * p.x.abs());
            prop_assert!((other.y - p.y).abs() <= tol * p.y.abs());
        }
    }

    /// Central difference with 1e-5 rad: third derivatives of X/Z are below 16 (1 + r^2)^2 f, so it
    /// errs by 1e-10/6 of that; rounding adds 4 eps (p + f)/1e-5.
    #[test]
    fn rotation_jacobian_is_the_derivative(
        f in 1000.0..5000.0_f64, p in pixel(), axis in 0_usize..3,
    ) {
        let camera = Camera::from_fov_deg([1024, 1000], [
            Angle::from_rad(2.0 * (512.0 / f).atan()).deg(),
            Angle::from_rad(2.0 * (500.0 / (1.004 * f)).atan()).deg(),
        ]).expect("axes within 0.5 %");
        let v = camera.direction(p);
        let d = 1e-5;
        let shifted = |angle: f64| {
            let mut theta = Vector3::zeros();
            theta[axis] = angle;
            camera.project(&(rotation_from_vector(&theta) * v)).expect("in front")
        };
        let (after, before) = (shifted(d), shifted(-d));
        let jacobian = camera.rotation_jacobian(p);
        let t = camera.tangent(p);
        let r2 = 1.0 + t.x * t.x + t.y * t.y;
        let tol = 3e-10 * r2 * r2 * f + 4.0 * f64::EPSILON * (4000.0 + f) / d;
        prop_assert!(((after.x - before.x) / (2.0 * d) - jacobian[0][axis]).abs() < tol);
        prop_assert!(((after.y - before.y) / (2.0 * d) - jacobian[1][axis]).abs() < tol);
    }

    #[test]
    fn phase_has_the_period_of_a_pixel(camera in camera(), p in -600.0..600.0_f64, n in -500..500) {
        let phase = camera.phase_rad(p);
        prop_assert!((0.0..2.0 * PI).contains(&phase));
        // p + n rounds by eps/2 of 1100 px, 2 pi times that in phase
        let apart = (camera.phase_rad(p + f64::from(n)) - phase).abs();
        prop_assert!(apart.min(2.0 * PI - apart) < 2.0 * PI * 2e-13);
        let mut out = [0.0];
        camera.phase_into(&[p], &mut out);
        prop_assert_eq!(out[0], phase);
    }

    #[test]
    fn batches_are_single_calls(camera in camera(), vs in prop::collection::vec(vector(1.0), 0..40)) {
        let n = vs.len();
        let column = |k: usize| vs.iter().map(|v| v[k]).collect::<Vec<_>>();
        let (x, y, z) = (column(0), column(1), column(2));
        let (mut px, mut py) = (vec![0.0; n], vec![0.0; n]);
        camera.project_into(Vectors { x: &x, y: &y, z: &z }, PointsMut { x: &mut px, y: &mut py });
        for (i, v) in vs.iter().enumerate() {
            match camera.project(v) {
                Some(p) => prop_assert_eq!([p.x, p.y], [px[i], py[i]]),
                None => prop_assert!(px[i].is_nan() && py[i].is_nan()),
            }
        }
        let points = Points { x: &x, y: &y };
        let mut out = vec![vec![0.0; n]; 6];
        let [a, b, c, d, e, f] = &mut out[..] else { unreachable!() };
        camera.direction_into(points, VectorsMut { x: a, y: b, z: c });
        for i in 0..n {
            let v = camera.direction(Pixel { x: x[i], y: y[i] });
            prop_assert_eq!([v.x, v.y, v.z], [a[i], b[i], c[i]]);
        }
        camera.rotation_jacobian_into(
            points,
            [VectorsMut { x: a, y: b, z: c }, VectorsMut { x: d, y: e, z: f }],
        );
        for i in 0..n {
            let j = camera.rotation_jacobian(Pixel { x: x[i], y: y[i] });
            prop_assert_eq!(j, [[a[i], b[i], c[i]], [d[i], e[i], f[i]]]);
        }
    }

    /// Rounding of the products: a few eps of the vector's length.
    #[test]
    fn columns_turn_as_vectors_do(theta in turn(), v in vector(1.0)) {
        let q = rotation_from_vector(&theta);
        let want = q * v;
        let columns = Vectors { x: &[v.x], y: &[v.y], z: &[v.z] };
        let (mut x, mut y, mut z) = ([0.0], [0.0], [0.0]);
        rotate_into(&q, columns, VectorsMut { x: &mut x, y: &mut y, z: &mut z });
        prop_assert!((Vector3::new(x[0], y[0], z[0]) - want).norm() < 8.0 * f64::EPSILON);
        let each = Quaternions { x: &[q.i], y: &[q.j], z: &[q.k], w: &[q.w] };
        rotate_each_into(each, columns, VectorsMut { x: &mut x, y: &mut y, z: &mut z });
        prop_assert!((Vector3::new(x[0], y[0], z[0]) - want).norm() < 8.0 * f64::EPSILON);
    }

    /// Against the identity the logarithm is relatively accurate, down to 1e-12 rad. Near pi the
    /// angle is 2 atan2(n, w) with w rounded at eps/2: again a few eps.
    #[test]
    fn logarithm_undoes_the_exponential(theta in turn()) {
        let q = rotation_from_vector(&theta);
        prop_assert!((q.into_inner().norm() - 1.0).abs() < 4.0 * f64::EPSILON);
        let back = rotation_vector(&q, &nalgebra::UnitQuaternion::identity());
        prop_assert!((back - theta).norm() <= 8.0 * f64::EPSILON * theta.norm());
    }

    /// v_meas = v_ref + theta x v_ref to second order.
    #[test]
    fn a_small_rotation_moves_vectors_as_defined(
        theta in vector(1e-6), q in turn(), v in vector(1.0),
    ) {
        let reference = rotation_from_vector(&q);
        let meas = rotation_from_vector(&theta) * reference;
        let error = rotation_vector(&meas, &reference);
        let before = reference * v;
        let tol = theta.norm_squared() * v.norm() + 2e-15;
        prop_assert!((meas * v - before - error.cross(&before)).norm() < tol);
    }

    /// exp(phi + e) = exp(J_l(phi) e) exp(phi) to second order in e = 1e-6.
    #[test]
    fn left_jacobian_is_the_derivative_of_the_exponential(phi in turn(), e in vector(1e-6)) {
        let step = rotation_vector(&rotation_from_vector(&(phi + e)), &rotation_from_vector(&phi));
        let want = so3_left_jacobian(&phi, &e);
        prop_assert!((step - want).norm() < 2.0 * e.norm_squared() + 3e-15, "{step} {want}");
    }

    /// |J_l^-1| is at most pi/2 up to pi; both errors are a few eps.
    #[test]
    fn inverse_jacobian_inverts(phi in turn(), v in vector(1.0)) {
        let there = so3_left_jacobian(&phi, &v);
        prop_assert!((so3_left_jacobian_inverse(&phi, &there) - v).norm() < 4e-15 * (1.0 + phi.norm()));
    }

    #[test]
    fn directions_survive_ra_and_dec(ra in 0.0..360.0_f64, dec in -90.0..90.0_f64) {
        let u = unit_vector(Angle::from_deg(ra), Angle::from_deg(dec));
        let (a, d) = ra_dec(&(u * 3.0));
        prop_assert!((unit_vector(a, d) - u).norm() < 8.0 * f64::EPSILON);
        prop_assert!((d.deg() - dec).abs() < 1e-13);
        prop_assert!((0.0..2.0 * PI).contains(&a.rad()));
    }

    /// Going and coming back differs by (v/c)^2 only.
    #[test]
    fn aberration_undone_is_second_order(ra in 0.0..360.0, dec in -90.0..90.0, v in vector(5e4)) {
        let u = unit_vector(Angle::from_deg(ra), Angle::from_deg(dec));
        let back = aberrated(&aberrated(&u, &v), &-v);
        let beta = v.norm() / focal_plane::SPEED_OF_LIGHT_M_S;
        prop_assert!((back - u).norm() < 2.0 * beta * beta + 1e-15);
    }

    /// The lag filter is exact between samples: a further sample on the input line changes nothing.
    #[test]
    fn a_sample_more_on_the_line_changes_no_lag(
        steps in prop::collection::vec((0.01..20.0_f64, -5.0..5.0_f64), 2..12),
        lag in 0.05..500.0_f64, part in 0.01..0.99_f64, at in any::<prop::sample::Index>(),
    ) {
        let mut t = 0.0;
        let (t_s, u): (Vec<_>, Vec<_>) = steps.iter().map(|&(h, u)| { t += h; (t, u) }).unzip();
        let i = at.index(t_s.len() - 1);
        let between = t_s[i] + part * (t_s[i + 1] - t_s[i]);
        let plain = Series::new(t_s.clone(), u.clone()).expect("ascending");
        let (mut more_t, mut more_u) = (t_s.clone(), u);
        more_t.insert(i + 1, between);
        more_u.insert(i + 1, plain.at(between).expect("inside"));
        let more = Series::new(more_t, more_u).expect("ascending");
        let (plain, more) = (plain.lagged(lag), more.lagged(lag));
        for &t in t_s.iter().chain([&between]) {
            let (a, b) = (plain.at(t).expect("inside"), more.at(t).expect("inside"));
            // values below 5; a dozen steps of a few roundings each
            prop_assert!((a - b).abs() < 5e-14, "{a} {b} at {t}");
        }
    }
}
