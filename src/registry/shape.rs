//! What a job may be made of at each place, read off its schema: what the reader of JSON keeps, so that a body that will
//! be refused costs little more memory than its own bytes.
//!
//! A shape is wider than the schema: the variants of a union are one. What does not fit a shape breaks the schema.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use serde_json::Value;

use super::checker::ItemRules;

/// A list that may have more items is too long to be kept whole before it is known to be in order.
const LONG_LIST: usize = 1000;

/// What may stand at a place.
#[derive(Debug, Clone, Default)]
pub(crate) struct Shape {
    /// Fields by name.
    fields: BTreeMap<String, Shape>,
    /// Fields of any other name.
    further: Option<Box<Shape>>,
    /// Items of a list.
    items: Option<Box<Shape>>,
    /// How many items; unbounded where the schema names no most.
    most_items: Option<usize>,
    /// What the items of a long list have to be, by the variants of the place.
    rules: Vec<Arc<ItemRules>>,
    /// Items that are not held to them.
    spared: BTreeSet<usize>,
    /// A text of any words may stand here.
    text: bool,
    /// Nothing is said of what stands here.
    open: bool,
    /// A field that need not be there, and whose value is never null: null says that it is not there.
    optional: bool,
}

/// A place of which nothing is known.
static OPEN: Shape = Shape {
    fields: BTreeMap::new(),
    further: None,
    items: None,
    most_items: None,
    rules: Vec::new(),
    spared: BTreeSet::new(),
    text: true,
    open: true,
    optional: false,
};

