//! What is measured. A new row is one entry in [`all`].

use precut::render::{self, Wording};
use precut_calc::calculator::{
    Axis, Block, Column, Dialect, Figure, Frame, Item, Message, Panel, Program, Role, Table,
};

use crate::Row;
use crate::deflection;
use crate::diagnosis;
use crate::feed;
use crate::fitting;
use crate::fixture;
use crate::http::{self, Bare, Clock, Exchange};
use crate::library;
use crate::measure::{Measured, Unit, cpu_time};
use crate::milling::{self, Teeth};
use crate::process;
use crate::program;
use crate::ring;
use crate::roundness;

const DEFLECTION: &str = "deflection-compensation";
/// A number of that calculator's jobs which changes the result and not the work.
const DEFLECTION_VARIED: &str = "/cut/feed_mm_per_rev";

/// The table, top to bottom.
#[allow(clippy::too_many_lines)] // a table
pub(crate) fn all() -> Vec<Row> {
    let us = |us: f64| Some(us * 1e-6);
    vec![
        row("compliance profile, 200 stations", Unit::Time, us(5.0), us(1.5), || deflection::compliance(200)),
        row("compliance profile, 10,000 stations", Unit::Time, us(80.0), us(20.0), || deflection::compliance(10_000)),
        row("complete deflection answer (detail: profile), 10,000 stations", Unit::Time, us(1000.0), us(300.0), || {
            deflection::answer(10_000, "profile", "auto")
        }),
        row("the same with path, comparison and advice (detail: full)", Unit::Time, None, None, || {
            deflection::answer(10_000, "full", "auto")
        }),
        row(
            "complete deflection answer (detail: profile), 201 stations, effects as stated",
            Unit::Time,
            us(20.0),
            us(10.0),
            || deflection::answer(201, "profile", "as_stated"),
        ),
        row("the same, effects tried by default, its partly turned section acting", Unit::Time, None, None, || {
            deflection::answer(201, "profile", "auto")
        }),
        row(
            "and with path, comparison, advice and the probability of a good shaft (detail: full)",
            Unit::Time,
            us(10_000.0),
            us(2000.0),
            || deflection::answer(201, "full", "auto"),
        ),
        row("fewest-chord tool path, 10,000 stations", Unit::Time, us(10_000.0), us(3000.0), || {
            deflection::chords(10_000)
        }),
        row("fewest-chord tool path, 200,000 stations", Unit::Time, us(500_000.0), us(200_000.0), || {
            deflection::chords(200_000)
        }),
        row("ring simulation, per angular step", Unit::Time, us(0.15), us(0.07), || ring::step(false)),
        row("ring simulation on rollers, per angular step", Unit::Time, us(1.0), us(0.3), || ring::step(true)),
        row(
            "ring: the source paper's algorithm plainly written, N = 3600, per angular step",
            Unit::Time,
            None,
            None,
            ring::plain_paper,
        ),
        row("ring: complete answer to the paper's run of 256 revolutions", Unit::Time, None, None, ring::answer),
        row("ring: set-up map, 91 x 61 cells, 20 lobes", Unit::Time, None, None, ring::map),
        row(
            "minimum-zone circle with its least-squares start, certified, 3600 points",
            Unit::Time,
            us(300.0),
            us(150.0),
            || roundness::zone(3600),
        ),
        row("all four reference circles, certified, 3600 points", Unit::Time, us(500.0), us(250.0), || {
            roundness::four(3600)
        }),
        row("complete roundness evaluation, 3600 points", Unit::Time, None, None, || roundness::answer(3600)),
        row("three names resolved into a fresh job", Unit::Time, us(50.0), us(15.0), library::resolve),
        row("designation of an insert read", Unit::Time, us(2.0), us(0.5), library::code),
        row("NIST StRD, 54 runs, default setting, no derivatives given", Unit::Time, None, None, fitting::nist_time),
        row("of these not solved to 4 digits", Unit::Count, Some(0.0), Some(0.0), || fitting::nist_missed(4.0)),
        row("of these not solved to 6 digits", Unit::Count, Some(2.0), Some(0.0), || fitting::nist_missed(6.0)),
        row("of these not solved to 8 digits", Unit::Count, Some(9.0), Some(4.0), || fitting::nist_missed(8.0)),
        row("machinability fit, 19 trials, 3 outputs, without resampling", Unit::Time, None, None, || {
            fitting::machinability(0)
        }),
        row("the same with 1000 resamples", Unit::Time, None, None, || fitting::machinability(1000)),
        row(
            "receptance fit, 4000 lines, two modes, with refinement and errors",
            Unit::Time,
            us(20_000.0),
            us(6000.0),
            || fitting::receptance(4000),
        ),
        row("clamping, 12 contacts, 120 loads, no slip and certain slip", Unit::Time, us(20_000.0), us(4000.0), || {
            fixture::clamping(120)
        }),
        row("lobe map 200 x 100 converged, one mode, full slot", Unit::Time, us(400_000.0), us(120_000.0), || {
            fixture::map(1.0)
        }),
        row("the same at 5 % radial immersion", Unit::Time, us(130_000.0), us(70_000.0), || fixture::map(0.05)),
        row(
            "lobe map 200 x 100 converged, two modes",
            Unit::Time,
            us(600_000.0),
            us(300_000.0),
            fixture::map_two_modes,
        ),
        row("textbook semi-discretisation on the first map (a part, scaled)", Unit::Time, None, None, || {
            fixture::textbook(1.0)
        }),
        row("lobe boundary, 400 speeds", Unit::Time, us(200_000.0), us(60_000.0), fixture::boundary),
        row("one converged multiplier with its error", Unit::Time, us(1000.0), us(300.0), || {
            fixture::multiplier(false)
        }),
        row("the same with two modes", Unit::Time, us(1500.0), us(500.0), || fixture::multiplier(true)),
        row("forced motion and least clamp force", Unit::Time, us(1000.0), us(300.0), fixture::forced),
        row("a step of the cut in time, linear force law", Unit::Time, us(0.01), us(0.0067), || fixture::step(0.0)),
        row("a step of the cut in time, power law", Unit::Time, us(0.04), us(0.0167), || fixture::step(0.1)),
        row("complete fixture answer: verdict", Unit::Time, None, None, fixture::answer),
        row("of a fixture answer its probability: stable, closed and held", Unit::Time, us(50_000.0), None, || {
            fixture::probability(&[], "auto")
        }),
        row("the same, the vise itself asked", Unit::Time, None, None, || fixture::probability(&[], "always")),
        row(
            "and depths of a probability over 200 speeds, with a robust one",
            Unit::Time,
            us(500_000.0),
            us(150_000.0),
            || fixture::probability(&["certainty"], "auto"),
        ),
        row("milling, map 200 x 100 converged, 2 x 2 modes", Unit::Time, us(2e6), us(0.8e6), || {
            milling::map(Teeth::Straight)
        }),
        row("the same with helix 30", Unit::Time, us(3e6), us(1.2e6), || milling::map(Teeth::Helical)),
        row("the same with pitch of two values", Unit::Time, us(6e6), us(2.5e6), || milling::map(Teeth::UnevenPitch)),
        row("milling, one multiplier, 2 x 2 modes", Unit::Time, us(2000.0), us(600.0), || {
            milling::multiplier(Teeth::Straight)
        }),
        row("the same with unequal pitch and helix", Unit::Time, us(8000.0), us(3000.0), || {
            milling::multiplier(Teeth::UnevenPitch)
        }),
        row("the same with unequal helix", Unit::Time, us(60_000.0), us(20_000.0), || {
            milling::multiplier(Teeth::UnevenHelix)
        }),
        row(
            "milling, boundary of 400 varying speeds, eight depths each",
            Unit::Time,
            us(5e6),
            us(2e6),
            milling::varying,
        ),
        row("milling, better speeds in full, 200 speeds", Unit::Time, us(1.5e6), us(0.5e6), || {
            milling::answer(&serde_json::json!(["verdict", "speeds"]))
        }),
        row("milling, forced motion and error of the wall", Unit::Time, us(3000.0), us(1000.0), milling::forced),
        row("thirty zones, usage and feed steps: solver alone", Unit::Time, us(300.0), us(80.0), || feed::solver(30)),
        row("a hundred zones, the same", Unit::Time, us(1000.0), us(300.0), || feed::solver(100)),
        row("thirty zones through the general conic solver, 1e-8", Unit::Time, us(5000.0), None, || feed::conic(30)),
        row("a hundred zones, the same", Unit::Time, us(20_000.0), None, || feed::conic(100)),
        row("compliances of thirty zones", Unit::Time, us(100.0), us(20.0), feed::compliances),
        row(
            "conflict of thirty zones: least relaxation and smallest set",
            Unit::Time,
            us(20_000.0),
            us(5000.0),
            feed::conflict,
        ),
        row(
            "continuous schedule on 600 points, cut into up to 24 zones",
            Unit::Time,
            us(15_000.0),
            us(3000.0),
            feed::continuous,
        ),
        row("1000 single zones", Unit::Time, us(10_000.0), us(2000.0), feed::single_zones),
        row("complete feed schedule: six zones with comparison", Unit::Time, None, None, feed::answer),
        row("thirty zones at a risk of each limit, over none", Unit::Ratio, Some(2.0), Some(1.1), || {
            feed::at_risk("each")
        }),
        row("thirty zones at one risk for all limits, over none", Unit::Ratio, Some(5.0), Some(2.5), || {
            feed::at_risk("joint")
        }),
        row("a turning program of 10,000 lines read", Unit::Time, us(5000.0), None, || program::read(10_000, false)),
        row("and turned on its blank, rigid", Unit::Time, us(100_000.0), us(20_000.0), || program::read(10_000, true)),
        row("the source paper's table of 28 rows under both laws, each with two steps", Unit::Time, None, None, || {
            fixture::table()
        }),
        row(
            "diagnosis of deflection, 500 points, all causes and pairs, held out, CPU of all cores",
            Unit::Time,
            us(300_000.0),
            us(100_000.0),
            || diagnosis::deflection(100),
        ),
        row("a part of a watched process, twelve rows, one type", Unit::Time, us(1000.0), us(200.0), || {
            process::part(1, 12)
        }),
        row("a part of a watched process, 200 rows, three types", Unit::Time, us(5000.0), us(1000.0), || {
            process::part(3, 200)
        }),
        row("a thousand parts of a watched process, twelve rows", Unit::Time, us(1e6), us(200_000.0), || {
            process::replay(1, 12, 1000)
        }),
        row("CSV, 10,000 rows of 8 numbers", Unit::Time, None, None, csv),
        row("G-code, 10,000 cuts", Unit::Time, None, None, gcode),
        row("SVG, 3 panels of 201 stations", Unit::Time, None, None, || svg(201)),
        row("SVG, 3 panels of 100,000 stations", Unit::Time, None, None, || svg(100_000)),
        row("cached answer over HTTP against a bare handler", Unit::Ratio, Some(2.5), Some(1.6), cached),
        row(
            "fresh deflection profile over HTTP, the client's wait in turns of 300, against a handler that parses \
             the job and sends as many bytes",
            Unit::Ratio,
            Some(2.0),
            Some(1.3),
            || fresh(Bare::Parses, Clock::Wait),
        ),
        row(
            "the same fresh profile in turns of 1500, while results are kept behind",
            Unit::Ratio,
            Some(2.0),
            Some(1.3),
            || fresh(Bare::Parses, Clock::SustainedWait),
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
            || fresh(Bare::Writes, Clock::Wait),
        ),
        row(
            "the same fresh profile against that handler, CPU time of the server with that of keeping the result",
            Unit::Ratio,
            None,
            None,
            || fresh(Bare::Writes, Clock::ServerCpu),
        ),
        row("health while every core computes: slowest of 100, wall time", Unit::Time, Some(0.05), Some(0.02), health),
        row("small fresh answer while every core computes: slowest of 100, wall time", Unit::Time, None, None, small),
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
    let blocks = std::iter::once(Block::Modes).chain(cuts).chain([Block::End(None)]).collect();
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

fn health() -> Result<Measured, String> {
    let probe = Exchange { path: "/health/live".to_owned(), body: Box::new(|_| Vec::new()) };
    http::latency_under_load(&probe, &load()?)
}

fn small() -> Result<Measured, String> {
    let job = http::example(DEFLECTION)?;
    let body = Box::new(move |count| http::varied(&job, DEFLECTION_VARIED, count));
    http::latency_under_load(&Exchange { path: format!("/v1/{DEFLECTION}"), body }, &load()?)
}

/// Large jobs, each another one.
fn load() -> Result<Exchange, String> {
    /// None of those that are asked for meanwhile.
    const BEYOND: usize = 1_000_000;
    let mut job = http::example(DEFLECTION)?;
    job["stations"] = serde_json::json!({"kind": "per_zone", "count": 50_000});
    let body = Box::new(move |count| http::varied(&job, DEFLECTION_VARIED, BEYOND + count));
    Ok(Exchange { path: format!("/v1/{DEFLECTION}"), body })
}

fn start() -> Result<Measured, String> {
    let body = http::example(DEFLECTION)?.to_string().into_bytes();
    http::start(&format!("/v1/{DEFLECTION}"), &body)
}
