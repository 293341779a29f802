//! Which noise effects the residuals call for.
//!
//! Each is held against the joint model of all of them (variance.rs): slope and rate
//! beside each other, and both beside spikes, whether those are claimed or not.
//!
//! ```text
//! p = 3 max( chi2 of 2 (L - L_without) / c,  F of beta^2 / var(beta) )
//!     c: how much wider than chi2_2 the squares scatter
//!     L_without: at no rate, no spikes, and for the slope next to none: nearer is as declared
//!     var: over blocks of time; for the slope also over stars, which may differ for no reason at all
//! for the rate, that each star's noise follows it where every star has its own level (`rate_by_star.rs`)
//! gain = sum over the folds of Z(all) - Z(others) - the same without,   Z = max ln L - ln(I + I_all/N) / 2
//! ```
//!
//! (I: information on the parameter beside the others, N: scalars). A rate that is seen in one fold alone is
//! predicted by no other, but neither spoiled; nor are spikes by one that is larger than all others.
//!
//! A rate is no effect where noise that changes with the time explains as much.
//!
//! Spikes are told from stars that are noisier than others: every star has its own
//! level there, from the median of its squares. And they are told from noise that merely
//! has tails: spikes must be likelier than Student's t with the freedom that suits best.
//!
//! Source: Wilks 1938; Liang & Zeger 1986; Satorra & Bentler 1994 (scaled ratio).

use std::cell::OnceCell;

use block_regression::{Folds, beyond};
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

use super::density::DECLARED;
use super::rate_by_star;
use super::rivals::Rival;
use super::rows::Row;
use super::squares::{MIN_ROWS, levels_shown};
use super::variance::{
    Covariance, Fit, LEVEL, MAGNITUDE, MOST_SHARE, Model, PARAMETERS, RATE, SHARE, SIZE, Vector,
    Without, information, logit, sigmoid,
};
use crate::search::selection::FAMILY_ALPHA;

/// Effects that are tried.
const TRIED: f64 = 3.0;
/// Fewest stars and spread of magnitudes that show a slope.
const MIN_STARS: usize = 4;
const MIN_SPREAD_MAG: f64 = 0.02;
/// Least relative spread of the squared rate.
const MIN_SPREAD_RATE: f64 = 0.05;
/// Largest slope that nature makes.
const CREDIBLE_SLOPE: f64 = 4.0;
/// Fewest spikes that are a rate.
const MIN_SPIKES: f64 = 3.0;
/// Share of the largest share beyond which it would be larger still.
const AT_MOST: f64 = 0.99;
/// Share of the spikes that follow or are followed by another of their star: by chance 0.36 at most.
const MOST_IN_A_ROW: f64 = 0.6;
/// Nats by which spikes must beat noise with tails.
const BEYOND_TAILS: f64 = 5.0;
/// Sigmas within which two estimates agree, and the least sigma of their difference, in
/// those of the worse one: neighbours are differenced, which costs a third of what they tell.
const AGREEING: f64 = 4.0;
const LEAST_SPREAD: f64 = 0.5;
/// Sigmas beyond what passes for nothing that the estimate from differences has to show.
const SEEN_QUICK: f64 = 2.0;
/// Rounds of rows (whose rotation is weighed by the noise) and fit.
const ROUNDS: usize = 2;

/// Makes the rows under a belief: the variance of a row, and how likely it is no spike.
pub(super) type Make<'a> = dyn Fn(&dyn Fn(&Row) -> [f64; 2]) -> Vec<Row> + 'a;

type Free = [bool; PARAMETERS];

/// One effect beside the others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Judged {
    pub(super) gain: f64,
    pub(super) p_value: f64,
    pub(super) observable: bool,
    pub(super) stands: bool,
    /// What speaks against it although it is significant.
    pub(super) against: Option<&'static str>,
    /// Of spikes the share of rows that the fewest are which make one, of a rate, which adds in square, the least that
    /// would have shown.
    pub(super) least_seen: Option<f64>,
    /// Values with sigmas: slope; rate; share and size.
    pub(super) values: [[f64; 2]; 2],
    /// What of the first value passes for nothing.
    pub(super) least: f64,
}

