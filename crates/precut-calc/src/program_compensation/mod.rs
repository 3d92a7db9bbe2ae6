//! The program that a shop has already (`program`): read as its control reads it.
//!
//! The way of a job: `job` -> `model` (the reader: bytes, words, blocks, moves; the blank, rigid and yielding) -> `answer` (moves,
//! errors, the corrected program, pictures, what is said). `conformance` is how probable it is that the parts are good, `forward` the model
//! as a function of its effects, for parts that were measured, and `consequence` what a program leaves that is corrected with it.

mod answer;
mod conformance;
mod consequence;
mod forward;
mod job;
mod made;
mod measurement;
mod model;

pub use answer::compensated::{CompensatedProgram, CompensationProof, LineChange, LineLeftAlone, Transition};
pub use answer::left::{CutsAlong, ErrorAlong, ErrorOfLines, LeftSurface, ProgramError, YieldedWork};
pub use answer::moves::ReadMoves;
pub use answer::output::Outcome;
pub use answer::refed::{RefedFeeds, RefedLimit, RefedPrice, RefedProgram};
pub use forward::{PreparedProgram, ProgramRun};
pub use job::{
    CorrectTo, DecimalPoint, Dialect, Job, KeepOut, Mode, ModeKind, ProgramFeed, ProgramInclude, ProgramStart,
    ProgramStock, ProgramTool, ProgramUnits, Reading, Refeed, StockRow, SupportLines, WordsOfX,
};
pub use measurement::ProgramMeasurement;
pub use model::correction::WhyLeftAlone;
pub use model::reader::{ContourCycle, CycleKind, Kind, MAX_LINES, MAX_MOVES, Nose};

use crate::calculator::{
    Answer, Basis, Calculator, CalculatorKind, Codes, Cost, Example, Failure, Figure, Finding, Hallmark, Message, Meta,
    Monitor, ProgramOrigin, ReturnedProgram, Table,
};

use crate::certainty::{self, Conformance};
use crate::diameters;

use answer::{advice, output, picture, returned};
use model::{correction, reader, refeed, stock, yielding};

/// Drives that a probability takes, about (measured).
const SURE_DRIVES: f64 = 180.0;

/// Reads programs for lathes.
#[derive(Debug, Clone, Copy)]
pub struct ProgramCompensation;

impl Calculator for ProgramCompensation {
    type Input = Job;
    type Output = Outcome;

    const META: Meta = Meta {
        id: "program-compensation",
        kind: CalculatorKind::Calculator,
        version: 14,
        title: "The program that is there",
        question: "What does this turning program make the machine do, word by word, and what in it is not understood?",
        summary: "A turning program as it is, for Fanuc (G-code systems A, B and C), Siemens or LinuxCNC, is read as its \
                  control reads it: every move with its line, end, arc centre, feed, speed, tool and nose compensation; \
                  single cycles, roughing and finishing along a contour are expanded into their moves. What is not \
                  understood is refused with its line, column and word and with what to do, all of it at once; threads and \
                  grooves are passed with a warning. Nothing is guessed. With a blank: the surface that the program leaves on \
                  work and machine that do not yield, which line makes which part of it, and rapid moves through stock. With forces \
                  and supports: what it leaves where they yield, and in mode `compensate` the same program with X of its finishing cuts \
                  shifted against that, every other line as it was, proved by reading and driving it again. In mode `refeed` its feeds become \
                  the fastest within limits of deflection, roughness, force, power and edges; mode `both` does one after the other.",
        references: &[
            "Fanuc, Operator's manual for lathe systems, G-code systems A, B and C",
            "Siemens, SINUMERIK 840D sl Programming manual, Fundamentals",
            "LinuxCNC, G-code reference",
        ],
        examples: &[
            Example {
                id: "two_diameters",
                title: "Shaft of two diameters from a bar, roughed and finished, as a Fanuc of system A reads it",
                job: include_str!("examples/two_diameters.json"),
            },
            Example {
                id: "slender_shaft",
                title: "Slender shaft between chuck and centre: its program, and the one that leaves no error",
                job: include_str!("examples/slender_shaft.json"),
            },
            Example {
                id: "within_tolerance",
                title: "The same shaft with a tolerance: how probably a part of the corrected program keeps it",
                job: include_str!("examples/within_tolerance.json"),
            },
            Example {
                id: "faster_feeds",
                title: "The same shaft: first the fastest feeds within its limits, then X at those",
                job: include_str!("examples/faster_feeds.json"),
            },
        ],
        hallmarks: &[Hallmark::Of("/dialect"), Hallmark::Of("/mode/kind")],
        study_outputs: &["/feed_moves", "/feed_length_mm", "/conformance/joint/probability"],
        codes: CODES,
        figures: picture::FIGURE_IDS,
        tables: picture::TABLE_IDS,
        program: Some(ProgramOrigin::Brought),
    };

