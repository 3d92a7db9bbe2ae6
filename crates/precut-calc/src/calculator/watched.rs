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

    /// What the drawing allows.
    fn limits(job: &Self::Job) -> Limits;

    /// The path that an answer commands, as a run that was cut on it states it; nothing where the answer has no whole path.
    fn commanded(output: &Self::Output) -> Option<Self::Run>;
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
