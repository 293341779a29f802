//! Noise that all stars of a frame share: the error of the reference that they are held against.
//!
//! A frame's residuals split into the rotation that its stars agree on and what no
//! rotation explains. The centroids' white noise shows in both; an error of the
//! reference shows in the rotation alone, and follows from frame to frame:
//!
//! ```text
//! r_k = A_k theta_k + e_k      theta^_k = N_k^-1 A_k^T r_k,   N_k = A_k^T A_k
//! theta^_k = b_k + w_k         cov w_k = sigma^2 N_k^-1 + diag(white^2)
//! b_k+1 = D_k b_k + n_k        per axis first-order Gauss-Markov (coloured.rs)
//! ```
//!
//! Source: Brown & Hwang 2012, ch. 4 (Gauss-Markov process).

use crate::coloured::Coloured;

/// Half the relative difference of two noises that serve a fit alike.
const ALIKE: f64 = 0.02;

/// What the residuals of stars against a reference are made of, all in one unit of angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommonNoise {
    /// White noise of a centroid per axis.
    pub centroid: f64,
    /// The reference's error per axis: `white` is its own, beside the centroids'.
    pub reference: [Coloured; 3],
}

impl CommonNoise {
    /// Whether the slow parts are alike within what makes no difference to a fit.
    pub fn is_like(&self, other: &Self) -> bool {
        let close = |a: f64, b: f64| (a - b).abs() <= ALIKE * (a + b);
        self.reference
            .iter()
            .zip(&other.reference)
            .all(|(a, b)| close(a.slow, b.slow) && (a.slow <= 0.0 || close(a.tau_s, b.tau_s)))
    }
}
