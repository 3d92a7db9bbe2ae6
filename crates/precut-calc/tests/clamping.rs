//! Clamping with friction: the reference cases, closed forms, properties over random fixtures, and what an answer says, done.
#![allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, missing_docs)]

use std::fs;
use std::path::Path;

use precut_calc::clamping::{
    Asked, Contact, Criterion, Fixture, Load, Rest, Sheet, Unheld, Vector, Vise, certain_slip_below_n, load_factor,
};
use precut_calc::num::stats::Resampler;
use serde_json::{Value, json};

use crate::fixture_support::{outcome, reference_job, with};

fn vector(of: &Value) -> Vector {
    std::array::from_fn(|i| of[i].as_f64().unwrap())
}

fn fixture(input: &Value) -> Fixture {
    let contact = |of: &Value| {
        let number = |name: &str| of[name].as_f64().unwrap_or(0.0);
        Contact {
            position_mm: vector(&of["position_mm"]),
            normal: vector(&of["normal"]),
            friction: number("friction"),
            normal_stiffness_n_per_mm: number("normal_stiffness_n_per_mm"),
            tangential_stiffness_n_per_mm: number("tangential_stiffness_n_per_mm"),
            clamp_share: number("clamp_share"),
            constant_force: of["constant_force"].as_bool().unwrap_or(false),
        }
    };
    Fixture {
        contacts: input["contacts"].as_array().unwrap().iter().map(contact).collect(),
        weight_n: input["weight_n"].as_f64().unwrap(),
        centre_of_mass_mm: vector(&input["centre_of_mass_mm"]),
    }
}

fn friction(fixture: &Fixture) -> Vec<f64> {
    fixture.contacts.iter().map(|contact| contact.friction).collect()
}

fn sheet(fixture: &Fixture, loads: &[Load], safety: f64, clamp_force_n: Option<f64>) -> Sheet {
    let friction = friction(fixture);
    Asked {
        fixture,
        peaks: loads,
        means: loads,
        safety,
        friction: [&friction; 3],
        clamp_force_n,
        programmes: usize::MAX,
    }
    .sheet()
    .unwrap()
}

/// (22) and (23).
fn forces(fixture: &Fixture, loads: &[Load]) -> (f64, f64) {
    let sheet = sheet(fixture, loads, 1.0, None);
    (sheet.certain_slip_below_n.unwrap(), sheet.clamp_force_min_n)
}

fn close(have: f64, want: f64, within: f64, what: &str) {
    assert!((have / want - 1.0).abs() < within, "{what}: {have}, expected {want}");
}

#[test]
fn forces_are_those_of_the_reference() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("reference/milling/clamping.json");
    let read: Value = serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();
    for case in read["cases"].as_array().unwrap() {
        let (id, input, expected) = (case["id"].as_str().unwrap(), &case["input"], &case["expected"]);
        let fixture = fixture(input);
        let load = |of: &Value| Load { force_n: vector(&of["force_n"]), point_mm: vector(&of["point_mm"]) };
        let loads: Vec<Load> = input["loads"].as_array().unwrap().iter().map(load).collect();
        let sheet = sheet(&fixture, &loads, input["safety"].as_f64().unwrap_or(1.0), None);
        close(sheet.clamp_force_min_n, expected["elastic_n"].as_f64().unwrap(), 1e-8, id);
        let certain_n = sheet.certain_slip_below_n.unwrap();
        close(certain_n, expected["equilibrium_n"].as_f64().unwrap(), 1e-7, id);
        let bracket = |i: usize| expected["bracket_n"][i].as_f64().unwrap();
        assert!((bracket(0)..=bracket(1)).contains(&certain_n), "{id}");
        let decides = sheet.decides.unwrap();
        assert_eq!(decides.load, usize::try_from(expected["load"].as_u64().unwrap()).unwrap(), "{id}");
        assert_eq!(decides.criterion.name(), expected["criterion"], "{id}");
        if id != "C01" {
            // There contacts tie by symmetry.
            assert_eq!(decides.contact, usize::try_from(expected["contact"].as_u64().unwrap()).unwrap(), "{id}");
        }
        // At the least force the contact that decides uses all of its friction, no other one more.
        let most = sheet.contacts.iter().filter_map(|one| one.friction_used_percent).fold(0.0, f64::max);
        close(most, 100.0, 1e-8, id);
        assert!((sheet.contacts[decides.contact].friction_used_percent.unwrap() / 100.0 - 1.0).abs() < 1e-8, "{id}");
    }
}

