//! Records in files: what is read of one, what it would change, and own records as a file.

mod csv_file;
mod json_file;
mod toml_file;

use precut_calc::calculator::Finding;
use precut_library::{Kind, built_in};
use serde::Serialize;
use serde_json::{Value, json};
use utoipa::ToSchema;

use super::compare::differences;
use super::draft::Draft;
use super::{FieldComparison, RecordError, kind_of, of_json};
use crate::engine::budget::Room;
use crate::engine::{Engine, Error, Shelf};
use crate::registry::Faults;
use crate::store::documents::{self, Before, Placed};

/// Form of a file of records.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// JSON, as the engine's own data.
    Json,
    /// The same tree as TOML.
    Toml,
    /// A row for each number, or a row for each tool.
    Csv,
}

/// Records that are read from a file.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct File(Vec<Draft>);

/// A record of a file before it is checked, and where it stands there.
struct Raw {
    kind: Kind,
    name: String,
    value: Value,
    place: String,
}

/// What an import changed, or would change.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct ImportReport {
    /// Whether nothing was written.
    pub dry_run: bool,
    /// Records whose names nothing had.
    pub new: Vec<Imported>,
    /// Records that say something else than the newest revision of their names.
    pub changed: Vec<Imported>,
    /// Records that say the same; they make no revision.
    pub equal: Vec<Imported>,
}

/// A record of an import.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Imported {
    /// `machine`, `tool`, `material` or `part`.
    #[schema(example = "tool")]
    pub kind: String,
    /// Its name.
    #[schema(example = "cnmg120408_own")]
    pub name: String,
    /// The revision that it is kept as; null where nothing was written.
    #[schema(minimum = 1, example = 2)]
    pub revision: Option<u32>,
    /// What differs from the newest revision before.
    pub fields: Vec<FieldComparison>,
}

impl File {
    /// Reads a file; every fault of every record at once.
    pub(crate) fn read(form: Form, bytes: &[u8], room: &Room) -> Result<Self, RecordError> {
        let raws = match form {
            Form::Json => json_file::read(bytes, room)?,
            Form::Toml => toml_file::read(bytes, room)?,
            Form::Csv => csv_file::read(bytes, room)?,
        };
        let (mut drafts, mut found) = (Vec::with_capacity(raws.len()), Faults::default());
        let mut names = std::collections::HashSet::new();
        for Raw { kind, name, value, place } in raws {
            if built_in::find(kind, &name).is_some() {
                found.add(Finding::new("name_is_built_in", place.clone()).with("name", name.clone()));
            }
            if !names.insert((kind, name.clone())) {
                found.add(Finding::new("record_twice", place.clone()).with("name", name.clone()));
            }
            match Draft::of(kind, &name, value) {
                Ok(draft) => drafts.push(draft),
                Err(RecordError::Invalid { findings, total }) => {
                    found.total += total - findings.len();
                    for finding in findings {
                        found.add(finding.under(&place));
                    }
                }
                Err(other) => return Err(other),
            }
        }
        if found.total > 0 { Err(RecordError::invalid(found)) } else { Ok(Self(drafts)) }
    }

    /// The records, without a store.
    pub(crate) fn records(&self) -> impl Iterator<Item = (&std::sync::Arc<precut_library::Record>, &str)> {
        self.0.iter().map(|draft| (&draft.record, draft.sha256.as_str()))
    }
}

impl Engine {
    /// Keeps the records of a file, all or none; those that say what is kept already make no revision. A dry run only tells
    /// what it would do.
    pub async fn import(
        &self,
        shelf: &Shelf,
        (form, bytes): (Form, &[u8]),
        dry_run: bool,
        owner: String,
    ) -> Result<ImportReport, RecordError> {
        let paid = super::super::budget::paid_beside(bytes.len());
        let File(drafts) = File::read(form, bytes, &Room::of(&self.inner.bodies, paid))?;
        let mut report = ImportReport { dry_run, new: Vec::new(), changed: Vec::new(), equal: Vec::new() };
        let mut before = Vec::with_capacity(drafts.len());
        for draft in &drafts {
            let record = &draft.record;
            let full = shelf.full(&record.name);
            before.push(self.inner.documents.document(kind_of(record.kind), full, None).await?);
        }
        let placed = if dry_run {
            self.refuse_taken(shelf, &drafts).await?;
            self.refuse_shorter_histories(shelf, &drafts).await?;
            self.refuse_strange_parts(&drafts)?;
            Vec::new()
        } else {
            self.keep(shelf, &drafts, (false, true), owner).await?
        };
        for (index, (draft, kept)) in drafts.iter().zip(before).enumerate() {
            let record = &draft.record;
            let placed: Option<&Placed> = placed.get(index);
            let then = match (&kept, placed) {
                (_, Some(placed)) => placed.before,
                (None, None) => Before::Nothing,
                (Some(kept), None) if kept.sha256 == draft.sha256 => Before::Same,
                (Some(_), None) => Before::Other,
            };
            let fields = match (&kept, then) {
                (Some(kept), Before::Other) => {
                    differences(&of_json(record.kind, &record.name, &kept.content)?.value, &record.value)
                }
                _ => Vec::new(),
            };
            let imported = Imported {
                kind: record.kind.name().to_owned(),
                name: record.name.clone(),
                revision: placed.map(|placed| placed.revision),
                fields,
            };
            match then {
                Before::Nothing => report.new.push(imported),
                Before::Other => report.changed.push(imported),
                Before::Same => report.equal.push(imported),
            }
        }
        Ok(report)
    }

    /// The newest revisions of all own records as a file.
    pub async fn export(&self, shelf: &Shelf, form: Form) -> Result<Vec<u8>, RecordError> {
        /// So many are read at once.
        const PAGE: u32 = 500;
        let mut lists = Vec::new();
        for kind in Kind::ALL {
            let (mut items, mut after) = (Vec::new(), String::new());
            loop {
                let page = self.inner.documents.documents(kind_of(kind), shelf.prefix(), after, PAGE).await?;
                let is_last = page.len() < PAGE as usize;
                after = page.last().map(|kept| shelf.plain(kept.clone()).name).unwrap_or_default();
                for kept in page {
                    let kept: documents::KeptDocument = shelf.plain(kept);
                    items.push(of_json(kind, &kept.name, &kept.content)?);
                }
                if is_last {
                    break;
                }
            }
            lists.push((kind, items));
        }
        Ok(match form {
            Form::Csv => csv_file::written(&lists),
            Form::Json | Form::Toml => {
                let mut tree = json!({ "schema_version": json_file::SCHEMA_VERSION });
                for (kind, items) in lists {
                    let with_id = |record: precut_library::Record| {
                        let mut fields = serde_json::Map::new();
                        fields.insert("id".to_owned(), record.name.into());
                        fields.extend(record.value.as_object().cloned().unwrap_or_default());
                        Value::Object(fields)
                    };
                    tree[kind.plural()] = items.into_iter().map(with_id).collect();
                }
                let written = match form {
                    Form::Toml => toml_file::written(tree),
                    _ => serde_json::to_vec(&tree).map_err(|error| error.to_string()),
                };
                written.map_err(Error::internal)?
            }
        })
    }
}
