//! First-order semi-discretisation (Insperger, Stepan 2011) with the exact mean of the coefficient over a step: an
//! independent second method. x one period before is linear over a step; only x is delayed.

use nalgebra::DMatrix;

/// q' = A q + B(t) x + C(t) x(t - T) on the last coordinate pair: x'' as the last row of a state (x, v).
pub struct Equation<'a> {
    pub a: DMatrix<f64>,
    /// Direction in which the coefficients push.
    pub push: DMatrix<f64>,
    pub period: f64,
    /// Mean over from..to of the coefficient of x and of x(t - T).
    pub mean: &'a dyn Fn(f64, f64) -> (f64, f64),
}

/// Modulus of the largest multiplier with m steps to the period.
pub fn multiplier(of: &Equation<'_>, m: usize) -> f64 {
    let n = of.a.nrows();
    let h = of.period / m as f64;
    let dimension = n + m;
    let mut total = DMatrix::<f64>::identity(dimension, dimension);
    for i in 0..m {
        let (present, delayed) = (of.mean)(i as f64 * h, (i + 1) as f64 * h);
        let mut a = of.a.clone();
        for row in 0..n {
            a[(row, 0)] += present * of.push[(row, 0)];
        }
        // q and the ramp of the delayed x: d/dt (q, u, s) = (A q + push delayed u, s, 0).
        let mut extended = DMatrix::<f64>::zeros(n + 2, n + 2);
        extended.view_mut((0, 0), (n, n)).copy_from(&a);
        for row in 0..n {
            extended[(row, n)] = delayed * of.push[(row, 0)];
        }
        extended[(n, n + 1)] = 1.0;
        let step = (extended * h).exp();
        // State: q, then x at the steps before, newest first; x(t_i - T) is the last, x(t_i - T + h) the one before.
        let mut map = DMatrix::<f64>::zeros(dimension, dimension);
        for row in 0..n {
            for column in 0..n {
                map[(row, column)] = step[(row, column)];
            }
            let (u, s) = (step[(row, n)], step[(row, n + 1)] / h);
            map[(row, dimension - 1)] += u - s;
            let next = if m == 1 { 0 } else { dimension - 2 };
            map[(row, next)] += s;
        }
        map[(n, 0)] = 1.0;
        for k in 1..m {
            map[(n + k, n + k - 1)] = 1.0;
        }
        total = map * total;
    }
    total.complex_eigenvalues().iter().map(|value| value.norm()).fold(0.0, f64::max)
}
