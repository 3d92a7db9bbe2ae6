//! What is not known of the effects of a job, as normal quantities `model:<effect>/<parameter>` (`certainty/1.3`).
//!
//! It comes as independent directions d = 1..m, each with how far it moves parameters at one standard deviation: B, a row by
//! parameter. A parameter has the standard deviation |B_i|; what a list holds (the places of a profile) is one quantity of several
//! modes, the principal axes of its own covariance. With u_i the unit row of a parameter or a mode, its score is z = U g, g
//! independent: U U' is the correlation of the scores, of whatever rank.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use serde::{Serialize, de::DeserializeOwned};

use crate::calculator::{Failure, Finding, Violations};
use crate::effects::{Catalogued, JointUncertainty, ParameterMove, has_parameter, with_changed};

/// Share of the variance of a list that its modes have together, and how many there are at most.
const SHARE_OF_LIST: f64 = 0.999;
const MOST_MODES: usize = 32;
/// Scores that go together by less than this are independent.
const UNCORRELATED: f64 = 1e-9;

/// How the name of a quantity of an effect begins.
const NAMED: &str = "model:";

/// Code of what is unsure of an effect that is not there.
pub(crate) const CODES: &[&str] = &["unknown_parameter"];

/// What is not known of the effects of a job.
#[derive(Debug, Clone)]
pub(crate) struct OpenEffects {
    modes: Vec<Mode>,
    /// Scores of the modes of independent ones.
    lower: DMatrix<f64>,
    is_independent: bool,
}

impl Default for OpenEffects {
    /// All is known.
    fn default() -> Self {
        Self { modes: Vec::new(), lower: DMatrix::zeros(0, 0), is_independent: true }
    }
}

/// Numbers of effects that are off together.
#[derive(Debug, Clone)]
struct Mode {
    /// The name of its quantity; modes of one name are one quantity.
    name: String,
    /// The parameters and how far each is off at a score of 1.
    moves: Vec<Moved>,
    /// Factor on that.
    width: f64,
}

#[derive(Debug, Clone)]
struct Moved {
    /// Place of the effect.
    effect: usize,
    parameter: String,
    by: f64,
}

/// A parameter of an effect with its row of B.
struct Row {
    effect: usize,
    parameter: String,
    by: Vec<f64>,
}

impl OpenEffects {
    /// Of checked effects.
    pub(crate) fn of<E: Catalogued>(effects: &[E], open: &[JointUncertainty]) -> Self {
        let mut quantities: Vec<(String, Vec<Row>)> = Vec::new();
        for row in rows(open) {
            let Some(effect) = effects.get(row.effect) else { continue };
            let name = name(effects, effect, &row);
            match quantities.iter_mut().find(|(own, _)| *own == name) {
                Some((_, rows)) => rows.push(row),
                None => quantities.push((name, vec![row])),
            }
        }
        let (mut modes, mut units): (Vec<Mode>, Vec<DVector<f64>>) = (Vec::new(), Vec::new());
        for (name, rows) in quantities {
            for (moves, unit) in modes_of(&rows) {
                modes.push(Mode { name: name.clone(), moves, width: 1.0 });
                units.push(unit);
            }
        }
        if modes.is_empty() {
            return Self::default();
        }
        // U' = Q R, so that U g = R' (Q' g) with Q' g as independent as g.
        let lower = DMatrix::from_columns(&units).qr().r().transpose();
        let correlations = &lower * lower.transpose();
        let is_independent = (0..modes.len()).all(|i| (0..i).all(|j| correlations[(i, j)].abs() < UNCORRELATED));
        Self { modes, lower, is_independent }
    }

    /// Modes, each a quantity or a part of one.
    pub(crate) fn count(&self) -> usize {
        self.modes.len()
    }

    /// Independent scores behind them.
    pub(crate) fn dimensions(&self) -> usize {
        self.lower.ncols()
    }

    /// Whether no mode tells of another.
    pub(crate) fn is_independent(&self) -> bool {
        self.is_independent
    }

    /// What the quantity of a mode is called.
    pub(crate) fn name(&self, mode: usize) -> &str {
        &self.modes[mode].name
    }

    /// Of independent scores, how far each mode is off in its standard deviations.
    pub(crate) fn values(&self, independent: &[f64]) -> Vec<f64> {
        let scores = &self.lower * DVector::from_column_slice(independent);
        self.modes.iter().zip(scores.iter()).map(|(mode, score)| mode.width * score).collect()
    }

    /// Halves the width of a mode.
    pub(crate) fn halve(&mut self, mode: usize) {
        self.modes[mode].width *= 0.5;
    }