impl Judged {
    /// Whether noise that changes from frame to frame tells the same: what is slow is no noise, and all of the
    /// residual shows the more for it. The estimate on all of it is the better one if there is nothing else, so
    /// that the difference has the difference of the variances (Hausman 1978).
    fn agrees(&self, quick: &Self) -> bool {
        let ([value, sigma], [other, its]) = (self.values[0], quick.values[0]);
        if !quick.observable {
            return true;
        }
        let spread = (its * its - sigma * sigma).max(0.0).sqrt();
        let [all, fast] = [value, other].map(|v| v * value.signum());
        all - fast <= AGREEING * spread.max(LEAST_SPREAD * its)
            && fast > self.least + SEEN_QUICK * its
    }

    /// The same beside what differences of rows tell.
    pub(super) fn beside(self, quick: &Self) -> Self {
        if !self.stands || self.agrees(quick) {
            return self;
        }
        Self {
            stands: false,
            against: Some("what changes from one row of a star to the next does not show it"),
            ..self
        }
    }
}

const UNSEEN: Judged = Judged {
    gain: 0.0,
    p_value: 1.0,
    observable: false,
    stands: false,
    against: None,
    least_seen: None,
    values: [[0.0; 2]; 2],
    least: 0.0,
};

/// The three effects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Verdicts {
    pub(super) magnitude: Judged,
    pub(super) rate: Judged,
    pub(super) outliers: Judged,
    /// Variance over the declared one beside the slope and the rate that stand, where one does.
    pub(super) level: Option<f64>,
}

/// Rows and what they are held against.
struct Bench<'a> {
    rows: Vec<Row>,
    model: Model,
    folds: &'a Folds,
    stars: usize,
    least_slope: f64,
    most_rate: f64,
    rivals: &'a [Rival<'a>],
}

/// A fit, how well its parameters are known, and what its folds tell where that is asked for.
struct Shown {
    fit: Fit,
    known: Option<Covariance<3>>,
    folds: OnceCell<Vec<Without>>,
}

/// Whether a gain is told in any case, or matters only to what is significant.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Gain {
    Told,
    IfSignificant,
}

/// What is known before the residuals are looked at.
#[derive(Clone, Copy)]
pub(super) struct Known<'a> {
    /// Whether rates are.
    pub(super) moving: bool,
    /// A slope that passes for nothing.
    pub(super) least_slope: f64,
    /// Largest noise of a rate that nature makes, arcsec/(deg/s).
    pub(super) most_rate: f64,
    /// Declared shares and sizes.
    pub(super) outliers: [[f64; 2]; DECLARED],
    /// What the noise may follow in place of the rate.
    pub(super) rivals: &'a [Rival<'a>],
}

/// Judges. `make` gives the rows under a belief of variance and soundness.
pub(super) fn judge(make: &Make<'_>, folds: &Folds, known: Known<'_>) -> Option<Verdicts> {
    let mut rows = make(&|row: &Row| [row.declared, 1.0]);
    let mut free = [false; PARAMETERS];
    let mut model = Model::new(&rows, known.outliers);
    // the highest hill is known from the first round on
    let mut hill: Option<Vector> = None;
    let up = |hill: Option<Vector>, model: &Model, rows: &[Row], free: Free| match hill {
        Some(hill) => Some(model.fit(rows, &hill, free, &|_| true)),
        None => climb(model, rows, free),
    };
    for _ in 0..ROUNDS {
        if rows.iter().filter(|r| !r.marked).count() < 10 * MIN_ROWS {
            return None;
        }
        free = observable(&rows, known.moving);
        let full = up(hill, &model, &rows, free)?;
        rows = make(&model.belief(&full.at));
        model = Model::new(&rows, known.outliers);
        hill = Some(full.at);
    }
    let stars = rows.iter().map(|r| r.star + 1).max()?;
    let bench = Bench {
        rows,
        model,
        folds,
        stars,
        least_slope: known.least_slope,
        most_rate: known.most_rate,
        rivals: known.rivals,
    };
    let full = up(hill, &bench.model, &bench.rows, free)?;
    let outliers = bench.spikes(&full);
    let full = bench.shown(full);
    let [mut magnitude, mut rate] = [MAGNITUDE, RATE].map(|k| bench.one(k, &full, Gain::Told));
    if magnitude.observable && rate.observable && magnitude.stands != rate.stands {
        // the one that stands, without the freedom of the other
        let (alone, other) = if magnitude.stands {
            (MAGNITUDE, RATE)
        } else {
            (RATE, MAGNITUDE)
        };
        let again = bench.alone(alone, &full.fit, other);
        if again.stands {
            *(if alone == MAGNITUDE {
                &mut magnitude
            } else {
                &mut rate
            }) = again;
        }
    } else if magnitude.observable && rate.observable && !magnitude.stands {
        // they may hide behind each other
        let alone = bench.alone(MAGNITUDE, &full.fit, RATE);
        let other = bench.alone(RATE, &full.fit, MAGNITUDE);
        if alone.stands && (!other.stands || alone.gain >= other.gain) {
            magnitude = alone;
        } else if other.stands {
            rate = other;
        }
    }
    let level = (magnitude.stands || rate.stands)
        .then(|| bench.level(&full.fit, [magnitude.stands, rate.stands]));
    Some(Verdicts {
        magnitude,
        rate,
        outliers,
        level,
    })
}

