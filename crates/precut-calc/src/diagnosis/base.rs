//! A calculator's own forward model as the subject of a diagnosis.

use std::sync::OnceLock;

use rayon::prelude::*;

use super::input::{DiagnosisOptions, PriorWeight};
use crate::calculator::{
    Design, Diagnosable, Expansions, Failure, Held, Hypotheses, Hypothesis, Inapplicability, Inapplicable,
    JacobianColumn, Missing, Monitor, Over, Prediction, Smooth, Treatment, Unnamed, Variable,
};
use crate::diagnosis::causes::subject::{Belief, Form, Setting, Subject};
use crate::diagnosis::model::known::{Known, with_numbers};
use crate::diagnosis::verdict::effort::Effort;

/// From this time of one prediction on, ms, divided differences are one-sided and fewer sets are refined.
const DEAR_MS: f64 = 5.0;

/// Step of a divided difference, prior standard deviations (of a shape without a prior: of its value).
///
/// Central: the truncation is of order (1e-3)^2 of the curvature over one prior standard deviation, the
/// round-off about 1e-13 of the value divided by 1e-3. One-sided where a prediction is dear: then the truncation is of
/// order 1e-3 of the curvature.
const STEP: f64 = 1e-3;
/// The same of something without a name, in the unit of its effect: what it opens or closes of a gap.
const UNIT_STEP: f64 = 0.01;

/// A forward model with its rows and allowances.
pub struct Bound<'a, M: Diagnosable> {
    prepared: M::Prepared,
    known: Known<M::Effect>,
    allowances: M::Allowances,
    hypotheses: Hypotheses,
    logarithmic: bool,
    dear: bool,
    /// The base with the numerics of divided differences, and of a search.
    coarse_base: OnceLock<Vec<Prediction>>,
    rough_base: OnceLock<Vec<Prediction>>,
    monitor: &'a dyn Monitor,
}

impl<'a, M: Diagnosable> Bound<'a, M> {
    /// `prepared` is of a job without effects; those of `known` act beside it. `quantity` decides whether residuals are taken
    /// of the value or of its logarithm. `options` leave out kinds of causes that are not asked for, and weigh those that are.
    pub fn new(
        prepared: M::Prepared,
        known: Known<M::Effect>,
        allowances: M::Allowances,
        quantity: &str,
        options: &DiagnosisOptions,
        monitor: &'a dyn Monitor,
    ) -> Result<Self, Failure> {
        let logarithmic = M::QUANTITIES.iter().any(|known| known.name == quantity && known.logarithmic);
        let mut hypotheses = about_known::<M>(&prepared, &known.effects, monitor)?;
        if let Some(asked_for) = &options.causes {
            let (kept, left): (Vec<Hypothesis>, Vec<Hypothesis>) =
                hypotheses.applicable.into_iter().partition(|h| asked_for.iter().any(|kind| kind == h.cause.kind));
            hypotheses.applicable = kept;
            let reason = Inapplicability::NotAskedFor;
            hypotheses.inapplicable.extend(left.into_iter().map(|h| Inapplicable { cause: h.cause, reason }));
        }
        weigh(&mut hypotheses.applicable, &options.prior_weights);
        let ms = M::predict_cost(&prepared).ms;
        let dear = ms > DEAR_MS;
        let (coarse_base, rough_base) = (OnceLock::new(), OnceLock::new());
        Ok(Self { prepared, known, allowances, hypotheses, logarithmic, dear, coarse_base, rough_base, monitor })
    }

    /// The forward model's own view of the rows.
    pub fn prepared(&self) -> &M::Prepared {
        &self.prepared
    }

    /// Whether a prediction costs more than the statistics about it.
    pub fn is_dear(&self) -> bool {
        self.dear
    }

    /// The whole search over its rows.
    pub(super) fn effort(&self, most_causes: usize) -> Effort {
        Effort::of(most_causes, self.dear)
    }

    /// What these rows can and cannot speak about.
    pub fn catalogue(&self) -> &Hypotheses {
        &self.hypotheses
    }

