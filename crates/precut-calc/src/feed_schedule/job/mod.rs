//! What is asked: input, defaults, checks, and the case that acts.

pub(super) mod acting;
pub(super) mod blank;
pub(super) mod case;
pub(super) mod check;
pub(super) mod compliance;
pub(super) mod effects;
pub(super) mod formula;
pub(super) mod input;
pub(super) mod models;
pub(super) mod of_fit;
pub(super) mod open;
pub(super) mod plan;
pub(super) mod remainder;
pub(super) mod scatter;
pub(super) mod segments;
