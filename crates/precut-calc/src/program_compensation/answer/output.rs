//! Numbers of the answer.

use std::collections::BTreeMap;

use crate::certainty::Conformance;
use crate::feed_schedule::stretches::PriceOfLimit;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::super::job::StockRow;
use super::super::model::correction::{ChangedLine, Corrected, Proof, Transition as ThickStretch, WhyLeftAlone};
use super::super::model::reader::{ContourCycle, Feed, Kind, Nose, Program, ProgramMove, Speed};
use super::super::model::refeed::{LimitReached, Refed};
use super::super::model::stock::{Curve, Part, Piece, Turned, lines_that_finish, outline};
use super::super::model::yielding::{ContourError, CutPlace, Yielded, between, contour as contour_of};

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

/// The fastest feeds of a program within the limits of `refeed`, as the program that is given back keeps them when it is read and
/// driven as one of its own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RefedProgram {
    /// Time of all moves at the feed, as the program is.
    #[schema(extensions(("x-unit" = json!("min"))))]
    pub cutting_time_before_min: f64,
    /// The same at the new feeds.
    #[schema(extensions(("x-unit" = json!("min"))))]
    pub cutting_time_after_min: f64,
    /// The lines that cut, in the order in which they first do, by columns.
    pub feeds: RefedFeeds,
    /// Lines that cut and keep their feed: it is one per minute at a constant cutting speed, or not one along the line.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub kept_lines: Vec<usize>,
    /// What each number of `refeed` that binds costs, the most costly first.
    pub prices: Vec<RefedPrice>,
    /// The limits with the most that is reached of them at any place of the cut.
    pub limits: Vec<RefedLimit>,
    /// Lines that are as they were, before X is shifted.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub lines_compared: usize,
    /// Moves that are no others than before but for their feed.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub moves_compared: usize,
}

/// Lines that cut and their feeds, all of one length.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RefedFeeds {
    /// Line of the program, from 1.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub line: Vec<usize>,
    /// Place of the tool in `tools`, from 0.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub tool: Vec<Option<u32>>,
    /// Whether it makes the surface that is left.
    pub is_finishing: Vec<bool>,
    /// Where its first move begins, from the headstock end.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub z_start_mm: Vec<f64>,
    /// Where its last move ends.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub z_end_mm: Vec<f64>,
    /// Length of its moves at the feed.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub length_mm: Vec<f64>,
    /// Largest depth that it really cuts.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_mm: Vec<f64>,
    /// Feed as the program is.
    #[schema(extensions(("x-unit" = json!("mm/rev"))))]
    pub old_feed_mm_per_rev: Vec<f64>,
    /// Feed of the program that is given back.
    #[schema(extensions(("x-unit" = json!("mm/rev"))))]
    pub new_feed_mm_per_rev: Vec<f64>,
    /// Limits that one step more of its feed passes, in this line or another; of more than 40 lines those that were passed when
    /// the lines were raised together.
    pub binding: Vec<Vec<String>>,
}

/// A number of `refeed` that binds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RefedPrice {
    /// The limit.
    #[schema(example = "deflection")]
    pub constraint: String,
    /// The number, in the unit of its field.
    #[schema(example = 10.0, extensions(("x-unit" = json!("as the field says"))))]
    pub limit: f64,
    /// What one percent looser takes off the time of the lines that cut.
    #[schema(example = 0.34, extensions(("x-unit" = json!("percent"))))]
    pub gain_percent: f64,
}

/// A limit and what is reached of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RefedLimit {
    /// The limit.
    #[schema(example = "deflection")]
    pub constraint: String,
    /// The limit, in the unit of its field.
    #[schema(example = 10.0, extensions(("x-unit" = json!("as the field says"))))]
    pub limit: f64,
    /// The most that is reached of it.
    #[schema(example = 9.98, extensions(("x-unit" = json!("as the field says"))))]
    pub reached: f64,
    /// Line in which it is, from 1; null where the limit is one of a tool.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub line: Option<usize>,
}

