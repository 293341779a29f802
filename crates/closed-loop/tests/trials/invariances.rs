//! What must not change the finding.

use rayon::ThreadPoolBuilder;
use telemetry::{Bundle, Model, TableFormat};

use crate::kit::{Case, Path, closed};

/// A shutter that 12 stars and two minutes of slews show at some 10 sigma.
fn shutter() -> Case {
    let mut case = Case::new(Path::Slews, 3).with("rolling_shutter", "line_time_s = 30e-6");
    case.duration_s = 150.0;
    case
}

#[test]
fn threads_change_nothing() {
    let (model, bundle) = shutter().make();
    let with = |threads: usize| {
        let pool = ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| closed(&model, &bundle)).unwrap()
    };
    let (one, four) = (with(1), with(4));
    assert_eq!(one.report, four.report);
    assert_eq!(one.stars, four.stars);
    assert_eq!(one.model.to_toml(), four.model.to_toml());
}

/// Every double goes round bit for bit in either format.
#[test]
fn files_change_nothing() {
    let (model, bundle) = shutter().make();
    let direct = closed(&model, &bundle).unwrap();
    let folder = tempfile::tempdir().unwrap();
    for (name, format) in [("csv", TableFormat::Csv), ("parquet", TableFormat::Parquet)] {
        let at = folder.path().join(name);
        bundle.write(&at, format).unwrap();
        let read = closed(&model, &Bundle::read(&at).unwrap()).unwrap();
        assert_eq!(direct.report, read.report, "{name}");
    }
}

/// The model that comes out, written and read, knows of the shutter: on the same
/// bundle it leaves what the first run left. The declared effect acts through the
/// path, the fitted one through columns about the estimate: equal to 1 %.
#[test]
fn the_model_that_comes_out_is_as_good_as_was_said() {
    let (model, bundle) = shutter().make();
    let first = closed(&model, &bundle).unwrap();
    assert_eq!(first.report.effects[0].id, "rolling_shutter");
    assert!(first.report.effects[0].parameters["line_time_s"].value > 0.0);
    let written = Model::parse(&first.model.to_toml(), "model.toml", &[]).unwrap();
    let second = closed(&written, &bundle).unwrap();
    let (after, before) = (
        first.report.after.star_rms_arcsec,
        second.report.before.star_rms_arcsec,
    );
    for (a, b) in after.unwrap().iter().zip(before.unwrap()) {
        assert!((a / b - 1.0).abs() < 0.01, "after {a}, then before {b}");
    }
    assert!(
        second
            .report
            .effects
            .iter()
            .all(|e| e.id != "rolling_shutter")
    );
}
