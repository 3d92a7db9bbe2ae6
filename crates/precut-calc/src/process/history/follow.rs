//! A change from its alarm until it is part of the mean profile (`process/3.5`).

use serde::{Deserialize, Serialize};

use crate::process::answer::output::{Change, OddPart, Situation};
use crate::process::change::detector::statistic;
use crate::process::change::null::{Column, Null, Older, Source, Told};
use crate::process::change::onsets::{Entry, What};
use crate::process::change::report;
use crate::process::change::verdict::{Judgement, judged};
use crate::process::history::memory::Memory;

/// An accepted change goes on being refined for so many parts.
const REFINED_FOR: usize = 30;
/// Causes that join the model at most, of one change.
const MOST_CAUSES: usize = 4;
/// Changes and odd parts that are told at most.
const MOST_TOLD: usize = 50;

/// A change that was reported and is not yet part of the model.
#[derive(Clone, Serialize, Deserialize)]
pub(in crate::process) struct Pending {
    pub(in crate::process) id: String,
    pub(in crate::process) reported: u32,
    pub(in crate::process) parts_since: usize,
}

/// A change that is part of the model.
#[derive(Clone, Serialize, Deserialize)]
pub(in crate::process) struct Accepted {
    pub(in crate::process) id: String,
    pub(in crate::process) since: u32,
    /// Where anything can have changed when it was found, and the part with which it joined.
    pub(in crate::process) first: u32,
    pub(in crate::process) joined: u32,
    pub(in crate::process) used_then: usize,
}

impl Memory {
    /// What the parts say with this one: odd parts go out, an alarm is followed until its change joins the model.
    pub(in crate::process) fn follow(&mut self, number: u32) -> (Situation, f64) {
        let (entries, evidence) = loop {
            let Some((entries, statistic, odd)) = self.weighed() else {
                return (Situation::InControl, f64::NEG_INFINITY);
            };
            match odd {
                None => break (entries, statistic / std::f64::consts::LN_10),
                Some(odd) => {
                    self.set_aside(odd);
                    if self.pending.is_some() && self.weighed().is_none_or(|(_, statistic, _)| statistic < 0.0) {
                        // The alarm hung on that part.
                        let gone = self.pending.take();
                        self.changes.retain(|change| gone.as_ref().is_none_or(|gone| gone.id != change.id));
                    }
                }
            }
        };
        if let Some(pending) = &mut self.pending {
            pending.parts_since += 1;
        } else if evidence >= 0.0 {
            self.reported += 1;
            self.pending = Some(Pending { id: format!("c{}", self.reported), reported: number, parts_since: 0 });
        } else {
            self.refine();
            return (Situation::InControl, evidence);
        }
        let judgement = self.with_told(|memory, told| judged(&entries, &memory.catalogue, told)).flatten();
        self.tell(judgement.as_ref());
        let settled = self.pending.as_ref().is_some_and(|own| own.parts_since >= self.options.settle_parts as usize);
        if let (true, Some(judgement)) = (settled, judgement) {
            self.accept(number, &judgement);
        }
        (Situation::Changed, evidence)
    }

    /// All hypotheses, the statistic beside its threshold, and the number of a part that is odd.
    pub(in crate::process) fn weighed(&self) -> Option<(Vec<Entry>, f64, Option<u32>)> {
        self.with_null(|told, null| {
            let entries = self.scale().entries(told, null, self.first);
            let statistic = statistic(&self.options, &entries, told, null, &self.scale());
            (entries, statistic.log_evidence, statistic.odd.map(|place| told[place].number))
        })
    }

    fn set_aside(&mut self, number: u32) {
        let reason = self.with_null(|told, null| {
            let part = told.iter().find(|part| part.number == number)?;
            let (chi2, [mean, ..]) = null.distance(part)?;
            // All of it off alike, and no more than chance beside that.
            Some(if mean * mean > 0.5 * chi2 { "gauge_slip" } else { "blank_or_clamping" })
        });
        for (part, _) in &mut self.parts {
            part.odd |= part.number == number;
        }
        self.scores.retain(|(own, ..)| *own != number);
        let reason = reason.flatten().unwrap_or("blank_or_clamping").into();
        self.odd.push(OddPart { number, reason });
        let excess = self.odd.len().saturating_sub(MOST_TOLD);
        self.odd.drain(..excess);
    }

