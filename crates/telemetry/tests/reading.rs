//! What a good bundle may look like, and what comes out of it.

mod common;

use common::{fixture, text};
use focal_plane::{AttitudeSource, Camera, Pixel};
use nalgebra::Vector3;
use proptest::collection::vec;
use proptest::prelude::*;
use telemetry::{
    Bundle, ExtraCells, Housekeeping, MemoryFiles, TableFiles, TableFormat, TimeScale,
};

/// Bundles may hold NaN (missing values), which equal nothing: compare their text.
fn shown(bundle: &Bundle) -> String {
    format!("{bundle:?}")
}

/// What a name says: a table, what may have been meant as one, or neither.
#[test]
fn files_that_only_look_like_tables_are_told() {
    let mut files = fixture("complete");
    let good = TableFiles::of(&files).unwrap();
    assert_eq!((good.read.len(), good.warning()), (7, None));
    files.remove("reference.csv");
    let meant = [
        "Stars.csv",
        "housekeeping.csv.zip",
        "night.PARQUET",
        "rates.txt",
        "reference.CSV",
        "references.csv.gz",
    ];
    let others = [
        "attitude.png",
        "reference.md",
        "README.md",
        "model.toml",
        "truth.json",
        "report.json",
        "residuals_stars.parquet",
        "dark_map.csv",
        "._stars.csv",
    ];
    for name in meant.into_iter().chain(others) {
        files.insert(name, Vec::new());
    }
    let tables = TableFiles::of(&files).unwrap();
    assert_eq!(tables.unread, meant);
    let read = [
        "attitude.csv",
        "stars.csv",
        "images.csv",
        "rates.csv",
        "catalog.csv",
        "housekeeping.csv",
    ];
    assert_eq!(tables.read, read);
    let warning = tables.warning().unwrap();
    for part in ["reference.CSV, references.csv.gz", "catalog, housekeeping"] {
        assert!(warning.contains(part), "{warning}");
    }
    assert!(Bundle::read_from(&files).unwrap().reference.is_none());
}

#[test]
fn every_table_is_read() {
    let bundle = Bundle::read_from(&fixture("complete")).unwrap();
    assert_eq!(bundle.meta.time_scale, Some(TimeScale::Tdb));
    assert_eq!(bundle.meta.tracker.exposure_s, Some(0.1));
    assert_eq!(
        bundle.camera,
        Camera::from_fov_deg([1024; 2], [20.0; 2]).ok()
    );
    let stars = bundle.stars.unwrap();
    assert_eq!((stars.frames(), stars.rows()), (12, 36));
    assert_eq!(stars.star_id[..3], [101, 102, 103]);
    assert_eq!(stars.slot[..3], [1, 2, 5]);
    let images = bundle.images.unwrap();
    assert_eq!((images.len(), images.size), (12, [4, 3]));
    assert_eq!(images.unread.iter().position(|u| *u), Some(0));
    // row 1, column 2 of the window: pixel p12
    assert_eq!(images.window(0)[4 + 2].to_bits(), 324.02_f64.to_bits());
    let catalog = bundle.catalog.unwrap();
    assert_eq!(catalog.epoch_year().to_bits(), 2000.0_f64.to_bits());
    assert!(catalog.stars()[2].bv.is_nan());
    let housekeeping = bundle.housekeeping.unwrap();
    assert_eq!(housekeeping.channels.len(), 5);
    assert!(housekeeping.channels["panel_c"][2].is_nan());
    // the missing value is bridged: between 20.125 at 0.8 s and 20.375 at 2.4 s
    let panel = housekeeping.series("panel_c").unwrap().at(1.6).unwrap();
    assert!((panel - 20.25).abs() < 1e-12, "{panel}");
    assert_eq!(
        bundle.meta.frames.unwrap().quaternion_signs.known(),
        Some([1.0, 1.0, -1.0])
    );
}

/// The fixture was projected by its script: catalogue, reference and stars agree to the digits
/// printed (1e-6 px and 1e-9 deg, which is 5e-8 px; half a unit of the last digit each).
#[test]
fn tables_agree_with_one_another() {
    let bundle = Bundle::read_from(&fixture("complete")).unwrap();
    let (camera, catalog) = (bundle.camera.unwrap(), bundle.catalog.unwrap());
    let (stars, reference) = (bundle.stars.unwrap(), bundle.reference.unwrap());
    let truth = reference.series().unwrap();
    for frame in 0..stars.frames() {
        let q = truth.attitude(stars.t_s[frame]).unwrap();
        for row in stars.rows_of(frame) {
            let index = catalog.index_of(stars.star_id[row]).unwrap();
            let at = camera
                .project(&(q * catalog.direction_at(index, 2000.0)))
                .unwrap();
            let measured = Pixel {
                x: stars.x_px[row],
                y: stars.y_px[row],
            };
            let miss = (at.x - measured.x).hypot(at.y - measured.y);
            assert!(miss < 1e-6, "row {row}: {miss} px");
        }
    }
    assert_eq!(
        reference.rates_rad_s.unwrap()[0],
        Vector3::new(1e-3, 0.0, 0.0)
    );
    let span_s = bundle.attitude.unwrap().series().unwrap().span_s();
    assert!(span_s[0].abs() < 1e-12 && (span_s[1] - 5.5).abs() < 1e-12);
}

