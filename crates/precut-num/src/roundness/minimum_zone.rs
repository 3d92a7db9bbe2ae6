//! The minimum-zone reference circles, MZCI.

use super::contact::{
    cross, equidistant, half_gap_cosine, hold_of_ties, hold_of_zone, order_from_gap, reach_mm, resolution_mm, sector,
    unit,
};
use super::section::{Span, square};
use super::{RoundnessError, Section, look};

/// Two concentric circles, nearest to each other, that hold all points between them, with their proof.
///
/// The two outer and the two inner contacts alternate round the circle, so no small shift of the centre narrows the
/// zone; [`Self::certified_within_mm`] says how far that proof reaches, [`Self::is_unique`] whether it reaches every
/// centre that could be as good, [`Self::is_global`] whether no other zone is narrower.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MinimumZone {
    /// Common centre in the coordinates of the section, mm.
    pub centre_mm: [f64; 2],
    /// Inner radius, mm.
    pub inner_radius_mm: f64,
    /// Outer radius, mm.
    pub outer_radius_mm: f64,
    /// Indices of the two points on the outer circle.
    pub outer_contacts: [usize; 2],
    /// Indices of the two points on the inner circle, between the outer ones in angle.
    pub inner_contacts: [usize; 2],
    /// Zone of the four contacts alone, mm: no centre within [`Self::certified_within_mm`] has a narrower zone.
    pub lower_bound_mm: f64,
    /// By how much, at least, the zone widens per mm of shift of the centre (first order); 0 where it is flat.
    pub stiffness: f64,
    /// Radius of the disc about the centre in which no narrower zone exists, mm (`roundness/4.4`).
    pub certified_within_mm: f64,
    /// Whether no zone about any centre is narrower: that disc holds all that could be, or all quadruples that matter
    /// were tried. False on arcs, where the proof is that of the disc alone.
    pub is_global: bool,
    /// Whether no other zone is as narrow.
    pub is_unique: bool,
    /// Bound of the round-off in the zone's width, mm, the gap to the lower bound included.
    pub width_error_mm: f64,
    /// Bound of the round-off in the centre, mm; `None` where the zone is flat and the centre not determined.
    pub centre_error_mm: Option<f64>,
    /// How many points touch the outer and the inner circle, round-off aside.
    pub touching: [usize; 2],
    /// Passes over all points, the certifying one included.
    pub scans: u32,
}

impl MinimumZone {
    /// RONt, the width of the zone, mm.
    pub fn width_mm(&self) -> f64 {
        self.outer_radius_mm - self.inner_radius_mm
    }
}

/// Exchanges after which the search goes on with the points met so far. Profiles take 2 to 10.
const MOST_EXCHANGES: u32 = 50;
/// Points among which every quadruple is tried, at most.
const LARGEST_CORE: usize = 40;
/// Points with which that trial begins.
const FIRST_CORE: usize = 8;

/// The minimum-zone circles (`roundness/4.1`), at least three points, through which there is one circle; `start_mm` is the least-squares centre.
///
/// Remez exchange with exact Euclidean contacts: the centre of four alternating contacts is the crossing of two
/// perpendicular bisectors; the farthest and the nearest point of all replace the contact of their own kind between the
/// same neighbours, until no point is outside the zone of the four. Where that does not end (deviations of the
/// order of the radius), the best quadruple of the points met, with further points until no point is outside.
pub fn minimum_zone(
    section: &Section,
    start_mm: [f64; 2],
    goes_on: &dyn Fn() -> bool,
) -> Result<MinimumZone, RoundnessError> {
    if section.len() < 3 {
        return Err(RoundnessError::TooFewPoints { count: section.len(), needed: 3 });
    }
    let start = section.inside(start_mm);
    if section.len() == 3 {
        return through_three(section, start);
    }
    let exchanged = match opposite_extremes(section, start).or_else(|| spread_reference(section, start)) {
        Some(reference) => exchange(section, start, reference, goes_on)?,
        None => None,
    };
    let found = match exchanged {
        Some(holding) => Some(holding),
        None => cut_planes(section, start, goes_on)?,
    };
    match found {
        Some(holding) => proven(section, holding, goes_on),
        None => Ok(about(section, start)),
    }
}

/// Three points lie on a circle.
fn through_three(section: &Section, start: [f64; 2]) -> Result<MinimumZone, RoundnessError> {
    let reference = Reference { outer: [0, 1], inner: [2, 0] };
    let centre = equidistant(section, start, [0, 1], [1, 2]).ok_or(RoundnessError::NoCircle)?;
    let span = section.span_inside(centre);
    let zone = Zone { reference, centre, outer_mm: span.farthest_mm, inner_mm: span.nearest_mm };
    Ok(Holding { zone, span, scans: 1 }.answer(section, true, true))
}

