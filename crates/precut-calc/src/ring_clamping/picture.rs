//! Pictures and tables of the answer.

use crate::calculator::{Axis, Column, Figure, Frame, Item, Message, Panel, Role, Table};

use super::output::{OtherJaws, Outcome};

pub(super) const FIGURE_IDS: &[&str] = &["released", "lobes"];
pub(super) const TABLE_IDS: &[&str] = &["lobes", "alternatives", "profile"];

/// Codes of titles, axes and legends.
pub(super) const LABEL_CODES: &[&str] = &[
    "angle",
    "radial_deviation",
    "harmonic_order",
    "amplitude",
    "released_profile",
    "mean_circle",
    "released_lobes",
    "ring_released",
    "ring_lobes",
];

pub(super) fn figures(outcome: &Outcome) -> Vec<Figure> {
    let profile = &outcome.profile;
    let closed = |values: &[f64]| values.iter().chain(values.first()).copied().map(Some).collect::<Vec<_>>();
    let angles: Vec<f64> = profile.angle_deg.iter().copied().chain([360.0]).collect();
    let line = |name, y, role| Item::Line { name, x: angles.clone(), y, role };
    let items = vec![
        line("released_profile", closed(&profile.radial_deviation_um), Role::After),
        line("mean_circle", vec![Some(0.0); angles.len()], Role::Nominal),
    ];
    let lobes = Item::Bars {
        name: "released_lobes",
        x: outcome.lobes.order.clone(),
        y: outcome.lobes.amplitude_um.iter().copied().map(Some).collect(),
        role: Role::After,
    };
    vec![
        Figure {
            id: "released",
            title: Message::new("ring_released"),
            frame: Frame::Polar,
            x: Axis::linear("angle", "deg"),
            panels: vec![Panel { y: Axis::linear("radial_deviation", "um"), height: 1.0, items }],
        },
        Figure {
            id: "lobes",
            title: Message::new("ring_lobes"),
            frame: Frame::Stacked,
            x: Axis::linear("harmonic_order", "1"),
            panels: vec![Panel { y: Axis::linear("amplitude", "um"), height: 1.0, items: vec![lobes] }],
        },
    ]
}

pub(super) fn tables(outcome: &Outcome) -> Vec<Table> {
    let (lobes, profile) = (&outcome.lobes, &outcome.profile);
    let others = |name, unit, of: &dyn Fn(&OtherJaws) -> Option<f64>| {
        Column::optional(name, unit, &outcome.alternatives.iter().map(of).collect::<Vec<_>>())
    };
    vec![
        Table {
            id: "lobes",
            columns: vec![
                Column::numbers("order", "1", &lobes.order),
                Column::numbers("amplitude", "um", &lobes.amplitude_um),
                Column::numbers("angle_of_max", "deg", &lobes.angle_of_max_deg),
            ],
        },
        Table {
            id: "alternatives",
            columns: vec![
                others("jaws", "1", &|other| Some(f64::from(other.jaws))),
                others("contact_angle", "deg", &|other| Some(other.contact_angle_deg)),
                others("force_per_jaw", "N", &|other| Some(other.force_per_jaw_n)),
                others("roundness", "um", &|other| Some(other.roundness_um)),
                others("force_per_jaw_max", "N", &|other| other.force_per_jaw_max_n),
            ],
        },
        Table {
            id: "profile",
            columns: vec![
                Column::numbers("angle", "deg", &profile.angle_deg),
                Column::numbers("radial_deviation", "um", &profile.radial_deviation_um),
            ],
        },
    ]
}
