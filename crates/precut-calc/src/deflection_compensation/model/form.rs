//! Form and size of a turned profile: what the deviations along the shaft amount to.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A profile flatter than this is a cylinder, um.
const FLAT_UM: f64 = 0.1;
/// An extremum counts when the profile leaves it by more than this share of the range on both sides.
const HYSTERESIS_SHARE: f64 = 0.02;

/// Form and size of a profile of diameter errors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Form {
    /// Class of the form; null where a station has no value.
    pub class: Option<FormClass>,
    /// Largest minus smallest diameter error; null where a station has no value.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub form_error_um: Option<f64>,
    /// Middle between largest and smallest diameter error: what an offset of the tool removes.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub size_error_um: Option<f64>,
    /// Diameter error at the last station minus that at the first.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub taper_um: Option<f64>,
    /// The taper per metre of length between first and last station.
    #[schema(extensions(("x-unit" = json!("um/m"))))]
    pub taper_um_per_m: Option<f64>,
    /// How far the profile must leave an extremum for it to count.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub hysteresis_um: Option<f64>,
    /// Interior extrema that count, along the shaft.
    pub extrema: Vec<Extremum>,
    /// The largest diameter error.
    pub largest: Option<Deviation>,
    /// The smallest diameter error.
    pub smallest: Option<Deviation>,
}

/// Class of a form.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum FormClass {
    /// No deviation above 0.1 um.
    Cylinder,
    /// Thin end at the headstock.
    TaperToHeadstock,
    /// Thin end at the tailstock.
    TaperToTailstock,
    /// Thick in between.
    Barrel,
    /// Thin in between.
    Saddle,
    /// More than one extremum.
    Combination,
}

impl FormClass {
    /// Its name, as in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cylinder => "cylinder",
            Self::TaperToHeadstock => "taper_to_headstock",
            Self::TaperToTailstock => "taper_to_tailstock",
            Self::Barrel => "barrel",
            Self::Saddle => "saddle",
            Self::Combination => "combination",
        }
    }
}

/// An interior extremum of a profile.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Extremum {
    /// Thick or thin there.
    pub kind: ExtremumKind,
    /// Where.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub z_mm: f64,
    /// The diameter error there.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub diameter_error_um: f64,
}

/// Kind of an extremum.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ExtremumKind {
    /// Thick.
    Maximum,
    /// Thin.
    Minimum,
}

/// A diameter error and where it stands.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Deviation {
    /// Where.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub z_mm: f64,
    /// How much.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub diameter_error_um: f64,
}

impl Form {
    /// Form of the diameter errors `errors_um` at the ascending stations `z_mm` (`deflection/5`).
    pub(in crate::deflection_compensation) fn of(z_mm: &[f64], errors_um: &[Option<f64>]) -> Self {
        let at = |i: usize| Deviation { z_mm: z_mm[i], diameter_error_um: errors_um[i].unwrap_or(0.0) };
        let (largest, smallest) = extremes(errors_um).map(|(high, low)| (at(high), at(low))).unzip();
        let mut form = Self {
            class: None,
            form_error_um: None,
            size_error_um: None,
            taper_um: None,
            taper_um_per_m: None,
            hysteresis_um: None,
            extrema: Vec::new(),
            largest,
            smallest,
        };
        let (true, Some(high), Some(low)) = (errors_um.iter().all(Option::is_some), largest, smallest) else {
            return form;
        };
        let (high, low) = (high.diameter_error_um, low.diameter_error_um);
        let taper = at(errors_um.len() - 1).diameter_error_um - at(0).diameter_error_um;
        let length_mm = z_mm[z_mm.len() - 1] - z_mm[0];
        let hysteresis = (HYSTERESIS_SHARE * (high - low)).max(FLAT_UM);
        form.form_error_um = Some(high - low);
        form.size_error_um = Some(0.5 * (high + low));
        form.taper_um = Some(taper);
        form.taper_um_per_m = (length_mm > 0.0).then(|| taper / length_mm * 1000.0);
        form.hysteresis_um = Some(hysteresis);
        if high - low > FLAT_UM {
            form.extrema = interior_extrema(z_mm, errors_um, hysteresis);
        }
        form.class = Some(classify(high - low, taper, &form.extrema));
        form
    }

    /// The deviation of larger magnitude.
    pub(in crate::deflection_compensation) fn farthest(&self) -> Option<Deviation> {
        let (high, low) = (self.largest?, self.smallest?);
        Some(if high.diameter_error_um.abs() >= low.diameter_error_um.abs() { high } else { low })
    }
}

