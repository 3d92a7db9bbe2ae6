//! What yields of tool and workpiece.

use serde::{Deserialize, Serialize};
use utoipa::openapi::schema::OneOfBuilder;
use utoipa::openapi::{RefOr, Schema};
use utoipa::{PartialSchema, ToSchema};

use crate::fixture_stability::Vise;
use crate::force::choice;
use crate::receptance_fit::Job as FitJob;
use crate::receptance_fit::{ReceptanceFile, Residuals};

use super::DirectionPart;

/// What yields of one side.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Yielding {
    /// Modes at the cut.
    Modes(YieldingModes),
    /// Measured frequency responses at the cut, of which modes are made.
    Receptances(YieldingReceptances),
    /// A vise along the feed, as the calculator of fixture stability takes it.
    Vise(YieldingVise),
    /// Nothing.
    Rigid(NothingYields),
}

impl PartialSchema for Yielding {
    fn schema() -> RefOr<Schema> {
        RefOr::T(Schema::OneOf(
            OneOfBuilder::new()
                .description(Some("What yields of one side."))
                .item(choice("modes", YieldingModes::schema()))
                .item(choice("receptances", YieldingReceptances::schema()))
                .item(choice("vise", YieldingVise::schema()))
                .item(choice("rigid", NothingYields::schema()))
                .build(),
        ))
    }
}

impl ToSchema for Yielding {
    fn schemas(schemas: &mut Vec<(String, RefOr<Schema>)>) {
        YieldingModes::schemas(schemas);
        YieldingReceptances::schemas(schemas);
        YieldingVise::schemas(schemas);
        NothingYields::schemas(schemas);
    }
}

/// Modes at the cut.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct YieldingModes {
    /// In any order.
    #[schema(min_items = 1, max_items = 20)]
    pub modes: Vec<YieldingMode>,
}

/// Frequency responses at the cut, along X, Y and Z of the fixture: of one direction or several, with those across or without. A
/// direction without any counts as rigid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct YieldingReceptances {
    /// What was measured: CSV, or universal files with datasets 58 and 58b.
    #[schema(min_items = 1, max_items = 16)]
    pub files: Vec<ReceptanceFile>,
    /// How many modes there are; as many as the lines ask for where it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 20, example = 2, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("N")), ("x-advanced" = json!(true))))]
    pub modes: Option<u32>,
    /// Lines below it are left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1_000_000.0, example = 100.0, extensions(("x-unit" = json!("Hz")), ("x-symbol" = json!("f_1")), ("x-advanced" = json!(true))))]
    pub from_hz: Option<f64>,
    /// Lines above it are left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1_000_000.0, example = 2500.0, extensions(("x-unit" = json!("Hz")), ("x-symbol" = json!("f_2")), ("x-advanced" = json!(true))))]
    pub to_hz: Option<f64>,
    /// What modes beside the band leave in it.
    #[serde(default)]
    #[schema(default = "mass_and_stiffness", extensions(("x-advanced" = json!(true))))]
    pub residuals: Residuals,
}

impl YieldingReceptances {
    /// The same as the evaluation of frequency responses takes it.
    pub(in crate::milling_stability) fn fit_job(&self) -> FitJob {
        let Self { files, modes, from_hz, to_hz, residuals } = self;
        FitJob { files: files.clone(), modes: *modes, from_hz: *from_hz, to_hz: *to_hz, residuals: *residuals }
    }
}

/// A vise along the feed, as the calculator of fixture stability takes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct YieldingVise {
    /// The vise with the workpiece; one whose screw locks itself.
    pub fixture: Vise,
}

/// Nothing of this side yields.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NothingYields {}

/// A mode: two of frequency, mass and stiffness, and one of damping ratio and damping.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct YieldingMode {
    /// Direction in which the cut moves, along X, Y and Z of the fixture; its length does not matter.
    #[schema(min_items = 3, max_items = 3, example = json!([1.0, 0.0, 0.0]))]
    pub direction: Vec<DirectionPart>,
    /// Natural frequency.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.001, maximum = 1e7, example = 456.8, extensions(("x-unit" = json!("Hz")), ("x-symbol" = json!("f"))))]
    pub frequency_hz: Option<f64>,
    /// Modal mass at the cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-9, maximum = 1e9, example = 0.963, extensions(("x-unit" = json!("kg")), ("x-symbol" = json!("m"))))]
    pub mass_kg: Option<f64>,
    /// Modal stiffness at the cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-6, maximum = 1e12, example = 7933.0, extensions(("x-unit" = json!("N/mm")), ("x-symbol" = json!("C"))))]
    pub stiffness_n_per_mm: Option<f64>,
    /// Share of critical damping.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, exclusive_maximum = 1.0, example = 0.03, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("zeta"))))]
    pub damping_ratio: Option<f64>,
    /// Modal damping at the cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e9, example = 0.17, extensions(("x-unit" = json!("N s/mm")), ("x-symbol" = json!("lambda")), ("x-code" = json!("negative_damping"))))]
    pub damping_n_s_per_mm: Option<f64>,
}
