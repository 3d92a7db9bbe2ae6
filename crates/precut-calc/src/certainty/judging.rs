//! Cuts that are judged by several limits: over what has a distribution, and within bounds at the worst (`certainty/1.2`,
//! `certainty/3.2`).

use crate::calculator::Failure;

use super::around::{Around, Asked, Real};
use super::bounds::Extremes;
use super::lines::Margins;
use super::{ConformanceMethod, Contribution, JointlyKept, LimitKept, Quantity, Uncertainties, bounded};

/// How far a probability that is told is checked on the real model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Checking {
    /// Not at all: a response surface tells it.
    None,
    /// On lines.
    OnLines,
    /// On lines, and half of the width of every quantity on so many lines of a scrambling.
    WithHalves(usize),
}

/// A cut with `K` limits, of which `S` sets are asked; it may be tried at another place.
pub(crate) trait Judging<const K: usize, const S: usize>: Sized {
    /// What may be uncertain in it.
    type Of: Quantity;
    /// Where it cuts.
    type At: Copy;

    /// Names of the limits, and the fields of the job that set them.
    const NAMES: [(&'static str, &'static str); K];
    /// Most lines of one scrambling, of the response surface and of the real model: for what is told, and for a place that is tried.
    const MOST_LINES: [usize; 2];
    const MOST_LINES_TRIED: [usize; 2];

    /// What is uncertain, those between bounds held where they are.
    fn uncertainties(&self) -> &Uncertainties<Self::Of>;

    /// The same with other ones.
    fn with(&self, uncertainties: Uncertainties<Self::Of>) -> Self;

    /// By how much the limits are kept at a place, at what the quantities come to.
    fn real(&self, at: Self::At) -> Result<impl Fn(&[f64]) -> Result<Margins<K>, Failure>, Failure>;

    /// What is asked of that.
    fn asked<'b>(&'b self, real: &'b Real<'b, K>, most_lines: [usize; 2]) -> Asked<'b, Self::Of, K, S>;

    /// Where within bounds the probability is least and most; `None` where there are none.
    fn extremes(&self, at: Self::At) -> Result<Option<Extremes>, Failure> {
        self.uncertainties().extremes(&mut |of| self.with(of.clone()).nearly(at))
    }

    /// The probability that all limits are kept, by a response surface alone.
    fn nearly(&self, at: Self::At) -> Result<f64, Failure> {
        let real = self.real(at)?;
        Around::of(self.asked(&real, Self::MOST_LINES_TRIED))?.nearly()
    }

    /// The same by the real model, with the quantities between bounds where they are.
    fn alone(&self, at: Self::At, most_lines: [usize; 2]) -> Result<f64, Failure> {
        let real = self.real(at)?;
        Ok(bounded(Around::of(self.asked(&real, most_lines))?.found()?.of[S - 1].probability))
    }

    /// That of a place that is tried, within bounds the least.
    fn probability(&self, at: Self::At) -> Result<f64, Failure> {
        match self.extremes(at)? {
            Some(extremes) => self.held(&extremes.least).alone(at, Self::MOST_LINES_TRIED),
            None => self.alone(at, Self::MOST_LINES_TRIED),
        }
    }

    /// With the quantities between bounds at these places.
    fn held(&self, places: &[f64]) -> Self {
        self.with(self.uncertainties().held(places))
    }

    /// Tells the probability at a place. Where bounds alone are known of a quantity it is the least within them.
    fn told(&self, at: Self::At, wanted: f64, check: Checking) -> Result<Told, Failure> {
        let Some(Extremes { least, most, search }) = self.extremes(at)? else {
            return self.told_alone(at, wanted, check);
        };
        let told = self.held(&least).told_alone(at, wanted, check)?;
        let most = self.held(&most);
        let most = if check == Checking::None { most.nearly(at)? } else { most.alone(at, Self::MOST_LINES)? };
        Ok(Told { joint: told.joint.least(most, search), ..told })
    }

    /// The same with the quantities between bounds where they are.
    fn told_alone(&self, at: Self::At, wanted: f64, check: Checking) -> Result<Told, Failure> {
        let real = self.real(at)?;
        let asked = self.asked(&real, Self::MOST_LINES);
        let (limits, seed) = (asked.limits, asked.seed);
        let around = Around::of(asked)?;
        let found = if check == Checking::None { around.by_surface()? } else { around.found()? };
        let joint = JointlyKept::of(found.of[S - 1], wanted);
        let compared = if let Checking::WithHalves(lines) = check { Some(lines) } else { None };
        let mut contributions = around.contributions(&found, compared)?;
        let at_half = &mut |of: &Uncertainties<Self::Of>| self.with(of.clone()).nearly(at);
        contributions.extend(self.uncertainties().contributions_within(joint.probability, at_half)?);
        Ok(Told {
            limits: limits.iter().map(|&limit| LimitKept::of(Self::NAMES[limit], found.of[limit])).collect(),
            joint,
            contributions,
            method: ConformanceMethod {
                integrated_lines: u32::try_from(found.lines).unwrap_or(u32::MAX),
                linear_probability: bounded(around.linear_probability()?),
                seed,
            },
        })
    }
}

/// What is told of a cut.
pub(crate) struct Told {
    /// Every limit alone.
    pub limits: Vec<LimitKept>,
    /// All of them.
    pub joint: JointlyKept,
    /// What the doubt is made of.
    pub contributions: Vec<Contribution>,
    /// How that was found.
    pub method: ConformanceMethod,
}
