//! A process, part by part.

use std::collections::VecDeque;

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::detector::statistic;
use super::document::{Document, Options, Part, Threshold};
use super::null::{Column, Gram, Null, Older, Source, Told};
use super::onsets::{Entry, Scale, WINDOW, What};
use super::report;
use super::scatter::Scatter;
use super::sight::{COSINES, Catalogue, Eye, Sighting, used};
use super::state::{Change, OddPart, ScatterReport, Score, Situation, State, Unused};
use super::verdict::{Judgement, judged};
use crate::calculator::{Calculator, Failure, ForwardModel, Monitor, Watched};
use crate::diagnosis::outliers;

/// A part with fewer rows says too little.
const LEAST_ROWS: usize = 4;
/// A part of which more rows than this share stand alone is measured again.
const MOST_ODD: f64 = 0.3;
/// A warning is due from this share of the alarm on, or at this probability of the score.
const WARNING: f64 = 0.1;
const RARE: f64 = 0.001;
/// From this log10 of the statistic beside its threshold on, something stirs.
const STIRS: f64 = -0.5;
/// Parts over which the scatter is watched.
const SCORES: usize = 20;
/// Scatter is learned anew after so many parts.
const LEARN_AFTER: [usize; 3] = [40, 80, 160];
/// An accepted change goes on being refined for so many parts.
const REFINED_FOR: usize = 30;
/// Causes that join the model at most, of one change; changes that stand in it apart from the mean profile.
const MOST_CAUSES: usize = 4;
const MOST_CHANGES: usize = 6;
/// Changes and odd parts that are told at most.
const MOST_TOLD: usize = 50;

/// The document of a process of `M`.
pub type DocumentOf<M> = Document<<M as Calculator>::Input, <M as ForwardModel>::Allowances>;
/// A part of a process of `M`.
pub type PartOf<M> = Part<<M as ForwardModel>::Run, <M as crate::calculator::Diagnosable>::Row>;

/// A process under watch. Its state is a function of the document and of the parts taken, in the order of their numbers.
pub struct Watch<M: Watched> {
    pub(super) eye: Eye<M>,
    pub(super) memory: Memory,
    pub(super) last: Option<PartOf<M>>,
}

/// All that is remembered of the parts.
pub(super) struct Memory {
    pub(super) options: Options,
    noise: Option<f64>,
    pub(super) catalogue: Catalogue,
    pub(super) scatter: Option<Scatter>,
    pub(super) columns: Vec<Column>,
    older: Older,
    /// The last parts, by ascending number, with what they tell once the scatter is known.
    pub(super) parts: VecDeque<(Sighting, Option<Gram>)>,
    /// Parts that came, and parts that were used.
    pub(super) came: usize,
    used: usize,
    learned_at: usize,
    /// Only from this number on anything can have changed that is not in the model.
    pub(super) first: u32,
    pending: Option<Pending>,
    accepted: Vec<Accepted>,
    reported: usize,
    pub(super) changes: Vec<Change>,
    odd: Vec<OddPart>,
    /// Number, distance and rows of the last parts.
    scores: VecDeque<(u32, f64, usize)>,
    /// log10 of the statistic beside its threshold, after the part before.
    evidence: f64,
}

/// A change that was reported and is not yet part of the model.
struct Pending {
    id: String,
    reported: u32,
    parts_since: usize,
}

/// A change that is part of the model.
struct Accepted {
    id: String,
    since: u32,
    /// Where anything can have changed when it was found, and the part with which it joined.
    first: u32,
    joined: u32,
    used_then: usize,
}

impl<M: Watched> Watch<M> {
    /// Before the first part. The document has no faults.
    pub fn new(document: DocumentOf<M>) -> Self {
        let memory = Memory {
            options: document.options.clone(),
            noise: document.noise_um.map(|um| um * M::per_diameter_um(&document.quantity)),
            catalogue: Catalogue::default(),
            scatter: None,
            columns: Vec::new(),
            older: Older::none(),
            parts: VecDeque::new(),
            came: 0,
            used: 0,
            learned_at: 0,
            first: 0,
            pending: None,
            accepted: Vec::new(),
            reported: 0,
            changes: Vec::new(),
            odd: Vec::new(),
            scores: VecDeque::new(),
            evidence: f64::NEG_INFINITY,
        };
        Self { eye: Eye::new(document), memory, last: None }
    }

