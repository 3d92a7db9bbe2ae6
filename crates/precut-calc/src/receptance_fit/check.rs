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
        let [from_hz, to_hz] = self.band_hz();
        violations.require(from_hz < to_hz, || Finding::new("empty_band", "/to_hz").measured(to_hz, from_hz, "Hz"));
        match reader::read(&self.files, "/files") {
            Err(faults) => {
                for fault in faults {
                    violations.add(fault);
                }
            }
            Ok(functions) => check_functions(self, &functions, violations),
        }
    }
}

fn check_functions(job: &Job, functions: &[Function], violations: &mut Violations) {
    let band = job.band_hz();
    for function in functions {
        let inside = function.frequency_hz.iter().filter(|f| (band[0]..=band[1]).contains(*f)).count();
        violations.require(inside >= LEAST_LINES || band[0] >= band[1], || {
            Finding::new("too_few_lines", format!("/files/{}", function.file))
                .with("set", function.set)
                .with("lines", inside)
                .with("minimum", LEAST_LINES)
        });
    }
    for group in model::groups(functions, band, job.residuals) {
        violations.require(group.has_direct(), || {
            let function = &functions[group.lines[0].function];
            Finding::new("no_direct_function", format!("/files/{}", function.file))
                .with("response", function.response.name())
                .with("excitation", function.excitation.name())
        });
    }
}
