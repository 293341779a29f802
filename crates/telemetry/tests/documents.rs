//! The examples of `docs/formats`, read as a user would read them.

mod common;

use common::repository;
use serde::{Serialize, de::DeserializeOwned};
use telemetry::report::{
    ASSESS_FORMAT, AssessReport, COMPARE_FORMAT, CompareReport, FIT_FORMAT, FitReport,
    REPORT_FORMAT, Report, Selector, WithSigma,
};
use telemetry::{Bundle, EffectValue, MemoryFiles, Model};

/// The fenced blocks of a page in a language.
fn blocks(page: &str, language: &str) -> Vec<String> {
    let path = repository("docs/formats").join(page);
    let text = std::fs::read_to_string(path).expect("the page is there");
    let fence = format!("```{language}\n");
    text.split(&fence)
        .skip(1)
        .map(|rest| rest.split("```").next().unwrap_or("").to_owned())
        .collect()
}

#[test]
fn the_bundle_of_the_page() {
    let mut files = MemoryFiles::new("page");
    let toml = blocks("bundle.md", "toml").remove(0);
    files.insert("bundle.toml", toml.into_bytes());
    let names = ["stars.csv", "images.csv", "catalog.csv", "housekeeping.csv"];
    let tables = blocks("bundle.md", "csv");
    assert_eq!(tables.len(), names.len());
    for (name, table) in names.into_iter().zip(tables) {
        files.insert(name, table.into_bytes());
    }
    let bundle = Bundle::read_from(&files).unwrap_or_else(|error| panic!("{error}"));
    let stars = bundle.stars.unwrap();
    assert_eq!((stars.frames(), stars.rows()), (3, 5));
    assert_eq!(stars.x_px[1].to_bits(), (-200.125_f64).to_bits());
    assert_eq!(bundle.extra["stars"][0].name, "quality");
    let images = bundle.images.unwrap();
    assert_eq!(
        (images.size, images.unread.as_slice()),
        ([3, 2], &[true, false, false, false, false, false][..])
    );
    assert_eq!(images.window(0), [0.0, 410.0, 55.0, 130.0, 395.0, 60.0]);
    assert!(bundle.catalog.unwrap().stars()[0].bv.is_nan());
    let housekeeping = bundle.housekeeping.unwrap();
    assert_eq!(
        housekeeping.channels.keys().collect::<Vec<_>>(),
        ["heater_on", "panel_c"]
    );
}

#[test]
fn the_model_of_the_page() {
    let text = blocks("model.md", "toml").remove(0);
    let model = Model::parse(&text, "page.toml", &[]).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(model.tracker.max_stars, Some(15));
    assert_eq!(model.noise.bias_arcsec, Some([0.0; 3]));
    assert_eq!(model.hem.map(|hem| hem.z.sigma_tn_arcsec), Some(52.0));
    let shutter = &model.effects[0];
    assert_eq!(
        shutter.parameters["line_time_s"],
        EffectValue::Number(30e-6)
    );
    let channel = &model.effects[1].parameters["channel"];
    assert_eq!(*channel, EffectValue::Text("panel_c".into()));
}

/// Reads an example and writes it again: no key is lost, none is added.
fn round<T: Serialize + DeserializeOwned>(text: &str) -> T {
    let read: T = serde_json::from_str(text).expect("the example is of the format");
    let example: serde_json::Value = serde_json::from_str(text).expect("JSON");
    assert_eq!(serde_json::to_value(&read).ok(), Some(example));
    read
}

#[test]
fn the_reports_of_the_page() {
    let examples = blocks("report.md", "json");
    let report: Report = round(&examples[0]);
    assert_eq!(report.format, REPORT_FORMAT);
    assert_eq!(
        report.effects[1].selectors["star_id"],
        Selector::Integer(113_963)
    );
    assert!(report.before.attitude_rms_arcsec.is_none());
    let fit: FitReport = round(&examples[1]);
    assert_eq!(fit.format, FIT_FORMAT);
    let unknown: WithSigma = round(&examples[2]);
    assert_eq!(
        (unknown.value, unknown.interval),
        (None, Some([Some(541.6), None]))
    );
    let compare: CompareReport = round(&examples[3]);
    assert_eq!(compare.format, COMPARE_FORMAT);
    assert_eq!(compare.model.axes.x.bands[3].error_db, None);
    let assess: AssessReport = round(&examples[4]);
    assert_eq!(assess.format, ASSESS_FORMAT);
}
