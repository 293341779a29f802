//! The loop at star level: centroids against catalogue and reference, or against
//! themselves.
//!
//! Where raw windows are there, what is left is traced to the detector first:
//! centroids are formed anew with a dark map learned outside each fold, and the
//! rival explanation, a function of pixel phase, is tried on the same footing. Where some rows have no window,
//! that is done on the others, and on all rows without windows if it was in vain.
//!
//! Not physics: the order of the steps.

use std::sync::Arc;

use block_regression::Folds;
use effects::{Candidate, Scene, StarFacts, WarmPixels};
use focal_plane::{AttitudeSeries, Points, StarFrames};
use spectra::robust::median_step;
use star_images::{Formed, Unusable};

use crate::causes::description;
use crate::causes::{self, Named, Outcome, Quest};
use crate::declared;
use crate::error::CloseError;
use crate::figures;
use crate::image_level::{self, ImageLevel, Side};
use crate::motion::{self, Around, gyro::with_rates, source};
use crate::outcome::Closed;
use crate::search::catalogue;
use crate::search::orbits::{self, Look};
use crate::search::{family, forms};
use crate::situation::Situation;
use crate::star::data::{Inputs, Star, StarData};
use crate::star::evidence::StarEvidence;
use crate::star::finish::{Finish, finish};
use crate::star::landing::Elsewhere;
use crate::star::pointed::Pointed;
use crate::star::rows_left;
use crate::star::search::{Searched, Wander, in_vain};
use crate::star::settling::{Settled, settle};
use crate::star::steadied::steadied;
use crate::star::windows::{self, AsMeasured, Seen};
use crate::unexplained::leftover::{self, Series};

/// Fewest frames: every fold needs data to be predicted from.
const MIN_FRAMES: usize = 2;
/// How often rows that only the effects found make stand out are set aside.
const OUTLIER_ROUNDS: usize = 2;
/// Searches after which the light is taken to fall where what was found takes it.
const LANDINGS: usize = 4;

pub(crate) fn run(
    situation: &Situation<'_>,
    progress: &dyn Fn(&str),
) -> Result<Closed, CloseError> {
    let frames = situation
        .bundle
        .stars
        .as_ref()
        .ok_or(CloseError::NothingToCompare("no stars"))?;
    let Some(table) = situation.windows else {
        return as_measured(situation, frames, None, progress);
    };
    let seen = Seen::of(frames, table);
    let some = seen.some(frames);
    let known = Known {
        in_part: some.is_some(),
        ..Known::default()
    };
    let ended = match (seen.count.used, &some) {
        (0, _) => Ended::AsMeasured(Unusable::NoWindow.into()),
        (_, None) => on_rows(situation, frames, &known, progress)?,
        (_, Some(some)) => match on_rows(situation, some, &known, progress) {
            Err(error) => Ended::AsMeasured(windows::too_few(&error).ok_or(error)?),
            Ok(ended) => ended,
        },
    };
    let mut count = seen.count;
    let mut closed = match ended {
        Ended::Closed(closed) => {
            let unformed = closed.report.windows.as_ref();
            let unformed = unformed.map_or(0, |w| w.rows_left_out);
            count.rows_left_out = count.rows_without + unformed;
            *closed
        }
        Ended::AsMeasured(why) => {
            let situation = situation.without_windows();
            let closed = as_measured(&situation, frames, Some(&why), progress)?;
            if let AsMeasured::Unusable(why) = why {
                count.not_formed = Some(why);
            }
            closed
        }
    };
    closed.report.windows = Some(count);
    Ok(closed)
}

/// All rows with the centroids of the table, whatever windows there are.
fn as_measured(
    situation: &Situation<'_>,
    frames: &StarFrames,
    why: Option<&AsMeasured>,
    progress: &dyn Fn(&str),
) -> Result<Closed, CloseError> {
    let known = Known {
        as_measured: why,
        ..Known::default()
    };
    match on_rows(situation, frames, &known, progress)? {
        Ended::Closed(closed) => Ok(*closed),
        // only windows lead there
        Ended::AsMeasured(_) => Err(CloseError::NothingToCompare("no windows")),
    }
}

