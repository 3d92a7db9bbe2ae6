//! Server-sent events: news of a job while it is watched.

use std::collections::{HashMap, VecDeque};
use std::convert::Infallible;
use std::hash::{BuildHasher, Hash, RandomState};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use axum::Extension;
use axum::extract::{Path, Request, State};
use axum::http::header::{CACHE_CONTROL, HeaderValue};
use axum::http::{HeaderMap, HeaderName, StatusCode};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use futures_util::{Stream, stream};
use precut_calc::calculator::Figure;
use serde::Serialize;
use utoipa::ToSchema;

use super::auth::Caller;
use super::jobs::{self, named};
use super::problem::Problem;
use super::{App, gate, negotiate, parts};
use crate::engine::{Engine, Feed, Job, JobId, JobRecord, JobState};
use crate::text::{Language, Texts};

pub(super) const LAST_EVENT_ID: HeaderName = HeaderName::from_static("last-event-id");
const X_ACCEL_BUFFERING: HeaderName = HeaderName::from_static("x-accel-buffering");

/// Silence after which a comment is sent, so that nobody on the way takes the stream for dead.
const KEEP_ALIVE: Duration = Duration::from_secs(15);
/// Progress is looked at so often, and therefore sent at most so often.
const LOOK: Duration = Duration::from_millis(200);
/// The record is read again after so many looks without news: whoever else serves the job may have written. Where that
/// is another process, it writes every second how far the job is.
const LOOKS_PER_READING: u32 = 10;
const LOOKS_PER_READING_SHARED: u32 = 5;
/// The last event's number lies so far beyond those that a running job can have: ms.
const BEYOND: u64 = 1000;

/// Data of the event `progress`.
#[derive(Debug, PartialEq, Serialize, ToSchema)]
pub(super) struct JobProgress {
    /// How far the computation is.
    #[schema(minimum = 0, maximum = 1, example = 0.32)]
    progress: f64,
    /// What it is doing.
    #[schema(example = "revolution 31 of 96")]
    stage: Option<String>,
    /// Time left, ms.
    #[schema(minimum = 0, example = 2900.0, extensions(("x-unit" = json!("ms"))))]
    remaining_ms: Option<f64>,
}

/// Open streams by client.
pub(super) struct Streams {
    most: usize,
    hasher: RandomState,
    open: Mutex<HashMap<u64, usize>>,
}

/// The right to one stream.
pub(super) struct Place {
    streams: Arc<Streams>,
    client: u64,
}

impl Streams {
    pub(super) fn new(most: usize) -> Self {
        Self { most, hasher: RandomState::new(), open: Mutex::default() }
    }

    /// So many a client may have open.
    pub(super) fn most(&self) -> usize {
        self.most
    }

    pub(super) fn place(self: &Arc<Self>, client: impl Hash) -> Option<Place> {
        let client = self.hasher.hash_one(client);
        let mut open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        let count = open.entry(client).or_insert(0);
        if *count >= self.most {
            return None;
        }
        *count += 1;
        Some(Place { streams: Arc::clone(self), client })
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let mut open = self.streams.open.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(count) = open.get_mut(&self.client) {
            *count -= 1;
            if *count == 0 {
                open.remove(&self.client);
            }
        }
    }
}

/// `GET /v1/jobs/{id}/events`
pub(super) async fn follow(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(id): Path<String>,
    request: Request,
) -> Result<Response, Problem> {
    let id = named(&app, &caller, &id).await?.record.id;
    let seen = last_seen(request.headers());
    let language = negotiate::language(request.headers());
    let owner = gate::owner(&caller, &request);
    let place = app.streams.place(owner).ok_or_else(|| {
        Problem::new(StatusCode::TOO_MANY_REQUESTS, "too_many_streams")
            .with("limit", app.streams.most)
            .retry_after(Duration::from_secs(1))
    })?;
    let feed = app.engine.feed(id);
    let job = app.engine.job(id).await?;
    if seen >= last_number(&job.record) {
        // A browser connects again when a stream ends; this tells it that there is nothing more to come.
        return Ok(StatusCode::NO_CONTENT.into_response());
    }
    let follower = Follower {
        engine: app.engine.clone(),
        id,
        language,
        feed,
        job: Some(job),
        number: seen,
        sent: Sent::default(),
        waiting: VecDeque::new(),
        looks: 0,
        _place: place,
    };
    let events = stream::unfold(follower, |mut follower| async move {
        let event = follower.next().await?;
        Some((Ok::<_, Infallible>(event), follower))
    });
    Ok(streamed(events))
}

