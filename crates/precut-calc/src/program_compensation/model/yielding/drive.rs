//! A program driven over a blank that yields: every move on what the moves before have really left.

use std::collections::{BTreeMap, BTreeSet};

use crate::calculator::{self, Failure, Finding, Monitor};
use crate::deflection_compensation::{Held, Holding};

use super::super::super::job::{Job, ProgramStock};
use super::super::reader::{Kind, Program, ProgramMove};
use super::super::stock::{Chain, Part, Shape, Stroke, Way, blank, strokes};
use super::aim::Aim;
use super::along::{Along, after};
use super::cut::{CutPlace, Cutting, Pace};
use super::near::{About, Near};
use super::together::Together;
use super::yielded::{PlaceOfMove, State, Yielded};

/// Why a program is not driven over a blank that yields.
pub(crate) const FAILURE_CODES: &[&str] = &["speed_missing", "supports_do_not_hold", "formula_without_value"];

/// How far between two places of a move the path may come off a straight line, mm: of one that finishes, of any other.
const STRAIGHT_MM: [f64; 2] = [3e-5, 3e-4];
/// A chip thinner than this is none, mm.
const CHIP_MM: f64 = 1e-7;
/// So many moves before the first one that makes the contour may change with it.
const MOVES_BEFORE: usize = 3;
/// Multiplications for a place of a move.
const WORK_OF_PLACE: usize = 20_000;
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
    let drive = Drive { job, holding, bore_mm: stock.bore_diameter_mm, driven, aim: aim.as_ref() };
    let strokes = strokes(program, job, zero).filter(|stroke| stroke.index >= from);
    let mut strokes = strokes.map(|stroke| drive.set_out(stroke)).peekable();
    while let Some(first) = strokes.next() {
        if kept_at.take_if(|at| first.index >= *at).is_some() {
            yielded.start = Some(Box::new(yielded.start_at(first.index, state.clone())));
        }
        // What goes on from the start does so at the same moves.
        let together = Together::of(first, &mut strokes, kept_at.unwrap_or(usize::MAX), (program, job));
        drive.go(together, &mut state, &mut yielded, &mut pace)?;
    }
    yielded.real = state.real.parts();
    yielded.nominal = aim.map_or_else(|| state.meant.parts(), Aim::into_meant);
    Ok(yielded)
}

/// What all moves of a drive have in common.
struct Drive<'a> {
    job: &'a Job,
    holding: &'a Holding,
    bore_mm: f64,
    driven: Driven<'a>,
    aim: Option<&'a Aim>,
}

