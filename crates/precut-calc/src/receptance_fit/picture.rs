//! Pictures and tables of the answer.

use crate::calculator::{Axis, Column, Figure, Frame, Item, Message, Panel, Role, Table};

use super::output::{CurveRow, Outcome};

pub(super) const FIGURE_IDS: &[&str] = &["receptance", "nyquist"];
pub(super) const TABLE_IDS: &[&str] = &["modes", "functions", "curve"];

/// Codes of titles, axes and legends.
pub(super) const LABEL_CODES: &[&str] = &[
    "receptance_frequency",
    "receptance_amplitude",
    "receptance_phase",
    "receptance_real",
    "receptance_imaginary",
    "receptance_measured",
    "receptance_by_modes",
    "receptance_left",
    "receptance_over_frequency",
    "receptance_in_the_plane",
];

/// Most lines that are drawn of a function.
const MOST_DRAWN: usize = 1500;

/// Rows of a function, as many as are drawn.
fn drawn(outcome: &Outcome, function: usize) -> Vec<CurveRow> {
    let rows: Vec<&CurveRow> = outcome.curve.iter().filter(|row| row.function == function).collect();
    let every = rows.len().div_ceil(MOST_DRAWN).max(1);
    rows.into_iter().step_by(every).copied().collect()
}

fn amplitude(re: f64, im: f64) -> f64 {
    re.hypot(im)
}

fn phase_deg(re: f64, im: f64) -> f64 {
    im.atan2(re).to_degrees()
}

/// The n-th of several functions; of a single one a role of its own.
fn role(outcome: &Outcome, function: usize, single: Role) -> Role {
    let number = u8::try_from(function).unwrap_or(u8::MAX);
    if outcome.functions.len() == 1 { single } else { Role::Series(number) }
}

/// A number of a line.
type Of<'a> = &'a dyn Fn(&CurveRow) -> f64;

fn points(name: &'static str, rows: &[CurveRow], (x, y): (Of<'_>, Of<'_>), role: Role) -> Item {
    Item::Points { name, x: rows.iter().map(x).collect(), y: rows.iter().map(y).collect(), role }
}

fn line(name: &'static str, rows: &[CurveRow], (x, y): (Of<'_>, Of<'_>), role: Role) -> Item {
    Item::Line { name, x: rows.iter().map(x).collect(), y: rows.iter().map(|row| Some(y(row))).collect(), role }
}

pub(super) fn figures(outcome: &Outcome) -> Vec<Figure> {
    let (mut amplitudes, mut phases, mut plane) = (Vec::new(), Vec::new(), Vec::new());
    let hz: Of<'_> = &|row| row.frequency_hz;
    let measured: Of<'_> = &|row| amplitude(row.real_um_per_n, row.imaginary_um_per_n);
    let fitted: Of<'_> = &|row| amplitude(row.fitted_real_um_per_n, row.fitted_imaginary_um_per_n);
    let left: Of<'_> = &|row| {
        let (re, im) = (row.real_um_per_n, row.imaginary_um_per_n);
        amplitude(re - row.fitted_real_um_per_n, im - row.fitted_imaginary_um_per_n)
    };
    let measured_phase: Of<'_> = &|row| phase_deg(row.real_um_per_n, row.imaginary_um_per_n);
    let fitted_phase: Of<'_> = &|row| phase_deg(row.fitted_real_um_per_n, row.fitted_imaginary_um_per_n);
    let measured_place: (Of<'_>, Of<'_>) = (&|row| row.real_um_per_n, &|row| row.imaginary_um_per_n);
    let fitted_place: (Of<'_>, Of<'_>) = (&|row| row.fitted_real_um_per_n, &|row| row.fitted_imaginary_um_per_n);
    for function in 0..outcome.functions.len() {
        let rows = drawn(outcome, function);
        let (data, modes) = (role(outcome, function, Role::Comparison), role(outcome, function, Role::After));
        amplitudes.push(points("receptance_measured", &rows, (hz, measured), data));
        amplitudes.push(line("receptance_by_modes", &rows, (hz, fitted), modes));
        amplitudes.push(line("receptance_left", &rows, (hz, left), Role::Plain));
        phases.push(points("receptance_measured", &rows, (hz, measured_phase), data));
        phases.push(line("receptance_by_modes", &rows, (hz, fitted_phase), modes));
        plane.push(points("receptance_measured", &rows, measured_place, data));
        plane.push(line("receptance_by_modes", &rows, fitted_place, modes));
    }
    vec![
        Figure {
            id: "receptance",
            title: Message::new("receptance_over_frequency"),
            frame: Frame::Stacked,
            x: Axis::linear("receptance_frequency", "Hz"),
            panels: vec![
                Panel { y: Axis::logarithmic("receptance_amplitude", "um/N"), height: 2.0, items: amplitudes },
                Panel { y: Axis::linear("receptance_phase", "deg"), height: 1.0, items: phases },
            ],
        },
        Figure {
            id: "nyquist",
            title: Message::new("receptance_in_the_plane"),
            frame: Frame::Stacked,
            x: Axis::linear("receptance_real", "um/N"),
            panels: vec![Panel { y: Axis::linear("receptance_imaginary", "um/N"), height: 2.0, items: plane }],
        },
    ]
}

