//! A process, part by part.

use crate::calculator::{Failure, Finding, Monitor, Watched};
use crate::process::answer::output::{State, Unused};
use crate::process::history::account::Account;
use crate::process::history::memory::Memory;
use crate::process::part::document::{DocumentOf, PartOf};
use crate::process::part::edges::{self, Edge};
use crate::process::part::sight::{Eye, Sighting, used};

/// A part with fewer rows says too little.
const LEAST_ROWS: usize = 4;

/// A process under watch. Its state is a function of the document and of the parts taken, in the order of their numbers.
pub struct Watch<M: Watched> {
    pub(in crate::process) eye: Eye<M>,
    pub(in crate::process) memory: Memory,
    pub(in crate::process) last: Option<PartOf<M>>,
    pub(in crate::process) account: Account<M>,
    pub(in crate::process) edge: Option<Edge>,
}

impl<M: Watched> Watch<M> {
    /// Before the first part. The document has no faults.
    pub fn new(document: DocumentOf<M>) -> Self {
        let noise = document.noise_um.map(|um| um * M::per_diameter_um(&document.quantity));
        let memory = Memory::new(document.options.clone(), noise);
        let account = Account::new(&document);
        Self { eye: Eye::new(document), memory, last: None, account, edge: None }
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
        let part = &edges::completed::<M>(&self.eye.document, part, &mut self.edge);
        if used(part).len() < LEAST_ROWS {
            return Ok(self.memory.unused(part.number, Unused::TooFewRows));
        }
        let sighting = self.seen(part, ordinal, monitor)?;
        if !part.confirmed {
            if self.memory.is_copy(&sighting) {
                return Ok(self.memory.unused(part.number, Unused::CopiedRows));
            }
            if self.memory.unit_suspected(&sighting).is_some() {
                return Ok(self.memory.unused(part.number, Unused::UnitSuspected));
            }
        }
        self.last = Some(part.clone());
        let state = self.memory.take(sighting, monitor)?;
        self.book(part, &state, monitor)?;
        Ok(state)
    }

    /// What is to be said before a part is taken: that its rows are those before times a factor, as a wrong unit leaves.
    pub fn doubts(&mut self, part: &PartOf<M>, monitor: &dyn Monitor) -> Result<Vec<Finding>, Failure> {
        let mut edge = self.edge;
        let part = &edges::completed::<M>(&self.eye.document, part, &mut edge);
        if part.confirmed || used(part).len() < LEAST_ROWS {
            return Ok(Vec::new());
        }
        let sighting = self.seen(part, self.memory.came, monitor)?;
        let suspected = self.memory.unit_suspected(&sighting);
        let finding = suspected.map(|[factor, fitted]| {
            Finding::new("unit_suspected", "/measurements").with("factor", factor).with("fitted", fitted)
        });
        Ok(finding.into_iter().collect())
    }

    pub(in crate::process) fn seen(
        &mut self,
        part: &PartOf<M>,
        ordinal: usize,
        monitor: &dyn Monitor,
    ) -> Result<Sighting, Failure> {
        let signs = self.eye.signs(part, &mut self.memory.catalogue, monitor)?;
        let (kind, value) = (self.eye.kind(part)?, self.eye.values(part));
        let residual = value.iter().zip(&signs.base).zip(&signs.predicted);
        let residual = residual.map(|((y, f), predicted)| if *predicted { y - f } else { 0.0 }).collect();
        let (keep, checks, number) = (signs.predicted.clone(), part.gauge_checks.clone(), part.number);
        let path_m = M::path_m(&part.conditions);
        Ok(Sighting { number, ordinal, kind, signs, value, residual, keep, checks, path_m, odd: false })
    }

    /// The same once more: what comes to one of them does not come to the other.
    #[must_use]
    pub fn copy(&self) -> Self {
        Self {
            eye: self.eye.copy(),
            memory: self.memory.clone(),
            last: self.last.clone(),
            account: self.account.copy(),
            edge: self.edge,
        }
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
