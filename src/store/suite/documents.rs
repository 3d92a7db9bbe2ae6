//! What every store has to do with documents under names.

use super::Place;
use crate::store::Store;
use crate::store::documents::{Before, KeptDocument, Kind, NewDocument, NewDocuments, Placed, PutDocuments, Revisions};
use crate::store::jobs::Quota;

fn document(kind: Kind, name: &str, content: &str) -> NewDocument {
    NewDocument {
        kind,
        name: name.to_owned(),
        class: "toy-bar".to_owned(),
        words: format!("title of {name}"),
        content: content.to_owned(),
        sha256: blake3::hash(content.as_bytes()).to_hex().to_string(),
    }
}

fn new(documents: Vec<NewDocument>) -> NewDocuments {
    NewDocuments {
        documents,
        only_new: false,
        unless_equal: false,
        owner: "key:one".to_owned(),
        quota: Quota::default(),
        most: 100,
    }
}

/// The revisions that documents were kept as; none where their names are taken.
fn placed(put: PutDocuments) -> Option<Vec<Placed>> {
    match put {
        PutDocuments::Kept(placed) => Some(placed),
        PutDocuments::Taken => None,
        other => panic!("{other:?}"),
    }
}

async fn put_model(store: &dyn Store, name: &str, only_new: bool) -> Option<u32> {
    let new = NewDocuments { only_new, ..new(vec![document(Kind::Model, name, "{}")]) };
    placed(store.put_documents(new).await.unwrap()).map(|placed| placed[0].revision)
}

fn names(documents: Vec<KeptDocument>) -> Vec<(String, u32)> {
    documents.into_iter().map(|one| (one.name, one.revision)).collect()
}

pub(in crate::store) async fn revisions_rise_and_are_never_given_twice<P: Place>() {
    const MODEL: Kind = Kind::Model;
    let place = P::new().await;
    let store = place.store();
    let put = async |name: &str, only_new| put_model(store, name, only_new).await;
    assert_eq!(put("b", true).await, Some(1));
    assert_eq!(put("b", true).await, None, "the name is taken");
    assert_eq!(put("b", false).await, Some(2));
    assert_eq!(put("a", true).await, Some(1));
    let all = names(store.documents(MODEL, String::new(), String::new(), 10).await.unwrap());
    assert_eq!(all, [("a".to_owned(), 1), ("b".to_owned(), 2)]);
    let behind = names(store.documents(MODEL, String::new(), "a".to_owned(), 10).await.unwrap());
    assert_eq!(behind, [("b".to_owned(), 2)]);
    assert_eq!(store.document(MODEL, "b".to_owned(), Some(1)).await.unwrap().unwrap().revision, 1);
    let revisions = async || store.revisions(MODEL, "b".to_owned()).await.unwrap();
    assert_eq!(revisions().await, Revisions { there: vec![1, 2], last: Some(2) });
    assert!(store.delete_document(MODEL, "b".to_owned()).await.unwrap());
    assert!(!store.delete_document(MODEL, "b".to_owned()).await.unwrap());
    assert_eq!(store.document(MODEL, "b".to_owned(), None).await.unwrap(), None);
    assert_eq!(revisions().await, Revisions { there: vec![], last: Some(2) });
    assert_eq!(put("b", true).await, Some(3), "2 is cited somewhere");
    assert_eq!(store.document(MODEL, "b".to_owned(), Some(2)).await.unwrap(), None);
    assert_eq!(revisions().await, Revisions { there: vec![3], last: Some(3) });
    assert_eq!(store.revisions(MODEL, "x".to_owned()).await.unwrap(), Revisions::default());
    // However many come at once, each has a number of its own.
    let many = (0..10).map(|_| put("c", false));
    let mut numbers: Vec<u32> = futures_util::future::join_all(many).await.into_iter().map(Option::unwrap).collect();
    numbers.sort_unstable();
    assert!(numbers.into_iter().eq(1..=10));
}

pub(in crate::store) async fn kinds_and_shelves_are_apart<P: Place>() {
    let place = P::new().await;
    let store = place.store();
    for (kind, name) in
        [(Kind::Machine, "lathe"), (Kind::Tool, "lathe"), (Kind::Tool, "one/lathe"), (Kind::Tool, "one/b")]
    {
        let put = store.put_documents(new(vec![document(kind, name, "{}")])).await.unwrap();
        assert_eq!(placed(put).unwrap()[0].revision, 1, "{name}");
    }
    let titles = async |kind, shelf: &str| -> Vec<(String, String)> {
        let titles = store.titles(kind, shelf.to_owned(), 10).await.unwrap();
        titles.into_iter().map(|title| (title.name, title.words)).collect()
    };
    let pair = |name: &str, full: &str| (name.to_owned(), format!("title of {full}"));
    assert_eq!(titles(Kind::Tool, "").await, [pair("lathe", "lathe")]);
    assert_eq!(titles(Kind::Tool, "one/").await, [pair("b", "one/b"), pair("lathe", "one/lathe")]);
    assert_eq!(titles(Kind::Material, "").await, []);
    assert!(store.delete_document(Kind::Tool, "one/lathe".to_owned()).await.unwrap());
    assert_eq!(titles(Kind::Tool, "one/").await, [pair("b", "one/b")]);
    assert!(store.document(Kind::Machine, "lathe".to_owned(), None).await.unwrap().is_some());
    assert_eq!(names(store.documents(Kind::Tool, "one/".to_owned(), String::new(), 10).await.unwrap()).len(), 1);
}

