//! How probably the diameters of turned parts keep their limits (`certainty/4`), for every calculator that turns some.
//!
//! What the drawing allows and what is not known exactly (`limits`, `quantities`) -> a [`Draw`] of it -> errors of the diameter
//! at stations, which the calculator makes of it ([`Parts`]) -> the probability that they keep their limits (`judged`), the aim
//! and the measured first part that raise it (`aim`, `first_part`), and the readings to accept (`acceptance`).

mod acceptance;
mod aim;
mod along;
mod draw;
mod first_part;
mod judged;
mod kept;
mod limits;
mod places;
mod quantities;
mod said;

pub(crate) use draw::Draw;
pub(crate) use judged::Judged;
pub(crate) use kept::kept;
pub use limits::{Aim, GaugeUncertainty, Tolerance, Uncertainty};
pub(crate) use places::Places;
pub(crate) use quantities::{CODES, DOUBT_LABELS, check};
pub use quantities::{DeflectionCorrelation, DeflectionQuantity, DeflectionUncertainQuantity};
pub(crate) use said::{EXPLANATION_CODES, OTHER_CUTS_CODES, WARNING_CODES, said, warnings};

use crate::calculator::Failure;
use crate::effects::DeflectionEffect;

/// What a job asks of the diameters of its parts.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Asked<'a> {
    pub(crate) tolerance: &'a Tolerance,
    pub(crate) uncertainty: &'a Uncertainty,
    /// Effects that scatter are uncertain, too.
    pub(crate) effects: &'a [DeflectionEffect],
    /// The least shift of the aim that is worth saying, um; none where the job has no aim that could be another one.
    pub(crate) open_aim_um: Option<f64>,
    /// Length over which errors may be new at every place of the part, mm; none where they may not.
    pub(crate) places_over_mm: Option<f64>,
}

/// Parts as a calculator cuts them.
pub(crate) trait Parts {
    /// Where errors are told.
    fn places(&self) -> &Places;

    /// Errors of the diameter by station of a part that is cut with a draw, um; with what makes the diameters commanded larger by
    /// `shift_um`. Fails as `OutOfModel` where it cannot be cut.
    fn errors_um(&self, draw: &Draw, shift_um: f64) -> Result<Vec<f64>, Failure>;

    /// Whether a part takes so long to cut that few should be.
    fn cost_much(&self) -> bool {
        false
    }
}
