//! The Newton system of the interior-point method: assembled from rows and sums, factored, applied.

use super::border::Bordered;
use super::layout::{BAND, Layout};
use super::{Affines, Objective};

/// A sum of exponentials at a point.
#[derive(Debug, Clone, Default)]
pub(super) struct SumState {
    /// ln Σ exp.
    pub value: f64,
    /// Share of every term.
    pub share: Vec<f64>,
    /// Gradient of the value.
    pub gradient: Vec<f64>,
    scratch: Vec<f64>,
}

impl SumState {
    pub(super) fn at(&mut self, terms: &Affines, y: &[f64]) {
        self.scratch.clear();
        self.scratch.extend((0..terms.len()).map(|row| terms.value(row, y)));
        let largest = self.scratch.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        self.share.clear();
        self.share.extend(self.scratch.iter().map(|v| (v - largest).exp()));
        let total: f64 = self.share.iter().sum();
        self.value = largest + total.ln();
        self.gradient.clear();
        self.gradient.resize(y.len(), 0.0);
        for (row, share) in self.share.iter_mut().enumerate() {
            *share /= total;
            for (i, a) in terms.entries(row) {
                self.gradient[i] += *share * a;
            }
        }
    }
}

/// What the method holds at a point: slacks, multipliers, sums.
#[derive(Debug, Clone, Default)]
pub(super) struct State {
    pub y: Vec<f64>,
    /// Of every row, then of every sum.
    pub s: Vec<f64>,
    pub z: Vec<f64>,
    /// a·y + c + s, and ln Σ + s.
    pub residual: Vec<f64>,
    pub objective: SumState,
    pub sums: Vec<SumState>,
}

impl State {
    pub(super) fn evaluate(&mut self, layout: &Layout) {
        if let Objective::Sum(terms) = &layout.objective {
            self.objective.at(terms, &self.y);
        }
        self.residual.clear();
        self.residual.resize(layout.limits(), 0.0);
        slopes(layout, &self.y, &mut self.residual);
        let pairs = layout.pairs.constant.iter();
        let mixed = (0..layout.mixed.len()).map(|row| layout.mixed.constant(row));
        let far = (0..layout.far.len()).map(|row| layout.far.constant(row));
        for ((r, s), c) in self.residual.iter_mut().zip(&self.s).zip(pairs.copied().chain(mixed).chain(far)) {
            *r += c + s;
        }
        let rows = layout.rows();
        self.sums.resize_with(layout.sums.len(), SumState::default);
        for (k, (state, terms)) in self.sums.iter_mut().zip(&layout.sums).enumerate() {
            state.at(terms, &self.y);
            self.residual[rows + k] = state.value + self.s[rows + k];
        }
    }

    /// Gradient of the objective plus Σ weight times the gradients of the limits.
    pub(super) fn gradient(&self, layout: &Layout, weight: &[f64], out: &mut Vec<f64>) {
        out.clear();
        out.resize(self.y.len(), 0.0);
        match &layout.objective {
            Objective::Sum(_) => out.copy_from_slice(&self.objective.gradient),
            Objective::Linear(form) => form.entries(0).for_each(|(i, c)| out[i] += c),
        }
        self.add_gradients(layout, weight, out);
    }

    /// Σ weight times the gradients of the limits, added to `out`.
    pub(super) fn add_gradients(&self, layout: &Layout, weight: &[f64], out: &mut [f64]) {
        let pairs = &layout.pairs;
        for k in 0..pairs.high.len() {
            out[pairs.high[k] as usize] += pairs.a_high[k] * weight[k];
            out[pairs.low[k] as usize] += pairs.a_low[k] * weight[k];
        }
        let first = pairs.high.len();
        for row in 0..layout.mixed.len() {
            layout.mixed.entries(row).for_each(|(i, a)| out[i] += a * weight[first + row]);
        }
        let first = first + layout.mixed.len();
        for row in 0..layout.far.len() {
            layout.far.entries(row).for_each(|(i, a)| out[i] += a * weight[first + row]);
        }
        let first = first + layout.far.len();
        for (k, state) in self.sums.iter().enumerate() {
            let w = weight[first + k];
            for (o, g) in out.iter_mut().zip(&state.gradient) {
                *o += w * g;
            }
        }
    }

    /// Slope of every row and sum along d.
    pub(super) fn slopes(&self, layout: &Layout, d: &[f64], out: &mut [f64]) {
        slopes(layout, d, out);
        let rows = layout.rows();
        for (k, state) in self.sums.iter().enumerate() {
            out[rows + k] = state.gradient.iter().zip(d).map(|(g, d)| g * d).sum();
        }
    }
}

