//! How much of a tool is in the stock: from the point that makes the surface along nose and edge on the side of the feed to where
//! they leave the stock (`program/4.2`).

use std::f64::consts::{FRAC_PI_2, PI};

use super::super::super::job::ProgramTool;
use super::super::stock::{Curve, Shape};
use super::near::Near;

/// The outline is laid so far ahead along the feed: what the move before has just made is not stock ahead, mm.
const AHEAD_MM: f64 = 1e-6;
/// No edge is longer, mm.
const LONGEST_MM: f64 = 1e4;
/// So far beside the outline stock is looked at, mm.
const NEAR_MM: f64 = 1e-6;
/// As many marks along an outline take no second allocation.
const MARKS: usize = 64;
/// A point beside the outline by a larger share of its distance is not on it, whatever rounding does, 1.
const BESIDE: f64 = 1e-9;
/// A direction this flat is none, 1.
const FLAT: f64 = 1e-12;

/// Nose and edge on the side of the feed, for one direction of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Outline {
    /// Direction of the feed: along x and r.
    pub(crate) feed: [f64; 2],
    /// Normal of the surface that is made, into the work.
    pub(crate) normal: [f64; 2],
    /// From the normal to the edge on the side of the feed, rad.
    pub(crate) lead: f64,
    /// Angle of the normal, rad, and which way the outline turns from there.
    from: f64,
    sense: f64,
    nose: f64,
    centre: [f64; 2],
    /// Direction from the centre of the nose to where the edge begins, and which way the edge goes.
    at_edge: [f64; 2],
    along: [f64; 2],
}

/// What of an outline is in the stock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Engaged {
    /// Extent against the normal, mm; 0 where nothing is.
    pub(crate) depth_mm: f64,
    /// Radius at which it leaves the stock, mm.
    pub(crate) outer_radius_mm: f64,
}

