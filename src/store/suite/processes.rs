//! What every store has to do with the records of processes.

use super::Place;
use crate::store::callbacks::{CallbackState, NewCallback, Subject, TakeUp, Tried};
use crate::store::documents::{Kind, NewDocument};
use crate::store::jobs::Quota;
use crate::store::processes::{Added, Addition, EntryKind, NewEntry, PartNow, Snapshot};
use crate::store::{Store, StoreError};

const NAME: &str = "one/shaft";

fn declared(after: Option<i64>, content: &str) -> Addition {
    let sha256 = blake3::hash(content.as_bytes()).to_hex().to_string();
    let document = NewDocument {
        kind: Kind::Process,
        name: NAME.to_owned(),
        class: "toy-bar".to_owned(),
        words: String::new(),
        content: content.to_owned(),
        sha256,
    };
    let entry = NewEntry { part: None, number: None, ..entry(EntryKind::Document, "", None, content) };
    Addition { document: Some(document), entries: vec![entry], ..addition(after, Vec::new()) }
}

fn entry(kind: EntryKind, part: &str, number: Option<u32>, content: &str) -> NewEntry {
    NewEntry {
        kind,
        part: Some(part.to_owned()),
        revision: 1,
        number,
        content: content.to_owned(),
        said: "{}".to_owned(),
        created_ms: None,
    }
}

fn addition(after: Option<i64>, entries: Vec<NewEntry>) -> Addition {
    let parts = entries.iter().enumerate().filter_map(|(place, entry)| {
        let now = "{}".to_owned();
        Some(PartNow { part: entry.part.clone()?, entry: Some((entry.number, place)), now })
    });
    Addition {
        process: NAME.to_owned(),
        after,
        parts: parts.collect(),
        entries,
        state: Some("{}".to_owned()),
        owner: "key:one".to_owned(),
        ..Addition::default()
    }
}

fn part(after: i64, part: &str, number: u32) -> Addition {
    addition(Some(after), vec![entry(EntryKind::Part, part, Some(number), "[]")])
}

async fn add(store: &dyn Store, addition: Addition) -> Option<i64> {
    match store.add_to_process(addition).await.unwrap() {
        Added::Done { sequence, .. } => Some(sequence),
        Added::Stale => None,
        Added::OverQuota(usage) => panic!("{usage:?}"),
    }
}

pub(in crate::store) async fn a_record_grows_without_a_gap_whoever_is_first<P: Place>() {
    let place = P::new().await;
    let store = place.store();
    assert_eq!(add(store, part(1, "a", 1)).await, None, "there is no such process");
    assert_eq!(add(store, declared(None, "{}")).await, Some(1));
    assert_eq!(add(store, declared(None, "{}")).await, None, "it is there");
    // Ten who know the same: one of them is first.
    let names: Vec<String> = (0..10).map(|k| format!("p{k}")).collect();
    let many = names.iter().map(|name| store.add_to_process(part(1, name, 1)));
    let added: Vec<Result<Added, StoreError>> = futures_util::future::join_all(many).await;
    assert_eq!(added.iter().filter(|one| matches!(one, Ok(Added::Done { sequence: 2, .. }))).count(), 1, "{added:?}");
    assert_eq!(added.iter().filter(|one| matches!(one, Ok(Added::Stale))).count(), 9, "{added:?}");
    assert_eq!(add(store, declared(Some(2), "[1]")).await, Some(3));
    let entries = store.process_entries(NAME.to_owned(), 0, 10, false).await.unwrap();
    let told: Vec<(i64, &str, u32)> = entries.iter().map(|one| (one.sequence, &*one.kind, one.revision)).collect();
    assert_eq!(told, [(1, "document", 1), (2, "part", 1), (3, "document", 2)]);
    assert_eq!(store.process_entries(NAME.to_owned(), 1, 10, true).await.unwrap().len(), 1);
    assert_eq!(store.process(NAME.to_owned()).await.unwrap().unwrap().sequence, 3);
}

