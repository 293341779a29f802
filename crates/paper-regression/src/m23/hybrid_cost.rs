//! Section 3: what the hybrid model saves.
//!
//! ```text
//! per frame of M stars     physics-based   M triangles, 2 M normals        hybrid   0 triangles, 6 normals
//! ```
//!
//! Source: \[M23\] Section 3, "substantially reduces computational throughput".

use std::time::Instant;

use star_tracker::Pbm;

use crate::row::{Group, Row, Verdict, digits};
use crate::trial::{Trial, field, hem, pbm, scenario};
use crate::{Inputs, PaperError};

pub(super) fn group(inputs: &Inputs) -> Result<Group, PaperError> {
    let mut flown = scenario("iht", inputs)?;
    flown.run.duration_s = Some(1.0);
    let trial = Trial::fly("iht", &flown, 0)?;
    let stars = trial.stars();
    let plain = hem(trial.camera(), HOLD)?;
    let saved = !plain.needs_stars();
    let bent = plain.with_distortion(field(inputs, 0)?);
    let still_stars = bent.needs_stars();
    Ok(Group {
        title: "[M23] 3: what the hybrid model saves",
        about: "Counted, since times vary; `cargo xtask paper` prints the times that it measures."
            .into(),
        rows: vec![Row {
            id: "work per frame".into(),
            paper: "the hybrid model substantially reduces computation".into(),
            ours: format!(
                "{stars} stars: {stars} centroid errors and {} normals a frame become 0 and 6; with distortion the stars \
                 are projected, distorted and solved all the same",
                2 * stars
            ),
            under: "with distortion, as in Fig. 5; without it the model needs no stars at all"
                .into(),
            tolerance: "a count; how much time it saves depends on what else a frame costs".into(),
            verdict: if saved && still_stars {
                Verdict::Consistent
            } else {
                Verdict::Contradicts
            },
            expected: Verdict::Consistent,
        }],
    })
}

/// Processes of about the size of the hold.
const HOLD: [[f64; 3]; 3] = [[0.8, 150.0, 1.4], [0.8, 150.0, 1.4], [3.6, 161.0, 10.0]];

/// Seconds per million frames of the hold: physics-based, hybrid with distortion, hybrid without. Times
/// vary: for the person who asked, not for the page.
fn seconds_per_million_frames(inputs: &Inputs) -> Result<[f64; 3], PaperError> {
    let mut flown = scenario("iht", inputs)?;
    flown.run.duration_s = Some(2000.0);
    let trial = Trial::fly("iht", &flown, 0)?;
    let physical: Pbm = pbm(trial.camera(), inputs, 0)?;
    let plain = hem(trial.camera(), HOLD)?;
    let bent = plain.clone().with_distortion(field(inputs, 0)?);
    let million = 1e6 / trial.frames() as f64;
    let time = |run: &dyn Fn() -> Result<(), PaperError>| {
        // the best of five: what the machine does besides only adds
        let mut best = f64::INFINITY;
        for _ in 0..5 {
            let start = Instant::now();
            run()?;
            best = best.min(start.elapsed().as_secs_f64());
        }
        Ok::<f64, PaperError>(best * million)
    };
    Ok([
        time(&|| trial.pbm(&physical, 0).map(drop))?,
        time(&|| trial.hem(&bent, 0).map(drop))?,
        time(&|| trial.hem(&plain, 0).map(drop))?,
    ])
}

/// What the hybrid model saves in time, measured now: a sentence that differs from run to run.
///
/// # Errors
/// As [`groups`](super::groups).
pub fn saving(inputs: &Inputs) -> Result<String, PaperError> {
    let [physical, bent, plain] = seconds_per_million_frames(inputs)?;
    Ok(format!(
        "a million frames: physics-based {} s, hybrid {} s ({} times less), hybrid without distortion {} s ({} times less)",
        digits(physical),
        digits(bent),
        digits(physical / bent),
        digits(plain),
        digits(physical / plain)
    ))
}
