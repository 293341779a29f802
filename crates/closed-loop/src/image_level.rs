//! Which explanation of an image-level leftover the data supports.
//!
//! Centroids are formed anew as first moments, as first moments less what the
//! effective spot says that they are off by, as positions of that spot, and as
//! positions of the round Gaussian nearest to it, each
//! with and without a dark map; a function of pixel phase, the rival explanation,
//! is tried on all of them. Out of fold, block by block:
//!
//! - the map is claimed if the best account with it beats the best without it:
//!   anything else that the windows allow may stand in for it; or if it frees first moments of more than the spot
//!   and pixel phase do, and no account is the worse for it;
//! - the spot is claimed if first moments corrected by it beat first moments as they
//!   are. A function of pixel phase may do as well: but what the spot says is read off the pixels, not off the
//!   centroids that it corrects. That a fitted spot has less noise than a first moment is no effect: it corrects no
//!   error of the model.
//!
//! Once either is claimed centroids are formed anew, and then in the way that predicts
//! best: a fitted spot also feels what is left of a warm pixel less. What is constant for a star is then known as
//! well as the map is; with a spot of its own, a star has no zero at all.
//!
//! Not physics: the comparison.

use std::collections::BTreeMap;
use std::sync::Arc;

use block_regression::{Folds, OutOfFold};
use effects::Candidate;
use star_images::{Formed, Stars, Variants};
use statrs::distribution::{ContinuousCDF, StudentsT};
use telemetry::report::{Estimate, FoundEffect, Selector};
use telemetry::{EffectEntry, EffectValue, WindowTable};

use crate::error::CloseError;
use crate::evidence::Evidence;
use crate::figures;
use crate::outcome::Rival;
use crate::search::selection::{FAMILY_ALPHA, columns_of};
use crate::search::{Fitted, amplitudes, borrowed, fit};
use crate::star::data::StarData;
use crate::star::evidence::StarEvidence;

/// Id of the effect in the catalogue.
pub(crate) const DARK_MAP: &str = "dark_map";
/// Id of the effect in the catalogue.
pub(crate) const EFFECTIVE_PSF: &str = "effective_psf";
/// The file that an adopted map is written to.
const DARK_MAP_FILE: &str = "dark_map.csv";

/// Dark map, spots and centroids from the raw windows, where these belong to the stars and are enough.
pub(crate) fn form(data: &StarData, windows: &WindowTable, folds: &Folds) -> Option<Formed> {
    // With directions of its own every star's constant is free, and a distortion
    // fitted fold by fold would only add steps between the folds.
    let expected = if data.free_directions {
        &data.projected
    } else {
        &data.modelled
    };
    let stars = Stars {
        camera: &data.camera,
        frames: &data.frames,
        stars: data.stars.len(),
        star: &data.star,
        expected_px: expected.each_ref().map(Vec::as_slice),
    };
    star_images::form(&stars, windows, &folds.fold_of_frame())
}

/// Centroids formed with or without a map.
pub(crate) struct Side<'a> {
    pub(crate) moments: StarEvidence<'a>,
    pub(crate) plain: StarEvidence<'a>,
    pub(crate) unbiased: StarEvidence<'a>,
    pub(crate) fitted: StarEvidence<'a>,
    pub(crate) gaussian: StarEvidence<'a>,
    /// Where pixels switch.
    pub(crate) followed: Option<StarEvidence<'a>>,
}

/// 1 sigma of where the zero of a star's own spot is, px.
const OWN_ZERO_PX: f64 = 0.05;
/// Nats that a claim has to bring at least: pixels that are hardly off zero are no map.
const LEAST_GAIN: f64 = 6.0;

/// What one step from a level to the next brought.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    pub(crate) delta_loglik: f64,
    pub(crate) p_value: f64,
    /// Share of the before mean square, out of fold.
    pub(crate) explained: f64,
    pub(crate) stands: bool,
}

/// The outcome of the comparison.
#[derive(Clone, Debug)]
pub(crate) struct ImageLevel {
    pub(crate) rivals: Vec<Rival>,
    pub(crate) dark_map: Step,
    pub(crate) effective_psf: Step,
    /// How centroids are formed once there is a reason to.
    way: Way,
}

