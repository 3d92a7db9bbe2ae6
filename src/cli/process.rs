//! Processes under watch: replayed without a server, or kept in a data folder or by a service.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use hyper::Method;
use precut_calc::calculator::Unwatched;
use precut_calc::process::{Outlook, State};
use serde_json::{Value, json};

use super::ask::{Asker, Question, Where};
use super::{Failed, job, print};
use crate::engine;
use crate::registry::Registry;
use crate::text::{Language, Texts};

#[derive(Debug, Args)]
pub(super) struct ProcessArgs {
    #[command(subcommand)]
    command: ProcessCommand,
}

#[derive(Debug, Subcommand)]
enum ProcessCommand {
    /// Say what would have been said after each part of a file, a line of JSON each; with the last, what to do next
    Replay(ReplayArgs),
    /// Declare a process, or declare it otherwise
    New(NewArgs),
    /// Report a measured part, and say what it says
    Add(AddArgs),
    /// Say what was said last
    State(Named),
    /// The next part: its job, or its program
    Next(NextArgs),
    /// All that happened, a line of JSON each
    History(Named),
    /// What paths of the process have brought
    Gain(Named),
}

/// A process that is kept.
#[derive(Debug, Args)]
struct Named {
    /// Its name
    name: String,
    #[command(flatten)]
    place: Where,
}

#[derive(Debug, Args)]
struct NewArgs {
    /// Process file without parts, or an exported record
    file: PathBuf,
    /// Its name [default: that of the file]
    #[arg(long)]
    name: Option<String>,
    #[command(flatten)]
    place: Where,
}

#[derive(Debug, Args)]
struct AddArgs {
    /// Name of the process
    name: String,
    /// The part as JSON, or its measured rows as CSV
    file: PathBuf,
    /// Its number
    #[arg(long)]
    number: Option<u32>,
    /// Its name [default: that of the file]
    #[arg(long)]
    part: Option<String>,
    /// Its type, with CSV
    #[arg(long, default_value = "A")]
    part_type: String,
    /// A condition of it, with CSV, as tool_path_at_start_m=731.2
    #[arg(long, value_name = "NAME=VALUE")]
    condition: Vec<String>,
    /// Revision of the part that is corrected
    #[arg(long, value_name = "REVISION")]
    correct: Option<u32>,
    #[command(flatten)]
    place: Where,
}

