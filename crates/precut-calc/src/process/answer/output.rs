//! What is said after a part (`process/4`).

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use crate::calculator::Message;
use crate::process::history::account::Gain;

/// How the process stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Situation {
    /// Too few parts to call anything a change.
    Learning,
    /// As the model says.
    InControl,
    /// Something may be about to change.
    Warning,
    /// Something changed.
    Changed,
}

/// Why a part says nothing of the process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Unused {
    /// Fewer than four rows.
    TooFewRows,
    /// The rows are those of an earlier part to the last digit.
    CopiedRows,
    /// The rows are those before times a factor, as a wrong unit leaves.
    UnitSuspected,
    /// Too many rows stand alone.
    MeasureAgain,
}

/// Everything that is said after a part.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct State {
    /// The part.
    pub number: u32,
    /// How the process stands.
    pub state: Situation,
    /// Why the part was not used.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unused: Option<Unused>,
    /// The part against what was expected of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub score: Option<Score>,
    /// log10 of the statistic over its threshold: 0 is the alarm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub evidence: Option<f64>,
    /// What scatters, as learned.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scatter: Option<ScatterReport>,
    /// What changed last and is not yet part of the model, or was taken into it with this part.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub change: Option<Change>,
    /// All changes so far that joined the model, the last of them.
    pub changes: Vec<Change>,
    /// Parts that are odd by themselves, the last of them.
    pub odd_parts: Vec<OddPart>,
    /// Rows of this part that stand alone and are not used, from 0.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub odd_rows: Vec<usize>,
    /// What there is to say, most important first.
    pub explanation: Vec<Message>,
}

/// A part against what the parts before it let expect.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Score {
    /// Squared distance in units of its scatter.
    pub chi2: f64,
    /// How many rows it is of.
    pub degrees: usize,
    /// Probability of as much by chance.
    pub p: f64,
    /// How far the mean is off, in standard deviations.
    pub z_mean: f64,
    /// The same of the taper.
    pub z_taper: f64,
    /// The same of the bow.
    pub z_bow: f64,
}

/// What scatters from reading to reading and from part to part.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ScatterReport {
    /// Standard deviation of a reading, in the unit of the quantity.
    pub sigma: f64,
    /// Correlation of a reading with the next one.
    pub correlation: f64,
    /// Each allowance of a part relative to what was stated.
    pub allowance_factors: Vec<f64>,
}

/// How sure a change has a name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ChangeVerdict {
    /// One cause.
    Named,
    /// One of several.
    OneOf,
    /// None of the catalogue.
    Unnamed,
}

/// How a change goes on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ChangeForm {
    /// It stays as it is.
    Step,
    /// It grows from part to part; sizes are those after 20 parts.
    Drift,
}

/// What a person says of a change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Decided {
    /// It is one.
    Confirmed,
    /// It is none: what the parts show belongs to the process.
    Rejected,
    /// It is this cause.
    Named,
}

/// A change.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Change {
    /// `c1`, `c2`, in the order in which they were reported.
    pub id: String,
    /// How sure its name is.
    pub verdict: ChangeVerdict,
    /// The part after which it was reported.
    pub reported_at_part: u32,
    /// The part with which it began, most probably.
    pub since_part: u32,
    /// The shortest range of parts in which it began with 90 %.
    pub since_parts_90: [u32; 2],
    /// Whether it is part of the model.
    pub accepted: bool,
    /// What a person said of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub decided: Option<Decided>,
    /// Causes that together have 95 %, likeliest first.
    pub causes: Vec<ChangedCause>,
}

/// A cause that may have changed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChangedCause {
    /// Its kind in the catalogue; `gauge_offset` of the gauge, `unnamed` of what has none.
    pub kind: String,
    /// Which of several of one kind.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub label: String,
    /// Probability.
    pub share: f64,
    /// How it goes on.
    pub form: ChangeForm,
    /// The field of the effect that changed; of what has no name its root mean square along the part.
    pub parameter: Cow<'static, str>,
    /// Its unit.
    pub unit: Cow<'static, str>,
    /// By how much.
    pub delta: f64,
    /// The same with 95 %.
    pub interval_95: [f64; 2],
    /// Whether it lies beyond what the cause allows.
    pub at_bound: bool,
    /// Whether another cause of the list does the same to these parts.
    pub same_as_other: bool,
}

