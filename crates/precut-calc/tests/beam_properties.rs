//! What must hold for every shaft: reciprocity, symmetry, scaling, limits.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::beam_support::random::{Case, cases, moved};
use precut_calc::num::beam::{Beam, Contact, Section, Segment, Side, Springs, State, Support, ToolLoad, Wanted};
use proptest::prelude::*;

const ALL: Wanted = Wanted { tangential: true, couple: true, weight: true };

fn built(case: &Case) -> Beam {
    Beam::new(&case.segments, &case.supports, case.state).unwrap()
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |largest, value| value.abs().max(largest))
}

/// Every pair within a share of the largest value, or of that of a shaft that is barely held; 1e-17 is the rounding
/// where all of them vanish.
fn agree(a: &[f64], b: &[f64], loose: &[f64], share: f64) -> Result<(), TestCaseError> {
    let scale = largest(a).max(largest(b)).max(largest(loose));
    for (i, (a, b)) in a.iter().zip(b).enumerate() {
        prop_assert!((a - b).abs() <= share * scale + 1e-17, "{}: {:e} and {:e}, largest {:e}", i, a, b, scale);
    }
    Ok(())
}

/// The shaft turned end for end.
fn mirrored(case: &Case) -> Case {
    let length = case.length();
    let supports = case.supports.iter().map(|support| match *support {
        Support::FollowRest { offset_mm, springs, contact } => {
            Support::FollowRest { offset_mm: -offset_mm, springs, contact }
        }
        Support::Centre { z_mm, .. } | Support::Chuck { z_mm, .. } | Support::SteadyRest { z_mm, .. } => {
            moved(*support, length - z_mm)
        }
    });
    let state = match case.state {
        State::Mixed { stock_side: Side::Left } => State::Mixed { stock_side: Side::Right },
        State::Mixed { stock_side: Side::Right } => State::Mixed { stock_side: Side::Left },
        same => same,
    };
    Case { segments: case.segments.iter().rev().copied().collect(), supports: supports.collect(), state }
}

/// Another material and another size: lengths, flexibilities and compliances by powers of four, so that neither they
/// nor the roots of pivots are rounded. Displacement per force goes with `length³ / EJ`.
fn scaled(case: &Case, length: f64, flexibility: f64) -> Case {
    let compliance = length * length * length * flexibility;
    let section = |section: Section| Section {
        bending_flexibility_per_n_mm2: section.bending_flexibility_per_n_mm2 * flexibility,
        shear_flexibility_per_n: section.shear_flexibility_per_n * flexibility * length * length,
        weight_n_per_mm: section.weight_n_per_mm,
    };
    let springs = |springs: Springs| Springs {
        radial_mm_per_n: springs.radial_mm_per_n * compliance,
        tangential_mm_per_n: springs.tangential_mm_per_n * compliance,
    };
    let supports = case.supports.iter().map(|support| match *support {
        Support::Centre { z_mm, springs: s } => Support::Centre { z_mm: z_mm * length, springs: springs(s) },
        Support::Chuck { z_mm, springs: s, rotational_rad_per_n_mm } => Support::Chuck {
            z_mm: z_mm * length,
            springs: springs(s),
            rotational_rad_per_n_mm: rotational_rad_per_n_mm * length * flexibility,
        },
        Support::SteadyRest { z_mm, springs: s, contact } => {
            Support::SteadyRest { z_mm: z_mm * length, springs: springs(s), contact }
        }
        Support::FollowRest { offset_mm, springs: s, contact } => {
            Support::FollowRest { offset_mm: offset_mm * length, springs: springs(s), contact }
        }
    });
    let segments = case.segments.iter().map(|s| Segment {
        length_mm: s.length_mm * length,
        finished: section(s.finished),
        stock: section(s.stock),
    });
    Case { segments: segments.collect(), supports: supports.collect(), state: case.state }
}

