//! What many operations of the contract share: headers, problems, the envelope of an answer.

use precut_calc::calculator::Basis;
use serde_json::{Value, json};
use utoipa::openapi::content::ContentBuilder;
use utoipa::openapi::header::{Header, HeaderBuilder};
use utoipa::openapi::path::{OperationBuilder, Parameter, ParameterBuilder, ParameterIn};
use utoipa::openapi::response::{Response, ResponseBuilder};
use utoipa::openapi::schema::{KnownFormat, ObjectBuilder, SchemaFormat, SchemaType, Type};
use utoipa::openapi::security::SecurityRequirement;
use utoipa::openapi::{Content, Object, Ref, RefOr, Required, Schema};

use crate::http::answer::Include;
use crate::http::negotiate::Media;
use crate::http::problem::ProblemDocument;
use crate::http::query::MOST_ITEMS;
use crate::text::Remark;

pub(super) const BEARER: &str = "bearer";

pub(super) const TAGS: [(&str, &str); 9] = [
    ("calculators", "Predict and decide from a model of the process."),
    ("evaluations", "Evaluate data that the user brings."),
    ("studies", "Vary one to three fields of any of them."),
    ("jobs", "Calculations that take long: watched, cancelled, and their results."),
    ("models", "What diagnoses found, stored for later jobs."),
    ("processes", "Parts that come one after another: what changed, since which part, what now."),
    ("library", "What can be asked, and the data of the engine."),
    ("results", "Kept answers, read again without computing."),
    ("service", "Health, figures, documentation."),
];

/// Schemas that every contract has.
pub(super) fn schemas() -> Vec<(String, RefOr<Schema>)> {
    let mut schemas = super::schemas_of::<ProblemDocument>();
    schemas.extend(super::schemas_of::<Remark>());
    schemas.extend(super::schemas_of::<Basis>());
    schemas
}

/// Problems by status: name of the response, what it means.
const PROBLEMS: [(u16, &str, &str); 21] = [
    (400, "BadRequest", "The request or the body's JSON is malformed: `errors` has line and column."),
    (401, "Unauthorized", "A key is needed, or the one sent is none."),
    (403, "Forbidden", "The key may not do this: it lacks the scope in `detail`."),
    (404, "NotFound", "There is nothing of that name; where one is like it, `detail` says which."),
    (405, "MethodNotAllowed", "The address has other methods: see `Allow`."),
    (406, "NotAcceptable", "None of the accepted media types exists here; `detail` lists those that do."),
    (408, "RequestTimeout", "The body did not arrive in time."),
    (409, "Conflict", "The job has no result: it is not finished (come again after `Retry-After`), or was cancelled."),
    (
        410,
        "Gone",
        "The result is kept no longer, or was made by another version of its calculator and cannot be drawn any more.",
    ),
    (
        412,
        "PreconditionFailed",
        "What is there is not what the request names in `If-Match`, or something has the name already.",
    ),
    (413, "PayloadTooLarge", "The body is larger than the limit in `detail`."),
    (414, "UriTooLong", "The address is longer than 8 KiB."),
    (415, "UnsupportedMediaType", "The body is of another type than those in `detail`."),
    (
        422,
        "Unprocessable",
        "The job breaks rules (every fault is in `errors`), is too expensive, or has no answer: infeasible, outside the model, not converged. Then `code` says why and `detail` what would make it possible.",
    ),
    (428, "PreconditionRequired", "Something else is there: a change names its `ETag` in `If-Match`."),
    (
        429,
        "TooManyRequests",
        "The client asks more often than its rate allows, has too many event streams open, or has spent a quota: of work in an hour, of bytes kept. `detail` says what is left and when there is more.",
    ),
    (431, "HeaderTooLarge", "The header is larger than 32 KiB."),
    (500, "InternalError", "The service's own fault; its log knows the request id."),
    (
        503,
        "Unavailable",
        "Busy, overloaded, its queue full, shutting down, or without its store: come again after `Retry-After`.",
    ),
    (507, "InsufficientStorage", "The disk is full: a job that cannot be put on record is not taken."),
    (0, "Problem", "Any other problem."),
];

/// Statuses that every guarded operation can give.
const ANYWHERE: [u16; 7] = [401, 403, 414, 429, 431, 500, 503];

fn problem_name(status: u16) -> &'static str {
    PROBLEMS.iter().find(|(known, ..)| *known == status).map_or("Problem", |(_, name, _)| name)
}

