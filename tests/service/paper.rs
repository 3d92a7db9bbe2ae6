//! Reports and workbooks: that they say what the JSON says, in both languages, and that nothing in them runs.

use std::collections::BTreeMap;
use std::io::Cursor;

use calamine::{Data, Range, Reader, Xlsx};
use precut::registry::Registry;
use serde_json::Value;

use crate::support::{Server, header, problem, toy};

const XLSX: &str = "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet";
const PDF: &str = "application/pdf";
/// A number on paper has five digits.
const PRINTED: f64 = 6e-5;

async fn standard() -> Server {
    Server::start_of(Registry::standard().unwrap(), |_| {}).await
}

/// Sends a job and gives the address of its answer with the answer.
async fn solved(server: &Server, calculator: &str, job: &str) -> (String, Value) {
    let request = server.post_to(&format!("/v1/{calculator}"), job.to_owned()).header("prefer", "wait=120");
    let response = request.send().await.unwrap();
    assert_eq!(response.status(), 200, "{calculator}");
    let answer: Value = response.json().await.unwrap();
    (format!("/v1/results/{}", answer["key"].as_str().unwrap()), answer)
}

/// A form of an answer as its bytes.
async fn form(server: &Server, address: &str, (accept, language): (&str, &str)) -> Vec<u8> {
    let response =
        server.get(address).header("accept", accept).header("accept-language", language).send().await.unwrap();
    assert_eq!(response.status(), 200, "{address} {accept}");
    assert_eq!(header(&response, "content-type"), accept);
    assert_eq!(header(&response, "content-language"), language);
    response.bytes().await.unwrap().to_vec()
}

