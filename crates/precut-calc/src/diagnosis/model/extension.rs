//! The model that a diagnosis leaves behind: the base extended by the causes named, or, where the rows do not settle which of
//! several sets acts, by their average, or by what has no name as a term of its own (`diagnosis/3.8`).

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{Failure, Hypothesis, Treatment};
use crate::diagnosis::causes::ranking::SetWeight;
use crate::diagnosis::causes::subject::{Belief, Setting};
use crate::diagnosis::model::gain::{Gain, predicting};
use crate::diagnosis::model::known::{Direction, directions, left_open};
use crate::diagnosis::model::term::Term;
use crate::diagnosis::verdict::judge::Verdict;
use crate::diagnosis::verdict::weigh::Weighing;
use crate::effects::JointUncertainty;

/// How far the average model may be, root mean square in units of the scatter, from the average of what the sets predict.
const AS_THE_AVERAGE: f64 = 0.5;
/// Share of the sets from which on a cause without a size is part of their average.
const THERE: f64 = 0.5;

/// What the extended model is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ExtensionKind {
    /// There is none: the base as it was.
    None,
    /// The causes that are named act.
    Named,
    /// The average over likely sets of causes, which the rows cannot tell apart; no cause is named by it.
    Average,
    /// The likeliest set of causes, where an average of several does not predict as they do; no cause is named by it.
    Likeliest,
    /// What no cause explains is a term of its own over the places measured, beside the causes that act at least.
    Remainder,
}

/// The base extended.
pub(in crate::diagnosis) struct Extension<'a> {
    pub(in crate::diagnosis) kind: ExtensionKind,
    /// What joins the base; of an average the causes of all sets, each size times the share of the sets that hold it.
    pub(in crate::diagnosis) believed: Belief,
    /// The sets behind it, with their shares.
    pub(in crate::diagnosis) parts: Vec<(f64, &'a SetWeight)>,
    /// What has no name, where that is a term.
    pub(in crate::diagnosis) term: Option<Term<'a>>,
}

impl<'a> Extension<'a> {
    /// The base as it was.
    pub(in crate::diagnosis) fn none() -> Self {
        Self { kind: ExtensionKind::None, believed: Belief::default(), parts: Vec::new(), term: None }
    }

    /// With what has no name as a term, where that predicted the rows that were held back better than the base, beyond chance;
    /// else by the set whose causes are named; else by the sets that predicted them so.
    pub(in crate::diagnosis) fn of(
        weighing: &'a Weighing<'a>,
        named: Option<&'a SetWeight>,
        gain: Option<&Gain>,
    ) -> Result<Self, Failure> {
        let gain = gain.filter(|gain| gain.interval.0 > 0.0);
        let term = gain.and_then(|_| Term::of(weighing)).and_then(|term| Some((term.belief()?, term)));
        if let Some((believed, term)) = term {
            return Ok(Self {
                kind: ExtensionKind::Remainder,
                believed,
                parts: vec![(1.0, term.set)],
                term: Some(term),
            });
        }
        if let Some(set) = named {
            return Ok(Self::one(ExtensionKind::Named, set));
        }
        let Some(gain) = gain else { return Ok(Self::none()) };
        if matches!(weighing.verdict, Verdict::Adequate) {
            return Ok(Self::none());
        }
        let parts = predicting(weighing);
        let Some(&(_, likeliest)) = parts.first() else { return Ok(Self::none()) };
        if parts.len() > 1 {
            let hypotheses = weighing.foundation.subject.hypotheses();
            let believed = Belief { settings: average(hypotheses, &parts), form: None };
            let average = Self { kind: ExtensionKind::Average, believed, parts, term: None };
            if average.predicts_as_its_parts(weighing)? {
                return Ok(average);
            }
        }
        let own = gain.of_sets.iter().find(|(members, _)| *members == likeliest.members);
        let is_better = own.is_some_and(|(_, rmse)| *rmse < gain.rmse_base);
        Ok(if is_better { Self::one(ExtensionKind::Likeliest, likeliest) } else { Self::none() })
    }

    fn one(kind: ExtensionKind, set: &'a SetWeight) -> Self {
        Self { kind, believed: Belief::of(&set.settings), parts: vec![(1.0, set)], term: None }
    }

    /// Predictions of the parts, and of all together.
    fn predicts_as_its_parts(&self, weighing: &Weighing<'_>) -> Result<bool, Failure> {
        let subject = weighing.foundation.subject;
        let with = subject.predict(&self.believed.settings)?;
        let mut gap: Vec<f64> = with.iter().map(|value| value.unwrap_or(0.0)).collect();
        for (share, set) in &self.parts {
            let of_set = subject.predict(&set.settings)?;
            for (gap, value) in gap.iter_mut().zip(of_set) {
                *gap -= share * value.unwrap_or(0.0);
            }
        }
        let kept = (0..gap.len()).filter(|&row| weighing.keep[row]);
        let (sum, count) = kept.fold((0.0, 0.0), |(sum, count), row| {
            let relative = gap[row] / weighing.scatter(row);
            (sum + relative * relative, count + 1.0)
        });
        Ok(sum <= AS_THE_AVERAGE * AS_THE_AVERAGE * count)
    }

