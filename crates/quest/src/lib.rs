//! QUEST: the attitude that best turns catalogue directions into measured ones.
//!
//! [`quest`] solves one frame with its covariance; [`ProfileBatch`] and [`solve_batch_into`] solve
//! many frames without allocating. The attitude is inertial to tracker everywhere:
//! `v_tracker = q * v_inertial`.
//!
//! ```
//! use nalgebra::{UnitQuaternion, Vector3};
//!
//! let attitude = UnitQuaternion::from_euler_angles(0.3, -1.1, 2.9);
//! let catalogue = [Vector3::x(), Vector3::y(), Vector3::new(0.6, 0.0, 0.8)];
//! let measured = catalogue.map(|v| attitude * v);
//!
//! let sigma_rad = 5e-5; // per star and axis, about 10 arcsec
//! let weights = [1.0 / (sigma_rad * sigma_rad); 3];
//! let solution = quest::quest(&measured, &catalogue, &weights)?;
//!
//! assert!(solution.q.angle_to(&attitude) < 1e-15 / solution.gap);
//! assert!(solution.covariance.diagonal().max().sqrt() < 2.0 * sigma_rad);
//! # Ok::<(), quest::QuestError>(())
//! ```
//!
//! # How exact
//!
//! Everything rests on the gap between the two largest eigenvalues of Davenport's matrix at unit
//! total weight. Stars spread by `s` rad (rms) about their mean direction have a gap near `2 s^2`:
//! 0.03 for a field of 20 degrees, 1.5e-4 for two stars 1 degree apart.
//!
//! | gap | method | rounding error of the attitude |
//! |---|---|---|
//! | above [`POLISH_GAP`] | Newton on the quartic | `< 40 eps/gap^2`, so below 4e-10 rad |
//! | down to [`MIN_GAP`] | and inverse iteration | `< 40 eps/gap` |
//! | below | [`QuestError::Degenerate`] or [`QuestError::Parallel`] | |
//!
//! One frame and a batch run the same arithmetic: from the same profile they agree bit for bit.
//!
//! Source: Shuster & Oh, J. Guidance and Control 4 (1981) 70-77, doi:10.2514/3.19717, as used by
//! \[M23\] section 2.5; the quartic in the form of Markley, J. Astronautical Sciences 41 (1993) 261.
#![forbid(unsafe_code)]

mod batch;
mod covariance;
mod error;
mod gap_limits;
mod polish;
mod profile;
mod quartic;
mod sequential;
mod single;
mod unit_vectors;

pub use batch::{FrameStatus, ProfileBatch, QuaternionsMut, Vectors, solve_batch_into};
pub use covariance::{covariance, covariance_as_printed};
pub use error::QuestError;
pub use gap_limits::{MIN_GAP, POLISH_GAP};
pub use profile::{Attitude, Profile};
pub use single::{Solution, quest};
pub use unit_vectors::UNIT_TOLERANCE;
