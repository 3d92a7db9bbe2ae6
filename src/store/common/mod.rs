//! What is kept in the same way in both databases, written once over [`super::sql`].

pub(super) mod callbacks;
mod documents;
pub(super) mod jobs;
pub(super) mod line;
mod processes;
pub(super) mod results;
pub(super) mod run;
pub(super) mod runnable;
pub(super) mod shards;
mod shelf;
pub(super) mod usage;
