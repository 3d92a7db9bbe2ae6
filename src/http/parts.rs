//! The parts of a kept result as data with words: its figures to be drawn, its tables to be shown, the job that made
//! it to be changed and sent again. What the workbench shows comes from here.

use axum::Extension;
use axum::extract::{Path, State};
use axum::http::header::CACHE_CONTROL;
use axum::http::{HeaderMap, HeaderValue, Uri};
use axum::response::Response;
use precut_calc::calculator::{Cells, Figure, Place, Table};
use serde::Serialize;
use serde_json::{Value, json};
use utoipa::ToSchema;

use super::auth::Caller;
use super::document::Document;
use super::problem::Problem;
use super::query::Query;
use super::{App, answer, negotiate, results};
use crate::engine::Stored;
use crate::text::{Language, Texts};

/// The figures of an answer, as data.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct FigureList {
    /// The figures, the main one first: frame, axes and panels with their items, each with its `text` in the
    /// language asked for.
    #[schema(value_type = Vec<Object>)]
    items: Vec<Value>,
}

/// The tables of an answer, by columns.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct TableList {
    /// The tables, the main one first.
    items: Vec<ResultTable>,
}

/// A table of an answer.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct ResultTable {
    /// Name for `?table=`.
    #[schema(example = "stations")]
    id: &'static str,
    /// Left to right.
    columns: Vec<ResultColumn>,
}

/// A column of a table.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct ResultColumn {
    /// Name of the column, without its unit.
    #[schema(example = "diameter_error")]
    name: String,
    /// The name in the language asked for.
    #[schema(example = "diameter error")]
    text: String,
    /// Unit as in the contract, `1` for numbers without, empty for words.
    #[schema(example = "um")]
    unit: &'static str,
    /// The rows: numbers, words, or null where there is none.
    #[schema(value_type = Vec<Value>)]
    cells: Vec<Value>,
}

/// The job of an answer, or one that is still computed.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct JobFile {
    /// Whose job it is.
    #[schema(example = "deflection-compensation")]
    pub(super) calculator: String,
    /// The job with every default filled in and its measured tables as rows; sent again it gives the same answer.
    #[schema(value_type = Object)]
    pub(super) job: Value,
}

/// `GET /v1/results/{key}/figures`
pub(super) async fn figures(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(name): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let language = negotiate::language(&headers);
    let document = made((&app, &caller), &name, move |stored| {
        let items = stored.figures()?.iter().map(|figure| worded(figure, language)).collect();
        Ok(Document::json(&FigureList { items }, Some(language)))
    });
    Ok(private(document.await?.respond(&headers)))
}

/// `GET /v1/results/{key}/tables`
pub(super) async fn tables(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(name): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let language = negotiate::language(&headers);
    let document = made((&app, &caller), &name, move |stored| {
        let items = stored.tables_in(language)?.into_iter().map(|table| shown(table, language)).collect();
        Ok(Document::json(&TableList { items }, Some(language)))
    });
    Ok(private(document.await?.respond(&headers)))
}

/// Another place of a picture, of whose job is asked.
struct Elsewhere {
    figure: String,
    setting: String,
    x: f64,
    y: f64,
}

impl Elsewhere {
    const KNOWN: &[&str] = &["figure", "setting", "x", "y"];
    const ANY: std::ops::RangeInclusive<f64> = f64::MIN..=f64::MAX;

    fn of(uri: &Uri) -> Result<Self, Problem> {
        let mut query = Query::of(uri, Self::KNOWN)?;
        Ok(Self {
            figure: query.needed("figure")?,
            setting: query.needed("setting")?,
            x: query.needed_number("x", &Self::ANY)?,
            y: query.needed_number("y", &Self::ANY)?,
        })
    }

    fn place(&self) -> Place<'_> {
        Place { figure: &self.figure, setting: &self.setting, x: self.x, y: self.y }
    }
}

/// `GET /v1/results/{key}/job`
pub(super) async fn job(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(name): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let document = made((&app, &caller), &name, |stored| {
        let job = serde_json::from_slice(&stored.job()).map_err(|_| Problem::internal())?;
        Ok(job_file(stored, job))
    });
    Ok(private(document.await?.respond(&headers)))
}

/// `GET /v1/results/{key}/job_at`
pub(super) async fn job_at(
    State(app): State<App>,
    Extension(caller): Extension<Caller>,
    Path(name): Path<String>,
    uri: Uri,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let elsewhere = Elsewhere::of(&uri)?;
    let document = made((&app, &caller), &name, move |stored| Ok(job_file(stored, stored.job_at(&elsewhere.place())?)));
    Ok(private(document.await?.respond(&headers)))
}

fn job_file(stored: &Stored, job: Value) -> Document {
    Document::json(&JobFile { calculator: stored.entry().meta().id.to_owned(), job }, None)
}

/// Makes a document of a kept result. Reading an answer back is work: not on the threads that move bytes.
async fn made(
    (app, caller): (&App, &Caller),
    name: &str,
    make: impl FnOnce(&Stored) -> Result<Document, Problem> + Send + 'static,
) -> Result<Document, Problem> {
    let stored = results::named(app, caller, name).await?;
    tokio::task::spawn_blocking(move || make(&stored)).await.map_err(|_| Problem::internal())?
}

pub(super) fn private(mut response: Response) -> Response {
    response.headers_mut().insert(CACHE_CONTROL, HeaderValue::from_static("private, no-cache"));
    response
}

/// A figure as data: what it is made of, and its words beside its codes.
pub(super) fn worded(figure: &Figure, language: Language) -> Value {
    let mut value = json!(figure);
    if let Some(title) = value.get_mut("title").and_then(Value::as_object_mut) {
        title.insert("text".to_owned(), Texts::shared().message(language, "figure", &figure.title).into());
    }
    name_parts(&mut value, &|code| answer::label(figure, code, language));
    value
}

/// Puts the text beside every label of an axis and every name of an item.
fn name_parts(value: &mut Value, word: &dyn Fn(&str) -> String) {
    match value {
        Value::Object(map) => {
            for code in ["label", "name"] {
                if let Some(text) = map.get(code).and_then(Value::as_str).map(word) {
                    map.insert("text".to_owned(), text.into());
                }
            }
            for part in ["x", "y", "value", "panels", "items", "about"] {
                if let Some(part) = map.get_mut(part) {
                    name_parts(part, word);
                }
            }
        }
        // Series of numbers have no names.
        Value::Array(items) if items.first().is_some_and(Value::is_object) => {
            for item in items {
                name_parts(item, word);
            }
        }
        _ => {}
    }
}

fn shown(table: Table, language: Language) -> ResultTable {
    let texts = Texts::shared();
    let columns = table.columns.into_iter().map(|column| {
        let name = column.name.into_owned();
        let text = texts.column(language, &name, column.unit);
        let cells = match column.cells {
            Cells::Numbers(cells) => cells.into_iter().map(|cell| json!(cell)).collect(),
            Cells::Words(cells) => cells.into_iter().map(|cell| Value::String(cell.into_owned())).collect(),
        };
        ResultColumn { name, text, unit: column.unit, cells }
    });
    ResultTable { id: table.id, columns: columns.collect() }
}
