//! Shards of large jobs: jobs of their own in the same line.
//!
//! One shard of a parent has its turn: the parent keeps one place of all, as any job that runs. The others go behind all jobs
//! of its priority: they are for places that nobody else wants. When the one ends, the next of those that wait has the turn.

use bytes::Bytes;

use super::jobs::count;
use super::runnable::unpacked;
use crate::key::Key;
use crate::store::jobs::{Lease, MOST_ATTEMPTS, Shard, ShardId};
use crate::store::sql::{Outcome, Session, Value, sql};

/// The turn of shards that go behind all other jobs of their priority.
pub(in crate::store) const BEHIND: i64 = i64::MAX / 4;

/// Puts shards of what runs under a lease in line. Whether the lease holds.
pub(super) async fn add<S: Session>(connection: &mut S, lease: Lease, numbers: &[u32]) -> Outcome<bool> {
    let parent = sql("SELECT key FROM jobs WHERE lease = $1 AND state = 'running' LIMIT 1").bind(lease);
    let parent = connection.first::<(Vec<u8>,)>(parent).await?;
    let Some(parent) = parent.and_then(|(key,)| Key::from_bytes(&key)) else { return Ok(false) };
    if !numbers.is_empty() {
        insert(connection, (lease, parent), numbers).await?;
    }
    // Unless one of them has it.
    let given = sql(concat!(
        give_turn!("$1", "$2"),
        " AND NOT EXISTS (SELECT 1 FROM jobs AS other
              WHERE other.parent = $1 AND other.state IN ('queued', 'running') AND other.turn < $2)"
    ));
    connection.run(given.bind(parent).bind(BEHIND)).await?;
    Ok(true)
}

async fn insert<S: Session>(connection: &mut S, (lease, parent): (Lease, Key), numbers: &[u32]) -> Outcome<()> {
    let now = connection.now_ms().await?;
    let mut added =
        sql("INSERT INTO jobs (id, key, shard, kind, calculator, version, priority, parent, input, state, turn,
             owner, estimate_ms, created_ms");
    added.push(S::ENGINE).push(") SELECT column1, column2, column3, kind, calculator, version, priority, key, ");
    added.push_bind(Vec::<u8>::new()).push(", 'queued', ").push_bind(BEHIND).push(", '', 0.0, ").push_bind(now);
    added.push(S::ENGINE).push(" FROM (SELECT * FROM jobs WHERE lease = ").push_bind(lease);
    added.push(" AND state = 'running' ORDER BY id LIMIT 1) AS whole, (VALUES ");
    for (index, &number) in numbers.iter().enumerate() {
        let shard = ShardId { parent, number };
        let row: [Value; 3] = [shard.job().into(), shard.key().into(), number.into()];
        added.push(if index == 0 { "" } else { ", " }).push_list(row);
    }
    // Without a condition SQLite would take ON for that of the join.
    added.push(
        ") AS shards WHERE true ON CONFLICT (id) DO UPDATE SET state = 'queued', attempt = 0, progress = 0.0,
             content = NULL, problem = NULL, started_ms = NULL, finished_ms = NULL, turn = excluded.turn
         WHERE jobs.state IN ('succeeded', 'failed', 'cancelled')",
    );
    connection.run(added).await.map(drop)
}

/// Gives the parent's turn to the first shard that waits.
macro_rules! give_turn {
    ($parent:literal, $behind:literal) => {
        concat!(
            "UPDATE jobs
             SET turn = coalesce(
                 (SELECT min(turn) FROM jobs AS whole WHERE whole.key = ",
            $parent,
            " AND whole.state = 'running'), turn)
             WHERE id = (SELECT id FROM jobs WHERE parent = ",
            $parent,
            " AND state = 'queued' ORDER BY id LIMIT 1)
                 AND state = 'queued' AND turn >= ",
            $behind
        )
    };
}
pub(in crate::store) use give_turn;

/// A parent of which a shard ends gets on: it is not to blame for the end of its processes. What is done is not computed
/// again, so that this cannot go on for ever.
macro_rules! get_on {
    ($parent:literal, $most:literal) => {
        concat!(
            "UPDATE jobs SET attempt = ",
            $most,
            " WHERE key = ",
            $parent,
            " AND state = 'running' AND attempt > ",
            $most
        )
    };
}
pub(in crate::store) use get_on;

/// The most starts with which a parent is left that gets on.
pub(in crate::store) const MOST_OF_PARENT: u32 = MOST_ATTEMPTS - 1;

/// A shard of that turn has ended: if it was the parent's, the next has it.
pub(super) async fn go_on<S: Session>(connection: &mut S, parent: Vec<u8>, turn: i64) -> Outcome<()> {
    connection.run(sql(get_on!("$1", "$2")).bind(parent.clone()).bind(MOST_OF_PARENT)).await?;
    if turn < BEHIND {
        connection.run(sql(give_turn!("$1", "$2")).bind(parent).bind(BEHIND)).await?;
    }
    Ok(())
}

/// Of these shards those that are over.
pub(in crate::store) async fn over<S: Session>(
    connection: &mut S,
    parent: Key,
    numbers: &[u32],
) -> Outcome<Vec<Shard>> {
    let Some(last) = numbers.last() else { return Ok(Vec::new()) };
    // Few lengths of the list: each is another statement, which has to be prepared.
    let asked = numbers.iter().chain(std::iter::repeat(last)).take(numbers.len().next_power_of_two());
    let mut over = sql("SELECT shard, content, problem FROM jobs WHERE state IN ('succeeded', 'failed') AND parent = ");
    over.push_bind(parent).push(" AND id IN ");
    over.push_list(asked.map(|&number| ShardId { parent, number }.job()));
    let rows: Vec<(i32, Option<Vec<u8>>, Option<String>)> = connection.all(over).await?;
    let shard = |(number, content, problem): (i32, Option<Vec<u8>>, Option<String>)| Shard {
        number: count(number),
        outcome: problem.map_or_else(|| Ok(unpacked(&content.unwrap_or_default())), Err),
    };
    Ok(rows.into_iter().map(shard).collect())
}

/// What is needed to run the job of a key that runs.
pub(in crate::store) async fn input_of<S: Session>(connection: &mut S, key: Key) -> Outcome<Option<Bytes>> {
    let input = sql("SELECT input FROM jobs WHERE key = $1 AND state = 'running' LIMIT 1").bind(key);
    Ok(connection.first::<(Vec<u8>,)>(input).await?.map(|(input,)| unpacked(&input)))
}

/// Forgets shards whose parent is over.
pub(in crate::store) async fn forget_orphans<S: Session>(connection: &mut S) -> Outcome<()> {
    let orphans = sql("DELETE FROM jobs WHERE parent IN (
             SELECT parent FROM (SELECT DISTINCT parent FROM jobs WHERE parent IS NOT NULL) AS parents
             WHERE NOT EXISTS (SELECT 1 FROM jobs AS whole
                               WHERE whole.key = parents.parent AND whole.state IN ('queued', 'running')))");
    connection.run(orphans).await.map(drop)
}
