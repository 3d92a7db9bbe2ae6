//! Rules between fields. What one field alone may hold stands in its schema.

use std::f64::consts::TAU;

use crate::calculator::{Check, Finding, Violations};

use crate::ring_roundness::job::cut_force;
use crate::ring_roundness::job::input::{Analysis, Job, MAX_STEPS, Method, ProfileRow};
use crate::ring_roundness::job::sampling::samples_of;
use crate::ring_roundness::job::uncertain;
use crate::ring_roundness::model::scene::Scene;
use crate::ring_roundness::model::stance::{JAMS_RAD, Stance, TOOL_CLEARANCE_RAD, at_radius, through_tip};
use crate::ring_roundness::model::turning::plane::{dot, norm, sub};

/// Codes of the faults found here.
pub(in crate::ring_roundness) const CODES: &[&str] = &[
    "ring_or_profile",
    "bad_ring_radius",
    "bad_distance",
    "bad_ring_feed",
    "bad_revolutions",
    "bad_samples",
    "profile_too_few_points",
    "angles_not_ascending",
    "duplicate_angle",
    "angles_overlap",
    "angles_look_like_radians",
    "gap_in_profile",
    "profile_unit_suspected",
    "deviation_too_large",
    "ring_falls_through",
    "ring_jams",
    "tool_at_support",
    "tool_below_ring",
    "tool_too_deep",
    "tool_out_of_reach",
    "feed_away_from_ring",
    "feed_too_deep",
    "run_too_long",
    "compliance_given_twice",
    "cut_force_missing",
    "search_needs_cut_stiffness",
    "wheel_with_compliance",
    "not_with_nearest_samples",
    "search_range_missing",
    "dynamics_missing",
    "mode_beyond_orders",
    "range_empty",
    "duplicate_analysis",
    "duplicate_effect",
    "roundness_tolerance_missing",
];

/// Points that a measured profile needs.
const LEAST_POINTS: usize = 16;
/// Widest gap of a measured profile, deg.
const WIDEST_GAP_DEG: f64 = 30.0;
/// Largest deviation of the blank over its radius.
const LARGEST_DEVIATION: f64 = 0.05;
/// Deepest place of the tip inside the ring at the start, over its radius.
const DEEPEST_START: f64 = 0.05;
/// Nodes between which the exact method works.
const LEAST_SAMPLES: u32 = 360;
/// Points of the paper's algorithm at most: its cost grows with their square.
const MOST_NEAREST_SAMPLES: u32 = 1000;
/// The finished ring keeps at least this share of its radius.
const LEAST_LEFT: f64 = 0.5;

impl Check for Job {
    fn check(&self, violations: &mut Violations) {
        check_profile(self, violations);
        check_numerics(self, violations);
        check_machine(self, violations);
        cut_force::check(self, violations);
        check_analyses(self, violations);
        check_effects(self, violations);
        uncertain::check(self, violations);
        // Of a radius of nothing, or a feed backwards, the rest would only be consequences.
        if let Some(radius_mm) = mean_radius_mm(self).filter(|radius| fields_hold(self, *radius)) {
            check_deviation(self, radius_mm, violations);
            check_geometry(self, radius_mm, violations);
        }
    }
}

/// Whether the numbers that the geometry is made of are any good by themselves; their own schemas say what is wrong.
fn fields_hold(job: &Job, radius_mm: f64) -> bool {
    radius_mm > 0.0
        && job.supports.distance_mm > 0.0
        && job.tool.feed_mm_per_rev > 0.0
        && job.tool.revolutions > 0.0
        && job.tool.spark_out_revolutions >= 0.0
}

fn check_profile(job: &Job, violations: &mut Violations) {
    violations.require(job.ring.is_some() != job.measured_profile.is_some(), || {
        Finding::new("ring_or_profile", "").with("given", if job.ring.is_some() { "both" } else { "neither" })
    });
    let Some(measured) = &job.measured_profile else { return };
    let rows = measured.rows();
    violations.require(rows.len() >= LEAST_POINTS, || {
        Finding::new("profile_too_few_points", "/measured_profile")
            .with("count", rows.len())
            .with("least", LEAST_POINTS)
    });
    for (i, pair) in rows.windows(2).enumerate() {
        check_neighbours(i + 1, pair[0], pair[1], violations);
    }
    let (Some(first), Some(last)) = (rows.first(), rows.last()) else { return };
    // Out of order, the ends are not the ends.
    if rows.windows(2).any(|pair| pair[1].angle_deg < pair[0].angle_deg) {
        return;
    }
    let span = last.angle_deg - first.angle_deg;
    violations.require(span < 360.0, || {
        Finding::new("angles_overlap", format!("/measured_profile/{}/angle_deg", rows.len() - 1)).measured(
            last.angle_deg,
            first.angle_deg + 360.0,
            "deg",
        )
    });
    // A whole turn, one step short, in radians.
    let in_radians = rows.len() >= LEAST_POINTS && span > 5.0 && span <= TAU + 1e-9;
    if in_radians {
        violations.add(Finding::new("angles_look_like_radians", "/measured_profile").value(last.angle_deg, "deg"));
    } else {
        let gap = first.angle_deg + 360.0 - last.angle_deg;
        violations.require(gap <= WIDEST_GAP_DEG, || {
            Finding::new("gap_in_profile", "/measured_profile/0/angle_deg").measured(gap, WIDEST_GAP_DEG, "deg")
        });
    }
}

