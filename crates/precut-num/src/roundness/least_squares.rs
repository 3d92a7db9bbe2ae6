//! The least-squares reference circle, LSCI.

use super::section::{count, mean, square};
use super::{Circle, RoundnessError, Section, Span, look};

/// Least-squares circle and the parameters that are defined about it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeastSquares {
    /// The circle.
    pub circle: Circle,
    /// Nearest and farthest point from its centre; RONt is [`Span::width_mm`].
    pub span: Span,
    /// RONp, largest distance beyond the circle, mm.
    pub peak_mm: f64,
    /// RONv, largest distance inside the circle, mm, not negative.
    pub valley_mm: f64,
    /// RONq, root mean square of the deviations, mm.
    pub rms_mm: f64,
    /// Bound of the round-off in the centre, mm; it grows where the points cover a short arc.
    pub centre_error_mm: f64,
    /// Steps taken.
    pub iterations: u32,
}

/// Steps after which the search is given up; 90° arcs with large residuals take about ten.
const MOST_ITERATIONS: u32 = 100;
/// Steps by Gauss-Newton alone before the second derivatives of the distances come in.
const FIRST_ORDER_ITERATIONS: u32 = 3;
/// Points are on a straight line where they spread across it by less than the square root of this, relative.
const FLATTEST: f64 = 1e-14;
/// Share of a step below which halving is given up.
const SHORTEST_SHARE: f64 = 1e-6;
/// Round-off of one distance in units of the last place of the largest: two differences, two squares, sum, root.
const DISTANCE_ULPS: f64 = 4.0;

/// The circle with the least sum of squared *distances* from the points (`roundness/3.1`), at least three points.
///
/// Gauss-Newton from the algebraic circle, Newton where it is slow (large residuals on short arcs), each step halved
/// until the sum falls; no linearisation in the eccentricity (limaçon) is left in the result. On the NIST reference
/// circles the centre is right to 2e-13 mm.
pub fn least_squares(section: &Section, goes_on: &dyn Fn() -> bool) -> Result<LeastSquares, RoundnessError> {
    if section.len() < 3 {
        return Err(RoundnessError::TooFewPoints { count: section.len(), needed: 3 });
    }
    let (mut centre, radius) = algebraic(section)?;
    let mut here = Referred::of(section, centre, radius);
    for iteration in 1..=MOST_ITERATIONS {
        look(goes_on)?;
        let normal = here.sums.normal();
        let smallest = normal.smaller_eigenvalue();
        // Also refuses what is no number.
        let spread = smallest > FLATTEST * here.sums.n;
        if !spread {
            return Err(RoundnessError::NoCircle);
        }
        let condition = here.sums.n / smallest;
        let mut shift = normal.solve(here.sums.descent());
        if iteration > FIRST_ORDER_ITERATIONS {
            let full = normal.plus(bending(section, centre, here.radius));
            if full.smaller_eigenvalue() > 0.0 && full.xx > 0.0 {
                shift = full.solve(here.sums.descent());
            }
        }
        let length = square(shift).sqrt();
        let resolution = f64::EPSILON * here.radius * condition;
        // Length of the next step: what Gauss-Newton leaves is of second order in shift and residual.
        let next = length * (length + here.sums.variance().sqrt()) / here.radius * condition;
        if next <= resolution {
            centre = [centre[0] + shift[0], centre[1] + shift[1]];
            return Ok(finished(section, centre, here.radius, condition, iteration));
        }
        let Some(moved) = descend(section, centre, &here, shift) else {
            // No shorter step lowers the sum: it is at its least as far as numbers tell, if the step is so short that
            // it changes the sum by its round-off only.
            if length * length <= resolution * here.radius {
                return Ok(finished(section, centre, here.radius, condition, iteration));
            }
            return Err(RoundnessError::NotConverged { iterations: iteration, left_mm: length });
        };
        (centre, here) = moved;
    }
    Err(RoundnessError::NotConverged { iterations: MOST_ITERATIONS, left_mm: here.sums.variance().sqrt() })
}

