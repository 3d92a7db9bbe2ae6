//! What a study is about, told from its bytes before any of its lists is kept.

use std::fmt;

use serde::Deserialize;
use serde::de::{Deserializer, IgnoredAny, SeqAccess, Visitor};

use super::expand::tokens;
use super::input::MOST_VARIABLES;
use crate::registry::{Entry, Registry, Shape};

/// Whose job is varied, and where.
#[derive(Deserialize)]
struct Head {
    calculator: String,
    #[serde(default)]
    job: Job,
    #[serde(default)]
    vary: Vary,
}

/// The job of a study. Those of some entries say themselves whose they are.
#[derive(Default, Deserialize)]
struct Job {
    calculator: Option<String>,
}

#[derive(Deserialize)]
struct Variable {
    pointer: String,
}

/// As many variables as there may be; of further ones nothing is kept.
#[derive(Default)]
struct Vary(Vec<Variable>);

impl<'de> Deserialize<'de> for Vary {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_seq(FirstFew)
    }
}

struct FirstFew;

impl<'de> Visitor<'de> for FirstFew {
    type Value = Vary;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list of variables")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut access: A) -> Result<Vary, A::Error> {
        let mut first = Vec::new();
        while first.len() < MOST_VARIABLES {
            match access.next_element()? {
                Some(variable) => first.push(variable),
                None => return Ok(Vary(first)),
            }
        }
        while access.next_element::<IgnoredAny>()?.is_some() {}
        Ok(Vary(first))
    }
}

/// What the body of a study may be made of, its job among it. Rows that a variable leads into are held to nothing: what they
/// lack may be filled in at the points. Nothing where it cannot be told whose job it is; such a study is refused.
pub(crate) fn shape(registry: &Registry, studies: &Entry, body: &[u8]) -> Option<Shape> {
    let head: Head = serde_json::from_slice(body.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(body)).ok()?;
    let entry = registry.entry(&head.calculator)?;
    let named = head.job.calculator.and_then(|calculator| entry.shape_of_member(&calculator));
    let mut job = named.unwrap_or_else(|| registry.shape_of(entry)).clone();
    for tokens in head.vary.0.iter().filter_map(|variable| tokens(&variable.pointer)) {
        job.spare(&tokens);
    }
    Some(registry.shape_of(studies).clone().with_field("job", job))
}
