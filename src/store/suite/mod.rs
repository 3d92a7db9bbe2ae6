//! The tests that every store has to pass, unchanged. A store comes with a [`Place`] and the line `suite!(Place);`.
#![allow(clippy::unwrap_used, clippy::panic)]

pub(in crate::store) mod callbacks;
pub(in crate::store) mod documents;
pub(in crate::store) mod jobs;
pub(in crate::store) mod processes;
pub(in crate::store) mod results;
pub(in crate::store) mod shards;

use std::time::Duration;

use crate::key::Key;
use crate::store::jobs::{Accepted, Claim, Claimed, JobId, JobRecord, Lease, NewJob, Next, Priority, Quota, Wanted};
use crate::store::sqlite::Keep;
use crate::store::{Cursor, KeptResult, ResultPage, ResultQuery, Store};

pub(in crate::store) const MOST: u32 = 3;
pub(in crate::store) const PROBLEM: &str = r#"{"kind":"deadline_exceeded"}"#;

/// A store of its own for one test, and what a test cannot ask of a store.
#[allow(async_fn_in_trait)] // nobody else implements it, and tests run on one thread
pub(in crate::store) trait Place: Sized {
    async fn with(keep: Keep) -> Self;
    fn store(&self) -> &dyn Store;
    /// As after the end of the process.
    async fn again_with(self, keep: Keep) -> Self;
    /// The jobs that wait, in their order.
    async fn line(&self) -> Vec<JobId>;
    /// From now on nobody has heard of any computation for long.
    async fn silence(&self);
    /// Everything that is on record happened so much earlier, ms.
    async fn later(&self, ms: i64);
    /// Changes the rows of kept results, and of shards that are done.
    async fn damage(&self);
    /// Takes the jobs of a key away, and leaves their shards.
    async fn abandon(&self, key: Key);
    /// The shards that are on record.
    async fn shards(&self) -> i64;

    async fn new() -> Self {
        Self::with(keep(Duration::from_hours(1))).await
    }

    async fn again(self) -> Self {
        self.again_with(keep(Duration::from_hours(1))).await
    }

    async fn accept(&self, job: NewJob) -> JobRecord {
        match self.store().submit(job, 100).await.unwrap() {
            Accepted::New(record) => record,
            other => panic!("{other:?}"),
        }
    }

    async fn record(&self, id: JobId) -> JobRecord {
        self.store().job(id).await.unwrap().unwrap()
    }

    async fn claim(&self, id: JobId) -> Claimed {
        self.store().claim(id, Lease::new(), MOST, PROBLEM.to_owned()).await.unwrap()
    }

    /// Takes the next job in line, or the next short one.
    async fn next(&self, short_ms: Option<f64>) -> Next {
        self.store().take(Wanted { lease: Lease::new(), short_ms, again: false }).await.unwrap()
    }

    async fn run(&self, id: JobId) -> Claim {
        match self.claim(id).await {
            Claimed::Run(claim) => *claim,
            other => panic!("{other:?}"),
        }
    }
}

pub(in crate::store) fn keep(jobs: Duration) -> Keep {
    Keep { bytes: 1 << 30, age: Duration::from_hours(1), jobs }
}

pub(in crate::store) fn key(number: u32) -> Key {
    Key::from_bytes(blake3::hash(&number.to_le_bytes()).as_bytes()).unwrap()
}

pub(in crate::store) fn job(number: u32) -> NewJob {
    NewJob {
        id: JobId::new(),
        calculator: "a".to_owned(),
        version: 1,
        key: key(number),
        input: format!("{{\"number\":{number}}}").into(),
        priority: Priority::Normal,
        owner: "one".to_owned(),
        idempotency: None,
        estimate_ms: 10.0,
        useful_for_ms: None,
        quota: Quota::default(),
        result: None,
        callback: None,
        traceparent: None,
        tracestate: None,
    }
}

pub(in crate::store) fn result(number: u32) -> KeptResult {
    KeptResult {
        key: key(number),
        calculator: "a".to_owned(),
        version: 1,
        engine: "0".to_owned(),
        input: "{}".into(),
        body: format!("{{\"answer\":{number}}}").into(),
        records: String::new(),
    }
}

