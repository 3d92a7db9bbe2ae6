//! The program of a schedule: one or more cuts per zone, feed and speed in the control's steps (`feed/9.2`).

use std::borrow::Cow;

use crate::calculator::{Column, Failure, Finding, Program, Table};
use crate::deflection_compensation::{ProgramZero, Reach, chuck_in_the_way, met};
use crate::force::ForceModel;
use crate::path::round_to_increment;
use crate::shaft::{FeedDirection, Support};
use crate::turning::{self, Limits, Proof, Setting, Speed, Stretch, Written, edge_meets_shoulders};

use crate::feed_schedule::answer::driven::Work;
use crate::feed_schedule::answer::output::{ChangePlace, Outcome, ToolChange, ZoneOutcome};
use crate::feed_schedule::answer::words::{Spoken, Words, at_diameter, is_surface, modes};
use crate::feed_schedule::job::blank::{Blank, Turned, zones_fit_the_shaft};
use crate::feed_schedule::job::input::{Job, SpeedMode};
use crate::feed_schedule::model::edges::cutting_order;

/// Steps of the control, mm.
const INCREMENT_MM: f64 = 0.001;
/// Share of a diameter by which a pass may differ from the one that its zone is counted at without a word.
const COUNTED: f64 = 0.02;
/// Share of the error without compensation by which that of the compensated program may be larger than told: feed and
/// speed are rounded.
const ROUNDED: f64 = 0.02;
const UM_PER_MM: f64 = 1e3;

/// One cut along a zone.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::feed_schedule) struct Pass {
    pub zone: usize,
    pub turned: Turned,
    /// Station and diameter, in the order of the cut.
    corners: Vec<(f64, f64)>,
    /// It goes on where the cut before it ended: the tool stays in the work.
    goes_on: bool,
}

/// The program of an answer with what it was seen to do.
pub(in crate::feed_schedule) struct Made {
    passes: Vec<Pass>,
    stretches: Vec<Stretch>,
    written: Written,
    proof: Option<Proof>,
    limits: Limits,
}

/// The program of an answer; none that would cut what the job's shaft says otherwise, none through a chuck, and none that was
/// not seen to do what the answer says.
pub(in crate::feed_schedule) fn program(job: &Job, outcome: &Outcome) -> Result<Program, Failure> {
    let passes = passes(job, outcome);
    zones_fit_the_shaft(job, outcome, &passes.iter().map(|pass| pass.turned).collect::<Vec<_>>())?;
    let made = Made::of(job, outcome)?;
    if let Some(chuck) = chuck_in_the_way(&reach(job, outcome, &made.written.program), &job.supports) {
        return Err(Failure::OutOfModel(chuck));
    }
    if let Some(proof) = &made.proof {
        proof.holds(&made.limits)?;
        as_told(outcome, proof)?;
    }
    Ok(made.written.program)
}

/// Refuses a program of a compensated path that leaves more than the answer says.
fn as_told(outcome: &Outcome, proof: &Proof) -> Result<(), Failure> {
    let Some(path) = &outcome.compensated_path else { return Ok(()) };
    let limit = path.largest_compensated_um + ROUNDED * path.largest_uncompensated_um + INCREMENT_MM * UM_PER_MM;
    let off = proof.farthest_um().abs();
    if off <= limit {
        return Ok(());
    }
    Err(Failure::OutOfModel(Finding::new("program_off_prediction", "/program").measured(off, limit, "um")))
}

impl Made {
    /// Writes the program of an answer and drives it over the blank.
    pub(in crate::feed_schedule) fn of(job: &Job, outcome: &Outcome) -> Result<Self, Failure> {
        let said = Spoken::of(job, outcome)?;
        let setting = setting(job, outcome);
        let passes = passes(job, outcome);
        let words: Vec<Words> = passes
            .iter()
            .map(|pass| at_diameter(said.words[pass.zone], &outcome.zones[pass.zone], pass.turned.diameter_mm, job))
            .collect();
        let stretches = stretches(job, outcome, &said, &setting, &passes, &words);
        let edges: Vec<f64> = stretches.iter().flat_map(|stretch| &stretch.corners).map(|corner| corner.0).collect();
        let cuts: Vec<Turned> = passes.iter().map(|pass| pass.turned).collect();
        let (mut work, blank) = Work::of(job, &said, &passes, &words, &Blank::of(job, &cuts, &edges))?;
        let head = said.passed.iter().cloned().chain(after_parts(job, outcome)).collect();
        let written = turning::write(&setting, &blank, &mut work, head, &stretches);
        let driven = turning::drive(&written, &blank, setting.zero_mm, &mut work);
        let fits = zones_fit_the_shaft(job, outcome, &cuts).is_ok();
        let proof = if fits { driven.proof(|station| work.wanted_mm(station), |_| None) } else { None };
        let limits = Limits {
            clearance_mm: setting.beside_x_mm().min(setting.beside_z_mm()),
            beside_prediction_um: f64::INFINITY,
        };
        Ok(Self { passes, stretches, written, proof, limits })
    }

