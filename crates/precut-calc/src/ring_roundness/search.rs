//! The analysis `settings_search`: fewest revolutions to a target, by simulation.
//!
//! By the theory (`ring/5.4`) the tool stands opposite to a support and is fed straight down, starts clear of the largest
//! diameter and ends below the smallest; what is left then is the feed. The roundness does not fall steadily with the
//! revolutions, so they are scanned in steps of 5 %, and a setting is preferred whose neighbours pass, too.

use crate::calculator::{Failure, Message, checkpoint};

use super::input::{Job, LongWave, SearchRange};
use super::output::{SearchOutcome, SearchSetting, SearchStatus, SecondStage, TriedColumns};
use super::sampling::samples_of;
use super::scene::Scene;
use super::simulate::Share;
use super::stance::{Stance, at_radius, through_tip};
use super::surface::{UM_PER_MM, odd_waves_mm, roundness_um, unevaluable};
use super::turning::plane::{Vec2, add, direction, scaled, sub, unit};
use super::turning::{Setting, turn};

/// Nodes of the scan where a filter hides the teeth: good to some nm.
const SCAN_SAMPLES: u32 = 1800;
/// Step of the scan.
const STEP: f64 = 1.05;
/// The scan begins at this share of the revolutions at which D' is the target, and ends at this multiple.
const FROM: f64 = 0.25;
const TO: f64 = 8.0;
/// Odd orders named at most.
const ORDERS: usize = 5;
/// Support half angle and tool angle of the second stage.
const SECOND_HALF_ANGLE_DEG: f64 = 20.0;
/// Feeds tried in the second stage, mm/rev.
const SECOND_FEEDS: [f64; 3] = [0.02, 0.04, 0.08];
/// How far off the tool is put to see what that does, deg.
const OFF_DEG: f64 = 0.1;
/// Share of the error that a second stage must leave at most to be worth its name.
const WORTH: f64 = 0.8;

/// The setting of the search apart from its feed.
struct Plan {
    setting: Setting,
    travel_mm: f64,
    /// Revolutions at which the teeth are as high as the target.
    natural: f64,
}

/// Result of one run.
struct Cut {
    roundness_um: f64,
    mean_radius_mm: f64,
    radii_mm: Vec<f64>,
}

pub(super) fn search(
    job: &Job,
    range: &SearchRange,
    scene: &Scene,
    share: Share<'_>,
) -> Result<SearchOutcome, Failure> {
    let n = if job.filter == LongWave::None { samples_of(job) } else { samples_of(job).min(SCAN_SAMPLES) };
    let blank = scene.blank_mm(job, n as usize).map_err(unevaluable)?;
    let odd = odd_waves_mm(&blank);
    let odd_lobes_um = roundness_um(&odd, job.filter)?.0;
    let mut outcome = SearchOutcome {
        status: SearchStatus::BeyondLimits,
        best: None,
        fewest: None,
        odd_lobes_um,
        odd_orders: odd_orders(&odd)?,
        tried: TriedColumns::default(),
        second_stage: None,
    };
    let Some(plan) = plan(range, scene, &blank) else { return Ok(outcome) };
    let finder = Finder { job, range, scene, plan, blank, share };
    if odd_lobes_um > range.target_um {
        outcome.status = SearchStatus::OddLobes;
        let Some(revolutions) = finder.nearest_allowed(finder.plan.natural) else { return Ok(outcome) };
        let first = finder.cut(&finder.setting(revolutions), &finder.blank)?;
        outcome.note(revolutions, &finder, first.roundness_um);
        outcome.best = Some(finder.verified(revolutions)?);
        outcome.second_stage = finder.second_stage(&first)?;
        return Ok(outcome);
    }
    finder.scan(&mut outcome)?;
    Ok(outcome)
}

impl SearchOutcome {
    fn note(&mut self, revolutions: f64, finder: &Finder<'_>, roundness_um: f64) {
        self.tried.revolutions.push(revolutions);
        self.tried.feed_mm_per_rev.push(finder.plan.travel_mm / revolutions);
        self.tried.roundness_um.push(roundness_um);
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
    plan: Plan,
    blank: Vec<f64>,
    share: Share<'a>,
}

impl Finder<'_> {
    fn setting(&self, revolutions: f64) -> Setting {
        let mut setting = self.plan.setting.clone();
        setting.revolutions = revolutions;
        setting.feed_mm_per_rev = self.plan.travel_mm / revolutions;
        setting
    }

    /// Fewest and most revolutions that the machine allows.
    fn limits(&self) -> (f64, f64) {
        let fewest = (self.plan.travel_mm / self.range.feed_max_mm_per_rev).ceil().max(1.0);
        let most = (self.plan.travel_mm / self.range.feed_min_mm_per_rev).floor().min(self.range.revolutions_max);
        (fewest, most)
    }

    fn nearest_allowed(&self, revolutions: f64) -> Option<f64> {
        let (fewest, most) = self.limits();
        (fewest <= most).then(|| revolutions.round().clamp(fewest, most))
    }

    fn cut(&self, setting: &Setting, blank: &[f64]) -> Result<Cut, Failure> {
        let turned = turn::<Failure>(blank, setting, &mut |_, _| checkpoint(self.share.monitor))?;
        let (roundness_um, mean_radius_mm) = roundness_um(&turned.radii_mm, self.job.filter)?;
        Ok(Cut { roundness_um, mean_radius_mm, radii_mm: turned.radii_mm })
    }

