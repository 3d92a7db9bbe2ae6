//! The whole record of a process, out and in again.

use precut_calc::calculator::Finding;
use serde_json::{Value, json};

use super::body::{self, Document, Issued};
use super::live::{Coming, Live, coming, read};
use super::{KeptProcess, PAGE, ProcessError, canonical_text, said};
use crate::engine::{Engine, Shelf, model};
use crate::store::documents::{Kind, NewDocument};
use crate::store::processes::{Addition, EntryKind, NewEntry, PartNow};

/// Version of the form of a record.
const FORM: u64 = 1;

impl Engine {
    /// All that happened to a process, for keeping it elsewhere.
    pub async fn export_process(&self, shelf: &Shelf, name: &str) -> Result<Value, ProcessError> {
        let full = shelf.full(name);
        let head = self.inner.head(shelf, name).await?;
        let (mut record, mut after) = (Vec::new(), 0);
        while after < head.sequence {
            let page = self.inner.processes.process_entries(full.clone(), after, PAGE, false).await?;
            let Some(last) = page.last() else { break };
            after = last.sequence;
            for entry in page {
                record.push(json!({
                    "sequence": entry.sequence, "kind": entry.kind, "part": entry.part, "revision": entry.revision,
                    "number": entry.number, "created_ms": entry.created_ms,
                    "content": read(&entry.content)?, "said": read(&entry.said)?,
                }));
            }
        }
        let record = Value::from(record);
        let sha256 = model::sha256(&canonical_text(&record)?);
        Ok(json!({ "form": FORM, "name": name, "sha256": sha256, "record": record }))
    }

    /// Takes a record that was exported: all of it or nothing, under a name that nothing has.
    pub(super) async fn import_process(
        &self,
        shelf: &Shelf,
        name: &str,
        sent: Value,
        owner: String,
    ) -> Result<(KeptProcess, bool), ProcessError> {
        let inner = &self.inner;
        let damaged = |place: &str| ProcessError::one(Finding::new("record_damaged", place.to_owned()));
        if sent["form"] != FORM || sent["sha256"] != model::sha256(&canonical_text(&sent["record"])?).as_str() {
            return Err(damaged("/sha256"));
        }
        let full = shelf.full(name);
        if inner.processes.process(full.clone()).await?.is_some() {
            return Err(ProcessError::Exists(name.to_owned()));
        }
        inner.model_name_is_free(shelf, name).await?;
        let (mut entries, mut document, mut paths) = (Vec::new(), None, Vec::new());
        let mut latest: Vec<(String, Option<u32>, usize, String)> = Vec::new();
        let mut decisions = Vec::new();
        for (place, sent) in sent["record"].as_array().into_iter().flatten().enumerate() {
            let pointer = format!("/record/{place}");
            let kind = sent["kind"].as_str().and_then(EntryKind::of_word).ok_or_else(|| damaged(&pointer))?;
            let part = sent["part"].as_str().map(ToOwned::to_owned);
            let revision = sent["revision"].as_u64().and_then(|revision| u32::try_from(revision).ok());
            let revision = revision.ok_or_else(|| damaged(&pointer))?;
            let number = sent["number"].as_u64().and_then(|number| u32::try_from(number).ok());
            let content = canonical_text(&sent["content"])?;
            match kind {
                EntryKind::Document => document = Some(Document::read(&inner.registry, &content)?),
                EntryKind::Path => paths.push(Issued { revision, content: sent["content"].clone() }),
                EntryKind::Decision => decisions.extend(body::read_decision(&sent["content"])),
                EntryKind::Part | EntryKind::Withdrawn => {
                    let part = part.clone().ok_or_else(|| damaged(&pointer))?;
                    let number = number.filter(|_| kind == EntryKind::Part);
                    match latest.iter_mut().find(|(own, ..)| *own == part) {
                        Some(own) => *own = (part, number, place, content.clone()),
                        None => latest.push((part, number, place, content.clone())),
                    }
                }
            }
            let created_ms = sent["created_ms"].as_i64();
            let said = sent["said"].to_string();
            entries.push(NewEntry { kind, part, revision, number, content, said, created_ms });
        }
        let document = document.ok_or_else(|| damaged("/record"))?;
        // Checked as a document is that comes by itself.
        self.read_document(shelf, document.sent.clone()).await?;
        let mut live = Live::begun(inner, document.clone())?;
        live.sequence = i64::try_from(entries.len()).unwrap_or(0);
        live.paths = paths;
        live.set_decisions(decisions);
        let counting = latest.iter().filter_map(|(part, number, _, content)| Some((part, (*number)?, content)));
        let mut all: Vec<Coming> = counting
            .map(|(part, number, content)| coming(part.clone(), number, content, &live.paths))
            .collect::<Result<_, _>>()?;
        all.sort_by_key(|part| part.number);
        let values = all.iter().map(|part| part.value.clone()).collect();
        let found = (document.observed(&inner.registry)?.faults)(document.filled.clone(), values);
        if !found.is_empty() {
            return Err(body::faulty(found));
        }
        let live = live.ran(all).await?;
        let now_of = |part: &str| {
            let own = live.said_of().iter().find(|(own, _)| own == part);
            own.map_or_else(|| json!({ "state": "withdrawn" }), |(_, state)| said::now(state)).to_string()
        };
        let parts = latest.iter().map(|(part, number, place, _)| PartNow {
            part: part.clone(),
            entry: Some((*number, *place)),
            now: now_of(part),
        });
        let stored = live.stored_model(&full, None).await?;
        let content = document.content()?;
        let kept = NewDocument {
            kind: Kind::Process,
            name: full.clone(),
            class: document.calculator().to_owned(),
            words: String::new(),
            sha256: model::sha256(&content),
            content,
        };
        let addition = Addition {
            process: full,
            document: Some(kept),
            model: stored,
            entries,
            parts: parts.collect(),
            snapshots: live.snapshots(),
            state: live.state(name, live.sequence).map(|state| state.to_string()),
            owner,
            quota: inner.settings.quota,
            ..Addition::default()
        };
        if inner.add(addition).await?.is_none() {
            return Err(ProcessError::Exists(name.to_owned()));
        }
        Ok((self.process(shelf, name).await?, true))
    }
}
