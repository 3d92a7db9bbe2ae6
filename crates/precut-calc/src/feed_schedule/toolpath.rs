//! The program of a schedule: one or more cuts per zone, feed and speed in the control's steps (`feed/9.2`).

use std::borrow::Cow;

use crate::calculator::{Block, Column, Failure, Finding, Program, Table};
use crate::deflection_compensation::{BESIDE_MM, ProgramZero, Reach, chuck_in_the_way, met};
use crate::path::round_to_increment;
use crate::shaft::FeedDirection;

use super::blank::{Blank, Turned, zones_fit_the_shaft};
use super::input::{Job, SpeedMode};
use super::output::{Outcome, ZoneOutcome};
use super::words::{Spoken, at_diameter, is_surface, modes};

/// Steps of the control, mm.
const INCREMENT_MM: f64 = 0.001;
/// Share of a diameter by which a pass may differ from the one that its zone is counted at without a word.
const COUNTED: f64 = 0.02;
/// One cut along a zone: where the tool turns, in the control's steps, in the order of the cut.
#[derive(Debug, Clone, PartialEq)]
struct Pass {
    zone: usize,
    turned: Turned,
    /// Diameter and station from program zero.
    corners: Vec<(f64, f64)>,
    /// Station of its begin.
    begins_mm: f64,
    /// Where the tool goes down before it; at the first corner itself beside what is as thick.
    approach_mm: Option<f64>,
    /// It goes on where the cut before it ended: the tool stays in the work.
    goes_on: bool,
}

/// The program of an answer; none that would cut what the job's shaft says otherwise, and none through a chuck.
pub(super) fn program(job: &Job, outcome: &Outcome) -> Result<Program, Failure> {
    let passes = passes(job, outcome);
    let cuts: Vec<Turned> = passes.iter().map(|pass| pass.turned).collect();
    zones_fit_the_shaft(job, outcome, &cuts)?;
    let program = written(job, outcome, &passes)?;
    match chuck_in_the_way(&reach(job, outcome, &program), &job.supports) {
        Some(chuck) => Err(Failure::OutOfModel(chuck)),
        None => Ok(program),
    }
}

/// What the program of an answer meets on its way: places where the tool feeds in radially, chucks and steady rests,
/// passes far from the diameter that they are counted at.
pub(super) fn encounters(job: &Job, outcome: &Outcome) -> Vec<Finding> {
    let passes = passes(job, outcome);
    let retract = retract_mm(job, &passes);
    let mut blocks = Vec::new();
    for (k, pass) in passes.iter().enumerate() {
        moves(&mut blocks, pass, passes.get(k + 1), None, retract);
    }
    let program = Program { dialect: job.program.dialect, increment_mm: INCREMENT_MM, blocks };
    let reach = reach(job, outcome, &program);
    let mut found = plunges(&passes);
    found.extend(job.supports.iter().enumerate().filter_map(|(i, support)| met(&reach, i, support)));
    found.extend(thicker(job, outcome, &passes));
    found.extend(beyond_the_spindle(job, outcome));
    found
}

/// Largest spindle speed of a program with constant cutting speed.
fn spindle_limit_rpm(job: &Job) -> f64 {
    job.machine.spindle_speed_max_rpm.unwrap_or(f64::INFINITY).min(job.program.spindle_limit_rpm)
}

/// The zone whose constant cutting speed the program's limit of the spindle cuts most.
fn beyond_the_spindle(job: &Job, outcome: &Outcome) -> Option<Finding> {
    let limit_rpm = spindle_limit_rpm(job);
    let fastest = outcome.zones.iter().max_by(|a, b| a.spindle_speed_rpm.total_cmp(&b.spindle_speed_rpm))?;
    let binds = is_surface(job) && fastest.spindle_speed_rpm > limit_rpm * (1.0 + 1e-9);
    binds.then(|| {
        Finding::new("spindle_limit_binds", "/program/spindle_limit_rpm")
            .measured(fastest.spindle_speed_rpm, limit_rpm, "rev/min")
            .with("diameter_mm", fastest.diameter_mm)
            .with("wanted_m_per_min", fastest.speed_m_per_min)
            .with("left_m_per_min", fastest.speed_m_per_min * limit_rpm / fastest.spindle_speed_rpm)
    })
}

