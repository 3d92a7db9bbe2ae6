//! Answers as text for other programs and for eyes: CSV, programs for machines, pictures.
//!
//! Pure functions from the plain data of [`precut_calc::calculator`] to text: equal input gives equal
//! bytes, and nothing here knows of HTTP. Words come from the caller, who knows the language.

mod csv;
mod gcode;
mod number;
mod svg;

pub use self::csv::csv;
pub use self::gcode::gcode;
pub use self::svg::{Wording, svg, unit_symbol};
