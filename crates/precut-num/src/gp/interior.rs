//! Mehrotra's predictor-corrector method on a [`Layout`] (`feed/6.3`).

use super::layout::Layout;
use super::newton::{Newton, State};
use super::{Objective, Program, Solution};

/// When the method stops.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Complementarity gap: the objective's error.
    pub gap: f64,
    /// Largest violation of a limit.
    pub primal: f64,
    /// Largest component of the Lagrangian's gradient.
    pub dual: f64,
    /// Most steps.
    pub iterations: u32,
    /// The program's start satisfies all limits: slacks begin as they are there. Slower, and it keeps where limits leave
    /// next to no room.
    pub inside: bool,
    /// Stop as soon as a point satisfies every limit with an objective below this: for tests of feasibility.
    pub enough: Option<f64>,
}

impl Default for Settings {
    fn default() -> Self {
        Self { gap: 1e-10, primal: 1e-9, dual: 1e-8, iterations: 80, inside: false, enough: None }
    }
}

/// Why there is no optimum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Failed {
    /// No point satisfies the limits, or so it seems: multipliers grow without bound, or a limit on what is fixed is broken.
    Infeasible,
    /// The steps came to nothing.
    Stalled {
        /// Steps taken.
        iterations: u32,
        /// Largest residual left.
        residual: f64,
    },
    /// A term spans more of the chain than the method holds.
    NotChained,
}

/// Multipliers above this say that no point is feasible.
const BEYOND: f64 = 1e9;
/// Slack of a limit that a start from inside touches.
const LEAST_SLACK: f64 = 1e-9;
/// Share of the way to the boundary.
const TO_BOUNDARY: f64 = 0.99;
/// Longest step of a log variable.
const LONGEST_STEP: f64 = 2.0;

/// Minimises a program.
///
/// # Errors
/// See [`Failed`]; an infeasible program may also show as stalled.
pub fn minimise(program: &Program, settings: &Settings) -> Result<Solution, Failed> {
    let layout = Layout::new(program).ok_or(Failed::NotChained)?;
    Method::default().run(&layout, settings)
}

impl Layout {
    /// Minimises the program that it was made of.
    ///
    /// # Errors
    /// See [`Failed`].
    pub fn minimise(&self, settings: &Settings) -> Result<Solution, Failed> {
        Method::default().run(self, settings)
    }

    /// Whether the optimum leaves a direction free along which neither objective nor an active limit changes.
    pub fn has_flat_direction(&self, solution: &Solution) -> bool {
        let multipliers = self.order.iter().map(|&row| solution.row_multipliers[row]);
        let active: Vec<bool> =
            multipliers.chain(solution.sum_multipliers.iter().copied()).map(|z| z > ACTIVE).collect();
        Newton::default().has_flat_direction(self, &active)
    }
}

/// A multiplier above this belongs to an active limit: inactive ones end near the gap over their slack.
const ACTIVE: f64 = 1e-7;

#[derive(Debug, Default)]
struct Method {
    state: State,
    newton: Newton,
    gradient: Vec<f64>,
    weight: Vec<f64>,
    right: Vec<f64>,
    dy: Vec<f64>,
    ds: Vec<f64>,
    dz: Vec<f64>,
    product: Vec<f64>,
}

impl Method {
    fn run(&mut self, layout: &Layout, settings: &Settings) -> Result<Solution, Failed> {
        if !layout.impossible.is_empty() {
            return Err(Failed::Infeasible);
        }
        self.begin(layout, settings.inside);
        let m = layout.limits() as f64;
        let curved = matches!(layout.objective, Objective::Sum(_)) || !layout.sums.is_empty();
        let mut worst = f64::INFINITY;
        for iteration in 0..settings.iterations {
            let gap: f64 = dot(&self.state.s, &self.state.z);
            let primal = largest(&self.state.residual);
            self.state.gradient(layout, &self.state.z, &mut self.gradient);
            let dual = largest(&self.gradient);
            worst = gap.max(primal).max(dual);
            let done = gap <= settings.gap && primal <= settings.primal && dual <= settings.dual;
            if done || self.is_enough(layout, settings) {
                return Ok(self.solution(layout, gap, primal, dual, iteration));
            }
            let most = self.state.z.iter().copied().fold(0.0, f64::max);
            if !worst.is_finite() {
                return Err(Failed::Stalled { iterations: iteration, residual: f64::INFINITY });
            }
            if most > BEYOND {
                return Err(Failed::Infeasible);
            }
            self.step(layout, gap / m, m, settings, curved);
        }
        Err(Failed::Stalled { iterations: settings.iterations, residual: worst })
    }

    fn begin(&mut self, layout: &Layout, inside: bool) {
        let state = &mut self.state;
        state.y.clone_from(&layout.start);
        state.s = vec![0.0; layout.limits()];
        state.evaluate(layout);
        // With s = 0 the residual is the value of the limit.
        let (least, product) = if inside { (LEAST_SLACK, 1.0 / layout.limits().max(1) as f64) } else { (0.3, 0.1) };
        state.s = state.residual.iter().map(|value| (-value).max(least)).collect();
        state.z = state.s.iter().map(|s| product / s).collect();
        state.evaluate(layout);
        self.ds = vec![0.0; layout.limits()];
        self.dz = vec![0.0; layout.limits()];
        self.product = vec![0.0; layout.limits()];
        self.weight = vec![0.0; layout.limits()];
    }

