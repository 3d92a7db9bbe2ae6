//! What names write into a job.

use precut_library::record::Kind;
use precut_library::resolve::From;
use precut_library::{Asked, Lookup, Resolution, asked, built_in, resolve};
use proptest::prelude::*;
use serde_json::{Value, json};

use super::{cases, near};

pub(super) fn looked_up(calculator: &str, job: &Value) -> Vec<(Asked, Lookup)> {
    asked(calculator, job).into_iter().map(|asked| (asked.clone(), Lookup::built_in(&asked))).collect()
}

/// Resolves a job by the built-in records.
pub(super) fn named(calculator: &str, job: &mut Value) -> Resolution {
    let found = looked_up(calculator, job);
    resolve(calculator, job, &found)
}

fn faultless(calculator: &str, job: &mut Value) -> Resolution {
    let resolution = named(calculator, job);
    assert!(resolution.faults.is_empty(), "{:?}", resolution.faults);
    resolution
}

/// The job of a case with what it leaves out because it does not matter there.
fn whole(case: &Value, calculator: &str) -> Value {
    let mut job = case["job"].clone();
    job["force"]["specific_normal_force_n_per_mm2"] = json!(900);
    job["force"]["normal_exponent"] = json!(0.35);
    if calculator == "feed-schedule" {
        let at = &case["limits_at"];
        job["zones"] =
            json!([{"id": "z", "z_start_mm": 0, "z_end_mm": 50, "depth_mm": 1, "diameter_mm": at["diameter_mm"]}]);
        job["cut_kind"] = at["cut"].clone();
        job["tool"] = json!({"name": job["tool"], "speed_tool": at["tool_grade"]});
    }
    job
}

fn from_of(resolution: &Resolution, pointer: &str) -> String {
    let origin =
        resolution.origins.iter().find(|origin| origin.pointer == pointer).unwrap_or_else(|| panic!("{pointer}"));
    let mut from: Vec<&str> = Vec::new();
    for part in &origin.parts {
        let name = match part.from {
            From::Job => "job",
            From::Tool => "tool",
            From::Machine => "machine",
            From::Material => "material",
        };
        if !from.contains(&name) {
            from.push(name);
        }
    }
    from.join(" + ")
}

#[test]
fn cases_are_resolved_as_published() {
    let file = cases(include_str!("../reference/resolution.json"));
    let mut compared = 0;
    for case in file["cases"].as_array().unwrap() {
        let (deflection, schedule) = ("deflection-compensation", "feed-schedule");
        for calculator in [deflection, schedule] {
            if calculator == schedule && case.get("limits_at").is_none() {
                continue;
            }
            let mut job = whole(case, calculator);
            let resolution = faultless(calculator, &mut job);
            for (pointer, expected) in case["expected"].as_object().unwrap() {
                let of_schedule = pointer.starts_with("/limits");
                let of_deflection = pointer.starts_with("/uncertainty") || pointer.starts_with("/path");
                if (of_schedule && calculator == deflection) || (of_deflection && calculator == schedule) {
                    continue;
                }
                // Where a schedule states no shaft there is none to be filled.
                if pointer.starts_with("/shaft") && job.get("shaft").is_none() {
                    assert_eq!(calculator, schedule);
                    continue;
                }
                let at = job.pointer(pointer).unwrap_or_else(|| panic!("{}: {pointer} in {job}", case["name"]));
                let tolerance = if pointer.ends_with("force_percent") { 5e-4 } else { 1e-9 };
                match (at.as_f64(), expected["value"].as_f64()) {
                    (Some(value), Some(expected)) => {
                        assert!(near(value, expected, tolerance), "{}: {pointer} {value} {expected}", case["name"]);
                    }
                    _ => assert_eq!(at, &expected["value"], "{}: {pointer}", case["name"]),
                }
                // The first part is the one that counts.
                let from = from_of(&resolution, pointer);
                let said = expected["from"].as_str().unwrap();
                let tightest = from.split(" + ").next().unwrap();
                assert!(from == said || (of_schedule && tightest == said), "{}: {pointer} {from} {said}", case["name"]);
                compared += 1;
            }
            assert_origins(&job, &resolution);
        }
    }
    assert!(compared > 100, "{compared}");
}

