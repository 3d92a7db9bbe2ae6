//! ISO 1832: indexable inserts.

use std::fmt;
use std::str::FromStr;

use super::{CLEARANCES, CodeFault, SHAPES, clearance_deg, included_angle_deg, is_shape, look, plain};

const TOLERANCES: &str = "A F C H E G J K L M U N";
const TYPES: &str = "N R F A M G W T Q U B H C J X";
const THICKNESSES: &str = "01 T1 02 T2 03 T3 04 05 06 07 09 12";
/// Inscribed circles, mm.
const CIRCLES_MM: [f64; 11] = [3.97, 4.76, 5.56, 6.35, 7.94, 9.525, 12.7, 15.875, 19.05, 25.4, 31.75];

/// Position 7: the corner.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Corner {
    /// Nothing is said.
    Unsaid,
    /// Nose radius in tenths of a millimetre.
    Tenths(u8),
    /// A wiper edge: letters of its angle and of its clearance.
    Wiper(u8, u8),
    /// A round insert whose size is in mm.
    RoundMetric,
    /// A round insert whose size is in inches.
    RoundInch,
}

/// The designation of an insert.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Insert {
    /// Shape.
    pub shape: char,
    /// Letter of the clearance angle.
    pub clearance: char,
    /// Tolerance class.
    pub tolerance_class: char,
    /// Type: chip breakers and hole.
    pub kind: char,
    /// Size, two digits.
    pub size: u8,
    /// Thickness, two signs.
    thickness: [u8; 2],
    /// Corner.
    pub corner: Corner,
    /// Condition of the edge.
    pub edge_condition: Option<char>,
    /// Hand.
    pub direction: Option<char>,
    /// What the maker adds.
    pub maker: Option<String>,
}

impl FromStr for Insert {
    type Err = CodeFault;

    fn from_str(text: &str) -> Result<Self, CodeFault> {
        let code = plain(text);
        let letter = |at: usize, known: &dyn Fn(u8) -> bool, fault, allowed| match code.get(at) {
            Some(&byte) if known(byte) => Ok(char::from(byte)),
            other => Err(CodeFault::new(
                fault,
                at,
                other.map_or(String::new(), |byte| char::from(*byte).to_string()),
                allowed,
            )),
        };
        let in_list = |list: &'static str| move |byte: u8| list.bytes().any(|letter| letter == byte && byte != b' ');
        let shape = letter(0, &is_shape, "bad_insert_shape", SHAPES)?;
        let clearance = letter(1, &|byte| clearance_deg(byte).is_some(), "bad_insert_clearance", CLEARANCES)?;
        let tolerance_class = letter(2, &in_list(TOLERANCES), "bad_insert_tolerance", TOLERANCES)?;
        let kind = letter(3, &in_list(TYPES), "bad_insert_type", TYPES)?;
        let rest = text_of(&code[4..]);
        let tail = split(&code[4..]).ok_or_else(|| CodeFault::new("bad_insert_code", 4, rest, ""))?;
        if thickness_mm(tail.thickness).is_none() {
            return Err(CodeFault::new("bad_insert_thickness", 6, text_of(&tail.thickness), THICKNESSES));
        }
        let corner = corner(tail.corner, shape == 'R').ok_or_else(|| {
            CodeFault::new("bad_insert_corner", 8, tail.corner.map_or(String::new(), |c| text_of(&c)), "")
        })?;
        Ok(Self {
            shape,
            clearance,
            tolerance_class,
            kind,
            size: tail.size,
            thickness: tail.thickness,
            corner,
            edge_condition: tail.edge.map(char::from),
            direction: tail.direction.map(char::from),
            maker: tail.maker,
        })
    }
}

fn text_of(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| char::from(*byte)).collect()
}

/// What stands behind the four letters, by its form alone.
struct Tail {
    size: u8,
    thickness: [u8; 2],
    corner: Option<[u8; 2]>,
    edge: Option<u8>,
    direction: Option<u8>,
    maker: Option<String>,
}

