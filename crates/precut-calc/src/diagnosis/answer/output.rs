//! The answer of a diagnosis.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use utoipa::openapi::Object;
use utoipa::openapi::schema::{ObjectBuilder, SchemaType, Type};

use crate::diagnosis::answer::blunder::BlunderReport;
use crate::diagnosis::answer::classes::ClassReport;
use crate::diagnosis::model::downstream::{DownstreamReport, GoodPartsReport};
use crate::diagnosis::model::extension::ExtensionKind;
use crate::effects::JointUncertainty;

/// What the measurements say about the base model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(bound(serialize = "E: Serialize, R: Serialize", deserialize = "E: Deserialize<'de>, R: Deserialize<'de>"))]
pub struct DiagnosisResult<E: ToSchema, R: ToSchema> {
    /// What kind of answer this is.
    pub verdict: VerdictClass,
    /// The causes named; for `unknown` those that act at least; empty otherwise.
    pub named: Vec<NamedCause>,
    /// For `confounded`: the likely sets of causes, likeliest first, which these data cannot tell apart. A set that only adds to
    /// one ten times as likely is not listed (`posterior_with_others`), unless all of them do.
    pub likely_sets: Vec<LikelySet>,
    /// Why nothing is said about physics, for `refused`.
    pub refusal: Option<Refusal>,
    /// Blunders in the data that the rows look like, likeliest first.
    pub blunders: Vec<BlunderReport>,
    /// What each of the causes named changes in the prediction.
    pub contributions: Vec<ContributionReport>,
    /// Collinearity index of the causes named (Brun and Reichert): above 20 they cannot be fitted together; absent for one
    /// cause alone.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub collinearity: Option<f64>,
    /// Posterior probability that nothing is wrong that these rows could show.
    #[schema(minimum = 0.0, maximum = 1.0, extensions(("x-unit" = json!("1"))))]
    pub none_probability: f64,
    /// Posterior probability that something acts that the catalogue does not hold.
    #[schema(minimum = 0.0, maximum = 1.0, extensions(("x-unit" = json!("1"))))]
    pub unnamed_probability: f64,
    /// Scatter of single rows.
    pub noise: NoiseReport,
    /// Classical tests of the base.
    pub tests: Vec<TestReport>,
    /// Sets of causes, heaviest first.
    pub sets: Vec<SetReport>,
    /// Causes with the probability that they take part, likeliest first.
    pub causes: Vec<CauseReport>,
    /// Causes of the catalogue that these rows cannot speak about.
    pub not_applicable: Vec<NotApplicable>,
    /// Pairs of causes with one signature whatever their size: this experiment cannot tell them apart.
    pub twins: Vec<CausePair>,
    /// How well leading sets can be told apart, sigmas.
    pub separations: Vec<SeparationReport>,
    /// What each leading set changes in the prediction, likeliest first; of sets that extend none that is likelier.
    pub signatures: Vec<SignatureReport>,
    /// Profile likelihoods of the parameters of the set that is named, of a `confounded` answer of its likeliest.
    pub profiles: Vec<ProfileReport>,
    /// Shape of what the catalogue does not explain.
    pub remainder: Option<RemainderReport>,
    /// Where the base holds a remainder of an earlier diagnosis that these rows show again; absent otherwise.
    pub recognised: Option<RecognisedReport>,
    /// What the extended model is. Where no cause is named there is one only if it predicted rows that were held back better
    /// than the base, beyond chance.
    pub extension: ExtensionKind,
    /// The effects that extend the base model, those that the base held otherwise in their place; empty where it is not
    /// extended.
    #[schema(inline)]
    pub effects: Vec<E>,
    /// What the rows leave open of `effects`.
    pub effects_uncertainty: Vec<JointUncertainty>,
    /// Error on data held back, base against extended; of classes see `classes`.
    pub gain: Option<GainReport>,
    /// Where the quantity is a class: what each model says of every row, and where the limits run.
    pub classes: Option<ClassReport>,
    /// What comes of deciding with either model, where the extended one is right; empty where the base is not extended, or
    /// where the job decides nothing.
    pub downstream: Vec<DownstreamReport>,
    /// With which probability the next part keeps all limits of the base job, made with either model; absent where the base is not
    /// extended, and where the job limits nothing of a part.
    pub good_parts: Option<GoodPartsReport>,
    /// The run that would best part the leading set from its strongest rival.
    #[schema(inline)]
    pub next_measurement: Option<NextReport<R>>,
    /// Row by row.
    pub rows: RowColumns,
    /// Whole runs that the others do not lead one to expect, and what the rows say without each.
    pub outlying_runs: Vec<OutlyingRunReport>,
    /// Rows left out because they stand alone, by their number from 1.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub outliers: Vec<u32>,
}

