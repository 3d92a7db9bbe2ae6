//! Small second-order cone programmes: least c.x with A x = b, x a product of cones of ice, |(x_1, x_2)| <= x_0.
//!
//! A primal-dual interior-point method with the scaling of Nesterov and Todd and a predictor and corrector (Andersen, Roos,
//! Terlaky, Math. Program. 95 (2003) 249; CVXOPT's notation). All that is solved are equations as large as b: made for a dozen of
//! them and some dozens of cones.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// A cone's piece of a vector.
pub type Three = [f64; 3];

/// A programme.
#[derive(Debug, Clone, Default)]
pub struct Program {
    /// Columns of A, three for each cone.
    pub columns: Vec<[DVector<f64>; 3]>,
    /// b.
    pub right: DVector<f64>,
    /// c.
    pub cost: Vec<Three>,
}

/// A programme's least value.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// x.
    pub x: Vec<Three>,
    /// c.x.
    pub value: f64,
    /// How far it can lie above the least one: the gap to the dual value, which lies below.
    pub gap: f64,
}

/// Most steps.
const MOST_STEPS: usize = 60;
/// Gap and residuals, relative, at which a programme is solved.
const SOLVED: f64 = 1e-10;
/// The same where it comes no further.
const NEARLY: f64 = 1e-7;
/// Share of the way to the wall that a step goes.
const SHORT: f64 = 0.995;
/// Shares of the diagonal that are added to it.
const LIFTS: [f64; 4] = [1e-15, 1e-13, 1e-11, 1e-9];

fn dot(a: &Three, b: &Three) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// x_0^2 - x_1^2 - x_2^2.
fn depth(x: &Three) -> f64 {
    let across = x[1].hypot(x[2]);
    (x[0] - across) * (x[0] + across)
}

/// Jordan's product.
fn product(a: &Three, b: &Three) -> Three {
    [dot(a, b), a[0] * b[1] + b[0] * a[1], a[0] * b[2] + b[0] * a[2]]
}

/// y of x o y = z.
fn quotient(x: &Three, z: &Three) -> Three {
    let first = (x[0] * z[0] - x[1] * z[1] - x[2] * z[2]) / depth(x);
    [first, (z[1] - first * x[1]) / x[0], (z[2] - first * x[2]) / x[0]]
}

/// How far x can go along d inside its cone.
fn room(x: &Three, d: &Three) -> f64 {
    // The first t above 0 with a t^2 + 2 b t + c = 0, c above 0, without a difference of like numbers.
    let (a, b, c) = (depth(d), x[0] * d[0] - x[1] * d[1] - x[2] * d[2], depth(x).max(0.0));
    let inside = b * b - a * c;
    let wall = if a < 0.0 && b > 0.0 {
        (b + inside.sqrt()) / -a
    } else if b < 0.0 && inside >= 0.0 || a < 0.0 {
        c / (inside.max(0.0).sqrt() - b)
    } else {
        f64::INFINITY
    };
    // Straight through the tip the root is a double one, which rounding may lose.
    if d[0] < 0.0 { wall.min(-x[0] / d[0]) } else { wall }
}

/// Scaling of a cone: W z = W^-1 x, W = beta (2 v v' - J).
struct Scaling {
    beta: f64,
    v: Three,
    scaled: Three,
}

impl Scaling {
    fn new(x: &Three, s: &Three) -> Self {
        let (of_x, of_s) = (depth(x).max(f64::MIN_POSITIVE).sqrt(), depth(s).max(f64::MIN_POSITIVE).sqrt());
        let (unit_x, unit_s) = (x.map(|e| e / of_x), s.map(|e| e / of_s));
        let gamma = (0.5 * (1.0 + dot(&unit_x, &unit_s))).sqrt();
        let w: Three =
            std::array::from_fn(|i| (unit_x[i] + if i == 0 { unit_s[i] } else { -unit_s[i] }) / (2.0 * gamma));
        let root = (2.0 * (w[0] + 1.0)).sqrt();
        let v = [(w[0] + 1.0) / root, w[1] / root, w[2] / root];
        let mut found = Self { beta: (of_x / of_s).sqrt(), v, scaled: [0.0; 3] };
        found.scaled = found.times(s);
        found
    }

    fn times(&self, z: &Three) -> Three {
        let along = 2.0 * dot(&self.v, z);
        [
            self.beta * (along * self.v[0] - z[0]),
            self.beta * (along * self.v[1] + z[1]),
            self.beta * (along * self.v[2] + z[2]),
        ]
    }

