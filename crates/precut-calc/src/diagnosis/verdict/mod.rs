//! From weights to a verdict, and what it can and cannot tell (`diagnosis/3.3`, `diagnosis/3.5` to `diagnosis/3.7`).

pub(super) mod adequacy;
mod class_tests;
pub(super) mod effort;
pub(super) mod foundation;
pub(super) mod identify;
pub(super) mod judge;
pub(super) mod remainder;
pub(super) mod weigh;
