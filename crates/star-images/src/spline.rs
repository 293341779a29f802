//! Tensor cubic B-splines on a square grid of knots.
//!
//! ```text
//! psi(d) = sum_jk g_jk b(d_x/h - j) b(d_y/h - k),        |d_x|, |d_y| <= half width
//! b on one knot interval, t in [0, 1): [(1-t)^3, 3t^3-6t^2+4, -3t^3+3t^2+3t+1, t^3]/6
//! ```
//!
//! Four coefficients along each axis act at a point. Offsets d in px; beyond the
//! half width the value at the edge holds, with no slope.
//!
//! Source: de Boor, A Practical Guide to Splines (1978), ch. X, uniform knots.

/// Coefficients that act at a point, along one axis.
pub(crate) const ORDER: usize = 4;

/// A square grid of spline coefficients about the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Grid {
    /// Largest offset that the grid covers, px.
    pub(crate) half_width_px: f64,
    /// Distance of knots, px.
    pub(crate) spacing_px: f64,
    /// Coefficients along each axis.
    pub(crate) side: usize,
}

/// An offset among the knots along one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Place {
    /// First coefficient that acts there.
    pub(crate) first: usize,
    /// Part of the knot interval before it.
    pub(crate) part: f64,
}

/// The coefficients that act at one offset along one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Taps {
    /// First coefficient.
    pub(crate) first: usize,
    /// Weight of each.
    pub(crate) value: [f64; ORDER],
    /// Derivative of each by the offset, 1/px.
    pub(crate) slope: [f64; ORDER],
}

impl Grid {
    /// A grid over `+-half_width_px` along both axes.
    pub(crate) fn new(half_width_px: f64, spacing_px: f64) -> Self {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a few intervals: the half width is that of a window"
        )]
        let intervals = (2.0 * half_width_px / spacing_px).ceil() as usize;
        Self {
            half_width_px,
            spacing_px,
            side: intervals.max(1) + ORDER - 1,
        }
    }

    /// Number of coefficients.
    pub(crate) fn len(&self) -> usize {
        self.side * self.side
    }

    /// Place of the offset `d_px` among the knots.
    pub(crate) fn place(&self, d_px: f64) -> Place {
        let d = d_px.clamp(-self.half_width_px, self.half_width_px);
        let u = (d + self.half_width_px) / self.spacing_px;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "u >= 0 after the clamp; a NaN becomes 0"
        )]
        let first = (u as usize).min(self.side - ORDER);
        Place {
            first,
            part: u - first as f64,
        }
    }

    /// Taps at the offset `d_px`.
    pub(crate) fn taps(&self, d_px: f64) -> Taps {
        let inside = d_px.abs() <= self.half_width_px;
        let Place { first, part: t } = self.place(d_px);
        let s = 1.0 - t;
        let value = [
            s * s * s / 6.0,
            (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0,
            (3.0 * s * s * s - 6.0 * s * s + 4.0) / 6.0,
            t * t * t / 6.0,
        ];
        let k = if inside { 0.5 / self.spacing_px } else { 0.0 };
        let slope = [
            -s * s * k,
            (3.0 * t * t - 4.0 * t) * k,
            (4.0 * s - 3.0 * s * s) * k,
            t * t * k,
        ];
        Taps {
            first,
            value,
            slope,
        }
    }

    /// Value and slope along x and y where two taps cross.
    pub(crate) fn evaluate(&self, coefficients: &[f64], x: &Taps, y: &Taps) -> [f64; 3] {
        let mut out = [0.0; 3];
        for a in 0..ORDER {
            let start = (x.first + a) * self.side + y.first;
            let g = &coefficients[start..start + ORDER];
            let value =
                g[0] * y.value[0] + g[1] * y.value[1] + g[2] * y.value[2] + g[3] * y.value[3];
            let slope =
                g[0] * y.slope[0] + g[1] * y.slope[1] + g[2] * y.slope[2] + g[3] * y.slope[3];
            out[0] += x.value[a] * value;
            out[1] += x.slope[a] * value;
            out[2] += x.value[a] * slope;
        }
        out
    }

    /// The value alone.
    pub(crate) fn value(&self, coefficients: &[f64], x: &Taps, y: &Taps) -> f64 {
        let mut out = 0.0;
        for a in 0..ORDER {
            let start = (x.first + a) * self.side + y.first;
            let g = &coefficients[start..start + ORDER];
            let value =
                g[0] * y.value[0] + g[1] * y.value[1] + g[2] * y.value[2] + g[3] * y.value[3];
            out += x.value[a] * value;
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Coefficients of a linear function are the function at the knots' Greville
    /// points, and B-splines reproduce it exactly: only rounding is left.
    #[test]
    fn linear_functions_are_exact_with_their_slopes() {
        let grid = Grid::new(3.3, 0.4);
        let f = |x: f64, y: f64| 0.7 + 0.3 * x - 1.1 * y;
        let knot = |j: usize| (j as f64 - 1.0) * grid.spacing_px - grid.half_width_px;
        let coefficients: Vec<f64> = (0..grid.len())
            .map(|k| f(knot(k / grid.side), knot(k % grid.side)))
            .collect();
        for i in 0..50 {
            let (x, y) = (-3.3 + 0.132 * f64::from(i), 3.3 - 0.11 * f64::from(i));
            let [v, gx, gy] = grid.evaluate(&coefficients, &grid.taps(x), &grid.taps(y));
            assert!((v - f(x, y)).abs() < 1e-13, "{v} at {x}, {y}");
            assert!((gx - 0.3).abs() < 1e-12 && (gy + 1.1).abs() < 1e-12);
            assert!((grid.value(&coefficients, &grid.taps(x), &grid.taps(y)) - v).abs() < 1e-15);
        }
    }

    /// Central differences at step e: error e^2 f'''/6 + rounding 1e-16/e.
    #[test]
    fn slopes_are_the_derivatives_and_vanish_outside() {
        let grid = Grid::new(2.0, 0.4);
        let e = 1e-5;
        for i in 0..60 {
            let d = -1.97 + 0.066 * f64::from(i);
            let (low, at, high) = (grid.taps(d - e), grid.taps(d), grid.taps(d + e));
            if low.first != high.first {
                continue;
            }
            for k in 0..ORDER {
                let numeric = (high.value[k] - low.value[k]) / (2.0 * e);
                assert!((numeric - at.slope[k]).abs() < 1e-8, "tap {k} at {d}");
            }
        }
        let (edge, outside) = (grid.taps(2.0), grid.taps(9.0));
        assert_eq!(
            outside.value.map(f64::to_bits),
            edge.value.map(f64::to_bits)
        );
        assert!(outside.slope.iter().all(|s| *s == 0.0));
    }
}
