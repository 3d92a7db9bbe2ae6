//! What must hold for any shaft: the command gives the drawing, mirrored jobs give mirrored answers, and so on.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use crate::support::{prepared, solved};
use precut_calc::calculator::{Answer, Calculator, Check, Finding, ForwardModel, Rows, Unwatched, Violations};
use precut_calc::deflection_compensation::{
    DeflectionCompensation, DeflectionPoint, DeflectionRun, Job, Outcome, StatusCompensated,
};
use proptest::prelude::*;
use serde_json::{Value, json};

/// A shaft of three segments in centres, with or without a one-sided rest and everything that can act.
#[derive(Debug, Clone)]
struct Case {
    lengths: [f64; 3],
    diameters: [f64; 3],
    depth: f64,
    springs: [f64; 3],
    rest: Option<(f64, f64)>,
    exponent: f64,
    all: bool,
    to_headstock: bool,
    timoshenko: bool,
    offset_um: f64,
}

fn case() -> impl Strategy<Value = Case> {
    (
        [100.0..400.0_f64, 100.0..400.0_f64, 100.0..400.0_f64],
        [20.0..60.0_f64, 20.0..60.0_f64, 20.0..60.0_f64],
        0.2..2.0_f64,
        [0.0..0.06_f64, 0.0..0.06_f64, 0.0..0.03_f64],
        proptest::option::of((0.2..0.8_f64, 0.0..30.0_f64)),
        0.5..1.1_f64,
        (any::<bool>(), any::<bool>(), any::<bool>()),
        -10.0..10.0_f64,
    )
        .prop_map(|(lengths, diameters, depth, springs, rest, exponent, flags, offset_um)| Case {
            lengths,
            diameters,
            depth,
            springs,
            rest,
            exponent,
            all: flags.0,
            to_headstock: flags.1,
            timoshenko: flags.2,
            offset_um,
        })
}

impl Case {
    fn length(&self) -> f64 {
        self.lengths.iter().sum()
    }

    /// The other end first, fed the other way.
    fn mirrored(&self) -> Self {
        let mut mirrored = self.clone();
        mirrored.lengths.reverse();
        mirrored.diameters.reverse();
        mirrored.springs.swap(0, 1);
        mirrored.rest = self.rest.map(|(share, gap)| (1.0 - share, gap));
        mirrored.to_headstock = !self.to_headstock;
        mirrored
    }

    fn job(&self) -> Value {
        let segments: Vec<Value> = self
            .lengths
            .iter()
            .zip(&self.diameters)
            .map(|(l, d)| json!({ "length_mm": l, "diameter_mm": d, "stock_diameter_mm": d + 2.0 * self.depth }))
            .collect();
        let length = self.length();
        let mut supports = vec![
            json!({ "kind": "centre", "z_mm": 0.0, "compliance_um_per_n": self.springs[0] }),
            json!({ "kind": "centre", "z_mm": length, "compliance_um_per_n": self.springs[1] }),
        ];
        if let Some((share, gap)) = self.rest {
            let rest = json!({ "kind": "steady_rest", "z_mm": share * length, "compliance_um_per_n": 0.02, "one_sided": true, "gap_um": gap });
            supports.insert(1, rest);
        }
        let stations: Vec<f64> = (0..=20).map(|k| (f64::from(k) / 20.0 * length).min(length)).collect();
        json!({
            "shaft": { "segments": segments, "youngs_modulus_n_per_mm2": 210_000.0,
                       "theory": if self.timoshenko { "timoshenko" } else { "euler_bernoulli" } },
            "supports": supports,
            "carriage": { "compliance_um_per_n": self.springs[2] },
            "force": {
                "kind": "power_law",
                "passive": { "coefficient": 1500.0, "depth_exponent": self.exponent, "feed_exponent": 0.6, "speed_exponent": -0.3 },
                "main": { "coefficient": 2500.0, "depth_exponent": 1.0, "feed_exponent": 0.75, "speed_exponent": -0.15 },
                "feed": { "coefficient": 1500.0, "depth_exponent": 1.0, "feed_exponent": 0.5, "speed_exponent": -0.4 }
            },
            "cut": { "feed_mm_per_rev": 0.2, "speed_m_per_min": 120.0,
                     "feed_direction": if self.to_headstock { "to_headstock" } else { "to_tailstock" } },
            "include": { "tangential": self.all, "axial_moment": self.all, "weight": self.all },
            "stations": { "kind": "list", "z_mm": stations },
            "effects": [{ "kind": "size_offset", "offset_um": self.offset_um }]
        })
    }
}

