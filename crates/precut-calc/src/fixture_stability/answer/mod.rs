//! What is answered: output, advice, pictures, program.

pub(super) mod advice;
pub(super) mod clamp;
pub(super) mod conformance;
pub(super) mod output;
pub(super) mod parts;
pub(super) mod picture;
pub(super) mod plausible;
pub(super) mod probable_depths;
pub(super) mod speeds;
pub(super) mod study;
