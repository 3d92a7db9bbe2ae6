//! One calculator with its types closed over.

use std::collections::{BTreeMap, BTreeSet};
use std::marker::PhantomData;
use std::sync::Arc;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

use precut_calc::calculator::{
    Answer, Basis, Calculator, Check, Cost, Diagnosable, Failure, Figure, Finding, ForwardModel, Message, Meta,
    Monitor, Place, Program, ReturnedProgram, Table, Violations, Watched,
};
use precut_calc::diagnosis::{Diagnosis, JobOf, ResultOf};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use utoipa::ToSchema;
use utoipa::openapi::{RefOr, Schema};

use super::canonical::canonical;
use super::checker::{Checker, Faults};
use super::contract::{self, Contract, Make};
use super::place::{Places, TablePlace, TextPlace, places};
use super::schema::Components;
use super::shape::Shape;
use super::watched::Observed;
use super::{RESERVED, RegistryError, Unwritable, append_result, child, non_finite_place};
use super::{family, names};

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
        Ok(Self::new(&meta, Contracts::Types { input, output }, Box::new(Typed::<C>(PhantomData))))
    }

    /// The entry of the diagnosis of one calculator.
    pub(super) fn of_diagnosis<M: Diagnosable>() -> Self {
        let base = M::META;
        let calculation = Box::new(NumbersOf { meta: base, calculation: Typed::<Diagnosis<M>>(PhantomData) });
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

    fn made_input(&self) -> Result<Contract, RegistryError> {
        match &self.contracts {
            Contracts::Types { input, .. } => input(),
            Contracts::Members(members) => {
                let part = |of: &Member| Ok((family::type_name(of.calculator, "DiagnosisJob"), of.entry.made_input()?));
                Contract::joined(members.iter().map(part), true)
            }
        }
    }

    fn made_output(&self) -> Result<Contract, RegistryError> {
        match &self.contracts {
            Contracts::Types { output, .. } => output(),
            Contracts::Members(members) => {
                let part =
                    |of: &Member| Ok((family::type_name(of.calculator, "DiagnosisResult"), of.entry.made_output()?));
                Contract::joined(members.iter().map(part), false)
            }
        }
    }

    fn input(&self) -> Contract {
        follows(self.made_input())
    }
    fn output(&self) -> Contract {
        follows(self.made_output())
    }

    /// What jobs are held against; where stands what may come as files is read off the same schema.
    fn checker(&self) -> &Checker {
        let made = || match self.members() {
            [] => {
                let strict = follows(self.input().strict());
                self.files.get_or_init(|| places(&strict));
                Checker::new(strict)
            }
            members => of_members(members),
        };
        self.checker.get_or_init(|| follows(made()))
    }

    /// Makes all that is made on demand, so that what cannot be made is known at once; `components` are those of the
    /// entries before.
    pub(super) fn verify(&self, components: &mut Components) -> Result<(), RegistryError> {
        for member in self.members() {
            member.entry.verify(components)?;
        }
        let (input, output) = (self.made_input()?, self.made_output()?);
        for contract in [&input, &output] {
            contract.schema()?;
            contract.components()?;
        }
        let strict = input.strict()?;
        let _ = self.files.set(places(&strict));
        let checker = match self.members() {
            [] => Checker::new(strict),
            members => of_members(members),
        };
        let _ = self.checker.set(checker?);
        let _ = self.strict_output.set(output.strict()?);
        for (name, component) in input.into_open().into_iter().chain(output.into_open()) {
            if components.get(&name).is_some_and(|other| *other != component) {
                return Err(RegistryError::ComponentClash { component: name, calculator: self.meta.id });
            }
            components.insert(name, component);
        }
        Ok(())
    }

    /// What stands on the door.
    pub fn meta(&self) -> &Meta {
        &self.meta
    }
    /// What the OpenAPI document says of job and result.
    pub fn schemas(&self) -> Schemas {
        let made = || {
            let (input, output) = (self.made_input()?, self.made_output()?);
            let mut components = output.components()?;
            components.extend(input.components()?);
            let components = components.into_iter().collect();
            Ok(Schemas { input: input.schema()?, output: output.schema()?, components })
        };
        follows(made())
    }
    pub(super) fn input_components(&self) -> BTreeMap<String, RefOr<Schema>> {
        follows(self.input().components())
    }
    pub(super) fn output_components(&self) -> BTreeMap<String, RefOr<Schema>> {
        follows(self.output().components())
    }
    /// Self-contained JSON Schema (2020-12) of the job.
    pub fn input_document(&self) -> Value {
        self.input().document()
    }
    /// Self-contained JSON Schema (2020-12) of the result.
    pub fn output_document(&self) -> Value {
        self.output().document()
    }
    /// Whether the job takes measured tables (CSV in place, or file parts).
    pub fn takes_tables(&self) -> bool {
        !self.files().tables.is_empty()
    }
    /// Whether anything of the job may come as a file part.
    pub fn takes_files(&self) -> bool {
        self.takes_tables() || !self.files().texts.is_empty()
    }
    /// Names of its measured tables, with dots from the root.
    pub fn table_names(&self) -> Vec<String> {
        self.files().tables.iter().map(|place| place.way.dotted()).collect()
    }
    /// Names of its long texts that may come as file parts, in the same way.
    pub fn text_names(&self) -> Vec<String> {
        self.files().texts.iter().map(|place| place.way.dotted()).collect()
    }
    fn files(&self) -> &Places {
        self.files.get_or_init(|| places(&follows(self.input().strict())))
    }
    /// Every code that it may utter: those of its declaration and those of its fields.
    pub fn codes(&self) -> BTreeSet<String> {
        let mut codes: BTreeSet<String> =
            self.meta.codes.all().chain(self.more_codes.iter().copied()).map(str::to_owned).collect();
        for member in self.members() {
            codes.extend(member.entry.more_codes.iter().map(|code| (*code).to_owned()));
        }
        codes_in(self.strict_input(), &mut codes);
        codes
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

/// What a job is held against that names no member. One that does is held against that member's own schema: all of them
/// in one would be the largest schema of all.
fn of_members(members: &[Member]) -> Result<Checker, RegistryError> {
    Checker::new(family::told_apart(members.iter().map(|of| of.calculator)))
}

fn codes_in(schema: &Value, codes: &mut BTreeSet<String>) {
    match schema {
        Value::Object(map) => {
            if let Some(Value::String(code)) = map.get("x-code") {
                codes.insert(code.clone());
            }
            map.values().for_each(|part| codes_in(part, codes));
        }
        Value::Array(parts) => parts.iter().for_each(|part| codes_in(part, codes)),
        _ => {}
    }
}

/// A job that can run.
pub struct Prepared {
    /// What it would cost.
    pub cost: Cost,
    /// The job with every default filled in, as RFC 8785 writes it.
    pub canonical: Vec<u8>,
    /// The calculator whose numbers come out, where that is another one.
    pub(crate) numbers_of: Option<Meta>,
    job: Box<dyn Job>,
}

impl Prepared {
    pub(crate) fn new(cost: Cost, canonical: Vec<u8>, job: Box<dyn Job>) -> Self {
        Self { cost, canonical, numbers_of: None, job }
    }
    /// The same with numbers that another calculator makes: its version counts, too.
    pub(crate) fn with_numbers_of(self, meta: &Meta) -> Self {
        Self { numbers_of: Some(*meta), ..self }
    }
    /// The job with every default filled in.
    pub fn input(&self) -> Result<Value, Failure> {
        self.job.input()
    }
    /// Appends the same as JSON, its fields in the order of their declaration.
    pub fn write_input(&self, body: &mut Vec<u8>) -> Result<(), Failure> {
        self.job.write_input(body)
    }
    /// Computes the answer and appends its result as JSON, every number finite.
    pub fn run(&self, monitor: &dyn Monitor, body: &mut Vec<u8>) -> Result<ResultNotes, Failure> {
        self.job.run(monitor, body)
    }
    /// Its shards, if it is worth to compute them apart.
    pub(crate) fn sharded(&self) -> Option<Arc<dyn Sharded>> {
        self.job.sharded()
    }
}

/// Why a job cannot run.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Unprepared {
    /// It breaks rules.
    Invalid(Vec<Finding>),
    /// Our own fault.
    Failed(Failure),
}

/// What an answer has beside its result.
#[derive(Debug, Clone, PartialEq)]
pub struct ResultNotes {
    /// Where an input leaves a formula's range of validity, and the like.
    pub warnings: Vec<Finding>,
    /// Most important first.
    pub explanation: Vec<Message>,
    /// The equations used.
    pub basis: Vec<Basis>,
}

/// A kept result that the calculator's types no longer read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct UnreadableResult(pub String);

type MaybeProgram = Option<Result<Program, Failure>>;
type MaybeReturned = Option<Result<ReturnedProgram, Failure>>;

/// A job, and what becomes of it at another place of a picture.
pub(crate) struct Moved {
    pub(crate) before: Value,
    pub(crate) after: Value,
}

/// What an entry does, whatever its types are.
pub(crate) trait Calculation: Send + Sync {
    fn prepare(&self, job: &Value) -> Result<Prepared, Unprepared>;
    fn broken_rules(&self, job: &Value) -> Vec<Finding>;
    /// What is wrong with a job that stands inside, of which the heads of long lists are there.
    fn faults_of_head(&self, _job: &Value) -> Vec<Finding> {
        Vec::new()
    }
    fn figures(&self, input: &[u8], envelope: &[u8]) -> Result<Vec<Figure>, UnreadableResult>;
    fn tables(&self, input: &[u8], envelope: &[u8]) -> Result<Vec<Table>, UnreadableResult>;
    fn program(&self, input: &[u8], envelope: &[u8]) -> Result<MaybeProgram, UnreadableResult>;
    /// What is made of other calculators' jobs brings no program along.
    fn returned(&self, _input: &[u8], _envelope: &[u8], _made_by: &str) -> Result<MaybeReturned, UnreadableResult> {
        Ok(None)
    }
    /// What has no places of its own stands where it is.
    fn at_place(&self, _input: &[u8], _envelope: &[u8], _place: &Place<'_>) -> Result<Option<Moved>, UnreadableResult> {
        Ok(None)
    }
}

/// A filled job.
pub(crate) trait Job: Send + Sync {
    fn input(&self) -> Result<Value, Failure>;
    fn write_input(&self, body: &mut Vec<u8>) -> Result<(), Failure>;
    fn run(&self, monitor: &dyn Monitor, body: &mut Vec<u8>) -> Result<ResultNotes, Failure>;
    /// Its shards, if it is worth to compute them apart: what is taken up of them, `run` does not compute.
    fn sharded(&self) -> Option<Arc<dyn Sharded>> {
        None
    }
}

/// A job in shards: each can be computed by itself, by whoever has a place, and comes to the same.
pub(crate) trait Sharded: Send + Sync {
    /// How many there are.
    fn count(&self) -> usize;
    /// What a shard comes to; `apart`: what may end its process is computed in one of its own.
    fn compute(&self, index: usize, monitor: &dyn Monitor, apart: bool) -> Result<Vec<u8>, Unfinished>;
    /// Takes up what a shard came to; whether it is that.
    fn take_up(&self, index: usize, content: &[u8]) -> bool;
    /// Tells how far it is by what was taken up.
    fn tell(&self, monitor: &dyn Monitor);
}

/// Why a shard came to nothing.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Unfinished {
    /// Nobody wants it any more.
    Cancelled,
    /// It ended the process that it was tried in.
    Deadly,
    /// Our own fault.
    Failed(Failure),
}

