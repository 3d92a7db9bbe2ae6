//! Lines that cut, and what comes out of them at a feed.

use std::collections::BTreeMap;

use crate::calculator::{Failure, Finding};
use crate::feed_schedule::stretches::{Stretch, Through, step_of};
use crate::force::Component;
use crate::machinability::{Conditions, MachinabilityModel, ModelForm};

use super::super::super::job::{Job, Refeed};
use super::super::reader::{Feed, Kind, Program};
use super::super::stock::{Stroke, strokes};
use super::super::yielding::{CutPlace, Load, Pace, Yielded};
use super::Task;

/// A thinner chip is none, mm.
const CHIP_MM: f64 = 1e-3;
/// Least step of a feed per minute, mm/min and inch/min.
const STEPS_PER_MIN: [f64; 2] = [0.1, 0.01];
/// Least step of a feed per revolution in inches.
const STEP_INCH: f64 = 1e-4;
/// One feed per revolution differs along a line by a smaller share.
const SAME_SHARE: f64 = 1e-9;
/// Exponent of the feed in a force of which none is known.
const USUAL_EXPONENT: f64 = 0.75;
const INCH_MM: f64 = 25.4;

/// A force or what follows from it: its name among limits, its limit, and what a place asks of it.
pub(super) struct OfForce {
    pub(super) name: &'static str,
    pub(super) limit: fn(&Refeed) -> Option<f64>,
    at: fn(&Load, &Refeed) -> f64,
    component: Component,
}

/// All of them.
pub(super) const FORCES: [OfForce; 4] = [
    OfForce {
        name: "force_y",
        limit: |refeed| refeed.force_y_max_n,
        at: |load, _| load.passive_n,
        component: Component::Passive,
    },
    OfForce {
        name: "force_z",
        limit: |refeed| refeed.force_z_max_n,
        at: |load, _| load.main_n,
        component: Component::Main,
    },
    OfForce {
        name: "power",
        limit: |refeed| refeed.power_kw,
        at: |load, refeed| load.main_n * load.speed_m_per_min() / (60_000.0 * refeed.efficiency),
        component: Component::Main,
    },
    OfForce {
        name: "torque",
        limit: |refeed| refeed.torque_n_m,
        at: |load, _| load.main_n * load.outer_radius_mm / 1000.0,
        component: Component::Main,
    },
];

/// A line that cuts, with one feed for all its moves.
#[derive(Debug, Clone)]
pub(super) struct CuttingLine {
    pub(super) line: usize,
    pub(super) tool: Option<u32>,
    /// Its moves at the feed.
    pub(super) moves: Vec<OneOfLine>,
    pub(super) is_finishing: bool,
    pub(super) length_mm: f64,
    pub(super) ends_mm: [f64; 2],
    /// Feed of the program, and a step of it as it is written.
    pub(super) feed_mm_per_rev: f64,
    pub(super) step_mm_per_rev: f64,
    /// Turns of the spindle, where the feed is one per minute.
    rpm: Option<f64>,
    time_min: f64,
    /// Whether the next line goes on where it ends.
    pub(super) touches_next: bool,
    edge_angle_deg: f64,
}

/// A move of a line.
#[derive(Debug, Clone, Copy)]
pub(super) struct OneOfLine {
    /// Which of the program's.
    pub(super) mv: usize,
    length_mm: f64,
    /// Whether it goes along the axis more than across it.
    is_along: bool,
}

impl OneOfLine {
    fn of(stroke: &Stroke<'_>) -> Self {
        Self { mv: stroke.index, length_mm: stroke.way.length_mm(), is_along: stroke.way.is_along() }
    }
}

impl CuttingLine {
    /// A feed per revolution as the program has it.
    pub(super) fn feed_of(&self, feed_mm_per_rev: f64) -> Feed {
        match self.rpm {
            Some(rpm) => Feed::PerMinute(feed_mm_per_rev * rpm),
            None => Feed::PerRev(feed_mm_per_rev),
        }
    }
}

/// What comes out of a line at a feed: the largest of all its places.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Reached {
    pub(super) depth_mm: f64,
    /// Off the path, of a line that finishes along the axis.
    pub(super) deflection_um: Option<f64>,
    pub(super) roughness_um: Option<f64>,
    /// By `FORCES`.
    pub(super) forces: [f64; FORCES.len()],
    pub(super) tool_usage: Option<f64>,
}

