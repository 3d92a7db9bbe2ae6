//! The search over everything that can be set: angles of tool and supports, feed, revolutions, compliance ratio.
//!
//! The linear theory ranks the cells of a grid of angles by what it leaves of the blank's waves; the best of them are
//! simulated with several feeds, the best of these again beside themselves, and the one that is given with angles, blank
//! and phase off by what a machine is off: how often the target is met then is its robustness (`ring/7.2`).

use rayon::prelude::*;

use crate::calculator::{Failure, Message, checkpoint};
use crate::num::roundness::Grid;

use crate::ring_roundness::job::input::Job;
use crate::ring_roundness::job::input_ranges::SearchRange;
use crate::ring_roundness::model::lobing::of_order;
use crate::ring_roundness::model::place::{Angles, Placed, touched_mm};
use crate::ring_roundness::model::simulate::{Share, or_none, side_by_side};
use crate::ring_roundness::model::softness::Softness;
use crate::ring_roundness::model::stance::TOOL_CLEARANCE_RAD;
use crate::ring_roundness::model::surface::{UM_PER_MM, roundness_um, unevaluable};
use crate::ring_roundness::model::turning::{Oscillation, Setting, turn};

/// Step of the grid of angles, deg.
const TOOL_STEP_DEG: f64 = 2.0;
const SUPPORT_STEP_DEG: f64 = 1.0;
/// Cells that are simulated.
const SIMULATED: usize = 64;
/// Highest order that the ranking looks at.
const HIGHEST: u32 = 24;
/// What a wave that the blank does not have begins with, um: teeth of the feed.
const SEED_UM: f64 = 0.02;
/// Revolutions over which the ranking looks.
const RANKED_REVOLUTIONS: f64 = 60.0;
/// Feeds tried, as shares of the range between the machine's least and largest, on a logarithmic scale.
const FEEDS: [f64; 4] = [0.15, 0.35, 0.5, 0.65];
/// Best cells that are looked at again beside themselves, and by how much, deg.
const REFINED: usize = 4;
const BESIDE_DEG: [f64; 3] = [-0.5, 0.0, 0.5];
/// Runs between two looks at the monitor.
const AT_ONCE: usize = 16;
/// Cells ranked in full between two looks.
const RANKED_AT_ONCE: usize = 256;
/// A setting of few revolutions is worth a trial where it leaves less than this share of the target.
const SURELY: f64 = 0.95;
/// Revolutions of spark-out that are tried beside those stated, in the second look.
const MORE_SPARK_OUT: f64 = 3.0;
/// Trials of the robustness.
const TRIALS: u32 = 24;
/// Share of trials from which on a setting counts as robust.
pub(in crate::ring_roundness) const ROBUST: f64 = 0.9;

/// What the search goes by.
pub(in crate::ring_roundness) struct Wide<'a> {
    pub job: &'a Job,
    pub range: &'a SearchRange,
    /// The job's setting in the kernel's frame; its angles and feed are replaced.
    pub base: &'a Setting,
    pub softness: &'a Softness,
    pub mirrored: bool,
    pub blank: &'a [f64],
    pub share: Share<'a>,
}

/// A setting that was simulated.
#[derive(Debug, Clone)]
pub(in crate::ring_roundness) struct Tried {
    pub angles: Angles,
    pub compliance_ratio: f64,
    pub setting: Setting,
    pub roundness_um: f64,
}

/// What came of it.
pub(in crate::ring_roundness) struct Found {
    /// The best first: those that meet the target most often when everything is a little off.
    pub best: Vec<Tried>,
    /// Settings simulated.
    pub simulated: usize,
}

