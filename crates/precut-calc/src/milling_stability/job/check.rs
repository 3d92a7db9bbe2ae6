//! Rules between fields. What one field alone may hold stands in its schema.

use std::f64::consts::PI;

use crate::calculator::{Check, Finding, Violations};
use crate::clamping::Unheld;
use crate::fixture_stability::{Vise, check_characteristic, check_friction};
use crate::receptance_fit::{Function, check_at};

use super::super::model::{MOST_OSCILLATIONS, Rotation, Vector};
use super::case::{Case, arc_rad, coefficient, direction, in_the_cut, milling, numbers, range_rpm, varying};
use super::input::{Asked, Cut, EdgeForce, Job, Yielding, YieldingMode};
use super::uncertain::clamped;

/// Codes of the faults found here, and those that fields name for their range.
pub(in crate::milling_stability) const CODES: &[&str] = &[
    "arc_empty",
    "arc_or_width",
    "strip_misses_cutter",
    "widths_beside_width",
    "spindle_speed_or_speed",
    "feed_missing",
    "feeds_disagree",
    "bad_spindle_speed",
    "bad_feed_per_tooth",
    "negative_damping",
    "pitch_sum",
    "one_for_each_tooth",
    "direction_zero",
    "mode_underdetermined",
    "mode_overdetermined",
    "damping_of_mode",
    "chip_floor_needed",
    "teeth_meet",
    "nothing_yields",
    "clamping_missing",
    "vise_or_contacts",
    "frictions_unordered",
    "friction_range_or_sd",
    "nothing_clamped",
    "clamping_unbalanced",
    "bad_clamp_force",
    "vise_not_modal",
    "vise_holds_work",
    "rubbing_coefficient",
    "modulation_incommensurate",
    "too_expensive",
    "speeds_reversed",
    "spindle_row_without_limit",
    "spindle_speeds_unordered",
    "certainty_of_nothing",
    "duplicate_effect",
    "effect_without_mode",
];

/// S and S_z that both are given may differ by so much.
const FEEDS_AGREE: f64 = 0.01;
/// Pitches may miss a turn by so much, deg.
const TURN_DEG: f64 = 0.01;
/// The floor of a chip that stands in the message.
const USUAL_FLOOR_MM: f64 = 0.005;
/// A direction that is so far out of the feed moves the tool across it.
const ACROSS: f64 = 1e-9;

impl Check for Job {
    fn check(&self, violations: &mut Violations) {
        check_cutter(self, violations);
        check_cut(self, violations);
        check_sides(self, violations);
        let measured = check_receptances(self, violations);
        check_clamping(self, violations);
        check_force(self, &measured, violations);
        check_spindle(self, violations);
        check_certainty(self, violations);
        super::acting::check(self, violations);
        check_cost(self, violations);
    }
}

fn check_cutter(job: &Job, violations: &mut Violations) {
    let cutter = &job.cutter;
    let lists = [
        ("pitch_deg", cutter.pitch_deg.len()),
        ("tooth_helix_angle_deg", cutter.tooth_helix_angle_deg.len()),
        ("radial_offset_um", cutter.radial_offset_um.len()),
        ("axial_offset_um", cutter.axial_offset_um.len()),
    ];
    for (field, count) in lists.into_iter().filter(|(_, count)| *count > 0) {
        violations.require(u32::try_from(count).is_ok_and(|count| count == cutter.teeth), || {
            Finding::new("one_for_each_tooth", format!("/cutter/{field}"))
                .with("count", count)
                .with("teeth", f64::from(cutter.teeth))
        });
    }
    if !cutter.pitch_deg.is_empty() {
        let sum: f64 = cutter.pitch_deg.iter().map(|pitch| pitch.0).sum();
        violations.require((sum - 360.0).abs() <= TURN_DEG, || {
            Finding::new("pitch_sum", "/cutter/pitch_deg").measured(sum, 360.0, "deg")
        });
    }
    if let Some(milling) = milling(job).filter(|milling| !milling.has_one_helix()) {
        let height = Case::teeth_meet_mm(&milling);
        violations.require(height > job.cut.depth_mm, || {
            Finding::new("teeth_meet", "/cutter/tooth_helix_angle_deg").measured(height, job.cut.depth_mm, "mm")
        });
    }
}

