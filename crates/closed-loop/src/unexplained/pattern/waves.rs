//! Cosines and sines of waves at millions of places, with the widest registers that the machine has.
//!
//! ```text
//! h = pi (u - round u)     sin h = h sum (-1)^k h^2k / (2k + 1)!     cos h = sum (-1)^k h^2k / (2k)!
//! cos 2 pi u = 1 - 2 sin^2 h     sin 2 pi u = 2 sin h cos h           to 1e-11, u in cycles
//! ```
//!
//! Written in the machine's vectors: left to itself, the compiler takes row by row.
//!
//! Not physics: a series of sine and cosine.

use std::f64::consts::PI;

use pulp::{Scalar, Simd, WithSimd};

/// Sums over the rows of a star before the means are taken out.
pub(super) const RAW: usize = 11;

/// `(-1)^k / (2k + 1)!` and `(-1)^k / (2k)!`, last first.
const SIN: [f64; 9] = factorials(1);
const COS: [f64; 9] = factorials(0);

const fn factorials(first: u32) -> [f64; 9] {
    let mut out = [1.0; 9];
    let (mut k, mut value) = (1, 1.0);
    while k < 9 {
        let n = (2 * k + first) as f64;
        value *= -1.0 / (n * (n - 1.0));
        out[8 - k as usize] = value;
        k += 1;
    }
    out
}

/// Cosine and sine of a number of cycles.
pub(super) fn wave(cycles: f64) -> [f64; 2] {
    Vectors(Scalar).wave(cycles)
}

/// What is needed of the machine's vectors.
#[derive(Clone, Copy)]
struct Vectors<S: Simd>(S);

impl<S: Simd> Vectors<S> {
    #[inline(always)]
    fn of(self, v: f64) -> S::f64s {
        self.0.splat_f64s(v)
    }

    #[inline(always)]
    fn times(self, a: S::f64s, b: S::f64s) -> S::f64s {
        self.0.mul_f64s(a, b)
    }

    #[inline(always)]
    fn plus(self, a: S::f64s, b: S::f64s) -> S::f64s {
        self.0.add_f64s(a, b)
    }

    #[inline(always)]
    fn series(self, coefficients: [f64; 9], z: S::f64s) -> S::f64s {
        let [first, rest @ ..] = coefficients;
        let mut sum = self.of(first);
        for c in rest {
            sum = self.plus(self.times(sum, z), self.of(c));
        }
        sum
    }

    #[inline(always)]
    fn wave(self, cycles: S::f64s) -> [S::f64s; 2] {
        // adding and taking off 1.5 2^52 rounds to a whole number
        let whole = self.of(6_755_399_441_055_744.0);
        let rounded = self.0.sub_f64s(self.plus(cycles, whole), whole);
        let h = self.times(self.of(PI), self.0.sub_f64s(cycles, rounded));
        let z = self.times(h, h);
        let sin = self.times(h, self.series(SIN, z));
        let cos = self.series(COS, z);
        let twice = self.plus(sin, sin);
        let square = self.times(twice, sin);
        [
            self.0.sub_f64s(self.of(1.0), square),
            self.times(twice, cos),
        ]
    }

    /// Cosines and sines of wave vector k at some places.
    #[inline(always)]
    fn wave_at(self, k: [f64; 2], x: S::f64s, y: S::f64s) -> [S::f64s; 2] {
        let [kx, ky] = k.map(|k| self.of(k));
        self.wave(self.plus(self.times(kx, x), self.times(ky, y)))
    }

    /// Adds what rows give to [`RawSums`].
    #[inline(always)]
    fn add(
        self,
        sums: &mut [S::f64s; RAW],
        k: [f64; 2],
        [x, y]: [S::f64s; 2],
        [rx, ry]: [S::f64s; 2],
    ) {
        let [c, s] = self.wave_at(k, x, y);
        let products = [(c, c), (c, s), (s, s), (c, rx), (s, rx), (c, ry), (s, ry)];
        sums[0] = self.plus(sums[0], c);
        sums[1] = self.plus(sums[1], s);
        for (sum, (a, b)) in sums[2..9].iter_mut().zip(products) {
            *sum = self.plus(*sum, self.times(a, b));
        }
        sums[9] = self.plus(sums[9], rx);
        sums[10] = self.plus(sums[10], ry);
    }
}

