//! What these rows can and cannot tell apart (`diagnosis/3.6`).

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::calculator::{Failure, Treatment};
use crate::diagnosis::causes::subject::{Setting, Subject};
use crate::diagnosis::statistics::whiten::{White, Whitener};
use crate::diagnosis::verdict::weigh::Weighing;

/// Cosine from which on two signatures are one for every size.
const SAME: f64 = 0.9995;
/// Separation below which two causes cannot be told apart here, sigmas.
pub const CONFOUNDED_BELOW: f64 = 3.0;
/// Collinearity index beyond which causes cannot be fitted together (Brun and Reichert).
pub const COLLINEAR_ABOVE: f64 = 20.0;

/// Two causes at their fitted sizes.
#[derive(Debug, Clone, PartialEq)]
pub struct Separation {
    /// A set of hypotheses.
    pub a: Vec<usize>,
    /// Another.
    pub b: Vec<usize>,
    /// The smaller of both directions, sigmas; the Bayes factor to be expected is about exp(d^2/2).
    pub sigmas: f64,
}

/// Pairs of hypotheses with the same signature whatever their size: no data of this experiment tell them apart.
pub fn twins(weighing: &Weighing<'_>) -> Vec<(usize, usize)> {
    let visible = &weighing.linear.visible;
    let mut found = Vec::new();
    for (i, &a) in visible.iter().enumerate() {
        for &b in &visible[i + 1..] {
            if weighing.linear.alike(a, b).is_some_and(|cosine| cosine.abs() > SAME) {
                found.push((a, b));
            }
        }
    }
    found
}

/// A set at its fit: its signature and the directions in which its own parameters move it.
pub struct Signature {
    /// Hypotheses.
    pub members: Vec<usize>,
    /// What it changes in the prediction of every row, in the unit of the rows; 0 where that is not known.
    pub change: Vec<f64>,
    whole: White,
    directions: Vec<White>,
}

impl Signature {
    /// Of the fitted settings of a set.
    pub fn of(weighing: &Weighing<'_>, members: &[usize], settings: &[Setting]) -> Result<Self, Failure> {
        let with = weighing.foundation.subject.predict(settings)?;
        let change: Vec<f64> = with
            .iter()
            .zip(&weighing.foundation.base)
            .map(|(with, base)| with.map_or(0.0, |with| with - base))
            .collect();
        let directions = weighing.fit(members).map_or_else(Vec::new, |fit| weighing.directions(fit));
        Ok(Self { members: members.to_vec(), whole: weighing.whitener.white(&change), change, directions })
    }

    /// Of no effect at all, beside another.
    pub(in crate::diagnosis) fn nothing(beside: &Self) -> Self {
        let change = vec![0.0; beside.change.len()];
        Self { members: Vec::new(), change, whole: beside.whole.minus(&beside.whole), directions: Vec::new() }
    }

    /// Of settings under other rows than those that were weighed.
    pub(in crate::diagnosis) fn anew(
        subject: &dyn Subject,
        whitener: &Whitener,
        keep: &[bool],
        settings: &[Setting],
    ) -> Result<Self, Failure> {
        let (base, with) = (subject.predict(&[])?, subject.predict(settings)?);
        let change: Vec<f64> = with
            .iter()
            .zip(&base)
            .zip(keep)
            .map(|((with, base), keep)| match (with, base) {
                (Ok(with), Ok(base)) if *keep => with - base,
                _ => 0.0,
            })
            .collect();
        let mut of = Vec::new();
        for (member, setting) in settings.iter().enumerate() {
            let variables = &subject.hypotheses()[setting.hypothesis].variables;
            of.extend(
                (0..variables.len())
                    .filter(|&v| matches!(variables[v].treatment, Treatment::Amplitude { .. }))
                    .map(|v| (member, v)),
            );
        }
        let directions = subject.jacobian(settings, &of)?.iter().map(|column| whitener.white(column)).collect();
        let members = settings.iter().map(|setting| setting.hypothesis).collect();
        Ok(Self { members, whole: whitener.white(&change), change, directions })
    }

    /// Length in sigmas: how visible it is against nothing.
    pub fn detectability(&self) -> f64 {
        self.whole.inner(&self.whole).max(0.0).sqrt()
    }

    /// min over the other's parameters of the distance between both, sigmas, in the smaller direction.
    pub fn separation(&self, other: &Self) -> f64 {
        let gap = self.whole.minus(&other.whole);
        let by = |signature: &Self| distance(&gap, &signature.directions.iter().collect::<Vec<_>>());
        by(other).min(by(self))
    }

    /// 1/sqrt of the smallest eigenvalue of the Gram matrix of the unit directions.
    pub fn collinearity(&self) -> Option<f64> {
        let count = self.directions.len();
        if count < 2 {
            return None;
        }
        let length: Vec<f64> = self.directions.iter().map(|d| d.inner(d).sqrt()).collect();
        if length.iter().any(|length| *length <= 0.0) {
            return None;
        }
        let unit = |i: usize, j: usize| self.directions[i].inner(&self.directions[j]) / (length[i] * length[j]);
        let least = DMatrix::from_fn(count, count, unit).symmetric_eigenvalues().min();
        Some(1.0 / least.max(1e-12).sqrt())
    }
}

/// How far a change of the rows stands from what causes of other kinds could make of it, each alone: the least distance over
/// their sizes and the points of their grids, sigmas. Its own length where there are none.
pub(in crate::diagnosis) fn from_others(weighing: &Weighing<'_>, change: &[f64], kind: &str) -> f64 {
    let (linear, whole) = (&weighing.linear, weighing.whitener.white(change));
    let of_others = linear.visible.iter().copied().filter(|&h| linear.hypotheses[h].cause.kind != kind);
    let gaps = of_others.flat_map(|h| linear.variants(h)).map(|variant| {
        let gap = variant.offset.map_or_else(|| whole.clone(), |offset| whole.minus(&linear.white[offset]));
        let directions: Vec<&White> = variant.free.iter().map(|free| &linear.white[free.column]).collect();
        distance(&gap, &directions)
    });
    gaps.fold(distance(&whole, &[]), f64::min)
}

/// Length of what the directions cannot explain of a gap.
pub(in crate::diagnosis) fn distance(gap: &White, directions: &[&White]) -> f64 {
    let whole = gap.inner(gap);
    let count = directions.len();
    if count == 0 {
        return whole.max(0.0).sqrt();
    }
    let gram = DMatrix::from_fn(count, count, |i, j| {
        let ridge = if i == j { 1e-10 * directions[i].inner(directions[i]) + f64::MIN_POSITIVE } else { 0.0 };
        directions[i].inner(directions[j]) + ridge
    });
    let right = DVector::from_iterator(count, directions.iter().map(|d| d.inner(gap)));
    let explained = Cholesky::new(gram).map_or(0.0, |factor| factor.solve(&right).dot(&right));
    (whole - explained).max(0.0).sqrt()
}

/// Separations between all leading sets, and of each from nothing.
pub fn separations(signatures: &[Signature]) -> Vec<Separation> {
    let mut found = Vec::new();
    for (i, a) in signatures.iter().enumerate() {
        for b in &signatures[i + 1..] {
            found.push(Separation { a: a.members.clone(), b: b.members.clone(), sigmas: a.separation(b) });
        }
    }
    found
}
