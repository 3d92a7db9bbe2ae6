//! Prints the request of a trial, and on standard error what is hidden in it:
//! `cargo run -p precut-trials --example draw -- ring one 5 2000009`.

use std::io::{Error, Write};

use precut_trials::{Class, deflection, fixture, machinability, ring};

fn main() -> Result<(), Error> {
    let given: Vec<String> = std::env::args().skip(1).collect();
    let usage =
        || Error::other("draw deflection|ring|fixture|machinability nothing|one|two|outside <signal to noise> <seed>");
    let [of, class, snr, seed] = &given[..] else { return Err(usage()) };
    let class = match class.as_str() {
        "nothing" => Class::Nothing,
        "one" => Class::One,
        "two" => Class::Two,
        "outside" => Class::Outside,
        _ => return Err(usage()),
    };
    let (snr, seed) = (snr.parse().map_err(|_| usage())?, seed.parse().map_err(|_| usage())?);
    let trial = match of.as_str() {
        "deflection" => deflection::draw(class, snr, seed),
        "ring" => ring::draw(class, snr, seed),
        "fixture" => fixture::draw(class, snr, seed),
        "machinability" => machinability::draw(class, snr, seed),
        _ => return Err(usage()),
    };
    writeln!(std::io::stderr(), "{:?}, scatter {:.3}", trial.truth, trial.sigma)?;
    writeln!(std::io::stdout(), "{:#}", trial.request)
}
