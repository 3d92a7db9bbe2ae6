//! Universal files: dataset 58 in ASCII and 58b in binary. Columns and codes are those of the format's own description
//! (SDRC, University of Cincinnati).

use nalgebra::Complex;

use crate::calculator::Finding;

use super::super::input::{Direction, Unit};
use super::{Function, Raw, Source};

/// Lines of a set before its values, its number included.
const HEAD_LINES: usize = 12;
/// A binary set whose bytes come with the first byte last.
const LITTLE_ENDIAN: usize = 1;
/// The other byte order.
const BIG_ENDIAN: usize = 2;
/// Numbers as IEEE 754 has them.
const IEEE: usize = 2;
/// Function types.
const FREQUENCY_RESPONSE: usize = 4;
const COHERENCE: usize = 6;
/// Kind of data of an abscissa that is a frequency.
const FREQUENCY: usize = 18;

/// Whether a file is a universal one: it begins with the mark of a set.
pub(super) fn is_uff(bytes: &[u8]) -> bool {
    let line = bytes.split(|byte| *byte == b'\n').find(|line| !line.trim_ascii().is_empty());
    line.is_some_and(|line| line.trim_ascii() == b"-1")
}

/// Where something stands in the file.
#[derive(Debug, Clone, Copy)]
struct Place {
    set: usize,
    byte: usize,
    line: usize,
}

/// A line of the file, and where the next one begins.
struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
    line: usize,
}

impl<'a> Lines<'a> {
    fn next(&mut self) -> Option<&'a [u8]> {
        let rest = self.bytes.get(self.at..).filter(|rest| !rest.is_empty())?;
        let length = rest.iter().position(|byte| *byte == b'\n').unwrap_or(rest.len());
        self.at += (length + 1).min(rest.len());
        self.line += 1;
        let line = &rest[..length];
        Some(line.strip_suffix(b"\r").unwrap_or(line))
    }
}

/// A set that holds what this reader takes.
enum Held {
    Response(Raw, Nodes),
    Coherence(Raw, Nodes),
    Other,
}

/// Between which degrees of freedom a function is: node and direction of each.
type Nodes = [String; 4];

pub(super) fn read(bytes: &[u8], source: &Source<'_>) -> Result<Vec<Raw>, Vec<Finding>> {
    let mut lines = Lines { bytes, at: 0, line: 0 };
    let (mut responses, mut coherences, mut faults) = (Vec::new(), Vec::new(), Vec::new());
    let mut set = 0;
    while let Some(line) = lines.next() {
        if line.trim_ascii() != b"-1" {
            continue;
        }
        set += 1;
        match one_set(&mut lines, set, source) {
            Ok(Held::Response(raw, nodes)) => responses.push((raw, nodes)),
            Ok(Held::Coherence(raw, nodes)) => coherences.push((raw, nodes)),
            Ok(Held::Other) => {}
            // What follows a set that is not understood cannot be told from its values.
            Err(fault) => {
                faults.push(fault);
                break;
            }
        }
    }
    if responses.is_empty() && faults.is_empty() {
        faults.push(source.fault("uff_no_frf", set).with("byte", bytes.len()));
    }
    if !faults.is_empty() {
        return Err(faults);
    }
    for (raw, nodes) in &mut responses {
        let found = coherences
            .iter()
            .find(|(other, others)| others == nodes && other.function.frequency_hz == raw.function.frequency_hz);
        raw.function.coherence = found.map(|(other, _)| other.function.values.iter().map(|value| value.re).collect());
    }
    Ok(responses.into_iter().map(|(raw, _)| raw).collect())
}

/// Characters of a line from one column to another.
fn field(line: &[u8], from: usize, to: usize) -> &str {
    let cut = line.get(from.min(line.len())..to.min(line.len())).unwrap_or_default();
    std::str::from_utf8(cut).unwrap_or_default().trim()
}

fn whole(line: &[u8], from: usize, to: usize) -> Option<usize> {
    field(line, from, to).parse().ok()
}

fn number(text: &str) -> Option<f64> {
    text.trim().replace(['D', 'd'], "E").parse().ok()
}

/// Reads on to the mark that ends a set.
fn to_end(lines: &mut Lines<'_>) -> bool {
    while let Some(line) = lines.next() {
        if line.trim_ascii() == b"-1" {
            return true;
        }
    }
    false
}