    /// All parts, in whatever order they stand: the state after each, by ascending number.
    pub fn replay(
        document: DocumentOf<M>,
        parts: &[PartOf<M>],
        monitor: &dyn Monitor,
    ) -> Result<(Self, Vec<State>), Failure> {
        let mut sorted: Vec<&PartOf<M>> = parts.iter().collect();
        sorted.sort_by_key(|part| part.number);
        let mut watch = Self::new(document);
        let states = sorted.into_iter().map(|part| watch.take(part, monitor)).collect::<Result<_, _>>()?;
        Ok((watch, states))
    }

    /// A part more, of a higher number than all before it and without faults.
    pub fn take(&mut self, part: &PartOf<M>, monitor: &dyn Monitor) -> Result<State, Failure> {
        if self.memory.parts.back().is_some_and(|(last, _)| last.number >= part.number) {
            return Err(Failure::Internal("a part that comes before the last one".to_owned()));
        }
        let ordinal = self.memory.came;
        self.memory.came += 1;
        if used(part).len() < LEAST_ROWS {
            return Ok(self.memory.unused(part.number, Unused::TooFewRows));
        }
        let signs = self.eye.signs(part, &mut self.memory.catalogue, monitor)?;
        let (kind, value) = (self.eye.kind(part)?, self.eye.values(part));
        let residual = value.iter().zip(&signs.base).zip(&signs.predicted);
        let residual = residual.map(|((y, f), predicted)| if *predicted { y - f } else { 0.0 }).collect();
        let (keep, checks, number) = (signs.predicted.clone(), part.gauge_checks.clone(), part.number);
        let sighting = Sighting { number, ordinal, kind, signs, value, residual, keep, checks, odd: false };
        self.last = Some(part.clone());
        self.memory.take(sighting, monitor)
    }

    /// How many parts and how many onsets are in memory, and how many columns are free: bounded, however many parts came.
    pub fn size(&self) -> [usize; 3] {
        let onsets = self.memory.with_told(|memory, told| {
            let mut onsets: Vec<u32> = memory.entries(told, 0).iter().map(|entry| entry.since).collect();
            onsets.dedup();
            onsets.len()
        });
        [self.memory.parts.len(), onsets.unwrap_or(0), self.memory.columns.len()]
    }
}

impl Memory {
    fn take(&mut self, mut part: Sighting, monitor: &dyn Monitor) -> Result<State, Failure> {
        let number = part.number;
        if self.parts.iter().any(|(before, _)| before.kind == part.kind && before.value == part.value) {
            return Ok(self.unused(number, Unused::CopiedRows));
        }
        self.free_up(&part);
        let odd_rows = self.odd_rows(&part, monitor)?;
        if odd_rows.len() as f64 > MOST_ODD * part.value.len() as f64 {
            return Ok(self.unused(number, Unused::MeasureAgain));
        }
        odd_rows.iter().for_each(|&row| part.keep[row] = false);
        self.used += 1;
        self.forget();
        let score = self.score(&part);
        let gram = self.scatter.as_ref().map(|scatter| Gram::of(&part, scatter, &self.catalogue));
        self.parts.push_back((part, gram));
        if self.scatter.is_none() {
            if self.used < self.options.learning_parts as usize {
                return Ok(self.said(number, Situation::Learning, None));
            }
            self.learn_first(monitor)?;
        }
        self.keep_pace(number, score);
        self.learn_again();
        let (situation, evidence) = self.follow(number);
        self.evidence = evidence;
        let rare = score.is_some_and(|score| score.p < RARE) || self.has_scatter_grown();
        let warns = situation == Situation::InControl && (rare || evidence >= WARNING.log10());
        let situation = if warns { Situation::Warning } else { situation };
        let mut state = self.said(number, situation, Some(evidence));
        state.score = score;
        state.odd_rows = odd_rows;
        Ok(state)
    }

    /// Columns of what shows for the first time.
    fn free_up(&mut self, part: &Sighting) {
        let knows = |columns: &[Column], source: Source| columns.iter().any(|own| own.source == source);
        if !knows(&self.columns, Source::Profile { kind: part.kind, order: 0 }) {
            self.columns.extend(Column::profile(part.kind, part.signs.per_um));
        }
        for (variant, own) in self.catalogue.variants.iter().enumerate() {
            let is_free = |column: &Column| column.source == Source::Cause(variant) && column.since.is_none();
            if own.in_null && !self.columns.iter().any(is_free) {
                self.columns.push(Column { source: Source::Cause(variant), since: None, sd: 1.0 });
            }
        }
        // What came before shows nothing of a new cause.
        let basic = COSINES + self.catalogue.variants.len() + 1;
        if self.parts.iter().any(|(_, gram)| gram.as_ref().is_some_and(|gram| gram.inner.nrows() != basic)) {
            self.look_again();
        }
    }

