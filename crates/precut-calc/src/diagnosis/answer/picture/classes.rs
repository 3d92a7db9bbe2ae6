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
    let mut items: Vec<Item> = classes.limit_band.iter().flat_map(bands).collect();
    items.extend(limits(&classes.limits_base, "diagnosis_limit_base", Role::Before));
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

/// The interval of a limit, one area for every stretch of speeds that has one.
fn bands(curve: &LimitCurve) -> Vec<Item> {
    let at = |k: usize| Some((curve.spindle_speed_rpm[k], (*curve.low_mm.get(k)?)?, (*curve.high_mm.get(k)?)?));
    let known: Vec<Option<(f64, f64, f64)>> = (0..curve.spindle_speed_rpm.len()).map(at).collect();
    let stretches = known.split(Option::is_none).filter(|stretch| stretch.len() > 1);
    let area = |stretch: &[Option<(f64, f64, f64)>]| {
        let of = |part: fn(&(f64, f64, f64)) -> f64| stretch.iter().flatten().map(part).collect();
        Item::Band {
            name: "diagnosis_band",
            x: of(|at| at.0),
            lower: of(|at| at.1),
            upper: of(|at| at.2),
            role: Role::Uncertainty,
        }
    };
    stretches.map(area).collect()
}
