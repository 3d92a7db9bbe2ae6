//! What dominates, what would help, where not to trust: codes with numbers.

use crate::calculator::{Finding, Message};

use crate::ring_roundness::answer::output::{CauseKind, Outcome, SimulationOutcome};
use crate::ring_roundness::answer::output_settings::{Fate, SearchOutcome, SearchSetting, SearchStatus, SpeedCell};
use crate::ring_roundness::job::input::{Job, LongWave, Method};
use crate::ring_roundness::job::input_ranges::SearchRange;
use crate::ring_roundness::model::scene::Scene;
use crate::ring_roundness::model::stance::{LOOSE_RAD, Stance, back_off_mm};
use crate::ring_roundness::model::surface::UM_PER_MM;

/// |a| + |b| above which lobes grow noticeably.
const GAIN: f64 = 1.02;
/// A bite is large above so many feeds and this share of the blank's deviation.
const BITE_OVER_FEED: f64 = 3.0;
const BITE_OVER_BLANK: f64 = 0.25;
/// Nodes per wave of the filter's cut-off.
const PER_CUTOFF_WAVE: u32 = 7;
/// Share of the roundness that makes a cause worth naming.
const WORTH_NAMING: f64 = 0.3;
/// Share of the roundness above which its error is warned of.
const ERROR_SHARE: f64 = 0.1;

/// Codes of the warnings made here.
pub(in crate::ring_roundness) const WARNING_CODES: &[&str] = &[
    "setting_not_diametral_lobes_grow",
    "not_cleaned_up",
    "first_bite_too_large_odd_lobes_locked_in",
    "supports_too_close_unstable",
    "ring_lifts_off",
    "ring_slips",
    "contacts_on_steps",
    "tip_starts_inside",
    "samples_below_cutoff",
    "teeth_unresolved",
    "samples_limited",
    "discretisation_error_large",
    "nearest_samples_no_geometry",
    "points_flew_apart",
    "roots_incomplete",
    "machine_chatters",
    "roundness_beyond_tolerance",
];

/// Codes of the explanations made here.
pub(in crate::ring_roundness) const EXPLANATION_CODES: &[&str] = &[
    "ring_comes_out",
    "size_and_error",
    "opposite_to_support",
    "off_the_diameter",
    "off_but_steady",
    "without_it",
    "no_single_cause",
    "start_clear",
    "growing_waves",
    "nearest_samples_explained",
    "worst_wave",
    "no_worst_wave",
    "map_best",
    "map_empty",
    "search_robust",
    "search_fragile",
    "search_two_stages",
    "search_beyond",
    "search_odd",
    "first_stage",
    "second_stage",
    "map_roundest",
    "mildest_speed",
    "worst_at_this_speed",
    "setting_only",
    "ring_not_modelled",
];

/// What to warn of.
pub(in crate::ring_roundness) fn warnings(job: &Job, scene: &Scene, end: &Stance, outcome: &Outcome) -> Vec<Finding> {
    let mut found = Vec::new();
    let setting = &outcome.setting;
    if setting.coefficient_sum > GAIN {
        let roots = scene.lobing(end.copying()).near_neutral(1.5, f64::from(job.highest_order) + 0.45);
        let worst = crate::ring_roundness::model::linear::worst_of(&roots);
        let mut finding =
            Finding::new("setting_not_diametral_lobes_grow", "/tool").measured(setting.coefficient_sum, GAIN, "1");
        if let Some(worst) = worst {
            finding = finding.with("lobes", worst.lobes).with("factor", worst.factor_per_revolution());
        }
        found.push(finding);
    }
    if let (Some(tolerance), Some(roundness_um)) = (&job.tolerance, outcome.roundness_um)
        && roundness_um > tolerance.roundness_um
    {
        found.push(
            Finding::new("roundness_beyond_tolerance", crate::ring_roundness::answer::conformance::POINTER).measured(
                roundness_um,
                tolerance.roundness_um,
                "um",
            ),
        );
    }
    if end.half_angle_rad < LOOSE_RAD {
        found.push(Finding::new("supports_too_close_unstable", "/supports/distance_mm").measured(
            end.half_angle_rad.to_degrees(),
            LOOSE_RAD.to_degrees(),
            "deg",
        ));
    }
    if let Some(reactions) = &setting.reactions
        && !reactions.seated
    {
        let values = [reactions.support_a_n, reactions.support_b_n];
        let driven = [reactions.driven_support_a_n, reactions.driven_support_b_n];
        let least = values.into_iter().chain(driven.into_iter().flatten()).fold(f64::INFINITY, f64::min);
        found.push(Finding::new("ring_lifts_off", "/forces").measured(least, 0.0, "N"));
    }
    let friction = setting.reactions.as_ref().and_then(|reactions| reactions.friction_needed).zip(job.forces.as_ref());
    if let Some((needed, forces)) = friction.filter(|(needed, forces)| *needed > forces.friction_available) {
        found.push(Finding::new("ring_slips", "/forces/drive").measured(needed, forces.friction_available, "1"));
    }
    if setting.gap_at_start_um < 0.0 {
        let bite = outcome.simulation.as_ref().and_then(|s| s.largest_bite_um);
        let mut finding = Finding::new("tip_starts_inside", "/tool/y_mm")
            .measured(-setting.gap_at_start_um, 0.0, "um")
            .with("half_turn_reduction_um", setting.half_turn_reduction_um);
        if let Some(bite) = bite {
            finding = finding.with("bite_um", bite);
        }
        found.push(finding);
    }
    if let Some(simulation) = &outcome.simulation {
        of_simulation(job, end, simulation, outcome, &mut found);
    }
    if let Some(worst) = crate::ring_roundness::model::speeds::here(job, scene, end).filter(|worst| worst.is_chatter) {
        found.push(
            Finding::new("machine_chatters", "/dynamics")
                .measured(worst.factor_per_revolution, 1.0, "1")
                .with("lobes", worst.lobes)
                .with("frequency_hz", worst.frequency_hz)
                .with("speed_rpm", worst.work_speed_rpm),
        );
    }
    if outcome.linear_theory.as_ref().is_some_and(|linear| !linear.complete) {
        found.push(Finding::new("roots_incomplete", "/analyses"));
    }
    found
}

