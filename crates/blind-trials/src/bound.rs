//! The least scatter that a parameter can be estimated with.
//!
//! ```text
//! dr/dp  = (r(p (1 + h)) - r(p (1 - h))) / 2 h p          runs rendered without noise
//! W      = (D + J R J')^-1 = D^-1 - D^-1 J (R^-1 + J' D^-1 J)^-1 J' D^-1        per frame
//! F      = sum X' W X,   X = [dr/dp of all parameters, J]          bound = sqrt (F^-1)_pp
//! ```
//!
//! D: variance of each star's centroid, from the run with noise; R: white error of the reference; J: small
//! rotations, of which the constant ones are unknown. Without a reference every frame's rotation is
//! unknown (R infinite, no constant ones). The parameters are those of the truth, of all effects that act,
//! estimated jointly by somebody who knows which they are; a loop that searches and fits more can only
//! do worse. A reference that wanders is taken for perfect here: the bound remains one.
//!
//! Source: Cramér 1946; Rao 1945; Woodbury's identity.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Matrix3};

use crate::BlindError;
use crate::residual::Residuals;
use crate::settings::{silent, turned};
use crate::trial::Trial;

/// Relative step of a difference: regressors are linear in their parameter, or nearly.
const STEP: f64 = 0.1;
/// Radians in an arcsecond.
const RAD: f64 = 1.0 / focal_plane::ARCSEC_PER_RAD;

/// Bounds of the truth's parameters, by number of the effect in the truth and name; those that no setting
/// of the instrument turns continuously are left out, and so are all of simulated trials.
///
/// # Errors
///
/// What the rendering says.
pub fn bounds(trial: &Trial) -> Result<BTreeMap<(usize, String), f64>, BlindError> {
    let Some(world) = trial.world() else {
        return Ok(BTreeMap::new());
    };
    let quiet = silent(&world.instrument);
    let mut names = Vec::new();
    let mut columns = Vec::new();
    let rendered = |instrument: &imager::Instrument| {
        Ok::<_, BlindError>(Residuals::of(&world.render(instrument, 0)?))
    };
    let Some(clean) = rendered(&quiet)? else {
        return Ok(BTreeMap::new());
    };
    for (k, acting) in trial.truth.effect.iter().enumerate() {
        for (name, &value) in &acting.values {
            let side = |factor| turned(&quiet, acting, name, factor);
            let (Some(up), Some(down)) = (side(1.0 + STEP), side(1.0 - STEP)) else {
                continue;
            };
            let (Some(up), Some(down)) = (rendered(&up)?, rendered(&down)?) else {
                continue;
            };
            // rows of the clean run
            let (up, down) = (clean.minus(&up), clean.minus(&down));
            let derivative = |(up, down): (&Option<[f64; 2]>, &Option<[f64; 2]>)| {
                // a row that one of them lacks tells nothing
                let (Some(up), Some(down)) = (up, down) else {
                    return [0.0; 2];
                };
                let of = |axis: usize| (down[axis] - up[axis]) / (2.0 * STEP * value);
                [of(0), of(1)]
            };
            columns.push(up.iter().zip(&down).map(derivative).collect::<Vec<_>>());
            names.push((k, name.clone()));
        }
    }
    if names.is_empty() {
        return Ok(BTreeMap::new());
    }
    let Some(noisy) = Residuals::of(&trial.bundle(0)?) else {
        return Ok(BTreeMap::new());
    };
    let variance = variance_of_stars(&noisy, &clean);
    let white = world.instrument.reference.as_ref().map(|r| r.white_arcsec);
    Ok(names
        .into_iter()
        .zip(least(&clean, &columns, &variance, white))
        .filter_map(|(name, sigma)| Some((name, sigma?)))
        .collect())
}

/// Variance of a centroid's noise by star, px^2: from what no rotation of its frame explains, for the
/// reference's error turns whole frames.
fn variance_of_stars(noisy: &Residuals, clean: &Residuals) -> BTreeMap<i64, f64> {
    let d = noisy.minus(clean);
    let mut sums: BTreeMap<i64, Vec<f64>> = BTreeMap::new();
    for frame in 0..noisy.frames() {
        let rows: Vec<usize> = noisy.rows_of(frame).filter(|&r| d[r].is_some()).collect();
        if rows.len() < 3 {
            continue;
        }
        let j = DMatrix::from_fn(2 * rows.len(), 3, |i, c| {
            noisy.jacobian[rows[i / 2]][i % 2][c]
        });
        let y = DVector::from_fn(2 * rows.len(), |i, _| {
            d[rows[i / 2]].unwrap_or_default()[i % 2]
        });
        let Some(inverse) = (j.transpose() * &j).try_inverse() else {
            continue;
        };
        let hat = &j * inverse * j.transpose();
        let left = &y - &hat * &y;
        for (i, &row) in rows.iter().enumerate() {
            for axis in 0..2 {
                let k = 2 * i + axis;
                let free = (1.0 - hat[(k, k)]).max(0.1);
                let squares = sums.entry(noisy.star_id[row]).or_default();
                squares.push(left[k] * left[k] / free);
            }
        }
    }
    // the median of chi-squared of one degree of freedom, against particles
    let typical = |squares: &mut Vec<f64>| {
        let middle = squares.len() / 2;
        let (_, median, _) = squares.select_nth_unstable_by(middle, f64::total_cmp);
        *median / 0.454_936
    };
    sums.iter_mut()
        .map(|(&id, squares)| (id, typical(squares)))
        .collect()
}

