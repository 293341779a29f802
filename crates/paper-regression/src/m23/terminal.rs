//! Section 4.3: the thruster hold before the impact.
//!
//! The measured side is the preset `pitt`, flown several times, against a canted camera with the printed
//! uncertainty and a frame that bends with the heaters: neither is in the models.
//!
//! Source: \[M23\] Section 4.3, Figs. 15 to 17.

use rayon::prelude::*;
use spectra::Psd;

use super::bands::{Misfit, SEGMENT_S, TOLERANCE, spectra};
use crate::row::{Group, Row, Verdict, digits};
use crate::spectrum::{averaged, consistent, level, mean, raw};
use crate::trial::{Axes, Trial, field, hem, pbm, scenario};
use crate::{Inputs, PaperError};

const Y: usize = 1;
/// Below the line of the heaters, which the models lack by what the paper says.
const LOW: [f64; 2] = [1.0 / SEGMENT_S, 0.0045];
const MIDDLE: [f64; 2] = [0.01, 0.1];
const HIGH: [f64; 2] = [0.1, 5.0];
const BANDS: [[f64; 2]; 3] = [LOW, MIDDLE, HIGH];
/// Around the heaters' 0.0055 Hz, and around it but for them.
const HEATER: [f64; 2] = [0.0050, 0.0061];

pub(super) fn group(inputs: &Inputs) -> Result<Group, PaperError> {
    let pitt = scenario("pitt", inputs)?;
    let trials = (0..inputs.flights)
        .into_par_iter()
        .map(|draw| Trial::fly("pitt", &pitt, draw))
        .collect::<Result<Vec<_>, _>>()?;
    let trial = &trials[0];
    let rate = trial.rate_hz;
    let flights = trials
        .par_iter()
        .map(|trial| spectra(&trial.residual()?, rate))
        .collect::<Result<Vec<_>, _>>()?;
    let hold = Trial::fly("iht", &scenario("iht", inputs)?, 0)?;
    let fit = |axes: &Axes| -> Result<[[f64; 3]; 3], PaperError> {
        let [x, y, z] = axes;
        let one = |series: &[f64]| consistent(&raw(series, rate)?);
        Ok([one(x)?, one(y)?, one(z)?])
    };
    let tuned = hem(trial.camera(), fit(&hold.residual()?)?)?;
    let again = hem(trial.camera(), fit(&trial.residual()?)?)?;
    let ensemble = |make: &(dyn Fn(u64) -> Result<Axes, PaperError> + Sync)| {
        (0..inputs.draws)
            .into_par_iter()
            .map(|draw| spectra(&make(draw)?, rate))
            .collect::<Result<Vec<_>, PaperError>>()
    };
    let other = |draw| draw + 1000;
    let physical = ensemble(&|draw| trial.pbm(&pbm(trial.camera(), inputs, other(draw))?, draw))?;
    let tuned = ensemble(&|draw| {
        trial.hem(
            &tuned.clone().with_distortion(field(inputs, other(draw))?),
            draw,
        )
    })?;
    let again = ensemble(&|draw| {
        trial.hem(
            &again.clone().with_distortion(field(inputs, other(draw))?),
            draw,
        )
    })?;
    let misfit = |model: &[[Psd; 3]]| BANDS.map(|band| Misfit::of(model, &flights, Y, band));
    let bad = |m: [Misfit; 3]| m.into_iter().any(|m| m.under() || m.over());
    let worst = |m: [Misfit; 3]| m.into_iter().map(|m| m.db.abs()).fold(0.0, f64::max);
    let rms = |m: [Misfit; 3]| (m.into_iter().map(|m| m.db.powi(2)).sum::<f64>() / 3.0).sqrt();
    let (of_hold, refitted, physics) = (misfit(&tuned), misfit(&again), misfit(&physical));
    let under = format!(
        "y axis; {} draws against {} flights",
        inputs.draws, inputs.flights
    );
    let told = |m: [Misfit; 3]| {
        format!(
            "below 0.0045 Hz {}, 0.01 to 0.1 Hz {}, above {} dB",
            m[0], m[1], m[2]
        )
    };
    let row = |id: &str, paper: &str, m, tolerance: &str, verdict, expected| Row {
        id: id.into(),
        paper: paper.into(),
        ours: told(m),
        under: under.clone(),
        tolerance: tolerance.into(),
        verdict,
        expected,
    };
    let factor_of_two = |m| match (worst(m) < 3.0, rms(m) < 3.0 && worst(m) < worst(of_hold)) {
        (true, _) => Verdict::Reproduced,
        (false, true) => Verdict::Consistent,
        (false, false) => Verdict::Contradicts,
    };
    let within = "reproduced if every band is within 3 dB, a factor of two; consistent if their rms is, and the worst is \
                  better than tuned on the hold";
    let mut rows = vec![one_axis(trial)?];
    rows.push(row(
        "thruster hold, hybrid model tuned on the hold",
        "clearly inadequate",
        of_hold,
        &format!("some band off by {TOLERANCE}, and the worst by more than 3 dB"),
        if bad(of_hold) && worst(of_hold) > 3.0 {
            Verdict::Reproduced
        } else {
            Verdict::Contradicts
        },
        Verdict::Reproduced,
    ));
    rows.push(row(
        "thruster hold, refitted hybrid model",
        "fits quite well",
        refitted,
        within,
        factor_of_two(refitted),
        Verdict::Consistent,
    ));
    rows.push(row(
        "thruster hold, physics-based model, never refitted",
        "worked well as a medium-fidelity model",
        physics,
        within,
        factor_of_two(physics),
        Verdict::Reproduced,
    ));
    rows.push(heaters(&flights, &physical));
    Ok(Group {
        title: "[M23] 4.3, the thruster hold",
        about: "Measured side: flights of the preset `pitt` against a camera canted by 15° with the printed noise, white, \
                whose frame bends by 2″ per °C of a heater that cycles in 180 s: an assumption, and in no model."
            .into(),
        rows,
    })
}

