//! What every store has to do with the shards of large jobs.

use super::{Place, job, key, result};
use crate::store::jobs::{
    Beat, Claim, Claimed, Ending, JobQuery, JobState, Lease, MOST_ATTEMPTS, NewJob, Next, Priority, Shard, ShardId,
};

/// A job that runs, with so many shards in line.
async fn parent<P: Place>(place: &P, number: u32, shards: u32) -> Claim {
    let id = place.accept(job(number)).await.id;
    let claim = place.run(id).await;
    add(place, claim.lease, &(0..shards).collect::<Vec<_>>()).await;
    claim
}

async fn add<P: Place>(place: &P, lease: Lease, numbers: &[u32]) {
    assert!(place.store().add_shards(lease, numbers.to_vec()).await.unwrap());
}

async fn next<P: Place>(place: &P) -> Claim {
    match place.next(None).await {
        Next::Run(claim) => *claim,
        other => panic!("{other:?}"),
    }
}

async fn over<P: Place>(place: &P, of: u32, numbers: &[u32]) -> Vec<Shard> {
    let mut over = place.store().shards(key(of), numbers.to_vec()).await.unwrap();
    over.sort_by_key(|shard| shard.number);
    over
}

fn done(number: u32, content: &'static str) -> Shard {
    Shard { number, outcome: Ok(content.into()) }
}

fn shard(parent: u32, number: u32) -> ShardId {
    ShardId { parent: key(parent), number }
}

pub(in crate::store) async fn shards_are_claimed_and_end_as_jobs_and_go_with_their_parent<P: Place>() {
    let place = P::new().await;
    let parent = parent(&place, 1, 3).await;
    assert_eq!((parent.shard, parent.key), (None, key(1)));
    assert_eq!(place.store().input_of(key(1)).await.unwrap(), Some("{\"number\":1}".into()));
    // The same again changes nothing.
    add(&place, parent.lease, &[0, 1, 2]).await;
    assert_eq!(place.shards().await, 3);
    let (first, second) = (next(&place).await, next(&place).await);
    assert_eq!((first.shard, second.shard), (Some(shard(1, 0)), Some(shard(1, 1))), "in their order");
    assert_eq!((first.attempt, first.input.len()), (1, 0));
    let ended = place.store().finish(first.lease, Ending::Shard("zero".into())).await.unwrap();
    assert_eq!(ended, [shard(1, 0).job()]);
    place.store().finish(second.lease, Ending::Failed("{\"why\":1}".to_owned())).await.unwrap();
    let failed = Shard { number: 1, outcome: Err("{\"why\":1}".to_owned()) };
    assert_eq!(over(&place, 1, &[0, 1, 2, 3]).await, [done(0, "zero"), failed]);
    assert_eq!(over(&place, 1, &[2]).await, []);
    // What its process leaves is in line again, and what is done stays; none of it is taken until the parent runs again.
    next(&place).await;
    let place = place.again().await;
    assert_eq!(over(&place, 1, &[0]).await, [done(0, "zero")]);
    let again = next(&place).await;
    assert_eq!((again.shard, again.key, again.attempt), (None, key(1), 2));
    let third = next(&place).await;
    assert_eq!((third.shard, third.attempt), (Some(shard(1, 2)), 2));
    // One that is damaged came to nothing; asked for again it begins anew.
    place.damage().await;
    assert_eq!(over(&place, 1, &[0]).await, [done(0, "")]);
    add(&place, again.lease, &[0]).await;
    assert_eq!(over(&place, 1, &[0]).await, []);
    assert_eq!(next(&place).await.shard, Some(shard(1, 0)));
    place.store().finish(again.lease, Ending::Succeeded(result(1))).await.unwrap();
    assert_eq!(place.shards().await, 0);
    assert_eq!(place.store().finish(third.lease, Ending::Shard("late".into())).await.unwrap(), []);
    assert_eq!(place.shards().await, 0);
    assert_eq!(place.store().input_of(key(1)).await.unwrap(), None);
}

