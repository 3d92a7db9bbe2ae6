//! The answer.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::machinability::{MachinabilityModel, ModelForm};

/// Models fitted to the trials, and what they are worth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(title = "MachinabilityFit")]
pub struct FitOutcome {
    /// The models, as `models` of a feed schedule takes them.
    pub models: FittedModels,
    /// Largest cross-validated error among the power laws: what a new trial of the worst modelled output misses, typically.
    #[schema(extensions(("x-unit" = json!("percent"))))]
    pub worst_held_out_error_percent: Option<f64>,
    /// One entry per output.
    pub outputs: Vec<OutputFit>,
    /// What the trials span.
    pub design: Design,
    /// Predictions at the conditions asked for, output by output.
    pub predictions: Vec<Prediction>,
    /// Generator of the resampling.
    pub generator: String,
}

/// Models by the names that a schedule knows.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FittedModels {
    /// Main (tangential) force P_z, N.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force_z: Option<MachinabilityModel>,
    /// Passive (radial) force P_y, N.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force_y: Option<MachinabilityModel>,
    /// Tool life, min.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tool_life: Option<MachinabilityModel>,
    /// Roughness, um.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub roughness: Option<MachinabilityModel>,
    /// Degree of hardening, percent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hardening: Option<MachinabilityModel>,
    /// Depth of hardening, um.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hardening_depth: Option<MachinabilityModel>,
    /// Further outputs.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub further: Vec<FittedFurther>,
}

/// A further output.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FittedFurther {
    /// Its name: the column without its unit.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// The model.
    pub model: MachinabilityModel,
}

impl FittedModels {
    /// Puts a model where its output's name belongs.
    pub(super) fn put(&mut self, name: &str, unit: &str, model: MachinabilityModel) {
        let slot = match name {
            "force_z" => &mut self.force_z,
            "force_y" => &mut self.force_y,
            "tool_life" => &mut self.tool_life,
            "roughness" => &mut self.roughness,
            "hardening" => &mut self.hardening,
            "hardening_depth" => &mut self.hardening_depth,
            _ => {
                self.further.push(FittedFurther { name: name.to_owned(), unit: unit.to_owned(), model });
                return;
            }
        };
        *slot = Some(model);
    }
}

/// The fit of one output. Errors, scatter and coefficients are those of ln(output) with `log_log` and of the output with
/// `semi_log`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct OutputFit {
    /// Column of the table.
    pub column: String,
    /// Name among the models.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Form of the model.
    pub form: ModelForm,
    /// Whether the trials tell the two forms apart with odds of 20 to 1; null where only one was tried.
    pub form_decided: Option<bool>,
    /// Trials used.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub trials: usize,
    /// Trials with the output that lack a variable or factor.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub incomplete_trials: usize,
    /// Distinct conditions among them.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub conditions: usize,
    /// Trials less coefficients.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub degrees_of_freedom: usize,
    /// The constant and the coefficients of the logarithms and levels.
    pub coefficients: Vec<Coefficient>,
    /// Standard deviation of single trials about the model.
    #[schema(extensions(("x-unit" = json!("of ln or of the output"))))]
    pub residual_scatter: f64,
    /// The same as a share of the output, for a power law.
    #[schema(extensions(("x-unit" = json!("percent"))))]
    pub residual_scatter_percent: Option<f64>,
    /// Share of the variance that the model explains in the trials it was fitted to: it flatters.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub r_squared: f64,
    /// What the model is worth on trials that it has not seen.
    pub cross_validation: CrossValidation,
    /// Scatter of repeats about their own mean; null without repeats.
    pub pure_error: Option<PureError>,
    /// Whether the model misses more than the repeats scatter; null without repeats or conditions to spare.
    pub lack_of_fit: Option<TestResult>,
    /// Whether the scatter grows or falls with some variable.
    pub uneven_scatter: Option<TestResult>,
    /// Whether residuals in the order of the table remember one another.
    pub drift_in_order: Option<TestResult>,
    /// Whether the residuals are normally distributed.
    pub normality: Option<TestResult>,
    /// Terms of second order that a model of first order lacks, the most certain first, at most five.
    pub missing_terms: Vec<MissingTerm>,
    /// The form that was not taken.
    pub other_form: Option<OtherForm>,
    /// Sets of terms that the trials cannot tell from the chosen one.
    pub rivals: Vec<Rival>,
    /// Largest variance inflation factor of the coefficients: 1 if the columns are orthogonal.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub largest_inflation: f64,
    /// Condition number of the centred columns of unit length.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub condition_number: f64,
    /// Trial by trial.
    pub rows: TrialColumns,
}

/// A coefficient.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Coefficient {
    /// `constant`, the column of a variable, or `factor = level`.
    pub name: String,
    /// Its value.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub value: f64,
    /// Standard error.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub standard_error: f64,
    /// Lower end of its interval, for scatter of normal shape.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub lower: f64,
    /// Upper end.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub upper: f64,
    /// Lower end by resampling; null for the constant or where resamples did not determine it.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub resampled_lower: Option<f64>,
    /// Upper end by resampling.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub resampled_upper: Option<f64>,
    /// Probability of a coefficient of such size by chance; null for the constant.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub p_value: Option<f64>,
    /// Variance inflation by the other columns; null for the constant.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub inflation: Option<f64>,
}

