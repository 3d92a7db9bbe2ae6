//! Processes under watch of a calculator, with its types closed over.

use precut_calc::calculator::{Failure, Finding, Monitor, Watched};
use precut_calc::process::{DocumentOf, Outlook, PartOf, State, Watch, faults};
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::second_line;

/// The parts of a process one after another.
pub(crate) type Replay = fn(Value, &dyn Monitor) -> Result<Replayed, NotReplayed>;

/// What was said after each part, and what is to be done before the next.
pub(crate) struct Replayed {
    pub(crate) states: Vec<State>,
    pub(crate) outlook: Option<Outlook>,
}

/// Why nothing was said.
pub(crate) enum NotReplayed {
    /// The process or a part is at fault.
    Faults(Vec<Finding>),
    /// The model is.
    Failed(Failure),
}

impl From<Failure> for NotReplayed {
    fn from(failure: Failure) -> Self {
        Self::Failed(failure)
    }
}

/// Replays `{..., "parts": [...]}`, whose jobs are filled.
pub(super) fn replay<M: Watched>(mut process: Value, monitor: &dyn Monitor) -> Result<Replayed, NotReplayed> {
    let parts = process.as_object_mut().and_then(|fields| fields.remove("parts")).unwrap_or_default();
    let parts: Vec<Value> = read(parts, "/parts")?;
    let each = parts.into_iter().enumerate();
    let parts: Vec<PartOf<M>> =
        each.map(|(index, part)| read(part, &format!("/parts/{index}"))).collect::<Result<_, _>>()?;
    let document: DocumentOf<M> = read(process, "")?;
    let found = faults::<M>(&document, &parts);
    if !found.is_empty() {
        return Err(NotReplayed::Faults(found));
    }
    let (mut watch, states) = Watch::<M>::replay(document, &parts, monitor)?;
    Ok(Replayed { states, outlook: watch.outlook(monitor)? })
}

fn read<T: DeserializeOwned>(value: Value, pointer: &str) -> Result<T, NotReplayed> {
    serde_path_to_error::deserialize(value)
        .map_err(|error| NotReplayed::Faults(vec![second_line(&error).under(pointer)]))
}
