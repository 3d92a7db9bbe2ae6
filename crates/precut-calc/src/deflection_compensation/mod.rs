//! Deflection compensation: where must the tool go so that the slender shaft comes out straight?
//!
//! A shaft held in centres, chuck and rests yields under the passive force. The gap between work and
//! tool opens by y, the depth really cut falls short, and the shaft comes out as a barrel, a saddle or
//! something between. The model: compliance W(z) at the cutting point by the force method
//! ([`crate::num::beam`]), forces over the *engaged* depth ([`crate::force`]), and the scalar
//! equilibrium at every station (`equilibrium`). The compensated command is explicit, because the
//! wanted state has the nominal depth; the prediction for any command is implicit.
//!
//! The way of a job: `job` (`input` -> `check` -> `grid`: stations, `acting`: effects, `structure`: beam) -> `model`
//! (`yielding`: opening over depth -> `cut` -> `stage`: passes, `chords`) -> `answer` (`driven`: `toolpath` and what it
//! gives and meets; `advice`, `output`, `picture`). `measured` gives the same model to the diagnosis, `model/held` to a
//! program that is there.

mod answer;
mod job;
mod measured;
mod model;

pub use crate::diameters::{
    Aim, DeflectionCorrelation, DeflectionQuantity, DeflectionUncertainQuantity, GaugeUncertainty, Tolerance,
    Uncertainty,
};
pub use answer::auto::Automatic;
pub use answer::output::{
    AddedSupport, ErrorFan, OneMoreRest, OneStep, Outcome, PassOutcome, Path, PathZone, SecondOrder, Shares,
    StationColumns, StatusCompensated, StatusUncompensated,
};
pub(crate) use job::check::EFFECT_CODES;
pub(crate) use job::encounters::{Reach, chuck_in_the_way, met};
pub use job::input::{
    Carriage, Cut, Detail, FeedDirection, Gravity, Include, IncludeMode, Job, Limits, MAX_STATIONS, Pass, PathSettings,
    ProgramSettings, ProgramZero, SafePosition, Section, Segment, Shaft, SpeedDiameter, Stations, StockRow, Support,
    Theory,
};
pub(crate) use measured::about::{GAUGE_STEP_MM, RELATIVE_STEP, columns_of_runs, difference};
pub(crate) use measured::measure::{Measure, QUANTITIES};
pub use measured::measurement::DeflectionMeasurement;
pub(crate) use measured::measurement::{first, measured_diameters};
pub(crate) use measured::next_runs::longest_run;
pub use measured::prepared::PreparedDeflection;
pub use measured::run::{DeflectionAllowances, DeflectionPoint, DeflectionRun};
pub(crate) use model::equilibrium::{Opening, engage};
pub use model::form::{Deviation, Extremum, ExtremumKind, Form, FormClass};
pub(crate) use model::held::{Gaps, Held, Holding, Planned, Push, Slice, ToolPlace};

use crate::calculator::{
    Answer, Basis, Calculator, CalculatorKind, Codes, Cost, Example, Failure, Figure, Hallmark, Message, Meta, Monitor,
    Program, ProgramOrigin, Table,
};
use crate::certainty;
use crate::diameters;
use crate::force;
use crate::shaft::places;
use crate::turning::Proof;

use answer::advice::SeenAlong;
use answer::aimed::{Sure, aimed};
use answer::columns::{Errors, columns, uncertainty_um};
use answer::driven::Driven;
use answer::other_cuts::improvements;
use job::acting::Acting;
use job::grid::{Grid, path_station_count, station_count};
use model::cut::one_step;
use model::stage::{Stage, all_cuts, in_reach};

const UM_PER_MM: f64 = 1e3;

/// The calculator.
#[derive(Debug, Clone, Copy)]
pub struct DeflectionCompensation;

impl Calculator for DeflectionCompensation {
    type Input = Job;
    type Output = Outcome;

