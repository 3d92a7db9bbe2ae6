//! What rows say of a hypothesis that is linear: covariance, evidence, remainders (`diagnosis/3.2`, `diagnosis/3.4`, `diagnosis/3.5`).

pub(super) mod blocks;
pub(super) mod class_likelihood;
pub(super) mod discrepancy;
pub(super) mod evidence;
pub(super) mod fairness;
pub(super) mod likelihood;
pub(super) mod values_beside;
pub(super) mod whiten;