impl Wide<'_> {
    /// The best setting; `None` where no cell holds the ring.
    pub(in crate::ring_roundness) fn search(&self) -> Result<Option<Found>, Failure> {
        let cells = self.ranked()?;
        let dwell = self.range.spark_out_revolutions;
        let mut tried = self.simulate(&cells, &[dwell], 0.0, 0.6)?;
        let mut simulated = tried.len();
        tried.sort_by(|p, q| p.roundness_um.total_cmp(&q.roundness_um));
        let mut beside: Vec<(Angles, f64)> = Vec::new();
        for best in tried.iter().take(REFINED) {
            for tool in BESIDE_DEG {
                for support in BESIDE_DEG {
                    let angles = Angles {
                        tool_rad: best.angles.tool_rad + tool.to_radians(),
                        half_angle_rad: best.angles.half_angle_rad + support.to_radians(),
                    };
                    // As much softer than by itself as the best cell is.
                    let by_itself = |angles: Angles| self.softness.ratio(&angles.copying());
                    let k = best.compliance_ratio - by_itself(best.angles) + by_itself(angles);
                    if !beside.contains(&(angles, k)) {
                        beside.push((angles, k));
                    }
                }
            }
        }
        let more = self.simulate(&beside, &[dwell, dwell + MORE_SPARK_OUT], 0.6, 0.9)?;
        simulated += more.len();
        tried.extend(more);
        tried.sort_by(|p, q| p.roundness_um.total_cmp(&q.roundness_um));
        tried.dedup_by(|p, q| {
            let runs =
                |tried: &Tried| [tried.setting.revolutions, tried.setting.spark_out_revolutions].map(f64::to_bits);
            p.angles == q.angles && runs(p) == runs(q)
        });
        // The roundest, and those that meet the target in the fewest revolutions, which a larger range of feeds must not hide.
        let mut quick = tried.split_off(REFINED.min(tried.len()));
        quick.retain(|tried| tried.roundness_um <= SURELY * self.range.target_um);
        quick.sort_by(|p, q| p.setting.revolutions.total_cmp(&q.setting.revolutions));
        quick.truncate(REFINED);
        tried.extend(quick);
        let mut best = Vec::with_capacity(tried.len());
        for candidate in tried {
            checkpoint(self.share.monitor)?;
            let robust = self.robust_share(candidate.angles, &candidate.setting)?;
            simulated += TRIALS as usize;
            best.push((robust, candidate));
        }
        best.sort_by(|p, q| q.0.total_cmp(&p.0));
        let best: Vec<Tried> = best.into_iter().map(|(_, best)| best).collect();
        Ok((!best.is_empty()).then_some(Found { best, simulated }))
    }

    /// The cells of which the theory leaves least, none beside a better one. An error of the angles only makes it worse, so
    /// what is left without one says which cells need no closer look.
    fn ranked(&self) -> Result<Vec<(Angles, f64)>, Failure> {
        let waves = self.waves_um()?;
        let mut cells = Vec::new();
        for some in self.cells().chunks(RANKED_AT_ONCE) {
            cells.extend(self.left_of(some, &waves, 0.0)?);
        }
        cells.sort_by(|p, q| p.0.total_cmp(&q.0));
        let error = self.range.angle_error_deg.to_radians();
        let mut ranked = Vec::new();
        for (done, some) in cells.chunks(RANKED_AT_ONCE).enumerate() {
            let some: Vec<(Angles, f64)> = some.iter().map(|&(_, angles, k)| (angles, k)).collect();
            ranked.extend(self.left_of(&some, &waves, error)?);
            ranked.sort_by(|p, q| p.0.total_cmp(&q.0));
            let kept = apart(&ranked);
            let others = cells.get((done + 1) * RANKED_AT_ONCE).map_or(f64::INFINITY, |(at_least, ..)| *at_least);
            if kept.len() == SIMULATED && kept.last().is_some_and(|(left, ..)| *left <= others) {
                break;
            }
        }
        Ok(apart(&ranked).into_iter().map(|(_, angles, k)| (angles, k)).collect())
    }

    /// What the theory leaves of some cells, um, with the angles off by up to `error`, rad; those where the tool has room.
    fn left_of(
        &self,
        cells: &[(Angles, f64)],
        waves: &[(u32, f64)],
        error: f64,
    ) -> Result<Vec<(f64, Angles, f64)>, Failure> {
        checkpoint(self.share.monitor)?;
        let left = |&(angles, k): &(Angles, f64)| Some((self.left_um(angles, k, waves, error)?, angles, k));
        Ok(cells.par_iter().filter_map(left).collect())
    }

    /// Peak to valley of the blank's waves by order, from 2.
    fn waves_um(&self) -> Result<Vec<(u32, f64)>, Failure> {
        let grid = Grid::new(self.blank.len()).map_err(unevaluable)?;
        let spectrum = grid.spectrum(self.blank, HIGHEST as usize).map_err(unevaluable)?;
        Ok((2..=HIGHEST)
            .filter_map(|order| {
                spectrum.iter().find(|h| h.order == order as usize).map(|h| (order, 2.0 * h.amplitude_mm * UM_PER_MM))
            })
            .collect())
    }

    fn cells(&self) -> Vec<(Angles, f64)> {
        let range = self.range;
        let steps = |from: f64, to: f64, step: f64| {
            let mut at = from;
            std::iter::from_fn(move || {
                let here = at;
                at += step;
                (here <= to + 1e-9).then_some(here)
            })
        };
        let ratios = |angles: Angles| {
            let given = self.softness.ratio(&angles.copying());
            let most = range.compliance_ratio_max.filter(|most| *most > given);
            [Some(given), most.map(|most| f64::midpoint(given, most)), most].into_iter().flatten()
        };
        let mut cells = Vec::new();
        for support in steps(range.support_angle_from_deg, range.support_angle_to_deg, SUPPORT_STEP_DEG) {
            for tool in steps(range.tool_angle_from_deg, range.tool_angle_to_deg, TOOL_STEP_DEG) {
                let tool_rad = crate::ring_roundness::model::scene::mirrored_rad(tool.to_radians(), self.mirrored);
                let angles = Angles { half_angle_rad: support.to_radians(), tool_rad };
                cells.extend(ratios(angles).map(|k| (angles, k)));
            }
        }
        cells
    }

    /// What the theory leaves, um: the worst that an error of the angles makes of it. `None` where the tool has no room.
    fn left_um(&self, angles: Angles, compliance_ratio: f64, waves: &[(u32, f64)], error: f64) -> Option<f64> {
        let corners = [(0.0, 0.0), (error, error), (-error, error), (error, -error), (-error, -error)];
        let corners = if error > 0.0 { &corners[..] } else { &corners[..1] };
        let mut worst = 0.0_f64;
        for (tool, support) in corners {
            let off = Angles { half_angle_rad: angles.half_angle_rad + support, tool_rad: angles.tool_rad + tool };
            let copying = off.copying();
            let turn = std::f64::consts::TAU;
            let near = |delay: f64| delay.min(turn - delay);
            if near(copying.delay_a_rad).min(near(copying.delay_b_rad)) < TOOL_CLEARANCE_RAD {
                return None;
            }
            let mut lobing = self.softness.lobing(copying);
            lobing.compliance_ratio = compliance_ratio.max(lobing.compliance_ratio);
            let roots = lobing.near_neutral(1.5, f64::from(HIGHEST) + 0.5);
            let after = |factor: f64| factor.powf(RANKED_REVOLUTIONS).min(1e6);
            let of_blank: f64 = waves
                .iter()
                .map(|(order, um)| {
                    um * of_order(&roots, f64::from(*order)).map_or(0.0, |r| after(r.factor_per_revolution()))
                })
                .sum();
            let of_feed: f64 = roots.iter().map(|root| SEED_UM * after(root.factor_per_revolution())).sum();
            worst = worst.max(of_blank + of_feed);
        }
        Some(worst)
    }

    /// Radii at which the tool starts and ends, mm.
    fn ends_mm(&self, angles: Angles) -> (f64, f64) {
        let (last_mm, first_mm) = touched_mm(self.blank, &angles.copying());
        let lowest = self.blank.iter().copied().fold(f64::INFINITY, f64::min);
        (first_mm + self.range.clearance_mm, last_mm.min(lowest) - self.range.allowance_mm)
    }

    fn placed(&self, angles: Angles, compliance_ratio: f64, (from_mm, to_mm): (f64, f64)) -> Option<Placed> {
        Placed::new(&Setting { compliance_ratio, ..self.base.clone() }, angles, from_mm, to_mm)
    }

    /// Every cell with every feed that the machine has.
    fn simulate(&self, cells: &[(Angles, f64)], dwells: &[f64], from: f64, to: f64) -> Result<Vec<Tried>, Failure> {
        let range = self.range;
        let mut runs: Vec<(Angles, f64, Setting)> = Vec::new();
        for &(angles, k) in cells {
            let Some(placed) = self.placed(angles, k, self.ends_mm(angles)) else { continue };
            let mut before = f64::INFINITY;
            for share in FEEDS {
                let feed = range.feed_min_mm_per_rev.powf(1.0 - share) * range.feed_max_mm_per_rev.powf(share);
                let revolutions = (placed.travel_mm / feed).ceil().clamp(1.0, range.revolutions_max);
                let feed = placed.travel_mm / revolutions;
                let can = feed >= range.feed_min_mm_per_rev && feed <= range.feed_max_mm_per_rev;
                if can && before - revolutions > 0.5 {
                    for dwell in dwells {
                        let setting = placed.in_revolutions(revolutions);
                        runs.push((angles, k, Setting { spark_out_revolutions: *dwell, ..setting }));
                    }
                    before = revolutions;
                }
            }
        }
        let mut tried = Vec::with_capacity(runs.len());
        for (done, some) in runs.chunks(AT_ONCE).enumerate() {
            checkpoint(self.share.monitor)?;
            let share = from + (to - from) * (done * AT_ONCE) as f64 / runs.len() as f64;
            self.share
                .report(share, Message::new("stage_search_wide").with("of", runs.len()).with("done", done * AT_ONCE));
            let of = |(angles, k, setting): &(Angles, f64, Setting)| {
                let found = self.run(setting, self.blank)?;
                let of = |roundness_um| Tried {
                    angles: *angles,
                    compliance_ratio: *k,
                    setting: setting.clone(),
                    roundness_um,
                };
                Ok(found.map(of))
            };
            tried.extend(side_by_side(some, of)?.into_iter().flatten());
        }
        Ok(tried)
    }

    /// `None` where the ring falls through or its profile has no circles.
    fn run(&self, setting: &Setting, blank: &[f64]) -> Result<Option<f64>, Failure> {
        let turned = or_none(turn::<Failure>(blank, setting, &mut |_, _| checkpoint(self.share.monitor)))?;
        let Some(turned) = turned.filter(|turned| turned.first_contact_rev.is_some()) else { return Ok(None) };
        Ok(or_none(roundness_um(&turned.radii_mm, self.job.filter, self.share.monitor))?.map(|found| found.0))
    }

    /// How often the target is met with the angles off by up to the stated error, the rollers running out, the blank's
    /// waves larger or smaller, and the blank put in turned: an even sequence of trials, always the same.
    pub(in crate::ring_roundness) fn robust_share(&self, angles: Angles, setting: &Setting) -> Result<f64, Failure> {
        let error = self.range.angle_error_deg.to_radians();
        let mean = self.blank.iter().sum::<f64>() / self.blank.len() as f64;
        // Set up for the blank as it is stated.
        let ends_mm = self.ends_mm(angles);
        let trials: Vec<_> = (1..=TRIALS).collect();
        let met = side_by_side(&trials, |&i| {
            // Additive recurrence with powers of the inverse of the root of x⁷ = x + 1: even in six dimensions.
            let at = |power: i32| (0.5 + f64::from(i) * 0.898_653_712_628_699_3_f64.powi(power)).fract();
            let off = Angles {
                tool_rad: angles.tool_rad + error * (2.0 * at(1) - 1.0),
                half_angle_rad: angles.half_angle_rad + error * (2.0 * at(2) - 1.0),
            };
            let by = 1.0 + 0.01 * self.range.blank_waves_error_percent * (2.0 * at(3) - 1.0);
            let mut blank: Vec<f64> = self.blank.iter().map(|radius| mean + by * (radius - mean)).collect();
            let n = blank.len();
            blank.rotate_left(turned_nodes(at(4), n));
            let Some(placed) = self.placed(off, setting.compliance_ratio, ends_mm) else { return Ok(false) };
            let dwell = setting.spark_out_revolutions;
            let mut off = Setting { spark_out_revolutions: dwell, ..placed.in_revolutions(setting.revolutions) };
            self.run_out(&mut off, mean, [at(5), at(6)]);
            Ok(self.run(&off, &blank)?.is_some_and(|um| um <= self.range.target_um))
        })?;
        Ok(met.iter().filter(|met| **met).count() as f64 / f64::from(TRIALS))
    }
}