fn times(values: &[f64], factor: f64) -> Vec<f64> {
    values.iter().map(|value| value * factor).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    /// The displacement at `a` by a force at `b` is that at `b` by a force at `a` (Maxwell), and at one place it is the
    /// compliance.
    #[test]
    fn influence_is_reciprocal(case in cases(false, 0), a in 0.0..1.0_f64, b in 0.0..1.0_f64) {
        let beam = built(&Case { state: State::Finished, ..case.clone() });
        let (a, b) = (a * case.length(), b * case.length());
        let there = beam.influence(a, &[b], None).unwrap()[0];
        let back = beam.influence(b, &[a], None).unwrap()[0];
        let own = [a, b].map(|z| beam.influence(z, &[z], None).unwrap()[0]);
        let scale = largest(&case.barely_held().radial_mm_per_n);
        prop_assert!((there - back).abs() <= 1e-11 * scale + 1e-17, "{there:e} {back:e}");
        for (place, own) in [(a, own[0]), (b, own[1])] {
            let compliance = beam.profile(&[place], Wanted::default()).radial_mm_per_n[0];
            prop_assert!((compliance - own).abs() <= 1e-11 * scale + 1e-17);
        }
        // The compliance matrix is positive semidefinite.
        prop_assert!(there * there <= own[0] * own[1] * (1.0 + 1e-9) + 1e-11 * scale * scale);
    }

    /// With the section of their blanks some segments change the compliance by no more than the bound says.
    #[test]
    fn blanks_change_no_more_than_the_bound(case in cases(true, 0)) {
        let of = |state| built(&Case { state, ..case.clone() });
        let finished = of(State::Finished);
        let compliance = |beam: &Beam| beam.profile(&case.grid(), Wanted::default()).radial_mm_per_n;
        let (share, before) = (finished.stock_changes_at_most(), compliance(&finished));
        let rounding = 1e-11 * largest(&case.barely_held().radial_mm_per_n) + 1e-17;
        let mixed = [Side::Left, Side::Right].map(|stock_side| State::Mixed { stock_side });
        for state in [State::Stock, mixed[0], mixed[1]] {
            for (after, before) in compliance(&of(state)).iter().zip(&before) {
                prop_assert!((after - before).abs() <= share * before + rounding, "{before:e} becomes {after:e}");
            }
        }
    }

    #[test]
    fn turned_end_for_end(case in cases(true, 2), force in 0.0..2000.0_f64) {
        let other = mirrored(&case);
        let grid = case.grid();
        let (here, there) = (built(&case).profile(&grid, ALL), built(&other).profile(&grid, ALL));
        let back = |values: &[f64]| values.iter().rev().copied().collect::<Vec<_>>();
        let loose = case.barely_held();
        agree(&here.radial_mm_per_n, &back(&there.radial_mm_per_n), &loose.radial_mm_per_n, 1e-11)?;
        agree(&here.tangential_mm_per_n, &back(&there.tangential_mm_per_n), &loose.tangential_mm_per_n, 1e-11)?;
        agree(&here.couple_per_n, &times(&back(&there.couple_per_n), -1.0), &loose.couple_per_n, 1e-11)?;
        agree(&here.sag_radial_mm, &back(&there.sag_radial_mm), &loose.sag_radial_mm, 1e-11)?;
        agree(&here.sag_tangential_mm, &back(&there.sag_tangential_mm), &loose.sag_tangential_mm, 1e-11)?;
        if let (Some(here_in), Some(there_in)) = (&here.contacts, &there.contacts) {
            let load = ToolLoad { force_n: force, couple_n_mm: 0.0, gravity_radial: 0.5 };
            let n = grid.len();
            let y: Vec<f64> = (0..n).map(|i| here_in.respond(i, load).displacement_mm).collect();
            let mirrored: Vec<f64> = (0..n).map(|i| there_in.respond(n - 1 - i, load).displacement_mm).collect();
            let open = force * largest(&loose.radial_mm_per_n) + largest(&loose.sag_radial_mm);
            prop_assert!(y.iter().zip(&mirrored).all(|(a, b)| (a - b).abs() <= 1e-9 * open + 1e-15));
        }
    }

    #[test]
    fn another_scale(case in cases(true, 1), lengths in -1..2_i32, flexibilities in -2..3_i32) {
        let (length, flexibility) = (4.0_f64.powi(lengths), 4.0_f64.powi(flexibilities));
        let compliance = length.powi(3) * flexibility;
        let other = scaled(&case, length, flexibility);
        let (here, there) =
            (built(&case).profile(&case.grid(), ALL), built(&other).profile(&times(&case.grid(), length), ALL));
        // Powers of four round nothing, also under a root: equal to the last bit or nearly.
        agree(&times(&here.radial_mm_per_n, compliance), &there.radial_mm_per_n, &[], 1e-15)?;
        agree(&times(&here.couple_per_n, compliance / length), &there.couple_per_n, &[], 1e-15)?;
        agree(&times(&here.sag_radial_mm, compliance * length), &there.sag_radial_mm, &[], 1e-15)?;
    }

    /// Compliance is positive and grows when rests are taken away.
    #[test]
    fn more_support_is_stiffer(case in cases(true, 2)) {
        let grid = case.grid();
        let profile = built(&case).profile(&grid, Wanted { tangential: true, ..Wanted::default() });
        let loose = case.barely_held();
        let all = largest(&loose.radial_mm_per_n).max(largest(&loose.tangential_mm_per_n));
        for (u, w) in profile.radial_mm_per_n.iter().zip(&profile.tangential_mm_per_n) {
            prop_assert!(*u >= -1e-12 * all - 1e-17 && *w >= -1e-12 * all - 1e-17);
        }
        for out in 0..case.supports.len() {
            let mut supports = case.supports.clone();
            supports.remove(out);
            let Ok(beam) = Beam::new(&case.segments, &supports, case.state) else { continue };
            let softer = beam.profile(&grid, Wanted::default()).radial_mm_per_n;
            let scale = largest(&softer).max(all);
            prop_assert!(profile.radial_mm_per_n.iter().zip(&softer).all(|(a, b)| *a <= b + 1e-11 * scale + 1e-17));
        }
    }

    /// `G_vt = dW/dx / 2` for the Euler-Bernoulli beam of one section. The central difference of a polynomial of degree
    /// six over `2 h` errs by `h² W'''/6`; `W'''` is at most some 100 `max W / a³` on a piece of length `a` >= 5 mm.
    #[test]
    fn coupling_is_half_the_slope(case in cases(false, 0), share in 0.01..0.99_f64) {
        let euler = case.segments.iter().all(|s| s.finished.shear_flexibility_per_n <= 0.0);
        let state = if matches!(case.state, State::Mixed { .. }) { State::Stock } else { case.state };
        prop_assume!(euler);
        let beam = built(&Case { state, ..case.clone() });
        let (x, h) = (share * case.length(), 1e-3);
        prop_assume!(case.grid().iter().all(|z| (z - x).abs() > 2.0 * h));
        let profile = beam.profile(&[x - h, x, x + h], ALL);
        let slope = (profile.radial_mm_per_n[2] - profile.radial_mm_per_n[0]) / (2.0 * h);
        let scale = largest(&beam.profile(&case.grid(), Wanted::default()).radial_mm_per_n);
        let allowed = scale * (h * h * 100.0 / 6.0 / 125.0 + 1e-14 / h);
        prop_assert!((profile.couple_per_n[1] - slope / 2.0).abs() <= allowed + 1e-14);
    }

    /// On rigid supports nothing moves, exactly.
    #[test]
    fn rigid_supports_stand_still(case in cases(true, 1)) {
        for support in &case.supports {
            let (z, springs, open) = match *support {
                Support::Centre { z_mm, springs } | Support::Chuck { z_mm, springs, .. } => (z_mm, springs, false),
                Support::SteadyRest { z_mm, springs, contact } => (z_mm, springs, contact != Contact::Bilateral),
                Support::FollowRest { .. } => continue,
            };
            let profile = built(&case).profile(&[z], ALL);
            if springs.radial_mm_per_n <= 0.0 && !open {
                prop_assert!([&profile.radial_mm_per_n, &profile.couple_per_n, &profile.sag_radial_mm].iter().all(|v| v[0].abs() <= 0.0));
            }
            if springs.tangential_mm_per_n <= 0.0 {
                prop_assert!([&profile.tangential_mm_per_n, &profile.sag_tangential_mm].iter().all(|v| v[0].abs() <= 0.0));
            }
        }
    }

    /// A soft clamp is a centre, a soft rest is none; the difference goes with stiffness times compliance.
    #[test]
    fn limits_of_springs(case in cases(false, 0), z in 0.0..1.0_f64) {
        let grid = case.grid();
        let soft = case.supports.iter().map(|support| match *support {
            Support::Chuck { z_mm, springs, .. } => Support::Chuck { z_mm, springs, rotational_rad_per_n_mm: 1e8 },
            other => other,
        });
        let plain: Vec<Support> = case.supports.iter().map(|support| match *support {
            Support::Chuck { z_mm, springs, .. } => Support::Centre { z_mm, springs },
            other => other,
        }).collect();
        prop_assume!(plain.len() > 1);
        let mut soft: Vec<Support> = soft.collect();
        let place = case.place(z) + 1.25;
        if place < case.length() {
            let springs = Springs { radial_mm_per_n: 1e12, tangential_mm_per_n: 1e12 };
            let middle = soft.iter().filter_map(|s| match s { Support::Centre { z_mm, .. } | Support::Chuck { z_mm, .. } | Support::SteadyRest { z_mm, .. } => Some(*z_mm), Support::FollowRest { .. } => None });
            let (low, high) = middle.fold((f64::MAX, f64::MIN), |(low, high), z| (low.min(z), high.max(z)));
            // Outside it would be the base, with a huge compliance that cancels.
            if place > low && place < high {
                soft.push(Support::SteadyRest { z_mm: place, springs, contact: Contact::Bilateral });
            }
        }
        let with = |supports: &[Support]| Beam::new(&case.segments, supports, case.state).unwrap().profile(&grid, ALL);
        let (soft, plain, loose) = (with(&soft), with(&plain), case.barely_held());
        agree(&soft.radial_mm_per_n, &plain.radial_mm_per_n, &loose.radial_mm_per_n, 1e-9)?;
        agree(&soft.couple_per_n, &plain.couple_per_n, &loose.couple_per_n, 1e-9)?;
        agree(&soft.sag_radial_mm, &plain.sag_radial_mm, &loose.sag_radial_mm, 1e-9)?;
    }
}
