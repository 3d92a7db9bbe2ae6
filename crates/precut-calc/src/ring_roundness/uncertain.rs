//! What is uncertain in the setting of a ring: its quantities, and what a draw of them changes (`certainty/1.4`).

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::Violations;
use crate::certainty::{
    Contradiction, Distribution, Level, Pair, Quantity, Source, Uncertain, Uncertainties, WidthUnit,
    check_correlations, check_presence, check_quantities, normal_below,
};

use super::input::Job;
use super::scene::Scene;
use super::stance::{Stance, at_radius, through_tip};
use super::turning::Setting;
use super::turning::plane::{Vec2, add, rotated, scaled, sub};

/// Standard deviation of what nobody states: of angles in deg, of factors that of their logarithm.
const ANGLE_DEG: f64 = 0.1;
const COMPLIANCE_RATIO: f64 = 0.3;
const AMPLITUDE: f64 = 0.2;

/// A quantity of a ring's setting that is not known exactly.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum RingQuantity {
    /// Added to the tool angle seen from the ring's centre, the finished radius as it is.
    ToolAngle,
    /// Added to the support half angle, the finished radius and the tool angle as they are.
    SupportHalfAngle,
    /// Factor on the compliance ratio.
    ComplianceRatio,
    /// Factor on the run-out of the rollers.
    RollerRunout,
    /// Factor on what the blank is out of round.
    BlankAmplitude,
}

impl Quantity for RingQuantity {
    fn name(self) -> &'static str {
        match self {
            Self::ToolAngle => "tool_angle",
            Self::SupportHalfAngle => "support_half_angle",
            Self::ComplianceRatio => "compliance_ratio",
            Self::RollerRunout => "roller_runout",
            Self::BlankAmplitude => "blank_amplitude",
        }
    }

    fn unit(self) -> WidthUnit {
        match self {
            Self::ToolAngle | Self::SupportHalfAngle => WidthUnit::Deg,
            _ => WidthUnit::Percent,
        }
    }
}

impl RingQuantity {
    const ALL: [Self; 5] =
        [Self::ToolAngle, Self::SupportHalfAngle, Self::ComplianceRatio, Self::RollerRunout, Self::BlankAmplitude];

    /// What is usual where nothing is said of it.
    fn usual(self) -> Distribution {
        match self {
            Self::ToolAngle | Self::SupportHalfAngle => Distribution::normal_deg(ANGLE_DEG),
            Self::ComplianceRatio => Distribution::Lognormal { log_standard_deviation: COMPLIANCE_RATIO },
            Self::RollerRunout | Self::BlankAmplitude => Distribution::Lognormal { log_standard_deviation: AMPLITUDE },
        }
    }

    fn level(self) -> Level {
        match self {
            Self::RollerRunout | Self::BlankAmplitude => Level::Part,
            _ => Level::Setup,
        }
    }

    /// The field of the job without which there is nothing of that kind, where it is not there.
    fn missing_in(self, job: &Job) -> Option<&'static str> {
        let setting = Scene::of(job, &job.effects).setting;
        match self {
            Self::ComplianceRatio if setting.compliance_ratio <= 0.0 => Some("/compliance_ratio"),
            Self::RollerRunout if setting.motion.runout_a.is_empty() && setting.motion.runout_b.is_empty() => {
                Some("/effects")
            }
            _ => None,
        }
    }
}

/// What is uncertain, and which probability is wanted; acts with the analysis `certainty`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RingUncertainty {
    /// What is uncertain, in place of what is usual or beside it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 5)]
    pub quantities: Vec<RingUncertainQuantity>,
    /// Which of them go together.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 10, extensions(("x-advanced" = json!(true))))]
    pub correlations: Vec<RingCorrelation>,
    /// Whether what is usual is uncertain, too, where nothing is said of it: both angles, compliance ratio, run-out of the
    /// rollers, the blank.
    #[serde(default = "yes")]
    #[schema(default = true, example = true)]
    pub defaults: bool,
    /// Probability that the ring is within its tolerance that is wanted; below it the answer warns.
    #[serde(default = "nineteen_of_twenty")]
    #[schema(exclusive_minimum = 0.0, exclusive_maximum = 1.0, default = 0.95, example = 0.95, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("P"))))]
    pub wanted_probability: f64,
    /// Seed of the points over which probabilities are integrated.
    #[serde(default = "one")]
    #[schema(minimum = 0, maximum = 100_000_000, default = 1, example = 1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("seed"))))]
    pub seed: u32,
}

fn yes() -> bool {
    true
}

fn nineteen_of_twenty() -> f64 {
    0.95
}

fn one() -> u32 {
    1
}

impl Default for RingUncertainty {
    fn default() -> Self {
        Self {
            quantities: Vec::new(),
            correlations: Vec::new(),
            defaults: yes(),
            wanted_probability: nineteen_of_twenty(),
            seed: one(),
        }
    }
}

