//! Machines, tools and materials: listed and shown.

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use precut_library::{Kind, Lookup};

use super::{Failed, job, print, print_json};
use crate::engine::{Library, StoredRecord};
use crate::http::{Problem, codes_said, record_said};
use crate::text::{Glossary, Language};

/// Which records.
#[derive(Debug, Args)]
pub(super) struct RecordArgs {
    /// Show this one in full; a material by any of its names
    name: Option<String>,
    /// Only those that this fits, by any name
    #[arg(long, short, value_name = "TEXT", conflicts_with = "name")]
    search: Option<String>,
    /// Records of your own beside the engine's (JSON, TOML or CSV)
    #[arg(long, value_name = "FILE")]
    library: Option<PathBuf>,
}

/// `precut machines`, `precut tools`, `precut materials`
pub(super) fn show(kind: Kind, arguments: &RecordArgs, language: Language) -> Result<(), Failed> {
    let library = match &arguments.library {
        Some(path) => job::library_file(path)?,
        None => Library::default(),
    };
    if let Some(name) = &arguments.name {
        return match library.find(kind, name)? {
            (Lookup::Found(resource), sha256) => {
                let record =
                    StoredRecord { record: resource.record, revision: resource.revision, sha256, created_ms: None };
                print_json(&record_said(&record, language))
            }
            (Lookup::Ambiguous { candidates }, _) => {
                Err(Failed::Usage(format!("{name} is what several are called: {}", candidates.join(", "))))
            }
            (Lookup::Unknown { .. }, _)
                if kind == Kind::Tool
                    && let Some(said) = by_codes(name) =>
            {
                print_json(&said)
            }
            (Lookup::Unknown { nearest }, _) => Err(Problem::unknown_record(kind, name, nearest).into()),
            _ => Err(Problem::unknown_record(kind, name, Vec::new()).into()),
        };
    }
    let records = library.list(kind, arguments.search.as_deref())?;
    let width = records.iter().map(|record| record.name.len()).max().unwrap_or(0);
    let mut lines = String::new();
    for record in records {
        let title = record.text("title").unwrap_or_default();
        let _ = writeln!(lines, "{:width$}  {}", record.name, Glossary::of(language).help(title));
    }
    print(lines.as_bytes())
}

/// What the designation of an insert or a holder says, or of both with a blank between them; nothing where it is none.
fn by_codes(text: &str) -> Option<serde_json::Value> {
    let both = text.split_once(' ').map(|(insert, holder)| codes_said(Some(insert), Some(holder)));
    let said = both.unwrap_or_else(|| codes_said(Some(text), None).or_else(|_| codes_said(None, Some(text))));
    said.ok()
}
