use super::*;
use crate::calculator::{Hypothesis, Shape, Treatment, Unwatched, Variable};
use crate::effects::RING_CAUSES;

/// A wave of two quadratures with a ratio, whose phase turns with its amplitude.
struct Wave {
    hypotheses: Vec<Hypothesis>,
    turns_per_size: f64,
    parts: u32,
}

const ROWS: usize = 200;
const NEAREST: usize = 6;

impl Wave {
    fn new(turns_per_size: f64, ratios: Vec<f64>, parts: u32) -> Self {
        let variable =
            |name, treatment, lower, upper| Variable { name, unit: "mm", treatment, range: Range { lower, upper } };
        let size = || Treatment::Amplitude { prior_sd: 1.0 };
        let prior = (ratios.len() > 1).then_some(Shape { mean: 5.0, sd: 3.0, logarithmic: false });
        let variables = vec![
            variable("cos", size(), -10.0, 10.0),
            variable("sin", size(), -10.0, 10.0),
            variable("ratio", Treatment::Shape { grid: ratios, prior }, 0.5, 50.0),
        ];
        let cause = &RING_CAUSES[0];
        let hypotheses = vec![Hypothesis { cause, label: String::new(), variables, prior_weight: 1.0, held: None }];
        Self { hypotheses, turns_per_size, parts }
    }

    fn rows(&self, values: &[f64]) -> Vec<f64> {
        let (amplitude, phase) = (values[0].hypot(values[1]), values[1].atan2(values[0]));
        let of = |i: usize| 20.0 * i as f64 / ROWS as f64;
        let turned = phase + self.turns_per_size * std::f64::consts::TAU * amplitude;
        (0..ROWS).map(|i| amplitude * (values[2] * of(i) + turned).cos()).collect()
    }

    fn nearest(&self, truth: &[f64]) -> (Vec<Place>, Vec<f64>) {
        let residual = self.rows(truth);
        (self.nearest_to(&residual), residual)
    }

    fn nearest_to(&self, residual: &[f64]) -> Vec<Place> {
        let grid: Vec<Setting> = match &self.hypotheses[0].variables[2].treatment {
            Treatment::Shape { grid, .. } => grid.clone(),
            _ => Vec::new(),
        }
        .into_iter()
        .map(|ratio| Setting { hypothesis: 0, values: vec![0.0, 0.0, ratio] })
        .collect();
        let places = Survey::new(self, 0, residual).places(&grid, &Unwatched).expect("nothing cancels it");
        places.into_iter().map(|(_, place)| place).collect()
    }
}

impl Subject for Wave {
    fn hypotheses(&self) -> &[Hypothesis] {
        &self.hypotheses
    }

    fn predict(&self, effects: &[Setting]) -> Result<Vec<Prediction>, Failure> {
        let values = effects.first().map_or(vec![0.0; ROWS], |setting| self.rows(&setting.values));
        Ok(values.into_iter().map(Ok).collect())
    }

    fn expansions(&self, _hypothesis: usize) -> Expansions {
        let of = |k: usize, size: f64| {
            let (sin, cos) = (std::f64::consts::TAU * k as f64 / 12.0).sin_cos();
            vec![size * cos, size * sin]
        };
        let places = [0.4, 0.8, 1.2].iter().flat_map(|&size| (0..12).map(move |k| of(k, size))).collect();
        Expansions { places, nearest: NEAREST, parts: self.parts }
    }

    fn jacobian(&self, effects: &[Setting], of: &[(usize, usize)]) -> Result<Vec<JacobianColumn>, Failure> {
        let slope = |&(member, variable): &(usize, usize)| {
            let mut moved = effects[member].values.clone();
            moved[variable] += 1e-6;
            let (with, without) = (self.rows(&moved), self.rows(&effects[member].values));
            with.iter().zip(&without).map(|(with, without)| (with - without) / 1e-6).collect()
        };
        Ok(of.iter().map(slope).collect())
    }

    fn nuisances(&self) -> Result<Vec<JacobianColumn>, Failure> {
        Ok(Vec::new())
    }
}

/// Share of what was measured that a place leaves.
fn left(place: &Place, residual: &[f64]) -> f64 {
    let left: Vec<f64> = residual.iter().zip(&place.change).map(|(r, change)| r - change).collect();
    dot(&left, &left) / dot(residual, residual)
}

#[test]
fn a_straight_model_has_one_place_where_least_squares_puts_it() {
    let truth = [0.6, -0.9, 5.0];
    let (places, residual) = Wave::new(0.0, vec![5.0], 1).nearest(&truth);
    assert_eq!(places.len(), 1);
    assert!(left(&places[0], &residual) < 1e-10);
    let values = &places[0].setting.values;
    assert!(values.iter().zip(truth).all(|(found, truth)| (found - truth).abs() < 1e-5), "{values:?}");
}

#[test]
fn a_model_that_turns_with_its_size_is_found_far_from_its_straight_line() {
    // Three whole turns at the size hidden: a straight line from 0 shows nothing of it.
    let wave = Wave::new(3.0, vec![5.0], 1);
    let (places, residual) = wave.nearest(&[0.7, 0.71, 5.0]);
    assert!(places.len() <= NEAREST);
    // Beside the truth lie local optima a turn farther in or out; the first must be the truth itself.
    assert!(left(&places[0], &residual) < 1e-2, "{}", left(&places[0], &residual));
    assert!(places.windows(2).all(|pair| left(&pair[0], &residual) <= left(&pair[1], &residual)));
}

#[test]
fn a_shape_between_the_points_of_its_grid_is_found() {
    // A whole step of the grid turns the end of the rows three times; a tenth of it keeps the phase within a third.
    let wave = Wave::new(0.0, (2..=10).map(f64::from).collect(), 10);
    let (places, residual) = wave.nearest(&[0.3, 0.4, 5.37]);
    assert!(left(&places[0], &residual) < 1e-6, "{}", left(&places[0], &residual));
    assert!((places[0].setting.values[2] - 5.37).abs() < 1e-3, "{:?}", places[0].setting.values);
}

/// Of two waves in one step of the grid the greater one does not hide the other.
#[test]
fn of_one_step_of_the_grid_more_than_one_place_is_found() {
    let wave = Wave::new(0.0, (2..=10).map(f64::from).collect(), 25);
    // Nearly three beats of 0.31 apart: each moves the valley of the other by a part of a beat, which is below 0.1.
    let truths = [[0.3, 0.4, 5.45], [0.5, -0.5, 4.6]];
    let residual: Vec<f64> =
        wave.rows(&truths[0]).iter().zip(wave.rows(&truths[1])).map(|(one, other)| one + other).collect();
    let places = wave.nearest_to(&residual);
    for truth in truths {
        let near = |place: &Place| (place.setting.values[2] - truth[2]).abs() < 0.1;
        assert!(places.iter().any(near), "{truth:?}");
    }
}
