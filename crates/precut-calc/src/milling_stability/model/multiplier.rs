//! The multiplier of largest modulus, with what it may be wrong by.

use crate::calculator::{Failure, Monitor, Pace, checkpoint};
use crate::num::dde::{Rule, largest_paced, largest_pair_paced};

use super::cutter::Milling;
use super::forced::{Forced, about_forced, forced};
use super::map::{Cut, Map};
use super::shares::{Alias, Shares, shares, transient_growth};
use super::slow::{MOST_OSCILLATIONS, slow_forced};
use super::slow_period::{SlowMultiplier, slow_multiplier};

/// Points of an element, of the finer one that tells the error, and of one that does for a map.
pub(super) const POINTS: usize = 12;
const FINER: usize = 16;
const COARSE: usize = 8;
/// Residual of the eigenvalue over its modulus, and that which does for a map.
const TOLERANCE: f64 = 1e-11;
const COARSE_TOLERANCE: f64 = 1e-6;
/// Applications of the map before the search, which take away what decays at once.
const POWER_STEPS: usize = 8;
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

    /// Angle by which it turns in a period, 0 to pi.
    pub fn angle_rad(&self) -> f64 {
        self.im.abs().atan2(self.re)
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
    coarse: Rule<COARSE>,
}

impl Orders {
    /// The cutter with its chips taken about the motion that they force; `None` where that is not asked for, changes nothing, or is not
    /// found: then undisturbed chips stand. It takes some dozen times as long as a multiplier.
    pub fn about(&self, cut: &Cut<'_>, monitor: &dyn Monitor) -> Result<Option<Milling>, Failure> {
        if cut.oscillations() > MOST_OSCILLATIONS { Ok(None) } else { about_forced(cut, &self.usual, monitor) }
    }

    /// The leading multiplier; `None` where the equations are singular. Of a slow cut that repeats from tooth to tooth it is the closed
    /// form, and what grows fifty times between two teeth counts as one that grows.
    pub fn multiplier(&self, cut: &Cut<'_>, monitor: &dyn Monitor) -> Result<Option<Multiplier>, Failure> {
        if cut.is_slow() && cut.repeats() {
            return Ok(Some(slow_multiplier(cut, false, monitor)?.counted()));
        }
        leading(cut, &self.usual, TOLERANCE, monitor)
    }

    /// The same to about 2e-5 of the modulus: for maps.
    pub fn on_map(&self, cut: &Cut<'_>, monitor: &dyn Monitor) -> Result<Option<Multiplier>, Failure> {
        if cut.is_slow() && cut.repeats() {
            return Ok(Some(slow_multiplier(cut, false, monitor)?.counted()));
        }
        leading(cut, &self.coarse, COARSE_TOLERANCE, monitor)
    }

    /// The closed form of a slow cut that repeats from tooth to tooth, with its error: the estimate of the form itself, and what places
    /// half as dense would change.
    pub fn slow(&self, cut: &Cut<'_>, monitor: &dyn Monitor) -> Result<SlowMultiplier, Failure> {
        let usual = slow_multiplier(cut, false, monitor)?;
        let finer = slow_multiplier(cut, true, monitor)?;
        let moved = (usual.multiplier.modulus() - finer.multiplier.modulus()).abs();
        Ok(SlowMultiplier { modulus_error: finer.modulus_error + moved, ..finer })
    }

    /// Frequencies and modes of the disturbance that grows most or decays least (`milling/4.19`); `None` where there is none or
    /// the period is so long that its aliases lie side by side.
    pub fn shares(&self, cut: &Cut<'_>, monitor: &dyn Monitor) -> Result<Option<Shares>, Failure> {
        let Some((map, found, vector)) = leading_pair(cut, &self.usual, TOLERANCE, monitor)? else { return Ok(None) };
        shares(cut, &map, (found.re, found.im), &vector, POINTS, monitor)
    }

    /// To the accuracy of maps, with the frequencies of the disturbance by falling share; none are told where the period is so long that
    /// they lie side by side. `None` where the equations are singular.
    pub fn heard_on_map(
        &self,
        cut: &Cut<'_>,
        monitor: &dyn Monitor,
    ) -> Result<Option<(Multiplier, Vec<Alias>)>, Failure> {
        if cut.is_slow() && cut.repeats() {
            let slow = slow_multiplier(cut, false, monitor)?;
            let alias = Alias { frequency_hz: slow.frequency_hz, share: 1.0 };
            return Ok(Some((slow.counted(), vec![alias])));
        }
        let pair = leading_pair(cut, &self.coarse, COARSE_TOLERANCE, monitor)?;
        let Some((map, found, vector)) = pair.filter(|(_, found, _)| found.modulus().is_finite()) else {
            return Ok(None);
        };
        let shares = shares(cut, &map, (found.re, found.im), &vector, COARSE, monitor)?;
        Ok(Some((found, shares.map_or_else(Vec::new, |shares| shares.aliases))))
    }

