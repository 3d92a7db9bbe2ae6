//! The next part: the calculator's own job, with what is known of the process by now.

use std::sync::Arc;

use precut_calc::calculator::Finding;
use precut_calc::process::ActionKind;
use serde_json::{Value, json};

use super::body::Issued;
use super::live::Live;
use super::{ProcessError, TRIES};
use crate::engine::{Body, Engine, Error, Shelf, Solved};
use crate::store::processes::{Addition, EntryKind, NewEntry};

/// On which path the next part is cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WhichPath {
    /// On the one that was given out last; the base job's own where none was.
    AsNow,
    /// On that of the model as it is by now.
    NewPath,
}

impl WhichPath {
    /// Both.
    pub const ALL: &[Self] = &[Self::AsNow, Self::NewPath];

    /// As it is asked for.
    pub const fn word(self) -> &'static str {
        match self {
            Self::AsNow => "as_now",
            Self::NewPath => "new_path",
        }
    }
}

/// What is asked of the next part.
#[derive(Debug, Clone, Default)]
pub struct NextAsked {
    /// Its type; that of the last part, or the first of the process.
    pub part_type: Option<String>,
    /// Its path; what the action says.
    pub path: Option<WhichPath>,
    /// Its conditions, by name.
    pub conditions: Vec<(String, f64)>,
    /// Whether the program is taken along: then the process knows of the path.
    pub issue: bool,
}

/// The next part.
#[derive(Debug, Clone)]
pub struct NextPart {
    /// Its number, unless another part comes first.
    pub number: u32,
    /// What it is.
    pub part_type: String,
    /// On which path.
    pub path: WhichPath,
    /// Number of that path, if it is given out or is so now.
    pub revision: u32,
    /// The job.
    pub job: Value,
    /// Its answer.
    pub solved: Solved,
    /// What is said of the process.
    pub state: Option<Value>,
}

impl Engine {
    /// The next part of a process.
    pub async fn next_part(
        &self,
        shelf: &Shelf,
        process: &str,
        asked: NextAsked,
        owner: &str,
    ) -> Result<NextPart, ProcessError> {
        let inner = &self.inner;
        let full = shelf.full(process);
        let seat = inner.live_processes.seat(&full);
        let mut seated = seat.lock().await;
        for _ in 0..TRIES {
            inner.head(shelf, process).await?;
            let live = Live::current(inner, &full, &mut seated).await?;
            let entry = Arc::clone(live.document.entry(&inner.registry)?);
            let observed = live.document.observed(&inner.registry)?;
            if let Some((name, _)) = asked.conditions.iter().find(|(name, _)| !observed.conditions.contains(&&**name)) {
                let finding = Finding::new("condition_not_of_process", "").with("name", name.clone());
                return Err(ProcessError::one(finding.with("known", observed.conditions.to_vec())));
            }
            let part_type = live.next_type(asked.part_type.clone())?;
            let calls = live.action() == Some(ActionKind::CallPerson);
            let proposed = live.action() == Some(ActionKind::NewPath) && live.document.is_automatic();
            let path = asked.path.unwrap_or(if proposed { WhichPath::NewPath } else { WhichPath::AsNow });
            if asked.issue && (calls || live.document.is_stopped()) && asked.path != Some(WhichPath::AsNow) {
                return Err(ProcessError::CallPerson);
            }
            let job = live.job(&part_type, path, asked.conditions.clone()).await?;
            let calculator = entry.meta().id;
            let solved = self.solve(calculator, Body::Json(job.to_string().into())).await?;
            let key = solved.stored.key.to_string();
            let known = live.paths.iter().rev().find(|issued| issued.content["key"] == key);
            let next = NextPart {
                number: live.last() + 1,
                part_type: part_type.clone(),
                path,
                revision: known.map_or_else(|| live.next_path(), |issued| issued.revision),
                job,
                state: live.state(process, live.sequence),
                solved,
            };
            if known.is_some() || !asked.issue {
                return Ok(next);
            }
            let result: Value = serde_json::from_slice(&next.solved.stored.body).map_err(|error| unreadable(&error))?;
            let Some(conditions) = (observed.commanded)(result["result"].clone()) else {
                // Whoever asks for the program is told what is wrong with the path.
                return Ok(next);
            };
            let content = json!({ "key": key, "part_type": part_type, "path": path.word(), "job": next.job,
                "conditions": conditions });
            let entry = NewEntry {
                kind: EntryKind::Path,
                part: None,
                revision: next.revision,
                number: None,
                content: content.to_string(),
                said: json!({ "news": ["path"], "path": next.revision, "part_type": part_type, "result": key })
                    .to_string(),
                created_ms: None,
            };
            let addition = Addition {
                process: full.clone(),
                after: Some(live.sequence),
                entries: vec![entry],
                state: live.state(process, live.sequence + 1).map(|state| state.to_string()),
                owner: owner.to_owned(),
                quota: inner.settings.quota,
                ..Addition::default()
            };
            if inner.add(addition).await?.is_some() {
                return Ok(next);
            }
        }
        Err(Error::Busy { retry_after: crate::engine::json::RETRY_AFTER }.into())
    }
}

fn unreadable(error: &serde_json::Error) -> Error {
    Error::internal(format!("a result: {error}"))
}

impl Live {
    fn next_path(&self) -> u32 {
        self.paths.iter().map(|issued| issued.revision).max().unwrap_or(0) + 1
    }

    fn action(&self) -> Option<ActionKind> {
        self.outlook().map(|outlook| outlook.action.kind)
    }

    /// The type asked for; else that of the last path, or the first that there is.
    fn next_type(&self, asked: Option<String>) -> Result<String, ProcessError> {
        let types = self.document.filled["part_types"].as_object().cloned().unwrap_or_default();
        let first = || types.keys().next().cloned().unwrap_or_default();
        let name = asked.unwrap_or_else(|| self.last_type().map_or_else(first, ToOwned::to_owned));
        if types.contains_key(&name) {
            return Ok(name);
        }
        let known: Vec<String> = types.keys().cloned().collect();
        let finding = Finding::new("part_type_not_declared", "/part_type").with("part_type", name);
        Err(ProcessError::one(finding.with("known", known)))
    }

    /// The job of a part: the one that was given out last, or that of the model as it is by now. It is the base job's where
    /// nothing was given out, and while nothing is known.
    async fn job(
        &self,
        part_type: &str,
        path: WhichPath,
        conditions: Vec<(String, f64)>,
    ) -> Result<Value, ProcessError> {
        let mut job = self.document.filled["part_types"][part_type]["job"].clone();
        match path {
            WhichPath::AsNow => {
                let is_it = |issued: &&Issued| issued.content["part_type"] == part_type;
                if let Some(issued) = self.paths.iter().rev().find(is_it) {
                    job = issued.content["job"].clone();
                }
            }
            WhichPath::NewPath => {
                if let Some(known) = self.known_job(part_type.to_owned(), conditions.clone()).await? {
                    job = known;
                }
            }
        }
        for (name, value) in &conditions {
            job["conditions"][name] = json!(value);
        }
        Ok(job)
    }
}
