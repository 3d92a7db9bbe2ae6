//! All tests of the crate in one program: what they use of the crate is compiled and linked once, not by every file.
//!
//! `cargo test -p precut-calc-tests beam_exact::` runs those of one file.
#![allow(clippy::needless_pass_by_value, clippy::cast_possible_truncation, clippy::cast_sign_loss)] // tests write jobs

mod beam_closed_forms;
mod beam_exact;
mod beam_properties;
mod beam_support;
mod blind_trials;
mod cancellation;
mod cases;
mod compliance_fit;
mod conformance;
mod cylinder_fits;
mod cylindricity_evaluation;
mod deflection_advice;
mod deflection_certainty;
mod deflection_clocks;
mod deflection_defaults;
mod deflection_effects;
mod deflection_faults;
mod deflection_program;
mod deflection_properties;
mod deflection_reference;
mod deflection_set_off;
mod deflection_soundness;
mod deflection_uncertainty;
mod diagnosis_answers;
mod diagnosis_blunders;
mod diagnosis_calibration;
mod diagnosis_claims;
mod diagnosis_classes;
mod diagnosis_deflection;
mod diagnosis_known;
mod diagnosis_profiles;
mod diagnosis_refusals;
mod diagnosis_remainder;
mod diagnosis_remainder_cuts;
mod diagnosis_ring;
mod diagnosis_ring_trials;
mod diagnosis_trials;
mod diagnosis_worth;
mod draw;
mod drawing_places;
mod feed_advice;
mod feed_benchmarks;
mod feed_cases;
mod feed_claims;
mod feed_continuous;
mod feed_decisions;
mod feed_depths;
mod feed_diagnosis;
mod feed_diagnosis_trials;
mod feed_effects;
mod feed_program;
mod feed_properties;
mod feed_reference;
mod feed_risk;
mod feed_support;
mod fixture_class_trials;
mod fixture_classes;
mod fixture_diagnosis;
mod fixture_diagnosis_trials;
mod fixture_drive;
mod fixture_effects;
mod fixture_grip;
mod fixture_identification;
mod fixture_methods;
mod fixture_paper;
mod fixture_reference;
mod fixture_support;
mod fixture_watch;
mod force_beyond_90;
mod force_contract;
mod force_handbook;
mod force_laws;
mod force_reference;
mod lsq_nist;
mod lsq_properties;
mod machinability_fit;
mod machinability_library;
mod machinability_real;
mod material_library;
mod milling_reference;
mod path_chords;
mod process_streams;
mod process_support;
mod process_watch;
mod program_correction;
mod program_fuzz;
mod program_reading;
mod program_stock;
mod program_yielding;
mod ring_cases;
mod ring_clamping;
mod ring_contract;
mod ring_dynamics;
mod ring_effects;
mod ring_errors;
mod ring_maps;
mod ring_plans;
mod ring_reference;
mod ring_refusals;
mod ring_support;
mod ring_theory;
mod roundness_circles;
mod roundness_evaluation;
mod roundness_made;
mod roundness_profile;
mod roundness_reference;
mod roundness_spikes;
mod stats;
mod strd;
mod support;

/// A file that is not named above would never run.
#[test]
fn every_file_of_this_folder_is_a_module_of_this_program() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/..", "/tests");
    for entry in std::fs::read_dir(folder).expect("the folder of this file") {
        let path = entry.expect("an entry of the folder").path();
        let Some(name) = path.file_stem().and_then(|name| name.to_str()) else { continue };
        let is_module = path.extension().is_some_and(|end| end == "rs") || path.join("mod.rs").is_file();
        let listed = include_str!("main.rs").lines().any(|line| line == format!("mod {name};"));
        assert!(!is_module || name == "main" || listed, "mod {name}; is missing in tests/main.rs");
    }
}
