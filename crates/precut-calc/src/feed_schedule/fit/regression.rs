//! One output, one form, one set of terms: the fit and what it is worth on trials that it has not seen.

use super::sample::Sample;
use crate::machinability::ModelForm;
use crate::num::dense::Columns;
use crate::num::stats::{Criteria, Linear, Resampler, group_out, percentile_interval, regress};

/// A fit of a sample.
#[derive(Debug, Clone)]
pub(super) struct Fitted {
    pub(super) form: ModelForm,
    /// Terms in it, by place in the sample.
    pub(super) terms: Vec<usize>,
    /// Response: ln(output) or the output.
    pub(super) response: Vec<f64>,
    pub(super) linear: Linear,
    /// Errors (response minus prediction) of every trial, predicted from the other folds.
    pub(super) held_out: Vec<Option<f64>>,
    pub(super) criteria: Criteria,
}

/// The response of a form; `None` where an output is not positive under a logarithm.
pub(super) fn response(form: ModelForm, values: &[f64]) -> Option<Vec<f64>> {
    match form {
        ModelForm::SemiLog => Some(values.to_vec()),
        ModelForm::LogLog => values.iter().all(|v| *v > 0.0).then(|| values.iter().map(|v| v.ln()).collect()),
    }
}

impl Fitted {
    /// Fits a form with a set of terms (`fit/1.1`, `fit/1.2`); `None` where the trials do not determine it.
    pub(super) fn new(sample: &Sample, form: ModelForm, terms: &[usize]) -> Option<Self> {
        let response = response(form, &sample.values)?;
        let design = sample.design.take_columns(&Sample::columns(terms));
        let linear = regress(&design, &response).ok()?;
        let held_out = group_out(&linear, &sample.folds);
        // Density of y from that of ln y.
        let offset = match form {
            ModelForm::LogLog => 2.0 * response.iter().sum::<f64>(),
            ModelForm::SemiLog => 0.0,
        };
        let criteria = Criteria::of(response.len(), terms.len() + 1, linear.rss, offset);
        Some(Self { form, terms: terms.to_vec(), response, linear, held_out, criteria })
    }

    /// Root mean square of the held-out errors and how many trials have one (`fit/2.1`).
    pub(super) fn held_out_error(&self) -> Option<(f64, usize)> {
        root_mean_square(self.held_out.iter().flatten().copied())
    }

    /// The same for the mean of the other folds in place of a model, over the trials that both predict.
    pub(super) fn baseline_error(&self, sample: &Sample) -> Option<f64> {
        let constant = Columns::of(self.response.len(), [vec![1.0; self.response.len()].as_slice()]);
        let mean = regress(&constant, &self.response).ok()?;
        let errors = group_out(&mean, &sample.folds);
        let both = errors.iter().zip(&self.held_out).filter_map(|(base, own)| own.and(*base));
        root_mean_square(both).map(|(error, _)| error)
    }

    /// Held-out error in the unit of the output, for comparing forms.
    pub(super) fn held_out_error_of_output(&self, sample: &Sample) -> Option<f64> {
        let errors = self.held_out.iter().zip(&self.response).zip(&sample.values).filter_map(|((error, y), value)| {
            let predicted = y - (*error)?;
            Some(value - if self.form == ModelForm::LogLog { predicted.exp() } else { predicted })
        });
        root_mean_square(errors).map(|(error, _)| error)
    }

    /// Intervals of the coefficients (constant at the centre first) by resampling whole conditions (`fit/1.4`).
    pub(super) fn resampled(&self, sample: &Sample, resamples: u32, seed: u32, level: f64) -> Vec<Option<(f64, f64)>> {
        let count = self.linear.coefficients.len();
        let groups = &sample.conditions;
        let draws: Vec<Vec<f64>> = (0..resamples)
            .filter_map(|index| {
                let mut draw = Resampler::new(u64::from(seed), u64::from(index));
                let rows: Vec<usize> =
                    draw.indices(groups.len()).into_iter().flat_map(|group| groups[group].iter().copied()).collect();
                let y: Vec<f64> = rows.iter().map(|&i| self.response[i]).collect();
                regress(&self.linear.design().take_rows(&rows), &y).ok().map(|fit| fit.coefficients)
            })
            .collect();
        // Intervals of few draws would be those of the lucky ones.
        let enough = draws.len() * 10 >= resamples as usize * 9 && draws.len() >= 100;
        (0..count)
            .map(|j| {
                let samples: Vec<f64> = draws.iter().map(|draw| draw[j]).collect();
                percentile_interval(&samples, level).filter(|_| enough)
            })
            .collect()
    }
}

fn root_mean_square(errors: impl Iterator<Item = f64>) -> Option<(f64, usize)> {
    let (sum, count) = errors.fold((0.0, 0), |(sum, count), e| (sum + e * e, count + 1));
    (count > 0).then(|| ((sum / count as f64).sqrt(), count))
}
