//! Fewer points where more than a screen can show: the picture stays the same.
//!
//! ```text
//! line      of the points in one column of 0.5 px: the first, the lowest, the highest, the last;
//!           of a line that goes to and fro: those 0.5 px or more from the one before
//! points    one for each cell of 1 px by 1 px
//! ```
//!
//! Not physics: drawing.

use std::collections::HashSet;

/// Width of a column, px.
const COLUMN_PX: f64 = 0.5;

/// Points of a line in px, thinned; a NaN stays where it breaks the line.
pub(crate) fn line(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let descends = |w: &[[f64; 2]]| w[1][0] < w[0][0];
    let ascending = !points.windows(2).any(descends);
    if points.len() < 1000 {
        return points.to_vec();
    }
    if !ascending {
        return steps(points);
    }
    let column = |p: &[f64; 2]| (p[0] / COLUMN_PX).floor();
    let mut out = vec![];
    let mut from = 0;
    while from < points.len() {
        let broken = |p: &[f64; 2]| p[0].is_nan() || p[1].is_nan();
        if broken(&points[from]) {
            out.push([f64::NAN; 2]);
            from += 1;
            continue;
        }
        let here = column(&points[from]);
        let mut to = from + 1;
        #[expect(clippy::float_cmp, reason = "whole numbers")]
        while to < points.len() && !broken(&points[to]) && column(&points[to]) == here {
            to += 1;
        }
        let by = |a: &usize, b: &usize| points[*a][1].total_cmp(&points[*b][1]);
        let low = (from..to).min_by(by).unwrap_or(from);
        let high = (from..to).max_by(by).unwrap_or(from);
        let mut keep = [from, low, high, to - 1];
        keep.sort_unstable();
        for (k, &index) in keep.iter().enumerate() {
            if k == 0 || index != keep[k - 1] {
                out.push(points[index]);
            }
        }
        from = to;
    }
    out
}

fn steps(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut out: Vec<[f64; 2]> = vec![];
    for (k, p) in points.iter().enumerate() {
        let step = out
            .last()
            .map_or(f64::NAN, |last| (p[0] - last[0]).hypot(p[1] - last[1]));
        // NaN on either side is kept: it begins or breaks a line
        if step.is_nan() || step >= COLUMN_PX || k + 1 == points.len() {
            out.push(*p);
        }
    }
    out
}

/// Places of points in px, one for each cell.
pub(crate) fn points(points: impl Iterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
    let mut seen = HashSet::new();
    points
        .filter(|p| p.iter().all(|v| v.is_finite() && v.abs() < 1e6))
        .filter(|p| {
            #[expect(clippy::cast_possible_truncation, reason = "below a million")]
            let cell = p.map(|v| v.round() as i64);
            seen.insert(cell)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 10^5 points over 100 px: extremes stay, and at most four for each half pixel are left.
    #[test]
    fn a_long_line_keeps_its_extremes() {
        let mut all: Vec<[f64; 2]> = (0..100_000)
            .map(|k| [f64::from(k) * 1e-3, f64::from(k % 97)])
            .collect();
        all[54_321][1] = 500.0;
        all[70_000][1] = f64::NAN;
        let thin = line(&all);
        assert!(thin.len() <= 4 * 202, "{}", thin.len());
        assert!(thin.iter().any(|p| (p[1] - 500.0).abs() < 1e-12));
        assert_eq!(thin.iter().filter(|p| p[1].is_nan()).count(), 1);
        assert_eq!(thin[0].map(f64::to_bits), all[0].map(f64::to_bits));
    }

    /// A circle that is run through a hundred times is its circumference in half pixels each time.
    #[test]
    fn a_line_to_and_fro_loses_its_short_steps() {
        let all: Vec<[f64; 2]> = (0..100_000)
            .map(|k| f64::from(k) * 2e-2 * std::f64::consts::PI)
            .map(|a| [10.0 * a.cos(), 10.0 * a.sin()])
            .collect();
        let thin = line(&all);
        assert!(thin.len() <= all.len() && thin.len() > 1000);
        let still = vec![[3.0, 4.0]; 5000];
        let mut back = still.clone();
        back[2500] = [2.9, 4.0];
        assert_eq!(line(&back).len(), 2);
    }

    #[test]
    fn points_on_one_spot_are_one() {
        let twice = [[1.0, 1.0], [1.2, 1.1], [9.0, f64::NAN], [5.0, 1.0]];
        assert_eq!(points(twice.into_iter()).len(), 2);
    }
}
