//! Where the edges of a tool end, and what of it is in the work beyond them (`program/3`).

use std::f64::consts::PI;

use super::super::super::job::ProgramTool;
use super::chain::Chain;
use super::curve::{Curve, Piece};
use super::sweep::{FAR_MM, Shape, Way};

/// A direction this flat is none, 1.
const FLAT: f64 = 1e-12;
/// A way straight across the axis is looked at over so much beside it, mm.
const BESIDE_MM: f64 = 1e-6;

/// Ends of both edges from the programmed point, along x and r: on the side of the headstock and on the other one, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct EdgeEnds([[f64; 2]; 2]);

impl EdgeEnds {
    /// Of a tool whose edges have a length: it counts from the corner that they would have without a nose, as in ISO 1832.
    pub(crate) fn of(tool: &ProgramTool, shape: &Shape) -> Option<Self> {
        let length_mm = tool.edge_length_mm?;
        let (leading, trailing) = (tool.cutting_edge_angle_deg.to_radians(), tool.minor_edge_angle_deg.to_radians());
        let (left, right) = if tool.tip_direction == 4 { (trailing, leading) } else { (leading, trailing) };
        let between = PI - left - right;
        // From the corner to where the nose ends.
        let of_nose = if between > FLAT { shape.nose / (0.5 * between).tan() } else { 0.0 };
        let straight = (length_mm - of_nose).max(0.0);
        let end = |side: f64, angle: f64| {
            let (x, r) =
                (shape.nose * angle.sin() + straight * angle.cos(), straight * angle.sin() - shape.nose * angle.cos());
            [shape.centre[0] + side * x, shape.centre[1] + r]
        };
        Some(Self([end(-1.0, left), end(1.0, right)]))
    }

    /// What a tool covers on its way that ends where its edges do, as pieces of which the lowest counts. Where a way is steeper than an
    /// edge, that counts as far as any place of the way brings it.
    pub(crate) fn covered(&self, shape: &Shape, way: &Way) -> Vec<Piece> {
        let [mut low, mut high] = [f64::INFINITY, f64::NEG_INFINITY];
        for point in self.0.into_iter().chain(shape.sides()) {
            for (path, _) in path_of(way, point) {
                (low, high) = (low.min(path.x0), high.max(path.x1));
            }
        }
        let clipped = |piece: Piece| Piece { x0: piece.x0.max(low), x1: piece.x1.min(high), ..piece };
        shape.sweep(way).pieces.into_iter().map(clipped).filter(|piece| piece.x1 > piece.x0).collect()
    }

    /// How high stock stands above the end of the edge that leads along a way, mm; below 0 it stays clear.
    pub(crate) fn beyond_mm(&self, tip_direction: u8, shape: &Shape, way: &Way, stock: &mut Chain) -> f64 {
        let mut highest = f64::NEG_INFINITY;
        for (side, (&end, slope)) in self.0.iter().zip([shape.left, shape.right]).enumerate() {
            for (path, direction) in path_of(way, end) {
                if leads(direction, tip_direction) != Some(side) {
                    continue;
                }
                let rays = slope.map(|slope| rays(&path, side, slope)).into_iter().flatten();
                for piece in rays.chain([path]) {
                    highest = highest.max(stock.depth(&piece));
                }
            }
        }
        highest
    }
}

/// The side of the edge that meets the work: that of the feed along the axis; straight across it the one beside the tip inward, the
/// tip's own outward.
fn leads([x, r]: [f64; 2], tip_direction: u8) -> Option<usize> {
    if x.abs() > FLAT {
        return Some(usize::from(x > 0.0));
    }
    match tip_direction {
        3 => Some(usize::from(r < 0.0)),
        4 => Some(usize::from(r > 0.0)),
        _ => None,
    }
}

/// The path of a point of the tool, as curves over the axis with the direction in the middle of each.
fn path_of(way: &Way, [x, r]: [f64; 2]) -> Vec<(Piece, [f64; 2])> {
    match *way {
        Way::Line(from, to) => {
            let Some(direction) = way.direction(0.5) else { return Vec::new() };
            let [a, b] = if from[0] <= to[0] { [from, to] } else { [to, from] };
            let piece = if b[0] - a[0] > BESIDE_MM {
                let ends = [[a[0] + x, a[1] + r], [b[0] + x, b[1] + r]];
                Piece { x0: ends[0][0], x1: ends[1][0], curve: Curve::through(ends[0], ends[1]) }
            } else {
                let lowest = Curve::Line { x: a[0] + x, r: a[1].min(b[1]) + r, slope: 0.0 };
                Piece { x0: a[0] + x - BESIDE_MM, x1: a[0] + x + BESIDE_MM, curve: lowest }
            };
            vec![(piece, direction)]
        }
        Way::Arc { centre, radius, from, turn } => {
            let (low, high) = if turn >= 0.0 { (from, from + turn) } else { (from + turn, from) };
            // Over the axis a circle has an upper and a lower half.
            let first = (low / PI).floor() + 1.0;
            let inner = (0..3).map(|k| (first + f64::from(k)) * PI).filter(|&at| at > low && at < high);
            let cuts: Vec<f64> = [low].into_iter().chain(inner).chain([high]).collect();
            let half = |ends: &[f64]| {
                let middle = 0.5 * (ends[0] + ends[1]);
                let along = [0, 1].map(|k| centre[0] + x + radius * ends[k].cos());
                let curve = Curve::Arc { x: centre[0] + x, r: centre[1] + r, radius, is_upper: middle.sin() > 0.0 };
                let piece = Piece { x0: along[0].min(along[1]), x1: along[0].max(along[1]), curve };
                (piece, [-turn.signum() * middle.sin(), turn.signum() * middle.cos()])
            };
            cuts.windows(2).map(half).collect()
        }
    }
}

/// What lies beyond an edge that rises with a slope, from both ends of the path of its end on.
fn rays(path: &Piece, side: usize, slope: f64) -> [Piece; 2] {
    [path.x0, path.x1].map(|x| {
        let r = path.curve.at(x);
        if side == 0 {
            Piece { x0: x - FAR_MM, x1: x, curve: Curve::Line { x, r, slope: -slope } }
        } else {
            Piece { x0: x, x1: x + FAR_MM, curve: Curve::Line { x, r, slope } }
        }
    })
}
