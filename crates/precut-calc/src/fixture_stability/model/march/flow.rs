//! What a step does to the vise.

use crate::fixture_stability::model::holding::System;
use crate::num::dde::{Matrix, exponential, times};

use super::Step;

impl<const N: usize> System<N> {
    /// A state as it is kept.
    pub(super) fn step(&self, q: &[f64; N], time_s: f64, force_n: f64, feed_mm: Option<f64>, demand: [f64; 4]) -> Step {
        Step {
            time_s,
            x_mm: q[0],
            velocity_mm_per_s: self.velocity(q, 0),
            jaw_mm: self.jaw.map(|jaw| q[jaw]),
            force_n,
            feed_mm,
            left_demand_n: demand[0],
            right_demand_n: demand[1],
        }
    }
}

/// Propagation over one step: q -> phi q + shift + start F0 + end F1.
#[derive(Clone)]
pub(super) struct Flow<const N: usize> {
    pub(super) a: Matrix<N>,
    pub(super) constant: [f64; N],
    pub(super) phi: Matrix<N>,
    pub(super) shift: [f64; N],
    pub(super) start: [f64; N],
    pub(super) end: [f64; N],
}

impl<const N: usize> Flow<N> {
    pub(super) fn new(system: &System<N>, constant: [f64; N], h: f64) -> Self {
        // Integrals of exp(A (h-s)) times 1 and s/h by their series, on a step short enough for it.
        let mut parts: u32 = 1;
        while crate::num::dde::norm(&system.a) * h / f64::from(parts) > 2.0 && parts < 1 << 20 {
            parts *= 2;
        }
        let sub = h / f64::from(parts);
        let phi_sub = exponential(&system.a, sub);
        let integrals = |v: &[f64; N]| -> ([f64; N], [f64; N]) {
            let (mut one, mut ramp) = ([0.0; N], [0.0; N]);
            let mut term: [f64; N] = std::array::from_fn(|i| v[i] * sub);
            let mut factorial = 1.0;
            for m in 0..40_u32 {
                factorial *= f64::from(m + 1);
                for i in 0..N {
                    one[i] += term[i] / factorial;
                    ramp[i] += term[i] / (factorial * f64::from(m + 2));
                }
                term = times(&system.a, &term);
                for value in &mut term {
                    *value *= sub;
                }
            }
            (one, ramp)
        };
        let (one, ramp) = integrals(&system.b);
        let (shift_sub, _) = integrals(&constant);
        let (mut start, mut end, mut shift) = ([0.0; N], [0.0; N], [0.0; N]);
        for part in 0..parts {
            let (from, width) = (f64::from(part) / f64::from(parts), 1.0 / f64::from(parts));
            let (start_before, end_before, shift_before) =
                (times(&phi_sub, &start), times(&phi_sub, &end), times(&phi_sub, &shift));
            for i in 0..N {
                // F = F0 (1-u) + F1 u with u = from + width s/sub.
                end[i] = end_before[i] + from * one[i] + width * ramp[i];
                start[i] = start_before[i] + (1.0 - from) * one[i] - width * ramp[i];
                shift[i] = shift_before[i] + shift_sub[i];
            }
        }
        Self { a: system.a, constant, phi: exponential(&system.a, h), shift, start, end }
    }

    /// What a step is without the force at its end, which is added by [`Self::ended`].
    #[inline]
    pub(super) fn begun(&self, q: &[f64; N], from_n: f64) -> [f64; N] {
        let moved = times(&self.phi, q);
        std::array::from_fn(|i| moved[i] + self.shift[i] + self.start[i] * from_n)
    }

    #[inline]
    pub(super) fn ended(&self, begun: &[f64; N], to_n: f64) -> [f64; N] {
        std::array::from_fn(|i| begun[i] + self.end[i] * to_n)
    }

    /// The same over a part t of the step, the force rising with `slope`: the Taylor series to round-off.
    pub(super) fn part(&self, b: &[f64; N], q: &[f64; N], from_n: f64, slope_n_per_s: f64, t: f64) -> [f64; N] {
        let mut sum = *q;
        let mut term = *q;
        for m in 1..60_u32 {
            let mut next = times(&self.a, &term);
            for i in 0..N {
                next[i] *= t / f64::from(m);
                match m {
                    1 => next[i] += (self.constant[i] + b[i] * from_n) * t,
                    2 => next[i] += b[i] * slope_n_per_s * 0.5 * t * t,
                    _ => {}
                }
            }
            let size = next.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
            for i in 0..N {
                sum[i] += next[i];
            }
            term = next;
            if m > 2 && size <= 1e-17 * sum.iter().fold(0.0, |m: f64, v| m.max(v.abs())) {
                break;
            }
        }
        sum
    }
}
