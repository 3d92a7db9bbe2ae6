//! Machine, tool and material by name in the form.

use serde_json::json;

use crate::{SETTLED, both};

const MATERIAL: &str = "[data-record=material] input";
const TOOL: &str = "[data-record=tool] input";
const MODULUS: &str = "#field-shaft-youngs_modulus_n_per_mm2";

#[test]
fn a_material_is_found_by_any_name_and_its_numbers_say_where_they_are_from() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("deflection-compensation"));
    page.until(SETTLED);
    page.until("document.querySelectorAll('[data-record]').length === 3");
    page.fill(MATERIAL, "38ХМ");
    page.until("document.querySelector('.hits [aria-selected=true] strong')?.textContent === '42crmo4'");
    page.press("Enter");
    page.until(&format!("document.querySelector('{MATERIAL}').value === '42crmo4' && {SETTLED}"));
    page.until("location.hash.includes('42crmo4')");
    // The example's own numbers count until they are taken from the record, too.
    page.click("[data-act=use-records]");
    page.until(&format!("!document.querySelector('[data-act=use-records]') && {SETTLED}"));
    let field = page.evaluate(&format!(
        "(() => {{ const it = document.querySelector('{MODULUS}'); return [it.value, it.placeholder] }})()"
    ));
    assert_eq!(field, json!(["", "210000"]));
    page.click(&format!(".row:has({MODULUS}) .origin-mark"));
    page.wait_for(".origin");
    let origin = page.text(".origin");
    assert!(origin.contains("42crmo4") && origin.contains("210"), "{origin}");
    // What is typed counts; taken away, the record's number is back.
    page.fill(MODULUS, "200000");
    page.until(&format!("!document.querySelector('.row:has({MODULUS}) .origin-mark') && {SETTLED}"));
    page.click("[data-act=use-records]");
    page.until(&format!("document.querySelector('{MODULUS}').value === '' && {SETTLED}"));
    page.assert_calm();
}

#[test]
fn a_tool_is_told_by_its_codes_and_a_bad_name_is_refused_at_its_picker() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("deflection-compensation"));
    page.until(SETTLED);
    page.fill(TOOL, "DNMG150608 PDJNL2525M15");
    page.press("Enter");
    page.until(&format!("document.querySelector('{TOOL}').value === 'DNMG150608 PDJNL2525M15' && {SETTLED}"));
    page.fill(TOOL, "XNMG120408");
    page.press("Enter");
    page.wait_for("[data-record=tool] .fault");
    let fault = page.text("[data-record=tool] .fault");
    assert!(fault.contains("XNMG120408"), "{fault}");
    page.click("[data-record=tool] [data-act=clear]");
    page.until(&format!("!document.querySelector('[data-record=tool] .fault') && {SETTLED}"));
    page.assert_calm();
}

#[test]
fn a_machine_of_ones_own_begins_as_a_copy_and_is_named_in_a_job() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("library"));
    page.wait_for(".record-copy");
    page.pick("#record-from", "lathe_engine_medium");
    page.fill("#record-name", "lathe-3");
    page.click(".record-copy button");
    page.wait_for(".record-numbers");
    let carriage = ".record-numbers input[aria-label='compliance · carriage_um_per_n']";
    page.fill(carriage, "0.018");
    page.click(".record-numbers button");
    page.until("document.querySelector('td.number')?.textContent === '2'");
    assert_eq!(page.value(carriage), "0.018");
    page.open(&service.page("deflection-compensation"));
    page.until(SETTLED);
    page.fill("[data-record=machine] input", "lathe-3");
    page.press("Enter");
    page.until(&format!("document.querySelector('[data-record=machine] input').value === 'lathe-3' && {SETTLED}"));
    page.until("location.hash.includes('lathe-3')");
    page.assert_calm();
}