/// How a run on some rows ends.
enum Ended {
    Closed(Box<Closed>),
    /// No centroids formed anew are adopted, so that it has to be run without windows.
    AsMeasured(AsMeasured),
}

/// From these star rows to the report.
fn on_rows(
    situation: &Situation<'_>,
    frames: &StarFrames,
    known: &Known<'_>,
    progress: &dyn Fn(&str),
) -> Result<Ended, CloseError> {
    progress("joining stars, reference and catalogue");
    let phase = declared::OnCentroids::of(situation)?;
    let find = |id: i64| -> Option<Star> { situation.star(id) };
    let mut data = StarData::prepare(&Inputs {
        camera: &situation.camera,
        frames,
        reference: situation.reference.as_ref(),
        catalogue: situation
            .bundle
            .catalog
            .is_some()
            .then_some(&find as &dyn Fn(i64) -> Option<Star>),
        phase: &phase,
        effects: &declared::effects(situation)?,
    });
    if data.frames.frames() < MIN_FRAMES {
        return Err(CloseError::TooFewFrames {
            table: "stars",
            frames: data.frames.frames(),
            need: MIN_FRAMES,
            why: "the others lie outside the reference, or have no two stars to solve an attitude from",
        });
    }
    rows_left::check(&data, &declared::effects(situation)?, MIN_FRAMES)?;
    if let Some(windows) = situation.windows {
        data.see_windows(windows);
    }
    let unrelated = data.frames_are_unrelated();
    let folds = if unrelated {
        Folds::unrelated(data.frames.frames())
    } else {
        Folds::cut(data.frames.frames())
    };
    for _ in 0..OUTLIER_ROUNDS {
        let ended = trace(&mut data, situation, &phase, &folds, known, progress)?;
        let Ended::Closed(closed) = &ended else {
            return Ok(ended);
        };
        // a star mistaken for another hides in the residual of a lens that nobody calibrated
        let left = closed.stars.as_ref().filter(|_| unrelated);
        if left.is_none_or(|s| data.mark_outliers(&[&s.after_arcsec]) == 0) {
            return Ok(ended);
        }
    }
    trace(&mut data, situation, &phase, &folds, known, progress)
}

/// From the residual of the declared model to the report.
fn trace(
    data: &mut StarData,
    situation: &Situation<'_>,
    phase: &declared::OnCentroids,
    folds: &Folds,
    before: &Known<'_>,
    progress: &dyn Fn(&str),
) -> Result<Ended, CloseError> {
    progress("residuals of the declared model");
    data.lands_as_modelled();
    let mut settled = settle(data, situation, phase, folds)?;
    rows_left::check(data, &declared::effects(situation)?, MIN_FRAMES)?;
    let mut known = Known {
        landings: LANDINGS,
        ..before.clone()
    };
    loop {
        let Elsewhere { shifts, forms } =
            match explain(data, situation, phase, folds, &settled, &known, progress)? {
                Explained::Closed(closed) => return Ok(Ended::Closed(closed)),
                Explained::AsMeasured(why) => return Ok(Ended::AsMeasured(*why)),
                Explained::Steadier(path) => {
                    known.path = Some(path);
                    continue;
                }
                Explained::Elsewhere(elsewhere) => *elsewhere,
            };
        known.landings -= 1;
        known.forms = forms;
        // the declared model knows nothing of where the light falls
        settled
            .phase_error
            .get_or_insert_with(|| data.phase_error.clone());
        data.land(&shifts, phase, &declared::effects(situation)?);
    }
}

/// What searches before know.
#[derive(Clone, Default)]
struct Known<'a> {
    /// Whether there are rows without windows beside these.
    in_part: bool,
    /// Why the centroids of the table stay.
    as_measured: Option<&'a AsMeasured>,
    /// The reference's motion without its slow error.
    path: Option<AttitudeSeries>,
    /// What was chosen, in its polished form, and its place among the candidates.
    forms: Vec<(usize, Arc<dyn Candidate>)>,
    /// How often the light may still be followed to where it falls.
    landings: usize,
}

