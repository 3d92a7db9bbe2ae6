//! Predictions of measured rows; what rows of one working point share is computed once.

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::calculator::{Failure, JacobianColumn, Missing, Monitor, Prediction};
use crate::effects::{FixtureConditions, FixtureEffect};

use crate::fixture_stability::answer::study::{UM_PER_MM, forced, forced_span_mm};
use crate::fixture_stability::job::acting::Case;
use crate::fixture_stability::job::check;
use crate::fixture_stability::job::input::FixtureJob;
use crate::fixture_stability::measured::forward::{Measure, RegimeMargin};
use crate::fixture_stability::measured::margins::or_missing;
use crate::fixture_stability::model::floquet::Working;
use crate::fixture_stability::model::lobes::{Rules, critical_depth, smooth_moduli};
use crate::fixture_stability::model::simulate::{count, plan, run as simulate, steps_per_tooth};

/// Step of a difference over time, s: below a tenth of a period of any vise.
const TIME_STEP_S: f64 = 1e-5;
/// Processor time on one core, ms, measured on a part of 4.4 kg at 400 Hz and six teeth at 300 to 640 rev/min: a forced
/// motion, a multiplier, a limit, a kept step in time; a second mode adds a fifth to a half. A depth takes 1.0 ms with joints
/// that harden and 0.8 ms with uneven teeth: a diagnosis asks for such motions once in a dozen predictions each.
const FORCED_MS: f64 = 0.04;
const MULTIPLIER_MS: f64 = 0.13;
const NOT_LINEAR_MS: f64 = (1.0 + 0.8) / 12.0;
const LIMIT_MS: f64 = 1.1;
const KEPT_STEP_MS: f64 = 5e-5;

/// What no effect parameter changes.
pub struct PreparedFixture {
    pub(in crate::fixture_stability) job: FixtureJob,
    /// The job with the effects that it holds.
    pub(in crate::fixture_stability) base: Case,
    pub(in crate::fixture_stability) rows: Vec<PreparedRow>,
    pub(in crate::fixture_stability) measure: Measure,
    pub(in crate::fixture_stability) rules: Rules,
    /// Rows of one speed, feed and time since clamping.
    groups: Vec<Vec<usize>>,
    /// Of classes: growth of ln|mu| with the logarithm of the depth where chatter begins in the base, by group.
    pub(in crate::fixture_stability) steepness: Vec<f64>,
}

/// A measured row's working point.
#[derive(Clone, Copy)]
pub(in crate::fixture_stability) struct PreparedRow {
    /// Index of its run.
    pub run: usize,
    pub working: Working,
    pub time_since_clamping_min: Option<f64>,
    /// Of a history.
    pub time_s: f64,
    /// Of a class.
    pub margin: RegimeMargin,
}

impl PreparedRow {
    /// What all rows of one speed share, as keys: not negative, so their bits are in order.
    pub(in crate::fixture_stability) fn regime(&self) -> (u64, u64, u64) {
        let clamped = self.time_since_clamping_min.unwrap_or(0.0);
        (self.working.spindle_rpm.to_bits(), self.working.feed_mm.to_bits(), clamped.to_bits())
    }
}

/// How rows are predicted.
#[derive(Clone, Copy)]
pub(in crate::fixture_stability) struct Ask<'a> {
    /// Whether a chattering point is to be found out.
    pub whether_stable: bool,
    /// How much later every row of a history is read, s.
    pub later_s: f64,
    pub monitor: &'a dyn Monitor,
}

impl<'a> Ask<'a> {
    pub(in crate::fixture_stability) fn new(monitor: &'a dyn Monitor) -> Self {
        Self { whether_stable: true, later_s: 0.0, monitor }
    }
}

