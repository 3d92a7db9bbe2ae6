//! The answer: numbers, pictures, and what is said of it.

pub(super) mod advice;
pub(super) mod output;
pub(super) mod picture;
pub(super) mod returned;
