//! Model files: good ones go round, faulty ones are shown in their line.

mod common;

use common::repository;
use focal_plane::Camera;
use telemetry::{EffectEntry, EffectValue, Model, ModelKind, TrackerMeta};

const GOOD: &str = r#"format = "boresight-model/1"
kind = "pbm"

[tracker]
pixels = [1024, 1024]
fov_deg = [20.0, 20.0]
update_rate_hz = 10.0
max_stars = 15

[noise]
temporal_arcsec = 7.43
distortion_arcsec = 3.1667
distortion_order = 7

[[effect]]
id = "rolling_shutter"
line_time_s = 30e-6
"#;

#[track_caller]
fn check(from: &str, to: &str, parts: &[&str]) {
    assert!(GOOD.contains(from), "no {from:?}");
    let message = Model::parse(&GOOD.replacen(from, to, 1), "m.toml", &[])
        .expect_err("a faulty model")
        .to_string();
    for part in parts {
        assert!(message.contains(part), "no {part:?} in:\n{message}");
    }
}

#[test]
fn a_model_goes_round() {
    let page = std::fs::read_to_string(repository("docs/formats/model.md")).unwrap();
    let text = page
        .split("```toml\n")
        .nth(1)
        .unwrap()
        .split("```")
        .next()
        .unwrap();
    let mut model = Model::parse(text, "", &[]).unwrap();
    model.effects.push(EffectEntry::new(
        "empirical",
        [
            (
                "variable".to_owned(),
                EffectValue::Text("pixel_phase_x*\"y\"".into()),
            ),
            (
                "coefficients".to_owned(),
                EffectValue::Numbers(vec![1.0, -2.5e-7, 1.0 / 3.0]),
            ),
            ("star_id".to_owned(), EffectValue::Number(113_963.0)),
            ("at s".to_owned(), EffectValue::Number(1e18)),
        ]
        .into(),
    ));
    let again = Model::parse(&model.to_toml(), "", &[]).unwrap();
    assert_eq!(again, model);
    assert!(
        model.to_toml().contains("star_id = 113963\n"),
        "ids stay whole"
    );
    assert_eq!(
        Model::parse(&Model::default().to_toml(), "", &[]).unwrap(),
        Model::default()
    );
}

/// Not as a misspelt key whose nearest one has nothing to do with it.
#[test]
fn a_scenario_is_told_as_one() {
    let text = format!("{GOOD}[run]\nduration_s = 5.0\n[motion]\nkind = \"hold\"\n");
    let said = Model::parse(&text, "s.toml", &[]).unwrap_err().to_string();
    for part in ["s.toml, line 18", "a scenario", "[motion], [run]"] {
        assert!(said.contains(part), "no {part:?} in:\n{said}");
    }
    assert!(!said.contains("nearest"), "{said}");
    assert!(Model::parse(&text, "s.toml", &["motion", "run"]).is_ok());
}

#[test]
fn what_is_left_out_is_none() {
    let model = Model::parse("format = \"boresight-model/1\"\n", "m.toml", &[]).unwrap();
    assert_eq!(model.kind, ModelKind::Pbm);
    assert_eq!(
        (model.tracker.exposure_s, model.noise.bias_arcsec),
        (None, None)
    );
    assert_eq!(model.camera(), Ok(None));
}

/// What a model leaves out of its camera is the bundle's, key by key; what both make together is checked.
#[test]
fn the_camera_of_a_model_is_completed_by_the_bundle() {
    let head = "format = \"boresight-model/1\"\n[tracker]\n";
    let over = |text: &str| {
        let model = Model::parse(&format!("{head}{text}"), "m.toml", &[]).unwrap();
        model.camera_over(&TrackerMeta {
            pixels: Some([1024, 1024]),
            fov_deg: Some([20.0, 20.0]),
            ..TrackerMeta::default()
        })
    };
    let of_bundle = over("").unwrap().unwrap();
    assert_eq!(of_bundle.pixels(), [1024, 1024]);
    let centred = over("pixel_centre = 0.0\n").unwrap().unwrap();
    assert_eq!(centred, of_bundle.clone().with_pixel_centre(0.0).unwrap());
    // another focal length replaces a field of view
    let longer = over("focal_length_px = 3000.0\n").unwrap().unwrap();
    let own = Camera::from_focal_length_px([1024, 1024], 3000.0).unwrap();
    assert_eq!(longer, own);
    assert_ne!(of_bundle, own);
    assert!(over("fov_deg = [20.0, 10.0]\n").is_err());
    let lacking = Model::parse(head, "m.toml", &[]).unwrap();
    assert_eq!(lacking.camera_over(&TrackerMeta::default()), Ok(None));
    let nothing = format!("{head}fov_deg = [20.0, 0.0]\n");
    let said = Model::parse(&nothing, "m.toml", &[]).unwrap_err();
    assert!(said.to_string().contains("m.toml, line 3"), "{said}");
}