/// Kinds of answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum VerdictClass {
    /// Nothing is wrong that these rows could show.
    Adequate,
    /// The causes are named.
    Named,
    /// One of several sets of causes; these data cannot tell which.
    Confounded,
    /// Something that the catalogue does not hold.
    Unknown,
    /// The data cannot be judged; the reason says why.
    Refused,
}

impl VerdictClass {
    /// Its name, as in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::Adequate => "adequate",
            Self::Named => "named",
            Self::Confounded => "confounded",
            Self::Unknown => "unknown",
            Self::Refused => "refused",
        }
    }
}

/// A cause with its fitted parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct NamedCause {
    /// Kind of the effect.
    pub kind: String,
    /// Which of several effects of one kind; empty where there is one.
    pub label: String,
    /// Its parameters.
    pub parameters: Vec<ParameterReport>,
}

/// A fitted or stated parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ParameterReport {
    /// Name with its unit.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Value, in the unit that `unit` names.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub value: f64,
    /// Value in the base, where the base holds the effect already; the cause is that it changed.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub was: Option<f64>,
    /// Posterior standard deviation; absent for what is stated.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub standard_deviation: Option<f64>,
    /// 50 % interval.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub interval_50: Option<[f64; 2]>,
    /// 90 % interval.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub interval_90: Option<[f64; 2]>,
    /// 95 % interval.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub interval_95: Option<[f64; 2]>,
    /// Where the intervals come from: `quadratic`, `profile` where the likelihood is not, `grid` where shapes are not fitted but
    /// averaged over a grid, or `several_optima` where the rows fit other values nearly as well; absent for what is stated.
    pub interval_from: Option<String>,
    /// Its values at other optima that the rows fit nearly as well. The intervals are then those of all together, each
    /// with its share of the posterior.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub other_values: Vec<f64>,
    /// Whether it lies at its physical limit.
    pub at_limit: bool,
}

/// What a cause changes in the prediction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ContributionReport {
    /// Kind of the effect.
    pub kind: String,
    /// Which of several effects of one kind; empty where there is one.
    pub label: String,
    /// Prediction with the set that is named, minus that without this cause: root mean square over the rows that count, in
    /// the unit of the quantity (a share where it is logarithmic).
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub change_rms: f64,
    /// Whether that is below half the scatter and below what the job calls negligible.
    pub negligible: bool,
}

/// A whole run that the others do not lead one to expect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct OutlyingRunReport {
    /// Number of the run, from 1.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub run: u32,
    /// Squared Mahalanobis distance from what the others predict, per row: about 1 where nothing is odd.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub misfit_per_row: f64,
    /// What the rows say without it.
    pub verdict_without: VerdictClass,
    /// Kinds of the causes that they name without it, or of the sets that they cannot tell apart.
    pub sets_without: Vec<Vec<String>>,
}

/// A set of causes in the list of a confounded answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct LikelySet {
    /// The causes.
    pub causes: Vec<NamedCause>,
    /// Share of the whole posterior.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub posterior: f64,
    /// Share of all sets of named causes that contain these: that all of them act, whatever else does.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub posterior_with_others: f64,
}

/// Why the data cannot be judged.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Refusal {
    /// Code of the reason: `unit_suspected`, `blunder_suspected`, `absolute_values`, `constant_values`, `too_few_rows`, `base_fails`.
    pub reason: String,
    /// For a suspected unit: the factor that it would leave.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub factor: Option<f64>,
    /// For a suspected unit: the factor fitted.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub fitted_factor: Option<f64>,
    /// Rows that would do, where there are too few.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub rows_needed: Option<u32>,
}