    fn fill(job: &mut Job) {
        job.fill();
    }

    fn cost(job: &Job) -> Cost {
        let (bytes, lines) = (job.nc_program.len(), lines_of(&job.nc_program));
        let read_ms = 1.0 + 2e-3 * lines as f64 + 2e-4 * bytes as f64;
        // Over a blank a move is held against what it comes near to, however long the program is (measured).
        let turned_ms = if job.stock.is_some() { 2e-2 * lines as f64 } else { 0.0 };
        // Where the work yields, every move bends a beam of its own.
        let yielding_ms = if job.force.is_some() { made::drive_ms_of(job) } else { 0.0 };
        // A correction drives it again as it should come out, and what comes of it, from its first line of the contour on: a few times
        // little, or once most of it (measured).
        let drives = if job.mode.kind.compensates() { 2.0 } else { 1.0 };
        // New feeds drive it until the schedule and what comes out at its feeds are one.
        let drives = if job.mode.kind.refeeds() { drives + 10.0 } else { drives };
        // How sure the parts are takes drives of its own: for a response surface, and on lines through what is uncertain.
        let drives = if job.tolerance.is_none() { drives } else { drives + SURE_DRIVES };
        Cost {
            ms: read_ms + drives * (turned_ms + yielding_ms),
            // A line makes four moves at most; cycles over a contour make some more.
            bytes: 10_000_000 + 1500 * lines as u64 + 2 * bytes as u64,
            driver: "/nc_program",
        }
    }

    fn run(job: &Job, monitor: &dyn Monitor) -> Result<Answer<Outcome>, Failure> {
        monitor.progress(0.0, Message::new("stage_reading"));
        let program = reader::read(&job.nc_program, job.dialect, &job.reading, monitor)?;
        let mut warnings = program.warnings.clone();
        let turned = match job.stock.as_ref().zip(job.program_zero_z_mm) {
            Some((stock, zero)) => {
                monitor.progress(0.3, Message::new("stage_turning"));
                let turned = stock::turned(&program, job, (stock, zero), monitor)?;
                let doubt = stock::doubt(&turned, stock);
                let fits = match doubt {
                    Some(_) => stock::zero_that_fits(&program, job, stock, monitor)?,
                    None => None,
                };
                warnings.extend(advice::warnings(&turned, doubt, (stock, zero, fits)));
                let finishing = stock::lines_that_finish(&turned);
                warnings.extend(advice::nose_on_taper(&program, job, zero, &finishing));
                warnings.extend(advice::blank_below(&program, job, zero, &turned, &finishing));
                Some(turned)
            }
            None => None,
        };
        let yielded = yielded(&program, job, turned.as_ref(), monitor)?;
        warnings.extend(yielded.as_ref().and_then(advice::turned_law));
        warnings.extend(yielded.iter().flat_map(advice::of_nothing_cut));
        if let Some((turned, yielded)) = turned.as_ref().zip(yielded.as_ref()) {
            warnings.extend(advice::close_rapids(yielded, turned));
            warnings.extend(job.force.iter().flat_map(|force| advice::beyond_law(yielded, force)));
        }
        let finishing = turned.as_ref().map(stock::lines_that_finish).unwrap_or_default();
        warnings.extend(yielded.as_ref().and_then(|yielded| advice::off_by_more_than_deep(yielded, &finishing)));
        warnings.extend(job.force.iter().flat_map(|force| force.cautions("/force")));
        let driven = turned.as_ref().zip(yielded.as_ref());
        let (refed, corrected) = changed(&program, job, driven, monitor)?;
        warnings.extend(corrected.iter().flat_map(advice::of_corrected));
        if job.mode.kind != ModeKind::Read && corrected.is_none() {
            warnings.push(Finding::new("program_unsafe", "/nc_program"));
        }
        let conformance = sure(job, (turned.as_ref(), yielded.as_ref()), corrected.as_ref(), monitor)?;
        let mut output = output::outcome(
            &program,
            &job.drawing,
            (turned.as_ref(), yielded.as_ref()),
            (corrected.as_ref(), refed.as_ref()),
        );
        output.conformance = conformance;
        warnings.extend(advice::far_from_drawing(&output, job.mode.correct_to));
        warnings.extend(output.conformance.iter().flat_map(|sure| diameters::warnings(&job.asked(), sure)));
        let explanation = advice::explanation(&output, job.mode.correct_to);
        monitor.progress(1.0, Message::new("stage_done"));
        Ok(Answer { output, warnings, explanation, basis: basis(job) })
    }

