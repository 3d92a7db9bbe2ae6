//! The flags of the command line.

use std::net::SocketAddr;
use std::path::PathBuf;

use serde::Serialize;

use super::{LogFormat, Role};
use crate::store::address::Given;

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
