//! Blind trials of the diagnosis of any calculator: effects hidden by a generator that shares no code with it.
//!
//! The tests of a calculator state how many are drawn from which seed and what the score must reach, two binomial standard
//! deviations below the goal. Every one of them takes other numbers from the environment:
//!
//! - `PRECUT_TRIALS`: how many;
//! - `PRECUT_TRIAL_SEED`: from which seed;
//! - `PRECUT_TRIAL_GAIN=1`: the gain on data held back, too, which takes many times as long;
//! - `PRECUT_TRIAL_SNR`: at which ratio of signal to noise;
//! - `PRECUT_TRIAL_APART=1`: how far hidden causes stand from the others also where that takes as long as a diagnosis, and
//!   whether an observer finds them who knows what every cause would look like;
//! - `PRECUT_TRIAL_TALK=1`: what every answer says;
//! - `PRECUT_TRIAL_SCATTER=normal`, `rounded` or `correlated`: how single rows of shafts and cuts scatter.
//!
//! The draws that stand in the tests are kept with their confusion matrices in `tests/trials`: a change that moves an answer is
//! seen there. `PRECUT_WRITE_TRIALS=1` writes them anew.
//!
//! `PRECUT_TRIALS=300 PRECUT_TRIAL_SEED=12345 cargo test --release -p precut-calc-tests diagnosis_trials -- --nocapture`

#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::fmt::Write;
use std::path::Path;

use precut_calc::calculator::{Calculator, Check, Diagnosable, Measurement, Unwatched, Violations};
use precut_calc::diagnosis::{
    Diagnosis, JobOf, NamedCause, ParameterReport, ResultOf, SetReport, VerdictClass, residuals_with, separation_from,
    separations_of,
};
use precut_trials::score::{HeldOut, Said, Score, Share};
use precut_trials::{Class, Hidden, Scatter, Trial, deflection, machinability};
use serde_json::{Value, json};

/// Draws trial number `seed` of a class at a ratio of signal to noise.
pub(crate) type Draw = fn(Class, f64, u64) -> Trial;

/// Whether an observer who knows what every cause would look like finds the one cause of a draw.
pub(crate) type Ideal = fn(f64, u64) -> bool;

/// What is hidden: how, how strongly, from which seed, and how many times.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Trials {
    /// Name of the file that keeps the score.
    pub(crate) name: &'static str,
    pub(crate) draw: Draw,
    pub(crate) ideal: Option<Ideal>,
    pub(crate) class: Class,
    pub(crate) snr: f64,
    pub(crate) seed: u64,
    pub(crate) count: u64,
}

/// The score of the diagnosis of `M` on so many draws; printed with its confusion matrix.
pub(crate) fn score<M: Diagnosable>(trials: Trials) -> Score {
    let Trials { name, draw, class, .. } = trials;
    let snr = number("PRECUT_TRIAL_SNR", trials.snr);
    let (seed, count) = (number("PRECUT_TRIAL_SEED", trials.seed), number("PRECUT_TRIALS", trials.count));
    let mut score = Score::default();
    for k in 0..count {
        let own_seed = seed_of(seed, k);
        let trial = draw(class, snr, own_seed);
        let ideal = trials
            .ideal
            .filter(|_| class == Class::One && asked_for("PRECUT_TRIAL_APART"))
            .map(|ideal| ideal(snr, own_seed));
        score.add(&trial.truth, &Said { ideal, ..answer::<M>(&trial) });
    }
    let text = format!("{}: {class:?}, signal to noise {snr}, {count} draws from seed {seed}\n{score}", M::META.id);
    println!("{text}");
    if (seed, count) == (trials.seed, trials.count)
        && !asked_for("PRECUT_TRIAL_GAIN")
        && !asked_for("PRECUT_TRIAL_APART")
        && scatter() == Scatter::Student
    {
        keep(name, &text);
    }
    score
}

/// Compares with the score that is kept under a name, or keeps this one.
fn keep(name: &str, text: &str) {
    let path =
        Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).join("tests/trials").join(name).with_extension("txt");
    if std::env::var_os("PRECUT_WRITE_TRIALS").is_some() {
        std::fs::write(&path, text).unwrap();
    }
    let kept = std::fs::read_to_string(&path).unwrap_or_default();
    assert_eq!(kept, text, "{} is another: see what moved, then PRECUT_WRITE_TRIALS=1", path.display());
}

