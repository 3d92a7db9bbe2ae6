//! How the errors of single parts lie along the shaft.

use crate::calculator::{Failure, checkpoint};
use crate::certainty::lines::points;
use crate::diameters::Judged;

use crate::deflection_compensation::answer::output::ErrorFan;

/// Parts of which a fan is made.
const FAN_PARTS: usize = 256;

impl Judged<'_> {
    /// How the errors of single parts lie along the shaft: by station, what so many percent of them stay below.
    pub(in crate::deflection_compensation) fn fan(&self, shift_um: f64) -> Result<ErrorFan, Failure> {
        let mut by_station = vec![Vec::with_capacity(FAN_PARTS); self.places().z_mm.len()];
        for point in points(FAN_PARTS, self.dimensions(), self.seed()) {
            checkpoint(self.monitor())?;
            match self.model_errors_um(&point, shift_um) {
                Ok(errors) => by_station.iter_mut().zip(errors).for_each(|(all, error)| all.push(error)),
                Err(Failure::OutOfModel(_)) => {}
                Err(failure) => return Err(failure),
            }
        }
        for errors in &mut by_station {
            errors.sort_by(f64::total_cmp);
        }
        let below = |percent: f64| by_station.iter().map(|errors| quantile(errors, percent / 100.0)).collect();
        Ok(ErrorFan {
            z_mm: self.places().z_mm.clone(),
            below_5_percent_um: below(5.0),
            below_25_percent_um: below(25.0),
            below_50_percent_um: below(50.0),
            below_75_percent_um: below(75.0),
            below_95_percent_um: below(95.0),
        })
    }
}

/// What a share of ascending values stays below; straight between neighbours.
fn quantile(ascending: &[f64], share: f64) -> f64 {
    let Some(last) = ascending.len().checked_sub(1) else { return 0.0 };
    let place = (share * ascending.len() as f64 - 0.5).clamp(0.0, last as f64);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // between 0 and the last
    let before = place as usize;
    let after = (before + 1).min(last);
    ascending[before] + (place - before as f64) * (ascending[after] - ascending[before])
}
