//! The configuration: one struct, one source of defaults (`config.default.toml`), one order of precedence.

use std::collections::BTreeSet;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::Duration;

use figment::providers::{Format, Serialized, Toml};
use figment::value::{Dict, Map, Value};
use figment::{Figment, Metadata, Profile, Provider};
use serde::{Deserialize, Serialize};
use tracing_subscriber::EnvFilter;

use crate::store::address::{Given, StoreAddress};

/// Every setting with its default and what it means; the source of the defaults.
pub const DEFAULTS: &str = include_str!("../config.default.toml");

/// Sections of the configuration: `PRECUT_LOG_LEVEL` is `log.level`.
const SECTIONS: [&str; 11] =
    ["log", "limits", "jobs", "quota", "callbacks", "traces", "cache", "postgres", "shutdown", "cors", "auth"];

/// Settings outside of the sections.
const OUTSIDE: [&str; 6] = ["listen", "admin_listen", "data", "store", "role", "cpu"];

/// Settings that are words even where they look like numbers: `PRECUT_DATA=2026`.
const WORDS: [&str; 9] = [
    "listen",
    "admin_listen",
    "data",
    "store",
    "role",
    "log.level",
    "log.format",
    "callbacks.secret_file",
    "traces.endpoint",
];

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

/// Who may call the service.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Auth {
    /// Accepted keys; none: everybody may call.
    pub keys: Vec<ApiKey>,
}

/// A key that a client may send.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ApiKey {
    /// What it is called in the log.
    pub name: String,
    /// BLAKE3 of the key, 64 hexadecimal digits.
    pub hash: String,
    /// Whose it is: several keys may be one owner's, who has his jobs, results and models to himself, and whose requests
    /// count together for the rate limit and his jobs for the fair order. The key's name where none is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub owner: Option<String>,
    /// What may be done with it.
    #[serde(default = "Scope::usual")]
    pub scopes: Vec<Scope>,
}

impl Default for ApiKey {
    fn default() -> Self {
        Self { name: String::new(), hash: String::new(), owner: None, scopes: Scope::usual() }
    }
}

/// What may be done with a key.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Scope {
    /// Ask: send jobs and cancel them.
    Solve,
    /// Read jobs, results, models and records of one's own.
    Read,
    /// Store and delete models of one's own.
    Models,
    /// Store and delete machines, tools and materials of one's own.
    Library,
    /// Declare, feed, decide on and delete processes of one's own.
    Processes,
    /// Report parts of processes of one's own: of all, or of the one of that name.
    Parts(Option<String>),
    /// See and cancel the jobs and read the results of all owners, and read the metrics.
    Admin,
}

impl TryFrom<String> for Scope {
    type Error = String;
    fn try_from(word: String) -> Result<Self, String> {
        Ok(match word.as_str() {
            "solve" => Self::Solve,
            "read" => Self::Read,
            "models" => Self::Models,
            "library" => Self::Library,
            "processes" => Self::Processes,
            "parts" => Self::Parts(None),
            "admin" => Self::Admin,
            _ => match word.split_once(':') {
                Some(("parts", process)) if !process.is_empty() => Self::Parts(Some(process.to_owned())),
                _ => {
                    return Err(format!(
                        "{word} is no scope; they are solve, read, models, library, processes, parts, parts:PROCESS, admin"
                    ));
                }
            },
        })
    }
}

impl From<Scope> for String {
    fn from(scope: Scope) -> Self {
        match &scope {
            Scope::Parts(Some(process)) => format!("parts:{process}"),
            other => other.word().to_owned(),
        }
    }
}

impl Scope {
    /// What a key may that says nothing of it.
    pub fn usual() -> Vec<Self> {
        vec![Self::Solve, Self::Read, Self::Models, Self::Library, Self::Processes]
    }

    /// As it is written.
    pub const fn word(&self) -> &'static str {
        match self {
            Self::Solve => "solve",
            Self::Read => "read",
            Self::Models => "models",
            Self::Library => "library",
            Self::Processes => "processes",
            Self::Parts(_) => "parts",
            Self::Admin => "admin",
        }
    }
}