/// What the rows can show.
fn observable(rows: &[Row], moving: bool) -> Free {
    let spread = |f: &dyn Fn(&Row) -> f64| {
        let n = rows.len().max(1) as f64;
        let mean = rows.iter().map(f).sum::<f64>() / n;
        let square = rows.iter().map(|r| (f(r) - mean).powi(2)).sum::<f64>() / n;
        (mean, square.sqrt())
    };
    let mut stars: Vec<usize> = rows.iter().map(|r| r.star).collect();
    stars.sort_unstable();
    stars.dedup();
    let mut free = [false; PARAMETERS];
    free[LEVEL] = true;
    free[SHARE] = true;
    free[SIZE] = true;
    free[MAGNITUDE] = stars.len() >= MIN_STARS && spread(&|r| r.mag).1 > MIN_SPREAD_MAG;
    let (mean, rate) = spread(&|r| r.rate);
    free[RATE] = moving && rate > MIN_SPREAD_RATE * mean;
    free
}

/// The best of several starts: spikes are a second maximum.
fn climb(model: &Model, rows: &[Row], free: Free) -> Option<Fit> {
    let plain = model.plain(rows);
    let starts = if free[SHARE] {
        let near = [[1e-3, 100.0], [1e-2, 25.0]].map(|[share, size]: [f64; 2]| {
            let mut at = plain;
            at[SHARE] = logit(share);
            at[SIZE] += (size / 100.0).ln();
            at
        });
        near.into_iter().chain(model.standing_out(rows)).collect()
    } else {
        vec![plain]
    };
    starts
        .iter()
        .map(|at| model.fit(rows, at, free, &|_| true))
        .filter(|fit| fit.loglik.is_finite())
        .max_by(|a, b| a.loglik.total_cmp(&b.loglik))
}

/// What the slope of `fit` makes of the variance of a row.
fn grown(fit: &Fit, row: &Row) -> f64 {
    10_f64.powf(0.4 * fit.at[MAGNITUDE] * row.mag)
}

