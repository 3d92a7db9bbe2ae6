//! The location where Newton's method fails: roots between brackets, which a steep flank cannot throw out.
//!
//! The distances of the two contacts decide where the ring is: its centre is where the circles of these radii about the
//! supports cross. Each distance must be the one that the profile has where its support then stands. Both lie between the
//! smallest and the largest distance that the profile has anywhere, so there is a solution, and a root of one equation
//! within a root of the other finds it whatever the slopes are.

use std::f64::consts::TAU;

use super::Stuck;
use super::nodes::Place;
use super::plane::{Vec2, add, angle, cross, dot, norm, scaled, sub, turned, unit};
use super::setting::Machine;
use super::stepper::{MOST_ITERATIONS, Solved, Stepper, half_gap, solve, wrapped};

/// Where a support climbs a flank of a node's width, the profile bends a thousand times more than elsewhere: a step of
/// Newton's method must be shorter to be the last.
const LAST_CLIMB_MM: f64 = 2e-8;
/// Least share of a step of Newton's method that is tried.
const LEAST_SHARE: f64 = 1e-9;
/// Share of a jump by which the cubic may overshoot it; a sixteenth is the most.
const OVERSHOOT: f64 = 0.2;
/// To what the distance of one contact is found, and within that the other, mm.
const OUTER_MM: f64 = 1e-10;
const INNER_MM: f64 = 1e-12;
/// A contact that is met to this is met, mm.
const MET_MM: f64 = 1e-9;
/// Starts per contact where both stand on flanks.
const STARTS: u32 = 12;

/// Evaluations of one root at most: halving alone would take 60.
const MOST_EVALUATIONS: u32 = 120;
/// The bracket round the start is this share of the range at first, and grows by this factor.
const FIRST_SHARE: f64 = 1e-3;
const WIDER: f64 = 8.0;

/// The centre of a ring that is so far from both supports and lies above them; `None` where it falls between them.
pub(super) fn centre_at(a: Vec2, b: Vec2, to_a_mm: f64, to_b_mm: f64) -> Option<Vec2> {
    let across = sub(b, a);
    let distance = norm(across);
    let along = (distance * distance + to_a_mm * to_a_mm - to_b_mm * to_b_mm) / (2.0 * distance);
    let height2 = to_a_mm * to_a_mm - along * along;
    let direction = unit(across);
    // Also refuses what is no number.
    (height2 > 0.0).then(|| add(add(a, scaled(direction, along)), scaled(turned(direction), height2.sqrt())))
}

/// A place where `f`, which is not negative at `low` and not positive at `high`, changes its sign; the nearest to `start` that
/// widening brackets find, to `tolerance`. `None` where `f` has no value.
pub(super) fn root(
    (low, high): (f64, f64),
    start: f64,
    tolerance: f64,
    mut f: impl FnMut(f64) -> Option<f64>,
) -> Option<f64> {
    let range = high - low;
    let start = start.clamp(low, high);
    let here = f(start)?;
    if here.abs() < f64::MIN_POSITIVE {
        return Some(start);
    }
    // The root lies on the side to which `f` pulls.
    let side = if here > 0.0 { 1.0 } else { -1.0 };
    let (mut left, mut f_left) = (start, here);
    let mut reach = (FIRST_SHARE * range).max(2.0 * tolerance);
    let (mut right, mut f_right) = loop {
        let at = (start + side * reach).clamp(low, high);
        let there = f(at)?;
        if there * here <= 0.0 || at <= low || at >= high {
            break (at, there);
        }
        (left, f_left) = (at, there);
        reach *= WIDER;
    };
    for turn in 0..MOST_EVALUATIONS {
        if (right - left).abs() <= tolerance {
            break;
        }
        // Illinois, and every third time the middle, so that a flank costs no more than halving.
        let secant = (left * f_right - right * f_left) / (f_right - f_left);
        let middle = 0.5 * (left + right);
        let inside = (secant - left) * (secant - right) < 0.0;
        let at = if inside && turn % 3 != 2 { secant } else { middle };
        let there = f(at)?;
        if there.abs() < f64::MIN_POSITIVE {
            return Some(at);
        }
        if there * f_left > 0.0 {
            (left, f_left, f_right) = (at, there, 0.5 * f_right);
        } else {
            (right, f_right, f_left) = (at, there, 0.5 * f_left);
        }
    }
    Some(if f_left.abs() < f_right.abs() { left } else { right })
}

