//! From the statistics to the answer: the verdict in the words of the contract, and every step behind it.

use crate::calculator::{
    Answer, Diagnosable, Failure, Hypothesis, Inapplicability, KnownOver, Measurement, Message, Monitor, Prediction,
    Quantity, Smooth, ToldEffects, Value,
};
use crate::diagnosis::answer::blunder::blunders;
use crate::diagnosis::answer::classes;
use crate::diagnosis::answer::output::{
    CausePair, DiagnosisResult, GainReport, NamedCause, NoiseReport, NotApplicable, PlaceRange, RecognisedReport,
    RemainderReport, RowColumns, StepReport, TestReport, VerdictClass,
};
use crate::diagnosis::answer::refuse::{most_causes, of_blunders, refusal};
use crate::diagnosis::answer::said::{basis, doubts, explanation, hinted, nearest, warnings};
use crate::diagnosis::answer::view::View;
use crate::diagnosis::base::Bound;
use crate::diagnosis::calculator::{JobOf, Measured, ResultOf, stage};
use crate::diagnosis::causes::subject::{Setting, Subject};
use crate::diagnosis::input::DiagnosisOptions;
use crate::diagnosis::model::downstream::{downstream, good_parts};
use crate::diagnosis::model::extension::{Extension, ExtensionKind};
use crate::diagnosis::model::gain::{Gain, gain};
use crate::diagnosis::model::next::{NextMeasurement, next_measurement};
use crate::diagnosis::rows::data::Data;
use crate::diagnosis::rows::noise::{NoiseSource, between_sweeps};
use crate::diagnosis::verdict::adequacy::Test;
use crate::diagnosis::verdict::effort::Effort;
use crate::diagnosis::verdict::foundation::Foundation;
use crate::diagnosis::verdict::identify::{CONFOUNDED_BELOW, twins};
use crate::diagnosis::verdict::judge::Verdict;
use crate::diagnosis::verdict::remainder::{RemainderShape, remainder_shape};
use crate::diagnosis::verdict::weigh::Weighing;

/// Probability of nothing from which on an adequate base leaves no reason to look for blunders.
const QUIET: f64 = 0.5;
/// The kind of what was found without a name, and stored.
const REMAINDER: &str = "remainder";
/// Sets that are listed.
const LISTED_SETS: usize = 20;

pub(in crate::diagnosis) const STAGE_CODES: &[&str] =
    &["diagnosis_stage_signatures", "diagnosis_stage_search", "diagnosis_stage_gain", "stage_done"];

