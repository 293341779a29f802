//! The loop at attitude level: the tracker's own attitude against a reference.
//!
//! Not physics: the order of the steps.

use std::sync::Arc;

use block_regression::Folds;
use coloured_noise::{Coloured, Foreknown};
use effects::{Candidate, Scene};
use focal_plane::AttitudeSource as _;

use crate::attitude::data::{AttitudeData, AttitudeEvidence};
use crate::attitude::declared_effects;
use crate::attitude::left::{by_axes, slow_leftover};
use crate::attitude::mixing::Mixing;
use crate::attitude::motion_terms;
use crate::attitude::search::{self, Declared};
use crate::attitude::spatial_errors::SpatialErrors;
use crate::attitude::steadied::steadied;
use crate::bins;
use crate::causes::SMEAR;
use crate::declared;
use crate::error::CloseError;
use crate::evidence::{Amplitudes, Evidence, Residuals};
use crate::figures;
use crate::motion::{self, Around};
use crate::outcome::{Closed, Rival};
use crate::questions::confusion;
use crate::questions::hypothesis::{self, Grounds};
use crate::questions::manoeuvre::attitudes::fly;
use crate::questions::needed::{ToExplain, remarkable};
use crate::search::catalogue;
use crate::search::empirical::{Empirical, Variable, range};
use crate::search::instants;
use crate::search::orbits::{self, Look};
use crate::search::refusal::{Refusal, Refused};
use crate::search::selection::columns_of;
use crate::search::{Found, amplitudes, borrowed, fit};
use crate::situation::{Situation, channels_of_interest};
use crate::unexplained::leftover::{self, Series};
use nalgebra::{DVector, UnitQuaternion};
use spectra::robust::median_step;
use spectra::standing_out::mark;
use telemetry::AttitudeResiduals;
use telemetry::report::{Errors, Report, Rows};

/// A slow error of so many times the declared is as declared: over a few correlation times its size is known to
/// a half.
const WIDER: f64 = 2.0;
/// Share of runs in which chance makes a line as likely as the least that is worth a search with it: that holds it
/// against more of the noise, pays for all frequencies, and costs little.
const LIKELY: f64 = 0.5;
/// Most bins of a search with a fast line; one that needs more is described.
const FINEST: usize = 20_000;
/// Fewest frames from which an effect and its noise can both be had.
const MIN_FRAMES: usize = 20;

