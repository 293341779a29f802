//! The rotating body: closed form against integration, conservation, and an independent program.

#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use assess::{
    AssessError, Body, Fitter, Free, Inertia, Observed, Rotating, axisymmetric, nutation_rates,
};
use focal_plane::{AttitudeSource, rotation_from_vector, rotation_vector};
use nalgebra::{Matrix4, Quaternion, UnitQuaternion, Vector3, Vector4};

const IMAGE: [f64; 3] = [14710.5, 14688.8, 29041.9];
/// Half a revolution a minute.
const SPIN: f64 = core::f64::consts::TAU / 120.0;

fn body(inertia: Inertia, nutation_deg: f64) -> Body {
    let across = inertia.axial_ratio * SPIN * nutation_deg.to_radians().tan();
    Body {
        inertia,
        epoch: rotation_from_vector(&Vector3::new(0.3, -1.1, 0.7)),
        rate_rad_s: Vector3::new(across * 0.8, across * 0.6, SPIN),
        torque_rad_s2: Vector3::zeros(),
    }
}

/// The printed form: `q_mod = [matrix of q'] q0`, quaternions conjugate to those here. Rounding over a few
/// products of numbers near one: 1e-14; the angles reach 200 rad, whose sine is right to 200 eps.
#[test]
fn the_printed_solution_is_this_one() {
    let inertia = Inertia::principal([14700.0, 14700.0, 29041.9]).unwrap();
    let body = body(inertia, 3.0);
    let l0 = body.momentum_rad_s();
    let u = l0.normalize();
    // as printed: omega_p and omega_l by their definitions
    let wp = (1.0 - inertia.axial_ratio) * body.rate_rad_s.z;
    let wl = inertia.axial_ratio / (1.0 - inertia.axial_ratio) / u.z * wp;
    let rates = nutation_rates(&body);
    assert!((rates.body_rad_s - wp).abs() < 1e-16 && (rates.inertial_rad_s - wl).abs() < 1e-15);
    let paper = body.epoch.conjugate();
    let q0 = Vector4::new(paper.i, paper.j, paper.k, paper.w);
    for t in [-900.0, -37.0, 0.0, 12.5, 411.0, 900.0] {
        let (sa, ca) = (0.5 * wp * t).sin_cos();
        let (sb, cb) = (0.5 * wl * t).sin_cos();
        let q1 = u.x * ca * sb + u.y * sa * sb;
        let q2 = u.y * ca * sb - u.x * sa * sb;
        let q3 = u.z * ca * sb + sa * cb;
        let q4 = ca * cb - u.z * sa * sb;
        #[rustfmt::skip]
        let m = Matrix4::new(
            q4, q3, -q2, q1,
            -q3, q4, q1, q2,
            q2, -q1, q4, q3,
            -q1, -q2, -q3, q4,
        );
        let got = m * q0;
        // back: the attitude matrix of theirs turns axes, so its quaternion is the conjugate of ours
        let theirs = UnitQuaternion::new_normalize(Quaternion::new(got.w, got.x, got.y, got.z));
        let ours = axisymmetric(&body, t);
        let off = rotation_vector(&theirs.conjugate(), &ours).norm();
        assert!(off < 1e-12, "{t}: {off:.1e}");
    }
}

/// Steps of 0.1 rad, sixth order: the error of a step is below (0.1)^7 / 2016000 (Gauss, three stages)
/// or 5e-14 rad; over 1900 steps 9e-11, which is the accuracy that is declared.
#[test]
fn integration_meets_the_closed_form() {
    let inertia = Inertia::principal(IMAGE).unwrap().axisymmetric();
    let body = body(inertia, 5.0);
    let motion = body.motion([-1800.0, 1800.0]).unwrap();
    for (k, t) in motion.t_s().iter().enumerate() {
        let off = rotation_vector(&motion.quaternions()[k], &axisymmetric(&body, *t)).norm();
        assert!(off < 1e-10, "{t}: {off:.1e}");
    }
    // between the steps: the cubic, (0.1)^4 / 384 of the nutation's turn, 0.09 rad
    let off =
        |t: f64| rotation_vector(&motion.attitude(t).unwrap(), &axisymmetric(&body, t)).norm();
    let worst = (0..3000)
        .map(|k| off(-1700.0 + 1.13 * f64::from(k)))
        .fold(0.0, f64::max);
    assert!(worst < 1e-7, "{worst:.1e}");
}

/// A trial of a fit may turn as fast as it likes: it is refused before memory is.
#[test]
fn a_body_that_turns_too_often_is_refused() {
    let fast = body(Inertia::principal([1.0, 1.4, 1.9]).unwrap(), 40.0);
    let refused = fast.motion([-1e11, 1e11]).unwrap_err();
    assert!(
        matches!(refused, AssessError::TooManyTurns { .. }),
        "{refused}"
    );
}

/// A triaxial body, far from symmetric: energy and momentum stay, by the same bound as above with all of
/// the rate in the nutation.
#[test]
fn energy_and_momentum_are_conserved() {
    let inertia = Inertia::principal([1.0, 1.4, 1.9]).unwrap();
    let body = body(inertia, 40.0);
    let motion = body.motion([-2000.0, 2000.0]).unwrap();
    let h0 = body.epoch.inverse() * body.momentum_rad_s();
    let e0 = body.twice_energy(&body.rate_rad_s);
    for t in motion.t_s() {
        let w = motion.rate_rad_s(*t).unwrap();
        let h = motion.attitude(*t).unwrap().inverse() * (inertia.tensor() * w);
        assert!((h - h0).norm() < 1e-11 * h0.norm(), "{t}");
        assert!((body.twice_energy(&w) / e0 - 1.0).abs() < 1e-10, "{t}");
    }
}

