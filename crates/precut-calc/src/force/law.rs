//! Forces over the engaged depth at one feed and one speed.

use super::Forces;
use super::kienzle::KienzleLaw;
use super::table::TableLaw;

/// A component of the cutting force.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Component {
    /// Radial, away from the tool.
    Passive,
    /// Tangential, along the cutting speed.
    Main,
    /// Axial, against the feed.
    Feed,
}

impl Forces {
    /// The value of one component, N.
    pub fn get(&self, component: Component) -> f64 {
        match component {
            Component::Passive => self.passive_n,
            Component::Main => self.main_n,
            Component::Feed => self.feed_n,
        }
    }
}

/// A multiple of a power of the depth, N. Whole exponents need no logarithm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Power {
    Constant(f64),
    Linear(f64),
    General { factor: f64, exponent: f64 },
}

impl Power {
    pub(super) const ZERO: Self = Self::Constant(0.0);

    pub(super) fn new(factor: f64, exponent: f64) -> Self {
        if exponent.abs() < f64::EPSILON {
            Self::Constant(factor)
        } else if (exponent - 1.0).abs() < f64::EPSILON {
            Self::Linear(factor)
        } else {
            Self::General { factor, exponent }
        }
    }

    fn parts(self) -> (f64, f64) {
        match self {
            Self::Constant(factor) => (factor, 0.0),
            Self::Linear(factor) => (factor, 1.0),
            Self::General { factor, exponent } => (factor, exponent),
        }
    }

    fn value_and_slope(self, depth_mm: f64) -> (f64, f64) {
        match self {
            Self::Constant(factor) => (factor, 0.0),
            Self::Linear(factor) => (factor * depth_mm, factor),
            Self::General { factor, exponent } => {
                let value = factor * (exponent * depth_mm.ln()).exp();
                (value, exponent * value / depth_mm)
            }
        }
    }
}

/// The shape of a law, before wear, rubbing and effects.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Law {
    Power { passive: Power, main: Power, feed: Power },
    Kienzle(Box<KienzleLaw>),
    Table(Box<TableLaw>),
}

impl Law {
    pub(super) fn constant(forces: Forces) -> Self {
        Self::Power {
            passive: Power::Constant(forces.passive_n),
            main: Power::Constant(forces.main_n),
            feed: Power::Constant(forces.feed_n),
        }
    }

    fn power(&self, component: Component) -> Option<Power> {
        match (self, component) {
            (Self::Power { passive, .. }, Component::Passive) => Some(*passive),
            (Self::Power { main, .. }, Component::Main) => Some(*main),
            (Self::Power { feed, .. }, Component::Feed) => Some(*feed),
            (Self::Kienzle(_) | Self::Table(_), _) => None,
        }
    }

    fn value_and_slope(&self, component: Component, depth_mm: f64) -> (f64, f64) {
        match self {
            Self::Power { passive, main, feed } => match component {
                Component::Passive => passive.value_and_slope(depth_mm),
                Component::Main => main.value_and_slope(depth_mm),
                Component::Feed => feed.value_and_slope(depth_mm),
            },
            Self::Kienzle(law) => law.value_and_slope(component, depth_mm),
            Self::Table(law) => law.value_and_slope(component, depth_mm),
        }
    }

    /// Value for depths just above 0.
    fn limit(&self, component: Component) -> f64 {
        match self {
            Self::Power { .. } => match self.power(component) {
                Some(Power::Constant(factor)) => factor,
                _ => 0.0,
            },
            Self::Kienzle(_) => 0.0,
            Self::Table(law) => law.limit(component),
        }
    }
}

/// A turn of the law about a reference depth, `(t/t_ref)^delta`.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Turn {
    exponent: f64,
    reference_mm: f64,
}

/// Forces over the engaged depth t, at one feed and one speed: `deflection/6.1` to `deflection/6.3`.
///
/// P(t) = P_0 + K P_law(t) for t > 0, and 0 for t <= 0, where nothing is cut: a law with a constant
/// part jumps there, see [`DepthLaw::limit`].
#[derive(Debug, Clone, PartialEq)]
pub struct DepthLaw {
    law: Law,
    scale: f64,
    added: Forces,
    turn: Option<Turn>,
}

impl DepthLaw {
    pub(super) fn new(law: Law, scale: f64, added: Forces) -> Self {
        Self { law, scale, added, turn: None }
    }

    /// No force at any depth.
    pub fn zero() -> Self {
        Self::new(Law::constant(Forces::default()), 1.0, Forces::default())
    }

    /// A power law in the depth: passive force `factor_n` t^`exponent`, t in mm, no other force.
    pub fn passive_only(factor_n: f64, exponent: f64) -> Self {
        let law = Law::Power { passive: Power::new(factor_n, exponent), main: Power::ZERO, feed: Power::ZERO };
        Self::new(law, 1.0, Forces::default())
    }

