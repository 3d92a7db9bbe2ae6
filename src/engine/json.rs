//! Bytes into a JSON value, more strictly than `serde_json` alone: a key twice in one object, bytes after the value,
//! deep nesting, numbers that a double does not hold. `serde_json` would keep the last of two keys without a word.

use std::cell::{Cell, RefCell};
use std::fmt;
use std::ops::Range;
use std::time::Duration;

use serde::de::{DeserializeSeed, Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde_json::map::Entry;
use serde_json::{Map, Number, Value};

use super::budget::Room;
use super::error::{Error, SyntaxFault};
use crate::registry::{Faults, Shape, child, cut_short_at};

/// Deepest nesting; below the parser's own limit of 128, so that the fault can be named with its place.
const DEEPEST: usize = 100;
/// Largest whole number that a double and RFC 8785 hold with all its digits: 2^53.
const LARGEST_INTEGER: u64 = 1 << 53;
/// Most characters of a number: the shortest decimal that tells two doubles apart has fewer than 800 digits.
const LONGEST_NUMBER: usize = 1000;
/// Names that no field has, of all objects of a job together: more than are ever shown, so that sorting by pointer still
/// shows those that come first. Of further ones only the count is kept.
const MOST_UNKNOWN: usize = 1000;
/// So many bytes of such a name are kept.
const LONGEST_UNKNOWN: usize = 100;
/// So many bytes of a text are kept where there may be none: more than are ever shown.
const LONGEST_MISFIT: usize = 1000;
/// So many items of a long list are kept of a body that is read for its faults.
pub(crate) const HEAD_ITEMS: usize = 256;
/// What a value and a field take beside what they hold, bytes.
const VALUE_BYTES: usize = size_of::<Value>();
/// A list that grows has room for as many items again.
const ITEM_BYTES: usize = 2 * VALUE_BYTES;
const FIELD_BYTES: usize = VALUE_BYTES + size_of::<String>() + 3 * size_of::<usize>();
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

/// A field of an object in its text: where it begins, and its value.
struct Member {
    begin: usize,
    value: Range<usize>,
}

impl Member {
    fn name<'t>(&self, object: &'t [u8]) -> &'t [u8] {
        object.get(self.begin + 1..self.value.start - 2).unwrap_or_default()
    }
}

/// The fields of an object, written without white space, as they come; up to where it is no object any more.
fn members(object: &[u8]) -> impl Iterator<Item = Member> {
    let (mut depth, mut in_text, mut escaped) = (0_usize, false, false);
    // Where the member that is being read begins, and its value.
    let (mut begin, mut value) = (1, None);
    object
        .iter()
        .enumerate()
        .map_while(move |(index, byte)| {
            if in_text {
                match byte {
                    _ if escaped => escaped = false,
                    b'\\' => escaped = true,
                    b'"' => in_text = false,
                    _ => {}
                }
                return Some(None);
            }
            let mut ended = None;
            match byte {
                b'"' => in_text = true,
                b'{' | b'[' => depth += 1,
                b':' if depth == 1 => value = Some(index + 1),
                b',' | b'}' if depth == 1 => {
                    ended = value.take().map(|value| Member { begin, value: value..index });
                    begin = index + 1;
                }
                b'}' | b']' => depth = depth.checked_sub(1)?,
                _ => {}
            }
            Some(ended)
        })
        .flatten()
}

/// Where in the text of an object, written without white space, the value of a field of its own stands.
pub(crate) fn top_level_field(object: &[u8], name: &str) -> Option<Range<usize>> {
    members(object).find(|member| member.name(object) == name.as_bytes()).map(|member| member.value)
}

