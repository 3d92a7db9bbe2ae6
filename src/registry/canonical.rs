//! Canonical JSON (RFC 8785) of typed values, in one buffer.
//!
//! Members are written as they come, noted, and put in order when their object ends. `serde_json_canonicalizer` gives
//! every name and value a buffer of its own; it stays the measure in the tests.

use std::cmp::Ordering;
use std::io;

use serde::Serialize;
use serde_json::ser::{CharEscape, CompactFormatter, Formatter, Serializer};

/// The canonical JSON of `value`, whose numbers must be finite.
pub(crate) fn canonical<T: Serialize + ?Sized>(value: &T) -> serde_json::Result<Vec<u8>> {
    let mut page =
        Page { text: Vec::with_capacity(USUAL_BYTES), sorted: Vec::with_capacity(USUAL_BYTES), ..Page::default() };
    value.serialize(&mut Serializer::with_formatter(io::sink(), OnPage(&mut page)))?;
    Ok(page.text)
}

/// Room for the canonical JSON of a usual job.
const USUAL_BYTES: usize = 2048;

/// What is written so far.
#[derive(Default)]
struct Page {
    text: Vec<u8>,
    /// The members of all objects that have not ended, those of the innermost last.
    members: Vec<Member>,
    /// The objects that have not ended.
    objects: Vec<Object>,
    sorted: Vec<u8>,
}

/// An object that has not ended: where it begins in the text and among the members.
struct Object {
    text: usize,
    members: usize,
}

/// Where in the text a member of an object stands.
#[derive(Clone, Copy)]
struct Member {
    begin: usize,
    colon: usize,
    end: usize,
    /// Whether its name is ASCII without escapes: then its bytes are in the order of its code units.
    is_plain: bool,
}

impl Page {
    fn name(&self, member: Member) -> &[u8] {
        &self.text[member.begin + 1..member.colon - 1]
    }

    /// The order of two members of an object, whose names differ.
    fn order(&self, a: Member, b: Member) -> Ordering {
        let (first, second) = (self.name(a), self.name(b));
        if a.is_plain && b.is_plain { first.cmp(second) } else { by_code_units(first, second) }
    }

    /// Puts the members of the innermost object in order, with commas between them.
    fn end_object(&mut self) {
        let Some(object) = self.objects.pop() else { return };
        let mut members = std::mem::take(&mut self.members);
        let own = &mut members[object.members..];
        own.sort_unstable_by(|a, b| self.order(*a, *b));
        self.sorted.clear();
        for (index, member) in own.iter().enumerate() {
            if index > 0 {
                self.sorted.push(b',');
            }
            self.sorted.extend_from_slice(&self.text[member.begin..member.end]);
        }
        members.truncate(object.members);
        self.members = members;
        self.text.truncate(object.text);
        self.text.push(b'{');
        self.text.extend_from_slice(&self.sorted);
        self.text.push(b'}');
    }
}

/// The order of names: by UTF-16 code units. Names come as they are written, with their escapes.
fn by_code_units(a: &[u8], b: &[u8]) -> Ordering {
    let units = |name: &[u8]| -> Vec<u16> {
        let quoted = [b"\"", name, b"\""].concat();
        serde_json::from_slice::<String>(&quoted).unwrap_or_default().encode_utf16().collect()
    };
    units(a).cmp(&units(b))
}

/// Writes on a page; the writer that `serde_json` hands on is none.
struct OnPage<'a>(&'a mut Page);

/// Whole numbers are written like all others: as the double that they are.
macro_rules! as_double {
    ($($method:ident: $type:ty),* $(,)?) => {
        $(fn $method<W: io::Write + ?Sized>(&mut self, writer: &mut W, value: $type) -> io::Result<()> {
            #[allow(clippy::cast_lossless, clippy::cast_precision_loss)] // the format knows doubles only
            self.write_f64(writer, value as f64)
        })*
    };
}

/// What stands in the text as it is.
macro_rules! plain {
    ($($method:ident($($argument:ident: $type:ty)?)),* $(,)?) => {
        $(fn $method<W: io::Write + ?Sized>(&mut self, _: &mut W, $($argument: $type)?) -> io::Result<()> {
            CompactFormatter.$method(&mut self.0.text, $($argument)?)
        })*
    };
}

