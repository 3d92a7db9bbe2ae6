//! A calculator's operation, from its declaration.

use precut_calc::calculator::{CalculatorKind, Example, Meta, ProgramOrigin};
use std::fmt::Write as _;

use serde_json::{Value, json};
use utoipa::openapi::content::ContentBuilder;
use utoipa::openapi::encoding::Encoding;
use utoipa::openapi::example::ExampleBuilder;
use utoipa::openapi::link::LinkBuilder;
use utoipa::openapi::path::{HttpMethod, OperationBuilder, ParameterIn, PathItem};
use utoipa::openapi::request_body::{RequestBody, RequestBodyBuilder};
use utoipa::openapi::response::ResponseBuilder;
use utoipa::openapi::schema::{
    AdditionalProperties, ArrayBuilder, KnownFormat, ObjectBuilder, SchemaFormat, SchemaType, Type,
};
use utoipa::openapi::{Content, Object, Ref, RefOr, Required, Schema};

use super::{jobs, parts};
use crate::engine;
use crate::http::answer::offered;
use crate::http::negotiate::Media;
use crate::registry::{Entry, Registry, Schemas};

/// A calculator's part of the contract.
pub(super) struct Room {
    pub(super) path: PathItem,
    pub(super) schemas: Vec<(String, RefOr<Schema>)>,
}

pub(super) fn room(entry: &Entry) -> Room {
    let meta = entry.meta();
    let tag = match meta.kind {
        CalculatorKind::Calculator => "calculators",
        CalculatorKind::Evaluation => "evaluations",
    };
    operation(entry, &pascal(meta.id), tag, meta.examples)
}

/// Parameter studies, with the examples of calculators that are there.
pub(super) fn studies(registry: &Registry) -> Room {
    let entry = engine::studies_of(registry);
    let of = |example: &Example| {
        let study: Value = serde_json::from_str(example.job).unwrap_or(Value::Null);
        study["calculator"].as_str().is_some_and(|id| registry.entry(id).is_some())
    };
    let examples: Vec<Example> = entry.meta().examples.iter().filter(|example| of(example)).copied().collect();
    operation(&entry, "Study", "studies", &examples)
}

fn operation(entry: &Entry, name: &str, tag: &str, examples: &[Example]) -> Room {
    let meta = entry.meta();
    let (job, result, answer) = (format!("{name}Job"), format!("{name}Result"), format!("{name}Answer"));
    let Schemas { input, output, components: mut schemas } = entry.schemas();
    schemas.push((job.clone(), input));
    schemas.push((result.clone(), output));
    schemas.push((answer.clone(), envelope(meta, &result).into()));
    let operation = OperationBuilder::new()
        .tag(tag)
        .operation_id(Some(format!("solve_{}", meta.id.replace('-', "_"))))
        .summary(Some(meta.question))
        .description(Some(description(meta)))
        .request_body(Some(body(entry, &job, examples)))
        .response("200", answered(meta, &answer));
    let operation = parts::conditional(jobs::may_become_one(parameters(operation, meta)));
    let operation = parts::guarded(operation, &[400, 404, 406, 408, 409, 410, 413, 415, 422, 507]);
    Room { path: PathItem::new(HttpMethod::Post, operation), schemas }
}

fn description(meta: &Meta) -> String {
    let mut text = meta.summary.to_owned();
    if !meta.references.is_empty() {
        text.push_str("\n\nSources:\n");
        for reference in meta.references {
            let _ = writeln!(text, "- {reference}");
        }
    }
    text
}

/// `deflection-compensation` as `DeflectionCompensation`.
fn pascal(id: &str) -> String {
    id.split('-')
        .map(|word| {
            let mut letters = word.chars();
            letters.next().map(|first| first.to_ascii_uppercase()).into_iter().chain(letters).collect::<String>()
        })
        .collect()
}

