//! What a spectrum tells of the three parameters at best, and the bias of the estimate that gets it.
//!
//! ```text
//! I_ij = sum_k (nu_k/2) f_i f_j / f^2                                   Fisher's information
//! E[error_r] = -1/2 (I^-1)_rs sum_k (nu_k/2) (f_s/f) (I^-1)_tu f_tu/f   to order 1/n
//! ```
//!
//! with `f` the sampled density and subscripts its derivatives by `ln sigma_HSF, ln tau,
//! ln sigma_TN`. The second line is the bias of Cox and Snell worked out for independent bins of
//! `chi2_nu/nu`: it is zero where `f` is linear in the parameters. It holds for the time-domain
//! likelihood too, whose cumulants are the same to this order (docs/fogm-fit.md).
//!
//! Source: Whittle, Arkiv foer Matematik 2 (1953) 423; Cox & Snell, J. R. Stat. Soc. B 30 (1968) 248.

use super::bins::Bins;
use super::likelihood::Logs;

type Matrix = [[f64; 3]; 3];

/// Covariance and bias of the logarithms of the parameters; `None` where the information is singular.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spread {
    pub(crate) covariance: Matrix,
    pub(crate) bias: [f64; 3],
}

/// Density, and its first and second derivatives by the logarithms, in units of 2/fs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Derivatives {
    pub(crate) f: f64,
    pub(crate) first: [f64; 3],
    pub(crate) second: Matrix,
}

/// At `cycles` = f/fs, for `x` = dt/tau.
pub(crate) fn derivatives(s2: f64, x: f64, w2: f64, cycles: f64) -> Derivatives {
    let half = (std::f64::consts::PI * cycles).sin();
    let (sin2, cos) = (half * half, (std::f64::consts::TAU * cycles).cos());
    // gain = sinh x / (cosh x - cos)
    let sh = (0.5 * x).sinh();
    let d = 2.0 * sh * sh + 2.0 * sin2;
    let top = 2.0 * sin2 - 2.0 * sh * sh * cos;
    let gain = x.sinh() / d;
    let by_x = top / (d * d);
    let by_xx = -x.sinh() * (top + 4.0 * sin2 * (1.0 - sin2)) / (d * d * d);
    let (gt, gtt) = (-x * by_x, x * by_x + x * x * by_xx);
    Derivatives {
        f: s2 * gain + w2,
        first: [2.0 * s2 * gain, s2 * gt, 2.0 * w2],
        second: [
            [4.0 * s2 * gain, 2.0 * s2 * gt, 0.0],
            [2.0 * s2 * gt, s2 * gtt, 0.0],
            [0.0, 0.0, 4.0 * w2],
        ],
    }
}

/// Spread of the best estimate from these bins at parameters `logs`.
pub(crate) fn spread(bins: &Bins, logs: Logs, correlation: f64) -> Option<Spread> {
    let (s2, w2) = ((2.0 * logs[0]).exp(), (2.0 * logs[2]).exp());
    let x = (-logs[1]).exp() / bins.fs_hz;
    let all: Vec<(f64, Derivatives)> = bins
        .samples
        .iter()
        .map(|s| {
            let weight = 0.5 * s.dof / correlation;
            (weight, derivatives(s2, x, w2, s.frequency_hz / bins.fs_hz))
        })
        .collect();
    let mut information = [[0.0; 3]; 3];
    for (weight, d) in &all {
        for i in 0..3 {
            for j in 0..3 {
                information[i][j] += weight * d.first[i] * d.first[j] / (d.f * d.f);
            }
        }
    }
    let covariance = inverse(&information)?;
    let mut score = [0.0; 3];
    for (weight, d) in &all {
        let mut trace = 0.0;
        for i in 0..3 {
            for j in 0..3 {
                trace += covariance[i][j] * d.second[i][j] / d.f;
            }
        }
        for i in 0..3 {
            score[i] += weight * d.first[i] / d.f * trace;
        }
    }
    let bias =
        std::array::from_fn(|i| -0.5 * (0..3).map(|j| covariance[i][j] * score[j]).sum::<f64>());
    Some(Spread { covariance, bias })
}

/// Inverse of a symmetric positive matrix; `None` where it is not positive to working precision.
pub(crate) fn inverse(m: &Matrix) -> Option<Matrix> {
    // unit diagonal first: the parameters may differ in scale by many orders
    let scale: [f64; 3] = std::array::from_fn(|i| m[i][i].sqrt().recip());
    if !scale.iter().all(|s| s.is_finite()) {
        return None;
    }
    let c = |i: usize, j: usize| m[i][j] * scale[i] * scale[j];
    let cofactor = |i: usize, j: usize| {
        let (r, s) = ((i + 1) % 3, (i + 2) % 3);
        let (t, u) = ((j + 1) % 3, (j + 2) % 3);
        c(r, t) * c(s, u) - c(r, u) * c(s, t)
    };
    let determinant: f64 = (0..3).map(|j| c(0, j) * cofactor(0, j)).sum();
    if !determinant.is_finite() || determinant < 1e-12 {
        return None;
    }
    let out = std::array::from_fn(|i| {
        std::array::from_fn(|j| cofactor(j, i) / determinant * scale[i] * scale[j])
    });
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// First and second derivatives against differences of the density: second differences with a
    /// step of 1e-3 are good to 1e-6 and lose 1e-10 to rounding.
    #[test]
    fn derivatives_are_those_of_differences() {
        let at = |logs: Logs, cycles: f64| {
            derivatives(
                (2.0 * logs[0]).exp(),
                (-logs[1]).exp(),
                (2.0 * logs[2]).exp(),
                cycles,
            )
        };
        let h = 1e-3;
        for (logs, cycles) in [
            ([0.3, 3.0, -0.2], 0.004),
            ([1.0, -0.5, 0.5], 0.3),
            ([0.0, 6.0, -3.0], 0.0002),
        ] {
            let here = at(logs, cycles);
            for i in 0..3 {
                let (mut up, mut down) = (logs, logs);
                up[i] += h;
                down[i] -= h;
                let (up, down) = (at(up, cycles), at(down, cycles));
                let slope = (up.f - down.f) / (2.0 * h);
                assert!((slope - here.first[i]).abs() < 1e-5 * here.f, "first {i}");
                for j in 0..3 {
                    let second = (up.first[j] - down.first[j]) / (2.0 * h);
                    let error = (second - here.second[i][j]).abs();
                    assert!(error < 1e-5 * here.f, "second {i} {j}: {error}");
                }
            }
        }
    }

    #[test]
    fn inverse_is_one() {
        let m = [[4.0, 1.0, 0.05], [1.0, 3e6, 2.0], [0.05, 2.0, 1e-2]];
        let inverse = inverse(&m).unwrap();
        for i in 0..3 {
            for j in 0..3 {
                let product: f64 = (0..3).map(|k| m[i][k] * inverse[k][j]).sum();
                let want = f64::from(u8::from(i == j));
                // columns differ in scale by 1e9
                assert!((product - want).abs() < 1e-5, "{i} {j}: {product}");
            }
        }
        assert!(super::inverse(&[[1.0; 3]; 3]).is_none());
    }
}
