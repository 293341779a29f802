//! A table as it comes from a file: columns by the format's names, and the way back from a row to
//! its line.
//!
//! Source: telemetry bundle format, the table of files (docs/formats/bundle.md).

mod cell;
pub(crate) mod csv;
pub(crate) mod parquet;
mod pixels;
mod raw;
pub(crate) mod write;

use std::collections::BTreeMap;

use crate::config::nearest;
use crate::layout::{Kind, Layout, Need, Rest};
use crate::{ExtraCells, ExtraColumn, ImagesMeta, Place, TelemetryError, TextCells, pixel_name};
use cell::{Channel, expected_number, integer, number, shown, whole};
pub(crate) use pixels::PixelBlock;
use raw::Places;
pub(crate) use raw::RawTable;

/// What the metadata say about a table.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Setting<'a> {
    pub(crate) layout: &'static Layout,
    /// Our name to the source's name.
    pub(crate) renamed: Option<&'a BTreeMap<String, String>>,
    pub(crate) images: Option<&'a ImagesMeta>,
}

/// Where the cells of one column of the file go.
#[derive(Debug)]
enum Store {
    Numbers { cells: Vec<f64>, blank: bool },
    Integers(Vec<i64>),
    Pixel { offset: usize, blank: bool },
    Channel(Channel),
    Extra(ExtraCells),
}

/// Collects the rows of a table.
#[derive(Debug)]
pub(crate) struct Builder {
    file: String,
    header: Vec<String>,
    /// Our name for each column of the file.
    names: Vec<String>,
    stores: Vec<Store>,
    pixels: Option<PixelBlock>,
    rows: usize,
    places: Places,
}

impl Builder {
    pub(crate) fn new(
        file: &str,
        header: Vec<String>,
        setting: Setting<'_>,
    ) -> Result<Self, TelemetryError> {
        let layout = setting.layout;
        for (second, name) in header.iter().enumerate() {
            if let Some(first) = header[..second].iter().position(|other| other == name) {
                return Err(TelemetryError::DuplicateColumn {
                    file: file.into(),
                    column: name.clone(),
                    first: first + 1,
                    second: second + 1,
                });
            }
        }
        let names = our_names(file, &header, setting)?;
        check_needs(file, layout, &header, &names)?;
        let pixels = match layout.rest {
            Rest::Pixels => Some(PixelBlock::new(file, &names, &header, setting.images)?),
            _ => None,
        };
        let stores = names
            .iter()
            .map(|name| store(name, layout, pixels.as_ref()))
            .collect();
        Ok(Self {
            file: file.into(),
            header,
            names,
            stores,
            pixels,
            rows: 0,
            places: Places::default(),
        })
    }

    /// Number of columns.
    pub(crate) fn width(&self) -> usize {
        self.header.len()
    }

    pub(crate) fn rows(&self) -> usize {
        self.rows
    }

    /// An error in one cell of the row being read.
    pub(crate) fn cell_error(
        &self,
        column: usize,
        place: Place,
        expected: &str,
        found: &str,
    ) -> TelemetryError {
        TelemetryError::cell(&self.file, place, &self.header[column], expected, found)
    }

    /// A row with the wrong number of cells.
    pub(crate) fn row_length(&self, place: Place, got: usize) -> TelemetryError {
        let need = self.width();
        TelemetryError::RowLength {
            file: self.file.clone(),
            place,
            column: self.header[got.min(need - 1)].clone(),
            need,
            got,
        }
    }

    /// Makes room for the pixels of rows to come.
    pub(crate) fn begin_rows(&mut self, count: usize) {
        if let Some(pixels) = &mut self.pixels {
            pixels.begin_rows(count);
        }
    }

    /// Ends a row whose cells have all been given.
    pub(crate) fn end_row(&mut self, place: Place) {
        self.places.push(self.rows, place);
        self.rows += 1;
    }

