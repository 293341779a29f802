//! What the stars follow in the place of a slow error of the reference.
//!
//! Frames that turn with a variable make a slow error; so the description under white noise is held against the search
//! beside that error,
//!
//! ```text
//! worth - ln(parts tried) a term > L(beside the error) - ln n an axis + 4
//! L, and that in worth: log-likelihood out of fold of the measurements in arcsec
//! ```
//!
//! Where nothing else beats it the time may: frames that turn to and fro with its polynomials, or for a stretch of it that
//! was looked for ([`super::places`]). A slow error looks like that, so that it takes 5 nats more, and the error has to last
//! for a third of the run: then it is a drift by another name.
//!
//! Source: Schwarz 1978 for the price of a parameter.

use crate::causes::description::{Described, Part};
use crate::causes::places::stretch;
use crate::causes::stand_ins::{BY_FAR, describe_with};
use crate::causes::terms::turning;
use crate::search::empirical::{Empirical, range};
use crate::search::selection::columns_of;
use crate::star::data::StarData;
use crate::star::search::Wander;

/// Nats more by which a description by the time must beat a slow error, which looks like it.
const OF_TIME: f64 = 5.0;

/// Share of the span that a slow error lasts for if the time may take its place.
const LASTS: f64 = 1.0 / 3.0;

/// Terms by which frames turn with the time, which describe nothing else: a slow error of the reference does that, too.
/// None where `wander` is too short for that.
pub(super) fn terms(
    data: &StarData,
    wander: &Wander,
    inside: Option<&[Vec<f64>]>,
    weight: &[f64],
) -> Vec<Empirical> {
    let axes = wander.axes();
    let claimed = (0..3).filter(|&axis| axes[axis]);
    let tau_s = claimed.map(|axis| wander.noise.reference[axis].tau_s);
    let [from, to] = range(data.t_s.iter().copied());
    if tau_s.fold(0.0, f64::max) < LASTS * (to - from) {
        return Vec::new();
    }
    let stretch = inside.and_then(|inside| stretch(data, inside, weight));
    turning(data).into_iter().chain(stretch).collect()
}

/// What the stars follow, where that beats a slow error of the reference about `axes` axes: `coloured` is beside it,
/// `plain` under white noise, with [`terms`].
pub(super) fn in_place(coloured: &Described, plain: &Described, axes: usize) -> Option<Vec<Part>> {
    let set = columns_of(&coloured.fitted.groups, &coloured.chosen);
    let with = coloured.fitted.fits.out_of_fold(&set)?.total_loglik() + coloured.fitted.log_scale;
    // a size and a time each
    let paid = axes as f64 * plain.fitted.scalars.max(2.0).ln();
    let beside = columns_of(&plain.fitted.groups, &plain.chosen);
    let better = |worth: f64, parts: &[Part]| {
        let time = plain.is_of_time(parts);
        let by = if time { BY_FAR + OF_TIME } else { BY_FAR };
        let worth = worth + plain.fitted.log_scale - plain.looked() * parts.len() as f64;
        worth > with - paid + by
    };
    let turns = plain.terms.iter().any(|t| t.term.turns_frames());
    let ways: &[bool] = if turns { &[false, true] } else { &[false] };
    ways.iter().find_map(|&turned| {
        let may = |term: &Empirical| turned || !term.turns_frames();
        let (worth, parts) = describe_with(plain, &beside, &may)?;
        better(worth, &parts).then(|| plain.before_time(&parts))
    })
}
