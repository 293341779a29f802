//! The inherent noise of a residual: what is left when everything slow is taken away.
//!
//! ```text
//! s^2(T) = sum_windows rss / sum_windows (n_i - 3)      parabola removed from windows of span T
//! total  = sigma^2 + c T                                 white noise, and what a parabola leaves of the rest
//! ```
//!
//! Three ways that do not know of each other: the parabolas of [A01] with a plateau that is found and not
//! chosen, the flat intervals of its Eq. 6, and, as rivals, the Allan deviation at one frame and the floor
//! of the spectrum.
//!
//! Source: [A01], text around Fig. 2, and Eq. 6.

mod flat;
mod parabola;
mod plateau;
mod rivals;

pub use flat::{FlatInterval, flat_intervals, pooled_sigma};
pub use parabola::{SpanNoise, Windows, local_maxima, noise_at_span, spans_s};
pub use plateau::{Plateau, find_plateau};
pub(crate) use rivals::agree;
pub use rivals::{Rival, allan_white, spectral_floor};

use crate::AssessError;

/// White noise of one axis, by every way.
#[derive(Clone, Debug, PartialEq)]
pub struct AxisNoise {
    /// Noise against span, from the shortest.
    pub spans: Vec<SpanNoise>,
    /// The plateau; `None` where the noise grows from the start.
    pub plateau: Option<Plateau>,
    /// Flat intervals, of 500 to 1000 s, or of a tenth of a shorter record.
    pub flat: Vec<FlatInterval>,
    /// \[A01\] Eq. 6 over them, arcsec.
    pub flat_sigma: Option<f64>,
    /// Allan deviation at the shortest times.
    pub allan: Option<Rival>,
    /// High-frequency floor of the spectrum.
    pub floor: Option<Rival>,
}

/// Everything about one axis.
///
/// # Errors
/// A spectrum that cannot be made; too short a series gives `None`s instead.
///
/// # Panics
/// If times and values differ in number.
pub fn axis_noise(t_s: &[f64], x: &[f64], step_s: f64) -> Result<AxisNoise, AssessError> {
    let spans: Vec<SpanNoise> = spans_s(t_s, step_s)
        .into_iter()
        .filter_map(|span_s| noise_at_span(t_s, x, step_s, span_s, &Windows::Tiles))
        .collect();
    let plateau = find_plateau(&spans);
    let span_s = t_s[t_s.len() - 1] - t_s[0];
    let lengths_s = if span_s >= 2000.0 {
        [500.0, 1000.0]
    } else {
        [0.1 * span_s, 0.2 * span_s]
    };
    let flat = flat_intervals(t_s, x, step_s, lengths_s, 0.5);
    let flat_sigma = pooled_sigma(&flat);
    Ok(AxisNoise {
        spans,
        plateau,
        flat_sigma,
        flat,
        allan: allan_white(t_s, x, step_s)?,
        floor: spectral_floor(t_s, x, step_s)?,
    })
}
