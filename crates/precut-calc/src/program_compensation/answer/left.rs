//! Numbers of the answer: what a program leaves where work and machine yield, and where they do not.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::super::job::StockRow;
use super::super::model::stock::{Curve, Part, Piece, Turned, lines_that_finish, outline};
use super::super::model::yielding::{ContourError, CutPlace, Yielded, between, contour as contour_of};

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
    pub(super) fn of(yielded: &Yielded, finishing: &[usize]) -> Self {
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
    pub(super) fn push(&mut self, error: &ContourError) {
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
    pub(super) fn of(turned: &Turned) -> Self {
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
    pub(super) fn of(turned: &Turned, rows: &[StockRow]) -> Option<Self> {
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
