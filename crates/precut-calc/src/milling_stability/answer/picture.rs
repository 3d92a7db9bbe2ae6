//! Figures and tables of an answer.

use std::borrow::Cow;

use crate::calculator::{Axis, Cells, Column, Figure, Frame, Item, Message, Panel, Place, Role, Said, Setting, Table};
use crate::certainty::picture as doubt;

use super::super::job::{Job, PartClamping};
use super::output::{
    ForceOfSide, LobeIntervals, MillingBoundary, MillingClampMap, MillingLobes, MillingMap, Outcome, SpeedCurve,
    SpeedPocket, WallSide,
};

pub(in crate::milling_stability) const FIGURE_IDS: &[&str] =
    &["lobes", "clamp_map", "speeds", "depth_line", "surface", "clamping", doubt::ID];
pub(in crate::milling_stability) const TABLE_IDS: &[&str] = &[
    "lobes",
    "intervals",
    "lobe_intervals",
    "map",
    "clamp_map",
    "speeds",
    "speed_curve",
    "modes",
    "force",
    "surface",
    "contacts",
    doubt::ID,
];

/// Codes of what may be doubted, in the picture of the doubt.
pub(in crate::milling_stability) const DOUBT_LABELS: &[&str] = &[
    "doubt_tool_mode_frequency",
    "doubt_tool_mode_stiffness",
    "doubt_tool_mode_damping",
    "doubt_work_mode_frequency",
    "doubt_work_mode_stiffness",
    "doubt_work_mode_damping",
    "doubt_cutting_force",
    "doubt_runout",
    "doubt_clamp_force",
    "doubt_friction",
    crate::certainty::picture::MODEL_LABEL,
];

/// Codes that the figures utter.
pub(in crate::milling_stability) const LABEL_CODES: &[&str] = &[
    "spindle_speed",
    "depth_of_cut",
    "multiplier_modulus",
    "safe_area",
    "chatter_limit",
    "examined_up_to",
    "island_from",
    "island_to",
    "spindle_power_limit",
    "spindle_torque_limit",
    "working_point",
    "feed_per_tooth_stays",
    "better_speeds",
    "under_all_limits",
    "removal_rate",
    "milling_speeds",
    "growth_per_tooth",
    "growth_limit",
    "unstable_depths",
    "working_depth",
    "height_of_wall",
    "surface_error",
    "wall_up",
    "wall_down",
    "allowed_surface_error",
    "rotation_of_cutter",
    "clamp_force",
    "clamp_force_asked",
    "clamp_force_at_hand",
    "certain_slip_below",
    "milling_clamping",
    "milling_lobes",
    "milling_clamp_map",
    "milling_depth_line",
    "milling_surface",
];

const SPEED: Axis = Axis::linear("spindle_speed", "rev/min");
const DEPTH: Axis = Axis::linear("depth_of_cut", "mm");

fn line(name: &'static str, x: &[f64], y: Vec<Option<f64>>, role: Role) -> Item {
    Item::Line { name, x: x.to_vec(), y, role }
}

fn some(values: &[f64]) -> Vec<Option<f64>> {
    values.iter().copied().map(Some).collect()
}

fn figure(id: &'static str, title: &'static str, x: Axis, panels: Vec<Panel>) -> Figure {
    Figure { id, title: Message::new(title), frame: Frame::Stacked, x, panels }
}

/// Every figure that the analyses of the job have something for.
pub(in crate::milling_stability) fn figures(job: &Job, outcome: &Outcome) -> Vec<Figure> {
    let mut figures = Vec::new();
    if let Some(diagram) = &outcome.lobes {
        let items = lobes(job, outcome, diagram);
        figures.push(figure("lobes", "milling_lobes", SPEED, vec![Panel { y: DEPTH, height: 1.0, items }]));
    }
    figures.extend(outcome.lobes.as_ref().and_then(|diagram| clamp_map(job, diagram)));
    figures.extend(speeds(job, outcome));
    figures.extend(depth_line(job, outcome));
    figures.extend(surface(job, outcome));
    figures.extend(clamping(job, outcome));
    let sure = outcome.conformance.as_ref();
    figures.extend(sure.and_then(|sure| doubt::figure(&sure.contributions, &sure.joint, DOUBT_LABELS)));
    figures
}

