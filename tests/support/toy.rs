//! A calculator with one of everything that the service has to carry: a bar that sags.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use precut::registry::Registry;
use precut_calc::calculator::{
    Answer, Axis, Basis, Block, Calculator, CalculatorKind, Check, Codes, Column, Cost, Dialect, Example, Failure,
    Figure, Finding, Frame, Hallmark, Item, Measured, MeasuredRow, Message, Meta, Monitor, Panel, Program,
    ProgramOrigin, Registrar, Role, Table, Violations, checkpoint,
};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Id of the toy.
pub const BAR: &str = "sagging-bar";

/// A job that runs.
pub const JOB: &str = r#"{"length_mm": 500.0, "load_n": 100.0}"#;

/// The registry with the toy in it.
pub fn registry() -> Registry {
    Registry::with(Registrar::calculator::<Bar>).expect("the toy is a decent calculator")
}

pub struct Bar;

/// A bar under a load.
#[derive(Debug, Clone, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct BarJob {
    /// Length of the bar.
    #[schema(minimum = 1, maximum = 20000, example = 500.0, extensions(("x-unit" = json!("mm"))))]
    pub length_mm: f64,
    /// Load in the middle.
    #[schema(minimum = 0, maximum = 10000, example = 100.0, extensions(("x-unit" = json!("N"))))]
    pub load_n: f64,
    /// Stations along the bar.
    #[serde(default = "ten")]
    #[schema(minimum = 2, maximum = 200_000, default = 10, example = 10, extensions(("x-unit" = json!("1"))))]
    pub stations: u32,
    /// What the toy shall do.
    #[serde(default)]
    pub behaviour: Behaviour,
    /// How long it computes; it tells its progress meanwhile and can be stopped.
    #[serde(default)]
    #[schema(minimum = 0, maximum = 600_000, default = 0.0, example = 0.0, extensions(("x-unit" = json!("ms"))))]
    pub duration_ms: f64,
    /// Estimated work beyond that.
    #[serde(default)]
    #[schema(minimum = 0, maximum = 1e9, default = 0.0, example = 0.0, extensions(("x-unit" = json!("ms"))))]
    pub work_ms: f64,
    /// What was measured.
    #[serde(default)]
    pub measurements: Readings,
}

fn ten() -> u32 {
    10
}

/// What the toy does.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Behaviour {
    /// Answers.
    #[default]
    Quick,
    /// Answers after a second.
    Slow,
    /// Has no solution.
    Infeasible,
    /// Answers, but without a command at one station.
    Incomplete,
    /// Crashes.
    Panic,
    /// Ends the process.
    Abort,
}

/// By another name, as a derived schema treats a generic type's name as its own business.
type Readings = Measured<Reading>;

/// A measured point.
#[derive(Debug, Clone, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Reading {
    /// Place.
    #[schema(minimum = 0, maximum = 20000, extensions(("x-unit" = json!("mm"))))]
    pub z_mm: f64,
    /// Sag.
    #[schema(minimum = -10000, maximum = 10000, extensions(("x-unit" = json!("um"))))]
    pub sag_um: f64,
}

impl MeasuredRow for Reading {
    const MAX_ROWS: usize = 100_000;
}

/// How the bar sags.
#[derive(Debug, Clone, Serialize, Deserialize, ToSchema)]
pub struct BarResult {
    /// Places.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub z_mm: Vec<f64>,
    /// Sag there.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub sag_um: Vec<f64>,
    /// Largest of them.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub max_sag_um: f64,
}

/// Bars, by the bits of their lengths, whose computation does not end before they are let go.
static HELD: Mutex<BTreeSet<u64>> = Mutex::new(BTreeSet::new());
/// How often bars of a length were computed.
static RUNS: Mutex<BTreeMap<u64, u32>> = Mutex::new(BTreeMap::new());

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Bars of a length are being computed as long as it lives.
pub struct Held(u64);

/// Holds the computation of bars of a length, one that no other test of this program has.
#[allow(dead_code)] // not every program of tests holds one
pub fn hold(length_mm: u32) -> Held {
    let length = bits(length_mm.into());
    lock(&HELD).insert(length);
    Held(length)
}

impl Drop for Held {
    fn drop(&mut self) {
        lock(&HELD).remove(&self.0);
    }
}

/// How often bars of a length were computed in this process.
#[allow(dead_code)] // not every program of tests asks
pub fn runs(length_mm: u32) -> u32 {
    lock(&RUNS).get(&bits(length_mm.into())).copied().unwrap_or(0)
}

/// Length of the bars that a process holds whose environment says so, until the file that it names is there.
pub const HELD_MM: &str = "TOY_HELD_MM";
/// Name of that file.
pub const GATE: &str = "TOY_GATE";

/// A length as a name.
fn bits(length_mm: f64) -> u64 {
    length_mm.to_bits()
}

fn is_held(length_mm: f64) -> bool {
    let told = || std::env::var(HELD_MM).is_ok_and(|held| held.parse() == Ok(length_mm));
    let open = || std::env::var_os(GATE).is_some_and(|gate| Path::new(&gate).exists());
    lock(&HELD).contains(&bits(length_mm)) || (told() && !open())
}

