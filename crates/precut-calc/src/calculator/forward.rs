//! What a diagnosis needs of a calculator: the model as a function of its effects.

use super::{Cost, Failure, Finding, Monitor, Unwatched};
use crate::effects::{Cause, JointUncertainty, Parameter};
use serde::{Serialize, de::DeserializeOwned};
use utoipa::ToSchema;

/// A calculator's model, run forward for given effects. Implemented with the code that
/// [`super::Calculator::run`] uses: there is no second model.
pub trait ForwardModel {
    /// The calculator's job: the base model.
    type Job;
    /// Conditions of one run; what it leaves out is taken from the job.
    type Run: DeserializeOwned + Serialize + ToSchema + Clone + Send + Sync;
    /// Where on the part (or when) a value was measured.
    type Point: DeserializeOwned + Serialize + ToSchema + Clone + Send + Sync;
    /// The named effects that the model takes.
    type Effect: Serialize + DeserializeOwned + Clone + Send + Sync;
    /// How wrong the base may be without that being a finding: standard deviations.
    type Allowances: DeserializeOwned + Serialize + ToSchema + Default + Clone + Send + Sync;
    /// What no effect's parameter changes.
    type Prepared: Send + Sync;

    /// The catalogue's entries for this model.
    const CAUSES: &'static [Cause];
    /// Whether `uncertainty.effects` of its job says what is not known of the effects that it holds.
    const TAKES_OPEN_EFFECTS: bool = false;
    /// What it predicts.
    const QUANTITIES: &'static [Quantity];
    /// Conditions of a run that may be set to any value of a range.
    const CONDITIONS: &'static [&'static str];

    /// What is wrong with a measured place and shows without computing: told with all other faults of a job, before
    /// anything runs. Pointers from the row.
    fn faults_of_point(_job: &Self::Job, _point: &Self::Point) -> Vec<Finding> {
        Vec::new()
    }

    /// Likewise of the conditions of a run; pointers from the run.
    fn faults_of_run(_run: &Self::Run) -> Vec<Finding> {
        Vec::new()
    }

    /// The effects that a job holds.
    fn own_effects(job: &Self::Job) -> &[Self::Effect];

    /// How unsure the job says they are; nothing where a job cannot say it.
    fn open_effects(_job: &Self::Job) -> &[JointUncertainty] {
        &[]
    }

    /// A job without them.
    fn without_effects(job: &Self::Job) -> Self::Job;

    /// Everything that no effect parameter changes, once per diagnosis. Faults of the rows are all given at once.
    fn prepare(
        job: &Self::Job,
        rows: &Rows<Self::Run, Self::Point>,
        quantity: &str,
        monitor: &dyn Monitor,
    ) -> Result<Self::Prepared, PrepareError>;

    /// One value per row, in the row's unit and order, with these effects beside those of the job. Deterministic, callable
    /// from any thread.
    fn predict(
        prepared: &Self::Prepared,
        effects: &[Self::Effect],
        monitor: &dyn Monitor,
    ) -> Result<Vec<Prediction>, Failure>;

    /// The effect of a cause with its parameters set to `values`, in the order of [`Cause::parameters`].
    fn effect(cause: &Cause, values: &[f64]) -> Option<Self::Effect>;

    /// d predict / d parameter, one column per entry of `of`; `of` names an effect of `effects` and one of its parameters.
    fn jacobian(
        prepared: &Self::Prepared,
        effects: &[(&'static Cause, Vec<f64>)],
        of: &[(usize, usize)],
    ) -> Result<Vec<Column>, Failure> {
        divided_differences::<Self>(prepared, effects, of)
    }

    /// d predict / d allowance: how the prediction with these effects moves when it is wrong by one standard deviation.
    fn nuisances(
        prepared: &Self::Prepared,
        effects: &[Self::Effect],
        allowances: &Self::Allowances,
        monitor: &dyn Monitor,
    ) -> Result<Vec<Column>, Failure>;

    /// Cost of one `predict`.
    fn predict_cost(prepared: &Self::Prepared) -> Cost;
}

/// Why rows could not be prepared.
#[derive(Debug, Clone, PartialEq)]
pub enum PrepareError {
    /// The data are at fault.
    Invalid(Vec<Finding>),
    /// The model is.
    Failed(Failure),
}

/// Measured places and the runs they belong to.
#[derive(Debug, Clone, PartialEq)]
pub struct Rows<R, P> {
    /// Conditions, one entry per run.
    pub runs: Vec<R>,
    /// For every row the index of its run and the place.
    pub points: Vec<(usize, P)>,
}

/// A predicted value, in the unit of the quantity, or why there is none.
pub type Prediction = Result<f64, Missing>;

/// Why the model predicts nothing for a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Missing {
    /// The tool does not cut there.
    NoCut,
    /// The equations have no solution there.
    NoSolution,
    /// The process is unstable there.
    Unstable,
}

/// One column of a sensitivity matrix, one entry per row.
pub type Column = Vec<f64>;

/// A quantity that a model predicts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Quantity {
    /// Field name with its unit: `diameter_deviation_um`.
    pub name: &'static str,
    /// Unit as in the contract.
    pub unit: &'static str,
    /// Whether statistics work on its logarithm.
    pub logarithmic: bool,
}

/// Central divided differences, step 1e-3 of the parameter's prior standard deviation, kept within bounds.
///
/// Error: the truncation of a central difference is of order (1e-3)^2 of the curvature over one prior
/// standard deviation; round-off about 1e-13 of the value divided by 1e-3.
pub(crate) fn divided_differences<M: ForwardModel + ?Sized>(
    prepared: &M::Prepared,
    effects: &[(&'static Cause, Vec<f64>)],
    of: &[(usize, usize)],
) -> Result<Vec<Column>, Failure> {
    let predict = |values: &[(&'static Cause, Vec<f64>)]| -> Result<Vec<Prediction>, Failure> {
        let built: Option<Vec<M::Effect>> = values.iter().map(|(cause, v)| M::effect(cause, v)).collect();
        let built = built.ok_or_else(|| Failure::Internal("an effect that the model does not know".to_owned()))?;
        M::predict(prepared, &built, &Unwatched)
    };
    of.iter()
        .map(|&(effect, parameter)| {
            let declared: &Parameter = &effects[effect].0.parameters[parameter];
            let centre = effects[effect].1[parameter];
            let step = 1e-3 * declared.prior_sd;
            let (low, high) = ((centre - step).max(declared.lower), (centre + step).min(declared.upper));
            let at = |value: f64| {
                let mut moved = effects.to_vec();
                moved[effect].1[parameter] = value;
                predict(&moved)
            };
            let (below, above) = (at(low)?, at(high)?);
            Ok(below
                .iter()
                .zip(&above)
                .map(|(b, a)| match (b, a) {
                    (Ok(b), Ok(a)) => (a - b) / (high - low),
                    _ => 0.0,
                })
                .collect())
        })
        .collect()
}
