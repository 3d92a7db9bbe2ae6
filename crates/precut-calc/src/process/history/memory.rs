//! All that is remembered of the parts of a process, and how one more is taken.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::calculator::{Failure, Monitor};
use crate::diagnosis::{digits_written, outliers};
use crate::process::answer::output::{Change, OddPart, ScatterReport, Score, Situation, State, Unused};
use crate::process::change::null::{Column, Gram, Null, Older, Source, Told};
use crate::process::change::onsets::{Entry, Scale, WINDOW};
use crate::process::change::report;
use crate::process::change::scatter::Scatter;
use crate::process::history::follow::{Accepted, Pending};
use crate::process::part::document::{Options, Threshold};
use crate::process::part::sight::{COSINES, Catalogue, Sighting};

/// A part of which more rows than this share stand alone is measured again.
const MOST_ODD: f64 = 0.3;
/// A warning is due from this share of the alarm on, or at this probability of the score.
const WARNING: f64 = 0.1;
const RARE: f64 = 0.001;
/// From this log10 of the statistic beside its threshold on, something stirs.
const STIRS: f64 = -0.5;
/// Rows that agree with those of an earlier part with less than this probability were copied.
const BY_CHANCE: f64 = 1e-9;
/// Rows that lie so far from what was expected of them are no chance, and no cause of the catalogue makes another unit of them.
const NEVER: f64 = 1e-9;
/// Factors that a wrong unit, a wrong sign, or a radius for a diameter leaves, and how near the fitted one has to be.
const UNITS: [f64; 7] = [1000.0, 1e-3, 25.4, 1.0 / 25.4, 2.0, 0.5, -1.0];
const NEAR: f64 = 0.12;
/// Parts over which the scatter is watched.
const SCORES: usize = 20;
/// Scatter is learned anew after so many parts.
const LEARN_AFTER: [usize; 3] = [40, 80, 160];
/// Accepted changes that stand apart from the mean profile.
const MOST_CHANGES: usize = 6;

/// All that is remembered of the parts.
#[derive(Clone, Serialize, Deserialize)]
pub(in crate::process) struct Memory {
    pub(in crate::process) options: Options,
    pub(in crate::process) noise: Option<f64>,
    pub(in crate::process) catalogue: Catalogue,
    pub(in crate::process) scatter: Option<Scatter>,
    pub(in crate::process) columns: Vec<Column>,
    pub(in crate::process) older: Older,
    /// The last parts, by ascending number, with what they tell once the scatter is known.
    #[serde(skip)]
    pub(in crate::process) parts: VecDeque<(Sighting, Option<Gram>)>,
    /// Parts that came, and parts that were used.
    pub(in crate::process) came: usize,
    pub(in crate::process) used: usize,
    pub(in crate::process) learned_at: usize,
    /// Only from this number on anything can have changed that is not in the model.
    pub(in crate::process) first: u32,
    pub(in crate::process) pending: Option<Pending>,
    pub(in crate::process) accepted: Vec<Accepted>,
    /// How many changes ever joined the model.
    pub(in crate::process) joined: usize,
    pub(in crate::process) reported: usize,
    pub(in crate::process) changes: Vec<Change>,
    pub(in crate::process) odd: Vec<OddPart>,
    /// Number, distance and rows of the last parts.
    pub(in crate::process) scores: VecDeque<(u32, f64, usize)>,
    /// log10 of the statistic beside its threshold, after the part before; none where nothing speaks of a change.
    pub(in crate::process) evidence: Option<f64>,
}

/// A part beside what those before it let expect.
#[derive(Default)]
struct Compared {
    /// Rows that stand alone.
    odd_rows: Vec<usize>,
    /// Nothing while the scatter is not known.
    score: Option<Score>,
    gram: Option<Gram>,
}

impl Memory {
    /// Before the first part; `noise` is stated, in the unit of the quantity.
    pub(in crate::process) fn new(options: Options, noise: Option<f64>) -> Self {
        Self {
            options,
            noise,
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
            joined: 0,
            reported: 0,
            changes: Vec::new(),
            odd: Vec::new(),
            scores: VecDeque::new(),
            evidence: None,
        }
    }

