//! Rules between fields. What one field alone may hold stands in its schema.

use crate::calculator::{Check, Finding, Violations};
use crate::effects::FixtureEffect as Effect;

use crate::fixture_stability::job::acting::Case;
use crate::fixture_stability::job::input::{FixtureJob, Friction, FrictionRange, MAX_MAP_POINTS, SpindlePoint, Vise};
use crate::fixture_stability::job::uncertain;
use crate::fixture_stability::model::cutting::engagement_rad;

/// Codes of the faults found here, and those that fields name for their range.
pub(in crate::fixture_stability) const CODES: &[&str] = &[
    "strip_misses_cutter",
    "spindle_speed_or_speed",
    "feed_missing",
    "feeds_disagree",
    "bad_spindle_speed",
    "bad_feed_per_tooth",
    "negative_damping",
    "bad_clamp_force",
    "speeds_reversed",
    "too_many_map_points",
    "steady_beyond_run",
    "spindle_without_limit",
    "spindle_row_without_limit",
    "spindle_speeds_unordered",
    "duplicate_effect",
    "condition_missing",
    "effect_without_jaw",
    "effect_without_clamp_force",
    "exponent_beyond_law",
    "runout_beyond_feed",
    "jaw_face_missing",
    "frictions_unordered",
    "friction_range_or_sd",
];

/// S and S_z that both are given may differ by so much.
const FEEDS_AGREE: f64 = 0.01;

impl Check for FixtureJob {
    fn check(&self, violations: &mut Violations) {
        check_cut(self, violations);
        check_grip(self, violations);
        check_spindle(self, violations);
        check_lobes(self, violations);
        check_simulation(self, violations);
        check_effects(self, violations);
        uncertain::check(self, violations);
    }
}

fn check_cut(job: &FixtureJob, violations: &mut Violations) {
    let cut = &job.cut;
    let radius = 0.5 * job.cutter.diameter_mm;
    violations.require(engagement_rad(radius, cut.width_mm, cut.offset_mm).is_some(), || {
        Finding::new("strip_misses_cutter", "/cut/offset_mm").measured(
            cut.offset_mm.abs(),
            radius + 0.5 * cut.width_mm,
            "mm",
        )
    });
    violations.require(cut.spindle_speed_rpm.is_some() != cut.speed_m_per_min.is_some(), || {
        let given = if cut.speed_m_per_min.is_some() { "both" } else { "neither" };
        Finding::new("spindle_speed_or_speed", "/cut").with("given", given)
    });
    violations.require(cut.feed_mm_per_tooth.is_some() || cut.feed_mm_per_min.is_some(), || {
        Finding::new("feed_missing", "/cut/feed_mm_per_tooth")
    });
    if let (Some(per_tooth), Some((of_table, table))) = (cut.feed_mm_per_tooth, job.feed_of_table_mm()) {
        let wanted = table * per_tooth / of_table;
        violations.require((per_tooth - of_table).abs() <= FEEDS_AGREE * per_tooth, || {
            Finding::new("feeds_disagree", "/cut/feed_mm_per_min")
                .measured(table, wanted, "mm/min")
                .with("feed_mm_per_tooth", per_tooth)
        });
    }
}

/// What is known of a friction stands in order, and once.
pub(crate) fn check_friction(friction: Friction, at: &str, violations: &mut Violations) {
    let FrictionRange { low, value, high } = friction.range();
    let has_range = friction.low.is_some() || friction.high.is_some();
    violations
        .require(!has_range || friction.sd.is_none(), || Finding::new("friction_range_or_sd", format!("{at}/sd")));
    violations.require(low <= value && value <= high, || {
        Finding::new("frictions_unordered", at).with("low", low).with("value", value).with("high", high)
    });
}

fn check_grip(job: &FixtureJob, violations: &mut Violations) {
    let Some(grip) = job.fixture.grip() else { return };
    check_friction(grip.friction, "/fixture/clamp/friction", violations);
    let faced = grip.jaw_length_mm.is_some() && grip.jaw_height_mm.is_some();
    violations.require(faced || grip.force_height_mm <= 0.0, || {
        let missing = if grip.jaw_length_mm.is_none() { "jaw_length_mm" } else { "jaw_height_mm" };
        Finding::new("jaw_face_missing", format!("/fixture/clamp/{missing}")).with("height", grip.force_height_mm)
    });
}

fn check_spindle(job: &FixtureJob, violations: &mut Violations) {
    let Some(spindle) = &job.spindle else { return };
    let limits = spindle.power_kw.is_some() || spindle.torque_n_m.is_some() || !spindle.characteristic.is_empty();
    violations.require(limits, || Finding::new("spindle_without_limit", "/spindle"));
    check_characteristic(&spindle.characteristic, violations);
}

