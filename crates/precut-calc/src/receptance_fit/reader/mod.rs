//! Frequency responses out of files: CSV and UFF datasets 58 and 58b (`receptance/2`).

mod base64;
mod csv;
mod uff;

use nalgebra::Complex;

use crate::calculator::Finding;

use super::input::{Direction, ReceptanceFile, Unit};

/// Codes of the faults of a file.
pub(super) const CODES: &[&str] = &[
    "file_twice",
    "file_missing",
    "not_base64",
    "unit_missing",
    "unit_unknown",
    "decibel",
    "frequency_order",
    "too_few_lines",
    "too_many_frf_lines",
    "not_frf",
    "cell_not_a_number",
    "coherence_out_of_range",
    "nothing_measured",
    "uff_truncated",
    "uff_no_frf",
    "uff_format",
];

/// Fewest lines of a function.
pub const LEAST_LINES: usize = 16;
/// Most lines of all functions together.
pub const MOST_LINES: usize = 50_000;
/// Coherence that is nearer to 1 says more of the analyser's rounding than of the noise.
const BEST_COHERENCE: f64 = 0.999_9;
/// A line of less coherence than this weighs as one of this.
const WORST_COHERENCE: f64 = 0.01;
/// Faults of one file that are told.
const MOST_FAULTS: usize = 20;

/// A frequency response, in SI units of what was measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Function {
    /// Number of the file that it stands in, from 0.
    pub file: usize,
    /// Number of the set in that file, from 1; a CSV file is one set.
    pub set: usize,
    /// In which direction it was measured.
    pub response: Direction,
    /// In which direction it was struck or shaken.
    pub excitation: Direction,
    /// What was measured, and in which unit.
    pub unit: Unit,
    /// Rising, above 0.
    pub frequency_hz: Vec<f64>,
    /// In m/N, m/s/N or m/s2/N.
    pub values: Vec<Complex<f64>>,
    /// Coherence of each line, where it was measured.
    pub coherence: Option<Vec<f64>>,
}

impl Function {
    /// Square roots of the weights: 1/sigma as far as the coherence says it, else 1. The number of averages and any other
    /// common factor drop out, as the scatter is estimated.
    pub fn root_weights(&self) -> Vec<f64> {
        let Some(coherence) = &self.coherence else { return vec![1.0; self.values.len()] };
        let of = |(value, coherence): (&Complex<f64>, &f64)| {
            let c = coherence.clamp(WORST_COHERENCE, BEST_COHERENCE);
            (2.0 * c / (1.0 - c)).sqrt() / value.norm().max(f64::MIN_POSITIVE.sqrt())
        };
        self.values.iter().zip(coherence).map(of).collect()
    }
}

/// A function as its file has it, and where each of its lines stands.
struct Raw {
    function: Function,
    /// Line of the text of the first value, from 1; 0 in binary sets.
    places: Vec<usize>,
}

/// All functions of the files; else what is wrong with them.
pub fn read(files: &[ReceptanceFile], pointer: &str) -> Result<Vec<Function>, Vec<Finding>> {
    let (mut functions, mut faults) = (Vec::new(), Vec::new());
    for (index, file) in files.iter().enumerate() {
        let at = format!("{pointer}/{index}");
        match of_file(file, index, &at) {
            Ok(found) => functions.extend(found),
            Err(found) => faults.extend(found.into_iter().take(MOST_FAULTS)),
        }
    }
    let lines: usize = functions.iter().map(|function| function.values.len()).sum();
    if lines > MOST_LINES {
        faults.push(Finding::new("too_many_frf_lines", pointer).with("lines", lines).with("maximum", MOST_LINES));
    }
    if faults.is_empty() { Ok(functions) } else { Err(faults) }
}

fn of_file(file: &ReceptanceFile, index: usize, pointer: &str) -> Result<Vec<Function>, Vec<Finding>> {
    let decoded;
    let (bytes, pointer) = match (&file.text, &file.base64) {
        (Some(_), Some(_)) => return Err(vec![Finding::new("file_twice", pointer)]),
        (None, None) => return Err(vec![Finding::new("file_missing", pointer)]),
        (Some(text), None) => (text.as_bytes(), format!("{pointer}/text")),
        (None, Some(text)) => {
            let pointer = format!("{pointer}/base64");
            decoded = base64::decoded(text)
                .map_err(|at| vec![Finding::new("not_base64", pointer.clone()).with("place", at + 1)])?;
            (decoded.as_slice(), pointer)
        }
    };
    let source = Source { file, index, pointer: &pointer };
    let raws = if uff::is_uff(bytes) {
        uff::read(bytes, &source)?
    } else {
        vec![csv::read(&String::from_utf8_lossy(bytes), &source)?]
    };
    let mut faults = Vec::new();
    let functions = raws.into_iter().filter_map(|raw| checked(raw, &source, &mut faults)).collect();
    if faults.is_empty() { Ok(functions) } else { Err(faults) }
}

/// A file that is read.
struct Source<'a> {
    file: &'a ReceptanceFile,
    index: usize,
    pointer: &'a str,
}

impl Source<'_> {
    fn fault(&self, code: &'static str, set: usize) -> Finding {
        Finding::new(code, self.pointer).with("set", set)
    }

    /// The direction that the job states, else x.
    fn response(&self) -> Direction {
        self.file.response.unwrap_or(Direction::X)
    }

    fn excitation(&self) -> Direction {
        self.file.excitation.unwrap_or(Direction::X)
    }
}

/// The rules that hold for every function, lines at 0 Hz left out: there is no residual -A/w^2.
fn checked(raw: Raw, source: &Source<'_>, faults: &mut Vec<Finding>) -> Option<Function> {
    let Raw { mut function, mut places } = raw;
    let before = faults.len();
    let set = function.set;
    if function.frequency_hz.first().is_some_and(|first| *first == 0.0) {
        function.frequency_hz.remove(0);
        function.values.remove(0);
        places.remove(0);
        if let Some(coherence) = &mut function.coherence {
            coherence.remove(0);
        }
    }
    let is_finite = |i: &usize| function.frequency_hz[*i].is_finite() && function.values[*i].is_finite();
    if let Some(i) = (0..function.values.len()).find(|i| !is_finite(i)) {
        faults.push(source.fault("cell_not_a_number", set).with("line", places[i]).with("found", "NaN"));
        return None;
    }
    let is_first_low = function.frequency_hz.first().is_some_and(|first| *first <= 0.0);
    let falls = function.frequency_hz.windows(2).position(|pair| pair[1] <= pair[0]).map(|i| i + 1);
    if let Some(i) = is_first_low.then_some(0).or(falls) {
        let before = if i == 0 { 0.0 } else { function.frequency_hz[i - 1] };
        let fault = source.fault("frequency_order", set).measured(function.frequency_hz[i], before, "Hz");
        faults.push(fault.with("line", places[i]).with("number", i + 1));
    }
    let count = function.values.len();
    if count < LEAST_LINES {
        faults.push(source.fault("too_few_lines", set).with("lines", count).with("minimum", LEAST_LINES));
    }
    if let Some(coherence) = &function.coherence {
        let out = coherence.iter().position(|c| !(0.0..=1.0).contains(c));
        if let Some(i) = out {
            let fault = source.fault("coherence_out_of_range", set).value(coherence[i], "1").within(0.0, 1.0);
            faults.push(fault.with("line", places[i]));
        }
    }
    if count > 0 && function.values.iter().all(|value| value.norm() == 0.0) {
        faults.push(source.fault("nothing_measured", set));
    }
    (faults.len() == before).then_some(function)
}