/// Places where the tool goes down beside what is as thick as the cut, once each with the smallest diameter.
fn plunges(passes: &[Pass]) -> Vec<Finding> {
    let mut starts: Vec<(f64, f64, f64)> = Vec::new();
    for (k, pass) in passes.iter().enumerate() {
        // A cut that goes on at a smaller diameter goes down beside the one before it.
        let from_thicker =
            || k.checked_sub(1).is_some_and(|before| passes[before].turned.diameter_mm > pass.turned.diameter_mm);
        let plunges = if pass.goes_on { from_thicker() } else { pass.approach_mm.is_none() };
        if !plunges {
            continue;
        }
        let Some(&(diameter_mm, z_program_mm)) = pass.corners.first() else { continue };
        match starts.iter_mut().find(|(z_mm, ..)| (*z_mm - pass.begins_mm).abs() < INCREMENT_MM) {
            Some((.., least_mm)) => *least_mm = least_mm.min(diameter_mm),
            None => starts.push((pass.begins_mm, z_program_mm, diameter_mm)),
        }
    }
    let warning = |(z_mm, z_program_mm, diameter_mm): (f64, f64, f64)| {
        Finding::new("plunge_at_shoulder", "/zones")
            .value(z_mm, "mm")
            .with("z_program_mm", z_program_mm)
            .with("diameter_mm", diameter_mm)
    };
    starts.into_iter().map(warning).collect()
}

/// The pass that is the farthest from the diameter at which its zone's time, wear and torque are counted.
fn thicker(job: &Job, outcome: &Outcome, passes: &[Pass]) -> Option<Finding> {
    let ratio = |pass: &Pass| pass.turned.diameter_mm / outcome.zones[pass.zone].diameter_mm;
    let most = passes.iter().max_by(|a, b| ratio(a).total_cmp(&ratio(b)))?;
    let (zone, ratio) = (&outcome.zones[most.zone], ratio(most));
    let least_rpm = job.machine.spindle_speed_min_rpm.unwrap_or(0.0);
    // What the cutting speed there is times that of the zone.
    let at_least = least_rpm * ratio / zone.spindle_speed_rpm;
    let (speed, faster) = match modes(job).1 {
        SpeedMode::ConstantRpm => ("one_for_all", ratio),
        _ if at_least > 1.0 => ("least", at_least),
        SpeedMode::PerZone | SpeedMode::Fixed | SpeedMode::ConstantSpeed => ("kept", 1.0),
    };
    (ratio > 1.0 + COUNTED).then(|| {
        Finding::new("pass_thicker_than_counted", "/zones")
            .measured(most.turned.diameter_mm, zone.diameter_mm, "mm")
            .with("zone", zone.id.clone())
            .with("percent", 100.0 * (ratio - 1.0))
            .with("speed", speed)
            .with("least_rpm", least_rpm)
            .with("beyond", beyond_at(job, zone, ratio, faster))
    })
}

/// Limits that a zone passes at so many times its diameter and its cutting speed.
fn beyond_at(job: &Job, zone: &ZoneOutcome, ratio: f64, faster: f64) -> Vec<&'static str> {
    let passes = |times: f64, value: Option<f64>, limit: Option<f64>| {
        value.zip(limit).is_some_and(|(value, limit)| value * times > limit * (1.0 + 1e-9))
    };
    let speed_max = job.limits.as_ref().map(|limits| limits.speed_max_m_per_min);
    [
        ("speed_max", faster > 1.0 && passes(faster, Some(zone.speed_m_per_min), speed_max)),
        ("power", faster > 1.0 && passes(faster, zone.power_kw, job.machine.power_kw)),
        ("torque", passes(ratio, zone.torque_n_m, job.machine.torque_n_m)),
    ]
    .into_iter()
    .filter_map(|(name, beyond)| beyond.then_some(name))
    .collect()
}

fn reach(job: &Job, outcome: &Outcome, program: &Program) -> Reach {
    Reach::along(program, zero_mm(job, outcome), job.program.clearance_z_mm)
}