    /// The effects that are believed: what joins the base, and what stands in place of an effect of the base.
    pub(super) fn effects_of(&self, believed: &Belief) -> Result<Vec<M::Effect>, Failure> {
        let mut effects = self.effects_of_settings(&believed.settings)?;
        if let Some(form) = &believed.form {
            put::<M>(&mut effects, self.remainder(&self.with_settings(&believed.settings)?, form)?);
        }
        Ok(effects)
    }

    fn effects_of_settings(&self, settings: &[Setting]) -> Result<Vec<M::Effect>, Failure> {
        let mut effects = Vec::with_capacity(settings.len());
        for setting in settings {
            effects.extend(self.effects_at(setting)?);
        }
        Ok(effects)
    }

    /// What has no name as an effect beside those that act.
    fn remainder(&self, acting: &[M::Effect], form: &Form) -> Result<M::Effect, Failure> {
        let found = Unnamed { over: &form.over, size: &|place| form.at(place) };
        M::remainder(&self.prepared, acting, &found)
            .ok_or_else(|| Failure::Internal("a remainder that the model has no effect for".to_owned()))
    }

    fn effects_at(&self, setting: &Setting) -> Result<Vec<M::Effect>, Failure> {
        let hypothesis = &self.hypotheses.applicable[setting.hypothesis];
        let values: Vec<f64> =
            setting.values.iter().enumerate().map(|(k, value)| value + hypothesis.counted_from(k)).collect();
        // A remainder is what it was found as: only its size is a number.
        let of_held = || {
            let held = hypothesis.held.as_ref()?;
            let named = hypothesis.variables.iter().map(|variable| variable.name).zip(values.iter().copied());
            Some(vec![with_numbers(&self.known.effects[held.effect], named)?])
        };
        M::effects(&self.prepared, hypothesis, &values)
            .or_else(of_held)
            .ok_or_else(|| Failure::Internal(format!("{} takes no {values:?}", hypothesis.cause.kind)))
    }

    /// All that acts where this is believed: the effects of the base, as far as they have not changed, and what it stands for.
    pub(super) fn acting(&self, believed: &Belief) -> Result<Vec<M::Effect>, Failure> {
        let mut acting = self.with_settings(&believed.settings)?;
        if let Some(form) = &believed.form {
            let remainder = self.remainder(&acting, form)?;
            put::<M>(&mut acting, remainder);
        }
        Ok(acting)
    }

    /// What is predicted where this is believed.
    pub(super) fn believing(&self, believed: &Belief) -> Result<Vec<Prediction>, Failure> {
        self.predicted(&self.acting(believed)?)
    }

    /// The effects that act with these settings: those of the base, as far as they have not changed, and theirs.
    pub(crate) fn with_settings(&self, settings: &[Setting]) -> Result<Vec<M::Effect>, Failure> {
        let changed = |effect: usize| {
            let is_of = |setting: &&Setting| {
                self.hypotheses.applicable[setting.hypothesis].held.as_ref().is_some_and(|held| held.effect == effect)
            };
            settings.iter().any(|setting| is_of(&setting))
        };
        let own = self.known.effects.iter().enumerate();
        let mut acting: Vec<M::Effect> =
            own.filter(|(index, _)| !changed(*index)).map(|(_, effect)| effect.clone()).collect();
        acting.extend(self.effects_of_settings(settings)?);
        Ok(acting)
    }

    /// The base with these effects beside its own, in the unit in which residuals are taken.
    pub(super) fn with_effects(&self, effects: &[M::Effect]) -> Result<Vec<Prediction>, Failure> {
        self.predicted(&[&self.known.effects, effects].concat())
    }

    fn predicted(&self, acting: &[M::Effect]) -> Result<Vec<Prediction>, Failure> {
        Ok(self.in_unit(M::predict(&self.prepared, acting, self.monitor)?))
    }

    fn predicted_coarsely(&self, acting: &[M::Effect]) -> Result<Vec<Prediction>, Failure> {
        Ok(self.in_unit(M::predict_coarsely(&self.prepared, acting, self.monitor)?))
    }

    fn coarsely(&self, settings: &[Setting]) -> Result<Vec<Prediction>, Failure> {
        self.predicted_coarsely(&self.with_settings(settings)?)
    }

