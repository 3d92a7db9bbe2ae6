//! From stretches to blocks: approach, cut, exit, stops, and what a setter expects about them.

use crate::calculator::{Block, Dialect, Program, ProgramEnd};
use crate::path::round_to_increment;

use super::{Surface, Yielding, drive::Cutting};

/// Rapid motion keeps so far from the work where the job asks for less, mm.
const LEAST_MM: f64 = 0.1;

/// What is constant at the spindle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Speed {
    /// rev/min.
    Spindle(f64),
    /// m/min, with its limit in rev/min.
    Surface(f64, f64),
}

/// A part of a pass that the tool cuts in one go.
#[derive(Debug, Clone)]
pub(crate) struct Stretch {
    /// Station and commanded diameter, in the order of the feed.
    pub corners: Vec<(f64, f64)>,
    /// The tool stays in the work: it begins where the stretch before it ended.
    pub goes_on: bool,
    pub feed_mm_per_rev: f64,
    pub speed: Speed,
    /// Number of the cut that [`Yielding`] knows it by.
    pub cut: usize,
    /// What is said before it.
    pub notes: Vec<String>,
    /// Why the program stops before it.
    pub stop: Option<String>,
}

/// A rest that stands round the shaft.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rest {
    pub z_mm: f64,
}

/// How the program is to be written.
pub(crate) struct Setting {
    pub dialect: Dialect,
    pub increment_mm: f64,
    /// Station of the program's zero, mm.
    pub zero_mm: f64,
    /// Distance on the diameter, and along the shaft.
    pub clearance_x_mm: f64,
    pub clearance_z_mm: f64,
    /// 1 where the tool comes from the tailstock, else -1.
    pub side: f64,
    pub rests: Vec<Rest>,
    pub tool_number: Option<u32>,
    pub coolant: bool,
    /// X and Z of the program.
    pub safe_position: Option<(f64, f64)>,
    pub end: Option<ProgramEnd>,
}

impl Setting {
    /// Distance that rapid motion keeps from the work across the shaft, mm on the radius.
    pub(crate) fn beside_x_mm(&self) -> f64 {
        (0.5 * self.clearance_x_mm).max(LEAST_MM)
    }

    /// The same along the shaft, mm.
    pub(crate) fn beside_z_mm(&self) -> f64 {
        self.clearance_z_mm.max(LEAST_MM)
    }
}

/// A program and what its blocks belong to.
#[derive(Debug, Clone)]
pub(crate) struct Written {
    pub program: Program,
    /// Number of the cut of every block.
    pub cuts: Vec<usize>,
    /// Indices of the stretches before which the tool feeds in radially beside what is as thick.
    pub plunges: Vec<usize>,
}

struct Writer<'a> {
    setting: &'a Setting,
    surface: Surface,
    work: &'a mut dyn Yielding,
    blocks: Vec<Block>,
    cuts: Vec<usize>,
    plunges: Vec<usize>,
    /// Diameter at which the tool travels along the shaft.
    travel_mm: f64,
    /// Where the tool stands, as a station; unknown at first.
    at_mm: Option<f64>,
    /// The last commanded corner.
    last: Option<(f64, f64)>,
    /// The point of the surface that the tool passed last since it came to the work.
    passed_last: Option<usize>,
    cut: usize,
    feed: Option<f64>,
    speed: Option<Speed>,
}

/// The program of stretches over a blank.
pub(crate) fn write(
    setting: &Setting,
    blank: &Surface,
    work: &mut dyn Yielding,
    head: Vec<String>,
    stretches: &[Stretch],
) -> Written {
    let travel_mm = up(2.0 * blank.widest_mm() + setting.clearance_x_mm.max(2.0 * LEAST_MM), setting.increment_mm);
    let mut writer = Writer {
        setting,
        surface: blank.clone(),
        work,
        blocks: Vec::new(),
        cuts: Vec::new(),
        plunges: Vec::new(),
        travel_mm,
        at_mm: None,
        last: None,
        passed_last: None,
        cut: 0,
        feed: None,
        speed: None,
    };
    writer.begin(head);
    for (k, stretch) in stretches.iter().enumerate() {
        // Stretches that go on are one cut.
        let end = stretches[k..].iter().enumerate().take_while(|(i, next)| *i == 0 || next.goes_on).last();
        writer.stretch(k, stretch, end.map_or(stretch, |(_, end)| end), stretches.get(k + 1));
    }
    writer.finish();
    let Writer { blocks, cuts, plunges, .. } = writer;
    Written { program: Program { dialect: setting.dialect, increment_mm: setting.increment_mm, blocks }, cuts, plunges }
}

