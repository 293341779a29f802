//! What the noise of attitudes follows: of rotations that all stars of a frame share, or of a tracker's own.
//!
//! Time tags that jitter turn a frame by its rate times the jitter, a reference may be noisier when it is warm. No
//! star shows either beside the others. Squares are held against variables as those of stars are ([`super::squares`]),
//! of what changes from frame to frame, for a slow error is no noise, and of what the frames before do not predict,
//! which tells all there is:
//!
//! ```text
//! d_k = sqrt(2/3) (theta_k - (theta_k-1 + theta_k+1)/2)     var d_k = (2/3) v_k + (v_k-1 + v_k+1)/6
//! v_k = c_k + S      c_k of the stars, S = sum (d^2 / C - 1) / sum 1 / C,  C = var d_k of c alone, axis by axis
//! e_k = (theta_k - E[theta_k | theta_1 .. theta_k-1]) / sigma_k     white and slow noise that suit theta, v_k its white part
//! ```
//!
//! Each axis has a level of its own, as a star has. What acts on all axes alike is asked, and what acts on each by the
//! square of its own rate or acceleration.
//!
//! Source: second differences (von Neumann 1941); moments of a random effect; Koenker 1981 as in `squares.rs`.

use std::collections::BTreeMap;

use block_regression::Folds;
use coloured_noise::Coloured;
use effects::CHANNEL;
use focal_plane::Series;
use rayon::prelude::*;
use spectra::robust::median;

use super::bursts::burst;
use super::quick::{NEIGHBOUR, OWN, of_three};
use super::squares::{Columns, Judged, MIN_ROWS, Place, StarLevel, Table, both};
use crate::gaps::longest_step;
use crate::search::empirical::{Scale, legendre, range};
use crate::situation::channels_of_interest;

/// Median of chi-squared of one degree.
const MEDIAN: f64 = 0.455;
/// Squares count as no more than this many times the usual, which one in two thousand is: a spike says little, and noise
/// that is loud for a while is no spike.
const MOST_OF_A_SQUARE: f64 = 12.0;
/// A motion that is taken from attitudes goes with their own errors, and so do its squares with the errors': at rest,
/// where it is all error, z is 0.6 of that over the largest motion, with half of which e^2 goes. Where the largest is this
/// many times the error, times the root of how many squares there are, those at rest feign half a sigma:
/// `sqrt(N) 0.3 / (MOVES sqrt(N)) / (1.4 * 0.3)`.
const MOVES: f64 = 1.7;
/// The part of the frames that move least, by which it is known what attitudes err by.
const AT_REST: usize = 4;
/// Frames beyond which what changes is enough: noise that suits them takes longer than it is worth.
const MOST_PREDICTED: usize = 30_000;

/// Rotations about three axes over frames, and what is known of their variances.
pub(crate) struct Turning<'a> {
    pub(crate) t_s: &'a [f64],
    /// arcsec; NaN where it is not known.
    pub(crate) theta: [Vec<f64>; 3],
    /// What of the variance is known, arcsec^2.
    pub(crate) known: [Vec<f64>; 3],
    pub(crate) folds: &'a Folds,
}

/// What noise may follow, frame by frame.
pub(crate) enum Varies {
    /// One number for all axes.
    Alike(Vec<f64>),
    /// The time, in which there may be bursts as well.
    Time,
    /// A motion, by its size and by its component about each axis.
    Motion(Motion),
}

impl Varies {
    /// Channels over frames at `t_s`, each by its name as a variable.
    pub(crate) fn channels(
        channels: &BTreeMap<String, Series>,
        t_s: &[f64],
    ) -> Vec<(String, Self)> {
        let each = channels_of_interest(channels);
        let each = each.map(|(name, series)| {
            let values = Self::Alike(series.at_all(t_s));
            (format!("{CHANNEL}{name}"), values)
        });
        each.collect()
    }
}

/// A motion about three axes.
pub(crate) struct Motion {
    /// arcsec/s, or arcsec/s^2.
    pub(crate) axes: [Vec<f64>; 3],
    /// What it errs by for each arcsec that attitudes err by, 1/s or 1/s^2.
    pub(crate) of_attitudes: f64,
}

