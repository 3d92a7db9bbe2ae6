//! The job: a table of trials and what to make of it.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::openapi::schema::{AdditionalProperties, ObjectBuilder, SchemaType, Type};
use utoipa::openapi::{RefOr, Schema};
use utoipa::{PartialSchema, ToSchema};

use crate::calculator::{Measured, MeasuredRow};
use crate::machinability::Variable;

/// Most trials of a table.
pub const MAX_TRIALS: usize = 5000;
/// Most variables and factors together.
pub(super) const MAX_TERMS: usize = 8;

/// Trials that were cut and measured, and the models wanted of them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(title = "MachinabilityFitJob")]
pub struct FitJob {
    /// One row per trial, in the order in which they were cut. As CSV, a column that is no field of a row goes to
    /// `further` if its cells are numbers, else to `factors`.
    #[schema(schema_with = Measured::<Trial>::schema)]
    pub trials: Measured<Trial>,
    /// Columns to be modelled: fields of a row or names in its `further`; left out: every output that has values.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 12, example = json!(["roughness_um"]))]
    pub outputs: Vec<String>,
    /// Columns that the outputs depend on, likewise; left out: speed, feed, depth and edge angle as far as they vary.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 8, example = json!(["speed_m_per_min", "feed_mm_per_rev", "depth_mm"]))]
    pub variables: Vec<String>,
    /// Columns of words that shift the outputs: coolant, batch, tool.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 4, example = json!(["coolant"]))]
    pub factors: Vec<String>,
    /// Form of the models.
    #[serde(default)]
    #[schema(default = "choose", example = "choose")]
    pub form: FormChoice,
    /// Which variables and factors a model has.
    #[serde(default)]
    #[schema(default = "all", example = "all")]
    pub terms: Terms,
    /// Confidence of intervals.
    #[serde(default = "default_confidence")]
    #[schema(minimum = 0.5, maximum = 0.999, default = 0.95, example = 0.95, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("1-a"))))]
    pub confidence: f64,
    /// A factor of which whole levels are held out in the cross-validation (a batch, a laboratory); left out: whole
    /// conditions, their repeats together. It need not be one of `factors`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_length = 1, max_length = 64, example = "batch", extensions(("x-advanced" = json!(true))))]
    pub hold_out: Option<String>,
    /// Values that further variables and factors have where the models are to be used; left out: the geometric mean of
    /// the trials, the first level.
    #[serde(default)]
    pub at: Standing,
    /// Conditions at which a prediction with its interval is wanted.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 200)]
    pub predict: Vec<Place>,
    /// Resamples of the trials for intervals that assume no shape of the scatter; 0 for none.
    #[serde(default = "default_resamples")]
    #[schema(minimum = 0, maximum = 10_000, default = 1000, example = 1000, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("B")), ("x-advanced" = json!(true))))]
    pub resamples: u32,
    /// Seed of the resampling.
    #[serde(default = "default_seed")]
    #[schema(minimum = 0, maximum = 4_294_967_295_u32, default = 1, example = 1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("seed")), ("x-advanced" = json!(true))))]
    pub seed: u32,
}

fn default_confidence() -> f64 {
    0.95
}
fn default_resamples() -> u32 {
    1000
}
fn default_seed() -> u32 {
    1
}

/// Form of a model: how the polynomial of first order in the logarithms gives the output.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum FormChoice {
    /// The better of the two where both are possible; power laws for outputs that a schedule multiplies.
    #[default]
    Choose,
    /// Power laws.
    LogLog,
    /// The output itself is linear in the logarithms: roughness, hardening and its depth, and further outputs.
    SemiLog,
}

/// Which variables and factors a model has.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Terms {
    /// All that were named; intervals say which of them matter.
    #[default]
    All,
    /// The set with the least corrected Akaike criterion; rivals that the data cannot tell from it are listed.
    Best,
}

