//! Classes on either side of a margin: their evidence against integrals, and what it says of whole samples.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use precut_calc::calculator::{
    Design, Failure, Hypothesis, JacobianColumn, Prediction, Range, Smooth, Treatment, Unwatched, Variable,
};
use precut_calc::diagnosis::{Data, Effort, Foundation, Layout, Setting, Subject, Verdict, Weighing, adequacy};
use precut_calc::effects::DEFLECTION_CAUSES;
use precut_trials::Random;
use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

/// Spread of the margins.
const SPREAD: f64 = 0.05;
/// Prior standard deviation of the shift.
const PRIOR_SD: f64 = 0.2;

/// Margins m_i = base_i + theta, one hypothesis, with an allowance for the level.
struct Shifted {
    hypotheses: Vec<Hypothesis>,
    base: Vec<f64>,
    level: f64,
}

impl Shifted {
    fn new(base: Vec<f64>, range: Range, level: f64) -> Self {
        let treatment = Treatment::Amplitude { prior_sd: PRIOR_SD };
        let variable = Variable { name: "shift", unit: "1", treatment, range };
        let (cause, label) = (&DEFLECTION_CAUSES[0], String::new());
        let hypothesis = Hypothesis { cause, label, variables: vec![variable], prior_weight: 1.0, held: None };
        Self { hypotheses: vec![hypothesis], base, level }
    }
}

impl Subject for Shifted {
    fn hypotheses(&self) -> &[Hypothesis] {
        &self.hypotheses
    }

    fn predict(&self, effects: &[Setting]) -> Result<Vec<Prediction>, Failure> {
        let shift = effects.first().map_or(0.0, |setting| setting.values[0]);
        Ok(self.base.iter().map(|base| Ok(base + shift)).collect())
    }

    fn jacobian(&self, _: &[Setting], of: &[(usize, usize)]) -> Result<Vec<JacobianColumn>, Failure> {
        Ok(of.iter().map(|_| vec![1.0; self.base.len()]).collect())
    }

    fn nuisances(&self) -> Result<Vec<JacobianColumn>, Failure> {
        Ok(if self.level > 0.0 { vec![vec![self.level; self.base.len()]] } else { Vec::new() })
    }
}

fn data(sides: Vec<f64>) -> Data {
    let count = sides.len();
    let all: Vec<usize> = (0..count).collect();
    let design = Design {
        smooth: Smooth::None,
        cell: all.clone(),
        regressors: Vec::new(),
        groupings: Vec::new(),
        conditions: Vec::new(),
        order: None,
        fold: vec![0; count],
    };
    let layout = Layout { traces: vec![all], run_of_trace: vec![0], design };
    Data { value: vec![0.0; count], uncertainty: Some(vec![SPREAD; count]), sides: Some(sides), layout }
}

/// Margins of a scan across the limit, and classes as they fall when the limit lies `shift` away.
fn scan(count: usize, shift: f64) -> (Vec<f64>, Vec<f64>) {
    scan_that_scatters(count, shift, SPREAD)
}

/// The same where margins scatter as far as `spread`.
fn scan_that_scatters(count: usize, shift: f64, spread: f64) -> (Vec<f64>, Vec<f64>) {
    let base: Vec<f64> = (0..count).map(|i| 0.4 * (i as f64 / (count as f64 - 1.0) - 0.5)).collect();
    // Quantiles of the scatter in an order without pattern: a sample that is as even as can be.
    let normal = Normal::standard();
    let scatter = |i: usize| {
        let turned = (0.5 + 0.618_033_988_749_895 * i as f64).fract();
        spread * normal.inverse_cdf(turned.clamp(0.01, 0.99))
    };
    let sides = base.iter().enumerate().map(|(i, m)| if m + shift + scatter(i) > 0.0 { 1.0 } else { -1.0 }).collect();
    (base, sides)
}

