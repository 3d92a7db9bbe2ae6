//! Programs that are given other feeds: what comes back is read and driven as any other program.
#![allow(clippy::unwrap_used, clippy::panic, clippy::cast_precision_loss, missing_docs)]

use precut_calc::calculator::{Answer, Calculator, Check, Failure, Violations};
use precut_calc::program_compensation::{Outcome, ProgramCompensation, RefedProgram};
use serde_json::{Value, json};

use crate::draw::Draw;
use crate::program_correction::{draws, off_from_told};
use crate::program_reading::number;
use crate::program_yielding::{DIALECTS, cases, job_of, shaft, try_solve};

/// Two programs of one part differ by what their numbers are rounded to, and by no more.
const SAME: f64 = 1e-9;

fn refed(answer: &Answer<Outcome>) -> &RefedProgram {
    answer.output.refeed.as_ref().unwrap()
}

fn text(answer: &Answer<Outcome>) -> &str {
    &answer.output.compensation.as_ref().unwrap().nc_program
}

/// A job that asks for feeds, with all limits that there are; `wide` ones bind nothing.
fn refeed(job: &Value, limits: &Value) -> Value {
    let mut job = job.clone();
    job["mode"] = json!({ "kind": "refeed" });
    job["refeed"] = json!({ "feed_min_mm_per_rev": 0.02, "feed_max_mm_per_rev": 0.6 });
    for (name, value) in limits.as_object().unwrap() {
        job["refeed"][name] = value.clone();
    }
    job
}

fn limits() -> Value {
    json!({
        "roughness_max_um": 2.5, "force_y_max_n": 400.0, "force_z_max_n": 900.0, "power_kw": 2.0,
        "efficiency": 0.8, "torque_n_m": 12.0, "tool_usage_max": 0.9, "feed_step_ratio_max": 1.6,
        "roughness": { "constant": 3.0, "speed_exponent": -0.1, "feed_exponent": 1.2, "depth_exponent": 0.05 },
        "tool_life": { "constant": 9.0, "speed_exponent": -1.5, "feed_exponent": -0.5, "depth_exponent": -0.2 },
    })
}

/// A share of what the lines that finish are pushed off at the feeds of the program.
fn deflection_um(job: &Value, share: f64) -> Value {
    let read = try_solve(&json_read(job)).unwrap();
    let (cuts, finishing) =
        (&read.output.yielding.as_ref().unwrap().cuts, &read.output.surface.as_ref().unwrap().finishing_lines);
    let is_it = |i: &usize| cuts.depth_mm[*i] > 1e-3 && finishing.contains(&cuts.line[*i]);
    let most = (0..cuts.line.len()).filter(is_it).map(|i| cuts.deflection_um[i].abs()).fold(0.0, f64::max);
    json!({ "deflection_max_um": share * most })
}

/// What the program at these feeds reaches of the limits, by a job that is not free to change them.
fn reached(job: &Value, program: &str) -> Result<Answer<Outcome>, Failure> {
    let mut again = job.clone();
    again["nc_program"] = json!(program);
    try_solve(&again)
}

/// A text without its feeds: words of F but those of threads and times.
fn without_feeds(line: &str) -> String {
    let bytes = line.as_bytes();
    let (mut kept, mut at, mut depth) = (String::new(), 0, 0);
    while at < bytes.len() {
        depth += i32::from(bytes[at] == b'(') - i32::from(bytes[at] == b')');
        if bytes[at] == b';' {
            kept.push_str(&line[at..]);
            break;
        }
        if depth == 0 && matches!(bytes[at], b'F' | b'f') {
            at += 1;
            while at < bytes.len() && (bytes[at].is_ascii_digit() || matches!(bytes[at], b'.' | b'=' | b'+')) {
                at += 1;
            }
            while kept.ends_with(' ') {
                kept.pop();
            }
            continue;
        }
        kept.push(bytes[at] as char);
        at += 1;
    }
    kept
}

fn assert_only_feeds_differ(given: &str, returned: &str) {
    let lines = |text: &str| text.split_inclusive('\n').map(str::to_owned).collect::<Vec<_>>();
    let (given, returned) = (lines(given), lines(returned));
    assert_eq!(given.len(), returned.len());
    for (old, new) in given.iter().zip(&returned) {
        assert!(old == new || without_feeds(old) == without_feeds(new), "{old}{new}");
    }
}