/// Settings given as flags; they win over all others.
#[derive(Debug, Clone, Default, Serialize, clap::Args)]
pub struct Flags {
    /// Address and port to listen on [default: 127.0.0.1:8080]
    #[arg(long, value_name = "ADDRESS:PORT")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub listen: Option<SocketAddr>,
    /// Folder of the database [default: ./data]
    #[arg(long, value_name = "DIR")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub data: Option<PathBuf>,
    /// `sqlite` in the data folder, or postgres://user:password@host:5432/database; others can see a flag, so that
    /// the environment (PRECUT_STORE) is the better place for a password [default: sqlite]
    #[arg(long, value_name = "STORE")]
    #[serde(skip)]
    pub store: Option<Given>,
    /// What this process does; other than `all` only with a PostgreSQL store [default: all]
    #[arg(long, value_name = "ROLE")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub role: Option<Role>,
    /// Threads that calculate; 0 takes all cores
    #[arg(long, value_name = "THREADS")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cpu: Option<usize>,
    /// Level or filter of the log [default: info]
    #[arg(long, value_name = "LEVEL")]
    #[serde(skip)]
    pub log_level: Option<String>,
    /// Form of the log [default: text]
    #[arg(long, value_name = "FORM")]
    #[serde(skip)]
    pub log_format: Option<LogFormat>,
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

    /// Settings that make no sense.
    fn faults(&self) -> Vec<String> {
        let mut faults = Vec::new();
        let limits = &self.limits;
        for (name, seconds) in [
            ("limits.body_timeout_s", limits.body_timeout_s),
            ("limits.header_timeout_s", limits.header_timeout_s),
            ("shutdown.grace_s", self.shutdown.grace_s),
            ("postgres.wait_s", self.postgres.wait_s),
        ] {
            if !(0.001..=86_400.0).contains(&seconds) {
                faults.push(format!("{name} = {seconds}: must be 0.001 to 86400 s"));
            }
        }
        for (name, count) in [
            ("limits.json_bytes", limits.json_bytes),
            ("limits.multipart_bytes", limits.multipart_bytes),
            ("limits.bodies_bytes", limits.bodies_bytes),
            ("limits.connections", limits.connections),
            ("limits.connections_per_client", limits.connections_per_client),
            ("limits.concurrent_requests", limits.concurrent_requests),
            ("jobs.streams", self.jobs.streams),
        ] {
            if count == 0 {
                faults.push(format!("{name} = 0: must be at least 1"));
            }
        }
        if !(limits.requests_per_s >= 0.0 && limits.requests_per_s.is_finite()) {
            faults.push(format!("limits.requests_per_s = {}: must be 0 or more", limits.requests_per_s));
        }
        if !(limits.burst >= 1.0 && limits.burst.is_finite()) {
            faults.push(format!("limits.burst = {}: must be at least 1", limits.burst));
        }
        for (name, ms) in [("limits.direct_ms", limits.direct_ms), ("limits.job_ms", limits.job_ms)] {
            if !(ms > 0.0 && ms.is_finite()) {
                faults.push(format!("{name} = {ms}: must be above 0"));
            }
        }
        let work_s = self.quota.work_s_per_hour;
        if !(work_s >= 0.0 && work_s.is_finite()) {
            faults.push(format!("quota.work_s_per_hour = {work_s}: must be 0 or more"));
        }
        self.faults_outward(&mut faults);
        let short_ms = self.jobs.short_ms;
        if !(short_ms >= 0.0 && short_ms.is_finite()) {
            faults.push(format!("jobs.short_ms = {short_ms}: must be 0 or more"));
        }
        if !(2..=1000).contains(&self.postgres.connections) {
            faults.push(format!("postgres.connections = {}: must be 2 to 1000", self.postgres.connections));
        }
        if self.role != Role::All && !self.store.is_shared() {
            faults.push("role: other than \"all\" only with a store that processes share: postgres://...".to_owned());
        }
        if self.jobs.queue == 0 || self.jobs.days == 0 {
            faults.push("jobs.queue and jobs.days: must be at least 1".to_owned());
        }
        if let Err(error) = EnvFilter::builder().parse(&self.log.level) {
            faults.push(format!("log.level = \"{}\": {error}", self.log.level));
        }
        for (index, key) in self.auth.keys.iter().enumerate() {
            if blake3::Hash::from_hex(&key.hash).is_err() {
                faults.push(format!(
                    "auth.keys[{index}].hash (\"{}\"): must be 64 hexadecimal digits, as `precut hash-key` prints them",
                    key.name
                ));
            }
        }
        for (index, key) in self.auth.keys.iter().enumerate() {
            if key.owner.as_deref().unwrap_or(&key.name).is_empty() {
                faults.push(format!("auth.keys[{index}]: needs a name or an owner"));
            }
        }
        for origin in &self.cors.origins {
            let is_origin = origin.split_once("://").is_some_and(|(scheme, host)| {
                !scheme.is_empty() && !host.is_empty() && !host.contains('/') && host.is_ascii()
            });
            if origin != "*" && !is_origin {
                faults.push(format!("cors.origins: \"{origin}\" is no origin such as https://cam.example.com"));
            }
        }
        faults
    }
}

