//! Every fault of the format's list, one at a time, made from a good bundle. A message must name
//! the file, the line, the column, what was expected and what was found.

mod common;

use std::io::Write as _;

use common::{fixture, refusal, text};
use flate2::Compression;
use flate2::write::GzEncoder;
use telemetry::{Bundle, MemoryFiles, TableFormat};

/// The good bundle with one place of one file changed.
fn changed(file: &str, from: &str, to: &str) -> MemoryFiles {
    let mut files = fixture("complete");
    let before = text(&files, file);
    assert!(before.contains(from), "{file} has no {from:?}");
    files.insert(file, before.replacen(from, to, 1).into_bytes());
    files
}

/// The good bundle with one line (1-based) of one file changed.
fn line_changed(file: &str, line: usize, change: impl Fn(&str) -> String) -> MemoryFiles {
    let mut files = fixture("complete");
    let mut lines: Vec<String> = text(&files, file).lines().map(String::from).collect();
    lines[line - 1] = change(&lines[line - 1]);
    files.insert(file, (lines.join("\n") + "\n").into_bytes());
    files
}

/// One cell of one line changed.
fn cell_changed(file: &str, line: usize, column: &str, to: &str) -> MemoryFiles {
    let header = text(&fixture("complete"), file);
    let names: Vec<&str> = header.lines().next().unwrap_or("").split(',').collect();
    let at = names.iter().position(|name| *name == column);
    let at = at.expect("a column of the table");
    line_changed(file, line, |line| {
        let mut cells: Vec<&str> = line.split(',').collect();
        cells[at] = to;
        cells.join(",")
    })
}

#[track_caller]
fn check(files: &MemoryFiles, parts: &[&str]) {
    let message = refusal(files);
    for part in parts {
        assert!(message.contains(part), "no {part:?} in:\n{message}");
    }
}

#[test]
fn the_good_bundle_is_good() {
    Bundle::read_from(&fixture("complete")).unwrap();
}

#[test]
fn missing_column() {
    let files = changed("stars.csv", "x_px", "xpos");
    check(
        &files,
        &[
            "b/stars.csv, line 1",
            "column x_px",
            "expected",
            "found t_s, slot, star_id, xpos",
        ],
    );
}

#[test]
fn missing_renamed_column() {
    let files = changed("bundle.toml", "qx = \"Q1\"", "qx = \"q1\"");
    check(
        &files,
        &[
            "b/attitude.csv, line 1",
            "column q1",
            "expected",
            "found t_s, Q1",
            "`Q1`",
        ],
    );
}

#[test]
fn half_a_group_of_columns() {
    let files = changed("reference.csv", "wz_rad_s", "other");
    check(
        &files,
        &["b/reference.csv, line 1", "column wz_rad_s", "expected"],
    );
    let files = changed("catalog.csv", "pm_dec_mas_yr", "other");
    check(&files, &["b/catalog.csv, line 1", "column pm_dec_mas_yr"]);
}

#[test]
fn missing_pixel() {
    let files = changed("images.csv", "p12", "q12");
    check(
        &files,
        &["b/images.csv, line 1", "column p12", "4 columns and 3 rows"],
    );
}

#[test]
fn pixel_beyond_the_window() {
    let files = changed("images.csv", "background,", "background,p30,");
    check(&files, &["b/images.csv", "p23", "p30", "size"]);
}

#[test]
fn duplicate_column() {
    let files = changed("stars.csv", "flux", "mag");
    check(
        &files,
        &["b/stars.csv, line 1", "column mag", "once", "6 and 7"],
    );
}

#[test]
fn word_in_a_number() {
    let files = cell_changed("stars.csv", 8, "y_px", "high");
    check(
        &files,
        &[
            "b/stars.csv, line 8",
            "column y_px",
            "a finite number",
            "\"high\"",
        ],
    );
}