pub(crate) fn run(
    situation: &Situation<'_>,
    progress: &dyn Fn(&str),
) -> Result<Closed, CloseError> {
    let table = situation
        .bundle
        .attitude
        .as_ref()
        .ok_or(CloseError::NothingToCompare("no attitude"))?;
    let reference = situation
        .reference
        .as_ref()
        .ok_or(CloseError::NothingToCompare(
            "the bundle has an attitude but no reference to hold it against",
        ))?;
    let mut data = AttitudeData::against(&table.t_s, &table.q, reference);
    if data.t_s.len() < MIN_FRAMES {
        return Err(CloseError::TooFewFrames {
            table: "attitude",
            frames: data.t_s.len(),
            need: MIN_FRAMES,
            why: "the others lie outside the reference or in its gaps",
        });
    }
    let folds = Folds::cut(data.t_s.len());
    let around = motion::around(reference, &data.t_s, 1.0);
    let mut motion = &around;
    if !motion.resolved() {
        data.rate = std::array::from_fn(|_| vec![0.0; data.t_s.len()]);
    }
    let effects = declared::effects(situation)?;
    if !effects.is_empty() {
        data.subtract(|t_s| declared_effects::rotation(&effects, motion, t_s));
    }
    progress("residuals of the declared model");
    let before = settle(&mut data, situation, &folds, motion)?;

    progress("searching for causes");
    let scene = scene(situation, &data);
    let changes = SpatialErrors::declared(situation, &data.t_s);
    let declared = Declared {
        changes: changes.as_ref(),
        noise: declared_noise(situation)?,
    };
    let search = |data: &AttitudeData, motion: &Around, put_forward: &[Arc<dyn Candidate>]| {
        let mut list = catalogue::candidates(&scene);
        list.retain(|c| c.acts_on_attitude());
        list.extend(leftover_terms(situation, data));
        list.extend(motion_terms::terms(motion, &data.t_s));
        list.extend(put_forward.iter().cloned());
        let with_noise = |noise: [Coloured; 3]| evidence(data, situation, noise, motion);
        let (bins, start) = (&data.bins.folds, fit_noise(data, &before));
        let (found, noise, refused) =
            search::search(&with_noise, data, bins, &folds, list, declared, start)?;
        let chosen = &found.selection.chosen;
        let inside = in_sample(&with_noise(noise), &found, chosen);
        let series = inside
            .as_ref()
            .map(|inside| tracks(data, inside, changes.as_ref()));
        Ok::<_, CloseError>((found, noise, refused, series, inside))
    };
    let (mut found, mut noise, mut refused, mut series, inside) = search(&data, motion, &[])?;
    let is_smeared = |found: &Found| found.chosen().any(|c| c.id() == SMEAR);
    let steady = inside
        .filter(|_| !motion.by_rates() && noise.iter().any(|n| n.slow > 0.0))
        .filter(|_| is_smeared(&found))
        .and_then(|inside| {
            let shared = data.mixing != Mixing::default();
            let whole = shared.then(|| fit_whole_noise(&data, &inside));
            steadied(&data, reference, &inside, &whole.unwrap_or(noise))
        });
    let steady = steady.map(|path| motion::around(&path, &data.t_s, 1.0).without_error());
    if let Some(steady) = &steady {
        progress("searching again along the path less the reference's slow error");
        motion = steady;
        (found, noise, refused, series, _) = search(&data, motion, &[])?;
    }
    let line = series.as_ref().and_then(|s| s.shared_line(LIKELY));
    let fine = line.map_or(0, |line| data.bins_for(line.frequency_hz));
    let line = line.filter(|_| fine <= FINEST);
    let jump = series.as_ref().and_then(Series::shared_jump);
    let mut put_forward: Vec<_> = line
        .map(|line| line.candidate(&scene))
        .into_iter()
        .collect();
    put_forward.extend(jump.map(|jump| jump.candidate(&scene)));
    let white = fit_noise(&data, &before).map(|n| Coloured {
        white: n.white.hypot(n.slow),
        slow: 0.0,
        ..n
    });
    let white = evidence(&data, situation, white, motion);
    let (bins, surroundings) = (&data.bins.folds, &scene.surroundings);
    put_forward.extend(orbits::propose(&white, bins, surroundings, &found, None)?);
    if !put_forward.is_empty() {
        progress("searching again with the line, jump or orbit that is left");
        if line.is_some_and(|line| !data.bins.resolve(line.frequency_hz)) {
            data.rebin(&folds, fine.max(leftover::MOST_POINTS));
        }
        let again = search(&data, motion, &put_forward)?;
        let rivals = search::rivals(
            &|noise| evidence(&data, situation, noise, motion),
            &data,
            &data.bins.folds,
            &again.0,
            declared,
            again.1,
            search::follows_a_channel,
        )?;
        let theirs = orbits::is_beaten(&again.0, &rivals, search::follows_a_channel);
        // what was put forward in vain changes nothing
        if again.0.names_one_of_the_last(put_forward.len()) && !theirs {
            (found, noise, refused, series, _) = again;
        } else {
            data.rebin(&folds, bins::MOST);
        }
    }
    if steady.is_some() && !is_smeared(&found) {
        refused.insert(SMEAR.to_owned(), Refusal::OwnPath);
    }
    let bins = &data.bins.folds;
    let with_noise = |noise: [Coloured; 3]| evidence(&data, situation, noise, motion);
    let after = residuals(&with_noise(noise), &folds, &found, &found.selection.chosen)?;
    let mut rivals = Vec::new();
    let channels = search::is_a_channel;
    for (set, gain) in search::rivals(&with_noise, &data, bins, &found, declared, noise, channels)?
    {
        let residual = residuals(&with_noise(noise), &folds, &found, &set)?;
        rivals.push(Rival {
            what: names(&found, &set),
            rms_arcsec: (0..3)
                .map(|a| figures::rms(&residual.axes[a], &data.outlier[a]).unwrap_or(f64::NAN))
                .collect(),
            delta_loglik: gain,
        });
    }
    progress("figures");
    finish(
        situation,
        &data,
        &folds,
        noise,
        motion,
        &found,
        &refused,
        before,
        after,
        rivals,
        changes.as_ref(),
        series,
    )
}

