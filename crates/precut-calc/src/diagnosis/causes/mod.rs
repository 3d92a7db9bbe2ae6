//! What causes do to the rows, and which sets of them explain the rows (`diagnosis/3.4`, `diagnosis/3.6`).

pub(super) mod descent;
pub(super) mod optima;
pub(super) mod profile;
pub(super) mod ranking;
pub(super) mod refine;
pub(super) mod search;
pub(super) mod signatures;
pub(super) mod subject;
pub(super) mod survey;
