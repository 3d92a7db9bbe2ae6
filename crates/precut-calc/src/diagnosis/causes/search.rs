//! Which sets of causes explain the rows, all from one matrix of inner products (`diagnosis/3.4`).

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{DMatrix, DVector};

use crate::calculator::{Failure, Hypothesis, Monitor, Treatment, Variable, checkpoint};
use crate::diagnosis::causes::optima::Peak;
use crate::diagnosis::causes::refine::{Fit, Start};
use crate::diagnosis::causes::signatures::{Signatures, Variant};
use crate::diagnosis::causes::subject::Setting;
use crate::diagnosis::statistics::evidence::{Evidence, Normal, Side, log_sum_exp};
use crate::diagnosis::statistics::likelihood::Likelihood;
use crate::diagnosis::statistics::whiten::White;

/// A signature shorter than this, whitened and at one prior standard deviation, cannot be seen.
const VISIBLE: f64 = 0.05;
/// Variants of a hypothesis that are tried beside another, where every evidence takes Newton's method.
const NARROWED: usize = 3;
/// Prior weights of none, one, two, three causes together.
const PRIOR: [f64; 4] = [0.5, 0.38, 0.10, 0.02];

/// All inner products that the sets are made of.
pub(in crate::diagnosis) struct Linear<'a> {
    pub(in crate::diagnosis) hypotheses: &'a [Hypothesis],
    signatures: &'a Signatures,
    pub(in crate::diagnosis) white: Vec<White>,
    pub(in crate::diagnosis) residual: White,
    gram: DMatrix<f64>,
    right: DVector<f64>,
    square: f64,
    pub(in crate::diagnosis) likelihood: Likelihood,
    /// Hypotheses that these rows can see.
    pub(in crate::diagnosis) visible: Vec<usize>,
    /// Of classes, whose evidence takes Newton's method: the variants of every hypothesis that explain most alone.
    narrowed: Vec<Vec<usize>>,
}

/// A set of causes at one point of its grids.
#[derive(Debug, Clone)]
struct Found {
    /// Variant of every member.
    point: Vec<usize>,
    /// Logarithm of the evidence times the share of the set's weight that this point has.
    weighed: f64,
    evidence: Evidence,
}

/// A cause beside another that was refined.
pub(in crate::diagnosis) struct Beside {
    /// By how much it raises the logarithm of the evidence; a mean over its grid.
    pub(in crate::diagnosis) gain: f64,
    /// Where both together begin to be refined.
    pub(in crate::diagnosis) start: Start,
}

/// A set of causes and how well it explains the rows.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::diagnosis) struct Candidate {
    /// Hypotheses, ascending.
    pub(in crate::diagnosis) members: Vec<usize>,
    /// Evidence, averaged over the grids.
    pub(in crate::diagnosis) log_z: f64,
    /// Evidence at the best point of the grids.
    pub(in crate::diagnosis) best_log_z: f64,
    pub(in crate::diagnosis) log_prior: f64,
    /// The best point of the grids: variant of every member.
    pub(in crate::diagnosis) variants: Vec<usize>,
    /// The fit there, in units of the priors.
    pub(in crate::diagnosis) t: Vec<f64>,
    /// Root mean square distance of every variable of every member from its value there, over the posterior
    /// of the whole grid: what a standard deviation at one point of the grid leaves out. In the units of the
    /// variables; empty where there is no grid.
    pub(in crate::diagnosis) spread: Vec<Vec<f64>>,
}

impl Candidate {
    pub(in crate::diagnosis) fn log_weight(&self) -> f64 {
        self.log_z + self.log_prior
    }
}