/// What a set of candidates is called.
fn names(found: &Found, set: &[usize]) -> String {
    let name = |&g: &usize| {
        let candidate = &found.candidates[g];
        candidate
            .selectors()
            .get("variable")
            .cloned()
            .unwrap_or_else(|| candidate.id().to_owned())
    };
    if set.is_empty() {
        return "declared model".to_owned();
    }
    set.iter().map(name).collect::<Vec<_>>().join(" + ")
}

/// The before residual, with outliers marked per axis.
fn settle(
    data: &mut AttitudeData,
    situation: &Situation<'_>,
    folds: &Folds,
    motion: &Around,
) -> Result<Residuals, CloseError> {
    let white = [Coloured::WHITE; 3];
    loop {
        data.rebin(folds, bins::MOST);
        let evidence = evidence(data, situation, white, motion);
        let fitted = fit(&evidence, &data.bins.folds, &[])?;
        let amplitudes = amplitudes(&fitted, folds, &[], 0).ok_or(CloseError::Singular)?;
        let before = evidence.residuals(folds, &[], &amplitudes);
        let each = before.axes.iter().zip(&mut data.outlier);
        let added: usize = each.map(|(axis, outlier)| mark(axis, outlier)).sum();
        if added == 0 {
            data.mixing = Mixing::of(&before, &data.outlier);
            return Ok(before);
        }
    }
}

fn evidence<'a>(
    data: &'a AttitudeData,
    situation: &Situation<'_>,
    noise: [Coloured; 3],
    motion: &'a Around,
) -> AttitudeEvidence<'a> {
    AttitudeEvidence {
        data,
        constant_sigma: situation
            .model
            .noise
            .bias_arcsec
            .map_or([f64::INFINITY; 3], |b| {
                b.map(|s| if s > 0.0 { s } else { f64::INFINITY })
            }),
        noise,
        motion: Some(motion),
    }
}

/// The slow noise that a hybrid model declares of each axis, or any model of the reference.
fn declared_noise(situation: &Situation<'_>) -> Result<[Option<Foreknown>; 3], CloseError> {
    let Some(hem) = &situation.model.hem else {
        return Ok(declared::reference(&declared::effects(situation)?));
    };
    Ok([&hem.x, &hem.y, &hem.z].map(|axis| {
        let known = Foreknown {
            slow: axis.sigma_hsf_arcsec,
            tau_s: axis.tau_hsf_s,
        };
        (known.slow > 0.0 && known.tau_s > 0.0).then_some(known)
    }))
}

/// Noise of each axis without what it shares.
fn fit_noise(data: &AttitudeData, residual: &Residuals) -> [Coloured; 3] {
    let axes = std::array::from_fn(|axis| residual.axes[axis].as_slice());
    noise_of(data, &data.unshared(axes))
}

/// Noise of each axis.
fn fit_whole_noise(data: &AttitudeData, residual: &Residuals) -> [Coloured; 3] {
    let means = std::array::from_fn(|axis| data.binned(axis, &residual.axes[axis]));
    noise_of(data, &means)
}

/// Noise that suits means over the bins best.
fn noise_of(data: &AttitudeData, means: &[Vec<f64>; 3]) -> [Coloured; 3] {
    std::array::from_fn(|axis| Coloured::fit(&data.bins.t_s, &means[axis], &data.count[axis]))
}

/// Log-likelihood of all rows a row, under the noise that suits them best, nats.
fn loglik_per_frame(data: &AttitudeData, residual: &Residuals) -> f64 {
    let total: f64 = (0..3)
        .map(|axis| {
            let count: Vec<f64> = data.outlier[axis]
                .iter()
                .map(|out| f64::from(u8::from(!out)))
                .collect();
            let series = &residual.axes[axis];
            Coloured::fit(&data.t_s, series, &count).log_likelihood(&data.t_s, series, &count)
        })
        .sum();
    total / data.t_s.len() as f64
}

