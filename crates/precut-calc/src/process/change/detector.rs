//! When to say that something changed, and which parts are odd by themselves (`process/3.3`).

use crate::diagnosis::log_sum_exp;
use crate::process::change::null::{Null, Told};
use crate::process::change::onsets::{Entry, Scale};
use crate::process::part::document::Options;

/// So many of the last parts may be odd by themselves.
const SUSPECTS: usize = 6;
/// Parts that have to follow before one is called odd.
const WITNESSES: usize = 2;
/// How much likelier than any change, and than chance, an odd part has to be; how rarely a process is thought to change there.
const SURER: f64 = 10.0;
const CHANGES_EVERY: f64 = 500.0;
/// The share of odd parts is at least this over the threshold: one part alone stays below it.
const LEAST_SHARE: f64 = 1.5;

/// What the parts so far say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::process) struct Statistic {
    /// ln R.
    pub(in crate::process) log_r: f64,
    /// ln of R/(1 + eps E)/A: 0 is the alarm.
    pub(in crate::process) log_evidence: f64,
    /// Place among the parts of one that is odd by itself, the likeliest.
    pub(in crate::process) odd: Option<usize>,
}

/// R over the onsets and causes, held against single odd parts.
pub(in crate::process) fn statistic(
    options: &Options,
    entries: &[Entry],
    parts: &[Told<'_>],
    null: &Null,
    scale: &Scale<'_>,
) -> Statistic {
    let weights: Vec<f64> = entries.iter().map(|entry| entry.log_weight).collect();
    let log_r = log_sum_exp(&weights);
    let first = parts.len().saturating_sub(SUSPECTS);
    let alone: Vec<f64> = scale.log_alone(&parts[first..], null);
    let alarm = options.alarm();
    let share = if options.changed_after_parts < 2 { 0.0 } else { options.bad_part_share.max(LEAST_SHARE / alarm) };
    // ln(1 + eps E).
    let doubt = log_sum_exp(&[0.0, share.ln() + log_sum_exp(&alone)]);
    let log_evidence = log_r - doubt - alarm.ln();
    let likely = |place: usize| share.ln() + alone[place - first];
    let needed = SURER.ln() + log_sum_exp(&[0.0, log_r - CHANGES_EVERY.ln()]);
    let candidates = (first..parts.len().saturating_sub(WITNESSES)).filter(|&place| likely(place) > needed);
    let odd = candidates.max_by(|&a, &b| likely(a).total_cmp(&likely(b)));
    Statistic { log_r, log_evidence, odd }
}
