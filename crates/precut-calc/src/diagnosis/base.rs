//! A calculator's own forward model as the subject of a diagnosis.

use std::sync::OnceLock;

use rayon::prelude::*;

use super::input::{DiagnosisOptions, PriorWeight};
use super::subject::{Setting, Subject};
use crate::calculator::{
    Diagnosable, Expansions, Failure, Hypotheses, Hypothesis, Inapplicability, Inapplicable, JacobianColumn, Missing,
    Prediction, Treatment, Variable,
};

/// From this time of one prediction on, ms, divided differences are one-sided and fewer sets are refined.
const DEAR_MS: f64 = 5.0;

/// Step of a divided difference, prior standard deviations (of a shape without a prior: of its value).
///
/// Central: the truncation is of order (1e-3)^2 of the curvature over one prior standard deviation, the
/// round-off about 1e-13 of the value divided by 1e-3. One-sided where a prediction is dear: then the truncation is of
/// order 1e-3 of the curvature.
const STEP: f64 = 1e-3;

/// A forward model with its rows and allowances.
pub struct Bound<M: Diagnosable> {
    prepared: M::Prepared,
    allowances: M::Allowances,
    hypotheses: Hypotheses,
    logarithmic: bool,
    dear: bool,
    /// The base with the numerics of divided differences.
    coarse_base: OnceLock<Vec<Prediction>>,
}

impl<M: Diagnosable> Bound<M> {
    /// `quantity` decides whether residuals are taken of the value or of its logarithm.
    /// `options` leave out kinds of causes that are not asked for, and weigh those that are.
    pub fn new(prepared: M::Prepared, allowances: M::Allowances, quantity: &str, options: &DiagnosisOptions) -> Self {
        let logarithmic = M::QUANTITIES.iter().any(|known| known.name == quantity && known.logarithmic);
        let mut hypotheses = M::hypotheses(&prepared);
        if let Some(asked_for) = &options.causes {
            let (kept, left): (Vec<Hypothesis>, Vec<Hypothesis>) =
                hypotheses.applicable.into_iter().partition(|h| asked_for.iter().any(|kind| kind == h.cause.kind));
            hypotheses.applicable = kept;
            let reason = Inapplicability::NotAskedFor;
            hypotheses.inapplicable.extend(left.into_iter().map(|h| Inapplicable { cause: h.cause, reason }));
        }
        weigh(&mut hypotheses.applicable, &options.prior_weights);
        let dear = M::predict_cost(&prepared).ms > DEAR_MS;
        Self { prepared, allowances, hypotheses, logarithmic, dear, coarse_base: OnceLock::new() }
    }

    /// The forward model's own view of the rows.
    pub fn prepared(&self) -> &M::Prepared {
        &self.prepared
    }

    /// Whether a prediction costs more than the statistics about it.
    pub fn is_dear(&self) -> bool {
        self.dear
    }

    /// What these rows can and cannot speak about.
    pub fn catalogue(&self) -> &Hypotheses {
        &self.hypotheses
    }

    /// The effects that settings stand for.
    pub(super) fn effects_of(&self, settings: &[Setting]) -> Result<Vec<M::Effect>, Failure> {
        let mut effects = Vec::with_capacity(settings.len());
        for setting in settings {
            let hypothesis = &self.hypotheses.applicable[setting.hypothesis];
            effects.extend(M::effects(&self.prepared, hypothesis, &setting.values).ok_or_else(|| {
                Failure::Internal(format!("{} takes no {:?}", hypothesis.cause.kind, setting.values))
            })?);
        }
        Ok(effects)
    }

    /// The base with these effects, in the unit in which residuals are taken.
    pub(super) fn with_effects(&self, effects: &[M::Effect]) -> Result<Vec<Prediction>, Failure> {
        Ok(self.in_unit(M::predict(&self.prepared, effects)?))
    }

    fn coarsely(&self, settings: &[Setting]) -> Result<Vec<Prediction>, Failure> {
        Ok(self.in_unit(M::predict_coarsely(&self.prepared, &self.effects_of(settings)?)?))
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

impl<M: Diagnosable> Subject for Bound<M>
where
    M::Allowances: Sync,
{
    fn hypotheses(&self) -> &[Hypothesis] {
        &self.hypotheses.applicable
    }

    fn predict(&self, settings: &[Setting]) -> Result<Vec<Prediction>, Failure> {
        self.with_effects(&self.effects_of(settings)?)
    }

    fn predict_coarsely(&self, settings: &[Setting]) -> Result<Vec<Prediction>, Failure> {
        self.centre(settings)
    }

    fn expansions(&self, hypothesis: usize) -> Expansions {
        M::expansions(&self.prepared, &self.hypotheses.applicable[hypothesis])
    }

    fn jacobian(&self, settings: &[Setting], of: &[(usize, usize)]) -> Result<Vec<JacobianColumn>, Failure> {
        let middle = if self.dear && !of.is_empty() { Some(self.centre(settings)?) } else { None };
        of.par_iter().map(|&place| self.slope(settings, place, middle.as_deref())).collect()
    }

    fn nuisances(&self) -> Result<Vec<JacobianColumn>, Failure> {
        M::nuisances(&self.prepared, &self.allowances)
    }
}