impl<'a> Linear<'a> {
    pub(in crate::diagnosis) fn new(
        hypotheses: &'a [Hypothesis],
        signatures: &'a Signatures,
        likelihood: Likelihood,
        residual: &[f64],
    ) -> Self {
        let white: Vec<White> = signatures.columns.iter().map(|column| likelihood.white(column)).collect();
        let residual = likelihood.white(residual);
        // Of classes as if every row stood on the boundary, where it says most.
        let Normal { gram, right, square } = Normal::of(&white.iter().collect::<Vec<_>>(), &residual);
        let seen = |h: &usize| {
            signatures.variants[*h].iter().any(|variant| {
                let mut columns = variant.free.iter().map(|free| free.column).chain(variant.offset);
                columns.any(|column| gram[(column, column)] > VISIBLE * VISIBLE)
            })
        };
        let visible = (0..hypotheses.len()).filter(seen).collect();
        let narrowed = Vec::new();
        let mut linear =
            Self { hypotheses, signatures, white, residual, gram, right, square, likelihood, visible, narrowed };
        if matches!(linear.likelihood, Likelihood::Classes(_)) {
            linear.narrowed = (0..hypotheses.len()).map(|h| linear.most_telling(h)).collect();
        }
        linear
    }

    /// The variants of a hypothesis that explain most alone, ascending; at most [`NARROWED`].
    fn most_telling(&self, hypothesis: usize) -> Vec<usize> {
        let count = self.signatures.variants[hypothesis].len();
        let alone = |v: usize| self.evidence(&[hypothesis], &[v]).map_or(f64::NEG_INFINITY, |found| found.log_z);
        let mut ranked: Vec<(f64, usize)> = (0..count).map(|v| (alone(v), v)).collect();
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut kept: Vec<usize> = ranked.into_iter().take(NARROWED).map(|(_, v)| v).collect();
        kept.sort_unstable();
        kept
    }

    pub(in crate::diagnosis) fn variant(&self, hypothesis: usize, variant: usize) -> &Variant {
        &self.signatures.variants[hypothesis][variant]
    }

    pub(in crate::diagnosis) fn variants(&self, hypothesis: usize) -> &[Variant] {
        &self.signatures.variants[hypothesis]
    }

    /// Whether a hypothesis has a single form.
    pub(in crate::diagnosis) fn has_no_grid(&self, hypothesis: usize) -> bool {
        self.signatures.grid_points[hypothesis] == 1
    }

    /// Whether a shape of one of these hypotheses may leave its grid.
    pub(in crate::diagnosis) fn has_free_shapes(&self, members: &[usize]) -> bool {
        members
            .iter()
            .flat_map(|&h| &self.hypotheses[h].variables)
            .any(|variable| matches!(variable.treatment, Treatment::Shape { prior: Some(_), .. }))
    }

    /// Cosine of the angle between the signatures of two hypotheses with one amplitude and no grid.
    pub(in crate::diagnosis) fn alike(&self, a: usize, b: usize) -> Option<f64> {
        let column = |h: usize| match self.signatures.variants[h][0].free.as_slice() {
            [only] if self.has_no_grid(h) => Some(only.column),
            _ => None,
        };
        let (a, b) = (column(a)?, column(b)?);
        Some(self.gram[(a, b)] / (self.gram[(a, a)] * self.gram[(b, b)]).sqrt())
    }

    /// Columns, sides and the residual of a set at a point of its grids.
    pub(in crate::diagnosis) fn parts(&self, members: &[usize], variants: &[usize]) -> (Vec<&White>, Vec<Side>, White) {
        let mut residual = self.residual.clone();
        let (mut columns, mut sides) = (Vec::new(), Vec::new());
        for (&h, &v) in members.iter().zip(variants) {
            let variant = self.variant(h, v);
            for free in &variant.free {
                columns.push(&self.white[free.column]);
                sides.push(free.side);
            }
            if let Some(offset) = variant.offset {
                residual = residual.minus(&self.white[offset]);
            }
        }
        (columns, sides, residual)
    }

