//! Spline, filter and spectrum of closed profiles.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    missing_docs
)]

use std::f64::consts::{PI, TAU};

use precut_calc::num::roundness::{Filter, Grid, PeriodicSpline, RoundnessError, Section, evaluate, refer};
use proptest::prelude::*;

/// A profile of a few harmonics: (order, amplitude, angle of maximum).
fn wave(harmonics: &[(f64, f64, f64)], angle: f64) -> f64 {
    harmonics.iter().map(|(k, amplitude, max)| amplitude * (k * (angle - max)).cos()).sum()
}

fn uniform(n: usize) -> Vec<f64> {
    (0..n).map(|i| TAU * i as f64 / n as f64).collect()
}

#[test]
fn a_gaussian_filter_passes_half_at_its_cut_off() {
    for cutoff_upr in [15.0, 50.0, 150.0, 500.0] {
        let k = cutoff_upr as usize;
        let low = Filter::LowPass { cutoff_upr };
        let high = Filter::HighPass { cutoff_upr };
        assert!((low.transmission(k) - 0.5).abs() < 1e-15);
        // The standard writes it exp(−π(αk/f)²) with α = √(ln 2/π).
        let alpha = (std::f64::consts::LN_2 / PI).sqrt();
        for k in [1, 2, k / 3, k, 2 * k] {
            let standard = (-PI * (alpha * k as f64 / cutoff_upr).powi(2)).exp();
            assert!((low.transmission(k) - standard).abs() < 1e-14);
            assert!((low.transmission(k) + high.transmission(k) - 1.0).abs() < 1e-15);
        }
        assert_eq!(
            (low.transmission(0).to_bits(), high.transmission(0).to_bits()),
            (1.0_f64.to_bits(), 1.0_f64.to_bits())
        );
    }
    let band = Filter::BandPass { from_upr: 15.0, to_upr: 500.0 };
    assert!((band.transmission(15) - 0.5 * Filter::LowPass { cutoff_upr: 500.0 }.transmission(15)).abs() < 1e-15);
}

/// Against the definition as a convolution with the Gaussian weight round the circle, summed directly.
#[test]
fn the_filter_is_the_convolution_of_the_standard() {
    let (n, cutoff_upr) = (720_usize, 15.0);
    let grid = Grid::new(n).unwrap();
    let radii: Vec<f64> = (0..n).map(|i| 10.0 + 0.01 * ((i * 7919) % 101) as f64 / 101.0).collect();
    let filtered = grid.filtered(&radii, Filter::LowPass { cutoff_upr }).unwrap();
    let alpha = (std::f64::consts::LN_2 / PI).sqrt();
    let step = 1.0 / n as f64;
    // Weight at a distance of u revolutions: (f/α) exp(−π(u f/α)²), wrapped.
    let weight = |u: f64| cutoff_upr / alpha * (-PI * (u * cutoff_upr / alpha).powi(2)).exp();
    for at in [0, 1, 100, 719] {
        let mut sum = 0.0;
        for (i, radius) in radii.iter().enumerate() {
            for turn in -2..=2 {
                sum += radius * weight((at as f64 - i as f64) * step + f64::from(turn)) * step;
            }
        }
        // The sum replaces an integral of a smooth periodic function: what aliases is of harmonic n − n/2, 2^-576.
        assert!((sum - filtered[at]).abs() < 1e-12, "{sum} {}", filtered[at]);
    }
}

