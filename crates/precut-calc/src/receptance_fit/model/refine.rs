//! Least squares of real modes in the quantity measured (`receptance/3.3`).
//!
//! Per mode the numbers are ln w, zeta and the mass-normalised shape v over the axes of the group; H_pq = sum of
//! v_p v_q/(w_k^2 - w^2 + 2 i zeta w_k w) - A_pq/w^2 + B_pq, times (i w)^k.

use nalgebra::{Complex, DMatrix, DVector};

use crate::num::stats::Criteria;

use super::poles::Pole;
use super::{Group, Lines, Unfit};

/// A mode of a group.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Mode {
    /// Natural frequency, Hz.
    pub frequency_hz: f64,
    /// Share of critical damping.
    pub damping_ratio: f64,
    /// Modal mass at the point, kg.
    pub mass_kg: f64,
    /// Direction of length 1 over the axes of the group.
    pub direction: Vec<f64>,
    /// Standard errors, in the order frequency, damping, mass; relative.
    pub relative_errors: [f64; 3],
}

/// Modes that come nearest to the lines of a group.
#[derive(Debug, Clone)]
pub(crate) struct Refined {
    /// By frequency.
    pub modes: Vec<Mode>,
    /// Schwarz's criterion.
    pub bic: f64,
    /// What the modes predict of each line, function by function, in the quantity measured.
    pub predicted: Vec<Vec<Complex<f64>>>,
    /// Whether the search ended at a minimum inside its bounds that the lines determine.
    pub settled: bool,
}

/// A mode whose mass is known worse than this is not told from nothing.
const SEEN: f64 = 1.0 / 3.0;

impl Refined {
    /// Whether it is a minimum with modes that the lines show.
    pub(super) fn stands(&self) -> bool {
        self.settled && self.modes.iter().all(|mode| mode.relative_errors[2] < SEEN)
    }

    /// The criterion of a fit that stands, the least being the best.
    pub(super) fn merit(&self) -> f64 {
        if self.stands() { self.bic } else { f64::INFINITY }
    }
}

/// The lines as a function of the numbers.
struct Model<'a> {
    group: &'a Group,
    modes: usize,
    /// Numbers of a mode.
    per_mode: usize,
}

/// A mode and a line: 1/(w_k^2 - w^2 + 2 i zeta w_k w).
pub(super) fn receptance(pole: Pole, omega: f64) -> Complex<f64> {
    let w = pole.omega;
    Complex::new(w * w - omega * omega, 2.0 * pole.zeta * w * omega).inv()
}

/// What -A/w^2 and B are in a line for numbers of one: A over the square of the upper end of the band, so that both are of
/// one size.
pub(super) fn residual_terms(omega: f64, upper: f64) -> [f64; 2] {
    [-(upper / omega).powi(2), 1.0]
}

impl<'a> Model<'a> {
    fn new(group: &'a Group, modes: usize) -> Self {
        Self { group, modes, per_mode: 2 + group.axes.len() }
    }

    fn count(&self) -> usize {
        self.modes * self.per_mode + self.group.lines.len() * self.group.residual_terms()
    }

    fn pole(&self, numbers: &[f64], k: usize) -> Pole {
        let of = &numbers[k * self.per_mode..];
        Pole { omega: of[0].exp(), zeta: of[1] }
    }

    fn shape<'n>(&self, numbers: &'n [f64], k: usize) -> &'n [f64] {
        &numbers[k * self.per_mode + 2..(k + 1) * self.per_mode]
    }

    /// Where the residuals of a function stand among the numbers.
    fn residuals_at(&self, function: usize) -> usize {
        self.modes * self.per_mode + function * self.group.residual_terms()
    }

    fn predicted(&self, numbers: &[f64], function: usize) -> Vec<Complex<f64>> {
        let lines = &self.group.lines[function];
        let band = self.group.band()[1];
        let (p, q) = (lines.response.0, lines.excitation.0);
        let modes: Vec<(Pole, f64)> = (0..self.modes)
            .map(|k| {
                let shape = self.shape(numbers, k);
                (self.pole(numbers, k), lines.sign() * shape[p] * shape[q])
            })
            .collect();
        let residuals = &numbers[self.residuals_at(function)..][..self.group.residual_terms()];
        let of = |(omega, factor): (&f64, &Complex<f64>)| {
            let modal: Complex<f64> = modes.iter().map(|(pole, residue)| receptance(*pole, *omega) * *residue).sum();
            let terms = residual_terms(*omega, band);
            let beside: f64 = residuals.iter().zip(terms).map(|(number, term)| number * term).sum();
            (modal + beside) * factor
        };
        lines.omega.iter().zip(&lines.factors).map(of).collect()
    }
}

/// Normal equations of the residuals about some numbers.
struct Equations {
    /// J'J.
    gram: DMatrix<f64>,
    /// J'r.
    slope: DVector<f64>,
    rss: f64,
}