    /// How many times the leading disturbance grows at most from one tooth to a later one within a period (`milling/4.18`); `None`
    /// where there is none.
    pub fn transient_growth(&self, cut: &Cut<'_>, monitor: &dyn Monitor) -> Result<Option<f64>, Failure> {
        let pair = leading_pair(cut, &self.usual, TOLERANCE, monitor)?;
        Ok(pair.map(|(map, found, vector)| transient_growth(cut, &map, found.modulus(), &vector, POINTS)))
    }

    /// The motion that repeats itself from period to period (`milling/4.20`); `None` where there is none.
    pub fn forced<'a>(&'a self, cut: &'a Cut<'a>, monitor: &dyn Monitor) -> Result<Option<Forced<'a>>, Failure> {
        // Without waves elements are cheap up to there.
        if cut.is_slow() && cut.oscillations() > MOST_OSCILLATIONS {
            return Ok(Some(slow_forced(cut, &self.usual, monitor)?));
        }
        forced(cut, &self.usual, monitor)
    }

    /// The same with its error in the modulus: against elements of a higher order, and what its eigenpair leaves times the
    /// condition of the eigenvalue, by its left and right vector.
    pub fn with_error(&self, cut: &Cut<'_>, monitor: &dyn Monitor) -> Result<Option<(Multiplier, f64)>, Failure> {
        if cut.is_slow() && cut.repeats() {
            let slow = self.slow(cut, monitor)?;
            return Ok(Some((slow.counted(), slow.modulus_error)));
        }
        let usual = conditioned(cut, &self.usual, monitor)?;
        let finer = leading(cut, &self.finer, TOLERANCE, monitor)?;
        Ok(usual.zip(finer).map(|((usual, condition), finer)| {
            let error = (usual.modulus() - finer.modulus()).abs();
            (finer, error + condition * (usual.residual + finer.residual) * finer.modulus())
        }))
    }
}

/// A map, its leading multiplier, and the real and imaginary part of its eigenvector.
type Pair = (Map, Multiplier, (Vec<f64>, Vec<f64>));

/// The map with its leading eigenvalue and eigenvector.
fn leading_pair<const P: usize>(
    cut: &Cut<'_>,
    rule: &Rule<P>,
    tolerance: f64,
    monitor: &dyn Monitor,
) -> Result<Option<Pair>, Failure> {
    let Some(map) = Map::new(cut, rule, monitor)? else { return Ok(None) };
    let mut pace = Pace::new(monitor);
    let mut applying = Pace::new(monitor);
    let apply = |vector: &mut [f64]| {
        map.apply(vector);
        applying.work(map.work())
    };
    let (found, vector) = largest_pair_paced(map.dimension(), POWER_STEPS, tolerance, apply, |done| pace.work(done))?;
    let found = Multiplier { re: found.re, im: found.im, residual: found.residual };
    Ok(vector.map(|vector| (map, found, vector)))
}

/// The leading multiplier and the condition of it as an eigenvalue, 1 at least.
fn conditioned<const P: usize>(
    cut: &Cut<'_>,
    rule: &Rule<P>,
    monitor: &dyn Monitor,
) -> Result<Option<(Multiplier, f64)>, Failure> {
    checkpoint(monitor)?;
    let Some(map) = Map::new(cut, rule, monitor)? else { return Ok(None) };
    let (mut pace, mut applying) = (Pace::new(monitor), Pace::new(monitor));
    let apply = |vector: &mut [f64]| {
        map.apply(vector);
        applying.work(map.work())
    };
    let (found, right) = largest_pair_paced(map.dimension(), POWER_STEPS, TOLERANCE, apply, |done| pace.work(done))?;
    if !found.modulus().is_finite() {
        return Ok(None);
    }
    let (mut pace, mut applying) = (Pace::new(monitor), Pace::new(monitor));
    let transposed = |vector: &mut [f64]| {
        map.apply_transposed(vector);
        applying.work(map.work())
    };
    let (_, left) =
        largest_pair_paced(map.dimension(), POWER_STEPS, COARSE_TOLERANCE, transposed, |done| pace.work(done))?;
    let condition = right.zip(left).map_or(1.0, |(right, left)| condition(&left, &right));
    Ok(Some((Multiplier { re: found.re, im: found.im, residual: found.residual }, condition)))
}

/// |y| |x| over |y' x| of a left and a right vector, real and imaginary parts.
fn condition((left_re, left_im): &(Vec<f64>, Vec<f64>), (right_re, right_im): &(Vec<f64>, Vec<f64>)) -> f64 {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(p, q)| p * q).sum::<f64>();
    let length = |re: &[f64], im: &[f64]| (dot(re, re) + dot(im, im)).sqrt();
    let re = dot(left_re, right_re) - dot(left_im, right_im);
    let im = dot(left_re, right_im) + dot(left_im, right_re);
    let found = length(left_re, left_im) * length(right_re, right_im) / re.hypot(im);
    if found.is_finite() { found.max(1.0) } else { 1.0 }
}

fn leading<const P: usize>(
    cut: &Cut<'_>,
    rule: &Rule<P>,
    tolerance: f64,
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
    let found = largest_paced(map.dimension(), POWER_STEPS, tolerance, apply, |done| pace.work(done))?;
    Ok(found.modulus().is_finite().then_some(Multiplier { re: found.re, im: found.im, residual: found.residual }))
}
