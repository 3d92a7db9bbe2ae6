//! The maximum inscribed reference circle, MICI.

use super::contact::{FLAT, half_gap_cosine, hold_of_ties, reach_mm, resolution_mm};
use super::section::square;
use super::triangle::{Held, first_triple};
use super::{Circle, RoundnessError, Section, Span, look};

/// The largest circle with no point inside it, with its proof.
#[derive(Debug, Clone, PartialEq)]
pub struct MaximumInscribed {
    /// The circle.
    pub circle: Circle,
    /// Nearest and farthest point from its centre; RONt is [`Span::width_mm`].
    pub span: Span,
    /// Indices of the three points that it touches; seen from the centre they are not in one half circle.
    pub contacts: [usize; 3],
    /// By how much, at least, the radius falls per mm of shift of the centre (first order); near 0 the centre is badly
    /// determined though the radius is not.
    pub stiffness: f64,
    /// Radius of the disc about the centre in which no larger circle exists, mm (`roundness/5.3`).
    pub certified_within_mm: f64,
    /// Whether no other circle is larger: that disc holds every centre that could be better, or all of them were tried.
    pub is_global: bool,
    /// By how much the radius of any other inscribed circle can exceed this one, mm; 0 where [`Self::is_global`].
    pub radius_gap_mm: f64,
    /// Other circles that no shift enlarges, as large as this one within the round-off: the circle is not unique.
    pub others: Vec<OtherInscribed>,
    /// Bound of the round-off in the radius, mm.
    pub radius_error_mm: f64,
    /// Bound of the round-off in the centre, mm.
    pub centre_error_mm: f64,
    /// How many points touch it, round-off aside: more than three on made profiles.
    pub touching: usize,
    /// Passes over all points, the certifying ones included.
    pub scans: u32,
}

impl MaximumInscribed {
    /// The largest circle about a given centre, unproven.
    pub(super) fn unproven_about(section: &Section, centre_mm: [f64; 2]) -> Self {
        let centre = section.inside(centre_mm);
        about(section, centre, section.span_inside(centre))
    }
}

/// Another inscribed circle of the same size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OtherInscribed {
    /// The circle.
    pub circle: Circle,
    /// Indices of the three points that it touches.
    pub contacts: [usize; 3],
}

/// Exchanges after which all triangles are tried. Profiles take 2 to 10.
const MOST_EXCHANGES: u32 = 60;
/// Passes over the points in the trial of all triangles, at most.
const MOST_TRIALS: u32 = 2000;

/// The maximum inscribed circle (`roundness/5.1`), at least three points; `start_mm` is the least-squares centre.
///
/// Exchange from the least-squares centre: three contacts that hold the centre between them; the point farthest inside
/// replaces one of them so that the new three hold their centre and the one that left is outside; the radius falls
/// with every exchange. Where the proof does not reach every centre that could be better, all triangles of the points
/// that matter are tried, which finds the largest circle of all and its equals.
///
/// [`RoundnessError::NotSurrounding`] where the points lie on an arc that holds no centre.
pub fn maximum_inscribed(
    section: &Section,
    start_mm: [f64; 2],
    goes_on: &dyn Fn() -> bool,
) -> Result<MaximumInscribed, RoundnessError> {
    if section.len() < 3 {
        return Err(RoundnessError::TooFewPoints { count: section.len(), needed: 3 });
    }
    let start = section.inside(start_mm);
    let span = section.span_inside(start);
    let exchanged = match first_triple(section, start, span.nearest, |a, b| a < b) {
        Some(triple) => exchange(section, start, triple, goes_on)?,
        None => None,
    };
    let found = match exchanged {
        Some(found) => found,
        None if half_gap_cosine(section, start).is_none() => return Err(RoundnessError::NotSurrounding),
        // The centre can be anywhere inside.
        None => match try_all(section, start, span.farthest_mm, None, goes_on)? {
            Some(tried) => tried.best,
            None => return Ok(about(section, start, span)),
        },
    };
    let Some(unproven) = Unproven::of(section, &found) else {
        return Ok(answer(section, &found, &[], None));
    };
    Ok(match try_all(section, found.held.centre, unproven.within_mm, Some(&found), goes_on)? {
        Some(tried) => tried.answer(section),
        None => answer(section, &found, &[], Some(unproven)),
    })
}

