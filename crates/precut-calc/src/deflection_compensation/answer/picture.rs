//! Figures and tables of an answer.

use crate::calculator::{Along, Axis, Column, Figure, Frame, Glyph, Item, Message, Panel, Role, Table};
use crate::certainty::picture as doubt;
use crate::diameters::DOUBT_LABELS;

use crate::deflection_compensation::answer::columns::offsets_um;
use crate::deflection_compensation::answer::output::{OneStep, Outcome, PathZone, StationColumns};
use crate::deflection_compensation::job::input::{Job, Support};
use crate::shaft::elastic::ends;
use crate::shaft::handles::handles;

const Z: Axis = Axis::linear("station", "mm");

pub(in crate::deflection_compensation) const FIGURE_IDS: &[&str] = &["profile", "compliance", "path", doubt::ID];
pub(in crate::deflection_compensation) const TABLE_IDS: &[&str] =
    &["stations", "path", "increments", "one_step", "passes", doubt::ID];

/// Codes that the figures utter.
pub(in crate::deflection_compensation) const LABEL_CODES: &[&str] = &[
    "station",
    "radius",
    "compliance",
    "diameter_error",
    "path_offset",
    "held_shaft",
    "blank",
    "work_compliance",
    "total_compliance",
    "without_compensation",
    "with_compensation",
    "uncertainty_band",
    "nine_of_ten_parts",
    "half_of_the_parts",
    "tolerance_band",
    "nominal_line",
    "commanded_path",
    "programmed_vertices",
    "one_step_formula",
    "deflection_profile",
    "deflection_compliance",
    "deflection_path",
];

pub(in crate::deflection_compensation) fn figures(job: &Job, outcome: &Outcome) -> Vec<Figure> {
    let title = |code| Message::new(code);
    let sure = outcome.conformance.as_ref();
    let doubted = sure.and_then(|sure| doubt::figure(&sure.contributions, &sure.joint, DOUBT_LABELS));
    let mut figures = vec![
        Figure {
            id: "profile",
            title: title("deflection_profile"),
            frame: Frame::Stacked,
            x: Z,
            panels: vec![
                outline(job, outcome, 0.8),
                compliance(&outcome.stations, 0.8),
                errors(job, outcome, 1.2),
                path(outcome, 0.8),
            ],
        },
        Figure {
            id: "compliance",
            title: title("deflection_compliance"),
            frame: Frame::Stacked,
            x: Z,
            panels: vec![outline(job, outcome, 0.8), compliance(&outcome.stations, 1.2)],
        },
        Figure {
            id: "path",
            title: title("deflection_path"),
            frame: Frame::Stacked,
            x: Z,
            panels: vec![path(outcome, 1.2), one_step(outcome, 0.8)],
        },
    ];
    figures.extend(doubted);
    figures
}

fn some(values: &[f64]) -> Vec<Option<f64>> {
    values.iter().copied().map(Some).collect()
}

