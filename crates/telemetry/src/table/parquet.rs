//! Tables as Parquet.
//!
//! Source: Apache Parquet format; read through the Arrow reader, batch by batch.

use std::fs::File;

use arrow_array::cast::AsArray;
use arrow_array::types::{
    ArrowPrimitiveType, Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type,
    UInt8Type, UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{Array, ArrayRef, RecordBatch};
use arrow_schema::DataType;
use bytes::Bytes;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::basic::Compression;
use parquet::file::metadata::RowGroupMetaData;
use parquet::file::reader::ChunkReader;

use super::{Builder, RawTable, Setting};
use crate::{Place, Source, TelemetryError};

/// Rows read at once.
const BATCH: usize = 8192;

/// Reads a table.
pub(crate) fn read(
    file: &str,
    source: Source,
    setting: Setting<'_>,
) -> Result<RawTable, TelemetryError> {
    match source {
        Source::File(opened) => read_chunks::<File>(file, opened, setting),
        Source::Memory(bytes) => read_chunks(file, Bytes::from(bytes.into_owned()), setting),
    }
}

fn read_chunks<C: ChunkReader + 'static>(
    file: &str,
    chunks: C,
    setting: Setting<'_>,
) -> Result<RawTable, TelemetryError> {
    let broken = |rows: usize, reason: String| TelemetryError::Broken {
        file: file.into(),
        place: Place::Row(rows as u64),
        what: "Parquet file",
        reason,
    };
    let opened = ParquetRecordBatchReaderBuilder::try_new(chunks)
        .map_err(|error| broken(0, error.to_string()))?;
    let fields = opened.schema().fields().clone();
    let header = fields.iter().map(|field| field.name().trim().to_owned());
    let mut builder = Builder::new(file, header.collect(), setting)?;
    for column in opened
        .metadata()
        .row_groups()
        .iter()
        .flat_map(RowGroupMetaData::columns)
    {
        let compression = column.compression();
        let read = match compression {
            Compression::UNCOMPRESSED
            | Compression::SNAPPY
            | Compression::GZIP(_)
            | Compression::ZSTD(_)
            | Compression::LZ4
            | Compression::LZ4_RAW => true,
            Compression::BROTLI(_) | Compression::LZO => false,
        };
        if !read {
            return Err(TelemetryError::Compression {
                file: file.into(),
                column: column.column_path().string(),
                found: compression.to_string().to_lowercase(),
            });
        }
    }
    let batches = opened
        .with_batch_size(BATCH)
        .build()
        .map_err(|error| broken(0, error.to_string()))?;
    for batch in batches {
        let batch = batch.map_err(|error| broken(builder.rows(), error.to_string()))?;
        take(&mut builder, &batch)?;
    }
    builder.finish()
}

fn take(builder: &mut Builder, batch: &RecordBatch) -> Result<(), TelemetryError> {
    let rows = batch.num_rows();
    builder.begin_rows(rows);
    for (column, array) in batch.columns().iter().enumerate() {
        match array.data_type() {
            DataType::Float64 => numbers::<Float64Type>(builder, column, array, |x| x)?,
            DataType::Float32 => numbers::<Float32Type>(builder, column, array, f64::from)?,
            DataType::Int8 => integers::<Int8Type>(builder, column, array)?,
            DataType::Int16 => integers::<Int16Type>(builder, column, array)?,
            DataType::Int32 => integers::<Int32Type>(builder, column, array)?,
            DataType::Int64 => integers::<Int64Type>(builder, column, array)?,
            DataType::UInt8 => integers::<UInt8Type>(builder, column, array)?,
            DataType::UInt16 => integers::<UInt16Type>(builder, column, array)?,
            DataType::UInt32 => integers::<UInt32Type>(builder, column, array)?,
            DataType::UInt64 => integers::<UInt64Type>(builder, column, array)?,
            DataType::Boolean if !builder.is_extra(column) => {
                let cells = array.as_boolean();
                for (ahead, cell) in cells.iter().enumerate() {
                    let place = place(builder, ahead);
                    builder.number(column, ahead, cell.map(|on| f64::from(u8::from(on))), place)?;
                }
            }
            DataType::Utf8 => texts(builder, column, array.as_string::<i32>().iter())?,
            DataType::LargeUtf8 => texts(builder, column, array.as_string::<i64>().iter())?,
            DataType::Utf8View => texts(builder, column, array.as_string_view().iter())?,
            other if !builder.is_extra(column) => {
                let found = format!("a column of type {other}");
                let place = place(builder, 0);
                return Err(builder.cell_error(column, place, "a column of numbers", &found));
            }
            _ => {
                // a type that the format has no use for: kept in words
                let cells: Vec<String> = (0..rows).map(|row| worded(array, row)).collect();
                texts(
                    builder,
                    column,
                    cells.iter().map(|cell| Some(cell.as_str())),
                )?;
            }
        }
    }
    for _ in 0..rows {
        let place = place(builder, 0);
        builder.end_row(place);
    }
    Ok(())
}

/// Place of a row that comes `ahead` rows after the last ended one.
fn place(builder: &Builder, ahead: usize) -> Place {
    Place::Row((builder.rows() + ahead) as u64 + 1)
}

fn numbers<T: ArrowPrimitiveType>(
    builder: &mut Builder,
    column: usize,
    array: &ArrayRef,
    number: impl Fn(T::Native) -> f64,
) -> Result<(), TelemetryError> {
    let cells = array.as_primitive::<T>();
    if builder.is_extra(column) {
        let cells = cells.iter().map(|cell| cell.map_or(f64::NAN, &number));
        builder.extra_numbers(column, cells);
        return Ok(());
    }
    for (ahead, cell) in cells.iter().enumerate() {
        let place = place(builder, ahead);
        builder.number(column, ahead, cell.map(&number), place)?;
    }
    Ok(())
}

/// Whole numbers stay such, so that long ids are exact; where the column is of another kind, or they are
/// too long for it, their digits are read.
fn integers<T: ArrowPrimitiveType>(
    builder: &mut Builder,
    column: usize,
    array: &ArrayRef,
) -> Result<(), TelemetryError>
where
    T::Native: std::fmt::Display + TryInto<i64>,
{
    use std::io::Write as _;
    let mut digits = Vec::new();
    for (ahead, cell) in array.as_primitive::<T>().iter().enumerate() {
        let whole = cell.and_then(|cell| cell.try_into().ok());
        if whole.is_some_and(|whole| builder.whole(column, whole)) {
            continue;
        }
        digits.clear();
        if let Some(cell) = cell {
            // writing to memory does not fail
            let _ = write!(digits, "{cell}");
        }
        let place = place(builder, ahead);
        builder.text(column, ahead, &digits, place)?;
    }
    Ok(())
}

fn texts<'a>(
    builder: &mut Builder,
    column: usize,
    cells: impl Iterator<Item = Option<&'a str>>,
) -> Result<(), TelemetryError> {
    for (ahead, cell) in cells.enumerate() {
        let place = place(builder, ahead);
        builder.text(column, ahead, cell.unwrap_or("").as_bytes(), place)?;
    }
    Ok(())
}

/// A cell of any type in the words of the Arrow library: its debug form has the value on the third
/// line.
fn worded(array: &ArrayRef, row: usize) -> String {
    if array.is_null(row) {
        return String::new();
    }
    let shown = format!("{:?}", array.slice(row, 1));
    let value = shown.lines().nth(2).unwrap_or("");
    value.trim().trim_end_matches(',').to_owned()
}
