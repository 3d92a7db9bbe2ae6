//! Processes under watch, without a server.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use precut_calc::calculator::Unwatched;
use precut_calc::process::{Outlook, State};
use serde_json::{Value, json};

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
    let ProcessCommand::Replay(replay) = &arguments.command;
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