impl PreparedFixture {
    pub(in crate::fixture_stability) fn new(
        job: FixtureJob,
        base: Case,
        rows: Vec<PreparedRow>,
        measure: Measure,
        rules: Rules,
        monitor: &dyn Monitor,
    ) -> Result<Self, Failure> {
        let mut groups: BTreeMap<_, Vec<usize>> = BTreeMap::new();
        for (index, row) in rows.iter().enumerate() {
            groups.entry(row.regime()).or_default().push(index);
        }
        let groups = groups.into_values().collect();
        let mut prepared = Self { job, base, rows, measure, rules, groups, steepness: Vec::new() };
        if measure == Measure::Regime {
            let each: Result<Vec<f64>, Failure> =
                prepared.groups.par_iter().map(|rows| prepared.steepness_of(rows, monitor)).collect();
            prepared.steepness = each?;
        }
        Ok(prepared)
    }

    /// One value per row.
    pub(in crate::fixture_stability) fn predicted(
        &self,
        effects: &[FixtureEffect],
        ask: Ask<'_>,
    ) -> Result<Vec<Prediction>, Failure> {
        let mut all = self.job.effects.clone();
        all.extend_from_slice(effects);
        let of_groups: Vec<Vec<(usize, Prediction)>> =
            (0..self.groups.len()).into_par_iter().map(|g| self.group(g, &all, ask)).collect::<Result<_, _>>()?;
        let mut predicted = vec![Err(Missing::NoSolution); self.rows.len()];
        for (row, prediction) in of_groups.into_iter().flatten() {
            predicted[row] = prediction;
        }
        Ok(predicted)
    }

    fn group(
        &self,
        group: usize,
        effects: &[FixtureEffect],
        ask: Ask<'_>,
    ) -> Result<Vec<(usize, Prediction)>, Failure> {
        let rows = &self.groups[group];
        let first = &self.rows[rows[0]];
        let conditions = FixtureConditions { time_since_clamping_min: first.time_since_clamping_min };
        let case = Case::with(&self.job, effects, &conditions)
            .map(|case| Case { working: first.working, ..case })
            .filter(check::holds);
        let Some(case) = case else { return Ok(rows.iter().map(|&row| (row, Err(Missing::NoSolution))).collect()) };
        let mut by_depth: BTreeMap<u64, Vec<usize>> = BTreeMap::new();
        for &row in rows {
            by_depth.entry(self.rows[row].working.depth_mm.to_bits()).or_default().push(row);
        }
        let (mut unit, mut unit_mm) = (None, None);
        let mut moduli = self.moduli(&case, &by_depth, ask)?.into_iter();
        let mut predicted = Vec::with_capacity(rows.len());
        for rows in by_depth.into_values() {
            let working = self.rows[rows[0]].working;
            let case = Case { working, ..case.clone() };
            let modulus = moduli.next().unwrap_or(Err(Missing::NoSolution));
            match self.measure {
                Measure::Displacement => predicted.extend(self.history(&case, &rows, modulus, ask)?),
                Measure::Regime => {
                    let chatter = modulus.map(|modulus| -modulus.ln() / self.steepness[group]);
                    predicted.extend(self.margins(&case, &rows, chatter, &mut unit, ask.monitor)?);
                }
                Measure::PeakToPeak => {
                    let prediction = Self::peak_to_peak(&case, &mut unit_mm, modulus, ask)?;
                    predicted.extend(rows.into_iter().map(|row| (row, prediction)));
                }
                Measure::DepthLimit => {
                    let most = 4.0 * working.depth_mm.max(2.5);
                    let limit = critical_depth(&self.rules, &case.holding, &case.cutting, working, most, ask.monitor);
                    let prediction = or_missing(limit)?.and_then(|limit| limit.depth_mm.ok_or(Missing::NoSolution));
                    predicted.extend(rows.into_iter().map(|row| (row, prediction)));
                }
            }
        }
        Ok(predicted)
    }

