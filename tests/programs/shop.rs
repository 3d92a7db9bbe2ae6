//! Random jobs of a shop. The generators know nothing of how the product makes a program.

use serde_json::{Value, json};

use crate::machine::{Column, Force, Lathe, Shaft};

/// A small generator (SplitMix64).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / 9_007_199_254_740_992.0
    }

    pub(crate) fn within(&mut self, low: f64, high: f64) -> f64 {
        low + self.next() * (high - low)
    }

    /// A drawing's number.
    fn decimal(&mut self, low: f64, high: f64, decimals: i32) -> f64 {
        let scale = 10.0_f64.powi(decimals);
        (self.within(low, high) * scale).round() / scale
    }

    pub(crate) fn one_of<'a, T>(&mut self, of: &'a [T]) -> &'a T {
        let i = (self.next() * of.len() as f64) as usize;
        &of[i.min(of.len() - 1)]
    }

    pub(crate) fn chance(&mut self, share: f64) -> bool {
        self.next() < share
    }
}

/// A segment: length, drawing, blank.
type Segment = (f64, f64, f64);

/// A job, and all that a lathe needs to know of it.
pub(crate) struct Shop {
    pub(crate) job: Value,
    pub(crate) segments: Vec<Segment>,
    /// Diameters of the passes; empty with one cut.
    pub(crate) passes: Vec<f64>,
    pub(crate) shaft: Shaft,
    pub(crate) force: Option<Force>,
    pub(crate) rest: Option<f64>,
    pub(crate) clearance: (f64, f64),
}

const FORCE: Force = Force { c: 2430.0, x: 0.9, y: 0.6, n: -0.3 };
const DIALECTS: [&str; 5] = ["fanuc", "fanuc_a", "fanuc_c", "siemens", "linuxcnc"];
/// On the diameter, and along the shaft.
const CLEARANCES: [(f64, f64); 5] = [(5.0, 2.0), (5.0, 2.0), (2.0, 5.0), (0.0, 0.0), (1.0, 0.5)];

fn segments(random: &mut Random, bar: bool) -> Vec<Segment> {
    let count = *random.one_of(&[1, 2, 3, 3, 4, 5]);
    let decimals = *random.one_of(&[0, 1, 2, 3]);
    let middle = random.within(25.0, 70.0);
    let mut segments: Vec<Segment> = Vec::new();
    for i in 0..count {
        let length = random.decimal(20.0, 9.0 * middle / f64::from(count) + 30.0, decimals);
        // Neighbours of one drawing, of fits a few hundredths apart, or of shoulders.
        let near = segments.last().map_or(middle, |last: &Segment| last.1);
        let drawing = match (i, random.within(0.0, 1.0)) {
            (1.., u) if u < 0.35 => near,
            (1.., u) if u < 0.5 => ((near + random.within(-0.03, 0.03)) * 1000.0).round() / 1000.0,
            _ => random.decimal(0.7 * middle, middle, 2),
        };
        let allowance = if !bar && count > 1 && random.chance(0.2) { 0.0 } else { random.decimal(0.4, 4.0, 2) };
        segments.push((length, drawing, drawing + allowance));
    }
    if bar {
        let widest = segments.iter().map(|segment| segment.1).fold(0.0, f64::max);
        let stock = ((widest + random.within(0.5, 4.0)) * 10.0).ceil() / 10.0;
        for segment in &mut segments {
            segment.2 = stock;
        }
    } else if segments.iter().all(|segment| segment.2 <= segment.1) {
        segments[0].2 = segments[0].1 + 1.0;
    }
    segments
}

fn springs(random: &mut Random) -> [f64; 3] {
    // um/N
    [random.decimal(0.005, 0.03, 4), random.decimal(0.01, 0.05, 4), random.decimal(0.005, 0.03, 4)]
}

fn shaft_json(segments: &[Segment]) -> Value {
    let segments: Vec<Value> = segments
        .iter()
        .map(|(length, d, stock)| json!({ "length_mm": length, "diameter_mm": d, "stock_diameter_mm": stock }))
        .collect();
    json!({ "segments": segments, "youngs_modulus_n_per_mm2": 210_000.0 })
}

