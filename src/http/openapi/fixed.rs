//! The operations that do not depend on which calculators there are.

use serde_json::json;
use utoipa::openapi::path::{HttpMethod, OperationBuilder, Parameter, ParameterIn, PathItem};
use utoipa::openapi::schema::{ObjectBuilder, SchemaType, Type};
use utoipa::openapi::{Content, Object, RefOr, Required, Schema};

use super::parts;
use crate::http::negotiate::Media;
use crate::http::query::DEFAULT_ITEMS;
use crate::http::{calculators, codes, health, pages, parts as result_parts, provenance, results};
use crate::registry::Registry;

/// Address and operations, in the order of the document.
pub(super) fn paths(registry: &Registry) -> Vec<(&'static str, PathItem)> {
    let get = |operation: OperationBuilder| PathItem::new(HttpMethod::Get, operation);
    vec![
        ("/v1/calculators", get(list_calculators())),
        ("/v1/calculators/{id}", get(describe_calculator(registry))),
        ("/v1/results", get(list_results(registry))),
        ("/v1/results/{key}", get(read_result())),
        ("/v1/results/{key}/figures", get(read_figures())),
        ("/v1/results/{key}/tables", get(read_tables())),
        ("/v1/results/{key}/job", get(read_result_job())),
        ("/v1/results/{key}/job_at", get(read_result_job_at())),
        ("/v1/results/{key}/provenance", get(read_provenance())),
        ("/", get(landing())),
        ("/docs", get(docs())),
        ("/openapi.json", get(openapi())),
        ("/problems/{code}", get(problem())),
        ("/health/live", get(live())),
        ("/health/ready", get(ready())),
        ("/metrics", get(metrics())),
    ]
}

/// Schemas of what they answer.
pub(super) fn schemas() -> Vec<(String, RefOr<Schema>)> {
    [
        super::schemas_of::<calculators::CalculatorList>(),
        super::schemas_of::<calculators::CalculatorDescription>(),
        super::schemas_of::<results::ResultList>(),
        super::schemas_of::<result_parts::FigureList>(),
        super::schemas_of::<result_parts::TableList>(),
        super::schemas_of::<result_parts::JobFile>(),
        super::schemas_of::<provenance::Provenance>(),
        super::schemas_of::<pages::Landing>(),
        super::schemas_of::<pages::ProblemPage>(),
        super::schemas_of::<health::Health>(),
    ]
    .concat()
}

fn operation(tag: &str, id: &str, summary: &str, description: &str) -> OperationBuilder {
    OperationBuilder::new().tag(tag).operation_id(Some(id)).summary(Some(summary)).description(Some(description))
}

fn json_of(schema: &str, text: &str) -> utoipa::openapi::response::ResponseBuilder {
    parts::success(text, "application/json", parts::json_of(schema))
}

fn list_calculators() -> OperationBuilder {
    let operation = operation(
        "library",
        "list_calculators",
        "What can be asked?",
        "Every calculator and evaluation with the question that it answers and its examples.",
    );
    let operation = operation.response("200", parts::tagged(json_of("CalculatorList", "The calculators.")));
    parts::guarded(parts::conditional(operation), &[])
}

fn describe_calculator(registry: &Registry) -> OperationBuilder {
    let ids: Vec<String> = registry.entries().iter().map(|entry| entry.meta().id.to_owned()).collect();
    let first = ids.first().cloned().unwrap_or_default();
    let name = if ids.is_empty() { parts::string() } else { parts::one_of(ids) };
    let operation = operation(
        "library",
        "describe_calculator",
        "What does a calculator need, and what does it answer?",
        "The schemas of job and result with labels, units and ranges, and example jobs ready to be posted.",
    )
    .parameter(parts::path_parameter("id", "Name of the calculator.", name, json!(first)))
    .response("200", parts::tagged(json_of("CalculatorDescription", "The calculator.")));
    parts::guarded(parts::conditional(operation), &[404])
}

