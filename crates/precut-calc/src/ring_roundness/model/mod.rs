//! The physics.

pub(super) mod causes;
pub(super) mod linear;
pub(super) mod lobing;
pub(super) mod place;
pub(super) mod replay;
pub(super) mod scene;
pub(super) mod search;
pub(super) mod search_wide;
pub(super) mod simulate;
pub(super) mod softness;
pub(super) mod speeds;
pub(super) mod stance;
pub(super) mod surface;
pub(super) mod turning;
