//! The answer, in the words of the contract.

mod band;
pub(super) mod blunder;
pub(super) mod classes;
pub(super) mod output;
pub(super) mod picture;
pub(super) mod refuse;
pub(super) mod report;
pub(super) mod said;
pub(super) mod trial;
pub(super) mod view;
