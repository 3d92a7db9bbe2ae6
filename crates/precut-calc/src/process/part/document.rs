//! A process and its parts, as they are told.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{Calculator, Diagnosable, ForwardModel};

/// Parts of a process at most.
pub const MOST_PARTS: usize = 100_000;

/// A process: what is cut, by which model, and how it is watched.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Document<J, A> {
    /// Whose jobs it cuts.
    pub calculator: String,
    /// What is cut, by the name that parts state.
    pub part_types: BTreeMap<String, PartType<J>>,
    /// What is measured: a quantity of the calculator.
    pub quantity: String,
    /// How far one part scatters from the next without that being a change: standard deviations, from which those that the
    /// parts show are learned.
    #[serde(default)]
    pub allowances: A,
    /// Standard deviation of a single reading; learned from the first parts where it is not stated, um.
    #[serde(default)]
    pub noise_um: Option<f64>,
    /// How it is watched.
    #[serde(default)]
    pub options: Options,
}

/// What is cut.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PartType<J> {
    /// The calculator's job: tolerance, and the model with the effects that it holds.
    pub job: J,
}

/// How a process is watched.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
#[schema(as = ProcessOptions)]
pub struct Options {
    /// Mean number of parts from one false alarm to the next, 50 to 100 000.
    #[schema(minimum = 50, maximum = 100_000, default = 500, example = 500, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("Q"))))]
    pub false_alarm_every_parts: u32,
    /// Whether that number is the one that was measured, or one that is proved.
    pub threshold: Threshold,
    /// Parts before anything is called a change, 5 to 160.
    #[schema(minimum = 5, maximum = 160, default = 20, example = 20, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("n_0"))))]
    pub learning_parts: u32,
    /// Parts after an alarm until the change joins the model, 1 to 30.
    #[schema(minimum = 1, maximum = 30, default = 3, example = 3, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("n_s"))))]
    pub settle_parts: u32,
    /// How rarely the process is thought to change: once in so many parts, 10 to 100 000. Of the forecast alone.
    #[schema(minimum = 10, maximum = 100_000, default = 200, example = 200, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("Q_c"))))]
    pub change_every_parts: u32,
    /// How often a part is thought to be odd by itself, 0 to 0.1.
    #[schema(minimum = 0.0, maximum = 0.1, default = 0.01, example = 0.01, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("eps"))))]
    pub bad_part_share: f64,
    /// 2: one part that is off is waited out; 1: it may be called a change at once.
    #[schema(minimum = 1, maximum = 2, default = 2, example = 2, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("n_c"))))]
    pub changed_after_parts: u32,
    /// Over how many parts the mean profile is remembered, 200 to 1 000 000; the larger of 1000 and twice
    /// `false_alarm_every_parts` where not given.
    #[schema(minimum = 200, maximum = 1_000_000, example = 1000, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("H"))))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub memory_parts: Option<u32>,
    /// Farther than this no path is moved, um on the diameter.
    #[schema(minimum = 0.0, maximum = 100_000.0, default = 200.0, example = 200.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("o"))))]
    pub offset_limit_um: f64,
}

/// Where the alarm lies for a given mean number of parts between false alarms (`process/3.3`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Threshold {
    /// Where that number was measured.
    Calibrated,
    /// Where it is proved to be at least that number.
    Bound,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            false_alarm_every_parts: 500,
            threshold: Threshold::Calibrated,
            learning_parts: 20,
            settle_parts: 3,
            change_every_parts: 200,
            bad_part_share: 0.01,
            changed_after_parts: 2,
            memory_parts: None,
            offset_limit_um: 200.0,
        }
    }
}

impl Options {
    /// A: the alarm is where the statistic reaches it.
    pub fn alarm(&self) -> f64 {
        let every = f64::from(self.false_alarm_every_parts);
        match self.threshold {
            // Measured: A = 140 gives one false alarm in about 500 parts.
            Threshold::Calibrated => 0.28 * every,
            Threshold::Bound => every,
        }
    }

    pub(in crate::process) fn memory(&self) -> f64 {
        f64::from(self.memory_parts.unwrap_or_else(|| (2 * self.false_alarm_every_parts).max(1000)))
    }
}

/// A measured part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part<R, W> {
    /// Its place in the order of the process.
    pub number: u32,
    /// What it is.
    pub part_type: String,
    /// Conditions under which it was cut, and the path if it was not the nominal one; what they leave out is as in the job.
    pub conditions: R,
    /// Which cutting edge, counted up.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub edge: Option<u32>,
    /// Which batch of blanks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub batch: Option<String>,
    /// Readings of a master with the gauge that measured the part.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub gauge_checks: Vec<GaugeCheck>,
    /// Whether a person looked at what seemed wrong with it: rows of an earlier part, a wrong unit.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub confirmed: bool,
    /// What was measured, all in one run.
    pub measurements: Vec<W>,
}

/// A reading of a master.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct GaugeCheck {
    /// What the gauge showed beside the master's diameter, um.
    #[schema(minimum = -1e6, maximum = 1e6, example = 0.3, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("m"))))]
    pub measured_um: f64,
    /// Standard uncertainty, above 0 to 1000 um.
    #[schema(exclusive_minimum = 0.0, maximum = 1000.0, example = 0.4, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("u"))))]
    pub uncertainty_um: f64,
}

/// The document of a process of `M`.
pub type DocumentOf<M> = Document<<M as Calculator>::Input, <M as ForwardModel>::Allowances>;
/// A part of a process of `M`.
pub type PartOf<M> = Part<<M as ForwardModel>::Run, <M as Diagnosable>::Row>;
