//! Parameters from tables of amplitude against depth: the source paper's two tables, and tables made with known ones.
#![allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, missing_docs)]

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::fixture_support::{outcome, reference};
use precut_calc::calculator::{
    Answer, Calculator, Check, Failure, Figure, Item, Message, Monitor, Unwatched, Value as Said, Violations,
};
use precut_calc::fixture_stability::Regeneration;
use precut_calc::fixture_stability::identification::{
    FixtureIdentification, IdentificationJob, IdentificationOutcome, IdentifiedParameter,
};
use serde_json::{Value, json};

fn example(id: &str) -> Value {
    let example = FixtureIdentification::META.examples.iter().find(|e| e.id == id).unwrap();
    serde_json::from_str(example.job).unwrap()
}

fn checked(job: &Value) -> Result<IdentificationJob, Vec<(String, String)>> {
    let mut job: IdentificationJob = serde_json::from_value(job.clone()).unwrap_or_else(|e| panic!("{e}: {job}"));
    let mut violations = Violations::default();
    job.check(&mut violations);
    let faults = violations.into_vec();
    if faults.is_empty() {
        FixtureIdentification::fill(&mut job);
        return Ok(job);
    }
    Err(faults.into_iter().map(|f| (f.code.to_owned(), f.pointer)).collect())
}

fn solve(job: &Value) -> Answer<IdentificationOutcome> {
    let job = checked(job).unwrap_or_else(|faults| panic!("{faults:?}"));
    FixtureIdentification::run(&job, &Unwatched).unwrap()
}

/// Amplitude in um of a cut in the vise of [`table`], by the calculator.
fn cut(rpm: f64, depth: f64, law: &str) -> f64 {
    let joint = |c: f64, l: f64| json!({ "stiffness_n_per_mm": c, "damping_n_s_per_mm": l });
    let got = outcome(&json!({
        "cutter": { "diameter_mm": 80, "teeth": 6 },
        "force": { "coefficient": 2000, "chip_thickness_exponent": 0.2 },
        "cut": { "width_mm": 40, "depth_mm": depth, "spindle_speed_rpm": rpm, "feed_mm_per_tooth": 0.1 },
        "fixture": {
            "kind": "self_locking", "workpiece_mass_kg": 4,
            "movable_joint": joint(12_000.0, 0.4), "fixed_joint": joint(28_000.0, 0.8),
        },
        "simulation": { "regeneration": law },
    }));
    if got.multiplier.modulus < 1.0 {
        got.forced.peak_to_peak_um
    } else {
        got.simulation.as_ref().unwrap().peak_to_peak_um
    }
}

/// The truth of [`cut`]: C1 + C2, and 1000 (lambda1 + lambda2)/(2 sqrt(1000 (C1 + C2) m)).
const STIFFNESS: f64 = 40_000.0;
const RATIO: f64 = 0.047_434;

/// A table made with a known vise, read to the micrometre.
fn table(law: &str) -> Value {
    let mut job = example("stiffness_and_damping");
    // Coarser than the truth, which is made with 80 steps to an oscillation: a percent or two in chatter.
    job["simulation"] = json!({ "tooth_periods": 60, "steady_tooth_periods": 20, "steps_per_oscillation": 32 });
    job["search"] = json!({ "members": 8, "generations": 6 });
    for row in job["measurements"].as_array_mut().unwrap() {
        let of = |name: &str| row[name].as_f64().unwrap();
        row["amplitude_um"] = json!(cut(of("spindle_speed_rpm"), of("depth_mm"), law).round());
    }
    job
}

/// The same without the rows just above both onsets, whose oscillations take hundreds of teeth to grow: what remains has five
/// stable rows and three that chatter.
fn short(mut job: Value) -> Value {
    let rows = job["measurements"].as_array_mut().unwrap();
    let slow = |row: &Value, rpm: u32, depth: f64| row["spindle_speed_rpm"] == rpm && row["depth_mm"] == depth;
    rows.retain(|row| !slow(row, 400, 3.5) && row["depth_mm"] != 4 || slow(row, 400, 4.0));
    assert_eq!(rows.len(), 8);
    job
}

