//! Modes of tool or workpiece from measured frequency responses (`receptance`).
//!
//! The way of a job: `input` -> `check` -> `reader` (CSV and universal files) -> `model` (poles, which of them are modes, least
//! squares in the quantity measured) -> `output`; `advice` says what it means, `picture` draws.

mod advice;
mod check;
mod input;
mod model;
mod output;
mod picture;
mod reader;

pub(crate) use advice::{WARNING_CODES, warnings};
pub(crate) use check::check_at;
pub use input::{Direction, Job, MAX_FILES, MAX_MODES, ReceptanceFile, Residuals, Unit};
pub use output::{CurveRow, FittedBand, FittedFunction, FittedGroup, FittedMode, ModeCertainty, Outcome};
pub use reader::{Function, LEAST_LINES, MOST_LINES, read};

use crate::calculator::{
    Answer, Basis, Calculator, CalculatorKind, Codes, Cost, Example, Failure, Figure, Finding, Hallmark, Message, Meta,
    Monitor, Table, checkpoint,
};

use model::{Chosen, Group, Lines, Unfit};

/// um/N in a m/N.
const UM_PER_M: f64 = 1e6;
const MM_PER_M: f64 = 1e3;
/// Parts of the band in which it is told what is left.
const PARTS: usize = 8;
/// Bytes of a line of a file, about.
const BYTES_OF_LINE: usize = 30;
/// Modes that are counted on where the job states none.
const USUAL_MODES: f64 = 3.0;

/// The evaluation.
#[derive(Debug, Clone, Copy)]
pub struct ReceptanceFit;

impl Calculator for ReceptanceFit {
    type Input = Job;
    type Output = Outcome;

    const META: Meta = Meta {
        id: "receptance-fit",
        kind: CalculatorKind::Evaluation,
        version: 1,
        title: "Modes from frequency responses",
        question: "Which natural frequencies, dampings and masses does my tap test show, and how well does it know them?",
        summary: "From measured frequency responses at the cut, as CSV or as universal files (datasets 58 and 58b), displacement, \
                  velocity or acceleration over force in one direction or several: modes with their standard errors, as a job of \
                  milling takes them, how many the lines ask for, what they leave line by line, and whether real modes suffice. \
                  Least-squares complex frequency, then least squares in the quantity measured.",
        references: &[
            "Guillaume, Verboven, Vanlanduit, Frequency-domain maximum likelihood identification of modal parameters, ISMA 1998",
            "Peeters, Van der Auweraer, Guillaume, Leuridan, The PolyMAX frequency-domain method, Shock and Vibration 11 (2004) 395-409",
            "Schwarz, Estimating the dimension of a model, Annals of Statistics 6 (1978) 461-464",
            "Universal dataset number 58, Structural Dynamics Research Laboratory, University of Cincinnati",
        ],
        examples: &[
            Example {
                id: "tap_test",
                title: "End mill struck along the feed: displacement over force, two modes",
                job: include_str!("examples/tap_test.json"),
            },
            Example {
                id: "two_directions",
                title: "Universal file with binary sets: acceleration over force along and across the feed",
                job: include_str!("examples/two_directions.json"),
            },
        ],
        hallmarks: &[Hallmark::Count("/files"), Hallmark::Of("/residuals")],
        study_outputs: &["/modes/0/frequency_hz", "/modes/0/damping_ratio", "/modes/0/mass_kg"],
        codes: CODES,
        figures: picture::FIGURE_IDS,
        tables: picture::TABLE_IDS,
        program: None,
    };

    fn fill(_job: &mut Job) {}

    fn cost(job: &Job) -> Cost {
        let bytes: usize =
            job.files.iter().map(|file| file.text.as_ref().or(file.base64.as_ref()).map_or(0, String::len)).sum();
        // Measured: some 1.6 us a line with two modes, as the square of the modes with many. Lines are far fewer than 2^53.
        #[allow(clippy::cast_precision_loss)]
        let lines = (bytes / BYTES_OF_LINE) as f64;
        let modes = job.modes.map_or(USUAL_MODES, f64::from);
        Cost { ms: 1.0 + 5e-4 * lines * (1.0 + modes * modes), bytes: 100_000 + 20 * bytes as u64, driver: "/files" }
    }

