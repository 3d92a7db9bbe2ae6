//! Models with the effects that act on them: values, slopes, and the affine form that a program can hold (`feed/6.4`).

use crate::effects::{MachinabilityConditions, MachinabilityEffect as Effect};
use crate::machinability::{MachinabilityModel, ModelForm};

use crate::feed_schedule::job::formula::Written;
use crate::feed_schedule::job::input::Reference;
use crate::feed_schedule::job::remainder::{Stated, Table};

/// Exponent with which the feed marks and the rest of the roughness are joined (`diagnosis/5.16`).
const FLOOR_POWER: f64 = 8.0;

/// How an output bends over ln V and ln S.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::feed_schedule) enum Bend {
    /// Not at all: the form is exact everywhere.
    Straight,
    /// Upward: an upper limit on it is convex.
    Convex,
    /// Downward: a lower limit on it is convex.
    Concave,
    /// Both, or neither is known.
    Mixed,
}

/// L = constant + speed ln V + feed ln S; the output is exp(L) or L.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::feed_schedule) struct Form {
    pub constant: f64,
    pub speed: f64,
    pub feed: f64,
    pub log_log: bool,
}

impl Form {
    /// L at ln V, ln S.
    pub(in crate::feed_schedule) fn at(&self, u: f64, x: f64) -> f64 {
        self.constant + self.speed * u + self.feed * x
    }
}

/// A model at one depth and edge angle, with everything that acts on it.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::feed_schedule) struct ActingModel {
    base: Form,
    /// Quadratic part: q_uu, q_xx, q_ux.
    quadratic: [f64; 3],
    /// Height, centre and width of a hump over V.
    hump: Option<(f64, f64, f64)>,
    /// Added to the output.
    offset: f64,
    /// Feed marks: ln of R at 1 mm/rev, acting with the square of the feed.
    floor: Option<f64>,
    /// What no cause explains, where it goes with speed or feed.
    tables: Vec<Table>,
    /// What formulas of the user add, where they go with speed or feed.
    formulas: Vec<Written>,
}

/// What an effect may turn about, with the job's reference behind it.
fn about(own: Option<f64>, job: Option<f64>) -> f64 {
    own.or(job).unwrap_or(1.0).ln()
}

