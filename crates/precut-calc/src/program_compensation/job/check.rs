//! Rules between fields. What is wrong in the program itself is told by its reader.

use crate::calculator::{Check, Finding, Violations};
use crate::diameters::{self, Uncertainty};
use crate::machinability::ModelForm;
use crate::material;

use super::input::Job;
use super::mode::{CorrectTo, ModeKind};

/// Codes of the faults found here.
pub(crate) const CODES: &[&str] = &[
    "not_in_encoding",
    "program_zero_missing",
    "tools_missing",
    "profile_falls_back",
    "stock_without_length",
    "duplicate_tool",
    "tip_not_outside",
    "force_without_stock",
    "compensation_without_force",
    "refeed_missing",
    "refeed_limits_cross",
    "refeed_needs_model",
    "refeed_needs_power_law",
    "refeed_needs_main_force",
    "keep_out_without_length",
    "keep_out_without_stock",
    "drawing_without_stock",
    "drawing_missing",
    "no_such_support",
    "unknown_material",
    "elastic_constants_missing",
    "bad_bore",
    "tolerance_without_force",
    "uncertainty_without_tolerance",
];

/// Tip directions of turning from outside.
const OUTSIDE: [u8; 5] = [0, 3, 4, 8, 9];

impl Check for Job {
    fn check(&self, violations: &mut Violations) {
        if let Some(outside) = self.nc_program.chars().find(|&character| !self.reading.encoding.has(character)) {
            violations.add(Finding::new("not_in_encoding", "/reading/encoding").with("character", outside.to_string()));
        }
        self.check_tools(violations);
        self.check_holding(violations);
        self.check_refeed(violations);
        self.check_certainty(violations);
        for (i, keep_out) in self.keep_out.iter().enumerate() {
            violations.require(keep_out.z_start_mm < keep_out.z_end_mm, || {
                Finding::new("keep_out_without_length", format!("/keep_out/{i}/z_end_mm"))
                    .measured(keep_out.z_end_mm, keep_out.z_start_mm, "mm")
                    .with("above", keep_out.z_start_mm)
            });
            let count = self.supports.len() as f64;
            violations.require(keep_out.support.is_none_or(|support| f64::from(support) < count), || {
                Finding::new("no_such_support", format!("/keep_out/{i}/support"))
                    .measured(keep_out.support.map_or(0.0, f64::from), count, "1")
                    .with("below", count)
            });
        }
        violations.require(self.drawing.is_empty() || self.stock.is_some(), || {
            Finding::new("drawing_without_stock", "/stock")
        });
        violations.require(self.mode.correct_to == CorrectTo::Program || !self.drawing.is_empty(), || {
            Finding::new("drawing_missing", "/drawing")
        });
        violations.require(self.keep_out.is_empty() || self.stock.is_some(), || {
            Finding::new("keep_out_without_stock", "/stock")
        });
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
        for (i, pair) in self.drawing.windows(2).enumerate() {
            violations.require(pair[0].z_mm <= pair[1].z_mm, || {
                Finding::new("profile_falls_back", format!("/drawing/{}/z_mm", i + 1))
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
    /// What forces and supports ask for.
    fn check_holding(&self, violations: &mut Violations) {
        for (i, lines) in self.support_lines.iter().enumerate() {
            violations.require((lines.support as usize) < self.supports.len(), || {
                Finding::new("no_such_support", format!("/support_lines/{i}/support"))
                    .measured(f64::from(lines.support), self.supports.len() as f64, "1")
                    .with("below", self.supports.len() as f64)
            });
        }
        if self.force.is_none() {
            return violations
                .require(self.mode.kind == ModeKind::Read, || Finding::new("compensation_without_force", "/force"));
        }
        let Some(stock) = &self.stock else {
            return violations.add(Finding::new("force_without_stock", "/stock"));
        };
        match &stock.material {
            Some(id) => violations.require(material::find(id).is_some(), || {
                Finding::new("unknown_material", "/stock/material")
                    .with("id", id.clone())
                    .with("known", material::library().iter().map(|m| m.id).collect::<Vec<_>>())
            }),
            None => violations.require(stock.youngs_modulus_n_per_mm2.is_some(), || {
                Finding::new("elastic_constants_missing", "/stock/youngs_modulus_n_per_mm2")
            }),
        }
        let least = stock.profile.iter().map(|row| row.diameter_mm).fold(f64::INFINITY, f64::min);
        violations.require(stock.bore_diameter_mm < least, || {
            Finding::new("bad_bore", "/stock/bore_diameter_mm")
                .measured(stock.bore_diameter_mm, least, "mm")
                .with("minimum", 0.0)
                .with("below", least)
        });
        if let Some(holding) = self.holding() {
            holding.check(violations);
        }
    }

    /// What limits of the diameter ask for.
    fn check_certainty(&self, violations: &mut Violations) {
        diameters::check(&self.asked(), violations);
        let is_limited = !self.tolerance.is_none();
        violations.require(!is_limited || self.force.is_some(), || Finding::new("tolerance_without_force", "/force"));
        violations.require(is_limited || self.uncertainty == Uncertainty::default(), || {
            Finding::new("uncertainty_without_tolerance", "/tolerance")
        });
    }

    /// What new feeds ask for.
    fn check_refeed(&self, violations: &mut Violations) {
        let Some(refeed) = &self.refeed else {
            return violations.require(!self.mode.kind.refeeds(), || Finding::new("refeed_missing", "/refeed"));
        };
        let (low, high) = (refeed.feed_min_mm_per_rev, refeed.feed_max_mm_per_rev);
        violations.require(low < high, || {
            Finding::new("refeed_limits_cross", "/refeed/feed_max_mm_per_rev")
                .measured(high, low, "mm/rev")
                .with("above", low)
        });
        for (limit, model, field, by) in [
            (refeed.roughness_max_um, &refeed.roughness, "roughness", "roughness_max_um"),
            (refeed.tool_usage_max, &refeed.tool_life, "tool_life", "tool_usage_max"),
        ] {
            violations.require(limit.is_none() || model.is_some(), || {
                Finding::new("refeed_needs_model", format!("/refeed/{field}")).with("needed_by", by)
            });
        }
        violations.require(refeed.tool_life.as_ref().is_none_or(|life| life.form == ModelForm::LogLog), || {
            Finding::new("refeed_needs_power_law", "/refeed/tool_life/form")
        });
        let main = refeed.force_z_max_n.or(refeed.power_kw).or(refeed.torque_n_m);
        let has_main = self.force.as_ref().is_none_or(crate::force::ForceModel::has_main);
        violations.require(main.is_none() || has_main, || Finding::new("refeed_needs_main_force", "/force"));
    }

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