/// The types of a calculator.
struct Typed<C>(PhantomData<fn() -> C>);

/// A calculation whose numbers are another calculator's, too.
struct NumbersOf<T> {
    meta: Meta,
    calculation: T,
}

impl<T: Calculation> Calculation for NumbersOf<T> {
    fn prepare(&self, job: &Value) -> Result<Prepared, Unprepared> {
        Ok(self.calculation.prepare(job)?.with_numbers_of(&self.meta))
    }
    fn broken_rules(&self, job: &Value) -> Vec<Finding> {
        self.calculation.broken_rules(job)
    }
    fn figures(&self, input: &[u8], envelope: &[u8]) -> Result<Vec<Figure>, UnreadableResult> {
        self.calculation.figures(input, envelope)
    }
    fn tables(&self, input: &[u8], envelope: &[u8]) -> Result<Vec<Table>, UnreadableResult> {
        self.calculation.tables(input, envelope)
    }
    fn program(&self, input: &[u8], envelope: &[u8]) -> Result<MaybeProgram, UnreadableResult> {
        self.calculation.program(input, envelope)
    }
}

/// What a family does with a job that names none of its calculators; the schema has refused such a job before.
struct NoCalculator;

impl Calculation for NoCalculator {
    fn prepare(&self, _job: &Value) -> Result<Prepared, Unprepared> {
        Err(Unprepared::Failed(Failure::Internal("a job of no calculator".to_owned())))
    }
    fn broken_rules(&self, _job: &Value) -> Vec<Finding> {
        Vec::new()
    }
    fn figures(&self, _input: &[u8], _envelope: &[u8]) -> Result<Vec<Figure>, UnreadableResult> {
        Err(UnreadableResult("a job of no calculator".to_owned()))
    }
    fn tables(&self, _input: &[u8], _envelope: &[u8]) -> Result<Vec<Table>, UnreadableResult> {
        Err(UnreadableResult("a job of no calculator".to_owned()))
    }
    fn program(&self, _input: &[u8], _envelope: &[u8]) -> Result<MaybeProgram, UnreadableResult> {
        Err(UnreadableResult("a job of no calculator".to_owned()))
    }
}

