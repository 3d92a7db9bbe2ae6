//! Classes in the plane of spindle speed and depth of cut.

use super::{figure, panel};
use crate::calculator::{Axis, Figure, Item, LimitCurve, Role};
use crate::diagnosis::answer::classes::ClassReport;

/// The rows by class, with the limit of both models, of every feed.
pub(super) fn plane(classes: &ClassReport) -> Figure {
    let of_class = |(class, name, role): (&str, &'static str, Role)| {
        // A row that speaks about two margins is one point.
        let mut points: Vec<(f64, f64)> = (0..classes.class.len())
            .filter(|&row| classes.class[row] == class)
            .map(|row| (classes.spindle_speed_rpm[row], classes.depth_mm[row]))
            .collect();
        points.dedup();
        let (x, y): (Vec<f64>, Vec<f64>) = points.into_iter().unzip();
        (!x.is_empty()).then_some(Item::Points { name, x, y, role })
    };
    let limits = |curves: &[LimitCurve], name: &'static str, role: Role| -> Vec<Item> {
        let line = |curve: &LimitCurve| Item::Line {
            name,
            x: curve.spindle_speed_rpm.clone(),
            y: curve.depth_mm.clone(),
            role,
        };
        curves.iter().map(line).collect()
    };
    let mut items = limits(&classes.limits_base, "diagnosis_limit_base", Role::Before);
    items.extend(limits(&classes.limits_extended, "diagnosis_limit_extended", Role::After));
    let known = [
        ("stable", "diagnosis_stable", Role::Stable),
        ("chatter", "diagnosis_chatter", Role::Unstable),
        ("opened", "diagnosis_opened", Role::Limit),
    ];
    items.extend(known.into_iter().filter_map(of_class));
    figure(
        "classes",
        "diagnosis_classes",
        Axis::linear("diagnosis_spindle_speed", "rev/min"),
        vec![panel(Axis::linear("diagnosis_depth", "mm"), items)],
    )
}
