//! A formula of the user as an effect (`diagnosis/5.22`).

use crate::calculator::{Finding, Violations};
use crate::effects::{Expression, MachinabilityEffect as Effect};
use crate::num::formula::{Dual, Fault, Formula, Unit};

use super::input::Job;
use super::remainder::{At, KNOWN, Known, Stated, require};

/// The numbers that a formula may have, by their names.
const NUMBERS: [&str; 3] = ["k1", "k2", "k3"];

/// What a formula may name: the conditions, then its numbers.
fn names() -> Vec<(&'static str, Unit)> {
    // Every condition has a unit that formulas know; a test reads one over all of them.
    let of = |known: &Known| (known.field, Unit::read(known.unit).unwrap_or(Unit::ONE));
    KNOWN.iter().map(of).chain(NUMBERS.map(|name| (name, Unit::ONE))).collect()
}

fn read(expression: &Expression) -> Result<&Formula, &Fault> {
    expression.formula(&names(), Unit::ONE)
}

/// What it is called: as the user does, else as it is written.
pub(super) fn label<'a>(name: &'a str, expression: &'a Expression) -> &'a str {
    if name.is_empty() { expression.text() } else { name }
}

/// The deviations of its numbers, 0 of those that it does not use.
pub(super) fn deviations(effect: &Effect) -> Option<[f64; 3]> {
    let Effect::Formula { expression, k1_deviation, k2_deviation, k3_deviation, .. } = effect else { return None };
    let formula = read(expression).ok()?;
    let stated = [*k1_deviation, *k2_deviation, *k3_deviation];
    Some(std::array::from_fn(|k| if formula.uses(KNOWN.len() + k) { stated[k] } else { 0.0 }))
}

/// Adds the faults of a formula at a place of the job.
pub(super) fn check(job: &Job, expression: &Expression, at: &str, violations: &mut Violations) {
    let formula = match read(expression) {
        Ok(formula) => formula,
        Err(fault) => {
            let finding = Finding::new("formula_unreadable", format!("{at}/expression"));
            violations.add(match fault {
                Fault::TooLong => finding.with("fault", "too_long"),
                Fault::TooDeep => finding.with("fault", "too_deep"),
                Fault::Unexpected { at } => finding.with("fault", "unexpected").with("letter", at + 1),
                Fault::UnknownName { name, at } => {
                    let known: Vec<&str> = names().iter().map(|(name, _)| *name).collect();
                    finding
                        .with("fault", "unknown_name")
                        .with("name", name.clone())
                        .with("letter", at + 1)
                        .with("known", known)
                }
                Fault::UnknownUnit { unit, at } => {
                    finding.with("fault", "unknown_unit").with("name", unit.clone()).with("letter", at + 1)
                }
                Fault::Unit { found, wanted } => {
                    finding.with("fault", "unit").with("found", found.clone()).with("wanted", wanted.clone())
                }
            });
            return;
        }
    };
    for (_, known) in KNOWN.iter().enumerate().filter(|(k, _)| formula.uses(*k)) {
        require(job, known, at, violations);
    }
}

/// A formula at one depth, edge, and state of it, over ln V and ln S.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Written {
    formula: Formula,
    /// Where the cut stands in every condition, in its unit; none where it does not state it.
    at: Vec<Option<At>>,
    numbers: [f64; 3],
}

impl Written {
    /// `None` where the formula cannot be read, which a check refuses.
    pub(super) fn of(expression: &Expression, numbers: [f64; 3], cut: &Stated<'_>) -> Option<Self> {
        let formula = read(expression).ok()?.clone();
        Some(Self { formula, at: KNOWN.iter().map(|known| cut.value(known)).collect(), numbers })
    }

    /// What is added to L whatever speed and feed are; `None` where it goes with one of them.
    pub(super) fn constant(&self) -> Option<f64> {
        let moves = |k: usize| self.formula.uses(k) && matches!(self.at[k], Some(At::Speed | At::Feed));
        (!(0..self.at.len()).any(moves)).then(|| self.at(0.0, 0.0).0)
    }

    /// What is added to L at ln V and ln S, and its slopes.
    pub(super) fn at(&self, u: f64, x: f64) -> (f64, f64, f64) {
        let units = names();
        let condition = |(at, (_, unit)): (&Option<At>, &(&str, Unit))| match at {
            // d V/d ln V is V.
            Some(At::Speed) => Dual { value: u.exp() * unit.factor, slopes: [u.exp() * unit.factor, 0.0] },
            Some(At::Feed) => Dual { value: x.exp() * unit.factor, slopes: [0.0, x.exp() * unit.factor] },
            Some(At::Fixed(value)) => Dual::fixed(value * unit.factor),
            None => Dual::fixed(f64::NAN),
        };
        let conditions = self.at.iter().zip(&units).map(condition);
        let values: Vec<Dual> = conditions.chain(self.numbers.map(Dual::fixed)).collect();
        let Dual { value, slopes: [by_u, by_x] } = self.formula.value(&values);
        (value, by_u, by_x)
    }
}