fn parameter<'a>(got: &'a IdentificationOutcome, name: &str) -> &'a IdentifiedParameter {
    got.parameters.iter().find(|p| p.name == name).unwrap()
}

#[test]
fn a_table_gives_back_the_vise_that_made_it() {
    let got = solve(&table("multiple")).output;
    // Stable rows are read to the micrometre: 13 um to 4 %, ten rows together to 2 %; the rest is the search's.
    let (stiffness, ratio) = (parameter(&got, "stiffness_n_per_mm"), parameter(&got, "damping_ratio"));
    assert!((stiffness.value / STIFFNESS - 1.0).abs() < 0.02, "{stiffness:?}");
    assert!((ratio.value / RATIO - 1.0).abs() < 0.05, "{ratio:?}");
    for (parameter, truth) in [(stiffness, STIFFNESS), (ratio, RATIO)] {
        assert!(parameter.lower <= truth && truth <= parameter.upper && !parameter.at_bound, "{parameter:?} {truth}");
        assert!(parameter.standard_error.unwrap() < 0.05 * parameter.value, "{parameter:?}");
    }
    assert!(got.onsets.iter().all(|onset| onset.within), "{:?}", got.onsets);
    // What a job of fixture stability says of the parameters is what the rows say.
    let mut job = json!({
        "cutter": { "diameter_mm": 80, "teeth": 6 }, "force": got.identified.force, "fixture": got.identified.fixture,
        "cut": { "width_mm": 40, "depth_mm": 3, "spindle_speed_rpm": 400, "feed_mm_per_tooth": 0.1 },
    });
    job["fixture"].as_object_mut().unwrap().remove("clamp_force_n");
    let again = outcome(&job).forced.peak_to_peak_um;
    assert!((got.rows[2].simulated_um / again - 1.0).abs() < 1e-9, "{again} {:?}", got.rows[2]);
}

#[test]
fn scattered_readings_are_met_to_their_scatter() {
    let answer = solve(&example("stiffness_and_damping"));
    let got = &answer.output;
    let stiffness = parameter(got, "stiffness_n_per_mm");
    assert!(stiffness.lower <= STIFFNESS && STIFFNESS <= stiffness.upper, "{stiffness:?}");
    // Ten residuals of unit scatter: the sum of their squares stays below 25 in 99.5 of 100 tables.
    assert!(got.fit.objective < 25.0 && got.fit.rows == 10, "{:?}", got.fit);
    let clamp = got.clamp_force.as_ref().unwrap();
    assert!(clamp.most_n.is_none() && clamp.consistent && clamp.least_n > 0.0, "{clamp:?}");
    let stated = clamp.contradicted_by_stated.as_ref().unwrap();
    // 5000 N serve the rows that ask for less.
    let asked = |row: usize| got.rows[row - 1].clamp_fixed_n.max(got.rows[row - 1].clamp_movable_n);
    assert!((1..=10).all(|row| stated.contains(&row) == (asked(row) > 5000.0)), "{clamp:?}");
    assert!(answer.explanation.iter().any(|m| m.code == "identification_clamp_above"));
    combinations_are_as_well_known_as_they_are_said_to_be(&answer);
}

