//! Intervals from the profile of the objective: one parameter held, the others fitted.

use super::{Ending, Fit, Model, NoFit, Parameter, Settings, fit};

/// Which end of an interval.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The lower one.
    Lower,
    /// The upper one.
    Upper,
}

/// Tries per end.
const TRIES: u32 = 40;

/// Where the profile of parameter `index` has risen by `rise` above the minimum of `at`, on one side.
///
/// For a level 1 - a with noise from the residuals, `rise = s^2 F(1 - a; 1, nu)`, s^2 the residual variance; with known
/// noise the quantile of chi-square with one degree. `None` where it does not rise so far before the bound, or no fit
/// on the way converges. Relative accuracy 1e-4 of the distance to the minimum.
pub fn profile_interval(
    model: &dyn Model,
    parameters: &[Parameter],
    settings: &Settings<'_>,
    at: &Fit,
    (index, side): (usize, Side),
    (rise, first_step): (f64, f64),
) -> Result<Option<f64>, NoFit> {
    let sign = if side == Side::Lower { -1.0 } else { 1.0 };
    let bound = if side == Side::Lower { parameters[index].lower } else { parameters[index].upper };
    let centre = at.parameters[index];
    let mut others = at.parameters.clone();
    let mut excess = |distance: f64| -> Result<Option<f64>, NoFit> {
        let mut held: Vec<Parameter> =
            parameters.iter().zip(&others).map(|(parameter, &start)| Parameter { start, ..*parameter }).collect();
        held[index] = held[index].held(centre + sign * distance);
        held[index].prior = parameters[index].prior;
        let found = fit(model, &held, settings)?;
        if found.ending != Ending::Converged {
            return Ok(None);
        }
        others.clone_from(&found.parameters);
        Ok(Some(found.objective - at.objective - rise))
    };
    let reach = (bound - centre).abs();
    let (mut inner, mut outer) = (0.0, first_step.abs().min(reach));
    let mut beyond = None;
    for _ in 0..TRIES {
        match excess(outer)? {
            Some(above) if above >= 0.0 => {
                beyond = Some(above);
                break;
            }
            Some(_) if outer >= reach => return Ok(None),
            Some(_) => (inner, outer) = (outer, (2.0 * outer).min(reach)),
            None => return Ok(None),
        }
    }
    if beyond.is_none() {
        return Ok(None);
    }
    // The profile is near a parabola: the root of its square root is found in few bisections and secants.
    for _ in 0..TRIES {
        if outer - inner <= 1e-4 * outer {
            break;
        }
        let middle = 0.5 * (inner + outer);
        match excess(middle)? {
            Some(above) if above >= 0.0 => outer = middle,
            Some(_) => inner = middle,
            None => return Ok(None),
        }
    }
    Ok(Some(centre + sign * 0.5 * (inner + outer)))
}
