//! Writing tables, row by row or block by block: no second copy of a column is made.
//!
//! Numbers are written with the fewest digits that read back as the same double.
//!
//! Source: RFC 4180; Apache Parquet format, snappy compression.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::io::{self, Write};
use std::sync::Arc;

use arrow_array::{ArrayRef, BooleanArray, Float64Array, Int64Array, RecordBatch, StringArray};
use arrow_schema::{ArrowError, DataType, Field, Schema};
use flate2::Compression;
use flate2::write::GzEncoder;
use parquet::arrow::ArrowWriter;
use parquet::basic::Compression as ParquetCompression;
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;

use crate::{ExtraCells, ExtraColumn, TableFormat, TelemetryError, TextCells};

/// Within 2 % of the size of level 6, in 40 % of its time.
const GZIP_LEVEL: Compression = Compression::new(3);
/// Rows of Parquet made at once.
const BATCH: usize = 8192;
/// Rows of a row group: what is held in memory, encoded.
const GROUP: usize = 1 << 17;
/// Bytes of the distinct values of a column in a row group, up to which they are listed once: stars are, and
/// times of frames with more than eight of them; measured values, of which hardly two are alike, cost no
/// search for long.
const LISTED: usize = 1 << 17;

/// The cells of a column, by row.
pub(crate) enum Cells<'a> {
    /// NaN is written as an empty cell, or null.
    Numbers(Box<dyn Fn(usize) -> f64 + 'a>),
    Integers(Box<dyn Fn(usize) -> i64 + 'a>),
    Flags(Box<dyn Fn(usize) -> bool + 'a>),
    Text(&'a TextCells),
}

/// A table to be written.
pub(crate) struct OutTable<'a> {
    rows: usize,
    columns: Vec<(Cow<'a, str>, Cells<'a>)>,
}

impl<'a> OutTable<'a> {
    pub(crate) fn new(rows: usize) -> Self {
        Self {
            rows,
            columns: Vec::new(),
        }
    }

    pub(crate) fn numbers_by(
        &mut self,
        name: impl Into<Cow<'a, str>>,
        cell: impl Fn(usize) -> f64 + 'a,
    ) {
        self.columns
            .push((name.into(), Cells::Numbers(Box::new(cell))));
    }

    pub(crate) fn numbers(&mut self, name: impl Into<Cow<'a, str>>, cells: &'a [f64]) {
        self.numbers_by(name, |row| cells[row]);
    }

    pub(crate) fn integers_by(
        &mut self,
        name: impl Into<Cow<'a, str>>,
        cell: impl Fn(usize) -> i64 + 'a,
    ) {
        self.columns
            .push((name.into(), Cells::Integers(Box::new(cell))));
    }

    pub(crate) fn flags(&mut self, name: impl Into<Cow<'a, str>>, cells: &'a [bool]) {
        self.columns
            .push((name.into(), Cells::Flags(Box::new(|row| cells[row]))));
    }

    pub(crate) fn extra(&mut self, columns: &'a [ExtraColumn]) {
        for ExtraColumn { name, cells } in columns {
            match cells {
                ExtraCells::Numbers(cells) => self.numbers(name.as_str(), cells),
                ExtraCells::Text(cells) => {
                    self.columns.push((name.into(), Cells::Text(cells)));
                }
            }
        }
    }

    /// Writes in one of the forms; `file` is the name in messages.
    pub(crate) fn write<'w>(
        &self,
        format: TableFormat,
        to: impl Write + Send + 'w,
        file: &str,
    ) -> Result<(), TelemetryError> {
        let mut writer = TableWriter::begin(self, format, Box::new(to), file)?;
        writer.append(self)?;
        writer.finish()
    }

    fn csv_rows<W: Write>(&self, csv: &mut csv::Writer<W>) -> io::Result<()> {
        let mut text = String::new();
        for row in 0..self.rows {
            for (_, cells) in &self.columns {
                text.clear();
                match cells {
                    Cells::Numbers(cell) => number(&mut text, cell(row)),
                    Cells::Integers(cell) => plain(&mut text, cell(row)),
                    Cells::Flags(cell) => plain(&mut text, cell(row)),
                    Cells::Text(cells) => text.push_str(cells.get(row).unwrap_or("")),
                }
                csv.write_field(&text)?;
            }
            csv.write_record(None::<&[u8]>)?;
        }
        Ok(())
    }

    fn names(&self) -> Vec<&str> {
        self.columns.iter().map(|(name, _)| &**name).collect()
    }

    /// The cells as Parquet has them: text that is all numbers, as extra columns of a CSV file are,
    /// becomes numbers.
    fn parquet_cells(&self) -> Vec<Cells<'_>> {
        let cells = self.columns.iter();
        cells.map(|(_, cells)| cells.for_parquet()).collect()
    }

    fn parquet_rows<W: Write + Send>(
        &self,
        writer: &mut ArrowWriter<W>,
    ) -> Result<(), ParquetError> {
        let (cells, schema) = (self.parquet_cells(), schema(self));
        for start in (0..self.rows).step_by(BATCH) {
            let end = self.rows.min(start + BATCH);
            let arrays = cells.iter().map(|cells| cells.array(start, end));
            let batch = RecordBatch::try_new(Arc::clone(&schema), arrays.collect());
            writer.write(&batch.map_err(|error: ArrowError| error)?)?;
        }
        Ok(())
    }
}

fn schema(table: &OutTable<'_>) -> Arc<Schema> {
    let cells = table.parquet_cells();
    let fields = table.names().into_iter().zip(&cells);
    let fields = fields.map(|(name, cells)| Field::new(name, cells.data_type(), true));
    Arc::new(Schema::new(fields.collect::<Vec<_>>()))
}

type Sink<'w> = Box<dyn Write + Send + 'w>;

