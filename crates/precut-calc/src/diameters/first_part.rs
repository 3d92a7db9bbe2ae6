//! What a first part that is measured would make of the probability (`certainty/4.4`).

use crate::calculator::Failure;
use crate::certainty::lines::{Estimate, Margins};
use crate::certainty::{Improvement, ImprovingAction, Level};

use super::judged::{ABOVE, By, JOINT, Judged, LIMITS, MOST_LINES};

impl Judged<'_> {
    /// What a measured first part would make of it: the command is shifted by what the scores that all parts share are to be
    /// expected at, given the reading, to first order; that is tried on the real model (`certainty/4.4`).
    pub(super) fn first_part(&self, shift_um: f64, now: Estimate) -> Result<Option<Improvement>, Failure> {
        let gauge = self.gauge_um();
        let (errors_um, slopes_um) = (self.stated_um(), &self.slopes.of_um);
        let is_common = |index: usize| self.uncertainties.level(index) == Level::Setup;
        // What costs much to try is not advised, nor what would have to hold everywhere within bounds. Scores of one level that are
        // correlated with the other have no conditional distribution of that form.
        let is_tried = self.uncertainties.scores.is_independent()
            && self.uncertainties.within.is_empty()
            && !self.parts.cost_much();
        let Some(middle) = self.limits.middle_um().filter(|_| is_tried) else { return Ok(None) };
        let split = |slopes: &[f64]| {
            let of = |common: bool| {
                let chosen = slopes.iter().enumerate().filter(move |(i, _)| is_common(*i) == common);
                chosen.map(|(_, s)| s * s).sum::<f64>()
            };
            (of(true), of(false))
        };
        let told = |station: usize| {
            let (common, own) = split(&slopes_um[station]);
            (common, common + own + gauge * gauge)
        };
        // Where a reading tells most of what all parts share.
        let station = (0..slopes_um.len())
            .max_by(|&a, &b| {
                let share = |i: usize| told(i).0 * told(i).0 / told(i).1;
                share(a).total_cmp(&share(b))
            })
            .unwrap_or(0);
        let (common, total) = told(station);
        if common <= 0.0 {
            return Ok(None);
        }
        let h: Vec<f64> =
            slopes_um[station].iter().enumerate().map(|(i, s)| if is_common(i) { *s } else { 0.0 }).collect();
        // Scores that a reading lets expect: along h, as far as it is not scatter.
        let expected = |reading: f64| -> Vec<f64> { h.iter().map(|h| h * reading / total.sqrt()).collect() };
        let centred = |reading: f64| -> Result<f64, Failure> {
            let errors = self.errors_um(By::Model, &self.uncertainties, &expected(reading), 0.0)?;
            let [largest, smallest] = self.parts.places().extremes_um(&errors);
            Ok(middle - 0.5 * (largest + smallest))
        };
        let slope = (centred(0.5)? - centred(-0.5)?) / total.sqrt();
        let as_expected = centred(0.0)?;
        // What is advised is tried: on a first part with its own scatter and a gauge with its own, then on a later one.
        let own: Vec<usize> = (0..h.len()).filter(|index| !is_common(*index)).collect();
        let later = |by: By, scores: &[f64]| -> Result<Margins<LIMITS>, Failure> {
            let mut first = scores[..h.len()].to_vec();
            own.iter().zip(&scores[h.len()..]).for_each(|(&index, score)| first[index] = *score);
            let gauge_um = gauge * scores[h.len() + own.len()];
            match self.errors_um(by, &self.uncertainties, &first, shift_um) {
                Ok(errors) => {
                    let shift = as_expected + slope * (errors[station] + gauge_um - errors_um[station]);
                    self.cut(by, &self.uncertainties, &scores[..h.len()], shift)
                }
                Err(Failure::OutOfModel(_)) => Ok([f64::NEG_INFINITY; LIMITS]),
                Err(failure) => Err(failure),
            }
        };
        let count = h.len() + own.len() + 1;
        let change = |index: usize| -> Result<f64, Failure> {
            let at = |score: f64| -> Result<f64, Failure> {
                let mut scores = vec![0.0; count];
                scores[index] = score;
                Ok(later(By::Surface, &scores)?[ABOVE])
            };
            Ok(at(0.5)? - at(-0.5)?)
        };
        let axis = (0..count).map(change).collect::<Result<Vec<f64>, Failure>>()?;
        let question = self.question(&axis, MOST_LINES[2]);
        let by = |by: By| move |scores: &[f64]| later(by, scores);
        let then = self.really(&question, &mut by(By::Model), &mut by(By::Surface))?.of[JOINT];
        let action = ImprovingAction::MeasureFirstPart {
            z_mm: self.parts.places().z_mm[station],
            gauge_um: gauge,
            expected_um: errors_um[station],
            shift_as_expected_um: as_expected - shift_um,
            shift_um_per_um: slope,
        };
        Ok(Improvement::of(action, now, then))
    }
}
