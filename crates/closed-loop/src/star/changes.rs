//! What residuals change by from one frame to the next: noise, which no slow effect adds to.
//!
//! Source: successive differences (von Neumann 1941).

use crate::gaps::longest_step;
use crate::star::data::StarData;

/// Of each row from the frame before, arcsec per axis; NaN for outliers, and where its star was not seen there.
pub(crate) fn of(data: &StarData) -> [Vec<f64>; 2] {
    // what a misalignment leaves changes along the motion
    let residual = data.bare_residual(data.frames.positions());
    let longest = longest_step(&data.frames.t_s);
    let mut last: Vec<Option<usize>> = vec![None; data.stars.len()];
    let mut out = [(); 2].map(|()| vec![f64::NAN; data.t_s.len()]);
    for row in (0..data.t_s.len()).filter(|&r| !data.outlier[r]) {
        if let Some(before) = last[data.star[row]].replace(row)
            && data.t_s[row] - data.t_s[before] <= longest
        {
            for (out, residual) in out.iter_mut().zip(&residual) {
                out[row] = residual[row] - residual[before];
            }
        }
    }
    out
}
