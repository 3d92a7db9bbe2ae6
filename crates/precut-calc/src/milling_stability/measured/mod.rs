//! Logs of cuts, each stable or chattering: what in the model they contradict, where the limit runs with it, and which cut is best
//! made next (`milling/7.28`).

mod consequence;
mod forward;
mod hypotheses;
mod limits;
mod lobes;
mod measurement;
mod next_runs;
mod predict;

pub use forward::{CutMargin, MillingAllowances, MillingPoint, MillingRun};
pub use measurement::{MillingMeasurement, ObservedCut};
