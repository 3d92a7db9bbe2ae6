//! A run ready to be predicted: what no effect changes.

use crate::calculator::{Failure, Missing, Monitor, Prediction, checkpoint};
use crate::effects::{DeflectionConditions, DeflectionEffect};
use crate::num::beam::Profile;

use crate::deflection_compensation::job::acting::{Acting, StructureChange};
use crate::deflection_compensation::job::grid::{Grid, interpolate};
use crate::deflection_compensation::job::input::{Job, Stations};
use crate::deflection_compensation::job::structure::{Structure, Variant};
use crate::deflection_compensation::measured::measure::Measure;
use crate::deflection_compensation::measured::run::{CommandedPoint, DeflectionRun};
use crate::deflection_compensation::model::equilibrium::Engagement;
use crate::deflection_compensation::model::regime::{Regime, Step, passages, section_of_pass};
use crate::deflection_compensation::model::yielding::{Ingredients, Line, Radii, wanted};

/// What no effect parameter changes.
pub struct PreparedDeflection {
    pub(in crate::deflection_compensation) runs: Vec<PreparedRun>,
    pub(in crate::deflection_compensation) rows: usize,
    pub(in crate::deflection_compensation) measure: Measure,
    pub(in crate::deflection_compensation) job: Job,
    pub(in crate::deflection_compensation) conditions_of_runs: Vec<DeflectionRun>,
    /// Run and station of every row.
    pub(in crate::deflection_compensation) places: Vec<(usize, f64)>,
}

impl PreparedDeflection {
    /// Rows along work that another model turns: what can be said of their causes, and no prediction.
    pub(crate) fn of_causes(
        job: Job,
        conditions_of_runs: Vec<DeflectionRun>,
        places: Vec<(usize, f64)>,
        measure: Measure,
    ) -> Self {
        Self { runs: Vec::new(), rows: places.len(), measure, job, conditions_of_runs, places }
    }
}

pub(in crate::deflection_compensation) struct PreparedRun {
    /// The job under the run's conditions.
    pub(in crate::deflection_compensation) job: Job,
    pub(in crate::deflection_compensation) conditions: DeflectionConditions,
    pub(in crate::deflection_compensation) grid: Grid,
    pub(in crate::deflection_compensation) regime: Regime,
    pub(in crate::deflection_compensation) radii: Radii,
    pub(in crate::deflection_compensation) command_mm: Vec<f64>,
    pub(in crate::deflection_compensation) base_change: StructureChange,
    pub(in crate::deflection_compensation) base_profile: Profile,
    /// Row of every station of the grid.
    pub(in crate::deflection_compensation) row_of_station: Vec<usize>,
}

impl PreparedRun {
    pub(in crate::deflection_compensation) fn of(
        base: &Job,
        run: &DeflectionRun,
        mut places: Vec<(usize, f64)>,
    ) -> Result<Self, Failure> {
        places.sort_by(|a, b| a.1.total_cmp(&b.1));
        let job = job_of_run(base, run, places.iter().map(|p| p.1).collect());
        let grid = Grid::of(&job);
        let conditions = conditions(base, run);
        let regime = Regime::of(&job.cut);
        let stock = crate::deflection_compensation::model::stage::stock_radii_mm(&job, &grid);
        let target: Vec<f64> = grid.segment.iter().map(|&i| job.shaft.segments[i].diameter_mm / 2.0).collect();
        let command_mm = if run.commanded_path.is_empty() {
            target.clone()
        } else {
            let (z, r): (Vec<f64>, Vec<f64>) = run.commanded_path.iter().map(|p| (p.z_mm, p.diameter_mm / 2.0)).unzip();
            interpolate(&z, &r, &grid.z_mm)
        };
        let base_change = Acting::of(&job.effects, &conditions, regime.direction).structure;
        let base_profile = structure(&job, &base_change, &regime)?.beam.profile(&grid.z_mm, wanted(&job));
        Ok(Self {
            radii: Radii { target, stock, planned: None, idle: Vec::new() },
            row_of_station: places.into_iter().map(|p| p.0).collect(),
            job,
            conditions,
            grid,
            regime,
            command_mm,
            base_change,
            base_profile,
        })
    }

