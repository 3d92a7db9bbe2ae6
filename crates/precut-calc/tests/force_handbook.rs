//! The handbook's choice: rows, factors, what it refuses, and what it says of itself.
#![allow(clippy::unwrap_used, clippy::float_cmp, missing_docs)]

use precut_calc::calculator::{Finding, Violations};
use precut_calc::force::{FAULT_CODES, ForceModel, PowerLaw, PowerTerm, Reached, ReachedCut, WARNING_CODES};
use precut_calc::material::Certainty;
use serde_json::{Value, json};

fn coefficients() -> Value {
    let path = format!(
        "{}/tests/reference/deflection-compensation/coefficients.json",
        concat!(env!("CARGO_MANIFEST_DIR"), "/..")
    );
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// A choice with `fields` over a steel of 750 N/mm² at 45 degrees, where every factor is 1.
fn choice(fields: &Value) -> ForceModel {
    let mut job = json!({"kind": "handbook", "cutting_edge_angle_deg": 45.0});
    for (name, value) in fields.as_object().unwrap() {
        job[name] = value.clone();
    }
    if job["work_material"].is_null() && job["material"].is_null() {
        job["work_material"] = json!("steel");
        job["tensile_strength_n_per_mm2"] = fields.get("tensile_strength_n_per_mm2").cloned().unwrap_or(json!(750.0));
    }
    serde_json::from_value(job).unwrap()
}

fn faults(model: &ForceModel) -> Vec<Finding> {
    let mut violations = Violations::default();
    model.check("/force", &mut violations);
    violations.into_vec()
}

fn filled(fields: &Value) -> PowerLaw {
    let mut model = choice(fields);
    assert!(faults(&model).is_empty(), "{fields}: {:?}", faults(&model));
    let before = model.clone();
    model.fill();
    // The choice and the law that it stands for are the same force.
    assert_eq!(before.at(0.3, 90.0).forces(1.7), model.at(0.3, 90.0).forces(1.7));
    let ForceModel::PowerLaw(law) = model.clone() else { unreachable!() };
    model.fill();
    assert_eq!(model, ForceModel::PowerLaw(law.clone()), "idempotent");
    law
}

/// K_p of P_z, P_y, P_x.
fn factors(fields: &Value) -> [f64; 3] {
    let law = filled(fields);
    [law.main.unwrap(), law.passive, law.feed.unwrap()].map(|term| term.correction_factor)
}

fn assert_factors(fields: &Value, expected: [f64; 3]) {
    let got = factors(fields);
    for (got, expected) in got.iter().zip(expected) {
        assert!((got - expected).abs() < 1e-12 * expected, "{fields}: {got} instead of {expected}");
    }
}

/// Code and pointer of the only fault.
fn only_fault(fields: &Value) -> (String, String) {
    let found = faults(&choice(fields));
    assert_eq!(found.len(), 1, "{fields}: {found:?}");
    assert!(FAULT_CODES.contains(&found[0].code));
    (found[0].code.to_owned(), found[0].pointer.clone())
}

fn triple(of: &Value) -> [f64; 3] {
    [0, 1, 2].map(|i| of[i].as_f64().unwrap())
}

#[test]
fn the_reference_steel_has_the_printed_coefficients() {
    let law = filled(&json!({}));
    let numbers = |term: PowerTerm| {
        [term.coefficient, term.depth_exponent, term.feed_exponent, term.speed_exponent, term.correction_factor]
    };
    assert_eq!(numbers(law.passive), [2430.0, 0.9, 0.6, -0.3, 1.0]);
    assert_eq!(numbers(law.main.unwrap()), [3000.0, 1.0, 0.75, -0.15, 1.0]);
    assert_eq!(numbers(law.feed.unwrap()), [3390.0, 1.0, 0.5, -0.4, 1.0]);
}

#[test]
fn factors_of_lead_angle_rake_inclination_and_nose_are_those_of_the_tables() {
    let tables = coefficients();
    let mut checked = 0;
    for (table, field) in [
        ("K_lead_angle", "cutting_edge_angle_deg"),
        ("K_rake", "rake_angle_deg"),
        ("K_inclination", "inclination_deg"),
        ("K_nose_radius", "nose_radius_mm"),
    ] {
        for (printed, tool) in [("carbide", "carbide"), ("HSS", "hss")] {
            let Some(rows) = tables[table][printed].as_object() else { continue };
            for (at, values) in rows {
                // High-speed steel's rake is printed as ranges: both ends.
                let ends: Vec<f64> = match at.parse() {
                    Ok(single) => vec![single],
                    Err(_) => at.split('-').map(|end| end.parse().unwrap()).collect(),
                };
                for end in ends {
                    assert_factors(&json!({"tool_material": tool, field: end}), triple(values));
                    checked += 1;
                }
            }
        }
    }
    assert_eq!(checked, 4 + 4 + 3 + 4 + 4 + 5);
}

#[test]
fn between_the_rows_angles_are_linear_and_radii_log_log() {
    assert_factors(&json!({"cutting_edge_angle_deg": 75.0}), [0.915, 0.635, 1.14]);
    assert_factors(&json!({"rake_angle_deg": -5.0}), [1.15, 1.6, 1.6]);
    assert_factors(&json!({"inclination_deg": 10.0}), [1.0, 1.475, 0.75]);
    assert_factors(&json!({"tool_material": "hss", "rake_angle_deg": 13.0}), [1.15, 1.6, 1.7]);
    assert_factors(&json!({"tool_material": "hss", "rake_angle_deg": 17.5}), [1.075, 1.3, 1.35]);
    let middle = |a: f64, b: f64| (a * b).sqrt();
    let expected = [middle(0.93, 1.0), middle(0.82, 1.0), 1.0];
    assert_factors(&json!({"tool_material": "hss", "nose_radius_mm": 2.0_f64.sqrt()}), expected);
}

#[test]
fn factors_of_the_material_follow_strength_and_hardness() {
    let ratio = 600.0_f64 / 750.0;
    let expected = [ratio.powf(0.75), ratio.powf(1.35), ratio];
    assert_factors(&json!({"tensile_strength_n_per_mm2": 600.0}), expected);
    assert!((expected[1] - 0.74).abs() < 0.001, "the number in the text");
    let expected = [ratio.powf(0.35), ratio.powf(2.0), ratio.powf(1.5)];
    assert_factors(&json!({"tensile_strength_n_per_mm2": 600.0, "tool_material": "hss"}), expected);
    let ratio = 900.0_f64 / 750.0;
    let expected = [ratio.powf(0.75), ratio.powf(2.0), ratio.powf(1.5)];
    assert_factors(&json!({"tensile_strength_n_per_mm2": 900.0, "tool_material": "hss"}), expected);
    let ratio = 210.0_f64 / 190.0;
    let iron = json!({"work_material": "grey_iron", "brinell_hardness": 210.0});
    assert_factors(&iron, [ratio.powf(0.4), ratio, ratio.powf(0.8)]);
    let ratio = 130.0_f64 / 150.0;
    let iron = json!({"work_material": "malleable_iron", "brinell_hardness": 130.0, "tool_material": "hss"});
    assert_factors(&iron, [ratio.powf(0.55), ratio.powf(1.3), ratio.powf(1.1)]);
}

#[test]
fn factors_multiply() {
    let all = json!({
        "tensile_strength_n_per_mm2": 600.0, "cutting_edge_angle_deg": 90.0, "rake_angle_deg": 0.0, "inclination_deg": 5.0,
    });
    let ratio = 0.8_f64;
    assert_factors(
        &all,
        [0.89 * 1.1 * ratio.powf(0.75), 0.5 * 1.4 * 1.25 * ratio.powf(1.35), 1.17 * 1.4 * 0.85 * ratio],
    );
}

#[test]
fn the_library_gives_class_and_strength_and_the_job_overrides() {
    let by_name = filled(&json!({"material": "steel_45"}));
    let by_class = filled(&json!({"work_material": "steel", "tensile_strength_n_per_mm2": 600.0}));
    assert_eq!(by_name, by_class);
    let stronger = filled(&json!({"material": "steel_45", "tensile_strength_n_per_mm2": 750.0}));
    assert_eq!(stronger.passive.correction_factor, 1.0);
    let iron = filled(&json!({"material": "grey_iron_hb190"}));
    assert_eq!(iron.passive.coefficient, 540.0);
}

#[test]
fn tables_are_never_extrapolated() {
    for (fields, field, limit) in [
        (json!({"cutting_edge_angle_deg": 29.9}), "cutting_edge_angle_deg", 30.0),
        (json!({"rake_angle_deg": 10.1}), "rake_angle_deg", 10.0),
        (json!({"rake_angle_deg": -16.0}), "rake_angle_deg", -15.0),
        (json!({"rake_angle_deg": 11.0, "tool_material": "hss"}), "rake_angle_deg", 12.0),
        (json!({"inclination_deg": 15.5}), "inclination_deg", 15.0),
        (json!({"nose_radius_mm": 0.4, "tool_material": "hss"}), "nose_radius_mm", 0.5),
        (json!({"nose_radius_mm": 4.1, "tool_material": "hss"}), "nose_radius_mm", 4.0),
    ] {
        let found = faults(&choice(&fields));
        assert_eq!(found.len(), 1, "{fields}");
        assert_eq!(
            (found[0].code, found[0].pointer.as_str()),
            ("outside_handbook_table", format!("/force/{field}").as_str())
        );
        assert_eq!(found[0].limit, Some(limit));
        assert!(found[0].values.get("least").is_some() && found[0].values.get("largest").is_some());
    }
}

#[test]
fn what_the_handbook_does_not_give_is_asked_for() {
    for (material, tool) in [("stainless_12kh18n9t", "carbide"), ("copper_multiphase", "hss"), ("aluminium", "hss")] {
        let fields = json!({"work_material": material, "tool_material": tool});
        assert_eq!(only_fault(&fields), ("passive_force_missing".into(), "/force/passive".into()));
        let mut ratio = fields.clone();
        ratio["passive_to_main_ratio"] = json!(0.4);
        let law = filled(&ratio);
        let (passive, main) = (law.passive, law.main.unwrap());
        assert!((passive.coefficient - 0.4 * main.coefficient).abs() < 1e-12);
        assert_eq!((passive.depth_exponent, passive.feed_exponent), (main.depth_exponent, main.feed_exponent));
        assert!(law.feed.is_none(), "left out, not invented");
        let mut own = fields.clone();
        own["passive"] = json!({"coefficient": 800.0, "depth_exponent": 0.9, "feed_exponent": 0.7});
        assert_eq!(filled(&own).passive.correction_factor, 1.0);
        own["rubbing"] = json!({"feed_n": 5.0});
        assert_eq!(only_fault(&own).0, "feed_force_missing");
    }
}

#[test]
fn every_wrong_choice_has_its_code() {
    let term = json!({"coefficient": 800.0, "depth_exponent": 0.9, "feed_exponent": 0.7});
    for (fields, code, field) in [
        (json!({"material": "unobtainium"}), "unknown_material", "/material"),
        (json!({"material": "brass"}), "material_without_force_law", "/material"),
        (json!({"material": "steel_45", "work_material": "steel"}), "material_or_class", ""),
        (json!({"material": "42crmo4"}), "bad_work_material", "/tensile_strength_n_per_mm2"),
        (json!({"work_material": "grey_iron"}), "bad_work_material", "/brinell_hardness"),
        (json!({"tensile_strength_n_per_mm2": -1.0}), "bad_work_material", "/tensile_strength_n_per_mm2"),
        (json!({"brinell_hardness": 200.0}), "factor_not_tabulated", "/brinell_hardness"),
        (json!({"material_factor": 1.2}), "factor_not_tabulated", "/material_factor"),
        (json!({"nose_radius_mm": 0.8}), "factor_not_tabulated", "/nose_radius_mm"),
        (json!({"nose_radius_mm": -0.8}), "bad_nose_radius", "/nose_radius_mm"),
        (json!({"inclination_deg": 5.0, "tool_material": "hss"}), "factor_not_tabulated", "/inclination_deg"),
        (json!({"cutting_edge_angle_deg": 100.1}), "bad_lead_angle", "/cutting_edge_angle_deg"),
        (json!({"cutting_edge_angle_deg": 0.0}), "bad_lead_angle", "/cutting_edge_angle_deg"),
        (json!({"wiper_edge": true, "tool_material": "hss"}), "no_handbook_row", "/wiper_edge"),
        (
            json!({"work_material": "grey_iron", "brinell_hardness": 190.0, "tool_material": "hss"}),
            "no_handbook_row",
            "/tool_material",
        ),
        (json!({"passive": term, "passive_to_main_ratio": 0.4}), "term_or_ratio", "/passive"),
        (json!({"passive_to_main_ratio": 0.0}), "bad_power_law", "/passive_to_main_ratio"),
        (json!({"wear_factor": 0.0}), "bad_wear_factor", "/wear_factor"),
        (json!({"rubbing": {"main_n": -3.0}}), "bad_rubbing_force", "/rubbing/main_n"),
    ] {
        assert_eq!(only_fault(&fields), (code.to_owned(), format!("/force{field}")), "{fields}");
    }
}

#[test]
fn copper_alloys_with_a_range_want_a_number_from_it() {
    let copper = |factor: Value| {
        json!({
            "work_material": "copper_single_phase", "tool_material": "hss", "passive_to_main_ratio": 0.4,
            "material_factor": factor,
        })
    };
    assert_eq!(only_fault(&copper(Value::Null)).0, "material_factor_missing");
    assert_eq!(only_fault(&copper(json!(2.3))).0, "material_factor_outside_table");
    assert_eq!(filled(&copper(json!(2.0))).main.unwrap().correction_factor, 2.0);
    let hard = json!({"work_material": "duralumin_350", "tool_material": "hss", "passive_to_main_ratio": 0.4});
    assert_eq!(filled(&hard).main.unwrap().correction_factor, 2.0);
}

#[test]
fn faults_of_several_fields_are_found_at_once() {
    let found = faults(&choice(&json!({
        "cutting_edge_angle_deg": 20.0, "rake_angle_deg": 40.0, "brinell_hardness": 100.0, "wear_factor": -1.0,
        "passive_to_main_ratio": -1.0,
    })));
    let codes: Vec<&str> = found.iter().map(|finding| finding.code).collect();
    for code in ["outside_handbook_table", "factor_not_tabulated", "bad_wear_factor", "bad_power_law"] {
        assert!(codes.contains(&code), "{code} in {codes:?}");
    }
}

#[test]
fn certainty_travels_with_the_term_and_doubt_is_said() {
    let law = filled(&json!({}));
    assert_eq!(law.passive.certainty, Some(Certainty::Likely));
    assert!(ForceModel::PowerLaw(law).cautions("/force").is_empty());
    let wiper = choice(&json!({"wiper_edge": true}));
    let cautions = wiper.cautions("/force");
    assert_eq!(cautions.len(), 3);
    assert_eq!((cautions[0].code, cautions[0].pointer.as_str()), ("unconfirmed_force_coefficient", "/force/passive"));
    assert!(WARNING_CODES.contains(&cautions[0].code));
    // Between a likely row and one to be checked the result is to be checked.
    let nose = |radius: f64| choice(&json!({"tool_material": "hss", "nose_radius_mm": radius})).cautions("").len();
    assert_eq!((nose(3.0), nose(3.5), nose(4.0)), (0, 3, 3));
}

fn cut<'a>(depth_mm: Reached<'a>, feed_mm_per_rev: Reached<'a>, speed_m_per_min: Reached<'a>) -> ReachedCut<'a> {
    ReachedCut { depth_mm, feed_mm_per_rev, speed_m_per_min }
}

