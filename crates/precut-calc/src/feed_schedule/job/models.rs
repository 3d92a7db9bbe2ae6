//! The set of machinability models of a job.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::force::{Component, ForceModel, MeasuredRange};
use crate::machinability::{self, MachinabilityModel, ModelRange};

/// What comes out of a cut. A model that is not given is taken from the library's set where one is named.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Models {
    /// A set of the library: `vt9_tk20`, `khn73mbtyu_tk25`. The echoed job has its numbers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 64, example = "vt9_tk20")]
    pub library: Option<String>,
    /// Main (tangential) force P_z, N: needed for power and torque. A power law.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force_z: Option<MachinabilityModel>,
    /// Passive (radial) force P_y, N: needed for the deflection. A power law.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force_y: Option<MachinabilityModel>,
    /// Tool life T, min. A power law.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tool_life: Option<MachinabilityModel>,
    /// Roughness, um.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub roughness: Option<MachinabilityModel>,
    /// Degree of hardening, percent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hardening: Option<MachinabilityModel>,
    /// Depth of hardening, um.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hardening_depth: Option<MachinabilityModel>,
    /// Further outputs by name, reported in the answer and open to custom limits.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 20)]
    pub further: Vec<FurtherModel>,
}

/// A further output.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FurtherModel {
    /// Its name.
    #[schema(min_length = 1, max_length = 64, example = "cost")]
    pub name: String,
    /// Its unit.
    #[schema(max_length = 32, example = "rub")]
    pub unit: String,
    /// The model.
    pub model: MachinabilityModel,
}

/// An output that the schedule itself knows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Output {
    /// Main force.
    ForceZ,
    /// Passive force.
    ForceY,
    /// Tool life.
    ToolLife,
    /// Roughness.
    Roughness,
    /// Degree of hardening.
    Hardening,
    /// Depth of hardening.
    HardeningDepth,
}

impl Output {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::ForceZ, Self::ForceY, Self::ToolLife, Self::Roughness, Self::Hardening, Self::HardeningDepth];

    /// Its field in `models`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::ForceZ => "force_z",
            Self::ForceY => "force_y",
            Self::ToolLife => "tool_life",
            Self::Roughness => "roughness",
            Self::Hardening => "hardening",
            Self::HardeningDepth => "hardening_depth",
        }
    }

    /// Unit of the output.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::ForceZ | Self::ForceY => "N",
            Self::ToolLife => "min",
            Self::Roughness | Self::HardeningDepth => "um",
            Self::Hardening => "percent",
        }
    }

    /// Whether it may only be a power law: it is multiplied, divided or added to others.
    pub const fn is_power_law(self) -> bool {
        matches!(self, Self::ForceZ | Self::ForceY | Self::ToolLife)
    }
}

impl Models {
    /// The model of an output.
    pub fn get(&self, output: Output) -> Option<&MachinabilityModel> {
        match output {
            Output::ForceZ => self.force_z.as_ref(),
            Output::ForceY => self.force_y.as_ref(),
            Output::ToolLife => self.tool_life.as_ref(),
            Output::Roughness => self.roughness.as_ref(),
            Output::Hardening => self.hardening.as_ref(),
            Output::HardeningDepth => self.hardening_depth.as_ref(),
        }
    }

    /// The place of an output's model.
    pub(crate) fn slot(&mut self, output: Output) -> &mut Option<MachinabilityModel> {
        match output {
            Output::ForceZ => &mut self.force_z,
            Output::ForceY => &mut self.force_y,
            Output::ToolLife => &mut self.tool_life,
            Output::Roughness => &mut self.roughness,
            Output::Hardening => &mut self.hardening,
            Output::HardeningDepth => &mut self.hardening_depth,
        }
    }

    /// Whether a model is there, given, of the library, or out of a force model.
    pub(in crate::feed_schedule) fn has(&self, output: Output, force: Option<&ForceModel>) -> bool {
        self.get(output).is_some()
            || self.of_library(output).is_some()
            || force.is_some_and(|force| of_force(force, output).is_some() || by_depth(force, output))
    }