/// Scatter of single rows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct NoiseReport {
    /// Standard deviation, in the unit of the quantity (relative where it is logarithmic).
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub standard_deviation: f64,
    /// Correlation from one row of a sweep to the next.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub correlation: f64,
    /// Degrees of freedom; absent where the scatter is what was stated.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub degrees_of_freedom: Option<f64>,
    /// Where it comes from: `stated`, or `scaled` where rows scatter beyond what was stated and count as they scatter; `repeats`,
    /// `profile`, `regression`; of classes `spread`: granted to their margins.
    #[schema(schema_with = noise_sources)]
    pub source: String,
    /// Scatter of the rows in units of what was stated.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub scatter_factor: Option<f64>,
    /// Standard deviation from the differences between sweeps of one run over the same places, in the unit of the quantity:
    /// what no model can foresee; absent without such sweeps.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub between_sweeps: Option<f64>,
    /// Its degrees of freedom.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub between_sweeps_degrees_of_freedom: Option<f64>,
}

fn noise_sources() -> Object {
    ObjectBuilder::new()
        .schema_type(SchemaType::new(Type::String))
        .description(Some(
            "Where it comes from: `stated`, or `scaled` where rows scatter beyond what was stated and count as they \
             scatter; `repeats`, `profile`, `regression`; of classes `spread`: granted to their margins.",
        ))
        .enum_values(Some(["stated", "scaled", "repeats", "profile", "regression", "spread"]))
        .build()
}

/// A test of the base.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct TestReport {
    /// `lack_of_fit`, `smooth_directions`, `ljung_box`, `runs`, `held_out`, of classes `deviance`, `levels`.
    pub test: String,
    /// Its statistic.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub statistic: f64,
    /// Probability of a larger one if the base were right.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub p: f64,
    /// The same, corrected for the number of tests after Holm.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub p_holm: f64,
    /// Whether it rejects the base at the level asked for.
    pub rejects: bool,
}

/// A set of causes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SetReport {
    /// Its causes; none for the base itself.
    pub causes: Vec<NamedCause>,
    /// Share of the whole posterior.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub posterior: f64,
    /// Whether an unnamed remainder stands beside them.
    pub with_remainder: bool,
    /// Bayesian information criterion, n ln(RSS/n) + k ln n; absent beside a remainder, whose sizes are as many as one likes.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub bic: Option<f64>,
    /// Probability that rows scatter so far from this set or farther if nothing else acts: the lesser one of two F tests, of
    /// that part of what it leaves which the scatter was not found from, and, without an order, of what goes smoothly with the
    /// conditions; of classes that of as odd a look, or odder, of classes drawn from it. Below the level a set is not named.
    /// Absent where there is nothing to test.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub lack_of_fit_p: Option<f64>,
    /// Root mean square error on data held back, this set fitted anew without each part, in the unit of the quantity;
    /// absent for sets that do not lead, or where nothing was held back.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub held_out_rmse: Option<f64>,
}

/// A cause and the probability that it takes part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CauseReport {
    /// Kind of the effect.
    pub kind: String,
    /// Which of several effects of one kind; empty where there is one.
    pub label: String,
    /// Posterior probability that it takes part.
    #[schema(extensions(("x-unit" = json!("1")), ("x-causes" = json!({ "errors_as_in": "residuals" }))))]
    pub probability: f64,
    /// Kinds that some experiments cannot tell from it.
    pub confounded_with: Vec<String>,
}

/// A cause that these rows cannot speak about.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct NotApplicable {
    /// Kind of the effect.
    pub kind: String,
    /// `condition_absent`, `condition_constant`, `condition_at_two_levels`, `nothing_to_act_on`, `in_job`, `scatter_only`, `not_asked_for`, `too_small`.
    pub reason: String,
    /// The condition that is absent or does not vary.
    pub condition: Option<String>,
}

/// Two causes with one signature.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CausePair {
    /// One kind.
    pub a: String,
    /// The other.
    pub b: String,
}

/// How well two sets can be told apart.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SeparationReport {
    /// Kinds of one set.
    pub a: Vec<String>,
    /// Kinds of the other.
    pub b: Vec<String>,
    /// Distance between their best fits, sigmas; below 3 these data cannot tell them apart.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub sigmas: f64,
}

