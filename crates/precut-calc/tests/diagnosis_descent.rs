//! Refinement of models that are far from linear: what is said of them is what they do.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use precut_calc::calculator::Unwatched;
use precut_calc::diagnosis::{Data, Effort, Foundation, Weighing};

use crate::diagnosis_profiles::{Curves, WIDE, data, misfit};

/// Evidence and the size that is found.
fn found(curves: &Curves, data: &Data) -> (f64, f64) {
    let foundation = Foundation::of(curves, data, &Unwatched).unwrap();
    let weighing = Weighing::of(&foundation, vec![true; data.value.len()], Effort::dear(1), &Unwatched).unwrap();
    let size = weighing.named_sets().next().unwrap().settings[0].values[0];
    (weighing.best_evidence(), size)
}

/// Cost and place of the best of many sizes, a thousandth from one to the next.
fn least(curves: &Curves, data: &Data) -> (f64, f64) {
    let of = |k: i32| (misfit(curves, data, &[1e-3 * f64::from(k)]), 1e-3 * f64::from(k));
    (-3000..3000).map(of).min_by(|a, b| a.0.total_cmp(&b.0)).unwrap()
}

/// Where teeth of a tenth stand one beside the other.
fn teeth(size: f64) -> f64 {
    let tooth = |u: f64| (u.rem_euclid(2.0) - 1.0).abs();
    0.1 * (tooth(10.0 * size + 0.3) - tooth(0.3))
}

/// Rows that lie where neither model ever comes, though from every place a straight line leads there. With sigma stated ln Z =
/// -Q/2 - ln|A|/2, and |A| is at least 1: no evidence is above what the best of all sizes leaves.
#[test]
fn what_a_straight_line_foretells_and_the_model_does_not_keep_is_no_evidence() {
    let shapes: [fn(usize, f64, f64) -> f64; 2] =
        [|_, size, x| 0.1 * x * (10.0 * size).sin(), |_, size, x| x * teeth(size)];
    for (number, shape) in shapes.into_iter().enumerate() {
        let curves = Curves::new(1, WIDE, shape);
        for truth in [-0.7, 0.4, 1.3] {
            let data = data(&Curves::new(1, WIDE, |_, size, x| x * size), &[truth]);
            let (evidence, _) = found(&curves, &data);
            let (of_least, of_base) = (-0.5 * least(&curves, &data).0, -0.5 * misfit(&curves, &data, &[0.0]));
            assert!(evidence <= of_least + 1e-9, "{number} {truth}: {evidence}, {of_least}");
            // Where the way ends where it began both are the same sum.
            assert!(evidence >= of_base * (1.0 + 1e-9), "{number} {truth}: {evidence}, {of_base}");
        }
    }
}

/// The straight line through 0 ends where the model is a million times too large.
#[test]
fn a_straight_line_that_leads_astray_is_followed_a_part_of_the_way() {
    let curves = Curves::new(1, WIDE, |_, size, x| 0.05 * ((6.0 * size).exp() - 1.0) * x);
    for truth in [0.3, 0.5, 0.7] {
        let data = data(&curves, &[truth]);
        let (_, size) = found(&curves, &data);
        let (_, best) = least(&curves, &data);
        // The sizes tried are a thousandth apart; the way ends where ln Z gains less than a hundredth: a seventh of a standard
        // deviation, which is below 0.01 here.
        assert!((size - best).abs() < 0.0025, "{truth}: {size}, {best}");
    }
}
