//! How text looks, and lines of it.

use krilla::color::rgb::Color;
use textwrap::core::Fragment;
use textwrap::wrap_algorithms::{Penalties, wrap_first_fit, wrap_optimal_fit};

use super::face::{self, GLUE, Run, Weight};

/// Face, size in points, colour.
#[derive(Debug, Clone, Copy)]
pub(super) struct Style {
    pub(super) weight: Weight,
    pub(super) size: f32,
    pub(super) color: (u8, u8, u8),
}

pub(super) const INK: (u8, u8, u8) = (0x1a, 0x1d, 0x21);
pub(super) const QUIET: (u8, u8, u8) = (0x5c, 0x64, 0x70);
pub(super) const ACCENT: (u8, u8, u8) = (0x00, 0x5a, 0x8f);
pub(super) const ALARM: (u8, u8, u8) = (0xb3, 0x45, 0x00);
pub(super) const RULE: (u8, u8, u8) = (0xb4, 0xbb, 0xc5);
pub(super) const FAINT: (u8, u8, u8) = (0xe1, 0xe5, 0xea);
pub(super) const TINT: (u8, u8, u8) = (0xee, 0xf4, 0xf9);
pub(super) const ALARM_TINT: (u8, u8, u8) = (0xfd, 0xf2, 0xe9);

pub(super) const TITLE: Style = style(Weight::Bold, 17.0, INK);
pub(super) const KICKER: Style = style(Weight::Bold, 9.0, ACCENT);
pub(super) const SUBJECT: Style = style(Weight::Regular, 9.5, QUIET);
pub(super) const VERDICT: Style = style(Weight::Bold, 11.5, INK);
pub(super) const HEADING: Style = style(Weight::Bold, 12.5, ACCENT);
pub(super) const GROUP: Style = style(Weight::Bold, 8.5, INK);
pub(super) const BODY: Style = style(Weight::Regular, 9.0, INK);
pub(super) const LABEL: Style = style(Weight::Regular, 8.0, QUIET);
pub(super) const VALUE: Style = style(Weight::Regular, 8.0, INK);
pub(super) const HEAD: Style = style(Weight::Bold, 7.2, INK);
pub(super) const CELL: Style = style(Weight::Regular, 7.2, INK);
pub(super) const NOTE: Style = style(Weight::Regular, 7.2, QUIET);
pub(super) const FORMULA: Style = style(Weight::Mono, 7.4, INK);
pub(super) const FOOT: Style = style(Weight::Regular, 6.5, QUIET);

const fn style(weight: Weight, size: f32, color: (u8, u8, u8)) -> Style {
    Style { weight, size, color }
}

/// Text on one line.
#[derive(Debug, Clone)]
pub(super) struct Line {
    pub(super) runs: Vec<Run>,
    pub(super) style: Style,
    /// Points.
    pub(super) width: f32,
}

impl Style {
    /// From one line to the next, points.
    pub(super) fn leading(self) -> f32 {
        (self.size * 1.38 * 4.0).round() / 4.0
    }

    /// From the top of a line to where its letters stand, points.
    pub(super) fn rise(self) -> f32 {
        self.size * 1.07
    }

    /// How wide a text is, points.
    pub(super) fn width(self, text: &str) -> f32 {
        face::width(text, self.weight) * self.size
    }

    /// The text on one line, however long.
    pub(super) fn line(self, text: &str) -> Line {
        let runs = face::shaped(&face::printable(text).replace(GLUE, " "), self.weight);
        let width = runs.iter().map(|run| run.width).sum::<f32>() * self.size;
        Line { runs, style: self, width }
    }

    /// The text in lines of at most `room` points; a word that is longer is broken.
    pub(super) fn lines(self, text: &str, room: f32) -> Vec<Line> {
        let text = face::printable(text);
        let space = f64::from(self.width(" "));
        let words: Vec<Word> = text
            .split(' ')
            .filter(|word| !word.is_empty())
            .flat_map(|word| self.broken(word, room))
            .map(|(text, is_end)| Word {
                width: self.width(&text).into(),
                space: if is_end { space } else { 0.0 },
                text,
            })
            .collect();
        let room = [f64::from(room)];
        let lines =
            wrap_optimal_fit(&words, &room, &Penalties::new()).unwrap_or_else(|_| wrap_first_fit(&words, &room));
        lines.into_iter().map(|line| self.line(&joined(line))).collect()
    }

    /// A word in pieces that fit, each with whether the word ends with it.
    fn broken(self, word: &str, room: f32) -> Vec<(String, bool)> {
        if self.width(word) <= room {
            return vec![(word.to_owned(), true)];
        }
        let mut pieces = vec![String::new()];
        let mut taken = 0.0;
        for character in word.chars() {
            let width = self.width(character.encode_utf8(&mut [0; 4]));
            if taken + width > room && taken > 0.0 {
                pieces.push(String::new());
                taken = 0.0;
            }
            taken += width;
            if let Some(piece) = pieces.last_mut() {
                piece.push(character);
            }
        }
        let last = pieces.len() - 1;
        pieces.into_iter().enumerate().map(|(index, piece)| (piece, index == last)).collect()
    }
}

pub(super) fn color((red, green, blue): (u8, u8, u8)) -> Color {
    Color::new(red, green, blue)
}

/// A word on its way into a line.
#[derive(Debug)]
struct Word {
    text: String,
    width: f64,
    space: f64,
}

impl Fragment for Word {
    fn width(&self) -> f64 {
        self.width
    }
    fn whitespace_width(&self) -> f64 {
        self.space
    }
    fn penalty_width(&self) -> f64 {
        0.0
    }
}

fn joined(words: &[Word]) -> String {
    let mut line = String::new();
    for word in words {
        line.push_str(&word.text);
        if word.space > 0.0 {
            line.push(' ');
        }
    }
    line.truncate(line.trim_end().len());
    line
}