/// How a quantity is distributed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RingUncertainQuantity {
    /// Which.
    #[schema(example = "tool_angle")]
    pub quantity: RingQuantity,
    /// How it is distributed about what the job states.
    pub distribution: Distribution,
}

/// How two quantities go together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RingCorrelation {
    /// Which two.
    #[schema(min_items = 2, max_items = 2, example = json!(["tool_angle", "support_half_angle"]))]
    pub between: Vec<RingQuantity>,
    /// Correlation of their standard normal scores.
    #[schema(exclusive_minimum = -1.0, exclusive_maximum = 1.0, example = 0.3, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("rho"))))]
    pub coefficient: f64,
}

/// All quantities of a checked job that are uncertain, and how they go together.
pub(super) fn uncertainties(job: &Job) -> Result<Uncertainties<RingQuantity>, Contradiction> {
    let stated = &job.uncertainty;
    let of = |quantity: RingQuantity| {
        let own = stated.quantities.iter().find(|one| one.quantity == quantity);
        let usual = stated.defaults && own.is_none() && quantity.missing_in(job).is_none();
        let (distribution, source) = match own {
            Some(own) => (own.distribution.clone(), Source::Stated),
            None if usual => (quantity.usual(), Source::Default),
            None => return None,
        };
        // One without width is known.
        let is_wide = (distribution.at(1.0) - distribution.at(-1.0)).abs() > 0.0;
        is_wide.then_some(Uncertain { quantity, distribution, level: quantity.level(), source })
    };
    Uncertainties::new(RingQuantity::ALL.into_iter().filter_map(of).collect(), pairs(stated))
}

fn pairs(stated: &RingUncertainty) -> Vec<Pair<'_, RingQuantity>> {
    stated.correlations.iter().map(|pair| (&pair.between[..], pair.coefficient)).collect()
}

/// Finds what cannot be.
pub(super) fn check(job: &Job, violations: &mut Violations) {
    let stated = &job.uncertainty;
    let quantities: Vec<_> = stated.quantities.iter().map(|one| (one.quantity, &one.distribution)).collect();
    check_quantities(&quantities, violations);
    check_correlations(&pairs(stated), || uncertainties(job).err(), violations);
    check_presence(stated.quantities.iter().map(|one| one.quantity), |quantity| quantity.missing_in(job), violations);
}

/// Scores beside those of the quantities: where the blank and where the rollers stand when the ring begins to turn, of which
/// nothing is known.
pub(super) const PHASES: usize = 2;

/// A ring as it may be set up.
pub(super) struct Drawn {
    pub setting: Setting,
    /// Factor on what the blank is out of round.
    pub waves: f64,
    /// How far the blank is turned, as a share of a turn.
    pub turned: f64,
}

/// The ring where the quantities come to this, with the scores of the phases; `None` where it would not rest so.
pub(super) fn drawn(
    scene: &Scene,
    end: &Stance,
    of: &Uncertainties<RingQuantity>,
    values: &[f64],
    phases: [f64; PHASES],
) -> Option<Drawn> {
    let value = |quantity| of.of.iter().zip(values).find(|(one, _)| one.quantity == quantity).map(|(_, value)| *value);
    let angle_rad = |quantity| value(quantity).unwrap_or(0.0).to_radians();
    let factor = |quantity| value(quantity).unwrap_or(1.0);
    // Seen in the mirror, angles run the other way.
    let tool_rad = if scene.mirrored { -1.0 } else { 1.0 } * angle_rad(RingQuantity::ToolAngle);
    let mut setting = scene.setting.clone();
    let apart = (end.half_angle_rad + angle_rad(RingQuantity::SupportHalfAngle)).sin() / end.half_angle_rad.sin();
    let middle = scaled(add(setting.support_a_mm, setting.support_b_mm), 0.5);
    let moved = |support: Vec2| add(middle, scaled(sub(support, middle), apart));
    (setting.support_a_mm, setting.support_b_mm) = (moved(setting.support_a_mm), moved(setting.support_b_mm));
    let centre_mm = at_radius(&setting, setting.tip_start_mm, end.radius_mm)?.centre_mm;
    setting.tip_start_mm = add(centre_mm, rotated(sub(setting.tip_start_mm, end.centre_mm), tool_rad));
    setting.feed_direction = rotated(setting.feed_direction, tool_rad);
    let rests = through_tip(&setting, setting.tip_end_mm())?;
    setting.compliance_ratio = scene.softness.ratio(&rests.copying()) * factor(RingQuantity::ComplianceRatio);
    let runout = factor(RingQuantity::RollerRunout);
    for own in setting.motion.runout_a.iter_mut().chain(&mut setting.motion.runout_b) {
        own.amplitude_mm *= runout;
        own.phase_rad += TAU * normal_below(phases[1]);
    }
    let waves = factor(RingQuantity::BlankAmplitude);
    Some(Drawn { setting, waves, turned: normal_below(phases[0]) })
}
