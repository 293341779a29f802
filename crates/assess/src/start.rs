//! Where a fit of a rotating body begins.
//!
//! ```text
//! spin axis, tracker axes     median rate between frames
//! body axes                   the alignment given, or the turn of the spin axis to body z
//! rate at the epoch           (0, 0, w3)                                             as [A01] starts
//! I3/IT                       given, or 1 + f/w3: f the frequency, body axes, at which the spin axis
//!                             goes round in what a uniform turn leaves
//! ```
//!
//! In the body the angular momentum goes round at `-(1 - I3/IT) w3`. A body that hardly turns is a
//! sphere: any other would have a nutation that its frames cannot show.
//!
//! Source: [A01], start values of the six-parameter fit; the body nutation rate below its Eq. 3.

use focal_plane::{ARCSEC_PER_RAD, Angle};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use crate::model::{Fitter, Free, Rotating};
use crate::rotator::{Body, Inertia};
use crate::{AssessError, Observed};

/// Ratio of an axisymmetric body whose ratio nothing shows: no nutation, so any but 1 will do.
const UNKNOWN_RATIO: f64 = 1.5;
/// Turn over the span below which a body does not count as spinning, rad.
const SPINNING_RAD: f64 = core::f64::consts::TAU;
/// A nutation line must hold this part of the variance that a uniform turn leaves.
const NUTATION_SHARE: f64 = 0.3;

/// A rotation from a matrix printed with few digits: nearest orthonormal, checked.
///
/// # Errors
/// [`AssessError::Alignment`] beyond 1e-3, or a reflection.
pub fn alignment(rows: [[f64; 3]; 3]) -> Result<UnitQuaternion<f64>, AssessError> {
    let m = Matrix3::from_fn(|i, j| rows[i][j]);
    let off = (m * m.transpose() - Matrix3::identity()).amax();
    // written so that a NaN is refused as well
    if !(off <= 1e-3 && m.determinant() > 0.0) {
        return Err(AssessError::Alignment { off });
    }
    Ok(UnitQuaternion::from_rotation_matrix(
        &Rotation3::from_matrix(&m),
    ))
}

/// Angles phi and theta, rad, of the misalignment `M = R3(0) R2(theta) R1(phi)` for which
/// `N M` and `to_body` have the same body z in the tracker; the third Euler angle is unobservable.
///
/// `None` where body z is along tracker X or Y, so that one of the two is unobservable as well.
#[must_use]
pub fn euler_123(to_body: &UnitQuaternion<f64>, nominal: &UnitQuaternion<f64>) -> Option<[f64; 2]> {
    let z = Vector3::z();
    let (seen, wanted) = (to_body.inverse() * z, nominal.inverse() * z);
    let turned = |phi: f64, theta: f64| misalignment_123(phi, theta) * seen;
    let (mut phi, mut theta) = (0.0, 0.0);
    // Newton on two components; the third follows from the norm
    for _ in 0..20 {
        let h = 1e-6;
        let e = turned(phi, theta) - wanted;
        let dphi = (turned(phi + h, theta) - turned(phi - h, theta)) / (2.0 * h);
        let dtheta = (turned(phi, theta + h) - turned(phi, theta - h)) / (2.0 * h);
        let (aa, ab, bb) = (
            dphi.norm_squared(),
            dphi.dot(&dtheta),
            dtheta.norm_squared(),
        );
        let det = aa * bb - ab * ab;
        if det < 1e-6 {
            return None;
        }
        let (ea, eb) = (dphi.dot(&e), dtheta.dot(&e));
        phi -= (bb * ea - ab * eb) / det;
        theta -= (aa * eb - ab * ea) / det;
    }
    Some([phi, theta])
}

/// `M` of \[A01\] Eq. 2 with psi = 0: a 1-2-3 sequence turns axes, not vectors.
#[must_use]
pub fn misalignment_123(phi_rad: f64, theta_rad: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -theta_rad)
        * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -phi_rad)
}

/// A start, and what is known of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Start {
    /// Model to begin with.
    pub model: Rotating,
    /// The alignment as given, or the turn of the spin axis to body z.
    pub nominal: UnitQuaternion<f64>,
    /// Whether the body turns at least once.
    pub spinning: bool,
    /// Whether `I3/IT` can be seen: given, or from nutation.
    pub ratio_seen: bool,
}

