//! The reference's impossible jobs: each is refused with its code at its field, among whatever else is wrong.

#[path = "../../crates/precut-calc/tests/support/mod.rs"]
mod support;

use std::collections::BTreeSet;

use precut::engine::{Body, Error, Given, check_now};
use precut::registry::Registry;
use precut::text::{Language, Texts};
use precut_calc::calculator::{Finding, Value as Said};
use serde_json::{Value, json};
use support::{cases, translate};

/// Code and pointer of every fault.
fn faults(registry: &Registry, job: &Value) -> Vec<(String, String)> {
    faults_of(registry, "deflection-compensation", job)
}

fn faults_of(registry: &Registry, calculator: &str, job: &Value) -> Vec<(String, String)> {
    findings_of(registry, calculator, job).into_iter().map(|f| (f.code.to_owned(), f.pointer)).collect()
}

fn findings_of(registry: &Registry, calculator: &str, job: &Value) -> Vec<Finding> {
    match check_now(registry, calculator, Body::Json(job.to_string().into()), &Given::default()) {
        Err(Error::Invalid { findings, .. }) => findings,
        Err(error) => panic!("{error:?}"),
        Ok(_) => panic!("accepted: {job}"),
    }
}

/// `shaft.segments[0].d_in` of the sketch as a pointer of the contract.
fn pointer(path: &str) -> String {
    let mut pointer = String::new();
    for part in path.split('.') {
        let (name, index) = part.split_once('[').map_or((part, None), |(n, i)| (n, Some(i.trim_end_matches(']'))));
        let name = match name {
            "length" => "length_mm",
            "d" => "diameter_mm",
            "d_in" => "bore_diameter_mm",
            "d_stock" => "stock_diameter_mm",
            "x" => "z_mm",
            "c" => "compliance_um_per_n",
            "s" => "feed_mm_per_rev",
            "E" => "youngs_modulus_n_per_mm2",
            "nu" => "poisson_ratio",
            other => other,
        };
        pointer.push('/');
        pointer.push_str(name);
        if let Some(index) = index {
            pointer.push('/');
            pointer.push_str(index);
        }
    }
    pointer
}

#[test]
fn every_impossible_job_is_refused_at_its_field() {
    let registry = Registry::standard().unwrap();
    for case in cases("invalid.json") {
        let title = case["title"].as_str().unwrap();
        let expected = &case["expected"]["error"];
        let (code, at) = (expected["code"].as_str().unwrap(), pointer(expected["path"].as_str().unwrap()));
        let found = faults(&registry, &translate(&case["input"]));
        assert!(
            found.iter().any(|(c, p)| c == code && (*p == at || p.starts_with(&format!("{at}/")))),
            "{title}: {code} at {at} is not among {found:?}"
        );
    }
}

