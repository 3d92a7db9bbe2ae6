//! The model as a diagnosis needs it: places of a part that the program made in, diameters out, effects as parameters.
//!
//! What is predicted is what the drive of the program leaves. Which causes there are, what they are called and what may be off
//! although nobody finds it is what deflection compensation has of the same work.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{
    Consequence, Cost, Design, Diagnosable, Example, Failure, Finding, ForwardModel, Hypotheses, Hypothesis,
    JacobianColumn, KnownOver, Missing, Monitor, NextRun, NextRuns, Prediction, PrepareError, Quantity, Ranges, Rows,
    Unnamed, checkpoint,
};
use crate::deflection_compensation::{
    DeflectionAllowances, DeflectionCompensation, DeflectionPoint, DeflectionRun, GAUGE_STEP_MM, Measure,
    PreparedDeflection, QUANTITIES, RELATIVE_STEP, Theory, columns_of_runs, difference, longest_run,
};
use crate::effects::{Cause, DEFLECTION_CAUSES, DeflectionConditions, DeflectionEffect, JointUncertainty};

use super::ProgramCompensation;
use super::consequence::consequences;
use super::job::{Job, SupportLines};
use super::made::{Made, drive_ms, drive_ms_of};
use super::measurement::ProgramMeasurement;
use super::model::stock::Part;
use super::model::yielding::radius_at;

/// Conditions of one part; what it leaves out is as in the job.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ProgramRun {
    /// The program that made it, where that is not the job's own: the one that was given back, say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_length = 1, max_length = 8_000_000, example = "%\nO0042\nN10 G21 G18 G40 G99\n")]
    pub nc_program: Option<String>,
    /// Supports that act in some lines only of that program; the job's are those of its own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 32)]
    pub support_lines: Vec<SupportLines>,
    /// Path that the edge had cut when the part began.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e6, example = 120.0, extensions(("x-unit" = json!("m")), ("x-symbol" = json!("s"))))]
    pub tool_path_at_start_m: Option<f64>,
    /// Time since the machine was cold when the part began.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e5, example = 15.0, extensions(("x-unit" = json!("min")), ("x-symbol" = json!("tau"))))]
    pub warm_time_at_start_min: Option<f64>,
}

impl ProgramRun {
    /// What decides which causes it can speak about.
    fn conditions(&self) -> DeflectionRun {
        DeflectionRun {
            tool_path_at_start_m: self.tool_path_at_start_m,
            warm_time_at_start_min: self.warm_time_at_start_min,
            ..DeflectionRun::default()
        }
    }

    /// The job under its conditions.
    fn job(&self, base: &Job) -> Job {
        let mut job = base.clone();
        if let Some(own) = &self.nc_program {
            job.nc_program.clone_from(own);
            job.support_lines.clone_from(&self.support_lines);
        }
        self.act_on(&mut job.conditions);
        job
    }

    /// Its conditions in the place of those of the job.
    pub(super) fn act_on(&self, conditions: &mut DeflectionConditions) {
        conditions.tool_path_at_start_m = self.tool_path_at_start_m.or(conditions.tool_path_at_start_m);
        conditions.warm_time_at_start_min = self.warm_time_at_start_min.or(conditions.warm_time_at_start_min);
    }
}

/// What no effect changes.
pub struct PreparedProgram {
    /// The work, its runs and rows as far as causes are concerned.
    causes: PreparedDeflection,
    measure: Measure,
    /// What is meant.
    nominal: Vec<Part>,
    /// The runs that have rows.
    runs: Vec<PreparedRun>,
    rows: usize,
}

/// A part, its program and the places at which it was measured.
struct PreparedRun {
    part: Made,
    /// Its rows, and the station of each.
    rows: Vec<usize>,
    z_mm: Vec<f64>,
}