fn of_simulation(job: &Job, end: &Stance, simulation: &SimulationOutcome, outcome: &Outcome, found: &mut Vec<Finding>) {
    if simulation.uncut_share > 0.0 {
        found.push(Finding::new("not_cleaned_up", "/tool/revolutions").measured(simulation.uncut_share, 0.0, "1"));
    }
    if simulation.location_error_um > 0.0 {
        found.push(Finding::new("contacts_on_steps", "/samples").value(simulation.location_error_um, "um"));
    }
    let blank_um = simulation.start.unfiltered.least_squares_um;
    // Elsewhere than opposite to a support the waves that a bite leaves decay or grow like any others.
    if let Some(bite_um) = simulation.largest_bite_um.filter(|_| end.copying().is_diametral()) {
        let limit = (BITE_OVER_FEED * job.tool.feed_mm_per_rev * UM_PER_MM).max(BITE_OVER_BLANK * blank_um);
        if bite_um > limit {
            found.push(
                Finding::new("first_bite_too_large_odd_lobes_locked_in", "/tool/y_mm").measured(bite_um, limit, "um"),
            );
        }
    }
    if let Some(cutoff) = job.filter.cutoff_upr()
        && simulation.samples < PER_CUTOFF_WAVE * cutoff
    {
        let (samples, needed) = (f64::from(simulation.samples), f64::from(PER_CUTOFF_WAVE * cutoff));
        found.push(Finding::new("samples_below_cutoff", "/samples").measured(samples, needed, "1"));
    }
    if job.method == Method::NearestSamples {
        if let (Some(end), Some(exact)) = (&simulation.end, &simulation.exact_contact) {
            let (here, exact) = (end.filtered.least_squares_um, exact.filtered.least_squares_um);
            found.push(Finding::new("nearest_samples_no_geometry", "/method").measured(here, exact, "um"));
        } else {
            found.push(Finding::new("points_flew_apart", "/samples").value(f64::from(simulation.samples), "1"));
        }
        return;
    }
    let (samples, needed) = (f64::from(simulation.samples), f64::from(simulation.samples_for_teeth));
    if job.filter == LongWave::None && simulation.samples < simulation.samples_for_teeth {
        let code = if job.samples.is_some_and(|n| n != crate::ring_roundness::job::sampling::MOST_CHOSEN) {
            "teeth_unresolved"
        } else {
            "samples_limited"
        };
        found.push(Finding::new(code, "/samples").measured(samples, needed, "1"));
    }
    if let (Some(value), Some(error)) = (outcome.roundness_um, outcome.roundness_error_um)
        && error > ERROR_SHARE * value
    {
        found.push(Finding::new("discretisation_error_large", "/samples").measured(error, ERROR_SHARE * value, "um"));
    }
}

