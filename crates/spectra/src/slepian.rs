//! Discrete prolate spheroidal sequences: the tapers with the most energy inside a band.
//!
//! ```text
//! T v = theta v,   T[t][t] = ((N - 1 - 2t)/2)^2 cos(2 pi W),   T[t][t-1] = t (N - t)/2
//! lambda = sum_tau r[tau] sin(2 pi W tau)/(pi tau),   r[tau] = sum_t v[t] v[t + tau]
//! ```
//!
//! The eigenvectors of the largest eigenvalues of this tridiagonal matrix are the tapers, in the order
//! of their concentration `lambda`, the share of energy within +-W. Eigenvalues by bisection, vectors by
//! inverse iteration. Each taper has unit energy; symmetric ones have a positive sum, antisymmetric ones
//! begin positive.
//!
//! Source: Slepian, Bell Syst. Tech. J. 57 (1978) 1371, Eqs. 14, 61; Percival & Walden (1993), Sections 8.2, 8.3.

use std::f64::consts::{PI, TAU};

use crate::SpectraError;

/// Slepian tapers of one length and bandwidth.
#[derive(Clone, Debug, PartialEq)]
pub struct Slepian {
    samples: usize,
    tapers: Vec<f64>,
    concentration: Vec<f64>,
}

impl Slepian {
    /// The first `count` tapers of `samples` samples with half-bandwidth `W = time_half_bandwidth / samples`
    /// (cycles a sample).
    ///
    /// ```
    /// let tapers = spectra::Slepian::new(128, 4.0, 7)?;
    /// assert!(tapers.concentration()[0] > 1.0 - 1e-9);
    /// let energy: f64 = tapers.taper(3).iter().map(|v| v * v).sum();
    /// assert!((energy - 1.0).abs() < 1e-14);
    /// # Ok::<(), spectra::SpectraError>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`SpectraError::Bandwidth`] unless it lies between 0 and half of the samples,
    /// [`SpectraError::Tapers`] for none or more than there are samples.
    pub fn new(
        samples: usize,
        time_half_bandwidth: f64,
        count: usize,
    ) -> Result<Self, SpectraError> {
        let n = samples as f64;
        if !(time_half_bandwidth > 0.0 && time_half_bandwidth < 0.5 * n) {
            return Err(SpectraError::Bandwidth {
                time_half_bandwidth,
                samples,
            });
        }
        if count == 0 || count > samples {
            return Err(SpectraError::Tapers {
                got: count,
                least: 1,
                most: samples,
            });
        }
        let w = time_half_bandwidth / n;
        let matrix = Tridiagonal {
            diagonal: (0..samples)
                .map(|t| (0.5 * (n - 1.0 - 2.0 * t as f64)).powi(2) * (TAU * w).cos())
                .collect(),
            off: (1..samples)
                .map(|t| 0.5 * t as f64 * (n - t as f64))
                .collect(),
        };
        let mut tapers = Vec::with_capacity(samples * count);
        let mut above = matrix.bounds()[1];
        for k in 0..count {
            let theta = matrix.eigenvalue_from_top(k, above);
            tapers.extend(matrix.eigenvector(theta, k % 2 == 1));
            above = theta + 1e-12 * theta.abs();
        }
        tapers.chunks_exact_mut(samples).for_each(set_sign);
        let concentration = concentrations(samples, &tapers, w);
        Ok(Self {
            samples,
            tapers,
            concentration,
        })
    }

    /// Samples of a taper.
    #[must_use]
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// Number of tapers.
    #[must_use]
    pub fn count(&self) -> usize {
        self.concentration.len()
    }

    /// Taper `k`.
    ///
    /// # Panics
    ///
    /// If there is no such taper.
    #[must_use]
    pub fn taper(&self, k: usize) -> &[f64] {
        &self.tapers[k * self.samples..(k + 1) * self.samples]
    }

    /// Share of the energy of each taper within the band.
    #[must_use]
    pub fn concentration(&self) -> &[f64] {
        &self.concentration
    }
}

/// A symmetric tridiagonal matrix; `off[i]` stands between `i` and `i + 1`.
struct Tridiagonal {
    diagonal: Vec<f64>,
    off: Vec<f64>,
}

impl Tridiagonal {
    /// Gershgorin's limits of the eigenvalues.
    fn bounds(&self) -> [f64; 2] {
        let last = self.diagonal.len() - 1;
        let mut bounds = [f64::INFINITY, f64::NEG_INFINITY];
        for (i, d) in self.diagonal.iter().enumerate() {
            let left = if i > 0 { self.off[i - 1] } else { 0.0 };
            let right = if i < last { self.off[i] } else { 0.0 };
            let radius = left.abs() + right.abs();
            bounds = [bounds[0].min(d - radius), bounds[1].max(d + radius)];
        }
        let margin = 1e-12 * bounds[0].abs().max(bounds[1].abs()) + f64::MIN_POSITIVE;
        [bounds[0] - margin, bounds[1] + margin]
    }

    /// Number of eigenvalues above `x`, by the signs of the pivots (Sturm).
    fn count_above(&self, x: f64) -> usize {
        let mut pivot = self.diagonal[0] - x;
        let mut above = usize::from(pivot > 0.0);
        for (d, e) in self.diagonal[1..].iter().zip(&self.off) {
            if pivot == 0.0 {
                pivot = f64::EPSILON * e.abs().max(f64::MIN_POSITIVE);
            }
            pivot = d - x - e * e / pivot;
            above += usize::from(pivot > 0.0);
        }
        above
    }

