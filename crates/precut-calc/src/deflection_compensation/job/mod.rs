//! What is asked: input, defaults, checks, and the case that acts.

pub(super) mod acting;
pub(super) mod check;
pub(super) mod encounters;
pub(super) mod formula;
pub(super) mod grid;
pub(super) mod input;
pub(super) mod structure;
pub(super) mod writing;
