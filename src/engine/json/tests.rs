//! Bytes that are JSON, and such as are not.
#![allow(clippy::unwrap_used, clippy::panic)]

use super::strict::{DEEPEST, LONGEST_MISFIT, LONGEST_UNKNOWN};
use super::*;
use crate::registry::{canonical, cut_short_at};
use proptest::prelude::*;
use serde_json::json;

fn refused(text: &str) -> SyntaxFault {
    match parse(text.as_bytes()) {
        Err(Error::Syntax(fault)) => fault,
        other => panic!("{text} gave {other:?}"),
    }
}

#[test]
fn a_field_of_the_object_itself_is_found_in_its_text() {
    let object = json!({
        "a": {"effects": 1}, "b": ["effects", {"effects": [2]}], "c\"effects": "x,\"effects\":{", "": 0,
        "effects": [{"kind": "wear\\\"]}", "of": [[1.5, null]]}, {}], "last": {},
    });
    let text = object.to_string();
    for name in ["a", "b", "effects", "", "last"] {
        let place = top_level_field(text.as_bytes(), name).unwrap();
        assert_eq!(text[place], object[name].to_string(), "{name}");
    }
    for (text, name) in [("{}", "a"), ("{\"a\":{\"b\":1}}", "b"), ("[1,2]", "a"), ("", "a"), ("{\"a\":1", "a")] {
        assert_eq!(top_level_field(text.as_bytes(), name), None, "{text}");
    }
}

proptest! {
    #[test]
    fn a_field_is_added_where_canonical_json_has_it(names in proptest::collection::btree_set("[a-z_]{1,6}", 0..6)) {
        let all: serde_json::Map<_, _> = names.iter().map(|name| (name.clone(), json!({ "of": [name, "}\",:"] }))).collect();
        for name in &names {
            let mut rest = all.clone();
            let taken = rest.shift_remove(name).unwrap();
            let (rest, taken) = (canonical(&rest).unwrap(), canonical(&taken).unwrap());
            let with = with_top_level(&rest, name, &taken);
            prop_assert_eq!(String::from_utf8(with).unwrap(), String::from_utf8(canonical(&all).unwrap()).unwrap());
        }
    }
}

#[test]
fn a_key_twice_is_refused_with_its_place() {
    let fault = refused("{\"a\": [0, {\"b\": 1,\n \"c/d\": 2, \"b\": 3}]}");
    assert_eq!((fault.code, fault.pointer.as_str(), fault.line), ("duplicate_key", "/a/1/b", 2));
}

#[test]
fn every_fault_of_syntax_has_its_code() {
    let deep = format!("{}{}", "[".repeat(200), "]".repeat(200));
    for (text, code) in [
        ("", "empty_body"),
        (" \n", "empty_body"),
        ("{", "unexpected_end"),
        ("{\"a\": }", "bad_syntax"),
        ("{\"a\": NaN}", "bad_syntax"),
        ("{\"a\": 1} x", "trailing_bytes"),
        ("{} {}", "trailing_bytes"),
        ("{\"a\": 1e400}", "number_out_of_range"),
        ("{\"a\": 9007199254740993}", "integer_too_large"),
        ("{\"a\": -9007199254740993}", "integer_too_large"),
        (deep.as_str(), "nested_too_deeply"),
    ] {
        assert_eq!(refused(text).code, code, "{text}");
    }
    assert_eq!(refused("{\"a\": {\"b\": 1e400}}").pointer, "/a/b");
    let not_utf8 = parse(b"{\"a\": \"\xff\"}");
    assert!(matches!(not_utf8, Err(Error::Syntax(_))), "{not_utf8:?}");
}

#[test]
fn a_number_is_no_longer_than_numbers_are() {
    let digits = |count| "1".repeat(count);
    let fault = refused(&format!("{{\"a\":\n  0.{}}}", digits(LONGEST_NUMBER)));
    assert_eq!((fault.code, fault.line, fault.column), ("number_too_long", 2, 3));
    let longest = format!("[0.{}, {:?}]", digits(LONGEST_NUMBER - 2), digits(9 * LONGEST_NUMBER));
    assert!((parse(longest.as_bytes()).unwrap()[0].as_f64().unwrap() - 1.0 / 9.0).abs() < 1e-15);
}

fn shape() -> Shape {
    Shape::of(&json!({"type": "object", "additionalProperties": false, "properties": {
        "rows": {"type": "array", "maxItems": 3, "items": {
            "type": "object", "additionalProperties": false, "properties": {"z": {"type": "number"}},
        }},
        "number": {"type": "number"},
    }}))
}

#[test]
fn of_what_does_not_fit_the_shape_only_as_much_is_kept_as_shows_it() {
    let read = |text: &str| parse_as(text.as_bytes(), &shape(), &Room::default()).unwrap();
    let long = "x".repeat(5000);
    let parsed =
        read(&format!("{{\"rows\": [{{\"z\": 1, \"y\": [[]]}}, 2, [3], 4, 5], \"number\": [1, 2], {long:?}: 1}}"));
    let cut = format!("{}…", "x".repeat(LONGEST_UNKNOWN));
    let kept = json!({"rows": [{"z": 1, "y": null}, 2, [], cut_short_at(5)], "number": [], cut: null});
    assert_eq!((parsed.value, parsed.left_out), (kept, 0));
    let names: Vec<String> = (0..MOST_UNKNOWN + 7).map(|number| format!("\"n{number}\":0")).collect();
    let parsed = read(&format!("{{\"rows\":[{{{}}}],\"number\":1}}", names.join(",")));
    assert_eq!((parsed.left_out, parsed.value["number"].as_u64()), (7, Some(1)));
    assert_eq!(parsed.value["rows"][0].as_object().unwrap().len(), MOST_UNKNOWN);
}

