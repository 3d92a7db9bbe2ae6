//! The physics.

pub(super) mod assess;
pub(super) mod binding;
pub(super) mod compensated;
pub(super) mod continuous;
pub(super) mod dual;
pub(super) mod edges;
pub(super) mod infeasible;
pub(super) mod passes;
pub(super) mod prices;
pub(super) mod program;
pub(super) mod refusal;
pub(super) mod risk;
pub(super) mod rule;
pub(super) mod solve;
pub(crate) mod stretches;
pub(super) mod whole;
