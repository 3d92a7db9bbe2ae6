//! How a figure is taken.

use std::hint::black_box;
use std::time::Duration;

use cpu_time::ProcessTime;

/// In what a row counts. Less is better in all of them.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Unit {
    /// Seconds.
    Time,
    /// Of the same thing done plainly.
    Ratio,
    /// Bytes.
    Size,
    /// Things that went wrong.
    Count,
}

impl Unit {
    /// Three digits and a fitting unit.
    pub(crate) fn write(self, value: f64) -> String {
        let scaled = |steps: &[(f64, &str)]| {
            let (step, symbol) =
                steps.iter().find(|(step, _)| value >= *step).or(steps.last()).copied().unwrap_or((1.0, ""));
            let number = value / step;
            let decimals = if number >= 99.95 {
                0
            } else if number >= 9.995 {
                1
            } else {
                2
            };
            format!("{number:.decimals$} {symbol}")
        };
        match self {
            Self::Time => scaled(&[(1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns")]),
            Self::Ratio => format!("{value:.2} x"),
            Self::Count => format!("{value:.0}"),
            Self::Size => scaled(&[(1e6, "MB"), (1e3, "kB"), (1.0, "B")]),
        }
    }
}

/// A median and the middle half around it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Measured {
    pub(crate) median: f64,
    pub(crate) low: f64,
    pub(crate) high: f64,
}

impl Measured {
    /// Of samples that were taken under equal conditions.
    pub(crate) fn of(mut samples: Vec<f64>) -> Result<Self, String> {
        samples.sort_by(f64::total_cmp);
        let at = |share: usize| samples.get(samples.len().saturating_sub(1) * share / 4).copied();
        match (at(1), at(2), at(3)) {
            (Some(low), Some(median), Some(high)) => Ok(Self { median, low, high }),
            _ => Err("no sample".to_owned()),
        }
    }
}

const BATCHES: usize = 21;
const BATCH: Duration = Duration::from_millis(25);

/// CPU time of one call, in all threads of this process: of work on one core, the time of that core.
pub(crate) fn cpu_time<T>(mut work: impl FnMut() -> T) -> Result<Measured, String> {
    let mut timed = |calls: u32| {
        let start = ProcessTime::now();
        for _ in 0..calls {
            black_box(work());
        }
        start.elapsed()
    };
    let mut calls = 1;
    // This also warms up.
    while timed(calls) < BATCH && calls < 1 << 28 {
        calls *= 2;
    }
    Measured::of((0..BATCHES).map(|_| timed(calls).as_secs_f64() / f64::from(calls)).collect())
}
