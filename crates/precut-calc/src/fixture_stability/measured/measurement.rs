//! A measured row of a workpiece that is milled in a vise.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{MeasuredRow, Measurement, Reading};
use crate::fixture_stability::FixtureStability;
use crate::fixture_stability::job::input::FixtureJob;
use crate::fixture_stability::measured::forward::{FixturePoint, RegimeMargin};

/// An amplitude at a depth, a point of a history, a depth at which chatter began, or how a cut went.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FixtureMeasurement {
    /// Number of the run that states its speed and feed, from 1 in the order of `runs`.
    #[serde(default = "one")]
    #[schema(minimum = 1, maximum = 10_000, default = 1, example = 1, extensions(("x-symbol" = json!("i")), ("x-unit" = json!("1"))))]
    pub run: u32,
    /// Number of the repetition; rows of one history stand in the order of time.
    #[serde(default = "one")]
    #[schema(minimum = 1, maximum = 10_000, default = 1, example = 1, extensions(("x-symbol" = json!("j")), ("x-unit" = json!("1"))))]
    pub repeat: u32,
    /// Axial depth of cut, where the run does not state it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1000.0, example = 2.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("H"))))]
    pub depth_mm: Option<f64>,
    /// Time since the entry, of a displacement.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1000.0, example = 0.05, extensions(("x-unit" = json!("s")), ("x-symbol" = json!("t"))))]
    pub time_s: Option<f64>,
    /// Largest minus smallest displacement of the workpiece along the feed, in the settled cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.000_001, maximum = 1e6, example = 12.3, extensions(("x-symbol" = json!("A")), ("x-unit" = json!("um"))))]
    pub peak_to_peak_um: Option<f64>,
    /// Displacement of the workpiece along the feed, positive toward the movable jaw.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = -1e6, maximum = 1e6, example = 4.5, extensions(("x-symbol" = json!("x")), ("x-unit" = json!("um"))))]
    pub displacement_um: Option<f64>,
    /// Depth at which chatter began at this speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.000_001, maximum = 1000.0, example = 3.2, extensions(("x-symbol" = json!("a_lim")), ("x-unit" = json!("mm"))))]
    pub depth_limit_mm: Option<f64>,
    /// How the cut at this depth went.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(inline, example = "stable")]
    pub regime: Option<ObservedRegime>,
    /// Standard uncertainty of an amplitude or a displacement.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-9, maximum = 1e6, example = 0.2, extensions(("x-symbol" = json!("u")), ("x-unit" = json!("um"))))]
    pub uncertainty_um: Option<f64>,
    /// Standard uncertainty of a depth limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-9, maximum = 1000.0, example = 0.1, extensions(("x-symbol" = json!("u")), ("x-unit" = json!("mm"))))]
    pub uncertainty_mm: Option<f64>,
    /// Whether the row is set aside: listed, not used.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    #[schema(default = false, example = false)]
    pub excluded: bool,
}

/// How a cut went.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ObservedRegime {
    /// The workpiece moved with the teeth alone, in closed joints.
    Stable,
    /// It swung up by itself, whatever the joints did then.
    Chatter,
    /// A joint opened in a cut that had not begun to chatter.
    Opened,
}

impl ObservedRegime {
    fn name(self) -> &'static str {
        match self {
            Self::Stable => "stable",
            Self::Chatter => "chatter",
            Self::Opened => "opened",
        }
    }

    /// The margins that this class speaks about, with the side of zero on which each lay. Of a chattering cut nobody knows
    /// whether the forced motion alone would have opened a joint.
    fn sides(self, has_clamp_force: bool) -> Vec<(RegimeMargin, f64)> {
        let quiet = (RegimeMargin::Chatter, 1.0);
        match self {
            Self::Chatter => vec![(RegimeMargin::Chatter, -1.0)],
            Self::Opened => vec![quiet, (RegimeMargin::Opening, -1.0)],
            Self::Stable if has_clamp_force => vec![quiet, (RegimeMargin::Opening, 1.0)],
            Self::Stable => vec![quiet],
        }
    }
}

fn one() -> u32 {
    1
}

impl MeasuredRow for FixtureMeasurement {
    const MAX_ROWS: usize = 20_000;
    const MEASURED: &'static [&'static str] = &["peak_to_peak_um", "displacement_um", "depth_limit_mm", "regime"];
}

impl Measurement for FixtureMeasurement {
    type Model = FixtureStability;

    fn run(&self) -> u32 {
        self.run
    }

    fn trace(&self) -> u32 {
        self.repeat
    }

    fn point(&self) -> FixturePoint {
        let margin = RegimeMargin::default();
        FixturePoint { depth_mm: self.depth_mm, repeat: Some(self.repeat), time_s: self.time_s, margin }
    }

    fn value(&self, quantity: &str) -> Option<f64> {
        match quantity {
            "peak_to_peak_um" => self.peak_to_peak_um,
            "displacement_um" => self.displacement_um,
            "depth_limit_mm" => self.depth_limit_mm,
            "regime" => self.regime.map(|class| if class == ObservedRegime::Stable { 1.0 } else { -1.0 }),
            _ => None,
        }
    }

    fn readings(&self, job: &FixtureJob, quantity: &str) -> Vec<Reading<FixturePoint>> {
        let Some(class) = self.regime.filter(|_| quantity == "regime") else {
            let value = self.value(quantity);
            return value
                .map(|value| Reading { point: self.point(), value, class: "", asks: "" })
                .into_iter()
                .collect();
        };
        let (_, _, _, clamp_force_n) = job.fixture.common();
        let of = |(margin, value): (RegimeMargin, f64)| {
            let point = FixturePoint { margin, ..self.point() };
            Reading { point, value, class: class.name(), asks: margin.name() }
        };
        class.sides(clamp_force_n.is_some()).into_iter().map(of).collect()
    }

    fn uncertainty(&self) -> Option<f64> {
        if self.depth_limit_mm.is_some() { self.uncertainty_mm } else { self.uncertainty_um }
    }

    fn excluded(&self) -> bool {
        self.excluded
    }
}
