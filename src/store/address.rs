//! Where the store is: a file in the data folder, or a PostgreSQL database. An address may hold a password, so that it
//! is never shown whole.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Where results, jobs and the queue are kept.
#[derive(Clone, Default, PartialEq, Eq)]
pub enum StoreAddress {
    /// In an SQLite file in the data folder, for one process.
    #[default]
    Sqlite,
    /// In a PostgreSQL database, for any number of processes.
    Postgres(Secret),
}

/// An address with credentials in it.
#[derive(Clone, PartialEq, Eq)]
pub struct Secret(String);

impl Secret {
    /// The whole address.
    pub(super) fn reveal(&self) -> &str {
        &self.0
    }
}

/// An address as it was given, read or not yet.
#[derive(Clone, PartialEq, Eq)]
pub struct Given(String);

impl Given {
    /// The whole text.
    pub(crate) fn reveal(&self) -> &str {
        &self.0
    }
}

impl FromStr for Given {
    type Err = std::convert::Infallible;
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Ok(Self(text.to_owned()))
    }
}

impl fmt::Debug for Given {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("(hidden)")
    }
}

/// A text that is no address of a store. It does not repeat the text, which may hold a password.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("store: must be \"sqlite\" or an address such as postgres://user:password@host:5432/database")]
pub struct BadAddress;

impl FromStr for StoreAddress {
    type Err = BadAddress;
    fn from_str(text: &str) -> Result<Self, BadAddress> {
        if text == "sqlite" {
            return Ok(Self::Sqlite);
        }
        let is_postgres = ["postgres://", "postgresql://"].iter().any(|scheme| text.starts_with(scheme));
        if is_postgres { Ok(Self::Postgres(Secret(text.to_owned()))) } else { Err(BadAddress) }
    }
}

impl StoreAddress {
    /// Whether other processes may use the same store.
    pub const fn is_shared(&self) -> bool {
        matches!(self, Self::Postgres(_))
    }

    /// The same without what stands before the host and behind the database: there may be credentials.
    pub fn shown(&self) -> String {
        match self {
            Self::Sqlite => "sqlite".to_owned(),
            Self::Postgres(Secret(address)) => {
                let rest = address.split_once("://").map_or("", |(_, rest)| rest);
                let rest = rest.split(['?', '#']).next().unwrap_or_default();
                // A password may hold an unescaped `@`: the host stands behind the last one.
                let host = rest.rsplit('@').next().unwrap_or_default();
                if host.len() < rest.len() {
                    format!("postgres://(hidden)@{host}")
                } else {
                    format!("postgres://{host}")
                }
            }
        }
    }
}

impl fmt::Debug for StoreAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.shown())
    }
}

impl fmt::Display for StoreAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.shown())
    }
}

impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("(hidden)")
    }
}

/// As it may be shown.
impl Serialize for StoreAddress {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.shown())
    }
}

impl<'de> Deserialize<'de> for StoreAddress {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn credentials_are_shown_nowhere() {
        for (text, shown) in [
            ("postgres://anna:secret@db:5432/precut", "postgres://(hidden)@db:5432/precut"),
            ("postgresql://anna:se@cret@db/precut?password=secret", "postgres://(hidden)@db/precut"),
            ("postgres://db/precut", "postgres://db/precut"),
            ("postgres://db/precut?user=anna&password=secret", "postgres://db/precut"),
        ] {
            let address: StoreAddress = text.parse().unwrap();
            assert_eq!(address.shown(), shown);
            let all = format!("{address} {address:?} {}", serde_json::to_string(&address).unwrap());
            assert!(!all.contains("anna") && !all.contains("cret"), "{all}");
        }
        let fault = "postgrs://anna:secret@db/precut".parse::<StoreAddress>().unwrap_err().to_string();
        assert!(!fault.contains("anna") && !fault.contains("secret@"), "{fault}");
    }
}
