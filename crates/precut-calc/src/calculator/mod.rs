//! What a calculator is, and the plain data that it speaks.
//!
//! A calculator is declared once, by implementing [`Calculator`]; its route, validation, contract,
//! cache key, command line, figures and tests follow from that declaration. Physics speaks in codes
//! with named numbers ([`Message`], [`Finding`]), never in sentences: the service words them.

mod conflict;
mod consequence;
mod design;
mod diagnosable;
mod figure;
mod finding;
mod forward;
mod hypothesis;
mod measured;
mod program;
mod ranges;
mod table;
mod user_formula;
mod watched;

pub use conflict::{Conflict, ConstraintName, ElasticScope, Infeasible, Relaxation};
pub use consequence::{Allowed, Consequence};
pub use design::{Condition, Design, Grouping, Smooth};
pub use diagnosable::{
    ClassLimits, Diagnosable, KnownOver, LimitCurve, Measurement, NextRun, NextRuns, Outlook, Over, Reading,
    ToldEffects, Unnamed,
};
pub(crate) use diagnosable::{divided, values_by_name};
pub use figure::{Along, Axis, Figure, Frame, Glyph, Handle, Item, Move, Panel, Place, Role, Said, Setting, Spacing};
pub use finding::{Finding, Message, Value, Values, Violations};
pub use forward::{Column as JacobianColumn, ForwardModel, Missing, Prediction, PrepareError, Quantity, Rows};
pub use hypothesis::{
    Expansions, Held, Hypotheses, Hypothesis, Inapplicability, Inapplicable, Range, Shape, Treatment, Variable,
};
pub use measured::{Measured, MeasuredRow};
pub use program::{Block, Dialect, Program, ProgramEncoding, ProgramEnd, ProgramOrigin, ReturnedProgram};
pub use ranges::{ConditionRange, Ranges};
pub use table::{Cells, Column, Table};
pub(crate) use user_formula::{FormulaRoom, values_of_formula};
pub use watched::{Limits, TellingRun, Watched};

use serde::{Serialize, de::DeserializeOwned};
use utoipa::ToSchema;

/// One question that the product answers: a job in, an answer out, nothing else touched.
pub trait Calculator: Send + Sync + 'static {
    /// The job. Its schema is the contract: ranges, units and descriptions stand on its fields.
    type Input: DeserializeOwned + Serialize + ToSchema + Check + Send + Sync + 'static;
    /// The result. Every number in it is finite or absent.
    type Output: Serialize + DeserializeOwned + ToSchema + Send + Sync + 'static;

    /// What stands on the door.
    const META: Meta;

    /// Writes out what depends on other fields or on the library (material id -> numbers), so that
    /// the cache key sees numbers only. Called after [`Check::check`] found nothing; idempotent.
    fn fill(input: &mut Self::Input);

    /// Expected work of a filled job. Cheap, monotone in every size, never panics.
    fn cost(input: &Self::Input) -> Cost;

    /// Computes the answer of a checked and filled job. Deterministic: equal jobs give equal bits.
    fn run(input: &Self::Input, monitor: &dyn Monitor) -> Result<Answer<Self::Output>, Failure>;

    /// The pictures of an answer; the first is the main one.
    fn figures(input: &Self::Input, output: &Self::Output) -> Vec<Figure>;

    /// The tables of an answer; the first is the one that a plain CSV request gets.
    fn tables(input: &Self::Input, output: &Self::Output) -> Vec<Table>;

    /// The program for the machine, where the answer is one: `None` if this calculator has none,
    /// `Err` if this answer has none (a station without a command).
    fn program(_input: &Self::Input, _output: &Self::Output) -> Option<Result<Program, Failure>> {
        None
    }

    /// The program that the job brought along, as the answer gives it back: `None` if jobs of this calculator bring none, `Err` if
    /// this answer has none. `made_by` names the answer, for a program in which that shall stand.
    fn returned(
        _input: &Self::Input,
        _output: &Self::Output,
        _made_by: &str,
    ) -> Option<Result<ReturnedProgram, Failure>> {
        None
    }

    /// The job for which another place of a [`Setting`] in a figure stands; `None` where there is none.
    fn at_place(_input: &Self::Input, _output: &Self::Output, _place: &Place<'_>) -> Option<Self::Input> {
        None
    }
}

/// Rules between fields, which no schema can say. Adds every fault, never stops at the first.
pub trait Check {
    /// Adds what is wrong with `self` to `violations`.
    fn check(&self, violations: &mut Violations);
}

