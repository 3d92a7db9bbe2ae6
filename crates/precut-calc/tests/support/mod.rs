//! Reads the reference cases and translates their sketch of an input into jobs of the contract.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    dead_code,
    unreachable_pub,
    reason = "test support, shared by several test files"
)]

use precut_calc::calculator::{Calculator, Check, Unwatched, Violations};
use precut_calc::deflection_compensation::{DeflectionCompensation, Job, Outcome};
use serde_json::{Map, Value, json};

/// A reference file of the deflection calculator.
pub fn reference(name: &str) -> Value {
    // Used by the tests of the whole workspace, too, which are compiled one folder up.
    let package = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let root = package.ancestors().find(|folder| folder.join("Cargo.lock").is_file()).unwrap_or(package);
    let path = root.join("crates/precut-calc").join("tests/reference/deflection-compensation").join(name);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    serde_json::from_str(&text).unwrap()
}

/// The cases of a reference file.
pub fn cases(name: &str) -> Vec<Value> {
    reference(name)["cases"].as_array().unwrap().clone()
}

fn number(value: &Value, key: &str) -> Option<f64> {
    value.get(key).and_then(Value::as_f64)
}

fn put(object: &mut Map<String, Value>, key: &str, value: Option<Value>) {
    if let Some(value) = value {
        object.insert(key.to_owned(), value);
    }
}

fn renamed(from: &Value, names: &[(&str, &str, f64)]) -> Map<String, Value> {
    let mut to = Map::new();
    for (old, new, factor) in names {
        // Whole numbers and sizes stay bit for bit; compliances go from mm/N to um/N.
        put(&mut to, new, number(from, old).map(|v| json!(v * factor)));
    }
    to
}

fn translate_support(support: &Value) -> Value {
    let kind = match support["kind"].as_str().unwrap() {
        "steady" => "steady_rest",
        "follow" => "follow_rest",
        other => other,
    };
    let mut to = renamed(
        support,
        &[
            ("x", "z_mm", 1.0),
            ("offset", "offset_mm", 1.0),
            ("c", "compliance_um_per_n", 1e3),
            ("c_z", "tangential_compliance_um_per_n", 1e3),
            ("c_rot", "rotational_compliance_rad_per_n_mm", 1.0),
            ("gap", "gap_um", 1e3),
        ],
    );
    if kind == "centre" {
        to.remove("rotational_compliance_rad_per_n_mm");
    }
    put(&mut to, "one_sided", support.get("unilateral").cloned());
    to.insert("kind".to_owned(), json!(kind));
    Value::Object(to)
}

/// The force model of a case.
pub fn translate_force(force: &Value) -> Value {
    match force["model"].as_str().unwrap() {
        "power" => {
            let term = |name: &str| {
                force.get(name).map(|t| {
                    json!({
                        "coefficient": 10.0 * t["C"].as_f64().unwrap(),
                        "depth_exponent": t["x"],
                        "feed_exponent": t["y"],
                        "speed_exponent": t["n"],
                        "correction_factor": number(t, "K").unwrap_or(1.0),
                        "constant_n": number(t, "P0").unwrap_or(0.0),
                    })
                })
            };
            let mut to = Map::new();
            to.insert("kind".to_owned(), json!("power_law"));
            put(&mut to, "passive", term("Py"));
            put(&mut to, "main", term("Pz"));
            put(&mut to, "feed", term("Px"));
            Value::Object(to)
        }
        "kienzle" => {
            let mut to = renamed(
                force,
                &[
                    ("kappa_deg", "cutting_edge_angle_deg", 1.0),
                    ("r_eps", "nose_radius_mm", 1.0),
                    ("kc11", "specific_cutting_force_n_per_mm2", 1.0),
                    ("mc", "cutting_exponent", 1.0),
                    ("kn11", "specific_normal_force_n_per_mm2", 1.0),
                    ("mn", "normal_exponent", 1.0),
                ],
            );
            to.insert("kind".to_owned(), json!("kienzle"));
            Value::Object(to)
        }
        "constant" => {
            let mut to = renamed(force, &[("Py", "passive_n", 1.0), ("Pz", "main_n", 1.0), ("Px", "feed_n", 1.0)]);
            to.insert("kind".to_owned(), json!("constant"));
            Value::Object(to)
        }
        other => json!({ "kind": other }),
    }
}

const CUT: &[(&str, &str, f64)] =
    &[("s", "feed_mm_per_rev", 1.0), ("v", "speed_m_per_min", 1.0), ("n", "spindle_speed_rpm", 1.0)];

