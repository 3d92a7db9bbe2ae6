//! Pictures and tables of the answer.

use std::borrow::Cow;

use crate::calculator::{Axis, Column, Figure, Frame, Item, Message, Panel, Role, Table};
use crate::certainty::picture as doubt;
use crate::diameters::DOUBT_LABELS;

use super::super::job::{Job, ProgramStock};
use super::super::model::reader::{CycleKind, Kind};
use super::compensated::{CompensatedProgram, LineChange};
use super::left::{ErrorAlong, LeftSurface, YieldedWork};
use super::moves::Path;
use super::output::Outcome;
use super::refed::RefedFeeds;

pub(crate) const FIGURE_IDS: &[&str] = &["program", doubt::ID];
pub(crate) const TABLE_IDS: &[&str] = &["moves", "cycles", "surface", "errors", "cuts", "changes", "feeds", doubt::ID];

/// Codes of titles, axes and legends.
pub(crate) const LABEL_CODES: &[&str] = &[
    "program_moves",
    "program_z",
    "program_diameter",
    "moves_rapid",
    "moves_feed",
    "moves_arc",
    "surface_of_blank",
    "surface_of_program",
    "error_of_diameter",
    "error_as_programmed",
    "error_as_corrected",
    "feed_of_lines",
    "feed_as_programmed",
    "feed_as_given_back",
];

/// Chords of a quarter in the picture.
const CHORDS_OF_QUARTER: f64 = 12.0;

/// The half plane of the program with blank, moves and what is left; below it, on the same axis, the error along the contour.
pub(crate) fn figures(job: &Job, outcome: &Outcome) -> Vec<Figure> {
    let zero_mm = job.program_zero_z_mm.unwrap_or(0.0);
    let (mut items, left) = match job.stock.as_ref().zip(outcome.surface.as_ref()) {
        Some((stock, surface)) => {
            let [blank, left] = outlines(stock, surface, zero_mm);
            (vec![blank], Some(left))
        }
        None => (Vec::new(), None),
    };
    items.extend(moves(job, outcome));
    items.extend(left);
    let panel = |y, height, items| Panel { y, height, items };
    let mut panels = vec![panel(Axis::linear("program_diameter", "mm"), 3.0, items)];
    if let Some(yielding) = outcome.yielding.as_ref().filter(|yielding| yielding.contour.z_mm.len() > 1) {
        let before = error_along("error_as_programmed", &yielding.contour, zero_mm, Role::Before);
        let after = outcome.compensation.as_ref().map(|one| &one.contour).filter(|along| !along.z_mm.is_empty());
        let after = after.map(|along| error_along("error_as_corrected", along, zero_mm, Role::After));
        let items = [before].into_iter().chain(after).collect();
        panels.push(panel(Axis::linear("error_of_diameter", "um"), 2.0, items));
    }
    if let Some(refeed) = &outcome.refeed {
        let feeds = &refeed.feeds;
        let before = feeds_along("feed_as_programmed", feeds, &feeds.old_feed_mm_per_rev, zero_mm, Role::Before);
        let after = feeds_along("feed_as_given_back", feeds, &feeds.new_feed_mm_per_rev, zero_mm, Role::After);
        panels.push(panel(Axis::linear("feed_of_lines", "mm/rev"), 2.0, vec![before, after]));
    }
    panels.retain(|panel| !panel.items.is_empty());
    let program = Figure {
        id: "program",
        title: Message::new("program_moves"),
        frame: Frame::Stacked,
        x: Axis::linear("program_z", "mm"),
        panels,
    };
    let sure = outcome.conformance.as_ref();
    let doubted = sure.and_then(|sure| doubt::figure(&sure.contributions, &sure.joint, DOUBT_LABELS));
    Some(program).filter(|program| !program.panels.is_empty()).into_iter().chain(doubted).collect()
}

