//! What is uncertain in a job of a shaft: its quantities, and what a draw of them changes (`certainty/1.4`).

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{Failure, Finding, Violations};
use crate::certainty::{
    self, Contradiction, Distribution, Level, OpenEffects, Pair, Quantity, Source, Uncertain, Uncertainties, WidthUnit,
    check_brought, check_correlations, check_quantities,
};
use crate::effects::DeflectionEffect;

use super::limits::{Tolerance, Uncertainty};
use super::{Asked, Draw, along};

const UM_PER_MM: f64 = 1e3;
/// Standard uncertainty of the diameter that a tool is set to, where nobody states it, um.
const TOOL_SETTING_UM: f64 = 2.0;
/// A relative uncertainty above this share is one of the logarithm.
const LARGEST_NORMAL_PERCENT: f64 = 25.0;

/// Codes of the faults found here.
pub(crate) const CODES: &[&str] = &[
    "tolerance_given_twice",
    "limits_crossed",
    "level_of_quantity",
    "correlation_length_missing",
    "correlation_length_too_short",
    "correlation_length_unused",
    "place_correlated",
];

/// Codes of what may be doubted, in the picture of the doubt.
pub(crate) const DOUBT_LABELS: &[&str] = &[
    "doubt_force",
    "doubt_stiffness",
    "doubt_youngs_modulus",
    "doubt_headstock_compliance",
    "doubt_tailstock_compliance",
    "doubt_rest_compliance",
    "doubt_carriage_compliance",
    "doubt_rest_gap",
    "doubt_tool_setting",
    "doubt_stock_diameter",
    "doubt_spindle_scatter",
    certainty::picture::MODEL_LABEL,
];

/// A quantity that is not known exactly.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum DeflectionQuantity {
    /// Factor on all cutting forces.
    Force,
    /// All compliances are divided by this factor.
    Stiffness,
    /// Factor on Young's modulus.
    YoungsModulus,
    /// Factor on the compliance of the leftmost carrying support.
    HeadstockCompliance,
    /// Factor on the compliance of the rightmost carrying support.
    TailstockCompliance,
    /// Factor on the compliance of all rests.
    RestCompliance,
    /// Factor on the compliance of the carriage.
    CarriageCompliance,
    /// Added to the gaps of one-sided rests.
    RestGap,
    /// Added to the diameter that the tool is set to.
    ToolSetting,
    /// Added to the diameter of the blank.
    StockDiameter,
    /// Added to the diameter that is left.
    SpindleScatter,
}

impl Quantity for DeflectionQuantity {
    fn name(self) -> &'static str {
        match self {
            Self::Force => "force",
            Self::Stiffness => "stiffness",
            Self::YoungsModulus => "youngs_modulus",
            Self::HeadstockCompliance => "headstock_compliance",
            Self::TailstockCompliance => "tailstock_compliance",
            Self::RestCompliance => "rest_compliance",
            Self::CarriageCompliance => "carriage_compliance",
            Self::RestGap => "rest_gap",
            Self::ToolSetting => "tool_setting",
            Self::StockDiameter => "stock_diameter",
            Self::SpindleScatter => "spindle_scatter",
        }
    }

    fn unit(self) -> WidthUnit {
        match self {
            Self::RestGap | Self::ToolSetting | Self::StockDiameter | Self::SpindleScatter => WidthUnit::Um,
            _ => WidthUnit::Percent,
        }
    }
}

/// What `stiffness` stands for.
const PARTS_OF_STIFFNESS: [DeflectionQuantity; 5] = [
    DeflectionQuantity::YoungsModulus,
    DeflectionQuantity::HeadstockCompliance,
    DeflectionQuantity::TailstockCompliance,
    DeflectionQuantity::RestCompliance,
    DeflectionQuantity::CarriageCompliance,
];

impl DeflectionQuantity {
    /// Whether it may be new at every place along a part: what is added to a diameter.
    fn varies_along(self) -> bool {
        matches!(self, Self::ToolSetting | Self::StockDiameter | Self::SpindleScatter)
    }

    fn usual_level(self) -> Level {
        match self {
            Self::StockDiameter | Self::SpindleScatter => Level::Part,
            _ => Level::Setup,
        }
    }

    /// Whether it is a part of what `stiffness` stands for.
    fn is_of_stiffness(self) -> bool {
        PARTS_OF_STIFFNESS.contains(&self)
    }

