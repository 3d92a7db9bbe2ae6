//! Precut.

pub mod render;