    /// One cell of text; `ahead` rows after the last ended one.
    pub(crate) fn text(
        &mut self,
        column: usize,
        ahead: usize,
        cell: &[u8],
        place: Place,
    ) -> Result<(), TelemetryError> {
        let cell = cell.trim_ascii();
        let row = self.rows + ahead;
        let expected = match &mut self.stores[column] {
            Store::Numbers { cells, blank } => match number(cell, *blank) {
                Some(number) => {
                    cells.push(number);
                    return Ok(());
                }
                None => expected_number(*blank),
            },
            Store::Integers(cells) => match integer(cell) {
                Some(number) => {
                    cells.push(number);
                    return Ok(());
                }
                None => "a whole number",
            },
            Store::Pixel { offset, blank } => match number(cell, *blank) {
                Some(number) => {
                    if let Some(pixels) = &mut self.pixels {
                        pixels.set(row, *offset, number);
                    }
                    return Ok(());
                }
                None => expected_number(*blank),
            },
            Store::Channel(channel) => {
                let Err(word) = channel.push(cell, place) else {
                    return Ok(());
                };
                let found = shown(word.text.as_bytes());
                return Err(self.cell_error(column, word.place, &word.expected, &found));
            }
            Store::Extra(ExtraCells::Text(cells)) => {
                cells.push(&String::from_utf8_lossy(cell));
                return Ok(());
            }
            Store::Extra(ExtraCells::Numbers(cells)) => {
                cells.push(number(cell, true).unwrap_or(f64::NAN));
                return Ok(());
            }
        };
        Err(self.cell_error(column, place, expected, &shown(cell)))
    }

    /// One cell of a column of whole numbers; false where it is no such column.
    pub(crate) fn whole(&mut self, column: usize, cell: i64) -> bool {
        let Store::Integers(cells) = &mut self.stores[column] else {
            return false;
        };
        cells.push(cell);
        true
    }

    /// Whether the numbers of a column should be kept as text, so that nothing of them is lost.
    pub(crate) fn is_extra(&self, column: usize) -> bool {
        matches!(self.stores[column], Store::Extra(_))
    }

    /// An extra column whose cells are numbers.
    pub(crate) fn extra_numbers(&mut self, column: usize, cells: impl Iterator<Item = f64>) {
        if let Store::Extra(store) = &mut self.stores[column] {
            if store.is_empty() {
                *store = ExtraCells::Numbers(Vec::new());
            }
            if let ExtraCells::Numbers(numbers) = store {
                numbers.extend(cells);
            }
        }
    }

    /// One cell that is a number, `None` for a null; `ahead` rows after the last ended one.
    pub(crate) fn number(
        &mut self,
        column: usize,
        ahead: usize,
        cell: Option<f64>,
        place: Place,
    ) -> Result<(), TelemetryError> {
        let row = self.rows + ahead;
        let usable = |blank: bool| match cell {
            Some(number) if number.is_finite() => Some(number),
            Some(number) if blank && number.is_nan() => Some(f64::NAN),
            None if blank => Some(f64::NAN),
            _ => None,
        };
        let expected = match &mut self.stores[column] {
            Store::Numbers { cells, blank } => match usable(*blank) {
                Some(number) => {
                    cells.push(number);
                    return Ok(());
                }
                None => expected_number(*blank),
            },
            Store::Integers(cells) => match usable(false).and_then(whole) {
                Some(number) => {
                    cells.push(number);
                    return Ok(());
                }
                None => "a whole number",
            },
            Store::Pixel { offset, blank } => match usable(*blank) {
                Some(number) => {
                    if let Some(pixels) = &mut self.pixels {
                        pixels.set(row, *offset, number);
                    }
                    return Ok(());
                }
                None => expected_number(*blank),
            },
            Store::Channel(channel) => match usable(true) {
                Some(number) => {
                    channel.numbers.push(number);
                    channel.any_number |= !number.is_nan();
                    return Ok(());
                }
                None => expected_number(true),
            },
            Store::Extra(_) => return Ok(()),
        };
        let found = cell.map_or_else(|| "nothing".into(), |number| number.to_string());
        Err(self.cell_error(column, place, expected, &found))
    }

