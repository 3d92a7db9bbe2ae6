//! Results as JSON in one pass: what is written is looked at on the way, for a number that is not finite has no text.
//!
//! `serde_json` writes it as `null` without a word, so that a second pass would have to look for it before.

use std::fmt::Display;

use serde::Serialize;
use serde::ser::{
    self, SerializeMap, SerializeSeq, SerializeStruct, SerializeStructVariant, SerializeTuple, SerializeTupleStruct,
    SerializeTupleVariant, Serializer,
};

use super::child;

/// Why a value cannot be written.
#[derive(Debug, PartialEq, thiserror::Error)]
pub(crate) enum Unwritable {
    /// A number is infinite or none; [`super::non_finite_place`] says which.
    #[error("a number is not finite")]
    NotFinite,
    /// Its type has no form in JSON.
    #[error("{0}")]
    Other(String),
}

impl ser::Error for Unwritable {
    fn custom<T: Display>(reason: T) -> Self {
        Self::Other(reason.to_string())
    }
}

/// Appends `value` as `serde_json` would write it; a number that is not finite stops the writing.
pub(crate) fn append<T: Serialize + ?Sized>(text: &mut Vec<u8>, value: &T) -> Result<(), Unwritable> {
    value.serialize(Pen { page: &mut Page { text, last: None } })
}

/// JSON Pointer to the first number of `value` that is not finite.
pub(crate) fn non_finite_place<T: Serialize + ?Sized>(value: &T) -> Option<String> {
    let mut text = Vec::new();
    (append(&mut text, value) == Err(Unwritable::NotFinite)).then(|| broken_off(&text))
}

/// Where the text of a value was broken off, as a JSON Pointer: before an item of a list, or behind the name of a field.
fn broken_off(text: &[u8]) -> String {
    /// A list with its items so far, or an object with the field that it has come to.
    enum Open {
        List(usize),
        Object(String),
    }
    let mut open = Vec::new();
    let mut rest = text;
    while let Some((&byte, behind)) = rest.split_first() {
        rest = behind;
        match (byte, open.last_mut()) {
            (b'[', _) => open.push(Open::List(0)),
            (b'{', _) => open.push(Open::Object(String::new())),
            (b']' | b'}', _) => drop(open.pop()),
            (b',', Some(Open::List(items))) => *items += 1,
            (b'"', place) => {
                let mut escaped = false;
                let ends = |byte: &u8| {
                    let is_end = *byte == b'"' && !escaped;
                    escaped = *byte == b'\\' && !escaped;
                    is_end
                };
                let end = behind.iter().position(ends).unwrap_or(behind.len());
                rest = behind.get(end + 1..).unwrap_or_default();
                if let (Some(Open::Object(field)), Some(b':')) = (place, rest.first()) {
                    *field = serde_json::from_slice(&text[text.len() - behind.len() - 1..text.len() - rest.len()])
                        .unwrap_or_default();
                }
            }
            _ => {}
        }
    }
    open.iter().fold(String::new(), |pointer, open| match open {
        Open::List(items) => format!("{pointer}/{items}"),
        Open::Object(field) => child(&pointer, field),
    })
}

/// What is written on.
struct Page<'a> {
    text: &'a mut Vec<u8>,
    last: Option<Written>,
}

/// The number written last: columns often repeat one, whose text is then copied and not found again.
#[derive(Clone, Copy)]
struct Written {
    bits: u64,
    begin: usize,
    end: usize,
}

impl Page<'_> {
    /// As `serde_json` does: the shortest text that reads back bit for bit.
    fn number(&mut self, value: f64) {
        let (bits, begin) = (value.to_bits(), self.text.len());
        match self.last.filter(|last| last.bits == bits) {
            Some(last) => self.text.extend_from_within(last.begin..last.end),
            None => self.text.extend_from_slice(zmij::Buffer::new().format_finite(value).as_bytes()),
        }
        self.last = Some(Written { bits, begin, end: self.text.len() });
    }
}

/// Writes one value.
struct Pen<'a, 'p> {
    page: &'a mut Page<'p>,
}

/// What `serde_json` writes: whole numbers, texts that may need escapes.
fn plainly<T: Serialize + ?Sized>(text: &mut Vec<u8>, value: &T) -> Result<(), Unwritable> {
    serde_json::to_writer(text, value).map_err(|error| Unwritable::Other(error.to_string()))
}