/// What is said of a combination is what the standard errors and their correlations make of the words.
fn combinations_are_as_well_known_as_they_are_said_to_be(answer: &Answer<IdentificationOutcome>) {
    let got = &answer.output;
    let relative = |i: usize| got.parameters[i].standard_error.unwrap() / got.parameters[i].value;
    let covariance = |i: usize, j: usize| {
        let names = [&got.parameters[i].name, &got.parameters[j].name];
        let of = |pair: &&precut_calc::fixture_stability::identification::ParameterPair| {
            [&pair.first, &pair.second] == names || [&pair.second, &pair.first] == names
        };
        let correlation = if i == j { 1.0 } else { got.correlations.iter().find(of).unwrap().correlation };
        correlation * relative(i) * relative(j)
    };
    for (code, named) in [("identification_known_best", 2), ("identification_known_least", 2)] {
        let message = answer.explanation.iter().find(|said| said.code == code).unwrap();
        let said = ["names", "powers", "share"].map(|name| message.values.get(name));
        let [Some(Said::List(names)), Some(Said::List(powers)), Some(Said::Number(share))] = said else {
            panic!("{message:?}")
        };
        let factors = names.iter().zip(powers).map(|factor| {
            let (Said::Text(name), Said::Number(power)) = factor else { panic!("{message:?}") };
            (got.parameters.iter().position(|p| p.name == *name).unwrap(), *power)
        });
        let powers: Vec<(usize, f64)> = factors.collect();
        let terms = powers.iter().flat_map(|(i, p)| powers.iter().map(move |(j, q)| p * q * covariance(*i, *j)));
        let square: f64 = terms.sum();
        // Errors that nearly cancel: the share's own digits are what is left of them.
        assert!((square.sqrt() / share - 1.0).abs() < 1e-6, "{message:?}: {}", square.sqrt());
        assert_eq!(powers.len(), named, "{message:?}");
    }
}

/// Every curve says whose it is: no two of a picture are called the same where the table has several numbers of teeth.
#[test]
fn curves_of_several_cutters_are_told_apart() {
    let job = checked(&example("paper_screw_vise")).unwrap();
    let outcome = FixtureIdentification::run(&job, &Unwatched).unwrap().output;
    for figure in FixtureIdentification::figures(&job, &outcome) {
        let mut words = Vec::new();
        for item in &figure.panels[0].items {
            let (Item::Line { name, .. } | Item::Points { name, .. }) = item else { panic!("{item:?}") };
            match figure.title.values.get(name) {
                Some(Said::List(parts)) => words.push(format!("{parts:?}")),
                _ => assert!(["table_opened", "table_exact"].contains(name), "{}: {name}", figure.id),
            }
        }
        let count = words.len();
        for teeth in [8.0, 12.0, 16.0] {
            let told = format!("{:?}", Said::List(vec!["teeth".into(), teeth.into(), "1".into()]));
            assert_eq!(words.iter().filter(|said| said.contains(&told)).count(), count / 3, "{told}: {words:?}");
        }
        words.sort_unstable();
        words.dedup();
        assert_eq!((words.len(), count), (count, if figure.id == "ratio" { 3 } else { 9 }), "{words:?}");
    }
    // One cutter at one speed needs no number.
    let mut single = example("paper_screw_vise");
    single["measurements"].as_array_mut().unwrap().retain(|row| row["teeth"] == 8);
    let job = checked(&single).unwrap();
    let outcome = FixtureIdentification::run(&job, &Unwatched).unwrap().output;
    for figure in FixtureIdentification::figures(&job, &outcome) {
        assert!(figure.title.values.is_empty(), "{:?}", figure.title);
    }
}

#[test]
fn both_laws_of_regeneration_are_told_apart() {
    for (law, other) in [(Regeneration::Single, "multiple"), (Regeneration::Multiple, "single")] {
        let mut job = short(table(law.name()));
        job["regenerations"] = json!([other, law.name()]);
        let got = solve(&job).output;
        assert_eq!(got.regeneration, law);
        assert_eq!((got.hypotheses[0].regeneration, got.hypotheses[0].worse_by), (law, 0.0));
        assert!(got.hypotheses[1].worse_by > 6.0, "{:?}", got.hypotheses[1].fit);
    }
}