impl Bench<'_> {
    /// `fit` without parameter `k`.
    fn without(&self, fit: &Fit, k: usize) -> Fit {
        self.with(fit, k, 0.0)
    }

    /// `fit` with parameter `k` held at `value`.
    fn with(&self, fit: &Fit, k: usize, value: f64) -> Fit {
        let mut free = fit.free;
        free[k] = false;
        let mut at = fit.at;
        at[k] = value;
        self.model.fit(&self.rows, &at, free, &|_| true)
    }

    /// The rows, whose declared variance has the slope of `fit`.
    fn flattened(&self, fit: &Fit) -> Vec<Row> {
        let row = |row: &Row| Row {
            declared: row.declared * grown(fit, row),
            ..*row
        };
        self.rows.iter().map(row).collect()
    }

    /// What speaks for another cause than the rate in `full`: noise that changes with the time as much, or with another
    /// variable more. What is no square serves as a slope in magnitude, of which that of `full` is taken out.
    fn against_rate(&self, full: &Fit) -> Option<&'static str> {
        let rows = self.flattened(full);
        let other = |changed: &dyn Fn(&Row) -> Row, adds: bool| {
            let rows: Vec<Row> = rows.iter().map(changed).collect();
            let (mut at, mut free) = (full.at, full.free);
            (at[MAGNITUDE], at[RATE]) = (0.0, 0.0);
            (free[MAGNITUDE], free[RATE]) = (!adds, adds);
            self.model.fit(&rows, &at, free, &|_| true).loglik
        };
        let last = rows.iter().map(|r| r.block).max().unwrap_or(0).max(1);
        let in_time = |row: &Row| Row {
            mag: 2.0 * row.block as f64 / last as f64 - 1.0,
            ..*row
        };
        if other(&in_time, false) >= full.loglik {
            return Some("noise that changes with time explains as much");
        }
        self.rivals.iter().find_map(|rival| {
            let own = other(&|row| rival.in_place(row), rival.adds());
            Rival::against(own, full.loglik)
        })
    }

    /// `fit`, with how well its parameters are known: by blocks, by stars and by both.
    fn shown(&self, fit: Fit) -> Shown {
        let known = self.model.covariance(
            &fit,
            &self.rows,
            [&|r| r.block, &|r| r.star, &|r| {
                r.block * self.stars + r.star
            }],
        );
        Shown {
            fit,
            known,
            folds: OnceCell::new(),
        }
    }

    /// Variance over the declared one where of slope and rate only those that `stand` act.
    fn level(&self, full: &Fit, stand: [bool; 2]) -> f64 {
        let (mut at, mut free) = (full.at, full.free);
        for (k, stands) in [MAGNITUDE, RATE].into_iter().zip(stand) {
            if !stands {
                (at[k], free[k]) = (0.0, false);
            }
        }
        self.model.fit(&self.rows, &at, free, &|_| true).at[LEVEL].exp()
    }

    /// Slope or rate without the `other`.
    fn alone(&self, k: usize, full: &Fit, other: usize) -> Judged {
        let shown = self.shown(self.without(full, other));
        self.one(k, &shown, Gain::IfSignificant)
    }

    /// Slope or rate beside all else that is free in a fit.
    fn one(&self, k: usize, shown: &Shown, wanted: Gain) -> Judged {
        let full = &shown.fit;
        if !full.free[k] {
            return UNSEEN;
        }
        let without = self.without(full, k);
        let value = full.at[k];
        // variances, and of how many sums
        let [blocks, stars, cells] = shown.known.as_ref().map_or([(0.0, 0); 3], |c| {
            (c.clustered.each_ref()).map(|(matrix, count)| (matrix[(k, k)], *count))
        });
        let widened = self.model.widening(&full.at, &self.rows);
        // what has to be shown is more than what passes for nothing
        let least = if k == MAGNITUDE {
            self.least_slope
        } else {
            0.0
        };
        let nearest = value.clamp(-least, least);
        let there = if nearest == 0.0 {
            without.loglik
        } else {
            self.with(full, k, nearest).loglik
        };
        let ratio = 2.0 * (full.loglik - there) / widened;
        let mut p = likely(ratio, 1.0);
        let beyond = value - nearest;
        p = p.max(wald(beyond, blocks.0, blocks.1, 1));
        let mut sigma2 = blocks.0.max(cells.0);
        if k == MAGNITUDE {
            let (variance, count) = stars;
            let variance = variance * of_few(count, 2);
            p = p.max(wald(beyond, variance, count, 2));
            sigma2 = sigma2.max(variance);
        }
        if k == RATE {
            let belief = self.model.belief(&full.at);
            let sound = |row: &Row| belief(row)[1];
            let rows = self.flattened(full);
            p = p.max(rate_by_star::chance(&rows, self.stars, sound, widened));
        }
        let p_value = (TRIED * p).min(1.0);
        let gain = if wanted == Gain::Told || p_value < FAMILY_ALPHA {
            let folds = shown.folds.get_or_init(|| self.folds_of(&self.rows, full));
            let others = self.folds_of(&self.rows, &without);
            self.gain(&[k], (full, folds), (&without, &others))
        } else {
            0.0
        };
        let values = if k == MAGNITUDE {
            [value, sigma2.sqrt()]
        } else {
            let root = value.max(0.0).sqrt();
            let sigma = if root > 0.0 {
                0.5 * sigma2.sqrt() / root
            } else {
                0.0
            };
            [root, sigma]
        };
        let credible = match k {
            MAGNITUDE => value.abs() <= CREDIBLE_SLOPE,
            _ => values[0] <= self.most_rate,
        };
        let significant = gain > 0.0 && p_value < FAMILY_ALPHA;
        let against = if !credible {
            Some("it would be larger than nature makes it")
        } else if k == RATE && significant {
            self.against_rate(full)
        } else {
            None
        };
        Judged {
            gain,
            p_value,
            observable: true,
            stands: against.is_none() && significant,
            against,
            least_seen: (k == RATE && sigma2 > 0.0).then(|| (super::SEEN * sigma2.sqrt()).sqrt()),
            values: [values, [0.0; 2]],
            least,
        }
    }

    /// Spikes, every star at its own level.
    fn spikes(&self, full: &Fit) -> Judged {
        let belief = self.model.belief(&full.at);
        let shown = levels_shown(&self.rows, self.stars, |row| belief(row)[0]);
        let rows: Vec<Row> = self
            .rows
            .iter()
            .map(|row| Row {
                declared: row.declared * grown(full, row) * shown[row.star].level.unwrap_or(1.0),
                ..*row
            })
            .collect();
        let mut free = full.free;
        free[MAGNITUDE] = false;
        let Some(with) = climb(&self.model, &rows, free) else {
            return UNSEEN;
        };
        free[SHARE] = false;
        free[SIZE] = false;
        let mut start = with.at;
        start[SHARE] = logit(1e-9);
        let without = self.model.fit(&rows, &start, free, &|_| true);
        let widened = self.model.widening(&with.at, &rows);
        let ratio = 2.0 * (with.loglik - without.loglik) / widened;
        let [held, others] = [&with, &without].map(|fit| self.folds_of(&rows, fit));
        let gain = self.gain(&[SHARE, SIZE], (&with, &held), (&without, &others));
        let share = sigmoid(with.at[SHARE]);
        let size = (0.5 * with.at[SIZE]).exp();
        let known = self.model.covariance(
            &with,
            &rows,
            [&|r| r.block, &|r| r.block * self.stars + r.star],
        );
        // a handful of spikes do not tell how they scatter
        let sigma = |k: usize| -> f64 {
            let all = known.iter().flat_map(|c| {
                let clustered = c.clustered.iter().map(|(matrix, _)| matrix);
                clustered.chain([&c.model])
            });
            all.map(|m| m[(k, k)]).fold(0.0, f64::max).sqrt()
        };
        let [part, larger] = self.model.untold(&with.at);
        let tails = self.model.loglik_of_tails(&with.at, &rows) + BEYOND_TAILS;
        let against = if share * (rows.len() as f64) < MIN_SPIKES {
            Some("so few rows are no share")
        } else if share > AT_MOST * MOST_SHARE {
            Some("so many rows are no spikes")
        } else if with.loglik <= tails {
            Some("noise with long tails explains as much")
        } else if self.in_a_row(&rows, &with) > MOST_IN_A_ROW {
            Some("they come one after the other")
        } else {
            None
        };
        let p_value = (TRIED * likely(ratio, 2.0)).min(1.0);
        Judged {
            gain,
            p_value,
            observable: true,
            stands: against.is_none() && gain > 0.0 && p_value < FAMILY_ALPHA,
            against,
            least_seen: Some(MIN_SPIKES / rows.len().max(1) as f64),
            values: [
                [share, share * part.hypot(sigma(SHARE) * (1.0 - share))],
                [size, 0.5 * size * larger.hypot(sigma(SIZE))],
            ],
            least: 0.0,
        }
    }

    /// Share of the spikes of `fit` whose star has one in its row before or after, too: what is smooth has all.
    fn in_a_row(&self, rows: &[Row], fit: &Fit) -> f64 {
        let belief = self.model.belief(&fit.at);
        let mut of_star = vec![Vec::new(); self.stars];
        for row in rows {
            of_star[row.star].push(belief(row)[1] < 0.5);
        }
        let (mut spikes, mut beside) = (0.0, 0.0);
        for star in &of_star {
            for k in (0..star.len()).filter(|&k| star[k]) {
                let before = k > 0 && star[k - 1];
                spikes += 1.0;
                beside += f64::from(before || star.get(k + 1) == Some(&true));
            }
        }
        beside / f64::max(spikes, 1.0)
    }

    /// What each fold tells, and what the others make of `fit` without it.
    fn folds_of(&self, rows: &[Row], fit: &Fit) -> Vec<Without> {
        self.model.without_each(rows, fit, self.folds).collect()
    }

    /// Gain of `with` over `without`, which holds the parameters `ks` at nothing, on folds that took no part in the fit;
    /// what the others know of these counts as it is known.
    fn gain(&self, ks: &[usize], with: (&Fit, &[Without]), without: (&Fit, &[Without])) -> f64 {
        let adds = |(fit, folds): (&Fit, &[Without])| -> f64 {
            let each = folds.iter().map(|fold| fit.loglik - fold.others.loglik);
            each.sum()
        };
        let known = ks.iter().map(|&k| {
            let told = information(with.1, with.0, k);
            let all: f64 = told.iter().sum();
            let one = all / (2 * self.rows.len()).max(1) as f64;
            let left = |told: &f64| (all - told).max(0.0) + one;
            let known = told.iter().filter(|_| all > 0.0);
            known
                .map(|told| 0.5 * ((all + one) / left(told)).ln())
                .sum::<f64>()
        });
        adds(with) - adds(without) - known.sum::<f64>()
    }
}

