//! Processes under watch of a calculator, with its types closed over.

use precut_calc::calculator::{
    Calculator, Failure, Finding, ForwardModel, Measured, MeasuredRow, Measurement, Monitor, Unwatched, Watched,
};
use precut_calc::process::{
    Decision, DocumentOf, GAUGE_SIZE, GaugeCheck, Options, Outlook, PartOf, State, Watch, faults,
};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use utoipa::openapi::{RefOr, Schema};
use utoipa::{PartialSchema, ToSchema};

use super::{Entry, second_line};

/// The parts of a process one after another.
type Replay = fn(Value, &dyn Monitor) -> Result<Replayed, NotReplayed>;

/// A process as it was kept.
type Resume = fn(Value, Value, Vec<Value>) -> Result<Box<dyn Watching>, NotReplayed>;

/// How a process of a calculator is watched.
pub(crate) struct Observed {
    pub(crate) replay: Replay,
    /// A process before its first part, by its document.
    pub(crate) begin: fn(Value) -> Result<Box<dyn Watching>, NotReplayed>,
    /// A process as it was kept, by its document, what was kept, and its parts since the first that is needed.
    pub(crate) resume: Resume,
    /// Every fault of a document and of some parts, in whatever order.
    pub(crate) faults: fn(Value, Vec<Value>) -> Vec<Finding>,
    /// The path that a result commands, as conditions of a part that is cut on it; nothing where it commands none.
    pub(crate) commanded: fn(Value) -> Option<Value>,
    /// Conditions of a part that come and go, which may be told of the next one.
    pub(crate) conditions: &'static [&'static str],
    /// Kind, field and unit of all that the model of a process may have a size of.
    pub(crate) sizes: Vec<(&'static str, &'static str, &'static str)>,
    /// What a document and a part are made of as they are sent.
    pub(crate) document: Box<Entry>,
    pub(crate) part: Box<Entry>,
}

impl Observed {
    pub(super) fn of<M: Watched>() -> Self {
        let meta = <M as Calculator>::META;
        let quantities: Vec<&str> = <M as ForwardModel>::QUANTITIES
            .iter()
            .map(|quantity| quantity.name)
            .filter(|name| M::per_diameter_um(name) > 0.0)
            .collect();
        Self {
            replay: replay::<M>,
            begin: |document| Ok(Box::new(Watch::<M>::new(read(document, "")?))),
            resume: resume::<M>,
            faults: |document, parts| read_all::<M>(document, parts).map_or_else(found, |(d, p)| faults::<M>(&d, &p)),
            commanded: |result| {
                let output: <M as Calculator>::Output = serde_json::from_value(result).ok()?;
                serde_json::to_value(M::commanded(&output)?).ok()
            },
            // A registry lives as long as the process.
            conditions: Vec::leak(M::conditions(&M::Run::default()).into_iter().map(|(name, _)| name).collect()),
            sizes: <M as ForwardModel>::CAUSES
                .iter()
                .flat_map(|cause| cause.parameters.iter().map(|own| (cause.kind, own.name, own.unit)))
                .chain([GAUGE_SIZE])
                .collect(),
            document: Box::new(Entry::of_body::<ProcessBody<M::Allowances>>(&meta, move |body| {
                let fields = &mut body["properties"];
                fields["quantity"]["enum"] = json!(quantities);
                fields["options"]["properties"]["path"] = json!({
                    "type": "string", "enum": ["advise", "auto"], "default": "advise",
                    "description": "Whether a new path is only proposed, or given out at once.",
                });
            })),
            part: Box::new(Entry::of_body::<PartBody<M::Run, M::Row>>(&meta, |body| {
                let conditions = &mut body["properties"]["conditions"];
                conditions["properties"]["edge"] = json!({
                    "type": "integer", "minimum": 0, "maximum": 1_000_000_000, "examples": [4],
                    "x-unit": "1", "x-symbol": "i", "description": "Which cutting edge, counted up.",
                });
                conditions["properties"]["batch"] = json!({
                    "type": "string", "maxLength": 100, "examples": ["H-1187"],
                    "description": "Which batch of blanks.",
                });
            })),
        }
    }
}

