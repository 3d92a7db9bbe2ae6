//! What is answered: output, advice, pictures, program.

pub(super) mod advice;
pub(super) mod conformance;
pub(super) mod elsewhere;
pub(super) mod map;
pub(super) mod output;
pub(super) mod output_settings;
pub(super) mod picture;
pub(super) mod tables;
