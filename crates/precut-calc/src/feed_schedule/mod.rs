//! Feed schedules: which feed and speed in which zone is fastest, cheapest or best within all limits?
//!
//! A shaft of varying stiffness is turned zone by zone. Tool life, roughness, hardening and forces are power laws of
//! speed, feed and depth, or linear in their logarithms ([`crate::machinability`]); the deflection is the beam's
//! compliance times the passive force ([`crate::num::beam`]). In ln V and ln S all limits are convex: a geometric
//! program ([`crate::num::gp`]), solved to a certificate, with the price of every limit as its multiplier. A conflict
//! is answered with a smallest set of limits that conflict and the least relaxation.
//!
//! The way of a job: `job` (`input`, `models`, `plan` -> `check`, `effects` -> `case`: zones with compliances and acting
//! models) -> `model` (`program`: rows and sums with names -> `solve`: once, over whole parts per edge, or by successive
//! linearisation, or `infeasible` -> `assess`, `binding`) -> `answer` (`run`: comparison, trade-off -> `output`,
//! `picture`, `toolpath`, `advice`). In `model`, `rule` is the source paper's method; `continuous` finds zones; `passes`
//! finds the split into passes; `compensated` asks the deflection calculator for the path. `measured` gives the models to
//! the diagnosis. `fit` fits the models to trials.

mod answer;
pub mod fit;
mod job;
mod measured;
mod model;

pub use answer::output::{
    Binding, Certificate, ChangePlace, Comparison, CompensatedPath, ConstantFeed, Continuous, EdgeUse, EqualDeflection,
    Looser, NamedValue, NextWhole, Outcome, PassTrial, PassesOutcome, PathOfZone, Price, PriceBasis,
    ScheduleConformance, ScheduledLimitKept, SegmentTime, Solver, SurfaceUsage, ToolChange, TradePoint, ZoneOutcome,
};
pub use job::input::{
    Coupling, CouplingTerm, CustomLimit, FeedMode, Goal, Job, Limits, MAX_ZONES, Machine, Reference, SpeedMode,
    UsageScope, Variables, Zone,
};
pub use job::models::{FurtherModel, Models, Output};
pub use job::open::ScheduleUncertainty;
pub use job::plan::{Compensation, EqualTarget, Method, PassPlan, TradeOff, TradedLimit};
pub use measured::forward::{MachinabilityAllowances, MachinabilityPoint, MachinabilityRun};
pub use measured::measurement::MachinabilityMeasurement;
pub use model::risk::Risk;
pub(crate) use model::stretches;

use crate::calculator::{
    Answer, Calculator, CalculatorKind, Codes, Cost, Example, Failure, Figure, Hallmark, Meta, Monitor, Place, Program,
    ProgramOrigin, Table,
};
use crate::certainty::open;
use crate::shaft::places;
use crate::{force, shaft};

/// The geometric program of a checked and filled job, as its solver gets it: for other solvers and for measurements.
/// Models that bend stand in it as their tangents at the middle of the bounds.
pub fn geometric_program(job: &Job) -> Result<crate::num::gp::Program, Failure> {
    let held = job::compliance::Held::of(job)?;
    let case = job::case::Case::of(job, held.as_ref(), None)?;
    Ok(model::program::build(&case, &model::program::Variation::default()).program)
}

/// Largest compliance of every zone by the beam, um/N; empty without a shaft.
pub fn zone_compliances(job: &Job) -> Result<Vec<f64>, Failure> {
    let stretches: Vec<(f64, f64)> = job.zones.iter().map(|zone| (zone.z_start_mm, zone.z_end_mm)).collect();
    Ok(job::compliance::Held::of(job)?.map(|held| held.largest(&stretches)).unwrap_or_default())
}

/// The calculator.
#[derive(Debug, Clone, Copy)]
pub struct FeedSchedule;

impl Calculator for FeedSchedule {
    type Input = Job;
    type Output = Outcome;

    const META: Meta = Meta {
        id: "feed-schedule",
        kind: CalculatorKind::Calculator,
        version: 10,
        title: "Feed schedule",
        question: "Which feed and speed in which zone: fastest within tolerance, roughness, tool life and power?",
        summary: "From a shaft in its supports, models of force, tool life and surface, and limits: feed and speed of \
                  every zone for least time, least cost or best surface, proven optimal, with the price of every limit \
                  that binds; or, where limits conflict, which ones and by how little they must give.",
        references: &[
            "Study of the influence of cutting conditions on accuracy and surface layer: turning of gas-turbine shafts of variable stiffness (equal deflection by zone)",
            "Ermer, Optimization of the constrained machining economics problem by geometric programming, J. Eng. Ind. 93 (1971) 1067-1072",
            "Mehrotra, On the implementation of a primal-dual interior point method, SIAM J. Optim. 2 (1992) 575-601",
            "Boyd, Kim, Vandenberghe, Hassibi, A tutorial on geometric programming, Optim. Eng. 8 (2007) 67-127",
        ],
        examples: &[
            Example {
                id: "paper",
                title: "A titanium shaft in six zones: 29 % less time than with the best single feed",
                job: include_str!("examples/paper.json"),
            },
            Example {
                id: "equal_deflection",
                title: "The rule of equal deflection on that shaft: 86 % more time than one feed",
                job: include_str!("examples/equal_deflection.json"),
            },
            Example {
                id: "compensated",
                title: "The path takes the deflection out, so the feed may rise; every edge serves whole parts",
                job: include_str!("examples/compensated.json"),
            },
            Example {
                id: "zones_found",
                title: "Where to change the feed: the fewest zones within one percent of the best",
                job: include_str!("examples/zones_found.json"),
            },
            Example {
                id: "passes",
                title: "How many passes, and how deep the last one, for least cost",
                job: include_str!("examples/passes.json"),
            },
        ],
        hallmarks: &[
            Hallmark::Of("/shaft/segments/*/diameter_mm"),
            Hallmark::Sum("/shaft/segments/*/length_mm"),
            Hallmark::Count("/zones"),
            Hallmark::Of("/zones/*/depth_mm"),
            Hallmark::Of("/zones/*/deflection_max_um"),
            Hallmark::Of("/zones/*/roughness_max_um"),
        ],
        study_outputs: &["/objective", "/cutting_time_min", "/tool_usage", "/largest_deflection_um"],
        codes: CODES,
        figures: answer::picture::FIGURE_IDS,
        tables: answer::picture::TABLE_IDS,
        program: Some(ProgramOrigin::Made),
    };

