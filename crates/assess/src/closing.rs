//! The loop: axisymmetric rotator, misalignment, then whatever else the residual asks for.
//!
//! ```text
//! gain = sum_axis n_eff/2 ln(rss_before / rss_after)            log-likelihood, tracker axes
//! n_eff = n (1 - c) / (1 + c)                                   c: lag-one correlation that is left
//! out of fold: d = -(J^T J)^-1 J^T r over the other four blocks, residual r + J d in the fifth
//! ```
//!
//! One term after another: of all candidates the one whose gain, less its number of parameters and the
//! logarithm of the trials, is largest by the linear problem is fitted. Where the residual is white and
//! no candidate has a chance below one in a hundred, the path ends; then, from its end, terms are taken
//! back that are not significant against the noise found there, or whose path predicts the other folds
//! no better. Blocks are solved by the linear problem around the fit of all frames, which differs from
//! theirs by arcseconds.
//!
//! Source: [A01], "it is clear from Fig. 1 that some systematic error remains"; docs/formats/report.md.

mod folds;
mod lines;

use nalgebra::{DMatrix, Vector3};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::model::{Fit, Fitter, Free, Oscillation, Rotating, TimeTagStep};
use crate::start::Start;
use crate::{AssessError, Observed};

use folds::out_of_fold;
pub(crate) use folds::{FOLDS, fold_of};
use lines::strongest_line;

/// Chance below which a term is believed.
const P_LIMIT: f64 = 0.01;
/// Most terms that are added.
const MOST_TERMS: usize = 10;
/// Correlation of neighbours above which a residual is no noise yet.
const STILL_COLOURED: f64 = 0.3;

/// What a model can get beside the six parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Term {
    /// Turn between tracker and body, about body x and y.
    Misalignment,
    /// `I3/IT` is not what was given.
    InertiaRatio,
    /// The transverse moments of inertia differ.
    Triaxiality,
    /// A torque along the angular momentum.
    SpinRateChange,
    /// A constant torque across it, in inertial space.
    SlowTorque,
    /// A step of the time tags.
    TimeTagStep,
    /// The tracker swings against the body that spins: a boom that flexes.
    Oscillation,
}

impl Term {
    /// Its name in reports.
    #[must_use]
    pub fn id(self) -> &'static str {
        match self {
            Self::Misalignment => "misalignment",
            Self::InertiaRatio => "inertia_ratio",
            Self::Triaxiality => "triaxiality",
            Self::SpinRateChange => "spin_rate_change",
            Self::SlowTorque => "slow_torque",
            Self::TimeTagStep => "time_tag_step",
            Self::Oscillation => "oscillation",
        }
    }

    /// Candidates once the alignment is right.
    pub const CANDIDATES: [Self; 6] = [
        Self::InertiaRatio,
        Self::Triaxiality,
        Self::SpinRateChange,
        Self::SlowTorque,
        Self::TimeTagStep,
        Self::Oscillation,
    ];
}

/// A term that was added, with what it did.
#[derive(Clone, Debug, PartialEq)]
pub struct Added {
    /// The term.
    pub term: Term,
    /// The first of its kind that was added.
    pub index: usize,
    /// Residual about the tracker's axes, rms out of fold, arcsec, before it.
    pub before_arcsec: [f64; 3],
    /// The same with it.
    pub after_arcsec: [f64; 3],
    /// Gain in log-likelihood out of fold, nats.
    pub delta_loglik: f64,
    /// Chance of its gain without the effect, the search paid for.
    pub p_value: f64,
}

/// A term that was looked at and left.
#[derive(Clone, Debug, PartialEq)]
pub struct Considered {
    /// The term.
    pub term: Term,
    /// Gain out of fold at the last look, nats; `None` where the data cannot show it.
    pub delta_loglik: Option<f64>,
    /// Its chance.
    pub p_value: Option<f64>,
}

