//! Bounds by an active set.

use super::Parameter;

/// Brings a point within its bounds; whether it had to be moved.
pub(super) fn project(point: &mut [f64], parameters: &[Parameter]) -> bool {
    let mut moved = false;
    for (value, parameter) in point.iter_mut().zip(parameters) {
        if *value < parameter.lower || *value > parameter.upper {
            *value = value.clamp(parameter.lower, parameter.upper);
            moved = true;
        }
    }
    moved
}

/// Which parameters a bound holds back: they lie on it and the sum falls beyond it. `slope` is half the gradient.
pub(super) fn held(point: &[f64], slope: &[f64], parameters: &[Parameter]) -> Vec<bool> {
    point
        .iter()
        .zip(slope)
        .zip(parameters)
        .map(|((&value, &slope), parameter)| {
            parameter.lower >= parameter.upper
                || (value <= parameter.lower && slope >= 0.0)
                || (value >= parameter.upper && slope <= 0.0)
        })
        .collect()
}

/// Indices of what is free.
pub(super) fn free(held: &[bool]) -> Vec<usize> {
    held.iter().enumerate().filter(|(_, held)| !**held).map(|(index, _)| index).collect()
}
