//! A process under watch: parts come one after another, each measured; after each, is the process still as its model says,
//! and if not, what changed, since which part, and what to do for the next.
//!
//! A part is one run of a diagnosis: prediction, catalogue, scatter and allowances are those of [`crate::diagnosis`]. What is
//! added is time:
//!
//! - `document`, `check`, `edges`: what a process and a part are, every fault of them, and what an edge has cut;
//! - `sight`: what a part shows of each cause, linearised about the model (`process/3.1`);
//! - `scatter`: how far readings and parts scatter, learned from the parts themselves (`process/3.4`);
//! - `null`: what is free although nothing changed, and what parts tell of it (`process/3.1`);
//! - `sums`, `onsets`: every cause since every part as one hypothesis, by running sums (`process/3.2`);
//! - `detector`: when to say that something changed; parts that are odd by themselves (`process/3.3`);
//! - `verdict`: which cause, since when, how large (`process/3.5`);
//! - `outlook`, `action`, `measure`, `next`: the next part (`process/4`, `process/5`); `stored`: the model for later jobs;
//! - `account`: what paths brought (`process/6`);
//! - `memory`, `follow`, `decide`: what is remembered of the parts, of a change from its alarm on, and what a person says of it;
//! - `snapshot`: what a process is kept as, so that it goes on from its last parts;
//! - `watch`: all of it, part by part; `state`, `report`: what is said after each.
//!
//! The state is a function of the document and of the parts in the order of their numbers, and of nothing else. It holds no
//! more than the last parts, as many as onsets are looked for in; older ones live on in the sums of `null`.

mod account;
mod action;
mod check;
mod decide;
mod detector;
mod document;
mod edges;
mod follow;
mod measure;
mod memory;
mod next;
mod null;
mod onsets;
mod outlook;
mod report;
mod scatter;
mod sight;
mod snapshot;
mod state;
mod stored;
mod sums;
mod verdict;
mod watch;

pub use account::{Gain, OnPath, PartGain};
pub use action::ACTION_CODES;
pub use check::{CODES as FAULT_CODES, faults};
pub use decide::Decision;
pub use document::{Document, GaugeCheck, MOST_PARTS, Options, Part, PartType, Threshold};
pub use next::Next;
pub use report::EXPLANATION_CODES;
pub use sight::GAUGE_SIZE;
pub use snapshot::Snapshot;
pub use state::*;
pub use stored::StoredModel;
pub use watch::{DocumentOf, PartOf, Watch};
