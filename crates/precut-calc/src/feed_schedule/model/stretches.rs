//! Stretches of a path whose limits are known as they come out at one feed: the schedule of programs that are there.
//!
//! A stretch is a zone of unit speed and of unit work per length, so that its time is that of the stretch; what comes out of it
//! is a power of the feed (or rises with its logarithm) through what came out at the feed that it was tried at. All the rest is
//! the schedule's: program, solver, prices, conflict.

use std::f64::consts::PI;

use crate::calculator::{Failure, Monitor};
use crate::effects::MachinabilityConditions;
use crate::machinability::{MachinabilityModel, ModelForm};
use crate::shaft::{Carriage, FeedDirection};

use crate::feed_schedule::answer::output::Looser;
use crate::feed_schedule::job::acting::{ActingModel, Form};
use crate::feed_schedule::job::case::{Case, CustomCase};
use crate::feed_schedule::job::input::{
    CustomLimit, FeedMode, Goal, Job, Limits, Machine, Reference, SpeedMode, UsageScope, Variables, Zone,
};
use crate::feed_schedule::job::models::{Models, Output};
use crate::feed_schedule::job::open::ScheduleUncertainty;
use crate::feed_schedule::job::plan::Method;
use crate::feed_schedule::model::prices::{self, Again};
use crate::feed_schedule::model::refusal::worded;
use crate::feed_schedule::model::risk::Risk;
use crate::feed_schedule::model::solve::solve;

/// Step of the feed, mm/rev, and of feeds below twenty such steps.
const FEED_STEP: f64 = 0.001;
const FINE_FEED_STEP: f64 = 0.0001;

/// Step of a feed as it is written, mm per revolution.
pub(crate) fn step_of(feed: f64) -> f64 {
    if feed < 20.0 * FEED_STEP { FINE_FEED_STEP } else { FEED_STEP }
}

/// An output at the feed that was tried, and its law of the feed through that.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Through {
    /// The output at that feed.
    pub(crate) value: f64,
    /// Its exponent of the feed; of an output that rises with the logarithm of the feed, by how much.
    pub(crate) feed_exponent: f64,
    /// Whether it is a power of the feed.
    pub(crate) is_power: bool,
}

impl Through {
    /// A power of the feed.
    pub(crate) fn power(value: f64, feed_exponent: f64) -> Self {
        Self { value, feed_exponent, is_power: true }
    }

    /// The model that goes through it.
    fn model(self, feed_mm_per_rev: f64) -> MachinabilityModel {
        let (form, at) =
            if self.is_power { (ModelForm::LogLog, self.value.ln()) } else { (ModelForm::SemiLog, self.value) };
        let constant = at - self.feed_exponent * feed_mm_per_rev.ln();
        MachinabilityModel { form, ..MachinabilityModel::power_law(constant, 0.0, self.feed_exponent, 0.0) }
    }
}

/// A stretch that has one feed.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Stretch {
    /// Its name in conflicts.
    pub(crate) id: String,
    /// Whose edge it wears.
    pub(crate) tool: String,
    /// The feed that it was tried at, and its time there.
    pub(crate) feed_mm_per_rev: f64,
    pub(crate) time_min: f64,
    /// Whether the next one goes on where it ends.
    pub(crate) touches_next: bool,
    pub(crate) deflection_um: Option<Through>,
    pub(crate) roughness_um: Option<Through>,
    pub(crate) tool_life_min: Option<Through>,
    /// By the places of `Bounds::largest`.
    pub(crate) outputs: Vec<Option<Through>>,
}

/// The limits.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Bounds {
    pub(crate) feed_mm_per_rev: [f64; 2],
    pub(crate) feed_step_ratio_max: Option<f64>,
    pub(crate) deflection_max_um: Option<f64>,
    pub(crate) roughness_max_um: Option<f64>,
    /// Per edge and part.
    pub(crate) tool_usage_max: Option<f64>,
    /// Further limits by their names.
    pub(crate) largest: Vec<(&'static str, f64)>,
}

/// A limit that binds somewhere: what one percent more of it takes off the time, percent.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PriceOfLimit {
    pub(crate) constraint: String,
    pub(crate) limit: f64,
    pub(crate) looser: Looser,
    pub(crate) gain_percent: f64,
}

/// The fastest feeds.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Scheduled {
    pub(crate) feeds_mm_per_rev: Vec<f64>,
    /// The most costly first.
    pub(crate) prices: Vec<PriceOfLimit>,
}

