//! What every calculator must keep, walked over all that are registered.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use precut_calc::calculator::{
    Along, Calculator, Cells, Check, Failure, Figure, ForwardModel, Frame, Handle, Item, Message, Monitor, Move,
    ProgramOrigin, Registrar, Unwatched, Violations,
};
use serde_json::Value;

/// Runs every rule on every calculator.
struct Conformance {
    ids: Vec<&'static str>,
}

impl Registrar for Conformance {
    fn calculator<C: Calculator>(&mut self) {
        self.ids.push(C::META.id);
        assert!(!C::META.examples.is_empty(), "{}: no example", C::META.id);
        let mut shown = BTreeSet::new();
        for example in C::META.examples {
            let job = prepared::<C>(example.job);
            shown.extend(example_runs_and_repeats::<C>(&job, example.id));
            cost_is_sane::<C>(&job);
        }
        for declared in [C::META.figures, C::META.tables, C::META.study_outputs].into_iter().flatten() {
            assert!(shown.contains(declared), "{} declares {declared}, which no example has", C::META.id);
        }
    }

    fn with_forward_model<C: Calculator + ForwardModel<Job = C::Input>>(&mut self) {
        self.calculator::<C>();
        for cause in C::CAUSES {
            for parameter in cause.parameters {
                assert!(parameter.lower <= parameter.upper, "{}: {}", cause.kind, parameter.name);
                assert!(!parameter.unit.is_empty(), "{}: {}", cause.kind, parameter.name);
            }
        }
    }
}

fn prepared<C: Calculator>(text: &str) -> C::Input {
    let mut job: C::Input = serde_json::from_str(text).unwrap_or_else(|e| panic!("{}: {e}", C::META.id));
    let mut violations = Violations::default();
    job.check(&mut violations);
    let faults = violations.into_vec();
    assert!(faults.is_empty(), "{faults:?}");
    C::fill(&mut job);
    job
}

