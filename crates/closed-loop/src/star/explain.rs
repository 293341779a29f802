//! From the declared model at its best to the report: one search of all that may explain the residual.
//!
//! ```text
//! images   centroids formed anew, and how well they do
//! ground   the search, and a second with what the first leaves
//! ```
//!
//! Not physics: the order of the steps.

use std::ops::ControlFlow;
use std::sync::Arc;

use block_regression::Folds;
use effects::{Candidate, Scene, StarFacts, WarmPixels};
use focal_plane::AttitudeSeries;
use spectra::robust::median_step;
use star_images::Formed;

use crate::causes::Named;
use crate::declared;
use crate::error::CloseError;
use crate::image_level::{self, ImageLevel};
use crate::motion::{self, Around, gyro::with_rates, source};
use crate::outcome::Closed;
use crate::search::{family, forms};
use crate::situation::Situation;
use crate::star::data::StarData;
use crate::star::evidence::StarEvidence;
use crate::star::finish::{Finish, finish};
use crate::star::landing::Elsewhere;
use crate::star::pointed::Pointed;
use crate::star::settling::Settled;
use crate::star::windows::AsMeasured;
use ground::{Findings, Ground};
use images::{anew, compared};

mod ground;
mod images;

/// Searches after which the light is taken to fall where what was found takes it.
pub(super) const LANDINGS: usize = 4;

/// What there is before anything is searched.
pub(super) struct Begun<'a> {
    pub(super) situation: &'a Situation<'a>,
    pub(super) phase: &'a declared::OnCentroids,
    pub(super) folds: &'a Folds,
    pub(super) settled: &'a Settled,
    pub(super) known: &'a Known<'a>,
}

/// What searches before know.
#[derive(Clone, Default)]
pub(super) struct Known<'a> {
    /// Whether there are rows without windows beside these.
    pub(super) in_part: bool,
    /// Why the centroids of the table stay.
    pub(super) as_measured: Option<&'a AsMeasured>,
    /// The reference's motion without its slow error.
    pub(super) path: Option<AttitudeSeries>,
    /// What was chosen, in its polished form, and its place among the candidates.
    pub(super) forms: Vec<(usize, Arc<dyn Candidate>)>,
    /// What was chosen of what an earlier search left: the catalogue does not list it.
    pub(super) put_forward: Vec<Arc<dyn Candidate>>,
    /// How often the light may still be followed to where it falls.
    pub(super) landings: usize,
}

/// Puts polished `forms` in the place of the same candidates of `list`: another polish has little left to do, and beside a
/// slow error a step shows at its instant alone.
fn polished(list: &mut [Arc<dyn Candidate>], forms: &[(usize, Arc<dyn Candidate>)]) {
    let cause = |c: &dyn Candidate| (family(c), c.part(), c.nonlinear().len());
    for (g, form) in forms {
        let candidate = list.get_mut(*g);
        let same = candidate.filter(|c| cause(c.as_ref()) == cause(form.as_ref()));
        if let Some(candidate) = same {
            candidate.clone_from(form);
            forms::along(list, *g);
        }
    }
}

/// What a search ends with.
pub(super) enum Explained {
    Closed(Box<Closed>),
    /// The centroids of the table are to stay, as if there were no windows.
    AsMeasured(Box<AsMeasured>),
    /// What was found shifts the light to another pixel phase than the fits assumed.
    Elsewhere(Box<Elsewhere>),
    /// Something is left that follows the motion of a reference that errs slowly: its path without that error.
    Steadier(AttitudeSeries),
}

