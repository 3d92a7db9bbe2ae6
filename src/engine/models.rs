//! Stored models: made of what a diagnosis found, listed, read, deleted, and found for the jobs that name them.

use std::str::FromStr;

use precut_calc::calculator::Finding;
use precut_calc::diagnosis::{JointUncertainty, ParameterMove};
use serde::Deserialize;
use serde_json::{Value, json};

use super::compare::{self, ModelComparison};
use super::model::{self, ModelContent, UNCERTAINTY};
use super::{Engine, Error, Inner, Key, Stored, json as read_json};
use crate::registry::{Faults, ModelUse, Registry, canonical, nearest};
use crate::store::documents::{Before, KeptDocument, Kind, NewDocument, NewDocuments, Placed, PutDocuments};
use crate::store::jobs::JobId;

/// The calculator whose results can become models.
const DIAGNOSIS: &str = "diagnosis";
/// Largest content of a model, bytes. What a diagnosis gives takes some thousands, and models are kept until somebody
/// deletes them.
const MOST_CONTENT: usize = 256 << 10;

/// An owner's part of the stored models, machines, tools and materials: what stands before their names in the store. Names have no slash, so that none of
/// one shelf is one of another.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Shelf(String);

impl Shelf {
    /// That of an owner; that of a service that knows no owners is the default.
    pub fn of(owner: &str) -> Self {
        Self(format!("{}/", owner.replace('%', "%25").replace('/', "%2F")))
    }

    /// The owner and his name of what is kept under a full name.
    pub(super) fn split(full: &str) -> (String, &str) {
        let (owner, name) = full.rsplit_once('/').unwrap_or(("", full));
        (owner.replace("%2F", "/").replace("%25", "%"), name)
    }

    pub(super) fn full(&self, name: &str) -> String {
        format!("{}{name}", self.0)
    }

    /// A document under the name that its owner knows.
    pub(super) fn plain(&self, kept: KeptDocument) -> KeptDocument {
        let name = kept.name.strip_prefix(self.0.as_str()).map(ToOwned::to_owned);
        KeptDocument { name: name.unwrap_or(kept.name.clone()), ..kept }
    }

    /// What stands before the names.
    pub(super) fn prefix(&self) -> String {
        self.0.clone()
    }
}

/// A stored model.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredModel {
    /// Its name.
    pub name: String,
    /// From 1; a revision never changes.
    pub revision: u32,
    /// SHA-256 of its content in canonical JSON.
    pub sha256: String,
    /// When it was stored, ms since 1970, UTC.
    pub created_ms: i64,
    /// What it says.
    pub content: ModelContent,
}

/// Where a new revision comes from.
#[derive(Debug, Clone, PartialEq)]
pub enum ModelSource {
    /// The kept result of a diagnosis.
    Result(Key),
    /// A job that was a diagnosis.
    Job(JobId),
    /// A model that was read elsewhere, with its hash where it has one.
    Exported {
        /// What it says.
        content: ModelContent,
        /// What its hash was.
        sha256: Option<String>,
    },
}

/// What came of storing a model.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelAnswer {
    /// As it is kept.
    pub model: StoredModel,
    /// Whether nothing had the name before.
    pub is_new: bool,
}

/// Why a model is not stored or not found.
#[derive(Debug, Clone, PartialEq)]
pub enum ModelError {
    /// No model of that name, or no such revision of it; the name most like it.
    Unknown {
        /// The name asked for.
        name: String,
        /// The one most like it.
        nearest: Option<String>,
    },
    /// The name is taken, and only a new one was wanted.
    Exists(String),
    /// A process stores its own model under the name.
    OfProcess(String),
    /// What was sent breaks rules.
    Invalid(Vec<Finding>),
    /// No such result is kept.
    UnknownResult(Key),
    /// Anything else.
    Other(Error),
}

impl<E: Into<Error>> From<E> for ModelError {
    fn from(error: E) -> Self {
        Self::Other(error.into())
    }
}