/// A name of a field or a variant: words of the code, which hardly ever need an escape.
fn word(text: &mut Vec<u8>, name: &str) -> Result<(), Unwritable> {
    if !name.bytes().all(|byte| byte.wrapping_sub(b'a') < 26 || byte == b'_' || byte.is_ascii_digit()) {
        return plainly(text, name);
    }
    text.reserve(name.len() + 2);
    text.push(b'"');
    text.extend_from_slice(name.as_bytes());
    text.push(b'"');
    Ok(())
}

macro_rules! whole {
    ($($method:ident: $type:ty),* $(,)?) => {
        $(fn $method(self, value: $type) -> Result<(), Unwritable> { plainly(self.page.text, &value) })*
    };
}

impl<'a, 'p> Serializer for Pen<'a, 'p> {
    type Ok = ();
    type Error = Unwritable;
    type SerializeSeq = List<'a, 'p>;
    type SerializeTuple = List<'a, 'p>;
    type SerializeTupleStruct = List<'a, 'p>;
    type SerializeTupleVariant = List<'a, 'p>;
    type SerializeMap = List<'a, 'p>;
    type SerializeStruct = List<'a, 'p>;
    type SerializeStructVariant = List<'a, 'p>;

    whole! {
        serialize_i8: i8, serialize_i16: i16, serialize_i32: i32, serialize_i64: i64, serialize_u8: u8,
        serialize_u16: u16, serialize_u32: u32, serialize_u64: u64, serialize_i128: i128, serialize_u128: u128,
        serialize_char: char, serialize_str: &str, serialize_bytes: &[u8],
    }

    fn serialize_bool(self, value: bool) -> Result<(), Unwritable> {
        self.page.text.extend_from_slice(if value { b"true" } else { b"false" });
        Ok(())
    }
    fn serialize_f32(self, value: f32) -> Result<(), Unwritable> {
        if value.is_finite() { plainly(self.page.text, &value) } else { Err(Unwritable::NotFinite) }
    }
    fn serialize_f64(self, value: f64) -> Result<(), Unwritable> {
        if !value.is_finite() {
            return Err(Unwritable::NotFinite);
        }
        self.page.number(value);
        Ok(())
    }
    fn serialize_none(self) -> Result<(), Unwritable> {
        self.serialize_unit()
    }
    fn serialize_some<T: Serialize + ?Sized>(self, value: &T) -> Result<(), Unwritable> {
        value.serialize(self)
    }
    fn serialize_unit(self) -> Result<(), Unwritable> {
        self.page.text.extend_from_slice(b"null");
        Ok(())
    }
    fn serialize_unit_struct(self, _: &'static str) -> Result<(), Unwritable> {
        self.serialize_unit()
    }
    fn serialize_unit_variant(self, _: &'static str, _: u32, variant: &'static str) -> Result<(), Unwritable> {
        word(self.page.text, variant)
    }
    fn serialize_newtype_struct<T: Serialize + ?Sized>(self, _: &'static str, value: &T) -> Result<(), Unwritable> {
        value.serialize(self)
    }
    fn serialize_newtype_variant<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        value: &T,
    ) -> Result<(), Unwritable> {
        self.page.text.push(b'{');
        word(self.page.text, variant)?;
        self.page.text.push(b':');
        value.serialize(Pen { page: self.page })?;
        self.page.text.push(b'}');
        Ok(())
    }
    fn serialize_seq(self, _: Option<usize>) -> Result<List<'a, 'p>, Unwritable> {
        Ok(List::open(self.page, b'[', "]"))
    }
    fn serialize_tuple(self, _: usize) -> Result<List<'a, 'p>, Unwritable> {
        Ok(List::open(self.page, b'[', "]"))
    }
    fn serialize_tuple_struct(self, _: &'static str, _: usize) -> Result<List<'a, 'p>, Unwritable> {
        Ok(List::open(self.page, b'[', "]"))
    }
    fn serialize_tuple_variant(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        _: usize,
    ) -> Result<List<'a, 'p>, Unwritable> {
        self.page.text.push(b'{');
        word(self.page.text, variant)?;
        self.page.text.push(b':');
        Ok(List::open(self.page, b'[', "]}"))
    }
    fn serialize_map(self, _: Option<usize>) -> Result<List<'a, 'p>, Unwritable> {
        Ok(List::open(self.page, b'{', "}"))
    }
    fn serialize_struct(self, _: &'static str, _: usize) -> Result<List<'a, 'p>, Unwritable> {
        Ok(List::open(self.page, b'{', "}"))
    }
    fn serialize_struct_variant(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        _: usize,
    ) -> Result<List<'a, 'p>, Unwritable> {
        self.page.text.push(b'{');
        word(self.page.text, variant)?;
        self.page.text.push(b':');
        Ok(List::open(self.page, b'{', "}}"))
    }
}