    /// Residuals are taken of the logarithm where the quantity is logarithmic.
    fn in_unit(&self, mut predicted: Vec<Prediction>) -> Vec<Prediction> {
        if self.logarithmic {
            for value in &mut predicted {
                *value = value.and_then(|v| if v > 0.0 { Ok(v.ln()) } else { Err(Missing::NoSolution) });
            }
        }
        predicted
    }

    /// Prediction in the middle of one-sided differences; the base's own where every size is 0.
    fn centre(&self, settings: &[Setting]) -> Result<Vec<Prediction>, Failure> {
        let absent = |setting: &Setting| {
            let hypothesis = &self.hypotheses.applicable[setting.hypothesis];
            let sizes = hypothesis.variables.iter().zip(&setting.values);
            hypothesis.has_amplitude()
                && sizes.into_iter().all(|(v, value)| {
                    !matches!(v.treatment, Treatment::Amplitude { .. }) || value.abs() < f64::MIN_POSITIVE
                })
        };
        if !settings.iter().all(absent) {
            return self.coarsely(settings);
        }
        if let Some(base) = self.coarse_base.get() {
            return Ok(base.clone());
        }
        let base = self.coarsely(&[])?;
        Ok(self.coarse_base.get_or_init(|| base).clone())
    }

    /// d predict / d variable; one-sided where the prediction in the middle is given.
    fn slope(
        &self,
        settings: &[Setting],
        (member, variable): (usize, usize),
        middle: Option<&[Prediction]>,
    ) -> Result<JacobianColumn, Failure> {
        let declared: &Variable = &self.hypotheses.applicable[settings[member].hypothesis].variables[variable];
        let centre = settings[member].values[variable];
        let step = STEP * width(declared, centre);
        let mut low = (centre - step).max(declared.range.lower);
        let high = (centre + step).min(declared.range.upper);
        let at = |value: f64| {
            let mut moved = settings.to_vec();
            moved[member].values[variable] = value;
            self.coarsely(&moved)
        };
        let (below, above) = match middle {
            // At the upper bound downwards.
            Some(middle) if high > centre => {
                low = centre;
                (middle.to_vec(), at(high)?)
            }
            Some(middle) => (at(low)?, middle.to_vec()),
            None => (at(low)?, at(high)?),
        };
        Ok(below
            .iter()
            .zip(&above)
            .map(|pair| match pair {
                (Ok(below), Ok(above)) => (above - below) / (high - low),
                _ => 0.0,
            })
            .collect())
    }
}

/// In place of an effect that is the same but for its numbers, or beside the others.
pub(crate) fn put<M: Diagnosable>(effects: &mut Vec<M::Effect>, effect: M::Effect) {
    effects.retain(|own| !M::is_same(own, &effect));
    effects.push(effect);
}

/// The whole of what something without a name goes with first: along a part, or the first condition that differs.
fn first_axis(design: &Design) -> Option<Over> {
    let name = match &design.smooth {
        Smooth::Along(_) => Over::ALONG,
        Smooth::Around(_) => return None,
        Smooth::None => design.conditions.first()?.name,
    };
    Some(Over { name, at: vec![0.0, 1.0] })
}

/// The causes that rows can speak about; those that the base has already as changes of what it has.
fn about_known<M: Diagnosable>(
    prepared: &M::Prepared,
    known: &[M::Effect],
    monitor: &dyn Monitor,
) -> Result<Hypotheses, Failure> {
    let Hypotheses { applicable, mut inapplicable } = M::hypotheses(prepared, known, monitor)?;
    let mut sorted = Vec::with_capacity(applicable.len());
    for hypothesis in applicable {
        let held = known
            .iter()
            .enumerate()
            .find_map(|(effect, own)| Some(Held { effect, values: M::values(prepared, &hypothesis, own)? }));
        let cause = hypothesis.cause;
        match held {
            None => sorted.push(hypothesis),
            Some(held) => match hypothesis.change_of(held) {
                Some(change) => sorted.push(change),
                None => inapplicable.push(Inapplicable { cause, reason: Inapplicability::InJob }),
            },
        }
    }
    Ok(Hypotheses { applicable: sorted, inapplicable })
}

