//! What every store has to do with stored models.

use super::Place;
use crate::store::jobs::Quota;
use crate::store::models::{KeptModel, NewModel, PutModel};

/// The revision that a model was kept as.
fn revision(put: PutModel) -> Option<u32> {
    match put {
        PutModel::Kept(kept) => Some(kept.revision),
        PutModel::Taken => None,
        PutModel::OverQuota(usage) => panic!("{usage:?}"),
    }
}

fn model(name: &str, only_new: bool) -> NewModel {
    NewModel {
        name: name.to_owned(),
        calculator: "toy-bar".to_owned(),
        content: "{}".to_owned(),
        sha256: "0".repeat(64),
        only_new,
        owner: "key:one".to_owned(),
        quota: Quota::default(),
    }
}

pub(in crate::store) async fn revisions_rise_and_are_never_given_twice<P: Place>() {
    let place = P::new().await;
    let store = place.store();
    let put = async |name: &str, only_new| revision(store.put_model(model(name, only_new)).await.unwrap());
    assert_eq!(put("b", true).await, Some(1));
    assert_eq!(put("b", true).await, None, "the name is taken");
    assert_eq!(put("b", false).await, Some(2));
    assert_eq!(put("a", true).await, Some(1));
    let names = |models: Vec<KeptModel>| models.into_iter().map(|m| (m.name, m.revision)).collect::<Vec<_>>();
    let all = names(store.models(String::new(), String::new(), 10).await.unwrap());
    assert_eq!(all, [("a".to_owned(), 1), ("b".to_owned(), 2)]);
    assert_eq!(names(store.models(String::new(), "a".to_owned(), 10).await.unwrap()), [("b".to_owned(), 2)]);
    assert_eq!(store.model("b".to_owned(), Some(1)).await.unwrap().unwrap().revision, 1);
    assert!(store.delete_model("b".to_owned()).await.unwrap());
    assert!(!store.delete_model("b".to_owned()).await.unwrap());
    assert_eq!(store.model("b".to_owned(), None).await.unwrap(), None);
    assert_eq!(put("b", true).await, Some(3), "2 is cited somewhere");
    assert_eq!(store.model("b".to_owned(), Some(2)).await.unwrap(), None);
    // However many come at once, each has a number of its own.
    let many = (0..10).map(|_| put("c", false));
    let mut numbers: Vec<u32> = futures_util::future::join_all(many).await.into_iter().map(Option::unwrap).collect();
    numbers.sort_unstable();
    assert!(numbers.into_iter().eq(1..=10));
}

pub(in crate::store) async fn models_count_for_who_stores_them_until_they_are_deleted<P: Place>() {
    let place = P::new().await;
    let store = place.store();
    let sized = |name: &str, owner: &str, bytes: usize| NewModel {
        // Two bytes each: what counts is bytes, not letters.
        content: format!("\"{}\"", "ä".repeat(bytes / 2 - 1)),
        owner: owner.to_owned(),
        quota: Quota { kept_bytes: Some(1000), ..Quota::default() },
        ..model(name, false)
    };
    let kept = async |owner: &str| store.usage(owner.to_owned()).await.unwrap().kept_bytes();
    assert_eq!(kept("key:one").await, 0);
    for (name, owner, bytes) in [("one/a", "key:one", 400), ("one/a", "key:one", 400), ("b", "ip:10.0.0.7", 100)] {
        assert!(matches!(store.put_model(sized(name, owner, bytes)).await.unwrap(), PutModel::Kept(_)), "{name}");
    }
    assert_eq!((kept("key:one").await, kept("ip:10.0.0.7").await), (800, 100), "each revision is kept");
    let PutModel::OverQuota(usage) = store.put_model(sized("one/c", "key:one", 202)).await.unwrap() else {
        panic!("there is no room for it");
    };
    assert_eq!(usage.kept_bytes(), 800);
    assert!(matches!(store.put_model(sized("one/c", "key:one", 200)).await.unwrap(), PutModel::Kept(_)), "it fits");
    assert_eq!(store.kept_by_owner().await.unwrap(), [("key:one".to_owned(), 1000)]);
    // Jobs count beside them, and find no room either.
    let one = |quota| crate::store::jobs::NewJob { owner: "key:one".to_owned(), quota, ..super::job(1) };
    let full = store.submit(one(Quota { kept_bytes: Some(1000), ..Quota::default() }), 100).await.unwrap();
    assert!(matches!(full, crate::store::jobs::Accepted::OverQuota(_)), "{full:?}");
    assert!(store.delete_model("one/a".to_owned()).await.unwrap());
    assert_eq!(kept("key:one").await, 200);
}
