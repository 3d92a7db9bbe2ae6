//! Ring roundness: how round will a ring get that is turned while it rests on the surface being turned?

mod lobing;
mod stance;
mod turning;
