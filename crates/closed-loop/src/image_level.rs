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
//!   error of the model. Beside a map, a correction that is next to nothing of what a fit gains is what the map leaves.
//!
//! Once either is claimed centroids are formed anew, and then in the way that predicts
//! best: a fitted spot also feels what is left of a warm pixel less. What is constant for a star is then known as
//! well as the map is; with a spot of its own, a star has no zero at all.
//!
//! Not physics: the comparison.

use std::collections::BTreeMap;
use std::sync::Arc;

use block_regression::{Folds, OutOfFold, beyond};
use effects::Candidate;
use star_images::{Formed, Stars, Unusable, Variants};
use statrs::distribution::StudentsT;
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
pub(crate) fn form(
    data: &StarData,
    windows: &WindowTable,
    folds: &Folds,
) -> Result<Formed, Unusable> {
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

/// Share of what a fitted spot gains that a correction of moments beside a map brings at least: of spots that are whole
/// it was 0.3 and 0.7 %, of those that are cut off 19 % and more.
const LEAST_SHARE: f64 = 0.05;

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
    /// Whether centroids formed anew are adopted.
    pub(crate) fn adopts(&self) -> bool {
        self.dark_map.stands || self.effective_psf.stands
    }

    /// The centroids that everything else is looked for in, and what is known of their zeros, px; `None`
    /// for those of the table.
    pub(crate) fn level<'a>(&self, formed: &'a Formed) -> Option<(&'a Variants, Vec<[f64; 2]>)> {
        if !self.adopts() {
            return None;
        }
        let (map, spot) = (self.dark_map.stands, self.effective_psf.stands);
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
        matches!(self.way, Way::Fitted | Way::Gaussian | Way::Followed) && self.adopts()
    }
}

/// A level out of fold, by itself and with the best function of pixel phase.
struct Scored<'a> {
    evidence: &'a StarEvidence<'a>,
    alone: Score,
    phase: Option<Score>,
}

impl Scored<'_> {
    fn best(&self) -> &Score {
        self.phase
            .as_ref()
            .filter(|p| p.total() > self.alone.total())
            .unwrap_or(&self.alone)
    }
}

/// Centroids formed with or without a map.
struct Scores<'a> {
    moments: Scored<'a>,
    plain: Scored<'a>,
    unbiased: Scored<'a>,
    fitted: Scored<'a>,
    gaussian: Scored<'a>,
}

/// The account that predicts best, pixel phase beside it or not; of two alike the latter.
fn best_of<'s, 'a>(first: &'s Scored<'a>, others: &[&'s Scored<'a>]) -> &'s Scored<'a> {
    others.iter().fold(first, |best, other| {
        if other.best().total() < best.best().total() {
            best
        } else {
            other
        }
    })
}

/// Which predicts better by itself.
fn better_of<'s, 'a>(a: &'s Scored<'a>, b: &'s Scored<'a>) -> &'s Scored<'a> {
    if a.alone.total() > b.alone.total() {
        a
    } else {
        b
    }
}

