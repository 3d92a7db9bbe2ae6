//! The model as a diagnosis needs it: measured places in, predictions out, effects as parameters.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{
    Consequence, Cost, Design, Diagnosable, Example, Failure, Finding, ForwardModel, Hypotheses, Hypothesis,
    JacobianColumn, KnownOver, Limits, Missing, Monitor, NextRun, Prediction, PrepareError, Quantity, Ranges, Rows,
    TellingRun, ToldEffects, Unnamed, Watched, checkpoint, values_by_name, values_of_formula,
};
use crate::diameters::{Aim, Tolerance};
use crate::effects::{Cause, DEFLECTION_CAUSES, DeflectionConditions, DeflectionEffect, ErrorPoint, JointUncertainty};
use crate::num::beam::Profile;
use crate::shaft::places;

use crate::deflection_compensation::DeflectionCompensation;
use crate::deflection_compensation::answer::output::Outcome;
use crate::deflection_compensation::job::acting::{Acting, StructureChange, error_um};
use crate::deflection_compensation::job::check::outside_shaft;
use crate::deflection_compensation::job::grid::{Grid, interpolate};
use crate::deflection_compensation::job::input::{FeedDirection, IncludeMode, Job, Stations, Theory};
use crate::deflection_compensation::job::structure::{Structure, Variant};
use crate::deflection_compensation::measured::consequence::{compensated, consequences, corners, parts_kept};
use crate::deflection_compensation::measured::hypotheses::{
    Experiment, chuck_scale_n_mm_per_rad, design, remainder_name,
};
use crate::deflection_compensation::measured::measurement::DeflectionMeasurement;
use crate::deflection_compensation::measured::next_runs::next_runs;
use crate::deflection_compensation::model::equilibrium::Engagement;
use crate::deflection_compensation::model::regime::{Regime, Step, cut_path_m, passages, section_of_pass};
use crate::deflection_compensation::model::yielding::{Ingredients, Line, Radii, wanted};

const UM_PER_MM: f64 = 1e3;
/// Step of the divided differences in ln F and in the bending scale: truncation 1e-6, round-off 1e-12.
pub(crate) const RELATIVE_STEP: f64 = 1e-3;
/// Step of the divided difference along the shaft, mm.
pub(crate) const GAUGE_STEP_MM: f64 = 0.05;

/// How wrong the base may be without that being a finding: standard deviations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DeflectionAllowances {
    /// Force level common to all runs, as a share.
    #[schema(minimum = 0.0, maximum = 1.0, example = 0.01, extensions(("x-symbol" = json!("u_F")), ("x-unit" = json!("1"))))]
    pub force_level_rel: f64,
    /// Force level of every run by itself, as a share.
    #[schema(minimum = 0.0, maximum = 1.0, example = 0.007, extensions(("x-symbol" = json!("u_Fi")), ("x-unit" = json!("1"))))]
    pub force_per_run_rel: f64,
    /// Bending compliance, as a share; 0.0035 is a diameter known to 0.1 %.
    #[schema(minimum = 0.0, maximum = 1.0, example = 0.0035, extensions(("x-symbol" = json!("u_b")), ("x-unit" = json!("1"))))]
    pub bending_rel: f64,
    /// Setting of the diameter in every run, on the diameter.
    #[schema(minimum = 0.0, maximum = 1000.0, example = 1.0, extensions(("x-symbol" = json!("u_0")), ("x-unit" = json!("um"))))]
    pub setup_diameter_um: f64,
    /// Position of the gauge along the shaft in every run.
    #[schema(minimum = 0.0, maximum = 100.0, example = 0.2, extensions(("x-symbol" = json!("u_z")), ("x-unit" = json!("mm"))))]
    pub gauge_position_mm: f64,
}

impl Default for DeflectionAllowances {
    fn default() -> Self {
        Self {
            force_level_rel: 0.01,
            force_per_run_rel: 0.007,
            bending_rel: 0.003_5,
            setup_diameter_um: 1.0,
            gauge_position_mm: 0.2,
        }
    }
}

