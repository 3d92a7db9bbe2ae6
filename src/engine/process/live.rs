//! A process in memory: as far as its record goes, computed part by part.

use std::sync::atomic::{AtomicU64, Ordering};

use precut_calc::calculator::{Finding, Unwatched};
use precut_calc::process::{Decision, Outlook, State};
use serde_json::{Value, json};
use tokio::sync::{Mutex, MutexGuard};

use super::body::{self, Document, Issued, for_calculator};
use super::{Error, Inner, PAGE, ProcessError, said};
use crate::registry::{NotReplayed, Watching};
use crate::store::processes::{Entry, EntryKind, KeptPart, MOST_SNAPSHOTS, PartNow, Snapshot};

/// A process is kept as it was after every so many parts: from there it is computed again when the service starts, or where a part
/// comes late or is corrected.
const SNAPSHOT_EVERY: usize = 64;

/// Numbers of all parts.
pub(super) const ALL: (i64, i64) = (0, i64::MAX);

/// The place of a process in memory. Who holds it adds to the process; others of this program wait.
#[derive(Default)]
pub(crate) struct Seat {
    live: Mutex<Option<Live>>,
    used: AtomicU64,
}

impl Seat {
    pub(super) async fn lock(&self) -> MutexGuard<'_, Option<Live>> {
        self.live.lock().await
    }

    pub(super) fn touch(&self) {
        static CLOCK: AtomicU64 = AtomicU64::new(1);
        self.used.store(CLOCK.fetch_add(1, Ordering::Relaxed), Ordering::Relaxed);
    }

    pub(super) fn used(&self) -> u64 {
        self.used.load(Ordering::Relaxed)
    }
}

/// A process after some of its parts.
struct Step {
    watch: Box<dyn Watching>,
    /// Number of the last of them, and how many they are.
    last: u32,
    taken: usize,
    /// How many decisions were taken.
    decided: usize,
}

impl Step {
    fn copy(&self) -> Self {
        Self { watch: self.watch.copy(), ..*self }
    }

    fn snapshot(&self) -> Snapshot {
        let (watch, first_part) = self.watch.snapshot();
        let content = json!({
            "taken": self.taken, "decided": self.decided, "first_part": first_part, "watch": watch,
        });
        Snapshot { number: i64::from(self.last), content: content.to_string() }
    }
}

/// A part on its way into a process.
pub(super) struct Coming {
    pub(super) part: String,
    pub(super) number: u32,
    /// As the calculator reads it.
    pub(super) value: Value,
}

/// A process in memory.
pub(crate) struct Live {
    pub(super) document: Document,
    pub(super) sequence: i64,
    pub(super) paths: Vec<Issued>,
    decisions: Vec<(u32, String, Decision)>,
    at: Step,
    /// As it was after some of the parts that were computed last.
    snapshots: Vec<Snapshot>,
    state: Option<State>,
    outlook: Option<Outlook>,
    last_type: Option<String>,
    /// What is said of the parts that were computed last.
    said_of: Vec<(String, State)>,
}