/// Every number in origins stands at its pointer; springs in one chain add.
fn assert_origins(job: &Value, resolution: &Resolution) {
    for origin in &resolution.origins {
        assert_eq!(job.pointer(&origin.pointer), Some(&origin.value), "{}", origin.pointer);
        if origin.pointer.starts_with("/carriage") && origin.parts[0].from != From::Job {
            let sum: f64 = origin.parts.iter().map(|part| part.value.as_ref().unwrap().as_f64().unwrap()).sum();
            assert!(near(sum, origin.value.as_f64().unwrap(), 1e-12), "{}", origin.pointer);
        }
    }
}

fn turning() -> Value {
    json!({
        "machine": "cnc_slant_bed_medium", "tool": "cnmg120408_pclnr2525m12", "material": "4140",
        "shaft": {"segments": [{"length_mm": 300, "diameter_mm": 40, "stock_diameter_mm": 42}]},
        "supports": [{"kind": "chuck", "z_mm": 0}, {"kind": "centre", "z_mm": 300}],
        "force": {"kind": "kienzle", "normal_force": "judged"},
        "cut": {"feed_mm_per_rev": 0.25, "speed_m_per_min": 180},
    })
}

#[test]
fn names_alone_make_a_whole_job() {
    let mut job = turning();
    let resolution = faultless("deflection-compensation", &mut job);
    for name in ["machine", "tool", "material"] {
        assert!(job.get(name).is_none(), "{name}");
    }
    assert!(job["force"].get("normal_force").is_none());
    let read: precut_calc::deflection_compensation::Job = serde_json::from_value(job.clone()).unwrap();
    assert_eq!(read.supports.len(), 2);
    assert_eq!(job["uncertainty"]["force_percent"], json!(40.0), "judged");
    assert!(resolution.warnings.iter().any(|warning| warning.code == "judged_normal_force"));
    assert!(resolution.warnings.iter().any(|warning| warning.code == "force_sources_differ"));
    let size = serde_json::to_vec(&resolution.origins).unwrap().len();
    assert!(size < 8 * 1024, "{size} bytes of origins");
}

#[test]
fn a_job_without_names_stays_as_it_is() {
    let plain = json!({
        "shaft": {"segments": [{"length_mm": 300, "diameter_mm": 40}], "material": "steel_45"},
        "supports": [{"kind": "centre", "z_mm": 0}], "force": {"kind": "kienzle", "material": "42crmo4"},
        "machine": {"power_kw": 10}, "cut": {},
    });
    for calculator in ["deflection-compensation", "feed-schedule", "fixture-stability", "ring-roundness"] {
        let mut job = plain.clone();
        assert_eq!(asked(calculator, &job), []);
        let resolution = named(calculator, &mut job);
        assert_eq!(job, plain, "{calculator}");
        assert!(resolution.origins.is_empty() && resolution.warnings.is_empty());
    }
}

#[test]
fn the_filled_job_asks_for_nothing_more() {
    let mut job = turning();
    faultless("deflection-compensation", &mut job);
    let filled = job.clone();
    assert_eq!(asked("deflection-compensation", &job), []);
    named("deflection-compensation", &mut job);
    assert_eq!(job, filled);
}

#[test]
fn an_explicit_zero_is_rigid_and_an_absent_one_is_filled() {
    let mut job = turning();
    job["supports"][0]["compliance_um_per_n"] = json!(0);
    job["carriage"] = json!({"compliance_um_per_n": 0.0});
    let resolution = faultless("deflection-compensation", &mut job);
    assert_eq!(job["supports"][0]["compliance_um_per_n"], json!(0));
    assert_eq!(job["supports"][0]["rotational_compliance_rad_per_n_mm"], json!(8e-10));
    assert_eq!(job["carriage"]["compliance_um_per_n"], json!(0.0));
    let overrules: Vec<&str> = resolution
        .warnings
        .iter()
        .filter(|warning| warning.code == "overrides_record")
        .map(|warning| warning.pointer.as_str())
        .collect();
    assert_eq!(overrules, ["/supports/0/compliance_um_per_n", "/carriage/compliance_um_per_n"]);
    let mut absent = turning();
    absent["carriage"] = json!({"compliance_um_per_n": null});
    faultless("deflection-compensation", &mut absent);
    assert_eq!(absent["carriage"]["compliance_um_per_n"], json!(0.018));
}