    /// The effect that is the same quantity, as a diagnosis finds it; `None` where there is none.
    fn effect(self) -> Option<&'static str> {
        match self {
            Self::Force => Some("force_level"),
            Self::YoungsModulus => Some("bending_scale"),
            Self::HeadstockCompliance => Some("headstock_compliance"),
            Self::TailstockCompliance => Some("tailstock_compliance"),
            Self::CarriageCompliance => Some("carriage_compliance"),
            // What an offset was says nothing of how the tool is set the next time.
            Self::ToolSetting
            | Self::Stiffness
            | Self::RestCompliance
            | Self::RestGap
            | Self::StockDiameter
            | Self::SpindleScatter => None,
        }
    }

    /// Whether what is not known of the effects of a job tells of it.
    fn is_brought(self, asked: &Asked<'_>) -> bool {
        self.effect().is_some_and(|kind| certainty::open::tells_of(asked.effects, &asked.uncertainty.effects, kind))
    }

    /// Puts its value, a factor or an addition in um, into a draw.
    fn put(self, value: f64, draw: &mut Draw) {
        match self {
            Self::Force => draw.force *= value,
            Self::Stiffness => draw.stiffness *= value,
            Self::YoungsModulus => draw.youngs_modulus *= value,
            Self::HeadstockCompliance => draw.headstock *= value,
            Self::TailstockCompliance => draw.tailstock *= value,
            Self::RestCompliance => draw.rests *= value,
            Self::CarriageCompliance => draw.carriage *= value,
            Self::RestGap => draw.rest_gap_mm += value / UM_PER_MM,
            Self::ToolSetting => draw.tool_setting_mm += 0.5 * value / UM_PER_MM,
            Self::StockDiameter => draw.stock_mm += 0.5 * value / UM_PER_MM,
            Self::SpindleScatter => draw.scatter_mm += 0.5 * value / UM_PER_MM,
        }
    }
}

/// How a quantity is distributed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DeflectionUncertainQuantity {
    /// Which.
    #[schema(example = "tool_setting")]
    pub quantity: DeflectionQuantity,
    /// How it is distributed about what the job states.
    pub distribution: Distribution,
    /// Among what it varies; not said: blank and spindle from part to part, all others from set-up to set-up. `place` is for normal
    /// additions to a diameter, with `correlation_length_mm`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = "setup")]
    pub level: Option<Level>,
    /// How far apart places are at which the correlation of a quantity of the level `place` is 0.48.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1.0, maximum = 100_000.0, example = 80.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("l"))))]
    pub correlation_length_mm: Option<f64>,
}

/// How two quantities go together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DeflectionCorrelation {
    /// Which two.
    #[schema(min_items = 2, max_items = 2, example = json!(["force", "stiffness"]))]
    pub between: Vec<DeflectionQuantity>,
    /// Correlation of their standard normal scores.
    #[schema(exclusive_minimum = -1.0, exclusive_maximum = 1.0, example = -0.3, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("rho"))))]
    pub coefficient: f64,
}

/// A quantity, of one mode where it is new at every place along a part.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct OneQuantity {
    quantity: DeflectionQuantity,
    mode: Option<usize>,
}

impl OneQuantity {
    pub(super) fn is_mode(self) -> bool {
        self.mode.is_some()
    }
}

impl Quantity for OneQuantity {
    fn name(self) -> &'static str {
        self.quantity.name()
    }

    fn unit(self) -> WidthUnit {
        self.quantity.unit()
    }
}

/// What modes of quantities are at the places of a part, for errors of standard deviation 1.
pub(super) type Modes = Vec<Vec<f64>>;

/// All quantities of a checked job that are uncertain, how they go together, and their modes at the places of a part.
pub(super) fn uncertainties(
    asked: &Asked<'_>,
    z_mm: &[f64],
) -> Result<(Uncertainties<OneQuantity>, Modes), Contradiction> {
    let stated = asked.uncertainty;
    let (mut of, mut modes): (Vec<Uncertain<OneQuantity>>, Modes) = (Vec::new(), Vec::new());
    for one in &stated.quantities {
        let uncertain = |mode: Option<usize>| Uncertain {
            quantity: OneQuantity { quantity: one.quantity, mode },
            distribution: one.distribution.clone(),
            level: one.level.unwrap_or(one.quantity.usual_level()),
            source: Source::Stated,
        };
        match one.correlation_length_mm.filter(|_| one.level == Some(Level::Place)) {
            Some(length_mm) => {
                for mode in along::modes(z_mm, length_mm) {
                    of.push(uncertain(Some(modes.len())));
                    modes.push(mode);
                }
            }
            None => of.push(uncertain(None)),
        }
    }
    for usual in usual(asked) {
        let is_stated = stated.quantities.iter().any(|one| {
            one.quantity == usual.quantity
                || usual.quantity == DeflectionQuantity::Stiffness && one.quantity.is_of_stiffness()
        });
        if !is_stated && !is_replaced(asked, usual.quantity) && (stated.defaults || usual.source == Source::Stated) {
            let Uncertain { quantity, distribution, level, source } = usual;
            of.push(Uncertain { quantity: OneQuantity { quantity, mode: None }, distribution, level, source });
        }
    }
    let pairs = single(&pairs(stated));
    let of = Uncertainties::new(of, pairs.iter().map(|(between, coefficient)| (&between[..], *coefficient)))?;
    Ok((of.beside(OpenEffects::of(asked.effects, &stated.effects)), modes))
}

