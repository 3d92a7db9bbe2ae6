//! A program driven over a blank that yields: every move on what the moves before have really left.

use std::collections::{BTreeMap, BTreeSet};

use crate::calculator::{self, Failure, Finding, Monitor};
use crate::deflection_compensation::{FeedDirection, Holding, Support, Theory};
use crate::force::ForceModel;

use super::super::super::job::{Job, ProgramStock};
use super::super::reader::{Kind, Program, ProgramMove};
use super::super::stock::{Chain, Part, Shape, Stroke, Way, blank, strokes};
use super::aim::Aim;
use super::along::{Along, SoFar, after};
use super::cut::{AXIS_MM, CutPlace, Cutting, Pace};
use super::near::Near;
use super::sections::{Lumps, slices};

/// Why a program is not driven over a blank that yields.
pub(crate) const FAILURE_CODES: &[&str] = &["speed_missing", "supports_do_not_hold", "formula_without_value"];

/// How far between two places of a move the path may come off a straight line, mm: of one that finishes, of any other.
const STRAIGHT_MM: [f64; 2] = [3e-5, 3e-4];
/// A chip thinner than this is none, mm.
const CHIP_MM: f64 = 1e-7;
/// A rapid move that stays farther off is told nothing of, mm.
const NEAR_MM: f64 = 1.0;
/// A rapid move that comes nearer to what is left there is told of, mm; where a cut has just ended the tool has to come off first,
/// mm of its way.
pub(crate) const CLOSE_MM: f64 = 0.1;
const COMES_OFF_MM: f64 = 1.0;
/// A cut that is meant is deeper, and a move through the air that is told longer, mm.
const MEANT_MM: f64 = 1e-3;
const AIR_MM: f64 = 20.0;
/// So many moves before the first one that makes the contour may change with it.
const MOVES_BEFORE: usize = 3;
/// The work is as its outline has it so far beside the tool, mm.
const BESIDE_MM: f64 = 1.0;
/// Multiplications for a place of a move.
const WORK_OF_PLACE: usize = 20_000;
/// A feed that climbs by more turns a force law that was measured along the axis, rad.
const TURNED_RAD: f64 = 15.0 * std::f64::consts::PI / 180.0;

/// A place of a move that cuts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PlaceOfMove {
    /// Line of the move, and which of the program's moves it is.
    pub(crate) line: usize,
    pub(crate) mv: usize,
    pub(crate) place: CutPlace,
}

/// How moves are driven.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Driven<'a> {
    /// Lines that make the contour: they are followed more closely.
    pub(crate) finishing: &'a [usize],
    /// Moves that come out as they are meant: at their places stands what the tool has to be set in for that.
    pub(crate) corrected: &'a BTreeSet<usize>,
    /// What some moves leave instead of their own way: the work bends as these leave it.
    pub(crate) bends_as: Option<&'a Instead>,
    /// A drive of a program that is no other one before its first line of the contour: it need not be driven again until there.
    pub(crate) goes_on: Option<&'a Yielded>,
    /// A drive of the same moves at whose places they are looked at: what comes of a small change is then as smooth as the model.
    pub(crate) places_of: Option<&'a Yielded>,
    /// By how much the tool stands farther out than it is programmed, on lines that make the contour and on all others, mm.
    pub(crate) set_out_mm: [f64; 2],
}

/// No move.
static NO_MOVES: BTreeSet<usize> = BTreeSet::new();

impl<'a> Driven<'a> {
    /// By how much the tool stands out on a line, mm.
    fn set_out_mm(&self, line: usize) -> f64 {
        self.set_out_mm[usize::from(self.finishing.binary_search(&line).is_err())]
    }

    /// As moves are, with the lines that make the contour.
    pub(crate) fn as_it_is(finishing: &'a [usize]) -> Self {
        Self { finishing, corrected: &NO_MOVES, bends_as: None, goes_on: None, places_of: None, set_out_mm: [0.0; 2] }
    }
}

