//! Batches and factor levels that occur in the rows, as effects of their own.

use crate::effects::{FactorLevel, MachinabilityConditions, MachinabilityEffect as Effect};

use crate::feed_schedule::measured::forward::Row;

/// Most pairs of levels that are tried.
const MOST_PAIRS: usize = 24;

/// A batch, a level or a pair of levels that may lie higher or lower.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::feed_schedule) struct NamedLevel {
    /// Words for it: `B`, `coolant = off`.
    pub(in crate::feed_schedule) label: String,
    /// The effect, with nothing added yet.
    pub(in crate::feed_schedule) effect: Effect,
    /// Share of its cause's prior weight.
    pub(in crate::feed_schedule) weight: f64,
}

impl NamedLevel {
    /// The effect with so much added.
    pub(in crate::feed_schedule) fn shifted(&self, by: f64) -> Effect {
        let mut effect = self.effect.clone();
        if let Effect::BatchShift { delta_ln, .. }
        | Effect::FactorShift { delta_ln, .. }
        | Effect::FactorInteraction { delta_ln, .. } = &mut effect
        {
            *delta_ln = by;
        }
        effect
    }

    /// What an effect adds to this level; `None` where it acts on another.
    pub(in crate::feed_schedule) fn shift_in(&self, effect: &Effect) -> Option<f64> {
        match (effect, &self.effect) {
            (Effect::BatchShift { batch: a, delta_ln, .. }, Effect::BatchShift { batch: b, .. }) => {
                (a == b).then_some(*delta_ln)
            }
            (
                Effect::FactorShift { factor: f, level: l, delta_ln, .. },
                Effect::FactorShift { factor: g, level: m, .. },
            ) => ((f, l) == (g, m)).then_some(*delta_ln),
            (
                Effect::FactorInteraction { factor_1: f, level_1: l, factor_2: p, level_2: q, delta_ln, .. },
                Effect::FactorInteraction { factor_1: g, level_1: m, factor_2: r, level_2: s, .. },
            ) => ((f, l, p, q) == (g, m, r, s) || (f, l, p, q) == (r, s, g, m)).then_some(*delta_ln),
            _ => None,
        }
    }
}

/// Batches of the rows; none where a row does not state its own.
pub(in crate::feed_schedule) fn batches(rows: &[Row]) -> Vec<String> {
    sorted(rows.iter().map(|row| row.conditions.batch.clone()))
}

/// Factors that every row states, each with its levels.
pub(in crate::feed_schedule) fn factors(rows: &[Row]) -> Vec<(String, Vec<String>)> {
    let Some(first) = rows.first() else { return Vec::new() };
    let mut names: Vec<&String> = first.conditions.factors.iter().map(|known| &known.factor).collect();
    names.sort();
    names
        .into_iter()
        .map(|name| (name.clone(), sorted(rows.iter().map(|row| row.conditions.level(name).map(str::to_owned)))))
        .filter(|(_, levels)| !levels.is_empty())
        .collect()
}

/// Different values in the order of their names; none where one is missing.
fn sorted(values: impl Iterator<Item = Option<String>>) -> Vec<String> {
    let Some(mut all) = values.collect::<Option<Vec<String>>>() else { return Vec::new() };
    all.sort();
    all.dedup();
    all
}

/// Levels that may be shifted: not the one that the base was made for. Where nobody says which that is, of two the
/// second: both would be each other's mirror image beside a shift of the whole; of more than two each of them.
fn free(levels: &[String], stated: Option<&str>) -> Vec<String> {
    if levels.len() < 2 {
        return Vec::new();
    }
    match stated.filter(|stated| levels.iter().any(|level| level == stated)) {
        Some(stated) => levels.iter().filter(|level| *level != stated).cloned().collect(),
        None if levels.len() == 2 => vec![levels[1].clone()],
        None => levels.to_vec(),
    }
}

/// Everything by name that may differ in these rows, on this output.
pub(in crate::feed_schedule) fn named(stated: &MachinabilityConditions, rows: &[Row], output: &str) -> Vec<NamedLevel> {
    let on = || Some(output.to_owned());
    let own = free(&batches(rows), stated.batch.as_deref());
    let mut all: Vec<NamedLevel> = own
        .iter()
        .map(|batch| NamedLevel {
            label: batch.clone(),
            effect: Effect::BatchShift { batch: batch.clone(), delta_ln: 0.0, output: on() },
            weight: 1.0 / own.len() as f64,
        })
        .collect();
    let factors = factors(rows);
    for (factor, levels) in &factors {
        let own = free(levels, stated.level(factor));
        all.extend(own.iter().map(|level| NamedLevel {
            label: format!("{factor} = {level}"),
            effect: Effect::FactorShift { factor: factor.clone(), level: level.clone(), delta_ln: 0.0, output: on() },
            weight: 1.0 / own.len() as f64,
        }));
    }
    let pairs = pairs(&factors);
    let weight = 1.0 / pairs.len().max(1) as f64;
    all.extend(pairs.into_iter().map(|(one, other)| NamedLevel {
        label: format!("{} = {}, {} = {}", one.factor, one.level, other.factor, other.level),
        effect: Effect::FactorInteraction {
            factor_1: one.factor,
            level_1: one.level,
            factor_2: other.factor,
            level_2: other.level,
            delta_ln: 0.0,
            output: on(),
        },
        weight,
    }));
    all
}

/// Pairs of levels of two factors that both vary.
fn pairs(factors: &[(String, Vec<String>)]) -> Vec<(FactorLevel, FactorLevel)> {
    let varying: Vec<&(String, Vec<String>)> = factors.iter().filter(|(_, levels)| levels.len() > 1).collect();
    let mut pairs = Vec::new();
    for (i, (one, of_one)) in varying.iter().enumerate() {
        for (other, of_other) in &varying[i + 1..] {
            for level in of_one {
                pairs.extend(of_other.iter().map(|beside| {
                    let at =
                        |factor: &String, level: &String| FactorLevel { factor: factor.clone(), level: level.clone() };
                    (at(one, level), at(other, beside))
                }));
            }
        }
    }
    pairs.truncate(MOST_PAIRS);
    pairs
}
