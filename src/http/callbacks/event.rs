//! What is sent when a job is over, and when something is said of a process.

use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;

use crate::engine::{Job, JobState};
use crate::http::problem::Problem;
use crate::store::processes::Entry;

/// What is posted to a callback. It says the same at every try.
#[derive(Debug, Serialize, ToSchema)]
pub(in crate::http) struct JobEvent {
    /// What happened.
    #[serde(rename = "type")]
    kind: JobEventKind,
    /// When it happened, UTC.
    #[schema(format = DateTime, example = "2026-02-03T10:15:04.512Z")]
    timestamp: String,
    /// The job.
    data: JobEventData,
}

/// What happened to a job.
#[derive(Debug, Serialize, ToSchema)]
enum JobEventKind {
    /// It has its result.
    #[serde(rename = "job.succeeded")]
    Succeeded,
    /// It has none; `data.problem` says why.
    #[serde(rename = "job.failed")]
    Failed,
    /// Nobody wanted it any more.
    #[serde(rename = "job.cancelled")]
    Cancelled,
}

/// The job that is over.
#[derive(Debug, Serialize, ToSchema)]
struct JobEventData {
    /// Its name.
    #[schema(example = "0198c5f1-8a3e-7c40-b0a1-5e2d9f4c6b7a")]
    id: String,
    /// Which calculator computed it.
    #[schema(example = "deflection-compensation")]
    calculator: String,
    /// Address of its result.
    #[schema(pattern = "^b3:[0-9a-f]{64}$")]
    key: String,
    /// When it was accepted, UTC.
    #[schema(format = DateTime)]
    created_at: String,
    /// Code of the problem of a job that failed.
    #[schema(example = "deadline_exceeded")]
    problem: Option<&'static str>,
    /// Where to go from here.
    links: JobEventLinks,
}

/// Addresses of the job.
#[derive(Debug, Serialize, ToSchema)]
struct JobEventLinks {
    /// The job itself.
    #[serde(rename = "self")]
    this: String,
    /// Its result.
    result: String,
}

/// What is posted to whom a process names. It says the same at every try.
#[derive(Debug, Serialize, ToSchema)]
pub(in crate::http) struct ProcessEvent {
    /// What happened: `process.` and the first of `data.news`, or the kind of the entry where nothing is new.
    #[serde(rename = "type")]
    #[schema(example = "process.change")]
    kind: String,
    /// When it happened, UTC.
    #[schema(format = DateTime, example = "2026-02-03T10:15:04.512Z")]
    timestamp: String,
    /// The process.
    data: ProcessEventData,
}

/// The process of which something is said.
#[derive(Debug, Serialize, ToSchema)]
struct ProcessEventData {
    /// Its name.
    #[schema(example = "shaft-560")]
    process: String,
    /// Number of the entry in its record.
    #[schema(minimum = 1, example = 41)]
    sequence: i64,
    /// The part that it is about.
    #[schema(example = "2026-02-03-0039")]
    part: Option<String>,
    /// Number of that part; null where it was withdrawn.
    #[schema(example = 39)]
    number: Option<i64>,
    /// What is new, the weightiest first.
    #[schema(example = json!(["change"]))]
    news: Vec<String>,
    /// What the process is said to be.
    #[schema(example = "changed")]
    state: Option<String>,
    /// What is said first of it, in English.
    #[schema(example = "Since part 37 the tailstock is softer.")]
    said: Option<String>,
    /// Where to go from here.
    links: ProcessEventLinks,
}

/// Addresses of the process.
#[derive(Debug, Serialize, ToSchema)]
struct ProcessEventLinks {
    /// The process itself.
    #[serde(rename = "self")]
    this: String,
    /// The part.
    part: Option<String>,
}

impl ProcessEvent {
    /// Words of news by weight.
    const NEWS: [&str; 5] = ["change", "accepted", "odd_part", "warning", "replayed"];

    /// That of an entry in the record of a process.
    pub(super) fn of(process: String, entry: &Entry) -> Self {
        let said: Value = serde_json::from_str(&entry.said).unwrap_or_default();
        let is_new = |word: &&str| said["news"].as_array().is_some_and(|news| news.iter().any(|own| own == word));
        let news: Vec<String> = Self::NEWS.into_iter().filter(is_new).map(ToOwned::to_owned).collect();
        let text = |pointer: &str| said.pointer(pointer).and_then(Value::as_str).map(ToOwned::to_owned);
        let this = format!("/v1/processes/{process}");
        Self {
            kind: format!("process.{}", news.first().unwrap_or(&entry.kind)),
            timestamp: format!("{:.3}", jiff::Timestamp::from_millisecond(entry.created_ms).unwrap_or_default()),
            data: ProcessEventData {
                sequence: entry.sequence,
                part: entry.part.clone(),
                number: entry.number,
                news,
                state: text("/state"),
                said: text("/explanation/0/text"),
                links: ProcessEventLinks { part: entry.part.as_ref().map(|part| format!("{this}/parts/{part}")), this },
                process,
            },
        }
    }
}

impl JobEvent {
    /// That of a job that is over.
    pub(super) fn of(job: &Job) -> Option<Self> {
        let record = &job.record;
        let kind = match record.state {
            JobState::Succeeded => JobEventKind::Succeeded,
            JobState::Failed => JobEventKind::Failed,
            JobState::Cancelled => JobEventKind::Cancelled,
            JobState::Queued | JobState::Running => return None,
        };
        let time = |ms: i64| format!("{:.3}", jiff::Timestamp::from_millisecond(ms).unwrap_or_default());
        let id = record.id;
        Some(Self {
            kind,
            timestamp: time(record.finished_ms?),
            data: JobEventData {
                id: id.to_string(),
                calculator: record.calculator.clone(),
                key: record.key.to_string(),
                created_at: time(record.created_ms),
                problem: job.problem.clone().map(|problem| Problem::from(problem).code()),
                links: JobEventLinks { this: format!("/v1/jobs/{id}"), result: format!("/v1/jobs/{id}/result") },
            },
        })
    }
}
