//! Feed and speed of a cut, and when the tool passes a station.

use std::f64::consts::PI;

use super::acting::Passage;
use super::grid::Grid;
use super::input::{Cut, FeedDirection, Job, Pass, Section, SpeedDiameter};
use super::structure::pass_diameter_mm;
use crate::shaft::elastic::ends;

/// Feed, speed and direction of one cut.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Regime {
    pub feed_mm_per_rev: f64,
    pub speed: Speed,
    pub speed_diameter: SpeedDiameter,
    pub direction: FeedDirection,
}

/// What the control holds constant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Speed {
    /// Cutting speed, m/min (G96).
    Surface(f64),
    /// Spindle speed, rev/min (G97).
    Spindle(f64),
}

impl Speed {
    fn of(speed_m_per_min: Option<f64>, spindle_speed_rpm: Option<f64>) -> Option<Self> {
        speed_m_per_min.map(Self::Surface).or(spindle_speed_rpm.map(Self::Spindle))
    }
}

impl Regime {
    /// The regime of a checked cut; `check` has made sure that one of the speeds is given.
    pub(super) fn of(cut: &Cut) -> Self {
        Self {
            feed_mm_per_rev: cut.feed_mm_per_rev,
            speed: Speed::of(cut.speed_m_per_min, cut.spindle_speed_rpm).unwrap_or(Speed::Surface(f64::NAN)),
            speed_diameter: cut.speed_diameter,
            direction: cut.feed_direction,
        }
    }

    /// The same with what the pass states of its own.
    pub(super) fn of_pass(self, pass: &Pass) -> Self {
        Self {
            feed_mm_per_rev: pass.feed_mm_per_rev.unwrap_or(self.feed_mm_per_rev),
            speed: Speed::of(pass.speed_m_per_min, pass.spindle_speed_rpm).unwrap_or(self.speed),
            ..self
        }
    }

    /// Cutting speed at a station, m/min: v = pi D n / 1000.
    pub(super) fn speed_m_per_min(&self, stock_radius_mm: f64, target_radius_mm: f64) -> f64 {
        match self.speed {
            Speed::Surface(v) => v,
            Speed::Spindle(n) => {
                let radius = match self.speed_diameter {
                    SpeedDiameter::Stock => stock_radius_mm,
                    SpeedDiameter::Finish => target_radius_mm,
                };
                PI * 2.0 * radius * n / 1000.0
            }
        }
    }

    /// Time per length of a turned piece of diameter d and path per length: (min/mm, m/mm).
    ///
    /// Path pi d/(1000 s); time path/v, or 1/(s n) at constant spindle speed.
    fn pace(&self, diameter_mm: f64) -> (f64, f64) {
        let path = PI * diameter_mm / (1000.0 * self.feed_mm_per_rev);
        let time = match self.speed {
            Speed::Surface(v) => path / v,
            Speed::Spindle(n) => 1.0 / (self.feed_mm_per_rev * n),
        };
        (time, path)
    }
}

/// When and where the tool passes every station of a cut (`diagnosis/4`: s and tau).
pub(super) fn passages(job: &Job, grid: &Grid, regime: &Regime, pass_mm: Option<f64>) -> Vec<Passage> {
    let segments = &job.shaft.segments;
    let pace: Vec<(f64, f64)> = segments
        .iter()
        .map(|segment| {
            let target = pass_diameter_mm(segment, pass_mm);
            let turned = job.stock_profile.is_some() || segment.stock_mm() > target;
            if turned { regime.pace(target) } else { (0.0, 0.0) }
        })
        .collect();
    // Time and path of whole segments before the tool reaches segment i's near end.
    let whole = |range: std::ops::Range<usize>| {
        range.fold((0.0, 0.0), |sum: (f64, f64), i| {
            (sum.0 + pace[i].0 * segments[i].length_mm, sum.1 + pace[i].1 * segments[i].length_mm)
        })
    };
    let before: Vec<(f64, f64)> = (0..segments.len())
        .map(|i| match regime.direction {
            FeedDirection::ToHeadstock => whole(i + 1..segments.len()),
            FeedDirection::ToTailstock => whole(0..i),
        })
        .collect();
    let (head, tail) = ends(&job.supports);
    let station =
        |support: Option<usize>, other: f64| support.and_then(|i| job.supports[i].station_mm()).unwrap_or(other);
    let (z_head, z_tail) = (station(head, 0.0), station(tail, grid.length_mm));
    grid.z_mm
        .iter()
        .zip(&grid.segment)
        .map(|(&z, &i)| {
            let into = match regime.direction {
                FeedDirection::ToHeadstock => grid.steps_mm[i + 1] - z,
                FeedDirection::ToTailstock => z - grid.steps_mm[i],
            };
            Passage {
                u: z / grid.length_mm,
                between_centres: (z - z_head) / (z_tail - z_head),
                diameter_mm: pass_diameter_mm(&segments[i], pass_mm),
                time_min: before[i].0 + pace[i].0 * into,
                path_m: before[i].1 + pace[i].1 * into,
            }
        })
        .collect()
}

/// Time in the cut over all turned zones, min.
pub(super) fn cutting_time_min(job: &Job, regime: &Regime, pass_mm: Option<f64>) -> f64 {
    job.shaft
        .segments
        .iter()
        .map(|segment| (segment, pass_diameter_mm(segment, pass_mm)))
        .filter(|(segment, target)| job.stock_profile.is_some() || segment.stock_mm() > *target)
        .map(|(segment, target)| regime.pace(target).0 * segment.length_mm)
        .sum()
}

/// Section that bends in a pass: passes are computed with the finished section of the pass.
pub(super) fn section_of_pass(job: &Job, uncut_side: bool) -> Section {
    if uncut_side {
        Section::Mixed
    } else if job.passes.is_empty() {
        job.shaft.section
    } else {
        Section::Finished
    }
}
