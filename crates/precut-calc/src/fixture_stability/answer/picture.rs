//! Figures and tables of an answer.

use crate::calculator::{Axis, Column, Figure, Frame, Item, Message, Panel, Place, Role, Said, Setting, Table};
use crate::certainty::picture as doubt;

use crate::fixture_stability::answer::output::{
    AmplitudeCurve, ArcProfile, FixtureOutcome, LobeBoundary, LobeDiagram, LobeMap, Oscillogram,
};
use crate::fixture_stability::answer::probable_depths::ProbableDepths;
use crate::fixture_stability::job::input::FixtureJob;
use crate::fixture_stability::model::floquet::Working;
use crate::fixture_stability::model::lobes::Map;

pub(in crate::fixture_stability) const FIGURE_IDS: &[&str] =
    &["lobes", "oscillogram", "last_revolution", "chip", "amplitude", doubt::ID];
pub(in crate::fixture_stability) const TABLE_IDS: &[&str] =
    &["boundary", "map", "amplitude", "probable_depths", "entry", "steady", "arc", doubt::ID];

/// Codes of what may be doubted, in the picture of the doubt.
pub(in crate::fixture_stability) const DOUBT_LABELS: &[&str] = &[
    "doubt_joint_stiffness",
    "doubt_movable_joint_stiffness",
    "doubt_fixed_joint_stiffness",
    "doubt_damping",
    "doubt_workpiece_mass",
    "doubt_cutting_force",
    "doubt_clamp_force",
    "doubt_friction",
    crate::certainty::picture::MODEL_LABEL,
];