    /// Scans the revolutions upward until three in a row pass and the middle one holds with the job's own nodes.
    fn scan(&self, outcome: &mut SearchOutcome) -> Result<(), Failure> {
        let (fewest, most) = self.limits();
        let from = (FROM * self.plan.natural).round().max(fewest);
        let to = (TO * self.plan.natural).round().max(from).min(most);
        let (mut n, mut row) = (from, 0);
        let mut nearest: Option<(f64, f64)> = None;
        let mut single: Option<f64> = None;
        while n <= to {
            let share = ((n / from).ln() / (to / from).ln().max(1e-9)).clamp(0.0, 1.0);
            self.share.report(share, Message::new("stage_search").with("revolutions", n));
            let found = self.cut(&self.setting(n), &self.blank)?.roundness_um;
            outcome.note(n, self, found);
            if nearest.is_none_or(|(_, best)| found < best) {
                nearest = Some((n, found));
            }
            row = if found <= self.range.target_um { row + 1 } else { 0 };
            if row > 0 && single.is_none() {
                single = Some(n);
            }
            if row >= 3 {
                let middle = outcome.tried.revolutions[outcome.tried.revolutions.len() - 2];
                let setting = self.verified(middle)?;
                if setting.margin_um >= 0.0 {
                    outcome.status = SearchStatus::Robust;
                    outcome.best = Some(setting);
                    break;
                }
            }
            n = (n * STEP).round().max(n + 1.0);
        }
        if let Some(fewest) = single {
            let setting = self.verified(fewest)?;
            outcome.fewest = (setting.margin_um >= 0.0).then_some(setting);
        }
        if outcome.best.is_none()
            && let Some((n, _)) = nearest
        {
            let setting = self.verified(n)?;
            outcome.status = if setting.margin_um >= 0.0 { SearchStatus::Fragile } else { SearchStatus::BeyondLimits };
            outcome.best = Some(setting);
        }
        Ok(())
    }

    /// The setting with the job's own nodes, and with half of them for the error.
    fn verified(&self, revolutions: f64) -> Result<SearchSetting, Failure> {
        let setting = self.setting(revolutions);
        let n = samples_of(self.job).max(super::input::DEFAULT_SAMPLES);
        let blank = |n: u32| self.scene.blank_mm(self.job, n as usize).map_err(unevaluable);
        let full = self.cut(&setting, &blank(n)?)?;
        let half = self.cut(&setting, &blank(n / 2)?)?;
        let error = (full.roundness_um - half.roundness_um).abs();
        let x = setting.tip_start_mm[0];
        Ok(SearchSetting {
            tool_x_mm: if self.scene.mirrored { -x } else { x },
            tool_y_mm: setting.tip_start_mm[1],
            feed_mm_per_rev: setting.feed_mm_per_rev,
            revolutions,
            spark_out_revolutions: setting.spark_out_revolutions,
            roundness_um: full.roundness_um,
            roundness_error_um: error,
            margin_um: self.range.target_um - full.roundness_um - error,
            mean_radius_mm: full.mean_radius_mm,
        })
    }

    /// Supports closer together and the tool on top: three lobes and others that the first stage cannot see decay there
    /// (`ring/5.5`). Given only where the simulation of both stages shows a gain.
    fn second_stage(&self, first: &Cut) -> Result<Option<SecondStage>, Failure> {
        let half_angle = SECOND_HALF_ANGLE_DEG.to_radians();
        let radii = &first.radii_mm;
        let (low, high) =
            radii.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), radius| (low.min(*radius), high.max(*radius)));
        let reach = first.mean_radius_mm + self.plan.setting.roller_radius_mm;
        let half = reach * half_angle.sin();
        let depth = -self.plan.setting.support_a_mm[1];
        let at = |feed: f64, off_deg: f64| -> Option<Setting> {
            let mut setting = self.plan.setting.clone();
            (setting.support_a_mm, setting.support_b_mm) = ([-half, -depth], [half, -depth]);
            let end_mm = low - self.range.allowance_mm;
            let rest = at_radius(&setting, [0.0, 0.0], end_mm)?;
            let tool = direction((90.0_f64 + off_deg).to_radians());
            let tip_end = add(rest.centre_mm, scaled(tool, end_mm));
            let travel_mm = travel(&setting, tip_end, high + self.range.clearance_mm)?;
            setting.tip_start_mm = add(tip_end, [0.0, travel_mm]);
            setting.revolutions = (travel_mm / feed).ceil();
            setting.feed_mm_per_rev = travel_mm / setting.revolutions;
            Some(setting)
        };
        let mut best: Option<SecondStage> = None;
        for feed in SECOND_FEEDS {
            let feed = feed.clamp(self.range.feed_min_mm_per_rev, self.range.feed_max_mm_per_rev);
            let (Some(straight), Some(off)) = (at(feed, 0.0), at(feed, OFF_DEG)) else { continue };
            if straight.revolutions > self.range.revolutions_max {
                continue;
            }
            let after = self.cut(&straight, radii)?;
            if best.as_ref().is_some_and(|best| best.after_um <= after.roundness_um) {
                continue;
            }
            let after_off = self.cut(&off, radii)?;
            best = Some(SecondStage {
                support_half_angle_deg: SECOND_HALF_ANGLE_DEG,
                tool_angle_deg: 90.0,
                support_distance_mm: 2.0 * half,
                feed_mm_per_rev: straight.feed_mm_per_rev,
                revolutions: straight.revolutions,
                before_um: first.roundness_um,
                after_um: after.roundness_um,
                after_off_um: after_off.roundness_um,
            });
        }
        Ok(best.filter(|stage| stage.after_um < WORTH * stage.before_um))
    }
}
