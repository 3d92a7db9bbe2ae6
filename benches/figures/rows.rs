//! What is measured. A new row is one entry in [`all`].

use precut::render::{self, Wording};
use precut_calc::calculator::{
    Axis, Block, Column, Dialect, Figure, Frame, Item, Message, Panel, Program, Role, Table,
};

use crate::Row;
use crate::deflection;
use crate::http::{self, Bare, Clock, Exchange};
use crate::measure::{Measured, Unit, cpu_time};

const DEFLECTION: &str = "deflection-compensation";
/// A number of that calculator's jobs which changes the result and not the work.
const DEFLECTION_VARIED: &str = "/cut/feed_mm_per_rev";

/// The table, top to bottom.
pub(crate) fn all() -> Vec<Row> {
    let us = |us: f64| Some(us * 1e-6);
    vec![
        row("compliance profile, 200 stations", Unit::Time, us(5.0), us(1.5), || deflection::compliance(200)),
        row("compliance profile, 10,000 stations", Unit::Time, us(80.0), us(20.0), || deflection::compliance(10_000)),
        row("complete deflection answer (detail: profile), 10,000 stations", Unit::Time, us(1000.0), us(300.0), || {
            deflection::answer(10_000, "profile")
        }),
        row("the same with path, comparison and advice (detail: full)", Unit::Time, None, None, || {
            deflection::answer(10_000, "full")
        }),
        row("complete deflection answer (detail: profile), 201 stations", Unit::Time, None, None, || {
            deflection::answer(201, "profile")
        }),
        row("the same with path, comparison and advice (detail: full), 201 stations", Unit::Time, None, None, || {
            deflection::answer(201, "full")
        }),
        row("fewest-chord tool path, 10,000 stations", Unit::Time, us(10_000.0), us(3000.0), || {
            deflection::chords(10_000)
        }),
        row("fewest-chord tool path, 200,000 stations", Unit::Time, us(500_000.0), us(200_000.0), || {
            deflection::chords(200_000)
        }),
        row("CSV, 10,000 rows of 8 numbers", Unit::Time, None, None, csv),
        row("G-code, 10,000 cuts", Unit::Time, None, None, gcode),
        row("SVG, 3 panels of 201 stations", Unit::Time, None, None, || svg(201)),
        row("SVG, 3 panels of 100,000 stations", Unit::Time, None, None, || svg(100_000)),
        row("cached answer over HTTP against a bare handler", Unit::Ratio, Some(2.5), Some(1.6), cached),
        row(
            "fresh deflection profile over HTTP, the client's wait, against a handler that parses the job and sends as \
             many bytes",
            Unit::Ratio,
            Some(2.0),
            Some(1.3),
            || fresh(Bare::Parses, Clock::Wall),
        ),
        row(
            "the same fresh profile, CPU time of the server with that of keeping the result",
            Unit::Ratio,
            Some(2.0),
            Some(1.3),
            || fresh(Bare::Parses, Clock::ServerCpu),
        ),
        row(
            "fresh deflection profile, the client's wait, against a handler that parses the job and writes as many \
             numbers as JSON",
            Unit::Ratio,
            None,
            None,
            || fresh(Bare::Writes, Clock::Wall),
        ),
        row(
            "the same fresh profile against that handler, CPU time of the server with that of keeping the result",
            Unit::Ratio,
            None,
            None,
            || fresh(Bare::Writes, Clock::ServerCpu),
        ),
        row("start to first answer, wall time", Unit::Time, Some(0.3), Some(0.1), start),
        row("idle memory", Unit::Size, Some(60e6), Some(25e6), http::idle_memory),
        row("binary", Unit::Size, Some(40e6), Some(20e6), http::binary_size),
    ]
}

fn row(
    work: &'static str,
    unit: Unit,
    at_least: Option<f64>,
    aim: Option<f64>,
    measure: fn() -> Result<Measured, String>,
) -> Row {
    Row { work, unit, at_least, aim, measure }
}

/// 0, 1, ... and a bow over them.
fn profile(count: u32) -> (Vec<f64>, Vec<f64>) {
    let x: Vec<f64> = (0..count).map(f64::from).collect();
    let y = x.iter().map(|x| 0.05 * (x * 3.1 / f64::from(count)).sin()).collect();
    (x, y)
}

fn csv() -> Result<Measured, String> {
    let (x, y) = profile(10_000);
    let columns = (0..4).flat_map(|_| [Column::numbers("z", "mm", &x), Column::numbers("error", "um", &y)]).collect();
    let table = Table { id: "stations", columns };
    cpu_time(|| render::csv(&table))
}

fn gcode() -> Result<Measured, String> {
    let (x, y) = profile(10_000);
    let cuts =
        x.iter().zip(&y).map(|(x, y)| Block::Cut { x_diameter_mm: 90.0 - y, z_mm: -x, feed_mm_per_rev: Some(0.5) });
    let blocks = std::iter::once(Block::Modes).chain(cuts).chain([Block::End]).collect();
    let program = Program { dialect: Dialect::Fanuc, increment_mm: 0.001, blocks };
    cpu_time(|| render::gcode(&program, &[]))
}

fn svg(stations: u32) -> Result<Measured, String> {
    let (x, y) = profile(stations);
    let line = |role| Item::Line { name: "curve", x: x.clone(), y: y.iter().copied().map(Some).collect(), role };
    let axis = Axis::linear("axis", "um");
    let panel = || Panel { y: axis, height: 1.0, items: vec![line(Role::Before), line(Role::After)] };
    let figure = Figure {
        id: "f",
        title: Message::new("title"),
        frame: Frame::Stacked,
        x: axis,
        panels: vec![panel(), panel(), panel()],
    };
    let words = Wording {
        message: &|message| message.code.to_owned(),
        label: &str::to_owned,
        unit: &render::unit_symbol,
        decimal: '.',
    };
    cpu_time(|| render::svg(&figure, &words))
}

fn cached() -> Result<Measured, String> {
    let body = http::example(DEFLECTION)?.to_string().into_bytes();
    let exchange = Exchange { path: format!("/v1/{DEFLECTION}"), body: Box::new(move |_| body.clone()) };
    http::ratio(&exchange, Bare::Sends, Clock::ServerCpu)
}

fn fresh(bare: Bare, clock: Clock) -> Result<Measured, String> {
    let mut job = http::example(DEFLECTION)?;
    job["detail"] = "profile".into();
    if job.pointer(DEFLECTION_VARIED).is_none() {
        return Err(format!("the example has no {DEFLECTION_VARIED}"));
    }
    let body = Box::new(move |count| http::varied(&job, DEFLECTION_VARIED, count));
    http::ratio(&Exchange { path: format!("/v1/{DEFLECTION}"), body }, bare, clock)
}

fn start() -> Result<Measured, String> {
    let body = http::example(DEFLECTION)?.to_string().into_bytes();
    http::start(&format!("/v1/{DEFLECTION}"), &body)
}