/// Every move is the one that it was, but for its feed.
fn assert_moves_are_kept(given: &Answer<Outcome>, returned: &Answer<Outcome>) {
    let (mut a, mut b) = (given.output.moves.clone(), returned.output.moves.clone());
    for moves in [&mut a, &mut b] {
        moves.feed_mm_per_rev.clear();
        moves.feed_mm_per_min.clear();
    }
    assert_eq!(a, b);
}

/// The feeds of a program as it is read, by the places of its moves.
fn feeds(answer: &Answer<Outcome>) -> Vec<(usize, Option<f64>)> {
    let moves = &answer.output.moves;
    (0..moves.line.len()).map(|i| (moves.line[i], moves.feed_mm_per_rev[i].or(moves.feed_mm_per_min[i]))).collect()
}

/// A program at the answer's feeds with one line a step faster, read and driven: what it leaves, limit by limit.
fn over_with_one_step_more(job: &Value, answer: &Answer<Outcome>, at: usize) -> bool {
    let feeds = &refed(answer).feeds;
    // Its own line says the feed, so that no other one goes faster.
    let mut lines: Vec<String> = text(answer).lines().map(str::to_owned).collect();
    let now = feeds.new_feed_mm_per_rev[at];
    let step = if now < 0.02 { 1e-4 } else { 1e-3 };
    let line = feeds.line[at] - 1;
    lines[line] = format!("{} F{:.4}", without_feeds(&lines[line]), now + step);
    if let Some(next) = feeds.line.get(at + 1).filter(|next| !lines[**next - 1].contains('F')) {
        let own = feeds.new_feed_mm_per_rev[at + 1];
        lines[next - 1] = format!("{} F{own:.4}", lines[next - 1]);
    }
    let mut again = job.clone();
    again["nc_program"] = json!(lines.join("\n") + "\n");
    let given = &job["refeed"];
    let driven = try_solve(&json_read(&again)).unwrap();
    let cuts = &driven.output.yielding.as_ref().unwrap().cuts;
    let most = |column: &[f64]| {
        let of_line = (0..cuts.line.len()).filter(|&i| cuts.line[i] == feeds.line[at] && cuts.depth_mm[i] > 1e-3);
        of_line.map(|i| column[i].abs()).fold(0.0, f64::max)
    };
    most(&cuts.deflection_um) > given["deflection_max_um"].as_f64().unwrap()
}

fn json_read(job: &Value) -> Value {
    let mut job = job.clone();
    job["mode"] = json!({ "kind": "read" });
    job
}

/// Programs of every control, whatever binds: only feeds differ, the part stays, no limit is passed when what comes back is driven as
/// a program of its own, and the same feeds come of every control.
#[test]
fn programs_of_every_control_are_given_feeds_within_all_limits() {
    let (mut faster, mut impossible) = (0, 0);
    for seed in 0..draws(2) {
        let mut in_all: Option<Vec<f64>> = None;
        for dialect in DIALECTS {
            let given = shaft(&mut Draw::new(3000 + seed), dialect);
            let mut all = limits();
            all["deflection_max_um"] = deflection_um(&given, 0.9)["deflection_max_um"].clone();
            let job = refeed(&given, &all);
            let answer = match try_solve(&job) {
                Ok(answer) => answer,
                // A few are drawn that no feed can do.
                Err(Failure::Conflicting(_)) => {
                    impossible += 1;
                    continue;
                }
                Err(e) => panic!("{dialect} {seed}: {e:?}"),
            };
            assert_only_feeds_differ(given["nc_program"].as_str().unwrap(), text(&answer));
            assert_moves_are_kept(
                &answer,
                &try_solve(&json_read(&{
                    let mut again = job.clone();
                    again["nc_program"] = json!(text(&answer));
                    again
                }))
                .unwrap(),
            );
            let refed = refed(&answer);
            let feeds = refed.feeds.old_feed_mm_per_rev.iter().zip(&refed.feeds.new_feed_mm_per_rev);
            faster += feeds.filter(|(old, new)| new > old).count();
            assert!(!refed.limits.is_empty() && refed.kept_lines.is_empty());
            for limit in &refed.limits {
                assert!(limit.reached <= limit.limit * (1.0 + SAME), "{dialect} {seed}: {limit:?}");
            }
            let all = in_all.get_or_insert_with(|| refed.feeds.new_feed_mm_per_rev.clone());
            assert_eq!(all, &refed.feeds.new_feed_mm_per_rev, "{dialect} {seed}");
        }
    }
    assert!(faster > 0 && 10 * impossible <= DIALECTS.len() as u64 * draws(2), "{impossible}");
}