    /// The model that acts at a depth: that of the job, or the job's force at this very depth. A force of none at all, as
    /// the passive one of a sharp edge at 90 degrees, is none.
    pub(in crate::feed_schedule) fn at_depth(
        &self,
        output: Output,
        force: Option<&ForceModel>,
        depth_mm: f64,
    ) -> Option<Cow<'_, MachinabilityModel>> {
        if let Some(model) = self.get(output) {
            return Some(Cow::Borrowed(model));
        }
        let power = force?.monomial_at(component_of(output)?, depth_mm)?;
        (power.coefficient > 0.0).then(|| {
            let (constant, speed, feed) = (power.coefficient.ln(), power.speed_exponent, power.feed_exponent);
            Cow::Owned(MachinabilityModel::power_law(constant, speed, feed, 0.0))
        })
    }

    /// The model that acts, whether given, of the library, or out of a force model.
    pub(in crate::feed_schedule) fn acting(
        &self,
        output: Output,
        force: Option<&ForceModel>,
    ) -> Option<MachinabilityModel> {
        self.get(output)
            .cloned()
            .or_else(|| self.of_library(output))
            .or_else(|| force.and_then(|force| of_force(force, output)))
    }

    /// Whether the job's force model says nothing, because the models of the forces are given otherwise.
    pub(in crate::feed_schedule) fn ignore(&self, force: &ForceModel) -> bool {
        if [Output::ForceY, Output::ForceZ].iter().any(|&output| self.get(output).is_none() && by_depth(force, output))
        {
            return false;
        }
        let laws = [Output::ForceY, Output::ForceZ].map(|output| (self.get(output), of_force(force, output)));
        laws.iter().all(|(model, law)| law.is_none() || model.map(law_of) != law.as_ref().map(law_of))
    }

    fn of_library(&self, output: Output) -> Option<MachinabilityModel> {
        let set = self.library.as_deref().and_then(machinability::find_set)?;
        set.models.iter().find(|model| model.output == output.name()).map(machinability::LibraryModel::model)
    }

    /// Writes the library's numbers and the force model's power laws into the places left open.
    pub(in crate::feed_schedule) fn fill(&mut self, force: Option<&ForceModel>) {
        for output in Output::ALL {
            let model = self.acting(output, force);
            *self.slot(output) = model;
        }
        if let Some(set) = self.library.take().as_deref().and_then(machinability::find_set) {
            for model in set.models {
                let known = Output::ALL.iter().any(|output| output.name() == model.output);
                if !known && !self.further.iter().any(|further| further.name == model.output) {
                    self.further.push(FurtherModel {
                        name: model.output.to_owned(),
                        unit: model.unit.to_owned(),
                        model: model.model(),
                    });
                }
            }
        }
    }
}

/// The numbers of a model of first order.
fn law_of(model: &MachinabilityModel) -> [f64; 5] {
    [model.constant, model.speed_exponent, model.feed_exponent, model.depth_exponent, model.angle_exponent]
}

fn component_of(output: Output) -> Option<Component> {
    match output {
        Output::ForceY => Some(Component::Passive),
        Output::ForceZ => Some(Component::Main),
        _ => None,
    }
}

/// Whether the force is a product of powers of feed and speed at every depth, but not over depths.
fn by_depth(force: &ForceModel, output: Output) -> bool {
    let at = |component| force.monomial(component).is_none() && force.monomial_at(component, 1.0).is_some();
    component_of(output).is_some_and(at)
}

/// The power law of a force component, where the force model is one without a constant part (`deflection/6.1`).
fn of_force(force: &ForceModel, output: Output) -> Option<MachinabilityModel> {
    let power = force.monomial(component_of(output)?)?;
    let mut model = MachinabilityModel::power_law(
        power.coefficient.ln(),
        power.speed_exponent,
        power.feed_exponent,
        power.depth_exponent,
    );
    model.source = Some("force model of the job".to_owned());
    model.range = force.measured_range().as_ref().map(range_of);
    Some(model)
}

/// The ranges of a force law's trials as those of a model; from 0 on is no least value.
fn range_of(measured: &MeasuredRange) -> ModelRange {
    let above_none = |least: f64| (least > 0.0).then_some(least);
    ModelRange {
        least_speed_m_per_min: above_none(measured.least_speed_m_per_min),
        largest_speed_m_per_min: Some(measured.largest_speed_m_per_min),
        least_feed_mm_per_rev: above_none(measured.least_feed_mm_per_rev),
        largest_feed_mm_per_rev: Some(measured.largest_feed_mm_per_rev),
        least_depth_mm: above_none(measured.least_depth_mm),
        largest_depth_mm: Some(measured.largest_depth_mm),
        ..ModelRange::default()
    }
}
