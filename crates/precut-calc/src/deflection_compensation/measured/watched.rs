//! What a process that is watched asks of the model.

use crate::calculator::{Failure, JacobianColumn, Limits, Monitor, TellingRun, Watched};
use crate::diameters::{Aim, Tolerance};
use crate::effects::DeflectionEffect;

use crate::deflection_compensation::DeflectionCompensation;
use crate::deflection_compensation::answer::output::Outcome;
use crate::deflection_compensation::job::input::{IncludeMode, Job};
use crate::deflection_compensation::measured::about::About;
use crate::deflection_compensation::measured::consequence::{compensated, corners};
use crate::deflection_compensation::measured::measure::Measure;
use crate::deflection_compensation::measured::prepared::{PreparedDeflection, under};
use crate::deflection_compensation::measured::run::{DeflectionAllowances, DeflectionPoint, DeflectionRun};
use crate::deflection_compensation::model::regime::{Regime, cut_path_m};

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
