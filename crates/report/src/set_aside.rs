//! Stars of which many rows were set aside: a mistaken one, say, or one that left its window.
//!
//! Not physics: counting what is flagged.

use std::collections::BTreeMap;

use telemetry::StarResiduals;

/// Share of a star's rows, and number of them, from which it is told.
const MANY: f64 = 0.1;
const LEAST: usize = 10;
/// Stars that are told one by one.
const MOST: usize = 4;

/// A sentence for each of these stars, most rows first.
pub(crate) fn stars(rows: Option<&StarResiduals>) -> Vec<String> {
    let Some(rows) = rows else {
        return Vec::new();
    };
    let mut each: BTreeMap<i64, (usize, Vec<f64>)> = BTreeMap::new();
    let [x, y] = &rows.before_arcsec;
    for (k, &id) in rows.star_id.iter().enumerate() {
        let (all, aside) = each.entry(id).or_default();
        *all += 1;
        // a row without a residual is none that stands out: it is counted as outside of the reference
        let has_residual = |axis: &Vec<f64>| axis.get(k).is_none_or(|r| r.is_finite());
        if rows.outlier[k] && has_residual(x) && has_residual(y) {
            aside.push(rows.t_s[k]);
        }
    }
    let many = |(all, aside): &(usize, Vec<f64>)| {
        aside.len() >= LEAST && aside.len() as f64 > MANY * *all as f64
    };
    let mut told: Vec<_> = each.into_iter().filter(|(_, star)| many(star)).collect();
    told.sort_by_key(|(_, (_, aside))| std::cmp::Reverse(aside.len()));
    let more = told.len().saturating_sub(MOST);
    let sentence = |(id, (all, aside)): &(i64, (usize, Vec<f64>))| {
        let (from, to) = (aside[0], aside[aside.len() - 1]);
        format!(
            "star {id}: {} of {all} rows are outliers, from {from} to {to} s",
            aside.len()
        )
    };
    let mut out: Vec<String> = told.iter().take(MOST).map(sentence).collect();
    if more > 0 {
        out.push(format!("so are many rows of {more} more stars"));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of two stars of 40 rows one loses its second half and one three rows, a third has no residuals; six more lose all of twenty.
    #[test]
    fn stars_that_lose_many_rows_are_told() {
        let mut rows = StarResiduals::default();
        let mut put = |id: i64, t_s: f64, outlier: bool| {
            rows.t_s.push(t_s);
            rows.star_id.push(id);
            rows.outlier.push(outlier);
            let known = if id == 9 { f64::NAN } else { 1.0 };
            rows.before_arcsec.iter_mut().for_each(|r| r.push(known));
        };
        for k in 0..40_i32 {
            put(7, f64::from(k), k >= 20);
            put(8, f64::from(k), k < 3);
            put(9, f64::from(k), true);
        }
        let one = "star 7: 20 of 40 rows are outliers, from 20 to 39 s";
        assert_eq!(stars(Some(&rows)), [one]);
        for id in 10..16 {
            for k in 0..21_i32 {
                rows.t_s.push(f64::from(k));
                rows.star_id.push(id);
                rows.outlier.push(true);
            }
        }
        let told = stars(Some(&rows));
        assert_eq!(told.len(), MOST + 1);
        assert_eq!(told[MOST], "so are many rows of 3 more stars");
    }
}
