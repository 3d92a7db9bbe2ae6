//! Numerics with no machining words in them.
