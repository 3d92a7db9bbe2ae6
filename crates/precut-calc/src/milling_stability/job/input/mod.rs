//! The job: a cutter, a cut, what yields on either side, and what is asked.

mod asked;
mod cut;
mod cutter;
mod force;
mod spindle;
mod yielding;

use serde::{Deserialize, Serialize};
use utoipa::openapi::{RefOr, Schema};
use utoipa::{PartialSchema, ToSchema};

use crate::effects::MillingEffect;

use super::super::model::Side;
use super::held::PartClamping;
use super::uncertain::MillingUncertainty;

pub use asked::{Asked, CutLimits, LobePlane};
pub use cut::{ChipsAbout, Cut, Milling};
pub use cutter::Cutter;
pub use force::{EdgeForce, FlankRubbing, KienzleForce, MechanisticForce, PowerForce, RubbingSource};
pub use spindle::{MillSpindle, SpeedVariation};
pub use yielding::{NothingYields, Yielding, YieldingMode, YieldingModes, YieldingReceptances, YieldingVise};

/// A cutter in a cut, what yields of tool and workpiece, and what is to be known before it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(title = "MillingStabilityJob")]
pub struct Job {
    /// The cutter.
    #[schema(extensions(("x-group" = json!("tool"))))]
    pub cutter: Cutter,
    /// How the force of an edge follows from the thickness of its chip.
    #[schema(extensions(("x-group" = json!("cut"))))]
    pub force: EdgeForce,
    /// The working point.
    #[schema(extensions(("x-group" = json!("cut"))))]
    pub cut: Cut,
    /// What yields of the tool in its spindle.
    #[schema(extensions(("x-group" = json!("machine"))))]
    pub tool: Yielding,
    /// What yields of the workpiece in its fixture.
    #[schema(extensions(("x-group" = json!("machine"))))]
    pub work: Yielding,
    /// What the spindle can give; without it power, torque and speed limit nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-group" = json!("machine"))))]
    pub spindle: Option<MillSpindle>,
    /// How the workpiece is held; needed by the analysis `clamping` alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-group" = json!("machine"))))]
    pub clamping: Option<PartClamping>,
    /// Rubbing of the flank in the waves that it left, which damps slow cuts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-group" = json!("cut")), ("x-advanced" = json!(true))))]
    pub process_damping: Option<FlankRubbing>,
    /// A spindle speed that goes up and down as a sine.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-group" = json!("machine")), ("x-advanced" = json!(true))))]
    pub speed_variation: Option<SpeedVariation>,
    /// What chips, and the surfaces that teeth meet, are taken about where teeth stand out.
    #[serde(default)]
    #[schema(default = json!("forced_motion"), example = "forced_motion", extensions(("x-group" = json!("numerics")), ("x-advanced" = json!(true))))]
    pub about: ChipsAbout,
    /// What is uncertain in it, and which probability is wanted; acts with the analysis `certainty`.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("cut"))))]
    pub uncertainty: MillingUncertainty,
    /// What is asked. Force, torque and power and the zeroth order are always told.
    #[serde(default = "usual_analyses")]
    #[schema(max_items = 8, default = json!(["verdict", "intervals"]), example = json!(["verdict", "intervals", "lobes"]), extensions(("x-group" = json!("numerics"))))]
    pub analyses: Vec<Asked>,
    /// What must be kept, and how deep is looked.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("numerics"))))]
    pub limits: CutLimits,
    /// The plane of the lobe diagram; what it leaves out is chosen around the working point.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("numerics"))))]
    pub lobes: LobePlane,
    /// Named physical effects that act beside the base model; a kind occurs once, of modes once for each mode.
    #[serde(default)]
    #[schema(max_items = 64, extensions(("x-group" = json!("effects"))))]
    pub effects: Vec<MillingEffect>,
}

fn usual_analyses() -> Vec<Asked> {
    vec![Asked::Verdict, Asked::Intervals]
}

