//! What limits: the same cut with one side or one direction held rigid, solved again.

use crate::calculator::Failure;

use super::super::model::{Mode, Side, Structure};
use super::Study;
use super::output::RigidLimits;

/// A mode whose direction has less than this left is gone.
const GONE: f64 = 1e-6;

/// `None` where one side alone yields in one direction.
pub(super) fn limits(study: &Study<'_>) -> Result<Option<RigidLimits>, Failure> {
    let modes = &study.case.structure.modes;
    let without_side = |side: Side| modes.iter().filter(|mode| mode.side != side).copied().collect();
    let without_axis = |axis: usize| modes.iter().filter_map(|mode| held(mode, axis)).collect();
    let mut found = RigidLimits {
        tried: Vec::new(),
        tool_rigid_limit_mm: None,
        work_rigid_limit_mm: None,
        x_rigid_limit_mm: None,
        y_rigid_limit_mm: None,
        z_rigid_limit_mm: None,
        examined_to_mm: study.examined_mm,
    };
    let trials: [(&str, Vec<Mode>); 5] = [
        ("tool", without_side(Side::Tool)),
        ("work", without_side(Side::Work)),
        ("x", without_axis(0)),
        ("y", without_axis(1)),
        ("z", without_axis(2)),
    ];
    for (name, left) in trials {
        // Nothing was held, or nothing is left.
        if left.is_empty() || left == *modes {
            continue;
        }
        let structure = Structure::new(left);
        let limit = study.first_limit_mm(&study.of(&study.case.milling, &structure))?;
        found.tried.push(name.to_owned());
        *match name {
            "tool" => &mut found.tool_rigid_limit_mm,
            "work" => &mut found.work_rigid_limit_mm,
            "x" => &mut found.x_rigid_limit_mm,
            "y" => &mut found.y_rigid_limit_mm,
            _ => &mut found.z_rigid_limit_mm,
        } = limit;
    }
    Ok((!found.tried.is_empty()).then_some(found))
}

/// A mode that cannot move along an axis of the cut: what is left of its direction, with the mass that belongs to it.
fn held(mode: &Mode, axis: usize) -> Option<Mode> {
    let mut direction = mode.direction;
    direction[axis] = 0.0;
    let length = direction.iter().map(|x| x * x).sum::<f64>().sqrt();
    if (length - 1.0).abs() < 1e-12 {
        return Some(*mode);
    }
    (length > GONE).then(|| Mode {
        direction: direction.map(|x| x / length),
        mass_kg: mode.mass_kg / (length * length),
        ..*mode
    })
}
