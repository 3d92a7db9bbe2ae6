//! Diagnosis: what a simulation gets wrong, which named causes explain it, and what these data cannot tell.
//!
//! A base model with its catalogue of effects is a [`Subject`]; rows are [`Data`]. The statistics in
//! between know no machining:
//!
//! - `outlier`, `noise`: what the rows say about their own scatter (`diagnosis/3.1`);
//! - `whiten`: scatter and allowances as one covariance (`diagnosis/3.2`);
//! - `likelihood`, `class_likelihood`, `link`: values that scatter about a prediction, classes on either side of it
//!   (`diagnosis/3.11`);
//! - `signatures`, `survey`: what each hypothesis does to the rows, about 0 and where it comes nearest to them;
//! - `evidence`, `discrepancy`, `search`, `refine`: how well each set of causes, alone or with an unnamed
//!   smooth remainder, explains the rows (`diagnosis/3.4`, `diagnosis/3.5`);
//! - `optima`: other values that the rows fit nearly as well (`diagnosis/3.4`);
//! - `weigh`: posterior weights and the verdict (`diagnosis/3.5`, `diagnosis/3.7`);
//! - `profile`: intervals where a likelihood is not quadratic (`diagnosis/3.6`);
//! - `blunder`: rows that were written down wrongly, weighed against physics (`diagnosis/8`);
//! - `extension`, `term`: the model that is left behind, an average where no set is settled, with a term of its own where
//!   something has no name (`diagnosis/3.8`);
//! - `gain`, `downstream`: what the extended model is worth, on data held back and in what is decided with it
//!   (`diagnosis/3.8`, `diagnosis/3.9`);
//! - `trial`: what is asked where the truth is known.

mod adequacy;
mod base;
mod basis;
mod blocks;
mod blunder;
mod calculator;
mod class_likelihood;
mod classes;
mod copies;
mod data;
mod descent;
mod discrepancy;
mod downstream;
mod evidence;
mod extension;
mod fairness;
mod foundation;
mod gain;
mod identify;
mod input;
mod known;
mod likelihood;
mod link;
mod next;
mod noise;
mod optima;
mod outlier;
mod outlying;
mod output;
mod picture;
mod profile;
mod ranking;
mod refine;
mod refuse;
mod remainder;
mod report;
mod said;
mod search;
mod signatures;
mod sparse;
mod subject;
mod survey;
mod suspect;
mod term;
mod trial;
mod view;
mod weigh;
mod whiten;

pub(crate) use base::put;
pub(crate) use basis::cosine;
pub(crate) use calculator::layout;
pub(crate) use copies::digits_written;
pub(crate) use discrepancy::spread_of_cosines;
pub(crate) use evidence::log_sum_exp;
pub(crate) use outlier::outliers;
pub(crate) use signatures::Signatures;
pub(crate) use sparse::Sparse;
pub(crate) use whiten::Whitener;

pub use adequacy::{Test, TestKind, adequacy};
pub use base::Bound;
pub use blunder::BlunderReport;
pub use calculator::{Diagnosis, JobOf, ResultOf};
pub use classes::{ClassHeldOut, ClassReport};
pub use data::{Data, Layout};
pub use extension::ExtensionKind;
pub use foundation::Foundation;
pub use gain::{Gain, gain};
pub use identify::{COLLINEAR_ABOVE, CONFOUNDED_BELOW, Separation, Signature, separations, twins};
pub use input::{DiagnosisJob, DiagnosisOptions, MAX_RUNS, PriorWeight};
pub(crate) use known::moves_between;
pub use known::{JointUncertainty, Known, ParameterMove};
pub use next::NextMeasurement;
pub use noise::{Noise, NoiseSource};
pub use optima::Peak;
pub use outlier::Outliers;
pub use outlying::OutlyingRun;
pub use output::*;
pub use profile::Profile;
pub use remainder::{RemainderShape, remainder_shape};
pub use subject::{Setting, Subject};
pub use suspect::{SuspectedFactor, suspected_factor, suspected_offset, swapped_columns};
pub use trial::{best_evidence, residuals_with, separation_from, separations_of};
pub use weigh::{Effort, SetWeight, Verdict, Weighing};