    /// The whole table.
    pub(crate) fn finish(self) -> Result<RawTable, TelemetryError> {
        if self.rows == 0 {
            return Err(TelemetryError::EmptyTable { file: self.file });
        }
        let mut table = RawTable {
            file: self.file,
            numbers: BTreeMap::new(),
            integers: BTreeMap::new(),
            channels: BTreeMap::new(),
            extra: Vec::new(),
            pixels: self.pixels,
            places: self.places,
            source_names: self.names.iter().cloned().zip(self.header).collect(),
        };
        for (name, store) in self.names.into_iter().zip(self.stores) {
            let extra = match store {
                Store::Numbers { cells, .. } => {
                    table.numbers.insert(name, cells);
                    continue;
                }
                Store::Integers(cells) => {
                    table.integers.insert(name, cells);
                    continue;
                }
                Store::Pixel { .. } => continue,
                Store::Channel(channel) => match channel.words {
                    Some(words) => ExtraCells::Text(words.cells),
                    None => {
                        table.channels.insert(name, channel.numbers);
                        continue;
                    }
                },
                Store::Extra(cells) => cells,
            };
            table.extra.push(ExtraColumn { name, cells: extra });
        }
        Ok(table)
    }
}

/// The format's name for each column of the file.
fn our_names(
    file: &str,
    header: &[String],
    setting: Setting<'_>,
) -> Result<Vec<String>, TelemetryError> {
    let mut names = header.to_vec();
    for (ours, theirs) in setting.renamed.into_iter().flatten() {
        let Some(at) = header.iter().position(|name| name == theirs) else {
            let all: Vec<&str> = header.iter().map(String::as_str).collect();
            let near = nearest(theirs, &all).unwrap_or("none");
            return Err(TelemetryError::MissingColumn {
                file: file.into(),
                column: theirs.clone(),
                header: header.join(", "),
                hint: format!(
                    " (bundle.toml reads `{ours}` from it; the nearest that is there is `{near}`)"
                ),
            });
        };
        names[at].clone_from(ours);
    }
    for (second, name) in names.iter().enumerate() {
        if let Some(first) = names[..second].iter().position(|other| other == name) {
            return Err(TelemetryError::DuplicateColumn {
                file: file.into(),
                column: format!("{name} (after the renames of bundle.toml)"),
                first: first + 1,
                second: second + 1,
            });
        }
    }
    Ok(names)
}

fn check_needs(
    file: &str,
    layout: &Layout,
    header: &[String],
    names: &[String],
) -> Result<(), TelemetryError> {
    let there = |name: &str| names.iter().any(|other| other == name);
    for column in layout.columns {
        let needed = match column.need {
            Need::Required => true,
            Need::Optional => false,
            Need::Together(_) => layout
                .columns
                .iter()
                .any(|other| other.need == column.need && there(other.name)),
        };
        if needed && !there(column.name) {
            let (table, name) = (layout.table, column.name);
            let hint = if header.is_empty() {
                String::new()
            } else {
                format!(
                    " (under another name? bundle.toml can say so: [columns.{table}] {name} = \"...\")"
                )
            };
            return Err(TelemetryError::MissingColumn {
                file: file.into(),
                column: name.into(),
                header: if header.is_empty() {
                    "nothing".into()
                } else {
                    header.join(", ")
                },
                hint,
            });
        }
    }
    Ok(())
}

fn store(name: &str, layout: &Layout, pixels: Option<&PixelBlock>) -> Store {
    let known = layout.columns.iter().find(|column| column.name == name);
    if let Some(column) = known {
        return match column.kind {
            Kind::Integer => Store::Integers(Vec::new()),
            kind => Store::Numbers {
                cells: Vec::new(),
                blank: kind == Kind::NumberOrBlank,
            },
        };
    }
    if let (Some(pixels), Some(pixel)) = (pixels, pixel_name::parse(name))
        && let Some(offset) = pixels.offset(pixel)
    {
        return Store::Pixel {
            offset,
            blank: pixels.unread[offset],
        };
    }
    if layout.rest == Rest::Channels {
        return Store::Channel(Channel::default());
    }
    Store::Extra(ExtraCells::Text(TextCells::default()))
}
