//! The model as a diagnosis needs it: measured places in, predictions out, effects as parameters.

use crate::calculator::{
    Consequence, Cost, Design, Diagnosable, Example, Failure, Finding, ForwardModel, Hypotheses, Hypothesis,
    JacobianColumn, KnownOver, Monitor, NextRuns, Prediction, PrepareError, Quantity, Ranges, Rows, ToldEffects,
    Unnamed, checkpoint, values_by_name, values_of_formula,
};
use crate::effects::{Cause, DEFLECTION_CAUSES, DeflectionEffect, ErrorPoint, JointUncertainty};
use crate::shaft::places;

use crate::deflection_compensation::DeflectionCompensation;
use crate::deflection_compensation::job::acting::error_um;
use crate::deflection_compensation::job::check::outside_shaft;
use crate::deflection_compensation::job::input::Job;
use crate::deflection_compensation::measured::about::About;
use crate::deflection_compensation::measured::consequence::{consequences, parts_kept};
use crate::deflection_compensation::measured::hypotheses::{
    Experiment, chuck_scale_n_mm_per_rad, design, remainder_name,
};
use crate::deflection_compensation::measured::measure::{Measure, QUANTITIES};
use crate::deflection_compensation::measured::measurement::DeflectionMeasurement;
use crate::deflection_compensation::measured::next_runs::next_runs;
use crate::deflection_compensation::measured::prepared::{PreparedDeflection, predict, prepared_runs};
use crate::deflection_compensation::measured::run::{DeflectionAllowances, DeflectionPoint, DeflectionRun};

impl ForwardModel for DeflectionCompensation {
    type Job = Job;
    type Run = DeflectionRun;
    type Point = DeflectionPoint;
    type Effect = DeflectionEffect;
    type Allowances = DeflectionAllowances;
    type Prepared = PreparedDeflection;

    const CAUSES: &'static [Cause] = DEFLECTION_CAUSES;
    const TAKES_OPEN_EFFECTS: bool = true;
    const QUANTITIES: &'static [Quantity] = QUANTITIES;
    const CONDITIONS: &'static [&'static str] = &["depth_mm", "feed_mm_per_rev", "speed_m_per_min"];

    fn faults_of_point(job: &Job, point: &DeflectionPoint) -> Vec<Finding> {
        let length = job.shaft.length_mm();
        // Of a shaft without segments that alone is told.
        let beside = length > 0.0 && !places::within(point.z_mm, [0.0, length]);
        beside.then(|| outside_shaft("/z_mm".to_owned(), point.z_mm, length)).into_iter().collect()
    }

    fn faults_of_run(run: &DeflectionRun) -> Vec<Finding> {
        let mut faults = Vec::new();
        if run.speed_m_per_min.is_some() && run.spindle_speed_rpm.is_some() {
            faults.push(Finding::new("speed_or_rpm", "").with("given", "both"));
        }
        for (i, pair) in run.commanded_path.windows(2).enumerate() {
            if pair[1].z_mm <= pair[0].z_mm {
                let at = format!("/commanded_path/{}/z_mm", i + 1);
                faults.push(Finding::new("stations_not_ascending", at).measured(pair[1].z_mm, pair[0].z_mm, "mm"));
            }
        }
        faults
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
        rows: &Rows<DeflectionRun, DeflectionPoint>,
        quantity: &str,
        monitor: &dyn Monitor,
    ) -> Result<PreparedDeflection, PrepareError> {
        let measure = Measure::asked(quantity)?;
        let faults = faults_of_rows(job, rows);
        if !faults.is_empty() {
            return Err(PrepareError::Invalid(faults));
        }
        checkpoint(monitor).map_err(PrepareError::Failed)?;
        let ends_mm = job.shaft.ends_mm();
        let settled = |(run, point): &(usize, DeflectionPoint)| (*run, places::settled(point.z_mm, &ends_mm));
        let places: Vec<(usize, f64)> = rows.points.iter().map(settled).collect();
        Ok(PreparedDeflection {
            runs: prepared_runs(job, &rows.runs, &places).map_err(PrepareError::Failed)?,
            rows: rows.points.len(),
            measure,
            job: job.clone(),
            conditions_of_runs: rows.runs.clone(),
            places,
        })
    }

    fn predict(
        prepared: &PreparedDeflection,
        effects: &[DeflectionEffect],
        monitor: &dyn Monitor,
    ) -> Result<Vec<Prediction>, Failure> {
        predict(&prepared.runs, prepared.rows, prepared.measure, effects, monitor)
    }

    fn effect(cause: &Cause, values: &[f64]) -> Option<DeflectionEffect> {
        DeflectionEffect::from_parameters(cause, values)
    }

    fn nuisances(
        prepared: &PreparedDeflection,
        effects: &[DeflectionEffect],
        allowances: &DeflectionAllowances,
        monitor: &dyn Monitor,
    ) -> Result<Vec<JacobianColumn>, Failure> {
        let about = About { prepared, effects, monitor };
        let by_force = about.slope(|delta| DeflectionEffect::ForceLevel { delta })?;
        let by_bending = about.slope(|delta| DeflectionEffect::BendingScale { delta })?;
        let scaled = |column: &[f64], by: f64| -> Vec<f64> { column.iter().map(|x| x * by).collect() };
        let mut columns = about.of_runs(&by_force, allowances)?;
        columns.push(scaled(&by_force, allowances.force_level_rel));
        columns.push(scaled(&by_bending, allowances.bending_rel));
        columns.extend(about.neglected_shear()?);
        Ok(columns)
    }

    fn predict_cost(prepared: &PreparedDeflection) -> Cost {
        // About 0.5 us per row, and 5 us per run for a structure that an effect changes.
        let us = 0.5 * prepared.rows as f64 + 5.0 * prepared.runs.len() as f64;
        Cost { ms: us / 1000.0, bytes: 400 * prepared.rows as u64, driver: "/measurements" }
    }
}

