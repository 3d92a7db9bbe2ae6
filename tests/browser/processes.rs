//! The page of a process under watch: the tailstock that softened.

use std::fmt::Write as _;

use serde_json::{Value, json};

use crate::both;
use crate::chromium::Page;
use crate::stream::process_file;

/// Sends the process with its first parts, all in one request.
fn feed(page: &mut Page, count: usize) {
    let mut process = process_file("r01-tailstock-softer.json");
    let fields = process.as_object_mut().unwrap();
    let Some(Value::Array(mut parts)) = fields.remove("parts") else { panic!("a stream without parts") };
    parts.truncate(count);
    parts.iter_mut().enumerate().for_each(|(index, part)| part["part"] = json!(format!("p-{}", index + 1)));
    let send = "(async (method, path, body) => { const said = await fetch(path, { method, headers: { 'Content-Type': \
                'application/json' }, body: JSON.stringify(body) }); return said.ok ? 'ok' : said.text() })";
    for (method, path, body) in [
        ("PUT", "/v1/processes/shaft-560", process),
        ("POST", "/v1/processes/shaft-560/parts", json!({ "parts": parts })),
    ] {
        assert_eq!(page.evaluate(&format!("{send}({}, {}, {body})", json!(method), json!(path))), "ok", "{path}");
    }
}

/// The first parts of the stream as a table.
fn history(count: usize) -> String {
    let process = process_file("r01-tailstock-softer.json");
    let mut table =
        "part,number,part_type,edge,batch,tool_path_at_start_m,warm_time_at_start_min,z_mm,diameter_deviation_um\n"
            .to_owned();
    for part in &process["parts"].as_array().unwrap()[..count] {
        let (number, c) = (&part["number"], &part["conditions"]);
        for row in part["measurements"].as_array().unwrap() {
            let cells = [
                &c["edge"],
                &c["batch"],
                &c["tool_path_at_start_m"],
                &c["warm_time_at_start_min"],
                &row["z_mm"],
                &row["diameter_deviation_um"],
            ];
            let cells = cells.map(|cell| cell.to_string().replace('"', "")).join(",");
            let _ = writeln!(table, "p-{number},{number},{},{cells}", part["part_type"].as_str().unwrap());
        }
    }
    table
}

#[test]
fn a_history_from_a_file_tells_what_would_have_been_said_when() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("processes"));
    page.wait_for(".empty-list");
    feed(&mut page, 0);
    page.open(&service.page("processes?name=shaft-560"));
    page.wait_for(".process-history input[type=file]");
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("history.csv");
    std::fs::write(&file, history(42)).unwrap();
    page.choose_file(".process-history input[type=file]", &file);
    page.wait_for(".process-history [role=status]");
    let told = page.text(".process-history");
    assert!(told.contains("42 parts taken"), "{told}");
    assert!(told.contains("a change is known"), "{told}");
    page.until("document.querySelector('.process-say').dataset.state === 'changed'");
    crate::access::assert_accessible(&mut page, "a process with a history");
    page.assert_calm();
}

#[test]
fn a_setter_reads_one_sentence_and_rejects_what_is_no_change() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("processes"));
    page.wait_for(".empty-list");
    feed(&mut page, 40);
    page.open(&service.page(""));
    page.open(&service.page("processes"));
    page.wait_for(".processes a");
    page.click(".processes a");
    page.wait_for(".process-say .said");
    let said = page.text(".process-say .said");
    assert!(said.contains("Since part 37"), "{said}");
    page.until("document.querySelectorAll('.process svg.chart').length >= 3");
    page.wait_for("[data-change=c1] li");
    let causes = page.text("[data-change=c1] ul");
    assert!(causes.to_lowercase().contains("tailstock compliance"), "{causes}");
    crate::access::assert_accessible(&mut page, "a process");
    page.click("[data-change=c1] [data-act=reject]");
    page.wait_for("[data-change=c1][data-decided=rejected]");
    page.until("document.querySelector('.process-say').dataset.state !== 'changed'");
    let wide = page.evaluate("document.documentElement.scrollWidth <= innerWidth");
    assert_eq!(wide, true, "the page is no wider than the screen");
    page.assert_calm();
}