/// Seed of the k-th draw of a series.
pub(crate) fn seed_of(series: u64, k: u64) -> u64 {
    series.wrapping_mul(1_000_003).wrapping_add(k)
}

/// How single rows scatter.
fn scatter() -> Scatter {
    match std::env::var("PRECUT_TRIAL_SCATTER").as_deref() {
        Ok("normal") => Scatter::Normal,
        Ok("rounded") => Scatter::Rounded,
        Ok("correlated") => Scatter::Correlated,
        _ => Scatter::Student,
    }
}

/// A shaft, whose rows scatter as asked for.
pub(crate) fn shaft(class: Class, snr: f64, seed: u64) -> Trial {
    deflection::draw_scattered(scatter(), class, snr, seed)
}

/// Cuts on levels.
pub(crate) fn cuts(class: Class, snr: f64, seed: u64) -> Trial {
    machinability::draw_scattered(scatter(), class, snr, seed)
}

/// Cuts as a workshop's records have them.
pub(crate) fn records(class: Class, snr: f64, seed: u64) -> Trial {
    machinability::draw_continuous_scattered(scatter(), class, snr, seed)
}

fn asked_for(name: &str) -> bool {
    std::env::var_os(name).is_some()
}

pub(crate) fn number<T: std::str::FromStr>(name: &str, default: T) -> T {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(default)
}

/// A request with these options, read and filled.
pub(crate) fn job<M: Diagnosable>(request: &Value, options: Value) -> JobOf<M> {
    let mut request = request.clone();
    request["options"] = options;
    let mut job: JobOf<M> = serde_json::from_value(request).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    assert!(violations.is_empty(), "{:?}", violations.into_vec());
    Diagnosis::<M>::fill(&mut job);
    job
}

fn answer<M: Diagnosable>(trial: &Trial) -> Said {
    let job = job::<M>(&trial.request, json!({ "held_out": asked_for("PRECUT_TRIAL_GAIN") }));
    let result = Diagnosis::<M>::run(&job, &Unwatched).unwrap().output;
    let later = later::<M>(trial, &result);
    if asked_for("PRECUT_TRIAL_TALK") {
        println!("estimated {:.0} ms, {later:?}", Diagnosis::<M>::cost(&job).ms);
        talk::<M>(trial, &result);
    }
    let mut hidden: Vec<String> = trial.truth.causes.iter().map(|hidden| hidden.kind.to_owned()).collect();
    let mut named = kinds(&result.named);
    hidden.sort_unstable();
    named.sort_unstable();
    let is_other = result.verdict == VerdictClass::Named && named != hidden && !trial.truth.together.is_empty();
    let named_instead = is_other.then(|| separation_from::<M>(&job, &trial.truth.together, &result.named).unwrap());
    if let (Some(sigmas), true) = (named_instead, asked_for("PRECUT_TRIAL_TALK")) {
        println!("     named instead, {sigmas:.1} sigmas away");
    }
    let first = result.sets.iter().find(|set| !set.causes.is_empty() && !set.with_remainder);
    Said {
        verdict: result.verdict.name().to_owned(),
        named: kinds(&result.named),
        likely: result.likely_sets.iter().map(|set| kinds(&set.causes)).collect(),
        first: first.map_or_else(Vec::new, |set| kinds(&set.causes)),
        covered: covered(trial, &result.named),
        covered_shapes: covered_shapes(trial, &result.named),
        held_out: result.gain.as_ref().filter(|gain| gain.explained_share.is_some()).map(|gain| {
            let square = |rmse: f64| (rmse / trial.sigma).powi(2);
            let base = square(gain.rmse_base);
            HeldOut { explained: base - square(gain.rmse_extended), explainable: base - square(gain.noise_ceiling) }
        }),
        separations: separations::<M>(trial, &job),
        named_instead,
        ideal: None,
        later,
    }
}

