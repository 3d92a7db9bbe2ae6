//! From the statistics to the answer: the verdict in the words of the contract, and every step behind it.

use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

use super::adequacy::{TestKind, adequacy};
use super::base::Bound;
use super::calculator::{JobOf, ResultOf, stage};
use super::data::Data;
use super::foundation::Foundation;
use super::gain::{Gain, gain};
use super::identify::{CONFOUNDED_BELOW, Signature, separations, twins};
use super::next::{NextMeasurement, next_measurement};
use super::noise::{Noise, NoiseSource};
use super::output::{
    CausePair, CauseReport, DiagnosisResult, GainReport, LikelySet, NamedCause, NextReport, NoiseReport, NotApplicable,
    ParameterReport, Refusal, RemainderReport, RowColumns, SeparationReport, SetReport, TestReport, VerdictClass,
};
use super::remainder::remainder_shape;
use super::subject::{Setting, Subject};
use super::suspect::{SuspectedFactor, copied_traces, suspected_factor};
use super::weigh::{Effort, SetWeight, Verdict, Weighing};
use crate::calculator::{
    Answer, Basis, Diagnosable, Failure, Finding, Hypothesis, Inapplicability, Measurement, Message, Monitor, Rows,
    Smooth, Treatment,
};

/// Sets that are listed.
const LISTED_SETS: usize = 20;
/// Leading sets whose separations are given.
const SEPARATED_SETS: usize = 6;
/// Share of rows that the base must predict.
const LEAST_PREDICTED: f64 = 0.8;

pub(super) const WARNING_CODES: &[&str] =
    &["rows_not_predicted", "outliers_left_out", "too_many_outliers", "copied_sweeps", "scatter_unlike_stated"];
pub(super) const EXPLANATION_CODES: &[&str] = &[
    "diagnosis_adequate",
    "diagnosis_adequate_with_hint",
    "diagnosis_named",
    "diagnosis_confounded",
    "diagnosis_unknown",
    "diagnosis_unit_suspected",
    "diagnosis_base_fails",
    "diagnosis_gain",
    "diagnosis_next",
];
pub(super) const STAGE_CODES: &[&str] =
    &["diagnosis_stage_signatures", "diagnosis_stage_search", "diagnosis_stage_gain", "stage_done"];

/// The whole answer.
pub(super) fn answer<M: Diagnosable>(
    job: &JobOf<M>,
    places: &Rows<M::Run, M::Point>,
    used: &[usize],
    bound: &Bound<M>,
    data: &Data,
    monitor: &dyn Monitor,
) -> Result<Answer<ResultOf<M>>, Failure> {
    stage(monitor, 0.05, "diagnosis_stage_signatures");
    let foundation = Foundation::of(bound, data, monitor)?;
    let found = foundation.outliers();
    let keep = if job.options.leave_outliers_out { foundation.keep(&found) } else { foundation.predicted.clone() };
    stage(monitor, 0.2, "diagnosis_stage_search");
    let most_causes = usize::from(job.options.most_causes);
    let (effort, fold_effort) = if bound.is_dear() {
        (Effort::dear(most_causes), Effort::dear_fold(most_causes))
    } else {
        (Effort::full(most_causes), Effort::full(most_causes))
    };
    let weighing = Weighing::of(&foundation, keep, effort, monitor)?;
    let refusal = refusal(job.options.accept_suspected_unit, &foundation, &weighing);
    let gain = if job.options.held_out && refusal.is_none() {
        stage(monitor, 0.5, "diagnosis_stage_gain");
        gain(&foundation, &weighing, fold_effort, true, u64::from(job.options.seed), monitor)?
    } else {
        None
    };
    let next = if refusal.is_none() { next_measurement::<M>(job, places, &weighing, monitor)? } else { None };
    let view = View { hypotheses: bound.hypotheses(), weighing: &weighing };
    let named = view.named();
    let settings: &[Setting] = view.leading().map_or(&[], |set| &set.settings);
    let shown = named.is_empty() || refusal.is_some();
    let effects = if shown { Vec::new() } else { bound.effects_of(settings)? };
    let extended = if shown { None } else { Some(bound.predict(settings)?) };
    let mut warnings = warnings(&foundation, &weighing, job.options.leave_outliers_out, &found, used);
    warnings.extend(copied_traces(data).into_iter().map(|(first, second)| {
        Finding::new("copied_sweeps", "/measurements").with("first", first + 1).with("second", second + 1)
    }));
    let output = DiagnosisResult {
        verdict: if refusal.is_some() { VerdictClass::Refused } else { view.class() },
        named: if refusal.is_some() { Vec::new() } else { named },
        likely_sets: view.likely_sets(),
        none_probability: weighing.none,
        unnamed_probability: weighing.unnamed,
        noise: noise_report(&weighing.noise),
        tests: adequacy(&weighing)
            .into_iter()
            .map(|test| TestReport {
                test: test_name(test.kind).to_owned(),
                statistic: test.statistic,
                p: test.p,
                p_holm: test.p_holm,
                rejects: test.p_holm < job.options.level,
            })
            .collect(),
        sets: weighing.sets.iter().take(LISTED_SETS).map(|set| view.set_report(set)).collect(),
        causes: view.causes(),
        not_applicable: not_applicable(bound, &weighing),
        twins: twins(&weighing)
            .into_iter()
            .map(|(a, b)| CausePair { a: view.kind(a).to_owned(), b: view.kind(b).to_owned() })
            .collect(),
        separations: view.separations()?,
        remainder: matches!(weighing.verdict, Verdict::Unknown(_)).then(|| remainder_shape(&weighing)).flatten().map(
            |shape| RemainderReport {
                kind: shape.kind.to_owned(),
                rms: shape.rms,
                largest_at_row: row_number(used[shape.extreme_row]),
                explained_share: shape.explained,
            },
        ),
        effects,
        gain: gain.as_ref().map(gain_report),
        next_measurement: next.map(|next| view.next_report(next)),
        rows: row_columns::<M>(job, used, &foundation, &weighing, extended.as_deref()),
        outliers: found.rows.iter().map(|&row| row_number(used[row])).collect(),
        refusal,
    };
    let explanation = explanation(&output, &job.quantity);
    stage(monitor, 1.0, "stage_done");
    Ok(Answer { output, warnings, explanation, basis: basis() })
}