/// The loop's findings.
#[derive(Clone, Debug)]
pub struct Closing {
    /// Six parameters, nominal alignment.
    pub axisymmetric: Fit,
    /// With the misalignment: the paper's model. The same as above where nothing shows a misalignment.
    pub aligned: Fit,
    /// With everything that was added.
    pub last: Fit,
    /// What was added, in order.
    pub added: Vec<Added>,
    /// What was not.
    pub considered: Vec<Considered>,
    /// Out-of-fold residual of the first model, tracker axes, arcsec.
    pub before_arcsec: [Vec<f64>; 3],
    /// Out-of-fold residual of the last.
    pub after_arcsec: [Vec<f64>; 3],
}

/// Closes the loop from a start. `noise_arcsec` is the white noise about the tracker's axes by which the
/// terms beyond the misalignment are weighed.
///
/// # Errors
/// A fit that does not converge.
pub fn close(
    observed: &Observed,
    start: &Start,
    noise_arcsec: [f64; 3],
    tell: &dyn Fn(&str),
) -> Result<Closing, AssessError> {
    let epoch_s = observed.middle_s();
    // slow residuals: let uncertainties hold for what goes together over a thirtieth of the span
    let lags = observed.len() / 30;
    let plain = Fitter::new(observed, epoch_s).with_lags(lags);
    tell("six-parameter fit");
    let axisymmetric = plain.fit(&start.model, &Free::SIX, "attitude and momentum")?;
    let mut added = Vec::new();
    if !start.spinning {
        // at a constant rate nothing but the rate shows
        let before = out_of_fold(&axisymmetric, observed)?;
        return Ok(Closing {
            aligned: axisymmetric.clone(),
            last: axisymmetric.clone(),
            axisymmetric,
            added,
            considered: Term::CANDIDATES
                .into_iter()
                .map(|term| Considered {
                    term,
                    delta_loglik: None,
                    p_value: None,
                })
                .collect(),
            before_arcsec: before.clone(),
            after_arcsec: before,
        });
    }
    tell("misalignment");
    let mut free = Free::SIX.to_vec();
    free.extend([Free::Misalignment(0), Free::Misalignment(1)]);
    let aligned = plain.fit(&axisymmetric.model, &free, "misalignment")?;
    let before = out_of_fold(&axisymmetric, observed)?;
    let n_eff = effective(&aligned.residual_arcsec);
    added.push(entry(
        Term::Misalignment,
        0,
        &axisymmetric,
        &aligned,
        observed,
        1.0,
        &n_eff,
    )?);
    let weighted = plain.weighted(noise_arcsec);
    let (last, mut considered) = match weighted.fit(&aligned.model, &free, "weighed") {
        Ok(first) => keep(path(&weighted, first, start, tell)?, &mut added, observed)?,
        // the aligned body stands; nothing more can be asked of such a record
        Err(_) => (aligned.clone(), vec![]),
    };
    considered.retain(|c| !added.iter().any(|a| a.term == c.term));
    let after_arcsec = out_of_fold(&last, observed)?;
    Ok(Closing {
        axisymmetric,
        aligned,
        last,
        added,
        considered,
        before_arcsec: before,
        after_arcsec,
    })
}

/// A step of the path: what was added, and how many were tried to find it.
struct Step {
    term: Term,
    index: usize,
    trials: f64,
    fit: Fit,
}

/// The fits one after the other, and what the last round looked at in vain.
struct Path {
    first: Fit,
    steps: Vec<Step>,
    left: Vec<Considered>,
}