/// The only window from physics to the outside world.
pub trait Monitor: Sync {
    /// Whether nobody waits for the answer any more. To be asked every 1 to 50 ms of work.
    fn cancelled(&self) -> bool;
    /// How far the work is, 0 to 1, never falling, and what it is doing.
    fn progress(&self, fraction: f64, stage: Message);
    /// The picture so far, of calculations that have one worth showing.
    fn interim(&self, _figure: Figure) {}
}

/// A monitor that never cancels and hears nothing: for tests and for the command line.
#[derive(Debug, Default, Clone, Copy)]
pub struct Unwatched;

impl Monitor for Unwatched {
    fn cancelled(&self) -> bool {
        false
    }
    fn progress(&self, _fraction: f64, _stage: Message) {}
}

/// A monitor that hears of no progress: for a calculation inside another one.
pub struct Quiet<'m>(pub &'m dyn Monitor);

impl Monitor for Quiet<'_> {
    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
    fn progress(&self, _fraction: f64, _stage: Message) {}
}

/// `Err(Failure::Cancelled)` once the monitor says so: `checkpoint(monitor)?`.
pub fn checkpoint(monitor: &dyn Monitor) -> Result<(), Failure> {
    if monitor.cancelled() { Err(Failure::Cancelled) } else { Ok(()) }
}

/// Looks at a monitor once per so much work, however the work is cut up into turns of loops.
pub struct Pace<'a> {
    monitor: &'a dyn Monitor,
    since_look: usize,
}

impl<'a> Pace<'a> {
    /// Multiplications between two looks: some milliseconds.
    const PER_LOOK: usize = 4_000_000;

    /// Nothing done yet.
    pub fn new(monitor: &'a dyn Monitor) -> Self {
        Self { monitor, since_look: 0 }
    }

    /// Counts work in multiplications, done or about to be done; `Err(Failure::Cancelled)` once nobody waits for the answer.
    pub fn work(&mut self, multiplications: usize) -> Result<(), Failure> {
        self.since_look = self.since_look.saturating_add(multiplications);
        if self.since_look < Self::PER_LOOK {
            return Ok(());
        }
        self.since_look = 0;
        checkpoint(self.monitor)
    }
}

/// A calculator's name, version, examples and sources.
#[derive(Debug, Clone, Copy)]
pub struct Meta {
    /// The name in routes and job files: `deflection-compensation`.
    pub id: &'static str,
    /// A full calculator, or an evaluation of data.
    pub kind: CalculatorKind,
    /// Rises whenever the numbers of an unchanged job may change; part of the cache key.
    pub version: u32,
    /// A few words for a list.
    pub title: &'static str,
    /// The question it answers, as a user would ask it.
    pub question: &'static str,
    /// One paragraph: what comes in, what comes out, by which physics.
    pub summary: &'static str,
    /// Where the formulas come from.
    pub references: &'static [&'static str],
    /// Complete jobs that really run; the first is the source paper's own.
    pub examples: &'static [Example],
    /// By what of a job a person knows it again in a list, the most telling first.
    pub hallmarks: &'static [Hallmark],
    /// Pointers into the result that a parameter study shows unless asked for others.
    pub study_outputs: &'static [&'static str],
    /// Everything that this calculator may utter. A test holds that each code has a text, and that
    /// nothing else is uttered.
    pub codes: Codes,
    /// `id`s of the figures, tables it makes (documentation of `?figure=` and `?table=`).
    pub figures: &'static [&'static str],
    /// `id`s of the tables it makes.
    pub tables: &'static [&'static str],
    /// Where the programs for a machine come from that its answers have; `None` of one whose answers have none.
    pub program: Option<ProgramOrigin>,
}