    /// The change that is followed, as it looks now.
    fn tell(&mut self, judgement: Option<&Judgement>) {
        let (Some(pending), Some(judgement)) = (&self.pending, judgement) else { return };
        let change = report::change(&pending.id, pending.reported, false, judgement, &self.catalogue);
        self.changes.retain(|own| own.id != change.id);
        self.changes.push(change);
        let excess = self.changes.len().saturating_sub(MOST_TOLD);
        self.changes.drain(..excess);
    }

    /// A change joins what is free.
    pub(in crate::process) fn accept(&mut self, number: u32, judgement: &Judgement) {
        let Some(pending) = self.pending.take() else { return };
        for suspect in judgement.list.iter().take(MOST_CAUSES) {
            let since = Some((judgement.since, suspect.form));
            match suspect.what {
                What::Cause(variant) => self.columns.push(Column { source: Source::Cause(variant), since, sd: 1.0 }),
                What::Unnamed(size) => {
                    let waves = self.scale().waves(size);
                    let column = |(order, sd): (usize, f64)| Column { source: Source::Wave(order), since, sd };
                    self.columns.extend(waves.into_iter().enumerate().map(column));
                }
            }
        }
        self.free_again();
        if let Some(change) = self.changes.iter_mut().find(|change| change.id == pending.id) {
            change.accepted = true;
        }
        self.accepted.push(Accepted {
            id: pending.id,
            since: judgement.since,
            first: self.first,
            joined: number,
            used_then: self.used,
        });
        self.joined += 1;
        self.first = number + 1;
        self.scores.clear();
    }

    /// The shares of the change that joined last, with the parts since.
    fn refine(&mut self) {
        let Some(accepted) = self.accepted.last() else { return };
        if self.used > accepted.used_then + REFINED_FOR {
            return;
        }
        let gone: Vec<bool> = self.columns.iter().map(|column| accepted.owns(column)).collect();
        let columns: Vec<Column> =
            self.columns.iter().zip(&gone).filter(|(_, gone)| !**gone).map(|(column, _)| column.clone()).collect();
        let known: Vec<bool> = gone.iter().take(self.older.eta.len()).copied().collect();
        let older = self.older.without(&known);
        let counts = self.parts.iter().filter(|(part, _)| !part.odd);
        let told: Vec<Told<'_>> =
            counts.filter_map(|(part, gram)| Some(Told::of(part, gram.as_ref()?, &columns))).collect();
        let Some(null) = Null::of(&columns, &older, told.iter()) else { return };
        let mut entries = self.scale().entries(&told, &null, accepted.first);
        entries.retain(|entry| entry.since <= accepted.joined);
        let Some(judgement) = judged(&entries, &self.catalogue, &told) else { return };
        // What a person said stays.
        let own = |change: &&mut Change| change.id == accepted.id && change.decided.is_none();
        if let Some(change) = self.changes.iter_mut().find(own) {
            *change = report::change(&accepted.id, change.reported_at_part, true, &judgement, &self.catalogue);
        }
    }

    /// A change of long ago becomes part of the mean profile: what was before it is forgotten.
    pub(in crate::process) fn close(&mut self, id: &str) {
        let Some(place) = self.accepted.iter().position(|accepted| accepted.id == id) else { return };
        let gone = self.accepted.remove(place);
        self.parts.retain(|(part, _)| part.number >= gone.since);
        self.columns.retain(|column| !gone.owns(column));
        self.free_again();
        self.older = Older::none();
    }
}

impl Accepted {
    pub(in crate::process) fn owns(&self, column: &Column) -> bool {
        column.since.is_some_and(|(since, _)| since == self.since)
    }
}
