//! The analysis `settings_search`: fewest revolutions to a target, by simulation; where the tool opposite to a support does
//! not reach it, over everything that can be set ([`crate::ring_roundness::model::search_wide`]), in one stage or two.
//!
//! By the theory (`ring/5.4`) the tool stands opposite to a support and is fed straight down, starts clear of the largest
//! diameter and ends below the smallest; what is left then is the feed. The roundness does not fall steadily with the
//! revolutions, so they are scanned in steps of 5 %, and a setting is preferred whose neighbours pass, too.

use std::f64::consts::TAU;

use crate::calculator::{Failure, Finding, Message, Unwatched, checkpoint};

use crate::ring_roundness::answer::output_settings::{
    SearchOutcome, SearchSetting, SearchStatus, SecondStage, TriedColumns,
};
use crate::ring_roundness::job::input::{Job, LongWave};
use crate::ring_roundness::job::input_ranges::SearchRange;
use crate::ring_roundness::job::sampling::samples_of;
use crate::ring_roundness::model::place::Angles;
use crate::ring_roundness::model::scene::{Scene, mirrored_rad};
use crate::ring_roundness::model::search_wide::{self, Tried, Wide};
use crate::ring_roundness::model::simulate::{SAFETY, Share, or_none, stated_errors};
use crate::ring_roundness::model::stance::{Stance, at_radius, through_tip};
use crate::ring_roundness::model::surface::{UM_PER_MM, odd_waves_mm, of_radii, roundness_um, unevaluable};
use crate::ring_roundness::model::turning::plane::{Vec2, add, angle, norm, scaled, sub, unit};
use crate::ring_roundness::model::turning::{Setting, turn};

/// Nodes of the scan where a filter hides the teeth: good to some nm.
const SCAN_SAMPLES: u32 = 1800;
/// Nodes of the blank that the work is estimated from.
const COARSE_SAMPLES: usize = 360;
/// Step of the scan.
const STEP: f64 = 1.05;
/// The scan begins at this share of the revolutions at which D' is the target, and ends at this multiple.
const FROM: f64 = 0.25;
const TO: f64 = 8.0;
/// Odd orders named at most.
const ORDERS: usize = 5;
/// Share of the error that a second stage must leave at most to be worth its name.
const WORTH: f64 = 0.8;

/// The setting opposite to a support apart from its feed.
struct Plan {
    setting: Setting,
    travel_mm: f64,
    /// Revolutions at which the teeth are as high as the target.
    natural: f64,
}

pub(in crate::ring_roundness) fn search(
    job: &Job,
    range: &SearchRange,
    scene: &Scene,
    share: Share<'_>,
) -> Result<SearchOutcome, Failure> {
    let n = if job.filter == LongWave::None { samples_of(job) } else { samples_of(job).min(SCAN_SAMPLES) };
    let blank = scene.blank_mm(job, n as usize).map_err(unevaluable)?;
    let odd = odd_waves_mm(&blank);
    let odd_lobes_um = roundness_um(&odd, job.filter, share.monitor)?.0;
    let mut outcome = SearchOutcome {
        status: SearchStatus::BeyondLimits,
        best: None,
        fewest: None,
        odd_lobes_um,
        odd_orders: odd_orders(&odd)?,
        simulated: 0,
        tried: TriedColumns::default(),
        second_stage: None,
    };
    let plan = plan(range, scene, &blank);
    let finder = Finder { job, range, scene, blank, share };
    // What a second stage may begin with.
    let mut firsts = Vec::new();
    if let Some(plan) = plan {
        if odd_lobes_um > range.target_um {
            outcome.status = SearchStatus::OddLobes;
            if let Some(revolutions) = finder.nearest_allowed(&plan, plan.natural) {
                let setting = plan.at(revolutions);
                if let Some(found_um) = finder.cut_um(&setting)? {
                    outcome.note(revolutions, &plan, found_um);
                }
                outcome.best = finder.verified(&setting)?;
            }
        } else {
            finder.scan(&plan, &mut outcome)?;
        }
        firsts.extend(outcome.best.map(|best| plan.at(best.revolutions)));
    }
    if outcome.is_reached() {
        return Ok(outcome);
    }
    firsts.extend(finder.everywhere(&mut outcome)?);
    if !outcome.is_reached() {
        for first in firsts {
            outcome.second_stage = finder.second_stage(&first, &mut outcome.simulated)?;
            if outcome.second_stage.is_some_and(|stages| stages.second.margin_um >= 0.0) {
                outcome.status = SearchStatus::TwoStages;
                break;
            }
        }
    }
    Ok(outcome)
}