impl Drive<'_> {
    fn set_out<'p>(&self, stroke: Stroke<'p>) -> Stroke<'p> {
        let by_mm = if stroke.one.kind.is_feed() { self.driven.set_out_mm(stroke.one.line) } else { 0.0 };
        Stroke { way: stroke.way.set_out(by_mm), ..stroke }
    }

    /// Drives moves that bend as one.
    fn go(
        &self,
        mut together: Together<'_>,
        state: &mut State,
        yielded: &mut Yielded,
        pace: &mut calculator::Pace<'_>,
    ) -> Result<(), Failure> {
        let is_feed = together.strokes.first().is_some_and(|first| first.one.kind.is_feed());
        if is_feed {
            together.cut(&mut state.meant, self.driven.bends_as);
        }
        for at in 0..together.strokes.len() {
            let stroke = together.strokes[at];
            let comes_off = std::mem::replace(&mut state.was_feed, is_feed);
            if stroke.one.kind == Kind::Rapid {
                yielded.find_rapid(&stroke, &mut state.real, comes_off);
            }
            if !is_feed {
                continue;
            }
            if !state.real.reaches(&stroke.shape, &stroke.way, CHIP_MM) {
                yielded.find_nothing(&stroke, together.means_to_cut(at));
                continue;
            }
            if !self.holding.is_held_by(&together.acts) {
                return Err(refused("supports_do_not_hold", stroke.one.line));
            }
            let move_pace = self.pace(&stroke)?;
            together.hold(self.holding, &state.meant, self.bore_mm)?;
            let Some(held) = together.held(at) else { continue };
            let places = self.places(&stroke, held, state)?;
            pace.work(places.len() * WORK_OF_PLACE)?;
            self.take(&stroke, &places, &mut state.real);
            state.so_far = after(state.so_far, &stroke.way, move_pace);
            let is_last = places.last().is_some_and(|place| place.depth_mm > 0.0);
            state.last_cut = is_last.then_some(stroke.index);
            yielded.find_cut(&stroke, move_pace, &places, &self.holding.force);
            let (line, mv) = (stroke.one.line, stroke.index);
            let first = yielded.places.len();
            yielded.places.extend(places.into_iter().map(|place| PlaceOfMove { line, mv, place }));
            if !self.driven.corrected.is_empty() {
                let laid = yielded.places[first..].iter_mut();
                laid.for_each(|of| of.find_clear(&stroke.shape, &mut state.real));
            }
        }
        Ok(())
    }

    /// Feed and speed of a move, as far as they are needed.
    fn pace(&self, stroke: &Stroke<'_>) -> Result<Pace, Failure> {
        let pace = Pace { feed: stroke.one.feed, speed: stroke.one.speed };
        let asks_for_speed = self.holding.force.depends_on_speed() || pace.feed_mm_per_rev(1.0).is_none();
        if pace.speed.is_none() && asks_for_speed {
            return Err(refused("speed_missing", stroke.one.line));
        }
        Ok(pace)
    }

    /// What happens along a move, on the work that is there.
    fn places(
        &self,
        stroke: &Stroke<'_>,
        (held, nominal): (&Held, Near<'_>),
        state: &State,
    ) -> Result<Vec<CutPlace>, Failure> {
        let way = &stroke.way;
        let about = About::of(&state.real, &stroke.shape, way);
        let cutting = Cutting {
            stroke,
            held,
            force: &self.holding.force,
            with_main: self.holding.tangential,
            with_loads: self.job.mode.kind.refeeds(),
            nominal,
            real: Near { chain: &state.real, about: &about },
            goes_on: state.last_cut == stroke.index.checked_sub(1),
            is_corrected: self.is_corrected(stroke),
            aim: self.aim,
        };
        let straight_mm = STRAIGHT_MM[usize::from(self.driven.finishing.binary_search(&stroke.one.line).is_err())];
        let from = cutting.meets_from();
        let shares = self.driven.places_of.map_or_else(Vec::new, |before| before.shares(stroke.index));
        let move_pace = Pace { feed: stroke.one.feed, speed: stroke.one.speed };
        Along { cutting, way, from, so_far: state.so_far, move_pace, straight_mm, shares }.places()
    }

    fn is_corrected(&self, stroke: &Stroke<'_>) -> bool {
        self.driven.corrected.contains(&stroke.index)
    }

    /// Takes away what a move really cuts.
    fn take(&self, stroke: &Stroke<'_>, places: &[CutPlace], real: &mut Chain) {
        let Stroke { one, shape, way, .. } = stroke;
        let is_corrected = self.is_corrected(stroke);
        if is_corrected && self.aim.is_none() {
            return real.cut_along(shape, way, one.line);
        }
        let off = |place: &CutPlace| if is_corrected { place.wanted_mm } else { place.lift_mm };
        let lifted: Vec<Way> = places
            .windows(2)
            .map(|pair| way.lifted([pair[0].share, pair[1].share], [off(&pair[0]), off(&pair[1])]))
            .collect();
        real.cut_along_all(shape, &lifted, one.line);
    }
}

/// What a program leaves on rigid work.
fn rigid(program: &Program, job: &Job, (stock, zero): (&ProgramStock, f64)) -> Vec<Part> {
    let mut chain = blank(stock);
    for stroke in strokes(program, job, zero).filter(|stroke| stroke.one.kind.is_feed()) {
        chain.cut_along(&stroke.shape, &stroke.way, stroke.one.line);
    }
    chain.parts()
}

/// The first move of a line that makes the contour, less a few: how the moves before it end may change with it.
fn begins_at(program: &Program, finishing: &[usize]) -> usize {
    let is_first = |one: &ProgramMove| finishing.binary_search(&one.line).is_ok();
    program.moves.iter().position(is_first).unwrap_or(0).saturating_sub(MOVES_BEFORE)
}

fn refused(code: &'static str, line: usize) -> Failure {
    Failure::OutOfModel(Finding::new(code, "/nc_program").with("line", line))
}
