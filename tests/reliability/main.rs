//! What the service survives, seen from outside: real processes, real HTTP, real faults.
//!
//! Each test prints its counts (`cargo test --test reliability -- --nocapture`). `PRECUT_RELIABILITY=N` makes them N
//! times as long as in the ordinary run; docs/operations.md has the commands. No test waits for a time to pass: each
//! polls for what shall come, with a patience that a busy machine does not exhaust.

#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout, clippy::float_cmp, missing_docs, unreachable_pub)]

#[path = "../support/mod.rs"]
#[allow(dead_code)] // these tests start processes only
mod support;

#[path = "../support/receiver.rs"]
#[allow(dead_code)] // not all of it is used here
mod receiver;

#[path = "../support/stream.rs"]
mod stream;

mod clients;
mod damage;
mod dice;
mod disk;
mod killed;
mod locked;
mod memory;
mod process;
mod small_disk;
mod streams;
mod watch;
mod webhooks;
