//! The places where an effect may act on a measurement, in the order of the light.
//!
//! ```text
//! catalogue direction u
//!   -> direction            u' = direction(star, u)                     inertial, before the tracker
//!   -> instant, exposure    q(t + time_shift), averaged over exposure   which attitude the row sees
//!   -> attitude             v = exp([theta x]) q u'                     theta = misalignment, tracker axes
//!   -> tracker_direction    v' = tracker_direction(star, v)             tracker axes
//!   -> pinhole, image       P = project(v') + image_shift
//!   -> distortion           P += eps(P)                                 declared LSFE, [M23] Eq. 4-8
//!   -> centroid             P += c(P) + centroid_shift(P)               declared HSFE, [M23] Eq. 10
//!   -> noise                P += n,  n ~ N(0, noise_sigma^2), + spike   per axis
//! ```
//!
//! A disturbance says in [`Disturbance::stages`] where it acts; the pipeline asks it nowhere else, so
//! a model without disturbances runs the plain kernels only.
//!
//! Source: the stages are Steps 1-4 of \[M23\] Fig. 4 with the omissions its Sections 2.2 and 4.2.1 name
//! (finite exposure, shutter, alignment) put at the point where they arise.

use core::fmt::Debug;

use focal_plane::Pixel;
use nalgebra::Vector3;

/// What a disturbance may know about the star it moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StarView {
    /// Time stamp of the frame, s: the middle of the exposure of row y = 0.
    pub t_s: f64,
    /// The tracker's slot.
    pub slot: i32,
    /// Catalogue identity.
    pub star_id: i64,
    /// Magnitude; NaN when unknown.
    pub mag: f64,
    /// Colour B - V, magnitudes; NaN when unknown.
    pub bv: f64,
    /// Where the star is at this stage, before the disturbance acts.
    pub at: Pixel,
}

/// The stages at which a disturbance acts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stages {
    /// [`Disturbance::direction`].
    pub direction: bool,
    /// [`Disturbance::time_shift_s`].
    pub instant: bool,
    /// [`Disturbance::exposure_s`].
    pub exposure: bool,
    /// [`Disturbance::misalignment_rad`].
    pub attitude: bool,
    /// [`Disturbance::tracker_direction`].
    pub tracker_direction: bool,
    /// [`Disturbance::image_shift_px`].
    pub image: bool,
    /// [`Disturbance::centroid_shift_px`].
    pub centroid: bool,
    /// [`Disturbance::noise_sigma_arcsec`].
    pub noise: bool,
    /// [`Disturbance::spike_px`].
    pub spike: bool,
}

impl Stages {
    /// No stage.
    pub const NONE: Self = Self {
        direction: false,
        instant: false,
        exposure: false,
        attitude: false,
        tracker_direction: false,
        image: false,
        centroid: false,
        noise: false,
        spike: false,
    };

    /// Stages of either.
    #[must_use]
    pub const fn union(self, other: Self) -> Self {
        Self {
            direction: self.direction | other.direction,
            instant: self.instant | other.instant,
            exposure: self.exposure | other.exposure,
            attitude: self.attitude | other.attitude,
            tracker_direction: self.tracker_direction | other.tracker_direction,
            image: self.image | other.image,
            centroid: self.centroid | other.centroid,
            noise: self.noise | other.noise,
            spike: self.spike | other.spike,
        }
    }
}

/// Something that a measurement suffers beyond the declared model.
///
/// Every method has the neutral answer as its default; a method is called only when
/// [`stages`](Self::stages) says so. Methods are pure: the same question gets the same answer, so that
/// results do not depend on the order of evaluation or on threads.
pub trait Disturbance: Debug + Send + Sync {
    /// Where it acts.
    fn stages(&self) -> Stages;

    /// Apparent inertial direction of a star whose catalogue direction is `u` (both unit vectors).
    fn direction(&self, star: &StarView, u: Vector3<f64>) -> Vector3<f64> {
        let _ = star;
        u
    }

    /// Middle of this row's exposure minus the frame's time stamp, s.
    fn time_shift_s(&self, star: &StarView) -> f64 {
        let _ = star;
        0.0
    }

    /// Length of the exposure over which the centroid is averaged, s.
    fn exposure_s(&self) -> f64 {
        0.0
    }

    /// Rotation of the whole tracker at `t_s`, rad, tracker axes: `v' = exp([theta x]) v`.
    fn misalignment_rad(&self, t_s: f64) -> Vector3<f64> {
        let _ = t_s;
        Vector3::zeros()
    }

    /// Apparent direction in tracker axes of a star at `v` (both unit vectors).
    fn tracker_direction(&self, star: &StarView, v: Vector3<f64>) -> Vector3<f64> {
        let _ = star;
        v
    }

    /// Shift of the image at `star.at` (pinhole position), px, before the declared distortion.
    fn image_shift_px(&self, star: &StarView) -> [f64; 2] {
        let _ = star;
        [0.0; 2]
    }

    /// Shift of the centroid of the image at `star.at` (distorted, noise-free), px, beside the declared
    /// centroid error.
    fn centroid_shift_px(&self, star: &StarView) -> [f64; 2] {
        let _ = star;
        [0.0; 2]
    }

    /// Per-axis temporal noise of this star, arcsec, when it would be `sigma_arcsec` without this
    /// disturbance; `speed_arcsec_s` is the star's speed across the detector.
    fn noise_sigma_arcsec(&self, star: &StarView, speed_arcsec_s: f64, sigma_arcsec: f64) -> f64 {
        let _ = (star, speed_arcsec_s);
        sigma_arcsec
    }

    /// A spike on this row, px. `uniform` yields independent numbers in [0, 1) and is the only source
    /// of randomness; it must be called the same number of times whatever the numbers are.
    fn spike_px(&self, star: &StarView, uniform: &mut dyn FnMut() -> f64) -> [f64; 2] {
        let _ = (star, uniform);
        [0.0; 2]
    }
}