    fn figures(job: &Job, outcome: &Outcome) -> Vec<Figure> {
        picture::figures(job, outcome)
    }

    fn tables(_job: &Job, outcome: &Outcome) -> Vec<Table> {
        picture::tables(outcome)
    }

    fn returned(job: &Job, outcome: &Outcome, made_by: &str) -> Option<Result<ReturnedProgram, Failure>> {
        let nothing = || Failure::OutOfModel(Finding::new("no_program_returned", "/mode/kind"));
        let kept = outcome.conformance.as_ref().map(|sure| &sure.joint);
        Some(outcome.compensation.as_ref().map(|one| returned::returned(job, one, (made_by, kept))).ok_or_else(nothing))
    }
}

/// What is left where work and machine yield, of a job that says by which forces.
fn yielded(
    program: &reader::Program,
    job: &Job,
    turned: Option<&stock::Turned>,
    monitor: &dyn Monitor,
) -> Result<Option<yielding::Yielded>, Failure> {
    let blank = job.stock.as_ref().zip(job.program_zero_z_mm);
    let (Some(holding), Some(blank), Some(turned)) = (job.holding(), blank, turned) else { return Ok(None) };
    monitor.progress(0.5, Message::new("stage_yielding"));
    let finishing = stock::lines_that_finish(turned);
    let driven = yielding::Driven::as_it_is(&finishing);
    yielding::yielding(program, job, &holding, blank, driven, monitor).map(Some)
}

/// New feeds, and the program that is given back, as far as they are asked for.
fn changed(
    program: &reader::Program,
    job: &Job,
    driven: Option<(&stock::Turned, &yielding::Yielded)>,
    monitor: &dyn Monitor,
) -> Result<(Option<refeed::Refed>, Option<correction::Corrected>), Failure> {
    let refed = refed(program, job, driven, monitor)?;
    let corrected = match (&refed, driven) {
        (Some(refed), _) if !job.mode.kind.compensates() => Some(refed.alone(job)),
        // Feeds change no line's place: supports, contour and blank are those of the given program.
        (Some(refed), Some((turned, _))) => {
            let mut again = job.clone();
            again.nc_program.clone_from(&refed.text);
            let corrected = corrected(&refed.program, &again, Some((turned, &refed.yielded)), monitor)?;
            corrected.map(|corrected| refed.joined(corrected, &job.nc_program))
        }
        _ => corrected(program, job, driven, monitor)?,
    };
    Ok((refed, corrected))
}

/// The program that is given back, and what the given one means; none where none is.
fn given_back(job: &Job, monitor: &dyn Monitor) -> Result<Option<(correction::Corrected, Vec<stock::Part>)>, Failure> {
    let Some(blank) = job.stock.as_ref().zip(job.program_zero_z_mm) else { return Ok(None) };
    let program = reader::read(&job.nc_program, job.dialect, &job.reading, monitor)?;
    let turned = stock::turned(&program, job, blank, monitor)?;
    let Some(yielded) = yielded(&program, job, Some(&turned), monitor)? else { return Ok(None) };
    let (_, corrected) = changed(&program, job, Some((&turned, &yielded)), monitor)?;
    Ok(corrected.map(|corrected| (corrected, yielded.nominal)))
}

/// The program that leaves no error, where it is asked for.
fn corrected(
    program: &reader::Program,
    job: &Job,
    driven: Option<(&stock::Turned, &yielding::Yielded)>,
    monitor: &dyn Monitor,
) -> Result<Option<correction::Corrected>, Failure> {
    let blank = job.stock.as_ref().zip(job.program_zero_z_mm);
    match (job.mode.kind.compensates(), job.holding(), blank, driven) {
        // A program that does harm as it is gets no new one.
        (true, Some(holding), Some(blank), Some(driven)) if is_safe(driven.0, blank.0) => {
            monitor.progress(0.7, Message::new("stage_correcting"));
            correction::corrected(program, job, &holding, blank, driven, monitor).map(Some)
        }
        _ => Ok(None),
    }
}