impl RefedProgram {
    fn of(refed: &Refed) -> Self {
        let mut feeds = RefedFeeds::default();
        for one in &refed.stretches {
            feeds.line.push(one.line);
            feeds.tool.push(one.tool);
            feeds.is_finishing.push(one.is_finishing);
            feeds.z_start_mm.push(one.ends_mm[0]);
            feeds.z_end_mm.push(one.ends_mm[1]);
            feeds.length_mm.push(one.length_mm);
            feeds.depth_mm.push(one.depth_mm);
            feeds.old_feed_mm_per_rev.push(one.feeds_mm_per_rev[0]);
            feeds.new_feed_mm_per_rev.push(one.feeds_mm_per_rev[1]);
            feeds.binding.push(one.binding.iter().copied().map(str::to_owned).collect());
        }
        let price = |one: &PriceOfLimit| RefedPrice {
            constraint: one.constraint.clone(),
            limit: one.limit,
            gain_percent: one.gain_percent,
        };
        let limit = |one: &LimitReached| RefedLimit {
            constraint: one.name.to_owned(),
            limit: one.limit,
            reached: one.reached,
            line: one.line,
        };
        Self {
            cutting_time_before_min: refed.time_min[0],
            cutting_time_after_min: refed.time_min[1],
            feeds,
            kept_lines: refed.kept_lines.clone(),
            prices: refed.prices.iter().map(price).collect(),
            limits: refed.limits.iter().map(limit).collect(),
            lines_compared: refed.lines_compared,
            moves_compared: refed.moves_compared,
        }
    }
}

/// What a program leaves on work and machine that do not yield, against the part of the drawing, by columns.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ProgramError {
    /// Place from the headstock end.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub z_mm: Vec<f64>,
    /// Diameter of the drawing.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub drawing_diameter_mm: Vec<f64>,
    /// By how much the diameter of the program is larger.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub program_error_um: Vec<f64>,
    /// Line that makes the surface there, from 1.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub line: Vec<usize>,
}

impl ProgramError {
    fn of(turned: &Turned, rows: &[StockRow]) -> Option<Self> {
        let drawing = outline(rows).parts();
        let (first, last) = drawing.first().zip(drawing.last())?;
        let (from, to) = (first.piece.x0, last.piece.x1);
        let part = |&(piece, owner): &(Piece, Option<usize>)| Part { piece, owner, step_owner: None };
        let made: Vec<Part> = turned.parts.iter().map(part).collect();
        let mut error = Self::default();
        for at in between(&made, &drawing).into_iter().filter(|at| (from..=to).contains(&at.z_mm)) {
            error.z_mm.push(at.z_mm);
            error.drawing_diameter_mm.push(at.diameter_mm + at.error_um / UM_PER_MM);
            error.program_error_um.push(-at.error_um);
            error.line.push(at.line);
        }
        Some(error)
    }
}

/// The program that is given back: its finishing cuts are shifted against what they would leave, or its feeds are others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CompensatedProgram {
    /// Lines of the given program that become others.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub lines_changed: Vec<usize>,
    /// What they become.
    pub changes: Vec<LineChange>,
    /// Finishing lines that stay as they are.
    pub left_alone: Vec<LineLeftAlone>,
    /// Stretches over which the work stays thick, because the shift jumps there and is laid on the side of the stock.
    pub transitions: Vec<Transition>,
    /// What came of the shifts when the program that is given back was read and driven again; null where nothing is shifted.
    pub proof: Option<CompensationProof>,
    /// The error that the program that is given back leaves along the contour, by columns; empty where nothing changes.
    pub contour: ErrorAlong,
    /// The change as a unified diff; empty where nothing changes.
    pub diff: String,
    /// The program that is given back: every line that is not among the changed ones is as it was, byte for byte.
    pub nc_program: String,
}

/// A line of a program that becomes others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct LineChange {
    /// Line of the given program, from 1.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub line: usize,
    /// As it was.
    pub old: String,
    /// As it is now.
    pub new: Vec<String>,
    /// Least shift along it, on the diameter.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub smallest_shift_um: f64,
    /// Largest shift along it, on the diameter.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub largest_shift_um: f64,
}