/// A circle with no point inside.
#[derive(Clone)]
struct Empty {
    held: Held,
    span: Span,
    scans: u32,
}

impl Empty {
    /// `None` where neither the three contacts nor all that tie with them hold the centre: a shift enlarges the circle.
    fn new(section: &Section, held: Held, span: Span, scans: u32) -> Option<Self> {
        if held.hold > FLAT {
            return Some(Self { held, span, scans });
        }
        let (hold, _) = hold_of_ties(section, held.centre, held.radius_mm);
        (hold > FLAT).then_some(Self { held: Held { hold, ..held }, span, scans })
    }
}

/// Where larger circles could be that the proof of the one found does not reach.
#[derive(Clone, Copy)]
struct Unproven {
    within_mm: f64,
    gap_mm: f64,
}

impl Unproven {
    /// `None` where the proof reaches all centres (`roundness/5.4`).
    fn of(section: &Section, found: &Empty) -> Option<Self> {
        let Held { centre, radius_mm, hold, .. } = found.held;
        let farthest_mm = found.span.farthest_mm;
        let bound =
            half_gap_cosine(section, centre).and_then(|cosine| larger_within_mm(farthest_mm, radius_mm, cosine));
        let Some(within_mm) = bound else {
            return Some(Self { within_mm: farthest_mm, gap_mm: farthest_mm - radius_mm });
        };
        let shift = within_mm.min(0.5 * radius_mm);
        let gap_mm = (shift * shift / (2.0 * (radius_mm - shift)) - hold * shift).max(0.0);
        (within_mm > reach_mm(hold, radius_mm)).then_some(Self { within_mm, gap_mm })
    }
}

/// A centre at this distance or beyond has a point nearer than `radius_mm`, mm, where neighbouring points are at most
/// twice the angle of `cosine` apart and all between `radius_mm` and `farthest_mm` away; `None` where the section is too
/// far from round to say so of every centre inside it.
///
/// A point at distance d and angle φ from the direction of the shift s is nearer than r while s is within
/// d·cos φ ± √(r² − d²sin²φ); the lower end is highest for the farthest point, the upper one lowest for the nearest.
fn larger_within_mm(farthest_mm: f64, radius_mm: f64, cosine: f64) -> Option<f64> {
    let half_chord = radius_mm * radius_mm - farthest_mm * farthest_mm * (1.0 - cosine * cosine);
    (half_chord > 0.0 && farthest_mm <= 2.0 * radius_mm * cosine).then(|| farthest_mm * cosine - half_chord.sqrt())
}

fn exchange(
    section: &Section,
    start: [f64; 2],
    triple: [usize; 3],
    goes_on: &dyn Fn() -> bool,
) -> Result<Option<Empty>, RoundnessError> {
    let Some(mut held) = Held::through(section, start, triple) else { return Ok(None) };
    for scans in 1..=MOST_EXCHANGES {
        look(goes_on)?;
        let span = section.span_inside(held.centre);
        let resolution = resolution_mm(span.farthest_mm);
        if span.nearest_mm >= held.radius_mm - resolution {
            return Ok(Empty::new(section, held, span, scans + 2));
        }
        let entering = span.nearest;
        let mut best: Option<Held> = None;
        for leaving in 0..3 {
            let mut contacts = held.contacts;
            let left = std::mem::replace(&mut contacts[leaving], entering);
            let Some(next) = Held::through(section, held.centre, contacts) else { continue };
            let outside = next.distance_mm(section, left) >= next.radius_mm - resolution;
            if outside && best.is_none_or(|best| next.radius_mm > best.radius_mm) {
                best = Some(next);
            }
        }
        let Some(best) = best else { break };
        held = best;
    }
    Ok(None)
}