fn check_cut(job: &Job, violations: &mut Violations) {
    let cut = &job.cut;
    let by_angles = cut.entry_deg.is_some() && cut.exit_deg.is_some();
    let any_angle = cut.entry_deg.is_some() || cut.exit_deg.is_some();
    let one = cut.width_mm.is_some() != any_angle && (cut.width_mm.is_some() || by_angles);
    violations.require(one, || {
        let given = match (cut.width_mm.is_some(), any_angle) {
            (true, _) => "both",
            (false, true) => "one_angle",
            (false, false) => "neither",
        };
        Finding::new("arc_or_width", "/cut/width_mm").with("given", given)
    });
    if one && arc_rad(&job.cutter, cut).is_none() {
        violations.add(if let (Some(entry), Some(exit)) = (cut.entry_deg, cut.exit_deg) {
            Finding::new("arc_empty", "/cut/exit_deg").measured(exit, entry, "deg")
        } else {
            let reach = 0.5 * (job.cutter.diameter_mm + cut.width_mm.unwrap_or(0.0));
            Finding::new("strip_misses_cutter", "/cut/offset_mm").measured(cut.offset_mm.abs(), reach, "mm")
        });
    }
    violations.require(cut.widths_mm.is_empty() || cut.width_mm.is_some(), || {
        Finding::new("widths_beside_width", "/cut/widths_mm")
    });
    for (index, width) in cut.widths_mm.iter().enumerate().filter(|_| one && cut.width_mm.is_some()) {
        let other = Cut { width_mm: Some(width.0), ..cut.clone() };
        violations.require(arc_rad(&job.cutter, &other).is_some(), || {
            let reach = 0.5 * (job.cutter.diameter_mm + width.0);
            Finding::new("strip_misses_cutter", format!("/cut/widths_mm/{index}")).measured(
                cut.offset_mm.abs(),
                reach,
                "mm",
            )
        });
    }
    violations.require(cut.spindle_speed_rpm.is_some() != cut.speed_m_per_min.is_some(), || {
        let given = if cut.speed_m_per_min.is_some() { "both" } else { "neither" };
        Finding::new("spindle_speed_or_speed", "/cut").with("given", given)
    });
    violations.require(cut.feed_mm_per_tooth.is_some() || cut.feed_mm_per_min.is_some(), || {
        Finding::new("feed_missing", "/cut/feed_mm_per_tooth")
    });
    if let (Some(per_tooth), Some((of_table, table))) = (cut.feed_mm_per_tooth, job.feed_of_table_mm()) {
        let wanted = table * per_tooth / of_table;
        violations.require((per_tooth - of_table).abs() <= FEEDS_AGREE * per_tooth, || {
            Finding::new("feeds_disagree", "/cut/feed_mm_per_min")
                .measured(table, wanted, "mm/min")
                .with("feed_mm_per_tooth", per_tooth)
        });
    }
}

/// Modes of both sides with where they stand.
pub(in crate::milling_stability) fn modes(job: &Job) -> impl Iterator<Item = (String, &YieldingMode)> {
    job.sides().into_iter().flat_map(|(side, _, yielding)| {
        let modes = match yielding {
            Yielding::Modes(of) => of.modes.as_slice(),
            Yielding::Receptances(_) | Yielding::Vise(_) | Yielding::Rigid(_) => &[],
        };
        modes.iter().enumerate().map(move |(index, mode)| (format!("{side}/modes/{index}"), mode))
    })
}

