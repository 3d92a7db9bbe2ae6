//! Which sets of causes explain the rows, all from one matrix of inner products (`diagnosis/3.4`).

use nalgebra::{DMatrix, DVector};

use super::evidence::{Evidence, Normal, Side, log_sum_exp};
use super::likelihood::Likelihood;
use super::subject::{Setting, Subject};
use super::whiten::White;
use crate::calculator::{Failure, Hypothesis, Monitor, Treatment, checkpoint};

/// Singles that may have partners.
const LEADING_SINGLES: usize = 6;
/// Pairs that may have a third.
const LEADING_PAIRS: usize = 6;
/// A signature shorter than this, whitened and at one prior standard deviation, cannot be seen.
const VISIBLE: f64 = 0.05;
/// Variants of a hypothesis that are tried beside another, where every evidence takes Newton's method.
const NARROWED: usize = 3;
/// Prior weights of none, one, two, three causes together.
const PRIOR: [f64; 4] = [0.5, 0.38, 0.10, 0.02];

/// A hypothesis at one point of the grid of its shapes, linearised about one size.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Variant {
    /// Values with every amplitude at 0, or where it is linearised.
    pub(super) setting: Setting,
    /// Its amplitudes: index of the variable, prior standard deviation, side, column among all.
    pub(super) amplitudes: Vec<Amplitude>,
    /// Column of what it does without an amplitude of its own, or of what a straight line through the place of its
    /// linearisation does at 0.
    offset: Option<usize>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Amplitude {
    pub(super) variable: usize,
    pub(super) prior_sd: f64,
    pub(super) side: Side,
    column: usize,
}

/// Signatures of a hypothesis before they are whitened: what a fold can use again.
pub(super) struct Signatures {
    /// Variants of every hypothesis; the points of its grid first.
    variants: Vec<Vec<Variant>>,
    /// How many of them are points of its grid.
    grid_points: Vec<usize>,
    /// Columns at one prior standard deviation.
    columns: Vec<Vec<f64>>,
}

impl Signatures {
    /// One Jacobian column for every amplitude at every point of the grids.
    pub(super) fn of(subject: &dyn Subject, base: &[f64], monitor: &dyn Monitor) -> Result<Self, Failure> {
        let mut signatures = Self { variants: Vec::new(), grid_points: Vec::new(), columns: Vec::new() };
        for (index, hypothesis) in subject.hypotheses().iter().enumerate() {
            checkpoint(monitor)?;
            let mut variants = Vec::new();
            let grid = grid(hypothesis);
            let size = hypothesis.variables.iter().position(|v| matches!(v.treatment, Treatment::Amplitude { .. }));
            for values in &grid {
                let setting = Setting { hypothesis: index, values: values.clone() };
                variants.push(signatures.variant(subject, base, setting)?);
            }
            for (value, values) in subject.expansions(index).into_iter().flat_map(|v| grid.iter().map(move |g| (v, g)))
            {
                checkpoint(monitor)?;
                let Some(size) = size else { break };
                let mut values = values.clone();
                values[size] = value;
                variants.extend(signatures.expansion(subject, Setting { hypothesis: index, values })?);
            }
            signatures.variants.push(variants);
            signatures.grid_points.push(grid.len());
        }
        Ok(signatures)
    }

    /// Linearised about a size: f(theta) = f(0) + (f(theta_0) - f(0) - J theta_0) + J theta. `None` where the model has no
    /// value there.
    fn expansion(&mut self, subject: &dyn Subject, setting: Setting) -> Result<Option<Variant>, Failure> {
        let (without, with) =
            (subject.predict_coarsely(&[])?, subject.predict_coarsely(std::slice::from_ref(&setting))?);
        let change: Option<Vec<f64>> = with
            .iter()
            .zip(&without)
            .map(|(with, without)| match (with, without) {
                (Ok(with), Ok(without)) => Some(with - without),
                (Err(_), Ok(_)) => None,
                _ => Some(0.0),
            })
            .collect();
        let Some(mut offset) = change else { return Ok(None) };
        let values = setting.values.clone();
        let mut variant = self.variant(subject, &[], setting)?;
        for amplitude in &variant.amplitudes {
            let t = values[amplitude.variable] / amplitude.prior_sd;
            offset.iter_mut().zip(&self.columns[amplitude.column]).for_each(|(o, c)| *o -= c * t);
        }
        self.columns.push(offset);
        variant.offset = Some(self.columns.len() - 1);
        Ok(Some(variant))
    }