impl Motion {
    /// A motion of this `order` (1: rate, 2: acceleration) from attitudes every `step_s`.
    ///
    /// ```text
    /// (theta_k+1 - theta_k-1) / 2 step: sqrt(1/2) / step        (theta_k+1 - 2 theta_k + theta_k-1) / step^2: sqrt 6 / step^2
    /// ```
    pub(crate) fn error(order: i32, step_s: f64) -> f64 {
        let of_one = if order == 1 { 0.5 } else { 6.0 };
        f64::sqrt(of_one) / step_s.powi(order)
    }

    fn sizes(&self) -> Vec<f64> {
        let [x, y, z] = &self.axes;
        let each = x.iter().zip(y).zip(z);
        each.map(|((x, y), z)| x.hypot(*y).hypot(*z)).collect()
    }
}

/// A square that counts.
struct Square {
    place: Place,
    square: f64,
    /// Its variance as far as it is known, arcsec^2.
    known: f64,
}

impl Turning<'_> {
    /// The chances of all `variables` by name, not yet paid for; none where the frames are too few.
    pub(crate) fn judged(&self, variables: &[(String, Varies)]) -> Vec<(String, Judged)> {
        let axes: Vec<Axis> = (0..3).into_par_iter().map(|axis| self.axis(axis)).collect();
        let Some(tables) = self.tables(&axes) else {
            return Vec::new();
        };
        let tables: Vec<&Table> = tables.iter().collect();
        let each = variables.par_iter().flat_map_iter(|(name, varies)| {
            let judged = self.of_variable(&axes, &tables, varies).into_iter();
            judged.map(|judged| (name.clone(), judged))
        });
        each.collect()
    }

    fn of_variable(&self, axes: &[Axis], tables: &[&Table], varies: &Varies) -> Vec<Judged> {
        // the first columns of them, in every table
        let within = |column: &dyn Fn(&Place) -> [f64; 2], counts: &[usize]| -> Vec<Judged> {
            let columns: Vec<Columns> = tables.iter().map(|t| Columns::of(t, column)).collect();
            let judged = counts.iter().filter_map(|&count| {
                let each = tables.iter().zip(&columns);
                each.map(|(table, columns)| table.within(columns, count))
                    .reduce(both)?
            });
            judged.collect()
        };
        let smooth = |values: &[f64]| {
            let scale = Scale::new(range(values.iter().copied()));
            let column = |place: &Place| {
                let [line, bend, _] = legendre(scale.of(values[place.at]));
                [line, bend]
            };
            within(&column, &[1, 2])
        };
        match varies {
            Varies::Alike(values) => smooth(values),
            Varies::Time => {
                let mut judged = smooth(self.t_s);
                if let [from, .., to] = self.t_s {
                    judged.extend(burst(tables, |place| self.t_s[place.at], [*from, *to]));
                }
                judged
            }
            Varies::Motion(motion) => {
                let sizes = motion.sizes();
                let [_, largest] = range(sizes.iter().copied());
                let count = tables.iter().map(|t| t.rows.len()).max().unwrap_or(0);
                let least = MOVES * (count as f64).sqrt() * motion.of_attitudes;
                if largest < least * error_at_rest(axes, &sizes) {
                    return Vec::new();
                }
                let own = |place: &Place| {
                    let z = motion.axes[place.star][place.at] / largest;
                    [if z.is_finite() { z * z } else { 0.0 }, 0.0]
                };
                let mut judged = smooth(&sizes);
                judged.extend(within(&own, &[1]));
                judged
            }
        }
    }

    /// Squares of what the frames before do not predict and of what changes, over their usual size; of a long run the
    /// latter. `None` where hardly an axis has any.
    fn tables(&self, axes: &[Axis]) -> Option<Vec<Table>> {
        let table = |of: &dyn Fn(&Axis) -> &[(Place, f64)]| {
            let mut table = Table {
                rows: Vec::new(),
                relative: Vec::new(),
                stars: Vec::new(),
                blocks: self.folds.blocks.len(),
            };
            for axis in axes.iter().map(of) {
                let mut level = StarLevel::UNSEEN;
                if axis.len() >= MIN_ROWS {
                    level.rows = axis.len();
                    level.level = axis.iter().map(|(_, z)| z).sum::<f64>() / axis.len() as f64;
                    table.rows.extend(axis.iter().map(|(place, _)| *place));
                    let relative = axis.iter().map(|(_, z)| z / level.level - 1.0);
                    table.relative.extend(relative);
                }
                table.stars.push(level);
            }
            table
        };
        let mut tables = vec![table(&|axis| &axis.changes)];
        if tables[0].rows.is_empty() {
            return None;
        }
        if self.t_s.len() <= MOST_PREDICTED {
            tables.insert(0, table(&|axis| &axis.unpredicted));
        }
        Some(tables)
    }

    fn axis(&self, axis: usize) -> Axis {
        let (squares, standing_out) = self.changes(axis);
        let more = beyond(squares.iter());
        let relative = |s: &Square| (s.place, s.square / (s.known + more));
        let mut out = Axis {
            changes: squares.iter().map(relative).collect(),
            unpredicted: Vec::new(),
            squares,
        };
        if self.t_s.len() <= MOST_PREDICTED && !out.squares.is_empty() {
            out.unpredicted = self.unpredicted(axis, more, &standing_out);
        }
        out
    }

    /// Squares of what the frames before do not predict about an axis, over their variance; what stands out does not say
    /// what the noise is.
    fn unpredicted(&self, axis: usize, more: f64, standing_out: &[usize]) -> Vec<(Place, f64)> {
        let (theta, known) = (&self.theta[axis], &self.known[axis]);
        let counts = |k: usize| theta[k].is_finite() && known[k] + more > 0.0;
        let mut count: Vec<f64> = (0..theta.len())
            .map(|k| {
                if counts(k) {
                    (known[k] + more).recip()
                } else {
                    0.0
                }
            })
            .collect();
        let most = count.iter().copied().fold(0.0, f64::max);
        count.iter_mut().for_each(|n| *n /= most);
        let mut usual = count.clone();
        standing_out.iter().for_each(|&k| usual[k] = 0.0);
        let kept = || (0..theta.len()).filter(|&k| usual[k] > 0.0);
        let mean = kept().map(|k| theta[k]).sum::<f64>() / kept().count().max(1) as f64;
        let about = |k: usize| if count[k] > 0.0 { theta[k] - mean } else { 0.0 };
        let mut left: Vec<f64> = (0..theta.len()).map(about).collect();
        let noise = Coloured::fit(self.t_s, &left, &usual);
        noise.whiten(self.t_s, &count, &mut [&mut left]);
        let mut out = Vec::new();
        for (block, frames) in self.folds.blocks.iter().enumerate() {
            for at in frames.clone().filter(|&k| count[k] > 0.0) {
                let place = Place {
                    at,
                    star: axis,
                    block,
                };
                let square = (left[at] * left[at]).min(MOST_OF_A_SQUARE);
                out.push((place, square));
            }
        }
        out
    }

    /// Squared differences about an axis, and the frames whose differences stand out.
    fn changes(&self, axis: usize) -> (Vec<Square>, Vec<usize>) {
        let (t_s, theta, known) = (self.t_s, &self.theta[axis], &self.known[axis]);
        let longest = 2.0 * longest_step(t_s);
        let mut all = Vec::new();
        for (block, frames) in self.folds.blocks.iter().enumerate() {
            for k in frames.clone().filter(|k| (1..t_s.len() - 1).contains(k)) {
                let around = [k - 1, k, k + 1];
                let difference = of_three(theta, around, OWN.sqrt(), -NEIGHBOUR.sqrt());
                if difference.is_finite() && t_s[k + 1] - t_s[k - 1] <= longest {
                    all.push(Square {
                        place: Place {
                            at: k,
                            star: axis,
                            block,
                        },
                        square: difference * difference,
                        known: of_three(known, around, OWN, NEIGHBOUR),
                    });
                }
            }
        }
        let mut more: Vec<f64> = all.iter().map(|s| s.square / MEDIAN - s.known).collect();
        let usual = median(&mut more).unwrap_or(0.0).max(0.0);
        all.retain(|s| s.known + usual > 0.0);
        let mut standing_out = Vec::new();
        for s in &mut all {
            let most = MOST_OF_A_SQUARE * (s.known + usual);
            if s.square > most {
                s.square = most;
                standing_out.push(s.place.at);
            }
        }
        (all, standing_out)
    }
}

