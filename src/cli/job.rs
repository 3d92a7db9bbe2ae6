//! Job files: read, checked, solved without a server.

use std::io::{self, IsTerminal, Read};
use std::ops::Range;
use std::path::Path;

use bytes::Bytes;
use precut_calc::calculator::Unwatched;
use serde::Deserialize;
use serde_json::json;
use serde_json::value::RawValue;

use super::{Failed, JobArgs, SolveArgs, entry, print, print_json};
use crate::engine::{
    Body, Error, FilePart, Form as FileForm, Given, Library, ModelFile, NotGiven, STUDIES, SyntaxFault, check_now,
    solve_now,
};
use crate::http::{Media, Problem, written};
use crate::registry::{Entry, Registry};
use crate::text::Language;

/// Form of an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Form {
    /// The whole answer
    Json,
    /// One of its tables
    Csv,
    /// One of its figures
    Svg,
    /// Its program for the machine
    Gcode,
    /// What changed in the program of its job
    Diff,
    /// Its inputs and all of its tables as a workbook
    Xlsx,
    /// All of it as a report on paper
    Pdf,
}

impl From<Form> for Media {
    fn from(form: Form) -> Self {
        match form {
            Form::Json => Self::Json,
            Form::Csv => Self::Csv,
            Form::Svg => Self::Svg,
            Form::Gcode => Self::Gcode,
            Form::Diff => Self::Diff,
            Form::Xlsx => Self::Xlsx,
            Form::Pdf => Self::Pdf,
        }
    }
}

/// `precut solve`
pub(super) fn solve(arguments: &SolveArgs, registry: &Registry, language: Language) -> Result<(), Failed> {
    let (calculator, body, given) = read(&arguments.job, registry)?;
    let part = match arguments.format {
        Form::Csv => arguments.table.as_deref(),
        Form::Svg => arguments.figure.as_deref(),
        Form::Json | Form::Gcode | Form::Diff | Form::Xlsx | Form::Pdf => None,
    };
    let stored = solve_now(registry, &calculator, body, &given, &Unwatched)?;
    let bytes = written(&stored, arguments.format.into(), part, language)?;
    match &arguments.output {
        Some(path) => std::fs::write(path, &bytes).map_err(|error| Failed::Machine(named(path, &error))),
        // A byte more would be a fault of the file.
        None if bytes.ends_with(b"\n")
            || matches!(arguments.format, Form::Gcode | Form::Diff | Form::Xlsx | Form::Pdf) =>
        {
            print(&bytes)
        }
        None => print(&bytes).and_then(|()| print(b"\n")),
    }
}

/// `precut check`
pub(super) fn check(arguments: &JobArgs, registry: &Registry) -> Result<(), Failed> {
    let (calculator, body, given) = read(arguments, registry)?;
    let checked = check_now(registry, &calculator, body, &given)?;
    print_json(&json!({
        "calculator": calculator,
        "key": checked.key.to_string(),
        "cost_ms": checked.cost.ms,
        "input": checked.input,
    }))
}

/// `precut example`
pub(super) fn example(entry: &Entry, id: Option<&str>, bare: bool) -> Result<(), Failed> {
    let meta = entry.meta();
    let example = match id {
        Some(id) => meta.examples.iter().find(|example| example.id == id),
        None => meta.examples.first(),
    };
    let Some(example) = example else {
        let known: Vec<_> = meta.examples.iter().map(|example| example.id).collect();
        return Err(Failed::Usage(format!("{} has these examples: {}", meta.id, known.join(", "))));
    };
    let job: serde_json::Value =
        serde_json::from_str(example.job).map_err(|error| Failed::Machine(error.to_string()))?;
    match (bare, meta.id) {
        (true, _) => print_json(&job),
        (false, STUDIES) => print_json(&json!({ "study": job })),
        (false, id) => print_json(&json!({ "calculator": id, "job": job })),
    }
}

/// What stands in a file, or comes from standard input where it is `-`.
pub(super) fn bytes_of(file: &Path) -> Result<Vec<u8>, Failed> {
    let bytes = if file.as_os_str() == "-" {
        if io::stdin().is_terminal() {
            eprintln!("reading the job from standard input; end it with Ctrl-D");
        }
        let mut bytes = Vec::new();
        io::stdin().read_to_end(&mut bytes).map(|_| bytes)
    } else {
        std::fs::read(file)
    };
    bytes.map_err(|error| Failed::Machine(named(file, &error)))
}

