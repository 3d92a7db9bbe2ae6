//! What a parameter set predicts for the rows of a table, and how far that is off.
//!
//! A row below the limit of chatter is the exact forced motion, a row above it a run in time with bonded joints
//! (`fixture/6.1`). The rows of one cutter, speed and feed share the integrals of the multiplier and, since the forced
//! motion goes with H^(1-mu), one forced motion.

use rayon::prelude::*;

use crate::calculator::{Failure, Monitor};

use super::input::{AmplitudeMeaning, IdentificationJob};
use super::unknowns::{Unknown, Values};
use crate::fixture_stability::job::input::Regeneration;
use crate::fixture_stability::model::cutting::Cutting;
use crate::fixture_stability::model::floquet::Working;
use crate::fixture_stability::model::holding::Holding;
use crate::fixture_stability::model::lobes::{Rules, by_states, moduli};
use crate::fixture_stability::model::march::{Plan, Surface, march};
use crate::fixture_stability::model::response::{Range, Response, response};
use crate::fixture_stability::model::simulate::count;

/// Residual up to which it counts by its square, beyond by its size (Huber).
pub(super) const HUBER: f64 = 3.0;
/// Steps per tooth pitch, least and most.
const STEPS: (f64, f64) = (200.0, 20_000.0);
/// A run is at least so many times as long as a disturbance takes to grow e-fold, up to so many tooth periods.
const GROWTHS: f64 = 12.0;
const MOST_PERIODS: f64 = 640.0;
/// An amplitude over depth that rises by this factor over that of shallower rows has jumped.
const JUMP: f64 = 2.0;
/// Residual of a row on the wrong side of the limit, and what a unit of ln |mu| adds to it.
const WRONG_SIDE: (f64, f64) = (3.0, 40.0);

/// How the amplitude of a row is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Law {
    pub regeneration: Regeneration,
    pub amplitude: AmplitudeMeaning,
}

/// Rows of one cutter, speed and feed.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Group {
    pub teeth: u32,
    /// Where the rows state one.
    pub spindle_rpm: Option<f64>,
    /// Where the rows or the job state it per tooth.
    feed_mm: Option<f64>,
    /// Rows of the table.
    pub rows: Vec<usize>,
}

/// What is predicted of a row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Predicted {
    pub modulus: f64,
    pub amplitude_mm: f64,
    /// Elastic force that the joints ask of the clamp.
    pub movable_n: f64,
    pub fixed_n: f64,
}

/// The table and everything that parameter sets share.
pub(super) struct Problem<'a> {
    pub job: &'a IdentificationJob,
    pub unknowns: Vec<Unknown>,
    pub groups: Vec<Group>,
    /// Per row: whether the table shows that it chatters.
    pub jumped: Vec<bool>,
    /// Per row: standard deviation of the logarithm of its amplitude; none where it does not take part.
    sigma: Vec<Option<f64>>,
    pub rules: Rules,
    pub monitor: &'a dyn Monitor,
}

/// The cut of a group under a parameter set.
pub(super) struct Cut {
    pub holding: Holding,
    pub cutting: Cutting,
    /// At 1 mm of depth.
    pub working: Working,
}

fn beyond_check() -> Failure {
    Failure::Internal("a job that the check refuses".to_owned())
}

impl<'a> Problem<'a> {
    pub(super) fn new(job: &'a IdentificationJob, monitor: &'a dyn Monitor) -> Self {
        let groups = groups(job);
        let mut jumped = vec![false; job.measurements.rows().len()];
        for group in &groups {
            mark_jumps(job, group, &mut jumped);
        }
        let sigma = job
            .measurements
            .rows()
            .iter()
            .map(|row| row.amplitude_um.filter(|_| !row.excluded).map(|amplitude| sigma(job, amplitude)))
            .collect();
        Self { job, unknowns: Unknown::all(job), groups, jumped, sigma, rules: Rules::new(), monitor }
    }