/// A finishing line that stays as it is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct LineLeftAlone {
    /// Line of the given program, from 1.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub line: usize,
    /// Why.
    pub reason: WhyLeftAlone,
}

/// A stretch over which the work stays thick.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = ThickStretch)]
pub struct Transition {
    /// Line of the given program, from 1.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub line: usize,
    /// Where it begins, from the headstock end.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub z_mm: f64,
    /// How long it is.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub length_mm: f64,
    /// By how much the diameter is larger there at the most than the corrected program aims at.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub leaves_um: f64,
}

/// The given and the corrected program, driven over the blank. Errors are those of the diameter along the contour, outside
/// transitions.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CompensationProof {
    /// Least error of the given program.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub smallest_error_before_um: f64,
    /// Largest error of the given program.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub largest_error_before_um: f64,
    /// Least error of the corrected program.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub smallest_error_after_um: f64,
    /// Largest error of the corrected program.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub largest_error_after_um: f64,
    /// How far the radius comes out at the most from what the corrected moves aim at.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub largest_residual_um: f64,
    /// Where, from the headstock end.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub largest_residual_z_mm: f64,
    /// How near rapid moves of the given program come to the work, across the axis: 0 where one begins at the end of a cut;
    /// null where none comes within 1 mm.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub rapid_clearance_before_mm: Option<f64>,
    /// The same of the corrected program.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub rapid_clearance_after_mm: Option<f64>,
    /// Lines that are as they were.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub lines_compared: usize,
    /// Moves that are no others than before.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub moves_compared: usize,
}

impl CompensatedProgram {
    fn of(corrected: &Corrected, refed: Option<&Refed>) -> Self {
        let change = |one: &ChangedLine| LineChange {
            line: one.line,
            old: one.old.clone(),
            new: one.new.clone(),
            smallest_shift_um: one.smallest_shift_um,
            largest_shift_um: one.largest_shift_um,
        };
        let mut contour = ErrorAlong::default();
        match (&corrected.proof, refed) {
            (Some(proof), _) => proof.contour.iter().for_each(|error| contour.push(error)),
            // What is not shifted leaves its error at the new feeds.
            (None, Some(refed)) => contour_of(&refed.yielded).iter().for_each(|error| contour.push(error)),
            (None, None) => {}
        }
        let transition = |one: &ThickStretch| Transition {
            line: one.line,
            z_mm: one.from_mm,
            length_mm: one.to_mm - one.from_mm,
            leaves_um: one.leaves_um,
        };
        Self {
            lines_changed: corrected.changed.iter().map(|one| one.line).collect(),
            changes: corrected.changed.iter().map(change).collect(),
            left_alone: corrected
                .left_alone
                .iter()
                .map(|one| LineLeftAlone { line: one.line, reason: one.why })
                .collect(),
            transitions: corrected.proof.iter().flat_map(|proof| &proof.transitions).map(transition).collect(),
            proof: corrected.proof.as_ref().map(CompensationProof::of),
            contour,
            diff: corrected.diff.clone(),
            nc_program: corrected.text.clone(),
        }
    }
}

impl CompensationProof {
    fn of(proof: &Proof) -> Self {
        // What stands in work that comes back touches it.
        let clearance = |clearance: Option<f64>| clearance.map(|clearance| clearance.max(0.0));
        Self {
            smallest_error_before_um: proof.before_um[0],
            largest_error_before_um: proof.before_um[1],
            smallest_error_after_um: proof.after_um[0],
            largest_error_after_um: proof.after_um[1],
            largest_residual_um: proof.residual_um,
            largest_residual_z_mm: proof.residual_at_mm,
            rapid_clearance_before_mm: clearance(proof.clearance_mm[0]),
            rapid_clearance_after_mm: clearance(proof.clearance_mm[1]),
            lines_compared: proof.lines_compared,
            moves_compared: proof.moves_compared,
        }
    }
}

