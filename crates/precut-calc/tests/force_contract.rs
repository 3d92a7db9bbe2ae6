//! What the contract says of force models, and what they refuse.
#![allow(clippy::unwrap_used, missing_docs)]

use precut_calc::calculator::Violations;
use precut_calc::force::{FAULT_CODES, ForceModel};
use serde_json::{Value, json};
use utoipa::openapi::{RefOr, Schema};
use utoipa::{PartialSchema, ToSchema};

/// Every object schema of the contract of a force model.
fn objects() -> Vec<Value> {
    let mut components: Vec<(String, RefOr<Schema>)> = Vec::new();
    ForceModel::schemas(&mut components);
    let root = serde_json::to_value(ForceModel::schema()).unwrap();
    let mut found: Vec<Value> = root["oneOf"].as_array().unwrap().clone();
    found.extend(components.into_iter().map(|(_, schema)| serde_json::to_value(schema).unwrap()));
    found.retain(|schema| schema["type"] == "object");
    found
}

fn is_number(schema: &Value) -> bool {
    let kind = &schema["type"];
    kind == "number" || kind.as_array().is_some_and(|kinds| kinds.contains(&json!("number")))
}

#[test]
fn every_number_has_description_unit_symbol_group_range_and_example() {
    let objects = objects();
    assert!(objects.len() >= 8);
    let mut numbers = 0;
    for object in &objects {
        assert_eq!(object["additionalProperties"], json!(false), "{object}");
        for (name, field) in object["properties"].as_object().unwrap() {
            if !is_number(field) {
                continue;
            }
            numbers += 1;
            for key in ["description", "x-unit", "x-symbol", "x-group", "example"] {
                assert!(!field[key].is_null(), "{name} has no {key}");
            }
            let bounded = |keys: [&str; 2]| keys.iter().any(|key| !field[key].is_null());
            assert!(bounded(["minimum", "exclusiveMinimum"]) && bounded(["maximum", "exclusiveMaximum"]), "{name}");
            let required = object["required"].as_array().is_some_and(|all| all.contains(&json!(name)));
            let optional = field["type"].is_array();
            assert!(required || optional || !field["default"].is_null(), "{name} is left out with no default");
        }
    }
    assert!(numbers > 30);
}

#[test]
fn choices_carry_their_kind_and_references_exist() {
    let root = serde_json::to_value(ForceModel::schema()).unwrap();
    let kinds: Vec<&str> = root["oneOf"]
        .as_array()
        .unwrap()
        .iter()
        .map(|one| one["properties"]["kind"]["enum"][0].as_str().unwrap())
        .collect();
    assert_eq!(kinds, ["power_law", "handbook", "kienzle", "constant", "table"]);
    assert!(root["oneOf"].as_array().unwrap().iter().all(|one| one["required"][0] == "kind"));
    let mut components: Vec<(String, RefOr<Schema>)> = Vec::new();
    ForceModel::schemas(&mut components);
    let names: Vec<&str> = components.iter().map(|(name, _)| name.as_str()).collect();
    let text = format!("{root}{}", objects().iter().map(ToString::to_string).collect::<String>());
    for reference in text.split("#/components/schemas/").skip(1) {
        let name = reference.split('"').next().unwrap();
        assert!(names.contains(&name), "{name} is not among {names:?}");
    }
}

/// Code and pointer of each fault.
fn faults(job: Value) -> Vec<(String, String)> {
    let model: ForceModel = serde_json::from_value(job).unwrap();
    let mut violations = Violations::default();
    model.check("/force", &mut violations);
    let found = violations.into_vec();
    assert!(found.iter().all(|finding| FAULT_CODES.contains(&finding.code)));
    found.into_iter().map(|finding| (finding.code.to_owned(), finding.pointer)).collect()
}

fn term() -> Value {
    json!({"coefficient": 2430.0, "depth_exponent": 0.9, "feed_exponent": 0.6, "speed_exponent": -0.3})
}