/// The problems as shared responses.
pub(super) fn responses() -> Vec<(String, Response)> {
    PROBLEMS
        .iter()
        .map(|&(status, name, text)| {
            let content =
                ContentBuilder::new().schema(Some(Ref::from_schema_name("Problem"))).example(example(status)).build();
            let mut response = ResponseBuilder::new()
                .description(text)
                .content("application/problem+json", content)
                .header("x-request-id", request_id())
                .header("Content-Language", text_header("Language of the sentences: `en` or `ru`.", "en"));
            if matches!(status, 409 | 429 | 503) {
                response = response.header("Retry-After", retry_after());
            }
            if status == 429 {
                response =
                    quotas().into_iter().fold(response, |response, (name, header)| response.header(name, header));
            }
            if status == 401 {
                response =
                    response.header("WWW-Authenticate", text_header("How to send a key.", "Bearer realm=\"precut\""));
            }
            if status == 405 {
                response = response.header("Allow", text_header("Methods of the address.", "GET,HEAD"));
            }
            (name.to_owned(), response.build())
        })
        .collect()
}

fn example(status: u16) -> Option<Value> {
    (status == 422).then(|| {
        json!({
            "type": "/problems/invalid_job",
            "code": "invalid_job",
            "title": "The job breaks rules",
            "status": 422,
            "detail": "one field is at fault; see errors",
            "instance": "019a1f0e-5d3c-7c39-9d5c-0a4d7c1f2b6e",
            "errors": [{
                "pointer": "/cut/feed_mm_per_rev",
                "code": "out_of_range",
                "detail": "feed_mm_per_rev is 9 mm/rev; allowed is 0.01 to 5 mm/rev",
                "value": 9.0,
                "limit": 5.0,
                "unit": "mm/rev"
            }],
            "errors_total": 1
        })
    })
}

/// Adds problems to an operation, and what every request takes and gives.
pub(super) fn guarded(mut operation: OperationBuilder, own: &[u16]) -> OperationBuilder {
    for status in own.iter().chain(&ANYWHERE) {
        operation = operation.response(status.to_string(), Ref::from_response_name(problem_name(*status)));
    }
    with_request_id(operation).securities(Some([SecurityRequirement::default(), bearer()]))
}

/// The same for operations that need no key.
pub(super) fn open(mut operation: OperationBuilder, own: &[u16]) -> OperationBuilder {
    operation = operation.securities(Some(Vec::new()));
    for status in own.iter().chain(&[414, 431, 500, 503]) {
        operation = operation.response(status.to_string(), Ref::from_response_name(problem_name(*status)));
    }
    with_request_id(operation)
}

fn bearer() -> SecurityRequirement {
    SecurityRequirement::new(BEARER, Vec::<String>::new())
}

fn with_request_id(operation: OperationBuilder) -> OperationBuilder {
    operation.parameter(header_parameter(
        "x-request-id",
        "An id for the log: 1 to 128 letters, digits and `-_.:/+=`. Anything else is replaced.",
    ))
}

/// Parameters of everything that is worded and can be asked for again.
pub(super) fn conditional(operation: OperationBuilder) -> OperationBuilder {
    operation
        .parameter(header_parameter(
            "Accept-Language",
            "Languages of sentences by preference: `en` (English) or `ru` (Russian); English where none fits.",
        ))
        .parameter(header_parameter(
            "If-None-Match",
            "Entity tags that the client has: `304` if the answer is among them.",
        ))
        .response(
            "304",
            ResponseBuilder::new()
                .description("The client has the answer already.")
                .header("ETag", etag())
                .header("x-request-id", request_id()),
        )
}

fn header_parameter(name: &str, text: &str) -> Parameter {
    parameter(name, ParameterIn::Header, text, string()).build()
}

/// An optional parameter.
pub(super) fn parameter(name: &str, place: ParameterIn, text: &str, schema: Object) -> ParameterBuilder {
    ParameterBuilder::new()
        .name(name)
        .parameter_in(place)
        .required(Required::False)
        .description(Some(text))
        .schema(Some(schema))
}

/// How many things a page of a list shall have.
pub(super) fn limit(text: &str, default: u32) -> Parameter {
    parameter("limit", ParameterIn::Query, text, integer(1, MOST_ITEMS, default)).build()
}

/// What an answer as JSON may bring along.
pub(super) fn include() -> Parameter {
    let words = one_of(Include::ALL.iter().map(|include| include.word().to_owned()));
    let text = "`figures`: what there is to draw, as the last field of an answer as JSON: one request in place of two.";
    parameter("include", ParameterIn::Query, text, words).build()
}

/// A part of the address.
pub(super) fn path_parameter(name: &str, text: &str, schema: Object, example: Value) -> Parameter {
    ParameterBuilder::new()
        .name(name)
        .parameter_in(ParameterIn::Path)
        .required(Required::True)
        .description(Some(text))
        .schema(Some(schema))
        .example(Some(example))
        .build()
}

pub(super) fn string() -> Object {
    ObjectBuilder::new().schema_type(SchemaType::new(Type::String)).build()
}

pub(super) fn one_of(values: impl IntoIterator<Item = String>) -> Object {
    ObjectBuilder::new().schema_type(SchemaType::new(Type::String)).enum_values(Some(values)).build()
}

