//! Standard deviation of the logarithm of what nobody states of a cut and of what holds the work (`certainty/1.4`).

pub(crate) const JOINT_STIFFNESS: f64 = 0.10;
pub(crate) const DAMPING: f64 = 0.30;
pub(crate) const CUTTING_FORCE: f64 = 0.10;
pub(crate) const SET_BY_HAND: f64 = 0.15;
pub(crate) const SET_BY_PRESSURE: f64 = 0.05;
pub(crate) const FRICTION: f64 = 0.20;