/// All circles through three points of a growing few that hold their centre and none of the few inside, not smaller than
/// a radius and about centres within a disc.
struct Trial<'a> {
    section: &'a Section,
    middle: [f64; 2],
    within_mm: f64,
    floor_mm: f64,
    resolution_mm: f64,
    few: Vec<usize>,
    circles: Vec<Held>,
}

impl Trial<'_> {
    fn add(&mut self, entering: usize) {
        let (section, resolution) = (self.section, self.resolution_mm);
        if self.few.contains(&entering) {
            return;
        }
        self.circles.retain(|circle| circle.distance_mm(section, entering) >= circle.radius_mm - resolution);
        for (k, &i) in self.few.iter().enumerate() {
            for &j in &self.few[k + 1..] {
                let Some(circle) = Held::through(section, self.middle, [entering, i, j]) else { continue };
                let shift = [circle.centre[0] - self.middle[0], circle.centre[1] - self.middle[1]];
                let matters = circle.radius_mm >= self.floor_mm - resolution
                    && square(shift).sqrt() <= self.within_mm + resolution;
                let empty = |&index: &usize| circle.distance_mm(section, index) >= circle.radius_mm - resolution;
                if matters && self.few.iter().all(empty) {
                    self.circles.push(circle);
                }
            }
        }
        self.few.push(entering);
    }
}

/// What the trial of all triangles found.
struct Tried {
    best: Empty,
    others: Vec<Empty>,
    /// Whether nothing can be larger.
    is_global: bool,
}

impl Tried {
    fn answer(&self, section: &Section) -> MaximumInscribed {
        let gap_mm = self.best.span.farthest_mm - self.best.held.radius_mm;
        let unproven = (!self.is_global).then_some(Unproven { within_mm: gap_mm, gap_mm });
        answer(section, &self.best, &self.others, unproven)
    }
}

/// The largest circle about a centre within a disc, and its equals; `None` where that takes too long.
///
/// The circles of a few points are at least as large as those of all, so the largest of the few that holds none of all
/// inside is the largest of all.
fn try_all(
    section: &Section,
    middle: [f64; 2],
    within_mm: f64,
    known: Option<&Empty>,
    goes_on: &dyn Fn() -> bool,
) -> Result<Option<Tried>, RoundnessError> {
    let farthest_mm = section.span_inside(middle).farthest_mm;
    let resolution_mm = resolution_mm(farthest_mm);
    let floor_mm = known.map_or(0.0, |known| known.held.radius_mm);
    let mut first = nearest_of_sectors(section, middle);
    first.extend(known.iter().flat_map(|known| known.held.contacts));
    // The few alone must keep larger circles within a disc, else the largest of the few need not be among the triangles.
    let bound = half_gap_cosine(&section.part(&first), middle)
        .and_then(|cosine| larger_within_mm(farthest_mm, floor_mm, cosine));
    let within_mm = within_mm.max(bound.unwrap_or(farthest_mm));
    let mut trial = Trial { section, middle, within_mm, floor_mm, resolution_mm, few: Vec::new(), circles: Vec::new() };
    for index in first {
        trial.add(index);
    }
    let mut found: Vec<Empty> = known.cloned().into_iter().collect();
    let mut scans = known.map_or(0, |known| known.scans);
    loop {
        let largest =
            (0..trial.circles.len()).max_by(|&a, &b| trial.circles[a].radius_mm.total_cmp(&trial.circles[b].radius_mm));
        let Some(at) = largest else { break };
        let held = trial.circles.swap_remove(at);
        if held.radius_mm < trial.floor_mm - resolution_mm || found.iter().any(|known| same(&known.held, &held)) {
            continue;
        }
        look(goes_on)?;
        let span = section.span_inside(held.centre);
        scans += 1;
        if scans > MOST_TRIALS {
            return Ok(None);
        }
        if span.nearest_mm >= held.radius_mm - resolution_mm {
            let Some(empty) = Empty::new(section, held, span, scans) else { continue };
            trial.floor_mm = trial.floor_mm.max(held.radius_mm);
            found.push(empty);
        } else {
            trial.add(span.nearest);
        }
    }
    // The first of equals is the one that was reached from the least-squares centre.
    let most = found.iter().map(|empty| empty.held.radius_mm).fold(f64::NEG_INFINITY, f64::max);
    found.retain(|empty| empty.held.radius_mm >= most - resolution_mm);
    let mut found = found.into_iter();
    Ok(found.next().map(|best| Tried {
        best: Empty { scans, ..best },
        others: found.collect(),
        is_global: bound.is_some(),
    }))
}

