//! The search of attitudes, and another one with what the first leaves.
//!
//! Not physics: the order of the steps.

use std::sync::Arc;

use block_regression::Folds;
use coloured_noise::Coloured;
use effects::{Candidate, Scene};
use focal_plane::AttitudeSeries;

use crate::attitude::data::AttitudeData;
use crate::attitude::fitted::{evidence, in_sample, residuals, tracks};
use crate::attitude::mixing::Mixing;
use crate::attitude::motion_terms;
use crate::attitude::noise::{fit_noise, fit_whole_noise};
use crate::attitude::search::{self, Declared};
use crate::attitude::steadied::steadied;
use crate::bins;
use crate::causes::SMEAR;
use crate::error::CloseError;
use crate::evidence::Residuals;
use crate::motion::{self, Around};
use crate::outcome::Rival;
use crate::residual_size;
use crate::search::Found;
use crate::search::catalogue;
use crate::search::empirical::{Empirical, Variable, range};
use crate::search::orbits;
use crate::search::refusal::Refused;
use crate::situation::{Situation, channels_of_interest};
use crate::unexplained::leftover::{self, Series};

/// Share of runs in which chance makes a line as likely as the least that is worth a search with it: that holds it
/// against more of the noise, pays for all frequencies, and costs little.
const LIKELY: f64 = 0.5;
/// Most bins of a search with a fast line; one that needs more is described.
const FINEST: usize = 20_000;

/// What is looked for.
pub(super) struct Inquiry<'q> {
    pub(super) situation: &'q Situation<'q>,
    /// Of the rows, not of their means.
    pub(super) folds: &'q Folds,
    pub(super) scene: &'q Scene<'q>,
    /// What the declared model leaves.
    pub(super) before: &'q Residuals,
    pub(super) declared: Declared<'q>,
}

/// What a search ends with.
pub(super) struct Searched {
    pub(super) found: Found,
    pub(super) noise: [Coloured; 3],
    pub(super) refused: Refused,
    /// What is left in sample, where that is known.
    inside: Option<Residuals>,
    /// Its series.
    pub(super) series: Option<Series>,
}

impl Searched {
    /// Whether the acceleration is in it.
    pub(super) fn is_smeared(&self) -> bool {
        self.found.chosen().any(|c| c.id() == SMEAR)
    }
}

/// What a search leaves to another one.
struct PutForward {
    candidates: Vec<Arc<dyn Candidate>>,
    /// How many bins the line among them needs, where there are too few.
    bins: Option<usize>,
}

