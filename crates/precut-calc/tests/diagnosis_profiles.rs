//! Profile likelihoods against likelihoods that are known in closed form.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use precut_calc::calculator::{
    Design, Failure, Hypothesis, JacobianColumn, Prediction, Range, Smooth, Treatment, Unwatched, Variable,
};
use precut_calc::diagnosis::{Data, Effort, Foundation, Layout, Profile, SetWeight, Setting, Subject, Weighing};
use precut_calc::effects::DEFLECTION_CAUSES;

const SIGMA: f64 = 0.05;
const PRIOR_SD: f64 = 1.0;

/// f(x) = sum over k of shape(k, theta_k, x).
struct Curves {
    hypotheses: Vec<Hypothesis>,
    x: Vec<f64>,
    shape: fn(usize, f64, f64) -> f64,
}

impl Curves {
    /// One hypothesis of so many sizes.
    fn new(sizes: usize, range: Range, shape: fn(usize, f64, f64) -> f64) -> Self {
        let treatment = Treatment::Amplitude { prior_sd: PRIOR_SD };
        let variable = Variable { name: "size", unit: "1", treatment, range };
        let cause = &DEFLECTION_CAUSES[0];
        let hypothesis =
            Hypothesis { cause, label: String::new(), variables: vec![variable; sizes], prior_weight: 1.0 };
        let x = (0..40).map(|i| f64::from(i) / 39.0).collect();
        Self { hypotheses: vec![hypothesis], x, shape }
    }

    fn at(&self, sizes: &[f64]) -> Vec<f64> {
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
fn data(curves: &Curves, truth: &[f64]) -> Data {
    let noise = |i: usize| SIGMA * 1.4 * (12.9898 * (i as f64 + 1.0)).sin();
    let value = curves.at(truth).iter().enumerate().map(|(i, f)| f + noise(i)).collect();
    let count = curves.x.len();
    let design = Design {
        smooth: Smooth::None,
        cell: (0..count).collect(),
        regressors: Vec::new(),
        groupings: Vec::new(),
        order: None,
        fold: vec![0; count],
    };
    let layout = Layout { traces: vec![(0..count).collect()], run_of_trace: vec![0], design };
    Data { value, uncertainty: Some(vec![SIGMA; count]), sides: None, layout }
}

/// |y - f(theta)|^2 / sigma^2 + |theta|^2 / prior^2, in plain sums.
fn misfit(curves: &Curves, data: &Data, sizes: &[f64]) -> f64 {
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

const WIDE: Range = Range { lower: -10.0, upper: 10.0 };

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
