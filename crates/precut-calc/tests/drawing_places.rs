//! Places and lengths are decimals of a drawing: no valid drawing is refused, a place that differs by rounding is treated
//! alike, and one that is wrong by a digit is still refused.
//!
//! The drawings are made in whole units of their last digit and written as text, as a person types them.
#![allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, missing_docs)]

use crate::cases::{Dice, answer, case, count, faults};
use precut_calc::deflection_compensation::DeflectionCompensation;
use precut_calc::feed_schedule::FeedSchedule;
use serde_json::{Value, json};

/// A drawing in units of its last digit.
struct Drawing {
    digits: u32,
    lengths: Vec<u64>,
    /// A rest, where there is one.
    rest: Option<u64>,
    /// Ends of touching zones from 0 to the whole length.
    zones: Vec<u64>,
    /// Stations, ascending, with both ends.
    stations: Vec<u64>,
}

impl Drawing {
    fn random(dice: &mut Dice) -> Self {
        let digits = u32::try_from(dice.whole(0, 4)).unwrap();
        let unit = 10_u64.pow(digits);
        let segments = dice.whole(1, 7);
        let lengths: Vec<u64> = (0..segments).map(|_| dice.whole(5 * unit, 400 * unit)).collect();
        let whole: u64 = lengths.iter().sum();
        let ends: Vec<u64> = lengths.iter().scan(0, |z, l| Some((*z += l, *z).1)).collect();
        let rest = dice.percent(40).then(|| match ends.len() {
            // On a step as often as beside one.
            n if n > 1 && dice.percent(50) => ends[usize::try_from(dice.whole(0, n as u64 - 2)).unwrap()],
            _ => dice.whole(unit, whole - unit),
        });
        let mut zones = vec![0, whole];
        zones.extend((0..dice.whole(0, 3)).map(|_| dice.whole(unit, whole - unit)));
        zones.extend(&ends[..ends.len() - 1]);
        let mut stations = zones.clone();
        stations.extend((0..dice.whole(5, 20)).map(|_| dice.whole(0, whole)));
        for places in [&mut zones, &mut stations] {
            places.sort_unstable();
            places.dedup();
        }
        Self { digits, lengths, rest, zones, stations }
    }

    fn whole(&self) -> u64 {
        self.lengths.iter().sum()
    }

    /// A number of units as it is typed.
    fn typed(&self, units: u64) -> f64 {
        let unit = 10_u64.pow(self.digits);
        let width = self.digits as usize;
        let text = match width {
            0 => format!("{units}"),
            _ => format!("{}.{:0width$}", units / unit, units % unit),
        };
        text.parse().unwrap()
    }

    fn shaft(&self) -> Value {
        let segment = |(i, length): (usize, &u64)| {
            let diameter = [40.0, 38.5, 42.25][i % 3];
            json!({ "length_mm": self.typed(*length), "diameter_mm": diameter, "stock_diameter_mm": diameter + 2.0 })
        };
        let segments: Vec<Value> = self.lengths.iter().enumerate().map(segment).collect();
        json!({ "segments": segments, "youngs_modulus_n_per_mm2": 210_000.0 })
    }

    fn supports(&self) -> Value {
        let centre =
            |units: u64, c: f64| json!({ "kind": "centre", "z_mm": self.typed(units), "compliance_um_per_n": c });
        let mut supports = vec![centre(0, 0.03), centre(self.whole(), 0.05)];
        supports.extend(
            self.rest.map(|z| json!({ "kind": "steady_rest", "z_mm": self.typed(z), "compliance_um_per_n": 0.03 })),
        );
        json!(supports)
    }

    fn deflection(&self) -> Value {
        let z_mm: Vec<f64> = self.stations.iter().map(|z| self.typed(*z)).collect();
        json!({
            "shaft": self.shaft(), "supports": self.supports(),
            "force": { "kind": "constant", "passive_n": 100.0 },
            "cut": { "feed_mm_per_rev": 0.2, "speed_m_per_min": 100.0 },
            "stations": { "kind": "list", "z_mm": z_mm }, "detail": "profile"
        })
    }