/// Explains the residual, or, while landings are left, says where the light falls.
pub(super) fn explain(
    data: &mut StarData,
    begun: &Begun<'_>,
    progress: &dyn Fn(&str),
) -> Result<Explained, CloseError> {
    let (situation, folds, known) = (begun.situation, begun.folds, begun.known);
    let around = flown(data, situation, known.path.as_ref());
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
        Some(formed) => Some(compared(clean, begun, motion, formed)?),
        None => None,
    };
    let adopts = image.as_ref().is_some_and(ImageLevel::adopts);
    if let Some(image) = image.take_if(|_| known.in_part && !adopts) {
        let why = AsMeasured::Compared(image);
        return Ok(Explained::AsMeasured(Box::new(why)));
    }
    let data = if adopts { clean } else { whole };
    let measured = StarEvidence::new(data, situation, vec![data.measured_residual()], motion);
    let (facts, warm) = pointed_at(data, motion, &measured, begun.settled);
    let scene = scene(situation, data, &facts, &warm);
    let own = image.as_ref().zip(formed.as_ref());
    let own = own.and_then(|(image, formed)| image.level(formed));
    let own = own.map(|(variants, zero_px)| anew(data, situation, motion, variants, &zero_px));
    let level = own.as_ref().unwrap_or(&measured);
    let ground = Ground::of(begun, level, motion, &scene)?;
    let mut explained = match ground.search(progress)? {
        ControlFlow::Continue(findings) => {
            let by_images = ByImages {
                measured: &measured,
                image: image.as_ref(),
                formed: formed.as_ref(),
            };
            conclude(&ground, findings, &by_images, progress)?
        }
        ControlFlow::Break(explained) => explained,
    };
    if let Explained::Elsewhere(elsewhere) = &mut explained {
        elsewhere.split(ground.listed().len());
    }
    Ok(explained)
}

/// The motion of the tracker: by its reference, or by `path`, or by its own stars.
fn flown(
    data: &StarData,
    situation: &Situation<'_>,
    path: Option<&AttitudeSeries>,
) -> Option<Around> {
    let own = match &situation.reference {
        Some(_) => None,
        None => data
            .own_motion()
            .map(|own| with_rates(own, situation.bundle.rates.as_ref())),
    };
    let known = path.or(situation.reference.as_ref()).or(own.as_ref());
    let arm = motion::roll_arm(&data.camera);
    let around =
        known.map(|series| motion::around(series, &data.frames.t_s, arm).turned(&data.turn()));
    match path {
        Some(_) => around.map(Around::without_error),
        None => around,
    }
}

/// What raw windows tell, beside the centroids of the table.
struct ByImages<'a> {
    measured: &'a StarEvidence<'a>,
    image: Option<&'a ImageLevel>,
    formed: Option<&'a Formed>,
}

/// From what was found to the report, or to where that takes the light.
fn conclude(
    ground: &Ground<'_, '_>,
    findings: Findings<'_>,
    by_images: &ByImages<'_>,
    progress: &dyn Fn(&str),
) -> Result<Explained, CloseError> {
    let Begun {
        situation,
        phase,
        folds,
        settled,
        known,
    } = *ground.begun;
    let data = ground.level.data;
    let Findings {
        named,
        inside,
        look,
    } = findings;
    let Named {
        mut searched,
        described,
        slow,
        oversize,
        refused,
        ..
    } = named;
    if situation.questions.empirical {
        ground.offer(&mut searched, &described)?;
    }
    let whole = Finish {
        situation,
        data,
        folds,
        measured: by_images.measured,
        level: searched.evidence.as_ref().unwrap_or(ground.level),
        found: &searched.found,
        described: &described,
        refused: &refused,
        slow,
        oversize,
        wander: searched.wander.as_ref(),
        only_errors_accelerate: searched.slow_error().is_some() && ground.only_errors_accelerate(),
        orbit: look,
        settled,
        image: match known.as_measured {
            Some(AsMeasured::Compared(image)) => Some(image),
            _ => by_images.image,
        },
        formed: by_images.formed,
        unusable: match known.as_measured {
            Some(AsMeasured::Unusable(why)) => Some(why),
            _ => None,
        },
    };
    let after = whole.residuals(&searched.found.selection.chosen)?;
    if known.landings > 0
        && by_images.formed.is_none()
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
