//! What is said of a program.

use std::collections::BTreeSet;

use crate::calculator::{Finding, Message};
use crate::diameters;

use super::super::job::{CorrectTo, Job, ProgramStock};
use super::super::model::correction::{Corrected, LeftAlone, WhyLeftAlone};
use super::super::model::reader::{Kind, Nose, Program};
use super::super::model::stock::{Doubt, FINISHES_MM, Stroke, Turned, Way, implausible_mm, strokes};
use super::super::model::yielding::{CLOSE_MM, CutMove, FARTHEST_MM, PlaceOfMove, Yielded};
use super::compensated::CompensatedProgram;
use super::output::Outcome;
use super::refed::RefedProgram;
use crate::force::{ForceModel, Reached, ReachedCut};

/// Rapid moves that are told.
const MOST_RAPIDS: usize = 100;
/// A thinner chip is none, and a nose that stands off by less is not told, mm.
const CHIP_MM: f64 = 1e-3;
const NOSE_MM: f64 = 5e-4;
/// Feeds differ by a larger share.
const SAME_FEED: f64 = 1e-9;
/// A finishing line that goes more across than this comes off the work or on to it, and means no surface, 1.
const ALONG: f64 = 0.4;
/// A surface that stands lower than it is meant by less is not told, mm.
const LOW_MM: f64 = 1e-3;
/// Lines that one warning names.
const MOST_LINES: usize = 20;

/// What may be wrong with a program on its blank.
pub(crate) const WARNING_CODES: &[&str] = &[
    "rapid_in_stock",
    "hits_support",
    "pushed_off_over_depth",
    "no_cut",
    "plunge_at_feed_in_air",
    "nose_error_on_taper",
    "nothing_cut",
    "cut_implausible",
    "force_law_turned",
    "program_unsafe",
    "undersize_before",
    "left_alone",
    "rapid_close",
    "gouge",
    "edge_too_short",
    "far_from_drawing",
    "blank_below_contour",
];

/// What an answer may explain.
pub(crate) const EXPLANATION_CODES: &[&str] = &[
    "program_read",
    "cycles_expanded",
    "stretches_passed",
    "surface_left",
    "program_off_drawing",
    "program_brought_to_drawing",
    "error_along_contour",
    "error_against_drawing",
    "program_corrected",
    "program_refed",
    "refeed_price",
    "jumps_left_thick",
    "nothing_to_correct",
];

pub(crate) fn explanation(outcome: &Outcome, correct_to: CorrectTo) -> Vec<Message> {
    let is_to_drawing = correct_to == CorrectTo::Drawing;
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
    if let Some(drawing) = &outcome.drawing
        && let Some(largest) = drawing.program_error_um.iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs()))
    {
        let code = if is_to_drawing { "program_brought_to_drawing" } else { "program_off_drawing" };
        said.push(Message::new(code).with("largest_um", largest));
    }
    if let Some(yielding) = &outcome.yielding
        && let Some((smallest, largest)) = yielding.smallest_error_um.zip(yielding.largest_error_um)
    {
        let code = if is_to_drawing { "error_against_drawing" } else { "error_along_contour" };
        said.push(Message::new(code).with("smallest_error_um", smallest).with("largest_error_um", largest));
    }
    said.extend(outcome.conformance.iter().flat_map(diameters::said));
    // What was asked for comes first.
    if let Some(compensation) = &outcome.compensation {
        said.splice(0..0, of_compensation(outcome, compensation));
    }
    if let Some(refeed) = &outcome.refeed {
        said.splice(0..0, of_refeed(refeed));
    }
    said
}

/// The feeds, and what would buy more.
fn of_refeed(refeed: &RefedProgram) -> Vec<Message> {
    let feeds = refeed.feeds.old_feed_mm_per_rev.iter().zip(&refeed.feeds.new_feed_mm_per_rev);
    let changed = feeds.filter(|(old, new)| (*old - *new).abs() > SAME_FEED * *old).count();
    let refed = Message::new("program_refed")
        .with("changed", changed)
        .with("lines", refeed.feeds.line.len())
        .with("before_min", refeed.cutting_time_before_min)
        .with("after_min", refeed.cutting_time_after_min);
    let price = refeed.prices.first().map(|price| {
        Message::new("refeed_price").with("limit", price.constraint.clone()).with("gain_percent", price.gain_percent)
    });
    [Some(refed), price].into_iter().flatten().collect()
}