fn supports(random: &mut Random, length: f64, springs: [f64; 3]) -> (Value, Option<f64>) {
    let mut supports = vec![
        json!({ "kind": "centre", "z_mm": 0.0, "compliance_um_per_n": springs[0] }),
        json!({ "kind": "centre", "z_mm": length, "compliance_um_per_n": springs[1] }),
    ];
    // A rest so open that it never touches: in the tool's way all the same.
    let rest = random.chance(0.25).then(|| random.decimal(0.15 * length, 0.85 * length, 1));
    if let Some(z) = rest {
        supports.insert(1, json!({ "kind": "steady_rest", "z_mm": z, "one_sided": true, "gap_um": 5000.0, "compliance_um_per_n": 0.02 }));
    }
    (json!(supports), rest)
}

impl Shop {
    pub(crate) fn compensation(seed: u64) -> Self {
        let random = &mut Random(seed);
        let several = random.chance(0.4);
        let bar = several || random.chance(0.3);
        let segments = segments(random, bar);
        let length: f64 = segments.iter().map(|segment| segment.0).sum();
        let springs = springs(random);
        let (supports, rest) = supports(random, length, springs);
        let clearance = *random.one_of(&CLEARANCES);
        let mut job = json!({
            "shaft": shaft_json(&segments),
            "supports": supports,
            "carriage": { "compliance_um_per_n": springs[2] },
            "force": { "kind": "power_law", "passive":
                { "coefficient": FORCE.c, "depth_exponent": FORCE.x, "feed_exponent": FORCE.y, "speed_exponent": FORCE.n } },
            "cut": {
                "feed_mm_per_rev": random.decimal(0.1, 0.4, 2),
                "feed_direction": random.one_of(&["to_headstock", "to_tailstock"]),
            },
            "tolerance": { "form_um": random.one_of(&[5.0, 10.0, 20.0]) },
            // The lathe's shaft is slender and turned.
            "include": { "mode": "as_stated" },
            "program": {
                "dialect": random.one_of(&DIALECTS),
                "zero": random.one_of(&["right_face", "left_face"]),
                "clearance_x_mm": clearance.0,
                "clearance_z_mm": clearance.1,
                "spindle_limit_rpm": 20_000.0,
            },
        });
        if random.chance(0.5) {
            job["cut"]["speed_m_per_min"] = json!(random.decimal(80.0, 200.0, 0));
        } else {
            job["cut"]["spindle_speed_rpm"] = json!(random.decimal(300.0, 1500.0, 0));
        }
        if random.chance(0.3) {
            job["stations"] = json!({ "kind": "per_zone", "count": random.one_of(&[2, 7, 50, 400]) });
        }
        if random.chance(0.3) {
            job["program"]["tool_number"] = json!(3);
            job["program"]["coolant"] = json!(true);
            job["program"]["safe_position"] = json!({ "x_diameter_mm": 250.0, "z_mm": length + 100.0 });
        }
        let mut passes = Vec::new();
        if several {
            let stock = segments[0].2;
            let least = segments.iter().map(|segment| segment.1).fold(f64::INFINITY, f64::min);
            let count = *random.one_of(&[1, 2, 3]);
            let step = (stock - least) / f64::from(count);
            for k in 1..=count {
                let d = if k == count { least } else { ((stock - f64::from(k) * step) * 100.0).round() / 100.0 };
                passes.push(d);
            }
            let of = |random: &mut Random, d: &f64| json!({ "diameter_mm": d, "feed_mm_per_rev": random.decimal(0.1, 0.4, 2), "compensated": random.chance(0.6) });
            job["passes"] = passes.iter().map(|d| of(random, d)).collect();
        }
        let springs = springs.map(|um| um / 1000.0);
        let shaft = Shaft { segments: segments.iter().map(|s| (s.0, s.1)).collect(), e: 210_000.0, springs };
        Self { job, segments, passes, shaft, force: Some(FORCE), rest, clearance }
    }

