//! The analysis `speed_map`: which waves grow over the work speed, by the geometry and by the modes of the machine
//! (`ring/5.6`).

use rayon::prelude::*;

use crate::calculator::{Failure, Message, checkpoint};

use crate::ring_roundness::answer::output_settings::{SpeedCell, SpeedMapOutcome};
use crate::ring_roundness::job::input::{Dynamics, Job};
use crate::ring_roundness::model::linear::{grows, worst_of};
use crate::ring_roundness::model::lobing::{Lobing, Root, of_order};
use crate::ring_roundness::model::scene::Scene;
use crate::ring_roundness::model::simulate::Share;
use crate::ring_roundness::model::stance::{Copying, Stance};

/// Most rows of the map: more orders than that share them.
const MOST_ROWS: u32 = 120;
/// Highest order that is looked at.
pub(in crate::ring_roundness) const MOST_ORDER: u32 = 5000;
/// Lowest order of which the map is made where no mode asks for more.
const LEAST_ORDER: u32 = 20;
/// Below this a wave is no error of form but the eccentricity.
const FROM_LOBES: f64 = 1.5;
/// Speeds between two looks at the monitor.
const AT_ONCE: usize = 4;
/// A mode's give is worth a look while it is above this share of what makes a wave grow.
const BEYOND: f64 = 1.1;

/// Speeds of the map: first and last, rev/min.
pub(in crate::ring_roundness) fn speeds_rpm(job: &Job, dynamics: &Dynamics) -> (f64, f64) {
    let range = &job.speed_map;
    (range.from_rpm.unwrap_or(0.5 * dynamics.work_speed_rpm), range.to_rpm.unwrap_or(2.0 * dynamics.work_speed_rpm))
}

/// The highest order at which modes can make a wave grow: where a mode of the ratio K at rest, beyond its natural
/// frequency, has come down to |K(iω)| = 1/2, (ω/ν)² = 1 + 2 K.
fn chatter_to(dynamics: &Dynamics, speed_rpm: f64) -> u32 {
    let cut_n_per_mm = dynamics.cut_n_per_mm.unwrap_or(0.0);
    let softest: f64 = dynamics.modes.iter().map(|mode| cut_n_per_mm / mode.stiffness_n_per_mm).sum();
    let fastest_hz = dynamics.modes.iter().map(|mode| mode.frequency_hz).fold(0.0, f64::max);
    let lobes = BEYOND * fastest_hz * 60.0 / speed_rpm * (1.0 + 2.0 * softest).sqrt();
    whole(lobes.ceil() + 2.0).clamp(LEAST_ORDER, MOST_ORDER)
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count of lobes, at most 5000")]
fn whole(lobes: f64) -> u32 {
    lobes.clamp(0.0, f64::from(MOST_ORDER)) as u32
}

/// The highest order of the map.
pub(in crate::ring_roundness) fn highest_order(job: &Job, dynamics: &Dynamics) -> u32 {
    job.speed_map.highest_order.unwrap_or_else(|| chatter_to(dynamics, speeds_rpm(job, dynamics).0))
}

/// What it takes, ms: three starts per order, a dozen steps of 0.1 us and 0.04 us per mode.
pub(in crate::ring_roundness) fn work_ms(job: &Job) -> f64 {
    let Some(dynamics) = &job.dynamics else { return 0.0 };
    let step_ms = 1e-4 + 4e-5 * dynamics.modes.len() as f64;
    let orders = f64::from(highest_order(job, dynamics));
    // The certificate takes about as long again.
    2.0 * 12.0 * step_ms * 3.0 * orders * f64::from(job.speed_map.speeds)
}

/// The worst wave at the job's speed, where the machine swings.
pub(in crate::ring_roundness) fn here(job: &Job, scene: &Scene, end: &Stance) -> Option<SpeedCell> {
    let dynamics = job.dynamics.as_ref()?;
    let highest = chatter_to(dynamics, dynamics.work_speed_rpm).max(job.highest_order);
    Looker { scene, copying: end.copying(), highest }.worst_at(dynamics.work_speed_rpm)
}

struct Looker<'a> {
    scene: &'a Scene,
    copying: Copying,
    highest: u32,
}