fn of_compensation(outcome: &Outcome, compensation: &CompensatedProgram) -> Vec<Message> {
    let Some(proof) = &compensation.proof else {
        let nothing = outcome.refeed.is_none().then(|| Message::new("nothing_to_correct"));
        return nothing.into_iter().collect();
    };
    let largest = |low: f64, high: f64| high.max(-low);
    let corrected = Message::new("program_corrected")
        .with("changed", compensation.lines_changed.len())
        .with("lines", outcome.lines)
        .with("before_um", largest(proof.smallest_error_before_um, proof.largest_error_before_um))
        .with("after_um", largest(proof.smallest_error_after_um, proof.largest_error_after_um));
    let corrected = if outcome.refeed.is_some() { corrected.with("refed", 1.0) } else { corrected };
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

/// Lines that finish farther off the drawing than the work is corrected to it.
pub(crate) fn far_from_drawing(outcome: &Outcome, correct_to: CorrectTo) -> Option<Finding> {
    let drawing = outcome.drawing.as_ref().filter(|_| correct_to == CorrectTo::Drawing)?;
    let off = drawing.line.iter().zip(&drawing.program_error_um);
    let far = |(&line, off_um): (&usize, &f64)| (off_um.abs() > 2e3 * FARTHEST_MM).then_some(line);
    let lines: BTreeSet<usize> = off.filter_map(far).collect();
    let lines: Vec<usize> = lines.into_iter().take(MOST_LINES).collect();
    let finding = Finding::new("far_from_drawing", "/drawing").with("limit_mm", 2.0 * FARTHEST_MM);
    (!lines.is_empty()).then(|| finding.with("lines", lines))
}

/// Lines that cut in another direction than the force law was measured in.
pub(crate) fn turned_law(yielded: &Yielded) -> Option<Finding> {
    let lines: Vec<usize> = yielded.turned_lines.iter().copied().take(MOST_LINES).collect();
    (!lines.is_empty()).then(|| Finding::new("force_law_turned", "/force").with("lines", lines))
}

/// Where cuts leave the range in which the force law was measured.
pub(crate) fn beyond_law(yielded: &Yielded, force: &ForceModel) -> Vec<Finding> {
    let reached = |values: fn(&CutMove) -> [f64; 2]| {
        let all = yielded.cuts.iter().flat_map(values);
        let (least, largest) =
            all.fold((f64::INFINITY, 0.0), |(low, high): (f64, f64), value| (low.min(value), high.max(value)));
        Reached { pointer: "/nc_program", least, largest }
    };
    if yielded.cuts.is_empty() {
        return Vec::new();
    }
    let cut = ReachedCut {
        depth_mm: reached(|cut| [cut.depth_mm; 2]),
        feed_mm_per_rev: reached(|cut| cut.feeds_mm_per_rev),
        speed_m_per_min: reached(|cut| cut.speeds_m_per_min),
    };
    // The nose is that of each tool, and not that of the law.
    let mut found = force.extrapolations(&cut);
    found.retain(|finding| finding.code == "extrapolated_force_model");
    found
}

/// Rapid moves that come close to the work as it yields, but for those that go through it, of which more is said.
pub(crate) fn close_rapids(yielded: &Yielded, turned: &Turned) -> Vec<Finding> {
    let goes_through = |line: usize| turned.in_stock.iter().any(|one| one.line == line);
    let close = yielded.close.iter().filter(|one| !goes_through(one.line)).take(MOST_RAPIDS);
    let told = close.map(|one| {
        Finding::new("rapid_close", "/nc_program").measured(one.gap_mm.max(0.0), CLOSE_MM, "mm").with("line", one.line)
    });
    told.collect()
}

/// Where the blank is thinner than a finishing line would leave it, so that nothing is cut: each stretch with its line.
pub(crate) fn blank_below(
    program: &Program,
    job: &Job,
    zero: f64,
    turned: &Turned,
    finishing: &[usize],
) -> Vec<Finding> {
    let is_along = |way: &Way| {
        let [from, to] = way.ends();
        (to[1] - from[1]).abs() <= ALONG * (to[0] - from[0]).abs()
    };
    let mut found: Vec<([f64; 2], f64, usize)> = Vec::new();
    let blanks: Vec<_> = turned.parts.iter().filter(|(_, owner)| owner.is_none()).map(|(blank, _)| blank).collect();
    for stroke in strokes(program, job, zero).filter(|stroke| stroke.one.kind.is_feed()) {
        let line = stroke.one.line;
        let Some(meant) = stroke.shape.line(&stroke.way).filter(|_| is_along(&stroke.way)) else { continue };
        if finishing.binary_search(&line).is_err() {
            continue;
        }
        for blank in &blanks {
            let ends = [blank.x0.max(meant.x0), blank.x1.min(meant.x1)];
            let low_mm = ends.map(|x| meant.curve.at(x) - blank.curve.at(x)).into_iter().fold(f64::INFINITY, f64::min);
            if ends[1] - ends[0] > FINISHES_MM && low_mm > LOW_MM {
                found.push((ends, low_mm, line));
            }
        }
    }
    let told = found.iter().take(MOST_LINES).map(|([from, to], low_mm, line)| {
        Finding::new("blank_below_contour", "/stock/profile")
            .measured(1e3 * low_mm, 0.0, "um")
            .with("line", *line)
            .with("from_mm", *from)
            .with("to_mm", *to)
    });
    told.collect()
}

/// Finishing lines whose cut is pushed off by more than it is deep, which no shift mends for good.
pub(crate) fn off_by_more_than_deep(yielded: &Yielded, finishing: &[usize]) -> Option<Finding> {
    let is_finishing = |line: usize| finishing.binary_search(&line).is_ok();
    let is_off =
        |of: &&PlaceOfMove| of.place.nominal_depth_mm > CHIP_MM && of.place.lift_mm > of.place.nominal_depth_mm;
    let lines: BTreeSet<usize> =
        yielded.places.iter().filter(|of| is_finishing(of.line)).filter(is_off).map(|of| of.line).collect();
    let lines: Vec<usize> = lines.into_iter().take(MOST_LINES).collect();
    (!lines.is_empty()).then(|| Finding::new("pushed_off_over_depth", "/nc_program").with("lines", lines))
}

/// Lines that find nothing to cut, and long ways at the feed through the air.
pub(crate) fn of_nothing_cut(yielded: &Yielded) -> Vec<Finding> {
    let lines: Vec<usize> = yielded.missed_lines.iter().copied().take(MOST_LINES).collect();
    let missed = (!lines.is_empty()).then(|| Finding::new("no_cut", "/nc_program").with("lines", lines));
    let in_air = yielded.in_air.iter().take(MOST_LINES).map(|one| {
        let finding = Finding::new("plunge_at_feed_in_air", "/nc_program")
            .measured(one.length_mm, 0.0, "mm")
            .with("line", one.line);
        match one.time_min {
            Some(time_min) => finding.with("time_s", 60.0 * time_min),
            None => finding,
        }
    });
    missed.into_iter().chain(in_air).collect()
}

/// Finishing lines on which the nose leaves more or less than the program says, because it runs without compensation along a
/// taper: by the imaginary tip the surface stands off by r (cos a + sin a - 1), normal to it.
pub(crate) fn nose_on_taper(program: &Program, job: &Job, zero: f64, finishing: &[usize]) -> Option<Finding> {
    let off_mm = |stroke: &Stroke<'_>| {
        let [from, to] = stroke.way.ends();
        let is_taper = stroke.one.kind == Kind::Line && (from[0] - to[0]).abs() > 0.0 && (from[1] - to[1]).abs() > 0.0;
        // The tip of the tool leads along the axis where it cuts toward the headstock, or as a left-hand tool away from it.
        let leads = match stroke.tool.tip_direction {
            3 => -1.0,
            4 => 1.0,
            _ => return None,
        };
        let angle = ((to[1] - from[1]) / (to[0] - from[0]) * leads).atan();
        (is_taper && stroke.one.nose == Nose::Off)
            .then(|| stroke.shape.nose * (angle.cos() + angle.sin() - 1.0))
            .filter(|off| off.abs() > NOSE_MM)
    };
    let is_finishing = |stroke: &Stroke<'_>| finishing.binary_search(&stroke.one.line).is_ok();
    let found: Vec<(usize, f64)> = strokes(program, job, zero)
        .filter(|stroke| is_finishing(stroke))
        .filter_map(|stroke| Some((stroke.one.line, off_mm(&stroke)?)))
        .collect();
    let worst = found.iter().map(|(_, off)| *off).max_by(|a, b| a.abs().total_cmp(&b.abs()))?;
    let lines: BTreeSet<usize> = found.iter().map(|(line, _)| *line).collect();
    let lines: Vec<usize> = lines.into_iter().take(MOST_LINES).collect();
    Some(Finding::new("nose_error_on_taper", "/nc_program").measured(1e3 * worst, 0.0, "um").with("lines", lines))
}