fn list_results(registry: &Registry) -> OperationBuilder {
    let query = |name, text: &str, schema| parts::parameter(name, ParameterIn::Query, text, schema).build();
    let ids: Vec<String> = registry.entries().iter().map(|entry| entry.meta().id.to_owned()).collect();
    let calculator = if ids.is_empty() { parts::string() } else { parts::one_of(ids) };
    let operation = operation(
        "results",
        "list_results",
        "Which answers are kept?",
        "The kept answers, newest first, by pages: follow `next` until it is null.",
    )
    .parameter(parts::limit("Most results of one page.", DEFAULT_ITEMS))
    .parameter(query("calculator", "Only those of this calculator.", calculator))
    .parameter(query(
        "record",
        "Only those whose jobs got this machine, tool or material: `machines/lathe-3`, or `machines/lathe-3@4` of one revision.",
        record(),
    ))
    .parameter(query("after", "Where the page before ended: taken from its `next`.", cursor()))
    .response("200", json_of("ResultList", "A page of results."));
    parts::guarded(operation, &[400, 404])
}

fn record() -> utoipa::openapi::Object {
    use utoipa::openapi::schema::{ObjectBuilder, SchemaType, Type};
    ObjectBuilder::new()
        .schema_type(SchemaType::new(Type::String))
        .pattern(Some("^(machines|tools|materials)/[a-z0-9][a-z0-9_-]{0,63}(@[1-9][0-9]{0,8})?$"))
        .build()
}

fn cursor() -> utoipa::openapi::Object {
    use utoipa::openapi::schema::{ObjectBuilder, SchemaType, Type};
    ObjectBuilder::new()
        .schema_type(SchemaType::new(Type::String))
        .pattern(Some("^(0|[1-9][0-9]{0,14})-[0-9a-f]{64}$"))
        .build()
}

fn read_result() -> OperationBuilder {
    let query = |name, text: &str| parts::parameter(name, ParameterIn::Query, text, parts::string()).build();
    let mut response = parts::tagged(parts::success(
        "The answer, as its calculator gave it.",
        Media::Json.essence(),
        Content::new(Some(
            utoipa::openapi::schema::ObjectBuilder::new()
                .description(Some("The answer: `calculator` says which one made it, and by which schema.")),
        )),
    ))
    .header("Content-Language", parts::text_header("Language of the sentences: `en` or `ru`.", "en"))
    .header("Precut-Cache", parts::text_header("Always `hit`: nothing is computed.", "hit"));
    response = parts::other_forms(response);
    let key = json!("b3:0000000000000000000000000000000000000000000000000000000000000000");
    let operation = operation(
        "results",
        "read_result",
        "What was that answer?",
        "A kept answer in any of its forms, read without computing. Its address is the `Content-Location` of the `POST`.",
    )
    .parameter(parts::path_parameter("key", "Address of the answer.", parts::key(), key))
    .parameter(query("table", "Which table, with `Accept: text/csv`; the first if absent."))
    .parameter(query("figure", "Which figure, with `Accept: image/svg+xml`; the first if absent."))
    .parameter(parts::include())
    .response("200", response);
    parts::guarded(parts::conditional(operation), &[400, 404, 406, 410, 422])
}

/// An operation that reads a part of a kept answer.
fn part_of_result(id: &str, summary: &str, description: &str, schema: &str) -> OperationBuilder {
    let key = json!("b3:0000000000000000000000000000000000000000000000000000000000000000");
    let operation = operation("results", id, summary, description)
        .parameter(parts::path_parameter("key", "Address of the answer.", parts::key(), key))
        .response("200", parts::tagged(json_of(schema, "The part of the answer.")));
    parts::guarded(parts::conditional(operation), &[400, 404, 410, 422])
}

fn read_figures() -> OperationBuilder {
    part_of_result(
        "read_result_figures",
        "What is there to draw?",
        "The figures of a kept answer as data: frame, axes, curves and symbols, with their words.",
        "FigureList",
    )
}

fn read_tables() -> OperationBuilder {
    part_of_result(
        "read_result_tables",
        "What is there to tabulate?",
        "The tables of a kept answer by columns, with their words.",
        "TableList",
    )
}