/// A process as it is declared.
#[derive(ToSchema)]
#[allow(dead_code)] // the contract of a body that the engine reads
struct ProcessBody<A: ToSchema> {
    /// Whose jobs it cuts.
    #[schema(example = "deflection-compensation")]
    calculator: String,
    /// What is cut: by the name that parts state, `{"job": ...}` with a whole job of the calculator.
    #[schema(value_type = Object)]
    part_types: Value,
    /// Stored model that extends every job: `name` or `name@revision`.
    #[schema(nullable = false, max_length = 80, example = "lathe-7")]
    model: Option<String>,
    /// Name of the quantity that is measured.
    #[schema(example = "diameter_deviation_um")]
    quantity: String,
    /// How far one part scatters from the next without that being a change.
    #[schema(inline, nullable = false)]
    allowances: Option<A>,
    /// Standard deviation of a single reading; learned from the first parts where it is not stated.
    #[schema(exclusive_minimum = 0.0, maximum = 1000.0, example = 1.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("sigma"))))]
    noise_um: Option<f64>,
    /// How it is watched.
    #[schema(inline, nullable = false)]
    options: Option<Options>,
    /// Whether a person stopped it: parts are recorded, nothing is commanded.
    #[schema(default = false, nullable = false)]
    stopped: Option<bool>,
    /// Who is told when something is said of it: a signed event is posted there. Hosts have to be allowed (`callbacks.hosts`).
    #[schema(inline, nullable = false)]
    callback: Option<ProcessCallback>,
}

/// Who is told what is said of a process.
#[derive(ToSchema)]
#[allow(dead_code)] // the contract of a body that the engine reads
struct ProcessCallback {
    /// Address.
    #[schema(max_length = 2048, example = "https://mes.plant.example/precut")]
    url: String,
    /// What is told; changes, parts that stand alone and warnings where it is left out.
    #[schema(nullable = false, min_items = 1, max_items = 7)]
    events: Option<Vec<ToldEvent>>,
}

/// What is told of a process.
#[derive(ToSchema)]
#[schema(rename_all = "snake_case")]
#[allow(dead_code)] // the contract of a body that the engine reads
enum ToldEvent {
    /// A part came or was corrected.
    Part,
    /// A part was withdrawn.
    Withdrawn,
    /// Parts are unusual; nothing is called a change yet.
    Warning,
    /// A change was reported.
    Change,
    /// A change joined the model.
    Accepted,
    /// A part stands alone.
    OddPart,
    /// Parts were judged anew.
    Replayed,
}

/// A measured part as it is sent.
#[derive(ToSchema)]
#[allow(dead_code)] // the contract of a body that the engine reads
struct PartBody<R: ToSchema, W: MeasuredRow + Measurement> {
    /// Its place in the order of the process.
    #[schema(minimum = 1, maximum = 1_000_000_000, example = 39, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("n"))))]
    number: u32,
    /// What it is: one of the process's `part_types`.
    #[schema(max_length = 100, example = "A")]
    part_type: String,
    /// Conditions under which it was cut; what they leave out is as in the job.
    #[schema(inline, nullable = false)]
    conditions: Option<R>,
    /// The path on which it was cut; stated once a path was given out.
    #[schema(nullable = false)]
    path: Option<PartPath>,
    /// Readings of a master with the gauge that measured the part.
    #[schema(nullable = false, max_items = 100)]
    gauge_checks: Option<Vec<GaugeCheck>>,
    /// Whether a person looked at what seemed wrong with it: rows of an earlier part, a wrong unit.
    #[schema(nullable = false, default = false, example = false)]
    confirmed: Option<bool>,
    /// What was measured, all in one run.
    #[schema(schema_with = measurements::<W>)]
    measurements: Measured<W>,
}

fn measurements<W: MeasuredRow>() -> RefOr<Schema> {
    Measured::<W>::schema()
}

/// The path on which a part was cut.
#[derive(ToSchema)]
#[allow(dead_code)] // the contract of a body that the engine reads
#[schema(as = PartPath)]
struct PartPath {
    /// `nominal`: the drawing's; `process`: one that the process gave out; `own`: that of `conditions.commanded_path`.
    kind: PartPathKind,
    /// Of a path of the process: which.
    #[schema(nullable = false, minimum = 1, maximum = 1_000_000, example = 2, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("r"))))]
    revision: Option<u32>,
}

/// Where the path of a part comes from.
#[derive(ToSchema)]
#[allow(dead_code)] // the contract of a body that the engine reads
#[schema(rename_all = "snake_case")]
enum PartPathKind {
    Nominal,
    Process,
    Own,
}