fn written(job: &Job, outcome: &Outcome, passes: &[Pass]) -> Result<Program, Failure> {
    let said = Spoken::of(job, outcome)?;
    let retract = retract_mm(job, passes);
    let mut blocks = vec![Block::Modes];
    blocks.extend(said.passed.iter().cloned().map(Block::Note));
    let (mut spoken, mut noted): (Option<f64>, Option<usize>) = (None, None);
    for (k, pass) in passes.iter().enumerate() {
        let words = &at_diameter(said.words[pass.zone], &outcome.zones[pass.zone], pass.turned.diameter_mm, job);
        if noted != Some(pass.zone) {
            blocks.push(Block::Note(said.note(job, pass.zone)));
            noted = Some(pass.zone);
        }
        if spoken.is_none_or(|last| (last - words.speed).abs() > 1e-9) {
            blocks.push(if is_surface(job) {
                Block::SurfaceSpeed { speed_m_per_min: words.speed, limit_rpm: spindle_limit_rpm(job) }
            } else {
                Block::SpindleSpeed { rpm: words.speed }
            });
            spoken = Some(words.speed);
        }
        moves(&mut blocks, pass, passes.get(k + 1), Some(words.feed_mm_per_rev), retract);
    }
    blocks.push(Block::End);
    Ok(Program { dialect: job.program.dialect, increment_mm: INCREMENT_MM, blocks })
}

/// Every corner of the program's cuts, in its order.
pub(super) fn path_table(job: &Job, outcome: &Outcome) -> Table {
    let (mut zone, mut x, mut z) = (Vec::new(), Vec::new(), Vec::new());
    for pass in passes(job, outcome) {
        for (x_mm, z_mm) in pass.corners {
            zone.push(Cow::Owned(outcome.zones[pass.zone].id.clone()));
            x.push(x_mm);
            z.push(z_mm);
        }
    }
    Table {
        id: "path",
        columns: vec![
            Column::words("zone", zone),
            Column::numbers("x_diameter", "mm", &x),
            Column::numbers("z_program", "mm", &z),
        ],
    }
}

/// Diameter at which the tool travels: beyond everything that stands.
fn retract_mm(job: &Job, passes: &[Pass]) -> f64 {
    let cuts: Vec<Turned> = passes.iter().map(|pass| pass.turned).collect();
    round_to_increment(Blank::of(job, &cuts).widest_mm() + job.program.clearance_x_mm, INCREMENT_MM)
}

/// Station of the program's zero.
fn zero_mm(job: &Job, outcome: &Outcome) -> f64 {
    let length = || {
        job.shaft.as_ref().map_or_else(
            || outcome.zones.iter().map(|zone| zone.z_end_mm).fold(0.0, f64::max),
            crate::shaft::Shaft::length_mm,
        )
    };
    match job.program.zero {
        ProgramZero::RightFace => length(),
        ProgramZero::LeftFace => 0.0,
    }
}

/// The cuts in their order: zones in the direction of cutting, all roughing before the finish.
fn passes(job: &Job, outcome: &Outcome) -> Vec<Pass> {
    let zero = zero_mm(job, outcome);
    let mut order: Vec<usize> = (0..outcome.zones.len()).collect();
    if job.feed_direction == FeedDirection::ToHeadstock {
        order.reverse();
    }
    // Roughing of a zone stands before its finish and is cut first, whichever way the tool travels.
    order.sort_by_key(|&i| !is_roughing(outcome, i));
    let mut all: Vec<Pass> = Vec::new();
    for i in order {
        for x_mm in diameters(outcome, i) {
            let mut next = pass(job, outcome, i, x_mm, zero);
            if let Some(before) = all.last() {
                join(before, &mut next, outcome);
            }
            all.push(next);
        }
    }
    let cuts: Vec<Turned> = all.iter().map(|pass| pass.turned).collect();
    let mut blank = Blank::of(job, &cuts);
    for pass in &mut all {
        let (clearance_mm, side) = (job.program.clearance_z_mm, away(job.feed_direction));
        // Beside what is as thick the tool goes down at the cut's begin itself; a compensated path begins deeper.
        let first_mm = pass.corners.first().map_or(f64::INFINITY, |corner| corner.0).min(pass.turned.diameter_mm);
        let stands_mm = blank.widest_between_mm(pass.begins_mm, pass.begins_mm + side * (clearance_mm + BESIDE_MM));
        let is_free = clearance_mm >= INCREMENT_MM && stands_mm < first_mm - 1e-9;
        let approach_mm = pass.begins_mm + side * clearance_mm - zero;
        pass.approach_mm = is_free.then(|| round_to_increment(approach_mm, INCREMENT_MM));
        blank.turn(&pass.turned);
    }
    all
}