/// Why only the y axis can be used: the reference's own noise there and elsewhere.
fn one_axis(trial: &Trial) -> Result<Row, PaperError> {
    let (residual, reference) = (trial.residual()?, trial.reference_error());
    let share = |axis: usize| -> Result<f64, PaperError> {
        let psd = |series: &[f64]| averaged(series, trial.rate_hz, SEGMENT_S);
        let all = [0.1, 5.0];
        Ok(level(&psd(&reference[axis])?, all) / level(&psd(&residual[axis])?, all))
    };
    let shares = [share(0)?, share(1)?, share(2)?];
    let yes = shares[0] > 0.5 && shares[2] > 0.5 && shares[1] < 0.5;
    Ok(Row {
        id: "y axis only".into(),
        paper: "the camera's 3σ of (32, 1.5, 120)″ is too large about X and Z, small about Y".into(),
        ours: format!(
            "the camera makes {:.0} %, {:.0} % and {:.0} % of the residual's density above 0.1 Hz",
            100.0 * shares[0],
            100.0 * shares[1],
            100.0 * shares[2]
        ),
        under: "camera noise white at the tracker's rate, an assumption: it is (10.7, 0.5, 40)″ 1σ in one frame".into(),
        tolerance: "half: beyond it the residual shows the camera rather than the tracker".into(),
        verdict: if yes { Verdict::Reproduced } else { Verdict::Contradicts },
        expected: Verdict::Reproduced,
    })
}

/// The line of the heaters: in the residual, not in the model.
fn heaters(flights: &[[Psd; 3]], physical: &[[Psd; 3]]) -> Row {
    let stands_out = |draws: &[[Psd; 3]]| {
        let all: Vec<Psd> = draws.iter().map(|psd| psd[Y].clone()).collect();
        let mean = mean(&all);
        let beside = 0.5 * (level(&mean, [0.0035, 0.0050]) + level(&mean, [0.0061, 0.0080]));
        level(&mean, HEATER) / beside
    };
    let (flown, model) = (stands_out(flights), stands_out(physical));
    Row {
        id: "heaters at 0.0055 Hz".into(),
        paper: "in the residual; the physics-based model is insensitive to it".into(),
        ours: format!(
            "density there over that beside it: residual {}, model {}",
            digits(flown),
            digits(model)
        ),
        under: "y axis; the swing of the bending is an assumption".into(),
        tolerance: "a factor of two: some 10 bins of the mean over the draws".into(),
        verdict: if flown > 2.0 && model < 2.0 {
            Verdict::Reproduced
        } else {
            Verdict::Contradicts
        },
        expected: Verdict::Reproduced,
    }
}
