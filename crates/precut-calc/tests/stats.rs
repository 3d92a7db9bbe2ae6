//! Regression and its diagnostics against closed forms, refits and simulation.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use precut_calc::num::dense::Columns;
use precut_calc::num::stats::{
    Criteria, Linear, Resampler, anderson_darling, breusch_pagan, collinearity, group_out, holm, lack_of_fit,
    leave_one_out, ljung_box, nested_f, regress, runs_test, t_quantile,
};

/// A constant and `count` columns of noise over `rows` rows, and a response that follows them.
fn data(rows: usize, count: usize, seed: u64) -> (Columns, Vec<f64>) {
    let mut draw = Resampler::new(seed, 0);
    let mut design = Columns::of(rows, [vec![1.0; rows].as_slice()]);
    for _ in 0..count {
        design.push(&(0..rows).map(|_| draw.uniform()).collect::<Vec<_>>());
    }
    let truth: Vec<f64> = (0..=count).map(|j| 1.0 + j as f64).collect();
    let y = design.times(&truth).iter().map(|m| m + 0.1 * draw.normal()).collect();
    (design, y)
}

fn fitted(design: &Columns, y: &[f64]) -> Linear {
    regress(design, y).unwrap()
}

#[test]
fn polynomials_of_high_degree_are_found_to_many_digits() {
    // y = sum x^k at x = 0..20: columns up to 20^5 and 20^10 with condition numbers (of unit columns) of 1e5 and 1e11.
    // Sums of whole numbers below 2^53 are exact, and refinement brings the digits back that conditioning took.
    for (degree, digits) in [(5, 14.0), (10, 11.0)] {
        let x: Vec<f64> = (0..=20).map(f64::from).collect();
        let columns: Vec<Vec<f64>> = (0..=degree).map(|k| x.iter().map(|x| x.powi(k)).collect()).collect();
        let design = Columns::of(21, columns.iter().map(Vec::as_slice));
        let y = design.times(&vec![1.0; columns.len()]);
        let found = fitted(&design, &y);
        let worst = found.coefficients.iter().map(|b| (b - 1.0).abs()).fold(0.0, f64::max);
        assert!(worst < 0.1_f64.powf(digits), "degree {degree}: {worst:e}");
    }
}

#[test]
fn a_straight_line_has_its_textbook_numbers() {
    // x = 1..5, y = 2, 4, 5, 4, 5: slope 0.6, intercept 2.2, RSS 2.4, s^2 = 0.8, se(slope)^2 = 0.08, se(intercept)^2 = 0.88.
    let x: Vec<f64> = (1..=5).map(f64::from).collect();
    let design = Columns::of(5, [[1.0; 5].as_slice(), &x]);
    let fit = fitted(&design, &[2.0, 4.0, 5.0, 4.0, 5.0]);
    let near = |value: f64, expected: f64| assert!((value - expected).abs() < 1e-13, "{value} {expected}");
    near(fit.coefficients[0], 2.2);
    near(fit.coefficients[1], 0.6);
    near(fit.rss, 2.4);
    near(fit.standard_errors()[1].powi(2), 0.08);
    near(fit.standard_errors()[0].powi(2), 0.88);
    // h = 1/5 + (x - 3)^2/10
    for (h, exact) in fit.leverages.iter().zip([0.6, 0.3, 0.2, 0.3, 0.6]) {
        near(*h, exact);
    }
    let (value, se) = fit.predict(&[1.0, 4.0]);
    near(value, 4.6);
    near(se * se, 0.8 * 0.3);
}