/// A trial. What was not measured is left out.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Trial {
    /// Its name; each occurs once.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_length = 1, max_length = 64, example = "7a")]
    pub id: Option<String>,
    /// Cutting speed V.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0.0, maximum = 20_000.0, example = 150.0, extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("V")), ("x-code" = json!("bad_speed"))))]
    pub speed_m_per_min: Option<f64>,
    /// Feed S.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0.0, maximum = 20.0, example = 0.15, extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("S")), ("x-code" = json!("bad_feed"))))]
    pub feed_mm_per_rev: Option<f64>,
    /// Depth of cut t.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0.0, maximum = 1000.0, example = 0.75, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("t"))))]
    pub depth_mm: Option<f64>,
    /// Major cutting edge angle phi.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0.0, maximum = 180.0, example = 75.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("phi"))))]
    pub cutting_edge_angle_deg: Option<f64>,
    /// Tool life.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e6, example = 32.0, extensions(("x-unit" = json!("min")), ("x-symbol" = json!("T"))))]
    pub tool_life_min: Option<f64>,
    /// Roughness.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e4, example = 1.83, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("Ra"))))]
    pub roughness_um: Option<f64>,
    /// Passive (radial) force P_y.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e6, example = 194.5, extensions(("x-unit" = json!("N")), ("x-symbol" = json!("P_y"))))]
    pub force_y_n: Option<f64>,
    /// Main (tangential) force P_z.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e6, example = 424.0, extensions(("x-unit" = json!("N")), ("x-symbol" = json!("P_z"))))]
    pub force_z_n: Option<f64>,
    /// Degree of hardening.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1000.0, example = 6.2, extensions(("x-unit" = json!("percent")), ("x-symbol" = json!("N"))))]
    pub hardening_percent: Option<f64>,
    /// Depth of hardening.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e5, example = 71.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("h_c"))))]
    pub hardening_depth_um: Option<f64>,
    /// Left out of every fit, but shown.
    #[serde(default, skip_serializing_if = "is_false")]
    #[schema(default = false, example = false)]
    pub excluded: bool,
    /// Further numbers by name, unit at the end of the name: `nose_radius_mm`, `vibration_um`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    #[schema(schema_with = further_schema)]
    pub further: BTreeMap<String, f64>,
    /// Words by name: `coolant`: `on`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    #[schema(schema_with = factors_schema)]
    pub factors: BTreeMap<String, String>,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde calls it with a reference")]
fn is_false(value: &bool) -> bool {
    !value
}

impl MeasuredRow for Trial {
    const MAX_ROWS: usize = MAX_TRIALS;
    const MEASURED: &'static [&'static str] =
        &["tool_life_min", "roughness_um", "force_y_n", "force_z_n", "hardening_percent", "hardening_depth_um"];
}

/// Values of what a schedule does not choose.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Standing {
    /// Further variables by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    #[schema(schema_with = further_schema)]
    pub further: BTreeMap<String, f64>,
    /// Factors by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    #[schema(schema_with = factors_schema)]
    pub factors: BTreeMap<String, String>,
}

/// Conditions of a prediction; what no model depends on may be left out.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Place {
    /// Cutting speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0.0, maximum = 20_000.0, example = 180.0, extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("V")), ("x-code" = json!("bad_speed"))))]
    pub speed_m_per_min: Option<f64>,
    /// Feed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0.0, maximum = 20.0, example = 0.12, extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("S")), ("x-code" = json!("bad_feed"))))]
    pub feed_mm_per_rev: Option<f64>,
    /// Depth of cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0.0, maximum = 1000.0, example = 0.5, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("t"))))]
    pub depth_mm: Option<f64>,
    /// Major cutting edge angle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0.0, maximum = 180.0, example = 75.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("phi"))))]
    pub cutting_edge_angle_deg: Option<f64>,
    /// Further variables by name; left out: those of `at`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    #[schema(schema_with = further_schema)]
    pub further: BTreeMap<String, f64>,
    /// Factors by name; left out: those of `at`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    #[schema(schema_with = factors_schema)]
    pub factors: BTreeMap<String, String>,
}

/// Numbers by name. In a table, columns without a field of their own land here.
fn further_schema() -> RefOr<Schema> {
    let number = ObjectBuilder::new()
        .schema_type(SchemaType::new(Type::Number))
        .minimum(Some(-1e12))
        .maximum(Some(1e12))
        .examples([0.8])
        .description(Some("The value, in the unit that the name says."))
        .extensions(Some(extensions(&[("x-unit", "as the name says"), ("x-symbol", "x")])));
    map_schema(number, "Numbers by name, unit at the end of the name.", "numbers")
}

/// Words by name. In a table, columns of words without a field of their own land here.
fn factors_schema() -> RefOr<Schema> {
    let word = ObjectBuilder::new()
        .schema_type(SchemaType::new(Type::String))
        .min_length(Some(1))
        .max_length(Some(64))
        .description(Some("The level."));
    map_schema(word, "Words by name.", "words")
}

fn map_schema(value: ObjectBuilder, description: &str, cells: &str) -> RefOr<Schema> {
    let object = ObjectBuilder::new()
        .schema_type(SchemaType::new(Type::Object))
        .additional_properties(Some(AdditionalProperties::RefOr(RefOr::T(Schema::Object(value.build())))))
        .description(Some(description.to_owned()))
        .extensions(Some(extensions(&[("x-free-columns", cells)])))
        .build();
    RefOr::T(Schema::Object(object))
}

