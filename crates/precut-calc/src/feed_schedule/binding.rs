//! Which limits bind and what they cost: multipliers read back (`feed/6.6`).

use super::case::Case;
use super::input::Job;
use super::output::Binding;
use super::program::{Label, Place};
use super::solve::Solved;

/// Multipliers up to this are rounding.
const LEAST: f64 = 1e-4;
/// A limit nearer than this, in logarithms, binds.
const NEAR: f64 = 1e-7;

/// Binding limits of the job, the most costly first.
pub(super) fn binding(case: &Case, solved: &Solved) -> Vec<Binding> {
    let solution = &solved.certificate;
    let mut found: Vec<Binding> = Vec::new();
    for (row, label) in solved.built.rows.iter().enumerate() {
        let price = solution.row_multipliers[row];
        if price * solved.elasticity > LEAST && label.kind.is_limit() {
            found.push(one(case, solved, label, price, has_parallel(solved, row)));
        }
    }
    for (sum, label) in solved.built.sums.iter().enumerate() {
        let price = solution.sum_multipliers[sum];
        if price * solved.elasticity > LEAST && label.kind.is_limit() {
            found.push(one(case, solved, label, price, false));
        }
    }
    let mut found = merged(found);
    found.sort_by(|a, b| b.gain_percent.total_cmp(&a.gain_percent));
    found
}

/// Whether it is a lower limit: one percent less of it gains, not one percent more.
pub(super) fn is_lower(job: &Job, bound: &Binding) -> bool {
    let least = |min: Option<f64>| min.is_some_and(|min| min.total_cmp(&bound.limit).is_eq());
    matches!(bound.constraint.as_str(), "rpm_min" | "feed_min" | "speed_min" | "tool_life_min")
        || job.custom.iter().any(|custom| custom.name == bound.constraint && least(custom.min))
}

fn one(case: &Case, solved: &Solved, label: &Label, price: f64, degenerate: bool) -> Binding {
    let name = label.name(case);
    // A semi-log limit has its price per unit; one percent of it is so many units.
    let per_share = if label.plain { label.limit } else { 1.0 };
    Binding {
        constraint: name.constraint,
        zone: name.zone,
        limit: label.limit,
        unit: label.unit.to_owned(),
        multiplier: price * solved.elasticity,
        per_unit: label.plain,
        gain_percent: price * per_share * solved.gain,
        degenerate,
    }
}

/// Rows of one name (both of a feed step, of a spread) are one limit: their multipliers add.
fn merged(all: Vec<Binding>) -> Vec<Binding> {
    let mut out: Vec<Binding> = Vec::with_capacity(all.len());
    for next in all {
        match out.iter_mut().find(|known| {
            known.constraint == next.constraint && known.zone == next.zone && known.limit.total_cmp(&next.limit).is_eq()
        }) {
            Some(known) => {
                known.multiplier += next.multiplier;
                known.gain_percent += next.gain_percent;
            }
            None => out.push(next),
        }
    }
    out
}

/// Whether another row binds at the same place with the same normal: only the sum of both multipliers is certain.
fn has_parallel(solved: &Solved, row: usize) -> bool {
    let rows = &solved.built.program.rows;
    let Place::Zone(zone) = solved.built.rows[row].place else { return false };
    let own: Vec<(usize, f64)> = rows.entries(row).collect();
    let norm = |entries: &[(usize, f64)]| entries.iter().map(|(_, a)| a * a).sum::<f64>().sqrt();
    (0..rows.len()).any(|other| {
        if other == row || solved.built.rows[other].place != Place::Zone(zone) {
            return false;
        }
        if solved.certificate.row_slacks[other] > NEAR {
            return false;
        }
        let entries: Vec<(usize, f64)> = rows.entries(other).collect();
        let dot: f64 = own.iter().map(|(i, a)| a * entries.iter().find(|(j, _)| i == j).map_or(0.0, |(_, b)| *b)).sum();
        dot >= (1.0 - 1e-12) * norm(&own) * norm(&entries) && dot > 0.0
    })
}
