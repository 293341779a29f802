//! Plans of Fourier transforms.
//!
//! ```text
//! forward  X_k = sum over j < n of x_j exp(-2 pi i j k / n)        inverse: with +, neither divides by n
//! ```
//!
//! The transforms are those of `rustfft` and `realfft`. What makes a plan is generic, and every crate
//! that names it compiles all transforms anew, half a minute each: so it is named here alone, and the
//! others ask for what they need. A plan is made for every length asked for, and can be shared by threads.
//!
//! ```
//! let plan = fourier::real_forward(4);
//! let (mut signal, mut spectrum) = (vec![1.0, 0.0, -1.0, 0.0], plan.make_output_vec());
//! plan.process(&mut signal, &mut spectrum)?;
//! assert_eq!(spectrum.iter().map(|c| c.re).collect::<Vec<_>>(), [0.0, 2.0, 0.0]);
//! # Ok::<(), realfft::FftError>(())
//! ```
//!
//! Source: Cooley and Tukey 1965; Bluestein 1970 for lengths with large prime factors.

use std::sync::Arc;

pub use realfft::num_complex::Complex;
pub use realfft::{ComplexToReal, RealToComplex};
pub use rustfft::Fft;

use realfft::RealFftPlanner;
use rustfft::FftPlanner;

/// From `length` real values to the `length / 2 + 1` bins from zero to half the sampling rate.
pub fn real_forward(length: usize) -> Arc<dyn RealToComplex<f64>> {
    RealFftPlanner::new().plan_fft_forward(length)
}

/// Back from `length / 2 + 1` bins to `length` real values, which are `length` times those of
/// [`real_forward`].
pub fn real_inverse(length: usize) -> Arc<dyn ComplexToReal<f64>> {
    RealFftPlanner::new().plan_fft_inverse(length)
}

/// Of `length` complex values, or of any multiple, each `length` by itself.
pub fn forward(length: usize) -> Arc<dyn Fft<f64>> {
    FftPlanner::new().plan_fft_forward(length)
}

/// Back from [`forward`], `length` times as large.
pub fn inverse(length: usize) -> Arc<dyn Fft<f64>> {
    FftPlanner::new().plan_fft_inverse(length)
}

/// As [`forward`], in single precision: half the memory, seven digits.
pub fn forward_single(length: usize) -> Arc<dyn Fft<f32>> {
    FftPlanner::new().plan_fft_forward(length)
}
