//! The outline of the work: radii end to end, with steps between them (`program/3`).
//!
//! The parts lie in runs of some tens, each with the largest radius in it. A tool that passes over a run without coming to it is
//! held against that radius alone: the edge of a tool reaches over all that is turned already, and a program of ten thousand
//! lines leaves as many parts.

use std::sync::{Arc, OnceLock};

use super::curve::{Curve, Piece, SAME_MM};

/// Most parts of a run.
const MOST: usize = 24;
/// Neighbouring runs that have no more parts than this together become one.
const FEW: usize = 8;

/// A curve is followed so far above all work, mm.
const BESIDE_MM: f64 = 0.01;

/// What a tool comes to within this is its own, mm.
pub(crate) const CONTACT_MM: f64 = 1e-3;

/// A part of the outline, and the line of the program that made it; none of the blank.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Part {
    pub(crate) piece: Piece,
    pub(crate) owner: Option<usize>,
    /// Who made the step at its left end.
    pub(crate) step_owner: Option<usize>,
}

/// Neighbouring parts.
#[derive(Debug, Clone, PartialEq)]
struct Run {
    /// At least one.
    parts: Vec<Part>,
    /// No radius in it is larger, mm.
    highest_mm: f64,
    /// What was summed over it, once it was asked for.
    sums: OnceLock<Sums>,
}

/// Sums over a stretch.
pub(crate) type Sums = [f64; 3];

impl Run {
    fn of(parts: Vec<Part>) -> Self {
        let highest_mm = parts.iter().map(|part| part.piece.highest()).fold(0.0, f64::max);
        Self { parts, highest_mm, sums: OnceLock::new() }
    }

    fn x0(&self) -> f64 {
        self.parts.first().map_or(f64::INFINITY, |part| part.piece.x0)
    }

    fn x1(&self) -> f64 {
        self.parts.last().map_or(f64::NEG_INFINITY, |part| part.piece.x1)
    }

    /// By how much the run rises above a curve at the most, mm: a bound, not more.
    fn above_at_most(&self, piece: &Piece) -> f64 {
        self.highest_mm - piece.lowest(self.x0().max(piece.x0), self.x1().min(piece.x1)).max(0.0)
    }
}

/// The outline.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Chain {
    /// Shared with the chains that it was before, as far as they are the same.
    runs: Vec<Arc<Run>>,
    /// No radius is larger, once that was asked for, mm.
    highest_mm: OnceLock<f64>,
    /// Parts that a curve was held against so far.
    looked_at: usize,
}

impl Chain {
    /// Of a blank: rows of place and radius, places never falling.
    pub(crate) fn of(rows: &[[f64; 2]]) -> Self {
        let parts = rows.windows(2).filter(|pair| pair[1][0] > pair[0][0]).map(|pair| Part {
            piece: Piece { x0: pair[0][0], x1: pair[1][0], curve: Curve::through(pair[0], pair[1]) },
            owner: None,
            step_owner: None,
        });
        let parts: Vec<Part> = parts.collect();
        let runs = parts.chunks(MOST).map(|run| Arc::new(Run::of(run.to_vec()))).collect();
        Self { runs, highest_mm: OnceLock::new(), looked_at: 0 }
    }

    /// The parts from left to right.
    pub(crate) fn parts(&self) -> Vec<Part> {
        let mut joined = Vec::with_capacity(self.runs.iter().map(|run| run.parts.len()).sum());
        self.runs.iter().flat_map(|run| &run.parts).for_each(|part| join(&mut joined, part));
        joined
    }

    /// The parts that lie between two places, wholly or not.
    pub(crate) fn parts_between(&self, from: f64, to: f64) -> impl Iterator<Item = &Part> {
        let runs = &self.runs[self.run_behind(from)..];
        let first = runs.first().map_or(0, |run| run.parts.partition_point(|part| part.piece.x1 <= from));
        let parts = runs.iter().flat_map(|run| &run.parts).skip(first);
        parts.take_while(move |part| part.piece.x0 < to).filter(move |part| part.piece.x1 > from)
    }

    /// No radius is larger, mm.
    pub(crate) fn highest(&self) -> f64 {
        *self.highest_mm.get_or_init(|| self.runs.iter().map(|run| run.highest_mm).fold(0.0, f64::max))
    }