/// What the verdict is made of.
struct View<'a> {
    hypotheses: &'a [Hypothesis],
    weighing: &'a Weighing<'a>,
}

impl View<'_> {
    fn kind(&self, hypothesis: usize) -> &'static str {
        self.hypotheses[hypothesis].cause.kind
    }

    fn class(&self) -> VerdictClass {
        match self.weighing.verdict {
            Verdict::Adequate => VerdictClass::Adequate,
            Verdict::Named(_) => VerdictClass::Named,
            Verdict::Confounded(_) => VerdictClass::Confounded,
            Verdict::Unknown(_) => VerdictClass::Unknown,
        }
    }

    /// The set whose causes are named.
    fn leading(&self) -> Option<&SetWeight> {
        let of = |members: &[usize], with_remainder: bool| {
            self.weighing.sets.iter().find(|set| set.members == members && set.remainder.is_some() == with_remainder)
        };
        match &self.weighing.verdict {
            Verdict::Named(members) => of(members, false),
            Verdict::Unknown(members) => of(members, true),
            _ => None,
        }
    }

    fn named(&self) -> Vec<NamedCause> {
        self.leading().map_or_else(Vec::new, |set| self.set(set))
    }

    fn likely_sets(&self) -> Vec<LikelySet> {
        let Verdict::Confounded(likely) = &self.weighing.verdict else { return Vec::new() };
        let sets = likely.iter().filter_map(|members| self.weighing.named_sets().find(|set| set.members == *members));
        sets.map(|set| LikelySet { causes: self.set(set), posterior: set.posterior }).collect()
    }

    fn set_report(&self, set: &SetWeight) -> SetReport {
        SetReport { causes: self.set(set), posterior: set.posterior, with_remainder: set.remainder.is_some() }
    }

    fn set(&self, set: &SetWeight) -> Vec<NamedCause> {
        let dof = self.weighing.noise.dof;
        set.settings
            .iter()
            .zip(&set.standard_deviations)
            .map(|(setting, deviations)| {
                let hypothesis = &self.hypotheses[setting.hypothesis];
                let parameters = hypothesis.variables.iter().zip(&setting.values).zip(deviations);
                NamedCause {
                    kind: hypothesis.cause.kind.to_owned(),
                    label: hypothesis.label.clone(),
                    parameters: parameters
                        .map(|((variable, &value), &sd)| {
                            let fitted = sd > 0.0 && !matches!(variable.treatment, Treatment::Stated { .. });
                            let interval = |share: f64| {
                                fitted.then(|| {
                                    let half = quantile(share, dof) * sd;
                                    let (low, high) = (variable.range.lower, variable.range.upper);
                                    [(value - half).clamp(low, high), (value + half).clamp(low, high)]
                                })
                            };
                            let range = variable.range;
                            let span = range.upper - range.lower;
                            ParameterReport {
                                name: variable.name.to_owned(),
                                unit: variable.unit.to_owned(),
                                value,
                                standard_deviation: fitted.then_some(sd),
                                interval_50: interval(0.50),
                                interval_90: interval(0.90),
                                interval_95: interval(0.95),
                                at_limit: fitted
                                    && (value - range.lower < 1e-9 * span || range.upper - value < 1e-9 * span),
                            }
                        })
                        .collect(),
                }
            })
            .collect()
    }

    fn causes(&self) -> Vec<CauseReport> {
        let mut causes: Vec<CauseReport> = self
            .hypotheses
            .iter()
            .zip(&self.weighing.inclusion)
            .map(|(hypothesis, &probability)| CauseReport {
                kind: hypothesis.cause.kind.to_owned(),
                label: hypothesis.label.clone(),
                probability,
                confounded_with: hypothesis.cause.confounded_with.iter().map(|&kind| kind.to_owned()).collect(),
            })
            .collect();
        causes.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        causes
    }

    fn next_report<R: utoipa::ToSchema>(&self, next: NextMeasurement<R>) -> NextReport<R> {
        let kinds = |members: &[usize]| members.iter().map(|&h| self.kind(h).to_owned()).collect();
        let count = |rows: usize| u32::try_from(rows).unwrap_or(u32::MAX);
        NextReport {
            changes: next.changes.to_owned(),
            run: next.run,
            rows: count(next.rows),
            leader: kinds(&next.leader),
            rival: kinds(&next.rival),
            separation_now_sigmas: next.separation_now,
            separation_then_sigmas: next.separation_then,
            bayes_factor: next.bayes_factor,
            rows_needed: next.rows_needed.map(count),
        }
    }

    fn separations(&self) -> Result<Vec<SeparationReport>, Failure> {
        let mut signatures = Vec::new();
        for set in self.weighing.named_sets().take(SEPARATED_SETS) {
            signatures.push(Signature::of(self.weighing, &set.members, &set.settings)?);
        }
        let kinds = |members: &[usize]| members.iter().map(|&h| self.kind(h).to_owned()).collect();
        Ok(separations(&signatures)
            .into_iter()
            .map(|pair| SeparationReport { a: kinds(&pair.a), b: kinds(&pair.b), sigmas: pair.sigmas })
            .collect())
    }
}