#[test]
fn closed_cross_validation_is_the_refit() {
    let (design, y) = data(18, 3, 1);
    let fit = fitted(&design, &y);
    let groups: Vec<Vec<usize>> = vec![vec![0, 1, 2], vec![3], (4..9).collect(), (9..18).collect()];
    let closed_one = leave_one_out(&fit);
    let closed_groups = group_out(&fit, &groups);
    let without = |group: &[usize], i: usize| {
        let rest: Vec<usize> = (0..18).filter(|k| !group.contains(k)).collect();
        let y_rest: Vec<f64> = rest.iter().map(|k| y[*k]).collect();
        y[i] - fitted(&design.take_rows(&rest), &y_rest).predict(&design.row(i)).0
    };
    for i in 0..18 {
        assert!((closed_one[i].unwrap() - without(&[i], i)).abs() < 1e-12);
        let group = groups.iter().find(|g| g.contains(&i)).unwrap();
        assert!((closed_groups[i].unwrap() - without(group, i)).abs() < 1e-11);
    }
    // Student's residual without the row: the same by adding a column that is 1 in that row alone.
    let deleted = fit.deleted_t();
    for i in [0, 7] {
        let mut more = design.clone();
        more.push(&(0..18).map(|k| f64::from(u8::from(k == i))).collect::<Vec<_>>());
        let shifted = fitted(&more, &y);
        let t = shifted.coefficients[4] / shifted.standard_errors()[4];
        assert!((deleted[i].unwrap() - t).abs() < 1e-9, "{t}");
    }
}

#[test]
fn a_row_that_decides_alone_has_no_held_out_error() {
    let design = Columns::of(4, [[1.0; 4].as_slice(), &[0.0, 0.0, 0.0, 1.0]]);
    let fit = fitted(&design, &[1.0, 2.0, 3.0, 9.0]);
    assert_eq!(leave_one_out(&fit)[3], None);
    assert!((leave_one_out(&fit)[0].unwrap() + 1.5).abs() < 1e-12);
    assert_eq!(group_out(&fit, &[vec![2, 3], vec![0, 1]])[2], None);
    assert_eq!(fit.deleted_t()[3], None);
}

#[test]
fn dependent_columns_are_named() {
    let (mut design, y) = data(12, 3, 2);
    let sum: Vec<f64> = (0..12).map(|i| 2.0 * design.at(i, 1) - design.at(i, 3) + 1.0).collect();
    design.push(&sum);
    let mut named = regress(&design, &y).unwrap_err().groups[0].clone();
    named.sort_unstable();
    assert_eq!(named, [0, 1, 3, 4]);
    design = design.take_columns(&[0, 1]);
    design.push(&[0.0; 12]);
    assert_eq!(regress(&design, &y).unwrap_err().groups[0], [2]);
}

#[test]
fn collinearity_is_that_of_two_correlated_columns() {
    // Correlation r: inflation 1/(1 - r^2), condition sqrt((1 + r)/(1 - r)).
    let a = [1.0, -1.0, 1.0, -1.0];
    let b = [1.0, 1.0, -1.0, -1.0];
    let mixed: Vec<f64> = a.iter().zip(b).map(|(a, b)| 0.8 * a + 0.6 * b).collect();
    let found = collinearity(&Columns::of(4, [[1.0; 4].as_slice(), &a, &mixed]));
    assert!((found.inflation[0] - 1.0 / 0.36).abs() < 1e-12);
    assert!((found.condition - 3.0).abs() < 1e-12);
}

#[test]
fn lack_of_fit_is_split_from_pure_error() {
    // Two repeats at x = 0, 1, 2 with means 1, 4, 1 and deviations +-0.5: pure error 1.5 on 3 degrees; the line through
    // is y = 2, lack of fit 2 (1 + 4 + 1) = 12 on 1: F = 24.
    let x = [0.0, 0.0, 1.0, 1.0, 2.0, 2.0];
    let y = [0.5, 1.5, 3.5, 4.5, 0.5, 1.5];
    let fit = fitted(&Columns::of(6, [[1.0; 6].as_slice(), &x]), &y);
    let groups = [vec![0, 1], vec![2, 3], vec![4, 5]];
    let test = lack_of_fit(&fit, &groups, &y).unwrap();
    assert!((test.statistic - 24.0).abs() < 1e-10);
    assert!((test.degrees, test.degrees_below) == (1.0, Some(3.0)));
    // F(1, 3) is t^2 with 3 degrees: P(F > 24) = P(|t| > 4.898979) = 0.01628...
    assert!((t_quantile(1.0 - test.p_value / 2.0, 3.0) - 24.0_f64.sqrt()).abs() < 1e-8);
    let squares: Vec<f64> = x.iter().map(|x| x * x).collect();
    let parabola = fitted(&Columns::of(6, [[1.0; 6].as_slice(), &x, &squares]), &y);
    assert!(lack_of_fit(&parabola, &groups, &y).is_none());
    // No lack of fit left: the parabola's F is (12/1)/(1.5/3) as well.
    assert!((nested_f(&fit, &parabola).unwrap().statistic - 24.0).abs() < 1e-9);
}

