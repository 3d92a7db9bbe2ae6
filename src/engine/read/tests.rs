//! Jobs that are read, and what is wrong with those that are not.
#![allow(clippy::unwrap_used, clippy::panic)]

use super::*;
use crate::registry::toy;
use crate::text::{Language, Texts};
use proptest::prelude::*;
use serde_json::json;

fn toy() -> Arc<Entry> {
    Arc::clone(toy::registry().entry("toy-bar").unwrap())
}

fn read(entry: &Arc<Entry>, body: &Body) -> Result<Ready, Error> {
    super::read(entry, body, &Names::new(toy::shared(), names::Found::default()))
}

fn body(job: &Value) -> Body {
    Body::Json(job.to_string().into())
}

fn key(job: &Value) -> Key {
    read(&toy(), &body(job)).unwrap_or_else(|error| panic!("{job}: {error:?}")).key
}

/// Code and pointer of every fault; each must have a text that fits its values.
fn faults(job: &Value) -> Vec<(&'static str, String)> {
    let Err(Error::Invalid { findings, total }) = read(&toy(), &body(job)) else { panic!("{job} is accepted") };
    assert_eq!(findings.len(), total.min(Error::MOST_FAULTS));
    for finding in &findings {
        Texts::shared().try_finding(Language::En, "fault", finding).unwrap();
    }
    findings.into_iter().map(|finding| (finding.code, finding.pointer)).collect()
}

fn only(job: &Value) -> Finding {
    let Err(Error::Invalid { mut findings, total: 1 }) = read(&toy(), &body(job)) else {
        panic!("not one fault in {job}")
    };
    findings.remove(0)
}

fn plain() -> Value {
    json!({"length_mm": 500, "segments": [{"diameter_mm": 20}]})
}

fn with(name: &str, value: Value) -> Value {
    let mut job = plain();
    job[name] = value;
    job
}

#[test]
fn spelling_order_and_defaults_do_not_change_the_key() {
    let same = json!({
        "segments": [{"diameter_mm": 2e1}], "support": {"kind": "rigid"}, "stations": 3.0, "length_mm": 500.0,
        "youngs_modulus_n_per_mm2": 210_000.0, "measurements": [], "steady": null,
    });
    assert_eq!(key(&plain()), key(&same));
    let left_out = json!({
        "length_mm": 500, "segments": [{"diameter_mm": 20}], "youngs_modulus_n_per_mm2": null, "support": null,
        "stations": null, "measurements": null, "effects": null,
    });
    assert_eq!(key(&plain()), key(&left_out));
    let needed = with("segments", json!([{"diameter_mm": null}]));
    assert_eq!(faults(&needed), [("wrong_type", "/segments/0/diameter_mm".to_owned())]);
    assert_ne!(key(&plain()), key(&with("length_mm", json!(501))));
}

#[test]
fn a_table_gives_one_key_however_it_comes() {
    let rows = with("measurements", json!([{"z_mm": 10, "deviation_um": 12}]));
    let text = "z [cm];deviation_mm\n1;0,012\n";
    assert_eq!(key(&rows), key(&with("measurements", json!({ "csv": text }))));
    let part = FilePart { name: "measurements".to_owned(), bytes: text.into() };
    let parts = Body::Parts { job: plain().to_string().into(), files: vec![part] };
    let ready = read(&toy(), &parts).unwrap();
    assert_eq!(ready.key, key(&rows));
    assert_eq!(ready.echo().unwrap()["measurements"]["rows"], 1);
}

