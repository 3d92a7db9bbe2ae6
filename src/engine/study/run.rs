//! The points of a study over the cores that are free, and put down as they are done.
//!
//! A shard is a run of points. Whoever has a core takes the next one; the thread that was given the study takes part,
//! and alone talks to the monitor. What a shard comes to does not depend on who computes it, so that the rows are the
//! same on one core and on many, and after any number of restarts.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use precut_calc::calculator::{Failure, Message, Monitor};

use super::figure;
use super::host::{Help, Host};
use super::plan::Plan;
use super::point::Shard;
use super::result::Row;
use crate::engine::exec::guarded;
use crate::key::Key;

/// A study whose cost is below is not worth a second core, nor putting down, ms.
const LARGE_MS: f64 = 200.0;
/// How often the picture so far is drawn.
const INTERIM: Duration = Duration::from_millis(500);
/// How often the thread that waits for the others looks whether it is still wanted.
const LOOK: Duration = Duration::from_millis(20);

/// How often what others have done is collected.
const COLLECT: Duration = Duration::from_millis(200);
/// How often there is a look for parts that were left behind by others.
const RETAKE: Duration = Duration::from_secs(1);
/// Pause where it cannot be said which part is next.
const PAUSE: Duration = Duration::from_millis(200);
/// Parts asked for at once.
const COLLECTED_AT_ONCE: usize = 512;

/// What everyone who works on a study has in common.
struct Work {
    plan: Arc<Plan>,
    host: Arc<dyn Host>,
    key: Key,
    /// Whether other processes take parts, too.
    shared: bool,
    next: AtomicUsize,
    points_done: AtomicUsize,
    stop: AtomicBool,
    crashed: AtomicBool,
    done: Mutex<Done>,
    changed: Condvar,
    /// Parts that are done and in our hands, but could not be put down. That is tried again when another one was put
    /// down or none is left to be taken; who gave them back at once would only be given them again.
    owed: Mutex<Vec<usize>>,
}

struct Done {
    shards: Vec<Option<Shard>>,
    missing: usize,
}

impl Work {
    fn done(&self) -> MutexGuard<'_, Done> {
        self.done.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn owed(&self) -> MutexGuard<'_, Vec<usize>> {
        self.owed.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn is_large(&self) -> bool {
        self.plan.cost.ms >= LARGE_MS
    }

    fn add(&self, index: usize, shard: Shard) {
        let mut done = self.done();
        // None is left where the study has been put together meanwhile.
        if done.shards.get_mut(index).is_some_and(|place| place.replace(shard).is_none()) {
            done.missing -= 1;
        }
        drop(done);
        self.changed.notify_all();
    }

    fn new(plan: &Arc<Plan>, host: &Arc<dyn Host>, key: Key) -> Self {
        let shards = plan.shards();
        Self {
            plan: Arc::clone(plan),
            host: Arc::clone(host),
            key,
            shared: plan.cost.ms >= LARGE_MS && shards > 1 && host.is_shared(),
            next: AtomicUsize::new(0),
            points_done: AtomicUsize::new(0),
            stop: AtomicBool::new(false),
            crashed: AtomicBool::new(false),
            done: Mutex::new(Done { shards: vec![None; shards], missing: shards }),
            changed: Condvar::new(),
            owed: Mutex::default(),
        }
    }

    fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// The next shard for whoever asks; `None` if none is left or nobody wants the study any more.
    fn next(&self, monitor: &dyn Monitor) -> Option<Held<'_>> {
        loop {
            if self.is_stopped() || monitor.cancelled() {
                return None;
            }
            let index = if self.shared {
                if self.done().missing == 0 {
                    return None;
                }
                let Ok(index) = self.host.take(&self.key, self.plan.shards()) else {
                    std::thread::sleep(PAUSE);
                    continue;
                };
                if index.is_none() {
                    self.pay();
                }
                index?
            } else {
                self.next.fetch_add(1, Ordering::Relaxed)
            };
            if index >= self.plan.shards() {
                return None;
            }
            if self.done().shards.get(index).is_some_and(Option::is_none) {
                return Some(Held { work: self, index, is_done: !self.shared });
            }
            if self.shared {
                // Somebody else had it meanwhile and has given it up.
                self.owed().push(index);
            }
        }
    }

    /// Puts a shard down; whether it is.
    fn put(&self, index: usize, shard: &Shard) -> bool {
        serde_json::to_vec(shard).is_ok_and(|content| self.host.put(&self.key, index, content.into()))
    }

    /// Puts down what could not be put down before, as far as that goes.
    fn pay(&self) {
        let mut owed = std::mem::take(&mut *self.owed());
        while let Some(index) = owed.pop() {
            let shard = self.done().shards.get(index).cloned().flatten();
            if !shard.is_some_and(|shard| self.put(index, &shard)) {
                owed.push(index);
                break;
            }
        }
        self.owed().append(&mut owed);
    }

    /// Computes shards until none is left, or until `go_on` says no; that is asked after each shard, and `told` is
    /// called after each point. Whether none is left.
    fn share(&self, monitor: &dyn Monitor, go_on: &mut dyn FnMut() -> bool, mut told: impl FnMut()) -> bool {
        loop {
            let Some(mut held) = self.next(monitor) else { return !self.is_stopped() };
            let index = held.index;
            let computed = Shard::compute(&self.plan, self.plan.shard(index), &*self.host, monitor, || {
                self.points_done.fetch_add(1, Ordering::Relaxed);
                told();
            });
            let Some(shard) = computed else {
                self.stop.store(true, Ordering::Relaxed);
                self.changed.notify_all();
                return false;
            };
            // Before it counts: with the last one the study is put together, and its parts are forgotten.
            let is_down = self.is_large() && self.put(index, &shard);
            held.is_done = true;
            drop(held);
            self.add(index, shard);
            if is_down {
                self.pay();
            } else if self.is_large() {
                self.owed().push(index);
            }
            if !go_on() {
                return false;
            }
        }
    }

    /// How many shards nobody has begun, about.
    fn left(&self) -> usize {
        if self.shared {
            return self.done().missing;
        }
        self.plan.shards().saturating_sub(self.next.load(Ordering::Relaxed))
    }

    /// What a helper does. A panic here would end the process, and a shard that nobody ends would never be waited for
    /// to the end.
    fn help(&self, go_on: &mut dyn FnMut() -> bool) {
        let outcome = guarded(|| {
            self.share(&Helper(self), go_on, || {});
            Ok(())
        });
        if outcome.is_err() {
            self.crashed.store(true, Ordering::Relaxed);
            self.stop.store(true, Ordering::Relaxed);
            self.changed.notify_all();
        }
    }

    /// Takes up what was put down before. What does not fit is computed again.
    fn resume(&self) {
        self.take_up(self.host.put_down(&self.key));
    }

    /// Takes up what others have done meanwhile.
    fn collect(&self) {
        if !self.shared {
            return;
        }
        let missing: Vec<usize> = {
            let done = self.done();
            let missing = done.shards.iter().enumerate().filter(|(_, shard)| shard.is_none());
            missing.map(|(index, _)| index).take(COLLECTED_AT_ONCE).collect()
        };
        if !missing.is_empty() {
            self.take_up(self.host.collect(&self.key, missing));
        }
    }

    fn take_up(&self, shards: Vec<(usize, bytes::Bytes)>) {
        for (index, content) in shards {
            if index >= self.plan.shards() || self.done().shards[index].is_some() {
                continue;
            }
            let points = self.plan.shard(index);
            if let Ok(shard) = serde_json::from_slice::<Shard>(&content)
                && shard.rows.len() == points.len()
                && shard.rows.iter().zip(points.clone()).all(|(row, point)| row.values == self.plan.settings(point))
            {
                self.points_done.fetch_add(points.len(), Ordering::Relaxed);
                self.add(index, shard);
            }
        }
    }

    fn progress(&self, monitor: &dyn Monitor) {
        // A part that two have computed counts once.
        let of = self.plan.points;
        let done = self.points_done.load(Ordering::Relaxed).min(of);
        let stage = Message::new("study_point").with("done", done).with("of", of);
        monitor.progress(done as f64 / of as f64, stage);
    }

    fn interim(&self, monitor: &dyn Monitor) {
        let done = self.done();
        let rows: Vec<Option<&Row>> = (0..self.plan.points)
            .map(|point| {
                let shard = done.shards[point / self.plan.shard_points].as_ref()?;
                shard.rows.get(point % self.plan.shard_points)
            })
            .collect();
        let figure = figure::of_plan(&self.plan, &rows);
        drop(done);
        if let Some(figure) = figure {
            monitor.interim(figure);
        }
    }
}

impl Drop for Work {
    fn drop(&mut self) {
        let owed = std::mem::take(&mut *self.owed());
        for index in owed {
            self.host.give_back(&self.key, index);
        }
    }
}

/// A shard in somebody's hands, until it is done or given back.
struct Held<'w> {
    work: &'w Work,
    index: usize,
    is_done: bool,
}