/// Tail of the likelihood ratio.
fn likely(ratio: f64, freedom: f64) -> f64 {
    ChiSquared::new(freedom).map_or(1.0, |law| law.sf(ratio.max(0.0)))
}

/// What a variance from `clusters` sums lacks, of which `spent` are spent: the fit goes through them
/// (`MacKinnon` and White 1985, HC3 at the mean leverage; of which (n - 1)/n is counted already).
fn of_few(clusters: usize, spent: usize) -> f64 {
    let n = clusters as f64;
    let left = clusters.saturating_sub(spent).max(1) as f64;
    n * (n - 1.0).max(1.0) / (left * left)
}

/// Tail of an estimate with a variance from `clusters` sums, of which `spent` are spent.
fn wald(value: f64, variance: f64, clusters: usize, spent: usize) -> f64 {
    let freedom = clusters.saturating_sub(spent) as f64;
    if variance <= 0.0 || freedom < 1.0 {
        return 1.0;
    }
    FisherSnedecor::new(1.0, freedom).map_or(1.0, |law| beyond(&law, value * value / variance))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_slow_is_no_noise() {
        let judged = |value: f64, sigma: f64| Judged {
            observable: true,
            values: [[value, sigma], [0.0; 2]],
            least: 0.1,
            ..UNSEEN
        };
        let all = judged(0.5, 0.05);
        // 0.08^2 - 0.05^2 = 0.062^2
        assert!(all.agrees(&judged(0.4, 0.08)));
        assert!(!all.agrees(&judged(0.2, 0.08)), "they differ by 4.8 sigma");
        // more than all: the same noise with its memory
        assert!(all.agrees(&judged(0.9, 0.08)));
        assert!(!all.agrees(&judged(-0.5, 0.08)));
        let refused = Judged {
            stands: true,
            ..all
        }
        .beside(&judged(0.2, 0.08));
        assert!(!refused.stands && refused.against.is_some());
        // they agree, and there is nothing in either
        assert!(!judged(0.2, 0.05).agrees(&judged(0.2, 0.08)));
        assert!(all.agrees(&UNSEEN), "nothing to hold it against");
    }
}
