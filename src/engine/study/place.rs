//! What a pointer means, by the schema of a job or of a result.

use std::collections::BTreeSet;

use serde_json::Value;

use super::expand::index;

/// A field that a pointer leads to.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Field {
    /// The numbers that it may be.
    pub(crate) numbers: Option<Numbers>,
    /// It may be true or false.
    pub(crate) truth: bool,
    /// It may be a word.
    pub(crate) word: bool,
    /// The words that it may be, where they are listed.
    pub(crate) options: Vec<String>,
    /// Unit as in the contract.
    pub(crate) unit: Option<String>,
}

/// Which numbers a field may be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Numbers {
    /// Any.
    Any,
    /// Whole ones.
    Whole,
}

impl Field {
    /// One that may be anything.
    pub(crate) fn any() -> Self {
        Self { numbers: Some(Numbers::Any), truth: true, word: true, ..Self::default() }
    }

    /// Whether it may be a number.
    pub(crate) fn is_number(&self) -> bool {
        self.numbers.is_some()
    }

    /// Whether, as a number, it must be a whole one.
    pub(crate) fn is_whole(&self) -> bool {
        self.numbers == Some(Numbers::Whole)
    }

    /// Whether it holds one thing and not several.
    pub(crate) fn is_scalar(&self) -> bool {
        self.is_number() || self.truth || self.word
    }

    /// The JSON types of its values.
    pub(crate) fn types(&self) -> Vec<&'static str> {
        let number = if self.is_whole() { "integer" } else { "number" };
        [(self.is_number(), number), (self.truth, "boolean"), (self.word, "string")]
            .into_iter()
            .filter_map(|(may, name)| may.then_some(name))
            .collect()
    }
}

/// Why a pointer leads nowhere.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Lost {
    /// There is no field of that name at that place; there are these.
    NoField { name: String, at: String, known: Vec<String> },
    /// The array is shorter.
    NoItem { index: String, at: String, length: usize },
}

/// The field that `tokens` lead to in a value of `schema` (the strict form of the registry). `value` is the value that
/// is there, where it decides which variant of a union is meant and which items an array has; without it any variant
/// and any item will do.
pub(crate) fn field(schema: &Value, value: Option<&Value>, tokens: &[String]) -> Result<Field, Lost> {
    let judged = value.is_some();
    let mut nodes = vec![schema];
    let mut value = value;
    let mut at = String::new();
    for token in tokens {
        let forms: Vec<&Value> = nodes.iter().flat_map(|node| forms(node, value)).collect();
        let arrays: Vec<&Value> = forms.iter().copied().filter(|form| form["items"].is_object()).collect();
        let mut inner: Vec<&Value> = Vec::new();
        if !arrays.is_empty() && index(token).is_some() {
            let length = value.and_then(Value::as_array).map_or(0, Vec::len);
            if judged && index(token).is_none_or(|index| index >= length) {
                return Err(Lost::NoItem { index: token.clone(), at, length });
            }
            inner.extend(arrays.iter().map(|form| &form["items"]));
        }
        inner.extend(forms.iter().filter_map(|form| form["properties"].get(token)));
        inner.extend(forms.iter().map(|form| &form["additionalProperties"]).filter(|free| free.is_object()));
        if inner.is_empty() {
            return Err(Lost::NoField { name: token.clone(), at, known: known(&forms) });
        }
        value = match value {
            Some(Value::Array(items)) => index(token).and_then(|index| items.get(index)),
            Some(value) => value.get(token),
            None => None,
        };
        at = crate::registry::child(&at, token);
        nodes = inner;
    }
    Ok(nodes.iter().flat_map(|node| forms(node, value)).fold(Field::default(), merged))
}

/// The node and those of its variants that the value belongs to.
fn forms<'s>(node: &'s Value, value: Option<&Value>) -> Vec<&'s Value> {
    let mut found = vec![node];
    let tag = node["x-tag"].as_str();
    for branch in node["allOf"].as_array().into_iter().flatten() {
        let Some(then) = branch.get("then") else {
            found.extend(forms(branch, value));
            continue;
        };
        let word = tag.map(|tag| &branch["if"]["properties"][tag]["const"]);
        let given = tag.and_then(|tag| value?.get(tag));
        if given.is_none() || given == word {
            found.extend(forms(then, value));
        }
    }
    for keyword in ["oneOf", "anyOf"] {
        found.extend(node[keyword].as_array().into_iter().flatten().flat_map(|form| forms(form, value)));
    }
    found
}

