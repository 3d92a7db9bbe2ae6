//! How long a calculation goes on after nobody waits for it any more, at the ends of the ranges of every calculator.
//!
//! Every number of an example goes to the ends of its range, one at a time; so do combinations that are known to be dear. What
//! counts is the processor time of the one thread that calculates, so that waiting for a core changes nothing.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Mutex;
use std::time::Duration;

use cpu_time::ThreadTime;
use precut_calc::calculator::{Calculator, Check, Diagnosable, Message, Monitor, Registrar, Violations};
use precut_calc::deflection_compensation::DeflectionCompensation;
use precut_calc::diagnosis::Diagnosis;
use precut_calc::feed_schedule::FeedSchedule;
use precut_calc::fixture_stability::FixtureStability;
use precut_calc::ring_roundness::RingRoundness;
use serde_json::{Value, json};
use utoipa::{PartialSchema, ToSchema};

/// What a service takes on at most: dearer jobs are refused before they begin.
const MOST_MS: f64 = 3_600_000.0;
const MOST_BYTES: u64 = 1 << 30;
/// A job that is said to take less needs no cancel, and takes no longer than so many times that.
const SHORT_MS: f64 = 50.0;
const SHORT_AT_MOST: Duration = Duration::from_secs(1);
/// Longest work between two looks, and from the cancel to the end. 100 ms are promised, of a release build on a core of its own; on a
/// shared machine whose other core works, too, the same work of a test build has taken 165 ms of processor time.
const LONGEST: Duration = Duration::from_millis(250);
/// When jobs are cancelled: a job at the end of a range, and one of the dear combinations.
const ENDS: [Duration; 1] = [Duration::from_millis(30)];
const DEAR: [Duration; 2] = [Duration::ZERO, Duration::from_millis(300)];

/// Cancels after some processor time, and notes the longest work between two looks.
struct Stopwatch {
    after: Duration,
    seen: Mutex<Seen>,
}

/// Processor time of this thread.
fn worked() -> Duration {
    ThreadTime::now().as_duration()
}

struct Seen {
    begin: Duration,
    last: Duration,
    longest: Duration,
}

impl Stopwatch {
    fn new(after: Duration) -> Self {
        let seen = Seen { begin: worked(), last: Duration::ZERO, longest: Duration::ZERO };
        Self { after, seen: Mutex::new(seen) }
    }

    fn look(&self) -> bool {
        let mut seen = self.seen.lock().unwrap();
        let now = worked().saturating_sub(seen.begin);
        seen.longest = seen.longest.max(now.saturating_sub(seen.last));
        seen.last = now;
        now >= self.after
    }
}

impl Monitor for Stopwatch {
    fn cancelled(&self) -> bool {
        self.look()
    }
    fn progress(&self, _fraction: f64, _stage: Message) {}
}

/// Longest work between two looks or up to the end, and all of it.
fn longest_work<C: Calculator>(job: &C::Input, after: Duration) -> (Duration, Duration) {
    let watch = Stopwatch::new(after);
    // What comes of it, and whether anything does, is no matter here.
    let _ = C::run(job, &watch);
    watch.look();
    let seen = watch.seen.into_inner().unwrap();
    (seen.longest, seen.last)
}

/// What a calculator's schema says of a place, whatever the variants of unions on the way.
struct Schema {
    root: Value,
    named: BTreeMap<String, Value>,
}

impl Schema {
    fn of<T: ToSchema>() -> Self {
        let mut named = Vec::new();
        T::schemas(&mut named);
        let named = named.into_iter().map(|(name, schema)| (name, serde_json::to_value(schema).unwrap())).collect();
        Self { root: serde_json::to_value(<T as PartialSchema>::schema()).unwrap(), named }
    }

