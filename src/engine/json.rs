//! Bytes into a JSON value, more strictly than `serde_json` alone: a key twice in one object, bytes after the value,
//! deep nesting, numbers that a double does not hold. `serde_json` would keep the last of two keys without a word.

use std::cell::RefCell;
use std::fmt;
use std::ops::Range;

use serde::de::{DeserializeSeed, Deserializer, MapAccess, SeqAccess, Visitor};
use serde_json::map::Entry;
use serde_json::{Map, Number, Value};

use super::error::{Error, SyntaxFault};
use crate::registry::child;

/// Deepest nesting; below the parser's own limit of 128, so that the fault can be named with its place.
const DEEPEST: usize = 100;
/// Largest whole number that a double and RFC 8785 hold with all its digits: 2^53.
const LARGEST_INTEGER: u64 = 1 << 53;

/// The value of `bytes`. A byte order mark is skipped. Whole numbers are integers however they are spelled (`500.0`,
/// `5e2`), so that a count may be written like any other number.
pub(crate) fn parse(bytes: &[u8]) -> Result<Value, Error> {
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    if bytes.iter().all(u8::is_ascii_whitespace) {
        let message = "the body is empty".to_owned();
        let fault = SyntaxFault { code: "empty_body", pointer: String::new(), line: 1, column: 1, message };
        return Err(Error::Syntax(fault));
    }
    let trail = Trail::default();
    let mut deserializer = serde_json::Deserializer::from_slice(bytes);
    let parsed = Strict { trail: &trail, depth: 0 }.deserialize(&mut deserializer);
    match parsed {
        Ok(value) => match deserializer.end() {
            Ok(()) => Ok(value),
            Err(error) => Err(Error::Syntax(fault(&error, Some("trailing_bytes"), String::new()))),
        },
        Err(error) => {
            let pointer = trail.steps.borrow().iter().rev().fold(String::new(), |pointer, step| match step {
                Step::Key(name) => child(&pointer, name),
                Step::Index(index) => format!("{pointer}/{index}"),
            });
            Err(Error::Syntax(fault(&error, trail.code.take(), pointer)))
        }
    }
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

/// Where in the text of an object, written without white space, the value of a field of its own stands.
pub(crate) fn top_level_field(object: &[u8], name: &str) -> Option<Range<usize>> {
    let (mut depth, mut in_text, mut escaped) = (0_usize, false, false);
    // Where the member that is being read begins, and where the value that is looked for does.
    let (mut member, mut value) = (1, None);
    for (index, byte) in object.iter().enumerate() {
        if in_text {
            match byte {
                _ if escaped => escaped = false,
                b'\\' => escaped = true,
                b'"' => in_text = false,
                _ => {}
            }
            continue;
        }
        match byte {
            b'"' => in_text = true,
            b'{' | b'[' => depth += 1,
            b':' if depth == 1 => {
                let key = object.get(member + 1..index - 1)?;
                value = (key == name.as_bytes()).then_some(index + 1);
            }
            b',' | b'}' if depth == 1 => {
                if let Some(begin) = value {
                    return Some(begin..index);
                }
                member = index + 1;
            }
            b'}' | b']' => depth = depth.checked_sub(1)?,
            _ => {}
        }
    }
    None
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

/// Why and where reading stopped; the steps are noted from the inside out, on failure only.
#[derive(Default)]
struct Trail {
    steps: RefCell<Vec<Step>>,
    code: RefCell<Option<&'static str>>,
}

enum Step {
    Key(String),
    Index(usize),
}

impl Trail {
    fn refuse<E: serde::de::Error>(&self, code: &'static str, message: impl fmt::Display) -> E {
        self.code.replace(Some(code));
        E::custom(message)
    }
}

#[derive(Clone, Copy)]
struct Strict<'a> {
    trail: &'a Trail,
    depth: usize,
}

impl Strict<'_> {
    fn inside<E: serde::de::Error>(self) -> Result<Self, E> {
        if self.depth == DEEPEST {
            return Err(self.trail.refuse("nested_too_deeply", format_args!("nested more than {DEEPEST} deep")));
        }
        Ok(Self { depth: self.depth + 1, ..self })
    }

    fn integer<E: serde::de::Error>(self, size: u64, number: Number) -> Result<Value, E> {
        if size > LARGEST_INTEGER {
            return Err(self.trail.refuse("integer_too_large", format_args!("{number} is above 2^53")));
        }
        Ok(Value::Number(number))
    }
}