#[test]
fn tables_of_a_scenario_are_left_to_the_caller() {
    let text = format!("{GOOD}\n[motion]\nkind = \"slew\"\n\n[run]\nseed = 1\n");
    assert!(Model::parse(&text, "s.toml", &["motion", "sky", "run"]).is_ok());
    let error = Model::parse(&text, "s.toml", &["motion"])
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("s.toml, line 22") && error.contains("`run`"),
        "{error}"
    );
}

#[test]
fn unknown_keys_name_the_nearest() {
    check(
        "temporal_arcsec",
        "temporal_arcsecs",
        &[
            "m.toml, line 11, column 1",
            "[noise]",
            "`temporal_arcsec`",
            "11 | temporal_arcsecs = 7.43",
            "^^^^^^^^^^^^^^^^",
        ],
    );
    check(
        "[noise]",
        "[nose]",
        &["m.toml, line 10", "`nose`", "`noise`"],
    );
    check(
        "max_stars",
        "temporal_arcsec",
        &["line 8", "`temporal_arcsec`", "it belongs in [noise]"],
    );
    check(
        "[[effect]]",
        "[[effects]]",
        &["line 15", "`effects`", "`effect`"],
    );
}

#[test]
fn values_are_judged() {
    check(
        "\"pbm\"",
        "\"pdm\"",
        &["m.toml, line 2", "`kind`", "\"pbm\", \"hem\"", "\"pdm\""],
    );
    check("\"pbm\"", "\"hem\"", &["m.toml, line 2", "[hem.x]"]);
    check(
        "max_stars = 15",
        "max_stars = 0",
        &["line 8", "`max_stars`", "found 0"],
    );
    check(
        "= 10.0",
        "= 0.0",
        &["line 7", "`update_rate_hz`", "above 0"],
    );
    check(
        "7.43",
        "-7.43",
        &["line 11", "`temporal_arcsec`", "not below 0", "-7.43"],
    );
    check(
        "distortion_order = 7",
        "distortion_order = 16",
        &["line 13", "0 to 15", "16"],
    );
    check(
        "distortion_order = 7",
        "distortion_order = 0",
        &["line 13", "above 0"],
    );
    check(
        "distortion_order = 7",
        "bias_arcsec = [0, -1, 0]",
        &["line 13", "`bias_arcsec`"],
    );
    check(
        "max_stars = 15",
        "focal_length_px = 2903.7",
        &["line 6", "both"],
    );
    check(
        "[20.0, 20.0]",
        "[20.0, 20.0, 20.0]",
        &["line 6", "`fov_deg`", "array of 2"],
    );
    check(
        "30e-6",
        "{ a = 1 }",
        &["line 17", "`line_time_s`", "a table"],
    );
    check(
        "id = \"rolling_shutter\"\n",
        "",
        &["line 15", "`id`", "found none"],
    );
    check("model/1", "bundle/1", &["line 1", "boresight-model/1"]);
    check(
        "format = \"boresight-model/1\"\n",
        "",
        &["line 1", "`format`"],
    );
    check("kind = \"pbm\"", "kind = pbm", &["line 2"]);
}

/// Only the effects catalogue knows its parameters: it can point to their place in the file.
#[test]
fn effects_remember_their_place() {
    let model = Model::parse(GOOD, "m.toml", &[]).unwrap();
    assert_eq!(model.effects[0].at.line("line_time_s"), 17);
    let error = model.effect_error(0, "line_time_s", "too long").to_string();
    assert!(
        error.contains("m.toml, line 17, column 15: too long"),
        "{error}"
    );
    assert!(error.contains("17 | line_time_s = 30e-6"), "{error}");
    let made = Model {
        effects: vec![EffectEntry::new("hot_pixel", [].into())],
        ..Model::default()
    };
    assert!(
        made.effect_error(0, "id", "unknown")
            .to_string()
            .contains("effect 1: unknown")
    );
}