impl ModelSource {
    /// What the body of a request says.
    pub fn read(body: &[u8]) -> Result<Self, ModelError> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Sent {
            from_result: Option<String>,
            from_job: Option<String>,
            calculator: Option<String>,
            effects: Option<Vec<Value>>,
            provenance: Option<Value>,
            sha256: Option<String>,
            // An exported document has these, too; the store gives its own.
            #[serde(rename = "name")]
            _name: Option<Value>,
            #[serde(rename = "revision")]
            _revision: Option<Value>,
            #[serde(rename = "created_at")]
            _created_at: Option<Value>,
            #[serde(rename = "links")]
            _links: Option<Value>,
        }
        let refuse = |code, pointer: &str| Err(ModelError::Invalid(vec![Finding::new(code, pointer)]));
        let value = read_json::parse(body)?;
        let sent: Sent = serde_path_to_error::deserialize(&value)
            .map_err(|error| ModelError::Invalid(vec![crate::registry::second_line(&error)]))?;
        match (sent.from_result, sent.from_job, sent.calculator, sent.effects) {
            (Some(key), None, None, None) => match Key::from_str(&key) {
                Ok(key) => Ok(Self::Result(key)),
                Err(_) => refuse("not_a_key", "/from_result"),
            },
            (None, Some(id), None, None) => match JobId::from_str(&id) {
                Ok(id) => Ok(Self::Job(id)),
                Err(_) => refuse("not_a_job_id", "/from_job"),
            },
            (None, None, Some(calculator), Some(effects)) => {
                let provenance = sent.provenance.unwrap_or(Value::Null);
                Ok(Self::Exported { content: ModelContent { calculator, effects, provenance }, sha256: sent.sha256 })
            }
            _ => refuse("model_from_nothing", ""),
        }
    }
}

impl Engine {
    /// Stores a model as the next revision of its name, for an owner.
    pub async fn put_model(
        &self,
        shelf: &Shelf,
        name: &str,
        source: ModelSource,
        (only_new, owner): (bool, String),
    ) -> Result<ModelAnswer, ModelError> {
        let inner = &self.inner;
        if !model::is_name(name) {
            let finding = Finding::new("bad_model_name", "").with("name", name.to_owned());
            return Err(ModelError::Invalid(vec![finding]));
        }
        if inner.processes.process(shelf.full(name)).await?.is_some() {
            return Err(ModelError::OfProcess(name.to_owned()));
        }
        let content = match source {
            ModelSource::Result(key) => {
                content_of(&*self.result(&key).await?.ok_or(ModelError::UnknownResult(key))?, "/from_result")?
            }
            ModelSource::Job(id) => content_of(&*self.job_result(id).await?, "/from_job")?,
            ModelSource::Exported { content, sha256 } => {
                if !is_whole(&content, sha256.as_deref()) {
                    return Err(ModelError::Invalid(vec![Finding::new("model_damaged", "/sha256")]));
                }
                content
            }
        };
        let findings = faults_of_model(&inner.registry, &content);
        if !findings.is_empty() {
            return Err(ModelError::Invalid(findings));
        }
        let text = content.canonical();
        if text.len() > MOST_CONTENT {
            let finding = Finding::new("model_too_large", "").with("bytes", text.len()).with("most", MOST_CONTENT);
            return Err(ModelError::Invalid(vec![finding]));
        }
        let (bytes, sha256) = (text.len() as u64, model::sha256(&text));
        let new = NewDocument {
            kind: Kind::Model,
            name: shelf.full(name),
            class: content.calculator.clone(),
            words: String::new(),
            sha256: sha256.clone(),
            content: text,
        };
        let (quota, most) = (inner.settings.quota, u64::MAX);
        let new = NewDocuments { documents: vec![new], only_new, unless_equal: false, owner, quota, most };
        let placed = match inner.put_documents(new).await? {
            PutDocuments::Kept(placed) => placed,
            PutDocuments::Taken => return Err(ModelError::Exists(name.to_owned())),
            PutDocuments::OverQuota(usage) => return Err(inner.no_room(&usage, bytes).into()),
            PutDocuments::Full => Vec::new(),
        };
        let [Placed { revision, created_ms, before }] = placed[..] else {
            return Err(Error::internal(format!("model {name} is not kept")).into());
        };
        let model = StoredModel { name: name.to_owned(), revision, sha256, created_ms, content };
        Ok(ModelAnswer { model, is_new: before == Before::Nothing })
    }

