//! A calculator with one of everything, for the tests of what surrounds calculators.

#![allow(clippy::panic, clippy::cast_precision_loss)]

use std::borrow::Cow;
use std::time::{Duration, Instant};

use precut_calc::calculator::{
    Answer, Axis, Basis, Calculator, CalculatorKind, Check, Codes, Column, Cost, Example, Failure, Figure, Finding,
    Frame, Item, Measured, MeasuredRow, Message, Meta, Monitor, Panel, Role, Table, Values, Violations, checkpoint,
};
use serde::{Deserialize, Serialize};
use serde_json::json;
use utoipa::ToSchema;
use utoipa::openapi::schema::{AllOfBuilder, Array, ArrayBuilder};
use utoipa::openapi::{Ref, Schema};

use super::Registry;

/// A bar on supports.
#[derive(Debug, Clone, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ToyInput {
    /// Length of the bar.
    #[schema(minimum = 1, maximum = 20000, example = 500.0,
        extensions(("x-unit" = json!("mm")), ("x-code" = json!("toy_bad_length"))))]
    pub(crate) length_mm: f64,
    /// Young's modulus.
    #[schema(minimum = 1000, maximum = 1_000_000, example = 210_000.0, extensions(("x-unit" = json!("N/mm2"))))]
    #[serde(default = "steel")]
    pub(crate) youngs_modulus_n_per_mm2: f64,
    /// Pieces.
    #[schema(schema_with = segments)]
    pub(crate) segments: Vec<ToySegment>,
    /// How it is held.
    #[schema(schema_with = support)]
    #[serde(default)]
    pub(crate) support: ToySupport,
    /// A second support.
    #[serde(default)]
    pub(crate) steady: Option<ToySupport>,
    /// Where to look.
    #[serde(default)]
    pub(crate) stations: ToyStations,
    /// What was measured.
    #[serde(default)]
    pub(crate) measurements: ToyRows,
    /// How it behaves.
    #[serde(default)]
    pub(crate) mode: ToyMode,
    /// Estimated work.
    #[schema(minimum = 0, maximum = 1e9, extensions(("x-unit" = json!("ms"))))]
    #[serde(default)]
    pub(crate) work_ms: f64,
    /// Effects that act.
    #[serde(default)]
    pub(crate) effects: Vec<ToySupport>,
}

/// A derived schema has no place for the code of an array of structs or of a union.
fn segments() -> Array {
    ArrayBuilder::new()
        .items(Ref::from_schema_name("ToySegment"))
        .min_items(Some(1))
        .max_items(Some(5))
        .extensions(Some([("x-code", json!("toy_no_segments"))].into_iter().collect()))
        .build()
}

fn support() -> Schema {
    let with_code = AllOfBuilder::new()
        .item(Ref::from_schema_name("ToySupport"))
        .extensions(Some([("x-code", json!("unknown_support"))].into_iter().collect()))
        .build();
    Schema::AllOf(with_code)
}

fn steel() -> f64 {
    210_000.0
}

/// A piece.
#[derive(Debug, Clone, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ToySegment {
    /// Diameter.
    #[schema(exclusive_minimum = 0, maximum = 1000, extensions(("x-unit" = json!("mm"))))]
    pub(crate) diameter_mm: f64,
}

/// A support.
#[derive(Debug, Clone, Default, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub(crate) enum ToySupport {
    /// Does not move.
    #[default]
    Rigid,
    /// Gives way.
    Elastic {
        /// Compliance.
        #[schema(minimum = 0, maximum = 10, extensions(("x-unit" = json!("um/N"))))]
        compliance_um_per_n: f64,
    },
    /// At several places.
    Several {
        /// Where.
        #[schema(max_items = 3, minimum = 0, maximum = 20000, extensions(("x-unit" = json!("mm"))))]
        places_mm: Vec<f64>,
    },
    /// A part of its own.
    Bar(ToySegment),
}

/// Stations: a list or a count.
#[derive(Debug, Clone, Serialize, Deserialize, ToSchema)]
#[serde(untagged)]
pub(crate) enum ToyStations {
    /// So many.
    Count(u32),
    /// These.
    List(Vec<f64>),
}

impl Default for ToyStations {
    fn default() -> Self {
        Self::Count(3)
    }
}

/// By another name, as a derived schema treats a generic type's name as its own business.
type ToyRows = Measured<ToyRow>;

/// A measured row.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ToyRow {
    /// Place.
    #[schema(minimum = 0, maximum = 20000, extensions(("x-unit" = json!("mm"))))]
    pub(crate) z_mm: f64,
    /// Deviation.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub(crate) deviation_um: f64,
    /// Who measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) gauge: Option<String>,
    /// How often.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub(crate) repeats: Option<u32>,
}

impl MeasuredRow for ToyRow {
    const MAX_ROWS: usize = 2000;
}

/// How the toy behaves.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum ToyMode {
    /// Answers.
    #[default]
    Plain,
    /// Works until cancelled, a minute at most.
    Endless,
    /// Works a tenth of a second.
    Slow,
    /// Panics.
    Panic,
    /// Gives a number that is none.
    NotFinite,
    /// Has no solution.
    Infeasible,
}

