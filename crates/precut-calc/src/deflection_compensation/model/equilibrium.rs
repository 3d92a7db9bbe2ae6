//! The scalar equations at one station: what depth is really cut, what must be commanded.

/// Relative accuracy to which a depth is solved: a few units in the last place.
const DEPTH_TOLERANCE: f64 = 4.0 * f64::EPSILON;
/// Newton steps allowed; the bisection safeguard alone needs 60.
const MAX_STEPS: u32 = 120;

/// Position of the work against the tool at an engaged depth, and how it changes with the depth.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Opening {
    /// Opening of the gap in the radial direction Y, mm.
    pub y_mm: f64,
    /// dY/dt.
    pub y_slope: f64,
    /// Tangential offset of the axis Z, mm.
    pub z_mm: f64,
    /// dZ/dt.
    pub z_slope: f64,
}

/// What becomes of a command.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Engagement {
    /// A chip of this depth is cut.
    Cut {
        /// Engaged depth t, mm.
        depth_mm: f64,
        /// The state there.
        opening: Opening,
        /// What is left of the equation, mm.
        residual_mm: f64,
    },
    /// The command does not reach the stock.
    NoContact,
    /// The system yields before a chip forms.
    NoCut,
}

impl Engagement {
    /// The depth really cut, 0 where nothing is cut.
    pub(crate) fn depth_mm(self) -> f64 {
        match self {
            Self::Cut { depth_mm, .. } => depth_mm,
            Self::NoContact | Self::NoCut => 0.0,
        }
    }
}

/// Compensated command, explicit (`deflection/4.1`): r_c = sqrt(r_t² - Z(a)²) - Y(a), mm.
///
/// The wanted state has the engaged depth a, so all forces are those at the nominal depth; nothing is
/// iterated and the command is unique. `None` where |Z(a)| >= r_t: no command gives the diameter.
pub(crate) fn command_radius_mm(target_radius_mm: f64, y_mm: f64, z_mm: f64) -> Option<f64> {
    if z_mm.abs() >= target_radius_mm {
        return None;
    }
    if z_mm.abs() <= 0.0 {
        return Some(target_radius_mm - y_mm);
    }
    // r_t - Z²/(r_t + sqrt(..)) loses no digits where Z is small.
    let axis = ((target_radius_mm - z_mm) * (target_radius_mm + z_mm)).sqrt();
    Some(target_radius_mm - z_mm * z_mm / (target_radius_mm + axis) - y_mm)
}

/// Depth really cut at a command (`deflection/4.1`): the root of
/// t + sqrt((r_c + Y(t))² + Z(t)²) = R0 on [0, R0].
///
/// Newton from `start_mm` with a bisection safeguard. `opening_at_zero` is the limit t -> 0+, with
/// rubbing force and sag in it. Accurate to a few units in the last place of the depth scale.
pub(crate) fn engage(
    stock_radius_mm: f64,
    command_radius_mm: f64,
    start_mm: f64,
    opening_at_zero: Opening,
    opening: impl Fn(f64) -> Opening,
) -> Engagement {
    let commanded = stock_radius_mm - command_radius_mm;
    // F(t) = t - t_c + Y + [sqrt((r_c+Y)² + Z²) - (r_c+Y)] without cancellation, and dF/dt = 1 + dS/dt.
    let residual = |t: f64, o: Opening| {
        let (radius_y, radius) = produced_radius(command_radius_mm, o);
        let excess = if radius_y > 0.0 { o.z_mm * o.z_mm / (radius + radius_y) } else { radius - radius_y };
        let slope = if radius > 0.0 { (radius_y * o.y_slope + o.z_mm * o.z_slope) / radius } else { o.y_slope };
        (t - commanded + o.y_mm + excess, 1.0 + slope)
    };
    // Where nothing is to be cut no tool comes, however the work stands.
    let at_rest = if commanded == 0.0 { 0.0 } else { residual(0.0, opening_at_zero).0 };
    if at_rest >= 0.0 {
        return if commanded <= 0.0 { Engagement::NoContact } else { Engagement::NoCut };
    }
    let (mut low, mut high) = (0.0, stock_radius_mm);
    let scale = stock_radius_mm.min(commanded.max(opening_at_zero.y_mm.abs()));
    // Work that stands towards the tool is cut by a command beyond its blank, too.
    let guess = if commanded > 0.0 { commanded } else { -at_rest };
    let mut t = if start_mm > 0.0 && start_mm < high { start_mm } else { guess.min(high) };
    let mut state = opening(t);
    let mut last = f64::INFINITY;
    for _ in 0..MAX_STEPS {
        let (f, slope) = residual(t, state);
        last = f;
        if f < 0.0 {
            low = t;
        } else {
            high = t;
        }
        let step = f / slope;
        // Converged: the equation holds to round-off, or the step no longer moves the depth.
        if f.abs() <= f64::EPSILON * scale || (slope > 0.0 && step.abs() <= DEPTH_TOLERANCE * scale) {
            break;
        }
        let newton = t - step;
        t = if slope > 0.0 && newton > low && newton < high { newton } else { 0.5 * (low + high) };
        state = opening(t);
        if high - low <= DEPTH_TOLERANCE * scale {
            break;
        }
    }
    Engagement::Cut { depth_mm: t, opening: state, residual_mm: last }
}

