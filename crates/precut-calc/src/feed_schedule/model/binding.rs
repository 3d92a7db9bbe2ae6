//! Which limits bind and what they cost: multipliers read back (`feed/6.6`).

use std::collections::HashMap;

use crate::feed_schedule::answer::output::Binding;
use crate::feed_schedule::job::case::Case;
use crate::feed_schedule::model::dual::Active;
use crate::feed_schedule::model::program::{Kind, Label};
use crate::feed_schedule::model::solve::Solved;

/// Multipliers up to this are rounding.
const LEAST: f64 = 1e-4;

/// Binding limits of the job, the most costly first.
pub(in crate::feed_schedule) fn binding(case: &Case, solved: &Solved) -> Vec<Binding> {
    let solution = &solved.certificate;
    let active = Active::of(solved);
    let labels = solved.built.rows.iter().chain(&solved.built.sums);
    let multipliers = solution.row_multipliers.iter().chain(&solution.sum_multipliers);
    let mut found: Vec<Binding> = Vec::new();
    for (row, (label, &price)) in labels.zip(multipliers).enumerate() {
        if price * solved.elasticity > LEAST && label.kind.is_limit() {
            let degenerate = !solved.shares_risk && active.is_known() && !active.settles(&[(row, 1.0)]);
            found.push(one(case, solved, label, price, degenerate));
        }
    }
    let mut found = merged(found);
    found.sort_by(|a, b| b.gain_percent.total_cmp(&a.gain_percent));
    found
}

fn one(case: &Case, solved: &Solved, label: &Label, price: f64, degenerate: bool) -> Binding {
    let mut name = label.name(case);
    if label.kind == Kind::WholeParts {
        // It is a limit on the usage; that its number is no knob stands in the prices.
        name.constraint = Kind::ToolUsage.name().into_owned();
    }
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
    let mut places: HashMap<(String, String, u64), usize> = HashMap::new();
    for next in all {
        let key = (next.constraint.clone(), next.zone.clone(), next.limit.to_bits());
        if let Some(&at) = places.get(&key) {
            out[at].multiplier += next.multiplier;
            out[at].gain_percent += next.gain_percent;
        } else {
            places.insert(key, out.len());
            out.push(next);
        }
    }
    out
}
