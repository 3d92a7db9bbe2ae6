//! Every fault of names and records, at its place.

use precut_calc::calculator::{Finding, Value as Told};
use precut_library::record::{Kind, Record, faults, schema, settle};
use precut_library::resolve::{FAULT_CODES, WARNING_CODES};
use precut_library::{Lookup, asked, resolve};
use serde_json::{Value, json};

use super::resolution::named;

const DEFLECTION: &str = "deflection-compensation";

fn turning(change: &Value) -> Value {
    let mut job = json!({
        "machine": "cnc_slant_bed_medium", "tool": "cnmg120408_pclnr2525m12", "material": "42crmo4",
        "shaft": {"segments": [{"length_mm": 300, "diameter_mm": 40, "stock_diameter_mm": 42}]},
        "supports": [{"kind": "chuck", "z_mm": 0}], "force": {"kind": "kienzle", "normal_force": "judged"},
        "cut": {"feed_mm_per_rev": 0.25, "speed_m_per_min": 180},
    });
    for (name, value) in change.as_object().unwrap() {
        job[name] = value.clone();
    }
    job
}

fn found(calculator: &str, change: &Value) -> Vec<Finding> {
    let mut job = turning(change);
    let resolution = named(calculator, &mut job);
    for fault in &resolution.faults {
        let general = ["missing_field", "unknown_field", "out_of_range", "wrong_type"];
        assert!(FAULT_CODES.contains(&fault.code) || general.contains(&fault.code), "{}", fault.code);
    }
    for warning in &resolution.warnings {
        assert!(WARNING_CODES.contains(&warning.code), "{}", warning.code);
    }
    resolution.faults
}

fn only(change: &Value) -> Finding {
    let mut faults = found(DEFLECTION, change);
    assert_eq!(faults.len(), 1, "{change}: {faults:?}");
    faults.remove(0)
}

fn is(fault: &Finding, code: &str, pointer: &str) {
    assert_eq!((fault.code, fault.pointer.as_str()), (code, pointer), "{fault:?}");
}

fn words(fault: &Finding, name: &str) -> Vec<String> {
    match fault.values.get(name) {
        Some(Told::List(items)) => items
            .iter()
            .filter_map(|item| match item {
                Told::Text(text) => Some(text.to_string()),
                _ => None,
            })
            .collect(),
        Some(Told::Text(text)) => vec![text.to_string()],
        _ => Vec::new(),
    }
}

#[test]
fn the_sound_job_has_no_fault() {
    assert_eq!(found(DEFLECTION, &json!({})), []);
}

#[test]
fn unknown_names_tell_the_nearest() {
    let fault = only(&json!({"machine": "cnc_slant_bed_mediom"}));
    is(&fault, "unknown_machine", "/machine");
    assert_eq!(words(&fault, "nearest")[0], "cnc_slant_bed_medium");
    let fault = only(&json!({"tool": {"name": "cnmg120408_pclnr2525m"}}));
    is(&fault, "unknown_tool", "/tool/name");
    let fault = only(&json!({"material": "1.7226"}));
    is(&fault, "unknown_material", "/material");
    assert!(words(&fault, "nearest").contains(&"1.7225".to_owned()), "{fault:?}");
    let fault = only(&json!({"material": "42crmo4@9"}));
    is(&fault, "unknown_revision", "/material");
}

#[test]
fn what_the_keeper_of_records_says_is_told() {
    for (lookup, code) in [
        (Lookup::Deleted, "deleted_record"),
        (Lookup::UnknownRevision { last: 4 }, "unknown_revision"),
        (Lookup::Ambiguous { candidates: vec!["a".to_owned(), "b".to_owned()] }, "ambiguous_material"),
    ] {
        let mut job = json!({"material": "x@9"});
        let asked = asked(DEFLECTION, &job);
        let resolution = resolve(DEFLECTION, &mut job, &[(asked[0].clone(), lookup)]);
        is(&resolution.faults[0], code, "/material");
    }
}

