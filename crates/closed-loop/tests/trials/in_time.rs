//! Lines anywhere in the spectrum, far above the harmonics that the catalogue proposes and between them; steps
//! between the instants that it proposes; and slow errors that no effect explains.

#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use closed_loop::close;
use scenarios::{Scenario, simulate};
use telemetry::report::{Errors, Report, Verdict};

/// A tracker at rest on which `effect` acts.
fn text(tables: &str, duration_s: f64, rate_hz: f64, seed: u64, effect: &str) -> String {
    format!(
        r#"
format = "boresight-model/1"
kind = "pbm"
[tracker]
pixels = [1024, 1024]
fov_deg = [20.0, 20.0]
max_stars = 8
[noise]
temporal_arcsec = 7.43
{effect}
[motion]
kind = "hold"
[sky]
kind = "generated"
[reference]
[run]
duration_s = {duration_s:?}
rate_hz = {rate_hz:?}
seed = {seed}
tables = [{tables}]
"#
    )
}

fn scenario(tables: &str, duration_s: f64, rate_hz: f64, seed: u64, effect: &str) -> Scenario {
    Scenario::parse(
        &text(tables, duration_s, rate_hz, seed, effect),
        "in_time.toml",
    )
    .unwrap()
}

fn report(tables: &str, duration_s: f64, rate_hz: f64, seed: u64, effect: &str) -> Report {
    report_of(&scenario(tables, duration_s, rate_hz, seed, effect))
}

fn report_of(scenario: &Scenario) -> Report {
    let bundle = simulate(scenario).unwrap();
    let model = scenario.model_without_effects();
    close(&model, &bundle, &|_| ()).unwrap().report
}

/// A line of `size` arcsec on X and Y.
fn line(frequency_hz: f64, size: f64) -> String {
    format!(
        "[[effect]]\nid = \"periodic_misalignment\"\nfrequency_hz = {frequency_hz:?}\n\
         x_cos_arcsec = {size:?}\ny_sin_arcsec = {size:?}\n"
    )
}

/// The one effect is the line, its frequency within 5 sigma; nothing else is left.
fn assert_named(report: &Report, frequency_hz: f64) {
    assert_eq!(report.verdict, Verdict::Explained, "{frequency_hz}");
    let named: Vec<&str> = report.effects.iter().map(|e| e.id.as_str()).collect();
    assert_eq!(named, ["periodic_misalignment"], "{frequency_hz}");
    let f = &report.effects[0].parameters["frequency_hz"];
    let z = (f.value - frequency_hz) / f.sigma.unwrap();
    assert!(z.abs() < 5.0, "{frequency_hz}: {f:?}");
    assert!(report.unattributed.lines_hz.is_empty());
    // a heater without a channel makes the same
    let alike = &report.effects[0].confusable_with;
    let heater = alike.iter().any(|c| c.id == "thermal_misalignment");
    assert_eq!(heater, frequency_hz < 1.0 / 30.0, "{frequency_hz}");
}

const STARS: &str = "\"stars\", \"catalog\"";
const ATTITUDE: &str = "\"attitude\"";

/// Both axes of 8 stars of 7.43 arcsec in 600 frames: X and Y are known to 0.15 arcsec, so that amplitudes
/// of 1.5 arcsec are 10 sigma each, q = 200: 70 nats after all that a scan of 1200 frequencies costs.
/// 61.3 and 107.5 cycles lie beyond all harmonics.
#[test]
fn lines_at_any_frequency_are_named() {
    // the last is slow enough for a heater
    let cases = [
        (STARS, 1, 61.3),
        (ATTITUDE, 2, 107.5),
        (STARS, 3, 140.0),
        (STARS, 4, 6.3),
    ];
    for (tables, seed, cycles) in cases {
        let f = cycles / 300.0;
        assert_named(&report(tables, 300.0, 2.0, seed, &line(f, 1.5)), f);
    }
}

/// Attitudes are searched as means of at most 2400 points. Of 3500 at 5 Hz these are pairs, which pass
/// nothing above 1.25 Hz: at 1.6 Hz they keep 0.54 of an amplitude, and the search needs the rows themselves.
#[test]
fn a_line_that_means_would_hide_is_named() {
    // 0.044 arcsec an amplitude: 6.8 sigma each, or 3.7 in pairs, which a scan of 7000 does not let pass
    assert_named(&report(ATTITUDE, 700.0, 5.0, 4, &line(1.6, 0.3)), 1.6);
}