    /// All three forces at `depth_mm`, N.
    pub fn forces(&self, depth_mm: f64) -> Forces {
        Forces {
            passive_n: self.component_and_slope(Component::Passive, depth_mm).0,
            main_n: self.component_and_slope(Component::Main, depth_mm).0,
            feed_n: self.component_and_slope(Component::Feed, depth_mm).0,
        }
    }

    /// Passive force at `depth_mm`, N.
    pub fn passive(&self, depth_mm: f64) -> f64 {
        self.component_and_slope(Component::Passive, depth_mm).0
    }

    /// Passive force, N, and its slope over depth, N/mm, at `depth_mm`.
    pub fn passive_and_slope(&self, depth_mm: f64) -> (f64, f64) {
        self.component_and_slope(Component::Passive, depth_mm)
    }

    /// Main force, N, and its slope over depth, N/mm, at `depth_mm`.
    pub fn main_and_slope(&self, depth_mm: f64) -> (f64, f64) {
        self.component_and_slope(Component::Main, depth_mm)
    }

    /// Feed force, N, and its slope over depth, N/mm, at `depth_mm`.
    pub fn feed_and_slope(&self, depth_mm: f64) -> (f64, f64) {
        self.component_and_slope(Component::Feed, depth_mm)
    }

    /// One force, N, and its slope over depth, N/mm; both 0 for depths up to 0.
    #[inline]
    pub fn component_and_slope(&self, component: Component, depth_mm: f64) -> (f64, f64) {
        // Written so that a NaN goes through the law and comes out as one.
        if depth_mm <= 0.0 {
            return (0.0, 0.0);
        }
        let (value, slope) = self.law.value_and_slope(component, depth_mm);
        let (mut value, mut slope) = (self.scale * value, self.scale * slope);
        if let Some(turn) = self.turn {
            let factor = (turn.exponent * (depth_mm / turn.reference_mm).ln()).exp();
            slope = factor * (slope + turn.exponent * value / depth_mm);
            value *= factor;
        }
        (value + self.added.get(component), slope)
    }

    /// The forces P(0+) just above depth 0, N: the constant part of the law. A command that leaves
    /// the tool to be pushed away by more than the depth cuts nothing (status `no_cut`).
    ///
    /// Infinite where a [turned](Self::with_depth_exponent) law grows without bound toward 0.
    pub fn limit(&self) -> Forces {
        let at = |component| self.added.get(component) + self.limit_of_law(component);
        Forces { passive_n: at(Component::Passive), main_n: at(Component::Main), feed_n: at(Component::Feed) }
    }

    fn limit_of_law(&self, component: Component) -> f64 {
        let limit = self.scale * self.law.limit(component);
        match self.turn {
            Some(turn) if turn.exponent >= 0.0 => 0.0,
            Some(_) if limit > 0.0 => f64::INFINITY,
            None | Some(_) => limit,
        }
    }

    /// Factor, N at 1 mm, and exponent of the depth, where the passive force is one power of the
    /// depth and nothing else.
    pub fn passive_power(&self) -> Option<(f64, f64)> {
        let (mut factor, mut exponent) = self.law.power(Component::Passive)?.parts();
        factor *= self.scale;
        if let Some(turn) = self.turn {
            factor *= (-turn.exponent * turn.reference_mm.ln()).exp();
            exponent += turn.exponent;
        }
        if self.added.passive_n > 0.0 {
            // Constant plus constant is a constant; constant plus power is no power.
            return (exponent.abs() < f64::EPSILON).then_some((factor + self.added.passive_n, 0.0));
        }
        Some((factor, exponent))
    }

    /// The law with all forces, the constant part too, multiplied by `factor` >= 0.
    #[must_use]
    pub fn scaled(mut self, factor: f64) -> Self {
        self.scale *= factor;
        self.added.passive_n *= factor;
        self.added.main_n *= factor;
        self.added.feed_n *= factor;
        self
    }

    /// The law with `forces` added wherever something is cut.
    #[must_use]
    pub fn with_added(mut self, forces: Forces) -> Self {
        self.added.passive_n += forces.passive_n;
        self.added.main_n += forces.main_n;
        self.added.feed_n += forces.feed_n;
        self
    }

    /// The law without its constant part times (t/t_ref)^`delta`: its exponent of the depth turned
    /// about `reference_mm` > 0. A second turn replaces the first.
    #[must_use]
    pub fn with_depth_exponent(mut self, delta: f64, reference_mm: f64) -> Self {
        self.turn = Some(Turn { exponent: delta, reference_mm });
        self
    }
}
