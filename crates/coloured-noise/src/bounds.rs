//! Bounds that hold the size and the correlation time of a slow part with 95 %.
//!
//! A run of a few correlation times leaves a long tail upwards: the curvature at the summit, relative to a size that
//! came out too small, calls the truth two sigmas off and more; and it does come out too small, for a constant that is
//! fitted takes the slowest part of it. The restricted likelihood does not, as a density in the logarithms of both,
//! over correlation times up to the span:
//!
//! ```text
//! P(ln slow, ln tau) ~ exp(ln L_R(white, slow, tau))       white as found, step/2 < tau < span
//! ```
//!
//! It is summed on a grid whose steps are half of what the curvature says, outwards from the summit as far as
//! it counts.
//!
//! Source: Gelman et al. 2013, ch. 3 (a density on a grid), with flat densities in the logarithms of scales.

use crate::coloured::{Coloured, Scales};

/// What either bound leaves out.
const TAIL: f64 = 0.025;
/// Two bounds of 95 % are so many sigmas apart.
const WIDTH: f64 = 2.0 * 1.959_964;
/// Steps of the grid in what the curvature says, and where it says nothing.
const STEP: f64 = 0.5;
const USUAL_STEP: [f64; 2] = [0.1, 0.2];
/// Densities below this part of the highest do not count.
const FAINT: f64 = 1e-4;
/// Nor sizes further than this factor from the likeliest: where one is none the density is not zero.
const FURTHEST: f64 = 20.0;

/// What a series tells of the slow part of its noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlowBounds {
    /// Its standard deviation, in the unit of the series.
    pub slow: Bounds,
    /// Its correlation time, s.
    pub tau_s: Bounds,
}

/// What is known of one number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// It is as likely above as below.
    pub middle: f64,
    /// It lies between these with 95 %.
    pub interval: [f64; 2],
}

impl Bounds {
    /// Standard error: a normal law with this interval has it.
    pub fn sigma(&self) -> f64 {
        let [low, high] = self.interval;
        (high - low) / WIDTH
    }
}

impl Coloured {
    /// What is known of the slow part of this noise, the likeliest of a `y` from which its mean may have been taken.
    /// `None`: it has none, or the times have no steps.
    pub fn slow_bounds(&self, t_s: &[f64], y: &[f64], count: &[f64]) -> Option<SlowBounds> {
        self.slow_bounds_weighed(t_s, y, count, |_| 0.0)
    }

    /// The same of laws that are not all as likely before `y` is looked at: the logarithm of the `weight` of each, nats.
    pub(crate) fn slow_bounds_weighed(
        &self,
        t_s: &[f64],
        y: &[f64],
        count: &[f64],
        weight: impl Fn(&Self) -> f64 + Sync,
    ) -> Option<SlowBounds> {
        let scales = Scales::of(t_s).filter(|s| self.slow > 0.0 && s.span > s.step)?;
        let steps = self
            .relative_sigma(t_s, y, count)
            .map_or(USUAL_STEP, |sigma| {
                std::array::from_fn(|i| (STEP * sigma[i]).min(USUAL_STEP[i]))
            });
        let log =
            |noise: &Self| noise.log_likelihood_beside_constant(t_s, y, count) + weight(noise);
        let summit = log(self);
        let grid = Grid {
            widest: FURTHEST.ln() / steps[0],
            density: |[slow, tau]: [f64; 2]| {
                let noise = Self {
                    slow: self.slow * (slow * steps[0]).exp(),
                    tau_s: self.tau_s * (tau * steps[1]).exp(),
                    ..*self
                };
                (log(&noise) - summit).exp()
            },
        };
        let whole = |tau_s: f64| (tau_s / self.tau_s).ln() / steps[1];
        let (least, most) = (whole(0.5 * scales.step), whole(scales.span));
        let (up, down) = rayon::join(
            || grid.rows(0, 1, |row| f64::from(row) <= most),
            || grid.rows(-1, -1, |row| f64::from(row) >= least),
        );
        let rows: Vec<Row> = down.into_iter().rev().chain(up).collect();
        let taus: Vec<(i32, f64)> = rows.iter().map(|r| (r.at, r.sum())).collect();
        let mut slows: Vec<(i32, f64)> = rows.into_iter().flat_map(|r| r.densities).collect();
        slows.sort_by_key(|s| s.0);
        slows.dedup_by(|next, kept| {
            let same = next.0 == kept.0;
            if same {
                kept.1 += next.1;
            }
            same
        });
        let bounds = |cells: &[(i32, f64)], value: f64, step: f64| {
            let at = |part: f64| value * (step * quantile(cells, part)).exp();
            Bounds {
                middle: at(0.5),
                interval: [at(TAIL), at(1.0 - TAIL)],
            }
        };
        Some(SlowBounds {
            slow: bounds(&slows, self.slow, steps[0]),
            tau_s: bounds(&taus, self.tau_s, steps[1]),
        })
    }
}

