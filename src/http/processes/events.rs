//! What happens to a process, as it happens: its record as server-sent events.

use std::collections::VecDeque;
use std::convert::Infallible;
use std::time::Duration;

use axum::Extension;
use axum::extract::{Path, Request, State};
use axum::http::StatusCode;
use axum::response::Response;
use axum::response::sse::Event;
use futures_util::stream;
use serde_json::{Value, json};
use tokio::sync::watch;

use super::super::auth::Caller;
use super::super::events::{self, Place};
use super::super::problem::Problem;
use super::super::{App, gate, negotiate};
use crate::engine::{Engine, Shelf, in_language};
use crate::store::processes::Entry;
use crate::text::Language;

/// Entries that are read at once.
const PAGE: u32 = 100;
/// What other programs over the same database add is looked for so often.
const LOOK: Duration = Duration::from_secs(1);

/// `GET /v1/processes/{name}/events`
pub(super) async fn follow(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(name): Path<String>,
    request: Request,
) -> Result<Response, Problem> {
    let shelf = caller.shelf();
    let process = app.engine.process(&shelf, &name).await?;
    let seen = events::last_seen(request.headers());
    let owner = gate::owner(&caller, &request);
    let place = app.streams.place(owner).ok_or_else(|| {
        Problem::new(StatusCode::TOO_MANY_REQUESTS, "too_many_streams")
            .with("limit", app.streams.most())
            .retry_after(Duration::from_secs(1))
    })?;
    // Who comes for the first time hears of what comes from now on.
    let after = if seen == 0 { process.sequence } else { i64::try_from(seen).unwrap_or(i64::MAX) };
    let follower = Follower {
        news: app.engine.process_news(),
        engine: app.engine.clone(),
        language: negotiate::language(request.headers()),
        shelf,
        name,
        after,
        waiting: VecDeque::new(),
        _place: place,
    };
    let stream = stream::unfold(follower, |mut follower| async move {
        let event = follower.next().await?;
        Some((Ok::<_, Infallible>(event), follower))
    });
    Ok(events::streamed(stream))
}

struct Follower {
    engine: Engine,
    news: watch::Receiver<u64>,
    language: Language,
    shelf: Shelf,
    name: String,
    /// Number of the last entry that was told.
    after: i64,
    waiting: VecDeque<Event>,
    _place: Place,
}

impl Follower {
    async fn next(&mut self) -> Option<Event> {
        loop {
            if let Some(event) = self.waiting.pop_front() {
                return Some(event);
            }
            // Where the process is gone, or the store does not answer, the client comes again and is told.
            let entries = self.engine.process_entries(&self.shelf, &self.name, self.after, PAGE).await.ok()?;
            for entry in &entries {
                self.after = entry.sequence;
                self.tell(entry);
            }
            if entries.is_empty() {
                tokio::select! {
                    _ = self.news.changed() => {}
                    () = tokio::time::sleep(LOOK) => {}
                    // The next process tells the rest.
                    () = self.engine.stopped() => return None,
                }
            }
        }
    }

    /// The entry itself comes last and has the number: a stream that ended before it begins with all of it again.
    fn tell(&mut self, entry: &Entry) {
        let said: Value = serde_json::from_str(&entry.said).unwrap_or_default();
        let said = in_language(said, self.language);
        let data = json!({
            "sequence": entry.sequence, "kind": entry.kind, "part": entry.part, "number": entry.number, "said": said,
        });
        let words = said["news"].as_array().cloned().unwrap_or_default();
        for word in words.iter().filter_map(Value::as_str).filter(|word| *word != entry.kind) {
            self.push(Event::default().event(word), &data);
        }
        self.push(Event::default().event(&entry.kind).id(entry.sequence.to_string()), &data);
    }

    fn push(&mut self, event: Event, data: &Value) {
        match event.json_data(data) {
            Ok(event) => self.waiting.push_back(event),
            Err(error) => tracing::error!(%error, "an event cannot be written"),
        }
    }
}
