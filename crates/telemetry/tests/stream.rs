//! A bundle written in pieces is the bundle written at once.
#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use std::fs;
use std::path::Path;

use telemetry::{Bundle, BundleWriter, Metadata, TableFormat, TelemetryError};

const COMPLETE: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../fixtures/bundles/complete"
);

/// Star rows and windows of the frames before, or from, a time.
fn part(bundle: &Bundle, keep: impl Fn(f64) -> bool) -> Bundle {
    let mut attitude = bundle.attitude.clone().unwrap();
    let kept: Vec<usize> = (0..attitude.t_s.len())
        .filter(|&k| keep(attitude.t_s[k]))
        .collect();
    attitude.q = kept.iter().map(|&k| attitude.q[k]).collect();
    attitude.t_s = kept.iter().map(|&k| attitude.t_s[k]).collect();
    Bundle {
        attitude: Some(attitude),
        ..Bundle::default()
    }
}

fn bytes(dir: &Path, format: TableFormat) -> Vec<u8> {
    fs::read(dir.join(format.file_name("attitude"))).unwrap()
}

#[test]
fn pieces_make_the_same_table() {
    let whole = Bundle::read(Path::new(COMPLETE)).unwrap();
    let middle = whole.attitude.as_ref().unwrap().t_s[1];
    let base = tempfile::tempdir().unwrap();
    for format in TableFormat::ALL {
        let (once, twice) = (base.path().join("once"), base.path().join("twice"));
        let all = part(&whole, |_| true);
        all.write(&once, format).unwrap();
        let mut writer = BundleWriter::new(&twice, format).unwrap();
        writer.append(&part(&whole, |t| t < middle)).unwrap();
        writer.append(&part(&whole, |t| t >= middle)).unwrap();
        writer.finish(Metadata::default()).unwrap();
        assert_eq!(Bundle::read(&twice).unwrap().attitude, all.attitude);
        // batches of rows leave traces in Parquet, none in CSV
        if format != TableFormat::Parquet {
            assert_eq!(bytes(&once, format), bytes(&twice, format), "{format:?}");
        }
    }
}

#[test]
fn an_unfinished_bundle_leaves_nothing_and_other_columns_are_refused() {
    let whole = Bundle::read(Path::new(COMPLETE)).unwrap();
    let base = tempfile::tempdir().unwrap();
    let dir = base.path().join("new");
    let mut writer = BundleWriter::new(&dir, TableFormat::Csv).unwrap();
    writer.append(&whole).unwrap();
    let mut other = whole.clone();
    other.reference.as_mut().unwrap().rates_rad_s = None;
    let changed = whole.reference.as_ref().unwrap().rates_rad_s.is_some();
    let got = writer.append(&other);
    assert!(changed && matches!(got, Err(TelemetryError::Inconsistent { .. })));
    drop(writer);
    assert_eq!(fs::read_dir(base.path()).unwrap().count(), 0);
}
