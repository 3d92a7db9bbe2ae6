//! The answer: what comes out, why, and how sure it is.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::ring_roundness::answer::conformance::RingConformance;
use crate::ring_roundness::answer::output_settings::{LinearOutcome, MapOutcome, SearchOutcome, SpeedMapOutcome};
use crate::ring_roundness::job::cut_force::CutForce;

/// How round the ring will be, and what decides it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(title = "RingRoundnessResult")]
pub struct Outcome {
    /// Roundness deviation at the end, about the least-squares circle, filtered; null without simulation.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub roundness_um: Option<f64>,
    /// Error of it by the number of nodes.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub roundness_error_um: Option<f64>,
    /// The same without filter.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub roundness_unfiltered_um: Option<f64>,
    /// Error of it by the number of nodes.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub roundness_unfiltered_error_um: Option<f64>,
    /// Radius of the least-squares circle at the end.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub mean_radius_mm: Option<f64>,
    /// Error of it by the number of nodes.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub mean_radius_error_um: Option<f64>,
    /// What the angles of tool and supports make of errors, at the end of the feed.
    pub setting: SettingOutcome,
    /// The cut, step by step.
    pub simulation: Option<SimulationOutcome>,
    /// Which waves grow, stay or decay.
    pub linear_theory: Option<LinearOutcome>,
    /// Which waves grow over the work speed.
    pub speed_map: Option<SpeedMapOutcome>,
    /// The same over tool angle and support angle.
    pub setup_map: Option<MapOutcome>,
    /// Fewest revolutions to the target.
    pub settings_search: Option<SearchOutcome>,
    /// How probably the ring comes out within its tolerance; only with the analysis `certainty`.
    pub conformance: Option<RingConformance>,
}

/// What the angles of tool and supports make of errors, at the end of the feed; exact but for rounding.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = RingSettingOutcome)]
pub struct SettingOutcome {
    /// Radius of the circle through the tip that touches both supports: the size that a rigid machine gives.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub circumradius_mm: f64,
    /// Support half angle from the downward vertical.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub support_half_angle_deg: f64,
    /// Tool angle seen from the ring's centre.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub tool_angle_deg: f64,
    /// Copying coefficient of the left support.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub coefficient_a: f64,
    /// Copying coefficient of the right support.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub coefficient_b: f64,
    /// Sum of their sizes: 1 where the tool stands opposite to a support; above, some lobes grow.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub coefficient_sum: f64,
    /// Rotation from the tool to the left support.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub delay_a_deg: f64,
    /// Rotation from the tool to the right support.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub delay_b_deg: f64,
    /// Compliance ratio that acted, effects included.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub compliance_ratio: f64,
    /// Radius lost per mm of feed.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub radius_per_feed: f64,
    /// What the tool takes off the diameter in half a revolution: the bound of the roundness deviation after spark-out
    /// where the tool stands opposite to a support and starts clear.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub half_turn_reduction_um: f64,
    /// Distance of the tip from the surface before the ring turns, negative inside.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub gap_at_start_um: f64,
    /// What the force law comes to; null where none is given.
    pub cut_force: Option<CutForce>,
    /// What the supports bear; null where no forces are given.
    pub reactions: Option<ReactionsOutcome>,
}

/// What the supports bear.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = RingReactionsOutcome)]
pub struct ReactionsOutcome {
    /// Left support, with a pure driving torque; negative: the ring lifts off.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub support_a_n: f64,
    /// Right support.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub support_b_n: f64,
    /// Left support, with friction drive by both rollers in equal parts; null where a torque drives.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub driven_support_a_n: Option<f64>,
    /// Right support, likewise.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub driven_support_b_n: Option<f64>,
    /// Coefficient of friction that driving rollers need; null where a torque drives or the ring lifts off.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub friction_needed: Option<f64>,
    /// Torque that turns the ring.
    #[schema(extensions(("x-unit" = json!("N m"))))]
    pub drive_torque_n_m: f64,
    /// Whether both supports stay loaded.
    pub seated: bool,
}

