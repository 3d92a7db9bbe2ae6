//! The source paper's two tables with the identified parameters, row by row.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use crate::fixture_support::{outcome, reference};
use serde_json::{Value, json};

/// The job of a row of the identified set; the paper's program forgets what earlier teeth left.
fn job(parameters: &Value, kind: u8, teeth: u64, depth: f64, regeneration: &str) -> Value {
    let of = |name: &str| parameters[name].as_f64().unwrap();
    let joint = |n: u8| {
        json!({
            "stiffness_n_per_mm": of(&format!("C{n}_N_mm")),
            "damping_n_s_per_mm": of(&format!("lambda{n}_N_s_mm")),
        })
    };
    let mut fixture = json!({
        "kind": if kind == 1 { "self_locking" } else { "constant_force" },
        "workpiece_mass_kg": of("m_kg"),
        "movable_joint": joint(1),
        "fixed_joint": joint(2),
    });
    if kind == 2 {
        fixture["jaw_mass_kg"] = json!(of("m3_kg"));
    }
    json!({
        "cutter": { "diameter_mm": of("diameter_mm"), "teeth": teeth },
        "force": { "coefficient": of("Cp"), "chip_thickness_exponent": of("k"), "radial_ratio": of("radial_ratio") },
        "cut": {
            "width_mm": of("width_mm"), "depth_mm": depth, "spindle_speed_rpm": of("spindle_rpm"),
            "feed_mm_per_tooth": parameters["feed_per_tooth_mm"][format!("z{teeth}")],
        },
        "fixture": fixture,
        "simulation": { "regeneration": regeneration, "tooth_periods": 160, "steady_tooth_periods": 50 },
        "limits": { "depth_max_mm": 12 },
    })
}

fn rows(table: &str) -> Vec<Value> {
    reference("identified.json")[table]["rows"].as_array().unwrap().clone()
}

/// Stable rows agree to the rounding of the reference (1e-4 mm) and its own step (some 0.5 %). Rows in chatter with the
/// single delay wander between attractors near an opening (the reference's own two steps differ by up to 5 %): they are
/// held to 8 %, but for those where the reference itself jumps.
#[test]
fn both_tables_are_predicted_row_by_row() {
    let parameters = reference("identified.json")["parameters"].clone();
    for (table, kind) in [("table1_type1", 1), ("table2_type2", 2)] {
        let (mut measured, mut errors) = (0, Vec::new());
        for row in rows(table) {
            let (teeth, depth) = (row["z"].as_u64().unwrap(), row["depth_mm"].as_f64().unwrap());
            let got = outcome(&job(&parameters, kind, teeth, depth, "single"));
            let have = got.simulation.as_ref().unwrap().peak_to_peak_um / 1e3;
            let (rough, fine) =
                (row["single_delay_p2p_mm"].as_f64().unwrap(), row["single_delay_p2p_fine_mm"].as_f64().unwrap());
            let jumps = (fine / rough - 1.0).abs() > 0.06 || row["table"].is_string() || have > 0.3;
            // Just below the limit 160 tooth periods do not see the transient out.
            let within = match got.multiplier.modulus {
                modulus if modulus < 0.97 => 1e-4 + 5e-3 * fine,
                modulus if modulus < 1.0 => 0.15 * fine,
                _ => 0.08 * fine,
            };
            assert!(jumps || (have - fine).abs() < within, "{table} z {teeth} H {depth}: {have}, reference {fine}");
            if let Some(printed) = row["table"].as_f64() {
                measured += 1;
                errors.push((have / printed).ln().abs());
            }
        }
        errors.sort_by(f64::total_cmp);
        let (count, median) = if kind == 1 { (25, 0.11) } else { (24, 0.13) };
        assert_eq!(measured, count, "{table}");
        // Medians of 0.068 and 0.109 in the reference at the step that was fitted with, 0.076 and 0.115 with it halved; near
        // the jumps the steps taken here move rows further.
        assert!(errors[errors.len() / 2] < median, "{table}: median {}", errors[errors.len() / 2]);
    }
}

#[test]
fn the_onset_lies_in_all_six_brackets_of_the_tables() {
    let identified = reference("identified.json");
    for (name, kind) in [("type1", 1), ("type2", 2)] {
        for teeth in [8, 12, 16] {
            let key = format!("z{teeth}");
            let got = outcome(&job(&identified["parameters"], kind, teeth, 1.0, "single")).chatter_depth_mm.unwrap();
            let want = identified["onset"]["H_crit_by_multiplier_mm"][name][&key].as_f64().unwrap();
            // Parameters and answers are printed with four or five digits.
            assert!((got / want - 1.0).abs() < 1e-3, "{name} {key}: {got}, reference {want}");
            let bracket = &identified["onset"]["table"][name][&key];
            assert!(bracket[0].as_f64().unwrap() <= got && got <= bracket[1].as_f64().unwrap(), "{name} {key}: {got}");
        }
    }
}

/// With the surface remembered the same set has the same stable rows and a smaller chatter.
#[test]
fn remembering_the_surface_makes_the_chatter_smaller() {
    let parameters = reference("identified.json")["parameters"].clone();
    for row in rows("table1_type1") {
        let (teeth, depth) = (row["z"].as_u64().unwrap(), row["depth_mm"].as_f64().unwrap());
        let got = outcome(&job(&parameters, 1, teeth, depth, "multiple"));
        let (have, want) =
            (got.simulation.as_ref().unwrap().peak_to_peak_um / 1e3, row["multiple_p2p_mm"].as_f64().unwrap());
        // The reference's step is 40 to an oscillation: some percent in chatter.
        // Just below the limit 160 tooth periods do not see the transient out.
        let within = match got.multiplier.modulus {
            modulus if modulus < 0.97 => 1e-4 + 5e-3 * want,
            modulus if modulus < 1.0 => 0.15 * want,
            _ => 0.05 * want,
        };
        assert!((have - want).abs() < within, "z {teeth} H {depth}: {have}, reference {want}");
    }
}

#[test]
fn the_printed_facts_of_the_paper_are_met() {
    let facts = &reference("paper-tables.json")["facts"].clone();
    let parameters = reference("identified.json")["parameters"].clone();
    let three = outcome(&job(&parameters, 1, 8, 3.0, "single"));
    let range = &facts["Px_quasistatic_range_at_3mm_N"];
    // Read off an oscillogram to two digits.
    assert!((three.quasi_static.force_max_n / range[1].as_f64().unwrap() - 1.0).abs() < 0.01);
    assert!((three.quasi_static.force_min_n / range[0].as_f64().unwrap() - 1.0).abs() < 0.2);
    let deep = outcome(&job(&parameters, 1, 8, 4.5, "single"));
    let peak = facts["Px_peak_quasistatic_at_4_5mm_N"].as_f64().unwrap();
    assert!((deep.quasi_static.force_max_n / peak - 1.0).abs() < 0.01);
    // 1650 N and 0.16 mm printed; the identified set gives 1507 N and 0.155 mm.
    assert!(
        (deep.simulation.as_ref().unwrap().force_max_n / facts["Px_peak_dynamic_at_4_5mm_N"].as_f64().unwrap() - 1.0)
            .abs()
            < 0.12
    );
    assert!(deep.simulation.as_ref().unwrap().lost_cut_share > 0.0);
}