#[test]
fn the_other_codes_of_the_specification() {
    let registry = Registry::standard().unwrap();
    let good = || {
        json!({
            "shaft": { "segments": [{ "length_mm": 500, "diameter_mm": 30, "stock_diameter_mm": 32 }], "youngs_modulus_n_per_mm2": 210_000 },
            "supports": [{ "kind": "centre", "z_mm": 0 }, { "kind": "centre", "z_mm": 500 }],
            "force": { "kind": "power_law", "passive": { "coefficient": 2430, "depth_exponent": 0.9, "feed_exponent": 0.6, "speed_exponent": -0.3 } },
            "cut": { "feed_mm_per_rev": 0.3, "speed_m_per_min": 120 }
        })
    };
    let kienzle = json!({
        "kind": "kienzle", "cutting_edge_angle_deg": 120, "nose_radius_mm": -1,
        "specific_cutting_force_n_per_mm2": 0, "cutting_exponent": 1.0,
        "specific_normal_force_n_per_mm2": 900, "normal_exponent": 0.3
    });
    let changes: &[(&str, Value, &str, &str)] = &[
        ("/shaft/segments/0/diameter_mm", json!(0), "bad_diameter", "/shaft/segments/0/diameter_mm"),
        ("/shaft/segments/0/diameter_mm", json!(1e-310), "bad_diameter", "/shaft/segments/0/diameter_mm"),
        ("/cut/speed_m_per_min", json!(0), "bad_speed", "/cut/speed_m_per_min"),
        ("/force/passive/coefficient", json!(0), "bad_power_law", "/force/passive/coefficient"),
        ("/force/passive/depth_exponent", json!(-0.1), "bad_power_law", "/force/passive/depth_exponent"),
        ("/force", kienzle.clone(), "bad_lead_angle", "/force/cutting_edge_angle_deg"),
        ("/force", kienzle.clone(), "bad_nose_radius", "/force/nose_radius_mm"),
        ("/force", kienzle.clone(), "bad_kienzle", "/force/specific_cutting_force_n_per_mm2"),
        ("/force", kienzle, "bad_kienzle", "/force/cutting_exponent"),
        ("/force/kind", json!("rosenberg"), "unknown_force_model", "/force/kind"),
        ("/supports", json!([]), "unstable_support", "/supports"),
        (
            "/supports/1",
            json!({ "kind": "steady_rest", "z_mm": 500, "one_sided": true }),
            "unstable_support",
            "/supports",
        ),
        ("/supports/1", json!({ "kind": "follow_rest", "offset_mm": 5 }), "unstable_support", "/supports"),
        ("/supports/1/gap_um", json!(-1), "unknown_field", "/supports/1/gap_um"),
        (
            "/effects",
            json!([{ "kind": "tool_wear", "rate_um_per_km": 1 }]),
            "condition_missing",
            "/conditions/tool_path_at_start_m",
        ),
        ("/effects", json!([{ "kind": "tool_ware", "rate_um_per_km": 1 }]), "unknown_kind", "/effects/0/kind"),
        (
            "/effects",
            json!([{ "kind": "force_level", "delta": 0.1 }, { "kind": "force_level", "delta": 0.1 }]),
            "duplicate_effect",
            "/effects/1/kind",
        ),
        ("/stations", json!({ "kind": "per_zone", "count": 300_000 }), "too_many_stations", "/stations/count"),
        ("/material", json!("steel"), "unknown_material", "/material"),
        ("/shaft/material", json!("unobtainium"), "unknown_material", "/shaft/material"),
    ];
    for (place, value, code, at) in changes {
        let mut job = good();
        let (parent, name) = place.rsplit_once('/').unwrap();
        match job.pointer_mut(parent).unwrap() {
            Value::Array(items) => items[name.parse::<usize>().unwrap()] = value.clone(),
            Value::Object(fields) => drop(fields.insert(name.to_owned(), value.clone())),
            other => panic!("{other}"),
        }
        let found = faults(&registry, &job);
        assert!(
            found.iter().any(|(c, p)| c == code && p == at),
            "{place} = {value}: {code} at {at} is not among {found:?}"
        );
    }
}

#[test]
fn all_faults_come_at_once() {
    let registry = Registry::standard().unwrap();
    let found = faults(
        &registry,
        &json!({
            "shaft": { "segments": [{ "length_mm": -1, "diameter_mm": 30, "stock_diameter_mm": 29, "bore_diameter_mm": 30 }], "youngs_modulus_n_per_mm2": 0 },
            "supports": [{ "kind": "centre", "z_mm": 0, "compliance_um_per_n": -1 }],
            "force": { "kind": "power_law", "passive": { "coefficient": -1, "depth_exponent": 0.9, "feed_exponent": 0.6, "speed_exponent": -0.3 } },
            "cut": { "feed_mm_per_rev": 0 },
            "effects": [{ "kind": "force_level", "delta": 0.1 }, { "kind": "force_level", "delta": 0.1 }],
            "stations": { "kind": "list", "z_mm": [600] }
        }),
    );
    let codes: Vec<&str> = found.iter().map(|(code, _)| code.as_str()).collect();
    for code in [
        "bad_length",
        "bad_bore",
        "stock_below_finish",
        "bad_modulus",
        "negative_compliance",
        "unstable_support",
        "bad_power_law",
        "bad_feed",
        "speed_or_rpm",
        "duplicate_effect",
    ] {
        assert!(codes.contains(&code), "{code} is not among {codes:?}");
    }
    // Beside a shaft of no possible length stands nothing.
    assert!(!codes.contains(&"station_outside_shaft"), "{codes:?}");
}

/// A job with one thing changed.
fn changed(place: &str, value: &Value) -> Value {
    let mut job = json!({
        "shaft": { "segments": [{ "length_mm": 500, "diameter_mm": 30, "stock_diameter_mm": 32 }], "youngs_modulus_n_per_mm2": 210_000 },
        "supports": [{ "kind": "centre", "z_mm": 0 }, { "kind": "centre", "z_mm": 500 }],
        "force": { "kind": "constant", "passive_n": 100 },
        "cut": { "feed_mm_per_rev": 0.3, "speed_m_per_min": 120 }
    });
    let (parent, name) = place.rsplit_once('/').unwrap();
    job.pointer_mut(parent).unwrap()[name] = value.clone();
    job
}