/// What a program leaves where work and machine yield, and what each of its moves meets.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct YieldedWork {
    /// Least error of the diameter along the contour; null where nothing is made.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub smallest_error_um: Option<f64>,
    /// Largest error of the diameter along the contour; null where nothing is made.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub largest_error_um: Option<f64>,
    /// The error by the lines that make the contour, by columns.
    pub lines: ErrorOfLines,
    /// The error along the contour, by columns.
    pub contour: ErrorAlong,
    /// What the moves meet, by columns: of every move, or, of more than 20 000 places, of those that make the contour.
    pub cuts: CutsAlong,
}

/// The error of the diameter by lines, all of one length.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ErrorOfLines {
    /// Line that makes the surface, from 1.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub line: Vec<usize>,
    /// Least error of its surface.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub smallest_error_um: Vec<f64>,
    /// Largest error of its surface.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub largest_error_um: Vec<f64>,
}

/// The error of the diameter along the contour, all of one length.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ErrorAlong {
    /// Place from the headstock end.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub z_mm: Vec<f64>,
    /// Diameter that the program leaves where nothing yields.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub wanted_diameter_mm: Vec<f64>,
    /// By how much the diameter comes out larger.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub diameter_error_um: Vec<f64>,
    /// Line that makes the surface there, from 1.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub line: Vec<usize>,
}

/// Places of the moves that cut, in their order, all of one length.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CutsAlong {
    /// Line of the move, from 1.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub line: Vec<usize>,
    /// Place of the programmed point, from the headstock end.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub z_mm: Vec<f64>,
    /// Its diameter.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub diameter_mm: Vec<f64>,
    /// Engaged depth where nothing yields.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub nominal_depth_mm: Vec<f64>,
    /// Engaged depth really cut, on what the moves before have left.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_mm: Vec<f64>,
    /// Angle between the surface that is made and the edge that cuts; 0 where none does.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub lead_angle_deg: Vec<f64>,
    /// Compliance at the tool, carriage included.
    #[schema(extensions(("x-unit" = json!("um/N"))))]
    pub compliance_um_per_n: Vec<f64>,
    /// Force on the work across the axis, away from the tool.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub radial_force_n: Vec<f64>,
    /// By how much the tool comes to stand off its path.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub deflection_um: Vec<f64>,
}

/// Places above which only those of the contour are told.
const MOST_PLACES: usize = 20_000;
const UM_PER_MM: f64 = 1e3;

impl YieldedWork {
    fn of(yielded: &Yielded, finishing: &[usize]) -> Self {
        let errors = contour_of(yielded);
        let ends = |errors: &mut dyn Iterator<Item = f64>| {
            errors.fold(None, |ends: Option<(f64, f64)>, error| {
                Some(ends.map_or((error, error), |(low, high)| (low.min(error), high.max(error))))
            })
        };
        let all = ends(&mut errors.iter().map(|error| error.error_um));
        let mut lines = ErrorOfLines::default();
        let mut of_lines: BTreeMap<usize, (f64, f64)> = BTreeMap::new();
        for error in &errors {
            let (low, high) = of_lines.entry(error.line).or_insert((error.error_um, error.error_um));
            (*low, *high) = (low.min(error.error_um), high.max(error.error_um));
        }
        for &line in finishing {
            if let Some(&(low, high)) = of_lines.get(&line) {
                lines.line.push(line);
                lines.smallest_error_um.push(low);
                lines.largest_error_um.push(high);
            }
        }
        let mut contour = ErrorAlong::default();
        for error in &errors {
            contour.push(error);
        }
        let mut cuts = CutsAlong::default();
        let is_told = |line: usize| yielded.places.len() <= MOST_PLACES || finishing.binary_search(&line).is_ok();
        yielded.places.iter().filter(|of| is_told(of.line)).for_each(|of| cuts.push(of.line, &of.place));
        Self {
            smallest_error_um: all.map(|(low, _)| low),
            largest_error_um: all.map(|(_, high)| high),
            lines,
            contour,
            cuts,
        }
    }
}

impl ErrorAlong {
    fn push(&mut self, error: &ContourError) {
        self.z_mm.push(error.z_mm);
        self.wanted_diameter_mm.push(error.diameter_mm);
        self.diameter_error_um.push(error.error_um);
        self.line.push(error.line);
    }
}