/// Events as they come.
pub(super) fn streamed(events: impl Stream<Item = Result<Event, Infallible>> + Send + 'static) -> Response {
    let mut response = Sse::new(events).keep_alive(KeepAlive::new().interval(KEEP_ALIVE)).into_response();
    response.headers_mut().insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    response.headers_mut().insert(X_ACCEL_BUFFERING, HeaderValue::from_static("no"));
    response
}

pub(super) fn last_seen(headers: &HeaderMap) -> u64 {
    headers.get(LAST_EVENT_ID).and_then(|id| id.to_str().ok()).and_then(|id| id.trim().parse().ok()).unwrap_or(0)
}

/// Number of the event `done` of a job that is over; never reached before.
fn last_number(record: &JobRecord) -> u64 {
    match record.finished_ms {
        Some(at) if record.state.is_final() => u64::try_from(at - record.created_ms).unwrap_or(0) + BEYOND,
        _ => u64::MAX,
    }
}

/// Who follows a job, with what it has been told.
struct Follower {
    engine: Engine,
    id: JobId,
    language: Language,
    feed: Feed,
    /// `None` once the last event is on its way.
    job: Option<Job>,
    /// Number of the last event: time since the job was accepted in ms, or one more than the one before. So it rises
    /// over a restart of the service, too.
    number: u64,
    sent: Sent,
    waiting: VecDeque<Event>,
    looks: u32,
    _place: Place,
}

/// What was said last.
#[derive(Default)]
struct Sent {
    state: Option<(JobState, u32)>,
    progress: Option<JobProgress>,
    interim: Option<Arc<Figure>>,
}

impl Follower {
    async fn next(&mut self) -> Option<Event> {
        loop {
            if let Some(event) = self.waiting.pop_front() {
                return Some(event);
            }
            let job = self.job.take()?;
            if self.sent.state.is_none() {
                self.tell(job);
                continue;
            }
            // Progress is looked at; everything else is news.
            let is_running = job.record.state == JobState::Running;
            let every = if self.engine.is_shared() { LOOKS_PER_READING_SHARED } else { LOOKS_PER_READING };
            let job = tokio::select! {
                () = self.feed.changed() => self.read(job).await,
                () = tokio::time::sleep(LOOK) => {
                    self.looks += 1;
                    if self.looks.is_multiple_of(every) {
                        self.read(job).await
                    } else if is_running {
                        self.engine.refreshed(job.record)
                    } else {
                        job
                    }
                }
                // The next process tells the rest.
                () = self.engine.stopped() => return None,
            };
            self.tell(job);
        }
    }

    /// The job as it is now; as it was where the store does not answer.
    async fn read(&self, before: Job) -> Job {
        self.engine.job(self.id).await.unwrap_or(before)
    }

    fn tell(&mut self, job: Job) {
        let state = (job.record.state, job.record.attempt);
        if self.sent.state != Some(state) {
            self.sent.state = Some(state);
            if job.record.state.is_final() {
                self.number = self.number.max(last_number(&job.record).saturating_sub(2));
            }
            self.push("state", &job, &jobs::document(&job, self.language));
        }
        if job.record.state == JobState::Running {
            self.tell_progress(&job);
        }
        if job.record.state.is_final() {
            self.push("done", &job, &jobs::document(&job, self.language));
        } else {
            self.job = Some(job);
        }
    }

    fn tell_progress(&mut self, job: &Job) {
        let stage = job.stage.as_ref().map(|stage| Texts::shared().message(self.language, "stage", stage));
        let same = |sent: &JobProgress| sent.progress.to_bits() == job.progress.to_bits() && sent.stage == stage;
        if !self.sent.progress.as_ref().is_some_and(same) {
            let progress = JobProgress { progress: job.progress, stage, remaining_ms: job.remaining_ms };
            self.push("progress", job, &progress);
            self.sent.progress = Some(progress);
        }
        if let Some(interim) = &job.interim
            && !self.sent.interim.as_ref().is_some_and(|sent| Arc::ptr_eq(sent, &interim.figure))
        {
            self.push("interim", job, &parts::worded(&interim.figure, self.language));
            self.sent.interim = Some(Arc::clone(&interim.figure));
        }
    }

    fn push(&mut self, name: &str, job: &Job, data: &impl Serialize) {
        let since = u64::try_from(self.engine.now_ms() - job.record.created_ms).unwrap_or(0);
        // A client may say that it saw the last number that there is.
        let next = self.number.saturating_add(1);
        self.number = if job.record.state.is_final() { next } else { since.max(next) };
        let event = Event::default().event(name).id(self.number.to_string());
        match event.json_data(data) {
            Ok(event) => self.waiting.push_back(event),
            Err(error) => tracing::error!(%error, name, "an event cannot be written"),
        }
    }
}