/// An object in canonical JSON with one field more, which it does not have yet. All names are ASCII.
pub(crate) fn with_top_level(object: &[u8], name: &str, value: &[u8]) -> Vec<u8> {
    let next = members(object).find(|member| member.name(object) > name.as_bytes());
    let (before, after) = match next {
        Some(next) => (&object[..next.begin], [b",", &object[next.begin..]].concat()),
        None => (&object[..object.len().saturating_sub(1)], b"}".to_vec()),
    };
    let comma: &[u8] = if after[0] == b'}' && before.len() > 1 { b"," } else { b"" };
    [before, comma, b"\"", name.as_bytes(), b"\":", value, &after].concat()
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

/// Items of long lists that are not kept.
#[derive(Default)]
struct Beyond {
    /// Theirs, with pointers from the value that is being read.
    faults: RefCell<Faults>,
    is_any: Cell<bool>,
    /// They are there one at a time.
    room: Room,
}

impl Beyond {
    /// How many faults are listed.
    fn listed(&self) -> usize {
        self.faults.borrow().listed.len()
    }

    /// The faults from `first` on were found in what stands at `step` of the value that is being read.
    fn place(&self, first: usize, step: &str) {
        for fault in &mut self.faults.borrow_mut().listed[first..] {
            fault.pointer.insert_str(0, step);
        }
    }
}

#[derive(Clone, Copy)]
struct Strict<'a> {
    trail: &'a Trail,
    depth: usize,
    shape: &'a Shape,
    room: &'a Room,
    /// Fields so far that have no name in the shape.
    unknown: &'a Cell<usize>,
    /// Fields of the object before this one in its list: this one will have as many.
    width: &'a Cell<usize>,
    /// Where long lists are not kept whole.
    beyond: Option<&'a Beyond>,
}

impl<'a> Strict<'a> {
    fn inside<E: serde::de::Error>(self) -> Result<Self, E> {
        if self.depth == DEEPEST {
            return Err(self.trail.refuse("nested_too_deeply", format_args!("nested more than {DEEPEST} deep")));
        }
        Ok(Self { depth: self.depth + 1, ..self })
    }

    fn of<'b>(self, shape: &'b Shape, width: &'b Cell<usize>) -> Strict<'b>
    where
        'a: 'b,
    {
        Strict { shape, width, ..self }
    }

    fn take<E: serde::de::Error>(self, bytes: usize) -> Result<(), E> {
        if self.room.take(bytes) { Ok(()) } else { Err(E::custom("no memory is left for it")) }
    }

    /// Whether a field that has no name in the shape is one of those that are kept.
    fn keeps_unknown(self) -> bool {
        self.unknown.set(self.unknown.get() + 1);
        self.unknown.get() <= MOST_UNKNOWN
    }

    /// Reads what stands at `step` and says of the faults beyond the heads of its lists where they are.
    fn at<T, E>(self, step: impl FnOnce() -> String, read: impl FnOnce() -> Result<T, E>) -> Result<T, E> {
        let first = self.beyond.map(Beyond::listed);
        let value = read()?;
        if let Some((beyond, first)) = self.beyond.zip(first)
            && beyond.listed() > first
        {
            beyond.place(first, &step());
        }
        Ok(value)
    }

    fn failed<E>(self, step: Step, error: E) -> E {
        self.trail.steps.borrow_mut().push(step);
        error
    }