/// A filled job of a calculator.
struct TypedJob<C: Calculator>(C::Input);

impl<C: Calculator> Calculation for Typed<C> {
    fn prepare(&self, job: &Value) -> Result<Prepared, Unprepared> {
        // The way to a fault is noted on a second reading only: noting it costs more than reading.
        let mut input = C::Input::deserialize(job).or_else(|_| {
            serde_path_to_error::deserialize(job).map_err(|error| Unprepared::Invalid(vec![second_line(&error)]))
        })?;
        let mut violations = Violations::default();
        input.check(&mut violations);
        if !violations.is_empty() {
            return Err(Unprepared::Invalid(violations.into_vec()));
        }
        C::fill(&mut input);
        if let Some(place) = non_finite_place(&input) {
            let what = format!("the filled job of {} is not finite at {place}", C::META.id);
            return Err(Unprepared::Failed(Failure::Internal(what)));
        }
        let canonical = canonical(&input).map_err(|error| Unprepared::Failed(unwritable("the filled job", &error)))?;
        Ok(Prepared::new(C::cost(&input), canonical, Box::new(TypedJob::<C>(input))))
    }
    fn broken_rules(&self, job: &Value) -> Vec<Finding> {
        let mut violations = Violations::default();
        if let Ok(input) = C::Input::deserialize(job) {
            input.check(&mut violations);
        }
        violations.into_vec()
    }
    fn figures(&self, input: &[u8], envelope: &[u8]) -> Result<Vec<Figure>, UnreadableResult> {
        let (input, output) = read::<C>(input, envelope)?;
        Ok(C::figures(&input, &output))
    }
    fn tables(&self, input: &[u8], envelope: &[u8]) -> Result<Vec<Table>, UnreadableResult> {
        let (input, output) = read::<C>(input, envelope)?;
        Ok(C::tables(&input, &output))
    }
    fn program(&self, input: &[u8], envelope: &[u8]) -> Result<MaybeProgram, UnreadableResult> {
        let (input, output) = read::<C>(input, envelope)?;
        Ok(C::program(&input, &output))
    }
    fn returned(&self, input: &[u8], envelope: &[u8], made_by: &str) -> Result<MaybeReturned, UnreadableResult> {
        let (input, output) = read::<C>(input, envelope)?;
        Ok(C::returned(&input, &output, made_by))
    }
    fn at_place(&self, input: &[u8], envelope: &[u8], place: &Place<'_>) -> Result<Option<Moved>, UnreadableResult> {
        let (input, output) = read::<C>(input, envelope)?;
        let Some(after) = C::at_place(&input, &output, place) else { return Ok(None) };
        let written = |job: &C::Input| serde_json::to_value(job).map_err(|error| UnreadableResult(error.to_string()));
        Ok(Some(Moved { before: written(&input)?, after: written(&after)? }))
    }
}

