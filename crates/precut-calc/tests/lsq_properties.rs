//! What nonlinear least squares must keep besides the reference problems: bounds, priors, robust loss, honest endings.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use std::cell::Cell;

use precut_calc::num::dense::Columns;
use precut_calc::num::lsq::{
    Ending, Loss, Model, NoFit, Noise, Parameter, Settings, Side, fit, from_fn, profile_interval,
};

/// Decay 5 exp(-0.7 t) + 1 at 40 times, with a scatter of 0.01 without pattern.
fn decay() -> (Vec<f64>, Vec<f64>) {
    let t: Vec<f64> = (0..40).map(|i| 0.15 * f64::from(i)).collect();
    let y =
        t.iter().enumerate().map(|(i, t)| 5.0 * (-0.7 * t).exp() + 1.0 + 0.01 * (12.9898 * i as f64).sin()).collect();
    (t, y)
}

fn decay_model<'a>(t: &'a [f64], y: &'a [f64]) -> impl Model + 'a {
    from_fn(t.len(), move |b, into| {
        for ((r, t), y) in into.iter_mut().zip(t).zip(y) {
            *r = b[0] * (-b[1] * t).exp() + b[2] - y;
        }
    })
}

fn starts() -> [Parameter; 3] {
    [Parameter::free(1.0), Parameter::free(0.1), Parameter::free(0.0)]
}

#[test]
fn a_bound_that_holds_gives_the_minimum_on_it() {
    let (t, y) = decay();
    let model = decay_model(&t, &y);
    let [a, rate, offset] = starts();
    let free = fit(&model, &starts(), &Settings::default()).unwrap();
    assert_eq!(free.ending, Ending::Converged);
    let bounded = [a, rate.within(0.0, 0.6), offset];
    let held = fit(&model, &bounded, &Settings::default()).unwrap();
    let same = fit(&model, &[a, rate.held(0.6), offset], &Settings::default()).unwrap();
    assert_eq!((held.ending, same.ending), (Ending::Converged, Ending::Converged));
    assert_eq!(held.at_bound, [false, true, false]);
    assert!((held.parameters[1] - 0.6).abs() < 1e-15);
    assert!(held.objective > free.objective);
    for (x, y) in held.parameters.iter().zip(&same.parameters) {
        // Both are minima over the other two parameters, to the accuracy of the polish.
        assert!((x - y).abs() < 1e-9 * y.abs(), "{x} {y}");
    }
    assert_eq!(held.covariance(Noise::FromResiduals).standard_deviations[1], None);
    // A bound that does not hold changes nothing.
    let wide = fit(&model, &[a, rate.within(0.0, 50.0), offset], &Settings::default()).unwrap();
    assert!(wide.parameters.iter().zip(&free.parameters).all(|(x, y)| (x - y).abs() < 1e-9 * y.abs()));
}

#[test]
fn every_bound_of_a_linear_problem_gives_the_kuhn_tucker_point() {
    // Residuals x - target in the plane, correlated: minimum at the target; corners and edges of a box otherwise.
    for (target, lower, upper) in [([2.0, 3.0], 0.0, 1.0), ([0.5, -3.0], -1.0, 1.0), ([-5.0, 0.2], -2.0, 8.0)] {
        let model = from_fn(3, move |b, into| {
            let d = [b[0] - target[0], b[1] - target[1]];
            into.copy_from_slice(&[d[0], d[1], 0.7 * (d[0] + d[1])]);
        });
        let parameters = [Parameter::free(0.1).within(lower, upper), Parameter::free(0.9).within(lower, upper)];
        let found = fit(&model, &parameters, &Settings::default()).unwrap();
        assert_eq!(found.ending, Ending::Converged);
        let d = [found.parameters[0] - target[0], found.parameters[1] - target[1]];
        let slope = [d[0] + 0.49 * (d[0] + d[1]), d[1] + 0.49 * (d[0] + d[1])];
        for k in 0..2 {
            let p = found.parameters[k];
            let kkt = if p <= lower {
                slope[k] >= 0.0
            } else if p >= upper {
                slope[k] <= 0.0
            } else {
                slope[k].abs() < 1e-8
            };
            assert!(kkt, "{target:?}: {:?} {slope:?}", found.parameters);
        }
    }
}