fn residuals(
    evidence: &AttitudeEvidence<'_>,
    folds: &Folds,
    found: &Found,
    chosen: &[usize],
) -> Result<Residuals, CloseError> {
    let columns = found
        .candidates
        .iter()
        .map(|c| c.coefficients().len())
        .sum();
    let amplitudes =
        amplitudes(&found.fitted, folds, chosen, columns).ok_or(CloseError::Singular)?;
    Ok(evidence.residuals(folds, &borrowed(&found.candidates), &amplitudes))
}

fn scene<'a>(situation: &'a Situation<'_>, data: &AttitudeData) -> Scene<'a> {
    Scene {
        surroundings: situation.surroundings(),
        has_stars: false,
        has_catalogue: false,
        has_reference: true,
        has_attitude: true,
        stars: &[],
        exposure_s: situation.exposure_s(),
        step_s: median_step(&data.t_s).unwrap_or(f64::INFINITY),
        warm: None,
    }
}

/// Time and every housekeeping channel but velocities, which belong to
/// aberration alone.
fn leftover_terms(situation: &Situation<'_>, data: &AttitudeData) -> Vec<Arc<dyn Candidate>> {
    let mut terms: Vec<Arc<dyn Candidate>> = Vec::new();
    let mut add = |variable: Variable, range: [f64; 2]| {
        if let Some(term) = Empirical::new(variable, range, false) {
            terms.push(Arc::new(term));
        }
    };
    add(Variable::Time, range(data.t_s.iter().copied()));
    for (name, series) in channels_of_interest(&situation.channels) {
        add(
            Variable::Housekeeping(name, series.clone()),
            range(series.value().iter().copied()),
        );
    }
    terms
}

/// Residuals with the chosen effects estimated from all data: what other folds
/// predict has steps of its own where folds meet.
fn in_sample(
    evidence: &AttitudeEvidence<'_>,
    found: &Found,
    chosen: &[usize],
) -> Option<Residuals> {
    let set = columns_of(&found.fitted.groups, chosen);
    let value = found.fitted.fits.estimate(&set)?.value;
    let list = borrowed(&found.candidates);
    let columns = list.iter().map(|c| c.coefficients().len()).sum();
    let mut beta = DVector::zeros(columns);
    for (i, &c) in set.iter().enumerate() {
        beta[c] = value[i];
    }
    let amplitudes = Amplitudes {
        nuisance: Vec::new(),
        candidates: vec![beta],
    };
    let folds = Folds::whole(evidence.data.t_s.len());
    Some(evidence.residuals(&folds, &list, &amplitudes))
}

/// What lines and jumps are looked for in: axes without the noise that they share, where a row counts on all of them.
fn tracks(data: &AttitudeData, residual: &Residuals, changes: Option<&SpatialErrors>) -> Series {
    let (axes, outlier) = data.mixing.mix_rows(&residual.axes, &data.outlier);
    Series::of(&leftover::attitude_tracks(
        &data.t_s, &axes, &outlier, changes,
    ))
}

/// Squared length of each candidate column about its mean on every axis, arcsec^2.
fn column_lengths(evidence: &AttitudeEvidence<'_>, found: &Found) -> Vec<f64> {
    let data = evidence.data;
    let binned = evidence.plain(&borrowed(&found.candidates));
    let m = data.bins.rows.len();
    let length = |column: &[f64]| -> f64 {
        (0..3)
            .map(|axis| {
                let (values, count) = (&column[axis * m..(axis + 1) * m], &data.count[axis]);
                let all = || values.iter().zip(count);
                let rows: f64 = count.iter().sum();
                let mean = all().map(|(v, n)| v * n).sum::<f64>() / rows.max(1.0);
                all().map(|(v, n)| n * (v - mean) * (v - mean)).sum::<f64>()
            })
            .sum()
    };
    binned
        .column_iter()
        .skip(3)
        .map(|column| length(column.as_slice()))
        .collect()
}