fn one_set(lines: &mut Lines<'_>, set: usize, source: &Source<'_>) -> Result<Held, Finding> {
    let begin = Place { set, byte: lines.at, line: lines.line };
    let cut_short = |lines: &Lines<'_>, expected: usize, found: usize| {
        let fault = source.fault("uff_truncated", set).with("byte", lines.at).with("line", lines.line);
        fault.with("expected", expected).with("found", found)
    };
    let Some(first) = lines.next() else { return Ok(Held::Other) };
    let name = field(first, 0, 7).to_owned();
    let is_binary = name == "58b";
    if !is_binary && name != "58" {
        to_end(lines);
        return Ok(Held::Other);
    }
    let mut head = Vec::with_capacity(HEAD_LINES - 1);
    for _ in 1..HEAD_LINES {
        match lines.next() {
            Some(line) if line.trim_ascii() != b"-1" || head.len() < 5 => head.push(line),
            _ => return Err(cut_short(lines, HEAD_LINES, head.len() + 1)),
        }
    }
    let form = Form::of(&head, begin, source)?;
    let numbers =
        if is_binary { binary(first, lines, &form, begin, source)? } else { ascii(lines, &form, begin, source)? };
    if !to_end(lines) {
        return Err(cut_short(lines, form.count, form.count));
    }
    form.held(&head, &numbers, begin, source)
}

/// How the values of a set are written.
struct Form {
    function_type: usize,
    is_complex: bool,
    is_double: bool,
    is_even: bool,
    count: usize,
    first_hz: f64,
    step_hz: f64,
}

impl Form {
    fn of(head: &[&[u8]], at: Place, source: &Source<'_>) -> Result<Self, Finding> {
        let (degrees, form) = (head[5], head[6]);
        let fault = |line: usize, found: &[u8]| {
            let fault = source.fault("uff_format", at.set).with("byte", at.byte).with("line", at.line + line);
            fault.with("found", String::from_utf8_lossy(found).trim().to_owned())
        };
        let function_type = whole(degrees, 0, 5).ok_or_else(|| fault(7, degrees))?;
        let kind = whole(form, 0, 10).ok_or_else(|| fault(8, form))?;
        let (is_complex, is_double) = match kind {
            2 => (false, false),
            4 => (false, true),
            5 => (true, false),
            6 => (true, true),
            _ => return Err(fault(8, form)),
        };
        let is_even = whole(form, 20, 30).ok_or_else(|| fault(8, form))? == 1;
        let read = |from, to| number(field(form, from, to)).unwrap_or(f64::NAN);
        Ok(Self {
            function_type,
            is_complex,
            is_double,
            is_even,
            count: whole(form, 10, 20).ok_or_else(|| fault(8, form))?,
            first_hz: if is_even { read(30, 43) } else { 0.0 },
            step_hz: if is_even { read(43, 56) } else { 0.0 },
        })
    }

    /// Numbers of a line of the function, its frequency included where it is written.
    fn width(&self) -> usize {
        1 + usize::from(self.is_complex) + usize::from(!self.is_even)
    }

    /// The function of the numbers.
    fn held(&self, head: &[&[u8]], numbers: &Numbers, at: Place, source: &Source<'_>) -> Result<Held, Finding> {
        let is_response = self.function_type == FREQUENCY_RESPONSE;
        if !is_response && self.function_type != COHERENCE {
            return Ok(Held::Other);
        }
        let fault = |code, line: usize, found: &str| {
            let fault = source.fault(code, at.set).with("byte", at.byte).with("line", at.line + line);
            fault.with("found", found.to_owned())
        };
        let (degrees, abscissa, numerator, denominator) = (head[5], head[7], head[8], head[9]);
        if whole(abscissa, 0, 10) != Some(FREQUENCY) {
            return Err(fault("not_frf", 9, field(abscissa, 0, 10)));
        }
        if !is_response {
            return Ok(Held::Coherence(self.raw(numbers, at, source, Unit::MPerN), nodes(degrees)));
        }
        let unit = match unit(numerator, denominator) {
            Ok(unit) => unit.or(source.file.unit),
            Err(Bad { code, found }) => return Err(fault(code, 10, &found)),
        };
        if !self.is_complex {
            return Err(fault("not_frf", 8, field(head[6], 0, 10)));
        }
        let unit = unit.ok_or_else(|| fault("unit_missing", 10, field(numerator, 0, 10)))?;
        let (Ok(response), Ok(excitation)) = (direction(degrees, 51, 55), direction(degrees, 76, 80)) else {
            return Err(fault("not_frf", 7, field(degrees, 51, 80)));
        };
        let mut raw = self.raw(numbers, at, source, unit);
        raw.function.response = response.unwrap_or(source.response());
        raw.function.excitation = excitation.unwrap_or(source.excitation());
        Ok(Held::Response(raw, nodes(degrees)))
    }

