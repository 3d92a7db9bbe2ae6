//! The diagnosis as a calculator over any base that can be diagnosed.

use std::collections::BTreeSet;
use std::marker::PhantomData;

use super::answer::{picture, report, said};
use super::base::Bound;
use super::input::{DiagnosisJob, MAX_RUNS};
use crate::calculator::{
    Answer, Calculator, CalculatorKind, Check, Codes, Cost, Design, Diagnosable, Failure, Figure, Finding,
    ForwardModel, Hallmark, MeasuredRow, Measurement, Message, Meta, Monitor, PrepareError, Reading, Rows, Table,
    Violations,
};
use crate::diagnosis::answer::output::DiagnosisResult;
use crate::diagnosis::model::known::Known;
use crate::diagnosis::rows::copies::{copies, digits_written};
use crate::diagnosis::rows::data::{Data, Layout};
use crate::effects::{JointUncertainty, has_parameter};

/// Rows from which on at least adequacy can be judged.
pub(super) const LEAST_ROWS: usize = 8;

/// Where predictions are dear, what is made of them with a part of the rows held back after the other, and without, relative to
/// `M::PREDICTIONS`: measured on eight vises and four rings.
const WITH_FOLDS: f64 = 1.3;
const WITHOUT_FOLDS: f64 = 0.6;

/// The diagnosis of one base.
#[derive(Debug, Clone, Copy)]
pub struct Diagnosis<M>(PhantomData<M>);

/// The answer of a diagnosis of `M`.
pub type ResultOf<M> = DiagnosisResult<<M as ForwardModel>::Effect, <M as ForwardModel>::Run>;

/// The job of a diagnosis of `M`.
pub type JobOf<M> = DiagnosisJob<
    <M as ForwardModel>::Job,
    <M as ForwardModel>::Run,
    <M as Diagnosable>::Row,
    <M as ForwardModel>::Allowances,
>;

impl<M: Diagnosable> Calculator for Diagnosis<M> {
    type Input = JobOf<M>;
    type Output = DiagnosisResult<M::Effect, M::Run>;

    const META: Meta = Meta {
        id: "diagnosis",
        kind: CalculatorKind::Calculator,
        version: 25,
        title: "Diagnosis",
        question: "What does the simulation get wrong, why, and what is gained by mending it?",
        summary: "Measurements of what was really cut against a calculator's job: whether anything is wrong beyond \
                  scatter and allowances, which named causes explain it and how surely, what these data cannot tell \
                  apart, the base model extended by the causes, and what that gains on data held back. It never \
                  forces a name.",
        references: &[
            "Kennedy, O'Hagan, Bayesian calibration of computer models, J. R. Stat. Soc. B 63 (2001) 425-464",
            "Brun, Reichert, Kuensch, Practical identifiability analysis of large environmental simulation models, Water Resour. Res. 37 (2001) 1015-1030",
        ],
        examples: M::DIAGNOSES,
        hallmarks: &[Hallmark::Count("/measurements"), Hallmark::Of("/quantity"), Hallmark::Count("/runs")],
        study_outputs: &["/none_probability", "/unnamed_probability"],
        codes: CODES,
        figures: picture::FIGURE_IDS,
        tables: picture::TABLE_IDS,
        program: None,
    };

    fn fill(job: &mut Self::Input) {
        M::fill(&mut job.job);
    }

    fn cost(job: &Self::Input) -> Cost {
        let rows = job.measurements.rows();
        let used = rows.iter().filter(|row| !row.excluded() && row.value(&job.quantity).is_some());
        let runs: BTreeSet<u32> = used.map(Measurement::run).collect();
        let folds = if job.options.held_out { M::folds(rows.len(), runs.len()) } else { 0 };
        let (statistics, bytes) = statistics(rows.len(), runs.len().max(1), 1 + folds);
        let share = if job.options.held_out { WITH_FOLDS } else { WITHOUT_FOLDS };
        let predictions = M::predict_all_ms(&job.job, job.runs.len(), rows.len()) * M::PREDICTIONS * share;
        let driver = if predictions > statistics { "/job" } else { "/measurements" };
        Cost { ms: statistics + predictions, bytes, driver }
    }

