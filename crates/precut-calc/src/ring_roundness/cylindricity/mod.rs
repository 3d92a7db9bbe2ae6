//! Cylindricity evaluation: is this measured cylinder within the drawing, and what makes its deviation?
//!
//! The way of a job: `input` -> `check` -> `sections` (points by height) -> `assess` (each section by
//! [`super::evaluation`], square to the axis; cylinders with proofs by [`crate::num::cylinder`]) -> `output`; `form` takes
//! parts out of the sections, `advice` says what dominates and what is kept, `picture` draws.

// Sections and points are far fewer than 2^53.
#![allow(clippy::cast_precision_loss)]

mod advice;
mod assess;
mod check;
mod form;
mod input;
mod output;
mod picture;
mod sections;

pub use input::{
    CylinderDeviationRow, CylinderFile, CylinderPointRow, CylinderRadiusRow, DatumSection, Job, SectionHeight,
};
pub use output::{
    CylinderAxis, CylinderContact, CylinderData, CylinderPart, CylinderProof, CylinderRequirement, CylinderSection,
    CylinderSurface, CylinderTaper, CylinderVerdict, Outcome, PartKind, ReferenceCylinder, ReferenceCylinders,
    RequirementKind,
};

use crate::calculator::{
    Answer, Basis, Calculator, CalculatorKind, Codes, Cost, Example, Failure, Figure, Hallmark, Meta, Monitor, Table,
};
use crate::ring_roundness::evaluation::RoundnessFilter;

/// The evaluation.
#[derive(Debug, Clone, Copy)]
pub struct CylindricityEvaluation;

impl Calculator for CylindricityEvaluation {
    type Input = Job;
    type Output = Outcome;

    const META: Meta = Meta {
        id: "cylindricity-evaluation",
        kind: CalculatorKind::Evaluation,
        version: 1,
        title: "Cylindricity evaluation",
        question: "Is this measured cylinder within the drawing, and what makes its deviation?",
        summary: "From points, radii or deviations measured in two or more sections: the least-squares, minimum-zone, \
                  maximum inscribed and minimum circumscribed cylinders with a bound on how much better any other could \
                  be, CYLt, RONt of every section, straightness of the axis, coaxiality to a datum axis, taper and \
                  barrel, what is left when each part is taken out, and for each tolerance of the drawing whether it is \
                  kept, with the uncertainty.",
        references: &[
            "ISO 12180-1:2011 and ISO 12180-2:2011, Cylindricity",
            "ISO 12181-1:2011 and ISO 12181-2:2011, Roundness",
            "ISO 1101:2017, Tolerances of form, orientation, location and run-out",
            "ISO 14253-1:2017, Decision rules for verifying conformity or nonconformity with specifications",
            "Shakarji, Least-squares fitting algorithms of the NIST algorithm testing system, J. Res. NIST 103 (1998) 633-641",
        ],
        examples: &[
            Example {
                id: "bearing_seat",
                title: "Ground bearing seat: five sections from a roundness tester, against a drawing",
                job: include_str!("examples/bearing_seat.json"),
            },
            Example {
                id: "probed_bore",
                title: "Bore probed by a coordinate machine: four sections, inclined, coaxiality of the inner two",
                job: include_str!("examples/probed_bore.json"),
            },
        ],
        hallmarks: &[
            Hallmark::Of("/nominal_radius_mm"),
            Hallmark::Count("/points"),
            Hallmark::Count("/deviations"),
            Hallmark::Of("/cylindricity_tolerance_um"),
            Hallmark::Of("/filter/cutoff_upr"),
        ],
        study_outputs: &["/cylindricity_um", "/roundness_um", "/axis/straightness_um", "/taper/diameter_change_um"],
        codes: CODES,
        figures: picture::FIGURE_IDS,
        tables: picture::TABLE_IDS,
        program: None,
    };

    fn fill(_job: &mut Job) {}

    #[allow(clippy::cast_precision_loss, reason = "at most some millions of lines")]
    fn cost(job: &Job) -> Cost {
        let points = sections::count(job);
        let driver = match sections::Table::of(job).first() {
            Some(sections::Table::Radii) => "/radii",
            Some(sections::Table::Deviations) => "/deviations",
            Some(sections::Table::File) => "/file",
            Some(sections::Table::Points) | None => "/points",
        };
        Cost { ms: 20.0 + 0.03 * points as f64, bytes: 2_000_000 + 1_000 * points as u64, driver }
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
        Basis { equation: "cylindricity/2.1", source: "Euclidean distances from a line" },
        Basis { equation: "cylindricity/3.1", source: "ISO 12180-1; Gauss-Newton" },
        Basis { equation: "cylindricity/4.1", source: "ISO 1101; linear programmes" },
        Basis { equation: "cylindricity/5.3", source: "linear bound and curvature" },
        Basis { equation: "cylindricity/6.1", source: "ISO 1101: straightness of a median line" },
        Basis { equation: "cylindricity/8.1", source: "ISO 14253-1" },
    ];
    if job.filter != (RoundnessFilter::None {}) {
        used.push(Basis { equation: "roundness/7.1", source: "ISO 16610-21" });
    }
    used
}

/// Everything that this calculator may utter, from where it is said.
const CODES: Codes = Codes {
    faults: &[check::CODES, check::SECTION_CODES],
    failures: &[assess::FAILURE_CODES],
    warnings: &[advice::WARNING_CODES],
    explanations: &[advice::EXPLANATION_CODES],
    stages: &[&["stage_sections", "stage_cylinders", "stage_parts", "stage_done"]],
    labels: &[picture::LABEL_CODES],
};
