//! The job: a program with how its control reads it.

mod check;
mod input;
mod mode;
mod reading;

pub use crate::calculator::Dialect;
pub(super) use check::CODES;
pub use input::{Job, KeepOut, ProgramInclude, ProgramStock, ProgramTool, StockRow, SupportLines};
pub use mode::{CorrectTo, Mode, ModeKind, Refeed};
pub use reading::{DecimalPoint, ProgramFeed, ProgramStart, ProgramUnits, Reading, WordsOfX};