pub(in crate::store) async fn parts_are_corrected_and_withdrawn_with_their_history<P: Place>() {
    let place = P::new().await;
    let store = place.store();
    add(store, declared(None, "{}")).await;
    add(store, part(1, "a", 7)).await;
    add(store, part(2, "b", 5)).await;
    let numbers = async |from: i64, to: i64| -> Vec<(String, Option<i64>)> {
        let parts = store.process_parts(NAME.to_owned(), (from, to), 10).await.unwrap();
        parts.into_iter().map(|part| (part.part, part.number)).collect()
    };
    let (a, b) = (|n| ("a".to_owned(), Some(n)), ("b".to_owned(), Some(5)));
    assert_eq!(numbers(0, 100).await, [b.clone(), a(7)]);
    assert_eq!(numbers(6, 100).await, [a(7)]);
    // Two parts of one number are never kept.
    assert!(store.add_to_process(part(3, "c", 5)).await.is_err());
    let corrected = NewEntry { revision: 2, ..entry(EntryKind::Part, "a", Some(8), "[2]") };
    assert_eq!(add(store, addition(Some(3), vec![corrected])).await, Some(4));
    assert_eq!(numbers(0, 100).await, [b.clone(), a(8)]);
    let said = PartNow { part: "b".to_owned(), entry: None, now: "{\"other\":1}".to_owned() };
    let withdrawn = NewEntry { revision: 3, ..entry(EntryKind::Withdrawn, "a", None, "null") };
    let addition = addition(Some(4), vec![withdrawn]);
    let parts = addition.parts.iter().cloned().chain([said]).collect();
    assert_eq!(add(store, Addition { parts, ..addition }).await, Some(5));
    assert_eq!(numbers(0, 100).await, [b]);
    let kept = store.process_part(NAME.to_owned(), "a".to_owned()).await.unwrap().unwrap();
    assert_eq!((kept.number, kept.revision, kept.sequence), (None, 3, 5));
    let kept = store.process_part(NAME.to_owned(), "b".to_owned()).await.unwrap().unwrap();
    assert_eq!((kept.now.as_str(), kept.sequence), ("{\"other\":1}", 3));
    let history = store.part_entries(NAME.to_owned(), "a".to_owned()).await.unwrap();
    assert_eq!(history.iter().map(|entry| entry.content.as_str()).collect::<Vec<_>>(), ["[]", "[2]", "null"]);
    let place = place.again().await;
    assert_eq!(place.store().process(NAME.to_owned()).await.unwrap().unwrap().sequence, 5);
}

pub(in crate::store) async fn what_is_told_of_an_entry_is_due_with_it_and_gone_with_the_process<P: Place>() {
    let place = P::new().await;
    let store = place.store();
    add(store, declared(None, "{}")).await;
    let callback = NewCallback { url: "https://mes.example/".to_owned(), host: "mes.example:443".to_owned() };
    let told = |after, name, number| Addition { tells: vec![(0, callback.clone())], ..part(after, name, number) };
    add(store, told(1, "a", 1)).await;
    // Who knows less than is there adds nothing and tells nobody.
    assert_eq!(add(store, told(1, "b", 2)).await, None);
    add(store, told(2, "b", 2)).await;
    let wanted = || TakeUp { most: 100, most_of_one: 100, not_of: Vec::new(), hold_ms: 60_000 };
    let due = store.take_up_callbacks(wanted()).await.unwrap();
    let subject = |sequence| Subject::Entry { process: NAME.to_owned(), sequence };
    let mut subjects: Vec<Subject> = due.iter().map(|due| due.subject.clone()).collect();
    subjects.sort();
    assert_eq!(subjects, [subject(2), subject(3)]);
    assert!(store.take_up_callbacks(wanted()).await.unwrap().is_empty(), "each try is one process's");
    assert!(store.settle_callback(due[0].clone(), Tried::Delivered).await.unwrap());
    assert!(!store.settle_callback(due[0].clone(), Tried::Delivered).await.unwrap());
    assert_eq!(store.counts().await.unwrap().callbacks, 1);
    let entries = store.process_entries(NAME.to_owned(), 0, 10, false).await.unwrap();
    let mut states: Vec<_> = entries.iter().map(|entry| entry.callback.as_ref().map(|told| told.state)).collect();
    states.sort_by_key(|state| format!("{state:?}"));
    assert_eq!(states, [None, Some(CallbackState::Delivered), Some(CallbackState::Pending)], "{entries:?}");
    assert!(store.delete_process(NAME.to_owned(), 3).await.unwrap());
    assert_eq!(store.counts().await.unwrap().callbacks, 0);
}

