//! Faults inside tables.

use telemetry::Bundle;

use super::common::{fixture, text};
use super::files::gzipped;
use super::{cell_changed, changed, check, line_changed};

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
            "the key may be left out",
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
