//! What a registry makes of a declaration.

#![allow(clippy::unwrap_used, clippy::panic)]

use precut_calc::calculator::{Answer, Cost, Failure, Figure, Meta, Monitor, Table};
use serde_json::{Value, json};

use super::toy::{Toy, ToyInput, ToyOutput};
use super::*;
use crate::text::{Language, Texts};

/// The toy under another name.
struct Renamed<const NAME: usize>;

const NAMES: [&str; 9] = ["jobs", "results", "studies", "models", "machines", "tools", "other-toy", "Toy", "toy bar"];

impl<const NAME: usize> Calculator for Renamed<NAME> {
    type Input = ToyInput;
    type Output = ToyOutput;
    const META: Meta = Meta { id: NAMES[NAME], ..Toy::META };
    fn fill(input: &mut ToyInput) {
        Toy::fill(input);
    }
    fn cost(input: &ToyInput) -> Cost {
        Toy::cost(input)
    }
    fn run(input: &ToyInput, monitor: &dyn Monitor) -> Result<Answer<ToyOutput>, Failure> {
        Toy::run(input, monitor)
    }
    fn figures(input: &ToyInput, output: &ToyOutput) -> Vec<Figure> {
        Toy::figures(input, output)
    }
    fn tables(input: &ToyInput, output: &ToyOutput) -> Vec<Table> {
        Toy::tables(input, output)
    }
}

#[test]
fn one_line_makes_a_calculator_known() {
    let registry = Registry::with(|offered| {
        offered.calculator::<Toy>();
        offered.calculator::<Renamed<6>>();
    })
    .unwrap();
    let ids: Vec<&str> = registry.entries().iter().map(|entry| entry.meta().id).collect();
    assert_eq!(ids, ["toy-bar", "other-toy"]);
    assert_eq!(registry.nearest("other_toy"), Some("other-toy"));
    assert_eq!(registry.entry("other-toy").unwrap().table_names(), ["measurements"]);
}

#[test]
fn everything_can_be_made_of_the_contracts_and_they_fit_together() {
    for registry in [Registry::standard().unwrap(), toy::registry()] {
        registry.verify().unwrap();
    }
}

#[test]
fn a_route_of_the_service_is_no_calculator() {
    let errors = [
        Registry::with(Registrar::calculator::<Renamed<0>>),
        Registry::with(Registrar::calculator::<Renamed<1>>),
        Registry::with(Registrar::calculator::<Renamed<2>>),
        Registry::with(Registrar::calculator::<Renamed<3>>),
        Registry::with(Registrar::calculator::<Renamed<4>>),
        Registry::with(Registrar::calculator::<Renamed<5>>),
    ];
    for (error, name) in errors.into_iter().zip(RESERVED) {
        assert_eq!(error.unwrap_err(), RegistryError::Reserved(name));
    }
    let bad = Registry::with(Registrar::calculator::<Renamed<7>>).unwrap_err();
    assert_eq!(bad, RegistryError::BadId("Toy"));
    let bad = Registry::with(Registrar::calculator::<Renamed<8>>).unwrap_err();
    assert_eq!(bad, RegistryError::BadId("toy bar"));
    let twice = Registry::with(|offered| {
        offered.calculator::<Toy>();
        offered.calculator::<Toy>();
    });
    assert_eq!(twice.unwrap_err(), RegistryError::Twice("toy-bar"));
}

/// Every object schema inside.
fn objects<'a>(schema: &'a Value, found: &mut Vec<&'a Value>) {
    match schema {
        Value::Object(map) => {
            if map.get("type").is_some_and(|kind| kind == "object") && map.contains_key("properties") {
                found.push(schema);
            }
            map.values().for_each(|part| objects(part, found));
        }
        Value::Array(parts) => parts.iter().for_each(|part| objects(part, found)),
        _ => {}
    }
}

#[test]
fn every_object_of_a_job_is_closed_in_the_published_schema() {
    for registry in [Registry::standard().unwrap(), toy::registry()] {
        for entry in registry.entries() {
            let mut found = Vec::new();
            let document = entry.input_document();
            objects(&document, &mut found);
            for object in found {
                assert!(object.get("additionalProperties").is_some(), "{}: {object}", entry.meta().id);
            }
        }
    }
}

#[test]
fn a_newtype_variant_is_one_object_with_its_tag() {
    let registry = toy::registry();
    let document = registry.entry("toy-bar").unwrap().input_document();
    let variants = document["$defs"]["ToySupport"]["oneOf"].as_array().unwrap();
    let bar = variants.iter().find(|variant| variant["properties"]["kind"]["enum"] == json!(["bar"])).unwrap();
    assert_eq!(bar["properties"]["diameter_mm"]["x-unit"], "mm");
    assert_eq!(bar["additionalProperties"], false);
    assert_eq!(bar.get("allOf"), None);
}

