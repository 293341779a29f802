//! Manoeuvres that the report recommends, flown in the simulation: they do what was promised.
#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use closed_loop::{Closed, Questions, close_asking};
use scenarios::{Scenario, simulate};
use telemetry::report::{Confusable, Manoeuvre};

const TRACKER: &str = r#"
format = "boresight-model/1"
kind = "pbm"
[tracker]
pixels = [1024, 1024]
fov_deg = [20.0, 20.0]
max_stars = 8
[noise]
temporal_arcsec = 7.43
centroid_arcsec = 5.06
distortion_arcsec = 3.1667
distortion_order = 7
[reference]
[sky]
kind = "hipparcos"
stars = 8
"#;

/// One slew about Y, 4 deg in 200 s: a time tag and a rolling shutter look alike. On the equator, with
/// Y to the north, it moves the boresight by as much in right ascension.
const SLEW: &str = "[motion]\nkind = \"slews\"\nstart = { ra_deg = 83.0, dec_deg = 0.0 }\n\
    [[motion.slew]]\naxis = [0.0, 1.0, 0.0]\nangle_deg = 4.0\nduration_s = 200.0\n";

/// There and back, twice: with a time tag the tracker lags its reference both ways.
const REPEATED: &str = "[motion]\nkind = \"slews\"\nstart = { ra_deg = 83.0, dec_deg = 0.0 }\nrepeat = 2\n\
    [[motion.slew]]\naxis = [0.0, 1.0, 0.0]\nangle_deg = 4.0\nduration_s = 50.0\n\
    [[motion.slew]]\naxis = [0.0, 1.0, 0.0]\nangle_deg = -4.0\nduration_s = 50.0\n";

/// The loop on a simulated run, asked about `other`.
fn run(motion: &str, effect: &str, duration_s: f64, draw: u64, other: &str) -> Closed {
    let text = format!(
        "{TRACKER}\n{motion}\n[run]\nduration_s = {duration_s}\nrate_hz = 2.0\nseed = 5\ndraw = {draw}\n{effect}\n"
    );
    let scenario = Scenario::parse(&text, "manoeuvre.toml").unwrap();
    let bundle = simulate(&scenario).unwrap();
    let questions = Questions::about([other]).unwrap();
    close_asking(
        &scenario.model_without_effects(),
        &bundle,
        &questions,
        &|_| (),
    )
    .unwrap()
}

/// What the first effect added, which is `id`, says of `other`.
fn rival(closed: &Closed, id: &str, other: &str) -> Confusable {
    let ids: Vec<&str> = closed
        .report
        .effects
        .iter()
        .map(|e| e.id.as_str())
        .collect();
    // beside it one run in a hundred names another
    assert_eq!(ids.first(), Some(&id), "the right effect first: {ids:?}");
    let all = &closed.report.effects[0].confusable_with;
    all.iter().find(|c| c.id == other).unwrap().clone()
}

/// The manoeuvre as `[motion]` of a scenario.
fn motion(m: &Manoeuvre, start: &str, repeat: u32) -> String {
    let axis = m.axis;
    let slew = |rate: f64, duration: f64| {
        let angle = rate * (duration - m.ramp_s);
        format!(
            "[[motion.slew]]\naxis = {axis:?}\nangle_deg = {angle:?}\nduration_s = {duration:?}\nramp_s = {:?}\n",
            m.ramp_s
        )
    };
    let legs = match m.kind.as_str() {
        "slew" => slew(m.rate_deg_s, m.duration_s),
        "to_and_fro" => {
            let half = 0.5 * m.duration_s;
            slew(m.rate_deg_s, half) + &slew(-m.rate_deg_s, half)
        }
        _ => {
            let drift = axis.map(|a| a * m.rate_deg_s * 3600.0);
            return format!(
                "[motion]\nkind = \"hold\"\nstart = {start}\ndrift_arcsec_s = {drift:?}\n"
            );
        }
    };
    format!("[motion]\nkind = \"slews\"\nstart = {start}\nrepeat = {repeat}\n{legs}")
}

/// An effect in a run that hardly tells it from another; the recommended manoeuvre, flown in `draws` runs
/// with the effect at the size that was found, finds it and misses the other by as many sigmas as
/// were promised.
///
/// Twice the log-likelihood by which the other alone falls short of the right one is chi-squared with
/// non-centrality n^2: its root scatters by 1 about n, and the mean of the draws by less. The gap is out of fold, where the declared unknowns (a distortion fitted to the other
/// folds) take up less of what the wrong effect misses: up to a fifth more than promised.
///
/// Flown `repeat` times in a row, the promise grows with the root of that. `base` is the run, `start` where its middle frame points: the manoeuvre was flown on paper under
/// the stars of that frame.
fn keeps_its_promise(
    [base, start]: [&str; 2],
    [id, parameter]: [&str; 2],
    value: f64,
    [repeat, draws]: [u32; 2],
    other: &str,
) {
    let effect = |value: f64| format!("[[effect]]\nid = \"{id}\"\n{parameter} = {value:e}\n");
    let first = run(base, &effect(value), 200.0, 0, other);
    let told = rival(&first, id, other);
    let manoeuvre = told.manoeuvre.unwrap();
    assert!(manoeuvre.sigma >= 5.0, "{}", manoeuvre.text);
    assert!(manoeuvre.text.contains(id) && manoeuvre.text.contains(other));
    let found = first.report.effects[0].parameters[parameter].value;
    let missed: Vec<f64> = (1..=u64::from(draws))
        .map(|draw| {
            let flown = run(
                &motion(&manoeuvre, start, repeat),
                &effect(found),
                f64::from(repeat) * manoeuvre.duration_s,
                draw,
                other,
            );
            let again = rival(&flown, id, other);
            let gap = flown.report.effects[0].delta_loglik - again.delta_loglik.unwrap();
            (2.0 * gap).max(0.0).sqrt()
        })
        .collect();
    let mean = missed.iter().sum::<f64>() / missed.len() as f64;
    let promised = manoeuvre.sigma * f64::from(repeat).sqrt();
    let scatter = 5.0 / f64::from(draws).sqrt();
    assert!(
        (promised - scatter..1.2 * promised + scatter).contains(&mean),
        "{}: flown, {missed:?}",
        manoeuvre.text
    );
}

#[test]
fn a_rolling_shutter_is_told_from_a_time_tag() {
    keeps_its_promise(
        [SLEW, "{ ra_deg = 85.0, dec_deg = 0.0 }"],
        ["rolling_shutter", "line_time_s"],
        40e-6,
        [4, 5],
        "time_tag_offset",
    );
}

#[test]
fn a_time_tag_is_told_from_a_rolling_shutter() {
    keeps_its_promise(
        [REPEATED, "{ ra_deg = 83.0, dec_deg = 0.0 }"],
        ["time_tag_offset", "offset_s"],
        10e-3,
        [4, 3],
        "rolling_shutter",
    );
}
