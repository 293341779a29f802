//! Star tracker error models that close the loop with measured data: one door to all crates.
//!
//! Every crate is here under its own name, with its own types and nothing renamed; [`prelude`] brings
//! the few names that almost every program needs.
//!
//! | crate | what it holds |
//! |---|---|
//! | [`focal_plane`] | units, coordinates, pinhole, attitude, stars, frames of measurements |
//! | [`distortion`] | low spatial frequency error: distortion residual polynomials |
//! | [`centroid`] | high spatial frequency error, and centroids of pixel windows |
//! | [`quest`] | attitude from star vectors, one frame or a batch |
//! | [`fourier`] | plans of Fourier transforms |
//! | [`spectra`] | one-sided densities, coherence, lines, Allan deviations of error series |
//! | [`fogm_fit`] | first-order Gauss-Markov processes: simulation, densities, fits |
//! | [`block_regression`] | fits from sums over blocks of time: errors out of fold, honest variances |
//! | [`coloured_noise`] | white and Gauss-Markov noise found, and removed by whitening filters |
//! | [`star_tracker`] | the physics-based model: truth attitude in, centroids and attitude out |
//! | [`effects`] | the catalogue of effects: how each acts, and what it leaves in a residual |
//! | [`telemetry`] | bundles, models and results on disk |
//! | [`scenarios`] | motions and skies: bundles simulated from a scenario |
//! | [`imager`] | pixels: what the detector sees and the tracker reads out, an independent truth |
//! | [`star_images`] | dark map, spots and centroids from raw windows |
//! | [`assess`] | on-orbit noise from quaternions alone: rigid rotator, gyro, plateau |
//! | [`closed_loop`] | residual, cause, better model |
//! | [`comparison`] | residual, spectrum, fitted process and ensemble of a model beside a bundle |
//! | [`figures`] | plots as SVG text from plain numbers |
//! | [`report`] | text and pictures from finished results |
//!
//! # One frame of a star tracker
//!
//! ```
//! use boresight::distortion::{DistortionField, LsfSigma};
//! use boresight::prelude::*;
//! use boresight::star_tracker::{NoiseStreams, Purpose, Scratch, StarField, stream};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // the tracker of DART and Parker Solar Probe
//! let camera = Camera::from_fov_deg([1024, 1024], [20.0, 20.0])?;
//! let lsfe = LsfSigma::Circular(Angle::from_arcsec(3.1667));
//! let field = DistortionField::draw(7, lsfe, &mut stream(1, 0, Purpose::Distortion))?;
//! let tracker = Pbm::new(camera.clone())
//!     .with_distortion(field)
//!     .with_centroid_error(CentroidError::Triangle(Triangle::from_peak(5.06)))
//!     .with_noise(TemporalNoise::circular_arcsec(7.43)?);
//!
//! // fourteen stars, and a tracker at rest
//! let truth = UniformRotation::default();
//! let attitude = truth.attitude(0.0).ok_or("at rest at any time")?;
//! let sky = StarField::generate(&camera, &attitude, 14, &mut stream(1, 0, Purpose::StarField))?;
//! let [x, y, z] = [0, 1, 2].map(|i| sky.stars().iter().map(|s| s.direction[i]).collect::<Vec<_>>());
//! let rows = Rows {
//!     t_s: &[0.0],
//!     first_row: &[0, 14],
//!     slot: &[],
//!     star_id: &[],
//!     mag: &[],
//!     bv: &[],
//!     direction: Vectors { x: &x, y: &y, z: &z },
//! };
//!
//! let mut measured = Measured::default();
//! tracker.measure_into(&truth, rows, &mut NoiseStreams::new(1, 0), &mut Scratch::default(), &mut measured);
//!
//! let error = rotation_vector(&measured.attitude(0).ok_or("14 stars fix an attitude")?, &attitude);
//! // 6.4 arcsec per star and axis: 1.7 across the boresight, some seven times as much about it
//! assert!(Angle::from_rad(error.xy().norm()).arcsec() < 10.0);
//! assert!(Angle::from_rad(error.z.abs()).arcsec() < 80.0);
//! # Ok(())
//! # }
//! ```
#![forbid(unsafe_code)]

#[doc(inline)]
pub use {
    assess, block_regression, centroid, closed_loop, coloured_noise, comparison, distortion,
    effects, figures, focal_plane, fogm_fit, fourier, imager, quest, report, scenarios, spectra,
    star_images, star_tracker, telemetry,
};

/// The names that almost every program needs.
pub mod prelude {
    pub use centroid::{CentroidError, Triangle};
    pub use closed_loop::close;
    pub use distortion::DistortionField;
    pub use effects::{Candidate, Effect};
    pub use focal_plane::{
        Angle, AttitudeSeries, AttitudeSource, Camera, Pixel, StarFrames, UniformRotation, Vectors,
        rotation_vector,
    };
    pub use scenarios::{Scenario, simulate};
    pub use star_tracker::{Disturbance, Measured, Pbm, Rows, TemporalNoise};
    pub use telemetry::{Bundle, Model};
}
