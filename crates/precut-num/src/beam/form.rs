//! Polynomials over an interval, written in its two barycentric coordinates.
//!
//! `xi = (x - a) / h`, `eta = (b - x) / h`; a form of degree `n` is `sum c_k xi^k eta^(n-k)`. Products of forms
//! with coefficients of one sign lose no digits, and a form with `c_0 = c_1 = 0` vanishes at `a` like `xi²` to full
//! relative accuracy: what a power of the place itself would lose.

use super::model::Side;

const ORDINALS: [f64; DEGREE + 1] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0];

/// The highest degree that occurs: compliance less the squares of cubic influence functions.
const DEGREE: usize = 6;

/// A form of degree `N - 1`, by its coefficients.
///
/// The degree belongs to the type: the few operations on forms are then straight lines of code.
#[derive(Debug, Clone, Copy)]
pub(super) struct Form<const N: usize>(pub(super) [f64; N]);

/// A form of the common degree, ready to be sampled.
pub(super) type Raised = Form<{ DEGREE + 1 }>;

impl<const N: usize> Form<N> {
    pub(super) const ZERO: Self = Self([0.0; N]);

    /// The same function, of a higher degree: times a power of `xi + eta`.
    #[inline]
    pub(super) fn raised<const M: usize>(self) -> Form<M> {
        const { assert!(N <= M) };
        let mut coefficients = [0.0; M];
        coefficients[..N].copy_from_slice(&self.0);
        for count in N..M {
            for k in (0..count).rev() {
                coefficients[k + 1] += coefficients[k];
            }
        }
        Form(coefficients)
    }

    /// Sum with a form of at most this degree.
    #[inline]
    pub(super) fn plus<const M: usize>(mut self, other: Form<M>) -> Self {
        for (mine, theirs) in self.0.iter_mut().zip(other.raised::<N>().0) {
            *mine += theirs;
        }
        self
    }

    /// Product; the degrees add up.
    #[inline]
    pub(super) fn times<const M: usize, const R: usize>(self, other: Form<M>) -> Form<R> {
        const { assert!(R + 1 == N + M) };
        let mut coefficients = [0.0; R];
        for (i, mine) in self.0.iter().enumerate() {
            for (j, theirs) in other.0.iter().enumerate() {
                coefficients[i + j] += mine * theirs;
            }
        }
        Form(coefficients)
    }

    /// The integral over `xi` from the start to the place, or with `Side::Right` from the place to the end: running sums
    /// of the coefficients in Bernstein's basis.
    #[inline]
    pub(super) fn accumulated<const R: usize>(self, side: Side) -> Form<R> {
        const { assert!(R == N + 1 && N <= DEGREE) };
        let place = |k: usize, count: usize| if side == Side::Left { k } else { count - 1 - k };
        let mut coefficients = [0.0; R];
        let mut sum = 0.0;
        // Binomial coefficients of this degree and of the next one.
        let (mut own, mut next) = (1.0, 1.0);
        let size = ORDINALS[N];
        for k in 0..N {
            sum += self.0[place(k, N)] / own;
            own *= (size - 1.0 - ORDINALS[k]) / ORDINALS[k + 1];
            next *= (size - ORDINALS[k]) / ORDINALS[k + 1];
            coefficients[place(k + 1, R)] = next * sum / size;
        }
        Form(coefficients)
    }

    /// With the ends of the interval exchanged.
    pub(super) fn mirrored(mut self) -> Self {
        self.0.reverse();
        self
    }

    /// Multiplied by a number.
    #[inline]
    pub(super) fn scaled(mut self, factor: f64) -> Self {
        for coefficient in &mut self.0 {
            *coefficient *= factor;
        }
        self
    }
}

/// An interval as [`sample`] needs it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Span {
    pub(super) start: f64,
    pub(super) end: f64,
    pub(super) inverse_length: f64,
}

/// Appends the values of a form at the places: one loop without branches that the compiler can vectorise.
///
/// Both coordinates are formed by themselves, so that each is exactly 0 at its end.
pub(super) fn sample(form: &Raised, span: Span, places: &[f64], into: &mut Vec<f64>) {
    let Form([c0, c1, c2, c3, c4, c5, c6]) = *form;
    let Span { start, end, inverse_length } = span;
    into.extend(places.iter().map(|&place| {
        let xi = (place - start) * inverse_length;
        let eta = (end - place) * inverse_length;
        let (xx, xe, ee) = (xi * xi, xi * eta, eta * eta);
        ee * ee * (c0 * ee + c1 * xe) + xe * xe * (c2 * ee + c3 * xe + c4 * xx) + xx * xx * (c5 * xe + c6 * xx)
    }));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value<const N: usize>(form: Form<N>, xi: f64) -> f64 {
        let mut out = Vec::new();
        sample(&form.raised(), Span { start: 0.0, end: 1.0, inverse_length: 1.0 }, &[xi], &mut out);
        out[0]
    }

    #[test]
    fn integrals_agree_with_powers() {
        // xi³ + 2 xi² eta - eta³ over xi, by hand: 1 - 3 xi + 3 xi² ... collected in powers of xi.
        let form = Form([-1.0, 0.0, 2.0, 1.0]);
        let power = |x: f64| -x + 1.5 * x * x - x.powi(3) / 3.0;
        for step in 0..=4 {
            let x = f64::from(step) / 4.0;
            assert!((value(form.accumulated::<5>(Side::Left), x) - power(x)).abs() < 1e-15);
            assert!((value(form.accumulated::<5>(Side::Right), x) - power(1.0) + power(x)).abs() < 1e-15);
        }
    }

    #[test]
    fn arithmetic_agrees_with_values() {
        let (a, b) = (Form([1.0, -2.0, 0.5]), Form([0.3, 4.0, 1.0, -2.0]));
        for step in 0..=8 {
            let xi = f64::from(step) / 8.0;
            let eta = 1.0 - xi;
            let va = eta * eta - 2.0 * xi * eta + 0.5 * xi * xi;
            let vb = 0.3 * eta.powi(3) + 4.0 * xi * eta * eta + xi * xi * eta - 2.0 * xi.powi(3);
            // A dozen operations on numbers of order one.
            assert!((value(a, xi) - va).abs() < 1e-14);
            assert!((value(b.plus(a), xi) - va - vb).abs() < 1e-14);
            assert!((value(a.times::<4, 6>(b).scaled(2.0), xi) - 2.0 * va * vb).abs() < 1e-13);
        }
    }
}