/// What a set of causes changes in the prediction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SignatureReport {
    /// Kinds of the set.
    pub causes: Vec<String>,
    /// Prediction with its fit minus that of the base, row by row, in the unit of the measured values of `rows`.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub change: Vec<f64>,
}

/// Profile likelihood of a parameter: all others of its set fitted anew at every value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ProfileReport {
    /// Kind of the effect.
    pub kind: String,
    /// Which of several effects of one kind; empty where there is one.
    pub label: String,
    /// Name of the parameter with its unit.
    pub parameter: String,
    /// Its unit.
    pub unit: String,
    /// Its values, ascending, in that unit.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub value: Vec<f64>,
    /// Distance from the best of them, standard deviations of the fit.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub deviations: Vec<f64>,
    /// Rise of the misfit above its least; of a quadratic likelihood the square of `deviations`.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub rise: Vec<f64>,
    /// Rise at the edges of the 95 % interval.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub rise_at_95: f64,
}

/// Shape of what the catalogue does not explain.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RemainderReport {
    /// What it is free over: `common` to all runs, `per_run`, `around` the part, `test_order`, a grouping, the levels of a
    /// `factor`, smooth in one of the `conditions` or in a `pair_of_conditions`.
    pub kind: String,
    /// Of `factor`, `conditions` and `pair_of_conditions`: which.
    pub over: Vec<String>,
    /// Root mean square over the rows, in the unit of the quantity.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub rms: f64,
    /// Row where it is largest, from 1.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub largest_at_row: u32,
    /// Row by row, in the order of `rows`, in the unit of the quantity.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub value: Vec<f64>,
    /// Posterior standard deviation of `value`; empty where it has more than 200 free sizes.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub standard_deviation: Vec<f64>,
    /// Orders of its waves: half waves over the length or the order of testing, whole ones round a part; empty for levels.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub orders: Vec<f64>,
    /// Amplitude of every order, in the unit of the quantity; of several runs the root mean square.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub amplitudes: Vec<f64>,
    /// Where the extended model holds it as a term: from where to where it is known, over what it goes with; beyond, the model
    /// takes it as at the ends.
    pub known_between: Vec<PlaceRange>,
    /// Share of the mean square left by the named part that it explains.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub explained_share: f64,
    /// Along a part: where a line with one step fits best.
    pub step: Option<StepReport>,
    /// Of one shape in all runs: how its size goes with what the base predicts there. 0: the same in all runs; 1: in proportion,
    /// as what comes of the force.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub proportional_to_base: Option<f64>,
    /// Standard deviation of that.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub proportional_to_base_deviation: Option<f64>,
}

/// From where to where something is known.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct PlaceRange {
    /// Field of a row that says where: a place, or a condition.
    pub field: String,
    /// Unit of the field.
    pub unit: String,
    /// Least value, in that unit.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub from: f64,
    /// Largest value.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub to: f64,
}

/// A remainder that the base holds, and that the rows show again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RecognisedReport {
    /// What the user calls it; empty where it has no name.
    pub label: String,
    /// Root mean square of what rows would lie from the base without it, in the unit of the quantity.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub error_without: f64,
    /// The same of the base as it stands.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub error_with: f64,
    /// How surely the rows tell one from the other, sigmas.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub sigmas: f64,
}

/// A step along a part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct StepReport {
    /// Place, as a share of the length.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub place: f64,
    /// What lies beyond it, above what lies before it, in the unit of the quantity.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub size: f64,
    /// Log likelihood of a line with this step, above that of a line without.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub log_likelihood: f64,
}

/// Error on data held back.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct GainReport {
    /// Parts of the data that were held back one after the other.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub folds: u32,
    /// Root mean square error of the base, in the unit of the quantity.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub rmse_base: f64,
    /// Of the extended model, causes chosen and fitted anew without each part.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub rmse_extended: f64,
    /// 1 - extended/base.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub gain: f64,
    /// 95 % interval of the gain on as many parts that are measured anew.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub gain_interval_95: [f64; 2],
    /// What scatter and allowances leave to any model.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub noise_ceiling: f64,
    /// Share of what could be explained that was; absent where the base is at the ceiling already.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub explained_share: Option<f64>,
}

