//! Rules between fields. What one field alone may hold stands in its schema.

use crate::calculator::{Check, Finding, Violations};

use super::input::{Job, RoundnessFilter};
use super::instrument::Unknown;
use super::readings::{Readings, Table, count, file, given_angles_deg, has_deviations, nominal_mm};

/// Codes of the faults found here.
pub(super) const CODES: &[&str] = &[
    "profile_missing",
    "profile_given_twice",
    "layout_unknown",
    "section_missing",
    "nominal_radius_missing",
    "too_few_points",
    "angles_look_like_radians",
    "points_on_a_line",
    "deviation_below_centre",
    "not_round",
    "band_inside_out",
];

/// Fewest points of a profile.
const FEWEST_POINTS: usize = 3;
/// Fewest rows whose angles can be told to be radians.
const TELLING_ROWS: usize = 16;
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
        if table == Table::File && !check_file(self, violations) {
            return;
        }
        let points = count(self);
        violations.require(points >= FEWEST_POINTS, || {
            // Counts here are far below 2^53.
            #[allow(clippy::cast_precision_loss)]
            Finding::new("too_few_points", &at).measured(points as f64, FEWEST_POINTS as f64, "1")
        });
        let in_order = given_angles_deg(self).is_none_or(|angles| check_angles(&at, &angles, violations));
        let has_radius = !has_deviations(self) || check_nominal(self, violations);
        if points >= FEWEST_POINTS && in_order && has_radius {
            check_form(self, &at, violations);
        }
    }
}

/// Angles in degrees. Whether they are.
fn check_angles(at: &str, angles: &[f64], violations: &mut Violations) -> bool {
    let (low, high) = angles.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), a| (l.min(*a), h.max(*a)));
    // A whole turn, one step short, in radians.
    let in_radians = angles.len() >= TELLING_ROWS && (5.0..=std::f64::consts::TAU + 1e-9).contains(&(high - low));
    if in_radians {
        violations.add(Finding::new("angles_look_like_radians", at).value(high, "deg"));
    }
    !in_radians
}

/// A file must be understood, and hold the section that is asked for. Whether it does.
fn check_file(job: &Job, violations: &mut Violations) -> bool {
    match file(job) {
        Some(Err(Unknown::NoNumbers)) => {
            violations.add(Finding::new("layout_unknown", "/file/text"));
            false
        }
        Some(Err(Unknown::Columns(columns))) => {
            violations.add(Finding::new("layout_unknown", "/file/columns").with("columns", columns));
            false
        }
        Some(Ok(read)) => {
            let asked = job.file.as_ref().map_or(1, |file| file.section) as usize;
            let there = read.sections.len();
            violations.require(asked <= there, || {
                Finding::new("section_missing", "/file/section").with("asked", asked).with("there", there)
            });
            asked <= there
        }
        None => true,
    }
}

/// Deviations need what they are deviations from, and must leave a radius. Whether they have both.
fn check_nominal(job: &Job, violations: &mut Violations) -> bool {
    let Some(nominal_mm) = nominal_mm(job) else {
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

/// What only the circle through the points shows: points on a line, a form that is not round.
fn check_form(job: &Job, at: &str, violations: &mut Violations) {
    let Ok(readings) = Readings::of(job, &|| true) else {
        violations.add(Finding::new("points_on_a_line", at));
        return;
    };
    let radius_mm = readings.circle.circle.radius_mm;
    let deviation = 0.5 * readings.circle.span.width_mm() / radius_mm;
    violations.require(deviation <= LARGEST_DEVIATION, || {
        Finding::new("not_round", at)
            .measured(deviation, LARGEST_DEVIATION, "1")
            .with("radius_mm", radius_mm)
            .with("spikes", readings.spikes.len())
    });
}

fn check_filter(job: &Job, violations: &mut Violations) {
    if let RoundnessFilter::BandPass { from_upr, to_upr } = job.filter {
        violations.require(from_upr < to_upr, || {
            Finding::new("band_inside_out", "/filter/from_upr").measured(from_upr, to_upr, "1")
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