fn split(code: &[u8]) -> Option<Tail> {
    let (head, maker) = match code.iter().position(|byte| *byte == b'-') {
        Some(at) => (&code[..at], Some(&code[at + 1..])),
        None => (code, None),
    };
    let &[tens, units, first, second, ref rest @ ..] = head else { return None };
    let is_thickness = (first.is_ascii_digit() || first == b'T') && second.is_ascii_digit();
    if !tens.is_ascii_digit() || !units.is_ascii_digit() || !is_thickness {
        return None;
    }
    let (corner, rest) = match rest {
        [a, b, rest @ ..] if is_corner(*a, *b) => (Some([*a, *b]), rest),
        rest => (None, rest),
    };
    let (edge, rest) = match rest {
        [letter, rest @ ..] if b"FETSKP".contains(letter) => (Some(*letter), rest),
        rest => (None, rest),
    };
    let (direction, rest) = match rest {
        [letter, rest @ ..] if b"RLN".contains(letter) => (Some(*letter), rest),
        rest => (None, rest),
    };
    let maker = match maker {
        None => None,
        Some([]) => return None,
        Some(letters) => Some(text_of(letters)),
    };
    let size = 10 * (tens - b'0') + (units - b'0');
    rest.is_empty().then_some(Tail { size, thickness: [first, second], corner, edge, direction, maker })
}

/// Two digits, two letters, or `M0`.
fn is_corner(first: u8, second: u8) -> bool {
    (first.is_ascii_digit() && second.is_ascii_digit())
        || (first.is_ascii_uppercase() && second.is_ascii_uppercase())
        || (first, second) == (b'M', b'0')
}

fn corner(signs: Option<[u8; 2]>, round: bool) -> Option<Corner> {
    let Some([first, second]) = signs else { return Some(Corner::Unsaid) };
    match (first, second) {
        (b'M', b'0') => round.then_some(Corner::RoundMetric),
        (b'0', b'0') if round => Some(Corner::RoundInch),
        _ if first.is_ascii_digit() => Some(Corner::Tenths(10 * (first - b'0') + (second - b'0'))),
        _ => (wiper_angle_deg(first).is_some() && clearance_deg(second).is_some())
            .then_some(Corner::Wiper(first, second)),
    }
}

fn wiper_angle_deg(letter: u8) -> Option<f64> {
    const ANGLES: &[(u8, f64)] = &[(b'A', 45.0), (b'D', 60.0), (b'E', 75.0), (b'F', 85.0), (b'G', 87.0), (b'P', 90.0)];
    look(ANGLES, letter)
}

fn thickness_mm(signs: [u8; 2]) -> Option<f64> {
    Some(match &signs {
        b"01" => 1.59,
        b"T1" => 1.98,
        b"02" => 2.38,
        b"T2" => 2.78,
        b"03" => 3.18,
        b"T3" => 3.97,
        b"04" => 4.76,
        b"05" => 5.56,
        b"06" => 6.35,
        b"07" => 7.94,
        b"09" => 9.52,
        b"12" => 12.7,
        _ => return None,
    })
}

/// Breakers, whether there is a hole, whether both sides can be used.
fn of_type(letter: char) -> Option<(u8, bool, bool)> {
    Some(match letter {
        'N' => (0, false, true),
        'R' => (1, false, false),
        'F' => (2, false, true),
        'A' | 'Q' | 'C' => (0, true, true),
        'M' | 'T' | 'H' => (1, true, false),
        'G' | 'U' | 'J' => (2, true, true),
        'W' | 'B' => (0, true, false),
        _ => return None,
    })
}

impl Insert {
    /// Angle between main and minor edge, degrees; none of a round one.
    pub fn included_angle_deg(&self) -> Option<f64> {
        included_angle_deg(byte(self.shape))
    }

    /// Clearance angle, degrees; a special one is not said.
    pub fn clearance_angle_deg(&self) -> Option<f64> {
        clearance_deg(byte(self.clearance)).flatten()
    }

    /// Faces with a chip breaker.
    pub fn chip_breaker_faces(&self) -> Option<u8> {
        of_type(self.kind).map(|row| row.0)
    }

