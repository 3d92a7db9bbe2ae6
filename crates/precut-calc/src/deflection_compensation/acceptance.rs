//! Which readings to accept, and what that risks (`certainty/2.1`).

use crate::calculator::{Failure, Finding, Message};
use crate::certainty::lines::{Margins, Question, Together};
use crate::certainty::{Acceptance, bounded};

use super::conformance::{By, Judged};

/// Standard uncertainties by which acceptance limits lie within those of size: then a part that is just out of them is accepted
/// with 5 % (ISO 14253-1:2017).
const BAND: f64 = 1.65;
/// The part within its limits, and its reading within those of acceptance: above and below.
const LIMITS: usize = 4;
const SETS: [Together; 3] = [0..=1, 2..=3, 0..=3];
const GOOD: usize = 0;
const ACCEPTED: usize = 1;
const BOTH: usize = 2;
/// Most lines of one scrambling.
const MOST_LINES: usize = 128;

/// Codes of what is said here.
pub(super) const EXPLANATION_CODES: &[&str] = &["accept_between"];
/// Codes of the warnings made here.
pub(super) const WARNING_CODES: &[&str] = &["gauge_too_uncertain"];

impl Judged<'_> {
    /// Limits of acceptance for a gauge of that standard uncertainty; `None` without limits of size, and where none are left. Its error
    /// is the same for all readings of a part.
    pub(super) fn acceptance(&self, gauge_um: f64, shift_um: f64) -> Result<Option<Acceptance>, Failure> {
        let limits = self.limits();
        let band_um = BAND * gauge_um;
        let (upper_um, lower_um) = (limits.upper_um.map(|um| um - band_um), limits.lower_um.map(|um| um + band_um));
        let is_left = upper_um.zip(lower_um).is_none_or(|(upper, lower)| upper > lower);
        if !is_left || upper_um.or(lower_um).is_none() {
            return Ok(None);
        }
        let within = |upper_um: Option<f64>, lower_um: Option<f64>, [largest, smallest]: [f64; 2]| {
            [upper_um.map_or(f64::INFINITY, |um| um - largest), lower_um.map_or(f64::INFINITY, |um| smallest - um)]
        };
        // The last score is that of the gauge.
        let margins = |by: By, scores: &[f64]| -> Result<Margins<LIMITS>, Failure> {
            let (of_part, of_gauge) = scores.split_at(scores.len() - 1);
            let Some(ends) = self.ends_um(by, of_part, shift_um)? else { return Ok([f64::NEG_INFINITY; LIMITS]) };
            let read = ends.map(|um| um + gauge_um * of_gauge[0]);
            let (part, reading) = (within(limits.upper_um, limits.lower_um, ends), within(upper_um, lower_um, read));
            Ok([part[0], part[1], reading[0], reading[1]])
        };
        let axis: Vec<f64> = self.axis().iter().copied().chain([0.0]).collect();
        let question = Question { axis: &axis, sets: SETS, effort: self.effort(MOST_LINES), monitor: self.monitor() };
        let by = |by: By| move |scores: &[f64]| margins(by, scores);
        let found = question.of_real(MOST_LINES, &mut by(By::Rehearsal), &mut by(By::Surface))?;
        let [good, accepted, both] = [GOOD, ACCEPTED, BOTH].map(|set| found.of[set].probability);
        Ok(Some(Acceptance {
            measuring_uncertainty_um: gauge_um,
            guard_band_um: band_um,
            upper_um,
            lower_um,
            accepted: bounded(accepted),
            bad_among_accepted: bounded((accepted - both) / accepted.max(f64::MIN_POSITIVE)),
            good_and_rejected: bounded(good - both),
            numerical_error: found.of[BOTH].error,
        }))
    }
}

/// What is said of it.
pub(super) fn said(acceptance: &Acceptance) -> Message {
    let mut said = Message::new("accept_between")
        .with("gauge_um", acceptance.measuring_uncertainty_um)
        .with("bad_percent", 100.0 * acceptance.bad_among_accepted)
        .with("rejected_percent", 100.0 * acceptance.good_and_rejected);
    for (name, um) in [("upper_um", acceptance.upper_um), ("lower_um", acceptance.lower_um)] {
        if let Some(um) = um {
            said = said.with(name, um);
        }
    }
    said
}

/// What is warned of where limits of size leave no reading that can be accepted.
pub(super) fn none_left(gauge_um: f64, width_um: f64) -> Finding {
    Finding::new("gauge_too_uncertain", "/uncertainty/measurement/standard_uncertainty_um")
        .measured(gauge_um, width_um / (2.0 * BAND), "um")
        .with("width_um", width_um)
}