#[test]
fn word_in_a_renamed_column() {
    let files = cell_changed("attitude.csv", 3, "Q4", "one");
    check(
        &files,
        &[
            "b/attitude.csv, line 3",
            "column Q4",
            "a finite number",
            "\"one\"",
        ],
    );
}

#[test]
fn word_in_a_channel() {
    let files = cell_changed("housekeeping.csv", 5, "panel_c", "warm");
    check(
        &files,
        &["b/housekeeping.csv, line 5", "column panel_c", "\"warm\""],
    );
    let files = cell_changed("housekeeping.csv", 2, "panel_c", "warm");
    check(
        &files,
        &[
            "b/housekeeping.csv, line 2",
            "column panel_c",
            "\"warm\"",
            "a number, as 20.125 of line 3",
        ],
    );
}

#[test]
fn fraction_in_a_whole_number() {
    let files = cell_changed("stars.csv", 4, "star_id", "101.5");
    check(
        &files,
        &[
            "b/stars.csv, line 4",
            "column star_id",
            "a whole number",
            "101.5",
        ],
    );
}

#[test]
fn empty_cell_outside_housekeeping() {
    let files = cell_changed("stars.csv", 4, "x_px", "");
    check(
        &files,
        &[
            "b/stars.csv, line 4",
            "column x_px",
            "a finite number",
            "an empty cell",
        ],
    );
}

#[test]
fn infinite_cell() {
    let files = cell_changed("housekeeping.csv", 4, "vx_km_s", "inf");
    check(
        &files,
        &[
            "b/housekeeping.csv, line 4",
            "column vx_km_s",
            "finite",
            "inf",
        ],
    );
    let files = cell_changed("rates.csv", 4, "wy_rad_s", "nan");
    check(
        &files,
        &["b/rates.csv, line 4", "column wy_rad_s", "finite", "nan"],
    );
}

#[test]
fn short_row() {
    let files = line_changed("stars.csv", 6, |_| "0.5,2,102".into());
    check(
        &files,
        &[
            "b/stars.csv, line 6",
            "column x_px",
            "expected 8 cells",
            "found 3",
        ],
    );
}

#[test]
fn long_row() {
    let files = line_changed("rates.csv", 6, |line| format!("{line},7"));
    check(
        &files,
        &[
            "b/rates.csv, line 6",
            "column wz_rad_s",
            "expected 4 cells",
            "found 5",
        ],
    );
}

#[test]
fn empty_tables() {
    let header = text(&fixture("complete"), "rates.csv");
    let header = header.lines().next().unwrap();
    for content in [
        header.to_owned(),
        format!("{header}\n"),
        format!("{header}\r\n\r\n"),
    ] {
        let mut files = fixture("complete");
        files.insert("rates.csv", content.into_bytes());
        check(
            &files,
            &[
                "b/rates.csv, line 2",
                "expected at least one row",
                "found none",
            ],
        );
    }
    let mut files = fixture("complete");
    files.insert("rates.csv", Vec::new());
    check(
        &files,
        &["b/rates.csv, line 1", "column t_s", "found nothing"],
    );
}

#[test]
fn non_unit_quaternion() {
    let files = cell_changed("attitude.csv", 7, "Q4", "0.999");
    check(
        &files,
        &[
            "b/attitude.csv, line 7",
            "column Q1, Q2, Q3, Q4",
            "norm 1 within 1e-6",
            "norm 0.999",
        ],
    );
    let files = cell_changed("reference.csv", 7, "qw", "1e200");
    check(
        &files,
        &["b/reference.csv, line 7", "column qx, qy, qz, qw", "norm"],
    );
}

/// The tolerance is 1e-6 on the norm: half of it passes, twice does not.
#[test]
fn quaternion_tolerance() {
    for (w, good) in [
        ("1.0000005", true),
        ("1.000002", false),
        ("0.9999995", true),
    ] {
        let files = cell_changed("attitude.csv", 2, "Q4", w);
        assert_eq!(Bundle::read_from(&files).is_ok(), good, "{w}");
    }
}