    /// Both ends, mm.
    pub(crate) fn ends(&self) -> [f64; 2] {
        [self.runs.first().map_or(0.0, |run| run.x0()), self.runs.last().map_or(0.0, |run| run.x1())]
    }

    /// How many runs it shares with another one at its begin and at its end.
    fn shared_with(&self, other: &Self) -> [usize; 2] {
        let (own, its) = (&self.runs, &other.runs);
        let count = own.len().min(its.len());
        let head = (0..count).take_while(|&i| Arc::ptr_eq(&own[i], &its[i])).count();
        let is_shared = |i: &usize| Arc::ptr_eq(&own[own.len() - 1 - i], &its[its.len() - 1 - i]);
        [head, (0..count - head).take_while(is_shared).count()]
    }

    /// Where it is no longer what another one is, from the first such place to the last, mm; none where both are one. What they share
    /// is not looked at.
    pub(crate) fn differs_from(&self, other: &Self) -> Option<[f64; 2]> {
        let [head, tail] = self.shared_with(other);
        let (own, its) = (&self.runs, &other.runs);
        let left = |runs: &[Arc<Run>]| -> Vec<Piece> {
            runs[head..runs.len() - tail].iter().flat_map(|run| &run.parts).map(|part| part.piece).collect()
        };
        let (own, its) = (left(own), left(its));
        let count = own.len().min(its.len());
        let head = (0..count).take_while(|&i| own[i] == its[i]).count();
        let tail = (0..count - head).take_while(|&i| own[own.len() - 1 - i] == its[its.len() - 1 - i]).count();
        let (own, its) = (&own[head..own.len() - tail], &its[head..its.len() - tail]);
        let all = || own.iter().chain(its);
        let first = all().map(|piece| piece.x0).reduce(f64::min)?;
        Some([first, all().map(|piece| piece.x1).fold(first, f64::max)])
    }

    /// Sums over a stretch of what a function sums over parts of pieces; those over whole runs are kept, so that every chain that
    /// shares them has to be asked with the same function.
    pub(crate) fn sums(&self, [from, to]: [f64; 2], of: impl Fn(Piece) -> Sums) -> Sums {
        let mut all = [0.0; 3];
        let mut add = |sums: Sums| (0..3).for_each(|k| all[k] += sums[k]);
        for run in &self.runs[self.run_behind(from)..] {
            if run.x0() >= to {
                break;
            }
            if from <= run.x0() && run.x1() <= to {
                add(*run.sums.get_or_init(|| {
                    let mut all = [0.0; 3];
                    run.parts.iter().for_each(|part| {
                        let sums = of(part.piece);
                        (0..3).for_each(|k| all[k] += sums[k]);
                    });
                    all
                }));
                continue;
            }
            for part in &run.parts {
                let (x0, x1) = (part.piece.x0.max(from), part.piece.x1.min(to));
                if x1 > x0 {
                    add(of(Piece { x0, x1, curve: part.piece.curve }));
                }
            }
        }
        all
    }

    /// Parts that a curve was held against since this was asked last, runs that were passed over as well.
    pub(crate) fn take_looked_at(&mut self) -> usize {
        std::mem::take(&mut self.looked_at)
    }

    /// The first run that goes on behind a place.
    fn run_behind(&self, x: f64) -> usize {
        self.runs.partition_point(|run| run.x1() <= x)
    }

    /// How deep a curve lies in the work at the most, mm; below 0 it stays clear by so much.
    pub(crate) fn depth(&mut self, piece: &Piece) -> f64 {
        self.depth_up_to(piece, f64::INFINITY)
    }