/// The zone about a centre, unproven: a narrower one was not found.
fn about(section: &Section, centre: [f64; 2]) -> MinimumZone {
    let span = section.span_inside(centre);
    let reference = Reference { outer: [span.farthest; 2], inner: [span.nearest; 2] };
    let zone = Zone { reference, centre, outer_mm: span.farthest_mm, inner_mm: span.nearest_mm };
    let answer = Holding { zone, span, scans: MOST_EXCHANGES }.answer(section, false, false);
    MinimumZone { lower_bound_mm: 0.0, certified_within_mm: 0.0, ..answer }
}

/// Four contacts, two of each kind.
#[derive(Debug, Clone, Copy)]
struct Reference {
    outer: [usize; 2],
    inner: [usize; 2],
}

/// Four contacts and the circles through them.
struct Zone {
    reference: Reference,
    centre: [f64; 2],
    outer_mm: f64,
    inner_mm: f64,
}

/// A zone that holds all points.
struct Holding {
    zone: Zone,
    span: Span,
    scans: u32,
}

impl Zone {
    /// The concentric circles through a reference, the pairs named by their distance.
    fn through(section: &Section, near: [f64; 2], reference: Reference) -> Option<Self> {
        let Reference { outer, inner } = reference;
        let centre = equidistant(section, near, outer, inner)?;
        let distance = |index| square(section.from(centre, index)).sqrt();
        let (far, close) = (outer.map(distance), inner.map(distance));
        let (outer_mm, inner_mm) = (far[0].max(far[1]), close[0].min(close[1]));
        if outer_mm >= inner_mm {
            return Some(Self { reference, centre, outer_mm, inner_mm });
        }
        let (outer_mm, inner_mm) = (close[0].max(close[1]), far[0].min(far[1]));
        Some(Self { reference: Reference { outer: inner, inner: outer }, centre, outer_mm, inner_mm })
    }

    /// How stiffly the contacts hold the centre; not positive where they do not alternate.
    fn hold(&self, section: &Section) -> f64 {
        let direction = |index| unit(section.from(self.centre, index));
        hold_of_zone(self.reference.inner.map(direction), self.reference.outer.map(direction))
    }
}

/// The farthest point, the nearest on either side of it, and the farthest between those two; `None` where the points
/// do not surround the centre so far.
fn opposite_extremes(section: &Section, centre: [f64; 2]) -> Option<Reference> {
    let first = section.span_inside(centre).farthest;
    let ahead = section.from(centre, first);
    let mut sides = [None, None];
    for index in 0..section.len() {
        let v = section.from(centre, index);
        let turn = cross(ahead, v);
        let (side, d) = (usize::from(turn < 0.0), square(v));
        if turn != 0.0 && sides[side].is_none_or(|(_, least)| d < least) {
            sides[side] = Some((index, d));
        }
    }
    let [(left, _), (right, _)] = [sides[0]?, sides[1]?];
    let arc = Arc::between(section, centre, left, right);
    let mut second = None;
    for index in 0..section.len() {
        let v = section.from(centre, index);
        let d = square(v);
        if second.is_none_or(|(_, most)| d > most) && arc.holds(v) && index != left && index != right {
            second = Some((index, d));
        }
    }
    Some(Reference { outer: [first, second?.0], inner: [left, right] })
}

/// Four points spread over the angle that the section covers, the kinds in turn.
fn spread_reference(section: &Section, centre: [f64; 2]) -> Option<Reference> {
    let order = order_from_gap(section, centre);
    let [a, b, c, d] = [0, 1, 2, 3].map(|i| order[(order.len() - 1) * i / 3]);
    Some(Reference { outer: [a, c], inner: [b, d] }).filter(|_| order.len() >= 4)
}

/// An arc of directions, counter-clockwise from one to the other.
struct Arc {
    from: [f64; 2],
    to: [f64; 2],
}

impl Arc {
    fn between(section: &Section, centre: [f64; 2], from: usize, to: usize) -> Self {
        Self { from: section.from(centre, from), to: section.from(centre, to) }
    }

    fn holds(&self, v: [f64; 2]) -> bool {
        if cross(self.from, self.to) >= 0.0 {
            cross(self.from, v) >= 0.0 && cross(v, self.to) >= 0.0
        } else {
            cross(self.to, v) < 0.0 || cross(v, self.from) < 0.0
        }
    }
}

