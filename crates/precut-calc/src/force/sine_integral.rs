//! The integral of a power of the sine, as it occurs along a tool's nose and over the arc of a face mill.

/// Terms of the series: at phi = 90 degrees each halves the remainder, 2^-50 of it is left.
const TERMS: usize = 50;

/// I(phi) = integral of sin^a from 0 to phi for 0 <= phi <= 180 degrees, a in (0, 2]; beyond 90 degrees by
/// I(phi) = 2 I(90°) - I(180° - phi).
///
/// With u = sin²(phi/2) it is 2^a times the incomplete beta function of u with both parameters
/// (a+1)/2, whose series u^(b+1) sum_k c_k u^k/(b+1+k), b = (a-1)/2, c_k = c_(k-1) (k-1-b)/k,
/// converges at least like 2^-k. Expected relative error 2e-15. Any u is welcome, however small,
/// since no angle is formed.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SineIntegral {
    /// b + 1
    exponent: f64,
    coefficients: [f64; TERMS],
}

impl SineIntegral {
    /// For sin^`power`.
    pub(crate) fn new(power: f64) -> Self {
        let b = 0.5 * (power - 1.0);
        let mut coefficients = [0.0; TERMS];
        let (mut binomial, mut k) = (power.exp2(), 0.0);
        for coefficient in &mut coefficients {
            *coefficient = binomial / (b + 1.0 + k);
            k += 1.0;
            binomial *= (k - 1.0 - b) / k;
        }
        Self { exponent: b + 1.0, coefficients }
    }

    /// I(phi) for u = sin²(phi/2), 0 < u < 1.
    pub(crate) fn at(&self, u: f64) -> f64 {
        if u > 0.5 { 2.0 * self.up_to_square(0.5) - self.up_to_square(1.0 - u) } else { self.up_to_square(u) }
    }

    /// The same for 0 < u <= 1/2.
    fn up_to_square(&self, u: f64) -> f64 {
        // Even and odd terms apart: two chains that the processor runs at the same time.
        let square = u * u;
        let (mut even, mut odd) = (0.0, 0.0);
        for pair in self.coefficients.chunks_exact(2).rev() {
            even = even * square + pair[0];
            odd = odd * square + pair[1];
        }
        u.powf(self.exponent) * (even + u * odd)
    }
}
