//! What a process is kept as, so that it goes on from its last parts and not from its first (`process/3.6`).
//!
//! Kept is what is remembered of all parts. What the last parts show follows from the document and from their measurements, which
//! are on record: they are looked at again.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use serde::{Deserialize, Serialize};

use crate::calculator::{Failure, Monitor, Watched};
use crate::process::history::account::{Cut, Totals};
use crate::process::history::memory::Memory;
use crate::process::history::watch::Watch;
use crate::process::part::document::{DocumentOf, PartOf};
use crate::process::part::edges::Edge;
use crate::process::part::sight::Sighting;

/// A process after some of its parts, without what follows from its document and its last parts.
#[derive(Clone, Serialize, Deserialize)]
pub struct Snapshot {
    /// Rises where a process remembers something else, or judges otherwise by it.
    version: u32,
    /// Version of the calculator by which the parts were judged.
    calculator: u32,
    memory: Memory,
    /// The parts in memory, and those whose account is open.
    parts: Vec<Seen>,
    open: Vec<Seen>,
    /// The part that was looked at last.
    last: Option<Known>,
    edge: Option<Edge>,
    closed: Totals,
}

/// Which version this program writes and reads.
const VERSION: u32 = 2;

/// A part on record, with what its edge had cut before it.
#[derive(Clone, Copy, Serialize, Deserialize)]
struct Known {
    number: u32,
    path_m: Option<f64>,
}

/// A part that was looked at.
#[derive(Clone, Serialize, Deserialize)]
struct Seen {
    #[serde(flatten)]
    part: Known,
    ordinal: usize,
    /// Rows that do not count although the model says what they should be.
    left_out: Vec<usize>,
    odd: bool,
}

impl Known {
    /// The part as it was completed, of those on record.
    fn part<M: Watched>(&self, on_record: &BTreeMap<u32, &PartOf<M>>) -> Result<PartOf<M>, Failure> {
        let Some(part) = on_record.get(&self.number) else {
            return Err(Failure::Internal(format!("part {} of a kept process is not on record", self.number)));
        };
        let part = PartOf::<M>::clone(part);
        Ok(PartOf::<M> { conditions: M::at_path_m(&part.conditions, self.path_m), ..part })
    }
}

impl Seen {
    fn of(sighting: &Sighting) -> Self {
        let rows = sighting.keep.iter().zip(&sighting.signs.predicted).enumerate();
        let left_out = rows.filter(|(_, (keep, predicted))| **predicted && !**keep).map(|(row, _)| row).collect();
        let part = Known { number: sighting.number, path_m: sighting.path_m };
        Self { part, ordinal: sighting.ordinal, left_out, odd: sighting.odd }
    }

    /// The same part again, as it was looked at.
    fn again(&self, mut sighting: Sighting) -> Sighting {
        for &row in &self.left_out {
            if let Some(keep) = sighting.keep.get_mut(row) {
                *keep = false;
            }
        }
        sighting.odd = self.odd;
        sighting
    }
}

impl Snapshot {
    /// Number of the first part that is needed to go on from here.
    pub fn first_part(&self) -> Option<u32> {
        let seen = self.parts.iter().chain(&self.open).map(|seen| seen.part.number);
        seen.chain(self.last.map(|last| last.number)).min()
    }
}

impl<M: Watched> Watch<M> {
    /// The process as it is kept.
    pub fn snapshot(&self) -> Snapshot {
        Snapshot {
            version: VERSION,
            calculator: M::META.version,
            memory: self.memory.clone(),
            parts: self.memory.parts.iter().map(|(sighting, _)| Seen::of(sighting)).collect(),
            open: self.account.open.iter().map(|cut| Seen::of(&cut.sighting)).collect(),
            last: self.last.as_ref().map(|part| Known { number: part.number, path_m: M::path_m(&part.conditions) }),
            edge: self.edge,
            closed: self.account.closed.clone(),
        }
    }

    /// The process as it was when it was kept: the same from then on, to the last digit. `parts` are those on record since
    /// [`Snapshot::first_part`].
    pub fn from_snapshot(
        document: DocumentOf<M>,
        snapshot: Snapshot,
        parts: &[PartOf<M>],
        monitor: &dyn Monitor,
    ) -> Result<Self, Failure> {
        if (snapshot.version, snapshot.calculator) != (VERSION, M::META.version) {
            return Err(Failure::Internal("a process kept by another version".to_owned()));
        }
        let on_record: BTreeMap<u32, &PartOf<M>> = parts.iter().map(|part| (part.number, part)).collect();
        let mut watch = Self::new(document);
        watch.memory = snapshot.memory;
        let mut looked = BTreeMap::new();
        for seen in snapshot.parts.iter().chain(&snapshot.open) {
            if let Entry::Vacant(place) = looked.entry(seen.part.number) {
                let part = seen.part.part::<M>(&on_record)?;
                let sighting = watch.seen(&part, seen.ordinal, monitor)?;
                place.insert((part, sighting));
            }
        }
        let again = |seen: &Seen| {
            let (part, sighting) = &looked[&seen.part.number];
            (part.clone(), seen.again(sighting.clone()))
        };
        watch.memory.parts = snapshot.parts.iter().map(|seen| (again(seen).1, None)).collect();
        watch.memory.look_again();
        let open = snapshot.open.iter().map(again);
        watch.account.open = open.map(|(part, sighting)| Cut { part, sighting }).collect();
        watch.account.closed = snapshot.closed;
        watch.last = snapshot.last.map(|last| last.part::<M>(&on_record)).transpose()?;
        watch.edge = snapshot.edge;
        Ok(watch)
    }
}