/// Finds a start and carries it, over growing spans, to the six-parameter fit of all frames.
///
/// # Errors
/// A fit that does not converge.
pub fn start(
    observed: &Observed,
    inertia: Option<Inertia>,
    given: Option<UnitQuaternion<f64>>,
) -> Result<Start, AssessError> {
    let middle_s = observed.middle_s();
    let rate = observed.rate_rad_s;
    let span_s = observed.t_s[observed.len() - 1] - observed.t_s[0];
    let spinning = rate.norm() * span_s >= SPINNING_RAD;
    let nominal = given.unwrap_or_else(|| {
        if spinning {
            to_z(&rate)
        } else {
            UnitQuaternion::identity()
        }
    });
    // the frame nearest to the middle is the epoch
    let near = |k: &usize| (observed.t_s[*k] - middle_s).abs();
    let all = 0..observed.len();
    let epoch = all
        .min_by(|a, b| near(a).total_cmp(&near(b)))
        .unwrap_or_default();
    let epoch_s = observed.t_s[epoch];
    let in_body = nominal * rate;
    let sphere = Inertia {
        axial_ratio: 1.0,
        triaxial: [0.0; 2],
    };
    let body = |inertia: Inertia, rate_rad_s| Body {
        inertia,
        epoch: nominal * observed.q[epoch],
        rate_rad_s,
        torque_rad_s2: Vector3::zeros(),
    };
    let model = |body: Body| Rotating {
        body,
        to_body: nominal,
        oscillations: vec![],
        steps: vec![],
    };
    if !spinning {
        let model = grow(observed, epoch_s, &model(body(sphere, in_body)))?;
        return Ok(Start {
            model,
            nominal,
            spinning,
            ratio_seen: false,
        });
    }
    let about_z = Vector3::new(0.0, 0.0, in_body.z);
    let (inertia, ratio_seen) = match inertia {
        Some(inertia) => (inertia.axisymmetric(), true),
        None => {
            let uniform = grow(observed, epoch_s, &model(body(sphere, in_body)))?;
            let fitter = Fitter::new(observed, epoch_s);
            let seen = nutation_ratio(&fitter, &uniform)?;
            let ratio = seen.unwrap_or(UNKNOWN_RATIO);
            let inertia = Inertia {
                axial_ratio: ratio,
                triaxial: [0.0; 2],
            };
            (inertia, seen.is_some())
        }
    };
    let model = grow(observed, epoch_s, &model(body(inertia, about_z)))?;
    Ok(Start {
        model,
        nominal,
        spinning,
        ratio_seen,
    })
}

/// The shortest turn of a direction to +z.
fn to_z(axis: &Vector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::rotation_between(axis, &Vector3::z()).unwrap_or_else(|| {
        UnitQuaternion::from_axis_angle(&Vector3::x_axis(), core::f64::consts::PI)
    })
}

/// Six parameters, over a tenth of the frames around the epoch, then more, then all.
fn grow(observed: &Observed, epoch_s: f64, model: &Rotating) -> Result<Rotating, AssessError> {
    let n = observed.len();
    let span_s = observed.t_s[n - 1] - observed.t_s[0];
    let mut model = model.clone();
    for share in [0.1, 0.3, 1.0] {
        let near = |k: usize| (observed.t_s[k] - epoch_s).abs() <= 0.5 * share * span_s + 1e-9;
        let part = observed.only(near);
        if part.len() < 20 {
            continue;
        }
        let fit = Fitter::new(&part, epoch_s).fit(&model, &Free::SIX, "attitude and momentum");
        match fit {
            Ok(fit) => model = fit.model,
            // a short part may not determine six numbers; all frames must
            Err(_) if share < 1.0 => {}
            Err(error) => return Err(error),
        }
    }
    Ok(model)
}

/// `I3/IT` from the line that a uniform turn leaves, if it leaves one.
fn nutation_ratio(fitter: &Fitter<'_>, uniform: &Rotating) -> Result<Option<f64>, AssessError> {
    let residual = fitter.residual_arcsec(uniform)?;
    let observed = fitter.observed();
    let rate = uniform.body.rate_rad_s;
    // the turn of the spin axis to body z, so that transverse is transverse
    let upright = UnitQuaternion::rotation_between(&rate, &Vector3::z())
        .unwrap_or_else(UnitQuaternion::identity);
    let spin = rate.norm();
    let n = observed.len();
    let (mut x, mut y, mut tau) = (vec![], vec![], vec![]);
    for k in 0..n {
        let e = Vector3::from_fn(|axis, _| residual[axis][k]);
        let e = upright * (uniform.to_body * e);
        x.push(e.x);
        y.push(e.y);
        tau.push(observed.t_s[k] - fitter.epoch_s());
    }
    for c in [&mut x, &mut y] {
        let mean = c.iter().sum::<f64>() / n as f64;
        c.iter_mut().for_each(|c| *c -= mean);
    }
    let variance: f64 = x.iter().chain(&y).map(|c| c * c).sum();
    let resolution = core::f64::consts::PI / (2.0 * fitter.half_s()) / 4.0;
    let power = |frequency: f64| {
        let (mut re, mut im) = (0.0, 0.0);
        for k in 0..n {
            let (sin, cos) = (frequency * tau[k]).sin_cos();
            re += x[k] * cos + y[k] * sin;
            im += y[k] * cos - x[k] * sin;
        }
        (re * re + im * im) / n as f64
    };
    // a ratio from 0.05 to 2; around 1 the nutation stands still and is a misalignment
    let (mut best, mut at) = (0.0, 0.0);
    let steps = (2.0 * spin / resolution).ceil();
    let mut k = 0.0;
    while k <= steps {
        let f = spin * (-0.95 + 1.95 * k / steps);
        if f.abs() > 4.0 * resolution && f > -spin + 4.0 * resolution {
            let p = power(f);
            if p > best {
                (best, at) = (p, f);
            }
        }
        k += 1.0;
    }
    let arcsec = best.max(0.0).sqrt() / (n as f64).sqrt();
    let seen =
        best > NUTATION_SHARE * variance && Angle::from_arcsec(arcsec).rad() > 1.0 / ARCSEC_PER_RAD;
    // in the body the momentum goes round at (r - 1) w3, and so does the error of a uniform turn
    Ok(seen.then_some(1.0 + at / spin))
}