/// Pairs of the contract; what is new at every place goes together with nothing.
fn single(pairs: &[Pair<'_, DeflectionQuantity>]) -> Vec<(Vec<OneQuantity>, f64)> {
    let one = |quantity: &DeflectionQuantity| OneQuantity { quantity: *quantity, mode: None };
    pairs.iter().map(|(between, coefficient)| (between.iter().map(one).collect(), *coefficient)).collect()
}

/// Whether what is usual of a quantity gives way to what is told of an effect: of itself, or of a part of it.
fn is_replaced(asked: &Asked<'_>, usual: DeflectionQuantity) -> bool {
    let parts = PARTS_OF_STIFFNESS.into_iter().filter(|_| usual == DeflectionQuantity::Stiffness);
    std::iter::once(usual).chain(parts).any(|quantity| quantity.is_brought(asked))
}

fn pairs(stated: &Uncertainty) -> Vec<Pair<'_, DeflectionQuantity>> {
    stated.correlations.iter().map(|pair| (&pair.between[..], pair.coefficient)).collect()
}

/// What is cut with where the quantities come to this; `effects` are those that the job states.
pub(super) fn draw_of(
    (of, modes): (&Uncertainties<OneQuantity>, &Modes),
    effects: &[DeflectionEffect],
    values: &[f64],
) -> Result<Draw, Failure> {
    let mut draw = Draw { effects: of.effects.effects(effects, of.of_effects(values))?, ..Draw::STATED };
    for (OneQuantity { quantity, mode }, value) in of.drawn(values) {
        match mode.and_then(|mode| modes.get(mode)) {
            Some(mode) => draw.along.add(quantity, mode, value),
            None => quantity.put(value, &mut draw),
        }
    }
    Ok(draw)
}

impl Asked<'_> {
    /// Relative standard uncertainty of force and of stiffness: as a quantity states it, else in percent; `None` where what is not
    /// known of the effects takes its place.
    pub(crate) fn of_force_and_stiffness(&self) -> [Option<f64>; 2] {
        let Uncertainty { quantities, force_percent, stiffness_percent, .. } = self.uncertainty;
        let of = |quantity, percent: f64| match quantities.iter().find(|one| one.quantity == quantity) {
            Some(one) => Some(one.distribution.relative()),
            None => (!is_replaced(self, quantity)).then_some(percent / 100.0),
        };
        [of(DeflectionQuantity::Force, *force_percent), of(DeflectionQuantity::Stiffness, *stiffness_percent)]
    }

    /// The effects where one standard deviation of what is not known of them acts, up and down; each is independent of the next.
    pub(crate) fn off_effects(&self) -> Result<Vec<[Vec<DeflectionEffect>; 2]>, Failure> {
        let open = OpenEffects::of(self.effects, &self.uncertainty.effects);
        let off = |score: usize, by: f64| -> Result<Vec<DeflectionEffect>, Failure> {
            let independent: Vec<f64> = (0..open.dimensions()).map(|own| if own == score { by } else { 0.0 }).collect();
            Ok(open.effects(self.effects, &open.values(&independent))?.unwrap_or_default())
        };
        (0..open.dimensions()).map(|score| Ok([off(score, 1.0)?, off(score, -1.0)?])).collect()
    }
}

