//! Published turning benchmarks, solved: the comparison tables of the documentation, and that each optimum is one.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use crate::feed_support::{near, of_zone, reference, solved, translate};
use precut_calc::num::gp::{self, Affines, Objective, Program, Settings};
use serde_json::{Value, json};

/// The page has this line.
fn documented(line: &str) {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/..", "/../../docs/physics/feed-schedule.md");
    let page = std::fs::read_to_string(path).unwrap();
    assert!(page.lines().any(|known| known == line), "docs/physics/feed-schedule.md lacks the line\n{line}");
}

#[test]
fn turning_economics_of_ermer() {
    let file = reference("benchmark-ermer-rao.json");
    let mut lines = Vec::new();
    for (case, limits) in file["cases"].as_array().unwrap().iter().zip([
        "feed <= 0.005 in/rev",
        "and power <= 10 hp",
        "feed <= 0.01 in/rev, power <= 10 hp, finish <= 100 uin",
    ]) {
        let outcome = solved(translate(&case["input"]));
        let feet = of_zone(&outcome, "z1", "speed_m_per_min") / 0.3048;
        let inches = of_zone(&outcome, "z1", "feed_mm_per_rev") / 25.4;
        // The source's own laws, in its own units, so that feasibility is seen without the translation.
        let power_hp = 3.58 * feet.powf(0.91) * inches.powf(0.78);
        let finish = 1.36e8 * feet.powf(-1.52) * inches.powf(1.004);
        let published = &case["published"];
        lines.push(format!(
            "| {limits} | ${:.2} at {} ft/min, {} in/rev | ${:.4} at {feet:.2} ft/min, {inches:.6} in/rev | {power_hp:.3} hp, {finish:.2} uin |",
            published["cost_usd"].as_f64().unwrap(),
            published["speed_ft_per_min"],
            published["feed_in_per_rev"],
            outcome.objective,
        ));
        assert!(power_hp < 10.0 * (1.0 + 1e-6) || limits == "feed <= 0.005 in/rev");
    }
    for line in &lines {
        documented(line);
    }
}

/// A job of the multi-pass benchmark: lives of at least these, no upper limit on them; time is least.
fn two_passes(life_rough: f64, life_finish: f64) -> Value {
    let file = reference("benchmark-chen-tsai-1996.json");
    let mut job = translate(&file["per_pass_wear"]["cases"][0]["input"]);
    let custom = job["custom"].as_array_mut().unwrap();
    let band = custom.iter().position(|limit| limit["name"] == "tool_life_band").unwrap();
    let mut life = custom.remove(band);
    life.as_object_mut().unwrap().remove("max");
    for (zone, least) in [("rough", life_rough), ("finish", life_finish)] {
        life["zone"] = json!(zone);
        life["min"] = json!(least);
        custom.push(life.clone());
    }
    job["objective"] = json!({ "kind": "time" });
    job
}