    pub(super) fn values(&self, at: &[f64]) -> Values {
        Values::at(self.job, &self.unknowns, at)
    }

    /// The cut of a group; `None` only for jobs that the check refuses.
    pub(super) fn cut(&self, values: &Values, group: &Group) -> Option<Cut> {
        let cutting = values.cutting(self.job, group.teeth)?;
        let spindle_rpm = group.spindle_rpm.or(values.spindle_rpm)?;
        let of_table = || Some(self.job.cut.feed_mm_per_min? / (spindle_rpm * f64::from(group.teeth)));
        let feed_mm = group.feed_mm.or_else(of_table)?;
        Some(Cut { holding: values.holding(), cutting, working: Working { spindle_rpm, feed_mm, depth_mm: 1.0 } })
    }

    fn depths(&self, group: &Group) -> Vec<f64> {
        group.rows.iter().map(|&row| self.job.measurements.rows()[row].depth_mm).collect()
    }

    /// Multipliers of the rows of a group and its forced motion at 1 mm.
    fn linear(&self, cut: &Cut, group: &Group) -> Result<(Vec<f64>, Response), Failure> {
        let moduli = moduli(&self.rules, &cut.holding, &cut.cutting, cut.working, &self.depths(group), self.monitor)?;
        let forced = by_states!(cut.holding, response(&cut.holding, &cut.cutting, cut.working, self.monitor))?;
        Ok((moduli, forced))
    }

    /// Residual of a row, 0 where it takes no part.
    pub(super) fn residual(&self, row: usize, amplitude_mm: f64) -> f64 {
        let measured = self.job.measurements.rows()[row].amplitude_um;
        match (self.sigma[row], measured) {
            (Some(sigma), Some(measured)) => (1e3 * amplitude_mm / measured).ln() / sigma,
            _ => 0.0,
        }
    }

    pub(super) fn sigma(&self, row: usize) -> Option<f64> {
        self.sigma[row]
    }

    /// The objective without any run in time (`fixture/6.2`): stable rows by their amplitude, the others by the side of
    /// the limit on which they lie.
    pub(super) fn quick(&self, at: &[f64], amplitude: AmplitudeMeaning) -> Result<f64, Failure> {
        let values = self.values(at);
        let mut sum = 0.0;
        for group in &self.groups {
            let cut = self.cut(&values, group).ok_or_else(beyond_check)?;
            let (moduli, forced) = self.linear(&cut, group)?;
            for (&row, modulus) in group.rows.iter().zip(moduli) {
                if self.job.measurements.rows()[row].excluded {
                    continue;
                }
                let growth = modulus.max(1e-300).ln();
                let wrong = || huber(WRONG_SIDE.0 + WRONG_SIDE.1 * growth.abs().min(10.0));
                sum += match (growth > 0.0, self.jumped[row]) {
                    (false, true) | (true, false) => wrong(),
                    (true, true) => 0.0,
                    (false, false) => {
                        let scale = cut.cutting.depth_power(self.job.measurements.rows()[row].depth_mm);
                        huber(self.residual(row, scale * amplitude_mm(forced.x_mm, amplitude)))
                    }
                };
            }
        }
        Ok(sum)
    }

