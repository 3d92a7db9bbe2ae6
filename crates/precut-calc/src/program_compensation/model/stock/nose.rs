//! Where a tool goes whose nose is compensated (G41, G42): its centre runs beside the programmed path, at the radius of the nose
//! (`program/3`).
//!
//! At a corner of which the tool is on the outside the nose turns about the corner and makes nothing but it, so that its way there is left
//! out. At a corner of which it is on the inside, both paths end where they meet. The first move with compensation ends beside the begin
//! of the next one, the first one without it begins where the nose stands.

use super::super::reader::Nose;
use super::sweep::Way;

/// Corners that turn by less are none, and so near to none that rounding may keep both paths apart, rad.
const STRAIGHT_RAD: f64 = 1e-9;
const NEARLY_RAD: f64 = 0.02;
/// Directions that go back on each other: cosine of their angle.
const BACK: f64 = -0.999;
/// Lengths that are none, mm.
const SAME_MM: f64 = 1e-9;

type Point = [f64; 2];

/// A move along a programmed path.
#[derive(Debug, Clone, Copy)]
pub(super) struct Programmed {
    pub(super) way: Way,
    pub(super) nose: Nose,
    /// Radius of the nose and its centre from the programmed point, mm.
    pub(super) radius: f64,
    pub(super) centre: Point,
    /// Which of the tools.
    pub(super) tool: Option<u32>,
}

/// The way that the programmed point of the tool takes, were there no compensation, and the shares of the programmed path beside
/// which it begins and ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Compensated {
    pub(super) way: Way,
    pub(super) programmed: [f64; 2],
}

fn add(a: Point, b: Point, times: f64) -> Point {
    [a[0] + times * b[0], a[1] + times * b[1]]
}

fn cross(a: Point, b: Point) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

impl Programmed {
    fn is_compensated(&self) -> bool {
        self.nose != Nose::Off && self.radius > 0.0
    }

    /// 1 where the nose runs to the left of the path.
    fn side(&self) -> f64 {
        if self.nose == Nose::Left { 1.0 } else { -1.0 }
    }

    /// From the path to the centre of the nose, at a share of it.
    fn beside(&self, share: f64) -> Point {
        let [x, r] = self.way.direction(share).unwrap_or([-1.0, 0.0]);
        let by = self.side() * self.radius;
        [-r * by, x * by]
    }

    fn centre_at(&self, share: f64) -> Point {
        add(self.way.at(share), self.beside(share), 1.0)
    }

    /// Share of the programmed path beside which the centre of the nose is.
    fn share_of(&self, centre: Point) -> f64 {
        match self.way {
            Way::Line(from, _) => {
                let Some(direction) = self.way.direction(0.0) else { return 0.0 };
                dot(add(centre, from, -1.0), direction) / self.way.length_mm()
            }
            Way::Arc { centre: about, from, turn, .. } => {
                let angle = (centre[1] - about[1]).atan2(centre[0] - about[0]);
                // From half a turn before the begin to half a turn behind it.
                let turned = (turn.signum() * (angle - from) + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU);
                (turned - std::f64::consts::PI) / turn.abs()
            }
        }
    }

    /// The path of the centre of the nose, from one place on it to another.
    fn between(&self, from: Point, to: Point) -> Option<Way> {
        let Way::Arc { centre, radius, turn, .. } = self.way else { return Some(Way::Line(from, to)) };
        let angle = |point: Point| (point[1] - centre[1]).atan2(point[0] - centre[0]);
        let by = (turn.signum() * (angle(to) - angle(from))).rem_euclid(std::f64::consts::TAU);
        let radius = radius - self.side() * turn.signum() * self.radius;
        (radius > SAME_MM).then(|| Way::Arc { centre, radius, from: angle(from), turn: turn.signum() * by })
    }
}