    const META: Meta = Meta {
        id: "deflection-compensation",
        kind: CalculatorKind::Calculator,
        version: 13,
        title: "Deflection compensation",
        question: "Where must the tool go so that the slender shaft comes out straight?",
        summary: "A slender shaft bends away from the tool, so less is cut than commanded. From shaft, supports, \
                  force law and regime: the diameter along the shaft if the tool follows the nominal line, the path \
                  that gives the drawing's diameter, the diameter with that path as programmed, what dominates, and \
                  how sure all this is.",
        references: &[
            "Pegashkin, Starostin, Bulletin of the South Ural State University, Mechanical Engineering, 2018, vol. 18 no. 1, pp. 51-57",
            "Kosilova, Meshcheryakov (eds.), Handbook of the process engineer, vol. 2, 4th ed., 1985, tables 22 and 23",
            "Cowper, The shear coefficient in Timoshenko's beam theory, J. Appl. Mech. 33 (1966) 335-340",
        ],
        examples: &[
            Example {
                id: "paper",
                title: "A shaft of 90 x 2000 mm that comes out 0.1 mm thick in the middle",
                job: include_str!("examples/paper.json"),
            },
            Example {
                id: "stepped_with_rest",
                title: "A stepped shaft in a steady rest: 77 µm too thick, and 2 µm along the compensated path",
                job: include_str!("examples/stepped_with_rest.json"),
            },
            Example {
                id: "chuck_and_tailstock",
                title: "A hollow shaft in a chuck: a worn tool and a soft tailstock make it 33 µm too thick",
                job: include_str!("examples/chuck_and_tailstock.json"),
            },
            Example {
                id: "two_passes",
                title: "A crooked blank: how much of it is left after roughing and finishing",
                job: include_str!("examples/two_passes.json"),
            },
        ],
        hallmarks: &[
            Hallmark::Of("/shaft/segments/*/diameter_mm"),
            Hallmark::Sum("/shaft/segments/*/length_mm"),
            Hallmark::Of("/cut/feed_mm_per_rev"),
            Hallmark::Of("/cut/speed_m_per_min"),
            Hallmark::Of("/cut/spindle_speed_rpm"),
            Hallmark::Of("/tolerance/form_um"),
        ],
        study_outputs: &[
            "/form_error_um",
            "/form_error_after_um",
            "/largest_error_um",
            "/cutting_time_min",
            "/conformance/joint/probability",
        ],
        codes: CODES,
        figures: answer::picture::FIGURE_IDS,
        tables: answer::picture::TABLE_IDS,
        program: Some(ProgramOrigin::Made),
    };

    fn fill(job: &mut Job) {
        job.shaft.fill();
        let ends_mm = job.shaft.ends_mm();
        for support in &mut job.supports {
            support.fill(&ends_mm);
        }
        if let Stations::List { z_mm } = &mut job.stations {
            for z in z_mm {
                *z = places::settled(*z, &ends_mm);
            }
        }
        job.path.chord_tolerance_um = Some(model::chords::chord_tolerance_um(job));
        job.force.fill();
    }

    fn cost(job: &Job) -> Cost {
        let full = job.detail == Detail::Full;
        let stations = (station_count(job) + if full { path_station_count(job) } else { 0 }) as f64;
        let passes = job.passes.len().max(1) as f64;
        // Measured: about 0.3 us per station and cut; each rest that opens and closes solves a contact problem anew.
        let contacts = job.supports.iter().filter(|s| !s.carries()).count() as f64;
        let tried = (answer::auto::SAMPLES * answer::auto::cuts_tried(job)) as f64;
        // Parts are cut again: some 10,000 of them, measured.
        let sure = if full && !job.tolerance.is_none() { 40_000.0 * passes * (1.0 + contacts) } else { 0.0 };
        let us = (stations * (passes + 1.0) + tried) * (0.5 + 1.5 * contacts) + sure;
        let bytes = 100_000 + station_count(job) as u64 * (400 + 80 * job.passes.len() as u64);
        let driver = match job.stations {
            Stations::PerZone { .. } => "/stations/count",
            Stations::List { .. } => "/stations/z_mm",
        };
        Cost { ms: 0.05 + us / 1000.0, bytes, driver }
    }

