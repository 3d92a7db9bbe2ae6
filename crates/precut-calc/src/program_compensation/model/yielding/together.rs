//! Short moves that go on along the axis bend as one (`program/4.6`).
//!
//! A CAM system cuts a contour by blocks of a tenth of a millimetre. What the work is ahead of such a block before it and behind it
//! after it, it is before the first and after the last of a few, but for what nose and edges leave standing beside the tip on the
//! way; a long move has that of its end alone, too.

use std::iter::Peekable;

use crate::calculator::Failure;
use crate::deflection_compensation::{FeedDirection, Held, Holding, Support, Theory};

use super::super::super::job::Job;
use super::super::reader::Program;
use super::super::stock::{Chain, Stroke, Way};
use super::drive::Instead;
use super::near::{About, Near};
use super::sections::{Lumps, slices};
use super::yielded::MEANT_MM;

/// Moves that bend as one reach no farther along the axis than this, mm, and are no more.
const FARTHEST_MM: f64 = 2.0;
const MOST_MOVES: usize = 64;
/// The work is as its outline has it so far beside the tool, mm.
const BESIDE_MM: f64 = 1.0;

/// What a rigid move comes to.
struct Meant {
    about: About,
    /// Whether it cuts.
    cuts: bool,
}

/// Moves that bend as one.
pub(super) struct Together<'p> {
    pub(super) strokes: Vec<Stroke<'p>>,
    /// Which of the supports act.
    pub(super) acts: Vec<bool>,
    /// The work on rigid moves before the first of them.
    before: Option<Chain>,
    meant: Vec<Meant>,
    /// Once one of them cuts.
    held: Option<Held>,
}

impl<'p> Together<'p> {
    /// A move and what goes on with it, of the program's moves below a number.
    pub(super) fn of(
        first: Stroke<'p>,
        rest: &mut Peekable<impl Iterator<Item = Stroke<'p>>>,
        below: usize,
        (program, job): (&Program, &Job),
    ) -> Self {
        let acts = |stroke: &Stroke<'_>| acts(job, program.executed_at(stroke.index));
        let of_first = acts(&first);
        let mut strokes = vec![first];
        let [from, _] = first.way.ends();
        while let Some(last) = strokes.last().copied().filter(|_| strokes.len() < MOST_MOVES) {
            let goes_on = |next: &Stroke<'_>| {
                next.index == last.index + 1
                    && next.index < below
                    && std::ptr::eq(next.tool, first.tool)
                    && is_one_way(&last.way, &next.way)
                    && (next.way.ends()[1][0] - from[0]).abs() <= FARTHEST_MM
                    && last.one.kind.is_feed()
                    && next.one.kind.is_feed()
                    && (job.support_lines.is_empty() || acts(next) == of_first)
            };
            match rest.next_if(goes_on) {
                Some(next) => strokes.push(next),
                None => break,
            }
        }
        Self { strokes, acts: of_first, before: None, meant: Vec::new(), held: None }
    }

    /// Takes the rigid moves away from the work.
    pub(super) fn cut(&mut self, meant: &mut Chain, bends_as: Option<&Instead>) {
        self.before = Some(meant.clone());
        for Stroke { index, one, shape, way, .. } in &self.strokes {
            let cuts = meant.reaches(shape, way, MEANT_MM);
            self.meant.push(Meant { about: About::of(meant, shape, way), cuts });
            match bends_as.and_then(|ways| ways.get(index)) {
                Some(ways) => ways.iter().for_each(|(shape, way)| meant.cut_along(shape, way, one.line)),
                None => meant.cut_along(shape, way, one.line),
            }
        }
    }

    /// Whether one of them would cut, did nothing yield.
    pub(super) fn means_to_cut(&self, at: usize) -> bool {
        self.meant.get(at).is_some_and(|meant| meant.cuts)
    }

    /// The work as it is held while they cut, with what is left of it after them on rigid moves.
    pub(super) fn hold(&mut self, holding: &Holding, meant: &Chain, bore_mm: f64) -> Result<(), Failure> {
        if let (None, Some(before), Some(first)) = (&self.held, &self.before, self.strokes.first()) {
            let last = self.strokes.last().unwrap_or(first);
            let lumps = lumps(holding, [before, meant], [&first.way, &last.way]);
            let slices = slices(before, meant, bore_mm, lumps.as_ref());
            self.held = Some(holding.hold(&slices, &self.acts, direction(&first.way))?);
        }
        Ok(())
    }

    /// The same, with the work on rigid moves before one of them; none before that was asked for.
    pub(super) fn held(&self, at: usize) -> Option<(&Held, Near<'_>)> {
        let near =
            self.before.as_ref().zip(self.meant.get(at)).map(|(chain, Meant { about, .. })| Near { chain, about });
        self.held.as_ref().zip(near)
    }
}

/// Whether both go straight along the axis, the same way.
fn is_one_way(a: &Way, b: &Way) -> bool {
    along(a) * along(b) > 0.0
}

/// How far a straight way goes along the axis, mm; 0 of others.
fn along(way: &Way) -> f64 {
    match *way {
        Way::Line(from, to) => to[0] - from[0],
        Way::Arc { .. } => 0.0,
    }
}

/// Where the work bends as a few slices do: everywhere but about the tool, unless its weight counts, or
/// shear, or a rest goes with the tool.
fn lumps(holding: &Holding, [before, after]: [&Chain; 2], ways: [&Way; 2]) -> Option<Lumps> {
    let supports_mm: Option<Vec<f64>> = holding.supports.iter().map(Support::station_mm).collect();
    let supports_mm = supports_mm?;
    if holding.weight || holding.shaft.theory == Some(Theory::Timoshenko) {
        return None;
    }
    let [from, to] = [ways[0].ends()[0][0], ways[1].ends()[1][0]];
    let turned = before.differs_from(after).unwrap_or([from, from]);
    // An arc may reach farther than its ends.
    let radius = |way: &Way| if let Way::Arc { radius, .. } = way { *radius } else { 0.0 };
    let beyond = radius(ways[0]).max(radius(ways[1]));
    let low = from.min(to).min(turned[0]) - beyond - BESIDE_MM;
    let high = from.max(to).max(turned[1]) + beyond + BESIDE_MM;
    Some(Lumps { near_mm: [low, high], supports_mm })
}

/// Which of the supports act in a line.
fn acts(job: &Job, line: usize) -> Vec<bool> {
    (0_u32..).zip(&job.supports).map(|(support, _)| job.acts(support, line)).collect()
}

fn direction(way: &Way) -> FeedDirection {
    let [from, to] = way.ends();
    if to[0] > from[0] { FeedDirection::ToTailstock } else { FeedDirection::ToHeadstock }
}
