//! Which limits bind and what they cost: multipliers read back (`feed/6.6`).

use super::case::Case;
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
        let multiplier = solution.row_multipliers[row] * solved.elasticity;
        if multiplier > LEAST && label.kind.is_limit() {
            found.push(one(case, label, multiplier, has_parallel(solved, row)));
        }
    }
    for (sum, label) in solved.built.sums.iter().enumerate() {
        let multiplier = solution.sum_multipliers[sum] * solved.elasticity;
        if multiplier > LEAST && label.kind.is_limit() {
            found.push(one(case, label, multiplier, false));
        }
    }
    let found = merged(found);
    let mut found = found;
    found.sort_by(|a, b| b.gain_percent.total_cmp(&a.gain_percent));
    found
}

fn one(case: &Case, label: &Label, multiplier: f64, degenerate: bool) -> Binding {
    let name = label.name(case);
    let gain_percent = if label.plain { multiplier * label.limit } else { multiplier };
    Binding {
        constraint: name.constraint,
        zone: name.zone,
        limit: label.limit,
        unit: label.unit.to_owned(),
        multiplier,
        per_unit: label.plain,
        gain_percent,
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
