//! The program of a schedule: one or more cuts per zone, feed and speed in the control's steps (`feed/9.2`).

use std::borrow::Cow;

use crate::calculator::{Block, Column, Failure, Finding, Program, Table};
use crate::deflection_compensation::{ProgramZero, Reach, chuck_in_the_way, met};
use crate::path::round_to_increment;
use crate::shaft::FeedDirection;

use super::assess;
use super::blank::{Blank, Turned, zones_fit_the_shaft};
use super::case::{Case, TOUCHING_MM, ZoneCase};
use super::compliance::Held;
use super::continuous::add_zone;
use super::input::{Job, SpeedMode, Variables};
use super::output::{Outcome, ZoneOutcome};
use super::program::{Built, Place, Variation, build};

/// Steps of the control, mm.
const INCREMENT_MM: f64 = 0.001;
/// Step of the feed, mm/rev.
const FEED_STEP: f64 = 0.001;
/// Share of a diameter by which a pass may differ from the one that its zone is counted at without a word.
const COUNTED: f64 = 0.02;
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
    let binds = job.variables.speed == SpeedMode::ConstantSpeed && fastest.spindle_speed_rpm > limit_rpm * (1.0 + 1e-9);
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
    let zone = &outcome.zones[most.zone];
    (ratio(most) > 1.0 + COUNTED).then(|| {
        let keeps_speed =
            matches!(job.variables.speed, SpeedMode::PerZone | SpeedMode::Fixed | SpeedMode::ConstantSpeed);
        Finding::new("pass_thicker_than_counted", "/zones")
            .measured(most.turned.diameter_mm, zone.diameter_mm, "mm")
            .with("zone", zone.id.clone())
            .with("percent", 100.0 * (ratio(most) - 1.0))
            .with("speed", if keeps_speed { "kept" } else { "faster" })
    })
}

fn reach(job: &Job, outcome: &Outcome, program: &Program) -> Reach {
    Reach::along(program, zero_mm(job, outcome), job.program.clearance_z_mm)
}