impl Formatter for OnPage<'_> {
    as_double! {
        write_i8: i8, write_i16: i16, write_i32: i32, write_i64: i64, write_i128: i128, write_u8: u8, write_u16: u16,
        write_u32: u32, write_u64: u64, write_u128: u128, write_f32: f32,
    }
    plain! {
        write_null(), write_bool(value: bool), begin_string(), end_string(), write_string_fragment(fragment: &str),
        write_char_escape(escape: CharEscape), begin_array(), end_array(), begin_array_value(first: bool),
        end_array_value(),
    }

    fn write_f64<W: io::Write + ?Sized>(&mut self, _: &mut W, value: f64) -> io::Result<()> {
        self.0.text.extend_from_slice(ryu_js::Buffer::new().format(value).as_bytes());
        Ok(())
    }

    fn write_number_str<W: io::Write + ?Sized>(&mut self, writer: &mut W, value: &str) -> io::Result<()> {
        self.write_f64(writer, value.parse().map_err(io::Error::other)?)
    }

    fn begin_object<W: io::Write + ?Sized>(&mut self, _: &mut W) -> io::Result<()> {
        let page = &mut *self.0;
        page.objects.push(Object { text: page.text.len(), members: page.members.len() });
        Ok(())
    }

    fn end_object<W: io::Write + ?Sized>(&mut self, _: &mut W) -> io::Result<()> {
        self.0.end_object();
        Ok(())
    }

    fn begin_object_key<W: io::Write + ?Sized>(&mut self, _: &mut W, _: bool) -> io::Result<()> {
        let begin = self.0.text.len();
        self.0.members.push(Member { begin, colon: begin, end: begin, is_plain: false });
        Ok(())
    }

    fn begin_object_value<W: io::Write + ?Sized>(&mut self, _: &mut W) -> io::Result<()> {
        let page = &mut *self.0;
        let colon = page.text.len();
        if let Some(member) = page.members.last_mut() {
            member.colon = colon;
            let name = &page.text[member.begin + 1..colon - 1];
            member.is_plain = name.iter().all(|byte| byte.is_ascii() && *byte != b'\\');
        }
        page.text.push(b':');
        Ok(())
    }

    fn end_object_value<W: io::Write + ?Sized>(&mut self, _: &mut W) -> io::Result<()> {
        let end = self.0.text.len();
        if let Some(member) = self.0.members.last_mut() {
            member.end = end;
        }
        Ok(())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::canonical;
    use proptest::prelude::*;
    use serde_json::{Value, json};

    fn assert_same(value: &Value) {
        let text = String::from_utf8(canonical(value).unwrap()).unwrap();
        assert_eq!(text, serde_json_canonicalizer::to_string(value).unwrap());
    }

    #[test]
    fn names_are_in_the_order_of_the_standard() {
        // The example of RFC 8785, section 3.2.3, and names that need escapes.
        assert_same(&json!({
            "\u{20ac}": "Euro Sign", "\r": "Carriage Return", "\u{fb33}": "Hebrew", "1": "One",
            "\u{1f600}": "Emoji", "\u{80}": "Control", "\u{f6}": "o", "\\": 1, "\"": 2, "a": {}, "": [],
        }));
    }

    #[test]
    fn numbers_are_doubles_as_the_standard_writes_them() {
        assert_same(&json!([
            0,
            -0.0,
            1,
            -7,
            500.0,
            4.50,
            2e-3,
            1e30,
            1e21,
            123_456_789_012_345_680_000.0,
            1e-7,
            1e-27,
            9_007_199_254_740_992_u64,
            333_333_333.333_333_3,
            5e-324,
            f64::MAX,
        ]));
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
        fn any_value_comes_out_as_the_reference_writes_it(value in any_value()) {
            let text = String::from_utf8(canonical(&value).unwrap()).unwrap();
            prop_assert_eq!(text, serde_json_canonicalizer::to_string(&value).unwrap());
        }
    }
}