/// A run worth measuring.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(bound(serialize = "R: Serialize", deserialize = "R: Deserialize<'de>"))]
pub struct NextReport<R: ToSchema> {
    /// The condition that it changes.
    pub changes: String,
    /// Its conditions.
    #[schema(inline)]
    pub run: R,
    /// Rows that it would bring.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub rows: u32,
    /// Where they would be measured: columns by the fields of a measured row, one entry per row.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    #[schema(extensions(("x-unit" = json!("as the field's name says"))))]
    pub places: BTreeMap<String, Vec<Option<f64>>>,
    /// Kinds of the leading set.
    pub leader: Vec<String>,
    /// Kinds of its strongest rival; none for the base.
    pub rival: Vec<String>,
    /// Separation of both with the rows there are, sigmas.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub separation_now_sigmas: f64,
    /// The same with this run measured too.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub separation_then_sigmas: f64,
    /// Bayes factor to be expected from this run.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub bayes_factor: f64,
    /// Of a class: by how much the entropy over the sets that may be right is expected to fall with it, nats.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub entropy_drop_nats: Option<f64>,
    /// Rows of this kind that would bring odds of 20 to 1; absent where more than twenty such runs would be needed.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub rows_needed: Option<u32>,
    /// Cost of odds of 20 to 1 with runs of this kind, in the unit of the stated costs; absent where more than twenty would be needed.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub cost_to_settle: Option<f64>,
    /// Runs to measure with it, where several were asked for: fewer where a further one would add nothing.
    #[serde(default = "Vec::new", skip_serializing_if = "Vec::is_empty")]
    #[schema(inline)]
    pub further_runs: Vec<FurtherRun<R>>,
    /// Every run that was looked at, with what it would part.
    #[schema(inline)]
    pub candidates: Vec<CandidateReport<R>>,
}

/// A run to measure with those before it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(bound(serialize = "R: Serialize", deserialize = "R: Deserialize<'de>"))]
pub struct FurtherRun<R: ToSchema> {
    /// The condition that it changes.
    pub changes: String,
    /// Its conditions.
    #[schema(inline)]
    pub run: R,
    /// Rows that it would bring.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub rows: u32,
    /// Where they would be measured: columns by the fields of a measured row, one entry per row.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    #[schema(extensions(("x-unit" = json!("as the field's name says"))))]
    pub places: BTreeMap<String, Vec<Option<f64>>>,
    /// Kinds of the rival that the runs before it part from the leading set least; none for the base.
    pub rival: Vec<String>,
    /// Separation of both with the runs before it, sigmas.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub separation_before_sigmas: f64,
    /// The same with this run measured too.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub separation_then_sigmas: f64,
}

/// A run that was looked at.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(bound(serialize = "R: Serialize", deserialize = "R: Deserialize<'de>"))]
pub struct CandidateReport<R: ToSchema> {
    /// The condition that it changes.
    pub changes: String,
    /// Its conditions.
    #[schema(inline)]
    pub run: R,
    /// Separation of leader and rival with this run measured too, sigmas.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub separation_sigmas: f64,
    /// Cost of odds of 20 to 1 with runs of this kind; absent where more than twenty would be needed.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub cost_to_settle: Option<f64>,
    /// Bayes factor to be expected from this run.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub bayes_factor: f64,
    /// Of a class: by how much the entropy over the sets that may be right is expected to fall with it, nats.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub entropy_drop_nats: Option<f64>,
}

/// Row by row, in the order of the measurements; values in the unit of the quantity (logarithms where it is logarithmic).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RowColumns {
    /// Number of the measured row, from 1.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub row: Vec<u32>,
    /// Run of the row.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub run: Vec<u32>,
    /// Where along the part, as a share of its length or of a turn; absent for rows without a place.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub place: Vec<Option<f64>>,
    /// Measured; of classes the side of zero on which the margin lay, 1 or -1.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub measured: Vec<f64>,
    /// Prediction of the base.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub base: Vec<Option<f64>>,
    /// Prediction of the extended model; the base where there is none.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub extended: Vec<Option<f64>>,
    /// Standard deviation of a row about the extended prediction: scatter, allowances, fit; absent where the base is
    /// not extended.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub extended_deviation: Vec<Option<f64>>,
    /// Whether the row counted.
    pub used: Vec<bool>,
}