/// A case's input as a job of the contract.
pub fn translate(input: &Value) -> Value {
    let shaft = &input["shaft"];
    let segments: Vec<Value> = shaft["segments"]
        .as_array()
        .unwrap()
        .iter()
        .map(|segment| {
            let names = [
                ("length", "length_mm", 1.0),
                ("d", "diameter_mm", 1.0),
                ("d_stock", "stock_diameter_mm", 1.0),
                ("d_in", "bore_diameter_mm", 1.0),
            ];
            Value::Object(renamed(segment, &names))
        })
        .collect();
    let mut to_shaft = renamed(
        shaft,
        &[("E", "youngs_modulus_n_per_mm2", 1.0), ("nu", "poisson_ratio", 1.0), ("density", "density_kg_per_m3", 1.0)],
    );
    to_shaft.insert("segments".to_owned(), json!(segments));
    put(&mut to_shaft, "section", shaft.get("section").cloned());
    put(
        &mut to_shaft,
        "theory",
        shaft.get("theory").map(|t| json!(if t == "euler" { "euler_bernoulli" } else { "timoshenko" })),
    );
    let mut cut = renamed(&input["cut"], CUT);
    put(&mut cut, "feed_direction", shaft.get("feed_direction").cloned());
    put(&mut cut, "speed_diameter", input["cut"].get("speed_diameter").cloned());
    let mut job = Map::new();
    job.insert("shaft".to_owned(), Value::Object(to_shaft));
    job.insert(
        "supports".to_owned(),
        json!(input["supports"].as_array().unwrap().iter().map(translate_support).collect::<Vec<_>>()),
    );
    let carriage = [("c", "compliance_um_per_n", 1e3), ("c_z", "tangential_compliance_um_per_n", 1e3)];
    job.insert("carriage".to_owned(), Value::Object(renamed(&input["carriage"], &carriage)));
    job.insert("force".to_owned(), translate_force(&input["force"]));
    job.insert("cut".to_owned(), Value::Object(cut));
    job.insert("stations".to_owned(), json!({ "kind": "list", "z_mm": input["stations"] }));
    put(&mut job, "include", input.get("effects").cloned());
    put(&mut job, "compare_one_step", Some(json!(true)));
    put(
        &mut job,
        "gravity",
        input.get("gravity").map(|g| {
            Value::Object(renamed(g, &[("g", "acceleration_m_per_s2", 1.0), ("angle_deg", "angle_deg", 1.0)]))
        }),
    );
    put(
        &mut job,
        "stock_profile",
        input.get("stock_profile").map(|p| {
            let (x, d) = (p["x"].as_array().unwrap(), p["d"].as_array().unwrap());
            json!(x.iter().zip(d).map(|(x, d)| json!({ "z_mm": x, "diameter_mm": d })).collect::<Vec<_>>())
        }),
    );
    put(
        &mut job,
        "passes",
        input.get("passes").map(|passes| {
            json!(
                passes
                    .as_array()
                    .unwrap()
                    .iter()
                    .map(|pass| {
                        let mut to = renamed(pass, CUT);
                        to.insert("diameter_mm".to_owned(), pass["d"].clone());
                        put(&mut to, "compensated", pass.get("compensated").cloned());
                        Value::Object(to)
                    })
                    .collect::<Vec<_>>()
            )
        }),
    );
    Value::Object(job)
}

/// A checked and filled job. Switches that it does not say are off: what acts by default has tests of its own.
pub fn prepared(mut job: Value) -> Job {
    let include = job.as_object_mut().unwrap().entry("include").or_insert_with(|| json!({}));
    include.as_object_mut().unwrap().entry("mode").or_insert(json!("as_stated"));
    let mut job: Job = serde_json::from_value(job).unwrap_or_else(|e| panic!("{e}"));
    let mut violations = Violations::default();
    job.check(&mut violations);
    let faults = violations.into_vec();
    assert!(faults.is_empty(), "{faults:?}");
    DeflectionCompensation::fill(&mut job);
    job
}

/// The answer of a job.
pub fn solved(job: Value) -> Outcome {
    DeflectionCompensation::run(&prepared(job), &Unwatched).unwrap().output
}

/// A list of the expected numbers of a case, null where there is none.
pub fn expected(case: &Value, key: &str) -> Option<Vec<Option<f64>>> {
    case["expected"].get(key).map(|list| list.as_array().unwrap().iter().map(Value::as_f64).collect())
}

/// Tolerance of a case.
pub struct Tolerance {
    pub rel: f64,
    pub abs: f64,
}

impl Tolerance {
    pub fn of(case: &Value) -> Self {
        let t = &case["tolerance"];
        Self { rel: number(t, "rel").unwrap_or(0.0), abs: number(t, "abs").unwrap_or(0.0) }
    }

    /// Compares lists; null agrees with null only.
    pub fn assert(&self, what: &str, found: &[Option<f64>], expected: &[Option<f64>]) {
        assert_eq!(found.len(), expected.len(), "{what}");
        for (i, (f, e)) in found.iter().zip(expected).enumerate() {
            match (f, e) {
                (Some(f), Some(e)) => {
                    let allowed = self.abs.max(self.rel * e.abs());
                    assert!(
                        (f - e).abs() <= allowed,
                        "{what}[{i}]: {f} instead of {e}, off by {:e} of {allowed:e}",
                        f - e
                    );
                }
                (None, None) => {}
                _ => panic!("{what}[{i}]: {f:?} instead of {e:?}"),
            }
        }
    }
}

/// `values` times a factor, all of them there.
pub fn scaled(values: &[f64], factor: f64) -> Vec<Option<f64>> {
    values.iter().map(|v| Some(v * factor)).collect()
}

/// `values` times a factor, gaps kept.
pub fn scaled_gaps(values: &[Option<f64>], factor: f64) -> Vec<Option<f64>> {
    values.iter().map(|v| v.map(|v| v * factor)).collect()
}