/// Something of a job by which a person knows it again. Pointers lead into the filled job; `*` stands for every item of
/// a list. Where a job has nothing there, nothing is said.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hallmark {
    /// A number or a word; of several numbers the least and the largest.
    Of(&'static str),
    /// The sum of several numbers.
    Sum(&'static str),
    /// How many items a list or a measured table has.
    Count(&'static str),
}

impl Hallmark {
    /// Where it stands.
    pub const fn pointer(self) -> &'static str {
        match self {
            Self::Of(pointer) | Self::Sum(pointer) | Self::Count(pointer) => pointer,
        }
    }
}

/// Codes by what they are used for, in the lists of the modules that utter them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Codes {
    /// Faults of a job, found by [`Check`].
    pub faults: &'static [&'static [&'static str]],
    /// Why a faultless job has no answer ([`Failure`]).
    pub failures: &'static [&'static [&'static str]],
    /// Warnings of an answer.
    pub warnings: &'static [&'static [&'static str]],
    /// What an answer explains.
    pub explanations: &'static [&'static [&'static str]],
    /// What a running calculation is doing.
    pub stages: &'static [&'static [&'static str]],
    /// Titles, axes and legends of figures.
    pub labels: &'static [&'static [&'static str]],
}

impl Codes {
    /// All of them, whatever they are used for.
    pub fn all(&self) -> impl Iterator<Item = &'static str> {
        [self.faults, self.failures, self.warnings, self.explanations, self.stages, self.labels]
            .into_iter()
            .flat_map(|lists| lists.iter().copied().flatten().copied())
    }

    /// Whether this code may be uttered.
    pub fn contains(&self, code: &str) -> bool {
        self.all().any(|known| known == code)
    }
}

/// What kind of question a calculator answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CalculatorKind {
    /// Predicts and decides from a model.
    Calculator,
    /// Evaluates data that the user brings.
    Evaluation,
}

/// A complete job that runs, shown in the contract and in the form.
#[derive(Debug, Clone, Copy)]
pub struct Example {
    /// Name in the contract, `snake_case`.
    pub id: &'static str,
    /// What it shows.
    pub title: &'static str,
    /// The job as JSON.
    pub job: &'static str,
}

/// Expected work of a job on a reference core.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cost {
    /// CPU time, ms.
    pub ms: f64,
    /// Memory held at the same time, bytes.
    pub bytes: u64,
    /// Pointer to the field that drives the cost: what to make smaller.
    pub driver: &'static str,
}

/// A result with everything that is to be said of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Answer<O> {
    /// The numbers.
    pub output: O,
    /// Where an input leaves a formula's range of validity, and the like.
    pub warnings: Vec<Finding>,
    /// What dominates, what binds, what would help: most important first.
    pub explanation: Vec<Message>,
    /// The equations used and their sources.
    pub basis: Vec<Basis>,
}

/// An equation that acted, by its number in the documentation, and where it comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
pub struct Basis {
    /// Number of the equation in the documentation of the physics, `deflection/3.1`.
    pub equation: &'static str,
    /// Where it comes from.
    pub source: &'static str,
}

/// Why a checked job has no answer. Deterministic but for `Cancelled` and `Internal`.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Failure {
    /// Nobody waits for it any more.
    #[error("cancelled")]
    Cancelled,
    /// No solution exists; says which limits conflict and what would make it possible.
    #[error("infeasible: {}", .0.code)]
    Infeasible(Finding),
    /// No solution exists, with the limits that conflict and the least relaxation that would make one.
    #[error("limits conflict: {}", .0.finding.code)]
    Conflicting(Box<Conflict>),
    /// An iteration did not reach its tolerance.
    #[error("{what} did not converge after {iterations} iterations, residual {residual:e}")]
    NotConverged {
        /// What was being solved for.
        what: &'static str,
        /// What was left, in the unit of the equation.
        residual: f64,
        /// Steps taken.
        iterations: u32,
    },
    /// The physics of the model does not cover the job.
    #[error("outside the model: {}", .0.code)]
    OutOfModel(Finding),
    /// A program that the job brings along is not read.
    #[error("the program is not read: {total} faults")]
    NotRead {
        /// The first of its faults, in the order of the program.
        findings: Vec<Finding>,
        /// How many there are.
        total: usize,
    },
    /// Our own fault.
    #[error("internal: {0}")]
    Internal(String),
}

/// Receives every calculator, typed, in the order in which they are offered.
pub trait Registrar {
    /// A calculator without a forward model.
    fn calculator<C: Calculator>(&mut self);
    /// A calculator whose model a diagnosis can run.
    fn with_forward_model<C: Calculator + ForwardModel<Job = C::Input>>(&mut self) {
        self.calculator::<C>();
    }
    /// A calculator whose model a diagnosis can compare with measurements.
    fn diagnosable<C: Diagnosable>(&mut self) {
        self.with_forward_model::<C>();
    }
    /// A calculator whose process can be watched part by part.
    fn watched<C: Watched>(&mut self) {
        self.diagnosable::<C>();
    }
}
