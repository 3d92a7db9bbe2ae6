//! A formula of the user as an effect (`diagnosis/5.22`).

use std::sync::LazyLock;

use crate::calculator::{FormulaRoom, Violations};
use crate::effects::UserFormula;
use crate::num::formula::{Dual, Formula};

use crate::feed_schedule::job::input::Job;
use crate::feed_schedule::job::remainder::{At, KNOWN, Stated, require};

/// What a formula may name: the conditions of the cut.
pub(in crate::feed_schedule) static ROOM: LazyLock<FormulaRoom> =
    LazyLock::new(|| FormulaRoom::of(KNOWN.iter().map(|known| (known.field, known.unit)), "1"));

/// Adds the faults of a formula at a place of the job.
pub(in crate::feed_schedule) fn check(job: &Job, own: &UserFormula<'_>, at: &str, violations: &mut Violations) {
    let Some(formula) = ROOM.checked(own.expression, at, violations) else { return };
    for (_, known) in KNOWN.iter().enumerate().filter(|(k, _)| formula.uses(*k)) {
        require(job, known, at, violations);
    }
}

/// A formula at one depth, edge, and state of it, over ln V and ln S.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::feed_schedule) struct Written {
    formula: Formula,
    /// Where the cut stands in every condition, in its unit; none where it does not state it.
    at: Vec<Option<At>>,
    numbers: [f64; 3],
}

impl Written {
    /// `None` where the formula cannot be read, which a check refuses.
    pub(in crate::feed_schedule) fn of(own: &UserFormula<'_>, cut: &Stated<'_>) -> Option<Self> {
        let formula = ROOM.read(own.expression).ok()?.clone();
        Some(Self { formula, at: KNOWN.iter().map(|known| cut.value(known)).collect(), numbers: own.numbers })
    }

    /// What is added to L whatever speed and feed are; `None` where it goes with one of them.
    pub(in crate::feed_schedule) fn constant(&self) -> Option<f64> {
        let moves = |k: usize| self.formula.uses(k) && matches!(self.at[k], Some(At::Speed | At::Feed));
        (!(0..self.at.len()).any(moves)).then(|| self.at(0.0, 0.0).0)
    }

    /// What is added to L at ln V and ln S, and its slopes.
    pub(in crate::feed_schedule) fn at(&self, u: f64, x: f64) -> (f64, f64, f64) {
        let condition = |(at, factor): (&Option<At>, f64)| match at {
            // d V/d ln V is V.
            Some(At::Speed) => Dual { value: u.exp() * factor, slopes: [u.exp() * factor, 0.0] },
            Some(At::Feed) => Dual { value: x.exp() * factor, slopes: [0.0, x.exp() * factor] },
            Some(At::Fixed(value)) => Dual::fixed(value * factor),
            None => Dual::fixed(f64::NAN),
        };
        let conditions = self.at.iter().zip(ROOM.factors()).map(condition);
        let values: Vec<Dual> = conditions.chain(self.numbers.map(Dual::fixed)).collect();
        let Dual { value, slopes: [by_u, by_x] } = self.formula.value(&values);
        (value, by_u, by_x)
    }
}