/// The whole answer.
pub(in crate::diagnosis) fn answer<M: Diagnosable>(
    job: &JobOf<M>,
    measured: &Measured<M::Run, M::Point>,
    bound: &Bound<'_, M>,
    data: &Data,
    monitor: &dyn Monitor,
) -> Result<Answer<ResultOf<M>>, Failure> {
    let Measured { places, used, copies, .. } = measured;
    stage(monitor, 0.05, "diagnosis_stage_signatures");
    let mut foundation = Foundation::of(bound, data, monitor)?;
    let found = foundation.outliers(monitor)?;
    let keep = foundation.heed(&found, job.options.leave_outliers_out);
    stage(monitor, 0.2, "diagnosis_stage_search");
    let [effort, fold_effort] = efforts(&job.options, used.len(), bound);
    let mut weighing = Weighing::of(&foundation, keep, effort, monitor)?;
    let quantity = quantity::<M>(job)?;
    let mut refusal = refusal::<M>(job, &foundation, &weighing);
    let is_quiet = weighing.none >= QUIET && matches!(weighing.verdict, Verdict::Adequate);
    let blunders = if refusal.is_some() || is_quiet || bound.is_dear() {
        Vec::new()
    } else {
        blunders::<M>(job, measured, &weighing, quantity, fold_effort, monitor)?
    };
    if !job.options.accept_suspected_unit {
        refusal = refusal.or_else(|| of_blunders(&blunders));
        weighing.doubt(blunders.iter().map(|blunder| blunder.probability).sum());
    }
    let seed = u64::from(job.options.seed);
    let gain = if job.options.held_out && refusal.is_none() {
        stage(monitor, 0.5, "diagnosis_stage_gain");
        gain(&foundation, &weighing, fold_effort, true, monitor)?
    } else {
        None
    };
    let next = if refusal.is_none() { next_measurement::<M>(job, places, &weighing, monitor)? } else { None };
    let contenders = Contenders::of(next.as_ref(), bound.hypotheses());
    let view = View::of(bound.hypotheses(), &weighing, refusal.is_none(), bound.is_dear(), monitor)?;
    let named = if refusal.is_some() { Vec::new() } else { view.named() };
    let leading = view.leading().filter(|_| !named.is_empty());
    // Of classes the error on what was held back is no square.
    let tried = gain.as_ref().filter(|_| data.sides.is_none());
    let extension = if refusal.is_none() { Extension::of(&weighing, leading, tried)? } else { Extension::none() };
    let believed = &extension.believed;
    let effects = bound.effects_of(believed)?;
    let term = effects.last().filter(|_| extension.kind == ExtensionKind::Remainder);
    let is_extended = extension.kind != ExtensionKind::None;
    let extended = Extended {
        prediction: is_extended.then(|| bound.believing(believed)).transpose()?,
        deviation: if is_extended { extension.deviation(&weighing)? } else { None },
    };
    let is_decided = matches!(view.class(), VerdictClass::Named | VerdictClass::Confounded);
    let effects_uncertainty = extension.open(&weighing, |believed| bound.effects_of(believed))?;
    let (downstream, good_parts) = if is_decided || extension.kind == ExtensionKind::Remainder {
        let told = ToldEffects { effects: &effects, open: &effects_uncertainty };
        let downstream = downstream(job, &places.runs, bound, &weighing, &extension, monitor)?;
        (downstream, good_parts(job, &places.runs, bound, &weighing, &extension, &told, monitor)?)
    } else {
        (Vec::new(), None)
    };
    let (contributions, collinearity) =
        if refusal.is_none() { view.contributions(job.options.negligible_below)? } else { (Vec::new(), None) };
    let mut warnings = warnings(&job.options, &weighing, &found, (used, copies), refusal.is_none(), gain.is_some());
    let (signatures, separations) = view.signatures()?;
    let with = extended.prediction.as_deref();
    let classes =
        classes::report(bound, &weighing, measured, with, &believed.settings, gain.as_ref(), (seed, monitor))?;
    // Of classes a root mean square means nothing.
    let gain = gain.filter(|_| classes.is_none());
    let output = DiagnosisResult {
        verdict: if refusal.is_some() { VerdictClass::Refused } else { view.class() },
        named,
        likely_sets: if refusal.is_some() { Vec::new() } else { view.likely_sets() },
        none_probability: weighing.none,
        unnamed_probability: weighing.unnamed,
        blunders,
        contributions,
        collinearity,
        noise: noise_report(&weighing),
        tests: test_reports(&weighing, job.options.level),
        sets: weighing.sets.iter().take(LISTED_SETS).map(|set| view.set_report(set, gain.as_ref())).collect(),
        causes: view.causes(),
        not_applicable: not_applicable(bound, &weighing),
        twins: pairs(twins(&weighing), &view),
        separations,
        signatures,
        profiles: view.profiles(),
        remainder: unnamed_remainder::<M>(&weighing, term, used),
        recognised: if refusal.is_none() { recognised(&weighing)? } else { None },
        extension: extension.kind,
        effects,
        effects_uncertainty,
        gain: gain.as_ref().map(gain_report),
        classes,
        downstream,
        good_parts,
        next_measurement: next.map(|next| view.next_report(next)),
        rows: row_columns::<M>(job, used, &foundation, &weighing, &extended),
        outlying_runs: view.outlying(gain.as_ref()),
        outliers: found.rows.iter().map(|&row| row_number(used[row])).collect(),
        refusal,
    };
    if output.refusal.is_none() {
        warnings.extend(doubts(&output, quantity));
    }
    let explanation = explanation(&output, quantity);
    let explanation =
        explanation.into_iter().map(|message| in_particular(message, &output, &contenders, quantity)).collect();
    stage(monitor, 1.0, "stage_done");
    Ok(Answer { output, warnings, explanation, basis: basis() })
}

/// The quantity that a checked job names.
fn quantity<M: Diagnosable>(job: &JobOf<M>) -> Result<&'static Quantity, Failure> {
    let named = M::QUANTITIES.iter().find(|known| known.name == job.quantity);
    named.ok_or_else(|| Failure::Internal(format!("{} is no quantity", job.quantity)))
}

/// How far is searched over all rows, and in every fold.
fn efforts<M: Diagnosable>(options: &DiagnosisOptions, rows: usize, bound: &Bound<'_, M>) -> [Effort; 2] {
    let most_causes = most_causes(usize::from(options.most_causes), rows);
    let in_fold = if bound.is_dear() { Effort::dear_fold(most_causes) } else { Effort::fold(most_causes) };
    [bound.effort(most_causes), in_fold].map(|effort| Effort { level: options.level, ..effort })
}

