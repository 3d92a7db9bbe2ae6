//! Which moves are shifted, and by how much along them (`program/5`).

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::super::super::job::Mode;
use super::super::reader::{Feed, Kind, Nose, Program, ProgramMove, WordsOfLine};
use super::super::stock::{Stroke, Way};
use super::super::yielding::{AXIS_MM, Instead, Pace, PlaceOfMove, Yielded};
use super::calls::Calls;
use super::chords::{Knot, Limits, Wanted, between, chords};

const MM_PER_UM: f64 = 1e-3;
const MIN_PER_MS: f64 = 1.0 / 60_000.0;
/// A straight move along the axis by no more makes a face, which keeps its place, mm.
const FACE_MM: f64 = 1e-9;
/// Lengths that are no different, mm.
const SAME_MM: f64 = 1e-6;
/// An arc that turns by more is not shifted, rad.
const WIDEST_RAD: f64 = 170.0 * std::f64::consts::PI / 180.0;
/// A jump of the shift is felt so far beside the nose, mm.
const BESIDE_MM: f64 = 0.1;
/// What a chord is taken to lose of the lift by its slope, to the lift itself (measured: 0.5 to 1.4).
const LOST_OF_LIFT: f64 = 1.6;
/// A tool that is nearer touches the work, mm.
const TOUCHES_MM: f64 = 1e-3;
/// Share of the tolerance that the chords may use: the rest is for rounding of Z and for what lies between two places.
const OF_TOLERANCE: f64 = 0.8;

/// Why a finishing line stays as it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum WhyLeftAlone {
    /// It belongs to a cycle that cannot be written out as its moves, or is run more than once.
    Cycle,
    /// It makes a face, which keeps its place.
    Face,
    /// It is an arc of nearly half a turn.
    Arc,
    /// The next block cannot be made to begin elsewhere.
    Block,
    /// It comes nearer to the axis than `minimum_diameter_mm`.
    NearAxis,
    /// The work would come out too thin beside a jump of its shift.
    NotSupportedByModel,
    /// It would change by less than half an increment.
    BelowResolution,
}

/// A finishing line that stays as it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct LeftAlone {
    pub(crate) line: usize,
    pub(crate) why: WhyLeftAlone,
}

/// Shifts of the radius, by the moves of a program.
#[derive(Debug, Clone, Default)]
pub(crate) struct Shifts {
    /// Knots along a move by shares of it, with the shift, mm; the last one is its end.
    pub(crate) knots: BTreeMap<usize, Vec<Knot>>,
    /// The same by shares of the programmed path, of moves with compensation of the nose.
    pub(crate) programmed: BTreeMap<usize, Vec<Knot>>,
    /// Shift at the end of a move that has no knots, mm.
    pub(crate) ends: BTreeMap<usize, f64>,
    /// Stretches of the work, from the headstock end, over which the shift jumps and is laid on the side of the stock, mm.
    pub(crate) jumps: Vec<Jump>,
}

impl Shifts {
    /// The largest one, mm.
    pub(crate) fn largest_mm(&self) -> f64 {
        self.knots.values().flatten().map(|knot| knot[1].abs()).fold(0.0, f64::max)
    }

    /// The largest share by which one changes how the work bends: four times its share of the radius.
    pub(crate) fn largest_share(&self, ways: &BTreeMap<usize, Stroke<'_>>) -> f64 {
        let share = |(index, knots): (&usize, &Vec<Knot>)| {
            let [from, to] = ways.get(index).map(|stroke| stroke.way.ends())?;
            let largest = knots.iter().map(|knot| knot[1].abs()).fold(0.0, f64::max);
            Some(4.0 * largest / from[1].min(to[1]).max(AXIS_MM))
        };
        self.knots.iter().filter_map(share).fold(0.0, f64::max)
    }

    /// The ways that moves take with their shifts.
    pub(crate) fn ways(&self, ways: &BTreeMap<usize, Stroke<'_>>) -> Instead {
        let pieces = |(index, knots): (&usize, &Vec<Knot>)| {
            let stroke = ways.get(index)?;
            let lifted = |pair: &[Knot]| stroke.way.lifted([pair[0][0], pair[1][0]], [pair[0][1], pair[1][1]]);
            Some((*index, knots.windows(2).map(|pair| (stroke.shape, lifted(pair))).collect()))
        };
        self.knots.iter().filter_map(pieces).collect()
    }
}

/// Knots by shares of the programmed path: beside it the nose may begin and end elsewhere.
fn programmed(stroke: &Stroke<'_>, knots: &[Knot]) -> Vec<Knot> {
    let [from, to] = stroke.programmed;
    let inner = |share: f64| if share <= 0.0 || share >= 1.0 { share } else { from + share * (to - from) };
    knots.iter().map(|&[share, shift]| [inner(share), shift]).filter(|[share, _]| (0.0..=1.0).contains(share)).collect()
}