pub(in crate::store) async fn one_shard_has_the_turn_of_its_parent_and_the_others_let_all_jobs_pass<P: Place>() {
    let place = P::new().await;
    let parent = parent(&place, 1, 3).await;
    let low = place.accept(NewJob { priority: Priority::Low, ..job(9) }).await.id;
    let jobs = [place.accept(job(2)).await.id, place.accept(NewJob { owner: "two".to_owned(), ..job(3) }).await.id];
    let turn = next(&place).await;
    assert_eq!(turn.shard, Some(shard(1, 0)));
    // With that one the parent has its place: the others wait.
    let other = next(&place).await;
    assert!(jobs.contains(&other.jobs[0]), "{other:?}");
    place.store().finish(turn.lease, Ending::Shard("0".into())).await.unwrap();
    let turn = next(&place).await;
    assert_eq!(turn.shard, Some(shard(1, 1)), "the place is the parent's as long as it runs");
    // One that is given back keeps it.
    place.store().release(turn.lease).await.unwrap();
    assert_eq!(next(&place).await.shard, Some(shard(1, 1)));
    assert!(jobs.contains(&next(&place).await.jobs[0]));
    // Places that nobody else of the priority wants are for the rest.
    assert_eq!(next(&place).await.shard, Some(shard(1, 2)));
    assert_eq!(next(&place).await.jobs, [low]);
    // A job that comes now stands where it would without them, and a short place is not for them.
    add(&place, parent.lease, &[3, 4]).await;
    assert!(!place.store().waits(Some(1e6)).await.unwrap());
    let short = place.accept(job(4)).await.id;
    let Next::Run(claim) = place.next(Some(1e6)).await else { panic!("it is short") };
    assert_eq!(claim.jobs, [short]);
    let late = place.accept(job(5)).await.id;
    assert_eq!(next(&place).await.jobs, [late], "one of the shards that are computed has the turn");
    assert_eq!((next(&place).await.shard, next(&place).await.shard), (Some(shard(1, 3)), Some(shard(1, 4))));
    assert!(matches!(place.next(None).await, Next::Nothing));
}

pub(in crate::store) async fn who_has_lost_a_shard_or_its_parent_cannot_write<P: Place>() {
    let place = P::new().await;
    let parent = parent(&place, 1, 1).await;
    let first = next(&place).await;
    place.silence().await;
    place.store().sweep(std::sync::Arc::new(Vec::new)).await.unwrap();
    // Nor can the one who ran the parent, which waits, and its shards with it.
    assert!(!place.store().add_shards(parent.lease, vec![1]).await.unwrap());
    let again = next(&place).await;
    assert_eq!((again.shard, &again.jobs), (None, &parent.jobs));
    let second = next(&place).await;
    assert_eq!((second.shard, second.attempt), (first.shard, 2));
    assert_eq!(place.store().finish(first.lease, Ending::Shard("late".into())).await.unwrap(), []);
    assert_eq!(over(&place, 1, &[0]).await, []);
    place.store().finish(second.lease, Ending::Shard("sound".into())).await.unwrap();
    assert_eq!(over(&place, 1, &[0]).await, [done(0, "sound")]);
    // A cancel takes the shards along: who computes one is told with his next word.
    add(&place, again.lease, &[1, 2]).await;
    let third = next(&place).await;
    place.store().cancel(parent.jobs[0]).await.unwrap().unwrap();
    assert_eq!(place.shards().await, 0);
    assert!(matches!(place.next(None).await, Next::Nothing));
    let beat = Beat { lease: third.lease, progress: 0.5, stage: None };
    assert_eq!(place.store().beat(vec![beat]).await.unwrap(), [third.lease]);
}