/// What to say, most important first.
pub(in crate::ring_roundness) fn explanation(
    job: &Job,
    scene: &Scene,
    end: &Stance,
    outcome: &Outcome,
) -> Vec<Message> {
    let mut said = Vec::new();
    if let Some(simulation) = &outcome.simulation {
        of_run(job, scene, simulation, outcome, &mut said);
    }
    let setting = &outcome.setting;
    let diametral = end.copying().is_diametral();
    let k = setting.compliance_ratio;
    let highest = f64::from(job.highest_order);
    let growing = scene
        .lobing(end.copying())
        .near_neutral(1.5, highest + 0.45)
        .iter()
        .any(crate::ring_roundness::model::linear::grows);
    let code = match (diametral, growing) {
        (true, _) => "opposite_to_support",
        (false, true) => "off_the_diameter",
        (false, false) => "off_but_steady",
    };
    said.push(
        Message::new(code)
            .with("highest_order", highest)
            .with("sum", setting.coefficient_sum)
            .with("half_turn_reduction_um", setting.half_turn_reduction_um)
            .with("even_factor", (k / (1.0 + k)).powi(2))
            .with("support", if setting.coefficient_a.abs() >= setting.coefficient_b.abs() { "A" } else { "B" }),
    );
    if let Some(linear) = &outcome.linear_theory {
        match &linear.worst {
            Some(worst) => {
                let growing = linear.orders.iter().filter(|order| order.fate == Fate::Grows).count();
                said.push(
                    Message::new("worst_wave")
                        .with("lobes", worst.lobes)
                        .with("factor", worst.factor_per_revolution)
                        .with("growing", growing),
                );
            }
            None => said.push(Message::new("no_worst_wave")),
        }
    }
    if let Some(map) = &outcome.setup_map {
        match &map.best {
            Some(best) => said.push(
                Message::new("map_best")
                    .with("tool_angle_deg", best.tool_angle_deg)
                    .with("support_half_angle_deg", best.support_half_angle_deg)
                    .with("factor", best.worst_factor_per_revolution.unwrap_or(0.0))
                    .with("here", map.here.worst_factor_per_revolution.unwrap_or(0.0)),
            ),
            None => said.push(Message::new("map_empty")),
        }
        if let Some(roundest) = &map.roundest {
            said.push(
                Message::new("map_roundest")
                    .with("tool_angle_deg", roundest.tool_angle_deg)
                    .with("support_half_angle_deg", roundest.support_half_angle_deg)
                    .with("roundness_um", roundest.roundness_um),
            );
        }
    }
    if let Some(speeds) = &outcome.speed_map {
        let told = |code, cell: &SpeedCell| {
            Message::new(code)
                .with("speed_rpm", cell.work_speed_rpm)
                .with("lobes", cell.lobes)
                .with("frequency_hz", cell.frequency_hz)
                .with("factor", cell.factor_per_revolution)
                .with("made_by", if cell.is_chatter { "machine" } else { "geometry" })
        };
        said.extend(speeds.here.iter().map(|cell| told("worst_at_this_speed", cell)));
        said.extend(speeds.best.iter().map(|cell| told("mildest_speed", cell)));
    }
    if let Some(search) = &outcome.settings_search {
        of_search(job, search, &mut said);
    }
    if outcome.simulation.is_none() {
        said.push(
            Message::new("setting_only")
                .with("circumradius_mm", setting.circumradius_mm)
                .with("radius_per_feed", setting.radius_per_feed),
        );
    }
    said.push(Message::new("ring_not_modelled"));
    said
}

fn of_run(job: &Job, scene: &Scene, simulation: &SimulationOutcome, outcome: &Outcome, said: &mut Vec<Message>) {
    if job.method == Method::NearestSamples {
        // First order in the spacing, about πR/N.
        let radius = simulation.start.mean_radius_mm;
        said.push(
            Message::new("nearest_samples_explained")
                .with("samples", f64::from(simulation.samples))
                .with("location_error_um", std::f64::consts::PI * radius / f64::from(simulation.samples) * UM_PER_MM)
                .with("exact_um", simulation.exact_contact.as_ref().map_or(0.0, |e| e.filtered.least_squares_um)),
        );
    }
    let (Some(end), Some(error)) = (&simulation.end, &simulation.end_error) else { return };
    said.push(
        Message::new("ring_comes_out")
            .with("roundness_um", end.filtered.least_squares_um)
            .with("minimum_zone_um", end.filtered.minimum_zone_um)
            .with("unfiltered_um", end.unfiltered.least_squares_um)
            .with("blank_um", simulation.start.unfiltered.least_squares_um),
    );
    if job.method == Method::NearestSamples {
        return;
    }
    said.push(
        Message::new("size_and_error")
            .with("radius_mm", end.mean_radius_mm)
            .with("radius_per_feed", outcome.setting.radius_per_feed)
            .with("roundness_error_um", error.filtered.least_squares_um)
            .with("unfiltered_error_um", error.unfiltered.least_squares_um)
            .with("samples", f64::from(simulation.samples)),
    );
    of_causes(job, scene, simulation, said);
}