/// Ways of the tool.
fn moves(job: &Job, outcome: &Outcome) -> Vec<Item> {
    let start = job.reading.start.map(|start| [start.x_diameter_mm, start.z_mm]);
    let mut lines = [Curve::new("moves_rapid"), Curve::new("moves_feed"), Curve::new("moves_arc")];
    for path in outcome.moves.paths(start) {
        match (path.kind, path.centre) {
            (Kind::Rapid, _) => lines[0].add(&[path.start, path.end]),
            (Kind::Line, _) => lines[1].add(&[path.start, path.end]),
            (Kind::ArcCw | Kind::ArcCcw, Some(centre)) => lines[2].add(&chords(&path, centre)),
            _ => {}
        }
    }
    let roles = [Role::Comparison, Role::Command, Role::Command];
    let drawn = lines.into_iter().zip(roles).filter(|(curve, _)| !curve.x.is_empty());
    drawn.map(|(curve, role)| Item::Line { name: curve.name, x: curve.x, y: curve.y, role }).collect()
}

/// An error with gaps where another line goes on.
fn error_along(name: &'static str, along: &ErrorAlong, zero_mm: f64, role: Role) -> Item {
    let (mut x, mut y) = (Vec::new(), Vec::new());
    for (i, (z, &error)) in along.z_mm.iter().zip(&along.diameter_error_um).enumerate() {
        let z = z - zero_mm;
        if i > 0 && along.line[i - 1] != along.line[i] {
            x.push(z);
            y.push(None);
        }
        x.push(z);
        y.push(Some(error));
    }
    Item::Line { name, x, y, role }
}

/// Feeds over the stretches of their lines, with gaps between them.
fn feeds_along(name: &'static str, feeds: &RefedFeeds, values: &[f64], zero_mm: f64, role: Role) -> Item {
    let (mut x, mut y) = (Vec::new(), Vec::new());
    for (i, &value) in values.iter().enumerate() {
        if i > 0 {
            x.push(feeds.z_start_mm[i] - zero_mm);
            y.push(None);
        }
        x.extend([feeds.z_start_mm[i] - zero_mm, feeds.z_end_mm[i] - zero_mm]);
        y.extend([Some(value); 2]);
    }
    Item::Line { name, x, y, role }
}

/// The blank and what is left of it, from program zero.
fn outlines(stock: &ProgramStock, surface: &LeftSurface, zero_mm: f64) -> [Item; 2] {
    let mut left = Curve::new("surface_of_program");
    for i in 0..surface.z_start_mm.len() {
        let ends =
            [[surface.diameter_start_mm[i], surface.z_start_mm[i]], [surface.diameter_end_mm[i], surface.z_end_mm[i]]];
        let arc = surface.centre_diameter_mm[i].zip(surface.centre_z_mm[i]).zip(surface.arc_radius_mm[i]);
        // Steps are drawn as they stand.
        if left.x.is_empty() {
            left.push(ends[0]);
        }
        match arc {
            None => ends.iter().for_each(|&end| left.push(end)),
            Some(((x, z), radius)) => {
                // Over the work a convex arc runs clockwise from left to right.
                let kind = if radius > 0.0 { Kind::ArcCw } else { Kind::ArcCcw };
                let path = Path { kind, start: ends[0], end: ends[1], centre: Some([x, z]) };
                for point in chords(&path, [x, z]) {
                    left.push(point);
                }
            }
        }
    }
    let blank = Item::Line {
        name: "surface_of_blank",
        x: stock.profile.iter().map(|row| row.z_mm - zero_mm).collect(),
        y: stock.profile.iter().map(|row| Some(row.diameter_mm)).collect(),
        role: Role::Stock,
    };
    let x = left.x.into_iter().map(|z| z - zero_mm).collect();
    [blank, Item::Line { name: left.name, x, y: left.y, role: Role::Part }]
}

/// Pieces of one kind with gaps between them.
struct Curve {
    name: &'static str,
    x: Vec<f64>,
    y: Vec<Option<f64>>,
}

impl Curve {
    fn new(name: &'static str) -> Self {
        Self { name, x: Vec::new(), y: Vec::new() }
    }

