//! Cycles that can be written out as their moves, so that these can be shifted (`program/6`): single cycles and finishing along
//! a contour, whose own lines serve roughing as well and are never changed.

use std::collections::BTreeSet;

use super::super::reader::{Call, Kind, Program, ProgramMove, Speed};
use super::super::stock::{Stroke, Way};

/// An arc that turns by more is not told by its radius, rad.
const WIDEST_RAD: f64 = 150.0 * std::f64::consts::PI / 180.0;

/// The cycles that can be written out, in the order of execution.
#[derive(Debug, Clone, Default)]
pub(crate) struct Calls<'p> {
    calls: Vec<&'p Call>,
}

impl<'p> Calls<'p> {
    /// Of a program, with the ways of its moves at the feed.
    pub(crate) fn of(program: &'p Program, ways: &std::collections::BTreeMap<usize, Stroke<'_>>) -> Self {
        let mut run: BTreeSet<usize> = BTreeSet::new();
        let mut twice: BTreeSet<usize> = BTreeSet::new();
        for call in &program.calls {
            let lines: BTreeSet<usize> = program.moves[call.moves.clone()].iter().map(|one| one.line).collect();
            twice.extend(lines.iter().filter(|line| !run.insert(**line)));
        }
        let is_narrow = |index: usize| {
            ways.get(&index).is_none_or(|stroke| match stroke.way {
                Way::Arc { turn, .. } => turn.abs() <= WIDEST_RAD,
                Way::Line(..) => true,
            })
        };
        let can_be = |call: &&Call| {
            let moves = &program.moves[call.moves.clone()];
            let once = moves.iter().all(|one| !twice.contains(&one.line));
            let all = moves.iter().all(|one| {
                matches!(one.kind, Kind::Rapid | Kind::Line | Kind::ArcCw | Kind::ArcCcw) && one.end.known().is_some()
            });
            let is_fed = moves.iter().all(|one| !one.kind.is_feed() || one.feed.is_some());
            call.is_plain
                && once
                && all
                && is_fed
                && keeps_mode(moves, call.speed_before)
                && call.moves.clone().all(is_narrow)
                && names_what_follows(program, call.moves.end)
        };
        Self { calls: program.calls.iter().filter(can_be).collect() }
    }

    /// The cycle that a move belongs to.
    pub(crate) fn of_move(&self, index: usize) -> Option<&'p Call> {
        let behind = self.calls.partition_point(|call| call.moves.start <= index);
        let call = *self.calls.get(behind.checked_sub(1)?)?;
        call.moves.contains(&index).then_some(call)
    }
}

/// Whether the speed changes by its number alone.
fn keeps_mode(moves: &[ProgramMove], before: Option<Speed>) -> bool {
    let mut speeds = before.into_iter().chain(moves.iter().filter_map(|one| one.speed));
    let Some(first) = speeds.next() else { return true };
    speeds.all(|speed| match (first, speed) {
        (Speed::Spindle(_), Speed::Spindle(_)) => true,
        (Speed::Surface(_, a), Speed::Surface(_, b)) => a == b,
        _ => false,
    })
}

/// Whether what comes next says itself how it moves: written out, a cycle leaves another motion behind.
fn names_what_follows(program: &Program, index: usize) -> bool {
    let Some(at) = (index..program.moves.len()).find(|&at| program.moves[at].kind != Kind::Dwell) else { return true };
    let one = &program.moves[at];
    let behind = program.calls.partition_point(|call| call.moves.start <= at);
    if let Some(call) = behind.checked_sub(1).and_then(|i| program.calls.get(i)).filter(|call| call.moves.contains(&at))
    {
        return call.names_motion;
    }
    let words = program.words_of_lines.get(&one.line).and_then(Option::as_ref).filter(|words| words.mv == at);
    one.kind == Kind::Home || words.is_some_and(|words| words.names_motion)
}