/// Which way along the shaft the tool comes from.
fn away(direction: FeedDirection) -> f64 {
    if direction == FeedDirection::ToHeadstock { 1.0 } else { -1.0 }
}

/// Lets a cut go on where the one before it ended, if both are the only cuts of zones that touch: the feed changes in the
/// work and leaves no mark of a new start.
fn join(before: &Pass, next: &mut Pass, outcome: &Outcome) {
    let single = |pass: &Pass| outcome.zones[pass.zone].passes == 1 && !is_roughing(outcome, pass.zone);
    let (Some(&last), Some(&first)) = (before.corners.last(), next.corners.first()) else { return };
    let near = |a: f64, b: f64| (a - b).abs() < 0.5 * INCREMENT_MM;
    next.goes_on = before.zone != next.zone && single(before) && single(next) && near(last.1, first.1);
    if next.goes_on && near(last.0, first.0) {
        next.corners.remove(0);
    }
}

/// Whether a zone of the answer is the roughing of one of the job's, which the split into passes has made. Names alone say
/// nothing: a user's own may end alike.
fn is_roughing(outcome: &Outcome, zone: usize) -> bool {
    outcome.passes.is_some() && outcome.zones[zone].id.ends_with(":rough")
}

/// Diameters that the passes of a zone turn down to, every one by the zone's depth.
fn diameters(outcome: &Outcome, index: usize) -> Vec<f64> {
    let zone = &outcome.zones[index];
    let bare = zone.id.strip_suffix(":rough").filter(|_| is_roughing(outcome, index));
    let is_finish = |other: &&ZoneOutcome| bare.is_some() && other.id.strip_suffix(":finish") == bare;
    let rest = outcome.zones.iter().find(is_finish).map_or(0.0, |finish| finish.depth_mm);
    (0..zone.passes).rev().map(|k| zone.diameter_mm + 2.0 * (rest + f64::from(k) * zone.depth_mm)).collect()
}

fn pass(job: &Job, outcome: &Outcome, index: usize, x_mm: f64, zero: f64) -> Pass {
    let to_headstock = job.feed_direction == FeedDirection::ToHeadstock;
    let zone = &outcome.zones[index];
    let path = outcome.compensated_path.as_ref().and_then(|path| path.zones.get(index));
    let mut corners: Vec<(f64, f64)> = match path {
        Some(path) => path.commanded_diameter_mm.iter().copied().zip(path.z_mm.iter().copied()).collect(),
        None => vec![(x_mm, zone.z_start_mm), (x_mm, zone.z_end_mm)],
    };
    if to_headstock {
        corners.reverse();
    }
    let place = |z: f64| round_to_increment(z - zero, INCREMENT_MM);
    let turned = Turned { from_mm: zone.z_start_mm, to_mm: zone.z_end_mm, diameter_mm: x_mm, depth_mm: zone.depth_mm };
    Pass {
        goes_on: false,
        zone: index,
        turned,
        begins_mm: if to_headstock { zone.z_end_mm } else { zone.z_start_mm },
        approach_mm: None,
        corners: corners.into_iter().map(|(x, z)| (round_to_increment(x, INCREMENT_MM), place(z))).collect(),
    }
}

/// To a cut, along it, and away from it unless the next one goes on.
fn moves(blocks: &mut Vec<Block>, pass: &Pass, next: Option<&Pass>, mut feed: Option<f64>, retract: f64) {
    if let (Some(&(first_x, first_z)), false) = (pass.corners.first(), pass.goes_on) {
        blocks.push(Block::Rapid { x_diameter_mm: Some(retract), z_mm: Some(pass.approach_mm.unwrap_or(first_z)) });
        if pass.approach_mm.is_some() {
            blocks.push(Block::Rapid { x_diameter_mm: Some(first_x), z_mm: None });
        }
    }
    for &(x_diameter_mm, z_mm) in &pass.corners {
        blocks.push(Block::Cut { x_diameter_mm, z_mm, feed_mm_per_rev: feed.take() });
    }
    if !next.is_some_and(|next| next.goes_on) {
        blocks.push(Block::Rapid { x_diameter_mm: Some(retract), z_mm: None });
    }
}
