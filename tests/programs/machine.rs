//! A lathe of our own: reads G-code text and turns a blank with it that yields. It shares nothing with the product.

use std::f64::consts::PI;

use serde_json::Value;

/// What a column lost or kept; columns stand beside steps, never on them.
#[derive(Debug, Clone)]
pub(crate) struct Column {
    pub(crate) z: f64,
    pub(crate) r: f64,
    /// Compliance at the tool with the finished section of every pass, mm/N.
    pub(crate) w: Vec<f64>,
    /// Cutting speed at 1 rev/min is pi D/1000: the diameter that counts, by pass.
    pub(crate) speed_diameter: Vec<f64>,
}

/// P = C t^x s^y v^n, N.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Force {
    pub(crate) c: f64,
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) n: f64,
}

/// A shaft of stepped sections on two centres: deflection by the unit load, integrated piece by piece.
pub(crate) struct Shaft {
    /// Length and diameter of every segment.
    pub(crate) segments: Vec<(f64, f64)>,
    pub(crate) e: f64,
    /// Left centre, right centre, carriage, mm/N.
    pub(crate) springs: [f64; 3],
}

impl Shaft {
    pub(crate) fn length(&self) -> f64 {
        self.segments.iter().map(|segment| segment.0).sum()
    }

    /// Compliance at a station under a load there.
    pub(crate) fn compliance(&self, a: f64) -> f64 {
        let l = self.length();
        let (left, right) = ((l - a) / l, a / l);
        let mut at = 0.0;
        let mut bent = 0.0;
        for &(length, d) in &self.segments {
            let ei = self.e * PI * d.powi(4) / 64.0;
            // M = left x before the load, right (l - x) behind it: the integral of M^2 is a cube.
            let (from, to) = (at, at + length);
            let (p, q) = (from.min(a), to.min(a));
            bent += left * left * (q.powi(3) - p.powi(3)) / 3.0 / ei;
            let (p, q) = (from.max(a), to.max(a));
            bent += right * right * ((l - p).powi(3) - (l - q).powi(3)) / 3.0 / ei;
            at = to;
        }
        bent + self.springs[0] * left * left + self.springs[1] * right * right + self.springs[2]
    }
}

/// What a program did.
#[derive(Debug, Default)]
pub(crate) struct Done {
    /// Radii of all columns after every pass.
    pub(crate) after_pass: Vec<Vec<f64>>,
    /// Worst approach of a rapid to the box of the clearances: how far it is inside, mm, with the line.
    pub(crate) inside: Option<(f64, String)>,
    /// Longest way fed in the air between two cuts or rapids, mm.
    pub(crate) longest_air: f64,
    /// Way along Z between stops, of columns: (lowest, highest), at the feed or in rapid motion, with what was said at the stop.
    pub(crate) legs: Vec<Leg>,
    pub(crate) feed_time_min: f64,
    pub(crate) air_time_min: f64,
}

#[derive(Debug, Clone)]
pub(crate) struct Leg {
    pub(crate) reason: String,
    pub(crate) low: f64,
    pub(crate) high: f64,
    /// Where the first of the moves that cut begins.
    pub(crate) begins: Option<f64>,
    /// Length over feed and speed of the moves that cut: (mm, mm/rev, m/min, rev/min).
    pub(crate) cuts: Vec<(f64, f64, f64, f64)>,
}

impl Leg {
    fn of(reason: String) -> Self {
        Self { reason, low: f64::INFINITY, high: f64::NEG_INFINITY, begins: None, cuts: Vec::new() }
    }
}

pub(crate) struct Lathe {
    pub(crate) columns: Vec<Column>,
    pub(crate) force: Option<Force>,
    /// Station of Z0.
    pub(crate) zero: f64,
    /// Radial and axial distance that rapids keep.
    pub(crate) box_mm: (f64, f64),
    pub(crate) limit_rpm: f64,
    /// The cutting speed counts at the diameter that is cut, not at the blank's.
    pub(crate) at_finish: bool,
}

struct State {
    x: Option<f64>,
    z: Option<f64>,
    feed: f64,
    rpm: Option<f64>,
    speed: f64,
    pass: usize,
    air: f64,
    comment: String,
}

impl Lathe {
    pub(crate) fn run(&mut self, text: &str) -> Done {
        let mut done = Done::default();
        let mut now =
            State { x: None, z: None, feed: 0.0, rpm: None, speed: 0.0, pass: 0, air: 0.0, comment: String::new() };
        done.legs.push(Leg::of(String::new()));
        for line in text.lines() {
            self.line(line, &mut now, &mut done);
        }
        done.longest_air = done.longest_air.max(now.air);
        done.after_pass.push(self.columns.iter().map(|column| column.r).collect());
        done
    }

