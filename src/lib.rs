//! Precut.
