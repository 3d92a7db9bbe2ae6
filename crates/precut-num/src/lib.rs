//! Numerics with no machining words in them.

pub mod beam;
pub mod cylinder;
pub mod dde;
pub mod dense;
pub mod evolve;
pub mod formula;
pub mod gmres;
pub mod gp;
pub mod hull;
pub mod lsq;
pub mod quadrature;
pub mod roots;
pub mod roundness;
pub mod socp;
pub mod stats;
pub mod table;
