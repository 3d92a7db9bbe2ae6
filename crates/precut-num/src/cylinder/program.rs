//! A linear programme in few unknowns and many rows, by the dual simplex method.

use nalgebra::{Matrix6, Vector6};

/// Unknowns: four of the axis, then the limit from above and that from below.
pub(super) const UNKNOWNS: usize = 6;
/// Ties are broken by a cost that changes no value by more than rounding.
const TIE: f64 = 1e-10;
/// A row that depends on those of the basis.
const DEPENDENT: f64 = 1e-11;
const MOST_ROUNDS: usize = 2000;
/// Rounds without gain after which what is violated is rounding. The value is a bound from below in every round.
const STALLED: usize = 40;

/// `rise · x[..4] + value`, which must stay below `x[4]` or above `x[5]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Plane {
    pub(super) rise: [f64; 4],
    pub(super) value: f64,
}

/// Lower one limit, raise the other, or bring both together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Sides {
    pub(super) above: bool,
    pub(super) below: bool,
}

/// Of a programme that was solved.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Solved {
    pub(super) step: [f64; 4],
    /// The least that (limit from above) - (limit from below) can be; of one side alone with its sign.
    pub(super) least: f64,
    /// Planes that hold the limit from above, and that from below.
    pub(super) held: [Vec<usize>; 2],
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Row {
    Low(usize),
    High(usize),
    Below(usize),
    Above(usize),
}

/// Minimises x4 - x5 over `low <= x[..4] <= high` and the planes between the limits. `None` where rounding stops it.
///
/// Starts from a corner of a box, whose multipliers are positive whatever the planes are; each round lets in the plane
/// that is violated most and lets one row out such that the multipliers stay positive. The value rises to the least one.
pub(super) fn solve(planes: &[Plane], sides: Sides, low: [f64; 4], high: [f64; 4]) -> Option<Solved> {
    let reach = (0..4).map(|k| low[k].abs().max(high[k].abs())).fold(0.0, f64::max);
    let most = planes.iter().map(|plane| plane.value.abs()).fold(0.0, f64::max);
    let wide = 8.0 * (most + 4.0 * reach) + f64::MIN_POSITIVE;
    let mut cost = Vector6::zeros();
    for k in 0..4 {
        cost[k] = TIE * [1.0, 0.618, 0.414, 0.271][k];
    }
    cost[4] = if sides.above { 1.0 } else { TIE };
    cost[5] = if sides.below { -1.0 } else { TIE };
    let bound = |k: usize, upper: bool| match (k, upper) {
        (0..4, true) => high[k],
        (0..4, false) => low[k],
        (_, true) => wide,
        (_, false) => -wide,
    };
    let of = |row: Row| -> (Vector6<f64>, f64) {
        let mut a = Vector6::zeros();
        match row {
            Row::High(k) => {
                a[k] = 1.0;
                (a, bound(k, true))
            }
            Row::Low(k) => {
                a[k] = -1.0;
                (a, -bound(k, false))
            }
            Row::Below(i) => {
                (0..4).for_each(|k| a[k] = planes[i].rise[k]);
                a[4] = -1.0;
                (a, -planes[i].value)
            }
            Row::Above(i) => {
                (0..4).for_each(|k| a[k] = -planes[i].rise[k]);
                a[5] = 1.0;
                (a, planes[i].value)
            }
        }
    };
    let mut basis: [Row; UNKNOWNS] = std::array::from_fn(|k| if cost[k] > 0.0 { Row::Low(k) } else { Row::High(k) });
    let (mut reached, mut stalled) = (f64::NEG_INFINITY, 0);
    let tolerance = 4.0 * f64::EPSILON * (most + reach);
    for _ in 0..MOST_ROUNDS {
        let mut rows = Matrix6::zeros();
        let mut right = Vector6::zeros();
        for (at, row) in basis.iter().enumerate() {
            let (a, b) = of(*row);
            rows.set_row(at, &a.transpose());
            right[at] = b;
        }
        let inverse = rows.try_inverse()?;
        let x = inverse * right;
        let multipliers = -(inverse.transpose() * cost);
        let value = x[4] - x[5];
        stalled = if value > reached { 0 } else { stalled + 1 };
        reached = reached.max(value);
        let entering =
            violated(planes, sides, &x, bound, tolerance).filter(|row| stalled < STALLED && !basis.contains(row));
        let Some(entering) = entering else {
            let held = [true, false].map(|above| {
                let of = |(row, y): (&Row, &f64)| match row {
                    Row::Below(i) if above && *y > 1e-9 => Some(*i),
                    Row::Above(i) if !above && *y > 1e-9 => Some(*i),
                    _ => None,
                };
                basis.iter().zip(multipliers.iter()).filter_map(of).collect()
            });
            let least = if sides.above { x[4] } else { 0.0 } - if sides.below { x[5] } else { 0.0 };
            return Some(Solved { step: [x[0], x[1], x[2], x[3]], least, held });
        };
        let weights = inverse.transpose() * of(entering).0;
        let mut leaving: Option<(f64, f64, usize)> = None;
        for at in 0..UNKNOWNS {
            if weights[at] <= DEPENDENT {
                continue;
            }
            let ratio = multipliers[at].max(0.0) / weights[at];
            let better =
                leaving.is_none_or(|(least, weight, _)| ratio < least || (ratio <= least && weights[at] > weight));
            if better {
                leaving = Some((ratio, weights[at], at));
            }
        }
        basis[leaving?.2] = entering;
    }
    None
}

/// The row that is violated most.
fn violated(
    planes: &[Plane],
    sides: Sides,
    x: &Vector6<f64>,
    bound: impl Fn(usize, bool) -> f64,
    tolerance: f64,
) -> Option<Row> {
    let (mut over, mut under) = ((f64::NEG_INFINITY, 0), (f64::INFINITY, 0));
    for (i, Plane { rise: [a, b, c, d], value }) in planes.iter().enumerate() {
        let value = value + a * x[0] + b * x[1] + c * x[2] + d * x[3];
        if value > over.0 {
            over = (value, i);
        }
        if value < under.0 {
            under = (value, i);
        }
    }
    let bounds = (0..4).flat_map(|k| [(bound(k, false) - x[k], Row::Low(k)), (x[k] - bound(k, true), Row::High(k))]);
    let above = sides.above.then_some((over.0 - x[4], Row::Below(over.1)));
    let below = sides.below.then_some((x[5] - under.0, Row::Above(under.1)));
    let worst = bounds.chain(above).chain(below).max_by(|a, b| a.0.total_cmp(&b.0))?;
    (worst.0 > tolerance).then_some(worst.1)
}