    /// A schema and everything it is made of.
    fn parts<'a>(&'a self, schema: &'a Value, into: &mut Vec<&'a Value>) {
        into.push(schema);
        if let Some(name) = schema["$ref"].as_str().and_then(|name| name.rsplit('/').next())
            && let Some(named) = self.named.get(name)
        {
            self.parts(named, into);
        }
        for list in ["allOf", "oneOf", "anyOf"] {
            schema[list].as_array().into_iter().flatten().for_each(|part| self.parts(part, into));
        }
    }

    fn inside<'a>(&'a self, schemas: &[&'a Value], step: &str) -> Vec<&'a Value> {
        let mut found = Vec::new();
        for schema in schemas {
            let property = schema["properties"].get(step);
            let item = || schema.get("items").filter(|_| step.parse::<usize>().is_ok());
            property.or_else(item).into_iter().for_each(|inside| self.parts(inside, &mut found));
        }
        found
    }

    /// Ends of the ranges of all numbers of a value, with their pointers. Of lists the first and the last item.
    fn ends(&self, value: &Value) -> Vec<(String, Value)> {
        let mut schemas = Vec::new();
        self.parts(&self.root, &mut schemas);
        let mut ends = Vec::new();
        self.ends_of(value, &schemas, "", &mut ends);
        ends
    }

    fn ends_of(&self, value: &Value, schemas: &[&Value], pointer: &str, ends: &mut Vec<(String, Value)>) {
        match value {
            Value::Number(there) => {
                // What may not be reached itself is come near to, and so is zero, which often switches off.
                let near = |end: f64| if end.abs() > 0.0 { end * (1.0 - 1e-6) } else { 1e-6 };
                let of = |names: [&str; 2]| {
                    let all = schemas.iter().flat_map(|schema| names.map(|name| schema[name].as_f64()));
                    all.flatten().collect::<Vec<f64>>()
                };
                let reached = of(["minimum", "maximum"]);
                let zeros = reached.iter().filter(|end| end.abs() <= 0.0).map(|end| near(*end));
                let beyond = of(["exclusiveMinimum", "exclusiveMaximum"]).into_iter().map(near);
                let distinct: BTreeSet<u64> =
                    reached.iter().copied().chain(zeros).chain(beyond).map(f64::to_bits).collect();
                let others = distinct.into_iter().map(f64::from_bits).filter(|at| there.as_f64() != Some(*at));
                ends.extend(others.map(|at| {
                    let whole = at.fract().abs() < 1e-12 && at.abs() < 1e15;
                    #[allow(clippy::cast_possible_truncation)]
                    let number = if whole { json!(at as i64) } else { json!(at) };
                    (pointer.to_owned(), number)
                }));
            }
            Value::Array(items) => {
                let last = items.len().saturating_sub(1);
                for (index, item) in items.iter().enumerate().filter(|(index, _)| *index == 0 || *index == last) {
                    let inside = self.inside(schemas, &index.to_string());
                    self.ends_of(item, &inside, &format!("{pointer}/{index}"), ends);
                }
            }
            Value::Object(fields) => {
                for (name, field) in fields {
                    self.ends_of(field, &self.inside(schemas, name), &format!("{pointer}/{name}"), ends);
                }
            }
            _ => {}
        }
    }
}

/// The job, if it is one.
fn job<C: Calculator>(value: &Value) -> Option<C::Input> {
    let mut job: C::Input = serde_json::from_value(value.clone()).ok()?;
    let mut violations = Violations::default();
    job.check(&mut violations);
    if !violations.is_empty() {
        return None;
    }
    C::fill(&mut job);
    Some(job)
}

/// Looks at every calculator.
#[derive(Default)]
struct Looked {
    faults: Vec<String>,
    jobs: usize,
    cancelled: usize,
    longest: Duration,
}

impl Looked {
    fn at<C: Calculator>(&mut self, value: &Value, name: &str, cancels: &[Duration]) {
        let Some(job) = job::<C>(value) else { return };
        let cost = C::cost(&job);
        if cost.ms > MOST_MS || cost.bytes > MOST_BYTES {
            return;
        }
        self.jobs += 1;
        let name = format!("{} {name}, said to take {:.0} ms", C::META.id, cost.ms);
        if cost.ms < SHORT_MS {
            let (_, all) = longest_work::<C>(&job, SHORT_AT_MOST);
            if all >= SHORT_AT_MOST {
                self.faults.push(format!("{name}: takes {all:.1?}"));
            }
            return;
        }
        self.cancelled += 1;
        for &after in cancels {
            let (longest, all) = longest_work::<C>(&job, after);
            if std::env::var_os("PRECUT_SHOW").is_some() {
                eprintln!("{longest:>10.1?} {all:>10.1?} {name}");
            }
            self.longest = self.longest.max(longest);
            if longest > LONGEST {
                self.faults.push(format!("{name}: {longest:.1?} without a look"));
            }
        }
    }