/// What a search is expected to do, before it does.
pub(in crate::ring_roundness) struct Expected {
    /// Largest number of revolutions of the scan.
    pub revolutions: f64,
    /// Whether the search over all angles is needed: opposite to a support no feed helps.
    pub is_wide: bool,
}

/// Of a coarse blank: the scan ends at about twice the revolutions at which the teeth are as high as the target.
pub(in crate::ring_roundness) fn expected(job: &Job, range: &SearchRange) -> Expected {
    let scene = Scene::of(job, &job.effects);
    let everything = Expected { revolutions: 0.0, is_wide: true };
    let Ok(blank) = scene.blank_mm(job, COARSE_SAMPLES) else { return everything };
    let odd = roundness_um(&odd_waves_mm(&blank), job.filter, &Unwatched).map_or(f64::MAX, |(odd_um, _)| odd_um);
    match plan(range, &scene, &blank) {
        Some(plan) if odd <= range.target_um => {
            let most = (plan.travel_mm / range.feed_min_mm_per_rev).min(range.revolutions_max);
            Expected { revolutions: (2.0 * plan.natural).min(most), is_wide: plan.natural > most }
        }
        _ => everything,
    }
}

impl Plan {
    fn at(&self, revolutions: f64) -> Setting {
        Setting { revolutions, feed_mm_per_rev: self.travel_mm / revolutions, ..self.setting.clone() }
    }
}

impl SearchOutcome {
    fn note(&mut self, revolutions: f64, plan: &Plan, roundness_um: f64) {
        self.tried.revolutions.push(revolutions);
        self.tried.feed_mm_per_rev.push(plan.travel_mm / revolutions);
        self.tried.roundness_um.push(roundness_um);
    }

    /// Whether one stage reaches the target.
    fn is_reached(&self) -> bool {
        matches!(self.status, SearchStatus::Robust | SearchStatus::Fragile)
    }
}

/// Odd orders of a profile by their size, those of more than a tenth of the largest.
fn odd_orders(odd_mm: &[f64]) -> Result<Vec<u32>, Failure> {
    let grid = crate::num::roundness::Grid::new(odd_mm.len()).map_err(unevaluable)?;
    let spectrum = grid.spectrum(odd_mm, 49).map_err(unevaluable)?;
    let mut orders: Vec<(u32, f64)> = (3..50_u32)
        .step_by(2)
        .filter_map(|order| spectrum.iter().find(|h| h.order == order as usize).map(|h| (order, h.amplitude_mm)))
        .collect();
    orders.sort_by(|p, q| q.1.total_cmp(&p.1));
    let least = orders.first().map_or(0.0, |largest| (0.1 * largest.1).max(1e-9));
    Ok(orders.into_iter().filter(|(_, size)| *size > least).take(ORDERS).map(|(order, _)| order).collect())
}

