//! An answer in the form that the client asked for.

use std::fmt::Write as _;
use std::sync::Arc;

use axum::body::Body;
use axum::http::header::{
    CACHE_CONTROL, CONTENT_DISPOSITION, CONTENT_LANGUAGE, CONTENT_LOCATION, CONTENT_TYPE, ETAG, HeaderName,
    HeaderValue, VARY,
};
use axum::http::{HeaderMap, StatusCode, Uri};
use axum::response::Response;
use bytes::Bytes;
use precut_calc::calculator::{Dialect, Figure, Meta, ProgramEncoding, ProgramOrigin, Value, Values};
use serde::Deserialize;
use tokio::sync::Semaphore;

use super::negotiate::{self, Media};
use super::problem::Problem;
use super::query::Query;
use super::{CACHE_STATE, codes, parts, report};
use crate::engine::{CacheState, ENGINE_VERSION, Stored, Timings};
use crate::render;
use crate::text::{Glossary, Language, Texts, fingerprint, significant};

const SERVER_TIMING: HeaderName = HeaderName::from_static("server-timing");

/// So many workbooks and reports are made at once: each takes some ten megabytes while it is made. Who gave up waiting
/// holds the place until the one that was begun is done.
static PLACES: Semaphore = Semaphore::const_new(2);

/// Which form of an answer is asked for.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct View {
    media: Media,
    /// Of the table or figure; the first if `None`.
    part: Option<String>,
    /// What stands in the document besides.
    include: Option<Include>,
    language: Language,
}

/// What an answer as JSON may bring along.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Include {
    /// Its figures as data, as under `/v1/results/{key}/figures`.
    Figures,
}

impl Include {
    pub(super) const ALL: &[Self] = &[Self::Figures];

    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Figures => "figures",
        }
    }
}

/// Which table and figure of an answer are asked for, whichever of them its form then needs.
#[derive(Debug, Default)]
pub(super) struct Parts {
    table: Option<String>,
    figure: Option<String>,
    include: Option<Include>,
}

impl Parts {
    /// Its parameters.
    pub(super) const KNOWN: &[&str] = &["table", "figure", "include"];

    pub(super) fn of(query: &mut Query) -> Result<Self, Problem> {
        let include = query.one_of("include", Include::ALL, Include::word)?;
        Ok(Self { table: query.text("table"), figure: query.text("figure"), include })
    }
}

/// The forms in which a calculator's answers exist.
pub(super) fn offered(meta: &Meta) -> Vec<Media> {
    let mut offered = vec![Media::Json];
    offered.extend((!meta.tables.is_empty()).then_some(Media::Csv));
    offered.extend((!meta.figures.is_empty()).then_some(Media::Svg));
    offered.extend(meta.program.map(|_| Media::Gcode));
    offered.extend((meta.program == Some(ProgramOrigin::Brought)).then_some(Media::Diff));
    offered.extend([Media::Xlsx, Media::Pdf]);
    offered
}

impl View {
    /// What a request asks for; refused if there is no such thing.
    pub(super) fn of(uri: &Uri, headers: &HeaderMap, meta: &Meta, offered: &[Media]) -> Result<Self, Problem> {
        Self::of_parts(Parts::of(&mut Query::of(uri, Parts::KNOWN)?)?, headers, meta, offered)
    }

    /// The same of a query that was read already.
    pub(super) fn of_parts(parts: Parts, headers: &HeaderMap, meta: &Meta, offered: &[Media]) -> Result<Self, Problem> {
        let known = |code, part: &Option<String>, ids: &[&str]| match part {
            Some(part) if !ids.contains(&part.as_str()) => {
                Err(Problem::missing(code, part).with("available", ids.join(", ")))
            }
            _ => Ok(()),
        };
        known("unknown_table", &parts.table, meta.tables)?;
        known("unknown_figure", &parts.figure, meta.figures)?;
        let media = negotiate::media(headers, offered).ok_or_else(|| not_acceptable(offered))?;
        let part = match media {
            Media::Csv => parts.table,
            Media::Svg => parts.figure,
            Media::Json | Media::Gcode | Media::Diff | Media::Xlsx | Media::Pdf => None,
        };
        let include = parts.include.filter(|_| media == Media::Json);
        Ok(Self { media, part, include, language: negotiate::language(headers) })
    }

    /// The strong entity tag: everything that the bytes depend on.
    fn etag(&self, stored: &Stored) -> String {
        let mut tag = String::with_capacity(96);
        tag.push('"');
        tag.push_str(stored.key.to_string().trim_start_matches("b3:"));
        let part = self.part.as_deref().unwrap_or_default();
        let _ = write!(tag, "-{}-{part}-{}", self.media.short(), self.language.tag());
        if let Some(include) = self.include {
            let _ = write!(tag, "-{}", include.word());
        }
        // What is made when it is asked for changes with what makes it,
        if self.media != Media::Json || self.include.is_some() {
            let _ = write!(tag, "-{ENGINE_VERSION}");
        }
        // and what is put into words then, with the words.
        let is_worded = self.media == Media::Svg || self.media.is_heavy() || self.include.is_some();
        if is_worded || self.language != Language::default() {
            let _ = write!(tag, "-{}", fingerprint(self.language));
        }
        tag.push('"');
        tag
    }
}