/// Puts `entering` in the place of the one of `own` that lies between the same two of `others`.
fn replace(section: &Section, centre: [f64; 2], own: &mut [usize; 2], others: [usize; 2], entering: usize) {
    let arc = Arc::between(section, centre, others[0], others[1]);
    let side = |index| arc.holds(section.from(centre, index));
    let leaving = usize::from(side(own[0]) != side(entering));
    own[leaving] = entering;
}

fn exchange(
    section: &Section,
    start: [f64; 2],
    reference: Reference,
    goes_on: &dyn Fn() -> bool,
) -> Result<Option<Holding>, RoundnessError> {
    let mut through = Zone::through(section, start, reference);
    for exchanges in 1..=MOST_EXCHANGES {
        let Some(zone) = through else { break };
        look(goes_on)?;
        let span = section.span_inside(zone.centre);
        let resolution = resolution_mm(span.farthest_mm);
        let (outside, inside) = (span.farthest_mm - zone.outer_mm, zone.inner_mm - span.nearest_mm);
        if outside + inside <= resolution {
            let alternates = zone.hold(section) > -f64::EPSILON.sqrt();
            return Ok(alternates.then_some(Holding { zone, span, scans: exchanges + 1 }));
        }
        let Reference { mut outer, mut inner } = zone.reference;
        if outside > 0.0 {
            replace(section, zone.centre, &mut outer, inner, span.farthest);
        }
        if inside > 0.0 {
            replace(section, zone.centre, &mut inner, outer, span.nearest);
        }
        through = Zone::through(section, zone.centre, Reference { outer, inner });
    }
    Ok(None)
}

/// The best quadruple of a few points; the farthest and the nearest point of all join them until none is outside.
fn cut_planes(
    section: &Section,
    start: [f64; 2],
    goes_on: &dyn Fn() -> bool,
) -> Result<Option<Holding>, RoundnessError> {
    let order = order_from_gap(section, start);
    let span = section.span_inside(start);
    let first = FIRST_CORE.min(order.len());
    let mut core: Vec<usize> = (0..first).map(|i| order[(order.len() - 1) * i / (first - 1)]).collect();
    core.extend([span.nearest, span.farthest]);
    narrowest(section, start, core, 0.5 * span.farthest_mm, goes_on)
}

/// The narrowest zone about a centre within `within_mm` of `start`: the best of a few points, which is at most as wide as
/// that of all, until it holds all. `None` where that takes too long.
fn narrowest(
    section: &Section,
    start: [f64; 2],
    mut core: Vec<usize>,
    within_mm: f64,
    goes_on: &dyn Fn() -> bool,
) -> Result<Option<Holding>, RoundnessError> {
    let mut scans = 1;
    loop {
        core.sort_unstable();
        core.dedup();
        if core.len() > LARGEST_CORE {
            return Ok(None);
        }
        look(goes_on)?;
        let Some(zone) = best_of(section, start, &core, within_mm) else { return Ok(None) };
        let reached = section.span_inside(zone.centre);
        scans += 1;
        let missing = (reached.farthest_mm - zone.outer_mm) + (zone.inner_mm - reached.nearest_mm);
        if missing <= resolution_mm(reached.farthest_mm) {
            return Ok(Some(Holding { zone, span: reached, scans }));
        }
        core.extend([reached.nearest, reached.farthest]);
    }
}

/// The narrowest zone of a few points about a centre within `within_mm` of `start`, by trial of all quadruples.
fn best_of(section: &Section, start: [f64; 2], core: &[usize], within_mm: f64) -> Option<Zone> {
    let mut pairs = Vec::new();
    for (k, &i) in core.iter().enumerate() {
        pairs.extend(core[k + 1..].iter().map(|&j| [i, j]));
    }
    let mut best: Option<Zone> = None;
    for (k, &first) in pairs.iter().enumerate() {
        for &second in &pairs[k + 1..] {
            if first.iter().any(|index| second.contains(index)) {
                continue;
            }
            let Some(zone) = Zone::through(section, start, Reference { outer: first, inner: second }) else { continue };
            let width = zone.outer_mm - zone.inner_mm;
            let narrower = best.as_ref().is_none_or(|best| width < best.outer_mm - best.inner_mm);
            let [x, y] = [zone.centre[0] - start[0], zone.centre[1] - start[1]];
            if narrower && square([x, y]) <= within_mm * within_mm && zone.hold(section) > 0.0 {
                let slack = 0.5 * resolution_mm(zone.outer_mm);
                let holds = |&index: &usize| {
                    let d = square(section.from(zone.centre, index)).sqrt();
                    d <= zone.outer_mm + slack && d >= zone.inner_mm - slack
                };
                if core.iter().all(holds) {
                    best = Some(zone);
                }
            }
        }
    }
    best
}

