//! Which cause, since when, how large (`process/3.5`).

use crate::diagnosis::log_sum_exp;
use crate::process::change::null::{Form, Told};
use crate::process::change::onsets::{Entry, What};
use crate::process::part::sight::{COSINES, Catalogue};

/// Share of one cause from which on it is named, of what has no name, and of the list.
const NAMED: f64 = 0.8;
const UNNAMED: f64 = 0.5;
const LISTED: f64 = 0.95;
/// Share of the onsets.
const ONSETS: f64 = 0.9;
/// Columns that agree better than this cannot be told apart.
const SAME: f64 = 0.9995;
/// A normal distribution holds 95 % within so many standard deviations.
pub(in crate::process) const NORMAL_95: f64 = 1.96;

/// What changed, as the parts tell it.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::process) struct Judgement {
    /// The 95 % list, likeliest first, with those that cannot be told from one of it.
    pub(in crate::process) list: Vec<Suspect>,
    /// Likeliest onset and the shortest range that holds 90 %.
    pub(in crate::process) since: u32,
    pub(in crate::process) since_90: [u32; 2],
    pub(in crate::process) class: Class,
}

/// How sure the name is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::process) enum Class {
    Named,
    OneOf,
    Unnamed,
}

/// A cause that may have changed.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::process) struct Suspect {
    /// Which; none has no name.
    pub(in crate::process) name: Option<usize>,
    pub(in crate::process) share: f64,
    /// Its likeliest variant and form.
    pub(in crate::process) what: What,
    pub(in crate::process) form: Form,
    /// Size of that, in prior standard deviations of the variant; of what has no name its largest deviation, in the unit of
    /// the quantity.
    pub(in crate::process) mean: f64,
    pub(in crate::process) deviation: f64,
    /// Whether another of the list has the same columns.
    pub(in crate::process) same_as_other: bool,
}

/// From all hypotheses, those that are heard; `parts` are those that the columns of causes are compared on.
pub(in crate::process) fn judged(entries: &[Entry], catalogue: &Catalogue, parts: &[Told<'_>]) -> Option<Judgement> {
    let weights: Vec<f64> = entries.iter().map(|entry| entry.log_weight).collect();
    let total = log_sum_exp(&weights);
    let share = |entry: &Entry| (entry.log_weight - total).exp();
    let (since, since_90) = onset(entries, &share)?;
    let unnamed = catalogue.names.len();
    let place = |entry: &Entry| match entry.what {
        What::Cause(variant) => catalogue.variants[variant].name,
        What::Unnamed(_) => unnamed,
    };
    let mut shares = vec![0.0; unnamed + 1];
    for entry in entries {
        shares[place(entry)] += share(entry);
    }
    let suspect = |name: usize| {
        let own: Vec<&Entry> = entries.iter().filter(|entry| place(entry) == name).collect();
        let leader = own.iter().max_by(|a, b| a.log_weight.total_cmp(&b.log_weight))?;
        let alike = own.iter().filter(|entry| entry.form == leader.form && is_alike(entry.what, leader.what));
        let moments = alike
            .map(|entry| (share(entry), entry.size()))
            .fold((0.0, 0.0, 0.0), |(w, m, s), (share, (mean, variance))| {
                (w + share, m + share * mean, s + share * (mean * mean + variance))
            });
        let mean = moments.1 / moments.0;
        Some(Suspect {
            name: (name < unnamed).then_some(name),
            share: shares[name],
            what: leader.what,
            form: leader.form,
            mean,
            deviation: (moments.2 / moments.0 - mean * mean).max(0.0).sqrt(),
            same_as_other: false,
        })
    };
    let mut all: Vec<Suspect> = (0..=unnamed).filter_map(suspect).collect();
    all.sort_by(|a, b| b.share.total_cmp(&a.share));
    let mut listed = 0;
    let mut held = 0.0;
    while listed < all.len() && held < LISTED {
        held += all[listed].share;
        listed += 1;
    }
    let (mut list, rest) = (all[..listed].to_vec(), &all[listed..]);
    let acting: Vec<&Told<'_>> = parts.iter().filter(|part| part.number >= since).collect();
    for other in rest {
        if list.iter().any(|own| is_same(own, other, &acting)) {
            list.push(other.clone());
        }
    }
    for place in 0..list.len() {
        let is_twin = |other: usize| other != place && is_same(&list[place], &list[other], &acting);
        list[place].same_as_other = (0..list.len()).any(is_twin);
    }
    let leader = list.first()?;
    let class = match leader.name {
        _ if shares[unnamed] >= UNNAMED => Class::Unnamed,
        Some(_) if leader.share >= NAMED && !leader.same_as_other => Class::Named,
        _ => Class::OneOf,
    };
    Some(Judgement { list, since, since_90, class })
}

fn is_alike(a: What, b: What) -> bool {
    match (a, b) {
        (What::Unnamed(_), What::Unnamed(_)) => true,
        _ => a == b,
    }
}

/// Whether what two causes do since an onset cannot be told apart.
fn is_same(a: &Suspect, b: &Suspect, parts: &[&Told<'_>]) -> bool {
    let (What::Cause(one), What::Cause(other)) = (a.what, b.what) else { return false };
    let sum = |i: usize, j: usize| parts.iter().map(|part| part.gram.inner[(COSINES + i, COSINES + j)]).sum::<f64>();
    let lengths = sum(one, one) * sum(other, other);
    lengths > 0.0 && sum(one, other).abs() > SAME * lengths.sqrt()
}

/// The likeliest onset, and the shortest range of onsets that holds 90 %.
fn onset(entries: &[Entry], share: &impl Fn(&Entry) -> f64) -> Option<(u32, [u32; 2])> {
    let mut onsets: Vec<(u32, f64)> = Vec::new();
    // Hypotheses come onset by onset, the latest first.
    for entry in entries {
        match onsets.last_mut() {
            Some((since, sum)) if *since == entry.since => *sum += share(entry),
            _ => onsets.push((entry.since, share(entry))),
        }
    }
    onsets.reverse();
    let since = onsets.iter().max_by(|a, b| a.1.total_cmp(&b.1))?.0;
    let width = |(from, to): (usize, usize)| onsets[to].0 - onsets[from].0;
    let mut best = (0, onsets.len() - 1);
    for from in 0..onsets.len() {
        let mut held = 0.0;
        let reached = (from..onsets.len()).find(|&to| {
            held += onsets[to].1;
            held >= ONSETS
        });
        let Some(to) = reached else { break };
        if width((from, to)) < width(best) {
            best = (from, to);
        }
    }
    Some((since, [onsets[best.0].0, onsets[best.1].0]))
}