impl CutsAlong {
    fn push(&mut self, line: usize, place: &CutPlace) {
        self.line.push(line);
        self.z_mm.push(place.z_mm);
        self.diameter_mm.push(2.0 * place.radius_mm);
        self.nominal_depth_mm.push(place.nominal_depth_mm);
        self.depth_mm.push(place.depth_mm);
        self.lead_angle_deg.push(place.lead_rad.to_degrees());
        self.compliance_um_per_n.push(place.compliance_mm_per_n * UM_PER_MM);
        self.radial_force_n.push(place.radial_force_n);
        self.deflection_um.push(place.lift_mm * UM_PER_MM);
    }
}

/// The outline that a program leaves, part by part from the headstock end, by columns. A part is straight, or an arc about a
/// centre.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct LeftSurface {
    /// Lines of the program that make at least 0.3 mm of it, alone or with others as short before and behind them.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub finishing_lines: Vec<usize>,
    /// Where a part begins, from the headstock end.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub z_start_mm: Vec<f64>,
    /// Where it ends.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub z_end_mm: Vec<f64>,
    /// Its diameter where it begins.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub diameter_start_mm: Vec<f64>,
    /// Its diameter where it ends.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub diameter_end_mm: Vec<f64>,
    /// Centre of an arc, from the headstock end.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub centre_z_mm: Vec<Option<f64>>,
    /// Diameter of the centre of an arc.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub centre_diameter_mm: Vec<Option<f64>>,
    /// Radius of an arc: above 0 the work is convex there, below 0 hollow.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub arc_radius_mm: Vec<Option<f64>>,
    /// Line that makes the part, from 1; null where the blank stands.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub line: Vec<Option<usize>>,
}

impl LeftSurface {
    fn of(turned: &Turned) -> Self {
        let mut surface = Self { finishing_lines: lines_that_finish(turned), ..Self::default() };
        for (piece, owner) in &turned.parts {
            let arc = match piece.curve {
                Curve::Line { .. } => None,
                Curve::Arc { x, r, radius, is_upper } => Some((x, 2.0 * r, if is_upper { radius } else { -radius })),
            };
            surface.z_start_mm.push(piece.x0);
            surface.z_end_mm.push(piece.x1);
            surface.diameter_start_mm.push(2.0 * piece.curve.at(piece.x0));
            surface.diameter_end_mm.push(2.0 * piece.curve.at(piece.x1));
            surface.centre_z_mm.push(arc.map(|(z, ..)| z));
            surface.centre_diameter_mm.push(arc.map(|(_, diameter, _)| diameter));
            surface.arc_radius_mm.push(arc.map(|(.., radius)| radius));
            surface.line.push(*owner);
        }
        surface
    }
}

/// Moves by columns, all of one length. Places are those of the programmed point from program zero, as the moves end; null
/// where the control alone knows it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ReadMoves {
    /// Line that asks for the move, from 1; of a cycle the line of its call.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub line: Vec<usize>,
    /// What the move is.
    pub kind: Vec<Kind>,
    /// Diameter at the end.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub x_diameter_mm: Vec<Option<f64>>,
    /// Place along the axis at the end.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub z_mm: Vec<Option<f64>>,
    /// Diameter of the centre of an arc.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub centre_x_diameter_mm: Vec<Option<f64>>,
    /// Place of the centre of an arc along the axis.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub centre_z_mm: Vec<Option<f64>>,
    /// Feed per revolution.
    #[schema(extensions(("x-unit" = json!("mm/rev"))))]
    pub feed_mm_per_rev: Vec<Option<f64>>,
    /// Feed per minute, where the program has it so.
    #[schema(extensions(("x-unit" = json!("mm/min"))))]
    pub feed_mm_per_min: Vec<Option<f64>>,
    /// Speed of the spindle, where it is constant.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub spindle_speed_rpm: Vec<Option<f64>>,
    /// Cutting speed, where it is constant.
    #[schema(extensions(("x-unit" = json!("m/min"))))]
    pub speed_m_per_min: Vec<Option<f64>>,
    /// Limit of the spindle with a constant cutting speed.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub spindle_limit_rpm: Vec<Option<f64>>,
    /// Place of the tool in `tools`, from 0.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub tool: Vec<Option<u32>>,
    /// Where the nose runs.
    pub nose_compensation: Vec<Nose>,
}

