//! Programs as G-code.

use precut_calc::calculator::Program;

/// A program in its dialect's words, `header` as comments before it.
pub fn gcode(program: &Program, header: &[String]) -> String {
    let _ = (program, header);
    String::new()
}