#[test]
fn leaving_the_measured_range_is_said() {
    let at = |pointer, least, largest| Reached { pointer, least, largest };
    let inside = (at("/cut/depth_mm", 0.1, 3.0), at("/cut/feed", 0.05, 0.5), at("/cut/speed", 30.0, 300.0));
    let carbide = choice(&json!({}));
    assert!(carbide.extrapolations(&cut(inside.0, inside.1, inside.2)).is_empty());
    let found = carbide.extrapolations(&cut(at("/d", 0.09, 3.0), at("/f", 0.04, 0.5), at("/v", 100.0, 301.0)));
    let said: Vec<_> = found.iter().map(|f| (f.code, f.pointer.as_str(), f.value, f.limit, f.unit)).collect();
    let code = "extrapolated_force_model";
    assert_eq!(
        said,
        [
            (code, "/d", Some(0.09), Some(0.1), Some("mm")),
            (code, "/f", Some(0.04), Some(0.05), Some("mm/rev")),
            (code, "/v", Some(301.0), Some(300.0), Some("m/min")),
        ]
    );
    let hss = choice(&json!({"tool_material": "hss"}));
    assert!(hss.extrapolations(&cut(inside.0, inside.1, at("/v", 5.0, 100.0))).is_empty());
    assert_eq!(hss.extrapolations(&cut(inside.0, inside.1, at("/v", 5.0, 100.1)))[0].limit, Some(100.0));
    let kienzle: ForceModel = serde_json::from_value(json!({
        "kind": "kienzle", "cutting_edge_angle_deg": 75.0, "nose_radius_mm": 0.4, "material": "42crmo4",
        "specific_normal_force_n_per_mm2": 900.0, "normal_exponent": 0.35,
    }))
    .unwrap();
    assert!(kienzle.extrapolations(&cut(inside.0, at("/f", 0.1, 0.3), inside.2)).is_empty());
    assert_eq!(
        kienzle.extrapolations(&cut(inside.0, at("/f", 0.1, 0.4), inside.2))[0].code,
        "feed_exceeds_nose_radius"
    );
    let table: ForceModel =
        serde_json::from_value(json!({"kind": "table", "rows": [{"depth_mm": 1.0, "passive_n": 9.0}]})).unwrap();
    assert!(table.extrapolations(&cut(at("/d", 0.01, 1.0), inside.1, inside.2)).is_empty());
    assert_eq!(table.extrapolations(&cut(at("/d", 0.01, 1.1), inside.1, inside.2))[0].limit, Some(1.0));
}

#[test]
fn a_range_of_ones_own_replaces_the_handbooks() {
    let mut job = serde_json::to_value(ForceModel::PowerLaw(filled(&json!({})))).unwrap();
    job["measured_range"] = json!({
        "least_depth_mm": 0.02, "largest_depth_mm": 1.0, "least_feed_mm_per_rev": 0.01, "largest_feed_mm_per_rev": 0.2,
        "least_speed_m_per_min": 200.0, "largest_speed_m_per_min": 800.0,
    });
    let model: ForceModel = serde_json::from_value(job).unwrap();
    let at = |pointer, least, largest| Reached { pointer, least, largest };
    assert!(model.extrapolations(&cut(at("/d", 0.03, 0.9), at("/f", 0.02, 0.2), at("/v", 250.0, 500.0))).is_empty());
    assert_eq!(model.extrapolations(&cut(at("/d", 0.03, 1.9), at("/f", 0.02, 0.3), at("/v", 150.0, 500.0))).len(), 3);
}