/// Takes the time that the job asks for, telling how far it is and what the bar looks like so far.
fn take_time(input: &BarJob, monitor: &dyn Monitor) -> Result<(), Failure> {
    let (start, whole) = (Instant::now(), Duration::from_secs_f64(input.duration_ms / 1e3));
    let mut pictures = 0;
    loop {
        let held = is_held(input.length_mm);
        if start.elapsed() >= whole && !held {
            return Ok(());
        }
        checkpoint(monitor)?;
        let elapsed_s = start.elapsed().as_secs_f64();
        // Nobody knows when what is held ends: it gets on, and never arrives.
        let share = elapsed_s / if held { elapsed_s + 1.0 } else { whole.as_secs_f64() };
        monitor.progress(share.min(1.0), Message::new("bar_sags").with("percent", (100.0 * share).floor()));
        if share >= 0.25 * f64::from(pictures) {
            pictures += 1;
            monitor.interim(figure("sag", &[0.0, input.length_mm], &[0.0, share]));
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn figure(id: &'static str, x: &[f64], y: &[f64]) -> Figure {
    let line = Item::Line { name: "sag", x: x.to_vec(), y: y.iter().copied().map(Some).collect(), role: Role::Plain };
    Figure {
        id,
        title: Message::new("sag"),
        frame: Frame::Stacked,
        x: Axis::linear("place", "mm"),
        panels: vec![Panel { y: Axis::linear("sag", "um"), height: 1.0, items: vec![line] }],
    }
}

impl Check for BarJob {
    fn check(&self, violations: &mut Violations) {
        violations.require(self.load_n <= 10.0 * self.length_mm, || {
            Finding::new("load_too_large", "/load_n").measured(self.load_n, 10.0 * self.length_mm, "N")
        });
    }
}

impl Calculator for Bar {
    type Input = BarJob;
    type Output = BarResult;

    const META: Meta = Meta {
        id: BAR,
        kind: CalculatorKind::Calculator,
        version: 1,
        title: "Sagging bar",
        question: "How far does the bar sag?",
        summary: "A bar on two supports under a load.",
        references: &["A textbook."],
        examples: &[Example { id: "plain", title: "A plain bar", job: JOB }],
        hallmarks: &[Hallmark::Of("/length_mm"), Hallmark::Count("/measurements"), Hallmark::Of("/behaviour")],
        study_outputs: &["/max_sag_um"],
        codes: Codes {
            faults: &[&["load_too_large"]],
            failures: &[&["bar_would_break", "path_incomplete"]],
            warnings: &[],
            explanations: &[&["sag_small"]],
            stages: &[&["bar_sags"]],
            labels: &[&["sag", "place"]],
        },
        figures: &["sag", "load"],
        tables: &["stations", "summary"],
        program: Some(ProgramOrigin::Made),
    };

    fn fill(_input: &mut BarJob) {}

    fn cost(input: &BarJob) -> Cost {
        // Slow answers take longer than they say: they are for those who wait.
        let least_ms = if matches!(input.behaviour, Behaviour::Slow) { 400.0 } else { 0.0 };
        let ms = least_ms + input.duration_ms + input.work_ms + f64::from(input.stations) * 1e-4;
        Cost { ms, bytes: 1000, driver: "/stations" }
    }

    fn run(input: &BarJob, monitor: &dyn Monitor) -> Result<Answer<BarResult>, Failure> {
        *lock(&RUNS).entry(bits(input.length_mm)).or_default() += 1;
        take_time(input, monitor)?;
        match input.behaviour {
            Behaviour::Slow => {
                let start = Instant::now();
                while start.elapsed() < Duration::from_secs(1) {
                    checkpoint(monitor)?;
                    std::thread::sleep(Duration::from_millis(5));
                }
            }
            Behaviour::Infeasible => {
                let finding = Finding::new("bar_would_break", "/load_n").measured(input.load_n, 1.0, "N");
                return Err(Failure::Infeasible(finding));
            }
            Behaviour::Panic => panic!("the toy was asked to"),
            Behaviour::Abort => std::process::abort(),
            Behaviour::Quick | Behaviour::Incomplete => {}
        }
        let spacing_mm = input.length_mm / f64::from(input.stations - 1);
        let z_mm: Vec<f64> = (0..input.stations).map(|station| f64::from(station) * spacing_mm).collect();
        let sag_um: Vec<f64> =
            z_mm.iter().map(|z| 1e-3 * input.load_n * z * (input.length_mm - z) / input.length_mm).collect();
        let max_sag_um = sag_um.iter().copied().fold(0.0, f64::max);
        Ok(Answer {
            output: BarResult { z_mm, sag_um, max_sag_um },
            warnings: vec![],
            explanation: vec![Message::new("sag_small").with("sag_um", max_sag_um)],
            basis: vec![Basis { equation: "toy/1", source: "a textbook" }],
        })
    }

    fn figures(_input: &BarJob, output: &BarResult) -> Vec<Figure> {
        ["sag", "load"].map(|id| figure(id, &output.z_mm, &output.sag_um)).to_vec()
    }

    fn tables(_input: &BarJob, output: &BarResult) -> Vec<Table> {
        vec![
            Table {
                id: "stations",
                columns: vec![Column::numbers("z", "mm", &output.z_mm), Column::numbers("sag", "um", &output.sag_um)],
            },
            Table { id: "summary", columns: vec![Column::numbers("max_sag", "um", &[output.max_sag_um])] },
        ]
    }

    fn program(input: &BarJob, _output: &BarResult) -> Option<Result<Program, Failure>> {
        Some(if input.behaviour == Behaviour::Incomplete {
            Err(Failure::Infeasible(Finding::new("path_incomplete", "/load_n")))
        } else {
            let blocks = vec![
                Block::Modes,
                Block::Rapid { x_diameter_mm: Some(50.0), z_mm: Some(2.0) },
                Block::Cut { x_diameter_mm: 50.0, z_mm: -input.length_mm, feed_mm_per_rev: Some(0.2) },
                Block::End(None),
            ];
            Ok(Program { dialect: Dialect::Fanuc, increment_mm: 0.001, blocks })
        })
    }
}
