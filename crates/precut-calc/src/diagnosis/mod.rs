//! Diagnosis: what a simulation gets wrong, which named causes explain it, and what these data cannot tell.
//!
//! A base model with its catalogue of effects is a [`Subject`]; rows are [`Data`]. The statistics in
//! between know no machining:
//!
//! - `outlier`, `noise`: what the rows say about their own scatter (`diagnosis/3.1`);
//! - `whiten`: scatter and allowances as one covariance (`diagnosis/3.2`);
//! - `evidence`, `discrepancy`, `search`, `refine`: how well each set of causes, alone or with an unnamed
//!   smooth remainder, explains the rows (`diagnosis/3.4`, `diagnosis/3.5`);
//! - `weigh`: posterior weights and the verdict (`diagnosis/3.5`, `diagnosis/3.7`).

mod base;
mod basis;
mod data;
mod discrepancy;
mod evidence;
mod noise;
mod outlier;
mod refine;
mod search;
mod subject;
mod weigh;
mod whiten;

pub use base::Bound;
pub use data::{Data, Layout};
pub use noise::{Noise, NoiseSource};
pub use outlier::{Outliers, outliers};
pub use subject::{Setting, Subject};
pub use weigh::{Diagnosed, SetWeight, Settings, Verdict, diagnose};
