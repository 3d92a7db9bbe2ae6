//! What a calculator has to say so that its process can be watched part by part.

use super::{Diagnosable, Failure, JacobianColumn, Monitor};

/// A calculator whose parts come one after another, each measured with a gauge.
pub trait Watched: Diagnosable {
    /// How far a quantity moves, in its unit, where the gauge shows 1 um more of a diameter; 0 of what is no deviation from
    /// the drawing.
    fn per_diameter_um(quantity: &str) -> f64;

    /// What scatters from one run to the next: what one standard deviation of each allowance that every run has for itself
    /// does to the rows of a single run. Always as many, in the same order.
    fn scatter(
        prepared: &Self::Prepared,
        effects: &[Self::Effect],
        allowances: &Self::Allowances,
        monitor: &dyn Monitor,
    ) -> Result<Vec<JacobianColumn>, Failure>;

    /// The conditions that come and go while the process stays as it is: all parts state one, or none does.
    fn conditions(run: &Self::Run) -> Vec<(&'static str, Option<f64>)>;

    /// Path that the edge had cut when the run began.
    fn path_m(run: &Self::Run) -> Option<f64>;

    /// A run with that path stated.
    fn at_path_m(run: &Self::Run, path_m: Option<f64>) -> Self::Run;

    /// Path that an edge cuts in a run, m.
    fn cut_path_m(job: &Self::Job, run: &Self::Run) -> f64;

    /// Runs other than the usual ones of a next measurement that tell causes apart: what they are, the condition that is another
    /// one, its value, and the run.
    fn telling_runs(job: &Self::Job, run: &Self::Run) -> Vec<TellingRun<Self::Run>>;

    /// What the drawing allows.
    fn limits(job: &Self::Job) -> Limits;

    /// What of a run decides the path that the calculator gives for a job: without a path of its own, and without conditions
    /// that no effect of the job goes with.
    fn deciding(job: &Self::Job, run: &Self::Run) -> Self::Run;

    /// A run on the path of another one; on the nominal one where that has none of its own.
    fn on_path_of(run: &Self::Run, other: &Self::Run) -> Self::Run;

    /// A run on the path that the calculator gives for a job under its conditions; `None` where it gives none.
    fn compensated(job: &Self::Job, run: &Self::Run, monitor: &dyn Monitor) -> Result<Option<Self::Run>, Failure>;

    /// The job under the conditions of a run, with these effects instead of its own. The path is its answer, so that of the run
    /// is not looked at.
    fn under(job: &Self::Job, run: &Self::Run, effects: Vec<Self::Effect>) -> Self::Job;

    /// A place along the part, as a share of its length.
    fn point_along(job: &Self::Job, share: f64) -> Self::Point;

    /// The path that an answer commands, as a run that was cut on it states it; nothing where the answer has no whole path.
    fn commanded(output: &Self::Output) -> Option<Self::Run>;
}

/// A run that may tell causes apart.
#[derive(Debug, Clone, PartialEq)]
pub struct TellingRun<R> {
    /// What it is: `other_depth`, `air_cut`.
    pub code: &'static str,
    /// The condition that is another one, and its value.
    pub condition: (&'static str, f64),
    /// The run.
    pub run: R,
}

/// What a drawing allows of the diameter along a part.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Limits {
    /// Largest minus smallest deviation, um.
    pub form_um: Option<f64>,
    /// Least deviation, um.
    pub lower_um: Option<f64>,
    /// Largest deviation, um.
    pub upper_um: Option<f64>,
}