/// The program that comes back, asked for feeds again, reaches what was told and gets no others but a step.
#[test]
fn what_comes_back_is_driven_as_it_is_told() {
    for seed in 0..draws(3) {
        let given = shaft(&mut Draw::new(3100 + seed), "fanuc_a");
        let job = refeed(&given, &deflection_um(&given, 0.9));
        let most_um = job["refeed"]["deflection_max_um"].as_f64().unwrap();
        let answer = try_solve(&job).unwrap();
        let told = refed(&answer);
        let driven = reached(&json_read(&job), text(&answer)).unwrap();
        let cuts = &driven.output.yielding.as_ref().unwrap().cuts;
        let along = |i: &usize| cuts.depth_mm[*i] > 1e-3;
        for at in (0..told.feeds.line.len()).filter(|&at| told.feeds.is_finishing[at]) {
            let places = (0..cuts.line.len()).filter(along).filter(|&i| cuts.line[i] == told.feeds.line[at]);
            let is_face = (told.feeds.z_start_mm[at] - told.feeds.z_end_mm[at]).abs() < 1e-9;
            let most = places.map(|i| cuts.deflection_um[i].abs()).fold(0.0, f64::max);
            assert!(is_face || most <= most_um * (1.0 + SAME), "{seed} {at}: {most}");
        }
        let again = reached(&job, text(&answer)).unwrap();
        for (a, b) in told.feeds.new_feed_mm_per_rev.iter().zip(&refed(&again).feeds.new_feed_mm_per_rev) {
            assert!((a - b).abs() < 1.5e-3, "{seed}: {a} {b}");
        }
    }
}

/// One step more passes the limit that is said to bind.
#[test]
fn one_step_more_passes_what_binds() {
    let mut tried = 0;
    for seed in 0..draws(3) {
        let given = shaft(&mut Draw::new(3200 + seed), "fanuc_a");
        let job = refeed(&given, &deflection_um(&given, 0.9));
        let answer = try_solve(&job).unwrap();
        let feeds = &refed(&answer).feeds;
        for at in 0..feeds.line.len() {
            if feeds.binding[at] == ["deflection"] {
                assert!(over_with_one_step_more(&job, &answer, at), "{seed} {at}");
                tried += 1;
            } else {
                assert_eq!(feeds.binding[at], ["feed_max"], "{seed} {at}");
                assert!((feeds.new_feed_mm_per_rev[at] - 0.6).abs() < SAME);
            }
        }
    }
    assert!(tried > 2, "{tried}");
}

/// A limit that is loosened by a tenth takes off the time what its price, the exponent of the time, says, but for whole steps of the
/// feed: a thousandth of a millimetre is about a percent of these feeds.
#[test]
fn a_looser_limit_brings_what_its_price_says() {
    let mut tried = 0;
    for seed in 0..draws(2) {
        let given = shaft(&mut Draw::new(3300 + seed), "fanuc_a");
        for (limits, constraint, field) in [
            (deflection_um(&given, 0.7), "deflection", "deflection_max_um"),
            (json!({ "force_z_max_n": 450.0 }), "force_z", "force_z_max_n"),
        ] {
            let job = refeed(&given, &limits);
            let Ok(answer) = try_solve(&job) else { continue };
            let told = refed(&answer);
            let Some(price) = told.prices.iter().find(|price| price.constraint == constraint) else { continue };
            let mut looser = job.clone();
            looser["refeed"][field] = json!(1.1 * limits[field].as_f64().unwrap());
            let after = try_solve(&looser).unwrap();
            let brought = 100.0 * (1.0 - refed(&after).cutting_time_after_min / told.cutting_time_after_min);
            let told = 100.0 * (1.0 - 1.1_f64.powf(-price.gain_percent));
            assert!((brought - told).abs() < 1.2, "{seed} {field}: told {told}, brought {brought}");
            tried += 1;
        }
    }
    assert!(tried > 1, "{tried}");
}

/// A bar on which one line cuts, whatever it says.
fn bar(program: &str) -> Value {
    let mut job = shaft(&mut Draw::new(950), "fanuc_a");
    job["nc_program"] = json!(program);
    job["program_zero_z_mm"] = json!(300);
    job["stock"]["profile"] = json!([{ "z_mm": 0, "diameter_mm": 30 }, { "z_mm": 300, "diameter_mm": 30 }]);
    job["supports"][1]["z_mm"] = json!(300);
    job
}