/// Diameter deviations, um, when the tool follows the commands given.
fn predicted(job: &Job, z: &[f64], commands: &[f64]) -> Vec<f64> {
    let path = z.iter().zip(commands).map(|(z, d)| json!({ "z_mm": z, "diameter_mm": d })).collect::<Vec<_>>();
    let run: DeflectionRun = serde_json::from_value(json!({ "commanded_path": path })).unwrap();
    let points = z.iter().map(|&z_mm| (0, DeflectionPoint { z_mm })).collect();
    let rows = Rows { runs: vec![run], points };
    let prepared = DeflectionCompensation::prepare(job, &rows, "diameter_deviation_um", &Unwatched).unwrap();
    DeflectionCompensation::predict(&prepared, &[], &Unwatched).unwrap().into_iter().map(Result::unwrap).collect()
}

fn commands(outcome: &Outcome) -> Option<Vec<f64>> {
    let fine = outcome.stations.status_compensated.iter().all(|s| *s == StatusCompensated::Ok);
    fine.then(|| outcome.stations.commanded_diameter_mm.iter().map(|d| d.unwrap()).collect())
}

fn close(a: &[Option<f64>], b: &[Option<f64>], tolerance: f64) -> bool {
    a.len() == b.len()
        && a.iter().zip(b).all(|(a, b)| match (a, b) {
            (Some(a), Some(b)) => (a - b).abs() <= tolerance,
            (None, None) => true,
            _ => false,
        })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// The explicit command, cut with the implicit model, gives the drawing.
    #[test]
    fn the_command_gives_the_drawing(case in case()) {
        let outcome = solved(case.job());
        let Some(commands) = commands(&outcome) else { return Ok(()) };
        for (z, deviation) in outcome.stations.z_mm.iter().zip(predicted(&prepared(case.job()), &outcome.stations.z_mm, &commands)) {
            // Radii of 30 mm in double precision: 1e-11 um, a few operations; the solver's own tolerance is below.
            prop_assert!(deviation.abs() < 1e-8, "{deviation} um at {z}");
        }
    }

    /// Nothing but the solver's tolerance separates the uncompensated answer from the forward model's.
    #[test]
    fn the_forward_model_is_the_calculators(case in case()) {
        let outcome = solved(case.job());
        let nominal = &outcome.stations.diameter_mm;
        let forward = predicted(&prepared(case.job()), &outcome.stations.z_mm, nominal);
        for (own, forward) in outcome.stations.diameter_error_uncompensated_um.iter().zip(forward) {
            prop_assert!((own.unwrap() - forward).abs() < 1e-8, "{own:?} {forward}");
        }
    }

    /// Turned end for end and fed the other way, the same shaft gives the same profile backwards.
    #[test]
    fn a_mirrored_job_gives_the_mirrored_answer(case in case()) {
        // The shoulder's station belongs to the segment that ends there: a convention, not a symmetry.
        let on_shoulder = |case: &Case| {
            let step = case.length() / 20.0;
            let near = |z: f64| ((z / step) - (z / step).round()).abs() < 1e-6;
            near(case.lengths[0]) || near(case.lengths[0] + case.lengths[1])
        };
        prop_assume!(!on_shoulder(&case));
        let straight = solved(case.job()).stations;
        let mut mirrored = solved(case.mirrored().job()).stations;
        mirrored.diameter_error_uncompensated_um.reverse();
        let (straight_offset_um, mut mirrored_offset_um) = (straight.offset_um.unwrap(), mirrored.offset_um.unwrap());
        mirrored_offset_um.reverse();
        // Sums of lengths round differently from the other end: 1e-13 of 1000 mm, times the slope of the compliance.
        prop_assert!(close(&straight.diameter_error_uncompensated_um, &mirrored.diameter_error_uncompensated_um, 1e-6));
        prop_assert!(close(&straight_offset_um, &mirrored_offset_um, 1e-6));
    }

    /// The short answer holds the same numbers as the full one, and says the same of uncertainty and copying; of the
    /// columns that it leaves out three are differences of those that it has.
    #[test]
    fn the_profile_alone_has_the_same_numbers(case in case()) {
        let mut short = case.job();
        short["detail"] = json!("profile");
        let answer = |job| DeflectionCompensation::run(&prepared(job), &Unwatched).unwrap();
        let (full, short) = (answer(case.job()), answer(short));
        let said = |answer: &Answer<Outcome>, code| answer.explanation.iter().find(|said| said.code == code).cloned();
        for code in ["uncertain_by", "stock_is_copied"] {
            prop_assert_eq!(said(&full, code), said(&short, code));
        }
        let (full, short) = (full.output, short.output);
        prop_assert_eq!(&full.stations.commanded_diameter_mm, &short.stations.commanded_diameter_mm);
        prop_assert_eq!(&full.stations.diameter_error_uncompensated_um, &short.stations.diameter_error_uncompensated_um);
        prop_assert_eq!(full.before, short.before);
        prop_assert!(short.path.is_none() && short.after.is_none() && short.one_step.is_none());
        let (full, short) = (full.stations, short.stations);
        prop_assert!(
            short.work_compliance_um_per_n.is_none()
                && short.depth_uncompensated_mm.is_none()
                && short.offset_um.is_none()
                && short.diameter_uncertainty_um.is_none()
                && short.copying_factor.is_none()
        );
        let carriage = case.springs[2];
        let work: Vec<_> = short.compliance_um_per_n.iter().map(|w| Some(w - carriage)).collect();
        let full_work: Vec<_> = full.work_compliance_um_per_n.unwrap().into_iter().map(Some).collect();
        prop_assert!(close(&full_work, &work, 1e-12));
        let offset = |(c, d): (&Option<f64>, &f64)| c.map(|c| (c - d) / 2.0 * 1e3);
        let offset: Vec<_> = short.commanded_diameter_mm.iter().zip(&short.diameter_mm).map(offset).collect();
        // Round-off of diameters of 100 mm, in um.
        prop_assert!(close(&full.offset_um.unwrap(), &offset, 1e-9));
        let depth = |(error, depth): (&Option<f64>, &f64)| error.map(|error| depth - error / 2.0 / 1e3);
        let depth: Vec<_> = short.diameter_error_uncompensated_um.iter().zip(&short.depth_mm).map(depth).collect();
        prop_assert!(close(&full.depth_uncompensated_mm.unwrap(), &depth, 1e-12));
    }

    /// Passive force alone, no rests: the error lies between none and twice the deflection at the nominal depth
    /// (`deflection/4.1`), the copying factor between 0 and 1.
    #[test]
    fn the_loss_is_less_than_the_deflection(mut case in case()) {
        case.all = false;
        case.rest = None;
        case.offset_um = 0.0;
        let stations = solved(case.job()).stations;
        for ((error, y), copied) in stations.diameter_error_uncompensated_um.iter().zip(&stations.deflection_um).zip(stations.copying_factor.as_ref().unwrap()) {
            let error = error.unwrap();
            prop_assert!(error >= -1e-9 && error <= 2.0 * y + 1e-9, "{error} for {y}");
            prop_assert!((0.0..1.0).contains(&copied.unwrap()));
        }
    }

    /// Shares of who yields are shares.
    #[test]
    fn shares_add_up(case in case()) {
        let shares = solved(case.job()).shares;
        let parts = [shares.work, shares.headstock, shares.tailstock, shares.rests, shares.tool];
        prop_assert!(parts.iter().all(|part| *part >= 0.0), "{shares:?}");
        prop_assert!((parts.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{shares:?}");
    }
}

/// The tailstock term of the paper's formula (2) is linear in x/l where it must be quadratic: printed, it breaks
/// mirror symmetry, and this shaft would bend differently when turned end for end.
#[test]
fn the_printed_tailstock_term_breaks_mirror_symmetry() {
    let (l, w) = (2000.0_f64, 3.3e-5);
    let printed = |x: f64, w_h: f64, w_t: f64| (1.0 - x / l).powi(2) * w_h + (x / l) * w_t;
    let right = |x: f64, w_h: f64, w_t: f64| (1.0 - x / l).powi(2) * w_h + (x / l).powi(2) * w_t;
    let x = 500.0;
    assert!((right(x, w, 2.0 * w) - right(l - x, 2.0 * w, w)).abs() < 1e-18);
    assert!((printed(x, w, 2.0 * w) - printed(l - x, 2.0 * w, w)).abs() > 0.1 * w);
    let job = |w_h: f64, w_t: f64, x: f64| {
        let outcome = solved(json!({
            "shaft": { "segments": [{ "length_mm": l, "diameter_mm": 500.0, "stock_diameter_mm": 501.0 }], "youngs_modulus_n_per_mm2": 2e6 },
            "supports": [
                { "kind": "centre", "z_mm": 0.0, "compliance_um_per_n": 1e3 * w_h },
                { "kind": "centre", "z_mm": l, "compliance_um_per_n": 1e3 * w_t }
            ],
            "force": { "kind": "constant", "passive_n": 100.0 },
            "cut": { "feed_mm_per_rev": 0.1, "speed_m_per_min": 100.0 },
            "stations": { "kind": "list", "z_mm": [x] }
        }));
        outcome.stations.work_compliance_um_per_n.unwrap()[0] / 1e3
    };
    let built = job(w, 2.0 * w, x);
    let bending = built - right(x, w, 2.0 * w);
    // What is left is the bending of a nearly rigid shaft: the quadratic term was built.
    assert!(bending > 0.0 && bending < 0.02 * w, "{bending:e}");
}

/// The source paper's shaft with weight partly along the tool, and a rest more.
fn paper(rest: Option<Value>) -> Value {
    let example = DeflectionCompensation::META.examples.iter().find(|example| example.id == "paper").unwrap();
    let mut job: Value = serde_json::from_str(example.job).unwrap();
    job["gravity"] = json!({ "angle_deg": -30 });
    job["supports"].as_array_mut().unwrap().extend(rest);
    job
}

/// Largest change of the diameter along the nominal line.
fn change_um(job: &Value, change: impl Fn(&mut Value)) -> f64 {
    let mut job = job.clone();
    job["detail"] = json!("profile");
    let mut other = job.clone();
    change(&mut other);
    let (before, after) = (solved(job).stations, solved(other).stations);
    let pairs = before.diameter_error_uncompensated_um.iter().zip(&after.diameter_error_uncompensated_um);
    pairs.map(|(a, b)| (a.unwrap() - b.unwrap()).abs()).fold(0.0, f64::max)
}

/// What an effect that is left out would change, against the job solved with it: with a one-sided rest closed an order
/// of magnitude less than with all rests open. The depth gives back what is copied, so the size is above the change.
#[test]
fn effects_left_out_are_judged_with_the_rests_as_they_stand() {
    let steady =
        json!({ "kind": "steady_rest", "z_mm": 1000, "compliance_um_per_n": 0.02, "one_sided": true, "gap_um": 20 });
    let follow = json!({ "kind": "follow_rest", "offset_mm": -30, "compliance_um_per_n": 0.02, "one_sided": true, "gap_um": 10 });
    for (name, rest) in [("none", None), ("steady", Some(steady)), ("follow", Some(follow))] {
        let job = paper(rest);
        let sizes = solved(job.clone()).second_order.unwrap();
        let held = |what: &str, size: Option<f64>, change: f64| {
            let size = size.unwrap();
            assert!(size > 0.99 * change && size < 1.3 * change + 0.01, "{name}, {what}: {size} for {change}");
        };
        held("weight", sizes.weight_um, change_um(&job, |job| job["include"] = json!({ "weight": true })));
        held("partly turned", sizes.partly_turned_um, change_um(&job, |job| job["shaft"]["section"] = json!("mixed")));
        held("shear", sizes.shear_um, change_um(&job, |job| job["shaft"]["theory"] = json!("timoshenko")));
    }
}

fn warnings(job: Value) -> Vec<Finding> {
    DeflectionCompensation::run(&prepared(job), &Unwatched).unwrap().warnings
}

fn left_out(job: Value) -> Vec<String> {
    let found = warnings(job).into_iter().filter(|warning| warning.code == "effect_left_out");
    found.map(|warning| format!("{:?}", warning.values.get("effect").unwrap())).collect()
}

/// What acts by an effect is not left out; what passes do not count is, whatever the job says of the section.
#[test]
fn an_effect_that_acts_is_not_called_left_out() {
    let says = |job: Value, what: &str| left_out(job).iter().any(|effect| effect.contains(what));
    let mut job = paper(None);
    assert!(says(job.clone(), "partly_turned"));
    job["effects"] = json!([{ "kind": "uncut_side_stiffness" }]);
    assert!(!says(job, "partly_turned"));
    let mut passes = paper(None);
    passes["shaft"]["section"] = json!("mixed");
    assert!(!says(passes.clone(), "partly_turned"));
    passes["passes"] = json!([{ "diameter_mm": 90.4 }, { "diameter_mm": 90 }]);
    passes["tolerance"]["form_um"] = json!(1);
    assert!(says(passes, "partly_turned_in_passes"));
}

/// A station beside the shaft is told the end that it lies beyond.
#[test]
fn a_station_beside_the_shaft_has_the_nearer_end_as_its_limit() {
    for (z, end) in [(-1.0, 0.0), (2001.0, 2000.0)] {
        let mut job = paper(None);
        job["stations"] = json!({ "kind": "list", "z_mm": [z] });
        let job: Job = serde_json::from_value(job).unwrap();
        let mut violations = Violations::default();
        job.check(&mut violations);
        let found = violations.into_vec();
        assert!(matches!(&found[..], [fault] if fault.code == "station_outside_shaft"), "{found:?}");
        assert_eq!((found[0].value, found[0].limit), (Some(z), Some(end)));
    }
}
