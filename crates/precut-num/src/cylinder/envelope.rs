//! Cylinders that enclose: narrowest zone, largest inside, smallest outside.

use super::axis::{Axis, Local, gradient, moved, seen};
use super::program::{Plane, Sides, solve};
use super::proof::{Proof, prove};
use super::{CylinderError, Point};

const MOST_STEPS: u32 = 200;
/// Gains below so many units of the last place of the radius are rounding.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// Which cylinder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Two coaxial cylinders nearest to each other that hold all points between them.
    MinimumZone,
    /// The largest inside.
    Inscribed,
    /// The smallest outside.
    Circumscribed,
}

impl Kind {
    /// What its value is when all distances are `middle_mm` and the planes start from there.
    pub(super) fn offset(self, middle_mm: f64) -> f64 {
        match self {
            Self::MinimumZone => 0.0,
            Self::Inscribed => -middle_mm,
            Self::Circumscribed => middle_mm,
        }
    }

    pub(super) fn sides(self) -> Sides {
        Sides { above: self != Self::Inscribed, below: self != Self::Circumscribed }
    }
}

/// A point that holds the cylinder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Contact {
    /// Which point.
    pub point: usize,
    /// Whether it lies on the outer cylinder.
    pub is_outer: bool,
}

/// An enclosing cylinder.
#[derive(Debug, Clone, PartialEq)]
pub struct Envelope {
    /// Its axis; height 0 is the middle of the points.
    pub axis: Axis,
    /// Half the length of the points along it, mm.
    pub half_mm: f64,
    /// Smallest and largest distance from it, mm.
    pub inner_mm: f64,
    /// See above.
    pub outer_mm: f64,
    /// The points that hold it.
    pub contacts: Vec<Contact>,
    /// How much better any other could be.
    pub proof: Proof,
}

impl Envelope {
    /// Peak to valley, mm.
    pub fn width_mm(&self) -> f64 {
        self.outer_mm - self.inner_mm
    }
}

/// What is to be as small as it can: the width, minus the radius inside, or the radius outside.
pub(super) fn value(kind: Kind, locals: &[Local]) -> f64 {
    let (inner, outer) = range(locals);
    match kind {
        Kind::MinimumZone => outer - inner,
        Kind::Inscribed => -inner,
        Kind::Circumscribed => outer,
    }
}

pub(super) fn range(locals: &[Local]) -> (f64, f64) {
    locals.iter().fold((f64::INFINITY, 0.0), |(l, h), local| (l.min(local.distance_mm), h.max(local.distance_mm)))
}

/// Distances linear in the ends of the axis, about a middle distance that keeps their digits.
pub(super) fn planes(locals: &[Local], half_mm: f64, middle_mm: f64) -> Vec<Plane> {
    let plane = |local: &Local| Plane { rise: gradient(local, half_mm), value: local.distance_mm - middle_mm };
    locals.iter().map(plane).collect()
}

/// From an axis near the best one: the linear programme of the distances within a step that is halved where the true
/// distances gain less than a quarter of what the linear ones promise. Stops where `goes_on` says no; asked before each
/// programme.
pub fn envelope(
    kind: Kind,
    points: &[Point],
    from: Axis,
    goes_on: &dyn Fn() -> bool,
) -> Result<Envelope, CylinderError> {
    let (mut axis, mut locals, mut half_mm) = seen(from, points);
    let mut now = value(kind, &locals);
    let (inner, outer) = range(&locals);
    let rounding = ROUNDING * outer;
    let mut step = (2.0 * (outer - inner)).max(rounding);
    let mut held = [Vec::new(), Vec::new()];
    for _ in 0..MOST_STEPS {
        if !goes_on() {
            return Err(CylinderError::Stopped);
        }
        let (inner, outer) = range(&locals);
        let middle_mm = 0.5 * (inner + outer);
        let planes = planes(&locals, half_mm, middle_mm);
        let solved = solve(&planes, kind.sides(), [-step; 4], [step; 4]).ok_or(CylinderError::Undetermined)?;
        let promised = now - (solved.least + kind.offset(middle_mm));
        let moves = solved.step.iter().fold(0.0_f64, |most, s| most.max(s.abs()));
        let (to, to_locals, to_half_mm) = seen(moved(axis, half_mm, solved.step), points);
        let gained = now - value(kind, &to_locals);
        held = solved.held;
        if gained > 0.0 {
            (axis, locals, half_mm, now) = (to, to_locals, to_half_mm, now - gained);
        }
        if promised <= rounding || moves <= rounding {
            break;
        }
        if gained < 0.25 * promised {
            step = 0.5 * moves;
        } else if gained > 0.75 * promised {
            step = step.max(2.0 * moves);
        }
    }
    let (inner_mm, outer_mm) = range(&locals);
    let contact = |is_outer| move |point: &usize| Contact { point: *point, is_outer };
    let [above, below] = &held;
    let contacts = above.iter().map(contact(true)).chain(below.iter().map(contact(false))).collect();
    let proof = prove(kind, &locals, half_mm);
    Ok(Envelope { axis, half_mm, inner_mm, outer_mm, contacts, proof })
}
