//! Refinement where the model is far from linear (`diagnosis/3.4`): no step is taken that does not come nearer to the rows.

use crate::calculator::{Failure, checkpoint};
use crate::diagnosis::causes::refine::{Fit, Here, Refinement, SETTLED, Start, Unknowns};
use crate::diagnosis::causes::subject::Setting;

/// Steps at most.
const STEPS: usize = 12;
/// Shares of a step that are tried one after the other.
const SHARES: [f64; 4] = [1.0, 0.4, 0.15, 0.05];
/// A step that lowers the cost by less than this changes the logarithm of the evidence by a hundredth and ends the way.
const WORTH_IT: f64 = 0.02;

/// A place on the way down: what it leaves of the rows, and its cost.
struct Stand {
    settings: Vec<Setting>,
    raw: Vec<f64>,
    cost: f64,
}

impl Refinement<'_> {
    /// Gauss-Newton; of every step the first of a few shares that lowers the cost.
    ///
    /// A model with kinks, as teeth are that move, may foretell a cost at the end of a step that it keeps at no share of it. What
    /// it does not keep is no evidence: the cost that was reached counts.
    pub(in crate::diagnosis) fn descend(&self, start: &Start, unknowns: Unknowns) -> Result<Option<Fit>, Failure> {
        let Some(mut stand) = self.first(start, &unknowns)? else { return Ok(None) };
        let mut is_worth_it = true;
        for step in 0.. {
            checkpoint(self.monitor)?;
            let here = unknowns.linearised(self, &stand.raw, &stand.settings)?;
            let Some(mut evidence) = here.evidence(self.likelihood, &unknowns) else { return Ok(None) };
            let (_, longest) = unknowns.moved(&stand.settings, &evidence, 1.0);
            let goes_on = is_worth_it && longest >= SETTLED && step < STEPS;
            let lower = if goes_on {
                self.lower(&stand, |share| unknowns.moved(&stand.settings, &evidence, share).0, &unknowns)?
            } else {
                None
            };
            if let Some(next) = lower {
                is_worth_it = stand.cost - next.cost > WORTH_IT;
                stand = next;
                continue;
            }
            let not_kept = self.not_kept(&stand, &here, &evidence.t, &unknowns);
            evidence.log_z += self.likelihood.gain(evidence.q, evidence.q + not_kept);
            evidence.q += not_kept;
            return Ok(Some(unknowns.fit(stand.settings, evidence, here, step < STEPS)));
        }
        Ok(None)
    }

    /// Where the straight model has its optimum; where the base alone costs less, a part of the way there.
    fn first(&self, start: &Start, unknowns: &Unknowns) -> Result<Option<Stand>, Failure> {
        let whole = self.stand(start.settings.clone(), unknowns)?;
        if whole.as_ref().is_some_and(|whole| whole.cost < self.misfit_of_base) {
            return Ok(whole);
        }
        let Some(about) = self.stand(unknowns.at(&start.settings, unknowns.coordinates_of(&start.about)), unknowns)?
        else {
            return Ok(whole);
        };
        let (from, to): (Vec<f64>, Vec<f64>) =
            (unknowns.coordinates_of(&about.settings).collect(), unknowns.coordinates_of(&start.settings).collect());
        let part = |share: f64| {
            unknowns.at(&start.settings, from.iter().zip(&to).map(|(from, to)| from + share * (to - from)))
        };
        Ok(Some(self.lower(&about, part, unknowns)?.unwrap_or(about)))
    }

    /// The first share of a way that costs less than where it begins.
    fn lower(
        &self,
        from: &Stand,
        part: impl Fn(f64) -> Vec<Setting>,
        unknowns: &Unknowns,
    ) -> Result<Option<Stand>, Failure> {
        for share in SHARES {
            checkpoint(self.monitor)?;
            let next = self.stand(part(share), unknowns)?;
            if next.as_ref().is_some_and(|next| next.cost < from.cost) {
                return Ok(next);
            }
        }
        Ok(None)
    }

    fn stand(&self, settings: Vec<Setting>, unknowns: &Unknowns) -> Result<Option<Stand>, Failure> {
        let raw = self.raw_residual(&settings)?;
        Ok(raw.map(|raw| Stand { cost: self.cost(&raw, &settings, unknowns), settings, raw }))
    }

    /// By how much less than it does cost the straight model would have it at the end of the next step.
    fn not_kept(&self, stand: &Stand, here: &Here, t: &[f64], unknowns: &Unknowns) -> f64 {
        let within: Vec<f64> = unknowns.coordinates_of(&unknowns.at(&stand.settings, t.iter().copied())).collect();
        (stand.cost - here.foretold(self.likelihood, &within)).max(0.0)
    }
}
