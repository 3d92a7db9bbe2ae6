//! What a diagnosis needs: the forward model, causes, consequences, next runs.

pub(super) mod forward;
pub(super) mod hypotheses;
pub(super) mod measurement;
pub(super) mod next_runs;
