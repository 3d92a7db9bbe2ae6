//! Cutting forces in turning as functions of depth, feed and speed.
//!
//! A [`ForceModel`] is what a job says; [`ForceModel::at`] makes of it, for one feed and one speed,
//! a [`DepthLaw`]: passive, main and feed force over the engaged depth, with slopes. Directions:
//! passive `P_y` radially away from the tool, main `P_z` along the cutting speed, feed `P_x` against
//! the feed; all three are what the tool does to the work, N, positive.

mod constant;
pub mod handbook;
mod kienzle;
mod law;
mod monomial;
mod power;
mod range;
mod rules;
mod schema;
mod sine_integral;
mod table;

pub use constant::Constant;
pub use handbook::{Handbook, WorkMaterial};
pub use kienzle::Kienzle;
pub use law::{Component, DepthLaw};
pub use monomial::Monomial;
pub use power::{CoefficientOrigin, MeasuredRange, PowerLaw, PowerTerm};
pub use range::ReachedCut;
pub use table::{ForceRow, ForceTable};

use range::Range;
pub(crate) use schema::choice;
pub(crate) use sine_integral::SineIntegral;

use crate::calculator::{Basis, Finding, Violations};
use serde::{Deserialize, Serialize};
use utoipa::openapi::extensions::Extensions;
use utoipa::openapi::schema::OneOfBuilder;
use utoipa::openapi::{RefOr, Schema};
use utoipa::{PartialSchema, ToSchema};

/// Codes of the faults that [`ForceModel::check`] may find.
pub const FAULT_CODES: &[&str] = &[
    "bad_constant_force",
    "bad_force_table",
    "bad_kienzle",
    "bad_lead_angle",
    "bad_nose_radius",
    "bad_power_law",
    "bad_rubbing_force",
    "bad_wear_factor",
    "bad_work_material",
    "factor_not_tabulated",
    "feed_force_missing",
    "kienzle_or_material",
    "material_factor_missing",
    "material_factor_outside_table",
    "material_or_class",
    "material_without_force_law",
    "no_handbook_row",
    "outside_handbook_table",
    "passive_force_missing",
    "term_or_ratio",
    "unknown_material",
];

/// Codes of the warnings of [`ForceModel::extrapolations`] and [`ForceModel::cautions`].
pub const WARNING_CODES: &[&str] = &[
    "extrapolated_force_model",
    "feed_exceeds_nose_radius",
    "edge_angle_beyond_table",
    "unconfirmed_force_coefficient",
];

/// Codes of the refusals of [`ForceModel::far_beyond`].
pub const FAILURE_CODES: &[&str] = &["far_beyond_force_model"];

/// Material of the cutting edge, as the handbook's tables distinguish it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ToolMaterial {
    /// Cemented carbide.
    #[default]
    Carbide,
    /// High-speed steel.
    Hss,
}

/// The three components of the cutting force, N.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Forces {
    /// Passive (radial) force P_y, away from the tool.
    #[serde(default)]
    #[schema(minimum = 0, maximum = 1_000_000, default = 0.0, example = 60.0,
        extensions(("x-unit" = json!("N")), ("x-symbol" = json!("P_y")), ("x-group" = json!("cut"))))]
    pub passive_n: f64,
    /// Main (tangential) force P_z, along the cutting speed.
    #[serde(default)]
    #[schema(minimum = 0, maximum = 1_000_000, default = 0.0, example = 90.0,
        extensions(("x-unit" = json!("N")), ("x-symbol" = json!("P_z")), ("x-group" = json!("cut"))))]
    pub main_n: f64,
    /// Feed (axial) force P_x, against the feed.
    #[serde(default)]
    #[schema(minimum = 0, maximum = 1_000_000, default = 0.0, example = 40.0,
        extensions(("x-unit" = json!("N")), ("x-symbol" = json!("P_x")), ("x-group" = json!("cut"))))]
    pub feed_n: f64,
}