#[test]
fn bad_power_laws_are_refused_at_their_field() {
    for (name, value) in [
        ("coefficient", 0.0),
        ("coefficient", -1.0),
        ("depth_exponent", -0.1),
        ("correction_factor", 0.0),
        ("constant_n", -1.0),
    ] {
        let mut bad = term();
        bad[name] = json!(value);
        for component in ["passive", "main"] {
            let mut job = json!({"kind": "power_law", "passive": term()});
            job[component] = bad.clone();
            assert_eq!(faults(job), [("bad_power_law".to_owned(), format!("/force/{component}/{name}"))]);
        }
    }
    let range = json!({
        "least_depth_mm": 2.0, "largest_depth_mm": 1.0, "least_feed_mm_per_rev": 0.1, "largest_feed_mm_per_rev": 0.2,
        "least_speed_m_per_min": 1.0, "largest_speed_m_per_min": 2.0,
    });
    let job = json!({"kind": "power_law", "passive": term(), "measured_range": range});
    assert_eq!(faults(job), [("bad_power_law".to_owned(), "/force/measured_range/largest_depth_mm".to_owned())]);
    assert!(faults(json!({"kind": "power_law", "passive": term()})).is_empty());
}

#[test]
fn numbers_that_are_none_are_refused() {
    let ForceModel::PowerLaw(good) = serde_json::from_value(json!({"kind": "power_law", "passive": term()})).unwrap()
    else {
        unreachable!()
    };
    for bad in [f64::NAN, f64::INFINITY] {
        let mut law = good.clone();
        law.passive.coefficient = bad;
        law.passive.depth_exponent = bad;
        law.passive.feed_exponent = bad;
        law.passive.speed_exponent = bad;
        law.wear_factor = bad;
        let mut violations = Violations::default();
        ForceModel::PowerLaw(law).check("", &mut violations);
        assert_eq!(violations.into_vec().len(), 5);
    }
}

#[test]
fn bad_kienzle_models_are_refused_at_their_field() {
    let good = json!({
        "kind": "kienzle", "cutting_edge_angle_deg": 75.0, "nose_radius_mm": 0.8,
        "specific_cutting_force_n_per_mm2": 2100.0, "cutting_exponent": 0.26,
        "specific_normal_force_n_per_mm2": 900.0, "normal_exponent": 0.35,
    });
    assert!(faults(good.clone()).is_empty());
    for (name, value, code) in [
        ("cutting_edge_angle_deg", json!(0.0), "bad_lead_angle"),
        ("cutting_edge_angle_deg", json!(120.0), "bad_lead_angle"),
        ("nose_radius_mm", json!(-0.1), "bad_nose_radius"),
        ("specific_cutting_force_n_per_mm2", json!(0.0), "bad_kienzle"),
        ("specific_normal_force_n_per_mm2", json!(-5.0), "bad_kienzle"),
        ("cutting_exponent", json!(1.0), "bad_kienzle"),
        ("normal_exponent", json!(-0.01), "bad_kienzle"),
        ("wear_factor", json!(0.0), "bad_wear_factor"),
    ] {
        let mut job = good.clone();
        job[name] = value;
        assert_eq!(faults(job), [(code.to_owned(), format!("/force/{name}"))]);
    }
    let mut both = good.clone();
    both["material"] = json!("42crmo4");
    assert_eq!(faults(both)[0].0, "kienzle_or_material");
    let mut half = good.clone();
    half.as_object_mut().unwrap().remove("cutting_exponent");
    assert_eq!(faults(half)[0].0, "kienzle_or_material");
}

