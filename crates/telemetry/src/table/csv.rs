//! Tables as CSV, plain or gzipped.
//!
//! Lines are split here rather than by the `csv` crate, whose line numbers are one too low after
//! CRLF and blank lines; a line with quotes is handed to it.
//!
//! Source: RFC 4180; RFC 1952 (gzip).

use std::io::{self, BufRead, BufReader, Cursor, Read};

use flate2::read::MultiGzDecoder;

use super::{Builder, RawTable, Setting};
use crate::{Place, Source, TelemetryError};

/// What messages call the compressed file.
const GZIP: &str = "gzip stream";

/// Its first bytes.
const GZIP_MAGIC: &[u8] = b"\x1f\x8b";

/// One read of the file system.
const BUFFER: usize = 1 << 18;

/// Reads a table.
pub(crate) fn read(
    file: &str,
    source: Source,
    gzip: bool,
    setting: Setting<'_>,
) -> Result<RawTable, TelemetryError> {
    let raw: Box<dyn Read> = match source {
        Source::File(file) => Box::new(file),
        Source::Memory(bytes) => Box::new(Cursor::new(bytes)),
    };
    let plain: Box<dyn Read> = if gzip {
        let mut packed = BufReader::with_capacity(BUFFER, raw);
        refuse_plain(file, &mut packed)?;
        Box::new(MultiGzDecoder::new(packed))
    } else {
        raw
    };
    let mut lines = Lines {
        file,
        gzip,
        reader: BufReader::with_capacity(BUFFER, plain),
        line: 0,
        first: 0,
        text: Vec::new(),
    };
    rows(&mut lines, setting).map_err(|error| match error {
        TelemetryError::Broken { what: GZIP, .. } => error,
        _ => lines.damage().unwrap_or(error),
    })
}

/// A file that does not begin as gzip does is none, rather than a damaged one.
fn refuse_plain(file: &str, packed: &mut impl BufRead) -> Result<(), TelemetryError> {
    let head = packed.fill_buf();
    let head = head.map_err(|error| TelemetryError::io(file, "read", &error))?;
    // one that ends before is told as such
    if head.iter().zip(GZIP_MAGIC).all(|(a, b)| a == b) {
        return Ok(());
    }
    Err(TelemetryError::InFile {
        file: file.into(),
        reason: "expected a gzip file, as its name ends in .gz, found none: it does not begin as gzip does (plain text belongs under a name that ends in .csv)".into(),
    })
}

fn rows(lines: &mut Lines<'_>, setting: Setting<'_>) -> Result<RawTable, TelemetryError> {
    let file = lines.file;
    let mut builder = Builder::new(file, lines.header()?, setting)?;
    while lines.next()? {
        let place = Place::Line(lines.first);
        let text = lines.text.as_slice();
        if text.trim_ascii().is_empty() {
            continue;
        }
        builder.begin_rows(1);
        if text.contains(&b'"') {
            let cells = quoted(file, text, place)?;
            if cells.len() != builder.width() {
                return Err(builder.row_length(place, cells.len()));
            }
            for (column, cell) in cells.iter().enumerate() {
                builder.text(column, 0, cell, place)?;
            }
        } else {
            let got = 1 + text.iter().filter(|&&b| b == b',').count();
            if got != builder.width() {
                return Err(builder.row_length(place, got));
            }
            for (column, cell) in text.split(|&b| b == b',').enumerate() {
                builder.text(column, 0, cell, place)?;
            }
        }
        builder.end_row(place);
    }
    builder.finish()
}

/// The cells of a line that has quotes.
fn quoted(file: &str, text: &[u8], place: Place) -> Result<csv::ByteRecord, TelemetryError> {
    let mut record = csv::ByteRecord::new();
    csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .from_reader(text)
        .read_byte_record(&mut record)
        .map_err(|error| TelemetryError::Broken {
            file: file.into(),
            place,
            what: "line of CSV",
            reason: error.to_string(),
        })?;
    Ok(record)
}

struct Lines<'a> {
    file: &'a str,
    gzip: bool,
    reader: BufReader<Box<dyn Read>>,
    /// Lines read so far.
    line: u64,
    /// Line at which the present text begins.
    first: u64,
    text: Vec<u8>,
}

impl Lines<'_> {
    /// Reads the next line, and more of them while a quoted cell goes on; `false` at the end.
    fn next(&mut self) -> Result<bool, TelemetryError> {
        self.text.clear();
        self.first = self.line + 1;
        loop {
            let before = self.text.len();
            let got = self.reader.read_until(b'\n', &mut self.text);
            if got.map_err(|error| self.broken(&error))? == 0 {
                if before == 0 {
                    return Ok(false);
                }
                return Err(TelemetryError::Broken {
                    file: self.file.into(),
                    place: Place::Line(self.first),
                    what: "quoted cell",
                    reason: "no closing quote".into(),
                });
            }
            self.line += 1;
            let quotes = self.text.iter().filter(|&&b| b == b'"').count();
            if quotes % 2 == 0 {
                break;
            }
        }
        while let Some(b'\n' | b'\r') = self.text.last() {
            self.text.pop();
        }
        Ok(true)
    }

    /// What is wrong with a gzip stream as such: its checksum stands at its end, so that a row of damaged
    /// bytes is met before it. None where the row itself is to blame.
    fn damage(&mut self) -> Option<TelemetryError> {
        if !self.gzip {
            return None;
        }
        let sound = self.first.saturating_sub(1);
        let error = io::copy(&mut self.reader, &mut io::sink()).err()?;
        self.line = sound;
        Some(self.broken(&error))
    }

    fn header(&mut self) -> Result<Vec<String>, TelemetryError> {
        if !self.next()? {
            return Ok(Vec::new());
        }
        let text = self
            .text
            .strip_prefix(b"\xef\xbb\xbf")
            .unwrap_or(&self.text);
        if let Err(error) = std::str::from_utf8(text) {
            let reason = if text.starts_with(GZIP_MAGIC) {
                "gzip, which belongs under a name that ends in .csv.gz".into()
            } else {
                error.to_string()
            };
            return Err(TelemetryError::Broken {
                file: self.file.into(),
                place: Place::Line(0),
                what: "header in UTF-8",
                reason,
            });
        }
        if text.trim_ascii().is_empty() {
            return Ok(Vec::new());
        }
        let cells = quoted(self.file, text, Place::Line(1))?;
        let name = |cell: &[u8]| String::from_utf8_lossy(cell).trim().to_owned();
        Ok(cells.iter().map(name).collect())
    }

    fn broken(&self, error: &io::Error) -> TelemetryError {
        if !self.gzip {
            return TelemetryError::io(self.file, "read", error);
        }
        let reason = match error.kind() {
            io::ErrorKind::UnexpectedEof => "that it ends early".into(),
            _ => error.to_string(),
        };
        TelemetryError::Broken {
            file: self.file.into(),
            place: Place::Line(self.line),
            what: GZIP,
            reason,
        }
    }
}
