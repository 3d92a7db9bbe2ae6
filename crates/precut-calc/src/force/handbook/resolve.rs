//! From a choice to the power law that it stands for.

use super::factors::{self, FactorRow, Reading};
use super::material_factor::{self, Rule};
use super::{Coefficients, Handbook, HandbookRow, Triple, WorkMaterial};
use crate::calculator::{Finding, Violations};
use crate::force::{CoefficientOrigin, Forces, PowerLaw, PowerTerm, ToolMaterial, rules};
use crate::material::{self, Certainty};

/// Last edge angle of the table, degrees; up to the one below its factors are taken, with a warning.
pub(in crate::force) const LAST_EDGE_ANGLE_DEG: f64 = 90.0;
const MOST_EDGE_ANGLE_DEG: f64 = 100.0;
/// Largest strength and hardness that the schema allows.
const MOST_STRENGTH_N_PER_MM2: f64 = 3000.0;
const MOST_HARDNESS: f64 = 700.0;

/// Correction factors with the least certain of their certainties.
type Factors = (Triple, Certainty);

/// A class of work material with what the library knows of it.
struct Work {
    class: WorkMaterial,
    strength: Option<f64>,
    hardness: Option<f64>,
}

impl Handbook {
    pub(in crate::force) fn check(&self, pointer: &str, violations: &mut Violations) {
        if let Err(faults) = self.resolve(pointer) {
            for fault in faults {
                violations.add(fault);
            }
        }
    }

    /// The power law of this choice, or everything that is wrong with the choice, which stands at
    /// `pointer` of the job.
    pub(in crate::force) fn resolve(&self, pointer: &str) -> Result<PowerLaw, Vec<Finding>> {
        let mut reader = Reader { choice: self, pointer, violations: Violations::default() };
        let law = reader.law();
        match (law, reader.violations.is_empty()) {
            (Some(law), true) => Ok(law),
            _ => Err(reader.violations.into_vec()),
        }
    }
}

/// Reads a choice and notes every fault on the way.
struct Reader<'a> {
    choice: &'a Handbook,
    pointer: &'a str,
    violations: Violations,
}

