//! The types of a calculator, closed over.

use std::marker::PhantomData;

use precut_calc::calculator::{
    Answer, Calculator, Check, Failure, Figure, Finding, Meta, Monitor, Place, Table, Violations,
};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::calculation::{
    Calculation, Job, MaybeProgram, MaybeReturned, Moved, Prepared, ResultNotes, Unprepared, UnreadableResult,
};
use super::canonical::canonical;
use super::{Unwritable, append_result, child, non_finite_place};

/// The types of a calculator.
pub(super) struct Typed<C> {
    /// See [`Prepared::numbers_of`].
    numbers_of: Option<Meta>,
    types: PhantomData<fn() -> C>,
}

impl<C> Typed<C> {
    pub(super) fn new(numbers_of: Option<&Meta>) -> Self {
        Self { numbers_of: numbers_of.copied(), types: PhantomData }
    }
}

/// What a family does with a job that names none of its calculators; the schema has refused such a job before.
pub(super) struct NoCalculator;

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
        Ok(Prepared::new(C::cost(&input), canonical, self.numbers_of.as_ref(), Box::new(TypedJob::<C>(input))))
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