impl Shape {
    /// A place of which nothing is known.
    pub(crate) fn open() -> &'static Self {
        &OPEN
    }

    /// What a schema in the form of [`super::schema::strict`] lets stand.
    pub(crate) fn of(strict: &Value) -> Self {
        let mut shape = Self::default();
        shape.add(strict);
        shape
    }

    /// What either lets stand.
    pub(crate) fn join(&mut self, other: Self) {
        for (name, field) in other.fields {
            match self.fields.entry(name) {
                Entry::Occupied(mut own) => {
                    let optional = own.get().optional && field.optional;
                    own.get_mut().join(field);
                    own.get_mut().optional = optional;
                }
                Entry::Vacant(place) => {
                    place.insert(field);
                }
            }
        }
        join(&mut self.further, other.further);
        match (&mut self.items, other.items) {
            (Some(items), Some(more)) => {
                items.join(*more);
                self.most_items = self.most_items.zip(other.most_items).map(|(one, other)| one.max(other));
            }
            (items @ None, Some(more)) => (*items, self.most_items) = (Some(more), other.most_items),
            (_, None) => {}
        }
        self.rules.extend(other.rules);
        self.text |= other.text;
        self.open |= other.open;
    }

    /// A list of so many at most.
    pub(crate) fn list_of(item: Self, most: usize) -> Self {
        Self { items: Some(Box::new(item)), most_items: Some(most), ..Self::default() }
    }

    /// Lets more stand where a way leads; `*` are the items of a list.
    pub(crate) fn let_in(&mut self, way: &[&str], more: Self) {
        match way.split_first() {
            None => self.join(more),
            Some((&"*", rest)) => self.items.get_or_insert_default().let_in(rest, more),
            Some((name, rest)) => self.fields.entry((*name).to_owned()).or_default().let_in(rest, more),
        }
    }

    /// The same with another shape for one of its fields.
    pub(crate) fn with_field(mut self, name: &str, field: Self) -> Self {
        self.fields.insert(name.to_owned(), field);
        self
    }

    /// Holds no item to anything that a way leads into.
    pub(crate) fn spare(&mut self, way: &[String]) {
        let Some((step, rest)) = way.split_first() else { return };
        if let Some(field) = self.fields.get_mut(step) {
            field.spare(rest);
        } else if let (Some(items), Ok(index)) = (&mut self.items, step.parse()) {
            self.spared.insert(index);
            items.spare(rest);
        }
    }

    fn add(&mut self, strict: &Value) {
        let Some(map) = strict.as_object() else { return };
        let part = |name: &str| map.get(name);
        let required = |name: &str| {
            part("required").and_then(Value::as_array).is_some_and(|all| all.iter().any(|one| one == name))
        };
        for (name, property) in part("properties").and_then(Value::as_object).into_iter().flatten() {
            // A field of several variants is left out of none that needs it.
            let elsewhere = self.fields.get(name).is_none_or(|field| field.optional);
            let field = self.fields.entry(name.clone()).or_default();
            field.add_or_open(property);
            field.optional = elsewhere && !required(name) && says_no_null(property);
        }
        if let Some(further) = part("additionalProperties").filter(|further| **further != Value::Bool(false)) {
            self.further.get_or_insert_default().add_or_open(further);
        }
        if let Some(patterns) = part("patternProperties").and_then(Value::as_object) {
            patterns.values().for_each(|pattern| self.further.get_or_insert_default().add_or_open(pattern));
        }
        let mut items: Vec<&Value> = part("items").into_iter().collect();
        items.extend(part("prefixItems").and_then(Value::as_array).into_iter().flatten());
        if !items.is_empty() {
            let most = part("maxItems").and_then(Value::as_u64).and_then(|most| usize::try_from(most).ok());
            let is_long = most.is_some_and(|most| most > LONG_LIST) && part("prefixItems").is_none();
            let rules = is_long.then(|| Arc::new(ItemRules::of(strict))).into_iter().collect();
            let mut shape = Self { items: Some(Box::default()), most_items: most, rules, ..Self::default() };
            for item in items {
                shape.items.get_or_insert_default().add_or_open(item);
            }
            self.join(shape);
        }
        for list in ["allOf", "anyOf", "oneOf"] {
            for branch in part(list).and_then(Value::as_array).into_iter().flatten() {
                self.add(branch);
            }
        }
        for branch in ["then", "else"] {
            if let Some(branch) = part(branch) {
                self.add(branch);
            }
        }
        // An object of which no field is named, and a list of which no item is, may hold anything.
        let has = |names: &[&str]| names.iter().any(|name| part(name).is_some());
        let may_be = |kind: &str| {
            let is = |one: &Value| one == kind;
            part("type").is_some_and(|kinds| is(kinds) || kinds.as_array().is_some_and(|kinds| kinds.iter().any(is)))
        };
        let is_any_object =
            may_be("object") && !has(&["properties", "additionalProperties", "patternProperties", "allOf"]);
        self.text |= may_be("string") && !has(&["enum", "const"]);
        let is_any_list = may_be("array") && !has(&["items", "prefixItems"]);
        self.open |= is_any_object || is_any_list;
    }

    /// What is named by nothing but its place may be anything.
    fn add_or_open(&mut self, strict: &Value) {
        const SAYING: [&str; 9] =
            ["type", "properties", "items", "prefixItems", "allOf", "anyOf", "oneOf", "enum", "const"];
        match strict.as_object() {
            Some(map) if SAYING.iter().any(|name| map.contains_key(*name)) => self.add(strict),
            _ => self.open = true,
        }
    }

    /// What may stand in a field; nothing where there is none of that name.
    pub(crate) fn field(&self, name: &str) -> Option<&Self> {
        // Rows may come as the text of a table in their place.
        let is_text_of_rows = || name == "csv" && self.items.is_some();
        let further = || self.further.as_deref();
        self.fields.get(name).or_else(further).or_else(|| (self.open || is_text_of_rows()).then(Self::open))
    }

    /// What the items of a long list have to be, by the variants of the place; nothing where no list is long.
    pub(crate) fn item_rules(&self) -> &[Arc<ItemRules>] {
        &self.rules
    }

    /// Whether the item at `index` is held to them.
    pub(crate) fn holds_item(&self, index: usize) -> bool {
        !self.spared.contains(&index)
    }

    /// Whether a text of any length may stand here.
    pub(crate) fn holds_text(&self) -> bool {
        self.text || self.open
    }

    /// Whether null in this field says that it is not there.
    pub(crate) fn is_left_out_by_null(&self) -> bool {
        self.optional
    }

    /// What may stand in a list, and how many; nothing where there may be no list.
    pub(crate) fn items(&self) -> Option<(&Self, usize)> {
        match &self.items {
            Some(items) => Some((items, self.most_items.unwrap_or(usize::MAX))),
            None => self.open.then(|| (Self::open(), usize::MAX)),
        }
    }
}

