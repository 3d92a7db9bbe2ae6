//! What may be asked of an engine about jobs.

use std::sync::Arc;
use std::time::Duration;

use super::{Ask, Feed, Job, Request};
use crate::engine::memory::{Kept, fingerprint_with};
use crate::engine::{Body, CacheState, Engine, Error, Known, Solved, Stored, Timings, hit};
use crate::store::jobs::{DueCallback, JobId, JobQuery, JobRecord, JobState, Subject, TakeUp, Tried};

/// What came of a request.
#[derive(Debug, Clone)]
pub enum Answered {
    /// Its answer.
    Solved(Box<Solved>),
    /// A job that is not over yet.
    Job(Box<Job>),
}

impl Engine {
    /// The answer to a job, or the job itself where it takes long, where the client wants to be told at once that it
    /// will be done, and wherever it has to be done whatever happens.
    pub async fn submit(&self, calculator: &str, body: Body, ask: Ask) -> Result<Answered, Error> {
        let inner = &self.inner;
        // Who is told belongs to what was asked.
        let told = ask.callback.as_ref().map(|callback| callback.url.as_str());
        let body_hash = ask.idempotency_key.as_ref().map(|_| fingerprint_with(calculator, &body, told));
        // Such a request has a record, whatever is known of its answer: what was promised outlives the process.
        let is_on_record = body_hash.is_some() || told.is_some();
        let (ready, parse, kept) = match self.know(calculator, &body, &ask.shelf).await? {
            Known::Kept(kept, parse) if !is_on_record => return Ok(solved(hit(kept, parse)?)),
            // It has a record, too, by which it is known again.
            Known::Kept(kept, parse) => {
                (Box::new(inner.read(&inner.known(calculator)?, body, &ask.shelf).await?), parse, Some(kept))
            }
            Known::New(ready, parse) => (ready, parse, None),
        };
        inner.afford(ready.prepared.cost)?;
        let meta = ready.entry.meta();
        // What was learned of a calculator holds for a study of it, too.
        let numbers_of = ready.prepared.numbers_of.as_ref().unwrap_or(meta);
        let estimate_ms = inner.jobs.estimates.corrected(numbers_of.id, numbers_of.version, ready.prepared.cost.ms);
        if kept.is_none() {
            inner.afford_at_all(&ready.prepared.cost, estimate_ms)?;
        }
        let is_short = estimate_ms <= inner.settings.direct_limit.as_secs_f64() * 1e3;
        if is_short && ask.wait.is_none() && !is_on_record {
            inner.charge(&ask.owner, estimate_ms).await?;
            let answer = self.solve_directly(*ready, parse);
            let outcome = match ask.deadline {
                None => answer.await,
                Some(deadline) => tokio::time::timeout(deadline, answer).await.unwrap_or(Err(Error::DeadlineExceeded)),
            };
            return outcome.map(solved);
        }
        let result = match kept {
            Some(Kept::Answer(stored)) => Some(stored),
            _ => None,
        };
        let request = Request {
            calculator: meta.id,
            version: meta.version,
            key: ready.key,
            input: ready.canonical.clone(),
            estimate_ms,
            body_hash: body_hash.unwrap_or_default(),
            result,
        };
        let was_there = request.result.is_some();
        inner.unwritten.write(&*inner.jobs.store).await?;
        let (record, is_new) = inner.jobs.accept(inner, request, &ask).await?;
        // A short job with a name of its own is answered as others are, if it gets its turn soon.
        let short_wait = if is_short { inner.settings.direct_limit + inner.settings.patience } else { Duration::ZERO };
        let job = inner.jobs.wait(record, ask.wait.unwrap_or(short_wait)).await?;
        if !job.record.state.is_final() {
            return Ok(Answered::Job(Box::new(job)));
        }
        let run = job.record.started_ms.zip(job.record.finished_ms).map_or(0, |(start, end)| (end - start).max(0));
        let timings = Timings { parse, run: Duration::from_millis(run.unsigned_abs()), ..Timings::default() };
        let cache = if is_new && !was_there { CacheState::Miss } else { CacheState::Hit };
        Ok(solved(Solved { stored: self.result_of(job).await?, cache, timings }))
    }

    /// A job as it is now.
    pub async fn job(&self, id: JobId) -> Result<Job, Error> {
        self.inner.jobs.job(id).await
    }