/// Squared residual beyond the white noise of the axes on which it stands out of that, arcsec^2. Each by itself:
/// the noise about the boresight would hide what the others hold.
fn beyond_white(data: &AttitudeData, residual: &Residuals) -> Option<f64> {
    let noise = fit_whole_noise(data, residual);
    let mut whole = None;
    for axis in 0..3 {
        let rows: f64 = data.count[axis].iter().sum();
        let white = noise[axis].white * noise[axis].white;
        let square = figures::rms(&residual.axes[axis], &data.outlier[axis])?.powi(2);
        if let Some(excess) = remarkable(rows * (square - white), white, rows) {
            *whole.get_or_insert(0.0) += excess;
        }
    }
    whole
}

/// What is left of the squared residual `with` what was added, arcsec^2, and all that is left of `bare`, without it.
/// `described` is the share of the latter that follows something; `None` where nothing is left.
fn unexplained(
    data: &AttitudeData,
    [bare, with]: [&Residuals; 2],
    described: Option<f64>,
) -> [Option<f64>; 2] {
    let square = |r: &Residuals| -> f64 {
        let axis = |a: usize| {
            let rows: f64 = data.count[a].iter().sum();
            Some(rows * figures::rms(&r.axes[a], &data.outlier[a])?.powi(2))
        };
        (0..3).filter_map(axis).sum()
    };
    let left = described.map(|share| {
        let over = beyond_white(data, with).unwrap_or(0.0);
        over.max(share * square(bare))
    });
    let all = (square(bare) - square(with)).max(0.0) + left.unwrap_or(0.0);
    [left, Some(all)].map(|excess| excess.filter(|e| *e > 0.0))
}

