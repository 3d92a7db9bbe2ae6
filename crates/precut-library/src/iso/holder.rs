//! ISO 5608: turning holders; ISO 6261: boring bars.

use std::fmt;
use std::str::FromStr;

use super::{CLEARANCES, CodeFault, SHAPES, clearance_deg, is_shape, look, plain};

const CLAMPINGS: &str = "C D M P S W X";
const STYLES: &str = "A B C D E F G H J K L M N P R S T U V W Y X";
const LENGTHS: &str = "A B C D E F G H J K L M N P Q R S T U V W Y X";
/// Styles of end-cutting holders: their main edge faces.
const FACING: &[u8] = b"CFKUWY";

/// Hand of a holder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hand {
    /// Right.
    Right,
    /// Left.
    Left,
    /// Neutral.
    Neutral,
}

impl Hand {
    /// Its word.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Right => "right",
            Self::Left => "left",
            Self::Neutral => "neutral",
        }
    }

    const fn letter(self) -> char {
        match self {
            Self::Right => 'R',
            Self::Left => 'L',
            Self::Neutral => 'N',
        }
    }

    const fn of(letter: u8) -> Option<Self> {
        match letter {
            b'R' => Some(Self::Right),
            b'L' => Some(Self::Left),
            b'N' => Some(Self::Neutral),
            _ => None,
        }
    }
}

/// What a bar is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BarMaterial {
    /// Steel.
    Steel,
    /// Cemented carbide.
    Carbide,
    /// Heavy metal.
    HeavyMetal,
}

impl BarMaterial {
    /// Its word.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Steel => "steel",
            Self::Carbide => "carbide",
            Self::HeavyMetal => "heavy_metal",
        }
    }

    /// Modulus of elasticity, N/mm²: a judgement (`library/4`); of heavy metal (tungsten with nickel and iron) too.
    pub const fn youngs_modulus_n_per_mm2(self) -> f64 {
        match self {
            Self::Steel => 210_000.0,
            Self::Carbide => 600_000.0,
            Self::HeavyMetal => 350_000.0,
        }
    }
}

/// The bar of a boring tool.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bar {
    letter: u8,
    /// Its diameter, mm.
    pub diameter_mm: u8,
}

impl Bar {
    /// What it is made of.
    pub const fn material(self) -> BarMaterial {
        match self.letter {
            b'C' | b'E' | b'F' | b'G' => BarMaterial::Carbide,
            b'H' | b'J' => BarMaterial::HeavyMetal,
            _ => BarMaterial::Steel,
        }
    }

    /// Whether coolant comes through it.
    pub const fn has_coolant(self) -> bool {
        matches!(self.letter, b'A' | b'D' | b'E' | b'G' | b'J')
    }

    /// Whether it damps vibration.
    pub const fn is_damped(self) -> bool {
        matches!(self.letter, b'B' | b'D' | b'F' | b'G')
    }
}

/// Height and width of a shank, mm.
pub type Shank = (u8, u8);

/// The designation of a holder or of a bar.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Holder {
    /// Clamping of the insert.
    pub clamping: char,
    /// Shape of its insert.
    pub shape: char,
    /// Style: the edge angle.
    pub style: char,
    /// Letter of the insert's clearance angle.
    pub clearance: char,
    /// Hand.
    pub hand: Hand,
    /// Height and width of its shank, mm; a bar has none.
    pub shank_mm: Option<Shank>,
    /// The bar.
    pub bar: Option<Bar>,
    /// Letter of the length.
    pub length: char,
    /// Size of its insert, two digits.
    pub insert_size: u8,
    /// What the maker adds.
    pub maker: Option<String>,
}

/// The angle of the main edge of a style, degrees; `Some(None)` where the style does not say it.
#[allow(clippy::option_option)] // no such style, a style that says no angle, an angle
fn style_deg(letter: u8) -> Option<Option<f64>> {
    const ANGLES: &[(u8, Option<f64>)] = &[
        (b'A', Some(90.0)),
        (b'B', Some(75.0)),
        (b'C', Some(90.0)),
        (b'D', Some(45.0)),
        (b'E', Some(60.0)),
        (b'F', Some(90.0)),
        (b'G', Some(90.0)),
        (b'H', Some(107.5)),
        (b'J', Some(93.0)),
        (b'K', Some(75.0)),
        (b'L', Some(95.0)),
        (b'M', Some(50.0)),
        (b'N', Some(63.0)),
        (b'P', Some(117.5)),
        (b'R', Some(75.0)),
        (b'S', Some(45.0)),
        (b'T', Some(60.0)),
        (b'U', Some(93.0)),
        (b'V', Some(72.5)),
        (b'W', Some(60.0)),
        (b'Y', Some(85.0)),
        (b'X', None),
    ];
    look(ANGLES, letter)
}

#[allow(clippy::option_option)] // no such letter, a letter that says no length, a length
fn length_mm(letter: u8) -> Option<Option<f64>> {
    const MM: &[u16] =
        &[32, 40, 50, 60, 70, 80, 90, 100, 110, 125, 140, 150, 160, 170, 180, 200, 250, 300, 350, 400, 450, 500];
    if letter == b'X' {
        return Some(None);
    }
    let at = LENGTHS.split(' ').position(|word| word.as_bytes() == [letter])?;
    MM.get(at).map(|mm| Some(f64::from(*mm)))
}