/// One term after another, the one first that explains most for its number of parameters. While lines
/// are left each of them hides the next, so that nothing is judged here but a white residual.
fn path(
    fitter: &Fitter<'_>,
    first: Fit,
    start: &Start,
    tell: &dyn Fn(&str),
) -> Result<Path, AssessError> {
    let mut steps: Vec<Step> = Vec::new();
    let mut left = Vec::new();
    while steps.len() < MOST_TERMS {
        tell(&format!("terms beyond the rigid body: {}", steps.len()));
        let base = steps.last().map_or(&first, |step| &step.fit);
        let n_eff = effective(&base.residual_arcsec);
        let all = [base.residual_arcsec[0].len() as f64; 3];
        let white = base
            .residual_arcsec
            .iter()
            .all(|x| lag_one(x) < STILL_COLOURED);
        left.clear();
        let mut looks: Vec<(f64, f64, Candidate)> = Vec::new();
        for term in Term::CANDIDATES {
            let mut looked = Considered {
                term,
                delta_loglik: None,
                p_value: None,
            };
            if let Some(candidate) = candidate(fitter, base, term, start)
                && let Some(after) = linear(fitter, base, &candidate)?
            {
                let gain = gain(&base.residual_arcsec, &after, &n_eff);
                let p_value = chance(gain, candidate.parameters(), candidate.trials);
                looked.delta_loglik = Some(gain);
                looked.p_value = Some(p_value);
                let score = if white {
                    gain - candidate.parameters() - candidate.trials.ln()
                } else {
                    // what takes most away comes first: in its shade nothing else can be judged
                    self::gain(&base.residual_arcsec, &after, &all)
                };
                looks.push((score, p_value, candidate));
            }
            left.push(looked);
        }
        looks.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut next = None;
        for (_, p_value, candidate) in looks {
            if white && p_value >= P_LIMIT {
                break;
            }
            if let Some(fit) = candidate.fit(fitter, base) {
                next = Some((candidate, fit));
                break;
            }
        }
        let Some((candidate, fit)) = next else { break };
        steps.push(Step {
            term: candidate.term,
            index: candidate.index,
            trials: candidate.trials,
            fit,
        });
    }
    Ok(Path { first, steps, left })
}

/// Takes back what the whiter residual at the end of the path does not bear out, and writes down the
/// rest.
fn keep(
    path: Path,
    added: &mut Vec<Added>,
    observed: &Observed,
) -> Result<(Fit, Vec<Considered>), AssessError> {
    let Path {
        first,
        mut steps,
        left,
    } = path;
    while let Some(step) = steps.last() {
        let before = steps.len().checked_sub(2).map_or(&first, |k| &steps[k].fit);
        let n_eff = effective(&step.fit.residual_arcsec);
        let inside = gain(&before.residual_arcsec, &step.fit.residual_arcsec, &n_eff);
        let parameters = step.fit.free.len() - before.free.len();
        let p_value = chance(inside, parameters as f64, step.trials);
        let outside = gain(
            &out_of_fold(&first, observed)?,
            &out_of_fold(&step.fit, observed)?,
            &n_eff,
        );
        if p_value < P_LIMIT && outside > 0.0 {
            break;
        }
        steps.pop();
    }
    let last = steps.last().map_or(&first, |step| &step.fit).clone();
    let n_eff = effective(&last.residual_arcsec);
    let mut before = first;
    for step in steps {
        let entry = entry(
            step.term,
            step.index,
            &before,
            &step.fit,
            observed,
            step.trials,
            &n_eff,
        )?;
        added.push(entry);
        before = step.fit;
    }
    Ok((last, left))
}

/// A term to be tried: a model that holds it at zero, and what is then free.
struct Candidate {
    term: Term,
    index: usize,
    trials: f64,
    model: Rotating,
    /// Free from zero on.
    extra: Vec<Free>,
    /// Free once the others are not zero.
    then: Option<Free>,
}

impl Candidate {
    fn parameters(&self) -> f64 {
        (self.extra.len() + usize::from(self.then.is_some())) as f64
    }

