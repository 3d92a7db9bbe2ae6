//! What happens in one process and concerns others: jobs that changed, computations that nobody wants any more, work that
//! waits. Told by notifications of the database, which leave with the transaction that they speak of.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use sqlx::postgres::{PgConnection, PgListener, PgPool};
use tokio::task::JoinHandle;

use super::texts;
use crate::store::jobs::{Changed, Hear, JobId, Lease, News};
use crate::store::sql::Outcome;

/// Our notifications.
const CHANNEL: &str = "precut_news";
/// Jobs and leases in one notification, which has room for 8000 bytes.
const TOLD_AT_ONCE: usize = 100;
/// Between two attempts to listen.
const PAUSE: Duration = Duration::from_millis(250);

#[derive(Default, Serialize, Deserialize)]
struct Notice {
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    jobs: Vec<String>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    unwanted: Vec<String>,
    /// Documents changed: what the trigger of their table says.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    library: bool,
    /// There is something to do: what the trigger of jobs says that come into line.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    waiting: bool,
}

/// A statement's way to say the same of one job.
macro_rules! told {
    ($id:literal) => {
        concat!("pg_notify('precut_news', json_build_object('jobs', json_build_array(", $id, "))::text)")
    };
}
pub(super) use told;

/// Tells all processes, once the transaction is committed.
pub(in crate::store) async fn tell(connection: &mut PgConnection, jobs: &[JobId], unwanted: &[Lease]) -> Outcome<()> {
    let (jobs, unwanted) = (texts(jobs), texts(unwanted));
    let of_jobs = jobs.chunks(TOLD_AT_ONCE).map(|jobs| Notice { jobs: jobs.to_vec(), ..Notice::default() });
    let of_leases =
        unwanted.chunks(TOLD_AT_ONCE).map(|unwanted| Notice { unwanted: unwanted.to_vec(), ..Notice::default() });
    for notice in of_jobs.chain(of_leases) {
        say(connection, &notice).await?;
    }
    Ok(())
}

async fn say(connection: &mut PgConnection, notice: &Notice) -> Outcome<()> {
    let text = serde_json::to_string(notice).map_err(|error| sqlx::Error::Encode(error.into()))?;
    sqlx::query("SELECT pg_notify($1, $2)").bind(CHANNEL).bind(text).execute(connection).await.map(drop)
}

/// Listens, over a connection of its own.
pub(super) struct Newsroom {
    hear: Arc<Mutex<Option<Hear>>>,
    task: JoinHandle<()>,
}

impl Newsroom {
    pub(super) fn open(pool: PgPool) -> Self {
        let hear: Arc<Mutex<Option<Hear>>> = Arc::default();
        let task = tokio::spawn(listen(pool, Arc::clone(&hear)));
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

async fn listen(pool: PgPool, hear: Arc<Mutex<Option<Hear>>>) {
    loop {
        if let Err(error) = listen_once(&pool, &hear).await {
            tracing::warn!(%error, "the database's notifications are not heard; listening again");
            metrics::counter!("precut_store_failures_total", "operation" => "listen").increment(1);
        }
        if pool.is_closed() {
            return;
        }
        tokio::time::sleep(PAUSE).await;
    }
}

async fn listen_once(pool: &PgPool, hear: &Mutex<Option<Hear>>) -> Outcome<()> {
    let mut listener = PgListener::connect_with(pool).await?;
    listener.listen(CHANNEL).await?;
    // What was said before is unknown.
    pass_on(hear, News::Missed);
    // Where nothing comes the connection was lost, and with it what was said meanwhile.
    while let Some(notification) = listener.try_recv().await? {
        let Ok(notice) = serde_json::from_str::<Notice>(notification.payload()) else { continue };
        let jobs: Vec<JobId> = notice.jobs.iter().filter_map(|id| id.parse().ok()).collect();
        let unwanted: Vec<Lease> = notice.unwanted.iter().filter_map(|lease| lease.parse().ok()).collect();
        if notice.library {
            pass_on(hear, News::Library);
        }
        if notice.waiting {
            pass_on(hear, News::Waiting);
        }
        if !jobs.is_empty() || !unwanted.is_empty() {
            pass_on(hear, News::Changed(Changed { jobs, unwanted }));
        }
    }
    Ok(())
}
