//! The period map of q' = A q - b [a(t) x + c(t) x(t - T)], x = q_0, coefficients of period T.
//!
//! The period is cut into elements inside which a and c are smooth. On an element with the Gauss points c_i,
//!
//! ```text
//!     x_i = e_0 exp(A c_i h) q(0) - sum_j K_ij (a_j x_j + c_j x_j(t - T)),
//!     q(h) = exp(A h) q(0) - sum_j k_j (a_j x_j + c_j x_j(t - T)):
//! ```
//!
//! one P x P system per element, whatever the size of A, and all integrals depend on A and h alone. The map acts on
//! (q(0), x at the points of the period before). Only x is delayed.

use super::rule::{Matrix, Propagator, times};

/// One element with its coefficients, ready to be applied.
#[derive(Debug, Clone)]
struct Active<const N: usize, const P: usize> {
    whole: Matrix<N>,
    /// x at the points by q(0).
    by_state: [[f64; N]; P],
    /// x at the points by x one period before.
    by_history: [[f64; P]; P],
    /// q at the end by the forces at the points.
    end_by_force: [[f64; N]; P],
    present: [f64; P],
    delayed: [f64; P],
}

/// A piece of the period.
#[derive(Debug, Clone)]
enum Piece<const N: usize, const P: usize> {
    /// Nothing but q' = A q: one exponential, no history.
    Free(Matrix<N>),
    /// With coefficients; the index of its history.
    Active(Box<Active<N, P>>, usize),
}

/// The period map, or the product of several that share their history.
#[derive(Debug, Clone, Default)]
pub struct PeriodMap<const N: usize, const P: usize> {
    pieces: Vec<Piece<N, P>>,
    histories: usize,
}

impl<const N: usize, const P: usize> PeriodMap<N, P> {
    /// An empty map, the identity.
    pub fn new() -> Self {
        Self { pieces: Vec::new(), histories: 0 }
    }

    /// Adds a span without coefficients.
    pub fn free(&mut self, whole: Matrix<N>) {
        self.pieces.push(Piece::Free(whole));
    }

    /// Adds an element with the coefficients a of x and c of x(t - T) at its points. Elements with one `history`
    /// lie one period apart. `None` when the equations of the element are singular.
    #[must_use]
    pub fn element(
        &mut self,
        propagator: &Propagator<N, P>,
        present: &[f64; P],
        delayed: &[f64; P],
        history: usize,
    ) -> Option<()> {
        let k = &propagator.points_by_force;
        let mut system: [[f64; P]; P] =
            std::array::from_fn(|i| std::array::from_fn(|j| k[i][j] * present[j] + f64::from(u8::from(i == j))));
        let mut by_state = propagator.at_points;
        let mut by_history: [[f64; P]; P] = std::array::from_fn(|i| std::array::from_fn(|j| -k[i][j] * delayed[j]));
        solve(&mut system, &mut by_state, &mut by_history)?;
        self.histories = self.histories.max(history + 1);
        self.pieces.push(Piece::Active(
            Box::new(Active {
                whole: propagator.whole,
                by_state,
                by_history,
                end_by_force: propagator.end_by_force,
                present: *present,
                delayed: *delayed,
            }),
            history,
        ));
        Some(())
    }

    /// Length of the vector that the map acts on.
    pub fn dimension(&self) -> usize {
        N + P * self.histories
    }

    /// One period on, in place.
    pub fn apply(&self, vector: &mut [f64]) {
        let (state, history) = vector.split_at_mut(N);
        let mut q: [f64; N] = std::array::from_fn(|i| state[i]);
        for piece in &self.pieces {
            match piece {
                Piece::Free(whole) => q = times(whole, &q),
                Piece::Active(element, index) => {
                    let slot = &mut history[index * P..(index + 1) * P];
                    element.apply(&mut q, slot);
                }
            }
        }
        state.copy_from_slice(&q);
    }
}

impl<const N: usize, const P: usize> Active<N, P> {
    #[inline]
    fn apply(&self, q: &mut [f64; N], slot: &mut [f64]) {
        let before: [f64; P] = std::array::from_fn(|j| slot[j]);
        let mut end = times(&self.whole, q);
        for i in 0..P {
            let mut x = 0.0;
            #[allow(clippy::needless_range_loop)] // indices as in the formula
            for j in 0..P {
                x += self.by_history[i][j] * before[j];
            }
            #[allow(clippy::needless_range_loop)] // indices as in the formula
            for k in 0..N {
                x += self.by_state[i][k] * q[k];
            }
            let force = self.present[i] * x + self.delayed[i] * before[i];
            #[allow(clippy::needless_range_loop)] // indices as in the formula
            for k in 0..N {
                end[k] -= self.end_by_force[i][k] * force;
            }
            slot[i] = x;
        }
        *q = end;
    }
}

/// Gaussian elimination with partial pivoting; both right-hand sides become solutions.
fn solve<const N: usize, const P: usize>(
    system: &mut [[f64; P]; P],
    first: &mut [[f64; N]; P],
    second: &mut [[f64; P]; P],
) -> Option<()> {
    for column in 0..P {
        let mut pivot = column;
        for row in column + 1..P {
            if system[row][column].abs() > system[pivot][column].abs() {
                pivot = row;
            }
        }
        if pivot != column {
            system.swap(pivot, column);
            first.swap(pivot, column);
            second.swap(pivot, column);
        }
        let inverse = 1.0 / system[column][column];
        if !inverse.is_finite() {
            return None;
        }
        for value in &mut system[column] {
            *value *= inverse;
        }
        for value in &mut first[column] {
            *value *= inverse;
        }
        for value in &mut second[column] {
            *value *= inverse;
        }
        let (pivot_row, pivot_first, pivot_second) = (system[column], first[column], second[column]);
        for row in 0..P {
            if row == column {
                continue;
            }
            let factor = system[row][column];
            for k in column..P {
                system[row][k] -= factor * pivot_row[k];
            }
            for k in 0..N {
                first[row][k] -= factor * pivot_first[k];
            }
            for k in 0..P {
                second[row][k] -= factor * pivot_second[k];
            }
        }
    }
    Some(())
}
