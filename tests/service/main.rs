//! The service over real HTTP: one file per subject.

#![allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, missing_docs, unreachable_pub)]

#[path = "../support/mod.rs"]
mod support;

#[path = "../support/isolation.rs"]
mod isolation;

#[path = "../support/certificates.rs"]
mod certificates;

#[path = "../support/receiver.rs"]
mod receiver;

#[path = "../support/stream.rs"]
mod stream;

mod attack;
mod bad_input;
mod cases;
mod command_line;
mod contract;
mod events;
mod jobs;
mod language;
mod library;
mod limits;
mod milling;
mod models;
mod negotiation;
mod owners;
mod paper;
mod process;
mod processes;
mod quotas;
mod results;
mod roundness;
mod standing;
mod studies;
mod traces;
mod turning_programs;
mod watched;
mod webhooks;