/// Sums about a centre with the mean distance as radius.
struct Referred {
    radius: f64,
    sums: Sums,
}

impl Referred {
    fn of(section: &Section, centre: [f64; 2], guess: f64) -> Self {
        let mut sums = Sums::of(section, centre, guess);
        let more = sums.mean();
        sums.refer(more);
        Self { radius: guess + more, sums }
    }
}

/// The step, halved until the sum of squares is not above the present one.
fn descend(section: &Section, centre: [f64; 2], here: &Referred, shift: [f64; 2]) -> Option<([f64; 2], Referred)> {
    // Round-off of the sum: a distance is known to some units of its last place.
    let unit = DISTANCE_ULPS * f64::EPSILON * here.radius;
    let limit = here.sums.variance() * (1.0 + 1e-12) + unit * unit;
    let mut share = 1.0;
    while share > SHORTEST_SHARE {
        let trial = [centre[0] + share * shift[0], centre[1] + share * shift[1]];
        let there = Referred::of(section, trial, here.radius);
        if there.sums.variance() <= limit {
            return Some((trial, there));
        }
        share *= 0.5;
    }
    None
}

/// Radius, extremes and root mean square about the final centre.
fn finished(section: &Section, centre: [f64; 2], guess: f64, condition: f64, iterations: u32) -> LeastSquares {
    let sums = Referred::of(section, centre, guess);
    let (radius, rms_mm) = (sums.radius, sums.sums.variance().sqrt());
    let span = section.span_inside(centre);
    LeastSquares {
        circle: Circle { centre_mm: section.outside(centre), radius_mm: radius },
        span,
        peak_mm: (span.farthest_mm - radius).max(0.0),
        valley_mm: (radius - span.nearest_mm).max(0.0),
        rms_mm,
        centre_error_mm: DISTANCE_ULPS * f64::EPSILON * span.farthest_mm * condition,
        iterations,
    }
}

/// The algebraic circle: least Σ(|p−c|² − r²)², linear in its unknowns. About the centroid.
fn algebraic(section: &Section) -> Result<([f64; 2], f64), RoundnessError> {
    let middle = [mean(&section.x_mm), mean(&section.y_mm)];
    let n = count(section.len());
    let [mut xx, mut xy, mut yy, mut xz, mut yz] = [0.0; 5];
    for index in 0..section.len() {
        let [x, y] = section.from(middle, index);
        let z = x * x + y * y;
        xx += x * x;
        xy += x * y;
        yy += y * y;
        xz += x * z;
        yz += y * z;
    }
    let determinant = xx * yy - xy * xy;
    let trace = xx + yy;
    // With this the negated comparison also refuses coincident points (0 > 0).
    if determinant <= FLATTEST * trace * trace || trace <= 0.0 {
        return Err(RoundnessError::NoCircle);
    }
    let shift = [0.5 * (xz * yy - yz * xy) / determinant, 0.5 * (yz * xx - xz * xy) / determinant];
    let radius = (square(shift) + trace / n).sqrt();
    Ok(([middle[0] + shift[0], middle[1] + shift[1]], radius))
}

/// Sums over the points about a centre; deviations e = d − radius, unit vectors u from the centre to the points.
struct Sums {
    n: f64,
    e: f64,
    ee: f64,
    u: [f64; 2],
    eu: [f64; 2],
    uxx: f64,
    uxy: f64,
}

/// Width of the accumulators: two numbers fit the narrowest vector unit.
const LANES: usize = 2;

