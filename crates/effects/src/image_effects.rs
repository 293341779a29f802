//! Effects on raw images: listed here, dealt with where the images are.
//!
//! A dark map is estimated from the windows, and an effective PSF from the spots in them; centroids are
//! then formed anew. Neither is a shift of given centroids, so there is nothing to build and there are
//! no candidates among stars and attitudes.
//!
//! Source: effects catalogue of this project, kind "I".

use crate::{ActsOn, Effect, EffectError, EffectKind, Parameters, Surroundings};

/// An effect on raw images.
#[derive(Debug)]
pub(crate) struct Kind {
    id: &'static str,
    summary: &'static str,
}

/// Warm pixels under the windows.
pub(crate) static DARK_MAP: Kind = Kind {
    id: "dark_map",
    summary: "warm pixels under the windows, estimated from the raw images in detector coordinates",
};

/// The spot is not what the centroid assumes.
pub(crate) static EFFECTIVE_PSF: Kind = Kind {
    id: "effective_psf",
    summary: "the spot is not what the centroid assumes: an effective PSF from the windows themselves",
};

impl EffectKind for Kind {
    fn id(&self) -> &'static str {
        self.id
    }
    fn summary(&self) -> &'static str {
        self.summary
    }
    fn needs(&self) -> &'static str {
        "stars and their raw windows (table images)"
    }
    fn acts_on(&self) -> ActsOn {
        ActsOn {
            images: true,
            ..ActsOn::default()
        }
    }
    fn build(&self, _: &Parameters, _: &Surroundings<'_>) -> Result<Box<dyn Effect>, EffectError> {
        Err(EffectError::ActsOnImages { effect: self.id })
    }
}
