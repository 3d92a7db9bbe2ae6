//! What a kept result or a job was, in a few words: by its marks a person finds it again in a list.
//!
//! Nothing is kept for it: marks are read from the filled job, which is kept anyway, and belong to its key for ever.

use std::collections::HashMap;
use std::hash::Hash;
use std::sync::Arc;

use bytes::Bytes;
use futures_util::future::BoxFuture;
use precut_calc::calculator::Hallmark;
use quick_cache::sync::Cache;
use serde_json::Value;

use super::{Engine, Key};
use crate::registry::{Entry, Registry, way};
use crate::store::StoreError;
use crate::store::jobs::JobId;
use crate::text::{Mark, Said};

/// Larger jobs, compressed, are not read for a list: measured tables of some ten thousand numbers.
const MOST_BYTES: usize = 64 << 10;
/// So many jobs are read at once.
const READ_AT_ONCE: usize = 50;
/// Summaries that are remembered, of a few hundred bytes each.
const REMEMBERED: usize = 4000;
/// Of a job inside another one only so much is told.
const MARKS_INSIDE: usize = 4;
/// So many words of a list are told.
const MOST_WORDS: usize = 3;
/// Stands for every item of a list.
const EVERY: &str = "*";

/// What tells a job from others, to be said in any language.
pub(crate) type Summary = Arc<[Mark]>;

/// Summaries that were asked for lately.
pub(super) struct Summaries {
    known: Cache<Key, Summary>,
}

impl Default for Summaries {
    fn default() -> Self {
        Self { known: Cache::new(REMEMBERED) }
    }
}

impl Engine {
    /// What kept results are results of, as far as that can be read: `(key, calculator)` of each.
    pub(crate) async fn summaries(&self, results: &[(Key, String)]) -> HashMap<Key, Summary> {
        let all: Vec<_> = results.iter().map(|(key, calculator)| (*key, *key, calculator.clone())).collect();
        self.summarised(all, |keys| self.inner.store.inputs(keys, MOST_BYTES)).await
    }

    /// What jobs compute, as far as that can be read: `(id, key, calculator)` of each; by their keys.
    pub(crate) async fn job_summaries(&self, jobs: &[(JobId, Key, String)]) -> HashMap<Key, Summary> {
        self.summarised(jobs.to_vec(), |ids| self.inner.jobs.store.job_inputs(ids, MOST_BYTES)).await
    }

    /// A list is complete without: what cannot be read has no summary.
    async fn summarised<'s, I, R>(&self, asked: Vec<(I, Key, String)>, read: R) -> HashMap<Key, Summary>
    where
        I: Copy + Eq + Hash + Send + 'static,
        R: Fn(Vec<I>) -> BoxFuture<'s, Result<Vec<(I, Bytes)>, StoreError>>,
    {
        let known = &self.inner.summaries.known;
        let mut found = HashMap::new();
        let mut wanted = Vec::new();
        for (id, key, calculator) in asked {
            match known.get(&key) {
                Some(summary) => drop(found.insert(key, summary)),
                None => wanted.push((id, (key, calculator))),
            }
        }
        for part in wanted.chunks(READ_AT_ONCE) {
            let inputs = match read(part.iter().map(|(id, _)| *id).collect()).await {
                Ok(inputs) => inputs,
                Err(error) => {
                    tracing::debug!(%error, "a list is told without what its jobs were");
                    break;
                }
            };
            let of: HashMap<I, (Key, String)> = part.iter().cloned().collect();
            let inner = Arc::clone(&self.inner);
            // Unpacking and reading may take milliseconds.
            let told = tokio::task::spawn_blocking(move || {
                let told = inputs.into_iter().filter_map(|(id, packed)| {
                    let (key, calculator) = of.get(&id)?;
                    let entry = inner.entry(calculator)?;
                    let job = serde_json::from_slice(&zstd::decode_all(&*packed).ok()?).ok()?;
                    Some((*key, Summary::from(marks(&inner.registry, entry, &job))))
                });
                told.collect::<Vec<_>>()
            });
            for (key, summary) in told.await.unwrap_or_default() {
                known.insert(key, Arc::clone(&summary));
                found.insert(key, summary);
            }
        }
        found
    }
}