impl Equations {
    /// The step to the least squares of the tangent, the diagonal raised by a share; `None` where the lines do not determine it.
    fn step(&self, damping: f64) -> Option<DVector<f64>> {
        let scale = self.gram.diagonal().map(|entry| entry.sqrt().max(f64::MIN_POSITIVE));
        let size = scale.len();
        let damped = |i: usize, j: usize| if i == j { 1.0 + damping } else { 0.0 };
        let unit =
            DMatrix::from_fn(
                size,
                size,
                |i, j| {
                    if i == j { damped(i, j) } else { self.gram[(i, j)] / (scale[i] * scale[j]) }
                },
            );
        let right = DVector::from_fn(size, |i, _| -self.slope[i] / scale[i]);
        let found = unit.cholesky()?.solve(&right);
        Some(DVector::from_fn(size, |i, _| found[i] / scale[i]))
    }

    fn inverse(&self) -> Option<DMatrix<f64>> {
        let scale = self.gram.diagonal().map(|entry| entry.sqrt().max(f64::MIN_POSITIVE));
        let size = scale.len();
        let unit = DMatrix::from_fn(size, size, |i, j| self.gram[(i, j)] / (scale[i] * scale[j]));
        let inverse = unit.cholesky()?.inverse();
        Some(DMatrix::from_fn(size, size, |i, j| inverse[(i, j)] / (scale[i] * scale[j])))
    }

    /// Squared length of a step as the residuals change by it.
    fn length(&self, step: &DVector<f64>) -> f64 {
        step.dot(&(&self.gram * step))
    }
}

impl Model<'_> {
    fn equations(&self, numbers: &[f64]) -> Equations {
        let size = self.count();
        let upper = self.group.band()[1];
        let mut gram = DMatrix::zeros(size, size);
        let (mut slope, mut rss) = (DVector::zeros(size), 0.0);
        let mut row: Vec<(usize, Complex<f64>)> = Vec::new();
        for (function, lines) in self.group.lines.iter().enumerate() {
            let (p, q) = (lines.response.0, lines.excitation.0);
            let begin = self.residuals_at(function);
            for (line, &omega) in lines.omega.iter().enumerate() {
                row.clear();
                let factor = lines.factors[line] * lines.weights[line];
                let mut left = -lines.values[line] * lines.weights[line];
                for k in 0..self.modes {
                    let (pole, shape) = (self.pole(numbers, k), self.shape(numbers, k));
                    let at = k * self.per_mode;
                    let h = receptance(pole, omega);
                    let driven = h * factor * lines.sign();
                    left += driven * (shape[p] * shape[q]);
                    let by_square = -h * driven * (shape[p] * shape[q]);
                    let w = pole.omega;
                    // d/d ln w of w^2 + 2 i zeta w omega, and d/d zeta.
                    row.push((at, by_square * Complex::new(2.0 * w * w, 2.0 * pole.zeta * w * omega)));
                    row.push((at + 1, by_square * Complex::new(0.0, 2.0 * w * omega)));
                    if p == q {
                        row.push((at + 2 + p, driven * (2.0 * shape[p])));
                    } else {
                        row.push((at + 2 + p.min(q), driven * shape[p.max(q)]));
                        row.push((at + 2 + p.max(q), driven * shape[p.min(q)]));
                    }
                }
                let terms = residual_terms(omega, upper);
                for (i, term) in terms.into_iter().take(self.group.residual_terms()).enumerate() {
                    left += factor * (term * numbers[begin + i]);
                    row.push((begin + i, factor * term));
                }
                rss += left.norm_sqr();
                for (a, &(i, x)) in row.iter().enumerate() {
                    slope[i] += x.re * left.re + x.im * left.im;
                    for &(j, y) in &row[..=a] {
                        gram[(i, j)] += x.re * y.re + x.im * y.im;
                    }
                }
            }
        }
        gram.fill_upper_triangle_with_lower_triangle();
        Equations { gram, slope, rss }
    }

    /// Bounds of a number.
    fn bounds(&self, i: usize) -> [f64; 2] {
        match (i < self.modes * self.per_mode).then_some(i % self.per_mode) {
            Some(0) => self.group.band().map(f64::ln),
            Some(1) => DAMPING,
            _ => [f64::NEG_INFINITY, f64::INFINITY],
        }
    }
}

/// Where a search ended.
struct Ended {
    numbers: Vec<f64>,
    equations: Equations,
    /// At a minimum inside the bounds that the lines determine.
    settled: bool,
}