    /// Holds an item that is not kept to what the items of its list have to be. Where the list may be one of several the
    /// whole is read before anything is said of it.
    fn check_beyond(self, beyond: &Beyond, item: &Value, index: usize) {
        beyond.is_any.set(true);
        if let [rules] = self.shape.item_rules()
            && self.shape.holds_item(index)
        {
            rules.check(item, || format!("/{index}"), &mut beyond.faults.borrow_mut());
        }
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
    fn visit_str<E: serde::de::Error>(self, value: &str) -> Result<Value, E> {
        let kept = match value {
            long if long.len() > LONGEST_MISFIT && !self.shape.holds_text() => {
                &long[..long.floor_char_boundary(LONGEST_MISFIT)]
            }
            whole => whole,
        };
        self.take(kept.len())?;
        Ok(Value::String(kept.to_owned()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut access: A) -> Result<Value, A::Error> {
        let inside = self.inside()?;
        let width = Cell::new(0);
        let (shape, most) = self.shape.items().unwrap_or((Shape::open(), 0));
        let (mut items, mut count) = (Vec::new(), 0);
        let item = inside.of(shape, &width);
        let head = match self.beyond {
            Some(_) if !self.shape.item_rules().is_empty() => HEAD_ITEMS.min(most),
            _ => most,
        };
        while count < head {
            match self.at(|| format!("/{count}"), || access.next_element_seed(item)) {
                Ok(Some(value)) => {
                    self.take(ITEM_BYTES).map_err(|error| self.failed(Step::Index(count), error))?;
                    items.push(value);
                }
                Ok(None) => return Ok(Value::Array(items)),
                Err(error) => return Err(self.failed(Step::Index(count), error)),
            }
            count += 1;
        }
        if let Some(beyond) = self.beyond {
            let item = Strict { room: &beyond.room, ..item };
            while count < most {
                match self.at(|| format!("/{count}"), || access.next_element_seed(item)) {
                    Ok(Some(value)) => self.check_beyond(beyond, &value, count),
                    Ok(None) => return Ok(Value::Array(items)),
                    Err(error) => return Err(self.failed(Step::Index(count), error)),
                }
                count += 1;
            }
        }
        loop {
            match access.next_element_seed(Skipped(inside)) {
                Ok(Some(())) => count += 1,
                Ok(None) => break,
                Err(error) => return Err(self.failed(Step::Index(count), error)),
            }
        }
        if count > most && most > 0 {
            match (self.beyond, self.shape.item_rules()) {
                (Some(beyond), [rules]) if head < most => beyond.faults.borrow_mut().add(rules.too_many(count)),
                _ => items.push(cut_short_at(count)),
            }
        }
        Ok(Value::Array(items))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut access: A) -> Result<Value, A::Error> {
        let inside = self.inside()?;
        let mut fields = Map::with_capacity(self.width.get());
        let mut left_out = Vec::new();
        let mut width = 0;
        while let Some(name) = access.next_key_seed(Name(self.shape))? {
            let shape = self.shape.field(&name);
            let is_kept = shape.is_some() || self.keeps_unknown();
            if !is_kept || (shape.is_none() && name.len() > LONGEST_UNKNOWN && fields.contains_key(&name)) {
                access.next_value_seed(Skipped(inside)).map_err(|error| self.failed(Step::Key(name), error))?;
                continue;
            }
            self.take::<A::Error>(FIELD_BYTES + name.len())?;
            width += 1;
            match fields.entry(name) {
                Entry::Occupied(there) => {
                    let name = there.key();
                    let error = self.trail.refuse("duplicate_key", format_args!("the key {name:?} occurs twice"));
                    return Err(self.failed(Step::Key(name.clone()), error));
                }
                Entry::Vacant(place) => {
                    let value = match shape {
                        Some(shape) => self
                            .at(|| child("", place.key()), || access.next_value_seed(inside.of(shape, &Cell::new(0)))),
                        None => access.next_value_seed(Skipped(inside)).map(|()| Value::Null),
                    };
                    match value {
                        Ok(value) => {
                            if value.is_null() && shape.is_some_and(Shape::is_left_out_by_null) {
                                left_out.push(place.key().clone());
                            }
                            place.insert(value);
                        }
                        Err(error) => return Err(self.failed(Step::Key(place.key().clone()), error)),
                    }
                }
            }
        }
        self.width.set(width);
        // Until here, so that a key twice is seen.
        for name in left_out {
            fields.remove(&name);
        }
        Ok(Value::Object(fields))
    }
}

/// A value of which nothing is kept: nested too deeply and numbers out of range are told of it all the same.
struct Skipped<'a>(Strict<'a>);

impl<'de> DeserializeSeed<'de> for Skipped<'_> {
    type Value = ();
    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Skipped<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON value")
    }
    fn visit_unit<E>(self) -> Result<(), E> {
        Ok(())
    }
    fn visit_bool<E>(self, _: bool) -> Result<(), E> {
        Ok(())
    }
    fn visit_u64<E: serde::de::Error>(self, value: u64) -> Result<(), E> {
        self.0.visit_u64(value).map(drop)
    }
    fn visit_i64<E: serde::de::Error>(self, value: i64) -> Result<(), E> {
        self.0.visit_i64(value).map(drop)
    }
    fn visit_f64<E: serde::de::Error>(self, value: f64) -> Result<(), E> {
        self.0.visit_f64(value).map(drop)
    }
    fn visit_str<E>(self, _: &str) -> Result<(), E> {
        Ok(())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut access: A) -> Result<(), A::Error> {
        let inside = self.0.inside()?;
        let mut count = 0;
        loop {
            match access.next_element_seed(Skipped(inside)) {
                Ok(Some(())) => count += 1,
                Ok(None) => return Ok(()),
                Err(error) => return Err(self.0.failed(Step::Index(count), error)),
            }
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, mut access: A) -> Result<(), A::Error> {
        let inside = self.0.inside()?;
        while access.next_key::<IgnoredAny>()?.is_some() {
            access.next_value_seed(Skipped(inside))?;
        }
        Ok(())
    }
}

/// The name of a field; one that has no place in the shape is cut to what can be shown.
struct Name<'a>(&'a Shape);

