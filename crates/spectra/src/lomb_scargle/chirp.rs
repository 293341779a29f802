//! Sums over regular samples at evenly spaced frequencies, by fast transforms.
//!
//! ```text
//! X_j = sum_n x_n e^(2 pi i f_j t_n),   t_n = t_0 + n dt,  f_j = f_0 + j df
//!     = e^(2 pi i f_j t_0) w_j sum_n [ x_n e^(2 pi i f_0 dt n) w_n ] conj(w_(j - n)),   w_m = e^(pi i df dt m^2)
//! ```
//!
//! since n j = (n^2 + j^2 - (j - n)^2) / 2: a convolution. Samples that are missing count as 0.
//!
//! Source: Bluestein, IEEE Trans. Audio Electroacoust. 18 (1970) 451.

use std::f64::consts::TAU;
use std::sync::Arc;

use fourier::{Complex, Fft};

/// Part of a step by which a sample may be off the grid: its phase is off by 3e-6 at most.
const OFF_GRID: f64 = 1e-6;
/// Places of the grid for each sample beyond which it is not worth it.
const SPARSE: f64 = 8.0;

/// Samples on a regular grid with holes.
#[derive(Clone, Debug)]
pub(super) struct Regular {
    start_s: f64,
    step_s: f64,
    /// Place of each sample.
    at: Vec<usize>,
}

impl Regular {
    /// `None` where the samples are on no such grid.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "places of a grid, limited by the number of samples"
    )]
    pub(super) fn of(t_s: &[f64]) -> Option<Self> {
        let (&first, &last) = t_s.first().zip(t_s.last())?;
        let least = t_s.windows(2).map(|w| w[1] - w[0]);
        let least = least.fold(f64::INFINITY, f64::min);
        let steps = ((last - first) / least).round();
        if !(1.0..SPARSE * t_s.len() as f64).contains(&steps) {
            return None;
        }
        let step_s = (last - first) / steps;
        let places = t_s.iter().map(|t| {
            let place = (t - first) / step_s;
            ((place - place.round()).abs() < OFF_GRID).then_some(place.round() as usize)
        });
        Some(Self {
            start_s: first,
            step_s,
            at: places.collect::<Option<_>>()?,
        })
    }
}

/// A plan.
#[derive(Clone)]
pub(super) struct Chirp {
    /// Place of each sample, and what it is multiplied by.
    samples: Vec<(usize, Complex<f64>)>,
    /// What each frequency is multiplied by.
    bins: Vec<Complex<f64>>,
    /// Transform of what is convolved with.
    filter: Vec<Complex<f64>>,
    forward: Arc<dyn Fft<f64>>,
    inverse: Arc<dyn Fft<f64>>,
}

impl std::fmt::Debug for Chirp {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Chirp")
            .field("length", &self.filter.len())
            .finish_non_exhaustive()
    }
}

/// Memory of one transform.
#[derive(Clone, Debug, Default)]
pub(super) struct ChirpScratch {
    pub(super) values: Vec<Complex<f64>>,
    fft: Vec<Complex<f64>>,
}

/// `e^(2 pi i turns factor)`: the product is reduced to one turn before it is rounded.
fn phasor(turns: f64, factor: f64) -> Complex<f64> {
    let product = turns * factor;
    let rest = turns.mul_add(factor, -product);
    let (sin, cos) = (TAU * (product.fract() + rest)).sin_cos();
    Complex::new(cos, sin)
}

impl Chirp {
    /// Of `bins` frequencies from `first_hz` in steps of `step_hz`.
    pub(super) fn new(grid: &Regular, [first_hz, step_hz]: [f64; 2], bins: usize) -> Self {
        let places = grid.at.last().map_or(0, |last| last + 1);
        let length = (places + bins).next_power_of_two();
        let half = 0.5 * step_hz * grid.step_s;
        let chirp = |m: usize| phasor(half, (m * m) as f64);
        let (forward, inverse) = (fourier::forward(length), fourier::inverse(length));
        let mut filter = vec![Complex::new(0.0, 0.0); length];
        for m in 0..places.max(bins) {
            // neither transform is normalised
            let value = chirp(m).conj() / length as f64;
            if m < bins {
                filter[m] = value;
            }
            if m < places {
                filter[(length - m) % length] = value;
            }
        }
        forward.process(&mut filter);
        let sample = |&n: &usize| (n, phasor(first_hz * grid.step_s, n as f64) * chirp(n));
        let bin = |j: usize| {
            let hz = first_hz + j as f64 * step_hz;
            phasor(hz, grid.start_s) * chirp(j)
        };
        Self {
            samples: grid.at.iter().map(sample).collect(),
            bins: (0..bins).map(bin).collect(),
            filter,
            forward,
            inverse,
        }
    }

    /// Number of frequencies.
    pub(super) fn bins(&self) -> usize {
        self.bins.len()
    }

    pub(super) fn make_scratch(&self) -> ChirpScratch {
        let zero = Complex::new(0.0, 0.0);
        let fft =
            (self.forward.get_inplace_scratch_len()).max(self.inverse.get_inplace_scratch_len());
        ChirpScratch {
            values: vec![zero; self.filter.len()],
            fft: vec![zero; fft],
        }
    }

    /// The sums for the samples `x`, in the first places of `scratch.values`.
    pub(super) fn sums(&self, x: impl Iterator<Item = f64>, scratch: &mut ChirpScratch) {
        let ChirpScratch { values, fft } = scratch;
        values.fill(Complex::new(0.0, 0.0));
        for ((place, factor), x) in self.samples.iter().zip(x) {
            values[*place] = factor * x;
        }
        self.forward.process_with_scratch(values, fft);
        for (value, filter) in values.iter_mut().zip(&self.filter) {
            *value *= filter;
        }
        self.inverse.process_with_scratch(values, fft);
        for (value, factor) in values.iter_mut().zip(&self.bins) {
            *value *= factor;
        }
    }
}
