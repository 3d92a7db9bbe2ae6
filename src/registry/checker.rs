//! A compiled schema that names every fault of a value.

use std::sync::OnceLock;

use jsonschema::Validator;
use precut_calc::calculator::Finding;
use serde_json::{Map, Value};

use super::RegistryError;
use super::fault::{report, too_many_items};

/// A compiled schema. The items of its arrays are checked one by one, each against a checker of their own and none
/// beyond the most that the array may hold, so that a hostile body of a million bad cells costs no more memory than
/// the faults that are kept.
#[derive(Debug)]
pub(crate) struct Checker {
    validator: Validator,
    schema: Value,
    arrays: Vec<ArrayItems>,
}

/// The items of an array inside a value.
#[derive(Debug)]
struct ArrayItems {
    /// Names of the fields that lead to the array.
    path: Vec<String>,
    /// Which variants of unions on the way the array belongs to.
    variants: Vec<Variant>,
    /// No item beyond this is looked at: the array is too long anyway.
    most: usize,
    items: Checker,
}

/// The variant `word` of the union at `path`, told by its field `tag`.
#[derive(Debug, Clone)]
struct Variant {
    path: Vec<String>,
    tag: String,
    word: Value,
}

/// What the items of a list have to be, each on its own: for lists that are too long to be kept before they are known to be
/// in order.
#[derive(Debug)]
pub(crate) struct ItemRules {
    /// The schema of the list.
    list: Value,
    items: OnceLock<Option<Checker>>,
}

impl ItemRules {
    /// Of a list's schema in the form of [`super::schema::strict`].
    pub(super) fn of(list: &Value) -> Self {
        Self { list: list.clone(), items: OnceLock::new() }
    }

    /// Adds every fault of one item, which stands at `pointer`.
    pub(crate) fn check(&self, item: &Value, pointer: impl FnOnce() -> String, faults: &mut Faults) {
        let items = self.items.get_or_init(|| {
            Checker::new(self.list["items"].clone())
                .inspect_err(|error| tracing::error!(%error, "the schema of a list's items does not stand alone"))
                .ok()
        });
        if let Some(items) = items.as_ref().filter(|items| !items.accepts(item)) {
            items.check(item, &pointer(), faults);
        }
    }

    /// The fault of a list at the place itself that has so many items, more than it may have.
    pub(crate) fn too_many(&self, items: usize) -> Finding {
        too_many_items("", items, &self.list)
    }
}

/// Faults found, the first of them kept.
#[derive(Debug, Default)]
pub(crate) struct Faults {
    pub(crate) listed: Vec<Finding>,
    pub(crate) total: usize,
}

impl Faults {
    /// More than are ever shown, so that sorting by pointer still shows those that come first.
    const KEPT: usize = 1000;

    pub(crate) fn add(&mut self, finding: Finding) {
        self.add_with(|| finding);
    }
    /// Adds what others found.
    pub(crate) fn extend(&mut self, found: Self) {
        self.total += found.total;
        let room = Self::KEPT.saturating_sub(self.listed.len());
        self.listed.extend(found.listed.into_iter().take(room));
    }
    /// Adds a fault that is only made if it is kept.
    pub(crate) fn add_with(&mut self, finding: impl FnOnce() -> Finding) {
        self.total += 1;
        if self.listed.len() < Self::KEPT {
            self.listed.push(finding());
        }
    }
}

impl Checker {
    /// Compiles a schema in the form of [`super::schema::strict`].
    pub(crate) fn new(mut strict: Value) -> Result<Self, RegistryError> {
        let mut arrays = Vec::new();
        hoist(&mut strict, &mut Vec::new(), &mut Vec::new(), &mut arrays)?;
        let validator =
            jsonschema::draft202012::new(&strict).map_err(|error| RegistryError::BadSchema(error.to_string()))?;
        Ok(Self { validator, schema: strict, arrays })
    }