impl Sums {
    /// One pass over the points.
    fn of(section: &Section, [cx, cy]: [f64; 2], radius: f64) -> Self {
        let mut lanes = [[0.0_f64; LANES]; 8];
        let (x_lanes, x_rest) = section.x_mm.as_chunks::<LANES>();
        let (y_lanes, y_rest) = section.y_mm.as_chunks::<LANES>();
        for (x, y) in x_lanes.iter().zip(y_lanes) {
            for lane in 0..LANES {
                for (sum, term) in lanes.iter_mut().zip(terms(x[lane] - cx, y[lane] - cy, radius)) {
                    sum[lane] += term;
                }
            }
        }
        for (x, y) in x_rest.iter().zip(y_rest) {
            for (sum, term) in lanes.iter_mut().zip(terms(x - cx, y - cy, radius)) {
                sum[0] += term;
            }
        }
        let [e, ee, ux, uy, eux, euy, uxx, uxy] = lanes.map(|sum| sum.iter().sum::<f64>());
        Self { n: count(section.len()), e, ee, u: [ux, uy], eu: [eux, euy], uxx, uxy }
    }

    /// Mean deviation.
    fn mean(&self) -> f64 {
        self.e / self.n
    }

    /// Mean square of the deviations about their mean.
    fn variance(&self) -> f64 {
        (self.ee / self.n - self.mean() * self.mean()).max(0.0)
    }

    /// The same sums of deviations from a radius larger by `more`.
    fn refer(&mut self, more: f64) {
        self.ee += more * (self.n * more - 2.0 * self.e);
        self.e -= self.n * more;
        self.eu = [self.eu[0] - more * self.u[0], self.eu[1] - more * self.u[1]];
    }

    /// Falling direction of half the sum of squares: Σ(e − ē)u.
    fn descent(&self) -> [f64; 2] {
        [self.eu[0] - self.mean() * self.u[0], self.eu[1] - self.mean() * self.u[1]]
    }

    /// Normal matrix Σ(u − ū)(u − ū)'.
    fn normal(&self) -> Symmetric {
        Symmetric {
            xx: self.uxx - self.u[0] * self.u[0] / self.n,
            xy: self.uxy - self.u[0] * self.u[1] / self.n,
            yy: (self.n - self.uxx) - self.u[1] * self.u[1] / self.n,
        }
    }
}

/// What one point adds: e, e², u, e·u, and the first row of uu'.
fn terms(x: f64, y: f64, radius: f64) -> [f64; 8] {
    let d = (x * x + y * y).sqrt();
    let inverse = 1.0 / d.max(f64::MIN_POSITIVE);
    let (ux, uy, e) = (x * inverse, y * inverse, d - radius);
    [e, e * e, ux, uy, e * ux, e * uy, ux * ux, ux * uy]
}

/// What the second derivatives of the distances add to the normal matrix: Σ e/d·(1 − uu').
fn bending(section: &Section, centre: [f64; 2], radius: f64) -> Symmetric {
    let mut sum = Symmetric { xx: 0.0, xy: 0.0, yy: 0.0 };
    for index in 0..section.len() {
        let [x, y] = section.from(centre, index);
        let d = (x * x + y * y).sqrt().max(f64::MIN_POSITIVE);
        let weight = (d - radius) / (d * d * d);
        sum.xx += weight * y * y;
        sum.xy -= weight * x * y;
        sum.yy += weight * x * x;
    }
    sum
}

/// A symmetric matrix of two rows.
#[derive(Clone, Copy)]
struct Symmetric {
    xx: f64,
    xy: f64,
    yy: f64,
}

impl Symmetric {
    fn plus(self, other: Self) -> Self {
        Self { xx: self.xx + other.xx, xy: self.xy + other.xy, yy: self.yy + other.yy }
    }

    fn determinant(self) -> f64 {
        self.xx * self.yy - self.xy * self.xy
    }

    /// The smaller eigenvalue, without cancellation.
    fn smaller_eigenvalue(self) -> f64 {
        let half = 0.5 * (self.xx + self.yy);
        let root = (0.25 * (self.xx - self.yy) * (self.xx - self.yy) + self.xy * self.xy).sqrt();
        self.determinant() / (half + root)
    }

    fn solve(self, [x, y]: [f64; 2]) -> [f64; 2] {
        let determinant = self.determinant();
        [(self.yy * x - self.xy * y) / determinant, (self.xx * y - self.xy * x) / determinant]
    }
}