/// Two-sided quantile of Student's t, or of the normal distribution where the scatter is known.
fn quantile(share: f64, dof: f64) -> f64 {
    let p = f64::midpoint(1.0, share);
    match StudentsT::new(0.0, 1.0, dof) {
        Ok(student) if dof.is_finite() => student.inverse_cdf(p),
        _ => Normal::standard().inverse_cdf(p),
    }
}

fn row_number(row: usize) -> u32 {
    u32::try_from(row + 1).unwrap_or(u32::MAX)
}

fn test_name(kind: TestKind) -> &'static str {
    match kind {
        TestKind::LackOfFit => "lack_of_fit",
        TestKind::SmoothDirections => "smooth_directions",
        TestKind::LjungBox => "ljung_box",
        TestKind::Runs => "runs",
    }
}

fn noise_report(noise: &Noise) -> NoiseReport {
    let (source, scatter_factor) = match noise.source {
        NoiseSource::Stated { scatter_factor } => ("stated", Some(scatter_factor)),
        NoiseSource::Repeats => ("repeats", None),
        NoiseSource::Profile => ("profile", None),
        NoiseSource::Regression => ("regression", None),
    };
    NoiseReport {
        standard_deviation: noise.sigma,
        correlation: noise.rho,
        degrees_of_freedom: noise.dof.is_finite().then_some(noise.dof),
        source: source.to_owned(),
        scatter_factor,
    }
}

fn gain_report(gain: &Gain) -> GainReport {
    GainReport {
        folds: u32::try_from(gain.folds).unwrap_or(u32::MAX),
        rmse_base: gain.rmse_base,
        rmse_extended: gain.rmse_extended,
        gain: gain.gain,
        gain_interval_95: [gain.interval.0, gain.interval.1],
        noise_ceiling: gain.ceiling,
        explained_share: gain.explained_share,
    }
}