    fn fit(&self, fitter: &Fitter<'_>, base: &Fit) -> Option<Fit> {
        let mut free = base.free.clone();
        free.extend(&self.extra);
        let mut fit = fitter.fit(&self.model, &free, self.term.id()).ok()?;
        if let Some(then) = self.then {
            free.push(then);
            fit = fitter.fit(&fit.model, &free, self.term.id()).ok()?;
        }
        let rss = |fit: &Fit| fit.minimum.residuals.norm_squared();
        (rss(&fit) < rss(base)).then_some(fit)
    }
}

fn has(fit: &Fit, term: Term) -> bool {
    fit.free.iter().any(|free| match term {
        Term::Misalignment => matches!(free, Free::Misalignment(_)),
        Term::InertiaRatio => matches!(free, Free::AxialRatio),
        Term::Triaxiality => matches!(free, Free::Triaxiality(_)),
        Term::SpinRateChange => matches!(free, Free::SpinTorque),
        Term::SlowTorque => matches!(free, Free::CrossTorque(_)),
        // there may be another
        Term::TimeTagStep | Term::Oscillation => false,
    })
}

/// `None` where the term is there already, or this motion cannot show it.
fn candidate(fitter: &Fitter<'_>, base: &Fit, term: Term, start: &Start) -> Option<Candidate> {
    if has(base, term) {
        return None;
    }
    let mut out = Candidate {
        term,
        index: 0,
        trials: 1.0,
        model: base.model.clone(),
        extra: vec![],
        then: None,
    };
    match term {
        Term::Misalignment => out.extra = vec![Free::Misalignment(0), Free::Misalignment(1)],
        // without nutation nothing depends on the moments of inertia
        Term::InertiaRatio | Term::Triaxiality if !start.ratio_seen => return None,
        Term::InertiaRatio => out.extra = vec![Free::AxialRatio],
        Term::Triaxiality => out.extra = vec![Free::Triaxiality(0), Free::Triaxiality(1)],
        Term::SpinRateChange => out.extra = vec![Free::SpinTorque],
        Term::SlowTorque => out.extra = vec![Free::CrossTorque(0), Free::CrossTorque(1)],
        Term::TimeTagStep => {
            let (at_s, tried) = best_step(fitter, base)?;
            out.index = out.model.steps.len();
            out.trials = tried;
            out.model.steps.push(TimeTagStep {
                at_s,
                offset_s: 0.0,
            });
            out.extra = vec![Free::StepOffset(out.index)];
        }
        Term::Oscillation => {
            let (frequency_hz, tried) = strongest_line(fitter, base)?;
            out.index = out.model.oscillations.len();
            out.trials = tried;
            out.model.oscillations.push(Oscillation {
                frequency_hz,
                cos_rad: Vector3::zeros(),
                sin_rad: Vector3::zeros(),
            });
            // amplitudes first: without them the frequency moves nothing
            let [frequency, amplitudes @ ..] = Free::oscillation(out.index);
            out.extra = amplitudes.to_vec();
            out.then = Some(frequency);
        }
    }
    Some(out)
}

/// Residual that a term would leave by the linear problem, tracker axes, arcsec; `None` where the data do
/// not determine it beside what is free already.
fn linear(
    fitter: &Fitter<'_>,
    base: &Fit,
    candidate: &Candidate,
) -> Result<Option<[Vec<f64>; 3]>, AssessError> {
    let columns = fitter.columns(&candidate.model, &candidate.extra)?;
    let (j, r) = (&base.minimum.jacobian, &base.minimum.residuals);
    let (n, m) = (j.ncols(), columns.ncols());
    let mut all = DMatrix::zeros(j.nrows(), n + m);
    all.columns_mut(0, n).copy_from(j);
    all.columns_mut(n, m).copy_from(&columns);
    for mut column in all.column_iter_mut() {
        let norm = column.norm();
        if norm > 0.0 {
            column /= norm;
        }
    }
    let gram = all.tr_mul(&all);
    let Some(cholesky) = gram.cholesky() else {
        return Ok(None);
    };
    // a pivot this small: what is new in the column is a thousandth of it
    let factor = cholesky.l();
    if (0..n + m).any(|k| factor[(k, k)] < 1e-3) && (n..n + m).any(|k| factor[(k, k)] < 1e-3) {
        return Ok(None);
    }
    let d = cholesky.solve(&all.tr_mul(r));
    let left = r - &all * d;
    let sigma = fitter.sigma_arcsec();
    Ok(Some(std::array::from_fn(|axis| {
        let rows = left.iter().skip(axis).step_by(3);
        rows.map(|r| r * sigma[axis]).collect()
    })))
}

