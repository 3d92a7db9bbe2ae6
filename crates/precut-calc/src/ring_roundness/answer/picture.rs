//! Figures of an answer. What the job does not ask for has no figure.

use crate::calculator::{Axis, Figure, Frame, Glyph, Item, Message, Panel, Role, Said, Setting};
use crate::certainty::picture as doubt;

use crate::ring_roundness::answer::elsewhere::{CONTACT_SUPPORT, CONTACT_TOOL, THIS_SETTING};
use crate::ring_roundness::answer::output::{
    HistoryColumns, Outcome, ProfileColumns, SettingOutcome, SimulationOutcome, SpectrumColumns,
};
use crate::ring_roundness::answer::output_settings::{MapOutcome, SpeedMapOutcome};
use crate::ring_roundness::job::input::Job;
use crate::ring_roundness::model::scene::Scene;

pub(in crate::ring_roundness) const FIGURE_IDS: &[&str] =
    &["polar", "profile", "history", "spectrum", "speeds", "map", "cut_map", "search", doubt::ID];

/// Codes of what may be doubted, in the picture of the doubt.
pub(in crate::ring_roundness) const DOUBT_LABELS: &[&str] = &[
    "doubt_tool_angle",
    "doubt_support_half_angle",
    "doubt_compliance_ratio",
    "doubt_roller_runout",
    "doubt_blank_amplitude",
    "doubt_phases",
    crate::certainty::picture::MODEL_LABEL,
];

/// Codes that the figures utter.
pub(in crate::ring_roundness) const LABEL_CODES: &[&str] = &[
    "body_angle",
    "deviation",
    "deviation_before",
    "revolutions_turned",
    "amplitude",
    "roundness_deviation",
    "deepest_cut",
    "waves_per_revolution",
    "factor_per_revolution",
    "work_speed",
    "lobes_per_revolution",
    "worst_wave_of_all",
    "worst_wave_at_rest",
    "tool_angle",
    "support_half_angle",
    "growth_per_revolution",
    "revolutions_to_target",
    "feed_revolutions",
    "ring_before",
    "ring_after",
    "ring_after_filtered",
    "waves_2",
    "waves_3",
    "waves_4",
    "waves_5",
    "waves_6",
    "waves_7",
    "neutral",
    "target",
    "tried_settings",
    "best_setting",
    THIS_SETTING,
    "set_up_stays",
    CONTACT_TOOL,
    CONTACT_SUPPORT,
    "ring_polar",
    "ring_profile",
    "ring_history",
    "ring_spectrum",
    "ring_speeds",
    "ring_map",
    "ring_cut_map",
    "ring_search",
];

/// A blank larger than so many times the finished deviation would hide it in the polar picture.
const SHOWN_TOGETHER: f64 = 4.0;

fn some(values: &[f64]) -> Vec<Option<f64>> {
    values.iter().copied().map(Some).collect()
}

/// Below this an amplitude is rounding, um; a logarithmic axis would make the most of it.
const LEAST_UM: f64 = 1e-4;

fn above_rounding(values: &[f64]) -> Vec<Option<f64>> {
    values.iter().map(|value| (*value >= LEAST_UM).then_some(*value)).collect()
}

fn line(name: &'static str, x: &[f64], y: &[f64], role: Role) -> Item {
    Item::Line { name, x: x.to_vec(), y: some(y), role }
}

/// A closed curve: the first point again at 360°.
fn closed(name: &'static str, angle_deg: &[f64], y: &[f64], role: Role) -> Item {
    let (mut x, mut y) = (angle_deg.to_vec(), some(y));
    if let (Some(&first_x), Some(&first_y)) = (x.first(), y.first()) {
        x.push(first_x + 360.0);
        y.push(first_y);
    }
    Item::Line { name, x, y, role }
}

