//! The answer: numbers, pictures, and what is said of it.

pub(super) mod advice;
pub(super) mod compensated;
pub(super) mod left;
pub(super) mod moves;
pub(super) mod output;
pub(super) mod picture;
pub(super) mod refed;
pub(super) mod returned;