    fn run(job: &Self::Input, monitor: &dyn Monitor) -> Result<Answer<Self::Output>, Failure> {
        with_measured::<M, _>(job, monitor, |measured, bound, data| {
            report::answer::<M>(job, measured, bound, data, monitor)
        })
    }

    fn figures(job: &Self::Input, output: &Self::Output) -> Vec<Figure> {
        picture::figures::<M>(&job.quantity, output)
    }

    fn tables(_job: &Self::Input, output: &Self::Output) -> Vec<Table> {
        picture::tables(output)
    }
}

/// Time of weighing so many rows of so many runs so often, ms, and the memory that it holds.
///
/// Measured with 18 causes of a shaft, 1 to 500 runs of 7 to 1000 rows: every weighing reads all rows and fits every run by
/// itself, and factors the allowances, some of which every run has for itself. What comes after the weighings, above all
/// the next run, takes the time of two more weighings and of ten more factors; sets that are refined about the model itself, and
/// blunders that are looked for, take that of one more and 25 ms. Memory is that of the rows, of the allowances
/// as columns of all rows, and of their factors.
fn statistics(rows: usize, runs: usize, weighings: usize) -> (f64, u64) {
    let (n, r, often) = (rows as f64, runs as f64, weighings as f64);
    let ms = 25.0 + 0.08 * n * (often + 1.0) + r * (often + 2.0) + 2.6e-6 * r.powi(3) * (often + 10.0);
    let (n, r) = (rows as u64, runs as u64);
    (ms, 1_000_000 + 5000 * n + 30 * n * r + 300 * r * r)
}

/// The base of a diagnosis: a job without effects, and those that it had.
pub(super) fn base_of<M: Diagnosable>(job: &JobOf<M>) -> (M::Job, Known<M::Effect>) {
    let known = Known { effects: M::own_effects(&job.job).to_vec(), unsure: unsure::<M>(job) };
    (M::without_effects(&job.job), known)
}