/// The lines that cut at one feed, in the order in which they first do, and those that cut otherwise and keep theirs.
pub(super) fn lines(
    (program, job): (&Program, &Job),
    zero: f64,
    finishing: &[usize],
    before: &Yielded,
) -> Result<(Vec<CuttingLine>, Vec<usize>), Failure> {
    let ways: BTreeMap<usize, Stroke<'_>> = strokes(program, job, zero).map(|stroke| (stroke.index, stroke)).collect();
    let mut loads: BTreeMap<usize, Vec<Load>> = BTreeMap::new();
    for of in before.places.iter().filter(|of| of.place.depth_mm > CHIP_MM) {
        loads.entry(of.line).or_default().extend(of.place.load);
    }
    let mut moves: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (mv, one) in program.moves.iter().enumerate().filter(|(_, one)| one.kind.is_feed()) {
        moves.entry(one.line).or_default().push(mv);
    }
    let (mut found, mut kept) = (Vec::new(), Vec::new());
    for (line, loads) in loads {
        let Some(moves) = moves.remove(&line) else { continue };
        let one = program.moves[moves[0]];
        if one.speed.is_none() || loads.iter().any(|load| load.rpm <= 0.0) {
            return Err(Failure::OutOfModel(Finding::new("speed_missing", "/nc_program").with("line", line)));
        }
        let is_one = moves.iter().all(|&mv| {
            let other = program.moves[mv];
            (other.tool, other.feed, other.speed) == (one.tool, one.feed, one.speed)
        });
        let strokes: Option<Vec<&Stroke<'_>>> = moves.iter().map(|mv| ways.get(mv)).collect();
        let (Some(strokes), Some(first), Some(of)) = (strokes, loads.first(), program.feeds_of_lines.get(&line)) else {
            kept.push(line);
            continue;
        };
        let feed = first.feed_mm_per_rev;
        if !is_one || loads.iter().any(|load| (load.feed_mm_per_rev / feed - 1.0).abs() > SAME_SHARE) {
            kept.push(line);
            continue;
        }
        let is_inch = of.unit_mm > 1.0;
        let (rpm, step_mm_per_rev) = match one.feed {
            Some(Feed::PerMinute(_)) => {
                let step = if is_inch { STEPS_PER_MIN[1] * INCH_MM } else { STEPS_PER_MIN[0] };
                (Some(first.rpm), step / first.rpm)
            }
            _ if is_inch => (None, STEP_INCH * INCH_MM),
            _ => (None, step_of(feed)),
        };
        let begins = strokes.first().map_or(0.0, |stroke| stroke.way.at(0.0)[0]);
        let ends = strokes.last().map_or(0.0, |stroke| stroke.way.at(1.0)[0]);
        found.push(CuttingLine {
            line,
            tool: one.tool,
            is_finishing: finishing.binary_search(&line).is_ok(),
            length_mm: strokes.iter().map(|stroke| stroke.way.length_mm()).sum(),
            ends_mm: [begins, ends],
            feed_mm_per_rev: feed,
            step_mm_per_rev,
            rpm,
            time_min: strokes.iter().filter_map(|stroke| time_of(stroke)).sum(),
            touches_next: false,
            edge_angle_deg: strokes.first().map_or(90.0, |stroke| stroke.tool.cutting_edge_angle_deg),
            moves: strokes.iter().map(|stroke| OneOfLine::of(stroke)).collect(),
        });
    }
    found.sort_by_key(|line| line.moves.first().map(|one| one.mv));
    for i in 1..found.len() {
        let (before, next) = (&found[i - 1], &found[i]);
        let both = before.moves.last().zip(next.moves.first());
        let goes_on = both.is_some_and(|(last, first)| last.mv + 1 == first.mv);
        found[i - 1].touches_next = goes_on && before.tool == next.tool;
    }
    Ok((found, kept))
}

/// Time of a move at the feed, min, where its speed is known: Simpson's rule over it.
fn time_of(stroke: &Stroke<'_>) -> Option<f64> {
    let pace = Pace { feed: stroke.one.feed, speed: stroke.one.speed };
    let per_mm = |share: f64| {
        let radius_mm = stroke.way.at(share)[1];
        pace.feed_mm_per_rev(radius_mm).zip(pace.rpm(radius_mm)).map(|(feed, rpm)| 1.0 / (feed * rpm))
    };
    Some(stroke.way.length_mm() * (per_mm(0.0)? + 4.0 * per_mm(0.5)? + per_mm(1.0)?) / 6.0)
}