impl Drop for Held<'_> {
    fn drop(&mut self) {
        if !self.is_done {
            self.work.host.give_back(&self.work.key, self.index);
        }
    }
}

/// Everyone but the first only needs to know whether to go on.
struct Helper<'w>(&'w Work);

impl Monitor for Helper<'_> {
    fn cancelled(&self) -> bool {
        self.0.stop.load(Ordering::Relaxed)
    }
    fn progress(&self, _fraction: f64, _stage: Message) {}
}

/// Computes the shards of a study.
pub(crate) fn run(
    plan: &Arc<Plan>,
    host: &Arc<dyn Host>,
    key: Key,
    monitor: &dyn Monitor,
) -> Result<Vec<Shard>, Failure> {
    let work = Arc::new(Work::new(plan, host, key));
    let helped = Arc::clone(&work);
    let help: Arc<Help> = Arc::new(move |go_on: &mut dyn FnMut() -> bool| helped.help(go_on));
    let mut hire = || {
        if work.is_large() {
            host.help(work.left().saturating_sub(1), &help);
        }
        work.collect();
        true
    };
    if work.is_large() {
        work.resume();
        if work.shared {
            host.call(&key, work.left().saturating_sub(1));
        }
        hire();
    }
    let mut drawn = Instant::now();
    let mut tell = || {
        work.progress(monitor);
        if drawn.elapsed() >= INTERIM {
            work.interim(monitor);
            drawn = Instant::now();
        }
    };
    work.share(monitor, &mut hire, &mut tell);
    let (mut collected, mut retaken) = (Instant::now(), Instant::now());
    let mut done = work.done();
    while done.missing > 0 && !work.is_stopped() {
        (done, _) = work.changed.wait_timeout(done, LOOK).unwrap_or_else(PoisonError::into_inner);
        drop(done);
        if monitor.cancelled() {
            work.stop.store(true, Ordering::Relaxed);
        }
        if collected.elapsed() >= COLLECT {
            work.collect();
            collected = Instant::now();
        }
        if work.shared && retaken.elapsed() >= RETAKE {
            // What somebody who died had in his hands.
            work.share(monitor, &mut hire, &mut tell);
            retaken = Instant::now();
        }
        tell();
        done = work.done();
    }
    let shards = std::mem::take(&mut done.shards);
    drop(done);
    if work.crashed.load(Ordering::Relaxed) {
        return Err(Failure::Internal("a part of a study crashed".to_owned()));
    }
    let all: Option<Vec<Shard>> = shards.into_iter().collect();
    let all = all.ok_or(Failure::Cancelled)?;
    if work.is_large() {
        host.forget(&key);
    }
    Ok(all)
}

