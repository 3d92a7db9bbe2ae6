//! Rules between the fields of a shaft and what holds it.

use super::{DIAMETER_MM, Segment, Shaft, Support, places};
use crate::calculator::{Finding, Violations};
use crate::material;

/// Codes of the faults found here.
pub(crate) const CODES: &[&str] = &[
    "no_segments",
    "unknown_material",
    "elastic_constants_missing",
    "bad_bore",
    "stock_below_finish",
    "gap_of_two_sided_rest",
    "support_outside_shaft",
    "duplicate_support",
    "unstable_support",
];

/// Codes of the faults of supports alone.
pub(crate) const SUPPORT_CODES: &[&str] =
    &["gap_of_two_sided_rest", "support_outside_shaft", "duplicate_support", "unstable_support"];

/// Faults of the shaft, which stands at `/shaft`.
pub(crate) fn shaft(shaft: &Shaft, violations: &mut Violations) {
    violations.require(!shaft.segments.is_empty(), || Finding::new("no_segments", "/shaft/segments"));
    for (i, segment) in shaft.segments.iter().enumerate() {
        check_segment(i, segment, violations);
    }
    match &shaft.material {
        Some(id) => violations.require(material::find(id).is_some(), || {
            Finding::new("unknown_material", "/shaft/material")
                .with("id", id.clone())
                .with("known", material::library().iter().map(|m| m.id).collect::<Vec<_>>())
        }),
        None => violations.require(shaft.youngs_modulus_n_per_mm2.is_some(), || {
            Finding::new("elastic_constants_missing", "/shaft/youngs_modulus_n_per_mm2")
        }),
    }
}

/// What a diameter that cannot be leaves open is no fault of bore or blank.
fn check_segment(i: usize, segment: &Segment, violations: &mut Violations) {
    if !segment.has_diameter() {
        return;
    }
    let at = |field: &str| format!("/shaft/segments/{i}/{field}");
    violations.require(segment.bore_diameter_mm < segment.diameter_mm, || {
        Finding::new("bad_bore", at("bore_diameter_mm"))
            .measured(segment.bore_diameter_mm, segment.diameter_mm, "mm")
            .with("minimum", 0.0)
            .with("below", segment.diameter_mm)
    });
    violations.require(segment.stock_mm() >= segment.diameter_mm, || {
        Finding::new("stock_below_finish", at("stock_diameter_mm"))
            .measured(segment.stock_mm(), segment.diameter_mm, "mm")
            .within(segment.diameter_mm, *DIAMETER_MM.end())
    });
}

/// Faults of the supports, which stand at `/supports`.
pub(crate) fn supports(shaft: &Shaft, supports: &[Support], violations: &mut Violations) {
    // Where a length is impossible nobody knows what stands beside the shaft.
    let length = shaft.known_length_mm();
    let mut seen: Vec<f64> = Vec::new();
    for (i, support) in supports.iter().enumerate() {
        if let Support::SteadyRest { one_sided: false, gap_um, .. }
        | Support::FollowRest { one_sided: false, gap_um, .. } = support
        {
            violations.require(*gap_um <= 0.0, || {
                Finding::new("gap_of_two_sided_rest", format!("/supports/{i}/gap_um"))
                    .measured(*gap_um, 0.0, "um")
                    .within(0.0, 0.0)
            });
        }
        let Some(z) = support.station_mm() else { continue };
        if let Some(length) = length {
            violations.require(places::within(z, [0.0, length]), || {
                beside("support_outside_shaft", format!("/supports/{i}/z_mm"), z, length)
            });
        }
        violations.require(!seen.iter().any(|other| places::same(*other, z)), || {
            Finding::new("duplicate_support", format!("/supports/{i}/z_mm")).value(z, "mm")
        });
        seen.push(z);
    }
    let chuck = supports.iter().any(|s| matches!(s, Support::Chuck { .. }));
    let carrying = supports.iter().filter(|s| s.carries()).count();
    violations
        .require(chuck || carrying >= 2, || Finding::new("unstable_support", "/supports").with("carrying", carrying));
}

/// What stands beside the shaft, with the end that it lies beyond as the limit.
pub(crate) fn beside(code: &'static str, pointer: String, z_mm: f64, length_mm: f64) -> Finding {
    let end = if z_mm < 0.0 { 0.0 } else { length_mm };
    Finding::new(code, pointer).measured(z_mm, end, "mm").within(0.0, length_mm)
}
