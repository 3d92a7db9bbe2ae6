//! What is said of a program.

use crate::calculator::{Finding, Message};

use super::super::job::ProgramStock;
use super::super::model::correction::{Corrected, LeftAlone, WhyLeftAlone};
use super::super::model::stock::{Doubt, Turned, implausible_mm};
use super::super::model::yielding::Yielded;
use super::output::{CompensatedProgram, Outcome};

/// Rapid moves that are told.
const MOST_RAPIDS: usize = 100;
/// Lines that one warning names.
const MOST_LINES: usize = 20;

/// What may be wrong with a program on its blank.
pub(crate) const WARNING_CODES: &[&str] = &[
    "rapid_in_stock",
    "nothing_cut",
    "cut_implausible",
    "force_law_turned",
    "program_unsafe",
    "undersize_before",
    "left_alone",
];

/// What an answer may explain.
pub(crate) const EXPLANATION_CODES: &[&str] = &[
    "program_read",
    "cycles_expanded",
    "stretches_passed",
    "surface_left",
    "error_along_contour",
    "program_corrected",
    "jumps_left_thick",
    "nothing_to_correct",
];

pub(crate) fn explanation(outcome: &Outcome) -> Vec<Message> {
    let mut said = vec![
        Message::new("program_read")
            .with("lines", outcome.lines)
            .with("feed_moves", outcome.feed_moves)
            .with("rapid_moves", outcome.rapid_moves)
            .with("feed_length_mm", outcome.feed_length_mm)
            .with("tools", outcome.tools.len()),
    ];
    if !outcome.cycles.is_empty() {
        said.push(Message::new("cycles_expanded").with("cycles", outcome.cycles.len()));
    }
    if outcome.passed_moves > 0 {
        said.push(Message::new("stretches_passed").with("moves", outcome.passed_moves));
    }
    if let Some(surface) = &outcome.surface {
        said.push(Message::new("surface_left").with("lines", surface.finishing_lines.len()));
    }
    if let Some(yielding) = &outcome.yielding
        && let Some((smallest, largest)) = yielding.smallest_error_um.zip(yielding.largest_error_um)
    {
        said.push(
            Message::new("error_along_contour").with("smallest_error_um", smallest).with("largest_error_um", largest),
        );
    }
    // What was asked for comes first.
    if let Some(compensation) = &outcome.compensation {
        said.splice(0..0, of_compensation(outcome.lines, compensation));
    }
    said
}

fn of_compensation(lines: usize, compensation: &CompensatedProgram) -> Vec<Message> {
    let Some(proof) = &compensation.proof else { return vec![Message::new("nothing_to_correct")] };
    let largest = |low: f64, high: f64| high.max(-low);
    let corrected = Message::new("program_corrected")
        .with("changed", compensation.lines_changed.len())
        .with("lines", lines)
        .with("before_um", largest(proof.smallest_error_before_um, proof.largest_error_before_um))
        .with("after_um", largest(proof.smallest_error_after_um, proof.largest_error_after_um));
    let thickest = compensation.transitions.iter().map(|one| one.leaves_um).reduce(f64::max);
    let thick = thickest.map(|leaves_um| {
        Message::new("jumps_left_thick").with("stretches", compensation.transitions.len()).with("leaves_um", leaves_um)
    });
    [Some(corrected), thick].into_iter().flatten().collect()
}

/// What is to be known of a corrected program: surfaces that come out too small, and lines that stay though they finish.
pub(crate) fn of_corrected(corrected: &Corrected) -> Vec<Finding> {
    let undersize = corrected.undersize.iter().take(MOST_LINES).map(|one| {
        Finding::new("undersize_before", "/nc_program")
            .measured(-one.error_um, 0.0, "um")
            .with("line", one.line)
            .with("z_mm", one.z_mm)
    });
    // That faces keep their place, and what is less than a step, needs no warning.
    let is_told = |left: &&LeftAlone| !matches!(left.why, WhyLeftAlone::Face | WhyLeftAlone::BelowResolution);
    let lines: Vec<usize> =
        corrected.left_alone.iter().filter(is_told).map(|left| left.line).take(MOST_LINES).collect();
    let left = (!lines.is_empty()).then(|| Finding::new("left_alone", "/nc_program").with("lines", lines));
    undersize.chain(left).collect()
}

/// Lines that cut in another direction than the force law was measured in.
pub(crate) fn turned_law(yielded: &Yielded) -> Option<Finding> {
    let lines: Vec<usize> = yielded.turned_lines.iter().copied().take(MOST_LINES).collect();
    (!lines.is_empty()).then(|| Finding::new("force_law_turned", "/force").with("lines", lines))
}

/// Rapid moves through stock, and a blank that does not go with the program; `fits` is a program zero that would.
pub(crate) fn warnings(
    turned: &Turned,
    doubt: Option<Doubt>,
    (stock, zero, fits): (&ProgramStock, f64, Option<f64>),
) -> Vec<Finding> {
    let rapid = turned.in_stock.iter().take(MOST_RAPIDS).map(|one| {
        Finding::new("rapid_in_stock", "/nc_program").measured(one.depth_mm, 0.0, "mm").with("line", one.line)
    });
    let and_fits = |finding: Finding| match fits {
        Some(fits) => finding.with("fits_z_mm", fits),
        None => finding,
    };
    let doubt = doubt.map(|doubt| match doubt {
        Doubt::NothingCut => and_fits(Finding::new("nothing_cut", "/program_zero_z_mm").value(zero, "mm")),
        Doubt::TooDeep(cut) => and_fits(
            Finding::new("cut_implausible", "/program_zero_z_mm")
                .measured(cut.depth_mm, implausible_mm(stock), "mm")
                .with("line", cut.line),
        ),
    });
    doubt.into_iter().chain(rapid).collect()
}
