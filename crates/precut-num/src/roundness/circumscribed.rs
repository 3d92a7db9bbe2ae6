//! The minimum circumscribed reference circle, MCCI.

use super::contact::{hold_of_ties, resolution_mm};
use super::section::square;
use super::triangle::Held;
use super::{Circle, RoundnessError, Section, Span, look};

/// The smallest circle that holds all points: always one and only one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MinimumCircumscribed {
    /// The circle.
    pub circle: Circle,
    /// Nearest and farthest point from its centre; RONt is [`Span::width_mm`].
    pub span: Span,
    /// Indices of the points that it touches, not all within a half circle; the third is absent where two
    /// diametral points hold the circle.
    pub contacts: (usize, usize, Option<usize>),
    /// By how much, at least, the radius grows per mm of shift of the centre (first order); 0 for two diametral contacts.
    pub stiffness: f64,
    /// Bound of the round-off in the radius, mm.
    pub radius_error_mm: f64,
    /// Bound of the round-off in the centre, mm.
    pub centre_error_mm: f64,
    /// How many points touch it, round-off aside.
    pub touching: usize,
    /// Passes over all points, the certifying one included.
    pub scans: u32,
}

/// Exchanges after which the search is given up; the radius grows with each, profiles take 2 to 10.
const MOST_EXCHANGES: u32 = 1000;

/// The minimum circumscribed circle (`roundness/5.5`), at least two different points; `start_mm` is the least-squares centre.
///
/// Exchange: the smallest circle of two or three contacts; the farthest point of all joins them, and the smallest
/// circle of these decides who stays; the radius grows with every exchange. A convex problem: the circle is unique.
pub fn minimum_circumscribed(
    section: &Section,
    start_mm: [f64; 2],
    goes_on: &dyn Fn() -> bool,
) -> Result<MinimumCircumscribed, RoundnessError> {
    if section.len() < 2 {
        return Err(RoundnessError::TooFewPoints { count: section.len(), needed: 2 });
    }
    let start = section.inside(start_mm);
    let first = section.span_inside(start).farthest;
    let second = section.span_inside(section.at(first)).farthest;
    let mut ball = Ball::of_two(section, first, second);
    for scans in 3..MOST_EXCHANGES {
        look(goes_on)?;
        let span = section.span_inside(ball.centre);
        let resolution = resolution_mm(span.farthest_mm);
        if span.farthest_mm <= ball.radius_mm + resolution {
            return if span.farthest_mm > 0.0 {
                Ok(ball.answer(section, span, scans))
            } else {
                Err(RoundnessError::NoCircle)
            };
        }
        ball = ball
            .with(section, span.farthest)
            .ok_or(RoundnessError::NotConverged { iterations: scans, left_mm: span.farthest_mm - ball.radius_mm })?;
    }
    Err(RoundnessError::NotConverged { iterations: MOST_EXCHANGES, left_mm: ball.radius_mm })
}

/// The smallest circle of two or three points.
#[derive(Debug, Clone, Copy)]
struct Ball {
    centre: [f64; 2],
    radius_mm: f64,
    hold: f64,
    contacts: (usize, usize, Option<usize>),
}

impl Ball {
    /// About the middle of two points.
    fn of_two(section: &Section, i: usize, j: usize) -> Self {
        let ([ax, ay], [bx, by]) = (section.at(i), section.at(j));
        let radius_mm = 0.5 * square([bx - ax, by - ay]).sqrt();
        Self { centre: [0.5 * (ax + bx), 0.5 * (ay + by)], radius_mm, hold: 0.0, contacts: (i, j, None) }
    }

    fn of_three(section: &Section, near: [f64; 2], [i, j, k]: [usize; 3]) -> Option<Self> {
        let Held { centre, radius_mm, hold, .. } = Held::through(section, near, [i, j, k])?;
        Some(Self { centre, radius_mm, hold, contacts: (i, j, Some(k)) })
    }

    /// The smallest circle of the contacts and a point outside, which it then touches.
    fn with(&self, section: &Section, entering: usize) -> Option<Self> {
        let (i, j, third) = self.contacts;
        let old = [Some(i), Some(j), third];
        let mut best: Option<Self> = None;
        let mut offer = |ball: Self| {
            let slack = 0.5 * resolution_mm(ball.radius_mm);
            let holds = |index: usize| square(section.from(ball.centre, index)).sqrt() <= ball.radius_mm + slack;
            if old.iter().flatten().all(|&index| holds(index))
                && best.is_none_or(|best| ball.radius_mm < best.radius_mm)
            {
                best = Some(ball);
            }
        };
        for &a in old.iter().flatten() {
            offer(Self::of_two(section, entering, a));
        }
        let pairs = [Some((i, j)), third.map(|k| (i, k)), third.map(|k| (j, k))];
        for (a, b) in pairs.into_iter().flatten() {
            if let Some(ball) = Self::of_three(section, self.centre, [entering, a, b]) {
                offer(ball);
            }
        }
        best
    }

    fn answer(self, section: &Section, span: Span, scans: u32) -> MinimumCircumscribed {
        let round_off = resolution_mm(span.farthest_mm);
        let wander = (2.0 * round_off * span.farthest_mm).sqrt();
        MinimumCircumscribed {
            circle: Circle { centre_mm: section.outside(self.centre), radius_mm: span.farthest_mm },
            span,
            contacts: self.contacts,
            stiffness: self.hold,
            radius_error_mm: round_off,
            touching: hold_of_ties(section, self.centre, span.farthest_mm).1,
            // Two contacts: their middle, as exact as they are; three: round-off over stiffness, at worst a flat optimum's.
            centre_error_mm: if self.contacts.2.is_some() { (round_off / self.hold).min(wander) } else { round_off },
            scans,
        }
    }
}