impl ActingModel {
    /// A model at a depth and angle under the effects chosen for it. Conditions that an effect needs were checked.
    pub(in crate::feed_schedule) fn of<'a>(
        model: &MachinabilityModel,
        effects: impl Iterator<Item = &'a Effect>,
        conditions: &MachinabilityConditions,
        reference: &Reference,
        depth_mm: f64,
        angle_deg: Option<f64>,
    ) -> Self {
        let mut acting = Self {
            base: Form {
                constant: model.constant_at(depth_mm, angle_deg),
                speed: model.speed_exponent,
                feed: model.feed_exponent,
                log_log: model.form == ModelForm::LogLog,
            },
            quadratic: [0.0; 3],
            hump: None,
            offset: 0.0,
            floor: None,
            tables: Vec::new(),
            formulas: Vec::new(),
        };
        // A wear-in stands in place of the model: whatever else acts, acts on it.
        let (instead, beside): (Vec<&Effect>, Vec<&Effect>) =
            effects.partition(|effect| matches!(effect, Effect::WearIn { .. }));
        for effect in instead.into_iter().chain(beside) {
            acting.add(effect, conditions, reference, depth_mm.ln(), angle_deg.map(f64::ln));
        }
        acting
    }

    fn tilt(&mut self, speed: f64, feed: f64, about: f64) {
        self.base.speed += speed;
        self.base.feed += feed;
        self.base.constant -= (speed + feed) * about;
    }

    /// Adds q_uu (u-a)² + q_xx (x-b)² + q_ux (u-a)(x-b), whatever the others turn about.
    fn bend(&mut self, q: [f64; 3], a: f64, b: f64) {
        // Collected about the origin: q_uu u² - 2 q_uu a u + ...
        for (sum, q) in self.quadratic.iter_mut().zip(q) {
            *sum += q;
        }
        self.base.speed -= 2.0 * q[0] * a + q[2] * b;
        self.base.feed -= 2.0 * q[1] * b + q[2] * a;
        self.base.constant += q[0] * a * a + q[1] * b * b + q[2] * a * b;
    }

    fn add(&mut self, effect: &Effect, at: &MachinabilityConditions, r: &Reference, ln_t: f64, ln_phi: Option<f64>) {
        let wear = at.flank_wear_mm.unwrap_or(0.0);
        let cut = Stated { depth_mm: ln_t.exp(), angle_deg: ln_phi.map(f64::exp), conditions: at };
        match effect {
            Effect::LevelShift { delta_ln, .. } => self.base.constant += delta_ln,
            Effect::BatchShift { batch, delta_ln, .. } => {
                if at.batch.as_deref() == Some(batch) {
                    self.base.constant += delta_ln;
                }
            }
            Effect::FactorShift { factor, level, delta_ln, .. } => {
                if at.level(factor) == Some(level) {
                    self.base.constant += delta_ln;
                }
            }
            Effect::FactorInteraction { factor_1, level_1, factor_2, level_2, delta_ln, .. } => {
                if at.level(factor_1) == Some(level_1) && at.level(factor_2) == Some(level_2) {
                    self.base.constant += delta_ln;
                }
            }
            Effect::SpeedExponent { delta, reference_speed_m_per_min, .. } => {
                self.tilt(*delta, 0.0, about(*reference_speed_m_per_min, r.speed_m_per_min));
            }
            Effect::FeedExponent { delta, reference_feed_mm_per_rev, .. } => {
                self.tilt(0.0, *delta, about(*reference_feed_mm_per_rev, r.feed_mm_per_rev));
            }
            Effect::DepthExponent { delta, reference_depth_mm, .. } => {
                self.base.constant += delta * (ln_t - about(*reference_depth_mm, r.depth_mm));
            }
            Effect::AngleExponent { delta, reference_angle_deg, .. } => {
                let own = about(*reference_angle_deg, r.cutting_edge_angle_deg);
                self.base.constant += delta * (ln_phi.unwrap_or(own) - own);
            }
            Effect::SpeedCurvature { coef, reference_speed_m_per_min, .. } => {
                self.bend([*coef, 0.0, 0.0], about(*reference_speed_m_per_min, r.speed_m_per_min), 0.0);
            }
            Effect::FeedCurvature { coef, reference_feed_mm_per_rev, .. } => {
                self.bend([0.0, *coef, 0.0], 0.0, about(*reference_feed_mm_per_rev, r.feed_mm_per_rev));
            }
            Effect::DepthCurvature { coef, reference_depth_mm, .. } => {
                let d = ln_t - about(*reference_depth_mm, r.depth_mm);
                self.base.constant += coef * d * d;
            }
            Effect::SpeedFeedInteraction { coef, reference_speed_m_per_min, reference_feed_mm_per_rev, .. } => self
                .bend(
                    [0.0, 0.0, *coef],
                    about(*reference_speed_m_per_min, r.speed_m_per_min),
                    about(*reference_feed_mm_per_rev, r.feed_mm_per_rev),
                ),
            Effect::FeedDepthInteraction { coef, reference_feed_mm_per_rev, reference_depth_mm, .. } => {
                let d = ln_t - about(*reference_depth_mm, r.depth_mm);
                self.tilt(0.0, coef * d, about(*reference_feed_mm_per_rev, r.feed_mm_per_rev));
            }
            Effect::SpeedDepthInteraction { coef, reference_speed_m_per_min, reference_depth_mm, .. } => {
                let d = ln_t - about(*reference_depth_mm, r.depth_mm);
                self.tilt(coef * d, 0.0, about(*reference_speed_m_per_min, r.speed_m_per_min));
            }
            Effect::BuiltUpEdge { hump_ln, centre_m_per_min, width_m_per_min, .. } => {
                self.hump = Some((*hump_ln, *centre_m_per_min, *width_m_per_min));
            }
            Effect::NoseRadiusFloor { k, nose_radius_mm, .. } => {
                self.floor = Some((k * 1000.0 / (32.0 * nose_radius_mm)).ln());
            }
            Effect::EdgeForceOffset { offset_n, .. } => self.offset += offset_n,
            Effect::WearMultiplicative { per_mm, .. } => self.base.constant += per_mm * wear,
            Effect::WearForceAdditive { n_per_mm, depth_power, reference_depth_mm, .. } => {
                let d = ln_t - about(*reference_depth_mm, r.depth_mm);
                self.offset += n_per_mm * wear * (depth_power * d).exp();
            }
            Effect::Remainder { scale, profile, .. } => {
                if let Some(table) = Table::of(*scale, profile, &cut) {
                    match table.constant() {
                        Some(constant) => self.base.constant += constant,
                        None => self.tables.push(table),
                    }
                }
            }
            Effect::Formula { .. } => {
                if let Some(written) = effect.formula().and_then(|own| Written::of(&own, &cut)) {
                    match written.constant() {
                        Some(constant) => self.base.constant += constant,
                        None => self.formulas.push(written),
                    }
                }
            }
            Effect::WearIn { wear_in_mm, time_constant_min, rate_mm_per_min, .. } => {
                let time = at.time_min.unwrap_or(0.0);
                let worn = wear_in_mm * (1.0 - (-time / time_constant_min).exp()) + rate_mm_per_min * time;
                let constant = if self.base.log_log { worn.ln() } else { worn };
                self.base = Form { constant, speed: 0.0, feed: 0.0, log_log: self.base.log_log };
            }
        }
    }

    /// L (the logarithm of the output, or the output itself) and its slopes at ln V, ln S.
    pub(in crate::feed_schedule) fn evaluate(&self, u: f64, x: f64) -> (f64, f64, f64) {
        let [q_uu, q_xx, q_ux] = self.quadratic;
        let mut value = self.base.at(u, x) + q_uu * u * u + q_xx * x * x + q_ux * u * x;
        let mut by_u = self.base.speed + 2.0 * q_uu * u + q_ux * x;
        let mut by_x = self.base.feed + 2.0 * q_xx * x + q_ux * u;
        if let Some((height, centre, width)) = self.hump {
            let speed = u.exp();
            let off = (speed - centre) / width;
            let hump = height * (-off * off).exp();
            value += hump;
            by_u -= hump * 2.0 * off * speed / width;
        }
        let added = self.tables.iter().map(|table| table.at(u, x));
        for (added, slope_u, slope_x) in added.chain(self.formulas.iter().map(|written| written.at(u, x))) {
            value += added;
            by_u += slope_u;
            by_x += slope_x;
        }
        if let Some(ln_marks) = self.floor {
            let marks = ln_marks + 2.0 * x;
            let own = if self.base.log_log { value } else { value.max(f64::MIN_POSITIVE).ln() };
            let top = own.max(marks);
            let (a, b) = ((FLOOR_POWER * (own - top)).exp(), (FLOOR_POWER * (marks - top)).exp());
            let joined = top + (a + b).ln() / FLOOR_POWER;
            let (share, rest) = (a / (a + b), b / (a + b));
            if self.base.log_log {
                (value, by_u, by_x) = (joined, share * by_u, share * by_x + rest * 2.0);
            } else {
                let y = joined.exp();
                let inner = y / own.exp();
                (value, by_u, by_x) = (y, share * by_u * inner, share * by_x * inner + rest * 2.0 * y);
            }
        }
        if self.offset != 0.0 {
            if self.base.log_log {
                let y = value.exp();
                let share = y / (y + self.offset);
                (value, by_u, by_x) = ((y + self.offset).ln(), share * by_u, share * by_x);
            } else {
                value += self.offset;
            }
        }
        (value, by_u, by_x)
    }

    /// The output at ln V, ln S.
    pub(in crate::feed_schedule) fn output(&self, u: f64, x: f64) -> f64 {
        let (value, ..) = self.evaluate(u, x);
        if self.base.log_log { value.exp() } else { value }
    }

    /// What is between this model and another of the same output: products with 1, ln V, ln S. `None` where that bends.
    pub(in crate::feed_schedule) fn straight_from(&self, other: &Self) -> Option<[f64; 3]> {
        // What is joined to the rest of the model, or added to its exponential, bends what moves beneath it.
        let is_plain = |model: &Self| model.floor.is_none() && (model.offset == 0.0 || !model.base.log_log);
        let bends_alike = self.quadratic.iter().zip(&other.quadratic).all(|(a, b)| (a - b).abs() <= 0.0)
            && self.hump == other.hump
            && self.tables == other.tables
            && self.formulas == other.formulas;
        let (own, base) = (self.base, other.base);
        (is_plain(self) && is_plain(other) && bends_alike).then(|| {
            let constant = own.constant + self.offset - base.constant - other.offset;
            [constant, own.speed - base.speed, own.feed - base.feed]
        })
    }

    /// How it bends.
    pub(in crate::feed_schedule) fn bends(&self) -> Bend {
        let [q_uu, q_xx, q_ux] = self.quadratic;
        let determinant = 4.0 * q_uu * q_xx - q_ux * q_ux;
        let inner = if self.hump.is_some() || !self.tables.is_empty() || !self.formulas.is_empty() {
            Bend::Mixed
        } else if self.quadratic.iter().all(|q| q.abs() <= 0.0) {
            Bend::Straight
        } else if q_uu >= 0.0 && q_xx >= 0.0 && determinant >= 0.0 {
            Bend::Convex
        } else if q_uu <= 0.0 && q_xx <= 0.0 && determinant >= 0.0 {
            Bend::Concave
        } else {
            Bend::Mixed
        };
        // ln(exp(L) + F) and the joined roughness rise with L and are convex: they keep convexity, not concavity. The
        // offset of a plain output is a shift.
        let joins = self.floor.is_some() || (self.offset != 0.0 && self.base.log_log);
        match (joins, inner) {
            (false, inner) => inner,
            (true, Bend::Straight | Bend::Convex) => Bend::Convex,
            (true, _) => Bend::Mixed,
        }
    }

    /// The affine form that touches the model at ln V, ln S: the model itself where it does not bend.
    pub(in crate::feed_schedule) fn form(&self, u: f64, x: f64) -> Form {
        if self.bends() == Bend::Straight && self.offset == 0.0 {
            return self.base;
        }
        let (value, speed, feed) = self.evaluate(u, x);
        Form { constant: value - speed * u - feed * x, speed, feed, log_log: self.base.log_log }
    }
}