/// Tool opposite to support A, fed down, from clear of the largest diameter to below the smallest; `None` where the ring
/// would fall through.
fn plan(range: &SearchRange, scene: &Scene, blank: &[f64]) -> Option<Plan> {
    let n = blank.len();
    let width = |i: usize| blank[i] + blank[(i + n / 2) % n];
    let widths = (0..n / 2).map(width);
    let (narrowest, widest) = widths.fold((f64::INFINITY, 0.0_f64), |(low, high), w| (low.min(w), high.max(w)));
    let smallest = blank.iter().copied().fold(f64::INFINITY, f64::min);
    let end_mm = (0.5 * narrowest).min(smallest) - range.allowance_mm;
    let mut setting = scene.setting.clone();
    setting.feed_direction = [0.0, -1.0];
    setting.spark_out_revolutions = range.spark_out_revolutions;
    let rest = at_radius(&setting, [0.0, 0.0], end_mm)?;
    let tip_end = add(rest.centre_mm, scaled(unit(sub(rest.centre_mm, setting.support_a_mm)), end_mm));
    let travel_mm = travel(&setting, tip_end, 0.5 * widest + range.clearance_mm)?;
    let end = through_tip(&setting, tip_end)?;
    setting.tip_start_mm = add(tip_end, [0.0, travel_mm]);
    let reduction = end.radius_per_feed(setting.feed_direction);
    (travel_mm > 0.0 && reduction > 0.0).then(|| Plan {
        setting,
        travel_mm,
        natural: travel_mm * reduction * UM_PER_MM / range.target_um,
    })
}

/// How far above its end the tip must start for the circle through it to have a radius; by bisection.
fn travel(setting: &Setting, tip_end: Vec2, radius_mm: f64) -> Option<f64> {
    let radius = |up: f64| through_tip(setting, add(tip_end, [0.0, up])).map(|stance: Stance| stance.radius_mm);
    let (mut low, mut high) = (0.0, radius_mm);
    if radius(high)? < radius_mm {
        return None;
    }
    for _ in 0..60 {
        let mid = 0.5 * (low + high);
        if radius(mid)? < radius_mm {
            low = mid;
        } else {
            high = mid;
        }
    }
    Some(high)
}

/// Everything that a search needs at each of its settings.
struct Finder<'a> {
    job: &'a Job,
    range: &'a SearchRange,
    scene: &'a Scene,
    blank: Vec<f64>,
    share: Share<'a>,
}

