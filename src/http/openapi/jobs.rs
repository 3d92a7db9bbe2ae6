//! The operations of jobs, and what a request that may become a job takes and gives besides.

use serde_json::json;
use utoipa::openapi::header::{Header, HeaderBuilder};
use utoipa::openapi::link::{Link, LinkBuilder};
use utoipa::openapi::path::{HttpMethod, OperationBuilder, Parameter, ParameterIn, PathItem};
use utoipa::openapi::request_body::RequestBodyBuilder;
use utoipa::openapi::response::ResponseBuilder;
use utoipa::openapi::schema::{ObjectBuilder, SchemaType, Type};
use utoipa::openapi::{Content, Object, RefOr, Required, Schema, SchemaFormat};

use super::parts;
use crate::http::calculators::{LEAST_DEADLINE_S, MOST_DEADLINE_S};
use crate::http::negotiate::Media;
use crate::http::query::DEFAULT_ITEMS;
use crate::http::{callbacks, events, jobs};
use crate::registry::Registry;
use crate::store::jobs::{JobState, Priority};

const ID: &str = "^[0-9a-f]{8}-[0-9a-f]{4}-7[0-9a-f]{3}-[0-9a-f]{4}-[0-9a-f]{12}$";
const EXAMPLE: &str = "0198c5f1-8a3e-7c40-b0a1-5e2d9f4c6b7a";
/// What an address is told that came with a job.
pub(super) const OVER: &str = "job_is_over";

/// Address and operations.
pub(super) fn paths(registry: &Registry) -> Vec<(&'static str, PathItem)> {
    let get = |operation: OperationBuilder| PathItem::new(HttpMethod::Get, operation);
    let mut one = get(read());
    one.delete = Some(cancel().build());
    vec![
        ("/v1/jobs", get(list(registry))),
        ("/v1/jobs/{id}", one),
        ("/v1/jobs/{id}/result", get(result())),
        ("/v1/jobs/{id}/job", get(input())),
        ("/v1/jobs/{id}/events", get(follow())),
    ]
}

/// Schemas of what they answer.
pub(super) fn schemas() -> Vec<(String, RefOr<Schema>)> {
    [
        super::schemas_of::<jobs::JobList>(),
        super::schemas_of::<events::JobProgress>(),
        super::schemas_of::<callbacks::JobEvent>(),
        super::schemas_of::<callbacks::ProcessEvent>(),
    ]
    .concat()
}

/// Adds to a calculator's operation that it may become a job.
pub(super) fn may_become_one(operation: OperationBuilder) -> OperationBuilder {
    let header = |name, text: &str, schema| parts::parameter(name, ParameterIn::Header, text, schema).build();
    let query = |name, text: &str, schema| parts::parameter(name, ParameterIn::Query, text, schema).build();
    let words = Priority::ALL.iter().map(|priority| priority.word().to_owned());
    let mut priority = parts::one_of(words);
    priority.default = Some(json!(Priority::Normal.word()));
    let deadline = ObjectBuilder::new()
        .schema_type(SchemaType::new(Type::Number))
        .minimum(Some(LEAST_DEADLINE_S))
        .maximum(Some(MOST_DEADLINE_S))
        .build();
    let url = ObjectBuilder::new()
        .schema_type(SchemaType::new(Type::String))
        .format(Some(SchemaFormat::Custom("uri".to_owned())))
        .max_length(Some(2048))
        .build();
    let key = ObjectBuilder::new().schema_type(SchemaType::new(Type::String)).pattern(Some("^[!-~]{1,255}$")).build();
    operation
        .parameter(header(
            "Prefer",
            "`respond-async`: a job at once, unless the answer is there already. `wait=N`: wait up to N seconds (at most \
             60) for a job's result. Without either, short jobs are answered and long ones become jobs (RFC 7240).",
            parts::string(),
        ))
        .parameter(header(
            "Idempotency-Key",
            "The client's own name for the request: the same name with the same body is the same job, whatever happened \
             in between; with another body it is refused.",
            key,
        ))
        .parameter(query("priority", "Which jobs go first, should this become one.", priority))
        .parameter(query("deadline_s", "After so many seconds the answer is of no use any more.", deadline))
        .parameter(query(
            "callback",
            "Address that is told when this is over: a signed `JobEvent` is posted to it (Standard Webhooks), again and \
             again until it is taken. Such a request is always a job. Hosts have to be allowed (`callbacks.hosts`).",
            url,
        ))
        .parameter(header(
            "traceparent",
            "Where the request belongs in a trace (W3C Trace Context): passed on to the job and to its callback.",
            parts::string(),
        ))
        .parameter(header(
            "tracestate",
            "What the systems on the trace's way say of it: passed on with `traceparent`, 32 entries and 512 characters of it.",
            parts::string(),
        ))
        .response("202", accepted())
}