    /// The same, and once that is more than enough, something between both.
    pub(super) fn depth_up_to(&mut self, piece: &Piece, enough_mm: f64) -> f64 {
        let first = self.run_behind(piece.x0 + SAME_MM);
        let count = self.runs[first..].partition_point(|run| run.x0() < piece.x1 - SAME_MM);
        let highest_mm = self.highest();
        let mut deepest = f64::NEG_INFINITY;
        // An edge only rises away from its tip: where it is far above all work, nothing behind is looked at.
        let falls = matches!(piece.curve, Curve::Line { slope, .. } if slope < 0.0);
        for i in 0..count {
            let run = &self.runs[first + if falls { count - 1 - i } else { i }];
            self.looked_at += 1;
            let nearest = if falls { run.x1().min(piece.x1) } else { run.x0().max(piece.x0) };
            if matches!(piece.curve, Curve::Line { .. }) && highest_mm - piece.curve.at(nearest) <= deepest {
                break;
            }
            if run.above_at_most(piece) <= deepest {
                continue;
            }
            for part in &run.parts[overlapping(&run.parts, piece)] {
                self.looked_at += 1;
                let (a, b) = (part.piece.x0.max(piece.x0), part.piece.x1.min(piece.x1));
                if part.piece.highest() - piece.lowest(a, b).max(0.0) <= deepest {
                    continue;
                }
                for share in [0.0, 0.25, 0.5, 0.75, 1.0] {
                    let at = a + share * (b - a);
                    deepest = deepest.max(part.piece.curve.at(at) - piece.curve.at(at).max(0.0));
                }
                if deepest > enough_mm {
                    return deepest;
                }
            }
        }
        deepest
    }

    /// Takes away what stands above curves.
    pub(crate) fn cut(&mut self, pieces: &[Piece], owner: usize) {
        let highest_mm = self.highest() + BESIDE_MM;
        let reaching: Vec<Piece> = pieces.iter().map(|piece| piece.below(highest_mm)).collect();
        // A run is written anew once for all of them, and stays short enough for that.
        for some in reaching.chunks(MOST) {
            self.cut_some(some, owner);
        }
    }

    fn cut_some(&mut self, pieces: &[Piece], owner: usize) {
        let (from, to) = pieces
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(from, to), piece| (from.min(piece.x0), to.max(piece.x1)));
        let mut at = self.run_behind(from + SAME_MM);
        let mut made: Vec<Part> = Vec::new();
        while let Some(run) = self.runs.get(at).filter(|run| run.x0() < to - SAME_MM).cloned() {
            let mut parts: Option<Vec<Part>> = None;
            for piece in pieces.iter().filter(|piece| run.x1() > piece.x0 + SAME_MM && run.x0() < piece.x1 - SAME_MM) {
                self.looked_at += 1;
                if run.above_at_most(piece) <= -CONTACT_MM {
                    continue;
                }
                let own = parts.as_deref().unwrap_or(&run.parts);
                let range = overlapping(own, piece);
                self.looked_at += range.len();
                made.clear();
                let mut is_changed = false;
                for part in &own[range.clone()] {
                    is_changed |= cut_part(part, piece, owner, &mut made);
                }
                if is_changed {
                    parts.get_or_insert_with(|| run.parts.clone()).splice(range, made.drain(..));
                }
            }
            at = 1 + parts.map_or(at, |parts| self.replace(at, &parts));
        }
    }

    /// Puts parts in the place of those of a run; those that are one with their neighbour become one. Gives the last run
    /// that has any of them.
    fn replace(&mut self, at: usize, parts: &[Part]) -> usize {
        // Where it was not here, it still is where it was.
        if self.highest_mm.get().is_some_and(|highest| self.runs[at].highest_mm >= *highest) {
            self.highest_mm = OnceLock::new();
        }
        let mut joined: Vec<Part> = Vec::with_capacity(parts.len());
        for part in parts {
            join(&mut joined, part);
        }
        if joined.len() > MOST {
            let count = joined.len().div_ceil(MOST);
            let runs: Vec<Arc<Run>> =
                joined.chunks(joined.len().div_ceil(count)).map(|run| Arc::new(Run::of(run.to_vec()))).collect();
            let last = at + runs.len() - 1;
            self.runs.splice(at..=at, runs);
            return last;
        }
        self.runs[at] = Arc::new(Run::of(joined));
        let is_few = |pair: &[Arc<Run>]| pair.iter().map(|run| run.parts.len()).sum::<usize>() <= FEW;
        if at > 0 && is_few(&self.runs[at - 1..=at]) {
            let own = self.runs.remove(at);
            let mut parts = self.runs[at - 1].parts.clone();
            own.parts.iter().for_each(|part| join(&mut parts, part));
            self.runs[at - 1] = Arc::new(Run::of(parts));
            return at - 1;
        }
        at
    }

    /// A wall that stands at a place from a radius on: the step there is then its owner's.
    pub(crate) fn touch_wall(&mut self, x: f64, from: f64, owner: usize) {
        let first = self.runs.partition_point(|run| run.x1() < x - CONTACT_MM);
        let mut left = first.checked_sub(1).and_then(|before| self.runs[before].parts.last()).map(|part| part.piece);
        for shared in &mut self.runs[first..] {
            if shared.x0() > x + CONTACT_MM {
                break;
            }
            let near = shared.parts.partition_point(|part| part.piece.x0 < x - CONTACT_MM);
            if !shared.parts[near..].first().is_some_and(|part| part.piece.x0 <= x + CONTACT_MM) {
                left = shared.parts.last().map(|part| part.piece);
                continue;
            }
            let run = Arc::make_mut(shared);
            if let Some(before) = near.checked_sub(1) {
                left = Some(run.parts[before].piece);
            }
            for part in run.parts[near..].iter_mut().take_while(|part| part.piece.x0 <= x + CONTACT_MM) {
                let at = part.piece.x0;
                if let Some(left) = left.replace(part.piece) {
                    let (left, right) = (left.curve.at(at), part.piece.curve.at(at));
                    if (left - right).abs() > CONTACT_MM && left.max(right) > from + CONTACT_MM {
                        part.step_owner = Some(owner);
                    }
                }
            }
            left = run.parts.last().map(|part| part.piece);
        }
    }
}