    /// W^-1 = (2 J v v' J - J)/beta.
    fn over(&self, z: &Three) -> Three {
        let v = [self.v[0], -self.v[1], -self.v[2]];
        let along = 2.0 * dot(&v, z);
        [(along * v[0] - z[0]) / self.beta, (along * v[1] + z[1]) / self.beta, (along * v[2] + z[2]) / self.beta]
    }
}

/// Where the search is.
struct Point {
    x: Vec<Three>,
    y: DVector<f64>,
    s: Vec<Three>,
}

/// Normal equations, factorised.
struct Factors {
    factors: Cholesky<f64, Dyn>,
    scale: DVector<f64>,
}

impl Factors {
    fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        self.factors.solve(&right.component_mul(&self.scale)).component_mul(&self.scale)
    }
}

struct Step {
    x: Vec<Three>,
    y: DVector<f64>,
    s: Vec<Three>,
}

impl Program {
    fn times(&self, x: &[Three]) -> DVector<f64> {
        let mut sum = DVector::zeros(self.right.len());
        for (columns, x) in self.columns.iter().zip(x) {
            for (column, x) in columns.iter().zip(x) {
                sum.axpy(*x, column, 1.0);
            }
        }
        sum
    }

    fn transposed(&self, y: &DVector<f64>) -> Vec<Three> {
        self.columns.iter().map(|columns| std::array::from_fn(|j| columns[j].dot(y))).collect()
    }

    /// The least value; `None` where there is none, or none is come to.
    pub fn least(&self) -> Option<Solution> {
        let cones = self.cost.len();
        let size = 1.0 + self.right.amax();
        let cost_size = 1.0 + self.cost.iter().flatten().fold(0.0_f64, |most, c| most.max(c.abs()));
        let start = |size: f64| vec![[size, 0.0, 0.0]; cones];
        let mut at = Point { x: start(size), y: DVector::zeros(self.right.len()), s: start(cost_size) };
        let mut best: Option<(f64, Solution)> = None;
        for _ in 0..MOST_STEPS {
            let of_x = self.times(&at.x);
            let primal = &self.right - of_x;
            let of_y = self.transposed(&at.y);
            let dual: Vec<Three> =
                (0..cones).map(|k| std::array::from_fn(|j| self.cost[k][j] - of_y[k][j] - at.s[k][j])).collect();
            let value: f64 = self.cost.iter().zip(&at.x).map(|(c, x)| dot(c, x)).sum();
            let gap: f64 = at.x.iter().zip(&at.s).map(|(x, s)| dot(x, s)).sum();
            let dual_off = dual.iter().flatten().fold(0.0_f64, |most, r| most.max(r.abs()));
            let off = (primal.amax() / size).max(dual_off / cost_size).max(gap / (1.0 + value.abs()));
            if !(value + gap + off).is_finite() {
                break;
            }
            if best.as_ref().is_none_or(|(least, _)| off < *least) {
                best = Some((off, Solution { x: at.x.clone(), value, gap }));
            }
            if off < SOLVED {
                break;
            }
            let scalings: Vec<Scaling> = at.x.iter().zip(&at.s).map(|(x, s)| Scaling::new(x, s)).collect();
            let Some(factors) = self.factors(&scalings) else { break };
            let middle = gap / cones as f64;
            let plain = |k: usize| product(&scalings[k].scaled, &scalings[k].scaled).map(|e| -e);
            let first = self.step(&scalings, &factors, (&primal, &dual), &plain);
            let (far_x, far_s) = at.room(&first);
            let after: f64 = (0..cones)
                .map(|k| {
                    let moved =
                        |a: &Three, d: &Three, far: f64| -> Three { std::array::from_fn(|i| a[i] + far * d[i]) };
                    dot(&moved(&at.x[k], &first.x[k], far_x.min(1.0)), &moved(&at.s[k], &first.s[k], far_s.min(1.0)))
                })
                .sum();
            let centred = (after / gap).clamp(0.0, 1.0).powi(3) * middle;
            let corrected = |k: usize| -> Three {
                let (a, b) = (scalings[k].over(&first.x[k]), scalings[k].times(&first.s[k]));
                let second = product(&a, &b);
                let base = plain(k);
                std::array::from_fn(|i| base[i] - second[i] + if i == 0 { centred } else { 0.0 })
            };
            let step = self.step(&scalings, &factors, (&primal, &dual), &corrected);
            let (far_x, far_s) = at.room(&step);
            at.go(&step, (SHORT * far_x).min(1.0), (SHORT * far_s).min(1.0));
        }
        best.filter(|(off, _)| *off < NEARLY).map(|(_, solution)| solution)
    }

