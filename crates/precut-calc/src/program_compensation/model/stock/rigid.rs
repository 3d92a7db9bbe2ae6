//! A program driven over a blank that does not yield.

use std::collections::BTreeMap;

use crate::calculator::{Failure, Finding, Monitor, Pace};

use super::super::super::job::{Job, KeepOut, ProgramStock, ProgramTool, StockRow};
use super::super::reader::{Kind, Nose, Program, ProgramMove};
use super::chain::{CONTACT_MM, Chain, step_owner};
use super::curve::{Curve, Piece};
use super::edges::EdgeEnds;
use super::nose::{self, Compensated, Programmed};
use super::sweep::{Shape, Way};

/// Why a program is not driven over its blank.
pub(crate) const FAILURE_CODES: &[&str] = &["tool_missing", "nose_compensation_not_driven"];

/// Lines that own so much of the surface finish, mm.
pub(crate) const FINISHES_MM: f64 = 0.3;
/// What stands above the end of an edge by less is not told, mm.
const BEYOND_EDGE_MM: f64 = 0.01;
/// An edge this steep is a wall.
const WALL_DEG: f64 = 90.0;
/// Multiplications of a move, and of it against a part of the outline, about.
const WORK_OF_MOVE: usize = 500;
const WORK_OF_PART: usize = 50;

/// What a program leaves.
#[derive(Debug, Clone)]
pub(crate) struct Turned {
    /// The parts of the outline: ends along the part, radius over the part, and the line that made it.
    pub(crate) parts: Vec<(Piece, Option<usize>)>,
    /// Length of the surface by the line that made it, mm.
    pub(crate) owned: BTreeMap<usize, f64>,
    /// The first rapid move through stock of each line.
    pub(crate) in_stock: Vec<InStock>,
    /// The first move of each line into a place where no tool may come.
    pub(crate) hits: Vec<Hit>,
    /// Lines on which the trailing edge cuts into what the tip has left: how steep the way falls there, and that edge, deg.
    pub(crate) gouges: BTreeMap<usize, [f64; 2]>,
    /// Lines whose cut goes on beyond the end of the edge: by how much the stock stands above that at the most, and the length
    /// of the edge, mm.
    pub(crate) beyond_edge: BTreeMap<usize, [f64; 2]>,
    /// Whether anything is cut.
    pub(crate) cuts: bool,
    /// The first cut along the axis: across it a cut may well be as deep as the work is thick.
    pub(crate) first_cut: Option<Cut>,
}

/// A rapid move through stock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct InStock {
    pub(crate) line: usize,
    pub(crate) depth_mm: f64,
}

/// A move into a place where no tool may come.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Hit {
    pub(crate) line: usize,
    /// Which of the places, from 0.
    pub(crate) place: usize,
    pub(crate) depth_mm: f64,
}

/// A cut: its line and its depth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Cut {
    pub(crate) line: usize,
    pub(crate) depth_mm: f64,
}

/// What speaks against a program and a blank that belong together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Doubt {
    /// No move at the feed cuts.
    NothingCut,
    /// The first cut goes deeper than half the radius.
    TooDeep(Cut),
}

/// Whether a program and its blank belong together.
pub(crate) fn doubt(turned: &Turned, stock: &ProgramStock) -> Option<Doubt> {
    match turned.first_cut {
        _ if !turned.cuts => Some(Doubt::NothingCut),
        Some(cut) if cut.depth_mm > implausible_mm(stock) => Some(Doubt::TooDeep(cut)),
        _ => None,
    }
}

/// Half the radius of the blank: no first cut is deeper.
pub(crate) fn implausible_mm(stock: &ProgramStock) -> f64 {
    0.25 * stock.profile.iter().map(|row| row.diameter_mm).fold(0.0, f64::max)
}

