//! Parts of a process: taken, corrected, withdrawn, one or many at a time.

use precut_calc::calculator::Finding;
use precut_calc::process::State;
use serde_json::{Value, json};

use super::body::{self, faulty, for_calculator};
use super::live::{ALL, Coming, Live, read};
use super::{ProcessError, TRIES, canonical_text, said, too_many_parts};
use crate::engine::{Engine, Error, FilePart, Inner, Shelf};
use crate::store::processes::{Addition, EntryKind, KeptPart, NewEntry, PartNow};

/// What whoever changes something has seen of it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Precondition {
    /// Tags of which one has to be that of what is there.
    pub tags: Option<Vec<String>>,
    /// Whether there must be nothing.
    pub only_new: bool,
}

impl Precondition {
    /// Whether it holds for what has that tag.
    pub(super) fn hold(&self, tag: &str) -> Result<(), ProcessError> {
        let tag = tag.to_owned();
        match &self.tags {
            _ if self.only_new => Err(ProcessError::PreconditionFailed { tag }),
            None => Err(ProcessError::PreconditionRequired { tag }),
            Some(tags) if tags.iter().any(|own| *own == tag || own == "*") => Ok(()),
            Some(_) => Err(ProcessError::PreconditionFailed { tag }),
        }
    }
}

/// What became of a part.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PartOutcome {
    /// It is new.
    Taken,
    /// It was there as it was sent.
    Same,
    /// It is another one now.
    Corrected,
}

/// What is said after a part.
#[derive(Debug, Clone, PartialEq)]
pub struct PartAnswer {
    /// What became of it.
    pub outcome: PartOutcome,
    /// Of the part.
    pub revision: u32,
    /// What is said.
    pub said: Value,
}

/// Part names stand in addresses.
fn is_part_name(name: &str) -> bool {
    let plain = |byte: u8| byte.is_ascii_alphanumeric();
    name.len() <= 100
        && name.bytes().next().is_some_and(plain)
        && name.bytes().all(|byte| plain(byte) || b"._-".contains(&byte))
}

impl Engine {
    /// Takes a part, or corrects it.
    pub async fn put_part(
        &self,
        shelf: &Shelf,
        (process, part): (&str, &str),
        (sent, tables): (Value, &[FilePart]),
        (precondition, owner): (Precondition, String),
    ) -> Result<PartAnswer, ProcessError> {
        let inner = &self.inner;
        let full = shelf.full(process);
        if !is_part_name(part) {
            return Err(ProcessError::one(Finding::new("bad_part_name", "").with("name", part.to_owned())));
        }
        let seat = inner.live_processes.seat(&full);
        let mut seated = seat.lock().await;
        let mut read_as: Option<Value> = None;
        for _ in 0..TRIES {
            inner.head(shelf, process).await?;
            let live = Live::current(inner, &full, &mut seated).await?;
            if read_as.is_none() {
                let observed = live.document.observed(&inner.registry)?;
                read_as = Some(body::part(observed, sent.clone(), tables)?);
            }
            let content = read_as.clone().unwrap_or_default();
            let text = canonical_text(&content)?;
            let there = inner.processes.process_part(full.clone(), part.to_owned()).await?;
            let standing = there.as_ref().filter(|there| there.number.is_some());
            if let Some(same) = standing.filter(|there| there.content == text) {
                let said = read(&same.said)?;
                return Ok(PartAnswer { outcome: PartOutcome::Same, revision: same.revision, said });
            }
            let number = number_of(&content)?;
            let value = for_calculator(&content, &live.paths, there.is_none()).map_err(ProcessError::one)?;
            if let Some(standing) = standing {
                precondition.hold(&standing.revision.to_string())?;
            }
            inner.between_neighbours(live, &full, (part, number), &value).await?;
            too_many_parts(live.count() + 1).map_or(Ok(()), Err)?;
            let change = Change {
                part,
                from: there.as_ref().and_then(|there| there.number),
                revision: there.as_ref().map_or(1, |there| there.revision + 1),
                comes: Some((Coming { part: part.to_owned(), number, value }, text)),
            };
            if let Some(done) = inner.changed(live, (&full, process), change, &owner).await? {
                let (next, answer) = done;
                *seated = Some(next);
                return Ok(answer);
            }
        }
        Err(Error::Busy { retry_after: crate::engine::json::RETRY_AFTER }.into())
    }