    pub(in crate::deflection_compensation) fn predict(
        &self,
        effects: &[DeflectionEffect],
        measure: Measure,
        out: &mut [Prediction],
    ) -> Result<(), Failure> {
        let mut all = self.job.effects.clone();
        all.extend_from_slice(effects);
        let acting = Acting::of(&all, &self.conditions, self.regime.direction);
        let structure = structure(&self.job, &acting.structure, &self.regime)?;
        let profile = if acting.structure == self.base_change {
            self.base_profile.clone()
        } else {
            structure.beam.profile(&self.grid.z_mm, wanted(&self.job))
        };
        // A run is one cut: its clocks start with the conditions that it states.
        let passages = if acting.has_errors() {
            passages(&self.job, &self.grid, &self.regime, &Step::default(), &self.radii)
        } else {
            Vec::new()
        };
        let displaced = structure.displaced(&self.job, &acting.set_off, &self.grid.z_mm)?;
        let ingredients = Ingredients {
            job: &self.job,
            grid: &self.grid,
            acting: &acting,
            structure: &structure,
            regime: &self.regime,
            radii: &self.radii,
            passages: &passages,
            displaced: displaced.as_ref(),
        };
        let line = Line::of(&ingredients, profile);
        let mut solver = line.solver();
        for (i, &row) in self.row_of_station.iter().enumerate() {
            // What a formula of the user says nothing of is not predicted.
            if !line.has_error_value(i) {
                out[row] = Err(Missing::NoSolution);
                continue;
            }
            let (stock, command) = (self.radii.stock[i], self.command_mm[i]);
            let commanded_depth = stock - command;
            let opening = line.opening_at(i, commanded_depth);
            let guess = commanded_depth - opening.y_mm / (1.0 + opening.y_slope);
            out[row] = match solver.engage(i, stock, command, guess) {
                Engagement::Cut { depth_mm, .. } => Ok(measure.of(stock - depth_mm, self.radii.target[i])),
                Engagement::NoContact => Ok(measure.of(stock, self.radii.target[i])),
                Engagement::NoCut => Err(Missing::NoCut),
            };
        }
        Ok(())
    }

    /// The same run measured `dz_mm` further along, kept on the shaft.
    pub(in crate::deflection_compensation) fn shifted(&self, dz_mm: f64) -> Result<Self, Failure> {
        let length = self.grid.length_mm;
        let places = self
            .row_of_station
            .iter()
            .zip(&self.grid.z_mm)
            .map(|(&row, z)| (row, (z + dz_mm).clamp(0.0, length)))
            .collect();
        let run = DeflectionRun {
            tool_path_at_start_m: self.conditions.tool_path_at_start_m,
            warm_time_at_start_min: self.conditions.warm_time_at_start_min,
            commanded_path: self
                .grid
                .z_mm
                .iter()
                .zip(&self.command_mm)
                .map(|(&z_mm, r)| CommandedPoint { z_mm, diameter_mm: 2.0 * r })
                .collect(),
            ..DeflectionRun::default()
        };
        Self::of(&self.job, &run, places)
    }
}

/// The state that effects depend on in a run.
pub(in crate::deflection_compensation) fn conditions(base: &Job, run: &DeflectionRun) -> DeflectionConditions {
    DeflectionConditions {
        tool_path_at_start_m: run.tool_path_at_start_m.or(base.conditions.tool_path_at_start_m),
        warm_time_at_start_min: run.warm_time_at_start_min.or(base.conditions.warm_time_at_start_min),
    }
}

/// The base job under the conditions of a run, at the places measured.
fn job_of_run(base: &Job, run: &DeflectionRun, z_mm: Vec<f64>) -> Job {
    Job { stations: Stations::List { z_mm }, ..under(base, run) }
}

/// The base job under the conditions of a run.
pub(in crate::deflection_compensation) fn under(base: &Job, run: &DeflectionRun) -> Job {
    let mut job = base.clone();
    job.passes.clear();
    job.conditions = conditions(base, run);
    if let Some(depth) = run.depth_mm {
        job.stock_profile = None;
        for segment in &mut job.shaft.segments {
            if segment.stock_mm() > segment.diameter_mm {
                segment.stock_diameter_mm = Some(segment.diameter_mm + 2.0 * depth);
            }
        }
    }
    if let Some(feed) = run.feed_mm_per_rev {
        job.cut.feed_mm_per_rev = feed;
    }
    if run.speed_m_per_min.is_some() || run.spindle_speed_rpm.is_some() {
        (job.cut.speed_m_per_min, job.cut.spindle_speed_rpm) = (run.speed_m_per_min, run.spindle_speed_rpm);
    }
    if let Some(direction) = run.feed_direction {
        job.cut.feed_direction = direction;
    }
    job
}

fn structure(job: &Job, change: &StructureChange, regime: &Regime) -> Result<Structure, Failure> {
    let mut variant = Variant::of(job, change);
    variant.direction = regime.direction;
    variant.section = section_of_pass(job, change.uncut_side);
    Structure::of(job, &variant)
}

pub(in crate::deflection_compensation) fn predict(
    runs: &[PreparedRun],
    rows: usize,
    measure: Measure,
    effects: &[DeflectionEffect],
    monitor: &dyn Monitor,
) -> Result<Vec<Prediction>, Failure> {
    let mut out = vec![Err(Missing::NoSolution); rows];
    for run in runs {
        checkpoint(monitor)?;
        run.predict(effects, measure, &mut out)?;
    }
    Ok(out)
}

/// The runs that have rows, each with its own.
pub(in crate::deflection_compensation) fn prepared_runs(
    job: &Job,
    runs: &[DeflectionRun],
    places: &[(usize, f64)],
) -> Result<Vec<PreparedRun>, Failure> {
    let mut prepared = Vec::with_capacity(runs.len());
    for (k, run) in runs.iter().enumerate() {
        let own: Vec<(usize, f64)> =
            places.iter().enumerate().filter(|(_, place)| place.0 == k).map(|(row, place)| (row, place.1)).collect();
        if !own.is_empty() {
            prepared.push(PreparedRun::of(job, run, own)?);
        }
    }
    Ok(prepared)
}