/// pyarrow wrote the same rows: an independent program, another format, the same bundle.
#[test]
fn parquet_of_another_program_is_the_same_bundle() {
    let mut csv = Bundle::read_from(&fixture("complete")).unwrap();
    let mut parquet = Bundle::read_from(&fixture("columnar")).unwrap();
    csv.extra.clear();
    parquet.extra.clear();
    assert_eq!(shown(&csv), shown(&parquet));
}

#[test]
fn extra_columns_are_kept() {
    let bundle = Bundle::read_from(&fixture("complete")).unwrap();
    let quality = &bundle.extra["stars"][0];
    assert_eq!(
        (quality.name.as_str(), quality.cells.len()),
        ("quality", 36)
    );
    let mode = &bundle.extra["housekeeping"][0];
    assert_eq!(mode.name, "mode");
    let ExtraCells::Text(cells) = &mode.cells else {
        unreachable!("words are text")
    };
    assert_eq!((cells.get(0), cells.get(1)), (Some(""), Some("fine")));
}

/// Written and read again in each form, nothing changes but the renames, which are gone.
#[test]
fn a_bundle_goes_round() {
    let bundle = Bundle::read_from(&fixture("complete")).unwrap();
    let dir = tempfile::tempdir().unwrap();
    // over one another: the second must not be mixed with what is left of the first
    for format in TableFormat::ALL {
        bundle.write(&dir.path().join("b"), format).unwrap();
        let again = Bundle::read(&dir.path().join("b")).unwrap();
        let mut expected = bundle.clone();
        expected.meta.columns.clear();
        assert_eq!(shown(&again), shown(&expected), "{format:?}");
    }
}

#[test]
fn tables_that_are_no_longer_there_do_not_stay() {
    let dir = tempfile::tempdir().unwrap();
    let mut bundle = Bundle::read_from(&fixture("complete")).unwrap();
    bundle.write(dir.path(), TableFormat::Csv).unwrap();
    bundle.reference = None;
    bundle.write(dir.path(), TableFormat::Csv).unwrap();
    assert!(Bundle::read(dir.path()).unwrap().reference.is_none());
}

#[test]
fn a_folder_of_foreign_tables_is_not_written_to() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("rates.csv.gz"), "mine").unwrap();
    let bundle = Bundle::read_from(&fixture("attitude_only")).unwrap();
    let error = bundle.write(dir.path(), TableFormat::Csv).unwrap_err();
    assert!(error.to_string().contains("rates.csv.gz"), "{error}");
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
}

#[test]
fn a_bundle_that_does_not_fit_together_leaves_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let mut bundle = Bundle::read_from(&fixture("complete")).unwrap();
    bundle.rates.as_mut().unwrap().w.pop();
    let error = bundle
        .write(&dir.path().join("b"), TableFormat::Csv)
        .unwrap_err();
    assert!(error.to_string().contains("rates"), "{error}");
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
}

/// The same bundle with each table passed through `change`.
fn tables_changed(change: impl Fn(&str) -> Vec<u8>) -> MemoryFiles {
    let mut files = fixture("complete");
    for table in [
        "attitude",
        "stars",
        "images",
        "reference",
        "rates",
        "catalog",
        "housekeeping",
    ] {
        let name = format!("{table}.csv");
        let content = change(&text(&files, &name));
        files.insert(&name, content);
    }
    files
}

#[test]
fn other_ways_to_write_csv() {
    let plain = shown(&Bundle::read_from(&fixture("complete")).unwrap());
    let quoted = |line: &str| {
        let cells: Vec<String> = line.split(',').map(|cell| format!("\"{cell}\"")).collect();
        cells.join(",") + "\n"
    };
    type Way = Box<dyn Fn(&str) -> Vec<u8>>;
    let ways: [(&str, Way); 7] = [
        (
            "CRLF",
            Box::new(|text| text.replace('\n', "\r\n").into_bytes()),
        ),
        (
            "byte order mark",
            Box::new(|text| format!("\u{feff}{text}").into_bytes()),
        ),
        (
            "blank lines at the end",
            Box::new(|text| format!("{text}\n\r\n").into_bytes()),
        ),
        (
            "no end of the last line",
            Box::new(|text| text.trim_end().into()),
        ),
        (
            "blanks around cells",
            Box::new(|text| text.replace(',', " , ").into_bytes()),
        ),
        (
            "quotes",
            Box::new(move |text| text.lines().map(quoted).collect::<String>().into()),
        ),
        (
            "nan for nothing",
            Box::new(|text| text.replace(",,0", ",nan,0").into_bytes()),
        ),
    ];
    for (name, way) in ways {
        let bundle = Bundle::read_from(&tables_changed(way));
        assert_eq!(
            shown(&bundle.unwrap_or_else(|e| panic!("{name}: {e}"))),
            plain,
            "{name}"
        );
    }
}