impl Looker<'_> {
    fn lobing(&self, speed_rpm: f64) -> Lobing {
        self.scene.softness.lobing_at(self.copying, speed_rpm)
    }

    fn roots(&self, lobing: &Lobing) -> Vec<Root> {
        lobing.near_neutral_confirmed(FROM_LOBES, f64::from(self.highest) + 0.5)
    }

    fn worst_at(&self, speed_rpm: f64) -> Option<SpeedCell> {
        self.cell(speed_rpm, worst_of(&self.roots(&self.lobing(speed_rpm)))?)
    }

    #[allow(clippy::unnecessary_wraps, reason = "the end of a chain of options")]
    fn cell(&self, speed_rpm: f64, worst: Root) -> Option<SpeedCell> {
        let at_once = self.scene.softness.lobing_at_rest(self.copying);
        let beside = at_once.near_neutral((worst.lobes - 2.0).max(FROM_LOBES), worst.lobes + 2.0);
        let geometric = of_order(&beside, worst.lobes).is_some_and(|root| grows(&root));
        Some(SpeedCell {
            work_speed_rpm: speed_rpm,
            lobes: worst.lobes,
            frequency_hz: worst.lobes * speed_rpm / 60.0,
            factor_per_revolution: worst.factor_per_revolution(),
            is_chatter: grows(&worst) && !geometric,
        })
    }
}

/// The map over the work speed.
pub(in crate::ring_roundness) fn map(
    job: &Job,
    scene: &Scene,
    end: &Stance,
    share: Share<'_>,
) -> Result<SpeedMapOutcome, Failure> {
    let dynamics = job.dynamics.as_ref().ok_or_else(|| Failure::Internal("modes of a checked job".to_owned()))?;
    let (from, to) = speeds_rpm(job, dynamics);
    let count = job.speed_map.speeds;
    let speeds: Vec<f64> = (0..count).map(|i| from + (to - from) * f64::from(i) / f64::from(count - 1)).collect();
    let looker = Looker { scene, copying: end.copying(), highest: highest_order(job, dynamics) };
    let rows = rows(looker.highest);
    let mut columns: Vec<(Vec<Option<f64>>, Option<SpeedCell>)> = Vec::with_capacity(speeds.len());
    for (done, some) in speeds.chunks(AT_ONCE).enumerate() {
        checkpoint(share.monitor)?;
        let done = (done * AT_ONCE) as f64 / speeds.len() as f64;
        share.report(done, Message::new("stage_speed_map").with("percent", (100.0 * done).round()));
        let column = |speed: &f64| {
            let roots = looker.roots(&looker.lobing(*speed));
            let worst = worst_of(&roots).and_then(|root| looker.cell(*speed, root));
            (by_rows(&rows, &roots), worst)
        };
        columns.extend(some.par_iter().map(column).collect::<Vec<_>>());
    }
    let at_rest = looker.roots(&scene.softness.lobing_at_rest(looker.copying));
    let worst: Vec<Option<SpeedCell>> = columns.iter().map(|(_, worst)| *worst).collect();
    Ok(SpeedMapOutcome {
        factor_per_revolution: (0..rows.len()).flat_map(|row| columns.iter().map(move |(of, _)| of[row])).collect(),
        at_rest_factor_per_revolution: by_rows(&rows, &at_rest),
        lobes_from: rows.iter().map(|(from, _)| *from).collect(),
        lobes_to: rows.iter().map(|(_, to)| *to).collect(),
        best: worst
            .iter()
            .copied()
            .flatten()
            .min_by(|p, q| p.factor_per_revolution.total_cmp(&q.factor_per_revolution)),
        here: here(job, scene, end),
        worst,
        work_speed_rpm: speeds,
    })
}

/// Rows of the map: orders from 2, as many to a row as it takes.
fn rows(highest: u32) -> Vec<(u32, u32)> {
    let each = (highest - 1).div_ceil(MOST_ROWS);
    (2..=highest).step_by(each as usize).map(|from| (from, (from + each - 1).min(highest))).collect()
}

/// Factor of the worst root of each row.
fn by_rows(rows: &[(u32, u32)], roots: &[Root]) -> Vec<Option<f64>> {
    let of = |&(from, to): &(u32, u32)| {
        let inside = |root: &&Root| root.lobes > f64::from(from) - 0.5 && root.lobes <= f64::from(to) + 0.5;
        roots.iter().filter(inside).map(Root::factor_per_revolution).reduce(f64::max)
    };
    rows.iter().map(of).collect()
}