/// A place of the centre, looked at.
#[derive(Debug, Clone, Copy)]
struct Stand {
    /// Rotation of the body that goes with it.
    body_rad: f64,
    /// How far the equations of the contacts are from being met.
    gap_mm2: f64,
    /// Where Newton's method would go, to be taken away from the place.
    step: Vec2,
}

/// The ring at given distances from its supports.
#[derive(Debug, Clone, Copy)]
struct Held {
    centre: Vec2,
    /// Rotation of the body that goes with it.
    body_rad: f64,
    /// How much farther than these distances the profile reaches there, mm.
    gap_mm: [f64; 2],
}

impl Held {
    fn off_mm(&self) -> f64 {
        self.gap_mm[0].abs().max(self.gap_mm[1].abs())
    }
}

impl<M: Machine> Stepper<'_, M> {
    /// Centre and rotation of the next step where Newton's method fails: its steps halved; brackets, one contact's within
    /// the other's; halved steps from starts all over the range (`ring/3.6`). What the last leaves, where both supports
    /// stand on flanks steeper than numbers resolve, is kept as [`Stepper::unmet_mm`].
    pub(super) fn slowly(&mut self) -> Result<Solved<1>, Stuck> {
        self.stale = true;
        if let Some(solved) = self.climb(self.before[0]) {
            return Ok(solved);
        }
        let (a, b) = self.machine.supports((self.body_rad + self.step_rad) * self.machine_per_body);
        let start = [a, b].map(|support| norm(sub(support, self.before[0])));
        let bracketed = self.bracketed(start, Self::held);
        if let Some(held) = bracketed.filter(|held| held.off_mm() < MET_MM) {
            return Ok(Solved { centre: [held.centre], body_rad: [held.body_rad] });
        }
        let (low, high) = self.distances_mm();
        let at = |k: u32| low + (high - low) * (f64::from(k) + 0.5) / f64::from(STARTS);
        for start in (0..STARTS).flat_map(|i| (0..STARTS).map(move |j| [at(i), at(j)])) {
            let solved = self.held(start).and_then(|held| self.climb(held.centre));
            if let Some(solved) = solved {
                return Ok(solved);
            }
        }
        let Some(held) = bracketed else { return Err(self.fallen(norm(sub(b, a)))) };
        self.unmet_mm = self.unmet_mm.max(held.off_mm());
        Ok(Solved { centre: [held.centre], body_rad: [held.body_rad] })
    }

    /// Where the ring at rest lies, likewise.
    pub(super) fn rest_slowly(&mut self, a: Vec2, b: Vec2, from: Vec2) -> Result<Vec2, Stuck> {
        let at = |stepper: &mut Self, to: [f64; 2]| {
            let centre = centre_at(a, b, to[0], to[1])?;
            let gap_mm =
                [stepper.at_angle(angle(sub(a, centre))) - to[0], stepper.at_angle(angle(sub(b, centre))) - to[1]];
            Some(Held { centre, body_rad: 0.0, gap_mm })
        };
        let found = self.bracketed([norm(sub(a, from)), norm(sub(b, from))], at);
        found.map(|held| held.centre).ok_or_else(|| self.fallen(norm(sub(b, a))))
    }

    /// What ends a run: the supports are farther apart than the ring reaches.
    fn fallen(&self, apart_mm: f64) -> Stuck {
        Stuck {
            turned_revolutions: self.body_rad.max(0.0) * self.machine_per_body / TAU,
            apart_mm,
            reach_mm: 2.0 * (self.nodes.range().1 + self.setting.roller_radius_mm),
        }
    }

    /// Smallest and largest distance that a contact can have, mm, what the cubic may overshoot included.
    fn distances_mm(&self) -> (f64, f64) {
        let (low, high) = self.nodes.range();
        let roller = self.setting.roller_radius_mm;
        let margin = OVERSHOOT * (high - low) + 1e-9 * high;
        (low + roller - margin, high + roller + margin)
    }

    /// The distances at which both contacts are met, one as a root within the other's; whichever order leaves less.
    /// `None` where the ring falls between its supports.
    fn bracketed(&mut self, start: [f64; 2], at: impl Fn(&mut Self, [f64; 2]) -> Option<Held>) -> Option<Held> {
        let range = self.distances_mm();
        let mut best: Option<Held> = None;
        for (outer, inner) in [(0, 1), (1, 0)] {
            let mut found = None;
            let mut other = start[inner];
            root(range, start[outer], OUTER_MM, |x| {
                let to = |y: f64| if outer == 0 { [x, y] } else { [y, x] };
                other = root(range, other, INNER_MM, |y| Some(at(self, to(y))?.gap_mm[inner]))?;
                found = at(self, to(other));
                found.map(|held| held.gap_mm[outer])
            })?;
            best = [best, found].into_iter().flatten().min_by(|p, q| p.off_mm().total_cmp(&q.off_mm()));
            if best.is_some_and(|held| held.off_mm() < MET_MM) {
                break;
            }
        }
        best
    }

    /// The ring of the next step so far from its supports; `None` where it falls between them.
    fn held(&mut self, to: [f64; 2]) -> Option<Held> {
        let mut body_rad = self.body_rad + self.step_rad;
        let (mut centre, mut arms, mut vt) = ([0.0; 2], [[0.0; 2]; 2], [0.0; 2]);
        // The supports and the tip follow from the rotation, and the rotation from where the ring is.
        for _ in 0..4 {
            let turned_rad = body_rad * self.machine_per_body;
            let (a, b) = self.machine.supports(turned_rad);
            centre = centre_at(a, b, to[0], to[1])?;
            arms = [sub(a, centre), sub(b, centre)];
            vt = sub(self.machine.tip(turned_rad), centre);
            let before = std::mem::replace(&mut body_rad, self.body_of(vt));
            if (body_rad - before).abs() < 1e-14 {
                break;
            }
        }
        let [(ea, _), (eb, _)] = self.contacts(vt, arms);
        Some(Held { centre, body_rad, gap_mm: [ea - to[0], eb - to[1]] })
    }

    /// Rotation of the body at which the next node is under the tip.
    fn body_of(&self, vt: Vec2) -> f64 {
        let near = angle(vt);
        let turns = ((self.frame.tip_rad - near) / TAU).round();
        near + turns * TAU - self.first_rad + self.step_rad * self.count as f64
    }

    /// Distances and slopes per node of the contacts at the ends of two arms.
    fn contacts(&mut self, vt: Vec2, arms: [Vec2; 2]) -> [(f64, f64); 2] {
        let n = self.nodes.len();
        let places = arms.map(|v| {
            let ahead = cross(vt, v).atan2(dot(vt, v)) * self.per_step;
            Place::of(wrapped(self.node as f64 + ahead, n as f64), n)
        });
        let (a, b) = self.read(places, 0);
        [a, b]
    }

    /// Newton's method from a place where it jumps to and fro: a support stands at the foot of a
    /// flank that is steeper than a node is wide. Its steps are halved until they bring the ring nearer, so that the
    /// support climbs the flank.
    fn climb(&mut self, from: Vec2) -> Option<Solved<1>> {
        let mut centre = from;
        let mut here = self.stand(centre);
        for _ in 0..MOST_ITERATIONS {
            let step = here.step;
            if norm(step) < LAST_CLIMB_MM {
                return Some(Solved { centre: [centre], body_rad: [here.body_rad] });
            }
            let mut share = 1.0;
            (centre, here) = loop {
                let tried = sub(centre, scaled(step, share));
                let there = self.stand(tried);
                // What is no number is not nearer either.
                if there.gap_mm2 < here.gap_mm2 {
                    break (tried, there);
                }
                share *= 0.5;
                if share < LEAST_SHARE {
                    return None;
                }
            };
        }
        None
    }

    /// What the next step finds with the centre at a place.
    fn stand(&mut self, centre: Vec2) -> Stand {
        let mut body_rad = self.body_rad + self.step_rad;
        let (mut turned_rad, mut vt) = (0.0, [0.0; 2]);
        // The rotation follows from the tip, and the tip, which moves by thousandths of a degree, from the rotation.
        for _ in 0..3 {
            turned_rad = body_rad * self.machine_per_body;
            vt = sub(self.machine.tip(turned_rad), centre);
            body_rad = self.body_of(vt);
        }
        let (a, b) = self.machine.supports(turned_rad);
        let (va, vb) = (sub(a, centre), sub(b, centre));
        let [(ea, slope_a), (eb, slope_b)] = self.contacts(vt, [va, vb]);
        let tip = scaled(turned(vt), 1.0 / dot(vt, vt));
        let row = |v: Vec2, e: f64, slope: f64| {
            let by = e * slope * self.per_step;
            let side = sub(scaled(turned(v), 1.0 / dot(v, v)), tip);
            [by * side[0] - v[0], by * side[1] - v[1]]
        };
        let (gap_a, gap_b) = (half_gap(va, ea), half_gap(vb, eb));
        let step = solve(row(va, ea, slope_a), row(vb, eb, slope_b), gap_a, gap_b);
        Stand { body_rad, gap_mm2: gap_a.hypot(gap_b), step }
    }
}
