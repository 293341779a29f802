//! Faults of `bundle.toml`, and values out of their range.

use telemetry::Bundle;

use super::common::{fixture, text};
use super::{cell_changed, changed, check};

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

/// 512 px to the edge, and a twentieth of 1024 px more.
#[test]
fn stars_beyond_the_edge() {
    for near in ["563.1", "-563.1"] {
        Bundle::read_from(&cell_changed("stars.csv", 3, "x_px", near)).unwrap();
    }
    for beyond in ["563.3", "-900"] {
        let files = cell_changed("stars.csv", 3, "x_px", beyond);
        let allowed =
            "within 563.2 px of its centre (512 px to the edge, and 5 % of the side beyond)";
        check(
            &files,
            &["b/stars.csv, line 3, column x_px", allowed, beyond],
        );
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