/// What the service posts to whoever is told that a job is over.
pub(super) fn callback() -> PathItem {
    let over = operation(
        OVER,
        "Is that job over?",
        "Posted to the address that came with a job as `callback`, signed as Standard Webhooks has it. It is delivered at \
         least once; `webhook-id` is the same each time. No redirect is followed, and no body of an answer is read.",
    );
    posted(over, "JobEvent", "The job that is over. The same at every try.")
}

/// What is posted to an address that is told something.
pub(super) fn posted(operation: OperationBuilder, event: &str, about: &str) -> PathItem {
    let header = |name, text: &str| parts::parameter(name, ParameterIn::Header, text, parts::string()).build();
    let body = RequestBodyBuilder::new()
        .description(Some(about))
        .required(Some(Required::True))
        .content("application/json", parts::json_of(event));
    let answer = |text: &str| ResponseBuilder::new().description(text);
    let operation = operation
    .parameter(header("webhook-id", "Id of what is told: the same at every try."))
    .parameter(header("webhook-timestamp", "When this try was made, seconds since 1970 UTC."))
    .parameter(header(
        "webhook-signature",
        "`v1,` and the base64 of HMAC-SHA256 over `id.timestamp.body`; two, with a space between, while a secret is replaced.",
    ))
    .parameter(header("traceparent", "Where the call belongs in a trace, if the job does."))
    .parameter(header("tracestate", "What came with the job beside its `traceparent`."))
    .request_body(Some(body.build()))
    // Its signature says who it is from.
    .securities(Some(Vec::new()))
    .response("2XX", answer("It is taken."))
    .response("410", answer("Nobody is there any more: it is given up at once."))
    .response("default", answer("It is tried again, after longer and longer pauses, or that of `Retry-After` if it is longer, up to a day."));
    PathItem::new(HttpMethod::Post, operation)
}

fn accepted() -> ResponseBuilder {
    let response = parts::success(
        "It is a job now, and will be done whatever happens to this process.",
        "application/json",
        parts::json_of("Job"),
    );
    let response = parts::quotas().into_iter().fold(response, |response, (name, header)| response.header(name, header));
    response
        .header("Location", parts::text_header("Address of the job.", &format!("/v1/jobs/{EXAMPLE}")))
        .header("Retry-After", seconds())
        .header("Preference-Applied", parts::text_header("Preferences that were followed.", "respond-async"))
        .header("Content-Language", parts::text_header("Language of the sentences: `en` or `ru`.", "en"))
        .link("job", link("read_job", "Reads the job."))
        .link("result", link("read_job_result", "Reads its result."))
        .link("cancel", link("cancel_job", "Cancels it."))
}

fn link(operation: &str, text: &str) -> Link {
    LinkBuilder::new().operation_id(operation).parameter("id", "$response.body#/id").description(text).build()
}

fn seconds() -> Header {
    HeaderBuilder::new()
        .schema(Some(ObjectBuilder::new().schema_type(SchemaType::new(Type::Integer)).minimum(Some(1)).build()))
        .description(Some("Seconds after which it is worth looking again."))
        .build()
}

fn operation(id: &str, summary: &str, description: &str) -> OperationBuilder {
    OperationBuilder::new().tag("jobs").operation_id(Some(id)).summary(Some(summary)).description(Some(description))
}

fn id() -> Parameter {
    parts::path_parameter("id", "Name of the job.", text_like(ID), json!(EXAMPLE))
}

fn text_like(pattern: &str) -> Object {
    ObjectBuilder::new().schema_type(SchemaType::new(Type::String)).pattern(Some(pattern)).build()
}

fn languages(operation: OperationBuilder) -> OperationBuilder {
    let text = "Languages of sentences by preference: `en` (English) or `ru` (Russian); English where none fits.";
    operation.parameter(parts::parameter("Accept-Language", ParameterIn::Header, text, parts::string()).build())
}

fn the_job(text: &str) -> ResponseBuilder {
    parts::success(text, "application/json", parts::json_of("Job"))
        .header("Retry-After", seconds())
        .header("Content-Language", parts::text_header("Language of the sentences: `en` or `ru`.", "en"))
}

