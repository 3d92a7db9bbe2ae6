//! Answers for other programs and for eyes: CSV, workbooks, programs for machines, pictures, reports on paper.
//!
//! Pure functions from the plain data of [`precut_calc::calculator`] to bytes: equal input gives equal
//! bytes, and nothing here knows of HTTP. Words come from the caller, who knows the language.

mod csv;
mod gcode;
mod number;
mod pdf;
mod report;
mod svg;
mod xlsx;

pub use self::csv::csv;
pub(crate) use self::csv::{csv_lines, defused};
pub use self::gcode::gcode;
pub use self::pdf::{PdfError, pdf};
pub use self::report::{Counted, Counts, Datum, Equation, Field, Headings, Picture, Report, Sheet};
pub use self::svg::{Wording, described, palette, svg, unit_symbol};
pub use self::xlsx::{MOST_CELLS, XlsxFault, xlsx};