/// Whether there is anything to see of it.
fn shows(item: &Item) -> bool {
    match item {
        Item::Line { y, .. } | Item::Bars { y, .. } => y.iter().any(Option::is_some),
        Item::HeatMap { values, .. } => values.iter().any(Option::is_some),
        Item::Band { x, .. } | Item::Points { x, .. } | Item::Ribbon { x, .. } | Item::Outline { x, .. } => {
            !x.is_empty()
        }
        Item::Glyph { .. } | Item::Handle(_) | Item::Setting(_) => false,
    }
}

pub(in crate::ring_roundness) fn figures(job: &Job, outcome: &Outcome) -> Vec<Figure> {
    let mut figures = drawn(job, outcome);
    // An empty panel would stand on axes that nothing made.
    for figure in &mut figures {
        figure.panels.retain(|panel| panel.items.iter().any(shows));
    }
    figures.retain(|figure| !figure.panels.is_empty());
    let sure = outcome.conformance.as_ref();
    figures.extend(sure.and_then(|sure| doubt::figure(&sure.contributions, &sure.joint, DOUBT_LABELS)));
    figures
}

fn figure(id: &'static str, title: &'static str, frame: Frame, x: Axis, panels: Vec<Panel>) -> Figure {
    Figure { id, title: Message::new(title), frame, x, panels }
}

fn drawn(job: &Job, outcome: &Outcome) -> Vec<Figure> {
    let simulation = outcome.simulation.as_ref();
    vec![
        Figure {
            // Their symbol is that of a steady rest; here they are what the job calls them.
            title: Message::new("ring_polar").with("glyph_steady_rest", vec!["supports"]),
            ..figure(
                "polar",
                "ring_polar",
                Frame::Polar,
                Axis::linear("body_angle", "deg"),
                vec![polar(job, simulation, &outcome.setting)],
            )
        },
        figure(
            "profile",
            "ring_profile",
            Frame::Stacked,
            Axis::linear("body_angle", "deg"),
            unrolled(simulation.map(|s| &s.profile)),
        ),
        figure(
            "history",
            "ring_history",
            Frame::Stacked,
            Axis::linear("revolutions_turned", "1"),
            history(simulation.map(|s| &s.history)),
        ),
        figure(
            "spectrum",
            "ring_spectrum",
            Frame::Stacked,
            Axis::linear("waves_per_revolution", "1"),
            spectrum(simulation.map(|s| &s.spectrum), outcome),
        ),
        figure(
            "speeds",
            "ring_speeds",
            Frame::Stacked,
            Axis::linear("work_speed", "rev/min"),
            speeds(outcome.speed_map.as_ref()),
        ),
        figure("map", "ring_map", Frame::Stacked, Axis::linear("tool_angle", "deg"), map(outcome.setup_map.as_ref())),
        cut_map(outcome.setup_map.as_ref()),
        figure("search", "ring_search", Frame::Stacked, Axis::linear("feed_revolutions", "1"), search(job, outcome)),
    ]
}

fn polar(job: &Job, simulation: Option<&SimulationOutcome>, setting: &SettingOutcome) -> Panel {
    let mut items = Vec::new();
    if let Some(simulation) = simulation
        && let Some(end) = &simulation.end
    {
        let profile = &simulation.profile;
        let small = SHOWN_TOGETHER * end.unfiltered.least_squares_um;
        if simulation.start.unfiltered.least_squares_um < small {
            items.push(closed("ring_before", &profile.angle_deg, &profile.start_deviation_um, Role::Before));
        }
        items.push(closed("ring_after", &profile.angle_deg, &profile.end_deviation_um, Role::After));
        items.push(closed("ring_after_filtered", &profile.angle_deg, &profile.end_filtered_um, Role::Plain));
        items.extend(drawn_contacts(job, profile, setting));
    } else if let Some(simulation) = simulation {
        let profile = &simulation.profile;
        items.push(closed("ring_before", &profile.angle_deg, &profile.start_deviation_um, Role::Before));
    }
    Panel { y: Axis::linear("deviation", "um"), height: 1.0, items }
}

