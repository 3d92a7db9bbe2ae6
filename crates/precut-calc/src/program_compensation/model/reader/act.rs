//! What a block does: where its axes lead, and along which path.

use crate::calculator::Failure;

use super::super::super::job::Dialect;
use super::Reader;
use super::arcs;
use super::block::{Asked, Once, Words};
use super::codes::Path;
use super::contour::Use;
use super::faults::Spot;
use super::lexer::{Operand, Word};
use super::moves::{Feed, Kind, Place};
use super::state::Motion;

impl<'a> Reader<'a> {
    /// Where the words of the axes lead, of which one at least is there.
    pub(super) fn target(&mut self, words: &mut Words<'_, 'a>) -> Place {
        let from = self.state.place;
        Place { x: self.axis(words, [b'X', b'U'], from.x), z: self.axis(words, [b'Z', b'W'], from.z) }
    }

    fn axis(&mut self, words: &mut Words<'_, 'a>, [absolute, relative]: [u8; 2], from: Option<f64>) -> Option<f64> {
        let by_letter = words.look(absolute).is_none() && self.dialect == Dialect::FanucA;
        let Some(word) = words.take(if by_letter { relative } else { absolute }) else {
            return from;
        };
        let is_relative = match word.operand {
            Operand::Relative(_) => true,
            Operand::Absolute(_) => false,
            _ => by_letter || (self.state.is_relative && self.dialect != Dialect::FanucA),
        };
        let factor = if absolute == b'X' { self.state.to_diameter(is_relative) } else { 1.0 };
        let length = factor * self.length(word);
        if !is_relative {
            return Some(length);
        }
        if from.is_none() {
            self.lost(word.spot);
        }
        from.map(|from| from + length)
    }

    /// The tool is nobody knows where; said once until that is known again.
    pub(super) fn lost(&mut self, spot: Spot<'a>) {
        if !self.is_doubtful {
            self.notes.fault(spot, "position_unknown");
        }
        self.is_doubtful = true;
    }

