//! What a model declares beside the catalogue: a leftover without a cause, offered, added as an empirical
//! term, and read again.
#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use std::collections::BTreeMap;

use closed_loop::{Closed, Questions, close_asking};
use focal_plane::{ARCSEC_PER_RAD, Series, rotation_from_vector};
use nalgebra::Vector3;
use scenarios::{Scenario, simulate};
use telemetry::report::Verdict;
use telemetry::{Bundle, Housekeeping, Model, WindowTable};

/// A tracker at rest, without any effect.
fn scenario(tables: &str) -> Scenario {
    let text = format!(
        r#"
format = "boresight-model/1"
kind = "pbm"
[tracker]
pixels = [1024, 1024]
fov_deg = [20.0, 20.0]
max_stars = 10
[noise]
temporal_arcsec = 7.43
[motion]
kind = "hold"
[sky]
kind = "generated"
[reference]
[run]
duration_s = 600.0
rate_hz = 1.0
tables = {tables}
"#
    );
    Scenario::parse(&text, "empirical.toml").unwrap()
}

/// The load of a wheel, which no effect of the catalogue may follow: it jumps between 10 and 20 at
/// times without a pattern, every ten seconds with a chance of one half.
fn load() -> Series {
    let mut state = 12_345_u64;
    let mut value = 10.0;
    let t_s: Vec<f64> = (0..=600).map(f64::from).collect();
    let values = (0..=600)
        .map(|k| {
            if k % 10 == 0 {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1);
                value = if state >> 63 == 0 { 10.0 } else { 20.0 };
            }
            value
        })
        .collect();
    Series::new(t_s, values).unwrap()
}

/// A bundle with that channel.
fn with_load(scenario: &Scenario) -> Bundle {
    let mut bundle = simulate(scenario).unwrap();
    let load = load();
    bundle.housekeeping = Some(Housekeeping {
        t_s: load.t_s().to_vec(),
        channels: BTreeMap::from([("wheel_load".to_owned(), load.value().to_vec())]),
    });
    bundle
}

fn run(model: &Model, bundle: &Bundle) -> Closed {
    let questions = Questions::default().adding_empirical(true);
    close_asking(model, bundle, &questions, &|_| ()).unwrap()
}

/// Found, added beside a verdict that it does not change, and gone once the written model is read.
/// `truth` is the coefficient's size for a load of 1.
fn comes_and_goes(
    scenario: &Scenario,
    bundle: &Bundle,
    variable: &str,
    coefficient: &str,
    truth: f64,
) {
    let closed = run(&scenario.model_without_effects(), bundle);
    let report = &closed.report;
    assert_eq!(report.verdict, Verdict::Unexplained);
    assert!(report.unattributed.present);
    assert_eq!(report.unattributed.depends_on[0].variable, variable);
    let ids: Vec<&str> = report.effects.iter().map(|e| e.id.as_str()).collect();
    assert_eq!(ids, ["empirical"]);
    let rms = |e: &telemetry::report::Errors| {
        let star = e.star_rms_arcsec.map(|v| v.iter().sum::<f64>());
        star.or_else(|| e.attitude_rms_arcsec.map(|v| v.iter().sum()))
            .unwrap()
    };
    assert!(rms(&report.after) < 0.97 * rms(&report.before));
    // the scale of the variable is that of the data: P_1 at the fit's middle and half range
    let parameters = &report.effects[0].parameters;
    let fitted = &parameters[coefficient];
    let half = parameters
        .get("by_half")
        .unwrap_or(&parameters["half"])
        .value;
    let slope = fitted.value / half;
    let sigma = fitted.sigma.unwrap() / half;
    assert!(
        (slope - truth).abs() < 5.0 * sigma,
        "{slope} +- {sigma}, {truth}"
    );
    // a text that a model file holds, read back
    let model = Model::parse(&closed.model.to_toml(), "model.toml", &[]).unwrap();
    let again = run(&model, bundle);
    assert_eq!(again.report.verdict, Verdict::Consistent);
    assert!((rms(&again.report.before) / rms(&report.after) - 1.0).abs() < 0.02);
}