/// A clamp and a locator opposite to each other on a line along y.
fn two_points(friction: f64) -> Fixture {
    let contact = |side: f64| Contact {
        position_mm: [0.0, 30.0 * side, 0.0],
        normal: [0.0, -side, 0.0],
        friction,
        normal_stiffness_n_per_mm: 40_000.0,
        tangential_stiffness_n_per_mm: 28_000.0,
        clamp_share: if side > 0.0 { 1.0 } else { 0.0 },
        constant_force: false,
    };
    Fixture { contacts: vec![contact(1.0), contact(-1.0)], weight_n: 0.0, centre_of_mass_mm: [0.0; 3] }
}

fn vise(friction: f64) -> Vise {
    Vise {
        jaw_length_mm: 100.0,
        jaw_height_mm: 30.0,
        part_width_mm: 60.0,
        parallels: true,
        friction,
        constant_force: true,
        weight_n: 0.0,
        centre_of_mass_mm: [0.0; 3],
    }
}

#[test]
fn a_force_along_two_jaws_at_their_middle_is_held_from_half_of_it_over_the_friction_on() {
    for friction in [0.1, 0.2, 0.35] {
        for (fixture, height) in [(two_points(friction), 0.0), (vise(friction).fixture(), 15.0)] {
            let along = Load { force_n: [406.0, 0.0, 0.0], point_mm: [0.0, 0.0, height] };
            let (certain_n, least_n) = forces(&fixture, &[along]);
            close(least_n, 406.0 / (2.0 * friction), 1e-9, "least");
            if fixture.contacts.len() == 2 {
                close(certain_n, least_n, 1e-8, "certain");
            }
        }
    }
}

/// The vise of `fixture-stability` has one face for each jaw: a force along them at their middle, without one upward, is the
/// same two contacts.
#[test]
fn fixture_stability_asks_for_the_same_force_where_both_can() {
    let mut job = reference_job(1);
    job["force"] = json!({ "coefficient": 1800, "radial_ratio": 0.4 });
    let job = with(&job, "/fixture/clamp", json!({ "friction": { "low": 0.2, "value": 0.25, "high": 0.3 } }));
    let clamp = outcome(&with(&job, "/analyses", json!(["clamp_force"]))).clamp.unwrap();
    let along = Load { force_n: [clamp.along.across_mean_n, 0.0, 0.0], point_mm: [0.0; 3] };
    let (_, least_n) = forces(&two_points(0.2), &[along]);
    close(clamp.slip.unwrap().against_mean_n, least_n, 1e-9, "mean force across the feed");
}

/// A part on drawn contacts: jaws pushed together, some with parallels.
fn drawn(draw: &mut Resampler) -> Fixture {
    let mut between = |low: f64, high: f64| low + (high - low) * draw.uniform();
    let vise = Vise {
        jaw_length_mm: between(40.0, 150.0),
        jaw_height_mm: between(10.0, 50.0),
        part_width_mm: between(20.0, 120.0),
        parallels: between(0.0, 1.0) < 0.7,
        friction: 0.2,
        constant_force: between(0.0, 1.0) < 0.5,
        weight_n: 0.0,
        centre_of_mass_mm: [0.0; 3],
    };
    let mut fixture = vise.fixture();
    for contact in &mut fixture.contacts {
        contact.friction = between(0.1, 0.35);
        contact.normal_stiffness_n_per_mm *= between(0.5, 2.0);
        contact.tangential_stiffness_n_per_mm *= between(0.5, 2.0);
    }
    fixture
}