/// Where tool or support touches the ring as it stops.
pub(in crate::ring_roundness) struct Contact {
    glyph: Glyph,
    /// In the frame of the body.
    pub(in crate::ring_roundness) body_angle_deg: f64,
    /// What it is called where it can be pulled; the left support follows the right one.
    pub(in crate::ring_roundness) handle: Option<&'static str>,
}

/// Tool and supports where they touch the ring as it stops.
pub(in crate::ring_roundness) fn contacts(job: &Job, setting: &SettingOutcome) -> [Contact; 3] {
    let scene = Scene::of(job, &job.effects);
    let turns = (scene.setting.revolutions + scene.setting.spark_out_revolutions) * (1.0 - scene.setting.motion.slip);
    let sense = if scene.mirrored { -1.0 } else { 1.0 };
    let half = setting.support_half_angle_deg;
    let of = |glyph, in_space: f64, handle| Contact {
        glyph,
        body_angle_deg: (in_space - sense * 360.0 * turns.fract()).rem_euclid(360.0),
        handle,
    };
    [
        of(Glyph::SteadyRest, 270.0 - half, None),
        of(Glyph::SteadyRest, 270.0 + half, Some(CONTACT_SUPPORT)),
        of(Glyph::Tool, setting.tool_angle_deg, Some(CONTACT_TOOL)),
    ]
}

fn pulled(name: &'static str, x: f64, y: f64) -> Setting {
    Setting { name, x, y, tried_in: None, about: Some(Said { label: "set_up_stays" }) }
}

fn drawn_contacts(job: &Job, profile: &ProfileColumns, setting: &SettingOutcome) -> Vec<Item> {
    let drawn = |contact: &Contact| {
        let x = contact.body_angle_deg;
        let nearest = profile.angle_deg.iter().rposition(|angle| *angle <= x)?;
        let y = *profile.end_deviation_um.get(nearest)?;
        let symbol = Item::Glyph { glyph: contact.glyph, x, y };
        let grip = contact.handle.map(|name| Item::Setting(pulled(name, x, y)));
        Some([Some(symbol), grip])
    };
    contacts(job, setting).iter().filter_map(drawn).flatten().flatten().collect()
}

fn unrolled(profile: Option<&ProfileColumns>) -> Vec<Panel> {
    let (mut before, mut after) = (Vec::new(), Vec::new());
    if let Some(profile) = profile {
        before.push(closed("ring_before", &profile.angle_deg, &profile.start_deviation_um, Role::Before));
        if !profile.end_deviation_um.is_empty() {
            after.push(closed("ring_after", &profile.angle_deg, &profile.end_deviation_um, Role::After));
            after.push(closed("ring_after_filtered", &profile.angle_deg, &profile.end_filtered_um, Role::Plain));
        }
    }
    vec![
        Panel { y: Axis::linear("deviation_before", "um"), height: 0.7, items: before },
        Panel { y: Axis::linear("deviation", "um"), height: 1.0, items: after },
    ]
}

pub(in crate::ring_roundness) const WAVE_NAMES: [&str; 6] =
    ["waves_2", "waves_3", "waves_4", "waves_5", "waves_6", "waves_7"];

fn history(history: Option<&HistoryColumns>) -> Vec<Panel> {
    let (mut roundness, mut waves, mut bites) = (Vec::new(), Vec::new(), Vec::new());
    if let Some(history) = history.filter(|history| !history.revolution.is_empty()) {
        roundness.push(line("roundness_deviation", &history.revolution, &history.roundness_um, Role::After));
        bites.push(line("deepest_cut", &history.revolution, &history.deepest_cut_um, Role::Plain));
        for ((wave, name), series) in history.waves.iter().zip(WAVE_NAMES).zip(0..) {
            let (x, y) = (history.revolution.clone(), above_rounding(&wave.amplitude_um));
            waves.push(Item::Line { name, x, y, role: Role::Series(series) });
        }
    }
    vec![
        Panel { y: Axis::logarithmic("roundness_deviation", "um"), height: 0.8, items: roundness },
        Panel { y: Axis::logarithmic("amplitude", "um"), height: 1.0, items: waves },
        Panel { y: Axis::linear("deepest_cut", "um"), height: 0.5, items: bites },
    ]
}