impl Known<'_> {
    /// Puts polished forms in the place of the same candidates of `list`: another polish has little left to do.
    fn polished(&self, list: &mut [Arc<dyn Candidate>]) {
        let cause = |c: &dyn Candidate| (family(c), c.part(), c.nonlinear().len());
        for (g, form) in &self.forms {
            let candidate = list.get_mut(*g);
            let same = candidate.filter(|c| cause(c.as_ref()) == cause(form.as_ref()));
            if let Some(candidate) = same {
                candidate.clone_from(form);
                forms::along(list, *g);
            }
        }
    }
}

/// What a search ends with.
enum Explained {
    Closed(Box<Closed>),
    /// The centroids of the table are to stay, as if there were no windows.
    AsMeasured(Box<AsMeasured>),
    /// What was found shifts the light to another pixel phase than the fits assumed.
    Elsewhere(Box<Elsewhere>),
    /// Something is left that follows the motion of a reference that errs slowly: its path without that error.
    Steadier(AttitudeSeries),
}

/// From the declared model at its best to the report, or, while landings are left, to where the light falls.
fn explain(
    data: &mut StarData,
    situation: &Situation<'_>,
    phase: &declared::OnCentroids,
    folds: &Folds,
    settled: &Settled,
    before: &Known<'_>,
    progress: &dyn Fn(&str),
) -> Result<Explained, CloseError> {
    let own = match &situation.reference {
        Some(_) => None,
        None => data
            .own_motion()
            .map(|own| with_rates(own, situation.bundle.rates.as_ref())),
    };
    let landings = before.landings;
    let path = before.path.as_ref();
    let known = path.or(situation.reference.as_ref()).or(own.as_ref());
    let arm = motion::roll_arm(&data.camera);
    let around =
        known.map(|series| motion::around(series, &data.frames.t_s, arm).turned(&data.turn()));
    let around = match path {
        Some(_) => around.map(Around::without_error),
        None => around,
    };
    let motion = around.as_ref();
    data.follow(source(motion));
    let whole = &*data;
    let formed = match situation.windows {
        Some(windows) => {
            progress("dark map from the raw windows");
            match image_level::form(whole, windows, folds) {
                Ok(formed) => Some(formed),
                Err(why) => return Ok(Explained::AsMeasured(Box::new(why.into()))),
            }
        }
        None => None,
    };
    let clean = formed.as_ref().and_then(|f| whole.formed_anew(&f.anew));
    let clean = clean.as_ref().unwrap_or(whole);
    progress("searching for causes");
    let mut image = match &formed {
        Some(formed) => Some(compared(clean, situation, motion, folds, settled, formed)?),
        None => None,
    };
    let adopts = image.as_ref().is_some_and(ImageLevel::adopts);
    if let Some(image) = image.take_if(|_| before.in_part && !adopts) {
        let why = AsMeasured::Compared(image);
        return Ok(Explained::AsMeasured(Box::new(why)));
    }
    let data = if adopts { clean } else { whole };
    let measured = StarEvidence::new(data, situation, vec![data.measured_residual()], motion);
    let (facts, warm) = pointed_at(data, motion, &measured, settled);
    let scene = scene(situation, data, &facts, &warm);
    let own = image.as_ref().zip(formed.as_ref());
    let own = own.and_then(|(image, formed)| image.level(formed));
    let own = own.map(|(variants, zero_px)| anew(data, situation, motion, variants, &zero_px));
    let level = own.as_ref().unwrap_or(&measured);
    let ways = description::ways(situation, data);
    let slow_reference = declared::reference(&declared::effects(situation)?);
    let reference = path.or(situation.reference.as_ref());
    let by_rates = motion.is_some_and(Around::by_rates);
    let accelerates = || by_rates || reference.is_none_or(|r| motion::accelerates(r, arm));
    let rms = figures::star_rms(&settled.before, data);
    let yields = description::could_yield(situation, data, rms);
    let named = |put_forward: &[Arc<dyn Candidate>], lands: bool| {
        let candidates = || {
            let mut list = catalogue::candidates(&scene);
            // With raw windows a warm pixel is the dark map's business.
            list.retain(|c| c.acts_on_stars() && !(formed.is_some() && c.id() == "hot_pixel"));
            before.polished(&mut list);
            list.extend(put_forward.iter().cloned());
            list
        };
        let quest = Quest {
            candidates: &candidates,
            terms: &|wander| {
                description::terms(situation, data, yields && (!wander || accelerates()))
            },
            ways: &ways,
            reference: slow_reference,
            surroundings: situation.surroundings(),
            lands: lands.then_some(phase),
            sight: (lands && landings == LANDINGS).then_some(phase),
        };
        causes::run(level, folds, &quest)
    };
    let left = |named: &mut Named<'_>| {
        let level = named.searched.evidence.as_ref().unwrap_or(level);
        let residual = named.inside.take()?;
        let series = Series::of(&leftover::star_tracks(data, &residual, &level.weight));
        Some((residual, series))
    };
    // but for the last time before anything is described
    let mut outcome = match named(&[], formed.is_none() && landings > 1)? {
        Outcome::Named(named) => *named,
        Outcome::Elsewhere(elsewhere) => return Ok(Explained::Elsewhere(elsewhere)),
    };
    let mut inside = left(&mut outcome);
    let line = inside
        .as_ref()
        .and_then(|(_, series)| series.shared_line(leftover::WORTH_A_SEARCH));
    // beside a reference that wanders a jump shows at its instant alone, which no grid has
    let jump = inside
        .as_ref()
        .filter(|_| scene.has_reference && outcome.searched.evidence.is_some())
        .and_then(|(_, series)| series.shared_jump());
    let mut put_forward: Vec<_> = line
        .map(|line| line.candidate(&scene))
        .into_iter()
        .collect();
    put_forward.extend(jump.map(|jump| jump.candidate(&scene)));
    let tracks = inside.as_ref().and_then(|(_, series)| series.across());
    let look = tracks.zip(level.motion).filter(|_| scene.has_reference);
    let look = look.and_then(|(tracks, path)| Look::at(&scene.surroundings, path, tracks));
    if scene.has_reference {
        put_forward.extend(orbit(level, folds, &scene, &outcome.searched, look)?);
    }
    if !put_forward.is_empty() && !in_vain(level, folds, &outcome.searched, &put_forward)? {
        progress("searching again with the line, jump or orbit that is left");
        // what was put forward in vain changes nothing
        if let Outcome::Named(mut again) = named(&put_forward, false)?
            && again
                .searched
                .found
                .names_one_of_the_last(put_forward.len())
        {
            inside = left(&mut again);
            outcome = *again;
        }
    }
    if let (None, false, Some(reference)) = (path, by_rates, reference)
        && let Some(noise) = outcome.searched.slow_error()
        && let Some((residual, _)) = &inside
        && outcome.follows_own_path()
    {
        let residual = [residual[0].as_slice(), &residual[1]];
        if let Some(path) = steadied(data, reference, noise, residual, &level.weight) {
            progress("searching again along the path less the reference's slow error");
            return Ok(Explained::Steadier(path));
        }
    }
    let Named {
        mut searched,
        described,
        inside: _,
        slow,
        oversize,
        refused,
    } = outcome;
    if situation.questions.empirical {
        description::offer(
            searched.evidence.as_ref().unwrap_or(level),
            folds,
            &mut searched.found,
            &described.follows(1.0),
            description::terms(situation, data, yields),
            &situation.surroundings(),
        )?;
    }
    let whole = Finish {
        situation,
        data,
        folds,
        measured: &measured,
        level: searched.evidence.as_ref().unwrap_or(level),
        found: &searched.found,
        described: &described,
        refused: &refused,
        slow,
        oversize,
        wander: searched.wander.as_ref(),
        orbit: look,
        settled,
        image: match before.as_measured {
            Some(AsMeasured::Compared(image)) => Some(image),
            _ => image.as_ref(),
        },
        formed: formed.as_ref(),
        unusable: match before.as_measured {
            Some(AsMeasured::Unusable(why)) => Some(why),
            _ => None,
        },
    };
    let after = whole.residuals(&searched.found.selection.chosen)?;
    if landings > 0
        && formed.is_none()
        && (searched.found.choice().moves_light() || data.lands_elsewhere(&after.modelled))
        && let Some(elsewhere) = Elsewhere::of(whole.level, folds, whole.found.choice(), phase)?
    {
        return Ok(Explained::Elsewhere(elsewhere));
    }
    progress("figures");
    let closed = finish(&whole, after, inside)?;
    // some hundred megabytes, which whoever writes the report need not wait for
    rayon::spawn(move || drop((described, searched.found)));
    Ok(Explained::Closed(Box::new(closed)))
}