    fn raw(&self, numbers: &Numbers, at: Place, source: &Source<'_>, unit: Unit) -> Raw {
        let step = self.width();
        let rows = numbers.values.chunks_exact(step);
        let frequency_hz = rows
            .clone()
            .enumerate()
            .map(|(i, row)| if self.is_even { self.first_hz + i as f64 * self.step_hz } else { row[0] });
        let value = |row: &[f64]| {
            let row = &row[usize::from(!self.is_even)..];
            Complex::new(row[0], row.get(1).copied().unwrap_or(0.0)) * unit.si()
        };
        let function = Function {
            file: source.index,
            set: at.set,
            response: source.response(),
            excitation: source.excitation(),
            unit,
            frequency_hz: frequency_hz.collect(),
            values: rows.map(value).collect(),
            coherence: None,
        };
        let places = (0..self.count).map(|i| numbers.lines.get(i * step).copied().unwrap_or(0)).collect();
        Raw { function, places }
    }
}

fn nodes(degrees: &[u8]) -> Nodes {
    [(41, 51), (51, 55), (66, 76), (76, 80)].map(|(from, to)| field(degrees, from, to).to_owned())
}

/// A degree of freedom that is no displacement.
struct Turning;

/// A direction of the degrees of freedom; `None` where none is named.
fn direction(degrees: &[u8], from: usize, to: usize) -> Result<Option<Direction>, Turning> {
    match field(degrees, from, to).parse::<i32>().unwrap_or(0) {
        0 => Ok(None),
        1 => Ok(Some(Direction::X)),
        2 => Ok(Some(Direction::Y)),
        3 => Ok(Some(Direction::Z)),
        -1 => Ok(Some(Direction::MinusX)),
        -2 => Ok(Some(Direction::MinusY)),
        -3 => Ok(Some(Direction::MinusZ)),
        _ => Err(Turning),
    }
}

/// A unit that is not taken.
struct Bad {
    code: &'static str,
    found: String,
}

/// Unit of the numbers by what stands above and below the line, and by their labels; `None` where neither says it.
fn unit(numerator: &[u8], denominator: &[u8]) -> Result<Option<Unit>, Bad> {
    let label = |line: &[u8]| {
        let label = field(line, 47, 67);
        if label.eq_ignore_ascii_case("none") { String::new() } else { label.to_owned() }
    };
    let (above, below) = (label(numerator), label(denominator));
    let bad = |code, found: &str| Err(Bad { code, found: found.to_owned() });
    for text in [&above, &below] {
        if text.to_lowercase().contains("db") {
            return bad("decibel", text);
        }
    }
    let kind = whole(numerator, 0, 10).unwrap_or(0);
    let usual = match kind {
        8 => Some(Unit::MPerN),
        11 => Some(Unit::MPerSPerN),
        12 => Some(Unit::MPerS2PerN),
        0 | 1 => None,
        _ => return bad("not_frf", field(numerator, 0, 10)),
    };
    // A force at the point or at a support; 0 and 1 say nothing.
    if !matches!(whole(denominator, 0, 10).unwrap_or(0), 0 | 1 | 9 | 13) {
        return bad("not_frf", field(denominator, 0, 10));
    }
    if !(below.is_empty() || below == "N") {
        return bad("unit_unknown", &below);
    }
    if above.is_empty() {
        return Ok(usual);
    }
    let spelled = Unit::of(&above).or_else(|| Unit::of(&format!("{above}/N")));
    match (spelled, usual) {
        (Some(unit), Some(usual)) if unit.derivative() != usual.derivative() => bad("unit_unknown", &above),
        (Some(unit), _) => Ok(Some(unit)),
        (None, _) => bad("unit_unknown", &above),
    }
}

