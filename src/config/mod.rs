//! The configuration: one struct, one source of defaults (`config.default.toml`), one order of precedence.

mod check;
mod environment;
mod flags;
mod keys;
#[cfg(test)]
mod tests;

use std::collections::BTreeSet;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::Duration;

use figment::Figment;
use figment::providers::{Format, Serialized, Toml};
use serde::{Deserialize, Serialize};

use crate::store::address::StoreAddress;
pub(crate) use check::allowed_host;
use environment::{PREFIX, Variable};
pub use flags::Flags;
pub use keys::{ApiKey, Auth, Scope};

/// Every setting with its default and what it means; the source of the defaults.
pub const DEFAULTS: &str = include_str!("../../config.default.toml");

/// What the service runs with. Unknown keys are refused wherever they come from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Address and port to listen on.
    pub listen: SocketAddr,
    /// Address and port of their own for health and metrics; `None`: only with everything else.
    #[serde(with = "address_or_nothing")]
    pub admin_listen: Option<SocketAddr>,
    /// Folder of the database.
    pub data: PathBuf,
    /// Where results, jobs and the queue are kept.
    pub store: StoreAddress,
    /// What this process does.
    pub role: Role,
    /// Threads that calculate; 0 takes all cores.
    pub cpu: usize,
    /// What is logged, and how.
    pub log: Log,
    /// What is refused because it is too large, too slow or too much.
    pub limits: Limits,
    /// What runs behind the answers.
    pub jobs: Jobs,
    /// What one owner may take.
    pub quota: Quota,
    /// Who may be told that a job is over.
    pub callbacks: Callbacks,
    /// Where spans go.
    pub traces: Traces,
    /// What is kept.
    pub cache: Cache,
    /// How a PostgreSQL database is used.
    pub postgres: Postgres,
    /// How the service stops.
    pub shutdown: Shutdown,
    /// Which web pages may call it.
    pub cors: Cors,
    /// Who may call it.
    pub auth: Auth,
    /// Variables of the environment that look like settings and are none.
    #[serde(skip)]
    pub strays: Vec<String>,
}

/// What is logged, and how.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Log {
    /// A level or a filter of `tracing-subscriber`.
    pub level: String,
    /// Form of a line.
    pub format: LogFormat,
}

/// Form of a line of the log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum LogFormat {
    /// For people.
    Text,
    /// One JSON object per line.
    Json,
}

/// What is refused because it is too large, too slow or too much.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Largest JSON job, bytes.
    pub json_bytes: usize,
    /// Largest multipart job, bytes.
    pub multipart_bytes: usize,
    /// Memory of all bodies in work together and of what is read from them, bytes.
    pub bodies_bytes: usize,
    /// A body must have arrived within this time, s.
    pub body_timeout_s: f64,
    /// A request's header must have arrived within this time, s.
    pub header_timeout_s: f64,
    /// Connections open at the same time.
    pub connections: usize,
    /// Connections that one client may have open.
    pub connections_per_client: usize,
    /// Requests in work at the same time.
    pub concurrent_requests: usize,
    /// Requests per second and client in the long run; 0 for no limit.
    pub requests_per_s: f64,
    /// Requests that one client may send at once.
    pub burst: f64,
    /// Largest estimated work that is answered at once, ms; what is larger runs as a job.
    pub direct_ms: f64,
    /// Largest estimated work of a job, ms.
    pub job_ms: f64,
    /// Largest estimated memory of a job, bytes.
    pub job_bytes: u64,
    /// Most points of a parameter study.
    pub study_points: u64,
    /// Most revisions of machines, tools and materials that are kept, of all owners together.
    pub library_records: u64,
    /// How long a job may wait for a core, ms.
    pub queue_ms: u64,
}

/// What runs behind the answers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Jobs {
    /// Jobs that run at the same time; 0 takes all cores but one.
    pub slots: usize,
    /// What is estimated shorter, ms, has a place of its own while all others are taken; 0 for no such place.
    pub short_ms: f64,
    /// Jobs that may wait.
    pub queue: u64,
    /// How long finished jobs and their results are kept, days.
    pub days: u32,
    /// Event streams that one client may have open.
    pub streams: usize,
}

/// What one owner of keys may take, or one address where nobody is asked for a key.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Quota {
    /// Work within an hour, s of computation; 0 for no limit.
    pub work_s_per_hour: f64,
    /// Jobs, their results and models kept for him, bytes; 0 for no limit.
    pub kept_bytes: u64,
}

/// Who may be told that a job is over.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Callbacks {
    /// Hosts that may be called, each with its port where that is not its scheme's; none: nobody is told.
    pub hosts: Vec<String>,
    /// Whether they may have addresses of private networks and of this machine.
    pub private: bool,
    /// File with the secret that signs, one or two lines.
    pub secret_file: String,
    /// The same of owners who have secrets of their own.
    pub owners: Vec<OwnerSecret>,
    /// How long one try may take, s.
    pub timeout_s: f64,
    /// Pauses between tries, s.
    pub pauses_s: Vec<f64>,
}

/// Where the secret of an owner of keys is.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OwnerSecret {
    /// Whose it is.
    pub owner: String,
    /// File with it, one or two lines.
    pub secret_file: String,
}

/// Where spans go.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Traces {
    /// Where batches of spans are posted (OTLP over HTTP); empty: nowhere.
    pub endpoint: String,
    /// Share of the traces that begin here which is exported, 0 to 1.
    pub share: f64,
}