/// Gauss and Newton's steps, damped where one does not go down (Levenberg, Marquardt). Normal equations lose digits of a
/// step, none of the minimum: it is where the slope of the residuals themselves is 0.
fn descend(model: &Model<'_>, from: &[f64], stop: &dyn Fn() -> bool) -> Result<Ended, Unfit> {
    let held = |i: usize, number: f64| {
        let [lower, upper] = model.bounds(i);
        number.clamp(lower, upper)
    };
    let mut numbers: Vec<f64> = from.iter().enumerate().map(|(i, number)| held(i, *number)).collect();
    let mut equations = model.equations(&numbers);
    let spare = model.group.residual_count().saturating_sub(model.count()).max(1) as f64;
    let size: f64 = model.group.lines.iter().map(Lines::square).sum();
    let (mut damping, mut settled) = (0.0, false);
    for _ in 0..MOST_STEPS {
        if stop() {
            return Err(Unfit::Stopped);
        }
        let Some(step) = equations.step(damping) else {
            damping = f64::max(10.0 * damping, FIRST_DAMPING);
            if damping > LAST_DAMPING {
                break;
            }
            continue;
        };
        let goal = (SETTLED * SETTLED * equations.rss / spare).max(ROUNDING * ROUNDING * size);
        if damping == 0.0 && equations.length(&step) <= goal {
            settled = true;
            break;
        }
        let trial: Vec<f64> = numbers.iter().zip(step.iter()).enumerate().map(|(i, (x, d))| held(i, x + d)).collect();
        let next = model.equations(&trial);
        if next.rss.is_finite() && next.rss <= equations.rss * (1.0 + ROUNDING) {
            (numbers, equations) = (trial, next);
            damping = if damping > FIRST_DAMPING { damping / 10.0 } else { 0.0 };
        } else {
            damping = f64::max(10.0 * damping, FIRST_DAMPING);
            if damping > LAST_DAMPING {
                break;
            }
        }
    }
    let is_inside = numbers.iter().enumerate().all(|(i, number)| {
        let [lower, upper] = model.bounds(i);
        lower < *number && *number < upper
    });
    Ok(Ended { settled: settled && is_inside, numbers, equations })
}

/// A start: poles with their shapes over the axes, and the residuals of each function.
pub(super) struct Start {
    pub modes: Vec<(Pole, Vec<f64>)>,
    pub residuals: Vec<Vec<f64>>,
}

impl Start {
    fn numbers(&self) -> Vec<f64> {
        let mode = |(pole, shape): &(Pole, Vec<f64>)| {
            let head = [pole.omega.ln(), pole.zeta];
            head.into_iter().chain(shape.iter().copied()).collect::<Vec<f64>>()
        };
        self.modes.iter().flat_map(mode).chain(self.residuals.iter().flatten().copied()).collect()
    }
}

/// Most steps of a search.
const MOST_STEPS: usize = 40;
/// Bounds of the damping of a mode: more of it is no resonance.
const DAMPING: [f64; 2] = [1e-6, 0.5];
/// Least and largest share by which the diagonal is raised.
const FIRST_DAMPING: f64 = 1e-6;
const LAST_DAMPING: f64 = 1e6;
/// A step of this many standard errors has settled.
const SETTLED: f64 = 1e-8;
/// Rounding of a sum of squares, relative.
const ROUNDING: f64 = 1e-13;

/// The least squares from a start.
pub(super) fn refine(group: &Group, start: &Start, stop: &dyn Fn() -> bool) -> Result<Refined, Unfit> {
    let model = Model::new(group, start.modes.len());
    if group.residual_count() <= model.count() {
        return Err(Unfit::TooFew);
    }
    let Ended { numbers, equations, settled } = descend(&model, &start.numbers(), stop)?;
    let spare = (group.residual_count() - model.count()) as f64;
    let inverse = equations.inverse();
    let settled = settled && inverse.is_some();
    let covariance = inverse.unwrap_or_else(|| DMatrix::zeros(model.count(), model.count())) * (equations.rss / spare);
    let mut modes: Vec<Mode> = (0..model.modes).map(|k| mode(&model, &numbers, &covariance, k)).collect();
    modes.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    Ok(Refined {
        modes,
        bic: Criteria::of(group.residual_count(), model.count(), equations.rss, 0.0).bic,
        predicted: (0..group.lines.len()).map(|function| model.predicted(&numbers, function)).collect(),
        settled,
    })
}

fn mode(model: &Model<'_>, numbers: &[f64], covariance: &DMatrix<f64>, k: usize) -> Mode {
    let (pole, shape) = (model.pole(numbers, k), model.shape(numbers, k));
    let begin = k * model.per_mode;
    let square: f64 = shape.iter().map(|v| v * v).sum();
    let mut variance = 0.0;
    for (i, a) in shape.iter().enumerate() {
        for (j, b) in shape.iter().enumerate() {
            variance += 4.0 * a * b * covariance[(begin + 2 + i, begin + 2 + j)];
        }
    }
    let length = square.sqrt();
    let error = |i: usize| covariance[(begin + i, begin + i)].max(0.0).sqrt();
    // Of both ends of a line one is taken: the largest share points along its axis.
    let largest = shape.iter().copied().fold(0.0, |most: f64, v| if v.abs() > most.abs() { v } else { most });
    let sign = if largest < 0.0 { -1.0 } else { 1.0 };
    Mode {
        frequency_hz: pole.omega / std::f64::consts::TAU,
        damping_ratio: pole.zeta,
        mass_kg: 1.0 / square,
        direction: shape.iter().map(|v| sign * v / length).collect(),
        relative_errors: [error(0), error(1) / pole.zeta, variance.max(0.0).sqrt() / square],
    }
}
