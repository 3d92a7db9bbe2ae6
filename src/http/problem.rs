//! Problem documents (RFC 9457): the one form in which the service says that something is wrong.
//!
//! A handler returns a [`Problem`]: a code with its numbers. It becomes a document at the very end, in
//! [`super::gate`], where the request id and the language are known; what the framework refuses by itself (an
//! unknown path, a wrong method) becomes one there, too. Internal causes go to the log, never into a document.

use std::time::Duration;

use axum::http::header::RETRY_AFTER;
use axum::http::{HeaderName, HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use precut_calc::calculator::{Failure, Finding, Infeasible, Value as Datum, Values};
use serde::Serialize;
use utoipa::ToSchema;

use crate::engine::Error;
use crate::store::StoreError;
use crate::text::{Language, Notice, Texts};

/// Why a request is not answered, before it is put into words.
#[derive(Debug, Clone)]
pub struct Problem(Box<Inner>);

#[derive(Debug, Clone)]
struct Inner {
    status: StatusCode,
    code: &'static str,
    values: Values,
    findings: Vec<Finding>,
    total: usize,
    /// The findings' sentences are the detail: a job without an answer.
    by_finding: Option<&'static str>,
    header: Option<(HeaderName, HeaderValue)>,
    infeasible: Option<Infeasible>,
    /// For the log alone.
    cause: Option<String>,
}

/// A problem document (RFC 9457).
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
#[schema(as = Problem)]
pub struct ProblemDocument {
    /// Address of a page that explains the problem: `/problems/{code}`.
    #[serde(rename = "type")]
    #[schema(example = "/problems/invalid_job")]
    pub kind: String,
    /// Stable name of the problem; never changes its meaning.
    #[schema(example = "invalid_job", pattern = "^[a-z][a-z0-9_]*$")]
    pub code: &'static str,
    /// What is wrong, the same for every occurrence.
    #[schema(example = "The job breaks rules")]
    pub title: String,
    /// Status of the answer.
    #[schema(minimum = 400, maximum = 599, example = 422)]
    pub status: u16,
    /// What is wrong this time, with numbers.
    #[schema(example = "2 faults in the job; each is listed with its place.")]
    pub detail: String,
    /// Id of the request: the log of the service knows it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(example = "019a1f0e-5d3c-7c39-9d5c-0a4d7c1f2b6e", nullable = false)]
    pub instance: Option<String>,
    /// Every fault of the job, ordered by its place; at most 100.
    #[schema(max_items = 100)]
    pub errors: Vec<Notice>,
    /// How many faults there are, listed or not.
    #[schema(minimum = 0, example = 2)]
    pub errors_total: usize,
    /// Where limits conflict: which, and the least relaxation that lets them hold.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub infeasible: Option<Infeasible>,
}

impl Problem {
    /// A problem that the texts know as `code`.
    pub(super) fn new(status: StatusCode, code: &'static str) -> Self {
        Self(Box::new(Inner {
            status,
            code,
            values: Values::new(),
            findings: Vec::new(),
            total: 0,
            by_finding: None,
            header: None,
            infeasible: None,
            cause: None,
        }))
    }

    /// The same with one more number or name for the sentence.
    pub(super) fn with(mut self, name: &'static str, value: impl Into<precut_calc::calculator::Value>) -> Self {
        self.0.values = std::mem::take(&mut self.0.values).with(name, value);
        self
    }

    /// The same with a header of the answer.
    pub(super) fn header(mut self, name: HeaderName, value: HeaderValue) -> Self {
        self.0.header = Some((name, value));
        self
    }

    /// The same with the time after which it is worth coming again.
    pub(super) fn retry_after(self, wait: Duration) -> Self {
        self.with("retry_after_s", wait.as_secs_f64()).header(RETRY_AFTER, HeaderValue::from(whole_s(wait).max(1)))
    }

    /// The same as its header says it.
    pub(super) fn retry_after_s(&self) -> Option<u64> {
        let (_, value) = self.0.header.as_ref().filter(|(name, _)| *name == RETRY_AFTER)?;
        value.to_str().ok()?.parse().ok()
    }

    fn findings(mut self, findings: Vec<Finding>, total: usize) -> Self {
        self.0.findings = findings;
        self.0.total = total;
        self
    }

    /// A job that has no answer: the finding's own code and sentence, under the title of `class`.
    fn without_answer(class: &'static str, finding: Finding) -> Self {
        let mut problem = Self::new(StatusCode::UNPROCESSABLE_ENTITY, finding.code).findings(vec![finding], 1);
        problem.0.by_finding = Some(class);
        problem
    }

    /// What the framework refused by itself.
    pub(super) fn of_status(status: StatusCode) -> Self {
        let code = super::codes::of_status(status);
        Self::new(status, code)
    }

    pub(super) fn too_large(limit_bytes: usize) -> Self {
        Self::new(StatusCode::PAYLOAD_TOO_LARGE, "body_too_large").with("limit_bytes", limit_bytes)
    }

    /// The memory for bodies is spent.
    pub(super) fn no_memory() -> Self {
        Error::Busy { retry_after: Duration::from_secs(1) }.into()
    }

    pub(super) fn too_slow(time: Duration) -> Self {
        Self::new(StatusCode::REQUEST_TIMEOUT, "timeout").with("limit_s", time.as_secs_f64())
    }

    pub(super) fn cut_off() -> Self {
        Self::new(StatusCode::BAD_REQUEST, "incomplete_body")
    }

    /// A body of a type that is not read; the type is empty where none was said.
    pub(super) fn media_type(received: &str, takes_files: bool) -> Self {
        let expected = if takes_files { "application/json or multipart/form-data" } else { "application/json" };
        Self::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, "unsupported_media_type")
            .with("received", received.to_owned())
            .with("expected", expected)
    }

    /// A body that is none of these types.
    pub(super) fn other_type(received: &str, types: &[&str]) -> Self {
        Self::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, "unsupported_media_type")
            .with("received", received.to_owned())
            .with("expected", types.join(", "))
    }

    /// A body that is compressed.
    pub(super) fn encoded(encoding: &str, takes_files: bool) -> Self {
        Self::media_type("", takes_files).with("encoding", encoding.to_owned())
    }

    pub(super) fn multipart(reason: String) -> Self {
        Self::new(StatusCode::BAD_REQUEST, "bad_multipart").with("reason", reason)
    }

    pub(super) fn not_found(path: &str) -> Self {
        Self::new(StatusCode::NOT_FOUND, "not_found").with("path", path.to_owned())
    }

    pub(super) fn method(method: &str, allowed: &str) -> Self {
        Self::new(StatusCode::METHOD_NOT_ALLOWED, "method_not_allowed")
            .with("method", method.to_owned())
            .with("allowed", allowed.to_owned())
    }

    pub(super) fn missing(code: &'static str, name: &str) -> Self {
        Self::new(StatusCode::NOT_FOUND, code).with("name", name.to_owned())
    }

    /// An answer with more numbers than a workbook is made of.
    pub(super) fn too_large_for_a_workbook(cells: usize, most: usize) -> Self {
        let problem = Self::new(StatusCode::UNPROCESSABLE_ENTITY, "workbook_too_large");
        problem.with("cells", cells as f64).with("most", most as f64)
    }

    /// A model that breaks rules.
    pub(super) fn invalid_model(findings: Vec<Finding>) -> Self {
        let total = findings.len();
        Self::new(StatusCode::UNPROCESSABLE_ENTITY, "invalid_model").findings(findings, total)
    }

    /// A machine, tool or material that is not there.
    pub fn unknown_record(kind: precut_library::Kind, name: &str, nearest: Vec<String>) -> Self {
        let problem = Self::missing(kind.unknown(), name);
        if nearest.is_empty() { problem } else { problem.with("nearest", nearest) }
    }

    /// A record, or several, that break rules.
    pub(super) fn invalid_record(findings: Vec<Finding>, total: usize) -> Self {
        Self::new(StatusCode::UNPROCESSABLE_ENTITY, "invalid_record")
            .with("errors_total", total)
            .with("listed", findings.len())
            .findings(findings, total)
    }

    /// A process or a part of it that breaks rules.
    pub(super) fn invalid_process(findings: Vec<Finding>, total: usize) -> Self {
        Self::new(StatusCode::UNPROCESSABLE_ENTITY, "invalid_process")
            .with("errors_total", total)
            .with("listed", findings.len())
            .findings(findings, total)
    }

    /// Status of the answer.
    pub fn status(&self) -> StatusCode {
        self.0.status
    }

    /// Stable name of the problem.
    pub fn code(&self) -> &'static str {
        self.0.code
    }

    /// What went wrong inside, which nobody outside is told.
    pub(super) fn cause(&self) -> Option<&str> {
        self.0.cause.as_deref()
    }

    pub(super) fn extra_header(&self) -> Option<&(HeaderName, HeaderValue)> {
        self.0.header.as_ref()
    }

    /// The problem in words.
    pub fn document(&self, language: Language, instance: Option<String>) -> ProblemDocument {
        let texts = Texts::shared();
        let inner = &*self.0;
        let values = short_values(&inner.values);
        let errors: Vec<Notice> =
            inner.findings.iter().map(|finding| texts.notice(language, "fault", &short(finding))).collect();
        let (title, detail) = match (inner.by_finding, errors.first()) {
            // The class gives the title; what is wrong this time is what was found.
            (Some(class), Some(fault)) => {
                let title = texts.word(language, "problem", &format!("{class}.title"), &values);
                (title, fault.detail.clone())
            }
            (class, _) => texts.problem(language, class.unwrap_or(inner.code), &values),
        };
        ProblemDocument {
            kind: format!("/problems/{}", inner.code),
            code: inner.code,
            title,
            status: inner.status.as_u16(),
            detail,
            instance,
            errors,
            errors_total: inner.total,
            infeasible: inner.infeasible.clone(),
        }
    }
}

