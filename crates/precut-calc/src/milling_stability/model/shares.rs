//! At which frequencies, and in which modes, the leading disturbance swings (`milling/4.19`).

use std::f64::consts::TAU;

use nalgebra::Complex;

use crate::calculator::{Failure, Monitor, Pace};
use crate::num::quadrature::gauss_legendre;

use super::map::{Cut, Map};

/// Frequencies are looked at up to so many times that of the fastest mode.
const HIGHEST: f64 = 2.5;
/// Beyond so many oscillations of the fastest mode to a period aliases lie side by side.
const MOST_OSCILLATIONS: f64 = 300.0;
/// An alias of less than this share is not told.
const LEAST_SHARE: f64 = 0.01;

/// A frequency at which the disturbance swings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alias {
    /// Hz.
    pub frequency_hz: f64,
    /// Of the mean square of the motion between tool and work.
    pub share: f64,
}

/// What a disturbance is made of.
#[derive(Debug, Clone, PartialEq)]
pub struct Shares {
    /// By falling share.
    pub aliases: Vec<Alias>,
    /// Share of each mode in the mean elastic energy.
    pub energy: Vec<f64>,
}

/// Of the eigenvector (real and imaginary part) of an eigenvalue. With mu = exp(s T) the force is exp(s t) times a Fourier series;
/// every mode answers each of its terms by its own receptance at the complex frequency.
pub(super) fn shares(
    cut: &Cut<'_>,
    map: &Map,
    (re, im): (f64, f64),
    vector: &(Vec<f64>, Vec<f64>),
    points: usize,
    monitor: &dyn Monitor,
) -> Result<Option<Shares>, Failure> {
    let structure = cut.structure;
    let period = map.times[map.times.len() - 1];
    let fastest = structure.fastest_rad_per_s();
    let modulus = re.hypot(im);
    if fastest * period / TAU > MOST_OSCILLATIONS || modulus <= 0.0 {
        return Ok(None);
    }
    let growth = modulus.ln() / period;
    let angle = im.atan2(re);
    let d = structure.basis.len();
    let (at, weights) = gauss_legendre(points);
    // Time, weight and force at every point where something is cut.
    let mut forces: Vec<(f64, Vec<Complex<f64>>)> = Vec::new();
    let mut real: Vec<Vec<f64>> = Vec::new();
    map.apply_seen(&mut vector.0.clone(), |_, force, _| real.push(force.to_vec()));
    map.apply_seen(&mut vector.1.clone(), |element, force, _| {
        let (from, length) = (map.times[element], map.times[element + 1] - map.times[element]);
        for (i, (point, weight)) in at.iter().zip(&weights).enumerate() {
            let time = from + point * length;
            let decayed = weight * length / period * (-growth * time).exp();
            let of = |b: usize| Complex::new(real[element][i * d + b], force[i * d + b]) * decayed;
            let one: Vec<Complex<f64>> = (0..d).map(of).collect();
            if one.iter().any(|c| c.norm_sqr() > 0.0) {
                forces.push((time, one));
            }
        }
    });
    let turns = HIGHEST * fastest * period / TAU;
    #[allow(clippy::cast_possible_truncation)] // some hundreds
    let highest = turns.ceil() as i32;
    let mut pace = Pace::new(monitor);
    let mut aliases: Vec<Alias> = Vec::new();
    let mut energy = vec![0.0; structure.modes.len()];
    // Every force turned by each term in its turn: from one to the next by one multiplication, whose round-off some hundreds of terms
    // leave below 1e-13.
    let turned_by = |rad_per_s: f64, time: f64| Complex::from_polar(1.0, -rad_per_s * time);
    let lowest = (angle - TAU * f64::from(highest)) / period;
    let mut turning: Vec<(Vec<Complex<f64>>, Complex<f64>)> = forces
        .into_iter()
        .map(|(time, force)| {
            let first = turned_by(lowest, time);
            (force.into_iter().map(|value| value * first).collect(), turned_by(TAU / period, time))
        })
        .collect();
    for l in -highest..=highest {
        pace.work(8 * turning.len())?;
        let rad_per_s = (angle + TAU * f64::from(l)) / period;
        let mut term = vec![Complex::new(0.0, 0.0); d];
        for (force, step) in &mut turning {
            for (sum, value) in term.iter_mut().zip(force) {
                *sum += *value;
                *value *= *step;
            }
        }
        let mut motion = vec![Complex::new(0.0, 0.0); d];
        for ((mode, along), energy) in structure.modes.iter().zip(&structure.directions).zip(&mut energy) {
            let pushed: Complex<f64> = term.iter().zip(along).map(|(f, a)| f * *a).sum();
            let swing = pushed * mode.receptance_at(Complex::new(growth, rad_per_s));
            *energy += mode.stiffness_n_per_mm() * swing.norm_sqr();
            for (sum, a) in motion.iter_mut().zip(along) {
                *sum += swing * *a;
            }
        }
        let square: f64 = motion.iter().map(Complex::norm_sqr).sum();
        let frequency_hz = rad_per_s.abs() / TAU;
        // Of a real multiplier two terms are one frequency.
        match aliases.iter_mut().find(|known| (known.frequency_hz - frequency_hz).abs() * period < 1e-6) {
            Some(known) => known.share += square,
            None => aliases.push(Alias { frequency_hz, share: square }),
        }
    }
    let (whole, stored): (f64, f64) = (aliases.iter().map(|alias| alias.share).sum(), energy.iter().sum());
    if !(whole > 0.0 && whole.is_finite() && stored > 0.0) {
        return Ok(None);
    }
    for alias in &mut aliases {
        alias.share /= whole;
    }
    aliases.retain(|alias| alias.share >= LEAST_SHARE);
    aliases.sort_by(|a, b| b.share.total_cmp(&a.share));
    Ok(Some(Shares { aliases, energy: energy.iter().map(|one| one / stored).collect() }))
}

