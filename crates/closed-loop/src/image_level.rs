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

use block_regression::Folds;
use star_images::{Formed, Stars, Unusable, Variants};
use telemetry::report::{Estimate, FoundEffect, Selector};
use telemetry::{EffectEntry, EffectValue, WindowTable};

use crate::outcome::Rival;
use crate::star::data::StarData;
use crate::star::evidence::StarEvidence;
pub(crate) use comparison::compare;

mod comparison;
mod scores;

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