    /// |mu| at every depth of a speed; where nobody asks for it 0. It is that of maps, off by 2e-5 near 1.
    fn moduli(
        &self,
        case: &Case,
        by_depth: &BTreeMap<u64, Vec<usize>>,
        ask: Ask<'_>,
    ) -> Result<Vec<Prediction>, Failure> {
        let is_asked = match self.measure {
            Measure::Regime => true,
            Measure::PeakToPeak | Measure::Displacement => ask.whether_stable,
            Measure::DepthLimit => false,
        };
        if !is_asked {
            return Ok(vec![Ok(0.0); by_depth.len()]);
        }
        // Where no margin of chatter is asked of a depth its modulus is not, either.
        let asks = |rows: &[usize]| {
            self.measure != Measure::Regime || rows.iter().any(|&row| self.rows[row].margin == RegimeMargin::Chatter)
        };
        let asked_mm: Vec<f64> =
            by_depth.iter().filter(|(_, rows)| asks(rows)).map(|(bits, _)| f64::from_bits(*bits)).collect();
        let Case { holding, cutting, working, .. } = case;
        let found = |depths_mm: &[f64]| {
            or_missing(smooth_moduli(&self.rules, holding, cutting, *working, depths_mm, ask.monitor))
        };
        // Where one depth has no solution the others may have theirs.
        let each: Vec<Prediction> = match found(&asked_mm)? {
            Ok(moduli) => moduli.into_iter().map(Ok).collect(),
            Err(_) => asked_mm.iter().map(|&mm| Ok(found(&[mm])?.map(|one| one[0]))).collect::<Result<_, Failure>>()?,
        };
        let mut each = each.into_iter();
        let mut next = || {
            let modulus = each.next().unwrap_or(Err(Missing::NoSolution));
            modulus.and_then(|modulus| if modulus.is_nan() { Err(Missing::NoSolution) } else { Ok(modulus) })
        };
        Ok(by_depth.values().map(|rows| if asks(rows) { next() } else { Err(Missing::NoSolution) }).collect())
    }

    /// The exact forced motion; a chattering point has no amplitude that a small change moves a little. `unit_mm` is
    /// the amplitude at 1 mm of depth, where the motion goes with H^(1-mu).
    fn peak_to_peak(
        case: &Case,
        unit_mm: &mut Option<f64>,
        modulus: Prediction,
        ask: Ask<'_>,
    ) -> Result<Prediction, Failure> {
        if case.working.depth_mm <= 0.0 {
            return Ok(Err(Missing::NoCut));
        }
        if let Some(missing) = instability(modulus) {
            return Ok(Err(missing));
        }
        if !case.is_linear() {
            let span_mm = or_missing(forced_span_mm(case, case.working, ask.monitor))?;
            return Ok(span_mm.map(|span_mm| span_mm * UM_PER_MM));
        }
        let span_mm = match unit_mm {
            Some(span_mm) => *span_mm,
            None => match or_missing(forced_span_mm(case, case.at_depth(1.0), ask.monitor))? {
                Ok(span_mm) => *unit_mm.insert(span_mm),
                Err(missing) => return Ok(Err(missing)),
            },
        };
        Ok(Ok(span_mm * case.cutting.depth_power(case.working.depth_mm) * UM_PER_MM))
    }

    /// x at the times of these rows after the entry: one cut in time, as long as the last row within it asks.
    fn history(
        &self,
        case: &Case,
        rows: &[usize],
        modulus: Prediction,
        ask: Ask<'_>,
    ) -> Result<Vec<(usize, Prediction)>, Failure> {
        if let Some(missing) = instability(modulus) {
            return Ok(rows.iter().map(|&row| (row, Err(missing))).collect());
        }
        let tau = case.cutting.tooth_period_s(case.working.spindle_rpm);
        let mut plan = plan(case, &self.job.simulation, case.working, 0.5);
        let time = |row: usize| (self.rows[row].time_s + ask.later_s).max(0.0);
        let periods = |row: usize| count((time(row) / tau).ceil() + 1.0);
        let (early, late): (Vec<usize>, Vec<usize>) = rows.iter().partition(|&&row| periods(row) <= plan.tooth_periods);
        let mut predicted = Vec::with_capacity(rows.len());
        if !late.is_empty() {
            // Long after the entry: the forced motion, in step with the tooth that entered at the start.
            let forced = or_missing(forced(case, case.working, ask.monitor))?;
            let at = |row: usize| forced.as_ref().map(|motion| motion.x_at(time(row)) * UM_PER_MM).map_err(|why| *why);
            predicted.extend(late.into_iter().map(|row| (row, at(row))));
        }
        let Some(wanted) = early.iter().map(|&row| periods(row)).max() else { return Ok(predicted) };
        plan.tooth_periods = wanted;
        plan.steady_periods = 1;
        plan.keep_first = wanted;
        plan.unilateral = case.holding.clamp_force_n.is_some();
        let steps = simulate(case, &plan, ask.monitor)?.first;
        predicted.extend(early.into_iter().map(|row| {
            let after = steps.partition_point(|step| step.time_s <= time(row)).clamp(1, steps.len().max(2) - 1);
            let value = match (steps.get(after - 1), steps.get(after)) {
                (Some(p), Some(q)) => {
                    let share = (time(row) - p.time_s) / (q.time_s - p.time_s);
                    Ok((p.x_mm + share * (q.x_mm - p.x_mm)) * UM_PER_MM)
                }
                _ => Err(Missing::NoSolution),
            };
            (row, value)
        }));
        Ok(predicted)
    }

