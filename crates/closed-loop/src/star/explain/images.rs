//! Ways to form centroids anew beside those of the table.
//!
//! Not physics: which evidence is held against which.

use focal_plane::Points;
use star_images::Formed;

use crate::error::CloseError;
use crate::image_level::{self, ImageLevel, Side};
use crate::motion::Around;
use crate::search::catalogue;
use crate::situation::Situation;
use crate::star::data::StarData;
use crate::star::evidence::StarEvidence;
use crate::star::explain::{Begun, pointed_at, scene};

/// How well each does.
pub(super) fn compared(
    data: &StarData,
    begun: &Begun<'_>,
    motion: Option<&Around>,
    formed: &Formed,
) -> Result<ImageLevel, CloseError> {
    let situation = begun.situation;
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
    let (facts, warm) = pointed_at(data, motion, &measured, begun.settled);
    let mut others = catalogue::candidates(&scene(situation, data, &facts, &warm));
    others.retain(|c| c.acts_on_stars());
    let phase: Vec<_> = others
        .extract_if(.., |c| c.id() == "pixel_phase_harmonics")
        .collect();
    let beside = [phase.as_slice(), &others];
    image_level::compare(&measured, &sides, beside, begun.folds, data)
}

/// Centroids formed anew as evidence; `zero_px` is 1 sigma of what is constant for each star, px.
pub(super) fn anew<'a>(
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