/// A stretch over which the work may stay thick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Jump {
    pub(crate) line: usize,
    /// Ends from the headstock end, mm.
    pub(crate) from_mm: f64,
    pub(crate) to_mm: f64,
}

fn words<'p>(program: &'p Program, one: &ProgramMove, index: usize) -> Option<&'p WordsOfLine> {
    program.words_of_lines.get(&one.line)?.as_ref().filter(|words| words.mv == index)
}

/// The moves that may be shifted, and the finishing lines that may not.
pub(crate) fn eligible(
    program: &Program,
    ways: &BTreeMap<usize, Stroke<'_>>,
    calls: &Calls<'_>,
    (finishing, mode): (&[usize], &Mode),
    before: &Yielded,
) -> (BTreeSet<usize>, Vec<LeftAlone>) {
    let cut: BTreeSet<usize> = before.places.iter().map(|of| of.mv).collect();
    let (mut eligible, mut left) = (BTreeSet::new(), Vec::new());
    for (&index, stroke) in ways {
        let one = stroke.one;
        if finishing.binary_search(&one.line).is_err() || !cut.contains(&index) {
            continue;
        }
        match why_not(program, calls, stroke, mode) {
            None => {
                eligible.insert(index);
            }
            Some(why) => left.push(LeftAlone { line: one.line, why }),
        }
    }
    (eligible, left)
}

/// Whether a move goes straight across the axis.
fn is_face(stroke: &Stroke<'_>) -> bool {
    let [from, to] = stroke.way.ends();
    matches!(stroke.way, Way::Line(..)) && (from[0] - to[0]).abs() <= FACE_MM
}

fn why_not(program: &Program, calls: &Calls<'_>, stroke: &Stroke<'_>, mode: &Mode) -> Option<WhyLeftAlone> {
    let (one, index) = (stroke.one, stroke.index);
    let of_line = words(program, one, index);
    if of_line.is_none() && calls.of_move(index).is_none() {
        return Some(WhyLeftAlone::Cycle);
    }
    let [from, to] = stroke.way.ends();
    if let Way::Arc { turn, .. } = stroke.way {
        if turn.abs() > WIDEST_RAD {
            return Some(WhyLeftAlone::Arc);
        }
    } else if is_face(stroke) {
        return Some(WhyLeftAlone::Face);
    }
    if from[1].min(to[1]) < AXIS_MM.max(0.5 * mode.minimum_diameter_mm) {
        return Some(WhyLeftAlone::NearAxis);
    }
    // What follows has to be able to end where it did; a cycle comes back to where it began.
    let next = program.moves.get(index + 1);
    let goes_on = next.is_none_or(|next| next.kind == Kind::Home || words(program, next, index + 1).is_some());
    (of_line.is_some() && !goes_on).then_some(WhyLeftAlone::Block)
}

/// Lines that were planned and came out as they were.
pub(crate) fn below_resolution(
    program: &Program,
    eligible: &BTreeSet<usize>,
    changed: &BTreeSet<usize>,
) -> Vec<LeftAlone> {
    let stays = eligible.difference(changed).map(|&index| program.moves[index].line);
    stays.map(|line| LeftAlone { line, why: WhyLeftAlone::BelowResolution }).collect()
}

/// What is wanted along all moves that cut.
pub(crate) struct Plan<'a> {
    program: &'a Program,
    ways: &'a BTreeMap<usize, Stroke<'a>>,
    calls: &'a Calls<'a>,
    curves: BTreeMap<usize, Curve>,
    eligible: &'a BTreeSet<usize>,
    limits: Limits,
    /// Least time of a block, min.
    min_block_min: f64,
    /// So near to a corner what is wanted counts for it, mm.
    near_mm: f64,
}

impl<'a> Plan<'a> {
    /// Of a program whose moves were driven as they should come out.
    pub(crate) fn of(
        program: &'a Program,
        (ways, calls): (&'a BTreeMap<usize, Stroke<'a>>, &'a Calls<'a>),
        planned: &Yielded,
        eligible: &'a BTreeSet<usize>,
        mode: &Mode,
    ) -> Self {
        let limits = Limits {
            tolerance: OF_TOLERANCE * mode.chord_tolerance_um * MM_PER_UM,
            shortest: mode.min_block_length_mm,
            lost: LOST_OF_LIFT,
        };
        let mut curves: BTreeMap<usize, Curve> = BTreeMap::new();
        for places in planned.places.chunk_by(|a, b| a.mv == b.mv) {
            if let Some((&index, stroke)) = places.first().and_then(|first| ways.get_key_value(&first.mv)) {
                curves.insert(index, Curve::of(stroke, places));
            }
        }
        Self {
            program,
            ways,
            calls,
            curves,
            eligible,
            limits,
            near_mm: mode.min_block_length_mm,
            min_block_min: mode.min_block_time_ms * MIN_PER_MS,
        }
    }