/// The program with the fastest feeds, where they are asked for.
fn refed(
    program: &reader::Program,
    job: &Job,
    driven: Option<(&stock::Turned, &yielding::Yielded)>,
    monitor: &dyn Monitor,
) -> Result<Option<refeed::Refed>, Failure> {
    let blank = job.stock.as_ref().zip(job.program_zero_z_mm);
    match (job.refeed.as_ref().filter(|_| job.mode.kind.refeeds()), job.holding(), blank, driven) {
        (Some(bounds), Some(holding), Some(blank), Some((turned, before))) if is_safe(turned, blank.0) => {
            monitor.progress(0.6, Message::new("stage_refeeding"));
            let finishing = stock::lines_that_finish(turned);
            refeed::refed(program, job, bounds, &holding, blank, (&finishing, before), monitor).map(Some)
        }
        _ => Ok(None),
    }
}

/// How sure the parts are to come out well, where their limits are given.
fn sure(
    job: &Job,
    (turned, yielded): (Option<&stock::Turned>, Option<&yielding::Yielded>),
    corrected: Option<&correction::Corrected>,
    monitor: &dyn Monitor,
) -> Result<Option<Conformance>, Failure> {
    match (turned.zip(job.stock.as_ref()), yielded) {
        (Some((turned, stock)), Some(yielded)) if is_safe(turned, stock) && !job.tolerance.is_none() => {
            monitor.progress(0.8, Message::new("stage_program_certainty"));
            conformance::conformance(job, corrected, &yielded.nominal, monitor)
        }
        _ => Ok(None),
    }
}

/// Whether nothing speaks against a program on its blank.
fn is_safe(turned: &stock::Turned, stock: &ProgramStock) -> bool {
    turned.in_stock.is_empty() && turned.hits.is_empty() && stock::doubt(turned, stock).is_none()
}

/// The equations that act.
fn basis(job: &Job) -> Vec<Basis> {
    let mut used = vec![Basis { equation: "program/2", source: "manuals of the controls" }];
    if job.stock.is_some() {
        used.push(Basis { equation: "program/3", source: "envelope of segments and arcs" });
    }
    if job.mode.kind.compensates() {
        used.push(Basis { equation: "program/5", source: "opening at the depth that is meant" });
    }
    if job.mode.kind.refeeds() {
        used.push(Basis { equation: "program/8", source: "geometric program through what comes out of every line" });
    }
    if !job.tolerance.is_none() {
        used.push(Basis {
            equation: "program/10",
            source: "lines through what is uncertain, the program driven again",
        });
    }
    if let Some(force) = &job.force {
        used.push(Basis { equation: "program/4", source: "cut along any direction, equilibrium at the engaged depth" });
        used.push(Basis { equation: "deflection/3.2", source: "force method, Euler-Bernoulli or Timoshenko beam" });
        used.extend(force.basis());
        used.extend(
            job.effects
                .iter()
                .map(|effect| Basis { equation: effect.cause().equation, source: "catalogue of effects" }),
        );
    }
    used
}

/// Everything that this calculator may utter.
const CODES: Codes = Codes {
    faults: &[
        job::CODES,
        crate::shaft::check::SUPPORT_CODES,
        crate::deflection_compensation::EFFECT_CODES,
        crate::force::FAULT_CODES,
        diameters::CODES,
        certainty::DISTRIBUTION_CODES,
        certainty::QUANTITY_CODES,
        certainty::open::CODES,
    ],
    failures: &[
        reader::FAULT_CODES,
        stock::FAILURE_CODES,
        yielding::FAILURE_CODES,
        correction::FAILURE_CODES,
        refeed::FAILURE_CODES,
        // Of parts that were measured.
        &["no_program_returned", "prediction_without_force", "station_outside_shaft"],
    ],
    warnings: &[
        reader::WARNING_CODES,
        advice::WARNING_CODES,
        diameters::WARNING_CODES,
        &["unconfirmed_force_coefficient", "edge_angle_beyond_table", "extrapolated_force_model"],
    ],
    explanations: &[advice::EXPLANATION_CODES, diameters::EXPLANATION_CODES],
    stages: &[&[
        "stage_reading",
        "stage_turning",
        "stage_yielding",
        "stage_refeeding",
        "stage_correcting",
        "stage_program_certainty",
        "stage_done",
    ]],
    labels: &[picture::LABEL_CODES, diameters::DOUBT_LABELS, certainty::picture::LABEL_CODES],
};

/// How many lines a text has at most.
fn lines_of(text: &str) -> usize {
    text.bytes().filter(|byte| matches!(byte, b'\n' | b'\r')).count() + 1
}