    fn evidence(&self, members: &[usize], variants: &[usize]) -> Option<Evidence> {
        let Likelihood::Gaussian { whitener, scale } = &self.likelihood else {
            let (columns, sides, residual) = self.parts(members, variants);
            return self.likelihood.evidence(&columns, &residual, &sides);
        };
        let (mut columns, mut sides, mut offsets) = (Vec::new(), Vec::new(), Vec::new());
        for (&h, &v) in members.iter().zip(variants) {
            let variant = self.variant(h, v);
            columns.extend(variant.free.iter().map(|free| free.column));
            sides.extend(variant.free.iter().map(|free| free.side));
            offsets.extend(variant.offset);
        }
        let count = columns.len();
        let gram = DMatrix::from_fn(count, count, |i, j| self.gram[(columns[i], columns[j])]);
        let shifted =
            |i: usize| self.right[columns[i]] - offsets.iter().map(|&o| self.gram[(columns[i], o)]).sum::<f64>();
        let right = DVector::from_fn(count, |i, _| shifted(i));
        let mut square = self.square;
        for &o in &offsets {
            square -= 2.0 * self.right[o];
            square += offsets.iter().map(|&p| self.gram[(o, p)]).sum::<f64>();
        }
        Normal { gram, right, square }.evidence(&sides, *scale, whitener.rows())
    }

    /// What a hypothesis explains beside a cause that was refined: linearised where it is linearised, that one about its fit.
    pub(in crate::diagnosis) fn beside(&self, fit: &Fit, hypothesis: usize) -> Option<Beside> {
        let evidence = |v: Option<usize>| {
            let variant = v.map(|v| self.variant(hypothesis, v));
            let own = variant.into_iter().flat_map(|variant| &variant.free);
            let columns: Vec<&White> =
                fit.columns.iter().chain(own.clone().map(|free| &self.white[free.column])).collect();
            let sides: Vec<Side> = fit.sides.iter().copied().chain(own.map(|free| free.side)).collect();
            let offset = variant.and_then(|variant| variant.offset);
            let shifted = offset.map(|offset| fit.residual.minus(&self.white[offset]));
            self.likelihood.evidence(&columns, shifted.as_ref().unwrap_or(&fit.residual), &sides)
        };
        let alone = evidence(None)?;
        let weighed = |v: usize| {
            let with = evidence(Some(v))?;
            Some((with.log_z + self.log_share(hypothesis, v), v, with.t))
        };
        // A point of the grid may be linearised about several places: the one that explains most counts.
        let mut of_cells: BTreeMap<usize, (f64, usize, Vec<f64>)> = BTreeMap::new();
        for tried in (0..self.variants(hypothesis).len()).filter_map(weighed) {
            let cell = of_cells.entry(self.cell(&[hypothesis], &[tried.1])).or_insert_with(|| tried.clone());
            if tried.0 > cell.0 {
                *cell = tried;
            }
        }
        let gain = log_sum_exp(&of_cells.values().map(|tried| tried.0).collect::<Vec<_>>()) - alone.log_z;
        let (_, v, t) = of_cells.into_values().max_by(|a, b| a.0.total_cmp(&b.0))?;
        let (of_fit, own) = t.split_at_checked(fit.free.len())?;
        let (members, variants) = ([hypothesis], [v]);
        let about = self.variant(hypothesis, v).setting.clone();
        let mut start = Start { settings: fit.moved(of_fit, self.hypotheses), about: fit.settings.clone() };
        start.settings.extend(self.within_bounds(&members, &variants, self.values(&members, &variants, own)));
        start.about.push(about);
        start.settings.sort_by_key(|setting| setting.hypothesis);
        start.about.sort_by_key(|setting| setting.hypothesis);
        Some(Beside { gain, start })
    }

    /// A set of causes: mean evidence over the product of the grids, and the best point.
    pub(in crate::diagnosis) fn candidate(&self, members: Vec<usize>, log_prior: f64) -> Option<Candidate> {
        let mut found = self.found(&members);
        let all: Vec<f64> = found.iter().map(|found| found.weighed).collect();
        let best = (0..found.len()).rev().max_by(|&a, &b| all[a].total_cmp(&all[b]))?;
        let spread = if self.has_cells(&members) { self.spread(&members, &found, best) } else { Vec::new() };
        let Found { point, evidence, .. } = found.swap_remove(best);
        Some(Candidate {
            members,
            log_z: log_sum_exp(&all),
            best_log_z: evidence.log_z,
            log_prior,
            variants: point,
            t: evidence.t,
            spread,
        })
    }