/// What the extended model explains of rows that were measured afterwards.
fn later<M: Diagnosable>(trial: &Trial, result: &ResultOf<M>) -> Option<HeldOut> {
    let later = trial.later.as_ref()?;
    let job = job::<M>(&later.request, json!({ "held_out": false }));
    let square = |residuals: &[f64]| {
        residuals.iter().map(|r| r * r).sum::<f64>() / (residuals.len() as f64 * trial.sigma * trial.sigma)
    };
    let base = residuals_with::<M>(&job, &[]).unwrap();
    let extended = residuals_with::<M>(&job, &result.effects).unwrap();
    let logarithmic = M::QUANTITIES.iter().any(|known| known.name == job.quantity && known.logarithmic);
    let measured = job.measurements.rows().iter().map(|row| row.value(&job.quantity).unwrap());
    let measured = measured.map(|value| if logarithmic { value.ln() } else { value });
    let best: Vec<f64> = measured.zip(&later.best).map(|(measured, best)| measured - best).collect();
    let explainable = square(&base) - square(&best);
    Some(HeldOut { explained: square(&base) - square(&extended), explainable }).filter(|_| explainable > 0.0)
}

/// What is said of one hidden cause where the catalogue lacks it.
#[derive(Debug, Default)]
pub(crate) struct Mutated {
    pub(crate) adequate: usize,
    pub(crate) confounded: usize,
    pub(crate) unknown: usize,
    /// Of sets that are named in its place: how far the hidden cause stands from what they could make of the rows, sigmas.
    pub(crate) twins: Vec<f64>,
}

/// The same draws of one cause each with the entry of that cause taken out of the catalogue.
pub(crate) fn without_the_cause<M: Diagnosable>(trials: Trials) -> Mutated {
    let (seed, count) = (number("PRECUT_TRIAL_SEED", trials.seed), number("PRECUT_TRIALS", trials.count));
    let (mut mutated, mut text) = (Mutated::default(), String::new());
    for k in 0..count {
        let trial = (trials.draw)(Class::One, trials.snr, seed_of(seed, k));
        let hidden = &trial.truth.causes[0];
        let options = json!({ "held_out": false, "causes": all_but::<M>(hidden.kind) });
        let result = Diagnosis::<M>::run(&job::<M>(&trial.request, options), &Unwatched).unwrap().output;
        let mut said = result.verdict.name().to_owned();
        match said.as_str() {
            "adequate" => mutated.adequate += 1,
            "confounded" => mutated.confounded += 1,
            "unknown" => mutated.unknown += 1,
            _ => {
                let kinds = kinds(&result.named);
                let whole = job::<M>(&trial.request, json!({ "held_out": false }));
                let sigmas = separation_from::<M>(&whole, &hidden.signature, &result.named).unwrap();
                said = format!("{}, {sigmas:.1} sigmas away", kinds.join(" + "));
                mutated.twins.push(sigmas);
            }
        }
        writeln!(text, "{:<28}{said}", hidden.kind).unwrap();
    }
    println!("{}: without the hidden cause, {count} draws from seed {seed}\n{text}{mutated:?}", M::META.id);
    if (seed, count) == (trials.seed, trials.count) {
        keep(trials.name, &text);
    }
    mutated
}

/// What comes of measuring again after a model was stored.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Stored {
    /// Draws whose cause was named, and so could be stored; the others are not tried.
    pub(crate) tried: u64,
    /// Of these, how many are quiet over rows that were measured later under other conditions, nothing having changed.
    pub(crate) quiet: Share,
    /// How many name the cause that was stored where it has grown since.
    pub(crate) named: Share,
    /// Of those, how often the interval holds what acts now.
    pub(crate) covered: Share,
    /// How many name something else.
    pub(crate) wrong: u64,
}

