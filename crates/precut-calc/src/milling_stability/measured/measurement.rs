//! A row of a log of cuts.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{MeasuredRow, Measurement, Reading};

use super::super::MillingStability;
use super::super::job::Job;
use super::forward::{CutMargin, MillingPoint};

/// A cut, how it went, and the frequency that was heard where it chattered.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MillingMeasurement {
    /// Number of the run whose conditions hold where the row states none, from 1 in the order of `runs`.
    #[serde(default = "one")]
    #[schema(minimum = 1, maximum = 10_000, default = 1, example = 1, extensions(("x-symbol" = json!("i")), ("x-unit" = json!("1"))))]
    pub run: u32,
    /// Spindle speed; that of the run or of the job where it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.1, maximum = 200_000.0, example = 9500.0, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n"))))]
    pub spindle_speed_rpm: Option<f64>,
    /// Axial depth of cut; that of the run or of the job where it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1000.0, example = 1.5, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("H"))))]
    pub depth_mm: Option<f64>,
    /// Width of the milled strip; that of the run or of the job where it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.001, maximum = 5000.0, example = 8.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("a_e"))))]
    pub width_mm: Option<f64>,
    /// How the cut went.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(inline, example = "stable")]
    pub class: Option<ObservedCut>,
    /// Strongest frequency of the chatter that was heard, beside those of the teeth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.1, maximum = 1e6, example = 1460.0, extensions(("x-unit" = json!("Hz")), ("x-symbol" = json!("f_c"))))]
    pub frequency_hz: Option<f64>,
    /// Whether the row is set aside: listed, not used.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    #[schema(default = false, example = false)]
    pub excluded: bool,
}

/// How a cut went.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ObservedCut {
    /// Tool and workpiece moved with the teeth alone.
    Stable,
    /// They swung up by themselves.
    Chatter,
}

impl ObservedCut {
    fn name(self) -> &'static str {
        match self {
            Self::Stable => "stable",
            Self::Chatter => "chatter",
        }
    }

    /// On which side of zero the margin of chatter lay.
    fn side(self) -> f64 {
        match self {
            Self::Stable => 1.0,
            Self::Chatter => -1.0,
        }
    }
}

fn one() -> u32 {
    1
}

impl MeasuredRow for MillingMeasurement {
    const MAX_ROWS: usize = 2000;
    const MEASURED: &'static [&'static str] = &["class"];
}

impl Measurement for MillingMeasurement {
    type Model = MillingStability;

    fn run(&self) -> u32 {
        self.run
    }

    fn trace(&self) -> u32 {
        1
    }

    fn point(&self) -> MillingPoint {
        MillingPoint {
            spindle_speed_rpm: self.spindle_speed_rpm,
            depth_mm: self.depth_mm,
            width_mm: self.width_mm,
            frequency_hz: self.frequency_hz,
            margin: CutMargin::Chatter,
            is_stable: self.class == Some(ObservedCut::Stable),
        }
    }

    fn value(&self, quantity: &str) -> Option<f64> {
        self.class.filter(|_| quantity == "class").map(ObservedCut::side)
    }

    fn readings(&self, _job: &Job, quantity: &str) -> Vec<Reading<MillingPoint>> {
        let Some(class) = self.class.filter(|_| quantity == "class") else { return Vec::new() };
        let of = |margin: CutMargin, value: f64| {
            let point = MillingPoint { margin, ..self.point() };
            Reading { point, value, class: class.name(), asks: margin.name() }
        };
        // What was heard stands where the model swings as fast.
        let heard = self.frequency_hz.map(|_| of(CutMargin::Frequency, 0.0));
        [of(CutMargin::Chatter, class.side())].into_iter().chain(heard).collect()
    }

    fn uncertainty(&self) -> Option<f64> {
        None
    }

    fn excluded(&self) -> bool {
        self.excluded
    }
}