/// Seconds since an epoch seventeen years ago. At t = 0 nothing would be known of the line's phase; from the
/// middle of the run amplitudes have the sigma of theory, s sqrt(2/n) = 0.107 arcsec (s = 7.43/sqrt(2 * 8), n = 600),
/// and the model as it is written takes the line away.
#[test]
fn amplitudes_of_a_line_mean_something_far_from_the_epoch() {
    const LATE_S: f64 = 5.5e8;
    let scenario = scenario(ATTITUDE, 300.0, 2.0, 5, &line(0.0213, 1.5));
    let mut bundle = simulate(&scenario).unwrap();
    let attitude = bundle.attitude.as_mut().unwrap();
    attitude.t_s.iter_mut().for_each(|t| *t += LATE_S);
    let reference = bundle.reference.as_mut().unwrap();
    reference.t_s.iter_mut().for_each(|t| *t += LATE_S);
    let closed = close(&scenario.model_without_effects(), &bundle, &|_| ()).unwrap();
    assert_eq!(closed.report.effects.len(), 1);
    let found = &closed.report.effects[0].parameters;
    let from_s = found["from_s"].value;
    assert!((from_s - LATE_S - 149.75).abs() < 0.3, "{from_s}");
    let (sin, cos) = (std::f64::consts::TAU * 0.0213 * (from_s - LATE_S)).sin_cos();
    for (name, truth) in [
        ("x_cos_arcsec", 1.5 * cos),
        ("x_sin_arcsec", -1.5 * sin),
        ("y_cos_arcsec", 1.5 * sin),
        ("y_sin_arcsec", 1.5 * cos),
    ] {
        let (value, sigma) = (found[name].value, found[name].sigma.unwrap());
        assert!((0.08..0.16).contains(&sigma), "{name}: {sigma}");
        assert!(
            (value - truth).abs() < 5.0 * sigma,
            "{name}: {value} {truth}"
        );
    }
    let again = close(&closed.model, &bundle, &|_| ()).unwrap().report;
    assert_eq!(again.verdict, Verdict::Consistent);
    // what that leaves is what the fit left, but for what the other folds did not know: (1 + 6/480)^1/2
    let rms = |errors: &Errors| errors.attitude_rms_arcsec.unwrap();
    for (left, after) in rms(&again.before).iter().zip(rms(&closed.report.after)) {
        assert!((left / after - 1.0).abs() < 0.02, "{left} {after}");
    }
}

/// A step of 1.5 sigma of a frame on X and Y in 400 frames is 15 sigma on each, but the catalogue's instants are
/// 8 s apart, and 4 s on the wrong side leave slow noise that takes all of it. Found among what is left, its
/// instant is right to the frames that 15 sigma tell: 8 sigma^2 / step^2 of them is e^-1.
#[test]
fn a_step_between_the_instants_is_named() {
    for (seed, at_s) in [(1, 116.1), (2, 84.2), (3, 59.8)] {
        let step = format!(
            "[[effect]]\nid = \"step_misalignment\"\nat_s = {at_s:?}\nx_arcsec = -2.8\ny_arcsec = 2.8\n"
        );
        let report = report(ATTITUDE, 200.0, 2.0, seed, &step);
        let named: Vec<&str> = report.effects.iter().map(|e| e.id.as_str()).collect();
        assert_eq!(named, ["step_misalignment"], "{at_s}");
        assert_eq!(report.verdict, Verdict::Explained, "{at_s}");
        let at = report.effects[0].parameters["at_s"].value;
        assert!((at - at_s).abs() < 8.0, "{at} {at_s}");
    }
}

/// A reference that wanders by 0.3 of a frame's noise over 30 s, 600 frames: seen beyond doubt on X and Y (a wander of
/// w sigma over a step of n frames gains 1/4 ln(1 + 4 w^2 n) nats every n, and here n = 60), and a thousandth of all
/// squares, for the boresight errs by ten times as much. It is told as slow, and no effect is named.
#[test]
fn a_slow_error_is_told_beside_a_noisy_boresight() {
    for seed in 1..=3 {
        let wander = "wander_arcsec = [1.0, 1.0, 0.0]\nwander_tau_s = [30.0, 30.0, 30.0]";
        let quiet = scenario(ATTITUDE, 300.0, 2.0, seed, "");
        assert_eq!(report_of(&quiet).verdict, Verdict::Consistent, "{seed}");
        let text = text(ATTITUDE, 300.0, 2.0, seed, "")
            .replace("[reference]", &format!("[reference]\n{wander}"));
        let report = report_of(&Scenario::parse(&text, "slow.toml").unwrap());
        assert_eq!(report.verdict, Verdict::Unexplained, "{seed}");
        assert_eq!(report.unattributed.depends_on[0].variable, "time");
        assert!(report.unattributed.depends_on[0].variance_explained < 0.1);
    }
}