#[test]
fn of_a_text_where_there_may_be_none_the_beginning_is_kept() {
    let shape = Shape::of(&json!({"type": "object", "properties": {
        "number": {"type": "number"},
        "choice": {"type": "string", "enum": ["one"]},
        "text": {"type": "string"},
        "either": {"oneOf": [{"type": "number"}, {"type": "string"}]},
        "rows": {"type": "array", "maxItems": 3, "items": {"type": "object", "properties": {}}},
    }}));
    let long = "\u{e9}".repeat(5000);
    for (place, kept) in [
        (json!({"number": long}), LONGEST_MISFIT),
        (json!({"choice": long}), LONGEST_MISFIT),
        (json!({"rows": long}), LONGEST_MISFIT),
        (json!({"text": long}), long.len()),
        (json!({"either": long}), long.len()),
        (json!({"rows": {"csv": long}}), long.len()),
    ] {
        let read = parse_as(place.to_string().as_bytes(), &shape, &Room::default()).unwrap().value;
        let (name, value) = read.as_object().unwrap().iter().next().unwrap();
        let text = value.get("csv").unwrap_or(value).as_str().unwrap();
        assert_eq!((text.len(), long.starts_with(text)), (kept, true), "{name}");
    }
    // What is kept for good is charged.
    let budget = crate::engine::budget::Budget::new(4 << 20);
    let text = json!({"text": "x".repeat(1 << 20)}).to_string();
    let room = Room::of(&budget, 0);
    assert!(parse_as(text.as_bytes(), &shape, &room).is_ok() && budget.used() >= 1 << 20);
}

#[test]
fn what_is_not_kept_is_held_to_depth_and_range_all_the_same() {
    let code = |text: String| match parse_as(text.as_bytes(), &shape(), &Room::default()) {
        Err(Error::Syntax(fault)) => Some(fault.code),
        other => other.map(|_| None).unwrap(),
    };
    let nested = |depth: usize| format!("{}1{}", "[".repeat(depth), "]".repeat(depth));
    let in_field = |name: &str, depth: usize| format!("{{\"{name}\":{}}}", nested(depth - 1));
    assert_eq!(code(nested(DEEPEST)), None);
    assert_eq!(code(nested(DEEPEST + 1)), Some("nested_too_deeply"));
    for name in ["number", "unknown"] {
        assert_eq!(code(in_field(name, DEEPEST)), None, "{name}");
        assert_eq!(code(in_field(name, DEEPEST + 1)), Some("nested_too_deeply"), "{name}");
        assert_eq!(code(format!("{{\"{name}\":[1e400]}}")), Some("number_out_of_range"), "{name}");
    }
}

#[test]
fn a_body_takes_no_more_than_the_budget() {
    let budget = crate::engine::budget::Budget::new(1 << 20);
    let body = format!("[{}1]", "{\"a\":[1,2]},".repeat(10_000));
    let room = Room::of(&budget, 0);
    let refused = parse_as(body.as_bytes(), Shape::open(), &room);
    assert!(matches!(refused, Err(Error::Busy { .. })), "{refused:?}");
    assert!(budget.used() <= 1 << 20);
    drop(room);
    assert!(parse_as(body.as_bytes(), Shape::open(), &Room::default()).is_ok());
    assert_eq!(budget.used(), 0);
}

#[test]
fn whole_numbers_are_integers_however_spelled() {
    assert_eq!(parse(b"[5, 5.0, 5e0, 0.5e1]").unwrap(), json!([5, 5, 5, 5]));
    assert_eq!(parse(b"[9007199254740992, 1e20, 0.1]").unwrap(), json!([9_007_199_254_740_992_u64, 1e20, 0.1]));
    assert!(parse(b"-0.0").unwrap().as_f64().unwrap().is_sign_negative());
    assert_eq!(parse(b"\xEF\xBB\xBF{}").unwrap(), json!({}));
}

fn any_json() -> impl Strategy<Value = Value> {
    let leaf = prop_oneof![
        Just(Value::Null),
        any::<bool>().prop_map(Value::from),
        (-(1_i64 << 53)..(1_i64 << 53)).prop_map(Value::from),
        any::<f64>()
            .prop_filter_map("finite, not whole", |x| { (x.is_finite() && x.fract() != 0.0).then(|| Value::from(x)) }),
        ".*".prop_map(Value::from),
    ];
    leaf.prop_recursive(4, 32, 6, |inner| {
        prop_oneof![
            prop::collection::vec(inner.clone(), 0..6).prop_map(Value::from),
            prop::collection::btree_map(".*", inner, 0..6).prop_map(|map| Value::Object(map.into_iter().collect())),
        ]
    })
}

proptest! {
    #[test]
    fn what_serde_json_writes_is_read_back(value in any_json()) {
        prop_assert_eq!(parse(value.to_string().as_bytes()).unwrap(), value);
    }

    #[test]
    fn no_bytes_make_it_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let _ = parse(&bytes);
    }

    #[test]
    fn what_it_accepts_serde_json_accepts(text in "[\\[\\]{}\",:0-9eE.+ \\-truefalsn\\\\]{0,40}") {
        if parse(text.as_bytes()).is_ok() {
            prop_assert!(serde_json::from_str::<Value>(&text).is_ok());
        }
    }
}