    fn schedule(&self) -> Value {
        let zone = |(i, ends): (usize, &[u64])| {
            json!({ "id": format!("z{i}"), "z_start_mm": self.typed(ends[0]), "z_end_mm": self.typed(ends[1]),
                    "diameter_mm": 40.0, "depth_mm": 1.0, "deflection_max_um": 400.0 })
        };
        let zones: Vec<Value> = self.zones.windows(2).enumerate().map(zone).collect();
        json!({
            "shaft": self.shaft(), "supports": self.supports(), "zones": zones,
            "models": { "force_y": { "constant": 7.0, "feed_exponent": 0.6, "depth_exponent": 0.9 } },
            "limits": { "feed_min_mm_per_rev": 0.02, "feed_max_mm_per_rev": 0.5,
                        "speed_min_m_per_min": 80.0, "speed_max_m_per_min": 350.0 },
            "objective": { "kind": "time" }
        })
    }
}

/// Codes of what is held against both jobs of a drawing.
fn held_against(deflection: &Value, schedule: &Value) -> Vec<&'static str> {
    let of_deflection = faults::<DeflectionCompensation>(deflection);
    let of_schedule = faults::<FeedSchedule>(schedule);
    of_deflection.into_iter().chain(of_schedule).map(|finding| finding.code).collect()
}

/// Moves the number at every pointer by some units of its last binary digit.
fn nudged(job: &Value, pointers: &[String], dice: &mut Dice) -> Value {
    let mut job = job.clone();
    for pointer in pointers {
        let number = job.pointer_mut(pointer).unwrap();
        let z = number.as_f64().unwrap();
        let steps = i64::try_from(dice.whole(0, 8)).unwrap() - 4;
        // Below 0 there is no place, and 0 has no last digit to speak of.
        if z > 0.0 {
            *number = json!(f64::from_bits(z.to_bits().wrapping_add_signed(steps)));
        }
    }
    job
}

fn pointers(job: &Value, list: &str, fields: &[&str]) -> Vec<String> {
    let count = job.pointer(list).map_or(0, |list| list.as_array().unwrap().len());
    (0..count).flat_map(|i| fields.iter().map(move |field| format!("{list}/{i}{field}"))).collect()
}

#[test]
fn no_decimal_drawing_is_refused_and_its_neighbour_by_rounding_is_treated_alike() {
    let mut dice = Dice(23);
    for number in 0..count(20_000) {
        let drawing = Drawing::random(&mut dice);
        let (deflection, schedule) = (drawing.deflection(), drawing.schedule());
        assert!(held_against(&deflection, &schedule).is_empty(), "drawing {number}: {deflection} {schedule}");
        let mut of_deflection = pointers(&deflection, "/supports", &["/z_mm"]);
        of_deflection.extend(pointers(&deflection, "/stations/z_mm", &[""]));
        of_deflection.extend(pointers(&deflection, "/shaft/segments", &["/length_mm"]));
        let mut of_schedule = pointers(&schedule, "/supports", &["/z_mm"]);
        of_schedule.extend(pointers(&schedule, "/zones", &["/z_start_mm", "/z_end_mm"]));
        let near = (nudged(&deflection, &of_deflection, &mut dice), nudged(&schedule, &of_schedule, &mut dice));
        assert!(held_against(&near.0, &near.1).is_empty(), "drawing {number}, nudged: {} {}", near.0, near.1);
        // One in twenty is answered, too.
        if number % 20 == 0 {
            let solved = |job: &Value| answer::<DeflectionCompensation>(job).unwrap().output.stations;
            let (typed, near) = (solved(&deflection), solved(&near.0));
            let depths = typed.depth_mm.iter().zip(&near.depth_mm).zip(&typed.commanded_diameter_mm);
            for (((a, b), command), other) in depths.zip(&near.commanded_diameter_mm) {
                assert!((a - b).abs() < 1e-9 && (command.unwrap() - other.unwrap()).abs() < 1e-9, "drawing {number}");
            }
        }
    }
}

