//! What stands behind the question mark of an address.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::ops::RangeInclusive;
use std::str::FromStr;

use axum::extract::Query as Pairs;
use axum::http::{StatusCode, Uri};
use precut_library::Kind;
use precut_library::record::is_name;

use super::problem::Problem;
use crate::engine::{Engine, Error};
use crate::registry::nearest;

/// Most things on one page of a list.
pub(super) const MOST_ITEMS: u32 = 500;
/// As many on a page unless asked for more or fewer.
pub(super) const DEFAULT_ITEMS: u32 = 50;

/// The first of things of which one more was read than a page takes, and whether there is another page.
pub(super) fn page<T>(mut things: Vec<T>, limit: u32) -> (Vec<T>, bool) {
    let more = things.len() > limit as usize;
    things.truncate(limit as usize);
    (things, more)
}

/// The parameters of a request, each once and each known to its address.
pub(super) struct Query(BTreeMap<String, String>);

impl Query {
    /// The query of an address that knows these parameters.
    pub(super) fn of(uri: &Uri, known: &'static [&'static str]) -> Result<Self, Problem> {
        let mut given = BTreeMap::new();
        if uri.query().is_none_or(str::is_empty) {
            return Ok(Self(given));
        }
        let Pairs(pairs) = Pairs::<Vec<(String, String)>>::try_from_uri(uri)
            .map_err(|error| fault("unreadable", "").with("reason", error.body_text()))?;
        for (name, value) in pairs {
            if !known.contains(&name.as_str()) {
                let fault = fault("unknown", &name).with("known", words(known.iter().copied()));
                return Err(match nearest(&name, known.iter().copied()) {
                    Some(nearest) => fault.with("nearest", nearest),
                    None => fault,
                });
            }
            if given.contains_key(&name) {
                return Err(fault("repeated", &name));
            }
            given.insert(name, value);
        }
        Ok(Self(given))
    }

    /// A text.
    pub(super) fn text(&mut self, name: &str) -> Option<String> {
        self.0.remove(name)
    }

    /// The name of a calculator that there is.
    pub(super) fn calculator(&mut self, engine: &Engine) -> Result<Option<String>, Problem> {
        let id = self.text("calculator");
        match &id {
            Some(id) if engine.entry(id).is_none() => Err(Error::unknown(engine.registry(), id).into()),
            _ => Ok(id),
        }
    }

    /// A record that jobs name, of one revision or any: `machines/lathe-3@4`.
    pub(super) fn record(&mut self) -> Result<Option<String>, Problem> {
        const NAME: &str = "record";
        let Some(text) = self.text(NAME) else { return Ok(None) };
        let is_one = text.split_once('/').is_some_and(|(folder, name)| {
            let (name, revision) = name.split_once('@').map_or((name, "1"), |(name, revision)| (name, revision));
            Kind::NAMED.into_iter().any(|kind| kind.plural() == folder)
                && is_name(name)
                && revision.parse::<u32>().is_ok_and(|number| number > 0 && number.to_string() == revision)
        });
        if is_one { Ok(Some(text)) } else { Err(fault("no_record", NAME).with("received", text)) }
    }

    /// A text that cannot be left out.
    pub(super) fn needed(&mut self, name: &'static str) -> Result<String, Problem> {
        self.text(name).ok_or_else(|| fault("missing", name))
    }

    /// A number within a range that cannot be left out.
    pub(super) fn needed_number<T>(&mut self, name: &'static str, range: &RangeInclusive<T>) -> Result<T, Problem>
    where
        T: FromStr + PartialOrd + Display,
    {
        self.number(name, range)?.ok_or_else(|| fault("missing", name))
    }

    /// A number within a range.
    pub(super) fn number<T>(&mut self, name: &'static str, range: &RangeInclusive<T>) -> Result<Option<T>, Problem>
    where
        T: FromStr + PartialOrd + Display,
    {
        let Some(text) = self.text(name) else { return Ok(None) };
        let number = text.parse().ok().filter(|number| range.contains(number));
        number.map(Some).ok_or_else(|| {
            let (least, most) = (range.start().to_string(), range.end().to_string());
            fault("out_of_range", name).with("received", text).with("least", least).with("most", most)
        })
    }

    /// How many things a page shall have.
    pub(super) fn limit(&mut self) -> Result<u32, Problem> {
        Ok(self.number("limit", &(1..=MOST_ITEMS))?.unwrap_or(DEFAULT_ITEMS))
    }

    /// One of some words.
    pub(super) fn one_of<T: Copy>(
        &mut self,
        name: &'static str,
        known: &[T],
        word: impl Fn(T) -> &'static str,
    ) -> Result<Option<T>, Problem> {
        let Some(text) = self.text(name) else { return Ok(None) };
        let found = known.iter().copied().find(|&one| word(one) == text);
        found.map(Some).ok_or_else(|| {
            let known = words(known.iter().map(|&one| word(one)));
            fault("no_such_word", name).with("received", text).with("known", known)
        })
    }

    /// Where the page before ended, as `next` of that page gave it.
    pub(super) fn after<T: FromStr>(&mut self) -> Result<Option<T>, Problem> {
        const NAME: &str = "after";
        let Some(text) = self.text(NAME) else { return Ok(None) };
        text.parse().map(Some).map_err(|_| fault("no_page", NAME).with("received", text))
    }
}

fn fault(fault: &'static str, name: &str) -> Problem {
    Problem::new(StatusCode::BAD_REQUEST, "bad_query").with("fault", fault).with("name", name.to_owned())
}

fn words<'a>(words: impl Iterator<Item = &'a str>) -> Vec<String> {
    words.map(ToOwned::to_owned).collect()
}