    /// The first word of an axis.
    pub(super) fn first_axis(words: &Words<'_, 'a>) -> Option<Spot<'a>> {
        words.block.words.iter().find(|word| matches!(word.letter, b'X' | b'Z' | b'U' | b'W')).map(|word| word.spot)
    }

    pub(super) fn act(&mut self, words: &mut Words<'_, 'a>, asked: &Asked<'a>) -> Result<Option<usize>, Failure> {
        let line = words.block.line;
        // A motion that is named holds on, whatever this block does beside it.
        if let Some((motion, _)) = asked.motion {
            if motion == Motion::Drill && self.state.motion != Some(Motion::Drill) {
                self.state.before_drill = self.state.motion;
            }
            self.state.motion = Some(motion);
        }
        if let Some((code, kind, spot)) = asked.passed {
            self.notes.warn(spot, code);
            words.take_rest();
            // Where such a cycle ends, its own words say.
            self.go(line, kind, Place::default(), None);
            return Ok(None);
        }
        let Some((once, spot)) = asked.once else {
            self.move_by(words, asked);
            return Ok(None);
        };
        match once {
            Once::Dwell => {
                words.take_all("XUPFS");
                self.go(line, Kind::Dwell, self.state.place, None);
            }
            Once::Home => self.home(words, true),
            Once::MachinePlace => self.home(words, false),
            Once::Limit => {
                words.take_all("PQ");
            }
            Once::ThreadRepeated => {
                self.notes.warn(spot, "thread_passed");
                words.take_rest();
                self.go(line, Kind::Thread, self.state.place, None);
            }
            Once::Groove => {
                self.notes.warn(spot, "cycle_passed");
                words.take_rest();
                self.go(line, Kind::Opaque, self.state.place, None);
            }
            Once::RoughAlong => return self.rough(words, spot, Use::RoughZ),
            Once::RoughAcross => return self.rough(words, spot, Use::RoughX),
            Once::Pattern => return self.rough(words, spot, Use::Pattern),
            Once::Finish => return self.finish(words, spot),
        }
        Ok(None)
    }

    /// To a place of the machine. The axes that are named are then the control's business alone, all of them if none is.
    fn home(&mut self, words: &mut Words<'_, 'a>, by_way: bool) {
        let line = words.block.line;
        let named = |letters: [u8; 2]| letters.iter().any(|&letter| words.look(letter).is_some());
        let (x, z) = (named([b'X', b'U']), named([b'Z', b'W']));
        let (x, z) = if x || z { (x, z) } else { (true, true) };
        let before = self.state.place;
        // To the point that the words say, and home from there. Siemens' words say the point itself.
        if by_way && self.dialect != Dialect::Siemens {
            let was_doubtful = std::mem::replace(&mut self.is_doubtful, true);
            let way = self.target(words);
            self.is_doubtful = was_doubtful;
            if way != before {
                self.go(line, Kind::Rapid, way, None);
            }
        }
        words.take_all("XZUW");
        let after = self.state.place;
        let place = Place { x: after.x.filter(|_| !x), z: after.z.filter(|_| !z) };
        self.go(line, Kind::Home, place, None);
    }

    fn move_by(&mut self, words: &mut Words<'_, 'a>, asked: &Asked<'a>) {
        let Some(first) = Self::first_axis(words) else {
            // A full circle names no end; a cycle without an end of its own does nothing.
            if let Some((Motion::Path(path @ (Path::Clockwise | Path::CounterClockwise)), spot)) = asked.motion
                && (words.look(b'I').is_some() || words.look(b'K').is_some())
            {
                self.path_to(words, asked, path, spot);
            }
            return;
        };
        let Some(motion) = self.state.motion else {
            if !self.is_doubtful {
                self.notes.fault(first, "motion_not_said");
            }
            words.take_rest();
            return;
        };
        let line = words.block.line;
        self.assume_modes(first);
        match motion {
            Motion::Path(path) => self.path_to(words, asked, path, first),
            Motion::Thread => {
                self.warn_named(asked, "thread_passed");
                let end = self.target(words);
                words.take_rest();
                self.go(line, Kind::Thread, end, None);
            }
            Motion::ThreadCycle => {
                self.warn_named(asked, "thread_passed");
                words.take_rest();
                self.go(line, Kind::Thread, self.state.place, None);
            }
            Motion::Drill => {
                self.warn_named(asked, "cycle_passed");
                words.take_rest();
                self.go(line, Kind::Opaque, self.state.place, None);
            }
            Motion::Nowhere => {
                if !self.is_doubtful {
                    self.notes.fault(first, "motion_not_said");
                }
                words.take_rest();
            }
            Motion::Single { across, words: kept } => {
                self.single(words, first, (across, asked.motion.is_some()), kept);
            }
        }
    }

    fn warn_named(&mut self, asked: &Asked<'a>, code: &'static str) {
        if let Some((_, spot)) = asked.motion {
            self.notes.warn(spot, code);
        }
    }

    /// Says what the first motion takes for granted.
    fn assume_modes(&mut self, spot: Spot<'a>) {
        let said = self.state.said;
        if !said.units {
            self.notes.assume(spot, "units", "mm");
        }
        if !said.plane {
            self.notes.assume(spot, "plane", "G18");
        }
        if !said.width {
            self.notes.assume(spot, "x_words", "diameter");
        }
    }

    /// Whether a move at the feed can be read: it needs a place to begin at, and a feed.
    pub(super) fn may_cut(&mut self, spot: Spot<'a>, end: Place) -> bool {
        if self.state.place.known().is_none() || end.known().is_none() {
            self.lost(spot);
            return false;
        }
        if !self.state.said.feed_mode {
            self.notes.assume(spot, "feed_mode", if self.state.per_minute { "per_min" } else { "per_rev" });
        }
        if self.state.tool.is_none() {
            let named = self.reading.tool.clone().map(|name| self.tool_named(name));
            self.state.tool = named;
            if named.is_none() {
                self.notes.assume(spot, "tool", "none");
            }
        }
        let is_roughed = matches!(self.contour, Some(Use::RoughZ | Use::RoughX | Use::Pattern));
        if self.state.feed.is_none() && !is_roughed {
            if !self.is_doubtful {
                self.notes.fault(spot, "feed_missing");
            }
            // Once is enough: nothing comes of a program with a fault.
            self.state.feed = Some(Feed::PerRev(1.0));
        }
        true
    }

    fn path_to(&mut self, words: &mut Words<'_, 'a>, asked: &Asked<'a>, path: Path, spot: Spot<'a>) {
        let line = words.block.line;
        let end = self.target(words);
        let before = self.moves.len();
        match path {
            Path::Rapid => self.go(line, Kind::Rapid, end, None),
            Path::Line => {
                if self.may_cut(spot, end) {
                    self.go(line, Kind::Line, end, None);
                }
            }
            Path::Clockwise | Path::CounterClockwise => {
                let of_arc = self.centre(words, asked, end, path);
                if self.may_cut(spot, end)
                    && let Some(centre) = of_arc
                {
                    let kind = if path == Path::Clockwise { Kind::ArcCw } else { Kind::ArcCcw };
                    self.go(line, kind, end, Some([2.0 * centre[0], centre[1]]));
                }
            }
        }
        if self.moves.len() > before {
            self.keep_words(words, asked.motion.is_some());
        }
        if end.known().is_some() {
            // A later fault is one of its own.
            self.is_doubtful = false;
        }
        self.state.place = end;
    }

    /// Centre of an arc: radius and z, mm.
    fn centre(&mut self, words: &mut Words<'_, 'a>, asked: &Asked<'a>, end: Place, path: Path) -> Option<[f64; 2]> {
        let radius = match self.dialect {
            Dialect::Siemens => words.block.words.iter().find(|word| word.is_named("CR")).copied(),
            _ => words.take(b'R'),
        };
        let (i, k) = (words.take(b'I'), words.take(b'K'));
        let spot = radius.or(i).or(k).map(|word| word.spot).or(asked.motion.map(|(_, spot)| spot));
        let spot = spot.or_else(|| Self::first_axis(words))?;
        let i_mm = i.map(|word| (word, self.length(word)));
        let k_mm = k.map(|word| (word, self.length(word)));
        let radius_mm = radius.map(|word| self.length(word));
        let ([x0, z0], [x1, z1]) = (self.state.place.known()?, end.known()?);
        let (from, to) = ([0.5 * x0, z0], [0.5 * x1, z1]);
        match (radius_mm, i_mm, k_mm) {
            (Some(radius), None, None) if arcs::are_apart(from, to) => {
                let found = arcs::centre_of_radius(from, to, radius, path);
                if found.is_none() {
                    self.notes.fault(spot, "arc_radius_too_small");
                }
                found
            }
            (None, i, k) if i.is_some() || k.is_some() => {
                let absolute = self.state.centre_absolute;
                let of = |given: Option<(Word<'a>, f64)>, start: f64| match given {
                    Some((word, length)) if absolute || matches!(word.operand, Operand::Absolute(_)) => length,
                    Some((_, length)) => start + length,
                    // An absolute centre needs both words; one that is left out of a relative one is 0.
                    None => start,
                };
                let centre = [of(i, from[0]), of(k, from[1])];
                if !arcs::fits(from, to, centre) {
                    self.notes.fault(spot, "arc_radius_mismatch");
                    return None;
                }
                Some(centre)
            }
            _ => {
                self.notes.fault(spot, "arc_not_defined");
                None
            }
        }
    }
}