/// Conditions of one run; what it leaves out is as in the job.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DeflectionRun {
    /// Nominal depth of cut: sets the stock of every turned segment to d + 2 depth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 100.0, example = 0.5, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("a"))))]
    pub depth_mm: Option<f64>,
    /// Feed per revolution.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.000_1, maximum = 20.0, example = 0.2, extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("S"))))]
    pub feed_mm_per_rev: Option<f64>,
    /// Cutting speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.01, maximum = 20_000.0, example = 120.0, extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("V"))))]
    pub speed_m_per_min: Option<f64>,
    /// Spindle speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.01, maximum = 200_000.0, example = 800.0, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n"))))]
    pub spindle_speed_rpm: Option<f64>,
    /// Which way the tool travelled.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub feed_direction: Option<FeedDirection>,
    /// Path that the edge had cut when the run began.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e6, example = 120.0, extensions(("x-unit" = json!("m")), ("x-symbol" = json!("s"))))]
    pub tool_path_at_start_m: Option<f64>,
    /// Time since the machine was cold when the run began.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e5, example = 15.0, extensions(("x-unit" = json!("min")), ("x-symbol" = json!("tau"))))]
    pub warm_time_at_start_min: Option<f64>,
    /// Path that the tool was told to follow, where it was not the nominal line.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 10_000)]
    pub commanded_path: Vec<CommandedPoint>,
}

/// A vertex of the path that the tool was told to follow; straight between vertices.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CommandedPoint {
    /// Station from the headstock end.
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 500.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("z"))))]
    pub z_mm: f64,
    /// Commanded diameter.
    #[schema(minimum = 0.0, maximum = 10_000.0, example = 89.93, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("X"))))]
    pub diameter_mm: f64,
}

/// Where a diameter was measured.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DeflectionPoint {
    /// Station from the headstock end.
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 500.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("z"))))]
    pub z_mm: f64,
}

/// What the measured value is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Measure {
    DiameterDeviation,
    RadiusDeviation,
    Diameter,
}

pub(crate) const QUANTITIES: &[Quantity] = &[
    Quantity { name: "diameter_deviation_um", unit: "um", logarithmic: false },
    Quantity { name: "radius_deviation_um", unit: "um", logarithmic: false },
    Quantity { name: "diameter_mm", unit: "mm", logarithmic: false },
];

impl Measure {
    /// What rows are asked for.
    pub(crate) fn asked(quantity: &str) -> Result<Self, PrepareError> {
        Self::named(quantity).ok_or_else(|| {
            let known: Vec<&'static str> = QUANTITIES.iter().map(|q| q.name).collect();
            PrepareError::Invalid(vec![
                Finding::new("unknown_quantity", "/quantity")
                    .with("quantity", quantity.to_owned())
                    .with("known", known),
            ])
        })
    }

    fn named(name: &str) -> Option<Self> {
        match name {
            "diameter_deviation_um" => Some(Self::DiameterDeviation),
            "radius_deviation_um" => Some(Self::RadiusDeviation),
            "diameter_mm" => Some(Self::Diameter),
            _ => None,
        }
    }

    /// Of radii that are produced and wanted.
    pub(crate) fn of(self, produced_mm: f64, target_mm: f64) -> f64 {
        match self {
            Self::DiameterDeviation => 2.0 * (produced_mm - target_mm) * UM_PER_MM,
            Self::RadiusDeviation => (produced_mm - target_mm) * UM_PER_MM,
            Self::Diameter => 2.0 * produced_mm,
        }
    }

    /// What a change of the diameter by 1 um makes in the quantity.
    fn per_diameter_um(self) -> f64 {
        match self {
            Self::DiameterDeviation => 1.0,
            Self::RadiusDeviation => 0.5,
            Self::Diameter => 1.0 / UM_PER_MM,
        }
    }
}

