//! An effect with its numbers, and the kind it is of.
//!
//! Not physics: interfaces.

use std::collections::BTreeMap;

use star_tracker::Disturbance;

use crate::{Candidate, EffectError, Parameter, Parameters, Scene, Surroundings};

/// What an effect moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ActsOn {
    /// A raw image.
    pub images: bool,
    /// A star's centroid.
    pub stars: bool,
    /// The whole attitude.
    pub attitude: bool,
    /// The noise level.
    pub noise: bool,
}

/// Coloured error of the reference: per axis a stationary first-order Gauss-Markov process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceWander {
    /// Standard deviation, arcsec, tracker axes.
    pub sigma_arcsec: [f64; 3],
    /// Correlation time, s.
    pub tau_s: [f64; 3],
}

/// One effect with values: it acts forward as a [`Disturbance`] and can say what it is.
///
/// `build(id, parameters + selectors)` gives the same effect again.
pub trait Effect: Disturbance {
    /// Identity in the catalogue.
    fn id(&self) -> &'static str;
    /// Numbers, in the order of the documentation.
    fn parameters(&self) -> Vec<Parameter>;
    /// What is not a number to estimate: channel, star, signs.
    fn selectors(&self) -> BTreeMap<String, String> {
        BTreeMap::new()
    }
    /// Error of the reference rather than of the tracker.
    fn reference_wander(&self) -> Option<ReferenceWander> {
        None
    }
}

/// One row of the catalogue.
pub trait EffectKind: core::fmt::Debug + Sync {
    /// Identity, as in model files.
    fn id(&self) -> &'static str;
    /// One sentence.
    fn summary(&self) -> &'static str;
    /// What it moves.
    fn acts_on(&self) -> ActsOn;
    /// What a bundle has to hold before this effect can be looked for, as words that follow "it needs".
    fn needs(&self) -> &'static str;
    /// The effect with the given parameters.
    ///
    /// # Errors
    /// A name that does not exist (with the nearest that does), a missing or impossible value, a
    /// channel that is not there, or an effect that needs raw images.
    fn build(
        &self,
        parameters: &Parameters,
        surroundings: &Surroundings<'_>,
    ) -> Result<Box<dyn Effect>, EffectError>;
    /// Ways in which this effect could be in the data; empty when the data cannot show it.
    fn candidates(&self, scene: &Scene<'_>) -> Vec<Box<dyn Candidate>> {
        let _ = scene;
        Vec::new()
    }
}