/// Ways of a tool instead of those of moves, by the moves.
pub(crate) type Instead = BTreeMap<usize, Vec<(Shape, Way)>>;

/// What a program leaves where work and machine yield.
#[derive(Debug, Clone, Default)]
pub(crate) struct Yielded {
    /// Places of the moves that cut, in the order of the program.
    pub(crate) places: Vec<PlaceOfMove>,
    /// The rapid moves that come near to what is left there, in the order of the program.
    pub(crate) rapids: Vec<Clearance>,
    /// The rapid moves that come close to the work before they are off it, or after: of each line the closest.
    pub(crate) close: Vec<Clearance>,
    /// What each move that cuts along the axis asks of the force law.
    pub(crate) cuts: Vec<CutMove>,
    /// What is left, and what is meant to be: what would be, did nothing yield, or the drawing.
    pub(crate) real: Vec<Part>,
    pub(crate) nominal: Vec<Part>,
    /// Lines that cut in another direction than the force law was measured in.
    pub(crate) turned_lines: BTreeSet<usize>,
    /// Lines that mean to cut and find nothing left to cut.
    pub(crate) missed_lines: BTreeSet<usize>,
    /// Long moves at the feed that cut nothing and do not mean to.
    pub(crate) in_air: Vec<InAir>,
    /// Where it stood before its first line of the contour.
    start: Option<Box<Start>>,
}

/// Where a drive stands between two moves.
#[derive(Debug, Clone)]
struct State {
    meant: Meant,
    real: Chain,
    so_far: SoFar,
    /// The last move that was still cutting when it ended.
    last_cut: Option<usize>,
    was_feed: bool,
}

/// Where a drive stood before its first line of the contour.
#[derive(Debug, Clone)]
struct Start {
    /// The move that comes next.
    index: usize,
    state: State,
    /// How many places, rapid moves, cuts and ways through the air there were.
    counts: [usize; 4],
    close: Vec<Clearance>,
    turned_lines: BTreeSet<usize>,
    missed_lines: BTreeSet<usize>,
}

/// What a move along the axis asks of the force law: depth where it is deepest, did nothing yield, feed and speed where it begins
/// and ends. Across the axis feed and speed go to whatever they are at the end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CutMove {
    pub(crate) depth_mm: f64,
    pub(crate) feeds_mm_per_rev: [f64; 2],
    pub(crate) speeds_m_per_min: [f64; 2],
}

/// A move at the feed through the air.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct InAir {
    pub(crate) line: usize,
    pub(crate) length_mm: f64,
    /// None where the speed is not known.
    pub(crate) time_min: Option<f64>,
}

/// How far a rapid move stays off the work, across the axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Clearance {
    pub(crate) line: usize,
    pub(crate) mv: usize,
    /// Below 0 it goes through it, mm.
    pub(crate) gap_mm: f64,
}

/// The work as the section of the beam has it: before and after a move that does not yield.
#[derive(Debug, Clone)]
struct Meant {
    before: Chain,
    after: Chain,
}

impl Meant {
    /// Comes to the next move.
    fn come_to(&mut self, stroke: &Stroke<'_>, bends_as: Option<&Instead>) {
        self.before.become_as(&self.after);
        match bends_as.and_then(|ways| ways.get(&stroke.index)) {
            Some(ways) => ways.iter().for_each(|(shape, way)| self.after.cut_along(shape, way, stroke.one.line)),
            None => self.after.cut_along(&stroke.shape, &stroke.way, stroke.one.line),
        }
    }
}

