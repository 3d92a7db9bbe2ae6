//! The database's clock, which counts for all.

use std::sync::atomic::{AtomicI64, Ordering};

use sqlx::postgres::PgPool;

use crate::store::now_ms;

/// The database's clock, as far as this process knows it.
#[derive(Debug)]
pub(super) struct Clock {
    /// What is to be added to this machine's clock, ms.
    ahead_ms: AtomicI64,
    /// What this machine's clock is off on top, for tests.
    skew_ms: AtomicI64,
}

/// Clocks that differ by more are worth a word, ms.
const WORTH_A_WORD: i64 = 5_000;

impl Clock {
    pub(super) fn new() -> Self {
        Self { ahead_ms: AtomicI64::new(0), skew_ms: AtomicI64::new(0) }
    }

    /// The time by the database, ms UTC.
    pub(super) fn now_ms(&self) -> i64 {
        self.local_ms() + self.ahead_ms.load(Ordering::Relaxed)
    }

    fn local_ms(&self) -> i64 {
        now_ms() + self.skew_ms.load(Ordering::Relaxed)
    }

    /// Reads the database's clock.
    pub(super) async fn read(&self, pool: &PgPool) -> Result<(), sqlx::Error> {
        let asked = self.local_ms();
        let theirs: i64 = sqlx::query_scalar("SELECT now_ms()").fetch_one(pool).await?;
        self.set(theirs, asked);
        Ok(())
    }

    /// Notes what the database's clock showed between `asked` and now.
    pub(super) fn set(&self, theirs: i64, asked: i64) {
        let ahead = theirs - i64::midpoint(asked, self.local_ms());
        let before = self.ahead_ms.swap(ahead, Ordering::Relaxed);
        if (ahead - before).abs() > WORTH_A_WORD {
            tracing::warn!(
                database_ahead_ms = ahead,
                "the clocks of this machine and of the database differ; the database's counts"
            );
        }
    }

    /// Makes this machine's clock wrong.
    #[cfg(test)]
    pub(super) fn skew(&self, ms: i64) {
        self.skew_ms.store(ms, Ordering::Relaxed);
    }
}
