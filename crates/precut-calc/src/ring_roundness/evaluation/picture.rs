//! Figures and tables of an answer.

use std::borrow::Cow;

use crate::calculator::{Axis, Column, Figure, Frame, Item, Message, Panel, Role, Table};

use super::output::{ContactKind, Outcome, RoundnessCircle, RoundnessCircles, RoundnessProof};

pub(super) const FIGURE_IDS: &[&str] = &["polar", "unrolled", "spectrum"];
pub(super) const TABLE_IDS: &[&str] = &["circles", "contacts", "profile", "spectrum"];

/// Codes that the figures utter.
pub(super) const LABEL_CODES: &[&str] = &[
    "angle",
    "radial_deviation",
    "harmonic_order",
    "amplitude",
    "transmission",
    "measured_profile",
    "filtered_profile",
    "removed_by_filter",
    "least_squares_circle",
    "minimum_zone_circles",
    "minimum_zone_inner",
    "inscribed_circle",
    "circumscribed_circle",
    "contact_points",
    "spectrum_measured",
    "spectrum_filtered",
    "roundness_polar",
    "roundness_unrolled",
    "roundness_spectrum",
];

const ANGLE: Axis = Axis::linear("angle", "deg");
const UM_PER_MM: f64 = 1e3;

pub(super) fn figures(outcome: &Outcome) -> Vec<Figure> {
    let mut figures = vec![polar(outcome), unrolled(outcome)];
    // Across a gap there is no spectrum.
    if !outcome.spectrum.order.is_empty() {
        figures.push(spectrum(outcome));
    }
    figures
}

fn some(values: &[f64]) -> Vec<Option<f64>> {
    values.iter().copied().map(Some).collect()
}

fn curve(name: &'static str, x: &[f64], y: &[f64], role: Role) -> Item {
    Item::Line { name, x: x.to_vec(), y: some(y), role }
}

/// The profile with its reference circles, all as seen from the least-squares centre of the points.
fn polar(outcome: &Outcome) -> Figure {
    let profile = &outcome.profile;
    let mut items = vec![curve("measured_profile", &profile.angle_deg, &profile.radial_deviation_um, Role::Before)];
    items.push(curve("filtered_profile", &profile.angle_deg, &profile.filtered_deviation_um, Role::After));
    items.extend(circles(outcome));
    items.push(contacts(outcome));
    let panel = Panel { y: Axis::linear("radial_deviation", "um"), height: 1.0, items };
    Figure { id: "polar", title: Message::new("roundness_polar"), frame: Frame::Polar, x: ANGLE, panels: vec![panel] }
}

/// The reference circles of the filtered profile.
fn circles(outcome: &Outcome) -> Vec<Item> {
    let RoundnessCircles { least_squares, minimum_zone, maximum_inscribed, minimum_circumscribed } = &outcome.filtered;
    [
        ("least_squares_circle", least_squares, least_squares.radius_mm, Role::Nominal),
        ("minimum_zone_circles", minimum_zone, minimum_zone.outer_radius_mm, Role::Limit),
        ("minimum_zone_inner", minimum_zone, minimum_zone.inner_radius_mm, Role::Limit),
        ("inscribed_circle", maximum_inscribed, maximum_inscribed.radius_mm, Role::Series(0)),
        // The next of the family has colour and dashes of the measured profile.
        ("circumscribed_circle", minimum_circumscribed, minimum_circumscribed.radius_mm, Role::Series(3)),
    ]
    .into_iter()
    .map(|(name, circle, radius_mm, role)| {
        let (x, y) = seen_from_middle(outcome, circle, radius_mm);
        curve(name, &x, &y, role)
    })
    .collect()
}

/// A circle off the middle as deviations seen from the middle, every degree: exact, no limaçon.
fn seen_from_middle(outcome: &Outcome, circle: &RoundnessCircle, radius_mm: f64) -> (Vec<f64>, Vec<f64>) {
    let middle_mm = outcome.measured.least_squares.radius_mm;
    (0..=360_u16)
        .map(|degree| {
            let angle_deg = f64::from(degree);
            let (sin, cos) = angle_deg.to_radians().sin_cos();
            let along = circle.centre_x_mm * cos + circle.centre_y_mm * sin;
            let across = circle.centre_x_mm * sin - circle.centre_y_mm * cos;
            // Differences of squares instead of a root that loses the deviation's digits.
            let root = (radius_mm * radius_mm - across * across).sqrt();
            (angle_deg, UM_PER_MM * (along - across * across / (root + radius_mm) + (radius_mm - middle_mm)))
        })
        .unzip()
}