/// Drives a program over a blank that yields.
pub(crate) fn yielding(
    program: &Program,
    job: &Job,
    holding: &Holding,
    (stock, zero): (&ProgramStock, f64),
    driven: Driven<'_>,
    monitor: &dyn Monitor,
) -> Result<Yielded, Failure> {
    let resumed = driven.goes_on.and_then(|before| before.start.as_deref().map(|start| before.up_to(start)));
    let is_whole = resumed.is_none();
    let (mut yielded, mut state, from) = resumed.unwrap_or_else(|| (Yielded::default(), State::of(stock), 0));
    let mut kept_at = is_whole.then(|| begins_at(program, driven.finishing));
    let aim = Aim::of(job, || rigid(program, job, (stock, zero)));
    let mut pace = calculator::Pace::new(monitor);
    for mut stroke in strokes(program, job, zero).filter(|stroke| stroke.index >= from) {
        if stroke.one.kind.is_feed() {
            stroke.way = stroke.way.set_out(driven.set_out_mm(stroke.one.line));
        }
        if kept_at.take_if(|at| stroke.index >= *at).is_some() {
            yielded.start = Some(Box::new(yielded.start_at(stroke.index, state.clone())));
        }
        let State { meant, real, so_far, last_cut, was_feed } = &mut state;
        let Stroke { one, shape, way, .. } = &stroke;
        let comes_off = std::mem::replace(was_feed, one.kind.is_feed());
        if one.kind == Kind::Rapid {
            yielded.find_close(&stroke, real, comes_off);
            let gap_mm = -real.depth_of(shape, way);
            if gap_mm < NEAR_MM {
                yielded.rapids.push(Clearance { line: one.line, mv: stroke.index, gap_mm });
            }
        }
        if !one.kind.is_feed() {
            continue;
        }
        meant.come_to(&stroke, driven.bends_as);
        if real.depth_of(shape, way) <= CHIP_MM {
            yielded.find_nothing(&stroke, meant.before.depth_of(shape, way));
            continue;
        }
        let acts = acts(job, program.executed_at(stroke.index));
        if !holding.is_held_by(&acts) {
            return Err(refused("supports_do_not_hold", one.line));
        }
        let move_pace = Pace { feed: one.feed, speed: one.speed };
        if move_pace.speed.is_none() && (holding.force.depends_on_speed() || move_pace.feed_mm_per_rev(1.0).is_none()) {
            return Err(refused("speed_missing", one.line));
        }
        let bore_mm = stock.bore_diameter_mm;
        let lumps = lumps(holding, meant, way);
        let held =
            holding.hold(&slices(&meant.before, &meant.after, bore_mm, lumps.as_ref()), &acts, direction(way))?;
        let cutting = Cutting {
            stroke: &stroke,
            held: &held,
            force: &holding.force,
            with_main: holding.tangential,
            with_loads: job.mode.kind.refeeds(),
            nominal: Near::of(&meant.before, shape, way),
            real: Near::of(real, shape, way),
            goes_on: *last_cut == stroke.index.checked_sub(1),
            is_corrected: driven.corrected.contains(&stroke.index),
            aim: aim.as_ref(),
        };
        let is_corrected = cutting.is_corrected;
        let straight_mm = STRAIGHT_MM[usize::from(driven.finishing.binary_search(&one.line).is_err())];
        let from = cutting.meets_from();
        let shares = driven.places_of.map_or_else(Vec::new, |before| before.shares(stroke.index));
        let along = Along { cutting, way, from, so_far: *so_far, move_pace, straight_mm, shares };
        let mut places = along.places()?;
        pace.work(places.len() * WORK_OF_PLACE)?;
        if is_corrected && aim.is_none() {
            real.cut_along(shape, way, one.line);
        } else {
            let off = |place: &CutPlace| if is_corrected { place.wanted_mm } else { place.lift_mm };
            let lifted: Vec<Way> = places
                .windows(2)
                .map(|pair| way.lifted([pair[0].share, pair[1].share], [off(&pair[0]), off(&pair[1])]))
                .collect();
            real.cut_along_all(shape, &lifted, one.line);
        }
        if !driven.corrected.is_empty() {
            let is_end = |place: &CutPlace| place.share <= 0.0 || place.share >= 1.0;
            for place in places.iter_mut().filter(|place| place.depth_mm <= 0.0 || is_end(place)) {
                let at = [place.z_mm, place.radius_mm];
                place.clear_mm = -real.depth_of(shape, &Way::Line(at, at));
            }
        }
        *so_far = after(*so_far, way, move_pace);
        yielded.cuts.extend(asked(way, move_pace, &places));
        let is_turned = places.iter().any(|place| place.depth_mm > 0.0) && climbs(way);
        if is_turned && !matches!(holding.force, ForceModel::Kienzle(_)) {
            yielded.turned_lines.insert(one.line);
        }
        let (line, mv) = (one.line, stroke.index);
        *last_cut = places.last().filter(|place| place.depth_mm > 0.0).map(|_| mv);
        yielded.places.extend(places.into_iter().map(|place| PlaceOfMove { line, mv, place }));
    }
    yielded.real = state.real.parts();
    yielded.nominal = aim.map_or_else(|| state.meant.after.parts(), Aim::into_meant);
    Ok(yielded)
}

