//! How predictions change with what is not quite known of the base.

use crate::calculator::{Failure, JacobianColumn, Monitor, Prediction};
use crate::effects::DeflectionEffect;

use crate::deflection_compensation::job::input::Theory;
use crate::deflection_compensation::measured::measure::Measure;
use crate::deflection_compensation::measured::prepared::{PreparedDeflection, PreparedRun, predict, prepared_runs};
use crate::deflection_compensation::measured::run::DeflectionAllowances;

/// Step of the divided differences in ln F and in the bending scale: truncation 1e-6, round-off 1e-12.
pub(crate) const RELATIVE_STEP: f64 = 1e-3;
/// Step of the divided difference along the shaft, mm.
pub(crate) const GAUGE_STEP_MM: f64 = 0.05;

/// The prediction with effects, and what changes it a little.
pub(in crate::deflection_compensation) struct About<'a> {
    pub(in crate::deflection_compensation) prepared: &'a PreparedDeflection,
    pub(in crate::deflection_compensation) effects: &'a [DeflectionEffect],
    pub(in crate::deflection_compensation) monitor: &'a dyn Monitor,
}

impl About<'_> {
    /// What is off in one run by itself.
    pub(in crate::deflection_compensation) fn of_runs(
        &self,
        by_force: &[f64],
        allowances: &DeflectionAllowances,
    ) -> Result<Vec<JacobianColumn>, Failure> {
        let rows = self.prepared.runs.iter().map(|run| run.row_of_station.as_slice());
        let along = self.slope_along()?;
        Ok(columns_of_runs(rows, self.prepared.measure, (by_force, &along), allowances))
    }

    pub(in crate::deflection_compensation) fn predicted(
        &self,
        runs: &[PreparedRun],
        effects: &[DeflectionEffect],
    ) -> Result<Vec<Prediction>, Failure> {
        predict(runs, self.prepared.rows, self.prepared.measure, effects, self.monitor)
    }

    /// What a base that bends without shear leaves out: known, so it is allowed for rather than found.
    /// `None` where the base has it.
    pub(in crate::deflection_compensation) fn neglected_shear(&self) -> Result<Option<JacobianColumn>, Failure> {
        let PreparedDeflection { job, runs, conditions_of_runs, places, .. } = self.prepared;
        if job.shaft.theory() == Theory::Timoshenko {
            return Ok(None);
        }
        let mut with_shear = job.clone();
        with_shear.shaft.theory = Some(Theory::Timoshenko);
        let with = prepared_runs(&with_shear, conditions_of_runs, places)?;
        let without = self.predicted(runs, self.effects)?;
        Ok(Some(difference(&without, &self.predicted(&with, self.effects)?, 1.0)))
    }

    /// Central difference of the prediction by a relative effect about 0, one entry per row.
    pub(in crate::deflection_compensation) fn slope(
        &self,
        effect: impl Fn(f64) -> DeflectionEffect,
    ) -> Result<Vec<f64>, Failure> {
        let at = |delta: f64| {
            self.predicted(&self.prepared.runs, &[self.effects, std::slice::from_ref(&effect(delta))].concat())
        };
        Ok(difference(&at(-RELATIVE_STEP)?, &at(RELATIVE_STEP)?, 2.0 * RELATIVE_STEP))
    }

    /// Central difference of the prediction along the shaft.
    pub(in crate::deflection_compensation) fn slope_along(&self) -> Result<Vec<f64>, Failure> {
        let at = |dz_mm: f64| -> Result<Vec<Prediction>, Failure> {
            let runs = self.prepared.runs.iter().map(|run| run.shifted(dz_mm)).collect::<Result<Vec<_>, _>>()?;
            self.predicted(&runs, self.effects)
        };
        Ok(difference(&at(-GAUGE_STEP_MM)?, &at(GAUGE_STEP_MM)?, 2.0 * GAUGE_STEP_MM))
    }
}

/// What is off in one run by itself: setting, force and place of the gauge, run by run, of each its rows. The slopes by force and place
/// are those of all rows.
pub(crate) fn columns_of_runs<'r>(
    rows_of_runs: impl Iterator<Item = &'r [usize]>,
    measure: Measure,
    (by_force, along): (&[f64], &[f64]),
    allowances: &DeflectionAllowances,
) -> Vec<JacobianColumn> {
    let ones = vec![measure.per_diameter_um(); by_force.len()];
    let allowed = [
        (ones.as_slice(), allowances.setup_diameter_um),
        (by_force, allowances.force_per_run_rel),
        (along, allowances.gauge_position_mm),
    ];
    let of_run = |rows: &'r [usize]| {
        allowed.map(|(column, by)| {
            let mut of_run = vec![0.0; column.len()];
            for &row in rows {
                of_run[row] = column[row] * by;
            }
            of_run
        })
    };
    rows_of_runs.flat_map(of_run).collect()
}

/// What lies between two predictions, over a span.
pub(crate) fn difference(below: &[Prediction], above: &[Prediction], span: f64) -> Vec<f64> {
    below
        .iter()
        .zip(above)
        .map(|(b, a)| match (b, a) {
            (Ok(b), Ok(a)) => (a - b) / span,
            _ => 0.0,
        })
        .collect()
}
