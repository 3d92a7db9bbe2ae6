//! Records in a TOML file: the tree of the JSON file, its lists as arrays of tables.

use serde_json::Value;

use super::super::RecordError;
use super::{Raw, json_file};
use crate::engine::budget::Room;
use crate::engine::json::{self, RETRY_AFTER};
use crate::engine::{Error, SyntaxFault};

/// What the tree of a TOML file takes of memory, at most about so many times its size.
const TREE: usize = 30;

pub(super) fn read(bytes: &[u8], room: &Room) -> Result<Vec<Raw>, RecordError> {
    if !room.take(TREE * bytes.len()) {
        return Err(Error::Busy { retry_after: RETRY_AFTER }.into());
    }
    let text = std::str::from_utf8(bytes).map_err(|error| broken(&error.to_string(), bytes, error.valid_up_to()))?;
    let tree: Value = toml::from_str(text)
        .map_err(|error| broken(error.message(), bytes, error.span().map_or(0, |span| span.start)))?;
    json_file::records(plain(tree))
}

pub(super) fn written(tree: Value) -> Result<Vec<u8>, String> {
    toml::to_string(&without_nulls(tree)).map(String::into_bytes).map_err(|error| error.to_string())
}

/// TOML has no null: what a part of a job says so is left out.
fn without_nulls(value: Value) -> Value {
    match value {
        Value::Array(items) => items.into_iter().filter(|item| !item.is_null()).map(without_nulls).collect(),
        Value::Object(fields) => fields
            .into_iter()
            .filter(|(_, value)| !value.is_null())
            .map(|(name, value)| (name, without_nulls(value)))
            .collect(),
        other => other,
    }
}

/// Whole numbers as integers however they are spelled, as JSON is read; a date is its text.
fn plain(value: Value) -> Value {
    const DATE: &str = "$__toml_private_datetime";
    match value {
        Value::Number(number) => number.as_f64().and_then(json::number).unwrap_or(Value::Number(number)),
        Value::Array(items) => items.into_iter().map(plain).collect(),
        Value::Object(mut fields) if fields.contains_key(DATE) => fields.remove(DATE).unwrap_or_default(),
        Value::Object(fields) => fields.into_iter().map(|(name, value)| (name, plain(value))).collect(),
        other => other,
    }
}

fn broken(reason: &str, bytes: &[u8], at: usize) -> Error {
    let before = &bytes[..at.min(bytes.len())];
    #[allow(clippy::naive_bytecount)] // once, of a refused body
    let line = 1 + before.iter().filter(|byte| **byte == b'\n').count();
    let column = 1 + before.iter().rev().take_while(|byte| **byte != b'\n').count();
    Error::Syntax(SyntaxFault { code: "bad_syntax", pointer: String::new(), line, column, message: reason.to_owned() })
}
