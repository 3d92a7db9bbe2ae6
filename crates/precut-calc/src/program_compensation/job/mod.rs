//! The job: a program with how its control reads it.

mod check;
mod input;

pub use crate::calculator::Dialect;
pub(super) use check::CODES;
pub use input::{
    CorrectTo, DecimalPoint, Job, KeepOut, Mode, ModeKind, ProgramFeed, ProgramInclude, ProgramStart, ProgramStock,
    ProgramTool, ProgramUnits, Reading, Refeed, StockRow, SupportLines, WordsOfX,
};