/// The shaft to scale along its length, its blank, what holds it, and the tool where it deflects most.
fn outline(job: &Job, outcome: &Outcome, height: f64) -> Panel {
    let mut items = Vec::new();
    let contour = |radius: &dyn Fn(&crate::deflection_compensation::job::input::Segment) -> f64| {
        let (mut x, mut y, mut left) = (Vec::new(), Vec::new(), 0.0);
        for segment in &job.shaft.segments {
            let right = left + segment.length_mm;
            x.extend([left, right]);
            y.extend([radius(segment), radius(segment)]);
            left = right;
        }
        let (mut below_x, mut below_y) = (x.clone(), y.clone());
        below_x.reverse();
        below_y.reverse();
        x.extend(below_x);
        y.extend(below_y.into_iter().map(|r| -r));
        (x, y)
    };
    let (x, y) = contour(&|s| s.stock_mm() / 2.0);
    items.push(Item::Outline { name: "blank", x, y, role: Role::Stock });
    let (x, y) = contour(&|s| s.diameter_mm / 2.0);
    items.push(Item::Outline { name: "held_shaft", x, y, role: Role::Part });
    let radius_at = |z: f64| {
        let mut left = 0.0;
        for segment in &job.shaft.segments {
            left += segment.length_mm;
            if z <= left {
                return segment.diameter_mm / 2.0;
            }
        }
        job.shaft.segments.last().map_or(0.0, |s| s.diameter_mm / 2.0)
    };
    let tool_z = outcome.shares.z_mm;
    let (_, tail) = ends(&job.supports);
    for (i, support) in job.supports.iter().enumerate() {
        items.push(match *support {
            Support::Centre { z_mm, .. } => {
                let glyph = if Some(i) == tail { Glyph::CentreRight } else { Glyph::CentreLeft };
                Item::Glyph { glyph, x: z_mm, y: 0.0 }
            }
            // It grips the part on both sides of the axis.
            Support::Chuck { z_mm, .. } => Item::Glyph { glyph: Glyph::Chuck, x: z_mm, y: 0.0 },
            Support::SteadyRest { z_mm, .. } => Item::Glyph { glyph: Glyph::SteadyRest, x: z_mm, y: radius_at(z_mm) },
            Support::FollowRest { offset_mm, .. } => {
                let z = tool_z + offset_mm;
                Item::Glyph { glyph: Glyph::FollowRest, x: z, y: radius_at(z) }
            }
        });
    }
    items.push(Item::Glyph { glyph: Glyph::Tool, x: tool_z, y: -radius_at(tool_z) });
    // Passes have diameters of their own, which those of the drawing cannot leave behind.
    let is_free = |item: &Item| job.passes.is_empty() || !matches!(item, Item::Handle(of) if of.along == Along::Y);
    items.extend(handles(&job.shaft, &job.supports).into_iter().filter(is_free));
    Panel { y: Axis::linear("radius", "mm"), height, items }
}

fn compliance(stations: &StationColumns, height: f64) -> Panel {
    let line = |name, values: &[f64], role| Item::Line { name, x: stations.z_mm.clone(), y: some(values), role };
    let work = stations.work_compliance_um_per_n.as_ref();
    let work = work.map(|values| line("work_compliance", values, Role::Comparison));
    let total = line("total_compliance", &stations.compliance_um_per_n, Role::Plain);
    Panel { y: Axis::linear("compliance", "um/N"), height, items: work.into_iter().chain([total]).collect() }
}

fn errors(job: &Job, outcome: &Outcome, height: f64) -> Panel {
    let stations = &outcome.stations;
    let mut items = Vec::new();
    let ends = [stations.z_mm.first(), stations.z_mm.last()];
    let limits = job.tolerance.size();
    if let (Some(lower), Some(upper), [Some(&from), Some(&to)]) = (limits.lower_um, limits.upper_um, ends) {
        items.push(Item::Band {
            name: "tolerance_band",
            x: vec![from, to],
            lower: vec![lower; 2],
            upper: vec![upper; 2],
            role: Role::Tolerance,
        });
    }
    let after = stations.diameter_error_compensated_um.as_ref();
    let whole = after.and_then(|after| after.iter().copied().collect::<Option<Vec<f64>>>());
    if let Some(fan) = &outcome.error_fan {
        let band = |name, lower: &[f64], upper: &[f64]| Item::Band {
            name,
            x: fan.z_mm.clone(),
            lower: lower.to_vec(),
            upper: upper.to_vec(),
            role: Role::Uncertainty,
        };
        items.push(band("nine_of_ten_parts", &fan.below_5_percent_um, &fan.below_95_percent_um));
        items.push(band("half_of_the_parts", &fan.below_25_percent_um, &fan.below_75_percent_um));
    } else if let (Some(after), Some(unsure)) = (whole, &stations.diameter_uncertainty_um) {
        let shifted = |sign: f64| -> Vec<f64> { after.iter().zip(unsure).map(|(e, u)| e + sign * 2.0 * u).collect() };
        items.push(Item::Band {
            name: "uncertainty_band",
            x: stations.z_mm.clone(),
            lower: shifted(-1.0),
            upper: shifted(1.0),
            role: Role::Uncertainty,
        });
    }
    items.push(Item::Line {
        name: "without_compensation",
        x: stations.z_mm.clone(),
        y: stations.diameter_error_uncompensated_um.clone(),
        role: Role::Before,
    });
    items.extend(after.map(|after| with_compensation(stations, after)));
    Panel { y: Axis::linear("diameter_error", "um"), height, items }
}

