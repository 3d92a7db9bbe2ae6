//! How an engine works.

use std::path::PathBuf;
use std::time::Duration;

/// How an engine works.
#[derive(Debug, Clone)]
pub struct EngineSettings {
    /// Folder of the database; made if absent.
    pub data: PathBuf,
    /// Threads for calculations.
    pub cores: usize,
    /// Bytes of answers kept in memory.
    pub memory_cache_bytes: u64,
    /// Bytes of answers kept in the database.
    pub store_bytes: u64,
    /// How long an unused answer is kept there.
    pub store_age: Duration,
    /// A job estimated above this is refused.
    pub direct_limit: Duration,
    /// A job estimated to hold more memory than this is refused.
    pub direct_limit_bytes: u64,
    /// So many points has a parameter study at most.
    pub study_points: u64,
    /// How long a job may stand in line for a core.
    pub patience: Duration,
    /// How long running calculations may go on when the engine is closed.
    pub grace: Duration,
}

impl EngineSettings {
    /// The defaults, with the database in `data`.
    pub fn in_folder(data: impl Into<PathBuf>) -> Self {
        Self {
            data: data.into(),
            cores: std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
            memory_cache_bytes: 64 << 20,
            store_bytes: 1 << 30,
            store_age: Duration::from_hours(30 * 24),
            direct_limit: Duration::from_secs(10),
            direct_limit_bytes: 1 << 30,
            study_points: super::study::MOST_POINTS,
            patience: Duration::from_millis(250),
            grace: Duration::from_secs(20),
        }
    }
}
