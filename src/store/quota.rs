//! What one owner may take of the service, and what he takes.

use std::time::Duration;

/// An hour: work counts for so long after it was done.
pub(crate) const HOUR_MS: i64 = 3_600_000;
/// Work is added up by minutes.
pub(super) const MINUTE_MS: i64 = 60_000;

/// How much of the service one owner may take.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Quota {
    /// Of what is kept for him, bytes.
    pub kept_bytes: Option<u64>,
    /// Of work within an hour, ms.
    pub work_ms: Option<f64>,
}

impl Quota {
    /// Whether there is none.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }
}

/// What one owner takes of the service.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Usage {
    /// What is kept of jobs, their results and documents, bytes, with the time from now after which it goes, ms; none for
    /// jobs that are not over, and for documents.
    pub kept: Vec<(Option<i64>, u64)>,
    /// Estimated work of jobs that are not over, ms.
    pub open_ms: f64,
    /// Work within the last hour, ms, with the time from now after which it counts no longer, ms.
    pub done: Vec<(i64, f64)>,
}

impl Usage {
    /// All that is kept, bytes.
    pub fn kept_bytes(&self) -> u64 {
        self.kept.iter().map(|(_, bytes)| bytes).sum()
    }

    /// All work that counts, ms.
    pub fn work_ms(&self) -> f64 {
        self.open_ms + self.done.iter().map(|(_, ms)| ms).sum::<f64>()
    }

    /// Which part of a quota a job of so much work goes beyond.
    pub(crate) fn beyond(&self, quota: &Quota, work_ms: f64) -> Option<Beyond> {
        let is_full = |most: &u64| self.kept_bytes() >= *most;
        let is_too_much = |most: &f64| work_ms > 0.0 && self.work_ms() + work_ms > *most;
        let kept = quota.kept_bytes.filter(is_full).map(|most_bytes| Beyond::Kept { most_bytes });
        kept.or_else(|| quota.work_ms.filter(is_too_much).map(|most_ms| Beyond::Work { most_ms }))
    }

    /// Whether so many bytes more are within a quota.
    pub(crate) fn has_room(&self, quota: &Quota, bytes: u64) -> bool {
        quota.kept_bytes.is_none_or(|most| self.kept_bytes().saturating_add(bytes) <= most)
    }

    /// When there is room for so much work, if nothing else is asked: what counts at the end counts for an hour after it.
    pub fn room_for_work(&self, most_ms: f64, work_ms: f64) -> Duration {
        let mut done = self.done.clone();
        done.sort_by_key(|(goes, _)| *goes);
        let mut left = self.work_ms() + work_ms - most_ms;
        let freed = done.iter().find_map(|(goes, ms)| {
            left -= ms;
            (left <= 0.0).then_some(*goes)
        });
        milliseconds(if self.work_ms() + work_ms <= most_ms { 0 } else { freed.unwrap_or(HOUR_MS) })
    }

    /// When there is room for a job's result, if nothing else is asked; `longest` is how long jobs are kept.
    pub fn room_to_keep(&self, most_bytes: u64, longest: Duration) -> Duration {
        let mut kept: Vec<(i64, u64)> = self.kept.iter().filter_map(|(goes, bytes)| Some(((*goes)?, *bytes))).collect();
        kept.sort_unstable();
        let mut left = self.kept_bytes();
        if left < most_bytes {
            return Duration::ZERO;
        }
        let freed = kept.iter().find_map(|(goes, bytes)| {
            left -= bytes;
            (left < most_bytes).then_some(*goes)
        });
        freed.map_or(longest, milliseconds)
    }
}

/// Which part of a quota is spent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Beyond {
    Kept { most_bytes: u64 },
    Work { most_ms: f64 },
}

fn milliseconds(ms: i64) -> Duration {
    Duration::from_millis(ms.max(0).unsigned_abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_is_told_with_the_time_when_there_is_room_for_more() {
        let usage = Usage { kept: vec![], open_ms: 30.0, done: vec![(2000, 20.0), (1000, 10.0)] };
        assert!((usage.work_ms() - 60.0).abs() < 1e-12);
        let room = |work_ms| usage.room_for_work(100.0, work_ms).as_millis();
        assert_eq!([room(40.0), room(45.0), room(50.0), room(51.0), room(70.0)], [0, 1000, 1000, 2000, 2000]);
        // What is still being computed counts for an hour after its end.
        assert_eq!(room(71.0), 3_600_000);
        let quota = Quota { work_ms: Some(100.0), ..Quota::default() };
        assert_eq!(
            (usage.beyond(&quota, 40.0), usage.beyond(&quota, 40.1)),
            (None, Some(Beyond::Work { most_ms: 100.0 }))
        );
        // What costs nothing is never too much.
        let spent = Quota { work_ms: Some(1.0), ..Quota::default() };
        assert_eq!(usage.beyond(&spent, 0.0), None);
        assert_eq!(usage.beyond(&Quota::default(), 1e9), None);
    }

    #[test]
    fn what_is_kept_is_told_with_the_time_when_there_is_room_again() {
        let usage = Usage { kept: vec![(None, 5), (Some(3000), 30), (Some(1000), 10)], ..Usage::default() };
        let day = Duration::from_hours(24);
        let room = |most| usage.room_to_keep(most, day).as_millis();
        assert_eq!([room(46), room(45), room(36), room(35), room(6), room(5)], [0, 1000, 1000, 3000, 3000, 86_400_000]);
        let kept = |most| Quota { kept_bytes: Some(most), ..Quota::default() };
        let beyond = |most| usage.beyond(&kept(most), 1.0);
        // How large a model is is known before it is kept.
        assert_eq!((usage.has_room(&kept(50), 5), usage.has_room(&kept(49), 5)), (true, false));
        assert!(usage.has_room(&Quota::default(), u64::MAX));
        assert_eq!((beyond(46), beyond(45)), (None, Some(Beyond::Kept { most_bytes: 45 })));
    }
}
