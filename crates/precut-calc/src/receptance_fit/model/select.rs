//! Which poles are modes (`receptance/3.2`).
//!
//! With the poles held, residues and residuals are linear. Poles go one by one, those first whose residue has the wrong sign,
//! then the one whose loss costs least; each number of modes is refined and the least of Schwarz's criterion taken.

use nalgebra::{Complex, DMatrix, DVector};

use crate::num::dense::{Columns, symmetric_eigen};
use crate::num::stats::Criteria;

use super::super::input::MAX_MODES;
use super::phase::phases;
use super::poles::{Pole, candidates};
use super::refine::{Refined, Start, receptance, refine, residual_terms};
use super::{Group, Lines, Unfit};

/// Most poles that are weighed.
const MOST_POLES: usize = 28;
/// Dampings of a mode that is looked for where most is left.
const USUAL_DAMPINGS: [f64; 2] = [0.01, 0.05];

/// The modes of a group and what one less or one more would give.
#[derive(Debug, Clone)]
pub(crate) struct Chosen {
    /// The modes.
    pub refined: Refined,
    /// Phase of each mode's residue where it may be complex, degrees from the real axis, and its standard error.
    pub phases_deg: Vec<[f64; 2]>,
    /// Schwarz's criterion with one mode less; `None` with one mode.
    pub bic_less: Option<f64>,
    /// The same with one more.
    pub bic_more: Option<f64>,
    /// How many modes would meet the lines better, each of them seen.
    pub better: Option<usize>,
}

/// Normal equations of a function.
pub(super) struct Normal {
    pub gram: DMatrix<f64>,
    pub right: DVector<f64>,
    pub square: f64,
    /// Whether residues have to be positive.
    is_direct: bool,
    sign: f64,
}

/// What each of some columns is in a line.
type Row<'a> = &'a dyn Fn(f64, &mut [Complex<f64>]);

/// Normal equations of a function for so many columns, which `row` writes for an angular frequency, and its residuals.
pub(super) fn normal(group: &Group, lines: &Lines, columns: usize, row_of: Row<'_>) -> Normal {
    let upper = group.band()[1];
    let size = columns + group.residual_terms();
    let (mut gram, mut right, mut square) = (DMatrix::zeros(size, size), DVector::zeros(size), 0.0);
    let mut row = vec![Complex::new(0.0, 0.0); size];
    for (i, &omega) in lines.omega.iter().enumerate() {
        let factor = lines.factors[i] * lines.weights[i];
        row_of(omega, &mut row[..columns]);
        for (entry, term) in row[columns..].iter_mut().zip(residual_terms(omega, upper)) {
            *entry = term.into();
        }
        for entry in &mut row {
            *entry *= factor;
        }
        let value = lines.values[i] * lines.weights[i];
        square += value.norm_sqr();
        for a in 0..size {
            right[a] += row[a].re * value.re + row[a].im * value.im;
            for b in 0..=a {
                gram[(a, b)] += row[a].re * row[b].re + row[a].im * row[b].im;
            }
        }
    }
    gram.fill_upper_triangle_with_lower_triangle();
    Normal { gram, right, square, is_direct: lines.is_direct(), sign: lines.sign() }
}

/// The normal equations of every function for poles with real residues.
fn normals(group: &Group, poles: &[Pole]) -> Vec<Normal> {
    let row = |omega: f64, into: &mut [Complex<f64>]| {
        for (entry, pole) in into.iter_mut().zip(poles) {
            *entry = receptance(*pole, omega);
        }
    };
    group.lines.iter().map(|lines| normal(group, lines, poles.len(), &row)).collect()
}

/// The best linear fit with some of the poles.
struct Linear {
    rss: f64,
    /// Coefficients of the poles in each function, and of its residuals.
    coefficients: Vec<DVector<f64>>,
    /// What the loss of each pole costs.
    costs: Vec<f64>,
}

fn linear(normals: &[Normal], poles: usize, kept: &[usize]) -> Option<Linear> {
    let mut found = Linear { rss: 0.0, coefficients: Vec::new(), costs: vec![0.0; kept.len()] };
    for normal in normals {
        let columns: Vec<usize> = kept.iter().copied().chain(poles..normal.right.len()).collect();
        let gram = DMatrix::from_fn(columns.len(), columns.len(), |i, j| normal.gram[(columns[i], columns[j])]);
        let scale: Vec<f64> = (0..columns.len()).map(|i| gram[(i, i)].sqrt()).collect();
        let unit = DMatrix::from_fn(columns.len(), columns.len(), |i, j| gram[(i, j)] / (scale[i] * scale[j]));
        let inverse = unit.cholesky()?.inverse();
        let right = DVector::from_fn(columns.len(), |i, _| normal.right[columns[i]] / scale[i]);
        let scaled = &inverse * &right;
        found.rss += (normal.square - scaled.dot(&right)).max(0.0);
        for (i, cost) in found.costs.iter_mut().enumerate() {
            *cost += scaled[i] * scaled[i] / inverse[(i, i)];
        }
        found.coefficients.push(DVector::from_fn(columns.len(), |i, _| scaled[i] / scale[i]));
    }
    Some(found)
}

