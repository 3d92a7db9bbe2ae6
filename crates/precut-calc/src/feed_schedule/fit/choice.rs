//! Which form, which terms: where the trials can tell.

use super::input::{FitJob, FormChoice, KNOWN_OUTPUTS, Terms};
use super::regression::Fitted;
use super::sample::{Sample, Source};
use crate::machinability::ModelForm;
use crate::num::stats::{holm, nested_f, regress};

/// A difference of the corrected Akaike criterion that decides: odds of 20 to 1.
const DECISIVE: f64 = 5.99;
/// Up to it a set of terms is a rival worth naming.
const RIVAL: f64 = 4.0;

/// What was chosen and against what.
#[derive(Debug, Clone)]
pub(super) struct Choice {
    pub(super) fitted: Fitted,
    /// The other form, where it was possible.
    pub(super) other_form: Option<Fitted>,
    /// Whether the trials tell the two forms apart (odds of 20 to 1).
    pub(super) form_decided: Option<bool>,
    /// Sets of terms that the trials cannot tell from the chosen one, with how much worse their criterion is.
    pub(super) rivals: Vec<RivalTerms>,
}

/// A set of terms and how much worse its criterion is.
pub(super) type RivalTerms = (Vec<usize>, f64);

/// Forms that an output may have.
pub(super) fn forms(job: &FitJob, output: &str) -> Vec<ModelForm> {
    let known = KNOWN_OUTPUTS.iter().find(|known| known.column == output);
    let positive = || job.used().filter_map(|(_, trial)| trial.number(output)).all(|value| value > 0.0);
    match job.form {
        _ if known.is_some_and(|known| known.power_law_only) => vec![ModelForm::LogLog],
        FormChoice::LogLog => vec![ModelForm::LogLog],
        FormChoice::SemiLog => vec![ModelForm::SemiLog],
        // A schedule limits further outputs as power laws.
        FormChoice::Choose if known.is_none() && positive() => vec![ModelForm::LogLog],
        FormChoice::Choose => vec![ModelForm::LogLog, ModelForm::SemiLog],
    }
}

/// The fit of an output (`fit/3.1`, `fit/3.2`); `None` where the trials determine none.
pub(super) fn choose(job: &FitJob, output: &str, sample: &Sample) -> Option<Choice> {
    let mut candidates: Vec<(Fitted, Vec<RivalTerms>)> =
        forms(job, output).into_iter().filter_map(|form| of_form(job, sample, form)).collect();
    // A stable order: the power law stays first where the two are equal.
    candidates.sort_by(|a, b| criterion(&a.0).total_cmp(&criterion(&b.0)));
    let mut candidates = candidates.into_iter();
    let (fitted, rivals) = candidates.next()?;
    let other_form = candidates.next().map(|(other, _)| other);
    let form_decided = other_form.as_ref().map(|other| criterion(other) - criterion(&fitted) >= DECISIVE);
    Some(Choice { fitted, other_form, form_decided, rivals })
}

/// Corrected Akaike criterion; without the room for the correction Schwarz's.
fn criterion(fitted: &Fitted) -> f64 {
    fitted.criteria.aicc.unwrap_or(fitted.criteria.bic)
}

fn of_form(job: &FitJob, sample: &Sample, form: ModelForm) -> Option<(Fitted, Vec<RivalTerms>)> {
    let all: Vec<usize> = (0..sample.terms.len()).collect();
    if job.terms == Terms::All {
        return Fitted::new(sample, form, &all).map(|fitted| (fitted, Vec::new()));
    }
    let blocks = blocks(sample);
    let mut fits: Vec<Fitted> = (0..1_usize << blocks.len())
        .filter_map(|mask| {
            let chosen = blocks.iter().enumerate().filter(|(k, _)| mask >> k & 1 == 1);
            let terms: Vec<usize> = chosen.flat_map(|(_, block)| block.iter().copied()).collect();
            Fitted::new(sample, form, &terms)
        })
        .collect();
    fits.sort_by(|a, b| criterion(a).total_cmp(&criterion(b)).then(a.terms.len().cmp(&b.terms.len())));
    let mut fits = fits.into_iter();
    let best = fits.next()?;
    let rivals = fits
        .map(|fit| (fit.terms.clone(), criterion(&fit) - criterion(&best)))
        .take_while(|(_, worse)| *worse <= RIVAL)
        .take(10)
        .collect();
    Some((best, rivals))
}

/// Terms that stand or fall together: a variable, or all levels of a factor.
fn blocks(sample: &Sample) -> Vec<Vec<usize>> {
    let mut blocks: Vec<Vec<usize>> = Vec::new();
    for (k, term) in sample.terms.iter().enumerate() {
        let same_factor = matches!(term.source, Source::Level { .. })
            && blocks.last().is_some_and(|block| sample.terms[block[0]].column == term.column);
        match blocks.last_mut() {
            Some(block) if same_factor => block.push(k),
            _ => blocks.push(vec![k]),
        }
    }
    blocks
}

/// A term of second order that the trials ask for.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Curvature {
    /// The two columns; equal for a square.
    pub(super) columns: (String, String),
    /// Coefficient of the product of the logarithms (centred).
    pub(super) coefficient: f64,
    /// Probability of so large a one by chance, corrected for the number of terms looked at.
    pub(super) p_value: f64,
    /// Held-out error with it.
    pub(super) held_out_error: Option<f64>,
}

/// Squares and products of the variables in the model, each added alone (`fit/3.3`); with the corrected probabilities,
/// smallest first.
pub(super) fn curvatures(sample: &Sample, fitted: &Fitted) -> Vec<Curvature> {
    let variables: Vec<usize> =
        fitted.terms.iter().copied().filter(|k| matches!(sample.terms[*k].source, Source::Logarithm { .. })).collect();
    let pairs = variables.iter().enumerate().flat_map(|(i, &a)| variables[i..].iter().map(move |&b| (a, b)));
    let mut found: Vec<Curvature> = pairs
        .filter_map(|(a, b)| {
            let mut design = fitted.linear.design().clone();
            let product: Vec<f64> =
                sample.design.column(a + 1).iter().zip(sample.design.column(b + 1)).map(|(x, y)| x * y).collect();
            design.push(&product);
            let larger = regress(&design, &fitted.response).ok()?;
            let test = nested_f(&fitted.linear, &larger)?;
            let errors = crate::num::stats::group_out(&larger, &sample.folds);
            let squares: Vec<f64> = errors.iter().flatten().map(|e| e * e).collect();
            let name = |k: usize| sample.terms[k].column.clone();
            Some(Curvature {
                columns: (name(a), name(b)),
                coefficient: *larger.coefficients.last()?,
                p_value: test.p_value,
                held_out_error: (!squares.is_empty())
                    .then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()),
            })
        })
        .filter(|curvature| curvature.p_value.is_finite())
        .collect();
    let corrected = holm(&found.iter().map(|c| c.p_value).collect::<Vec<_>>());
    for (curvature, p) in found.iter_mut().zip(corrected) {
        curvature.p_value = p;
    }
    found.sort_by(|a, b| a.p_value.total_cmp(&b.p_value));
    found
}
