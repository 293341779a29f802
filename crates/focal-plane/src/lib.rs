//! Units, coordinates, pinhole, attitude and stars of a star tracker: the lowest layer.
//!
//! Everything above this crate speaks in its terms. One meaning each, everywhere:
//!
//! ```text
//! attitude      v_tracker = q v_inertial            Hamilton, unit, inertial -> tracker
//! error         theta = log(q_meas q_ref^-1)        tracker axes, rad: v_meas = v_ref + theta x v_ref
//! rate          dv_tracker/dt = -omega x v_tracker  tracker relative to inertial, tracker axes
//! pinhole       x = f X/Z,  y = f Y/Z               [M23] Eq. 1; Z out of the boresight
//! pixels        0 at the boresight, +-n/2 at the edges, x along columns, y along rows
//! angles        radians inside; the unit is in the type or in the name
//! ```
//!
//! | module contents | types |
//! |---|---|
//! | units | [`Angle`], [`ARCSEC_PER_RAD`], [`SPEED_OF_LIGHT_M_S`] |
//! | positions on the detector | [`Tangent`], [`Normalised`], [`Pixel`], [`Camera`] |
//! | slices, structure of arrays | [`Points`], [`Vectors`], [`Quaternions`] and their `Mut` twins |
//! | attitude | [`AttitudeSource`], [`AttitudeSeries`], [`UniformRotation`], [`rotation_vector`] |
//! | stars | [`unit_vector`], [`ra_dec`], [`aberrated`], [`Catalogue`] |
//! | measurements | [`StarFrames`], [`Series`] |
//!
//! ```
//! use focal_plane::{Angle, Camera, unit_vector, rotation_from_vector, rotation_vector};
//! use nalgebra::{UnitQuaternion, Vector3};
//!
//! // AA-STR of [M23]: 20 deg over 1024 px
//! let camera = Camera::from_fov_deg([1024, 1024], [20.0, 20.0])?;
//! assert!((camera.focal_length_px()[0] - 2903.7).abs() < 0.05);
//!
//! // a star near the pole, seen by a tracker that looks along inertial Z
//! let star = unit_vector(Angle::from_deg(30.0), Angle::from_deg(85.0));
//! let pixel = camera.project(&star).expect("in front of the camera");
//! assert!(camera.contains(pixel));
//! assert!((camera.direction(pixel) - star).norm() < 1e-15);
//!
//! // an attitude error of 5 arcsec about X
//! let truth = UnitQuaternion::identity();
//! let measured = rotation_from_vector(&Vector3::new(Angle::from_arcsec(5.0).rad(), 0.0, 0.0)) * truth;
//! let error = rotation_vector(&measured, &truth);
//! assert!((Angle::from_rad(error.x).arcsec() - 5.0).abs() < 1e-12);
//! # Ok::<(), focal_plane::CameraError>(())
//! ```
//!
//! \[M23\]: Miller et al. 2023, In-Orbit Assessment of a Physics-based Star Tracker Model Using
//! DART and PSP Flight Data.
//!
//! Source: \[M23\] Eq. 1 (pinhole); each module names its own.
#![forbid(unsafe_code)]

mod attitude;
mod camera;
mod catalogue;
mod coordinates;
mod frames;
mod series;
mod soa;
mod star;
mod units;

pub use attitude::{
    AttitudeCursor, AttitudeError, AttitudeResidual, AttitudeSeries, AttitudeSource,
    UniformRotation, rotate_each_into, rotate_into, rotation_from_vector, rotation_vector,
    so3_left_jacobian, so3_left_jacobian_inverse,
};
pub use camera::{Camera, CameraError};
pub use catalogue::{Catalogue, CatalogueError, CatalogueStar};
pub use coordinates::{Normalised, Pixel, Tangent};
pub use frames::{FramesError, StarFrames};
pub use series::{Series, SeriesError};
pub use soa::{Points, PointsMut, Quaternions, QuaternionsMut, Vectors, VectorsMut};
pub use star::{aberrated, ra_dec, unit_vector};
pub use units::{ARCSEC_PER_RAD, Angle, SPEED_OF_LIGHT_M_S};
