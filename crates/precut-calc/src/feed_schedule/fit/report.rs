//! From fits to the answer.

use super::check::term_name;
use super::choice::{Choice, curvatures};
use super::input::{FitJob, KNOWN_OUTPUTS, known_variable, unit_of};
use super::output::{
    Coefficient, CrossValidation, Design, FactorSpan, MissingTerm, OtherForm, OutputFit, Prediction, PureError, Rival,
    TestResult, TrialColumns, VariableSpan,
};
use super::regression::Fitted;
use super::sample::{Sample, Source};
use crate::machinability::{
    CoefficientCovariance, FurtherVariable, MachinabilityModel, ModelCoefficient, ModelForm, ModelRange,
};
use crate::material::Certainty;
use crate::num::dense::{Columns, dot};
use crate::num::hull::distance_to_hull;
use crate::num::stats::{Test, anderson_darling, breusch_pagan, collinearity, lack_of_fit, ljung_box, t_two_sided};

/// Points by which the share of the hull in its box is measured.
const HULL_POINTS: u32 = 400;
/// Level of the test for outliers over all trials together.
const OUTLIER_LEVEL: f64 = 0.05;

/// A fitted output with what its answer is made of.
pub(super) struct Fit<'a> {
    pub(super) job: &'a FitJob,
    pub(super) column: String,
    pub(super) sample: Sample,
    pub(super) choice: Choice,
}

/// Name of an output among models and its unit.
pub(super) fn output_name(column: &str) -> (String, &'static str) {
    KNOWN_OUTPUTS.iter().find(|known| known.column == column).map_or_else(
        || {
            let unit = unit_of(column);
            let suffix = match unit {
                "1" => String::new(),
                other => format!("_{}", other.to_lowercase().replace('/', "_per_").replace(' ', "_")),
            };
            (column.strip_suffix(suffix.as_str()).unwrap_or(column).to_owned(), unit)
        },
        |known| (known.name.to_owned(), known.unit),
    )
}

/// A spread of logarithms as a share of the value.
pub(super) fn percent(form: ModelForm, spread: f64) -> Option<f64> {
    let share = 100.0 * spread.exp_m1();
    (form == ModelForm::LogLog && share.is_finite()).then_some(share)
}