/// Codes that the figures utter.
pub(in crate::fixture_stability) const LABEL_CODES: &[&str] = &[
    "spindle_speed",
    "depth_of_cut",
    "time",
    "displacement",
    "force_along_feed",
    "tooth_angle",
    "chip_thickness",
    "peak_to_peak",
    "clamp_force_asked",
    "multiplier_modulus",
    "safe_area",
    "chatter_limit",
    "zeroth_order_limit",
    "probable_limits",
    "wanted_probability",
    "amplitude_limit",
    "movable_joint_limit",
    "fixed_joint_limit",
    "slip_limit",
    "spindle_power_limit",
    "spindle_torque_limit",
    "refined_boundary",
    "better_speeds",
    "working_point",
    "feed_per_tooth_stays",
    "working_depth",
    "workpiece_displacement",
    "jaw_displacement",
    "cutting_force",
    "actual_chip",
    "smooth_chip",
    "feed_per_tooth",
    "movable_joint",
    "fixed_joint",
    "given_clamp_force",
    "fixture_lobes",
    "fixture_oscillogram",
    "fixture_last_revolution",
    "fixture_chip",
    "fixture_amplitude",
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

/// |mu| by its logarithm: decay below 1, growth above.
fn heat(speeds: &[f64], depths: &[f64], modulus: impl Iterator<Item = Option<f64>>) -> Item {
    Item::HeatMap {
        value: Axis::logarithmic("multiplier_modulus", "1"),
        x: speeds.to_vec(),
        y: depths.to_vec(),
        // A map that is still growing has zeros where nothing was computed yet.
        values: modulus.map(|modulus| modulus.filter(|m| *m > 0.0)).collect(),
        diverging: true,
    }
}

fn working_point(spindle_rpm: f64, depth_mm: f64) -> Item {
    Item::Points { name: "working_point", x: vec![spindle_rpm], y: vec![depth_mm], role: Role::Command }
}

/// The lobe diagram while it is computed.
pub(in crate::fixture_stability) fn lobes_so_far(
    boundary: &[(f64, Option<f64>)],
    map: Option<&Map>,
    working: Working,
) -> Figure {
    let mut items: Vec<Item> = map
        .map(|map| heat(&map.speeds_rpm, &map.depths_mm, map.modulus.iter().copied().map(Some)))
        .into_iter()
        .collect();
    let mut points: Vec<(f64, Option<f64>)> = boundary.to_vec();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (x, y): (Vec<f64>, Vec<Option<f64>>) = points.into_iter().unzip();
    items.push(Item::Line { name: "chatter_limit", x, y, role: Role::Limit });
    if let Some(map) = map.filter(|map| !map.refined.is_empty()) {
        let (x, y) = map.refined.iter().copied().unzip();
        items.push(Item::Points { name: "refined_boundary", x, y, role: Role::Unstable });
    }
    items.push(working_point(working.spindle_rpm, working.depth_mm));
    figure("lobes", "fixture_lobes", SPEED, vec![Panel { y: DEPTH, height: 1.0, items }])
}

/// Every figure that the analyses of the job have something for.
pub(in crate::fixture_stability) fn figures(job: &FixtureJob, outcome: &FixtureOutcome) -> Vec<Figure> {
    let mut figures = Vec::new();
    if let Some(diagram) = &outcome.lobes {
        let items = lobes(job, outcome, diagram);
        figures.push(figure("lobes", "fixture_lobes", SPEED, vec![Panel { y: DEPTH, height: 1.0, items }]));
    }
    if let Some(history) = &outcome.history {
        figures.push(oscillogram("oscillogram", "fixture_oscillogram", &history.entry));
        figures.push(oscillogram("last_revolution", "fixture_last_revolution", &history.steady));
        figures.push(chip(&history.arc));
    }
    figures.extend(outcome.limits.as_ref().map(|limits| amplitude(job, outcome, &limits.curve)));
    let sure = outcome.conformance.as_ref();
    figures.extend(sure.and_then(|sure| doubt::figure(&sure.contributions, &sure.joint, DOUBT_LABELS)));
    figures
}

fn chip(arc: &ArcProfile) -> Figure {
    let items = vec![
        line("smooth_chip", &arc.angle_deg, some(&arc.smooth_chip_mm), Role::Nominal),
        line("actual_chip", &arc.angle_deg, some(&arc.chip_thickness_mm), Role::Plain),
    ];
    let panel = Panel { y: Axis::linear("chip_thickness", "mm"), height: 1.0, items };
    figure("chip", "fixture_chip", Axis::linear("tooth_angle", "deg"), vec![panel])
}

fn lobes(job: &FixtureJob, outcome: &FixtureOutcome, lobes: &LobeDiagram) -> Vec<Item> {
    let working = working_point(outcome.engagement.spindle_speed_rpm, job.cut.depth_mm);
    let mut items: Vec<Item> =
        lobes.map.iter().map(|map| heat(&map.spindle_speed_rpm, &map.depth_mm, map.modulus.iter().copied())).collect();
    let LobeBoundary { spindle_speed_rpm: x, .. } = &lobes.boundary;
    let of = &lobes.boundary;
    items.push(Item::Band {
        name: "safe_area",
        x: x.clone(),
        lower: vec![0.0; x.len()],
        upper: of.safe_mm(),
        role: Role::Stable,
    });
    if let Some(depths) = &outcome.probable_depths {
        items.extend(probable(depths));
    }
    items.push(line("chatter_limit", x, of.chatter_mm.clone(), Role::Limit));
    if let Some(depths) = of.examined_without_chatter_mm() {
        items.push(line("examined_up_to", x, depths, Role::Unstable));
    }
    items.push(line("zeroth_order_limit", x, of.zeroth_order_mm.clone(), Role::Comparison));
    for (name, values, series) in [
        ("amplitude_limit", &of.amplitude_mm, 0),
        ("movable_joint_limit", &of.movable_opens_mm, 1),
        ("fixed_joint_limit", &of.fixed_opens_mm, 2),
        ("spindle_power_limit", &of.power_mm, 3),
        ("spindle_torque_limit", &of.torque_mm, 4),
        ("slip_limit", &of.slips_mm, 5),
    ] {
        if values.iter().any(Option::is_some) {
            items.push(line(name, x, values.clone(), Role::Series(series)));
        }
    }
    if let Some(LobeMap { refined_speed_rpm, refined_depth_mm, .. }) = &lobes.map
        && !refined_speed_rpm.is_empty()
    {
        items.push(Item::Points {
            name: "refined_boundary",
            x: refined_speed_rpm.clone(),
            y: refined_depth_mm.clone(),
            role: Role::Unstable,
        });
    }
    if !lobes.better_speeds.is_empty() {
        let better = lobes.better_speeds.iter().map(|better| (better.spindle_speed_rpm, better.depth_mm));
        let (x, y) = better.unzip();
        items.push(Item::Points { name: "better_speeds", x, y, role: Role::After });
    }
    items.push(working);
    let (x, y) = (outcome.engagement.spindle_speed_rpm, job.cut.depth_mm);
    items.push(Item::Setting(Setting {
        name: "working_point",
        x,
        y,
        tried_in: None,
        about: Some(Said { label: "feed_per_tooth_stays" }),
    }));
    items
}

/// Between which depths nine of ten such vises and one of ten are stable, as far as the diagram goes, and the wanted share of them.
fn probable(depths: &ProbableDepths) -> [Item; 2] {
    let x = &depths.spindle_speed_rpm;
    let known = depths.stable_10_percent_mm.iter().chain(&depths.stable_90_percent_mm).flatten();
    let top = known.copied().fold(0.0, f64::max);
    let up_to = |of: &[Option<f64>]| of.iter().map(|depth| depth.unwrap_or(top)).collect();
    let band = Item::Band {
        name: "probable_limits",
        x: x.clone(),
        lower: up_to(&depths.stable_90_percent_mm),
        upper: up_to(&depths.stable_10_percent_mm),
        role: Role::Uncertainty,
    };
    [band, line("wanted_probability", x, depths.stable_wanted_mm.clone(), Role::Command)]
}

/// The job of a place in the lobe diagram: speed and depth to three digits, the feed per tooth as it is.
pub(in crate::fixture_stability) fn at_place(job: &FixtureJob, place: &Place<'_>) -> Option<FixtureJob> {
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

/// A stretch of the cut in time, at the time at which it was: the entry and the last revolution lie too far apart for one
/// axis.
fn oscillogram(id: &'static str, title: &'static str, of: &Oscillogram) -> Figure {
    let curve = |name, values: &[f64], role| line(name, &of.time_s, some(values), role);
    let panel = |y: Axis, items: Vec<Item>| Panel { y, height: 1.0, items };
    let mut displacement = vec![curve("workpiece_displacement", &of.displacement_um, Role::Plain)];
    displacement.extend(of.jaw_um.as_ref().map(|jaw| curve("jaw_displacement", jaw, Role::Series(0))));
    let force = vec![curve("cutting_force", &of.force_n, Role::Plain)];
    let clamp = vec![
        curve("movable_joint", &of.clamp_movable_n, Role::Series(0)),
        curve("fixed_joint", &of.clamp_fixed_n, Role::Series(1)),
    ];
    let panels = vec![
        panel(Axis::linear("force_along_feed", "N"), force),
        panel(Axis::linear("displacement", "um"), displacement),
        panel(Axis::linear("clamp_force_asked", "N"), clamp),
    ];
    figure(id, title, Axis::linear("time", "s"), panels)
}

fn amplitude(job: &FixtureJob, outcome: &FixtureOutcome, curve: &AmplitudeCurve) -> Figure {
    let ends: Vec<f64> = curve.depth_mm.first().into_iter().chain(curve.depth_mm.last()).copied().collect();
    let level = |name, value: f64, role| line(name, &ends, vec![Some(value); ends.len()], role);
    let mut forces = vec![
        line("movable_joint", &curve.depth_mm, some(&curve.clamp_movable_n), Role::Series(0)),
        line("fixed_joint", &curve.depth_mm, some(&curve.clamp_fixed_n), Role::Series(1)),
    ];
    if let Some(force) = job.fixture.common().3 {
        forces.push(level("given_clamp_force", force, Role::Limit));
    }
    figure(
        "amplitude",
        "fixture_amplitude",
        DEPTH,
        vec![
            Panel {
                y: Axis::linear("peak_to_peak", "um"),
                height: 1.2,
                items: vec![
                    line("workpiece_displacement", &curve.depth_mm, some(&curve.peak_to_peak_um), Role::Plain),
                    level("feed_per_tooth", 1e3 * outcome.engagement.feed_mm_per_tooth, Role::Limit),
                    Item::Points {
                        name: "working_depth",
                        x: vec![job.cut.depth_mm],
                        y: vec![outcome.verdict.peak_to_peak_um],
                        role: Role::Command,
                    },
                ],
            },
            Panel { y: Axis::linear("clamp_force_asked", "N"), height: 0.8, items: forces },
        ],
    )
}

pub(in crate::fixture_stability) fn tables(outcome: &FixtureOutcome) -> Vec<Table> {
    let no_boundary = LobeBoundary::default();
    let of = outcome.lobes.as_ref().map_or(&no_boundary, |lobes| &lobes.boundary);
    let no_curve = AmplitudeCurve::default();
    let curve = outcome.limits.as_ref().map_or(&no_curve, |limits| &limits.curve);
    let no_wave = Oscillogram::default();
    let (entry, steady) =
        outcome.history.as_ref().map_or((&no_wave, &no_wave), |history| (&history.entry, &history.steady));
    let no_arc = ArcProfile::default();
    let arc = outcome.history.as_ref().map_or(&no_arc, |history| &history.arc);
    vec![
        Table {
            id: "boundary",
            columns: vec![
                Column::numbers("spindle_speed", "rev/min", &of.spindle_speed_rpm),
                Column::optional("chatter", "mm", &of.chatter_mm),
                Column::optional("stable_again", "mm", &of.stable_again_mm),
                Column::optional("amplitude", "mm", &of.amplitude_mm),
                Column::optional("movable_opens", "mm", &of.movable_opens_mm),
                Column::optional("fixed_opens", "mm", &of.fixed_opens_mm),
                Column::optional("slips", "mm", &of.slips_mm),
                Column::optional("power", "mm", &of.power_mm),
                Column::optional("torque", "mm", &of.torque_mm),
                Column::optional("zeroth_order", "mm", &of.zeroth_order_mm),
            ],
        },
        map_table(outcome.lobes.as_ref().and_then(|lobes| lobes.map.as_ref())),
        Table {
            id: "amplitude",
            columns: vec![
                Column::numbers("depth", "mm", &curve.depth_mm),
                Column::numbers("modulus", "1", &curve.modulus),
                Column::numbers("peak_to_peak", "um", &curve.peak_to_peak_um),
                Column::numbers("clamp_movable", "N", &curve.clamp_movable_n),
                Column::numbers("clamp_fixed", "N", &curve.clamp_fixed_n),
                Column::numbers("lost_cut_share", "1", &curve.lost_cut_share),
            ],
        },
        probable_table(outcome.probable_depths.as_ref()),
        wave_table("entry", entry),
        wave_table("steady", steady),
        Table {
            id: "arc",
            columns: vec![
                Column::numbers("angle", "deg", &arc.angle_deg),
                Column::numbers("effective_feed", "mm", &arc.effective_feed_mm),
                Column::numbers("chip_thickness", "mm", &arc.chip_thickness_mm),
                Column::numbers("smooth_chip", "mm", &arc.smooth_chip_mm),
            ],
        },
        doubt::table(outcome.conformance.as_ref().map_or(&[], |sure| &sure.contributions)),
    ]
}

fn probable_table(depths: Option<&ProbableDepths>) -> Table {
    let none = ProbableDepths::default();
    let of = depths.unwrap_or(&none);
    Table {
        id: "probable_depths",
        columns: vec![
            Column::numbers("spindle_speed", "rev/min", &of.spindle_speed_rpm),
            Column::optional("stable_90_percent", "mm", &of.stable_90_percent_mm),
            Column::optional("stable_50_percent", "mm", &of.stable_50_percent_mm),
            Column::optional("stable_10_percent", "mm", &of.stable_10_percent_mm),
            Column::optional("stable_wanted", "mm", &of.stable_wanted_mm),
        ],
    }
}

/// One row per point of the map.
fn map_table(map: Option<&LobeMap>) -> Table {
    let (mut speed, mut depth, mut modulus) = (Vec::new(), Vec::new(), Vec::new());
    if let Some(map) = map {
        for &h in &map.depth_mm {
            speed.extend_from_slice(&map.spindle_speed_rpm);
            depth.extend(std::iter::repeat_n(h, map.spindle_speed_rpm.len()));
        }
        modulus.clone_from(&map.modulus);
    }
    Table {
        id: "map",
        columns: vec![
            Column::numbers("spindle_speed", "rev/min", &speed),
            Column::numbers("depth", "mm", &depth),
            Column::optional("modulus", "1", &modulus),
        ],
    }
}

fn wave_table(id: &'static str, wave: &Oscillogram) -> Table {
    let mut columns =
        vec![Column::numbers("time", "s", &wave.time_s), Column::numbers("displacement", "um", &wave.displacement_um)];
    columns.extend(wave.jaw_um.as_ref().map(|jaw| Column::numbers("jaw", "um", jaw)));
    columns.extend([
        Column::numbers("force", "N", &wave.force_n),
        Column::optional("effective_feed", "mm", &wave.effective_feed_mm),
        Column::numbers("clamp_movable", "N", &wave.clamp_movable_n),
        Column::numbers("clamp_fixed", "N", &wave.clamp_fixed_n),
    ]);
    Table { id, columns }
}