#[test]
fn a_prior_is_one_more_measurement() {
    // Mean of five numbers of unit noise with prior N(10, 0.5): weights 5 and 4.
    let data = [1.0, 2.0, 3.0, 4.0, 5.0];
    let model = from_fn(5, |b, into| {
        for (r, y) in into.iter_mut().zip(data) {
            *r = b[0] - y;
        }
    });
    let found = fit(&model, &[Parameter::free(0.0).with_prior(10.0, 0.5)], &Settings::default()).unwrap();
    assert!((found.parameters[0] - 55.0 / 9.0).abs() < 1e-12);
    let sd = found.covariance(Noise::Known).standard_deviations[0].unwrap();
    assert!((sd - 1.0 / 3.0).abs() < 1e-12);
    // A prior alone determines what the data do not.
    let silent = from_fn(1, |_, into| into[0] = 0.0);
    let found = fit(&silent, &[Parameter::free(1.0).with_prior(4.0, 2.0)], &Settings::default()).unwrap();
    assert_eq!(found.ending, Ending::Converged);
    assert!((found.parameters[0] - 4.0).abs() < 1e-12);
}

#[test]
fn robust_losses_leave_outliers_behind() {
    let (t, mut y) = decay();
    let clean = fit(&decay_model(&t, &y), &starts(), &Settings::default()).unwrap();
    for i in [4, 17, 29] {
        y[i] += 3.0;
    }
    let scaled = |scale: f64| {
        let (t, y) = (t.clone(), y.clone());
        from_fn(40, move |b: &[f64], into: &mut [f64]| {
            for ((r, t), y) in into.iter_mut().zip(&t).zip(&y) {
                *r = (b[0] * (-b[1] * t).exp() + b[2] - y) / scale;
            }
        })
    };
    let off =
        |parameters: &[f64]| parameters.iter().zip(&clean.parameters).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
    let squares = fit(&scaled(0.01), &starts(), &Settings::default()).unwrap();
    for loss in [Loss::Huber { at: 1.345 }, Loss::Cauchy { at: 2.385 }, Loss::StudentT { degrees: 5.0 }] {
        let robust = fit(&scaled(0.01), &starts(), &Settings { loss, ..Settings::default() }).unwrap();
        assert_eq!(robust.ending, Ending::Converged, "{loss:?}");
        assert!(off(&robust.parameters) < 0.05 * off(&squares.parameters), "{loss:?}: {:?}", robust.parameters);
    }
}

#[test]
fn without_influence_nothing_is_said_to_be_known() {
    // The plateau 3 of both signs: once exp(-b t) has died away, no b is better than another.
    let model = from_fn(10, |b, into| {
        for (i, r) in into.iter_mut().enumerate() {
            *r = b[0] * (1.0 - (-b[1] * (5.0 + i as f64)).exp()) - 3.0 - 0.1 * (i as f64).sin();
        }
    });
    let found = fit(&model, &[Parameter::free(1.0), Parameter::free(40.0)], &Settings::default()).unwrap();
    assert_eq!(found.ending, Ending::Undetermined);
    assert_eq!(found.undetermined, [1]);
    assert_eq!(found.covariance(Noise::FromResiduals).standard_deviations[1], None);
    // Two that only act as a sum.
    let twins = from_fn(6, |b, into| {
        for (i, r) in into.iter_mut().enumerate() {
            *r = (b[0] + b[1]) * i as f64 - 2.0 * i as f64 - 0.01 * (i as f64).cos();
        }
    });
    let found = fit(&twins, &[Parameter::free(1.0), Parameter::free(0.5)], &Settings::default()).unwrap();
    assert_eq!(found.ending, Ending::Undetermined, "{found:?}");
}

#[test]
fn a_fit_that_did_not_converge_says_so() {
    let (t, y) = decay();
    let model = decay_model(&t, &y);
    // No step allowed from far away: the polish alone does not get there.
    let short = Settings { max_iterations: 1, ..Settings::default() };
    let far = [Parameter::free(-300.0), Parameter::free(9.0), Parameter::free(80.0)];
    let found = fit(&model, &far, &short).unwrap();
    assert_ne!(found.ending, Ending::Converged, "{found:?}");
    // A model with a step in it has no slope to follow.
    let jump = from_fn(4, |b, into| into.fill(if b[0] > 0.1 { 1.0 + b[0] } else { 5.0 }));
    let found = fit(&jump, &[Parameter::free(1.0)], &Settings::default()).unwrap();
    assert_ne!(found.ending, Ending::Converged, "{found:?}");
    let asked = Cell::new(0);
    let stop = || {
        asked.set(asked.get() + 1);
        asked.get() > 2
    };
    let found = fit(&model, &starts(), &Settings { stop: Some(&stop), ..Settings::default() }).unwrap();
    assert_eq!((found.ending, asked.get()), (Ending::Stopped, 3));
}