fn not_applicable<M: Diagnosable>(bound: &Bound<M>, weighing: &Weighing<'_>) -> Vec<NotApplicable> {
    let report = |kind: &str, reason: &str, condition: Option<&str>| NotApplicable {
        kind: kind.to_owned(),
        reason: reason.to_owned(),
        condition: condition.map(str::to_owned),
    };
    let stated = bound.catalogue().inapplicable.iter().map(|entry| {
        let kind = entry.cause.kind;
        match entry.reason {
            Inapplicability::ConditionAbsent(field) => report(kind, "condition_absent", Some(field)),
            Inapplicability::ConditionConstant(field) => report(kind, "condition_constant", Some(field)),
            Inapplicability::ConditionAtTwoLevels(field) => report(kind, "condition_at_two_levels", Some(field)),
            Inapplicability::NothingToActOn => report(kind, "nothing_to_act_on", None),
            Inapplicability::InJob => report(kind, "in_job", None),
            Inapplicability::ScatterOnly => report(kind, "scatter_only", None),
            Inapplicability::NotAskedFor => report(kind, "not_asked_for", None),
        }
    });
    let small = (0..bound.hypotheses().len())
        .filter(|h| !weighing.linear.visible.contains(h))
        .map(|h| report(bound.hypotheses()[h].cause.kind, "too_small", None));
    stated.chain(small).collect()
}

fn refusal(accept: bool, foundation: &Foundation<'_>, weighing: &Weighing<'_>) -> Option<Refusal> {
    let count = foundation.predicted.len() as f64;
    let predicted = foundation.predicted.iter().filter(|ok| **ok).count() as f64;
    if predicted < LEAST_PREDICTED * count {
        return Some(Refusal { reason: "base_fails".to_owned(), factor: None, fitted_factor: None, rows_needed: None });
    }
    let suspected = suspected_factor(&foundation.data.value, &foundation.base, &weighing.keep)
        .filter(|suspected| !accept && !explained_better(foundation, weighing, suspected));
    suspected.map(|SuspectedFactor { factor, fitted, .. }| Refusal {
        reason: "unit_suspected".to_owned(),
        factor: Some(factor),
        fitted_factor: Some(fitted),
        rows_needed: None,
    })
}

/// Whether causes leave a fifth less than what the factor leaves: then the rows are in the right unit. A wrong unit that
/// causes imitate leaves as little with the factor as with them.
fn explained_better(foundation: &Foundation<'_>, weighing: &Weighing<'_>, suspected: &SuspectedFactor) -> bool {
    let Some(set) = weighing.named_sets().next() else { return false };
    let Ok(with) = foundation.subject.predict(&set.settings) else { return false };
    let kept: Vec<usize> = (0..with.len()).filter(|&row| weighing.keep[row]).collect();
    let value = |row: usize| foundation.data.value[row];
    let mean = kept.iter().map(|&row| value(row)).sum::<f64>() / kept.len().max(1) as f64;
    let whole: f64 = kept.iter().map(|&row| (value(row) - mean).powi(2)).sum();
    let left: f64 = kept.iter().map(|&row| with[row].map_or(f64::INFINITY, |f| (value(row) - f).powi(2))).sum();
    left < 0.8 * (1.0 - suspected.explained) * whole
}

fn warnings(
    foundation: &Foundation<'_>,
    weighing: &Weighing<'_>,
    leave_out: bool,
    found: &super::outlier::Outliers,
    used: &[usize],
) -> Vec<Finding> {
    let mut warnings = Vec::new();
    let missing = foundation.predicted.iter().filter(|ok| !**ok).count();
    if missing > 0 {
        warnings.push(Finding::new("rows_not_predicted", "/measurements").with("count", missing));
    }
    if found.too_many {
        warnings.push(Finding::new("too_many_outliers", "/measurements").with("count", found.rows.len()));
    } else if leave_out && !found.rows.is_empty() {
        let rows: Vec<usize> = found.rows.iter().map(|&row| used[row] + 1).collect();
        warnings.push(Finding::new("outliers_left_out", "/measurements").with("count", rows.len()).with("rows", rows));
    }
    if let NoiseSource::Stated { scatter_factor } = weighing.noise.source
        && !(0.5..=2.0).contains(&scatter_factor)
    {
        warnings.push(Finding::new("scatter_unlike_stated", "/measurements").value(scatter_factor, "1"));
    }
    warnings
}

