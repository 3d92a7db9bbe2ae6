//! The operations of processes under watch.

mod schemas;

use serde_json::{Value, json};
use utoipa::openapi::content::ContentBuilder;
use utoipa::openapi::path::{HttpMethod, OperationBuilder, Parameter, ParameterIn, PathItem};
use utoipa::openapi::request_body::{RequestBody, RequestBodyBuilder};
use utoipa::openapi::response::ResponseBuilder;
use utoipa::openapi::schema::{Object, ObjectBuilder, SchemaType, Type};
use utoipa::openapi::{Ref, RefOr, Required};

use super::{jobs, parts};
use crate::engine::WhichPath;
use crate::http::processes;
use crate::http::query::DEFAULT_ITEMS;
use crate::registry::Registry;
pub(super) use schemas::schemas;

const NAME: &str = "^[a-z0-9][a-z0-9_-]{0,63}$";
const PART: &str = "^[A-Za-z0-9][A-Za-z0-9._-]{0,99}$";
const EXAMPLE: &str = "shaft-560";
/// What is posted to whom a process names.
pub(super) const SAID: &str = "process_said";
/// The operation that takes the address for it, and where it stands there.
pub(super) const SAID_TO: (&str, &str) = ("store_process", "{$request.body#/callback/url}");

/// Address and operations.
pub(super) fn paths(registry: &Registry) -> Vec<(String, PathItem)> {
    let one = "/v1/processes/{name}";
    let under = |part: &str| format!("{one}/{part}");
    let get = |operation: OperationBuilder| PathItem::new(HttpMethod::Get, operation);
    let mut process = get(read());
    process.put = Some(store(registry).build());
    process.delete = Some(delete().build());
    let mut all_parts = get(list_parts());
    all_parts.post = Some(import().build());
    let mut part = get(read_part());
    part.put = Some(put_part(registry).build());
    part.delete = Some(withdraw().build());
    vec![
        ("/v1/processes".to_owned(), get(list())),
        (one.to_owned(), process),
        (under("parts"), all_parts),
        (under("parts/{part}"), part),
        (under("state"), get(state())),
        (under("figures"), get(figures())),
        (under("history"), get(history())),
        (under("changes"), get(changes())),
        (under("changes/{id}"), PathItem::new(HttpMethod::Post, decide())),
        (under("next"), get(next(registry))),
        (under("gain"), get(gain())),
        (under("events"), get(events())),
        (under("export"), get(export())),
    ]
}

fn text(pattern: &str) -> Object {
    ObjectBuilder::new().schema_type(SchemaType::new(Type::String)).pattern(Some(pattern)).build()
}

fn name() -> Parameter {
    parts::path_parameter("name", "Name of the process.", text(NAME), json!(EXAMPLE))
}

fn part() -> Parameter {
    parts::path_parameter("part", "Name of the part.", text(PART), json!("2026-02-03-0039"))
}

fn query(name: &str, about: &str, schema: Object) -> Parameter {
    parts::parameter(name, ParameterIn::Query, about, schema).build()
}

fn limit() -> Parameter {
    parts::limit("Most of one page.", DEFAULT_ITEMS)
}

fn header(name: &str, about: &str) -> Parameter {
    parts::parameter(name, ParameterIn::Header, about, parts::string()).build()
}

fn if_match() -> Parameter {
    header("If-Match", "The ETag of what is changed: needed where something else is there.")
}

fn language() -> Parameter {
    header(
        "Accept-Language",
        "Languages of sentences by preference: `en` (English) or `ru` (Russian); English where none fits.",
    )
}

fn operation(id: &str, summary: &str, description: &str) -> OperationBuilder {
    OperationBuilder::new()
        .tag("processes")
        .operation_id(Some(id))
        .summary(Some(summary))
        .description(Some(description))
}

fn document(about: &str, schema: &str) -> ResponseBuilder {
    parts::success(about, "application/json", parts::json_of(schema))
}

fn changed(about: &str, schema: &str) -> ResponseBuilder {
    document(about, schema).header("ETag", parts::etag())
}

fn number() -> Object {
    parts::integer(0, processes::MOST_NUMBER, 0)
}

