//! The figures that we want to reach, measured: `cargo bench` prints one Markdown table, `cargo bench -- csv` only the
//! rows with that word.
//!
//! The machines are shared and noisy, so an absolute wall time proves nothing. Times are CPU times of one
//! core, the median of batches; what goes over HTTP is a ratio to a bare handler that answers with the
//! same bytes, measured in turns in the same run. Nothing fails here: the table is for reading.

mod deflection;
mod diagnosis;
mod feed;
mod fitting;
mod fixture;
mod http;
mod library;
mod measure;
mod milling;
mod process;
mod program;
mod ring;
mod roundness;
mod rows;
#[path = "../../crates/precut-calc/tests/strd/mod.rs"]
mod strd;

use std::io::Write;

/// As in the program.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

use measure::{Measured, Unit};

/// One line of the table.
pub(crate) struct Row {
    /// What is done.
    pub(crate) work: &'static str,
    /// Of all three numbers.
    pub(crate) unit: Unit,
    /// What must be reached.
    pub(crate) at_least: Option<f64>,
    /// Where we want to end.
    pub(crate) aim: Option<f64>,
    /// Does it; `Err` says why it cannot be measured here.
    pub(crate) measure: fn() -> Result<Measured, String>,
}

fn main() -> std::io::Result<()> {
    if http::is_bare_server() {
        return http::serve_bare();
    }
    // Cargo passes `--bench`.
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let mut out = std::io::stdout().lock();
    writeln!(out, "| work | measured | spread | at least | aim | |\n|---|---|---|---|---|---|")?;
    for row in rows::all() {
        if words.iter().all(|word| row.work.contains(word.as_str())) {
            writeln!(out, "{}", line(&row))?;
            out.flush()?;
        }
    }
    Ok(())
}

fn line(row: &Row) -> String {
    let bound = |bound: Option<f64>| bound.map_or("-".to_owned(), |value| row.unit.write(value));
    let (at_least, aim) = (bound(row.at_least), bound(row.aim));
    match (row.measure)() {
        Ok(Measured { median, low, high }) => {
            let spread = format!("{} to {}", row.unit.write(low), row.unit.write(high));
            let verdict = verdict(median, row.at_least, row.aim);
            format!("| {} | {} | {spread} | {at_least} | {aim} | {verdict} |", row.work, row.unit.write(median))
        }
        Err(reason) => format!("| {} | not measured: {reason} | | {at_least} | {aim} | |", row.work),
    }
}

fn verdict(median: f64, at_least: Option<f64>, aim: Option<f64>) -> &'static str {
    match (at_least, aim) {
        (_, Some(aim)) if median <= aim => "aim reached",
        (Some(least), _) if median <= least => "reached",
        (Some(_), _) => "BEHIND",
        (None, _) => "",
    }
}
