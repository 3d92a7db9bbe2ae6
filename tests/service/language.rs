//! The languages: which one comes, that it is all of it, and that every language has its own tag.

use precut::registry::Registry;
use serde_json::Value;

use crate::support::{Server, header, problem};

const ROOM: &str = "/v1/deflection-compensation";

fn job() -> &'static str {
    Registry::standard().unwrap().entry("deflection-compensation").unwrap().meta().examples[0].job
}

async fn standard() -> Server {
    Server::start_of(Registry::standard().unwrap(), |_| {}).await
}

fn is_russian(text: &Value) -> bool {
    text.as_str().unwrap().chars().any(|c| ('а'..='я').contains(&c))
}

#[tokio::test]
async fn an_answer_is_computed_once_and_said_in_every_language() {
    let server = standard().await;
    let ask = async |language: &str| {
        let response = server.post_to(ROOM, job()).header("accept-language", language).send().await.unwrap();
        assert_eq!(response.status(), 200);
        let part = |name: &str| header(&response, name).to_owned();
        assert_eq!(part("vary"), "Accept, Accept-Language, Accept-Encoding");
        let (spoken, tag, cache) = (part("content-language"), part("etag"), part("precut-cache"));
        (spoken, tag, cache, response.json::<Value>().await.unwrap())
    };
    let (english_spoken, english_tag, _, english) = ask("en").await;
    let (russian_spoken, russian_tag, cache, russian) = ask("ru-RU, ru;q=0.9, en;q=0.8").await;
    assert_eq!((english_spoken.as_str(), russian_spoken.as_str(), cache.as_str()), ("en", "ru", "hit"));
    assert_ne!(english_tag, russian_tag);
    for name in ["key", "input", "result", "basis", "effects"] {
        assert_eq!(english[name], russian[name], "{name}");
    }
    let pairs = |name: &str| {
        let (english, russian) = (english[name].as_array().unwrap(), russian[name].as_array().unwrap());
        assert_eq!(english.len(), russian.len());
        english.iter().cloned().zip(russian.iter().cloned()).collect::<Vec<_>>()
    };
    assert!(!pairs("explanation").is_empty());
    for (english, russian) in pairs("explanation").into_iter().chain(pairs("warnings")) {
        assert_eq!(english["code"], russian["code"]);
        assert_eq!(english["values"], russian["values"]);
        let text = if english["text"].is_string() { "text" } else { "detail" };
        assert!(!is_russian(&english[text]) && is_russian(&russian[text]), "{russian}");
    }
    // The same bytes again, and none for those who have them.
    assert_eq!(ask("ru").await.3, russian);
    let again = server.post_to(ROOM, job()).header("accept-language", "ru").header("if-none-match", &russian_tag);
    assert_eq!(again.send().await.unwrap().status(), 304);
    let other = server.post_to(ROOM, job()).header("accept-language", "ru").header("if-none-match", &english_tag);
    assert_eq!(other.send().await.unwrap().status(), 200);
}

#[tokio::test]
async fn pictures_are_labelled_in_the_language_and_tables_are_the_same_in_all() {
    let server = standard().await;
    let ask = async |accept: &str, language: &str| {
        let request = server.post_to(ROOM, job()).header("accept", accept).header("accept-language", language);
        request.send().await.unwrap().text().await.unwrap()
    };
    let russian = ask("image/svg+xml", "ru").await;
    for word in ["Обточенный вал до и после компенсации", "мкм", "допуск"] {
        assert!(russian.contains(word), "{word} in {russian}");
    }
    assert!(ask("image/svg+xml", "en").await.contains("Turned shaft before and after compensation"));
    assert_eq!(ask("text/csv", "ru").await, ask("text/csv", "en").await);
    assert_eq!(ask("text/x-gcode", "ru").await, ask("text/x-gcode", "en").await);
}

