//! What becomes of a disturbance: the leading multiplier, by elements or by the closed form of a slow cut.

use crate::calculator::Failure;

use super::super::model::{About, Cut, GROWN, Milling, Multiplier, SlowMultiplier};
use super::Study;
use super::output::{FrequencyShare, LeadingMultiplier};

/// A disturbance of this share has died away.
const DECAYED: f64 = 1e-3;

/// What becomes of a disturbance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Growth {
    /// The multiplier is 1 within its error.
    Unknown,
    Grows,
    /// It dies out from tooth to tooth, after growing fifty times and more between two.
    GrowsWithin,
    DiesOut,
}

impl Growth {
    /// Of a slow cut what grows between two teeth counts.
    pub(super) fn of(multiplier: &LeadingMultiplier, is_slow: bool) -> Self {
        let within = multiplier.transient_growth.filter(|_| is_slow).unwrap_or(0.0);
        let is_one = (multiplier.modulus - 1.0).abs() <= multiplier.modulus_error;
        // What grows fifty times does harm on either side of 1.
        if is_one && within < GROWN {
            Self::Unknown
        } else if multiplier.modulus > 1.0 {
            Self::Grows
        } else if within >= GROWN {
            Self::GrowsWithin
        } else {
            Self::DiesOut
        }
    }
}

/// A multiplier with the share of each mode in its energy, where that is known.
type Told = (LeadingMultiplier, Option<Vec<f64>>);

/// The leading multiplier, about the motion that the chips force where that is known; `None` of a slow cut whose teeth are not followed by
/// one alike.
pub(super) fn multiplier(study: &Study<'_>, about: Option<&Milling>) -> Result<Option<Told>, Failure> {
    let cut = study.cut();
    if study.is_slow {
        return if cut.repeats() { Ok(Some((slow_multiplier(study, &cut)?, None))) } else { Ok(None) };
    }
    let unsolved = Failure::NotConverged { what: "largest Floquet multiplier", residual: 1.0, iterations: 0 };
    let smooth_chips_modulus = match about {
        Some(milling) => {
            let milling = Milling { about: About::SmoothChips, ..milling.clone() };
            let found = study.orders.with_error(&Cut { milling: &milling, ..cut }, study.monitor)?;
            found.map(|(found, _)| found.modulus())
        }
        None => None,
    };
    let cut = about.map_or(cut, |milling| Cut { milling, ..cut });
    let (found, modulus_error) = study.orders.with_error(&cut, study.monitor)?.ok_or(unsolved)?;
    let shares = study.orders.shares(&cut, study.monitor)?;
    let varies = cut.rotation.varies();
    let transient_growth = if varies { study.orders.transient_growth(&cut, study.monitor)? } else { None };
    let period_s = cut.rotation.period_s(cut.milling.period_rad());
    let growth_per_s = found.growth() / period_s;
    let aliases: Vec<FrequencyShare> = shares
        .iter()
        .flat_map(|shares| &shares.aliases)
        .map(|alias| FrequencyShare { frequency_hz: alias.frequency_hz, share: alias.share })
        .collect();
    let told = LeadingMultiplier {
        modulus: found.modulus(),
        real: found.re,
        imaginary: found.im.abs(),
        kind: found.kind().into(),
        period_s,
        per_tooth: per_tooth(&found, study.teeth_per_period(&cut.rotation)),
        growth_per_s,
        settling_time_s: (growth_per_s < 0.0).then(|| DECAYED.ln() / growth_per_s),
        modulus_error,
        smooth_chips_modulus,
        chatter_frequency_hz: aliases.first().map(|alias| alias.frequency_hz),
        aliases,
        transient_growth,
    };
    Ok(Some((told, shares.map(|shares| shares.energy))))
}

/// That of a slow cut by its closed form.
fn slow_multiplier(study: &Study<'_>, cut: &Cut<'_>) -> Result<LeadingMultiplier, Failure> {
    let SlowMultiplier { multiplier: found, modulus_error, within, frequency_hz } =
        study.orders.slow(cut, study.monitor)?;
    let period_s = cut.rotation.period_s(cut.milling.period_rad());
    let growth_per_s = found.growth() / period_s;
    Ok(LeadingMultiplier {
        modulus: found.modulus(),
        real: found.re,
        imaginary: found.im.abs(),
        kind: found.kind().into(),
        period_s,
        per_tooth: found.modulus(),
        growth_per_s,
        settling_time_s: (growth_per_s < 0.0).then(|| DECAYED.ln() / growth_per_s),
        modulus_error,
        smooth_chips_modulus: None,
        chatter_frequency_hz: Some(frequency_hz),
        aliases: Vec::new(),
        transient_growth: Some(within),
    })
}

/// |mu| from tooth to tooth.
pub(super) fn per_tooth(found: &Multiplier, teeth: f64) -> f64 {
    (found.growth() / teeth).exp()
}