    /// The effects where the modes come to this, within the ranges of their catalogue; `None` where nothing is open.
    pub(crate) fn effects<E>(&self, stated: &[E], values: &[f64]) -> Result<Option<Vec<E>>, Failure>
    where
        E: Catalogued + Clone + Serialize + DeserializeOwned,
    {
        if self.modes.is_empty() {
            return Ok(None);
        }
        let mut off: BTreeMap<(usize, &str), f64> = BTreeMap::new();
        for (mode, value) in self.modes.iter().zip(values) {
            for moved in &mode.moves {
                *off.entry((moved.effect, &moved.parameter)).or_default() += value * moved.by;
            }
        }
        let mut effects = stated.to_vec();
        for (place, effect) in effects.iter_mut().enumerate() {
            let mut own = off.range((place, "")..(place + 1, "")).peekable();
            if own.peek().is_none() {
                continue;
            }
            let within = |path: &str, value: f64| {
                effect.parameter(path).map_or(value, |range| value.clamp(range.lower, range.upper))
            };
            let changes = own.map(|(&(_, path), &by)| (path, move |value: f64| within(path, value + by)));
            *effect = with_changed(&*effect, changes)?;
        }
        Ok(Some(effects))
    }
}

/// The parameters that move, in the order in which they are named.
fn rows(open: &[JointUncertainty]) -> Vec<Row> {
    let mut rows: Vec<Row> = Vec::new();
    for (direction, entry) in open.iter().enumerate() {
        for own in &entry.moves {
            let Some(effect) = own.place() else { continue };
            let index = rows.iter().position(|row| row.effect == effect && row.parameter == own.parameter);
            let index = index.unwrap_or_else(|| {
                rows.push(Row { effect, parameter: own.parameter.clone(), by: vec![0.0; open.len()] });
                rows.len() - 1
            });
            rows[index].by[direction] += own.by;
        }
    }
    rows.retain(|row| row.by.iter().any(|by| by.abs() > 0.0));
    rows
}

/// `model:<effect>/<parameter>`, of a list the field that holds it; with the number of the effect where its kind recurs.
fn name<E: Catalogued>(effects: &[E], effect: &E, row: &Row) -> String {
    let kind = effect.entry().kind;
    let recurs = effects.iter().filter(|other| other.entry().kind == kind).count() > 1;
    let number = if recurs { format!("#{}", row.effect + 1) } else { String::new() };
    let field = row.parameter.split('/').next().unwrap_or_default();
    format!("{NAMED}{kind}{number}/{field}")
}

/// The kind of the effect that a quantity is of; `None` of one of the job itself.
pub(crate) fn effect_of(quantity: &str) -> Option<&str> {
    quantity.strip_prefix(NAMED)?.split(['/', '#']).next()
}

/// The modes of a quantity with their unit rows: one of a single parameter, the principal axes of a list.
fn modes_of(rows: &[Row]) -> Vec<(Vec<Moved>, DVector<f64>)> {
    let by = |row: &Row| DVector::from_column_slice(&row.by);
    let moved = |row: &Row, by: f64| Moved { effect: row.effect, parameter: row.parameter.clone(), by };
    if let [row] = rows {
        let deviation = by(row).norm();
        return vec![(vec![moved(row, deviation)], by(row) / deviation)];
    }
    let all = DMatrix::from_columns(&rows.iter().map(by).collect::<Vec<_>>()).transpose();
    let axes = (&all * all.transpose()).symmetric_eigen();
    let mut order: Vec<usize> = (0..rows.len()).collect();
    order.sort_by(|a, b| axes.eigenvalues[*b].total_cmp(&axes.eigenvalues[*a]));
    let whole: f64 = axes.eigenvalues.iter().sum();
    let mut told = 0.0;
    let mut modes = Vec::new();
    for axis in order.into_iter().take(MOST_MODES) {
        let variance = axes.eigenvalues[axis];
        if told >= SHARE_OF_LIST * whole || variance <= 0.0 {
            break;
        }
        told += variance;
        let (direction, deviation) = (axes.eigenvectors.column(axis), variance.sqrt());
        let moves = rows.iter().zip(direction.iter()).map(|(row, share)| moved(row, share * deviation)).collect();
        modes.push((moves, all.transpose() * direction / deviation));
    }
    modes
}

/// Finds what is unsure of no number of an effect, or of one that is read off the job.
pub(crate) fn check<E: Catalogued + Serialize>(effects: &[E], open: &[JointUncertainty], violations: &mut Violations) {
    for (index, entry) in open.iter().enumerate() {
        for (number, unsure) in entry.moves.iter().enumerate() {
            let effect = unsure.place().and_then(|place| effects.get(place));
            let is_there =
                |effect: &E| has_parameter(effect, &unsure.parameter) && !effect.is_of_job(&unsure.parameter);
            violations.require(effect.is_some_and(is_there), || {
                Finding::new("unknown_parameter", format!("/uncertainty/effects/{index}/moves/{number}"))
                    .with("effect", f64::from(unsure.effect))
                    .with("parameter", unsure.parameter.clone())
                    .with("count", effects.len())
            });
        }
    }
}

/// Whether something is unsure of an effect of this kind.
pub(crate) fn tells_of<E: Catalogued>(effects: &[E], open: &[JointUncertainty], kind: &str) -> bool {
    let moves = open.iter().flat_map(|entry| &entry.moves).filter(|own| own.by.abs() > 0.0);
    moves.filter_map(ParameterMove::place).filter_map(|place| effects.get(place)).any(|own| own.entry().kind == kind)
}