    /// A model, `name` for its newest revision or `name@revision`.
    pub async fn model(&self, shelf: &Shelf, asked: &str) -> Result<StoredModel, ModelError> {
        let inner = &self.inner;
        let found = match model::asked(asked) {
            Some((name, revision)) => inner.documents.document(Kind::Model, shelf.full(&name), revision).await?,
            None => None,
        };
        match found.and_then(|kept| ModelContent::read(&kept).map(|content| stored(shelf.plain(kept), content))) {
            Some(model) => Ok(model),
            None => Err(inner.unknown_model(shelf, asked).await?),
        }
    }

    /// The newest revisions of up to `limit` models whose names follow `after`, by name.
    pub async fn models(&self, shelf: &Shelf, after: String, limit: u32) -> Result<Vec<StoredModel>, ModelError> {
        let kept = self.inner.documents.documents(Kind::Model, shelf.prefix(), after, limit).await?;
        Ok(kept
            .into_iter()
            .filter_map(|kept| Some((ModelContent::read(&kept)?, kept)))
            .map(|(c, k)| stored(shelf.plain(k), c))
            .collect())
    }

    /// Two models, each by `name` or `name@revision`, beside each other.
    pub async fn compare_models(&self, shelf: &Shelf, asked: &str, with: &str) -> Result<ModelComparison, ModelError> {
        compare::compare(&self.model(shelf, asked).await?, &self.model(shelf, with).await?)
    }

    /// Deletes every revision of a model. Jobs that were accepted with it are not touched.
    pub async fn delete_model(&self, shelf: &Shelf, name: &str) -> Result<(), ModelError> {
        let inner = &self.inner;
        if model::is_name(name) && inner.delete_document(Kind::Model, shelf.full(name)).await? {
            return Ok(());
        }
        Err(inner.unknown_model(shelf, name).await?)
    }
}

impl Inner {
    async fn unknown_model(&self, shelf: &Shelf, name: &str) -> Result<ModelError, Error> {
        let names = self.finder(shelf).await?.names(Kind::Model).await?;
        let plain = name.split('@').next().unwrap_or_default();
        let nearest = nearest(plain, names.iter().map(String::as_str)).map(str::to_owned);
        Ok(ModelError::Unknown { name: name.to_owned(), nearest })
    }
}

/// What is wrong with a model: its calculator, or effects that the calculator does not know.
fn faults_of_model(registry: &Registry, content: &ModelContent) -> Vec<Finding> {
    let entry = registry.entry(&content.calculator).filter(|entry| entry.model_use() == ModelUse::OfJob);
    let Some(entry) = entry else {
        let known: Vec<String> = registry
            .entries()
            .iter()
            .filter(|entry| entry.model_use() == ModelUse::OfJob)
            .map(|entry| entry.meta().id.to_owned())
            .collect();
        let finding = Finding::new("calculator_without_models", "/calculator");
        return vec![finding.with("name", content.calculator.clone()).with("known", known)];
    };
    if content.effects.is_empty() {
        return vec![Finding::new("model_without_effects", "/effects")];
    }
    let mut faults = Faults::default();
    entry.validate_effects(&json!(content.effects), &mut faults);
    if faults.listed.is_empty() {
        for (index, effect) in content.effects.iter().enumerate() {
            let again =
                content.effects[..index].iter().any(|before| compare::identity(before) == compare::identity(effect));
            let kind = effect["kind"].as_str().filter(|_| again);
            faults.listed.extend(kind.map(|kind| {
                Finding::new("duplicate_effect", format!("/effects/{index}/kind")).with("kind", kind.to_owned())
            }));
        }
    }
    faults.listed
}

/// Whether an exported model is the one that its hash is of.
fn is_whole(content: &ModelContent, sha256: Option<&str>) -> bool {
    sha256.is_none_or(|sha256| sha256 == model::sha256(&content.canonical()))
}

/// A model that was exported, for jobs that are solved without a store.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelFile(KeptDocument);

impl ModelFile {
    /// What `GET /v1/models/{name}` gave.
    pub fn read(registry: &Registry, document: &[u8]) -> Result<Self, ModelError> {
        let refuse = |code, pointer: &str| Err(ModelError::Invalid(vec![Finding::new(code, pointer)]));
        let ModelSource::Exported { content, sha256 } = ModelSource::read(document)? else {
            return refuse("model_not_exported", "");
        };
        if !is_whole(&content, sha256.as_deref()) {
            return refuse("model_damaged", "/sha256");
        }
        let findings = faults_of_model(registry, &content);
        if !findings.is_empty() {
            return Err(ModelError::Invalid(findings));
        }
        let fields = read_json::parse(document)?;
        let name = fields["name"].as_str().unwrap_or("exported").to_owned();
        if !model::is_name(&name) {
            return Err(ModelError::Invalid(vec![Finding::new("bad_model_name", "/name").with("name", name)]));
        }
        let revision = fields["revision"].as_u64().and_then(|revision| u32::try_from(revision).ok()).unwrap_or(1);
        let text = content.canonical();
        Ok(Self(KeptDocument {
            name,
            revision,
            class: content.calculator,
            sha256: model::sha256(&text),
            content: text,
            created_ms: 0,
        }))
    }