fn row_columns<M: Diagnosable>(
    job: &JobOf<M>,
    used: &[usize],
    foundation: &Foundation<'_>,
    weighing: &Weighing<'_>,
    extended: Option<&[crate::calculator::Prediction]>,
) -> RowColumns {
    let rows = job.measurements.rows();
    let place = |index: usize| match &foundation.data.layout.design.smooth {
        Smooth::Along(u) => Some(u[index]),
        Smooth::Around(angle) => Some(angle[index] / (2.0 * std::f64::consts::PI)),
        Smooth::None => None,
    };
    let base = |index: usize| foundation.predicted[index].then_some(foundation.base[index]);
    let all = 0..used.len();
    RowColumns {
        row: used.iter().map(|&row| row_number(row)).collect(),
        run: used.iter().map(|&row| rows[row].run()).collect(),
        place: all.clone().map(place).collect(),
        measured: foundation.data.value.clone(),
        base: all.clone().map(base).collect(),
        extended: all.map(|index| extended.map_or_else(|| base(index), |with| with[index].ok())).collect(),
        used: weighing.keep.clone(),
    }
}

/// Most important first: the verdict, then the gain.
fn explanation<E: utoipa::ToSchema, R: utoipa::ToSchema>(
    output: &DiagnosisResult<E, R>,
    quantity: &str,
) -> Vec<Message> {
    let kinds = |causes: &[NamedCause]| causes.iter().map(|cause| cause.kind.clone()).collect::<Vec<_>>();
    let mut said = vec![match output.verdict {
        VerdictClass::Adequate if output.none_probability < 0.5 => {
            let hint = output.causes.first().map_or_else(String::new, |cause| cause.kind.clone());
            Message::new("diagnosis_adequate_with_hint")
                .with("probability_none", output.none_probability)
                .with("cause", hint)
        }
        VerdictClass::Adequate => Message::new("diagnosis_adequate").with("probability_none", output.none_probability),
        VerdictClass::Named => Message::new("diagnosis_named")
            .with("causes", kinds(&output.named))
            .with("probability", output.sets.first().map_or(0.0, |set| set.posterior)),
        VerdictClass::Confounded => {
            let sets: Vec<String> = output.likely_sets.iter().map(|set| kinds(&set.causes).join(" + ")).collect();
            Message::new("diagnosis_confounded").with("sets", sets).with("limit_sigmas", CONFOUNDED_BELOW)
        }
        VerdictClass::Unknown => Message::new("diagnosis_unknown")
            .with("probability", output.unnamed_probability)
            .with("rms", output.remainder.as_ref().map_or(0.0, |remainder| remainder.rms))
            .with("kind", output.remainder.as_ref().map_or_else(String::new, |remainder| remainder.kind.clone()))
            .with("named", kinds(&output.named)),
        VerdictClass::Refused => match &output.refusal {
            Some(Refusal { factor: Some(factor), fitted_factor: Some(fitted), .. }) => {
                Message::new("diagnosis_unit_suspected").with("factor", *factor).with("fitted", *fitted)
            }
            _ => Message::new("diagnosis_base_fails"),
        },
    }];
    if let Some(next) = &output.next_measurement {
        said.push(
            Message::new("diagnosis_next")
                .with("changes", next.changes.clone())
                .with("leader", next.leader.clone())
                .with("rival", next.rival.clone())
                .with("now", next.separation_now_sigmas)
                .with("then", next.separation_then_sigmas),
        );
    }
    if let Some(gain) = &output.gain {
        said.push(
            Message::new("diagnosis_gain")
                .with("base", gain.rmse_base)
                .with("extended", gain.rmse_extended)
                .with("ceiling", gain.noise_ceiling)
                .with("quantity", quantity.to_owned()),
        );
    }
    said
}

fn basis() -> Vec<Basis> {
    vec![
        Basis { equation: "diagnosis/3.1", source: "scatter: stated, from repeats, or restricted maximum likelihood" },
        Basis { equation: "diagnosis/3.2", source: "scatter and allowances as one covariance" },
        Basis { equation: "diagnosis/3.4", source: "evidence of linear Gaussian hypotheses, Laplace at the optimum" },
        Basis { equation: "diagnosis/3.5", source: "weights of causes, of nothing, and of an unnamed remainder" },
    ]
}
