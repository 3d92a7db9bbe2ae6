//! Precut: what to know before the cut. The service around the pure compute core `precut_calc`.
//!
//! Layers, each of which knows only those before it: [`units`] and [`key`] (units by name, the address of an answer),
//! [`registry`] (calculators by name), [`text`] (codes into sentences), [`render`] (answers into CSV, G-code, SVG),
//! [`store`] (kept results, and which of them [`config`] asks for), [`engine`] (bytes into answers), [`http`] (the
//! service) and [`cli`] (the command line).

pub mod cli;
pub mod config;
pub mod engine;
pub mod http;
pub mod key;
mod log;
mod outward;
pub mod registry;
pub mod render;
pub mod store;
pub mod text;
mod trace;
pub mod units;