/// The circle about a centre that only the trial of all triangles could have bettered, which took too long: told as
/// unproven, with what may be missing.
fn about(section: &Section, centre: [f64; 2], span: Span) -> MaximumInscribed {
    let held = Held { contacts: [span.nearest; 3], centre, radius_mm: span.nearest_mm, hold: 0.0 };
    let gap_mm = span.width_mm();
    answer(section, &Empty { held, span, scans: MOST_TRIALS }, &[], Some(Unproven { within_mm: gap_mm, gap_mm }))
}

/// Whether two circles are one: several triples touch it.
fn same(a: &Held, b: &Held) -> bool {
    let apart = square([a.centre[0] - b.centre[0], a.centre[1] - b.centre[1]]).sqrt();
    apart <= centre_error_mm(a).max(centre_error_mm(b))
}

/// Bound of the round-off in the centre, mm: that of the distances over the stiffness, and never more than a flat
/// optimum lets it wander.
fn centre_error_mm(held: &Held) -> f64 {
    let round_off = resolution_mm(held.radius_mm);
    (round_off / held.hold).min((2.0 * round_off * held.radius_mm).sqrt())
}

/// The nearest point of each sector.
fn nearest_of_sectors(section: &Section, centre: [f64; 2]) -> Vec<usize> {
    const SECTORS: usize = 16;
    let mut nearest: [Option<(usize, f64)>; SECTORS] = [None; SECTORS];
    for index in 0..section.len() {
        let v = section.from(centre, index);
        let (sector, d) = (super::contact::sector(v), square(v));
        let slot = &mut nearest[sector];
        if slot.is_none_or(|(_, least)| d < least) {
            *slot = Some((index, d));
        }
    }
    nearest.into_iter().flatten().map(|(index, _)| index).collect()
}

fn answer(section: &Section, found: &Empty, others: &[Empty], unproven: Option<Unproven>) -> MaximumInscribed {
    let &Empty { held, span, scans } = found;
    let circle = |held: &Held| Circle { centre_mm: section.outside(held.centre), radius_mm: held.radius_mm };
    MaximumInscribed {
        // No point is inside by more than the round-off; the radius is that of the nearest.
        circle: Circle { radius_mm: span.nearest_mm, ..circle(&held) },
        span,
        contacts: held.contacts,
        stiffness: held.hold,
        certified_within_mm: reach_mm(held.hold, held.radius_mm),
        is_global: unproven.is_none(),
        radius_gap_mm: unproven.map_or(0.0, |unproven| unproven.gap_mm),
        others: others
            .iter()
            .map(|other| OtherInscribed { circle: circle(&other.held), contacts: other.held.contacts })
            .collect(),
        radius_error_mm: resolution_mm(span.farthest_mm),
        centre_error_mm: centre_error_mm(&held),
        touching: hold_of_ties(section, held.centre, span.nearest_mm).1,
        scans,
    }
}
