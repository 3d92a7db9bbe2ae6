//! Feed and speed of a cut, and when the tool passes a station.

use std::f64::consts::PI;

use crate::deflection_compensation::job::acting::Passage;
use crate::deflection_compensation::job::grid::Grid;
use crate::deflection_compensation::job::input::{Cut, FeedDirection, Job, Pass, Section, Segment, SpeedDiameter};
use crate::deflection_compensation::job::structure::pass_diameter_mm;
use crate::deflection_compensation::model::yielding::Radii;

/// Feed, speed and direction of one cut.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::deflection_compensation) struct Regime {
    pub feed_mm_per_rev: f64,
    pub speed: Speed,
    pub speed_diameter: SpeedDiameter,
    pub direction: FeedDirection,
}

/// What the control holds constant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::deflection_compensation) enum Speed {
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
    pub(in crate::deflection_compensation) fn of(cut: &Cut) -> Self {
        Self {
            feed_mm_per_rev: cut.feed_mm_per_rev,
            speed: Speed::of(cut.speed_m_per_min, cut.spindle_speed_rpm).unwrap_or(Speed::Surface(f64::NAN)),
            speed_diameter: cut.speed_diameter,
            direction: cut.feed_direction,
        }
    }

    /// The same with what the pass states of its own.
    pub(in crate::deflection_compensation) fn of_pass(self, pass: &Pass) -> Self {
        Self {
            feed_mm_per_rev: pass.feed_mm_per_rev.unwrap_or(self.feed_mm_per_rev),
            speed: Speed::of(pass.speed_m_per_min, pass.spindle_speed_rpm).unwrap_or(self.speed),
            ..self
        }
    }

    /// Cutting speed at a station, m/min: v = pi D n / 1000.
    pub(in crate::deflection_compensation) fn speed_m_per_min(
        &self,
        stock_radius_mm: f64,
        target_radius_mm: f64,
    ) -> f64 {
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

/// Spindle speed that gives a cutting speed on a diameter, rev/min.
pub(in crate::deflection_compensation) fn spindle_speed_rpm(speed_m_per_min: f64, diameter_mm: f64) -> f64 {
    1000.0 * speed_m_per_min / (PI * diameter_mm)
}

/// A cut as a step of a job: what it turns to and what came before. The default is a job of one cut.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(in crate::deflection_compensation) struct Step {
    /// Diameter that the pass aims at, where it is one of several.
    pub pass_mm: Option<f64>,
    /// That of the pass before, where there is one.
    pub before_mm: Option<f64>,
    /// Path that the edge has cut in the passes before, m.
    pub path_before_m: f64,
    /// Time in the cut of the passes before, min.
    pub time_before_min: f64,
}

impl Step {
    /// The pass that follows this cut, with the same edge on the same blank and without a pause.
    pub(in crate::deflection_compensation) fn next(&self, job: &Job, regime: &Regime, pass_mm: f64) -> Self {
        let (time_min, path_m) = whole(job, &paces(job, regime, self));
        Self {
            pass_mm: Some(pass_mm),
            before_mm: self.pass_mm,
            path_before_m: self.path_before_m + path_m,
            time_before_min: self.time_before_min + time_min,
        }
    }

    /// The first of several passes.
    pub(in crate::deflection_compensation) fn first(pass_mm: f64) -> Self {
        Self { pass_mm: Some(pass_mm), ..Self::default() }
    }

    /// Whether the cut takes anything off a segment: what the pass before left, or else the blank, is thicker than
    /// what this one turns to. A measured blank may be thicker anywhere.
    fn turns(&self, job: &Job, segment: &Segment) -> bool {
        let target = pass_diameter_mm(segment, self.pass_mm);
        let blank = if job.stock_profile.is_some() { f64::INFINITY } else { segment.stock_mm() };
        let before = self.before_mm.map_or(blank, |before| pass_diameter_mm(segment, Some(before)).min(blank));
        before > target
    }
}

/// Time and path per length in every segment, (min/mm, m/mm); 0 where nothing is cut.
fn paces(job: &Job, regime: &Regime, step: &Step) -> Vec<(f64, f64)> {
    let pace = |segment: &Segment| {
        let target = pass_diameter_mm(segment, step.pass_mm);
        if step.turns(job, segment) { regime.pace(target) } else { (0.0, 0.0) }
    };
    job.shaft.segments.iter().map(pace).collect()
}

/// Time and path of a whole cut.
fn whole(job: &Job, paces: &[(f64, f64)]) -> (f64, f64) {
    along(&job.shaft.segments, paces, 0..paces.len())
}

/// Time and path over whole segments.
fn along(segments: &[Segment], paces: &[(f64, f64)], range: std::ops::Range<usize>) -> (f64, f64) {
    range.fold((0.0, 0.0), |(time, path), i| {
        (time + paces[i].0 * segments[i].length_mm, path + paces[i].1 * segments[i].length_mm)
    })
}

/// When and where the tool passes every station of a cut, and what it is to cut there (`diagnosis/4`: p and tau).
pub(in crate::deflection_compensation) fn passages(
    job: &Job,
    grid: &Grid,
    regime: &Regime,
    step: &Step,
    radii: &Radii,
) -> Vec<Passage> {
    let segments = &job.shaft.segments;
    let pace = paces(job, regime, step);
    // Time and path of whole segments before the tool reaches segment i's near end.
    let before: Vec<(f64, f64)> = (0..segments.len())
        .map(|i| match regime.direction {
            FeedDirection::ToHeadstock => along(segments, &pace, i + 1..segments.len()),
            FeedDirection::ToTailstock => along(segments, &pace, 0..i),
        })
        .collect();
    let planned = radii.planned().iter().zip(&radii.target);
    grid.z_mm
        .iter()
        .zip(&grid.segment)
        .zip(planned)
        .map(|((&z, &i), (planned_mm, target_mm))| {
            let into = match regime.direction {
                FeedDirection::ToHeadstock => grid.steps_mm[i + 1] - z,
                FeedDirection::ToTailstock => z - grid.steps_mm[i],
            };
            Passage {
                z_mm: z,
                u: z / grid.length_mm,
                diameter_mm: pass_diameter_mm(&segments[i], step.pass_mm),
                time_min: step.time_before_min + before[i].0 + pace[i].0 * into,
                path_m: step.path_before_m + before[i].1 + pace[i].1 * into,
                depth_mm: planned_mm - target_mm,
                feed_mm_per_rev: regime.feed_mm_per_rev,
                speed_m_per_min: regime.speed_m_per_min(*planned_mm, *target_mm),
            }
        })
        .collect()
}

/// Time in the cut over all turned zones, of this cut and of the passes before it, min.
pub(in crate::deflection_compensation) fn cutting_time_min(job: &Job, regime: &Regime, step: &Step) -> f64 {
    step.time_before_min + whole(job, &paces(job, regime, step)).0
}

/// Path that the edge cuts over all turned zones in a job of one cut, m.
pub(in crate::deflection_compensation) fn cut_path_m(job: &Job, regime: &Regime) -> f64 {
    whole(job, &paces(job, regime, &Step::default())).1
}

/// Section that bends in a pass: passes are computed with the finished section of the pass.
pub(in crate::deflection_compensation) fn section_of_pass(job: &Job, uncut_side: bool) -> Section {
    if uncut_side {
        Section::Mixed
    } else if job.passes.is_empty() {
        job.shaft.section()
    } else {
        Section::Finished
    }
}