    /// The objective: the sum of the rows' residuals by Huber's loss (`fixture/6.1`). Beyond `bound` it is cut short.
    pub(super) fn objective(&self, at: &[f64], law: Law, bound: f64) -> Result<f64, Failure> {
        let values = self.values(at);
        let mut sum = 0.0;
        let mut runs: Vec<(f64, usize, Cut, f64)> = Vec::new();
        for group in &self.groups {
            let cut = self.cut(&values, group).ok_or_else(beyond_check)?;
            let (moduli, forced) = self.linear(&cut, group)?;
            for (&row, modulus) in group.rows.iter().zip(moduli) {
                if self.sigma[row].is_none() {
                    continue;
                }
                let depth_mm = self.job.measurements.rows()[row].depth_mm;
                if modulus < 1.0 {
                    let scale = cut.cutting.depth_power(depth_mm);
                    sum += huber(self.residual(row, scale * amplitude_mm(forced.x_mm, law.amplitude)));
                } else {
                    let own = Cut {
                        holding: cut.holding.clone(),
                        cutting: cut.cutting.clone(),
                        working: Working { depth_mm, ..cut.working },
                    };
                    // Short runs first: they may be enough to give this set up.
                    runs.push((1.0 / modulus.ln(), row, own, modulus));
                }
            }
        }
        runs.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (_, row, cut, modulus) in runs {
            if sum > bound {
                break;
            }
            let run = self.run(&cut, modulus, law, 1)?;
            sum += huber(self.residual(row, run.amplitude_mm));
        }
        Ok(sum)
    }

    /// What every row does, the step divided by `fineness`.
    pub(super) fn predict(&self, values: &Values, law: Law, fineness: u32) -> Result<Vec<Predicted>, Failure> {
        let mut found: Vec<Option<Predicted>> = vec![None; self.job.measurements.rows().len()];
        let mut runs: Vec<(usize, Cut, f64)> = Vec::new();
        for group in &self.groups {
            let cut = self.cut(values, group).ok_or_else(beyond_check)?;
            let (moduli, forced) = self.linear(&cut, group)?;
            for (&row, modulus) in group.rows.iter().zip(moduli) {
                let depth_mm = self.job.measurements.rows()[row].depth_mm;
                if modulus < 1.0 {
                    let scale = cut.cutting.depth_power(depth_mm);
                    found[row] = Some(Predicted {
                        modulus,
                        amplitude_mm: scale * amplitude_mm(forced.x_mm, law.amplitude),
                        movable_n: scale * forced.left_elastic_n.high.max(0.0),
                        fixed_n: scale * forced.right_elastic_n.high.max(0.0),
                    });
                } else {
                    let working = Working { depth_mm, ..cut.working };
                    let own = Cut { holding: cut.holding.clone(), cutting: cut.cutting.clone(), working };
                    runs.push((row, own, modulus));
                }
            }
        }
        let run: Result<Vec<Predicted>, Failure> =
            runs.par_iter().map(|(_, cut, modulus)| self.run(cut, *modulus, law, fineness)).collect();
        for ((row, ..), predicted) in runs.iter().zip(run?) {
            found[*row] = Some(predicted);
        }
        found.into_iter().map(|row| row.ok_or_else(beyond_check)).collect()
    }

    /// A row in time, joints bonded.
    fn run(&self, cut: &Cut, modulus: f64, law: Law, fineness: u32) -> Result<Predicted, Failure> {
        let settings = &self.job.simulation;
        let highest = cut.holding.modes().last().map_or(0.0, |mode| mode.natural_hz);
        let oscillations = highest * cut.cutting.tooth_period_s(cut.working.spindle_rpm);
        let per_oscillation = f64::from(settings.steps_per_oscillation);
        let steps = (per_oscillation * oscillations).clamp(STEPS.0, STEPS.1).ceil() * f64::from(fineness);
        let asked = f64::from(settings.tooth_periods);
        let periods = (GROWTHS / modulus.ln().max(1e-3)).clamp(asked, MOST_PERIODS.max(asked));
        let plan = Plan {
            working: cut.working,
            steps_per_tooth: count(steps),
            tooth_periods: count(periods),
            steady_periods: settings.steady_tooth_periods as usize,
            surface: match law.regeneration {
                Regeneration::Multiple => Surface::Multiple,
                Regeneration::Single => Surface::Single,
            },
            gradual: false,
            unilateral: false,
            keep_first: 0,
            keep_last: 0,
        };
        let run = by_states!(cut.holding, march(&cut.holding, &cut.cutting, &plan, self.monitor))?;
        Ok(Predicted {
            modulus,
            amplitude_mm: amplitude_mm(run.x_mm, law.amplitude),
            movable_n: run.left_elastic_n.high.max(0.0),
            fixed_n: run.right_elastic_n.high.max(0.0),
        })
    }
}