    /// Lays jumps of the shift over a longer stretch.
    pub(crate) fn lay_gentler(&mut self) {
        self.limits.lost *= 2.0;
    }

    /// The shifts of the moves that may be shifted.
    pub(crate) fn shifts(&self) -> Shifts {
        let mut shifts = Shifts::default();
        for index in self.eligible {
            let (Some(curve), Some(stroke)) = (self.curves.get(index), self.ways.get(index)) else { continue };
            let before = index.checked_sub(1).filter(|before| self.joins(*before));
            let reached = before.and_then(|before| shifts.knots.get(&before)).and_then(|knots| knots.last());
            let (start, end) = (reached.map_or_else(|| self.start(*index), |knot| knot[1]), self.end(*index));
            if let Some(before) = before.filter(|before| !self.eligible.contains(before) && start.abs() > 0.0) {
                shifts.ends.insert(before, start);
            }
            let knots = chords(&curve.points, start, end, self.limits_of(stroke));
            shifts.jumps.extend(curve.jumps(&knots, self.limits.tolerance, stroke));
            let shares = knots.into_iter().map(|[at, shift]| [at / curve.length_mm, shift]);
            let shares: Vec<Knot> = shares.collect();
            if stroke.one.nose != Nose::Off {
                shifts.programmed.insert(*index, programmed(stroke, &shares));
            }
            shifts.knots.insert(*index, shares);
        }
        shifts
    }

    /// The limits with the length that the least time of a block makes at the feed of a move.
    fn limits_of(&self, stroke: &Stroke<'_>) -> Limits {
        let pace = Pace { feed: stroke.one.feed, speed: stroke.one.speed };
        // Where a constant surface speed turns it fastest.
        let [from, to] = stroke.way.ends();
        let per_min = match pace.feed {
            Some(Feed::PerRev(feed)) => pace.rpm(from[1].min(to[1])).map(|rpm| feed * rpm),
            Some(Feed::PerMinute(feed)) => Some(feed),
            None => None,
        };
        let of_time = per_min.map_or(0.0, |feed| feed * self.min_block_min);
        // A control that compensates the nose wants blocks as long as it is wide.
        let of_nose = if stroke.one.nose == Nose::Off { 0.0 } else { 2.0 * stroke.shape.nose };
        Limits { shortest: self.limits.shortest.max(of_time).max(of_nose), ..self.limits }
    }

    /// Whether the next move of the program begins where this one ends, with the same tool.
    fn joins(&self, index: usize) -> bool {
        let pair = self.program.moves.get(index).zip(self.program.moves.get(index + 1));
        pair.is_some_and(|(one, next)| one.tool == next.tool && one.end.known().is_some())
    }

    /// Whether where a move ends can be written.
    fn can_end(&self, index: usize) -> bool {
        let has_words = self.program.moves.get(index).is_some_and(|one| words(self.program, one, index).is_some());
        has_words || self.calls.of_move(index).is_some()
    }

    /// Whether a move that is not shifted makes a part of the contour along the work: then it ends where it did.
    fn makes_something(&self, index: usize) -> bool {
        let cuts = self.curves.get(&index).is_some_and(|curve| curve.points.iter().any(|point| point.cuts));
        cuts && self.ways.get(&index).is_some_and(|stroke| !is_face(stroke))
    }

    /// The shift at the begin of a move.
    fn start(&self, index: usize) -> f64 {
        let Some(before) = index.checked_sub(1).filter(|&before| self.joins(before)) else { return 0.0 };
        match self.curves.get(&index).and_then(|curve| curve.first(self.near_mm)) {
            Some(wanted) if self.can_end(before) && !self.makes_something(before) => {
                self.curves.get(&before).and_then(|curve| curve.bound(true)).map_or(wanted, |bound| wanted.max(bound))
            }
            _ => 0.0,
        }
    }

    /// The shift at the end of a move; none where nothing asks for one.
    fn end(&self, index: usize) -> Option<f64> {
        let own = self.curves.get(&index).and_then(|curve| curve.last(self.near_mm));
        // At a corner the tool stands where it cuts nothing thin, be it on this move or on the next one.
        let next = self.curves.get(&(index + 1));
        let wanted = match self.program.moves.get(index + 1).filter(|one| self.joins(index) && one.kind.is_feed()) {
            None => None,
            Some(_) if self.eligible.contains(&(index + 1)) => next.and_then(|next| next.first(self.near_mm)),
            // One along the work that is not shifted begins where it did.
            Some(_) if self.ways.get(&(index + 1)).is_some_and(|stroke| !is_face(stroke)) => return Some(0.0),
            // One that cuts nothing where it begins slides along what is just made.
            Some(_) => Some(next.and_then(|next| next.bound(false)).unwrap_or(0.0)),
        };
        match (own, wanted) {
            (Some(own), Some(wanted)) => Some(own.max(wanted)),
            (own, wanted) => own.or(wanted),
        }
    }
}