/// Half of peak to peak with the stiffness known is half the amplitude: the table tells.
#[test]
fn the_meaning_of_an_amplitude_is_told_from_the_others() {
    let mut job = table("multiple");
    for row in job["measurements"].as_array_mut().unwrap() {
        row["amplitude_um"] = json!(0.5 * row["amplitude_um"].as_f64().unwrap());
    }
    job["amplitudes"] = json!(["peak_to_peak", "half_peak_to_peak", "largest_displacement"]);
    job["fixture"]["movable_joint"] = json!({ "stiffness_n_per_mm": 12_000, "damping_n_s_per_mm": 0.4 });
    job["fixture"]["fixed_joint"] = json!({ "stiffness_n_per_mm": 28_000, "damping_n_s_per_mm": 0.8 });
    job["unknowns"] = json!({});
    let got = solve(&job).output;
    let names: Vec<&str> = got.hypotheses.iter().map(|h| h.amplitude.name()).collect();
    assert_eq!(names[0], "half_peak_to_peak", "{names:?}");
    let of = |name: &str| &got.hypotheses.iter().find(|h| h.amplitude.name() == name).unwrap().simulated_um;
    for (half, whole) in of("half_peak_to_peak").iter().zip(of("peak_to_peak")) {
        assert!((whole - 2.0 * half).abs() < 1e-9);
    }
}

#[test]
fn what_a_table_cannot_see_is_said() {
    // With natural frequency and damping ratio free every amplitude and every onset is a function of force over stiffness.
    let mut job = short(table("multiple"));
    job["unknowns"] = json!({
        "stiffness_n_per_mm": [20_000, 80_000], "force_coefficient": [1000, 4000],
        "natural_frequency_hz": [450, 550], "damping_ratio": [0.03, 0.08],
    });
    let answer = solve(&job);
    let got = &answer.output;
    for name in ["stiffness_n_per_mm", "force_coefficient"] {
        let parameter = parameter(got, name);
        assert!(parameter.standard_error.is_none(), "{parameter:?}");
        let at = format!("/unknowns/{name}");
        assert!(answer.warnings.iter().any(|w| w.code == "identification_not_fixed" && w.pointer == at), "{name}");
    }
    assert!(parameter(got, "damping_ratio").standard_error.is_some());
    // What cannot be seen is their product.
    let (unseen, known) = (got.combinations.last().unwrap(), &got.combinations[0]);
    let ends: Vec<f64> = got.parameters.iter().zip(&unseen.powers).map(|(_, power)| power.abs()).collect();
    let half = 0.5_f64.sqrt();
    assert!(unseen.standard_deviation.is_none() && known.standard_deviation.unwrap() < 0.05, "{:?}", got.combinations);
    assert!(ends.iter().filter(|power| (*power - half).abs() < 1e-3).count() == 2, "{ends:?}");
}

