//! Medians and the rule for outliers.
//!
//! ```text
//! sigma_robust = 1.4826 median |r - median r|,   outlier: |r - median r| > 8 sigma_robust
//! ```
//!
//! 1.4826 = 1/Phi^-1(3/4) makes the scaled MAD the standard deviation of a
//! Gaussian. At 8 sigma a Gaussian bundle of 10^7 scalars loses one row in 10^8.
//!
//! Source: Rousseeuw & Croux 1993, Alternatives to the median absolute deviation.

/// Rows beyond this many robust sigmas are outliers.
pub const OUTLIER_SIGMAS: f64 = 8.0;

/// The median of the finite values, `None` if there is none. Reorders `values`.
#[must_use]
pub fn median(values: &mut Vec<f64>) -> Option<f64> {
    values.retain(|v| v.is_finite());
    if values.is_empty() {
        return None;
    }
    let (half, odd) = (values.len() / 2, values.len() % 2 == 1);
    let (below, middle, _) = values.select_nth_unstable_by(half, f64::total_cmp);
    let upper = *middle;
    if odd {
        return Some(upper);
    }
    let lower = below.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    Some(0.5 * (lower + upper))
}

/// The median of the steps of a time grid, in its unit; `None` with fewer than two times.
///
/// ```
/// // a gap is one step
/// assert_eq!(spectra::robust::median_step(&[0.0, 0.5, 1.0, 9.0]), Some(0.5));
/// assert_eq!(spectra::robust::median_step(&[3.0]), None);
/// ```
#[must_use]
pub fn median_step(t_s: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> = t_s.windows(2).map(|w| w[1] - w[0]).collect();
    median(&mut steps)
}

/// Median and scaled median absolute deviation of the finite values.
///
/// ```
/// let (centre, scale) = spectra::robust::centre_and_scale([1.0, 2.0, 3.0, 4.0, 1e6].into_iter()).expect("finite");
/// assert_eq!((centre, scale), (3.0, 1.482_602_218_505_602));
/// ```
#[must_use]
pub fn centre_and_scale(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let mut kept: Vec<f64> = values.collect();
    let centre = median(&mut kept)?;
    for v in &mut kept {
        *v = (*v - centre).abs();
    }
    let mad = median(&mut kept)?;
    Some((centre, 1.482_602_218_505_602 * mad))
}

/// A scale that is so much smaller than what stands out is that of rounding: attitudes of 1e-16 beside an arcsecond.
const ROUNDING: f64 = 1e-9;

/// Marks the outliers of each group in `outlier` (already marked rows are not
/// asked and stay marked); returns how many were added.
///
/// # Panics
///
/// Unless every `group[i] < groups`, and the three slices have one length.
pub fn mark_outliers(
    values: &[f64],
    group: &[usize],
    groups: usize,
    outlier: &mut [bool],
) -> usize {
    let mut members = vec![Vec::new(); groups];
    for (i, &g) in group.iter().enumerate() {
        if !outlier[i] && values[i].is_finite() {
            members[g].push(i);
        }
    }
    let mut added = 0;
    for rows in &members {
        let Some((centre, scale)) = centre_and_scale(rows.iter().map(|&i| values[i])) else {
            continue;
        };
        // A series of which most is constant to rounding has no scale to judge by.
        let most = rows.iter().map(|&i| (values[i] - centre).abs());
        if scale <= ROUNDING * most.fold(0.0, f64::max) {
            continue;
        }
        for &i in rows {
            if (values[i] - centre).abs() > OUTLIER_SIGMAS * scale {
                outlier[i] = true;
                added += 1;
            }
        }
    }
    added
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn median_of_even_and_odd_counts() {
        assert_eq!(median(&mut vec![3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(&mut vec![4.0, 1.0, 2.0, 3.0]), Some(2.5));
        assert_eq!(median(&mut vec![f64::NAN]), None);
    }

    #[test]
    fn one_spike_in_one_group_is_found() {
        let mut values: Vec<f64> = (0..200).map(|i| f64::from(i % 7) - 3.0).collect();
        let group: Vec<usize> = (0..200).map(|i| i % 2).collect();
        values[31] = 60.0;
        let mut outlier = vec![false; 200];
        assert_eq!(mark_outliers(&values, &group, 2, &mut outlier), 1);
        assert!(outlier[31]);
    }
}