/// Prior weights as stated, together as many as there are hypotheses: a set of causes stays as likely as before.
fn weigh(hypotheses: &mut [Hypothesis], stated: &[PriorWeight]) {
    let weight = |kind: &str| stated.iter().find(|of| of.kind == kind).map_or(1.0, |of| of.weight);
    let total: f64 = hypotheses.iter().map(|hypothesis| weight(hypothesis.cause.kind)).sum();
    let count = hypotheses.len() as f64;
    for hypothesis in hypotheses {
        hypothesis.prior_weight *= weight(hypothesis.cause.kind) * count / total;
    }
}

/// The scale on which a variable matters.
fn width(variable: &Variable, value: f64) -> f64 {
    match &variable.treatment {
        Treatment::Amplitude { prior_sd } => *prior_sd,
        Treatment::Shape { prior: Some(prior), .. } if !prior.logarithmic => prior.sd,
        Treatment::Shape { .. } | Treatment::Stated { .. } => value.abs().max(f64::MIN_POSITIVE.sqrt()),
    }
}

impl<M: Diagnosable> Subject for Bound<'_, M>
where
    M::Allowances: Sync,
{
    fn hypotheses(&self) -> &[Hypothesis] {
        &self.hypotheses.applicable
    }

    fn predict(&self, settings: &[Setting]) -> Result<Vec<Prediction>, Failure> {
        self.predicted(&self.with_settings(settings)?)
    }

    fn predict_coarsely(&self, settings: &[Setting]) -> Result<Vec<Prediction>, Failure> {
        self.centre(settings)
    }

    fn predict_roughly(&self, settings: &[Setting]) -> Result<Vec<Prediction>, Failure> {
        let at = |settings: &[Setting]| {
            Ok(self.in_unit(M::predict_roughly(&self.prepared, &self.with_settings(settings)?, self.monitor)?))
        };
        match self.rough_base.get() {
            _ if !settings.is_empty() => at(settings),
            Some(base) => Ok(base.clone()),
            None => {
                let base = at(&[])?;
                Ok(self.rough_base.get_or_init(|| base).clone())
            }
        }
    }

    /// Sizes that the model is linearised about. Those of a change of a held effect are counted from what the base holds.
    fn expansions(&self, hypothesis: usize) -> Expansions {
        let hypothesis = &self.hypotheses.applicable[hypothesis];
        let mut expansions = M::expansions(&self.prepared, hypothesis);
        if hypothesis.held.is_some() {
            let within = |place: &Vec<f64>| {
                let sizes = hypothesis.amplitudes().map(|(variable, _)| hypothesis.variables[variable].range);
                sizes.zip(place).all(|(range, size)| (range.lower..=range.upper).contains(size))
            };
            expansions.places.retain(within);
        }
        expansions
    }

    fn jacobian(&self, settings: &[Setting], of: &[(usize, usize)]) -> Result<Vec<JacobianColumn>, Failure> {
        let middle = if self.dear && !of.is_empty() { Some(self.centre(settings)?) } else { None };
        of.par_iter().map(|&place| self.slope(settings, place, middle.as_deref())).collect()
    }

    /// Allowances of the job, and the uncertainty of the effects that the base holds.
    fn nuisances(&self) -> Result<Vec<JacobianColumn>, Failure> {
        let Self { prepared, known, allowances, monitor, .. } = self;
        let mut columns = M::nuisances(prepared, &known.effects, allowances, *monitor)?;
        columns.extend(known.columns(|acting| self.predicted_coarsely(acting))?);
        Ok(columns)
    }

    fn unnamed(&self) -> Result<Option<JacobianColumn>, Failure> {
        let acting = &self.known.effects;
        let Some(axis) = first_axis(&M::design(&self.prepared)) else { return Ok(None) };
        let with = |size: f64| {
            let found = Unnamed { over: std::slice::from_ref(&axis), size: &|_| size };
            let mut effects = acting.clone();
            put::<M>(&mut effects, M::remainder(&self.prepared, acting, &found)?);
            Some(self.predicted_coarsely(&effects))
        };
        let Some((below, above)) = with(-UNIT_STEP).zip(with(UNIT_STEP)) else { return Ok(None) };
        let slope = |(below, above): (&Prediction, &Prediction)| match (below, above) {
            (Ok(below), Ok(above)) => (above - below) / (2.0 * UNIT_STEP),
            _ => 0.0,
        };
        Ok(Some(below?.iter().zip(&above?).map(slope).collect()))
    }
}
