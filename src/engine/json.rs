//! Bytes into a JSON value, more strictly than `serde_json` alone: a key twice in one object, bytes after the value,
//! deep nesting, numbers that a double does not hold. `serde_json` would keep the last of two keys without a word.

mod strict;
#[cfg(test)]
mod tests;
mod text;

use std::cell::Cell;
use std::time::Duration;

use serde::de::DeserializeSeed;
use serde_json::{Number, Value};

use super::budget::Room;
use super::error::{Error, SyntaxFault};
use crate::registry::{Faults, Shape, child};
use strict::{Beyond, MOST_UNKNOWN, Step, Strict, Trail};
pub(crate) use text::{top_level_field, with_top_level};

/// Largest whole number that a double and RFC 8785 hold with all its digits: 2^53.
const LARGEST_INTEGER: u64 = 1 << 53;
/// Most characters of a number: the shortest decimal that tells two doubles apart has fewer than 800 digits.
const LONGEST_NUMBER: usize = 1000;
/// So many items of a long list are kept of a body that is read for its faults.
pub(crate) const HEAD_ITEMS: usize = 256;
/// When a client that found no memory should come again.
pub(crate) const RETRY_AFTER: Duration = Duration::from_secs(1);

/// The value of `bytes`, whatever it is.
pub(crate) fn parse(bytes: &[u8]) -> Result<Value, Error> {
    parse_as(bytes, Shape::open(), &Room::default()).map(|parsed| parsed.value)
}

/// What was made of a large body to see what is wrong with it.
#[derive(Debug)]
pub(crate) struct ParsedHead {
    pub(crate) parsed: Parsed,
    /// Where a long list was not kept whole, the faults of its further items.
    pub(crate) beyond: Option<Faults>,
}

/// The value of `bytes` with the first items of long lists only. Each further one is held to what the items of its list
/// have to be, and forgotten: as values they take many times the memory of their text, which a body that is refused
/// anyway shall not.
pub(crate) fn parse_head(bytes: &[u8], shape: &Shape, room: &Room) -> Result<ParsedHead, Error> {
    let beyond = Beyond::default();
    let parsed = parse_with(bytes, shape, room, Some(&beyond))?;
    let Beyond { faults, is_any, .. } = beyond;
    Ok(ParsedHead { parsed, beyond: is_any.get().then(|| faults.into_inner()) })
}

/// What was made of a body.
#[derive(Debug)]
pub(crate) struct Parsed {
    pub(crate) value: Value,
    /// Fields that have no name in the shape and are left out, as there are so many.
    pub(crate) left_out: usize,
}

/// The value of `bytes`. A byte order mark is skipped. Whole numbers are integers however they are spelled (`500.0`,
/// `5e2`), so that a count may be written like any other number.
///
/// Of what does not fit the shape only as much is kept as shows what is wrong: of a field without a name in it the name, of a
/// list where there may be none that it is one, of a list that is too long its most items and how many they are.
pub(crate) fn parse_as(bytes: &[u8], shape: &Shape, room: &Room) -> Result<Parsed, Error> {
    parse_with(bytes, shape, room, None)
}

fn parse_with(bytes: &[u8], shape: &Shape, room: &Room, beyond: Option<&Beyond>) -> Result<Parsed, Error> {
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    if bytes.iter().all(u8::is_ascii_whitespace) {
        let message = "the body is empty".to_owned();
        let fault = SyntaxFault { code: "empty_body", pointer: String::new(), line: 1, column: 1, message };
        return Err(Error::Syntax(fault));
    }
    if let Some(fault) = long_number(bytes) {
        return Err(Error::Syntax(fault));
    }
    let trail = Trail::default();
    let (unknown, width) = (Cell::new(0), Cell::new(0));
    let mut deserializer = serde_json::Deserializer::from_slice(bytes);
    let strict = Strict { trail: &trail, depth: 0, shape, room, unknown: &unknown, width: &width, beyond };
    match strict.deserialize(&mut deserializer) {
        Ok(value) => match deserializer.end() {
            Ok(()) => Ok(Parsed { value, left_out: unknown.get().saturating_sub(MOST_UNKNOWN) }),
            Err(error) => Err(Error::Syntax(fault(&error, Some("trailing_bytes"), String::new()))),
        },
        Err(_) if room.is_spent() => Err(Error::Busy { retry_after: RETRY_AFTER }),
        Err(error) => {
            let pointer = trail.steps.borrow().iter().rev().fold(String::new(), |pointer, step| match step {
                Step::Key(name) => child(&pointer, name),
                Step::Index(index) => format!("{pointer}/{index}"),
            });
            Err(Error::Syntax(fault(&error, trail.code.take(), pointer)))
        }
    }
}

/// The first number with more characters than any number needs: to read it takes memory by its length.
fn long_number(bytes: &[u8]) -> Option<SyntaxFault> {
    if bytes.len() <= LONGEST_NUMBER {
        return None;
    }
    let (mut in_text, mut escaped, mut length) = (false, false, 0_usize);
    for (index, byte) in bytes.iter().enumerate() {
        match byte {
            _ if escaped => escaped = false,
            b'\\' if in_text => escaped = true,
            b'"' => (in_text, length) = (!in_text, 0),
            b'0'..=b'9' | b'.' | b'+' | b'-' | b'e' | b'E' if !in_text => {
                length += 1;
                if length > LONGEST_NUMBER {
                    let before = &bytes[..=index - LONGEST_NUMBER];
                    #[allow(clippy::naive_bytecount)] // once, of a refused body
                    let line = 1 + before.iter().filter(|byte| **byte == b'\n').count();
                    let column = before.iter().rev().take_while(|byte| **byte != b'\n').count();
                    let message = format!("a number has more than {LONGEST_NUMBER} characters");
                    return Some(SyntaxFault {
                        code: "number_too_long",
                        pointer: String::new(),
                        line,
                        column,
                        message,
                    });
                }
            }
            _ => length = 0,
        }
    }
    None
}

/// A finite number as JSON, whole numbers up to 2^53 as integers. Minus zero stays what it is.
pub(crate) fn number(value: f64) -> Option<Value> {
    // 2^53 is a double, and whole numbers up to it convert without loss.
    #[allow(clippy::cast_precision_loss)]
    let small = value.abs() <= LARGEST_INTEGER as f64;
    let minus_zero = value == 0.0 && value.is_sign_negative();
    if small && value.fract() == 0.0 && !minus_zero {
        #[allow(clippy::cast_possible_truncation)]
        return Some(Value::Number((value as i64).into()));
    }
    Number::from_f64(value).map(Value::Number)
}

fn fault(error: &serde_json::Error, code: Option<&'static str>, pointer: String) -> SyntaxFault {
    let text = error.to_string();
    let message = text.rsplit_once(" at line ").map_or(text.as_str(), |(message, _)| message).to_owned();
    let code = code.unwrap_or_else(|| match message.as_str() {
        "number out of range" => "number_out_of_range",
        "recursion limit exceeded" => "nested_too_deeply",
        _ if error.is_eof() => "unexpected_end",
        _ => "bad_syntax",
    });
    SyntaxFault { code, pointer, line: error.line(), column: error.column(), message }
}