fn extensions(entries: &[(&str, &str)]) -> utoipa::openapi::extensions::Extensions {
    let mut extensions = utoipa::openapi::extensions::Extensions::default();
    for (name, value) in entries {
        extensions.insert((*name).to_owned(), (*value).into());
    }
    extensions
}

impl Trial {
    /// The value of a numeric column.
    pub(super) fn number(&self, column: &str) -> Option<f64> {
        match column {
            "speed_m_per_min" => self.speed_m_per_min,
            "feed_mm_per_rev" => self.feed_mm_per_rev,
            "depth_mm" => self.depth_mm,
            "cutting_edge_angle_deg" => self.cutting_edge_angle_deg,
            "tool_life_min" => self.tool_life_min,
            "roughness_um" => self.roughness_um,
            "force_y_n" => self.force_y_n,
            "force_z_n" => self.force_z_n,
            "hardening_percent" => self.hardening_percent,
            "hardening_depth_um" => self.hardening_depth_um,
            other => self.further.get(other).copied(),
        }
    }
}

impl Place {
    /// The value of a numeric column.
    pub(super) fn number(&self, column: &str) -> Option<f64> {
        match column {
            "speed_m_per_min" => self.speed_m_per_min,
            "feed_mm_per_rev" => self.feed_mm_per_rev,
            "depth_mm" => self.depth_mm,
            "cutting_edge_angle_deg" => self.cutting_edge_angle_deg,
            other => self.further.get(other).copied(),
        }
    }
}

/// An output that a schedule knows by a field of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct KnownOutput {
    /// Field of a row.
    pub(super) column: &'static str,
    /// Name among a schedule's models.
    pub(super) name: &'static str,
    /// Unit.
    pub(super) unit: &'static str,
    /// Whether a schedule takes it as a power law only.
    pub(super) power_law_only: bool,
}

const fn known(column: &'static str, name: &'static str, unit: &'static str, power_law_only: bool) -> KnownOutput {
    KnownOutput { column, name, unit, power_law_only }
}

/// All of them.
pub(super) const KNOWN_OUTPUTS: [KnownOutput; 6] = [
    known("force_z_n", "force_z", "N", true),
    known("force_y_n", "force_y", "N", true),
    known("tool_life_min", "tool_life", "min", true),
    known("roughness_um", "roughness", "um", false),
    known("hardening_percent", "hardening", "percent", false),
    known("hardening_depth_um", "hardening_depth", "um", false),
];

/// The variable of a column, of those that every model knows.
pub(super) fn known_variable(column: &str) -> Option<Variable> {
    Variable::ALL.into_iter().find(|variable| variable.field() == column)
}

impl FitJob {
    /// Columns to be modelled.
    pub(super) fn wanted_outputs(&self) -> Vec<String> {
        if !self.outputs.is_empty() {
            return self.outputs.clone();
        }
        KNOWN_OUTPUTS
            .iter()
            .filter(|output| self.trials.rows().iter().any(|trial| trial.number(output.column).is_some()))
            .map(|output| output.column.to_owned())
            .collect()
    }

    /// Columns that the outputs depend on.
    pub(super) fn wanted_variables(&self) -> Vec<String> {
        if !self.variables.is_empty() {
            return self.variables.clone();
        }
        Variable::ALL
            .into_iter()
            .map(Variable::field)
            .filter(|column| {
                let mut values = self.used().filter_map(|(_, trial)| trial.number(column));
                values.next().is_some_and(|first| values.any(|value| value.to_bits() != first.to_bits()))
            })
            .map(str::to_owned)
            .collect()
    }

    /// Trials that are not excluded, with their places in the table.
    pub(super) fn used(&self) -> impl Iterator<Item = (usize, &Trial)> {
        self.trials.rows().iter().enumerate().filter(|(_, trial)| !trial.excluded)
    }
}

/// The unit at the end of a name, of those that a user's own column may carry.
pub(super) fn unit_of(column: &str) -> &'static str {
    const SUFFIXES: [(&str, &str); 14] = [
        ("_um_per_n", "um/N"),
        ("_m_per_min", "m/min"),
        ("_mm_per_rev", "mm/rev"),
        ("_n_per_mm2", "N/mm2"),
        ("_percent", "percent"),
        ("_n_m", "N m"),
        ("_min", "min"),
        ("_mm", "mm"),
        ("_um", "um"),
        ("_deg", "deg"),
        ("_kw", "kW"),
        ("_hz", "Hz"),
        ("_k", "K"),
        ("_n", "N"),
    ];
    SUFFIXES.iter().find(|(suffix, _)| column.ends_with(suffix)).map_or("1", |(_, unit)| unit)
}
