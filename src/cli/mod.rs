//! The command line: the service, and the same calculators without it.

mod ask;
mod backup;
mod compensate;
mod health;
mod job;
mod library;
mod process;
mod serve;

use std::ffi::OsString;
use std::fmt::Write as _;
use std::io::{self, Read, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

use clap::{Args, Parser, Subcommand};
use precut_library::Kind;

use crate::config::Flags;
use crate::engine::{Engine, Error, Isolation, STUDIES, studies_of};
use crate::http::{Problem, auth, openapi};
use crate::registry::{Entry, Registry, RegistryError};
use crate::text::{self, Glossary, Language};

const EXAMPLES: &str = "\
Examples:
  precut                                          serve on 127.0.0.1:8080, database in ./data
  precut serve --listen 0.0.0.0:8080 --data /var/lib/precut
  precut list                                     what can be asked
  precut example deflection-compensation          a complete job file, ready to run
  precut example deflection-compensation | precut solve -
  precut solve job.json --format gcode -o shaft.nc
  precut solve job.json --format pdf -o report.pdf
  precut solve diag.json --measured shaft.csv     what was measured, from a file beside the job
  precut solve job.json --model lathe-7.json      with the causes that a diagnosis found
  precut solve job.json --data ./data             the same by the name in the job, from the service's database
  precut materials 4140                           what a material brings along, by any of its names
  precut tools --search DNMG                      which tools are known
  precut solve job.json --library ours.toml       with machines and tools of one's own
  precut process replay parts.json                what would have been said after each measured part
  precut process new shaft-560.json --url http://127.0.0.1:8080
                                                  a process that the service keeps; then `add` for each measured part
  precut check job.json                           every fault of a job at once
  precut compensate shaft.nc --job shaft.json -o shaft.c.nc
                                                  a program corrected, the diff on standard output
  precut solve job.json --lang ru                 the same in Russian
  precut example studies | precut solve - --format csv
  PRECUT_LOG_FORMAT=json precut                   settings from the environment

Exit codes:
  0  done
  1  the machine's fault: a file, the network, the data folder
  2  the command line or the job is at fault; the problem document on standard error lists every fault
  3  the job is in order but has no answer (infeasible, outside the model, not converged)

Settings: `precut --print-config` prints them all. Unlike other commands, `serve` writes a database.";

/// What to know before the cut: machining accuracy as a service.
///
/// Without a command it serves HTTP. The other commands compute right here: they need no server and write no
/// database.
#[derive(Debug, Parser)]
#[command(name = "precut", version, after_long_help = EXAMPLES, after_help = "See --help for examples and exit codes.")]
#[command(args_conflicts_with_subcommands = true, max_term_width = 110)]
struct Cli {
    #[command(flatten)]
    serve: ServeArgs,
    /// Language of answers, faults and labels
    #[arg(long, global = true, value_name = "LANGUAGE", env = "PRECUT_LANG", value_parser = spoken)]
    lang: Option<Language>,
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Serve HTTP until SIGTERM or Ctrl-C
    Serve(ServeArgs),
    /// Compute the answer to a job file
    Solve(SolveArgs),
    /// Check a job file without computing: prints the job with every default filled in
    Check(JobArgs),
    /// Correct a turning program: X of its finishing cuts shifted, every other line as it was
    #[command(
        after_help = "Exit codes: 0 lines changed, 3 nothing to change, 2 program or job not read, 1 no correction."
    )]
    Compensate(compensate::CompensateArgs),
    /// List the calculators with their questions
    List,
    /// List the machines that a job may name, or show one
    Machines(library::RecordArgs),
    /// List the tools that a job may name, or show one; a designation shows what it says
    Tools(library::RecordArgs),
    /// List the materials that a job may name, or show one
    Materials(library::RecordArgs),
    /// A process under watch: what changed, since which part, and what to do before the next
    Process(process::ProcessArgs),
    /// Print the JSON Schema of a calculator's job
    Schema {
        /// Name of the calculator, or `studies`
        calculator: String,
        /// The schema of the result in its place
        #[arg(long)]
        result: bool,
    },
    /// Print a job file that is ready to run
    Example {
        /// Name of the calculator, or `studies`
        calculator: String,
        /// Which example [default: the first]
        id: Option<String>,
        /// Only the job, as it is posted
        #[arg(long)]
        job: bool,
    },
    /// Compute one job for the service that started this
    #[command(hide = true)]
    Compute,
    /// Print the contract of the HTTP interface (OpenAPI 3.1)
    Openapi,
    /// Copy the database of a data folder as it is at one moment, while a service works with it or not
    Backup(backup::CopyArgs),
    /// Put a copy into a data folder that has no database
    Restore(backup::CopyArgs),
    /// Read every byte of a copy and say whether it is in order
    Verify(backup::VerifyArgs),
    /// Ask a running service whether it is ready; exit code 1 if not
    Health {
        /// Its address [default: PRECUT_ADMIN_LISTEN, PRECUT_LISTEN, or http://127.0.0.1:8080]
        #[arg(long, value_name = "URL")]
        url: Option<String>,
    },
    /// Read a key from standard input and print its hash for `auth.keys`
    #[command(after_help = "Example: openssl rand -hex 32 | tee cam.key | precut hash-key")]
    HashKey,
}

