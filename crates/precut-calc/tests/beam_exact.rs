//! The beam against an independent exact solution of the differential equation, for random shafts.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::beam_support::exact::{Acting, Exact, Plane};
use crate::beam_support::random::{Case, cases};
use precut_calc::num::beam::{Beam, Offset, Profile, State, Support, ToolLoad, Wanted};
use proptest::prelude::*;

const ALL: Wanted = Wanted { tangential: true, couple: true, weight: true };
const UNIT_FORCE: Acting = Acting { force: 1.0, couple: 0.0, weight: 0.0 };
const UNIT_COUPLE: Acting = Acting { force: 0.0, couple: 1.0, weight: 0.0 };
const FULL_WEIGHT: Acting = Acting { force: 0.0, couple: 0.0, weight: 1.0 };

/// Of the largest value over the shaft: some thousand roundings on both sides.
const RELATIVE: f64 = 1e-11;

/// Of forces at rigid supports as close as 5 mm: the compliance between them is `(l/h)³` smaller than that of the shaft.
const OF_FORCES: f64 = 1e-6;

/// With one-sided rests touching, of the displacement with all of them open: they may be rigid and 5 mm apart.
const IN_CONTACT: f64 = 1e-9;

/// Where all values of a quantity are zero: rounding of what cancels there, some 1e-5 mm/N.
const ROUNDING: f64 = 1e-17;

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |largest, value| value.abs().max(largest))
}

/// Beam and profile over the whole grid, for the scale of each quantity.
fn whole(case: &Case) -> (Beam, Vec<f64>, Profile) {
    let beam = Beam::new(&case.segments, &case.supports, case.state).unwrap();
    let grid = case.grid();
    let profile = beam.profile(&grid, ALL);
    (beam, grid, profile)
}

/// The largest value of a quantity, also of the shaft that is barely held.
fn scale(case: &Case, profile: &Profile, of: fn(&Profile) -> &[f64]) -> f64 {
    largest(of(profile)).max(largest(of(&case.barely_held())))
}

fn index(grid: &[f64], tool: f64) -> usize {
    grid.iter().position(|z| (z - tool).abs() <= 0.0).unwrap()
}

/// Whether a follow rest stands where another support does, with the tool at this place.
fn meets_a_support(case: &Case, tool: f64) -> bool {
    let places: Vec<f64> = case
        .supports
        .iter()
        .map(|support| match *support {
            Support::Centre { z_mm, .. } | Support::Chuck { z_mm, .. } | Support::SteadyRest { z_mm, .. } => z_mm,
            Support::FollowRest { offset_mm, .. } => tool + offset_mm,
        })
        .collect();
    (0..places.len()).any(|i| places[..i].iter().any(|place| (place - places[i]).abs() < 1e-9))
}

