//! Figures and tables of an answer. What the job does not ask for has no figure.

use crate::calculator::{Axis, Column, Figure, Frame, Glyph, Item, Message, Panel, Role, Table};

use super::input::Job;
use super::output::{
    HistoryColumns, MapOutcome, Outcome, ProfileColumns, SettingOutcome, SimulationOutcome, SpectrumColumns,
};
use super::scene::Scene;

pub(super) const FIGURE_IDS: &[&str] = &["polar", "profile", "history", "spectrum", "map", "search"];
pub(super) const TABLE_IDS: &[&str] =
    &["profile", "history", "waves", "spectrum", "lobing", "roots", "map", "search", "centre_path"];

/// Codes that the figures utter.
pub(super) const LABEL_CODES: &[&str] = &[
    "body_angle",
    "deviation",
    "deviation_before",
    "revolutions_turned",
    "amplitude",
    "roundness_deviation",
    "deepest_cut",
    "waves_per_revolution",
    "factor_per_revolution",
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
    "this_setting",
    "ring_polar",
    "ring_profile",
    "ring_history",
    "ring_spectrum",
    "ring_map",
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
        Item::Glyph { .. } | Item::Handle(_) => false,
    }
}

pub(super) fn figures(job: &Job, outcome: &Outcome) -> Vec<Figure> {
    let mut figures = drawn(job, outcome);
    // An empty panel would stand on axes that nothing made.
    for figure in &mut figures {
        figure.panels.retain(|panel| panel.items.iter().any(shows));
    }
    figures.retain(|figure| !figure.panels.is_empty());
    figures
}

fn drawn(job: &Job, outcome: &Outcome) -> Vec<Figure> {
    let simulation = outcome.simulation.as_ref();
    let figure = |id, title, frame, x, panels| Figure { id, title: Message::new(title), frame, x, panels };
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
        figure("map", "ring_map", Frame::Stacked, Axis::linear("tool_angle", "deg"), map(outcome.setup_map.as_ref())),
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
        items.extend(contacts(job, profile, setting));
    } else if let Some(simulation) = simulation {
        let profile = &simulation.profile;
        items.push(closed("ring_before", &profile.angle_deg, &profile.start_deviation_um, Role::Before));
    }
    Panel { y: Axis::linear("deviation", "um"), height: 1.0, items }
}

/// Tool and supports where they touch the ring as it stops, in the frame of the body.
fn contacts(job: &Job, profile: &ProfileColumns, setting: &SettingOutcome) -> Vec<Item> {
    let scene = Scene::of(job, &job.effects);
    let turns = (scene.setting.revolutions + scene.setting.spark_out_revolutions) * (1.0 - scene.setting.motion.slip);
    let sense = if scene.mirrored { -1.0 } else { 1.0 };
    let half = setting.support_half_angle_deg;
    [(Glyph::SteadyRest, 270.0 - half), (Glyph::SteadyRest, 270.0 + half), (Glyph::Tool, setting.tool_angle_deg)]
        .into_iter()
        .filter_map(|(glyph, in_space)| {
            let x = (in_space - sense * 360.0 * turns.fract()).rem_euclid(360.0);
            let nearest = profile.angle_deg.iter().rposition(|angle| *angle <= x)?;
            Some(Item::Glyph { glyph, x, y: *profile.end_deviation_um.get(nearest)? })
        })
        .collect()
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

const WAVE_NAMES: [&str; 6] = ["waves_2", "waves_3", "waves_4", "waves_5", "waves_6", "waves_7"];

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
        let here = |items: &mut Vec<Item>| {
            items.push(Item::Points {
                name: "this_setting",
                x: vec![map.here.tool_angle_deg],
                y: vec![map.here.support_half_angle_deg],
                role: Role::Nominal,
            });
        };
        here(&mut growth);
        // Near the edge of decay the revolutions go to infinity: their logarithm shows the rest, too.
        let values = positive(&map.revolutions_to_target);
        revolutions.push(heat(Axis::logarithmic("revolutions_to_target", "1"), values, false));
        here(&mut revolutions);
    }
    vec![
        Panel { y: Axis::linear("support_half_angle", "deg"), height: 1.0, items: growth },
        Panel { y: Axis::linear("support_half_angle", "deg"), height: 1.0, items: revolutions },
    ]
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

pub(super) fn tables(outcome: &Outcome) -> Vec<Table> {
    let simulation = outcome.simulation.as_ref();
    vec![
        profile_table(&simulation.map(|s| s.profile.clone()).unwrap_or_default()),
        history_table(&simulation.map(|s| s.history.clone()).unwrap_or_default()),
        waves_table(&simulation.map(|s| s.history.clone()).unwrap_or_default()),
        spectrum_table(&simulation.map(|s| s.spectrum.clone()).unwrap_or_default()),
        lobing_table(outcome),
        roots_table(outcome),
        map_table(outcome.setup_map.as_ref()),
        search_table(outcome),
        path_table(outcome),
    ]
}