    fn line(&mut self, line: &str, now: &mut State, done: &mut Done) {
        let line = line.trim();
        if line.starts_with('(') || line.starts_with(';') {
            let said = line.trim_matches(|c| "(); ".contains(c));
            if let Some(pass) =
                said.strip_prefix("pass ").and_then(|rest| rest.split(' ').next()?.parse::<usize>().ok())
            {
                if pass > 1 {
                    done.after_pass.push(self.columns.iter().map(|column| column.r).collect());
                }
                now.pass = pass - 1;
            }
            now.comment.push_str(said);
            now.comment.push(' ');
            return;
        }
        let mut motion = None;
        let (mut x, mut z) = (None, None);
        for word in line.split(' ') {
            let value = || word[1..].parse::<f64>().unwrap();
            match (word.chars().next(), word) {
                (_, "G0") => motion = Some(false),
                (_, "G1") => motion = Some(true),
                (_, "M0") => {
                    let reason = std::mem::take(&mut now.comment);
                    // The way on behind the stop is another one.
                    done.longest_air = done.longest_air.max(now.air);
                    now.air = 0.0;
                    done.legs.push(Leg::of(reason));
                }
                (Some('X'), _) => x = Some(0.5 * value()),
                (Some('Z'), _) => z = Some(value() + self.zero),
                (Some('F'), _) => now.feed = value(),
                (Some('S'), _) if line.starts_with("G97") => now.rpm = Some(value()),
                (Some('S'), _) if line.starts_with("G96") => {
                    now.rpm = None;
                    now.speed = value();
                }
                _ => {}
            }
        }
        if let Some(feeds) = motion {
            now.comment.clear();
            let from = (now.x, now.z);
            (now.x, now.z) = (x.or(now.x), z.or(now.z));
            // At first the tool stands somewhere.
            let (Some(x), Some(z)) = (now.x, now.z) else { return };
            let to = (x, z);
            let from = (from.0.unwrap_or(to.0), from.1.unwrap_or(to.1));
            let leg = done.legs.last_mut().unwrap();
            for at in [from.1, to.1] {
                (leg.low, leg.high) = (leg.low.min(at), leg.high.max(at));
            }
            if feeds {
                self.feed(from, to, now, done);
            } else {
                done.longest_air = done.longest_air.max(now.air);
                now.air = 0.0;
                self.rapid(from, to, line, done);
            }
        }
    }

    fn rapid(&self, from: (f64, f64), to: (f64, f64), line: &str, done: &mut Done) {
        let (low, high) = (from.1.min(to.1) - self.box_mm.1, from.1.max(to.1) + self.box_mm.1);
        let lowest = from.0.min(to.0);
        for column in self.columns.iter().filter(|column| low < column.z && column.z < high) {
            let inside = (column.r + self.box_mm.0 - lowest).min(column.z - low).min(high - column.z);
            if inside > done.inside.as_ref().map_or(0.0, |inside| inside.0) {
                done.inside = Some((inside, format!("{line} at z {:.3}, radius {:.4}", column.z, column.r)));
            }
        }
    }

    fn feed(&mut self, from: (f64, f64), to: (f64, f64), now: &mut State, done: &mut Done) {
        let (low, high) = (from.1.min(to.1), from.1.max(to.1));
        let length = (to.0 - from.0).hypot(to.1 - from.1);
        let (mut cut, mut all) = (0.0, 0.0);
        let mut stands = 0.0_f64;
        for column in &mut self.columns {
            let near = (column.z - to.1).abs() < 0.02;
            if near {
                stands = stands.max(column.r);
            }
            if !(low < column.z && column.z < high) {
                continue;
            }
            all += 1.0;
            let command = from.0 + (column.z - from.1) / (to.1 - from.1) * (to.0 - from.0);
            let commanded = column.r - command;
            if commanded <= 0.0 {
                continue;
            }
            // A compensated command goes below the diameter that is left.
            let drawn = column.speed_diameter[now.pass];
            let counts = if self.at_finish { drawn.max(2.0 * command) } else { drawn };
            let speed = now.rpm.map_or(now.speed, |rpm| PI * counts * rpm / 1000.0);
            let t = match self.force {
                None => commanded,
                Some(force) => {
                    let k = column.w[now.pass] * force.c * now.feed.powf(force.y) * speed.powf(force.n);
                    let (mut a, mut b) = (0.0, commanded);
                    for _ in 0..60 {
                        let t = 0.5 * (a + b);
                        if t + k * t.powf(force.x) < commanded { a = t } else { b = t }
                    }
                    0.5 * (a + b)
                }
            };
            if t > 1e-7 {
                cut += 1.0;
                column.r -= t;
            }
        }
        let share = if all > 0.0 {
            cut / all
        } else if to.0 < from.0 && stands > to.0 {
            ((stands - to.0) / (from.0 - to.0)).min(1.0)
        } else {
            0.0
        };
        let air = (1.0 - share) * length;
        now.air += air;
        if share > 0.0 {
            done.longest_air = done.longest_air.max(now.air);
            now.air = 0.0;
        }
        let mean = from.0 + to.0;
        let rpm = now.rpm.unwrap_or((1000.0 * now.speed / (PI * mean)).min(self.limit_rpm));
        let time = length / (now.feed * rpm);
        done.feed_time_min += time;
        done.air_time_min += (1.0 - share) * time;
        if share > 0.0 {
            let leg = done.legs.last_mut().unwrap();
            leg.begins.get_or_insert(from.1);
            leg.cuts.push((share * length, now.feed, rpm, PI * mean * rpm / 1000.0));
        }
    }
}

/// Number of a JSON value.
pub(crate) fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}
