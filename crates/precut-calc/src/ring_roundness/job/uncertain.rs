//! What is uncertain in the setting of a ring: its quantities, and what a draw of them changes (`certainty/1.4`).

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::Violations;
use crate::certainty::{
    Block, Contradiction, Distribution, Level, OpenEffects, Quantity, Uncertainties, WidthUnit, check_brought,
    normal_below, open, uncertainty_block,
};
use crate::effects::JointUncertainty;

use crate::ring_roundness::job::input::Job;
use crate::ring_roundness::model::scene::Scene;
use crate::ring_roundness::model::stance::{Stance, at_radius, through_tip};
use crate::ring_roundness::model::turning::Setting;
use crate::ring_roundness::model::turning::plane::{Vec2, add, rotated, scaled, sub};

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

    /// The effect that is the same quantity, as a diagnosis finds it; `None` where there is none.
    fn effect(self) -> Option<&'static str> {
        match self {
            Self::ComplianceRatio => Some("tool_push_off"),
            Self::RollerRunout => Some("roller_runout"),
            Self::ToolAngle | Self::SupportHalfAngle | Self::BlankAmplitude => None,
        }
    }

    /// Whether what is not known of the effects of the job tells of it.
    fn is_brought(self, job: &Job) -> bool {
        self.effect().is_some_and(|kind| open::tells_of(&job.effects, &job.uncertainty.effects, kind))
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

uncertainty_block! {
    /// What is uncertain, and which probability is wanted; acts with the analysis `certainty`.
    RingUncertainty {
        quantities: RingUncertainQuantity of RingQuantity (max_items = 5), such as "tool_angle";
        correlations: RingCorrelation (10), such as ["tool_angle", "support_half_angle"];
        effects: Vec<JointUncertainty>;
        /// Whether what is usual is uncertain, too, where nothing is said of it: both angles, compliance ratio, run-out of the
        /// rollers, the blank.
        defaults;
        /// Probability that the ring is within its tolerance that is wanted; below it the answer warns.
        wanted_probability;
    }
}

/// All quantities of a checked job that are uncertain, and how they go together.
pub(in crate::ring_roundness) fn uncertainties(job: &Job) -> Result<Uncertainties<RingQuantity>, Contradiction> {
    let block = &job.uncertainty;
    let of = |quantity: RingQuantity| {
        let is_usual = quantity.missing_in(job).is_none() && !quantity.is_brought(job);
        block.uncertain(quantity, quantity.level(), is_usual.then(|| quantity.usual()))
    };
    let of = RingQuantity::ALL.into_iter().filter_map(of).collect();
    Ok(Uncertainties::new(of, block.pairs())?.beside(OpenEffects::of(&job.effects, &block.effects)))
}

/// Finds what cannot be.
pub(in crate::ring_roundness) fn check(job: &Job, violations: &mut Violations) {
    let block = &job.uncertainty;
    block.check(|| uncertainties(job).err(), |quantity| quantity.missing_in(job), violations);
    open::check(&job.effects, &block.effects, violations);
    check_brought(block.quantities.iter().map(|one| one.quantity), |one| one.is_brought(job), violations);
}

/// Scores beside those of the quantities: where the blank and where the rollers stand when the ring begins to turn, of which
/// nothing is known.
pub(in crate::ring_roundness) const PHASES: usize = 2;

/// A ring as it may be set up.
pub(in crate::ring_roundness) struct Drawn {
    pub setting: Setting,
    /// Factor on what the blank is out of round.
    pub waves: f64,
    /// How far the blank is turned, as a share of a turn.
    pub turned: f64,
}

/// The ring where the quantities come to this, with the scores of the phases; `None` where it would not rest so.
pub(in crate::ring_roundness) fn drawn(
    scene: &Scene,
    end: &Stance,
    of: &Uncertainties<RingQuantity>,
    values: &[f64],
    phases: [f64; PHASES],
) -> Option<Drawn> {
    let value = |quantity| of.drawn(values).find(|(own, _)| *own == quantity).map(|(_, value)| value);
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