#[test]
fn a_bar_and_its_carriage_are_one_chain() {
    let mut job = turning();
    job["tool"] = json!({"name": "bar_a25_pclnr12", "overhang_mm": 130});
    let resolution = faultless("deflection-compensation", &mut job);
    let bar = 64.0 * 130.0_f64.powi(3) / (3.0 * std::f64::consts::PI * 210_000.0 * 25.0_f64.powi(4)) * 1000.0;
    assert!(near(job["carriage"]["compliance_um_per_n"].as_f64().unwrap(), 0.018 + bar, 1e-12));
    assert!(near(job["carriage"]["tangential_compliance_um_per_n"].as_f64().unwrap(), bar, 1e-12));
    let warning = resolution.warnings.iter().find(|warning| warning.code == "bar_overhang_beyond_limit").unwrap();
    assert_eq!((warning.value, warning.limit), (Some(5.2), Some(4.0)));
}

#[test]
fn a_tool_is_told_by_its_codes() {
    let mut job = turning();
    job["tool"] = json!({"insert": "DNMG 15 06 08", "holder": "pdjnl2525m15"});
    let resolution = faultless("deflection-compensation", &mut job);
    assert_eq!((&job["force"]["nose_radius_mm"], &job["force"]["cutting_edge_angle_deg"]), (&json!(0.8), &json!(93.0)));
    let said = from_of(&resolution, "/force/nose_radius_mm");
    assert_eq!(said, "tool");
    job = turning();
    job["tool"] = json!({"insert": "DNMG150608", "holder": "PDJNL2525M15", "RE": 0.4});
    let resolution = faultless("deflection-compensation", &mut job);
    assert_eq!(job["force"]["nose_radius_mm"], json!(0.4), "the field wins");
    assert!(resolution.warnings.iter().any(|warning| warning.code == "contradicts_code"));
}

#[test]
fn rests_have_names_and_ends_decide_the_centre() {
    use precut_library::record::{Record, settle};
    use precut_library::resolve::{Resource, Revision};
    let mut value = json!({"kind": "lathe", "compliance": {
        "rests_um_per_n": {"front": 0.031}, "steady_rest_um_per_n": 0.05, "headstock_centre_um_per_n": 0.01,
        "tailstock_centre_um_per_n": 0.02, "carriage_um_per_n": 0.04, "carriage_tangential_um_per_n": 0.06,
    }});
    settle(Kind::Machine, &mut value);
    let record = Record { kind: Kind::Machine, name: "lathe-3".to_owned(), value };
    let mut job = json!({"machine": "lathe-3@2", "supports": [
        {"kind": "centre", "z_mm": 500}, {"kind": "centre", "z_mm": 0}, {"kind": "steady_rest", "z_mm": 200, "rest": "front"},
        {"kind": "steady_rest", "z_mm": 300},
    ]});
    let asked = asked("deflection-compensation", &job);
    assert_eq!((asked[0].name.as_str(), asked[0].revision), ("lathe-3", Some(2)));
    let found = vec![(asked[0].clone(), Lookup::Found(Resource { record: record.into(), revision: Revision::Own(2) }))];
    let resolution = resolve("deflection-compensation", &mut job, &found);
    let compliances: Vec<f64> =
        job["supports"].as_array().unwrap().iter().map(|s| s["compliance_um_per_n"].as_f64().unwrap()).collect();
    assert_eq!(compliances, [0.02, 0.01, 0.031, 0.05]);
    assert!(job["supports"][2].get("rest").is_none());
    assert_eq!(job["carriage"], json!({"compliance_um_per_n": 0.04, "tangential_compliance_um_per_n": 0.06}));
    assert_eq!(job["uncertainty"]["stiffness_percent"], json!(10.0), "by the certainty of a user's number");
    assert!(resolution.faults.is_empty());
}

