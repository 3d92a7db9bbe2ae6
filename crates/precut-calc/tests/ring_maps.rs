//! The map of set-ups cut in every cell: what a cell says is what its job gives, and the picture grows on the way.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::print_stdout,
    missing_docs
)]

use std::f64::consts::TAU;
use std::sync::Mutex;

use crate::draw::Draw;
use crate::ring_support::{ends_of_the_feed, run, trials};
use precut_calc::calculator::{Calculator, Figure, Item, Message, Monitor};
use precut_calc::ring_roundness::{Job, MapOutcome, RingRoundness};
use serde_json::{Value, json};

const RADIUS_MM: f64 = 45.0;
/// Order, amplitude (mm) and angle of the maximum (rad).
type Waves = [(u32, f64, f64)];
const WAVES: [(u32, f64, f64); 2] = [(2, 0.012, 0.0), (3, 0.004, 0.5)];

fn harmonics(waves: &Waves) -> Vec<Value> {
    let wave = |(k, mm, at): &(u32, f64, f64)| json!({ "order": k, "amplitude_um": 1e3 * mm, "angle_of_max_deg": at.to_degrees() });
    waves.iter().map(wave).collect()
}

fn job() -> Value {
    json!({
        "ring": { "radius_mm": RADIUS_MM, "harmonics": harmonics(&WAVES) },
        "supports": { "distance_mm": 60, "depth_mm": 32 },
        "tool": { "x_mm": 30, "y_mm": 34, "feed_mm_per_rev": 0.006, "revolutions": 14, "spark_out_revolutions": 2 },
        "compliance_ratio": 0.3, "analyses": ["setup_map"],
        "setup_map": {
            "tool_angle_from_deg": 40, "tool_angle_to_deg": 130, "tool_angles": 6, "support_angle_from_deg": 20,
            "support_angle_to_deg": 50, "support_angles": 4, "simulated_cells": 0, "cut_everywhere": true
        }
    })
}

/// Largest radius of a round ring at which the tip of a cell touches the blank.
fn touched_mm(waves: &Waves, tool: f64, beta: f64) -> f64 {
    let radius =
        |t: f64| RADIUS_MM + waves.iter().map(|(k, mm, at)| mm * (f64::from(*k) * (t - at)).cos()).sum::<f64>();
    let (a, b) = (-(tool - beta).cos() / (2.0 * beta).sin(), (tool + beta).cos() / (2.0 * beta).sin());
    let (to_a, to_b) = (1.5 * TAU / 2.0 - beta - tool, 1.5 * TAU / 2.0 + beta - tool);
    let size = |i: u32| {
        let t = TAU * f64::from(i) / 7200.0;
        (radius(t) - a * radius(t + to_a) - b * radius(t + to_b)) / (1.0 - a - b)
    };
    (0..7200).map(size).fold(0.0, f64::max)
}

#[test]
fn a_cell_comes_out_as_round_as_its_job() {
    let answer = run(&job());
    let map = answer.output.setup_map.unwrap();
    assert!(answer.explanation.iter().any(|message| message.code == "map_roundest"));
    let columns = map.tool_angle_deg.len();
    let mut cut = 0;
    for (i, found_um) in map.cut_roundness_um.iter().enumerate() {
        let Some(found_um) = *found_um else { continue };
        cut += 1;
        let (tool, beta) =
            (map.tool_angle_deg[i % columns].to_radians(), map.support_half_angle_deg[i / columns].to_radians());
        let depth = 32.0;
        let (start, end, half) =
            ends_of_the_feed(touched_mm(&WAVES, tool, beta) + 0.01, 0.006 * 14.0, beta, tool, depth);
        let mut cell = job();
        cell["analyses"] = json!(["simulation"]);
        cell["samples"] = json!(1440);
        cell["supports"] = json!({ "distance_mm": 2.0 * half, "depth_mm": depth });
        cell["tool"]["x_mm"] = json!(start[0]);
        cell["tool"]["y_mm"] = json!(start[1]);
        cell["tool"]["feed_direction_deg"] = json!((end[1] - start[1]).atan2(end[0] - start[0]).to_degrees());
        let outcome = run(&cell).output;
        let (um, error_um) = (outcome.roundness_um.unwrap(), outcome.roundness_error_um.unwrap());
        // The map's nodes are half of these.
        assert!((um - found_um).abs() < 0.05 + 0.03 * um + error_um, "cell {i}: {found_um} on the map, {um} cut");
    }
    assert!(cut >= 20, "{cut}");
    let roundest = map.roundest.unwrap();
    let least = map.cut_roundness_um.iter().flatten().copied().fold(f64::INFINITY, f64::min);
    assert!((roundest.roundness_um - least).abs() < 1e-12);
}