    /// The eigenvalue below which `k` others lie above, known to lie below `above`.
    fn eigenvalue_from_top(&self, k: usize, above: f64) -> f64 {
        let (mut low, mut high) = (self.bounds()[0], above.min(self.bounds()[1]));
        loop {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                return middle;
            }
            if self.count_above(middle) > k {
                low = middle;
            } else {
                high = middle;
            }
        }
    }

    /// The vector of the eigenvalue `theta`, of unit length and of known parity.
    fn eigenvector(&self, theta: f64, odd: bool) -> Vec<f64> {
        let n = self.diagonal.len();
        let factors = Factors::new(self, theta);
        // a start without zeros in any direction: the fractional parts of multiples of the golden ratio
        let mut v: Vec<f64> = (0..n)
            .map(|t| (t as f64 * 0.618_033_988_749_894_8).fract() + 0.5)
            .collect();
        for _ in 0..4 {
            take_parity(&mut v, odd);
            factors.solve(&mut v);
            normalise(&mut v);
        }
        take_parity(&mut v, odd);
        normalise(&mut v);
        v
    }
}

/// `T - theta` as a product of triangles, rows exchanged where that keeps the pivots large.
struct Factors {
    pivot: Vec<f64>,
    first: Vec<f64>,
    second: Vec<f64>,
    multiplier: Vec<f64>,
    exchanged: Vec<bool>,
}

impl Factors {
    fn new(matrix: &Tridiagonal, theta: f64) -> Self {
        let n = matrix.diagonal.len();
        let floor = f64::EPSILON * matrix.bounds()[1].abs().max(f64::MIN_POSITIVE);
        let mut f = Self {
            pivot: vec![0.0; n],
            first: vec![0.0; n],
            second: vec![0.0; n],
            multiplier: vec![0.0; n],
            exchanged: vec![false; n],
        };
        // the row that is being eliminated: places i, i + 1
        let mut row = [
            matrix.diagonal[0] - theta,
            matrix.off.first().copied().unwrap_or(0.0),
        ];
        for i in 0..n - 1 {
            let below = [
                matrix.off[i],
                matrix.diagonal[i + 1] - theta,
                matrix.off.get(i + 1).copied().unwrap_or(0.0),
            ];
            if row[0].abs() >= below[0].abs() {
                f.pivot[i] = row[0];
                f.first[i] = row[1];
                f.multiplier[i] = below[0] / row[0];
                row = [below[1] - f.multiplier[i] * row[1], below[2]];
            } else {
                f.exchanged[i] = true;
                f.pivot[i] = below[0];
                f.first[i] = below[1];
                f.second[i] = below[2];
                f.multiplier[i] = row[0] / below[0];
                row = [
                    row[1] - f.multiplier[i] * below[1],
                    -f.multiplier[i] * below[2],
                ];
            }
        }
        f.pivot[n - 1] = if row[0].abs() < floor { floor } else { row[0] };
        f
    }

    fn solve(&self, v: &mut [f64]) {
        let n = v.len();
        for i in 0..n - 1 {
            if self.exchanged[i] {
                v.swap(i, i + 1);
            }
            v[i + 1] -= self.multiplier[i] * v[i];
        }
        for i in (0..n).rev() {
            let right = if i + 1 < n {
                self.first[i] * v[i + 1]
            } else {
                0.0
            };
            let further = if i + 2 < n {
                self.second[i] * v[i + 2]
            } else {
                0.0
            };
            v[i] = (v[i] - right - further) / self.pivot[i];
        }
    }
}

fn take_parity(v: &mut [f64], odd: bool) {
    let n = v.len();
    let sign = if odd { -1.0 } else { 1.0 };
    for t in 0..n.div_ceil(2) {
        let even = 0.5 * (v[t] + sign * v[n - 1 - t]);
        v[n - 1 - t] = sign * even;
        v[t] = even;
    }
}

fn normalise(v: &mut [f64]) {
    let largest = v.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    v.iter_mut().for_each(|x| *x /= largest);
    let norm = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    v.iter_mut().for_each(|x| *x /= norm);
}

/// Symmetric: positive sum. Antisymmetric: the first value that counts is positive.
fn set_sign(v: &mut [f64]) {
    let n = v.len();
    let symmetric = (v[0] - v[n - 1]).abs() <= (v[0] + v[n - 1]).abs();
    let threshold = (1.0 / n as f64).max(1e-7);
    let leading = if symmetric {
        v.iter().sum()
    } else {
        v.iter()
            .copied()
            .find(|x| x * x > threshold)
            .unwrap_or(v[0])
    };
    if leading < 0.0 {
        v.iter_mut().for_each(|x| *x = -*x);
    }
}

/// Share of the energy of each taper within +-`w` cycles a sample, from its autocorrelation.
fn concentrations(samples: usize, tapers: &[f64], w: f64) -> Vec<f64> {
    let length = (2 * samples).next_power_of_two();
    let forward = fourier::real_forward(length);
    let inverse = fourier::real_inverse(length);
    let (mut padded, mut spectrum) = (forward.make_input_vec(), forward.make_output_vec());
    let mut of_taper = |taper: &[f64]| {
        padded.fill(0.0);
        padded[..samples].copy_from_slice(taper);
        let mut done = forward.process(&mut padded, &mut spectrum);
        for z in &mut spectrum {
            *z = (z.norm_sqr()).into();
        }
        done = done.and_then(|()| inverse.process(&mut spectrum, &mut padded));
        assert!(done.is_ok(), "buffers of one plan: {done:?}");
        let tail: f64 = (1..samples)
            .map(|tau| {
                let tau_f = tau as f64;
                padded[tau] * (TAU * w * tau_f).sin() / (PI * tau_f)
            })
            .sum();
        ((padded[0] * 2.0 * w + 2.0 * tail) / length as f64).min(1.0)
    };
    tapers.chunks_exact(samples).map(&mut of_taper).collect()
}