/// Ways of moves that follow each other; `None` of what is no move along a path. The place of the move that cannot be followed where
/// there is one.
pub(super) fn ways(moves: &[Option<Programmed>]) -> Result<Vec<Option<Compensated>>, usize> {
    let mut found: Vec<Option<Compensated>> = vec![None; moves.len()];
    // Where the centre of the nose stands, of which tool, and whether it is beside a path there.
    let mut stands: Option<(Point, Option<u32>, bool)> = None;
    for (i, one) in moves.iter().enumerate() {
        let Some(one) = one else {
            stands = None;
            continue;
        };
        let length = one.way.length_mm();
        let before = stands.filter(|(_, tool, _)| *tool == one.tool);
        let was_beside = before.is_some_and(|(_, _, is_beside)| is_beside);
        // The next move of this tool that goes anywhere.
        let next = moves[i + 1..].iter().take_while(|next| next.is_some()).flatten();
        let next = next.take_while(|next| next.tool == one.tool).find(|next| next.way.length_mm() > SAME_MM);
        let next = next.filter(|next| next.is_compensated() && next.nose == one.nose);
        let by_path = Compensated { way: one.way, programmed: [0.0, 1.0] };
        if length <= SAME_MM {
            found[i] = Some(by_path);
            continue;
        }
        if !one.is_compensated() {
            let [_, to] = one.way.ends();
            let way = match (before.filter(|_| was_beside), one.way) {
                (None, way) => way,
                (Some((centre, _, _)), Way::Line(..)) => Way::Line(add(centre, one.centre, -1.0), to),
                (Some(_), Way::Arc { .. }) => return Err(i),
            };
            found[i] = Some(Compensated { way, programmed: [0.0, 1.0] });
            stands = Some((add(to, one.centre, 1.0), one.tool, false));
            continue;
        }
        if !was_beside {
            // It comes beside the path.
            let Way::Line(from, _) = one.way else { return Err(i) };
            let end = next.map_or_else(|| one.centre_at(1.0), |next| next.centre_at(0.0));
            let way = Way::Line(from, add(end, one.centre, -1.0));
            found[i] = Some(Compensated { way, programmed: [0.0, 1.0] });
            stands = Some((end, one.tool, true));
            continue;
        }
        let start = before.map_or_else(|| one.centre_at(0.0), |(centre, _, _)| centre);
        let (end, begin_of_next) = match next {
            Some(next) => corner(one, next).ok_or(i)?,
            None => (one.centre_at(1.0), one.centre_at(1.0)),
        };
        let programmed = [one.share_of(start), one.share_of(end)];
        // A way that is wholly cut off at both corners: the control refuses it, too.
        if programmed[1] - programmed[0] <= 0.0 {
            return Err(i);
        }
        let way = one.between(start, end).ok_or(i)?;
        found[i] = Some(Compensated { way: moved(way, one.centre), programmed });
        stands = Some((begin_of_next, one.tool, true));
    }
    Ok(found)
}