fn lobes(job: &Job, outcome: &Outcome, diagram: &MillingLobes) -> Vec<Item> {
    let mut items: Vec<Item> = diagram.map.iter().map(heat).collect();
    let MillingBoundary { spindle_speed_rpm: x, chatter_mm, power_mm, torque_mm, .. } = &diagram.boundary;
    let most = diagram.examined_to_mm;
    // Under all limits; nothing is safe at a speed that is not answered.
    let answered = diagram.boundary.is_answered();
    let safe = |k: usize| {
        let limits = [chatter_mm[k], power_mm[k], torque_mm[k]];
        if answered[k] { limits.into_iter().flatten().fold(most, f64::min) } else { 0.0 }
    };
    items.push(Item::Band {
        name: "safe_area",
        x: x.clone(),
        lower: vec![0.0; x.len()],
        upper: (0..x.len()).map(safe).collect(),
        role: Role::Stable,
    });
    items.push(line("chatter_limit", x, chatter_mm.clone(), Role::Limit));
    let open = |k: usize| (answered[k] && chatter_mm[k].is_none()).then_some(most);
    let examined: Vec<Option<f64>> = (0..x.len()).map(open).collect();
    if examined.iter().any(Option::is_some) {
        items.push(line("examined_up_to", x, examined, Role::Unstable));
    }
    items.extend(islands(&diagram.intervals));
    for (name, values, series) in [("spindle_power_limit", power_mm, 0), ("spindle_torque_limit", torque_mm, 1)] {
        let shown: Vec<Option<f64>> = values.iter().map(|value| value.filter(|depth| *depth <= most)).collect();
        if shown.iter().any(Option::is_some) {
            items.push(line(name, x, shown, Role::Series(series)));
        }
    }
    items.extend(pockets(outcome, |pocket| pocket.depth_mm));
    let (speed, depth) = (outcome.engagement.spindle_speed_rpm, job.cut.depth_mm);
    items.push(Item::Points { name: "working_point", x: vec![speed], y: vec![depth], role: Role::Command });
    items.push(Item::Setting(Setting {
        name: "working_point",
        x: speed,
        y: depth,
        tried_in: None,
        about: Some(Said { label: "feed_per_tooth_stays" }),
    }));
    items
}

/// The best speeds as points.
fn pockets(outcome: &Outcome, of: impl Fn(&SpeedPocket) -> f64) -> Option<Item> {
    let (x, y) = outcome.speeds.iter().map(|pocket| (pocket.spindle_speed_rpm, of(pocket))).unzip();
    (!outcome.speeds.is_empty()).then_some(Item::Points { name: "better_speeds", x, y, role: Role::After })
}

/// What every speed allows, and what it removes.
fn speeds(job: &Job, outcome: &Outcome) -> Option<Figure> {
    let curve = outcome.speed_curve.as_ref()?;
    let x = &curve.spindle_speed_rpm;
    let working = |y: f64| Item::Points {
        name: "working_point",
        x: vec![outcome.engagement.spindle_speed_rpm],
        y: vec![y],
        role: Role::Command,
    };
    let mut depth = vec![line("under_all_limits", x, curve.depth_mm.clone(), Role::Limit)];
    depth.extend(pockets(outcome, |pocket| pocket.depth_mm));
    depth.push(working(job.cut.depth_mm));
    let mut rate = vec![line("removal_rate", x, curve.removal_rate_cm3_per_min.clone(), Role::Plain)];
    rate.extend(pockets(outcome, |pocket| pocket.removal_rate_cm3_per_min));
    rate.push(working(outcome.engagement.removal_rate_cm3_per_min));
    let panels = vec![
        Panel { y: Axis::linear("removal_rate", "cm3/min"), height: 1.0, items: rate },
        Panel { y: DEPTH, height: 1.0, items: depth },
    ];
    Some(figure("speeds", "milling_speeds", SPEED, panels))
}

/// |mu| by its logarithm: decay below 1, growth above.
fn heat(map: &MillingMap) -> Item {
    Item::HeatMap {
        value: Axis::logarithmic("multiplier_modulus", "1"),
        x: map.spindle_speed_rpm.clone(),
        y: map.depth_mm.clone(),
        values: map.per_tooth.iter().map(|value| value.filter(|value| *value > 0.0)).collect(),
        diverging: true,
    }
}

