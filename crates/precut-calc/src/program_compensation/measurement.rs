//! A measured row of a part that the program made.

use super::ProgramCompensation;
use crate::deflection_compensation::measured_diameters;

measured_diameters! {
    /// A diameter or a radius of a part that the program made, at a station from its headstock end. Nominal is what the program of the
    /// job means: its contour on work that does not yield, or the drawing where it is corrected to that.
    ProgramMeasurement, ProgramCompensation
}