/// The fastest feeds within all limits.
pub(crate) fn fastest(stretches: &[Stretch], bounds: &Bounds, monitor: &dyn Monitor) -> Result<Scheduled, Failure> {
    let job = job(stretches, bounds);
    let case = case(&job, stretches, bounds)?;
    let solved = solve(&case, true, monitor).map_err(|unsolved| worded(unsolved, &job))?;
    let again = Again { job: &job, held: None, split: None, is_possible: false };
    let mut prices: Vec<PriceOfLimit> = Vec::new();
    for price in prices::prices(&case, &solved, &again, monitor)? {
        let gain = price.gain_percent.unwrap_or(0.0);
        // A number of the job is one knob, however many stretches it binds.
        match prices.iter_mut().find(|known| known.constraint == price.constraint) {
            Some(known) => known.gain_percent += gain,
            None => prices.push(PriceOfLimit {
                constraint: price.constraint,
                limit: price.limit,
                looser: price.looser,
                gain_percent: gain,
            }),
        }
    }
    prices.sort_by(|a, b| b.gain_percent.total_cmp(&a.gain_percent));
    let feeds_mm_per_rev = solved.at.iter().map(|(_, x)| x.exp()).collect();
    Ok(Scheduled { feeds_mm_per_rev, prices })
}

/// The stretches as zones one behind the other.
fn job(stretches: &[Stretch], bounds: &Bounds) -> Job {
    let mut z_mm = 0.0;
    let zones = stretches.iter().map(|stretch| {
        // At unit speed and unit work per length that is its time.
        let z_start_mm = z_mm;
        z_mm += stretch.time_min * stretch.feed_mm_per_rev;
        Zone {
            id: stretch.id.clone(),
            z_start_mm,
            z_end_mm: z_mm,
            diameter_mm: 1000.0 / PI,
            depth_mm: 1.0,
            repeat: 1,
            surface: Some(stretch.tool.clone()),
            compliance_um_per_n: Some(1.0),
            deflection_max_um: bounds.deflection_max_um.filter(|_| stretch.deflection_um.is_some()),
            roughness_max_um: bounds.roughness_max_um.filter(|_| stretch.roughness_um.is_some()),
            ..Zone::default()
        }
    });
    Job {
        shaft: None,
        supports: Vec::new(),
        carriage: Carriage::default(),
        zones: zones.collect(),
        models: Models::default(),
        force: None,
        cutting_edge_angle_deg: None,
        machine: Machine::default(),
        limits: Some(Limits {
            feed_min_mm_per_rev: bounds.feed_mm_per_rev[0],
            feed_max_mm_per_rev: bounds.feed_mm_per_rev[1],
            // The speed is no variable.
            speed_min_m_per_min: 0.5,
            speed_max_m_per_min: 2.0,
            tool_usage_max: bounds.tool_usage_max,
            tool_usage_scope: UsageScope::Surface,
            feed_step_ratio_max: bounds.feed_step_ratio_max,
            deflection_residual_fraction: 1.0,
            ..Limits::default()
        }),
        risk: Risk::None {},
        variables: Variables {
            feed: FeedMode::PerZone,
            speed: SpeedMode::Fixed,
            fixed_feed_mm_per_rev: None,
            fixed_speed_m_per_min: Some(1.0),
        },
        custom: bounds
            .largest
            .iter()
            .map(|&(name, max)| CustomLimit { name: name.to_owned(), max: Some(max), ..CustomLimit::default() })
            .collect(),
        couplings: Vec::new(),
        objective: Goal::default(),
        method: Method::Optimal,
        passes: None,
        trade_off: None,
        compensation: None,
        feed_direction: FeedDirection::default(),
        program: crate::deflection_compensation::ProgramSettings::default(),
        reference: None,
        effects: Vec::new(),
        uncertainty: ScheduleUncertainty::default(),
        conditions: MachinabilityConditions::default(),
    }
}

/// The zones with what came out of them.
fn case(job: &Job, stretches: &[Stretch], bounds: &Bounds) -> Result<Case, Failure> {
    let mut case = Case::of(job, None, None)?;
    case.custom.clear();
    for (i, stretch) in stretches.iter().enumerate() {
        let acting = |through: Through| {
            let model = through.model(stretch.feed_mm_per_rev);
            ActingModel::of(&model, std::iter::empty(), &job.conditions, &Reference::default(), 1.0, None)
        };
        let zone = &mut case.zones[i];
        zone.touches_next = stretch.touches_next;
        zone.models = [const { None }; 6];
        for (output, through) in [
            (Output::ForceY, stretch.deflection_um),
            (Output::Roughness, stretch.roughness_um),
            (Output::ToolLife, stretch.tool_life_min),
        ] {
            zone.models[output as usize] = through.map(acting);
        }
        for (&(name, max), through) in bounds.largest.iter().zip(&stretch.outputs) {
            if let Some(through) = through {
                let model = through.model(stretch.feed_mm_per_rev);
                let own =
                    Form { constant: model.constant, speed: 0.0, feed: model.feed_exponent, log_log: through.is_power };
                case.custom.push(CustomCase {
                    name: name.to_owned(),
                    zone: i,
                    own,
                    further: None,
                    max: Some(max),
                    min: None,
                });
            }
        }
    }
    Ok(case)
}
