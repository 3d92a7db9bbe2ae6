//! One calculator with its types closed over.

mod contracts;

use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

use precut_calc::calculator::{Calculator, Diagnosable, Figure, Finding, ForwardModel, Meta, Place, Table, Watched};
use precut_calc::diagnosis::{Diagnosis, JobOf, ResultOf};
use serde_json::Value;
use utoipa::ToSchema;
use utoipa::openapi::{RefOr, Schema};

use super::calculation::{Calculation, MaybeProgram, MaybeReturned, Moved, Prepared, Unprepared, UnreadableResult};
use super::checker::{Checker, Faults};
use super::contract::{self, Make};
use super::place::{Places, TablePlace, TextPlace};
use super::shape::Shape;
use super::typed::{NoCalculator, Typed};
use super::watched::Observed;
use super::{RESERVED, RegistryError, family, names};

/// One calculator with its types closed over.
pub struct Entry {
    meta: Meta,
    contracts: Contracts,
    /// What jobs are held against, and where stands what may come as files: made for the first job.
    checker: OnceLock<Checker>,
    files: OnceLock<Places>,
    /// What a job may be made of, for who reads it.
    shape: OnceLock<Shape>,
    /// Schemas of job and result with references followed and unions told apart: made for the first who asks.
    strict_input: OnceLock<Value>,
    strict_output: OnceLock<Value>,
    /// Codes that another calculator declares.
    more_codes: Vec<&'static str>,
    calculation: Box<dyn Calculation>,
    composed: bool,
    model_use: ModelUse,
    /// Whether a job says what is not known of its effects.
    takes_open_effects: bool,
    /// Of a calculator whose process can be watched.
    observed: Option<Observed>,
    /// Bytes of the answer written last.
    answer_bytes: AtomicUsize,
}

/// Schemas of job and result for the OpenAPI document.
pub struct Schemas {
    /// Of the job; refers to the components.
    pub input: RefOr<Schema>,
    /// Of the result; refers to the components.
    pub output: RefOr<Schema>,
    /// Every component that either schema refers to, by name, each name once; where both do, as the job has it.
    pub components: Vec<(String, RefOr<Schema>)>,
}

/// Whether a job may name a stored model, and what of it the model extends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ModelUse {
    /// It may not.
    None,
    /// The job itself.
    OfJob,
    /// The base job inside it.
    OfBase,
    /// The job inside it names the model.
    Within,
}

/// Where the contracts of jobs and results come from.
enum Contracts {
    /// From the types of one calculator.
    Types { input: Make, output: Make },
    /// From those of several, one of which stands in the job: one entry for each of them, in the order of their names'
    /// place in the contract.
    Members(Vec<Member>),
}

/// One calculator's form of a question that is asked of several.
pub(super) struct Member {
    /// Whose jobs it takes.
    pub(super) calculator: &'static str,
    pub(super) entry: Entry,
}

impl Member {
    /// What a job of it may be made of.
    fn shape(&self) -> &Shape {
        self.entry.shape.get_or_init(|| {
            let mut own = Shape::of(&follows(self.entry.input().strict()));
            if let Some(mut job) = own.field("job").cloned() {
                names::let_in(&mut job, self.calculator);
                own = own.with_field("job", job);
            }
            own
        })
    }
}

/// Takes what is made of a contract. It cannot fail: contracts follow from types alone, and a test makes everything that is made
/// of them.
fn follows<T>(made: Result<T, RegistryError>) -> T {
    made.expect("the contract of a type is made by a test")
}

impl Entry {
    /// The entry of a calculator.
    pub(super) fn of<C: Calculator>() -> Result<Self, RegistryError> {
        Self::with_input::<C>(contract::of::<C::Input>(C::META.id, true, |_| {}))
    }

    /// The entry of a calculator whose jobs may name a stored model.
    pub(super) fn with_model<C: Calculator + ForwardModel>() -> Result<Self, RegistryError> {
        let entry = Self::with_input::<C>(contract::of::<C::Input>(C::META.id, true, family::offer_model))?;
        Ok(Self { model_use: ModelUse::OfJob, takes_open_effects: C::TAKES_OPEN_EFFECTS, ..entry })
    }

