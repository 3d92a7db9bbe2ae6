//! Profile likelihoods against likelihoods that are known in closed form.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use precut_calc::calculator::{
    Design, Failure, Hypothesis, JacobianColumn, Prediction, Range, Smooth, Treatment, Unwatched, Variable,
};
use precut_calc::diagnosis::{
    Data, Effort, Foundation, Layout, Profile, SetWeight, Setting, Subject, Verdict, Weighing,
};
use precut_calc::effects::DEFLECTION_CAUSES;

pub(crate) const SIGMA: f64 = 0.05;
const PRIOR_SD: f64 = 1.0;

/// f(x) = sum over k of shape(k, theta_k, x).
pub(crate) struct Curves {
    hypotheses: Vec<Hypothesis>,
    x: Vec<f64>,
    shape: fn(usize, f64, f64) -> f64,
    /// Where values do not act each by itself.
    together: Option<fn(&[f64], f64) -> f64>,
}

impl Curves {
    /// One hypothesis of so many sizes.
    pub(crate) fn new(sizes: usize, range: Range, shape: fn(usize, f64, f64) -> f64) -> Self {
        let treatment = Treatment::Amplitude { prior_sd: PRIOR_SD };
        let variable = Variable { name: "size", unit: "1", treatment, range };
        let cause = &DEFLECTION_CAUSES[0];
        let hypothesis =
            Hypothesis { cause, label: String::new(), variables: vec![variable; sizes], prior_weight: 1.0, held: None };
        let x = (0..40).map(|i| f64::from(i) / 39.0).collect();
        Self { hypotheses: vec![hypothesis], x, shape, together: None }
    }

    fn at(&self, sizes: &[f64]) -> Vec<f64> {
        if let Some(together) = self.together.filter(|_| !sizes.is_empty()) {
            return self.x.iter().map(|x| together(sizes, *x)).collect();
        }
        let of = |x: &f64| sizes.iter().enumerate().map(|(k, size)| (self.shape)(k, *size, *x)).sum();
        self.x.iter().map(of).collect()
    }
}

impl Subject for Curves {
    fn hypotheses(&self) -> &[Hypothesis] {
        &self.hypotheses
    }

    fn predict(&self, effects: &[Setting]) -> Result<Vec<Prediction>, Failure> {
        let sizes = effects.first().map_or(&[][..], |setting| &setting.values);
        Ok(self.at(sizes).into_iter().map(Ok).collect())
    }

    fn jacobian(&self, effects: &[Setting], of: &[(usize, usize)]) -> Result<Vec<JacobianColumn>, Failure> {
        let step = 1e-5;
        let column = |&(member, variable): &(usize, usize)| {
            let at = |by: f64| {
                let mut sizes = effects[member].values.clone();
                sizes[variable] += by;
                self.at(&sizes)
            };
            at(step).iter().zip(at(-step)).map(|(above, below)| (above - below) / (2.0 * step)).collect()
        };
        Ok(of.iter().map(column).collect())
    }

    fn nuisances(&self) -> Result<Vec<JacobianColumn>, Failure> {
        Ok(Vec::new())
    }
}

/// Measured values with a known scatter: repeatable, of the size of sigma, without pattern.
pub(crate) fn data(curves: &Curves, truth: &[f64]) -> Data {
    let noise = |i: usize| SIGMA * 1.4 * (12.9898 * (i as f64 + 1.0)).sin();
    let value = curves.at(truth).iter().enumerate().map(|(i, f)| f + noise(i)).collect();
    let count = curves.x.len();
    let design = Design {
        smooth: Smooth::None,
        cell: (0..count).collect(),
        regressors: Vec::new(),
        groupings: Vec::new(),
        conditions: Vec::new(),
        order: None,
        fold: vec![0; count],
    };
    let layout = Layout { traces: vec![(0..count).collect()], run_of_trace: vec![0], design };
    Data { value, uncertainty: Some(vec![SIGMA; count]), sides: None, layout }
}

