//! What is asked: input, defaults, checks, and the case that acts.

pub(super) mod check;
pub(super) mod cut_force;
pub(super) mod input;
pub(super) mod input_ranges;
pub(super) mod sampling;
pub(super) mod uncertain;