pub(super) fn tables(outcome: &Outcome) -> Vec<Table> {
    let modes = |name, unit, of: &dyn Fn(usize) -> f64| {
        Column::numbers(name, unit, &(0..outcome.modes.len()).map(of).collect::<Vec<_>>())
    };
    let (of_mode, known) = (&outcome.modes, &outcome.certainty);
    let functions = |name, unit, of: &dyn Fn(usize) -> f64| {
        Column::numbers(name, unit, &(0..outcome.functions.len()).map(of).collect::<Vec<_>>())
    };
    let of_function = &outcome.functions;
    let rows = |name, unit, of: &dyn Fn(&CurveRow) -> f64| {
        Column::numbers(name, unit, &outcome.curve.iter().map(of).collect::<Vec<_>>())
    };
    // Counts are far below 2^53.
    #[allow(clippy::cast_precision_loss)]
    let count = |number: usize| number as f64;
    vec![
        Table {
            id: "modes",
            columns: vec![
                modes("frequency", "Hz", &|i| of_mode[i].frequency_hz),
                modes("frequency_error", "Hz", &|i| known[i].frequency_error_hz),
                modes("damping_ratio", "1", &|i| of_mode[i].damping_ratio),
                modes("damping_ratio_error", "1", &|i| known[i].damping_ratio_error),
                modes("mass", "kg", &|i| of_mode[i].mass_kg),
                modes("mass_error", "kg", &|i| known[i].mass_error_kg),
                modes("stiffness", "N/mm", &|i| known[i].stiffness_n_per_mm),
                modes("direction_x", "1", &|i| of_mode[i].direction[0]),
                modes("direction_y", "1", &|i| of_mode[i].direction[1]),
                modes("direction_z", "1", &|i| of_mode[i].direction[2]),
                modes("residue_phase", "deg", &|i| known[i].residue_phase_deg),
            ],
        },
        Table {
            id: "functions",
            columns: vec![
                functions("file", "1", &|i| count(of_function[i].file)),
                functions("set", "1", &|i| count(of_function[i].set)),
                Column::words("response", of_function.iter().map(|one| one.response.name().into()).collect()),
                Column::words("excitation", of_function.iter().map(|one| one.excitation.name().into()).collect()),
                Column::words("unit", of_function.iter().map(|one| one.unit.spelling().into()).collect()),
                functions("lines", "1", &|i| count(of_function[i].lines)),
                functions("residual_share", "1", &|i| of_function[i].residual_share),
            ],
        },
        Table {
            id: "curve",
            columns: vec![
                rows("function", "1", &|row| count(row.function)),
                rows("frequency", "Hz", &|row| row.frequency_hz),
                rows("real", "um/N", &|row| row.real_um_per_n),
                rows("imaginary", "um/N", &|row| row.imaginary_um_per_n),
                rows("fitted_real", "um/N", &|row| row.fitted_real_um_per_n),
                rows("fitted_imaginary", "um/N", &|row| row.fitted_imaginary_um_per_n),
            ],
        },
    ]
}