/// Ways to form centroids anew beside those of the table.
fn compared(
    data: &StarData,
    situation: &Situation<'_>,
    motion: Option<&Around>,
    folds: &Folds,
    settled: &Settled,
    formed: &Formed,
) -> Result<ImageLevel, CloseError> {
    let measured = StarEvidence::new(data, situation, vec![data.measured_residual()], motion);
    let sides = [&formed.without_map, &formed.with_map].map(|c| {
        let anew = |variants| anew(data, situation, motion, variants, &c.zero_px);
        Side {
            moments: anew(&c.moments),
            plain: anew(&c.plain),
            unbiased: anew(&c.unbiased),
            fitted: anew(&c.fitted),
            gaussian: anew(&c.gaussian),
            followed: (!c.followed.is_empty()).then(|| anew(&c.followed)),
        }
    });
    let (facts, warm) = pointed_at(data, motion, &measured, settled);
    let mut others = catalogue::candidates(&scene(situation, data, &facts, &warm));
    others.retain(|c| c.acts_on_stars());
    let phase: Vec<_> = others
        .extract_if(.., |c| c.id() == "pixel_phase_harmonics")
        .collect();
    let beside = [phase.as_slice(), &others];
    image_level::compare(&measured, &sides, beside, folds, data)
}

/// Centroids formed anew as evidence; `zero_px` is 1 sigma of what is constant for each star, px.
fn anew<'a>(
    data: &'a StarData,
    situation: &Situation<'_>,
    motion: Option<&'a Around>,
    variants: &[[Vec<f64>; 2]],
    zero_px: &[[f64; 2]],
) -> StarEvidence<'a> {
    let residuals = variants
        .iter()
        .map(|c| data.residual_arcsec(Points { x: &c[0], y: &c[1] }))
        .collect();
    let evidence = StarEvidence::new(data, situation, residuals, motion);
    StarEvidence {
        nuisance: evidence.nuisance.with_zeros(data, zero_px),
        ..evidence
    }
}