/// Which of the declared figures, tables and numbers this example has.
fn example_runs_and_repeats<C: Calculator>(job: &C::Input, example: &str) -> Vec<&'static str> {
    let at = format!("{}/{example}", C::META.id);
    let filled = serde_json::to_value(job).unwrap();
    let mut again: C::Input = serde_json::from_value(filled.clone()).unwrap();
    let mut violations = Violations::default();
    again.check(&mut violations);
    assert!(violations.is_empty(), "{at}: the echoed job is refused");
    C::fill(&mut again);
    assert_eq!(serde_json::to_value(&again).unwrap(), filled, "{at}: filling twice changes the job");

    let watch = Watch::default();
    let first = C::run(job, &watch).unwrap_or_else(|e| panic!("{at}: {e}"));
    let count = CancelAt { looks: AtomicUsize::new(0), at: usize::MAX };
    let second = C::run(&again, &count).unwrap();
    cancellation_is_honoured::<C>(job, count.looks.into_inner());
    let output = serde_json::to_value(&first.output).unwrap();
    let bits = |value: &Value| serde_json::to_string(value).unwrap();
    assert_eq!(bits(&output), bits(&serde_json::to_value(&second.output).unwrap()), "{at}: not deterministic");
    let back: C::Output = serde_json::from_value(output.clone()).unwrap_or_else(|e| panic!("{at}: {e}"));
    assert_eq!(bits(&serde_json::to_value(&back).unwrap()), bits(&output), "{at}: does not round-trip");
    let mut has = Vec::new();
    for &pointer in C::META.study_outputs {
        // What an answer does not have it may leave out.
        let Some(value) = output.pointer(pointer) else { continue };
        assert!(value.is_number() || value.is_null(), "{at}: no number at {pointer}");
        has.extend(value.is_number().then_some(pointer));
    }

    let declared =
        |lists: &[&[&'static str]]| -> BTreeSet<&'static str> { lists.iter().copied().flatten().copied().collect() };
    let codes = C::META.codes;
    for warning in &first.warnings {
        assert!(declared(codes.warnings).contains(warning.code), "{at}: undeclared warning {}", warning.code);
        assert!(
            warning.value.is_none_or(f64::is_finite) && warning.limit.is_none_or(f64::is_finite),
            "{at}: {warning:?}"
        );
    }
    for said in &first.explanation {
        assert!(declared(codes.explanations).contains(said.code), "{at}: undeclared explanation {}", said.code);
    }
    for stage in watch.stages.into_inner().unwrap() {
        assert!(declared(codes.stages).contains(stage), "{at}: undeclared stage {stage}");
    }
    assert!(!first.explanation.is_empty() && !first.basis.is_empty(), "{at}: says nothing, or not by what");

    let figures = C::figures(job, &first.output);
    has.extend(in_declared_order(figures.iter().map(|figure| figure.id), C::META.figures, &at));
    let tables = C::tables(job, &first.output);
    let mut numbers = BTreeSet::new();
    // What a job brings along is drawn as it is written: from the zero of its program, too.
    for zero in [0.0, filled["program_zero_z_mm"].as_f64().unwrap_or(0.0)] {
        note_numbers(&output, zero, &mut numbers);
        note_numbers(&filled, zero, &mut numbers);
    }
    for column in tables.iter().flat_map(|table| &table.columns) {
        if let Cells::Numbers(cells) = &column.cells {
            numbers.extend(cells.iter().flatten().map(|&number| digits(number)));
        }
    }
    for figure in &figures {
        figure_is_sound(figure, &declared(codes.labels), &at);
        figure_stands_where_its_numbers_do(figure, &numbers, &at);
        for item in figure.panels.iter().flat_map(|panel| &panel.items) {
            if let Item::Handle(handle) = item {
                handle_moves_the_job::<C>(handle, &filled, &at);
            }
        }
    }
    has.extend(in_declared_order(tables.iter().map(|table| table.id), C::META.tables, &at));
    for table in &tables {
        let lengths: BTreeSet<usize> = table
            .columns
            .iter()
            .map(|column| match &column.cells {
                Cells::Numbers(cells) => cells.len(),
                Cells::Words(cells) => cells.len(),
            })
            .collect();
        assert!(lengths.len() <= 1, "{at}: table {} is ragged", table.id);
    }
    assert_eq!(C::program(job, &first.output).is_some(), C::META.program == Some(ProgramOrigin::Made), "{at}");
    assert_eq!(C::returned(job, &first.output, "").is_some(), C::META.program == Some(ProgramOrigin::Brought), "{at}");
    has
}

/// The names an answer shows: all declared, in the declared order.
fn in_declared_order(
    shown: impl Iterator<Item = &'static str>,
    declared: &[&'static str],
    at: &str,
) -> Vec<&'static str> {
    let shown: Vec<_> = shown.collect();
    let in_order: Vec<_> = declared.iter().copied().filter(|id| shown.contains(id)).collect();
    assert_eq!(shown, in_order, "{at}");
    shown
}

/// Nine digits of a number.
fn digits(number: f64) -> String {
    format!("{:.8e}", if number == 0.0 { 0.0 } else { number })
}

fn note_numbers(value: &Value, zero: f64, numbers: &mut BTreeSet<String>) {
    match value {
        Value::Number(number) => drop(numbers.insert(digits(number.as_f64().unwrap() - zero))),
        Value::Array(items) => items.iter().for_each(|item| note_numbers(item, zero, numbers)),
        Value::Object(fields) => fields.values().for_each(|field| note_numbers(field, zero, numbers)),
        _ => {}
    }
}

/// Curves of a formula, drawn at places of their own: circles about a profile, a fit against what was measured, which is
/// told by its logarithm; arcs of a program.
const DRAWN_ANYWHERE: [&str; 11] = [
    "least_squares_circle",
    "minimum_zone_circles",
    "minimum_zone_inner",
    "inscribed_circle",
    "circumscribed_circle",
    "fit_perfect",
    "fit_of_all",
    "fit_held_out",
    "fit_outlier_limit",
    "moves_arc",
    "surface_of_program",
];

/// No axis without its true scale: what is drawn stands at a number of the tables, the answer or the job. A profile closes
/// where it began.
fn figure_stands_where_its_numbers_do(figure: &Figure, numbers: &BTreeSet<String>, at: &str) {
    for item in figure.panels.iter().flat_map(|panel| &panel.items) {
        let (Item::Line { name, x, .. }
        | Item::Band { name, x, .. }
        | Item::Points { name, x, .. }
        | Item::Bars { name, x, .. }) = item
        else {
            continue;
        };
        let closes = |x: f64| figure.x.unit == "deg" && (x - 360.0).abs() < 1e-9;
        let invented = x.iter().find(|&&x| !closes(x) && !numbers.contains(&digits(x)));
        assert!(
            invented.is_none() || DRAWN_ANYWHERE.contains(name),
            "{at}: {} has {name} at {}, which is no number of the answer",
            figure.id,
            invented.unwrap()
        );
    }
}

/// Wherever a handle goes within its reach, the job that follows it is one that may be asked, and the handle is then there.
fn handle_moves_the_job<C: Calculator>(handle: &Handle, filled: &Value, at: &str) {
    let place = |handle: &Handle| if handle.along == Along::X { handle.x } else { handle.y };
    let (from, [least, most]) = (place(handle), handle.reach);
    assert!(least <= from && from <= most && !handle.moves.is_empty(), "{at}: {} stands beside its reach", handle.name);
    for to in [least, 0.5 * (least + from), 0.5 * (from + most), most] {
        let mut job = filled.clone();
        for Move { pointer, per_unit } in &handle.moves {
            let number = job.pointer_mut(pointer).unwrap_or_else(|| panic!("{at}: {pointer} is not in the job"));
            *number = (number.as_f64().unwrap() + per_unit * (to - from)).into();
        }
        let mut job: C::Input = serde_json::from_value(job).unwrap();
        let mut violations = Violations::default();
        job.check(&mut violations);
        let faults = violations.into_vec();
        // Two supports at one place are told apart by nobody.
        let others: Vec<_> = faults.iter().filter(|fault| fault.code != "duplicate_support").collect();
        assert!(others.is_empty(), "{at}: {} at {to}: {others:?}", handle.name);
        if !faults.is_empty() {
            continue;
        }
        C::fill(&mut job);
        let Ok(answer) = C::run(&job, &Unwatched) else { continue };
        let is_it = |other: &&Handle| other.name == handle.name && other.moves == handle.moves;
        let figures = C::figures(&job, &answer.output);
        let moved = figures
            .iter()
            .flat_map(|figure| &figure.panels)
            .flat_map(|panel| &panel.items)
            .find_map(|item| if let Item::Handle(other) = item { Some(other).filter(is_it) } else { None });
        let there = moved.map_or(f64::NAN, place);
        assert!((there - to).abs() <= 1e-6 * most.abs(), "{at}: {} went to {to} and is at {there}", handle.name);
    }
}

fn figure_is_sound(figure: &Figure, labels: &BTreeSet<&'static str>, at: &str) {
    let known = |code: &str| assert!(labels.contains(code), "{at}: undeclared label {code}");
    known(figure.title.code);
    known(figure.x.label);
    if figure.frame == Frame::Polar {
        assert_eq!((figure.panels.len(), figure.x.unit), (1, "deg"), "{at}: {}", figure.id);
    }
    for panel in &figure.panels {
        known(panel.y.label);
        let maps = panel.items.iter().filter(|item| matches!(item, Item::HeatMap { .. })).count();
        assert!(maps <= 1, "{at}: {} has a panel of {maps} maps", figure.id);
        for item in &panel.items {
            match item {
                Item::Line { name, x, y, .. } | Item::Bars { name, x, y, .. } => {
                    known(name);
                    assert_eq!(x.len(), y.len(), "{at}: {name}");
                    assert!(y.iter().flatten().chain(x).all(|v| v.is_finite()), "{at}: {name}");
                }
                Item::Band { name, x, lower, upper, .. } => {
                    known(name);
                    assert_eq!((x.len(), x.len()), (lower.len(), upper.len()), "{at}: {name}");
                    assert!(lower.iter().zip(upper).all(|(l, u)| l <= u), "{at}: {name} is inside out");
                }
                Item::Points { name, x, y, .. } | Item::Outline { name, x, y, .. } => {
                    known(name);
                    assert_eq!(x.len(), y.len(), "{at}: {name}");
                }
                Item::HeatMap { value, x, y, values, .. } => {
                    known(value.label);
                    assert_eq!(values.len(), x.len() * y.len(), "{at}: {}", value.label);
                    assert!([x, y].iter().all(|m| m.is_sorted_by(|a, b| a < b)), "{at}: {}", value.label);
                    assert!(values.iter().flatten().chain(x).chain(y).all(|v| v.is_finite()), "{at}: {}", value.label);
                }
                Item::Ribbon { name, x, x_end, weight, places, .. } => {
                    known(name);
                    assert_eq!([x.len(); 3], [x_end.len(), weight.len(), places.len()], "{at}: {name}");
                    assert!(x.iter().zip(x_end).all(|(from, to)| from < to), "{at}: {name} is inside out");
                    assert!(weight.iter().all(|weight| weight.is_finite() && *weight > 0.0), "{at}: {name}");
                    let ribbons = panel.items.iter().all(|item| matches!(item, Item::Ribbon { .. }));
                    assert!(ribbons, "{at}: ribbons stand in a panel of their own");
                }
                Item::Glyph { x, y, .. } => assert!(x.is_finite() && y.is_finite(), "{at}"),
                Item::Handle(handle) => known(handle.name),
                Item::Setting(setting) => known(setting.name),
            }
        }
    }
}

/// Hears stages, and that progress never falls.
#[derive(Default)]
struct Watch {
    progress: AtomicU64,
    stages: std::sync::Mutex<Vec<&'static str>>,
}

impl Monitor for Watch {
    fn cancelled(&self) -> bool {
        false
    }
    fn progress(&self, fraction: f64, stage: Message) {
        assert!((0.0..=1.0).contains(&fraction));
        // Bits of non-negative floats order as the floats do.
        assert!(self.progress.swap(fraction.to_bits(), Ordering::Relaxed) <= fraction.to_bits(), "progress falls");
        self.stages.lock().unwrap().push(stage.code);
    }
}

/// Cancels at the n-th look.
struct CancelAt {
    looks: AtomicUsize,
    at: usize,
}

impl Monitor for CancelAt {
    fn cancelled(&self) -> bool {
        self.looks.fetch_add(1, Ordering::Relaxed) >= self.at
    }
    fn progress(&self, _fraction: f64, _stage: Message) {}
}

/// `looks` is how often it looks when it is not cancelled.
fn cancellation_is_honoured<C: Calculator>(job: &C::Input, looks: usize) {
    assert!(looks > 0, "{}: never looks whether it is cancelled", C::META.id);
    for at in [0, looks / 2, looks - 1] {
        let cancel = CancelAt { looks: AtomicUsize::new(0), at };
        assert_eq!(C::run(job, &cancel).err(), Some(Failure::Cancelled), "{}: look {at} of {looks}", C::META.id);
        // Threads that were at work may each look once more.
        let looked = cancel.looks.into_inner() - at - 1;
        assert!(looked <= rayon::current_num_threads(), "{}: goes on after the cancel", C::META.id);
    }
}

fn cost_is_sane<C: Calculator>(job: &C::Input) {
    let cost = C::cost(job);
    assert!(cost.ms.is_finite() && cost.ms >= 0.0 && cost.driver.starts_with('/'), "{}: {cost:?}", C::META.id);
}

#[test]
fn every_calculator_keeps_the_contract() {
    let mut conformance = Conformance { ids: Vec::new() };
    precut_calc::register(&mut conformance);
    assert!(!conformance.ids.is_empty());
    let distinct: BTreeSet<_> = conformance.ids.iter().collect();
    assert_eq!(distinct.len(), conformance.ids.len());
}
