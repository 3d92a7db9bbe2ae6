//! Margins of the cuts of a log; what cuts of one speed, depth, width and feed share is computed once.

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::calculator::{
    ClassLimits, Failure, Finding, LimitCurve, Missing, Monitor, Outlook, Prediction, PrepareError, Rows,
};
use crate::effects::MillingEffect;

use super::super::cost::on_map_ms;
use super::super::job::{Case, Job, beyond_modes, fits, guessed};
use super::super::model::{Alias, Cut, Mode, Multiplier, Orders};
use super::forward::{CutMargin, MillingAllowances, MillingPoint, MillingRun};
use super::limits::{Look, cut_at, first_limit_mm, teeth_per_period};
use super::lobes::limit_over_speed;

/// Of the frequencies of a disturbance those count whose share is at least this times the largest: which of them sounds loudest
/// depends on where it is heard.
const LOUD: f64 = 0.3;
/// A cut behaves like one of a depth within its scatter, and near a depth at which another mode takes over it may sound as either: depths
/// over its own whose frequencies count, too, two usual scatters to either side.
const SOUNDS: [f64; 2] = [0.9, 1.1];
/// Widths and feeds whose limits are drawn.
const MOST_CURVES: usize = 4;

/// What no effect parameter changes.
pub struct PreparedMilling {
    /// The job with its measured sides as modes, at every width and feed of the rows.
    cases: Vec<Case>,
    pub(super) rows: Vec<PreparedRow>,
    /// Rows of one cut.
    places: Vec<Vec<usize>>,
    orders: Orders,
}

/// A row with its cut.
#[derive(Debug, Clone, Copy)]
pub(super) struct PreparedRow {
    /// Which width and feed.
    pub case: usize,
    pub spindle_rpm: f64,
    pub feed_mm: f64,
    pub depth_mm: f64,
    pub width_mm: f64,
    pub margin: CutMargin,
    /// Frequency that was heard, where that is asked.
    heard_hz: f64,
    /// Growth of ln|mu| from tooth to tooth with the logarithm of the depth, at the limit of the base that the cut lies beside.
    steepness: f64,
}

impl PreparedRow {
    fn place(&self) -> (usize, u64, u64) {
        (self.case, self.spindle_rpm.to_bits(), self.depth_mm.to_bits())
    }
}

impl PreparedMilling {
    pub(super) fn new(
        job: &Job,
        rows: &Rows<MillingRun, MillingPoint>,
        monitor: &dyn Monitor,
    ) -> Result<Self, PrepareError> {
        let (_, job) = fits(job, monitor).map_err(PrepareError::Failed)?;
        let unchecked = || PrepareError::Failed(Failure::Internal("a job that the check refuses".to_owned()));
        let own = Case::of(&job).ok_or_else(unchecked)?;
        if let Some(fault) = beyond_modes(&job.effects, own.structure.modes.len()) {
            return Err(PrepareError::Invalid(vec![fault]));
        }
        let mut prepared = Self { cases: Vec::new(), rows: Vec::new(), places: Vec::new(), orders: Orders::default() };
        let mut known: Vec<(u64, u64)> = Vec::new();
        let mut faults = Vec::new();
        for (row, (run, point)) in rows.points.iter().enumerate() {
            let Some(of) = rows.runs.get(*run) else {
                faults.push(Finding::new("unknown_run", format!("/measurements/{row}/run")).with("run", *run));
                continue;
            };
            let width_mm = point.width_mm.or(of.width_mm).or(job.cut.width_mm);
            let feed_mm = of.feed_mm_per_tooth.unwrap_or(own.milling.feed_mm);
            let key = (width_mm.unwrap_or(0.0).to_bits(), feed_mm.to_bits());
            let case = known.iter().position(|other| *other == key).or_else(|| {
                prepared.cases.push(Case::of(&with(&job, width_mm, feed_mm))?);
                known.push(key);
                Some(known.len() - 1)
            });
            let Some(case) = case else {
                faults.push(width_fault(&job, width_mm, row));
                continue;
            };
            prepared.rows.push(PreparedRow {
                case,
                spindle_rpm: point.spindle_speed_rpm.or(of.spindle_speed_rpm).unwrap_or(own.rotation.spindle_rpm),
                feed_mm,
                depth_mm: point.depth_mm.or(of.depth_mm).unwrap_or(own.depth_mm),
                width_mm: prepared.cases[case].width_mm,
                margin: point.margin,
                heard_hz: point.frequency_hz.unwrap_or(0.0),
                steepness: 1.0,
            });
        }
        if !faults.is_empty() {
            return Err(PrepareError::Invalid(faults));
        }
        prepared.place();
        prepared.find_steepness(monitor).map_err(PrepareError::Failed)?;
        Ok(prepared)
    }

    fn place(&mut self) {
        let mut places: BTreeMap<_, Vec<usize>> = BTreeMap::new();
        for (index, row) in self.rows.iter().enumerate() {
            places.entry(row.place()).or_default().push(index);
        }
        self.places = places.into_values().collect();
    }

