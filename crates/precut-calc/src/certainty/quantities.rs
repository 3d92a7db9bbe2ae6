//! The quantities of a job that are uncertain, and how they go together (`certainty/1.1`, `certainty/1.3`).

use crate::calculator::{Finding, Violations};

use super::{Contradiction, Distribution, Level, OpenEffects, Scores, Source, WidthUnit};

/// Codes of the faults found here.
pub(crate) const CODES: &[&str] =
    &["duplicate_quantity", "bad_correlation", "interval_correlated", "correlations_contradict"];

/// What may be uncertain in the jobs of a calculator.
pub(crate) trait Quantity: Copy + PartialEq {
    /// Its name, as in the contract.
    fn name(self) -> &'static str;
    /// In what its width is given.
    fn unit(self) -> WidthUnit;
}

/// A quantity with all that is known of it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Uncertain<Q> {
    pub quantity: Q,
    pub distribution: Distribution,
    pub level: Level,
    pub source: Source,
}

/// A quantity of which bounds alone are known, at a place between them (`certainty/1.2`).
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Within<Q> {
    pub of: Uncertain<Q>,
    /// From -1, the lower end, to 1.
    pub place: f64,
}

impl<Q: Copy> Within<Q> {
    fn value(&self) -> (Q, f64) {
        (self.of.quantity, self.of.distribution.at(self.place))
    }
}

/// How two quantities go together: which, and the correlation of their scores.
pub(crate) type Pair<'a, Q> = (&'a [Q], f64);

/// All quantities of a job that are uncertain, and how they go together: its own, then the modes of what is not known of its effects;
/// beside them those that are held at a place between bounds.
#[derive(Debug, Clone)]
pub(crate) struct Uncertainties<Q> {
    pub of: Vec<Uncertain<Q>>,
    pub scores: Scores,
    pub effects: OpenEffects,
    pub within: Vec<Within<Q>>,
}

/// What is told of a quantity, or of a mode of one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Told<'a> {
    pub name: &'a str,
    pub source: Source,
    pub level: Level,
}

impl<Q: Quantity> Uncertainties<Q> {
    /// Of quantities, each named once; pairs with one that is not among them say nothing.
    pub(crate) fn new<'a>(
        of: Vec<Uncertain<Q>>,
        pairs: impl IntoIterator<Item = Pair<'a, Q>>,
    ) -> Result<Self, Contradiction>
    where
        Q: 'a,
    {
        let (within, of): (Vec<_>, Vec<_>) = of.into_iter().partition(|one| one.distribution.is_interval());
        let within = within.into_iter().map(|of| Within { of, place: 0.0 }).collect();
        let place = |quantity| of.iter().position(|one: &Uncertain<Q>| one.quantity == quantity);
        let pairs: Vec<(usize, usize, f64)> = pairs
            .into_iter()
            .filter_map(|(between, coefficient)| match *between {
                [one, other] => Some((place(one)?, place(other)?, coefficient)),
                _ => None,
            })
            .collect();
        let scores = Scores::new(of.len(), &pairs)?;
        Ok(Self { of, scores, effects: OpenEffects::default(), within })
    }

    /// The same with what is not known of effects.
    pub(crate) fn beside(self, effects: OpenEffects) -> Self {
        Self { effects, ..self }
    }

    /// The same with the quantities of which bounds alone are known at these places, each between -1 and 1.
    pub(crate) fn held(&self, places: &[f64]) -> Self {
        let mut held = self.clone();
        held.within.iter_mut().zip(places).for_each(|(one, place)| one.place = *place);
        held
    }

    /// Where those are held.
    pub(crate) fn places(&self) -> Vec<f64> {
        self.within.iter().map(|one| one.place).collect()
    }

    /// Whether all is known.
    pub(crate) fn is_empty(&self) -> bool {
        self.count() == 0 && self.within.is_empty()
    }

    /// The value of every quantity of the job: `values` of those with a distribution, then those that are held between bounds.
    pub(crate) fn drawn(&self, values: &[f64]) -> impl Iterator<Item = (Q, f64)> {
        let own = self.of.iter().zip(values).map(|(one, value)| (one.quantity, *value));
        own.chain(self.within.iter().map(Within::value))
    }

    /// Quantities with a distribution, each mode of what is not known of effects counted.
    pub(crate) fn count(&self) -> usize {
        self.of.len() + self.effects.count()
    }

    /// Independent scores behind them.
    pub(crate) fn dimensions(&self) -> usize {
        self.of.len() + self.effects.dimensions()
    }

    /// Whether no quantity tells of another; then each has the score of its own place.
    pub(crate) fn is_independent(&self) -> bool {
        self.scores.is_independent() && self.effects.is_independent()
    }

    /// Among what an independent score varies.
    pub(crate) fn level(&self, score: usize) -> Level {
        self.of.get(score).map_or(Level::Setup, |one| one.level)
    }

    /// What is told of the quantity in a place.
    pub(crate) fn told(&self, place: usize) -> Told<'_> {
        match self.of.get(place) {
            Some(one) => Told { name: one.quantity.name(), source: one.source, level: one.level },
            None => Told { name: self.effects.name(place - self.of.len()), source: Source::Model, level: Level::Setup },
        }
    }

    /// The names of all quantities, each with its places.
    pub(crate) fn named(&self) -> Vec<(Told<'_>, Vec<usize>)> {
        let mut named: Vec<(Told<'_>, Vec<usize>)> = Vec::new();
        for (place, told) in (0..self.count()).map(|place| (place, self.told(place))) {
            match named.iter_mut().find(|(own, _)| own.name == told.name) {
                Some((_, places)) => places.push(place),
                None => named.push((told, vec![place])),
            }
        }
        named
    }

    /// What every quantity comes to at independent scores: factors, and additions in their unit.
    pub(crate) fn values(&self, independent: &[f64]) -> Vec<f64> {
        let (own, of_effects) = independent.split_at(self.of.len());
        let own = self.of.iter().zip(self.scores.of(own)).map(|(one, score)| one.distribution.at(score));
        own.chain(self.effects.values(of_effects)).collect()
    }

    /// Of all values those of what is not known of effects.
    pub(crate) fn of_effects<'v>(&self, values: &'v [f64]) -> &'v [f64] {
        values.get(self.of.len()..).unwrap_or_default()
    }

    /// Of every quantity what it comes to at its median, and half of what lies between scores of -1 and 1.
    pub(crate) fn scales(&self) -> Vec<(f64, f64)> {
        let of = |one: &Uncertain<Q>| {
            let at = |score: f64| one.distribution.at(score);
            (at(0.0), 0.5 * (at(1.0) - at(-1.0)))
        };
        self.of.iter().map(of).chain(std::iter::repeat_n((0.0, 1.0), self.effects.count())).collect()
    }

    /// The same with half of the width of one of them.
    pub(crate) fn halved(&self, index: usize) -> Self {
        let mut halved = self.clone();
        match halved.of.get_mut(index) {
            Some(own) => own.distribution = own.distribution.halved(),
            None => halved.effects.halve(index - self.of.len()),
        }
        halved
    }
}

