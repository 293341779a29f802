//! Which accounts of the centroids are claimed, and how centroids are formed from then on.
//!
//! Not physics: the order of the questions.

use std::sync::Arc;

use block_regression::Folds;
use effects::Candidate;

use super::scores::{LEAST_GAIN, Scored, beside_others, best_of, better_of, score, step};
use super::{ImageLevel, Side, Step, Way};
use crate::error::CloseError;
use crate::outcome::Rival;
use crate::star::data::StarData;
use crate::star::evidence::StarEvidence;

/// Share of what a fitted spot gains that a correction of moments beside a map brings at least: of spots that are whole
/// it was 0.3 and 0.7 %, of those that are cut off 19 % and more.
const LEAST_SHARE: f64 = 0.05;

/// Centroids formed with or without a map.
struct Scores<'a> {
    moments: Scored<'a>,
    plain: Scored<'a>,
    unbiased: Scored<'a>,
    fitted: Scored<'a>,
    gaussian: Scored<'a>,
}

/// All accounts of the centroids.
struct Accounts<'a> {
    /// Those of the table.
    measured: Scored<'a>,
    bare: Scores<'a>,
    map: Scores<'a>,
    /// Where pixels switch.
    followed: Option<&'a StarEvidence<'a>>,
    /// Squared error of those of the table.
    whole: f64,
}

/// What is judged beside a claim: first moments as they are, those whose spot is known, and all that have its map or
/// none.
struct Standing<'s, 'a> {
    moments: &'s Scored<'a>,
    plain: &'s Scored<'a>,
    side: &'s Scores<'a>,
}

