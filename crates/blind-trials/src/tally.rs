//! Scores of one trial, counted.
//!
//! Not physics: counting.

use std::collections::BTreeMap;

use telemetry::report::Verdict;

use crate::{Score, Trial};

/// Counts over the seeds of a trial.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tally {
    /// Bundles.
    pub runs: usize,
    /// An effect that acts was named first.
    pub first: usize,
    /// Everything that acts was found.
    pub all: usize,
    /// Something was named that does not act.
    pub with_extra: usize,
    /// What, and how often.
    pub extra: BTreeMap<String, usize>,
    /// All that acts, and nothing else.
    pub exact: usize,
    /// A parameter was off by more than 5 sigma.
    pub off: usize,
    /// Consistent, explained, partly explained, unexplained.
    pub verdicts: [usize; 4],
    /// Something outside was told honestly.
    pub honest: usize,
    /// What the leftover follows most, and how often.
    pub leftover: BTreeMap<String, usize>,
    /// Mean of before over floor, and of after over floor; NaN where the floor is not known.
    pub over_floor: [f64; 2],
    /// After is within 2 % of the floor: in how many, of how many.
    pub within: [usize; 2],
    /// The parameters.
    pub parameters: Vec<ParameterRow>,
    /// Sum of z^2, and their number.
    pub z: (f64, usize),
    /// Intervals that hold the truth, of how many.
    pub held: [usize; 2],
}

/// A parameter over the seeds in which its effect was found.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterRow {
    /// Effect and name.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Truth.
    pub truth: f64,
    /// Seeds.
    pub count: usize,
    /// Mean of the estimates.
    pub mean: f64,
    /// Rms of their errors.
    pub scatter: f64,
    /// The least that it could be.
    pub bound: Option<f64>,
    /// Rms of error over sigma; NaN without sigmas.
    pub z: f64,
}

impl Tally {
    /// Counts; `bounds` are those of [`bounds`](crate::bounds).
    #[must_use]
    pub fn of(trial: &Trial, scores: &[Score], bounds: &BTreeMap<(usize, String), f64>) -> Self {
        let mut tally = Self {
            runs: scores.len(),
            over_floor: [mean(scores, |s| s.before), mean(scores, |s| s.after)],
            ..Self::default()
        };
        for score in scores {
            tally.first += usize::from(score.first_right());
            tally.all += usize::from(score.all_found());
            tally.honest += usize::from(score.honest());
            tally.off += usize::from(!score.values_right());
            let mut extra = 0;
            for id in score.extra() {
                *tally.extra.entry(id.to_owned()).or_default() += 1;
                extra += 1;
            }
            tally.with_extra += usize::from(extra > 0);
            tally.exact += usize::from(extra == 0 && score.all_found());
            tally.verdicts[place(score.verdict)] += 1;
            if let Some(variable) = &score.leftover {
                *tally.leftover.entry(variable.clone()).or_default() += 1;
            }
            if score.floor.is_finite() {
                tally.within[0] += usize::from((score.after / score.floor - 1.0).abs() <= 0.02);
                tally.within[1] += 1;
            }
            for held in score.drawn.iter().filter_map(|d| d.held) {
                tally.held[0] += usize::from(held);
                tally.held[1] += 1;
            }
            for z in score.drawn.iter().map(|d| d.z).filter(|z| z.is_finite()) {
                tally.z.0 += z * z;
                tally.z.1 += 1;
            }
        }
        for (k, acting) in trial.truth.effect.iter().enumerate() {
            for (name, &truth) in &acting.values {
                let drawn = scores.iter().flat_map(|s| &s.drawn);
                let drawn: Vec<_> = drawn.filter(|d| d.acting == k && d.name == *name).collect();
                let Some(first) = drawn.first() else { continue };
                let n = drawn.len() as f64;
                let average = |f: &dyn Fn(f64, f64) -> f64| {
                    drawn.iter().map(|d| f(d.value, d.z)).sum::<f64>() / n
                };
                tally.parameters.push(ParameterRow {
                    name: format!("{} {name}", acting.id),
                    unit: first.unit.clone(),
                    truth,
                    count: drawn.len(),
                    mean: average(&|value, _| value),
                    scatter: average(&|value, _| (value - truth).powi(2)).sqrt(),
                    bound: bounds.get(&(k, name.clone())).copied(),
                    z: average(&|_, z| z * z).sqrt(),
                });
            }
        }
        tally
    }
}

