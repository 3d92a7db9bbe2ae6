//! Random shafts. Places lie on a grid of 5 mm: elements of the comparison stay well conditioned, and tool,
//! steps and supports often coincide.

use precut_calc::num::beam::{
    Beam, Contact, Material, Profile, Section, Segment, Side, Springs, State, Support, Theory, Wanted,
};
use proptest::prelude::*;

/// Millimetres per step of the grid.
pub(crate) const GRID_MM: f64 = 5.0;

/// A shaft on supports.
#[derive(Debug, Clone)]
pub(crate) struct Case {
    pub(crate) segments: Vec<Segment>,
    pub(crate) supports: Vec<Support>,
    pub(crate) state: State,
}

impl Case {
    pub(crate) fn length(&self) -> f64 {
        self.segments.iter().map(|segment| segment.length_mm).sum()
    }

    /// The place on the grid nearest to a share of the length.
    pub(crate) fn place(&self, share: f64) -> f64 {
        (share * self.length() / GRID_MM).round() * GRID_MM
    }

    /// The profile of the shaft on its outermost two supports alone, or on its chuck: what the method subtracts the
    /// effect of the others from, so the measure of its rounding. Some cases here hold back nearly all of that (two
    /// rigid follow rests on a slender overhang, two chucks side by side).
    pub(crate) fn barely_held(&self) -> Profile {
        let bilateral = |support: &&Support| {
            !matches!(
                support,
                Support::FollowRest { .. } | Support::SteadyRest { contact: Contact::OneSided { .. }, .. }
            )
        };
        let mut supports: Vec<Support> = self.supports.iter().filter(bilateral).copied().collect();
        supports.sort_by(|a, b| place_of(a).total_cmp(&place_of(b)));
        if supports.len() > 1 {
            supports = [supports[0], supports[supports.len() - 1]]
                .map(|support| match support {
                    Support::Chuck { z_mm, springs, .. } => Support::Centre { z_mm, springs },
                    other => other,
                })
                .to_vec();
        }
        let want = Wanted { tangential: true, couple: true, weight: true };
        Beam::new(&self.segments, &supports, self.state).unwrap().profile(&self.grid(), want)
    }

    /// The grid from end to end.
    pub(crate) fn grid(&self) -> Vec<f64> {
        let mut places = vec![0.0];
        while places[places.len() - 1] < self.length() {
            places.push(places[places.len() - 1] + GRID_MM);
        }
        places
    }
}

fn compliance(largest: f64) -> impl Strategy<Value = f64> {
    prop_oneof![Just(0.0), (0.01..1.0_f64).prop_map(move |share| share * largest)]
}

fn springs() -> impl Strategy<Value = Springs> {
    (compliance(1e-4), compliance(1e-4))
        .prop_map(|(radial_mm_per_n, tangential_mm_per_n)| Springs { radial_mm_per_n, tangential_mm_per_n })
}

fn contact(one_sided: bool) -> BoxedStrategy<Contact> {
    if one_sided {
        prop_oneof![
            Just(Contact::Bilateral),
            Just(Contact::OneSided { gap_mm: 0.0 }),
            (0.0..0.05_f64).prop_map(|gap_mm| Contact::OneSided { gap_mm })
        ]
        .boxed()
    } else {
        Just(Contact::Bilateral).boxed()
    }
}

/// A support with its place as a share of the length.
fn fixed(one_sided: bool) -> impl Strategy<Value = (f64, Support)> {
    let z_mm = 0.0;
    let share = prop_oneof![Just(0.0), Just(1.0), 0.0..1.0_f64];
    let support = prop_oneof![
        springs().prop_map(move |springs| Support::Centre { z_mm, springs }),
        (springs(), compliance(1e-8)).prop_map(move |(springs, rotational_rad_per_n_mm)| Support::Chuck {
            z_mm,
            springs,
            rotational_rad_per_n_mm
        }),
        (springs(), contact(one_sided)).prop_map(move |(springs, contact)| Support::SteadyRest {
            z_mm,
            springs,
            contact
        }),
    ];
    (share, support)
}

fn follow(one_sided: bool) -> impl Strategy<Value = Support> {
    (-8..=8_i32, springs(), contact(one_sided)).prop_map(|(steps, springs, contact)| Support::FollowRest {
        offset_mm: GRID_MM * f64::from(steps),
        springs,
        contact,
    })
}

fn segment(theory: Theory) -> impl Strategy<Value = Segment> {
    let material = Material {
        youngs_modulus_n_per_mm2: 210_000.0,
        poisson_ratio: 0.3,
        density_kg_per_m3: 7850.0,
        gravity_m_per_s2: 9.81,
    };
    (4..60_i32, 15.0..80.0_f64, 0.0..6.0_f64, prop_oneof![Just(0.0), 0.1..0.7_f64]).prop_map(
        move |(steps, diameter, allowance, bore)| Segment {
            length_mm: GRID_MM * f64::from(steps),
            finished: Section::round(diameter, bore * diameter, &material, theory),
            stock: Section::round(diameter + allowance, bore * diameter, &material, theory),
        },
    )
}

fn state() -> impl Strategy<Value = State> {
    prop_oneof![
        Just(State::Finished),
        Just(State::Stock),
        Just(State::Mixed { stock_side: Side::Left }),
        Just(State::Mixed { stock_side: Side::Right }),
    ]
}

/// Where a support stands.
pub(crate) fn place_of(support: &Support) -> f64 {
    match *support {
        Support::Centre { z_mm, .. } | Support::Chuck { z_mm, .. } | Support::SteadyRest { z_mm, .. } => z_mm,
        Support::FollowRest { offset_mm, .. } => offset_mm,
    }
}

/// Moves a support that stands still.
pub(crate) fn moved(support: Support, z_mm: f64) -> Support {
    match support {
        Support::Centre { springs, .. } => Support::Centre { z_mm, springs },
        Support::Chuck { springs, rotational_rad_per_n_mm, .. } => {
            Support::Chuck { z_mm, springs, rotational_rad_per_n_mm }
        }
        Support::SteadyRest { springs, contact, .. } => Support::SteadyRest { z_mm, springs, contact },
        follow @ Support::FollowRest { .. } => follow,
    }
}

/// Shafts that are held; with or without rests that act on one side, with at most so many follow rests.
pub(crate) fn cases(one_sided: bool, follow_rests: usize) -> impl Strategy<Value = Case> {
    let theory = prop_oneof![Just(Theory::EulerBernoulli), Just(Theory::Timoshenko)];
    let segments = theory.prop_flat_map(|theory| prop::collection::vec(segment(theory), 1..6));
    let supports = prop::collection::vec(fixed(one_sided), 1..6);
    let follow = prop::collection::vec(follow(one_sided), 0..=follow_rests);
    (segments, supports, follow, state()).prop_filter_map("not held", |(segments, fixed, follow, state)| {
        let mut case = Case { segments, supports: Vec::new(), state };
        let mut taken: Vec<f64> = Vec::new();
        for (share, support) in fixed {
            let z = case.place(share);
            if taken.iter().all(|other| (other - z).abs() > 0.0) {
                taken.push(z);
                case.supports.push(moved(support, z));
            }
        }
        case.supports.extend(follow);
        Beam::new(&case.segments, &case.supports, case.state).is_ok().then_some(case)
    })
}
