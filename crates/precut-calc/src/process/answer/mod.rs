//! What is said after each part, and what to do for the next.

pub(super) mod action;
pub(super) mod measure;
pub(super) mod next;
pub(super) mod outlook;
pub(super) mod output;
pub(super) mod stored;
