//! What the rows are, and what they say of their own scatter (`diagnosis/3.1`, `diagnosis/8`).

pub(super) mod basis;
pub(super) mod copies;
pub(super) mod data;
pub(super) mod link;
pub(super) mod noise;
pub(super) mod outlier;
pub(super) mod sparse;
pub(super) mod suspect;