impl Fit<'_> {
    fn fitted(&self) -> &Fitted {
        &self.choice.fitted
    }

    fn of_response(&self, response: f64) -> f64 {
        if self.fitted().form == ModelForm::LogLog { response.exp() } else { response }
    }

    /// Row of the chosen fit's design out of a whole row.
    fn chosen_row(&self, whole: &[f64]) -> Vec<f64> {
        Sample::columns(&self.fitted().terms).into_iter().map(|j| whole[j]).collect()
    }

    /// The design's row at 1 of every variable and the first levels: there the constant stands.
    fn row_of_ones(&self) -> Vec<f64> {
        let at_one = self.sample.terms.iter().map(|term| match term.source {
            Source::Logarithm { mean, .. } => -mean,
            Source::Level { .. } => 0.0,
        });
        std::iter::once(1.0).chain(at_one).collect()
    }

    /// The model as a schedule takes it (`fit/1.3`).
    pub(super) fn model(&self) -> MachinabilityModel {
        let fitted = self.fitted();
        let mut model = MachinabilityModel {
            form: fitted.form,
            constant: fitted.linear.predict(&self.chosen_row(&self.row_of_ones())).0,
            residual_scatter: Some(fitted.linear.residual_sd()),
            trials: u32::try_from(self.sample.rows.len()).ok(),
            source: Some("fitted to trials".to_owned()),
            certainty: Some(Certainty::Likely),
            ..MachinabilityModel::default()
        };
        let mut range = ModelRange::default();
        for (k, term) in self.sample.terms.iter().enumerate() {
            let place = fitted.terms.iter().position(|chosen| *chosen == k);
            let coefficient = place.map_or(0.0, |place| fitted.linear.coefficients[place + 1]);
            match (&term.source, known_variable(&term.column)) {
                (Source::Logarithm { range: (least, largest), .. }, Some(variable)) => {
                    range.set(variable, *least, *largest);
                    let slot = match variable {
                        crate::machinability::Variable::Speed => &mut model.speed_exponent,
                        crate::machinability::Variable::Feed => &mut model.feed_exponent,
                        crate::machinability::Variable::Depth => &mut model.depth_exponent,
                        crate::machinability::Variable::Angle => &mut model.angle_exponent,
                    };
                    *slot = coefficient;
                }
                (Source::Logarithm { mean, range: (least, largest) }, None) if place.is_some() => {
                    model.further.push(FurtherVariable {
                        name: term.column.clone(),
                        exponent: coefficient,
                        value: self.job.at.further.get(&term.column).copied().unwrap_or_else(|| mean.exp()),
                        least: Some(*least),
                        largest: Some(*largest),
                    });
                }
                (Source::Logarithm { .. }, None) => {}
                (Source::Level { level }, _) => {
                    let standing = self.job.at.factors.get(&term.column);
                    if standing == Some(level) {
                        model.constant += coefficient;
                    }
                }
            }
        }
        for variable in crate::machinability::Variable::ALL {
            // What was the same in all trials is the range as well.
            let mut values =
                self.sample.rows.iter().filter_map(|&i| self.job.trials.rows()[i].number(variable.field()));
            if range.of(variable) == (None, None)
                && let Some(first) = values.next()
                && values.all(|value| value.to_bits() == first.to_bits())
            {
                range.set(variable, first, first);
            }
        }
        model.range = Some(range);
        model.coefficient_covariance = self.covariance(&model);
        model
    }

    /// The covariance of the model's coefficients (`fit/1.5`), with further variables and factors as they stand; `None` where
    /// the trials leave no degree of freedom.
    fn covariance(&self, model: &MachinabilityModel) -> Option<CoefficientCovariance> {
        let linear = &self.fitted().linear;
        if linear.degrees_of_freedom == 0 {
            return None;
        }
        let mut constant = self.row_of_ones();
        let mut rows: Vec<(ModelCoefficient, Vec<f64>)> = Vec::new();
        for (k, term) in self.sample.terms.iter().enumerate() {
            match (&term.source, known_variable(&term.column)) {
                (Source::Logarithm { .. }, Some(variable)) => {
                    let mut unit = vec![0.0; constant.len()];
                    unit[k + 1] = 1.0;
                    if self.fitted().terms.contains(&k) {
                        rows.push((ModelCoefficient::of(variable), self.chosen_row(&unit)));
                    }
                }
                (Source::Logarithm { .. }, None) => {
                    let stands = model.further.iter().find(|further| further.name == term.column);
                    constant[k + 1] += stands.map_or(0.0, |further| further.value.ln());
                }
                (Source::Level { level }, _) => {
                    constant[k + 1] = f64::from(u8::from(self.job.at.factors.get(&term.column) == Some(level)));
                }
            }
        }
        rows.insert(0, (ModelCoefficient::Constant, self.chosen_row(&constant)));
        let variance = linear.residual_sd().powi(2);
        let covariance = |a: &[f64], b: &[f64]| {
            let along = |i: usize| dot(&linear.inverse_gram.row(i), b);
            variance * a.iter().enumerate().map(|(i, a)| a * along(i)).sum::<f64>()
        };
        // Symmetric to the last digit.
        let entry = |i: usize, j: usize| covariance(&rows[i.min(j)].1, &rows[i.max(j)].1);
        Some(CoefficientCovariance {
            order: rows.iter().map(|(coefficient, _)| *coefficient).collect(),
            matrix: (0..rows.len()).map(|i| (0..rows.len()).map(|j| entry(i, j)).collect()).collect(),
            degrees_of_freedom: Some(linear.degrees_of_freedom as f64),
        })
    }

    /// Everything that is to be said of the fit.
    pub(super) fn output(&self) -> OutputFit {
        let (fitted, sample, linear) = (self.fitted(), &self.sample, &self.fitted().linear);
        let (name, unit) = output_name(&self.column);
        let scatter = linear.residual_sd();
        let design = linear.design();
        let collinear = collinearity(design);
        let mean = fitted.response.iter().sum::<f64>() / fitted.response.len().max(1) as f64;
        let total: f64 = fitted.response.iter().map(|y| (y - mean) * (y - mean)).sum();
        let names = |terms: &[usize]| terms.iter().map(|k| term_name(&sample.terms[*k])).collect();
        let lags = (sample.rows.len() / 5).min(10);
        OutputFit {
            column: self.column.clone(),
            name,
            unit: unit.to_owned(),
            form: fitted.form,
            form_decided: self.choice.form_decided,
            trials: sample.rows.len(),
            incomplete_trials: sample.incomplete,
            conditions: sample.conditions.len(),
            degrees_of_freedom: linear.degrees_of_freedom,
            coefficients: self.coefficients(&collinear.inflation),
            residual_scatter: scatter,
            residual_scatter_percent: percent(fitted.form, scatter),
            r_squared: 1.0 - linear.rss / total,
            cross_validation: self.cross_validation(),
            pure_error: self.pure_error(),
            lack_of_fit: lack_of_fit(linear, &sample.conditions, &fitted.response).map(result),
            uneven_scatter: breusch_pagan(&linear.residuals, design).map(result),
            drift_in_order: ljung_box(&linear.residuals, lags).map(result),
            normality: anderson_darling(&linear.residuals).map(result),
            missing_terms: curvatures(sample, fitted)
                .into_iter()
                .take(5)
                .map(|curvature| MissingTerm {
                    column: curvature.columns.0,
                    with: curvature.columns.1,
                    coefficient: curvature.coefficient,
                    p_value: curvature.p_value,
                    error_with: curvature.held_out_error,
                })
                .collect(),
            other_form: self.choice.other_form.as_ref().map(|other| OtherForm {
                form: other.form,
                criterion_above: criterion(other) - criterion(fitted),
                error_of_output: other.held_out_error_of_output(sample),
            }),
            rivals: self
                .choice
                .rivals
                .iter()
                .map(|(terms, above)| Rival { columns: names(terms), criterion_above: *above })
                .collect(),
            largest_inflation: collinear.inflation.iter().fold(1.0, |most, v| v.max(most)),
            condition_number: collinear.condition,
            rows: self.rows(),
        }
    }

    fn coefficients(&self, inflation: &[f64]) -> Vec<Coefficient> {
        let (fitted, job) = (self.fitted(), self.job);
        let linear = &fitted.linear;
        let half = linear.half_width(job.confidence);
        let errors = linear.standard_errors();
        let resampled = fitted.resampled(&self.sample, job.resamples, job.seed, job.confidence);
        let degrees = linear.degrees_of_freedom as f64;
        let ones = self.chosen_row(&self.row_of_ones());
        let (constant, constant_error) = linear.predict(&ones);
        let first = Coefficient {
            name: "constant".to_owned(),
            value: constant,
            standard_error: constant_error,
            lower: constant - half * constant_error,
            upper: constant + half * constant_error,
            resampled_lower: None,
            resampled_upper: None,
            p_value: None,
            inflation: None,
        };
        let others = fitted.terms.iter().enumerate().map(|(place, &term)| {
            let (value, error) = (linear.coefficients[place + 1], errors[place + 1]);
            let interval = resampled.get(place + 1).copied().flatten();
            let t = value / error;
            Coefficient {
                name: term_name(&self.sample.terms[term]),
                value,
                standard_error: error,
                lower: value - half * error,
                upper: value + half * error,
                resampled_lower: interval.map(|i| i.0),
                resampled_upper: interval.map(|i| i.1),
                p_value: Some(if error > 0.0 { t_two_sided(t, degrees) } else { 0.0 }),
                inflation: inflation.get(place).copied(),
            }
        });
        std::iter::once(first).chain(others).collect()
    }

    fn cross_validation(&self) -> CrossValidation {
        let fitted = self.fitted();
        let error = fitted.held_out_error();
        let of_mean = fitted.baseline_error(&self.sample);
        let explained = error.zip(of_mean).map(|((own, _), mean)| 1.0 - (own / mean).powi(2)).filter(|s| s.is_finite());
        CrossValidation {
            folds: self.sample.folds.len(),
            predicted_trials: error.map_or(0, |(_, count)| count),
            error: error.map(|(error, _)| error),
            error_percent: error.and_then(|(error, _)| percent(fitted.form, error)),
            error_of_output: fitted.held_out_error_of_output(&self.sample),
            error_of_mean: of_mean,
            explained_share: explained,
        }
    }

    /// Pooled scatter of repeats (`fit/4.1`).
    fn pure_error(&self) -> Option<PureError> {
        let response = &self.fitted().response;
        let degrees = self.sample.rows.len() - self.sample.conditions.len();
        let squares: f64 = self
            .sample
            .conditions
            .iter()
            .map(|group| {
                let mean = group.iter().map(|&i| response[i]).sum::<f64>() / group.len() as f64;
                group.iter().map(|&i| (response[i] - mean) * (response[i] - mean)).sum::<f64>()
            })
            .sum();
        (degrees > 0)
            .then(|| PureError { standard_deviation: (squares / degrees as f64).sqrt(), degrees_of_freedom: degrees })
    }

    fn rows(&self) -> TrialColumns {
        let (fitted, linear) = (self.fitted(), &self.fitted().linear);
        let studentised = linear.deleted_t();
        let degrees = linear.degrees_of_freedom as f64 - 1.0;
        let count = studentised.len() as f64;
        TrialColumns {
            row: self.sample.rows.clone(),
            measured: self.sample.values.clone(),
            fitted: linear.fitted.iter().map(|y| self.of_response(*y)).collect(),
            held_out: fitted
                .held_out
                .iter()
                .zip(&fitted.response)
                .map(|(error, y)| error.map(|e| self.of_response(y - e)).filter(|v| v.is_finite()))
                .collect(),
            outlier: studentised
                .iter()
                .map(|t| t.is_some_and(|t| t_two_sided(t, degrees) * count < OUTLIER_LEVEL))
                .collect(),
            leverage: linear.leverages.clone(),
            cooks_distance: linear.cooks_distances(),
            studentised,
        }
    }

    /// Predictions at the places asked for (`fit/1.5`).
    pub(super) fn predictions(&self, hull: &[Vec<f64>]) -> Vec<Prediction> {
        let linear = &self.fitted().linear;
        let half = linear.half_width(self.job.confidence);
        let scatter = linear.residual_sd();
        let at = |(place, whole): (usize, Vec<f64>)| {
            let (value, error) = linear.predict(&self.chosen_row(&whole));
            let single = (error * error + scatter * scatter).sqrt();
            let distance = distance_to_hull(hull, &self.sample.unit_point(&whole)).unwrap_or(0.0);
            let ends = |spread: f64| (self.of_response(value - half * spread), self.of_response(value + half * spread));
            let ((lower, upper), (trial_lower, trial_upper)) = (ends(error), ends(single));
            Prediction {
                place,
                output: output_name(&self.column).0,
                value: self.of_response(value),
                lower,
                upper,
                trial_lower,
                trial_upper,
                within_hull: distance <= 0.0,
                hull_distance: distance,
            }
        };
        let rows = self.job.predict.iter().enumerate();
        let rows = rows.filter_map(|(index, place)| Some((index, self.sample.row(self.job, place).ok()?)));
        rows.map(at).filter(|p| [p.value, p.lower, p.trial_upper, p.upper].iter().all(|v| v.is_finite())).collect()
    }

    /// Response errors without the trial's own say, for naming wrong units.
    pub(super) fn deleted_errors(&self) -> Vec<f64> {
        let linear = &self.fitted().linear;
        linear.residuals.iter().zip(&linear.leverages).map(|(e, h)| e / (1.0 - h).max(1e-9)).collect()
    }
}

