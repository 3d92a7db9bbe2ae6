//! Rules between fields. What is wrong in the program itself is told by its reader.

use crate::calculator::{Check, Finding, Violations};

use super::input::Job;

/// Codes of the faults found here.
pub(crate) const CODES: &[&str] = &[
    "program_zero_missing",
    "tools_missing",
    "profile_falls_back",
    "stock_without_length",
    "duplicate_tool",
    "tip_not_outside",
];

/// Tip directions of turning from outside.
const OUTSIDE: [u8; 5] = [0, 3, 4, 8, 9];

impl Check for Job {
    fn check(&self, violations: &mut Violations) {
        self.check_tools(violations);
        let Some(stock) = &self.stock else { return };
        violations
            .require(self.program_zero_z_mm.is_some(), || Finding::new("program_zero_missing", "/program_zero_z_mm"));
        violations.require(!self.tools.is_empty(), || Finding::new("tools_missing", "/tools"));
        for (i, pair) in stock.profile.windows(2).enumerate() {
            violations.require(pair[0].z_mm <= pair[1].z_mm, || {
                Finding::new("profile_falls_back", format!("/stock/profile/{}/z_mm", i + 1))
                    .measured(pair[1].z_mm, pair[0].z_mm, "mm")
                    .with("minimum", pair[0].z_mm)
            });
        }
        let ends = stock.profile.first().zip(stock.profile.last());
        violations.require(ends.is_some_and(|(first, last)| first.z_mm < last.z_mm), || {
            Finding::new("stock_without_length", "/stock/profile")
        });
    }
}

impl Job {
    fn check_tools(&self, violations: &mut Violations) {
        for (i, tool) in self.tools.iter().enumerate() {
            violations.require(!self.tools[..i].iter().any(|other| other.number == tool.number), || {
                Finding::new("duplicate_tool", format!("/tools/{i}/number")).with("name", tool.number.clone())
            });
            violations.require(OUTSIDE.contains(&tool.tip_direction), || {
                Finding::new("tip_not_outside", format!("/tools/{i}/tip_direction"))
                    .value(f64::from(tool.tip_direction), "1")
            });
        }
    }
}