fn path(outcome: &Outcome, height: f64) -> Panel {
    let stations = &outcome.stations;
    let vertices: Vec<(f64, f64)> = outcome
        .path
        .iter()
        .flat_map(|path| &path.zones)
        .flat_map(|zone| zone.z_mm.iter().copied().zip(zone.delta_x_um.iter().map(|x| x / 2.0)))
        .collect();
    let mut items = Vec::new();
    if let (Some(&from), Some(&to)) = (stations.z_mm.first(), stations.z_mm.last()) {
        items.push(Item::Line {
            name: "nominal_line",
            x: vec![from, to],
            y: vec![Some(0.0), Some(0.0)],
            role: Role::Nominal,
        });
    }
    items.push(Item::Line {
        name: "commanded_path",
        x: stations.z_mm.clone(),
        y: offsets_um(&stations.commanded_diameter_mm, &stations.diameter_mm),
        role: Role::Command,
    });
    if outcome.path.is_some() {
        let (x, y) = vertices.into_iter().unzip();
        items.push(Item::Points { name: "programmed_vertices", x, y, role: Role::Command });
    }
    Panel { y: Axis::linear("path_offset", "um"), height, items }
}

fn one_step(outcome: &Outcome, height: f64) -> Panel {
    let stations = &outcome.stations;
    let line = |name, y: &[Option<f64>], role| Item::Line { name, x: stations.z_mm.clone(), y: y.to_vec(), role };
    Panel {
        y: Axis::linear("diameter_error", "um"),
        height,
        items: outcome
            .one_step
            .iter()
            .map(|step| line("one_step_formula", &step.diameter_error_um, Role::Comparison))
            .chain(stations.diameter_error_compensated_um.iter().map(|after| with_compensation(stations, after)))
            .collect(),
    }
}

fn with_compensation(stations: &StationColumns, after: &[Option<f64>]) -> Item {
    Item::Line { name: "with_compensation", x: stations.z_mm.clone(), y: after.to_vec(), role: Role::After }
}

pub(in crate::deflection_compensation) fn tables(job: &Job, outcome: &Outcome) -> Vec<Table> {
    vec![
        Table { id: "stations", columns: station_columns(&outcome.stations) },
        crate::deflection_compensation::answer::toolpath::path_table(job, outcome),
        increments_table(outcome),
        one_step_table(outcome),
        passes_table(outcome),
        doubt::table(outcome.conformance.as_ref().map_or(&[], |sure| &sure.contributions)),
    ]
}