/// Indices of the first largest and the first smallest error.
fn extremes(errors: &[Option<f64>]) -> Option<(usize, usize)> {
    let first = errors.iter().position(Option::is_some)?;
    let start = (first, errors[first]?);
    let (mut high, mut low) = (start, start);
    for (i, error) in errors.iter().enumerate() {
        let Some(error) = *error else { continue };
        if error > high.1 {
            high = (i, error);
        }
        if error < low.1 {
            low = (i, error);
        }
    }
    Some((high.0, low.0))
}

fn classify(range_um: f64, taper_um: f64, extrema: &[Extremum]) -> FormClass {
    if range_um <= FLAT_UM {
        return FormClass::Cylinder;
    }
    match extrema {
        // Named after the thin end, toward which it tapers.
        [] if taper_um > 0.0 => FormClass::TaperToHeadstock,
        [] => FormClass::TaperToTailstock,
        [one] if one.kind == ExtremumKind::Maximum => FormClass::Barrel,
        [_] => FormClass::Saddle,
        _ => FormClass::Combination,
    }
}

/// Zigzag with hysteresis: an interior extremum counts only if the profile leaves it by more than
/// `hysteresis` on both sides.
fn interior_extrema(z_mm: &[f64], errors: &[Option<f64>], hysteresis: f64) -> Vec<Extremum> {
    let mut found = Vec::new();
    // The running highest and lowest since the last turn; which way the profile goes is open at first.
    let start = (0, errors.first().copied().flatten().unwrap_or(0.0));
    let (mut highest, mut lowest): ((usize, f64), (usize, f64)) = (start, start);
    let mut rising: Option<bool> = None;
    let extremum = |kind, (i, diameter_error_um): (usize, f64)| Extremum { kind, z_mm: z_mm[i], diameter_error_um };
    for (i, error) in errors.iter().enumerate() {
        let Some(e) = *error else { continue };
        if e > highest.1 {
            highest = (i, e);
        }
        if e < lowest.1 {
            lowest = (i, e);
        }
        match rising {
            None if e - lowest.1 > hysteresis => {
                // Nothing before stood higher by the hysteresis, or it would have been falling: no minimum yet.
                rising = Some(true);
                highest = (i, e);
            }
            None if highest.1 - e > hysteresis => {
                rising = Some(false);
                lowest = (i, e);
            }
            Some(true) if highest.1 - e > hysteresis => {
                found.push(extremum(ExtremumKind::Maximum, highest));
                rising = Some(false);
                lowest = (i, e);
            }
            Some(false) if e - lowest.1 > hysteresis => {
                found.push(extremum(ExtremumKind::Minimum, lowest));
                rising = Some(true);
                highest = (i, e);
            }
            _ => {}
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn class(errors: &[f64]) -> Option<FormClass> {
        let z: Vec<f64> = (0u32..).map(f64::from).take(errors.len()).collect();
        Form::of(&z, &errors.iter().copied().map(Some).collect::<Vec<_>>()).class
    }

    #[test]
    fn classes_are_named_after_what_a_machinist_sees() {
        assert_eq!(class(&[1.0, 1.05, 1.0]), Some(FormClass::Cylinder));
        assert_eq!(class(&[0.0, 1.0, 2.0]), Some(FormClass::TaperToHeadstock));
        assert_eq!(class(&[2.0, 1.0, 0.0]), Some(FormClass::TaperToTailstock));
        assert_eq!(class(&[0.0, 5.0, 1.0]), Some(FormClass::Barrel));
        assert_eq!(class(&[5.0, 0.0, 4.0]), Some(FormClass::Saddle));
        assert_eq!(class(&[5.0, 0.0, 4.0, 1.0]), Some(FormClass::Combination));
        assert_eq!(class(&[3.0, 0.0, 4.0, 1.0, 9.0]), Some(FormClass::Combination));
    }

    #[test]
    fn a_dip_within_the_hysteresis_does_not_count() {
        assert_eq!(class(&[0.0, 50.0, 100.0, 99.0, 60.0, 0.0]), Some(FormClass::Barrel));
        assert_eq!(class(&[1.0, 0.0, 50.0, 100.0]), Some(FormClass::TaperToHeadstock));
        assert_eq!(class(&[3.0, 0.0, 50.0, 100.0]), Some(FormClass::Saddle));
    }

    #[test]
    fn a_gap_has_no_class_but_known_extremes() {
        let form = Form::of(&[0.0, 1.0, 2.0], &[Some(1.0), None, Some(3.0)]);
        assert_eq!((form.class, form.form_error_um), (None, None));
        assert_eq!(form.largest.map(|d| d.z_mm), Some(2.0));
    }
}
