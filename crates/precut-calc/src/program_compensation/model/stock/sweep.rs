//! What a tool covers on its way: the lower boundary of the sum of path and tool, as pieces of which the lowest counts.
//!
//! The tool is an upward closed convex region: a nose, an edge on either side that rises with its slope, or a wall. Every piece
//! here is the boundary of the tool at some place of its way, and together they have every lowest one, so that the least of them
//! is the envelope, exactly.

use super::curve::{Curve, Piece};

/// The region of a tool about its programmed point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Shape {
    /// Radius of the nose, mm; 0 for a corner.
    pub(crate) nose: f64,
    /// Slope of the edge on the side of the headstock; none where it is a wall.
    pub(crate) left: Option<f64>,
    /// The same on the other side.
    pub(crate) right: Option<f64>,
    /// From the programmed point to the centre of the nose: along x and r, mm.
    pub(crate) centre: [f64; 2],
}

/// A way of the programmed point between two places (x, r), mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Way {
    /// Straight.
    Line([f64; 2], [f64; 2]),
    /// About a centre, by an angle from +x toward +r at its begin and how far it turns, rad.
    Arc { centre: [f64; 2], radius: f64, from: f64, turn: f64 },
}

impl Way {
    /// Both ends.
    pub(crate) fn ends(&self) -> [[f64; 2]; 2] {
        [self.at(0.0), self.at(1.0)]
    }

    /// The place at a share of the way.
    pub(crate) fn at(&self, share: f64) -> [f64; 2] {
        match *self {
            Self::Line(from, to) => [0, 1].map(|k| from[k] + share * (to[k] - from[k])),
            Self::Arc { centre, radius, from, turn } => {
                let angle = from + share * turn;
                [centre[0] + radius * angle.cos(), centre[1] + radius * angle.sin()]
            }
        }
    }

    /// Unit vector along the way at a share of it; none where it has no length.
    pub(crate) fn direction(&self, share: f64) -> Option<[f64; 2]> {
        match *self {
            Self::Line(from, to) => {
                let (dx, dr) = (to[0] - from[0], to[1] - from[1]);
                let length = dx.hypot(dr);
                (length > 0.0).then(|| [dx / length, dr / length])
            }
            Self::Arc { from, turn, .. } => {
                let angle = from + share * turn;
                Some([-turn.signum() * angle.sin(), turn.signum() * angle.cos()])
            }
        }
    }

    /// Length, mm.
    pub(crate) fn length_mm(&self) -> f64 {
        match *self {
            Self::Line(from, to) => (to[0] - from[0]).hypot(to[1] - from[1]),
            Self::Arc { radius, turn, .. } => radius * turn.abs(),
        }
    }

    /// Whether it goes along the axis more than across it.
    pub(crate) fn is_along(&self) -> bool {
        let [from, to] = self.ends();
        (to[0] - from[0]).abs() >= (to[1] - from[1]).abs()
    }

    /// The same way farther off the axis.
    pub(crate) fn set_out(self, by_mm: f64) -> Self {
        let out = |[x, r]: [f64; 2]| [x, r + by_mm];
        match self {
            Self::Line(from, to) => Self::Line(out(from), out(to)),
            Self::Arc { centre, radius, from, turn } => Self::Arc { centre: out(centre), radius, from, turn },
        }
    }

    /// The way between two of its places, each lifted off the axis: an arc stays an arc of its radius.
    pub(crate) fn lifted(&self, [from, to]: [f64; 2], lifts_mm: [f64; 2]) -> Self {
        let lift = |share: f64, by: f64| {
            let [x, r] = self.at(share);
            [x, r + by]
        };
        let (a, b) = (lift(from, lifts_mm[0]), lift(to, lifts_mm[1]));
        let Self::Arc { radius, turn, .. } = *self else { return Self::Line(a, b) };
        let (dx, dr) = (b[0] - a[0], b[1] - a[1]);
        let chord = dx.hypot(dr);
        let height = (radius * radius - 0.25 * chord * chord).max(0.0).sqrt();
        if chord <= 0.0 || 0.5 * chord >= radius || turn.abs() * (to - from) >= std::f64::consts::PI {
            return Self::Line(a, b);
        }
        // The centre lies to the left of an arc that turns counter-clockwise.
        let side = height * turn.signum() / chord;
        let centre = [0.5 * (a[0] + b[0]) - side * dr, 0.5 * (a[1] + b[1]) + side * dx];
        let angle = |point: [f64; 2]| (point[1] - centre[1]).atan2(point[0] - centre[0]);
        let half = 2.0 * (0.5 * chord / radius).asin();
        Self::Arc { centre, radius, from: angle(a), turn: half * turn.signum() }
    }
}

/// A wall of the tool: its place, and the radius from which it stands.
pub(crate) type Wall = [f64; 2];

/// What a way leaves.
#[derive(Debug, Clone, Default)]
pub(crate) struct Swept {
    pub(crate) pieces: Vec<Piece>,
    pub(crate) walls: Vec<Wall>,
}