/// A part that is odd by itself.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OddPart {
    /// Its number.
    pub number: u32,
    /// `gauge_slip` where all of it is off alike, otherwise `blank_or_clamping`.
    pub reason: Cow<'static, str>,
}

/// What the next part will be like, and what to do.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outlook {
    /// What the process is taken to be.
    pub model: Model,
    /// The next part with the path as it was, and with a new one.
    pub forecast: Forecast,
    /// What to do.
    pub action: Action,
    /// What to measure, the best first.
    pub measure_next: Vec<Measure>,
    /// What paths brought so far.
    pub gain: Gain,
}

/// The base job's model with what the parts tell.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Model {
    /// 1 and one more with each change that joined it.
    pub revision: usize,
    /// Sizes of the causes that act beside the base job's effects: those that come and go with conditions, and those that changed.
    pub sizes: Vec<ModelSize>,
    /// Their covariance, in the units of the sizes.
    pub covariance: Vec<Vec<f64>>,
    /// What no cause explains, at the rows of the next part, in the unit of the quantity.
    pub remainder: Vec<f64>,
    /// Its standard deviation.
    pub remainder_deviation: Vec<f64>,
}

/// A field of an effect that gives its form.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ModelShape {
    /// The field.
    pub parameter: Cow<'static, str>,
    /// Its unit.
    pub unit: Cow<'static, str>,
    /// Its value.
    pub value: f64,
}

/// A size of the model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ModelSize {
    /// The kind of its cause in the catalogue.
    pub kind: String,
    /// Which of several of one kind.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub label: String,
    /// Since when it acts; absent where it always did.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub since_part: Option<u32>,
    /// How it goes on from there; of a drift the size is that after 20 parts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub form: Option<ChangeForm>,
    /// The form of the effect, where several of one kind act: the machine may warm up with several time constants.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub shape: Vec<ModelShape>,
    /// The field of the effect.
    pub parameter: Cow<'static, str>,
    /// Its unit.
    pub unit: Cow<'static, str>,
    /// By how much it differs from the base job's.
    pub delta: f64,
    /// The same with 95 %.
    pub interval_95: [f64; 2],
}

/// The next part.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Forecast {
    /// With the path of the last part.
    pub as_now: PathForecast,
    /// With the mean deviation taken out.
    pub new_path: PathForecast,
    /// With the path that the base job alone gives; as now where it gives none.
    pub base_path: PathForecast,
}

/// A part that is cut on one path.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PathForecast {
    /// Mean deviation at the rows of the last part, in the unit of the quantity.
    pub mean: Vec<f64>,
    /// Its standard deviation there, with what a part scatters by itself.
    pub deviation: Vec<f64>,
    /// Mean of largest minus smallest deviation, um on the diameter.
    pub form_um: f64,
    /// Probability that all of it lies within the drawing; absent where that allows anything.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub in_tolerance_probability: Option<f64>,
}

/// What to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ActionKind {
    /// Keep the program.
    Keep,
    /// Take a new one.
    NewPath,
    /// Put the master on the gauge.
    MeasureGauge,
    /// Measure more first.
    MeasureMore,
    /// Call a person.
    CallPerson,
}

/// What to do, and why.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Action {
    /// What.
    pub kind: ActionKind,
    /// Why.
    pub code: &'static str,
}

impl Action {
    /// Why, as a message.
    pub fn message(&self) -> Message {
        Message::new(self.code)
    }
}

/// Something to measure.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Measure {
    /// What.
    pub code: &'static str,
    /// The type of part, where it is another one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub part_type: Option<String>,
    /// The condition to change, where one is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub condition: Option<&'static str>,
    /// Its value, in the unit of the condition's field.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// How many stations along the part, where more than now.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stations: Option<usize>,
    /// Which two causes it tells apart.
    pub decides: [String; 2],
    /// By how much: expected Bayes factor of one such part or reading.
    pub expected_bayes_factor: f64,
}
