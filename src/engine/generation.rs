//! Whether what is remembered of names still holds: models, machines, tools and materials are revised while the service runs.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use super::Inner;
use crate::store::StoreError;
use crate::store::documents::{Kind, NewDocuments, PutDocuments};

/// What other processes change is told by notifications. One that is lost costs no more than so long.
const READ_AGAIN: Duration = Duration::from_millis(500);

/// Counts changes of documents.
#[derive(Default)]
pub(crate) struct Generation {
    number: Arc<AtomicU64>,
    /// The number of the store that other processes count, too, and when it was read.
    seen: Mutex<Option<(Option<i64>, Instant)>>,
}

impl Generation {
    /// What is remembered from now on holds until the next change. To be asked for before names are looked up: a change
    /// meanwhile then counts.
    pub(crate) fn number(&self) -> u64 {
        self.number.load(Ordering::Acquire)
    }

    /// Something has changed.
    pub(crate) fn changed(&self) {
        self.number.fetch_add(1, Ordering::AcqRel);
    }

    /// Does a write, after which something has changed: also where it failed, which may have been too late, and where whoever
    /// asked for it has gone.
    pub(super) async fn after<T: Send + 'static>(
        &self,
        write: impl Future<Output = Result<T, StoreError>> + Send + 'static,
    ) -> Result<T, StoreError> {
        let number = Arc::clone(&self.number);
        let written = tokio::spawn(async move {
            let outcome = write.await;
            number.fetch_add(1, Ordering::AcqRel);
            outcome
        });
        written.await.unwrap_or_else(|error| Err(StoreError::Failed(error.to_string())))
    }

    /// Whether the store has to be asked again.
    fn is_old(&self) -> bool {
        let seen = *self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        seen.is_none_or(|(number, when)| number.is_some() && when.elapsed() >= READ_AGAIN)
    }

    fn see(&self, number: Option<i64>) {
        let mut seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        if seen.is_some_and(|(before, _)| before != number) {
            self.changed();
        }
        *seen = Some((number, Instant::now()));
    }
}

impl Inner {
    /// The generation, which holds whatever other processes did until half a second ago.
    pub(crate) async fn generation(&self) -> Result<u64, StoreError> {
        if self.generation.is_old() {
            let number = self.documents.generation().await?;
            self.generation.see(number);
        }
        Ok(self.generation.number())
    }

    /// Whether what was so then is so now; always where it names nothing that may be revised.
    pub(super) async fn still_means(&self, then: Option<u64>) -> bool {
        match then {
            None => true,
            Some(then) => self.generation().await.is_ok_and(|now| now == then),
        }
    }

    /// Keeps documents; from then on names mean them.
    pub(super) async fn put_documents(&self, new: NewDocuments) -> Result<PutDocuments, StoreError> {
        let documents = Arc::clone(&self.documents);
        self.generation.after(async move { documents.put_documents(new).await }).await
    }

    /// Deletes a document; from then on its name means nothing.
    pub(super) async fn delete_document(&self, kind: Kind, name: String) -> Result<bool, StoreError> {
        let documents = Arc::clone(&self.documents);
        self.generation.after(async move { documents.delete_document(kind, name).await }).await
    }
}
