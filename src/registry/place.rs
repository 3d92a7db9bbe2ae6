//! Where in a job measured tables stand, and what their columns are.

use std::sync::Arc;

use serde_json::Value;

use super::checker::ItemRules;

/// A field of a job that holds a measured table.
#[derive(Debug, Clone)]
pub(crate) struct TablePlace {
    /// JobWay from the root of the job.
    pub(crate) way: JobWay,
    /// What a row holds.
    pub(crate) columns: Vec<TableColumn>,
    /// Most rows.
    pub(crate) max_rows: usize,
    /// Fields of a row that take the columns which no field names: one for numbers, one for words.
    pub(crate) free: FreeColumns,
    /// What a row has to be.
    pub(crate) rules: Arc<ItemRules>,
}

/// Where columns go that no field names; without a place they are faults.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct FreeColumns {
    /// An object of numbers by name.
    pub(crate) numbers: Option<String>,
    /// An object of words by name.
    pub(crate) words: Option<String>,
}

/// One step into a JSON value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Step {
    /// The field of that name.
    Field(String),
    /// Every item of an array.
    Each,
}

/// A column of a measured table.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct TableColumn {
    /// Field name, with the suffix of its unit.
    pub(crate) name: String,
    /// Unit as in the contract; empty where the schema names none.
    pub(crate) unit: String,
    /// What a cell is.
    pub(crate) kind: CellKind,
    /// Whether every row must have it.
    pub(crate) required: bool,
}

/// What a cell is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum CellKind {
    /// A number.
    Number,
    /// A whole number.
    Integer,
    /// A word.
    Word,
    /// true or false.
    Truth,
}

/// A field of a job that holds a long text, which may come as a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct TextPlace {
    /// JobWay from the root of the job.
    pub(crate) way: JobWay,
    /// JobWay from beside it to the field that says which bytes its characters are.
    pub(crate) encoding: Vec<String>,
}

/// A way into a job.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct JobWay(pub(crate) Vec<Step>);

impl JobWay {
    /// Names of the fields on the way, with dots; the name of a file part may be this or its last piece.
    pub(crate) fn dotted(&self) -> String {
        let names: Vec<&str> = self
            .0
            .iter()
            .map(|step| match step {
                Step::Field(name) => name.as_str(),
                Step::Each => "*",
            })
            .collect();
        names.join(".")
    }

    /// Last name on the way.
    fn name(&self) -> &str {
        match self.0.last() {
            Some(Step::Field(name)) => name,
            _ => "",
        }
    }

    /// The way to the place that the name of a file part means: the last name, or all names and indices with dots.
    pub(crate) fn fit(&self, name: &str) -> Option<Vec<String>> {
        let plain = self.0.iter().all(|step| matches!(step, Step::Field(_)));
        if plain && self.name() == name {
            return Some(self.dotted().split('.').map(str::to_owned).collect());
        }
        let steps: Vec<&str> = name.split('.').collect();
        let fits = steps.len() == self.0.len()
            && steps.iter().zip(&self.0).all(|(step, expected)| match expected {
                Step::Field(field) => step == field,
                Step::Each => step.parse::<usize>().is_ok(),
            });
        fits.then(|| steps.into_iter().map(str::to_owned).collect())
    }
}

/// What of a job may come as files.
#[derive(Debug, Default)]
pub(super) struct Places {
    pub(super) tables: Vec<TablePlace>,
    pub(super) texts: Vec<TextPlace>,
}

/// Everything in a job of this (strict) schema that may come as a file.
pub(super) fn places(strict: &Value) -> Places {
    let mut places = Places::default();
    walk(strict, &mut Vec::new(), &mut places);
    places
}

fn walk(schema: &Value, path: &mut Vec<Step>, places: &mut Places) {
    let Some(map) = schema.as_object() else { return };
    if map.contains_key("x-table") {
        if !places.tables.iter().any(|place| place.way.0 == *path) {
            places.tables.push(place(schema, path));
        }
        return;
    }
    if let Some(encoding) = map.get("x-text-file").and_then(Value::as_str) {
        if !places.texts.iter().any(|place| place.way.0 == *path) {
            let encoding = encoding.split('/').map(str::to_owned).collect();
            places.texts.push(TextPlace { way: JobWay(path.clone()), encoding });
        }
        return;
    }
    if let Some(Value::Object(properties)) = map.get("properties") {
        for (name, property) in properties {
            path.push(Step::Field(name.clone()));
            walk(property, path, places);
            path.pop();
        }
    }
    if let Some(items) = map.get("items") {
        path.push(Step::Each);
        walk(items, path, places);
        path.pop();
    }
    for branch in map.get("allOf").and_then(Value::as_array).into_iter().flatten() {
        walk(branch.get("then").unwrap_or(branch), path, places);
    }
}

fn place(schema: &Value, path: &[Step]) -> TablePlace {
    let row = &schema["items"];
    let required = |name: &str| row["required"].as_array().is_some_and(|names| names.iter().any(|n| n == name));
    let fields = || row["properties"].as_object().into_iter().flatten();
    let free = |cells: &str| fields().find(|(_, field)| field["x-free-columns"] == cells).map(|(name, _)| name.clone());
    let columns = fields()
        .filter(|(_, field)| field.get("x-free-columns").is_none())
        .map(|(name, field)| TableColumn {
            name: name.clone(),
            unit: field["x-unit"].as_str().unwrap_or_default().to_owned(),
            kind: kind(&field["type"]),
            required: required(name),
        })
        .collect();
    let max_rows = schema["maxItems"].as_u64().and_then(|most| usize::try_from(most).ok()).unwrap_or(usize::MAX);
    let free = FreeColumns { numbers: free("numbers"), words: free("words") };
    TablePlace { way: JobWay(path.to_vec()), columns, max_rows, free, rules: Arc::new(ItemRules::of(schema)) }
}

fn kind(declared: &Value) -> CellKind {
    let is = |name: &str| declared == name || declared.as_array().is_some_and(|many| many.iter().any(|k| k == name));
    if is("number") {
        CellKind::Number
    } else if is("integer") {
        CellKind::Integer
    } else if is("boolean") {
        CellKind::Truth
    } else {
        CellKind::Word
    }
}