/// Writes the items of an array or the members of an object.
struct List<'a, 'p> {
    page: &'a mut Page<'p>,
    is_first: bool,
    end: &'static str,
}

impl<'a, 'p> List<'a, 'p> {
    fn open(page: &'a mut Page<'p>, begin: u8, end: &'static str) -> Self {
        page.text.push(begin);
        Self { page, is_first: true, end }
    }

    fn next(&mut self) {
        if !self.is_first {
            self.page.text.push(b',');
        }
        self.is_first = false;
    }

    fn item<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Unwritable> {
        self.next();
        value.serialize(Pen { page: self.page })
    }

    fn member<T: Serialize + ?Sized>(&mut self, name: &str, value: &T) -> Result<(), Unwritable> {
        self.next();
        word(self.page.text, name)?;
        self.page.text.push(b':');
        value.serialize(Pen { page: self.page })
    }

    fn close(self) {
        self.page.text.extend_from_slice(self.end.as_bytes());
    }
}

macro_rules! lists {
    ($($form:ident: $method:ident),* $(,)?) => {
        $(impl $form for List<'_, '_> {
            type Ok = ();
            type Error = Unwritable;
            fn $method<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Unwritable> {
                self.item(value)
            }
            fn end(self) -> Result<(), Unwritable> {
                self.close();
                Ok(())
            }
        })*
    };
}

lists! {
    SerializeSeq: serialize_element, SerializeTuple: serialize_element, SerializeTupleStruct: serialize_field,
    SerializeTupleVariant: serialize_field,
}

macro_rules! objects {
    ($($form:ident),* $(,)?) => {
        $(impl $form for List<'_, '_> {
            type Ok = ();
            type Error = Unwritable;
            fn serialize_field<T: Serialize + ?Sized>(
                &mut self,
                name: &'static str,
                value: &T,
            ) -> Result<(), Unwritable> {
                self.member(name, value)
            }
            fn end(self) -> Result<(), Unwritable> {
                self.close();
                Ok(())
            }
        })*
    };
}

objects! { SerializeStruct, SerializeStructVariant }