/// The cost that is published weighs the tool lives of both passes; for given least lives it falls with the time, so the
/// optimum is that of a scan over both lives with a geometric program at each point.
#[test]
fn two_passes_of_chen_and_tsai_with_the_weighted_tool_life() {
    let cost = |time: f64, mean: f64| {
        0.5 * time + 0.5 * (0.75 + (0.0007 * 300.0 + 0.3) * 2.0) + (0.5 * 1.5 + 2.5) * time / mean
    };
    let steps = 8;
    let lives: Vec<f64> = (0..=steps).map(|k| 25.0 + 20.0 * f64::from(k) / f64::from(steps)).collect();
    let mut times = Vec::new();
    for &rough in &lives {
        for &finish in &lives {
            times.push((rough, finish, solved(two_passes(rough, finish)).cutting_time_min));
        }
    }
    for (name, theta, expected) in [("1/2", 0.5, 2.062_059), ("2/3", 2.0 / 3.0, 2.046_028), ("0.8", 0.8, 2.035_080)] {
        let best = times
            .iter()
            .map(|&(rough, finish, time)| (cost(time, theta * rough + (1.0 - theta) * finish), rough, finish))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .unwrap();
        near("cost", best.0, expected, 1e-5, 0.0);
        assert_eq!((best.1.to_bits(), best.2.to_bits()), (45.0_f64.to_bits(), 25.0_f64.to_bits()), "theta {name}");
        let outcome = solved(two_passes(best.1, best.2));
        let of = |zone: &str, name: &str| of_zone(&outcome, zone, name);
        let (vr, fr) = (of("rough", "speed_m_per_min"), of("rough", "feed_mm_per_rev"));
        let (vs, fs) = (of("finish", "speed_m_per_min"), of("finish", "feed_mm_per_rev"));
        // No life above the band's upper end, which the scan left out.
        assert!(of("rough", "tool_life_min") < 45.0 * (1.0 + 1e-6) && of("finish", "tool_life_min") < 45.0);
        if name == "2/3" {
            documented(&format!(
                "| weighted tool life, theta = {name} | $2.046 at V_r 109.6631, f_r 0.565, V_s 169.9783, f_s 0.2262 | ${:.5} at {vr:.4}, {fr:.5}, {vs:.4}, {fs:.5} |",
                best.0
            ));
            for (limit, value, most) in limits(vr, fr, vs, fs, 3.0) {
                documented(&format!("| {limit} | {value:.4} | {most} |"));
            }
        }
    }
}

/// The source's limits in its own units.
fn limits(vr: f64, fr: f64, vs: f64, fs: f64, d: f64) -> Vec<(&'static str, f64, &'static str)> {
    let force = |f: f64| 108.0 * f.powf(0.75) * d.powf(0.95);
    let power = |v: f64, f: f64| force(f) * v / (6120.0 * 0.85);
    let life = |v: f64, f: f64| 6e11 / (v.powi(5) * f.powf(1.75) * d.powf(0.75));
    let heat = |v: f64, f: f64| 132.0 * v.powf(0.4) * f.powf(0.2) * d.powf(0.105);
    vec![
        ("force, roughing, kgf", force(fr), "<= 200"),
        ("force, finishing, kgf", force(fs), "<= 200"),
        ("power, roughing, kW", power(vr, fr), "<= 5"),
        ("power, finishing, kW", power(vs, fs), "<= 5"),
        ("tool life, roughing, min", life(vr, fr), "25 to 45"),
        ("tool life, finishing, min", life(vs, fs), "25 to 45"),
        ("stable cutting V^2 f/d, roughing", vr * vr * fr / d, ">= 140"),
        ("stable cutting V^2 f/d, finishing", vs * vs * fs / d, ">= 140"),
        ("chip temperature, roughing, degC", heat(vr, fr), "<= 1000"),
        ("chip temperature, finishing, degC", heat(vs, fs), "<= 1000"),
        ("finish, um", 1000.0 * fs * fs / (8.0 * 1.2), "<= 10"),
        ("f_r/f_s", fr / fs, ">= 2.5"),
        ("V_s/V_r", vs / vr, ">= 1"),
    ]
}

/// Wear that adds up pass by pass: the cost that a shop pays.
#[test]
fn passes_of_chen_and_tsai_with_wear_that_adds_up() {
    let file = reference("benchmark-chen-tsai-1996.json");
    for case in file["per_pass_wear"]["cases"].as_array().unwrap() {
        let outcome = solved(translate(&case["input"]));
        let of = |zone: &str, name: &str| of_zone(&outcome, zone, name);
        documented(&format!(
            "| wear adds up, {} mm, {} roughing | none | ${:.5} at {:.4}, {:.5}, {:.4}, {:.5} |",
            case["total_depth_mm"],
            case["rough_passes"],
            outcome.objective,
            of("rough", "speed_m_per_min"),
            of("rough", "feed_mm_per_rev"),
            of("finish", "speed_m_per_min"),
            of("finish", "feed_mm_per_rev")
        ));
        // T = (p - 1)(t_e + k_t/k_o), the economic tool life, in closed form.
        near("economic life", of("rough", "tool_life_min"), 4.0 * (1.5 + 2.5 / 0.5), 1e-5, 0.0);
    }
}