/// One cause of this strength is found and stored, with what the rows leave open of it; then the same machine is measured
/// again, and once more as if the stored effect had been a share of what acts now.
pub(crate) fn after_a_model_was_stored<M: Diagnosable>(trials: Trials, share: f64) -> Stored {
    let (seed, count) = (number("PRECUT_TRIAL_SEED", trials.seed), number("PRECUT_TRIALS", trials.count));
    let (mut stored, mut text) = (Stored::default(), String::new());
    let diagnosed = |request: &Value| {
        Diagnosis::<M>::run(&job::<M>(request, json!({ "held_out": false })), &Unwatched).unwrap().output
    };
    for k in 0..count {
        let mut trial = (trials.draw)(trials.class, trials.snr, seed_of(seed, k));
        let first = diagnosed(&trial.request);
        let hidden: Vec<String> = trial.truth.causes.iter().map(|hidden| hidden.kind.to_owned()).collect();
        if first.verdict != VerdictClass::Named || kinds(&first.named) != hidden || first.effects.is_empty() {
            continue;
        }
        // A job that holds it must state what it depends on; the rows have their own.
        let needed = match hidden[0].as_str() {
            "wear_multiplicative" | "wear_force_additive" => Some(("flank_wear_mm", json!(0.0))),
            "batch_shift" => Some(("batch", json!("A"))),
            "tool_wear" => Some(("tool_path_at_start_m", json!(0.0))),
            "thermal_growth" => Some(("warm_time_at_start_min", json!(0.0))),
            _ => None,
        };
        if let Some((condition, value)) = needed {
            trial.request["job"]["conditions"][condition] = value.clone();
            if let Some(later) = &mut trial.later {
                later.request["job"]["conditions"][condition] = value;
            }
        }
        stored.tried += 1;
        let unsure = serde_json::to_value(&first.effects_uncertainty).unwrap();
        let mut said = Vec::new();
        if let Some(later) = &trial.later {
            let again = diagnosed(&with_effects(&later.request, &first.effects, &unsure));
            stored.quiet.add(again.verdict == VerdictClass::Adequate);
            said.push(format!("later {} {}", again.verdict.name(), kinds(&again.named).join(" + ")));
        }
        let mut before = serde_json::to_value(&first.effects).unwrap();
        let mut field = first.effects_uncertainty[0].moves.iter().map(|own| own.parameter.as_str());
        let field = field.find(|field| *field != "phase_rad").unwrap();
        let absent = if field == "factor" { 1.0 } else { 0.0 };
        let now = before[0][field].as_f64().unwrap();
        before[0][field] = json!(absent + share * (now - absent));
        let changed = diagnosed(&with_effects(&trial.request, &before, &unsure));
        let is_right = changed.verdict == VerdictClass::Named && kinds(&changed.named) == hidden;
        stored.named.add(is_right);
        if is_right {
            for held in covered(&trial, &changed.named) {
                stored.covered.add(held);
            }
            assert!(changed.named[0].parameters[0].was.is_some(), "{:?}", changed.named);
        } else if changed.verdict == VerdictClass::Named {
            stored.wrong += 1;
        }
        said.push(format!("grown {} {}", changed.verdict.name(), kinds(&changed.named).join(" + ")));
        writeln!(text, "{:<28}{}", hidden[0], said.join("; ")).unwrap();
    }
    println!("{}: after a model was stored, {count} draws from seed {seed}\n{text}{stored:?}", M::META.id);
    if (seed, count) == (trials.seed, trials.count) {
        keep(trials.name, &text);
    }
    stored
}

/// A request whose base holds these effects.
fn with_effects(request: &Value, effects: &impl serde::Serialize, unsure: &Value) -> Value {
    let mut request = request.clone();
    request["job"]["effects"] = serde_json::to_value(effects).unwrap();
    request["effects_uncertainty"] = unsure.clone();
    request
}

/// The kinds of the catalogue without one.
pub(crate) fn all_but<M: Diagnosable>(kind: &str) -> Vec<&'static str> {
    M::CAUSES.iter().map(|cause| cause.kind).filter(|known| *known != kind).collect()
}

impl Mutated {
    /// How many draws there were.
    pub(crate) fn drawn(&self) -> usize {
        self.adequate + self.confounded + self.unknown + self.twins.len()
    }

    /// Sets named in its place that these rows can tell from the hidden cause.
    pub(crate) fn forced(&self) -> usize {
        self.twins.iter().filter(|sigmas| **sigmas >= 4.0).count()
    }
}

/// How far every hidden cause stands from the others; nothing where rows are classes, or where nobody asks for what takes as
/// long as the diagnosis itself.
fn separations<M: Diagnosable>(trial: &Trial, job: &JobOf<M>) -> Vec<f64> {
    let is_dear = M::predict_ms(&job.job) > 0.0;
    let changes: Vec<(&str, &[f64])> = trial.truth.causes.iter().map(|h| (h.kind, h.signature.as_slice())).collect();
    if changes.iter().any(|(_, change)| change.is_empty()) || (is_dear && !asked_for("PRECUT_TRIAL_APART")) {
        return Vec::new();
    }
    separations_of::<M>(job, &changes).unwrap()
}

