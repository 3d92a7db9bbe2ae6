//! Precut: what to know before the cut. The service around the pure compute core `precut_calc`.
//!
//! Layers, each of which knows only those before it: [`registry`] (calculators by name), [`text`] (codes
//! into sentences), [`store`] (kept results), [`engine`] (bytes into answers).

pub mod engine;
pub mod registry;
pub mod store;
pub mod text;
