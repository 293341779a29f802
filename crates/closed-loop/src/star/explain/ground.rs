//! What is searched, and the search: once, and again with what the first leaves.
//!
//! Not physics: the order of the steps.

use std::cell::OnceCell;
use std::ops::ControlFlow;
use std::sync::Arc;

use coloured_noise::Foreknown;
use effects::{Candidate, Scene};

use crate::causes::changing_effect::Way;
use crate::causes::description::{self, Described};
use crate::causes::terms;
use crate::causes::{self, Inquiry, Named, Outcome};
use crate::declared;
use crate::error::CloseError;
use crate::motion::{self, Around};
use crate::residual_size;
use crate::search::catalogue;
use crate::search::orbits::{self, Look};
use crate::star::data::StarData;
use crate::star::evidence::StarEvidence;
use crate::star::explain::{Begun, Explained, LANDINGS, polished};
use crate::star::search::{Searched, Wander, in_vain};
use crate::star::steadied::steadied;
use crate::unexplained::leftover::{self, Series};
use focal_plane::AttitudeSeries;

/// What is searched.
pub(super) struct Ground<'g, 'a> {
    pub(super) begun: &'g Begun<'g>,
    pub(super) level: &'g StarEvidence<'a>,
    scene: &'g Scene<'g>,
    /// What effects may change with.
    ways: Vec<Way>,
    /// What the model declares of the reference's slow error.
    slow_reference: [Option<Foreknown>; 3],
    /// Whether the motion is by measured rates.
    by_rates: bool,
    /// Whether what yields to the acceleration could show.
    yields: bool,
}

/// What was found.
pub(super) struct Findings<'a> {
    pub(super) named: Named<'a>,
    /// What is left in sample, where that is known, arcsec, with its series.
    pub(super) inside: Inside,
    /// What was looked for without candidates.
    pub(super) look: Option<Look>,
}

type Inside = Option<(Vec<Vec<f64>>, Series)>;

impl<'g, 'a> Ground<'g, 'a> {
    pub(super) fn of(
        begun: &'g Begun<'g>,
        level: &'g StarEvidence<'a>,
        motion: Option<&Around>,
        scene: &'g Scene<'g>,
    ) -> Result<Self, CloseError> {
        let (situation, data) = (begun.situation, level.data);
        let rms = residual_size::star_rms(&begun.settled.before, data);
        Ok(Self {
            begun,
            level,
            scene,
            ways: terms::ways(situation, data),
            slow_reference: declared::reference(&declared::effects(situation)?),
            by_rates: motion.is_some_and(Around::by_rates),
            yields: terms::could_yield(situation, data, rms),
        })
    }

