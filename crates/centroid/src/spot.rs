//! A Gaussian spot integrated over pixels.
//!
//! ```text
//! v[row][column] = flux [Phi(x+) - Phi(x-)] [Phi(y+) - Phi(y-)],   x+- = (x_column +- 1/2 - x)/sigma
//! ```
//!
//! Source: integration of a two-dimensional Gaussian over square pixels without gaps.

use focal_plane::Pixel;

use crate::failure::{self, CentroidFailure};
use crate::normal;

/// Fills a window, row by row along y, with a spot of total `flux`; no background.
///
/// `first` is the centre of the first pixel, `at` that of the spot, both in the same pixel
/// coordinates.
///
/// # Errors
///
/// If `sigma_px` is not finite and positive.
///
/// # Panics
///
/// If `out` is not a whole number of rows of `columns` pixels.
///
/// ```
/// use focal_plane::Pixel;
///
/// let mut window = [0.0; 49];
/// let (first, at) = (Pixel { x: -3.0, y: -3.0 }, Pixel { x: 0.2, y: -0.1 });
/// centroid::pixel_gaussian_into(first, 7, at, 0.5, 1000.0, &mut window)?;
/// assert!((window.iter().sum::<f64>() - 1000.0).abs() < 1e-4);
/// # Ok::<(), centroid::CentroidFailure>(())
/// ```
pub fn pixel_gaussian_into(
    first: Pixel,
    columns: usize,
    at: Pixel,
    sigma_px: f64,
    flux: f64,
    out: &mut [f64],
) -> Result<(), CentroidFailure> {
    failure::positive("sigma_px", sigma_px)?;
    assert!(
        columns > 0 && out.len().is_multiple_of(columns),
        "{} pixels are no whole number of rows of {columns}",
        out.len()
    );
    let share = |pixel: f64, spot: f64| {
        normal::mass(
            (pixel - 0.5 - spot) / sigma_px,
            (pixel + 0.5 - spot) / sigma_px,
        )
    };
    if out.is_empty() {
        return Ok(());
    }
    // the first row holds the shares of the columns until the others are done
    let (shares, rest) = out.split_at_mut(columns);
    for (column, value) in shares.iter_mut().enumerate() {
        *value = share(first.x + column as f64, at.x);
    }
    for (row, values) in rest.chunks_exact_mut(columns).enumerate() {
        let factor = flux * share(first.y + (row + 1) as f64, at.y);
        for (value, share) in values.iter_mut().zip(shares.iter()) {
            *value = factor * share;
        }
    }
    let factor = flux * share(first.y, at.y);
    for value in shares {
        *value *= factor;
    }
    Ok(())
}