pub(in crate::store) async fn several_are_kept_together_or_none_of_them<P: Place>() {
    let place = P::new().await;
    let store = place.store();
    let tool = |name: &str, content: &str| document(Kind::Tool, name, content);
    let before = store.generation().await.unwrap();
    let both = || new(vec![tool("a", "{}"), document(Kind::Machine, "a", "{}")]);
    let kept = placed(store.put_documents(both()).await.unwrap()).unwrap();
    assert!(kept.iter().all(|one| (one.revision, one.before) == (1, Before::Nothing)), "{kept:?}");
    if let (Some(before), Some(after)) = (before, store.generation().await.unwrap()) {
        assert!(after > before, "other processes see that something changed");
    }
    // What says the same makes no revision, what says something else does.
    let again = NewDocuments { unless_equal: true, ..new(vec![tool("a", "{}"), tool("b", "{}")]) };
    let kept = placed(store.put_documents(again).await.unwrap()).unwrap();
    assert_eq!((kept[0].revision, kept[0].before), (1, Before::Same));
    assert_eq!((kept[1].revision, kept[1].before), (1, Before::Nothing));
    let other = NewDocuments { unless_equal: true, ..new(vec![tool("a", "[]")]) };
    let kept = placed(store.put_documents(other).await.unwrap()).unwrap();
    assert_eq!((kept[0].revision, kept[0].before), (2, Before::Other));
    // Four are kept: there is room for one of two, and neither is kept.
    let two = || vec![tool("c", "{}"), tool("d", "{}")];
    let full = store.put_documents(NewDocuments { most: 5, ..new(two()) }).await.unwrap();
    assert_eq!(full, PutDocuments::Full);
    assert_eq!(store.document(Kind::Tool, "c".to_owned(), None).await.unwrap(), None);
    // Equal ones take no room, and models are not counted.
    let equal = NewDocuments { most: 4, unless_equal: true, ..both() };
    let equal = NewDocuments { documents: equal.documents[1..].to_vec(), ..equal };
    assert!(placed(store.put_documents(equal).await.unwrap()).is_some());
    let model = NewDocuments { most: 4, ..new(vec![document(Kind::Model, "m", "{}")]) };
    assert!(placed(store.put_documents(model).await.unwrap()).is_some());
    assert!(placed(store.put_documents(NewDocuments { most: 6, ..new(two()) }).await.unwrap()).is_some());
}

pub(in crate::store) async fn documents_count_for_who_stores_them_until_they_are_deleted<P: Place>() {
    let place = P::new().await;
    let store = place.store();
    let sized = |kind: Kind, name: &str, owner: &str, bytes: usize| {
        // Two bytes each: what counts is bytes, not letters.
        let content = format!("\"{}\"", "ä".repeat(bytes / 2 - 1));
        let quota = Quota { kept_bytes: Some(1000), ..Quota::default() };
        NewDocuments { owner: owner.to_owned(), quota, ..new(vec![document(kind, name, &content)]) }
    };
    let put = async |new| store.put_documents(new).await.unwrap();
    let kept = async |owner: &str| store.usage(owner.to_owned()).await.unwrap().kept_bytes();
    assert_eq!(kept("key:one").await, 0);
    for (kind, name, owner, bytes) in [
        (Kind::Model, "one/a", "key:one", 400),
        (Kind::Machine, "one/a", "key:one", 400),
        (Kind::Model, "b", "ip:10.0.0.7", 100),
    ] {
        assert!(matches!(put(sized(kind, name, owner, bytes)).await, PutDocuments::Kept(_)), "{name}");
    }
    assert_eq!((kept("key:one").await, kept("ip:10.0.0.7").await), (800, 100), "each is kept");
    let PutDocuments::OverQuota(usage) = put(sized(Kind::Tool, "one/c", "key:one", 202)).await else {
        panic!("there is no room for it");
    };
    assert_eq!(usage.kept_bytes(), 800);
    assert!(matches!(put(sized(Kind::Tool, "one/c", "key:one", 200)).await, PutDocuments::Kept(_)), "it fits");
    assert_eq!(store.kept_by_owner().await.unwrap(), [("key:one".to_owned(), 1000)]);
    // Jobs count beside them, and find no room either.
    let one = |quota| crate::store::jobs::NewJob { owner: "key:one".to_owned(), quota, ..super::job(1) };
    let full = store.submit(one(Quota { kept_bytes: Some(1000), ..Quota::default() }), 100).await.unwrap();
    assert!(matches!(full, crate::store::jobs::Accepted::OverQuota(_)), "{full:?}");
    assert!(store.delete_document(Kind::Model, "one/a".to_owned()).await.unwrap());
    assert_eq!(kept("key:one").await, 600);
}