#[test]
fn codes_are_refused_at_their_place() {
    for (tool, code, pointer) in [
        (json!({"insert": "QNMG120408", "holder": "PCLNR2525M12"}), "bad_insert_shape", "/tool/insert"),
        (json!({"insert": "CXMG120408", "holder": "PCLNR2525M12"}), "bad_insert_clearance", "/tool/insert"),
        (json!({"insert": "CNZG120408", "holder": "PCLNR2525M12"}), "bad_insert_tolerance", "/tool/insert"),
        (json!({"insert": "CNMY120408", "holder": "PCLNR2525M12"}), "bad_insert_type", "/tool/insert"),
        (json!({"insert": "CNMG121508", "holder": "PCLNR2525M12"}), "bad_insert_thickness", "/tool/insert"),
        (json!({"insert": "CNMG1204M0", "holder": "PCLNR2525M12"}), "bad_insert_corner", "/tool/insert"),
        (json!({"insert": "CNMG12", "holder": "PCLNR2525M12"}), "bad_insert_code", "/tool/insert"),
        (json!({"insert": "CNMG120408", "holder": "PCZNR2525M12"}), "unknown_holder_style", "/tool/holder"),
        (json!({"insert": "CNMG120408", "holder": "PCLN"}), "bad_holder_code", "/tool/holder"),
        (json!({"insert": "CNMG120408", "holder": "PDJNR2525M15"}), "insert_does_not_fit_holder", "/tool/insert"),
        (json!({"insert": "SNMG120408", "holder": "PSLNR2525M12"}), "no_minor_edge_clearance", "/tool/holder"),
        (json!({"insert": "CNMG120408", "holder": "PCKNR2525M12"}), "holder_for_facing", "/tool"),
    ] {
        let faults = found(DEFLECTION, &json!({"tool": tool}));
        assert!(faults.iter().any(|fault| fault.code == code && fault.pointer == pointer), "{tool}: {faults:?}");
    }
    let fault = &found(DEFLECTION, &json!({"tool": {"insert": "QNMG120408"}}))[0];
    assert!(words(fault, "allowed").contains(&"C".to_owned()));
}

#[test]
fn machines_have_limits() {
    let long = only(&json!({"shaft": {"segments": [{"length_mm": 9000, "diameter_mm": 40, "stock_diameter_mm": 42}]}}));
    is(&long, "above_machine_limit", "/shaft/segments");
    assert_eq!((long.value, long.unit), (Some(9000.0), Some("mm")));
    let thick = only(&json!({"shaft": {"segments": [{"length_mm": 90, "diameter_mm": 4000}]}}));
    is(&thick, "above_machine_limit", "/shaft/segments");
    let fast = only(&json!({"cut": {"feed_mm_per_rev": 0.25, "spindle_speed_rpm": 9000}}));
    is(&fast, "above_machine_limit", "/cut/spindle_speed_rpm");
    assert_eq!((fast.value, fast.limit), (Some(9000.0), Some(4500.0)));
    let quick = only(&json!({"cut": {"feed_mm_per_rev": 0.25, "speed_m_per_min": 900}}));
    is(&quick, "above_machine_limit", "/cut/speed_m_per_min");
    assert!(quick.limit.is_some_and(|limit| (limit - 593.76).abs() < 0.01), "{quick:?}");
}

#[test]
fn machines_and_tools_are_of_a_kind() {
    is(&only(&json!({"machine": "hmc_bt50"})), "wrong_kind_of_machine", "/machine");
    is(&only(&json!({"tool": "endmill_10_z4"})), "wrong_kind_of_tool", "/tool");
    let faults = found("fixture-stability", &json!({}));
    let codes: Vec<&str> = faults.iter().map(|fault| fault.code).collect();
    assert_eq!(codes, ["wrong_kind_of_machine", "wrong_kind_of_tool"]);
}

#[test]
fn a_force_needs_its_law() {
    let hard = only(&json!({"material": "100cr6_60hrc"}));
    is(&hard, "material_without_force_law", "/material");
    assert!(hard.values.get("without_exponent").is_some());
    is(&only(&json!({"material": "az31b"})), "material_without_force_law", "/material");
    is(
        &only(&json!({"material": "ti_6al_4v", "force": {"kind": "handbook"}})),
        "material_without_force_law",
        "/material",
    );
    let silent = only(&json!({"force": {"kind": "kienzle"}}));
    is(&silent, "passive_force_missing", "/force/specific_normal_force_n_per_mm2");
    is(
        &only(&json!({"force": {"kind": "kienzle", "normal_force": "guessed"}})),
        "passive_force_missing",
        "/force/specific_normal_force_n_per_mm2",
    );
    let row = only(&json!({"force": {"kind": "kienzle", "normal_force": "judged", "kienzle_row": 77}}));
    is(&row, "unknown_kienzle_row", "/force/kienzle_row");
    let source = only(&json!({"force": {"kind": "kienzle", "normal_force": "judged", "source": "nobody"}}));
    is(&source, "unknown_kienzle_row", "/force/source");
    assert!(words(&source, "allowed").contains(&"iscar_2017".to_owned()));
}