    /// Whether there is a hole.
    pub fn has_hole(&self) -> Option<bool> {
        of_type(self.kind).map(|row| row.1)
    }

    /// Whether both sides can be used.
    pub fn is_double_sided(&self) -> Option<bool> {
        of_type(self.kind).map(|row| row.2)
    }

    /// Thickness, mm.
    pub fn thickness_mm(&self) -> Option<f64> {
        thickness_mm(self.thickness)
    }

    /// Whether it is round.
    pub fn is_round(&self) -> bool {
        self.shape == 'R'
    }

    /// Angle of a wiper edge, and its clearance, degrees.
    pub fn wiper_deg(&self) -> Option<(f64, Option<f64>)> {
        let Corner::Wiper(angle, clearance) = self.corner else { return None };
        Some((wiper_angle_deg(angle)?, clearance_deg(clearance).flatten()))
    }

    /// Diameter of the inscribed circle, mm; `None` where the size fits none or two.
    pub fn inscribed_circle_mm(&self) -> Option<f64> {
        match (self.shape, self.corner) {
            ('R', Corner::RoundMetric) => return Some(f64::from(self.size)),
            ('R', Corner::RoundInch) => {}
            ('R' | 'A' | 'B' | 'K' | 'L', _) => return None,
            ('W', _) => {
                const SIZES: &[(u8, f64)] = &[(4, 6.35), (5, 7.94), (6, 9.525), (8, 12.7), (10, 15.875), (13, 19.05)];
                return look(SIZES, self.size);
            }
            _ => {}
        }
        let fits = |circle: &&f64| self.edge_of(**circle).trunc().to_bits() == f64::from(self.size).to_bits();
        let mut fitting = CIRCLES_MM.iter().filter(fits);
        fitting.next().copied().filter(|_| fitting.next().is_none())
    }

    /// Length of an edge, mm, to hundredths as the standard's tables have it.
    pub fn cutting_edge_length_mm(&self) -> Option<f64> {
        if matches!(self.shape, 'R' | 'W') {
            return None;
        }
        self.inscribed_circle_mm().map(|circle| self.edge_of(circle))
    }

    /// Length of the edge about an inscribed circle; of a round one its diameter.
    fn edge_of(&self, circle_mm: f64) -> f64 {
        let length = match (self.shape, self.included_angle_deg()) {
            ('T', _) => circle_mm * 3.0_f64.sqrt(),
            ('H', _) => circle_mm / 3.0_f64.sqrt(),
            ('O', _) => circle_mm * 0.4142,
            ('P', _) => circle_mm * 0.7265,
            ('C' | 'D' | 'E' | 'M' | 'V', Some(angle)) => circle_mm / angle.to_radians().sin(),
            _ => circle_mm,
        };
        (100.0 * length).round() / 100.0
    }

    /// Nose radius, mm; of a round insert half its circle.
    pub fn nose_radius_mm(&self) -> Option<f64> {
        match self.corner {
            Corner::Tenths(tenths) if !self.is_round() => Some(f64::from(tenths) / 10.0),
            Corner::RoundMetric | Corner::RoundInch => self.inscribed_circle_mm().map(|circle| 0.5 * circle),
            _ => None,
        }
    }
}

/// The byte of a letter of a code; all of them are ASCII.
fn byte(letter: char) -> u8 {
    u8::try_from(letter).unwrap_or(b' ')
}

impl fmt::Display for Insert {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}{}{}{:02}", self.shape, self.clearance, self.tolerance_class, self.kind, self.size)?;
        f.write_str(&text_of(&self.thickness))?;
        match self.corner {
            Corner::Unsaid => {}
            Corner::Tenths(tenths) => write!(f, "{tenths:02}")?,
            Corner::Wiper(angle, clearance) => f.write_str(&text_of(&[angle, clearance]))?,
            Corner::RoundMetric => f.write_str("M0")?,
            Corner::RoundInch => f.write_str("00")?,
        }
        self.edge_condition.iter().chain(&self.direction).try_for_each(|letter| write!(f, "{letter}"))?;
        self.maker.iter().try_for_each(|maker| write!(f, "-{maker}"))
    }
}