fn parameters(mut operation: OperationBuilder, meta: &Meta) -> OperationBuilder {
    let ids = |ids: &[&str]| parts::one_of(ids.iter().map(|&id| id.to_owned()));
    if !meta.tables.is_empty() {
        let text = "Which table, with `Accept: text/csv`; the first if absent.";
        operation = operation.parameter(parts::parameter("table", ParameterIn::Query, text, ids(meta.tables)).build());
    }
    if !meta.figures.is_empty() {
        let text = "Which figure, with `Accept: image/svg+xml`; the first if absent.";
        operation =
            operation.parameter(parts::parameter("figure", ParameterIn::Query, text, ids(meta.figures)).build());
        operation = operation.parameter(parts::include());
    }
    operation
}

fn body(entry: &Entry, job: &str, examples: &[Example]) -> RequestBody {
    let examples = examples.iter().map(|example| {
        let value = serde_json::from_str(example.job).unwrap_or(Value::Null);
        (example.id, ExampleBuilder::new().summary(example.title).value(Some(value)).build())
    });
    let json = ContentBuilder::new().schema(Some(Ref::from_schema_name(job))).examples_from_iter(examples).build();
    let mut body = RequestBodyBuilder::new()
        .description(Some("The job. Whatever is left out takes its default, which the answer's `input` shows."))
        .required(Some(Required::True))
        .content("application/json", json);
    if entry.takes_files() {
        body = body.content("multipart/form-data", multipart(entry, job));
    }
    body.build()
}

/// The job as one part, its measured tables and long texts as files beside it.
fn multipart(entry: &Entry, job: &str) -> Content {
    let mut form = ObjectBuilder::new()
        .property("job", Ref::from_schema_name(job))
        .required("job")
        .additional_properties(Some(AdditionalProperties::FreeForm(false)));
    for table in entry.table_names() {
        let schema = ObjectBuilder::new().schema_type(SchemaType::new(Type::String)).description(Some(
            "The table as CSV in place of the field of the same name: header `name [unit]` or `name_unit`.",
        ));
        form = form.property(table, schema);
    }
    for text in entry.text_names() {
        let file = ObjectBuilder::new()
            .schema_type(SchemaType::new(Type::String))
            .format(Some(SchemaFormat::KnownFormat(KnownFormat::Binary)))
            .description(Some("The file in place of the text of the same name, byte for byte."));
        form = form.property(text, file);
    }
    let mut encoding = Encoding::default();
    encoding.content_type = Some("application/json".to_owned());
    ContentBuilder::new().schema(Some(form.build())).encoding("job", encoding).build()
}

fn answered(meta: &Meta, answer: &str) -> ResponseBuilder {
    let mut response = parts::tagged(parts::success("The answer.", Media::Json.essence(), parts::json_of(answer)))
        .header("Content-Location", parts::text_header("Lasting address of the answer.", "/v1/results/b3:5d41..."))
        .header("Content-Language", parts::text_header("Language of the sentences: `en` or `ru`.", "en"))
        .header(
            "Precut-Cache",
            parts::header_of(parts::one_of(["hit", "miss"].map(ToOwned::to_owned)), "Whether it was there already."),
        )
        .header("Preference-Applied", parts::text_header("Preferences that were followed.", "wait=10"))
        .header(
            "Server-Timing",
            parts::text_header("Where the time went, ms.", "parse;dur=0.041, queue;dur=0.004, run;dur=0.310"),
        );
    response = parts::quotas().into_iter().fold(response, |response, (name, header)| response.header(name, header));
    response = response.link(
        "result",
        LinkBuilder::new()
            .operation_id("read_result")
            .parameter("key", "$response.body#/key")
            .description("Reads the answer again, in any form, without computing.")
            .build(),
    );
    for media in offered(meta) {
        let text = match media {
            Media::Json => continue,
            Media::Csv => "One table; header `name [unit]`, decimal points, UTF-8.",
            Media::Svg => "One figure, worth printing.",
            Media::Gcode if meta.program == Some(ProgramOrigin::Brought) => {
                "The job's own program as it is given back, in its own encoding; `422` where none is."
            }
            Media::Gcode => "The program for the machine; `422` while a station has no command.",
            Media::Diff => {
                "What changed in the job's program, as a unified diff in its encoding; empty where nothing did."
            }
            Media::Xlsx => "A workbook: the answer in words, its inputs, and every table on a sheet of its own.",
            Media::Pdf => "A report: verdict, warnings, pictures, numbers, inputs, tables, equations (PDF/A-2a).",
        };
        let content =
            if matches!(media, Media::Xlsx | Media::Pdf) { parts::file_of(text) } else { parts::text_of(text) };
        response = response.content(media.essence(), content);
    }
    response
}

