//! The model: the program that is read, and what it does to the work, be it rigid or not.

pub(super) mod correction;
pub(super) mod reader;
pub(super) mod refeed;
pub(super) mod stock;
pub(super) mod yielding;
