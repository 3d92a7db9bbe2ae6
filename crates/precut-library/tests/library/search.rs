//! Finding a record by what somebody types.

use precut_library::built_in;
use precut_library::record::Kind;
use precut_library::search::{Index, fold, nearest};
use proptest::prelude::*;

fn index() -> Index {
    let mut index = Index::default();
    for record in built_in::records(Kind::Material) {
        index.add(&record.name, record.text("title").unwrap_or_default(), record.names());
    }
    index
}

#[test]
fn letters_fold() {
    for same in [
        ["40Х", "40Kh", "40X"],
        ["ШХ15", "ShKh15", "shx 15"],
        ["1.7225", "17225", "1-7225"],
        ["30ХГСА", "30KhGSA", "30xgsa"],
    ] {
        assert!(same.iter().all(|name| fold(name) == fold(same[0])), "{same:?}: {:?}", same.map(fold));
    }
    assert_eq!(fold("12Х18Н10Т"), fold("12Kh18N10T"));
    assert_eq!(fold("  -. "), "");
}

#[test]
fn one_steel_has_many_names() {
    for name in ["4140", "1.7225", "SCM440", "38ХМ", "42CrMo4", "42 crmo 4", "38KhM", "42CRMO4"] {
        let found: Vec<&str> = built_in::materials_called(name).iter().map(|record| record.name.as_str()).collect();
        assert_eq!(found, ["42crmo4"], "{name}");
        assert_eq!(index().find(name, 10).first(), Some(&"42crmo4"), "{name}");
    }
}

#[test]
fn names_come_before_parts_of_names() {
    let mut index = Index::default();
    for (name, title) in
        [("bar_a25", "Boring bar 25"), ("a25", "Something"), ("a25_long", "Long one"), ("x", "Bar a25")]
    {
        index.add(name, title, std::iter::empty());
    }
    assert_eq!(index.find("a25", 10), ["a25", "a25_long", "bar_a25", "x"]);
    assert_eq!(index.find("a25", 2), ["a25", "a25_long"]);
    assert_eq!(index.find("25 boring", 10), ["bar_a25"]);
    assert!(index.find("nothing of it", 10).is_empty());
    assert_eq!(index.find("", 10).len(), 4);
}

#[test]
fn a_slip_finds_its_name() {
    let known = || built_in::records(Kind::Machine).iter().map(|record| record.name.as_str());
    assert_eq!(nearest("lathe_engin_medium", known()).first().map(String::as_str), Some("lathe_engine_medium"));
    assert!(nearest("zzzz", known()).is_empty());
    assert!(nearest(&"x".repeat(100_000), known()).is_empty());
}

proptest! {
    #[test]
    fn folding_is_settled_after_once(text in "\\PC{0,40}") {
        let once = fold(&text);
        prop_assert_eq!(fold(&once), once.clone());
        prop_assert!(once.bytes().all(|byte| byte.is_ascii_lowercase() || byte.is_ascii_digit()));
    }

    #[test]
    fn every_name_finds_its_material(pick in any::<proptest::sample::Index>()) {
        let records = built_in::records(Kind::Material);
        let record = &records[pick.index(records.len())];
        for name in record.names() {
            prop_assert_eq!(built_in::materials_called(name)[0].name.as_str(), record.name.as_str());
        }
    }
}
