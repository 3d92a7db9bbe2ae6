//! The analysis `settings_search`: fewest revolutions to a target, by simulation; where the tool opposite to a support does
//! not reach it, over everything that can be set ([`super::search_wide`]), in one stage or two.
//!
//! By the theory (`ring/5.4`) the tool stands opposite to a support and is fed straight down, starts clear of the largest
//! diameter and ends below the smallest; what is left then is the feed. The roundness does not fall steadily with the
//! revolutions, so they are scanned in steps of 5 %, and a setting is preferred whose neighbours pass, too.

use std::f64::consts::TAU;

use crate::calculator::{Failure, Finding, Message, checkpoint};

use super::input::{Job, LongWave, SearchRange};
use super::output::{SearchOutcome, SearchSetting, SearchStatus, SecondStage, TriedColumns};
use super::place::Angles;
use super::sampling::samples_of;
use super::scene::{Scene, mirrored_rad};
use super::search_wide::{self, Tried, Wide};
use super::simulate::Share;
use super::stance::{Stance, at_radius, through_tip};
use super::surface::{UM_PER_MM, odd_waves_mm, roundness_um, unevaluable};
use super::turning::plane::{Vec2, add, angle, norm, scaled, sub, unit};
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
        simulated: 0,
        tried: TriedColumns::default(),
        second_stage: None,
    };
    let Some(plan) = plan(range, scene, &blank) else { return Ok(outcome) };
    let finder = Finder { job, range, scene, plan, blank, share };
    let mut first = None;
    if odd_lobes_um > range.target_um {
        outcome.status = SearchStatus::OddLobes;
        if let Some(revolutions) = finder.nearest_allowed(finder.plan.natural) {
            let cut = finder.cut(&finder.setting(revolutions), &finder.blank)?;
            outcome.note(revolutions, &finder, cut.roundness_um);
            outcome.best = Some(finder.verified(&finder.setting(revolutions))?);
            first = Some(cut);
        }
    } else {
        finder.scan(&mut outcome)?;
    }
    if matches!(outcome.status, SearchStatus::Robust | SearchStatus::Fragile) {
        return Ok(outcome);
    }
    finder.everywhere(&mut outcome)?;
    if let (SearchStatus::BeyondLimits | SearchStatus::OddLobes, Some(first)) = (outcome.status, first) {
        outcome.second_stage = finder.second_stage(&first, &mut outcome.simulated)?;
    }
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
                let setting = self.verified(&self.setting(middle))?;
                if setting.margin_um >= 0.0 {
                    outcome.status = SearchStatus::Robust;
                    outcome.best = Some(setting);
                    break;
                }
            }
            n = (n * STEP).round().max(n + 1.0);
        }
        if let Some(fewest) = single {
            let setting = self.verified(&self.setting(fewest))?;
            outcome.fewest = (setting.margin_um >= 0.0).then_some(setting);
        }
        if outcome.best.is_none()
            && let Some((n, _)) = nearest
        {
            let setting = self.verified(&self.setting(n))?;
            outcome.status = if setting.margin_um >= 0.0 { SearchStatus::Fragile } else { SearchStatus::BeyondLimits };
            outcome.best = Some(setting);
        }
        Ok(())
    }

    /// The setting with the job's own nodes, and with half of them for the error.
    fn verified(&self, setting: &Setting) -> Result<SearchSetting, Failure> {
        let n = samples_of(self.job).max(super::input::DEFAULT_SAMPLES);
        let blank = |n: u32| self.scene.blank_mm(self.job, n as usize).map_err(unevaluable);
        let full = self.cut(setting, &blank(n)?)?;
        let half = self.cut(setting, &blank(n / 2)?)?;
        let error = (full.roundness_um - half.roundness_um).abs();
        let coarse = blank(search_wide::nodes(self.job))?;
        let end = through_tip(setting, setting.tip_end_mm())
            .ok_or_else(|| Failure::OutOfModel(Finding::new("no_end_position", "/tool")))?;
        let angles = Angles { half_angle_rad: end.half_angle_rad, tool_rad: end.tool_rad() };
        let placed = self.as_placed(setting);
        Ok(SearchSetting {
            tool_x_mm: placed.x_mm,
            tool_y_mm: placed.y_mm,
            feed_direction_deg: placed.feed_direction_deg,
            support_distance_mm: placed.distance_mm,
            support_depth_mm: placed.depth_mm,
            support_half_angle_deg: end.half_angle_rad.to_degrees(),
            tool_angle_deg: mirrored_rad(end.tool_rad(), self.scene.mirrored).to_degrees(),
            compliance_ratio: setting.compliance_ratio,
            robust_share: self.wide(&coarse).robust_share(angles, setting)?,
            feed_mm_per_rev: setting.feed_mm_per_rev,
            revolutions: setting.revolutions,
            spark_out_revolutions: setting.spark_out_revolutions,
            roundness_um: full.roundness_um,
            roundness_error_um: error,
            margin_um: self.range.target_um - full.roundness_um - error,
            mean_radius_mm: full.mean_radius_mm,
        })
    }

    fn wide<'b>(&'b self, blank: &'b [f64]) -> Wide<'b> {
        Wide {
            job: self.job,
            range: self.range,
            base: &self.plan.setting,
            mirrored: self.scene.mirrored,
            blank,
            share: self.share,
        }
    }

    /// The search over all angles; what it finds is taken where it is better.
    fn everywhere(&self, outcome: &mut SearchOutcome) -> Result<(), Failure> {
        let nodes = search_wide::nodes(self.job) as usize;
        let blank = self.scene.blank_mm(self.job, nodes).map_err(unevaluable)?;
        let Some(found) = self.wide(&blank).search()? else { return Ok(()) };
        outcome.simulated += found.simulated;
        let setting = self.verified(&found.best.setting)?;
        if setting.margin_um >= 0.0 {
            let robust = setting.robust_share >= search_wide::ROBUST;
            outcome.status = if robust { SearchStatus::Robust } else { SearchStatus::Fragile };
        }
        if outcome.best.is_none_or(|best| setting.roundness_um < best.roundness_um) {
            outcome.best = Some(setting);
        }
        Ok(())
    }

    /// Where tool and supports stand, as the job has it.
    fn as_placed(&self, setting: &Setting) -> Placing {
        let [x, y] = setting.tip_start_mm;
        let direction_rad = angle(setting.feed_direction);
        let mirrored = self.scene.mirrored;
        Placing {
            x_mm: if mirrored { -x } else { x },
            y_mm: y,
            feed_direction_deg: mirrored_rad(direction_rad, mirrored).rem_euclid(TAU).to_degrees(),
            distance_mm: norm(sub(setting.support_b_mm, setting.support_a_mm)),
            depth_mm: -setting.support_a_mm[1],
        }
    }

    /// A second stage that begins with what the first leaves: the waves that the first does not see decay at other angles
    /// (`ring/5.5`). Given only where the simulation of both shows a gain.
    fn second_stage(&self, first: &Cut, simulated: &mut usize) -> Result<Option<SecondStage>, Failure> {
        let wide = self.wide(&first.radii_mm);
        let Some(found) = wide.search()? else { return Ok(None) };
        *simulated += found.simulated;
        let Tried { setting, angles, roundness_um, .. } = found.best;
        let placed = self.as_placed(&setting);
        let stage = SecondStage {
            tool_x_mm: placed.x_mm,
            tool_y_mm: placed.y_mm,
            feed_direction_deg: placed.feed_direction_deg,
            support_depth_mm: placed.depth_mm,
            support_half_angle_deg: angles.half_angle_rad.to_degrees(),
            tool_angle_deg: mirrored_rad(angles.tool_rad, self.scene.mirrored).to_degrees(),
            support_distance_mm: placed.distance_mm,
            feed_mm_per_rev: setting.feed_mm_per_rev,
            revolutions: setting.revolutions,
            before_um: first.roundness_um,
            after_um: roundness_um,
            robust_share: found.robust_share,
        };
        let alone = self.range.target_um.max(WORTH * first.roundness_um);
        Ok(Some(stage).filter(|stage| stage.after_um < alone))
    }
}

/// Where tool and supports stand, in the machine of the job.
struct Placing {
    x_mm: f64,
    y_mm: f64,
    feed_direction_deg: f64,
    distance_mm: f64,
    depth_mm: f64,
}