/// Compares the measured centroids with those formed `[without, with]` a map.
pub(crate) fn compare<'a>(
    measured: &'a StarEvidence<'a>,
    sides: &'a [Side<'a>; 2],
    [phase, others]: [&[Arc<dyn Candidate>]; 2],
    folds: &Folds,
    data: &StarData,
) -> Result<ImageLevel, CloseError> {
    let (accounts, rivals) = Accounts::of(measured, sides, phase, folds, data)?;
    // what steps from one level to another beside what else moves the stars
    let beside = |levels: [&StarEvidence<'_>; 2]| -> Result<Step, CloseError> {
        let [with, without] = levels.map(|level| beside_others(level, others, folds));
        Ok(step(&with?, &without?, accounts.whole))
    };
    let claim = accounts.claim(&beside)?;
    let standing = accounts.standing(claim.stands);
    let corrected = standing.corrected(claim.stands, accounts.whole);
    let (way, last) = standing.way(corrected.stands);
    let by_map = if claim.stands && !corrected.stands {
        last
    } else {
        &accounts.map.moments
    };
    let by_itself = accounts.by_itself(by_map);
    let mut dark_map = told(&claim, &by_itself);
    let effective_psf = if corrected.stands {
        // both together are what the last level gains
        let rest = step(&last.alone, &standing.moments.alone, accounts.whole);
        let not_told = if claim.stands {
            [
                by_itself.delta_loglik - dark_map.delta_loglik,
                by_itself.explained - dark_map.explained,
            ]
        } else {
            [0.0; 2]
        };
        Step {
            stands: true,
            p_value: corrected.p_value,
            delta_loglik: rest.delta_loglik + not_told[0],
            explained: rest.explained + not_told[1],
        }
    } else {
        corrected
    };
    // What switches is the map's, whatever the way; a static map is claimed by itself first.
    let follows = match accounts.followed.filter(|_| claim.stands) {
        Some(followed) => Some(beside([followed, last.evidence])?).filter(|s| s.stands),
        None => None,
    };
    if let Some(further) = &follows {
        dark_map.delta_loglik += further.delta_loglik;
        dark_map.explained += further.explained;
    }
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

/// What is told of a map: what does not stand is told with the gain that was judged; and so is a map in which centroids
/// formed anew as the tracker's are lose more than it brings.
fn told(claim: &Step, by_itself: &Step) -> Step {
    if claim.stands && by_itself.delta_loglik > 0.0 {
        Step {
            stands: true,
            p_value: claim.p_value,
            ..by_itself.clone()
        }
    } else {
        claim.clone()
    }
}

impl<'a> Accounts<'a> {
    /// All of them, and those that are shown as rivals.
    fn of(
        measured: &'a StarEvidence<'a>,
        sides: &'a [Side<'a>; 2],
        phase: &[Arc<dyn Candidate>],
        folds: &Folds,
        data: &StarData,
    ) -> Result<(Self, Vec<Rival>), CloseError> {
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
        let whole = measured.alone.squares();
        let accounts = Self {
            measured,
            bare,
            map,
            followed,
            whole,
        };
        Ok((accounts, rivals))
    }

    /// What speaks for a map.
    fn claim(
        &self,
        beside: &dyn Fn([&StarEvidence<'_>; 2]) -> Result<Step, CloseError>,
    ) -> Result<Step, CloseError> {
        let Self {
            measured,
            bare,
            map,
            whole,
            ..
        } = self;
        let with = best_of(&map.moments, &[&map.fitted, &map.gaussian]);
        let without = best_of(measured, &[&bare.moments, &bare.fitted, &bare.gaussian]);
        let predicts = step(with.best(), without.best(), *whole);
        // What the tracker sent are moments: pixels at the rim move them that no fitted spot feels.
        let unfreed = best_of(measured, &[&bare.moments, &bare.unbiased]);
        let frees = step(map.moments.best(), unfreed.best(), *whole);
        let harmless = with.best().total() > without.best().total() - LEAST_GAIN;
        let (claim, accounts) = if !predicts.stands && frees.stands && harmless {
            (frees, [&map.moments, unfreed])
        } else {
            (predicts, [with, without])
        };
        if !claim.stands {
            return Ok(claim);
        }
        // what moves the stars otherwise may be what a map of nothing profits from
        let beside_others = beside(accounts.map(|account| account.evidence))?;
        Ok(if beside_others.stands {
            claim
        } else {
            beside_others
        })
    }

    /// Without a map, moments are those of the table or those formed anew.
    fn better<'s>(&'s self, anew: &'s Scored<'a>) -> &'s Scored<'a> {
        better_of(anew, &self.measured)
    }

    fn standing(&self, map_claimed: bool) -> Standing<'_, 'a> {
        let (map, bare) = (&self.map, &self.bare);
        if map_claimed {
            Standing {
                moments: &map.moments,
                plain: &map.plain,
                side: map,
            }
        } else {
            let plain = self.better(&bare.plain);
            Standing {
                moments: plain,
                plain,
                side: bare,
            }
        }
    }

    /// What a map brings to first moments, or in the way in which centroids are formed with it.
    fn by_itself(&self, by_map: &Scored<'_>) -> Step {
        let without = self.better(&self.bare.moments);
        step(&by_map.alone, &without.alone, self.whole)
    }
}

impl<'s, 'a> Standing<'s, 'a> {
    /// What the spot says that moments are off by.
    fn corrected(&self, map_claimed: bool, whole: f64) -> Step {
        let (plain, side) = (self.plain, self.side);
        let mut corrected = step(&side.unbiased.alone, &plain.alone, whole);
        if map_claimed {
            // what is left of pixels at the rim moves moments, and a spot's wings take some of it
            let fit = side.fitted.alone.total() - plain.alone.total();
            corrected.stands &= corrected.delta_loglik > LEAST_SHARE * fit;
        }
        corrected
    }

    /// The way to form centroids once there is a reason to.
    fn way(&self, corrected: bool) -> (Way, &'s Scored<'a>) {
        let (moments, side) = (self.moments, self.side);
        [
            (Way::Moments, moments),
            (Way::Unbiased, &side.unbiased),
            (Way::Fitted, &side.fitted),
            (Way::Gaussian, &side.gaussian),
        ]
        .into_iter()
        .filter(|(way, _)| match way {
            Way::Moments | Way::Gaussian => !corrected,
            Way::Unbiased => corrected,
            Way::Fitted | Way::Followed => true,
        })
        .max_by(|a, b| a.1.alone.total().total_cmp(&b.1.alone.total()))
        .unwrap_or((Way::Moments, moments))
    }
}