fn unit(angle: f64) -> [f64; 2] {
    [angle.cos(), angle.sin()]
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

impl Outline {
    /// Of a tool that is fed in a direction; none where it does not cut with this side: the edge rubs or stands off.
    pub(crate) fn of(tool: &ProgramTool, shape: &Shape, feed: [f64; 2]) -> Option<Self> {
        let is_left_hand = tool.tip_direction == 4;
        let (leading, trailing) = (tool.cutting_edge_angle_deg.to_radians(), tool.minor_edge_angle_deg.to_radians());
        let (left, right) = if is_left_hand { (trailing, leading) } else { (leading, trailing) };
        let normal = normal(feed, tool.tip_direction)?;
        let mut from = normal[1].atan2(normal[0]);
        if from > FRAC_PI_2 {
            from -= 2.0 * PI;
        }
        let sense = if normal[0] * feed[1] - normal[1] * feed[0] < 0.0 { -1.0 } else { 1.0 };
        let lead = if sense < 0.0 { from + FRAC_PI_2 + left } else { right - FRAC_PI_2 - from };
        let at_edge = unit(from + sense * lead);
        (lead > FLAT && lead < PI).then_some(Self {
            feed,
            normal,
            lead,
            from,
            sense,
            nose: shape.nose,
            centre: shape.centre,
            at_edge,
            along: [-sense * at_edge[1], sense * at_edge[0]],
        })
    }

    /// What is in the stock with the programmed point at a place.
    pub(crate) fn engaged(&self, stock: &Near<'_>, [x, r]: [f64; 2]) -> Engaged {
        let centre = [x + self.centre[0] + AHEAD_MM * self.feed[0], r + self.centre[1] + AHEAD_MM * self.feed[1]];
        let tip = [centre[0] + self.nose * self.normal[0], centre[1] + self.nose * self.normal[1]];
        let mut placed = Placed::of(self, centre, stock);
        placed.end_above(stock);
        let mut marks = Vec::with_capacity(MARKS);
        marks.extend([0.0, placed.end]);
        placed.crossings(stock, &mut marks);
        marks.retain(|mark| (0.0..=placed.end).contains(mark));
        marks.sort_unstable_by(f64::total_cmp);
        let is_inside = |pair: &&[f64]| {
            let [px, pr] = placed.at(0.5 * (pair[0] + pair[1]));
            pair[1] - pair[0] > FLAT && stock_at(stock, px).is_some_and(|radius| pr < radius)
        };
        let none = Engaged { depth_mm: 0.0, outer_radius_mm: tip[1].max(0.0) };
        let Some(last) = marks.windows(2).rev().find(is_inside) else { return none };
        let out = placed.at(last[1]);
        let depth_mm = -dot(self.normal, [out[0] - tip[0], out[1] - tip[1]]);
        Engaged { depth_mm: depth_mm.max(0.0), outer_radius_mm: out[1].max(tip[1]).max(0.0) }
    }
}

/// The unit normal with a part toward the axis; of a move straight across the axis that to the side of the tip.
fn normal(feed: [f64; 2], tip_direction: u8) -> Option<[f64; 2]> {
    if feed[0].abs() > FLAT {
        let side = -feed[0].signum();
        return Some([side * -feed[1], side * feed[0]]).map(|n| if n[1] < 0.0 { n } else { [-n[0], -n[1]] });
    }
    match tip_direction {
        3 => Some([-1.0, 0.0]),
        4 => Some([1.0, 0.0]),
        // A nose that plunges makes its surface only at the end.
        _ => None,
    }
}

/// Radius of the stock over a place; none beside it.
fn stock_at(stock: &Near<'_>, x: f64) -> Option<f64> {
    let parts = stock.parts_between(x - FLAT, x + FLAT);
    parts.map(|part| part.piece.curve.at(x)).reduce(f64::max)
}

/// An outline at a place, by the length along it from the point that makes the surface.
struct Placed {
    centre: [f64; 2],
    nose: f64,
    from: f64,
    sense: f64,
    lead: f64,
    /// Where the edge begins and which way it goes.
    edge: [f64; 2],
    along: [f64; 2],
    end: f64,
    /// Directions from the centre of the nose to both of its ends.
    ends: [[f64; 2]; 2],
}

impl Placed {
    fn of(outline: &Outline, centre: [f64; 2], stock: &Near<'_>) -> Self {
        let Outline { nose, from, sense, lead, at_edge, along, .. } = *outline;
        let edge = [centre[0] + nose * at_edge[0], centre[1] + nose * at_edge[1]];
        let [first_x, last_x] = stock.ends();
        let mut length = LONGEST_MM;
        if along[1] > FLAT {
            length = length.min((stock.highest() - edge[1]).max(0.0) / along[1]);
        }
        if along[0] > FLAT {
            length = length.min((last_x - edge[0]).max(0.0) / along[0]);
        } else if along[0] < -FLAT {
            length = length.min((first_x - edge[0]).min(0.0) / along[0]);
        }
        let ends = [outline.normal, at_edge];
        Self { centre, nose, from, sense, lead, edge, along, end: nose * lead + length + 1e-3, ends }
    }

    fn at(&self, length: f64) -> [f64; 2] {
        let of_nose = self.nose * self.lead;
        if length < of_nose {
            let direction = unit(self.from + self.sense * length / self.nose);
            return [self.centre[0] + self.nose * direction[0], self.centre[1] + self.nose * direction[1]];
        }
        let beyond = length - of_nose;
        [self.edge[0] + beyond * self.along[0], self.edge[1] + beyond * self.along[1]]
    }

    /// Ends the outline where it has come above all stock that it reaches: what lies beyond is in none.
    fn end_above(&mut self, stock: &Near<'_>) {
        let ([low, high], _) = self.extent();
        let highest = stock.parts_between(low, high).map(|part| part.piece.highest()).fold(0.0, f64::max) + NEAR_MM;
        let of_nose = self.nose * self.lead;
        if self.along[1] <= FLAT {
            return;
        }
        if self.edge[1] < highest {
            self.end = self.end.min(of_nose + (highest - self.edge[1]) / self.along[1]);
            return;
        }
        self.end = of_nose;
        // From the lowest point of the nose on it only rises.
        let below = self.centre[1] - highest;
        let lowest = self.sense_to(-FRAC_PI_2);
        let lowest = if lowest > PI { lowest - 2.0 * PI } else { lowest };
        if below > 0.0 && below < self.nose && lowest < self.lead {
            self.end = self.end.min(self.nose * (lowest + (below / self.nose).acos())).max(0.0);
        }
    }

    /// Both ends of the outline along the axis, and its lowest radius. What lies beside it, as all that the moves before have made
    /// behind the tip, or below it, is not looked at.
    fn extent(&self) -> ([f64; 2], f64) {
        let is_on_nose = self.end < self.nose * self.lead;
        let last = self.at(self.end);
        let (mut low, mut high, mut lowest) = (f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY);
        for [x, r] in [self.at(0.0), if is_on_nose { last } else { self.edge }, last] {
            (low, high, lowest) = (low.min(x), high.max(x), lowest.min(r));
        }
        // The nose goes on to its ends along the axis and to its lowest point, where the outline comes by them.
        let turned = if is_on_nose { self.end / self.nose } else { self.lead };
        let has = |angle: f64| self.sense_to(angle) < turned;
        if has(PI) {
            low = low.min(self.centre[0] - self.nose);
        }
        if has(0.0) {
            high = high.max(self.centre[0] + self.nose);
        }
        if has(-FRAC_PI_2) {
            lowest = lowest.min(self.centre[1] - self.nose);
        }
        ([low - NEAR_MM, high + NEAR_MM], lowest - NEAR_MM)
    }

    /// How far the outline has turned at an angle, rad.
    fn sense_to(&self, angle: f64) -> f64 {
        (self.sense * (angle - self.from)).rem_euclid(2.0 * PI)
    }

    /// Lengths at which the outline may go into the stock or out of it.
    fn crossings(&self, stock: &Near<'_>, into: &mut Vec<f64>) {
        let ([low, high], lowest) = self.extent();
        into.push(self.nose * self.lead);
        let mut last = f64::NEG_INFINITY;
        for part in stock.parts_between(low, high).filter(|part| part.piece.highest() >= lowest) {
            let piece = part.piece;
            // Where the part before ends, it has been looked at.
            for x in [piece.x0, piece.x1] {
                if x > last {
                    self.at_place(x, into);
                }
                last = last.max(x);
            }
            self.at_curve(piece.curve, into);
            let within = [piece.x0, piece.x1];
            if self.nose > 0.0 {
                // Its other half has the same crossings.
                let [x, r] = self.centre;
                let nose = Curve::Arc { x, r, radius: self.nose, is_upper: false };
                for x in nose.crossings(piece.curve, 0.0, within) {
                    self.push_angle([x, piece.curve.at(x)], into);
                }
            }
            if self.along[0].abs() > FLAT {
                let slope = self.along[1] / self.along[0];
                let edge = Curve::Line { x: self.edge[0], r: self.edge[1], slope };
                let lengths = edge.crossings(piece.curve, 0.0, within);
                into.extend(lengths.map(|x| self.nose * self.lead + (x - self.edge[0]) / self.along[0]));
            }
        }
    }

    /// Where the outline passes a place along the axis.
    fn at_place(&self, x: f64, into: &mut Vec<f64>) {
        let beside = x - self.centre[0];
        if beside.abs() < self.nose {
            let half = (self.nose * self.nose - beside * beside).sqrt();
            for r in [self.centre[1] - half, self.centre[1] + half] {
                self.push_angle([x, r], into);
            }
        }
        if self.along[0].abs() > FLAT {
            into.push(self.nose * self.lead + (x - self.edge[0]) / self.along[0]);
        }
    }

    /// Where an edge that stands on the axis passes a curve.
    fn at_curve(&self, curve: Curve, into: &mut Vec<f64>) {
        if self.along[1].abs() > FLAT && self.along[0].abs() <= 1e-3 {
            into.push(self.nose * self.lead + (curve.at(self.edge[0]) - self.edge[1]) / self.along[1]);
        }
    }

    fn push_angle(&self, point: [f64; 2], into: &mut Vec<f64>) {
        let to = [point[0] - self.centre[0], point[1] - self.centre[1]];
        // An outline turns by less than half a circle: most points are seen to be none of its nose without their angle.
        let beside = |a: [f64; 2], b: [f64; 2]| self.sense * (a[0] * b[1] - a[1] * b[0]) < -BESIDE * self.nose;
        if beside(self.ends[0], to) || beside(to, self.ends[1]) {
            return;
        }
        let angle = to[1].atan2(to[0]);
        let turned = self.sense_to(angle);
        if turned < self.lead {
            into.push(self.nose * turned);
        }
    }
}
