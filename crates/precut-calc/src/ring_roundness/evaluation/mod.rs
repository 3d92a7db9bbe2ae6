//! Roundness evaluation: how round is this measured section, about which circle, and what form has the error?
//!
//! The way of a job: `input` -> `check` -> `readings` (points in order, their least-squares circle) ->
//! [`crate::num::roundness`] (circles with proofs, spline, filter, spectrum) -> `assess` -> `output`; `advice` says
//! what dominates and what looks wrong, `picture` draws.

pub(super) mod advice;
pub(super) mod assess;
mod check;
mod columns;
mod header;
mod input;
pub(super) mod instrument;
mod output;
mod picture;
pub(super) mod readings;
mod spikes;

pub use input::{
    FileColumn, InstrumentFile, Job, MAX_POINTS, ReferenceCircle, RoundnessDeviationRow, RoundnessFilter,
    RoundnessPointRow, RoundnessRadiusRow, SpikeTreatment,
};
pub use output::{
    ContactKind, OtherCircle, Outcome, RepairKind, RoundnessCircle, RoundnessCircles, RoundnessContact, RoundnessData,
    RoundnessProfile, RoundnessProof, RoundnessRepair, RoundnessSpectrum, RoundnessSpike,
};

use crate::calculator::{
    Answer, Basis, Calculator, CalculatorKind, Codes, Cost, Example, Failure, Figure, Hallmark, Meta, Monitor, Table,
};

/// The evaluation.
#[derive(Debug, Clone, Copy)]
pub struct RoundnessEvaluation;

impl Calculator for RoundnessEvaluation {
    type Input = Job;
    type Output = Outcome;

    const META: Meta = Meta {
        id: "roundness-evaluation",
        kind: CalculatorKind::Evaluation,
        version: 5,
        title: "Roundness evaluation",
        question: "How round is this measured section, about which circle, and what form has the error?",
        summary: "From measured radii, deviations or points of a round section: the least-squares, minimum-zone, \
                  maximum inscribed and minimum circumscribed circles with the points that they touch and the proof \
                  that none is better, RONt, RONp, RONv and RONq before and after the Gaussian filter, the filtered \
                  profile and the harmonic spectrum, and how far each number is to be trusted.",
        references: &[
            "ISO 12181-1:2011 and ISO 12181-2:2011, Roundness",
            "ISO 16610-21:2011, Linear profile filters: Gaussian filters",
            "ISO 1101:2017, Tolerances of form",
            "Shakarji, Least-squares fitting algorithms of the NIST algorithm testing system, J. Res. NIST 103 (1998) 633-641",
        ],
        examples: &[
            Example {
                id: "turned_ring",
                title: "Ring turned on its own surface: 120 deviations from a roundness tester",
                job: include_str!("examples/turned_ring.json"),
            },
            Example {
                id: "coordinate_points",
                title: "Bore probed at 48 uneven points, with a grain of dirt, against a tolerance",
                job: include_str!("examples/coordinate_points.json"),
            },
            Example {
                id: "waviness",
                title: "Waviness of a ground ring: radii, band pass 15 to 60",
                job: include_str!("examples/waviness.json"),
            },
        ],
        hallmarks: &[
            Hallmark::Of("/nominal_radius_mm"),
            Hallmark::Count("/deviations"),
            Hallmark::Count("/radii"),
            Hallmark::Count("/points"),
            Hallmark::Of("/filter/kind"),
            Hallmark::Of("/filter/cutoff_upr"),
            Hallmark::Of("/tolerance_um"),
        ],
        study_outputs: &[
            "/roundness_um",
            "/filtered/least_squares/ront_um",
            "/filtered/minimum_zone/ront_um",
            "/filtered/least_squares/ronq_um",
        ],
        codes: CODES,
        figures: picture::FIGURE_IDS,
        tables: picture::TABLE_IDS,
        program: None,
    };

    fn fill(job: &mut Job) {
        // At most 200 000 rows.
        job.profile_points.get_or_insert(u32::try_from(readings::count(job)).unwrap_or(u32::MAX));
    }

    #[allow(clippy::cast_precision_loss, reason = "at most 200 000")]
    fn cost(job: &Job) -> Cost {
        let points = readings::count(job);
        let angles = job.profile_points.map_or(points, |angles| usize::try_from(angles).unwrap_or(usize::MAX));
        let driver = match readings::Table::of(job).first() {
            Some(_) if angles > points => "/profile_points",
            Some(readings::Table::Deviations) => "/deviations",
            Some(readings::Table::Points) => "/points",
            Some(readings::Table::File) => "/file",
            Some(readings::Table::Radii) | None => "/radii",
        };
        // Measured: about 0.3 us per point, and as much per place read, of which there are four times the uniform angles.
        let ms = 0.1 + (0.3 * points as f64 + 1.2 * angles as f64) / 1000.0;
        Cost { ms, bytes: 100_000 + 500 * (points as u64 + angles as u64), driver }
    }

    fn run(job: &Job, monitor: &dyn Monitor) -> Result<Answer<Outcome>, Failure> {
        let output = assess::outcome(job, monitor)?;
        let warnings = advice::warnings(job, &output);
        let explanation = advice::explanation(job, &output);
        Ok(Answer { output, warnings, explanation, basis: basis(job) })
    }

    fn figures(_job: &Job, outcome: &Outcome) -> Vec<Figure> {
        picture::figures(outcome)
    }

    fn tables(_job: &Job, outcome: &Outcome) -> Vec<Table> {
        picture::tables(outcome)
    }
}

/// The equations that acted.
fn basis(job: &Job) -> Vec<Basis> {
    let mut used = vec![
        Basis { equation: "roundness/3.1", source: "ISO 12181-1; Euclidean distances" },
        Basis { equation: "roundness/4.1", source: "ISO 1101; Remez exchange" },
        Basis { equation: "roundness/5.1", source: "ISO 12181-1" },
        Basis { equation: "roundness/5.5", source: "ISO 12181-1" },
        Basis { equation: "roundness/6.2", source: "periodic cubic spline" },
        Basis { equation: "roundness/8.1", source: "ISO 12181-1" },
    ];
    if job.filter != (RoundnessFilter::None {}) {
        used.push(Basis { equation: "roundness/7.1", source: "ISO 16610-21" });
    }
    used
}

/// Everything that this calculator may utter, from where it is said.
const CODES: Codes = Codes {
    faults: &[check::CODES],
    failures: &[assess::FAILURE_CODES],
    warnings: &[advice::WARNING_CODES],
    explanations: &[advice::EXPLANATION_CODES],
    stages: &[&["stage_circles", "stage_denser", "stage_done"]],
    labels: &[picture::LABEL_CODES],
};
