//! The job, what may stand in it, and the model that it means.

mod acting;
mod case;
mod check;
mod held;
mod input;
mod measured;
mod uncertain;

pub(super) use acting::beyond_modes;
pub(super) use case::{Case, range_rpm, varying};
pub(super) use check::{CODES, modes, too_expensive, way};
pub(super) use held::Held;
pub use held::{Coordinate, CutStation, GrippingContacts, GrippingPoint, GrippingVise, PartClamping};
pub use input::{
    Asked, ChipsAbout, Cut, CutLimits, CutWidth, Cutter, DirectionPart, EdgeForce, FlankRubbing, Job, KienzleForce,
    LobePlane, MechanisticForce, MillSpindle, Milling, NothingYields, PowerForce, RubbingSource, SpeedVariation,
    ToothHelix, ToothOffset, ToothPitch, Yielding, YieldingMode, YieldingModes, YieldingReceptances, YieldingVise,
};
pub(super) use measured::{Fit, fits, guessed};
pub(super) use uncertain::{Drawn, OneQuantity, clamped, drawn, uncertainties};
pub use uncertain::{MillingCorrelation, MillingQuantity, MillingUncertainQuantity, MillingUncertainty};