    /// The modes of tool and workpiece, those of the tool first.
    pub(super) fn modes(&self) -> &[Mode] {
        self.cases.first().map_or(&[], |case| &case.structure.modes)
    }

    /// A cutter of the rows.
    pub(super) fn case(&self) -> Option<&Case> {
        self.cases.first()
    }

    /// One value per row.
    pub(super) fn predicted(
        &self,
        effects: &[MillingEffect],
        monitor: &dyn Monitor,
    ) -> Result<Vec<Prediction>, Failure> {
        let cases: Vec<Case> = self.cases.iter().map(|case| case.clone().with_effects(effects)).collect();
        let of_place = |rows: &Vec<usize>| self.at_place(&cases, rows, monitor);
        let of_places: Vec<Vec<(usize, Prediction)>> =
            self.places.par_iter().map(of_place).collect::<Result<_, _>>()?;
        let mut predicted = vec![Err(Missing::NoSolution); self.rows.len()];
        for (row, prediction) in of_places.into_iter().flatten() {
            predicted[row] = prediction;
        }
        Ok(predicted)
    }

    fn at_place(
        &self,
        cases: &[Case],
        rows: &[usize],
        monitor: &dyn Monitor,
    ) -> Result<Vec<(usize, Prediction)>, Failure> {
        let first = &self.rows[rows[0]];
        let all = |missing: Missing| rows.iter().map(|&row| (row, Err(missing))).collect();
        if first.depth_mm <= 0.0 {
            return Ok(all(Missing::NoCut));
        }
        let case = &cases[first.case];
        let Some(cut) = cut_at(case, first.spindle_rpm, first.depth_mm) else { return Ok(all(Missing::NoSolution)) };
        let asks_frequency = rows.iter().any(|&row| self.rows[row].margin == CutMargin::Frequency);
        let found = if asks_frequency {
            self.heard(&cut, monitor)?
        } else {
            self.orders.on_map(&cut, monitor)?.map(|multiplier| (multiplier, Vec::new()))
        };
        let Some((multiplier, loud)) = found else { return Ok(all(Missing::NoSolution)) };
        let growth = multiplier.growth() / teeth_per_period(&cut);
        let of = |&row: &usize| {
            let own = &self.rows[row];
            let margin = match own.margin {
                CutMargin::Chatter => Ok(-growth / own.steepness),
                CutMargin::Frequency => nearest(&loud, own.heard_hz).ok_or(Missing::NoSolution),
            };
            (row, margin)
        };
        Ok(rows.iter().map(of).collect())
    }

    /// What may be seen of every row that is cut next.
    pub(super) fn outlooks(
        &self,
        allowances: &MillingAllowances,
        effects: &[MillingEffect],
        monitor: &dyn Monitor,
    ) -> Result<Vec<Option<Outlook>>, Failure> {
        let cases: Vec<Case> = self.cases.iter().map(|case| case.clone().with_effects(effects)).collect();
        let of = |row: &PreparedRow| -> Result<Option<Outlook>, Failure> {
            let Some(cut) = cut_at(&cases[row.case], row.spindle_rpm, row.depth_mm) else { return Ok(None) };
            let Some((multiplier, aliases)) = self.orders.heard_on_map(&cut, monitor)? else { return Ok(None) };
            let growth = multiplier.growth() / teeth_per_period(&cut);
            Ok(Some(Outlook {
                margin: -growth / row.steepness,
                scatter: allowances.limit_scatter_rel,
                heard: loud(&aliases).map(f64::ln).collect(),
                heard_scatter: allowances.frequency_scatter_rel,
            }))
        };
        self.rows.par_iter().map(of).collect()
    }

    /// The multiplier of a cut and the frequencies that may be heard of it, Hz.
    fn heard(&self, cut: &Cut<'_>, monitor: &dyn Monitor) -> Result<Option<(Multiplier, Vec<f64>)>, Failure> {
        let Some((multiplier, own)) = self.orders.heard_on_map(cut, monitor)? else { return Ok(None) };
        let mut each = vec![own];
        for share in SOUNDS {
            let near = Cut { depth_mm: share * cut.depth_mm, ..*cut };
            each.extend(self.orders.heard_on_map(&near, monitor)?.map(|(_, aliases)| aliases));
        }
        Ok(Some((multiplier, each.iter().flat_map(|aliases| loud(aliases)).collect())))
    }

