//! Where the stars of a frame are, as one rigid body behind a slightly wrong lens.
//!
//! ```text
//! s_it = base_it + c_i + J_it a_t + beta(base_it) - beta(base_i) + error
//! beta = p1 (2xy, r^2 + 2y^2) + p2 (r^2 + 2x^2, 2xy) + k1 r^2 (x, y),    x, y in units of L
//! ```
//!
//! base: attitude and catalogue; `c_i`: what is constant for star i; `a_t`: a small
//! rotation of frame t, J its effect, px/rad; beta: decentring and radial
//! distortion, px at r = L. Spots and dark map are learned at these positions:
//! a position fitted to its own window would share the errors that are to be
//! learned.
//!
//! Source: Brown 1966, Photogrammetric Engineering 32, 444.

use nalgebra::{Matrix3, Vector3};

use super::sample::Sample;

/// Rounds of attitude, constants and distortion; one would do if every frame held
/// the same stars.
const ROUNDS: usize = 10;
/// Standard deviation, px, at which a coefficient of the distortion is believed
/// without evidence: it only keeps motionless stars from inventing one.
const PRIOR_PX: f64 = 10.0;

/// The rigid model of the positions.
#[derive(Clone, Debug)]
pub(crate) struct Geometry {
    /// `c_i` and the position that its distortion counts from, px.
    constant: Vec<[f64; 2]>,
    origin: Vec<[f64; 2]>,
    distortion: Vector3<f64>,
    weight: Vec<f64>,
    /// L, px.
    length_px: f64,
}

/// Columns p1, p2, k1 of the distortion at a position, px per px.
fn brown(at: [f64; 2], length_px: f64) -> [[f64; 3]; 2] {
    let (x, y) = (at[0] / length_px, at[1] / length_px);
    let r2 = x * x + y * y;
    [
        [2.0 * x * y, r2 + 2.0 * x * x, x * r2],
        [r2 + 2.0 * y * y, 2.0 * x * y, y * r2],
    ]
}

impl Geometry {
    /// Fits the model to positions `at` of the windows of the frames `taken`.
    pub(crate) fn fit(
        sample: &Sample,
        taken: &[usize],
        at: &[[f64; 2]],
        weight: &[f64],
        length_px: f64,
    ) -> Self {
        let mut geometry = Self {
            constant: vec![[0.0; 2]; sample.stars],
            origin: means(sample, taken, |w| sample.base[w]),
            distortion: Vector3::zeros(),
            weight: weight.to_vec(),
            length_px,
        };
        geometry.constant = means(sample, taken, |w| difference(at[w], sample.base[w]));
        let columns = geometry.columns(sample, taken);
        for _ in 0..ROUNDS {
            let residual = geometry.residual(sample, taken, at);
            let mean = means(sample, taken, |w| residual[w]);
            for (c, m) in geometry.constant.iter_mut().zip(&mean) {
                c[0] += m[0];
                c[1] += m[1];
            }
            geometry.improve_distortion(sample, taken, &columns, &residual, &mean);
        }
        geometry
    }

    /// What each coefficient of the distortion moves, attitude and constants taken
    /// out.
    fn columns(&self, sample: &Sample, taken: &[usize]) -> [Vec<[f64; 2]>; 3] {
        std::array::from_fn(|k| {
            let mut column = vec![[0.0; 2]; sample.windows()];
            for &f in taken {
                for w in sample.windows_of(f) {
                    let b = brown(sample.base[w], self.length_px);
                    column[w] = [b[0][k], b[1][k]];
                }
                self.take_off_attitude(sample, f, &mut column);
            }
            let average = means(sample, taken, |w| column[w]);
            for (c, &star) in column.iter_mut().zip(&sample.star) {
                *c = difference(*c, average[star]);
            }
            column
        })
    }