/// Finds what cannot be in the quantities of the block `uncertainty`: each with its distribution.
pub(crate) fn check_quantities<Q: Quantity>(stated: &[(Q, &Distribution)], violations: &mut Violations) {
    for (i, (quantity, distribution)) in stated.iter().enumerate() {
        let at = |field: &str| format!("/uncertainty/quantities/{i}{field}");
        distribution.check(quantity.unit(), &at("/distribution"), violations);
        violations.require(stated[..i].iter().all(|before| before.0 != *quantity), || {
            Finding::new("duplicate_quantity", at("/quantity")).with("quantity", quantity.name())
        });
    }
}

/// Finds quantities that are stated although what is not known of the effects brings them.
pub(crate) fn check_brought<Q: Quantity>(
    stated: impl IntoIterator<Item = Q>,
    is_brought: impl Fn(Q) -> bool,
    violations: &mut Violations,
) {
    for (i, quantity) in stated.into_iter().enumerate() {
        violations.require(!is_brought(quantity), || {
            Finding::new("duplicate_quantity", format!("/uncertainty/quantities/{i}/quantity"))
                .with("quantity", quantity.name())
                .with("brought_by", "model")
        });
    }
}

/// Code of a quantity that is uncertain in a job that has none of it.
pub(crate) const MISSING_CODES: &[&str] = &["quantity_of_nothing"];

/// Finds quantities that a job has not; `missing_in` is the field without which there is none, where it is not there.
pub(crate) fn check_presence<Q: Quantity>(
    stated: impl IntoIterator<Item = Q>,
    missing_in: impl Fn(Q) -> Option<&'static str>,
    violations: &mut Violations,
) {
    for (i, quantity) in stated.into_iter().enumerate() {
        if let Some(field) = missing_in(quantity) {
            violations.add(
                Finding::new("quantity_of_nothing", format!("/uncertainty/quantities/{i}/quantity"))
                    .with("quantity", quantity.name())
                    .with("field", field),
            );
        }
    }
}

/// Finds what cannot be in its correlations; `contradiction` is what [`Uncertainties::new`] says of them.
pub(crate) fn check_correlations<Q: Quantity>(
    pairs: &[Pair<'_, Q>],
    stated: &[(Q, &Distribution)],
    contradiction: impl FnOnce() -> Option<Contradiction>,
    violations: &mut Violations,
) {
    let mut are_pairs = true;
    for (i, (between, _)) in pairs.iter().enumerate() {
        let [one, other] = **between else { continue };
        let same = |before: &Pair<'_, Q>| *before.0 == [one, other] || *before.0 == [other, one];
        let is_pair = one != other && !pairs[..i].iter().any(same);
        are_pairs &= is_pair;
        violations.require(is_pair, || {
            Finding::new("bad_correlation", format!("/uncertainty/correlations/{i}/between"))
                .with("one", one.name())
                .with("other", other.name())
        });
        let is_interval = |quantity: &Q| stated.iter().any(|(own, is)| own == quantity && is.is_interval());
        if let Some(interval) = [one, other].into_iter().find(is_interval) {
            are_pairs = false;
            violations.add(
                Finding::new("interval_correlated", format!("/uncertainty/correlations/{i}/between"))
                    .with("quantity", interval.name()),
            );
        }
    }
    if are_pairs && let Some(Contradiction { largest_factor }) = contradiction() {
        violations.add(
            Finding::new("correlations_contradict", "/uncertainty/correlations").with("largest_factor", largest_factor),
        );
    }
}
