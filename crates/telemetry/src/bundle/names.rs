//! Which files of a folder are tables of a bundle, and which look like some and are not.
//!
//! Source: telemetry bundle format, the names of tables (docs/formats/bundle.md).

use super::{TableFormat, table_files};
use crate::{Files, TelemetryError, layout};

/// Tables that boresight writes beside a bundle or anywhere: never meant to be read as one of it.
const RESULTS: [&str; 5] = [
    "residuals_stars.parquet",
    "residuals_attitude.parquet",
    "dark_map.csv",
    "psd.csv",
    "draws.csv",
];

/// Ends of what is no table, whatever it is called.
const NO_TABLES: [&str; 7] = [".html", ".jpg", ".md", ".pdf", ".png", ".svg", ".toml"];

/// Names of files, of a bundle and beside it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TableFiles {
    /// Tables of the format, in its order.
    pub read: Vec<String>,
    /// Files that look like tables and are not read, by the alphabet: tables by the end of the name, or called as
    /// a table of the format.
    pub unread: Vec<String>,
}

impl TableFiles {
    /// Looks at the names of files.
    ///
    /// ```
    /// use telemetry::{MemoryFiles, TableFiles};
    /// let files = MemoryFiles::new("night").with("stars.csv", "").with("Reference.csv", "");
    /// let tables = TableFiles::of(&files)?;
    /// assert_eq!((tables.read, tables.unread), (vec!["stars.csv".into()], vec!["Reference.csv".into()]));
    /// # Ok::<(), telemetry::TelemetryError>(())
    /// ```
    ///
    /// # Errors
    ///
    /// What the operating system says.
    pub fn of(files: &dyn Files) -> Result<Self, TelemetryError> {
        let names = files.names();
        let mut names =
            names.map_err(|error| TelemetryError::io(files.label(), "read the folder", &error))?;
        let read: Vec<String> = table_files().filter(|name| names.contains(name)).collect();
        names.retain(|name| !read.contains(name) && looks_like_a_table(name));
        names.sort_unstable();
        Ok(Self {
            read,
            unread: names,
        })
    }

    /// What to say of files that are not read; `None` where there are none.
    #[must_use]
    pub fn warning(&self) -> Option<String> {
        if self.unread.is_empty() {
            return None;
        }
        Some(format!(
            "not read, though by their names they may be tables: {}; tables have the names {}, in small letters, and end in {}",
            self.unread.join(", "),
            layout::TABLES.join(", "),
            TableFormat::ALL.map(TableFormat::extension).join(", ")
        ))
    }
}

fn looks_like_a_table(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    let ends = |form: TableFormat| name.ends_with(form.extension());
    let hidden = name.starts_with('.');
    let named = layout::TABLES.iter().any(|table| name.starts_with(table));
    let other = NO_TABLES.iter().any(|end| name.ends_with(end));
    (named || TableFormat::ALL.into_iter().any(ends))
        && !hidden
        && !other
        && !RESULTS.contains(&name.as_str())
}