/// Time of all moves at the feed, min.
pub(super) fn time_min(program: &Program, job: &Job, zero: f64) -> f64 {
    let feeds =
        strokes(program, job, zero).filter(|stroke| matches!(stroke.one.kind, Kind::Line | Kind::ArcCw | Kind::ArcCcw));
    feeds.filter_map(|stroke| time_of(&stroke)).sum()
}

fn value(model: &MachinabilityModel, line: &CuttingLine, place: &CutPlace, load: &Load) -> f64 {
    model.value(&Conditions {
        speed_m_per_min: load.speed_m_per_min(),
        feed_mm_per_rev: load.feed_mm_per_rev,
        depth_mm: place.depth_mm,
        cutting_edge_angle_deg: Some(line.edge_angle_deg),
    })
}

/// What came out of every line when the program was driven.
pub(super) fn reached(yielded: &Yielded, lines: &[CuttingLine], refeed: &Refeed) -> Vec<Reached> {
    let by_line: BTreeMap<usize, usize> = lines.iter().enumerate().map(|(i, line)| (line.line, i)).collect();
    let mut found: Vec<Reached> = lines.iter().map(|_| Reached::default()).collect();
    let mut last: Option<(usize, f64, f64)> = None;
    for of in &yielded.places {
        let (Some(&i), place) = (by_line.get(&of.line), &of.place) else { continue };
        let (line, one) = (&lines[i], &mut found[i]);
        let Some(own) = line.moves.iter().find(|own| own.mv == of.mv) else { continue };
        let load = place.load.filter(|_| place.depth_mm > CHIP_MM);
        // Share of an edge per share of the move.
        let wears = load
            .as_ref()
            .zip(refeed.tool_life.as_ref())
            .map_or(0.0, |(load, life)| 1.0 / (load.feed_mm_per_rev * load.rpm * value(life, line, place, load)));
        if refeed.tool_life.is_some() {
            let usage = one.tool_usage.get_or_insert(0.0);
            if let Some((_, share, worn)) = last.filter(|(mv, ..)| *mv == of.mv) {
                *usage += 0.5 * (worn + wears) * (place.share - share) * own.length_mm;
            }
            last = Some((of.mv, place.share, wears));
        }
        let Some(load) = load else { continue };
        one.depth_mm = one.depth_mm.max(place.depth_mm);
        for (value, force) in one.forces.iter_mut().zip(&FORCES) {
            *value = value.max((force.at)(&load, refeed));
        }
        let larger = |known: &mut Option<f64>, value: f64| *known = Some(known.map_or(value, |known| known.max(value)));
        if line.is_finishing && own.is_along {
            larger(&mut one.deflection_um, 1e3 * place.lift_mm.abs());
        }
        if let Some(model) = refeed.roughness.as_ref().filter(|_| line.is_finishing) {
            larger(&mut one.roughness_um, value(model, line, place, &load));
        }
    }
    found
}

impl Task<'_> {
    /// A line as a stretch of the schedule, by what came out of it at a feed.
    pub(super) fn stretch(&self, at: usize, feed_mm_per_rev: f64, reached: &Reached) -> Stretch {
        let line = &self.lines[at];
        let named = line.tool.and_then(|tool| self.program.tools.get(tool as usize));
        let exponent = |component| {
            let law = self.holding.force.monomial_at(component, 1.0);
            law.map_or(USUAL_EXPONENT, |law| law.feed_exponent)
        };
        let force = |value: f64, component| (value > 0.0).then(|| Through::power(value, exponent(component)));
        let of_model = |value: f64, model: &MachinabilityModel| Through {
            value,
            feed_exponent: model.feed_exponent,
            is_power: model.form == ModelForm::LogLog,
        };
        let outputs = FORCES.iter().zip(reached.forces).filter(|(force, _)| (force.limit)(self.refeed).is_some());
        let time_min = line.time_min * line.feed_mm_per_rev / feed_mm_per_rev;
        let life = reached.tool_usage.filter(|usage| *usage > 0.0).map(|usage| time_min / usage);
        Stretch {
            id: line.line.to_string(),
            tool: format!("T{}", named.map_or("", String::as_str)),
            feed_mm_per_rev,
            time_min,
            touches_next: line.touches_next,
            deflection_um: reached.deflection_um.and_then(|value| force(value, Component::Passive)),
            roughness_um: reached.roughness_um.zip(self.refeed.roughness.as_ref()).map(|(r, model)| of_model(r, model)),
            tool_life_min: life.zip(self.refeed.tool_life.as_ref()).map(|(life, model)| of_model(life, model)),
            outputs: outputs.map(|(of, value)| force(value, of.component)).collect(),
        }
    }
}