#[test]
fn a_single_stiffness_is_split_by_its_meaning() {
    use precut_library::record::{Record, settle};
    use precut_library::resolve::{Resource, Revision};
    // Headstock, tailstock and carriage, um/N, of 20 000 N/mm: deflection-compensation, section 5.
    for (meaning, expected) in [
        ("carriage_only", [0.0, 0.0, 0.05]),
        ("three_springs", [0.05, 0.05, 0.05]),
        ("midspan_equal", [0.033_333, 0.033_333, 0.033_333]),
        ("midspan_1_2_1", [0.028_571, 0.057_143, 0.028_571]),
        ("sum_equal", [0.016_667, 0.016_667, 0.016_667]),
    ] {
        let mut value =
            json!({"kind": "lathe", "compliance": {"single_stiffness_n_per_mm": 20_000, "meaning": meaning}});
        settle(Kind::Machine, &mut value);
        let record = Record { kind: Kind::Machine, name: "m".to_owned(), value };
        let mut job =
            json!({"machine": "m", "supports": [{"kind": "centre", "z_mm": 0}, {"kind": "centre", "z_mm": 9}]});
        let asked = asked("deflection-compensation", &job);
        let found =
            vec![(asked[0].clone(), Lookup::Found(Resource { record: record.into(), revision: Revision::Own(1) }))];
        resolve("deflection-compensation", &mut job, &found);
        let got = [
            &job["supports"][0]["compliance_um_per_n"],
            &job["supports"][1]["compliance_um_per_n"],
            &job["carriage"]["compliance_um_per_n"],
        ];
        for (got, expected) in got.into_iter().zip(expected) {
            assert!((got.as_f64().unwrap() - expected).abs() < 1e-6, "{meaning}: {got} {expected}");
        }
    }
}

#[test]
fn a_stored_model_comes_with_the_machine_unless_the_job_says() {
    use precut_library::record::Record;
    use precut_library::resolve::{Resource, Revision};
    let value = json!({"kind": "lathe", "models": {"deflection-compensation": "lathe-7@1"}});
    let record = std::sync::Arc::new(Record { kind: Kind::Machine, name: "m".to_owned(), value });
    for (said, expected) in
        [(None, json!("lathe-7@1")), (Some(json!(null)), json!(null)), (Some(json!("own")), json!("own"))]
    {
        let mut job = json!({"machine": "m"});
        if let Some(said) = said {
            job["model"] = said;
        }
        let asked = asked("deflection-compensation", &job);
        let resource = Resource { record: std::sync::Arc::clone(&record), revision: Revision::Own(1) };
        resolve("deflection-compensation", &mut job, &[(asked[0].clone(), Lookup::Found(resource))]);
        assert_eq!(job["model"], expected);
    }
}

#[test]
fn a_schedule_gets_spindle_prices_and_ranges() {
    let mut job = json!({
        "machine": {"name": "cnc_slant_bed_stiff", "power_kw": 5}, "tool": "cnmg120408_pclnr2525m12", "material": "34crmo4",
        "cut_kind": "medium", "objective": {"kind": "cost"}, "force": {"kind": "kienzle", "normal_force": "judged"},
        "zones": [
            {"id": "a", "z_start_mm": 0, "z_end_mm": 50, "depth_mm": 1, "diameter_mm": 60},
            {"id": "b", "z_start_mm": 50, "z_end_mm": 90, "depth_mm": 1, "diameter_mm": 20},
        ],
        "models": {"tool_life": {"constant": 20, "speed_exponent": -4}}, "compensation": {},
    });
    let resolution = faultless("feed-schedule", &mut job);
    assert_eq!(job["machine"]["power_kw"], json!(5), "the job's own");
    assert_eq!(job["machine"]["torque_n_m"], json!(420.2));
    assert_eq!(job["machine"]["spindle_speed_max_rpm"], json!(3500.0));
    assert_eq!(job["objective"]["edge_cost"], json!(9.0 / 4.0));
    assert_eq!(
        (&job["limits"]["speed_min_m_per_min"], &job["limits"]["speed_max_m_per_min"]),
        (&json!(150.0), &json!(230.0))
    );
    assert_eq!(job["limits"]["feed_min_mm_per_rev"], json!(0.2));
    assert_eq!(job["compensation"]["increment_um"], json!(1.0));
    assert_eq!(job["cutting_edge_angle_deg"], json!(95.0));
    assert!(job.get("cut_kind").is_none() && job.get("uncertainty").is_none());
    assert_origins(&job, &resolution);
    let read: Result<precut_calc::feed_schedule::Job, _> = serde_json::from_value(job.clone());
    assert!(read.is_ok(), "{read:?} of {job}");
    assert!(job.get("shaft").is_none(), "a schedule without a shaft is a whole job");
}