    /// The same with its process.
    pub(super) fn watching<M: Watched>(self) -> Self {
        Self { observed: Some(Observed::of::<M>()), ..self }
    }

    /// How a process of it is watched; `None` of a calculator whose process nobody watches.
    pub(crate) fn observed(&self) -> Option<&Observed> {
        self.observed.as_ref()
    }

    /// Something that is checked and told in the contract like a job of that calculator, and is none.
    pub(super) fn of_body<I: ToSchema>(meta: &Meta, adapt: impl Fn(&mut Value) + Send + Sync + 'static) -> Self {
        let input = contract::of::<I>(meta.id, true, adapt);
        let output = contract::of::<I>(meta.id, false, |_| {});
        Self::new(meta, Contracts::Types { input, output }, Box::new(NoCalculator))
    }

    fn with_input<C: Calculator>(input: Make) -> Result<Self, RegistryError> {
        let meta = C::META;
        let fits = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        if !meta.id.starts_with(|c: char| c.is_ascii_lowercase()) || !meta.id.chars().all(fits) {
            return Err(RegistryError::BadId(meta.id));
        }
        if RESERVED.contains(&meta.id) {
            return Err(RegistryError::Reserved(meta.id));
        }
        let output = contract::of::<C::Output>(meta.id, false, |_| {});
        Ok(Self::new(&meta, Contracts::Types { input, output }, Box::new(Typed::<C>::new(None))))
    }

    /// The entry of the diagnosis of one calculator.
    pub(super) fn of_diagnosis<M: Diagnosable>() -> Self {
        let base = M::META;
        let calculation = Box::new(Typed::<Diagnosis<M>>::new(Some(&base)));
        let input = contract::of::<JobOf<M>>(base.id, true, move |job| {
            family::name_calculator(job, base.id);
            family::offer_model(job);
        });
        let output = contract::of::<ResultOf<M>>(base.id, false, |_| {});
        let entry = Self::new(&<Diagnosis<M> as Calculator>::META, Contracts::Types { input, output }, calculation);
        // A diagnosis refuses a base job in the words of the base.
        let of_base = [base.codes.faults, base.codes.failures].into_iter().flatten().copied().flatten();
        Self { model_use: ModelUse::OfBase, more_codes: of_base.copied().collect(), ..entry }
    }

    /// One question that is asked of several calculators, each with its own form of job and answer.
    pub(super) fn family(members: Vec<Member>) -> Option<Self> {
        let examples: Vec<_> = members.iter().flat_map(|member| member.entry.meta.examples).copied().collect();
        // A registry lives as long as the process.
        let meta = Meta { examples: Vec::leak(examples), ..members.first()?.entry.meta };
        let entry = Self::new(&meta, Contracts::Members(members), Box::new(NoCalculator));
        Some(Self { model_use: ModelUse::OfBase, ..entry })
    }

    /// The entry of something that is asked like a calculator and made of other calculators' jobs. It has a route of
    /// the service's own and stands in no registry.
    pub(crate) fn composed<I: ToSchema, O: ToSchema>(meta: &Meta, calculation: Box<dyn Calculation>) -> Self {
        let input = contract::of::<I>(meta.id, true, |_| {});
        let output = contract::of::<O>(meta.id, false, |_| {});
        let entry = Self::new(meta, Contracts::Types { input, output }, calculation);
        Self { composed: true, model_use: ModelUse::Within, ..entry }
    }

    fn new(meta: &Meta, contracts: Contracts, calculation: Box<dyn Calculation>) -> Self {
        Self {
            meta: *meta,
            contracts,
            checker: OnceLock::new(),
            files: OnceLock::new(),
            shape: OnceLock::new(),
            strict_input: OnceLock::new(),
            strict_output: OnceLock::new(),
            more_codes: Vec::new(),
            calculation,
            composed: false,
            model_use: ModelUse::None,
            takes_open_effects: false,
            observed: None,
            answer_bytes: AtomicUsize::new(0),
        }
    }

    fn members(&self) -> &[Member] {
        match &self.contracts {
            Contracts::Types { .. } => &[],
            Contracts::Members(members) => members,
        }
    }