/// A place of program zero, at either end of the blank, with which the program cuts as programs do.
pub(crate) fn zero_that_fits(
    program: &Program,
    job: &Job,
    stock: &ProgramStock,
    monitor: &dyn Monitor,
) -> Result<Option<f64>, Failure> {
    for end in [stock.profile.last(), stock.profile.first()].into_iter().flatten() {
        let tried = turned(program, job, (stock, end.z_mm), monitor)?;
        if tried.in_stock.is_empty() && doubt(&tried, stock).is_none() {
            return Ok(Some(end.z_mm));
        }
    }
    Ok(None)
}

/// Lines that own enough of the surface to be said to finish it: alone, or with others as short before and behind them, as the
/// blocks of a contour that a CAM system wrote.
pub(crate) fn lines_that_finish(turned: &Turned) -> Vec<usize> {
    let owned: Vec<(usize, f64)> = turned.owned.iter().map(|(&line, &length)| (line, length)).collect();
    let is_short = |length: f64| length < FINISHES_MM;
    let runs =
        owned.chunk_by(|(line, length), (next, of_next)| line + 1 == *next && is_short(*length) && is_short(*of_next));
    let finishing = runs.filter(|run| run.iter().map(|(_, length)| length).sum::<f64>() >= FINISHES_MM);
    finishing.flatten().map(|(line, _)| *line).collect()
}

/// The tools that cut and are not described: name and first line.
fn missing_tools(program: &Program, tools: &[ProgramTool]) -> Vec<(String, usize)> {
    let mut missing: Vec<(String, usize)> = Vec::new();
    for one in program.moves.iter().filter(|one| one.kind.is_feed()) {
        let name = name_of(program, one).unwrap_or("none");
        let is_there = tools.iter().any(|tool| tool.number == name) || missing.iter().any(|(known, _)| known == name);
        if !is_there {
            missing.push((name.to_owned(), one.line));
        }
    }
    missing
}

fn name_of<'p>(program: &'p Program, one: &ProgramMove) -> Option<&'p str> {
    one.tool.and_then(|tool| program.tools.get(tool as usize)).map(String::as_str)
}

/// The region of a tool about its programmed point.
fn shape(tool: &ProgramTool) -> Shape {
    let slope = |degrees: f64| (degrees < WALL_DEG).then(|| degrees.to_radians().tan());
    let (leading, trailing) = (slope(tool.cutting_edge_angle_deg), slope(tool.minor_edge_angle_deg));
    let nose = tool.nose_radius_mm;
    // A left-hand tool leads toward the tailstock.
    let is_left_hand = tool.tip_direction == 4;
    let (left, right) = if is_left_hand { (trailing, leading) } else { (leading, trailing) };
    let centre = match tool.tip_direction {
        3 => [nose, nose],
        4 => [-nose, nose],
        8 => [0.0, nose],
        _ => [0.0, 0.0],
    };
    Shape { nose, left, right, centre }
}

/// The way of a move that begins at a place (diameter and z), from the headstock end.
fn way(one: &ProgramMove, [x0, z0]: [f64; 2], [x1, z1]: [f64; 2], zero: f64) -> Way {
    let (a, b) = ([z0 + zero, 0.5 * x0], [z1 + zero, 0.5 * x1]);
    let Some([cx, cz]) = one.centre else {
        return Way::Line(a, b);
    };
    let centre = [cz + zero, 0.5 * cx];
    let angle = |point: [f64; 2]| (point[1] - centre[1]).atan2(point[0] - centre[0]);
    let full = std::f64::consts::TAU;
    let turn = match one.kind {
        Kind::ArcCcw => (angle(b) - angle(a)).rem_euclid(full),
        _ => -(angle(a) - angle(b)).rem_euclid(full),
    };
    // From a place to itself it goes all the way round.
    let turn = if turn.abs() > 1e-9 { turn } else { full };
    Way::Arc { centre, radius: (a[0] - centre[0]).hypot(a[1] - centre[1]), from: angle(a), turn }
}

/// A move of a tool between two known places.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stroke<'p> {
    /// Which of the program's moves it is.
    pub(crate) index: usize,
    pub(crate) one: &'p ProgramMove,
    pub(crate) tool: &'p ProgramTool,
    pub(crate) shape: Shape,
    /// Of the programmed point, were there no compensation of the nose.
    pub(crate) way: Way,
    /// Shares of the programmed path beside which it begins and ends.
    pub(crate) programmed: [f64; 2],
}

