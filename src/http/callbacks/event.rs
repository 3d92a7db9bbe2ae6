//! What is sent when a job is over.

use serde::Serialize;
use utoipa::ToSchema;

use crate::engine::{Job, JobState};
use crate::http::problem::Problem;

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
