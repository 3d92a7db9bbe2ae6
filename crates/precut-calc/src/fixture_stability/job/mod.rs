//! What is asked: input, defaults, checks, and the case that acts.

pub(super) mod acting;
pub(super) mod check;
pub(super) mod input;
pub(super) mod uncertain;
pub(crate) mod usual_scatter;