/// Hands the base model, bound to its rows, and what was measured there to who needs them.
pub(super) fn with_measured<M: Diagnosable, T>(
    job: &JobOf<M>,
    monitor: &dyn Monitor,
    then: impl FnOnce(&Measured<M::Run, M::Point>, &Bound<'_, M>, &Data) -> Result<T, Failure>,
) -> Result<T, Failure> {
    let rows = job.measurements.rows();
    let of_row = |row: usize| {
        let readings = if rows[row].excluded() { Vec::new() } else { rows[row].readings(&job.job, &job.quantity) };
        readings.into_iter().map(move |reading| (row, reading))
    };
    let all: Vec<(usize, Reading<M::Point>)> = (0..rows.len()).flat_map(of_row).collect();
    let (base, known) = base_of::<M>(job);
    let (mut measured, mut prepared, mut data) = laid_out::<M>(job, &base, &all, monitor)?;
    let runs = &measured.places.runs;
    let raw: Vec<f64> = all.iter().map(|(_, reading)| reading.value).collect();
    let relative = |(digit, value): (f64, &f64)| if is_logarithmic::<M>(job) { digit / value.abs() } else { digit };
    let digits: Vec<f64> = digits_written(&raw).into_iter().zip(&raw).map(relative).collect();
    let copies = copies(&data, &digits, |a, b| runs[a] == runs[b]);
    if !copies.is_empty() {
        let once: Vec<(usize, Reading<M::Point>)> = (0..all.len())
            .filter(|index| copies.binary_search(index).is_err())
            .map(|index| all[index].clone())
            .collect();
        (measured, prepared, data) = laid_out::<M>(job, &base, &once, monitor)?;
        measured.copies = copies.into_iter().map(|index| all[index].0).collect();
    }
    let allowances = job.allowances.clone();
    let bound = Bound::<M>::new(prepared, known, allowances, &job.quantity, &job.options, monitor)?;
    then(&measured, &bound, &data)
}

/// Readings, each with its row, before the base model.
#[allow(clippy::type_complexity, reason = "three parts that are made together")]
fn laid_out<M: Diagnosable>(
    job: &JobOf<M>,
    base: &M::Job,
    readings: &[(usize, Reading<M::Point>)],
    monitor: &dyn Monitor,
) -> Result<(Measured<M::Run, M::Point>, M::Prepared, Data), Failure> {
    let rows = job.measurements.rows();
    let used: Vec<usize> = readings.iter().map(|(row, _)| *row).collect();
    let runs = if job.runs.is_empty() { vec![M::Run::default()] } else { job.runs.clone() };
    let run_of = |row: usize| rows[row].run() as usize - 1;
    let points = readings.iter().map(|(row, reading)| (run_of(*row), reading.point.clone())).collect();
    let places: Rows<M::Run, M::Point> = Rows { runs, points };
    let prepared = M::prepare(base, &places, &job.quantity, monitor).map_err(|error| unprepared(error, &used))?;
    let design = M::design(&prepared);
    let raw: Vec<f64> = readings.iter().map(|(_, reading)| reading.value).collect();
    let data = match M::spreads(&prepared, &job.allowances) {
        None => data::<M>(job, &used, raw, design),
        spreads => Data {
            value: vec![0.0; raw.len()],
            uncertainty: spreads,
            sides: Some(raw),
            layout: layout(job.measurements.rows(), &used, design),
        },
    };
    let seen = readings.iter().map(|(_, reading)| Seen { class: reading.class, asks: reading.asks }).collect();
    Ok((Measured { places, used, seen, copies: Vec::new() }, prepared, data))
}

/// Everything that a diagnosis may utter.
const CODES: Codes = Codes {
    faults: &[FAULT_CODES],
    failures: &[FAULT_CODES],
    warnings: &[said::WARNING_CODES],
    explanations: &[said::EXPLANATION_CODES],
    stages: &[report::STAGE_CODES],
    labels: &[picture::LABEL_CODES],
};

/// Faults of a diagnosis beside those of the base's own job.
pub(super) const FAULT_CODES: &[&str] = &[
    "too_few_measurements",
    "unknown_run",
    "unknown_quantity",
    "unknown_cause",
    "unknown_condition",
    "unknown_parameter",
    "range_reversed",
    "duplicate_items",
];

/// The first reason; a row by its number in the job, where rows without a value count, too.
fn unprepared(error: PrepareError, used: &[usize]) -> Failure {
    let findings = match error {
        PrepareError::Failed(failure) => return failure,
        PrepareError::Invalid(findings) => findings,
    };
    let Some(mut finding) = findings.into_iter().next() else {
        return Failure::Internal("rows without a reason".to_owned());
    };
    let parts = finding.pointer.strip_prefix("/measurements/").and_then(|rest| rest.split_once('/'));
    let row = parts.and_then(|(row, field)| Some((used.get(row.parse::<usize>().ok()?)?, field)));
    if let Some((row, field)) = row {
        finding.pointer = format!("/measurements/{row}/{field}");
    }
    Failure::OutOfModel(finding)
}

/// What was measured, reading by reading.
pub(super) struct Measured<R, P> {
    /// Runs and places.
    pub(super) places: Rows<R, P>,
    /// Number of the row of every reading.
    pub(super) used: Vec<usize>,
    /// What was seen of classes.
    pub(super) seen: Vec<Seen>,
    /// Rows that are not used, as they copy an earlier one.
    pub(super) copies: Vec<usize>,
}

/// A class, and the margin that a reading of it is about; both empty where values were measured.
pub(super) struct Seen {
    pub(super) class: &'static str,
    pub(super) asks: &'static str,
}

/// Whether residuals are taken of the logarithm of what was measured.
fn is_logarithmic<M: Diagnosable>(job: &JobOf<M>) -> bool {
    M::QUANTITIES.iter().any(|known| known.name == job.quantity && known.logarithmic)
}

/// Rows that have a value.
fn data<M: Diagnosable>(job: &JobOf<M>, used: &[usize], raw: Vec<f64>, design: Design) -> Data {
    let rows = job.measurements.rows();
    let logarithmic = is_logarithmic::<M>(job);
    let stated: Option<Vec<f64>> = used.iter().map(|&row| rows[row].uncertainty_of(&job.quantity)).collect();
    let uncertainty = stated.filter(|_| !used.is_empty()).map(|stated| {
        let relative = |(u, value): (f64, &f64)| if logarithmic { u / value.abs() } else { u };
        stated.into_iter().zip(&raw).map(relative).collect()
    });
    let value = raw.into_iter().map(|y| if logarithmic { y.max(f64::MIN_POSITIVE).ln() } else { y }).collect();
    Data { value, uncertainty, sides: None, layout: layout(job.measurements.rows(), used, design) }
}

/// Sweep by sweep.
pub(crate) fn layout<W: Measurement>(rows: &[W], used: &[usize], design: Design) -> Layout {
    let mut sweeps: Vec<((u32, u32), Vec<usize>)> = Vec::new();
    for (index, &row) in used.iter().enumerate() {
        let id = (rows[row].run(), rows[row].trace());
        match sweeps.iter_mut().find(|(of, _)| *of == id) {
            Some((_, members)) => members.push(index),
            None => sweeps.push((id, vec![index])),
        }
    }
    // By number, so that the order of the sweeps among the rows changes nothing.
    sweeps.sort_by_key(|(id, _)| *id);
    Layout {
        run_of_trace: sweeps.iter().map(|((run, _), _)| *run as usize - 1).collect(),
        traces: sweeps.into_iter().map(|(_, members)| members).collect(),
        design,
    }
}

impl<J, R, W, A> Check for DiagnosisJob<J, R, W, A>
where
    J: Check + utoipa::ToSchema,
    R: utoipa::ToSchema,
    W: MeasuredRow + Measurement<Model: ForwardModel<Job = J, Run = R>>,
    A: utoipa::ToSchema,
{
    fn check(&self, violations: &mut Violations) {
        let mut of_base = Violations::default();
        self.job.check(&mut of_base);
        for finding in of_base.into_vec() {
            violations.add(finding.under("/job"));
        }
        check_rows(self, violations);
        check_uncertainty(self, violations);
        check_places(self, violations);
    }
}

/// Rules between the fields of a diagnosis that hold for every base.
fn check_rows<J, R, W, A>(job: &DiagnosisJob<J, R, W, A>, violations: &mut Violations)
where
    J: utoipa::ToSchema,
    R: utoipa::ToSchema,
    W: MeasuredRow + Measurement,
    A: utoipa::ToSchema,
{
    let (quantities, causes) = (W::Model::QUANTITIES, W::Model::CAUSES);
    let known: Vec<&'static str> = quantities.iter().map(|quantity| quantity.name).collect();
    violations.require(known.contains(&job.quantity.as_str()), || {
        Finding::new("unknown_quantity", "/quantity")
            .with("quantity", job.quantity.clone())
            .with("known", known.clone())
    });
    let rows = job.measurements.rows();
    let runs = job.runs.len().max(1);
    for (index, row) in rows.iter().enumerate() {
        violations.require((1..=runs.min(MAX_RUNS)).contains(&(row.run() as usize)), || {
            Finding::new("unknown_run", format!("/measurements/{index}/run"))
                .measured(f64::from(row.run()), runs as f64, "1")
                .with("run", f64::from(row.run()))
        });
    }
    let used = rows.iter().filter(|row| !row.excluded() && row.value(&job.quantity).is_some()).count();
    violations.require(used >= LEAST_ROWS, || {
        Finding::new("too_few_measurements", "/measurements")
            .measured(used as f64, LEAST_ROWS as f64, "1")
            .with("quantity", job.quantity.clone())
    });
    let options = &job.options;
    let asked_for = options.causes.iter().flatten().enumerate().map(|(i, kind)| (format!("/options/causes/{i}"), kind));
    let weighed = options.prior_weights.iter().enumerate();
    let weighed = weighed.map(|(i, weight)| (format!("/options/prior_weights/{i}/kind"), &weight.kind));
    for (pointer, kind) in asked_for.chain(weighed) {
        violations.require(causes.iter().any(|cause| cause.kind == kind), || {
            let known: Vec<&'static str> = causes.iter().map(|cause| cause.kind).collect();
            Finding::new("unknown_cause", pointer).with("kind", kind.clone()).with("known", known)
        });
    }
    let mut kinds: Vec<&str> = options.prior_weights.iter().map(|weight| weight.kind.as_str()).collect();
    let mut conditions: Vec<&str> = options.ranges.iter().map(|range| range.condition.as_str()).collect();
    // Of two for one name only the first could count.
    for (field, names) in [("prior_weights", &mut kinds), ("ranges", &mut conditions)] {
        names.sort_unstable();
        violations.require(names.windows(2).all(|pair| pair[0] != pair[1]), || {
            Finding::new("duplicate_items", format!("/options/{field}"))
        });
    }
    for (index, range) in options.ranges.iter().enumerate() {
        let conditions = W::Model::CONDITIONS;
        violations.require(conditions.contains(&range.condition.as_str()), || {
            Finding::new("unknown_condition", format!("/options/ranges/{index}/condition"))
                .with("condition", range.condition.clone())
                .with("known", conditions.to_vec())
        });
        violations.require(range.to > range.from, || {
            Finding::new("range_reversed", format!("/options/ranges/{index}/to"))
                .measured(range.to, range.from, "1")
                .with("name", range.condition.clone())
        });
    }
}

/// What is not known of the effects of the base: as the diagnosis says, and as the base job does.
fn unsure<M: Diagnosable>(job: &JobOf<M>) -> Vec<JointUncertainty> {
    job.effects_uncertainty.iter().chain(M::open_effects(&job.job)).cloned().collect()
}

/// Refuses an uncertainty of an effect, or of a parameter, that the base does not have.
fn check_uncertainty<J, R, W, A>(job: &DiagnosisJob<J, R, W, A>, violations: &mut Violations)
where
    J: utoipa::ToSchema,
    R: utoipa::ToSchema,
    W: MeasuredRow + Measurement<Model: ForwardModel<Job = J, Run = R>>,
    A: utoipa::ToSchema,
{
    let effects = W::Model::own_effects(&job.job);
    for (index, entry) in job.effects_uncertainty.iter().enumerate() {
        for (number, unsure) in entry.moves.iter().enumerate() {
            let effect = (unsure.effect as usize).checked_sub(1).and_then(|index| effects.get(index));
            violations.require(effect.is_some_and(|effect| has_parameter(effect, &unsure.parameter)), || {
                Finding::new("unknown_parameter", format!("/effects_uncertainty/{index}/moves/{number}"))
                    .with("effect", f64::from(unsure.effect))
                    .with("parameter", unsure.parameter.clone())
                    .with("count", effects.len())
            });
        }
    }
}

/// Faults of single rows that are used and of single runs, as the base tells them.
fn check_places<J, R, W, A>(job: &DiagnosisJob<J, R, W, A>, violations: &mut Violations)
where
    J: utoipa::ToSchema,
    R: utoipa::ToSchema,
    W: MeasuredRow + Measurement<Model: ForwardModel<Job = J, Run = R>>,
    A: utoipa::ToSchema,
{
    let rows = job.measurements.rows().iter().enumerate();
    for (index, row) in rows.filter(|(_, row)| !row.excluded() && row.value(&job.quantity).is_some()) {
        for fault in W::Model::faults_of_point(&job.job, &row.point()) {
            violations.add(fault.under(&format!("/measurements/{index}")));
        }
    }
    for (index, run) in job.runs.iter().enumerate() {
        for fault in W::Model::faults_of_run(run) {
            violations.add(fault.under(&format!("/runs/{index}")));
        }
    }
}

/// What a diagnosis is doing.
pub(super) fn stage(monitor: &dyn Monitor, fraction: f64, code: &'static str) {
    monitor.progress(fraction, Message::new(code));
}

#[cfg(test)]
mod tests {
    use super::statistics;

    /// Rows, runs, weighings; time, ms, and memory, MB, of shafts with 18 causes on one core of 2026.
    const MEASURED: [(usize, usize, usize, f64, f64); 9] = [
        (400, 10, 11, 344.0, 6.0),
        (3000, 3, 4, 652.0, 20.0),
        (750, 50, 51, 4204.0, 10.0),
        (5000, 50, 51, 15_931.0, 37.0),
        (1000, 100, 101, 20_978.0, 14.0),
        (6000, 150, 151, 66_989.0, 62.0),
        (2000, 200, 201, 72_796.0, 32.0),
        (12_000, 300, 1, 2166.0, 162.0),
        (20_000, 500, 1, 6241.0, 375.0),
    ];

    #[test]
    fn estimates_are_near_what_was_measured() {
        for (rows, runs, weighings, ms, mb) in MEASURED {
            let (of_time, of_memory) = statistics(rows, runs, weighings);
            assert!((0.5..2.0).contains(&(of_time / ms)), "{rows} rows, {runs} runs: {of_time} ms");
            assert!((0.5..2.0).contains(&(of_memory as f64 / 1e6 / mb)), "{rows} rows, {runs} runs: {of_memory} bytes");
        }
    }
}