/// |y - f(theta)|^2 / sigma^2 + |theta|^2 / prior^2, in plain sums.
pub(crate) fn misfit(curves: &Curves, data: &Data, sizes: &[f64]) -> f64 {
    let rows = data.value.iter().zip(curves.at(sizes)).map(|(y, f)| ((y - f) / SIGMA).powi(2)).sum::<f64>();
    rows + sizes.iter().map(|size| (size / PRIOR_SD).powi(2)).sum::<f64>()
}

fn profiled<T>(curves: &Curves, data: &Data, look: impl FnOnce(&SetWeight, &[Profile]) -> T) -> T {
    let foundation = Foundation::of(curves, data, &Unwatched).unwrap();
    let weighing = Weighing::of(&foundation, vec![true; data.value.len()], Effort::full(1), &Unwatched).unwrap();
    let set = weighing.named_sets().next().unwrap();
    let profiles = weighing.profiles(set, 1.96, false, &Unwatched).unwrap();
    look(set, &profiles)
}

pub(crate) const WIDE: Range = Range { lower: -10.0, upper: 10.0 };

#[test]
fn of_a_linear_model_the_profile_is_the_square_of_the_distance() {
    let curves = Curves::new(2, WIDE, |k, size, x| size * if k == 0 { 1.0 } else { x });
    let data = data(&curves, &[0.4, -0.3]);
    profiled(&curves, &data, |set, profiles| {
        assert_eq!(profiles.len(), 2);
        for profile in profiles {
            let (value, sd) = (set.settings[0].values[profile.variable], set.standard_deviations[0][profile.variable]);
            for (at, rise) in profile.value.iter().zip(&profile.rise) {
                // Exact up to the rounding of sums of 40 squares of about 1.
                assert!((rise - ((at - value) / sd).powi(2)).abs() < 1e-8, "{at} {rise}");
            }
            let [low, high] = profile.interval(1.96);
            // The root of the rise is straight: so is what is read off it.
            assert!((low - (value - 1.96 * sd)).abs() < 1e-6 * sd && (high - (value + 1.96 * sd)).abs() < 1e-6 * sd);
            assert!(profile.agrees(value, [value - 1.96 * sd, value + 1.96 * sd], 1.96, 0.2));
        }
    });
}

#[test]
fn of_a_bent_model_the_interval_is_where_the_misfit_says_and_not_where_the_parabola_is() {
    // Grows fast to one side: far from linear over the posterior.
    let curves = Curves::new(1, WIDE, |_, size, x| 0.02 * ((3.0 * size).exp() - 1.0) * x);
    let data = data(&curves, &[0.35]);
    profiled(&curves, &data, |set, profiles| {
        let profile = &profiles[0];
        let (value, sd) = (set.settings[0].values[0], set.standard_deviations[0][0]);
        let cost = |size: f64| misfit(&curves, &data, &[size]);
        let least = profile.value.iter().map(|at| cost(*at)).fold(f64::INFINITY, f64::min);
        for (at, rise) in profile.value.iter().zip(&profile.rise) {
            assert!((rise - (cost(*at) - least)).abs() < 1e-8 * cost(*at), "{at}");
        }
        // Edges by bisection of the misfit itself. Between two points half a standard deviation apart the root of the rise
        // is taken for straight: 0.04 of a standard deviation here, where it bends over one of them.
        let edge = |mut inside: f64, mut outside: f64| {
            for _ in 0..60 {
                let middle = f64::midpoint(inside, outside);
                if cost(middle) - least < 1.96 * 1.96 { inside = middle } else { outside = middle }
            }
            inside
        };
        let [low, high] = profile.interval(1.96);
        assert!((low - edge(value, value - 12.0 * sd)).abs() < 0.04 * sd);
        assert!((high - edge(value, value + 12.0 * sd)).abs() < 0.04 * sd);
        assert!(!profile.agrees(value, [value - 1.96 * sd, value + 1.96 * sd], 1.96, 0.2));
        // Longer where it is flat.
        assert!(value - low > 1.2 * (high - value));
    });
}