fn spectrum(spectrum: Option<&SpectrumColumns>, outcome: &Outcome) -> Vec<Panel> {
    let (mut bars, mut factors) = (Vec::new(), Vec::new());
    if let Some(spectrum) = spectrum {
        let order: Vec<f64> = spectrum.order.iter().copied().map(f64::from).collect();
        let waves = |name, values: &[f64], role| Item::Bars { name, x: order.clone(), y: above_rounding(values), role };
        bars.push(waves("ring_before", &spectrum.start_um, Role::Before));
        bars.push(waves("ring_after", &spectrum.end_um, Role::After));
    }
    if let Some(linear) = &outcome.linear_theory {
        let order: Vec<f64> = linear.orders.iter().map(|o| f64::from(o.order)).collect();
        let ends = [order.first().copied().unwrap_or(2.0), order.last().copied().unwrap_or(3.0)];
        let factor = linear.orders.iter().map(|o| o.factor_per_revolution).collect();
        factors.push(Item::Bars { name: "factor_per_revolution", x: order, y: factor, role: Role::Plain });
        factors.push(line("neutral", &ends, &[1.0, 1.0], Role::Limit));
    }
    let mut panels = vec![Panel { y: Axis::logarithmic("amplitude", "um"), height: 1.0, items: bars }];
    // Without the theory its panel would only take room.
    if !factors.is_empty() {
        panels.push(Panel { y: Axis::linear("factor_per_revolution", "1"), height: 0.7, items: factors });
    }
    panels
}

fn map(map: Option<&MapOutcome>) -> Vec<Panel> {
    let (mut growth, mut revolutions) = (Vec::new(), Vec::new());
    if let Some(map) = map {
        let heat = |value, values, diverging| Item::HeatMap {
            value,
            x: map.tool_angle_deg.clone(),
            y: map.support_half_angle_deg.clone(),
            values,
            diverging,
        };
        // By its logarithm: growth and decay weigh alike. What is gone within the revolution has none.
        let positive = |values: &[Option<f64>]| values.iter().map(|value| value.filter(|v| *v > 0.0)).collect();
        let factors = positive(&map.worst_factor_per_revolution);
        growth.push(heat(Axis::logarithmic("growth_per_revolution", "1"), factors, true));
        let (x, y) = (map.here.tool_angle_deg, map.here.support_half_angle_deg);
        let here = |items: &mut Vec<Item>| {
            items.push(Item::Points { name: THIS_SETTING, x: vec![x], y: vec![y], role: Role::Nominal });
            items.push(Item::Setting(pulled(THIS_SETTING, x, y)));
        };
        here(&mut growth);
        // Near the edge of decay the revolutions go to infinity: their logarithm shows the rest, too.
        let values: Vec<Option<f64>> = positive(&map.revolutions_to_target);
        // Without a wave that decays everywhere to the target the panel would be empty.
        if values.iter().any(Option::is_some) {
            revolutions.push(heat(Axis::logarithmic("revolutions_to_target", "1"), values, false));
            here(&mut revolutions);
        }
    }
    vec![
        Panel { y: Axis::linear("support_half_angle", "deg"), height: 1.0, items: growth },
        Panel { y: Axis::linear("support_half_angle", "deg"), height: 1.0, items: revolutions },
    ]
}

