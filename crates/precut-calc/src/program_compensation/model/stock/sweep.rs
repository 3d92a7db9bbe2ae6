//! What a tool covers on its way: the lower boundary of the sum of path and tool, as pieces of which the lowest counts.
//!
//! The tool is an upward closed convex region: a nose, an edge on either side that rises with its slope, or a wall. Every piece
//! here is the boundary of the tool at some place of its way, and together they have every lowest one, so that the least of them
//! is the envelope, exactly.

use super::curve::{Curve, Piece};

/// The region of a tool about its programmed point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shape {
    /// Radius of the nose, mm; 0 for a corner.
    pub(super) nose: f64,
    /// Slope of the edge on the side of the headstock; none where it is a wall.
    pub(super) left: Option<f64>,
    /// The same on the other side.
    pub(super) right: Option<f64>,
    /// From the programmed point to the centre of the nose: along x and r, mm.
    pub(super) centre: [f64; 2],
}

/// A way of the programmed point between two places (x, r), mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Way {
    /// Straight.
    Line([f64; 2], [f64; 2]),
    /// About a centre, by an angle from +x toward +r at its begin and how far it turns, rad.
    Arc { centre: [f64; 2], radius: f64, from: f64, turn: f64 },
}

/// A wall of the tool: its place, and the radius from which it stands.
pub(super) type Wall = [f64; 2];

/// What a way leaves.
#[derive(Debug, Clone, Default)]
pub(super) struct Swept {
    pub(super) pieces: Vec<Piece>,
    pub(super) walls: Vec<Wall>,
}

/// An edge goes on as far as there is work, mm.
const FAR_MM: f64 = 1e6;

impl Shape {
    /// Unit normal below the nose where its slope is this: along x and r.
    fn below(slope: f64) -> [f64; 2] {
        let length = (1.0 + slope * slope).sqrt();
        [slope / length, -1.0 / length]
    }

    /// End of the nose toward a side, from its centre along x.
    fn reach(&self, edge: Option<f64>) -> f64 {
        self.nose * edge.map_or(1.0, |slope| Self::below(slope)[0])
    }

    fn has_slope(&self, slope: f64) -> bool {
        self.left.is_none_or(|left| slope > -left) && self.right.is_none_or(|right| slope < right)
    }

    /// What the way leaves.
    pub(super) fn sweep(&self, way: &Way) -> Swept {
        let mut swept = Swept::default();
        match *way {
            Way::Line(from, to) => {
                self.stand(from, &mut swept);
                self.stand(to, &mut swept);
                let (a, b) = if from[0] <= to[0] { (from, to) } else { (to, from) };
                let slope = (b[1] - a[1]) / (b[0] - a[0]);
                if slope.is_finite() && self.has_slope(slope) {
                    let by = self.support(slope);
                    let ends = [a, b].map(|[x, r]| [x + by[0], r + by[1]]);
                    swept.pieces.push(Piece {
                        x0: ends[0][0],
                        x1: ends[1][0],
                        curve: Curve::through(ends[0], ends[1]),
                    });
                }
            }
            Way::Arc { centre, radius, from, turn } => self.sweep_arc((centre, radius), (from, turn), &mut swept),
        }
        swept
    }

    /// From the programmed point to what cuts where the slope is this.
    fn support(&self, slope: f64) -> [f64; 2] {
        let below = Self::below(slope);
        [self.centre[0] + self.nose * below[0], self.centre[1] + self.nose * below[1]]
    }

    /// The tool at one place.
    fn stand(&self, [x, r]: [f64; 2], swept: &mut Swept) {
        let (cx, cr) = (x + self.centre[0], r + self.centre[1]);
        let (left, right) = (cx - self.reach(self.left), cx + self.reach(self.right));
        if self.nose > 0.0 {
            let curve = Curve::Arc { x: cx, r: cr, radius: self.nose, is_upper: false };
            swept.pieces.push(Piece { x0: left, x1: right, curve });
        }
        for (edge, at, side) in [(self.left, left, -1.0), (self.right, right, 1.0)] {
            match edge {
                Some(slope) => {
                    let low = cr + self.nose * Self::below(slope)[1];
                    let (x0, x1) = if side < 0.0 { (at - FAR_MM, at) } else { (at, at + FAR_MM) };
                    swept.pieces.push(Piece { x0, x1, curve: Curve::Line { x: at, r: low, slope: side * slope } });
                }
                None => swept.walls.push([at, cr]),
            }
        }
    }

    fn sweep_arc(&self, (centre, radius): ([f64; 2], f64), (from, turn): (f64, f64), swept: &mut Swept) {
        let point = |angle: f64| [centre[0] + radius * angle.cos(), centre[1] + radius * angle.sin()];
        // The slope of the path is infinite at its left and right ends, and that of an edge in between.
        let half = std::f64::consts::PI;
        let mut marks = vec![0.0, half];
        for slope in [self.left.map(|left| -left), self.right].into_iter().flatten() {
            // Tangent of slope m: the normal points by atan2(1, -m) or against it.
            let angle = 1.0_f64.atan2(-slope);
            marks.extend([angle, angle - half]);
        }
        let (low, high) = if turn >= 0.0 { (from, from + turn) } else { (from + turn, from) };
        let mut cuts: Vec<f64> = vec![low, high];
        for mark in marks {
            let first = ((low - mark) / (2.0 * half)).ceil();
            cuts.extend((0..2).map(|k| mark + (first + f64::from(k)) * 2.0 * half).filter(|&at| at > low && at < high));
        }
        cuts.sort_by(f64::total_cmp);
        for &at in &cuts {
            self.stand(point(at), swept);
        }
        for pair in cuts.windows(2) {
            let middle = 0.5 * (pair[0] + pair[1]);
            let is_upper = middle.sin() > 0.0;
            let slope = -middle.cos() / middle.sin();
            if !slope.is_finite() || !self.has_slope(slope) {
                continue;
            }
            // The nose runs inside the upper half of a circle and outside its lower one.
            let radius = if is_upper { radius - self.nose } else { radius + self.nose };
            if radius <= 0.0 {
                continue;
            }
            let (x, r) = (centre[0] + self.centre[0], centre[1] + self.centre[1]);
            let ends = [pair[0], pair[1]].map(|at| x + radius * at.cos());
            swept.pieces.push(Piece {
                x0: ends[0].min(ends[1]),
                x1: ends[0].max(ends[1]),
                curve: Curve::Arc { x, r, radius, is_upper },
            });
        }
    }
}