/// What a program leaves on rigid work.
fn rigid(program: &Program, job: &Job, (stock, zero): (&ProgramStock, f64)) -> Vec<Part> {
    let mut chain = blank(stock);
    for stroke in strokes(program, job, zero).filter(|stroke| stroke.one.kind.is_feed()) {
        chain.cut_along(&stroke.shape, &stroke.way, stroke.one.line);
    }
    chain.parts()
}

/// Where the work bends as a few slices do: everywhere but about the tool, unless its weight counts, or
/// shear, or a rest goes with the tool.
fn lumps(holding: &Holding, meant: &Meant, way: &Way) -> Option<Lumps> {
    let supports_mm: Option<Vec<f64>> = holding.supports.iter().map(Support::station_mm).collect();
    let supports_mm = supports_mm?;
    if holding.weight || holding.shaft.theory == Some(Theory::Timoshenko) {
        return None;
    }
    let [from, to] = way.ends().map(|[x, _]| x);
    let turned = meant.before.differs_from(&meant.after).unwrap_or([from, from]);
    // An arc may reach farther than its ends.
    let beyond = if let Way::Arc { radius, .. } = way { *radius } else { 0.0 };
    let low = from.min(to).min(turned[0]) - beyond - BESIDE_MM;
    let high = from.max(to).max(turned[1]) + beyond + BESIDE_MM;
    Some(Lumps { near_mm: [low, high], supports_mm })
}

/// What a move asks of the force law; nothing where it cuts nothing.
fn asked(way: &Way, pace: Pace, places: &[CutPlace]) -> Option<CutMove> {
    let depth_mm = places.iter().map(|place| place.nominal_depth_mm).fold(0.0, f64::max);
    let radii = way.ends().map(|[_, radius]| radius.max(AXIS_MM));
    let [Some(first), Some(last)] = radii.map(|radius| pace.feed_mm_per_rev(radius)) else { return None };
    let speed = |radius: f64| 2.0 * std::f64::consts::PI * radius * pace.rpm(radius).unwrap_or(0.0) / 1000.0;
    (depth_mm > MEANT_MM && way.is_along()).then(|| CutMove {
        depth_mm,
        feeds_mm_per_rev: [first, last],
        speeds_m_per_min: radii.map(speed),
    })
}

/// The first move of a line that makes the contour, less a few: how the moves before it end may change with it.
fn begins_at(program: &Program, finishing: &[usize]) -> usize {
    let is_first = |one: &ProgramMove| finishing.binary_search(&one.line).is_ok();
    program.moves.iter().position(is_first).unwrap_or(0).saturating_sub(MOVES_BEFORE)
}

impl State {
    fn of(stock: &ProgramStock) -> Self {
        let meant = Meant { before: blank(stock), after: blank(stock) };
        Self { meant, real: blank(stock), so_far: SoFar::default(), last_cut: None, was_feed: false }
    }
}

impl Yielded {
    /// Shares of a move at which it was looked at; none where it was not.
    fn shares(&self, mv: usize) -> Vec<f64> {
        let first = self.places.partition_point(|of| of.mv < mv);
        self.places[first..].iter().take_while(|of| of.mv == mv).map(|of| of.place.share).collect()
    }

