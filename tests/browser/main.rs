//! The workbench in a real browser, against the whole service: what a process engineer does with it.
//!
//! `PRECUT_WRITE_SCREENSHOTS=1 cargo test --test browser the_documentation_shows` draws the pictures of
//! `docs/workbench.md` anew. Without Chromium the tests say so and pass; with `CI=true` they fail.

#![allow(clippy::unwrap_used, clippy::panic, clippy::needless_pass_by_value, missing_docs, unreachable_pub)]

mod access;
mod answers;
mod assets;
mod calm;
mod chromium;
mod diagnosis;
mod drag;
mod instruments;
mod jobs;
mod keys;
mod matrix;
mod offers;
mod processes;
mod programs;
mod records;
mod rooms;
mod screenshots;
mod service;
mod shell;
mod sizes;
mod studies;
mod tables;
mod words;

#[path = "../support/stream.rs"]
mod stream;

use std::sync::{LazyLock, Mutex, MutexGuard, PoisonError};

use chromium::Page;
use service::Service;

/// One browser at a time: a second one only makes both slow.
static TURN: Mutex<()> = Mutex::new(());

/// A browser and a service; `None` where there is no browser.
fn both() -> Option<(MutexGuard<'static, ()>, Page, Service)> {
    let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    let page = Page::new()?;
    Some((turn, page, Service::start()))
}

/// A browser and the one service of all tests that only look at pages: what one has asked for is there for the next.
fn looking() -> Option<(MutexGuard<'static, ()>, Page, &'static Service)> {
    static SERVICE: LazyLock<Service> = LazyLock::new(Service::start);
    let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    let page = Page::new()?;
    Some((turn, page, &SERVICE))
}

/// The picture is there and nothing is on its way.
const SETTLED: &str = "document.querySelector('.picture svg.chart') && \
    document.querySelector('.result-pane')?.getAttribute('aria-busy') === 'false'";
/// Whatever the main picture draws.
const DRAWN: &str =
    "[...document.querySelectorAll('.picture svg.chart path')].map(path => path.getAttribute('d')).join('')";
