//! Who asks: optional bearer keys, of which only the hashes are known here, and what may be done with each.

use std::sync::{Arc, PoisonError, RwLock};

use axum::http::header::AUTHORIZATION;
use axum::http::{HeaderMap, Method};

use crate::config::{self, Scope};
use crate::engine::Shelf;

/// The keys that open the service.
pub(super) struct Keys(RwLock<Arc<Vec<Known>>>);

struct Known {
    hash: blake3::Hash,
    holder: Arc<Holder>,
}

/// Whose key it is.
#[derive(Debug)]
pub(super) struct Holder {
    /// What the key is called.
    pub(super) name: String,
    /// Whose things it shows.
    pub(super) owner: String,
    scopes: Vec<Scope>,
}

/// Who asks, as far as keys tell.
#[derive(Debug, Clone)]
pub(super) enum Caller {
    /// The service asks nobody for a key.
    Anyone,
    /// The key is one of ours.
    Holder(Arc<Holder>),
    /// There is no key, or another.
    Stranger,
}

impl Keys {
    /// Those of a configuration that was checked.
    pub(super) fn new(auth: &config::Auth) -> Self {
        Self(RwLock::new(Arc::new(known(auth))))
    }

    /// From now on these, unless that would open to everybody what keys guard; whether they are in force.
    pub(super) fn replace(&self, auth: &config::Auth) -> bool {
        let mut there = self.0.write().unwrap_or_else(PoisonError::into_inner);
        let new = known(auth);
        let opens = new.is_empty() && !there.is_empty();
        if !opens {
            *there = Arc::new(new);
        }
        !opens
    }

    /// Who asks. Takes the same time whichever key it is, and whether it is one.
    pub(super) fn caller(&self, headers: &HeaderMap) -> Caller {
        let keys = Arc::clone(&self.0.read().unwrap_or_else(PoisonError::into_inner));
        if keys.is_empty() {
            return Caller::Anyone;
        }
        let bearer = headers.get(AUTHORIZATION).and_then(|sent| sent.to_str().ok()?.split_once(' '));
        let Some((_, token)) = bearer.filter(|(scheme, _)| scheme.eq_ignore_ascii_case("bearer")) else {
            return Caller::Stranger;
        };
        let sent = hash(token.trim());
        // `blake3::Hash` compares in constant time; every key is compared.
        let found = keys.iter().fold(None, |found, known| if known.hash == sent { Some(&known.holder) } else { found });
        found.map_or(Caller::Stranger, |holder| Caller::Holder(Arc::clone(holder)))
    }
}

fn known(auth: &config::Auth) -> Vec<Known> {
    let known = |key: &config::ApiKey| {
        let owner = key.owner.clone().unwrap_or_else(|| key.name.clone());
        let holder = Arc::new(Holder { name: key.name.clone(), owner, scopes: key.scopes.clone() });
        Some(Known { hash: blake3::Hash::from_hex(&key.hash).ok()?, holder })
    };
    auth.keys.iter().filter_map(known).collect()
}

impl Caller {
    /// Whether something may be done.
    pub(super) fn may(&self, scope: &Scope) -> bool {
        match self {
            Self::Anyone => true,
            Self::Holder(holder) => holder.scopes.iter().any(|own| match (own, scope) {
                // Who writes processes reports their parts, too.
                (Scope::Admin, _) | (Scope::Processes | Scope::Parts(None), Scope::Parts(_)) => true,
                _ => own == scope,
            }),
            Self::Stranger => false,
        }
    }

    /// The name by which records know whose they are; none without a key.
    pub(super) fn owner(&self) -> Option<String> {
        match self {
            Self::Holder(holder) => Some(format!("key:{}", holder.owner)),
            Self::Anyone | Self::Stranger => None,
        }
    }

    /// Whose things are shown; those of all where it is none.
    pub(super) fn shown(&self) -> Option<String> {
        self.owner().filter(|_| !self.may(&Scope::Admin))
    }

    /// Whether a thing of that owner is shown.
    pub(super) fn sees(&self, owner: &str) -> bool {
        self.shown().is_none_or(|own| own == owner)
    }

    /// Where the models are that are found by their names.
    pub(super) fn shelf(&self) -> Shelf {
        match self {
            Self::Holder(holder) => Shelf::of(&holder.owner),
            Self::Anyone | Self::Stranger => Shelf::default(),
        }
    }
}

/// Addresses of records.
const RECORDS: [&str; 5] = ["/v1/machines", "/v1/tools", "/v1/materials", "/v1/parts", "/v1/library"];

/// What must be allowed for a request under `/v1/` or for the metrics.
pub(super) fn needed(method: &Method, path: &str) -> Scope {
    let is_reading = matches!(*method, Method::GET | Method::HEAD | Method::OPTIONS);
    match path {
        "/metrics" => Scope::Admin,
        _ if is_reading => Scope::Read,
        _ if path.starts_with("/v1/models") => Scope::Models,
        _ if path.starts_with("/v1/processes") => of_process(method, path),
        // Nothing is stored.
        "/v1/tools/parse" => Scope::Solve,
        _ if RECORDS.iter().any(|folder| path.starts_with(folder)) => Scope::Library,
        _ => Scope::Solve,
    }
}

/// What writing to a process takes: a gauge station reports parts and nothing else.
fn of_process(method: &Method, path: &str) -> Scope {
    match path.split('/').collect::<Vec<_>>()[..] {
        ["", "v1", "processes", name, "parts", _] if *method == Method::PUT => Scope::Parts(Some(name.to_owned())),
        _ => Scope::Processes,
    }
}

/// The hash under which a key stands in the configuration.
pub fn hash(key: &str) -> blake3::Hash {
    blake3::hash(key.as_bytes())
}