    /// The moves before its first line of the contour, as far as they are kept.
    pub(crate) fn moves_before_contour(&self) -> usize {
        self.start.as_ref().map_or(0, |start| start.index)
    }

    fn start_at(&self, index: usize, state: State) -> Start {
        Start {
            index,
            state,
            counts: [self.places.len(), self.rapids.len(), self.cuts.len(), self.in_air.len()],
            close: self.close.clone(),
            turned_lines: self.turned_lines.clone(),
            missed_lines: self.missed_lines.clone(),
        }
    }

    /// The drive as it was at its start, and the move that comes next.
    fn up_to(&self, start: &Start) -> (Self, State, usize) {
        let [places, rapids, cuts, in_air] = start.counts;
        let found = Self {
            places: self.places[..places].to_vec(),
            rapids: self.rapids[..rapids].to_vec(),
            close: start.close.clone(),
            cuts: self.cuts[..cuts].to_vec(),
            turned_lines: start.turned_lines.clone(),
            missed_lines: start.missed_lines.clone(),
            in_air: self.in_air[..in_air].to_vec(),
            ..Self::default()
        };
        (found, start.state.clone(), start.index)
    }

    /// Keeps a rapid move that comes close to the work; where a cut has just ended, once it had to be off.
    fn find_close(&mut self, stroke: &Stroke<'_>, real: &mut Chain, comes_off: bool) {
        let length_mm = stroke.way.length_mm();
        let from = if comes_off { COMES_OFF_MM / length_mm } else { 0.0 };
        if length_mm <= 0.0 || from >= 1.0 {
            return;
        }
        let gap_mm = -real.depth_of(&stroke.shape, &stroke.way.lifted([from, 1.0], [0.0; 2]));
        let close = Clearance { line: stroke.one.line, mv: stroke.index, gap_mm };
        match self.close.last_mut().filter(|last| last.line == close.line) {
            _ if gap_mm >= CLOSE_MM => {}
            Some(last) => last.gap_mm = last.gap_mm.min(gap_mm),
            None => self.close.push(close),
        }
    }

    /// Keeps a move at the feed that cuts nothing, with the depth that it would have, did nothing yield.
    fn find_nothing(&mut self, stroke: &Stroke<'_>, meant_mm: f64) {
        let (line, length_mm) = (stroke.one.line, stroke.way.length_mm());
        if meant_mm > MEANT_MM {
            self.missed_lines.insert(line);
        } else if length_mm > AIR_MM {
            let pace = Pace { feed: stroke.one.feed, speed: stroke.one.speed };
            let radius_mm = stroke.way.at(0.5)[1].max(AXIS_MM);
            let per_min = pace.feed_mm_per_rev(radius_mm).zip(pace.rpm(radius_mm)).map(|(feed, rpm)| feed * rpm);
            let time_min = per_min.filter(|per_min| *per_min > 0.0).map(|per_min| length_mm / per_min);
            self.in_air.push(InAir { line, length_mm, time_min });
        }
    }
}

fn refused(code: &'static str, line: usize) -> Failure {
    Failure::OutOfModel(Finding::new(code, "/nc_program").with("line", line))
}

/// Which of the supports act in a line.
fn acts(job: &Job, line: usize) -> Vec<bool> {
    (0_u32..).zip(&job.supports).map(|(support, _)| job.acts(support, line)).collect()
}

fn direction(way: &Way) -> FeedDirection {
    let [from, to] = way.ends();
    if to[0] > from[0] { FeedDirection::ToTailstock } else { FeedDirection::ToHeadstock }
}

/// Whether a way leaves the direction of the axis by much.
fn climbs(way: &Way) -> bool {
    let steep = |share: f64| way.direction(share).is_some_and(|[x, r]| r.atan2(x.abs()).abs() > TURNED_RAD);
    [0.0, 0.5, 1.0].into_iter().any(steep)
}