#[test]
fn limits_that_do_not_meet_tell_the_diameter_that_would_do() {
    let mut job = json!({
        "machine": "roll_lathe_stiff", "tool": "cnmg120408_pclnr2525m12", "material": "34crmo4", "cut_kind": "medium",
        "zones": [{"id": "a", "z_start_mm": 0, "z_end_mm": 50, "depth_mm": 1, "diameter_mm": 60}],
    });
    let resolution = named("feed-schedule", &mut job);
    let fault = &resolution.faults[0];
    is(fault, "limits_do_not_meet", "/zones/0/diameter_mm");
    let Some(Told::Number(diameter)) = fault.values.get("diameter_mm") else { panic!("{fault:?}") };
    job = json!({
        "machine": "roll_lathe_stiff", "tool": "cnmg120408_pclnr2525m12", "material": "34crmo4", "cut_kind": "medium",
        "zones": [{"id": "a", "z_start_mm": 0, "z_end_mm": 50, "depth_mm": 1, "diameter_mm": diameter * 1.000_001}],
    });
    assert!(named("feed-schedule", &mut job).faults.is_empty(), "the diameter told does");
}

#[test]
fn a_schedule_without_a_range_is_told_what_there_is() {
    let schedule = |change: Value| {
        let mut job = json!({
            "tool": "cnmg120408_pclnr2525m12", "material": "34crmo4",
            "zones": [{"id": "a", "z_start_mm": 0, "z_end_mm": 50, "depth_mm": 1, "diameter_mm": 60}],
        });
        change.as_object().unwrap().iter().for_each(|(name, value)| job[name] = value.clone());
        named("feed-schedule", &mut job).faults
    };
    let limits = json!({"feed_min_mm_per_rev": 0.1, "feed_max_mm_per_rev": 0.3, "speed_min_m_per_min": 100, "speed_max_m_per_min": 200});
    for (change, codes) in [
        (json!({}), vec!["no_recommended_feed", "no_recommended_speed"]),
        (json!({"cut_kind": "slow"}), vec!["no_recommended_feed", "no_recommended_speed"]),
        (json!({"cut_kind": "slow", "limits": limits}), vec!["no_recommended_feed"]),
        (json!({"tool": {"insert": "CNMG120408", "holder": "PCLNL2525M12"}, "limits": limits}), vec![]),
        (json!({"cut_kind": "medium"}), vec![]),
    ] {
        let faults = schedule(change.clone());
        assert_eq!(faults.iter().map(|fault| fault.code).collect::<Vec<_>>(), codes, "{change}");
        // What is told can be chosen.
        for fault in &faults {
            for word in words(fault, "allowed") {
                let chosen = match fault.code {
                    "no_recommended_feed" => json!({"cut_kind": word}),
                    _ => json!({"tool": {"name": "cnmg120408_pclnr2525m12", "speed_tool": word}, "cut_kind": "medium"}),
                };
                assert!(schedule(chosen.clone()).iter().all(|left| left.code != fault.code), "{chosen}");
            }
        }
    }
    assert_eq!(
        named("feed-schedule", &mut json!({"tool": "cnmg120408_pclnr2525m12", "material": "34crmo4"})).faults,
        []
    );
}

#[test]
fn what_a_job_says_over_a_record_is_checked() {
    for (tool, code, pointer) in [
        (json!({"name": "bar_a25_pclnr12"}), "missing_field", "/tool/overhang_mm"),
        (json!({"name": "cnmg120408_pclnr2525m12", "nose_radus_mm": 1}), "unknown_field", "/tool/nose_radus_mm"),
        (json!({"name": "cnmg120408_pclnr2525m12", "nose_radius_mm": -1}), "out_of_range", "/tool/nose_radius_mm"),
        (json!({"name": "cnmg120408_pclnr2525m12", "nose_radius_mm": []}), "wrong_type", "/tool/nose_radius_mm"),
        (json!({"name": "cnmg120408_pclnr2525m12", "overhang_mm": 50}), "unknown_field", "/tool/overhang_mm"),
    ] {
        is(&only(&json!({"tool": tool})), code, pointer);
    }
    let rest = only(
        &json!({"supports": [{"kind": "chuck", "z_mm": 0}, {"kind": "steady_rest", "z_mm": 100, "rest": "front"}]}),
    );
    is(&rest, "unknown_rest", "/supports/1/rest");
}

