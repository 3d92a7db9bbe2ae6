//! The physics.

pub(super) mod answering;
pub(super) mod cutting;
pub(super) mod drive;
pub(super) mod floquet;
pub(super) mod holding;
pub(super) mod lobes;
pub(super) mod march;
pub(super) mod response;
pub(super) mod settled;
pub(super) mod simulate;
pub(super) mod slip;
pub(super) mod slow;
pub(super) mod zeroth;
