//! Numbers of the answer.

use crate::certainty::Conformance;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::super::job::StockRow;
use super::super::model::correction::Corrected;
use super::super::model::reader::{ContourCycle, Kind, Program};
use super::super::model::refeed::Refed;
use super::super::model::stock::{Turned, lines_that_finish};
use super::super::model::yielding::Yielded;
use super::compensated::CompensatedProgram;
use super::left::{LeftSurface, ProgramError, YieldedWork};
use super::moves::ReadMoves;
use super::refed::RefedProgram;

/// What a program makes the machine do.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(title = "ProgramCompensation")]
pub struct Outcome {
    /// Lines of the program.
    #[schema(extensions(("x-unit" = json!("1")), ("x-program" = json!({
        "text": "nc_program",
        "changes": "/compensation/changes",
        "figure": "program",
        "places": [
            { "of": "/moves", "x": "z_mm", "y": "x_diameter_mm", "is_path": true },
            { "of": "/yielding/contour", "x": "z_mm", "y": "diameter_error_um", "from": "program_zero_z_mm" },
        ],
        "tells": [
            { "of": "/yielding/lines", "fields": ["smallest_error_um", "largest_error_um"] },
            { "of": "/yielding/cuts", "fields": ["depth_mm", "radial_force_n", "deflection_um"] },
        ],
    }))))]
    pub lines: usize,
    /// Moves that cut along a known path.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub feed_moves: usize,
    /// Rapid moves.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub rapid_moves: usize,
    /// Threads, grooves and drilling that are passed.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub passed_moves: usize,
    /// Length of the path at the feed.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub feed_length_mm: f64,
    /// The tools, as the program calls them, in the order in which it does.
    pub tools: Vec<String>,
    /// The cycles over a contour that were expanded into moves.
    pub cycles: Vec<ContourCycle>,
    /// The moves in the order of execution, by columns.
    pub moves: ReadMoves,
    /// What the program leaves of the blank on work and machine that do not yield; null without a blank.
    pub surface: Option<LeftSurface>,
    /// How far that is off the part of the drawing; null without a drawing.
    pub drawing: Option<ProgramError>,
    /// What it leaves where work and machine yield; null without a force law.
    pub yielding: Option<YieldedWork>,
    /// The program that is given back, with its X, its feeds, or both changed; null where none was asked for.
    pub compensation: Option<CompensatedProgram>,
    /// The feeds that it was given, why, and what they bring; null where they were not asked for.
    pub refeed: Option<RefedProgram>,
    /// How probable it is that a part keeps `tolerance` all along the contour, outside transitions: of the program that is given back, or of
    /// the given one where none is; null without `tolerance`.
    pub conformance: Option<Conformance>,
}

/// The numbers of a program that is read.
pub(crate) fn outcome(
    program: &Program,
    drawing: &[StockRow],
    (turned, yielded): (Option<&Turned>, Option<&Yielded>),
    (corrected, refed): (Option<&Corrected>, Option<&Refed>),
) -> Outcome {
    let finishing = turned.map(lines_that_finish).unwrap_or_default();
    let mut moves = ReadMoves::default();
    program.moves.iter().for_each(|one| moves.push(one));
    let count = |is: fn(Kind) -> bool| moves.kind.iter().filter(|&&kind| is(kind)).count();
    Outcome {
        lines: program.lines,
        feed_moves: count(Kind::is_feed),
        rapid_moves: count(|kind| kind == Kind::Rapid),
        passed_moves: count(|kind| matches!(kind, Kind::Thread | Kind::Opaque)),
        feed_length_mm: moves.paths(None).filter(|path| path.kind.is_feed()).map(|path| path.length()).sum(),
        tools: program.tools.clone(),
        cycles: program.cycles.clone(),
        moves,
        surface: turned.map(LeftSurface::of),
        drawing: turned.and_then(|turned| ProgramError::of(turned, drawing)),
        yielding: yielded.map(|yielded| YieldedWork::of(yielded, &finishing)),
        compensation: corrected.map(|corrected| CompensatedProgram::of(corrected, refed)),
        refeed: refed.map(RefedProgram::of),
        conformance: None,
    }
}
