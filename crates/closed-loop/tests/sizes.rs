//! What is said of sizes: which would have shown, which are believed, and which would explain the residual.
#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use std::path::Path;

use closed_loop::{Questions, close_asking};
use scenarios::{Scenario, simulate};
use telemetry::report::{ConsideredEffect, Report, Verdict};
use telemetry::{Bundle, Model};

const ASKED: [&str; 3] = ["time_tag_offset", "exposure_smear", "rolling_shutter"];

/// A world that another program made, asked about these.
fn world(name: &str) -> Report {
    let worlds = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/oracles/worlds");
    let bundle = Bundle::read(&worlds.join(name)).unwrap();
    let model = Model::read(&worlds.join(name).join("model.toml")).unwrap();
    let questions = Questions::about(ASKED).unwrap();
    let closed = close_asking(&model, &bundle, &questions, &|_| ());
    closed.unwrap().report
}

fn considered<'a>(report: &'a Report, id: &str) -> &'a ConsideredEffect {
    report.considered.iter().find(|c| c.id == id).unwrap()
}

/// Where the verdict is that something is left, each answer says how large its effect would have to be, and the list
/// of what was not added says the same.
#[test]
fn what_the_verdict_announces_no_answer_denies() {
    for name in ["hk_nonlinear", "rate_squared"] {
        let report = world(name);
        assert_eq!(report.verdict, Verdict::Unexplained, "{name}");
        for asked in &report.hypotheses {
            let size = &asked.sizes[0];
            let needed = size.needed.unwrap();
            assert!(needed > 0.0, "{name} {}", asked.id);
            assert!(
                !asked.finding.contains("nothing is left"),
                "{name}: {}",
                asked.finding
            );
            let listed = considered(&report, &asked.id);
            assert_eq!(listed.parameter.as_ref(), Some(&size.parameter), "{name}");
            assert_eq!(listed.needed, Some(needed), "{name} {}", asked.id);
        }
    }
}

/// Where nothing is left nothing is needed, of any effect.
#[test]
fn nothing_is_needed_where_nothing_is_left() {
    for name in ["time_tag", "null_wrong_noise"] {
        let report = world(name);
        assert!(!report.unattributed.present, "{name}");
        assert!(
            report.considered.iter().all(|c| c.needed.is_none()),
            "{name}"
        );
        for asked in report.hypotheses.iter().filter(|h| !h.added) {
            assert!(asked.sizes.iter().all(|s| s.needed.is_none()), "{name}");
            assert!(
                asked.finding.contains("nothing is left"),
                "{name}: {}",
                asked.finding
            );
            assert_eq!(
                considered(&report, &asked.id).needed,
                None,
                "{name} {}",
                asked.id
            );
        }
    }
}

/// A time tag of 0.3 s that acts alone explains all by itself at what it is, within its error, and is believed
/// as the search believes it.
#[test]
fn an_effect_that_acts_alone_needs_its_own_size() {
    let text = r#"
format = "boresight-model/1"
kind = "pbm"
[tracker]
pixels = [1024, 1024]
fov_deg = [20.0, 20.0]
max_stars = 8
[noise]
temporal_arcsec = 7.43
[sky]
kind = "generated"
[reference]
[motion]
kind = "slews"
repeat = 2
[[motion.slew]]
axis = [0.0, 1.0, 0.0]
angle_deg = 2.0
duration_s = 100.0
[[motion.slew]]
axis = [1.0, 0.0, 0.0]
angle_deg = -2.0
duration_s = 100.0
[run]
duration_s = 400.0
rate_hz = 2.0
[[effect]]
id = "time_tag_offset"
offset_s = 0.3
"#;
    let scenario = Scenario::parse(text, "sizes.toml").unwrap();
    let bundle = simulate(&scenario).unwrap();
    let questions = Questions::about(ASKED).unwrap();
    let model = scenario.model_without_effects();
    let report = close_asking(&model, &bundle, &questions, &|_| ())
        .unwrap()
        .report;
    let asked = &report.hypotheses[0];
    assert!(asked.added && !report.unattributed.present);
    let size = &asked.sizes[0];
    let (needed, sigma) = (size.needed_alone.unwrap(), size.sigma.unwrap());
    assert!((needed - 0.3).abs() < 5.0 * sigma, "{needed} +- {sigma}");
    assert_eq!(size.needed_is_plausible, Some(true), "{}", asked.finding);
}

/// Sizes are those of the catalogue's parameters, on what they act on.
#[test]
fn sizes_are_told_as_parameters_of_the_catalogue() {
    let report = world("hk_nonlinear");
    let parameter = |id: &str| {
        let c = considered(&report, id);
        (c.parameter.as_deref().unwrap(), c.unit.as_deref().unwrap())
    };
    assert_eq!(parameter("exposure_smear"), ("exposure_s", "s"));
    assert_eq!(
        parameter("pixel_phase_harmonics")
            .0
            .split_once('_')
            .unwrap()
            .1,
        "amplitude_arcsec"
    );
    let heated = considered(&report, "thermal_misalignment");
    assert!(heated.selectors.contains_key("channel"), "{heated:?}");
    assert!(
        considered(&report, "catalogue_position")
            .selectors
            .contains_key("star_id")
    );
    // a slope of faint stars that are quieter makes no excess
    assert_eq!(considered(&report, "magnitude_noise").needed, None);
}

/// What only sizes beyond belief would show is not observable; what is says at which size.
#[test]
fn observable_is_what_a_believed_size_would_show() {
    let report = world("null_without_reference");
    for id in ["time_tag_offset", "exposure_smear"] {
        let c = considered(&report, id);
        assert!(!c.observable && c.detectable.is_none(), "{c:?}");
    }
    let asked = &report.hypotheses[0];
    assert!(
        asked.finding.starts_with("not observable"),
        "{}",
        asked.finding
    );
    for name in ["step", "null_without_reference"] {
        let report = world(name);
        let seen = report.considered.iter().filter(|c| c.observable);
        for c in seen.filter(|c| c.id != "velocity_aberration") {
            assert!(c.detectable.is_some_and(|d| d > 0.0), "{name}: {c:?}");
        }
    }
}