    /// The search, and another one with the line, the jump and the orbit that it leaves; breaks off where there is no report yet.
    pub(super) fn search(
        &self,
        progress: &dyn Fn(&str),
    ) -> Result<ControlFlow<Explained, Findings<'a>>, CloseError> {
        let known = self.begun.known;
        let formed = self.begun.situation.windows.is_some();
        // but for the last time before anything is described
        let lands = !formed && known.landings > 1;
        let (outcome, mut also) = self.first(lands)?;
        let mut outcome = match outcome {
            Outcome::Named(named) => *named,
            Outcome::Elsewhere(to) => return Ok(ControlFlow::Break(Explained::Elsewhere(to))),
        };
        let mut inside = self.left(&mut outcome);
        let series = inside.as_ref().map(|(_, series)| series);
        let look = self.look(series);
        let put_forward = self.put_forward(&outcome.searched, series, look)?;
        if !put_forward.is_empty() && !self.is_in_vain(&outcome, &put_forward)? {
            progress("searching again with the line, jump or orbit that is left");
            let first = self.listed().len() + also.len();
            let count = put_forward.len();
            also.extend(put_forward);
            // what was put forward in vain changes nothing
            let forms = outcome.searched.found.choice().forms();
            match self.named(&also, &forms, lands)? {
                Outcome::Named(mut again) => {
                    if again.searched.found.names_one_of_the_last(count) {
                        inside = self.left(&mut again);
                        outcome = *again;
                    }
                }
                Outcome::Elsewhere(to) => {
                    if to.forms.iter().any(|(g, _)| *g >= first) {
                        return Ok(ControlFlow::Break(Explained::Elsewhere(to)));
                    }
                }
            }
        }
        let residual = inside.as_ref().map(|(residual, _)| residual.as_slice());
        if let Some(path) = self.steadier(&outcome, residual) {
            progress("searching again along the path less the reference's slow error");
            return Ok(ControlFlow::Break(Explained::Steadier(path)));
        }
        Ok(ControlFlow::Continue(Findings {
            named: outcome,
            inside,
            look,
        }))
    }

    /// Whether a search with what is `put_forward` is needless. What is described in every fit hides more than it leaves.
    fn is_in_vain(
        &self,
        named: &Named<'_>,
        put_forward: &[Arc<dyn Candidate>],
    ) -> Result<bool, CloseError> {
        let (level, folds, searched) = (self.level, self.begun.folds, &named.searched);
        let found = &searched.found;
        match &searched.wander {
            Some(wander) => in_vain::beside_slow(level, folds, found, wander, put_forward),
            // one that the model declares, or that is too faint to be told, is in the evidence
            None if named.keeps || searched.evidence.is_some() => Ok(false),
            None => in_vain::without_slow(level, folds, found, put_forward),
        }
    }

    /// The first search: with what an earlier one put forward, if that is named again.
    fn first(&self, lands: bool) -> Result<(Outcome<'a>, Vec<Arc<dyn Candidate>>), CloseError> {
        let also = &self.begun.known.put_forward;
        if !also.is_empty() {
            let outcome = self.named(also, &[], lands)?;
            let again = match &outcome {
                Outcome::Named(named) => named.searched.found.names_one_of_the_last(also.len()),
                Outcome::Elsewhere(_) => true,
            };
            if again {
                return Ok((outcome, also.clone()));
            }
        }
        Ok((self.named(&[], &[], lands)?, Vec::new()))
    }

    /// Terms of what nobody listed, for the question what the leftover follows most.
    pub(super) fn offer(
        &self,
        searched: &mut Searched<'_>,
        described: &Described,
    ) -> Result<(), CloseError> {
        let situation = self.begun.situation;
        description::offer(
            searched.evidence.as_ref().unwrap_or(self.level),
            self.begun.folds,
            &mut searched.found,
            &described.follows(1.0),
            terms::terms(situation, self.data(), self.yields),
            &situation.surroundings(),
        )
    }

    fn data(&self) -> &'a StarData {
        self.level.data
    }

    /// What may be named of the catalogue.
    pub(super) fn listed(&self) -> Vec<Arc<dyn Candidate>> {
        let mut list = catalogue::candidates(self.scene);
        // With raw windows a warm pixel is the dark map's business.
        let formed = self.begun.situation.windows.is_some();
        list.retain(|c| c.acts_on_stars() && !(formed && c.id() == "hot_pixel"));
        polished(&mut list, &self.begun.known.forms);
        list
    }

    /// What may be named of the catalogue and of what was put forward, in the `forms` that a search before gave them;
    /// `lands`: whether the light is to be followed.
    fn named(
        &self,
        put_forward: &[Arc<dyn Candidate>],
        forms: &[(usize, Arc<dyn Candidate>)],
        lands: bool,
    ) -> Result<Outcome<'a>, CloseError> {
        let Begun {
            situation,
            phase,
            folds,
            known,
            ..
        } = *self.begun;
        let candidates = || {
            let mut list = self.listed();
            list.extend(put_forward.iter().cloned());
            polished(&mut list, forms);
            list
        };
        let accelerates = OnceCell::new();
        let inquiry = Inquiry {
            candidates: &candidates,
            terms: &|| terms::terms(situation, self.data(), self.yields),
            beside_slow: &|term| {
                !term.is_of_acceleration() || *accelerates.get_or_init(|| self.accelerates())
            },
            ways: &self.ways,
            reference: self.slow_reference,
            surroundings: situation.surroundings(),
            lands: lands.then_some(phase),
            sight: (lands && known.landings == LANDINGS).then_some(phase),
        };
        causes::run(self.level, folds, &inquiry)
    }

    /// The reference, or its path without its slow error.
    fn reference(&self) -> Option<&AttitudeSeries> {
        let path = self.begun.known.path.as_ref();
        path.or(self.begun.situation.reference.as_ref())
    }

    /// Whether the motion tells an acceleration beside a slow error of the reference.
    fn accelerates(&self) -> bool {
        let arm = motion::roll_arm(&self.data().camera);
        let reference = self.reference();
        self.by_rates || reference.is_none_or(|r| motion::accelerates(r, arm))
    }

    /// Whether all that accelerates is the error of the reference's own path.
    pub(super) fn only_errors_accelerate(&self) -> bool {
        let arm = motion::roll_arm(&self.data().camera);
        let reference = self.reference();
        !self.by_rates && reference.is_some_and(|r| motion::only_errs(r, arm))
    }

    /// What is left in sample beside what was `named`.
    fn left(&self, named: &mut Named<'_>) -> Inside {
        let level = named.searched.evidence.as_ref().unwrap_or(self.level);
        let residual = named.inside.take()?;
        let series = Series::of(&leftover::star_tracks(
            self.data(),
            &residual,
            &level.weight,
        ));
        Some((residual, series))
    }

    /// What the rotations that are left say of orbits.
    fn look(&self, series: Option<&Series>) -> Option<Look> {
        let tracks = series.and_then(Series::across);
        let look = tracks.zip(self.level.motion);
        let (tracks, path) = look.filter(|_| self.scene.has_reference)?;
        Look::at(&self.scene.surroundings, path, tracks)
    }

    /// The line, the jump and the orbit that are left.
    fn put_forward(
        &self,
        searched: &Searched<'_>,
        series: Option<&Series>,
        look: Option<Look>,
    ) -> Result<Vec<Arc<dyn Candidate>>, CloseError> {
        let line = series.and_then(|series| series.shared_line(leftover::WORTH_A_SEARCH));
        // beside a reference that wanders a jump shows at its instant alone, which no grid has
        let jump = series
            .filter(|_| self.scene.has_reference && searched.evidence.is_some())
            .and_then(Series::shared_jump);
        let mut put_forward: Vec<_> = line
            .map(|line| line.candidate(self.scene))
            .into_iter()
            .collect();
        put_forward.extend(jump.map(|jump| jump.candidate(self.scene)));
        if self.scene.has_reference || self.scales_tell() {
            put_forward.extend(self.orbit(searched, look)?);
        }
        Ok(put_forward)
    }

    /// Whether the scales of frames that turn freely tell the velocity along the boresight.
    fn scales_tell(&self) -> bool {
        self.scene.has_catalogue && !self.scene.has_reference
    }

    /// The orbit that turns the camera, or stretches what free frames see, in place of what was found to, or beside what is
    /// left of that.
    fn orbit(
        &self,
        searched: &Searched<'_>,
        look: Option<Look>,
    ) -> Result<Option<Arc<dyn Candidate>>, CloseError> {
        let wander = searched.wander.as_ref();
        let slow = wander.map_or(0.0, Wander::nats);
        let turns = searched.found.chosen().any(|c| c.turns_camera());
        let shows = turns || self.scales_tell() || look.is_some_and(Look::follows);
        if wander.is_none() && !shows {
            return Ok(None);
        }
        orbits::propose(
            self.level,
            self.begun.folds,
            &self.scene.surroundings,
            &searched.found,
            Some(slow),
            self.scales_tell(),
        )
    }

    /// The reference's path without its slow error, where something follows the path with it; `inside`: what is left in
    /// sample.
    fn steadier(&self, named: &Named<'_>, inside: Option<&[Vec<f64>]>) -> Option<AttitudeSeries> {
        let begun = self.begun;
        if begun.known.path.is_some() || self.by_rates {
            return None;
        }
        let reference = begun.situation.reference.as_ref()?;
        let noise = named.searched.slow_error()?;
        let inside = inside.filter(|_| named.follows_own_path())?;
        let residual = [inside[0].as_slice(), &inside[1]];
        steadied(self.data(), reference, noise, residual, &self.level.weight)
    }
}