    /// Whether a grid of these hypotheses has more than one point, or stands beside a place off it.
    fn has_cells(&self, members: &[usize]) -> bool {
        members.iter().any(|&h| self.signatures.grid_points[h] > 1 || self.signatures.is_off_grid[h])
    }

    /// A set of causes at every point of the product of its grids. Of several places about which one point is linearised
    /// that counts which explains most; a cause that was found off its grid has half of its weight there. A point that has
    /// no evidence, and one that is not tried, adds nothing to the mean over all of them.
    fn found(&self, members: &[usize]) -> Vec<Found> {
        let cells: usize = members.iter().map(|&h| self.signatures.grid_points[h] + 1).product();
        let mut found: Vec<Option<Found>> = vec![None; cells];
        for point in self.points(members) {
            let Some(evidence) = self.evidence(members, &point) else { continue };
            let weighed = evidence.log_z + members.iter().zip(&point).map(|(&h, &v)| self.log_share(h, v)).sum::<f64>();
            let cell = &mut found[self.cell(members, &point)];
            if cell.as_ref().is_none_or(|known| weighed > known.weighed) {
                *cell = Some(Found { point, weighed, evidence });
            }
        }
        found.into_iter().flatten().collect()
    }

    /// What every variable of every member may be, point by point of the product of the grids: a shape anywhere in its cell.
    /// `None` where there are no grids. The best point comes first.
    pub(in crate::diagnosis) fn peaks(&self, candidate: &Candidate) -> Option<Vec<Vec<Vec<Peak>>>> {
        let members = &candidate.members;
        if !self.has_cells(members) {
            return None;
        }
        let mut found = self.found(members);
        found.sort_by_key(|found| found.point != candidate.variants);
        let total = log_sum_exp(&found.iter().map(|found| found.weighed).collect::<Vec<_>>());
        let mut peaks: Vec<Vec<Vec<Peak>>> =
            members.iter().map(|&h| vec![Vec::new(); self.hypotheses[h].variables.len()]).collect();
        for here in &found {
            let weight = (here.weighed - total).exp();
            let values = self.values(members, &here.point, &here.evidence.t);
            let variances = self.variances(members, here, &values);
            for (member, own) in peaks.iter_mut().enumerate() {
                for (variable, peaks) in own.iter_mut().enumerate() {
                    let standard_deviation = variances[member][variable].sqrt();
                    peaks.push(Peak { value: values[member][variable], standard_deviation, weight });
                }
            }
        }
        Some(peaks)
    }

    /// The product of the variants of these hypotheses, as far as they are tried together.
    fn points(&self, members: &[usize]) -> Vec<Vec<usize>> {
        members.iter().fold(vec![Vec::new()], |points, &h| {
            let tried = self.narrowed.get(h).filter(|_| members.len() > 1).cloned();
            let tried = tried.unwrap_or_else(|| (0..self.signatures.variants[h].len()).collect());
            points
                .into_iter()
                .flat_map(|p| tried.iter().map(move |&v| [p.as_slice(), &[v]].concat()).collect::<Vec<_>>())
                .collect()
        })
    }

    /// The settings that a set has about each of its places, and the evidence there, largest first.
    pub(in crate::diagnosis) fn starts(&self, members: &[usize]) -> Vec<(Start, f64)> {
        let of = |point: Vec<usize>| {
            let evidence = self.evidence(members, &point)?;
            Some((self.start(members, &point, &evidence.t), evidence.log_z))
        };
        let mut starts: Vec<_> = self.points(members).into_iter().filter_map(of).collect();
        starts.sort_by(|a, b| b.1.total_cmp(&a.1));
        starts
    }

    /// Number of a point in the product of the grids; off a grid comes after all of its points.
    fn cell(&self, members: &[usize], point: &[usize]) -> usize {
        members.iter().zip(point).fold(0, |cell, (&h, &v)| {
            let count = self.signatures.grid_points[h];
            cell * (count + 1) + self.variant(h, v).grid_point.unwrap_or(count)
        })
    }