/// The clamp force over the plane, where chatter begins, and the depth at which the force at hand gives out.
fn clamp_map(job: &Job, diagram: &MillingLobes) -> Option<Figure> {
    let map = diagram.clamp_map.as_ref()?;
    let MillingBoundary { spindle_speed_rpm, chatter_mm, .. } = &diagram.boundary;
    let mut items = vec![Item::HeatMap {
        value: Axis::linear("clamp_force", "N"),
        x: map.spindle_speed_rpm.clone(),
        y: map.depth_mm.clone(),
        values: map.clamp_force_n.clone(),
        diverging: false,
    }];
    items.push(line("chatter_limit", spindle_speed_rpm, chatter_mm.clone(), Role::Limit));
    if let Some((force, _)) = job.clamping.as_ref().and_then(PartClamping::clamp_force) {
        let given_out = (0..map.spindle_speed_rpm.len()).map(|column| map.gives_out_mm(column, force)).collect();
        items.push(line("clamp_force_at_hand", &map.spindle_speed_rpm, given_out, Role::Command));
    }
    Some(figure("clamp_map", "milling_clamp_map", SPEED, vec![Panel { y: DEPTH, height: 1.0, items }]))
}

impl MillingClampMap {
    /// The depth of a column at which a clamp force gives out, straight between rows; `None` where it does not.
    fn gives_out_mm(&self, column: usize, force_n: f64) -> Option<f64> {
        let asked = |row: usize| self.clamp_force_n[row * self.spindle_speed_rpm.len() + column];
        let above = (0..self.depth_mm.len()).find(|&row| asked(row).is_some_and(|asked| asked > force_n))?;
        // Without a cut nothing is asked.
        let (depth, held) =
            above.checked_sub(1).map_or(Some((0.0, 0.0)), |row| Some((self.depth_mm[row], asked(row)?)))?;
        let share = (force_n - held) / (asked(above)? - held);
        Some(depth + share * (self.depth_mm[above] - depth))
    }
}

/// Ends of unstable stretches beyond the first of a speed.
fn islands(of: &LobeIntervals) -> Vec<Item> {
    let rows = 0..of.spindle_speed_rpm.len();
    let is_first = |k: usize| k == 0 || of.spindle_speed_rpm[k - 1] < of.spindle_speed_rpm[k];
    let begins = rows.clone().filter(|&k| !is_first(k)).map(|k| (of.spindle_speed_rpm[k], of.from_mm[k])).unzip();
    let ends = rows.filter_map(|k| Some((of.spindle_speed_rpm[k], of.to_mm[k]?))).unzip();
    [("island_from", begins), ("island_to", ends)]
        .into_iter()
        .filter(|(_, (x, _)): &(&str, (Vec<f64>, Vec<f64>))| !x.is_empty())
        .map(|(name, (x, y))| Item::Points { name, x, y, role: Role::Unstable })
        .collect()
}

impl MillingBoundary {
    fn is_answered(&self) -> Vec<bool> {
        self.status.iter().map(|status| *status == super::output::SpeedStatus::Answered).collect()
    }
}

/// Growth over the depth at the working speed, with the depths that are unstable.
fn depth_line(job: &Job, outcome: &Outcome) -> Option<Figure> {
    let curve = outcome.depth_line.as_ref()?;
    let ends = [0.0, outcome.examined_to_mm];
    let mut items = vec![line("growth_per_tooth", &curve.depth_mm, some(&curve.per_tooth), Role::Plain)];
    items.push(line("growth_limit", &ends, vec![Some(1.0); 2], Role::Limit));
    if let Some(multiplier) = &outcome.multiplier {
        let (x, y) = (vec![job.cut.depth_mm], vec![multiplier.per_tooth]);
        items.push(Item::Points { name: "working_depth", x, y, role: Role::Command });
    }
    let mut panels = vec![Panel { y: Axis::linear("growth_per_tooth", "1"), height: 1.0, items }];
    if !outcome.unstable_intervals.is_empty() {
        let from: Vec<f64> = outcome.unstable_intervals.iter().map(|of| of.from_mm.unwrap_or(0.0)).collect();
        let to: Vec<f64> =
            outcome.unstable_intervals.iter().map(|of| of.to_mm.unwrap_or(outcome.examined_to_mm)).collect();
        let places = outcome.unstable_intervals.iter().map(|of| of.kind.name().to_owned()).collect();
        let weight = vec![1.0; from.len()];
        let ribbon = Item::Ribbon { name: "unstable_depths", x: from, x_end: to, weight, places, role: Role::Unstable };
        panels.push(Panel { y: Axis::linear("unstable_depths", "1"), height: 0.2, items: vec![ribbon] });
    }
    Some(figure("depth_line", "milling_depth_line", DEPTH, panels))
}