    /// Adds every fault of `value`, which stands at `pointer`.
    pub(crate) fn check(&self, value: &Value, pointer: &str, faults: &mut Faults) {
        if !self.validator.is_valid(value) {
            for error in self.validator.iter_errors(value) {
                report(&error, &self.schema, pointer, faults);
            }
        }
        for array in &self.arrays {
            let Some(items) = array.items_in(value) else { continue };
            let pointer = array.path.iter().fold(pointer.to_owned(), |pointer, name| child(&pointer, name));
            for (index, item) in items.iter().take(array.most).enumerate() {
                if !array.items.accepts(item) {
                    array.items.check(item, &format!("{pointer}/{index}"), faults);
                }
            }
        }
    }

    fn accepts(&self, value: &Value) -> bool {
        self.validator.is_valid(value)
            && self.arrays.iter().all(|array| {
                let items = array.items_in(value).unwrap_or_default();
                items.iter().take(array.most).all(|item| array.items.accepts(item))
            })
    }
}

impl ArrayItems {
    /// The array's items in `value`, if it is there and its variants are those meant.
    fn items_in<'a>(&self, value: &'a Value) -> Option<&'a [Value]> {
        let at = |path: &[String]| path.iter().try_fold(value, |value, name| value.get(name));
        let meant =
            |variant: &Variant| at(&variant.path).and_then(|union| union.get(&variant.tag)) == Some(&variant.word);
        if !self.variants.iter().all(meant) {
            return None;
        }
        at(&self.path)?.as_array().map(Vec::as_slice)
    }
}

/// Takes the items of arrays out of `schema` and compiles them apart.
fn hoist(
    schema: &mut Value,
    path: &mut Vec<String>,
    variants: &mut Vec<Variant>,
    arrays: &mut Vec<ArrayItems>,
) -> Result<(), RegistryError> {
    let Value::Object(map) = schema else { return Ok(()) };
    let most = map.get("maxItems").and_then(Value::as_u64).and_then(|most| usize::try_from(most).ok());
    if map.get("prefixItems").is_none()
        && let Some(items) = map.get_mut("items").filter(|items| items.is_object())
    {
        let items = Checker::new(std::mem::replace(items, Value::Object(Map::new())))?;
        let most = most.unwrap_or(usize::MAX);
        arrays.push(ArrayItems { path: path.clone(), variants: variants.clone(), most, items });
    }
    if let Some(Value::Object(properties)) = map.get_mut("properties") {
        for (name, property) in properties {
            path.push(name.clone());
            hoist(property, path, variants, arrays)?;
            path.pop();
        }
    }
    let Some(tag) = map.get("x-tag").and_then(Value::as_str).map(str::to_owned) else { return Ok(()) };
    for branch in map.get_mut("allOf").and_then(Value::as_array_mut).into_iter().flatten() {
        let word = branch["if"]["properties"][&tag]["const"].clone();
        variants.push(Variant { path: path.clone(), tag: tag.clone(), word });
        hoist(&mut branch["then"], path, variants, arrays)?;
        variants.pop();
    }
    Ok(())
}

/// `pointer` extended by a field's name (RFC 6901).
pub(crate) fn child(pointer: &str, name: &str) -> String {
    if name.contains(['~', '/']) {
        format!("{pointer}/{}", name.replace('~', "~0").replace('/', "~1"))
    } else {
        format!("{pointer}/{name}")
    }
}

/// In the order of the document's tree: names by alphabet, indices by number.
pub(crate) fn by_pointer(a: &Finding, b: &Finding) -> std::cmp::Ordering {
    let parts = |finding: &Finding| -> Vec<(u64, String)> {
        finding
            .pointer
            .split('/')
            .map(|part| {
                part.parse::<u64>().map_or_else(|_| (u64::MAX, part.to_owned()), |index| (index, String::new()))
            })
            .collect()
    };
    parts(a).cmp(&parts(b)).then_with(|| a.code.cmp(b.code))
}