/// The cut, step by step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = RingSimulationOutcome)]
pub struct SimulationOutcome {
    /// Nodes on the circumference.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub samples: u32,
    /// Nodes of the run beside it that the errors come from; with `nearest_samples` those of the exact one.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub samples_beside: u32,
    /// Nodes that the teeth of the surface need for unfiltered values.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub samples_for_teeth: u32,
    /// Before the cut.
    pub start: Evaluated,
    /// After the cut; null where the points of `nearest_samples` flew apart.
    pub end: Option<Evaluated>,
    /// Error of every value of `end` by the number of nodes; with `nearest_samples` the difference from exact contact.
    pub end_error: Option<Evaluated>,
    /// Radius at the end less the circumradius of the setting.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub size_error_um: Option<f64>,
    /// Largest depth that the tip met.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub largest_bite_um: Option<f64>,
    /// Revolution of the first contact.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub first_contact_rev: Option<f64>,
    /// Last revolution of the feed at which the tip was in the air; null where it never was.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub last_air_cut_rev: Option<f64>,
    /// Share of the surface that was never cut.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub uncut_share: f64,
    /// Most by which a contact of the ring with a support was off, where both supports stood on steps steeper than the
    /// nodes resolve; 0 where every step was located to a nanometre.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub location_error_um: f64,
    /// Where the error at the end comes from.
    pub causes: CausesOutcome,
    /// Waves before and after.
    pub spectrum: SpectrumColumns,
    /// Revolution by revolution; empty with `nearest_samples`.
    pub history: HistoryColumns,
    /// Profiles by body angle.
    pub profile: ProfileColumns,
    /// The surface on the way; null unless `replay_frames` asks for it, and with `nearest_samples`.
    pub replay: Option<ReplayOutcome>,
    /// Where the ring's origin went in the last revolution: what an indicator at the tool shows.
    pub centre_path: PathColumns,
    /// What exact contact gives with the same job, beside `nearest_samples`.
    pub exact_contact: Option<Evaluated>,
}

/// Values of the four reference circles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = RingEvaluated)]
pub struct Evaluated {
    /// Radius of the least-squares circle, unfiltered.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub mean_radius_mm: f64,
    /// Without filter.
    pub unfiltered: CircleValues,
    /// After the filter.
    pub filtered: CircleValues,
}

/// Roundness deviations about the four reference circles.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = RingCircleValues)]
pub struct CircleValues {
    /// Peak to valley, least-squares circle (LSCI).
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub least_squares_um: f64,
    /// Peak to valley, minimum zone (MZCI).
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub minimum_zone_um: f64,
    /// Peak to valley, maximum inscribed circle (MICI).
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub inscribed_um: f64,
    /// Peak to valley, minimum circumscribed circle (MCCI).
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub circumscribed_um: f64,
    /// Highest peak above the least-squares circle (RONp).
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub peak_um: f64,
    /// Deepest valley below it (RONv).
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub valley_um: f64,
    /// Root mean square about it (RONq).
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub rms_um: f64,
}

/// Where the error at the end comes from: first order, and by simulation with one term of the job off after another.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = RingCausesOutcome)]
pub struct CausesOutcome {
    /// Step of the spiral that the stop of the feed leaves; 0 after half a revolution of spark-out in a rigid machine.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub feed_step_um: f64,
    /// Bound of the teeth that the feed leaves.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub teeth_um: f64,
    /// What of the largest bite above that stays as odd lobes: half of it over 1 + 2 K; 0 where the tool starts clear,
    /// null where it does not stand opposite to a support.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub first_bite_um: Option<f64>,
    /// Peak to valley of the odd waves (3, 5, ...) of the start profile, which a tool opposite to a support cannot see;
    /// null where it does not stand so.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub odd_lobes_um: Option<f64>,
    /// Largest peak to valley at the end of a single wave that the linear theory says grows.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub growing_lobes_um: f64,
    /// Nodes of the runs with a term off, and of the one with all terms that they are compared with.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub samples: u32,
    /// The roundness without each term that makes waves, the one that matters most first. Shares need not add up to 1:
    /// terms act on each other. The first bite is left out where a start clear of the blank takes more than four times the
    /// job's revolutions.
    pub switched_off: Vec<CauseOutcome>,
}

/// What comes out with one term of the job off.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = RingCauseOutcome)]
pub struct CauseOutcome {
    /// What was switched off.
    pub cause: CauseKind,
    /// Which of the job's effects, from 0; null where it is none.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub effect: Option<usize>,
    /// Roundness deviation without it, filtered, least-squares circle.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub roundness_without_um: f64,
    /// Share of the roundness that goes away with it; negative where it comes out worse without.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub share: f64,
}

/// A term of the job that makes waves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = RingCauseKind)]
pub enum CauseKind {
    /// Waves of odd order of the blank: taken off it.
    BlankOddWaves,
    /// Waves of even order of the blank: taken off it.
    BlankEvenWaves,
    /// A start inside the largest diameter: moved back until clear.
    FirstBite,
    /// The feed per revolution: halved, with twice the revolutions.
    Feed,
    /// Too little spark-out: three revolutions more.
    SparkOutMissing,
    /// The give of machine and tool: made rigid.
    Compliance,
    /// A tool not opposite to a support: put opposite to the nearest.
    ToolOffLine,
    /// An effect of the job: left out.
    Effect,
}