    /// Logarithm of the share of a hypothesis' weight that its cell has.
    fn log_share(&self, hypothesis: usize, variant: usize) -> f64 {
        let halved = if self.signatures.is_off_grid[hypothesis] { 0.5 } else { 1.0 };
        let points =
            self.variant(hypothesis, variant).grid_point.map_or(1, |_| self.signatures.grid_points[hypothesis]);
        (halved / points as f64).ln()
    }

    /// Whether a member stands off its grid at the best point: its shapes are free there.
    pub(in crate::diagnosis) fn is_off_grid(&self, candidate: &Candidate) -> bool {
        candidate.members.iter().zip(&candidate.variants).any(|(&h, &v)| self.variant(h, v).grid_point.is_none())
    }

    fn spread(&self, members: &[usize], found: &[Found], best: usize) -> Vec<Vec<f64>> {
        let total = log_sum_exp(&found.iter().map(|found| found.weighed).collect::<Vec<_>>());
        let mut squares: Vec<Vec<f64>> =
            members.iter().map(|&h| vec![0.0; self.hypotheses[h].variables.len()]).collect();
        let of_best = self.values(members, &found[best].point, &found[best].evidence.t);
        for here in found {
            let weight = (here.weighed - total).exp();
            let values = self.values(members, &here.point, &here.evidence.t);
            let variances = self.variances(members, here, &values);
            for (member, squares) in squares.iter_mut().enumerate() {
                for (variable, square) in squares.iter_mut().enumerate() {
                    let away = values[member][variable] - of_best[member][variable];
                    *square += weight * (away * away + variances[member][variable]);
                }
            }
        }
        squares.into_iter().map(|member| member.into_iter().map(f64::sqrt).collect()).collect()
    }

    /// Variance of every variable of every member at a point of the grids: of a shape that of a value anywhere in its cell.
    fn variances(&self, members: &[usize], here: &Found, values: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let mut column = 0;
        let of_member = |(member, &h): (usize, &usize)| {
            let of_cell = |(variable, value): (&Variable, &f64)| cell_width(variable, *value).powi(2) / 12.0;
            let mut own: Vec<f64> = self.hypotheses[h].variables.iter().zip(&values[member]).map(of_cell).collect();
            for free in &self.variant(h, here.point[member]).free {
                let slope = free.coordinate.slope(values[member][free.variable]);
                own[free.variable] = here.evidence.covariance[(column, column)] * slope * slope;
                column += 1;
            }
            own
        };
        members.iter().enumerate().map(of_member).collect()
    }

    /// Values of every member at a point of the grids and these coordinates.
    fn values(&self, members: &[usize], point: &[usize], t: &[f64]) -> Vec<Vec<f64>> {
        let mut t = t.iter();
        let of_member = |(&h, &v): (&usize, &usize)| {
            let variant = self.variant(h, v);
            let mut values = variant.setting.values.clone();
            for free in &variant.free {
                values[free.variable] = free.coordinate.value(t.next().copied().unwrap_or(0.0));
            }
            values
        };
        members.iter().zip(point).map(of_member).collect()
    }

    fn log_prior(&self, members: &[usize]) -> f64 {
        let count = self.visible.len() as f64;
        let ways = match members.len() {
            0 => 1.0,
            1 => count,
            2 => count * (count - 1.0) / 2.0,
            _ => count * (count - 1.0) * (count - 2.0) / 6.0,
        };
        let own: f64 = members.iter().map(|&h| self.hypotheses[h].prior_weight.ln()).sum();
        (PRIOR[members.len().min(3)] / ways).ln() + own
    }

