//! What turns a forward model into one that can be diagnosed.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{
    Calculator, Consequence, Design, Example, Expansions, Failure, ForwardModel, Hypotheses, Hypothesis, MeasuredRow,
    Monitor, Prediction, Ranges, Rows, Treatment, Variable,
};
use crate::effects::JointUncertainty;

/// A calculator whose model can be compared with measurements, cause by cause.
pub trait Diagnosable:
    Calculator<Input: Clone + PartialEq + std::fmt::Debug>
    + ForwardModel<
        Job = <Self as Calculator>::Input,
        Run: Default + PartialEq + std::fmt::Debug + 'static,
        Allowances: PartialEq + std::fmt::Debug + 'static,
        Effect: ToSchema + PartialEq + std::fmt::Debug + 'static,
    >
{
    /// A measured row: its place, its run, and the value under the name of its quantity.
    type Row: MeasuredRow + Measurement<Model = Self> + PartialEq + std::fmt::Debug;

    /// Predictions of every run that a diagnosis makes, where they are dear: signatures, the sets refined, the next run, the
    /// folds.
    const PREDICTIONS: f64 = 300.0;

    /// Complete diagnoses that really run.
    const DIAGNOSES: &'static [Example];

    /// The causes that these rows can speak about, in the coordinates in which they are fitted, with bounds
    /// and references as the job has them. `held` acts already: of kinds that may recur each of these is there, too.
    fn hypotheses(
        prepared: &Self::Prepared,
        held: &[Self::Effect],
        monitor: &dyn Monitor,
    ) -> Result<Hypotheses, Failure>;

    /// The effects that a hypothesis stands for at these values of its variables; `None` outside their ranges.
    fn effects(prepared: &Self::Prepared, hypothesis: &Hypothesis, values: &[f64]) -> Option<Vec<Self::Effect>>;

    /// The values of a hypothesis' variables at which it is this effect; `None` where it is about another.
    fn values(_prepared: &Self::Prepared, hypothesis: &Hypothesis, effect: &Self::Effect) -> Option<Vec<f64>> {
        values_by_name(hypothesis, effect)
    }

    /// What no cause explains as an effect of the model, of the same size in all runs; what `held` has of it already is part of
    /// it. `None` where the model has no such effect.
    fn remainder(_prepared: &Self::Prepared, _held: &[Self::Effect], _found: &Unnamed<'_>) -> Option<Self::Effect> {
        None
    }

    /// From where to where a remainder is known; empty of other effects.
    fn known_over(_remainder: &Self::Effect) -> Vec<KnownOver> {
        Vec::new()
    }

    /// Whether of two effects one stands in place of the other, as two remainders over the same do.
    fn is_same(one: &Self::Effect, other: &Self::Effect) -> bool {
        std::mem::discriminant(one) == std::mem::discriminant(other)
    }

    /// How the rows hang together.
    fn design(prepared: &Self::Prepared) -> Design;

    /// Of a quantity that is a class: how much the margin of every row scatters from cut to cut, in its unit. `None` where
    /// rows are values.
    fn spreads(_prepared: &Self::Prepared, _allowances: &Self::Allowances) -> Option<Vec<f64>> {
        None
    }

    /// Of a quantity that is a class: where the rows stand and where the limit runs with these effects.
    fn class_limits(
        _prepared: &Self::Prepared,
        _effects: &[Self::Effect],
        _monitor: &dyn Monitor,
    ) -> Result<Option<ClassLimits>, Failure> {
        Ok(None)
    }

    /// Runs that could be measured next, each with its rows: every condition moved to the ends of its
    /// range, or started afresh. None where a job has no runs.
    fn next_runs(
        job: &Self::Job,
        rows: &Rows<Self::Run, Self::Point>,
        ranges: Ranges<'_>,
        monitor: &dyn Monitor,
    ) -> Result<NextRuns<Self::Run, Self::Point>, Failure>;

    /// The same where it is known what may be right: the effects of every set of causes that may be, the leading one first. A room in
    /// which runs tell most where these disagree has them there.
    fn next_runs_between(
        job: &Self::Job,
        rows: &Rows<Self::Run, Self::Point>,
        ranges: Ranges<'_>,
        _likely: &[Vec<Self::Effect>],
        monitor: &dyn Monitor,
    ) -> Result<NextRuns<Self::Run, Self::Point>, Failure> {
        Self::next_runs(job, rows, ranges, monitor)
    }

    /// What a person may see of every cut with these effects, where the quantity is a class and every row a cut. A row is `None`
    /// where its cut cannot be computed; the whole is `None` where the model predicts nothing beside the margin.
    fn outlooks(
        _prepared: &Self::Prepared,
        _allowances: &Self::Allowances,
        _effects: &[Self::Effect],
        _monitor: &dyn Monitor,
    ) -> Result<Option<Vec<Option<Outlook>>>, Failure> {
        Ok(None)
    }

    /// Where a row of a next run would be measured, by the fields of a row; nothing where its run says it all, or where
    /// another point is of the same row.
    fn place(_point: &Self::Point) -> Vec<(&'static str, Option<f64>)> {
        Vec::new()
    }

    /// The same place where it was counted from the other end of the part; `None` where a place has no other end.
    fn from_other_end(_job: &Self::Job, _point: &Self::Point) -> Option<Self::Point> {
        None
    }

    /// What comes of the decision that the job's user makes with the effects `believed` (the path that is compensated, the
    /// schedule, the depth), where each of `acting` is what really acts; both stand beside the job's own effects. What
    /// the job leaves to its runs is as in the first. Empty where the job decides nothing.
    fn consequences(
        _job: &Self::Job,
        _quantity: &str,
        _runs: &[Self::Run],
        _believed: &[Self::Effect],
        _acting: &[Vec<Self::Effect>],
        _monitor: &dyn Monitor,
    ) -> Result<Vec<Consequence>, Failure> {
        Ok(Vec::new())
    }

    /// Draws by which [`Self::parts_kept`] is asked.
    const PARTS_DRAWN: usize = 0;

    /// Whether the next part keeps all limits of the job when it is made with the effects `believed`, for each of `acting` together
    /// with a draw of what else the job says is uncertain; of that what is `told` of an effect takes the place. `None` where nothing
    /// of a part is limited, and where none can be made so.
    fn parts_kept(
        _job: &Self::Job,
        _runs: &[Self::Run],
        _believed: &[Self::Effect],
        _acting: &[Vec<Self::Effect>],
        _told: &ToldEffects<'_, Self::Effect>,
        _monitor: &dyn Monitor,
    ) -> Result<Option<Vec<bool>>, Failure> {
        Ok(None)
    }

    /// Effects that act though nobody found them: one draw of what the job allows the model to be wrong by in the next cut,
    /// `normal` giving standard normal numbers.
    fn allowed(_allowances: &Self::Allowances, _normal: &mut dyn FnMut() -> f64) -> Vec<Self::Effect> {
        Vec::new()
    }

    /// How many times rows are held back, at most: for the time that it takes.
    fn folds(_rows: usize, runs: usize) -> usize {
        runs.max(1)
    }

    /// Sizes of a hypothesis about which the model is linearised, too, beside 0.
    fn expansions(_prepared: &Self::Prepared, _hypothesis: &Hypothesis) -> Expansions {
        Expansions::default()
    }

    /// The prediction as divided differences need it: where a prediction is dear, with coarser numerics, whose own error
    /// cancels in a difference.
    fn predict_coarsely(
        prepared: &Self::Prepared,
        effects: &[Self::Effect],
        monitor: &dyn Monitor,
    ) -> Result<Vec<Prediction>, Failure> {
        Self::predict(prepared, effects, monitor)
    }

    /// The prediction as the search for the places of a hypothesis needs it: with numerics that only say where the model comes near
    /// to the rows.
    fn predict_roughly(
        prepared: &Self::Prepared,
        effects: &[Self::Effect],
        monitor: &dyn Monitor,
    ) -> Result<Vec<Prediction>, Failure> {
        Self::predict_coarsely(prepared, effects, monitor)
    }

    /// Expected time of one prediction of all rows, ms.
    fn predict_all_ms(job: &Self::Job, runs: usize, _rows: usize) -> f64 {
        Self::predict_ms(job) * runs.max(1) as f64
    }

    /// Expected time of one prediction of one run, ms: a diagnosis makes some hundreds. 0 where it is next to nothing
    /// beside the statistics.
    fn predict_ms(_job: &Self::Job) -> f64 {
        0.0
    }
}