/// What is told of a filled job.
fn marks(registry: &Registry, entry: &Arc<Entry>, job: &Value) -> Vec<Mark> {
    let mut told = Vec::new();
    // A diagnosis or a study has the job of another calculator in it.
    let inner = job["calculator"].as_str().and_then(|id| registry.entry(id)).filter(|_| job["job"].is_object());
    if let Some(inner) = inner {
        told.push(Mark::Title(inner.meta().title));
        told.extend(varied(inner, &job["vary"]));
    }
    told.extend(hallmarks(entry, job));
    if let Some(inner) = inner {
        told.extend(hallmarks(inner, &job["job"]).into_iter().take(MARKS_INSIDE));
    }
    for job in [job, &job["job"]] {
        if let Some(name) = job["model"]["name"].as_str() {
            told.push(Mark::Name(name.to_owned()));
        } else {
            told.extend(words(job["effects"].as_array().into_iter().flatten().map(|effect| &effect["kind"])));
        }
    }
    told
}

/// What a calculator declares that its jobs are known by.
pub(super) fn hallmarks(entry: &Entry, job: &Value) -> Vec<Mark> {
    let declared = entry.meta().hallmarks;
    if declared.is_empty() {
        return Vec::new();
    }
    let document = entry.input_document();
    let mark = |hallmark: &Hallmark| {
        let tokens = tokens(hallmark.pointer());
        let values = found(job, &tokens);
        let said = match hallmark {
            Hallmark::Of(_) => {
                let Some(said) = numbers(values.iter().copied()) else { return words(values.into_iter()) };
                said
            }
            Hallmark::Sum(_) => {
                let numbers: Vec<f64> = values.iter().filter_map(|value| value.as_f64()).collect();
                (!numbers.is_empty()).then(|| Said::Number(numbers.iter().sum()))?
            }
            Hallmark::Count(_) => Said::Count(values.first()?.as_array().map(Vec::len).filter(|&items| items > 0)?),
        };
        field(&document, entry.meta().id, &tokens, said)
    };
    declared.iter().filter_map(mark).collect()
}

/// The fields that a study varies, with their values.
fn varied(entry: &Entry, variables: &Value) -> Vec<Mark> {
    let Some(variables) = variables.as_array() else { return Vec::new() };
    let document = entry.input_document();
    let mark = |variable: &Value| {
        let ends = variable["from"].as_f64().zip(variable["to"].as_f64());
        let given = || variable["values"].as_array().into_iter().flatten();
        let said = match ends {
            Some((from, to)) => Said::Span(from, to),
            None => match numbers(given()) {
                Some(said) => said,
                None => return words(given()),
            },
        };
        field(&document, entry.meta().id, &tokens(variable["pointer"].as_str()?), said)
    };
    variables.iter().filter_map(mark).collect()
}

/// The field that the tokens lead to, called by its own name.
fn field(document: &Value, root: &str, tokens: &[String], said: Said) -> Option<Mark> {
    let first: Vec<String> =
        tokens.iter().map(|token| if token == EVERY { "0".to_owned() } else { token.clone() }).collect();
    let way = way(document, root, &first);
    let name = way.steps.into_iter().rev().find(|step| step.parse::<usize>().is_err())?;
    Some(Mark::Field { name, unit: way.unit, said })
}

/// One number, or the least and the largest of several.
fn numbers<'v>(values: impl Iterator<Item = &'v Value>) -> Option<Said> {
    let ends = values.filter_map(Value::as_f64).fold(None, |ends: Option<(f64, f64)>, number| {
        Some(ends.map_or((number, number), |(least, most)| (least.min(number), most.max(number))))
    });
    ends.map(|(least, most)| if least < most { Said::Span(least, most) } else { Said::Number(least) })
}

/// The first few different words.
fn words<'v>(values: impl Iterator<Item = &'v Value>) -> Option<Mark> {
    let mut words: Vec<String> = Vec::new();
    for word in values.filter_map(Value::as_str) {
        if !words.iter().any(|known| known == word) {
            words.push(word.to_owned());
        }
    }
    let more = words.len() > MOST_WORDS;
    words.truncate(MOST_WORDS);
    (!words.is_empty()).then_some(Mark::Words { words, more })
}

fn tokens(pointer: &str) -> Vec<String> {
    pointer.split('/').skip(1).map(|token| token.replace("~1", "/").replace("~0", "~")).collect()
}

