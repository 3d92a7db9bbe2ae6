//! Tables of an answer.

use crate::calculator::{Column, Table};
use crate::certainty::picture as doubt;

use crate::ring_roundness::answer::output::{HistoryColumns, Outcome, ProfileColumns, SpectrumColumns};
use crate::ring_roundness::answer::output_settings::{MapOutcome, OrderOutcome, SpeedCell, SpeedMapOutcome};
use crate::ring_roundness::answer::picture::WAVE_NAMES;

pub(in crate::ring_roundness) const TABLE_IDS: &[&str] = &[
    "profile",
    "history",
    "waves",
    "spectrum",
    "lobing",
    "roots",
    "speeds",
    "map",
    "search",
    "centre_path",
    doubt::ID,
];

pub(in crate::ring_roundness) fn tables(outcome: &Outcome) -> Vec<Table> {
    let simulation = outcome.simulation.as_ref();
    vec![
        profile_table(&simulation.map(|s| s.profile.clone()).unwrap_or_default()),
        history_table(&simulation.map(|s| s.history.clone()).unwrap_or_default()),
        waves_table(&simulation.map(|s| s.history.clone()).unwrap_or_default()),
        spectrum_table(&simulation.map(|s| s.spectrum.clone()).unwrap_or_default()),
        lobing_table(outcome),
        roots_table(outcome),
        speeds_table(outcome.speed_map.as_ref()),
        map_table(outcome.setup_map.as_ref()),
        search_table(outcome),
        path_table(outcome),
        doubt::table(outcome.conformance.as_ref().map_or(&[], |sure| &sure.contributions)),
    ]
}

fn profile_table(profile: &ProfileColumns) -> Table {
    let padded = |values: &[f64]| -> Vec<Option<f64>> {
        if values.is_empty() { vec![None; profile.angle_deg.len()] } else { values.iter().copied().map(Some).collect() }
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
    let column = |of: &dyn Fn(&OrderOutcome) -> f64| orders.iter().map(of).collect::<Vec<f64>>();
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

fn speeds_table(map: Option<&SpeedMapOutcome>) -> Table {
    let (speeds, worst) = map.map_or((&[][..], &[][..]), |map| (&map.work_speed_rpm[..], &map.worst[..]));
    let column = |of: fn(&SpeedCell) -> f64| worst.iter().map(|cell| cell.as_ref().map(of)).collect::<Vec<_>>();
    Table {
        id: "speeds",
        columns: vec![
            Column::numbers("work_speed", "rev/min", speeds),
            Column::optional("lobes", "1", &column(|cell| cell.lobes)),
            Column::optional("frequency", "Hz", &column(|cell| cell.frequency_hz)),
            Column::optional("factor_per_revolution", "1", &column(|cell| cell.factor_per_revolution)),
        ],
    }
}

fn map_table(map: Option<&MapOutcome>) -> Table {
    let (mut tool, mut support) = (Vec::new(), Vec::new());
    let nothing: &[Option<f64>] = &[];
    let mut cut = Vec::new();
    if let Some(map) = map {
        cut = if map.cut_roundness_um.is_empty() {
            vec![None; map.revolutions_to_target.len()]
        } else {
            map.cut_roundness_um.clone()
        };
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
            Column::optional("cut_roundness", "um", &cut),
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