    /// A piece through points (diameter and z), which goes on where the last one ended.
    fn add(&mut self, points: &[[f64; 2]]) {
        let [first, ..] = points else { return };
        let ended = self.x.last().copied().zip(self.y.last().copied().flatten());
        let goes_on = ended.is_some_and(|(z, x)| [x, z].map(f64::to_bits) == first.map(f64::to_bits));
        if !goes_on {
            if let Some(&z) = self.x.last() {
                self.x.push(z);
                self.y.push(None);
            }
            self.push(*first);
        }
        points[1..].iter().for_each(|&point| self.push(point));
    }

    fn push(&mut self, [x, z]: [f64; 2]) {
        self.x.push(z);
        self.y.push(Some(x));
    }
}

/// An arc as chords.
fn chords(path: &Path, centre: [f64; 2]) -> Vec<[f64; 2]> {
    let ((from, turn), radius) = (path.turn(centre), path.radius(centre));
    let count = (turn.abs() / std::f64::consts::FRAC_PI_2 * CHORDS_OF_QUARTER).ceil().max(1.0);
    // A full turn has 48.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let count = count as usize;
    let between = (1..count).map(|i| {
        let angle = from + turn * i as f64 / count as f64;
        [centre[0] + 2.0 * radius * angle.sin(), centre[1] + radius * angle.cos()]
    });
    std::iter::once(path.start).chain(between).chain(std::iter::once(path.end)).collect()
}

pub(crate) fn tables(outcome: &Outcome) -> Vec<Table> {
    let moves = &outcome.moves;
    let lines: Vec<f64> = moves.line.iter().map(|&line| line as f64).collect();
    let tools = moves.tool.iter().map(|tool| {
        let named = tool.and_then(|tool| outcome.tools.get(tool as usize));
        Cow::Owned(named.cloned().unwrap_or_default())
    });
    let optional = |name, unit, cells: &[Option<f64>]| Column::optional(name, unit, cells);
    let mut found = vec![Table {
        id: "moves",
        columns: vec![
            Column::numbers("line", "1", &lines),
            Column::words("kind", moves.kind.iter().map(|kind| kind.name().into()).collect()),
            optional("x_diameter", "mm", &moves.x_diameter_mm),
            optional("z", "mm", &moves.z_mm),
            optional("centre_x_diameter", "mm", &moves.centre_x_diameter_mm),
            optional("centre_z", "mm", &moves.centre_z_mm),
            optional("feed", "mm/rev", &moves.feed_mm_per_rev),
            optional("feed_rate", "mm/min", &moves.feed_mm_per_min),
            optional("spindle_speed", "rev/min", &moves.spindle_speed_rpm),
            optional("speed", "m/min", &moves.speed_m_per_min),
            optional("spindle_limit", "rev/min", &moves.spindle_limit_rpm),
            Column::words("tool", tools.collect()),
            Column::words("nose_compensation", moves.nose_compensation.iter().map(|nose| nose.name().into()).collect()),
        ],
    }];
    if !outcome.cycles.is_empty() {
        let of = |number: fn(&super::super::model::reader::ContourCycle) -> f64| -> Vec<f64> {
            outcome.cycles.iter().map(number).collect()
        };
        let kinds = outcome.cycles.iter().map(|cycle| match cycle.kind {
            CycleKind::RoughZ => "rough_z".into(),
            CycleKind::RoughX => "rough_x".into(),
            CycleKind::Pattern => "pattern".into(),
            CycleKind::Finishing => "finishing".into(),
        });
        found.push(Table {
            id: "cycles",
            columns: vec![
                Column::numbers("line", "1", &of(|cycle| cycle.line as f64)),
                Column::words("kind", kinds.collect()),
                Column::numbers("from_line", "1", &of(|cycle| cycle.from_line as f64)),
                Column::numbers("to_line", "1", &of(|cycle| cycle.to_line as f64)),
                Column::numbers("allowance_x_diameter", "mm", &of(|cycle| cycle.allowance_x_diameter_mm)),
                Column::numbers("allowance_z", "mm", &of(|cycle| cycle.allowance_z_mm)),
            ],
        });
    }
    if let Some(surface) = &outcome.surface {
        let lines: Vec<Option<f64>> = surface.line.iter().map(|line| line.map(|line| line as f64)).collect();
        found.push(Table {
            id: "surface",
            columns: vec![
                Column::numbers("z_start", "mm", &surface.z_start_mm),
                Column::numbers("z_end", "mm", &surface.z_end_mm),
                Column::numbers("diameter_start", "mm", &surface.diameter_start_mm),
                Column::numbers("diameter_end", "mm", &surface.diameter_end_mm),
                optional("centre_z", "mm", &surface.centre_z_mm),
                optional("centre_diameter", "mm", &surface.centre_diameter_mm),
                optional("arc_radius", "mm", &surface.arc_radius_mm),
                optional("line", "1", &lines),
            ],
        });
    }
    if let Some(yielding) = &outcome.yielding {
        found.extend(tables_of_yielding(yielding));
    }
    if let Some(compensation) = outcome.compensation.as_ref().filter(|one| !one.changes.is_empty()) {
        found.push(changes(compensation));
    }
    if let Some(refeed) = &outcome.refeed {
        let feeds = &refeed.feeds;
        let lines: Vec<f64> = feeds.line.iter().map(|&line| line as f64).collect();
        found.push(Table {
            id: "feeds",
            columns: vec![
                Column::numbers("line", "1", &lines),
                Column::numbers("depth", "mm", &feeds.depth_mm),
                Column::numbers("old_feed", "mm/rev", &feeds.old_feed_mm_per_rev),
                Column::numbers("new_feed", "mm/rev", &feeds.new_feed_mm_per_rev),
                Column::words("binding", feeds.binding.iter().map(|names| names.join(" ").into()).collect()),
            ],
        });
    }
    found.extend(outcome.conformance.as_ref().map(|sure| doubt::table(&sure.contributions)));
    found
}