/// Quiza Sardinas: ln v, ln f, ln a; time against tool use.
fn pass_of_quiza(tool_use_max_percent: Option<f64>) -> Program {
    let rate = |entries: &[(usize, f64)], constant: f64| (entries.to_vec(), constant);
    let volume = 219_912.0_f64;
    let life = rate(&[(0, -3.46), (1, -0.696), (2, -0.46)], 5.48e9_f64.ln());
    let force = rate(&[(0, -0.286), (1, 0.917), (2, 1.10)], 6.56e3_f64.ln());
    let mut rows = Affines::new();
    let mut limit =
        |(entries, constant): &(Vec<(usize, f64)>, f64), most: f64| rows.push(entries, constant - most.ln());
    limit(&force, 5000.0);
    limit(&rate(&[(0, 1.0 - 0.286), (1, 0.917), (2, 1.10)], force.1 - 60_000.0_f64.ln()), 7.5);
    limit(&rate(&[(1, 2.0)], (125.0_f64 / 0.8).ln()), 50.0);
    for (variable, low, high) in [(0, 250.0_f64, 400.0_f64), (1, 0.15, 0.55), (2, 0.5, 6.0)] {
        limit(&rate(&[(variable, 1.0)], 0.0), high);
        limit(&rate(&[(variable, -1.0)], low.ln()), 1.0);
    }
    // 1/MRR and 1/(MRR T).
    let cutting = rate(&[(0, -1.0), (1, -1.0), (2, -1.0)], (volume / 1000.0).ln());
    let wear = rate(&[(0, 3.46 - 1.0), (1, 0.696 - 1.0), (2, 0.46 - 1.0)], cutting.1 - life.1);
    if let Some(most) = tool_use_max_percent {
        limit(&wear, most / 100.0);
    }
    let mut objective = Affines::new();
    objective.push(&cutting.0, cutting.1);
    objective.push(&wear.0, wear.1 + 0.2_f64.ln());
    Program {
        local: 0,
        common: 3,
        objective: Objective::Sum(objective),
        rows,
        sums: Vec::new(),
        start: vec![310.0_f64.ln(), 0.3_f64.ln(), 1.7_f64.ln()],
    }
}

#[test]
fn time_against_tool_use_of_quiza() {
    let file = reference("benchmark-quiza-2006.json");
    for point in file["pareto"].as_array().unwrap() {
        let solution =
            gp::minimise(&pass_of_quiza(point["tool_use_max_percent"].as_f64()), &Settings::default()).unwrap();
        assert!(solution.gap < 1e-9 && solution.dual_residual < 1e-6 && solution.primal_residual < 1e-9);
        let [v, f, a] = [0, 1, 2].map(|k: usize| solution.y[k].exp());
        let expected = |key: &str| point[key].as_f64().unwrap();
        let time = 0.2 + solution.objective.exp();
        near("time", time, expected("time_min"), 1e-5, 0.0);
        let life = 5.48e9 * v.powf(-3.46) * f.powf(-0.696) * a.powf(-0.46);
        let tool_use = 100.0 * 219_912.0 / (1000.0 * v * f * a * life);
        let force = 6.56e3 * f.powf(0.917) * a.powf(1.10) * v.powf(-0.286);
        let power = v * force / 60_000.0;
        for (name, value, key) in [
            ("v", v, "v"),
            ("f", f, "f"),
            ("a", a, "a"),
            ("tool use", tool_use, "tool_use_percent"),
            ("force", force, "force_N"),
            ("power", power, "power_kW"),
        ] {
            near(name, value, expected(key), 1e-5, 0.0);
        }
        let asked = point["tool_use_max_percent"].as_f64().map_or("none".to_owned(), |most| format!("{most}"));
        let rough = 125.0 * f * f / 0.8;
        documented(&format!(
            "| {asked} | {time:.6} | {v:.3}, {f:.3}, {a:.4} | {tool_use:.3} | {force:.1} | {power:.3} | {rough:.2} |"
        ));
    }
}
