//! The answer's parts about settings: which waves grow, the maps, and the search.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What becomes of waves, to first order in their size.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = RingLinearOutcome)]
pub struct LinearOutcome {
    /// One entry per order from 2.
    pub orders: Vec<OrderOutcome>,
    /// Roots of the characteristic equation by rising lobes; lobes need not be whole.
    pub roots: Vec<RootOutcome>,
    /// Whether the argument principle confirms that no root is missing.
    pub complete: bool,
    /// The wave that decays slowest or grows fastest; null where every wave is gone within a revolution.
    pub worst: Option<RootOutcome>,
}

/// What becomes of a wave.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = RingOrderOutcome)]
pub struct OrderOutcome {
    /// Waves per revolution.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub order: u32,
    /// Share of an error that one pass of the tool finds, real part of A(k).
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub visibility_real: f64,
    /// Imaginary part.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub visibility_imaginary: f64,
    /// Factor on its amplitude per revolution; null where it is gone within one (below 0.0066).
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub factor_per_revolution: Option<f64>,
    /// What becomes of it.
    pub fate: Fate,
}

/// What becomes of a wave.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = RingFate)]
pub enum Fate {
    /// It grows.
    Grows,
    /// It stays.
    Stays,
    /// It decays.
    Decays,
    /// It is gone within a revolution.
    Gone,
}

impl Fate {
    /// Its name, as in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::Grows => "grows",
            Self::Stays => "stays",
            Self::Decays => "decays",
            Self::Gone => "gone",
        }
    }
}

/// A root of the characteristic equation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = RingRootOutcome)]
pub struct RootOutcome {
    /// Lobes per revolution.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub lobes: f64,
    /// Factor on the amplitude per revolution.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub factor_per_revolution: f64,
}

/// Worst wave over tool angle and support angle, row by row of the support angles. A neutral wave counts 1.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = RingMapOutcome)]
pub struct MapOutcome {
    /// Columns.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub tool_angle_deg: Vec<f64>,
    /// Rows.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub support_half_angle_deg: Vec<f64>,
    /// Factor per revolution of the worst wave; null where the tool is too near to a support, or every wave is gone.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub worst_factor_per_revolution: Vec<Option<f64>>,
    /// Its lobes.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub worst_lobes: Vec<Option<f64>>,
    /// Revolutions with the job's feed and spark-out, from a start just clear of the ring, after which the simulation is
    /// at the target; null where a wave grows or stays, and where no simulation says so.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub revolutions_to_target: Vec<Option<f64>>,
    /// Roundness that the simulation gave there, filtered; null where the cell was not simulated.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub simulated_roundness_um: Vec<Option<f64>>,
    /// Roundness that the job's feed, revolutions and spark-out give in each cell, from a start just clear of the ring,
    /// simulated and filtered; empty where `cut_everywhere` does not ask for it, null where tool or ring have no room.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub cut_roundness_um: Vec<Option<f64>>,
    /// The cell that comes out roundest so.
    pub roundest: Option<CutCell>,
    /// The cell whose worst wave decays most.
    pub best: Option<MapCell>,
    /// The job's own angles.
    pub here: MapCell,
}

/// A cell of the map.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = RingMapCell)]
pub struct MapCell {
    /// Tool angle.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub tool_angle_deg: f64,
    /// Support half angle.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub support_half_angle_deg: f64,
    /// Factor per revolution of the worst wave.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub worst_factor_per_revolution: Option<f64>,
}

/// A cell of the map that was cut.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = RingCutCell)]
pub struct CutCell {
    /// Tool angle.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub tool_angle_deg: f64,
    /// Support half angle.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub support_half_angle_deg: f64,
    /// Roundness deviation, filtered, least-squares circle.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub roundness_um: f64,
}

/// Which waves grow over the work speed, to first order: those that the geometry makes and those that the machine's modes
/// make, row by row of the orders.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = RingSpeedMapOutcome)]
pub struct SpeedMapOutcome {
    /// Columns.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub work_speed_rpm: Vec<f64>,
    /// Rows: the lowest order of each.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub lobes_from: Vec<u32>,
    /// The highest order of each.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub lobes_to: Vec<u32>,
    /// Factor per revolution of the worst wave of these orders; null where each of them is gone within a revolution.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub factor_per_revolution: Vec<Option<f64>>,
    /// The same of each row for a machine that gives as much, but at once: what the geometry makes at any speed.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub at_rest_factor_per_revolution: Vec<Option<f64>>,
    /// The worst wave of all at each speed.
    pub worst: Vec<Option<SpeedCell>>,
    /// The worst wave at the job's speed.
    pub here: Option<SpeedCell>,
    /// The speed of the map at which the worst wave is mildest.
    pub best: Option<SpeedCell>,
}