fn slopes(layout: &Layout, d: &[f64], out: &mut [f64]) {
    let pairs = &layout.pairs;
    let count = pairs.high.len();
    for (((o, (h, l)), a), b) in
        out.iter_mut().zip(pairs.high.iter().zip(&pairs.low)).zip(&pairs.a_high).zip(&pairs.a_low)
    {
        *o = a * d[*h as usize] + b * d[*l as usize];
    }
    for row in 0..layout.mixed.len() {
        out[count + row] = layout.mixed.slope(row, d);
    }
    let first = count + layout.mixed.len();
    for row in 0..layout.far.len() {
        out[first + row] = layout.far.slope(row, d);
    }
}

/// The matrix of the Newton system and its factors.
#[derive(Debug, Clone, Default)]
pub(super) struct Newton {
    matrix: Bordered,
    /// z/s of every limit.
    pub ratio: Vec<f64>,
    rest: Vec<f64>,
    trial: Vec<f64>,
    slope: Vec<f64>,
}

/// Weights of the second derivatives: 1 for the objective, z for every sum.
impl Newton {
    /// Assembles and factors the Newton matrix at the state.
    pub(super) fn factor(&mut self, layout: &Layout, state: &State) {
        self.ratio.clear();
        self.ratio.extend(state.z.iter().zip(&state.s).map(|(z, s)| z / s));
        let (nl, nc) = (layout.local, layout.common);
        let low_rank =
            usize::from(matches!(layout.objective, Objective::Sum(_))) + layout.sums.len() + layout.far.len();
        self.matrix.reset(nl, nc + low_rank);
        let ratio = std::mem::take(&mut self.ratio);
        self.add_pairs(layout, &ratio);
        let first = layout.pairs.high.len();
        for row in 0..layout.mixed.len() {
            self.add_form(layout, &layout.mixed, row, ratio[first + row]);
        }
        let mut column = nc;
        if let Objective::Sum(terms) = &layout.objective {
            self.add_terms(layout, terms, &state.objective.share, 1.0);
            self.add_vector(layout, column, &state.objective.gradient, -1.0);
            column += 1;
        }
        let rows = layout.rows();
        for (k, (terms, sum)) in layout.sums.iter().zip(&state.sums).enumerate() {
            let z = state.z[rows + k];
            self.add_terms(layout, terms, &sum.share, z);
            self.add_vector(layout, column, &sum.gradient, ratio[rows + k] - z);
            column += 1;
        }
        let first = first + layout.mixed.len();
        for row in 0..layout.far.len() {
            self.add_far(layout, row, column, ratio[first + row]);
            column += 1;
        }
        self.ratio = ratio;
        self.matrix.factor();
    }

    /// Whether a direction exists that no active limit and no term of the objective or an active sum determines.
    pub(super) fn has_flat_direction(&mut self, layout: &Layout, active: &[bool]) -> bool {
        let nc = layout.common;
        let rows = layout.rows();
        // Without the low-rank part: positive semidefinite, singular exactly where a direction is free.
        self.matrix.reset(layout.local, nc + layout.far.len());
        let ones: Vec<f64> = active.iter().map(|&a| if a { 1.0 } else { 0.0 }).collect();
        self.add_pairs(layout, &ones);
        let first = layout.pairs.high.len();
        for row in 0..layout.mixed.len() {
            self.add_form(layout, &layout.mixed, row, ones[first + row]);
        }
        let first = first + layout.mixed.len();
        for row in 0..layout.far.len() {
            self.add_far(layout, row, nc + row, ones[first + row]);
        }
        match &layout.objective {
            Objective::Sum(terms) => self.add_all(layout, terms),
            Objective::Linear(form) => self.add_all(layout, form),
        }
        for (k, terms) in layout.sums.iter().enumerate() {
            if active[rows + k] {
                self.add_all(layout, terms);
            }
        }
        // The weights are of order one, so a pivot of 1e-8 of its diagonal is rounding.
        self.matrix.singular(nc, 1e-8)
    }

    fn add_all(&mut self, layout: &Layout, terms: &Affines) {
        for row in 0..terms.len() {
            self.add_form(layout, terms, row, 1.0);
        }
    }

    fn add_pairs(&mut self, layout: &Layout, weight: &[f64]) {
        let pairs = &layout.pairs;
        let band = &mut self.matrix.band;
        for (k, &w) in weight.iter().enumerate().take(pairs.high.len()) {
            let (i, j) = (pairs.high[k] as usize, pairs.low[k] as usize);
            let (a, b) = (pairs.a_high[k], pairs.a_low[k]);
            band[i][0] += w * a * a;
            // Where there is one variable b is 0 and both of these add nothing.
            band[j][0] += w * b * b;
            band[i][i - j] += w * a * b;
        }
    }