/// The feed that a block behind the cut relied on is put back; what no block relies on is not.
#[test]
fn the_old_feed_is_put_back_where_it_was_relied_on() {
    let given = "G21 G18 G40 G99\nT0101\nG97 S800 M3\nG0 X32. Z2.\nX28.\nG1 Z-100. F0.2 (cut)\nX31. ;out\nX40.\nZ2.\n\
                 G0 X26.\nG1Z-50.(second)\nG0 X32.\nM30\n";
    let answer = try_solve(&refeed(&bar(given), &json!({ "feed_max_mm_per_rev": 0.35 }))).unwrap();
    let lines: Vec<&str> = text(&answer).lines().collect();
    assert_eq!(lines[5], "G1 Z-100. F0.35 (cut)");
    // Along the wall that stands there it cuts nothing, and goes as it did.
    assert_eq!((lines[6], lines[7], lines[8]), ("X31.F0.2 ;out", "X40.", "Z2."));
    assert_eq!(lines[10], "G1Z-50.F0.35(second)");
    assert_eq!(answer.output.compensation.as_ref().unwrap().lines_changed, [6, 7, 11]);
    let back = reached(&json_read(&bar(given)), text(&answer)).unwrap();
    let of = |line: usize| feeds(&back).into_iter().find(|(at, _)| *at == line).unwrap().1.unwrap();
    for (line, feed) in [(6, 0.35), (7, 0.2), (8, 0.2), (9, 0.2), (11, 0.35)] {
        assert!((of(line) - feed).abs() < SAME, "{line}");
    }
}

/// A cycle that is passed keeps the feed that it relied on; a call of Siemens takes no word, and says so.
#[test]
fn passed_cycles_keep_their_feed() {
    let given = "G21 G18 G40 G99\nT0101\nG97 S800 M3\nG0 X32. Z2.\nX28.\nG1 Z-100. F0.2\nG0 X32.\nG75 R0.5\nG75 X20. P2000 (groove)\n\
                 G0 X40.\nM30\n";
    let mut job = refeed(&bar(given), &json!({ "feed_max_mm_per_rev": 0.35 }));
    job["reading"] = json!({ "decimal_point": "as_increments" });
    let answer = try_solve(&job).unwrap();
    let lines: Vec<&str> = text(&answer).lines().collect();
    assert_eq!((lines[5], lines[7], lines[8]), ("G1 Z-100. F0.35", "G75 R0.5 F0.2", "G75 X20. P2000 (groove)"));
    let siemens = |own: &str| {
        format!(
            "G710 G18 G40 G90 G95 DIAMON\nT1 D1\nG97 S800 M3\nG0 X32 Z2\nX28\nG1 Z-100 F0.2\nG0 X32\n{own}CYCLE93(30,-20,3,2)\n\
             G0 X40 Z5\nM30\n"
        )
    };
    let mut job = refeed(&bar(&siemens("")), &json!({ "feed_max_mm_per_rev": 0.35 }));
    job["dialect"] = json!("siemens");
    let Err(Failure::OutOfModel(finding)) = try_solve(&job) else { panic!("a feed was lost") };
    assert_eq!((finding.code, number(&finding, "line") as usize), ("feed_not_put_back", 8));
    job["nc_program"] = json!(siemens("F0.2\n"));
    assert!(text(&try_solve(&job).unwrap()).contains("G1 Z-100 F0.35\nG0 X32\nF0.2\nCYCLE93"));
}

/// Feeds per minute, in inches and in increments are written in the form that they have; a cycle has one for all its passes.
#[test]
fn feeds_keep_their_form() {
    let cut = |head: &str, line: &str| format!("{head}\nT0101\nG97 S800 M3\nG0 X32. Z2.\n{line}\nG0 X40.\nM30\n");
    for (head, line, expected) in [
        ("G21 G18 G40 G98", "G0 X28.\nG1 Z-100. F100.", "G1 Z-100. F240."),
        ("G21 G18 G40 G99", "G0 X28.\nG1 Z-100. F.10", "G1 Z-100. F.30"),
        ("G21 G18 G40 G99", "G90 X28. Z-100. F0.1\nX26.", "G90 X28. Z-100. F0.3"),
    ] {
        let given = cut(head, line);
        let answer = try_solve(&refeed(&bar(&given), &json!({ "feed_max_mm_per_rev": 0.3 }))).unwrap();
        assert!(text(&answer).contains(expected), "{}", text(&answer));
        assert_only_feeds_differ(&given, text(&answer));
        assert_eq!(answer.output.compensation.as_ref().unwrap().lines_changed.len(), 1);
    }
    let mut job = bar(&cut("G21 G18 G40 G99", "G0 X28000\nG1 Z-100000 F10")
        .replace("X32. Z2.", "X32000 Z2000")
        .replace("X40.", "X40000"));
    job["reading"] = json!({ "decimal_point": "as_increments" });
    let answer = try_solve(&refeed(&job, &json!({ "feed_max_mm_per_rev": 0.3 }))).unwrap();
    assert!(text(&answer).contains("G1 Z-100000 F30\n"), "{}", text(&answer));
}

