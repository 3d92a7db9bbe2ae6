//! How far a calculation is, seen from outside while it runs.

use std::sync::{Arc, Mutex, PoisonError};

use precut_calc::calculator::{Figure, Message, Monitor};

/// Where a calculation leaves word of itself, and whoever waits looks.
#[derive(Default)]
pub(crate) struct Progress(Mutex<Reported>);

/// What a calculation said last.
#[derive(Debug, Clone, Default)]
pub(crate) struct Reported {
    /// How far it is, 0 to 1.
    pub fraction: f64,
    /// What it is doing.
    pub stage: Option<Message>,
    /// The picture so far.
    pub interim: Option<Interim>,
}

/// A picture of an unfinished calculation.
#[derive(Debug, Clone)]
pub struct Interim {
    /// Which one of this calculation, from 1.
    pub number: u64,
    /// The picture.
    pub figure: Arc<Figure>,
}

impl Progress {
    /// Notes how far it is; never less than before.
    pub(crate) fn report(&self, fraction: f64, stage: Message) {
        let mut reported = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if fraction.is_finite() {
            reported.fraction = fraction.clamp(reported.fraction, 1.0);
        }
        reported.stage = Some(stage);
    }

    /// Notes the picture so far.
    pub(crate) fn show(&self, figure: Figure) {
        let mut reported = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let number = reported.interim.as_ref().map_or(0, |interim| interim.number) + 1;
        reported.interim = Some(Interim { number, figure: Arc::new(figure) });
    }

    /// What was said last.
    pub(crate) fn read(&self) -> Reported {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Monitor for Progress {
    fn cancelled(&self) -> bool {
        false
    }
    fn progress(&self, fraction: f64, stage: Message) {
        self.report(fraction, stage);
    }
    fn interim(&self, figure: Figure) {
        self.show(figure);
    }
}
