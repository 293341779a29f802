//! The loop at star level: centroids against catalogue and reference, or against
//! themselves.
//!
//! Where raw windows are there, what is left is traced to the detector first:
//! centroids are formed anew with a dark map learned outside each fold, and the
//! rival explanation, a function of pixel phase, is tried on the same footing. Where some rows have no window,
//! that is done on the others, and on all rows without windows if it was in vain.
//!
//! Not physics: the order of the steps.

use block_regression::Folds;
use focal_plane::StarFrames;
use star_images::Unusable;

use crate::declared;
use crate::error::CloseError;
use crate::outcome::Closed;
use crate::situation::Situation;
use crate::star::data::{Inputs, Star, StarData};
use crate::star::explain::{Begun, Explained, Known, LANDINGS, explain};
use crate::star::landing::Elsewhere;
use crate::star::rows_left;
use crate::star::settling::settle;
use crate::star::windows::{self, AsMeasured, Seen};

/// Fewest frames: every fold needs data to be predicted from.
const MIN_FRAMES: usize = 2;
/// How often rows that only the effects found make stand out are set aside.
const OUTLIER_ROUNDS: usize = 2;

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
        let begun = Begun {
            situation,
            phase,
            folds,
            settled: &settled,
            known: &known,
        };
        let elsewhere = match explain(data, &begun, progress)? {
            Explained::Closed(closed) => return Ok(Ended::Closed(closed)),
            Explained::AsMeasured(why) => return Ok(Ended::AsMeasured(*why)),
            Explained::Steadier(path) => {
                known.path = Some(path);
                continue;
            }
            Explained::Elsewhere(elsewhere) => *elsewhere,
        };
        let Elsewhere {
            shifts,
            forms,
            put_forward,
        } = elsewhere;
        known.landings -= 1;
        known.forms = forms;
        known.put_forward = put_forward;
        // the declared model knows nothing of where the light falls
        settled
            .phase_error
            .get_or_insert_with(|| data.phase_error.clone());
        data.land(&shifts, phase, &declared::effects(situation)?);
    }
}
