//! The forced motion as what a run in time comes to: of uneven teeth that lose the cut, or on joints that harden.

use crate::calculator::{Failure, Monitor};

use crate::fixture_stability::model::cutting::Cutting;
use crate::fixture_stability::model::floquet::Working;
use crate::fixture_stability::model::holding::Holding;
use crate::fixture_stability::model::march::{Marched, Plan, Surface, march};
use crate::fixture_stability::model::response::{Moment, Response};
use crate::fixture_stability::model::simulate::count;

/// Steps per tooth pitch, first and most tooth periods of a run that is to settle, and how well. A run that has not come to rest
/// says by its decay how long the next must be.
const SETTLING_STEPS: f64 = 400.0;
const FIRST_PERIODS: usize = 160;
const MOST_PERIODS: usize = 5120;
const AT_REST: f64 = 1e-6;

/// The run in time that has settled, over a revolution; `None` where it does not (chatter).
pub(in crate::fixture_stability) fn settled<const N: usize>(
    holding: &Holding,
    cutting: &Cutting,
    working: Working,
    monitor: &dyn Monitor,
) -> Result<Option<Response>, Failure> {
    let highest = holding.modes().last().map_or(0.0, |mode| mode.natural_hz);
    let steps = count((80.0 * highest * cutting.tooth_period_s(working.spindle_rpm)).clamp(SETTLING_STEPS, 8000.0));
    let mut periods = FIRST_PERIODS;
    let mut decayed = true;
    while periods <= MOST_PERIODS {
        let whole = periods.div_ceil(cutting.teeth).max(3) * cutting.teeth;
        let plan = Plan {
            working,
            steps_per_tooth: steps,
            tooth_periods: whole,
            steady_periods: cutting.teeth,
            surface: Surface::Multiple,
            gradual: false,
            unilateral: false,
            keep_first: 0,
            keep_last: cutting.teeth,
        };
        let run = march::<N>(holding, cutting, &plan, monitor)?;
        if run.diverged {
            return Ok(None);
        }
        // From one revolution to the next, after so many.
        let change = |revolutions: usize| {
            let (last, before) = ((revolutions - 1) * cutting.teeth, (revolutions - 2) * cutting.teeth);
            (0..cutting.teeth)
                .map(|i| (run.samples_mm[last + i] - run.samples_mm[before + i]).abs())
                .fold(0.0, f64::max)
        };
        let revolutions = whole / cutting.teeth;
        let (half, now, rest) = ((revolutions / 2).max(2), change(revolutions), AT_REST * working.feed_mm);
        if now <= rest {
            return Ok(Some(of_run(cutting, working, &run)));
        }
        let decay = (change(half) / now).ln() / (revolutions - half).max(1) as f64;
        if decay > SLOWEST_DECAY {
            decayed = true;
            // A tenth more: two modes may beat.
            periods = whole + count(1.1 * (now / rest).ln() / decay + 2.0) * cutting.teeth;
        } else if decayed {
            // A hard entry may hide it once.
            decayed = false;
            periods *= 4;
        } else {
            break;
        }
    }
    Ok(None)
}

/// Decay per revolution below which a run settles in no reasonable time: a factor of e in a thousand revolutions.
const SLOWEST_DECAY: f64 = 1e-3;

/// The last revolution of a settled run.
fn of_run(cutting: &Cutting, working: Working, run: &Marched) -> Response {
    let tau = cutting.tooth_period_s(working.spindle_rpm);
    let start = run.last.first().map_or(0.0, |step| step.time_s);
    let rad_per_s = cutting.pitch_rad() / tau;
    let mut moments: Vec<Moment> = run
        .last
        .iter()
        .map(|step| Moment {
            time_s: step.time_s - start,
            since_entry_rad: ((step.time_s - start) % tau) * rad_per_s,
            x_mm: step.x_mm,
            velocity_mm_per_s: step.velocity_mm_per_s,
            force_n: step.force_n,
            unloading_n: step.left_demand_n + step.right_demand_n,
        })
        .collect();
    let period_s = tau * cutting.teeth as f64;
    moments.extend(moments.first().map(|first| Moment { time_s: period_s, ..*first }));
    let first = moments.first().map_or(0.0, |moment| moment.x_mm);
    let mut response = Response {
        moments,
        x_mm: run.x_mm,
        left_n: run.left_n,
        right_n: run.right_n,
        left_elastic_n: run.left_elastic_n,
        right_elastic_n: run.right_elastic_n,
        x_at_entry_mm: first,
        x_at_exit_mm: first,
        period_s,
    };
    if let [before, _] = cutting.stretches()[..] {
        response.x_at_exit_mm = response.x_at(before.length_rad() / rad_per_s);
    }
    response
}