/// Fit of the reference's set at its own step: 0.134 and 0.216; with the step refined near the jumps 0.165 and 0.231.
#[test]
fn the_papers_tables_are_predicted_with_their_differences() {
    for (id, name, rms) in [("paper_screw_vise", "table1_type1", 0.17), ("paper_pneumatic_vise", "table2_type2", 0.24)]
    {
        let answer = solve(&example(id));
        let got = &answer.output;
        let want = reference("identified.json")[name]["rows"].as_array().unwrap().clone();
        assert_eq!(got.rows.len(), want.len());
        for (row, want) in got.rows.iter().zip(&want) {
            assert_eq!(
                (f64::from(row.teeth), Some(row.depth_mm)),
                (want["z"].as_f64().unwrap(), want["depth_mm"].as_f64())
            );
            let fine = 1e3 * want["single_delay_p2p_fine_mm"].as_f64().unwrap();
            // Rounded to 0.1 um; in chatter the reference's own step leaves some percent, and 160 periods just above the
            // onset do not see it grow out.
            let within = if row.modulus < 0.97 { 0.06 + 2e-3 * fine } else { 0.25 * fine };
            assert!((row.simulated_um - fine).abs() < within, "{name} {row:?}, reference {fine}");
            assert!(row.simulated_error_um <= 0.02 * row.simulated_um, "{row:?}");
        }
        assert_eq!(
            (got.regeneration, got.fit.rows),
            (Regeneration::Single, if id == "paper_screw_vise" { 25 } else { 24 })
        );
        assert!(got.fit.rms_log < rms && got.fit.median_log < 0.12, "{:?}", got.fit);
        assert!(got.onsets.len() == 3 && got.onsets.iter().all(|onset| onset.within), "{:?}", got.onsets);
        assert!(got.parameters.is_empty() && got.evaluations == 2);
        let clamp = got.clamp_force.as_ref().unwrap();
        if id == "paper_pneumatic_vise" {
            // 5.10 .. 5.21 kN with the step refined to convergence.
            assert!((clamp.least_n / 5100.0 - 1.0).abs() < 0.01, "{clamp:?}");
            assert!((clamp.most_n.unwrap() / 5210.0 - 1.0).abs() < 0.01 && clamp.consistent, "{clamp:?}");
        } else {
            // Row 20 (12 teeth, 4.5 mm) jumps to the larger motion, row 21 opens below what it asks for.
            assert!(!clamp.consistent && !clamp.contradicted_rows.is_empty(), "{clamp:?}");
            assert!(answer.warnings.iter().any(|w| w.code == "identification_clamp_contradicted"));
        }
    }
}

#[test]
fn a_measured_peak_force_fixes_the_coefficient() {
    let mut job = example("paper_screw_vise");
    job["force"]["coefficient"] = json!(1);
    job["peak_force"] = json!({ "force_n": 500, "depth_mm": 3, "teeth": 8, "feed_mm_per_tooth": 0.039 });
    job["regenerations"] = json!(["single"]);
    let got = solve(&job).output;
    // 1186 printed to four digits, and 499.9 N.
    assert!((got.identified.force.coefficient / 1186.0 - 1.0).abs() < 1e-3, "{:?}", got.identified.force);
}

fn faults(change: impl Fn(&mut Value)) -> Vec<(String, String)> {
    let mut job = example("stiffness_and_damping");
    change(&mut job);
    checked(&job).unwrap_err()
}

#[test]
fn faults_are_named_all_at_once() {
    let found = faults(|job| {
        job["cutter"] = json!({ "diameter_mm": 80 });
        job["cut"]["offset_mm"] = json!(70);
        job["cut"]["feed_mm_per_min"] = json!(100);
        job["fixture"]["kind"] = json!("self_locking");
        job["measurements"] = json!([
            { "depth_mm": 1, "amplitude_um": 13 }, { "depth_mm": 2, "teeth": 6, "spindle_speed_rpm": 400 },
        ]);
        job["peak_force"] = json!({ "force_n": 500, "depth_mm": 3, "teeth": 8, "feed_mm_per_tooth": 0.039 });
        job["unknowns"] = json!({
            "mass_kg": [1, 10], "natural_frequency_hz": [900, 200], "damping_n_s_per_mm": [0.1, 1],
            "damping_ratio": [0.01, 0.2], "jaw_mass_kg": [1, 2], "movable_stiffness_share": [0.1, 0.9],
            "force_coefficient": [100, 1000],
        });
        job["regenerations"] = json!(["single", "single"]);
        job["amplitudes"] = json!(["peak_to_peak", "peak_to_peak"]);
        job["simulation"] = json!({ "tooth_periods": 40, "steady_tooth_periods": 50 });
    });
    for (code, pointer) in [
        ("strip_misses_cutter", "/cut/offset_mm"),
        ("feed_given_twice", "/cut/feed_mm_per_min"),
        ("teeth_missing", "/measurements/0/teeth"),
        ("row_speed_missing", "/measurements/0/spindle_speed_rpm"),
        ("row_without_value", "/measurements/1/amplitude_um"),
        ("range_reversed", "/unknowns/natural_frequency_hz"),
        ("unknowns_exclude_each_other", "/unknowns/natural_frequency_hz"),
        ("unknowns_exclude_each_other", "/unknowns/damping_ratio"),
        ("unknown_without_influence", "/unknowns/jaw_mass_kg"),
        ("unknown_without_influence", "/unknowns/movable_stiffness_share"),
        ("unknown_stated_elsewhere", "/unknowns/force_coefficient"),
        ("too_few_rows", "/measurements"),
        ("listed_twice", "/regenerations/1"),
        ("listed_twice", "/amplitudes/1"),
        ("steady_beyond_run", "/simulation/steady_tooth_periods"),
    ] {
        assert!(found.contains(&(code.to_owned(), pointer.to_owned())), "{code} at {pointer}: {found:?}");
    }
    assert_eq!(found.len(), 15, "{found:?}");
    let found = faults(|job| {
        job["cut"].as_object_mut().unwrap().remove("feed_mm_per_tooth");
        job["unknowns"] = json!({ "spindle_speed_rpm": [100, 1000] });
    });
    assert!(
        found.contains(&("row_feed_missing".to_owned(), "/measurements/0/feed_mm_per_tooth".to_owned())),
        "{found:?}"
    );
    assert!(found.contains(&("unknown_stated_elsewhere".to_owned(), "/unknowns/spindle_speed_rpm".to_owned())));
}