/// Squares about an axis, over what their variance is in itself.
struct Axis {
    changes: Vec<(Place, f64)>,
    unpredicted: Vec<(Place, f64)>,
    /// Those of the changes themselves.
    squares: Vec<Square>,
}

/// The variance beyond what is known, arcsec^2; 0 of none.
fn beyond<'s>(squares: impl Iterator<Item = &'s Square>) -> f64 {
    let (sum, information) = squares.fold((0.0, 0.0), |(sum, information), s| {
        // without any that is known all count alike
        let weight = if s.known > 0.0 { s.known.recip() } else { 1.0 };
        (sum + weight * (s.square - s.known), information + weight)
    });
    f64::max(sum / information, 0.0)
}

/// What attitudes err by from frame to frame in the frames with the least of these `sizes`, arcsec: about the axis that
/// errs most.
fn error_at_rest(axes: &[Axis], sizes: &[f64]) -> f64 {
    let mut known: Vec<f64> = sizes.iter().copied().filter(|s| s.is_finite()).collect();
    known.sort_by(f64::total_cmp);
    let Some(slow) = known.get(known.len() / AT_REST) else {
        return f64::INFINITY;
    };
    let each = axes.iter().map(|axis| {
        let at_rest = axis.squares.iter().filter(|s| sizes[s.place.at] <= *slow);
        beyond(at_rest).sqrt()
    });
    each.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    /// Frames that turn to and fro about x, and a temperature.
    const FRAMES: usize = 1200;

    fn rate(k: usize) -> f64 {
        0.1 * (k as f64 / 30.0).sin()
    }

    /// Chances of a motion and a channel where the noise about each axis is 1 arcsec beside `more(axis, frame)`, and a
    /// slow error of 20 arcsec.
    fn chances(seed: u64, more: impl Fn(usize, usize) -> f64) -> [f64; 2] {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let t_s: Vec<f64> = (0..FRAMES).map(|k| 0.5 * k as f64).collect();
        let theta = [0, 1, 2].map(|axis| {
            let each = (0..FRAMES).map(|k| {
                let [white, own]: [f64; 2] = [0, 1].map(|_| StandardNormal.sample(&mut rng));
                white + own * more(axis, k) + 20.0 * (k as f64 / 90.0).sin()
            });
            each.collect()
        });
        let turning = Turning {
            t_s: &t_s,
            theta,
            // stars of which a half is seen by turns
            known: [0; 3].map(|_| (0..FRAMES).map(|k| [0.3, 0.6][k / 100 % 2]).collect()),
            folds: &Folds::cut(FRAMES),
        };
        let none = || vec![0.0; FRAMES];
        let motion = Motion {
            axes: [(0..FRAMES).map(rate).collect(), none(), none()],
            of_attitudes: 0.0,
        };
        let channel = (0..FRAMES).map(|k| (k as f64 / 170.0).cos()).collect();
        let judged = turning.judged(&[
            ("rate".to_owned(), Varies::Motion(motion)),
            ("channel".to_owned(), Varies::Alike(channel)),
        ]);
        ["rate", "channel"].map(|name| {
            let of_name = judged.iter().filter(|(n, _)| n == name);
            of_name.map(|(_, [p, _])| *p).fold(1.0, f64::min)
        })
    }

    /// A jitter that turns frames by 1.2 arcsec at the largest rate, about the axis that turns: of its 1200 squares the
    /// mean grows by 0.72 where z^2 is a half, to 0.054 / 0.35; 10 sigma and more, of which differences keep 0.7. A
    /// channel at whose warm end all axes have 1.6 times the noise: 3600 squares.
    #[test]
    fn noise_that_frames_share_follows_a_motion_and_a_channel() {
        let [of_rate, other] = chances(1, |axis, k| if axis == 0 { 12.0 * rate(k) } else { 0.0 });
        assert!(of_rate < 1e-6 && other > 1e-3, "{of_rate} {other}");
        let [other, of_channel] = chances(2, |_, k| {
            let warm = 0.5 + 0.5 * (k as f64 / 170.0).cos();
            1.25 * warm
        });
        assert!(of_channel < 1e-6 && other > 1e-3, "{of_channel} {other}");
    }

    /// Of 200 runs whose noise follows nothing, a chance of 5 % of five tests comes up in 50 at most if each were by
    /// itself; the score test is known by some hundred blocks. Twice 200 chances below 0.01: ten of them expected, five
    /// columns each (two of the channel, three of the motion) with one chance taken of all.
    #[test]
    fn noise_that_follows_nothing_is_told_as_such() {
        let all: Vec<[f64; 2]> = (0..200)
            .map(|seed| chances(10 + seed, |_, _| 0.0))
            .collect();
        let below = |column: usize| all.iter().filter(|c| c[column] < 0.01).count();
        // 200 * 0.03 and 200 * 0.02, and 4 sigma of counts
        assert!(below(0) <= 6 + 10, "{}", below(0));
        assert!(below(1) <= 4 + 8, "{}", below(1));
    }
}