impl Diagnosable for DeflectionCompensation {
    type Row = DeflectionMeasurement;

    const DIAGNOSES: &'static [Example] = &[
        Example {
            id: "headstock",
            title: "Five runs of a slender shaft: the headstock is softer than assumed",
            job: include_str!("../examples/diagnosis_headstock.json"),
        },
        Example {
            id: "guideway",
            title: "Five runs on a worn guideway: a shape that no cause of the catalogue has",
            job: include_str!("../examples/diagnosis_guideway.json"),
        },
    ];

    fn allowed(allowances: &DeflectionAllowances, normal: &mut dyn FnMut() -> f64) -> Vec<DeflectionEffect> {
        // The next cut is a run of its own.
        let force = allowances.force_level_rel.hypot(allowances.force_per_run_rel);
        vec![
            DeflectionEffect::ForceLevel { delta: force * normal() },
            DeflectionEffect::BendingScale { delta: allowances.bending_rel * normal() },
            DeflectionEffect::SizeOffset { offset_um: 0.5 * allowances.setup_diameter_um * normal() },
        ]
    }

    fn hypotheses(
        prepared: &PreparedDeflection,
        held: &[DeflectionEffect],
        _monitor: &dyn Monitor,
    ) -> Result<Hypotheses, Failure> {
        Ok(Experiment { job: &prepared.job, runs: &prepared.conditions_of_runs, held }.hypotheses())
    }

    fn remainder(
        prepared: &PreparedDeflection,
        held: &[DeflectionEffect],
        found: &Unnamed<'_>,
    ) -> Option<DeflectionEffect> {
        let [along] = found.over else { return None };
        let [from_end, to_end] = [along.at.first().copied()?, along.at.last().copied()?];
        let length_mm = prepared.job.shaft.length_mm();
        let before = held.iter().find_map(|effect| match effect {
            DeflectionEffect::Remainder { scale, profile, .. } => Some((*scale, profile.as_slice())),
            _ => None,
        });
        let name = held.iter().map(remainder_name).collect();
        // The one that was known before is part of it, over all places of either.
        let ends_before = before.and_then(|(_, known)| Some([known.first()?.z_mm, known.last()?.z_mm]));
        let [from, to] = [from_end, to_end].map(|end| end * length_mm);
        let [first, last] = ends_before.map_or([from, to], |[first, last]| [first.min(from), last.max(to)]);
        let count = before.map_or(along.at.len(), |(_, known)| along.at.len().max(known.len())).max(2);
        let point = |index: usize| {
            let z_mm = first + (last - first) * index as f64 / (count - 1) as f64;
            let known = before.map_or(0.0, |(scale, known)| scale * error_um(known, z_mm));
            ErrorPoint { z_mm, error_um: known + (found.size)(&[(z_mm / length_mm).clamp(from_end, to_end)]) }
        };
        Some(DeflectionEffect::Remainder { name, scale: 1.0, profile: (0..count).map(point).collect() })
    }

    fn known_over(remainder: &DeflectionEffect) -> Vec<KnownOver> {
        let DeflectionEffect::Remainder { profile, .. } = remainder else { return Vec::new() };
        let ends = profile.first().zip(profile.last());
        let range = |(first, last): (&ErrorPoint, &ErrorPoint)| KnownOver {
            field: "z_mm",
            unit: "mm",
            from: first.z_mm,
            to: last.z_mm,
        };
        ends.map(range).into_iter().collect()
    }

    fn effects(
        prepared: &PreparedDeflection,
        hypothesis: &Hypothesis,
        values: &[f64],
    ) -> Option<Vec<DeflectionEffect>> {
        let effect = match (hypothesis.cause.kind, values) {
            ("chuck_rotational_stiffness", &[kappa]) => {
                let ktheta = kappa / (1.0 - kappa) * chuck_scale_n_mm_per_rad(&prepared.job);
                DeflectionEffect::ChuckRotationalStiffness { ktheta_n_mm_per_rad: ktheta.max(1.0) }
            }
            _ => DeflectionEffect::from_parameters(hypothesis.cause, values)?,
        };
        Some(vec![effect])
    }

    fn values(prepared: &PreparedDeflection, hypothesis: &Hypothesis, effect: &DeflectionEffect) -> Option<Vec<f64>> {
        if let Some(own) = effect.formula() {
            return values_of_formula(hypothesis, &own);
        }
        match effect {
            DeflectionEffect::ChuckRotationalStiffness { ktheta_n_mm_per_rad: k } => {
                let is_it = hypothesis.cause.kind == effect.kind();
                is_it.then(|| vec![k / (k + chuck_scale_n_mm_per_rad(&prepared.job))])
            }
            _ => values_by_name(hypothesis, effect),
        }
    }

    fn design(prepared: &PreparedDeflection) -> Design {
        design(&prepared.job, &prepared.places)
    }

    fn consequences(
        job: &Job,
        _quantity: &str,
        runs: &[DeflectionRun],
        believed: &[DeflectionEffect],
        acting: &[Vec<DeflectionEffect>],
        monitor: &dyn Monitor,
    ) -> Result<Vec<Consequence>, Failure> {
        consequences(job, runs, believed, acting, monitor)
    }

    const PARTS_DRAWN: usize = 500;

    fn parts_kept(
        job: &Job,
        runs: &[DeflectionRun],
        believed: &[DeflectionEffect],
        acting: &[Vec<DeflectionEffect>],
        told: &ToldEffects<'_, DeflectionEffect>,
        monitor: &dyn Monitor,
    ) -> Result<Option<Vec<bool>>, Failure> {
        parts_kept(job, runs, believed, acting, told, monitor)
    }

    fn from_other_end(job: &Job, point: &DeflectionPoint) -> Option<DeflectionPoint> {
        let length = job.shaft.length_mm();
        Some(DeflectionPoint { z_mm: (length - point.z_mm).clamp(0.0, length) })
    }

    fn place(point: &DeflectionPoint) -> Vec<(&'static str, Option<f64>)> {
        vec![("z_mm", Some(point.z_mm))]
    }

    fn next_runs(
        job: &Job,
        rows: &Rows<DeflectionRun, DeflectionPoint>,
        ranges: Ranges<'_>,
        _monitor: &dyn Monitor,
    ) -> Result<NextRuns<DeflectionRun, DeflectionPoint>, Failure> {
        Ok(next_runs(job, rows, ranges))
    }
}

fn faults_of_rows(job: &Job, rows: &Rows<DeflectionRun, DeflectionPoint>) -> Vec<Finding> {
    let mut faults = Vec::new();
    for (row, (run, point)) in rows.points.iter().enumerate() {
        if *run >= rows.runs.len() {
            faults.push(Finding::new("unknown_run", format!("/measurements/{row}/run")).with("run", *run));
        }
        let of_point = DeflectionCompensation::faults_of_point(job, point);
        faults.extend(of_point.into_iter().map(|fault| fault.under(&format!("/measurements/{row}"))));
    }
    for (k, run) in rows.runs.iter().enumerate() {
        let of_run = DeflectionCompensation::faults_of_run(run);
        faults.extend(of_run.into_iter().map(|fault| fault.under(&format!("/runs/{k}"))));
    }
    faults
}