/// Labels of the causes that a next measurement parts.
#[derive(Default)]
struct Contenders {
    leader: Vec<String>,
    rival: Vec<String>,
}

impl Contenders {
    fn of<R>(next: Option<&NextMeasurement<R>>, hypotheses: &[Hypothesis]) -> Self {
        let labels = |members: &[usize]| members.iter().map(|&member| hypotheses[member].label.clone()).collect();
        next.map_or_else(Self::default, |next| Self { leader: labels(&next.leader), rival: labels(&next.rival) })
    }
}

/// A sentence that also says which cause of its kind is meant, as several waves or batches may act at once, and in
/// which unit its numbers are.
fn in_particular<E: utoipa::ToSchema, R: utoipa::ToSchema>(
    message: Message,
    output: &DiagnosisResult<E, R>,
    contenders: &Contenders,
    quantity: &Quantity,
) -> Message {
    let labels = |causes: &[NamedCause]| causes.iter().map(|cause| cause.label.clone()).collect::<Vec<_>>();
    match message.code {
        "diagnosis_next" => {
            message.with("leader_labels", contenders.leader.clone()).with("rival_labels", contenders.rival.clone())
        }
        "diagnosis_unknown" => message
            .with("labels", labels(&output.named))
            // What is left of logarithms is a share.
            .with("unit", if quantity.logarithmic { "" } else { quantity.unit }),
        "diagnosis_objected" => {
            message.with("labels", nearest(output).map_or_else(Vec::new, |set| labels(&set.causes)))
        }
        "diagnosis_confounded" => {
            let said: &[Value] = match message.values.get("sets") {
                Some(Value::List(sets)) => sets,
                _ => &[],
            };
            let kinds = |causes: &[NamedCause]| causes.iter().map(|cause| cause.kind.clone()).collect::<Vec<_>>();
            let own = output.likely_sets.iter().filter(|set| said.contains(&Value::from(kinds(&set.causes))));
            let own: Vec<Vec<String>> = own.take(said.len()).map(|set| labels(&set.causes)).collect();
            message.with("labels", own)
        }
        "diagnosis_negligible" => {
            let small = output.contributions.iter().filter(|contribution| contribution.negligible);
            message.with("labels", small.map(|contribution| contribution.label.clone()).collect::<Vec<_>>())
        }
        "diagnosis_adequate_with_hint" => {
            message.with("label", hinted(output).map_or_else(String::new, |cause| cause.label.clone()))
        }
        _ => message,
    }
}

/// The extended model on the rows, where there is one.
struct Extended {
    prediction: Option<Vec<Prediction>>,
    /// Standard deviation of a row about it.
    deviation: Option<Vec<f64>>,
}

/// What is left without a name, where the verdict is that something is.
fn unnamed_remainder<M: Diagnosable>(
    weighing: &Weighing<'_>,
    term: Option<&M::Effect>,
    used: &[usize],
) -> Option<RemainderReport> {
    let shape = matches!(weighing.verdict, Verdict::Unknown(_)).then(|| remainder_shape(weighing)).flatten()?;
    let range = |known: KnownOver| PlaceRange {
        field: known.field.to_owned(),
        unit: known.unit.to_owned(),
        from: known.from,
        to: known.to,
    };
    let known_between = term.map_or_else(Vec::new, M::known_over).into_iter().map(range).collect();
    Some(RemainderReport { known_between, ..remainder_report(shape, used) })
}

/// Whether rows show a remainder that the base holds: without it they would lie farther from the base than scatter and
/// allowances explain.
fn recognised(weighing: &Weighing<'_>) -> Result<Option<RecognisedReport>, Failure> {
    let subject = weighing.foundation.subject;
    let held = subject.hypotheses().iter().enumerate().filter_map(|(hypothesis, own)| {
        let held = own.held.as_ref().filter(|_| own.cause.kind == REMAINDER)?;
        let gone = Setting { hypothesis, values: held.values.iter().map(|value| -value).collect() };
        Some((own.label.as_str(), gone))
    });
    let each = held.map(|(label, gone)| shown_again(weighing, label, gone)).collect::<Result<Vec<_>, Failure>>()?;
    // Of several the one that shows most.
    Ok(each.into_iter().flatten().max_by(|a, b| a.sigmas.total_cmp(&b.sigmas)))
}