/// How to serve.
#[derive(Debug, Args)]
struct ServeArgs {
    /// File with settings (TOML)
    #[arg(long, value_name = "FILE", env = "PRECUT_CONFIG")]
    config: Option<PathBuf>,
    #[command(flatten)]
    flags: Flags,
    /// Print the settings in force as TOML, without secrets, and stop
    #[arg(long)]
    print_config: bool,
}

/// Where a job is.
#[derive(Debug, Args)]
struct JobArgs {
    /// Job file `{"calculator": "...", "job": {...}}` or `{"study": {...}}`; `-` reads standard input
    #[arg(value_name = "FILE", default_value = "-")]
    file: PathBuf,
    /// The file is the bare job of this calculator
    #[arg(long, short, value_name = "NAME")]
    calculator: Option<String>,
    /// What was measured, as a CSV file with units in its header, instead of rows in the job; `FIELD=FILE` for another
    /// table of the job
    #[arg(long, value_name = "FILE")]
    measured: Vec<String>,
    /// Stored model that extends the job, as `GET /v1/models/NAME` exported it; the job may name it
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// File with machines, tools and materials of your own (JSON, TOML or CSV), which the job may name
    #[arg(long, value_name = "FILE", conflicts_with = "data")]
    library: Option<PathBuf>,
    /// Data folder that has the stored model, machine, tool and material which the job names; a service may be using it
    #[arg(long, value_name = "DIR", conflicts_with = "model")]
    data: Option<PathBuf>,
}

#[derive(Debug, Args)]
struct SolveArgs {
    #[command(flatten)]
    job: JobArgs,
    /// Form of the answer
    #[arg(long, short, value_enum, default_value = "json")]
    format: job::Form,
    /// Which table, with `--format csv` [default: the first]
    #[arg(long, value_name = "NAME")]
    table: Option<String>,
    /// Which figure, with `--format svg` [default: the first]
    #[arg(long, value_name = "NAME")]
    figure: Option<String>,
    /// Write here instead of to standard output
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
}

/// A language by its tag.
fn spoken(tag: &str) -> Result<Language, String> {
    let known = Language::ALL.map(Language::tag).join(", ");
    Language::of_tag(tag).ok_or_else(|| format!("the languages are {known}"))
}

/// Why a command did not do what it was asked to.
#[derive(Debug)]
enum Failed {
    /// The command line or the job.
    Problem(Problem),
    /// The command line, in words.
    Usage(String),
    /// The machine, in words.
    Machine(String),
    /// A service does not take what is asked of it.
    Refused {
        /// Its problem document.
        text: String,
        /// Whether the fault is the service's.
        is_ours: bool,
    },
    /// The reader of our output has gone: nobody is left to tell.
    NobodyListens,
}

impl From<Problem> for Failed {
    fn from(problem: Problem) -> Self {
        Self::Problem(problem)
    }
}

impl From<Error> for Failed {
    fn from(error: Error) -> Self {
        Self::Problem(error.into())
    }
}

/// Runs the command that `arguments` spell (the first is the program's name), with the calculators of `registry`.
pub fn main(
    arguments: impl IntoIterator<Item = OsString>,
    registry: impl FnOnce() -> Result<Registry, RegistryError>,
) -> ExitCode {
    // Without knowing its own file it cannot start itself again, and does without.
    let isolation = std::env::current_exe().ok().map(|program| Isolation {
        program,
        arguments: vec![COMPUTE.into()],
        environment: Vec::new(),
    });
    main_as(arguments, registry, isolation)
}

/// The sub-command by which the program computes one job for a service that is its parent.
pub const COMPUTE: &str = "compute";

/// The same for a program that starts itself again in another way.
pub fn main_as(
    arguments: impl IntoIterator<Item = OsString>,
    registry: impl FnOnce() -> Result<Registry, RegistryError>,
    isolation: Option<Isolation>,
) -> ExitCode {
    let cli = match Cli::try_parse_from(arguments) {
        Ok(cli) => cli,
        Err(error) => {
            // Help and version go to standard output and are no error; a closed pipe is none either.
            let _ = error.print();
            return ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2));
        }
    };
    let language = cli.lang.unwrap_or_default();
    let outcome = registry()
        .map_err(|error| Failed::Machine(error.to_string()))
        .and_then(|registry| run(cli, &registry, isolation));
    match outcome {
        Ok(code) => code,
        Err(Failed::NobodyListens) => ExitCode::SUCCESS,
        Err(Failed::Usage(message)) => {
            let _ = writeln!(io::stderr(), "precut: {message}");
            ExitCode::from(2)
        }
        Err(Failed::Machine(message)) => {
            let _ = writeln!(io::stderr(), "precut: {message}");
            ExitCode::FAILURE
        }
        Err(Failed::Refused { text, is_ours }) => {
            let _ = writeln!(io::stderr(), "{text}");
            ExitCode::from(if is_ours { 1 } else { 2 })
        }
        Err(Failed::Problem(problem)) => {
            let document = problem.document(language, None);
            let text = serde_json::to_string_pretty(&document).unwrap_or_else(|_| document.detail.clone());
            let _ = writeln!(io::stderr(), "{text}");
            ExitCode::from(exit_code(&problem))
        }
    }
}