/// Corrected Akaike criterion; without room for the correction Schwarz's.
fn criterion(fitted: &Fitted) -> f64 {
    fitted.criteria.aicc.unwrap_or(fitted.criteria.bic)
}

fn result(test: Test) -> TestResult {
    let Test { statistic, degrees, degrees_below, p_value } = test;
    TestResult {
        statistic: statistic.clamp(f64::MIN, f64::MAX),
        degrees_of_freedom: degrees,
        degrees_of_freedom_below: degrees_below,
        p_value,
    }
}

/// What the trials span, seen from the first output.
pub(super) fn design(job: &FitJob, sample: &Sample, hull: &[Vec<f64>]) -> Design {
    let variables = sample.terms.iter().filter_map(|term| match &term.source {
        Source::Logarithm { range: (least, largest), .. } => {
            let mut levels: Vec<u64> = sample
                .rows
                .iter()
                .filter_map(|&i| job.trials.rows()[i].number(&term.column).map(f64::to_bits))
                .collect();
            levels.sort_unstable();
            levels.dedup();
            Some(VariableSpan { column: term.column.clone(), least: *least, largest: *largest, levels: levels.len() })
        }
        Source::Level { .. } => None,
    });
    let factors = sample.first_levels.iter().map(|(column, first)| {
        let further = sample.terms.iter().filter(|term| term.column == *column).filter_map(|term| match &term.source {
            Source::Level { level } => Some(level.clone()),
            Source::Logarithm { .. } => None,
        });
        FactorSpan { column: column.clone(), levels: std::iter::once(first.clone()).chain(further).collect() }
    });
    let share = hull_share(hull);
    Design {
        trials: job.trials.rows().len(),
        excluded: job.trials.rows().iter().filter(|trial| trial.excluded).count(),
        variables: variables.collect(),
        factors: factors.collect(),
        hull_share: share,
        hull_share_error: (share * (1.0 - share) / f64::from(HULL_POINTS)).sqrt(),
    }
}