impl PreparedProgram {
    /// One value a row, so far along the work from where it was measured.
    fn predicted(
        &self,
        effects: &[DeflectionEffect],
        shifts_mm: &[f64],
        monitor: &dyn Monitor,
    ) -> Result<Vec<Vec<Prediction>>, Failure> {
        let mut found = vec![vec![Err(Missing::NoSolution); self.rows]; shifts_mm.len()];
        for run in &self.runs {
            checkpoint(monitor)?;
            // Without further effects it is what it was.
            let own = if effects.is_empty() { None } else { Some(run.part.with_effects(effects, monitor)?) };
            let real = own.as_ref().map_or(&run.part.base.real, |own| &own.real);
            for (into, shift) in found.iter_mut().zip(shifts_mm) {
                for (&row, z) in run.rows.iter().zip(&run.z_mm) {
                    let [left, meant] = [real, &self.nominal].map(|parts| radius_at(parts, z + shift));
                    into[row] = Ok(self.measure.of(left, meant));
                }
            }
        }
        Ok(found)
    }

    /// The same at the places of the rows alone.
    fn at_rows(&self, effects: &[DeflectionEffect], monitor: &dyn Monitor) -> Result<Vec<Prediction>, Failure> {
        let mut found = self.predicted(effects, &[0.0], monitor)?;
        found.pop().ok_or_else(|| Failure::Internal("no row was predicted".to_owned()))
    }

    /// Central difference of the prediction by a relative effect about 0.
    fn slope(
        &self,
        effects: &[DeflectionEffect],
        effect: impl Fn(f64) -> DeflectionEffect,
        monitor: &dyn Monitor,
    ) -> Result<Vec<f64>, Failure> {
        let at = |delta: f64| self.at_rows(&[effects, &[effect(delta)]].concat(), monitor);
        Ok(difference(&at(-RELATIVE_STEP)?, &at(RELATIVE_STEP)?, 2.0 * RELATIVE_STEP))
    }

    /// What a base that bends without shear leaves out.
    fn neglected_shear(
        &self,
        effects: &[DeflectionEffect],
        monitor: &dyn Monitor,
    ) -> Result<Option<JacobianColumn>, Failure> {
        let has_shear = |run: &PreparedRun| {
            run.part.job.stock.as_ref().is_some_and(|stock| stock.theory == Some(Theory::Timoshenko))
        };
        if self.runs.iter().any(has_shear) {
            return Ok(None);
        }
        let mut column = vec![0.0; self.rows];
        for run in &self.runs {
            let drive = |theory| run.part.with_theory(theory, effects, monitor);
            let [without, with] = [drive(Theory::EulerBernoulli)?, drive(Theory::Timoshenko)?];
            for (&row, z) in run.rows.iter().zip(&run.z_mm) {
                let [with, without] = [&with, &without].map(|of| self.measure.of(radius_at(&of.real, *z), 0.0));
                column[row] = with - without;
            }
        }
        Ok(Some(column))
    }
}

/// Faults of a program, told where it stands in what is asked.
fn failed_at(failure: Failure, place: &str) -> PrepareError {
    PrepareError::Failed(match failure {
        Failure::NotRead { findings, total } => {
            Failure::NotRead { findings: findings.into_iter().map(|finding| finding.under(place)).collect(), total }
        }
        other => other,
    })
}

impl ForwardModel for ProgramCompensation {
    type Job = Job;
    type Run = ProgramRun;
    type Point = DeflectionPoint;
    type Effect = DeflectionEffect;
    type Allowances = DeflectionAllowances;
    type Prepared = PreparedProgram;