    /// A W^2 A', factorised.
    fn factors(&self, scalings: &[Scaling]) -> Option<Factors> {
        let size = self.right.len();
        let mut normal = DMatrix::<f64>::zeros(size, size);
        for (columns, scaling) in self.columns.iter().zip(scalings) {
            // Rows of A W: as W is symmetric, combinations of its columns.
            for row in 0..3 {
                let unit: Three = std::array::from_fn(|i| if i == row { 1.0 } else { 0.0 });
                let of = scaling.times(&unit);
                let mut mixed = &columns[0] * of[0];
                mixed.axpy(of[1], &columns[1], 1.0);
                mixed.axpy(of[2], &columns[2], 1.0);
                normal.syger(1.0, &mixed, &mixed, 1.0);
            }
        }
        // Equations of one size; those that depend on each other are lifted until the factors stand.
        let scale = normal.diagonal().map(|entry| 1.0 / entry.sqrt().max(f64::MIN_POSITIVE));
        let unit = DMatrix::from_fn(size, size, |i, j| normal[(i, j)] * scale[i] * scale[j]);
        let lifted = |lift: f64| unit.clone() + DMatrix::identity(size, size) * lift;
        let factors = LIFTS.into_iter().find_map(|lift| lifted(lift).cholesky())?;
        Some(Factors { factors, scale })
    }

    fn step(
        &self,
        scalings: &[Scaling],
        factors: &Factors,
        (primal, dual): (&DVector<f64>, &[Three]),
        centre: &dyn Fn(usize) -> Three,
    ) -> Step {
        let cones = scalings.len();
        let goals: Vec<Three> = (0..cones).map(|k| quotient(&scalings[k].scaled, &centre(k))).collect();
        let mixed: Vec<Three> = (0..cones)
            .map(|k| {
                let of_dual = scalings[k].times(&scalings[k].times(&dual[k]));
                let of_goal = scalings[k].times(&goals[k]);
                std::array::from_fn(|i| of_dual[i] - of_goal[i])
            })
            .collect();
        let y = factors.solve(&(primal + self.times(&mixed)));
        let of_y = self.transposed(&y);
        let mut found = Step { x: Vec::with_capacity(cones), y, s: Vec::with_capacity(cones) };
        for k in 0..cones {
            let s: Three = std::array::from_fn(|i| dual[k][i] - of_y[k][i]);
            let scaled = scalings[k].times(&s);
            let left: Three = std::array::from_fn(|i| goals[k][i] - scaled[i]);
            found.x.push(scalings[k].times(&left));
            found.s.push(s);
        }
        found
    }
}

impl Point {
    fn room(&self, step: &Step) -> (f64, f64) {
        let least = |at: &[Three], d: &[Three]| at.iter().zip(d).map(|(x, d)| room(x, d)).fold(f64::INFINITY, f64::min);
        (least(&self.x, &step.x), least(&self.s, &step.s))
    }

    fn go(&mut self, step: &Step, far_x: f64, far_s: f64) {
        let go = |at: &mut [Three], d: &[Three], far: f64| {
            for (x, d) in at.iter_mut().flatten().zip(d.iter().flatten()) {
                *x += far * d;
            }
        };
        go(&mut self.x, &step.x, far_x);
        go(&mut self.s, &step.s, far_s);
        self.y.axpy(far_s, &step.y, 1.0);
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// Least x_0 over a cone whose x_1 and x_2 are given is their length; over two cones that share a sum, the length of it.
    #[test]
    fn the_least_value_is_a_length() {
        let column = |row: usize, size: usize| DVector::from_fn(size, |i, _| if i == row { 1.0 } else { 0.0 });
        let nothing = |size: usize| DVector::zeros(size);
        let one = Program {
            columns: vec![[nothing(2), column(0, 2), column(1, 2)]],
            right: DVector::from_vec(vec![3.0, -4.0]),
            cost: vec![[1.0, 0.0, 0.0]],
        };
        let found = one.least().unwrap();
        assert!((found.value - 5.0).abs() < 1e-8 && found.gap < 1e-8, "{found:?}");
        let two = Program {
            columns: vec![[nothing(2), column(0, 2), column(1, 2)]; 2],
            right: DVector::from_vec(vec![300.0, -400.0]),
            cost: vec![[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]],
        };
        assert!((two.least().unwrap().value - 500.0).abs() < 1e-6);
    }

    #[test]
    fn a_programme_without_a_point_has_no_value() {
        // x_0 = -1 lies outside its cone.
        let none = Program {
            columns: vec![[DVector::from_vec(vec![1.0]), DVector::zeros(1), DVector::zeros(1)]],
            right: DVector::from_vec(vec![-1.0]),
            cost: vec![[1.0, 0.0, 0.0]],
        };
        assert_eq!(none.least(), None);
    }
}
