//! The visitor that makes a value, and notes where and why it stops.

use std::cell::{Cell, RefCell};
use std::fmt;

use serde::de::{DeserializeSeed, Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde_json::map::Entry;
use serde_json::{Map, Number, Value};

use super::{HEAD_ITEMS, LARGEST_INTEGER, number};
use crate::engine::budget::Room;
use crate::registry::{Faults, Shape, child, cut_short_at};

/// Deepest nesting; below the parser's own limit of 128, so that the fault can be named with its place.
pub(super) const DEEPEST: usize = 100;
/// Names that no field has, of all objects of a job together: more than are ever shown, so that sorting by pointer still
/// shows those that come first. Of further ones only the count is kept.
pub(super) const MOST_UNKNOWN: usize = 1000;
/// So many bytes of such a name are kept.
pub(super) const LONGEST_UNKNOWN: usize = 100;
/// So many bytes of a text are kept where there may be none: more than are ever shown.
pub(super) const LONGEST_MISFIT: usize = 1000;
/// What a value and a field take beside what they hold, bytes.
const VALUE_BYTES: usize = size_of::<Value>();
/// A list that grows has room for as many items again.
const ITEM_BYTES: usize = 2 * VALUE_BYTES;
const FIELD_BYTES: usize = VALUE_BYTES + size_of::<String>() + 3 * size_of::<usize>();

/// Why and where reading stopped; the steps are noted from the inside out, on failure only.
#[derive(Default)]
pub(super) struct Trail {
    pub(super) steps: RefCell<Vec<Step>>,
    pub(super) code: RefCell<Option<&'static str>>,
}

pub(super) enum Step {
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
pub(super) struct Beyond {
    /// Theirs, with pointers from the value that is being read.
    pub(super) faults: RefCell<Faults>,
    pub(super) is_any: Cell<bool>,
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
pub(super) struct Strict<'a> {
    pub(super) trail: &'a Trail,
    pub(super) depth: usize,
    pub(super) shape: &'a Shape,
    pub(super) room: &'a Room,
    /// Fields so far that have no name in the shape.
    pub(super) unknown: &'a Cell<usize>,
    /// Fields of the object before this one in its list: this one will have as many.
    pub(super) width: &'a Cell<usize>,
    /// Where long lists are not kept whole.
    pub(super) beyond: Option<&'a Beyond>,
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