/// Directions that are looked at along an arc; a way straighter across the axis has no slope; slopes that are the same, 1.
const ARC_SHARES: u32 = 36;
const ACROSS: f64 = 1e-6;
const SAME_SLOPE: f64 = 1e-9;
/// An edge goes on as far as there is work, mm.
pub(super) const FAR_MM: f64 = 1e6;

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

    /// Both ends of the nose from the programmed point, at the height of its centre, mm.
    pub(super) fn sides(&self) -> [[f64; 2]; 2] {
        let [x, r] = self.centre;
        [[x - self.reach(self.left), r], [x + self.reach(self.right), r]]
    }

    fn has_slope(&self, slope: f64) -> bool {
        self.left.is_none_or(|left| slope > -left) && self.right.is_none_or(|right| slope < right)
    }

    /// How steep a way falls behind its tip where the trailing edge is flatter and cuts, deg; none where it does not.
    pub(crate) fn falls_behind(&self, way: &Way, is_left_hand: bool) -> Option<f64> {
        let trailing = if is_left_hand { self.left } else { self.right }?;
        let shares: u32 = if matches!(way, Way::Arc { .. }) { ARC_SHARES } else { 1 };
        let slopes = (0..shares).filter_map(|share| way.direction((f64::from(share) + 0.5) / f64::from(shares)));
        // Straight across the axis it is the nose that comes in.
        let slopes = slopes.filter(|[x, _]| x.abs() > ACROSS).map(|[x, r]| if is_left_hand { -r / x } else { r / x });
        let steepest = slopes.reduce(f64::max)?;
        (steepest > trailing * (1.0 + SAME_SLOPE)).then(|| steepest.atan().to_degrees())
    }

    /// The line that the tool leaves of a straight way along the axis, its ends along it, mm.
    pub(crate) fn line(&self, way: &Way) -> Option<Piece> {
        let Way::Line(from, to) = *way else { return None };
        let [a, b] = if from[0] <= to[0] { [from, to] } else { [to, from] };
        let slope = (b[1] - a[1]) / (b[0] - a[0]);
        if !slope.is_finite() || !self.has_slope(slope) {
            return None;
        }
        let by = self.support(slope);
        let ends = [a, b].map(|[x, r]| [x + by[0], r + by[1]]);
        Some(Piece { x0: ends[0][0], x1: ends[1][0], curve: Curve::through(ends[0], ends[1]) })
    }

    /// From the programmed point to the place of the surface that a feed along the axis makes; none where neither the nose nor
    /// the corner makes it.
    pub(crate) fn makes(&self, [x, r]: [f64; 2]) -> Option<[f64; 2]> {
        let slope = r / x;
        (x.abs() > ACROSS && self.has_slope(slope)).then(|| self.support(slope))
    }

    /// How far from the programmed point, along the axis, its lower boundary rises by no more than so much: toward the headstock and
    /// the other way, mm.
    pub(crate) fn extent_mm(&self, by_mm: f64) -> [f64; 2] {
        let x = self.centre[0];
        let reach = |edge: Option<f64>| self.reach(edge) + edge.map_or(0.0, |slope| by_mm / slope);
        [x - reach(self.left), x + reach(self.right)]
    }

    /// Its lower boundary over the programmed point, so far beside it along the axis, mm; none where it has none.
    pub(crate) fn height_mm(&self, beside: f64) -> Option<f64> {
        let by = beside - self.centre[0];
        let edge = if by < 0.0 { self.left } else { self.right };
        let reach = self.reach(edge);
        if by.abs() <= reach {
            return Some(self.centre[1] - (self.nose * self.nose - by * by).max(0.0).sqrt());
        }
        let slope = edge?;
        Some(self.centre[1] + self.nose * Self::below(slope)[1] + (by.abs() - reach) * slope)
    }

    /// What the way leaves.
    pub(crate) fn sweep(&self, way: &Way) -> Swept {
        // Nose and edges at both ends, and what lies between.
        let mut swept = Swept { pieces: Vec::with_capacity(8), walls: Vec::with_capacity(2) };
        match *way {
            Way::Line(from, to) => {
                self.stand(from, &mut swept);
                self.stand(to, &mut swept);
                swept.pieces.extend(self.line(way));
            }
            Way::Arc { centre, radius, from, turn } => self.sweep_arc((centre, radius), (from, turn), &mut swept),
        }
        swept
    }

    /// What straight ways leave that follow each other along the axis, one way of it: what no place of them makes alone is left out. None
    /// where a way turns back or is steeper than an edge.
    pub(crate) fn sweep_all(&self, ways: &[Way]) -> Option<Swept> {
        let line = |way: &Way| match *way {
            Way::Line(from, to) => Some([from, to]),
            Way::Arc { .. } => None,
        };
        let mut lines: Vec<[[f64; 2]; 2]> = ways.iter().map(line).collect::<Option<_>>()?;
        if lines.first().is_some_and(|[from, to]| from[0] > to[0]) {
            lines.reverse();
            for ends in &mut lines {
                ends.reverse();
            }
        }
        let slope = |[from, to]: &[[f64; 2]; 2]| (to[1] - from[1]) / (to[0] - from[0]);
        let is_smooth = lines.iter().all(|ends| ends[1][0] > ends[0][0] && self.has_slope(slope(ends)));
        let ends = lines.first().zip(lines.last()).filter(|_| is_smooth)?;
        let mut swept = Swept::default();
        self.stand(ends.0[0], &mut swept);
        self.stand(ends.1[1], &mut swept);
        swept.pieces.extend(lines.iter().filter_map(|[from, to]| self.line(&Way::Line(*from, *to))));
        // Between two lines of which the second one rises more, the nose makes what lies between.
        for pair in lines.windows(2) {
            let slopes = [slope(&pair[0]), slope(&pair[1])];
            if self.nose > 0.0 && slopes[0] < slopes[1] {
                let [x, r] = pair[1][0];
                let (cx, cr) = (x + self.centre[0], r + self.centre[1]);
                let [x0, x1] = slopes.map(|slope| cx + self.nose * Self::below(slope)[0]);
                swept.pieces.push(Piece {
                    x0,
                    x1,
                    curve: Curve::Arc { x: cx, r: cr, radius: self.nose, is_upper: false },
                });
            }
        }
        Some(swept)
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