    fn add_terms(&mut self, layout: &Layout, terms: &Affines, share: &[f64], weight: f64) {
        for (row, share) in share.iter().enumerate() {
            self.add_form(layout, terms, row, weight * share);
        }
    }

    /// Adds w a aᵀ of a form near in the chain.
    fn add_form(&mut self, layout: &Layout, forms: &Affines, row: usize, w: f64) {
        let (nl, m) = (layout.local, self.matrix.m);
        for (p, (i, a)) in forms.entries(row).enumerate() {
            for (q, (j, b)) in forms.entries(row).enumerate() {
                let value = w * a * b;
                match (i < nl, j < nl) {
                    (true, true) if p == q => self.matrix.band[i][0] += value,
                    (true, true) if i > j => self.matrix.band[i][i - j] += value,
                    (true, false) => self.matrix.border[(j - nl) * nl + i] += value,
                    (false, false) => self.matrix.corner[(i - nl) * m + (j - nl)] += value,
                    _ => {}
                }
            }
        }
    }

    /// Adds w v vᵀ by one more unknown: column sqrt(|w|) v, corner -sign(w).
    fn add_vector(&mut self, layout: &Layout, column: usize, v: &[f64], w: f64) {
        let (nl, m) = (layout.local, self.matrix.m);
        let root = w.abs().sqrt();
        for (to, v) in self.matrix.border[column * nl..(column + 1) * nl].iter_mut().zip(v) {
            *to = root * v;
        }
        for c in 0..layout.common {
            let value = root * v[nl + c];
            self.matrix.corner[c * m + column] = value;
            self.matrix.corner[column * m + c] = value;
        }
        self.matrix.corner[column * m + column] = if w > 0.0 { -1.0 } else { 1.0 };
    }

    fn add_far(&mut self, layout: &Layout, row: usize, column: usize, w: f64) {
        let (nl, m) = (layout.local, self.matrix.m);
        let root = w.sqrt();
        for (i, a) in layout.far.entries(row) {
            if i < nl {
                self.matrix.border[column * nl + i] = root * a;
            } else {
                self.matrix.corner[(i - nl) * m + column] = root * a;
                self.matrix.corner[column * m + (i - nl)] = root * a;
            }
        }
        self.matrix.corner[column * m + column] = -1.0;
    }

    /// Solves M d = r in place.
    pub(super) fn solve(&mut self, layout: &Layout, r: &mut [f64]) {
        let (chain, common) = r.split_at_mut(layout.local);
        self.rest.clear();
        self.rest.extend_from_slice(common);
        self.rest.resize(self.matrix.m, 0.0);
        self.matrix.solve(chain, &mut self.rest);
        common.copy_from_slice(&self.rest[..layout.common]);
    }

    /// One step of iterative refinement of M d = r with the same factors: `d` is improved.
    pub(super) fn refine(&mut self, layout: &Layout, state: &State, r: &[f64], d: &mut [f64]) {
        let mut left = std::mem::take(&mut self.trial);
        left.clear();
        left.extend_from_slice(r);
        let mut slope = std::mem::take(&mut self.slope);
        slope.clear();
        slope.resize(layout.limits(), 0.0);
        state.slopes(layout, d, &mut slope);
        for (slope, ratio) in slope.iter_mut().zip(&self.ratio) {
            *slope *= -ratio;
        }
        state.add_gradients(layout, &slope, &mut left);
        if let Objective::Sum(terms) = &layout.objective {
            subtract_curvature(terms, &state.objective, 1.0, d, &mut left);
        }
        let rows = layout.rows();
        for (k, (terms, sum)) in layout.sums.iter().zip(&state.sums).enumerate() {
            subtract_curvature(terms, sum, state.z[rows + k], d, &mut left);
        }
        self.solve(layout, &mut left);
        for (d, left) in d.iter_mut().zip(&left) {
            *d += left;
        }
        (self.trial, self.slope) = (left, slope);
    }
}

/// out -= w (Σ p a aᵀ - g gᵀ) d.
fn subtract_curvature(terms: &Affines, sum: &SumState, w: f64, d: &[f64], out: &mut [f64]) {
    let along: f64 = sum.gradient.iter().zip(d).map(|(g, d)| g * d).sum();
    for (row, share) in sum.share.iter().enumerate() {
        // Σ p (a·d) a - (g·d) g = Σ p (a·d - g·d) a: no cancellation between large parts.
        let value = w * share * (terms.slope(row, d) - along);
        terms.entries(row).for_each(|(i, a)| out[i] -= value * a);
    }
}

const _: () = assert!(BAND >= 2, "two variables per zone and its neighbour");
