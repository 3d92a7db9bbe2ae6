//! How much better than a cylinder that was found any other could be (`cylindricity/5.1`).

use super::axis::Local;
use super::envelope::{Kind, planes, range, value};
use super::program::{Plane, solve};

/// Points that the stiffness far from the axis is taken from; fewer make the bound weaker, never wrong.
const FAR_POINTS: usize = 2_000;
/// Points next to either limit that the stiffness near the axis is taken from.
const NEAR_POINTS: usize = 1_000;

/// A bound on how much better any other axis could be that passes within a distance of the one found, at both ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Proof {
    /// No other is better by more than this, mm.
    pub gap_mm: f64,
    /// For every axis that passes within this distance of the one found in both end planes, along x and along y, mm.
    pub within_mm: f64,
}

/// By how much distances may differ from the linear ones when both ends move by up to `s` in each direction, over s².
///
/// A point inside nears by at least the linear amount but |s|²/2(d - |s|); one outside recedes at least by the linear
/// amount but for the slant of the axis, (d + |s|) |t|²/2.
fn curvature(kind: Kind, (inner_mm, outer_mm): (f64, f64), half_mm: f64, s: f64) -> f64 {
    let across = std::f64::consts::SQRT_2 * s;
    let (inside, outside) = (1.0 / (inner_mm - across), (outer_mm + across) / (half_mm * half_mm));
    match kind {
        Kind::MinimumZone => inside + outside,
        Kind::Inscribed => inside,
        Kind::Circumscribed => outside,
    }
}

pub(super) fn prove(kind: Kind, locals: &[Local], half_mm: f64) -> Proof {
    let span = range(locals);
    let (inner_mm, outer_mm) = span;
    let now = value(kind, locals);
    let middle_mm = 0.5 * (inner_mm + outer_mm);
    // The planes are relative to the middle.
    let offset = kind.offset(middle_mm);
    let all = planes(locals, half_mm, middle_mm);
    let rounding = 16.0 * f64::EPSILON * outer_mm;
    // Farther than this nothing is said; the curvature is taken there once.
    let limit = 0.25 * inner_mm;
    let bend = curvature(kind, span, half_mm, limit);
    // Far: the directions alone, whatever the values: value(s) >= stiffness s - slack - bend s².
    let stiffness = stiffness(kind, &spread_out(&all));
    let needed = match kind {
        Kind::MinimumZone => 2.0 * (outer_mm - inner_mm),
        Kind::Inscribed | Kind::Circumscribed => outer_mm - inner_mm,
    } + rounding;
    let root = stiffness * stiffness - 4.0 * bend * needed;
    if root <= 0.0 {
        // The points are too far from round, or the axis too short, to shut out other axes: what holds near the axis.
        let (near, gap) = nearby(kind, &all, now - offset, bend, (0.5 * stiffness / bend).min(limit), rounding);
        return Proof { gap_mm: gap + rounding, within_mm: near };
    }
    let within_mm = ((stiffness + root.sqrt()) / (2.0 * bend)).min(limit);
    let rho = (2.0 * needed / (stiffness + root.sqrt())).min(within_mm);
    let bend_near = curvature(kind, span, half_mm, rho);
    let (_, gap) = nearby(kind, &all, now - offset, bend_near, rho, rounding);
    Proof { gap_mm: gap + rounding, within_mm }
}

/// The gap over all axes within `rho`: from the programme's value on the faces of smaller boxes; the smallest gap of a
/// few box sizes. By convexity the linear value rises beyond a box as it does up to its faces.
fn nearby(kind: Kind, all: &[Plane], now: f64, bend: f64, rho: f64, rounding: f64) -> (f64, f64) {
    let mut best = f64::INFINITY;
    for share in [1e-4, 1e-3, 1e-2, 0.1, 1.0] {
        let box_mm = share * rho;
        if box_mm <= 1e3 * rounding && share < 1.0 {
            continue;
        }
        let planes = near(all, 8.0 * box_mm);
        let face = faces(kind, &planes, box_mm).map_or(f64::NEG_INFINITY, |least| least - now);
        let Some(inside) = solve(&planes, kind.sides(), [-box_mm; 4], [box_mm; 4]) else { continue };
        let within = now - inside.least + bend * box_mm * box_mm;
        let beyond = bend * rho * rho - face / share;
        best = best.min(within.max(beyond).max(0.0));
    }
    (rho, best)
}

/// The least linear value on the faces of a box.
fn faces(kind: Kind, planes: &[Plane], box_mm: f64) -> Option<f64> {
    let mut least = f64::INFINITY;
    for k in 0..4 {
        for side in [-box_mm, box_mm] {
            let (mut low, mut high) = ([-box_mm; 4], [box_mm; 4]);
            (low[k], high[k]) = (side, side);
            least = least.min(solve(planes, kind.sides(), low, high)?.least);
        }
    }
    Some(least)
}

/// The least that the directions alone give at a unit distance.
fn stiffness(kind: Kind, planes: &[Plane]) -> f64 {
    let directions: Vec<Plane> = planes.iter().map(|plane| Plane { value: 0.0, ..*plane }).collect();
    faces(kind, &directions, 1.0).unwrap_or(0.0).max(0.0)
}

/// Some of the planes, spread evenly over the list, and those of the ends of the axis.
fn spread_out(all: &[Plane]) -> Vec<Plane> {
    if all.len() <= FAR_POINTS {
        return all.to_vec();
    }
    let share = |plane: &Plane| (plane.rise[0].hypot(plane.rise[1]) - 0.5).abs();
    let mut order: Vec<usize> = (0..all.len()).collect();
    order.sort_by(|&a, &b| share(&all[b]).total_cmp(&share(&all[a])).then(a.cmp(&b)));
    let ends = &mut order[..all.len().min(4 * FAR_POINTS)];
    ends.sort_unstable();
    ends.iter().step_by(ends.len().div_ceil(FAR_POINTS)).map(|&i| all[i]).collect()
}

/// The planes next to either limit.
fn near(all: &[Plane], reach: f64) -> Vec<Plane> {
    let (low, high) = all.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p.value), h.max(p.value)));
    let off = |plane: &Plane| (plane.value - low).min(high - plane.value);
    let mut near: Vec<Plane> = all.iter().filter(|plane| off(plane) <= reach).copied().collect();
    near.sort_by(|a, b| off(a).total_cmp(&off(b)));
    near.truncate(2 * NEAR_POINTS);
    near
}
