//! Everything that is asked of a clamping (`clamping/5`).

use super::elastic::{Criterion, Deciding, Lift, Loaded};
use super::equilibrium::{LARGEST_FACTOR, certain_slip_below_n, load_factor};
use super::rest::Rest;
use super::{Fixture, Load, Unheld};

/// Steps of the search for a factor.
const STEPS: usize = 60;
/// Its relative width at the end.
const NARROW: f64 = 1e-10;
const PERCENT: f64 = 100.0;

/// What is asked.
#[derive(Debug, Clone, Copy)]
pub struct Asked<'a> {
    /// The fixture; its contacts' own friction does not act.
    pub fixture: &'a Fixture,
    /// Loads at every instant and station.
    pub peaks: &'a [Load],
    /// Their means, one for each station.
    pub means: &'a [Load],
    /// Safety on the loads.
    pub safety: f64,
    /// Lowest, likely and highest friction of each contact, above 0.
    pub friction: [&'a [f64]; 3],
    /// The clamp force at hand.
    pub clamp_force_n: Option<f64>,
    /// Loads for which certain slip is solved at most, those that ask for most first: of fewer what is told stays certain, and may be
    /// less sharp.
    pub programmes: usize,
}

/// The answer.
#[derive(Debug, Clone, PartialEq)]
pub struct Sheet {
    /// Least clamp force at which no contact slips or opens at the lowest friction, 0 at least.
    pub clamp_force_min_n: f64,
    /// The same at the likely friction.
    pub at_likely_friction_n: f64,
    /// The same at the highest friction.
    pub at_high_friction_n: f64,
    /// The same by the mean loads, at the lowest friction.
    pub against_mean_n: f64,
    /// Below this the part slips for certain, at the lowest friction; `None` where the programme came to no end.
    pub certain_slip_below_n: Option<f64>,
    /// The same by the mean loads.
    pub certain_slip_by_mean_n: Option<f64>,
    /// What asks for the least clamp force; `None` without loads.
    pub decides: Option<Deciding>,
    /// How the clamp force at hand holds.
    pub at_hand: Option<AtHand>,
    /// Contacts that come off.
    pub lifts: Vec<Lift>,
    /// The load that takes the part off all contacts at once that no clamp force presses on.
    pub comes_off: Option<Lift>,
    /// Contact by contact, at the clamp force at hand, else at the least.
    pub contacts: Vec<Used>,
}

/// How a clamp force holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AtHand {
    /// Factor on the loads, safety left aside, at which a contact slips or opens, at the lowest friction.
    pub no_slip_factor: f64,
    /// Factor beyond which slip is certain; `None` where the programme came to no end.
    pub certain_slip_factor: Option<f64>,
    /// Least friction, the same everywhere, that holds; `None` where a contact opens.
    pub friction_needed: Option<f64>,
}

/// What a contact carries.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Used {
    /// Normal force at rest.
    pub rest_n: f64,
    /// Least normal force under the loads.
    pub least_normal_n: f64,
    /// Largest tangential force.
    pub tangential_n: f64,
    /// Largest share of its friction that is used, percent, 100 at least where it slips; `None` where a load opens it.
    pub friction_used_percent: Option<f64>,
}