#[test]
fn a_machine_shows_what_it_has_learnt_and_learns_more() {
    let Some((_turn, mut page, service)) = both() else { return };
    page.open(&service.page("library"));
    page.wait_for(".record-copy");
    let put = "(async (path, body) => { const said = await fetch(path, { method: 'PUT', headers: { 'Content-Type': 'application/json' }, \
               body: JSON.stringify(body) }); return said.ok ? 'ok' : said.text() })";
    for (path, body) in [
        ("/v1/machines/lathe-3", json!({ "from": "lathe_engine_medium" })),
        (
            "/v1/models/winter",
            json!({ "calculator": "deflection-compensation", "effects": [{ "kind": "headstock_compliance", "delta_um_per_n": 0.01 }], "provenance": {} }),
        ),
        (
            "/v1/models/summer",
            json!({ "calculator": "deflection-compensation", "effects": [{ "kind": "headstock_compliance", "delta_um_per_n": 0.01 }], "provenance": {} }),
        ),
    ] {
        assert_eq!(page.evaluate(&format!("{put}({}, {body})", json!(path))), "ok", "{path}");
    }
    page.open(&service.page("library"));
    page.click(".list [aria-expanded]");
    page.wait_for(".learnt");
    assert!(page.text(".learnt").contains("No stored model extends its jobs yet"));
    page.until("document.querySelector('.learnt select')?.options.length === 2");
    let rows = "[...document.querySelectorAll('.learnt tbody tr')].map(row => [row.querySelector('td').textContent, 'inForce' in row.dataset])";
    page.pick(".learnt select", "winter");
    page.click(".learnt-next button");
    page.until("document.querySelectorAll('.learnt tbody tr').length === 1");
    page.pick(".learnt select", "summer");
    page.click(".learnt-next button");
    page.until("document.querySelectorAll('.learnt tbody tr').length === 2");
    assert_eq!(page.evaluate(rows), json!([["summer@1", true], ["winter@1", false]]), "the newest stands first");
    let kept = page.evaluate("fetch('/v1/machines/lathe-3').then(said => said.json())");
    assert_eq!(kept["models"], json!({ "deflection-compensation": "summer@1" }));
    assert!(kept["history"][0]["to_date"].is_string() && kept["history"][1]["to_date"].is_null(), "{kept:#}");
    crate::access::assert_accessible(&mut page, "what a machine has learnt");
    page.click(".learnt [data-in-force] button");
    page.until("!document.querySelector('.learnt [data-in-force]')");
    assert_eq!(page.evaluate(rows), json!([["summer@1", false], ["winter@1", false]]));
    page.assert_calm();
}

#[test]
fn sources_that_differ_stand_side_by_side_at_the_number() {
    const FORCE: &str = "#field-force-specific_cutting_force_n_per_mm2";
    let Some((_turn, mut page, service)) = both() else { return };
    let force =
        "{\"kind\":\"kienzle\",\"normal_force\":\"judged\",\"cutting_edge_angle_deg\":95,\"nose_radius_mm\":0.8}";
    page.open(&service.page(&format!("deflection-compensation?example=paper&/force={force}&/material=\"42crmo4\"")));
    page.until(&format!("{SETTLED} && document.querySelector('{FORCE}')?.placeholder"));
    page.click(&format!(".row:has({FORCE}) .origin-mark"));
    page.wait_for(".sources [data-used]");
    let said = page.evaluate("fetch('/v1/materials/42crmo4').then(said => said.json())");
    let sources = said["force_sources"].as_array().unwrap();
    let shown = page.evaluate("[...document.querySelectorAll('.sources tr')].map(row => row.textContent)");
    let shown: Vec<&str> = shown.as_array().unwrap().iter().map(|row| row.as_str().unwrap()).collect();
    assert!(sources.len() >= 2 && shown.len() == sources.len(), "{shown:?}");
    for (row, source) in shown.iter().zip(sources) {
        assert!(row.contains(source["source"].as_str().unwrap()), "{row}");
        assert_eq!(row.contains("used here"), source["preferred"] == true, "{row}");
    }
    crate::access::assert_accessible(&mut page, "sources side by side");
    page.assert_calm();
}