    /// The form of a family's job that a job has, by the calculator that it names; this entry where it is no family.
    pub(crate) fn of_job(&self, job: &Value) -> Option<&Self> {
        match self.members() {
            [] => Some(self),
            _ => self.member(job.get(family::CALCULATOR)?.as_str()?),
        }
    }

    fn member(&self, calculator: &str) -> Option<&Self> {
        self.members().iter().find(|of| of.calculator == calculator).map(|of| &of.entry)
    }

    /// The same for a kept job.
    fn of_kept_job(&self, input: &[u8]) -> Result<&Self, UnreadableResult> {
        if self.members().is_empty() {
            return Ok(self);
        }
        let unreadable = |error: String| UnreadableResult(error);
        let named: family::Named = serde_json::from_slice(input).map_err(|error| unreadable(error.to_string()))?;
        self.member(&named.calculator).ok_or_else(|| unreadable(format!("no calculator {}", named.calculator)))
    }

    /// What stands on the door.
    pub fn meta(&self) -> &Meta {
        &self.meta
    }
    /// A buffer for the next answer, about as large as the last one was.
    pub(crate) fn answer_buffer(&self) -> Vec<u8> {
        /// Answers differ by some digits and words.
        const SPARE: usize = 512;
        /// Beyond that, growing costs little beside what is written.
        const MOST: usize = 1 << 20;
        let last = self.answer_bytes.load(Ordering::Relaxed);
        Vec::with_capacity((last + last / 64 + SPARE).min(MOST))
    }
    /// An answer is written: hands its bytes on without what is much too large for them.
    pub(crate) fn answer_written(&self, mut body: Vec<u8>) -> Vec<u8> {
        self.answer_bytes.store(body.len(), Ordering::Relaxed);
        if body.capacity() > body.len() + body.len() / 8 {
            // Kept in memory for long, it shall not take more than it counts for.
            body.shrink_to_fit();
        }
        body
    }

    /// Where the measured tables of a job stand; nowhere where it cannot be told what job it is.
    pub(crate) fn tables_of(&self, job: &Value) -> &[TablePlace] {
        let Some(entry) = self.of_job(job) else { return &[] };
        // Who asks for the tables of a job checks it next.
        entry.checker();
        &entry.files().tables
    }
    /// Where its long texts stand that may come as files.
    pub(crate) fn texts_of(&self, job: &Value) -> &[TextPlace] {
        let Some(entry) = self.of_job(job) else { return &[] };
        entry.checker();
        &entry.files().texts
    }
    /// What a job may be made of; `of_any` says it of the job of any calculator, where there is one inside.
    pub(crate) fn shape(&self, of_any: impl FnOnce() -> Shape) -> &Shape {
        self.shape.get_or_init(|| match self.members() {
            [] => {
                let mut own = Shape::of(&follows(self.input().strict()));
                names::let_in(&mut own, self.meta.id);
                if self.composed { own.with_field("job", of_any()) } else { own }
            }
            members => members.iter().fold(Shape::default(), |mut all, member| {
                all.join(member.shape().clone());
                all
            }),
        })
    }
    /// What the job in a body may be made of, where it names one of several calculators.
    pub(crate) fn shape_of_named(&self, body: &[u8]) -> Option<&Shape> {
        let named: family::Named = serde_json::from_slice(body).ok().filter(|_| !self.members().is_empty())?;
        self.shape_of_member(&named.calculator)
    }
    /// What the job of one of several calculators may be made of.
    pub(crate) fn shape_of_member(&self, calculator: &str) -> Option<&Shape> {
        self.members().iter().find(|of| of.calculator == calculator).map(Member::shape)
    }
    /// The fields of the job that may name records: of the job itself, or of the base job of a diagnosis of that calculator.
    pub(crate) fn job_fields(&self, calculator: &str) -> &Value {
        match self.member(calculator) {
            Some(member) => &member.strict_input()["properties"]["job"]["properties"],
            None => &self.strict_input()["properties"],
        }
    }
    /// Whether a job may name a stored model.
    pub(crate) fn model_use(&self) -> ModelUse {
        self.model_use
    }
    /// Whether a job says what is not known of its effects, in `uncertainty.effects`.
    pub(crate) fn takes_open_effects(&self) -> bool {
        self.takes_open_effects
    }
    /// Whether it is made of other entries' jobs: reading one is work, and running one waits for the store.
    pub(crate) fn is_composed(&self) -> bool {
        self.composed
    }
    /// Schema of the job with references followed and unions told apart.
    pub(crate) fn strict_input(&self) -> &Value {
        self.strict_input.get_or_init(|| follows(self.input().strict()))
    }
    /// Schema of the result in the same form.
    pub(crate) fn strict_output(&self) -> &Value {
        self.strict_output.get_or_init(|| follows(self.output().strict()))
    }