impl Inquiry<'_> {
    /// Searches the catalogue, what the leftover may follow, and what was put forward.
    pub(super) fn search(
        &self,
        data: &AttitudeData,
        motion: &Around,
        put_forward: &[Arc<dyn Candidate>],
    ) -> Result<Searched, CloseError> {
        let situation = self.situation;
        let mut list = catalogue::candidates(self.scene);
        list.retain(|c| c.acts_on_attitude());
        list.extend(leftover_terms(situation, data));
        list.extend(motion_terms::terms(motion, &data.t_s));
        list.extend(put_forward.iter().cloned());
        let with_noise = |noise: [Coloured; 3]| evidence(data, situation, noise, motion);
        let (bins, start) = (&data.bins.folds, fit_noise(data, self.before));
        let (found, noise, refused) = search::search(
            &with_noise,
            data,
            bins,
            self.folds,
            list,
            self.declared,
            start,
        )?;
        let inside = in_sample(&with_noise(noise), &found, &found.selection.chosen);
        let series = inside
            .as_ref()
            .map(|inside| tracks(data, inside, self.declared.changes));
        Ok(Searched {
            found,
            noise,
            refused,
            inside,
            series,
        })
    }

    /// The motion along the reference less its slow error, where a smear was found along the path with it.
    pub(super) fn steadier(
        &self,
        data: &AttitudeData,
        reference: &AttitudeSeries,
        motion: &Around,
        searched: &Searched,
    ) -> Option<Around> {
        let noise = searched.noise;
        let inside = searched
            .inside
            .as_ref()
            .filter(|_| !motion.by_rates() && noise.iter().any(|n| n.slow > 0.0))
            .filter(|_| searched.is_smeared())?;
        let shared = data.mixing != Mixing::default();
        let whole = shared.then(|| fit_whole_noise(data, inside));
        let path = steadied(data, reference, inside, &whole.unwrap_or(noise))?;
        Some(motion::around(&path, &data.t_s, 1.0).without_error())
    }

    /// Another search with the line, the jump and the orbit that are left, if it names one of them.
    pub(super) fn again(
        &self,
        data: &mut AttitudeData,
        motion: &Around,
        searched: &Searched,
        progress: &dyn Fn(&str),
    ) -> Result<Option<Searched>, CloseError> {
        let PutForward { candidates, bins } = self.put_forward(data, motion, searched)?;
        if candidates.is_empty() {
            return Ok(None);
        }
        progress("searching again with the line, jump or orbit that is left");
        if let Some(bins) = bins {
            data.rebin(self.folds, bins);
        }
        let again = self.search(data, motion, &candidates)?;
        let channel = search::follows_a_channel;
        let rivals = self.sets_of(data, motion, &again, channel)?;
        let theirs = orbits::is_beaten(&again.found, &rivals, channel);
        // what was put forward in vain changes nothing
        if again.found.names_one_of_the_last(candidates.len()) && !theirs {
            return Ok(Some(again));
        }
        data.rebin(self.folds, bins::MOST);
        Ok(None)
    }

    fn put_forward(
        &self,
        data: &AttitudeData,
        motion: &Around,
        searched: &Searched,
    ) -> Result<PutForward, CloseError> {
        let series = searched.series.as_ref();
        let line = series.and_then(|s| s.shared_line(LIKELY));
        let fine = line.map_or(0, |line| data.bins_for(line.frequency_hz));
        let line = line.filter(|_| fine <= FINEST);
        let jump = series.and_then(Series::shared_jump);
        let mut candidates: Vec<_> = line
            .map(|line| line.candidate(self.scene))
            .into_iter()
            .collect();
        candidates.extend(jump.map(|jump| jump.candidate(self.scene)));
        let white = fit_noise(data, self.before).map(|n| Coloured {
            white: n.white.hypot(n.slow),
            slow: 0.0,
            ..n
        });
        let white = evidence(data, self.situation, white, motion);
        let (bins, surroundings) = (&data.bins.folds, &self.scene.surroundings);
        candidates.extend(orbits::propose(
            &white,
            bins,
            surroundings,
            &searched.found,
            None,
            false,
        )?);
        let too_fast = line.filter(|line| !data.bins.resolve(line.frequency_hz));
        Ok(PutForward {
            candidates,
            bins: too_fast.map(|_| fine.max(leftover::MOST_POINTS)),
        })
    }

    /// Other explanations of the same, those that follow a channel.
    pub(super) fn rivals(
        &self,
        data: &AttitudeData,
        motion: &Around,
        searched: &Searched,
    ) -> Result<Vec<Rival>, CloseError> {
        let found = &searched.found;
        let evidence = evidence(data, self.situation, searched.noise, motion);
        let mut rivals = Vec::new();
        for (set, gain) in self.sets_of(data, motion, searched, search::is_a_channel)? {
            let residual = residuals(&evidence, self.folds, found, &set)?;
            rivals.push(Rival {
                what: names(found, &set),
                rms_arcsec: (0..3)
                    .map(|a| {
                        residual_size::rms(&residual.axes[a], &data.outlier[a]).unwrap_or(f64::NAN)
                    })
                    .collect(),
                delta_loglik: gain,
            });
        }
        Ok(rivals)
    }

    /// Sets of candidates of which one `is_rival`, and their gains, nats.
    fn sets_of(
        &self,
        data: &AttitudeData,
        motion: &Around,
        searched: &Searched,
        is_rival: fn(&dyn Candidate) -> bool,
    ) -> Result<Vec<(Vec<usize>, f64)>, CloseError> {
        search::rivals(
            &|noise| evidence(data, self.situation, noise, motion),
            data,
            &data.bins.folds,
            &searched.found,
            self.declared,
            searched.noise,
            is_rival,
        )
    }
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
