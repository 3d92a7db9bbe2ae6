//! A response surface: a model's values as they depend on a few numbers, to second order about a point.

use crate::calculator::Failure;

/// Steps from the point, tried in this order: where the model cannot be asked that far off it is asked nearer.
const STEPS: [f64; 3] = [1.0, 0.25, 0.0625];

/// v(x) = v0 + sum of slopes_i x_i + sum over i <= j of curvatures_ij x_i x_j, for many values v at once.
#[derive(Debug, Clone)]
pub(crate) struct Surface {
    at_point: Vec<f64>,
    terms: Vec<Term>,
}

/// One term: the product of these coordinates times a coefficient for every value.
#[derive(Debug, Clone)]
struct Term {
    of: Monomial,
    coefficients: Vec<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Monomial {
    Linear(usize),
    Product(usize, usize),
}

/// A model: its values at coordinates. It fails as `OutOfModel` where it has none.
pub(crate) type Model<'a> = dyn FnMut(&[f64]) -> Result<Vec<f64>, Failure> + 'a;

impl Surface {
    /// Of a model about 0, with steps of one in those coordinates that `acts` names: 1 + 2 n + n (n - 1)/2 calls. A
    /// coordinate along which the model cannot be asked at all stays without effect.
    pub(crate) fn of(acts: &[bool], model: &mut Model<'_>) -> Result<Self, Failure> {
        Self::crossed(acts, &|_, _| true, model)
    }

    /// The same with products of those pairs alone that `is_crossed` names.
    pub(crate) fn crossed(
        acts: &[bool],
        is_crossed: &dyn Fn(usize, usize) -> bool,
        model: &mut Model<'_>,
    ) -> Result<Self, Failure> {
        let mut x = vec![0.0; acts.len()];
        let at_point = model(&x)?;
        let mut terms = Vec::new();
        let mut steps: Vec<(usize, f64, Vec<f64>)> = Vec::new();
        for (i, _) in acts.iter().enumerate().filter(|(_, acts)| **acts) {
            for step in STEPS {
                x[i] = step;
                let up = answered(model(&x))?;
                x[i] = -step;
                let down = answered(model(&x))?;
                x[i] = 0.0;
                if let (Some(up), Some(down)) = (up, down) {
                    let of = |f: &dyn Fn(f64, f64, f64) -> f64| -> Vec<f64> {
                        at_point.iter().zip(&up).zip(&down).map(|((v, up), down)| f(*v, *up, *down)).collect()
                    };
                    terms.push(Term {
                        of: Monomial::Linear(i),
                        coefficients: of(&|_, up, down| (up - down) / (2.0 * step)),
                    });
                    terms.push(Term {
                        of: Monomial::Product(i, i),
                        coefficients: of(&|v, up, down| (up - 2.0 * v + down) / (2.0 * step * step)),
                    });
                    steps.push((i, step, up));
                    break;
                }
            }
        }
        for (n, (i, step, up)) in steps.iter().enumerate() {
            for (j, other_step, other_up) in steps[..n].iter().filter(|(j, ..)| is_crossed(*i, *j)) {
                (x[*i], x[*j]) = (*step, *other_step);
                let both = answered(model(&x))?;
                (x[*i], x[*j]) = (0.0, 0.0);
                if let Some(both) = both {
                    let mixed = both.iter().zip(up).zip(other_up).zip(&at_point);
                    let coefficients = mixed.map(|(((both, a), b), v)| (both - a - b + v) / (step * other_step));
                    terms.push(Term { of: Monomial::Product(*i, *j), coefficients: coefficients.collect() });
                }
            }
        }
        Ok(Self { at_point, terms })
    }

    /// The values at the point itself.
    pub(crate) fn at_point(&self) -> &[f64] {
        &self.at_point
    }

    /// The values at coordinates.
    pub(crate) fn at(&self, x: &[f64]) -> Vec<f64> {
        self.sum(x, true)
    }

    /// The values at coordinates by the slopes alone.
    pub(crate) fn linear_at(&self, x: &[f64]) -> Vec<f64> {
        self.sum(x, false)
    }

    fn sum(&self, x: &[f64], is_bent: bool) -> Vec<f64> {
        let mut values = self.at_point.clone();
        for Term { of, coefficients } in &self.terms {
            let factor = match *of {
                Monomial::Linear(i) => x[i],
                Monomial::Product(i, j) if is_bent => x[i] * x[j],
                Monomial::Product(..) => 0.0,
            };
            if factor.abs() <= 0.0 {
                continue;
            }
            values.iter_mut().zip(coefficients).for_each(|(value, coefficient)| *value += factor * coefficient);
        }
        values
    }
}

/// What a model answered; `None` where it could not be asked.
fn answered(of: Result<Vec<f64>, Failure>) -> Result<Option<Vec<f64>>, Failure> {
    match of {
        Ok(values) => Ok(Some(values)),
        Err(Failure::OutOfModel(_)) => Ok(None),
        Err(failure) => Err(failure),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_polynomial_of_second_order_is_met_everywhere() {
        let exact = |x: &[f64]| vec![3.0 + x[0] - 2.0 * x[2] + 0.5 * x[0] * x[0] - 0.7 * x[0] * x[2], x[2] * x[2]];
        let surface = Surface::of(&[true, false, true], &mut |x| Ok(exact(x))).unwrap();
        for x in [[0.0; 3], [3.0, 0.0, -5.0], [-0.3, 0.0, 0.1]] {
            let (found, exact) = (surface.at(&x), exact(&x));
            assert!(found.iter().zip(&exact).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?} {exact:?}");
        }
        assert!((surface.linear_at(&[2.0, 0.0, 0.0])[0] - 5.0).abs() < 1e-12);
    }
}