/// The image is larger by 1.2 arcsec at the edge for each unit of load.
#[test]
fn a_term_of_the_stars() {
    let scenario = scenario("[\"stars\", \"catalog\"]");
    let mut bundle = with_load(&scenario);
    let (load, camera) = (load(), bundle.camera.clone().unwrap());
    let stars = bundle.stars.as_mut().unwrap();
    for k in 0..stars.frames() {
        let size = 1.2 * (load.at(stars.t_s[k]).unwrap() - 15.0);
        for row in stars.rows_of(k) {
            let half = camera.half_size_px();
            let scale = camera.arcsec_per_px();
            stars.x_px[row] *= 1.0 + size / scale[0] / half[0];
            stars.y_px[row] *= 1.0 + size / scale[1] / half[1];
        }
    }
    comes_and_goes(&scenario, &bundle, "housekeeping:wheel_load", "c3", 1.2);
}

/// The image is sheared: 1.5 arcsec along y at the edge in x for each unit of load beyond its mean in the run. About any
/// other load it is sheared all the time as well, and once the term is in the model that is an `optical_distortion`.
#[test]
fn a_term_of_two_variables() {
    let scenario = scenario("[\"stars\", \"catalog\"]");
    let mut bundle = with_load(&scenario);
    let (load, camera) = (load(), bundle.camera.clone().unwrap());
    let stars = bundle.stars.as_mut().unwrap();
    let [low, high] = stars
        .x_px
        .iter()
        .fold([0.0_f64; 2], |[l, h], &x| [l.min(x), h.max(x)]);
    let loads: Vec<f64> = stars
        .t_of_rows_s()
        .iter()
        .map(|t| load.at(*t).unwrap())
        .collect();
    let mean = loads.iter().sum::<f64>() / loads.len() as f64;
    for k in 0..stars.frames() {
        let size = 1.5 * (load.at(stars.t_s[k]).unwrap() - mean);
        for row in stars.rows_of(k) {
            // P_1 over the range of the stars
            let z = (2.0 * stars.x_px[row] - low - high) / (high - low);
            stars.y_px[row] += size * z / camera.arcsec_per_px()[1];
        }
    }
    let variable = "x_px*housekeeping:wheel_load";
    comes_and_goes(&scenario, &bundle, variable, "c1", 1.5);
}

/// The attitude turns about X by 0.6 arcsec for each unit of load.
#[test]
fn a_term_of_the_attitude() {
    let scenario = scenario("[\"attitude\"]");
    let mut bundle = with_load(&scenario);
    let load = load();
    let table = bundle.attitude.as_mut().unwrap();
    for (t, q) in table.t_s.iter().zip(&mut table.q) {
        let angle = 0.6 * load.at(*t).unwrap() / ARCSEC_PER_RAD;
        *q = rotation_from_vector(&(Vector3::x() * angle)) * *q;
    }
    comes_and_goes(&scenario, &bundle, "housekeeping:wheel_load", "c0", 0.6);
}

/// A dark map cannot be taken off windows yet: with windows the model is refused, without it is read.
#[test]
fn a_declared_map_is_not_passed_over() {
    let scenario = scenario("[\"stars\", \"catalog\"]");
    let mut bundle = simulate(&scenario).unwrap();
    let text = format!(
        "{}\n[[effect]]\nid = \"dark_map\"\ndark_map = \"dark_map.csv\"\n",
        scenario.model.to_toml()
    );
    let model = Model::parse(&text, "model.toml", &[]).unwrap();
    run(&model, &bundle);
    bundle.images = Some(WindowTable::default());
    let questions = Questions::default();
    let error = close_asking(&model, &bundle, &questions, &|_| ()).unwrap_err();
    let message = error.to_string();
    assert!(
        message.contains("`dark_map`") && message.contains("images"),
        "{message}"
    );
}