    fn variant(&mut self, subject: &dyn Subject, base: &[f64], setting: Setting) -> Result<Variant, Failure> {
        let hypothesis = &subject.hypotheses()[setting.hypothesis];
        let sizes: Vec<(usize, f64)> = hypothesis
            .variables
            .iter()
            .enumerate()
            .filter_map(|(variable, v)| match v.treatment {
                Treatment::Amplitude { prior_sd } => Some((variable, prior_sd)),
                _ => None,
            })
            .collect();
        let mut offset = None;
        if sizes.is_empty() {
            let with = subject.predict(std::slice::from_ref(&setting))?;
            self.columns.push(with.iter().zip(base).map(|(with, base)| with.map_or(0.0, |with| with - base)).collect());
            offset = Some(self.columns.len() - 1);
        }
        let of: Vec<(usize, usize)> = sizes.iter().map(|(variable, _)| (0, *variable)).collect();
        let slopes = subject.jacobian(std::slice::from_ref(&setting), &of)?;
        let mut amplitudes = Vec::new();
        for ((variable, prior_sd), slope) in sizes.into_iter().zip(slopes) {
            self.columns.push(slope.iter().map(|x| x * prior_sd).collect());
            let side = Side::of(hypothesis.variables[variable].range);
            amplitudes.push(Amplitude { variable, prior_sd, side, column: self.columns.len() - 1 });
        }
        Ok(Variant { setting, amplitudes, offset })
    }
}

/// Product grid of a hypothesis' shapes, amplitudes at 0.
fn grid(hypothesis: &Hypothesis) -> Vec<Vec<f64>> {
    hypothesis.variables.iter().fold(vec![Vec::new()], |points, variable| {
        let choices = match &variable.treatment {
            Treatment::Amplitude { .. } => vec![0.0],
            Treatment::Shape { grid, .. } => grid.clone(),
            Treatment::Stated { value } => vec![*value],
        };
        points
            .into_iter()
            .flat_map(|point| choices.iter().map(move |choice| [point.as_slice(), &[*choice]].concat()))
            .collect()
    })
}

/// All inner products that the sets are made of.
pub(super) struct Linear<'a> {
    pub(super) hypotheses: &'a [Hypothesis],
    signatures: &'a Signatures,
    pub(super) white: Vec<White>,
    pub(super) residual: White,
    gram: DMatrix<f64>,
    right: DVector<f64>,
    square: f64,
    pub(super) likelihood: Likelihood,
    /// Hypotheses that these rows can see.
    pub(super) visible: Vec<usize>,
    /// Of classes, whose evidence takes Newton's method: the variants of every hypothesis that explain most alone.
    narrowed: Vec<Vec<usize>>,
}

/// A set of causes and how well it explains the rows.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Candidate {
    /// Hypotheses, ascending.
    pub(super) members: Vec<usize>,
    /// Evidence, averaged over the grids.
    pub(super) log_z: f64,
    /// Evidence at the best point of the grids.
    pub(super) best_log_z: f64,
    pub(super) log_prior: f64,
    /// The best point of the grids: variant of every member.
    pub(super) variants: Vec<usize>,
    /// The fit there, in units of the priors.
    pub(super) t: Vec<f64>,
    /// Root mean square distance of every variable of every member from its value there, over the posterior
    /// of the whole grid: what a standard deviation at one point of the grid leaves out. In the units of the
    /// variables; empty where there is no grid.
    pub(super) spread: Vec<Vec<f64>>,
}