fn profile_table(profile: &ProfileColumns) -> Table {
    let padded = |values: &[f64]| -> Vec<Option<f64>> {
        if values.is_empty() { vec![None; profile.angle_deg.len()] } else { some(values) }
    };
    Table {
        id: "profile",
        columns: vec![
            Column::numbers("angle", "deg", &profile.angle_deg),
            Column::numbers("start_radius", "mm", &profile.start_radius_mm),
            Column::optional("end_radius", "mm", &padded(&profile.end_radius_mm)),
            Column::numbers("start_deviation", "um", &profile.start_deviation_um),
            Column::optional("end_deviation", "um", &padded(&profile.end_deviation_um)),
            Column::optional("end_filtered", "um", &padded(&profile.end_filtered_um)),
        ],
    }
}

fn history_table(history: &HistoryColumns) -> Table {
    Table {
        id: "history",
        columns: vec![
            Column::numbers("revolution", "1", &history.revolution),
            Column::numbers("roundness", "um", &history.roundness_um),
            Column::numbers("mean_radius", "mm", &history.mean_radius_mm),
            Column::numbers("deepest_cut", "um", &history.deepest_cut_um),
            Column::numbers("cutting_share", "1", &history.cutting_share),
        ],
    }
}

fn waves_table(history: &HistoryColumns) -> Table {
    let mut columns = vec![Column::numbers("revolution", "1", &history.revolution)];
    columns.extend(
        history.waves.iter().zip(WAVE_NAMES).map(|(wave, name)| Column::numbers(name, "um", &wave.amplitude_um)),
    );
    Table { id: "waves", columns }
}

fn spectrum_table(spectrum: &SpectrumColumns) -> Table {
    let order: Vec<f64> = spectrum.order.iter().copied().map(f64::from).collect();
    Table {
        id: "spectrum",
        columns: vec![
            Column::numbers("order", "1", &order),
            Column::numbers("start", "um", &spectrum.start_um),
            Column::numbers("end", "um", &spectrum.end_um),
            Column::numbers("end_error", "um", &spectrum.end_error_um),
            Column::numbers("end_angle_of_max", "deg", &spectrum.end_angle_of_max_deg),
            Column::optional("ratio", "1", &spectrum.ratio),
        ],
    }
}

fn lobing_table(outcome: &Outcome) -> Table {
    let orders = outcome.linear_theory.as_ref().map_or(&[][..], |linear| &linear.orders);
    let column = |of: &dyn Fn(&super::output::OrderOutcome) -> f64| orders.iter().map(of).collect::<Vec<f64>>();
    Table {
        id: "lobing",
        columns: vec![
            Column::numbers("order", "1", &column(&|o| f64::from(o.order))),
            Column::numbers("visibility_real", "1", &column(&|o| o.visibility_real)),
            Column::numbers("visibility_imaginary", "1", &column(&|o| o.visibility_imaginary)),
            Column::optional(
                "factor_per_revolution",
                "1",
                &orders.iter().map(|o| o.factor_per_revolution).collect::<Vec<_>>(),
            ),
            Column::words("fate", orders.iter().map(|o| o.fate.name().into()).collect()),
        ],
    }
}

fn roots_table(outcome: &Outcome) -> Table {
    let roots = outcome.linear_theory.as_ref().map_or(&[][..], |linear| &linear.roots);
    Table {
        id: "roots",
        columns: vec![
            Column::numbers("lobes", "1", &roots.iter().map(|r| r.lobes).collect::<Vec<_>>()),
            Column::numbers(
                "factor_per_revolution",
                "1",
                &roots.iter().map(|r| r.factor_per_revolution).collect::<Vec<_>>(),
            ),
        ],
    }
}

fn map_table(map: Option<&MapOutcome>) -> Table {
    let (mut tool, mut support) = (Vec::new(), Vec::new());
    let nothing: &[Option<f64>] = &[];
    if let Some(map) = map {
        for beta in &map.support_half_angle_deg {
            for alpha in &map.tool_angle_deg {
                tool.push(*alpha);
                support.push(*beta);
            }
        }
    }
    Table {
        id: "map",
        columns: vec![
            Column::numbers("tool_angle", "deg", &tool),
            Column::numbers("support_half_angle", "deg", &support),
            Column::optional(
                "worst_factor_per_revolution",
                "1",
                map.map_or(nothing, |m| &m.worst_factor_per_revolution),
            ),
            Column::optional("worst_lobes", "1", map.map_or(nothing, |m| &m.worst_lobes)),
            Column::optional("revolutions_to_target", "1", map.map_or(nothing, |m| &m.revolutions_to_target)),
        ],
    }
}

fn search_table(outcome: &Outcome) -> Table {
    let tried = outcome.settings_search.as_ref().map(|s| s.tried.clone()).unwrap_or_default();
    Table {
        id: "search",
        columns: vec![
            Column::numbers("revolutions", "1", &tried.revolutions),
            Column::numbers("feed", "mm/rev", &tried.feed_mm_per_rev),
            Column::numbers("roundness", "um", &tried.roundness_um),
        ],
    }
}

fn path_table(outcome: &Outcome) -> Table {
    let path = outcome.simulation.as_ref().map(|s| s.centre_path.clone()).unwrap_or_default();
    Table {
        id: "centre_path",
        columns: vec![
            Column::numbers("revolution", "1", &path.revolution),
            Column::numbers("x", "um", &path.x_um),
            Column::numbers("y", "um", &path.y_um),
        ],
    }
}