impl Wide<'_> {
    /// Both rollers off their axes by half of the stated run-out, at phases that are shares of a turn.
    fn run_out(&self, setting: &mut Setting, ring_mm: f64, phases: [f64; 2]) {
        let amplitude_mm = 0.5 * self.range.roller_runout_um / UM_PER_MM;
        if setting.roller_radius_mm <= 0.0 || amplitude_mm <= 0.0 {
            return;
        }
        let [a, b] = phases.map(|share| Oscillation {
            amplitude_mm,
            ratio: ring_mm / setting.roller_radius_mm,
            phase_rad: std::f64::consts::TAU * share,
        });
        setting.motion.runout_a.push(a);
        setting.motion.runout_b.push(b);
    }
}

/// By how many of n nodes a ring is turned that is turned by a share of a turn.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of n")]
pub(in crate::ring_roundness) fn turned_nodes(share: f64, n: usize) -> usize {
    ((share * n as f64) as usize).min(n - 1)
}

/// The best cells, none of them the neighbour of a better one.
fn apart(cells: &[(f64, Angles, f64)]) -> Vec<(f64, Angles, f64)> {
    let mut kept: Vec<(f64, Angles, f64)> = Vec::new();
    for &cell in cells {
        let near = |other: &(f64, Angles, f64)| {
            (other.1.tool_rad - cell.1.tool_rad).abs() < 1.1 * TOOL_STEP_DEG.to_radians()
                && (other.1.half_angle_rad - cell.1.half_angle_rad).abs() < 1.1 * SUPPORT_STEP_DEG.to_radians()
                && other.2.to_bits() == cell.2.to_bits()
        };
        if !kept.iter().any(near) {
            kept.push(cell);
            if kept.len() == SIMULATED {
                break;
            }
        }
    }
    kept
}

/// What it takes, ms: two stages as often as one, each of some hundred runs of the revolutions that its feeds give.
pub(in crate::ring_roundness) fn work_ms(job: &Job, range: &SearchRange, step_ns: f64) -> f64 {
    const RUNS: f64 = 1.5 * (4.0 * SIMULATED as f64 + 8.0 * 9.0 * REFINED as f64 + REFINED as f64 * TRIALS as f64);
    let cells = (range.tool_angle_to_deg - range.tool_angle_from_deg) / TOOL_STEP_DEG
        * (range.support_angle_to_deg - range.support_angle_from_deg)
        / SUPPORT_STEP_DEG;
    let ratios = if range.compliance_ratio_max.is_some() { 3.0 } else { 1.0 };
    // Five sets of roots per cell, 30 us each.
    1.5 * cells * ratios * 0.15 + RUNS * 1e-6 * step_ns * f64::from(nodes(job)) * 50.0_f64.min(range.revolutions_max)
}

/// Nodes of the simulations of the search.
pub(in crate::ring_roundness) fn nodes(job: &Job) -> u32 {
    crate::ring_roundness::model::causes::nodes(job)
}