/// The answer as a response: `304` if the client has it already.
pub(super) async fn respond(stored: Arc<Stored>, view: View, condition: &HeaderMap) -> Result<Response, Problem> {
    let etag = view.etag(&stored);
    let mut response = if negotiate::has_already(condition, &etag) {
        let mut response = Response::new(Body::empty());
        *response.status_mut() = StatusCode::NOT_MODIFIED;
        response
    } else {
        let (media, language) = (view.media, view.language);
        let made = if media == Media::Json && view.include.is_none() && language == Language::default() {
            Rendered::of(media, stored.body.clone())
        } else {
            let stored = stored.clone();
            let place = if media.is_heavy() { PLACES.acquire().await.ok() } else { None };
            // Reading an answer back, wording and drawing it is work: not on the threads that move bytes.
            let made = tokio::task::spawn_blocking(move || {
                let _place = place;
                rendered(&stored, &view)
            });
            made.await.map_err(|_| Problem::internal())??
        };
        let mut response = Response::new(Body::from(made.body));
        let headers = response.headers_mut();
        headers.insert(CONTENT_TYPE, HeaderValue::from_static(made.content_type));
        if let Some(file) = made.file {
            headers.insert(CONTENT_DISPOSITION, value(format!("attachment; filename=\"{file}\"")));
        }
        headers.insert(CONTENT_LANGUAGE, HeaderValue::from_static(language.tag()));
        response
    };
    let headers = response.headers_mut();
    headers.insert(ETAG, value(etag));
    headers.insert(CACHE_CONTROL, HeaderValue::from_static("private, no-cache"));
    headers.insert(VARY, HeaderValue::from_static("Accept, Accept-Language, Accept-Encoding"));
    Ok(response)
}

/// What a POST says of an answer besides: where it stays, and how it came about.
pub(super) fn describe(response: &mut Response, stored: &Stored, cache: CacheState, timings: &Timings) {
    let ms = |time: std::time::Duration| time.as_secs_f64() * 1e3;
    let headers = response.headers_mut();
    headers.insert(CONTENT_LOCATION, value(format!("/v1/results/{}", stored.key)));
    let timing = match cache {
        CacheState::Hit => format!("parse;dur={:.3}", ms(timings.parse)),
        CacheState::Miss => format!(
            "parse;dur={:.3}, queue;dur={:.3}, run;dur={:.3}",
            ms(timings.parse),
            ms(timings.queue),
            ms(timings.run)
        ),
    };
    headers.insert(SERVER_TIMING, value(timing));
    let state = match cache {
        CacheState::Hit => "hit",
        CacheState::Miss => "miss",
    };
    headers.insert(CACHE_STATE, HeaderValue::from_static(state));
}

fn value(text: String) -> HeaderValue {
    HeaderValue::from_maybe_shared(Bytes::from(text)).expect("keys, names and numbers are visible ASCII")
}

/// An answer in some form, as the command line writes it: `part` is the table or figure, the first if `None`.
pub fn written(stored: &Stored, media: Media, part: Option<&str>, language: Language) -> Result<Bytes, Problem> {
    let meta = stored.entry().meta();
    let offered = offered(meta);
    if !offered.contains(&media) {
        return Err(not_acceptable(&offered));
    }
    Ok(rendered(stored, &View { media, part: part.map(ToOwned::to_owned), include: None, language })?.body)
}

pub(super) fn not_acceptable(offered: &[Media]) -> Problem {
    let available: Vec<_> = offered.iter().map(|media| media.essence()).collect();
    Problem::new(StatusCode::NOT_ACCEPTABLE, "not_acceptable").with("available", available.join(", "))
}

/// An answer in some form.
struct Rendered {
    body: Bytes,
    content_type: &'static str,
    /// What it is called as a file, where that is said.
    file: Option<&'static str>,
}

impl Rendered {
    fn of(media: Media, body: Bytes) -> Self {
        Self { body, content_type: media.content_type(), file: None }
    }
}

fn rendered(stored: &Stored, view: &View) -> Result<Rendered, Problem> {
    let is_returned = stored.entry().meta().program == Some(ProgramOrigin::Brought);
    match view.media {
        Media::Gcode | Media::Diff if is_returned => returned(stored, view.media),
        media => Ok(Rendered::of(media, made(stored, view)?)),
    }
}

/// The program that the job brought along, as it is given back, or what changed in it: in its own encoding.
fn returned(stored: &Stored, media: Media) -> Result<Rendered, Problem> {
    let program = stored.returned()?.ok_or_else(Problem::internal)?;
    let is_diff = media == Media::Diff;
    let body = program.encoding.encoded(if is_diff { &program.diff } else { &program.text });
    let content_type = match (program.encoding, is_diff) {
        (ProgramEncoding::Utf8, _) => media.content_type(),
        (ProgramEncoding::Latin1, false) => "text/x-gcode; charset=iso-8859-1",
        (ProgramEncoding::Latin1, true) => "text/x-diff; charset=iso-8859-1",
    };
    let file = match (program.dialect, is_diff) {
        (_, true) => "program.diff",
        (Dialect::Siemens, _) => "program.mpf",
        (Dialect::LinuxCnc, _) => "program.ngc",
        (Dialect::Fanuc | Dialect::FanucA | Dialect::FanucC, _) => "program.nc",
    };
    Ok(Rendered { body: body.ok_or_else(Problem::internal)?.into(), content_type, file: Some(file) })
}

