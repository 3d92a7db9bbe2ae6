//! A process and its parts, as they are told.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

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
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Options {
    /// Mean number of parts from one false alarm to the next, 50 to 100 000.
    pub false_alarm_every_parts: u32,
    /// Whether that number is the one that was measured, or one that is proved.
    pub threshold: Threshold,
    /// Parts before anything is called a change, 5 to 160.
    pub learning_parts: u32,
    /// Parts after an alarm until the change joins the model, 1 to 30.
    pub settle_parts: u32,
    /// How rarely the process is thought to change: once in so many parts, 10 to 100 000. Of the forecast alone.
    pub change_every_parts: u32,
    /// How often a part is thought to be odd by itself, 0 to 0.1.
    pub bad_part_share: f64,
    /// 2: one part that is off is waited out; 1: it may be called a change at once.
    pub changed_after_parts: u32,
    /// Over how many parts the mean profile is remembered, 200 to 1 000 000; the larger of 1000 and twice
    /// `false_alarm_every_parts` where not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub memory_parts: Option<u32>,
    /// Farther than this no path is moved, um on the diameter.
    pub offset_limit_um: f64,
}

/// Where the alarm lies for a given mean number of parts between false alarms (`process/3.3`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
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

    pub(super) fn memory(&self) -> f64 {
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
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GaugeCheck {
    /// What the gauge showed beside the master's diameter, um.
    pub measured_um: f64,
    /// Standard uncertainty, above 0 to 1000 um.
    pub uncertainty_um: f64,
}