/// Too low or too high: both ends of what is allowed are said, in numbers and in words of every language.
#[test]
fn a_number_out_of_its_range_is_told_both_ends() {
    let registry = Registry::standard().unwrap();
    let kienzle = |field: &str, value: f64| {
        let mut force = json!({
            "kind": "kienzle", "cutting_edge_angle_deg": 75, "nose_radius_mm": 0.8,
            "specific_cutting_force_n_per_mm2": 2000, "cutting_exponent": 0.2,
            "specific_normal_force_n_per_mm2": 900, "normal_exponent": 0.35
        });
        force[field] = json!(value);
        force
    };
    let power = |field: &str, value: f64| {
        let mut force = json!({ "kind": "power_law", "passive": { "coefficient": 2430, "depth_exponent": 0.9, "feed_exponent": 0.6 } });
        force["passive"][field] = json!(value);
        force
    };
    let of_force = |force: Value| ("/force", force);
    let cases = [
        (("/shaft/segments/0/length_mm", json!(1e308)), "bad_length", ["0.001", "100000"]),
        (("/shaft/segments/0/diameter_mm", json!(10_001)), "bad_diameter", ["0.01", "10000"]),
        (("/shaft/segments/0/diameter_mm", json!(-30)), "bad_diameter", ["0.01", "10000"]),
        (("/shaft/segments/0/bore_diameter_mm", json!(-1)), "bad_bore", ["0", "10000"]),
        (("/shaft/segments/0/bore_diameter_mm", json!(20_000)), "bad_bore", ["0", "30"]),
        (("/shaft/segments/0/stock_diameter_mm", json!(20_000)), "bad_diameter", ["0.01", "10000"]),
        (("/shaft/youngs_modulus_n_per_mm2", json!(1)), "bad_modulus", ["1000", "2000000"]),
        (("/shaft/poisson_ratio", json!(0.5)), "bad_poisson", ["-1", "0.5"]),
        (("/supports/0/compliance_um_per_n", json!(1e300)), "negative_compliance", ["0", "1000 µm/N"]),
        (("/supports/0/compliance_um_per_n", json!(-1)), "negative_compliance", ["0", "1000 µm/N"]),
        (("/supports/0/z_mm", json!(-1)), "support_outside_shaft", ["0", "500"]),
        (("/supports/0/z_mm", json!(1e6)), "support_outside_shaft", ["0", "500"]),
        (("/cut/feed_mm_per_rev", json!(0)), "bad_feed", ["0.0001", "20"]),
        (("/cut/speed_m_per_min", json!(1e9)), "bad_speed", ["0.01", "20000 m/min"]),
        (("/force/passive_n", json!(-1)), "bad_constant_force", ["0", "1000000 N"]),
        (("/force/passive_n", json!(1e300)), "out_of_range", ["0", "1000000 N"]),
        (("/force/wear_factor", json!(0)), "bad_wear_factor", ["0", "10"]),
        (of_force(kienzle("cutting_edge_angle_deg", 120.0)), "bad_lead_angle", ["0", "120"]),
        (of_force(kienzle("nose_radius_mm", -1.0)), "bad_nose_radius", ["0", "50 mm"]),
        (of_force(kienzle("specific_normal_force_n_per_mm2", 0.0)), "bad_kienzle", ["0", "100000 N/mm²"]),
        (of_force(kienzle("normal_exponent", 1.0)), "bad_kienzle", ["0", "1"]),
        (of_force(power("coefficient", 0.0)), "bad_power_law", ["0", "10000000"]),
        (of_force(power("depth_exponent", -0.1)), "bad_power_law", ["0", "3"]),
    ];
    for ((place, value), code, ends) in cases {
        let found = findings_of(&registry, "deflection-compensation", &changed(place, &value));
        let [finding] = &found[..] else { panic!("{place} = {value}: {found:?}") };
        assert_eq!(finding.code, code, "{place} = {value}");
        let stated =
            |names: [&str; 2]| names.iter().any(|name| matches!(finding.values.get(name), Some(Said::Number(_))));
        assert!(stated(["minimum", "above"]) && stated(["maximum", "below"]) && finding.unit.is_some(), "{finding:?}");
        let english = Texts::shared().try_finding(Language::En, "fault", finding).unwrap();
        assert!(ends.iter().all(|end| english.contains(end)), "{english}");
        let russian = Texts::shared().try_finding(Language::Ru, "fault", finding).unwrap();
        let numbers = ends.map(|end| end.split(' ').next().unwrap_or_default().replace('.', ","));
        assert!(numbers.iter().all(|end| russian.contains(end.as_str())), "{russian}");
    }
}

