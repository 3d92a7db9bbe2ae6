//! Writes that somebody waits for: in groups, each group one transaction and one flush of the disk.
//!
//! Whoever orders a write hears of it only once it is on the disk. Nobody can take an order back: a client that goes
//! away in the middle leaves no half-done transaction.

use futures_util::future::BoxFuture;
use sqlx::Connection;
use sqlx::sqlite::{SqliteConnection, SqlitePool};
use tokio::sync::{mpsc, oneshot};

use super::StoreError;

/// Orders that may wait; further ones wait before the door.
const WAITING: usize = 1024;
/// Orders in one transaction.
const GROUP: usize = 64;

/// What a write does with the connection. May be called again where another order of its group failed.
type Work<T> = Box<dyn for<'c> Fn(&'c mut SqliteConnection) -> BoxFuture<'c, Result<T, sqlx::Error>> + Send + Sync>;

/// Takes orders and has them carried out.
#[derive(Clone)]
pub(super) struct Ledger {
    orders: mpsc::Sender<Box<dyn Order>>,
}

trait Order: Send {
    fn attempt<'c>(&'c mut self, connection: &'c mut SqliteConnection) -> BoxFuture<'c, Result<(), sqlx::Error>>;
    fn done(self: Box<Self>, outcome: Result<(), StoreError>);
}

struct Write<T> {
    work: Work<T>,
    value: Option<T>,
    reply: oneshot::Sender<Result<T, StoreError>>,
}

impl<T: Send + 'static> Order for Write<T> {
    fn attempt<'c>(&'c mut self, connection: &'c mut SqliteConnection) -> BoxFuture<'c, Result<(), sqlx::Error>> {
        Box::pin(async move {
            self.value = Some((self.work)(connection).await?);
            Ok(())
        })
    }
    fn done(self: Box<Self>, outcome: Result<(), StoreError>) {
        let answer = match (outcome, self.value) {
            (Ok(()), Some(value)) => Ok(value),
            (Ok(()), None) => Err(StoreError::Failed("a write was not attempted".to_owned())),
            (Err(error), _) => Err(error),
        };
        // Nobody listens if the client has gone.
        let _ = self.reply.send(answer);
    }
}

impl Ledger {
    pub(super) fn start(pool: SqlitePool) -> Self {
        let (orders, receiver) = mpsc::channel(WAITING);
        tokio::spawn(carry_out(pool, receiver));
        Self { orders }
    }

    /// Does `work` in a transaction, perhaps with others; returns when it is on the disk.
    pub(super) async fn write<T: Send + 'static>(
        &self,
        work: impl for<'c> Fn(&'c mut SqliteConnection) -> BoxFuture<'c, Result<T, sqlx::Error>> + Send + Sync + 'static,
    ) -> Result<T, StoreError> {
        let closed = || StoreError::Failed("the store is closed".to_owned());
        let (reply, answer) = oneshot::channel();
        let order = Box::new(Write { work: Box::new(work), value: None, reply });
        self.orders.send(order).await.map_err(|_| closed())?;
        answer.await.map_err(|_| closed())?
    }
}

async fn carry_out(pool: SqlitePool, mut orders: mpsc::Receiver<Box<dyn Order>>) {
    let mut group = Vec::new();
    while orders.recv_many(&mut group, GROUP).await > 0 {
        match together(&pool, &mut group).await {
            Ok(()) => group.drain(..).for_each(|order| order.done(Ok(()))),
            Err(error) if group.len() == 1 || !is_of_one_order(&error) => {
                let error = StoreError::from(error);
                group.drain(..).for_each(|order| order.done(Err(error.clone())));
            }
            // One of them is at fault: each alone shows which.
            Err(_) => {
                for order in group.drain(..) {
                    let mut alone = vec![order];
                    let outcome = together(&pool, &mut alone).await.map_err(StoreError::from);
                    for order in alone {
                        order.done(outcome.clone());
                    }
                }
            }
        }
    }
}

/// Whether an error may be that of one order; a disk or a lock fails them all, and trying each would only take longer.
fn is_of_one_order(error: &sqlx::Error) -> bool {
    /// `BUSY`, `LOCKED`, `READONLY`, `IOERR`, `FULL`, `CANTOPEN` of SQLite.
    const OF_ALL: [i32; 6] = [5, 6, 8, 10, 13, 14];
    match super::sqlite_code(error) {
        Some(code) => !OF_ALL.contains(&code),
        None => !matches!(error, sqlx::Error::PoolTimedOut | sqlx::Error::PoolClosed | sqlx::Error::Io(_)),
    }
}

async fn together(pool: &SqlitePool, group: &mut [Box<dyn Order>]) -> Result<(), sqlx::Error> {
    let mut connection = pool.acquire().await?;
    let outcome = within(&mut connection, group).await;
    if outcome.is_err() {
        // Where SQLite has rolled back by itself (a full disk), the driver still counts a transaction that nothing can
        // end, and would refuse every later one.
        connection.close_on_drop();
    }
    outcome
}

async fn within(connection: &mut SqliteConnection, group: &mut [Box<dyn Order>]) -> Result<(), sqlx::Error> {
    let mut transaction = connection.begin_with("BEGIN IMMEDIATE").await?;
    for order in group {
        order.attempt(&mut transaction).await?;
    }
    transaction.commit().await
}