    fn run(job: &Job, monitor: &dyn Monitor) -> Result<Answer<Outcome>, Failure> {
        checkpoint(monitor)?;
        monitor.progress(0.0, Message::new("stage_modes"));
        let output = outcome(job, "", monitor)?;
        let warnings = warnings(job, &output, "");
        let explanation = advice::explanation(&output);
        monitor.progress(1.0, Message::new("stage_done"));
        Ok(Answer { output, warnings, explanation, basis: BASIS.to_vec() })
    }

    fn figures(_job: &Job, outcome: &Outcome) -> Vec<Figure> {
        picture::figures(outcome)
    }

    fn tables(_job: &Job, outcome: &Outcome) -> Vec<Table> {
        picture::tables(outcome)
    }
}

/// The equations that act.
const BASIS: &[Basis] = &[
    Basis { equation: "receptance/3.1", source: "least-squares complex frequency, Guillaume et al. 1998" },
    Basis { equation: "receptance/3.2", source: "Schwarz 1978" },
    Basis { equation: "receptance/3.3", source: "least squares of real modes in the quantity measured" },
];

/// Codes of a faultless job without answer.
pub(crate) const FAILURE_CODES: &[&str] = &["no_mode_seen"];

/// Codes of the faults of functions, for jobs that hold some.
pub(crate) const FAULT_CODES: [&[&str]; 2] = [check::CODES, reader::CODES];

/// Everything that this evaluation may utter.
const CODES: Codes = Codes {
    faults: &FAULT_CODES,
    failures: &[FAILURE_CODES],
    warnings: &[WARNING_CODES],
    explanations: &[advice::EXPLANATION_CODES],
    stages: &[&["stage_modes", "stage_done"]],
    labels: &[picture::LABEL_CODES],
};

/// The modes of the functions of a job without faults; pointers begin with `at`, where it stands in another one.
pub(crate) fn outcome(job: &Job, at: &str, monitor: &dyn Monitor) -> Result<Outcome, Failure> {
    let functions = read(&job.files, at).map_err(|_| Failure::Internal("a checked file is not read".to_owned()))?;
    let mut found = Outcome {
        modes: Vec::new(),
        certainty: Vec::new(),
        largest_residual_share: 0.0,
        groups: Vec::new(),
        functions: functions.iter().map(unfitted).collect(),
        curve: Vec::new(),
    };
    let stop = || monitor.cancelled();
    for mut group in model::groups(&functions, job.band_hz(), job.residuals) {
        let modes = job.modes.and_then(|modes| usize::try_from(modes).ok());
        let chosen = model::choose(&mut group, modes, &stop).map_err(|unfit| refused(unfit, &functions, &group, at))?;
        add(&mut found, &group, &chosen);
    }
    found.curve.sort_by_key(|row| row.function);
    Ok(found)
}

fn refused(unfit: Unfit, functions: &[Function], group: &Group, at: &str) -> Failure {
    match unfit {
        Unfit::Stopped => Failure::Cancelled,
        Unfit::NoMode | Unfit::TooFew => {
            let function = &functions[group.lines[0].function];
            let lines: usize = group.lines.iter().map(|lines| lines.values.len()).sum();
            Failure::OutOfModel(
                Finding::new("no_mode_seen", format!("{at}/files/{}", function.file))
                    .with("response", function.response.name())
                    .with("excitation", function.excitation.name())
                    .with("lines", lines),
            )
        }
    }
}

fn unfitted(function: &Function) -> FittedFunction {
    FittedFunction {
        file: function.file,
        set: function.set,
        response: function.response,
        excitation: function.excitation,
        unit: function.unit,
        lines: 0,
        residual_share: 0.0,
        neighbour_correlation: 0.0,
        bands: Vec::new(),
    }
}