/// Errors on trials that were held out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CrossValidation {
    /// Groups held out in turn.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub folds: usize,
    /// Trials that the others predict.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub predicted_trials: usize,
    /// Root mean square of the errors; null where the others predict none.
    #[schema(extensions(("x-unit" = json!("of ln or of the output"))))]
    pub error: Option<f64>,
    /// The same as a share of the output, for a power law.
    #[schema(extensions(("x-unit" = json!("percent"))))]
    pub error_percent: Option<f64>,
    /// The same in the output's own unit, whatever the form.
    #[schema(extensions(("x-unit" = json!("of the output"))))]
    pub error_of_output: Option<f64>,
    /// Error of the plain mean of the other trials.
    #[schema(extensions(("x-unit" = json!("of ln or of the output"))))]
    pub error_of_mean: Option<f64>,
    /// Share of the variance of held-out trials that the model explains; negative if it is worse than the mean.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub explained_share: Option<f64>,
}

/// Scatter of repeats.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct PureError {
    /// Standard deviation.
    #[schema(extensions(("x-unit" = json!("of ln or of the output"))))]
    pub standard_deviation: f64,
    /// Degrees of freedom.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub degrees_of_freedom: usize,
}

/// A test.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct TestResult {
    /// The statistic.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub statistic: f64,
    /// Degrees of freedom, or the number of values.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub degrees_of_freedom: f64,
    /// Degrees of freedom of the denominator.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub degrees_of_freedom_below: Option<f64>,
    /// Probability of a statistic of that size by chance.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub p_value: f64,
}

/// A square or product that the model lacks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MissingTerm {
    /// First column.
    pub column: String,
    /// Second column; the first again for a square.
    pub with: String,
    /// Coefficient of the product of the two logarithms, each less its mean.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub coefficient: f64,
    /// Probability by chance, corrected for the number of terms looked at.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub p_value: f64,
    /// Cross-validated error with it.
    #[schema(extensions(("x-unit" = json!("of ln or of the output"))))]
    pub error_with: Option<f64>,
}

/// The form that was not taken.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct OtherForm {
    /// It.
    pub form: ModelForm,
    /// How much larger its corrected Akaike criterion is: above 5.99 the odds are 20 to 1.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub criterion_above: f64,
    /// Its cross-validated error in the output's own unit.
    #[schema(extensions(("x-unit" = json!("of the output"))))]
    pub error_of_output: Option<f64>,
}

/// A set of terms that the trials cannot tell from the chosen one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Rival {
    /// Columns in it.
    pub columns: Vec<String>,
    /// How much larger its corrected Akaike criterion is.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub criterion_above: f64,
}

/// Trial by trial, in the order of the table.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct TrialColumns {
    /// Place in the table, from 0.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub row: Vec<usize>,
    /// Value measured.
    #[schema(extensions(("x-unit" = json!("of the output"))))]
    pub measured: Vec<f64>,
    /// Value of the model.
    #[schema(extensions(("x-unit" = json!("of the output"))))]
    pub fitted: Vec<f64>,
    /// Value of the model fitted without the trial's fold.
    #[schema(extensions(("x-unit" = json!("of the output"))))]
    pub held_out: Vec<Option<f64>>,
    /// Residual over its standard deviation, judged without the trial (externally studentised).
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub studentised: Vec<Option<f64>>,
    /// Leverage: 1 for a trial that the model must pass through.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub leverage: Vec<f64>,
    /// Cook's distance: how far the coefficients move without the trial.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub cooks_distance: Vec<Option<f64>>,
    /// Whether the trial is an outlier (level 0.05 over all trials together).
    pub outlier: Vec<bool>,
}

/// What the trials span.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Design {
    /// Trials in the table.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub trials: usize,
    /// Excluded by the user.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub excluded: usize,
    /// Range of every variable.
    pub variables: Vec<VariableSpan>,
    /// Levels of every factor; the first is the one that the others are compared with.
    pub factors: Vec<FactorSpan>,
    /// Share of the box of all ranges (in logarithms) that lies within the convex hull of the trials.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub hull_share: f64,
    /// Uncertainty of it (standard error of the sampling).
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub hull_share_error: f64,
}

/// Range of a variable.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct VariableSpan {
    /// Column.
    pub column: String,
    /// Least value.
    #[schema(extensions(("x-unit" = json!("as the name says"))))]
    pub least: f64,
    /// Largest value.
    #[schema(extensions(("x-unit" = json!("as the name says"))))]
    pub largest: f64,
    /// Distinct values.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub levels: usize,
}

/// Levels of a factor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct FactorSpan {
    /// Column.
    pub column: String,
    /// Levels.
    pub levels: Vec<String>,
}

/// A prediction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Prediction {
    /// Place in `predict`.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub place: usize,
    /// Name of the output.
    pub output: String,
    /// Value: for a power law the median.
    #[schema(extensions(("x-unit" = json!("of the output"))))]
    pub value: f64,
    /// Lower end of the interval of the model's value.
    #[schema(extensions(("x-unit" = json!("of the output"))))]
    pub lower: f64,
    /// Upper end.
    #[schema(extensions(("x-unit" = json!("of the output"))))]
    pub upper: f64,
    /// Lower end of the interval that holds a single new trial.
    #[schema(extensions(("x-unit" = json!("of the output"))))]
    pub trial_lower: f64,
    /// Upper end.
    #[schema(extensions(("x-unit" = json!("of the output"))))]
    pub trial_upper: f64,
    /// Whether it lies within the convex hull of the trials.
    pub within_hull: bool,
    /// Distance to the hull in the space of the logarithms, each variable over its range: 1 is as far as the trials span.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub hull_distance: f64,
}