pub(super) fn integer(minimum: u32, maximum: u32, default: u32) -> Object {
    ObjectBuilder::new()
        .schema_type(SchemaType::new(Type::Integer))
        .format(Some(SchemaFormat::KnownFormat(KnownFormat::Int32)))
        .minimum(Some(minimum))
        .maximum(Some(maximum))
        .default(Some(json!(default)))
        .build()
}

/// The address of a result.
pub(super) fn key() -> Object {
    ObjectBuilder::new()
        .schema_type(SchemaType::new(Type::String))
        .pattern(Some("^b3:[0-9a-f]{64}$"))
        .description(Some("Hash of everything that the answer depends on: its lasting name."))
        .build()
}

/// A successful response with one body, and the headers that all have.
pub(super) fn success(text: &str, media: &str, content: Content) -> ResponseBuilder {
    ResponseBuilder::new().description(text).content(media, content).header("x-request-id", request_id())
}

pub(super) fn json_of(schema: &str) -> Content {
    Content::new(Some(Ref::from_schema_name(schema)))
}

/// A stream of events. OpenAPI 3.1 has no word for its items: as its tools have it, the schema is that of one event.
pub(super) fn events(about: &str, event: &str, data: &str) -> Content {
    let string = |about: &str| ObjectBuilder::new().schema_type(SchemaType::new(Type::String)).description(Some(about));
    let schema = ObjectBuilder::new()
        .property("event", string(event))
        .property("id", string("Number of the event, for `Last-Event-ID`."))
        .property("data", string(data))
        .description(Some(about));
    Content::new(Some(schema.build()))
}

pub(super) fn text_of(text: &str) -> Content {
    let schema = ObjectBuilder::new().schema_type(SchemaType::new(Type::String)).description(Some(text)).build();
    Content::new(Some(schema))
}

/// Bytes that are no text.
pub(super) fn file_of(text: &str) -> Content {
    let binary = SchemaFormat::KnownFormat(KnownFormat::Binary);
    let schema = ObjectBuilder::new().schema_type(SchemaType::new(Type::String)).format(Some(binary));
    Content::new(Some(schema.description(Some(text)).build()))
}

/// The forms of an answer beside JSON, whichever calculator made it.
pub(super) fn other_forms(mut response: ResponseBuilder) -> ResponseBuilder {
    for (media, text) in [
        (Media::Csv, "One of its tables."),
        (Media::Svg, "One of its figures."),
        (Media::Gcode, "Its program."),
        (Media::Diff, "What changed in the program of its job."),
    ] {
        response = response.content(media.essence(), text_of(text));
    }
    for (media, text) in [(Media::Xlsx, "All of its tables as a workbook."), (Media::Pdf, "All of it as a report.")] {
        response = response.content(media.essence(), file_of(text));
    }
    response
}

/// Headers of what can be asked for again.
pub(super) fn tagged(response: ResponseBuilder) -> ResponseBuilder {
    response
        .header("ETag", etag())
        .header("Vary", text_header("What the representation depends on.", "Accept, Accept-Language, Accept-Encoding"))
}

pub(super) fn etag() -> Header {
    text_header(
        "Tag of exactly these bytes: one per content, media type and language.",
        "\"5d41402abc4b2a76-json--en\"",
    )
}

pub(super) fn request_id() -> Header {
    text_header("Id of the request: the client's own, or a new one.", "019a1f0e-5d3c-7c39-9d5c-0a4d7c1f2b6e")
}

fn retry_after() -> Header {
    HeaderBuilder::new()
        .schema(Some(ObjectBuilder::new().schema_type(SchemaType::new(Type::Integer)).minimum(Some(1)).build()))
        .description(Some("Seconds after which it is worth coming again."))
        .build()
}

pub(super) fn text_header(text: &str, example: &str) -> Header {
    HeaderBuilder::new().schema(Some(string())).description(Some(text)).example(Some(json!(example))).build()
}

/// How an owner stands with his quotas, in the header of an answer.
pub(super) fn quotas() -> [(&'static str, Header); 2] {
    let policy = "Where the service sets quotas: which. `work`: seconds of computation in an hour; `kept`: bytes of jobs \
                  and results (draft-ietf-httpapi-ratelimit-headers).";
    let limit =
        "Where it sets quotas: what is left (`r`), and after how many seconds some of what is taken comes back (`t`).";
    [
        (
            "RateLimit-Policy",
            text_header(
                policy,
                "\"work\";q=3600;qu=\"compute-seconds\";w=3600, \"kept\";q=200000000;qu=\"kept-bytes\"",
            ),
        ),
        ("RateLimit", text_header(limit, "\"work\";r=3540;t=1260, \"kept\";r=187654321;t=86400")),
    ]
}

pub(super) fn header_of(schema: Object, text: &str) -> Header {
    HeaderBuilder::new().schema(Some(schema)).description(Some(text)).build()
}