fn read_result_job() -> OperationBuilder {
    part_of_result(
        "read_result_job",
        "Which job made that answer?",
        "The job of a kept answer with every default filled in and its measured tables as rows: to be changed and sent again.",
        "JobFile",
    )
}

fn read_result_job_at() -> OperationBuilder {
    part_of_result(
        "read_result_job_at",
        "Which job stands at another place of a picture?",
        "The job for which another place of a setting in a picture of a kept answer stands; where none stands there, the job as \
         it is.",
        "JobFile",
    )
    .parameter(query("figure", "Figure in which a setting is put elsewhere.", parts::string()))
    .parameter(query("setting", "Name of the item of kind `setting` that is put elsewhere.", parts::string()))
    .parameter(query("x", "Its abscissa there, in the unit of the axis.", number()))
    .parameter(query("y", "Its ordinate there, in the unit of the axis.", number()))
}

fn query(name: &str, text: &str, schema: Object) -> Parameter {
    parts::parameter(name, ParameterIn::Query, text, schema).required(Required::True).build()
}

fn number() -> Object {
    ObjectBuilder::new().schema_type(SchemaType::new(Type::Number)).build()
}

fn read_provenance() -> OperationBuilder {
    part_of_result(
        "read_result_provenance",
        "Where does that answer come from?",
        "Traces an answer, as from the line `result b3:...` of a program, to the versions that made it, the model that took \
         part, and the jobs that came to it with the owners of their keys. Jobs and owners that who asks may not see are \
         not told.",
        "Provenance",
    )
}

fn landing() -> OperationBuilder {
    let response = json_of("Landing", "Where to go.").content("text/html", parts::text_of("The same as a page."));
    let operation = operation(
        "service",
        "landing",
        "What is this?",
        "Where to go from here, as JSON or as a page (`Accept: text/html`).",
    )
    .response("200", parts::tagged(response));
    parts::open(parts::conditional(operation), &[])
}

fn docs() -> OperationBuilder {
    let response = parts::success("The page.", "text/html", parts::text_of("A page that needs nothing from outside."));
    let operation = operation("service", "docs", "Can I try it in a browser?", "This contract as an interactive page.")
        .response("200", parts::tagged(response));
    parts::open(parts::conditional(operation), &[])
}

fn openapi() -> OperationBuilder {
    let schema = utoipa::openapi::schema::ObjectBuilder::new().description(Some("An OpenAPI 3.1 document."));
    let response = parts::success("The contract.", "application/json", Content::new(Some(schema)));
    let operation = operation("service", "openapi", "What is the contract?", "This document.")
        .response("200", parts::tagged(response));
    parts::open(parts::conditional(operation), &[])
}

fn problem() -> OperationBuilder {
    let known = parts::one_of(codes::CODES.iter().map(|&(code, _)| code.to_owned()));
    let response =
        json_of("ProblemPage", "What the problem means.").content("text/html", parts::text_of("The same as a page."));
    let operation = operation(
        "service",
        "explain_problem",
        "What does that problem mean?",
        "What a problem means and what to do. Codes by which a calculator says that a job has no answer are known, too.",
    )
    .parameter(parts::path_parameter("code", "Code of the problem.", known, json!("invalid_job")))
    .response("200", parts::tagged(response));
    parts::open(parts::conditional(operation), &[404])
}

fn live() -> OperationBuilder {
    let operation = operation("service", "live", "Does the process live?", "For restarting it if it does not.")
        .response("200", json_of("Health", "It does."));
    parts::open(operation, &[])
}

fn ready() -> OperationBuilder {
    let operation = operation(
        "service",
        "ready",
        "Does the service take work?",
        "For sending it none if not: its store does not answer, or it is shutting down.",
    )
    .response("200", json_of("Health", "It does."));
    parts::open(operation, &[])
}

fn metrics() -> OperationBuilder {
    let response = parts::success("The figures.", "text/plain", parts::text_of("Text format of Prometheus."));
    let operation = operation("service", "metrics", "How is the service doing?", "Figures for Prometheus.")
        .response("200", response);
    parts::guarded(operation, &[])
}