fn known(forms: &[&Value]) -> Vec<String> {
    let names: BTreeSet<&String> =
        forms.iter().filter_map(|form| form["properties"].as_object()).flat_map(serde_json::Map::keys).collect();
    names.into_iter().cloned().collect()
}

fn merged(mut field: Field, form: &Value) -> Field {
    let is = |kind: &str| match &form["type"] {
        Value::Array(kinds) => kinds.iter().any(|one| one == kind),
        one => one == kind,
    };
    field.numbers = match (field.numbers, is("number"), is("integer")) {
        (Some(Numbers::Any), ..) | (_, true, _) => Some(Numbers::Any),
        (known, false, false) => known,
        (_, false, true) => Some(Numbers::Whole),
    };
    field.truth |= is("boolean");
    field.word |= is("string");
    let options = form["enum"].as_array().into_iter().flatten().chain(form.get("const"));
    for word in options.filter_map(Value::as_str) {
        field.word = true;
        if !field.options.iter().any(|known| known == word) {
            field.options.push(word.to_owned());
        }
    }
    field.unit = field.unit.or_else(|| form["x-unit"].as_str().map(str::to_owned));
    field
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::super::expand::tokens;
    use super::*;
    use crate::registry::toy;
    use serde_json::json;

    fn at(pointer: &str, job: &Value) -> Result<Field, Lost> {
        let registry = toy::registry();
        field(registry.entry("toy-bar").unwrap().strict_input(), Some(job), &tokens(pointer).unwrap())
    }

    #[test]
    fn numbers_words_and_variants_are_found() {
        let job = json!({"length_mm": 500, "segments": [{"diameter_mm": 20}],
            "support": {"kind": "elastic", "compliance_um_per_n": 1}});
        let length = at("/length_mm", &job).unwrap();
        assert_eq!((length.is_number(), length.word, length.unit.as_deref()), (true, false, Some("mm")));
        assert!(at("/segments/0/diameter_mm", &job).unwrap().is_number());
        assert!(at("/youngs_modulus_n_per_mm2", &job).unwrap().is_number(), "absent, but it has a default");
        assert_eq!(at("/support/compliance_um_per_n", &job).unwrap().unit.as_deref(), Some("um/N"));
        assert!(at("/steady/compliance_um_per_n", &job).unwrap().is_number(), "absent: any variant will do");
        let mode = at("/mode", &job).unwrap();
        assert!(mode.word && mode.options.contains(&"slow".to_owned()));
        assert!(at("/support/kind", &job).unwrap().options.contains(&"rigid".to_owned()));
        let count = at("/stations", &job).unwrap();
        assert!(count.is_whole(), "a count or a list");
        assert!(!at("/segments/0", &job).unwrap().is_scalar());
        assert!(!at("/segments", &job).unwrap().is_scalar());
    }

    #[test]
    fn what_is_not_there_says_what_is() {
        let job = json!({"length_mm": 500, "segments": [{"diameter_mm": 20}], "support": {"kind": "rigid"}});
        let Err(Lost::NoField { name, known, .. }) = at("/lenght_mm", &job) else { unreachable!() };
        assert!(name == "lenght_mm" && known.contains(&"length_mm".to_owned()));
        let Err(Lost::NoField { known, at: place, .. }) = at("/support/compliance_um_per_n", &job) else {
            unreachable!()
        };
        assert_eq!((known, place.as_str()), (vec!["kind".to_owned()], "/support"), "another variant's field");
        let lost = at("/segments/1/diameter_mm", &job).unwrap_err();
        assert_eq!(lost, Lost::NoItem { index: "1".to_owned(), at: "/segments".to_owned(), length: 1 });
        assert!(matches!(at("/segments/x/diameter_mm", &job), Err(Lost::NoField { .. })));
        assert!(matches!(at("/length_mm/0", &job), Err(Lost::NoField { .. })));
    }

    #[test]
    fn in_a_result_every_item_is_thinkable() {
        let registry = toy::registry();
        let output = registry.entry("toy-bar").unwrap().strict_output();
        let deflection = field(output, None, &tokens("/deflections_um/17").unwrap()).unwrap();
        assert_eq!((deflection.is_number(), deflection.unit.as_deref()), (true, Some("um")));
        assert!(!field(output, None, &tokens("/deflections_um").unwrap()).unwrap().is_scalar());
        assert!(field(output, None, &tokens("/deflection_um/0").unwrap()).is_err());
    }
}