    pub(super) fn kept(&self) -> &KeptDocument {
        &self.0
    }
}

fn stored(kept: KeptDocument, content: ModelContent) -> StoredModel {
    StoredModel { name: kept.name, revision: kept.revision, sha256: kept.sha256, created_ms: kept.created_ms, content }
}

/// How unsure effects are that stand elsewhere in another list, or are left out of it.
pub(super) fn renumbered(unsure: &Value, place: impl Fn(usize) -> Option<usize>) -> Vec<JointUncertainty> {
    let unsure: Vec<JointUncertainty> = serde_json::from_value(unsure.clone()).unwrap_or_default();
    let moved = |own: ParameterMove| {
        let effect = place((own.effect as usize).checked_sub(1)?)?;
        Some(ParameterMove { effect: u32::try_from(effect + 1).ok()?, ..own })
    };
    let entries = unsure.into_iter().map(|entry| entry.moves.into_iter().filter_map(moved).collect::<Vec<_>>());
    entries.filter(|moves| !moves.is_empty()).map(|moves| JointUncertainty { moves }).collect()
}

/// The model that a diagnosis found, with where it comes from.
fn content_of(stored: &Stored, pointer: &str) -> Result<ModelContent, ModelError> {
    if stored.entry().meta().id != DIAGNOSIS {
        let finding = Finding::new("not_a_diagnosis", pointer).with("calculator", stored.entry().meta().id);
        return Err(ModelError::Invalid(vec![finding]));
    }
    let broken = |error: serde_json::Error| Error::internal(format!("a kept diagnosis: {error}"));
    let answer: Value = serde_json::from_slice(&stored.body).map_err(broken)?;
    let (input, result) = (&answer["input"], &answer["result"]);
    let named = result["effects"].as_array().cloned().unwrap_or_default();
    if named.is_empty() {
        let verdict = result["verdict"].as_str().unwrap_or_default().to_owned();
        let finding = Finding::new("diagnosis_without_causes", pointer).with("verdict", verdict);
        return Err(ModelError::Invalid(vec![finding]));
    }
    // What an earlier model added to the base job belongs to the extended one, as far as it has not changed.
    let of_job = input["job"]["effects"].as_array().map_or(&[][..], Vec::as_slice);
    let inherited = input["model"]["effects"].as_u64().and_then(|count| usize::try_from(count).ok()).unwrap_or(0);
    let stays = |own: &Value| named.iter().all(|found| compare::identity(found) != compare::identity(own));
    let kept: Vec<usize> =
        (of_job.len().saturating_sub(inherited)..of_job.len()).filter(|&index| stays(&of_job[index])).collect();
    let mut unsure = renumbered(&input[UNCERTAINTY], |effect| kept.iter().position(|&index| index == effect));
    unsure.extend(renumbered(&result[UNCERTAINTY], |effect| Some(kept.len() + effect)));
    let effects = kept.iter().map(|&index| of_job[index].clone()).chain(named).collect();
    let base = canonical(&input["job"]).map_err(|error| Error::internal(format!("a kept diagnosis: {error}")))?;
    Ok(ModelContent {
        calculator: input["calculator"].as_str().unwrap_or_default().to_owned(),
        effects,
        provenance: json!({
            "diagnosis": stored.key.to_string(),
            "engine": answer["engine"],
            "verdict": result["verdict"],
            "quantity": input["quantity"],
            "data": input["measurements"],
            "base_job_b3": blake3::hash(&base).to_hex().as_str(),
            "extends": input.get("model").cloned().unwrap_or(Value::Null),
            "causes": result["named"],
            "extension": result["extension"],
            UNCERTAINTY: unsure,
            "gain": result["gain"],
        }),
    })
}
