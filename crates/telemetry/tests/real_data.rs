//! Bundles of real instruments. They are not part of the repository: `BORESIGHT_DATA` names the
//! folder (default: `../shared/data` beside the workspace). Without it these tests pass with a
//! word on stderr, or fail if `BORESIGHT_REQUIRE_DATA=1`.

#[path = "common/flight_data.rs"]
mod flight_data;

use flight_data::flight_data;
use telemetry::{Bundle, MemoryFiles, TableFormat};

#[test]
fn chandra_windows_and_stars() {
    let Some(path) = flight_data("chandra-aca-2019-272") else {
        return;
    };
    let bundle = Bundle::read(&path).unwrap();
    let camera = bundle.camera.as_ref().unwrap();
    assert_eq!(camera.pixel_centre().to_bits(), 0.0_f64.to_bits());
    let stars = bundle.stars.as_ref().unwrap();
    assert_eq!(
        (stars.rows(), stars.slot[0], stars.star_id[1]),
        (7960, 3, 4)
    );
    assert_eq!(stars.frames(), 7960 / 5);
    assert_eq!(stars.flux.as_ref().map(|flux| flux[0]), Some(12_471.8));
    let images = bundle.images.as_ref().unwrap();
    assert_eq!((images.len(), images.size), (7960, [6, 6]));
    assert_eq!(images.unread.iter().filter(|unread| **unread).count(), 4);
    assert!(images.unread[0] && images.unread[5] && images.unread[30] && images.unread[35]);
    assert_eq!(images.window(0)[7..9], [331.25, 1130.0]);
    let temperature = bundle
        .housekeeping
        .as_ref()
        .unwrap()
        .series("ccd_temp_c")
        .unwrap();
    assert_eq!(temperature.at(62.348), Some(-9.2));
    assert!(bundle.attitude.is_none() && bundle.catalog.is_none() && bundle.extra.is_empty());
    // 1998-01-01 and 21.74 years
    let year = bundle.meta.julian_year(0.0).unwrap();
    assert!((year - 2019.742).abs() < 1e-3, "{year}");
}

#[test]
fn tess_attitudes_and_velocity() {
    let Some(path) = flight_data("tess-s1-cam1-vs-cam4") else {
        return;
    };
    let bundle = Bundle::read(&path).unwrap();
    let (attitude, reference) = (bundle.attitude.unwrap(), bundle.reference.unwrap());
    assert_eq!((attitude.t_s.len(), reference.t_s.len()), (19_227, 19_227));
    let housekeeping = bundle.housekeeping.unwrap();
    assert_eq!(housekeeping.t_s.len(), 19_229);
    assert_eq!(housekeeping.channels.len(), 9);
    let frames = bundle.meta.frames.unwrap();
    assert!((frames.tracker_boresight.unwrap().norm() - 1.0).abs() < 1e-15);
    assert_eq!(frames.quaternion_signs.known(), None);
}

/// What was read is what is written and read again, in every form.
#[test]
fn real_bundles_go_round() {
    for name in ["chandra-aca-2019-272", "tess-s1-cam1-vs-cam4"] {
        let Some(path) = flight_data(name) else {
            return;
        };
        let bundle = Bundle::read(&path).unwrap();
        for format in TableFormat::ALL {
            let dir = tempfile::tempdir().unwrap();
            bundle.write(&dir.path().join("b"), format).unwrap();
            let again = Bundle::read(&dir.path().join("b")).unwrap();
            assert!(again == bundle, "{name} changed as {format:?}");
        }
    }
}

/// Every cut through a compressed table is noticed: no shorter table passes for the whole one.
#[test]
fn cut_gzip_is_never_a_shorter_table() {
    let Some(path) = flight_data("chandra-aca-2019-272") else {
        return;
    };
    let whole = std::fs::read(path.join("stars.csv.gz")).unwrap();
    let meta = std::fs::read(path.join("bundle.toml")).unwrap();
    for cut in [
        0,
        5,
        11,
        1000,
        50_000,
        whole.len() - 9,
        whole.len() - 4,
        whole.len() - 1,
    ] {
        let mut files = MemoryFiles::new("cut");
        files.insert("bundle.toml", meta.clone());
        files.insert("stars.csv.gz", whole[..cut].to_vec());
        let error = Bundle::read_from(&files)
            .expect_err("cut short")
            .to_string();
        assert!(error.contains("cut/stars.csv.gz"), "{cut}: {error}");
    }
}