/// Stars and pixels that the residual of the declared model points at.
fn pointed_at(
    data: &StarData,
    motion: Option<&Around>,
    measured: &StarEvidence<'_>,
    settled: &Settled,
) -> (Vec<StarFacts>, WarmPixels) {
    let pointed = Pointed::of(data, &settled.before, &measured.weight);
    let rows = data.rows(0..data.t_s.len(), source(motion), None);
    (pointed.stars(), pointed.pixels(&rows))
}

/// The orbit that turns the camera in place of what was found to, or beside what is left of that.
fn orbit(
    level: &StarEvidence<'_>,
    folds: &Folds,
    scene: &Scene<'_>,
    searched: &Searched<'_>,
    look: Option<Look>,
) -> Result<Option<Arc<dyn Candidate>>, CloseError> {
    let wander = searched.wander.as_ref();
    let slow = wander.map_or(0.0, Wander::nats);
    let turns = searched.found.chosen().any(|c| c.turns_camera());
    if wander.is_none() && !turns && !look.is_some_and(Look::follows) {
        return Ok(None);
    }
    orbits::propose(
        level,
        folds,
        &scene.surroundings,
        &searched.found,
        Some(slow),
    )
}

fn scene<'a>(
    situation: &'a Situation<'_>,
    data: &StarData,
    facts: &'a [StarFacts],
    warm: &'a WarmPixels,
) -> Scene<'a> {
    Scene {
        surroundings: situation.surroundings(),
        has_stars: true,
        has_catalogue: !data.free_directions,
        has_reference: !data.free_attitude,
        has_attitude: situation.bundle.attitude.is_some(),
        stars: facts,
        exposure_s: situation.exposure_s(),
        step_s: median_step(&data.frames.t_s).unwrap_or(f64::INFINITY),
        warm: Some(warm),
    }
}
