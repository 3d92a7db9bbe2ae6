//! Thin rings under jaws and shoes against the closed forms of Roark and Timoshenko, and the advice done.
#![allow(clippy::unwrap_used, clippy::panic, clippy::cast_precision_loss, missing_docs)]

use std::f64::consts::PI;

use precut_calc::calculator::{Answer, Calculator, Check, Unwatched, Violations};
use precut_calc::ring_clamping::{Job, Outcome, RingClamping};
use serde_json::{Value, json};

fn faults(text: &Value) -> Vec<&'static str> {
    let job: Job = serde_json::from_value(text.clone()).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    violations.into_vec().into_iter().map(|finding| finding.code).collect()
}

fn solve(text: &Value) -> Answer<Outcome> {
    assert_eq!(faults(text), Vec::<&str>::new());
    let mut job: Job = serde_json::from_value(text.clone()).unwrap();
    RingClamping::fill(&mut job);
    RingClamping::run(&job, &Unwatched).unwrap()
}

fn codes(answer: &Answer<Outcome>) -> Vec<&'static str> {
    let said = answer.explanation.iter().map(|message| message.code);
    said.chain(answer.warnings.iter().map(|finding| finding.code)).collect()
}

const RADIUS_MM: f64 = 70.0;
const WIDTH_MM: f64 = 24.0;
const FORCE_N: f64 = 1.0;
const MODULUS: f64 = 210_000.0;

fn jaws(wall_mm: f64, count: u32, more: &Value) -> Value {
    let mut holding = json!({ "kind": "jaws", "jaws": count, "force_per_jaw_n": FORCE_N });
    for (name, value) in more.as_object().unwrap() {
        holding[name] = value.clone();
    }
    json!({
        "outer_diameter_mm": 2.0 * RADIUS_MM + wall_mm, "inner_diameter_mm": 2.0 * RADIUS_MM - wall_mm,
        "width_mm": WIDTH_MM, "youngs_modulus_n_per_mm2": MODULUS, "holding": holding
    })
}

fn inertia(wall_mm: f64) -> f64 {
    WIDTH_MM * wall_mm.powi(3) / 12.0
}

/// Timoshenko's ring under n equal loads, over F R³/EI and F R: inward displacement of the wall and moment, under a load and
/// half way between two.
fn thin(count: u32) -> [(f64, f64); 2] {
    let half = PI / f64::from(count);
    let (s, c) = half.sin_cos();
    let under = 0.5 * ((half + s * c) / (2.0 * s * s) - 1.0 / half);
    let between = -0.5 * (1.0 / half - (s + half * c) / (2.0 * s * s));
    [(under, 0.5 * (1.0 / half - c / s)), (between, -0.5 * (1.0 / s - 1.0 / half))]
}

/// Both ends of the profile, for thin walls and thicker ones. Roark's factors: ordinary bending counts 1 - alpha + beta,
/// and shear adds beta times the moment.
#[test]
fn n_equal_loads_bend_a_ring_as_in_the_books() {
    for wall_mm in [0.7, 4.0, 10.0] {
        for count in [2, 3, 4, 6, 12] {
            let out = solve(&jaws(wall_mm, count, &json!({}))).output;
            let stretch = (wall_mm / RADIUS_MM).powi(2) / 12.0;
            let shear = 1.2 * 2.6 * stretch;
            let unit_um = 1e3 * FORCE_N * RADIUS_MM.powi(3) / (MODULUS * inertia(wall_mm));
            let even_um = 1e3 * f64::from(count) * FORCE_N * RADIUS_MM / (2.0 * PI * MODULUS * WIDTH_MM * wall_mm);
            // Let go, the wall stands outward by what it was pressed in.
            let [under, between] = thin(count).map(|(w, m)| unit_um * ((1.0 - stretch + shear) * w + shear * m));
            let at_jaw = out.profile.radial_deviation_um[0];
            let half_way = out.profile.radial_deviation_um[360 / count as usize];
            assert!((out.radius_change_um - even_um).abs() < 1e-9 * even_um);
            assert!((at_jaw / under - 1.0).abs() < 2e-3, "{wall_mm} {count}: {at_jaw} {under}");
            assert!((half_way / between - 1.0).abs() < 2e-3, "{wall_mm} {count}: {half_way} {between}");
            assert!((out.roundness_um / (at_jaw - half_way) - 1.0).abs() < 1e-4);
        }
    }
}

