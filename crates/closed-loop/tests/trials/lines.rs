//! Lines anywhere in the spectrum: far above the harmonics that the catalogue proposes, and between them.

use closed_loop::close;
use scenarios::{Scenario, simulate};
use telemetry::report::{Report, Verdict};

/// The report on a tracker at rest that swings by `effect`.
fn report(tables: &str, duration_s: f64, rate_hz: f64, seed: u64, effect: &str) -> Report {
    let text = format!(
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
    );
    let scenario = Scenario::parse(&text, "lines.toml").unwrap();
    let bundle = simulate(&scenario).unwrap();
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
}

const STARS: &str = "\"stars\", \"catalog\"";
const ATTITUDE: &str = "\"attitude\"";

/// Both axes of 8 stars of 7.43 arcsec in 600 frames: X and Y are known to 0.15 arcsec, so that amplitudes
/// of 1.5 arcsec are 10 sigma each, q = 200: 70 nats after all that a scan of 1200 frequencies costs.
/// 61.3 and 107.5 cycles lie beyond all harmonics.
#[test]
fn a_line_beyond_the_harmonics_is_named() {
    for (tables, seed, cycles) in [(STARS, 1, 61.3), (ATTITUDE, 2, 107.5), (STARS, 3, 140.0)] {
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