impl SerializeMap for List<'_, '_> {
    type Ok = ();
    type Error = Unwritable;
    fn serialize_key<T: Serialize + ?Sized>(&mut self, key: &T) -> Result<(), Unwritable> {
        self.next();
        let key = serde_json::to_value(key).map_err(|error| Unwritable::Other(error.to_string()))?;
        match key {
            serde_json::Value::String(name) => word(self.page.text, &name),
            serde_json::Value::Number(_) | serde_json::Value::Bool(_) => word(self.page.text, &key.to_string()),
            _ => Err(Unwritable::Other("a key is neither text nor number".to_owned())),
        }
    }
    fn serialize_value<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Unwritable> {
        self.page.text.push(b':');
        value.serialize(Pen { page: self.page })
    }
    fn end(self) -> Result<(), Unwritable> {
        self.close();
        Ok(())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde_json::Value;
    use std::collections::BTreeMap;

    fn text<T: Serialize + ?Sized>(value: &T) -> Result<String, Unwritable> {
        let mut text = Vec::new();
        append(&mut text, value)?;
        Ok(String::from_utf8(text).unwrap())
    }

    #[derive(Serialize)]
    struct Unit;

    #[derive(Serialize)]
    struct Pair(f64, &'static str);

    #[derive(Serialize)]
    #[serde(rename_all = "kebab-case")]
    enum Plain {
        One,
        Number(f64),
        Both(u8, i64),
        Named { depth_mm: Option<f64> },
    }

    #[derive(Serialize)]
    #[serde(tag = "kind", rename_all = "snake_case")]
    enum Tagged {
        Empty,
        Round { radius_mm: f64 },
        Inner(Inner),
    }

    #[derive(Serialize)]
    struct Inner {
        name: String,
        #[serde(skip_serializing_if = "Option::is_none")]
        absent: Option<f64>,
        #[serde(flatten)]
        rest: BTreeMap<String, f64>,
    }

    #[test]
    fn a_number_that_comes_again_is_written_again() {
        let column = [90.0, 90.0, 0.1 + 0.2, 0.1 + 0.2, 0.0, -0.0, -0.0, 1e-7, 1e300, 1e300];
        let value = (column, Some(1e300), "1e300", 1e300, [[1e300], [2.0]]);
        assert_eq!(text(&value).unwrap(), serde_json::to_string(&value).unwrap());
        assert_eq!(text(&[1.0, f64::NAN, f64::NAN]), Err(Unwritable::NotFinite));
    }

    /// Everything that serde knows.
    #[test]
    fn every_form_is_written_as_serde_json_writes_it() {
        let inner = || Inner {
            name: "quo\"te \u{1f600}\n".to_owned(),
            absent: None,
            rest: BTreeMap::from([("a b".to_owned(), 0.25), ("ü".to_owned(), -3.0)]),
        };
        let value = (
            (true, 'x', 7_u8, -7_i64, u64::MAX, 0.5_f32, "plain", [1.5, 2.0]),
            (Unit, Pair(1e-7, "p"), Plain::One, Plain::Number(2.0), Plain::Both(1, -2)),
            (Plain::Named { depth_mm: Some(0.1) }, Plain::Named { depth_mm: None }),
            (Tagged::Empty, Tagged::Round { radius_mm: 45.0 }, Tagged::Inner(inner())),
            (vec![None, Some(1.0)], Vec::<f64>::new(), (), BTreeMap::from([(3, "three")]), BTreeMap::<u8, u8>::new()),
        );
        assert_eq!(text(&value).unwrap(), serde_json::to_string(&value).unwrap());
    }

    #[test]
    fn what_is_not_finite_stops_the_writing() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(text(&vec![Some(1.0), Some(bad)]), Err(Unwritable::NotFinite));
        }
        assert_eq!(text(&f32::NAN), Err(Unwritable::NotFinite));
    }

    #[test]
    fn the_place_of_a_number_that_is_none_is_named() {
        let fine = (vec![None, Some((1.0, 2.0))], Tagged::Round { radius_mm: 1.0 });
        assert_eq!(non_finite_place(&fine), None);
        let bad = BTreeMap::from([("rows", vec![None, Some((1.0, f64::NAN))])]);
        assert_eq!(non_finite_place(&bad).as_deref(), Some("/rows/1/1"));
        let bad = BTreeMap::from([("a \"}],[:\\", vec![("x:,\\\"", 1.0)]), ("b/c", vec![("[", 2.0), ("{", f64::NAN)])]);
        assert_eq!(non_finite_place(&bad).as_deref(), Some("/b~1c/1/1"));
        assert_eq!(non_finite_place(&f64::NAN).as_deref(), Some(""));
        let bad = BTreeMap::from([("shape", Tagged::Round { radius_mm: f64::INFINITY })]);
        assert_eq!(non_finite_place(&bad).as_deref(), Some("/shape/radius_mm"));
    }

    #[test]
    fn a_key_that_is_no_word_is_refused() {
        assert!(matches!(text(&BTreeMap::from([((1, 2), 3)])), Err(Unwritable::Other(_))));
    }

    fn any_value() -> impl Strategy<Value = Value> {
        let leaf = prop_oneof![
            Just(Value::Null),
            any::<bool>().prop_map(Value::from),
            any::<i64>().prop_map(Value::from),
            any::<f64>().prop_map(Value::from),
            any::<String>().prop_map(Value::from),
        ];
        leaf.prop_recursive(4, 60, 6, |inner| {
            prop_oneof![
                prop::collection::vec(inner.clone(), 0..6).prop_map(Value::from),
                prop::collection::hash_map(any::<String>(), inner, 0..6)
                    .prop_map(|fields| Value::Object(fields.into_iter().collect())),
            ]
        })
    }

    proptest! {
        #[test]
        fn any_value_comes_out_as_serde_json_writes_it(value in any_value()) {
            prop_assert_eq!(text(&value).unwrap(), serde_json::to_string(&value).unwrap());
        }
    }
}