#[test]
fn a_materials_name_becomes_its_numbers() {
    let job = |material: &str| {
        json!({
            "kind": "kienzle", "cutting_edge_angle_deg": 75.0, "nose_radius_mm": 0.8, "material": material,
            "specific_normal_force_n_per_mm2": 900.0, "normal_exponent": 0.35,
        })
    };
    assert_eq!(faults(job("no_such")), [("unknown_material".to_owned(), "/force/material".to_owned())]);
    assert_eq!(faults(job("steel_750")), [("material_without_force_law".to_owned(), "/force/material".to_owned())]);
    let mut model: ForceModel = serde_json::from_value(job("42crmo4")).unwrap();
    let before = model.at(0.2, 100.0);
    model.fill();
    assert_eq!(before, model.at(0.2, 100.0));
    let echoed = serde_json::to_value(&model).unwrap();
    assert_eq!(echoed["specific_cutting_force_n_per_mm2"], json!(2526.0));
    assert_eq!(echoed["cutting_exponent"], json!(0.25));
    assert_eq!(echoed["certainty"], "likely");
    assert!(echoed["material"].is_null());
    let once = model.clone();
    model.fill();
    assert_eq!(once, model);
    assert!(model.cautions("/force").is_empty());
    let titanium: ForceModel = serde_json::from_value(job("ti_6al_4v")).unwrap();
    assert_eq!(titanium.cautions("/force")[0].code, "unconfirmed_force_coefficient");
}

#[test]
fn bad_tables_and_constants_are_refused() {
    let row = |depth: f64, passive: f64| json!({"depth_mm": depth, "passive_n": passive});
    let table = |rows: Value| faults(json!({"kind": "table", "rows": rows}));
    let fault = |pointer: &str| ("bad_force_table".to_owned(), pointer.to_owned());
    assert_eq!(table(json!([])), [fault("/force/rows")]);
    assert_eq!(table(json!([row(0.0, 5.0)])), [fault("/force/rows")]);
    assert_eq!(table(json!([row(1.0, 5.0), row(1.0, 6.0)])), [fault("/force/rows/1/depth_mm")]);
    assert_eq!(table(json!([row(1.0, 5.0), row(2.0, -6.0)])), [fault("/force/rows/1/passive_n")]);
    assert_eq!(table(json!([row(-1.0, 5.0), row(2.0, 6.0)])), [fault("/force/rows/0/depth_mm")]);
    assert!(table(json!([row(0.0, 5.0), row(2.0, 6.0)])).is_empty());
    let constant = json!({"kind": "constant", "passive_n": -1.0});
    assert_eq!(faults(constant), [("bad_constant_force".to_owned(), "/force/passive_n".to_owned())]);
}

#[test]
fn unknown_fields_and_kinds_are_refused() {
    for job in [
        json!({"kind": "constant", "passive_n": 1.0, "mu": 1.2}),
        json!({"kind": "rosenberg", "passive_n": 1.0}),
        json!({"passive_n": 1.0}),
        json!({"kind": "power_law"}),
    ] {
        assert!(serde_json::from_value::<ForceModel>(job).is_err());
    }
}

#[test]
fn the_echo_is_the_job_with_its_defaults() {
    let model: ForceModel = serde_json::from_value(json!({"kind": "power_law", "passive": term()})).unwrap();
    let echoed = serde_json::to_value(&model).unwrap();
    let mut passive = term();
    passive["correction_factor"] = json!(1.0);
    passive["constant_n"] = json!(0.0);
    let expected = json!({
        "kind": "power_law", "passive": passive, "wear_factor": 1.0, "tool_material": "carbide", "origin": "given",
    });
    assert_eq!(echoed, expected);
    assert_eq!(serde_json::from_value::<ForceModel>(echoed).unwrap(), model);
}

#[test]
fn every_model_names_its_equation_and_source() {
    for job in [
        json!({"kind": "power_law", "passive": term()}),
        json!({"kind": "power_law", "passive": term(), "origin": "handbook"}),
        json!({"kind": "handbook", "material": "steel_45", "cutting_edge_angle_deg": 45.0}),
        json!({"kind": "constant", "passive_n": 1.0}),
        json!({"kind": "table", "rows": []}),
    ] {
        let model: ForceModel = serde_json::from_value(job).unwrap();
        let basis = model.basis();
        assert!(!basis.is_empty());
        assert!(basis.iter().all(|entry| entry.equation.starts_with("deflection/6.") && !entry.source.is_empty()));
    }
}
