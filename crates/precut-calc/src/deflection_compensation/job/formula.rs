//! A formula of the user as a radial error of a shaft (`diagnosis/4.24`).

use std::sync::LazyLock;

use crate::calculator::{Finding, FormulaRoom, Violations};
use crate::effects::{DeflectionConditions, UserFormula};
use crate::num::formula::{Dual, Formula};

use crate::deflection_compensation::job::acting::Passage;
use crate::deflection_compensation::job::input::Job;

/// Largest error that is one, mm: ten times what any other effect may state. Beyond it a formula has left its range.
const LARGEST_MM: f64 = 10.0;

/// Something that a formula may name.
struct Named {
    name: &'static str,
    unit: &'static str,
    /// Where a passage stands in it, in its unit, under conditions of the cut.
    value: fn(&Passage, &DeflectionConditions) -> f64,
    /// The condition without which it is not known.
    needs: Option<Condition>,
}

/// A condition of the cut: its field, and what it is.
type Condition = (&'static str, fn(&DeflectionConditions) -> Option<f64>);

const PATH: Condition = ("tool_path_at_start_m", |conditions| conditions.tool_path_at_start_m);
const WARM: Condition = ("warm_time_at_start_min", |conditions| conditions.warm_time_at_start_min);

const NAMED: [Named; 7] = [
    Named { name: "z_mm", unit: "mm", value: |at, _| at.z_mm, needs: None },
    Named { name: "diameter_mm", unit: "mm", value: |at, _| at.diameter_mm, needs: None },
    Named { name: "depth_mm", unit: "mm", value: |at, _| at.depth_mm, needs: None },
    Named { name: "feed_mm_per_rev", unit: "mm/rev", value: |at, _| at.feed_mm_per_rev, needs: None },
    Named { name: "speed_m_per_min", unit: "m/min", value: |at, _| at.speed_m_per_min, needs: None },
    Named {
        name: "tool_path_m",
        unit: "m",
        value: |at, conditions| conditions.tool_path_at_start_m.unwrap_or(0.0) + at.path_m,
        needs: Some(PATH),
    },
    Named {
        name: "warm_time_min",
        unit: "min",
        value: |at, conditions| conditions.warm_time_at_start_min.unwrap_or(0.0) + at.time_min,
        needs: Some(WARM),
    },
];

/// What a formula may name, and that it gives a length.
pub(in crate::deflection_compensation) static ROOM: LazyLock<FormulaRoom> =
    LazyLock::new(|| FormulaRoom::of(NAMED.iter().map(|named| (named.name, named.unit)), "mm"));

/// Adds the faults of a formula at a place of the job.
pub(in crate::deflection_compensation) fn check(
    job: &Job,
    own: &UserFormula<'_>,
    at: &str,
    violations: &mut Violations,
) {
    let Some(formula) = ROOM.checked(own.expression, at, violations) else { return };
    let needed = NAMED.iter().enumerate().filter(|(k, _)| formula.uses(*k)).filter_map(|(_, named)| named.needs);
    for (condition, of) in needed {
        violations.require(of(&job.conditions).is_some(), || {
            Finding::new("condition_missing", format!("/conditions/{condition}"))
                .with("kind", "formula")
                .with("condition", condition)
        });
    }
}

/// A formula under the conditions of a cut.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::deflection_compensation) struct Written {
    label: String,
    formula: Formula,
    numbers: [f64; 3],
    conditions: DeflectionConditions,
}

impl Written {
    /// `None` where the formula cannot be read, which a check refuses.
    pub(in crate::deflection_compensation) fn of(
        own: &UserFormula<'_>,
        conditions: &DeflectionConditions,
    ) -> Option<Self> {
        let formula = ROOM.read(own.expression).ok()?.clone();
        Some(Self { label: own.label().to_owned(), formula, numbers: own.numbers, conditions: conditions.clone() })
    }

    /// What it is called.
    pub(in crate::deflection_compensation) fn label(&self) -> &str {
        &self.label
    }

    /// Radial error where the tool passes, mm; not a number where it has none. Where nothing is planned to be cut a formula of the
    /// depth need not have one.
    pub(in crate::deflection_compensation) fn error_mm(&self, at: Passage) -> f64 {
        let fields = NAMED.iter().zip(ROOM.factors()).map(|(named, one)| one * (named.value)(&at, &self.conditions));
        let values: Vec<Dual> = fields.chain(self.numbers).map(Dual::fixed).collect();
        let error_mm = self.formula.value(&values).value;
        if error_mm.abs() <= LARGEST_MM {
            error_mm
        } else if at.depth_mm > 0.0 {
            f64::NAN
        } else {
            0.0
        }
    }
}