    /// What the rows leave open of the effects: within every set, and between the sets.
    pub(in crate::diagnosis) fn open<E: Serialize>(
        &self,
        weighing: &Weighing<'_>,
        effects_of: impl Fn(&Belief) -> Result<Vec<E>, Failure>,
    ) -> Result<Vec<JointUncertainty>, Failure> {
        if let Some(term) = &self.term {
            return left_open(&self.believed, &term.directions(), effects_of);
        }
        let place = |hypothesis: usize| self.believed.settings.iter().position(|own| own.hypothesis == hypothesis);
        let hypotheses = weighing.foundation.subject.hypotheses();
        let mut all: Vec<Direction> = Vec::new();
        for (share, set) in &self.parts {
            let root = share.sqrt();
            for direction in directions(weighing, set) {
                let moved = direction.of_settings.into_iter().filter_map(|((member, variable), by)| {
                    Some(((place(set.settings[member].hypothesis)?, variable), root * by))
                });
                all.push(Direction { of_settings: moved.collect(), of_form: Vec::new() });
            }
            if self.parts.len() > 1 {
                all.push(self.off_average(hypotheses, set, root));
            }
        }
        left_open(&self.believed, &all, effects_of)
    }

    /// How far the sizes of a set lie from the average, times a factor.
    fn off_average(&self, hypotheses: &[Hypothesis], set: &SetWeight, factor: f64) -> Direction {
        let mut direction = Direction::default();
        for (member, own) in self.believed.settings.iter().enumerate() {
            let of_set = set.settings.iter().find(|other| other.hypothesis == own.hypothesis);
            for (variable, _) in hypotheses[own.hypothesis].amplitudes() {
                let there = of_set.map_or(0.0, |other| other.values[variable]);
                direction.of_settings.push(((member, variable), factor * (there - own.values[variable])));
            }
        }
        direction
    }

    /// Standard deviation of a measured row about the prediction: scatter, allowances, what the fits leave open, and how far
    /// the sets lie apart. `None` where a set was not refined.
    pub(in crate::diagnosis) fn deviation(&self, weighing: &Weighing<'_>) -> Result<Option<Vec<f64>>, Failure> {
        if let Some(term) = &self.term {
            return Ok(Some(term.deviation()));
        }
        if let [(_, set)] = self.parts.as_slice() {
            return Ok(weighing.deviation(set));
        }
        let subject = weighing.foundation.subject;
        let with = subject.predict(&self.believed.settings)?;
        let mut variance = vec![0.0; with.len()];
        for (share, set) in &self.parts {
            let Some(own) = weighing.deviation(set) else { return Ok(None) };
            for (row, (own, value)) in own.iter().zip(subject.predict(&set.settings)?).enumerate() {
                let apart = value.ok().zip(with[row].ok()).map_or(0.0, |(value, with)| value - with);
                variance[row] += share * (own * own + apart * apart);
            }
        }
        Ok(Some(variance.into_iter().map(f64::sqrt).collect()))
    }
}

/// The causes of all sets, each size the mean over the sets, 0 where a set does not hold it; shapes are those of the
/// likeliest set that holds them.
fn average(hypotheses: &[Hypothesis], parts: &[(f64, &SetWeight)]) -> Vec<Setting> {
    let all: BTreeSet<usize> = parts.iter().flat_map(|(_, set)| set.members.iter().copied()).collect();
    let of = |hypothesis: usize| {
        let holding: Vec<(f64, &Setting)> = parts
            .iter()
            .filter_map(|(share, set)| Some((*share, set.settings.iter().find(|own| own.hypothesis == hypothesis)?)))
            .collect();
        let (_, first) = holding.first()?;
        let declared = &hypotheses[hypothesis];
        let whole: f64 = holding.iter().map(|(share, _)| share).sum();
        let mean = |variable: usize| holding.iter().map(|(share, own)| share * own.values[variable]).sum();
        let value = |variable: usize| match declared.variables[variable].treatment {
            Treatment::Amplitude { .. } => mean(variable),
            _ => first.values[variable],
        };
        let values = (0..declared.variables.len()).map(value).collect();
        (declared.has_amplitude() || whole >= THERE).then_some(Setting { hypothesis, values })
    };
    all.into_iter().filter_map(of).collect()
}
