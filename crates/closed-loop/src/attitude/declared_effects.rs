//! What the declared effects do to a measured attitude: what they do to the star at the boresight, and about it.
//!
//! ```text
//! theta = misalignment(t)
//!       + mean over the exposure of log( q(t + shift + s) q(t)^-1 )     where the samples resolve the motion
//!       + z x ( q direction(q^-1 z) - z ) + z x ( tracker_direction(z) - z )
//! ```
//!
//! These are the terms that candidates fit here, so that a loop closed with the model that it wrote finds none of
//! them again. What moves stars by where they fall has no one rotation, and is left out on both sides.
//!
//! Source: the stages of [`star_tracker::Disturbance`].

use std::sync::Arc;

use effects::{Effect, mean_turn};
use focal_plane::{ARCSEC_PER_RAD, AttitudeSource, Pixel};
use nalgebra::Vector3;
use star_tracker::StarView;

use crate::motion::Around;

/// Rotation of the measured attitude at `t_s`, arcsec, tracker axes.
pub(crate) fn rotation(effects: &[Arc<dyn Effect>], motion: &Around, t_s: f64) -> Vector3<f64> {
    let boresight = StarView {
        t_s,
        slot: -1,
        star_id: -1,
        mag: f64::NAN,
        bv: f64::NAN,
        at: Pixel { x: 0.0, y: 0.0 },
    };
    let (mut theta, mut shift_s, mut exposure_s) = (Vector3::zeros(), 0.0, 0.0_f64);
    for effect in effects {
        let stages = effect.stages();
        if stages.attitude {
            theta += effect.misalignment_rad(t_s);
        }
        if stages.instant {
            shift_s += effect.time_shift_s(&boresight);
        }
        if stages.exposure {
            exposure_s = exposure_s.max(effect.exposure_s());
        }
        if stages.direction
            && let Some(q) = motion.attitude(t_s)
        {
            let v = q * effect.direction(&boresight, q.inverse() * Vector3::z());
            theta += Vector3::z().cross(&v);
        }
        if stages.tracker_direction {
            theta += Vector3::z().cross(&effect.tracker_direction(&boresight, Vector3::z()));
        }
    }
    if motion.resolved() && (shift_s != 0.0 || exposure_s > 0.0) {
        theta += mean_turn(motion, t_s, shift_s, exposure_s, &mut 0).unwrap_or_default();
    }
    theta * ARCSEC_PER_RAD
}