#[test]
fn criteria_differ_by_what_a_coefficient_costs() {
    let (a, b) = (Criteria::of(20, 3, 1.7, 0.0), Criteria::of(20, 4, 1.7, 0.0));
    assert!((b.bic - a.bic - 20.0_f64.ln()).abs() < 1e-12);
    assert!((b.aicc.unwrap() - a.aicc.unwrap() - (200.0 / 14.0 - 160.0 / 15.0)).abs() < 1e-12);
    assert_eq!(Criteria::of(5, 4, 1.0, 0.0).aicc, None);
}

#[test]
fn holm_corrects_from_the_smallest() {
    let corrected = holm(&[0.04, 0.01, 0.03, 0.005]);
    for (c, expected) in corrected.iter().zip([0.06, 0.03, 0.06, 0.02]) {
        assert!((c - expected).abs() < 1e-15, "{corrected:?}");
    }
}

/// How often of 2000 draws a test with probability below 0.05 alarms.
fn alarms(test: impl Fn(&mut Resampler) -> f64) -> f64 {
    let hits = (0..2000).filter(|index| test(&mut Resampler::new(11, *index)) < 0.05).count();
    hits as f64 / 2000.0
}

#[test]
fn tests_alarm_as_often_as_they_say() {
    let noise = |draw: &mut Resampler| (0..60).map(|_| draw.normal()).collect::<Vec<f64>>();
    // 5 % with a standard deviation of 0.5 %; four of them, and the approximations' own error of some 1 %.
    let about = |share: f64| assert!((0.02..0.08).contains(&share), "{share}");
    about(alarms(|draw| ljung_box(&noise(draw), 6).unwrap().p_value));
    about(alarms(|draw| runs_test(&noise(draw)).unwrap().p_value));
    about(alarms(|draw| anderson_darling(&noise(draw)).unwrap().p_value));
    about(alarms(|draw| {
        let by = Columns::of(60, [[1.0; 60].as_slice(), &(0..60).map(f64::from).collect::<Vec<_>>()]);
        breusch_pagan(&noise(draw), &by).unwrap().p_value
    }));
    // And they see what they are for.
    let wandering = alarms(|draw| {
        let mut level = 0.0;
        let walk: Vec<f64> = noise(draw)
            .iter()
            .map(|e| {
                level = 0.7 * level + e;
                level
            })
            .collect();
        ljung_box(&walk, 6).unwrap().p_value.max(runs_test(&walk).unwrap().p_value)
    });
    assert!(wandering > 0.9, "{wandering}");
    let skewed =
        alarms(|draw| anderson_darling(&noise(draw).iter().map(|e| e.exp()).collect::<Vec<_>>()).unwrap().p_value);
    assert!(skewed > 0.95, "{skewed}");
    let fanned = alarms(|draw| {
        let x: Vec<f64> = (0..60).map(f64::from).collect();
        let spread: Vec<f64> = noise(draw).iter().zip(&x).map(|(e, x)| e * (1.0 + 0.1 * x)).collect();
        breusch_pagan(&spread, &Columns::of(60, [[1.0; 60].as_slice(), &x])).unwrap().p_value
    });
    assert!(fanned > 0.9, "{fanned}");
}

#[test]
fn intervals_hold_the_truth_as_often_as_they_say() {
    let (mut mean, mut single) = (0, 0);
    for index in 0..2000 {
        let (design, y) = data(10, 2, 1000 + index);
        let fit = fitted(&design, &y);
        let half = fit.half_width(0.9);
        let at = [1.0, 0.3, 0.9];
        let (value, se) = fit.predict(&at);
        let truth = 1.0 + 2.0 * 0.3 + 3.0 * 0.9;
        mean += i32::from((value - truth).abs() <= half * se);
        let new = truth + 0.1 * Resampler::new(77, index).normal();
        single += i32::from((value - new).abs() <= half * (se * se + fit.residual_sd().powi(2)).sqrt());
    }
    // 1800 of 2000 with a standard deviation of 13.4; four of them.
    assert!((mean - 1800).abs() < 54 && (single - 1800).abs() < 54, "{mean} {single}");
}