impl FromStr for Holder {
    type Err = CodeFault;

    fn from_str(text: &str) -> Result<Self, CodeFault> {
        let unreadable = || CodeFault::new("bad_holder_code", 0, text, "");
        let parts = split(&plain(text)).ok_or_else(unreadable)?;
        let [clamping, shape, style, clearance] = parts.letters;
        let check = |known: bool, fault, at, letter: u8, allowed| {
            if known { Ok(char::from(letter)) } else { Err(CodeFault::new(fault, at, char::from(letter), allowed)) }
        };
        Ok(Self {
            clamping: check(b"CDMPSWX".contains(&clamping), "bad_holder_clamping", 0, clamping, CLAMPINGS)?,
            shape: check(is_shape(shape), "bad_holder_shape", 1, shape, SHAPES)?,
            style: check(style_deg(style).is_some(), "unknown_holder_style", 2, style, STYLES)?,
            clearance: check(clearance_deg(clearance).is_some(), "bad_holder_clearance", 3, clearance, CLEARANCES)?,
            hand: parts.hand,
            shank_mm: parts.shank_mm,
            bar: parts.bar,
            length: check(length_mm(parts.length).is_some(), "bad_holder_length", 7, parts.length, LENGTHS)?,
            insert_size: parts.insert_size,
            maker: parts.maker,
        })
    }
}

/// The elements by their form alone.
struct Parts {
    letters: [u8; 4],
    hand: Hand,
    shank_mm: Option<Shank>,
    bar: Option<Bar>,
    length: u8,
    insert_size: u8,
    maker: Option<String>,
}

fn two_digits(tens: u8, units: u8) -> Option<u8> {
    (tens.is_ascii_digit() && units.is_ascii_digit()).then(|| 10 * (tens - b'0') + (units - b'0'))
}

fn split(code: &[u8]) -> Option<Parts> {
    split_bar(code).or_else(|| split_holder(code))
}

fn split_holder(code: &[u8]) -> Option<Parts> {
    let &[c, shape, style, clearance, hand, h1, h2, w1, w2, length, s1, s2, ref rest @ ..] = code else { return None };
    letters(&[c, shape, style, clearance, length])?;
    Some(Parts {
        letters: [c, shape, style, clearance],
        hand: Hand::of(hand)?,
        shank_mm: Some((two_digits(h1, h2)?, two_digits(w1, w2)?)),
        bar: None,
        length,
        insert_size: two_digits(s1, s2)?,
        maker: maker(rest)?,
    })
}

fn split_bar(code: &[u8]) -> Option<Parts> {
    let &[bar, d1, d2, length, b'-', c, shape, style, clearance, hand, s1, s2, ref rest @ ..] = code else {
        return None;
    };
    letters(&[c, shape, style, clearance, length])?;
    let known = b"SABCDEFGHJ".contains(&bar);
    Some(Parts {
        letters: [c, shape, style, clearance],
        hand: Hand::of(hand)?,
        shank_mm: None,
        bar: Some(Bar { letter: known.then_some(bar)?, diameter_mm: two_digits(d1, d2)? }),
        length,
        insert_size: two_digits(s1, s2)?,
        maker: maker(rest)?,
    })
}

fn letters(bytes: &[u8]) -> Option<()> {
    bytes.iter().all(u8::is_ascii_uppercase).then_some(())
}

/// What stands behind a dash; `None` where something else follows.
#[allow(clippy::option_option)] // a fault, nothing, a text
fn maker(rest: &[u8]) -> Option<Option<String>> {
    match rest {
        [] => Some(None),
        [b'-', tail @ ..] if !tail.is_empty() => Some(Some(tail.iter().map(|byte| char::from(*byte)).collect())),
        _ => None,
    }
}

impl Holder {
    /// Angle of the main edge to the feed, degrees; style X does not say it.
    pub fn cutting_edge_angle_deg(&self) -> Option<f64> {
        style_deg(byte(self.style)).flatten()
    }

    /// Clearance angle of its insert, degrees.
    pub fn clearance_angle_deg(&self) -> Option<f64> {
        clearance_deg(byte(self.clearance)).flatten()
    }

    /// Length of holder or bar, mm; X does not say it.
    pub fn length_mm(&self) -> Option<f64> {
        length_mm(byte(self.length)).flatten()
    }

    /// Whether its main edge cuts when facing: end-cutting styles of external holders.
    pub fn is_for_facing(&self) -> bool {
        self.bar.is_none() && FACING.contains(&byte(self.style))
    }
}

fn byte(letter: char) -> u8 {
    u8::try_from(letter).unwrap_or(b' ')
}

impl fmt::Display for Holder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(bar) = self.bar {
            write!(f, "{}{:02}{}-", char::from(bar.letter), bar.diameter_mm, self.length)?;
        }
        write!(f, "{}{}{}{}{}", self.clamping, self.shape, self.style, self.clearance, self.hand.letter())?;
        if let Some((height, width)) = self.shank_mm {
            write!(f, "{height:02}{width:02}{}", self.length)?;
        }
        write!(f, "{:02}", self.insert_size)?;
        self.maker.iter().try_for_each(|maker| write!(f, "-{maker}"))
    }
}