    pub(in crate::process) fn take(&mut self, mut part: Sighting, monitor: &dyn Monitor) -> Result<State, Failure> {
        let number = part.number;
        self.free_up(&part);
        let Compared { odd_rows, score, gram } = self.compared(&mut part, monitor)?;
        if odd_rows.len() as f64 > MOST_ODD * part.value.len() as f64 {
            return Ok(self.unused(number, Unused::MeasureAgain));
        }
        self.used += 1;
        self.forget();
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
        self.evidence = Some(evidence).filter(|evidence| evidence.is_finite());
        let rare = score.is_some_and(|score| score.p < RARE) || self.has_scatter_grown();
        let warns = situation == Situation::InControl && (rare || evidence >= WARNING.log10());
        let situation = if warns { Situation::Warning } else { situation };
        let mut state = self.said(number, situation, Some(evidence));
        state.score = score;
        state.odd_rows = odd_rows;
        Ok(state)
    }

    /// Whether an earlier part has the same rows to the last digit, and scatter would not let that happen.
    pub(in crate::process) fn is_copy(&self, part: &Sighting) -> bool {
        let Some(scatter) = &self.scatter else { return false };
        // Two normal numbers fall on the same digit d with d/(2 sigma sqrt(pi)).
        let width = 2.0 * scatter.sigma * std::f64::consts::PI.sqrt();
        let chance: f64 = digits_written(&part.value).iter().map(|digit| (digit / width).min(1.0)).product();
        let is_same = |before: &Sighting| before.kind == part.kind && before.value == part.value;
        chance < BY_CHANCE && self.parts.iter().any(|(before, _)| is_same(before))
    }

    /// The factor that a wrong unit leaves, and the one fitted, where the rows lie far from what was expected and, divided by either,
    /// do not.
    pub(in crate::process) fn unit_suspected(&self, part: &Sighting) -> Option<[f64; 2]> {
        let scatter = self.scatter.as_ref()?;
        // Causes that no part has shown yet are in no column of what is known.
        if part.signs.causes.iter().any(|(variant, _)| !self.knows(*variant)) {
            return None;
        }
        let chance = |factor: f64| {
            let residual = part.value.iter().zip(&part.signs.base).map(|(y, f)| y / factor - f).collect();
            let divided = Sighting { residual, checks: Vec::new(), ..part.clone() };
            let gram = Gram::of(&divided, scatter, &self.catalogue);
            let told = Told::of(&divided, &gram, &self.columns);
            let (chi2, _) = self.with_null(|_, null| null.distance(&told)).flatten()?;
            ChiSquared::new(gram.rows as f64).ok().map(|law| law.sf(chi2))
        };
        // Of parts that are expected to be straight every change, divided by enough, is as expected.
        if chance(1.0)? > NEVER || chance(f64::INFINITY)? > NEVER {
            return None;
        }
        let expected = self.with_null(|_, null| null.expected_rows(part))?;
        let (along, square) =
            part.value.iter().zip(&expected).fold((0.0, 0.0), |sum, (y, f)| (sum.0 + y * f, sum.1 + f * f));
        let fitted = along / square;
        let fits = |factor: f64| {
            let is_near = (fitted / factor - 1.0).abs() < NEAR;
            let tried = if is_near { [factor, fitted] } else { [factor; 2] };
            tried.into_iter().filter_map(chance).any(|p| p > RARE)
        };
        UNITS.into_iter().find(|factor| fits(*factor)).map(|factor| [factor, fitted])
    }

    /// Whether all parts in memory were looked at for a variant.
    fn knows(&self, variant: usize) -> bool {
        self.parts.iter().all(|(_, gram)| gram.as_ref().is_none_or(|gram| COSINES + variant < gram.residual()))
    }

    /// Columns of what shows for the first time.
    fn free_up(&mut self, part: &Sighting) {
        let before = self.columns.len();
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
        if self.columns.len() > before {
            self.free_again();
        }
        // What came before shows nothing of a new cause.
        let basic = COSINES + self.catalogue.variants.len() + 1;
        if self.parts.iter().any(|(_, gram)| gram.as_ref().is_some_and(|gram| gram.inner.nrows() != basic)) {
            self.look_again();
        }
    }

    /// Other columns are free than before.
    pub(in crate::process) fn free_again(&mut self) {
        self.parts.iter_mut().filter_map(|(_, gram)| gram.as_mut()).for_each(Gram::forget_free);
    }

