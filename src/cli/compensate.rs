//! `precut compensate`: a program in, the same program out, with X of its finishing cuts shifted, its feeds changed, or both.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use bytes::Bytes;
use clap::Args;
use precut_calc::calculator::Unwatched;
use precut_calc::program_compensation::Outcome;
use serde::Deserialize;
use serde_json::{Map, Value, json};

use super::{Failed, exit_code, job, print};
use crate::engine::{Body, Error, FilePart, Given, solve_now};
use crate::http::{Media, Problem, written};
use crate::registry::Registry;
use crate::text::Language;

const CALCULATOR: &str = "program-compensation";
/// What a diff begins with.
const HEADS: &[u8] = b"--- given\n+++ corrected\n";
/// Nothing had to change.
const UNCHANGED: u8 = 3;
/// The program or the job is at fault, or is not understood.
const NOT_READ: u8 = 2;
/// Any other refusal.
const REFUSED: u8 = 1;

#[derive(Debug, Args)]
pub(super) struct CompensateArgs {
    /// The program; the diff of what changes goes to standard output
    #[arg(value_name = "PROGRAM")]
    program: PathBuf,
    /// Job file for it, without its program: as for `solve`, or the bare job
    #[arg(long, value_name = "FILE")]
    job: PathBuf,
    /// File with machines, tools and materials of your own (JSON, TOML or CSV), which the job may name
    #[arg(long, value_name = "FILE")]
    library: Option<PathBuf>,
    /// Write the corrected program here
    #[arg(long, short, value_name = "FILE", required_unless_present_any = ["check", "in_place"])]
    output: Option<PathBuf>,
    /// Write nothing but the diff
    #[arg(long, conflicts_with_all = ["output", "in_place"])]
    check: bool,
    /// Write the corrected program over the given one
    #[arg(long, conflicts_with = "output")]
    in_place: bool,
}

/// What of an answer is needed here.
#[derive(Deserialize)]
struct Answer {
    result: Outcome,
    #[serde(default)]
    warnings: Vec<Notice>,
    #[serde(default)]
    explanation: Vec<Notice>,
}

#[derive(Deserialize)]
struct Notice {
    /// Warnings and faults call it so, explanations `text`.
    #[serde(alias = "text")]
    detail: String,
    #[serde(default)]
    values: Map<String, Value>,
}

impl CompensateArgs {
    /// Where the corrected program goes.
    fn target(&self) -> Result<Option<&Path>, Failed> {
        let target = if self.in_place { Some(self.program.as_path()) } else { self.output.as_deref() };
        let is_same = |path: &Path| match (path.canonicalize(), self.program.canonicalize()) {
            (Ok(a), Ok(b)) => a == b,
            _ => false,
        };
        match target {
            Some(path) if !self.in_place && is_same(path) => Err(Failed::Usage(format!(
                "{} is the program that is given; with --in-place it is written over",
                path.display()
            ))),
            target => Ok(target),
        }
    }
}

/// Runs the command; the exit code says whether anything changed.
pub(super) fn run(arguments: &CompensateArgs, registry: &Registry, language: Language) -> Result<ExitCode, Failed> {
    let target = arguments.target()?;
    let program = FilePart { name: "nc_program".to_owned(), bytes: read(&arguments.program)?.into() };
    let body = Body::Parts { job: job_without_program(&arguments.job)?, files: vec![program] };
    let library = arguments.library.as_ref().map(|file| job::library_file(file)).transpose()?;
    let given = Given { library, ..Given::default() };
    let stored = match solve_now(registry, CALCULATOR, body, &given, &Unwatched) {
        Ok(stored) => stored,
        Err(error) => return Ok(refused(error, &arguments.program, language)),
    };
    let answer: Answer =
        serde_json::from_slice(&stored.body_in(language)).map_err(|error| Failed::Machine(error.to_string()))?;
    for warning in &answer.warnings {
        tell(&arguments.program, warning);
    }
    let Some(compensation) = answer.result.compensation else { return Ok(ExitCode::from(REFUSED)) };
    for said in &answer.explanation {
        let _ = writeln!(std::io::stderr(), "{}", said.detail);
    }
    if let Some(target) = target {
        std::fs::write(target, written(&stored, Media::Gcode, None, language)?)
            .map_err(|error| Failed::Machine(job::named(target, &error)))?;
    }
    let named = target.unwrap_or(&arguments.program);
    let diff = written(&stored, Media::Diff, None, language)?;
    // A diff without its heads has not changed.
    if let Some(changes) = diff.strip_prefix(HEADS) {
        print(heads(&arguments.program, named).as_bytes())?;
        print(changes)?;
    }
    Ok(if compensation.lines_changed.is_empty() { ExitCode::from(UNCHANGED) } else { ExitCode::SUCCESS })
}

fn heads(old: &Path, new: &Path) -> String {
    format!("--- {}\n+++ {}\n", old.display(), new.display())
}

fn read(path: &Path) -> Result<Vec<u8>, Failed> {
    std::fs::read(path).map_err(|error| Failed::Machine(job::named(path, &error)))
}

/// The job that takes the program.
fn job_without_program(path: &Path) -> Result<Bytes, Failed> {
    let no_job = |what: &str| Failed::Usage(format!("{}: {what}", path.display()));
    let mut job: Value = serde_json::from_slice(&read(path)?).map_err(|error| no_job(&error.to_string()))?;
    if job.get("job").is_some() {
        if job.get("calculator").is_some_and(|calculator| calculator != CALCULATOR) {
            return Err(no_job("this is a job of another calculator"));
        }
        job = job["job"].take();
    }
    let Some(fields) = job.as_object_mut() else { return Err(no_job("a job is an object")) };
    fields.remove("nc_program");
    let mode = fields.entry("mode").or_insert_with(|| json!({}));
    if let Some(mode) = mode.as_object_mut() {
        // What the job asks for beside reading is done.
        let kind = mode.entry("kind").or_insert_with(|| json!("compensate"));
        if kind == "read" {
            *kind = json!("compensate");
        }
    }
    Ok(job.to_string().into())
}

/// To standard error, with the place in the program.
fn tell(program: &Path, notice: &Notice) {
    let number = |name: &str| notice.values.get(name).and_then(Value::as_f64).map(|number| format!("{number}:"));
    let place = [number("line"), number("column")].into_iter().map_while(|number| number).collect::<String>();
    let _ = writeln!(std::io::stderr(), "{}:{place} {}", program.display(), notice.detail);
}

/// Says why there is no answer.
fn refused(error: Error, program: &Path, language: Language) -> ExitCode {
    let problem = Problem::from(error);
    let document = serde_json::to_value(problem.document(language, None)).unwrap_or_default();
    let errors: Vec<Notice> =
        document.get("errors").cloned().map(serde_json::from_value).transpose().ok().flatten().unwrap_or_default();
    if errors.is_empty() {
        let detail = document.get("detail").and_then(Value::as_str).unwrap_or_default();
        let _ = writeln!(std::io::stderr(), "{}: {detail}", program.display());
    }
    for error in &errors {
        tell(program, error);
    }
    let is_read = problem.code() != "program_not_read" && exit_code(&problem) != NOT_READ;
    ExitCode::from(if is_read { REFUSED } else { NOT_READ })
}