    /// Whether the point itself, not its slacks, satisfies what was asked for.
    fn is_enough(&self, layout: &Layout, settings: &Settings) -> bool {
        let Some(enough) = settings.enough else { return false };
        let state = &self.state;
        let feasible = state.residual.iter().zip(&state.s).all(|(residual, s)| residual - s <= 0.0);
        feasible && objective(layout, state) < enough
    }

    fn step(&mut self, layout: &Layout, mu: f64, m: f64, settings: &Settings, curved: bool) {
        self.newton.factor(layout, &self.state);
        let refine = mu < 1e-9;
        self.product.iter_mut().for_each(|p| *p = 0.0);
        self.direction(layout, 0.0, refine);
        let (primal, dual) = self.reach();
        let (affine_primal, affine_dual) = if curved { (primal.min(dual), primal.min(dual)) } else { (primal, dual) };
        let affine: f64 = (0..self.ds.len())
            .map(|k| (self.state.s[k] + affine_primal * self.ds[k]) * (self.state.z[k] + affine_dual * self.dz[k]))
            .sum::<f64>()
            / m;
        let centring = (affine / mu).powi(3);
        let target = (centring * mu).max(0.1 * settings.gap / m);
        for ((product, ds), dz) in self.product.iter_mut().zip(&self.ds).zip(&self.dz) {
            *product = ds * dz;
        }
        self.direction(layout, target, refine);
        let (primal, dual) = self.reach();
        let longest = largest(&self.dy);
        let cap = if longest > LONGEST_STEP { LONGEST_STEP / longest } else { 1.0 };
        let (mut primal, mut dual) = ((TO_BOUNDARY * primal).min(1.0), (TO_BOUNDARY * dual).min(1.0));
        if curved {
            primal = primal.min(dual).min(cap);
            dual = primal;
        } else {
            primal = primal.min(cap);
        }
        let state = &mut self.state;
        add_scaled(&mut state.y, primal, &self.dy);
        add_scaled(&mut state.s, primal, &self.ds);
        add_scaled(&mut state.z, dual, &self.dz);
        state.evaluate(layout);
    }

    /// The direction toward s z = target - product.
    fn direction(&mut self, layout: &Layout, target: f64, refine: bool) {
        let state = &self.state;
        for k in 0..self.weight.len() {
            self.weight[k] = (target - self.product[k]) / state.s[k] + self.newton.ratio[k] * state.residual[k];
        }
        state.gradient(layout, &self.weight, &mut self.right);
        for r in &mut self.right {
            *r = -*r;
        }
        self.dy.clone_from(&self.right);
        self.newton.solve(layout, &mut self.dy);
        if refine {
            self.newton.refine(layout, state, &self.right, &mut self.dy);
        }
        state.slopes(layout, &self.dy, &mut self.ds);
        for k in 0..self.ds.len() {
            self.ds[k] = -state.residual[k] - self.ds[k];
            self.dz[k] = (target - self.product[k]) / state.s[k] - state.z[k] - self.newton.ratio[k] * self.ds[k];
        }
    }

    /// Longest steps that keep slacks and multipliers positive.
    fn reach(&self) -> (f64, f64) {
        (longest(&self.state.s, &self.ds), longest(&self.state.z, &self.dz))
    }

    fn solution(&self, layout: &Layout, gap: f64, primal: f64, dual: f64, iterations: u32) -> Solution {
        let mut row_multipliers = vec![0.0; layout.program_rows];
        let mut row_slacks = vec![f64::INFINITY; layout.program_rows];
        for (k, &row) in layout.order.iter().enumerate() {
            row_multipliers[row] = self.state.z[k];
            row_slacks[row] = self.state.s[k];
        }
        Solution {
            y: self.state.y.clone(),
            objective: objective(layout, &self.state),
            row_multipliers,
            sum_multipliers: self.state.z[layout.rows()..].to_vec(),
            row_slacks,
            gap,
            primal_residual: primal,
            dual_residual: dual,
            iterations,
        }
    }
}

fn objective(layout: &Layout, state: &State) -> f64 {
    match &layout.objective {
        Objective::Sum(_) => state.objective.value,
        Objective::Linear(form) => form.value(0, &state.y),
    }
}

fn longest(x: &[f64], dx: &[f64]) -> f64 {
    // 1/step as a maximum: no branch.
    let inverse = x.iter().zip(dx).map(|(x, dx)| -dx / x).fold(0.0, f64::max);
    if inverse > 0.0 { 1.0 / inverse } else { f64::INFINITY }
}

fn largest(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |most, x| if x.abs() > most || x.is_nan() { x.abs() } else { most })
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn add_scaled(x: &mut [f64], by: f64, d: &[f64]) {
    for (x, d) in x.iter_mut().zip(d) {
        *x += by * d;
    }
}