    /// g of every row: at the largest limit of the base below the cut, else at the least one above; 1 where there is none.
    fn find_steepness(&mut self, monitor: &dyn Monitor) -> Result<(), Failure> {
        let mut speeds: BTreeMap<(usize, u64), Vec<f64>> = BTreeMap::new();
        for row in self.rows.iter().filter(|row| row.margin == CutMargin::Chatter && row.depth_mm > 0.0) {
            speeds.entry((row.case, row.spindle_rpm.to_bits())).or_default().push(row.depth_mm);
        }
        let speeds: Vec<((usize, u64), Vec<f64>)> = speeds.into_iter().collect();
        let limits = |((case, speed), depths): &((usize, u64), Vec<f64>)| {
            let look =
                Look { orders: &self.orders, case: &self.cases[*case], spindle_rpm: f64::from_bits(*speed), monitor };
            Ok(((*case, *speed), look.limits(depths)?))
        };
        let found: BTreeMap<(usize, u64), Vec<(f64, f64)>> =
            speeds.par_iter().map(limits).collect::<Result<_, Failure>>()?;
        for row in &mut self.rows {
            let Some(limits) = found.get(&(row.case, row.spindle_rpm.to_bits())) else { continue };
            let below = limits.iter().rev().find(|(limit_mm, _)| *limit_mm <= row.depth_mm);
            if let Some((_, steepness)) = below.or(limits.first()) {
                row.steepness = *steepness;
            }
        }
        Ok(())
    }

    /// Where the rows stand, and the depth at which chatter begins with these effects, of every width and feed.
    pub(super) fn class_limits(
        &self,
        effects: &[MillingEffect],
        monitor: &dyn Monitor,
    ) -> Result<ClassLimits, Failure> {
        let of = |value: fn(&PreparedRow) -> f64| -> Vec<f64> { self.rows.iter().map(value).collect() };
        let (speeds, depths) = (of(|row| row.spindle_rpm), of(|row| row.depth_mm));
        let ends =
            speeds.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), n| (low.min(0.95 * n), high.max(1.05 * n)));
        let most_mm = 2.0 * depths.iter().copied().fold(1e-3, f64::max);
        let mut curves = Vec::new();
        for case in self.cases.iter().take(MOST_CURVES) {
            let case = case.clone().with_effects(effects);
            let limit = |speed: f64| self.limit_mm(&case, speed, most_mm, monitor);
            let found = limit_over_speed([ends.0, ends.1], most_mm, limit)?;
            curves.push(LimitCurve {
                feed_mm_per_tooth: case.milling.feed_mm,
                width_mm: Some(case.width_mm),
                depth_mm: found.iter().map(|(_, limit)| *limit).collect(),
                spindle_speed_rpm: found.iter().map(|(speed, _)| *speed).collect(),
                low_mm: Vec::new(),
                high_mm: Vec::new(),
            });
        }
        Ok(ClassLimits { spindle_speed_rpm: speeds, depth_mm: depths, curves })
    }

    fn limit_mm(
        &self,
        case: &Case,
        spindle_rpm: f64,
        depth_max_mm: f64,
        monitor: &dyn Monitor,
    ) -> Result<Option<f64>, Failure> {
        first_limit_mm(&self.orders, case, spindle_rpm, depth_max_mm, monitor)
    }

    /// Expected time of one prediction, ms, on average over the effects of a diagnosis.
    pub(super) fn predict_ms(&self) -> f64 {
        let of = |rows: &Vec<usize>| {
            let row = &self.rows[rows[0]];
            let sounds = rows.iter().any(|&row| self.rows[row].margin == CutMargin::Frequency);
            let of_sounds = if sounds { SOUNDS.len() } else { 0 };
            (1 + of_sounds) as f64 * on_map_ms(&self.cases[row.case], row.spindle_rpm)
        };
        self.places.iter().map(of).sum()
    }
}

/// Those of the frequencies of a disturbance that count, Hz, by falling share.
fn loud(aliases: &[Alias]) -> impl Iterator<Item = f64> + '_ {
    let loudest = aliases.first().map_or(0.0, |alias| alias.share);
    let counts = move |alias: &&Alias| alias.share >= LOUD * loudest && alias.frequency_hz > 0.0;
    aliases.iter().filter(counts).map(|alias| alias.frequency_hz)
}

/// Expected time of the prediction of one cut, ms.
pub(super) fn cut_ms(job: &Job) -> f64 {
    let case = guessed(job).and_then(|job| Case::of(&job));
    case.map_or(0.0, |case| on_map_ms(&case, case.rotation.spindle_rpm))
}

/// A job at another width and feed.
fn with(job: &Job, width_mm: Option<f64>, feed_mm: f64) -> Job {
    let mut job = job.clone();
    job.cut.width_mm = width_mm;
    (job.cut.feed_mm_per_tooth, job.cut.feed_mm_per_min) = (Some(feed_mm), None);
    job
}

/// A strip that misses the cutter.
fn width_fault(job: &Job, width_mm: Option<f64>, row: usize) -> Finding {
    let reach = 0.5 * (job.cutter.diameter_mm + width_mm.unwrap_or(0.0));
    Finding::new("strip_misses_cutter", format!("/measurements/{row}/width_mm")).measured(
        job.cut.offset_mm.abs(),
        reach,
        "mm",
    )
}

/// ln of that of the frequencies over the one heard that lies nearest to it.
fn nearest(loud_hz: &[f64], heard_hz: f64) -> Option<f64> {
    loud_hz.iter().map(|hz| (hz / heard_hz).ln()).min_by(|a, b| a.abs().total_cmp(&b.abs()))
}