/// Densities over steps of the logarithms of slow and tau from the summit, where they are 0.
struct Grid<D> {
    density: D,
    /// Steps of ln slow on either side.
    widest: f64,
}

/// Densities along ln slow at one tau.
struct Row {
    at: i32,
    densities: Vec<(i32, f64)>,
}

impl Row {
    fn highest(&self) -> (i32, f64) {
        let all = self.densities.iter().copied();
        all.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, 0.0))
    }

    fn sum(&self) -> f64 {
        self.densities.iter().map(|d| d.1).sum()
    }
}

impl<D: Fn([f64; 2]) -> f64> Grid<D> {
    /// Rows from `first` on, `towards` one side, as long as they are `allowed` and count.
    fn rows(&self, first: i32, towards: i32, allowed: impl Fn(i32) -> bool) -> Vec<Row> {
        let mut rows: Vec<Row> = Vec::new();
        let (mut middle, mut most) = (0, 0.0_f64);
        let mut at = first;
        // at least the summit's own
        while rows.is_empty() || allowed(at) {
            let row = self.row(at, middle);
            let sum = row.sum();
            middle = row.highest().0;
            most = most.max(sum);
            if sum < FAINT * most {
                break;
            }
            rows.push(row);
            at += towards;
        }
        rows
    }

    /// One row, outwards from `middle`, which is near its summit.
    fn row(&self, at: i32, middle: i32) -> Row {
        let mut row = Row {
            at,
            densities: Vec::new(),
        };
        for (first, towards) in [(middle, 1), (middle - 1, -1)] {
            let mut j = first;
            let mut highest = row.highest().1;
            loop {
                let density = (self.density)([f64::from(j), f64::from(at)]);
                row.densities.push((j, density));
                highest = highest.max(density);
                if density <= FAINT * highest || f64::from(j.abs()) >= self.widest {
                    break;
                }
                j += towards;
            }
        }
        row
    }
}

/// Where the sum of `cells`, each about its number, comes to this `part` of all.
fn quantile(cells: &[(i32, f64)], part: f64) -> f64 {
    let wanted = part * cells.iter().map(|c| c.1).sum::<f64>();
    let mut below = 0.0;
    for &(at, density) in cells {
        if below + density >= wanted {
            return f64::from(at) - 0.5 + (wanted - below) / density;
        }
        below += density;
    }
    cells.last().map_or(0.0, |c| f64::from(c.0) + 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coloured::tests::series;

    /// Ten minutes, less their mean, of errors that last for one: intervals of 95 % hold the truth in 95 of 100 runs. Of
    /// 100 runs the share is known to sqrt(0.95 0.05 / 100) = 0.022, of two numbers that hang together little better; four
    /// of that are 0.86. The sigmas of a law that is not normal make an rms z near 1 (0.6 and 1.0 here); those from the
    /// curvature, relative to what was found, make one of more than 2.4 of the correlation time.
    #[test]
    fn bounds_hold_the_truth_in_a_short_run() {
        let t_s: Vec<f64> = (0..1200).map(|k| 0.5 * f64::from(k)).collect();
        let count = vec![1.0; t_s.len()];
        let truth = Coloured {
            white: 1.5,
            slow: 0.5,
            tau_s: 60.0,
        };
        let (mut runs, mut held, mut z) = (0, [0; 2], [0.0; 2]);
        for seed in 0..100 {
            let mut y = series(&truth, &t_s, seed);
            let mean = y.iter().sum::<f64>() / y.len() as f64;
            y.iter_mut().for_each(|y| *y -= mean);
            let found = Coloured::fit_above(truth.white, &t_s, &y, &count);
            let white = Coloured { slow: 0.0, ..truth };
            let gain = |n: &Coloured| n.log_likelihood(&t_s, &y, &count);
            // what would not be told has no bounds to be judged
            if found.slow <= 0.0 || gain(&found) < gain(&white) + 8.0 {
                continue;
            }
            let bounds = found.slow_bounds(&t_s, &y, &count).expect("a slow part");
            runs += 1;
            let of = [(truth.slow, bounds.slow), (truth.tau_s, bounds.tau_s)];
            for (i, (truth, bounds)) in of.into_iter().enumerate() {
                let [low, high] = bounds.interval;
                held[i] += u32::from((low..high).contains(&truth));
                z[i] += ((bounds.middle - truth) / bounds.sigma()).powi(2);
            }
        }
        for (held, z) in held.into_iter().zip(z) {
            assert!(f64::from(held) > 0.86 * f64::from(runs), "{held} of {runs}");
            assert!(z < 1.6_f64.powi(2) * f64::from(runs), "{z} of {runs}");
        }
    }
}
