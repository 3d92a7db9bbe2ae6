//! Numerics with no machining words in them.

pub mod beam;
pub mod dde;
pub mod quadrature;
