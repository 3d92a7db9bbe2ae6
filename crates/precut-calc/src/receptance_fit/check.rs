//! Rules between fields: what the files hold.

use crate::calculator::{Check, Finding, Violations};

use super::input::Job;
use super::model;
use super::reader::{self, Function, LEAST_LINES};

/// Codes of the faults made here.
pub(super) const CODES: &[&str] = &["empty_band", "too_few_lines", "no_direct_function"];

impl Job {
    /// The band that is fitted, Hz.
    pub(super) fn band_hz(&self) -> [f64; 2] {
        [self.from_hz.unwrap_or(0.0), self.to_hz.unwrap_or(f64::INFINITY)]
    }
}

impl Check for Job {
    fn check(&self, violations: &mut Violations) {
        check_at(self, "", violations);
    }
}

/// The same of functions that stand inside another job, under the pointer `at`. Gives the functions that were read.
pub(crate) fn check_at(job: &Job, at: &str, violations: &mut Violations) -> Vec<Function> {
    let [from_hz, to_hz] = job.band_hz();
    violations
        .require(from_hz < to_hz, || Finding::new("empty_band", format!("{at}/to_hz")).measured(to_hz, from_hz, "Hz"));
    match reader::read(&job.files, &format!("{at}/files")) {
        Err(faults) => {
            for fault in faults {
                violations.add(fault);
            }
            Vec::new()
        }
        Ok(functions) => {
            check_functions(job, &functions, at, violations);
            functions
        }
    }
}

fn check_functions(job: &Job, functions: &[Function], at: &str, violations: &mut Violations) {
    let band = job.band_hz();
    for function in functions {
        let inside = function.frequency_hz.iter().filter(|f| (band[0]..=band[1]).contains(*f)).count();
        violations.require(inside >= LEAST_LINES || band[0] >= band[1], || {
            Finding::new("too_few_lines", format!("{at}/files/{}", function.file))
                .with("set", function.set)
                .with("lines", inside)
                .with("minimum", LEAST_LINES)
        });
    }
    for group in model::groups(functions, band, job.residuals) {
        violations.require(group.has_direct(), || {
            let function = &functions[group.lines[0].function];
            Finding::new("no_direct_function", format!("{at}/files/{}", function.file))
                .with("response", function.response.name())
                .with("excitation", function.excitation.name())
        });
    }
}