/// What no effect parameter changes.
pub struct PreparedDeflection {
    runs: Vec<PreparedRun>,
    rows: usize,
    measure: Measure,
    job: Job,
    conditions_of_runs: Vec<DeflectionRun>,
    /// Run and station of every row.
    places: Vec<(usize, f64)>,
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

struct PreparedRun {
    /// The job under the run's conditions.
    job: Job,
    conditions: DeflectionConditions,
    grid: Grid,
    regime: Regime,
    radii: Radii,
    command_mm: Vec<f64>,
    base_change: StructureChange,
    base_profile: Profile,
    /// Row of every station of the grid.
    row_of_station: Vec<usize>,
}

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
    ) -> Vec<NextRun<DeflectionRun, DeflectionPoint>> {
        next_runs(job, rows, ranges)
    }
}

impl Watched for DeflectionCompensation {
    fn per_diameter_um(quantity: &str) -> f64 {
        let deviates = Measure::named(quantity).filter(|measure| *measure != Measure::Diameter);
        deviates.map_or(0.0, Measure::per_diameter_um)
    }

    fn scatter(
        prepared: &PreparedDeflection,
        effects: &[DeflectionEffect],
        allowances: &DeflectionAllowances,
        monitor: &dyn Monitor,
    ) -> Result<Vec<JacobianColumn>, Failure> {
        let about = About { prepared, effects, monitor };
        about.of_runs(&about.slope(|delta| DeflectionEffect::ForceLevel { delta })?, allowances)
    }

    fn conditions(run: &DeflectionRun) -> Vec<(&'static str, Option<f64>)> {
        vec![("tool_path_at_start_m", run.tool_path_at_start_m), ("warm_time_at_start_min", run.warm_time_at_start_min)]
    }

    fn path_m(run: &DeflectionRun) -> Option<f64> {
        run.tool_path_at_start_m
    }

    fn at_path_m(run: &DeflectionRun, path_m: Option<f64>) -> DeflectionRun {
        DeflectionRun { tool_path_at_start_m: path_m, ..run.clone() }
    }

    fn cut_path_m(job: &Job, run: &DeflectionRun) -> f64 {
        let job = under(job, run);
        cut_path_m(&job, &Regime::of(&job.cut))
    }

    fn telling_runs(job: &Job, run: &DeflectionRun) -> Vec<TellingRun<DeflectionRun>> {
        let turned = job.shaft.segments.iter().map(|own| 0.5 * (own.stock_mm() - own.diameter_mm));
        let depth_mm = run.depth_mm.unwrap_or_else(|| turned.fold(0.0, f64::max));
        // On the nominal path: that of a part is made for its own depth.
        let at = |code, share: f64| TellingRun {
            code,
            condition: ("depth_mm", share * depth_mm),
            run: DeflectionRun { depth_mm: Some(share * depth_mm), commanded_path: Vec::new(), ..run.clone() },
        };
        if depth_mm > 0.0 {
            vec![at("other_depth", 0.5), at("other_depth", 1.5), at("air_cut", 0.02)]
        } else {
            Vec::new()
        }
    }

    fn limits(job: &Job) -> Limits {
        let size = job.tolerance.size();
        Limits { form_um: job.tolerance.form_um, lower_um: size.lower_um, upper_um: size.upper_um }
    }

    fn deciding(job: &Job, run: &DeflectionRun) -> DeflectionRun {
        // A formula may go with any of them.
        let asks = |own: &DeflectionEffect, condition: &str| {
            own.formula().is_some() || own.cause().conditions.contains(&condition)
        };
        let goes_with = |condition: &str| job.effects.iter().any(|own| asks(own, condition));
        let kept = |name: &str, value: Option<f64>| value.filter(|_| goes_with(name));
        DeflectionRun {
            tool_path_at_start_m: kept("tool_path_at_start_m", run.tool_path_at_start_m),
            warm_time_at_start_min: kept("warm_time_at_start_min", run.warm_time_at_start_min),
            commanded_path: Vec::new(),
            ..run.clone()
        }
    }