fn check_neighbours(i: usize, before: ProfileRow, here: ProfileRow, violations: &mut Violations) {
    let at = || format!("/measured_profile/{i}/angle_deg");
    let step = here.angle_deg - before.angle_deg;
    if step < 0.0 {
        violations.add(Finding::new("angles_not_ascending", at()).measured(here.angle_deg, before.angle_deg, "deg"));
    } else if step < 1e-9 {
        violations.add(Finding::new("duplicate_angle", at()).value(here.angle_deg, "deg"));
    }
    violations
        .require(step <= WIDEST_GAP_DEG, || Finding::new("gap_in_profile", at()).measured(step, WIDEST_GAP_DEG, "deg"));
}

fn check_numerics(job: &Job, violations: &mut Violations) {
    let samples = f64::from(samples_of(job));
    match (job.method, job.samples) {
        (Method::ExactContact, Some(n)) => violations.require(n >= LEAST_SAMPLES && n.is_multiple_of(4), || {
            let fault = Finding::new("bad_samples", "/samples").measured(f64::from(n), f64::from(LEAST_SAMPLES), "1");
            fault.with("method", "exact_contact").with("minimum", f64::from(LEAST_SAMPLES))
        }),
        (Method::NearestSamples, Some(n)) => violations.require(n <= MOST_NEAREST_SAMPLES, || {
            let most = f64::from(MOST_NEAREST_SAMPLES);
            let fault = Finding::new("bad_samples", "/samples").measured(f64::from(n), most, "1");
            fault.with("method", "nearest_samples").with("maximum", most)
        }),
        (_, None) => {}
    }
    let steps = (job.tool.revolutions + job.tool.spark_out_revolutions) * samples;
    let driver = if samples > 7200.0 { "/samples" } else { "/tool/revolutions" };
    violations.require(steps <= MAX_STEPS, || {
        Finding::new("run_too_long", driver)
            .measured(steps, MAX_STEPS, "1")
            .with("revolutions", job.tool.revolutions)
            .with("samples", samples)
    });
}

fn check_machine(job: &Job, violations: &mut Violations) {
    violations.require(job.stiffness.is_none() || job.compliance_ratio <= 0.0, || {
        Finding::new("compliance_given_twice", "/compliance_ratio").value(job.compliance_ratio, "1")
    });
    let soft = Scene::of(job, &job.effects).setting.compliance_ratio > 0.0;
    violations.require(!(soft && job.tool.wheel_radius_mm.is_some()), || {
        Finding::new("wheel_with_compliance", "/tool/wheel_radius_mm")
    });
    if job.method == Method::NearestSamples {
        let mut refuse = |is: bool, at: &str| {
            violations.require(!is, || Finding::new("not_with_nearest_samples", at));
        };
        refuse(soft, "/compliance_ratio");
        refuse(job.supports.roller_radius_mm > 0.0, "/supports/roller_radius_mm");
        refuse(job.tool.wheel_radius_mm.is_some(), "/tool/wheel_radius_mm");
        refuse(!job.effects.is_empty(), "/effects");
        refuse(job.replay_frames > 0, "/replay_frames");
    }
}

