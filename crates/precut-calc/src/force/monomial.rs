//! A force as one product of powers, where it is one: what a geometric program can hold.

use super::{Component, ForceModel, MeasuredRange, PowerLaw, PowerTerm};

/// A force K t^x s^y v^n, N, with t in mm, s in mm/rev, v in m/min.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Monomial {
    /// Force at 1 mm, 1 mm/rev, 1 m/min, N.
    pub coefficient: f64,
    /// Exponent of the depth.
    pub depth_exponent: f64,
    /// Exponent of the feed.
    pub feed_exponent: f64,
    /// Exponent of the speed.
    pub speed_exponent: f64,
}

impl ForceModel {
    /// The force component as a product of powers: of a power law, or a handbook choice, without a constant part.
    pub fn monomial(&self, component: Component) -> Option<Monomial> {
        match self {
            Self::PowerLaw(law) => of_law(law, component),
            Self::Handbook(handbook) => of_law(&handbook.resolve("").ok()?, component),
            Self::Kienzle(_) | Self::Constant(_) | Self::Table(_) => None,
        }
    }

    /// The force component at a depth as a product of powers of feed and speed: a power law without a constant part, and
    /// Kienzle's law without rubbing, whose nose arc does not depend on the feed (`library/2`). The depth is in the
    /// coefficient; the passive force counts by its size.
    pub fn monomial_at(&self, component: Component, depth_mm: f64) -> Option<Monomial> {
        let Self::Kienzle(law) = self else {
            let law = self.monomial(component)?;
            let coefficient = law.coefficient * depth_mm.powf(law.depth_exponent);
            return Some(Monomial { coefficient, depth_exponent: 0.0, ..law });
        };
        let mut filled = law.clone();
        filled.fill();
        let exponent = match component {
            Component::Main => filled.cutting_exponent?,
            Component::Passive | Component::Feed => filled.normal_exponent,
        };
        let (force_n, _) = filled.at(1.0).component_and_slope(component, depth_mm);
        filled.rubbing.is_none().then_some(Monomial {
            coefficient: force_n.abs(),
            depth_exponent: 0.0,
            feed_exponent: 1.0 - exponent,
            speed_exponent: 0.0,
        })
    }

    /// What the trials behind a power law covered, where it is stated.
    pub fn measured_range(&self) -> Option<MeasuredRange> {
        match self {
            Self::PowerLaw(law) => law.measured_range,
            Self::Handbook(handbook) => handbook.resolve("").ok()?.measured_range,
            Self::Kienzle(_) | Self::Constant(_) | Self::Table(_) => None,
        }
    }
}

fn of_law(law: &PowerLaw, component: Component) -> Option<Monomial> {
    let term: &PowerTerm = match component {
        Component::Passive => &law.passive,
        Component::Main => law.main.as_ref()?,
        Component::Feed => law.feed.as_ref()?,
    };
    (term.constant_n <= 0.0).then_some(Monomial {
        coefficient: term.coefficient * term.correction_factor * law.wear_factor,
        depth_exponent: term.depth_exponent,
        feed_exponent: term.feed_exponent,
        speed_exponent: term.speed_exponent,
    })
}