/// Rapid moves through stock, moves where no tool may come, and a blank that does not go with the program; `fits` is a program zero that would.
pub(crate) fn warnings(
    turned: &Turned,
    doubt: Option<Doubt>,
    (stock, zero, fits): (&ProgramStock, f64, Option<f64>),
) -> Vec<Finding> {
    let rapid = turned.in_stock.iter().take(MOST_RAPIDS).map(|one| {
        Finding::new("rapid_in_stock", "/nc_program").measured(one.depth_mm, 0.0, "mm").with("line", one.line)
    });
    let hits = turned.hits.iter().take(MOST_RAPIDS).map(|one| {
        Finding::new("hits_support", format!("/keep_out/{}", one.place))
            .measured(one.depth_mm, 0.0, "mm")
            .with("line", one.line)
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
    let gouges = turned.gouges.iter().take(MOST_LINES).map(|(line, [falls_deg, edge_deg])| {
        Finding::new("gouge", "/nc_program").measured(*falls_deg, *edge_deg, "deg").with("line", *line)
    });
    let short = turned.beyond_edge.iter().take(MOST_LINES).map(|(line, [beyond_mm, length_mm])| {
        Finding::new("edge_too_short", "/nc_program").measured(*beyond_mm, *length_mm, "mm").with("line", *line)
    });
    doubt.into_iter().chain(rapid).chain(hits).chain(gouges).chain(short).collect()
}