fn finish(
    situation: &Situation<'_>,
    data: &AttitudeData,
    folds: &Folds,
    noise: [Coloured; 3],
    motion: &Around,
    found: &Found,
    refused: &Refused,
    before: Residuals,
    after: Residuals,
    rivals: Vec<Rival>,
    changes: Option<&SpatialErrors>,
    series: Option<Series>,
) -> Result<Closed, CloseError> {
    let chosen = &found.selection.chosen;
    let evidence = evidence(data, situation, noise, motion);
    let power = |r: &Residuals| -> f64 {
        (0..3)
            .filter_map(|a| figures::rms(&r.axes[a], &data.outlier[a]))
            .map(|v| v * v)
            .sum()
    };
    let whole = power(&before);
    let mut explained = Vec::new();
    let mut last = whole;
    for k in 0..chosen.len() {
        let now = power(&residuals(&evidence, folds, found, &chosen[..=k])?);
        explained.push((last - now) / whole);
        last = now;
    }
    // what is left is judged before a term without a cause is added
    let share = last / whole;
    let mut unattributed = figures::unattributed(found, share, |c| !motion_terms::is_of_motion(c));
    let with = |g: usize| residuals(&evidence, folds, found, &[chosen.as_slice(), &[g]].concat());
    let own = changes.map_or([0.0; 3], |c| c.slow_arcsec);
    let described = by_axes(data, found, &after, &with, own, share, &mut unattributed)?;
    let (surroundings, questions) = (situation.surroundings(), situation.questions);
    let mut added = chosen.clone();
    let plain = after;
    let mut after = plain.clone();
    if questions.empirical
        && let Some(g) = figures::best_empirical(found, &unattributed, &surroundings)
    {
        added.push(g);
        after = residuals(&evidence, folds, found, &added)?;
        explained.push((last - power(&after)) / whole);
    }
    let (mut effects, entries) =
        figures::effects_found(found, &added, &explained, &surroundings, questions)?;
    if effects.is_empty() {
        // nothing was added: constants that coloured noise weighs otherwise are no gain, and no loss
        after.clone_from(&before);
    }
    let confusion = confusion::compare(found, &mut effects);
    if let (false, Some(step), Some(&start)) = (
        confusion.is_empty(),
        median_step(&data.t_s),
        data.t_s.first(),
    ) {
        let sigma = evidence.constant_sigma;
        // a velocity is seen from where the tracker points
        let looking = situation.reference.as_ref().and_then(|r| r.attitude(start));
        let looking = looking.unwrap_or_else(UnitQuaternion::identity);
        confusion.tell(&mut effects, start, looking, &|flown| {
            fly(
                flown,
                &confusion.candidates,
                step,
                sigma,
                noise,
                data.mixing,
            )
        });
    }
    orbits::images::complete(
        &evidence,
        &data.bins.folds,
        found,
        &surroundings,
        &mut effects,
    )?;
    instants::complete(
        &evidence,
        &data.bins.folds,
        found,
        &surroundings,
        median_step(&data.t_s).unwrap_or(1.0),
        &mut effects,
    )?;
    let mut model = situation.model.clone();
    model.effects.extend(entries);
    let declared = match &situation.model.hem {
        Some(hem) => [&hem.x, &hem.y, &hem.z].map(|axis| WIDER * axis.sigma_hsf_arcsec),
        None => own,
    };
    // what acts in one fold alone is predicted by no other, and would be slow noise out of fold
    let told: Vec<usize> = chosen.iter().copied().chain(described).collect();
    let inside = in_sample(&evidence, found, &told);
    let left = inside.as_ref().unwrap_or(&plain);
    slow_leftover(data, left, declared, &mut unattributed, share);
    let series = series.unwrap_or_else(|| tracks(data, &plain, changes));
    let reference = situation.reference.as_ref().zip(series.across());
    let look = reference.and_then(|(path, tracks)| Look::at(&surroundings, path, tracks));
    series.describe().tell(&mut unattributed);
    let errors = |r: &Residuals| Errors {
        star_rms_arcsec: None,
        attitude_rms_arcsec: Some(std::array::from_fn(|a| {
            figures::rms(&r.axes[a], &data.outlier[a]).unwrap_or(f64::NAN)
        })),
        log_psd_cost: None,
        chi2_per_dof: None,
        loglik_per_frame: Some(loglik_per_frame(data, r)),
    };
    let lengths = column_lengths(&evidence, found);
    let inside = |chosen: &[usize]| in_sample(&evidence, found, chosen);
    let bare = inside(&[]).unwrap_or_else(|| before.clone());
    let with = inside(chosen).unwrap_or_else(|| plain.clone());
    let described = unattributed.variance_fraction.unwrap_or(0.0);
    let described = unattributed.present.then_some(described);
    let [left, alone] = unexplained(data, [&bare, &with], described);
    let to_explain = ToExplain {
        left,
        alone,
        length: &|column, _| lengths[column],
    };
    let mut considered = figures::considered(found, &to_explain, refused, &surroundings);
    if let Some(look) = look {
        look.tell(&mut considered);
    }
    let hypotheses = hypothesis::answer(
        situation.questions,
        &Grounds {
            found,
            surroundings: situation.surroundings(),
            to_explain: &to_explain,
            something_left: unattributed.present,
            noise_ratio: None,
            resolved: motion.resolved(),
            unusable: None,
            effects: &effects,
            considered: &considered,
        },
    );
    let outliers: Vec<bool> = (0..data.t_s.len())
        .map(|k| (0..3).any(|a| data.outlier[a][k]))
        .collect();
    let count = outliers.iter().filter(|o| **o).count();
    let report = Report {
        format: telemetry::report::REPORT_FORMAT.to_owned(),
        verdict: figures::verdict(&effects, unattributed.present),
        folds: folds.count,
        rows: Rows {
            used: data.t_s.len() - count,
            outliers: count,
            outside_reference: data.outside_reference,
        },
        windows: None,
        before: errors(&before),
        after: errors(&after),
        effects,
        considered,
        hypotheses,
        unattributed,
    };
    let [bx, by, bz]: [Vec<f64>; 3] = before.axes.try_into().unwrap_or_default();
    let [ax, ay, az]: [Vec<f64>; 3] = after.axes.try_into().unwrap_or_default();
    Ok(Closed {
        report,
        model,
        stars: None,
        attitude: Some(AttitudeResiduals {
            t_s: data.t_s.clone(),
            before_arcsec: [bx, by, bz],
            after_arcsec: [ax, ay, az],
            fold: folds.column(),
            outlier: outliers,
        }),
        dark_map: None,
        rivals,
    })
}