/// Pointers of the numbers of a job: of a list, those of its first row.
fn numbers(job: &Value, at: &str, found: &mut Vec<String>) {
    match job {
        Value::Number(_) => found.push(at.to_owned()),
        Value::Object(fields) => fields.iter().for_each(|(name, field)| numbers(field, &format!("{at}/{name}"), found)),
        Value::Array(items) => items.iter().take(1).for_each(|item| numbers(item, &format!("{at}/0"), found)),
        _ => {}
    }
}

/// Whatever the sentence of a number beyond its range says, it says the whole range: in every calculator's examples,
/// with all defaults filled in, in every language.
#[test]
fn every_number_beyond_its_range_is_told_the_whole_range() {
    let registry = Registry::standard().unwrap();
    let said = |language: Language, finding: &Finding| Texts::shared().try_finding(language, "fault", finding).unwrap();
    let mut seen = BTreeSet::new();
    for entry in registry.entries() {
        let id = entry.meta().id;
        for example in entry.meta().examples {
            let checked = check_now(&registry, id, Body::Json(example.job.into()), &Given::default()).unwrap();
            let mut places = Vec::new();
            numbers(&checked.input, "", &mut places);
            // The same field of another row or example is the same field.
            places.retain(|place| seen.insert((id, place.clone())));
            for (place, value) in places.iter().flat_map(|place| [(place, -1e30), (place, 1e30)]) {
                let mut job = checked.input.clone();
                *job.pointer_mut(place).unwrap() = json!(value);
                let Err(Error::Invalid { findings, .. }) =
                    check_now(&registry, id, Body::Json(job.to_string().into()), &Given::default())
                else {
                    panic!("{id} takes {place} = {value}");
                };
                for finding in findings.iter().filter(|finding| finding.pointer == *place) {
                    let of_schema =
                        matches!(finding.values.get("rule"), Some(Said::Text(rule)) if rule == "out_of_range");
                    if !of_schema {
                        continue;
                    }
                    for language in Language::ALL {
                        let plain = Finding { code: "out_of_range", ..finding.clone() };
                        let plain = said(language, &plain);
                        let range = plain.split("; ").nth(1).unwrap().split_once(' ').unwrap().1;
                        let range = range.strip_prefix("is ").unwrap_or(range);
                        let sentence = said(language, finding);
                        assert!(sentence.contains(range), "{id} {place}: {range} is not said in: {sentence}");
                    }
                }
            }
        }
    }
}

/// The ends that the rules of the force models know are those of the schema.
#[test]
fn rules_and_schema_agree_on_the_ends() {
    let registry = Registry::standard().unwrap();
    let ends = |finding: &Finding| -> Vec<(&str, f64)> {
        let names = ["minimum", "above", "maximum", "below"].into_iter();
        let stated = names.filter_map(|name| match finding.values.get(name) {
            Some(Said::Number(end)) => Some((name, *end)),
            _ => None,
        });
        stated.collect()
    };
    let constant = json!({ "kind": "constant", "passive_n": 100, "rubbing": { "passive_n": 1 } });
    let handbook = json!({ "kind": "handbook", "work_material": "steel", "tool_material": "carbide",
        "tensile_strength_n_per_mm2": 600, "cutting_edge_angle_deg": 45 });
    let kienzle = json!({ "kind": "kienzle", "cutting_edge_angle_deg": 75, "nose_radius_mm": 0.8,
        "specific_cutting_force_n_per_mm2": 2000, "cutting_exponent": 0.2,
        "specific_normal_force_n_per_mm2": 900, "normal_exponent": 0.35 });
    let power =
        json!({ "kind": "power_law", "passive": { "coefficient": 2430, "depth_exponent": 0.9, "feed_exponent": 0.6 } });
    for (force, place) in [
        (&constant, "/force/passive_n"),
        (&constant, "/force/rubbing/passive_n"),
        (&constant, "/force/wear_factor"),
        (&handbook, "/force/nose_radius_mm"),
        (&handbook, "/force/cutting_edge_angle_deg"),
        (&handbook, "/force/tensile_strength_n_per_mm2"),
        (&kienzle, "/force/cutting_edge_angle_deg"),
        (&kienzle, "/force/nose_radius_mm"),
        (&kienzle, "/force/specific_normal_force_n_per_mm2"),
        (&kienzle, "/force/normal_exponent"),
        (&power, "/force/passive/coefficient"),
        (&power, "/force/passive/depth_exponent"),
        (&power, "/force/passive/correction_factor"),
        (&power, "/force/passive/constant_n"),
    ] {
        let at = |value: f64| {
            let mut job = changed("/force", force);
            let (parent, name) = place.rsplit_once('/').unwrap();
            job.pointer_mut(parent).unwrap()[name] = json!(value);
            let found = findings_of(&registry, "deflection-compensation", &job);
            found
                .into_iter()
                .find(|finding| finding.pointer == place)
                .unwrap_or_else(|| panic!("{place} takes {value}"))
        };
        // Below, a rule speaks; far above, for most of them the schema alone.
        assert_eq!(ends(&at(-1.0)), ends(&at(1e12)), "{place} of {force}");
    }
}