impl Config {
    /// Of where the service sends something by itself.
    fn faults_outward(&self, faults: &mut Vec<String>) {
        let Callbacks { hosts, secret_file, owners, timeout_s, pauses_s, .. } = &self.callbacks;
        for host in hosts {
            if allowed_host(host).is_none() {
                faults.push(format!(
                    "callbacks.hosts: \"{host}\" is no host such as mes.plant.example or mes.plant.example:8443"
                ));
            }
        }
        if !hosts.is_empty() && secret_file.is_empty() {
            faults.push("callbacks.secret_file: has to be given with callbacks.hosts".to_owned());
        }
        for OwnerSecret { owner, secret_file } in owners {
            if owner.is_empty() || secret_file.is_empty() {
                faults.push("callbacks.owners: each needs an owner and a secret_file".to_owned());
            }
        }
        if !(0.1..=60.0).contains(timeout_s) {
            faults.push(format!("callbacks.timeout_s = {timeout_s}: must be 0.1 to 60 s"));
        }
        if pauses_s.len() > 30 || !pauses_s.iter().all(|pause| (0.0..=604_800.0).contains(pause)) {
            faults.push("callbacks.pauses_s: must be at most 30 pauses of 0 to 604800 s".to_owned());
        }
        let Traces { endpoint, share } = &self.traces;
        let is_http = |url: url::Url| matches!(url.scheme(), "http" | "https") && url.has_host();
        if !endpoint.is_empty() && !endpoint.parse().is_ok_and(is_http) {
            faults.push(format!(
                "traces.endpoint = \"{endpoint}\": must be an address such as http://127.0.0.1:4318/v1/traces"
            ));
        }
        if !(0.0..=1.0).contains(share) {
            faults.push(format!("traces.share = {share}: must be 0 to 1"));
        }
    }
}

