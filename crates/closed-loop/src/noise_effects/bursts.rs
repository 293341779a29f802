//! Bursts of noise: the stretch of time in which squares differ most from those of all other times.
//!
//! ```text
//! f = 1 in the stretch, 0 elsewhere;   per block and star   u = Z_in - m Z,   N = n_in (1 - 2 m) + m^2 n
//! ```
//!
//! n and Z are rows and the sum of their z, m the share of the star's rows that lies in the stretch: `squares.rs`
//! with a column of ones and noughts. Every stretch begins and ends at a fortieth of the time, so that sums over those
//! do for all.
//!
//! Source: a scan over stretches (Naus 1965); what each is worth, as in `squares.rs`.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::squares::{Judged, Place, Scores, Table, both};

/// Fortieths that a burst may last: a fifth, a tenth, a twentieth. Each begins at every half of its length.
const LENGTHS: [usize; 3] = [8, 4, 2];
const CELLS: usize = 40;

/// Rows, and the sum of their z.
type Sum = (usize, f64);

/// The stretch with the least chance, which pays for all that are tried: in one table, or in all residuals and their
/// changes.
pub(super) fn burst(
    tables: &[&Table],
    t_s: impl Fn(&Place) -> f64,
    [from, to]: [f64; 2],
) -> Option<Judged> {
    let lengths = LENGTHS.iter();
    let stretches: Vec<[usize; 2]> = lengths
        .flat_map(|&n| (0..=CELLS - n).step_by(n / 2).map(move |k| [k, k + n]))
        .collect();
    let edges: Vec<f64> = (1..CELLS)
        .map(|k| from + (to - from) * k as f64 / CELLS as f64)
        .collect();
    let cell = |row: &Place| {
        let t = t_s(row);
        edges.partition_point(|edge| *edge <= t)
    };
    let cells: Vec<Cells<'_>> = tables.iter().map(|table| Cells::of(table, cell)).collect();
    let judged = stretches.par_iter().filter_map(|stretch| {
        let each = cells.iter().map(|cells| cells.judge(*stretch));
        each.reduce(both)?
    });
    let [p, share] = judged.min_by(|a, b| a[0].total_cmp(&b[0]))?;
    Some([(p * stretches.len() as f64).min(1.0), share])
}

/// A table by block, star and fortieth of the time.
struct Cells<'a> {
    table: &'a Table,
    sums: BTreeMap<(usize, usize, usize), Sum>,
}

impl<'a> Cells<'a> {
    fn of(table: &'a Table, cell: impl Fn(&Place) -> usize) -> Self {
        let mut sums = BTreeMap::new();
        for (row, z) in table.rows.iter().zip(&table.relative) {
            let sum: &mut Sum = sums.entry((row.block, row.star, cell(row))).or_default();
            *sum = (sum.0 + 1, sum.1 + z);
        }
        Self { table, sums }
    }

    fn judge(&self, [start, end]: [usize; 2]) -> Option<Judged> {
        let within = |cell: usize| start <= cell && cell < end;
        let mut share = vec![0.0; self.table.stars.len()];
        for (&(_, star, cell), (rows, _)) in &self.sums {
            if within(cell) {
                share[star] += *rows as f64 / self.table.stars[star].rows as f64;
            }
        }
        let mut of_block = vec![Scores::zeros(1); self.table.blocks];
        for (&(block, star, cell), &(rows, z)) in &self.sums {
            let f = f64::from(u8::from(within(cell))) - share[star];
            of_block[block].score[0] += f * z;
            of_block[block].normal[(0, 0)] += f * f * rows as f64;
        }
        self.table.judge(of_block)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise_effects::squares::Columns;
    use crate::noise_effects::squares::tests::in_time;

    /// Twice the variance in an eighth of the time, 300 rows: known to 1/sqrt(300), 17 sigma, of which a slope and a
    /// parabola take next to nothing. Without it 67 stretches are tried for nothing.
    #[test]
    fn a_burst_of_noise_is_seen() {
        let chance = |more: f64| {
            let (table, _) = in_time(|t| {
                if (0.1..0.35).contains(&t) {
                    1.0 + more
                } else {
                    1.0
                }
            });
            let time = |row: &Place| row.at as f64 / 1200.0 - 1.0;
            burst(&[&table, &table], time, [-1.0, 1.0]).unwrap()[0]
        };
        assert!(chance(1.0) < 1e-6, "{}", chance(1.0));
        assert!(chance(0.0) > 0.01, "{}", chance(0.0));
    }

    /// Sums over fortieths are those of a column of ones and noughts over the rows.
    #[test]
    fn a_stretch_is_judged_as_its_column() {
        let (table, _) = in_time(|t| 1.0 + 0.3 * t);
        // 2400 rows: 60 to a fortieth
        let cells = Cells::of(&table, |row| row.at / 60);
        for stretch in [[0, 8], [22, 26], [38, 40]] {
            let rows = 60 * stretch[0]..60 * stretch[1];
            let column = |row: &Place| [f64::from(u8::from(rows.contains(&row.at))), 0.0];
            let known = table.within(&Columns::of(&table, column), 1).unwrap();
            let judged = cells.judge(stretch).unwrap();
            for (judged, known) in judged.iter().zip(known) {
                assert!((judged - known).abs() < 1e-9 * known, "{judged} {known}");
            }
        }
    }
}