/// A set of poles with its criterion, for each number of them.
fn chain(group: &Group, normals: &[Normal], poles: &[Pole]) -> Vec<(Vec<usize>, f64)> {
    let mut kept: Vec<usize> = (0..poles.len()).collect();
    let mut found = Vec::new();
    while !kept.is_empty() {
        let Some(fit) = linear(normals, poles.len(), &kept) else {
            // Two poles are one to the last digit: the later goes.
            kept.pop();
            continue;
        };
        let is_wrong = |i: &usize| {
            normals.iter().zip(&fit.coefficients).any(|(normal, of)| normal.is_direct && normal.sign * of[*i] <= 0.0)
        };
        let wrong: Vec<usize> = (0..kept.len()).filter(is_wrong).collect();
        let among: Vec<usize> = if wrong.is_empty() { (0..kept.len()).collect() } else { wrong.clone() };
        if wrong.is_empty() {
            found.push((kept.clone(), bic(group, kept.len(), fit.rss)));
        }
        let Some(cheapest) = among.into_iter().min_by(|&a, &b| fit.costs[a].total_cmp(&fit.costs[b])) else { break };
        kept.remove(cheapest);
    }
    found.reverse();
    found
}

fn bic(group: &Group, modes: usize, rss: f64) -> f64 {
    let numbers = modes * (2 + group.axes.len()) + group.lines.len() * group.residual_terms();
    Criteria::of(group.residual_count(), numbers, rss, 0.0).bic
}

/// A start from poles: the shapes that come nearest to their residues.
fn start(group: &Group, normals: &[Normal], poles: &[Pole], kept: &[usize]) -> Option<Start> {
    let fit = linear(normals, poles.len(), kept)?;
    let count = group.axes.len();
    let shape = |i: usize| {
        let mut residues = Columns::zeros(count, count);
        for (lines, coefficients) in group.lines.iter().zip(&fit.coefficients) {
            let (p, q) = (lines.response.0, lines.excitation.0);
            let value = lines.sign() * coefficients[i];
            residues.set(p, q, value);
            residues.set(q, p, value);
        }
        let (values, vectors) = symmetric_eigen(&residues);
        let size = values[count - 1].max(0.0).sqrt();
        vectors.column(count - 1).iter().map(|v| v * size).collect::<Vec<f64>>()
    };
    Some(Start {
        modes: kept.iter().enumerate().map(|(i, pole)| (poles[*pole], shape(i))).collect(),
        residuals: fit.coefficients.iter().map(|of| of.iter().skip(kept.len()).copied().collect()).collect(),
    })
}

/// Where a fit leaves most.
fn beside(group: &Group, refined: &Refined) -> Option<f64> {
    let left = group.lines.iter().zip(&refined.predicted).flat_map(|(lines, predicted)| {
        let size = |i: usize| (lines.values[i] - predicted[i]).norm() * lines.weights[i];
        (0..lines.omega.len()).map(move |i| (size(i), lines.omega[i]))
    });
    left.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, omega)| omega)
}

pub(super) fn poles_of(refined: &Refined) -> Vec<Pole> {
    let pole = |mode: &super::Mode| Pole { omega: std::f64::consts::TAU * mode.frequency_hz, zeta: mode.damping_ratio };
    refined.modes.iter().map(pole).collect()
}

/// Fits of one group with any number of modes.
struct Search<'a> {
    group: &'a Group,
    poles: Vec<Pole>,
    normals: Vec<Normal>,
    chain: Vec<(Vec<usize>, f64)>,
    stop: &'a dyn Fn() -> bool,
    found: Vec<Option<Refined>>,
}

impl<'a> Search<'a> {
    fn new(group: &'a Group, poles: Vec<Pole>, stop: &'a dyn Fn() -> bool) -> Self {
        let normals = normals(group, &poles);
        let chain = chain(group, &normals, &poles);
        Self { group, poles, normals, chain, stop, found: Vec::new() }
    }

    /// The fit with so many of the poles; where they do not suffice, with modes added where most is left. `None` where there is
    /// none.
    fn with(&mut self, modes: usize) -> Result<Option<Refined>, Unfit> {
        if modes == 0 {
            return Ok(None);
        }
        if let Some(found) = self.found.get(modes).and_then(Option::as_ref) {
            return Ok(Some(found.clone()));
        }
        let kept = self.chain.iter().find(|(kept, _)| kept.len() == modes).map(|(kept, _)| kept.clone());
        let refined = match kept {
            Some(kept) => self.refined(start(self.group, &self.normals, &self.poles, &kept))?,
            None => match self.with(modes - 1)? {
                Some(less) => self.grown(&less)?,
                None => None,
            },
        };
        self.keep(modes, refined.clone());
        Ok(refined)
    }