/// Share of the unit box within the hull, over points of Halton's sequence (`fit/5.2`).
fn hull_share(hull: &[Vec<f64>]) -> f64 {
    const BASES: [u32; 8] = [2, 3, 5, 7, 11, 13, 17, 19];
    let dimension = hull.first().map_or(0, Vec::len);
    if dimension == 0 {
        return 1.0;
    }
    let inside = (1..=HULL_POINTS).filter(|&index| {
        let point: Vec<f64> = (0..dimension).map(|d| radical_inverse(index, BASES[d % BASES.len()])).collect();
        distance_to_hull(hull, &point).is_some_and(|distance| distance <= 0.0)
    });
    inside.count() as f64 / f64::from(HULL_POINTS)
}

/// Digits of `index` in `base`, mirrored behind the point.
fn radical_inverse(mut index: u32, base: u32) -> f64 {
    let (mut value, mut weight) = (0.0, 1.0);
    while index > 0 {
        weight /= f64::from(base);
        value += weight * f64::from(index % base);
        index /= base;
    }
    value
}

/// How strongly a term moves the response over the range of the trials.
pub(super) fn swing(sample: &Sample, fitted: &Fitted, place: usize) -> f64 {
    let column: &[f64] = sample.design.column(fitted.terms[place] + 1);
    let (low, high) = column.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
    fitted.linear.coefficients[place + 1] * (high - low)
}

/// Correlation of two numbers' columns, for naming what moves together.
pub(super) fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let centre = |v: &[f64]| {
        let mean = v.iter().sum::<f64>() / v.len().max(1) as f64;
        v.iter().map(|x| x - mean).collect::<Vec<f64>>()
    };
    let (a, b) = (centre(a), centre(b));
    let size = (dot(&a, &a) * dot(&b, &b)).sqrt();
    if size > 0.0 { dot(&a, &b) / size } else { 0.0 }
}

/// The two variables that move together most.
pub(super) fn closest_pair(sample: &Sample, design: &Columns) -> Option<(usize, usize, f64)> {
    let count = sample.terms.len();
    (0..count)
        .flat_map(|a| (a + 1..count).map(move |b| (a, b)))
        .map(|(a, b)| (a, b, correlation(design.column(a + 1), design.column(b + 1))))
        .max_by(|x, y| x.2.abs().total_cmp(&y.2.abs()))
}
