//! The lowest point of a rough function in a box: differential evolution, then a simplex.
//!
//! For functions that jump and have several valleys, where a descent by derivatives stops anywhere. Coordinates run from
//! 0 to 1. Differential evolution "current to best of some" (Zhang, Sanderson, IEEE Trans. Evol. Comput. 13 (2009) 945)
//! with a step drawn anew for every trial; each trial draws from a stream of its own, so that the answer depends on the
//! seed alone, not on the number of threads. The simplex is that of Nelder and Mead, held in the box.

use rayon::prelude::*;

use super::stats::Resampler;

/// Share of a trial's coordinates that come from the mutant.
const CROSSING: f64 = 0.9;
/// Least and largest step along a difference.
const STEPS: (f64, f64) = (0.4, 0.95);
/// Share of the members that count as good.
const GOOD: f64 = 0.15;
/// A population whose values differ by less than this has arrived.
const ARRIVED: f64 = 1e-6;

/// How to search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Evolution {
    /// Members of the population, at least 6.
    pub members: usize,
    /// Generations at most.
    pub generations: u32,
    /// Seed of all draws.
    pub seed: u64,
}

/// A place and its value.
#[derive(Debug, Clone, PartialEq)]
pub struct Member {
    /// Coordinates, 0 to 1.
    pub at: Vec<f64>,
    /// Value there; infinite where the function is not defined.
    pub value: f64,
}

/// A function of a place and of a bound: a value above the bound need not be exact, so its sum may stop there. `None`
/// calls the search off.
pub type Objective<'a> = &'a (dyn Fn(&[f64], f64) -> Option<f64> + Sync);

/// Members of the last generation, best first; `None` where the objective called the search off. `first` begin beside
/// members spread over the box (Latin hypercube); `hear` is told the generation and its best after each.
pub fn evolve(
    dimensions: usize,
    first: &[Vec<f64>],
    settings: &Evolution,
    objective: Objective<'_>,
    hear: &mut dyn FnMut(u32, &Member),
) -> Option<Vec<Member>> {
    let members = settings.members.max(6);
    let mut places = spread(dimensions, members, settings.seed);
    for (place, stated) in places.iter_mut().zip(first) {
        place.clone_from(stated);
    }
    let mut population: Vec<Member> = places
        .into_par_iter()
        .map(|at| {
            let value = objective(&at, f64::INFINITY)?;
            Some(Member { at, value: if value.is_nan() { f64::INFINITY } else { value } })
        })
        .collect::<Option<_>>()?;
    sort(&mut population);
    for generation in 1..=settings.generations {
        hear(generation - 1, &population[0]);
        let spread = population[members - 1].value - population[0].value;
        if spread.is_finite() && spread <= ARRIVED * (1.0 + population[0].value.abs()) {
            break;
        }
        population = (0..members)
            .into_par_iter()
            .map(|i| {
                let mut draw = Resampler::new(settings.seed, u64::from(generation) * 65_536 + i as u64);
                let at = trial(&population, i, &mut draw);
                let parent = &population[i];
                let value = objective(&at, parent.value)?;
                Some(if value <= parent.value { Member { at, value } } else { parent.clone() })
            })
            .collect::<Option<_>>()?;
        sort(&mut population);
    }
    Some(population)
}

fn sort(population: &mut [Member]) {
    population.sort_by(|a, b| a.value.total_cmp(&b.value));
}

/// One member in every layer of every coordinate.
fn spread(dimensions: usize, members: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut places = vec![vec![0.0; dimensions]; members];
    let mut draw = Resampler::new(seed, 0);
    for coordinate in 0..dimensions {
        let mut layers: Vec<usize> = (0..members).collect();
        for i in (1..members).rev() {
            layers.swap(i, draw.below(i + 1));
        }
        for (place, layer) in places.iter_mut().zip(layers) {
            place[coordinate] = (layer as f64 + draw.uniform()) / members as f64;
        }
    }
    places
}