/// A path at a distance to the side of another one: round the corners of which it is on the outside, and at others as far as both
/// parts of it meet. `None` where the other one is narrower than that.
pub(crate) fn path_beside(path: &[Way], nose: Nose, by_mm: f64) -> Option<Vec<Way>> {
    let beside = |way: Way| Programmed { way, nose, radius: by_mm, centre: [0.0; 2], tool: None };
    let path: Vec<Programmed> = path.iter().copied().filter(|way| way.length_mm() > SAME_MM).map(beside).collect();
    // It comes beside the path from anywhere.
    let [begin, _] = path.first()?.way.ends();
    let approach = beside(Way::Line(add(begin, [1.0, 1.0], by_mm), begin));
    let moves: Vec<Option<Programmed>> = std::iter::once(approach).chain(path.iter().copied()).map(Some).collect();
    let found = ways(&moves).ok()?;
    let mut all: Vec<Way> = Vec::new();
    for (i, one) in found.into_iter().skip(1).enumerate() {
        let way = one?.way;
        if let (Some(last), Some(before)) = (all.last(), i.checked_sub(1)) {
            let ([_, from], [to, _]) = (last.ends(), way.ends());
            let [_, corner] = path[before].way.ends();
            let [first, second] = [from, to].map(|end| (end[1] - corner[1]).atan2(end[0] - corner[0]));
            if dot(add(to, from, -1.0), add(to, from, -1.0)).sqrt() > SAME_MM {
                // Less than half a turn.
                let turn =
                    (second - first + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI;
                all.push(Way::Arc { centre: corner, radius: by_mm, from: first, turn });
            }
        }
        all.push(way);
    }
    Some(all)
}

/// The way of the programmed point that goes with one of the centre of the nose.
fn moved(way: Way, centre: Point) -> Way {
    match way {
        Way::Line(from, to) => Way::Line(add(from, centre, -1.0), add(to, centre, -1.0)),
        Way::Arc { centre: about, radius, from, turn } => {
            Way::Arc { centre: add(about, centre, -1.0), radius, from, turn }
        }
    }
}

/// Where the path of the nose ends at a corner, and where the next one begins.
fn corner(one: &Programmed, next: &Programmed) -> Option<(Point, Point)> {
    let (first, second) = (one.way.direction(1.0)?, next.way.direction(0.0)?);
    let turn = cross(first, second);
    let ends = (one.centre_at(1.0), next.centre_at(0.0));
    if dot(first, second) < BACK {
        return None;
    }
    // Outside the corner, or where there is none.
    if turn * one.side() <= STRAIGHT_RAD {
        return Some(ends);
    }
    let meets = meet(&Locus::of(one), &Locus::of(next), one.way.at(1.0));
    let nearly = (turn.abs() < NEARLY_RAD).then_some(ends.0);
    meets.or(nearly).map(|point| (point, point))
}

/// The path of the centre of the nose, without its ends.
enum Locus {
    Line { from: Point, along: Point },
    Circle { centre: Point, radius: f64 },
}

impl Locus {
    fn of(one: &Programmed) -> Self {
        match one.way {
            Way::Line(..) => {
                Self::Line { from: one.centre_at(0.0), along: one.way.direction(0.0).unwrap_or([-1.0, 0.0]) }
            }
            Way::Arc { centre, radius, turn, .. } => {
                Self::Circle { centre, radius: radius - one.side() * turn.signum() * one.radius }
            }
        }
    }
}

/// Where two paths meet nearest to a place.
fn meet(one: &Locus, other: &Locus, near: Point) -> Option<Point> {
    let points = match (one, other) {
        (Locus::Line { from, along }, Locus::Line { from: other, along: to }) => {
            let share = cross(add(*other, *from, -1.0), *to) / cross(*along, *to);
            vec![add(*from, *along, share)]
        }
        (Locus::Line { from, along }, Locus::Circle { centre, radius })
        | (Locus::Circle { centre, radius }, Locus::Line { from, along }) => {
            let to = add(*centre, *from, -1.0);
            let half = (radius * radius - cross(*along, to).powi(2)).sqrt();
            [-half, half].map(|half| add(*from, *along, dot(to, *along) + half)).to_vec()
        }
        (Locus::Circle { centre, radius }, Locus::Circle { centre: other, radius: second }) => {
            let to = add(*other, *centre, -1.0);
            let distance = to[0].hypot(to[1]);
            let along = 0.5 * (distance + (radius * radius - second * second) / distance);
            let half = (radius * radius - along * along).sqrt();
            let direction = to.map(|length| length / distance);
            let foot = add(*centre, direction, along);
            [-half, half].map(|half| add(foot, [-direction[1], direction[0]], half)).to_vec()
        }
    };
    let distance = |point: &Point| (point[0] - near[0]).hypot(point[1] - near[1]);
    points.into_iter().filter(|point| distance(point).is_finite()).min_by(|a, b| distance(a).total_cmp(&distance(b)))
}
