//! What a diagnosis needs: the forward model, causes, consequences, next runs.

pub(super) mod about;
pub(super) mod consequence;
pub(super) mod forward;
pub(super) mod hypotheses;
pub(super) mod measure;
pub(super) mod measurement;
pub(super) mod next_runs;
pub(super) mod prepared;
pub(super) mod run;
pub(super) mod watched;
