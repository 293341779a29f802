//! The sums of a short run, star by star.
//!
//! A few dozen frames make five blocks in time, and of what drifts all along two hold the information: no scatter
//! between them tells its sigma. What its neighbours in time share with a centroid error is its own star's, however
//! slow; so the stars are blocks, too. Where every frame's attitude is free, with the rows of a frame
//!
//! ```text
//! c' = c - A (A^T A)^-1 A^T c         sum over all rows of c' c'^T = R
//! ```
//!
//! so that the parts of all stars add up to the same sum. Beside a reference its errors would be all stars' at once.
//!
//! Source: Liang & Zeger 1986 (clusters of any kind that are independent of each other).

use std::sync::Arc;

use block_regression::{Folds, Gram, Symmetric};
use nalgebra::{DMatrix, RowVector3};

use crate::star::columns::StarColumns;
use crate::star::frame_rotation::rotation_row;
use crate::star::layout::Filled;
use crate::star::moments::SOLVING;

/// Blocks in time from which on they are enough.
const MANY_BLOCKS: usize = 30;
/// Fewest stars that are worth it, and most parts: more stars share them.
const FEW_STARS: usize = 12;
const MOST_PARTS: usize = 40;

/// The parts; none where the run is long enough, its frames are unrelated anyway, or there are too few stars.
pub(super) fn by_star(columns: &StarColumns<'_>, folds: &Folds) -> Vec<Gram> {
    let data = columns.data;
    let few = folds.blocks.len() < MANY_BLOCKS && folds.prior_blocks <= 0.0;
    if !few || !data.free_attitude || data.stars.len() < FEW_STARS {
        return Vec::new();
    }
    parts(columns, data.stars.len().min(MOST_PARTS))
}

/// So many parts, star by star.
pub(super) fn parts(columns: &StarColumns<'_>, parts: usize) -> Vec<Gram> {
    let data = columns.data;
    let layout = columns.layout();
    let width = layout.width();
    let mut rows_of_part: Vec<Vec<f64>> = vec![Vec::new(); parts];
    let mut filled = Filled::default();
    for frame in 0..data.frames.frames() {
        let frames = frame..frame + 1;
        let rows = data.frames.rows_of(frame);
        columns.fill(frames.clone(), &layout, &mut filled);
        if columns.weigh(frames, &mut filled) < SOLVING {
            continue;
        }
        // rows of x, then of y; what turns the camera is nothing beside a free attitude
        let (n, polynomials) = (rows.len(), filled.shared.transpose());
        let (mut seen, mut turns) = (DMatrix::zeros(2 * n, width), DMatrix::zeros(2 * n, 3));
        for axis in 0..2 {
            let mut seen = seen.rows_mut(axis * n, n);
            for (k, column) in polynomials.column_iter().enumerate() {
                seen.column_mut(layout.shared_at(k, axis))
                    .copy_from(&column);
            }
            for (column, &place) in filled.own[axis].column_iter().zip(&layout.own) {
                seen.column_mut(place).copy_from(&column);
            }
        }
        for (i, row) in rows.clone().enumerate() {
            let weight = columns.weight_of(row);
            for (axis, turn) in rotation_row(data, row).iter().enumerate() {
                let turn = RowVector3::from_row_slice(turn) * weight;
                turns.row_mut(axis * n + i).copy_from(&turn);
            }
        }
        let Some(solved) = turns.tr_mul(&turns).cholesky() else {
            continue;
        };
        let left = &seen - &turns * solved.solve(&turns.tr_mul(&seen));
        for (i, row) in rows.enumerate().filter(|(_, row)| !data.outlier[*row]) {
            let part = &mut rows_of_part[data.star[row] % parts];
            part.extend(left.row(i).iter().chain(left.row(n + i).iter()));
        }
    }
    let nothing = Arc::new(Symmetric::zeros(width));
    let each = rows_of_part.into_iter();
    each.map(|values| {
        let rows = DMatrix::from_row_slice(values.len() / width, width, &values);
        if rows.nrows() < width {
            Gram::new(0.0, nothing.clone(), rows)
        } else {
            Gram::whole(Symmetric::of_products(&rows))
        }
    })
    .collect()
}
