//! Many processes over one PostgreSQL: real processes, real HTTP, a real database of their own that these tests start,
//! stop and break.
//!
//! Each test prints its counts (`cargo test --test cluster -- --nocapture`). `PRECUT_RELIABILITY=N` makes the chaos N
//! times as long. Without an installed PostgreSQL the tests say so and pass; where nothing may be left out (CI=true)
//! they fail.

#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout, clippy::float_cmp, missing_docs, unreachable_pub)]

#[path = "../support/mod.rs"]
#[allow(dead_code)] // these tests start processes only
mod support;

#[path = "../support/isolation.rs"]
mod isolation;

#[path = "../reliability/dice.rs"]
mod dice;

#[path = "../reliability/small_disk.rs"]
mod small_disk;

#[path = "../support/certificates.rs"]
mod certificates;

#[path = "../support/receiver.rs"]
#[allow(dead_code)] // not all of it is used here
mod receiver;

#[path = "../support/stream.rs"]
mod stream;

mod across;
mod backup;
mod chaos;
mod clocks;
mod database;
mod full;
mod owners;
mod process;
mod processes;
mod start;
mod studies;
mod tls;
mod webhooks;
