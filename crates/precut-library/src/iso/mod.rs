//! Designations of inserts (ISO 1832), of holders (ISO 5608) and of boring bars (ISO 6261).

mod holder;
mod insert;
mod pair;

pub use holder::{Bar, BarMaterial, Hand, Holder, Shank};
pub use insert::{Corner, Insert};
pub use pair::{Geometry, fit};

use precut_calc::calculator::Finding;

/// A fault of a designation: its code, the position where it is, and what would be allowed there.
#[derive(Debug, Clone, PartialEq)]
pub struct CodeFault {
    /// Code of the fault.
    pub code: &'static str,
    /// Position in the designation, from 0: of an insert the letter, of a holder the element of the standard.
    pub at: usize,
    /// What stands there.
    pub found: String,
    /// What may stand there; empty where it is a pattern.
    pub allowed: &'static str,
}

impl CodeFault {
    fn new(code: &'static str, at: usize, found: impl Into<String>, allowed: &'static str) -> Self {
        Self { code, at, found: found.into(), allowed }
    }

    /// The fault as one of the field at `pointer` that holds `designation`.
    pub fn finding(self, pointer: &str, designation: &str) -> Finding {
        let finding = Finding::new(self.code, pointer)
            .with("designation", shown(designation))
            .with("position", self.at + 1)
            .with("received", shown(&self.found));
        match self.allowed {
            "" => finding,
            letters => finding.with("allowed", letters.split(' ').collect::<Vec<_>>()),
        }
    }
}

/// What two designations say.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Read {
    /// The insert.
    pub insert: Option<Insert>,
    /// The holder or bar.
    pub holder: Option<Holder>,
    /// What follows from both together.
    pub geometry: Option<Geometry>,
    /// Faults, at `/insert` and `/holder`.
    pub faults: Vec<Finding>,
}

/// Reads the designation of an insert, of a holder, or of both that are to fit.
pub fn read(insert: Option<&str>, holder: Option<&str>) -> Read {
    let mut read = Read::default();
    if let Some(code) = insert {
        match code.parse::<Insert>() {
            Ok(parsed) => read.insert = Some(parsed),
            Err(fault) => read.faults.push(fault.finding("/insert", code)),
        }
    }
    if let Some(code) = holder {
        match code.parse::<Holder>() {
            Ok(parsed) => read.holder = Some(parsed),
            Err(fault) => read.faults.push(fault.finding("/holder", code)),
        }
    }
    if let (Some(insert), Some(holder)) = (&read.insert, &read.holder) {
        match fit(insert, holder) {
            Ok(geometry) => read.geometry = Some(geometry),
            Err(finding) => read.faults.push(*finding),
        }
    }
    read
}

/// A text cut to what fits in a sentence.
fn shown(text: &str) -> String {
    text.chars().take(64).collect()
}

/// The signs of a designation: no blanks, upper case, what is neither letter nor digit nor dash as `?`. Longer ones than
/// any designation are cut, which makes them none.
fn plain(text: &str) -> Vec<u8> {
    let sign = |letter: char| match u8::try_from(letter.to_ascii_uppercase()) {
        Ok(byte) if byte.is_ascii_alphanumeric() || byte == b'-' => byte,
        _ => b'?',
    };
    let mut signs: Vec<u8> = text.chars().filter(|letter| *letter != ' ').map(sign).take(65).collect();
    if signs.len() > 64 {
        signs.truncate(64);
        signs.push(b'?');
    }
    signs
}

/// The value of a letter in a table.
fn look<T: Copy>(table: &[(u8, T)], letter: u8) -> Option<T> {
    table.iter().find(|row| row.0 == letter).map(|row| row.1)
}

const SHAPES: &str = "A B C D E H K L M O P R S T V W";
const CLEARANCES: &str = "A B C D E F G N P O";

/// Included angle of a shape, degrees; a round one has none.
fn included_angle_deg(shape: u8) -> Option<f64> {
    const ANGLES: &[(u8, f64)] = &[
        (b'A', 85.0),
        (b'B', 82.0),
        (b'C', 80.0),
        (b'D', 55.0),
        (b'E', 75.0),
        (b'H', 120.0),
        (b'K', 55.0),
        (b'L', 90.0),
        (b'M', 86.0),
        (b'O', 135.0),
        (b'P', 108.0),
        (b'S', 90.0),
        (b'T', 60.0),
        (b'V', 35.0),
        (b'W', 80.0),
    ];
    look(ANGLES, shape)
}

fn is_shape(letter: u8) -> bool {
    letter == b'R' || included_angle_deg(letter).is_some()
}

/// Clearance angle of a letter, degrees; `Some(None)` for the special one.
#[allow(clippy::option_option)] // no such letter, a letter that says no angle, an angle
fn clearance_deg(letter: u8) -> Option<Option<f64>> {
    const ANGLES: &[(u8, Option<f64>)] = &[
        (b'A', Some(3.0)),
        (b'B', Some(5.0)),
        (b'C', Some(7.0)),
        (b'D', Some(15.0)),
        (b'E', Some(20.0)),
        (b'F', Some(25.0)),
        (b'G', Some(30.0)),
        (b'N', Some(0.0)),
        (b'P', Some(11.0)),
        (b'O', None),
    ];
    look(ANGLES, letter)
}
