//! A section about its own circle: what can be taken out of a cylinder, part by part.

use crate::num::cylinder::Point;

use super::output::PartKind;

/// A point of a section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sample {
    pub(super) angle_rad: f64,
    /// Off the section's circle, mm.
    pub(super) off_mm: f64,
    pub(super) height_mm: f64,
}

/// A section square to an axis near that of the cylinder.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Form {
    /// Height along that axis, mm.
    pub(super) height_mm: f64,
    /// Centre off that axis, mm.
    pub(super) centre_mm: [f64; 2],
    pub(super) radius_mm: f64,
    pub(super) samples: Vec<Sample>,
}

impl Form {
    pub(super) fn points(&self) -> impl Iterator<Item = Point> + '_ {
        self.samples.iter().map(|sample| {
            let (sin, cos) = sample.angle_rad.sin_cos();
            let distance = self.radius_mm + sample.off_mm;
            [self.centre_mm[0] + distance * cos, self.centre_mm[1] + distance * sin, sample.height_mm]
        })
    }
}

/// All points, section after section.
pub(super) fn points(forms: &[Form]) -> Vec<Point> {
    forms.iter().flat_map(Form::points).collect()
}

/// A line through values at heights, by least squares: value at the middle height, and slope.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Line {
    middle_mm: f64,
    value: f64,
    pub(super) slope: f64,
}

impl Line {
    pub(super) fn at(&self, height_mm: f64) -> f64 {
        self.value + self.slope * (height_mm - self.middle_mm)
    }
}

/// The straight line of least squares through (height, value).
pub(super) fn line(places: &[(f64, f64)]) -> Line {
    let n = places.len() as f64;
    let middle_mm = places.iter().map(|(z, _)| z).sum::<f64>() / n;
    let value = places.iter().map(|(_, v)| v).sum::<f64>() / n;
    let across: f64 = places.iter().map(|(z, v)| (z - middle_mm) * (v - value)).sum();
    let along: f64 = places.iter().map(|(z, _)| (z - middle_mm) * (z - middle_mm)).sum();
    Line { middle_mm, value, slope: if along > 0.0 { across / along } else { 0.0 } }
}

/// The second-degree part of the radii: how much larger the radius is in the middle than at the ends, and the polynomial
/// in the share of half the length that has no straight part by least squares.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(clippy::struct_field_names, reason = "units stand in the name")]
pub(super) struct Barrel {
    /// Radius in the middle less that at the ends, mm.
    pub(super) rise_mm: f64,
    middle_mm: f64,
    half_mm: f64,
}

impl Barrel {
    /// What it adds to the radius at a height, but for a straight line, mm.
    fn at(&self, height_mm: f64) -> f64 {
        let u = (height_mm - self.middle_mm) / self.half_mm;
        -self.rise_mm * u * u
    }
}

/// Of three sections or more: the parabola of least squares through the radii.
pub(super) fn barrel(forms: &[Form]) -> Option<Barrel> {
    let (first, last) = (forms.first()?, forms.last()?);
    if forms.len() < 3 {
        return None;
    }
    let (middle_mm, half_mm) =
        (f64::midpoint(first.height_mm, last.height_mm), 0.5 * (last.height_mm - first.height_mm));
    let share = |form: &Form| (form.height_mm - middle_mm) / half_mm;
    // u² less its line is orthogonal to lines: its coefficient needs no system.
    let squares = line(&forms.iter().map(|f| (f.height_mm, share(f) * share(f))).collect::<Vec<_>>());
    let bowed = |form: &Form| share(form) * share(form) - squares.at(form.height_mm);
    let size: f64 = forms.iter().map(|f| bowed(f) * bowed(f)).sum();
    let mean = forms.iter().map(|f| f.radius_mm).sum::<f64>() / forms.len() as f64;
    let part: f64 = forms.iter().map(|f| bowed(f) * (f.radius_mm - mean)).sum();
    (size > 1e-9).then(|| Barrel { rise_mm: -part / size, middle_mm, half_mm })
}

/// The sections with a part taken out.
pub(super) fn without(forms: &[Form], part: PartKind) -> Option<Vec<Form>> {
    let mut left = forms.to_vec();
    match part {
        PartKind::Roundness => left.iter_mut().flat_map(|f| &mut f.samples).for_each(|sample| sample.off_mm = 0.0),
        PartKind::Taper => {
            let radii = line(&forms.iter().map(|f| (f.height_mm, f.radius_mm)).collect::<Vec<_>>());
            for form in &mut left {
                form.radius_mm -= radii.slope * (form.height_mm - radii.middle_mm);
            }
        }
        PartKind::Barrel => {
            let barrel = barrel(forms)?;
            for form in &mut left {
                form.radius_mm -= barrel.at(form.height_mm);
            }
        }
        PartKind::Bend => {
            if forms.len() < 3 {
                return None;
            }
            for k in [0, 1] {
                let centres = line(&forms.iter().map(|f| (f.height_mm, f.centre_mm[k])).collect::<Vec<_>>());
                for form in &mut left {
                    form.centre_mm[k] = centres.at(form.height_mm);
                }
            }
        }
    }
    Some(left)
}