/// The same of one of them, `gone` being what takes it away.
fn shown_again(weighing: &Weighing<'_>, label: &str, gone: Setting) -> Result<Option<RecognisedReport>, Failure> {
    let foundation = weighing.foundation;
    let without = foundation.subject.predict(&[gone])?;
    let left: Vec<f64> = without
        .iter()
        .zip(&foundation.data.value)
        .zip(&foundation.residual)
        .map(|((without, value), residual)| without.map_or(*residual, |without| value - without))
        .collect();
    let misfit = |left: &[f64]| {
        let white = weighing.whitener.white(left);
        white.inner(&white)
    };
    let rms = |left: &[f64]| {
        let (sum, count) = (0..left.len())
            .filter(|&row| weighing.keep[row])
            .fold((0.0, 0.0), |(sum, count), row| (sum + left[row] * left[row], count + 1.0));
        f64::sqrt(sum / f64::max(count, 1.0))
    };
    let sigmas = (misfit(&left) - misfit(&foundation.residual)).max(0.0).sqrt();
    Ok((sigmas > CONFOUNDED_BELOW).then(|| RecognisedReport {
        label: label.to_owned(),
        error_without: rms(&left),
        error_with: rms(&foundation.residual),
        sigmas,
    }))
}

/// Pairs of causes by their kinds.
fn pairs(pairs: Vec<(usize, usize)>, view: &View<'_>) -> Vec<CausePair> {
    pairs.into_iter().map(|(a, b)| CausePair { a: view.kind(a).to_owned(), b: view.kind(b).to_owned() }).collect()
}

fn remainder_report(shape: RemainderShape, used: &[usize]) -> RemainderReport {
    let (orders, amplitudes) = shape.spectrum.into_iter().unzip();
    RemainderReport {
        kind: shape.kind.to_owned(),
        over: shape.over,
        rms: shape.rms,
        known_between: Vec::new(),
        largest_at_row: row_number(used[shape.extreme_row]),
        value: shape.value,
        standard_deviation: shape.deviation,
        orders,
        amplitudes,
        explained_share: shape.explained,
        step: shape.step.map(|step| StepReport {
            place: step.place,
            size: step.size,
            log_likelihood: step.log_likelihood,
        }),
        proportional_to_base: shape.with_base.map(|(slope, _)| slope),
        proportional_to_base_deviation: shape.with_base.map(|(_, deviation)| deviation),
    }
}

fn row_number(row: usize) -> u32 {
    u32::try_from(row + 1).unwrap_or(u32::MAX)
}

fn test_reports(weighing: &Weighing<'_>, level: f64) -> Vec<TestReport> {
    let report = |test: Test| TestReport {
        test: test.kind.name().to_owned(),
        statistic: test.statistic,
        p: test.p,
        p_holm: test.p_holm,
        rejects: test.p_holm < level,
    };
    weighing.tests.iter().copied().map(report).collect()
}

fn noise_report(weighing: &Weighing<'_>) -> NoiseReport {
    let (noise, foundation) = (&weighing.noise, weighing.foundation);
    let between = between_sweeps(foundation.data, &foundation.residual, &weighing.keep);
    let (source, scatter_factor) = match noise.source {
        NoiseSource::Stated { scatter_factor } => ("stated", Some(scatter_factor)),
        NoiseSource::Scaled { scatter_factor } => ("scaled", Some(scatter_factor)),
        NoiseSource::Repeats => ("repeats", None),
        NoiseSource::Profile => ("profile", None),
        NoiseSource::Regression => ("regression", None),
        NoiseSource::Spread => ("spread", None),
    };
    NoiseReport {
        standard_deviation: noise.sigma,
        correlation: noise.rho,
        degrees_of_freedom: noise.dof.is_finite().then_some(noise.dof),
        source: source.to_owned(),
        scatter_factor,
        between_sweeps: between.map(|(sigma, _)| sigma),
        between_sweeps_degrees_of_freedom: between.map(|(_, dof)| dof),
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

fn not_applicable<M: Diagnosable>(bound: &Bound<'_, M>, weighing: &Weighing<'_>) -> Vec<NotApplicable> {
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

fn row_columns<M: Diagnosable>(
    job: &JobOf<M>,
    used: &[usize],
    foundation: &Foundation<'_>,
    weighing: &Weighing<'_>,
    extended: &Extended,
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
        measured: foundation.data.sides.as_ref().unwrap_or(&foundation.data.value).clone(),
        base: all.clone().map(base).collect(),
        extended: all
            .clone()
            .map(|index| extended.prediction.as_ref().map_or_else(|| base(index), |with| with[index].ok()))
            .collect(),
        extended_deviation: all.map(|index| extended.deviation.as_ref().map(|deviation| deviation[index])).collect(),
        used: weighing.keep.clone(),
    }
}
