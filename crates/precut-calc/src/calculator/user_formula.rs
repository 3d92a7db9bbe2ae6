//! A formula of the user as an effect: what every model does alike with it (`diagnosis/5.22`).

use super::{Finding, Hypothesis, Range, Treatment, Variable, Violations};
use crate::effects::{Cause, Expression, FORMULA_NUMBERS as NUMBERS, Parameter, UserFormula};
use crate::num::formula::{Fault, Formula, Unit};

/// Names that a model's formulas may use, and the unit of their value.
pub(crate) struct FormulaRoom {
    /// Conditions and places with their units, then the numbers.
    names: Vec<(&'static str, Unit)>,
    wanted: Unit,
}

impl FormulaRoom {
    /// A room in which these fields may be named, each with its unit.
    pub(crate) fn of(fields: impl IntoIterator<Item = (&'static str, &'static str)>, wanted: &str) -> Self {
        // Every field has a unit that formulas know; tests of the models read one over all of them.
        let known = |unit: &str| Unit::read(unit).unwrap_or(Unit::ONE);
        let fields = fields.into_iter().map(|(field, unit)| (field, known(unit)));
        Self { names: fields.chain(NUMBERS.map(|number| (number.name, Unit::ONE))).collect(), wanted: known(wanted) }
    }

    /// How many names stand before the numbers.
    fn fields(&self) -> usize {
        self.names.len() - NUMBERS.len()
    }

    /// One unit of every name in what formulas are computed in.
    pub(crate) fn factors(&self) -> impl Iterator<Item = f64> {
        self.names.iter().take(self.fields()).map(|(_, unit)| unit.factor)
    }

    /// Reads an expression with these names.
    pub(crate) fn read<'a>(&self, expression: &'a Expression) -> Result<&'a Formula, &'a Fault> {
        expression.formula(&self.names, self.wanted)
    }

    /// The formula of an effect at a place of the job; `None` where it cannot be read, which is added to the faults.
    pub(crate) fn checked<'a>(
        &self,
        expression: &'a Expression,
        at: &str,
        violations: &mut Violations,
    ) -> Option<&'a Formula> {
        match self.read(expression) {
            Ok(formula) => Some(formula),
            Err(fault) => {
                violations.add(self.unreadable(fault, at));
                None
            }
        }
    }

    fn unreadable(&self, fault: &Fault, at: &str) -> Finding {
        let finding = Finding::new("formula_unreadable", format!("{at}/expression"));
        match fault {
            Fault::TooLong => finding.with("fault", "too_long"),
            Fault::TooDeep => finding.with("fault", "too_deep"),
            Fault::Unexpected { at } => finding.with("fault", "unexpected").with("letter", at + 1),
            Fault::UnknownName { name, at } => {
                let known: Vec<&str> = self.names.iter().map(|(name, _)| *name).collect();
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
        }
    }

    /// The hypothesis that the numbers of a formula are others, each as far from what is stated as the effect says; `None`
    /// where none of those that it uses is to be fitted.
    pub(crate) fn hypothesis(&self, cause: &'static Cause, own: &UserFormula<'_>) -> Option<Hypothesis> {
        let formula = self.read(own.expression).ok()?;
        let is_fitted = |k: usize| own.deviations[k] > 0.0 && formula.uses(self.fields() + k);
        let variable = |(k, parameter): (usize, &Parameter)| Variable {
            name: parameter.name,
            unit: parameter.unit,
            treatment: if is_fitted(k) {
                Treatment::Amplitude { prior_sd: own.deviations[k] }
            } else {
                Treatment::Stated { value: 0.0 }
            },
            range: Range { lower: parameter.lower, upper: parameter.upper },
        };
        (0..NUMBERS.len()).any(is_fitted).then(|| {
            let variables = NUMBERS.iter().enumerate().map(variable).collect();
            Hypothesis { cause, label: own.label().to_owned(), variables, prior_weight: 1.0, held: None }
        })
    }
}

/// The values of a hypothesis' variables at which it is this formula; `None` where it is about another.
pub(crate) fn values_of_formula(hypothesis: &Hypothesis, own: &UserFormula<'_>) -> Option<Vec<f64>> {
    (hypothesis.cause.kind == "formula" && hypothesis.label == own.label()).then(|| own.numbers.to_vec())
}
