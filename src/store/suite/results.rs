//! What every store has to do with results.

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use super::{Place, keep, list};
use crate::key::Key;
use crate::store::sqlite::Keep;
use crate::store::{KeptResult, ResultPage, ResultQuery};

fn result(number: u32, calculator: &str) -> KeptResult {
    let body: Vec<u8> =
        (0..4000_u32).flat_map(|i| i.wrapping_mul(number).wrapping_mul(2_654_435_761).to_le_bytes()).collect();
    KeptResult {
        key: Key::from_bytes(blake3::hash(&number.to_le_bytes()).as_bytes()).unwrap(),
        calculator: calculator.to_owned(),
        version: 3,
        engine: "0.0.0".to_owned(),
        input: vec![b' '; 100].into(),
        body: body.into(),
        records: String::new(),
    }
}

/// How long anything may take that does come to an end.
const PATIENCE: Duration = Duration::from_mins(1);

/// Waits until so many results are listed, which are written behind the back of who puts them.
async fn listed<P: Place>(place: &P, count: usize) {
    let begun = Instant::now();
    loop {
        let items = list(place.store(), None, 500, None).await.items;
        if items.len() == count {
            return;
        }
        assert!(begun.elapsed() < PATIENCE, "{} are listed, not {count}", items.len());
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

fn of_bytes(bytes: u64) -> Keep {
    Keep { bytes, ..keep(Duration::from_hours(1)) }
}

pub(in crate::store) async fn what_is_put_is_got_after_the_store_was_closed<P: Place>() {
    let kept = result(1, "a");
    let first = P::new().await;
    assert_eq!(first.store().get(kept.key).await.unwrap(), None);
    first.store().put(kept.clone());
    let second = first.again().await;
    second.store().ping().await.unwrap();
    assert_eq!(second.store().get(kept.key).await.unwrap(), Some(kept));
}

pub(in crate::store) async fn what_is_too_much_to_wait_is_not_kept_and_does_no_harm<P: Place>() {
    let place = P::new().await;
    let large = |number: u32| KeptResult { body: vec![b' '; 20 << 20].into(), ..result(number, "a") };
    for number in 0..5 {
        place.store().put(large(number));
    }
    assert_eq!(place.store().get(large(4).key).await.unwrap(), None);
    listed(&place, 3).await;
    place.store().put(large(4));
    listed(&place, 4).await;
    assert_eq!(place.store().get(large(4).key).await.unwrap(), Some(large(4)));
}

pub(in crate::store) async fn a_damaged_row_is_not_served_and_goes_away<P: Place>() {
    let kept = result(1, "a");
    let place = P::new().await;
    place.store().put(kept.clone());
    let place = place.again().await;
    place.damage().await;
    assert_eq!(place.store().get(kept.key).await.unwrap(), None);
    assert_eq!(list(place.store(), None, 10, None).await.items, []);
    // It can be kept again.
    place.store().put(kept.clone());
    listed(&place, 1).await;
    assert_eq!(place.store().get(kept.key).await.unwrap(), Some(kept));
}

pub(in crate::store) async fn the_list_is_paged_newest_first_and_filtered<P: Place>() {
    let place = P::new().await;
    for number in 0..7 {
        place.store().put(result(number, if number % 2 == 0 { "even" } else { "odd" }));
        if number == 3 {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    }
    listed(&place, 7).await;
    let whole = list(place.store(), None, 100, None).await;
    assert_eq!((whole.items.len(), whole.next), (7, None));
    assert!(whole.items.is_sorted_by(|a, b| (a.created_ms, a.key) > (b.created_ms, b.key)));
    let mut paged = Vec::new();
    let mut after = None;
    loop {
        let page = list(place.store(), None, 3, after).await;
        paged.extend(page.items);
        after = page.next;
        // A cursor goes through the text of an address.
        let Some(cursor) = after else { break };
        assert_eq!(cursor.to_string().parse(), Ok(cursor));
    }
    assert_eq!(paged, whole.items);
    let odd = list(place.store(), Some("odd"), 2, None).await;
    let rest = list(place.store(), Some("odd"), 2, odd.next).await;
    assert_eq!((odd.items.len(), rest.items.len(), rest.next), (2, 1, None));
    assert!(odd.items.iter().chain(&rest.items).all(|item| item.calculator == "odd"));
    assert_eq!(list(place.store(), Some("none"), 2, None).await, ResultPage::default());
}

pub(in crate::store) async fn results_are_found_by_the_records_of_their_jobs<P: Place>() {
    let place = P::new().await;
    let store = place.store();
    let named = |number: u32, records: &str| KeptResult { records: records.to_owned(), ..result(number, "a") };
    let all = [
        named(1, "|machines/lathe-3@4|tools/bar_25@1|"),
        named(2, "|machines/lathe-3@41|"),
        named(3, "|materials/lathe-3@4|tools/barx25@1|"),
        named(4, ""),
    ];
    for result in &all {
        store.put(result.clone());
    }
    listed(&place, all.len()).await;
    let second = place.again().await;
    let store = second.store();
    assert_eq!(store.get(all[0].key).await.unwrap().as_ref(), Some(&all[0]));
    store.note_asked(all[1].key, "anna".to_owned()).await.unwrap();
    let cases: [(&str, &[usize]); 6] = [
        ("machines/lathe-3", &[0, 1]),
        ("machines/lathe-3@4", &[0]),
        ("machines/lathe-3@41", &[1]),
        ("machines/lathe", &[]),
        // An underscore is no wildcard.
        ("tools/bar_25", &[0]),
        ("materials/lathe-3@4", &[2]),
    ];
    for (record, expected) in cases {
        for owner in [None, Some("anna".to_owned())] {
            let expected: BTreeSet<Key> =
                expected.iter().filter(|at| owner.is_none() || **at == 1).map(|at| all[*at].key).collect();
            let query = ResultQuery { record: Some(record.to_owned()), owner: owner.clone(), ..ResultQuery::default() };
            let found: BTreeSet<Key> = store.list(query).await.unwrap().items.iter().map(|item| item.key).collect();
            assert_eq!(found, expected, "{record} of {owner:?}");
            let uses = store.uses(record.to_owned(), owner).await.unwrap();
            assert_eq!(uses, expected.len() as u64, "{record}");
        }
    }
}

pub(in crate::store) async fn the_total_stays_below_the_limit_and_the_last_used_stay<P: Place>() {
    let place = P::with(of_bytes(200_000)).await;
    for number in 0..40 {
        place.store().put(result(number, "a"));
        tokio::time::sleep(Duration::from_millis(2)).await;
        list(place.store(), None, 1, None).await;
    }
    // Another list: what came last was written before, and eviction follows the writing.
    let items = list(place.store(), None, 500, None).await.items;
    let total: u64 = items.iter().map(|item| item.bytes).sum();
    assert!(total <= 220_000 && items.len() > 5, "{total} bytes in {}", items.len());
    assert_eq!(place.store().get(result(0, "a").key).await.unwrap(), None);
    assert_eq!(place.store().get(result(39, "a").key).await.unwrap(), Some(result(39, "a")));
}

pub(in crate::store) async fn what_is_old_is_forgotten_at_the_next_start<P: Place>() {
    let first = P::new().await;
    first.store().put(result(1, "a"));
    tokio::time::sleep(Duration::from_millis(20)).await;
    let second = first.again_with(Keep { age: Duration::from_millis(1), ..of_bytes(1 << 30) }).await;
    let begun = Instant::now();
    while !list(second.store(), None, 10, None).await.items.is_empty() {
        assert!(begun.elapsed() < PATIENCE, "it is still listed");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    assert_eq!(second.store().get(result(1, "a").key).await.unwrap(), None);
}

pub(in crate::store) async fn the_jobs_of_some_results_are_read_at_once<P: Place>() {
    let place = P::new().await;
    let jobs = ["{\"a\":1}", "{\"a\":2}", "{\"a\":3}"];
    let kept = |number: u32, job: &str| KeptResult { input: job.to_owned().into(), ..result(number, "a") };
    for (number, job) in (0..).zip(jobs) {
        place.store().put(kept(number, job));
    }
    // What waits to be written is written by then.
    listed(&place, 3).await;
    let keys = vec![result(2, "a").key, result(9, "a").key, result(0, "a").key];
    let mut found = place.store().inputs(keys.clone(), 1000).await.unwrap();
    found.sort_by_key(|(key, _)| *key != result(0, "a").key);
    let read: Vec<_> = found.iter().map(|(key, packed)| (*key, zstd::decode_all(&**packed).unwrap())).collect();
    assert_eq!(read, [(keys[2], jobs[0].into()), (keys[0], jobs[2].into())]);
    assert_eq!(place.store().inputs(keys, 5).await.unwrap(), [], "larger ones are left out");
    assert_eq!(place.store().inputs(Vec::new(), 1000).await.unwrap(), []);
}