/// How centroids are formed anew.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    Moments,
    Unbiased,
    Fitted,
    Gaussian,
    Followed,
}

impl ImageLevel {
    /// The centroids that everything else is looked for in, and what is known of their zeros, px; `None`
    /// for those of the table.
    pub(crate) fn level<'a>(&self, formed: &'a Formed) -> Option<(&'a Variants, Vec<[f64; 2]>)> {
        let (map, spot) = (self.dark_map.stands, self.effective_psf.stands);
        if !map && !spot {
            return None;
        }
        let side = if map {
            &formed.with_map
        } else {
            &formed.without_map
        };
        let variants = match self.way {
            Way::Moments => &side.moments,
            Way::Unbiased => &side.unbiased,
            Way::Fitted => &side.fitted,
            Way::Gaussian => &side.gaussian,
            Way::Followed => &side.followed,
        };
        let own = if spot { OWN_ZERO_PX } else { 0.0 };
        let zero = |z: &[f64; 2]| z.map(|z| z.hypot(own));
        Some((variants, side.zero_px.iter().map(zero).collect()))
    }

    /// Whether the noise of the centroids is no longer that of the declared ones.
    pub(crate) fn new_noise(&self) -> bool {
        matches!(self.way, Way::Fitted | Way::Gaussian | Way::Followed)
            && (self.dark_map.stands || self.effective_psf.stands)
    }
}

/// A level out of fold, by itself and with the best function of pixel phase.
struct Scored {
    alone: Score,
    phase: Option<Score>,
}

impl Scored {
    fn best(&self) -> &Score {
        self.phase
            .as_ref()
            .filter(|p| p.total() > self.alone.total())
            .unwrap_or(&self.alone)
    }
}

/// Centroids formed with or without a map.
struct Scores {
    moments: Scored,
    plain: Scored,
    unbiased: Scored,
    fitted: Scored,
    gaussian: Scored,
}

