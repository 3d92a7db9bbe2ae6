//! What was measured of a side: how well its modes are known, and the limit by the measured lines themselves.

use crate::calculator::{Failure, Finding, Message};
use crate::receptance_fit::{Direction, FittedMode, ModeCertainty};

use super::super::job::Fit;
use super::super::model::{Direct, NotDirect, Side};
use super::Study;
use super::output::{MeasuredSide, Outcome, ReceptanceLimit, YieldingSide};

/// Modes make another limit than the lines that they were made of where it differs by more than this share.
const FIT_MATTERS: f64 = 0.05;
const PERCENT: f64 = 100.0;
const AXES: [Direction; 3] = [Direction::X, Direction::Y, Direction::Z];

pub(super) fn sides(study: &Study<'_>) -> Vec<MeasuredSide> {
    study.fits.iter().map(side).collect()
}

fn side(fit: &Fit) -> MeasuredSide {
    let fitted = &fit.fitted;
    let is_measured = |direction: &Direction| fitted.groups.iter().any(|group| group.directions.contains(direction));
    MeasuredSide {
        side: if fit.side == Side::Tool { YieldingSide::Tool } else { YieldingSide::Work },
        certainty: fitted.certainty.clone(),
        largest_residual_share: fitted.largest_residual_share,
        groups: fitted.groups.clone(),
        functions: fitted.functions.clone(),
        rigid_directions: AXES.into_iter().filter(|direction| !is_measured(direction)).collect(),
    }
}

/// The first limit by measured lines, and whether there is one; `None` where nothing was measured.
pub(super) fn limit(
    study: &Study<'_>,
    by_modes_mm: Option<f64>,
) -> Result<Option<(Option<f64>, ReceptanceLimit)>, Failure> {
    if study.fits.is_empty() {
        return Ok(None);
    }
    let turn = study.job.cut.feed_direction_deg.to_radians();
    let pairs: Vec<_> = study.fits.iter().flat_map(|fit| fit.pairs(turn)).collect();
    let direct = match Direct::new(study.cut(), &pairs) {
        Ok(direct) => direct,
        Err(NotDirect::Uneven) => return Ok(Some((None, ReceptanceLimit::UnevenTeeth))),
        Err(NotDirect::Varying) => return Ok(Some((None, ReceptanceLimit::VaryingSpeed))),
        Err(NotDirect::Slow) => return Ok(Some((None, ReceptanceLimit::TooSlow))),
    };
    let found = direct.limit(study.examined_mm, by_modes_mm, study.monitor)?;
    let status = if found.depth_mm.is_some() { ReceptanceLimit::Found } else { ReceptanceLimit::NoneExamined };
    Ok(Some((found.depth_mm, status)))
}

/// Where the lines make another limit than the modes that were made of them.
pub(super) fn doubts(study: &Study<'_>, outcome: &Outcome) -> Option<Finding> {
    let fit = study.fits.first()?;
    if !matches!(outcome.receptance_limit?, ReceptanceLimit::Found | ReceptanceLimit::NoneExamined) {
        return None;
    }
    let (direct, limit, examined) = (outcome.limit_by_receptance_mm, outcome.first_limit_mm, outcome.examined_to_mm);
    let moved = direct.unwrap_or(examined) / limit.unwrap_or(examined) - 1.0;
    let finding = Finding::new("fit_changes_limit", format!("{}/files", fit.at)).with("examined_mm", examined);
    let with = |finding: Finding, name: &'static str, depth: Option<f64>| match depth {
        Some(depth) => finding.with(name, depth),
        None => finding,
    };
    (moved.abs() > FIT_MATTERS).then(|| with(with(finding, "direct_mm", direct), "limit_mm", limit))
}

/// How well measured sides are known, and what their lines say themselves.
pub(super) fn said(study: &Study<'_>, outcome: &Outcome) -> Vec<Message> {
    let mut said = Vec::new();
    for (fit, told) in study.fits.iter().zip(&outcome.measured) {
        let side = if fit.side == Side::Tool { "tool" } else { "work" };
        let errors = fit.fitted.modes.iter().zip(&told.certainty);
        let worst = |of: &dyn Fn((&FittedMode, &ModeCertainty)) -> f64| errors.clone().map(of).fold(0.0, f64::max);
        said.push(
            Message::new("side_is_measured")
                .with("side", side)
                .with("modes", fit.fitted.modes.len())
                .with(
                    "frequency_error_percent",
                    PERCENT * worst(&|(mode, of)| of.frequency_error_hz / mode.frequency_hz),
                )
                .with(
                    "damping_error_percent",
                    PERCENT * worst(&|(mode, of)| of.damping_ratio_error / mode.damping_ratio),
                )
                .with("mass_error_percent", PERCENT * worst(&|(mode, of)| of.mass_error_kg / mode.mass_kg))
                .with("left_percent", PERCENT * told.largest_residual_share),
        );
        if !told.rigid_directions.is_empty() {
            let names: Vec<&'static str> = told.rigid_directions.iter().map(|of| of.name()).collect();
            said.push(Message::new("measured_side_is_rigid").with("side", side).with("names", names));
        }
    }
    match (outcome.receptance_limit, outcome.limit_by_receptance_mm) {
        (Some(ReceptanceLimit::Found | ReceptanceLimit::NoneExamined), direct) => {
            let with = |message: Message, name: &'static str, depth: Option<f64>| match depth {
                Some(depth) => message.with(name, depth),
                None => message,
            };
            let message = Message::new("limit_by_receptance").with("examined_mm", outcome.examined_to_mm);
            said.push(with(with(message, "direct_mm", direct), "limit_mm", outcome.first_limit_mm));
        }
        (Some(why), _) => said.push(Message::new("receptance_not_solved").with("why", why.name())),
        (None, _) => {}
    }
    said
}