/// Rows of a spindle: each states a limit, by rising speed.
pub(crate) fn check_characteristic(rows: &[SpindlePoint], violations: &mut Violations) {
    for (i, row) in rows.iter().enumerate() {
        violations.require(row.power_kw.is_some() || row.torque_n_m.is_some(), || {
            Finding::new("spindle_row_without_limit", format!("/spindle/characteristic/{i}"))
        });
    }
    for (i, pair) in rows.windows(2).enumerate() {
        let (before, here) = (pair[0].spindle_speed_rpm, pair[1].spindle_speed_rpm);
        violations.require(before < here, || {
            Finding::new("spindle_speeds_unordered", format!("/spindle/characteristic/{}/spindle_speed_rpm", i + 1))
                .measured(here, before, "rev/min")
        });
    }
}

fn check_lobes(job: &FixtureJob, violations: &mut Violations) {
    let lobes = &job.lobes;
    let working = job.spindle_rpm();
    let (from, to) = (lobes.from_rpm.or(working.map(|n| 0.5 * n)), lobes.to_rpm.or(working.map(|n| 2.0 * n)));
    if let (Some(from), Some(to)) = (from, to) {
        violations
            .require(from < to, || Finding::new("speeds_reversed", "/lobes/to_rpm").measured(to, from, "rev/min"));
    }
    let points = u64::from(lobes.speeds) * if lobes.map { u64::from(lobes.depths) } else { 24 };
    violations.require(points <= MAX_MAP_POINTS, || {
        let at = if lobes.map && lobes.depths > lobes.speeds { "/lobes/depths" } else { "/lobes/speeds" };
        Finding::new("too_many_map_points", at).with("points", points as f64).with("most", MAX_MAP_POINTS as f64)
    });
}

fn check_simulation(job: &FixtureJob, violations: &mut Violations) {
    let of = &job.simulation;
    if let (Some(all), Some(steady)) = (of.tooth_periods, of.steady_tooth_periods) {
        violations.require(steady <= all, || {
            Finding::new("steady_beyond_run", "/simulation/steady_tooth_periods").measured(
                f64::from(steady),
                f64::from(all),
                "1",
            )
        });
    }
}

fn check_effects(job: &FixtureJob, violations: &mut Violations) {
    for (i, effect) in job.effects.iter().enumerate() {
        let kind = effect.kind();
        let at = |field: &str| format!("/effects/{i}{field}");
        violations.require(job.effects[..i].iter().all(|before| before.kind() != kind), || {
            Finding::new("duplicate_effect", at("/kind")).with("kind", kind)
        });
        for condition in effect.cause().conditions {
            violations.require(job.conditions.time_since_clamping_min.is_some(), || {
                Finding::new("condition_missing", format!("/conditions/{condition}"))
                    .with("kind", kind)
                    .with("condition", *condition)
            });
        }
        match *effect {
            Effect::JawMass { .. } => {
                violations.require(matches!(job.fixture, Vise::ConstantForce(_)), || {
                    Finding::new("effect_without_jaw", at("")).with("kind", kind)
                });
            }
            Effect::PreloadLoss { .. } => violations.require(job.fixture.common().3.is_some(), || {
                Finding::new("effect_without_clamp_force", at("")).with("kind", kind)
            }),
            Effect::ChipThicknessExponent { delta } => {
                exponent(job.force.chip_thickness_exponent, delta, at("/delta"), violations);
            }
            Effect::DepthExponent { delta } => exponent(job.force.depth_exponent, delta, at("/delta"), violations),
            Effect::ToothRunout { runout_mm } => {
                let feed = job.feed_mm().unwrap_or(f64::INFINITY);
                violations.require(runout_mm.abs() < feed, || {
                    Finding::new("runout_beyond_feed", at("/runout_mm")).measured(runout_mm.abs(), feed, "mm")
                });
            }
            _ => {}
        }
    }
}

/// k or mu with its change must stay in 0..1.
fn exponent(stated: f64, delta: f64, at: String, violations: &mut Violations) {
    let sum = stated + delta;
    violations.require((0.0..1.0).contains(&sum), || {
        Finding::new("exponent_beyond_law", at).measured(delta, if sum < 0.0 { -stated } else { 1.0 - stated }, "1")
    });
}

/// Whether effects put on top of a job leave a model.
pub(in crate::fixture_stability) fn holds(case: &Case) -> bool {
    (0.0..1.0).contains(&case.cutting.chip_exponent)
        && (0.0..1.0).contains(&case.cutting.depth_exponent)
        && case.cutting.runout_mm.abs() < case.working.feed_mm
}