fn trial(population: &[Member], i: usize, draw: &mut Resampler) -> Vec<f64> {
    let members = population.len();
    // At least two of a population of at least six.
    let good = (2..=members).take_while(|&n| n as f64 <= (GOOD * members as f64).max(2.0)).last().unwrap_or(2);
    let best = &population[draw.below(good)].at;
    let (mut p, mut q) = (i, i);
    while p == i {
        p = draw.below(members);
    }
    while q == i || q == p {
        q = draw.below(members);
    }
    let own = &population[i].at;
    let step = STEPS.0 + (STEPS.1 - STEPS.0) * draw.uniform();
    let kept = draw.below(own.len().max(1));
    (0..own.len())
        .map(|k| {
            if k != kept && draw.uniform() > CROSSING {
                return own[k];
            }
            let moved = own[k] + step * (best[k] - own[k]) + step * (population[p].at[k] - population[q].at[k]);
            // Beyond the box: half way to its end.
            if moved < 0.0 {
                0.5 * own[k]
            } else if moved > 1.0 {
                0.5 * (1.0 + own[k])
            } else {
                moved
            }
        })
        .collect()
}

/// Nelder and Mead's simplex from `start` with edges of `size`, until it is smaller than `end` or `most` values are taken;
/// `None` where the objective called it off. `hear` is told the number of values taken.
pub fn simplex(
    start: &Member,
    size: f64,
    end: f64,
    most: u32,
    objective: &dyn Fn(&[f64]) -> Option<f64>,
    hear: &mut dyn FnMut(u32),
) -> Option<Member> {
    let n = start.at.len();
    let taken = std::cell::Cell::new(0_u32);
    let at = |at: Vec<f64>| {
        taken.set(taken.get() + 1);
        let at: Vec<f64> = at.into_iter().map(|x| x.clamp(0.0, 1.0)).collect();
        let value = objective(&at)?;
        Some(Member { value: if value.is_nan() { f64::INFINITY } else { value }, at })
    };
    let mut corners = vec![start.clone()];
    for k in 0..n {
        let mut corner = start.at.clone();
        corner[k] += if corner[k] + size <= 1.0 { size } else { -size };
        corners.push(at(corner)?);
    }
    while n > 0 && taken.get() < most {
        hear(taken.get());
        sort(&mut corners);
        let width = (0..n)
            .map(|k| corners.iter().map(|c| (c.at[k] - corners[0].at[k]).abs()).fold(0.0, f64::max))
            .fold(0.0, f64::max);
        if width < end {
            break;
        }
        let middle: Vec<f64> = (0..n).map(|k| corners[..n].iter().map(|c| c.at[k]).sum::<f64>() / n as f64).collect();
        let along = |share: f64| -> Vec<f64> {
            middle.iter().zip(&corners[n].at).map(|(m, worst)| m + share * (m - worst)).collect()
        };
        let mirrored = at(along(1.0))?;
        let next = if mirrored.value < corners[0].value {
            let further = at(along(2.0))?;
            if further.value < mirrored.value { further } else { mirrored }
        } else if mirrored.value < corners[n - 1].value {
            mirrored
        } else {
            let inner = at(along(if mirrored.value < corners[n].value { 0.5 } else { -0.5 }))?;
            if inner.value < corners[n].value.min(mirrored.value) {
                inner
            } else {
                let best = corners[0].at.clone();
                for corner in &mut corners[1..] {
                    let half = corner.at.iter().zip(&best).map(|(c, b)| 0.5 * (c + b)).collect();
                    *corner = at(half)?;
                }
                continue;
            }
        };
        corners[n] = next;
    }
    sort(&mut corners);
    Some(corners.swap_remove(0))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// Rastrigin's function on -5..5: a valley at every whole number, the lowest at 0.
    fn rastrigin(at: &[f64]) -> f64 {
        at.iter()
            .map(|u| {
                let x = 10.0 * u - 5.0;
                x * x + 10.0 - 10.0 * (std::f64::consts::TAU * x).cos()
            })
            .sum()
    }

    #[test]
    fn finds_the_lowest_of_many_valleys() {
        let settings = Evolution { members: 40, generations: 300, seed: 3 };
        let found = evolve(3, &[], &settings, &|at, _| Some(rastrigin(at)), &mut |_, _| ()).unwrap();
        // Neighbouring valleys lie at 1; the population has arrived at 1e-6.
        assert!(found[0].value < 1e-4, "{:?}", found[0]);
    }

    #[test]
    fn the_answer_depends_on_the_seed_and_on_nothing_else() {
        let run = |seed, threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let settings = Evolution { members: 12, generations: 8, seed };
            pool.install(|| evolve(2, &[], &settings, &|at, _| Some(rastrigin(at)), &mut |_, _| ()))
        };
        assert_eq!(run(1, 1), run(1, 2));
        assert_ne!(run(1, 1), run(2, 1));
    }

    #[test]
    fn a_bound_is_the_parents_value() {
        // Values that stop at the bound lead to the same members.
        let settings = Evolution { members: 12, generations: 8, seed: 5 };
        let exact = evolve(2, &[], &settings, &|at, _| Some(rastrigin(at)), &mut |_, _| ());
        let cut = |at: &[f64], bound: f64| {
            let value = rastrigin(at);
            Some(if value > bound { bound * 1.000_001 + 1e-9 } else { value })
        };
        assert_eq!(exact, evolve(2, &[], &settings, &cut, &mut |_, _| ()));
    }

    #[test]
    fn a_simplex_walks_down_a_bent_valley() {
        let rosenbrock = |at: &[f64]| {
            let (x, y) = (4.0 * at[0] - 2.0, 4.0 * at[1] - 2.0);
            (1.0 - x).powi(2) + 100.0 * (y - x * x).powi(2)
        };
        let start = Member { at: vec![0.2, 0.75], value: rosenbrock(&[0.2, 0.75]) };
        let end = simplex(&start, 0.05, 1e-9, 2000, &|at| Some(rosenbrock(at)), &mut |_| ()).unwrap();
        assert!((end.at[0] - 0.75).abs() < 1e-6 && (end.at[1] - 0.75).abs() < 1e-6, "{end:?}");
    }

    #[test]
    fn stays_in_the_box() {
        let slope = |at: &[f64], _: f64| Some(at[0]);
        let settings = Evolution { members: 8, generations: 20, seed: 1 };
        let found = evolve(1, &[vec![0.3]], &settings, &slope, &mut |_, _| ()).unwrap();
        assert!(found.iter().all(|m| (0.0..=1.0).contains(&m.at[0])) && found[0].value < 1e-3, "{found:?}");
        let end = simplex(&found[0], 0.1, 1e-6, 100, &|at| Some(at[0]), &mut |_| ()).unwrap();
        assert!(end.at[0].abs() < 1e-12);
    }

    #[test]
    fn a_search_called_off_ends_within_one_value_per_thread() {
        use std::sync::atomic::{AtomicUsize, Ordering};
        let settings = Evolution { members: 200, generations: 50, seed: 1 };
        for at_most in [0, 100, 1000] {
            let taken = AtomicUsize::new(0);
            let counted = |at: &[f64], _: f64| (taken.fetch_add(1, Ordering::Relaxed) < at_most).then(|| at[0]);
            assert_eq!(evolve(2, &[], &settings, &counted, &mut |_, _| ()), None);
            let after = taken.into_inner() - at_most;
            assert!((1..=rayon::current_num_threads()).contains(&after), "{after}");
        }
        let start = Member { at: vec![0.5; 2], value: 1.0 };
        assert_eq!(simplex(&start, 0.1, 1e-6, 100, &|_| None, &mut |_| ()), None);
    }
}