/// Growth over work speed and orders; below it the worst wave of all.
fn speeds(map: Option<&SpeedMapOutcome>) -> Vec<Panel> {
    let (mut growth, mut worst) = (Vec::new(), Vec::new());
    if let Some(map) = map {
        let speeds = &map.work_speed_rpm;
        let rows = map.lobes_from.iter().zip(&map.lobes_to);
        growth.push(Item::HeatMap {
            value: Axis::logarithmic("growth_per_revolution", "1"),
            x: speeds.clone(),
            y: rows.map(|(from, to)| 0.5 * f64::from(from + to)).collect(),
            values: map.factor_per_revolution.clone(),
            diverging: true,
        });
        let cells = &map.worst;
        let y = cells.iter().map(|cell| cell.map(|cell| cell.factor_per_revolution)).collect();
        worst.push(Item::Line { name: "worst_wave_of_all", x: speeds.clone(), y, role: Role::After });
        let at_rest = map.at_rest_factor_per_revolution.iter().copied().flatten().reduce(f64::max);
        let ends = [speeds.first().copied(), speeds.last().copied()].map(|speed| speed.unwrap_or(0.0));
        if let Some(at_rest) = at_rest {
            worst.push(line("worst_wave_at_rest", &ends, &[at_rest; 2], Role::Plain));
        }
        worst.push(line("neutral", &ends, &[1.0; 2], Role::Limit));
        if let Some(here) = &map.here {
            let point = |y| Item::Points { name: "this_setting", x: vec![here.work_speed_rpm], y, role: Role::Nominal };
            growth.push(point(vec![here.lobes]));
            worst.push(point(vec![here.factor_per_revolution]));
        }
    }
    vec![
        Panel { y: Axis::linear("lobes_per_revolution", "1"), height: 1.0, items: growth },
        Panel { y: Axis::logarithmic("factor_per_revolution", "1"), height: 0.5, items: worst },
    ]
}

fn cut_map(map: Option<&MapOutcome>) -> Figure {
    let Some(map) = map.filter(|map| !map.cut_roundness_um.is_empty()) else { return cut_map_of(Vec::new()) };
    let mut items = vec![cut_cells((&map.tool_angle_deg, &map.support_half_angle_deg), &map.cut_roundness_um)];
    let mut mark = |name, x, y, role| items.push(Item::Points { name, x: vec![x], y: vec![y], role });
    let (x, y) = (map.here.tool_angle_deg, map.here.support_half_angle_deg);
    mark(THIS_SETTING, x, y, Role::Nominal);
    if let Some(roundest) = &map.roundest {
        mark("best_setting", roundest.tool_angle_deg, roundest.support_half_angle_deg, Role::After);
    }
    items.push(Item::Setting(pulled(THIS_SETTING, x, y)));
    cut_map_of(items)
}

/// The simulated map while it is computed: tool angles, support half angles, and the cells cut so far.
pub(in crate::ring_roundness) fn cut_map_so_far(angles_deg: (&[f64], &[f64]), roundness_um: &[Option<f64>]) -> Figure {
    cut_map_of(vec![cut_cells(angles_deg, roundness_um)])
}

fn cut_map_of(items: Vec<Item>) -> Figure {
    let panel = Panel { y: Axis::linear("support_half_angle", "deg"), height: 1.0, items };
    figure("cut_map", "ring_cut_map", Frame::Stacked, Axis::linear("tool_angle", "deg"), vec![panel])
}

fn cut_cells((x, y): (&[f64], &[f64]), roundness_um: &[Option<f64>]) -> Item {
    Item::HeatMap {
        value: Axis::logarithmic("roundness_deviation", "um"),
        x: x.to_vec(),
        y: y.to_vec(),
        values: roundness_um.to_vec(),
        diverging: false,
    }
}

fn search(job: &Job, outcome: &Outcome) -> Vec<Panel> {
    let mut items = Vec::new();
    if let (Some(search), Some(range)) = (&outcome.settings_search, &job.settings_search) {
        let tried = &search.tried;
        let (low, high) = tried
            .revolutions
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), n| (low.min(*n), high.max(*n)));
        items.push(line("tried_settings", &tried.revolutions, &tried.roundness_um, Role::Plain));
        if low < high {
            items.push(line("target", &[low, high], &[range.target_um, range.target_um], Role::Limit));
        }
        if let Some(best) = &search.best {
            let (x, y) = (vec![best.revolutions], vec![best.roundness_um]);
            items.push(Item::Points { name: "best_setting", x, y, role: Role::After });
        }
    }
    vec![Panel { y: Axis::logarithmic("roundness_deviation", "um"), height: 1.0, items }]
}
