//! What every store has to do with stored models.

use super::Place;
use crate::store::models::{KeptModel, NewModel};

fn model(name: &str, only_new: bool) -> NewModel {
    NewModel {
        name: name.to_owned(),
        calculator: "toy-bar".to_owned(),
        content: "{}".to_owned(),
        sha256: "0".repeat(64),
        only_new,
    }
}

pub(in crate::store) async fn revisions_rise_and_are_never_given_twice<P: Place>() {
    let place = P::new().await;
    let store = place.store();
    let put = |name: &str, only_new| store.put_model(model(name, only_new));
    assert_eq!(put("b", true).await.unwrap().unwrap().revision, 1);
    assert_eq!(put("b", true).await.unwrap(), None, "the name is taken");
    assert_eq!(put("b", false).await.unwrap().unwrap().revision, 2);
    assert_eq!(put("a", true).await.unwrap().unwrap().revision, 1);
    let names = |models: Vec<KeptModel>| models.into_iter().map(|m| (m.name, m.revision)).collect::<Vec<_>>();
    let all = names(store.models(String::new(), String::new(), 10).await.unwrap());
    assert_eq!(all, [("a".to_owned(), 1), ("b".to_owned(), 2)]);
    assert_eq!(names(store.models(String::new(), "a".to_owned(), 10).await.unwrap()), [("b".to_owned(), 2)]);
    assert_eq!(store.model("b".to_owned(), Some(1)).await.unwrap().unwrap().revision, 1);
    assert!(store.delete_model("b".to_owned()).await.unwrap());
    assert!(!store.delete_model("b".to_owned()).await.unwrap());
    assert_eq!(store.model("b".to_owned(), None).await.unwrap(), None);
    assert_eq!(put("b", true).await.unwrap().unwrap().revision, 3, "2 is cited somewhere");
    assert_eq!(store.model("b".to_owned(), Some(2)).await.unwrap(), None);
    // However many come at once, each has a number of its own.
    let many = (0..10).map(|_| put("c", false));
    let mut numbers: Vec<u32> =
        futures_util::future::join_all(many).await.into_iter().map(|kept| kept.unwrap().unwrap().revision).collect();
    numbers.sort_unstable();
    assert!(numbers.into_iter().eq(1..=10));
}