    pub(crate) fn schedule(seed: u64) -> Self {
        let random = &mut Random(seed);
        let segments = segments(random, false);
        let length: f64 = segments.iter().map(|segment| segment.0).sum();
        let springs = springs(random);
        // A rest that holds makes another shaft: only where nothing yields.
        let yields = random.chance(0.7);
        let (mut supports, mut rest) = supports(random, length, springs);
        if rest.is_some() && yields {
            rest = None;
            supports.as_array_mut().unwrap().remove(1);
        } else if rest.is_some() {
            let object = supports[1].as_object_mut().unwrap();
            object.remove("one_sided");
            object.remove("gap_um");
        }
        let clearance = *random.one_of(&CLEARANCES);
        let mut zones = Vec::new();
        let mut from = 0.0;
        for (i, (segment, d, stock)) in segments.iter().enumerate() {
            if stock > d {
                let repeat = if random.chance(0.3) { 2.0 } else { 1.0 };
                zones.push(json!({
                    "id": format!("z{i}"), "z_start_mm": from, "z_end_mm": from + segment, "diameter_mm": d,
                    "depth_mm": (stock - d) / 2.0 / repeat, "repeat": repeat as u32,
                }));
            }
            from += segment;
        }
        let once = zones.iter().all(|zone| zone["repeat"] == json!(1));
        let mut job = json!({
            "shaft": shaft_json(&segments),
            "supports": supports,
            "carriage": { "compliance_um_per_n": springs[2] },
            "zones": zones,
            "models": { "tool_life": { "form": "log_log", "constant": random.within(11.0, 14.0), "speed_exponent": -2.0, "feed_exponent": -0.5 } },
            "limits": {
                "feed_min_mm_per_rev": 0.05, "feed_max_mm_per_rev": random.decimal(0.15, 0.4, 2),
                "speed_min_m_per_min": 30.0, "speed_max_m_per_min": random.decimal(80.0, 200.0, 0)
            },
            "objective": { "kind": "time", "tool_change_time_min": 1.0 },
            "feed_direction": random.one_of(&["to_headstock", "to_tailstock"]),
            "program": {
                "dialect": random.one_of(&DIALECTS),
                "zero": random.one_of(&["right_face", "left_face"]),
                "clearance_x_mm": clearance.0,
                "clearance_z_mm": clearance.1,
                "spindle_limit_rpm": 20_000.0,
            },
        });
        if yields {
            job["models"]["force_y"] = json!({
                "form": "log_log", "constant": FORCE.c.ln(), "feed_exponent": FORCE.y, "depth_exponent": FORCE.x, "speed_exponent": FORCE.n
            });
            if once && random.chance(0.5) {
                job["compensation"] = json!({});
            }
        }
        let springs = springs.map(|um| um / 1000.0);
        let shaft = Shaft { segments: segments.iter().map(|s| (s.0, s.1)).collect(), e: 210_000.0, springs };
        Self { job, segments, passes: Vec::new(), shaft, force: yields.then_some(FORCE), rest, clearance }
    }

    /// The lathe with the blank in it: a column every quarter of a millimetre and beside every step.
    pub(crate) fn lathe(&self) -> Lathe {
        let length = self.shaft.length();
        let passes = self.passes.len().max(1);
        let shafts: Vec<Shaft> = (0..passes)
            .map(|k| {
                let aim = self.passes.get(k).copied().unwrap_or(0.0);
                let segments = self.shaft.segments.iter().map(|&(length, d)| (length, d.max(aim))).collect();
                Shaft { segments, ..self.shaft }
            })
            .collect();
        let at_finish = self.job["zones"].is_array();
        let mut columns = Vec::new();
        let mut from = 0.0;
        for &(segment, d, stock) in &self.segments {
            let count = (segment / 0.5).ceil();
            let mut places: Vec<f64> = vec![from + 0.004, from + segment - 0.004];
            let mut k = 0.5;
            while k < count {
                // Never where two moves meet.
                places.push(from + segment * k / count + 0.000_123_456_7);
                k += 1.0;
            }
            places.sort_by(f64::total_cmp);
            for z in places {
                let before = |k: usize| match k {
                    _ if at_finish => d,
                    0 => stock,
                    _ => self.passes[k - 1].max(d).min(stock),
                };
                columns.push(Column {
                    z,
                    r: 0.5 * stock,
                    w: shafts.iter().map(|shaft| shaft.compliance(z)).collect(),
                    speed_diameter: (0..passes).map(before).collect(),
                });
            }
            from += segment;
        }
        let zero = if self.job["program"]["zero"] == json!("left_face") { 0.0 } else { length };
        let box_mm = ((self.clearance.0 / 2.0).max(0.1), self.clearance.1.max(0.1));
        Lathe { columns, force: self.force, zero, box_mm, limit_rpm: 20_000.0, at_finish }
    }

    /// Drawing radius at a column.
    pub(crate) fn drawing(&self, z: f64) -> f64 {
        let mut to = 0.0;
        for &(length, d, _) in &self.segments {
            to += length;
            if z < to {
                return 0.5 * d;
            }
        }
        0.5 * self.segments[self.segments.len() - 1].1
    }
}