    fn all_of<C: Calculator>(&mut self) {
        let filled = job::<C>(&serde_json::from_str(C::META.examples[0].job).unwrap()).unwrap();
        let example = serde_json::to_value(filled).unwrap();
        for (pointer, end) in Schema::of::<C::Input>().ends(&example) {
            let mut value = example.clone();
            *value.pointer_mut(&pointer).unwrap() = end.clone();
            self.at::<C>(&value, &format!("{pointer} = {end}"), &ENDS);
        }
        for (index, combination) in dear(C::META.id).into_iter().enumerate() {
            let mut value: Value = serde_json::from_str(C::META.examples[0].job).unwrap();
            merge(&mut value, &combination);
            assert!(job::<C>(&value).is_some(), "{}: {combination} is no job", C::META.id);
            self.at::<C>(&value, &format!("dear {index}: {combination}"), &DEAR);
        }
    }
}

impl Registrar for Looked {
    fn calculator<C: Calculator>(&mut self) {
        self.all_of::<C>();
    }
}

/// A merge patch (RFC 7396) without removals.
fn merge(value: &mut Value, patch: &Value) {
    match patch {
        Value::Object(fields) => {
            for (name, part) in fields {
                merge(&mut value[name.as_str()], part);
            }
        }
        _ => *value = patch.clone(),
    }
}

/// Deviations of eight lobes under waves that never repeat, so many readings.
fn readings(count: u32) -> Value {
    let um = |i: u32| {
        let turn = f64::from(i) / f64::from(count) * std::f64::consts::TAU;
        4.0 * (8.0 * turn).cos() + (f64::from(i) * 0.754_877_666).fract()
    };
    (0..count)
        .map(|i| json!({"angle_deg": 360.0 * f64::from(i) / f64::from(count), "radial_deviation_um": um(i)}))
        .collect()
}

/// Combinations that take long, on top of the first example.
fn dear(calculator: &str) -> Vec<Value> {
    match calculator {
        "fixture-stability" => vec![
            json!({"cut": {"spindle_speed_rpm": 2}}),
            json!({"cut": {"spindle_speed_rpm": 0.5}, "analyses": ["verdict"]}),
            json!({"cutter": {"teeth": 200}, "simulation": {"steps_per_tooth": 20000, "tooth_periods": 3000, "verified": true}}),
            json!({"cutter": {"teeth": 120}, "effects": [{"kind": "tooth_runout", "runout_mm": 0.01}], "analyses": ["verdict"]}),
            json!({"effects": [{"kind": "contact_hardening", "cubic_per_mm2": 1000.0}]}),
            json!({"cut": {"spindle_speed_rpm": 20}, "analyses": ["lobes"],
                   "lobes": {"from_rpm": 5, "to_rpm": 40, "speeds": 400, "depths": 50, "map": true}}),
        ],
        "milling-stability" => vec![
            json!({"cut": {"spindle_speed_rpm": 25}, "analyses": ["intervals"]}),
            json!({"cut": {"spindle_speed_rpm": 25}, "analyses": ["motion", "proposals"]}),
            json!({"cutter": {"teeth": 12, "helix_angle_deg": 40, "radial_offset_um": [0, 9, 1, 5, 3, 7, 2, 8, 4, 6, 5, 1]}}),
            json!({"speed_variation": {"amplitude": 0.2, "frequency_hz": 15.833}, "analyses": ["lobes", "speeds"]}),
        ],
        "ring-roundness" => vec![
            json!({"samples": 200_000, "tool": {"revolutions": 1000}}),
            json!({"analyses": ["setup_map"], "setup_map": {"tool_angles": 100, "support_angles": 100}}),
            json!({"samples": 200_000, "supports": {"roller_radius_mm": 20, "distance_mm": 225, "depth_mm": 126}}),
            json!({"analyses": ["settings_search"], "settings_search": {"target_um": 0.01, "compliance_ratio_max": 3}}),
        ],
        "roundness-evaluation" => vec![
            json!({"deviations": readings(200_000), "profile_points": 200_000}),
            // A symmetric section: many circles to tell apart.
            json!({"deviations": readings(720), "profile_points": 200_000}),
        ],
        "feed-schedule" => vec![json!({"method": {"kind": "continuous", "grid_points": 1000, "segments_max": 100}})],
        _ => Vec::new(),
    }
}