impl Candidate {
    pub(super) fn log_weight(&self) -> f64 {
        self.log_z + self.log_prior
    }
}

impl<'a> Linear<'a> {
    pub(super) fn new(
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
                let mut columns = variant.amplitudes.iter().map(|a| a.column).chain(variant.offset);
                columns.any(|column| gram[(column, column)] > VISIBLE * VISIBLE)
            })
        };
        let visible = (0..hypotheses.len()).filter(seen).collect();
        let narrowed = Vec::new();
        let mut linear =
            Self { hypotheses, signatures, white, residual, gram, right, square, likelihood, visible, narrowed };
        if matches!(linear.likelihood, Likelihood::Probit(_)) {
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

    pub(super) fn variant(&self, hypothesis: usize, variant: usize) -> &Variant {
        &self.signatures.variants[hypothesis][variant]
    }

    /// Whether a hypothesis has a single form.
    pub(super) fn has_no_grid(&self, hypothesis: usize) -> bool {
        self.signatures.grid_points[hypothesis] == 1
    }

    /// Whether a shape of one of these hypotheses may leave its grid.
    pub(super) fn has_free_shapes(&self, members: &[usize]) -> bool {
        members
            .iter()
            .flat_map(|&h| &self.hypotheses[h].variables)
            .any(|variable| matches!(variable.treatment, Treatment::Shape { prior: Some(_), .. }))
    }

    /// Cosine of the angle between the signatures of two hypotheses with one amplitude and no grid.
    pub(super) fn alike(&self, a: usize, b: usize) -> Option<f64> {
        let column = |h: usize| match self.signatures.variants[h][0].amplitudes.as_slice() {
            [amplitude] if self.has_no_grid(h) => Some(amplitude.column),
            _ => None,
        };
        let (a, b) = (column(a)?, column(b)?);
        Some(self.gram[(a, b)] / (self.gram[(a, a)] * self.gram[(b, b)]).sqrt())
    }

    /// Columns, sides and the residual of a set at a point of its grids.
    pub(super) fn parts(&self, members: &[usize], variants: &[usize]) -> (Vec<&White>, Vec<Side>, White) {
        let mut residual = self.residual.clone();
        let (mut columns, mut sides) = (Vec::new(), Vec::new());
        for (&h, &v) in members.iter().zip(variants) {
            let variant = self.variant(h, v);
            for amplitude in &variant.amplitudes {
                columns.push(&self.white[amplitude.column]);
                sides.push(amplitude.side);
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
            columns.extend(variant.amplitudes.iter().map(|a| a.column));
            sides.extend(variant.amplitudes.iter().map(|a| a.side));
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

    /// A set of causes: mean evidence over the product of the grids, and the best point.
    pub(super) fn candidate(&self, members: Vec<usize>, log_prior: f64) -> Option<Candidate> {
        let mut points: Vec<Vec<usize>> = vec![Vec::new()];
        let mut of_all = 1.0;
        for &h in &members {
            let count = self.signatures.variants[h].len();
            of_all *= count as f64;
            let tried = self.narrowed.get(h).filter(|_| members.len() > 1).cloned();
            let tried = tried.unwrap_or_else(|| (0..count).collect());
            points = points
                .into_iter()
                .flat_map(|p| tried.iter().map(move |&v| [p.as_slice(), &[v]].concat()).collect::<Vec<_>>())
                .collect();
        }
        let mut found = Vec::with_capacity(points.len());
        for point in points {
            let evidence = self.evidence(&members, &point)?;
            found.push((point, evidence));
        }
        let all: Vec<f64> = found.iter().map(|(_, evidence)| evidence.log_z).collect();
        let best = (0..found.len()).rev().max_by(|&a, &b| all[a].total_cmp(&all[b]))?;
        let spread = if found.len() > 1 { self.spread(&members, &found, best) } else { Vec::new() };
        let (variants, evidence) = found.swap_remove(best);
        Some(Candidate {
            members,
            // Points of the product that are not tried add nothing to speak of to the mean over all of it.
            log_z: log_sum_exp(&all) - of_all.ln(),
            best_log_z: evidence.log_z,
            log_prior,
            variants,
            t: evidence.t,
            spread,
        })
    }

    fn spread(&self, members: &[usize], found: &[(Vec<usize>, Evidence)], best: usize) -> Vec<Vec<f64>> {
        let total = log_sum_exp(&found.iter().map(|(_, evidence)| evidence.log_z).collect::<Vec<_>>());
        let mut squares: Vec<Vec<f64>> =
            members.iter().map(|&h| vec![0.0; self.hypotheses[h].variables.len()]).collect();
        for (point, evidence) in found {
            let weight = (evidence.log_z - total).exp();
            let mut column = 0;
            for (member, &h) in members.iter().enumerate() {
                let (here, there) = (self.variant(h, point[member]), self.variant(h, found[best].0[member]));
                let shapes = here.setting.values.iter().zip(&there.setting.values);
                for (square, (value, best)) in squares[member].iter_mut().zip(shapes) {
                    *square += weight * (value - best) * (value - best);
                }
                for amplitude in &here.amplitudes {
                    let gap = evidence.t[column] - found[best].1.t[column];
                    let square = evidence.covariance[(column, column)] + gap * gap;
                    squares[member][amplitude.variable] += weight * square * amplitude.prior_sd * amplitude.prior_sd;
                    column += 1;
                }
            }
        }
        squares.into_iter().map(|member| member.into_iter().map(f64::sqrt).collect()).collect()
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
    pub(super) fn search(&self, most_causes: usize, monitor: &dyn Monitor) -> Result<Vec<Candidate>, Failure> {
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
            for (rank, single) in singles.iter().take(LEADING_SINGLES).enumerate() {
                checkpoint(monitor)?;
                let leaders: Vec<usize> = singles[..rank].iter().map(|s| s.members[0]).collect();
                let first = single.members[0];
                let partners = self.visible.iter().filter(|h| **h != first && !leaders.contains(h));
                pairs.extend(partners.filter_map(|&h| set(vec![first.min(h), first.max(h)])));
            }
            by_weight(&mut pairs);
        }
        let mut triples: Vec<Candidate> = Vec::new();
        if most_causes >= 3 {
            for pair in pairs.iter().take(LEADING_PAIRS) {
                checkpoint(monitor)?;
                for &third in self.visible.iter().filter(|h| !pair.members.contains(h)) {
                    let mut members = [pair.members.as_slice(), &[third]].concat();
                    members.sort_unstable();
                    if triples.iter().all(|triple| triple.members != members) {
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
    pub(super) fn settings(&self, candidate: &Candidate) -> Vec<Setting> {
        let mut t = candidate.t.iter();
        let members = candidate.members.iter().zip(&candidate.variants);
        members
            .map(|(&h, &v)| {
                let variant = self.variant(h, v);
                let mut setting = variant.setting.clone();
                for amplitude in &variant.amplitudes {
                    let range = self.hypotheses[h].variables[amplitude.variable].range;
                    let size = t.next().map_or(0.0, |t| t * amplitude.prior_sd);
                    setting.values[amplitude.variable] = size.clamp(range.lower, range.upper);
                }
                setting
            })
            .collect()
    }
}

/// Heaviest first; equal weights in the order of their members, so that the order never depends on the search.
pub(super) fn by_weight(candidates: &mut [Candidate]) {
    candidates.sort_by(|a, b| b.log_weight().total_cmp(&a.log_weight()).then_with(|| a.members.cmp(&b.members)));
}