    /// What the program was seen to do; nothing where its zones do not fit the shaft.
    pub(in crate::feed_schedule) fn proof(&self) -> Option<Proof> {
        self.proof.clone()
    }

    /// What the program meets on its way: places where the tool feeds in radially, chucks and steady rests, passes far
    /// from the diameter that they are counted at.
    pub(in crate::feed_schedule) fn encounters(&self, job: &Job, outcome: &Outcome) -> Vec<Finding> {
        let reach = reach(job, outcome, &self.written.program);
        let mut found = self.plunges(job, outcome);
        found.extend(job.supports.iter().enumerate().filter_map(|(i, support)| met(&reach, i, support)));
        found.extend(thicker(job, outcome, &self.passes));
        found.extend(beyond_the_spindle(job, outcome));
        found.extend(self.shoulders(job));
        found
    }

    /// Shoulders that the edge runs into.
    fn shoulders(&self, job: &Job) -> Vec<Finding> {
        let cuts: Vec<Turned> = self.passes.iter().map(|pass| pass.turned).collect();
        let finished = Blank::of(job, &cuts, &[]).finished(&cuts);
        let of_force = || job.force.as_ref().and_then(ForceModel::cutting_edge_angle_deg);
        let (angle_deg, pointer) = match job.cutting_edge_angle_deg {
            Some(angle_deg) => (Some(angle_deg), "/cutting_edge_angle_deg"),
            None => (of_force(), "/force/cutting_edge_angle_deg"),
        };
        edge_meets_shoulders(angle_deg, pointer, job.feed_direction, &finished)
    }