impl ReadMoves {
    /// Adds a move. Feed and speed stand with moves that cut.
    fn push(&mut self, one: &ProgramMove) {
        let cuts = one.kind.is_feed();
        let (per_rev, per_min) = match one.feed.filter(|_| cuts) {
            Some(Feed::PerRev(feed)) => (Some(feed), None),
            Some(Feed::PerMinute(feed)) => (None, Some(feed)),
            None => (None, None),
        };
        let (spindle, surface, limit) = match one.speed.filter(|_| cuts) {
            Some(Speed::Spindle(rpm)) => (Some(rpm), None, None),
            Some(Speed::Surface(speed, limit)) => (None, Some(speed), limit),
            None => (None, None, None),
        };
        self.line.push(one.line);
        self.kind.push(one.kind);
        self.x_diameter_mm.push(one.end.x);
        self.z_mm.push(one.end.z);
        self.centre_x_diameter_mm.push(one.centre.map(|[x, _]| x));
        self.centre_z_mm.push(one.centre.map(|[_, z]| z));
        self.feed_mm_per_rev.push(per_rev);
        self.feed_mm_per_min.push(per_min);
        self.spindle_speed_rpm.push(spindle);
        self.speed_m_per_min.push(surface);
        self.spindle_limit_rpm.push(limit);
        self.tool.push(one.tool);
        self.nose_compensation.push(one.nose);
    }

    /// The moves with the place where each begins: diameter and z.
    pub(super) fn paths(&self, start: Option<[f64; 2]>) -> impl Iterator<Item = Path> {
        let ends = self.x_diameter_mm.iter().zip(&self.z_mm).map(|(x, z)| (*x).zip(*z).map(|(x, z)| [x, z]));
        let centres =
            self.centre_x_diameter_mm.iter().zip(&self.centre_z_mm).map(|(x, z)| (*x).zip(*z).map(|(x, z)| [x, z]));
        let mut from = start;
        self.kind.iter().zip(ends).zip(centres).filter_map(move |((&kind, end), centre)| {
            let begin = std::mem::replace(&mut from, end);
            Some(Path { kind, start: begin?, end: end?, centre })
        })
    }
}

/// A move between two known places: diameters and z, mm.
#[derive(Debug, Clone, Copy)]
pub(super) struct Path {
    pub(super) kind: Kind,
    pub(super) start: [f64; 2],
    pub(super) end: [f64; 2],
    pub(super) centre: Option<[f64; 2]>,
}

impl Path {
    /// Angle about the centre at which an arc begins, and by which it turns, rad; counter-clockwise above 0.
    pub(super) fn turn(&self, centre: [f64; 2]) -> (f64, f64) {
        let angle = |point: [f64; 2]| (0.5 * (point[0] - centre[0])).atan2(point[1] - centre[1]);
        let full = std::f64::consts::TAU;
        let (from, to) = (angle(self.start), angle(self.end));
        let turn = if self.kind == Kind::ArcCcw { (to - from).rem_euclid(full) } else { -(from - to).rem_euclid(full) };
        // From a place to itself an arc goes all the way round.
        let is_round = turn.abs() < 1e-12;
        (
            from,
            if is_round && self.kind == Kind::ArcCcw {
                full
            } else if is_round {
                -full
            } else {
                turn
            },
        )
    }

    /// Radius of an arc about its centre, mm.
    pub(super) fn radius(&self, centre: [f64; 2]) -> f64 {
        (0.5 * (self.start[0] - centre[0])).hypot(self.start[1] - centre[1])
    }

    /// Length, mm.
    fn length(&self) -> f64 {
        match self.centre {
            Some(centre) => self.radius(centre) * self.turn(centre).1.abs(),
            None => (0.5 * (self.end[0] - self.start[0])).hypot(self.end[1] - self.start[1]),
        }
    }
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
