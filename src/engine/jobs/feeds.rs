//! Who waits for news of which job.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::watch;

use crate::store::jobs::JobId;

/// The jobs somebody waits for.
#[derive(Default)]
pub(crate) struct Feeds(Mutex<HashMap<JobId, Line>>);

/// Where those who wait for one job hear of it.
struct Line {
    news: watch::Sender<()>,
    /// How many they are. Receivers are counted only after their feed has let go of the lock.
    feeds: usize,
}

impl Feeds {
    /// News of a job from now on. Look at its record after this, not before.
    pub(crate) fn subscribe(self: &Arc<Self>, id: JobId) -> Feed {
        let mut lines = self.lock();
        let line = lines.entry(id).or_insert_with(|| Line { news: watch::channel(()).0, feeds: 0 });
        line.feeds += 1;
        let news = line.news.subscribe();
        Feed { feeds: Arc::clone(self), id, news }
    }

    /// Something about these jobs has changed; of shards it is told to who asks for all of their parent's.
    pub(crate) fn touch(&self, ids: &[JobId]) {
        let feeds = self.lock();
        let ids = ids.iter().flat_map(|&id| [Some(id), id.of_siblings()]).flatten();
        for line in ids.filter_map(|id| feeds.get(&id)) {
            line.news.send_replace(());
        }
    }

    /// Any job may have changed.
    pub(crate) fn touch_all(&self) {
        for line in self.lock().values() {
            line.news.send_replace(());
        }
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<JobId, Line>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// News of one job.
pub struct Feed {
    feeds: Arc<Feeds>,
    id: JobId,
    news: watch::Receiver<()>,
}

impl Feed {
    /// Waits until something has changed since this was last called.
    pub async fn changed(&mut self) {
        // The sender lives as long as this does.
        let _ = self.news.changed().await;
    }
}

impl Drop for Feed {
    fn drop(&mut self) {
        let mut lines = self.feeds.lock();
        let Some(line) = lines.get_mut(&self.id) else { return };
        line.feeds -= 1;
        if line.feeds == 0 {
            lines.remove(&self.id);
        }
    }
}
