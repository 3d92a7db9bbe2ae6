//! The multiplier of largest modulus, with what it may be wrong by.

use crate::calculator::{Failure, Monitor, Pace, checkpoint};
use crate::num::dde::{Rule, largest_paced};

use super::map::{Cut, Map};

/// Points of an element, and of the finer one that tells the error.
const POINTS: usize = 12;
const FINER: usize = 16;
/// Residual of the eigenvalue over its modulus.
const TOLERANCE: f64 = 1e-11;
/// An imaginary part below this share is none.
const REAL: f64 = 1e-7;

/// How a disturbance comes back.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A pair: a frequency of its own.
    Hopf,
    /// Negative: every second period.
    Flip,
    /// Positive: it goes away or grows without swinging.
    Fold,
}

/// The leading multiplier over a period of the map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Multiplier {
    /// Real part.
    pub re: f64,
    /// Imaginary part, of a pair the positive one.
    pub im: f64,
    /// Of the eigenpair, over the modulus.
    pub residual: f64,
}

impl Multiplier {
    /// |mu|.
    pub fn modulus(&self) -> f64 {
        self.re.hypot(self.im)
    }

    /// ln |mu|: below 0 a disturbance dies away.
    pub fn growth(&self) -> f64 {
        self.modulus().max(f64::MIN_POSITIVE).ln()
    }

    /// Its kind.
    pub fn kind(&self) -> Kind {
        if self.im.abs() > REAL * self.modulus() {
            Kind::Hopf
        } else if self.re < 0.0 {
            Kind::Flip
        } else {
            Kind::Fold
        }
    }
}

/// Tables of the elements, made once.
#[derive(Debug, Default)]
pub struct Orders {
    usual: Rule<POINTS>,
    finer: Rule<FINER>,
}

impl Orders {
    /// The leading multiplier; `None` where the equations are singular.
    pub fn multiplier(&self, cut: &Cut<'_>, monitor: &dyn Monitor) -> Result<Option<Multiplier>, Failure> {
        leading(cut, &self.usual, monitor)
    }

    /// The same with its error in the modulus: against elements of a higher order, and what its eigenpair leaves.
    pub fn with_error(&self, cut: &Cut<'_>, monitor: &dyn Monitor) -> Result<Option<(Multiplier, f64)>, Failure> {
        let (usual, finer) = (leading(cut, &self.usual, monitor)?, leading(cut, &self.finer, monitor)?);
        Ok(usual.zip(finer).map(|(usual, finer)| {
            let error = (usual.modulus() - finer.modulus()).abs();
            (finer, error + (usual.residual + finer.residual) * finer.modulus())
        }))
    }
}

fn leading<const P: usize>(
    cut: &Cut<'_>,
    rule: &Rule<P>,
    monitor: &dyn Monitor,
) -> Result<Option<Multiplier>, Failure> {
    checkpoint(monitor)?;
    let Some(map) = Map::new(cut, rule, monitor)? else { return Ok(None) };
    let mut pace = Pace::new(monitor);
    let mut applying = Pace::new(monitor);
    let apply = |vector: &mut [f64]| {
        map.apply(vector);
        applying.work(map.work())
    };
    let found = largest_paced(map.dimension(), 8, TOLERANCE, apply, |done| pace.work(done))?;
    Ok(found.modulus().is_finite().then_some(Multiplier { re: found.re, im: found.im, residual: found.residual }))
}