fn body(about: &str, schema: &str, example: Option<Value>) -> RequestBody {
    let content = ContentBuilder::new().schema(Some(Ref::from_schema_name(schema))).example(example).build();
    RequestBodyBuilder::new()
        .description(Some(about))
        .required(Some(Required::True))
        .content("application/json", content)
        .build()
}

fn list() -> OperationBuilder {
    let operation = operation(
        "list_processes",
        "Which processes are watched?",
        "By name and by pages: follow `next` until it is null.",
    )
    .parameter(limit())
    .parameter(query("after", "Where the page before ended: taken from its `next`.", parts::string()))
    .parameter(language())
    .response("200", document("A page.", "ProcessList"));
    parts::guarded(operation, &[400, 507])
}

fn read() -> OperationBuilder {
    let operation = operation("read_process", "How is a process?", "Its document and what was said last.")
        .parameter(name())
        .response("200", parts::tagged(document("The process.", "Process")));
    parts::guarded(parts::conditional(operation), &[404, 507])
}

/// The example job of the first calculator whose process is watched, as a process.
fn example(registry: &Registry) -> Option<Value> {
    let entry = registry.entries().iter().find(|entry| entry.observed().is_some())?;
    let job: Value = serde_json::from_str(entry.meta().examples.first()?.job).ok()?;
    let quantity = entry.observed()?.document.input_document()["properties"]["quantity"]["enum"][0].clone();
    Some(json!({
        "calculator": entry.meta().id, "part_types": { "A": { "job": job } }, "quantity": quantity,
        "options": { "false_alarm_every_parts": 500, "path": "advise" },
    }))
}

fn store(registry: &Registry) -> OperationBuilder {
    let operation = operation(
        "store_process",
        "May a process be watched?",
        "Declares a process, or declares it otherwise: then all parts are judged anew, and nothing changes of what was said when \
         they came. A record that was exported goes in whole, under a new name.",
    )
    .parameter(name())
    .parameter(if_match())
    .parameter(header("If-None-Match", "`*`: only if nothing has the name."))
    .parameter(language())
    .request_body(Some(body("The process, or its exported record.", "ProcessDocument", example(registry))))
    .response("200", changed("It is declared otherwise, or was so already.", "Process"))
    .response("201", changed("It is new.", "Process").header("Location", parts::text_header("Its address.", "/v1/processes/shaft-560")));
    parts::guarded(operation, &[400, 408, 409, 412, 413, 415, 422, 428, 507])
}

/// What the service posts to whom a process names.
pub(super) fn callback() -> PathItem {
    let said = operation(
        SAID,
        "What is said of that process?",
        "Posted to the address that a process names as `callback.url`, when what it wants to hear is new, signed as Standard \
         Webhooks has it. It is delivered at least once; `webhook-id` is the same each time. A history that comes at once is not told.",
    );
    jobs::posted(said, "ProcessEvent", "What is said. The same at every try.")
}

fn delete() -> OperationBuilder {
    let operation = operation("delete_process", "How does a process go?", "Deletes it with its whole record.")
        .parameter(name())
        .parameter(if_match())
        .response("204", ResponseBuilder::new().description("It is gone.").header("x-request-id", parts::request_id()));
    parts::guarded(operation, &[404, 412, 428, 507])
}

fn list_parts() -> OperationBuilder {
    let states = ["learning", "in_control", "warning", "changed"].map(ToOwned::to_owned);
    let operation = operation(
        "list_process_parts",
        "Which parts were measured?",
        "Parts that are not withdrawn, by number: what was sent, what was said then, what is said now.",
    )
    .parameter(name())
    .parameter(query("from", "Least number.", number()))
    .parameter(query("to", "Largest number.", number()))
    .parameter(query("state", "Only parts of which this is said now; pages may then be short.", parts::one_of(states)))
    .parameter(limit())
    .parameter(language())
    .response("200", document("A page.", "ProcessParts"));
    parts::guarded(operation, &[400, 404, 507])
}