/// A cutting-force model, shared by all calculators. Equations `deflection/6.1` to `deflection/6.3`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum ForceModel {
    /// Power law in depth, feed and speed with coefficients of one's own.
    PowerLaw(PowerLaw),
    /// The handbook's power law with its correction factors.
    Handbook(Box<Handbook>),
    /// Specific force over chip thickness, integrated along the edge and its nose.
    Kienzle(Kienzle),
    /// Forces that do not depend on the cut.
    Constant(Constant),
    /// Forces measured over depth.
    Table(ForceTable),
}

impl PartialSchema for ForceModel {
    fn schema() -> RefOr<Schema> {
        RefOr::T(Schema::OneOf(
            OneOfBuilder::new()
                .item(schema::choice("power_law", PowerLaw::schema()))
                .item(schema::choice("handbook", Handbook::schema()))
                .item(schema::choice("kienzle", Kienzle::schema()))
                .item(schema::choice("constant", Constant::schema()))
                .item(schema::choice("table", ForceTable::schema()))
                .description(Some("Cutting forces over depth, feed and speed."))
                .extensions(Some(Extensions::builder().add("x-code", "unknown_force_model").build()))
                .build(),
        ))
    }
}

impl ToSchema for ForceModel {
    fn schemas(schemas: &mut Vec<(String, RefOr<Schema>)>) {
        PowerLaw::schemas(schemas);
        Handbook::schemas(schemas);
        Kienzle::schemas(schemas);
        Constant::schemas(schemas);
        ForceTable::schemas(schemas);
    }
}

/// What a quantity reaches during a cut, to be held against a force model's range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reached<'a> {
    /// Field of the job that rules the quantity.
    pub pointer: &'a str,
    /// Least value where something is cut.
    pub least: f64,
    /// Largest value.
    pub largest: f64,
}

impl ForceModel {
    /// Adds every fault of the model, which stands at `pointer` (`/force`) of the job.
    pub fn check(&self, pointer: &str, violations: &mut Violations) {
        match self {
            Self::PowerLaw(model) => model.check(pointer, violations),
            Self::Handbook(model) => model.check(pointer, violations),
            Self::Kienzle(model) => model.check(pointer, violations),
            Self::Constant(model) => model.check(pointer, violations),
            Self::Table(model) => model.check(pointer, violations),
        }
    }

    /// Writes the library's numbers into a checked model: a handbook choice becomes the power law
    /// that it stands for, a material's name its coefficients. Idempotent.
    pub fn fill(&mut self) {
        match self {
            Self::Handbook(model) => {
                if let Ok(law) = model.resolve("") {
                    *self = Self::PowerLaw(law);
                }
            }
            Self::Kienzle(model) => model.fill(),
            Self::PowerLaw(_) | Self::Constant(_) | Self::Table(_) => {}
        }
    }

    /// Forces over depth at `feed_mm_per_rev` > 0 and `speed_m_per_min` > 0.
    ///
    /// Of a model that [`Self::check`] refuses the law is zero.
    pub fn at(&self, feed_mm_per_rev: f64, speed_m_per_min: f64) -> DepthLaw {
        match self {
            Self::PowerLaw(model) => model.at(feed_mm_per_rev, speed_m_per_min),
            Self::Handbook(model) => {
                model.resolve("").map_or_else(|_| DepthLaw::zero(), |law| law.at(feed_mm_per_rev, speed_m_per_min))
            }
            Self::Kienzle(model) => model.at(feed_mm_per_rev),
            Self::Constant(model) => model.law(),
            Self::Table(model) => model.law(),
        }
    }

    /// Whether [`Self::at`] gives different laws at different speeds, so that one law does not do
    /// for a whole shaft at constant spindle speed.
    pub fn depends_on_speed(&self) -> bool {
        match self {
            Self::PowerLaw(model) => model.depends_on_speed(),
            Self::Handbook(model) => model.resolve("").is_ok_and(|law| law.depends_on_speed()),
            Self::Kienzle(_) | Self::Constant(_) | Self::Table(_) => false,
        }
    }