/// A host that may be called, with its port where one is given: as they stand in an address that was read.
pub(crate) fn allowed_host(text: &str) -> Option<(String, Option<u16>)> {
    // The default port of its scheme would not be told from none; no scheme has port 0.
    let url: url::Url = format!("precut://{text}").parse().ok()?;
    let is_bare = url.path().is_empty() && url.query().is_none() && url.fragment().is_none();
    let is_nobodys = url.username().is_empty() && url.password().is_none();
    let port = url.port();
    if !is_bare || !is_nobodys || text.contains(['@', '*']) || text.ends_with(':') {
        return None;
    }
    // A host of a scheme that the web knows is brought into its one form: lower case, Punycode, numbers as addresses.
    let host: url::Url = format!("http://{}", url.host_str()?).parse().ok()?;
    let host = host.host_str()?;
    Some((host.strip_suffix('.').unwrap_or(host).to_owned(), port))
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

/// What the names of settings in the environment begin with.
const PREFIX: &str = "PRECUT_";
/// Variables that the command line itself reads: the file, and the language of what it says.
const OF_THE_COMMAND_LINE: [&str; 2] = ["config", "lang"];

/// Whether Kubernetes put a variable there: it tells every container the addresses of a service called `precut`.
fn is_of_the_cluster(key: &str, value: &str) -> bool {
    key.starts_with("service_") || key.starts_with("port_") || (key == "port" && value.contains("://"))
}

/// A setting from the environment.
struct Variable {
    name: String,
    key: String,
    value: String,
}

impl Variable {
    /// `None` for variables that are no settings.
    fn new((name, value): (String, String)) -> Option<Self> {
        let key = name.strip_prefix(PREFIX)?.to_ascii_lowercase();
        if OF_THE_COMMAND_LINE.contains(&key.as_str()) || is_of_the_cluster(&key, &value) {
            return None;
        }
        let sectioned = SECTIONS.iter().find_map(|section| {
            key.strip_prefix(section).and_then(|rest| rest.strip_prefix('_')).map(|rest| format!("{section}.{rest}"))
        });
        Some(Self { name, key: sectioned.unwrap_or(key), value })
    }

    /// Whether it is in no section and no setting: somebody else's variable, or a slip. It stops nothing.
    fn is_stray(&self) -> bool {
        !self.key.contains('.') && !OUTSIDE.contains(&self.key.as_str()) && !SECTIONS.contains(&self.key.as_str())
    }

    fn said(&self) -> String {
        let nearest = crate::registry::nearest(&self.key, OUTSIDE.into_iter());
        let meant = nearest.map(|name| format!("; did you mean {PREFIX}{}?", name.to_uppercase())).unwrap_or_default();
        format!("environment variable {} is no setting and is passed over{meant}", self.name)
    }
}

impl Provider for Variable {
    fn metadata(&self) -> Metadata {
        Metadata::named(format!("environment variable {}", self.name))
    }

    fn data(&self) -> figment::Result<Map<Profile, Dict>> {
        let value = if WORDS.contains(&self.key.as_str()) {
            Value::from(self.value.clone())
        } else {
            self.value.parse().unwrap_or_else(|never: std::convert::Infallible| match never {})
        };
        let nested = figment::util::nest(&self.key, value).into_dict().unwrap_or_default();
        Ok(Map::from([(Profile::Default, nested)]))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn load(file: &str, environment: &[(&str, &str)], flags: &Flags) -> Result<Config, ConfigError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("precut.toml");
        std::fs::write(&path, file).unwrap();
        let environment = environment.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned()));
        Config::from_sources(Some(&path), environment, flags)
    }

    #[test]
    fn the_default_file_is_complete_and_valid() {
        assert_eq!(load("", &[], &Flags::default()).unwrap(), Config::default());
    }

    #[test]
    fn flags_win_over_environment_over_file_over_defaults() {
        let file = "data = \"from-file\"\ncpu = 1\n[limits]\njson_bytes = 1\nburst = 7.0\n[log]\nformat = \"json\"";
        let environment = [
            ("PRECUT_DATA", "from-environment"),
            ("PRECUT_LIMITS_JSON_BYTES", "2"),
            ("PRECUT_CONFIG", "ignored-here"),
            ("HOME", "/nobody"),
        ];
        let flags = Flags {
            data: Some("from-flag".into()),
            log_level: Some("debug".to_owned()),
            listen: Some("127.0.0.1:9".parse().unwrap()),
            ..Flags::default()
        };
        let config = load(file, &environment, &flags).unwrap();
        assert_eq!(config.data, PathBuf::from("from-flag"));
        assert_eq!(config.limits.json_bytes, 2);
        assert_eq!(config.cpu, 1);
        assert_eq!(config.log, Log { level: "debug".to_owned(), format: LogFormat::Json });
        assert_eq!(config.listen.port(), 9);
        assert_eq!(config.limits.multipart_bytes, Config::default().limits.multipart_bytes);
        let config = load(file, &[("PRECUT_DATA", "2026")], &Flags::default()).unwrap();
        assert_eq!(config.data, PathBuf::from("2026"));
    }

    #[test]
    fn unknown_keys_are_refused_by_name_wherever_they_stand() {
        let error = load("[limits]\njson_byte = 1", &[], &Flags::default()).unwrap_err().to_string();
        assert!(error.contains("json_byte") && error.contains("precut.toml"), "{error}");
        let error = load("", &[("PRECUT_LIMITS_JSON_BYTE", "1")], &Flags::default()).unwrap_err().to_string();
        assert!(error.contains("json_byte") && error.contains("PRECUT_LIMITS_JSON_BYTE"), "{error}");
    }

    #[test]
    fn a_stray_variable_stops_nothing_and_is_told_with_the_nearest() {
        let strays = [("PRECUT_LISTN", "127.0.0.1:1"), ("PRECUT_URL", "http://cam"), ("PRECUT_PORT", "8080")];
        let config = load("", &strays, &Flags::default()).unwrap();
        assert_eq!(config.listen, Config::default().listen);
        assert_eq!(config.strays.len(), 3);
        assert!(config.strays[0].contains("PRECUT_LISTN") && config.strays[0].contains("PRECUT_LISTEN?"));
        assert!(config.strays[1].contains("PRECUT_URL") && !config.strays[1].contains("did you mean"));
    }

    #[test]
    fn an_address_of_its_own_for_health_and_metrics_is_none_unless_it_is_given() {
        assert_eq!(Config::default().admin_listen, None);
        let config = load("", &[("PRECUT_ADMIN_LISTEN", "127.0.0.1:9090")], &Flags::default()).unwrap();
        assert_eq!(config.admin_listen, Some("127.0.0.1:9090".parse().unwrap()));
        assert_eq!(toml::from_str::<Config>(&config.to_toml()).unwrap(), config);
        assert!(config.is_loopback());
        let config = load("admin_listen = \"0.0.0.0:9090\"", &[], &Flags::default()).unwrap();
        assert!(!config.is_loopback(), "others reach the metrics, too");
        let error = load("admin_listen = \"here\"", &[], &Flags::default()).unwrap_err().to_string();
        assert!(error.contains("admin_listen"), "{error}");
    }

    #[test]
    fn what_is_no_setting_is_left_alone() {
        let others = [
            ("PRECUT_LANG", "ru"),
            ("PRECUT_SERVICE_HOST", "10.0.0.7"),
            ("PRECUT_SERVICE_PORT_HTTP", "8080"),
            ("PRECUT_PORT", "tcp://10.0.0.7:8080"),
            ("PRECUT_PORT_8080_TCP_ADDR", "10.0.0.7"),
        ];
        assert_eq!(load("", &others, &Flags::default()).unwrap(), Config::default());
    }

    #[test]
    fn senseless_values_are_all_reported_at_once() {
        let file = "[limits]\njson_bytes = 0\nbody_timeout_s = -1.0\n[cors]\norigins = [\"cam\"]\n\
                    [auth]\nkeys = [{ name = \"cam\", hash = \"12\" }]\n[log]\nlevel = \"precut=loud\"";
        let error = load(file, &[], &Flags::default()).unwrap_err().to_string();
        for name in ["json_bytes", "body_timeout_s", "cors.origins", "auth.keys[0]", "log.level"] {
            assert!(error.contains(name), "{name} missing in: {error}");
        }
    }

    #[test]
    fn settings_of_the_wrong_type_are_reported_with_all_others() {
        let file = "cpu = \"many\"\n[limits]\njson_bytes = \"big\"\nburst = 0.5\n[log]\nformat = \"xml\"";
        let error = load(file, &[("PRECUT_LISTEN", "here")], &Flags::default()).unwrap_err().to_string();
        for name in ["cpu", "limits.json_bytes", "limits.burst", "log.format", "PRECUT_LISTEN"] {
            assert!(error.contains(name), "{name} missing in: {error}");
        }
        assert_eq!(error.lines().count(), 5, "{error}");
    }

    #[test]
    fn a_host_that_may_be_called_is_brought_into_its_one_form() {
        let host = |text| allowed_host(text).map(|(host, port)| format!("{host} {port:?}"));
        assert_eq!(host("MES.Plant.example").as_deref(), Some("mes.plant.example None"));
        assert_eq!(host("mes.plant.example.:8443").as_deref(), Some("mes.plant.example Some(8443)"));
        assert_eq!(host("mes.plant.example:443").as_deref(), Some("mes.plant.example Some(443)"));
        assert_eq!(host("0x7f.1:80").as_deref(), Some("127.0.0.1 Some(80)"));
        assert_eq!(host("[::1]:8000").as_deref(), Some("[::1] Some(8000)"));
        for bad in
            ["", "https://mes.plant.example", "mes/path", "user@mes", "mes:", "mes:x", "*", "a b", "mes?x", "mes#x"]
        {
            assert_eq!(host(bad), None, "{bad}");
        }
    }

    #[test]
    fn settings_of_what_is_sent_outward_are_looked_at() {
        let file = "[callbacks]\nhosts = [\"https://mes\"]\ntimeout_s = 0.0\npauses_s = [-1.0]\n\
                    owners = [{ owner = \"cam\", secret_file = \"\" }]\n\
                    [traces]\nendpoint = \"collector:4318\"\nshare = 2.0";
        let error = load(file, &[], &Flags::default()).unwrap_err().to_string();
        for name in ["hosts", "secret_file", "owners", "timeout_s", "pauses_s"].map(|name| format!("callbacks.{name}"))
        {
            assert!(error.contains(&name), "{name} missing in: {error}");
        }
        assert!(error.contains("traces.endpoint") && error.contains("traces.share"), "{error}");
        let environment = [("PRECUT_CALLBACKS_HOSTS", "[\"mes:80\"]"), ("PRECUT_CALLBACKS_SECRET_FILE", "12")];
        let config = load("", &environment, &Flags::default()).unwrap();
        assert_eq!(
            (config.callbacks.hosts, config.callbacks.secret_file),
            (vec!["mes:80".to_owned()], "12".to_owned())
        );
    }

    #[test]
    fn the_printed_configuration_reads_back_and_hides_secrets() {
        let mut config = Config::default();
        assert_eq!(toml::from_str::<Config>(&config.to_toml()).unwrap(), config);
        let hash = "ab".repeat(32);
        config.auth.keys.push(ApiKey { name: "cam".to_owned(), hash: hash.clone(), ..ApiKey::default() });
        assert!(!config.to_toml().contains(&hash));
    }
}