    /// What a late zero of time does to the history of each run.
    pub(in crate::fixture_stability) fn late_by_ms(
        &self,
        late_ms: f64,
        effects: &[FixtureEffect],
        monitor: &dyn Monitor,
    ) -> Result<Vec<JacobianColumn>, Failure> {
        let at = |later_s: f64| self.predicted(effects, Ask { later_s, ..Ask::new(monitor) });
        let (before, after) = (at(-TIME_STEP_S)?, at(TIME_STEP_S)?);
        let slopes: Vec<f64> = before
            .iter()
            .zip(&after)
            .map(|pair| match pair {
                (Ok(before), Ok(after)) => (after - before) / (2.0 * TIME_STEP_S),
                _ => 0.0,
            })
            .collect();
        let runs = self.rows.iter().map(|row| row.run).max().map_or(0, |most| most + 1);
        let column = |run: usize| -> JacobianColumn {
            let moved = |(row, slope): (&PreparedRow, &f64)| if row.run == run { 1e-3 * late_ms * slope } else { 0.0 };
            self.rows.iter().zip(&slopes).map(moved).collect()
        };
        Ok((0..runs).filter(|&run| self.rows.iter().any(|row| row.run == run)).map(column).collect())
    }

    /// Expected time of one prediction, ms, on average over the effects of a diagnosis.
    pub(in crate::fixture_stability) fn predict_ms(&self) -> f64 {
        let mut cells: Vec<_> = self.rows.iter().map(|row| (row.regime(), row.working.depth_mm.to_bits())).collect();
        cells.sort_unstable();
        cells.dedup();
        let (groups, cells) = (self.groups.len() as f64, cells.len() as f64);
        match self.measure {
            Measure::PeakToPeak | Measure::Regime => FORCED_MS * groups + (MULTIPLIER_MS + NOT_LINEAR_MS) * cells,
            Measure::DepthLimit => LIMIT_MS * cells,
            Measure::Displacement => (FORCED_MS + MULTIPLIER_MS) * cells + KEPT_STEP_MS * self.steps(),
        }
    }

    /// Steps in time of the histories, most of them: up to the last row of each run.
    fn steps(&self) -> f64 {
        let mut last: BTreeMap<(usize, u64), f64> = BTreeMap::new();
        for row in &self.rows {
            let of = last.entry((row.run, row.working.spindle_rpm.to_bits())).or_insert(0.0);
            *of = of.max(row.time_s);
        }
        let steps = |(&(_, rpm), &time_s): (&(usize, u64), &f64)| {
            let rpm = f64::from_bits(rpm);
            let most = plan(&self.base, &self.job.simulation, self.base.working, 0.5).tooth_periods as f64;
            let periods = (time_s / self.base.cutting.tooth_period_s(rpm)).ceil() + 1.0;
            periods.min(most) * steps_per_tooth(&self.base, rpm) as f64
        };
        last.iter().map(steps).sum()
    }
}

/// Why a point has no amplitude, where it has none: it chatters, or there is no motion to ask about.
fn instability(modulus: Prediction) -> Option<Missing> {
    match modulus {
        Ok(modulus) => (modulus >= 1.0).then_some(Missing::Unstable),
        Err(missing) => Some(missing),
    }
}
