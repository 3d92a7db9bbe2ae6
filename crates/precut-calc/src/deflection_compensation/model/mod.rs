//! The physics.

pub(super) mod chords;
pub(super) mod cut;
pub(super) mod equilibrium;
pub(super) mod extremes;
pub(super) mod form;
pub(super) mod held;
pub(super) mod laws;
pub(super) mod power_cut;
pub(super) mod regime;
pub(super) mod rehearsal;
pub(super) mod second_order;
pub(super) mod soundness;
pub(super) mod stage;
pub(super) mod yielding;