/// The tools of a program that are described, with their regions.
fn tools_of<'p>(program: &Program, job: &'p Job) -> Vec<Option<(&'p ProgramTool, Shape)>> {
    let described = |name: &String| job.tools.iter().find(|tool| tool.number == *name).map(|tool| (tool, shape(tool)));
    program.tools.iter().map(described).collect()
}

/// Where the nose goes, of the moves of a program with compensation; empty where it has none. The line of a move that cannot be
/// followed where there is one.
fn compensated(program: &Program, job: &Job, zero: f64) -> Result<Vec<Option<Compensated>>, usize> {
    if program.moves.iter().all(|one| one.nose == Nose::Off) {
        return Ok(Vec::new());
    }
    let tools = tools_of(program, job);
    let mut from = job.reading.start.map(|start| [start.x_diameter_mm, start.z_mm]);
    let programmed = program.moves.iter().map(|one| {
        let begin = std::mem::replace(&mut from, one.end.known());
        let (_, shape) = one.tool.and_then(|tool| tools.get(tool as usize).copied().flatten())?;
        Some(Programmed {
            way: way(one, begin?, one.end.known()?, zero),
            nose: one.nose,
            radius: shape.nose,
            centre: shape.centre,
            tool: one.tool,
        })
    });
    let programmed: Vec<Option<Programmed>> = programmed.collect();
    nose::ways(&programmed).map_err(|at| program.moves.get(at).map_or(1, |one| one.line))
}

/// The moves of a program over a blank: those between known places, of tools that are described.
pub(crate) fn strokes<'p>(program: &'p Program, job: &'p Job, zero: f64) -> impl Iterator<Item = Stroke<'p>> {
    let tools = tools_of(program, job);
    // A program that cannot be followed is refused before anything is made of it.
    let compensated = compensated(program, job, zero).unwrap_or_default();
    let mut from = job.reading.start.map(|start| [start.x_diameter_mm, start.z_mm]);
    program.moves.iter().enumerate().filter_map(move |(index, one)| {
        let begin = std::mem::replace(&mut from, one.end.known());
        let (tool, shape) = one.tool.and_then(|tool| tools.get(tool as usize).copied().flatten())?;
        let as_programmed = || Some((way(one, begin?, one.end.known()?, zero), [0.0, 1.0]));
        let beside = compensated.get(index).copied().flatten().map(|found| (found.way, found.programmed));
        let (way, programmed) = beside.or_else(as_programmed)?;
        Some(Stroke { index, one, tool, shape, way, programmed })
    })
}

/// The outline of a blank.
pub(crate) fn blank(stock: &ProgramStock) -> Chain {
    outline(&stock.profile)
}

/// An outline of places and diameters.
pub(crate) fn outline(rows: &[StockRow]) -> Chain {
    let rows: Vec<[f64; 2]> = rows.iter().map(|row| [row.z_mm, 0.5 * row.diameter_mm]).collect();
    Chain::of(&rows)
}

fn cylinder(keep_out: &KeepOut) -> Chain {
    let radius = 0.5 * keep_out.diameter_mm;
    Chain::of(&[[keep_out.z_start_mm, radius], [keep_out.z_end_mm, radius]])
}