#[test]
fn the_spectrum_finds_amplitude_and_phase() {
    let harmonics = [(2.0, 0.006, 0.3), (3.0, 0.004, 1.1), (17.0, 0.001, 0.05), (60.0, 0.0005, 0.01)];
    for n in [360, 361, 719, 3600] {
        let grid = Grid::new(n).unwrap();
        let radii: Vec<f64> = uniform(n).iter().map(|&angle| 40.0 + wave(&harmonics, angle)).collect();
        let spectrum = grid.spectrum(&radii, 100).unwrap();
        assert_eq!(spectrum.len(), 100);
        for (order, amplitude, max) in harmonics {
            let found = spectrum[order as usize - 1];
            assert!((found.amplitude_mm - amplitude).abs() < 1e-14, "{n} {order}");
            // Round-off of the radii over the amplitude.
            assert!((found.angle_of_max_rad - max).abs() < 1e-14 / amplitude, "{n} {order}: {found:?}");
        }
        let others = spectrum.iter().filter(|h| !harmonics.iter().any(|(k, ..)| *k as usize == h.order));
        assert!(others.fold(0.0_f64, |most, h| most.max(h.amplitude_mm)) < 1e-14);
    }
    // The highest harmonic of an even grid counts once.
    let grid = Grid::new(8).unwrap();
    let radii: Vec<f64> = (0..8).map(|i| 5.0 + 0.01 * (PI * f64::from(i)).cos()).collect();
    assert!((grid.spectrum(&radii, 4).unwrap()[3].amplitude_mm - 0.01).abs() < 1e-15);
}

/// Error of a periodic cubic spline through k waves at spacing h: at most 5/384·(kh)⁴ of the amplitude (Hall, Meyer 1976).
#[test]
fn the_spline_errs_as_theory_says() {
    for (k, n) in [(3.0, 72), (5.0, 200), (11.0, 360)] {
        let angles = uniform(n);
        let values = angles.iter().map(|a| (k * a).cos()).collect();
        let spline = PeriodicSpline::new(angles, values).unwrap();
        let bound = 5.0 / 384.0 * (k * TAU / n as f64).powi(4);
        let fine = spline.uniform(10 * n);
        let error = uniform(10 * n).iter().zip(&fine).map(|(a, v)| (v - (k * a).cos()).abs()).fold(0.0, f64::max);
        assert!(error < bound + 1e-14 && error > 0.1 * bound, "{k} {n}: {error:e} of {bound:e}");
        for (i, value) in fine.iter().enumerate().step_by(37) {
            let at = TAU * i as f64 / (10 * n) as f64;
            assert!((spline.at(at) - value).abs() < 1e-14 && (spline.at(at - TAU) - value).abs() < 1e-12);
        }
    }
}