impl Reader<'_> {
    fn law(&mut self) -> Option<PowerLaw> {
        rules::check_wear(self.choice.wear_factor, self.pointer, &mut self.violations);
        rules::check_rubbing(self.choice.rubbing.as_ref(), self.pointer, &mut self.violations);
        let geometry = self.geometry_factors();
        let work = self.work()?;
        let material = self.material_factors(&work);
        let row = self.row(work.class)?;
        // Where a factor is missing a fault is noted already; the forces are looked at all the same.
        let neutral = (Triple::ONE, Certainty::Confirmed);
        let (material, geometry) = (material.unwrap_or(neutral), geometry.unwrap_or(neutral));
        let factors = (material.0.times(geometry.0), material.1.max(geometry.1));
        self.terms(row, factors)
    }

    fn fault(&mut self, code: &'static str, field: &str) {
        self.add(Finding::new(code, self.at(field)));
    }

    fn add(&mut self, finding: Finding) {
        self.violations.add(finding);
    }

    fn at(&self, field: &str) -> String {
        format!("{}/{field}", self.pointer)
    }

    fn work(&mut self) -> Option<Work> {
        let (strength, hardness) = (self.choice.tensile_strength_n_per_mm2, self.choice.brinell_hardness);
        match (self.choice.material.as_deref(), self.choice.work_material) {
            (None, Some(class)) => Some(Work { class, strength, hardness }),
            (Some(id), None) => {
                let Some(found) = material::find(id) else {
                    self.add(Finding::new("unknown_material", self.at("material")).with("material", id.to_owned()));
                    return None;
                };
                let Some(class) = found.work_material else {
                    self.add(
                        Finding::new("material_without_force_law", self.at("material")).with("material", found.id),
                    );
                    return None;
                };
                // Only the property that the class asks for: the other one is no statement of the job.
                let library = |value: Option<material::Sourced>| value.map(|sourced| sourced.value);
                let (by_strength, by_hardness) = match class.rule() {
                    Rule::Strength => (library(found.tensile_strength_n_per_mm2), None),
                    Rule::Hardness { .. } => (None, library(found.brinell_hardness)),
                    Rule::Fixed { .. } | Rule::Stated { .. } => (None, None),
                };
                Some(Work { class, strength: strength.or(by_strength), hardness: hardness.or(by_hardness) })
            }
            _ => {
                self.add(Finding::new("material_or_class", self.pointer));
                None
            }
        }
    }

    fn row(&mut self, class: WorkMaterial) -> Option<&'static HandbookRow> {
        let (tool, wiper) = (self.choice.tool_material, self.choice.wiper_edge);
        let found = class.rows().iter().find(|row| row.tool_material == tool && row.wiper_edge == wiper);
        if found.is_none() {
            self.fault("no_handbook_row", if wiper { "wiper_edge" } else { "tool_material" });
        }
        found
    }

    fn material_factors(&mut self, work: &Work) -> Option<Factors> {
        let rule = work.class.rule();
        let tool = self.choice.tool_material;
        let by_strength = matches!(rule, Rule::Strength);
        let by_hardness = matches!(rule, Rule::Hardness { .. });
        let stated = matches!(rule, Rule::Stated { .. });
        let strength = self.property("tensile_strength_n_per_mm2", work.strength, by_strength, "N/mm2");
        let hardness = self.property("brinell_hardness", work.hardness, by_hardness, "1");
        if self.choice.material_factor.is_some() && !stated {
            self.fault("factor_not_tabulated", "material_factor");
        }
        match rule {
            Rule::Strength => Some((material_factor::of_strength(strength?, tool), Certainty::Likely)),
            Rule::Hardness { reference } => {
                Some((material_factor::of_hardness(hardness? / reference, tool), Certainty::Likely))
            }
            Rule::Fixed { factor, certainty } => Some((Triple::of(factor, factor, factor), certainty)),
            Rule::Stated { least, largest } => self.stated_factor(least, largest),
        }
    }

    /// A property that K_m needs, and that is no use where K_m does not.
    fn property(&mut self, field: &str, value: Option<f64>, needed: bool, unit: &'static str) -> Option<f64> {
        match value {
            Some(value) if needed && rules::positive(value) => return Some(value),
            Some(value) if needed => {
                let most = if unit == "1" { MOST_HARDNESS } else { MOST_STRENGTH_N_PER_MM2 };
                let finding = Finding::new("bad_work_material", self.at(field)).measured(value, 0.0, unit);
                self.add(finding.with("above", 0.0).with("maximum", most));
            }
            None if needed => self.fault("bad_work_material", field),
            Some(_) => self.fault("factor_not_tabulated", field),
            None => {}
        }
        None
    }

    fn stated_factor(&mut self, least: f64, largest: f64) -> Option<Factors> {
        let finding = |code, at: String| Finding::new(code, at).with("least", least).with("largest", largest);
        let at = self.at("material_factor");
        match self.choice.material_factor {
            None => self.add(finding("material_factor_missing", at)),
            Some(factor) if (least..=largest).contains(&factor) => {
                return Some((Triple::of(factor, factor, factor), Certainty::ToBeChecked));
            }
            Some(factor) => {
                let limit = if factor > largest { largest } else { least };
                let finding = finding("material_factor_outside_table", at).measured(factor, limit, "1");
                self.add(finding.within(least, largest));
            }
        }
        None
    }

    /// K_phi K_gamma K_lambda K_r.
    fn geometry_factors(&mut self) -> Option<Factors> {
        use Reading::{Linear, LogLog};
        let choice = self.choice;
        let angle = choice.cutting_edge_angle_deg;
        let angle_ok = angle > 0.0 && angle <= MOST_EDGE_ANGLE_DEG;
        if !angle_ok {
            let most = ("maximum", MOST_EDGE_ANGLE_DEG);
            self.add(rules::bad_lead_angle(angle, most, self.at("cutting_edge_angle_deg")));
        }
        let radius = choice.nose_radius_mm.filter(|&radius| rules::not_negative(radius));
        if let (None, Some(bad)) = (radius, choice.nose_radius_mm) {
            self.add(rules::bad_nose_radius(bad, "above", self.at("nose_radius_mm")));
        }
        let (phi, gamma) = match choice.tool_material {
            ToolMaterial::Carbide => (&factors::LEAD_ANGLE_CARBIDE[..], &factors::RAKE_CARBIDE[..]),
            ToolMaterial::Hss => (&factors::LEAD_ANGLE_HSS[..], &factors::RAKE_HSS[..]),
        };
        let (lambda, nose) = match choice.tool_material {
            ToolMaterial::Carbide => (Some(&factors::INCLINATION[..]), None),
            ToolMaterial::Hss => (None, Some(&factors::NOSE_RADIUS_HSS[..])),
        };
        let read = [
            self.read("cutting_edge_angle_deg", Some(phi), angle_ok.then_some(angle.min(LAST_EDGE_ANGLE_DEG)), Linear),
            self.read("rake_angle_deg", Some(gamma), choice.rake_angle_deg, Linear),
            self.read("inclination_deg", lambda, choice.inclination_deg, Linear),
            self.read("nose_radius_mm", nose, radius, LogLog),
        ];
        read.into_iter().try_fold((Triple::ONE, Certainty::Confirmed), |product, factor| {
            let (triple, certainty) = factor?;
            Some((product.0.times(triple), product.1.max(certainty)))
        })
    }

    /// One factor; 1 where nothing is said, a fault outside the table or where there is none.
    fn read(
        &mut self,
        field: &str,
        table: Option<&[FactorRow]>,
        value: Option<f64>,
        reading: Reading,
    ) -> Option<Factors> {
        let Some(value) = value else { return Some((Triple::ONE, Certainty::Confirmed)) };
        let Some(table) = table else {
            self.fault("factor_not_tabulated", field);
            return None;
        };
        let found = factors::read(table, value, reading);
        if found.is_none() {
            let (least, largest) = factors::range(table);
            let limit = if value > largest { largest } else { least };
            let unit = if reading == Reading::LogLog { "mm" } else { "deg" };
            let finding = Finding::new("outside_handbook_table", self.at(field)).measured(value, limit, unit);
            self.add(finding.within(least, largest).with("least", least).with("largest", largest));
        }
        found
    }

    fn terms(&mut self, row: &HandbookRow, (factors, certainty): Factors) -> Option<PowerLaw> {
        let choice = self.choice;
        let rubbing = choice.rubbing.unwrap_or_default();
        let main = term(&row.main, factors.main, certainty);
        let passive = row.passive.map(|found| term(&found, factors.passive, certainty));
        let feed = row.feed.map(|found| term(&found, factors.feed, certainty));
        let passive = self.own("passive", choice.passive.as_ref(), choice.passive_to_main_ratio, passive, &main);
        let feed = self.own("feed", choice.feed.as_ref(), choice.feed_to_main_ratio, feed, &main);
        if passive.is_none() {
            self.fault("passive_force_missing", "passive");
        }
        if feed.is_none() && rubbing.feed_n > 0.0 {
            self.fault("feed_force_missing", "feed");
        }
        let Forces { passive_n, main_n, feed_n } = rubbing;
        Some(PowerLaw {
            passive: with_constant(passive?, passive_n),
            main: Some(with_constant(main, main_n)),
            feed: feed.map(|feed| with_constant(feed, feed_n)),
            wear_factor: choice.wear_factor,
            tool_material: choice.tool_material,
            cutting_edge_angle_deg: Some(choice.cutting_edge_angle_deg),
            measured_range: None,
            origin: CoefficientOrigin::Handbook,
        })
    }

    /// The user's own force, as a term or as a multiple of the main force, before the handbook's.
    fn own(
        &mut self,
        field: &'static str,
        given: Option<&PowerTerm>,
        ratio: Option<f64>,
        tabulated: Option<PowerTerm>,
        main: &PowerTerm,
    ) -> Option<PowerTerm> {
        match (given, ratio) {
            (Some(_), Some(_)) => {
                self.fault("term_or_ratio", field);
                tabulated
            }
            (Some(term), None) => {
                term.check(&self.at(field), &mut self.violations);
                Some(*term)
            }
            (None, Some(ratio)) => {
                let at = self.at(&format!("{field}_to_main_ratio"));
                self.violations.require(rules::positive(ratio), || {
                    let finding = Finding::new("bad_power_law", at).measured(ratio, 0.0, "1");
                    finding.with("above", 0.0).with("maximum", rules::MOST_FACTOR)
                });
                Some(PowerTerm { coefficient: ratio * main.coefficient, ..*main })
            }
            (None, None) => tabulated,
        }
    }
}

fn term(found: &Coefficients, correction_factor: f64, certainty: Certainty) -> PowerTerm {
    PowerTerm {
        coefficient: found.coefficient,
        depth_exponent: found.depth_exponent,
        feed_exponent: found.feed_exponent,
        speed_exponent: found.speed_exponent,
        correction_factor,
        constant_n: 0.0,
        certainty: Some(found.certainty.max(certainty)),
    }
}

fn with_constant(term: PowerTerm, constant_n: f64) -> PowerTerm {
    PowerTerm { constant_n: term.constant_n + constant_n, ..term }
}
