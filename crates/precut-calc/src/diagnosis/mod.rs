//! Diagnosis: what a simulation gets wrong, which named causes explain it, and what these data cannot tell.
//!
//! A base model with its catalogue of effects is a [`Subject`]; rows are [`Data`]. The statistics in
//! between know no machining. Each folder knows those before it alone:
//!
//! - `rows`: rows, their copies and blunders, and what they say of their own scatter (`diagnosis/3.1`, `diagnosis/8`);
//! - `statistics`: scatter and allowances as one covariance, what a set of columns explains, alone or beside a remainder without
//!   a name; values that scatter about a prediction, and classes on either side of it (`diagnosis/3.2`, `diagnosis/3.4`,
//!   `diagnosis/3.5`, `diagnosis/3.11`);
//! - `causes`: what each hypothesis does to the rows, about 0 and where it comes nearest to them; sets of them, refined about
//!   the model itself, other values that fit nearly as well, intervals where a likelihood is not quadratic (`diagnosis/3.4`,
//!   `diagnosis/3.6`);
//! - `verdict`: posterior weights, tests and the verdict, and what cannot be told apart (`diagnosis/3.3`, `diagnosis/3.5` to
//!   `diagnosis/3.7`);
//! - `model`: the model that is left behind, an average where no set is settled, with a term of its own where something has no
//!   name; what it is worth, on data held back and in what is decided with it, and which run would tell more
//!   (`diagnosis/3.6`, `diagnosis/3.8`, `diagnosis/3.9`);
//! - `answer`: all of it in the words of the contract, with rows that were written down wrongly as rivals of physics
//!   (`diagnosis/8`).

mod answer;
mod base;
mod calculator;
mod causes;
mod input;
mod model;
mod rows;
mod statistics;
mod verdict;

pub(crate) use base::put;
pub(crate) use calculator::layout;
pub(crate) use causes::signatures::Signatures;
pub(crate) use rows::basis::cosine;
pub(crate) use rows::copies::digits_written;
pub(crate) use rows::outlier::outliers;
pub(crate) use rows::sparse::Sparse;
pub(crate) use statistics::discrepancy::spread_of_cosines;
pub(crate) use statistics::evidence::log_sum_exp;
pub(crate) use statistics::whiten::Whitener;

pub use crate::effects::{JointUncertainty, ParameterMove};
pub use answer::blunder::BlunderReport;
pub use answer::classes::{ClassHeldOut, ClassReport};
pub use answer::output::*;
pub use answer::trial::{best_evidence, residuals_with, separation_from, separations_of};
pub use base::Bound;
pub use calculator::{Diagnosis, JobOf, ResultOf};
pub use causes::optima::Peak;
pub use causes::profile::Profile;
pub use causes::ranking::SetWeight;
pub use causes::subject::{Setting, Subject};
pub use input::{DiagnosisJob, DiagnosisOptions, MAX_RUNS, PriorWeight};
pub use model::downstream::{DecisionReport, DownstreamReport, GoodPartsReport, ProbablyGood};
pub use model::extension::ExtensionKind;
pub use model::gain::{Gain, gain};
pub use model::known::Known;
pub(crate) use model::known::moves_between;
pub use model::next::NextMeasurement;
pub use model::outlying::OutlyingRun;
pub use rows::data::{Data, Layout};
pub use rows::noise::{Noise, NoiseSource};
pub use rows::outlier::Outliers;
pub use rows::suspect::{SuspectedFactor, suspected_factor, suspected_offset, swapped_columns};
pub use verdict::adequacy::{Test, TestKind, adequacy};
pub use verdict::effort::Effort;
pub use verdict::foundation::Foundation;
pub use verdict::identify::{COLLINEAR_ABOVE, CONFOUNDED_BELOW, Separation, Signature, separations, twins};
pub use verdict::judge::Verdict;
pub use verdict::remainder::{RemainderShape, remainder_shape};
pub use verdict::weigh::Weighing;
