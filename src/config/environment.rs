//! Settings from the environment: `PRECUT_LOG_LEVEL` is `log.level`.

use std::sync::LazyLock;

use figment::value::{Dict, Map, Value};
use figment::{Metadata, Profile, Provider};

use super::DEFAULTS;

/// Every setting there is, with its default.
static KNOWN: LazyLock<toml::Table> = LazyLock::new(|| DEFAULTS.parse().expect("a test reads the defaults"));

/// What the names of settings in the environment begin with.
pub(super) const PREFIX: &str = "PRECUT_";
/// Variables that the command line itself reads: the file, and the language of what it says.
const OF_THE_COMMAND_LINE: [&str; 2] = ["config", "lang"];

/// Whether Kubernetes put a variable there: it tells every container the addresses of a service called `precut`.
fn is_of_the_cluster(key: &str, value: &str) -> bool {
    key.starts_with("service_") || key.starts_with("port_") || (key == "port" && value.contains("://"))
}

/// A setting from the environment.
pub(super) struct Variable {
    name: String,
    key: String,
    value: String,
}

impl Variable {
    /// `None` for variables that are no settings.
    pub(super) fn new((name, value): (String, String)) -> Option<Self> {
        let key = name.strip_prefix(PREFIX)?.to_ascii_lowercase();
        if OF_THE_COMMAND_LINE.contains(&key.as_str()) || is_of_the_cluster(&key, &value) {
            return None;
        }
        let section = KNOWN.iter().filter(|(_, value)| value.is_table()).find_map(|(section, _)| {
            let setting = key.strip_prefix(section.as_str())?.strip_prefix('_')?;
            Some(format!("{section}.{setting}"))
        });
        Some(Self { name, key: section.unwrap_or(key), value })
    }

    /// Whether it is in no section and no setting: somebody else's variable, or a slip. It stops nothing.
    pub(super) fn is_stray(&self) -> bool {
        !self.key.contains('.') && !KNOWN.contains_key(&self.key)
    }

    /// Whether it is a word even where it looks like a number: `PRECUT_DATA=2026`.
    fn is_word(&self) -> bool {
        let default = match self.key.split_once('.') {
            Some((section, setting)) => KNOWN.get(section).and_then(|section| section.get(setting)),
            None => KNOWN.get(&self.key),
        };
        default.is_some_and(toml::Value::is_str)
    }

    pub(super) fn said(&self) -> String {
        let settings = KNOWN.iter().filter(|(_, value)| !value.is_table()).map(|(name, _)| name.as_str());
        let nearest = crate::registry::nearest(&self.key, settings);
        let meant = nearest.map(|name| format!("; did you mean {PREFIX}{}?", name.to_uppercase())).unwrap_or_default();
        format!("environment variable {} is no setting and is passed over{meant}", self.name)
    }
}

impl Provider for Variable {
    fn metadata(&self) -> Metadata {
        Metadata::named(format!("environment variable {}", self.name))
    }

    fn data(&self) -> figment::Result<Map<Profile, Dict>> {
        let value = if self.is_word() {
            Value::from(self.value.clone())
        } else {
            self.value.parse().unwrap_or_else(|never: std::convert::Infallible| match never {})
        };
        let nested = figment::util::nest(&self.key, value).into_dict().unwrap_or_default();
        Ok(Map::from([(Profile::Default, nested)]))
    }
}