    fn fill(job: &mut Job) {
        let mut ends_mm = Vec::new();
        if let Some(shaft) = &mut job.shaft {
            shaft.fill();
            ends_mm = shaft.ends_mm();
        }
        for support in &mut job.supports {
            support.fill(&ends_mm);
        }
        for zone in &mut job.zones {
            let settled = [zone.z_start_mm, zone.z_end_mm].map(|z_mm| places::settled(z_mm, &ends_mm));
            // A zone so short that both its ends are one end of a segment stays as it is: nothing of it would be left.
            if settled[0] < settled[1] {
                [zone.z_start_mm, zone.z_end_mm] = settled;
            }
        }
        if let Some(force) = &mut job.force {
            force.fill();
        }
        let force = job.force.clone();
        job::effects::fill(job);
        job.models.fill(force.as_ref());
    }

    fn cost(job: &Job) -> Cost {
        let zones = job.zones.len() as f64;
        // Measured: about 7 us per zone and solve, twice for the comparison.
        let mut ms = 0.1 + 0.03 * zones;
        if let Some(plan) = &job.passes {
            ms += 0.03 * zones * 55.0 * f64::from(plan.roughing_passes_max + 1);
        }
        if let Some(wanted) = &job.trade_off {
            ms += 0.015 * zones * f64::from(wanted.count);
        }
        if let Some(wanted) = &job.compensation {
            ms += zones * (0.2 + 0.004 * f64::from(wanted.stations_per_zone));
        }
        let mut driver = "/zones";
        if let Method::Continuous { grid_points, segments_max, feed_gradient_per_mm, .. } = &job.method {
            let (points, segments) = (f64::from(*grid_points), f64::from(*segments_max));
            ms += points * points * segments * 1e-6 + points * 0.05 + segments * segments * 0.02;
            // Every point of a trade-off has a continuous schedule of its own.
            if let (Some(wanted), Some(_)) = (&job.trade_off, feed_gradient_per_mm) {
                ms += points * 0.05 * f64::from(wanted.count);
            }
            driver = "/method/grid_points";
        }
        if !job.effects.is_empty() {
            ms *= 20.0;
        }
        if job.limits.as_ref().is_some_and(|limits| limits.whole_parts_per_edge) {
            ms *= 10.0;
        }
        ms *= match job.risk {
            Risk::None {} | Risk::Each { .. } => 1.0,
            Risk::Joint { .. } => 600.0,
            Risk::LeastCost { .. } => 12_000.0,
        };
        if job.limits.as_ref().is_some_and(|limits| limits.whole_edges) {
            ms *= model::whole::programs(job.zones.len()) as f64 / 8.0;
        }
        Cost { ms, bytes: 1_000_000 + job.zones.len() as u64 * 20_000, driver }
    }

    fn run(job: &Job, monitor: &dyn Monitor) -> Result<Answer<Outcome>, Failure> {
        answer::run::run(job, monitor)
    }

    fn figures(job: &Job, outcome: &Outcome) -> Vec<Figure> {
        answer::picture::figures(job, outcome)
    }

    fn tables(job: &Job, outcome: &Outcome) -> Vec<Table> {
        answer::picture::tables(job, outcome)
    }

    fn program(job: &Job, outcome: &Outcome) -> Option<Result<Program, Failure>> {
        Some(answer::toolpath::program(job, outcome))
    }

    fn at_place(job: &Job, _outcome: &Outcome, place: &Place<'_>) -> Option<Job> {
        answer::picture::at_place(job, place)
    }
}

/// Everything that this calculator may utter, from where it is said.
const CODES: Codes = Codes {
    faults: &[
        job::check::CODES,
        model::risk::CODES,
        job::effects::CODES,
        open::CODES,
        measured::forward::CODES,
        shaft::check::CODES,
        force::FAULT_CODES,
    ],
    failures: &[
        &[
            "no_zones",
            "nothing_bends",
            "schedule_out_of_reach",
            "infeasible_schedule",
            "no_pass_split",
            "too_few_segments",
            "gradient_with_bending_model",
            "zone_off_drawing",
            "zone_off_blank",
            "tool_hits_chuck",
        ],
        crate::turning::Proof::CODES,
        model::risk::FAILURE_CODES,
    ],
    warnings: &[answer::advice::WARNING_CODES],
    explanations: &[answer::advice::EXPLANATION_CODES],
    stages: &[&["stage_passes", "stage_continuous", "stage_segments", "stage_comparison", "stage_path", "stage_done"]],
    labels: &[answer::picture::LABEL_CODES, crate::shaft::handles::LABEL_CODES],
};
