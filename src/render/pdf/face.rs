//! Typefaces, and text as glyphs of them.
//!
//! The faces are in the program: a report looks the same on every machine, and may be kept for ever. Text is set in Noto
//! Sans, formulas and what it lacks in DejaVu Sans Mono; a character that neither has is written by its number, since an
//! archive must not hold glyphs without meaning.

use std::sync::{Arc, LazyLock};

use krilla::text::{Font, GlyphId, KrillaGlyph};
use rustybuzz::UnicodeBuffer;
use usvg::fontdb;

const REGULAR: &[u8] = include_bytes!("fonts/NotoSans-Regular.ttf");
const BOLD: &[u8] = include_bytes!("fonts/NotoSans-Bold.ttf");
const MONO: &[u8] = include_bytes!("fonts/DejaVuSansMono.ttf");

/// What pictures call the family that they are drawn with.
pub(super) const FAMILY: &str = "Noto Sans";

/// Which face a text is set in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Weight {
    Regular,
    Bold,
    /// Every character equally wide: formulas.
    Mono,
}

struct Face {
    font: Font,
    shaper: rustybuzz::Face<'static>,
    units_per_em: f32,
}

impl Face {
    fn of(bytes: &'static [u8]) -> Self {
        let font = Font::new(bytes.into(), 0).expect("the faces in the program are tested");
        let shaper = rustybuzz::Face::from_slice(bytes, 0).expect("the faces in the program are tested");
        Self { units_per_em: font.units_per_em(), font, shaper }
    }

    fn has(&self, character: char) -> bool {
        self.shaper.glyph_index(character).is_some()
    }
}

static FACES: LazyLock<[Face; 3]> = LazyLock::new(|| [REGULAR, BOLD, MONO].map(Face::of));

/// The faces as pictures look for them.
pub(super) fn database() -> Arc<fontdb::Database> {
    static DATABASE: LazyLock<Arc<fontdb::Database>> = LazyLock::new(|| {
        let mut database = fontdb::Database::new();
        for face in [REGULAR, BOLD, MONO] {
            database.load_font_source(fontdb::Source::Binary(Arc::new(face)));
        }
        database.set_sans_serif_family(FAMILY);
        Arc::new(database)
    });
    Arc::clone(&DATABASE)
}

/// Glyphs of one face beside each other.
#[derive(Debug, Clone)]
pub(super) struct Run {
    face: usize,
    pub(super) text: String,
    pub(super) glyphs: Vec<KrillaGlyph>,
    /// In the size of the letters.
    pub(super) width: f32,
}

impl Run {
    pub(super) fn font(&self) -> Font {
        FACES[self.face].font.clone()
    }
}

/// A space at which no line ends.
pub(super) const GLUE: char = '\u{a0}';

/// Text as it can be set: white space is a space, what cannot be seen is left out, and what no face has is written by
/// its number.
pub(super) fn printable(text: &str) -> String {
    let mut printable = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            GLUE => printable.push(GLUE),
            c if c.is_whitespace() => printable.push(' '),
            '\u{ad}' | '\u{200b}'..='\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}' => {}
            // From right to left: lines here go the other way.
            '\u{590}'..='\u{8ff}' | '\u{fb1d}'..='\u{fdff}' | '\u{fe70}'..='\u{fefc}' => {
                printable.push_str(&numbered(character));
            }
            // Of private use: without a meaning to whom it was not told.
            '\u{e000}'..='\u{f8ff}' | '\u{f0000}'.. => printable.push_str(&numbered(character)),
            c if c.is_ascii_graphic() || FACES[0].has(c) || FACES[2].has(c) => printable.push(c),
            c => printable.push_str(&numbered(c)),
        }
    }
    printable
}

fn numbered(character: char) -> String {
    format!("U+{:04X}", u32::from(character))
}

/// The glyphs of a printable text.
pub(super) fn shaped(text: &str, weight: Weight) -> Vec<Run> {
    let first = match weight {
        Weight::Regular => 0,
        Weight::Bold => 1,
        Weight::Mono => 2,
    };
    let mut pieces: Vec<(usize, String)> = Vec::new();
    for character in text.chars() {
        let face = [first, 0, 2].into_iter().find(|face| FACES[*face].has(character)).unwrap_or(first);
        match pieces.last_mut() {
            Some((last, piece)) if *last == face => piece.push(character),
            _ => pieces.push((face, character.to_string())),
        }
    }
    pieces.into_iter().map(|(face, text)| run(face, text)).collect()
}

/// How wide a text is, in the size of its letters.
pub(super) fn width(text: &str, weight: Weight) -> f32 {
    shaped(text, weight).iter().map(|run| run.width).sum()
}

fn run(face: usize, text: String) -> Run {
    let Face { shaper, units_per_em, .. } = &FACES[face];
    let mut buffer = UnicodeBuffer::new();
    buffer.push_str(&text);
    buffer.set_direction(rustybuzz::Direction::LeftToRight);
    buffer.guess_segment_properties();
    let output = rustybuzz::shape(shaper, &[], buffer);
    let infos = output.glyph_infos();
    let ems = |units: i32| units as f32 / units_per_em;
    let mut glyphs = Vec::with_capacity(infos.len());
    for (index, (info, position)) in infos.iter().zip(output.glyph_positions()).enumerate() {
        let start = info.cluster as usize;
        let next = infos[index..].iter().map(|later| later.cluster as usize).find(|cluster| *cluster > start);
        glyphs.push(KrillaGlyph::new(
            GlyphId::new(info.glyph_id),
            ems(position.x_advance),
            ems(position.x_offset),
            ems(position.y_offset),
            ems(position.y_advance),
            start..next.unwrap_or(text.len()),
            None,
        ));
    }
    let width = output.glyph_positions().iter().map(|position| ems(position.x_advance)).sum();
    Run { face, text, glyphs, width }
}