    /// Places where the tool goes down beside what is as thick as the cut, once each with the smallest diameter.
    fn plunges(&self, job: &Job, outcome: &Outcome) -> Vec<Finding> {
        let mut starts: Vec<(f64, f64)> = Vec::new();
        // A cut that goes on at a smaller diameter goes down beside the one before it.
        let goes_down = (1..self.stretches.len()).filter(|&k| {
            let (before, next) = (self.stretches[k - 1].corners.last(), self.stretches[k].corners.first());
            self.stretches[k].goes_on && before.zip(next).is_some_and(|(before, next)| next.1 < before.1 - INCREMENT_MM)
        });
        let plunging = self.written.plunges.iter().copied().chain(goes_down);
        for &(z_mm, diameter_mm) in plunging.filter_map(|k| self.stretches[k].corners.first()) {
            match starts.iter_mut().find(|(known, _)| (known - z_mm).abs() < INCREMENT_MM) {
                Some((_, least_mm)) => *least_mm = least_mm.min(diameter_mm),
                None => starts.push((z_mm, diameter_mm)),
            }
        }
        let zero = zero_mm(job, outcome);
        let warning = |(z_mm, diameter_mm): (f64, f64)| {
            Finding::new("plunge_at_shoulder", "/zones")
                .value(z_mm, "mm")
                .with("z_program_mm", round_to_increment(z_mm - zero, INCREMENT_MM))
                .with("diameter_mm", diameter_mm)
        };
        starts.into_iter().map(warning).collect()
    }
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

fn setting(job: &Job, outcome: &Outcome) -> Setting {
    job.program.setting(INCREMENT_MM, zero_mm(job, outcome), job.feed_direction, &job.supports)
}

/// What is cut in one go, with its words: every pass, parted where a rest is passed and where the edge is used up.
fn stretches(
    job: &Job,
    outcome: &Outcome,
    said: &Spoken,
    setting: &Setting,
    passes: &[Pass],
    words: &[Words],
) -> Vec<Stretch> {
    let parts = parts(outcome, passes);
    let edges = 1 + parts.iter().flatten().filter(|part| part.changes).count();
    let stops: Vec<f64> = job.supports.iter().filter_map(|support| stop_before_mm(support, setting)).collect();
    let (mut all, mut noted, mut edge): (Vec<Stretch>, Option<usize>, usize) = (Vec::new(), None, 1);
    for (cut, (pass, words)) in passes.iter().zip(words).enumerate() {
        for (k, part) in parts[cut].iter().enumerate() {
            edge += usize::from(part.changes);
            let stop = part.changes.then(|| format!("edge {edge} of {edges}: index or change the insert"));
            let corners = between(&pass.corners, part.shares, setting);
            for (j, corners) in parted(corners, &stops).into_iter().enumerate() {
                let begins = k == 0 && j == 0;
                let notes = if noted == Some(pass.zone) { Vec::new() } else { vec![said.note(job, pass.zone)] };
                noted = Some(pass.zone);
                let at_stop = corners.first().is_some_and(|first| stops.iter().any(|stop| near(*stop, first.0)));
                all.push(Stretch {
                    goes_on: begins && pass.goes_on && !part.changes && !at_stop,
                    feed_mm_per_rev: words.feed_mm_per_rev,
                    speed: if is_surface(job) {
                        Speed::Surface(words.speed, spindle_limit_rpm(job))
                    } else {
                        Speed::Spindle(words.speed)
                    },
                    cut,
                    notes,
                    stop: stop.clone().filter(|_| j == 0),
                    corners,
                });
            }
        }
    }
    all
}

/// After how many parts the edge is changed, where edges are whole and one serves several.
fn after_parts(job: &Job, outcome: &Outcome) -> Option<String> {
    let limits = job.limits.as_ref().filter(|limits| limits.whole_edges)?;
    let change = outcome.tool_changes.last().filter(|change| change.every_parts > 1)?;
    let every = change.every_parts;
    let note = format!("one edge cuts {every} parts: index or change the insert after every {every} parts");
    Some(match limits.batch_parts {
        Some(batch) => format!("{note}, {} edges for {batch} parts", batch.div_ceil(every)),
        None => note,
    })
}

/// A part of a pass, as shares of its length, and whether it begins with a new edge.
struct Part {
    shares: [f64; 2],
    changes: bool,
}

/// The passes as the edges cut them: parted where the plan of the answer changes the tool.
fn parts(outcome: &Outcome, passes: &[Pass]) -> Vec<Vec<Part>> {
    const SAME: f64 = 1e-9;
    let mut cuts_of_zone = vec![0_u32; outcome.zones.len()];
    let of = |pass: &Pass| {
        cuts_of_zone[pass.zone] += 1;
        let begins_here = |change: &&ToolChange| {
            change.place != ChangePlace::BetweenParts
                && change.before_zone == outcome.zones[pass.zone].id
                && change.pass == cuts_of_zone[pass.zone]
        };
        let (mut parts, mut from, mut changes) = (Vec::new(), 0.0, false);
        for change in outcome.tool_changes.iter().filter(begins_here) {
            let share = share_along(pass, change.z_mm);
            if share > from + SAME {
                parts.push(Part { shares: [from, share], changes });
                from = share;
            }
            changes = true;
        }
        parts.push(Part { shares: [from, 1.0], changes });
        parts
    };
    passes.iter().map(of).collect()
}

/// Share of the length of a pass that is cut when the tool is at a station.
fn share_along(pass: &Pass, z_mm: f64) -> f64 {
    match (pass.corners.first(), pass.corners.last()) {
        (Some(first), Some(last)) if (last.0 - first.0).abs() > 0.0 => {
            ((z_mm - first.0) / (last.0 - first.0)).clamp(0.0, 1.0)
        }
        _ => 0.0,
    }
}

/// Station at which the tool leaves the work before a rest that it is to pass, mm.
fn stop_before_mm(support: &Support, setting: &Setting) -> Option<f64> {
    let Support::SteadyRest { z_mm, .. } = *support else { return None };
    let stop = z_mm + setting.side * setting.beside_z_mm() - setting.zero_mm;
    Some(round_to_increment(stop, setting.increment_mm) + setting.zero_mm)
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() < 0.5 * INCREMENT_MM
}

/// The corners between two shares of the way along the shaft.
fn between(corners: &[(f64, f64)], shares: [f64; 2], setting: &Setting) -> Vec<(f64, f64)> {
    let (Some(first), Some(last)) = (corners.first(), corners.last()) else { return Vec::new() };
    let place = |share: f64| {
        let z = first.0 + share * (last.0 - first.0) - setting.zero_mm;
        round_to_increment(z, setting.increment_mm) + setting.zero_mm
    };
    let mut rest = corners.to_vec();
    if shares[1] < 1.0 {
        rest = split(&rest, place(shares[1])).0;
    }
    if shares[0] > 0.0 {
        rest = split(&rest, place(shares[0])).1;
    }
    rest
}

/// The corners in pieces that end at the stops.
fn parted(corners: Vec<(f64, f64)>, stops: &[f64]) -> Vec<Vec<(f64, f64)>> {
    let (Some(&(from, _)), Some(&(to, _))) = (corners.first(), corners.last()) else { return Vec::new() };
    let inside = |stop: f64| from.min(to) + INCREMENT_MM < stop && stop < from.max(to) - INCREMENT_MM;
    let mut stops: Vec<f64> = stops.iter().copied().filter(|stop| inside(*stop)).collect();
    stops.sort_by(|a, b| (a - from).abs().total_cmp(&(b - from).abs()));
    let (mut pieces, mut rest) = (Vec::new(), corners);
    for stop in stops {
        let (before, after) = split(&rest, stop);
        pieces.push(before);
        rest = after;
    }
    pieces.push(rest);
    pieces
}

/// Corners of a path: station and diameter.
type Corners = Vec<(f64, f64)>;

/// The corners before and after a station between the first and the last.
fn split(corners: &[(f64, f64)], z_mm: f64) -> (Corners, Corners) {
    let forward = corners.last().map_or(0.0, |last| last.0) >= corners.first().map_or(0.0, |first| first.0);
    let passed = |z: f64| if forward { z < z_mm } else { z > z_mm };
    let count = corners.iter().take_while(|corner| passed(corner.0)).count().clamp(1, corners.len().max(2) - 1);
    let (before, after) = corners.split_at(count);
    let ((z0, x0), (z1, x1)) = (before[count - 1], after.first().copied().unwrap_or(before[count - 1]));
    let share = if (z1 - z0).abs() > 0.0 { ((z_mm - z0) / (z1 - z0)).clamp(0.0, 1.0) } else { 0.0 };
    let middle = (z_mm, round_to_increment(x0 + share * (x1 - x0), INCREMENT_MM));
    let (mut before, mut after) = (before.to_vec(), after.to_vec());
    before.push(middle);
    if after.first().is_none_or(|first| !near(first.0, z_mm)) {
        after.insert(0, middle);
    }
    (before, after)
}

/// Every corner of the program's cuts, in its order.
pub(in crate::feed_schedule) fn path_table(job: &Job, outcome: &Outcome) -> Table {
    let zero_mm = zero_mm(job, outcome);
    let (mut zone, mut x, mut z) = (Vec::new(), Vec::new(), Vec::new());
    if let Ok(made) = Made::of(job, outcome) {
        for stretch in &made.stretches {
            // Where the tool goes on at the same diameter there is no corner.
            let joint =
                stretch.goes_on && x.last().zip(stretch.corners.first()).is_some_and(|(x, first)| near(*x, first.1));
            for (z_mm, x_mm) in stretch.corners.iter().skip(usize::from(joint)) {
                zone.push(Cow::Owned(outcome.zones[made.passes[stretch.cut].zone].id.clone()));
                x.push(*x_mm);
                z.push(round_to_increment(z_mm - zero_mm, INCREMENT_MM));
            }
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
    let order = cutting_order(job.feed_direction, outcome.zones.len(), |i| is_roughing(outcome, i));
    let mut all: Vec<Pass> = Vec::new();
    for i in order {
        for x_mm in diameters(outcome, i) {
            let mut next = pass(job, outcome, i, x_mm);
            next.goes_on = all.last().is_some_and(|before| goes_on(before, &next, outcome));
            all.push(next);
        }
    }
    all
}

/// Whether a cut goes on where the one before it ended, which it does if both are the only cuts of zones that touch: the feed
/// changes in the work and leaves no mark of a new start.
fn goes_on(before: &Pass, next: &Pass, outcome: &Outcome) -> bool {
    let single = |pass: &Pass| outcome.zones[pass.zone].passes == 1 && !is_roughing(outcome, pass.zone);
    let (Some(&last), Some(&first)) = (before.corners.last(), next.corners.first()) else { return false };
    before.zone != next.zone && single(before) && single(next) && near(last.0, first.0)
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

fn pass(job: &Job, outcome: &Outcome, index: usize, x_mm: f64) -> Pass {
    let zone = &outcome.zones[index];
    let path = outcome.compensated_path.as_ref().and_then(|path| path.zones.get(index));
    let mut corners: Vec<(f64, f64)> = match path {
        Some(path) => path.z_mm.iter().copied().zip(path.commanded_diameter_mm.iter().copied()).collect(),
        None => vec![(zone.z_start_mm, x_mm), (zone.z_end_mm, x_mm)],
    };
    if job.feed_direction == FeedDirection::ToHeadstock {
        corners.reverse();
    }
    for (_, x) in &mut corners {
        *x = round_to_increment(*x, INCREMENT_MM);
    }
    let turned = Turned { from_mm: zone.z_start_mm, to_mm: zone.z_end_mm, diameter_mm: x_mm, depth_mm: zone.depth_mm };
    Pass { goes_on: false, zone: index, turned, corners }
}