/// Numbers of a set and, in text, the line on which each stands.
struct Numbers {
    values: Vec<f64>,
    lines: Vec<usize>,
}

fn ascii(lines: &mut Lines<'_>, form: &Form, at: Place, source: &Source<'_>) -> Result<Numbers, Finding> {
    // Values of single precision take 13 columns, of double precision 20; a written frequency always 13.
    let wide = |i: usize| form.is_double && (form.is_even || !i.is_multiple_of(form.width()));
    let row = match (form.is_double, form.is_even, form.is_complex) {
        (false, ..) => 6,
        (true, false, true) => 3,
        (true, ..) => 4,
    };
    let total = form.count.saturating_mul(form.width());
    let mut found = Numbers { values: Vec::new(), lines: Vec::new() };
    while found.values.len() < total {
        let before = (lines.at, lines.line);
        let line = lines.next().filter(|line| line.trim_ascii() != b"-1");
        let Some(line) = line else {
            (lines.at, lines.line) = before;
            let fault = source.fault("uff_truncated", at.set).with("byte", lines.at).with("line", lines.line);
            return Err(fault.with("expected", total).with("found", found.values.len()));
        };
        let mut from = 0;
        for _ in 0..row.min(total - found.values.len()) {
            let to = from + if wide(found.values.len()) { 20 } else { 13 };
            let text = field(line, from, to);
            let Some(value) = number(text) else {
                let fault = source.fault("cell_not_a_number", at.set).with("line", lines.line);
                return Err(fault.with("column", from + 1).with("found", text.to_owned()));
            };
            found.values.push(value);
            found.lines.push(lines.line);
            from = to;
        }
    }
    Ok(found)
}

fn binary(
    first: &[u8],
    lines: &mut Lines<'_>,
    form: &Form,
    at: Place,
    source: &Source<'_>,
) -> Result<Numbers, Finding> {
    let (order, format, declared) = (whole(first, 7, 13), whole(first, 13, 19), whole(first, 31, 43));
    let fault = |code| source.fault(code, at.set).with("byte", at.byte).with("line", at.line + 1);
    let is_little = match (order, format) {
        (Some(LITTLE_ENDIAN), Some(IEEE)) => true,
        (Some(BIG_ENDIAN), Some(IEEE)) => false,
        _ => return Err(fault("uff_format").with("found", String::from_utf8_lossy(first).trim().to_owned())),
    };
    let size = if form.is_double { 8 } else { 4 };
    let plain = form.count.saturating_mul(form.width()).saturating_mul(size);
    // Some programs write the frequencies of double values in single precision, as the text form does.
    let mixed = plain.saturating_sub(form.count.saturating_mul(4));
    let is_mixed = form.is_double && !form.is_even && declared == Some(mixed);
    let expected = if is_mixed { mixed } else { plain };
    if declared.is_some_and(|declared| declared != expected) {
        let found = declared.unwrap_or_default();
        return Err(fault("uff_truncated").with("expected", expected).with("found", found));
    }
    let rest = lines.bytes.get(lines.at..).unwrap_or_default();
    let Some(data) = rest.get(..expected) else {
        return Err(source
            .fault("uff_truncated", at.set)
            .with("byte", lines.bytes.len())
            .with("expected", expected)
            .with("found", rest.len()));
    };
    let single = |bytes: &[u8]| {
        let four = [bytes[0], bytes[1], bytes[2], bytes[3]];
        f64::from(if is_little { f32::from_le_bytes(four) } else { f32::from_be_bytes(four) })
    };
    let double = |bytes: &[u8]| {
        let mut eight = [0; 8];
        eight.copy_from_slice(&bytes[..8]);
        if is_little { f64::from_le_bytes(eight) } else { f64::from_be_bytes(eight) }
    };
    let mut values = Vec::with_capacity(form.count * form.width());
    let mut from = 0;
    while from < data.len() {
        let is_short = !form.is_double || (is_mixed && values.len().is_multiple_of(form.width()));
        let length = if is_short { 4 } else { 8 };
        let bytes = &data[from..from + length];
        values.push(if is_short { single(bytes) } else { double(bytes) });
        from += length;
    }
    lines.at += expected;
    Ok(Numbers { values, lines: Vec::new() })
}