/// 1 sigma of each column's parameter; `None` where the motion does not show it.
fn least(
    clean: &Residuals,
    columns: &[Vec<[f64; 2]>],
    variance: &BTreeMap<i64, f64>,
    white_arcsec: Option<[f64; 3]>,
) -> Vec<Option<f64>> {
    let own = columns.len();
    // all of one size, for the inverse
    let size: Vec<f64> = columns
        .iter()
        .map(|column| {
            let squares: f64 = column.iter().flatten().map(|v| v * v).sum();
            (squares / column.len().max(1) as f64).sqrt()
        })
        .collect();
    let width = own + if white_arcsec.is_some() { 3 } else { 0 };
    let mut fisher = DMatrix::zeros(width, width);
    for frame in 0..clean.frames() {
        let rows = clean.rows_of(frame);
        let (mut whole, mut turned) = (DMatrix::zeros(width, width), DMatrix::zeros(3, width));
        let mut rotations = Matrix3::zeros();
        for row in rows {
            let Some(&variance) = variance.get(&clean.star_id[row]) else {
                continue;
            };
            for axis in 0..2 {
                let j = clean.jacobian[row][axis].map(|v| v * RAD);
                let x = DVector::from_fn(width, |c, _| {
                    if c < own {
                        columns[c][row][axis] / size[c].max(f64::MIN_POSITIVE)
                    } else {
                        j[c - own]
                    }
                });
                let j = nalgebra::Vector3::from(j);
                whole.ger(1.0 / variance, &x, &x, 1.0);
                turned += j * x.transpose() / variance;
                rotations += j * j.transpose() / variance;
            }
        }
        let inner = match white_arcsec {
            None => Some(rotations),
            Some(white) if white.iter().all(|s| *s > 0.0) => {
                let precision = white.map(|s| 1.0 / (s * s));
                Some(rotations + Matrix3::from_diagonal(&precision.into()))
            }
            Some(_) => None,
        };
        fisher += &whole;
        if let Some(inverse) = inner.and_then(|m| m.try_inverse()) {
            fisher -= turned.transpose() * inverse * &turned;
        }
    }
    let Some(inverse) = fisher.try_inverse() else {
        return vec![None; own];
    };
    (0..own)
        .map(|c| {
            let variance = inverse[(c, c)];
            (variance > 0.0 && size[c] > 0.0).then(|| variance.sqrt() / size[c])
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One star on the boresight, no reference error, one parameter that shifts x by 1 px per unit in every
    /// second frame: two means of 50 frames each are told apart to 2 sigma / sqrt(100). A white
    /// rotation of 0.5 px rms about y adds its variance to that of the centroid.
    #[test]
    fn the_bound_of_a_difference_of_means() {
        let f = 1000.0;
        let frames = 100;
        let clean = Residuals {
            first_row: (0..=frames).collect(),
            star_id: vec![1; frames],
            slot: vec![0; frames],
            t_s: vec![0.0; frames],
            r: vec![[0.0; 2]; frames],
            // z does not show on one star at the boresight; a little of it keeps the matrix regular
            jacobian: vec![[[0.0, f, 0.0], [-f, 0.0, f]]; frames],
            scale: [1.0; 2],
            against_reference: true,
        };
        let column = (0..frames)
            .map(|k| [if k % 2 == 0 { 1.0 } else { 0.0 }, 0.0])
            .collect::<Vec<_>>();
        let variance = BTreeMap::from([(1, 0.25)]);
        // the y rotation alone is a nuisance that x shows: drop the others by a second star
        let mut two = clean;
        two.first_row = (0..=frames).map(|k| 2 * k).collect();
        two.star_id = vec![1; 2 * frames];
        two.slot = (0..2 * frames).map(|k| i32::from(k % 2 == 1)).collect();
        two.t_s = vec![0.0; 2 * frames];
        two.r = vec![[0.0; 2]; 2 * frames];
        // the second star sees the other two rotations only
        two.jacobian = (0..2 * frames)
            .map(|k| {
                if k % 2 == 0 {
                    [[0.0, f, 0.0], [0.0, 0.0, 0.0]]
                } else {
                    [[0.0, 0.0, f], [-f, 0.0, 0.0]]
                }
            })
            .collect();
        let wide: Vec<[f64; 2]> = column.iter().flat_map(|c| [*c, [0.0; 2]]).collect();
        let bound = least(&two, std::slice::from_ref(&wide), &variance, Some([0.0; 3]))[0].unwrap();
        assert!((bound - 2.0 * 0.5 / 10.0).abs() < 1e-9, "{bound}");
        let half_px = 0.5 / f * focal_plane::ARCSEC_PER_RAD;
        let bound = least(&two, &[wide], &variance, Some([half_px; 3]))[0].unwrap();
        assert!(
            (bound - 2.0 * 0.5_f64.sqrt() / 10.0).abs() < 1e-9,
            "{bound}"
        );
    }
}