impl Writer<'_> {
    fn push(&mut self, block: Block) {
        self.blocks.push(block);
        self.cuts.push(self.cut);
    }

    fn begin(&mut self, head: Vec<String>) {
        self.push(Block::Modes);
        for note in head {
            self.push(Block::Note(note));
        }
        if self.setting.safe_position.is_some() {
            self.retreat();
        }
        if let Some(number) = self.setting.tool_number {
            self.push(Block::Tool { number });
        }
    }

    fn finish(&mut self) {
        self.retreat();
        if self.setting.coolant {
            self.push(Block::Coolant { on: false });
        }
        self.push(Block::End(self.setting.end));
    }

    /// To the safe position, where there is one: first away from the work, then along it.
    fn retreat(&mut self) {
        if let Some((x, z)) = self.setting.safe_position {
            let rounded = |value| round_to_increment(value, self.setting.increment_mm);
            let (x_diameter_mm, z_mm) = (Some(rounded(x)), Some(rounded(z)));
            self.push(Block::Rapid { x_diameter_mm, z_mm: None });
            self.push(Block::Rapid { x_diameter_mm: None, z_mm });
            self.at_mm = Some(z + self.setting.zero_mm);
        }
    }

    fn stretch(&mut self, number: usize, stretch: &Stretch, end: &Stretch, next: Option<&Stretch>) {
        let (Some(&first), Some(&last)) = (stretch.corners.first(), stretch.corners.last()) else { return };
        self.cut = stretch.cut;
        if !stretch.goes_on {
            self.stops(stretch, first.0, end.corners.last().map_or(last.0, |corner| corner.0));
        }
        for note in &stretch.notes {
            self.push(Block::Note(note.clone()));
        }
        self.speak(stretch.speed);
        self.feed = Some(stretch.feed_mm_per_rev);
        if stretch.goes_on {
            self.feed_to(self.joint(first), first.1);
        } else {
            self.approach(number, first);
        }
        let inner = &stretch.corners[1..stretch.corners.len().max(2) - 1];
        for &(z, x) in inner {
            self.feed_to(self.placed(z), x);
        }
        let next = next.filter(|next| next.goes_on);
        if stretch.corners.len() > 1 {
            let ahead = next.and_then(|next| next.corners.first()).map(|corner| corner.1);
            self.feed_to(self.end_of(last, ahead), last.1);
        }
        if next.is_none() {
            self.leave(last);
        }
    }

    /// Stops where a rest stands between the tool and the end of the cut, or where the stretch asks for it.
    fn stops(&mut self, stretch: &Stretch, from_mm: f64, to_mm: f64) {
        // The tool comes down before the cut.
        let down_mm = from_mm + self.setting.side * self.setting.beside_z_mm();
        let ends = [self.at_mm.unwrap_or(from_mm), down_mm, from_mm, to_mm];
        let low = ends.iter().copied().fold(f64::INFINITY, f64::min) + self.setting.increment_mm;
        let high = ends.iter().copied().fold(f64::NEG_INFINITY, f64::max) - self.setting.increment_mm;
        let rests: Vec<f64> =
            self.setting.rests.iter().map(|rest| rest.z_mm).filter(|z| low < *z && *z < high).collect();
        let mut reasons: Vec<String> = stretch.stop.iter().cloned().collect();
        reasons.extend(rests.into_iter().map(|z| {
            let z = round_to_increment(z - self.setting.zero_mm, self.setting.increment_mm);
            format!("the tool passes the steady rest at Z{z}: open it or move it out of the way, and close it behind the tool")
        }));
        if reasons.is_empty() {
            return;
        }
        self.retreat();
        if self.setting.coolant && self.speed.is_some() {
            self.push(Block::Coolant { on: false });
        }
        for reason in reasons {
            self.push(Block::Stop { reason });
        }
        // The spindle starts again behind a stop.
        self.speed = None;
    }

    fn speak(&mut self, speed: Speed) {
        if self.speed == Some(speed) {
            return;
        }
        let begins = self.speed.is_none();
        self.push(match speed {
            Speed::Spindle(rpm) => Block::SpindleSpeed { rpm },
            Speed::Surface(speed_m_per_min, limit_rpm) => Block::SurfaceSpeed { speed_m_per_min, limit_rpm },
        });
        if begins && self.setting.coolant {
            self.push(Block::Coolant { on: true });
        }
        self.speed = Some(speed);
    }

    /// Station of the program's step that is nearest.
    fn placed(&self, z_mm: f64) -> f64 {
        round_to_increment(z_mm - self.setting.zero_mm, self.setting.increment_mm)
    }

    /// The same, but never nearer to the headstock (`side` 1) or the tailstock (-1).
    fn beyond(&self, z_mm: f64, side: f64) -> f64 {
        let near = self.placed(z_mm);
        let lacks = side * (z_mm - self.setting.zero_mm - near) > 1e-9;
        if lacks {
            round_to_increment(near + side * self.setting.increment_mm, self.setting.increment_mm)
        } else {
            near
        }
    }

    /// Where the tool steps from one stretch into the next: the deeper of the two never reaches into the other.
    fn joint(&self, (z_mm, x_mm): (f64, f64)) -> f64 {
        match self.last {
            Some((_, last)) => self.step_at(z_mm, last, x_mm),
            None => self.placed(z_mm),
        }
    }

    /// The end of a stretch, where the next one goes on at a diameter, or something stands ahead that it is not to reach.
    fn end_of(&self, (z_mm, x_mm): (f64, f64), ahead_mm: Option<f64>) -> f64 {
        let side = self.setting.side;
        let stands = || 2.0 * self.surface.highest_mm(z_mm, z_mm - side * self.setting.beside_z_mm());
        self.step_at(z_mm, x_mm, ahead_mm.unwrap_or_else(stands))
    }

    /// A step between two diameters as a step of the program, on the side of the deeper one.
    fn step_at(&self, z_mm: f64, before_mm: f64, ahead_mm: f64) -> f64 {
        let side = self.setting.side;
        if ahead_mm > before_mm {
            self.beyond(z_mm, side)
        } else if ahead_mm < before_mm && ahead_mm > 0.0 {
            self.beyond(z_mm, -side)
        } else {
            self.placed(z_mm)
        }
    }

    fn rapid(&mut self, x_diameter_mm: Option<f64>, z_mm: Option<f64>) {
        if let Some(z) = z_mm {
            self.at_mm = Some(z + self.setting.zero_mm);
        }
        self.push(Block::Rapid { x_diameter_mm, z_mm });
    }

    /// Feeds to a place of the program, and notes what is left there; no block where the tool is there already.
    fn feed_to(&mut self, z_mm: f64, x_diameter_mm: f64) {
        if self.last == Some((z_mm + self.setting.zero_mm, x_diameter_mm)) {
            return;
        }
        let feed_mm_per_rev = self.feed.take();
        self.push(Block::Cut { x_diameter_mm, z_mm, feed_mm_per_rev });
        let z = z_mm + self.setting.zero_mm;
        if let Some(from) = self.last {
            let cutting =
                Cutting { from, to: (z, x_diameter_mm), cut: self.cut, slack_mm: 1.01 * self.setting.increment_mm };
            cutting.turn(&mut self.surface, self.work, &mut self.passed_last);
        }
        self.last = Some((z, x_diameter_mm));
        self.at_mm = Some(z);
    }

    /// Comes to the begin of a cut: in rapid motion to the clearance, from there at the feed.
    fn approach(&mut self, number: usize, (z_mm, x_mm): (f64, f64)) {
        let (beside_x, beside_z, side) = (self.setting.beside_x_mm(), self.setting.beside_z_mm(), self.setting.side);
        let begins = self.begin_of(z_mm, x_mm);
        let begin = begins + self.setting.zero_mm;
        let before = self.beyond(begin + side * beside_z, side);
        let before_mm = before + self.setting.zero_mm;
        let stands = self.surface.highest_mm(begin, before_mm);
        let own = self.surface.highest_mm(begin, begin - side * beside_z);
        let plunges = stands >= 0.5 * x_mm;
        // Beside a shoulder that is thicker than the own blank the tool comes down over that, else over what stands before it.
        let over = if plunges && stands > own { self.beyond(begin - side * beside_z, -side) } else { before };
        let over_mm = over + self.setting.zero_mm;
        let floor = self.surface.highest_mm(over_mm - beside_z, over_mm + beside_z);
        self.rapid(Some(self.travel_mm), Some(over));
        (self.last, self.passed_last) = (None, None);
        // Nothing stands there: right down to the cut.
        let down = if floor <= 0.0 { x_mm } else { self.up(2.0 * (floor + beside_x)).max(x_mm) };
        if down < self.travel_mm {
            self.rapid(Some(down), None);
        }
        self.last = Some((over_mm, down.min(self.travel_mm)));
        if plunges {
            self.plunges.push(number);
            // Over the own blank straight along, over what is lower down to it: then radially in.
            let beside = if stands > own { down.min(self.travel_mm) } else { self.up(2.0 * stands) };
            self.feed_to(begins, beside);
        }
        self.feed_to(begins, x_mm);
    }

    /// Begin or end of a stretch as a step of the program: a cut deeper than what stands beside it does not reach into that.
    fn begin_of(&self, z_mm: f64, x_mm: f64) -> f64 {
        let side = self.setting.side;
        let beside = self.surface.highest_mm(z_mm, z_mm + side * self.setting.beside_z_mm());
        if beside > 0.5 * x_mm { self.beyond(z_mm, -side) } else { self.placed(z_mm) }
    }

    fn up(&self, diameter_mm: f64) -> f64 {
        up(diameter_mm, self.setting.increment_mm)
    }

    /// Leaves the work at the feed as far as the clearance, away from a face that stands ahead, then in rapid motion.
    fn leave(&mut self, (z_mm, x_mm): (f64, f64)) {
        let (beside_x, beside_z, side) = (self.setting.beside_x_mm(), self.setting.beside_z_mm(), self.setting.side);
        let ahead = self.surface.highest_mm(z_mm, z_mm - side * beside_z);
        let behind = self.surface.highest_mm(z_mm, z_mm + side * beside_z);
        let here = self.placed(z_mm);
        // The radius that stands of the cut itself may be larger than commanded: the work comes back.
        if ahead > behind {
            let clear = self.up((2.0 * (behind + LEAST_MM)).max(x_mm));
            self.feed_to(here, clear);
            let back = self.beyond(z_mm + side * beside_z, side);
            let back_mm = back + self.setting.zero_mm;
            let floor = self.surface.highest_mm(back_mm - beside_z, back_mm + beside_z);
            self.feed_to(back, self.up((2.0 * (floor + beside_x)).max(clear)).min(self.travel_mm.max(clear)));
        } else {
            let floor = ahead.max(behind);
            self.feed_to(here, self.up((2.0 * (floor + beside_x)).max(x_mm)).min(self.travel_mm.max(x_mm)));
        }
        self.rapid(Some(self.travel_mm), None);
        self.last = None;
    }
}

/// To the next increment that is no less.
fn up(diameter_mm: f64, increment_mm: f64) -> f64 {
    let near = round_to_increment(diameter_mm, increment_mm);
    if near < diameter_mm - 1e-9 { round_to_increment(near + increment_mm, increment_mm) } else { near }
}