impl Check for ToyInput {
    fn check(&self, violations: &mut Violations) {
        for (index, segment) in self.segments.iter().enumerate() {
            violations.require(segment.diameter_mm <= self.length_mm, || {
                let pointer = format!("/segments/{index}/diameter_mm");
                Finding::new("thicker_than_long", pointer).measured(segment.diameter_mm, self.length_mm, "mm")
            });
        }
    }
}

/// What comes out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub(crate) struct ToyOutput {
    /// Deflections.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub(crate) deflections_um: Vec<f64>,
    /// How many rows there were.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub(crate) rows: usize,
}

/// The calculator.
pub(crate) struct Toy;

impl Calculator for Toy {
    type Input = ToyInput;
    type Output = ToyOutput;
    const META: Meta = Meta {
        id: "toy-bar",
        kind: CalculatorKind::Calculator,
        version: 7,
        title: "Toy",
        question: "How far does a toy bend?",
        summary: "Only for tests.",
        references: &[],
        examples: &[Example {
            id: "plain",
            title: "Plain",
            job: r#"{"length_mm": 500, "segments": [{"diameter_mm": 20}]}"#,
        }],
        hallmarks: &[],
        study_outputs: &["/deflections_um/0"],
        codes: Codes {
            faults: &[&["toy_bad_length", "toy_no_segments", "unknown_support", "thicker_than_long"]],
            failures: &[&["no_solution_here"]],
            warnings: &[&["toy_is_slender"]],
            explanations: &[&["toy_bends"]],
            stages: &[],
            labels: &[],
        },
        figures: &["bending"],
        tables: &["bending"],
        program: None,
    };

    fn fill(_input: &mut ToyInput) {}

    fn cost(input: &ToyInput) -> Cost {
        let least_ms = match input.mode {
            ToyMode::Endless | ToyMode::Slow => 100.0,
            _ => 0.0,
        };
        Cost { ms: input.work_ms.max(least_ms), bytes: 1000, driver: "/work_ms" }
    }

    fn run(input: &ToyInput, monitor: &dyn Monitor) -> Result<Answer<ToyOutput>, Failure> {
        let count = match &input.stations {
            ToyStations::Count(count) => *count as usize,
            ToyStations::List(list) => list.len(),
        };
        let mut deflections_um: Vec<f64> = (0..count).map(|i| input.length_mm / (i as f64 + 3.0)).collect();
        match input.mode {
            ToyMode::Plain => {}
            ToyMode::Endless => work(Duration::from_mins(1), monitor)?,
            ToyMode::Slow => work(Duration::from_millis(100), monitor)?,
            ToyMode::Panic => panic!("the toy breaks"),
            ToyMode::NotFinite => deflections_um[0] = f64::NAN,
            ToyMode::Infeasible => {
                let finding = Finding::new("no_solution_here", "/length_mm").measured(input.length_mm, 1.0, "mm");
                return Err(Failure::Infeasible(finding));
            }
        }
        Ok(Answer {
            output: ToyOutput { deflections_um, rows: input.measurements.rows().len() },
            warnings: vec![Finding::new("toy_is_slender", "/length_mm").measured(input.length_mm, 100.0, "mm")],
            explanation: vec![Message::new("toy_bends").with("share", 0.83)],
            basis: vec![Basis { equation: "toy/1", source: "none" }],
        })
    }

    fn figures(_input: &ToyInput, output: &ToyOutput) -> Vec<Figure> {
        let x: Vec<f64> = (0..output.deflections_um.len()).map(|i| i as f64).collect();
        let y = output.deflections_um.iter().copied().map(Some).collect();
        let line = Item::Line { name: "bending", x, y, role: Role::Plain };
        vec![Figure {
            id: "bending",
            title: Message { code: "bending", values: Values::new() },
            frame: Frame::Stacked,
            x: Axis::linear("bending", "1"),
            panels: vec![Panel { y: Axis::linear("bending", "um"), height: 1.0, items: vec![line] }],
        }]
    }

    fn tables(input: &ToyInput, output: &ToyOutput) -> Vec<Table> {
        let words = output.deflections_um.iter().map(|_| Cow::Owned(format!("{} mm", input.length_mm))).collect();
        let columns = vec![Column::numbers("deflection", "um", &output.deflections_um), Column::words("length", words)];
        vec![Table { id: "bending", columns }]
    }
}

fn work(long: Duration, monitor: &dyn Monitor) -> Result<(), Failure> {
    let begun = Instant::now();
    while begun.elapsed() < long {
        checkpoint(monitor)?;
        std::thread::sleep(Duration::from_millis(2));
    }
    Ok(())
}

/// The toy and nothing else.
#[allow(clippy::unwrap_used)]
pub(crate) fn registry() -> Registry {
    use precut_calc::calculator::Registrar;
    Registry::with(Registrar::calculator::<Toy>).unwrap()
}

/// The same for tests that only look.
pub(crate) fn shared() -> &'static Registry {
    static REGISTRY: std::sync::LazyLock<Registry> = std::sync::LazyLock::new(registry);
    &REGISTRY
}