#[test]
fn non_finite_quaternion() {
    let files = cell_changed("attitude.csv", 7, "Q2", "nan");
    check(
        &files,
        &[
            "b/attitude.csv, line 7",
            "column Q2",
            "a finite number",
            "found nan",
        ],
    );
}

#[test]
fn time_backwards_and_repeated() {
    for (file, line, time) in [
        ("attitude.csv", 5, "0.25"),
        ("attitude.csv", 5, "1.0"),
        ("reference.csv", 5, "-3"),
        ("rates.csv", 5, "1.0"),
        ("housekeeping.csv", 5, "1.6"),
    ] {
        let files = cell_changed(file, line, "t_s", time);
        let at = format!("b/{file}, line {line}");
        check(
            &files,
            &[&at, "column t_s", "later than", "of line 4", "found"],
        );
    }
}

#[test]
fn time_backwards_between_frames() {
    let files = cell_changed("stars.csv", 8, "t_s", "0.5");
    check(
        &files,
        &[
            "b/stars.csv, line 8",
            "column t_s, slot",
            "once",
            "line 5",
            "slot 1",
        ],
    );
    let files = cell_changed("stars.csv", 8, "t_s", "0.25");
    check(
        &files,
        &[
            "b/stars.csv, line 8",
            "column t_s",
            "not before 0.5 of line 7",
            "0.25",
        ],
    );
    let files = cell_changed("images.csv", 8, "t_s", "-1");
    check(
        &files,
        &[
            "b/images.csv, line 8",
            "column t_s",
            "not before 0.5 of line 7",
        ],
    );
}

#[test]
fn slot_repeated_in_a_frame() {
    for file in ["stars.csv", "images.csv"] {
        let files = cell_changed(file, 7, "slot", "1");
        let at = format!("b/{file}, line 7");
        check(
            &files,
            &[&at, "column t_s, slot", "once at 0.5 s", "line 5", "slot 1"],
        );
    }
}

#[test]
fn unknown_star() {
    let files = cell_changed("stars.csv", 9, "star_id", "999");
    check(
        &files,
        &[
            "b/stars.csv, line 9",
            "column star_id",
            "table catalog",
            "found 999",
        ],
    );
}

#[test]
fn star_twice_in_the_catalogue() {
    let files = cell_changed("catalog.csv", 4, "star_id", "102");
    check(
        &files,
        &[
            "b/catalog.csv, line 4",
            "column star_id",
            "once",
            "line 3",
            "102",
        ],
    );
}

#[test]
fn sample_rate_off() {
    let files = changed(
        "bundle.toml",
        "sample_rate_hz = 2.0",
        "sample_rate_hz = 2.03",
    );
    check(
        &files,
        &[
            "b/bundle.toml, line 8, column 1",
            "`sample_rate_hz`",
            "2.0",
            "0.5",
            "2.03",
            "1 %",
        ],
    );
    for near in ["1.985", "2.015"] {
        let near = format!("sample_rate_hz = {near}");
        let files = changed("bundle.toml", "sample_rate_hz = 2.0", &near);
        Bundle::read_from(&files).unwrap();
    }
}

#[test]
fn neither_attitude_nor_stars() {
    let mut files = fixture("complete");
    files.remove("stars.csv");
    files.remove("attitude.csv");
    check(
        &files,
        &[
            "b: ",
            "`attitude` or `stars`",
            "found bundle.toml, catalog.csv",
        ],
    );
}

#[test]
fn no_metadata() {
    let mut files = fixture("complete");
    let meta = text(&files, "bundle.toml").into_bytes();
    files.remove("bundle.toml");
    files.insert("bundel.toml", meta);
    check(&files, &["b/bundle.toml", "expected", "bundel.toml"]);
}

#[test]
fn no_folder() {
    let error = Bundle::read("no/such/folder".as_ref()).unwrap_err();
    assert!(error.to_string().contains("no/such/folder"), "{error}");
}