/// An independent program integrated the Euler equations (`make_rotator.py`); its tolerance is 1e-13, and
/// over 150 rad of turn it differs from itself at tighter tolerance by less than 1e-10.
#[test]
fn triaxial_motion_is_that_of_an_independent_program() {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../fixtures/oracles/assess/rotator.csv"
    );
    let mut reader = csv::Reader::from_path(path).unwrap();
    let rows: Vec<Vec<f64>> = reader
        .records()
        .map(|row| row.unwrap().iter().map(|x| x.parse().unwrap()).collect())
        .collect();
    assert_eq!(rows.len(), 42);
    for case in rows.chunks(21) {
        let first = &case[0];
        let inertia = Inertia::principal([first[0], first[1], first[2]]).unwrap();
        let body = Body {
            inertia,
            epoch: UnitQuaternion::identity(),
            rate_rad_s: Vector3::new(first[4], first[5], first[6]),
            torque_rad_s2: Vector3::zeros(),
        };
        let motion = body.motion([0.0, 1800.0]).unwrap();
        for row in case {
            let q = UnitQuaternion::new_normalize(Quaternion::new(row[10], row[7], row[8], row[9]));
            let off = rotation_vector(&motion.attitude(row[3]).unwrap(), &q).norm();
            // the cubic between steps: (0.1)^4 / 384 of the nutation, up to a rad here
            assert!(off < 4e-7, "{}: {off:.1e}", row[3]);
            let w = Vector3::new(row[4], row[5], row[6]);
            // its slope: (0.1)^3 / 216 times four, of the nutation
            assert!((motion.rate_rad_s(row[3]).unwrap() - w).norm() < 2e-5 * w.norm());
        }
    }
}

/// What an axisymmetric fit with this `I3/IT` leaves of a triaxial body about body x and y, rms, arcsec.
fn leftover(nutation_deg: f64, axial_ratio: f64) -> [f64; 2] {
    let truth = body(Inertia::principal(IMAGE).unwrap(), nutation_deg);
    let motion = truth.motion([-900.0, 900.0]).unwrap();
    let t_s: Vec<f64> = (0..=1800).map(|k| f64::from(k) - 900.0).collect();
    let q: Vec<_> = t_s.iter().map(|t| motion.attitude(*t).unwrap()).collect();
    let observed = Observed::new(&t_s, &q).unwrap();
    let inertia = Inertia {
        axial_ratio,
        triaxial: [0.0; 2],
    };
    let start = Rotating {
        body: Body { inertia, ..truth },
        to_body: UnitQuaternion::identity(),
        oscillations: vec![],
        steps: vec![],
    };
    let mut free = Free::SIX.to_vec();
    free.extend([Free::Misalignment(0), Free::Misalignment(1)]);
    let fit = Fitter::new(&observed, 0.0)
        .fit(&start, &free, "all")
        .unwrap();
    let [x, y, _] = fit.residual_body_arcsec();
    [x, y].map(|e| (e.iter().map(|e| e * e).sum::<f64>() / e.len() as f64).sqrt())
}

/// Erratum E20. With IT = 14700 as [A01] rounds it, 0.5, 2.6 and 7.8 arcsec are left about body x at 0.12,
/// 0.62 and 1.9 deg of nutation, to the printed digits and 5 percent for the phase of the nutation, which
/// is not told. Most of that is the rounding: with the mean of both moments, 14699.65, the asymmetry
/// leaves 0.14, 0.72 and 2.2 arcsec. Either way it would take more than 10 deg to leave a minute of arc.
#[test]
fn triaxiality_cannot_leave_a_minute_of_arc() {
    let mean = Inertia::principal(IMAGE).unwrap().axial_ratio;
    for (nutation_deg, rounded, exact) in [(0.12, 0.5, 0.14), (0.62, 2.6, 0.72), (1.9, 7.8, 2.2)] {
        let [x, _] = leftover(nutation_deg, IMAGE[2] / 14700.0);
        assert!((x / rounded - 1.0).abs() < 0.05, "{nutation_deg}: {x}");
        for e in leftover(nutation_deg, mean) {
            assert!((e / exact - 1.0).abs() < 0.05, "{nutation_deg}: {e}");
        }
    }
    let [x, y] = leftover(10.0, mean);
    assert!(x.max(y) < 20.0, "{x} {y}");
    assert!(leftover(10.0, IMAGE[2] / 14700.0)[0] < 50.0);
}

/// Erratum E18: 2 (14710.5 - 14688.8) / (14710.5 + 14688.8) = 0.148 percent, and not 7.
#[test]
fn transverse_moments_agree_to_a_seventh_of_a_percent() {
    let image = Inertia::principal(IMAGE).unwrap();
    assert!((200.0 * image.triaxial[0] - 0.148).abs() < 0.001);
    assert!(Inertia::principal([1.0, 1.0, 2.5]).is_err());
    assert!(Inertia::principal([1.0, -1.0, 1.0]).is_err());
}
