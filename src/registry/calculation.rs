//! What an entry does, whatever its types are, and what it makes of a job.

use std::sync::Arc;

use precut_calc::calculator::{
    Basis, Cost, Failure, Figure, Finding, Message, Meta, Monitor, Place, Program, ReturnedProgram, Table,
};
use serde_json::Value;

/// A job that can run.
pub struct Prepared {
    /// What it would cost.
    pub cost: Cost,
    /// The job with every default filled in, as RFC 8785 writes it.
    pub canonical: Vec<u8>,
    /// The calculator whose numbers come out, where that is another one: its version counts, too.
    pub(crate) numbers_of: Option<Meta>,
    job: Box<dyn Job>,
}

impl Prepared {
    pub(crate) fn new(cost: Cost, canonical: Vec<u8>, numbers_of: Option<&Meta>, job: Box<dyn Job>) -> Self {
        Self { cost, canonical, numbers_of: numbers_of.copied(), job }
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

pub(super) type MaybeProgram = Option<Result<Program, Failure>>;
pub(super) type MaybeReturned = Option<Result<ReturnedProgram, Failure>>;

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