/// Roark, table 9.2, case 1: what the diameter along two loads loses, the even part included.
#[test]
fn two_loads_shorten_a_thick_ring_as_in_the_book() {
    for wall_mm in [0.7, 4.0, 10.0, 20.0] {
        let out = solve(&jaws(wall_mm, 2, &json!({}))).output;
        let stretch = (wall_mm / RADIUS_MM).powi(2) / 12.0;
        let (k1, k2) = (1.0 - stretch + 3.12 * stretch, 1.0 - stretch);
        let unit_um = 1e3 * FORCE_N * RADIUS_MM.powi(3) / (MODULUS * inertia(wall_mm));
        let shorter = unit_um * (0.25 * PI * k1 - 2.0 * k2 * k2 / PI);
        let found = 2.0 * (out.profile.radial_deviation_um[0] + out.radius_change_um);
        // The book keeps the square of alpha in k2².
        assert!((found / shorter - 1.0).abs() < 1e-3, "{wall_mm}: {found} {shorter}");
    }
}

#[test]
fn two_loads_give_the_ovality_of_timoshenko() {
    // Shorter by 0.149 F R³/EI along the loads, longer by 0.137 across.
    let out = solve(&jaws(0.7, 2, &json!({}))).output;
    let unit_um = 1e3 * FORCE_N * RADIUS_MM.powi(3) / (MODULUS * inertia(0.7));
    let (along, across) = (0.25 * PI - 2.0 / PI, 2.0 / PI - 0.5);
    assert!((out.two_point_um / (unit_um * (along + across)) - 1.0).abs() < 1e-3, "{}", out.two_point_um);
    assert!((out.lobes.order[0] - 2.0).abs() < 1e-9 && out.lobes.angle_of_max_deg[0].abs() < 1e-6);
}

#[test]
fn the_largest_moment_is_that_under_a_load() {
    for count in [2, 3, 4, 6] {
        let wall_mm = 4.0;
        let half = PI / f64::from(count);
        let moment = 0.5 * FORCE_N * RADIUS_MM * (1.0 / half - 1.0 / half.tan());
        let stress = moment * 0.5 * wall_mm / inertia(wall_mm);
        let found = solve(&jaws(wall_mm, count, &json!({}))).output.bending_stress_n_per_mm2;
        assert!((found / stress - 1.0).abs() < 5e-3, "{count}: {found} {stress}");
    }
}

#[test]
fn jaws_all_round_press_evenly_and_from_inside_the_other_way() {
    let mut all_round = jaws(4.0, 3, &json!({ "contact_angle_deg": 120.0 }));
    all_round["roundness_tolerance_um"] = json!(1.0);
    let even = solve(&all_round).output;
    assert!(even.roundness_um < 1e-6, "{}", even.roundness_um);
    assert_eq!(even.limits.unwrap().force_per_jaw_max_n, None);
    let outside = solve(&jaws(4.0, 3, &json!({}))).output;
    let inside = solve(&jaws(4.0, 3, &json!({ "grip": "inside" }))).output;
    assert!((outside.roundness_um / inside.roundness_um - 1.0).abs() < 1e-9);
    assert!((outside.radius_change_um + inside.radius_change_um).abs() < 1e-12);
    // Released from outside the lobes stand at the jaws, from inside between them.
    assert!(outside.lobes.angle_of_max_deg[0].abs() < 1e-6);
    assert!((inside.lobes.angle_of_max_deg[0] - 60.0).abs() < 1e-6);
}

/// Three lobes: a gauge between two points sees nothing of them, and is told to.
#[test]
fn odd_lobes_are_blind_to_two_points() {
    let three = solve(&jaws(4.0, 3, &json!({})));
    assert!(codes(&three).contains(&"two_point_blind"), "{:?}", codes(&three));
    let four = solve(&jaws(4.0, 4, &json!({})));
    assert!(!codes(&four).contains(&"two_point_blind"));
    assert!((four.output.two_point_um / four.output.roundness_um - 2.0).abs() < 1e-3);
}

/// The force that may be gives the tolerance; the force that must be holds the cut by its safety; other jaws as told.
#[test]
fn what_is_advised_is_done_and_comes() {
    let mut job = jaws(8.0, 3, &json!({ "contact_angle_deg": 15.0 }));
    job["roundness_tolerance_um"] = json!(10.0);
    job["cutting"] = json!({ "tangential_force_n": 250, "axial_force_n": 100, "cutting_diameter_mm": 130 });
    let first = solve(&job);
    let limits = first.output.limits.unwrap();
    let most = limits.force_per_jaw_max_n.unwrap();
    for (force, is_out) in [(0.999 * most, false), (1.001 * most, true)] {
        job["holding"]["force_per_jaw_n"] = json!(force);
        assert_eq!(codes(&solve(&job)).contains(&"released_out_of_tolerance"), is_out, "{force}");
    }
    let least = limits.force_per_jaw_min_n.unwrap();
    let held_mm: f64 = 2.0 * RADIUS_MM + 8.0;
    let slides_n = (250.0 * 130.0 / held_mm).hypot(100.0);
    assert!((3.0 * 0.12 * least - 2.0 * slides_n).abs() < 1e-9);
    for (force, is_weak) in [(0.999 * least, true), (1.001 * least, false)] {
        job["holding"]["force_per_jaw_n"] = json!(force);
        assert_eq!(codes(&solve(&job)).contains(&"grip_too_weak"), is_weak, "{force}");
    }
    assert_eq!(codes(&first).contains(&"no_force_fits"), least > most);
    for other in &first.output.alternatives {
        job["holding"] = json!({
            "kind": "jaws", "jaws": other.jaws, "force_per_jaw_n": other.force_per_jaw_n,
            "contact_angle_deg": other.contact_angle_deg
        });
        assert!((f64::from(other.jaws) * other.force_per_jaw_n - 3.0 * FORCE_N).abs() < 1e-9);
        let there = solve(&job).output.roundness_um;
        assert!((there - other.roundness_um).abs() <= 1e-9 * there, "{other:?}: {there}");
    }
}