/// Hears a search, and cancels it after so many looks.
#[derive(Default)]
struct Watch {
    heard: Mutex<Vec<(f64, &'static str)>>,
    pictures: Mutex<Vec<&'static str>>,
    looks: AtomicUsize,
    cancel_after: Option<usize>,
}

impl Monitor for Watch {
    fn cancelled(&self) -> bool {
        self.cancel_after.is_some_and(|most| self.looks.fetch_add(1, Ordering::Relaxed) >= most)
    }
    fn progress(&self, fraction: f64, stage: Message) {
        self.heard.lock().unwrap().push((fraction, stage.code));
    }
    fn interim(&self, figure: Figure) {
        self.pictures.lock().unwrap().push(figure.id);
    }
}

#[test]
fn a_search_tells_how_far_it_is_and_can_be_cancelled() {
    let mut job = short(example("stiffness_and_damping"));
    job["simulation"] = json!({ "tooth_periods": 60, "steady_tooth_periods": 20, "steps_per_oscillation": 32 });
    job["search"] = json!({ "members": 8, "generations": 3 });
    let job = checked(&job).unwrap();
    let watch = Watch::default();
    let first = FixtureIdentification::run(&job, &watch).unwrap();
    let heard = watch.heard.into_inner().unwrap();
    assert!(heard.is_sorted_by(|a, b| a.0 <= b.0) && heard.last().unwrap().0 == 1.0, "{heard:?}");
    for stage in ["stage_identification_first", "stage_identification_search", "stage_identification_certainty"] {
        assert!(heard.iter().any(|(_, code)| *code == stage), "{stage}");
    }
    assert_eq!(watch.pictures.into_inner().unwrap(), ["amplitude"]);
    // Whatever the threads: the same bits.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(pool.install(|| FixtureIdentification::run(&job, &Watch::default())).unwrap(), first);
    let counting = Watch { cancel_after: Some(usize::MAX), ..Watch::default() };
    FixtureIdentification::run(&job, &counting).unwrap();
    let all = counting.looks.into_inner();
    assert!(all > 100, "{all}");
    for looks in [0, 1, 20, all / 2, all * 9 / 10] {
        let watch = Watch { cancel_after: Some(looks), ..Watch::default() };
        assert_eq!(FixtureIdentification::run(&job, &watch), Err(Failure::Cancelled), "{looks}");
    }
}
