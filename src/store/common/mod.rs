//! What is kept in the same way in both databases, written once over [`super::sql`].

pub(super) mod callbacks;
mod documents;
pub(super) mod jobs;
mod processes;
pub(super) mod results;
pub(super) mod shards;
pub(super) mod usage;