#[test]
fn the_document_stands_alone_and_the_contract_says_the_same() {
    let registry = toy::registry();
    let entry = registry.entry("toy-bar").unwrap();
    let document = entry.input_document();
    let text = document.to_string();
    assert!(!text.contains("#/components"), "{text}");
    for (name, component) in registry.components() {
        let component =
            serde_json::to_value(component).unwrap().to_string().replace("#/components/schemas/", "#/$defs/");
        let defined = &document["$defs"][&name];
        // The order of extensions is lost in utoipa's hash map.
        assert_eq!(serde_json::from_str::<Value>(&component).unwrap(), *defined, "{name}");
    }
}

#[test]
fn every_rule_of_a_schema_has_its_code_and_its_words() {
    let cases = [
        (json!({"type": "string", "minLength": 2}), json!("a"), "text_too_short"),
        (json!({"type": "string", "maxLength": 2}), json!("abc"), "text_too_long"),
        (json!({"type": "string", "pattern": "^a"}), json!("b"), "bad_pattern"),
        (json!({"type": "array", "minItems": 2}), json!([1]), "too_few_items"),
        (json!({"type": "array", "maxItems": 0}), json!([1]), "too_many_items"),
        (json!({"type": "array", "uniqueItems": true}), json!([1, 1]), "duplicate_items"),
        (json!({"type": "object", "minProperties": 1}), json!({}), "too_few_fields"),
        (json!({"type": "object", "maxProperties": 0}), json!({"a": 1}), "too_many_fields"),
        (json!({"type": "number", "multipleOf": 2}), json!(3), "not_a_multiple"),
        (json!({"oneOf": [{"minimum": 3}, {"minimum": 4}]}), json!(1), "no_variant"),
        (json!({"not": {"type": "number"}}), json!(1), "not_allowed"),
        (json!({"const": "a"}), json!("b"), "not_one_of"),
        (json!({"type": "string", "enum": ["a"]}), json!("b"), "not_one_of"),
        (json!({"type": "number", "minimum": 0}), json!(-1), "out_of_range"),
        (json!({"type": "number", "exclusiveMaximum": 0, "minimum": -1, "x-unit": "mm"}), json!(0), "out_of_range"),
        (json!({"type": "number", "exclusiveMinimum": 0, "exclusiveMaximum": 1}), json!(7), "out_of_range"),
        (json!({"type": ["number", "null"]}), json!("x"), "wrong_type"),
        (json!({"type": "string"}), json!(3), "wrong_type"),
    ];
    for (schema, value, code) in cases {
        let schema = json!({"type": "object", "properties": {"field": schema}});
        let checker = checker::Checker::new(schema.clone()).unwrap();
        let mut faults = Faults::default();
        checker.check(&json!({ "field": value }), "", &mut faults);
        let [finding] = faults.listed.as_slice() else { panic!("{schema}: {faults:?}") };
        assert_eq!((finding.code, finding.pointer.as_str()), (code, "/field"));
        let words = Texts::shared().try_finding(Language::En, "fault", finding).unwrap();
        assert!(words.contains("field") && !words.contains("  "), "{words}");
        let is_number_for_text = code == "wrong_type" && value.is_number();
        assert_eq!(words.ends_with("write it in quotes: \"3\""), is_number_for_text, "{words}");
    }
}

/// A job that names a calculator is held against that calculator's form alone; the published schema is one of them all.
#[test]
fn the_members_of_a_family_find_what_its_whole_schema_finds() {
    let registry = Registry::standard().unwrap();
    let family = registry.entry("diagnosis").unwrap();
    let whole = checker::Checker::new(family.strict_input().clone()).unwrap();
    let listed = |faults: Faults| {
        let mut listed = faults.listed;
        listed.sort_by(by_pointer);
        (listed, faults.total)
    };
    let mut jobs = vec![json!(null), json!([1]), json!({}), json!({"calculator": 3}), json!({"calculator": "shaft"})];
    for example in family.meta().examples {
        let job: Value = serde_json::from_str(example.job).unwrap();
        let fields: Vec<String> = job.as_object().unwrap().keys().cloned().collect();
        for field in fields {
            for value in [json!(null), json!(-1), json!("x"), json!({}), json!([{"kind": "none"}])] {
                let mut changed = job.clone();
                changed[&field] = value;
                jobs.push(changed);
            }
            let mut without = job.clone();
            without.as_object_mut().unwrap().remove(&field);
            jobs.push(without);
        }
        jobs.push(job);
    }
    for job in jobs {
        let (mut by_member, mut by_whole) = (Faults::default(), Faults::default());
        family.validate(&job, &mut by_member);
        whole.check(&job, "", &mut by_whole);
        assert_eq!(listed(by_member), listed(by_whole), "{job}");
    }
}
