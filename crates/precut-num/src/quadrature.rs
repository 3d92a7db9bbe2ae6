//! Gauss-Legendre quadrature.

/// Points and weights of Gauss-Legendre quadrature on 0..1, ascending. Exact for polynomials up to degree 2n-1.
///
/// Newton's method on the Legendre polynomial from the usual cosine guess; points are good to a few units of the
/// last place for the orders used here (up to some 60).
pub fn gauss_legendre(count: usize) -> (Vec<f64>, Vec<f64>) {
    let n = count as f64;
    let mut points = Vec::with_capacity(count);
    let mut weights = Vec::with_capacity(count);
    for i in 0..count {
        let mut x = -(std::f64::consts::PI * (i as f64 + 0.75) / (n + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..100 {
            let (value, derivative) = legendre(count, x);
            slope = derivative;
            let step = value / derivative;
            x -= step;
            // The step after this one would be of the order of its square.
            if step.abs() < 1e-10 {
                slope = legendre(count, x).1;
                break;
            }
        }
        points.push(0.5 * (1.0 + x));
        weights.push(1.0 / ((1.0 - x * x) * slope * slope));
    }
    (points, weights)
}

/// Legendre polynomial of the order and its derivative at x inside -1..1.
fn legendre(order: usize, x: f64) -> (f64, f64) {
    let (mut before, mut value) = (1.0, x);
    if order == 0 {
        return (1.0, 0.0);
    }
    for k in 2..=order {
        let k = k as f64;
        (before, value) = (value, ((2.0 * k - 1.0) * x * value - (k - 1.0) * before) / k);
    }
    (value, order as f64 * (before - x * value) / (1.0 - x * x))
}

/// Integral of `f` from `a` to `b` on `count` Gauss points.
pub fn integrate(a: f64, b: f64, count: usize, mut f: impl FnMut(f64) -> f64) -> f64 {
    let (points, weights) = gauss_legendre(count);
    (b - a) * points.iter().zip(&weights).map(|(c, w)| w * f(a + c * (b - a))).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_up_to_twice_the_order_are_exact() {
        for n in [1_u8, 4, 12, 30] {
            let (points, weights) = gauss_legendre(usize::from(n));
            for degree in 0..2 * i32::from(n) {
                let sum: f64 = points.iter().zip(&weights).map(|(c, w)| w * c.powi(degree)).sum();
                // Round-off of n terms of size 1.
                assert!((sum - 1.0 / f64::from(degree + 1)).abs() < 1e-14, "{n}, {degree}: {sum}");
            }
        }
    }
}