    pub(in crate::process) fn look_again(&mut self) {
        let Some(scatter) = &self.scatter else { return };
        for (part, gram) in &mut self.parts {
            *gram = Some(Gram::of(part, scatter, &self.catalogue));
        }
    }

    /// What the parts in memory that count tell.
    pub(in crate::process) fn with_told<T>(&self, then: impl FnOnce(&Self, &[Told<'_>]) -> T) -> Option<T> {
        self.scatter.as_ref()?;
        let counts = self.parts.iter().filter(|(part, _)| !part.odd);
        let told: Vec<Told<'_>> =
            counts.filter_map(|(part, gram)| Some(Told::of(part, gram.as_ref()?, &self.columns))).collect();
        Some(then(self, &told))
    }

    pub(in crate::process) fn null(&self, told: &[Told<'_>]) -> Option<Null> {
        Null::of(&self.columns, &self.older, told.iter())
    }

    pub(in crate::process) fn scale(&self) -> Scale<'_> {
        let sigma = self.scatter.as_ref().map_or(0.0, |scatter| scatter.sigma);
        let thinned_weigh = self.options.threshold == Threshold::Calibrated;
        Scale { catalogue: &self.catalogue, sigma, thinned_weigh }
    }

    pub(in crate::process) fn entries(&self, told: &[Told<'_>], first: u32) -> Vec<Entry> {
        self.null(told).map_or_else(Vec::new, |null| self.scale().entries(told, &null, first))
    }

    /// Everything that the outlook needs: what the parts tell, and what is free.
    pub(in crate::process) fn with_null<T>(&self, then: impl FnOnce(&[Told<'_>], &Null) -> T) -> Option<T> {
        self.with_told(|memory, told| memory.null(told).map(|null| then(told, &null))).flatten()
    }

    /// A part beside what those before it let expect; its rows that stand alone count no more.
    fn compared(&self, part: &mut Sighting, monitor: &dyn Monitor) -> Result<Compared, Failure> {
        let Some(scatter) = &self.scatter else { return Ok(Compared::default()) };
        let compared = self.with_null(|_, null| {
            let left: Vec<f64> = part.value.iter().zip(null.expected_rows(part)).map(|(y, e)| y - e).collect();
            let mut odd_rows = outliers(&part.data(), &left, Some(scatter.sigma), monitor)?.rows;
            odd_rows.sort_unstable();
            for &row in &odd_rows {
                part.keep[row] = false;
            }
            let gram = Gram::of(part, scatter, &self.catalogue);
            let score = self.score(part, &gram, null);
            Ok(Compared { odd_rows, score, gram: Some(gram) })
        });
        compared.unwrap_or_else(|| Ok(Compared::default()))
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

    /// The part against what those before it let expect.
    fn score(&self, part: &Sighting, gram: &Gram, null: &Null) -> Option<Score> {
        let (chi2, [z_mean, z_taper, z_bow]) = null.distance(&Told::of(part, gram, &self.columns))?;
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

    pub(in crate::process) fn learn_first(&mut self, monitor: &dyn Monitor) -> Result<(), Failure> {
        let parts: Vec<Sighting> = self.parts.iter().map(|(part, _)| part.clone()).collect();
        let first = Scatter::first(&parts, self.noise);
        for (part, _) in &mut self.parts {
            let rows = outliers(&part.data(), &part.residual, Some(first.sigma), monitor)?.rows;
            if rows.len() as f64 <= MOST_ODD * part.value.len() as f64 {
                for row in rows {
                    part.keep[row] = false;
                }
            }
        }
        self.scatter = Some(first);
        self.learn();
        Ok(())
    }

    pub(in crate::process) fn learn(&mut self) {
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
    pub(in crate::process) fn learn_again(&mut self) {
        let due = LEARN_AFTER.iter().any(|&after| after <= self.used && after > self.learned_at);
        if due && self.pending.is_none() && self.evidence.is_none_or(|evidence| evidence < STIRS) {
            self.learn();
        }
    }

    pub(in crate::process) fn unused(&self, number: u32, why: Unused) -> State {
        let situation = match (&self.scatter, &self.pending) {
            (None, _) => Situation::Learning,
            (_, Some(_)) => Situation::Changed,
            _ => Situation::InControl,
        };
        State { unused: Some(why), ..self.said(number, situation, None) }
    }

    pub(in crate::process) fn said(&self, number: u32, state: Situation, evidence: Option<f64>) -> State {
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
