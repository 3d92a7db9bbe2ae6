//! The contract of the calculators: fields, kept answers, jobs at the ends of ranges, and jobs that are refused.

#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

mod fields;
mod hostile_jobs;
mod invalid_feed_jobs;
mod invalid_jobs;