/// When diagnoses are cancelled: while the base is prepared, while signatures are computed, in the search or the folds.
const WITHIN: [Duration; 3] = [Duration::from_millis(1), Duration::from_millis(200), Duration::from_millis(800)];

/// The first diagnosis of a calculator with a base that is dear to predict, and with all that was measured so many times over,
/// each time as runs of their own and a little different.
fn diagnosis<M: Diagnosable>(base: &Value, times: usize) -> Value {
    let mut value: Value = serde_json::from_str(M::DIAGNOSES[0].job).unwrap();
    merge(&mut value["job"], base);
    let quantity = value["quantity"].as_str().unwrap().to_owned();
    let runs = value["runs"].as_array().cloned().unwrap_or_default();
    let rows = value["measurements"].as_array().cloned().unwrap();
    let apart = if rows[0].get("run").is_some() { runs.len() } else { 0 };
    let mut measured = Vec::with_capacity(times * rows.len());
    for k in 0..times {
        for (index, row) in rows.iter().enumerate() {
            let mut row = row.clone();
            if apart > 0 {
                row["run"] = json!(row["run"].as_u64().unwrap() as usize + k * apart);
            }
            let by = 1.0 + 1e-3 * ((k * 7 + index * 13) % 11) as f64;
            row[&quantity] = json!(row[&quantity].as_f64().unwrap() * by);
            measured.push(row);
        }
    }
    value["measurements"] = json!(measured);
    value["runs"] = json!(vec![runs; if apart > 0 { times } else { 1 }].concat());
    value
}

#[test]
fn a_cancelled_diagnosis_ends_soon_wherever_it_is() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let looked = pool.install(|| {
        let mut looked = Looked::default();
        let vise = [
            json!({"cutter": {"teeth": 200}, "cut": {"spindle_speed_rpm": 20}}),
            json!({"effects": [{"kind": "contact_hardening", "cubic_per_mm2": 1000.0}]}),
        ];
        for base in &vise {
            let job = diagnosis::<FixtureStability>(base, 1);
            looked.at::<Diagnosis<FixtureStability>>(&job, &base.to_string(), &WITHIN);
        }
        let ring = json!({"tool": {"spark_out_revolutions": 1000}});
        let job = diagnosis::<RingRoundness>(&ring, 1);
        looked.at::<Diagnosis<RingRoundness>>(&job, &ring.to_string(), &WITHIN);
        let shafts = diagnosis::<DeflectionCompensation>(&json!({}), 20);
        looked.at::<Diagnosis<DeflectionCompensation>>(&shafts, "20 times", &WITHIN);
        let cuts = diagnosis::<FeedSchedule>(&json!({}), 40);
        looked.at::<Diagnosis<FeedSchedule>>(&cuts, "40 times", &WITHIN);
        looked
    });
    eprintln!("{} cancelled, {:.1?} without a look at most", looked.cancelled, looked.longest);
    assert_eq!(looked.cancelled, 5);
    assert!(looked.faults.is_empty(), "{}", looked.faults.join("\n"));
}

#[test]
fn a_cancelled_calculation_ends_soon_at_the_ends_of_all_ranges() {
    // One thread: what it works is what is worked.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let looked = pool.install(|| {
        let mut looked = Looked::default();
        precut_calc::register(&mut looked);
        looked
    });
    eprintln!("{} jobs, {} cancelled, {:.1?} without a look at most", looked.jobs, looked.cancelled, looked.longest);
    assert!(looked.cancelled > 100, "{} of {} jobs", looked.cancelled, looked.jobs);
    assert!(looked.faults.is_empty(), "{}", looked.faults.join("\n"));
}
