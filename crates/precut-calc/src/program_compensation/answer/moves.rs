//! Numbers of the answer: the moves that are read.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::super::model::reader::{Feed, Kind, Nose, ProgramMove, Speed};

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
    pub(super) fn push(&mut self, one: &ProgramMove) {
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
    pub(super) fn length(&self) -> f64 {
        match self.centre {
            Some(centre) => self.radius(centre) * self.turn(centre).1.abs(),
            None => (0.5 * (self.end[0] - self.start[0])).hypot(self.end[1] - self.start[1]),
        }
    }
}