/// Adds a group's modes, what they leave and the lines.
fn add(found: &mut Outcome, group: &Group, chosen: &Chosen) {
    for (mode, phase) in chosen.refined.modes.iter().zip(&chosen.phases_deg) {
        let mut direction = [0.0; 3];
        for (axis, share) in group.axes.iter().zip(&mode.direction) {
            direction[*axis] = *share;
        }
        let omega = std::f64::consts::TAU * mode.frequency_hz;
        found.modes.push(FittedMode {
            direction,
            frequency_hz: mode.frequency_hz,
            damping_ratio: mode.damping_ratio,
            mass_kg: mode.mass_kg,
        });
        found.certainty.push(ModeCertainty {
            stiffness_n_per_mm: mode.mass_kg * omega * omega / MM_PER_M,
            frequency_error_hz: mode.relative_errors[0] * mode.frequency_hz,
            damping_ratio_error: mode.relative_errors[1] * mode.damping_ratio,
            mass_error_kg: mode.relative_errors[2] * mode.mass_kg,
            residue_phase_deg: phase[0],
            residue_phase_error_deg: phase[1],
        });
    }
    let axes = [Direction::X, Direction::Y, Direction::Z];
    found.groups.push(FittedGroup {
        directions: group.axes.iter().map(|axis| axes[*axis]).collect(),
        modes: chosen.refined.modes.len(),
        bic: chosen.refined.bic,
        bic_one_less: chosen.bic_less,
        bic_one_more: chosen.bic_more,
        better_modes: chosen.better,
    });
    for (lines, predicted) in group.lines.iter().zip(&chosen.refined.predicted) {
        let row = |i: usize| {
            let receptance = |value: nalgebra::Complex<f64>| value / lines.factors[i] * UM_PER_M;
            let (measured, fitted) = (receptance(lines.values[i]), receptance(predicted[i]));
            CurveRow {
                function: lines.function,
                frequency_hz: lines.frequency_hz[i],
                real_um_per_n: measured.re,
                imaginary_um_per_n: measured.im,
                fitted_real_um_per_n: fitted.re,
                fitted_imaginary_um_per_n: fitted.im,
            }
        };
        found.curve.extend((0..lines.values.len()).map(row));
        let function = &mut found.functions[lines.function];
        let left = Left::new(lines, predicted);
        let count = lines.values.len();
        function.lines = count;
        function.residual_share = left.share(0, count);
        found.largest_residual_share = found.largest_residual_share.max(function.residual_share);
        function.neighbour_correlation = left.neighbour_correlation();
        let parts = PARTS.min(count / LEAST_LINES).max(1);
        function.bands = (0..parts)
            .map(|part| {
                let (from, to) = (part * count / parts, (part + 1) * count / parts);
                FittedBand {
                    from_hz: lines.frequency_hz[from],
                    to_hz: lines.frequency_hz[to - 1],
                    residual_share: left.share(from, to),
                }
            })
            .collect();
    }
}

/// What is left of a function, in the quantity measured and its weights.
struct Left {
    values: Vec<nalgebra::Complex<f64>>,
    left: Vec<nalgebra::Complex<f64>>,
}

impl Left {
    fn new(lines: &Lines, predicted: &[nalgebra::Complex<f64>]) -> Self {
        let weighed = |i: usize, value: nalgebra::Complex<f64>| value * lines.weights[i];
        Self {
            values: (0..predicted.len()).map(|i| weighed(i, lines.values[i])).collect(),
            left: (0..predicted.len()).map(|i| weighed(i, lines.values[i] - predicted[i])).collect(),
        }
    }

    fn share(&self, from: usize, to: usize) -> f64 {
        let square = |of: &[nalgebra::Complex<f64>]| of[from..to].iter().map(nalgebra::Complex::norm_sqr).sum::<f64>();
        let whole = square(&self.values);
        if whole > 0.0 { (square(&self.left) / whole).sqrt() } else { 0.0 }
    }

    fn neighbour_correlation(&self) -> f64 {
        let products: f64 = self.left.windows(2).map(|pair| (pair[0] * pair[1].conj()).re).sum();
        let squares: f64 = self.left.iter().map(nalgebra::Complex::norm_sqr).sum();
        // What is left of numbers without noise is their rounding.
        let whole: f64 = self.values.iter().map(nalgebra::Complex::norm_sqr).sum();
        if squares > ROUNDING * whole { products / squares } else { 0.0 }
    }
}

/// Squares of what numbers of ten digits leave, as a share of theirs.
const ROUNDING: f64 = 1e-18;
