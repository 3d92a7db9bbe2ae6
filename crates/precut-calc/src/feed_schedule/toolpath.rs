//! The program of a schedule: one or more cuts per zone, feed and speed in the control's steps (`feed/9.2`).

use crate::calculator::{Block, Failure, Program};
use crate::deflection_compensation::ProgramZero;
use crate::path::round_to_increment;
use crate::shaft::FeedDirection;

use super::case::Case;
use super::compliance::Held;
use super::input::{Job, SpeedMode, Variables};
use super::output::{Outcome, ZoneOutcome};
use super::program::{Built, Place, Variation, build};

/// Steps of the control, mm.
const INCREMENT_MM: f64 = 0.001;
/// Step of the feed, mm/rev.
const FEED_STEP: f64 = 0.001;
/// A limit may be passed by this much in logarithms: the rounding of the schedule itself.
const KEPT: f64 = 1e-9;

/// Feed and speed as programmed.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Words {
    feed_mm_per_rev: f64,
    /// rev/min, or m/min with constant surface speed.
    speed: f64,
    /// No neighbouring pair of steps keeps all limits of the zone.
    kept: bool,
}

/// The program of an answer.
pub(super) fn program(job: &Job, outcome: &Outcome) -> Result<Program, Failure> {
    let surface = job.variables.speed == SpeedMode::ConstantSpeed;
    let held = Held::of(job)?;
    let rows = limits_of_zones(job, outcome, held.as_ref())?;
    let length = job.shaft.as_ref().map_or_else(
        || outcome.zones.iter().map(|zone| zone.z_end_mm).fold(0.0, f64::max),
        crate::shaft::Shaft::length_mm,
    );
    let zero = match job.program.zero {
        ProgramZero::RightFace => length,
        ProgramZero::LeftFace => 0.0,
    };
    let to_headstock = job.feed_direction == FeedDirection::ToHeadstock;
    let widest = outcome.zones.iter().map(|zone| zone.diameter_mm + 2.0 * zone.depth_mm * f64::from(zone.passes));
    let retract = round_to_increment(widest.fold(0.0, f64::max) + job.program.clearance_x_mm, INCREMENT_MM);
    let mut blocks = vec![Block::Modes];
    let order: Vec<usize> =
        if to_headstock { (0..outcome.zones.len()).rev().collect() } else { (0..outcome.zones.len()).collect() };
    // Roughing of a zone stands before its finish and is cut first, whichever way the tool travels.
    let rough = order.iter().copied().filter(|&i| outcome.zones[i].id.ends_with(":rough"));
    let finish = order.iter().copied().filter(|&i| !outcome.zones[i].id.ends_with(":rough"));
    let mut spoken: Option<f64> = None;
    for i in rough.chain(finish) {
        let zone = &outcome.zones[i];
        let words = words(&rows, i, zone, surface);
        blocks.push(Block::Note(note(zone, &words)));
        if spoken.is_none_or(|last| (last - words.speed).abs() > 1e-9) {
            blocks.push(if surface {
                Block::SurfaceSpeed { speed_m_per_min: words.speed, limit_rpm: job.program.spindle_limit_rpm }
            } else {
                Block::SpindleSpeed { rpm: words.speed }
            });
            spoken = Some(words.speed);
        }
        for x_mm in diameters(outcome, zone) {
            cut(&mut blocks, job, outcome, zone, i, x_mm, &words, retract, zero);
        }
    }
    blocks.push(Block::End);
    Ok(Program { dialect: job.program.dialect, increment_mm: INCREMENT_MM, blocks })
}

/// Diameters that the passes of a zone turn down to. Repeats of a finish are spark-out passes at its diameter.
fn diameters(outcome: &Outcome, zone: &ZoneOutcome) -> Vec<f64> {
    let Some(bare) = zone.id.strip_suffix(":rough") else {
        return vec![zone.diameter_mm; zone.passes as usize];
    };
    let finish = outcome.zones.iter().find(|other| other.id.strip_suffix(":finish") == Some(bare));
    let rest = finish.map_or(0.0, |finish| finish.depth_mm);
    (0..zone.passes).rev().map(|k| zone.diameter_mm + 2.0 * (rest + f64::from(k) * zone.depth_mm)).collect()
}

fn note(zone: &ZoneOutcome, words: &Words) -> String {
    use std::fmt::Write as _;
    let mut text = format!("zone {}", zone.id);
    // Writing to a string does not fail.
    if let Some(deflection) = zone.deflection_um {
        let _ = write!(text, " deflection {deflection:.1} um");
    }
    if let Some(roughness) = zone.roughness_um {
        let _ = write!(text, " Ra {roughness:.2} um");
    }
    if let Some(usage) = zone.tool_usage {
        let _ = write!(text, " edge {:.1} percent", 100.0 * usage);
    }
    if !words.kept {
        text.push_str(" rounding breaks a limit");
    }
    text
}