    const CAUSES: &'static [Cause] = DEFLECTION_CAUSES;
    const TAKES_OPEN_EFFECTS: bool = true;
    const QUANTITIES: &'static [Quantity] = QUANTITIES;
    const CONDITIONS: &'static [&'static str] = &[];

    fn faults_of_point(job: &Job, point: &DeflectionPoint) -> Vec<Finding> {
        let of = |work| DeflectionCompensation::faults_of_point(&work, point);
        job.holding().map(|holding| of(holding.work())).unwrap_or_default()
    }

    fn own_effects(job: &Job) -> &[DeflectionEffect] {
        &job.effects
    }

    fn open_effects(job: &Job) -> &[JointUncertainty] {
        &job.uncertainty.effects
    }

    fn without_effects(job: &Job) -> Job {
        let mut job = Job { effects: Vec::new(), ..job.clone() };
        job.uncertainty.effects.clear();
        job
    }

    fn prepare(
        job: &Job,
        rows: &Rows<ProgramRun, DeflectionPoint>,
        quantity: &str,
        monitor: &dyn Monitor,
    ) -> Result<PreparedProgram, PrepareError> {
        let measure = Measure::asked(quantity)?;
        let holding = job.holding().filter(|_| job.program_zero_z_mm.is_some());
        let holding = holding
            .ok_or_else(|| PrepareError::Invalid(vec![Finding::new("prediction_without_force", "/job/force")]))?;
        let places: Vec<(usize, f64)> = rows.points.iter().map(|(run, point)| (*run, point.z_mm)).collect();
        let of_runs = rows.runs.iter().map(ProgramRun::conditions).collect();
        let causes = PreparedDeflection::of_causes(holding.work(), of_runs, places.clone(), measure);
        let given = Made::of(job.clone(), monitor).map_err(|failure| failed_at(failure, "/job"))?;
        let mut runs = Vec::new();
        for (k, conditions) in rows.runs.iter().enumerate() {
            let own = || places.iter().enumerate().filter(move |(_, (run, _))| *run == k);
            if own().next().is_none() {
                continue;
            }
            let place = if conditions.nc_program.is_some() { format!("/runs/{k}") } else { "/job".to_owned() };
            let part = Made::of(conditions.job(job), monitor).map_err(|failure| failed_at(failure, &place))?;
            let (rows, z_mm) = own().map(|(row, (_, z))| (row, *z)).unzip();
            runs.push(PreparedRun { part, rows, z_mm });
        }
        Ok(PreparedProgram { causes, measure, nominal: given.base.nominal, runs, rows: places.len() })
    }

    fn predict(
        prepared: &PreparedProgram,
        effects: &[DeflectionEffect],
        monitor: &dyn Monitor,
    ) -> Result<Vec<Prediction>, Failure> {
        prepared.at_rows(effects, monitor)
    }

    fn effect(cause: &Cause, values: &[f64]) -> Option<DeflectionEffect> {
        DeflectionCompensation::effect(cause, values)
    }

    fn nuisances(
        prepared: &PreparedProgram,
        effects: &[DeflectionEffect],
        allowances: &DeflectionAllowances,
        monitor: &dyn Monitor,
    ) -> Result<Vec<JacobianColumn>, Failure> {
        let by_force = prepared.slope(effects, |delta| DeflectionEffect::ForceLevel { delta }, monitor)?;
        let by_bending = prepared.slope(effects, |delta| DeflectionEffect::BendingScale { delta }, monitor)?;
        let beside = prepared.predicted(effects, &[-GAUGE_STEP_MM, GAUGE_STEP_MM], monitor)?;
        let along = difference(&beside[0], &beside[1], 2.0 * GAUGE_STEP_MM);
        let rows = prepared.runs.iter().map(|run| run.rows.as_slice());
        let scaled = |column: &[f64], by: f64| -> Vec<f64> { column.iter().map(|x| x * by).collect() };
        let mut columns = columns_of_runs(rows, prepared.measure, (&by_force, &along), allowances);
        columns.push(scaled(&by_force, allowances.force_level_rel));
        columns.push(scaled(&by_bending, allowances.bending_rel));
        columns.extend(prepared.neglected_shear(effects, monitor)?);
        Ok(columns)
    }

    fn predict_cost(prepared: &PreparedProgram) -> Cost {
        let ms = prepared.runs.iter().map(|run| drive_ms(&run.part.program, &run.part.job)).sum();
        Cost { ms, bytes: 1_000_000 * prepared.runs.len() as u64, driver: "/job/nc_program" }
    }
}