    /// Exponent of the depth in the passive force where that is a pure power of the depth (0 for a
    /// constant force), else `None`.
    pub fn depth_exponent(&self) -> Option<f64> {
        self.at(1.0, 100.0).passive_power().map(|(_, exponent)| exponent)
    }

    /// Whether the model gives the main force; where it does not, that force is 0.
    pub fn has_main(&self) -> bool {
        match self {
            Self::PowerLaw(model) => model.main.is_some(),
            Self::Handbook(_) | Self::Kienzle(_) => true,
            Self::Constant(model) => model.main_n > 0.0,
            Self::Table(model) => model.rows.rows().iter().any(|row| row.main_n > 0.0),
        }
    }

    /// Whether the model gives the feed force; where it does not, that force is 0.
    pub fn has_feed(&self) -> bool {
        match self {
            Self::PowerLaw(model) => model.feed.is_some(),
            Self::Handbook(model) => model.resolve("").is_ok_and(|law| law.feed.is_some()),
            Self::Kienzle(_) => true,
            Self::Constant(model) => model.feed_n > 0.0,
            Self::Table(model) => model.rows.rows().iter().any(|row| row.feed_n > 0.0),
        }
    }

    /// Warnings where the cut leaves the range in which the model was measured (`deflection/6.1`,
    /// `deflection/10`). The answer is given all the same.
    pub fn extrapolations(&self, cut: &ReachedCut) -> Vec<Finding> {
        match self {
            Self::PowerLaw(model) => cut.outside(&model.range()),
            Self::Handbook(model) => model.resolve("").map(|law| cut.outside(&law.range())).unwrap_or_default(),
            Self::Kienzle(model) => model.extrapolations(cut),
            Self::Constant(_) => Vec::new(),
            Self::Table(model) => model.extrapolations(cut),
        }
    }

    /// Depth or feed so far beyond the source of the law that no answer is given. What is measured by the user himself is
    /// his to judge.
    pub fn far_beyond(&self, cut: &ReachedCut) -> Option<Finding> {
        match self {
            Self::PowerLaw(model) if model.measured_range.is_none() => cut.far_beyond(&model.range()),
            Self::Handbook(model) => cut.far_beyond(&model.resolve("").ok()?.range()),
            Self::Kienzle(_) => cut.far_beyond(&Kienzle::range()),
            Self::PowerLaw(_) | Self::Constant(_) | Self::Table(_) => None,
        }
    }

    /// Angle of the straight edge to the direction of feed, where the model knows it, degrees.
    pub fn cutting_edge_angle_deg(&self) -> Option<f64> {
        match self {
            Self::PowerLaw(model) => model.cutting_edge_angle_deg,
            Self::Handbook(model) => Some(model.cutting_edge_angle_deg),
            Self::Kienzle(model) => Some(model.cutting_edge_angle_deg),
            Self::Constant(_) | Self::Table(_) => None,
        }
    }

    /// Warnings about coefficients of the library that nobody has confirmed; the model stands at
    /// `pointer` of the job.
    pub fn cautions(&self, pointer: &str) -> Vec<Finding> {
        match self {
            Self::PowerLaw(model) => model.cautions(pointer),
            Self::Handbook(model) => model.resolve("").map(|law| law.cautions(pointer)).unwrap_or_default(),
            Self::Kienzle(model) => model.cautions(pointer),
            Self::Constant(_) | Self::Table(_) => Vec::new(),
        }
    }

    /// The equations of the model and where they come from.
    pub fn basis(&self) -> Vec<Basis> {
        match self {
            Self::PowerLaw(model) => model.basis(),
            Self::Handbook(_) => power::handbook_basis(),
            Self::Kienzle(_) => kienzle::basis(),
            Self::Constant(_) => constant::basis(),
            Self::Table(_) => table::basis(),
        }
    }
}