enum Form<'w> {
    Csv(csv::Writer<Sink<'w>>),
    CsvGz(csv::Writer<GzEncoder<Sink<'w>>>),
    Parquet(ArrowWriter<Sink<'w>>),
}

/// A table that grows piece by piece: what is held does not depend on its length.
pub(crate) struct TableWriter<'w> {
    file: String,
    /// Columns of the first piece, which all others must have.
    names: Vec<String>,
    form: Form<'w>,
}

impl<'w> TableWriter<'w> {
    /// Begins a table with the columns of `table`, whose rows are not written yet; `file` is the name
    /// in messages.
    pub(crate) fn begin(
        table: &OutTable<'_>,
        format: TableFormat,
        to: Sink<'w>,
        file: &str,
    ) -> Result<Self, TelemetryError> {
        let form = Form::begin(table, format, to);
        Ok(Self {
            file: file.to_owned(),
            names: table.names().into_iter().map(str::to_owned).collect(),
            form: form.map_err(|error| TelemetryError::io(file, "write", &error))?,
        })
    }

    /// Adds rows of the same columns.
    pub(crate) fn append(&mut self, table: &OutTable<'_>) -> Result<(), TelemetryError> {
        if table.names() != self.names {
            return Err(TelemetryError::Inconsistent {
                table: "bundle",
                reason: format!("a piece of {} has other columns than the first", self.file),
            });
        }
        let done = match &mut self.form {
            Form::Csv(csv) => table.csv_rows(csv),
            Form::CsvGz(csv) => table.csv_rows(csv),
            Form::Parquet(writer) => table.parquet_rows(writer).map_err(io::Error::other),
        };
        done.map_err(|error| TelemetryError::io(&*self.file, "write", &error))
    }

    pub(crate) fn finish(self) -> Result<(), TelemetryError> {
        let done = match self.form {
            Form::Csv(csv) => into_inner(csv).and_then(|mut to| to.flush()),
            Form::CsvGz(csv) => into_inner(csv).and_then(|gzip| gzip.finish()?.flush()),
            Form::Parquet(writer) => writer.close().map(|_| ()).map_err(io::Error::other),
        };
        done.map_err(|error| TelemetryError::io(&*self.file, "write", &error))
    }
}

impl<'w> Form<'w> {
    fn begin(table: &OutTable<'_>, format: TableFormat, to: Sink<'w>) -> io::Result<Self> {
        match format {
            TableFormat::Csv => csv_with_header(table, to).map(Self::Csv),
            TableFormat::CsvGz => {
                csv_with_header(table, GzEncoder::new(to, GZIP_LEVEL)).map(Self::CsvGz)
            }
            TableFormat::Parquet => {
                let properties = WriterProperties::builder()
                    .set_compression(ParquetCompression::SNAPPY)
                    .set_max_row_group_row_count(Some(GROUP))
                    .set_dictionary_page_size_limit(LISTED)
                    .build();
                let writer = ArrowWriter::try_new(to, schema(table), Some(properties));
                writer.map(Self::Parquet).map_err(io::Error::other)
            }
        }
    }
}

fn csv_with_header<W: Write>(table: &OutTable<'_>, to: W) -> io::Result<csv::Writer<W>> {
    let mut csv = csv::WriterBuilder::new()
        .buffer_capacity(1 << 16)
        .from_writer(to);
    csv.write_record(table.names())?;
    Ok(csv)
}

fn into_inner<W: Write>(csv: csv::Writer<W>) -> io::Result<W> {
    csv.into_inner().map_err(|error| error.into_error())
}

impl Cells<'_> {
    fn for_parquet(&self) -> Cells<'_> {
        match self {
            Self::Numbers(cell) => Cells::Numbers(Box::new(cell)),
            Self::Integers(cell) => Cells::Integers(Box::new(cell)),
            Self::Flags(cell) => Cells::Flags(Box::new(cell)),
            Self::Text(cells) => {
                let number = |cell: &str| cell.is_empty() || cell.parse::<f64>().is_ok();
                if !cells.iter().all(number) {
                    return Cells::Text(cells);
                }
                let cell = |row| cells.get(row).unwrap_or("").parse().unwrap_or(f64::NAN);
                Cells::Numbers(Box::new(cell))
            }
        }
    }

    fn data_type(&self) -> DataType {
        match self {
            Self::Numbers(_) => DataType::Float64,
            Self::Integers(_) => DataType::Int64,
            Self::Flags(_) => DataType::Boolean,
            Self::Text(_) => DataType::Utf8,
        }
    }

    fn array(&self, start: usize, end: usize) -> ArrayRef {
        let rows = start..end;
        match self {
            Self::Numbers(cell) => {
                let value = |row| Some(cell(row)).filter(|number| !number.is_nan());
                Arc::new(rows.map(value).collect::<Float64Array>())
            }
            Self::Integers(cell) => Arc::new(Int64Array::from_iter_values(rows.map(cell))),
            Self::Flags(cell) => Arc::new(BooleanArray::from_iter(rows.map(|row| Some(cell(row))))),
            Self::Text(cells) => {
                let value = |row| cells.get(row);
                Arc::new(rows.map(value).collect::<StringArray>())
            }
        }
    }
}

fn plain(text: &mut String, value: impl std::fmt::Display) {
    // writing to memory does not fail
    let _ = write!(text, "{value}");
}

/// The shortest digits that read back the same; an exponent where plain digits would be long.
fn number(text: &mut String, value: f64) {
    let size = value.abs();
    if value.is_nan() {
        // a missing value
    } else if size != 0.0 && !(1e-9..1e17).contains(&size) {
        let _ = write!(text, "{value:e}");
    } else {
        let _ = write!(text, "{value}");
    }
}