impl Diagnosable for ProgramCompensation {
    type Row = ProgramMeasurement;

    /// The others', and twice so many parts as are judged.
    const PREDICTIONS: f64 = 700.0;

    const DIAGNOSES: &'static [Example] = &[Example {
        id: "soft_tailstock",
        title: "Two parts that a program made: the tailstock is softer than assumed",
        job: include_str!("examples/diagnosis_tailstock.json"),
    }];

    fn hypotheses(
        prepared: &PreparedProgram,
        held: &[DeflectionEffect],
        monitor: &dyn Monitor,
    ) -> Result<Hypotheses, Failure> {
        DeflectionCompensation::hypotheses(&prepared.causes, held, monitor)
    }

    fn effects(prepared: &PreparedProgram, hypothesis: &Hypothesis, values: &[f64]) -> Option<Vec<DeflectionEffect>> {
        DeflectionCompensation::effects(&prepared.causes, hypothesis, values)
    }

    fn values(prepared: &PreparedProgram, hypothesis: &Hypothesis, effect: &DeflectionEffect) -> Option<Vec<f64>> {
        DeflectionCompensation::values(&prepared.causes, hypothesis, effect)
    }

    fn remainder(
        prepared: &PreparedProgram,
        held: &[DeflectionEffect],
        found: &Unnamed<'_>,
    ) -> Option<DeflectionEffect> {
        DeflectionCompensation::remainder(&prepared.causes, held, found)
    }

    fn known_over(remainder: &DeflectionEffect) -> Vec<KnownOver> {
        DeflectionCompensation::known_over(remainder)
    }

    fn design(prepared: &PreparedProgram) -> Design {
        DeflectionCompensation::design(&prepared.causes)
    }

    fn allowed(allowances: &DeflectionAllowances, normal: &mut dyn FnMut() -> f64) -> Vec<DeflectionEffect> {
        DeflectionCompensation::allowed(allowances, normal)
    }

    fn place(point: &DeflectionPoint) -> Vec<(&'static str, Option<f64>)> {
        DeflectionCompensation::place(point)
    }

    fn from_other_end(job: &Job, point: &DeflectionPoint) -> Option<DeflectionPoint> {
        DeflectionCompensation::from_other_end(&job.holding()?.work(), point)
    }

    /// The same program with a fresh edge, and on a cold machine.
    fn next_runs(
        _job: &Job,
        rows: &Rows<ProgramRun, DeflectionPoint>,
        _ranges: Ranges<'_>,
        _monitor: &dyn Monitor,
    ) -> Result<NextRuns<ProgramRun, DeflectionPoint>, Failure> {
        let Some(typical) = rows.runs.get(rows.runs.len() / 2) else { return Ok(Vec::new()) };
        let points = longest_run(rows);
        let next = |changes, run| NextRun { changes, run, points: points.clone() };
        Ok(vec![
            next("tool_path_at_start_m", ProgramRun { tool_path_at_start_m: Some(0.0), ..typical.clone() }),
            next("warm_time_at_start_min", ProgramRun { warm_time_at_start_min: Some(0.0), ..typical.clone() }),
        ])
    }

    fn consequences(
        job: &Job,
        _quantity: &str,
        runs: &[ProgramRun],
        believed: &[DeflectionEffect],
        acting: &[Vec<DeflectionEffect>],
        monitor: &dyn Monitor,
    ) -> Result<Vec<Consequence>, Failure> {
        consequences(job, runs, believed, acting, monitor)
    }

    fn predict_ms(job: &Job) -> f64 {
        drive_ms_of(job)
    }
}