/// Computes shards of a study that another process runs and puts together, as long as `go_on` says so; whether some may
/// be left.
pub(crate) fn help(
    plan: &Arc<Plan>,
    host: &Arc<dyn Host>,
    key: Key,
    monitor: &dyn Monitor,
    go_on: &mut dyn FnMut() -> bool,
) -> bool {
    let work = Work::new(plan, host, key);
    work.shared && !work.share(monitor, go_on, || {})
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use bytes::Bytes;
    use precut_calc::calculator::Unwatched;
    use serde_json::json;

    use super::*;
    use crate::engine::answer::Stored;
    use crate::engine::error::Error;
    use crate::engine::memory::Kept;
    use crate::engine::read::Ready;
    use crate::engine::study::Alone;
    use crate::registry::toy;

    const PARTS: usize = 3;

    /// A store that several processes share, as one of them sees it.
    #[derive(Default)]
    struct Book {
        free: BTreeSet<usize>,
        down: BTreeMap<usize, Bytes>,
        given_back: Vec<usize>,
        taken: usize,
        /// So many parts more are not taken down.
        refused: usize,
        /// What is said to be down counts for nothing, as somebody else has the part; he gives it up at once.
        lost: Option<usize>,
        /// A part in another's hands, who puts it down when that other one is down.
        elsewhere: Option<(usize, Bytes, usize)>,
    }

    struct Shared(Mutex<Book>);

    impl Shared {
        fn with(book: Book) -> Arc<Self> {
            let busy = book.elsewhere.as_ref().map(|(part, ..)| *part);
            let free = (0..PARTS).filter(|part| Some(*part) != busy).collect();
            Arc::new(Self(Mutex::new(Book { free, ..book })))
        }

        fn book(&self) -> MutexGuard<'_, Book> {
            self.0.lock().unwrap()
        }

        /// Runs a study of three parts in it, each a point.
        fn run(self: &Arc<Self>) -> Vec<Shard> {
            let host: Arc<dyn Host> = Arc::<Self>::clone(self);
            run(&plan(), &host, Key::from_bytes(&[7; 32]).unwrap(), &Unwatched).unwrap()
        }
    }

    impl Host for Shared {
        fn kept(&self, _key: &Key) -> Option<Kept> {
            None
        }
        fn keep(&self, ready: &Ready, outcome: Result<Stored, Error>, took: Duration) -> Result<Arc<Stored>, Error> {
            Alone.keep(ready, outcome, took)
        }
        fn help(&self, _most: usize, _work: &Arc<Help>) {}
        fn put_down(&self, _study: &Key) -> Vec<(usize, Bytes)> {
            Vec::new()
        }
        fn put(&self, _study: &Key, shard: usize, content: Bytes) -> bool {
            let mut book = self.book();
            if book.lost == Some(shard) {
                book.lost = None;
                book.free.insert(shard);
                return true;
            }
            if book.refused > 0 {
                book.refused -= 1;
                return false;
            }
            book.down.insert(shard, content);
            true
        }
        fn is_shared(&self) -> bool {
            true
        }
        fn take(&self, _study: &Key, _of: usize) -> Result<Option<usize>, ()> {
            let mut book = self.book();
            book.taken += 1;
            Ok(book.free.pop_first())
        }
        fn give_back(&self, _study: &Key, shard: usize) {
            let mut book = self.book();
            book.given_back.push(shard);
            book.free.insert(shard);
        }
        fn collect(&self, _study: &Key, wanted: Vec<usize>) -> Vec<(usize, Bytes)> {
            let book = self.book();
            let put =
                book.elsewhere.iter().filter(|(part, _, after)| wanted.contains(part) && book.down.contains_key(after));
            put.map(|(part, content, _)| (*part, content.clone())).collect()
        }
        fn forget(&self, _study: &Key) {}
    }

    fn plan() -> Arc<Plan> {
        let study = json!({
            "calculator": "toy-bar",
            "job": {"segments": [{"diameter_mm": 20}], "work_ms": 300},
            "vary": [{"pointer": "/length_mm", "values": [100, 200, 300]}],
        });
        let plan = Plan::new(&toy::registry(), 100, serde_json::from_value(study).unwrap()).unwrap();
        assert_eq!(plan.shards(), PARTS);
        Arc::new(plan)
    }

    fn computed(index: usize) -> Shard {
        let plan = plan();
        Shard::compute(&plan, plan.shard(index), &Alone, &Unwatched, || {}).unwrap()
    }

    #[test]
    fn parts_that_could_not_be_put_down_are_put_down_with_the_next() {
        let shared = Shared::with(Book { refused: 2, ..Book::default() });
        assert_eq!(shared.run(), (0..PARTS).map(computed).collect::<Vec<_>>());
        let book = shared.book();
        assert_eq!((book.down.len(), book.taken, book.given_back.len()), (PARTS, PARTS, 0));
    }

    #[test]
    fn a_study_that_is_complete_ends_though_nothing_can_be_put_down() {
        let shared = Shared::with(Book { refused: usize::MAX, ..Book::default() });
        assert_eq!(shared.run().len(), PARTS);
        let mut book = shared.book();
        book.given_back.sort_unstable();
        assert_eq!((book.down.len(), book.taken, book.given_back.as_slice()), (0, PARTS, &[0, 1, 2][..]));
    }

    #[test]
    fn a_part_that_comes_back_when_it_is_done_is_put_down_again_without_haste() {
        let elsewhere = (2, serde_json::to_vec(&computed(2)).unwrap().into(), 0);
        let shared = Shared::with(Book { lost: Some(0), elsewhere: Some(elsewhere), ..Book::default() });
        assert_eq!(shared.run(), (0..PARTS).map(computed).collect::<Vec<_>>());
        assert!(shared.book().taken < 10, "{} asked for", shared.book().taken);
        // The same where that fails at first: it is tried once a second.
        let elsewhere = (2, serde_json::to_vec(&computed(2)).unwrap().into(), 0);
        let shared = Shared::with(Book { lost: Some(0), elsewhere: Some(elsewhere), ..Book::default() });
        shared.book().refused = 2;
        let begun = Instant::now();
        assert_eq!(shared.run(), (0..PARTS).map(computed).collect::<Vec<_>>());
        assert!(begun.elapsed() >= RETAKE && shared.book().taken < 10, "{} asked for", shared.book().taken);
    }
}