impl<'de> DeserializeSeed<'de> for Name<'_> {
    type Value = String;
    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<String, D::Error> {
        deserializer.deserialize_str(self)
    }
}

impl Visitor<'_> for Name<'_> {
    type Value = String;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a name")
    }
    fn visit_str<E>(self, name: &str) -> Result<String, E> {
        if name.len() <= LONGEST_UNKNOWN || self.0.field(name).is_some() {
            return Ok(name.to_owned());
        }
        Ok(format!("{}…", &name[..name.floor_char_boundary(LONGEST_UNKNOWN)]))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::panic)]
mod tests {
    use super::*;
    use crate::registry::canonical;
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

    proptest! {
        #[test]
        fn a_field_is_added_where_canonical_json_has_it(names in proptest::collection::btree_set("[a-z_]{1,6}", 0..6)) {
            let all: serde_json::Map<_, _> = names.iter().map(|name| (name.clone(), json!({ "of": [name, "}\",:"] }))).collect();
            for name in &names {
                let mut rest = all.clone();
                let taken = rest.shift_remove(name).unwrap();
                let (rest, taken) = (canonical(&rest).unwrap(), canonical(&taken).unwrap());
                let with = with_top_level(&rest, name, &taken);
                prop_assert_eq!(String::from_utf8(with).unwrap(), String::from_utf8(canonical(&all).unwrap()).unwrap());
            }
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
    fn a_number_is_no_longer_than_numbers_are() {
        let digits = |count| "1".repeat(count);
        let fault = refused(&format!("{{\"a\":\n  0.{}}}", digits(LONGEST_NUMBER)));
        assert_eq!((fault.code, fault.line, fault.column), ("number_too_long", 2, 3));
        let longest = format!("[0.{}, {:?}]", digits(LONGEST_NUMBER - 2), digits(9 * LONGEST_NUMBER));
        assert!((parse(longest.as_bytes()).unwrap()[0].as_f64().unwrap() - 1.0 / 9.0).abs() < 1e-15);
    }

    fn shape() -> Shape {
        Shape::of(&json!({"type": "object", "additionalProperties": false, "properties": {
            "rows": {"type": "array", "maxItems": 3, "items": {
                "type": "object", "additionalProperties": false, "properties": {"z": {"type": "number"}},
            }},
            "number": {"type": "number"},
        }}))
    }

    #[test]
    fn of_what_does_not_fit_the_shape_only_as_much_is_kept_as_shows_it() {
        let read = |text: &str| parse_as(text.as_bytes(), &shape(), &Room::default()).unwrap();
        let long = "x".repeat(5000);
        let parsed =
            read(&format!("{{\"rows\": [{{\"z\": 1, \"y\": [[]]}}, 2, [3], 4, 5], \"number\": [1, 2], {long:?}: 1}}"));
        let cut = format!("{}…", "x".repeat(LONGEST_UNKNOWN));
        let kept = json!({"rows": [{"z": 1, "y": null}, 2, [], cut_short_at(5)], "number": [], cut: null});
        assert_eq!((parsed.value, parsed.left_out), (kept, 0));
        let names: Vec<String> = (0..MOST_UNKNOWN + 7).map(|number| format!("\"n{number}\":0")).collect();
        let parsed = read(&format!("{{\"rows\":[{{{}}}],\"number\":1}}", names.join(",")));
        assert_eq!((parsed.left_out, parsed.value["number"].as_u64()), (7, Some(1)));
        assert_eq!(parsed.value["rows"][0].as_object().unwrap().len(), MOST_UNKNOWN);
    }

    #[test]
    fn of_a_text_where_there_may_be_none_the_beginning_is_kept() {
        let shape = Shape::of(&json!({"type": "object", "properties": {
            "number": {"type": "number"},
            "choice": {"type": "string", "enum": ["one"]},
            "text": {"type": "string"},
            "either": {"oneOf": [{"type": "number"}, {"type": "string"}]},
            "rows": {"type": "array", "maxItems": 3, "items": {"type": "object", "properties": {}}},
        }}));
        let long = "\u{e9}".repeat(5000);
        for (place, kept) in [
            (json!({"number": long}), LONGEST_MISFIT),
            (json!({"choice": long}), LONGEST_MISFIT),
            (json!({"rows": long}), LONGEST_MISFIT),
            (json!({"text": long}), long.len()),
            (json!({"either": long}), long.len()),
            (json!({"rows": {"csv": long}}), long.len()),
        ] {
            let read = parse_as(place.to_string().as_bytes(), &shape, &Room::default()).unwrap().value;
            let (name, value) = read.as_object().unwrap().iter().next().unwrap();
            let text = value.get("csv").unwrap_or(value).as_str().unwrap();
            assert_eq!((text.len(), long.starts_with(text)), (kept, true), "{name}");
        }
        // What is kept for good is charged.
        let budget = crate::engine::budget::Budget::new(4 << 20);
        let text = json!({"text": "x".repeat(1 << 20)}).to_string();
        let room = Room::of(&budget, 0);
        assert!(parse_as(text.as_bytes(), &shape, &room).is_ok() && budget.used() >= 1 << 20);
    }

    #[test]
    fn what_is_not_kept_is_held_to_depth_and_range_all_the_same() {
        let code = |text: String| match parse_as(text.as_bytes(), &shape(), &Room::default()) {
            Err(Error::Syntax(fault)) => Some(fault.code),
            other => other.map(|_| None).unwrap(),
        };
        let nested = |depth: usize| format!("{}1{}", "[".repeat(depth), "]".repeat(depth));
        let in_field = |name: &str, depth: usize| format!("{{\"{name}\":{}}}", nested(depth - 1));
        assert_eq!(code(nested(DEEPEST)), None);
        assert_eq!(code(nested(DEEPEST + 1)), Some("nested_too_deeply"));
        for name in ["number", "unknown"] {
            assert_eq!(code(in_field(name, DEEPEST)), None, "{name}");
            assert_eq!(code(in_field(name, DEEPEST + 1)), Some("nested_too_deeply"), "{name}");
            assert_eq!(code(format!("{{\"{name}\":[1e400]}}")), Some("number_out_of_range"), "{name}");
        }
    }

    #[test]
    fn a_body_takes_no_more_than_the_budget() {
        let budget = crate::engine::budget::Budget::new(1 << 20);
        let body = format!("[{}1]", "{\"a\":[1,2]},".repeat(10_000));
        let room = Room::of(&budget, 0);
        let refused = parse_as(body.as_bytes(), Shape::open(), &room);
        assert!(matches!(refused, Err(Error::Busy { .. })), "{refused:?}");
        assert!(budget.used() <= 1 << 20);
        drop(room);
        assert!(parse_as(body.as_bytes(), Shape::open(), &Room::default()).is_ok());
        assert_eq!(budget.used(), 0);
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
