//! What somebody would be left with who knows everything that acts, but the noise.
//!
//! ```text
//! d = r(as measured) - r(the same run without noise)      per row
//! floor = rms of d less three constant angles;  without a reference, less each frame's own rotation
//! ```
//!
//! The rows are those that the loop's own figures are made of.
//!
//! Source: least squares; formats.md of the house for what *before* and *after* are.

use std::collections::BTreeSet;

use nalgebra::{Matrix3, Vector3};
use telemetry::StarResiduals;

use crate::residual::Residuals;

/// Rms along x and y, arcsec, with perfect knowledge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Floor(pub [f64; 2]);

/// Normal equations of a rotation.
#[derive(Clone, Copy, Debug, Default)]
struct Rotation {
    matrix: Matrix3<f64>,
    vector: Vector3<f64>,
}

impl Rotation {
    fn add(&mut self, jacobian: &[[f64; 3]; 2], d: [f64; 2]) {
        for (row, value) in jacobian.iter().zip(d) {
            let j = Vector3::from(*row);
            self.matrix += j * j.transpose();
            self.vector += j * value;
        }
    }

    fn solve(&self) -> Vector3<f64> {
        let inverse = self.matrix.try_inverse().unwrap_or_else(Matrix3::zeros);
        inverse * self.vector
    }
}

impl Floor {
    /// `figures` are the residuals of the loop: its rows, and which are outliers.
    pub(crate) fn of(
        noisy: &Residuals,
        clean: &Residuals,
        figures: &StarResiduals,
    ) -> Option<Self> {
        let used: BTreeSet<(u64, i32)> = (0..figures.t_s.len())
            .filter(|&row| !figures.outlier[row])
            .map(|row| (figures.t_s[row].to_bits(), figures.slot[row]))
            .collect();
        let d = noisy.minus(clean);
        let take = |row: usize| used.contains(&(noisy.t_s[row].to_bits(), noisy.slot[row]));
        let kept: Vec<Option<[f64; 2]>> = (0..d.len()).map(|r| d[r].filter(|_| take(r))).collect();
        let angle_of = |rows: std::ops::Range<usize>| {
            let mut rotation = Rotation::default();
            for row in rows {
                if let Some(d) = kept[row] {
                    rotation.add(&noisy.jacobian[row], d);
                }
            }
            rotation.solve()
        };
        let constant = angle_of(0..kept.len());
        let (mut squares, mut count) = ([0.0; 2], 0.0);
        for frame in 0..noisy.frames() {
            let rows = noisy.rows_of(frame);
            let angle = if noisy.against_reference {
                constant
            } else {
                angle_of(rows.clone())
            };
            for row in rows {
                let Some(d) = kept[row] else { continue };
                for axis in 0..2 {
                    let turned = Vector3::from(noisy.jacobian[row][axis]).dot(&angle);
                    squares[axis] += ((d[axis] - turned) * noisy.scale[axis]).powi(2);
                }
                count += 1.0;
            }
        }
        (count > 0.0).then(|| Self(squares.map(|s| (s / count).sqrt())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two stars over two frames. A constant rotation is taken off, what is left is the rest; a row that the
    /// loop set aside does not count.
    #[test]
    fn a_rotation_is_taken_off_and_outliers_do_not_count() {
        let f = 100.0;
        let places = [[10.0, 0.0], [-10.0, 5.0], [0.0, -20.0]];
        let jacobian = |p: [f64; 2]| {
            let (x, y) = (p[0] / f, p[1] / f);
            [
                [-f * x * y, f * (1.0 + x * x), -f * y],
                [-f * (1.0 + y * y), f * x * y, f * x],
            ]
        };
        let angle = [1e-3, -2e-3, 3e-3];
        let mut noisy = Residuals {
            first_row: vec![0, 3, 6],
            scale: [2.0, 2.0],
            against_reference: true,
            ..Residuals::default()
        };
        for frame in 0..2_u8 {
            for (slot, place) in places.into_iter().enumerate() {
                let j = jacobian(place);
                let turned =
                    |row: [f64; 3]| -> f64 { row.iter().zip(angle).map(|(a, b)| a * b).sum() };
                noisy.t_s.push(f64::from(frame));
                noisy.slot.push(i32::try_from(slot).unwrap());
                noisy.star_id.push(7);
                noisy.r.push([turned(j[0]), turned(j[1])]);
                noisy.jacobian.push(j);
            }
        }
        let clean = Residuals {
            r: vec![[0.0; 2]; 6],
            ..noisy.clone()
        };
        let mut figures = StarResiduals {
            t_s: noisy.t_s.clone(),
            slot: noisy.slot.clone(),
            outlier: vec![false; 6],
            ..StarResiduals::default()
        };
        let Floor(none) = Floor::of(&noisy, &clean, &figures).unwrap();
        assert!(none[0] < 1e-9 && none[1] < 1e-9, "{none:?}");
        // a spike that the loop has seen is not part of the floor
        noisy.r[4][0] += 50.0;
        let Floor(with) = Floor::of(&noisy, &clean, &figures).unwrap();
        assert!(with[0] > 10.0, "{with:?}");
        figures.outlier[4] = true;
        let Floor(without) = Floor::of(&noisy, &clean, &figures).unwrap();
        assert!(without[0] < 1e-9, "{without:?}");
        // in another frame's own rotation, only what turns goes out
        noisy.against_reference = false;
        noisy.r[0] = [noisy.r[0][0] + 0.3, noisy.r[0][1]];
        let Floor(free) = Floor::of(&noisy, &clean, &figures).unwrap();
        assert!(free[0] > 1e-3 && free[0] < 2.0 * 0.3, "{free:?}");
    }
}