    /// The jobs, newest first, and where the next page begins.
    pub async fn jobs(&self, query: JobQuery) -> Result<(Vec<Job>, Option<JobId>), Error> {
        self.inner.jobs.list(query).await
    }

    /// Cancels a job; with its state before.
    pub async fn cancel(&self, id: JobId) -> Result<(Job, JobState), Error> {
        self.inner.jobs.cancel(id).await
    }

    /// News of a job. To be asked for before looking at the job.
    pub fn feed(&self, id: JobId) -> Feed {
        self.inner.jobs.feed(id)
    }

    /// What a job computes: the filled job, as JSON. Its calculator stands in the record.
    pub(crate) async fn job_input(&self, id: JobId) -> Result<(JobRecord, Vec<u8>), Error> {
        let record = self.inner.jobs.job(id).await?.record;
        let mut found = self.inner.jobs.store.job_inputs(vec![id], usize::MAX).await?;
        let (_, packed) = found.pop().ok_or(Error::JobExpired)?;
        let unreadable = |error: std::io::Error| Error::internal(format!("the input of job {id}: {error}"));
        // A large job takes milliseconds to unpack.
        let read = tokio::task::spawn_blocking(move || zstd::decode_all(&*packed));
        let input = read.await.map_err(|error| Error::internal(error.to_string()))?.map_err(unreadable)?;
        Ok((record, input))
    }

    /// What a job came to.
    pub async fn job_result(&self, id: JobId) -> Result<Arc<Stored>, Error> {
        let job = self.inner.jobs.job(id).await?;
        self.result_of(job).await
    }

    async fn result_of(&self, job: Job) -> Result<Arc<Stored>, Error> {
        let state = job.record.state;
        let not_finished = |retry_after| Error::JobNotFinished { state, retry_after };
        if job.is_expired(self.now_ms()) {
            return Err(Error::JobExpired);
        }
        match state {
            JobState::Queued | JobState::Running => Err(not_finished(job.retry_after())),
            JobState::Cancelled => Err(Error::JobCancelled),
            JobState::Failed => {
                Err(job.problem.unwrap_or_else(|| Error::internal("a job failed without a reason".to_owned())))
            }
            JobState::Succeeded => {
                if let Some(stored) = self.result(&job.record.key).await? {
                    return Ok(stored);
                }
                // The row was damaged. The job is known: it is computed again.
                tracing::warn!(job = %job.record.id, "the result of a job is gone; it is computed again");
                self.inner.jobs.store.redo(job.record.id).await?;
                self.inner.jobs.call();
                Err(Error::JobNotFinished { state: JobState::Queued, retry_after: job.retry_after() })
            }
        }
    }

    /// Waits until a job has ended here, at most so long: then somebody may have to be told.
    pub(crate) async fn ended(&self, most: Duration) {
        let _ = tokio::time::timeout(most, self.inner.jobs.ended.notified()).await;
    }

    /// Takes up callbacks that are due.
    pub(crate) async fn take_up_callbacks(&self, wanted: TakeUp) -> Result<Vec<DueCallback>, Error> {
        Ok(self.inner.jobs.store.take_up_callbacks(wanted).await?)
    }

    /// Writes what came of a try of a callback.
    pub(crate) async fn settle_callback(&self, due: DueCallback, tried: Tried) -> Result<(), Error> {
        let subject = due.subject.clone();
        if self.inner.jobs.store.settle_callback(due, tried).await?
            && let Subject::Job(job) = subject
        {
            self.inner.jobs.feeds.touch(&[job]);
        }
        Ok(())
    }

    /// From now on no job is taken up, and those that run go back in line; the rest goes on.
    pub fn stop_jobs(&self) {
        self.inner.jobs.stop();
    }

    /// A job that was read before, with what is known in memory by now.
    pub fn refreshed(&self, record: JobRecord) -> Job {
        self.inner.jobs.now(record)
    }

    /// Whether jobs may be run by other processes.
    pub fn is_shared(&self) -> bool {
        self.inner.jobs.store.is_shared()
    }

    /// The time by which jobs live, ms UTC.
    pub fn now_ms(&self) -> i64 {
        self.inner.jobs.store.now_ms()
    }

    /// Waits until [`Engine::stop_jobs`].
    pub async fn stopped(&self) {
        self.inner.jobs.stopped().await;
    }
}

fn solved(solved: Solved) -> Answered {
    Answered::Solved(Box::new(solved))
}