    /// Withdraws a part; it stays on record.
    pub async fn withdraw_part(
        &self,
        shelf: &Shelf,
        (process, part): (&str, &str),
        (precondition, owner): (Precondition, String),
    ) -> Result<PartAnswer, ProcessError> {
        let inner = &self.inner;
        let full = shelf.full(process);
        let seat = inner.live_processes.seat(&full);
        let mut seated = seat.lock().await;
        for _ in 0..TRIES {
            inner.head(shelf, process).await?;
            let live = Live::current(inner, &full, &mut seated).await?;
            let there = inner.processes.process_part(full.clone(), part.to_owned()).await?;
            let there = there.filter(|there| there.number.is_some());
            let there = there.ok_or_else(|| ProcessError::UnknownPart(part.to_owned()))?;
            if precondition.tags.is_some() {
                precondition.hold(&there.revision.to_string())?;
            }
            let change = Change { part, from: there.number, revision: there.revision + 1, comes: None };
            if let Some((next, answer)) = inner.changed(live, (&full, process), change, &owner).await? {
                *seated = Some(next);
                return Ok(answer);
            }
        }
        Err(Error::Busy { retry_after: crate::engine::json::RETRY_AFTER }.into())
    }

    /// Takes a whole history: parts in any order, all of them or none.
    pub async fn put_parts(
        &self,
        shelf: &Shelf,
        process: &str,
        parts: Vec<(String, Value)>,
        owner: String,
    ) -> Result<Value, ProcessError> {
        let inner = &self.inner;
        let full = shelf.full(process);
        let seat = inner.live_processes.seat(&full);
        let mut seated = seat.lock().await;
        for _ in 0..TRIES {
            inner.head(shelf, process).await?;
            let live = Live::current(inner, &full, &mut seated).await?;
            let many = inner.many(live, &full, &parts).await?;
            let first = many.iter().map(|part| part.number).min().unwrap_or(0);
            let (back, later) = live.back_to(inner, &full, first).await?;
            let mut all = live.coming(later)?;
            let replayed = all.iter().filter(|coming| coming.number > first).count();
            let mut texts: Vec<(String, u32, String)> =
                many.iter().map(|part| (part.part.clone(), part.number, part.text.clone())).collect();
            texts.sort_by_key(|(_, number, _)| *number);
            all.extend(many.into_iter().map(|part| Coming { part: part.part, number: part.number, value: part.value }));
            all.sort_by_key(|part| part.number);
            let mut next = back.ran(all).await?;
            next.sequence = live.sequence + i64::try_from(texts.len()).unwrap_or(0);
            let addition = next.history(&full, process, (live.sequence, &texts), &owner);
            let state = addition.state.as_deref().map(read).transpose()?.unwrap_or_default();
            let model = next.stored_model(&full, Some(live)).await?;
            let addition = Addition { quota: inner.settings.quota, model, ..addition };
            let told: Vec<Value> = next.said_of().iter().map(|(part, state)| brief(part, state)).collect();
            if inner.add(addition).await?.is_some() {
                *seated = Some(next);
                return Ok(json!({ "taken": texts.len(), "replayed_parts": replayed, "said": told, "state": state }));
            }
        }
        Err(Error::Busy { retry_after: crate::engine::json::RETRY_AFTER }.into())
    }
}

/// What would have been said when, in a line.
fn brief(part: &str, state: &State) -> Value {
    let mut line = said::now(state);
    line["part"] = json!(part);
    line["number"] = json!(state.number);
    line
}

/// A part of a history.
struct OfMany {
    part: String,
    number: u32,
    text: String,
    value: Value,
}

/// What happens to a part: it comes, it is corrected, or it goes.
struct Change<'a> {
    part: &'a str,
    /// The number that it had.
    from: Option<i64>,
    revision: u32,
    /// As it comes, and as it is kept.
    comes: Option<(Coming, String)>,
}

fn number_of(content: &Value) -> Result<u32, ProcessError> {
    let number = content["number"].as_u64().and_then(|number| u32::try_from(number).ok());
    number.ok_or_else(|| ProcessError::one(Finding::new("missing_field", "/number")))
}