pub(in crate::store) async fn a_process_counts_for_its_owner_until_it_is_deleted<P: Place>() {
    let place = P::new().await;
    let store = place.store();
    add(store, declared(None, "{}")).await;
    let kept = async || store.usage("key:one".to_owned()).await.unwrap().kept_bytes();
    let before = kept().await;
    add(store, part(1, "a", 1)).await;
    assert_eq!(kept().await, before + 4, "what came, and what was said");
    let quota = Quota { kept_bytes: Some(before + 5), ..Quota::default() };
    let full = store.add_to_process(Addition { quota, ..part(2, "b", 2) }).await.unwrap();
    assert!(matches!(full, Added::OverQuota(_)), "{full:?}");
    assert!(!store.delete_process(NAME.to_owned(), 1).await.unwrap(), "it goes on meanwhile");
    assert!(store.delete_process(NAME.to_owned(), 2).await.unwrap());
    assert_eq!(kept().await, 0);
    assert_eq!(store.process(NAME.to_owned()).await.unwrap(), None);
    assert!(store.process_entries(NAME.to_owned(), 0, 10, false).await.unwrap().is_empty());
    assert_eq!(add(store, declared(None, "{}")).await, Some(1));
    let again = store.process_entries(NAME.to_owned(), 0, 10, false).await.unwrap();
    assert_eq!(again[0].revision, 2, "numbers of what was deleted are not given again");
}

pub(in crate::store) async fn a_snapshot_counts_until_something_before_it_changes<P: Place>() {
    let place = P::new().await;
    let store = place.store();
    add(store, declared(None, "{}")).await;
    let snapshot = |number: i64| Snapshot { number, content: format!("{{\"after\":{number}}}") };
    for number in 1..=12_u32 {
        let snapshots = if number % 2 == 0 { vec![snapshot(i64::from(number))] } else { Vec::new() };
        let own = part(i64::from(number), &format!("p{number}"), number);
        add(store, Addition { snapshots, ..own }).await;
    }
    let last = async |before: Option<i64>| {
        let kept = store.process_snapshot(NAME.to_owned(), before).await.unwrap();
        kept.map(|kept| (kept.number, kept.content))
    };
    let told = |number: i64| Some((number, snapshot(number).content));
    assert_eq!(last(None).await, told(10), "of the last part itself nothing would be said");
    assert_eq!(last(Some(10)).await, told(8));
    assert_eq!(last(Some(6)).await, None, "four are kept");
    // A part that is corrected: what was kept after it counts no more, until it is kept again.
    let corrected = NewEntry { revision: 2, ..entry(EntryKind::Part, "p9", Some(9), "[2]") };
    add(store, addition(Some(13), vec![corrected])).await;
    assert_eq!(last(None).await, told(8));
    let snapshots = vec![Snapshot { content: "{}".to_owned(), ..snapshot(10) }];
    let other = NewEntry { revision: 3, ..entry(EntryKind::Part, "p9", Some(9), "[3]") };
    add(store, Addition { snapshots, ..addition(Some(14), vec![other]) }).await;
    assert_eq!(last(None).await, Some((10, "{}".to_owned())));
    // One that is withdrawn, one that gets another number, and one that comes late.
    let withdrawn = NewEntry { revision: 4, ..entry(EntryKind::Withdrawn, "p9", None, "null") };
    add(store, addition(Some(15), vec![withdrawn])).await;
    assert_eq!(last(None).await, told(8));
    let moved = NewEntry { revision: 2, ..entry(EntryKind::Part, "p8", Some(20), "[]") };
    add(store, addition(Some(16), vec![moved])).await;
    assert_eq!(last(None).await, told(6));
    add(store, Addition { snapshots: vec![snapshot(12)], ..part(17, "p30", 30) }).await;
    assert_eq!(last(None).await, told(12));
    add(store, part(18, "late", 9)).await;
    assert_eq!(last(None).await, told(6));
    // Another document judges all parts anew.
    add(store, Addition { snapshots: vec![snapshot(12)], ..part(19, "p31", 31) }).await;
    add(store, declared(Some(20), "[1]")).await;
    assert_eq!(last(None).await, None);
    assert!(store.delete_process(NAME.to_owned(), 21).await.unwrap());
    add(store, declared(None, "{}")).await;
    add(store, part(1, "a", 40)).await;
    assert_eq!(last(None).await, None);
}