/// Which of some parts a curve lies over or under.
fn overlapping(parts: &[Part], piece: &Piece) -> std::ops::Range<usize> {
    let from = parts.partition_point(|part| part.piece.x1 <= piece.x0 + SAME_MM);
    let to = parts.partition_point(|part| part.piece.x0 < piece.x1 - SAME_MM);
    from..to.max(from)
}

/// Adds a part, to the last one where it goes on as that does.
fn join(parts: &mut Vec<Part>, part: &Part) {
    match parts.last_mut() {
        Some(last) if last.owner == part.owner && last.piece.curve == part.piece.curve && part.step_owner.is_none() => {
            last.piece.x1 = part.piece.x1;
        }
        _ => parts.push(*part),
    }
}

/// What a curve leaves of a part; whether it comes to it at all.
fn cut_part(part: &Part, piece: &Piece, owner: usize, made: &mut Vec<Part>) -> bool {
    let [x0, x1] = [part.piece.x0, part.piece.x1];
    let (a, b) = (x0.max(piece.x0), x1.min(piece.x1));
    if part.piece.highest() - piece.lowest(a, b) <= -CONTACT_MM {
        made.push(*part);
        return false;
    }
    let mut is_changed = false;
    // Both ends of both, and two crossings twice.
    let mut at = Vec::with_capacity(8);
    at.extend([x0, x1]);
    at.extend([a, b].into_iter().filter(|&end| end > x0 + SAME_MM && end < x1 - SAME_MM));
    for raised in [0.0, CONTACT_MM] {
        at.extend(piece.curve.crossings(part.piece.curve, raised, [a, b]));
    }
    at.sort_by(f64::total_cmp);
    for (i, ends) in at.windows(2).enumerate() {
        let [from, to] = [ends[0], ends[1]];
        if to - from <= SAME_MM {
            continue;
        }
        let middle = 0.5 * (from + to);
        let mut own = Part { piece: Piece { x0: from, x1: to, curve: part.piece.curve }, ..*part };
        if i > 0 {
            own.step_owner = None;
        }
        if middle > a && middle < b {
            let over = part.piece.curve.at(middle) - piece.curve.at(middle);
            if over > 0.0 {
                own.piece.curve = piece.curve;
            }
            if over > -CONTACT_MM {
                own.owner = Some(owner);
                is_changed = true;
            }
        }
        made.push(own);
    }
    is_changed
}

/// Who made the step at the left end of a part: who touched it last, else who made its lower side.
pub(crate) fn step_owner(parts: &[Part], i: usize) -> Option<usize> {
    let (left, right) = (parts.get(i.checked_sub(1)?)?, parts.get(i)?);
    let at = right.piece.x0;
    let low = if left.piece.curve.at(at) < right.piece.curve.at(at) { left } else { right };
    right.step_owner.or(low.owner)
}