/// Where the zone and the circles touch the filtered profile.
fn contacts(outcome: &Outcome) -> Item {
    let RoundnessCircles { minimum_zone, maximum_inscribed, minimum_circumscribed, .. } = &outcome.filtered;
    let touching = [minimum_zone, maximum_inscribed, minimum_circumscribed].into_iter().flat_map(|c| &c.contacts);
    let profile = &outcome.profile;
    let mut places: Vec<(f64, f64)> = touching
        .filter(|contact| matches!(contact.kind, ContactKind::Outer | ContactKind::Inner))
        .filter_map(|contact| {
            let at = profile.angle_deg.partition_point(|&angle| angle < contact.angle_deg - 1e-9);
            Some((contact.angle_deg, *profile.filtered_deviation_um.get(at)?))
        })
        .collect();
    places.sort_by(|a, b| a.0.total_cmp(&b.0));
    places.dedup();
    let (x, y) = places.into_iter().unzip();
    Item::Points { name: "contact_points", x, y, role: Role::Limit }
}

fn unrolled(outcome: &Outcome) -> Figure {
    let profile = &outcome.profile;
    let angles = &profile.angle_deg;
    let mut items = vec![
        curve("measured_profile", angles, &profile.radial_deviation_um, Role::Before),
        curve("filtered_profile", angles, &profile.filtered_deviation_um, Role::After),
    ];
    items.extend(circles(outcome));
    items.push(contacts(outcome));
    let removed: Vec<f64> =
        profile.radial_deviation_um.iter().zip(&profile.filtered_deviation_um).map(|(all, kept)| all - kept).collect();
    let panel = |height, items| Panel { y: Axis::linear("radial_deviation", "um"), height, items };
    Figure {
        id: "unrolled",
        title: Message::new("roundness_unrolled"),
        frame: Frame::Stacked,
        x: ANGLE,
        panels: vec![panel(1.4, items), panel(0.6, vec![curve("removed_by_filter", angles, &removed, Role::Plain)])],
    }
}

fn spectrum(outcome: &Outcome) -> Figure {
    let spectrum = &outcome.spectrum;
    let kept: Vec<f64> = spectrum.amplitude_um.iter().zip(&spectrum.transmission).map(|(a, t)| a * t).collect();
    let bars = |name, y: &[f64], role| Item::Bars { name, x: spectrum.order.clone(), y: some(y), role };
    let amplitudes = vec![
        bars("spectrum_measured", &spectrum.amplitude_um, Role::Before),
        bars("spectrum_filtered", &kept, Role::After),
    ];
    Figure {
        id: "spectrum",
        title: Message::new("roundness_spectrum"),
        frame: Frame::Stacked,
        x: Axis::linear("harmonic_order", "1"),
        panels: vec![
            Panel { y: Axis::linear("amplitude", "um"), height: 1.2, items: amplitudes },
            Panel {
                y: Axis::linear("transmission", "1"),
                height: 0.6,
                items: vec![curve("transmission", &spectrum.order, &spectrum.transmission, Role::Plain)],
            },
        ],
    }
}

pub(super) fn tables(outcome: &Outcome) -> Vec<Table> {
    let (profile, spectrum) = (&outcome.profile, &outcome.spectrum);
    vec![
        circles_table(outcome),
        contacts_table(outcome),
        Table {
            id: "profile",
            columns: vec![
                Column::numbers("angle", "deg", &profile.angle_deg),
                Column::numbers("radial_deviation", "um", &profile.radial_deviation_um),
                Column::numbers("filtered_deviation", "um", &profile.filtered_deviation_um),
            ],
        },
        Table {
            id: "spectrum",
            columns: vec![
                Column::numbers("order", "1", &spectrum.order),
                Column::numbers("amplitude", "um", &spectrum.amplitude_um),
                Column::numbers("angle_of_max", "deg", &spectrum.angle_of_max_deg),
                Column::numbers("transmission", "1", &spectrum.transmission),
            ],
        },
    ]
}

