//! Who waits for news of which job.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::watch;

use crate::store::jobs::JobId;

/// The jobs somebody waits for.
#[derive(Default)]
pub(crate) struct Feeds(Mutex<HashMap<JobId, watch::Sender<()>>>);

impl Feeds {
    /// News of a job from now on. Look at its record after this, not before.
    pub(crate) fn subscribe(self: &Arc<Self>, id: JobId) -> Feed {
        let news = self.lock().entry(id).or_insert_with(|| watch::channel(()).0).subscribe();
        Feed { feeds: Arc::clone(self), id, news }
    }

    /// Something about these jobs has changed.
    pub(crate) fn touch(&self, ids: &[JobId]) {
        let feeds = self.lock();
        for sender in ids.iter().filter_map(|id| feeds.get(id)) {
            sender.send_replace(());
        }
    }

    /// Any job may have changed.
    pub(crate) fn touch_all(&self) {
        for sender in self.lock().values() {
            sender.send_replace(());
        }
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<JobId, watch::Sender<()>>> {
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
        let mut feeds = self.feeds.lock();
        if feeds.get(&self.id).is_some_and(|sender| sender.receiver_count() <= 1) {
            feeds.remove(&self.id);
        }
    }
}