/// The worst wave at a work speed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = RingSpeedCell)]
pub struct SpeedCell {
    /// Work speed.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub work_speed_rpm: f64,
    /// Lobes per revolution.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub lobes: f64,
    /// Frequency at which they pass the tool.
    #[schema(extensions(("x-unit" = json!("Hz"))))]
    pub frequency_hz: f64,
    /// Factor on the amplitude per revolution.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub factor_per_revolution: f64,
    /// Whether it grows only because the machine swings: with one that gives as much, but at once, no wave of this order
    /// grows.
    pub is_chatter: bool,
}

/// Fewest revolutions to the target with the tool opposite to a support and fed straight down; where that does not reach it,
/// the best of a search over all angles, feeds and, where allowed, compliance ratios, by theory first, then simulated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = RingSearchOutcome)]
pub struct SearchOutcome {
    /// Whether the target can be reached, and how safely.
    pub status: SearchStatus,
    /// The setting advised; where the target is out of reach, the one that comes nearest.
    pub best: Option<SearchSetting>,
    /// Fewest revolutions of all that reached the target, without regard to their neighbours.
    pub fewest: Option<SearchSetting>,
    /// Peak to valley of the odd waves of the start profile, filtered: what stays in this setting whatever the feed.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub odd_lobes_um: f64,
    /// Orders of these waves, largest first.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub odd_orders: Vec<u32>,
    /// Settings simulated in the search over all angles; 0 where there was no need of it.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub simulated: usize,
    /// Everything tried with the tool opposite to a support, by rising revolutions.
    pub tried: TriedColumns,
    /// Two stages that help, by simulation of both; null where they are not needed or do not help.
    pub second_stage: Option<SecondStage>,
}

/// Whether the target can be reached.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = RingSearchStatus)]
pub enum SearchStatus {
    /// Reached, and also with 5 %, at least one revolution, more and fewer; found in the search over all angles, in nine of
    /// ten trials with everything a little off.
    Robust,
    /// Reached, but not with all neighbours, or in fewer of the trials.
    Fragile,
    /// Reached in two stages, simulated one after the other, and not in one.
    TwoStages,
    /// Not within the machine's limits: the search over all angles did not reach it either, nor two stages.
    BeyondLimits,
    /// Likewise, and opposite to a support the odd waves of the start profile alone are larger, whatever the feed.
    OddLobes,
}

/// A setting of the search.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = RingSearchSetting)]
pub struct SearchSetting {
    /// Tip at the start.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub tool_x_mm: f64,
    /// Tip at the start.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub tool_y_mm: f64,
    /// Direction of the feed, counter-clockwise from the x axis.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub feed_direction_deg: f64,
    /// Distance between the supports; of rollers between their centres.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub support_distance_mm: f64,
    /// How far they lie below the origin of the machine.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub support_depth_mm: f64,
    /// Support half angle at the end of the feed.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub support_half_angle_deg: f64,
    /// Tool angle at the end of the feed.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub tool_angle_deg: f64,
    /// Compliance ratio in all: what effects, stiffness and modes give is in it.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub compliance_ratio: f64,
    /// Share of simulated trials in which the target is met with the angles off by up to `angle_error_deg`, rollers running
    /// out by `roller_runout_um`, the blank's waves larger or smaller by up to `blank_waves_error_percent` and the blank put
    /// in turned.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub robust_share: f64,
    /// Feed.
    #[schema(extensions(("x-unit" = json!("mm/rev"))))]
    pub feed_mm_per_rev: f64,
    /// Revolutions with feed.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub revolutions: f64,
    /// Revolutions without.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub spark_out_revolutions: f64,
    /// Roundness deviation that the simulation gives.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub roundness_um: f64,
    /// Its error by the number of nodes.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub roundness_error_um: f64,
    /// Target less roundness, less its error.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub margin_um: f64,
    /// Radius of the least-squares circle at the end.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub mean_radius_mm: f64,
}

/// Settings tried.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = RingTriedColumns)]
pub struct TriedColumns {
    /// Revolutions with feed.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub revolutions: Vec<f64>,
    /// Feed.
    #[schema(extensions(("x-unit" = json!("mm/rev"))))]
    pub feed_mm_per_rev: Vec<f64>,
    /// Roundness deviation, with the nodes of the search.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub roundness_um: Vec<f64>,
}

/// Two stages one after the other, simulated so: the second begins with what the first leaves.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = RingSecondStage)]
pub struct SecondStage {
    /// The first stage; its roundness is what it leaves.
    pub first: SearchSetting,
    /// The second stage; its roundness is that after both, its robustness with the first as stated.
    pub second: SearchSetting,
}