impl Live {
    /// The process as it is on record: what is in memory with what was added since, or computed from the start.
    pub(super) async fn current<'a>(
        inner: &Inner,
        full: &str,
        seat: &'a mut Option<Self>,
    ) -> Result<&'a Self, ProcessError> {
        let followed = match seat.take() {
            Some(live) => live.followed(inner, full).await?,
            None => None,
        };
        let live = match followed {
            Some(live) => live,
            None => Self::load(inner, full, None).await?,
        };
        Ok(seat.insert(live))
    }

    /// With what was added since; nothing where that changed what was before.
    async fn followed(mut self, inner: &Inner, full: &str) -> Result<Option<Self>, ProcessError> {
        let Some(head) = inner.processes.process(full.to_owned()).await? else { return Ok(None) };
        if head.sequence < self.sequence {
            return Ok(None);
        }
        while self.sequence < head.sequence {
            let added = inner.processes.process_entries(full.to_owned(), self.sequence, PAGE, false).await?;
            if added.is_empty() {
                return Ok(None);
            }
            for entry in added {
                if !self.follow(&entry)? {
                    return Ok(None);
                }
                self.sequence = entry.sequence;
            }
            self.look_ahead()?;
        }
        Ok(Some(self))
    }

    /// One entry more; `false` where it changed what was before.
    fn follow(&mut self, entry: &Entry) -> Result<bool, ProcessError> {
        match EntryKind::of_word(&entry.kind) {
            Some(EntryKind::Part) => {
                let (Some(part), Some(number)) = (entry.part.clone(), entry.number) else { return Ok(false) };
                let Ok(number) = u32::try_from(number) else { return Ok(false) };
                if number <= self.at.last || entry.revision > 1 {
                    return Ok(false);
                }
                let coming = coming(part, number, &entry.content, &self.paths)?;
                self.take(vec![coming])?;
                Ok(true)
            }
            Some(EntryKind::Path) => {
                self.paths.push(issued(entry)?);
                Ok(true)
            }
            Some(EntryKind::Decision) => {
                let content = read(&entry.content)?;
                let Some((_, change, decision)) = body::read_decision(&content) else { return Ok(false) };
                self.decide(&change, &decision)
            }
            _ => Ok(false),
        }
    }

    /// From the record alone, judged by another document where one is given.
    pub(super) async fn load(inner: &Inner, full: &str, document: Option<Document>) -> Result<Self, ProcessError> {
        loop {
            let gone = || Error::internal(format!("the record of process {full} is gone"));
            let head = inner.processes.process(full.to_owned()).await?.ok_or_else(gone)?;
            let (mut paths, mut decisions, mut declared) = (Vec::new(), Vec::new(), None);
            let mut after = 0;
            loop {
                let entries = inner.processes.process_entries(full.to_owned(), after, PAGE, true).await?;
                let Some(last) = entries.last() else { break };
                after = last.sequence;
                for entry in &entries {
                    match EntryKind::of_word(&entry.kind) {
                        Some(EntryKind::Document) => declared = Some(entry.content.clone()),
                        Some(EntryKind::Path) => paths.push(issued(entry)?),
                        Some(EntryKind::Decision) => decisions.extend(body::read_decision(&read(&entry.content)?)),
                        _ => {}
                    }
                }
            }
            let declared = declared.ok_or_else(gone)?;
            let declared_as = match &document {
                Some(document) => document.clone(),
                None => Document::read(&inner.registry, &declared)?,
            };
            let mut live = Self::begun(inner, declared_as)?;
            (live.sequence, live.paths, live.decisions) = (head.sequence, paths, decisions);
            let kept = match &document {
                Some(_) => None,
                None => inner.processes.process_snapshot(full.to_owned(), None).await?,
            };
            let from = live.resume(inner, full, kept).await?;
            let parts = Self::parts(inner, full, (i64::from(from), i64::MAX)).await?;
            let coming = live.coming(parts)?;
            let live = live.ran(coming).await?;
            // Who added meanwhile may be in it or not.
            let now = inner.processes.process(full.to_owned()).await?;
            if now.is_some_and(|now| now.sequence == head.sequence) {
                return Ok(live);
            }
        }
    }

    /// Before its first part.
    pub(super) fn begun(inner: &Inner, document: Document) -> Result<Self, ProcessError> {
        let observed = document.observed(&inner.registry)?;
        let watch = (observed.begin)(document.filled.clone()).map_err(Error::from)?;
        Ok(Self {
            document,
            sequence: 0,
            paths: Vec::new(),
            decisions: Vec::new(),
            at: Step { watch, last: 0, taken: 0, decided: 0 },
            snapshots: Vec::new(),
            state: None,
            outlook: None,
            last_type: None,
            said_of: Vec::new(),
        })
    }

    /// All parts of those numbers, in order.
    pub(super) async fn parts(inner: &Inner, full: &str, (from, to): (i64, i64)) -> Result<Vec<KeptPart>, Error> {
        let (mut all, mut next) = (Vec::new(), from);
        loop {
            let page = inner.processes.process_parts(full.to_owned(), (next, to), PAGE).await?;
            let Some(last) = page.last().and_then(|part| part.number) else { return Ok(all) };
            next = last + 1;
            all.extend(page);
        }
    }

    pub(super) fn copy(&self) -> Self {
        Self {
            document: self.document.clone(),
            sequence: self.sequence,
            paths: self.paths.clone(),
            decisions: self.decisions.clone(),
            at: self.at.copy(),
            snapshots: Vec::new(),
            state: self.state.clone(),
            outlook: self.outlook.clone(),
            last_type: self.last_type.clone(),
            said_of: Vec::new(),
        }
    }

    /// The process before a number, or somewhat earlier, and the parts that are to be taken again from there on.
    pub(super) async fn back_to(
        &self,
        inner: &Inner,
        full: &str,
        number: u32,
    ) -> Result<(Self, Vec<KeptPart>), ProcessError> {
        if number > self.last() {
            return Ok((self.copy(), Vec::new()));
        }
        let kept = inner.processes.process_snapshot(full.to_owned(), Some(i64::from(number))).await?;
        let begun = Self::begun(inner, self.document.clone())?;
        let mut back =
            Self { sequence: self.sequence, paths: self.paths.clone(), decisions: self.decisions.clone(), ..begun };
        let from = back.resume(inner, full, kept).await?;
        let later = Self::parts(inner, full, (i64::from(from), i64::MAX)).await?;
        Ok((back, later))
    }

    /// Goes on from a snapshot, where it is one that can be read; the number of the first part that is to be taken.
    async fn resume(&mut self, inner: &Inner, full: &str, kept: Option<Snapshot>) -> Result<u32, ProcessError> {
        let Some(kept) = kept else { return Ok(0) };
        match self.read_snapshot(inner, full, &kept).await {
            Ok(at) => self.at = at,
            // A program of another version kept it: everything is on record.
            Err(error) => tracing::info!(process = full, part = kept.number, ?error, "process_snapshot_not_read"),
        }
        Ok(self.at.last + 1)
    }

    async fn read_snapshot(&self, inner: &Inner, full: &str, kept: &Snapshot) -> Result<Step, ProcessError> {
        let mut content = read(&kept.content)?;
        let damaged = || Error::internal("a kept process that cannot be read".to_owned());
        let count = |field: &str| content[field].as_u64().and_then(|count| usize::try_from(count).ok());
        let (taken, decided) = (count("taken").ok_or_else(damaged)?, count("decided").ok_or_else(damaged)?);
        let from = content["first_part"].as_i64().ok_or_else(damaged)?;
        let parts = Self::parts(inner, full, (from, kept.number)).await?;
        let parts = self.coming(parts)?.into_iter().map(|coming| coming.value).collect();
        let (observed, document) = (self.document.observed(&inner.registry)?, self.document.filled.clone());
        let (resume, watch) = (observed.resume, content["watch"].take());
        let watch = tokio::task::spawn_blocking(move || resume(document, watch, parts));
        let watch = watch.await.map_err(|error| Error::internal(error.to_string()))?.map_err(why)?;
        let last = u32::try_from(kept.number).map_err(|_| damaged())?;
        Ok(Step { watch, last, taken, decided })
    }

    /// Parts of the record on their way into the process.
    pub(super) fn coming(&self, parts: Vec<KeptPart>) -> Result<Vec<Coming>, ProcessError> {
        let numbered = parts.into_iter().filter_map(|kept| Some((u32::try_from(kept.number?).ok()?, kept)));
        numbered.map(|(number, kept)| coming(kept.part, number, &kept.content, &self.paths)).collect()
    }

    /// Number of the last part, 0 before the first.
    pub(super) fn last(&self) -> u32 {
        self.at.last
    }

    /// How many parts it has.
    pub(super) fn count(&self) -> usize {
        self.at.taken
    }

    /// With more parts of ascending numbers beyond the last, computed away from the threads that move bytes.
    pub(super) async fn ran(mut self, coming: Vec<Coming>) -> Result<Self, ProcessError> {
        let computed = tokio::task::spawn_blocking(move || {
            self.said_of.clear();
            self.snapshots.clear();
            self.take(coming)?;
            self.look_ahead()?;
            Ok(self)
        });
        computed.await.map_err(|error| Error::internal(error.to_string()))?
    }

    fn take(&mut self, coming: Vec<Coming>) -> Result<(), ProcessError> {
        for part in coming {
            self.settle(Some(part.number));
            self.last_type = part.value["part_type"].as_str().map(ToOwned::to_owned);
            let state = self.at.watch.take(part.value, &Unwatched).map_err(why)?;
            (self.at.last, self.at.taken) = (part.number, self.at.taken + 1);
            if self.at.taken.is_multiple_of(SNAPSHOT_EVERY) {
                self.snapshots.push(self.at.snapshot());
                let excess = self.snapshots.len().saturating_sub(MOST_SNAPSHOTS as usize);
                self.snapshots.drain(..excess);
            }
            self.state = Some(state.clone());
            self.said_of.push((part.part, state));
        }
        self.settle(None);
        Ok(())
    }

    /// What a person should look at before a part is taken that comes last.
    pub(super) async fn doubts(&self, part: Value) -> Result<Vec<Finding>, ProcessError> {
        let mut watch = self.at.watch.copy();
        let computed = tokio::task::spawn_blocking(move || watch.doubts(part, &Unwatched));
        computed.await.map_err(|error| Error::internal(error.to_string()))?.map_err(why)
    }

    /// The job of the next part with what is known of the process; nothing while that is nothing.
    pub(super) async fn known_job(
        &self,
        part_type: String,
        conditions: Vec<(String, f64)>,
    ) -> Result<Option<Value>, ProcessError> {
        let mut watch = self.at.watch.copy();
        let computed = tokio::task::spawn_blocking(move || watch.next(&part_type, &conditions, &Unwatched));
        let computed = computed.await.map_err(|error| Error::internal(error.to_string()))?;
        Ok(computed.map_err(Error::Calculation)?)
    }

    /// The model as it is by now; nothing while the process is learned.
    pub(super) async fn found_model(&self) -> Result<Option<Value>, ProcessError> {
        let mut watch = self.at.watch.copy();
        let computed = tokio::task::spawn_blocking(move || watch.stored(&Unwatched));
        let computed = computed.await.map_err(|error| Error::internal(error.to_string()))?;
        Ok(computed.map_err(Error::Calculation)?)
    }

    fn look_ahead(&mut self) -> Result<(), ProcessError> {
        self.outlook = self.at.watch.outlook(&Unwatched).map_err(Error::Calculation)?;
        Ok(())
    }

    /// Takes the decisions that were made before a part of that number, or all.
    fn settle(&mut self, before: Option<u32>) {
        while let Some((after, change, decision)) = self.decisions.get(self.at.decided) {
            if before.is_some_and(|number| number <= *after) {
                return;
            }
            // What it was about may be gone since a part was corrected.
            if let Some(state) = self.at.watch.decide(change, decision) {
                self.state = Some(State { number: self.at.last, ..state });
            }
            self.at.decided += 1;
        }
    }

    /// Takes what a person says of a change; `false` where that does not fit.
    pub(super) fn decide(&mut self, change: &str, decision: &Decision) -> Result<bool, ProcessError> {
        let Some(state) = self.at.watch.decide(change, decision) else { return Ok(false) };
        self.state = Some(State { number: self.at.last, ..state });
        self.decisions.push((self.at.last, change.to_owned(), decision.clone()));
        self.at.decided = self.decisions.len();
        self.look_ahead()?;
        Ok(true)
    }

    pub(super) fn knows_change(&self, change: &str) -> bool {
        self.state.as_ref().is_some_and(|state| state.changes.iter().any(|own| own.id == change))
    }

    /// What is said last of the process.
    pub(super) fn state(&self, name: &str, sequence: i64) -> Option<Value> {
        let state = self.state.as_ref()?;
        Some(said::state((name, sequence, self.count()), state, self.outlook.as_ref(), &self.document))
    }

    pub(super) fn outlook(&self) -> Option<&Outlook> {
        self.outlook.as_ref()
    }

    /// The type of the last part.
    pub(super) fn last_type(&self) -> Option<&str> {
        self.last_type.as_deref()
    }

    pub(super) fn last_said(&self) -> Option<&State> {
        self.state.as_ref()
    }

    /// What persons decided of a process that has no parts yet.
    pub(super) fn set_decisions(&mut self, decisions: Vec<(u32, String, Decision)>) {
        self.decisions = decisions;
    }

    /// What was said after each of the parts that were computed last.
    pub(super) fn said_of(&self) -> &[(String, State)] {
        &self.said_of
    }

    /// The process after some of the parts that were computed last.
    pub(super) fn snapshots(&self) -> Vec<Snapshot> {
        self.snapshots.clone()
    }

    /// What is said now of the parts that were computed last.
    pub(super) fn nows(&self) -> impl Iterator<Item = PartNow> {
        self.said_of.iter().map(|(part, state)| PartNow {
            part: part.clone(),
            entry: None,
            now: said::now(state).to_string(),
        })
    }
}

/// A part of the record on its way into the process.
pub(super) fn coming(part: String, number: u32, content: &str, paths: &[Issued]) -> Result<Coming, ProcessError> {
    let value = for_calculator(&read(content)?, paths, false).map_err(ProcessError::one)?;
    Ok(Coming { part, number, value })
}

fn issued(entry: &Entry) -> Result<Issued, Error> {
    Ok(Issued { revision: entry.revision, content: read(&entry.content)? })
}

pub(super) fn read(content: &str) -> Result<Value, Error> {
    serde_json::from_str(content).map_err(|error| Error::internal(format!("a kept process: {error}")))
}

fn why(error: NotReplayed) -> ProcessError {
    match error {
        NotReplayed::Faults(findings) => body::faulty(findings),
        NotReplayed::Failed(failure) => Error::Calculation(failure).into(),
    }
}