/// Sums of cos and sin of a wave at some places, of their products, and of both with the residuals there.
pub(super) struct RawSums<'a> {
    pub(super) at: [&'a [f64]; 2],
    pub(super) residual: [&'a [f64]; 2],
    pub(super) k: [f64; 2],
}

impl WithSimd for RawSums<'_> {
    type Output = [f64; RAW];

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> [f64; RAW] {
        let (vectors, one) = (Vectors(simd), Vectors(Scalar));
        let [x, y, rx, ry] = [self.at[0], self.at[1], self.residual[0], self.residual[1]]
            .map(|v| S::as_simd_f64s(v));
        let mut sums = [vectors.of(0.0); RAW];
        let places = x.0.iter().zip(y.0).zip(rx.0.iter().zip(ry.0));
        for ((x, y), (rx, ry)) in places {
            vectors.add(&mut sums, self.k, [*x, *y], [*rx, *ry]);
        }
        let mut out = sums.map(|sum| simd.reduce_sum_f64s(sum));
        let rest = x.1.iter().zip(y.1).zip(rx.1.iter().zip(ry.1));
        for ((x, y), (rx, ry)) in rest {
            one.add(&mut out, self.k, [*x, *y], [*rx, *ry]);
        }
        out
    }
}

/// Cosines and sines of a wave at some places.
pub(super) struct Waves<'a> {
    pub(super) at: [&'a [f64]; 2],
    pub(super) k: [f64; 2],
    pub(super) cos: &'a mut [f64],
    pub(super) sin: &'a mut [f64],
}

impl WithSimd for Waves<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (vectors, one) = (Vectors(simd), Vectors(Scalar));
        let [x, y] = self.at.map(|v| S::as_simd_f64s(v));
        let cos = S::as_mut_simd_f64s(self.cos);
        let sin = S::as_mut_simd_f64s(self.sin);
        let places = x.0.iter().zip(y.0);
        for ((cos, sin), (x, y)) in cos.0.iter_mut().zip(sin.0).zip(places) {
            [*cos, *sin] = vectors.wave_at(self.k, *x, *y);
        }
        let places = x.1.iter().zip(y.1);
        for ((cos, sin), (x, y)) in cos.1.iter_mut().zip(sin.1).zip(places) {
            [*cos, *sin] = one.wave_at(self.k, *x, *y);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pulp::Arch;

    /// Fewer rows than any vector is wide, and more. Terms left out of the series are 6e-13 and 7e-12 at a right
    /// angle, doubled 1e-11 at most: 1001 rows of up to 500 lose 5e-6, and their sums are of the order of 1e4.
    #[test]
    fn sums_are_those_of_the_standard_functions() {
        for rows in [3, 1001] {
            let [x, y, rx, ry] = [1.7, 0.9, 0.31, 0.57].map(|step| -> Vec<f64> {
                (0..rows)
                    .map(|i| 500.0 * (step * f64::from(i)).sin())
                    .collect()
            });
            let (mut cos, mut sin) = (vec![0.0; x.len()], vec![0.0; x.len()]);
            let k = [0.37, -0.81];
            let at = [x.as_slice(), &y];
            Arch::new().dispatch(Waves {
                at,
                k,
                cos: &mut cos,
                sin: &mut sin,
            });
            let residual = [rx.as_slice(), &ry];
            let sums = Arch::new().dispatch(RawSums { at, residual, k });
            let mut known = [0.0; RAW];
            for i in 0..x.len() {
                let (s, c) = (2.0 * PI * (k[0] * x[i] + k[1] * y[i])).sin_cos();
                assert!((cos[i] - c).abs() < 1e-10 && (sin[i] - s).abs() < 1e-10);
                let (u, v) = (rx[i], ry[i]);
                let own = [c, s, c * c, c * s, s * s, c * u, s * u, c * v, s * v, u, v];
                known.iter_mut().zip(own).for_each(|(sum, v)| *sum += v);
            }
            for (sum, known) in sums.iter().zip(known) {
                assert!((sum - known).abs() < 1e-5, "{sums:?} {known:?}");
            }
        }
    }
}
