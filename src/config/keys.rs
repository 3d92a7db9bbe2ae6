//! Who may call the service, and what each key may do.

use serde::{Deserialize, Serialize};

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