fn check_analyses(job: &Job, violations: &mut Violations) {
    for (i, analysis) in job.analyses.iter().enumerate() {
        violations.require(!job.analyses[..i].contains(analysis), || {
            Finding::new("duplicate_analysis", format!("/analyses/{i}"))
        });
    }
    let mut ascends = |at: &str, from: f64, to: f64, unit: &'static str| {
        violations.require(from < to, || Finding::new("range_empty", at).measured(to, from, unit));
    };
    let map = &job.setup_map;
    ascends("/setup_map/tool_angle_to_deg", map.tool_angle_from_deg, map.tool_angle_to_deg, "deg");
    ascends("/setup_map/support_angle_to_deg", map.support_angle_from_deg, map.support_angle_to_deg, "deg");
    if let Some(search) = &job.settings_search {
        let at = "/settings_search/feed_max_mm_per_rev";
        ascends(at, search.feed_min_mm_per_rev, search.feed_max_mm_per_rev, "mm/rev");
        let at = "/settings_search/tool_angle_to_deg";
        ascends(at, search.tool_angle_from_deg, search.tool_angle_to_deg, "deg");
        let at = "/settings_search/support_angle_to_deg";
        ascends(at, search.support_angle_from_deg, search.support_angle_to_deg, "deg");
    }
    if let Some(dynamics) = &job.dynamics {
        let (from, to) = crate::ring_roundness::model::speeds::speeds_rpm(job, dynamics);
        ascends("/speed_map/to_rpm", from, to, "rev/min");
        let most = f64::from(crate::ring_roundness::model::speeds::MOST_ORDER);
        for (i, mode) in dynamics.modes.iter().enumerate() {
            let lobes = mode.frequency_hz * 60.0 / dynamics.work_speed_rpm;
            violations.require(lobes <= most, || {
                Finding::new("mode_beyond_orders", format!("/dynamics/modes/{i}/frequency_hz"))
                    .measured(lobes, most, "1")
                    .with("frequency_hz", mode.frequency_hz)
                    .with("speed_rpm", dynamics.work_speed_rpm)
            });
        }
    }
    violations.require(!job.asks(Analysis::SpeedMap) || job.dynamics.is_some(), || {
        Finding::new("dynamics_missing", "/dynamics")
    });
    violations.require(!job.asks(Analysis::SettingsSearch) || job.settings_search.is_some(), || {
        Finding::new("search_range_missing", "/settings_search")
    });
    if job.asks(Analysis::Certainty) {
        violations.require(job.tolerance.is_some(), || Finding::new("roundness_tolerance_missing", "/tolerance"));
        violations
            .require(job.method == Method::ExactContact, || Finding::new("not_with_nearest_samples", "/analyses"));
    }
}

fn check_effects(job: &Job, violations: &mut Violations) {
    for (i, effect) in job.effects.iter().enumerate() {
        let same = |before: &crate::effects::RingEffect| {
            before.kind() == effect.kind()
                && before.recurs_by().map(f64::to_bits) == effect.recurs_by().map(f64::to_bits)
        };
        violations.require(!job.effects[..i].iter().any(same), || {
            Finding::new("duplicate_effect", format!("/effects/{i}/kind")).with("kind", effect.kind())
        });
    }
}

/// Mean radius of the blank, mm; of the points where it is measured.
pub(in crate::ring_roundness) fn mean_radius_mm(job: &Job) -> Option<f64> {
    match (&job.measured_profile, &job.ring) {
        (Some(measured), _) if !measured.is_empty() => {
            Some(measured.rows().iter().map(|row| row.radius_mm).sum::<f64>() / measured.rows().len() as f64)
        }
        (None, Some(ring)) => Some(ring.radius_mm),
        _ => None,
    }
}

fn check_deviation(job: &Job, radius_mm: f64, violations: &mut Violations) {
    let (deviation_mm, at) = match (&job.measured_profile, &job.ring) {
        (Some(measured), _) => {
            let (low, high) = measured
                .rows()
                .iter()
                .fold((f64::INFINITY, 0.0_f64), |(low, high), row| (low.min(row.radius_mm), high.max(row.radius_mm)));
            (0.5 * (high - low), "/measured_profile")
        }
        (None, Some(ring)) => {
            let waves: f64 = ring.harmonics.iter().map(|wave| wave.amplitude_um * 1e-3).sum();
            (0.5 * ring.ellipticity_mm + waves, "/ring")
        }
        _ => return,
    };
    let waves: f64 = job
        .effects
        .iter()
        .map(|effect| match effect {
            crate::effects::RingEffect::InitialHarmonic { amplitude_mm, .. } => amplitude_mm.abs(),
            _ => 0.0,
        })
        .sum();
    let limit = LARGEST_DEVIATION * radius_mm;
    violations.require(deviation_mm + waves <= limit, || {
        Finding::new("deviation_too_large", at).measured(deviation_mm + waves, limit, "mm")
    });
}