/// Frame from which on a shift of the time tags explains most, and the number of frames tried.
fn best_step(fitter: &Fitter<'_>, last: &Fit) -> Option<(f64, f64)> {
    let observed = fitter.observed();
    let [n, least] = [observed.len(), 20];
    if n < 2 * least + 2 {
        return None;
    }
    // about the spin axis the shift is a step of the angle: the best two-level split
    let axis = last
        .model
        .to_body
        .inverse()
        .transform_vector(&last.model.body.rate_rad_s.try_normalize(0.0)?);
    let sigma = fitter.sigma_arcsec();
    let angle = |k: usize| -> f64 {
        (0..3)
            .map(|i| last.residual_arcsec[i][k] * axis[i] / (sigma[i] * sigma[i]))
            .sum()
    };
    let total: f64 = (0..n).map(angle).sum();
    let (mut left, mut best) = (0.0, (0.0, 0));
    for k in 0..n {
        if k >= least && k + least <= n {
            let (a, b) = (k as f64, (n - k) as f64);
            let split = (left / a - (total - left) / b).powi(2) * a * b;
            if split > best.0 {
                best = (split, k);
            }
        }
        left += angle(k);
    }
    (best.1 > 0).then(|| (observed.t_s[best.1], n as f64))
}

/// What a term did.
fn entry(
    term: Term,
    index: usize,
    without: &Fit,
    with: &Fit,
    observed: &Observed,
    trials: f64,
    n_eff: &[f64; 3],
) -> Result<Added, AssessError> {
    let (before, after) = (
        out_of_fold(without, observed)?,
        out_of_fold(with, observed)?,
    );
    let inside = gain(&without.residual_arcsec, &with.residual_arcsec, n_eff);
    let parameters = with.free.len() - without.free.len();
    Ok(Added {
        term,
        index,
        before_arcsec: rms(&before),
        after_arcsec: rms(&after),
        delta_loglik: gain(&before, &after, n_eff),
        p_value: chance(inside, parameters as f64, trials),
    })
}

fn gain(before: &[Vec<f64>; 3], after: &[Vec<f64>; 3], n_eff: &[f64; 3]) -> f64 {
    (0..3)
        .map(|axis| 0.5 * n_eff[axis] * (rss(&before[axis]) / rss(&after[axis])).ln())
        .sum()
}

/// Twice the gain against chi-squared; the search multiplies the chance.
fn chance(gain: f64, parameters: f64, trials: f64) -> f64 {
    let chance =
        ChiSquared::new(parameters.max(1.0)).map_or(1.0, |chi2| chi2.sf(2.0 * gain.max(0.0)));
    (chance * trials * Term::CANDIDATES.len() as f64).min(1.0)
}

fn rss(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum()
}

pub(crate) fn rms(x: &[Vec<f64>; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| (rss(&x[axis]) / x[axis].len() as f64).sqrt())
}

pub(crate) fn lag_one(x: &[f64]) -> f64 {
    let lag: f64 = x.windows(2).map(|w| w[0] * w[1]).sum();
    lag / rss(x)
}

/// Frames that count, each axis: neighbours that agree count less.
fn effective(residual: &[Vec<f64>; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| {
        let x = &residual[axis];
        let c = lag_one(x).clamp(0.0, 0.999);
        x.len() as f64 * (1.0 - c) / (1.0 + c)
    })
}
