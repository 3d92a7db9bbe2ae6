//! Single cycles: to the depth, along the work, out and back (`program/2.3`).

use super::Reader;
use super::block::Words;
use super::faults::Spot;
use super::moves::{Kind, Place};
use super::state::{Motion, SingleWords};

impl<'a> Reader<'a> {
    /// A pass and its way back. What it is told holds for the next lines until another motion is named.
    pub(super) fn single(
        &mut self,
        words: &mut Words<'_, 'a>,
        first: Spot<'a>,
        (across, names_motion): (bool, bool),
        mut kept: SingleWords,
    ) {
        let line = words.block.line;
        let from = self.state.place;
        let named = |letters: [u8; 2]| letters.iter().any(|&letter| words.look(letter).is_some());
        let (names_x, names_z) = (named([b'X', b'U']), named([b'Z', b'W']));
        let end = self.target(words);
        kept.x = if names_x { end.x } else { kept.x };
        kept.z = if names_z { end.z } else { kept.z };
        let taper = words.take(b'R').or_else(|| words.take(if across { b'K' } else { b'I' }));
        if let Some(word) = taper {
            kept.taper = self.length(word);
        }
        self.state.motion = Some(Motion::Single { across, words: kept });
        let end = Place { x: kept.x, z: kept.z };
        if from.known().is_some() && end.known().is_none() {
            if !self.is_doubtful {
                self.notes.fault(first, "cycle_word_missing");
            }
            return;
        }
        let (true, Some([x0, z0]), Some([x, z])) = (self.may_cut(first, end), from.known(), end.known()) else {
            return;
        };
        let made = (self.moves.len(), self.state.speed());
        if across {
            self.go(line, Kind::Rapid, Place::at(x0, z + kept.taper), None);
            self.go(line, Kind::Line, Place::at(x, z), None);
            self.go(line, Kind::Line, Place::at(x, z0), None);
        } else {
            self.go(line, Kind::Rapid, Place::at(x + 2.0 * kept.taper, z0), None);
            self.go(line, Kind::Line, Place::at(x, z), None);
            self.go(line, Kind::Line, Place::at(x0, z), None);
        }
        self.go(line, Kind::Rapid, Place::at(x0, z0), None);
        self.keep_call(words, made, names_motion);
    }
}