/// Effects that a diagnosis tells, and what it leaves open of them.
#[derive(Debug, Clone, PartialEq)]
pub struct ToldEffects<'a, E> {
    /// The effects.
    pub effects: &'a [E],
    /// What is not known of them.
    pub open: &'a [JointUncertainty],
}

/// Something without a name that goes with a place along a part, or with one or two conditions.
pub struct Unnamed<'a> {
    /// What it goes with.
    pub over: &'a [Over],
    /// Its size in the unit of the effect, where it stands at these places of each.
    pub size: &'a dyn Fn(&[f64]) -> f64,
}

/// From where to where something is known.
#[derive(Debug, Clone, PartialEq)]
pub struct KnownOver {
    /// A place or a condition, by its field.
    pub field: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Least value.
    pub from: f64,
    /// Largest value.
    pub to: f64,
}

/// What something without a name goes with.
#[derive(Debug, Clone, PartialEq)]
pub struct Over {
    /// The condition, as the design calls it; [`Over::ALONG`] along a part.
    pub name: &'static str,
    /// Places, ascending shares of its range or of the length of the part, between which it is known: straight between them it
    /// is given well enough.
    pub at: Vec<f64>,
}

impl Over {
    /// The name of the place along a part.
    pub const ALONG: &'static str = "along";
}