/// Most characters of a text that came with a request and goes out with its answer.
const LONGEST_SHOWN: usize = 300;

/// The finding, with texts that are no longer than somebody reads: what is sent in megabytes does not come back.
fn short(finding: &Finding) -> Finding {
    Finding { pointer: short_text(&finding.pointer), values: short_values(&finding.values), ..finding.clone() }
}

fn short_values(values: &Values) -> Values {
    values.iter().fold(Values::new(), |short, (name, value)| short.with(name, short_value(value)))
}

fn short_value(value: &Datum) -> Datum {
    match value {
        Datum::Text(text) if text.len() > LONGEST_SHOWN => Datum::Text(short_text(text).into()),
        Datum::List(items) => Datum::List(items.iter().map(short_value).collect()),
        other => other.clone(),
    }
}

fn short_text(text: &str) -> String {
    match text.char_indices().nth(LONGEST_SHOWN) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

/// A time in whole seconds, none too few.
pub(super) fn whole_s(time: Duration) -> u64 {
    time.as_secs() + u64::from(time.subsec_nanos() > 0)
}

impl IntoResponse for Problem {
    /// An answer without a body: `super::gate` writes the document.
    fn into_response(self) -> Response {
        let mut response = self.0.status.into_response();
        response.extensions_mut().insert(self);
        response
    }
}

impl From<Error> for Problem {
    fn from(error: Error) -> Self {
        match error {
            Error::Syntax(fault) => {
                #[allow(clippy::cast_precision_loss)] // lines and columns of a body of some megabytes
                let (line, column) = (fault.line as f64, fault.column as f64);
                // Without an argument: optimised, a closure that is called twice with the same constant gives both calls one
                // moved value (rust-lang/rust#155241).
                let place = || {
                    Values::new()
                        .with("line", line)
                        .with("column", column)
                        .with("reason", fault.message.clone())
                        .with("pointer", fault.pointer.clone())
                };
                let mut finding = Finding::new(fault.code, fault.pointer.clone());
                finding.values = place();
                let mut problem = Self::new(StatusCode::BAD_REQUEST, fault.code).findings(vec![finding], 1);
                problem.0.values = place();
                problem
            }
            Error::Invalid { findings, total } => Self::new(StatusCode::UNPROCESSABLE_ENTITY, "invalid_job")
                .with("errors_total", total)
                .with("listed", findings.len())
                .findings(findings, total),
            Error::UnknownCalculator { name, nearest } => {
                let problem = Self::missing("unknown_calculator", &name);
                match nearest {
                    Some(nearest) => problem.with("nearest", nearest),
                    None => problem,
                }
            }
            Error::TooExpensive { cost, limit, limit_bytes } => {
                #[allow(clippy::cast_precision_loss)] // printed with three digits
                let (estimate_mb, limit_mb) = (cost.bytes as f64 / 1e6, limit_bytes as f64 / 1e6);
                let limit_ms = limit.as_secs_f64() * 1e3;
                let finding = Finding::new("too_expensive", cost.driver).measured(cost.ms, limit_ms, "ms");
                Self::new(StatusCode::UNPROCESSABLE_ENTITY, "too_expensive")
                    .with("estimate_ms", cost.ms)
                    .with("limit_ms", limit_ms)
                    .with("estimate_mb", estimate_mb)
                    .with("limit_mb", limit_mb)
                    .with("pointer", cost.driver)
                    .findings(vec![finding], 1)
            }
            Error::QueueFull { queued, retry_after } => {
                #[allow(clippy::cast_precision_loss)] // a count of jobs
                Self::new(StatusCode::SERVICE_UNAVAILABLE, "queue_full")
                    .with("queued", queued as f64)
                    .retry_after(retry_after)
            }
            Error::WorkQuota { estimate_s, left_s, quota_s, retry_after } => {
                Self::new(StatusCode::TOO_MANY_REQUESTS, "work_quota")
                    .with("estimate_s", estimate_s)
                    .with("left_s", left_s)
                    .with("quota_s", quota_s)
                    .retry_after(retry_after)
            }
            Error::KeptQuota { kept_bytes, quota_bytes, room_ms, retry_after } => {
                let room_at = jiff::Timestamp::from_millisecond(room_ms).unwrap_or_default();
                #[allow(clippy::cast_precision_loss)] // printed with three digits
                let problem = Self::new(StatusCode::TOO_MANY_REQUESTS, "kept_quota")
                    .with("kept_mb", kept_bytes as f64 / 1e6)
                    .with("quota_mb", quota_bytes as f64 / 1e6)
                    .with("room_at", format!("{room_at:.0}"));
                match retry_after {
                    Some(wait) => problem.retry_after(wait),
                    None => problem,
                }
            }
            Error::IdempotencyKeyReused(job) => {
                Self::new(StatusCode::UNPROCESSABLE_ENTITY, "idempotency_key_reused").with("job", job.to_string())
            }
            Error::UnknownJob(job) => Self::missing("unknown_job", &job.to_string()),
            Error::JobNotFinished { state, retry_after } => {
                Self::new(StatusCode::CONFLICT, "job_not_finished").with("state", state.word()).retry_after(retry_after)
            }
            Error::JobCancelled => Self::new(StatusCode::CONFLICT, "job_cancelled"),
            Error::JobExpired => Self::new(StatusCode::GONE, "job_expired"),
            Error::DeadlineExceeded => Self::new(StatusCode::UNPROCESSABLE_ENTITY, "deadline_exceeded"),
            Error::CrashedRepeatedly { attempts } => {
                Self::new(StatusCode::INTERNAL_SERVER_ERROR, "crashed_repeatedly").with("attempts", f64::from(attempts))
            }
            Error::Busy { retry_after } => Self::new(StatusCode::SERVICE_UNAVAILABLE, "busy").retry_after(retry_after),
            Error::Calculation(failure) => failure.into(),
            Error::Store(StoreError::Outdated(reason)) => {
                tracing::debug!(reason, "a result of another version was asked for");
                Self::new(StatusCode::GONE, "outdated_result")
            }
            Error::Store(StoreError::Failed(cause)) => {
                tracing::error!(cause, "the store failed");
                Self::new(StatusCode::SERVICE_UNAVAILABLE, "store_failed").retry_after(Duration::from_secs(1))
            }
            Error::Store(StoreError::Full(cause)) => {
                tracing::error!(cause, "the disk is full");
                Self::new(StatusCode::INSUFFICIENT_STORAGE, "disk_full")
            }
            // A direct answer is cancelled only when nobody waits for it, or at the end of a shutdown.
            Error::Cancelled | Error::ShuttingDown => Self::shutting_down(),
            Error::Crashed => Self::new(StatusCode::INTERNAL_SERVER_ERROR, "crashed"),
        }
    }
}

impl From<Failure> for Problem {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::Cancelled => Self::shutting_down(),
            Failure::Infeasible(finding) => Self::without_answer("infeasible", finding),
            Failure::Conflicting(conflict) => {
                let mut problem = Self::without_answer("infeasible", conflict.finding);
                problem.0.infeasible = Some(conflict.infeasible);
                problem
            }
            Failure::OutOfModel(finding) => Self::without_answer("out_of_model", finding),
            Failure::NotRead { findings, total } => Self::new(StatusCode::UNPROCESSABLE_ENTITY, "program_not_read")
                .with("errors_total", total)
                .with("listed", findings.len())
                .findings(findings, total),
            Failure::NotConverged { what, residual, iterations } => {
                let problem = Self::new(StatusCode::UNPROCESSABLE_ENTITY, "not_converged")
                    .with("what", what)
                    .with("iterations", f64::from(iterations));
                // Solvers that fail before their first residual have none.
                if residual.is_finite() { problem.with("residual", residual) } else { problem }
            }
            Failure::Internal(cause) => {
                let mut problem = Self::new(StatusCode::INTERNAL_SERVER_ERROR, "internal");
                problem.0.cause = Some(cause);
                problem
            }
        }
    }
}

impl Problem {
    /// Our own fault; the log has the cause.
    pub(super) fn internal() -> Self {
        Self::new(StatusCode::INTERNAL_SERVER_ERROR, "internal")
    }

    /// No more work is taken.
    pub(super) fn shutting_down() -> Self {
        Self::new(StatusCode::SERVICE_UNAVAILABLE, "shutting_down").retry_after(Duration::from_secs(5))
    }
}
