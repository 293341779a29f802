//! Faults of files as such: gzip and Parquet.

use std::io::Write as _;

use flate2::Compression;
use flate2::write::GzEncoder;
use telemetry::{Bundle, MemoryFiles, TableFormat};

use super::common::{fixture, refusal, text};
use super::{cell_changed, check};

pub(super) fn gzipped(bytes: &[u8]) -> Vec<u8> {
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
    let none = "expected a gzip file, as its name ends in .gz, found none";
    check(&files, &["b/stars.csv.gz: ", none]);
    assert!(!refusal(&files).contains("line"), "no line of it was read");
}

/// Bytes that changed on the way make a row that cannot be read, long before the checksum that tells it.
#[test]
fn damaged_bytes_are_not_blamed_on_a_column() {
    let mut files = fixture("complete");
    let stars = text(&files, "stars.csv");
    files.remove("stars.csv");
    let comma = stars.match_indices(',').nth(30).unwrap().0;
    let mut gzip = GzEncoder::new(Vec::new(), Compression::none());
    gzip.write_all(stars.as_bytes()).unwrap();
    let mut bytes = gzip.finish().unwrap();
    let head = bytes.len() - stars.len() - 8;
    assert_eq!(bytes[head + comma], b',', "stored as it is");
    bytes[head + comma] = b'7';
    files.insert("stars.csv.gz", bytes);
    let message = refusal(&files);
    for part in ["b/stars.csv.gz, after line", "expected a whole gzip stream"] {
        assert!(message.contains(part), "{message}");
    }
    assert!(!message.contains("column"), "{message}");
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
        &fixture("brotli_columns"),
        &[
            "b/attitude.parquet",
            "column t_s",
            "expected snappy, zstd, gzip or LZ4 compression or none",
            "found brotli",
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