/// What stands on the pages, with one space between words.
fn read(pdf: &[u8]) -> String {
    let document = lopdf::Document::load_mem(pdf).unwrap();
    let pages: Vec<u32> = document.get_pages().into_keys().collect();
    let text = document.extract_text(&pages).unwrap();
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Every number on the pages.
fn numbers(text: &str, language: &str) -> Vec<f64> {
    let text = if language == "ru" { text.replace(',', ".") } else { text.to_owned() };
    let part = |c: char| c.is_ascii_digit() || "+-.e".contains(c);
    text.split(|c| !part(c)).filter_map(|token| token.trim_matches('.').parse().ok()).collect()
}

fn is_printed(value: f64, printed: &[f64], tolerance: f64) -> bool {
    printed.iter().any(|number| (number - value).abs() <= tolerance)
}

/// The single values of a part of an answer by their pointers, as far as no list stands above them.
fn singles(value: &Value, pointer: &str, found: &mut BTreeMap<String, Value>) {
    match value {
        Value::Object(fields) => {
            fields.iter().for_each(|(name, value)| singles(value, &format!("{pointer}/{name}"), found));
        }
        Value::Array(_) | Value::Null => {}
        single => drop(found.insert(pointer.to_owned(), single.clone())),
    }
}

fn book(bytes: Vec<u8>) -> Xlsx<Cursor<Vec<u8>>> {
    Xlsx::new(Cursor::new(bytes)).unwrap()
}

fn sheets(book: &mut Xlsx<Cursor<Vec<u8>>>) -> Vec<(String, Range<Data>)> {
    for name in book.sheet_names() {
        let formulas = book.worksheet_formula(&name).unwrap();
        assert!(formulas.used_cells().all(|(.., formula)| formula.is_empty()), "a formula on {name}");
    }
    book.worksheets()
}

/// Values of a sheet of fields by their pointers.
fn by_pointer(sheet: &Range<Data>) -> BTreeMap<String, Data> {
    let rows = sheet.rows().filter(|row| row.len() > 4);
    rows.filter_map(|row| match &row[4] {
        Data::String(pointer) if pointer.starts_with('/') => Some((pointer.clone(), row[2].clone())),
        _ => None,
    })
    .collect()
}

#[tokio::test]
async fn a_report_of_every_first_example_says_what_the_json_says() {
    let server = standard().await;
    let registry = Registry::standard().unwrap();
    for entry in registry.entries() {
        let meta = entry.meta();
        let (address, answer) = solved(&server, meta.id, meta.examples[0].job).await;
        let tables: Value = server.get(&format!("{address}/tables")).send().await.unwrap().json().await.unwrap();
        for language in ["en", "ru"] {
            let pdf = form(&server, &address, (PDF, language)).await;
            assert!(pdf.starts_with(b"%PDF-1.7"), "{}", meta.id);
            let metadata = String::from_utf8_lossy(&pdf);
            assert!(metadata.contains("<pdfaid:part>2<") && metadata.contains("<pdfaid:conformance>A<"), "{}", meta.id);
            let text = read(&pdf);
            let printed = numbers(&text, language);
            // What is said, but for where lines end.
            let said = server.get(&address).header("accept-language", language).send().await.unwrap();
            let said: Value = said.json().await.unwrap();
            let sentences = said["explanation"].as_array().unwrap().iter().map(|remark| &remark["text"]);
            for sentence in
                sentences.chain(said["warnings"].as_array().unwrap().iter().map(|warning| &warning["detail"]))
            {
                let words: Vec<&str> = sentence.as_str().unwrap().split_whitespace().skip(1).collect();
                assert!(text.contains(&words.join(" ")), "{} {language}: {sentence} in {text}", meta.id);
            }
            assert!(text.contains(answer["key"].as_str().unwrap()), "{}", meta.id);
            for pointer in meta.study_outputs {
                let Some(value) = answer["result"].pointer(pointer).and_then(Value::as_f64) else { continue };
                assert!(is_printed(value, &printed, PRINTED * value.abs()), "{} {pointer} = {value}", meta.id);
            }
            for basis in answer["basis"].as_array().unwrap() {
                assert!(text.contains(basis["equation"].as_str().unwrap()), "{}: {basis}", meta.id);
            }
            // The ends of every table.
            for column in
                tables["items"].as_array().unwrap().iter().flat_map(|table| table["columns"].as_array().unwrap())
            {
                let cells: Vec<f64> = column["cells"].as_array().unwrap().iter().filter_map(Value::as_f64).collect();
                let most = cells.iter().fold(0.0_f64, |most, cell| most.max(cell.abs()));
                if let Some(cell) = cells.first() {
                    assert!(is_printed(*cell, &printed, PRINTED * most), "{} {language}: {cell} of {column}", meta.id);
                }
            }
        }
    }
    server.stop().await;
}

#[tokio::test]
async fn a_workbook_of_every_first_example_holds_the_numbers_of_the_json() {
    let server = standard().await;
    let registry = Registry::standard().unwrap();
    let mut compared = 0;
    for entry in registry.entries() {
        let meta = entry.meta();
        let (address, answer) = solved(&server, meta.id, meta.examples[0].job).await;
        for language in ["en", "ru"] {
            let tables = server.get(&format!("{address}/tables")).header("accept-language", language);
            let tables: Value = tables.send().await.unwrap().json().await.unwrap();
            let tables = tables["items"].as_array().unwrap();
            let mut book = book(form(&server, &address, (XLSX, language)).await);
            let sheets = sheets(&mut book);
            assert_eq!(sheets.len(), tables.len() + 2, "{}: answer, inputs, tables", meta.id);
            for (part, sheet) in [("result", &sheets[0].1), ("input", &sheets[1].1)] {
                let held = by_pointer(sheet);
                let mut wanted = BTreeMap::new();
                singles(&answer[part], "", &mut wanted);
                for (pointer, cell) in &held {
                    match (cell, answer[part].pointer(pointer)) {
                        (Data::Float(number), Some(Value::Number(own))) => assert_eq!(Some(*number), own.as_f64()),
                        (Data::Float(number), own) => panic!("{} {pointer}: {number} for {own:?}", meta.id),
                        (_, own) => assert!(!matches!(own, Some(Value::Number(_))), "{} {pointer}: {cell}", meta.id),
                    }
                    compared += 1;
                }
                // All inputs stand there; of the result what is not for experts alone.
                let absent: Vec<_> = wanted.keys().filter(|pointer| !held.contains_key(*pointer)).collect();
                assert!(part == "result" || absent.is_empty(), "{}: {absent:?}", meta.id);
                assert!(part == "input" || 2 * held.len() >= wanted.len().min(10), "{}: {absent:?}", meta.id);
            }
            for ((name, sheet), table) in sheets[2..].iter().zip(tables) {
                for (place, column) in table["columns"].as_array().unwrap().iter().enumerate() {
                    let head = sheet.get((0, place)).unwrap().to_string();
                    let unit = column["unit"].as_str().unwrap();
                    assert_eq!(head.ends_with(']'), !["", "1"].contains(&unit), "{} {name}: {head}", meta.id);
                    for (row, own) in column["cells"].as_array().unwrap().iter().enumerate() {
                        let cell = sheet.get((row + 1, place)).unwrap_or(&Data::Empty);
                        match own {
                            Value::Number(own) => {
                                assert_eq!(cell, &Data::Float(own.as_f64().unwrap()), "{name} {place} {row}");
                            }
                            Value::Null => assert_eq!(cell, &Data::Empty),
                            Value::String(own) => {
                                assert_eq!(own.is_empty(), *cell == Data::Empty, "{name}: {own} {cell}");
                            }
                            other => panic!("{other}"),
                        }
                        compared += 1;
                    }
                }
            }
        }
    }
    assert!(compared > 20_000, "{compared}");
    server.stop().await;
}

/// Names that a spreadsheet would run, that a typesetter might read as commands, that no typeface has.
const HOSTILE: [&str; 6] = [
    "=1+1",
    "@SUM(A1:A9)",
    "+cmd|' /C calc'!A0",
    "-2+3\t=HYPERLINK(\"http://x\")",
    "#set page(1pt); $x$ </text><script>\\input{x}",
    "零件 شكل \u{1f600} \u{202e}x",
];

#[tokio::test]
async fn hostile_names_are_words_wherever_they_stand() {
    let server = standard().await;
    let registry = Registry::standard().unwrap();
    let mut job: Value = serde_json::from_str(registry.entry("feed-schedule").unwrap().meta().examples[0].job).unwrap();
    let zones = job["zones"].as_array_mut().unwrap();
    assert_eq!(zones.len(), HOSTILE.len());
    for (zone, name) in zones.iter_mut().zip(HOSTILE) {
        zone["id"] = name.into();
    }
    let (address, _) = solved(&server, "feed-schedule", &job.to_string()).await;
    for language in ["en", "ru"] {
        let mut book = book(form(&server, &address, (XLSX, language)).await);
        let sheets = sheets(&mut book);
        for name in HOSTILE {
            let holders = sheets
                .iter()
                .filter(|(_, sheet)| sheet.used_cells().any(|(.., cell)| *cell == Data::String(name.to_owned())));
            assert!(holders.count() >= 2, "{name:?} is among inputs and in a table");
        }
        let text = read(&form(&server, &address, (PDF, language)).await);
        for name in ["=1+1", "@SUM(A1:A9)", "#set page(1pt);", "</text><script>", "U+96F6U+4EF6", "U+0634", "U+1F600"] {
            assert!(text.contains(name), "{name} in {text}");
        }
    }
    server.stop().await;
}

#[tokio::test]
async fn the_same_answer_gives_the_same_bytes_and_every_form_a_tag_of_its_own() {
    let server = Server::start().await;
    let address = header(&server.post(toy::JOB).send().await.unwrap(), "content-location").to_owned();
    let mut tags = Vec::new();
    for accept in [XLSX, PDF] {
        for language in ["en", "ru"] {
            let get = |tag: &str| {
                let request = server.get(&address).header("accept", accept).header("accept-language", language);
                request.header("if-none-match", tag.to_owned()).send()
            };
            let response = get("\"none\"").await.unwrap();
            let tag = header(&response, "etag").to_owned();
            let bytes = response.bytes().await.unwrap();
            assert_eq!(form(&server, &address, (accept, language)).await, bytes, "{accept} {language}");
            assert_eq!(get(&tag).await.unwrap().status(), 304);
            assert!(!tags.contains(&tag));
            tags.push(tag);
        }
    }
    // Straight from a job, too.
    let response = server.post(toy::JOB).header("accept", PDF).send().await.unwrap();
    assert_eq!(header(&response, "precut-cache"), "hit");
    assert!(response.bytes().await.unwrap().starts_with(b"%PDF"));
    server.stop().await;
}

#[tokio::test]
async fn a_long_answer_has_a_short_report_that_says_so() {
    let server = Server::start().await;
    let job = r#"{"length_mm": 500, "load_n": 100, "stations": 20001}"#;
    for (language, said) in
        [("en", "30 of 20001 rows, evenly spaced"), ("ru", "30 из 20001 строк, через равные промежутки")]
    {
        let response = server.post(job).header("accept", PDF).header("accept-language", language).send().await.unwrap();
        assert_eq!(response.status(), 200);
        let bytes = response.bytes().await.unwrap();
        assert!(bytes.len() < 400_000, "{}", bytes.len());
        let text = read(&bytes);
        assert!(text.contains(said), "{text}");
        // From end to end.
        let printed = numbers(&text, language);
        assert!(is_printed(500.0, &printed, 0.0) && is_printed(12.5, &printed, 0.05 * 500.0), "{text}");
    }
    let response = server.post(job).header("accept", XLSX).send().await.unwrap();
    let sheets = sheets(&mut book(response.bytes().await.unwrap().to_vec()));
    assert_eq!(sheets[2].1.height(), 20_002, "the workbook has them all");
    server.stop().await;
}

#[tokio::test]
async fn studies_and_jobs_have_them_too() {
    let server = Server::start().await;
    let study = r#"{"calculator": "sagging-bar", "job": {"length_mm": 500, "load_n": 100},
                    "vary": [{"pointer": "/length_mm", "values": [100, 200, 400]}]}"#;
    let address = header(&server.post_to("/v1/studies", study).send().await.unwrap(), "content-location").to_owned();
    for language in ["en", "ru"] {
        assert!(read(&form(&server, &address, (PDF, language)).await).contains("b3:"));
        let sheets = sheets(&mut book(form(&server, &address, (XLSX, language)).await));
        let held = |number: f64| {
            sheets.iter().any(|(_, sheet)| sheet.used_cells().any(|(.., cell)| *cell == Data::Float(number)))
        };
        assert!(held(200.0) && held(400.0), "{sheets:?}");
    }
    let accepted = server.post(r#"{"length_mm": 321, "load_n": 100}"#).header("prefer", "respond-async, wait=30");
    let response = accepted.header("accept", PDF).send().await.unwrap();
    assert_eq!((response.status().as_u16(), header(&response, "content-type")), (200, PDF));
    let list: Value = server.get("/v1/jobs").send().await.unwrap().json().await.unwrap();
    let address = list["items"][0]["links"]["result"].as_str().unwrap();
    let result = server.get(address).header("accept", XLSX).send().await.unwrap();
    assert_eq!(header(&result, "content-type"), XLSX);
    server.stop().await;
}

#[tokio::test]
async fn parts_are_not_asked_of_the_whole() {
    let server = Server::start().await;
    let response =
        server.post_to("/v1/sagging-bar?table=nothing", toy::JOB).header("accept", XLSX).send().await.unwrap();
    problem(response, 404, "unknown_table").await;
    server.stop().await;
}