pub(in crate::store) async fn list(
    store: &dyn Store,
    calculator: Option<&str>,
    limit: u32,
    after: Option<Cursor>,
) -> ResultPage {
    let query =
        ResultQuery { calculator: calculator.map(str::to_owned), limit: Some(limit), after, ..ResultQuery::default() };
    store.list(query).await.unwrap()
}

/// All of them for one store.
macro_rules! suite {
    ($place:ty) => {
        suite! { $place, jobs:
            a_job_goes_from_the_line_to_its_result
            who_has_lost_the_lease_cannot_write
            a_live_lease_is_left_alone
            what_a_process_left_running_is_in_line_again_at_the_next_start
            a_start_that_was_given_back_is_not_charged
            equal_jobs_are_taken_together_and_end_together
            a_job_whose_result_is_there_ends_where_it_begins
            a_name_is_one_job_for_its_owner
            a_full_queue_takes_no_more
            the_line_is_fair_between_owners_and_keeps_priorities
            a_long_job_lets_some_short_ones_pass_and_no_more
            the_next_short_job_is_the_first_of_them_in_line
            the_state_of_jobs_and_store_is_told_in_figures
            an_owner_gets_so_much_work_in_an_hour
            what_is_kept_for_an_owner_has_a_bound
            deadlines_end_what_is_late_and_nothing_else
            what_a_kept_job_points_to_stays_and_what_is_expired_goes
            what_some_jobs_need_is_read_at_once
            timings_are_kept_newest_first
            the_line_is_handed_out_in_order_and_each_job_once
            equal_jobs_are_handed_out_together
            what_was_charged_too_often_is_kept_for_who_runs_it_alone
            a_job_that_may_not_begin_fails_and_its_equals_wait_again
        }
        suite! { $place, shards:
            shards_are_claimed_and_end_as_jobs_and_go_with_their_parent
            one_shard_has_the_turn_of_its_parent_and_the_others_let_all_jobs_pass
            who_has_lost_a_shard_or_its_parent_cannot_write
            shards_are_in_no_list_and_no_quota
            shards_stay_as_long_as_an_equal_job_wants_them
            a_parent_that_gets_on_is_not_charged_for_it
            a_shard_is_over_only_with_the_results_of_its_points
        }
        suite! { $place, callbacks:
            a_callback_is_due_when_its_job_is_over_however_it_ends
            a_callback_is_one_process_at_a_time_and_over_once_it_is_settled
            who_has_died_loses_a_callback_and_nobody_takes_all_places
        }
        suite! { $place, documents:
            revisions_rise_and_are_never_given_twice
            kinds_and_shelves_are_apart
            several_are_kept_together_or_none_of_them
            documents_count_for_who_stores_them_until_they_are_deleted
        }
        suite! { $place, processes:
            what_is_told_of_an_entry_is_due_with_it_and_gone_with_the_process
            a_record_grows_without_a_gap_whoever_is_first
            parts_are_corrected_and_withdrawn_with_their_history
            a_process_counts_for_its_owner_until_it_is_deleted
            a_snapshot_counts_until_something_before_it_changes
        }
        suite! { $place, results:
            what_is_put_is_got_after_the_store_was_closed
            what_is_too_much_to_wait_is_not_kept_and_does_no_harm
            a_damaged_row_is_not_served_and_goes_away
            the_list_is_paged_newest_first_and_filtered
            results_are_found_by_the_records_of_their_jobs
            the_total_stays_below_the_limit_and_the_last_used_stay
            what_is_old_is_forgotten_at_the_next_start
            the_jobs_of_some_results_are_read_at_once
        }
    };
    ($place:ty, $part:ident: $($test:ident)+) => {
        $(
            #[tokio::test]
            async fn $test() {
                if <$place>::is_there() {
                    crate::store::suite::$part::$test::<$place>().await;
                }
            }
        )+
    };
}

pub(in crate::store) use suite;