#[allow(clippy::too_many_arguments)]
fn cut(
    blocks: &mut Vec<Block>,
    job: &Job,
    outcome: &Outcome,
    zone: &ZoneOutcome,
    index: usize,
    x_mm: f64,
    words: &Words,
    retract: f64,
    zero: f64,
) {
    let to_headstock = job.feed_direction == FeedDirection::ToHeadstock;
    let path = outcome.compensated_path.as_ref().and_then(|path| path.zones.get(index));
    let mut corners: Vec<(f64, f64)> = match path {
        Some(path) => path.z_mm.iter().copied().zip(path.commanded_diameter_mm.iter().copied()).collect(),
        None => vec![(zone.z_start_mm, x_mm), (zone.z_end_mm, x_mm)],
    };
    if to_headstock {
        corners.reverse();
    }
    let place = |z: f64| round_to_increment(z - zero, INCREMENT_MM);
    let (first_z, first_x) = corners[0];
    let sign = if to_headstock { 1.0 } else { -1.0 };
    let approach = first_z + sign * job.program.clearance_z_mm;
    // Beside a thicker neighbour the tool goes down at the shoulder itself.
    let blocked = outcome.zones.iter().any(|other| {
        let (low, high) = (approach.min(first_z), approach.max(first_z));
        other.z_end_mm > low + 1e-6 && other.z_start_mm < high - 1e-6 && other.diameter_mm >= first_x - 1e-9
    });
    let start = if blocked { first_z } else { approach };
    blocks.push(Block::Rapid { x_diameter_mm: Some(retract), z_mm: Some(place(start)) });
    let x = round_to_increment(first_x, INCREMENT_MM);
    if !blocked {
        blocks.push(Block::Rapid { x_diameter_mm: Some(x), z_mm: None });
    }
    let mut feed = Some(words.feed_mm_per_rev);
    for (z, x) in corners {
        blocks.push(Block::Cut {
            x_diameter_mm: round_to_increment(x, INCREMENT_MM),
            z_mm: place(z),
            feed_mm_per_rev: feed.take(),
        });
    }
    blocks.push(Block::Rapid { x_diameter_mm: Some(retract), z_mm: None });
}

/// The limits of every zone with feed and speed of its own, in the order of the answer's zones.
fn limits_of_zones(job: &Job, outcome: &Outcome, held: Option<&Held>) -> Result<Built, Failure> {
    let split = outcome.passes.as_ref().map(|passes| super::case::PassSplit {
        roughing_passes: passes.roughing_passes,
        roughing_mm: passes.roughing_depth_mm.unwrap_or(0.0),
        finishing_mm: passes.finishing_depth_mm,
    });
    let base = Case::of(job, held, split.as_ref())?;
    let mut case = base.clone();
    case.variables = Variables::default();
    if outcome.continuous.is_some() {
        // Found zones take over the limits of the zone that they lie in.
        case.custom.clear();
        case.zones = outcome
            .zones
            .iter()
            .filter_map(|given| {
                let own = base
                    .zones
                    .iter()
                    .find(|own| own.from_mm <= given.z_start_mm + 1e-6 && own.to_mm >= given.z_end_mm - 1e-6)?;
                let mut piece = own.clone();
                (piece.from_mm, piece.to_mm) = (given.z_start_mm, given.z_end_mm);
                piece.compliance_um_per_n = given.compliance_um_per_n;
                piece.touches_next = false;
                Some(piece)
            })
            .collect();
    }
    case.limits.deflection_spread_ratio_max = None;
    let at: Vec<(f64, f64)> =
        outcome.zones.iter().map(|zone| (zone.speed_m_per_min.ln(), zone.feed_mm_per_rev.ln())).collect();
    Ok(build(&case, &Variation { parts_per_edge: None, about: Some((&at, f64::INFINITY)) }))
}

/// Whether all limits of the zone by itself hold.
fn holds(built: &Built, zone: usize, u: f64, x: f64) -> bool {
    let mut y = built.program.start.clone();
    for (source, value) in [(built.speed[zone], u), (built.feed[zone], x)] {
        if let Some(variable) = source.variable {
            y[variable] = value;
        }
    }
    built
        .rows
        .iter()
        .enumerate()
        .filter(|(_, label)| label.place == Place::Zone(zone) && label.kind.is_limit())
        .all(|(row, _)| built.program.rows.value(row, &y) <= KEPT)
}

/// Feed rounded down and speed to the neighbouring whole number that keeps all limits of the zone; where neither does,
/// the lower speed and one more step of feed down.
fn words(built: &Built, zone: usize, given: &ZoneOutcome, surface: bool) -> Words {
    let per_rpm = std::f64::consts::PI * given.diameter_mm / 1000.0;
    let exact = if surface { given.speed_m_per_min } else { given.spindle_speed_rpm };
    let metres = |speed: f64| if surface { speed } else { speed * per_rpm };
    let down = |feed: f64| (feed / FEED_STEP + 1e-9).floor() * FEED_STEP;
    let feed = down(given.feed_mm_per_rev).max(FEED_STEP);
    let lower = (exact + 1e-9).floor().max(1.0);
    let upper = (exact - 1e-9).ceil().max(1.0);
    for (feed, speed) in [(feed, upper), (feed, lower), ((feed - FEED_STEP).max(FEED_STEP), lower)] {
        if holds(built, zone, metres(speed).ln(), feed.ln()) {
            return Words { feed_mm_per_rev: round_to_increment(feed, FEED_STEP), speed, kept: true };
        }
    }
    Words { feed_mm_per_rev: round_to_increment(feed, FEED_STEP), speed: lower, kept: false }
}