    fn run(job: &Job, monitor: &dyn Monitor) -> Result<Answer<Outcome>, Failure> {
        run(job, monitor)
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
}

/// Bound of the relative round-off of the compliance (`deflection/3.3`).
const COMPLIANCE_ACCURACY: f64 = 1e-9;

fn run(job: &Job, monitor: &dyn Monitor) -> Result<Answer<Outcome>, Failure> {
    crate::calculator::checkpoint(monitor)?;
    let asked = job;
    let (job, included_automatically) = answer::auto::settled(asked, monitor)?;
    let job = &*job;
    let grid = Grid::of(job);
    let acting = Acting::of(&job.effects, &job.conditions, job.cut.feed_direction);
    let mut of_passes = Vec::new();
    let mut look =
        |grid: &Grid, stage: &Stage, number: usize| of_passes.extend(answer::advice::of_pass(job, grid, stage, number));
    let (stage, passes, driven) = match job.detail {
        Detail::Profile => {
            let (mut stage, passes) = all_cuts(job, &grid, &acting, &mut look, monitor)?;
            // What needs probabilities is left for the full answer.
            let middle_um = job.tolerance.size().middle_um().filter(|_| job.aim == (Aim::Middle {}));
            let aim_um = middle_um.unwrap_or(0.0);
            stage.cut.aim(0.5 * aim_um / UM_PER_MM);
            (stage, passes, None)
        }
        Detail::Full => {
            let (aimed, sure) = aimed(job, &grid, &acting, &mut look, monitor)?;
            let Driven { stage, passes, path, produced_mm, after, drawn, proof, .. } = aimed;
            (stage, passes, Some(Along { path, produced_mm, after, drawn, proof, sure }))
        }
    };
    in_reach(&stage)?;
    monitor.progress(0.8, Message::new("stage_advice"));
    let errors = Errors::of(&stage, driven.as_ref().map(|driven| driven.produced_mm.as_slice()));
    let mut sure = Sure::default();
    let (drawn, driven) = driven
        .map(|along| {
            sure = along.sure;
            (along.drawn, (along.path, along.after, along.proof))
        })
        .unzip();
    let mut outcome = Assembly { asked, job, grid: &grid, acting: &acting, stage: &stage }
        .outcome(driven, passes, &errors, monitor)?;
    outcome.included_automatically = included_automatically;
    if let Some(conformance) = &mut sure.conformance {
        conformance.advise(improvements(asked, &conformance.joint, outcome.one_more_rest.as_ref(), monitor)?);
    }
    (outcome.aim_shift_um, outcome.conformance, outcome.error_fan) = (sure.aim_um, sure.conformance, sure.fan);
    let uncertainty_um = uncertainty_um(job, &grid, &acting, &stage)?;
    let drawn = drawn.flatten();
    let warnings = answer::advice::warnings(job, &grid, &acting, &stage, &outcome, drawn.as_ref(), &uncertainty_um);
    let warnings = answer::advice::with_earlier(warnings, of_passes);
    let seen_along = SeenAlong::of(&stage, &outcome.shares, &uncertainty_um);
    outcome.stations = columns(job, grid.z_mm, stage, errors, uncertainty_um);
    let explanation = answer::advice::explanation(job, &outcome, &seen_along);
    monitor.progress(1.0, Message::new("stage_done"));
    Ok(Answer { output: outcome, warnings, explanation, basis: basis(job) })
}

/// What is known of the program's path beside the cut at the stations of the answer.
struct Along {
    path: Path,
    produced_mm: Vec<Option<f64>>,
    after: Form,
    drawn: Option<answer::toolpath::Drawn>,
    proof: Option<Proof>,
    sure: Sure,
}

/// What an outcome is put together from.
struct Assembly<'a> {
    /// The job as it was asked, with the switches that it leaves open.
    asked: &'a Job,
    job: &'a Job,
    grid: &'a Grid,
    acting: &'a Acting,
    stage: &'a Stage,
}

