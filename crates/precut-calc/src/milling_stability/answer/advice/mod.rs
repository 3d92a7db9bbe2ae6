//! What is to be said of an answer, as codes with numbers.

mod explanation;
mod warnings;

use explanation::rounded_up;
pub(in crate::milling_stability) use explanation::{EXPLANATION_CODES, explanation};
pub(in crate::milling_stability) use warnings::{WARNING_CODES, warnings};