impl Asked<'_> {
    /// Solves everything.
    pub fn sheet(&self) -> Result<Sheet, Unheld> {
        let rest = Rest::of(self.fixture)?;
        let loaded = rest.loaded(self.fixture, self.peaks, self.safety)?;
        let [low, likely, high] = self.friction;
        let least = |loaded: &[Loaded], friction: &[f64]| {
            rest.against_slip(loaded, friction).map_or(0.0, |deciding| deciding.clamp_force_n.max(0.0))
        };
        let means = rest.loaded(self.fixture, self.means, self.safety)?;
        let certain = |loads: &[Load], loaded: &[Loaded]| {
            let each: Vec<f64> = loaded.iter().map(|one| least(std::slice::from_ref(one), low)).collect();
            Some(certain_slip_below_n(self.fixture, loads, self.safety, low, &each, self.programmes)?.0)
        };
        let clamp_force_min_n = least(&loaded, low);
        let at_hand = self.clamp_force_n.map(|force_n| self.at_hand(&rest, &loaded, force_n)).transpose()?;
        Ok(Sheet {
            clamp_force_min_n,
            at_likely_friction_n: least(&loaded, likely),
            at_high_friction_n: least(&loaded, high),
            against_mean_n: least(&means, low),
            certain_slip_below_n: certain(self.peaks, &loaded),
            certain_slip_by_mean_n: certain(self.means, &means),
            decides: rest.against_slip(&loaded, low),
            at_hand,
            lifts: rest.lifts(self.fixture, self.peaks, &loaded),
            comes_off: rest.comes_off(self.fixture, self.peaks, &loaded),
            contacts: used(&rest, &loaded, low, self.clamp_force_n.unwrap_or(clamp_force_min_n)),
        })
    }

    fn at_hand(&self, rest: &Rest, loaded: &[Loaded], force_n: f64) -> Result<AtHand, Unheld> {
        let low = self.friction[0];
        let mut certain = Some(LARGEST_FACTOR);
        let asked_n =
            |of: &Loaded| rest.against_slip(std::slice::from_ref(of), low).map_or(0.0, |one| one.clamp_force_n);
        let mut order: Vec<(f64, &Load)> = loaded.iter().map(asked_n).zip(self.peaks).collect();
        order.sort_by(|a, b| b.0.total_cmp(&a.0));
        for (_, load) in order.into_iter().take(self.programmes) {
            // A load that slips nowhere at this factor is balanced at it, too.
            let one = std::slice::from_ref(load);
            let holds = |factor: f64| -> Result<bool, Unheld> {
                let loaded = rest.loaded(self.fixture, one, factor)?;
                Ok(rest.against_slip(&loaded, low).is_none_or(|asked| asked.clamp_force_n <= force_n))
            };
            if certain.map(holds).transpose()? == Some(true) {
                continue;
            }
            certain = certain.zip(load_factor(self.fixture, load, force_n, low)).map(|(least, one)| least.min(one));
        }
        Ok(AtHand {
            no_slip_factor: self.no_slip_factor(rest, force_n)?,
            certain_slip_factor: certain,
            friction_needed: rest.friction_needed(loaded, force_n),
        })
    }

    /// The factor on the loads at which a contact slips or opens.
    fn no_slip_factor(&self, rest: &Rest, force_n: f64) -> Result<f64, Unheld> {
        let short = |factor: f64| -> Result<f64, Unheld> {
            let loaded = rest.loaded(self.fixture, self.peaks, factor)?;
            let asked = rest.against_slip(&loaded, self.friction[0]);
            Ok(asked.map_or(0.0, |deciding| deciding.clamp_force_n) - force_n)
        };
        let (mut below, mut short_below) = (0.0, short(0.0)?);
        if short_below > 0.0 {
            return Ok(0.0);
        }
        let (mut above, mut short_above) = (1.0, short(1.0)?);
        while short_above <= 0.0 {
            if above >= LARGEST_FACTOR {
                return Ok(LARGEST_FACTOR);
            }
            (below, short_below) = (above, short_above);
            above = (2.0 * above).min(LARGEST_FACTOR);
            short_above = short(above)?;
        }
        // The force asked for is linear in the factor as long as the same contacts are closed: a secant, halved where it is slow.
        let mut side = 0;
        for _ in 0..STEPS {
            if above - below <= NARROW * above {
                break;
            }
            let middle = below + (above - below) * (-short_below / (short_above - short_below)).clamp(0.0, 1.0);
            let middle = if (below..above).contains(&middle) { middle } else { 0.5 * (below + above) };
            let value = short(middle)?;
            if value > 0.0 {
                (above, short_above) = (middle, value);
                short_below *= if side == 1 { 0.5 } else { 1.0 };
                side = 1;
            } else {
                (below, short_below) = (middle, value);
                short_above *= if side == -1 { 0.5 } else { 1.0 };
                side = -1;
            }
            if value.abs() <= NARROW * force_n {
                return Ok(middle);
            }
        }
        Ok(below)
    }
}

/// What each contact carries under a clamp force.
fn used(rest: &Rest, loaded: &[Loaded], friction: &[f64], clamp_force_n: f64) -> Vec<Used> {
    let contact = |i: usize| {
        let rest_n = rest.shares[i] * clamp_force_n + rest.by_weight_n[i];
        let mut found = Used { rest_n, least_normal_n: rest_n, tangential_n: 0.0, friction_used_percent: Some(0.0) };
        for of in loaded {
            let normal_n = rest_n + of.normal_n[i];
            let tangential_n = of.tangential[i].iter().map(|t| t * t).sum::<f64>().sqrt();
            found.least_normal_n = found.least_normal_n.min(normal_n);
            found.tangential_n = found.tangential_n.max(tangential_n);
            let used = super::friction_needed(tangential_n, normal_n).map(|needed| PERCENT * needed / friction[i]);
            found.friction_used_percent = found.friction_used_percent.zip(used).map(|(most, one)| most.max(one));
        }
        found
    };
    (0..rest.shares.len()).map(contact).collect()
}

impl Criterion {
    /// Its name, as answers have it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Slip => "slip",
            Self::Opening => "opening",
        }
    }
}