    /// Least squares for the distortion.
    fn improve_distortion(
        &mut self,
        sample: &Sample,
        taken: &[usize],
        columns: &[Vec<[f64; 2]>; 3],
        residual: &[[f64; 2]],
        mean: &[[f64; 2]],
    ) {
        let mut normal = Matrix3::zeros();
        let mut moment = Vector3::zeros();
        let (mut power, mut total) = (0.0, 0.0);
        for &f in taken {
            for w in sample.windows_of(f) {
                let s = sample.star[w];
                for axis in 0..2 {
                    let g = Vector3::from_fn(|k, _| columns[k][w][axis]);
                    let r = residual[w][axis] - mean[s][axis];
                    normal += self.weight[s] * g * g.transpose();
                    moment += self.weight[s] * r * g;
                    power += self.weight[s] * r * r;
                    total += 1.0;
                }
            }
        }
        let prior = (power / f64::max(total, 1.0)).max(1e-12) / (PRIOR_PX * PRIOR_PX);
        moment -= prior * self.distortion;
        normal += Matrix3::from_diagonal_element(prior);
        if let Some(factor) = normal.cholesky() {
            self.distortion += factor.solve(&moment);
        }
    }

    /// What is left of positions `at` after constants, attitude and distortion,
    /// px; 0 for windows outside the frames `taken`.
    pub(crate) fn residual(
        &self,
        sample: &Sample,
        taken: &[usize],
        at: &[[f64; 2]],
    ) -> Vec<[f64; 2]> {
        let mut residual = vec![[0.0; 2]; sample.windows()];
        for &f in taken {
            for w in sample.windows_of(f) {
                let s = sample.star[w];
                let b = brown(sample.base[w], self.length_px);
                let o = brown(self.origin[s], self.length_px);
                for axis in 0..2 {
                    let bent: f64 = (0..3)
                        .map(|k| (b[axis][k] - o[axis][k]) * self.distortion[k])
                        .sum();
                    residual[w][axis] =
                        at[w][axis] - sample.base[w][axis] - self.constant[s][axis] - bent;
                }
            }
            self.take_off_attitude(sample, f, &mut residual);
        }
        residual
    }

    /// Removes from the windows of frame `f` what a rotation of it explains.
    fn take_off_attitude(&self, sample: &Sample, f: usize, values: &mut [[f64; 2]]) {
        let mut normal = Matrix3::<f64>::zeros();
        let mut moment = Vector3::<f64>::zeros();
        for w in sample.windows_of(f) {
            for axis in 0..2 {
                let j = Vector3::from(sample.jacobian[w][axis]);
                let weight = self.weight[sample.star[w]];
                normal += weight * j * j.transpose();
                moment += weight * values[w][axis] * j;
            }
        }
        // Two of three rotations move the image thousands of times more than the
        // third, and with one star the three cannot be told apart.
        let size = normal
            .diagonal()
            .map(|v| if v > 0.0 { v.sqrt() } else { 1.0 });
        for i in 0..3 {
            for j in 0..3 {
                normal[(i, j)] /= size[i] * size[j];
            }
            normal[(i, i)] += 1e-9;
            moment[i] /= size[i];
        }
        let Some(factor) = normal.cholesky() else {
            return;
        };
        let rotation = factor.solve(&moment).component_div(&size);
        for w in sample.windows_of(f) {
            for axis in 0..2 {
                values[w][axis] -= Vector3::from(sample.jacobian[w][axis]).dot(&rotation);
            }
        }
    }
}