/// Drives a program over its blank.
pub(crate) fn turned(
    program: &Program,
    job: &Job,
    (stock, zero): (&ProgramStock, f64),
    monitor: &dyn Monitor,
) -> Result<Turned, Failure> {
    let missing = missing_tools(program, &job.tools);
    if !missing.is_empty() {
        let (names, lines): (Vec<String>, Vec<usize>) = missing.into_iter().unzip();
        return Err(Failure::OutOfModel(
            Finding::new("tool_missing", "/tools").with("names", names).with("lines", lines),
        ));
    }
    if let Err(line) = compensated(program, job, zero) {
        let finding = Finding::new("nose_compensation_not_driven", "/nc_program").with("line", line);
        return Err(Failure::OutOfModel(finding));
    }
    let mut chain = blank(stock);
    let mut turned = Turned {
        parts: Vec::new(),
        owned: BTreeMap::new(),
        in_stock: Vec::new(),
        hits: Vec::new(),
        gouges: BTreeMap::new(),
        beyond_edge: BTreeMap::new(),
        cuts: false,
        first_cut: None,
    };
    let mut kept_out: Vec<(Chain, Option<u32>)> =
        job.keep_out.iter().map(|keep_out| (cylinder(keep_out), keep_out.support)).collect();
    let mut pace = Pace::new(monitor);
    for Stroke { index, one, tool, shape, way, .. } in strokes(program, job, zero) {
        pace.work(WORK_OF_MOVE * (1 + kept_out.len()) + chain.take_looked_at() * WORK_OF_PART)?;
        for (place, (kept_out, support)) in kept_out.iter_mut().enumerate() {
            if support.is_some_and(|support| !job.acts(support, program.executed_at(index))) {
                continue;
            }
            let depth_mm = kept_out.depth_of_tool(tool, &shape, &way);
            let is_told = turned.hits.iter().rev().take_while(|hit| hit.line == one.line).any(|hit| hit.place == place);
            if depth_mm > CONTACT_MM && !is_told {
                turned.hits.push(Hit { line: one.line, place, depth_mm });
            }
        }
        if one.kind == Kind::Rapid {
            let depth_mm = chain.depth_of(&shape, &way);
            let is_told = turned.in_stock.last().is_some_and(|last| last.line == one.line);
            if depth_mm > CONTACT_MM && !is_told {
                turned.in_stock.push(InStock { line: one.line, depth_mm });
            }
        } else if one.kind.is_feed() {
            if let Some((ends, length_mm)) = EdgeEnds::of(tool, &shape).zip(tool.edge_length_mm) {
                let beyond_mm = ends.beyond_mm(tool.tip_direction, &shape, &way, &mut chain);
                if beyond_mm > BEYOND_EDGE_MM {
                    let told = turned.beyond_edge.entry(one.line).or_insert([0.0, length_mm]);
                    told[0] = told[0].max(beyond_mm);
                }
            }
            // The depth of the first cut is told, of all others whether there is any.
            let depth_mm = turned.first_cut.is_none().then(|| chain.depth_of(&shape, &way));
            let cuts =
                depth_mm.map_or_else(|| chain.reaches(&shape, &way, CONTACT_MM), |depth_mm| depth_mm > CONTACT_MM);
            chain.cut_along(&shape, &way, one.line);
            if cuts {
                if let Some(steepest) = shape.falls_behind(&way, tool.tip_direction == 4) {
                    let told = turned.gouges.entry(one.line).or_insert([0.0, tool.minor_edge_angle_deg]);
                    told[0] = told[0].max(steepest);
                }
                turned.cuts = true;
                let first = depth_mm.filter(|_| way.is_along()).map(|depth_mm| Cut { line: one.line, depth_mm });
                turned.first_cut = turned.first_cut.or(first);
            }
        }
    }
    own(&chain, &mut turned);
    Ok(turned)
}

/// Who owns how much; what is turned away wholly is no surface.
fn own(chain: &Chain, turned: &mut Turned) {
    let parts = chain.parts();
    let axis = Curve::Line { x: 0.0, r: 0.0, slope: 0.0 };
    for (i, part) in parts.iter().enumerate() {
        if let Some(owner) = part.owner.filter(|_| part.piece.curve != axis) {
            *turned.owned.entry(owner).or_default() += part.piece.length();
        }
        if let Some(before) = i.checked_sub(1).and_then(|i| parts.get(i)) {
            let at = part.piece.x0;
            let height = (before.piece.curve.at(at) - part.piece.curve.at(at)).abs();
            if let Some(owner) = step_owner(&parts, i).filter(|_| height > CONTACT_MM) {
                *turned.owned.entry(owner).or_default() += height;
            }
        }
        turned.parts.push((part.piece, part.owner));
    }
}
