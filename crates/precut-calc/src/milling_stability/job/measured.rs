//! Sides that are given by measured frequency responses: their modes, and the lines themselves along the axes of the cut.

use crate::calculator::{Failure, Monitor};
use crate::receptance_fit::{Job as FitJob, Outcome as Fitted, outcome, read};

use super::super::model::{MeasuredPair, Side, Vector};
use super::case::in_the_cut;
use super::input::{DirectionPart, Job, Yielding, YieldingMode, YieldingModes};

/// Modes that are counted on along a direction, before any are known.
const USUAL_MODES: u32 = 2;
/// The fastest of them as a share of the highest line.
const FASTEST: f64 = 0.7;
/// Any mode of a machine stands for it.
const USUAL_DAMPING: f64 = 0.03;
const USUAL_KG: f64 = 1.0;
const MM_PER_M: f64 = 1e3;

/// What measured functions say of a side.
#[derive(Debug, Clone)]
pub(in crate::milling_stability) struct Fit {
    /// Where the side stands in the job.
    pub at: &'static str,
    pub side: Side,
    pub job: FitJob,
    pub fitted: Fitted,
}

/// The modes of all measured sides, and the job with those modes in their place.
pub(in crate::milling_stability) fn fits(job: &Job, monitor: &dyn Monitor) -> Result<(Vec<Fit>, Job), Failure> {
    let (mut found, mut with_modes) = (Vec::new(), job.clone());
    for (at, side, yielding) in job.sides() {
        let Yielding::Receptances(of) = yielding else { continue };
        let job = of.fit_job();
        let fitted = outcome(&job, at, monitor)?;
        let mode = |one: &crate::receptance_fit::FittedMode| YieldingMode {
            direction: one.direction.iter().map(|part| DirectionPart(*part)).collect(),
            frequency_hz: Some(one.frequency_hz),
            mass_kg: Some(one.mass_kg),
            stiffness_n_per_mm: None,
            damping_ratio: Some(one.damping_ratio),
            damping_n_s_per_mm: None,
        };
        let modes = Yielding::Modes(YieldingModes { modes: fitted.modes.iter().map(mode).collect() });
        *with_modes.side_mut(side) = modes;
        found.push(Fit { at, side, job, fitted });
    }
    Ok((found, with_modes))
}

/// A job with about as many modes as functions will show, to estimate what it costs before they are looked at; `None` where they
/// are not read.
pub(in crate::milling_stability) fn guessed(job: &Job) -> Option<Job> {
    let mut with_modes = job.clone();
    for (_, side, yielding) in job.sides() {
        let Yielding::Receptances(of) = yielding else { continue };
        let functions = read(&of.files, "").ok()?;
        let most_hz = of.to_hz.unwrap_or(f64::INFINITY);
        let highest = functions.iter().filter_map(|one| one.frequency_hz.last()).fold(0.0_f64, |most, f| most.max(*f));
        let mode = |axis: usize| YieldingMode {
            direction: (0..3).map(|q| DirectionPart(f64::from(u8::from(q == axis)))).collect(),
            frequency_hz: Some(FASTEST * highest.min(most_hz)),
            mass_kg: Some(USUAL_KG),
            stiffness_n_per_mm: None,
            damping_ratio: Some(USUAL_DAMPING),
            damping_n_s_per_mm: None,
        };
        let axes = (0..3).filter(|axis| functions.iter().any(|one| one.response.axis() == *axis));
        let modes = axes.flat_map(|axis| (0..of.modes.unwrap_or(USUAL_MODES)).map(move |_| mode(axis))).collect();
        *with_modes.side_mut(side) = Yielding::Modes(YieldingModes { modes });
    }
    Some(with_modes)
}

impl Fit {
    /// The lines that were fitted, as displacement in mm over N along directions of the cut; the function across stands for the one
    /// back where that was not measured (Maxwell, Betti).
    pub(in crate::milling_stability) fn pairs(&self, turn_rad: f64) -> Vec<MeasuredPair> {
        let axis = |q: usize| -> Vector { in_the_cut(std::array::from_fn(|p| f64::from(u8::from(p == q))), turn_rad) };
        let of = |(number, function): (usize, &crate::receptance_fit::FittedFunction)| {
            let sign = function.response.sign() * function.excitation.sign();
            let lines = self.fitted.curve.iter().filter(|row| row.function == number);
            let value = |re: f64, im: f64| nalgebra::Complex::new(re, im) * (sign / MM_PER_M);
            MeasuredPair {
                side: self.side,
                response: axis(function.response.axis()),
                excitation: axis(function.excitation.axis()),
                lines: lines.map(|row| (row.frequency_hz, value(row.real_um_per_n, row.imaginary_um_per_n))).collect(),
            }
        };
        self.fitted.functions.iter().enumerate().map(of).collect()
    }
}