    /// Adds every violation of the schema. Measured tables must be rows by now.
    pub(crate) fn validate(&self, job: &Value, faults: &mut Faults) {
        self.of_job(job).unwrap_or(self).checker().check(job, "", faults);
    }
    /// What a field of the job has to be, where it is of the type of that name.
    pub(super) fn part(&self, field: &str, type_name: &str) -> Option<Checker> {
        match self.members() {
            [] => self.input().part(field, type_name).map(|schema| follows(schema.and_then(Checker::new))),
            members => members.iter().find_map(|member| member.entry.part(field, type_name)),
        }
    }
    /// Adds what is wrong with effects that are to act in jobs of this calculator.
    pub(crate) fn validate_effects(&self, effects: &Value, faults: &mut Faults) {
        let schema = self.strict_input()["properties"]["effects"].clone();
        match Checker::new(schema) {
            Ok(checker) => checker.check(effects, "/effects", faults),
            Err(error) => tracing::error!(%error, "the schema of a calculator's effects does not stand alone"),
        }
    }
    /// A job that the schema accepts, typed, checked and filled.
    pub(crate) fn prepare(&self, job: &Value) -> Result<Prepared, Unprepared> {
        match self.of_job(job) {
            Some(entry) => entry.calculation.prepare(job),
            None => self.calculation.prepare(job),
        }
    }
    /// The rules between fields that a job breaks which the schema refuses; none where it cannot be read at all.
    pub(crate) fn broken_rules(&self, job: &Value) -> Vec<Finding> {
        self.of_job(job).map(|entry| entry.calculation.broken_rules(job)).unwrap_or_default()
    }
    /// What is wrong with a job that stands inside, of which the heads of long lists are there.
    pub(crate) fn faults_of_head(&self, job: &Value) -> Vec<Finding> {
        self.calculation.faults_of_head(job)
    }
    /// The pictures of a result, from its job and its envelope as JSON.
    pub(crate) fn figures(&self, input: &[u8], envelope: &[u8]) -> Result<Vec<Figure>, UnreadableResult> {
        self.of_kept_job(input)?.calculation.figures(input, envelope)
    }
    /// The tables of a result.
    pub(crate) fn result_tables(&self, input: &[u8], envelope: &[u8]) -> Result<Vec<Table>, UnreadableResult> {
        self.of_kept_job(input)?.calculation.tables(input, envelope)
    }
    /// The job for which another place in a picture of a result stands; `None` where there is none.
    pub(crate) fn at_place(
        &self,
        input: &[u8],
        envelope: &[u8],
        place: &Place<'_>,
    ) -> Result<Option<Moved>, UnreadableResult> {
        self.of_kept_job(input)?.calculation.at_place(input, envelope, place)
    }
    /// The program of a result, where there is one.
    pub(crate) fn program(&self, input: &[u8], envelope: &[u8]) -> Result<MaybeProgram, UnreadableResult> {
        self.of_kept_job(input)?.calculation.program(input, envelope)
    }
    /// The program that its job brought along, as it is given back.
    pub(crate) fn returned(
        &self,
        input: &[u8],
        envelope: &[u8],
        made_by: &str,
    ) -> Result<MaybeReturned, UnreadableResult> {
        self.of_kept_job(input)?.calculation.returned(input, envelope, made_by)
    }
}

impl std::fmt::Debug for Entry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Entry").field("id", &self.meta.id).field("version", &self.meta.version).finish_non_exhaustive()
    }
}