fn check_sides(job: &Job, violations: &mut Violations) {
    for (at, mode) in modes(job) {
        violations.require(direction(mode).is_some(), || Finding::new("direction_zero", format!("{at}/direction")));
        let fields = [
            ("frequency_hz", mode.frequency_hz.is_some()),
            ("mass_kg", mode.mass_kg.is_some()),
            ("stiffness_n_per_mm", mode.stiffness_n_per_mm.is_some()),
        ];
        let missing: Vec<&'static str> = fields.iter().filter(|(_, given)| !given).map(|(name, _)| *name).collect();
        if missing.len() > 1 {
            violations.add(Finding::new("mode_underdetermined", at.clone()).with("missing", missing));
        } else if missing.is_empty() {
            violations.add(Finding::new("mode_overdetermined", at.clone()));
        }
        violations.require(mode.damping_ratio.is_some() != mode.damping_n_s_per_mm.is_some(), || {
            let given = if mode.damping_ratio.is_some() { "both" } else { "neither" };
            Finding::new("damping_of_mode", format!("{at}/damping_ratio")).with("given", given)
        });
        if let Some((.., ratio)) = numbers(mode)
            && mode.damping_n_s_per_mm.is_some()
        {
            violations.require(ratio < 1.0, || {
                let most = mode.damping_n_s_per_mm.unwrap_or(0.0) / ratio;
                Finding::new("negative_damping", format!("{at}/damping_n_s_per_mm"))
                    .value(mode.damping_n_s_per_mm.unwrap_or(0.0), "N s/mm")
                    .with("field", "damping_n_s_per_mm")
                    .with("minimum", 0.0)
                    .with("below", most)
            });
        }
    }
    let mut has_vise = false;
    for (at, _, yielding) in job.sides() {
        let Yielding::Vise(of) = yielding else { continue };
        has_vise = true;
        violations.require(matches!(of.fixture, Vise::SelfLocking(_)), || {
            Finding::new("vise_not_modal", format!("{at}/fixture/kind"))
        });
        violations.require(at == "/work", || Finding::new("vise_holds_work", at));
    }
    let yields = has_vise || job.is_measured() || modes(job).next().is_some();
    violations.require(!job.asks_stability() || yields, || Finding::new("nothing_yields", "/tool"));
}

/// Faults of measured functions at their places. Gives the functions that were read, along the axes of the fixture.
fn check_receptances(job: &Job, violations: &mut Violations) -> Vec<Function> {
    let mut read = Vec::new();
    for (at, _, yielding) in job.sides() {
        if let Yielding::Receptances(of) = yielding {
            read.extend(check_at(&of.fit_job(), at, violations));
        }
    }
    read
}

/// Ways in which a part may go, as words.
const WAYS: [[&str; 2]; 6] =
    [["+x", "-x"], ["+y", "-y"], ["+z", "-z"], ["about_x", "about_x"], ["about_y", "about_y"], ["about_z", "about_z"]];

/// The axis along or about which a free motion goes most.
pub(in crate::milling_stability) fn way(free: &[f64; 6]) -> &'static str {
    let most = (0..6).max_by(|a, b| free[*a].abs().total_cmp(&free[*b].abs())).unwrap_or(0);
    WAYS[most][usize::from(free[most] < 0.0)]
}

fn check_clamping(job: &Job, violations: &mut Violations) {
    let Some(clamping) = &job.clamping else {
        violations.require(!job.asks(Asked::Clamping), || Finding::new("clamping_missing", "/clamping"));
        return;
    };
    violations.require(clamping.vise.is_some() != clamping.contacts.is_some(), || {
        let given = if clamping.vise.is_some() { "both" } else { "neither" };
        Finding::new("vise_or_contacts", "/clamping").with("given", given)
    });
    for (at, friction) in clamping.frictions() {
        check_friction(friction, &at, violations);
    }
    let points = clamping.contacts.iter().flat_map(|of| &of.points);
    for (index, point) in points.enumerate() {
        violations.require(point.direction().is_some(), || {
            Finding::new("direction_zero", format!("/clamping/contacts/points/{index}/normal"))
        });
    }
    match clamping.held(job.cut.feed_direction_deg) {
        Some(Err(Unheld::NothingClamped)) => {
            violations.add(Finding::new("nothing_clamped", "/clamping/contacts/points"));
        }
        Some(Err(Unheld::Free(free))) => {
            violations.add(Finding::new("clamping_unbalanced", "/clamping/contacts/points").with("way", way(&free)));
        }
        Some(Ok(_)) | None => {}
    }
}