/// The amplitude that a range of displacements is.
fn amplitude_mm(x_mm: Range, meaning: AmplitudeMeaning) -> f64 {
    match meaning {
        AmplitudeMeaning::PeakToPeak => x_mm.span(),
        AmplitudeMeaning::HalfPeakToPeak => 0.5 * x_mm.span(),
        AmplitudeMeaning::LargestDisplacement => x_mm.high.abs().max(x_mm.low.abs()),
    }
}

/// Square near 0, straight beyond [`HUBER`].
pub(super) fn huber(residual: f64) -> f64 {
    let size = residual.abs();
    if size <= HUBER { size * size } else { HUBER * (2.0 * size - HUBER) }
}

/// Scatter of the logarithm of an amplitude: of the process, and of a reading to the resolution (0.6 of a step: a little
/// more than the rounding's 0.29, since readings off a trace are not rounded fairly).
fn sigma(job: &IdentificationJob, amplitude_um: f64) -> f64 {
    f64::hypot(job.relative_scatter, 0.6 * job.resolution_um / amplitude_um)
}

fn groups(job: &IdentificationJob) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    for (i, row) in job.measurements.rows().iter().enumerate() {
        let teeth = row.teeth.or(job.cutter.teeth).unwrap_or(1);
        // An unknown speed is that of the rows without one of their own.
        let stated = if job.unknowns.spindle_speed_rpm.is_some() { None } else { job.cut.spindle_speed_rpm };
        let spindle_rpm = row.spindle_speed_rpm.or(stated);
        let feed_mm = row.feed_mm_per_tooth.or(job.cut.feed_mm_per_tooth);
        let same = |group: &&mut Group| {
            group.teeth == teeth
                && group.spindle_rpm.map(f64::to_bits) == spindle_rpm.map(f64::to_bits)
                && group.feed_mm.map(f64::to_bits) == feed_mm.map(f64::to_bits)
        };
        match groups.iter_mut().find(same) {
            Some(group) => group.rows.push(i),
            None => groups.push(Group { teeth, spindle_rpm, feed_mm, rows: vec![i] }),
        }
    }
    for group in &mut groups {
        group
            .rows
            .sort_by(|&a, &b| job.measurements.rows()[a].depth_mm.total_cmp(&job.measurements.rows()[b].depth_mm));
    }
    groups
}

/// From the first row on whose amplitude over depth has risen by [`JUMP`], a group chatters; opened joints are deeper still.
fn mark_jumps(job: &IdentificationJob, group: &Group, jumped: &mut [bool]) {
    let mut least = f64::INFINITY;
    let mut seen = false;
    for &row in &group.rows {
        let of = &job.measurements.rows()[row];
        if let Some(amplitude) = of.amplitude_um.filter(|_| !of.excluded) {
            let per_depth = amplitude / of.depth_mm;
            // A coarse reading of a small amplitude is no jump.
            seen |= per_depth * (1.0 - job.resolution_um / amplitude).max(0.0) > JUMP * least;
            least = least.min(per_depth);
        }
        jumped[row] = seen;
    }
}

/// Between which depths the table shows the onset of chatter.
pub(super) fn onset_mm(problem: &Problem<'_>, group: &Group) -> (Option<f64>, Option<f64>) {
    let depth = |row: &&usize| problem.job.measurements.rows()[**row].depth_mm;
    let with_value = |row: &&usize| problem.job.measurements.rows()[**row].amplitude_um.is_some();
    let below = group.rows.iter().filter(with_value).rfind(|row| !problem.jumped[**row]);
    let above = group.rows.iter().find(|row| problem.jumped[**row]);
    (below.as_ref().map(depth), above.as_ref().map(depth))
}