/// The shift wanted along a move, by the length from its begin.
struct Curve {
    points: Vec<Wanted>,
    length_mm: f64,
    /// How far the tool may be set in at both ends without touching the work, mm.
    clear_mm: [f64; 2],
}

impl Curve {
    fn of(stroke: &Stroke<'_>, places: &[PlaceOfMove]) -> Self {
        let length_mm = stroke.way.length_mm();
        let cuts = |of: &PlaceOfMove| of.place.depth_mm > 0.0;
        let shift = |of: &PlaceOfMove| of.place.wanted_mm - of.place.lift_mm;
        let lowest = places.iter().filter(|of| cuts(of)).map(shift).fold(0.0, f64::min);
        let wanted = |of: &PlaceOfMove| Wanted {
            at: of.place.share * length_mm,
            shift: if cuts(of) { shift(of) } else { -of.place.clear_mm.clamp(0.0, -lowest) },
            cuts: cuts(of),
        };
        let clear = |of: Option<&PlaceOfMove>| of.map_or(0.0, |of| of.place.clear_mm.max(0.0));
        Self {
            points: places.iter().map(wanted).collect(),
            length_mm,
            clear_mm: [clear(places.first()), clear(places.last())],
        }
    }

    /// The largest shift wanted so near to the begin that it counts for the corner there; none where nothing is cut.
    fn first(&self, near_mm: f64) -> Option<f64> {
        self.largest([0.0, near_mm])
    }

    /// The least shift at an end at which a move that is not shifted itself cuts nothing thin.
    fn bound(&self, at_end: bool) -> Option<f64> {
        let point = if at_end { self.points.last() } else { self.points.first() };
        let clear_mm = self.clear_mm[usize::from(at_end)];
        point.map(|point| if point.cuts && clear_mm <= TOUCHES_MM { point.shift } else { -clear_mm })
    }

    fn last(&self, near_mm: f64) -> Option<f64> {
        self.largest([self.length_mm - near_mm, self.length_mm])
    }

    fn largest(&self, [from, to]: [f64; 2]) -> Option<f64> {
        let inside = |wanted: &Wanted| (from..=to).contains(&wanted.at);
        // Places may stand farther apart.
        let ends = self.points.windows(2).flat_map(|pair| {
            let at = [from, to].map(|at| at.clamp(pair[0].at, pair[1].at));
            at.map(|at| between(pair[0], pair[1], at))
        });
        let near: Vec<Wanted> = self.points.iter().copied().chain(ends).filter(inside).collect();
        let cuts = near.iter().any(|wanted| wanted.cuts);
        near.iter().map(|wanted| wanted.shift).reduce(f64::max).filter(|_| cuts)
    }

    /// Where the chords lie above what is wanted by more than the tolerance: as stretches of the work.
    fn jumps(&self, knots: &[Knot], tolerance: f64, stroke: &Stroke<'_>) -> Vec<Jump> {
        let mut chord = 0;
        let mut found: Vec<[f64; 2]> = Vec::new();
        let knots_on = knots.iter().map(|knot| knot[0]);
        let mut places: Vec<f64> = self.points.iter().map(|wanted| wanted.at).chain(knots_on).collect();
        places.sort_by(f64::total_cmp);
        let mut i = 1;
        for at in places {
            while i + 1 < self.points.len() && self.points[i].at < at {
                i += 1;
            }
            while chord + 2 < knots.len() && knots[chord + 1][0] < at {
                chord += 1;
            }
            let (Some(pair), Some(ends)) = (self.points.get(i - 1..=i), knots.get(chord..chord + 2)) else { break };
            let wanted = between(pair[0], pair[1], at);
            let length = ends[1][0] - ends[0][0];
            let laid = ends[0][1] + (at - ends[0][0]) / length.max(SAME_MM) * (ends[1][1] - ends[0][1]);
            if !wanted.cuts || laid <= wanted.shift + 1.01 * tolerance {
                continue;
            }
            match found.last_mut() {
                Some(last) if at - last[1] <= 0.5 => last[1] = at,
                _ => found.push([at, at]),
            }
        }
        let of_work = |[from, to]: [f64; 2]| {
            let ends = [from, to].map(|at| stroke.way.at(at / self.length_mm)[0] + stroke.shape.centre[0]);
            let beside = stroke.shape.nose + BESIDE_MM;
            Jump { line: stroke.one.line, from_mm: ends[0].min(ends[1]) - beside, to_mm: ends[0].max(ends[1]) + beside }
        };
        found.into_iter().map(of_work).collect()
    }
}