impl Inner {
    /// The faults of a part beside those before and after it.
    async fn between_neighbours(
        &self,
        live: &Live,
        full: &str,
        (part, number): (&str, u32),
        value: &Value,
    ) -> Result<(), ProcessError> {
        let observed = live.document.observed(&self.registry)?;
        let mut beside = Vec::new();
        if number > live.last() {
            // The usual way: behind all others.
            beside.extend(self.processes.process_parts(full.to_owned(), (i64::from(live.last()), i64::MAX), 1).await?);
        } else {
            let at = i64::from(number);
            let taken = self.processes.process_parts(full.to_owned(), (at, at), 1).await?;
            if let Some(taken) = taken.into_iter().find(|taken| taken.part != part) {
                return Err(ProcessError::NumberTaken { number, part: taken.part });
            }
            let parts = Live::parts(self, full, ALL).await?;
            let is_before = |kept: &&KeptPart| kept.number.is_some_and(|own| own < at) && kept.part != part;
            let is_after = |kept: &&KeptPart| kept.number.is_some_and(|own| own > at) && kept.part != part;
            beside.extend(parts.iter().rev().find(is_before).cloned());
            beside.extend(parts.iter().find(is_after).cloned());
        }
        let mut all = vec![value.clone()];
        for kept in beside.into_iter().filter(|kept| kept.part != part) {
            all.push(for_calculator(&read(&kept.content)?, &live.paths, false).map_err(ProcessError::one)?);
        }
        // A fault between two parts is one of that which comes.
        let own = |mut finding: Finding| {
            let place = finding.pointer.strip_prefix("/parts/")?;
            let rest = place.trim_start_matches(|digit: char| digit.is_ascii_digit());
            if !place.starts_with('0') && finding.code == "condition_missing" {
                // What the others leave out this one states.
                finding.code = "part_condition_new";
            }
            finding.pointer = for_sender(rest);
            Some(finding)
        };
        let mut found: Vec<Finding> = Vec::new();
        for finding in (observed.faults)(live.document.filled.clone(), all).into_iter().filter_map(own) {
            if !found.iter().any(|there| there.code == finding.code && there.pointer == finding.pointer) {
                found.push(finding);
            }
        }
        if found.is_empty() { Ok(()) } else { Err(faulty(found)) }
    }

    /// The parts of a history, checked together with each other and with what is there.
    async fn many(&self, live: &Live, full: &str, parts: &[(String, Value)]) -> Result<Vec<OfMany>, ProcessError> {
        let observed = live.document.observed(&self.registry)?;
        let (mut found, mut many) = (Vec::new(), Vec::<OfMany>::with_capacity(parts.len()));
        for (index, (part, sent)) in parts.iter().enumerate() {
            let pointer = format!("/parts/{index}");
            if !is_part_name(part) {
                found.push(Finding::new("bad_part_name", format!("{pointer}/part")).with("name", part.clone()));
            }
            if many.iter().any(|own| own.part == *part) {
                found.push(Finding::new("part_twice", format!("{pointer}/part")).with("name", part.clone()));
            }
            let content = match body::part(observed, sent.clone(), &[]) {
                Ok(content) => content,
                Err(ProcessError::Invalid { findings, .. }) => {
                    found.extend(findings.into_iter().map(|finding| finding.under(&pointer)));
                    continue;
                }
                Err(error) => return Err(error),
            };
            let value = match for_calculator(&content, &live.paths, true) {
                Ok(value) => value,
                Err(finding) => {
                    found.push(finding.under(&pointer));
                    continue;
                }
            };
            let (number, text) = (number_of(&content)?, canonical_text(&content)?);
            many.push(OfMany { part: part.clone(), number, text, value });
        }
        if !found.is_empty() {
            return Err(faulty(found));
        }
        let there = Live::parts(self, full, ALL).await?;
        for own in &many {
            if let Some(kept) = there.iter().find(|kept| kept.part == own.part) {
                if kept.content != own.text {
                    return Err(ProcessError::PreconditionRequired { tag: kept.revision.to_string() });
                }
            } else if let Some(kept) = there.iter().find(|kept| kept.number == Some(i64::from(own.number))) {
                return Err(ProcessError::NumberTaken { number: own.number, part: kept.part.clone() });
            }
        }
        many.retain(|own| !there.iter().any(|kept| kept.part == own.part));
        too_many_parts(there.len() + many.len()).map_or(Ok(()), Err)?;
        let mut all: Vec<Value> = many.iter().map(|part| part.value.clone()).collect();
        for kept in &there {
            all.push(for_calculator(&read(&kept.content)?, &live.paths, false).map_err(ProcessError::one)?);
        }
        let found = (observed.faults)(live.document.filled.clone(), all);
        if found.is_empty() { Ok(many) } else { Err(faulty(found)) }
    }