#[derive(Debug, Args)]
struct NextArgs {
    /// Name of the process
    name: String,
    /// Form of the answer
    #[arg(long, value_enum, default_value = "json")]
    format: NextForm,
    /// On which path [default: as the action says]
    #[arg(long, value_enum)]
    path: Option<NextPath>,
    /// Of which type
    #[arg(long)]
    part_type: Option<String>,
    #[command(flatten)]
    place: Where,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum NextForm {
    Json,
    Csv,
    Gcode,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum NextPath {
    #[value(name = "as_now")]
    AsNow,
    #[value(name = "new_path")]
    NewPath,
}

#[derive(Debug, Args)]
struct ReplayArgs {
    /// Process file `{"calculator": "...", "part_types": {...}, "quantity": "...", "parts": [...]}`; `-` reads standard
    /// input
    #[arg(value_name = "FILE", default_value = "-")]
    file: PathBuf,
    /// Only what is said after the last part
    #[arg(long)]
    last: bool,
}

/// `precut process`
pub(super) fn run(arguments: &ProcessArgs, registry: &Registry, language: Language) -> Result<(), Failed> {
    let (place, asked) = match &arguments.command {
        ProcessCommand::Replay(replay) => return replayed(replay, registry, language),
        ProcessCommand::New(new) => (&new.place, declare(new)?),
        ProcessCommand::Add(add) => (&add.place, report(add)?),
        ProcessCommand::State(of) => (&of.place, Question::get(address(&of.name, "/state"))),
        ProcessCommand::Next(next) => (&next.place, next_of(next)),
        ProcessCommand::History(of) => (&of.place, Question::get(address(&of.name, "/history?limit=500"))),
        ProcessCommand::Gain(of) => (&of.place, Question::get(address(&of.name, "/gain"))),
    };
    let is_history = matches!(arguments.command, ProcessCommand::History(_));
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build();
    let runtime = runtime.map_err(|error| Failed::Machine(format!("the threads cannot be started: {error}")))?;
    runtime.block_on(async {
        let asker = Asker::of(place, registry, language).await?;
        let outcome = if is_history { history(&asker, asked).await } else { told(&asker, asked).await };
        asker.close().await;
        outcome
    })
}

fn address(name: &str, rest: &str) -> String {
    format!("/v1/processes/{name}{rest}")
}

/// Name of a file without what it ends with.
fn stem(file: &std::path::Path) -> String {
    file.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default()
}

fn declare(new: &NewArgs) -> Result<Question, Failed> {
    let name = new.name.clone().unwrap_or_else(|| stem(&new.file));
    let body = Some(("application/json", job::bytes_of(&new.file)?));
    Ok(Question { method: Method::PUT, body, ..Question::get(address(&name, "")) })
}

fn report(add: &AddArgs) -> Result<Question, Failed> {
    let bytes = job::bytes_of(&add.file)?;
    let part = add.part.clone().unwrap_or_else(|| stem(&add.file));
    let path = address(&add.name, &format!("/parts/{part}"));
    let if_match = add.correct.map(|revision| revision.to_string());
    let is_csv = add.file.extension().is_some_and(|end| end.eq_ignore_ascii_case("csv"));
    if is_csv {
        let number = add.number.ok_or_else(|| Failed::Usage("measured rows alone need --number".to_owned()))?;
        let mut query = vec![format!("number={number}"), format!("part_type={}", add.part_type)];
        query.extend(add.condition.iter().cloned());
        let path = format!("{path}?{}", query.join("&"));
        return Ok(Question { method: Method::PUT, body: Some(("text/csv", bytes)), if_match, ..Question::get(path) });
    }
    let mut sent: Value = serde_json::from_slice(&bytes).map_err(|error| job::no_json(&error))?;
    if let Some(number) = add.number {
        sent["number"] = json!(number);
    }
    let body = Some(("application/json", sent.to_string().into_bytes()));
    Ok(Question { method: Method::PUT, body, if_match, ..Question::get(path) })
}

fn next_of(next: &NextArgs) -> Question {
    let path = next.path.map(|path| match path {
        NextPath::AsNow => "path=as_now".to_owned(),
        NextPath::NewPath => "path=new_path".to_owned(),
    });
    let part_type = next.part_type.as_ref().map(|part_type| format!("part_type={part_type}"));
    let query: Vec<String> = path.into_iter().chain(part_type).collect();
    let accept = match next.format {
        NextForm::Json => "application/json",
        NextForm::Csv => "text/csv",
        NextForm::Gcode => "text/x-gcode",
    };
    Question { accept, ..Question::get(address(&next.name, &format!("/next?{}", query.join("&")))) }
}

/// An answer as it is.
async fn told(asker: &Asker, question: Question) -> Result<(), Failed> {
    let mut bytes = asker.ask(question).await?;
    if !bytes.ends_with(b"\n") {
        bytes.push(b'\n');
    }
    print(&bytes)
}

/// Every entry, page after page.
async fn history(asker: &Asker, first: Question) -> Result<(), Failed> {
    let mut next = Some(first);
    while let Some(question) = next.take() {
        let bytes = asker.ask(question).await?;
        let page: Value = serde_json::from_slice(&bytes).map_err(|error| Failed::Machine(error.to_string()))?;
        let mut lines = String::new();
        for item in page["items"].as_array().into_iter().flatten() {
            lines.push_str(&item.to_string());
            lines.push('\n');
        }
        print(lines.as_bytes())?;
        next = page["next"].as_str().map(|next| Question::get(next.to_owned()));
    }
    Ok(())
}

/// `precut process replay`
fn replayed(replay: &ReplayArgs, registry: &Registry, language: Language) -> Result<(), Failed> {
    let bytes = job::bytes_of(&replay.file)?;
    let replayed = engine::replay(registry, &bytes, &Unwatched)?;
    let count = replayed.states.len();
    let mut lines = String::new();
    for (index, state) in replayed.states.iter().enumerate() {
        let is_last = index + 1 == count;
        if is_last || !replay.last {
            let outlook = replayed.outlook.as_ref().filter(|_| is_last);
            lines.push_str(&said(state, outlook, language)?.to_string());
            lines.push('\n');
        }
    }
    print(lines.as_bytes())
}

/// A state with its sentences.
fn said(state: &State, outlook: Option<&Outlook>, language: Language) -> Result<Value, Failed> {
    let written = |error: serde_json::Error| Failed::Machine(error.to_string());
    let mut fields = serde_json::to_value(state).map_err(written)?;
    let sentences = state.explanation.iter().map(|message| Texts::shared().remark(language, message));
    fields["explanation"] = serde_json::to_value(sentences.collect::<Vec<_>>()).map_err(written)?;
    if let Some(outlook) = outlook {
        fields["outlook"] = serde_json::to_value(outlook).map_err(written)?;
        let action = Texts::shared().message(language, "explanation", &outlook.action.message());
        fields["outlook"]["action"]["text"] = json!(action);
    }
    Ok(fields)
}
