//! What changed, since when, and how sure that is: sums over the parts.

pub(super) mod detector;
pub(super) mod null;
pub(super) mod onsets;
pub(super) mod report;
pub(super) mod scatter;
pub(super) mod sums;
pub(super) mod verdict;