fn surface(job: &Job, outcome: &Outcome) -> Option<Figure> {
    let walls = &outcome.motion.as_ref()?.walls;
    let first = walls.first()?;
    let mut items: Vec<Item> = walls
        .iter()
        .enumerate()
        .map(|(k, wall)| {
            let name = if wall.wall == WallSide::Up { "wall_up" } else { "wall_down" };
            let role = if k == 0 { Role::Plain } else { Role::Series(0) };
            line(name, &wall.height_mm, some(&wall.surface_error_um), role)
        })
        .collect();
    if let Some(most) = job.limits.surface_error_max_um {
        let x = first.height_mm.clone();
        let (lower, upper) = (vec![-most; x.len()], vec![most; x.len()]);
        items.insert(0, Item::Band { name: "allowed_surface_error", x, lower, upper, role: Role::Tolerance });
    }
    let panel = Panel { y: Axis::linear("surface_error", "um"), height: 1.0, items };
    Some(figure("surface", "milling_surface", Axis::linear("height_of_wall", "mm"), vec![panel]))
}

/// Clamp force that a turn asks for, against that at hand.
fn clamping(job: &Job, outcome: &Outcome) -> Option<Figure> {
    let of = outcome.clamping.as_ref()?;
    let x = &of.over_turn.rotation_deg;
    let ends = [*x.first()?, *x.last()?];
    let level = |name: &'static str, force: Option<f64>, role: Role| {
        force.map(|force| line(name, &ends, vec![Some(force); 2], role))
    };
    let mut items = vec![line("clamp_force_asked", x, some(&of.over_turn.clamp_force_n), Role::Plain)];
    items.extend(level("certain_slip_below", of.certain_slip_below_n, Role::Limit));
    let at_hand = job.clamping.as_ref().and_then(PartClamping::clamp_force);
    items.extend(level("clamp_force_at_hand", at_hand.map(|(force, _)| force), Role::Command));
    let panel = Panel { y: Axis::linear("clamp_force", "N"), height: 1.0, items };
    Some(figure("clamping", "milling_clamping", Axis::linear("rotation_of_cutter", "deg"), vec![panel]))
}

/// The job of a place in the lobe diagram: speed and depth to three digits, the feed per tooth as it is.
pub(in crate::milling_stability) fn at_place(job: &Job, place: &Place<'_>) -> Option<Job> {
    let is_lobes = place.figure == "lobes" && place.setting == "working_point" && place.x > 0.0 && place.y > 0.0;
    is_lobes.then(|| {
        let mut next = job.clone();
        (next.cut.spindle_speed_rpm, next.cut.speed_m_per_min) = (Some(three_digits(place.x)), None);
        next.cut.depth_mm = three_digits(place.y);
        next
    })
}

fn three_digits(value: f64) -> f64 {
    let scale = 10_f64.powf(2.0 - value.log10().floor());
    (value * scale).round() / scale
}