fn list(registry: &Registry) -> OperationBuilder {
    let query = |name, text: &str, schema| parts::parameter(name, ParameterIn::Query, text, schema).build();
    let ids: Vec<String> = registry.entries().iter().map(|entry| entry.meta().id.to_owned()).collect();
    let calculator = if ids.is_empty() { parts::string() } else { parts::one_of(ids) };
    let operation = operation(
        "list_jobs",
        "Which jobs are there?",
        "The jobs, newest first, by pages: follow `next` until it is null.",
    )
    .parameter(parts::limit("Most jobs of one page.", DEFAULT_ITEMS))
    .parameter(query(
        "state",
        "Only those in this state.",
        parts::one_of(JobState::ALL.iter().map(|state| state.word().to_owned())),
    ))
    .parameter(query("calculator", "Only those of this calculator.", calculator))
    .parameter(query("after", "Where the page before ended: taken from its `next`.", text_like(ID)))
    .response(
        "200",
        parts::success("A page of jobs.", "application/json", parts::json_of("JobList"))
            .header("Content-Language", parts::text_header("Language of the sentences: `en` or `ru`.", "en")),
    );
    parts::guarded(languages(operation), &[400, 404])
}

fn read() -> OperationBuilder {
    let operation = operation("read_job", "How far is that job?", "A job as it is now.")
        .parameter(id())
        .response("200", the_job("The job."));
    parts::guarded(languages(operation), &[404])
}

fn input() -> OperationBuilder {
    let operation = operation(
        "read_job_input",
        "What does that job compute?",
        "The job as it was accepted, with every default filled in and its measured tables as rows: to be looked at while \
         it is computed, or changed and sent again.",
    )
    .parameter(id())
    .response(
        "200",
        parts::tagged(parts::success("What it computes.", "application/json", parts::json_of("JobFile"))),
    );
    parts::guarded(parts::conditional(operation), &[404, 410])
}

fn cancel() -> OperationBuilder {
    let operation = operation(
        "cancel_job",
        "Is that job not wanted any more?",
        "Cancels a job: at once on record, and within 100 ms of work on its core. Other jobs that wait for the same \
         result keep the computation. Once more does no harm.",
    )
    .parameter(id())
    .response("200", the_job("It waited, or was over already."))
    .response("202", the_job("It was running; its computation is being stopped."));
    parts::guarded(languages(operation), &[404, 507])
}

fn result() -> OperationBuilder {
    let query = |name, text: &str| parts::parameter(name, ParameterIn::Query, text, parts::string()).build();
    let answer =
        ObjectBuilder::new().description(Some("The answer: `calculator` says which one made it, and by which schema."));
    let mut response = parts::tagged(parts::success("The answer.", Media::Json.essence(), Content::new(Some(answer))))
        .header("Content-Location", parts::text_header("Lasting address of the answer.", "/v1/results/b3:5d41..."))
        .header("Content-Language", parts::text_header("Language of the sentences: `en` or `ru`.", "en"))
        .header("Precut-Cache", parts::text_header("Always `hit`: nothing is computed.", "hit"))
        .header("Server-Timing", parts::text_header("Where the time went, ms.", "parse;dur=0.000"));
    response = parts::other_forms(response);
    let operation = operation(
        "read_job_result",
        "What did that job come to?",
        "The result of a job in any of its forms, as the direct answer would have been. Of a failed job, its problem, \
         with the status that the direct answer would have had.",
    )
    .parameter(id())
    .parameter(query("table", "Which table, with `Accept: text/csv`; the first if absent."))
    .parameter(query("figure", "Which figure, with `Accept: image/svg+xml`; the first if absent."))
    .response("200", response);
    parts::guarded(parts::conditional(operation), &[400, 404, 406, 409, 410, 422, 507])
}

fn follow() -> OperationBuilder {
    let text = "Events `state` and `done` with the job as data, `progress` with a `JobProgress`, `interim` with a figure \
                of what is computed so far. At most five `progress` and `interim` each second.";
    let stream =
        parts::events(text, "`state`, `progress`, `interim` or `done`.", "JSON: a `Job`, a `JobProgress` or a figure.");
    let stream = parts::success("The events, until the job is over.", "text/event-stream", stream);
    // Any text: what is no number of an event is as good as none.
    let last = ObjectBuilder::new().schema_type(SchemaType::new(Type::String)).build();
    let operation = operation(
        "follow_job",
        "Can I watch that job?",
        "Server-sent events: what the job is when the stream begins, every change of its state, its progress, and its \
         end, with which the stream ends. A client that comes back with `Last-Event-ID` gets events with higher \
         numbers only, and `204` if it has had the last.",
    )
    .parameter(id())
    .parameter(
        parts::parameter("Last-Event-ID", ParameterIn::Header, "Number of the last event received.", last).build(),
    )
    .response("200", stream)
    .response(
        "204",
        ResponseBuilder::new()
            .description("The job is over and the client has had its last event.")
            .header("x-request-id", parts::request_id()),
    );
    parts::guarded(languages(operation), &[404])
}
