//! A frequency response as CSV: `frequency [Hz]`, then real and imaginary part, or amplitude and phase, and the coherence.

use nalgebra::Complex;

use crate::calculator::Finding;

use super::super::input::Unit;
use super::{Function, MOST_FAULTS, Raw, Source};

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    Frequency,
    Real,
    Imaginary,
    Amplitude,
    Phase,
    Coherence,
}

/// What columns are called, lower case.
const NAMES: &[(Part, &[&str])] = &[
    (Part::Frequency, &["frequency", "freq", "f", "frequenz", "частота"]),
    (Part::Real, &["real", "re", "real part", "realteil", "действительная часть"]),
    (Part::Imaginary, &["imaginary", "imag", "im", "imaginary part", "imaginärteil", "мнимая часть"]),
    (Part::Amplitude, &["amplitude", "magnitude", "mag", "abs", "modulus", "betrag", "амплитуда", "модуль"]),
    (Part::Phase, &["phase", "angle", "фаза"]),
    (Part::Coherence, &["coherence", "coh", "gamma2", "kohärenz", "когерентность"]),
];

/// A column that is read.
struct Column<'a> {
    part: Part,
    at: usize,
    heading: &'a str,
    unit: Option<&'a str>,
}

pub(super) fn read(text: &str, source: &Source<'_>) -> Result<Raw, Vec<Finding>> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    let Some((number, header)) = lines.next() else {
        return Err(vec![source.fault("not_frf", 1).with("line", 1_usize).with("found", "")]);
    };
    let separator = ['\t', ';', ','].into_iter().find(|one| header.contains(*one)).unwrap_or(',');
    let columns = columns(header, separator);
    let heads = heads(&columns, header, number + 1, source).map_err(|fault| vec![fault])?;
    let mut faults = Vec::new();
    let (mut frequency_hz, mut values, mut coherence, mut places) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for (number, line) in lines {
        let cells: Vec<&str> = line.split(separator).map(str::trim).collect();
        let mut cell = |column: &Column<'_>| {
            let found = cells.get(column.at).copied().unwrap_or_default();
            let plain = if separator == ',' { found.to_owned() } else { found.replace(',', ".") };
            plain.parse::<f64>().ok().filter(|number| number.is_finite()).or_else(|| {
                let fault = source.fault("cell_not_a_number", 1).with("line", number + 1);
                faults.push(fault.with("column", column.heading.to_owned()).with("found", found.to_owned()));
                None
            })
        };
        let read = (cell(heads.frequency), cell(heads.pair[0]), cell(heads.pair[1]));
        let seen = heads.coherence.map(&mut cell);
        if let (Some(frequency), Some(first), Some(second)) = read {
            frequency_hz.push(frequency * heads.to_hz);
            values.push(heads.value(first, second));
            coherence.extend(seen.flatten());
            places.push(number + 1);
        }
        if faults.len() >= MOST_FAULTS {
            break;
        }
    }
    if !faults.is_empty() {
        return Err(faults);
    }
    let function = Function {
        file: source.index,
        set: 1,
        response: source.response(),
        excitation: source.excitation(),
        unit: heads.unit,
        frequency_hz,
        values,
        coherence: heads.coherence.is_some().then_some(coherence),
    };
    Ok(Raw { function, places })
}

/// A heading without its unit, and the unit.
fn split(heading: &str) -> (String, Option<&str>) {
    let heading = heading.trim().trim_matches('"');
    let bracketed = [('[', ']'), ('(', ')')].into_iter().find_map(|(open, close)| {
        let (name, unit) = heading.strip_suffix(close)?.split_once(open)?;
        Some((name.trim().to_lowercase(), Some(unit.trim())))
    });
    bracketed.unwrap_or_else(|| (heading.to_lowercase(), None))
}

fn columns(header: &str, separator: char) -> Vec<Column<'_>> {
    let column = |(at, heading): (usize, &'_ str)| -> Option<(usize, Part)> {
        let (name, _) = split(heading);
        let name = name.replace('_', " ");
        NAMES.iter().find(|(_, names)| names.contains(&name.as_str())).map(|(part, _)| (at, *part))
    };
    let headings: Vec<&str> = header.split(separator).collect();
    headings
        .iter()
        .enumerate()
        .filter_map(|(at, heading)| column((at, heading)))
        .map(|(at, part)| {
            let heading = headings[at].trim().trim_matches('"');
            Column { part, at, heading, unit: split(headings[at]).1 }
        })
        .collect()
}

/// The columns of a function and what their numbers are.
struct Heads<'a> {
    frequency: &'a Column<'a>,
    /// Real and imaginary part, or amplitude and phase.
    pair: [&'a Column<'a>; 2],
    coherence: Option<&'a Column<'a>>,
    to_hz: f64,
    unit: Unit,
    /// Radians of one unit of the phase, where it is amplitude and phase.
    phase_rad: Option<f64>,
}

impl Heads<'_> {
    fn value(&self, first: f64, second: f64) -> Complex<f64> {
        let size = self.unit.si();
        match self.phase_rad {
            Some(phase_rad) => Complex::from_polar(first * size, second * phase_rad),
            None => Complex::new(first * size, second * size),
        }
    }
}

fn heads<'a>(columns: &'a [Column<'a>], header: &str, line: usize, source: &Source<'_>) -> Result<Heads<'a>, Finding> {
    let of = |part: Part| columns.iter().find(|column| column.part == part);
    let pair = of(Part::Real).zip(of(Part::Imaginary)).or(of(Part::Amplitude).zip(of(Part::Phase)));
    let (Some(frequency), Some((first, second))) = (of(Part::Frequency), pair) else {
        return Err(source.fault("not_frf", 1).with("line", line).with("found", header.trim().to_owned()));
    };
    let fault = |code, column: &Column<'_>| {
        let found = column.unit.unwrap_or_default().to_owned();
        source.fault(code, 1).with("line", line).with("column", column.heading.to_owned()).with("found", found)
    };
    let to_hz = match frequency.unit.map(str::to_lowercase).as_deref() {
        None => return Err(fault("unit_missing", frequency)),
        Some("hz" | "1/s" | "гц") => 1.0,
        Some("khz" | "кгц") => 1000.0,
        Some("rad/s" | "рад/с") => 1.0 / std::f64::consts::TAU,
        Some(_) => return Err(fault("unit_unknown", frequency)),
    };
    let is_polar = first.part == Part::Amplitude;
    let measured: &[&Column<'_>] = if is_polar { &[first] } else { &[first, second] };
    let mut unit = None;
    for column in measured {
        let read = match column.unit {
            Some(text) if text.to_lowercase().contains("db") => return Err(fault("decibel", column)),
            Some(text) => Unit::of(text).ok_or_else(|| fault("unit_unknown", column))?,
            None => source.file.unit.ok_or_else(|| fault("unit_missing", column))?,
        };
        if unit.is_some_and(|unit| unit != read) {
            return Err(fault("unit_unknown", column));
        }
        unit = Some(read);
    }
    let Some(unit) = unit else { return Err(fault("unit_missing", first)) };
    let phase_rad = match (is_polar, second.unit.map(str::to_lowercase).as_deref()) {
        (false, _) => None,
        (true, None) => return Err(fault("unit_missing", second)),
        (true, Some("deg" | "°" | "grad" | "град")) => Some(1.0_f64.to_radians()),
        (true, Some("rad" | "рад")) => Some(1.0),
        (true, Some(_)) => return Err(fault("unit_unknown", second)),
    };
    Ok(Heads { frequency, pair: [first, second], coherence: of(Part::Coherence), to_hz, unit, phase_rad })
}