fn drawn_load(draw: &mut Resampler) -> Load {
    let mut between = |size: f64| size * (2.0 * draw.uniform() - 1.0);
    Load {
        force_n: [between(800.0), between(800.0), between(400.0)],
        point_mm: [between(40.0), between(20.0), 30.0 + between(20.0)],
    }
}

/// Turned about an axis by an angle, then moved.
fn moved(v: &Vector, angle: f64, by: f64) -> Vector {
    let (s, c) = angle.sin_cos();
    [c * v[0] - s * v[1] + by, s * v[0] + c * v[1] - by, v[2] + 2.0 * by]
}

#[test]
fn forces_keep_their_order_scale_with_the_loads_and_do_not_know_the_axes() {
    for seed in 0..60 {
        let mut draw = Resampler::new(seed, 7);
        let fixture = drawn(&mut draw);
        let loads: Vec<Load> = (0..3).map(|_| drawn_load(&mut draw)).collect();
        let (certain_n, least_n) = forces(&fixture, &loads);
        assert!(certain_n <= least_n * (1.0 + 1e-7), "{seed}: {certain_n} above {least_n}");
        let twice: Vec<Load> =
            loads.iter().map(|load| Load { force_n: load.force_n.map(|x| 2.5 * x), ..*load }).collect();
        let (certain_twice_n, least_twice_n) = forces(&fixture, &twice);
        close(least_twice_n, 2.5 * least_n, 1e-8, "least, scaled");
        close(certain_twice_n, 2.5 * certain_n, 1e-6, "certain, scaled");
        let turned = Fixture {
            contacts: fixture
                .contacts
                .iter()
                .map(|one| Contact {
                    position_mm: moved(&one.position_mm, 0.7, 35.0),
                    normal: moved(&one.normal, 0.7, 0.0),
                    ..one.clone()
                })
                .collect(),
            ..fixture.clone()
        };
        let turned_loads: Vec<Load> = loads
            .iter()
            .map(|load| Load { force_n: moved(&load.force_n, 0.7, 0.0), point_mm: moved(&load.point_mm, 0.7, 35.0) })
            .collect();
        let (certain_turned_n, least_turned_n) = forces(&turned, &turned_loads);
        close(least_turned_n, least_n, 1e-7, "least, turned");
        close(certain_turned_n, certain_n, 1e-6, "certain, turned");
    }
}

/// The programme over the clamp force and the one over the factor on the load are each other's inverse, and pruning loses no load.
#[test]
fn the_force_below_which_slip_is_certain_holds_just_the_load() {
    for seed in 0..40 {
        let mut draw = Resampler::new(seed, 8);
        let fixture = drawn(&mut draw);
        let friction = friction(&fixture);
        let loads: Vec<Load> = (0..4).map(|_| drawn_load(&mut draw)).collect();
        let alone =
            |load: &Load| certain_slip_below_n(&fixture, &[*load], 1.0, &friction, &[f64::INFINITY], 1).unwrap().0;
        let each: Vec<f64> = loads.iter().map(alone).collect();
        for (load, force_n) in loads.iter().zip(&each).filter(|(_, force_n)| **force_n > 1.0) {
            close(load_factor(&fixture, load, *force_n, &friction).unwrap(), 1.0, 1e-5, "factor");
            close(load_factor(&fixture, load, 1.5 * force_n, &friction).unwrap(), 1.5, 1e-5, "factor at half more");
        }
        let most = each.iter().copied().fold(0.0, f64::max);
        close(forces(&fixture, &loads).0, most, 1e-7, "largest of all loads");
    }
}

