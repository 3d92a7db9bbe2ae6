//! What is remembered of the parts: a process, part by part.

pub(super) mod account;
pub(super) mod decide;
pub(super) mod follow;
pub(super) mod memory;
pub(super) mod snapshot;
pub(super) mod watch;