fn import() -> OperationBuilder {
    let mut body = body("All parts.", "ProcessImport", None);
    body.content.insert(
        "text/csv".to_owned(),
        RefOr::T(parts::text_of(
            "A row for each measured place: `part`, `number`, `part_type`, conditions, and the columns of measured rows.",
        )),
    );
    let operation = operation(
        "import_process_parts",
        "What would have been said when?",
        "Takes a whole history, all of it or nothing, and judges it part by part. Parts that are there as they are sent stay.",
    )
    .parameter(name())
    .parameter(language())
    .request_body(Some(body))
    .response("200", document("What would have been said.", "ProcessImported"));
    parts::guarded(operation, &[400, 404, 408, 409, 413, 415, 422, 428, 507])
}

fn read_part() -> OperationBuilder {
    let operation = operation("read_process_part", "What was said of a part?", "With all that happened to it.")
        .parameter(name())
        .parameter(part())
        .parameter(language())
        .response("200", changed("The part.", "ProcessPart"));
    parts::guarded(operation, &[404, 507])
}

fn put_part(registry: &Registry) -> OperationBuilder {
    let quantity = registry.entries().iter().find_map(|entry| entry.observed());
    let quantity =
        quantity.map(|observed| observed.document.input_document()["properties"]["quantity"]["enum"][0].clone());
    let quantity = quantity.as_ref().and_then(Value::as_str).unwrap_or("value").to_owned();
    let example = json!({
        "number": 39, "part_type": "A",
        "measurements": [{ "z_mm": 16.8, quantity.clone(): 1.9 }, { "z_mm": 64.7, quantity.clone(): 2.6 },
            { "z_mm": 112.5, quantity.clone(): 3.1 }, { "z_mm": 160.4, quantity: 2.2 }],
    });
    let mut body = body("The part; its table may come as a file part.", "ProcessPartBody", Some(example));
    body.content.insert(
        "text/csv".to_owned(),
        RefOr::T(parts::text_of("The measured rows alone; number, type and conditions stand in the query.")),
    );
    let operation = operation(
        "put_process_part",
        "Is the process still as its model says, with this part?",
        "Takes a part, or corrects it. The same part again changes nothing and is answered as it was. A part may come late: then \
         those after it are judged anew.",
    )
    .parameter(name())
    .parameter(part())
    .parameter(if_match())
    .parameter(language())
    .request_body(Some(body))
    .response("200", changed("It was there, or is corrected.", "ProcessSaid"))
    .response("201", changed("It is taken.", "ProcessSaid").header("Location", parts::text_header("Its address.", "/v1/processes/shaft-560/parts/2026-02-03-0039")));
    parts::guarded(operation, &[400, 404, 408, 409, 412, 413, 415, 422, 428, 507])
}

fn withdraw() -> OperationBuilder {
    let operation = operation(
        "withdraw_process_part",
        "What if a part was none?",
        "Withdraws it: those after it are judged anew. It stays on record.",
    )
    .parameter(name())
    .parameter(part())
    .parameter(if_match())
    .parameter(language())
    .response("200", changed("What is said without it.", "ProcessSaid"));
    parts::guarded(operation, &[404, 412, 428, 507])
}

fn state() -> OperationBuilder {
    let tables = processes::TABLES.iter().map(|&table| table.to_owned());
    let operation = operation(
        "read_process_state",
        "What is said of a process?",
        "What was said last; as CSV a line for each part, change, cause of the model, or part with what paths brought by then.",
    )
    .parameter(name())
    .parameter(query("table", "As CSV: which table.", parts::one_of(tables)))
    .parameter(query("figure", "As SVG: which figure.", parts::one_of(processes::FIGURES.iter().map(|&figure| figure.to_owned()))))
    .response(
        "200",
        parts::tagged(document("What is said.", "ProcessState"))
            .content("text/csv", parts::text_of("One of its tables."))
            .content("image/svg+xml", parts::text_of("One of its figures.")),
    );
    parts::guarded(parts::conditional(operation), &[400, 404, 406, 507])
}

fn figures() -> OperationBuilder {
    let operation = operation(
        "read_process_figures",
        "What does a process look like?",
        "Its control chart, what its paths brought, and what is expected of the next part, as data that a page draws.",
    )
    .parameter(name())
    .parameter(language())
    .response("200", document("The figures.", "FigureList"));
    parts::guarded(operation, &[404, 507])
}

