//! Programs that come where no tool may: jaws, and a centre while it is there.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use precut_calc::calculator::{Calculator, Check, Violations};
use precut_calc::program_compensation::ProgramCompensation;
use serde_json::{Value, json};

use crate::program_correction::{bar, codes, compensate, compensation};
use crate::program_reading::number;
use crate::program_yielding::try_solve;

/// A tool that comes where none may is told with its line, and nothing is corrected until it stays out.
#[test]
fn a_program_that_runs_into_the_jaws_is_not_corrected() {
    let program = "G21 G18 G40 G99\nT0101\nG97 S800 M3\nG0 X32. Z2.\nX26.\nG1 Z-290. F0.1\nG0 X100.\nM30\n";
    let mut job = bar(program, "fanuc_a");
    job["keep_out"] = json!([{ "z_start_mm": 0, "z_end_mm": 15, "diameter_mm": 120 }]);
    let answer = try_solve(&compensate(&job)).unwrap();
    assert!(answer.output.compensation.is_none());
    let hit = answer.warnings.iter().find(|warning| warning.code == "hits_support").unwrap();
    assert!(hit.value.unwrap() > 40.0, "{hit:?}");
    assert!(codes(&answer).contains(&"program_unsafe"));
    job["nc_program"] = json!(program.replace("Z-290.", "Z-284."));
    let answer = try_solve(&compensate(&job)).unwrap();
    assert!(!codes(&answer).contains(&"hits_support"));
    assert!(!compensation(&answer).lines_changed.is_empty());
}

/// A centre stands in the way while it acts, and a tool reaches no farther than its edges.
#[test]
fn a_centre_is_in_the_way_while_it_acts() {
    let program = "G21 G18 G40 G99\nT0101\nG97 S800 M3\nG0 X32. Z-1.\nG1 X12. F0.1\nG0 X50.\nG0 X26. Z2.\nG1 Z-250.\nG0 X100.\nM30\n";
    let mut job = bar(program, "fanuc_a");
    // The point of the centre, and its sleeve 30 mm behind it; the trailing edge leans by 5 degrees.
    job["tools"][0]["minor_edge_angle_deg"] = json!(5);
    job["tools"][0]["edge_length_mm"] = json!(12);
    job["support_lines"] = json!([{ "support": 1, "from_line": 7 }]);
    job["keep_out"] = json!([
        { "z_start_mm": 298.5, "z_end_mm": 330, "diameter_mm": 16, "support": 1 },
        { "z_start_mm": 330, "z_end_mm": 400, "diameter_mm": 60, "support": 1 },
    ]);
    let hits = |job: &Value| {
        let answer = try_solve(&compensate(job)).unwrap();
        assert_eq!(codes(&answer).contains(&"program_unsafe"), answer.output.compensation.is_none());
        let hits = answer.warnings.iter().filter(|warning| warning.code == "hits_support");
        hits.map(|hit| (number(hit, "line") as usize, hit.pointer.clone(), hit.value.unwrap())).collect::<Vec<_>>()
    };
    assert_eq!(hits(&job), []);
    // Facing down to 12 mm comes into the point of a centre that stands there from the begin.
    let mut always = job.clone();
    always["keep_out"][0].as_object_mut().unwrap().remove("support");
    // Along the round nose the depth is looked at in some places.
    for (hit, wanted) in hits(&always).iter().zip([5, 6]) {
        let (line, place, depth) = hit;
        assert!(*line == wanted && place == "/keep_out/0" && (depth - 2.0).abs() < 0.01, "{hit:?}");
    }
    assert_eq!(hits(&always).len(), 2);
    // An edge that goes on without end comes to the sleeve, as does one that is 30 mm long.
    let mut endless = job.clone();
    endless["tools"][0].as_object_mut().unwrap().remove("edge_length_mm");
    let mut longer = job.clone();
    longer["tools"][0]["edge_length_mm"] = json!(30);
    for job in [&endless, &longer] {
        let found = hits(job);
        assert!(found.iter().all(|(line, place, _)| *line >= 7 && place == "/keep_out/1"), "{found:?}");
        assert!(!found.is_empty());
    }
    job["keep_out"][0]["support"] = json!(2);
    let parsed: <ProgramCompensation as Calculator>::Input = serde_json::from_value(job).unwrap();
    let mut violations = Violations::default();
    parsed.check(&mut violations);
    let faults: Vec<_> = violations.into_vec().into_iter().map(|fault| (fault.code, fault.pointer)).collect();
    assert_eq!(faults, [("no_such_support", "/keep_out/0/support".into())]);
}