/// A cause is named where its own simulation says that it goes away with it.
fn of_causes(job: &Job, scene: &Scene, simulation: &SimulationOutcome, said: &mut Vec<Message>) {
    let causes = &simulation.causes;
    let named: Vec<_> = causes.switched_off.iter().filter(|cause| cause.share > WORTH_NAMING).collect();
    for cause in &named {
        let kind = cause.effect.and_then(|i| job.effects.get(i)).map_or(cause.cause.name(), |effect| effect.kind());
        said.push(
            Message::new("without_it")
                .with("cause", cause.cause.name())
                .with("kind", kind)
                .with("without_um", cause.roundness_without_um)
                .with("share", cause.share),
        );
    }
    let is_named = |kind: CauseKind| named.iter().any(|cause| cause.cause == kind);
    if is_named(CauseKind::FirstBite)
        && let Some(back_mm) = back_off_mm(&scene.setting, &simulation.profile.start_radius_mm)
    {
        said.push(Message::new("start_clear").with("back_mm", back_mm));
    }
    if is_named(CauseKind::ToolOffLine) && causes.growing_lobes_um > 0.0 {
        said.push(Message::new("growing_waves").with("height_um", causes.growing_lobes_um));
    }
    if named.is_empty() && !causes.switched_off.is_empty() {
        said.push(Message::new("no_single_cause").with("share", WORTH_NAMING));
    }
}

/// A setting of the search in words.
fn placed(message: Message, job: &Job, setting: &SearchSetting) -> Message {
    let off = |of: fn(&SearchRange) -> f64| job.settings_search.as_ref().map_or(0.0, of);
    let rolls = job.supports.roller_radius_mm > 0.0;
    message
        .with("revolutions", setting.revolutions)
        .with("spark_out_revolutions", setting.spark_out_revolutions)
        .with("feed_mm_per_rev", setting.feed_mm_per_rev)
        .with("x_mm", setting.tool_x_mm)
        .with("y_mm", setting.tool_y_mm)
        .with("tool_angle_deg", setting.tool_angle_deg)
        .with("support_half_angle_deg", setting.support_half_angle_deg)
        .with("support_distance_mm", setting.support_distance_mm)
        .with("support_depth_mm", setting.support_depth_mm)
        .with("feed_direction_deg", setting.feed_direction_deg)
        .with("compliance_ratio", setting.compliance_ratio)
        .with("robust_share", setting.robust_share)
        .with("angle_error_deg", off(|range| range.angle_error_deg))
        .with("waves_error", off(|range| 0.01 * range.blank_waves_error_percent))
        .with("runout_um", if rolls { off(|range| range.roller_runout_um) } else { 0.0 })
        .with("roundness_um", setting.roundness_um)
        .with("margin_um", setting.margin_um)
}

fn of_search(job: &Job, search: &SearchOutcome, said: &mut Vec<Message>) {
    let target = job.settings_search.map_or(0.0, |range| range.target_um);
    let code = match search.status {
        SearchStatus::Robust => "search_robust",
        SearchStatus::Fragile => "search_fragile",
        SearchStatus::TwoStages => "search_two_stages",
        SearchStatus::BeyondLimits => "search_beyond",
        SearchStatus::OddLobes => "search_odd",
    };
    let mut message = Message::new(code)
        .with("target_um", target)
        .with("tried", search.tried.revolutions.len() + search.simulated)
        .with("everywhere", search.simulated)
        .with("odd_lobes_um", search.odd_lobes_um)
        .with("odd_orders", search.odd_orders.iter().map(|order| f64::from(*order)).collect::<Vec<_>>());
    if let Some(best) = &search.best {
        message = placed(message, job, best);
    }
    said.push(message);
    if let Some(stages) = &search.second_stage {
        for (code, stage) in [("first_stage", &stages.first), ("second_stage", &stages.second)] {
            let error_um = stage.roundness_error_um;
            said.push(placed(Message::new(code), job, stage).with("target_um", target).with("error_um", error_um));
        }
    }
}
