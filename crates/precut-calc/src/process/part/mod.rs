//! What a process and a part are, and what a part shows of each cause.

pub(super) mod bits;
pub(super) mod check;
pub(super) mod document;
pub(super) mod edges;
pub(super) mod sight;
