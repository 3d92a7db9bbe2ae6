//! Precut: what to know before the cut. The service around the pure compute core `precut_calc`.
//!
//! Layers, each of which knows only those before it: [`registry`] (calculators by name), [`text`] (codes
//! into sentences), [`render`] (answers into CSV, G-code, SVG), [`store`] (kept results), [`engine`] (bytes
//! into answers), [`http`] (the service) and [`cli`] (the command line), both run by [`config`].

pub mod cli;
pub mod config;
pub mod engine;
pub mod http;
mod log;
pub mod registry;
pub mod render;
pub mod store;
pub mod text;
pub mod units;
