//! What acts by default: effects that the job's own numbers show to matter, and no other.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use crate::cases::{Dice, answer, case, count};
use precut_calc::calculator::Answer;
use precut_calc::deflection_compensation::{DeflectionCompensation, Outcome};
use serde_json::{Value, json};

fn solved(job: &Value) -> Answer<Outcome> {
    answer::<DeflectionCompensation>(job).unwrap()
}

fn automatic(outcome: &Outcome) -> Vec<&str> {
    outcome.included_automatically.iter().map(|one| one.effect.as_str()).collect()
}

/// A switch of a job by the name of its effect.
fn switch(job: &mut Value, effect: &str, on: bool) {
    match effect {
        "partly_turned" => job["shaft"]["section"] = json!(if on { "mixed" } else { "finished" }),
        "shear" => job["shaft"]["theory"] = json!(if on { "timoshenko" } else { "euler_bernoulli" }),
        name => job["include"][name] = json!(on),
    }
}

const EFFECTS: [&str; 4] = ["axial_moment", "tangential", "partly_turned", "shear"];

#[test]
fn a_chucked_bar_is_not_programmed_undersize_by_a_known_taper() {
    let job = case("deflection-compensation/chuckbar.json");
    let end =
        |job: &Value| *solved(job).output.path.unwrap().zones.last().unwrap().commanded_diameter_mm.last().unwrap();
    let mut stated = job.clone();
    stated["include"] = json!({ "mode": "as_stated" });
    let mut full = stated.clone();
    for effect in ["axial_moment", "tangential", "partly_turned"] {
        switch(&mut full, effect, true);
    }
    assert!((end(&stated) - 27.927).abs() < 2e-3, "{}", end(&stated));
    assert!((end(&full) - 27.974).abs() < 2e-3, "{}", end(&full));
    assert!((end(&job) - end(&full)).abs() < 3e-3, "{} {}", end(&job), end(&full));
    let answer = solved(&job);
    assert!(automatic(&answer.output).contains(&"axial_moment"));
    let said = answer.explanation.iter().filter(|message| message.code == "effect_acts_by_default").count();
    assert_eq!(said, answer.output.included_automatically.len());
    assert!(solved(&stated).output.included_automatically.is_empty());
}

fn random(dice: &mut Dice) -> Value {
    let length = dice.between(100.0, 900.0).round();
    let diameter = dice.between(15.0, 80.0).round();
    let depth = dice.between(0.3, 3.0);
    let chucked = dice.percent(50);
    let mut supports =
        vec![json!({ "kind": if chucked { "chuck" } else { "centre" }, "z_mm": 0.0, "compliance_um_per_n": 0.02 })];
    if !chucked || dice.percent(50) {
        supports.push(json!({ "kind": "centre", "z_mm": length, "compliance_um_per_n": 0.03 }));
    }
    let mut job = json!({
        "shaft": { "segments": [
            { "length_mm": length * 0.4, "diameter_mm": diameter, "stock_diameter_mm": diameter + 2.0 * depth },
            { "length_mm": length * 0.6, "diameter_mm": diameter - 1.0, "stock_diameter_mm": diameter + 2.0 * depth }],
            "youngs_modulus_n_per_mm2": 210_000.0 },
        "supports": supports, "carriage": { "compliance_um_per_n": 0.02 },
        "force": { "kind": "kienzle", "cutting_edge_angle_deg": dice.between(45.0, 100.0), "nose_radius_mm": 0.8,
            "specific_cutting_force_n_per_mm2": 2085.0, "cutting_exponent": 0.173,
            "specific_normal_force_n_per_mm2": 900.0, "normal_exponent": 0.35 },
        "cut": { "feed_mm_per_rev": dice.between(0.08, 0.4), "speed_m_per_min": 120.0,
                 "feed_direction": if dice.percent(50) { "to_headstock" } else { "to_tailstock" } },
        "include": {}, "detail": "full"
    });
    if dice.percent(70) {
        job["tolerance"] = json!({ "form_um": dice.between(5.0, 200.0) });
    }
    job
}

#[test]
fn what_acts_by_default_is_what_matters_and_the_switches_written_out_give_the_same() {
    let mut dice = Dice(43);
    let mut on = 0;
    for number in 0..count(1000) {
        let job = random(&mut dice);
        let found = solved(&job).output;
        let sizes = found.second_order.as_ref().unwrap();
        let acting = automatic(&found);
        on += acting.len();
        let size = |effect: &str| match effect {
            "axial_moment" => sizes.axial_moment_um,
            "tangential" => sizes.tangential_um,
            "partly_turned" => sizes.partly_turned_um,
            _ => sizes.shear_um,
        };
        let limit = job["tolerance"]["form_um"].as_f64().map(|form| form / 10.0);
        for one in &found.included_automatically {
            assert!(one.change_um > one.limit_um && limit.is_none_or(|limit| (limit - one.limit_um).abs() < 1e-9));
        }
        for effect in EFFECTS.into_iter().filter(|effect| !acting.contains(effect)) {
            // Tried at a sample of the stations.
            let left = size(effect).unwrap();
            assert!(limit.is_none_or(|limit| left <= 1.05 * limit), "{number}: {effect} {left} {limit:?}");
        }
        let mut written = job.clone();
        written["include"]["mode"] = json!("as_stated");
        for effect in EFFECTS {
            switch(&mut written, effect, acting.contains(&effect));
        }
        let same = solved(&written).output;
        assert_eq!(same.stations, found.stations, "{number}");
        // A switch that is said holds.
        let mut off = job.clone();
        off["detail"] = json!("profile");
        for effect in EFFECTS {
            switch(&mut off, effect, false);
        }
        assert!(solved(&off).output.included_automatically.is_empty());
    }
    assert!(on > 50, "{on}");
}

#[test]
fn the_short_answer_has_the_numbers_of_the_full_one() {
    let mut dice = Dice(44);
    for _ in 0..20 {
        let mut job = random(&mut dice);
        let full = solved(&job).output;
        job["detail"] = json!("profile");
        let short = solved(&job).output;
        assert_eq!(short.included_automatically, full.included_automatically);
        assert_eq!(short.stations.commanded_diameter_mm, full.stations.commanded_diameter_mm);
    }
}

/// One support more, as it is advised: the job with it is solved, and the form error is the one that was told.
#[test]
fn the_support_that_is_advised_gives_the_form_error_that_was_told() {
    let mut dice = Dice(45);
    let (mut rests, mut tailstocks) = (0, 0);
    for number in 0..count(1000) {
        let job = random(&mut dice);
        let found = solved(&job).output;
        let Some(advised) = &found.one_more_rest else { continue };
        let kind = serde_json::to_value(advised.kind).unwrap();
        let mut taken = job.clone();
        taken["detail"] = json!("profile");
        taken["supports"]
            .as_array_mut()
            .unwrap()
            .push(json!({ "kind": kind, "z_mm": advised.z_mm, "compliance_um_per_n": advised.compliance_um_per_n }));
        let got = solved(&taken).output.form_error_um.unwrap();
        let gain = found.form_error_um.unwrap() - advised.form_error_um;
        let allowed = 0.02 * gain.abs().max(0.02 * found.form_error_um.unwrap());
        assert!((got - advised.form_error_um).abs() <= allowed, "{number}: {got} {advised:?} {job}");
        match kind.as_str().unwrap() {
            "centre" => {
                tailstocks += 1;
                assert!(job["supports"].as_array().unwrap().len() == 1);
            }
            _ => rests += 1,
        }
    }
    assert!(rests > 10 && tailstocks > 10, "{rests} {tailstocks}");
}