/// How many times the disturbance of an eigenvector grows at most from one tooth to a later one within a period: by the mean square of
/// the motion over the pitch of a tooth. Beyond the end of the period it goes on as the multiplier says.
pub(super) fn transient_growth(
    cut: &Cut<'_>,
    map: &Map,
    modulus: f64,
    vector: &(Vec<f64>, Vec<f64>),
    points: usize,
) -> f64 {
    let d = cut.structure.basis.len();
    let (_, weights) = gauss_legendre(points);
    let pitch_rad = TAU / cut.milling.teeth.len() as f64;
    let whole = cut.rotation.rotation_rad(map.times[map.times.len() - 1]);
    // Some dozens.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let count = (whole / pitch_rad).round().max(1.0) as usize;
    // Square of the motion over time, and the time, tooth by tooth.
    let mut teeth = vec![(0.0, 0.0); count];
    for part in [&vector.0, &vector.1] {
        map.apply_seen(&mut part.clone(), |element, force, state| {
            let (from, to) = (map.times[element], map.times[element + 1]);
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            let tooth = (cut.rotation.rotation_rad(0.5 * (from + to)) / pitch_rad) as usize;
            let motion = map.motion(element, force, state);
            let square = motion.chunks_exact(d).zip(&weights).map(|(r, w)| w * r.iter().map(|x| x * x).sum::<f64>());
            let known = &mut teeth[tooth.min(count - 1)];
            (known.0, known.1) = (known.0 + square.sum::<f64>() * (to - from), known.1 + (to - from));
        });
    }
    let size = |tooth: usize| (teeth[tooth].0 / teeth[tooth].1).sqrt();
    let later = |tooth: usize| if tooth < count { size(tooth) } else { size(tooth - count) * modulus };
    let of = |first: usize| (first + 1..first + count).map(move |tooth| later(tooth) / size(first));
    (0..count).flat_map(of).filter(|growth| growth.is_finite()).fold(1.0, f64::max)
}
