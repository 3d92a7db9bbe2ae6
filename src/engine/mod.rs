//! From the bytes of a job to the bytes of its answer. Knows calculators by name, nothing of HTTP.

mod error;
mod key;

pub use error::{Error, SyntaxFault};
pub use key::{BadKey, Key};

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;
use precut_calc::calculator::{Cost, Figure, Monitor, Program, Table};
use serde_json::Value;

use crate::registry::{Entry, Registry};
use crate::store::{ResultPage, ResultQuery};

/// The calculators behind their cache and their pool of cores. Cheap to clone.
#[derive(Clone)]
pub struct Engine {
    registry: Registry,
}

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
    /// How long a job may stand in line for a core.
    pub patience: Duration,
}

impl EngineSettings {
    /// The defaults, with the database in `data`.
    pub fn in_folder(data: impl Into<PathBuf>) -> Self {
        Self {
            data: data.into(),
            cores: std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
            memory_cache_bytes: 64 << 20,
            store_bytes: 1 << 30,
            store_age: Duration::from_secs(30 * 24 * 3600),
            direct_limit: Duration::from_secs(10),
            direct_limit_bytes: 1 << 30,
            patience: Duration::from_millis(250),
        }
    }
}

/// Why an engine does not start.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// Another process serves this folder.
    #[error("the data folder {0} is in use by another precut")]
    InUse(PathBuf),
    /// The folder or the database cannot be used.
    #[error("the data folder {folder} cannot be used: {reason}")]
    Unusable {
        /// Which folder.
        folder: PathBuf,
        /// Why.
        reason: String,
    },
    /// The pool of threads cannot be made.
    #[error("the calculation threads cannot be started: {0}")]
    Threads(String),
}

/// A job as it came.
#[derive(Debug, Clone)]
pub enum Body {
    /// As JSON.
    Json(Bytes),
    /// As JSON with measured tables beside it.
    Parts {
        /// The job.
        job: Bytes,
        /// Its tables.
        tables: Vec<TablePart>,
    },
}

/// A measured table as a file beside the job.
#[derive(Debug, Clone)]
pub struct TablePart {
    /// Name of the field: its last part or all of it with dots.
    pub name: String,
    /// The CSV.
    pub text: Bytes,
}

/// A job that could run.
#[derive(Debug, Clone)]
pub struct Checked {
    /// The job with every default filled in, measured tables replaced by their row count and hash.
    pub input: Value,
    /// What it would cost.
    pub cost: Cost,
    /// The address of its answer.
    pub key: Key,
}

/// An answer with how it came about.
#[derive(Debug, Clone)]
pub struct Solved {
    /// The answer.
    pub stored: Arc<Stored>,
    /// Whether it was there already.
    pub cache: CacheState,
    /// Where the time went.
    pub timings: Timings,
}

/// Whether an answer was there already.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CacheState {
    /// It was.
    Hit,
    /// It was computed for this request or another one at the same time.
    Miss,
}

/// Where the time of a request went.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Timings {
    /// Reading and checking the job.
    pub parse: Duration,
    /// Waiting for a core.
    pub queue: Duration,
    /// Computing and writing the answer.
    pub run: Duration,
}

/// An answer's bytes.
pub struct Stored {
    /// Its address.
    pub key: Key,
    /// The envelope in English, JSON.
    pub body: Bytes,
    entry: Arc<Entry>,
}

impl std::fmt::Debug for Stored {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Stored").field("key", &self.key).field("bytes", &self.body.len()).finish_non_exhaustive()
    }
}

impl Stored {
    /// Which calculator made it.
    pub fn entry(&self) -> &Arc<Entry> {
        &self.entry
    }
    /// Its pictures; the first is the main one.
    pub fn figures(&self) -> Result<Vec<Figure>, Error> {
        Ok(Vec::new())
    }
    /// Its tables; the first is the main one.
    pub fn tables(&self) -> Result<Vec<Table>, Error> {
        Ok(Vec::new())
    }
    /// Its program for the machine: `None` if the calculator has none, `Err` if this answer has none.
    pub fn program(&self) -> Result<Option<Program>, Error> {
        Ok(None)
    }
}

impl Engine {
    /// Opens the store in the settings' folder and starts the threads.
    #[allow(clippy::unused_async)] // the store is opened here
    pub async fn open(registry: Registry, _settings: EngineSettings) -> Result<Self, OpenError> {
        Ok(Self { registry })
    }
    /// The calculators.
    pub fn registry(&self) -> &Registry {
        &self.registry
    }
    /// Everything but the calculation.
    pub fn check(&self, calculator: &str, body: Body) -> Result<Checked, Error> {
        check_now(&self.registry, calculator, body)
    }
    /// The answer to a job, from the cache or computed. Dropping the future cancels the calculation unless another
    /// request waits for the same one.
    #[allow(clippy::unused_async)]
    pub async fn solve(&self, calculator: &str, _body: Body) -> Result<Solved, Error> {
        Err(Error::unknown(&self.registry, calculator))
    }
    /// A kept answer.
    #[allow(clippy::unused_async)]
    pub async fn result(&self, _key: &Key) -> Result<Option<Arc<Stored>>, Error> {
        Ok(None)
    }
    /// The list of kept answers, newest first.
    #[allow(clippy::unused_async)]
    pub async fn results(&self, _query: ResultQuery) -> Result<ResultPage, Error> {
        Ok(ResultPage::default())
    }
    /// Whether it serves: the store answers and nobody has closed it.
    #[allow(clippy::unused_async)]
    pub async fn ready(&self) -> Result<(), Error> {
        Ok(())
    }
    /// Takes no more jobs, writes what waits to be written, closes the store.
    #[allow(clippy::unused_async)]
    pub async fn close(&self) {}
}

/// [`Engine::check`] without an engine.
pub fn check_now(registry: &Registry, calculator: &str, _body: Body) -> Result<Checked, Error> {
    Err(Error::unknown(registry, calculator))
}

/// The answer to a job in this thread, without cache, store or limit of cost: for the command line.
pub fn solve_now(registry: &Registry, calculator: &str, _body: Body, _monitor: &dyn Monitor) -> Result<Stored, Error> {
    Err(Error::unknown(registry, calculator))
}
mod csv_table;
mod json;
mod table;