    /// The better of the fit with one pole more and of those with a mode added where most is left.
    fn one_more(&mut self, less: &Refined) -> Result<Option<Refined>, Unfit> {
        let modes = less.modes.len() + 1;
        let of_poles = self.with(modes)?;
        let grown = self.grown(less)?;
        let order = |a: &Refined, b: &Refined| a.merit().total_cmp(&b.merit()).then(a.bic.total_cmp(&b.bic));
        let better = [of_poles, grown].into_iter().flatten().min_by(order);
        self.keep(modes, better.clone());
        Ok(better)
    }

    fn keep(&mut self, modes: usize, refined: Option<Refined>) {
        if self.found.len() < modes + 1 {
            self.found.resize(modes + 1, None);
        }
        self.found[modes] = refined;
    }

    fn refined(&self, start: Option<Start>) -> Result<Option<Refined>, Unfit> {
        let Some(start) = start else { return Ok(None) };
        match refine(self.group, &start, self.stop) {
            Ok(refined) => Ok(Some(refined)),
            Err(Unfit::Stopped) => Err(Unfit::Stopped),
            Err(_) => Ok(None),
        }
    }

    /// With a mode more, where those before leave most.
    fn grown(&self, less: &Refined) -> Result<Option<Refined>, Unfit> {
        let Some(omega) = beside(self.group, less) else { return Ok(None) };
        let mut best: Option<Refined> = None;
        for zeta in USUAL_DAMPINGS {
            let mut poles = poles_of(less);
            poles.push(Pole { omega, zeta });
            let normals = normals(self.group, &poles);
            let all: Vec<usize> = (0..poles.len()).collect();
            if let Some(refined) = self.refined(start(self.group, &normals, &poles, &all))?
                && best.as_ref().is_none_or(|best| refined.merit() < best.merit())
            {
                best = Some(refined);
            }
        }
        Ok(best)
    }

    /// How many modes the linear fits ask for.
    fn likely(&self) -> Option<usize> {
        self.chain.iter().min_by(|a, b| a.1.total_cmp(&b.1)).map(|(kept, _)| kept.len())
    }
}

/// Root mean square of what a fit leaves of each function, in its weights.
fn scatter(group: &Group, refined: &Refined) -> Vec<f64> {
    let of = |(lines, predicted): (&Lines, &Vec<Complex<f64>>)| {
        let left = |i: usize| ((lines.values[i] - predicted[i]) * lines.weights[i]).norm_sqr();
        let squares: f64 = (0..lines.values.len()).map(left).sum();
        (squares / lines.values.len() as f64).sqrt()
    };
    group.lines.iter().zip(&refined.predicted).map(of).collect()
}

/// The modes of a group: so many, or as many as the lines ask for.
pub(crate) fn choose(group: &mut Group, modes: Option<usize>, stop: &dyn Fn() -> bool) -> Result<Chosen, Unfit> {
    let mut poles = candidates(group, stop).ok_or(Unfit::Stopped)?;
    poles.truncate(MOST_POLES);
    if group.lines.len() > 1 {
        // Each function by its own scatter, which a first fit tells.
        let mut search = Search::new(group, poles.clone(), stop);
        let count = modes.or(search.likely()).ok_or(Unfit::NoMode)?;
        if let Some(refined) = search.with(count)? {
            let scatter = scatter(group, &refined);
            for (lines, scatter) in group.lines.iter_mut().zip(scatter) {
                if scatter > 0.0 {
                    for weight in &mut lines.weights {
                        *weight /= scatter;
                    }
                }
            }
        }
    }
    let group = &*group;
    let mut search = Search::new(group, poles, stop);
    let refined = match modes {
        Some(count) => search.with(count)?.ok_or(Unfit::NoMode)?,
        None => least(&mut search)?,
    };
    let less = search.with(refined.modes.len() - 1)?;
    let more = search.one_more(&refined)?;
    let is_better = |one: &&Refined| one.merit() < refined.bic;
    let better = [&more, &less].into_iter().flatten().find(is_better).map(|one| one.modes.len());
    Ok(Chosen {
        phases_deg: phases(group, &refined),
        bic_less: less.map(|less| less.bic),
        bic_more: more.map(|more| more.bic),
        better,
        refined,
    })
}

/// The number of modes with the least criterion, from what the linear fits ask for.
fn least(search: &mut Search<'_>) -> Result<Refined, Unfit> {
    let count = search.likely().ok_or(Unfit::NoMode)?;
    let mut best = search.with(count)?.ok_or(Unfit::NoMode)?;
    while !best.stands() {
        best = search.with(best.modes.len() - 1)?.ok_or(Unfit::NoMode)?;
    }
    loop {
        if let Some(less) = search.with(best.modes.len() - 1)?.filter(|less| less.merit() < best.merit()) {
            best = less;
            continue;
        }
        let more = search.one_more(&best)?.filter(|more| more.merit() < best.merit());
        match more.filter(|more| more.modes.len() <= MAX_MODES) {
            Some(more) => best = more,
            None => return Ok(best),
        }
    }
}