/// Where the jaws given cannot hold the cut and keep the tolerance, those that are named can: at the force that must be.
#[test]
fn the_jaws_that_are_named_do_what_the_given_ones_cannot() {
    let mut job = jaws(10.0, 3, &json!({ "contact_angle_deg": 20.0, "force_per_jaw_n": 2000.0 }));
    job["roundness_tolerance_um"] = json!(10.0);
    job["cutting"] = json!({ "tangential_force_n": 250, "cutting_diameter_mm": 130 });
    let first = solve(&job);
    let finding = first.warnings.iter().find(|finding| finding.code == "no_force_fits").unwrap();
    let number = |name: &str| match finding.values.get(name) {
        Some(precut_calc::calculator::Value::Number(number)) => *number,
        other => panic!("{name}: {other:?}"),
    };
    let (count, angle) = (number("jaws"), number("contact_angle_deg"));
    let other = first.output.alternatives.iter().find(|other| (f64::from(other.jaws) - count).abs() < 0.5).unwrap();
    job["holding"] = json!({ "kind": "jaws", "jaws": other.jaws, "force_per_jaw_n": 1.0, "contact_angle_deg": angle });
    let least = solve(&job).output.limits.unwrap().force_per_jaw_min_n.unwrap();
    job["holding"]["force_per_jaw_n"] = json!(1.0001 * least);
    let second = solve(&job);
    assert!(second.warnings.is_empty(), "{:?}", codes(&second));
    assert!(!codes(&second).contains(&"other_jaws"));
}

/// Jaws one by one are jaws: any contacts are sums of waves, and must balance.
#[test]
fn contacts_one_by_one_are_jaws_and_must_balance() {
    let of_jaws = solve(&jaws(4.0, 3, &json!({ "contact_angle_deg": 10.0 }))).output;
    let contact = |angle: f64, force: f64| json!({ "angle_deg": angle, "force_n": force, "contact_angle_deg": 10.0 });
    let mut job = jaws(4.0, 3, &json!({}));
    job["holding"] = json!({ "kind": "contacts", "contacts": [contact(0.0, FORCE_N), contact(120.0, FORCE_N), contact(-120.0, FORCE_N)] });
    let of_contacts = solve(&job).output;
    assert!((of_contacts.roundness_um / of_jaws.roundness_um - 1.0).abs() < 1e-9);
    assert!(of_contacts.alternatives.is_empty() && of_contacts.limits.is_none());
    job["holding"]["contacts"][1] = contact(120.0, 0.9 * FORCE_N);
    assert_eq!(faults(&job), ["forces_not_balanced"]);
    // Wheel and two shoes at the angles that balance them: two lobes and three.
    let share = 1.0 / (2.0 * 50f64.to_radians().cos());
    job["holding"]["contacts"] =
        json!([contact(0.0, 120.0), contact(130.0, 120.0 * share), contact(230.0, 120.0 * share)]);
    let shoes = solve(&job).output;
    assert_eq!(&shoes.lobes.order[..2], &[2.0, 3.0]);
    assert!(shoes.roundness_um > 0.0);
}

#[test]
fn what_is_no_ring_is_refused_and_a_thick_or_yielding_one_told() {
    let mut job = jaws(4.0, 3, &json!({ "contact_angle_deg": 121.0 }));
    job["inner_diameter_mm"] = json!(200.0);
    job["youngs_modulus_n_per_mm2"] = Value::Null;
    assert_eq!(faults(&job), ["ring_without_wall", "elastic_constants_missing", "jaws_overlap"]);
    assert!(codes(&solve(&jaws(30.0, 3, &json!({})))).contains(&"ring_thick"));
    let mut soft = jaws(4.0, 3, &json!({}));
    let stress = solve(&soft).output.bending_stress_n_per_mm2;
    for (strength, yields) in [(1.99 * stress, true), (2.01 * stress, false)] {
        soft["yield_strength_n_per_mm2"] = json!(strength);
        assert_eq!(codes(&solve(&soft)).contains(&"ring_yields"), yields);
    }
}
