//! The tables of a bundle and their columns.
//!
//! Source: telemetry bundle format, the table of files (docs/formats/bundle.md).

use crate::pixel_name;

/// Names of the tables, as in file names.
pub(crate) const TABLES: [&str; 7] = [
    "attitude",
    "stars",
    "images",
    "reference",
    "rates",
    "catalog",
    "housekeeping",
];

/// What a cell of a column may hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// A finite number.
    Number,
    /// A finite number, or nothing: empty or `nan`.
    NumberOrBlank,
    /// A whole number.
    Integer,
}

/// Whether a column must be there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Need {
    Required,
    Optional,
    /// All columns of this group, or none of them.
    Together(u8),
}

/// A column of the format.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Column {
    pub(crate) name: &'static str,
    pub(crate) kind: Kind,
    pub(crate) need: Need,
}

const fn column(name: &'static str, kind: Kind, need: Need) -> Column {
    Column { name, kind, need }
}

const fn required(name: &'static str) -> Column {
    column(name, Kind::Number, Need::Required)
}

const fn together(name: &'static str, group: u8) -> Column {
    column(name, Kind::Number, Need::Together(group))
}

/// What the columns beyond those of the format are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rest {
    /// Kept as they are.
    Extra,
    /// Numeric channels.
    Channels,
    /// Pixels, where the name is one; else kept.
    Pixels,
}

/// A table of the format.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layout {
    pub(crate) table: &'static str,
    pub(crate) columns: &'static [Column],
    pub(crate) rest: Rest,
}

const T_S: Column = required("t_s");
const SLOT: Column = column("slot", Kind::Integer, Need::Required);
const STAR_ID: Column = column("star_id", Kind::Integer, Need::Required);

pub(crate) const ATTITUDE: Layout = Layout {
    table: "attitude",
    columns: &[
        T_S,
        required("qx"),
        required("qy"),
        required("qz"),
        required("qw"),
    ],
    rest: Rest::Extra,
};

pub(crate) const STARS: Layout = Layout {
    table: "stars",
    columns: &[
        T_S,
        SLOT,
        STAR_ID,
        required("x_px"),
        required("y_px"),
        column("mag", Kind::Number, Need::Optional),
        column("flux", Kind::Number, Need::Optional),
    ],
    rest: Rest::Extra,
};

pub(crate) const IMAGES: Layout = Layout {
    table: "images",
    columns: &[
        T_S,
        SLOT,
        required("x0_px"),
        required("y0_px"),
        required("background"),
    ],
    rest: Rest::Pixels,
};

pub(crate) const REFERENCE: Layout = Layout {
    table: "reference",
    columns: &[
        T_S,
        required("qx"),
        required("qy"),
        required("qz"),
        required("qw"),
        together("wx_rad_s", 0),
        together("wy_rad_s", 0),
        together("wz_rad_s", 0),
        together("sx_arcsec", 1),
        together("sy_arcsec", 1),
        together("sz_arcsec", 1),
    ],
    rest: Rest::Extra,
};

pub(crate) const RATES: Layout = Layout {
    table: "rates",
    columns: &[
        T_S,
        required("wx_rad_s"),
        required("wy_rad_s"),
        required("wz_rad_s"),
    ],
    rest: Rest::Extra,
};

pub(crate) const CATALOG: Layout = Layout {
    table: "catalog",
    columns: &[
        STAR_ID,
        required("ra_deg"),
        required("dec_deg"),
        required("mag"),
        column("bv", Kind::NumberOrBlank, Need::Required),
        together("pm_ra_mas_yr", 0),
        together("pm_dec_mas_yr", 0),
        column("parallax_mas", Kind::Number, Need::Optional),
    ],
    rest: Rest::Extra,
};

pub(crate) const HOUSEKEEPING: Layout = Layout {
    table: "housekeeping",
    columns: &[T_S],
    rest: Rest::Channels,
};

const LAYOUTS: [&Layout; 7] = [
    &ATTITUDE,
    &STARS,
    &IMAGES,
    &REFERENCE,
    &RATES,
    &CATALOG,
    &HOUSEKEEPING,
];

/// Columns that a table has by the format.
pub(crate) fn column_names(table: &str) -> Vec<&'static str> {
    LAYOUTS
        .iter()
        .filter(|layout| layout.table == table)
        .flat_map(|layout| layout.columns)
        .map(|column| column.name)
        .collect()
}

/// Whether a column of this name means something in the table.
pub(crate) fn has_column(table: &str, name: &str) -> bool {
    column_names(table).contains(&name)
        || table == "housekeeping"
        || (table == "images" && pixel_name::parse(name).is_some())
}