impl CauseKind {
    /// Its name, as in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::BlankOddWaves => "blank_odd_waves",
            Self::BlankEvenWaves => "blank_even_waves",
            Self::FirstBite => "first_bite",
            Self::Feed => "feed",
            Self::SparkOutMissing => "spark_out_missing",
            Self::Compliance => "compliance",
            Self::ToolOffLine => "tool_off_line",
            Self::Effect => "effect",
        }
    }
}

/// One entry per order from 2.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = RingSpectrumColumns)]
pub struct SpectrumColumns {
    /// Waves per revolution.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub order: Vec<u32>,
    /// Amplitude before the cut.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub start_um: Vec<f64>,
    /// Amplitude after the cut.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub end_um: Vec<f64>,
    /// Its error by the number of nodes.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub end_error_um: Vec<f64>,
    /// Body angle of the first maximum after the cut.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub end_angle_of_max_deg: Vec<f64>,
    /// After over before; null where nothing was there before.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub ratio: Vec<Option<f64>>,
}

/// One entry per revolution, or per several of long runs.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = RingHistoryColumns)]
pub struct HistoryColumns {
    /// Revolutions turned.
    #[schema(extensions(
        ("x-unit" = json!("1")),
        ("x-replay" = json!({
            "figure": "polar",
            "curve": "ring_after",
            "at": "revolution",
            "value": "roundness_um",
            "beside": "mean_radius_mm",
            "from": {
                "value": "/simulation/start/unfiltered/least_squares_um",
                "beside": "/simulation/start/mean_radius_mm",
            },
            "asks": { "/analyses": ["simulation"], "/profile_points": 36, "/replay_frames": 120 },
            "keeps": { "/samples": "/simulation/samples" },
            "drops": ["/settings_search", "/setup_map", "/speed_map"],
            "frames": "/simulation/replay",
            "most": 120,
            "angles": "angle_deg",
            "values": "deviation_um",
            "turned": "tool_angle_deg",
            "blank": "profile",
        }))
    ))]
    pub revolution: Vec<f64>,
    /// Roundness deviation, least-squares circle, unfiltered.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub roundness_um: Vec<f64>,
    /// Radius of the least-squares circle.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub mean_radius_mm: Vec<f64>,
    /// Deepest cut since the entry before.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub deepest_cut_um: Vec<f64>,
    /// Share of the time in cut since the entry before.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub cutting_share: Vec<f64>,
    /// Amplitudes of the waves of orders 2 to 7: one list per order.
    pub waves: Vec<WaveColumn>,
}

/// How one wave developed.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = RingWaveColumn)]
pub struct WaveColumn {
    /// Waves per revolution.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub order: u32,
    /// Amplitude.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub amplitude_um: Vec<f64>,
}

/// Profiles by body angle, thinned out evenly; values of the circles come from all nodes.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = RingProfileColumns)]
pub struct ProfileColumns {
    /// Body angle.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub angle_deg: Vec<f64>,
    /// Radius from the body's origin before the cut.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub start_radius_mm: Vec<f64>,
    /// Radius from the body's origin after the cut.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub end_radius_mm: Vec<f64>,
    /// Deviation from the least-squares circle before the cut.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub start_deviation_um: Vec<f64>,
    /// Deviation from the least-squares circle after the cut.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub end_deviation_um: Vec<f64>,
    /// The same after the filter.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub end_filtered_um: Vec<f64>,
}

/// The surface on the way, to be looked at: thinned out to at most 360 angles and rounded to a two-thousandth of its
/// deviation or finer. What is to be measured stands in `history`, from all nodes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = RingReplayOutcome)]
pub struct ReplayOutcome {
    /// Body angles of every frame.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub angle_deg: Vec<f64>,
    /// In the order of the revolutions, the last one among them.
    pub frames: Vec<ReplayFrame>,
}

/// The surface after so many revolutions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = RingReplayFrame)]
pub struct ReplayFrame {
    /// Revolutions turned.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub revolution: f64,
    /// Body angle at which the tool stands then.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub tool_angle_deg: f64,
    /// Deviation from the least-squares circle at each of the angles, unfiltered.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub deviation_um: Vec<f64>,
}

/// The path of the ring's origin in the last revolution, about its mean.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = RingPathColumns)]
pub struct PathColumns {
    /// Revolutions turned.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub revolution: Vec<f64>,
    /// To the right.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub x_um: Vec<f64>,
    /// Up.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub y_um: Vec<f64>,
}