/// A number of a list, with its unit and range.
macro_rules! number {
    ($name:ident, $about:literal, $unit:literal, $symbol:literal, $least:literal, $most:literal, $example:literal) => {
        #[doc = $about]
        #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
        #[serde(transparent)]
        pub struct $name(pub f64);

        impl PartialSchema for $name {
            fn schema() -> RefOr<Schema> {
                let mut extensions = utoipa::openapi::extensions::Extensions::default();
                extensions.insert("x-unit".to_owned(), $unit.into());
                extensions.insert("x-symbol".to_owned(), $symbol.into());
                utoipa::openapi::schema::ObjectBuilder::new()
                    .schema_type(utoipa::openapi::schema::SchemaType::new(utoipa::openapi::schema::Type::Number))
                    .description(Some($about))
                    .minimum(Some($least))
                    .maximum(Some($most))
                    .examples([$example])
                    .extensions(Some(extensions))
                    .into()
            }
        }

        impl ToSchema for $name {}
    };
}

pub(super) use number;

number!(ToothPitch, "Angle from a tooth to the tooth before it, at the tip.", "deg", "theta_j", 0.1, 360.0, 90.0);

number!(ToothHelix, "Helix angle of one tooth.", "deg", "eta_j", -80.0, 80.0, 30.0);

number!(ToothOffset, "How far a tooth stands out or down.", "um", "rho_j", -1000.0, 1000.0, 10.0);

number!(CutWidth, "Width of a milled strip.", "mm", "a_e", 0.001, 5000.0, 8.0);

number!(DirectionPart, "Part of a direction along an axis of the fixture.", "1", "d", -1000.0, 1000.0, 1.0);

impl Job {
    /// Spindle speed of a job that states one of both speeds.
    pub(in crate::milling_stability) fn spindle_rpm(&self) -> Option<f64> {
        let by_speed = |v: f64| 1000.0 * v / (std::f64::consts::PI * self.cutter.diameter_mm);
        self.cut.spindle_speed_rpm.or_else(|| self.cut.speed_m_per_min.map(by_speed))
    }

    /// Feed per tooth of a job that states a feed.
    pub(in crate::milling_stability) fn feed_mm(&self) -> Option<f64> {
        self.cut.feed_mm_per_tooth.or_else(|| Some(self.feed_of_table_mm()?.0))
    }

    /// Feed per tooth by the table feed, and the table feed.
    pub(in crate::milling_stability) fn feed_of_table_mm(&self) -> Option<(f64, f64)> {
        let table = self.cut.feed_mm_per_min?;
        Some((table / (self.spindle_rpm()? * f64::from(self.cutter.teeth)), table))
    }

    pub(in crate::milling_stability) fn asks(&self, what: Asked) -> bool {
        self.analyses.contains(&what)
    }

    /// Whether a multiplier is asked for.
    pub(in crate::milling_stability) fn asks_stability(&self) -> bool {
        [Asked::Verdict, Asked::Intervals, Asked::Lobes, Asked::Speeds, Asked::Proposals]
            .into_iter()
            .any(|what| self.asks(what))
    }

    /// The job with each of the other widths in place of its own.
    pub(in crate::milling_stability) fn with_other_widths(&self) -> Vec<Self> {
        let own = self.cut.width_mm.unwrap_or(0.0);
        let others = self.cut.widths_mm.iter().map(|of| of.0).filter(|width| (width - own).abs() > 0.0);
        let with = |width_mm: f64| {
            let cut = Cut { width_mm: Some(width_mm), widths_mm: Vec::new(), ..self.cut.clone() };
            Self { cut, ..self.clone() }
        };
        others.map(with).collect()
    }

    /// Both sides with where they stand.
    pub(in crate::milling_stability) fn sides(&self) -> [(&'static str, Side, &Yielding); 2] {
        [("/tool", Side::Tool, &self.tool), ("/work", Side::Work, &self.work)]
    }

    /// One of both sides.
    pub(in crate::milling_stability) fn side_mut(&mut self, side: Side) -> &mut Yielding {
        match side {
            Side::Tool => &mut self.tool,
            Side::Work => &mut self.work,
        }
    }

    /// Whether a side is given by its frequency responses.
    pub(in crate::milling_stability) fn is_measured(&self) -> bool {
        self.sides().iter().any(|(.., yielding)| matches!(yielding, Yielding::Receptances(_)))
    }
}
