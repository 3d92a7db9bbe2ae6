//! The two alloys of the library against the source's table, evaluated over its own ranges.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use precut_calc::machinability::{Conditions, LibraryModel, find_set, sets};
use serde_json::Value;

fn table() -> Value {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/..", "/tests/reference/feed-scheduling/seed-tables.json");
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn list(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

fn at(v: f64, s: f64, t: f64, phi: f64) -> Conditions {
    Conditions { speed_m_per_min: v, feed_mm_per_rev: s, depth_mm: t, cutting_edge_angle_deg: Some(phi) }
}

fn near(what: &str, found: f64, expected: &Value) {
    let expected = expected.as_f64().unwrap();
    // The file prints nine digits.
    assert!((found - expected).abs() <= 1e-8 * expected.abs(), "{what}: {found}, expected {expected}");
}

#[test]
fn every_row_of_the_table_in_the_form_it_is_read() {
    let table = table();
    let grid = &table["evaluation_grid"];
    let of = |name: &str| list(&grid[name]);
    for (alloy, set) in [("VT9", "vt9_tk20"), ("KhN73MBTYu-VD", "khn73mbtyu_tk25")] {
        let set = find_set(set).unwrap();
        let rows = table["models"][alloy].as_object().unwrap();
        assert_eq!(set.models.len(), rows.len());
        assert!(table["tools"][alloy].as_str().unwrap().starts_with(set.tool.split(' ').next().unwrap()));
        let typical = &table["typical_point"][alloy];
        let typical = ["V", "S", "t", "phi"].map(|key| typical[key].as_f64().unwrap());
        for (name, row) in rows {
            let known: &LibraryModel = set.models.iter().find(|model| model.output == name).unwrap();
            let model = known.model();
            let form = row["form"].as_str().unwrap();
            assert_eq!(serde_json::to_value(known.form).unwrap(), form, "{alloy} {name}");
            let value = |c: [f64; 4]| model.value(&at(c[0], c[1], c[2], c[3]));
            let what = format!("{alloy} {name}");
            near(&what, value(typical), &row[form]["typical"]);
            let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
            for &v in &of("V") {
                for &s in &of("S") {
                    for &t in &of("t") {
                        for &phi in &of("phi") {
                            let y = value([v, s, t, phi]);
                            (least, most) = (least.min(y), most.max(y));
                        }
                    }
                }
            }
            near(&what, least, &row[form]["min"]);
            near(&what, most, &row[form]["max"]);
        }
    }
}

/// The source's doubtful points stand where a user sees them, and ids are what jobs name.
#[test]
fn sets_say_what_is_doubtful() {
    assert_eq!(sets().iter().map(|set| set.id).collect::<Vec<_>>(), ["vt9_tk20", "khn73mbtyu_tk25"]);
    for set in sets() {
        assert!(set.caveat.contains("fourth variable"), "{}", set.id);
        assert!(set.caveat.contains("never used as a limit"), "{}", set.id);
        for model in set.models {
            assert!(!model.source.is_empty());
            let range = model.model().range.unwrap();
            // The reference's ranges of the trials.
            assert_eq!(
                (range.least_speed_m_per_min, range.largest_speed_m_per_min, range.largest_cutting_edge_angle_deg),
                (Some(10.0), Some(80.0), Some(105.0))
            );
        }
    }
    assert!(sets()[0].caveat.contains("VT6"));
}