/// What is uncertain in every job, as far as it is not stated otherwise.
fn usual(asked: &Asked<'_>) -> Vec<Uncertain<DeflectionQuantity>> {
    let Uncertainty { force_percent, stiffness_percent, .. } = *asked.uncertainty;
    let usual = Uncertainty::default();
    let source = |percent: f64, usual: f64| {
        if percent.to_bits() == usual.to_bits() { Source::Default } else { Source::Stated }
    };
    let mut all = vec![
        Uncertain {
            quantity: DeflectionQuantity::Force,
            distribution: Distribution::Lognormal { log_standard_deviation: force_percent / 100.0 },
            level: Level::Setup,
            source: source(force_percent, usual.force_percent),
        },
        Uncertain {
            quantity: DeflectionQuantity::Stiffness,
            distribution: if stiffness_percent > LARGEST_NORMAL_PERCENT {
                Distribution::Lognormal { log_standard_deviation: stiffness_percent / 100.0 }
            } else {
                Distribution::normal_percent(stiffness_percent)
            },
            level: Level::Setup,
            source: source(stiffness_percent, usual.stiffness_percent),
        },
        Uncertain {
            quantity: DeflectionQuantity::ToolSetting,
            distribution: Distribution::normal_um(TOOL_SETTING_UM),
            level: Level::Setup,
            source: Source::Default,
        },
    ];
    all.extend(asked.effects.iter().filter_map(|effect| match *effect {
        DeflectionEffect::SpindleScatter { sd_um } => Some(Uncertain {
            quantity: DeflectionQuantity::SpindleScatter,
            // Of the radius.
            distribution: Distribution::normal_um(2.0 * sd_um),
            level: Level::Part,
            source: Source::Stated,
        }),
        _ => None,
    }));
    all
}

/// Finds what cannot be in the uncertainty and in the limits of size.
pub(crate) fn check(asked: &Asked<'_>, violations: &mut Violations) {
    check_limits(asked.tolerance, violations);
    let stated = asked.uncertainty;
    let quantities: Vec<_> = stated.quantities.iter().map(|one| (one.quantity, &one.distribution)).collect();
    check_quantities(&quantities, violations);
    certainty::open::check(asked.effects, &stated.effects, violations);
    check_brought(quantities.iter().map(|(quantity, _)| *quantity), |one| one.is_brought(asked), violations);
    check_correlations(&pairs(stated), &quantities, || uncertainties(asked, &[]).err(), violations);
    check_levels(asked, violations);
}

/// Finds levels that a quantity cannot have: along a part there are normal additions to a diameter alone.
fn check_levels(asked: &Asked<'_>, violations: &mut Violations) {
    let stated = asked.uncertainty;
    let is_place = |one: &DeflectionUncertainQuantity| one.level == Some(Level::Place);
    for (i, one) in stated.quantities.iter().enumerate() {
        let at = |field: &str| format!("/uncertainty/quantities/{i}/{field}");
        let length = one.correlation_length_mm;
        if !is_place(one) {
            violations.require(length.is_none(), || {
                Finding::new("correlation_length_unused", at("correlation_length_mm"))
                    .with("quantity", one.quantity.name())
            });
            continue;
        }
        let is_normal = matches!(one.distribution, Distribution::Normal { .. });
        violations.require(asked.places_over_mm.is_some() && one.quantity.varies_along() && is_normal, || {
            Finding::new("level_of_quantity", at("level"))
                .with("quantity", one.quantity.name())
                .with("has_places", if asked.places_over_mm.is_some() { "yes" } else { "no" })
        });
        violations.require(length.is_some(), || {
            Finding::new("correlation_length_missing", at("correlation_length_mm"))
                .with("quantity", one.quantity.name())
        });
        let (length_mm, least_mm) =
            (length.unwrap_or(f64::MAX), along::least_length_mm(asked.places_over_mm.unwrap_or(0.0)));
        violations.require(length_mm >= least_mm, || {
            Finding::new("correlation_length_too_short", at("correlation_length_mm"))
                .measured(length_mm, least_mm, "mm")
                .with("quantity", one.quantity.name())
        });
    }
    for (i, pair) in stated.correlations.iter().enumerate() {
        let along = stated.quantities.iter().find(|one| is_place(one) && pair.between.contains(&one.quantity));
        if let Some(along) = along {
            violations.add(
                Finding::new("place_correlated", format!("/uncertainty/correlations/{i}/between"))
                    .with("quantity", along.quantity.name()),
            );
        }
    }
}

fn check_limits(tolerance: &Tolerance, violations: &mut Violations) {
    let limits = [tolerance.diameter_upper_um, tolerance.diameter_lower_um];
    violations.require(tolerance.diameter_um.is_none() || limits.iter().all(Option::is_none), || {
        Finding::new("tolerance_given_twice", "/tolerance/diameter_um")
    });
    if let [Some(upper), Some(lower)] = limits {
        violations.require(lower < upper, || {
            Finding::new("limits_crossed", "/tolerance/diameter_lower_um")
                .measured(lower, upper, "um")
                .with("below", upper)
        });
    }
}