fn mean(scores: &[Score], of: impl Fn(&Score) -> f64) -> f64 {
    let ratios = scores.iter().map(|s| of(s) / s.floor);
    let finite: Vec<f64> = ratios.filter(|r| r.is_finite()).collect();
    finite.iter().sum::<f64>() / finite.len() as f64
}

fn place(verdict: Verdict) -> usize {
    match verdict {
        Verdict::Consistent => 0,
        Verdict::Explained => 1,
        Verdict::PartlyExplained => 2,
        Verdict::Unexplained => 3,
    }
}

/// Chance of at least `k` of `n` where each comes with probability `p`.
pub(crate) fn at_least(k: usize, n: usize, p: f64) -> f64 {
    let mut term = (1.0 - p).powf(n as f64);
    let mut sum = 0.0;
    // the tail itself: it may be far below the rounding of 1
    for i in 0..=n {
        if i >= k {
            sum += term;
        }
        term *= (n - i) as f64 / (i as f64 + 1.0) * p / (1.0 - p);
    }
    f64::min(sum, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulated::nulls;
    use crate::{Claim, Drawn};
    use imager::Acting;

    fn a_score() -> Score {
        Score {
            verdict: Verdict::Explained,
            claims: vec![Claim {
                id: "a".into(),
                right: Some(0),
            }],
            found: vec![true],
            drawn: Vec::new(),
            leftover: None,
            follows: false,
            before: 2.0,
            after: 1.01,
            floor: 1.0,
        }
    }

    /// Three bundles: found at +1 and -1 sigma, and missed with something else named. The mean is over those
    /// found.
    #[test]
    fn counts_and_parameters() {
        let mut trial = nulls().unwrap().swap_remove(0);
        trial.truth.effect = vec![Acting {
            id: "a".into(),
            values: [("k".to_owned(), 5.0)].into(),
            ..Acting::default()
        }];
        let with = |value: f64| Score {
            drawn: vec![Drawn {
                acting: 0,
                name: "k".into(),
                unit: "s".into(),
                value,
                z: (value - 5.0) / 0.5,
                held: None,
            }],
            ..a_score()
        };
        let wrong = Score {
            verdict: Verdict::PartlyExplained,
            claims: vec![Claim {
                id: "b".into(),
                right: None,
            }],
            found: vec![false],
            leftover: Some("time".into()),
            after: 1.5,
            ..a_score()
        };
        let bounds = [((0, "k".to_owned()), 0.25)].into();
        let tally = Tally::of(&trial, &[with(5.5), with(4.5), wrong], &bounds);
        assert_eq!(
            (tally.runs, tally.first, tally.all, tally.exact),
            (3, 2, 2, 2)
        );
        assert_eq!((tally.with_extra, tally.extra["b"]), (1, 1));
        assert_eq!(tally.verdicts, [0, 2, 1, 0]);
        assert_eq!(tally.within, [2, 3]);
        assert_eq!(tally.leftover["time"], 1);
        let row = &tally.parameters[0];
        assert_eq!((row.count, row.bound), (2, Some(0.25)));
        assert!((row.mean - 5.0).abs() < 1e-12 && (row.scatter - 0.5).abs() < 1e-12);
        assert!((row.z - 1.0).abs() < 1e-12);
        assert!((tally.over_floor[0] - 2.0).abs() < 1e-12);
    }

    /// Of two tosses of probability 1/10: at least one 0.19, at least two 0.01.
    #[test]
    fn the_tail_of_a_binomial() {
        assert!((at_least(0, 2, 0.1) - 1.0).abs() < 1e-12);
        assert!((at_least(1, 2, 0.1) - 0.19).abs() < 1e-12);
        assert!((at_least(2, 2, 0.1) - 0.01).abs() < 1e-12);
        assert!((at_least(9, 9, 0.01) / 1e-18 - 1.0).abs() < 1e-9);
    }
}