#[test]
fn one_table_in_two_files() {
    let mut files = fixture("complete");
    let stars = text(&files, "stars.csv");
    files.insert("stars.csv.gz", gzipped(stars.as_bytes()));
    check(
        &files,
        &["stars", "b/stars.csv", "b/stars.csv.gz", "one file"],
    );
}

fn gzipped(bytes: &[u8]) -> Vec<u8> {
    let mut gzip = GzEncoder::new(Vec::new(), Compression::default());
    gzip.write_all(bytes).expect("memory takes all");
    gzip.finish().expect("memory takes all")
}

/// The good bundle with its stars gzipped.
fn with_gzip(change: impl Fn(&mut Vec<u8>)) -> MemoryFiles {
    let mut files = fixture("complete");
    let mut bytes = gzipped(text(&files, "stars.csv").as_bytes());
    change(&mut bytes);
    files.remove("stars.csv");
    files.insert("stars.csv.gz", bytes);
    files
}

#[test]
fn gzip_ends_early() {
    Bundle::read_from(&with_gzip(|_| {})).unwrap();
    let length = gzipped(text(&fixture("complete"), "stars.csv").as_bytes()).len();
    for cut in (0..length).step_by(7).chain(length - 9..length) {
        let files = with_gzip(|bytes| bytes.truncate(cut));
        let message = refusal(&files);
        assert!(message.contains("b/stars.csv.gz"), "{cut}: {message}");
        if cut > 10 {
            let whole = "expected a whole gzip stream";
            assert!(
                message.contains(whole) && message.contains("line"),
                "{cut}: {message}"
            );
        }
    }
}

#[test]
fn gzip_damaged_or_misnamed() {
    let files = with_gzip(|bytes| {
        let last = bytes.len() - 6; // in the checksum
        bytes[last] ^= 0xff;
    });
    check(&files, &["b/stars.csv.gz", "gzip stream"]);
    let mut files = fixture("complete");
    let stars = text(&files, "stars.csv");
    files.insert("stars.csv", gzipped(stars.as_bytes()));
    check(&files, &["b/stars.csv,", "gzip", ".csv.gz"]);
    files.remove("stars.csv");
    files.insert("stars.csv.gz", stars.into_bytes());
    check(&files, &["b/stars.csv.gz", "gzip"]);
}

#[test]
fn fault_in_a_gzipped_table_has_its_line() {
    let mut files = cell_changed("stars.csv", 9, "mag", "dim");
    let faulty = text(&files, "stars.csv");
    files.remove("stars.csv");
    files.insert("stars.csv.gz", gzipped(faulty.as_bytes()));
    check(&files, &["b/stars.csv.gz, line 9", "column mag", "\"dim\""]);
}

#[test]
fn parquet_cut_short() {
    let files = fixture("columnar");
    Bundle::read_from(&files).unwrap();
    let whole = files.get("stars.parquet").unwrap().to_vec();
    for cut in (0..whole.len())
        .step_by(97)
        .chain(whole.len() - 12..whole.len())
    {
        let mut files = files.clone();
        files.insert("stars.parquet", whole[..cut].to_vec());
        check(
            &files,
            &["b/stars.parquet", "row", "expected a whole Parquet file"],
        );
    }
}

#[test]
fn parquet_of_another_compression() {
    check(
        &fixture("gzip_columns"),
        &[
            "b/attitude.parquet",
            "column t_s",
            "expected snappy compression or none",
            "found gzip",
        ],
    );
}

#[test]
fn parquet_without_a_column() {
    let mut files = fixture("columnar");
    let reference = files.remove("reference.parquet").unwrap();
    files.insert("stars.parquet", reference.into_owned());
    check(
        &files,
        &[
            "b/stars.parquet",
            "column slot",
            "expected",
            "found t_s, qx",
        ],
    );
}