    /// Computes a process with a change of a part, and puts it on record; nothing where somebody else has added meanwhile.
    async fn changed(
        &self,
        live: &Live,
        (full, process): (&str, &str),
        change: Change<'_>,
        owner: &str,
    ) -> Result<Option<(Live, PartAnswer)>, ProcessError> {
        let (part, revision) = (change.part.to_owned(), change.revision);
        let had = change.from.and_then(|number| u32::try_from(number).ok());
        let (comes, text) = change.comes.unzip();
        let number = comes.as_ref().map(|coming| coming.number);
        let first = had.into_iter().chain(number).min().unwrap_or(0);
        if let Some(coming) = comes.as_ref().filter(|_| first > live.last()) {
            let doubts = live.doubts(coming.value.clone()).await?;
            if !doubts.is_empty() {
                return Err(faulty(doubts));
            }
        }
        let (back, later) = live.back_to(self, full, first).await?;
        let mut all = live.coming(later.into_iter().filter(|kept| kept.part != part).collect())?;
        let replayed = all.iter().filter(|coming| coming.number > first).count();
        all.extend(comes);
        all.sort_by_key(|part| part.number);
        let mut next = back.ran(all).await?;
        next.sequence = live.sequence + 1;
        let outcome = if revision == 1 { PartOutcome::Taken } else { PartOutcome::Corrected };
        // Without its last part a process has no state, as before its first.
        let state = next.state(process, next.sequence);
        let mut said = state.clone().unwrap_or_else(|| json!({ "process": process }));
        said["part"] = json!(part);
        said["number"] = json!(number);
        said["revision"] = json!(revision);
        said["replayed_parts"] = json!(replayed);
        let news = next.last_said().map(|now| said::news(live.last_said(), now, replayed)).unwrap_or_default();
        said["news"] = json!(news);
        let mut parts: Vec<PartNow> = next.nows().filter(|now| now.part != part).collect();
        let of_part = next.said_of().iter().find(|(own, _)| *own == part).map(|(_, state)| said::now(state));
        let now = of_part.unwrap_or_else(|| json!({ "state": "withdrawn" })).to_string();
        parts.push(PartNow { part: part.clone(), entry: Some((number, 0)), now });
        let kind = if text.is_some() { EntryKind::Part } else { EntryKind::Withdrawn };
        let entry = NewEntry {
            kind,
            part: Some(part),
            revision,
            number,
            content: text.unwrap_or_else(|| "null".to_owned()),
            said: said.to_string(),
            created_ms: None,
        };
        let stored = next.stored_model(full, Some(live)).await?;
        let tells = live.document.told(kind, &news).map(|callback| (0, callback)).into_iter().collect();
        let addition = Addition {
            process: full.to_owned(),
            after: Some(live.sequence),
            model: stored,
            entries: vec![entry],
            parts,
            snapshots: next.snapshots(),
            tells,
            state: state.map(|state| state.to_string()),
            owner: owner.to_owned(),
            quota: self.settings.quota,
            ..Addition::default()
        };
        let added = self.add(addition).await?;
        Ok(added.map(|_| (next, PartAnswer { outcome, revision, said })))
    }
}

/// A place of the part as the calculator reads it, as it was sent.
fn for_sender(pointer: &str) -> String {
    match pointer {
        "/edge" | "/batch" => format!("/conditions{pointer}"),
        other => other.to_owned(),
    }
}

impl Live {
    /// The entries of a history that was computed last.
    pub(super) fn history(
        &self,
        full: &str,
        process: &str,
        (after, texts): (i64, &[(String, u32, String)]),
        owner: &str,
    ) -> Addition {
        let state = self.state(process, self.sequence).map(|state| state.to_string());
        let said_of = |part: &str| self.said_of().iter().find(|(own, _)| own == part).map(|(_, state)| state);
        let mut parts: Vec<PartNow> =
            self.nows().filter(|now| !texts.iter().any(|(part, ..)| *part == now.part)).collect();
        let (mut entries, mut before) = (Vec::with_capacity(texts.len()), None);
        for (place, (part, number, text)) in texts.iter().enumerate() {
            let now = said_of(part);
            let mut said = now.map(|state| said::state((process, after, place), state, None, &self.document));
            if let (Some(said), Some(now)) = (&mut said, now) {
                said["part"] = json!(part);
                said["number"] = json!(number);
                said["revision"] = json!(1);
                said["sequence"] = json!(after + 1 + i64::try_from(place).unwrap_or(0));
                said["news"] = json!(said::news(before, now, 0));
            }
            before = now.or(before);
            entries.push(NewEntry {
                kind: EntryKind::Part,
                part: Some(part.clone()),
                revision: 1,
                number: Some(*number),
                content: text.clone(),
                said: said.unwrap_or_default().to_string(),
                created_ms: None,
            });
            let now = now.map(said::now).unwrap_or_default().to_string();
            parts.push(PartNow { part: part.clone(), entry: Some((Some(*number), place)), now });
        }
        Addition {
            process: full.to_owned(),
            after: Some(after),
            entries,
            parts,
            snapshots: self.snapshots(),
            state,
            owner: owner.to_owned(),
            // A history that comes at once happened long ago: nobody is told.
            ..Addition::default()
        }
    }
}