macro_rules! close {
    ($what:expr, $got:expr, $expected:expr, $scale:expr) => {
        close!($what, $got, $expected, $scale, RELATIVE)
    };
    ($what:expr, $got:expr, $expected:expr, $scale:expr, $share:expr) => {{
        let (got, expected, scale): (f64, f64, f64) = ($got, $expected, $scale);
        prop_assert!(
            (got - expected).abs() <= $share * scale + ROUNDING,
            "{}: {got:e} instead of {expected:e}, scale {scale:e}",
            $what
        );
    }};
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn compliance_coupling_and_sag(case in cases(true, 2), share in 0.0..1.0_f64) {
        let (_, grid, profile) = whole(&case);
        let tool = case.place(share);
        let (i, n) = (index(&grid, tool), case.supports.len());
        let radial = Exact::new(&case.segments, &case.supports, case.state, Plane::Radial, tool, &[]);
        let tangential = Exact::new(&case.segments, &case.supports, case.state, Plane::Tangential, tool, &[]);
        let value = |exact: &Exact, acting| exact.displacement(&exact.open(tool, acting, n), tool);
        close!("W", profile.radial_mm_per_n[i], value(&radial, UNIT_FORCE), scale(&case, &profile, |p| &p.radial_mm_per_n));
        close!("W_w", profile.tangential_mm_per_n[i], value(&tangential, UNIT_FORCE), scale(&case, &profile, |p| &p.tangential_mm_per_n));
        close!("G", profile.couple_per_n[i], value(&radial, UNIT_COUPLE), scale(&case, &profile, |p| &p.couple_per_n));
        close!("sag", profile.sag_radial_mm[i], value(&radial, FULL_WEIGHT), scale(&case, &profile, |p| &p.sag_radial_mm));
        close!("sag_w", profile.sag_tangential_mm[i], value(&tangential, FULL_WEIGHT), scale(&case, &profile, |p| &p.sag_tangential_mm));
    }

    #[test]
    fn one_sided_rests(
        case in cases(true, 2),
        share in 0.0..1.0_f64,
        force in -500.0..2000.0_f64,
        couple in -3000.0..3000.0_f64,
        gravity in -1.0..1.0_f64,
    ) {
        let (_, grid, profile) = whole(&case);
        let Some(contacts) = &profile.contacts else { return Err(TestCaseError::reject("no one-sided rest")) };
        let tool = case.place(share);
        let (i, n) = (index(&grid, tool), case.supports.len());
        let exact = Exact::new(&case.segments, &case.supports, case.state, Plane::Radial, tool, &[]);
        let load = ToolLoad { force_n: force, couple_n_mm: couple, gravity_radial: gravity };
        let got = contacts.respond(i, load);
        let (expected, margin) = exact.in_contact(tool, Acting { force, couple, weight: gravity }, n);
        let moved = scale(&case, &profile, |p| &p.radial_mm_per_n) * force.abs()
            + scale(&case, &profile, |p| &p.couple_per_n) * couple.abs() + scale(&case, &profile, |p| &p.sag_radial_mm);
        close!("Y", got.displacement_mm, exact.displacement(&expected, tool), moved, IN_CONTACT);
        if margin > 1e-6 && force.abs() > 1.0 {
            for (rest, &support) in contacts.supports().iter().enumerate() {
                close!("rest", got.force_n(rest), expected.forces[support], force.abs() + couple.abs() + 100.0, OF_FORCES);
                prop_assert_eq!(got.closed & (1 << rest) != 0, expected.forces[support] > 0.0);
            }
            // Piecewise linear: the derivatives by differences inside the piece, exact but for rounding.
            let step = margin.min(1.0) * 1e-2;
            let more = contacts.respond(i, ToolLoad { force_n: force + step, ..load });
            if more.closed == got.closed {
                let rounding = 1e-12 * moved / step;
                let slope = (more.displacement_mm - got.displacement_mm) / step;
                prop_assert!((slope - got.compliance_mm_per_n).abs() <= rounding + RELATIVE * scale(&case, &profile, |p| &p.radial_mm_per_n));
                let more = contacts.respond(i, ToolLoad { couple_n_mm: couple + step, ..load });
                let slope = (more.displacement_mm - got.displacement_mm) / step;
                prop_assert!(more.closed != got.closed
                    || (slope - got.coupling_per_n).abs() <= rounding + RELATIVE * scale(&case, &profile, |p| &p.couple_per_n));
            }
        }
    }

    #[test]
    fn supports_set_off_the_axis(
        case in cases(true, 2),
        share in 0.0..1.0_f64,
        offsets in prop::collection::vec(-0.1..0.1_f64, 12),
        force in -500.0..2000.0_f64,
    ) {
        let (beam, grid, profile) = whole(&case);
        let tool = case.place(share);
        let (i, n) = (index(&grid, tool), case.supports.len());
        let set_off: Vec<Offset> = (0..n).map(|support| Offset { support, offset_mm: offsets[support] }).collect();
        let displaced = beam.displaced(&grid, &set_off);
        let mut exact = Exact::new(&case.segments, &case.supports, case.state, Plane::Radial, tool, &[]);
        exact.displace(&offsets[..n]);
        // Two rigid supports at one place that are set off by different amounts contradict each other.
        if meets_a_support(&case, tool) { return Err(TestCaseError::reject("a follow rest at a support")) }
        let scale_mm = largest(&displaced.work_mm).max(0.1);
        close!("open", displaced.work_mm[i], exact.displacement(&exact.open(tool, Acting::default(), n), tool), scale_mm, OF_FORCES);
        let Some(mut contacts) = profile.contacts.clone() else { return Ok(()) };
        contacts.displace(displaced.rests_mm);
        let got = contacts.respond(i, ToolLoad { force_n: force, ..ToolLoad::default() });
        let (expected, _) = exact.in_contact(tool, Acting { force, ..Acting::default() }, n);
        let moved = scale(&case, &profile, |p| &p.radial_mm_per_n) * force.abs() + scale_mm;
        close!("Y", got.displacement_mm + displaced.work_mm[i], exact.displacement(&expected, tool), moved, OF_FORCES);
    }

    #[test]
    fn reactions_and_shares(case in cases(true, 2), share in 0.0..1.0_f64) {
        let (beam, grid, profile) = whole(&case);
        let tool = case.place(share);
        let exact = Exact::new(&case.segments, &case.supports, case.state, Plane::Radial, tool, &[]);
        let expected = exact.open(tool, UNIT_FORCE, case.supports.len());
        let got = beam.reactions(tool);
        // Where two rigid supports meet only the sum of their forces is determined.
        let total: f64 = got.iter().map(|reaction| reaction.force).sum();
        let sizes = got.iter().fold(1.0_f64, |size, reaction| size.max(reaction.force.abs()));
        prop_assert!((total - 1.0).abs() <= 1e-10 * sizes);
        close!("M", beam.peak_bending_moment_mm([tool]), expected.peak_moment, case.length() * sizes, OF_FORCES);
        let shares = beam.shares(tool);
        let sum = shares.bending_mm_per_n + shares.shear_mm_per_n + shares.supports_mm_per_n.iter().sum::<f64>();
        let compliance = profile.radial_mm_per_n[index(&grid, tool)];
        // All terms of the sum are positive; the compliance itself is a difference for redundant supports.
        prop_assert!((sum - compliance).abs() <= 1e-10 * compliance + 1e-12 * scale(&case, &profile, |p| &p.radial_mm_per_n) + ROUNDING, "{sum:e} {compliance:e}");
        for (i, support) in case.supports.iter().enumerate() {
            if shares.supports_mm_per_n[i] > 0.0 {
                close!(format!("{support:?}"), got[i].force, expected.forces[i], sizes, OF_FORCES);
                close!(format!("{support:?}"), got[i].couple_mm, expected.couples[i], case.length() * sizes, OF_FORCES);
            }
        }
    }

    #[test]
    fn influence(case in cases(true, 2), share in 0.0..1.0_f64, at in 0.0..1.0_f64, out in 0..12_usize) {
        let (beam, _, _) = whole(&case);
        let (load, place) = (case.place(share), case.place(at));
        let left_out = Some(out).filter(|out| *out < case.supports.len());
        let kept: Vec<_> = case.supports.iter().enumerate()
            .filter(|(i, _)| Some(*i) != left_out).map(|(_, support)| *support)
            .filter(|support| !matches!(support, Support::FollowRest { .. })).collect();
        let Ok(got) = beam.influence(load, &[place], left_out) else { return Err(TestCaseError::reject("not held")) };
        let state = if case.state == State::Stock { case.state } else { State::Finished };
        let exact = Exact::new(&case.segments, &kept, state, Plane::Radial, load, &[place]);
        let expected = exact.displacement(&exact.open(load, UNIT_FORCE, kept.len()), place);
        let scale = largest(&beam.influence(load, &case.grid(), left_out).unwrap());
        close!("influence", got[0], expected, scale);
    }
}