impl<C: Calculator> Job for TypedJob<C> {
    fn input(&self) -> Result<Value, Failure> {
        serde_json::to_value(&self.0).map_err(|error| unwritable("the filled job", &error))
    }
    fn write_input(&self, body: &mut Vec<u8>) -> Result<(), Failure> {
        serde_json::to_writer(body, &self.0).map_err(|error| unwritable("the filled job", &error))
    }
    fn run(&self, monitor: &dyn Monitor, body: &mut Vec<u8>) -> Result<ResultNotes, Failure> {
        let Answer { output, warnings, explanation, basis } = C::run(&self.0, monitor)?;
        append_result(body, &output).map_err(|error| match error {
            Unwritable::NotFinite => {
                let place = non_finite_place(&output).unwrap_or_default();
                Failure::Internal(format!("the result of {} is not finite at {place}", C::META.id))
            }
            Unwritable::Other(_) => unwritable("the result", &error),
        })?;
        Ok(ResultNotes { warnings, explanation, basis })
    }
}

fn unwritable(what: &str, error: &impl std::fmt::Display) -> Failure {
    Failure::Internal(format!("{what}: {error}"))
}

/// What is read of an envelope.
#[derive(Deserialize)]
struct Answered<O> {
    result: O,
}

fn read<C: Calculator>(input: &[u8], envelope: &[u8]) -> Result<(C::Input, C::Output), UnreadableResult> {
    fn json<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, UnreadableResult> {
        serde_json::from_slice(bytes).map_err(|error| UnreadableResult(error.to_string()))
    }
    Ok((json::<C::Input>(input)?, json::<Answered<C::Output>>(envelope)?.result))
}

/// What the types refuse although the schema does not: one fault, as deserialisation stops at the first.
pub(crate) fn second_line(error: &serde_path_to_error::Error<serde_json::Error>) -> Finding {
    use serde_path_to_error::Segment;
    let pointer = error.path().iter().fold(String::new(), |pointer, segment| match segment {
        Segment::Seq { index } => format!("{pointer}/{index}"),
        Segment::Map { key } => child(&pointer, key),
        Segment::Enum { .. } | Segment::Unknown => pointer,
    });
    Finding::new("not_readable", pointer).with("reason", error.inner().to_string())
}
