//! The same scenario gives the same bundle, on any thread and on disk; another draw another one.

mod common;

use std::collections::BTreeMap;
use std::path::Path;

use common::{SLEWS, scenario};
use scenarios::{
    Motion, Recorded, RecordedTable, Scenario, ScenarioError, simulate, simulate_with_truth,
};
use telemetry::{Bundle, TableFormat};

const NOISE: &str = "temporal_arcsec = 7.43\ncentroid_arcsec = 5.06\ndistortion_arcsec = 3.1667";

fn noisy() -> Result<Scenario, ScenarioError> {
    let rest = format!(
        "{SLEWS}closed_loop = {{ sigma_arcsec = [1.0, 1.0, 1.0], frequency_hz = 0.036 }}\n\
         [reference]\nwander_arcsec = [0.5, 0.5, 0.5]\n[rates]\nwhite_arcsec_s = [0.1, 0.1, 0.1]\n\
         [housekeeping]\nchannel = [{{ kind = \"sinusoid\", name = \"a_c\", amplitude = 1.0, \
         period_s = 50.0, noise = 0.1 }}]\n[run]\nduration_s = 60.0\nrate_hz = 2.0\nseed = 9"
    );
    scenario(NOISE, &rest)
}

#[test]
fn the_same_seed_gives_the_same_bundle_on_any_thread() {
    let given = noisy().unwrap();
    let here = simulate(&given).unwrap();
    std::thread::scope(|scope| {
        let others: Vec<_> = (0..4)
            .map(|_| scope.spawn(|| simulate(&given).unwrap()))
            .collect();
        for other in others {
            assert_eq!(other.join().unwrap(), here);
        }
    });
}

#[test]
fn another_draw_and_another_seed_differ_in_everything_random() {
    let given = noisy().unwrap();
    let first = simulate_with_truth(&given, 0).unwrap();
    let mut reseeded = given.clone();
    reseeded.run.seed = 10;
    for other in [
        simulate_with_truth(&given, 1).unwrap(),
        simulate_with_truth(&reseeded, 0).unwrap(),
    ] {
        let (a, b) = (&first.bundle, &other.bundle);
        assert_ne!(a.stars, b.stars);
        assert_ne!(a.attitude, b.attitude);
        assert_ne!(a.reference, b.reference);
        assert_ne!(a.rates, b.rates);
        assert_ne!(a.housekeeping, b.housekeeping);
        assert_ne!(first.pbm.distortion(), other.pbm.distortion());
        assert_ne!(first.truth, other.truth);
    }
}

fn files(folder: &Path) -> std::io::Result<BTreeMap<String, Vec<u8>>> {
    std::fs::read_dir(folder)?
        .map(|entry| {
            let entry = entry?;
            Ok((
                entry.file_name().to_string_lossy().into_owned(),
                std::fs::read(entry.path())?,
            ))
        })
        .collect()
}

/// What is written is read back as it was, and written twice it is the same to the byte.
#[test]
fn files_are_the_same_to_the_byte_and_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let bundle = simulate(&noisy().unwrap()).unwrap();
    for format in [TableFormat::CsvGz, TableFormat::Csv, TableFormat::Parquet] {
        let (one, two) = (
            folder.path().join(format!("one-{format:?}")),
            folder.path().join(format!("two-{format:?}")),
        );
        bundle.write(&one, format).unwrap();
        simulate(&noisy().unwrap())
            .unwrap()
            .write(&two, format)
            .unwrap();
        let written = files(&one).unwrap();
        assert!(written.len() >= 7, "{:?}", written.keys());
        assert_eq!(written, files(&two).unwrap());
        let read = Bundle::read(&one).unwrap();
        assert_eq!(read.stars, bundle.stars);
        assert_eq!(read.catalog, bundle.catalog);
        assert_eq!(
            read.attitude.as_ref().map(|a| a.t_s.len()),
            bundle.attitude.as_ref().map(|a| a.t_s.len())
        );
        assert_eq!(read.housekeeping, bundle.housekeeping);
    }
}

/// A recorded attitude moves the stars as the motion did that it was recorded from: the cubic through
/// 10 Hz samples with rates differs from the truth by h^4/384 of the fourth derivative, below
/// 1e-4 / 384 x 5e-5 rad/s^4 = 1e-11 rad, far below 1e-6 px.
#[test]
fn a_recorded_motion_repeats_the_stars() {
    let folder = tempfile::tempdir().unwrap();
    let run = "[run]\nduration_s = 60.0\nrate_hz = 2.0";
    let given = scenario("", &format!("{SLEWS}[reference]\nrate_hz = 10.0\n{run}")).unwrap();
    let original = simulate(&given).unwrap();
    original
        .write(&folder.path().join("recording"), TableFormat::Csv)
        .unwrap();
    let mut replay = Scenario {
        folder: folder.path().to_owned(),
        ..given
    };
    replay.motion = Motion::Recorded(Recorded {
        bundle: "recording".into(),
        table: RecordedTable::Reference,
        max_gap_s: None,
    });
    let simulated = simulate_with_truth(&replay, 0).unwrap();
    // the recording starts one sample, 0.1 s, before the first frame
    assert!((simulated.rows.t_s[0] + 0.1).abs() < 1e-12);
    replay.run.duration_s = None;
    replay.run.rate_hz = Some(10.0);
    let replayed = simulate(&replay).unwrap();
    let (before, after) = (original.stars.unwrap(), replayed.stars.unwrap());
    // a time on the 10 Hz grid as text, so that it can be a key
    let key = |t: f64| format!("{t:.1}");
    let at: BTreeMap<(String, i64), usize> = after
        .t_of_rows_s()
        .iter()
        .zip(&after.star_id)
        .enumerate()
        .map(|(row, (t, id))| ((key(*t), *id), row))
        .collect();
    let mut compared = 0;
    for (row, t) in before.t_of_rows_s().iter().enumerate() {
        let Some(&other) = at.get(&(key(*t), before.star_id[row])) else {
            continue;
        };
        let off =
            (before.x_px[row] - after.x_px[other]).hypot(before.y_px[row] - after.y_px[other]);
        assert!(off < 1e-6, "{off} px");
        compared += 1;
    }
    assert!(
        compared > before.rows() * 9 / 10,
        "{compared} of {}",
        before.rows()
    );
}