#[test]
fn finer_reading_keeps_the_profile() {
    for n in [90, 91] {
        let (grid, fine) = (Grid::new(n).unwrap(), Grid::new(2 * n).unwrap());
        let harmonics = [(2.0, 0.006, 0.3), (44.0, 0.004, 0.02)];
        let profile = |m: usize| -> Vec<f64> { uniform(m).iter().map(|&a| 40.0 + wave(&harmonics, a)).collect() };
        let read = grid.resampled(&profile(n), Filter::None, &fine).unwrap();
        let error = read.iter().zip(profile(2 * n)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(error < 1e-13, "{n}: {error:e}");
    }
}

#[test]
fn what_is_no_profile_is_refused() {
    let spline = |angles: &[f64]| PeriodicSpline::new(angles.to_vec(), vec![1.0; angles.len()]).map(|_| ());
    assert_eq!(spline(&[0.0, 2.0, 1.0]), Err(RoundnessError::NotStarShaped { index: 2 }));
    assert_eq!(spline(&[0.0, 2.0, 2.0]), Err(RoundnessError::NotStarShaped { index: 2 }));
    assert_eq!(spline(&[0.0, 2.0, TAU]), Err(RoundnessError::NotStarShaped { index: 0 }));
    assert_eq!(spline(&[0.0, 2.0]), Err(RoundnessError::TooFewPoints { count: 2, needed: 3 }));
    assert_eq!(spline(&[0.0, 2.0, f64::NAN]), Err(RoundnessError::NotFinite { index: 2 }));
    // A point that lies behind its predecessor as seen from the centre.
    let mut points: Vec<(f64, f64)> = uniform(40).iter().map(|a| (a.cos(), a.sin())).collect();
    points.swap(10, 11);
    let (x, y): (Vec<f64>, Vec<f64>) = points.into_iter().unzip();
    let found = refer(&Section::from_points(&x, &y).unwrap(), [0.0, 0.0], 40);
    assert_eq!(found, Err(RoundnessError::NotStarShaped { index: 11 }));
    assert!(Grid::new(2).is_err() && Grid::new(10).unwrap().spectrum(&[1.0; 9], 3).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

    /// Uneven angles and an eccentric part: after referring to the centre, filter and spectrum are those of the form.
    #[test]
    fn uneven_angles_give_the_same_form(
        jitter in prop::collection::vec(-0.4_f64..0.4, 400),
        phase in 0.0_f64..TAU,
        eccentricity in (-0.05_f64..0.05, -0.05_f64..0.05),
    ) {
        let n = jitter.len();
        let harmonics = [(2.0, 0.006, phase), (5.0, 0.002, 0.2), (12.0, 0.001, 0.1)];
        let angles: Vec<f64> = jitter.iter().enumerate().map(|(i, j)| TAU * (i as f64 + j) / n as f64).collect();
        let (x, y): (Vec<f64>, Vec<f64>) = angles
            .iter()
            .map(|&a| (a, 30.0 + wave(&harmonics, a)))
            .map(|(a, r)| (r * a.cos() + eccentricity.0, r * a.sin() + eccentricity.1))
            .unzip();
        let section = Section::from_points(&x, &y).unwrap();
        let grid = Grid::new(n).unwrap();
        let found = evaluate(&section, &grid, Filter::LowPass { cutoff_upr: 50.0 }, 50, &|| true).unwrap();
        // Spline error of harmonic 12 at the widest spacing (1.8 of the mean), and the centre that uneven points put
        // off the middle of the form: its share of the amplitudes over the radius, doubled once in the second order.
        let spline = 5.0 / 384.0 * (12.0 * 1.8 * TAU / n as f64).powi(4) * 0.001;
        let centre = found.unfiltered.least_squares.circle.centre_mm;
        let off = (centre[0] - eccentricity.0).hypot(centre[1] - eccentricity.1);
        let mixed = off * 0.006 * 12.0 / 30.0 + off * off / 30.0;
        for (k, amplitude, _) in harmonics {
            let got = found.spectrum[k as usize - 1].amplitude_mm;
            prop_assert!((got - amplitude).abs() <= spline + mixed + 1e-13, "{k}: {:e}", got - amplitude);
        }
        prop_assert!(found.spectrum[0].amplitude_mm <= off + spline + mixed);
    }

    /// Filtering is linear and does not depend on where the first angle lies.
    #[test]
    fn the_filter_is_linear_and_turns_with_the_profile(
        deviations in prop::collection::vec(-0.01_f64..0.01, 150), by in 0_usize..150, factor in -3.0_f64..3.0,
    ) {
        let grid = Grid::new(150).unwrap();
        let radii: Vec<f64> = deviations.iter().map(|d| 20.0 + d).collect();
        let filter = Filter::BandPass { from_upr: 2.0, to_upr: 15.0 };
        let once = grid.filtered(&radii, filter).unwrap();
        let mut turned = radii.clone();
        turned.rotate_left(by);
        let mut expected = once.clone();
        expected.rotate_left(by);
        for (got, wanted) in grid.filtered(&turned, filter).unwrap().iter().zip(&expected) {
            prop_assert!((got - wanted).abs() < 1e-13);
        }
        let scaled: Vec<f64> = radii.iter().map(|r| factor * r).collect();
        for (got, wanted) in grid.filtered(&scaled, filter).unwrap().iter().zip(&once) {
            prop_assert!((got - factor * wanted).abs() < 1e-12);
        }
    }
}