/// First the feeds, then X: the lines that change are told against the given program.
#[test]
fn both_changes_come_together() {
    let given = job_of(&cases()[1]["job"]);
    let mut job = refeed(&given, &json!({ "deflection_max_um": 12.0 }));
    job["mode"]["kind"] = json!("both");
    let answer = try_solve(&job).unwrap();
    let compensation = answer.output.compensation.as_ref().unwrap();
    assert!(compensation.proof.unwrap().largest_residual_um <= 1.5);
    let original: Vec<&str> = given["nc_program"].as_str().unwrap().lines().collect();
    for change in &compensation.changes {
        assert_eq!(change.old, original[change.line - 1]);
    }
    let (worst, compared) = off_from_told(&job, compensation);
    assert!(worst < 0.15 && compared > 30, "{worst}, {compared}");
    let alone = try_solve(&refeed(&given, &json!({ "deflection_max_um": 12.0 }))).unwrap();
    assert_eq!(refed(&alone).feeds, refed(&answer).feeds);
    assert!(refed(&alone).prices.iter().any(|price| price.gain_percent > 0.0));
}

/// Limits that cannot hold together are told with the lines where they do not.
#[test]
fn a_conflict_names_its_lines() {
    let job = refeed(
        &bar("G21 G18 G40 G99\nT0101\nG97 S800 M3\nG0 X32. Z2.\nX26.\nG1 Z-250. F0.2\nG0 X40.\nM30\n"),
        &json!({ "deflection_max_um": 0.5, "feed_min_mm_per_rev": 0.1 }),
    );
    let Err(Failure::Conflicting(conflict)) = try_solve(&job) else { panic!("no conflict") };
    assert_eq!((conflict.finding.code, conflict.finding.pointer.as_str()), ("infeasible_schedule", "/refeed"));
    let names: Vec<(&str, &str)> =
        conflict.infeasible.conflict_set.iter().map(|one| (one.constraint.as_str(), one.zone.as_str())).collect();
    assert!(names.contains(&("deflection", "6")) && names.contains(&("feed_min", "6")), "{names:?}");
    // The relaxation that is told makes feeds possible.
    let factor = conflict.infeasible.relaxations[0].factor;
    let mut looser = job.clone();
    looser["refeed"]["deflection_max_um"] = json!(0.5 * factor * 1.01);
    assert!(try_solve(&looser).is_ok(), "{factor}");
}

/// Codes of the faults of a job.
fn faults(job: &Value) -> Vec<&'static str> {
    let parsed: <ProgramCompensation as Calculator>::Input = serde_json::from_value(job.clone()).unwrap();
    let mut violations = Violations::default();
    parsed.check(&mut violations);
    violations.into_vec().into_iter().map(|fault| fault.code).collect()
}

#[test]
fn limits_have_what_they_need() {
    let job = shaft(&mut Draw::new(950), "fanuc_a");
    let mut without = refeed(&job, &json!({}));
    without.as_object_mut().unwrap().remove("refeed");
    assert_eq!(faults(&without), ["refeed_missing"]);
    for (limits, code) in [
        (json!({ "roughness_max_um": 1.6 }), "refeed_needs_model"),
        (json!({ "tool_usage_max": 1.0 }), "refeed_needs_model"),
        (json!({ "feed_max_mm_per_rev": 0.02 }), "refeed_limits_cross"),
        (json!({ "tool_life": { "form": "semi_log", "constant": 60.0 } }), "refeed_needs_power_law"),
    ] {
        assert_eq!(faults(&refeed(&job, &limits)), [code]);
    }
    let mut passive = refeed(&job, &json!({ "power_kw": 5.0 }));
    passive["force"] = json!({ "kind": "power_law", "passive": { "coefficient": 800.0, "depth_exponent": 0.9, "feed_exponent": 0.6 } });
    assert_eq!(faults(&passive), ["refeed_needs_main_force"]);
}