/// What every answer has in common.
fn envelope(meta: &Meta, result: &str) -> Object {
    let text = |text: &str| ObjectBuilder::new().schema_type(SchemaType::new(Type::String)).description(Some(text));
    let list = |of: &str, text: &str| ArrayBuilder::new().items(Ref::from_schema_name(of)).description(Some(text));
    let anything = |text: &str| {
        ObjectBuilder::new().additional_properties(Some(AdditionalProperties::FreeForm(true))).description(Some(text))
    };
    let effects = ArrayBuilder::new()
        .items(anything("An effect with its `kind` and parameters."))
        .description(Some("Every effect that acted."));
    let version = ObjectBuilder::new()
        .schema_type(SchemaType::new(Type::Integer))
        .minimum(Some(0))
        .description(Some("Version of the calculator's physics."))
        .examples([json!(meta.version)]);
    ObjectBuilder::new()
        .property("calculator", text("Which calculator answered.").enum_values(Some([meta.id])))
        .property("version", version)
        .property("engine", text("Version of the engine.").examples([json!(env!("CARGO_PKG_VERSION"))]))
        .property("key", parts::key())
        .property(
            "input",
            anything("The job with every default filled in; measured tables in it as their row count and hash."),
        )
        .property("model", model())
        .property("resources", resources())
        .property(
            "origins",
            list(
                "NumberOrigin",
                "Where each number comes from that a record had a say in; absent where the job named none.",
            ),
        )
        .property("effects", effects)
        .property("result", Ref::from_schema_name(result))
        .property("explanation", list("Remark", "What dominates, what binds, what would help: most important first."))
        .property("warnings", list("Notice", "Where an input leaves a formula's range of validity, and the like."))
        .property("basis", list("Basis", "The equations that acted, with their sources."))
        .property(
            "figures",
            ArrayBuilder::new()
                .items(anything("A figure: frame, axes and panels with their items, each with its `text`."))
                .description(Some("What there is to draw, with `include=figures`; absent otherwise.")),
        )
        .required("calculator")
        .required("version")
        .required("engine")
        .required("key")
        .required("input")
        .required("model")
        .required("effects")
        .required("result")
        .required("explanation")
        .required("warnings")
        .required("basis")
        .description(Some(format!("An answer of {}.", meta.id)))
        .build()
}

/// The records that a job named.
fn resources() -> Object {
    ObjectBuilder::new()
        .additional_properties(Some(Ref::from_schema_name("RecordOrigin")))
        .description(Some(
            "The machine, tool and material that the job named, each as it was when the job was accepted; absent where it named none.",
        ))
        .build()
}

/// The stored model that took part in an answer.
fn model() -> Object {
    let text = |text: &str| ObjectBuilder::new().schema_type(SchemaType::new(Type::String)).description(Some(text));
    let whole = |least: u32, text: &str| {
        ObjectBuilder::new().schema_type(SchemaType::new(Type::Integer)).minimum(Some(least)).description(Some(text))
    };
    ObjectBuilder::new()
        .schema_type(SchemaType::from_iter([Type::Object, Type::Null]))
        .property("name", text("Its name."))
        .property("revision", whole(1, "Its revision, which never changes."))
        .property("sha256", text("Hash of its content."))
        .property("effects", whole(0, "So many of the effects, the last ones, are the model's."))
        .required("name")
        .required("revision")
        .required("sha256")
        .required("effects")
        .description(Some("The stored model that took part; null where none was asked for."))
        .build()
}