/// The account that predicts best, pixel phase beside it or not.
fn best_of<'a, 'b>(
    accounts: &[(&'a Scored, &'a StarEvidence<'b>)],
) -> (&'a Scored, &'a StarEvidence<'b>) {
    let total = |account: &(&Scored, &StarEvidence<'_>)| account.0.best().total();
    let best = accounts.iter().copied();
    best.max_by(|a, b| total(a).total_cmp(&total(b)))
        .expect("there is an account")
}

/// Which predicts better by itself.
fn better_of<'a>(a: &'a Scored, b: &'a Scored) -> &'a Scored {
    if a.alone.total() > b.alone.total() {
        a
    } else {
        b
    }
}

/// Compares the measured centroids with those formed `[without, with]` a map.
pub(crate) fn compare(
    measured: &StarEvidence<'_>,
    sides: &[Side<'_>; 2],
    [phase, others]: [&[Arc<dyn Candidate>]; 2],
    folds: &Folds,
    data: &StarData,
) -> Result<ImageLevel, CloseError> {
    let mut rivals = Vec::new();
    let mut tell = |name: &str, evidence: &StarEvidence<'_>| {
        score(name, evidence, phase, folds, data, &mut rivals)
    };
    let table = measured;
    let measured = tell("declared model", table)?;
    let [bare, map] = sides;
    let bare = Scores {
        moments: tell("moments anew", &bare.moments)?,
        plain: tell("moments anew - level", &bare.plain)?,
        unbiased: tell("moments anew - spot", &bare.unbiased)?,
        fitted: tell("effective_psf", &bare.fitted)?,
        gaussian: tell("gaussian spot", &bare.gaussian)?,
    };
    let map = Scores {
        moments: tell("dark_map", &map.moments)?,
        plain: tell("dark_map - level", &map.plain)?,
        unbiased: tell("dark_map - spot", &map.unbiased)?,
        fitted: tell("dark_map + effective_psf", &map.fitted)?,
        gaussian: tell("dark_map + gaussian spot", &map.gaussian)?,
    };
    if let Some(followed) = &sides[1].followed {
        tell("dark_map, switching + effective_psf", followed)?;
    }
    // What only leads to a decision is not an account to be shown.
    rivals.retain(|r| !r.what.contains(" - "));
    let zero = rivals.first().map_or(0.0, |r| r.delta_loglik);
    for rival in &mut rivals {
        rival.delta_loglik -= zero;
    }
    let whole = measured.alone.sse.iter().sum::<f64>();
    let [plainly, mapped] = sides;
    let freed = (&map.moments, &mapped.moments);
    let with = best_of(&[
        freed,
        (&map.fitted, &mapped.fitted),
        (&map.gaussian, &mapped.gaussian),
    ]);
    let of_moments = [(&measured, table), (&bare.moments, &plainly.moments)];
    let without = best_of(
        &[
            &of_moments[..],
            &[
                (&bare.fitted, &plainly.fitted),
                (&bare.gaussian, &plainly.gaussian),
            ],
        ]
        .concat(),
    );
    let predicts = step(with.0.best(), without.0.best(), whole);
    // What the tracker sent are moments: pixels at the rim move them that no fitted spot feels.
    let unfreed = best_of(&[&of_moments[..], &[(&bare.unbiased, &plainly.unbiased)]].concat());
    let frees = step(freed.0.best(), unfreed.0.best(), whole);
    let harmless = with.0.best().total() > without.0.best().total() - LEAST_GAIN;
    let (mut claim, accounts) = if !predicts.stands && frees.stands && harmless {
        (frees, [freed.1, unfreed.1])
    } else {
        (predicts, [with.1, without.1])
    };
    if claim.stands {
        // what moves the stars otherwise may be what a map of nothing profits from
        let [with, without] = accounts.map(|evidence| beside_others(evidence, others, folds));
        claim.stands = step(&with?, &without?, whole).stands;
    }
    // Without a map, moments are those of the table or those formed anew.
    let better = |anew| better_of(anew, &measured);
    let (moments, plain, side) = if claim.stands {
        (&map.moments, &map.plain, &map)
    } else {
        let plain = better(&bare.plain);
        (plain, plain, &bare)
    };
    let corrected = step(&side.unbiased.alone, &plain.alone, whole);
    let spot_stands = corrected.stands;
    // the way to form centroids once there is a reason to
    let (way, last) = [
        (Way::Moments, moments),
        (Way::Unbiased, &side.unbiased),
        (Way::Fitted, &side.fitted),
        (Way::Gaussian, &side.gaussian),
    ]
    .into_iter()
    .filter(|(way, _)| match way {
        Way::Moments | Way::Gaussian => !spot_stands,
        Way::Unbiased => spot_stands,
        Way::Fitted | Way::Followed => true,
    })
    .max_by(|a, b| a.1.alone.total().total_cmp(&b.1.alone.total()))
    .unwrap_or((Way::Moments, moments));
    let by_map = match (claim.stands, spot_stands) {
        (true, false) => last,
        _ => &map.moments,
    };
    let mut dark_map = Step {
        stands: claim.stands,
        p_value: claim.p_value,
        ..step(&by_map.alone, &better(&bare.moments).alone, whole)
    };
    // What switches is the map's, whatever the way; a static map is claimed by itself first.
    let side = if claim.stands { &sides[1] } else { &sides[0] };
    let fixed = match way {
        Way::Moments => &side.moments,
        Way::Unbiased => &side.unbiased,
        Way::Fitted | Way::Followed => &side.fitted,
        Way::Gaussian => &side.gaussian,
    };
    let follows = match side.followed.as_ref().filter(|_| claim.stands) {
        Some(followed) => {
            let [with, without] =
                [followed, fixed].map(|evidence| beside_others(evidence, others, folds));
            Some(step(&with?, &without?, whole)).filter(|s| s.stands)
        }
        None => None,
    };
    if let Some(further) = &follows {
        dark_map.delta_loglik += further.delta_loglik;
        dark_map.explained += further.explained;
    }
    let effective_psf = Step {
        stands: spot_stands,
        p_value: corrected.p_value,
        ..step(&last.alone, &moments.alone, whole)
    };
    Ok(ImageLevel {
        rivals,
        dark_map,
        effective_psf,
        way: if follows.is_some() {
            Way::Followed
        } else {
            way
        },
    })
}

/// Squared error and log-likelihood of each block, out of fold.
#[derive(Clone, Debug)]
struct Score {
    sse: Vec<f64>,
    loglik: Vec<f64>,
}

impl Score {
    /// The noise of a fold is that of the *predictions* of the others: what was
    /// learned from windows follows their noise, and looks better on them than it is.
    fn new(error: &OutOfFold, folds: &Folds) -> Self {
        let of = &folds.fold_of_block;
        let loglik = (0..error.sse.len())
            .map(|b| {
                let others = || (0..error.sse.len()).filter(|&o| of[o] != of[b]);
                let scalars: f64 = others().map(|o| error.scalars[o]).sum();
                let variance = others().map(|o| error.sse[o]).sum::<f64>() / scalars.max(1.0);
                let variance = variance.max(f64::MIN_POSITIVE);
                -0.5 * (error.scalars[b] * (std::f64::consts::TAU * variance).ln()
                    + error.sse[b] / variance)
            })
            .collect();
        Self {
            sse: error.sse.clone(),
            loglik,
        }
    }

    fn total(&self) -> f64 {
        self.loglik.iter().sum()
    }
}

/// The score with some columns.
fn scored(fitted: &Fitted, set: &[usize], folds: &Folds) -> Option<Score> {
    let scored = fitted.fits.out_of_fold_by_block(set)?;
    Some(Score::new(&scored, folds))
}

/// The score with each candidate that is observable, and its number.
fn with_one(fitted: &Fitted, folds: &Folds) -> impl Iterator<Item = (usize, Score)> {
    let observable = (0..fitted.groups.len()).filter(|&g| !fitted.groups[g].columns.is_empty());
    observable.filter_map(move |g| {
        let set = columns_of(&fitted.groups, &[g]);
        Some((g, scored(fitted, &set, folds)?))
    })
}

/// A level by itself and with the best phase term.
fn score(
    name: &str,
    evidence: &StarEvidence<'_>,
    phase: &[Arc<dyn Candidate>],
    folds: &Folds,
    data: &StarData,
    rivals: &mut Vec<Rival>,
) -> Result<Scored, CloseError> {
    let fitted = fit(evidence, folds, &borrowed(phase))?;
    let alone = scored(&fitted, &[], folds).ok_or(CloseError::Singular)?;
    let best = with_one(&fitted, folds).max_by(|a, b| a.1.total().total_cmp(&b.1.total()));
    let columns = phase.iter().map(|c| c.coefficients().len()).sum();
    let mut tell = |what: String, set: &[usize], loglik: f64| -> Result<(), CloseError> {
        let amplitudes = amplitudes(&fitted, folds, set, columns).ok_or(CloseError::Singular)?;
        let residual = evidence.residuals(folds, &borrowed(phase), &amplitudes);
        rivals.push(Rival {
            what,
            rms_arcsec: figures::star_rms(&residual, data).to_vec(),
            delta_loglik: loglik,
        });
        Ok(())
    };
    tell(name.to_owned(), &[], alone.total())?;
    if let Some((g, score)) = &best {
        tell(
            format!("{name} + pixel_phase_harmonics"),
            &[*g],
            score.total(),
        )?;
    }
    Ok(Scored {
        alone,
        phase: best.map(|b| b.1),
    })
}

/// A level beside the effect of the catalogue that improves it most: what moves the stars may be far larger than
/// what a pixel that switches does.
fn beside_others(
    evidence: &StarEvidence<'_>,
    others: &[Arc<dyn Candidate>],
    folds: &Folds,
) -> Result<Score, CloseError> {
    let fitted = fit(evidence, folds, &borrowed(others))?;
    with_one(&fitted, folds)
        .map(|(_, score)| score)
        .chain(scored(&fitted, &[], folds))
        .max_by(|a, b| a.total().total_cmp(&b.total()))
        .ok_or(CloseError::Singular)
}

/// Gain of one score over another, block by block: its mean against its scatter
/// is honest however the errors within a block hang together.
fn step(with: &Score, without: &Score, whole: f64) -> Step {
    let gain: Vec<f64> = with
        .loglik
        .iter()
        .zip(&without.loglik)
        .map(|(a, b)| a - b)
        .collect();
    let total: f64 = gain.iter().sum();
    let p_value = one_sided(&gain);
    let sse = |s: &Score| s.sse.iter().sum::<f64>();
    Step {
        delta_loglik: total,
        p_value,
        explained: (sse(without) - sse(with)) / whole,
        stands: total > LEAST_GAIN && p_value < FAMILY_ALPHA,
    }
}

/// Chance of a mean this far above zero: Student's t over the blocks.
fn one_sided(gain: &[f64]) -> f64 {
    let n = gain.len() as f64;
    let mean = gain.iter().sum::<f64>() / n;
    let variance = gain.iter().map(|g| (g - mean).powi(2)).sum::<f64>() / (n - 1.0);
    if variance.is_nan() || variance <= 0.0 {
        return if mean > 0.0 { 0.0 } else { 1.0 };
    }
    StudentsT::new(0.0, 1.0, n - 1.0).map_or(1.0, |law| law.sf(mean / (variance / n).sqrt()))
}

/// The adopted steps as effects of the report and entries of the model.
pub(crate) fn effects(level: &ImageLevel, formed: &Formed) -> Vec<(FoundEffect, EffectEntry)> {
    let mut out = Vec::new();
    if level.dark_map.stands {
        let pixels = formed.map.pixels.len() as f64;
        let rms = formed.map.rms_dn();
        // The rms of n independent pixels is known to rms/sqrt(2 n).
        let mut numbers = vec![
            ("pixels", pixels, None, ""),
            (
                "rms_dn",
                rms,
                Some(rms / (2.0 * pixels.max(1.0)).sqrt()),
                "DN",
            ),
        ];
        if level.way == Way::Followed {
            let followed = formed.with_map.switching as f64;
            numbers.push(("followed", followed, None, ""));
        }
        out.push(entry(
            DARK_MAP,
            &level.dark_map,
            Some(DARK_MAP_FILE),
            &numbers,
        ));
    }
    if level.effective_psf.stands {
        let mut widths: Vec<f64> = formed.fwhm_px.clone();
        let fwhm = spectra::robust::median(&mut widths).unwrap_or(f64::NAN);
        let n = widths.len().max(1) as f64;
        let scatter = (widths.iter().map(|w| (w - fwhm).powi(2)).sum::<f64>() / n).sqrt();
        out.push(entry(
            EFFECTIVE_PSF,
            &level.effective_psf,
            None,
            &[("fwhm_px", fwhm, Some(scatter), "px")],
        ));
    }
    out
}

fn entry(
    id: &str,
    step: &Step,
    file: Option<&str>,
    numbers: &[(&str, f64, Option<f64>, &str)],
) -> (FoundEffect, EffectEntry) {
    let mut written: BTreeMap<String, EffectValue> = BTreeMap::new();
    let mut selectors = BTreeMap::new();
    if let Some(file) = file {
        written.insert("file".to_owned(), EffectValue::Text(file.to_owned()));
        selectors.insert("file".to_owned(), Selector::Text(file.to_owned()));
    }
    let mut parameters = BTreeMap::new();
    for &(name, value, sigma, unit) in numbers {
        written.insert(name.to_owned(), EffectValue::Number(value));
        parameters.insert(
            name.to_owned(),
            Estimate {
                value,
                sigma,
                unit: unit.to_owned(),
                interval: None,
            },
        );
    }
    let effect = FoundEffect {
        id: id.to_owned(),
        selectors,
        parameters,
        delta_loglik: step.delta_loglik,
        p_value: step.p_value,
        variance_explained: Some(step.explained),
        confusable_with: Vec::new(),
    };
    (effect, EffectEntry::new(id, written))
}