/// What was written down with one of its numbers divided; `None` where it has no such number.
pub(crate) fn divided<T: Serialize + DeserializeOwned>(own: &T, field: &str, factor: f64) -> Option<T> {
    let mut fields = serde_json::to_value(own).ok()?;
    let number = fields.get_mut(field)?;
    *number = (number.as_f64()? / factor).into();
    serde_json::from_value(fields).ok()
}

/// Values of variables that are fields of the effect. Of hypotheses that differ by a label what is stated is what they
/// are about.
pub(crate) fn values_by_name(hypothesis: &Hypothesis, effect: &impl Serialize) -> Option<Vec<f64>> {
    let fields = serde_json::to_value(effect).ok()?;
    if fields.get("kind")?.as_str()? != hypothesis.cause.kind {
        return None;
    }
    let field = |variable: &Variable| {
        let value = fields.get(variable.name)?.as_f64()?;
        let is_another = match variable.treatment {
            Treatment::Stated { value: of } => !hypothesis.label.is_empty() && (value - of).abs() > 1e-9 * of.abs(),
            _ => false,
        };
        (!is_another).then_some(value)
    };
    hypothesis.variables.iter().map(field).collect()
}

/// Runs that could be measured next.
pub type NextRuns<R, P> = Vec<NextRun<R, P>>;

/// A run that could be measured next.
#[derive(Debug, Clone, PartialEq)]
pub struct NextRun<R, P> {
    /// The condition that it changes: a field of the run.
    pub changes: &'static str,
    /// Its conditions.
    pub run: R,
    /// Where it would be measured.
    pub points: Vec<P>,
}

/// What may be seen of a cut: its class, and a value where it is not quiet.
#[derive(Debug, Clone, PartialEq)]
pub struct Outlook {
    /// Its margin, and the standard deviation of its scatter.
    pub margin: f64,
    /// See `margin`.
    pub scatter: f64,
    /// Logarithms of the values that may be measured, likeliest first; none where there is none.
    pub heard: Vec<f64>,
    /// Standard deviation of such a logarithm.
    pub heard_scatter: f64,
}

/// Rows that are classes in the plane of spindle speed and depth of cut.
#[derive(Debug, Clone, PartialEq)]
pub struct ClassLimits {
    /// Spindle speed of every row, rev/min.
    pub spindle_speed_rpm: Vec<f64>,
    /// Its depth of cut, mm.
    pub depth_mm: Vec<f64>,
    /// The limit, of every feed its own.
    pub curves: Vec<LimitCurve>,
}

/// Largest depth without chatter over the spindle speed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct LimitCurve {
    /// Feed per tooth at which it holds.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub feed_mm_per_tooth: f64,
    /// Width of cut at which it holds, where rows may differ in it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub width_mm: Option<f64>,
    /// Spindle speeds.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub spindle_speed_rpm: Vec<f64>,
    /// Depth at which chatter begins; absent where there is none up to twice the largest depth measured.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_mm: Vec<Option<f64>>,
    /// Lower end of its 95 % interval by what the rows leave open of the causes; empty of the base.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub low_mm: Vec<Option<f64>>,
    /// Upper end.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub high_mm: Vec<Option<f64>>,
}

/// What a measured row says.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading<P> {
    /// Of which prediction.
    pub point: P,
    /// The value; of a class the side of zero on which the margin lay, +1 or -1.
    pub value: f64,
    /// The class that was seen; empty for a value.
    pub class: &'static str,
    /// Which margin this is about; empty for a value.
    pub asks: &'static str,
}

/// A row of measurements.
pub trait Measurement {
    /// Whose rows these are.
    type Model: ForwardModel;

    /// Number of its run as the row names it; runs are numbered from 1 in the order of the job.
    fn run(&self) -> u32;
    /// Number of its sweep within the run: rows of one sweep stand in measuring order.
    fn trace(&self) -> u32;
    /// Where it was measured.
    fn point(&self) -> <Self::Model as ForwardModel>::Point;
    /// The value of a quantity, in the quantity's unit; `None` where this row has none.
    fn value(&self, quantity: &str) -> Option<f64>;
    /// What the row says of a quantity under a job: nothing, one value, or of a class every margin that it speaks about.
    fn readings(
        &self,
        _job: &<Self::Model as ForwardModel>::Job,
        quantity: &str,
    ) -> Vec<Reading<<Self::Model as ForwardModel>::Point>> {
        let value = self.value(quantity);
        value.map(|value| Reading { point: self.point(), value, class: "", asks: "" }).into_iter().collect()
    }
    /// Standard uncertainty, in the quantity's unit.
    fn uncertainty(&self) -> Option<f64>;
    /// Standard uncertainty of one quantity, where a row has several.
    fn uncertainty_of(&self, _quantity: &str) -> Option<f64> {
        self.uncertainty()
    }
    /// Whether the user set it aside.
    fn excluded(&self) -> bool;
}