/// The calculator's name, the job with its tables, and what its names mean.
fn read(arguments: &JobArgs, registry: &Registry) -> Result<(String, Body, Given), Failed> {
    let bytes = bytes_of(&arguments.file)?;
    let (calculator, job) = match &arguments.calculator {
        Some(calculator) => (calculator.clone(), bytes.into()),
        None => job_file(bytes)?,
    };
    let body = if arguments.measured.is_empty() {
        Body::Json(job)
    } else {
        let names = entry(registry, &calculator)?.table_names();
        let files = arguments.measured.iter().map(|given| table(given, &calculator, &names));
        Body::Parts { job, files: files.collect::<Result<_, _>>()? }
    };
    let model = arguments.model.as_ref().map(|file| model_file(file, registry)).transpose()?;
    let library = arguments.library.as_ref().map(|file| library_file(file)).transpose()?;
    let mut given = Given { model, library, ..Given::default() };
    if let Some(folder) = &arguments.data {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
        let runtime = runtime.map_err(|error| Failed::Machine(format!("the threads cannot be started: {error}")))?;
        let looked = runtime.block_on(given.look_up(registry, (&calculator, &body), folder));
        looked.map_err(|error| match error {
            NotGiven::Folder(error) => Failed::Machine(error.to_string()),
            NotGiven::Asked(error) => error.into(),
        })?;
    }
    Ok((calculator, body, given))
}

/// Own records of a file, by how its name ends.
pub(super) fn library_file(path: &Path) -> Result<Library, Failed> {
    let bytes = std::fs::read(path).map_err(|error| Failed::Machine(named(path, &error)))?;
    let form = match path.extension().and_then(|end| end.to_str()) {
        Some("toml") => FileForm::Toml,
        Some("csv") => FileForm::Csv,
        _ => FileForm::Json,
    };
    Ok(Library::read(form, &bytes).map_err(Problem::from)?)
}

/// A model as `GET /v1/models/{name}` gave it.
fn model_file(path: &Path, registry: &Registry) -> Result<ModelFile, Failed> {
    let bytes = std::fs::read(path).map_err(|error| Failed::Machine(named(path, &error)))?;
    Ok(ModelFile::read(registry, &bytes).map_err(Problem::from)?)
}

/// What was measured stands in this field of a job that has other tables, too.
const MEASUREMENTS: &str = "measurements";

/// A measured table from `FILE`: the only one of the job, else its measurements; from `FIELD=FILE` any.
fn table(given: &str, calculator: &str, names: &[String]) -> Result<FilePart, Failed> {
    let (name, path) = match given.split_once('=').filter(|(name, _)| names.iter().any(|known| is_field(known, name))) {
        Some((name, path)) => (name.to_owned(), Path::new(path)),
        None => match names {
            [only] => (only.clone(), Path::new(given)),
            [] => return Err(Failed::Usage(format!("a job of {calculator} takes no measured table"))),
            several if several.iter().any(|known| known == MEASUREMENTS) => (MEASUREMENTS.to_owned(), Path::new(given)),
            several => {
                let known = several.join(", ");
                let example = several[0].as_str();
                return Err(Failed::Usage(format!(
                    "a job of {calculator} takes several measured tables ({known}): say which one, as in --measured {example}=FILE"
                )));
            }
        },
    };
    let bytes = std::fs::read(path).map_err(|error| Failed::Machine(named(path, &error)))?;
    Ok(FilePart { name, bytes: bytes.into() })
}

/// Whether the name of a table is this one, or ends with it.
fn is_field(known: &str, name: &str) -> bool {
    known == name || known.strip_suffix(name).is_some_and(|rest| rest.ends_with('.'))
}

/// A job file: a job with its calculator, or a parameter study.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct JobFile<'a> {
    calculator: Option<String>,
    #[serde(default, borrow, deserialize_with = "present")]
    job: Option<&'a RawValue>,
    #[serde(default, borrow, deserialize_with = "present")]
    study: Option<&'a RawValue>,
}

/// Whatever is there, be it null, is there.
fn present<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Option<&'de RawValue>, D::Error> {
    Deserialize::deserialize(deserializer).map(Some)
}

impl<'a> JobFile<'a> {
    /// Whose job it is, and its text.
    fn parts(self) -> Option<(String, &'a str)> {
        match (self.calculator, self.job, self.study) {
            (Some(calculator), Some(job), None) => Some((calculator, job.get())),
            (None, None, Some(study)) => Some((STUDIES.to_owned(), study.get())),
            _ => None,
        }
    }
}