#[test]
fn every_fault_is_listed_at_once_at_its_own_place() {
    let job = json!({
        "lenght_mm": 500,
        "youngs_modulus_n_per_mm2": "2.1e5",
        "segments": [{"diameter_mm": 20}, {"diameter_mm": -1, "colour": "red"}, {}],
        "support": {"kind": "elastic", "compliance_um_per_n": 99, "stiffness": 3},
        "steady": {"kind": "elastik"},
        "stations": "many",
        "mode": "plane",
        "effects": [{"kind": "bar"}, {"diameter_mm": 3}],
    });
    let expected = [
        ("unknown_field", "/lenght_mm"),
        ("missing_field", "/length_mm"),
        ("wrong_type", "/youngs_modulus_n_per_mm2"),
        ("unknown_field", "/segments/1/colour"),
        ("out_of_range", "/segments/1/diameter_mm"),
        ("missing_field", "/segments/2/diameter_mm"),
        ("out_of_range", "/support/compliance_um_per_n"),
        ("unknown_field", "/support/stiffness"),
        ("unknown_kind", "/steady/kind"),
        ("wrong_type", "/stations"),
        ("not_one_of", "/mode"),
        ("missing_field", "/effects/0/diameter_mm"),
        ("missing_kind", "/effects/1/kind"),
    ];
    let mut expected: Vec<(&str, String)> = expected.map(|(code, pointer)| (code, pointer.to_owned())).to_vec();
    expected.sort_by(|a, b| a.1.cmp(&b.1));
    assert_eq!(faults(&job), expected);
}

#[test]
fn who_writes_a_word_in_place_of_an_object_is_told_its_kinds() {
    let told = |finding: &Finding| Texts::shared().finding(Language::En, "fault", finding);
    let finding = only(&with("steady", json!("soft")));
    assert_eq!(finding.code, "wrong_type");
    assert!(told(&finding).contains("expected object with kind, one of "), "{}", told(&finding));
}

#[test]
fn a_field_may_have_a_code_of_its_own() {
    assert!(faults(&with("length_mm", json!(0))).contains(&("toy_bad_length", "/length_mm".to_owned())));
    let finding = only(&with("length_mm", json!("500")));
    assert_eq!((finding.code, finding.values.get("rule")), ("toy_bad_length", Some(&"wrong_type".into())));
    assert_eq!(
        Texts::shared().finding(Language::En, "fault", &finding),
        "length_mm is of type string, expected number; write the number without quotes and with a decimal point"
    );
    assert_eq!(faults(&with("segments", json!([]))), [("toy_no_segments", "/segments".to_owned())]);
    assert_eq!(faults(&with("support", json!({"kind": "soft"}))), [("unknown_support", "/support/kind".to_owned())]);
}

#[test]
fn a_number_out_of_range_says_both_ends_the_unit_and_what_was_meant() {
    let finding = only(&with("youngs_modulus_n_per_mm2", json!(210)));
    assert_eq!((finding.value, finding.limit, finding.unit), (Some(210.0), Some(1000.0), Some("N/mm2")));
    assert_eq!(
        Texts::shared().finding(Language::En, "fault", &finding),
        "youngs_modulus_n_per_mm2 is 210 N/mm²; allowed is 1000 to 1000000 N/mm²; \
         210 looks like GPa, in N/mm² it would be 210000"
    );
    let finding = only(&with("segments", json!([{"diameter_mm": 0}])));
    assert_eq!(
        Texts::shared().finding(Language::En, "fault", &finding),
        "diameter_mm is 0 mm; allowed is above 0, at most 1000 mm"
    );
}

#[test]
fn an_unknown_name_comes_with_the_nearest() {
    let finding = only(&with("suport", json!({"kind": "rigid"})));
    assert_eq!(finding.values.get("nearest"), Some(&"support".into()));
    let finding = only(&with("steady", json!({"kind": "elastik"})));
    assert_eq!(finding.values.get("nearest"), Some(&"elastic".into()));
    let finding = only(&with("mode", json!("plane")));
    assert!(finding.values.get("allowed").is_some());
}

/// The same job as a body that is kept whole while it is read, and as one of which the heads of lists are kept.
fn small_and_large(job: &Value) -> [Body; 2] {
    let text = job.to_string();
    assert!(text.len() <= KEPT_WHOLE, "{}", text.len());
    [Body::Json(text.clone().into()), Body::Json((text + &" ".repeat(KEPT_WHOLE)).into())]
}

