//! The job of a diagnosis: a base model, what was measured, and what may be off without being a finding.

use serde::{Deserialize, Serialize};
use utoipa::openapi::RefOr;
use utoipa::openapi::schema::{ObjectBuilder, Schema, SchemaType, Type};
use utoipa::{PartialSchema, ToSchema};

use crate::calculator::{ConditionRange, ForwardModel, Measured, MeasuredRow, Measurement};
use crate::diagnosis::verdict::effort::LEVEL;
use crate::effects::JointUncertainty;

/// Most runs of one diagnosis.
pub const MAX_RUNS: usize = 500;

/// Measurements against a calculator's job.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[serde(bound(
    serialize = "J: Serialize, R: Serialize, A: Serialize",
    deserialize = "J: Deserialize<'de>, R: Deserialize<'de>, A: Deserialize<'de> + Default"
))]
pub struct DiagnosisJob<J: ToSchema, R: ToSchema, W: MeasuredRow + Measurement, A: ToSchema> {
    /// Whose job this is.
    #[schema(example = "deflection-compensation")]
    pub calculator: String,
    /// The base model: a complete job of that calculator. The diagnosis adds to the effects that it holds, or finds them changed.
    #[schema(inline)]
    pub job: J,
    /// What is not known of the effects that the base job holds; a stored model brings its own. What lies within is no finding.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 256)]
    pub effects_uncertainty: Vec<JointUncertainty>,
    /// Conditions of the runs that were measured; what a run leaves out is as in the job.
    #[serde(default = "Vec::new", skip_serializing_if = "Vec::is_empty")]
    #[schema(inline, max_items = 500)]
    pub runs: Vec<R>,
    /// Name of the quantity that was measured.
    #[schema(schema_with = quantity::<W>)]
    pub quantity: String,
    /// The measured rows.
    #[schema(schema_with = measurements::<W>)]
    pub measurements: Measured<W>,
    /// How wrong the base may be without that being a finding.
    #[serde(default)]
    #[schema(inline)]
    pub allowances: A,
    /// What is looked for, and how far.
    #[serde(default)]
    pub options: DiagnosisOptions,
}

/// One of those that the calculator predicts.
fn quantity<W: Measurement>() -> RefOr<Schema> {
    let known = <W::Model as ForwardModel>::QUANTITIES.iter().map(|quantity| quantity.name);
    ObjectBuilder::new()
        .schema_type(SchemaType::new(Type::String))
        .description(Some("Name of the quantity that was measured."))
        .examples(known.clone().take(1))
        .enum_values(Some(known))
        .into()
}

/// Rows that name their run; a column that they do not have may be a condition of it.
fn measurements<W: MeasuredRow>() -> RefOr<Schema> {
    let mut schema = Measured::<W>::schema();
    if let RefOr::T(Schema::OneOf(forms)) = &mut schema {
        let extensions = forms.extensions.get_or_insert_default();
        extensions.insert("x-runs".to_owned(), "runs".into());
        extensions.insert("x-run-number".to_owned(), "run".into());
    }
    schema
}

/// What is looked for, and how far.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DiagnosisOptions {
    /// Kinds of causes to look for; all of the catalogue where not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 64, example = json!(["headstock_compliance", "tailstock_offset"]))]
    pub causes: Option<Vec<String>>,
    /// How much likelier than the others single kinds of causes are before anything is measured; 1 where not given.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 64)]
    pub prior_weights: Vec<PriorWeight>,
    /// In which ranges a next run may lie; other conditions may go 1.5 times beyond what was observed, on either side.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 16)]
    pub ranges: Vec<ConditionRange>,
    /// Change of the prediction, root mean square in the unit of the quantity (a share where it is logarithmic), below
    /// which a cause does not matter: what is below it and below half the scatter is called negligible.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e9, example = 0.5, extensions(("x-symbol" = json!("delta")), ("x-unit" = json!("1"))))]
    pub negligible_below: Option<f64>,
    /// Most causes at the same time.
    #[schema(minimum = 1, maximum = 3, default = 3, example = 3, extensions(("x-symbol" = json!("k")), ("x-unit" = json!("1"))))]
    pub most_causes: u8,
    /// Significance level of the tests; what the rows object to at this level is not named.
    #[schema(minimum = 1e-6, maximum = 0.2, default = 0.01, example = 0.01, extensions(("x-symbol" = json!("alpha")), ("x-unit" = json!("1"))))]
    pub level: f64,
    /// Whether single rows that stand alone are left out.
    #[schema(default = true, example = true)]
    pub leave_outliers_out: bool,
    /// Whether the gain is measured on data held back, with causes chosen anew in every fold.
    #[schema(default = true, example = true)]
    pub held_out: bool,
    /// Go on although the data look like a wrong unit, a wrong sign or another blunder.
    #[schema(default = false, example = false)]
    pub accept_suspected_unit: bool,
    /// How many runs are to be measured next, planned together.
    #[schema(minimum = 1, maximum = 4, default = 1, example = 1, extensions(("x-symbol" = json!("n_next")), ("x-unit" = json!("1"))))]
    pub next_runs: u8,
    /// Cost of making one more run, in any unit. Runs are ranked by the cost of settling the question with them.
    #[schema(minimum = 1e-6, maximum = 1e9, default = 1.0, example = 1.0, extensions(("x-symbol" = json!("c_run")), ("x-unit" = json!("1"))))]
    pub cost_per_run: f64,
    /// Cost of each row measured in it, in the same unit.
    #[schema(minimum = 0.0, maximum = 1e9, default = 0.0, example = 0.0, extensions(("x-symbol" = json!("c_row")), ("x-unit" = json!("1"))))]
    pub cost_per_row: f64,
    /// Seed of the draws behind the intervals of decisions, and of the gain of classes.
    #[schema(minimum = 0, maximum = 4_294_967_295_u32, default = 1, example = 1, extensions(("x-symbol" = json!("s_0")), ("x-unit" = json!("1"))))]
    pub seed: u32,
}

/// How much likelier a kind of cause is than the others, before anything is measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PriorWeight {
    /// Kind of the cause.
    #[schema(max_length = 64, example = "tool_wear")]
    pub kind: String,
    /// Its weight: 2 is twice as likely as a cause that is not listed.
    #[schema(minimum = 0.001, maximum = 1000.0, example = 2.0, extensions(("x-symbol" = json!("w")), ("x-unit" = json!("1"))))]
    pub weight: f64,
}

impl Default for DiagnosisOptions {
    fn default() -> Self {
        Self {
            causes: None,
            prior_weights: Vec::new(),
            ranges: Vec::new(),
            negligible_below: None,
            most_causes: 3,
            level: LEVEL,
            leave_outliers_out: true,
            held_out: true,
            accept_suspected_unit: false,
            next_runs: 1,
            cost_per_run: 1.0,
            cost_per_row: 0.0,
            seed: 1,
        }
    }
}