fn history() -> OperationBuilder {
    let operation = operation("read_process_history", "What happened to a process?", "Its record, in order, by pages.")
        .parameter(name())
        .parameter(query("after", "Number of the last entry that is known.", number()))
        .parameter(limit())
        .parameter(language())
        .response("200", document("A page.", "ProcessHistory"));
    parts::guarded(operation, &[400, 404, 507])
}

fn changes() -> OperationBuilder {
    let operation = operation("list_process_changes", "What has changed?", "The last changes, each with its causes.")
        .parameter(name())
        .parameter(language())
        .response("200", document("The changes.", "ProcessChanges"));
    parts::guarded(operation, &[404, 507])
}

fn decide() -> OperationBuilder {
    let id = parts::path_parameter("id", "Id of the change.", text("^c[1-9][0-9]{0,8}$"), json!("c1"));
    let operation = operation(
        "decide_process_change",
        "Is a change one?",
        "What a person says of a change: confirmed it joins the model at once; rejected it belongs to the process and causes no \
         alarm any more; named it is one of its causes alone.",
    )
    .parameter(name())
    .parameter(id)
    .parameter(language())
    .request_body(Some(body("The decision.", "ProcessDecision", Some(json!({ "decision": "confirm" })))))
    .response("200", changed("What is said now.", "ProcessSaid"));
    parts::guarded(operation, &[400, 404, 408, 413, 415, 422, 507])
}

fn next(registry: &Registry) -> OperationBuilder {
    let path = parts::one_of(WhichPath::ALL.iter().map(|path| path.word().to_owned()));
    let mut operation = operation(
        "next_process_part",
        "What is to be cut next?",
        "The next part's job, which is the calculator's own, and its answer. Who takes its program along cuts on its path: the \
         header `Precut-Path` has the revision that the part then states.",
    )
    .parameter(name())
    .parameter(query("part_type", "Its type; that of the last part.", parts::string()))
    .parameter(query("path", "The path as it is, or a new one; by `options.path` and the action.", path))
    .parameter(query("table", "With `text/csv`: which table of the answer.", parts::string()))
    .parameter(query("figure", "With `image/svg+xml`: which figure of the answer.", parts::string()))
    .parameter(language());
    let observed = registry.entries().iter().filter_map(|entry| entry.observed());
    for condition in observed.flat_map(|observed| observed.conditions) {
        let schema = ObjectBuilder::new()
            .schema_type(SchemaType::new(Type::Number))
            .minimum(Some(0.0))
            .maximum(Some(processes::MOST_NUMBER))
            .build();
        operation = operation.parameter(query(condition, "The same of the next part.", schema));
    }
    let operation = operation.response(
        "200",
        parts::other_forms(document("The next part.", "ProcessNext")).header(
            "Precut-Path",
            parts::header_of(parts::integer(1, 1_000_000, 1), "With a program: the revision of its path."),
        ),
    );
    parts::guarded(operation, &[400, 404, 406, 409, 422, 507])
}

fn gain() -> OperationBuilder {
    let operation = operation(
        "read_process_gain",
        "What did it bring?",
        "The account of the gain on parts that were cut with a path of the process.",
    )
    .parameter(name())
    .parameter(language())
    .response("200", document("The account.", "ProcessGain"));
    parts::guarded(operation, &[404, 507])
}

fn events() -> OperationBuilder {
    let stream = parts::events(
        "Each entry of the record, and before it what is new with it.",
        "`document`, `part`, `withdrawn`, `decision` or `path`; `warning`, `change`, `accepted`, `odd_part` or `replayed`.",
        "JSON: `sequence`, `kind`, `part`, `number` and `said` of the entry.",
    );
    let operation = operation(
        "follow_process",
        "What happens to a process?",
        "Its record as server-sent events, as it grows. `Last-Event-ID` resumes.",
    )
    .parameter(name())
    .parameter(header("Last-Event-ID", "Number of the last entry that is known; without it only what is new is told."))
    .parameter(language())
    .response("200", parts::success("Events.", "text/event-stream", stream));
    parts::guarded(operation, &[404, 507])
}

fn export() -> OperationBuilder {
    let operation = operation(
        "export_process",
        "May the record be kept elsewhere?",
        "All that happened, with a hash. `PUT` takes it again.",
    )
    .parameter(name())
    .response("200", document("The record.", "ProcessRecord"));
    parts::guarded(operation, &[404, 507])
}