#[test]
fn a_large_body_has_the_faults_that_it_has_when_it_is_kept_whole() {
    let rows = |count: usize, bad: &[(usize, Value)]| {
        let mut rows = vec![json!({"z_mm": 1, "deviation_um": 2}); count];
        for (index, row) in bad {
            rows[*index] = row.clone();
        }
        with("measurements", rows.into())
    };
    let bad = [
        (3, json!({"z_mm": -1, "deviation_um": "x"})),
        (300, json!({"z_mm": 1, "deviation_um": 2, "colour": [1, 2]})),
        (1999, json!({"z_mm": null, "deviation_um": 2})),
    ];
    let mut with_more = rows(2000, &bad[1..]);
    with_more["lenght_mm"] = json!(3);
    with_more.as_object_mut().unwrap().remove("segments");
    for job in [rows(2000, &bad[..1]), rows(2000, &bad[1..]), rows(2002, &bad), with_more] {
        let [small, large] = small_and_large(&job).map(|body| match read(&toy(), &body) {
            Err(Error::Invalid { findings, total }) => (findings, total),
            _ => panic!("accepted"),
        });
        assert!(small.1 > 0);
        assert_eq!(small, large);
    }
    let [small, large] = small_and_large(&rows(2000, &[])).map(|body| read(&toy(), &body).unwrap().key);
    assert_eq!(small, large);
    let swapped = rows(2000, &[(1999, json!({"deviation_um": 2, "z_mm": 7}))]);
    let [small, large] = small_and_large(&swapped).map(|body| read(&toy(), &body).unwrap().key);
    assert!(small == large && small != key(&rows(2000, &[])));
}

#[test]
fn a_row_beyond_the_head_of_a_text_says_its_line() {
    let lines: String = (0..400).map(|line| if line == 350 { "-3,4\n" } else { "1,2\n" }).collect();
    let finding = only(&with("measurements", json!({"csv": format!("z_mm,deviation_um\n{lines}")})));
    assert_eq!((finding.code, finding.pointer.as_str()), ("out_of_range", "/measurements/350/z_mm"));
    assert_eq!(finding.values.get("line"), Some(&352.0.into()));
}

#[test]
fn a_row_from_a_text_says_its_line() {
    let job = with("measurements", json!({"csv": "z_mm,deviation_um\n\n1,2\n\n-3,4\n"}));
    let finding = only(&job);
    assert_eq!((finding.code, finding.pointer.as_str()), ("out_of_range", "/measurements/1/z_mm"));
    assert_eq!(finding.values.get("line"), Some(&5.0.into()));
    let unreadable = with("measurements", json!({"csv": "z_mm,deviation_um\n1,x\n"}));
    assert_eq!(faults(&unreadable), [("bad_cell", "/measurements/0/deviation_um".to_owned())]);
}

#[test]
fn rules_between_fields_come_after_the_schema() {
    let job = with("segments", json!([{"diameter_mm": 600}, {"diameter_mm": 20}, {"diameter_mm": 700}]));
    assert_eq!(
        faults(&job),
        [
            ("thicker_than_long", "/segments/0/diameter_mm".to_owned()),
            ("thicker_than_long", "/segments/2/diameter_mm".to_owned())
        ]
    );
}

#[test]
fn rules_are_checked_too_where_the_schema_is_broken_elsewhere() {
    let mut job = with("segments", json!([{"diameter_mm": 600}]));
    job["length_mm"] = json!(-5);
    let codes: Vec<&str> = faults(&job).into_iter().map(|fault| fault.0).collect();
    assert_eq!(codes, ["toy_bad_length", "thicker_than_long"]);
}

#[test]
fn a_thousand_bad_rows_are_counted_and_a_hundred_listed() {
    let rows: Vec<Value> = (0..2000).map(|_| json!({"z_mm": -1, "deviation_um": "x"})).collect();
    let Err(Error::Invalid { findings, total }) = read(&toy(), &body(&with("measurements", rows.into()))) else {
        panic!("accepted")
    };
    assert_eq!((findings.len(), total), (100, 4000));
    assert_eq!(findings[99].pointer, "/measurements/49/z_mm");
}

#[test]
fn items_are_checked_wherever_their_array_is_and_none_beyond_its_most() {
    let several = |places: Value| json!({"kind": "several", "places_mm": places});
    let job = with("effects", json!([several(json!([1, -1, "x"])), several(json!([0, 0, 0, -1]))]));
    let expected = [
        ("out_of_range", "/effects/0/places_mm/1"),
        ("wrong_type", "/effects/0/places_mm/2"),
        ("too_many_items", "/effects/1/places_mm"),
    ];
    assert_eq!(faults(&job), expected.map(|(code, pointer)| (code, pointer.to_owned())));
    key(&with("support", several(json!([1, 2, 3]))));
}