/// A zone with its proof; where that of first order does not reach far enough, with that of trial.
fn proven(section: &Section, holding: Holding, goes_on: &dyn Fn() -> bool) -> Result<MinimumZone, RoundnessError> {
    let could_be_better_mm = half_gap_cosine(section, holding.zone.centre)
        .and_then(|cosine| narrower_within_mm(holding.span.width_mm(), cosine))
        // Beyond half the radius nothing was proven; the bound does not go there.
        .filter(|&mm| mm <= 0.5 * holding.span.nearest_mm);
    let reached = reach_mm(holding.zone.hold(section), holding.zone.inner_mm);
    if could_be_better_mm.is_some_and(|mm| mm <= reached) {
        return Ok(holding.answer(section, true, true));
    }
    let trial = could_be_better_mm.and_then(|_| {
        let mut core = extremes_of_octants(section, holding.zone.centre);
        core.extend(holding.zone.reference.outer.iter().chain(&holding.zone.reference.inner));
        let cosine = half_gap_cosine(&section.part(&core), holding.zone.centre)?;
        // The few alone must keep narrower zones within a disc, else their narrowest need not be among the quadruples.
        let within_mm = narrower_within_mm(holding.span.width_mm(), cosine)?;
        (within_mm <= 0.5 * holding.span.nearest_mm).then_some((core, within_mm))
    });
    let tried = match trial {
        Some((core, within_mm)) => narrowest(section, holding.zone.centre, core, within_mm, goes_on)?,
        None => None,
    };
    Ok(match tried {
        Some(found) if found.span.width_mm() < holding.span.width_mm() => found.answer(section, true, false),
        Some(_) => holding.answer(section, true, false),
        None => holding.answer(section, false, false),
    })
}

/// The nearest and the farthest point of each eighth of a turn.
fn extremes_of_octants(section: &Section, centre: [f64; 2]) -> Vec<usize> {
    let mut extremes: [Option<[(usize, f64); 2]>; 8] = [None; 8];
    for index in 0..section.len() {
        let v = section.from(centre, index);
        let d = square(v);
        let [near, far] = extremes[sector(v) & 7].get_or_insert([(index, d); 2]);
        if d < near.1 {
            *near = (index, d);
        }
        if d > far.1 {
            *far = (index, d);
        }
    }
    extremes.into_iter().flatten().flatten().map(|(index, _)| index).collect()
}

impl Holding {
    fn answer(self, section: &Section, is_global: bool, is_unique: bool) -> MinimumZone {
        let Self { zone, span, scans } = self;
        let stiffness = zone.hold(section).max(0.0);
        let width = span.width_mm();
        let round_off = resolution_mm(span.farthest_mm);
        MinimumZone {
            centre_mm: section.outside(zone.centre),
            inner_radius_mm: span.nearest_mm,
            outer_radius_mm: span.farthest_mm,
            outer_contacts: zone.reference.outer,
            inner_contacts: zone.reference.inner,
            lower_bound_mm: (zone.outer_mm - zone.inner_mm).min(width),
            stiffness,
            certified_within_mm: reach_mm(stiffness, zone.inner_mm),
            is_global,
            is_unique,
            width_error_mm: (width - (zone.outer_mm - zone.inner_mm)).max(0.0) + round_off,
            touching: [span.farthest_mm, span.nearest_mm].map(|mm| hold_of_ties(section, zone.centre, mm).1),
            centre_error_mm: (stiffness > f64::EPSILON.sqrt()).then(|| round_off / stiffness),
            scans,
        }
    }
}

/// Farther than this from the centre every zone is wider than `width`, mm, where neighbouring points are at most twice
/// the angle of `cosine` apart (`roundness/4.5`); `None` where the points are too few to say so.
///
/// A shift by s brings a point nearer by s·cos γ − s²sin²γ/D at least, and takes another away by s·cos γ.
fn narrower_within_mm(width: f64, cosine: f64) -> Option<f64> {
    let slope = 2.0 * cosine - 0.5 * (1.0 - cosine * cosine);
    (slope > 0.0).then(|| 2.0 * width / slope)
}