/// Lines count as an editor shows them, also after CRLF, blank lines and quoted line ends.
#[test]
fn lines_are_counted_as_an_editor_does() {
    let mut files = fixture("attitude_only");
    for (content, line) in [
        ("t_s,qx,qy,qz,qw\r\n0,0,0,0,1\r\n1,0,0,0,x\r\n", 3),
        ("t_s,qx,qy,qz,qw\n\n0,0,0,0,1\n\n\n1,0,0,0,x\n", 6),
        (
            "t_s,qx,qy,qz,qw,note\n0,0,0,0,1,\"two\nlines\"\n1,0,0,0,x,\n",
            4,
        ),
        // the place of a value that parses, but is wrong
        ("t_s,qx,qy,qz,qw\n\n0,0,0,0,1\n\n\n1,0,0,0,2\n", 6),
    ] {
        files.insert("attitude.csv", content.as_bytes().to_vec());
        let error = Bundle::read_from(&files).unwrap_err().to_string();
        assert!(
            error.contains(&format!("line {line},")),
            "{content:?}: {error}"
        );
    }
}

#[test]
fn whole_numbers_may_look_like_fractions() {
    let mut files = fixture("complete");
    let stars = text(&files, "stars.csv").replace(",101,", ",101.0,");
    files.insert("stars.csv", stars.into_bytes());
    Bundle::read_from(&files).unwrap();
}

/// A window of 4 columns and 3 rows is one, in whichever order its size was written.
#[test]
fn the_columns_say_which_way_a_window_lies() {
    let mut files = fixture("complete");
    let meta = text(&files, "bundle.toml");
    for size in ["size = [3, 4]", "size = [4, 3]"] {
        files.insert(
            "bundle.toml",
            meta.replace("size = [4, 3]", size).into_bytes(),
        );
        let images = Bundle::read_from(&files).unwrap().images.unwrap();
        assert_eq!(images.size, [4, 3], "{size}");
    }
}

#[test]
fn windows_beyond_ten() {
    let mut bundle = Bundle::read_from(&fixture("complete")).unwrap();
    let images = bundle.images.as_mut().unwrap();
    images.size = [12, 11];
    images.unread = vec![false; 132];
    images.unread[131] = true;
    images.pixels = (0..132 * images.t_s.len()).map(|i| i as f64).collect();
    let dir = tempfile::tempdir().unwrap();
    bundle.write(dir.path(), TableFormat::Csv).unwrap();
    let header = std::fs::read_to_string(dir.path().join("images.csv")).unwrap();
    assert!(header.contains(",p09,p0_10,p0_11,p10,"));
    let again = Bundle::read(dir.path()).unwrap();
    assert_eq!(again.images, bundle.images);
}

#[test]
fn other_files_are_not_opened() {
    let mut files = fixture("complete");
    files.insert("truth.json", b"not even JSON".to_vec());
    files.insert("notes.csv", b"\xff\xfe".to_vec());
    files.insert("stars.csv.bak", Vec::new());
    Bundle::read_from(&files).unwrap();
}

#[test]
fn the_catalogue_may_have_another_epoch() {
    let mut files = fixture("complete");
    let meta = text(&files, "bundle.toml");
    let meta = meta.replace("\n[tracker]", "catalog_epoch_year = 1991.25\n\n[tracker]");
    files.insert("bundle.toml", meta.into_bytes());
    let catalog = Bundle::read_from(&files).unwrap().catalog.unwrap();
    assert_eq!(catalog.epoch_year().to_bits(), 1991.25_f64.to_bits());
}

/// A missing value is an empty cell in CSV, so that no reader has to know a word for it.
#[test]
fn missing_values_are_empty_cells() {
    let dir = tempfile::tempdir().unwrap();
    let bundle = Bundle::read_from(&fixture("complete")).unwrap();
    bundle.write(dir.path(), TableFormat::Csv).unwrap();
    let housekeeping = std::fs::read_to_string(dir.path().join("housekeeping.csv")).unwrap();
    let row = housekeeping.lines().nth(3).unwrap();
    assert_eq!(row, "1.6,0,,7.5,-0.5,0,fine");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Every finite double comes back bit for bit, whatever the form of the table.
    #[test]
    fn numbers_go_round_bit_for_bit(numbers in vec(prop::num::f64::ANY, 1..40)) {
        let numbers: Vec<f64> = numbers.into_iter().filter(|x| x.is_finite()).collect();
        prop_assume!(!numbers.is_empty());
        let mut bundle = Bundle::read_from(&fixture("attitude_only")).unwrap();
        bundle.housekeeping = Some(Housekeeping {
            t_s: (0..numbers.len()).map(|row| row as f64).collect(),
            channels: [("any".to_owned(), numbers.clone())].into(),
        });
        let dir = tempfile::tempdir().unwrap();
        for format in TableFormat::ALL {
            bundle.write(dir.path(), format).unwrap();
            let again = Bundle::read(dir.path()).unwrap().housekeeping.unwrap();
            let bits = |column: &[f64]| column.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            prop_assert_eq!(bits(&again.channels["any"]), bits(&numbers));
        }
    }
}