fn weighed<T>(subject: &Shifted, data: &Data, look: impl FnOnce(&Weighing<'_>) -> T) -> T {
    let foundation = Foundation::of(subject, data, &Unwatched).unwrap();
    look(&Weighing::of(&foundation, vec![true; data.value.len()], Effort::full(1), &Unwatched).unwrap())
}

/// ln of the probability of a class at a margin on its side: Student's t with five degrees of freedom, whose variance is 5/3, of
/// the spread.
fn log_probability(margin: f64) -> f64 {
    StudentsT::new(0.0, 1.0, 5.0).unwrap().cdf((5.0_f64 / 3.0).sqrt() * margin / SPREAD).ln()
}

/// ln of the mean of the likelihood under a Gaussian of this standard deviation, by the trapezoidal rule: of so smooth an
/// integrand that falls to nothing on both sides it converges faster than any power of the step.
fn integral(base: &[f64], sides: &[f64], sd: f64, one_sided: bool) -> f64 {
    let (count, reach) = (4000, 8.0);
    let step = 2.0 * reach / f64::from(count);
    let at = |k: i32| {
        let t = -reach + step * f64::from(k);
        if one_sided && t < 0.0 {
            return 0.0;
        }
        let of = |(base, side): (&f64, &f64)| log_probability(side * (base + sd * t));
        let weight = if one_sided && t.abs() < 1e-12 { 0.5 } else { 1.0 };
        let log_likelihood: f64 = base.iter().zip(sides).map(of).sum();
        weight * (log_likelihood - 0.5 * t * t).exp()
    };
    let sum: f64 = (0..=count).map(at).sum();
    let doubled = if one_sided { 2.0_f64.ln() } else { 0.0 };
    (sum * step).ln() - 0.5 * (2.0 * std::f64::consts::PI).ln() + doubled
}

/// ln of the Bayes factor of the shift over nothing, from the weights: prior 0.38 against 0.5.
fn log_odds(weighing: &Weighing<'_>) -> f64 {
    let set = weighing.named_sets().next().unwrap();
    (set.posterior / weighing.none).ln() - (0.38_f64 / 0.5).ln()
}

const WIDE: Range = Range { lower: -10.0, upper: 10.0 };

/// Laplace's approximation of an integral over a sample of n rows is off by a term in 1/n: here below 0.02 in the logarithm
/// with 40 rows, and about half of that with twice as many.
#[test]
fn the_evidence_is_the_integral_of_the_likelihood() {
    let mut errors = Vec::new();
    for count in [20, 40, 80, 160] {
        let (base, sides) = scan(count, 0.06);
        let subject = Shifted::new(base.clone(), WIDE, 0.0);
        let nothing: f64 = base.iter().zip(&sides).map(|(m, s)| log_probability(s * m)).sum();
        let exact = integral(&base, &sides, PRIOR_SD, false) - nothing;
        let found = weighed(&subject, &data(sides), log_odds);
        errors.push((found - exact).abs());
    }
    assert!(errors[0] < 0.06 && errors[1] < 0.03 && errors[2] < 0.015 && errors[3] < 0.008, "{errors:?}");
}

/// The worked case of the documentation.
#[test]
fn four_cuts_are_few() {
    let (base, sides) = (vec![0.1, 0.05, 0.0, -0.05], vec![1.0, -1.0, -1.0, -1.0]);
    let exact = integral(&base, &sides, PRIOR_SD, false);
    assert!((exact + 2.410_04).abs() < 1e-4, "{exact}");
    let (odds, shift) = weighed(&Shifted::new(base, WIDE, 0.0), &data(sides), |weighing| {
        (log_odds(weighing), weighing.named_sets().next().unwrap().settings[0].values[0])
    });
    // -2.45918 - -2.92030, and the mode to the last step of the refinement.
    assert!((odds - 0.461_12).abs() < 1e-4 && (shift + 0.075_55).abs() < 1e-3, "{odds} {shift}");
}

#[test]
fn a_size_with_one_sign_doubles_its_prior_there() {
    let (base, sides) = scan(60, 0.02);
    let nothing: f64 = base.iter().zip(&sides).map(|(m, s)| log_probability(s * m)).sum();
    let exact = integral(&base, &sides, PRIOR_SD, true) - nothing;
    let subject = Shifted::new(base, Range { lower: 0.0, upper: 10.0 }, 0.0);
    let found = weighed(&subject, &data(sides), log_odds);
    // As above, and the skewness in the share of the posterior on the allowed side.
    assert!((found - exact).abs() < 0.05, "{found} {exact}");
}

/// The level is a second Gaussian shift: shift and level together are one shift with the variances added.
#[test]
fn allowances_are_integrated_over() {
    let (base, sides) = scan(80, 0.06);
    let level = 0.04;
    let subject = Shifted::new(base.clone(), WIDE, level);
    let with = integral(&base, &sides, (PRIOR_SD * PRIOR_SD + level * level).sqrt(), false);
    let without = integral(&base, &sides, level, false);
    let found = weighed(&subject, &data(sides), log_odds);
    // Two approximations of 80 rows.
    assert!((found - (with - without)).abs() < 0.03, "{found} {}", with - without);
}

#[test]
fn the_fitted_shift_is_where_the_posterior_is_highest_and_its_interval_holds_the_truth() {
    let (base, sides) = scan(200, 0.08);
    let subject = Shifted::new(base.clone(), WIDE, 0.0);
    let (value, sd) = weighed(&subject, &data(sides.clone()), |weighing| {
        let set = weighing.named_sets().next().unwrap();
        (set.settings[0].values[0], set.standard_deviations[0][0])
    });
    let posterior = |shift: f64| -> f64 {
        let rows = base.iter().zip(&sides).map(|(m, s)| log_probability(s * (m + shift)));
        rows.sum::<f64>() - 0.5 * (shift / PRIOR_SD).powi(2)
    };
    // Its derivative by central differences: truncation of order (1e-4/0.05)^2, and the last step was below 0.01 sd.
    let slope = (posterior(value + 1e-4) - posterior(value - 1e-4)) / 2e-4;
    let curvature = (posterior(value + 1e-3) - 2.0 * posterior(value) + posterior(value - 1e-3)) / 1e-6;
    assert!((slope * sd).abs() < 0.02, "{slope}");
    assert!((sd * (-curvature).sqrt() - 1.0).abs() < 0.02, "{sd} {curvature}");
    assert!((value - 0.08).abs() < 2.0 * sd, "{value} {sd}");
}

#[test]
fn classes_of_one_side_are_weighed_without_running_away() {
    let base = vec![0.1; 30];
    let right = weighed(&Shifted::new(base.clone(), WIDE, 0.0), &data(vec![1.0; 30]), |w| w.none);
    // Two spreads inside the limit, as seen: nothing is wrong.
    assert!(right > 0.5, "{right}");
    let (wrong, shift) = weighed(&Shifted::new(base, WIDE, 0.0), &data(vec![-1.0; 30]), |w| {
        (w.none, w.named_sets().next().unwrap().settings[0].values[0])
    });
    // Beyond the limit by as much as the prior still believes: no more than a few of its standard deviations.
    assert!(wrong < 1e-6 && shift < -0.1 && shift > -3.0 * PRIOR_SD, "{wrong} {shift}");
}

/// The p-value of the deviance counts draws from the base: a sample as the base draws them is in the middle, one from elsewhere
/// in the tail.
#[test]
fn the_deviance_is_judged_by_draws_of_the_base() {
    for (shift, low, high) in [(0.0, 0.05, 1.0), (0.1, 0.0, 0.001)] {
        let (base, sides) = scan(80, shift);
        let tests = weighed(&Shifted::new(base, WIDE, 0.005), &data(sides), |of| adequacy(of, &Unwatched).unwrap());
        assert_eq!(tests.len(), 1);
        assert!((low..=high).contains(&tests[0].p), "{shift}: {:?}", tests[0]);
    }
}

/// A shift is likely in both scans. One scatters as the shift foresees, the other four times as far: no limit that moved does that.
#[test]
fn a_likely_set_that_classes_speak_against_is_not_named() {
    for (spread, named) in [(SPREAD, true), (4.0 * SPREAD, false)] {
        let (base, sides) = scan_that_scatters(120, 0.12, spread);
        let (verdict, likely) = weighed(&Shifted::new(base, WIDE, 0.0), &data(sides), |weighing| {
            (weighing.verdict.clone(), weighing.named_sets().next().unwrap().posterior)
        });
        assert!(likely > 0.9, "{likely}");
        assert_eq!(verdict, if named { Verdict::Named(vec![0]) } else { Verdict::Unknown(Vec::new()) });
    }
}

/// A set is objected to no more often than the level says where nothing else acts: 4 of 100 at 1 % are three deviations.
#[test]
fn a_true_set_is_rarely_objected_to() {
    let (base, _) = scan(60, 0.0);
    let student = StudentsT::new(0.0, 1.0, 5.0).unwrap();
    let mut random = Random::new(9);
    let objected = (0..100).filter(|_| {
        let mut scatter = || SPREAD * (3.0_f64 / 5.0).sqrt() * student.inverse_cdf(random.uniform(0.0, 1.0));
        let sides = base.iter().map(|m| if m + 0.15 + scatter() > 0.0 { 1.0 } else { -1.0 }).collect();
        let verdict = weighed(&Shifted::new(base.clone(), WIDE, 0.0), &data(sides), |of| of.verdict.clone());
        verdict == Verdict::Unknown(Vec::new())
    });
    assert!(objected.count() <= 4);
}
