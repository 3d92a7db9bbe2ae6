//! What a residual costs.

/// Cost rho of a squared residual u = r^2, the residual in units of its scale. All are u for small u.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Loss {
    /// rho = u: least squares.
    Squared,
    /// Squares up to `at`, straight beyond: rho = 2 at sqrt(u) - at^2 (Huber).
    Huber {
        /// Where it turns, in scales; 1.345 loses 5 % of the efficiency on Gaussian noise.
        at: f64,
    },
    /// rho = at^2 ln(1 + u/at^2) (Cauchy): far points lose all influence.
    Cauchy {
        /// Where it turns, in scales; 2.385 loses 5 % of the efficiency on Gaussian noise.
        at: f64,
    },
    /// Minus twice the log density of Student's t with `degrees` degrees of freedom: rho = (degrees + 1) ln(1 + u/degrees).
    StudentT {
        /// Degrees of freedom.
        degrees: f64,
    },
}

impl Loss {
    /// rho(u).
    pub fn cost(self, u: f64) -> f64 {
        match self {
            Self::Squared => u,
            Self::Huber { at } if u <= at * at => u,
            Self::Huber { at } => 2.0 * at * u.sqrt() - at * at,
            Self::Cauchy { at } => at * at * (u / (at * at)).ln_1p(),
            Self::StudentT { degrees } => (degrees + 1.0) * (u / degrees).ln_1p(),
        }
    }

    /// d rho / d u: the weight of a squared residual.
    pub fn weight(self, u: f64) -> f64 {
        match self {
            Self::Squared => 1.0,
            Self::Huber { at } if u <= at * at => 1.0,
            Self::Huber { at } => at / u.sqrt(),
            Self::Cauchy { at } => 1.0 / (1.0 + u / (at * at)),
            Self::StudentT { degrees } => (degrees + 1.0) / (degrees + u),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_weight_is_the_slope_of_the_cost() {
        let losses =
            [Loss::Squared, Loss::Huber { at: 1.3 }, Loss::Cauchy { at: 2.0 }, Loss::StudentT { degrees: 5.0 }];
        for loss in losses {
            for u in [0.01, 1.0, 1.5, 2.0, 30.0, 1e4] {
                let h = 1e-5 * u;
                let slope = (loss.cost(u + h) - loss.cost(u - h)) / (2.0 * h);
                // Central difference: relative truncation of order (h/u)^2, rounding of order 1e-16/1e-5.
                assert!((slope - loss.weight(u)).abs() < 1e-8, "{loss:?} {u}: {slope} {}", loss.weight(u));
            }
        }
    }
}