/// Whoever stands at the machine has the program alone.
#[tokio::test]
async fn a_program_says_what_the_answer_warns_of() {
    let server = standard().await;
    for dialect in ["fanuc", "fanuc_a", "fanuc_c", "siemens", "linuxcnc"] {
        let mut stepped: Value = serde_json::from_str(job()).unwrap();
        stepped["shaft"]["segments"] = serde_json::json!([
            { "length_mm": 900, "diameter_mm": 90, "stock_diameter_mm": 91 },
            { "length_mm": 200, "diameter_mm": 86, "stock_diameter_mm": 91 },
            { "length_mm": 900, "diameter_mm": 90, "stock_diameter_mm": 91 }
        ]);
        stepped["program"] = serde_json::json!({ "dialect": dialect });
        let ask = async |job: &Value, accept: &str| {
            let request = server.post_to(ROOM, job.to_string()).header("accept", accept);
            request.send().await.unwrap().text().await.unwrap()
        };
        let answer: Value = serde_json::from_str(&ask(&stepped, "application/json").await).unwrap();
        let warnings = answer["warnings"].as_array().unwrap();
        let codes: Vec<&str> = warnings.iter().map(|warning| warning["code"].as_str().unwrap()).collect();
        for code in ["plunge_at_shoulder", "effect_left_out"] {
            assert!(codes.contains(&code), "{codes:?}");
        }
        let program = ask(&stepped, "text/x-gcode").await;
        assert!(program.is_ascii(), "{program}");
        let header: Vec<&str> = program.lines().take_while(|line| !line.starts_with('G')).collect();
        let said = |code: &&str| header.iter().any(|line| line.contains(&format!("WARNING {code}: ")));
        assert!(codes.iter().all(said), "{program}");
        assert!(header.iter().any(|line| line.contains("Z-900")), "{program}");
        let system = |letter: &str| header.iter().any(|line| line.contains(&format!("G-code system {letter}")));
        assert_eq!((system("A"), system("B")), (dialect == "fanuc_a", dialect == "fanuc"));
        // With limits it says how probably all of them are kept.
        stepped["tolerance"] = serde_json::json!({ "diameter_um": 40 });
        let answer: Value = serde_json::from_str(&ask(&stepped, "application/json").await).unwrap();
        let probability = answer["result"]["conformance"]["joint"]["probability"].as_f64().unwrap();
        let program = ask(&stepped, "text/x-gcode").await;
        let kept = program.lines().find_map(|line| line.split_once("within all limits with probability ")).unwrap().1;
        let kept: f64 = kept.trim_end_matches([')', ' ']).parse().unwrap();
        assert!((kept / probability - 1.0).abs() < 1e-3, "{kept} {probability}");
    }
}

#[tokio::test]
async fn faults_are_said_in_the_language_of_the_request() {
    let server = standard().await;
    let bad = r#"{"cut": {"feed_mm_per_rev": 900.5}}"#;
    let response = server.post_to(ROOM, bad).header("accept-language", "ru").send().await.unwrap();
    assert_eq!(header(&response, "content-language"), "ru");
    assert_eq!(header(&response, "vary"), "Accept-Language, Accept-Encoding");
    let document = problem(response, 422, "invalid_job").await;
    assert_eq!(document["title"], "Задание составлено с ошибками");
    let errors = document["errors"].as_array().unwrap();
    assert!(errors.len() > 1 && errors.iter().all(|fault| is_russian(&fault["detail"])), "{document}");
    let feed = errors.iter().find(|fault| fault["pointer"] == "/cut/feed_mm_per_rev").unwrap();
    assert!(feed["detail"].as_str().unwrap().starts_with("feed_mm_per_rev = 900,5 мм/об; подача"), "{feed}");
    let response = server.post_to(ROOM, "{\"cut\": [1,}").header("accept-language", "ru").send().await.unwrap();
    let document = problem(response, 400, "bad_syntax").await;
    assert_eq!(document["detail"], "ожидается значение: строка 1, столбец 12");
    let page = server.get("/problems/invalid_job").header("accept-language", "ru").header("accept", "text/html");
    let text = page.send().await.unwrap().text().await.unwrap();
    assert!(text.contains("<html lang=\"ru\">") && text.contains("Документация"), "{text}");
}

#[tokio::test]
async fn a_calculator_is_described_in_the_language_of_the_request() {
    let server = standard().await;
    let ask = async |path: &str, language: &str| {
        let response = server.get(path).header("accept-language", language).send().await.unwrap();
        assert_eq!(header(&response, "content-language"), language);
        assert_eq!(header(&response, "vary"), "Accept, Accept-Language, Accept-Encoding");
        (header(&response, "etag").to_owned(), response.json::<Value>().await.unwrap())
    };
    let path = "/v1/calculators/deflection-compensation";
    let ((english_tag, english), (russian_tag, russian)) = (ask(path, "en").await, ask(path, "ru").await);
    assert_ne!(english_tag, russian_tag);
    let feed =
        |described: &Value| described.pointer("/input_schema/$defs/Cut/properties/feed_mm_per_rev").unwrap().clone();
    assert_eq!(feed(&english)["title"], "Feed");
    assert_eq!(feed(&russian)["title"], "Подача");
    assert_eq!(feed(&russian)["description"], "Подача на оборот.");
    assert_eq!(feed(&russian)["x-unit"], "mm/rev");
    assert_eq!(feed(&russian)["x-unit-label"], "мм/об");
    assert_eq!(feed(&russian)["x-group-label"], "Режим резания");
    assert_eq!(russian["jobs"], english["jobs"]);
    assert!(
        is_russian(&russian["title"]) && is_russian(&russian["summary"]) && is_russian(&russian["labels"]["stations"])
    );
    let materials = ask("/v1/materials", "ru").await.1;
    assert!(materials["items"].as_array().unwrap().iter().all(|material| is_russian(&material["title"])));
}
