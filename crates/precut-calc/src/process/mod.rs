//! A process under watch: parts come one after another, each measured; after each, is the process still as its model says,
//! and if not, what changed, since which part, and what to do for the next.
//!
//! A part is one run of a diagnosis: prediction, catalogue, scatter and allowances are those of [`crate::diagnosis`]. What is
//! added is time:
//!
//! - `part`: what a process and a part are, every fault of them, and what an edge has cut (`document`, `check`, `edges`); what a part
//!   shows of each cause, linearised about the model (`sight`, `process/3.1`);
//! - `change`: what is free although nothing changed (`null`, `process/3.1`); every cause since every part as one hypothesis, by
//!   running sums (`sums`, `onsets`, `process/3.2`); when to say that something changed, and which parts are odd by themselves
//!   (`detector`, `process/3.3`); how far readings and parts scatter, learned from the parts themselves (`scatter`, `process/3.4`); which
//!   cause, since when, how large (`verdict`, `report`, `process/3.5`);
//! - `history`: all of it, part by part (`watch`); what is remembered of the parts, of a change from its alarm on, and what a
//!   person says of it (`memory`, `follow`, `decide`); what it is kept as, so that it goes on from its last parts (`snapshot`); what
//!   paths brought (`account`, `process/6`);
//! - `answer`: what is said after each part (`output`), the next part (`outlook`, `action`, `measure`, `next`, `process/4`,
//!   `process/5`), and the model for later jobs (`stored`).
//!
//! The state is a function of the document and of the parts in the order of their numbers, and of nothing else. It holds no
//! more than the last parts, as many as onsets are looked for in; older ones live on in the sums of `null`.

mod answer;
mod change;
mod history;
mod part;

pub use answer::action::ACTION_CODES;
pub use answer::next::Next;
pub use answer::output::*;
pub use answer::stored::StoredModel;
pub use change::report::EXPLANATION_CODES;
pub use history::account::{Gain, OnPath, PartGain};
pub use history::decide::Decision;
pub use history::snapshot::Snapshot;
pub use history::watch::Watch;
pub use part::check::{CODES as FAULT_CODES, faults};
pub use part::document::{Document, DocumentOf, GaugeCheck, MOST_PARTS, Options, Part, PartOf, PartType, Threshold};
pub use part::sight::GAUGE_SIZE;
