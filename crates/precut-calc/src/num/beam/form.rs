//! Polynomials over an interval, written in its two barycentric coordinates.
//!
//! `xi = (x - a) / h`, `eta = (b - x) / h`; a form of degree `n` is `sum c_k xi^k eta^(n-k)`. Products of forms
//! with coefficients of one sign lose no digits, and a form with `c_0 = c_1 = 0` vanishes at `a` like `xi²` to full
//! relative accuracy: what a power of the place itself would lose.

use super::model::Side;

const ORDINALS: [f64; DEGREE + 1] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0];

/// The highest degree that occurs: compliance less the squares of cubic influence functions.
const DEGREE: usize = 6;

/// Coefficients raised to the common degree, ready to be sampled.
pub(super) type Raised = [f64; DEGREE + 1];

/// A form of degree 0..=6.
#[derive(Debug, Clone, Copy)]
pub(super) struct Form {
    coefficients: Raised,
    degree: usize,
}

impl Form {
    /// From its coefficients; at most seven.
    pub(super) fn new(given: &[f64]) -> Self {
        let mut coefficients = [0.0; DEGREE + 1];
        coefficients[..given.len()].copy_from_slice(given);
        Self { coefficients, degree: given.len() - 1 }
    }

    /// The same function, one degree higher: times `xi + eta`.
    fn lifted(mut self) -> Self {
        for k in (0..=self.degree).rev() {
            self.coefficients[k + 1] += self.coefficients[k];
        }
        self.degree += 1;
        self
    }

    /// The coefficients at the common degree.
    pub(super) fn raised(mut self) -> Raised {
        while self.degree < DEGREE {
            self = self.lifted();
        }
        self.coefficients
    }

    /// Sum of two forms of any degree.
    pub(super) fn plus(mut self, mut other: Self) -> Self {
        while self.degree < other.degree {
            self = self.lifted();
        }
        while other.degree < self.degree {
            other = other.lifted();
        }
        for (mine, theirs) in self.coefficients.iter_mut().zip(&other.coefficients) {
            *mine += theirs;
        }
        self
    }

    /// Product; the degrees must add up to at most six.
    pub(super) fn times(&self, other: &Self) -> Self {
        let mut coefficients = [0.0; DEGREE + 1];
        for (i, mine) in self.coefficients[..=self.degree].iter().enumerate() {
            for (j, theirs) in other.coefficients[..=other.degree].iter().enumerate() {
                coefficients[i + j] += mine * theirs;
            }
        }
        Self { coefficients, degree: self.degree + other.degree }
    }

    /// The integral over `xi` from the start to the place, or with `Side::Right` from the place to the end: running sums
    /// of the coefficients in Bernstein's basis. The degree must be below six.
    pub(super) fn accumulated(mut self, side: Side) -> Self {
        let degree = self.degree;
        if side == Side::Right {
            self.coefficients[..=degree].reverse();
        }
        let mut coefficients = [0.0; DEGREE + 1];
        let mut sum = 0.0;
        // Binomial coefficients of this degree and of the next one.
        let (mut own, mut next) = (1.0, 1.0);
        let size = ORDINALS[degree + 1];
        for k in 0..=degree {
            sum += self.coefficients[k] / own;
            own *= (size - 1.0 - ORDINALS[k]) / ORDINALS[k + 1];
            next *= (size - ORDINALS[k]) / ORDINALS[k + 1];
            coefficients[k + 1] = next * sum / size;
        }
        if side == Side::Right {
            coefficients[..=degree + 1].reverse();
        }
        Self { coefficients, degree: degree + 1 }
    }

    /// Multiplied by a number.
    pub(super) fn scaled(mut self, factor: f64) -> Self {
        for coefficient in &mut self.coefficients {
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
    let [c0, c1, c2, c3, c4, c5, c6] = *form;
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

    fn value(form: Form, xi: f64) -> f64 {
        let mut out = Vec::new();
        sample(&form.raised(), Span { start: 0.0, end: 1.0, inverse_length: 1.0 }, &[xi], &mut out);
        out[0]
    }

    #[test]
    fn integrals_agree_with_powers() {
        // xi³ + 2 xi² eta - eta³ over xi, by hand: 1 - 3 xi + 3 xi² ... collected in powers of xi.
        let form = Form::new(&[-1.0, 0.0, 2.0, 1.0]);
        let power = |x: f64| -x + 1.5 * x * x - x.powi(3) / 3.0;
        for step in 0..=4 {
            let x = f64::from(step) / 4.0;
            assert!((value(form.accumulated(Side::Left), x) - power(x)).abs() < 1e-15);
            assert!((value(form.accumulated(Side::Right), x) - power(1.0) + power(x)).abs() < 1e-15);
        }
    }

    #[test]
    fn arithmetic_agrees_with_values() {
        let (a, b) = (Form::new(&[1.0, -2.0, 0.5]), Form::new(&[0.3, 4.0, 1.0, -2.0]));
        for step in 0..=8 {
            let xi = f64::from(step) / 8.0;
            let eta = 1.0 - xi;
            let va = eta * eta - 2.0 * xi * eta + 0.5 * xi * xi;
            let vb = 0.3 * eta.powi(3) + 4.0 * xi * eta * eta + xi * xi * eta - 2.0 * xi.powi(3);
            // A dozen operations on numbers of order one.
            assert!((value(a, xi) - va).abs() < 1e-14);
            assert!((value(a.plus(b), xi) - va - vb).abs() < 1e-14);
            assert!((value(a.times(&b).scaled(2.0), xi) - 2.0 * va * vb).abs() < 1e-13);
        }
    }
}