impl<'de> DeserializeSeed<'de> for Strict<'_> {
    type Value = Value;
    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Strict<'_> {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON value")
    }
    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }
    fn visit_bool<E>(self, value: bool) -> Result<Value, E> {
        Ok(Value::Bool(value))
    }
    fn visit_u64<E: serde::de::Error>(self, value: u64) -> Result<Value, E> {
        self.integer(value, value.into())
    }
    fn visit_i64<E: serde::de::Error>(self, value: i64) -> Result<Value, E> {
        self.integer(value.unsigned_abs(), value.into())
    }
    fn visit_f64<E: serde::de::Error>(self, value: f64) -> Result<Value, E> {
        number(value).ok_or_else(|| self.trail.refuse("number_out_of_range", "a number is too large"))
    }
    fn visit_str<E>(self, value: &str) -> Result<Value, E> {
        Ok(Value::String(value.to_owned()))
    }
    fn visit_string<E>(self, value: String) -> Result<Value, E> {
        Ok(Value::String(value))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut access: A) -> Result<Value, A::Error> {
        let inside = self.inside()?;
        let mut items = Vec::new();
        loop {
            match access.next_element_seed(inside) {
                Ok(Some(item)) => items.push(item),
                Ok(None) => return Ok(Value::Array(items)),
                Err(error) => {
                    self.trail.steps.borrow_mut().push(Step::Index(items.len()));
                    return Err(error);
                }
            }
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, mut access: A) -> Result<Value, A::Error> {
        let inside = self.inside()?;
        let mut fields = Map::new();
        while let Some(name) = access.next_key::<String>()? {
            match fields.entry(name) {
                Entry::Occupied(there) => {
                    let name = there.key();
                    let error = self.trail.refuse("duplicate_key", format_args!("the key {name:?} occurs twice"));
                    self.trail.steps.borrow_mut().push(Step::Key(name.clone()));
                    return Err(error);
                }
                Entry::Vacant(place) => match access.next_value_seed(inside) {
                    Ok(value) => {
                        place.insert(value);
                    }
                    Err(error) => {
                        self.trail.steps.borrow_mut().push(Step::Key(place.key().clone()));
                        return Err(error);
                    }
                },
            }
        }
        Ok(Value::Object(fields))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::panic)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde_json::json;

    fn refused(text: &str) -> SyntaxFault {
        match parse(text.as_bytes()) {
            Err(Error::Syntax(fault)) => fault,
            other => panic!("{text} gave {other:?}"),
        }
    }

    #[test]
    fn a_field_of_the_object_itself_is_found_in_its_text() {
        let object = json!({
            "a": {"effects": 1}, "b": ["effects", {"effects": [2]}], "c\"effects": "x,\"effects\":{", "": 0,
            "effects": [{"kind": "wear\\\"]}", "of": [[1.5, null]]}, {}], "last": {},
        });
        let text = object.to_string();
        for name in ["a", "b", "effects", "", "last"] {
            let place = top_level_field(text.as_bytes(), name).unwrap();
            assert_eq!(text[place], object[name].to_string(), "{name}");
        }
        for (text, name) in [("{}", "a"), ("{\"a\":{\"b\":1}}", "b"), ("[1,2]", "a"), ("", "a"), ("{\"a\":1", "a")] {
            assert_eq!(top_level_field(text.as_bytes(), name), None, "{text}");
        }
    }

    #[test]
    fn a_key_twice_is_refused_with_its_place() {
        let fault = refused("{\"a\": [0, {\"b\": 1,\n \"c/d\": 2, \"b\": 3}]}");
        assert_eq!((fault.code, fault.pointer.as_str(), fault.line), ("duplicate_key", "/a/1/b", 2));
    }

    #[test]
    fn every_fault_of_syntax_has_its_code() {
        let deep = format!("{}{}", "[".repeat(200), "]".repeat(200));
        for (text, code) in [
            ("", "empty_body"),
            (" \n", "empty_body"),
            ("{", "unexpected_end"),
            ("{\"a\": }", "bad_syntax"),
            ("{\"a\": NaN}", "bad_syntax"),
            ("{\"a\": 1} x", "trailing_bytes"),
            ("{} {}", "trailing_bytes"),
            ("{\"a\": 1e400}", "number_out_of_range"),
            ("{\"a\": 9007199254740993}", "integer_too_large"),
            ("{\"a\": -9007199254740993}", "integer_too_large"),
            (deep.as_str(), "nested_too_deeply"),
        ] {
            assert_eq!(refused(text).code, code, "{text}");
        }
        assert_eq!(refused("{\"a\": {\"b\": 1e400}}").pointer, "/a/b");
        let not_utf8 = parse(b"{\"a\": \"\xff\"}");
        assert!(matches!(not_utf8, Err(Error::Syntax(_))), "{not_utf8:?}");
    }

    #[test]
    fn whole_numbers_are_integers_however_spelled() {
        assert_eq!(parse(b"[5, 5.0, 5e0, 0.5e1]").unwrap(), json!([5, 5, 5, 5]));
        assert_eq!(parse(b"[9007199254740992, 1e20, 0.1]").unwrap(), json!([9_007_199_254_740_992_u64, 1e20, 0.1]));
        assert!(parse(b"-0.0").unwrap().as_f64().unwrap().is_sign_negative());
        assert_eq!(parse(b"\xEF\xBB\xBF{}").unwrap(), json!({}));
    }

    fn any_json() -> impl Strategy<Value = Value> {
        let leaf = prop_oneof![
            Just(Value::Null),
            any::<bool>().prop_map(Value::from),
            (-(1_i64 << 53)..(1_i64 << 53)).prop_map(Value::from),
            any::<f64>().prop_filter_map("finite, not whole", |x| {
                (x.is_finite() && x.fract() != 0.0).then(|| Value::from(x))
            }),
            ".*".prop_map(Value::from),
        ];
        leaf.prop_recursive(4, 32, 6, |inner| {
            prop_oneof![
                prop::collection::vec(inner.clone(), 0..6).prop_map(Value::from),
                prop::collection::btree_map(".*", inner, 0..6).prop_map(|map| Value::Object(map.into_iter().collect())),
            ]
        })
    }

    proptest! {
        #[test]
        fn what_serde_json_writes_is_read_back(value in any_json()) {
            prop_assert_eq!(parse(value.to_string().as_bytes()).unwrap(), value);
        }

        #[test]
        fn no_bytes_make_it_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let _ = parse(&bytes);
        }

        #[test]
        fn what_it_accepts_serde_json_accepts(text in "[\\[\\]{}\",:0-9eE.+ \\-truefalsn\\\\]{0,40}") {
            if parse(text.as_bytes()).is_ok() {
                prop_assert!(serde_json::from_str::<Value>(&text).is_ok());
            }
        }
    }
}