#[test]
fn a_walk_ends_at_the_bound_and_so_does_the_interval() {
    let curves = Curves::new(1, Range { lower: 0.0, upper: 10.0 }, |_, size, x| 0.02 * size * x);
    let data = data(&curves, &[0.8]);
    profiled(&curves, &data, |_, profiles| {
        let profile = &profiles[0];
        assert_eq!(profile.value.first(), Some(&0.0));
        assert!(profile.value.windows(2).all(|pair| pair[0] < pair[1]));
        assert!(profile.interval(1.96)[0] >= 0.0);
        // Wider than anything in reach: the bound, where no evidence says otherwise.
        assert!((profile.interval(1e6)[1] - 10.0).abs() < 1e-12);
    });
}

/// The Gaussian evidence of one column, written out: r ~ N(0, sigma^2 + x x'), and what it says of the size.
fn of_one_column(data: &Data, column: &[f64]) -> (f64, f64, f64) {
    let xx = 1.0 + column.iter().map(|x| (x / SIGMA).powi(2)).sum::<f64>();
    let xr = column.iter().zip(&data.value).map(|(x, y)| x * y / SIGMA / SIGMA).sum::<f64>();
    (-0.5 * xx.ln() + 0.5 * xr * xr / xx, xr / xx, xx.sqrt().recip())
}

const RATES: [f64; 4] = [0.5, 1.0, 2.0, 4.0];

/// A size that decays with a rate which is one of a grid.
fn decay(rates: &[f64]) -> Curves {
    let mut curves = Curves::new(2, WIDE, |_, _, _| 0.0);
    let range = Range { lower: 0.0, upper: 1e9 };
    let treatment = Treatment::Shape { grid: rates.to_vec(), prior: None };
    curves.hypotheses[0].variables[1] = Variable { name: "rate", unit: "1", treatment, range };
    curves.together = Some(|sizes, x| sizes[0] * (-sizes[1] * x).exp());
    curves
}

#[test]
fn of_a_shape_on_its_grid_every_point_has_its_share() {
    let curves = decay(&RATES);
    let data = data(&curves, &[0.12, 1.4]);
    let foundation = Foundation::of(&curves, &data, &Unwatched).unwrap();
    let weighing = Weighing::of(&foundation, vec![true; data.value.len()], Effort::full(1), &Unwatched).unwrap();
    let set = weighing.named_sets().next().unwrap();
    let peaks = weighing.peaks(set).unwrap();
    let expected: Vec<(f64, f64, f64)> =
        RATES.iter().map(|rate| of_one_column(&data, &curves.at(&[PRIOR_SD, *rate]))).collect();
    let total: f64 = expected.iter().map(|(log_z, ..)| log_z.exp()).sum();
    for (rate, (log_z, size, sd)) in RATES.iter().zip(&expected) {
        let at = peaks[0][1].iter().position(|peak| (peak.value - rate).abs() < 1e-12).unwrap();
        // Divided differences of a product with the size are exact to 1e-9.
        let found = peaks[0][0][at];
        assert!((found.weight - log_z.exp() / total).abs() < 1e-6, "{found:?} {}", log_z.exp() / total);
        assert!((found.value - size).abs() < 1e-6 && (found.standard_deviation - sd).abs() < 1e-6, "{found:?}");
    }
    // A shape may be anywhere in its cell: half way to its neighbours, a uniform distribution.
    let cell =
        |rate: f64| peaks[0][1].iter().find(|peak| (peak.value - rate).abs() < 1e-12).unwrap().standard_deviation;
    assert!((cell(1.0) - 0.75 / 12.0_f64.sqrt()).abs() < 1e-12 && (cell(4.0) - 2.0 / 12.0_f64.sqrt()).abs() < 1e-12);
    // No single point has it all here, so no single point may give the interval.
    assert!(peaks[0][0].iter().filter(|peak| peak.weight > 0.05).count() > 1);
}

#[test]
fn a_point_of_a_grid_where_the_model_overflows_does_not_drop_its_cause() {
    let curves = decay(&[-800.0, 1.0]);
    let data = data(&curves, &[0.4, 1.0]);
    let foundation = Foundation::of(&curves, &data, &Unwatched).unwrap();
    let weighing = Weighing::of(&foundation, vec![true; data.value.len()], Effort::full(1), &Unwatched).unwrap();
    assert_eq!(weighing.verdict, Verdict::Named(vec![0]));
}