#[test]
fn milling_gets_cutter_spindle_and_force() {
    let mut job = json!({"machine": "hmc_bt50", "tool": "face_100_z7_sekt12", "material": "42CrMo4", "cut": {}});
    let resolution = faultless("fixture-stability", &mut job);
    assert_eq!(job["cutter"], json!({"diameter_mm": 100.0, "teeth": 7}));
    assert_eq!(job["force"], json!({"coefficient": 2526.0, "chip_thickness_exponent": 0.25, "depth_exponent": 0.0}));
    assert_eq!(job["spindle"]["characteristic"][1]["power_kw"], json!(30.0));
    // The force is as well known as the sources of the material agree on it.
    let percent = job["uncertainty"]["force_percent"].as_f64().unwrap();
    assert!(percent > 10.0, "{percent}");
    assert_eq!(from_of(&resolution, "/uncertainty/force_percent"), "material");
    assert_origins(&job, &resolution);
    let mut own = json!({"material": "42CrMo4", "cut": {}, "force": {"coefficient": 2000.0}});
    faultless("fixture-stability", &mut own);
    assert!(own.get("uncertainty").is_none(), "a coefficient of the job is no material's: {own}");
    for (part, ok) in [
        ("cutter", serde_json::from_value::<precut_calc::fixture_stability::FaceMill>(job["cutter"].clone()).is_ok()),
        ("spindle", serde_json::from_value::<precut_calc::fixture_stability::Spindle>(job["spindle"].clone()).is_ok()),
        ("force", serde_json::from_value::<precut_calc::fixture_stability::MillingForce>(job["force"].clone()).is_ok()),
    ] {
        assert!(ok, "{part}");
    }
}

/// There the law is one of several, and a spindle says how fast it turns.
#[test]
fn milling_in_three_directions_gets_a_law_and_the_fastest_speed() {
    let modes = json!({"kind": "modes", "modes": []});
    let cutter = json!({"name": "face_100_z7_sekt12", "teeth": 5});
    let mut job = json!({"machine": "hmc_bt50", "cutter": cutter, "tool": modes, "material": "42CrMo4", "cut": {}});
    faultless("milling-stability", &mut job);
    assert_eq!(job["tool"], modes, "what yields of the tool is the job's");
    assert_eq!(job["cutter"]["teeth"], json!(5), "the job's own");
    assert_eq!(job["cutter"]["diameter_mm"], json!(100.0));
    assert_eq!(job["cutter"]["cutting_edge_angle_deg"], json!(45.0));
    assert_eq!(job["force"]["kind"], json!("power_law"));
    assert_eq!(job["force"]["coefficient"], json!(2526.0));
    assert!(job["uncertainty"]["force_percent"].as_f64().is_some_and(|percent| percent > 10.0));
    assert!(job["spindle"]["speed_max_rpm"].as_f64().is_some_and(|speed| speed > 1000.0));
    for (part, ok) in [
        ("cutter", serde_json::from_value::<precut_calc::milling_stability::Cutter>(job["cutter"].clone()).is_ok()),
        (
            "spindle",
            serde_json::from_value::<precut_calc::milling_stability::MillSpindle>(job["spindle"].clone()).is_ok(),
        ),
        ("force", serde_json::from_value::<precut_calc::milling_stability::EdgeForce>(job["force"].clone()).is_ok()),
    ] {
        assert!(ok, "{part}");
    }
    // Another law that the job states stays as it is.
    let mut job = json!({"material": "42CrMo4", "force": {"kind": "mechanistic", "tangential_n_per_mm2": 900}});
    faultless("milling-stability", &mut job);
    assert_eq!(job["force"], json!({"kind": "mechanistic", "tangential_n_per_mm2": 900}));
}