#[derive(Default)]
struct Watch {
    filled: Mutex<Vec<usize>>,
}

impl Monitor for Watch {
    fn cancelled(&self) -> bool {
        false
    }
    fn progress(&self, _fraction: f64, _stage: Message) {}
    fn interim(&self, figure: Figure) {
        assert_eq!(figure.id, "cut_map");
        let Item::HeatMap { values, .. } = &figure.panels[0].items[0] else { panic!("{figure:?}") };
        self.filled.lock().unwrap().push(values.iter().flatten().count());
    }
}

#[test]
fn the_picture_of_the_cut_grows_while_it_is_computed() {
    let mut job = job();
    job["setup_map"]["tool_angles"] = json!(13);
    job["setup_map"]["support_angles"] = json!(10);
    job["tool"]["revolutions"] = json!(6);
    let mut job: Job = serde_json::from_value(job).unwrap();
    RingRoundness::fill(&mut job);
    let watch = Watch::default();
    let outcome = RingRoundness::run(&job, &watch).unwrap().output;
    let filled = watch.filled.into_inner().unwrap();
    let map: &MapOutcome = outcome.setup_map.as_ref().unwrap();
    assert!(filled.len() >= 4 && filled.is_sorted(), "{filled:?}");
    assert!(filled[0] < map.cut_roundness_um.iter().flatten().count());
    let figures = RingRoundness::figures(&job, &outcome);
    let figure = figures.iter().find(|figure| figure.id == "cut_map").unwrap();
    let Item::HeatMap { values, .. } = &figure.panels[0].items[0] else { panic!("{figure:?}") };
    assert_eq!(values, &map.cut_roundness_um);
}

/// A number of revolutions in a cell is given only where a simulation reaches the target; driven, it does.
#[test]
fn a_number_of_revolutions_is_one_that_reaches_the_target() {
    let mut driven = 0;
    for seed in 0..trials(3) {
        let mut draw = Draw::new(4000 + seed);
        let mut job = job();
        let waves = [(2 + (draw.share() * 4.0) as u32, draw.between(0.004, 0.025), draw.between(0.0, TAU))];
        job["ring"] = json!({ "radius_mm": RADIUS_MM, "harmonics": harmonics(&waves) });
        job["compliance_ratio"] = json!(draw.between(0.0, 1.0));
        let target_um = draw.between(1.0, 4.0);
        job["setup_map"] = json!({
            "tool_angle_from_deg": 40, "tool_angle_to_deg": 130, "tool_angles": 12, "support_angle_from_deg": 18,
            "support_angle_to_deg": 50, "support_angles": 9, "simulated_cells": 12, "target_um": target_um
        });
        let map = run(&job).output.setup_map.unwrap();
        let columns = map.tool_angle_deg.len();
        let numbered = map.revolutions_to_target.iter().enumerate().filter_map(|(i, n)| Some((i, (*n)?)));
        for (i, revolutions) in numbered.step_by(4) {
            let (tool, beta) =
                (map.tool_angle_deg[i % columns].to_radians(), map.support_half_angle_deg[i / columns].to_radians());
            // From just clear of the blank, the job's feed for so many revolutions.
            let first_mm = touched_mm(&waves, tool, beta) + 0.01;
            let (start, end, half) = ends_of_the_feed(first_mm, 0.006 * revolutions, beta, tool, 32.0);
            let mut cell = job.clone();
            cell["analyses"] = json!(["simulation"]);
            cell["samples"] = json!(1440);
            cell["supports"] = json!({ "distance_mm": 2.0 * half, "depth_mm": 32.0 });
            cell["tool"] = json!({
                "x_mm": start[0], "y_mm": start[1], "feed_mm_per_rev": 0.006, "revolutions": revolutions,
                "feed_direction_deg": (end[1] - start[1]).atan2(end[0] - start[0]).to_degrees(), "spark_out_revolutions": 2
            });
            let found = run(&cell).output.roundness_um.unwrap();
            driven += 1;
            // The map keeps 5 % of the target for what the number of nodes does.
            assert!(found <= target_um, "{seed}, cell {i}: {found} um, {target_um} asked");
        }
    }
    assert!(driven > 0);
    println!("{driven} cells driven");
}
