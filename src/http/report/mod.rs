//! An answer as a report or a workbook: what stands on its paper, from the declarations of its calculator.

mod equations;
mod fields;
mod tree;
mod vocabulary;

use precut_calc::calculator::{Cells, Figure, Table, Values};
use serde::Deserialize;
use serde::de::DeserializeOwned;

use self::fields::{Fields, Lists};
use self::tree::Tree;
use self::vocabulary::Vocabulary;
use super::answer;
use super::problem::Problem;
use crate::engine::Stored;
use crate::render::{self, Counted, Equation, Headings, Picture, Report, Sheet};
use crate::text::{Glossary, Language, Texts, capitalised, told};

/// The answer as pages.
pub(super) fn pdf(stored: &Stored, language: Language) -> Result<Vec<u8>, Problem> {
    let mut report = report(stored, language)?;
    report.pictures = stored.figures()?.iter().map(|figure| picture(figure, language)).collect();
    render::pdf(&report, &|count| counted(language, count)).map_err(|error| {
        tracing::error!(%error, key = %stored.key, "an answer cannot be put on paper");
        Problem::internal()
    })
}

/// The answer as sheets.
pub(super) fn xlsx(stored: &Stored, language: Language) -> Result<Vec<u8>, Problem> {
    render::xlsx(&report(stored, language)?).map_err(|fault| match fault {
        render::XlsxFault::TooLarge(cells) => Problem::too_large_for_a_workbook(cells, render::MOST_CELLS),
        fault @ render::XlsxFault::Unwritten(_) => {
            tracing::error!(error = %fault, key = %stored.key, "an answer cannot be put on sheets");
            Problem::internal()
        }
    })
}

/// What of an envelope is put on paper.
#[derive(Debug, Deserialize)]
struct Remark {
    text: String,
}

#[derive(Debug, Deserialize)]
struct Warning {
    detail: String,
}

#[derive(Debug, Deserialize)]
struct Basis {
    equation: String,
    source: String,
}

#[derive(Debug, Deserialize)]
struct Model {
    name: String,
    revision: u64,
    sha256: String,
}

/// Everything but the pictures.
fn report(stored: &Stored, language: Language) -> Result<Report, Problem> {
    let glossary = Glossary::of(language);
    let entry = stored.entry();
    let meta = entry.meta();
    let body = stored.body_in(language);
    let remarks: Vec<Remark> = part(&body, "explanation")?;
    let warnings: Vec<Warning> = part(&body, "warnings")?;
    let basis: Vec<Basis> = part(&body, "basis")?;
    let (input, result): (Tree, Tree) = (part(&body, "input")?, part(&body, "result")?);
    let (of_job, of_result) = (entry.input_document(), entry.output_document());
    let words = Vocabulary::of([&of_result, &of_job], meta.id, language);
    let fields = |document, tree, lists| Fields::of(document, meta.id, (language, &words), lists).all(tree);
    let engine = stored.said("engine").unwrap_or_default();
    let version = stored.said("version").unwrap_or_default();
    Ok(Report {
        language: language.tag(),
        decimal: language.decimal(),
        title: glossary.help(meta.title).to_owned(),
        question: glossary.help(meta.question).to_owned(),
        subject: told(language, &stored.marks()),
        remarks: remarks.into_iter().map(|remark| capitalised(&remark.text)).collect(),
        warnings: warnings.into_iter().map(|warning| capitalised(&warning.detail)).collect(),
        results: fields(&of_result, &result, Lists::LeftOut),
        inputs: fields(&of_job, &input, Lists::Told),
        pictures: Vec::new(),
        tables: stored.tables_in(language)?.into_iter().map(|table| sheet(table, &words, language)).collect(),
        equations: basis.into_iter().map(equation).collect(),
        references: meta.references.iter().map(|reference| (*reference).to_owned()).collect(),
        origin: origin(stored, part(&body, "model")?, language),
        signature: format!("precut {engine} · {} {version} · {}", meta.id, stored.key),
        headings: headings(language),
    })
}

/// A part of the envelope.
fn part<T: DeserializeOwned>(body: &[u8], name: &str) -> Result<T, Problem> {
    let place = crate::engine::top_level_field(body, name).ok_or_else(Problem::internal)?;
    serde_json::from_slice(&body[place]).map_err(|error| {
        tracing::error!(%error, name, "a part of an answer cannot be read");
        Problem::internal()
    })
}

/// A word of the paper's own.
fn own(language: Language, code: &str) -> String {
    Texts::shared().word(language, "report", code, &Values::new())
}

fn headings(language: Language) -> Headings {
    let own = |code| own(language, code);
    Headings {
        answer: own("answer"),
        warnings: own("warnings"),
        results: own("results"),
        inputs: own("inputs"),
        tables: own("tables"),
        equations: own("equations"),
        references: own("references"),
        origin: own("origin"),
        columns: ["group", "field", "value", "unit", "place"].map(own),
    }
}

fn counted(language: Language, count: Counted) -> String {
    let (code, shown, all) = match count {
        Counted::EvenRows(shown, all) => ("even_rows", shown, all),
        Counted::FirstRows(shown, all) => ("first_rows", shown, all),
        Counted::Fields(shown, all) => ("first_fields", shown, all),
        Counted::Page(page, pages) => ("page", page, pages),
    };
    let values = Values::new().with("shown", shown as f64).with("all", all as f64);
    Texts::shared().word(language, "report", code, &values)
}

/// What made the answer, so that it can be asked again and found.
fn origin(stored: &Stored, model: Option<Model>, language: Language) -> Vec<(String, String)> {
    let said = |name| stored.said(name).unwrap_or_default();
    let mut origin = vec![
        (own(language, "engine"), format!("precut {}", said("engine"))),
        (own(language, "calculator"), format!("{} {}", said("calculator"), said("version"))),
    ];
    if let Some(Model { name, revision, sha256 }) = model {
        origin.push((own(language, "model"), format!("{name}@{revision} (sha256 {sha256})")));
    }
    origin.push((own(language, "address"), format!("/v1/results/{}", stored.key)));
    origin.push((own(language, "key"), stored.key.to_string()));
    origin
}

fn picture(figure: &Figure, language: Language) -> Picture {
    answer::with_words(figure, language, |wording| Picture {
        svg: render::svg(figure, wording),
        description: format!("{}. {}", (wording.message)(&figure.title), render::described(figure, wording)),
    })
}

/// A table with the words of its head, and words in place of codes.
fn sheet(mut table: Table, words: &Vocabulary, language: Language) -> Sheet {
    let glossary = Glossary::of(language);
    let heads = table.columns.iter().map(|column| {
        let name = Texts::shared().column(language, &column.name, column.unit);
        (capitalised(&name), glossary.unit(column.unit))
    });
    let heads = heads.collect();
    for column in &mut table.columns {
        let Cells::Words(cells) = &mut column.cells else { continue };
        for cell in cells {
            if let Some(said) = words.under(&column.name, cell) {
                *cell = said.into();
            }
        }
    }
    Sheet { title: capitalised(&glossary.word(table.id)), heads, table }
}

fn equation(basis: Basis) -> Equation {
    let formula = equations::formula(&basis.equation).to_vec();
    Equation { number: basis.equation, formula, source: basis.source }
}
