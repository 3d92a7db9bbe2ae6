//! Milling in three directions: the reference cases of multipliers, boundaries and the zeroth order, and properties.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use std::f64::consts::TAU;
use std::fs;
use std::path::Path;

use precut_calc::calculator::Unwatched;
use precut_calc::milling_stability::model::{
    About, Cut, Kind, Law, Milling, Mode, Orders, Rotation, Rubbing, Search, Side, Structure, Tooth, Wall,
    mean_stiffness, scan, statics, unstable, zeroth,
};
use serde_json::Value;

fn cases(file: &str) -> Vec<Value> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("reference/milling").join(file);
    let read: Value = serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();
    read["cases"].as_array().unwrap().clone()
}

fn number(of: &Value, name: &str) -> f64 {
    of[name].as_f64().unwrap_or(0.0)
}

/// One number for all teeth, one each, or what is usual.
fn per_tooth(of: &Value, teeth: usize, usual: f64) -> Vec<f64> {
    match of {
        Value::Array(list) => list.iter().map(|x| x.as_f64().unwrap()).collect(),
        one => vec![one.as_f64().unwrap_or(usual); teeth],
    }
}

fn law(force: &Value) -> Law {
    let three = |names: [&str; 3]| names.map(|name| number(force, name));
    match force["kind"].as_str().unwrap() {
        "mechanistic" => Law::Mechanistic { edge: three(["kte", "kre", "kae"]), cutting: three(["ktc", "krc", "kac"]) },
        "kienzle" => Law::Power {
            at_1_mm: three(["kc11_t", "kc11_r", "kc11_a"]),
            exponent: three(["mc_t", "mc_r", "mc_a"]),
            floor_mm: number(force, "chip_floor_mm"),
        },
        _ => {
            let c = number(force, "coefficient");
            let k = number(force, "chip_thickness_exponent");
            Law::Power { at_1_mm: [c, c * number(force, "radial_ratio"), 0.0], exponent: [k; 3], floor_mm: 0.0 }
        }
    }
}

fn milling(input: &Value) -> Milling {
    let (cutter, cut) = (&input["cutter"], &input["cut"]);
    let count = usize::try_from(cutter["teeth"].as_u64().unwrap()).unwrap();
    let radius_mm = 0.5 * number(cutter, "diameter_mm");
    let pitch = per_tooth(&cutter["pitch_deg"], count, 360.0 / count as f64);
    let helix = per_tooth(&cutter["helix_deg"], count, 0.0);
    let radial = per_tooth(&cutter["radial_offset_um"], count, 0.0);
    let axial = per_tooth(&cutter["axial_offset_um"], count, 0.0);
    let tooth = |j: usize| Tooth {
        pitch_rad: pitch[j].to_radians(),
        lag_rad_per_mm: helix[j].to_radians().tan() / radius_mm,
        radial_mm: radial[j] / 1e3,
        axial_mm: axial[j] / 1e3,
    };
    let damping = &input["process_damping"];
    Milling {
        radius_mm,
        teeth: (0..count).map(tooth).collect(),
        edge_angle_rad: cutter["cutting_edge_angle_deg"].as_f64().unwrap_or(90.0).to_radians(),
        entry_rad: number(cut, "entry_deg").to_radians(),
        exit_rad: number(cut, "exit_deg").to_radians(),
        feed_mm: cut["feed_mm_per_tooth"].as_f64().unwrap_or(0.1),
        law: law(&input["force"]),
        depth_exponent: 0.0,
        rubbing: damping.is_object().then(|| Rubbing {
            coefficient_n_per_mm: number(damping, "coefficient_n_per_mm"),
            friction: number(damping, "friction"),
        }),
        about: About::SmoothChips,
    }
}