/// A process, part by part.
pub(crate) trait Watching: Send + Sync {
    /// A part more, of a higher number than all before it and without faults.
    fn take(&mut self, part: Value, monitor: &dyn Monitor) -> Result<State, NotReplayed>;
    /// What is to be said before a part is taken, because a person should look at it first.
    fn doubts(&mut self, part: Value, monitor: &dyn Monitor) -> Result<Vec<Finding>, NotReplayed>;
    /// The next part; nothing while the process is learned.
    fn outlook(&mut self, monitor: &dyn Monitor) -> Result<Option<Outlook>, Failure>;
    /// The job of the next part of a type, with what is known of the process in it; under the conditions of the last part but
    /// for those given by name. Nothing while the process is learned, and of a type that no part was of.
    fn next(
        &mut self,
        part_type: &str,
        conditions: &[(String, f64)],
        monitor: &dyn Monitor,
    ) -> Result<Option<Value>, Failure>;
    /// The model as later jobs take it, `{"effects", "effects_uncertainty", "part_type", "with_profile"}`; nothing while the process
    /// is learned.
    fn stored(&mut self, monitor: &dyn Monitor) -> Result<Option<Value>, Failure>;
    /// What a person says of a change, and what is said then; nothing where that does not fit.
    fn decide(&mut self, change: &str, decision: &Decision) -> Option<State>;
    /// What is kept of it, and the number of the first part that is needed to go on from there.
    fn snapshot(&self) -> (Value, u32);
    /// The same once more.
    fn copy(&self) -> Box<dyn Watching>;
}

impl<M: Watched> Watching for Watch<M> {
    fn take(&mut self, part: Value, monitor: &dyn Monitor) -> Result<State, NotReplayed> {
        Ok(Watch::take(self, &read(part, "")?, monitor)?)
    }

    fn doubts(&mut self, part: Value, monitor: &dyn Monitor) -> Result<Vec<Finding>, NotReplayed> {
        Ok(Watch::doubts(self, &read(part, "")?, monitor)?)
    }

    fn outlook(&mut self, monitor: &dyn Monitor) -> Result<Option<Outlook>, Failure> {
        Watch::outlook(self, monitor)
    }

    fn next(
        &mut self,
        part_type: &str,
        conditions: &[(String, f64)],
        monitor: &dyn Monitor,
    ) -> Result<Option<Value>, Failure> {
        let last = self.last_conditions().map_or_else(M::Run::default, |(_, run)| run.clone());
        let mut run = json!(last);
        for (name, value) in conditions {
            run[name] = json!(value);
        }
        let run: M::Run = serde_json::from_value(run).map_err(|error| Failure::Internal(error.to_string()))?;
        Ok(Watch::next(self, part_type, &run, monitor)?.map(|next| json!(next.job)))
    }

    fn stored(&mut self, monitor: &dyn Monitor) -> Result<Option<Value>, Failure> {
        Ok(Watch::stored(self, monitor)?.map(|model| json!(model)))
    }

    fn decide(&mut self, change: &str, decision: &Decision) -> Option<State> {
        Watch::decide(self, change, decision)
    }

    fn snapshot(&self) -> (Value, u32) {
        let snapshot = Watch::snapshot(self);
        let first = snapshot.first_part().unwrap_or(u32::MAX);
        (json!(snapshot), first)
    }

    fn copy(&self) -> Box<dyn Watching> {
        Box::new(Watch::copy(self))
    }
}

/// What was said after each part, and what is to be done before the next.
pub(crate) struct Replayed {
    pub(crate) states: Vec<State>,
    pub(crate) outlook: Option<Outlook>,
}

/// Why nothing was said.
#[derive(Debug)]
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
fn replay<M: Watched>(mut process: Value, monitor: &dyn Monitor) -> Result<Replayed, NotReplayed> {
    let parts = process.as_object_mut().and_then(|fields| fields.remove("parts")).unwrap_or_default();
    let (document, parts) = read_all::<M>(process, read(parts, "/parts")?)?;
    let found = faults::<M>(&document, &parts);
    if !found.is_empty() {
        return Err(NotReplayed::Faults(found));
    }
    let (mut watch, states) = Watch::<M>::replay(document, &parts, monitor)?;
    Ok(Replayed { states, outlook: watch.outlook(monitor)? })
}

fn resume<M: Watched>(document: Value, kept: Value, parts: Vec<Value>) -> Result<Box<dyn Watching>, NotReplayed> {
    let (document, parts) = read_all::<M>(document, parts)?;
    Ok(Box::new(Watch::<M>::from_snapshot(document, read(kept, "")?, &parts, &Unwatched)?))
}

fn read_all<M: Watched>(document: Value, parts: Vec<Value>) -> Result<(DocumentOf<M>, Vec<PartOf<M>>), NotReplayed> {
    let each = parts.into_iter().enumerate();
    let parts = each.map(|(index, part)| read(part, &format!("/parts/{index}"))).collect::<Result<_, _>>()?;
    Ok((read(document, "")?, parts))
}

fn found(error: NotReplayed) -> Vec<Finding> {
    match error {
        NotReplayed::Faults(findings) => findings,
        NotReplayed::Failed(failure) => vec![Finding::new("not_readable", "").with("reason", failure.to_string())],
    }
}

fn read<T: DeserializeOwned>(value: Value, pointer: &str) -> Result<T, NotReplayed> {
    serde_path_to_error::deserialize(value)
        .map_err(|error| NotReplayed::Faults(vec![second_line(&error).under(pointer)]))
}
