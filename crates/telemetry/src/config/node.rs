//! The tree of a TOML file, with the place of each key and value: what the parser gives, without
//! its borrow of the text.
//!
//! Source: TOML 1.1.

use std::collections::BTreeMap;
use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

pub(super) type Table = BTreeMap<String, Node>;

/// A value and where it stands, in bytes.
#[derive(Clone, Debug)]
pub(super) struct Node {
    /// Of its key; of the value itself for an item of an array.
    pub(super) key_span: Range<usize>,
    pub(super) span: Range<usize>,
    pub(super) value: Value,
}

#[derive(Clone, Debug)]
pub(super) enum Value {
    Text(String),
    Whole(i64),
    Float(f64),
    Switch(bool),
    /// A date, or a number that fits no type of ours.
    Other,
    Array(Vec<Node>),
    Table(Table),
}

pub(super) fn table(table: &DeTable<'_>) -> Table {
    table
        .iter()
        .map(|(key, value)| (key.get_ref().to_string(), node(key.span(), value)))
        .collect()
}

fn node(key_span: Range<usize>, value: &Spanned<DeValue<'_>>) -> Node {
    Node {
        key_span,
        span: value.span(),
        value: self::value(value.get_ref()),
    }
}

fn value(value: &DeValue<'_>) -> Value {
    match value {
        DeValue::String(text) => Value::Text(text.to_string()),
        DeValue::Integer(digits) => {
            i64::from_str_radix(digits.as_str(), digits.radix()).map_or(Value::Other, Value::Whole)
        }
        DeValue::Float(digits) => digits.as_str().parse().map_or(Value::Other, Value::Float),
        DeValue::Boolean(on) => Value::Switch(*on),
        DeValue::Datetime(_) => Value::Other,
        DeValue::Array(items) => {
            Value::Array(items.iter().map(|item| node(item.span(), item)).collect())
        }
        DeValue::Table(inner) => Value::Table(table(inner)),
    }
}