fn written(job: &Job, outcome: &Outcome, passes: &[Pass]) -> Result<Program, Failure> {
    let surface = job.variables.speed == SpeedMode::ConstantSpeed;
    let held = Held::of(job)?;
    let (case, built) = limits_of_zones(job, outcome, held.as_ref())?;
    let words = words_of_zones(job, &built, outcome, surface);
    let at: Vec<(f64, f64)> =
        outcome.zones.iter().zip(&words).map(|(zone, words)| logs(zone, words, surface)).collect();
    let retract = retract_mm(job, passes);
    let mut blocks = vec![Block::Modes];
    blocks.extend(passed(&case, &built, &at).into_iter().map(Block::Note));
    let (mut spoken, mut noted): (Option<f64>, Option<usize>) = (None, None);
    for (k, pass) in passes.iter().enumerate() {
        let words = &at_diameter(words[pass.zone], &outcome.zones[pass.zone], pass.turned.diameter_mm, job);
        if noted != Some(pass.zone) {
            let rounded = assess::zone_outcome(&case, job, pass.zone, at[pass.zone]);
            blocks.push(Block::Note(note(&rounded, words)));
            noted = Some(pass.zone);
        }
        if spoken.is_none_or(|last| (last - words.speed).abs() > 1e-9) {
            blocks.push(if surface {
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
    order.sort_by_key(|&i| !outcome.zones[i].id.ends_with(":rough"));
    let mut all: Vec<Pass> = Vec::new();
    for i in order {
        for x_mm in diameters(outcome, &outcome.zones[i]) {
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
        let away = job.program.clearance_z_mm * away(job.feed_direction);
        // Beside what is as thick the tool goes down at the cut's begin itself.
        let stands_mm = blank.widest_between_mm(pass.begins_mm, pass.begins_mm + away);
        let is_free = stands_mm < pass.turned.diameter_mm - 1e-9;
        pass.approach_mm = is_free.then(|| round_to_increment(pass.begins_mm + away - zero, INCREMENT_MM));
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
    let single = |pass: &Pass| outcome.zones[pass.zone].passes == 1 && !outcome.zones[pass.zone].id.ends_with(":rough");
    let (Some(&last), Some(&first)) = (before.corners.last(), next.corners.first()) else { return };
    let near = |a: f64, b: f64| (a - b).abs() < 0.5 * INCREMENT_MM;
    next.goes_on = before.zone != next.zone && single(before) && single(next) && near(last.1, first.1);
    if next.goes_on && near(last.0, first.0) {
        next.corners.remove(0);
    }
}

/// Diameters that the passes of a zone turn down to, every one by the zone's depth.
fn diameters(outcome: &Outcome, zone: &ZoneOutcome) -> Vec<f64> {
    let bare = zone.id.strip_suffix(":rough");
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

/// The words of a zone for a pass at another diameter: the same speed at the cut, where a pass may have a speed of
/// its own.
fn at_diameter(words: Words, zone: &ZoneOutcome, diameter_mm: f64, job: &Job) -> Words {
    match job.variables.speed {
        SpeedMode::ConstantSpeed | SpeedMode::ConstantRpm => words,
        SpeedMode::PerZone | SpeedMode::Fixed => {
            let speed = words.speed * zone.diameter_mm / diameter_mm;
            Words { speed: if speed < words.speed { speed.floor().max(1.0) } else { words.speed }, ..words }
        }
    }
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
        text.push_str(" rounding breaks a limit of this zone");
    }
    text
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

/// The limits of every zone with feed and speed of its own, in the order of the answer's zones.
fn limits_of_zones(job: &Job, outcome: &Outcome, held: Option<&Held>) -> Result<(Case, Built), Failure> {
    let split = outcome.passes.as_ref().map(|passes| super::case::PassSplit {
        roughing_passes: passes.roughing_passes,
        roughing_mm: passes.roughing_depth_mm.unwrap_or(0.0),
        finishing_mm: passes.finishing_depth_mm,
    });
    let base = Case::of(job, held, split.as_ref())?;
    let mut case = base.clone();
    case.variables = Variables::default();
    if outcome.continuous.is_some() {
        // Found zones take over the limits of the zone that they lie in, and keep their own names.
        case.custom.clear();
        case.zones.clear();
        for (k, given) in outcome.zones.iter().enumerate() {
            let lies_in = |own: &ZoneCase| own.from_mm <= given.z_start_mm + 1e-6 && own.to_mm >= given.z_end_mm - 1e-6;
            let zone = base.zones.iter().position(lies_in);
            let zone = zone.ok_or_else(|| Failure::Internal("a found zone lies in none of the job's".to_owned()))?;
            let mut piece = base.zones[zone].clone();
            piece.id.clone_from(&given.id);
            (piece.from_mm, piece.to_mm) = (given.z_start_mm, given.z_end_mm);
            piece.compliance_um_per_n = given.compliance_um_per_n;
            let next = outcome.zones.get(k + 1);
            piece.touches_next = next.is_some_and(|next| (next.z_start_mm - given.z_end_mm).abs() <= TOUCHING_MM);
            add_zone(&mut case, &base, zone, piece);
        }
    }
    case.limits.deflection_spread_ratio_max = None;
    let at: Vec<(f64, f64)> =
        outcome.zones.iter().map(|zone| (zone.speed_m_per_min.ln(), zone.feed_mm_per_rev.ln())).collect();
    let built = build(&case, &Variation { parts_per_edge: outcome.parts_per_edge, about: Some((&at, f64::INFINITY)) });
    Ok((case, built))
}

/// ln V and ln S as programmed.
fn logs(zone: &ZoneOutcome, words: &Words, surface: bool) -> (f64, f64) {
    (metres_per_min(zone, words.speed, surface).ln(), words.feed_mm_per_rev.ln())
}

fn metres_per_min(zone: &ZoneOutcome, speed: f64, surface: bool) -> f64 {
    if surface { speed } else { speed * std::f64::consts::PI * zone.diameter_mm / 1000.0 }
}

/// The program's variables with these values in the zones.
fn variables(built: &Built, at: impl Iterator<Item = (usize, (f64, f64))>) -> Vec<f64> {
    let mut y = built.program.start.clone();
    for (zone, (u, x)) in at {
        for (source, value) in [(built.speed[zone], u), (built.feed[zone], x)] {
            if let Some(variable) = source.variable {
                y[variable] = value;
            }
        }
    }
    y
}

/// Whether all limits of the zone by itself hold.
fn holds(built: &Built, zone: usize, at: (f64, f64)) -> bool {
    let y = variables(built, std::iter::once((zone, at)));
    built
        .rows
        .iter()
        .enumerate()
        .filter(|(_, label)| label.place == Place::Zone(zone) && label.kind.is_limit())
        .all(|(row, _)| built.program.rows.value(row, &y) <= KEPT)
}

/// Limits over several zones or the part that the rounded words pass, each in words. A lower feed takes longer, and can
/// use more of the edge.
fn passed(case: &Case, built: &Built, at: &[(f64, f64)]) -> Vec<String> {
    let y = variables(built, at.iter().copied().enumerate());
    let rows = built.rows.iter().enumerate().map(|(row, label)| (label, built.program.rows.value(row, &y)));
    let sums = built.sums.iter().zip(&built.program.sums).map(|(label, terms)| (label, terms.log_sum_exp(&y)));
    rows.chain(sums)
        .filter(|(label, value)| label.kind.is_limit() && !matches!(label.place, Place::Zone(_)) && *value > KEPT)
        .map(|(label, value)| {
            let name = label.name(case);
            format!("rounded words pass {} of {} by {:.2} percent", name.constraint, name.zone, 100.0 * value.exp_m1())
        })
        .collect()
}

/// Feed rounded down and speed to a neighbouring whole number that keeps all limits: not always the lower one, since
/// the passive force grows when the speed falls. Where neither does, the lower speed and one more step of feed down.
/// A speed that is one for all zones stays one.
fn words_of_zones(job: &Job, built: &Built, outcome: &Outcome, surface: bool) -> Vec<Words> {
    let zones = &outcome.zones;
    let exact = |zone: &ZoneOutcome| if surface { zone.speed_m_per_min } else { zone.spindle_speed_rpm };
    let lower = |zone: &ZoneOutcome| (exact(zone) + 1e-9).floor().max(1.0);
    let upper = |zone: &ZoneOutcome| (exact(zone) - 1e-9).ceil().max(1.0);
    let down = |zone: &ZoneOutcome| ((zone.feed_mm_per_rev / FEED_STEP + 1e-9).floor() * FEED_STEP).max(FEED_STEP);
    let keeps =
        |i: usize, feed: f64, speed: f64| holds(built, i, (metres_per_min(&zones[i], speed, surface).ln(), feed.ln()));
    let shared = matches!(job.variables.speed, SpeedMode::ConstantSpeed | SpeedMode::ConstantRpm);
    let all_upper = shared && zones.iter().enumerate().all(|(i, zone)| keeps(i, down(zone), upper(zone)));
    zones
        .iter()
        .enumerate()
        .map(|(i, zone)| {
            let feed = down(zone);
            let slower = (feed - FEED_STEP).max(FEED_STEP);
            let tries = match (shared, all_upper) {
                (true, true) => vec![(feed, upper(zone))],
                (true, false) => vec![(feed, lower(zone)), (slower, lower(zone))],
                (false, _) => vec![(feed, upper(zone)), (feed, lower(zone)), (slower, lower(zone))],
            };
            let found = tries.iter().copied().find(|&(feed, speed)| keeps(i, feed, speed));
            let (feed, speed) = found.unwrap_or((feed, lower(zone)));
            Words { feed_mm_per_rev: round_to_increment(feed, FEED_STEP), speed, kept: found.is_some() }
        })
        .collect()
}