fn words(values: impl Iterator<Item = &'static str>) -> Vec<Cow<'static, str>> {
    values.map(Cow::Borrowed).collect()
}

pub(in crate::milling_stability) fn tables(outcome: &Outcome) -> Vec<Table> {
    let (no_boundary, no_stretches) = (MillingBoundary::default(), LobeIntervals::default());
    let lobes = outcome.lobes.as_ref();
    let of = lobes.map_or(&no_boundary, |lobes| &lobes.boundary);
    let stretches = lobes.map_or(&no_stretches, |lobes| &lobes.intervals);
    vec![
        Table {
            id: "lobes",
            columns: vec![
                Column::numbers("spindle_speed", "rev/min", &of.spindle_speed_rpm),
                Column::optional("chatter", "mm", &of.chatter_mm),
                Column::optional("power", "mm", &of.power_mm),
                Column::optional("torque", "mm", &of.torque_mm),
                Column::words("status", words(of.status.iter().map(|status| status.name()))),
            ],
        },
        intervals(outcome),
        Table {
            id: "lobe_intervals",
            columns: vec![
                Column::numbers("spindle_speed", "rev/min", &stretches.spindle_speed_rpm),
                Column::numbers("from", "mm", &stretches.from_mm),
                Column::optional("to", "mm", &stretches.to_mm),
                Column::words("kind", words(stretches.kind.iter().map(|kind| kind.name()))),
            ],
        },
        map(lobes.and_then(|lobes| lobes.map.as_ref())),
        clamp_table(lobes.and_then(|lobes| lobes.clamp_map.as_ref())),
        speed_table(outcome),
        curve_table(outcome.speed_curve.as_ref()),
        modes(outcome),
        force(outcome),
        wall_table(outcome),
        contacts(outcome),
        doubt::table(outcome.conformance.as_ref().map_or(&[], |sure| &sure.contributions)),
    ]
}

fn numbers<T>(name: &'static str, unit: &'static str, rows: &[T], of: impl Fn(&T) -> Option<f64>) -> Column {
    Column { name: name.into(), unit, cells: Cells::Numbers(rows.iter().map(of).collect()) }
}

fn intervals(outcome: &Outcome) -> Table {
    let rows = &outcome.unstable_intervals;
    let certified = |certified: bool| if certified { "yes" } else { "no" };
    Table {
        id: "intervals",
        columns: vec![
            numbers("from", "mm", rows, |row| row.from_mm),
            numbers("to", "mm", rows, |row| row.to_mm),
            Column::words("kind", words(rows.iter().map(|row| row.kind.name()))),
            numbers("from_low", "mm", rows, |row| row.from_low_mm),
            numbers("from_high", "mm", rows, |row| row.from_high_mm),
            numbers("to_low", "mm", rows, |row| row.to_low_mm),
            numbers("to_high", "mm", rows, |row| row.to_high_mm),
            Column::words("certified", words(rows.iter().map(|row| certified(row.certified)))),
        ],
    }
}

/// One row per point of the map.
fn map(map: Option<&MillingMap>) -> Table {
    let (mut speed, mut depth, mut modulus) = (Vec::new(), Vec::new(), Vec::new());
    if let Some(map) = map {
        for &h in &map.depth_mm {
            speed.extend_from_slice(&map.spindle_speed_rpm);
            depth.extend(std::iter::repeat_n(h, map.spindle_speed_rpm.len()));
        }
        modulus.clone_from(&map.per_tooth);
    }
    Table {
        id: "map",
        columns: vec![
            Column::numbers("spindle_speed", "rev/min", &speed),
            Column::numbers("depth", "mm", &depth),
            Column::optional("per_tooth", "1", &modulus),
        ],
    }
}

/// One row per place of the map of the clamp force.
fn clamp_table(map: Option<&MillingClampMap>) -> Table {
    let columns = map.map_or(0, |map| map.spindle_speed_rpm.len());
    let rows: Vec<([f64; 2], [Option<f64>; 3])> = map
        .iter()
        .flat_map(|map| map.clamp_force_n.iter().enumerate().map(move |(k, force)| (map, k, force)))
        .map(|(map, k, force)| {
            let (row, column) = (k / columns, k % columns);
            ([map.spindle_speed_rpm[column], map.depth_mm[row]], [*force, map.static_n[row], map.mean_n[row]])
        })
        .collect();
    Table {
        id: "clamp_map",
        columns: vec![
            numbers("spindle_speed", "rev/min", &rows, |row| Some(row.0[0])),
            numbers("depth", "mm", &rows, |row| Some(row.0[1])),
            numbers("clamp_force", "N", &rows, |row| row.1[0]),
            numbers("static_clamp_force", "N", &rows, |row| row.1[1]),
            numbers("mean_clamp_force", "N", &rows, |row| row.1[2]),
        ],
    }
}

fn speed_table(outcome: &Outcome) -> Table {
    let rows = &outcome.speeds;
    Table {
        id: "speeds",
        columns: vec![
            numbers("spindle_speed", "rev/min", rows, |row| Some(row.spindle_speed_rpm)),
            numbers("depth", "mm", rows, |row| Some(row.depth_mm)),
            numbers("width", "mm", rows, |row| Some(row.width_mm)),
            numbers("removal_rate", "cm3/min", rows, |row| Some(row.removal_rate_cm3_per_min)),
            Column::words("binds", words(rows.iter().map(|row| row.binds.name()))),
            numbers("chatter", "mm", rows, |row| row.chatter_depth_mm),
            numbers("power", "kW", rows, |row| Some(row.motor_power_kw)),
            numbers("torque", "N m", rows, |row| Some(row.torque_n_m)),
            numbers("peak_to_peak", "um", rows, |row| row.peak_to_peak_um),
            numbers("surface_error", "um", rows, |row| row.surface_error_um),
        ],
    }
}

fn curve_table(curve: Option<&SpeedCurve>) -> Table {
    let nothing = SpeedCurve::default();
    let of = curve.unwrap_or(&nothing);
    Table {
        id: "speed_curve",
        columns: vec![
            Column::numbers("spindle_speed", "rev/min", &of.spindle_speed_rpm),
            Column::optional("depth", "mm", &of.depth_mm),
            Column::words("binds", words(of.binds.iter().map(|binds| binds.map_or("", |binds| binds.name())))),
            Column::optional("removal_rate", "cm3/min", &of.removal_rate_cm3_per_min),
        ],
    }
}

fn modes(outcome: &Outcome) -> Table {
    let rows = &outcome.modes;
    Table {
        id: "modes",
        columns: vec![
            Column::words("side", words(rows.iter().map(|row| row.side.name()))),
            numbers("x", "1", rows, |row| Some(row.x)),
            numbers("y", "1", rows, |row| Some(row.y)),
            numbers("z", "1", rows, |row| Some(row.z)),
            numbers("frequency", "Hz", rows, |row| Some(row.frequency_hz)),
            numbers("stiffness", "N/mm", rows, |row| Some(row.stiffness_n_per_mm)),
            numbers("damping_ratio", "1", rows, |row| Some(row.damping_ratio)),
            numbers("energy_share", "1", rows, |row| row.energy_share),
        ],
    }
}

fn force(outcome: &Outcome) -> Table {
    let rows = [("tool", outcome.force.tool), ("work", outcome.force.work)];
    let axes = ["x", "y", "z"];
    let of =
        |pick: fn(&ForceOfSide) -> [f64; 3]| -> Vec<f64> { rows.iter().flat_map(|(_, side)| pick(side)).collect() };
    Table {
        id: "force",
        columns: vec![
            Column::words("side", words(rows.iter().flat_map(|(name, _)| [*name; 3]))),
            Column::words("direction", words(rows.iter().flat_map(|_| axes))),
            Column::numbers("mean", "N", &of(|side| [side.x_mean_n, side.y_mean_n, side.z_mean_n])),
            Column::numbers("min", "N", &of(|side| [side.x_min_n, side.y_min_n, side.z_min_n])),
            Column::numbers("max", "N", &of(|side| [side.x_max_n, side.y_max_n, side.z_max_n])),
        ],
    }
}

fn contacts(outcome: &Outcome) -> Table {
    let rows = outcome.clamping.as_ref().map_or(&[][..], |clamping| &clamping.contacts);
    let counted: Vec<f64> = (1..=rows.len()).map(|number| number as f64).collect();
    Table {
        id: "contacts",
        columns: vec![
            Column::numbers("contact", "1", &counted),
            numbers("x", "mm", rows, |row| Some(row.x_mm)),
            numbers("y", "mm", rows, |row| Some(row.y_mm)),
            numbers("z", "mm", rows, |row| Some(row.z_mm)),
            numbers("rest", "N", rows, |row| Some(row.rest_n)),
            numbers("least_normal", "N", rows, |row| Some(row.least_normal_n)),
            numbers("tangential", "N", rows, |row| Some(row.tangential_n)),
            numbers("friction_used", "percent", rows, |row| row.friction_used_percent),
        ],
    }
}

fn wall_table(outcome: &Outcome) -> Table {
    let walls = outcome.motion.as_ref().map_or(&[][..], |motion| &motion.walls);
    let side = |side: WallSide| if side == WallSide::Up { "up" } else { "down" };
    let heights: Vec<f64> = walls.iter().flat_map(|wall| wall.height_mm.iter().copied()).collect();
    let errors: Vec<f64> = walls.iter().flat_map(|wall| wall.surface_error_um.iter().copied()).collect();
    Table {
        id: "surface",
        columns: vec![
            Column::words(
                "wall",
                words(walls.iter().flat_map(|wall| std::iter::repeat_n(side(wall.wall), wall.height_mm.len()))),
            ),
            Column::numbers("height", "mm", &heights),
            Column::numbers("surface_error", "um", &errors),
        ],
    }
}
