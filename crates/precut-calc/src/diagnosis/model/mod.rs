//! The model that is left behind, what it is worth, and what to measure next (`diagnosis/3.6`, `diagnosis/3.8`, `diagnosis/3.9`).

pub(super) mod downstream;
pub(super) mod extension;
pub(super) mod gain;
pub(super) mod known;
pub(super) mod next;
pub(super) mod outlook;
pub(super) mod outlying;
pub(super) mod term;