impl Finder<'_> {
    /// Fewest and most revolutions that the machine allows.
    fn limits(&self, plan: &Plan) -> (f64, f64) {
        let fewest = (plan.travel_mm / self.range.feed_max_mm_per_rev).ceil().max(1.0);
        let most = (plan.travel_mm / self.range.feed_min_mm_per_rev).floor().min(self.range.revolutions_max);
        (fewest, most)
    }

    fn nearest_allowed(&self, plan: &Plan, revolutions: f64) -> Option<f64> {
        let (fewest, most) = self.limits(plan);
        (fewest <= most).then(|| revolutions.round().clamp(fewest, most))
    }

    /// The radii after stages one after the other; `None` where the ring falls through.
    fn after(&self, stages: &[&Setting], mut radii_mm: Vec<f64>) -> Result<Option<Vec<f64>>, Failure> {
        for stage in stages {
            let watch = &mut |_: Option<&_>, _: &[f64]| checkpoint(self.share.monitor);
            let Some(turned) = or_none(turn::<Failure>(&radii_mm, stage, watch))? else { return Ok(None) };
            radii_mm = turned.radii_mm;
        }
        Ok(Some(radii_mm))
    }

    /// Roundness with the nodes of the scan, um.
    fn cut_um(&self, setting: &Setting) -> Result<Option<f64>, Failure> {
        let Some(radii) = self.after(&[setting], self.blank.clone())? else { return Ok(None) };
        Ok(or_none(roundness_um(&radii, self.job.filter, self.share.monitor))?.map(|(roundness_um, _)| roundness_um))
    }

    /// Scans the revolutions upward until three in a row pass and the middle one holds with the job's own nodes.
    fn scan(&self, plan: &Plan, outcome: &mut SearchOutcome) -> Result<(), Failure> {
        let (fewest, most) = self.limits(plan);
        let from = (FROM * plan.natural).round().max(fewest);
        let to = (TO * plan.natural).round().max(from).min(most);
        let (mut n, mut row) = (from, 0);
        let mut nearest: Option<(f64, f64)> = None;
        let mut single: Option<f64> = None;
        while n <= to {
            let share = ((n / from).ln() / (to / from).ln().max(1e-9)).clamp(0.0, 1.0);
            self.share.report(share, Message::new("stage_search").with("revolutions", n));
            let found = self.cut_um(&plan.at(n))?.unwrap_or(f64::MAX);
            outcome.note(n, plan, found);
            if nearest.is_none_or(|(_, best)| found < best) {
                nearest = Some((n, found));
            }
            row = if found <= self.range.target_um { row + 1 } else { 0 };
            if row > 0 && single.is_none() {
                single = Some(n);
            }
            if row >= 3 {
                let middle = outcome.tried.revolutions[outcome.tried.revolutions.len() - 2];
                if let Some(setting) = self.verified(&plan.at(middle))?.filter(|setting| setting.margin_um >= 0.0) {
                    outcome.status = SearchStatus::Robust;
                    outcome.best = Some(setting);
                    break;
                }
            }
            n = (n * STEP).round().max(n + 1.0);
        }
        if let Some(fewest) = single {
            outcome.fewest = self.verified(&plan.at(fewest))?.filter(|setting| setting.margin_um >= 0.0);
        }
        if let (None, Some((n, _))) = (&outcome.best, nearest) {
            outcome.best = self.verified(&plan.at(n))?;
            if outcome.best.is_some_and(|best| best.margin_um >= 0.0) {
                outcome.status = SearchStatus::Fragile;
            }
        }
        Ok(())
    }

    /// A setting with the job's own nodes, and with half and a third of them for the error.
    fn verified(&self, setting: &Setting) -> Result<Option<SearchSetting>, Failure> {
        let coarse = self.coarse_mm()?;
        self.verified_after(&[], setting, &coarse)
    }

    fn coarse_mm(&self) -> Result<Vec<f64>, Failure> {
        self.scene.blank_mm(self.job, search_wide::nodes(self.job) as usize).map_err(unevaluable)
    }

    /// The same of a setting that begins with what others leave; `start_mm` is that, with the nodes of the wide search.
    fn verified_after(
        &self,
        before: &[&Setting],
        setting: &Setting,
        start_mm: &[f64],
    ) -> Result<Option<SearchSetting>, Failure> {
        let n = samples_of(self.job).max(crate::ring_roundness::job::input::DEFAULT_SAMPLES);
        let stages: Vec<&Setting> = before.iter().copied().chain([setting]).collect();
        let mut surfaces = Vec::with_capacity(3);
        for nodes in [n, n / 2, (n / 3).next_multiple_of(4)] {
            let blank = self.scene.blank_mm(self.job, nodes as usize).map_err(unevaluable)?;
            let Some(radii) = self.after(&stages, blank)? else { return Ok(None) };
            let Some(surface) = or_none(of_radii(&radii, self.job.filter, 2, self.share.monitor))? else {
                return Ok(None);
            };
            surfaces.push(surface);
        }
        let [full, half, third] = &surfaces[..] else { return Ok(None) };
        let error = stated_errors(full, &[(half, SAFETY), (third, SAFETY)]);
        let (roundness_um, error_um) = (full.evaluated.filtered.least_squares_um, error.filtered.least_squares_um);
        let end = through_tip(setting, setting.tip_end_mm())
            .ok_or_else(|| Failure::OutOfModel(Finding::new("no_end_position", "/tool")))?;
        let angles = Angles { half_angle_rad: end.half_angle_rad, tool_rad: end.tool_rad() };
        let mirrored = self.scene.mirrored;
        let [x, y] = setting.tip_start_mm;
        Ok(Some(SearchSetting {
            tool_x_mm: if mirrored { -x } else { x },
            tool_y_mm: y,
            feed_direction_deg: mirrored_rad(angle(setting.feed_direction), mirrored).rem_euclid(TAU).to_degrees(),
            support_distance_mm: norm(sub(setting.support_b_mm, setting.support_a_mm)),
            support_depth_mm: -setting.support_a_mm[1],
            support_half_angle_deg: end.half_angle_rad.to_degrees(),
            tool_angle_deg: mirrored_rad(end.tool_rad(), mirrored).to_degrees(),
            compliance_ratio: setting.compliance_ratio,
            robust_share: self.wide(start_mm).robust_share(angles, setting)?,
            feed_mm_per_rev: setting.feed_mm_per_rev,
            revolutions: setting.revolutions,
            spark_out_revolutions: setting.spark_out_revolutions,
            roundness_um,
            roundness_error_um: error_um,
            margin_um: self.range.target_um - roundness_um - error_um,
            mean_radius_mm: full.evaluated.mean_radius_mm,
        }))
    }

    fn wide<'b>(&'b self, blank: &'b [f64]) -> Wide<'b> {
        Wide {
            job: self.job,
            range: self.range,
            base: &self.scene.setting,
            softness: &self.scene.softness,
            mirrored: self.scene.mirrored,
            blank,
            share: self.share,
        }
    }

    /// The search over all angles; what it finds is taken where it is better. The setting that it found.
    fn everywhere(&self, outcome: &mut SearchOutcome) -> Result<Option<Setting>, Failure> {
        let blank = self.coarse_mm()?;
        let Some(found) = self.wide(&blank).search()? else { return Ok(None) };
        outcome.simulated += found.simulated;
        let Some((found, setting)) = self.first_that_holds(&[], found.best, &blank)? else { return Ok(None) };
        if setting.margin_um >= 0.0 {
            let robust = setting.robust_share >= search_wide::ROBUST;
            outcome.status = if robust { SearchStatus::Robust } else { SearchStatus::Fragile };
        }
        if outcome.is_reached() || outcome.best.is_none_or(|best| setting.roundness_um < best.roundness_um) {
            outcome.best = Some(setting);
        }
        Ok(Some(found))
    }

    /// The first of the settings found that meets the target with the job's own nodes and their error, else the first.
    fn first_that_holds(
        &self,
        before: &[&Setting],
        found: Vec<Tried>,
        start_mm: &[f64],
    ) -> Result<Option<(Setting, SearchSetting)>, Failure> {
        let mut first = None;
        for tried in found {
            if first.is_some() && tried.roundness_um > self.range.target_um {
                continue;
            }
            let Some(verified) = self.verified_after(before, &tried.setting, start_mm)? else { continue };
            if verified.margin_um >= 0.0 {
                return Ok(Some((tried.setting, verified)));
            }
            first.get_or_insert((tried.setting, verified));
        }
        Ok(first)
    }

    /// A second stage that begins with what the first leaves: the waves that the first does not see decay at other angles
    /// (`ring/5.5`). Given only where the simulation of both shows a gain.
    fn second_stage(&self, first: &Setting, simulated: &mut usize) -> Result<Option<SecondStage>, Failure> {
        let blank = self.coarse_mm()?;
        let Some(left_mm) = self.after(&[first], blank.clone())? else { return Ok(None) };
        let Some(found) = self.wide(&left_mm).search()? else { return Ok(None) };
        *simulated += found.simulated;
        let second = self.first_that_holds(&[first], found.best, &left_mm)?.map(|(_, second)| second);
        let Some((first, second)) = self.verified_after(&[], first, &blank)?.zip(second) else { return Ok(None) };
        let worth = self.range.target_um.max(WORTH * first.roundness_um);
        Ok(Some(SecondStage { first, second }).filter(|stages| stages.second.roundness_um < worth))
    }
}