/// Everything at a pointer in which `*` is every item.
fn found<'v>(value: &'v Value, tokens: &[String]) -> Vec<&'v Value> {
    let Some((first, rest)) = tokens.split_first() else { return vec![value] };
    match value {
        Value::Array(items) if first == EVERY => items.iter().flat_map(|item| found(item, rest)).collect(),
        Value::Object(fields) => fields.get(first).map_or_else(Vec::new, |field| found(field, rest)),
        _ => Vec::new(),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::text::{Language, told};

    /// What is declared leads to fields, and of every example something is told, in every language.
    #[test]
    fn every_calculator_tells_its_jobs_apart() {
        let registry = Registry::standard().unwrap();
        for entry in registry.entries() {
            let meta = entry.meta();
            let document = entry.input_document();
            assert!(!meta.hallmarks.is_empty(), "{}", meta.id);
            let mut seen = std::collections::BTreeSet::new();
            let mut apart = std::collections::BTreeSet::new();
            for example in meta.examples {
                let job: Value = serde_json::from_str(example.job).unwrap();
                let filled = entry.prepare(&job).ok().unwrap().canonical;
                let filled = serde_json::from_slice(&filled).unwrap();
                let marks = marks(&registry, entry, &filled);
                for language in Language::ALL {
                    let said = told(language, &marks);
                    assert!(said.len() > 12 && !said.contains('_'), "{} {}: {said}", meta.id, example.id);
                    let is_cyrillic = said.chars().any(|letter| ('а'..='я').contains(&letter));
                    assert_eq!(is_cyrillic, language == Language::Ru, "{} {}: {said}", meta.id, example.id);
                }
                apart.insert(told(Language::En, &marks));
                let there = meta.hallmarks.iter().map(|hallmark| hallmark.pointer());
                seen.extend(there.filter(|pointer| !found(&filled, &tokens(pointer)).is_empty()));
            }
            assert!(2 * apart.len() >= meta.examples.len(), "{}: {apart:#?}", meta.id);
            for hallmark in meta.hallmarks {
                let place = tokens(&hallmark.pointer().replace('*', "0"));
                let way = way(&document, meta.id, &place);
                assert!(way.steps.iter().all(|step| !step.starts_with('.')), "{}: {}", meta.id, hallmark.pointer());
            }
            let unseen: Vec<_> = meta.hallmarks.iter().filter(|hallmark| !seen.contains(hallmark.pointer())).collect();
            assert!(unseen.is_empty(), "{}: no example has {unseen:?}", meta.id);
        }
    }

    #[test]
    fn a_summary_has_the_numbers_of_the_job_and_of_the_one_inside() {
        let registry = Registry::standard().unwrap();
        let entry = registry.entry("deflection-compensation").unwrap();
        let job: Value = serde_json::json!({
            "shaft": {"segments": [{"length_mm": 150, "diameter_mm": 40}, {"length_mm": 700.5, "diameter_mm": 50}]},
            "cut": {"feed_mm_per_rev": 0.25},
            "effects": [{"kind": "tool_wear"}, {"kind": "tailstock_compliance"}],
        });
        let said = |language| told(language, &marks(&registry, entry, &job));
        assert_eq!(
            said(Language::En),
            "Diameter 40…50 mm · length 850.5 mm · feed 0.25 mm/rev · tool wear, tailstock compliance"
        );
        assert!(said(Language::Ru).starts_with("Диаметр 40…50 мм · длина 850,5 мм · подача 0,25 мм/об · "));
        let study = serde_json::json!({
            "calculator": "deflection-compensation", "job": job,
            "vary": [{"pointer": "/cut/feed_mm_per_rev", "from": 0.1, "to": 0.5, "count": 5},
                     {"pointer": "/shaft/segments/0/diameter_mm", "values": [40, 45]}],
        });
        let marks = marks(&registry, entry, &study);
        let said = told(Language::En, &marks);
        assert!(said.starts_with("Deflection compensation · feed 0.1…0.5 mm/rev · diameter 40…45 mm · "), "{said}");
        // A model is told in place of its effects; nothing is told of nothing.
        let named = super::marks(
            &registry,
            entry,
            &serde_json::json!({"model": {"name": "lathe-7"}, "effects": [{"kind": "tool_wear"}]}),
        );
        assert_eq!(told(Language::En, &named), "lathe-7");
        assert!(super::marks(&registry, entry, &serde_json::json!(7)).is_empty());
    }
}