/// Compares the measured centroids with those formed `[without, with]` a map.
pub(crate) fn compare<'a>(
    measured: &'a StarEvidence<'a>,
    sides: &'a [Side<'a>; 2],
    [phase, others]: [&[Arc<dyn Candidate>]; 2],
    folds: &Folds,
    data: &StarData,
) -> Result<ImageLevel, CloseError> {
    let mut rivals = Vec::new();
    let mut account = |name: &str, evidence: &'a StarEvidence<'a>| {
        score(Some(name), evidence, phase, folds, data, &mut rivals)
    };
    let measured = account("declared model", measured)?;
    let mut scores = |side: &'a Side<'a>, [moments, fitted, gaussian]: [&str; 3]| {
        // what only leads to a decision is not an account to be shown
        let decides = |evidence| score(None, evidence, phase, folds, data, &mut Vec::new());
        Ok::<_, CloseError>(Scores {
            moments: account(moments, &side.moments)?,
            plain: decides(&side.plain)?,
            unbiased: decides(&side.unbiased)?,
            fitted: account(fitted, &side.fitted)?,
            gaussian: account(gaussian, &side.gaussian)?,
        })
    };
    let [bare, map] = sides;
    let followed = map.followed.as_ref();
    let bare = scores(bare, ["moments anew", "effective_psf", "gaussian spot"])?;
    let with_map = [
        "dark_map",
        "dark_map + effective_psf",
        "dark_map + gaussian spot",
    ];
    let map = scores(map, with_map)?;
    if let Some(followed) = followed {
        account("dark_map, switching + effective_psf", followed)?;
    }
    let zero = rivals.first().map_or(0.0, |r| r.delta_loglik);
    for rival in &mut rivals {
        rival.delta_loglik -= zero;
    }
    let whole = measured.alone.sse.iter().sum::<f64>();
    let with = best_of(&map.moments, &[&map.fitted, &map.gaussian]);
    let without = best_of(&measured, &[&bare.moments, &bare.fitted, &bare.gaussian]);
    let predicts = step(with.best(), without.best(), whole);
    // What the tracker sent are moments: pixels at the rim move them that no fitted spot feels.
    let unfreed = best_of(&measured, &[&bare.moments, &bare.unbiased]);
    let frees = step(map.moments.best(), unfreed.best(), whole);
    let harmless = with.best().total() > without.best().total() - LEAST_GAIN;
    let (mut claim, accounts) = if !predicts.stands && frees.stands && harmless {
        (frees, [&map.moments, unfreed])
    } else {
        (predicts, [with, without])
    };
    // what steps from one level to another beside what else moves the stars
    let beside = |levels: [&StarEvidence<'_>; 2]| -> Result<Step, CloseError> {
        let [with, without] = levels.map(|level| beside_others(level, others, folds));
        Ok(step(&with?, &without?, whole))
    };
    if claim.stands {
        // what moves the stars otherwise may be what a map of nothing profits from
        let beside_others = beside(accounts.map(|account| account.evidence))?;
        if !beside_others.stands {
            claim = beside_others;
        }
    }
    // Without a map, moments are those of the table or those formed anew.
    let better = |anew| better_of(anew, &measured);
    let (moments, plain, side) = if claim.stands {
        (&map.moments, &map.plain, &map)
    } else {
        let plain = better(&bare.plain);
        (plain, plain, &bare)
    };
    let mut corrected = step(&side.unbiased.alone, &plain.alone, whole);
    if claim.stands {
        // what is left of pixels at the rim moves moments, and a spot's wings take some of it
        let fit = side.fitted.alone.total() - plain.alone.total();
        corrected.stands &= corrected.delta_loglik > LEAST_SHARE * fit;
    }
    // the way to form centroids once there is a reason to
    let (way, last) = [
        (Way::Moments, moments),
        (Way::Unbiased, &side.unbiased),
        (Way::Fitted, &side.fitted),
        (Way::Gaussian, &side.gaussian),
    ]
    .into_iter()
    .filter(|(way, _)| match way {
        Way::Moments | Way::Gaussian => !corrected.stands,
        Way::Unbiased => corrected.stands,
        Way::Fitted | Way::Followed => true,
    })
    .max_by(|a, b| a.1.alone.total().total_cmp(&b.1.alone.total()))
    .unwrap_or((Way::Moments, moments));
    let by_map = if claim.stands && !corrected.stands {
        last
    } else {
        &map.moments
    };
    // What does not stand is told with the gain that was judged; and so is a map in which centroids formed anew as the
    // tracker's are lose more than it brings.
    let by_itself = step(&by_map.alone, &better(&bare.moments).alone, whole);
    let mut dark_map = if claim.stands && by_itself.delta_loglik > 0.0 {
        Step {
            stands: true,
            p_value: claim.p_value,
            ..by_itself.clone()
        }
    } else {
        claim.clone()
    };
    let not_told = if claim.stands {
        [
            by_itself.delta_loglik - dark_map.delta_loglik,
            by_itself.explained - dark_map.explained,
        ]
    } else {
        [0.0; 2]
    };
    // What switches is the map's, whatever the way; a static map is claimed by itself first.
    let follows = match followed.filter(|_| claim.stands) {
        Some(followed) => Some(beside([followed, last.evidence])?).filter(|s| s.stands),
        None => None,
    };
    if let Some(further) = &follows {
        dark_map.delta_loglik += further.delta_loglik;
        dark_map.explained += further.explained;
    }
    let effective_psf = if corrected.stands {
        // both together are what the last level gains
        let rest = step(&last.alone, &moments.alone, whole);
        Step {
            stands: true,
            p_value: corrected.p_value,
            delta_loglik: rest.delta_loglik + not_told[0],
            explained: rest.explained + not_told[1],
        }
    } else {
        corrected
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

/// A level by itself and with the best phase term, both among the `rivals` if it has a name.
fn score<'a>(
    name: Option<&str>,
    evidence: &'a StarEvidence<'a>,
    phase: &[Arc<dyn Candidate>],
    folds: &Folds,
    data: &StarData,
    rivals: &mut Vec<Rival>,
) -> Result<Scored<'a>, CloseError> {
    let fitted = fit(evidence, folds, &borrowed(phase))?;
    let alone = scored(&fitted, &[], folds).ok_or(CloseError::Singular)?;
    let best = with_one(&fitted, folds).max_by(|a, b| a.1.total().total_cmp(&b.1.total()));
    if let Some(name) = name {
        let columns = phase.iter().map(|c| c.coefficients().len()).sum();
        let mut tell = |what: String, set: &[usize], loglik: f64| -> Result<(), CloseError> {
            let amplitudes =
                amplitudes(&fitted, folds, set, columns).ok_or(CloseError::Singular)?;
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
    }
    Ok(Scored {
        evidence,
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
    StudentsT::new(0.0, 1.0, n - 1.0).map_or(1.0, |law| beyond(&law, mean / (variance / n).sqrt()))
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
