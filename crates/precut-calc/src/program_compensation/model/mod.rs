//! The model: the program that is read, and what it does to the work.

pub(super) mod reader;
pub(super) mod stock;