fn difference(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

/// Mean of `f` over the windows of each star.
fn means(sample: &Sample, taken: &[usize], f: impl Fn(usize) -> [f64; 2]) -> Vec<[f64; 2]> {
    let mut sum = vec![[0.0; 3]; sample.stars];
    for &k in taken {
        for w in sample.windows_of(k) {
            let v = f(w);
            let s = &mut sum[sample.star[w]];
            *s = [s[0] + v[0], s[1] + v[1], s[2] + 1.0];
        }
    }
    sum.iter()
        .map(|s| [s[0] / s[2].max(1.0), s[1] / s[2].max(1.0)])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::sample::Entry;
    use super::*;

    /// By hand on the axes and the diagonal, as rows (dx, dy) for p1, p2, k1.
    #[test]
    fn decentring_and_radial_terms_by_hand() {
        for (at, expected) in [
            ([2.0, 0.0], [[0.0, 3.0, 1.0], [1.0, 0.0, 0.0]]),
            ([0.0, -2.0], [[0.0, 1.0, 0.0], [3.0, 0.0, -1.0]]),
            ([2.0, 2.0], [[2.0, 4.0, 2.0], [4.0, 2.0, 2.0]]),
        ] {
            let got = brown(at, 2.0);
            for (g, e) in got.as_flattened().iter().zip(expected.as_flattened()) {
                assert!((g - e).abs() < 1e-15, "{got:?}");
            }
        }
    }

    /// Five stars that move by 30 px behind a lens with decentring and radial
    /// distortion of some px at 500 px: found to the second order of what the
    /// attitude absorbs. One star sits in every other frame only, some frames hold
    /// a single star: nothing is left of these, and nothing breaks.
    #[test]
    fn distortion_and_attitude_are_told_apart() {
        let stars = [
            [-300.0, 210.0],
            [350.0, 280.0],
            [60.0, -390.0],
            [-120.0, -60.0],
            [220.0, -80.0],
        ];
        let (length, focal) = (500.0, 40_000.0);
        let truth = [0.4, -0.7, 1.5];
        let values = [1.0, 2.0, 3.0, 2.0];
        let mut frames = Vec::new();
        let mut at = Vec::new();
        for k in 0..200 {
            let t = f64::from(k);
            let shift = [30.0 * (0.05 * t).sin(), 25.0 * (0.031 * t).cos()];
            let rotation = [
                1e-5 * (0.7 * t).sin(),
                1e-5 * (0.3 * t).cos(),
                1e-4 * (0.2 * t).sin(),
            ];
            let mut frame = Vec::new();
            for (star, place) in stars.iter().enumerate() {
                if star == 4 && k % 2 == 0 || star > 0 && k % 50 == 7 {
                    continue;
                }
                let base = [place[0] + shift[0], place[1] + shift[1]];
                let jacobian = [[0.0, focal, -base[1]], [-focal, 0.0, base[0]]];
                let bent = brown(base, length);
                at.push([0, 1].map(|a| {
                    let turn: f64 = (0..3).map(|j| jacobian[a][j] * rotation[j]).sum();
                    let bend: f64 = (0..3).map(|j| bent[a][j] * truth[j]).sum();
                    base[a] + 0.1 * star as f64 + turn + bend
                }));
                frame.push(Entry {
                    t_s: 0.0,
                    row: at.len() - 1,
                    star,
                    start: base,
                    flux: None,
                    base,
                    jacobian,
                    corner: base.map(f64::round),
                    background: 0.0,
                    values: &values,
                });
            }
            frames.push(frame);
        }
        let sample = Sample::collect(5, [2, 2], &[], &frames).unwrap();
        let taken: Vec<usize> = (0..200).filter(|k| k % 3 != 0).collect();
        let others: Vec<usize> = (0..200).filter(|k| k % 3 == 0).collect();
        let rms = |r: &[[f64; 2]]| {
            (r.iter().flatten().map(|v| v * v).sum::<f64>() / r.len() as f64).sqrt()
        };
        let weight = [1.0, 2.0, 1.0, 3.0, 1.0];
        let geometry = Geometry::fit(&sample, &taken, &at, &weight, length);
        assert!(
            (geometry.distortion - Vector3::from(truth)).norm() < 0.05,
            "{}",
            geometry.distortion
        );
        let left = rms(&geometry.residual(&sample, &others, &at));
        let plain = Geometry::fit(&sample, &taken, &at, &weight, f64::INFINITY);
        let without = rms(&plain.residual(&sample, &others, &at));
        assert!(without > 0.01 && left < 0.02 * without, "{left} {without}");
    }
}