/// A fault inside a Parquet table is named by its row; here rows are those of the CSV table.
#[test]
fn parquet_fault_has_its_row() {
    let mut bundle = Bundle::read_from(&fixture("complete")).unwrap();
    let housekeeping = bundle.housekeeping.as_mut().unwrap();
    housekeeping.channels.get_mut("panel_c").unwrap()[4] = -400.0;
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("b");
    bundle.write(&folder, TableFormat::Parquet).unwrap();
    let message = Bundle::read(&folder).unwrap_err().to_string();
    for part in [
        "housekeeping.parquet, row 5",
        "column panel_c",
        "-273.15",
        "-400",
    ] {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn unknown_keys() {
    for (from, to, parts) in [
        (
            "epoch_offset_s",
            "epoch_ofset_s",
            ["line 6, column 1", "`epoch_ofset_s`", "`epoch_offset_s`"],
        ),
        (
            "exposure_s",
            "exposure",
            ["line 13, column 1", "[tracker]", "`exposure_s`"],
        ),
        (
            "unread",
            "unred",
            ["line 17, column 1", "[images]", "`unread`"],
        ),
        (
            "vectors_in",
            "vector_in",
            ["line 22, column 1", "[frames]", "`vectors_in`"],
        ),
        (
            "[columns.attitude]",
            "[columns.atitude]",
            ["line 25", "`atitude`", "`attitude`"],
        ),
        (
            "qx = \"Q1\"",
            "qq = \"Q1\"",
            ["line 26, column 1", "`qq`", "`qx`"],
        ),
        (
            "exposure_s",
            "sample_rate_hz",
            ["line 13", "`sample_rate_hz`", "the top of the file"],
        ),
    ] {
        let files = changed("bundle.toml", from, to);
        check(&files, &["b/bundle.toml", "^"]);
        check(&files, &parts);
    }
}

#[test]
fn the_offending_line_is_shown() {
    let files = changed("bundle.toml", "exposure_s = 0.1", "exposure = 0.1");
    check(&files, &["13 | exposure = 0.1", " | ^^^^^^^^"]);
}

#[test]
fn toml_that_is_none() {
    let files = changed("bundle.toml", "title = \"Three", "title = Three");
    check(&files, &["b/bundle.toml, line 2", "title = Three"]);
    let files = changed("bundle.toml", "[images]", "[tracker]");
    check(&files, &["b/bundle.toml, line 15", "[tracker]"]);
}

#[test]
fn another_format() {
    let files = changed("bundle.toml", "bundle/1", "bundle/2");
    check(
        &files,
        &[
            "b/bundle.toml, line 1",
            "boresight-bundle/1",
            "boresight-bundle/2",
        ],
    );
    let files = changed("bundle.toml", "format = \"boresight-bundle/1\"\n", "");
    check(&files, &["b/bundle.toml, line 1", "`format`", "found none"]);
}

#[test]
fn metadata_out_of_range() {
    for (from, to, line, key) in [
        ("pixels = [1024, 1024]", "pixels = [1024, 0]", 11, "pixels"),
        ("pixels = [1024, 1024]", "pixels = [1024]", 11, "pixels"),
        (
            "pixels = [1024, 1024]",
            "pixels = [1024.5, 1024]",
            11,
            "pixels",
        ),
        (
            "fov_deg = [20.0, 20.0]",
            "fov_deg = [20.0, 25.0]",
            12,
            "fov_deg",
        ),
        (
            "fov_deg = [20.0, 20.0]",
            "fov_deg = [20.0, 190.0]",
            12,
            "fov_deg",
        ),
        (
            "fov_deg = [20.0, 20.0]",
            "focal_length_px = -2903.7",
            12,
            "focal_length_px",
        ),
        ("exposure_s = 0.1", "exposure_s = -0.1", 13, "exposure_s"),
        (
            "exposure_s = 0.1",
            "exposure_s = \"long\"",
            13,
            "exposure_s",
        ),
        (
            "exposure_s = 0.1",
            "pixel_centre = 0.25",
            13,
            "pixel_centre",
        ),
        ("2018-07-25", "2018-02-30", 5, "epoch"),
        (
            "epoch_offset_s = 10.0",
            "epoch_offset_s = nan",
            6,
            "epoch_offset_s",
        ),
        ("\"TDB\"", "\"EST\"", 7, "time_scale"),
        (
            "sample_rate_hz = 2.0",
            "sample_rate_hz = 0.0",
            8,
            "sample_rate_hz",
        ),
        ("size = [4, 3]", "size = [0, 3]", 16, "size"),
        ("\"p00\"", "\"p09\"", 17, "unread"),
        ("\"body\"", "\"ship\"", 22, "vectors_in"),
        ("[1, 1, -1]", "[1, 1, 2]", 23, "quaternion_signs"),
        ("[0.5878, 0.0", "[0.9, 0.0", 20, "tracker_boresight"),
    ] {
        let files = changed("bundle.toml", from, to);
        let (at, key) = (format!("b/bundle.toml, line {line}"), format!("`{key}`"));
        check(&files, &[&at, &key]);
    }
}

#[test]
fn fov_and_focal_length() {
    let files = changed(
        "bundle.toml",
        "exposure_s = 0.1",
        "focal_length_px = 2903.7",
    );
    check(
        &files,
        &[
            "b/bundle.toml, line 12",
            "`focal_length_px` or `fov_deg`",
            "both",
        ],
    );
}

#[test]
fn half_a_camera() {
    let files = changed("bundle.toml", "fov_deg = [20.0, 20.0]\n", "");
    check(
        &files,
        &[
            "b/bundle.toml, line 10",
            "`focal_length_px` or `fov_deg`",
            "`pixels`",
        ],
    );
    let files = changed("bundle.toml", "pixels = [1024, 1024]\n", "");
    check(
        &files,
        &["b/bundle.toml, line 10", "`pixels`", "found none"],
    );
}

#[test]
fn values_out_of_range() {
    for (file, line, column, value) in [
        ("catalog.csv", 3, "dec_deg", "90.5"),
        ("catalog.csv", 3, "dec_deg", "-91"),
        ("catalog.csv", 3, "ra_deg", "361"),
        ("catalog.csv", 3, "mag", "99"),
        ("catalog.csv", 3, "bv", "99"),
        ("stars.csv", 3, "x_px", "900"),
        ("stars.csv", 3, "mag", "-99"),
        ("images.csv", 3, "y0_px", "-900"),
        ("reference.csv", 3, "sy_arcsec", "-1"),
        ("reference.csv", 3, "wx_rad_s", "1e4"),
        ("rates.csv", 3, "wx_rad_s", "-1e4"),
        ("housekeeping.csv", 3, "panel_c", "-300"),
        ("housekeeping.csv", 3, "heater_on", "2"),
        ("housekeeping.csv", 3, "vy_km_s", "300000"),
    ] {
        let files = cell_changed(file, line, column, value);
        let at = format!("b/{file}, line {line}, column {column}");
        check(&files, &[&at, "expected", "found"]);
    }
}

#[test]
fn negative_magnitude_is_fine() {
    let files = cell_changed("catalog.csv", 3, "mag", "-1.46");
    Bundle::read_from(&files).unwrap();
}

#[test]
fn text_that_is_no_utf8() {
    let mut files = fixture("complete");
    let mut bytes = files.get("rates.csv").unwrap().to_vec();
    let at = text(&files, "rates.csv").find("\n1.0,").unwrap() + 5;
    bytes[at] = 0xff;
    files.insert("rates.csv", bytes);
    check(
        &files,
        &["b/rates.csv, line 4", "column wx_rad_s", "a finite number"],
    );
}

#[test]
fn quoted_cell_without_an_end() {
    let files = cell_changed("stars.csv", 4, "quality", "\"good");
    check(&files, &["b/stars.csv", "line 4", "quote"]);
}