fn station_columns(stations: &StationColumns) -> Vec<Column> {
    let mut columns = vec![
        Column::numbers("z", "mm", &stations.z_mm),
        Column::numbers("diameter", "mm", &stations.diameter_mm),
        Column::numbers("stock_diameter", "mm", &stations.stock_diameter_mm),
    ];
    let work = stations.work_compliance_um_per_n.as_ref();
    columns.extend(work.map(|values| Column::numbers("work_compliance", "um/N", values)));
    columns.extend([
        Column::numbers("compliance", "um/N", &stations.compliance_um_per_n),
        Column::numbers("depth", "mm", &stations.depth_mm),
        Column::numbers("passive_force", "N", &stations.passive_force_n),
    ]);
    let acting = [
        ("main_force", "N", &stations.main_force_n),
        ("feed_force", "N", &stations.feed_force_n),
        ("tangential_deflection", "um", &stations.tangential_deflection_um),
    ];
    for (name, unit, values) in acting {
        columns.extend(values.as_ref().map(|values| Column::numbers(name, unit, values)));
    }
    columns.push(Column::numbers("deflection", "um", &stations.deflection_um));
    let (error, command) = (&stations.diameter_error_uncompensated_um, &stations.commanded_diameter_mm);
    let along = [
        ("depth_uncompensated", "mm", stations.depth_uncompensated_mm.as_ref()),
        ("diameter_error_uncompensated", "um", Some(error)),
        ("offset", "um", stations.offset_um.as_ref()),
        ("commanded_diameter", "mm", Some(command)),
        ("diameter_error_compensated", "um", stations.diameter_error_compensated_um.as_ref()),
    ];
    for (name, unit, values) in along {
        columns.extend(values.map(|values| Column::optional(name, unit, values)));
    }
    let unsure = stations.diameter_uncertainty_um.as_ref();
    columns.extend(unsure.map(|values| Column::numbers("diameter_uncertainty", "um", values)));
    let copying = stations.copying_factor.as_ref();
    columns.extend(copying.map(|values| Column::optional("copying_factor", "1", values)));
    columns.extend([
        Column::words("status_uncompensated", stations.status_uncompensated.iter().map(|s| s.name().into()).collect()),
        Column::words("status_compensated", stations.status_compensated.iter().map(|s| s.name().into()).collect()),
    ]);
    columns
}

fn zones(outcome: &Outcome) -> &[PathZone] {
    outcome.path.as_ref().map_or(&[], |path| &path.zones)
}

/// For a compensation memory: change of X on the diameter over Z.
fn increments_table(outcome: &Outcome) -> Table {
    let zones = zones(outcome);
    let z: Vec<f64> = zones.iter().flat_map(|zone| zone.z_mm.iter().copied()).collect();
    let delta: Vec<f64> = zones.iter().flat_map(|zone| zone.delta_x_um.iter().copied()).collect();
    Table { id: "increments", columns: vec![Column::numbers("z", "mm", &z), Column::numbers("delta_x", "um", &delta)] }
}

fn one_step_table(outcome: &Outcome) -> Table {
    let nothing = OneStep::default();
    let step = outcome.one_step.as_ref().unwrap_or(&nothing);
    let z: &[f64] = if outcome.one_step.is_some() { &outcome.stations.z_mm } else { &[] };
    Table {
        id: "one_step",
        columns: vec![
            Column::numbers("z", "mm", z),
            Column::optional("factor", "1", &step.factor),
            Column::optional("depth", "mm", &step.depth_mm),
            Column::optional("diameter_error", "um", &step.diameter_error_um),
            Column::optional("residual_commanded_model", "um", &step.residual_commanded_model_um),
            Column::optional("depth_commanded_model", "mm", &step.depth_commanded_model_mm),
        ],
    }
}

/// One row per pass and station.
fn passes_table(outcome: &Outcome) -> Table {
    let passes = &outcome.passes;
    let z = &outcome.stations.z_mm;
    let mut number = Vec::new();
    let (mut station, mut produced, mut error) = (Vec::new(), Vec::new(), Vec::new());
    let (mut commanded, mut copying, mut copied) = (Vec::new(), Vec::new(), Vec::new());
    let mut count = 0.0;
    for pass in passes {
        count += 1.0;
        number.extend(std::iter::repeat_n(count, z.len()));
        station.extend_from_slice(z);
        produced.extend_from_slice(&pass.produced_diameter_mm);
        error.extend_from_slice(&pass.diameter_error_um);
        commanded.extend_from_slice(&pass.commanded_diameter_mm);
        copying.extend_from_slice(&pass.copying_factor);
        copied.extend_from_slice(&pass.copied_so_far);
    }
    Table {
        id: "passes",
        columns: vec![
            Column::numbers("pass", "1", &number),
            Column::numbers("z", "mm", &station),
            Column::numbers("produced_diameter", "mm", &produced),
            Column::numbers("diameter_error", "um", &error),
            Column::optional("commanded_diameter", "mm", &commanded),
            Column::optional("copying_factor", "1", &copying),
            Column::optional("copied_so_far", "1", &copied),
        ],
    }
}
