//! Rules between the fields of a record, which no schema says.

use precut_calc::calculator::{Finding, Violations};
use serde_json::Value;

use super::{Kind, numbers};
use crate::iso;

/// Every fault between fields of a settled record; those of its schema are found apart. Pointers are of the record.
pub fn faults(kind: Kind, record: &Value) -> Vec<Finding> {
    let mut violations = Violations::default();
    ends(kind, record, &mut violations);
    match kind {
        Kind::Machine => machine(record, &mut violations),
        Kind::Tool => tool(record, &mut violations),
        Kind::Material => material(record, &mut violations),
        // What it may be, the calculators say that have such a field.
        Kind::Part => {}
    }
    violations.into_vec()
}

/// `low` <= `value` <= `high`.
fn ends(kind: Kind, record: &Value, violations: &mut Violations) {
    for (pointer, number) in numbers(kind, record) {
        let end = |name: &str| number.get(name).and_then(Value::as_f64);
        let Some(value) = end("value") else { continue };
        for (name, holds) in
            [("low", end("low").is_none_or(|low| low <= value)), ("high", end("high").is_none_or(|high| high >= value))]
        {
            violations.require(holds, || {
                Finding::new("value_outside_its_ends", format!("{pointer}/{name}"))
                    .measured(end(name).unwrap_or(value), value, "1")
                    .with("end", if name == "low" { "low" } else { "high" })
            });
        }
    }
}

fn rising(rows: &[Value], field: &str) -> Option<usize> {
    let at = |row: &Value| row.get(field).and_then(Value::as_f64);
    rows.windows(2)
        .position(|pair| matches!((at(&pair[0]), at(&pair[1])), (Some(a), Some(b)) if a >= b))
        .map(|at| at + 1)
}

fn machine(record: &Value, violations: &mut Violations) {
    let compliance = record.get("compliance");
    let has = |name: &str| compliance.and_then(|part| part.get(name)).is_some();
    violations.require(!has("single_stiffness_n_per_mm") || has("meaning"), || {
        Finding::new("stiffness_meaning_missing", "/compliance/meaning")
            .with("allowed", super::machine::MEANINGS.to_vec())
    });
    let doubled = ["carriage_um_per_n", "headstock_centre_um_per_n", "tailstock_centre_um_per_n"];
    for name in doubled.into_iter().filter(|name| has("single_stiffness_n_per_mm") && has(name)) {
        violations.add(Finding::new("compliance_or_single_stiffness", format!("/compliance/{name}")));
    }
    let spindle = |name: &str| record.pointer(&format!("/spindle/{name}/value")).and_then(Value::as_f64);
    if let (Some(least), Some(largest)) = (spindle("speed_min_rpm"), spindle("speed_max_rpm")) {
        violations.require(least <= largest, || {
            Finding::new("ends_reversed", "/spindle/speed_min_rpm").measured(least, largest, "rev/min")
        });
    }
    let points = record.pointer("/spindle/characteristic").and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
    if let Some(index) = rising(points, "spindle_speed_rpm") {
        violations.add(Finding::new(
            "characteristic_not_rising",
            format!("/spindle/characteristic/{index}/spindle_speed_rpm"),
        ));
    }
}

fn tool(record: &Value, violations: &mut Violations) {
    let code = |name: &str| record.get(name).and_then(Value::as_str);
    let parsed = iso::read(code("insert"), code("holder"));
    parsed.faults.into_iter().for_each(|fault| violations.add(fault));
    for (index, row) in record.get("recommended").and_then(Value::as_array).into_iter().flatten().enumerate() {
        reversed(row, ["depth_low_mm", "depth_high_mm"], "mm", &format!("/recommended/{index}"), violations);
        reversed(
            row,
            ["feed_low_mm_per_rev", "feed_high_mm_per_rev"],
            "mm/rev",
            &format!("/recommended/{index}"),
            violations,
        );
    }
}

fn reversed(row: &Value, [low, high]: [&str; 2], unit: &'static str, pointer: &str, violations: &mut Violations) {
    let at = |name: &str| row.get(name).and_then(Value::as_f64);
    if let (Some(least), Some(largest)) = (at(low), at(high)) {
        violations.require(least <= largest, || {
            Finding::new("ends_reversed", format!("{pointer}/{low}")).measured(least, largest, unit)
        });
    }
}

fn material(record: &Value, violations: &mut Violations) {
    let rows = |name: &str| record.get(name).and_then(Value::as_array).into_iter().flatten().enumerate();
    let preferred = rows("kienzle").filter(|(_, row)| row.get("use").is_some_and(|word| word == "preferred"));
    for (index, _) in preferred.skip(1) {
        violations.add(Finding::new("several_preferred_rows", format!("/kienzle/{index}/use")));
    }
    for (index, row) in rows("kienzle") {
        let has = |name: &str| row.get(name).is_some();
        violations.require(has("cutting_exponent") || row.get("use").is_none_or(|word| word == "incomplete"), || {
            Finding::new("missing_field", format!("/kienzle/{index}/cutting_exponent"))
        });
        violations.require(has("specific_normal_force_n_per_mm2") == has("normal_exponent"), || {
            let absent = if has("normal_exponent") { "specific_normal_force_n_per_mm2" } else { "normal_exponent" };
            Finding::new("missing_field", format!("/kienzle/{index}/{absent}"))
        });
    }
    for (index, row) in rows("taylor") {
        let needs: &[&str] = match row.get("form").and_then(Value::as_str) {
            Some("handbook") => &["coefficient", "depth_exponent", "feed_exponent"],
            Some("taylor") => &["speed_at_one_minute_m_per_min"],
            _ => &[],
        };
        for name in needs.iter().filter(|name| row.get(**name).is_none()) {
            violations.add(Finding::new("missing_field", format!("/taylor/{index}/{name}")));
        }
    }
    for (index, row) in rows("cutting_speeds") {
        reversed(row, ["low_m_per_min", "high_m_per_min"], "m/min", &format!("/cutting_speeds/{index}"), violations);
    }
}