#[test]
fn all_faults_come_at_once() {
    let faults = found(
        DEFLECTION,
        &json!({"machine": "nothing_like_it", "tool": {"insert": "QNMG120408"}, "material": "az31b"}),
    );
    let codes: Vec<&str> = faults.iter().map(|fault| fault.code).collect();
    assert_eq!(codes, ["unknown_machine", "bad_insert_shape", "material_without_force_law"]);
}

fn of_record(kind: Kind, mut value: Value) -> (bool, Vec<String>) {
    settle(kind, &mut value);
    let valid = jsonschema::draft202012::new(&schema(kind)).unwrap().is_valid(&value);
    (valid, faults(kind, &value).into_iter().map(|fault| format!("{} {}", fault.code, fault.pointer)).collect())
}

#[test]
fn records_are_held_against_schema_and_rules() {
    let fine = |kind, value: Value| assert_eq!(of_record(kind, value.clone()), (true, vec![]), "{value}");
    fine(
        Kind::Machine,
        json!({"kind": "lathe", "compliance": {"carriage_um_per_n": 0.03, "tailstock_centre_um_per_n": null}}),
    );
    fine(Kind::Tool, json!({"kind": "turning_external", "RE": 0.8, "KAPR": 95, "note": "mine", "tags": ["left"]}));
    fine(
        Kind::Material,
        json!({"youngs_modulus_n_per_mm2": 210_000, "kienzle": [{"specific_cutting_force_n_per_mm2": 2000, "cutting_exponent": 0.25}]}),
    );
    let refused = |kind, value: Value| assert!(!of_record(kind, value.clone()).0, "{value}");
    refused(Kind::Machine, json!({"kind": "robot"}));
    refused(Kind::Machine, json!({"kind": "lathe", "compliance": {"carriage_um_per_n": -0.03}}));
    refused(Kind::Machine, json!({"kind": "lathe", "complaince": {}}));
    refused(Kind::Material, json!({"youngs_modulus_n_per_mm2": 210}));
    refused(Kind::Material, json!({"poisson_ratio": 0.7}));
    refused(Kind::Tool, json!({"kind": "turning_external", "RE": 0.8, "nose_radius_mm": 0.4}));
    let told = |kind, value: Value| of_record(kind, value).1;
    assert_eq!(
        told(
            Kind::Machine,
            json!({"kind": "lathe", "compliance": {"single_stiffness_n_per_mm": 20_000, "carriage_um_per_n": 0.1},
            "spindle": {"speed_min_rpm": 100, "speed_max_rpm": 10, "characteristic": [{"spindle_speed_rpm": 5}, {"spindle_speed_rpm": 5}]}})
        ),
        [
            "stiffness_meaning_missing /compliance/meaning",
            "compliance_or_single_stiffness /compliance/carriage_um_per_n",
            "ends_reversed /spindle/speed_min_rpm",
            "characteristic_not_rising /spindle/characteristic/1/spindle_speed_rpm",
        ]
    );
    assert_eq!(
        told(
            Kind::Material,
            json!({"density_kg_per_m3": {"value": 7850, "low": 7900, "high": 7800}, "taylor": [{"form": "handbook", "tool": "hss", "life_exponent": 0.2}]})
        ),
        [
            "value_outside_its_ends /density_kg_per_m3/low",
            "value_outside_its_ends /density_kg_per_m3/high",
            "missing_field /taylor/0/coefficient",
            "missing_field /taylor/0/depth_exponent",
            "missing_field /taylor/0/feed_exponent",
        ]
    );
    assert_eq!(told(Kind::Tool, json!({"kind": "turning_external", "insert": "CNMG1204"})), Vec::<String>::new());
    assert_eq!(
        told(Kind::Tool, json!({"kind": "turning_external", "insert": "XNMG120408"})),
        ["bad_insert_shape /insert"]
    );
}

#[test]
fn a_short_record_is_written_out() {
    let mut value = json!({"kind": "turning_external", "RE": 0.8, "iso513_grade": "P25"});
    settle(Kind::Tool, &mut value);
    let user = |value: Value| json!({"value": value, "source": "user", "certainty": "user"});
    assert_eq!(
        value,
        json!({"kind": "turning_external", "iso513_grade": user(json!("P25")), "nose_radius_mm": user(json!(0.8))})
    );
    let settled = value.clone();
    settle(Kind::Tool, &mut value);
    assert_eq!(value, settled);
    let record = Record { kind: Kind::Tool, name: "mine".to_owned(), value };
    assert_eq!(record.number(&["nose_radius_mm"]).map(|number| number.certainty), Some("user"));
    assert_eq!(record.word(&["iso513_grade"]), Some("P25"));
}