/// Every circle with the words for its row: of the points or of the filtered profile, and its kind.
fn named(outcome: &Outcome) -> Vec<(&'static str, &'static str, &RoundnessCircle)> {
    [("measured", &outcome.measured), ("filtered", &outcome.filtered)]
        .into_iter()
        .flat_map(|(profile, circles)| {
            [
                (profile, "least_squares", &circles.least_squares),
                (profile, "minimum_zone", &circles.minimum_zone),
                (profile, "maximum_inscribed", &circles.maximum_inscribed),
                (profile, "minimum_circumscribed", &circles.minimum_circumscribed),
            ]
        })
        .collect()
}

fn circles_table(outcome: &Outcome) -> Table {
    let rows = named(outcome);
    let words = |name, of: &dyn Fn(&(&'static str, &'static str, &RoundnessCircle)) -> &'static str| {
        Column::words(name, rows.iter().map(|row| Cow::Borrowed(of(row))).collect())
    };
    let numbers = |name, unit, of: &dyn Fn(&RoundnessCircle) -> Option<f64>| {
        Column::optional(name, unit, &rows.iter().map(|(_, _, circle)| of(circle)).collect::<Vec<_>>())
    };
    let proof = |of: fn(&RoundnessProof) -> bool| {
        move |row: &(&'static str, &'static str, &RoundnessCircle)| match row.2.proof.as_ref().map(of) {
            Some(true) => "true",
            Some(false) => "false",
            None => "",
        }
    };
    Table {
        id: "circles",
        columns: vec![
            words("profile", &|row| row.0),
            words("circle", &|row| row.1),
            numbers("centre_x", "mm", &|circle| Some(circle.centre_x_mm)),
            numbers("centre_y", "mm", &|circle| Some(circle.centre_y_mm)),
            numbers("radius", "mm", &|circle| Some(circle.radius_mm)),
            numbers("inner_radius", "mm", &|circle| Some(circle.inner_radius_mm)),
            numbers("outer_radius", "mm", &|circle| Some(circle.outer_radius_mm)),
            numbers("ront", "um", &|circle| Some(circle.ront_um)),
            numbers("ronp", "um", &|circle| circle.ronp_um),
            numbers("ronv", "um", &|circle| circle.ronv_um),
            numbers("ronq", "um", &|circle| circle.ronq_um),
            numbers("sampling_error", "um", &|circle| circle.sampling_error_um),
            numbers("numerical_error", "um", &|circle| Some(circle.numerical_error_um)),
            numbers("stiffness", "1", &|circle| circle.proof.as_ref().map(|proof| proof.stiffness)),
            words("is_global", &proof(|proof| proof.is_global)),
            words("is_unique", &proof(|proof| proof.is_unique)),
        ],
    }
}

fn contacts_table(outcome: &Outcome) -> Table {
    let mut columns: [Vec<Cow<'static, str>>; 3] = Default::default();
    let (mut angles, mut rows) = (Vec::new(), Vec::new());
    for (profile, name, circle) in named(outcome) {
        for contact in &circle.contacts {
            let kind = match contact.kind {
                ContactKind::Outer => "outer",
                ContactKind::Inner => "inner",
                ContactKind::Peak => "peak",
                ContactKind::Valley => "valley",
            };
            for (column, word) in columns.iter_mut().zip([profile, name, kind]) {
                column.push(Cow::Borrowed(word));
            }
            angles.push(contact.angle_deg);
            // Rows are far fewer than 2^53.
            #[allow(clippy::cast_precision_loss)]
            rows.push(contact.row.map(|row| row as f64));
        }
    }
    let [profiles, names, kinds] = columns;
    Table {
        id: "contacts",
        columns: vec![
            Column::words("profile", profiles),
            Column::words("circle", names),
            Column::words("contact", kinds),
            Column::numbers("angle", "deg", &angles),
            Column::optional("row", "1", &rows),
        ],
    }
}
