//! Radii over the axis: straight lines and parts of circles.

/// Lengths that are no different, mm.
pub(crate) const SAME_MM: f64 = 1e-9;

/// A radius over x, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Curve {
    /// Through a point with a slope.
    Line { x: f64, r: f64, slope: f64 },
    /// The upper or the lower half of a circle.
    Arc { x: f64, r: f64, radius: f64, is_upper: bool },
}

impl Curve {
    /// The line through two points, of which the second lies to the right.
    pub(crate) fn through([x, r]: [f64; 2], [x1, r1]: [f64; 2]) -> Self {
        Self::Line { x, r, slope: if x1 > x { (r1 - r) / (x1 - x) } else { 0.0 } }
    }

    /// Radius at a place; beside a circle that of its end.
    pub(crate) fn at(self, at: f64) -> f64 {
        match self {
            Self::Line { x, r, slope } => r + slope * (at - x),
            Self::Arc { x, r, radius, is_upper } => {
                let half = (radius * radius - (at - x).powi(2)).max(0.0).sqrt();
                if is_upper { r + half } else { r - half }
            }
        }
    }

    /// Slope at a place inside; of a circle's end beside it.
    pub(crate) fn slope(self, at: f64) -> f64 {
        match self {
            Self::Line { slope, .. } => slope,
            Self::Arc { x, radius, is_upper, .. } => {
                let half = (radius * radius - (at - x).powi(2)).max(f64::MIN_POSITIVE).sqrt();
                if is_upper { (x - at) / half } else { (at - x) / half }
            }
        }
    }

    fn raised(self, by: f64) -> Self {
        match self {
            Self::Line { x, r, slope } => Self::Line { x, r: r + by, slope },
            Self::Arc { x, r, radius, is_upper } => Self::Arc { x, r: r + by, radius, is_upper },
        }
    }

    /// Places between two others at which it crosses another one raised by so much.
    pub(crate) fn crossings(self, other: Self, raised: f64, within: [f64; 2]) -> impl Iterator<Item = f64> {
        let other = other.raised(raised);
        let candidates = match (self, other) {
            (Self::Line { x, r, slope }, Self::Line { x: x1, r: r1, slope: s1 }) => {
                let turn = slope - s1;
                [if turn.abs() > 0.0 { (r1 - s1 * x1 - r + slope * x) / turn } else { f64::NAN }, f64::NAN]
            }
            (Self::Line { x, r, slope }, Self::Arc { x: cx, r: cr, radius, .. })
            | (Self::Arc { x: cx, r: cr, radius, .. }, Self::Line { x, r, slope }) => {
                // From the foot of the perpendicular of the centre half a chord either way.
                let length = (1.0 + slope * slope).sqrt();
                let (tx, tr) = (1.0 / length, slope / length);
                let along = (cx - x) * tx + (cr - r) * tr;
                let beside = (cr - r) * tx - (cx - x) * tr;
                let half = (radius * radius - beside * beside).max(0.0).sqrt();
                [x + (along - half) * tx, x + (along + half) * tx]
            }
            (Self::Arc { x: xa, r: ra, radius: a, .. }, Self::Arc { x: xb, r: rb, radius: b, .. }) => {
                let (dx, dr) = (xb - xa, rb - ra);
                // About one centre there are none.
                let distance = (dx * dx + dr * dr).sqrt();
                let along = 0.5 * (distance + (a * a - b * b) / distance);
                let half = (a * a - along * along).max(0.0).sqrt();
                let (tx, tr) = (dx / distance, dr / distance);
                [xa + along * tx - half * tr, xa + along * tx + half * tr]
            }
        };
        candidates.into_iter().filter(move |at| *at > within[0] + SAME_MM && *at < within[1] - SAME_MM)
    }
}

/// A curve between two places.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Piece {
    pub(crate) x0: f64,
    pub(crate) x1: f64,
    pub(crate) curve: Curve,
}

impl Piece {
    /// The largest radius, mm.
    pub(crate) fn highest(&self) -> f64 {
        let ends = self.curve.at(self.x0).max(self.curve.at(self.x1));
        match self.curve {
            Curve::Arc { x, r, radius, is_upper: true } if self.x0 < x && x < self.x1 => r + radius,
            _ => ends,
        }
    }

    /// The least radius between two places of the piece, mm.
    pub(crate) fn lowest(&self, a: f64, b: f64) -> f64 {
        match self.curve {
            Curve::Arc { x, r, radius, is_upper: false } if a < x && x < b => r - radius,
            curve => curve.at(a).min(curve.at(b)),
        }
    }

    /// As much of it as lies below a radius, of a straight one; any other is as it is.
    pub(crate) fn below(&self, radius_mm: f64) -> Self {
        let Curve::Line { x, r, slope } = self.curve else { return *self };
        let reached = x + (radius_mm - r) / slope;
        match slope {
            _ if !reached.is_finite() => *self,
            slope if slope > 0.0 => Self { x1: reached.clamp(self.x0, self.x1), ..*self },
            _ => Self { x0: reached.clamp(self.x0, self.x1), ..*self },
        }
    }

    /// Length of its path, mm.
    pub(crate) fn length(&self) -> f64 {
        match self.curve {
            Curve::Line { slope, .. } => (self.x1 - self.x0) * (1.0 + slope * slope).sqrt(),
            Curve::Arc { x, radius, .. } => {
                let angle = |at: f64| ((at - x) / radius).clamp(-1.0, 1.0).asin();
                radius * (angle(self.x1) - angle(self.x0))
            }
        }
    }
}