/// A table that cannot be read is one fault: nothing is said of a job without it, or with an empty one.
#[test]
fn a_cell_that_cannot_be_read_is_the_only_fault() {
    let registry = Registry::standard().unwrap();
    let rows = |bad: u32| -> String {
        let row = |i: u32| format!("{},{}", 5 * i, if i == bad { "x" } else { "150" });
        (0..72).map(row).collect::<Vec<_>>().join("\n")
    };
    let mut job = json!({
        "measured_profile": { "csv": format!("angle_deg,radius_mm\n{}", rows(7)) },
        "supports": { "distance_mm": 200, "depth_mm": 111 },
        "tool": { "x_mm": 100, "y_mm": 113.5, "feed_mm_per_rev": 0.023_437_5, "revolutions": 107 },
    });
    let of = |job: &Value| faults_of(&registry, "ring-roundness", job);
    assert_eq!(of(&job), [("bad_cell".to_owned(), "/measured_profile/7/radius_mm".to_owned())]);
    // Without any table the rule speaks, and other rules are broken whatever became of the table.
    let mut without = job.clone();
    without.as_object_mut().unwrap().remove("measured_profile");
    assert!(of(&without).iter().any(|(code, _)| code == "ring_or_profile"));
    job["effects"] = json!([{ "kind": "spark_out_missing", "spark_out_revolutions": 0 },
        { "kind": "spark_out_missing", "spark_out_revolutions": 0 }]);
    let codes: Vec<String> = of(&job).into_iter().map(|(code, _)| code).collect();
    assert!(codes.contains(&"bad_cell".to_owned()) && codes.contains(&"duplicate_effect".to_owned()), "{codes:?}");
}

/// Classes of cuts as a table with another separator and unit are those of the rows; one that is misspelt is named with its row.
#[test]
fn classes_come_as_a_table_too_and_one_that_is_none_is_its_only_fault() {
    let registry = Registry::standard().unwrap();
    let diagnosis = registry.entry("diagnosis").unwrap().meta();
    let example = diagnosis.examples.iter().find(|example| example.id == "fixture_classes").unwrap();
    let mut job: Value = serde_json::from_str(example.job).unwrap();
    let rows = job["measurements"].as_array().unwrap().clone();
    let line = |row: &Value| {
        let depth_um = 1e3 * row["depth_mm"].as_f64().unwrap();
        format!("{};{depth_um:.0},0;{}", row["run"], row["regime"].as_str().unwrap())
    };
    let table = |rows: &[Value]| {
        let lines: Vec<String> = rows.iter().map(line).collect();
        json!({ "csv": format!("run;depth [um];regime\n{}", lines.join("\n")) })
    };
    let of = |job: &Value| faults_of(&registry, "diagnosis", job);
    let key = |job: &Value| {
        check_now(&registry, "diagnosis", Body::Json(job.to_string().into()), &Given::default()).unwrap().key
    };
    let of_rows = key(&job);
    job["measurements"] = table(&rows);
    assert_eq!(key(&job), of_rows);
    let mut misspelt = rows.clone();
    misspelt[4]["regime"] = json!("chater");
    job["measurements"] = table(&misspelt);
    assert_eq!(of(&job), [("not_one_of".to_owned(), "/measurements/4/regime".to_owned())]);
}
