//! How what a part is cut with differs from what its job states.

use crate::effects::DeflectionEffect;
use crate::shaft::elastic::ends;
use crate::shaft::{Carriage, Support};

use super::quantities::DeflectionQuantity;

const UM_PER_MM: f64 = 1e3;

/// How what is cut with differs from what the job states.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Draw {
    /// Factor on all cutting forces.
    pub(crate) force: f64,
    /// All compliances are divided by it.
    pub(crate) stiffness: f64,
    /// Factor on Young's modulus.
    pub(crate) youngs_modulus: f64,
    /// Factors on compliances.
    pub(crate) headstock: f64,
    pub(crate) tailstock: f64,
    pub(crate) rests: f64,
    pub(crate) carriage: f64,
    /// Added to the gaps of one-sided rests, mm.
    pub(crate) rest_gap_mm: f64,
    /// Added to the radius that the tool is set to, mm.
    pub(crate) tool_setting_mm: f64,
    /// Added to the radius of the blank, mm.
    pub(crate) stock_mm: f64,
    /// Added to the radius that is left, mm.
    pub(crate) scatter_mm: f64,
    /// The same along the part, by its places; empty where there is none.
    pub(crate) along: Along,
    /// Effects in place of those of the job.
    pub(crate) effects: Option<Vec<DeflectionEffect>>,
}

/// What is added to radii, by the places of a part.
#[derive(Debug, Clone, PartialEq)]
#[allow(clippy::struct_field_names)] // the unit
pub(crate) struct Along {
    tool_setting_mm: Vec<f64>,
    stock_mm: Vec<f64>,
    scatter_mm: Vec<f64>,
}

impl Along {
    const NONE: Self = Self { tool_setting_mm: Vec::new(), stock_mm: Vec::new(), scatter_mm: Vec::new() };

    /// Adds a mode of a quantity of the diameter, um; of no other quantity there are modes.
    pub(super) fn add(&mut self, quantity: DeflectionQuantity, mode: &[f64], um: f64) {
        let own = match quantity {
            DeflectionQuantity::ToolSetting => &mut self.tool_setting_mm,
            DeflectionQuantity::StockDiameter => &mut self.stock_mm,
            DeflectionQuantity::SpindleScatter => &mut self.scatter_mm,
            _ => return,
        };
        own.resize(mode.len(), 0.0);
        own.iter_mut().zip(mode).for_each(|(own, mode)| *own += 0.5 * um * mode / UM_PER_MM);
    }
}

impl Draw {
    /// What is added to the radius that the tool is set to, to that of the blank and to that which is left, at a place of the part.
    pub(crate) fn added_mm(&self, place: usize) -> [f64; 3] {
        let at = |along: &[f64]| along.get(place).copied().unwrap_or(0.0);
        let Along { tool_setting_mm, stock_mm, scatter_mm } = &self.along;
        [self.tool_setting_mm + at(tool_setting_mm), self.stock_mm + at(stock_mm), self.scatter_mm + at(scatter_mm)]
    }

    /// As the job states.
    pub(crate) const STATED: Self = Self {
        force: 1.0,
        stiffness: 1.0,
        youngs_modulus: 1.0,
        headstock: 1.0,
        tailstock: 1.0,
        rests: 1.0,
        carriage: 1.0,
        rest_gap_mm: 0.0,
        tool_setting_mm: 0.0,
        stock_mm: 0.0,
        scatter_mm: 0.0,
        along: Along::NONE,
        effects: None,
    };

    /// Whether it differs by more than loads that are all multiplied by one number.
    #[allow(clippy::float_cmp)] // what is stated is stated exactly
    pub(crate) fn changes_structure(&self) -> bool {
        let Self { youngs_modulus, headstock, tailstock, rests, carriage, rest_gap_mm, ref effects, .. } = *self;
        [youngs_modulus, headstock, tailstock, rests, carriage] != [1.0; 5] || rest_gap_mm != 0.0 || effects.is_some()
    }

    /// Puts factors on what holds the shaft and what carries the tool.
    pub(crate) fn yield_in(&self, supports: &mut [Support], carriage: &mut Carriage) {
        let (head, tail) = ends(supports);
        for (i, support) in supports.iter_mut().enumerate() {
            let factor = if !support.carries() {
                self.rests
            } else if Some(i) == head {
                self.headstock
            } else if Some(i) == tail {
                self.tailstock
            } else {
                1.0
            };
            support.yield_times(factor);
        }
        carriage.compliance_um_per_n *= self.carriage;
        carriage.tangential_compliance_um_per_n *= self.carriage;
    }

    /// Factors on cutting forces and on weight that do what they and the compliances of all do: all compliances smaller by one factor
    /// move the shaft as loads that are smaller by it.
    pub(crate) fn loads(&self) -> [f64; 2] {
        [self.force / self.stiffness, 1.0 / self.stiffness]
    }
}