fn check_force(job: &Job, measured: &[Function], violations: &mut Violations) {
    let (floor, exponent, at) = match &job.force {
        EdgeForce::Mechanistic(_) => (1.0, 0.0, ""),
        EdgeForce::Kienzle(of) => {
            let most = of.tangential_exponent.max(of.radial_exponent).max(of.axial_exponent);
            (of.chip_floor_mm, most, "/force/chip_floor_mm")
        }
        EdgeForce::PowerLaw(of) => (of.chip_floor_mm, of.chip_thickness_exponent, "/force/chip_floor_mm"),
    };
    let turn = job.cut.feed_direction_deg.to_radians();
    let is_across = |of: Vector| {
        let [_, y, z] = in_the_cut(of, turn);
        y.abs() > ACROSS || z.abs() > ACROSS
    };
    let of_function = |function: &Function| std::array::from_fn(|q| f64::from(u8::from(function.response.axis() == q)));
    let yields_across = modes(job).filter_map(|(_, mode)| direction(mode)).any(is_across)
        || measured.iter().map(of_function).any(is_across);
    let from_nothing = arc_rad(&job.cutter, &job.cut).is_some_and(|(entry, exit)| entry < 1e-9 || exit > PI - 1e-9);
    let needed = exponent > 0.0 && from_nothing && yields_across;
    violations.require(!needed || floor > 0.0, || {
        Finding::new("chip_floor_needed", at).measured(floor, USUAL_FLOOR_MM, "mm")
    });
    if let Some(rubbing) = &job.process_damping {
        violations.require(coefficient(rubbing).is_some(), || {
            Finding::new("rubbing_coefficient", "/process_damping/coefficient_n_per_mm")
        });
    }
}

fn check_spindle(job: &Job, violations: &mut Violations) {
    if let Some(spindle) = &job.spindle {
        check_characteristic(&spindle.characteristic, violations);
    }
    if let Some(working) = job.spindle_rpm() {
        let (from, to) = range_rpm(job, working);
        violations
            .require(from < to, || Finding::new("speeds_reversed", "/lobes/to_rpm").measured(to, from, "rev/min"));
    }
    if let (Some(of), Some(milling), Some(speed)) = (job.speed_variation, milling(job), job.spindle_rpm())
        && let Err(nearest) = varying(&milling, speed, of.amplitude, of.frequency_hz)
    {
        violations.add(Finding::new("modulation_incommensurate", "/speed_variation/frequency_hz").measured(
            of.frequency_hz,
            nearest,
            "Hz",
        ));
    }
}

fn check_certainty(job: &Job, violations: &mut Violations) {
    super::uncertain::check(job, violations);
    let limits = &job.limits;
    let of_surface = [limits.amplitude_max_um, limits.surface_error_max_um, limits.roughness_max_um];
    let is_rigid = job.sides().iter().all(|(.., yielding)| matches!(yielding, Yielding::Rigid(_)));
    let is_driven = job.spindle.as_ref().zip(job.spindle_rpm()).is_some_and(|(spindle, rpm)| {
        let available = spindle.drive().available(rpm);
        available.power_kw.is_some() || available.torque_n_m.is_some()
    });
    let has_limit = !is_rigid || is_driven || clamped(job).is_some() || of_surface.iter().any(Option::is_some);
    violations.require(!job.asks(Asked::Certainty) || has_limit, || Finding::new("certainty_of_nothing", "/analyses"));
}

/// A multiplier over thousands of oscillations is refused; a lobe diagram leaves such speeds out. Of a slow cut closed forms tell what
/// is asked, but no other cutter is tried. Of a measured side it is known only when its modes are.
fn check_cost(job: &Job, violations: &mut Violations) {
    if let Some(finding) = Case::of(job).and_then(|case| too_expensive(job, &case)) {
        violations.add(finding);
    }
}

/// What is too dear at the working speed.
pub(in crate::milling_stability) fn too_expensive(job: &Job, case: &Case) -> Option<Finding> {
    let at_speed = [Asked::Verdict, Asked::Intervals, Asked::Motion, Asked::Proposals, Asked::Certainty]
        .into_iter()
        .any(|what| job.asks(what));
    let oscillations = case.oscillations();
    let is_told = case.cut().is_slow() && !job.asks(Asked::Proposals);
    if !at_speed || is_told || oscillations <= MOST_OSCILLATIONS {
        return None;
    }
    // Of a varying speed a period is some modulations, whatever the speed.
    let steady = Rotation::steady(case.rotation.spindle_rpm);
    let lowest = steady.spindle_rpm * case.oscillations_at(&steady) / MOST_OSCILLATIONS;
    Some(
        Finding::new("too_expensive", "/cut/spindle_speed_rpm")
            .measured(oscillations, MOST_OSCILLATIONS, "1")
            .with("speed_rpm", case.rotation.spindle_rpm)
            .with("lowest_rpm", lowest)
            .with("varies", if case.rotation.varies() { "yes" } else { "no" }),
    )
}
