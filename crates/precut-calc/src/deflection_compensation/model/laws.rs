//! Force laws along the shaft, effects in them.

use crate::force::{DepthLaw, ForceModel, Forces};

use crate::deflection_compensation::job::acting::ForceChange;
use crate::deflection_compensation::model::power_cut::MAX_EXPONENT;
use crate::deflection_compensation::model::regime::Speed;
use crate::deflection_compensation::model::yielding::Ingredients;

/// Forces at a depth and their slopes dP/dt.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(in crate::deflection_compensation) struct Loads {
    pub passive_n: f64,
    pub passive_slope: f64,
    pub main_n: f64,
    pub main_slope: f64,
    pub feed_n: f64,
    pub feed_slope: f64,
}

/// Force laws at the stations, effects in them: one for every speed and hardness that differ.
#[derive(Clone)]
pub(in crate::deflection_compensation) struct StationLaws {
    laws: Vec<DepthLaw>,
    /// Empty where there is one law for all.
    of_station: Vec<u32>,
}

/// Laws that are powers of the depth, all of one exponent.
#[derive(Clone)]
pub(in crate::deflection_compensation) struct PowerLine {
    /// Passive force at 1 mm of every law, N.
    pub factors_n: Vec<f64>,
    pub exponent: f64,
}

impl StationLaws {
    pub(in crate::deflection_compensation) fn of(from: &Ingredients<'_>) -> Self {
        let Ingredients { job, grid, acting, regime, radii, .. } = *from;
        let feed = regime.feed_mm_per_rev;
        if let Speed::Surface(speed) = regime.speed
            && acting.force.same_everywhere()
        {
            let factor = acting.force.factor(0.0, feed, speed);
            let law = law_at(&job.force, feed, speed, factor, &acting.force);
            return Self { laws: vec![law], of_station: Vec::new() };
        }
        let mut laws = Self { laws: Vec::new(), of_station: Vec::with_capacity(grid.len()) };
        let mut last = (f64::NAN, f64::NAN);
        let radii = radii.planned().iter().zip(&radii.target);
        for (z_mm, (planned, target)) in grid.z_mm.iter().zip(radii) {
            let speed = regime.speed_m_per_min(*planned, *target);
            let factor = acting.force.factor(z_mm / grid.length_mm, feed, speed);
            if speed.to_bits() != last.0.to_bits() || factor.to_bits() != last.1.to_bits() {
                laws.laws.push(law_at(&job.force, feed, speed, factor, &acting.force));
                last = (speed, factor);
            }
            // At most one law per station, and stations are limited to 200 000.
            laws.of_station.push(u32::try_from(laws.laws.len() - 1).unwrap_or(u32::MAX));
        }
        laws
    }

    /// Multiplies all forces.
    pub(in crate::deflection_compensation) fn scale(&mut self, factor: f64) {
        for law in &mut self.laws {
            *law = law.clone().scaled(factor);
        }
    }

    /// Whether no law has a constant part: every force vanishes with the depth.
    pub(in crate::deflection_compensation) fn vanish_with_depth(&self) -> bool {
        self.laws.iter().all(|law| law.limit() == Forces::default())
    }

    /// The laws where the passive force of all is a rising power of the depth, with one exponent.
    pub(in crate::deflection_compensation) fn power(&self) -> Option<PowerLine> {
        let (_, exponent) = self.laws.first()?.passive_power()?;
        let same = |other: f64| other.to_bits() == exponent.to_bits();
        let factors_n: Option<Vec<f64>> = self
            .laws
            .iter()
            .map(|law| law.passive_power().filter(|(_, z)| same(*z)).map(|(factor, _)| factor))
            .collect();
        // Beyond an edge angle of 90 degrees a sharp corner is pulled in: that force falls.
        let rises = self.laws.iter().all(|law| law.passive_power().is_some_and(|(factor, _)| factor >= 0.0));
        (rises && exponent > 0.0 && exponent <= MAX_EXPONENT).then_some(PowerLine { factors_n: factors_n?, exponent })
    }

    #[inline]
    pub(in crate::deflection_compensation) fn index(&self, i: usize) -> u32 {
        self.of_station.get(i).copied().unwrap_or(0)
    }

    pub(in crate::deflection_compensation) fn law(&self, i: usize) -> &DepthLaw {
        &self.laws[self.index(i) as usize]
    }

    pub(in crate::deflection_compensation) fn loads(&self, i: usize, depth_mm: f64, main: bool, feed: bool) -> Loads {
        let law = self.law(i);
        let (passive_n, passive_slope) = law.passive_and_slope(depth_mm);
        let (main_n, main_slope) = if main { law.main_and_slope(depth_mm) } else { (0.0, 0.0) };
        let (feed_n, feed_slope) = if feed { law.feed_and_slope(depth_mm) } else { (0.0, 0.0) };
        Loads { passive_n, passive_slope, main_n, main_slope, feed_n, feed_slope }
    }

    pub(in crate::deflection_compensation) fn loads_at_zero(&self, i: usize, main: bool, feed: bool) -> Loads {
        let limit = self.law(i).limit();
        Loads {
            passive_n: limit.passive_n,
            main_n: if main { limit.main_n } else { 0.0 },
            feed_n: if feed { limit.feed_n } else { 0.0 },
            ..Loads::default()
        }
    }
}

/// The law at one feed and speed with the effects in it: factors on all components, then the turned
/// depth exponent, then what is added to the passive force.
pub(in crate::deflection_compensation) fn law_at(
    force: &ForceModel,
    feed_mm_per_rev: f64,
    speed_m_per_min: f64,
    factor: f64,
    change: &ForceChange,
) -> DepthLaw {
    let mut law = force.at(feed_mm_per_rev, speed_m_per_min).scaled(factor);
    if let Some((delta, reference_mm)) = change.depth {
        law = law.with_depth_exponent(delta, reference_mm);
    }
    law.with_added(Forces { passive_n: change.added_passive_n, main_n: 0.0, feed_n: 0.0 })
}