/// A row for every line that is given back in the place of one that changed.
fn changes(compensation: &CompensatedProgram) -> Table {
    let rows = || {
        compensation.changes.iter().flat_map(|change| {
            change
                .new
                .iter()
                .enumerate()
                .map(move |(i, new)| (change, if i == 0 { change.old.as_str() } else { "" }, new))
        })
    };
    let of = |number: fn(&LineChange) -> f64| -> Vec<f64> { rows().map(|(change, ..)| number(change)).collect() };
    Table {
        id: "changes",
        columns: vec![
            Column::numbers("line", "1", &of(|change| change.line as f64)),
            Column::words("old", rows().map(|(_, old, _)| old.to_owned().into()).collect()),
            Column::words("new", rows().map(|(.., new)| new.clone().into()).collect()),
            Column::numbers("smallest_shift", "um", &of(|change| change.smallest_shift_um)),
            Column::numbers("largest_shift", "um", &of(|change| change.largest_shift_um)),
        ],
    }
}

fn tables_of_yielding(yielding: &YieldedWork) -> [Table; 2] {
    let of = |lines: &[usize]| -> Vec<f64> { lines.iter().map(|&line| line as f64).collect() };
    let (along, cuts) = (&yielding.contour, &yielding.cuts);
    [
        Table {
            id: "errors",
            columns: vec![
                Column::numbers("z", "mm", &along.z_mm),
                Column::numbers("wanted_diameter", "mm", &along.wanted_diameter_mm),
                Column::numbers("diameter_error", "um", &along.diameter_error_um),
                Column::numbers("line", "1", &of(&along.line)),
            ],
        },
        Table {
            id: "cuts",
            columns: vec![
                Column::numbers("line", "1", &of(&cuts.line)),
                Column::numbers("z", "mm", &cuts.z_mm),
                Column::numbers("diameter", "mm", &cuts.diameter_mm),
                Column::numbers("nominal_depth", "mm", &cuts.nominal_depth_mm),
                Column::numbers("depth", "mm", &cuts.depth_mm),
                Column::numbers("lead_angle", "deg", &cuts.lead_angle_deg),
                Column::numbers("compliance", "um/N", &cuts.compliance_um_per_n),
                Column::numbers("radial_force", "N", &cuts.radial_force_n),
                Column::numbers("deflection", "um", &cuts.deflection_um),
            ],
        },
    ]
}
