//! Who is told, and what came of it. How callbacks are taken up is each store's own.

use super::jobs::{count, parsed, unreadable};
use crate::store::callbacks::{Callback, CallbackState, DueCallback, NewCallback, Subject, Tried};
use crate::store::jobs::{JobId, Lease};
use crate::store::sql::{Outcome, Session, sql};

/// Puts down who is told of a job: now, where it is over already.
pub(in crate::store) async fn note<S: Session>(
    connection: &mut S,
    job: JobId,
    callback: &NewCallback,
    over_ms: Option<i64>,
) -> Outcome<()> {
    let state = if over_ms.is_some() { "pending" } else { "waiting" };
    let noted = sql("INSERT INTO callbacks (job, url, host, state, next_ms) VALUES ($1, $2, $3, $4, $5)");
    let noted = noted.bind(job.to_string()).bind(&callback.url).bind(&callback.host).bind(state).bind(over_ms);
    connection.run(noted).await.map(drop)
}

/// Puts down who is told of an entry of a process.
pub(super) async fn note_entry<S: Session>(
    connection: &mut S,
    (process, sequence): (&str, i64),
    callback: &NewCallback,
    now: i64,
) -> Outcome<()> {
    let noted = sql("INSERT INTO callbacks (process, sequence, url, host, state, next_ms)
         VALUES ($1, $2, $3, $4, 'pending', $5)");
    let noted = noted.bind(process).bind(sequence).bind(&callback.url).bind(&callback.host).bind(now);
    connection.run(noted).await.map(drop)
}

pub(in crate::store) async fn settle<S: Session>(
    connection: &mut S,
    due: &DueCallback,
    tried: &Tried,
) -> Outcome<bool> {
    let now = connection.now_ms().await?;
    let (state, after_ms, fault) = tried.written();
    let settled = sql("UPDATE callbacks SET state = $3, next_ms = $4, fault = $5, lease = NULL, settled_ms = $6
         WHERE id = $1 AND lease = $2");
    let settled = settled.bind(due.id).bind(due.lease.to_string()).bind(state);
    let settled = settled.bind(after_ms.map(|after| now.saturating_add(after))).bind(fault);
    Ok(connection.run(settled.bind(after_ms.is_none().then_some(now))).await? > 0)
}

/// A callback that was taken up, as it is read.
pub(in crate::store) struct Taken {
    id: i64,
    job: Option<String>,
    process: Option<String>,
    sequence: Option<i64>,
    url: String,
    host: String,
    attempts: u32,
}

from_row!(Taken { id, job, process, sequence, url, host, attempts as i32 });

impl Taken {
    pub(in crate::store) fn due(self, lease: Lease) -> Outcome<DueCallback> {
        let job = self.job.map(|job| parsed(&job)).transpose()?;
        let subject = Subject::read(job, self.process, self.sequence)?;
        Ok(DueCallback { id: self.id, subject, url: self.url, host: self.host, lease, attempt: self.attempts })
    }
}

/// What has become of a callback, where there is one: its columns beside those of what it tells of.
pub(super) struct Told {
    url: Option<String>,
    callback_state: Option<String>,
    attempts: Option<i32>,
    next_ms: Option<i64>,
    fault: Option<String>,
    settled_ms: Option<i64>,
}

from_row!(Told { url, callback_state, attempts, next_ms, fault, settled_ms });

/// The columns of a [`Told`].
macro_rules! told {
    () => {
        "url, callbacks.state AS callback_state, attempts, next_ms, fault, settled_ms"
    };
}

pub(super) use told;

impl Told {
    pub(super) fn callback(self) -> Outcome<Option<Callback>> {
        let (Some(url), Some(state)) = (self.url, self.callback_state) else { return Ok(None) };
        Ok(Some(Callback {
            url,
            state: CallbackState::of_word(&state).ok_or_else(|| unreadable("callback"))?,
            attempts: self.attempts.map_or(0, count),
            next_ms: self.next_ms,
            fault: self.fault,
            settled_ms: self.settled_ms,
        }))
    }
}

/// A row with the callback that stands beside it.
pub(super) struct WithCallback<T> {
    pub(super) row: T,
    pub(super) told: Told,
}

impl<'r, R: sqlx::Row, T: sqlx::FromRow<'r, R>> sqlx::FromRow<'r, R> for WithCallback<T>
where
    Told: sqlx::FromRow<'r, R>,
{
    fn from_row(row: &'r R) -> Outcome<Self> {
        Ok(Self { row: T::from_row(row)?, told: Told::from_row(row)? })
    }
}