#[test]
fn a_hostile_body_costs_no_more_than_its_bytes() {
    let fields: serde_json::Map<String, Value> = (0..50_000).map(|i| (format!("f{i}"), Value::Null)).collect();
    let Err(Error::Invalid { findings, total }) = read(&toy(), &body(&fields.into())) else { panic!("accepted") };
    assert_eq!((findings.len(), total), (100, 50_002));
    let many: Vec<Value> = vec![Value::Null; 1_000_000];
    let Err(Error::Invalid { total, .. }) = read(&toy(), &body(&with("segments", many.into()))) else {
        panic!("accepted")
    };
    assert_eq!(total, 1 + 5, "too many, and the first five of them bad");
}

#[test]
fn what_is_no_object_is_a_fault_of_the_whole_job() {
    for job in [json!([]), json!(3), json!(null)] {
        assert_eq!(faults(&job), [("wrong_type", String::new())]);
    }
}

#[test]
fn what_only_the_types_refuse_is_a_fault_too() {
    assert_eq!(faults(&with("stations", json!(5_000_000_000_u64))), [("not_readable", "/stations".to_owned())]);
}

/// Something like a job: right names, any values.
fn any_job() -> impl Strategy<Value = Value> {
    let leaf = prop_oneof![
        Just(Value::Null),
        any::<bool>().prop_map(Value::from),
        any::<i32>().prop_map(Value::from),
        any::<f64>().prop_map(Value::from),
        prop_oneof![Just("rigid"), Just("elastic"), Just("several"), Just("bar"), Just("z_mm;deviation_um\n1;2")]
            .prop_map(Value::from),
    ];
    let name = prop_oneof![
        Just("length_mm"),
        Just("segments"),
        Just("diameter_mm"),
        Just("support"),
        Just("kind"),
        Just("stations"),
        Just("measurements"),
        Just("csv"),
        Just("z_mm"),
        Just("effects"),
        Just("steady"),
        Just("x"),
        Just("compliance_um_per_n"),
        Just("places_mm"),
    ];
    leaf.prop_recursive(4, 40, 5, move |inner| {
        prop_oneof![
            prop::collection::vec(inner.clone(), 0..5).prop_map(Value::from),
            prop::collection::vec((name.clone(), inner), 0..6).prop_map(|fields| {
                Value::Object(fields.into_iter().map(|(name, value)| (name.to_owned(), value)).collect())
            }),
        ]
    })
}

proptest! {
    #[test]
    fn any_job_is_accepted_or_has_worded_faults(job in any_job()) {
        match read(&toy(), &body(&job)) {
            Ok(_) => {}
            Err(Error::Invalid { findings, total }) => {
                prop_assert!(total > 0 && !findings.is_empty());
                for finding in findings {
                    Texts::shared().try_finding(Language::En, "fault", &finding).unwrap();
                }
            }
            Err(other) => prop_assert!(false, "{:?}", other),
        }
    }

    #[test]
    fn the_verdict_is_that_of_the_published_schema(job in any_job()) {
        let entry = toy();
        let published = jsonschema::draft202012::new(&entry.input_document()).unwrap();
        let parsed = json::parse(job.to_string().as_bytes()).unwrap();
        let mut faults = Faults::default();
        entry.validate(&parsed, &mut faults);
        // CSV has become rows before the service validates.
        let has_csv = parsed.pointer("/measurements/csv").is_some();
        prop_assert!(has_csv || published.is_valid(&parsed) == (faults.total == 0));
    }

    #[test]
    fn fields_that_differ_give_keys_that_differ(a in 1.0..20000.0_f64, b in 1.0..20000.0_f64) {
        let job = |length: f64| with("length_mm", json!(length));
        let small = |length: f64| length < 20.0;
        prop_assume!(!small(a) && !small(b));
        prop_assert_eq!(key(&job(a)) == key(&job(b)), a.to_bits() == b.to_bits());
    }
}