/// Records by name, and what of the job says otherwise.
fn any_job() -> impl Strategy<Value = Value> {
    let pick = |kind: Kind, of: &'static [&'static str]| {
        let names: Vec<String> = built_in::records(kind)
            .iter()
            .filter(|record| of.is_empty() || record.text("kind").is_some_and(|kind| of.contains(&kind)))
            .map(|record| record.name.clone())
            .collect();
        proptest::sample::select(names)
    };
    let given = proptest::option::of(0.0..0.2_f64);
    (
        pick(Kind::Machine, &["lathe"]),
        pick(Kind::Tool, &["turning_external"]),
        pick(Kind::Material, &[]),
        given.clone(),
        given,
        any::<bool>(),
    )
        .prop_map(|(machine, tool, material, support, carriage, chuck)| {
            let first = if chuck { "chuck" } else { "centre" };
            let mut job = json!({
                "machine": machine, "tool": tool, "material": material,
                "supports": [{"kind": first, "z_mm": 0}, {"kind": "centre", "z_mm": 100}],
                "shaft": {"segments": [{"length_mm": 100, "diameter_mm": 18, "stock_diameter_mm": 19}]},
                "force": {"kind": "kienzle", "normal_force": "judged"}, "cut": {"feed_mm_per_rev": 0.1, "spindle_speed_rpm": 200},
            });
            if let Some(value) = support {
                job["supports"][0]["compliance_um_per_n"] = json!(value);
            }
            if let Some(value) = carriage {
                job["carriage"]["compliance_um_per_n"] = json!(value);
            }
            job
        })
}

proptest! {
    #[test]
    fn what_is_stated_stays_and_what_is_filled_has_an_origin(stated in any_job()) {
        let mut job = stated.clone();
        let resolution = named("deflection-compensation", &mut job);
        for origin in &resolution.origins {
            prop_assert_eq!(job.pointer(&origin.pointer), Some(&origin.value));
            if let Some(said) = stated.pointer(&origin.pointer) {
                prop_assert_eq!(Some(said), job.pointer(&origin.pointer));
            }
        }
        let without_names = |mut job: Value| {
            for name in ["machine", "tool", "material"] {
                job.as_object_mut().unwrap().shift_remove(name);
            }
            job["force"].as_object_mut().unwrap().shift_remove("normal_force");
            job
        };
        let mut filled = Vec::new();
        leaves(&job, String::new(), &mut filled);
        let before = without_names(stated);
        for pointer in filled.iter().filter(|pointer| before.pointer(pointer).is_none()) {
            prop_assert!(resolution.origins.iter().any(|origin| &origin.pointer == pointer), "{} has no origin", pointer);
        }
    }

    #[test]
    fn hostile_jobs_are_refused_or_filled(text in "[a-z0-9@_-]{0,20}", number in any::<f64>(), which in 0_usize..6) {
        let odd = [json!(text), json!(number), json!([text]), json!({"name": text}), json!({"name": number, "x": [1]}), json!({"insert": text, "holder": text})];
        for calculator in ["deflection-compensation", "feed-schedule", "fixture-stability"] {
            for name in ["machine", "tool", "material", "force", "shaft", "supports", "zones", "limits"] {
                let mut job = turning();
                job[name] = odd[which].clone();
                named(calculator, &mut job);
            }
        }
    }
}

fn leaves(value: &Value, pointer: String, found: &mut Vec<String>) {
    match value {
        Value::Object(fields) => {
            fields.iter().for_each(|(name, value)| leaves(value, format!("{pointer}/{name}"), found));
        }
        Value::Array(items) => {
            items.iter().enumerate().for_each(|(at, value)| leaves(value, format!("{pointer}/{at}"), found));
        }
        _ => found.push(pointer),
    }
}
