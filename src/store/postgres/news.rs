//! What happens in one process and concerns others: jobs that changed, computations that nobody wants any more, tasks
//! that were pushed. Told by notifications of the database, which leave with the transaction that they speak of.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use futures_util::task::AtomicWaker;
use serde::{Deserialize, Serialize};
use sqlx::postgres::{PgConnection, PgListener, PgPool};
use tokio::task::JoinHandle;

use super::record::Outcome;
use crate::store::jobs::{Changed, Hear, JobId, Lease, News};

/// Our notifications.
const CHANNEL: &str = "precut_news";
/// The queue's own, at every task that is pushed.
const TASKS: &str = "apalis::job::insert";
/// Jobs and leases in one notification, which has room for 8000 bytes.
const TOLD_AT_ONCE: usize = 100;
/// Between two attempts to listen.
const PAUSE: Duration = Duration::from_millis(250);
/// The bell is rung so often even where nothing is heard.
const RING: Duration = Duration::from_secs(1);

#[derive(Default, Serialize, Deserialize)]
struct Notice {
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    jobs: Vec<String>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    unwanted: Vec<String>,
    /// Documents changed: what the trigger of their table says.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    library: bool,
}

/// Tells all processes, once the transaction is committed.
pub(super) async fn tell(connection: &mut PgConnection, jobs: &[JobId], unwanted: &[Lease]) -> Outcome<()> {
    let (jobs, unwanted) = (super::record::texts(jobs), super::record::texts(unwanted));
    let of_jobs = jobs.chunks(TOLD_AT_ONCE).map(|jobs| Notice { jobs: jobs.to_vec(), ..Notice::default() });
    let of_leases =
        unwanted.chunks(TOLD_AT_ONCE).map(|unwanted| Notice { unwanted: unwanted.to_vec(), ..Notice::default() });
    for notice in of_jobs.chain(of_leases) {
        let text = serde_json::to_string(&notice).map_err(|error| sqlx::Error::Encode(error.into()))?;
        sqlx::query("SELECT pg_notify($1, $2)").bind(CHANNEL).bind(text).execute(&mut *connection).await?;
    }
    Ok(())
}

/// Listens, over a connection of its own.
pub(super) struct Newsroom {
    hear: Arc<Mutex<Option<Hear>>>,
    task: JoinHandle<()>,
}

impl Newsroom {
    pub(super) fn open(pool: PgPool, bell: Arc<AtomicWaker>) -> Self {
        let hear: Arc<Mutex<Option<Hear>>> = Arc::default();
        let task = tokio::spawn(listen(pool, bell, Arc::clone(&hear)));
        Self { hear, task }
    }

    /// From now on news go there.
    pub(super) fn to(&self, hear: Hear) {
        *self.hear.lock().unwrap_or_else(PoisonError::into_inner) = Some(hear);
    }

    pub(super) fn close(&self) {
        self.task.abort();
    }
}

impl Drop for Newsroom {
    fn drop(&mut self) {
        self.close();
    }
}

fn pass_on(hear: &Mutex<Option<Hear>>, news: News) {
    let hear = hear.lock().unwrap_or_else(PoisonError::into_inner).clone();
    if let Some(hear) = hear {
        hear(news);
    }
}

async fn listen(pool: PgPool, bell: Arc<AtomicWaker>, hear: Arc<Mutex<Option<Hear>>>) {
    loop {
        if let Err(error) = listen_once(&pool, &bell, &hear).await {
            tracing::warn!(%error, "the database's notifications are not heard; listening again");
            metrics::counter!("precut_store_failures_total", "operation" => "listen").increment(1);
        }
        if pool.is_closed() {
            return;
        }
        tokio::time::sleep(PAUSE).await;
    }
}

async fn listen_once(pool: &PgPool, bell: &AtomicWaker, hear: &Mutex<Option<Hear>>) -> Outcome<()> {
    let mut listener = PgListener::connect_with(pool).await?;
    listener.listen_all([CHANNEL, TASKS]).await?;
    // What was said before is unknown.
    pass_on(hear, News::Missed);
    let ringing = async {
        let mut ring = tokio::time::interval(RING);
        loop {
            ring.tick().await;
            bell.wake();
        }
    };
    let listening = async {
        loop {
            match listener.try_recv().await? {
                // The connection was lost, and with it what was said meanwhile.
                None => return Ok(()),
                Some(notification) if notification.channel() == TASKS => bell.wake(),
                Some(notification) => {
                    if let Ok(notice) = serde_json::from_str::<Notice>(notification.payload()) {
                        if notice.library {
                            pass_on(hear, News::Library);
                            continue;
                        }
                        let jobs = notice.jobs.iter().filter_map(|id| id.parse().ok()).collect();
                        let unwanted = notice.unwanted.iter().filter_map(|lease| lease.parse().ok()).collect();
                        pass_on(hear, News::Changed(Changed { jobs, unwanted }));
                    }
                }
            }
        }
    };
    // Neither is begun anew: what a connection has half received would be lost.
    tokio::select! {
        () = ringing => Ok(()),
        heard = listening => heard,
    }
}