/// The parameter of a named cause that is the hidden size: the first that is none of the others.
fn sized<'n>(hidden: &Hidden, named: &'n NamedCause) -> Option<&'n ParameterReport> {
    named.parameters.iter().find(|own| !hidden.shapes.iter().any(|(other, _)| *other == own.name))
}

/// Whether the 95 % interval of the size of a named cause holds what was hidden, for every cause named right.
pub(crate) fn covered(trial: &Trial, named: &[NamedCause]) -> Vec<bool> {
    let of = |hidden: &Hidden| {
        let named = named.iter().find(|cause| cause.kind == hidden.kind)?;
        let [low, high] = sized(hidden, named)?.interval_95?;
        Some((low..=high).contains(&hidden.size))
    };
    trial.truth.causes.iter().filter_map(of).collect()
}

/// Whether the 95 % intervals of the other parameters of the causes named right hold what was hidden.
fn covered_shapes(trial: &Trial, named: &[NamedCause]) -> Vec<bool> {
    let of = |hidden: &Hidden| -> Vec<bool> {
        let Some(named) = named.iter().find(|cause| cause.kind == hidden.kind) else { return Vec::new() };
        let holds = |(name, truth): &(&str, f64)| {
            let [low, high] = named.parameters.iter().find(|parameter| parameter.name == *name)?.interval_95?;
            Some((low..=high).contains(truth))
        };
        hidden.shapes.iter().filter_map(holds).collect()
    };
    trial.truth.causes.iter().flat_map(of).collect()
}

fn kinds(causes: &[NamedCause]) -> Vec<String> {
    causes.iter().map(|cause| cause.kind.clone()).collect()
}

fn talk<M: Diagnosable>(trial: &Trial, result: &ResultOf<M>) {
    let each = |cause: &NamedCause| {
        let values: Vec<String> = cause.parameters.iter().map(|p| format!("{:.4}", p.value)).collect();
        format!("{} {} [{}]", cause.kind, cause.label, values.join(" "))
    };
    let causes = trial.truth.causes.iter().map(|hidden| format!("{} {:.5}", hidden.kind, hidden.size));
    println!(
        "truth [{}] sigma {:.4} found {:.4} -> {}",
        causes.collect::<Vec<String>>().join(", "),
        trial.sigma,
        result.noise.standard_deviation,
        result.verdict.name()
    );
    for test in result.tests.iter().filter(|test| test.rejects) {
        println!(
            "     {} rejects the base: {:.3} p {:.2e} Holm {:.2e}",
            test.test, test.statistic, test.p, test.p_holm
        );
    }
    let base = result.sets.iter().find(|set| set.causes.is_empty() && !set.with_remainder);
    println!("     lack of fit of the base {:?}", base.and_then(|base| base.lack_of_fit_p));
    for hidden in &trial.truth.causes {
        let Some(named) = result.named.iter().find(|cause| cause.kind == hidden.kind) else { continue };
        let Some(first) = sized(hidden, named) else { continue };
        println!("     {} hidden {:.5} fitted {:.5} in {:?}", hidden.kind, hidden.size, first.value, first.interval_95);
        for (name, truth) in &hidden.shapes {
            let own = named.parameters.iter().find(|parameter| parameter.name == *name).unwrap();
            println!(
                "     {name} {truth:.5} fitted {:.5} in {:?}, {:?}",
                own.value, own.interval_95, own.interval_from
            );
        }
    }
    let mut hidden: Vec<&str> = trial.truth.causes.iter().map(|hidden| hidden.kind).collect();
    hidden.sort_unstable();
    let is_truth = |set: &&SetReport| {
        let mut kinds = kinds(&set.causes);
        kinds.sort_unstable();
        !set.with_remainder && kinds == hidden
    };
    let beyond = result.sets.iter().skip(4).find(is_truth);
    for set in result.sets.iter().take(4).chain(beyond) {
        let rest = if set.with_remainder { "+rest" } else { "" };
        let names: Vec<String> = set.causes.iter().map(each).collect();
        println!("     {:.2e} {rest} {}", set.posterior, names.join(" + "));
    }
}
