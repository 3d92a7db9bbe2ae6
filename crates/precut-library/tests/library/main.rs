//! The library's data, codes and resolver against published cases and properties.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

mod codes;
mod data;
mod faults;
mod resolution;
mod search;
mod sources;

use serde_json::Value;

/// A file of cases.
fn cases(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

/// Whether two numbers agree to a relative tolerance.
fn near(a: f64, b: f64, relative: f64) -> bool {
    (a - b).abs() <= relative * b.abs().max(1e-300)
}