#[test]
fn a_place_that_is_wrong_by_a_digit_is_still_refused() {
    let mut dice = Dice(32);
    for number in 0..count(20_000) {
        let drawing = Drawing::random(&mut dice);
        let beyond = drawing.typed(drawing.whole() + dice.whole(1, 3));
        let (mut deflection, mut schedule) = (drawing.deflection(), drawing.schedule());
        deflection["supports"][1]["z_mm"] = json!(beyond);
        schedule["supports"][1]["z_mm"] = json!(beyond);
        let said = held_against(&deflection, &schedule);
        assert_eq!(said, ["support_outside_shaft"; 2], "drawing {number}: {deflection}");

        let (mut deflection, mut schedule) = (drawing.deflection(), drawing.schedule());
        let last = (drawing.stations.len() - 1, drawing.zones.len() - 2);
        deflection["stations"]["z_mm"][last.0] = json!(beyond);
        schedule["zones"][last.1]["z_end_mm"] = json!(beyond);
        let said = held_against(&deflection, &schedule);
        assert_eq!(said, ["station_outside_shaft", "zone_outside_shaft"], "drawing {number}: {schedule}");

        // A digit inside is another place: neither refused nor the end.
        let (mut deflection, mut schedule) = (drawing.deflection(), drawing.schedule());
        let inside = drawing.typed(drawing.whole() - 1);
        deflection["supports"].as_array_mut().unwrap().push(json!({ "kind": "steady_rest", "z_mm": inside }));
        schedule["supports"].as_array_mut().unwrap().push(json!({ "kind": "steady_rest", "z_mm": inside }));
        if drawing.rest != Some(drawing.whole() - 1) {
            assert!(held_against(&deflection, &schedule).is_empty(), "drawing {number}: {deflection}");
        }
        if drawing.zones.len() > 2 {
            let mut schedule = drawing.schedule();
            schedule["zones"][1]["z_start_mm"] = json!(drawing.typed(drawing.zones[1] - 1));
            let said = held_against(&drawing.deflection(), &schedule);
            assert_eq!(said, ["zones_overlap"], "drawing {number}: {schedule}");
        }
    }
}

#[test]
fn the_drawings_that_were_refused_are_answered() {
    let job = case("deflection-compensation/deflection-roundoff-length.json");
    assert!(answer::<DeflectionCompensation>(&job).is_ok());
    let job = case("feed-schedule/support-at-decimal-end.json");
    assert!(answer::<FeedSchedule>(&job).is_ok());
}

#[test]
fn a_blank_is_held_against_the_bore_at_its_place() {
    let job = case("deflection-compensation/bore-profile.json");
    assert!(answer::<DeflectionCompensation>(&job).is_ok());
    let said = |row: usize, z: f64, diameter: f64| {
        let mut job = job.clone();
        job["stock_profile"][row] = json!({ "z_mm": z, "diameter_mm": diameter });
        let faults = faults::<DeflectionCompensation>(&job);
        faults.into_iter().map(|fault| (fault.code, fault.pointer)).collect::<Vec<_>>()
    };
    let refused = |row: usize| vec![("bad_diameter", format!("/stock_profile/{row}/diameter_mm"))];
    // The bore of 50 begins at 200: a row there, one beyond, and a line that comes to the step below 50.
    assert_eq!(said(1, 200.0, 42.0), refused(1));
    assert_eq!(said(2, 200.1, 49.9), refused(2));
    assert_eq!(said(2, 203.0, 82.0), refused(2));
    assert_eq!(said(2, 200.1, 82.0), []);
    assert_eq!(said(0, 0.0, 10.0), refused(0));
    assert_eq!(said(0, 0.0, 10.1), []);
}