    /// The empty set, all singles, pairs with a leading single in them, and leading pairs with a third.
    pub(in crate::diagnosis) fn search(
        &self,
        most_causes: usize,
        [leading_singles, leading_pairs]: [usize; 2],
        monitor: &dyn Monitor,
    ) -> Result<Vec<Candidate>, Failure> {
        let set = |members: Vec<usize>| {
            let log_prior = self.log_prior(&members);
            self.candidate(members, log_prior)
        };
        let mut found: Vec<Candidate> = set(Vec::new()).into_iter().collect();
        let mut singles: Vec<Candidate> = Vec::new();
        if most_causes >= 1 {
            singles = self.visible.iter().filter_map(|&h| set(vec![h])).collect();
            by_weight(&mut singles);
        }
        let mut pairs = Vec::new();
        if most_causes >= 2 {
            for (rank, single) in singles.iter().take(leading_singles).enumerate() {
                checkpoint(monitor)?;
                let leaders: Vec<usize> = singles[..rank].iter().map(|s| s.members[0]).collect();
                let first = single.members[0];
                let partners = self.visible.iter().filter(|h| **h != first && !leaders.contains(h));
                pairs.extend(partners.filter_map(|&h| set(vec![first.min(h), first.max(h)])));
            }
            by_weight(&mut pairs);
        }
        let mut triples: Vec<Candidate> = Vec::new();
        let mut known: BTreeSet<Vec<usize>> = BTreeSet::new();
        if most_causes >= 3 {
            for pair in pairs.iter().take(leading_pairs) {
                checkpoint(monitor)?;
                for &third in self.visible.iter().filter(|h| !pair.members.contains(h)) {
                    let mut members = [pair.members.as_slice(), &[third]].concat();
                    members.sort_unstable();
                    if known.insert(members.clone()) {
                        triples.extend(set(members));
                    }
                }
            }
        }
        found.extend(singles);
        found.extend(pairs);
        found.extend(triples);
        by_weight(&mut found);
        Ok(found)
    }

    /// Full settings of a candidate at the best point of its grids.
    pub(in crate::diagnosis) fn settings(&self, candidate: &Candidate) -> Vec<Setting> {
        let Candidate { members, variants, t, .. } = candidate;
        self.within_bounds(members, variants, self.values(members, variants, t))
    }

    /// Where the refinement of a candidate begins.
    pub(in crate::diagnosis) fn start_of(&self, candidate: &Candidate) -> Start {
        self.start(&candidate.members, &candidate.variants, &candidate.t)
    }

    fn start(&self, members: &[usize], variants: &[usize], t: &[f64]) -> Start {
        let about = members.iter().zip(variants).map(|(&h, &v)| self.variant(h, v).setting.clone()).collect();
        Start { settings: self.within_bounds(members, variants, self.values(members, variants, t)), about }
    }

    fn within_bounds(&self, members: &[usize], variants: &[usize], values: Vec<Vec<f64>>) -> Vec<Setting> {
        let of_member = |((&hypothesis, &variant), mut values): ((&usize, &usize), Vec<f64>)| {
            for free in &self.variant(hypothesis, variant).free {
                let range = self.hypotheses[hypothesis].variables[free.variable].range;
                values[free.variable] = range.clamp(values[free.variable]);
            }
            Setting { hypothesis, values }
        };
        members.iter().zip(variants).zip(values).map(of_member).collect()
    }
}

/// Width of the cell about a point of a shape's grid: half way to its neighbours, and as far beyond the ends.
fn cell_width(variable: &Variable, value: f64) -> f64 {
    let Treatment::Shape { grid, .. } = &variable.treatment else { return 0.0 };
    let nearest = |side: f64| {
        let gaps = grid.iter().map(|other| (other - value) * side).filter(|gap| *gap > 0.0);
        gaps.min_by(f64::total_cmp)
    };
    match (nearest(-1.0), nearest(1.0)) {
        (Some(below), Some(above)) => f64::midpoint(below, above),
        (Some(gap), None) | (None, Some(gap)) => gap,
        (None, None) => 0.0,
    }
}

/// Heaviest first; equal weights in the order of their members, so that the order never depends on the search.
pub(in crate::diagnosis) fn by_weight(candidates: &mut [Candidate]) {
    candidates.sort_by(|a, b| b.log_weight().total_cmp(&a.log_weight()).then_with(|| a.members.cmp(&b.members)));
}