impl Assembly<'_> {
    /// All but the columns: they take over the arrays of the stage once nobody asks it any more.
    fn outcome(
        &self,
        driven: Option<(Path, Form, Option<Proof>)>,
        passes: Vec<PassOutcome>,
        errors: &Errors,
        monitor: &dyn Monitor,
    ) -> Result<Outcome, Failure> {
        let Self { asked, job, grid, acting, stage } = *self;
        let full = job.detail == Detail::Full;
        let before = Form::of(&grid.z_mm, &errors.uncompensated_um);
        let (path, after, proof) = match driven {
            Some((path, after, proof)) => (Some(path), Some(after), proof),
            None => (None, None, None),
        };
        let most_deflected = answer::advice::most_deflected(stage);
        let largest_mm = model::yielding::at(&stage.cut.y_mm, most_deflected).abs();
        Ok(Outcome {
            form_error_um: before.form_error_um,
            form_error_after_um: after.as_ref().and_then(|form| form.form_error_um),
            largest_error_um: largest(&before),
            largest_error_after_um: after.as_ref().and_then(largest),
            cutting_time_min: model::regime::cutting_time_min(job, &stage.regime, &stage.step),
            before,
            after,
            path,
            proof,
            shares: answer::advice::shares(job, grid, acting, stage, most_deflected)?,
            second_order: if full { Some(model::second_order::second_order(job, grid, acting, stage)?) } else { None },
            one_more_rest: if full {
                answer::advice::one_more_rest(asked, grid, acting, stage, monitor)?
            } else {
                None
            },
            included_automatically: Vec::new(),
            aim_shift_um: 0.0,
            conformance: None,
            error_fan: None,
            critical_speed_rpm: if full { model::soundness::critical_speed_rpm(job, stage)? } else { None },
            one_step: (full && job.compare_one_step && !stage.line.has_contacts())
                .then(|| one_step(&stage.line, &stage.radii, &stage.cut, job.force.depth_exponent())),
            passes,
            numerical_error_um: 2.0 * (stage.cut.residual_mm + COMPLIANCE_ACCURACY * largest_mm) * UM_PER_MM,
            stations: StationColumns::default(),
        })
    }
}

fn largest(form: &Form) -> Option<f64> {
    form.form_error_um?;
    Some(form.farthest()?.diameter_error_um)
}

/// The equations that acted.
fn basis(job: &Job) -> Vec<Basis> {
    const PAPER: &str = "Pegashkin, Starostin 2018, corrected";
    let mut used = vec![
        Basis { equation: "deflection/3.2", source: "force method, Euler-Bernoulli or Timoshenko beam" },
        Basis { equation: "deflection/4.1", source: "equilibrium at the engaged depth" },
        Basis { equation: "deflection/4.3", source: PAPER },
        Basis { equation: "deflection/4.4", source: "copying of the previous surface" },
    ];
    used.extend(job.force.basis());
    used.extend(
        job.effects.iter().map(|effect| Basis { equation: effect.cause().equation, source: "catalogue of effects" }),
    );
    used
}

/// Everything that this calculator may utter, from where it is said.
const CODES: Codes = Codes {
    faults: &[
        job::check::CODES,
        job::check::EFFECT_CODES,
        diameters::CODES,
        certainty::DISTRIBUTION_CODES,
        certainty::QUANTITY_CODES,
        certainty::open::CODES,
        crate::shaft::check::CODES,
        force::FAULT_CODES,
    ],
    failures: &[
        &[
            "path_incomplete",
            "path_not_computed",
            "pass_without_command",
            "numbers_out_of_reach",
            "tool_hits_chuck",
            "formula_without_value",
        ],
        Proof::CODES,
        force::FAILURE_CODES,
    ],
    warnings: &[
        answer::advice::WARNING_CODES,
        diameters::WARNING_CODES,
        model::soundness::WARNING_CODES,
        model::second_order::WARNING_CODES,
        force::WARNING_CODES,
    ],
    explanations: &[answer::advice::EXPLANATION_CODES, diameters::EXPLANATION_CODES, diameters::OTHER_CUTS_CODES],
    stages: &[&["stage_pass", "stage_advice", "stage_done"]],
    labels: &[
        answer::picture::LABEL_CODES,
        diameters::DOUBT_LABELS,
        certainty::picture::LABEL_CODES,
        crate::shaft::handles::LABEL_CODES,
    ],
};
