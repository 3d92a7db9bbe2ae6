//! A compiled schema that names every fault of a value.

use jsonschema::Validator;
use precut_calc::calculator::Finding;
use serde_json::{Map, Value};

use super::RegistryError;
use super::fault::findings;

/// Arrays that may hold more items than this are checked item by item, so that a large table of bad cells costs
/// no more memory than the faults that are listed.
const LARGE: u64 = 64;

/// A compiled schema.
pub(crate) struct Checker {
    validator: Validator,
    schema: Value,
    large: Vec<LargeArray>,
}

/// An array whose items are checked apart.
struct LargeArray {
    /// Names of the fields that lead to it.
    path: Vec<String>,
    items: Checker,
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
        self.total += 1;
        if self.listed.len() < Self::KEPT {
            self.listed.push(finding);
        }
    }
    pub(crate) fn extend(&mut self, findings: impl IntoIterator<Item = Finding>) {
        findings.into_iter().for_each(|finding| self.add(finding));
    }
}

impl Checker {
    /// Compiles a schema in the form of [`super::schema::strict`].
    pub(crate) fn new(mut strict: Value) -> Result<Self, RegistryError> {
        let mut large = Vec::new();
        hoist(&mut strict, &mut Vec::new(), &mut large)?;
        let validator =
            jsonschema::draft202012::new(&strict).map_err(|error| RegistryError::BadSchema(error.to_string()))?;
        Ok(Self { validator, schema: strict, large })
    }

    /// Adds every fault of `value`, which stands at `pointer`.
    pub(crate) fn check(&self, value: &Value, pointer: &str, faults: &mut Faults) {
        if !self.validator.is_valid(value) {
            for error in self.validator.iter_errors(value) {
                faults.extend(findings(&error, &self.schema, pointer));
            }
        }
        for array in &self.large {
            let found = array.path.iter().try_fold(value, |value, name| value.get(name));
            let Some(Value::Array(items)) = found else { continue };
            let pointer = array.path.iter().fold(pointer.to_owned(), |pointer, name| child(&pointer, name));
            for (index, item) in items.iter().enumerate() {
                if !array.items.accepts(item) {
                    array.items.check(item, &format!("{pointer}/{index}"), faults);
                }
            }
        }
    }

    fn accepts(&self, value: &Value) -> bool {
        self.large.is_empty() && self.validator.is_valid(value)
    }
}

/// Takes the items of large arrays out of `schema` and compiles them apart.
fn hoist(schema: &mut Value, path: &mut Vec<String>, large: &mut Vec<LargeArray>) -> Result<(), RegistryError> {
    let Value::Object(map) = schema else { return Ok(()) };
    let is_large = map.get("maxItems").and_then(Value::as_u64).is_none_or(|most| most > LARGE);
    if is_large
        && map.get("prefixItems").is_none()
        && let Some(items) = map.get_mut("items").filter(|items| items.is_object())
    {
        let items = std::mem::replace(items, Value::Object(Map::new()));
        large.push(LargeArray { path: path.clone(), items: Checker::new(items)? });
    }
    if let Some(Value::Object(properties)) = map.get_mut("properties") {
        for (name, property) in properties {
            path.push(name.clone());
            hoist(property, path, large)?;
            path.pop();
        }
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
