//! Plans of two stages, done as two jobs; and what a search says of machines that give by stiffness, or whose rollers run out.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use crate::ring_support::{as_job, run};
use precut_calc::ring_roundness::{SearchOutcome, SearchSetting, SearchStatus};
use serde_json::{Value, json};

/// Roundness and its error of a stage as a job; with the profile that it leaves.
fn done(job: &Value, stage: &SearchSetting, before: Option<Value>) -> (f64, f64, Value) {
    let mut staged = as_job(job, stage);
    staged["profile_points"] = json!(3600);
    if let Some(rows) = before {
        staged.as_object_mut().unwrap().remove("ring");
        staged["measured_profile"] = rows;
    }
    let outcome = run(&staged).output;
    let profile = &outcome.simulation.as_ref().unwrap().profile;
    let rows = profile.angle_deg.iter().zip(&profile.end_radius_mm);
    let rows: Vec<Value> = rows.map(|(angle, radius)| json!({ "angle_deg": angle, "radius_mm": radius })).collect();
    (outcome.roundness_um.unwrap(), outcome.roundness_error_um.unwrap(), rows.into())
}

/// A blank of which no single setting within these limits takes both the three lobes and the large ovality in time.
fn hard(target_um: f64) -> Value {
    json!({
        "ring": { "radius_mm": 150, "ellipticity_mm": 0.5, "harmonics": [{ "order": 3, "amplitude_um": 25 }] },
        "supports": { "distance_mm": 200, "depth_mm": 111 },
        "tool": { "x_mm": 100, "y_mm": 113, "feed_mm_per_rev": 0.02, "revolutions": 40 },
        "samples": 3600, "analyses": ["settings_search"],
        "settings_search": {
            "target_um": target_um, "revolutions_max": 60, "feed_min_mm_per_rev": 0.004, "support_angle_from_deg": 18
        }
    })
}

fn search(job: &Value) -> SearchOutcome {
    run(job).output.settings_search.unwrap()
}

#[test]
fn two_stages_done_one_after_the_other_leave_what_is_promised() {
    let mut job = hard(1.5);
    job["settings_search"]["revolutions_max"] = json!(40);
    let found = search(&job);
    let stages = found.second_stage.unwrap_or_else(|| panic!("{:?} {:?}", found.status, found.best));
    let (first_um, first_error_um, left) = done(&job, &stages.first, None);
    let said = &stages.first;
    assert!(
        (first_um - said.roundness_um).abs() <= 0.01 + first_error_um.min(said.roundness_error_um),
        "{first_um} {said:?}"
    );
    let (both_um, _, _) = done(&job, &stages.second, Some(left));
    let said = &stages.second;
    assert!((both_um - said.roundness_um).abs() <= 0.02 + said.roundness_error_um, "{both_um} {said:?}");
    assert!(both_um < 0.8 * first_um);
    assert_eq!(found.status == SearchStatus::TwoStages, said.margin_um >= 0.0, "{found:?}");
}

/// Where the machine gives by its stiffness, an advised place is one at which it gives as the search has counted.
#[test]
fn an_advised_place_gives_as_the_stiffness_of_the_job_says() {
    let mut job = hard(30.0);
    job["ring"] = json!({ "radius_mm": 150, "harmonics": [{ "order": 3, "amplitude_um": 25 }] });
    job["stiffness"] = json!({ "cut_n_per_mm": 8000, "tool_n_per_mm": 40_000, "support_a_n_per_mm": 30_000, "support_b_n_per_mm": 60_000 });
    let best = search(&job).best.unwrap();
    let mut advised = as_job(&job, &best);
    advised["compliance_ratio"] = json!(0);
    let outcome = run(&advised).output;
    assert!((outcome.setting.compliance_ratio - best.compliance_ratio).abs() < 1e-6, "{best:?} {:?}", outcome.setting);
    let off = (outcome.roundness_um.unwrap() - best.roundness_um).abs();
    assert!(off <= 0.02 + best.roundness_error_um, "{off} {best:?}");
}

/// Run-out of the rollers, tried: opposite to a support it is copied, and the share says so.
#[test]
fn rollers_that_run_out_make_a_setting_less_robust() {
    let mut job = hard(4.0);
    job["ring"] = json!({ "radius_mm": 150, "ellipticity_mm": 0.1 });
    job["supports"] = json!({ "distance_mm": 240.9, "depth_mm": 133.8, "roller_radius_mm": 30 });
    job["tool"]["y_mm"] = json!(112.0);
    let share = |runout_um: f64| {
        let mut job = job.clone();
        job["settings_search"]["roller_runout_um"] = json!(runout_um);
        job["settings_search"]["angle_error_deg"] = json!(0.02);
        search(&job).best.unwrap().robust_share
    };
    let (true_running, out) = (share(0.0), share(20.0));
    assert!(true_running > 0.9 && out < 0.5, "{true_running} {out}");
}

/// A machine whose supports are too far apart for this ring has settings all the same.
#[test]
fn nothing_is_called_unreachable_before_all_angles_were_searched() {
    let mut job = hard(12.0);
    // The job's own supports drop the ring before the tool comes to its depth.
    job["ring"] = json!({ "radius_mm": 100.4, "harmonics": [{ "order": 2, "amplitude_um": 20 }] });
    job["supports"] = json!({ "distance_mm": 193.5, "depth_mm": 20 });
    job["tool"] = json!({ "x_mm": 0, "y_mm": 107.5, "feed_mm_per_rev": 0.01, "revolutions": 1 });
    job["settings_search"]["allowance_mm"] = json!(4);
    job["settings_search"]["revolutions_max"] = json!(400);
    job["settings_search"]["feed_max_mm_per_rev"] = json!(0.05);
    let found = search(&job);
    assert!(found.simulated > 0, "{found:?}");
}
