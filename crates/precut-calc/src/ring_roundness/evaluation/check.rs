//! Rules between fields. What one field alone may hold stands in its schema.

use crate::calculator::{Check, Finding, Violations};

use super::input::{Job, RoundnessFilter};
use super::readings::{Readings, Table, angles_deg, count};

/// Codes of the faults found here.
pub(super) const CODES: &[&str] = &[
    "profile_missing",
    "profile_given_twice",
    "nominal_radius_missing",
    "too_few_points",
    "angles_not_ascending",
    "duplicate_angle",
    "angles_beyond_one_turn",
    "angles_look_like_radians",
    "gap_too_wide",
    "points_on_a_line",
    "duplicate_point",
    "deviation_below_centre",
    "not_round",
    "cutoff_beyond_points",
    "band_inside_out",
];

/// Fewest points of a profile.
const FEWEST_POINTS: usize = 16;
/// Widest gap between neighbouring points: half a wave of six lobes.
const WIDEST_GAP_DEG: f64 = 30.0;
/// Largest deviation, half of peak to valley, over the radius.
const LARGEST_DEVIATION: f64 = 0.05;

impl Check for Job {
    fn check(&self, violations: &mut Violations) {
        check_filter(self, violations);
        let [table] = Table::of(self)[..] else {
            let code = if Table::of(self).is_empty() { "profile_missing" } else { "profile_given_twice" };
            let given: Vec<&'static str> = Table::of(self).into_iter().map(Table::name).collect();
            violations.add(Finding::new(code, "").with("given", given));
            return;
        };
        let at = format!("/{}", table.name());
        let points = count(self);
        violations.require(points >= FEWEST_POINTS, || {
            // Counts here are far below 2^53.
            #[allow(clippy::cast_precision_loss)]
            Finding::new("too_few_points", &at).measured(points as f64, FEWEST_POINTS as f64, "1")
        });
        let in_order = angles_deg(self).is_none_or(|angles| check_angles(&at, &angles, violations));
        let has_radius = table != Table::Deviations || check_nominal(self, violations);
        if points >= FEWEST_POINTS && in_order && has_radius {
            check_form(self, &at, violations);
        }
    }
}

/// Ascending, none twice, within one turn. Whether they are.
fn check_angles(at: &str, angles: &[f64], violations: &mut Violations) -> bool {
    let mut in_order = true;
    for (index, pair) in angles.windows(2).enumerate() {
        let [before, angle] = [pair[0], pair[1]];
        if angle <= before {
            let code = if angle < before { "angles_not_ascending" } else { "duplicate_angle" };
            violations.add(Finding::new(code, format!("{at}/{}/angle_deg", index + 1)).measured(angle, before, "deg"));
            in_order = false;
        }
    }
    if let (true, Some(first), Some(last)) = (in_order, angles.first(), angles.last())
        && last - first >= 360.0
    {
        let finding = Finding::new("angles_beyond_one_turn", format!("{at}/{}/angle_deg", angles.len() - 1));
        violations.add(finding.measured(*last, first + 360.0, "deg"));
        in_order = false;
    } else if let (true, Some(first), Some(last)) = (in_order, angles.first(), angles.last())
        && angles.len() >= FEWEST_POINTS
        && (5.0..=std::f64::consts::TAU + 1e-9).contains(&(last - first))
    {
        // A whole turn, one step short, in radians.
        violations.add(Finding::new("angles_look_like_radians", at).value(*last, "deg"));
        in_order = false;
    }
    in_order
}

/// Deviations need what they are deviations from, and must leave a radius. Whether they have both.
fn check_nominal(job: &Job, violations: &mut Violations) -> bool {
    let Some(nominal_mm) = job.nominal_radius_mm else {
        violations.add(Finding::new("nominal_radius_missing", "/nominal_radius_mm"));
        return false;
    };
    let rows = job.deviations.as_ref().map_or(&[][..], |table| table.rows());
    let limit_um = -1e3 * nominal_mm;
    let inside = rows.iter().position(|row| row.radial_deviation_um <= limit_um);
    if let Some(index) = inside {
        let finding = Finding::new("deviation_below_centre", format!("/deviations/{index}/radial_deviation_um"));
        violations.add(finding.measured(rows[index].radial_deviation_um, limit_um, "um"));
    }
    inside.is_none()
}

/// What only the circle through the points shows: gaps, points in one direction, a form that is not round.
fn check_form(job: &Job, at: &str, violations: &mut Violations) {
    let Ok(readings) = Readings::of(job) else {
        violations.add(Finding::new("points_on_a_line", at));
        return;
    };
    let row = |point: usize| format!("{at}/{}", readings.rows[point]);
    let (gap_deg, after) = readings.largest_gap;
    violations.require(gap_deg <= WIDEST_GAP_DEG, || {
        Finding::new("gap_too_wide", row(after))
            .measured(gap_deg, WIDEST_GAP_DEG, "deg")
            .with("before_row", readings.rows[(after + readings.rows.len() - 1) % readings.rows.len()])
    });
    if job.points.is_some() {
        let pairs = readings.angles_deg.windows(2).enumerate();
        for (index, pair) in pairs.filter(|(_, pair)| pair[1] <= pair[0]) {
            let finding = Finding::new("duplicate_point", row(index + 1)).value(pair[1], "deg");
            violations.add(finding.with("other_row", readings.rows[index]));
        }
    }
    let radius_mm = readings.circle.circle.radius_mm;
    let deviation = 0.5 * readings.circle.span.width_mm() / radius_mm;
    violations.require(deviation <= LARGEST_DEVIATION, || {
        Finding::new("not_round", at).measured(deviation, LARGEST_DEVIATION, "1").with("radius_mm", radius_mm)
    });
}

fn check_filter(job: &Job, violations: &mut Violations) {
    if let RoundnessFilter::BandPass { from_upr, to_upr } = job.filter {
        violations.require(from_upr < to_upr, || {
            Finding::new("band_inside_out", "/filter/from_upr").measured(from_upr, to_upr, "1")
        });
    }
    let points = filter_points(job);
    if let Some((cutoff, field)) = job.filter.highest_cutoff()
        && points > 0.0
    {
        violations.require(cutoff <= 0.5 * points, || {
            let finding = Finding::new("cutoff_beyond_points", format!("/filter/{field}"));
            finding.measured(cutoff, (0.5 * points).floor(), "1").with("points", points)
        });
    }
}

/// How many points the filter has to go by: those measured, or the fewer that they are brought to.
pub(super) fn filter_points(job: &Job) -> f64 {
    // At most 200 000.
    #[allow(clippy::cast_precision_loss)]
    let measured = count(job) as f64;
    job.profile_points.map_or(measured, |points| measured.min(f64::from(points)))
}