fn made(stored: &Stored, view: &View) -> Result<Bytes, Problem> {
    let wanted = |id: &str| view.part.as_deref().is_none_or(|part| part == id);
    let text = match view.media {
        Media::Json if view.include == Some(Include::Figures) => return with_figures(stored, view.language),
        Media::Json => return Ok(stored.body_in(view.language)),
        Media::Csv => {
            let tables = stored.tables_in(view.language)?;
            let table = tables.iter().find(|table| wanted(table.id));
            render::csv(table.ok_or_else(|| absent("unknown_table", view, tables.iter().map(|table| table.id)))?)
        }
        Media::Svg => {
            let figures = stored.figures()?;
            let figure = figures.iter().find(|figure| wanted(figure.id));
            let figure =
                figure.ok_or_else(|| absent("unknown_figure", view, figures.iter().map(|figure| figure.id)))?;
            drawn(figure, view.language)
        }
        Media::Gcode => {
            let program = stored.program()?.ok_or_else(Problem::internal)?;
            render::gcode(&program, &program_header(stored))
        }
        Media::Diff => return Err(Problem::internal()),
        Media::Xlsx => return Ok(report::xlsx(stored, view.language)?.into()),
        Media::Pdf => return Ok(report::pdf(stored, view.language)?.into()),
    };
    Ok(Bytes::from(text))
}

/// The answer with its figures as its last field.
fn with_figures(stored: &Stored, language: Language) -> Result<Bytes, Problem> {
    let figures: Vec<_> = stored.figures()?.iter().map(|figure| parts::worded(figure, language)).collect();
    let mut body = Vec::from(stored.body_in(language));
    if body.pop() != Some(b'}') {
        return Err(Problem::internal());
    }
    body.extend_from_slice(b",\"figures\":");
    serde_json::to_writer(&mut body, &figures).map_err(|_| Problem::internal())?;
    body.push(b'}');
    Ok(body.into())
}

/// A declared table or figure that this answer does not have.
fn absent<'a>(code: &'static str, view: &View, ids: impl Iterator<Item = &'a str>) -> Problem {
    debug_assert!(codes::status(code).is_some());
    let available: Vec<_> = ids.collect();
    Problem::missing(code, view.part.as_deref().unwrap_or_default()).with("available", available.join(", "))
}

pub(super) fn drawn(figure: &Figure, language: Language) -> String {
    with_words(figure, language, |wording| render::svg(figure, wording))
}

/// Makes something of a figure with its words in that language.
pub(super) fn with_words<T>(figure: &Figure, language: Language, make: impl FnOnce(&render::Wording<'_>) -> T) -> T {
    let texts = Texts::shared();
    make(&render::Wording {
        message: &|message| texts.message(language, "figure", message),
        label: &|code| label(figure, code, language),
        unit: &|unit| match language {
            Language::En => render::unit_symbol(unit),
            Language::Ru => Glossary::of(language).unit(unit),
        },
        decimal: language.decimal(),
    })
}

/// What a figure calls an axis or a curve. Names that no table of texts has stand in the title's values: as text, or, of
/// a study's variables, as their ways through the contract; names of causes and fields are those of the contract.
pub(super) fn label(figure: &Figure, code: &str, language: Language) -> String {
    match figure.title.values.get(code) {
        Some(Value::Text(name)) => name.clone().into_owned(),
        Some(ways @ Value::List(_)) => Texts::names(language, ways).unwrap_or_else(|| code.to_owned()),
        _ if Texts::shared().has(language, "label", code) => {
            Texts::shared().word(language, "label", code, &Values::new())
        }
        _ => Glossary::of(language).name(code),
    }
}

/// Comments at the head of a program: what computed its path, perhaps long ago, where it comes from, and what the answer
/// warns of: whoever stands at the machine has the program alone.
fn program_header(stored: &Stored) -> Vec<String> {
    let said = |name| stored.said(name).unwrap_or_default();
    let mut header = vec![
        format!("precut {} {} version {}", said("engine"), said("calculator"), said("version")),
        format!("result {}", stored.key),
    ];
    header.extend(
        stored.probability().map(|kept| format!("within all limits with probability {}", significant(kept, 4))),
    );
    let warnings: Vec<Warning> = serde_json::from_str(&said("warnings")).unwrap_or_default();
    header.extend(warnings.iter().map(|warning| format!("WARNING {}: {}", warning.code, warning.detail)));
    header
}

/// A warning as it stands in an answer.
#[derive(Deserialize)]
struct Warning {
    code: String,
    detail: String,
}
