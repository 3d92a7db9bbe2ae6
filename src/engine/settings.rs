//! How an engine works.

use std::path::PathBuf;
use std::time::Duration;

use super::Isolation;
use crate::config::{Config, Role, milliseconds, seconds};
use crate::store::StoreSettings;
use crate::store::address::StoreAddress;
use crate::store::jobs::Quota;
use crate::store::sqlite::Keep;

/// How an engine works.
#[derive(Debug, Clone)]
pub struct EngineSettings {
    /// Folder of the database; made if absent.
    pub data: PathBuf,
    /// Where results, jobs and the queue are kept.
    pub store: StoreAddress,
    /// Connections to a PostgreSQL store at most.
    pub store_connections: u32,
    /// How long to wait at the start for a PostgreSQL store that does not answer.
    pub store_wait: Duration,
    /// Whether jobs are run here, and not only accepted.
    pub role: Role,
    /// Threads for calculations.
    pub cores: usize,
    /// Bytes of answers kept in memory.
    pub memory_cache_bytes: u64,
    /// Bytes of answers kept in the database.
    pub store_bytes: u64,
    /// How long an unused answer is kept there.
    pub store_age: Duration,
    /// A job estimated above this is not answered at once, but run behind.
    pub direct_limit: Duration,
    /// A job estimated above this is refused.
    pub cost_limit: Duration,
    /// A job estimated to hold more memory than this is refused.
    pub cost_limit_bytes: u64,
    /// With so many jobs waiting, further ones are refused.
    pub queue_limit: u64,
    /// Jobs run at the same time behind the direct answers.
    pub job_slots: usize,
    /// A job estimated below this has a place of its own while all others are taken; none has at 0.
    pub short_limit: Duration,
    /// How long finished jobs and their results are kept.
    pub job_age: Duration,
    /// Memory of all bodies in work together and of what is read from them, bytes.
    pub bodies_bytes: usize,
    /// How a process is started for a job that may be deadly; without, such a job is given up by the count of its starts.
    pub isolation: Option<Isolation>,
    /// So many points has a parameter study at most.
    pub study_points: u64,
    /// So many revisions of machines, tools and materials are kept at most, of everybody together.
    pub most_records: u64,
    /// How much one owner may take.
    pub quota: Quota,
    /// How long a job may stand in line for a core.
    pub patience: Duration,
}

/// What one job may take where nothing else is set.
pub(super) const COST_LIMIT: Duration = Duration::from_hours(1);
pub(super) const COST_LIMIT_BYTES: u64 = 1 << 30;

impl EngineSettings {
    /// The defaults, with the database in `data`.
    pub fn in_folder(data: impl Into<PathBuf>) -> Self {
        let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        Self {
            data: data.into(),
            store: StoreAddress::Sqlite,
            store_connections: 8,
            store_wait: Duration::from_secs(10),
            role: Role::All,
            cores,
            memory_cache_bytes: 64 << 20,
            store_bytes: 1 << 30,
            store_age: Duration::from_hours(30 * 24),
            direct_limit: Duration::from_millis(500),
            cost_limit: COST_LIMIT,
            cost_limit_bytes: COST_LIMIT_BYTES,
            queue_limit: 10_000,
            job_slots: Self::job_slots_of(cores),
            short_limit: Duration::from_secs(5),
            job_age: Duration::from_hours(30 * 24),
            bodies_bytes: 128 << 20,
            isolation: None,
            study_points: super::study::MOST_POINTS,
            most_records: 100_000,
            quota: Quota::default(),
            patience: Duration::from_millis(250),
        }
    }

    /// Those of a configuration.
    pub fn of(config: &Config) -> Self {
        let defaults = Self::in_folder(&config.data);
        let cores = if config.cpu == 0 { defaults.cores } else { config.cpu };
        Self {
            data: defaults.data,
            store: config.store.clone(),
            store_connections: config.postgres.connections,
            store_wait: seconds(config.postgres.wait_s),
            role: config.role,
            cores,
            memory_cache_bytes: config.cache.memory_bytes,
            store_bytes: config.cache.store_bytes,
            store_age: Duration::from_secs(u64::from(config.cache.store_days) * 24 * 3600),
            direct_limit: milliseconds(config.limits.direct_ms),
            cost_limit: milliseconds(config.limits.job_ms),
            cost_limit_bytes: config.limits.job_bytes,
            queue_limit: config.jobs.queue,
            job_slots: if config.jobs.slots == 0 { Self::job_slots_of(cores) } else { config.jobs.slots },
            short_limit: milliseconds(config.jobs.short_ms),
            job_age: Duration::from_secs(u64::from(config.jobs.days) * 24 * 3600),
            bodies_bytes: config.limits.bodies_bytes,
            isolation: None,
            study_points: config.limits.study_points,
            most_records: config.limits.library_records,
            quota: Quota {
                kept_bytes: Some(config.quota.kept_bytes).filter(|bytes| *bytes > 0),
                work_ms: Some(1e3 * config.quota.work_s_per_hour).filter(|ms| *ms > 0.0),
            },
            patience: Duration::from_millis(config.limits.queue_ms),
        }
    }

    /// How the store is opened.
    pub(crate) fn store_settings(&self) -> StoreSettings {
        StoreSettings {
            address: self.store.clone(),
            data: self.data.clone(),
            keep: Keep { bytes: self.store_bytes, age: self.store_age, jobs: self.job_age },
            connections: self.store_connections,
            wait: self.store_wait,
            works: self.role.works(),
        }
    }

    /// All cores but one: long jobs leave short answers a core.
    pub const fn job_slots_of(cores: usize) -> usize {
        if cores > 2 { cores - 1 } else { 1 }
    }
}