/// Takes a job file apart. The job keeps its bytes, and its place: whatever stands around it becomes blank, so that
/// lines and columns of a fault are those of the file.
fn job_file(mut bytes: Vec<u8>) -> Result<(String, Bytes), Failed> {
    if bytes.starts_with(BYTE_ORDER_MARK) {
        bytes.drain(..BYTE_ORDER_MARK.len());
    }
    let (calculator, job) = match serde_json::from_slice(&bytes).map(JobFile::parts) {
        Ok(Some((calculator, job))) => (calculator, place_of(job, &bytes)),
        Err(error) if !error.is_data() => return Err(no_json(&error)),
        Ok(None) | Err(_) => return Err(Failed::Usage(NO_JOB_FILE.to_owned())),
    };
    bytes.truncate(job.end);
    for byte in &mut bytes[..job.start] {
        if *byte != b'\n' {
            *byte = b' ';
        }
    }
    Ok((calculator, bytes.into()))
}

/// Editors of Windows write it.
const BYTE_ORDER_MARK: &[u8] = b"\xEF\xBB\xBF";

const NO_JOB_FILE: &str = "this is no job file: that is {\"calculator\": \"NAME\", \"job\": {...}} or \
                           {\"study\": {...}}; if it is the bare job of a calculator, say which: --calculator NAME \
                           (`precut list` tells them)";

pub(super) fn no_json(error: &serde_json::Error) -> Failed {
    let message = error.to_string();
    let message = message.rsplit_once(" at line ").map_or(message.as_str(), |(message, _)| message).to_owned();
    let (line, column) = (error.line(), error.column());
    Error::Syntax(SyntaxFault { code: "bad_syntax", pointer: String::new(), line, column, message }).into()
}

/// Where a part of the text stands in it.
fn place_of(part: &str, whole: &[u8]) -> Range<usize> {
    let start = part.as_ptr().addr() - whole.as_ptr().addr();
    start..start + part.len()
}

pub(super) fn named(path: &Path, error: &io::Error) -> String {
    if path.as_os_str() == "-" { format!("standard input: {error}") } else { format!("{}: {error}", path.display()) }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn job_of(text: &str) -> (String, String) {
        let (calculator, job) = job_file(text.as_bytes().to_vec()).map_err(|failed| format!("{failed:?}")).unwrap();
        (calculator, String::from_utf8(job.to_vec()).unwrap())
    }

    #[test]
    fn the_job_keeps_its_bytes_and_its_place() {
        let (calculator, job) = job_of("{\"calculator\": \"beam\",\n \"job\": {\"a\": 1, \"a\": 2}}\n");
        assert_eq!(calculator, "beam");
        assert_eq!(job.trim(), "{\"a\": 1, \"a\": 2}");
        assert_eq!(job.find('{'), Some(31));
        assert_eq!(job.matches('\n').count(), 1);
    }

    #[test]
    fn order_nesting_and_escapes_do_not_confuse_it() {
        for (text, expected) in [
            ("{\"job\":{\"calculator\":[1,{\"job\":2}]},\"calculator\":\"x\"}", "{\"calculator\":[1,{\"job\":2}]}"),
            ("{\"calculator\":\"job\",\"job\":[\"}\\\"]\",\"\\\\\"]}", "[\"}\\\"]\",\"\\\\\"]"),
            ("{\"job\":null,\"calculator\":\"x\"}", "null"),
        ] {
            assert_eq!(job_of(text).1.trim(), expected, "{text}");
        }
    }

    #[test]
    fn a_study_is_a_job_file_too() {
        let (calculator, study) = job_of("{\"study\": {\"calculator\": \"beam\", \"job\": {}}}");
        assert_eq!((calculator.as_str(), study.trim()), ("studies", "{\"calculator\": \"beam\", \"job\": {}}"));
    }

    #[test]
    fn a_byte_order_mark_is_no_part_of_it() {
        let (calculator, job) = job_of("\u{feff}{\"calculator\": \"beam\", \"job\": {}}");
        assert_eq!((calculator.as_str(), job.trim(), job.find('{')), ("beam", "{}", Some(30)));
    }

    #[test]
    fn what_is_no_json_is_said_with_its_place() {
        for text in ["", "{", "{\"calculator\" 1}"] {
            let Err(Failed::Problem(problem)) = job_file(text.as_bytes().to_vec()) else { unreachable!("{text}") };
            assert_eq!(problem.code(), "bad_syntax", "{text}");
        }
    }

    #[test]
    fn what_is_json_and_no_job_file_is_told_how_to_be_read() {
        for text in [
            "[]",
            "{}",
            "{\"study\":{},\"job\":{}}",
            "{\"job\":{}}",
            "{\"calculator\":\"x\"}",
            "{\"calculator\":\"x\",\"job\":{},\"jobs\":1}",
            "{\"shaft\":{\"segments\":[]}}",
        ] {
            let Err(Failed::Usage(said)) = job_file(text.as_bytes().to_vec()) else { unreachable!("{text}") };
            assert!(said.contains("--calculator"), "{text}");
        }
    }
}