pub(in crate::store) async fn shards_are_in_no_list_and_no_quota<P: Place>() {
    let place = P::new().await;
    let before = place.accept(job(1)).await;
    let alone = place.run(before.id).await;
    let usage = place.store().usage("one".to_owned()).await.unwrap();
    add(&place, alone.lease, &[0, 1, 2]).await;
    let claim = next(&place).await;
    place.store().finish(claim.lease, Ending::Shard("zero".into())).await.unwrap();
    let running = next(&place).await;
    let listed = async |query: JobQuery| {
        let page = place.store().jobs(JobQuery { limit: 10, ..query }).await.unwrap();
        page.items.iter().map(|job| job.id).collect::<Vec<_>>()
    };
    assert_eq!(listed(JobQuery::default()).await, [before.id]);
    assert_eq!(listed(JobQuery { calculator: Some("a".to_owned()), ..JobQuery::default() }).await, [before.id]);
    assert_eq!(listed(JobQuery { state: Some(JobState::Running), ..JobQuery::default() }).await, [before.id]);
    assert_eq!(listed(JobQuery { state: Some(JobState::Queued), ..JobQuery::default() }).await, []);
    let [shard] = running.jobs[..] else { panic!("one") };
    assert_eq!(place.store().job(shard).await.unwrap(), None);
    assert_eq!(place.store().cancel(shard).await.unwrap(), None);
    let counts = place.store().counts().await.unwrap();
    assert_eq!((counts.queued, counts.running, counts.oldest_ms), (0, 1, None));
    let now = place.store().usage("one".to_owned()).await.unwrap();
    assert_eq!((now.kept_bytes(), now.open_ms), (usage.kept_bytes(), usage.open_ms));
    assert!(now.done.is_empty(), "{now:?}");
    // Nor do they fill the line.
    assert!(matches!(place.store().submit(job(2), 1).await.unwrap(), crate::store::jobs::Accepted::New(_)));
}

pub(in crate::store) async fn shards_stay_as_long_as_an_equal_job_wants_them<P: Place>() {
    let place = P::new().await;
    let parent = parent(&place, 1, 2).await;
    let joined = place.accept(job(1)).await;
    assert_eq!(joined.state, JobState::Running);
    place.store().cancel(parent.jobs[0]).await.unwrap().unwrap();
    assert_eq!(place.shards().await, 2);
    assert_eq!(next(&place).await.shard, Some(shard(1, 0)));
    place.store().forget_expired().await.unwrap();
    assert_eq!(place.shards().await, 2);
    place.store().cancel(joined.id).await.unwrap().unwrap();
    assert_eq!(place.shards().await, 0);
    // Who wrote one just then has left it: it is taken by nobody, and forgotten.
    let again = place.accept(job(1)).await.id;
    let again = place.run(again).await;
    add(&place, again.lease, &[0, 1]).await;
    place.abandon(key(1)).await;
    assert_eq!((place.shards().await, place.store().waits(None).await.unwrap()), (2, false));
    place.store().forget_expired().await.unwrap();
    assert_eq!(place.shards().await, 0);
}

pub(in crate::store) async fn a_parent_that_gets_on_is_not_charged_for_it<P: Place>() {
    let mut place = P::new().await;
    let id = place.accept(job(1)).await.id;
    for round in 0..5 {
        let claim = place.run(id).await;
        assert!(claim.attempt <= MOST_ATTEMPTS, "{claim:?}");
        add(&place, claim.lease, &[round]).await;
        let shard = next(&place).await;
        place.store().finish(shard.lease, Ending::Shard("done".into())).await.unwrap();
        place = place.again().await;
    }
    // Once it gets on no more, it is given up.
    place.run(id).await;
    let place = place.again().await;
    assert!(matches!(place.claim(id).await, Claimed::Poisonous(_)));
    assert_eq!(place.shards().await, 0);
}

pub(in crate::store) async fn a_shard_is_over_only_with_the_results_of_its_points<P: Place>() {
    let place = P::new().await;
    parent(&place, 1, 1).await;
    let claim = next(&place).await;
    place.store().put(result(7));
    place.store().finish(claim.lease, Ending::Shard("done".into())).await.unwrap();
    let place = place.again().await;
    assert_eq!(place.store().get(key(7)).await.unwrap(), Some(result(7)));
}