/// Where the job's geometry is impossible: code and pointer, value, limit, unit.
struct Impossible {
    code: &'static str,
    at: &'static str,
    measured: Option<(f64, f64, &'static str)>,
}

fn check_geometry(job: &Job, radius_mm: f64, violations: &mut Violations) {
    let found = impossible(job, radius_mm);
    if found.is_empty() {
        return;
    }
    for fault in found {
        let finding = Finding::new(fault.code, fault.at);
        violations.add(match fault.measured {
            Some((value, limit, unit)) => finding.measured(value, limit, unit),
            None => finding,
        });
    }
    // Would the job make sense with the radius in another unit?
    let at = if job.measured_profile.is_some() { "/measured_profile" } else { "/ring/radius_mm" };
    let units: [(f64, &str); 5] = [(1e-3, "um"), (1e3, "m"), (25.4, "inch"), (10.0, "cm"), (0.5, "diameter")];
    if let Some((factor, unit)) = units.iter().find(|(factor, _)| impossible(job, radius_mm * factor).is_empty()) {
        violations.add(
            Finding::new("profile_unit_suspected", at)
                .value(radius_mm, "mm")
                .with("unit_meant", *unit)
                .with("radius_meant", radius_mm * factor),
        );
    }
}

/// Everything that is geometrically impossible with a ring of that radius.
fn impossible(job: &Job, radius_mm: f64) -> Vec<Impossible> {
    let setting = Scene::of(job, &job.effects).setting;
    let mut found = Vec::new();
    let mut add = |code, at, measured| found.push(Impossible { code, at, measured });
    let reach = radius_mm + setting.roller_radius_mm;
    let half = 0.5 * norm(sub(setting.support_b_mm, setting.support_a_mm));
    let Some(start) = at_radius(&setting, setting.tip_start_mm, radius_mm) else {
        add("ring_falls_through", "/supports/distance_mm", Some((2.0 * half, 2.0 * reach, "mm")));
        return found;
    };
    let deg = |rad: f64| rad.to_degrees();
    if start.half_angle_rad > JAMS_RAD {
        add("ring_jams", "/supports/distance_mm", Some((deg(start.half_angle_rad), deg(JAMS_RAD), "deg")));
    }
    if start.tool_is_below() {
        add("tool_below_ring", "/tool", None);
        return found;
    }
    let clear = start.tool_clearance_rad();
    // A not-a-number is a fault, too.
    if clear.is_nan() || clear < TOOL_CLEARANCE_RAD {
        // Where the tip is taken off the support, the ring ends elsewhere, too.
        add("tool_at_support", "/tool", Some((deg(clear), deg(TOOL_CLEARANCE_RAD), "deg")));
        return found;
    }
    let approach = dot(start.to_tip, setting.feed_direction);
    if approach.is_nan() || approach >= 0.0 {
        add("feed_away_from_ring", "/tool/feed_direction_deg", None);
        return found;
    }
    let gap = norm(sub(setting.tip_start_mm, start.centre_mm)) - radius_mm;
    if gap.is_nan() || gap < -DEEPEST_START * radius_mm {
        add("tool_too_deep", "/tool/y_mm", Some((-gap, DEEPEST_START * radius_mm, "mm")));
        return found;
    }
    let travel = setting.feed_mm_per_rev * setting.revolutions;
    if gap > travel + LARGEST_DEVIATION * radius_mm {
        add("tool_out_of_reach", "/tool/revolutions", Some((gap, travel, "mm")));
        return found;
    }
    check_end(through_tip(&setting, setting.tip_end_mm()).as_ref(), radius_mm, reach, half, &mut add);
    found
}

fn check_end(
    end: Option<&Stance>,
    radius_mm: f64,
    reach: f64,
    half: f64,
    add: &mut impl FnMut(&'static str, &'static str, Option<(f64, f64, &'static str)>),
) {
    match end {
        None => add("ring_falls_through", "/tool/revolutions", Some((2.0 * half, 2.0 * reach, "mm"))),
        Some(end) if end.radius_mm < LEAST_LEFT * radius_mm => {
            add("feed_too_deep", "/tool/revolutions", Some((end.radius_mm, LEAST_LEFT * radius_mm, "mm")));
        }
        Some(end) if end.half_angle_rad > JAMS_RAD => {
            let (found, limit) = (end.half_angle_rad.to_degrees(), JAMS_RAD.to_degrees());
            add("ring_jams", "/tool/revolutions", Some((found, limit, "deg")));
        }
        Some(end) if end.tool_clearance_rad() < TOOL_CLEARANCE_RAD => {
            let (found, limit) = (end.tool_clearance_rad().to_degrees(), TOOL_CLEARANCE_RAD.to_degrees());
            add("tool_at_support", "/tool", Some((found, limit, "deg")));
        }
        Some(_) => {}
    }
}