    fn look_again(&mut self) {
        let Some(scatter) = &self.scatter else { return };
        for (part, gram) in &mut self.parts {
            *gram = Some(Gram::of(part, scatter, &self.catalogue));
        }
    }

    /// What the parts in memory that count tell.
    fn with_told<T>(&self, then: impl FnOnce(&Self, &[Told<'_>]) -> T) -> Option<T> {
        self.scatter.as_ref()?;
        let counts = self.parts.iter().filter(|(part, _)| !part.odd);
        let told: Vec<Told<'_>> =
            counts.filter_map(|(part, gram)| Some(Told::of(part, gram.as_ref()?, &self.columns))).collect();
        Some(then(self, &told))
    }

    pub(super) fn null(&self, told: &[Told<'_>]) -> Option<Null> {
        Null::of(&self.columns, &self.older, told.iter())
    }

    pub(super) fn scale(&self) -> Scale<'_> {
        let sigma = self.scatter.as_ref().map_or(0.0, |scatter| scatter.sigma);
        let thinned_weigh = self.options.threshold == Threshold::Calibrated;
        Scale { catalogue: &self.catalogue, sigma, thinned_weigh }
    }

    fn entries(&self, told: &[Told<'_>], first: u32) -> Vec<Entry> {
        self.null(told).map_or_else(Vec::new, |null| self.scale().entries(told, &null, first))
    }

    /// Everything that the outlook needs: what the parts tell, and what is free.
    pub(super) fn with_null<T>(&self, then: impl FnOnce(&[Told<'_>], &Null) -> T) -> Option<T> {
        self.with_told(|memory, told| memory.null(told).map(|null| then(told, &null))).flatten()
    }

    /// Rows that stand alone beside what was expected of the part.
    fn odd_rows(&self, part: &Sighting, monitor: &dyn Monitor) -> Result<Vec<usize>, Failure> {
        let Some(scatter) = &self.scatter else { return Ok(Vec::new()) };
        let Some(expected) = self.with_null(|_, null| {
            let mean = null.mean();
            let mut expected = vec![0.0; part.value.len()];
            for (size, column) in mean.iter().zip(null.rows_of(part)) {
                expected.iter_mut().zip(column).for_each(|(sum, x)| *sum += size * x);
            }
            expected
        }) else {
            return Ok(Vec::new());
        };
        let left: Vec<f64> = part.residual.iter().zip(expected).map(|(r, e)| r - e).collect();
        let mut rows = outliers(&part.data(), &left, Some(scatter.sigma), monitor)?.rows;
        rows.sort_unstable();
        Ok(rows)
    }

    /// Parts that are too old live on in what is known of what is free.
    fn forget(&mut self) {
        while self.parts.front().is_some_and(|(part, _)| self.came - part.ordinal > WINDOW) {
            let Some((part, gram)) = self.parts.pop_front() else { return };
            if let (false, Some(gram)) = (part.odd, &gram) {
                self.older.take(&Told::of(&part, gram, &self.columns), self.options.memory());
            }
        }
        while self.accepted.len() > MOST_CHANGES {
            self.close(&self.accepted[0].id.clone());
        }
    }

    /// A change of long ago becomes part of the mean profile: what was before it is forgotten.
    fn close(&mut self, id: &str) {
        let Some(place) = self.accepted.iter().position(|accepted| accepted.id == id) else { return };
        let gone = self.accepted.remove(place);
        self.parts.retain(|(part, _)| part.number >= gone.since);
        self.columns.retain(|column| !gone.owns(column));
        self.older = Older::none();
    }

    /// The part against what those before it let expect.
    fn score(&self, part: &Sighting) -> Option<Score> {
        let scatter = self.scatter.as_ref()?;
        let gram = Gram::of(part, scatter, &self.catalogue);
        let told = Told::of(part, &gram, &self.columns);
        let (chi2, [z_mean, z_taper, z_bow]) = self.with_null(|_, null| null.distance(&told)).flatten()?;
        let degrees = gram.rows;
        let p = ChiSquared::new(degrees as f64).map_or(1.0, |law| law.sf(chi2));
        Some(Score { chi2, degrees, p, z_mean, z_taper, z_bow })
    }

    fn keep_pace(&mut self, number: u32, score: Option<Score>) {
        self.scores.extend(score.map(|score| (number, score.chi2, score.degrees)));
        while self.scores.len() > SCORES {
            self.scores.pop_front();
        }
    }

    fn has_scatter_grown(&self) -> bool {
        let sum = |(sum, all), (_, chi2, own): &(u32, f64, usize)| (sum + chi2, all + own);
        let (chi2, degrees) = self.scores.iter().fold((0.0, 0), sum);
        let by_chance = ChiSquared::new(degrees as f64).map_or(1.0, |law| law.sf(chi2));
        self.scores.len() == SCORES && by_chance < RARE
    }

    fn learn_first(&mut self, monitor: &dyn Monitor) -> Result<(), Failure> {
        let parts: Vec<Sighting> = self.parts.iter().map(|(part, _)| part.clone()).collect();
        let first = Scatter::first(&parts, self.noise);
        for (part, _) in &mut self.parts {
            let rows = outliers(&part.data(), &part.residual, Some(first.sigma), monitor)?.rows;
            if rows.len() as f64 <= MOST_ODD * part.value.len() as f64 {
                rows.iter().for_each(|&row| part.keep[row] = false);
            }
        }
        self.scatter = Some(first);
        self.learn();
        Ok(())
    }

    fn learn(&mut self) {
        self.look_again();
        let counts = self.parts.iter().filter(|(part, _)| !part.odd).map(|(part, _)| part.clone());
        let parts: Vec<Sighting> = counts.collect();
        let learned = self.with_null(|_, null| {
            let scatter = self.scatter.as_ref();
            scatter.map(|scatter| scatter.learned(&parts, null, self.noise))
        });
        if let Some(learned) = learned.flatten() {
            self.scatter = Some(learned);
            self.learned_at = self.used;
            self.look_again();
        }
    }

    /// Once more while nothing stirs: what changes would pass for scatter.
    fn learn_again(&mut self) {
        let due = LEARN_AFTER.iter().any(|&after| after <= self.used && after > self.learned_at);
        if due && self.pending.is_none() && self.evidence < STIRS {
            self.learn();
        }
    }

    /// What the parts say with this one: odd parts go out, an alarm is followed until its change joins the model.
    fn follow(&mut self, number: u32) -> (Situation, f64) {
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
                        self.pending = None;
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
    fn weighed(&self) -> Option<(Vec<Entry>, f64, Option<u32>)> {
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
        self.odd.push(OddPart { number, reason: reason.flatten().unwrap_or("blank_or_clamping") });
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
    fn accept(&mut self, number: u32, judgement: &Judgement) {
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
        if let Some(change) = self.changes.iter_mut().find(|change| change.id == accepted.id) {
            *change = report::change(&accepted.id, change.reported_at_part, true, &judgement, &self.catalogue);
        }
    }

    fn unused(&self, number: u32, why: Unused) -> State {
        let situation = match (&self.scatter, &self.pending) {
            (None, _) => Situation::Learning,
            (_, Some(_)) => Situation::Changed,
            _ => Situation::InControl,
        };
        State { unused: Some(why), ..self.said(number, situation, None) }
    }

    fn said(&self, number: u32, state: Situation, evidence: Option<f64>) -> State {
        let scatter = self.scatter.as_ref().map(|scatter| ScatterReport {
            sigma: scatter.sigma,
            correlation: scatter.rho,
            allowance_factors: scatter.factors.clone(),
        });
        let change = self.changes.last().filter(|_| state == Situation::Changed).cloned();
        let said = State {
            number,
            state,
            unused: None,
            score: None,
            evidence: evidence.filter(|evidence| evidence.is_finite()),
            scatter,
            change,
            changes: self.changes.clone(),
            odd_parts: self.odd.clone(),
            odd_rows: Vec::new(),
            explanation: Vec::new(),
        };
        State { explanation: report::explanation(&said, &self.options), ..said }
    }
}

impl Accepted {
    fn owns(&self, column: &Column) -> bool {
        column.since.is_some_and(|(since, _)| since == self.since)
    }
}