fn structure(input: &Value) -> Structure {
    let mode = |mode: &Value| {
        let given: Vec<f64> = mode["direction"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect();
        let length = given.iter().map(|x| x * x).sum::<f64>().sqrt();
        Mode {
            side: if mode["side"] == "tool" { Side::Tool } else { Side::Work },
            direction: std::array::from_fn(|i| given[i] / length),
            frequency_hz: number(mode, "frequency_hz"),
            damping_ratio: number(mode, "damping_ratio"),
            mass_kg: number(mode, "mass_kg"),
        }
    };
    Structure::new(input["modes"].as_array().unwrap().iter().map(mode).collect())
}

fn rotation(input: &Value, milling: &Milling) -> Rotation {
    let spindle_rpm = number(&input["cut"], "spindle_rpm");
    let variation = &input["speed_variation"];
    if !variation.is_object() {
        return Rotation::steady(spindle_rpm);
    }
    let frequency_hz = number(variation, "frequency_hz");
    let periods = |q: u32| TAU * spindle_rpm / 60.0 * f64::from(q) / frequency_hz / milling.period_rad();
    let modulations = (1..=8).find(|q| (periods(*q) - periods(*q).round()).abs() < 1e-9).unwrap();
    Rotation { spindle_rpm, amplitude: number(variation, "amplitude"), frequency_hz, modulations }
}

fn kind(name: &Value) -> Kind {
    match name.as_str().unwrap() {
        "hopf" => Kind::Hopf,
        "flip" => Kind::Flip,
        _ => Kind::Fold,
    }
}

/// Modulus to 1e-6, real and imaginary part to 2e-6 of it, and an error that is told is not less than what is off.
#[test]
fn multipliers_are_those_of_the_reference() {
    let orders = Orders::default();
    for case in cases("multipliers.json") {
        let (id, input, expected) = (&case["id"], &case["input"], &case["expected"]);
        let (milling, structure) = (milling(input), structure(input));
        let rotation = rotation(input, &milling);
        let depth_mm = number(&input["cut"], "depth_mm");
        let cut = Cut { milling: &milling, structure: &structure, rotation, depth_mm };
        let (found, error) = orders.with_error(&cut, &Unwatched).unwrap().unwrap();
        let modulus = number(expected, "modulus");
        let off = (found.modulus() - modulus).abs() / modulus;
        assert!(off < 1e-6, "{id}: {} for {modulus}", found.modulus());
        assert!(error < 1e-6 * modulus, "{id}: error {error}");
        assert_eq!(found.kind(), kind(&expected["kind"]), "{id}");
        assert!((found.re - number(expected, "re")).abs() < 2e-6 * modulus, "{id}: {found:?}");
        assert!((found.im - number(expected, "im")).abs() < 2e-6 * modulus, "{id}: {found:?}");
        let period = rotation.period_s(milling.period_rad());
        assert!((period - number(expected, "period_s")).abs() < 1e-12, "{id}: {period}");
    }
}

/// Every crossing to 1e-6 of its depth, none missed and none more, each certified between its ends.
#[test]
fn boundaries_are_those_of_the_reference() {
    let orders = Orders::default();
    for case in cases("boundaries.json") {
        let (id, input) = (&case["id"], &case["input"]);
        let (milling, structure) = (milling(input), structure(input));
        let cut = Cut { milling: &milling, structure: &structure, rotation: rotation(input, &milling), depth_mm: 1.0 };
        let deepest = case["scan"].as_array().unwrap().last().unwrap().as_f64().unwrap();
        let search = Search { depth_max_mm: deepest, steps: 24, only_first: false, on_map: false };
        let found = scan(&orders, &cut, &search, &Unwatched).unwrap().crossings;
        let expected = case["expected"]["crossings"].as_array().unwrap();
        assert_eq!(found.len(), expected.len(), "{id}: {found:?}");
        for (found, expected) in found.iter().zip(expected) {
            let depth = number(expected, "depth_mm");
            assert!((found.depth_mm - depth).abs() < 1e-6 * depth, "{id}: {} for {depth}", found.depth_mm);
            assert_eq!(found.enters, expected["enters"].as_bool().unwrap(), "{id}");
            assert_eq!(found.kind, kind(&expected["kind"]), "{id}");
            assert!(found.certified, "{id}: {found:?}");
        }
        assert_eq!(unstable(&found).len(), expected.iter().filter(|one| one["enters"] == true).count(), "{id}");
    }
}

#[test]
fn the_zeroth_order_is_that_of_the_reference() {
    for case in cases("zeroth-order.json") {
        let (id, input, expected) = (&case["id"], &case["input"], &case["expected"]);
        let (milling, structure) = (milling(input), structure(input));
        let found = zeroth(&milling, &structure).unwrap();
        let depth = number(expected, "depth_min_mm");
        assert!((found.depth_mm - depth).abs() < 1e-8 * depth, "{id}: {found:?} for {depth}");
        // Flat at the least depth: a frequency is known to the root of what the depth is known to.
        assert!((found.frequency_hz - number(expected, "frequency_hz")).abs() < 1e-3, "{id}: {found:?}");
        let mean = mean_stiffness(&milling);
        let given = |i: usize, j: usize| expected["mean_matrix"][i][j].as_f64().unwrap();
        let largest = (0..9).map(|k| given(k / 3, k % 3).abs()).fold(0.0, f64::max);
        for k in 0..9 {
            let off = (mean[k / 3][k % 3] - given(k / 3, k % 3)).abs();
            assert!(off < 1e-10 * largest, "{id}: {mean:?}");
        }
    }
}

/// Extremes of the forced motion and the error of the wall to 1e-6 of the swing, mean force to round-off.
#[test]
fn forced_motions_are_those_of_the_reference() {
    let orders = Orders::default();
    for case in cases("motion.json") {
        let (id, input, expected) = (&case["id"], &case["input"], &case["expected"]);
        let (milling, structure) = (milling(input), structure(input));
        let depth_mm = number(&input["cut"], "depth_mm");
        let cut = Cut { milling: &milling, structure: &structure, rotation: rotation(input, &milling), depth_mm };
        let forced = orders.forced(&cut, &Unwatched).unwrap().unwrap();
        let (low, high) = forced.extremes();
        for (q, name) in ["x", "y", "z"].iter().enumerate() {
            let given = ["min", "max"].map(|end| number(expected, &format!("{name}_{end}_um")));
            let swing = given[1] - given[0];
            for (found, given) in [low[q], high[q]].iter().zip(given) {
                assert!((1e3 * found - given).abs() <= 1e-6 * swing, "{id} {name}: {} for {given}", 1e3 * found);
            }
        }
        let force = statics(&milling, depth_mm, &Unwatched).unwrap();
        for q in 0..3 {
            let given = expected["mean_force_n"][q].as_f64().unwrap();
            assert!((force.mean_n[q] - given).abs() < 1e-9 * 1e3, "{id}: {:?}", force.mean_n);
        }
        let swing = number(expected, "y_max_um") - number(expected, "y_min_um");
        let walls = forced.walls();
        assert_eq!(walls.len(), usize::from(expected["sle_um"].is_array()), "{id}");
        for wall in walls {
            assert_eq!(wall == Wall::Up, number(&input["cut"], "entry_deg") < 1.0, "{id}");
            for (k, height) in expected["heights_mm"].as_array().unwrap().iter().enumerate() {
                let found = 1e3 * forced.surface_error_mm(wall, height.as_f64().unwrap());
                let given = expected["sle_um"][k].as_f64().unwrap();
                assert!((found - given).abs() < 1e-6 * swing, "{id} at {height}: {found} for {given}");
            }
            // Teeth that are alike leave arcs one feed apart.
            let feed = milling.feed_mm;
            let rz = forced.roughness(wall, 0.0).rz_mm;
            assert!((rz / (feed * feed / (8.0 * milling.radius_mm)) - 1.0).abs() < 1e-4, "{id}: {rz}");
        }
    }
}

/// The modulus of a case of the reference with something else made of it.
fn modulus(orders: &Orders, input: &Value, change: impl FnOnce(&mut Milling, &mut Vec<Mode>)) -> f64 {
    let (mut milling, mut modes) = (milling(input), structure(input).modes);
    change(&mut milling, &mut modes);
    let structure = Structure::new(modes);
    let rotation = rotation(input, &milling);
    let cut = Cut { milling: &milling, structure: &structure, rotation, depth_mm: number(&input["cut"], "depth_mm") };
    orders.multiplier(&cut, &Unwatched).unwrap().unwrap().modulus()
}

/// Numbering of the teeth, whose mode it is, which way a direction points and a mode in two halves do not matter.
#[test]
fn what_is_the_same_cut_has_the_same_multiplier() {
    let orders = Orders::default();
    for case in cases("multipliers.json") {
        let (id, input) = (&case["id"], &case["input"]);
        let plain = modulus(&orders, input, |_, _| ());
        let renumbered = modulus(&orders, input, |milling, _| milling.teeth.rotate_left(1));
        let swapped = modulus(&orders, input, |_, modes| {
            for mode in modes {
                mode.side = if mode.side == Side::Tool { Side::Work } else { Side::Tool };
                mode.direction = mode.direction.map(|x| -x);
            }
        });
        let halved = modulus(&orders, input, |_, modes| {
            modes[0].mass_kg *= 2.0;
            modes.push(modes[0]);
        });
        for (what, other) in [("renumbered", renumbered), ("swapped", swapped), ("halved", halved)] {
            assert!((other - plain).abs() < 1e-6 * plain, "{id} {what}: {other} for {plain}");
        }
    }
}

/// A helix of nothing and a pitch that is hardly uneven are near to straight and even teeth; over a turn the multiplier is that
/// of a tooth to the power of their number.
#[test]
fn small_differences_of_teeth_change_little() {
    let orders = Orders::default();
    for case in
        cases("multipliers.json").iter().filter(|case| ["M03", "M04", "M19"].iter().any(|id| case["id"] == **id))
    {
        let (id, input) = (&case["id"], &case["input"]);
        let plain = modulus(&orders, input, |_, _| ());
        let leaning = modulus(&orders, input, |milling, _| {
            milling.teeth.iter_mut().for_each(|tooth| tooth.lag_rad_per_mm = 1e-6);
        });
        assert!((leaning - plain).abs() < 1e-4 * plain, "{id}: {leaning} for {plain}");
        let uneven = modulus(&orders, input, |milling, _| {
            milling.teeth[0].pitch_rad += 1e-7;
            milling.teeth[1].pitch_rad -= 1e-7;
        });
        let turn = plain.powf(milling(input).teeth.len() as f64);
        assert!((uneven - turn).abs() < 1e-4 * turn, "{id}: {uneven} for {turn}");
    }
}
