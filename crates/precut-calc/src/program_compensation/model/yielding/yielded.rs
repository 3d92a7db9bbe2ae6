//! What a drive over a blank that yields leaves, and what it finds on the way.

use std::collections::BTreeSet;

use crate::force::ForceModel;

use super::super::super::job::ProgramStock;
use super::super::stock::{Chain, Part, Shape, Stroke, Way, blank};
use super::along::SoFar;
use super::cut::{AXIS_MM, CutPlace, Pace};

/// A rapid move that stays farther off is told nothing of, mm.
const NEAR_MM: f64 = 1.0;
/// A rapid move that comes nearer to what is left there is told of, mm; where a cut has just ended the tool has to come off first,
/// mm of its way.
pub(crate) const CLOSE_MM: f64 = 0.1;
const COMES_OFF_MM: f64 = 1.0;
/// A cut that is meant is deeper, and a move through the air that is told longer, mm.
pub(super) const MEANT_MM: f64 = 1e-3;
const AIR_MM: f64 = 20.0;
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
    pub(super) start: Option<Box<Start>>,
}

/// Where a drive stands between two moves.
#[derive(Debug, Clone)]
pub(super) struct State {
    /// The work as the section of the beam has it: as moves leave it that do not yield.
    pub(super) meant: Chain,
    pub(super) real: Chain,
    pub(super) so_far: SoFar,
    /// The last move that was still cutting when it ended.
    pub(super) last_cut: Option<usize>,
    pub(super) was_feed: bool,
}

/// Where a drive stood before its first line of the contour.
#[derive(Debug, Clone)]
pub(super) struct Start {
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

impl PlaceOfMove {
    /// How far off what is left the tool stands at the end of a move, and where it cuts nothing.
    pub(super) fn find_clear(&mut self, shape: &Shape, real: &mut Chain) {
        let place = &mut self.place;
        if place.depth_mm <= 0.0 || place.share <= 0.0 || place.share >= 1.0 {
            let at = [place.z_mm, place.radius_mm];
            place.clear_mm = -real.depth_of(shape, &Way::Line(at, at));
        }
    }
}

impl State {
    pub(super) fn of(stock: &ProgramStock) -> Self {
        Self { meant: blank(stock), real: blank(stock), so_far: SoFar::default(), last_cut: None, was_feed: false }
    }
}

impl Yielded {
    /// Shares of a move at which it was looked at; none where it was not.
    pub(super) fn shares(&self, mv: usize) -> Vec<f64> {
        let first = self.places.partition_point(|of| of.mv < mv);
        self.places[first..].iter().take_while(|of| of.mv == mv).map(|of| of.place.share).collect()
    }

    /// The moves before its first line of the contour, as far as they are kept.
    pub(crate) fn moves_before_contour(&self) -> usize {
        self.start.as_ref().map_or(0, |start| start.index)
    }

    pub(super) fn start_at(&self, index: usize, state: State) -> Start {
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
    pub(super) fn up_to(&self, start: &Start) -> (Self, State, usize) {
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

    /// Keeps a rapid move that comes near to the work.
    pub(super) fn find_rapid(&mut self, stroke: &Stroke<'_>, real: &mut Chain, comes_off: bool) {
        self.find_close(stroke, real, comes_off);
        let gap_mm = -real.depth_of(&stroke.shape, &stroke.way);
        if gap_mm < NEAR_MM {
            self.rapids.push(Clearance { line: stroke.one.line, mv: stroke.index, gap_mm });
        }
    }

    /// Keeps what a move asks of the force law.
    pub(super) fn find_cut(&mut self, stroke: &Stroke<'_>, pace: Pace, places: &[CutPlace], force: &ForceModel) {
        self.cuts.extend(asked(&stroke.way, pace, places));
        let is_turned = places.iter().any(|place| place.depth_mm > 0.0) && climbs(&stroke.way);
        if is_turned && !matches!(force, ForceModel::Kienzle(_)) {
            self.turned_lines.insert(stroke.one.line);
        }
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

    /// Keeps a move at the feed that cuts nothing, by whether it would, did nothing yield.
    pub(super) fn find_nothing(&mut self, stroke: &Stroke<'_>, means_to_cut: bool) {
        let (line, length_mm) = (stroke.one.line, stroke.way.length_mm());
        if means_to_cut {
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

/// Whether a way leaves the direction of the axis by much.
fn climbs(way: &Way) -> bool {
    let steep = |share: f64| way.direction(share).is_some_and(|[x, r]| r.atan2(x.abs()).abs() > TURNED_RAD);
    [0.0, 0.5, 1.0].into_iter().any(steep)
}
