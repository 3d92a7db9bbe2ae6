//! Trials as numbers: logarithms of the variables, levels of the factors, conditions that repeat.

use std::collections::BTreeMap;

use super::input::{FitJob, Place, Trial};
use crate::num::dense::Columns;

/// What a term of the model is made of.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Source {
    /// The logarithm of a numeric column, less its mean over the trials.
    Logarithm {
        /// Mean of the logarithms: that of the geometric mean.
        mean: f64,
        /// Least and largest value.
        range: (f64, f64),
    },
    /// 1 where a factor has a level, else 0; the first level of a factor has no term.
    Level {
        /// The level.
        level: String,
    },
}

/// A term beside the constant.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Term {
    /// Column of the table.
    pub(super) column: String,
    /// What becomes of it.
    pub(super) source: Source,
}

/// The trials that take part in the fit of one output.
#[derive(Debug, Clone)]
pub(super) struct Sample {
    /// Places in the table.
    pub(super) rows: Vec<usize>,
    /// Values of the output.
    pub(super) values: Vec<f64>,
    /// Terms, variables first.
    pub(super) terms: Vec<Term>,
    /// First levels of the factors.
    pub(super) first_levels: BTreeMap<String, String>,
    /// Constant and terms.
    pub(super) design: Columns,
    /// Rows (of the sample) of each distinct condition.
    pub(super) conditions: Vec<Vec<usize>>,
    /// Rows held out together.
    pub(super) folds: Vec<Vec<usize>>,
    /// Trials with the output but without some variable or factor.
    pub(super) incomplete: usize,
}

impl Sample {
    /// The sample of an output.
    pub(super) fn new(job: &FitJob, output: &str, variables: &[String]) -> Self {
        let complete = |trial: &Trial| {
            variables.iter().all(|column| trial.number(column).is_some())
                && job.factors.iter().all(|factor| trial.factors.contains_key(factor))
        };
        let measured = || job.used().filter(|(_, trial)| trial.number(output).is_some());
        let chosen: Vec<(usize, &Trial)> = measured().filter(|(_, trial)| complete(trial)).collect();
        let incomplete = measured().count() - chosen.len();
        let values = chosen.iter().filter_map(|(_, trial)| trial.number(output)).collect();
        let mut design = Columns::of(chosen.len(), [vec![1.0; chosen.len()].as_slice()]);
        let mut terms = Vec::new();
        for column in variables {
            let raw: Vec<f64> = chosen.iter().filter_map(|(_, trial)| trial.number(column)).collect();
            let logs: Vec<f64> = raw.iter().map(|x| x.ln()).collect();
            let mean = logs.iter().sum::<f64>() / logs.len().max(1) as f64;
            let range = raw.iter().fold((f64::INFINITY, 0.0), |(low, high): (f64, f64), x| (low.min(*x), high.max(*x)));
            design.push(&logs.iter().map(|l| l - mean).collect::<Vec<_>>());
            terms.push(Term { column: column.clone(), source: Source::Logarithm { mean, range } });
        }
        let mut first_levels = BTreeMap::new();
        for factor in &job.factors {
            let level = |trial: &Trial| trial.factors.get(factor).cloned().unwrap_or_default();
            let mut levels: Vec<String> = chosen.iter().map(|(_, trial)| level(trial)).collect();
            levels.sort();
            levels.dedup();
            for name in levels.iter().skip(1) {
                design.push(
                    &chosen.iter().map(|(_, trial)| f64::from(u8::from(level(trial) == *name))).collect::<Vec<_>>(),
                );
                terms.push(Term { column: factor.clone(), source: Source::Level { level: name.clone() } });
            }
            first_levels.insert(factor.clone(), levels.into_iter().next().unwrap_or_default());
        }
        let conditions = grouped(&(0..chosen.len()).map(|i| bits(&design.row(i))).collect::<Vec<_>>());
        let folds = match &job.hold_out {
            None => conditions.clone(),
            Some(factor) => {
                grouped(&chosen.iter().map(|(_, trial)| trial.factors.get(factor).cloned()).collect::<Vec<_>>())
            }
        };
        let rows = chosen.iter().map(|(index, _)| *index).collect();
        Self { rows, values, terms, first_levels, design, conditions, folds, incomplete }
    }

    /// Columns of the design that a set of terms (by place in `terms`) has, the constant among them.
    pub(super) fn columns(terms: &[usize]) -> Vec<usize> {
        std::iter::once(0).chain(terms.iter().map(|term| term + 1)).collect()
    }

    /// A row of the design for conditions, or the column that is missing.
    pub(super) fn row(&self, job: &FitJob, place: &Place) -> Result<Vec<f64>, String> {
        let mut row = vec![1.0];
        for term in &self.terms {
            row.push(match &term.source {
                Source::Logarithm { mean, .. } => {
                    let given = place.number(&term.column).or_else(|| job.at.further.get(&term.column).copied());
                    given.ok_or_else(|| term.column.clone())?.ln() - mean
                }
                Source::Level { level } => {
                    let given = place.factors.get(&term.column).or_else(|| job.at.factors.get(&term.column));
                    let standing = given.or_else(|| self.first_levels.get(&term.column));
                    f64::from(u8::from(standing == Some(level)))
                }
            });
        }
        Ok(row)
    }

    /// The trials' places in the space of the logarithms, each variable over its range: in the unit box.
    pub(super) fn unit_points(&self) -> Vec<Vec<f64>> {
        let mut points: Vec<Vec<f64>> = (0..self.rows.len()).map(|i| self.unit_point(&self.design.row(i))).collect();
        points.sort_by(|a, b| {
            a.iter().zip(b).map(|(a, b)| a.total_cmp(b)).find(|o| o.is_ne()).unwrap_or(std::cmp::Ordering::Equal)
        });
        points.dedup_by(|a, b| bits(a) == bits(b));
        points
    }

    /// A row of the design as a place in the unit box; factors have none.
    pub(super) fn unit_point(&self, row: &[f64]) -> Vec<f64> {
        self.terms
            .iter()
            .zip(&row[1..])
            .filter_map(|(term, x)| match &term.source {
                Source::Logarithm { mean, range: (low, high) } => {
                    let width = (high / low).ln();
                    Some(if width > 0.0 { (x + mean - low.ln()) / width } else { 0.0 })
                }
                Source::Level { .. } => None,
            })
            .collect()
    }
}

/// Rows by what they have in common, in the order of their first.
fn grouped<K: Ord + Clone>(keys: &[K]) -> Vec<Vec<usize>> {
    let mut place: BTreeMap<K, usize> = BTreeMap::new();
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (i, key) in keys.iter().enumerate() {
        let at = *place.entry(key.clone()).or_insert_with(|| {
            groups.push(Vec::new());
            groups.len() - 1
        });
        groups[at].push(i);
    }
    groups
}

/// Numbers that are equal when they were written equal.
fn bits(row: &[f64]) -> Vec<u64> {
    row.iter().map(|x| x.to_bits()).collect()
}