/// As the help says.
fn exit_code(problem: &Problem) -> u8 {
    match (problem.status().as_u16(), problem.code()) {
        (422, "invalid_job" | "invalid_model" | "invalid_record" | "too_expensive") => 2,
        (422, _) => 3,
        (400..=499, _) => 2,
        _ => 1,
    }
}

fn run(cli: Cli, registry: &Registry, isolation: Option<Isolation>) -> Result<ExitCode, Failed> {
    let language = cli.lang.unwrap_or_default();
    let done = match cli.command {
        Some(Command::Compensate(arguments)) => return compensate::run(&arguments, registry, language),
        None => serve::run(&cli.serve, registry.clone(), isolation),
        Some(Command::Serve(serve)) => serve::run(&serve, registry.clone(), isolation),
        Some(Command::Solve(solve)) => job::solve(&solve, registry, language),
        Some(Command::Check(job)) => job::check(&job, registry),
        Some(Command::List) => list(registry, language),
        Some(Command::Machines(records)) => library::show(Kind::Machine, &records, language),
        Some(Command::Tools(records)) => library::show(Kind::Tool, &records, language),
        Some(Command::Materials(records)) => library::show(Kind::Material, &records, language),
        Some(Command::Process(process)) => process::run(&process, registry, language),
        Some(Command::Schema { calculator, result }) => {
            let entry = entry(registry, &calculator)?;
            let document = if result { entry.output_document() } else { entry.input_document() };
            print_json(&text::described(&document, entry.meta().id, language))
        }
        Some(Command::Example { calculator, id, job }) => {
            job::example(&*entry(registry, &calculator)?, id.as_deref(), job)
        }
        Some(Command::Compute) => Engine::compute_alone(registry, io::stdin(), &mut io::stdout().lock())
            .map_err(|error| Failed::Machine(format!("a job of another process: {error}"))),
        Some(Command::Openapi) => print(openapi::json(registry).as_bytes()),
        Some(Command::Backup(copy)) => backup::take(&copy),
        Some(Command::Restore(copy)) => backup::put_back(&copy),
        Some(Command::Verify(copy)) => backup::check(&copy),
        Some(Command::Health { url }) => health::ask(url),
        Some(Command::HashKey) => hash_key(),
    };
    done.map(|()| ExitCode::SUCCESS)
}

fn list(registry: &Registry, language: Language) -> Result<(), Failed> {
    let width = registry.entries().iter().map(|entry| entry.meta().id.len()).max().unwrap_or(0);
    let mut lines = String::new();
    for meta in registry.entries().iter().map(|entry| entry.meta()) {
        let _ = writeln!(lines, "{:width$}  {}", meta.id, Glossary::of(language).help(meta.question));
    }
    print(lines.as_bytes())
}

fn hash_key() -> Result<(), Failed> {
    let mut key = String::new();
    io::stdin().read_to_string(&mut key).map_err(|error| Failed::Machine(format!("standard input: {error}")))?;
    let key = key.trim();
    if key.len() < 16 {
        return Err(Failed::Usage("a key has at least 16 characters; make one with `openssl rand -hex 32`".to_owned()));
    }
    print(format!("{}\n", auth::hash(key)).as_bytes())
}

/// A calculator, or parameter studies.
fn entry(registry: &Registry, name: &str) -> Result<Arc<Entry>, Failed> {
    if name == STUDIES {
        return Ok(studies_of(registry));
    }
    Ok(registry.entry(name).cloned().ok_or_else(|| Error::unknown(registry, name))?)
}

fn print_json(value: &impl serde::Serialize) -> Result<(), Failed> {
    let mut text = serde_json::to_string_pretty(value).map_err(|error| Failed::Machine(error.to_string()))?;
    text.push('\n');
    print(text.as_bytes())
}

/// To standard output.
fn print(bytes: &[u8]) -> Result<(), Failed> {
    let mut out = io::stdout().lock();
    out.write_all(bytes).and_then(|()| out.flush()).map_err(|error| match error.kind() {
        io::ErrorKind::BrokenPipe => Failed::NobodyListens,
        _ => Failed::Machine(format!("standard output: {error}")),
    })
}