/// r_c + Y and the produced radius S = sqrt((r_c + Y)² + Z²).
fn produced_radius(command_radius_mm: f64, o: Opening) -> (f64, f64) {
    let radius_y = command_radius_mm + o.y_mm;
    (radius_y, if o.z_mm.abs() > 0.0 { radius_y.hypot(o.z_mm) } else { radius_y.abs() })
}

/// Copying factor eps = S'/(1 + S') (`deflection/4.4`): the share of a stock deviation that is left.
pub(crate) fn copying_factor(command_radius_mm: f64, o: Opening) -> f64 {
    let (radius_y, radius) = produced_radius(command_radius_mm, o);
    let slope = if radius > 0.0 { (radius_y * o.y_slope + o.z_mm * o.z_slope) / radius } else { o.y_slope };
    slope / (1.0 + slope)
}

/// Command of the commanded-depth model (`deflection/4.2`), the paper's assumption taken to its end:
/// the smallest root of t - y(t) = a, y(t) = k t^z non-decreasing. `None` where there is none (a fold).
///
/// `deflection` returns y and dy/dt; `guess_mm` is a little below the root (the one-step formula is). For
/// z <= 1 the function is convex and has exactly one root, reached from the right, where one step from a
/// rising point lands; for z > 1 it is concave up to its fold, and Newton climbs from t = a to the smaller root.
pub(crate) fn commanded_model_depth_mm(
    nominal_depth_mm: f64,
    guess_mm: f64,
    exponent: f64,
    deflection: impl Fn(f64) -> (f64, f64),
) -> Option<f64> {
    let mut t = nominal_depth_mm;
    if exponent <= 1.0 && deflection(guess_mm).1 < 0.5 {
        t = guess_mm;
    } else if exponent <= 1.0 {
        // Go right until t - y(t) - a > 0; for z = 1 with k >= 1 this never happens.
        let mut reach = nominal_depth_mm + deflection(nominal_depth_mm).0;
        let mut doublings = 0;
        while reach - deflection(reach).0 < nominal_depth_mm {
            reach *= 2.0;
            doublings += 1;
            if doublings > 200 {
                return None;
            }
        }
        t = reach;
    }
    for _ in 0..MAX_STEPS {
        let (y, slope) = deflection(t);
        let gradient = 1.0 - slope;
        if gradient <= 0.0 {
            return None;
        }
        let step = (t - y - nominal_depth_mm) / gradient;
        t -= step;
        if !t.is_finite() {
            return None;
        }
        if step.abs() <= DEPTH_TOLERANCE * t {
            return Some(t);
        }
    }
    // At a fold Newton halves its distance and stalls at the square root of the precision: still a root.
    let (y, slope) = deflection(t);
    ((t - y - nominal_depth_mm).abs() <= 1e-12 * t && slope <= 1.0).then_some(t)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::float_cmp)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn power(k: f64, z: f64) -> impl Fn(f64) -> Opening {
        move |t: f64| Opening { y_mm: k * t.powf(z), y_slope: k * z * t.powf(z - 1.0), ..Opening::default() }
    }

    fn close(a: f64, b: f64, rel: f64) -> bool {
        (a - b).abs() <= rel * b.abs()
    }

    proptest! {
        #[test]
        fn engaged_depth_meets_the_closed_forms(k in 1e-6..50.0_f64, tc in 1e-3..20.0_f64) {
            let r0 = 50.0;
            let depth = |z: f64| engage(r0, r0 - tc, tc, Opening::default(), power(k, z)).depth_mm();
            // Round-off of R0 - r_c is 7e-15 mm, 7e-12 of the least depth; the closed forms cancel as much.
            prop_assert!(close(depth(1.0), tc / (1.0 + k), 1e-10));
            let root = 2.0 * tc / (k + (k * k + 4.0 * tc).sqrt());
            prop_assert!(close(depth(0.5), root * root, 1e-8));
            prop_assert!(close(depth(2.0), 2.0 * tc / (1.0 + (1.0 + 4.0 * k * tc).sqrt()), 1e-10));
        }

        #[test]
        fn the_explicit_command_gives_the_wanted_radius(
            r_t in 1.0..100.0_f64, a in 0.01..5.0_f64, k in 0.0..0.5_f64, kz in 0.0..0.2_f64, z in 0.3..1.5_f64,
        ) {
            let r0 = r_t + a;
            let at = |t: f64| Opening {
                y_mm: k * t.powf(z),
                y_slope: k * z * t.powf(z - 1.0),
                z_mm: kz * t,
                z_slope: kz,
            };
            let wanted = at(a);
            prop_assume!(wanted.z_mm < 0.9 * r_t);
            let r_c = command_radius_mm(r_t, wanted.y_mm, wanted.z_mm).unwrap();
            prop_assume!(r_c > 0.0);
            let cut = engage(r0, r_c, a, Opening::default(), at).depth_mm();
            prop_assert!((cut - a).abs() <= 1e-12 * r0, "{cut} for {a}");
        }

        #[test]
        fn a_start_anywhere_gives_the_same_depth(start in 0.0..5.0_f64, k in 0.0..5.0_f64, z in 0.3..2.0_f64) {
            let at = power(k, z);
            let far = engage(20.0, 18.0, start, Opening::default(), &at).depth_mm();
            let near = engage(20.0, 18.0, 2.0, Opening::default(), &at).depth_mm();
            prop_assert!(close(far, near, 1e-12));
        }

        #[test]
        fn commanded_model_meets_its_closed_forms(k in 1e-4..0.9_f64, a in 0.01..2.0_f64) {
            let y = |z: f64| move |t: f64| (k * t.powf(z), k * z * t.powf(z - 1.0));
            prop_assert!(close(commanded_model_depth_mm(a, a, 1.0, y(1.0)).unwrap(), a / (1.0 - k), 1e-12));
            let root = f64::midpoint(k, (k * k + 4.0 * a).sqrt());
            prop_assert!(close(commanded_model_depth_mm(a, a, 0.5, y(0.5)).unwrap(), root * root, 1e-12));
            match commanded_model_depth_mm(a, a, 2.0, y(2.0)) {
                // Near the fold the root is as sensitive as the square root of the data.
                Some(t) => prop_assert!(close(t, 2.0 * a / (1.0 + (1.0 - 4.0 * k * a).max(0.0).sqrt()), 1e-6)),
                None => prop_assert!(4.0 * k * a > 1.0 - 1e-9),
            }
        }
    }

    #[test]
    fn rubbing_force_alone_cuts_nothing() {
        let at_zero = Opening { y_mm: 0.03, ..Opening::default() };
        assert_eq!(engage(10.0, 10.0 - 0.02, 0.02, at_zero, |_| at_zero), Engagement::NoCut);
        assert!(engage(10.0, 10.0 - 0.04, 0.04, at_zero, |_| at_zero).depth_mm() > 0.0);
        assert_eq!(engage(10.0, 10.0, 0.0, at_zero, |_| at_zero), Engagement::NoContact);
    }

    #[test]
    fn no_command_beyond_the_axis_offset() {
        assert_eq!(command_radius_mm(2.0, 0.0, 2.0), None);
        assert_eq!(command_radius_mm(5.0, 1.0, 3.0), Some(3.0));
    }
}