#[test]
fn what_a_sheet_says_of_a_force_at_hand_holds_when_it_is_done() {
    for seed in 0..30 {
        let mut draw = Resampler::new(seed, 9);
        let fixture = Fixture { weight_n: 20.0, centre_of_mass_mm: [0.0, 0.0, 20.0], ..drawn(&mut draw) };
        let loads: Vec<Load> = (0..3).map(|_| drawn_load(&mut draw)).collect();
        let least_n = sheet(&fixture, &loads, 1.0, None).clamp_force_min_n;
        let at_hand_n = 1.4 * least_n;
        let said = sheet(&fixture, &loads, 1.0, Some(at_hand_n)).at_hand.unwrap();
        assert!(said.no_slip_factor > 1.0, "{seed}: {said:?}");
        assert!(said.certain_slip_factor.unwrap() >= said.no_slip_factor * (1.0 - 1e-5), "{seed}: {said:?}");
        close(sheet(&fixture, &loads, said.no_slip_factor, None).clamp_force_min_n, at_hand_n, 1e-7, "factor");
        // With the friction that is needed, everywhere, no less force holds.
        let needed = vec![said.friction_needed.unwrap(); fixture.contacts.len()];
        let rest = Rest::of(&fixture).unwrap();
        let loaded = rest.loaded(&fixture, &loads, 1.0).unwrap();
        let decides = rest.against_slip(&loaded, &needed).unwrap();
        assert_eq!(decides.criterion, Criterion::Slip);
        close(decides.clamp_force_n, at_hand_n, 1e-8, "friction");
        // Too little force: a factor below 1.
        let short = sheet(&fixture, &loads, 1.0, Some(0.9 * least_n)).at_hand.unwrap();
        assert!(short.no_slip_factor < 1.0, "{seed}: {short:?}");
    }
}

#[test]
fn a_contact_that_comes_off_is_told_and_weight_holds_it_down() {
    let light = vise(0.2).fixture();
    let up = [Load { force_n: [0.0, 0.0, 210.0], point_mm: [0.0, 0.0, 40.0] }];
    let told = sheet(&light, &up, 1.0, None).lifts;
    assert_eq!(told.iter().map(|lift| lift.contact).collect::<Vec<_>>(), [8, 9, 10, 11]);
    assert!(told.iter().all(|lift| (lift.off_n - 210.0).abs() < 1e-9));
    let heavy = Fixture { weight_n: 5000.0, ..light };
    assert_eq!(sheet(&heavy, &up, 1.0, None).lifts, []);
    // Without parallels the weight hangs on the friction of the jaws.
    let hanging =
        Vise { parallels: false, weight_n: 100.0, centre_of_mass_mm: [0.0, 0.0, 15.0], ..vise(0.2) }.fixture();
    assert!(Rest::of(&hanging).unwrap().weight_hangs);
    let nothing = [Load { force_n: [0.0; 3], point_mm: [0.0; 3] }];
    close(sheet(&hanging, &nothing, 1.0, None).clamp_force_min_n, 100.0 / (2.0 * 0.2), 1e-9, "weight");
    assert_eq!(sheet(&vise(0.2).fixture(), &nothing, 1.0, None).clamp_force_min_n, 0.0);
}

#[test]
fn a_part_that_nothing_holds_is_refused_with_the_way_it_goes() {
    let mut fixture = two_points(0.2);
    fixture.contacts[1].normal = [1.0, 0.0, 0.0];
    match Rest::of(&fixture) {
        // The clamp pushes along -y, and nothing stands there.
        Err(Unheld::Free(way)) => assert!(way[1] < -0.5, "{way:?}"),
        other => panic!("{other:?}"),
    }
    let mut loose = two_points(0.2);
    loose.contacts[0].clamp_share = 0.0;
    assert_eq!(Rest::of(&loose), Err(Unheld::NothingClamped));
    // Two points hold no couple about the line between them.
    let points = two_points(0.2);
    let rest = Rest::of(&points).unwrap();
    let turning = Load { force_n: [100.0, 0.0, 0.0], point_mm: [0.0, 0.0, 20.0] };
    assert!(matches!(rest.loaded(&points, &[turning], 1.0), Err(Unheld::Free(_))));
}