/// Whether a schema names types, and null is none of them.
fn says_no_null(strict: &Value) -> bool {
    match strict.get("type") {
        Some(Value::String(kind)) => kind != "null",
        Some(Value::Array(kinds)) => kinds.iter().all(|kind| kind != "null"),
        _ => false,
    }
}

fn join(here: &mut Option<Box<Shape>>, more: Option<Box<Shape>>) {
    match (here, more) {
        (Some(here), Some(more)) => here.join(*more),
        (here @ None, more) => *here = more,
        (Some(_), None) => {}
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn lists_have_their_most_and_unions_are_one() {
        let shape = Shape::of(&json!({
            "type": "object",
            "properties": {
                "rows": {"type": "array", "maxItems": 3, "items": {"type": "object", "properties": {"a": {"type": "number"}}}},
                "one": {"x-tag": "kind", "allOf": [
                    {"if": {}, "then": {"properties": {"kind": {"const": "x"}, "z": {"type": "array", "items": {}}}}},
                    {"if": {}, "then": {"properties": {"kind": {"const": "y"}, "w": {"type": "number"}}}},
                ]},
                "map": {"type": "object", "additionalProperties": {"type": "number"}},
                "any": {"type": "object"},
                "list": {"type": "array"},
                "whatever": {"description": "of no type"},
                "number": {"type": "number"},
            },
            "additionalProperties": false,
        }));
        let rows = shape.field("rows").unwrap();
        assert_eq!(rows.items().unwrap().1, 3);
        assert!(rows.items().unwrap().0.field("a").is_some() && rows.items().unwrap().0.field("b").is_none());
        assert!(rows.field("csv").is_some() && rows.field("other").is_none());
        let one = shape.field("one").unwrap();
        assert!(one.field("z").is_some() && one.field("w").is_some() && one.field("v").is_none());
        assert!(shape.field("map").unwrap().field("whatever").unwrap().items().is_none());
        assert!(shape.field("any").unwrap().field("x").unwrap().items().is_some());
        assert!(
            shape.field("number").unwrap().items().is_none() && shape.field("number").unwrap().field("x").is_none()
        );
        assert!(shape.field("list").unwrap().items().is_some() && shape.field("whatever").unwrap().items().is_some());
        assert!(shape.field("unknown").is_none());
    }

    #[test]
    fn null_leaves_out_what_no_variant_needs_and_none_takes() {
        let variant = |required: &[&str]| {
            json!({"type": "object", "required": required, "properties": {
                "a": {"type": "number"}, "b": {"type": ["number", "null"]}, "c": {}, "d": {"type": "object"},
            }})
        };
        let left_out =
            |shape: &Shape| ["a", "b", "c", "d"].map(|name| shape.field(name).unwrap().is_left_out_by_null());
        let free = Shape::of(&variant(&[]));
        assert_eq!(left_out(&free), [true, false, false, true]);
        assert_eq!(
            left_out(&Shape::of(&json!({"allOf": [variant(&["a"]), variant(&[])]}))),
            [false, false, false, true]
        );
        let mut joined = Shape::default();
        joined.join(free);
        assert_eq!(left_out(&joined), [true, false, false, true]);
        joined.join(Shape::of(&variant(&["d"])));
        assert_eq!(left_out(&joined), [true, false, false, false]);
    }
}