    fn on_path_of(run: &DeflectionRun, other: &DeflectionRun) -> DeflectionRun {
        DeflectionRun { commanded_path: other.commanded_path.clone(), ..run.clone() }
    }

    fn compensated(job: &Job, run: &DeflectionRun, monitor: &dyn Monitor) -> Result<Option<DeflectionRun>, Failure> {
        let mut job = under(job, run);
        if job.aim == (Aim::Nominal {}) {
            // How sure it is to come out well moves no path.
            job.tolerance = Tolerance::default();
        }
        let path = compensated(&job, run, &[], monitor)?;
        Ok(path.map(|commanded_path| DeflectionRun { commanded_path, ..run.clone() }))
    }

    fn under(job: &Job, run: &DeflectionRun, effects: Vec<DeflectionEffect>) -> Job {
        let mut job = under(job, run);
        // The model that predicts takes the switches as they stand.
        job.include.mode = IncludeMode::AsStated;
        Job { effects, ..job }
    }

    fn point_along(job: &Job, share: f64) -> DeflectionPoint {
        DeflectionPoint { z_mm: share * job.shaft.length_mm() }
    }

    fn commanded(output: &Outcome) -> Option<DeflectionRun> {
        let commanded_path = output.path.as_ref().and_then(corners).filter(|corners| !corners.is_empty())?;
        Some(DeflectionRun { commanded_path, ..DeflectionRun::default() })
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

impl PreparedRun {
    fn of(base: &Job, run: &DeflectionRun, mut places: Vec<(usize, f64)>) -> Result<Self, Failure> {
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

    fn predict(&self, effects: &[DeflectionEffect], measure: Measure, out: &mut [Prediction]) -> Result<(), Failure> {
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
    fn shifted(&self, dz_mm: f64) -> Result<Self, Failure> {
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
fn conditions(base: &Job, run: &DeflectionRun) -> DeflectionConditions {
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
fn under(base: &Job, run: &DeflectionRun) -> Job {
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

fn predict(
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
fn prepared_runs(job: &Job, runs: &[DeflectionRun], places: &[(usize, f64)]) -> Result<Vec<PreparedRun>, Failure> {
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

/// The prediction with effects, and what changes it a little.
struct About<'a> {
    prepared: &'a PreparedDeflection,
    effects: &'a [DeflectionEffect],
    monitor: &'a dyn Monitor,
}

impl About<'_> {
    /// What is off in one run by itself.
    fn of_runs(&self, by_force: &[f64], allowances: &DeflectionAllowances) -> Result<Vec<JacobianColumn>, Failure> {
        let rows = self.prepared.runs.iter().map(|run| run.row_of_station.as_slice());
        let along = self.slope_along()?;
        Ok(columns_of_runs(rows, self.prepared.measure, (by_force, &along), allowances))
    }

    fn predicted(&self, runs: &[PreparedRun], effects: &[DeflectionEffect]) -> Result<Vec<Prediction>, Failure> {
        predict(runs, self.prepared.rows, self.prepared.measure, effects, self.monitor)
    }

    /// What a base that bends without shear leaves out: known, so it is allowed for rather than found.
    /// `None` where the base has it.
    fn neglected_shear(&self) -> Result<Option<JacobianColumn>, Failure> {
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
    fn slope(&self, effect: impl Fn(f64) -> DeflectionEffect) -> Result<Vec<f64>, Failure> {
        let at = |delta: f64| {
            self.predicted(&self.prepared.runs, &[self.effects, std::slice::from_ref(&effect(delta))].concat())
        };
        Ok(difference(&at(-RELATIVE_STEP)?, &at(RELATIVE_STEP)?, 2.0 * RELATIVE_STEP))
    }

    /// Central difference of the prediction along the shaft.
    fn slope_along(&self) -> Result<Vec<f64>, Failure> {
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
