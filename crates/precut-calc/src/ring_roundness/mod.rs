//! Roundness of rings: how it is evaluated.

pub mod evaluation;