/// What is kept.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cache {
    /// Results kept in memory, bytes.
    pub memory_bytes: u64,
    /// Results kept in the database, bytes.
    pub store_bytes: u64,
    /// How long a result that nobody asks for is kept, days.
    pub store_days: u32,
}

/// What a process does.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Answers requests and runs jobs.
    #[default]
    All,
    /// Answers requests; jobs are run by others.
    Api,
    /// Runs jobs; of requests only health and metrics.
    Worker,
}

impl Role {
    /// Whether it runs jobs.
    pub const fn works(self) -> bool {
        matches!(self, Self::All | Self::Worker)
    }
}

/// How a PostgreSQL database is used.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Postgres {
    /// Connections of this process at most; one more listens for notifications.
    pub connections: u32,
    /// How long to wait at the start for a database that does not answer, s.
    pub wait_s: f64,
}

/// How the service stops.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shutdown {
    /// How long requests in work may take to finish, s.
    pub grace_s: f64,
}

/// Which web pages may call the service.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cors {
    /// Allowed origins, or `*`.
    pub origins: Vec<String>,
}

/// Why there is no configuration.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// Settings that are of the wrong type or make no sense, all of them; after an unknown one nothing is read.
    #[error("{}", .0.join("\n"))]
    Invalid(Vec<String>),
}

impl Config {
    /// Defaults < file < environment < flags.
    pub fn load(file: Option<&Path>, flags: &Flags) -> Result<Self, ConfigError> {
        let (mut environment, mut faults) = (Vec::new(), Vec::new());
        for (name, value) in std::env::vars_os() {
            // What others have there need not be text.
            let Some(name) = name.to_str().filter(|name| name.starts_with(PREFIX)) else { continue };
            match value.into_string() {
                Ok(value) => environment.push((name.to_owned(), value)),
                Err(_) => faults.push(format!("environment variable {name} is not Unicode")),
            }
        }
        if faults.is_empty() { Self::from_sources(file, environment, flags) } else { Err(ConfigError::Invalid(faults)) }
    }

    /// [`Config::load`] with the environment as it is given.
    pub fn from_sources(
        file: Option<&Path>,
        environment: impl IntoIterator<Item = (String, String)>,
        flags: &Flags,
    ) -> Result<Self, ConfigError> {
        let mut figment = Figment::from(Toml::string(DEFAULTS));
        if let Some(file) = file {
            figment = figment.merge(Toml::file_exact(file));
        }
        let mut strays = Vec::new();
        for variable in environment.into_iter().filter_map(Variable::new) {
            if variable.is_stray() {
                strays.push(variable.said());
            } else {
                figment = figment.merge(variable);
            }
        }
        figment = figment.merge(Serialized::defaults(flags));
        if let Some(store) = &flags.store {
            figment = figment.merge(("store", store.reveal()));
        }
        if let Some(level) = &flags.log_level {
            figment = figment.merge(("log.level", level));
        }
        if let Some(format) = &flags.log_format {
            figment = figment.merge(("log.format", format));
        }
        Self::read(figment).map(|config| Self { strays, ..config })
    }

    /// The configuration, or everything that is wrong with it: a setting that cannot be read takes its default, so that
    /// the next one shows.
    fn read(mut figment: Figment) -> Result<Self, ConfigError> {
        let defaults = Figment::from(Toml::string(DEFAULTS));
        let mut faults = Vec::new();
        let mut mended = BTreeSet::new();
        loop {
            let error = match figment.extract::<Self>() {
                Ok(config) => {
                    faults.extend(config.faults());
                    return if faults.is_empty() { Ok(config) } else { Err(ConfigError::Invalid(faults)) };
                }
                Err(error) => error,
            };
            faults.push(error.to_string());
            let place = error.path.join(".");
            match defaults.find_value(&place) {
                Ok(value) if value.as_dict().is_none() && mended.insert(place.clone()) => {
                    figment = figment.merge((place, value));
                }
                _ => return Err(ConfigError::Invalid(faults)),
            }
        }
    }

    /// The configuration as TOML, without secrets.
    #[allow(clippy::missing_panics_doc)] // it cannot
    pub fn to_toml(&self) -> String {
        let mut shown = self.clone();
        for key in &mut shown.auth.keys {
            "(hidden)".clone_into(&mut key.hash);
        }
        toml::to_string(&shown).expect("a configuration has only TOML types")
    }

    /// Whether only this machine can reach the service.
    pub fn is_loopback(&self) -> bool {
        [Some(self.listen), self.admin_listen].into_iter().flatten().all(|address| address.ip().is_loopback())
    }
}

impl Default for Config {
    fn default() -> Self {
        toml::from_str(DEFAULTS).expect("a test reads the defaults")
    }
}

/// An address, or an empty text for none: TOML has no other word for nothing.
mod address_or_nothing {
    use std::net::SocketAddr;

    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};

    #[allow(clippy::ref_option)] // serde gives a reference to the field
    pub(super) fn serialize<S: Serializer>(address: &Option<SocketAddr>, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&address.map(|address| address.to_string()).unwrap_or_default())
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<SocketAddr>, D::Error> {
        let text = String::deserialize(deserializer)?;
        if text.is_empty() { Ok(None) } else { text.parse().map(Some).map_err(D::Error::custom) }
    }
}

/// A duration from seconds that [`Config::load`] has checked.
pub(crate) fn seconds(s: f64) -> Duration {
    Duration::try_from_secs_f64(s).unwrap_or(Duration::MAX)
}

/// The same from milliseconds.
pub(crate) fn milliseconds(ms: f64) -> Duration {
    seconds(ms / 1e3)
}