#[test]
fn what_cannot_be_fitted_is_refused() {
    let model = from_fn(1, |b, into| into[0] = b[0].ln());
    let refused = |parameters: &[Parameter]| fit(&model, parameters, &Settings::default()).unwrap_err();
    assert_eq!(refused(&[Parameter::free(-1.0)]), NoFit::UndefinedAtStart(0));
    assert_eq!(refused(&[Parameter::free(f64::NAN)]), NoFit::BadParameter(0));
    assert_eq!(refused(&[Parameter::free(1.0).within(2.0, 3.0)]), NoFit::BadParameter(0));
    assert_eq!(refused(&[Parameter::free(1.0).with_prior(0.0, 0.0)]), NoFit::BadParameter(0));
    let two = [Parameter::free(1.0), Parameter::free(1.0)];
    assert_eq!(refused(&two), NoFit::TooFewResiduals { residuals: 1, parameters: 2 });
}

#[test]
fn given_derivatives_lead_to_the_same_place() {
    struct Exact<'a>(&'a [f64], &'a [f64]);
    impl Model for Exact<'_> {
        fn residual_count(&self) -> usize {
            self.0.len()
        }
        fn residuals(&self, b: &[f64], into: &mut [f64]) {
            for ((r, t), y) in into.iter_mut().zip(self.0).zip(self.1) {
                *r = b[0] * (-b[1] * t).exp() + b[2] - y;
            }
        }
        fn jacobian(&self, b: &[f64], into: &mut Columns) -> bool {
            for (i, t) in self.0.iter().enumerate() {
                let decayed = (-b[1] * t).exp();
                into.set(i, 0, decayed);
                into.set(i, 1, -b[0] * t * decayed);
                into.set(i, 2, 1.0);
            }
            true
        }
    }
    let (t, y) = decay();
    let exact = fit(&Exact(&t, &y), &starts(), &Settings::default()).unwrap();
    let differences = fit(&decay_model(&t, &y), &starts(), &Settings::default()).unwrap();
    assert!(exact.evaluations < differences.evaluations);
    for (x, y) in exact.parameters.iter().zip(&differences.parameters) {
        // Derivatives good to 1e-12 of their size move the minimum by less than 1e-10 of a well-conditioned problem.
        assert!((x - y).abs() < 1e-10 * y.abs(), "{x} {y}");
    }
    let (a, b) = (exact.jacobian(), differences.jacobian());
    for j in 0..3 {
        for (x, y) in a.column(j).iter().zip(b.column(j)) {
            assert!((x - y).abs() < 1e-11 * (1.0 + x.abs()), "{x} {y}");
        }
    }
}

#[test]
fn a_profile_of_a_linear_model_is_its_t_interval() {
    // Straight line: the profile is a parabola, the interval centre +- sd sqrt(rise)/s.
    let model = from_fn(12, |b, into| {
        for (i, r) in into.iter_mut().enumerate() {
            let x = i as f64;
            *r = b[0] + b[1] * x - 2.0 - 0.5 * x - 0.1 * (7.0 * x).sin();
        }
    });
    let parameters = [Parameter::free(0.0), Parameter::free(1.0)];
    let settings = Settings::default();
    let found = fit(&model, &parameters, &settings).unwrap();
    let covariance = found.covariance(Noise::FromResiduals);
    let sd = covariance.standard_deviations[1].unwrap();
    let rise = 4.0 * covariance.residual_sd * covariance.residual_sd;
    for (side, sign) in [(Side::Lower, -1.0), (Side::Upper, 1.0)] {
        let end = profile_interval(&model, &parameters, &settings, &found, (1, side), (rise, sd)).unwrap().unwrap();
        assert!((end - found.parameters[1] - sign * 2.0 * sd).abs() < 1e-3 * sd, "{end}");
    }
    let bounded = [parameters[0], Parameter::free(0.5).within(0.49, 0.51)];
    let none = profile_interval(&model, &bounded, &settings, &found, (1, Side::Upper), (1e9, sd)).unwrap();
    assert_eq!(none, None);
}
