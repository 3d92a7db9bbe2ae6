//! What becomes of jobs once they are there.

use bytes::Bytes;
use futures_util::future::BoxFuture;

use super::callbacks::settle;
use super::usage::{kept_by_owner, note_work, usage};
use super::{jobs, run, shards};
use crate::key::Key;
use crate::store::StoreError;
use crate::store::jobs::{
    Cancelled, Claimed, DueCallback, JobId, JobPage, JobQuery, JobRecord, JobShelf, Lease, Shard, Timing, Tried, Usage,
};
use crate::store::sql::Writes;

impl<W: Writes> JobShelf for W {
    fn job(&self, id: JobId) -> BoxFuture<'_, Result<Option<JobRecord>, StoreError>> {
        Box::pin(async move { Ok(jobs::record(&mut *self.reader().await?, id).await?) })
    }
    fn jobs(&self, query: JobQuery) -> BoxFuture<'_, Result<JobPage, StoreError>> {
        Box::pin(async move { Ok(jobs::list(&mut *self.reader().await?, query).await?) })
    }
    fn job_inputs(&self, ids: Vec<JobId>, most: usize) -> BoxFuture<'_, Result<Vec<(JobId, Bytes)>, StoreError>> {
        Box::pin(async move { Ok(jobs::inputs(&mut *self.reader().await?, &ids, most).await?) })
    }
    fn shards(&self, parent: Key, numbers: Vec<u32>) -> BoxFuture<'_, Result<Vec<Shard>, StoreError>> {
        Box::pin(async move { Ok(shards::over(&mut *self.reader().await?, parent, &numbers).await?) })
    }
    fn input_of(&self, key: Key) -> BoxFuture<'_, Result<Option<Bytes>, StoreError>> {
        Box::pin(async move { Ok(shards::input_of(&mut *self.reader().await?, key).await?) })
    }
    fn usage(&self, owner: String) -> BoxFuture<'_, Result<Usage, StoreError>> {
        Box::pin(async move { Ok(usage(&mut *self.reader().await?, &owner).await?) })
    }
    fn kept_by_owner(&self) -> BoxFuture<'_, Result<Vec<(String, u64)>, StoreError>> {
        Box::pin(async move { Ok(kept_by_owner(&mut *self.reader().await?).await?) })
    }
    fn hold(&self, id: JobId) -> BoxFuture<'_, Result<(), StoreError>> {
        self.write(move |connection| Box::pin(run::hold(connection, id)))
    }
    fn claim(&self, id: JobId, lease: Lease, most: u32, problem: String) -> BoxFuture<'_, Result<Claimed, StoreError>> {
        let keep_ms = self.keep_ms();
        self.write(move |connection| {
            let problem = problem.clone();
            Box::pin(async move { run::claim(connection, id, lease, (most, &problem), keep_ms).await })
        })
    }
    fn add_shards(&self, lease: Lease, numbers: Vec<u32>) -> BoxFuture<'_, Result<bool, StoreError>> {
        self.write(move |connection| {
            let numbers = numbers.clone();
            Box::pin(async move { run::add_shards(connection, lease, &numbers).await })
        })
    }
    fn release(&self, lease: Lease) -> BoxFuture<'_, Result<Vec<JobId>, StoreError>> {
        self.write(move |connection| Box::pin(run::requeue(connection, lease, false, None)))
    }
    fn refuse(&self, lease: Lease, owner: String, problem: String) -> BoxFuture<'_, Result<Vec<JobId>, StoreError>> {
        let keep_ms = self.keep_ms();
        self.write(move |connection| {
            let (owner, problem) = (owner.clone(), problem.clone());
            Box::pin(async move { run::refuse(connection, lease, (&owner, &problem), keep_ms).await })
        })
    }
    fn cancel(&self, id: JobId) -> BoxFuture<'_, Result<Option<Cancelled>, StoreError>> {
        let keep_ms = self.keep_ms();
        self.write(move |connection| Box::pin(run::cancel(connection, id, keep_ms)))
    }
    fn redo(&self, id: JobId) -> BoxFuture<'_, Result<(), StoreError>> {
        self.write(move |connection| Box::pin(run::redo(connection, id)))
    }
    fn note_work(&self, work: Vec<(String, f64)>) -> BoxFuture<'_, Result<(), StoreError>> {
        self.write(move |connection| {
            let work = work.clone();
            Box::pin(async move { note_work(connection, &work).await })
        })
    }
    fn settle_callback(&self, due: DueCallback, tried: Tried) -> BoxFuture<'_, Result<bool, StoreError>> {
        self.write(move |connection| {
            let (due, tried) = (due.clone(), tried.clone());
            Box::pin(async move { settle(connection, &due, &tried).await })
        })
    }
    fn timings(&self, limit: u32) -> BoxFuture<'_, Result<Vec<Timing>, StoreError>> {
        Box::pin(async move { Ok(jobs::timings(&mut *self.reader().await?, limit).await?) })
    }
}
